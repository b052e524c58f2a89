"""What is wrong throughout is told beside an answer; only what is still to be stated takes its verdict."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from bfi_cli.notes import Note
from bfi_cli.plausibility import Implausible, with_plausibility


@dataclass(frozen=True)
class Answer:
    """The fields of an answer that this is about."""

    decision: str
    verdicts: dict[str, str]
    faults: tuple[str, ...] = ()
    summary: str = "what the log says"
    notes: tuple[Note, ...] = ()
    plausibility: tuple[Implausible, ...] = ()


def finding(what: str, channel: str, offset: float = 0.0, *, fixed: bool = False, rivals: tuple[str, ...] = ()):
    return Implausible(
        channels=(channel,),
        what=what,  # type: ignore[arg-type]
        unit="",
        factor=1.0,
        offset=offset,
        agrees_with=("pitch", "tas"),
        relative_misfit=0.0,
        rivals=rivals,
        text=f"{channel} errs",
        advice=f"check {channel}",
        fixed=fixed,
    )


NOTHING = Answer("no_fault", {"abrupt": "no_fault", "slow": "no_fault"})
FAULT = Answer("fault", {"abrupt": "fault", "slow": "no_fault"}, faults=("bias",))


@pytest.mark.parametrize(
    ("one", "excludes", "declares"),
    [
        (finding("offset", "aoa", 0.11), True, True),
        (finding("offset", "pitch", 0.11, rivals=("aoa",)), True, True),
        (finding("offset", "pitch_rate", -0.05, fixed=True), True, True),
        (finding("offset", "pitch", 0.11, rivals=("tas",)), False, True),
        (finding("offset", "aoa", 0.3), False, True),
        (finding("offset", "tas", 10.0, fixed=True), False, True),
        (finding("scale", "tas"), False, True),
        (finding("unrelated", "aoa", fixed=True), False, True),
        (finding("impossible", "aoa", fixed=True), True, True),
        (finding("unit", "tas", fixed=True), True, True),
        (finding("unit", "tas"), False, False),
        (finding("sign", "aoa"), False, False),
        (finding("clock", "time"), False, False),
    ],
)
def test_a_verdict_beside_what_is_wrong_throughout(one: Implausible, excludes: bool, declares: bool):
    nothing, fault = (with_plausibility(answer, [one]) for answer in (NOTHING, FAULT))
    assert nothing.plausibility == fault.plausibility == (one,)
    assert ("no_fault" in {nothing.decision, *nothing.verdicts.values()}) == excludes
    assert nothing.decision == ("no_fault" if excludes else "inconclusive")
    assert (fault.decision, fault.faults) == (("fault", ("bias",)) if declares else ("inconclusive", ()))
    assert nothing.summary.startswith("check ") != excludes


def test_without_findings_an_answer_is_as_it_is():
    assert with_plausibility(NOTHING, []) == NOTHING
