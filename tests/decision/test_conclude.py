"""One conclusion of several sources: what one declares, what another refutes, and the smallest of their limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from noted import texts

from bfi_cli.decision import (
    KINDS,
    WITHHELD,
    Candidate,
    Evidence,
    Manoeuvre,
    OnsetBound,
    at_entries,
    beyond_tolerance,
    candidate_of,
    conclude,
)
from bfi_cli.faults import Fault, FaultEstimate
from bfi_cli.flight.plausibility import Implausible


def estimate(shape: str = "bias", onset_s: float = 50.0, **changes: Any) -> FaultEstimate:
    parameters = {key: changes.pop(key) for key in ("duration_s", "time_constant_s") if key in changes}
    return FaultEstimate(
        name=shape,
        fault=Fault(shape=shape, channel="tas", onset_s=onset_s, **parameters),
        magnitude=3.0,
        unit="m/s",
        physical_value=3.0,
        physical_unit="m/s",
        sd=0.1,
        ci95=(2.8, 3.2),
        **{"onset_ci95": (onset_s - 0.5, onset_s + 0.5), "statistic": 100.0, "effect": 3.0, **changes},
    )


def candidate(kind: str, effect: float | None, state: str | None = None, **changes: Any) -> Candidate:
    shape = {"abrupt": "bias", "oscillating": "sine", "slow": "drift"}[kind]
    tolerance = 2.0
    excluded = effect is not None and effect <= tolerance
    return Candidate(
        name=shape,
        shape=shape,
        channel="tas",
        kind=kind,  # type: ignore[arg-type]
        state=state or ("excluded" if excluded else "not_seen"),  # type: ignore[arg-type]
        magnitude=None,
        unit="m/s",
        sd=None,
        effect=effect,
        tolerance=tolerance,
        channel_unit="m/s",
        **changes,
    )


QUIET = tuple(candidate(kind, 1.0) for kind in KINDS)


def test_sources_without_a_fault_that_exclude_all_kinds_say_no_fault():
    said = conclude([Evidence(source="scan", candidates=QUIET)], KINDS)
    assert (said.decision, said.faults, texts(said.notes)) == ("no_fault", (), ())


@pytest.mark.parametrize("source", [0, 1])
def test_a_fault_of_either_source_decides_whatever_the_other_excludes_of_other_kinds(source):
    sources = [Evidence(source="scan", candidates=QUIET), Evidence(source="physics")]
    sources[source] = replace(sources[source], faults=(estimate(),))
    said = conclude(sources, ["slow"])
    assert (said.decision, said.verdicts["abrupt"], said.verdicts["oscillating"]) == ("fault", "fault", "no_fault")
    assert said.faults[0].evidence == {sources[source].source: 100.0}


def test_what_two_sources_declare_at_one_time_is_named_by_the_one_with_more_evidence():
    step, ramp = estimate(), estimate("ramp_hold", 47.0, duration_s=6.0, statistic=150.0)
    said = conclude([Evidence(source="scan", faults=(step,)), Evidence(source="physics", faults=(ramp,))], KINDS)
    (fault,) = said.faults
    assert (fault.fault.shape, fault.source, fault.evidence) == (
        "ramp_hold",
        "physics",
        {"physics": 150.0, "scan": 100.0},
    )


def test_faults_of_one_source_and_faults_apart_in_time_stay_apart():
    first, second, later = estimate(), estimate("sine"), estimate(onset_s=80.0)
    said = conclude(
        [Evidence(source="scan", faults=(first, second)), Evidence(source="physics", faults=(later,))], KINDS
    )
    assert [one.fault.onset_s for one in said.faults] == [50.0, 50.0, 80.0]


def test_an_entry_at_a_stated_onset_keeps_its_name():
    stated = estimate(statistic=None, onset_ci95=None)
    said = conclude(
        [Evidence(source="scan", faults=(estimate(),)), Evidence(source="dictionary", faults=(stated,))], KINDS
    )
    assert [one.source for one in said.faults] == ["dictionary"]


def test_two_slow_faults_of_one_channel_are_one():
    one, other = estimate("drift", 30.0), estimate("drift", 60.0, statistic=20.0)
    said = conclude([Evidence(source="scan", faults=(one,)), Evidence(source="physics", faults=(other,))], KINDS)
    assert [fault.fault.onset_s for fault in said.faults] == [30.0]


@pytest.mark.parametrize(("limit", "declared"), [(2.9, False), (3.1, True)])
def test_a_slow_fault_that_another_source_excludes_is_suspected(limit, declared):
    drift = estimate("drift", effect=3.0)
    own = candidate("slow", None, "declared")
    sources = [
        Evidence(source="scan", faults=(drift,), candidates=(own, *QUIET[:2])),
        Evidence(source="physics", candidates=(candidate("slow", limit),)),
    ]
    said = conclude(sources, KINDS)
    assert bool(said.faults) == declared
    assert said.candidates[0].state == ("declared" if declared else "suspected")
    assert said.verdicts["slow"] == ("fault" if declared else "inconclusive")
    assert len(texts(said.notes)) == (not declared)


@pytest.mark.parametrize(("onset_s", "declared"), [(50.3, False), (30.0, True)])
def test_what_an_entry_excludes_at_its_onset_says_nothing_of_another(onset_s: float, declared: bool):
    drift = estimate("drift", effect=3.0)
    sources = [
        Evidence(source="dictionary", candidates=(candidate("slow", 1.0, onset_s=onset_s),)),
        Evidence(source="scan", faults=(drift,), candidates=(candidate("slow", None, "declared"),)),
    ]
    assert bool(conclude(sources, KINDS).faults) == declared


def test_the_smallest_limit_of_a_slow_error_counts_for_all_sources():
    loose, tight = candidate("slow", 20.0, excluded_above=0.2), candidate("slow", 1.5)
    sources = [Evidence(source="scan", candidates=(loose, *QUIET[:2])), Evidence(source="physics", candidates=(tight,))]
    said = conclude(sources, KINDS)
    assert said.decision == "no_fault"
    first = said.candidates[0]
    assert (first.state, first.effect, first.excluded_above) == ("excluded", 1.5, pytest.approx(0.015))


def test_a_limit_bounds_no_step():
    step, slow = candidate("abrupt", 20.0), candidate("slow", 1.0)
    said = conclude(
        [Evidence(source="scan", candidates=(step,)), Evidence(source="physics", candidates=(slow,))], KINDS
    )
    assert said.candidates[0].effect == 20.0


@pytest.mark.parametrize(
    ("effect", "sd", "expected"),
    [(1.0, 0.1, False), (4.0, 0.1, True), (2.0, 0.1, None), (1.9, 2.0, None), (1.0, float("nan"), None)],
)
def test_an_error_is_beyond_the_tolerance_where_its_whole_interval_is(effect, sd, expected):
    assert beyond_tolerance(effect, 3.0, sd, 2.0) is expected
    assert beyond_tolerance(effect, -3.0, sd, 2.0) is expected


def test_without_a_tolerance_nothing_is_beyond_it():
    assert beyond_tolerance(1.0, 3.0, 0.1, None) is None


def test_a_frozen_sensor_is_declared_and_tells_of_no_other_fault_of_its_channel():
    frozen = estimate("frozen", effect=None)
    other = replace(QUIET[0], channel="aoa")
    said = conclude(
        [Evidence(source="scan", candidates=(*QUIET, other)), Evidence(source="physics", faults=(frozen,))], KINDS
    )
    assert [one.name for one in said.faults] == ["frozen"]
    assert [(one.channel, one.state) for one in said.candidates] == [("tas", "not_seen")] * 3 + [("aoa", "excluded")]
    assert said.verdicts == {"abrupt": "inconclusive", "oscillating": "inconclusive", "slow": "fault"}


@pytest.mark.parametrize(("onset_s", "names"), [(50.0, ["frozen"]), (80.0, ["frozen"]), (20.0, ["bias", "frozen"])])
def test_what_seems_to_begin_on_a_channel_whose_reading_is_held_is_no_fault_of_its_own(onset_s, names):
    step = estimate(onset_s=onset_s, statistic=900.0)
    said = conclude(
        [Evidence(source="dictionary", faults=(step,)), Evidence(source="physics", faults=(estimate("frozen"),))],
        KINDS,
    )
    assert [one.name for one in said.faults] == names


STALL = Evidence(
    source="phases", manoeuvres=(Manoeuvre(name="stall", from_s=40.0, to_s=45.0, beside_s=10.0),), faults=()
)


@pytest.mark.parametrize("onset_s", [46.0, 58.0])
def test_what_a_model_makes_of_a_line_that_leaks_is_no_second_fault(onset_s):
    """The course of a leak is no step, ramp or drift: what fits it begins somewhere in it, with more evidence."""
    ramp = estimate("ramp_hold", onset_s, duration_s=20.0, statistic=300.0)
    leak = estimate("static_leak", 45.0, time_constant_s=20.0, statistic=5.0, effect=None)
    said = conclude([Evidence(source="scan", faults=(ramp,)), Evidence(source="physics", faults=(leak,))], KINDS)
    assert [(one.name, one.evidence) for one in said.faults] == [("static_leak", {"physics": 5.0, "scan": 300.0})]
    before = estimate("bias", 20.0)
    said = conclude([Evidence(source="scan", faults=(before,)), Evidence(source="physics", faults=(leak,))], KINDS)
    assert [one.name for one in said.faults] == ["bias", "static_leak"]


@pytest.mark.parametrize("source", ["scan", "dictionary"])
@pytest.mark.parametrize(("onset_s", "decision"), [(29.0, "fault"), (31.0, "inconclusive"), (56.0, "fault")])
def test_what_a_model_declares_in_or_beside_a_manoeuvre_is_suspected(source: str, onset_s: float, decision: str):
    model = Evidence(
        source=source, faults=(estimate(onset_s=onset_s),), candidates=(candidate("abrupt", None, "declared"),)
    )
    said = conclude([model, STALL], ["abrupt"])
    assert said.decision == decision
    assert said.candidates[0].state == ("declared" if decision == "fault" else "suspected")
    if decision != "fault":
        (note,) = texts(said.notes)
        assert note.endswith("it begins within 10 s of a stall (40 to 45 s), which no linear model follows")


def test_what_needs_no_model_is_declared_in_a_manoeuvre_too():
    physics = Evidence(source="physics", faults=(estimate(onset_s=42.0),))
    held = Evidence(source="scan", faults=(estimate("frozen", 42.0),))
    for one in (physics, held):
        assert conclude([one, STALL], KINDS).decision == "fault"


def test_a_second_fault_of_the_same_kind_stays_declared_where_the_first_is_refuted():
    """Of entries each has its own state; of a kind at any onset one that stands is enough."""
    first, second = replace(estimate(onset_s=42.0), name="early"), replace(estimate(onset_s=80.0), name="late")
    declared = candidate("abrupt", None, "declared")
    entries = tuple(replace(declared, name=one.name, onset_s=one.fault.onset_s) for one in (first, second))
    of_entries = Evidence(source="dictionary", faults=(first, second), candidates=entries)
    said = conclude([of_entries, STALL], KINDS)
    assert [one.name for one in said.faults] == ["late"]
    assert [one.state for one in said.candidates] == ["suspected", "declared"]
    of_kind = Evidence(source="scan", faults=(first, second), candidates=(declared,))
    assert [one.state for one in conclude([of_kind, STALL], KINDS).candidates] == ["declared"]


# What a search finds at an entry of a dictionary is that entry; what it finds elsewhere keeps its own name.

STEP = Fault(name="step", shape="bias", channel="tas", onset_s=50.0)
LATER = Fault(name="later", shape="bias", channel="tas", onset_s=80.0)


def entry(fault: Fault, **changes: Any) -> Candidate:
    return candidate_of(fault, "m/s", onset_s=fault.onset_s, tolerance=2.0, **changes)


def at(fault: FaultEstimate, *entries: Fault, declared: tuple[str, ...] = ()) -> tuple[dict[str, str | None], Evidence]:
    """Return the states of the entries by name, and the evidence of the search."""
    candidates = tuple(entry(one, declared=one.name in declared) for one in entries)
    stated = Evidence(source="dictionary", candidates=candidates)
    kind = {"sine": "oscillating", "drift": "slow"}.get(fault.fault.shape, "abrupt")
    found = replace(candidate(kind, None, "declared"), shape=fault.fault.shape)
    search = Evidence(source="scan", faults=(fault,), candidates=(found,))
    stated, search = at_entries(stated, search, entries, rate_hz=10.0, duration_s=60.0)
    return {one.name: one.state for one in stated.candidates}, search


def test_a_fault_at_an_entry_is_that_entry():
    states, search = at(estimate(), STEP, LATER)
    assert states == {"step": "declared", "later": "not_seen"}
    assert (search.faults[0].name, search.faults[0].fault.name, search.candidates) == ("step", "step", ())
    said = conclude([Evidence(source="dictionary", candidates=(entry(STEP, declared=True),)), search], KINDS)
    assert [one.name for one in said.faults] == ["step"]
    assert [one.state for one in said.candidates] == ["declared"]


@pytest.mark.parametrize(
    ("fault", "other"),
    [
        (estimate(onset_s=60.0), STEP),
        (estimate("drift"), STEP),
        (estimate(), replace(STEP, channel="cas")),
        (estimate(), Fault(name="water", shape="sine", channel="tas", onset_s=50.0, frequency_hz=0.4)),
    ],
)
def test_a_fault_elsewhere_keeps_its_name(fault: FaultEstimate, other: Fault):
    states, search = at(fault, other)
    assert states == {other.name: "not_seen"}
    assert search.faults == (fault,)
    assert len(search.candidates) == 1


@pytest.mark.parametrize(("frequency_hz", "is_entry"), [(0.4, True), (0.405, True), (0.42, False)])
def test_an_oscillation_has_the_frequency_of_its_entry_as_far_as_the_window_resolves(
    frequency_hz: float, is_entry: bool
):
    water = Fault(name="water", shape="cosine", channel="tas", onset_s=50.0, frequency_hz=0.4)
    found = estimate("sine")
    found = replace(found, fault=replace(found.fault, frequency_hz=frequency_hz))
    states, _ = at(found, water)
    assert states == {"water": "declared" if is_entry else "not_seen"}


def test_an_entry_is_found_once_and_the_nearest_onset_names():
    near = replace(STEP, name="near", onset_s=50.3)
    assert at(estimate(), near, STEP)[0] == {"near": "not_seen", "step": "declared"}
    assert at(estimate(), STEP, declared=("step",))[1].faults[0].name == "step"


def test_a_slope_that_the_entry_states_is_its_measure():
    drift = Fault(name="drift_50", shape="drift", channel="tas", slope=0.5, onset_s=50.0)
    found = replace(estimate("drift"), magnitude=1.0, physical_value=1.0, physical_unit="m/s^2", sd=0.1)
    search = Evidence(source="scan", faults=(found,))
    stated = Evidence(source="dictionary", candidates=(entry(drift),))
    stated, _ = at_entries(stated, search, [drift], rate_hz=10.0, duration_s=60.0)
    (known,) = stated.candidates
    assert (known.magnitude, known.sd, known.state) == (2.0, 0.2, "declared")


def test_an_entry_whose_fault_is_refuted_is_suspected():
    drift = Fault(name="slow", shape="drift", channel="tas", onset_s=50.0)
    found = replace(estimate("drift", effect=9.0), name="slow")
    bounds = Evidence(source="physics", candidates=(candidate("slow", 1.0),))
    said = conclude(
        [
            Evidence(source="dictionary", candidates=(entry(drift, declared=True),)),
            Evidence(source="scan", faults=(found,)),
            bounds,
        ],
        KINDS,
    )
    assert said.faults == ()
    assert said.candidates[0].state == "suspected"


# What is wrong throughout is told beside an answer; only what is still to be stated takes its verdict.


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
    beside = Evidence(source="arithmetic", findings=(one,))
    quiet = Evidence(source="scan", candidates=QUIET)
    nothing = conclude([quiet, beside], KINDS)
    fault = conclude([replace(quiet, faults=(estimate(),)), beside], KINDS)
    assert nothing.plausibility == fault.plausibility == (one,)
    assert ("no_fault" in {nothing.decision, *nothing.verdicts.values()}) == excludes
    assert nothing.decision == ("no_fault" if excludes else "inconclusive")
    assert (fault.decision, len(fault.faults)) == (("fault", 1) if declares else ("inconclusive", 0))
    assert fault.is_withheld != declares
    assert nothing.summary.startswith("check ") != excludes


def test_what_would_be_declared_is_suspected_while_channels_contradict_each_other():
    declared = Evidence(source="scan", faults=(estimate(),), candidates=(candidate("abrupt", None, "declared"),))
    said = conclude([declared, Evidence(source="arithmetic", findings=(finding("unit", "tas"),))], KINDS)
    assert [(one.state, one.note) for one in said.candidates] == [("suspected", WITHHELD)]
    assert texts(said.notes) == (f"what would be declared is {WITHHELD}: bias",)


def test_a_method_that_fails_or_fires_decides():
    declared = Evidence(source="dictionary", faults=(estimate(),), candidates=QUIET)
    failed = conclude([declared], KINDS, failed="no solution", fires=True)
    assert (failed.decision, set(failed.verdicts.values()), failed.summary) == (
        "inconclusive",
        {"inconclusive"},
        "no solution",
    )
    assert conclude([replace(declared, faults=())], KINDS, fires=True).decision == "fault"


def bound(*errors: float, channel: str = "tas") -> OnsetBound:
    """Return a bound of steps that begin at 0, 1, 2 ... s."""
    return OnsetBound(channel=channel, onsets_s=np.arange(len(errors), dtype=float), errors=np.array(errors))


def test_a_bound_holds_between_its_onsets_and_not_beyond_them():
    steps = bound(5.0, 1.0, 2.0, 3.0, 9.0)
    assert steps.over(((1.0, 3.0),), None) == (3.0, ((1.0, 3.0),))
    assert steps.over(((1.5, 1.6),), None)[0] == 2.0  # the worse of both neighbours
    assert steps.over(((0.5, 1.0), (2.0, 3.0)), None)[0] == 5.0
    assert steps.over(((1.0, 4.5),), None)[0] == math.inf
    assert steps.over(((-0.5, 1.0),), None)[0] == math.inf


def test_a_bound_within_the_tolerance_at_most_onsets_is_that_of_these():
    errors = [1.0] * 60
    errors[30], errors[40] = 4.0, 1.9
    spans_s = ((1.0, 58.0),)
    assert bound(*errors).over(spans_s, 2.0) == (1.9, ((1.0, 29.0), (31.0, 58.0)))
    assert bound(*errors).over(spans_s, 5.0) == (4.0, spans_s)
    errors[10:13] = [4.0] * 3  # with that more than a twentieth
    assert bound(*errors).over(spans_s, 2.0) == (4.0, spans_s)


@pytest.mark.parametrize(
    ("changes", "state", "effect"),
    [
        ({"onsets_checked": ((2.0, 7.0),)}, "excluded", 1.5),
        ({"onset_s": 5.0}, "excluded", 1.5),
        ({"onsets_checked": ((2.0, 70.0),)}, "not_seen", 3.0),
        ({"channel": "cas", "onset_s": 5.0}, "not_seen", 3.0),
        ({"shape": "decaying_bias", "onset_s": 5.0}, "not_seen", 3.0),
        ({"state": "suspected", "onset_s": 5.0}, "suspected", 3.0),
        ({}, "not_seen", 3.0),
    ],
)
def test_a_step_is_excluded_by_a_bound_of_another_source_at_its_onsets(changes, state, effect):
    step = replace(candidate("abrupt", 3.0, excluded_above=3.0, seen_above=4.0), **changes)
    sources = [Evidence(source="scan", candidates=(step,)), Evidence(source="physics", bounds=(bound(*[1.5] * 10),))]
    (said,) = conclude(sources, KINDS).candidates
    assert (said.state, said.effect, said.excluded_above, said.seen_above) == (state, effect, effect, 4.0)


def test_a_step_that_a_bound_excludes_at_most_onsets_is_checked_at_these():
    errors = [1.5] * 40
    errors[20] = 2.5
    step = candidate("abrupt", 3.0, onsets_checked=((1.0, 38.0),))
    sources = [Evidence(source="scan", candidates=(step,)), Evidence(source="physics", bounds=(bound(*errors),))]
    (said,) = conclude(sources, KINDS).candidates
    assert (said.state, said.onsets_checked) == ("excluded", ((1.0, 19.0), (21.0, 38.0)))
    (smaller,) = conclude([replace(sources[0], candidates=(replace(step, effect=1.0),)), sources[1]], KINDS).candidates
    assert (smaller.effect, smaller.onsets_checked) == (1.0, step.onsets_checked)


def test_an_oscillation_since_the_start_is_suspected_where_a_model_excludes_later_ones():
    scan = Evidence(source="scan", candidates=QUIET)
    physics = Evidence(source="physics", since_start={"tas": "tas against mach oscillates"})
    said = conclude([scan, physics], KINDS)
    assert (said.decision, said.verdicts["abrupt"], said.verdicts["oscillating"]) == (
        "inconclusive",
        "no_fault",
        "inconclusive",
    )
    (suspect,) = (one for one in said.candidates if one.state == "suspected")
    assert (suspect.kind, suspect.note) == ("oscillating", "tas against mach oscillates")
    other = replace(physics, since_start={"cas": "cas against mach oscillates"})
    assert conclude([scan, other], KINDS).decision == "no_fault"
