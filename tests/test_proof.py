"""What limits are worth on the log itself: which sighting counts, what is kept, and the same document by every road."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bfi_cli import Config, merge, read_log, start_time
from bfi_cli import proof as proving_module
from bfi_cli.decision import Proof
from bfi_cli.errors import ConfigError, LogError
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.faults.shapes import Kind
from bfi_cli.journal import Journal, lines_of_journal
from bfi_cli.model.onset import OnsetResult, onset_content, onset_document
from bfi_cli.model.onset.report import onset_from_document
from bfi_cli.proof import JOURNAL, Proving, Sighting, flight_claims, sees, sightings_of
from bfi_cli.quantities.text import SI
from bfi_cli.report.first_screen import proof_in_words
from bfi_cli.serialization import from_plain, provenance, to_plain

DATA = Path(__file__).parents[1] / "data"
COARSE: dict[str, Any] = {"conditioning.rate_hz": 4.0, "model.order": 2}
QUICK = {**COARSE, "start_time.shapes": ["bias"]}
QUICKLY = ("--rate", "4", "--order", "2", "--shape", "bias")
PROOF = Proof(kind="abrupt", channel="tas", size=0.3, unit="m/s", n_seen=19, n_added=20)
STEP = Fault(shape="bias", channel="tas", onset_s=10.0)
LAG = Fault(shape="lagged_bias", channel="tas", onset_s=10.0, time_constant_s=2.0)


def sighting(*kinds: Kind, name: str = "tas", onset_s: tuple[float, float] | None = None) -> Sighting:
    return Sighting(kinds=frozenset(kinds or ("abrupt",)), names=frozenset([name]), onset_s=onset_s)


@pytest.mark.parametrize(
    ("fault", "seen", "counts"),
    [
        (STEP, sighting(onset_s=(9.0, 11.0)), True),
        (STEP, sighting(onset_s=(10.2, 11.0)), False),
        (STEP, sighting(onset_s=(10.05, 11.0)), True),  # within the slack
        (STEP, sighting(onset_s=(8.0, 9.5)), False),
        (STEP, sighting(), True),  # suspected, with no onset of its own
        (STEP, sighting("slow"), False),
        (STEP, sighting("slow", "abrupt"), True),  # a drift that may be a step
        (STEP, sighting(name="aoa"), False),
        (LAG, sighting(onset_s=(13.0, 14.0)), True),  # a step while it builds up, in 4.6 s
        (LAG, sighting(onset_s=(15.0, 16.0)), False),
    ],
)
def test_what_counts_as_seen(fault: Fault, seen: Sighting, counts: bool):
    assert sees([seen], "abrupt", "tas", fault, slack_s=0.1) is counts


def test_a_suspicion_that_the_log_raised_before_counts_for_nothing(monkeypatch: pytest.MonkeyPatch):
    log = read_log(DATA / "citation_clean.h5")
    suspicion = sighting()
    monkeypatch.setattr(proving_module, "sightings_of", lambda _: (suspicion,))
    trial = proving_module.Trial(claim=0, fault=STEP)
    shared: dict[str, Any] = {
        "log": log,
        "analyse": lambda log: log,
        "response": proving_module.response_of((), log.rate_hz),
        "claims": [("abrupt", "tas")],
        "quanta": {},
        "slack_s": 0.1,
    }
    assert proving_module.finds(trial, before=(suspicion,), **shared) is False
    assert proving_module.finds(trial, before=(), **shared) is True


def test_a_fault_that_cannot_be_added_is_not_counted_and_an_analysis_that_fails_has_not_seen_it():
    log = read_log(DATA / "citation_clean.h5")

    def fails(_log: object) -> Any:
        raise LogError("no log")

    shared: dict[str, Any] = {
        "log": log,
        "analyse": fails,
        "response": proving_module.response_of((), log.rate_hz),
        "before": (),
        "claims": [("abrupt", "tas")],
        "quanta": {},
        "slack_s": 0.1,
    }
    late = replace(STEP, onset_s=1e6)
    trials = [proving_module.Trial(claim=0, fault=fault) for fault in (STEP, late)]
    seen = [proving_module.finds(trial, **shared) for trial in trials]
    assert seen == [False, None]
    claim = SimpleNamespace(kind="abrupt", channel="tas", size=1.0, unit="m/s")
    (proof,) = proving_module.proofs_of([claim], trials, seen)  # type: ignore[list-item]
    assert (proof.n_seen, proof.n_added) == (0, 1)


def test_a_step_has_a_size_of_whole_quanta_no_smaller_than_is_stated():
    step = replace(STEP, magnitude=-0.042)
    assert proving_module._in_whole_steps(step, 0.03).magnitude == pytest.approx(-0.06)
    assert proving_module._in_whole_steps(replace(step, magnitude=0.06), 0.03).magnitude == pytest.approx(0.06)
    assert proving_module._in_whole_steps(step, None) is step
    assert proving_module._in_whole_steps(LAG, 0.03) is LAG


def test_a_drift_keeps_its_error_after_the_window():
    window = start_time(read_log(DATA / "citation_clean.h5"), merge(Config(), QUICK)).log
    drift = replace(STEP, shape="drift", magnitude=1.0)
    added = proving_module._with_error(drift, -2.0, window)
    assert added is not None
    assert (added.shape, added.onset_s) == ("ramp_hold", drift.onset_s)
    signal = added.magnitude * unit_signal(added, np.array([window.stop_s, 1e4]), window_start_s=0.0)
    assert signal == pytest.approx([-2.0, -2.0])


def test_entries_of_a_document_are_read_back():
    entry = {"kind": "abrupt", "channel": "tas", "size": 0.3, "unit": "m/s", "found": 19, "of": 20}
    assert to_plain([PROOF]) == [entry]
    assert from_plain(tuple[Proof, ...], [entry], where="result: proved") == (PROOF,)
    without = {key: value for key, value in entry.items() if key != "found"}
    with pytest.raises(ConfigError, match=r"result: proved\[0\]: no key 'found'"):
        from_plain(tuple[Proof, ...], [without], where="result: proved")


def test_the_sentence_names_the_channel_where_there_are_several():
    assert proof_in_words([PROOF], SI) == ["19 of 20 steps of 0.3 m/s added to this log"]
    two = [PROOF, replace(PROOF, channel="pitot_icing")]
    assert proof_in_words(two, SI)[0] == "19 of 20 steps of 0.3 m/s on true airspeed added to this log"
    assert "on pitot icing" in proof_in_words(two, SI)[1]


def test_a_journal_keeps_whole_lines_and_leaves_a_torn_one_out(tmp_path: Path):
    path = tmp_path / JOURNAL
    origin = json.loads(json.dumps({"version": "0"}))
    with Journal(path, {"kind": "start-time", "provenance": origin}) as journal:
        journal.add({"is_seen": True})
    with path.open("a") as file:
        file.write('{"is_seen": fa')
    assert lines_of_journal(path)[1:] == [{"is_seen": True}]
    assert lines_of_journal(tmp_path / "none") == []


@pytest.fixture(scope="module", autouse=True)
def few() -> Iterator[None]:
    """Add two faults of each kind."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proving_module, "ADDED", 2)
        yield


@pytest.fixture(scope="module")
def whole(few: None) -> OnsetResult:
    """Return the answer of a log without a fault, whose limits are tried."""
    return start_time(read_log(DATA / "citation_clean.h5"), merge(Config(), QUICK), prove=True)


def test_a_stopped_proof_continues_and_ends_the_same(
    whole: OnsetResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    log, config = read_log(DATA / "citation_clean.h5"), merge(Config(), QUICK)
    assert {proof.n_added for proof in whole.proved} == {2}
    analysed: list[Fault] = []
    finds = proving_module.finds

    def counted(trial: Any, **shared: Any) -> bool | None:
        if len(analysed) == 1 and stops:
            raise KeyboardInterrupt
        analysed.append(trial.fault)
        return finds(trial, **shared)

    monkeypatch.setattr(proving_module, "finds", counted)
    stops = True
    with pytest.raises(KeyboardInterrupt):
        start_time(log, config, prove=Proving(out=tmp_path))
    stops = False
    continued = start_time(log, config, prove=Proving(out=tmp_path))
    assert continued.proved == whole.proved
    n_trials = sum(proof.n_added for proof in whole.proved)
    assert len(analysed) == n_trials
    start_time(log, merge(config, {"seed": 1}), prove=Proving(out=tmp_path))  # another proof begins anew
    assert len(analysed) == 2 * n_trials


def test_the_command_counts_what_the_call_counts(whole: OnsetResult, bfi: Callable):
    path = DATA / "citation_clean.h5"
    outcome = bfi("start-time", path, *QUICKLY, "--prove", "--workers", "1", "--json")
    assert outcome.code == 0
    document = onset_document(whole, provenance(log_sha256=""))
    proved = json.loads(outcome.stdout)["proved"]
    assert proved == document["proved"]
    assert all(0 <= entry["found"] <= entry["of"] == 2 for entry in proved)
    assert onset_from_document(document).proved == whole.proved
    assert "proved" not in onset_document(replace(whole, proved=()), provenance(log_sha256=""))
    content = onset_content(document)
    assert any(table.name == "proved" and len(table.rows) == len(proved) for table in content.tables)
    assert content.screen is not None
    assert "Would have been found" in content.screen.lines


def test_what_is_added_lies_where_the_answer_claims_something_and_not_at_a_declared_fault():
    config = merge(Config(), COARSE)
    result = start_time(read_log(DATA / "citation_bias.csv"), config)
    claims = proving_module.window_claims(result, config)
    before = sightings_of(result)
    trials = list(proving_module.drawn_trials(claims, before, np.random.default_rng(0)))
    assert trials
    for trial in trials:
        claim = claims[trial.claim]
        spans = [
            span
            for candidate in result.candidates
            if (candidate.shape, candidate.channel) == (trial.fault.shape, trial.fault.channel)
            for span in candidate.onsets_checked or ()
        ]
        assert any(first_s <= trial.fault.onset_s <= last_s for first_s, last_s in spans)
        assert not sees(before, claim.kind, claim.channel, trial.fault)
        signal = trial.fault.magnitude * unit_signal(trial.fault, result.time_s, window_start_s=result.log.start_s)
        assert np.abs(signal).max() == pytest.approx(claim.size, rel=0.01)


def test_a_fault_of_a_flight_has_its_seconds_within_what_was_watched():
    """What would be seen within a minute is no promise for the last half minute of a flight."""
    limit = SimpleNamespace(fault="tas", shape="drift", holds_in=0.95, seen_above=0.1, seen_within_s=60.0, unit="m/s^2")
    looks = [SimpleNamespace(from_s=100.0, to_s=220.0), SimpleNamespace(from_s=160.0, to_s=280.0)]
    summary = SimpleNamespace(start_s=0.0, stop_s=1000.0)
    result: Any = SimpleNamespace(limits=[limit], windows=looks, log=summary, unwatched=[(100.0, 130.0, "")])
    log: Any = SimpleNamespace(find=lambda name: name)
    (claim,) = flight_claims(result, log)
    rng = np.random.default_rng(0)
    drawn = [fault for _ in range(500) if (fault := claim.draw(rng)) is not None]
    assert len(drawn) > 20
    assert all(130.0 < fault.onset_s <= 220.0 for fault in drawn)
    assert all(abs(fault.magnitude) == pytest.approx(6.0) for fault in drawn)
