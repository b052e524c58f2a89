"""Limits of a diagnosis: no fault above a limit goes unseen, and every half minute of flight is watched or named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_events import event_of

from bfi_cli.config import Config
from bfi_cli.decision import KINDS, conclude, decide
from bfi_cli.flight import DiagnoseResult, FlightLimit, diagnose_flight
from bfi_cli.flight.flight import Flight, flight_of
from bfi_cli.flight.limits import (
    BIN_S,
    EXCEEDED_BY,
    Hidden,
    bounds_of,
    hidden_slopes,
    limit_courses,
    limits_of,
)
from bfi_cli.flight.looks import Scanned, rate_of, scan_flight, thresholds_of
from bfi_cli.flight.parity import LENGTHS_S, ScanKey, shipped_tables
from bfi_cli.flight.parity.holds import UnseenLine
from bfi_cli.flight.parity.record import STATIC_LEAK
from bfi_cli.flight.result import Event
from bfi_cli.flight.unwatched import Unwatched, flown_of, unwatched_by_lines, unwatched_by_steps
from bfi_cli.flight.verdict import evidence_of, sentence_of
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.phases import Phase
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels import ONE_SIDED_95
from bfi_cli.kernels.runs import left_of

AIRSPEEDS = ("tas", "cas", "mach")
RATES = dict.fromkeys(LENGTHS_S, 0.01)
KEY = ScanKey(residuals=("lift",), length_s=120.0, knows_zero_lift=True)


@pytest.fixture(scope="module")
def flight(journey: FlightLog) -> Flight:
    config = Config.model_validate({"window": {"from_s": 240.0, "to_s": 700.0}})
    names = ("tas", "cas", "altitude", "altitude_rate", "aoa", "pitch", "roll", "normal_acc", "velocity_north")
    channels = {name: journey.channels[name] for name in (*names, "velocity_east", "longitudinal_acc")}
    return flight_of(replace(journey, channels=channels), config)


def span(from_s: float, to_s: float, size: float, *, tolerance: float = 3.0, scale: float = 1.0, step: float = 10.0):
    onsets_s = np.arange(from_s + step, to_s - 20.0 + 1e-6, step)
    sizes = np.full(len(onsets_s), size)
    return Hidden(
        fault="tas",
        shape="drift",
        channel="tas",
        unit="m/s^2",
        bounds="error",
        window=(from_s, to_s),
        onsets_s=onsets_s,
        sizes=sizes,
        declared=2.0 * sizes,
        spreads=sizes,
        scale=scale,
        tolerance=tolerance,
    )


def bounds(windows: list[Hidden], **changes: Any) -> list[Hidden]:
    return [replace(hidden, **changes) for hidden in windows]


def row(**changes: Any) -> FlightLimit:
    values: dict[str, Any] = {
        "fault": "tas",
        "shape": "drift",
        "channel": "tas",
        "bounds": "error",
        "holds_in": 1.0,
        "grows_on": False,
        "excluded_above": 0.02,
        "unit": "m/s^2",
        "effect": 2.0,
        "effect_unit": "m/s",
        "tolerance": 3.0,
        "within_tolerance": True,
        "from_s": 240.0,
        "to_s": 300.0,
        **changes,
    }
    return FlightLimit(**values)


# Limits


def test_the_worst_limit_is_the_nearest_to_its_tolerance_not_the_largest(flight: Flight):
    """4.0 m/s hidden at 80 m/s, where 2.57 are tolerable, count for more than 4.6 at 160 m/s, where 4.8 are."""
    slow, fast = span(240.0, 480.0, 4.0, tolerance=2.57), span(460.0, 700.0, 4.6, tolerance=4.8)
    worst, mostly = limits_of(flight, [bounds([fast, slow], shape="bias", unit="m/s")])
    assert (worst.effect, worst.tolerance, worst.within_tolerance, worst.holds_in) == (4.0, 2.57, False, 1.0)
    assert (worst.from_s, worst.to_s) == (240.0, 480.0)
    assert (mostly.effect, mostly.holds_in) == (4.0, 0.95)


def test_over_a_stretch_the_window_counts_that_is_furthest_within_its_tolerance(flight: Flight):
    small, tolerable = span(240.0, 700.0, 3.0, tolerance=2.0), span(240.0, 700.0, 4.0, tolerance=5.0)
    worst, _ = limits_of(flight, [bounds([small, tolerable], shape="bias", unit="m/s")])
    assert (worst.effect, worst.within_tolerance) == (4.0, True)


@pytest.mark.parametrize(("rough", "mostly"), [(2, 1.0), (3, 2.0)])
def test_one_limit_holds_in_most_of_the_watched_time(flight: Flight, rough: int, mostly: float):
    """Of 44 stretches of ten seconds 42 are 95 %."""
    calm = [
        replace(span(240.0 + 10.0 * k, 270.0 + 10.0 * k, 1.0), onsets_s=np.array([240.0, 250.0]) + 10.0 * k)
        for k in range(44)
    ]
    sizes = [np.full(2, 2.0 if k < rough else 1.0) for k in range(44)]
    calm = [replace(one, sizes=x, declared=x, spreads=np.ones(2)) for one, x in zip(calm, sizes, strict=True)]
    worst, most = limits_of(flight, [bounds(calm, shape="bias", unit="m/s")])
    assert (worst.effect, most.effect) == (2.0, mostly)


@pytest.mark.parametrize("seed", range(5))
def test_no_drift_that_grows_on_unseen_exceeds_its_limit(flight: Flight, seed: int):
    """Tried out: every onset, every end from that of the window that counts on, the steepest slope not shown yet."""
    rng = np.random.default_rng(seed)
    windows = [span(240.0 + 30.0 * k, 300.0 + 30.0 * k, rng.uniform(0.02, 0.1), tolerance=1.0) for k in range(13)] + [
        span(240.0 + 60.0 * k, 360.0 + 60.0 * k, rng.uniform(0.01, 0.05), tolerance=1.0) for k in range(5)
    ]
    worst, _, grown = sorted(limits_of(flight, [bounds(windows)]), key=lambda one: (one.grows_on, -one.holds_in))
    reached, in_window = 0.0, 0.0
    for onset_s in np.arange(240.0, 671.0, BIN_S):
        shown = [(one.window[1], float(one.sizes[0])) for one in windows if onset_s + BIN_S <= one.onsets_s[-1]]
        inside = [
            (one.sizes[0] * (one.window[1] - onset_s), one.window[1])
            for one in windows
            if one.window[0] <= onset_s and onset_s + BIN_S <= one.onsets_s[-1]
        ]
        if not inside:
            continue
        effect, first_s = min(inside)
        in_window = max(in_window, effect)
        for end_s in np.arange(first_s, max(end for end, _ in shown) + 0.5):
            slope = min(size for end, size in shown if end < end_s or end == first_s)
            reached = max(reached, slope * (end_s - onset_s))
    assert worst.effect == pytest.approx(in_window)
    assert grown.effect == pytest.approx(reached, rel=0.01)
    assert grown.excluded_above * (grown.to_s - grown.from_s) == pytest.approx(grown.effect)
    assert (grown.grows_on, grown.holds_in) == (True, 1.0)


def test_of_what_grows_on_the_nearest_to_its_tolerance_counts(flight: Flight):
    """12 m/s at the end of a window where 1 is tolerable, 23 by the end of the other where 10 are."""
    windows = [span(240.0, 480.0, 0.05, tolerance=1.0), span(460.0, 700.0, 0.06, tolerance=10.0)]
    (grown,) = (one for one in limits_of(flight, [bounds(windows)]) if one.grows_on)
    assert (grown.effect, grown.tolerance, grown.to_s) == (pytest.approx(0.05 * 240.0), 1.0, 480.0)


def test_an_error_as_large_as_the_airspeed_is_any_size(flight: Flight):
    median = float(np.median(flight.record.between(240.0, 700.0).channels["tas"]))
    for size, known in ((0.99 * median, True), (1.01 * median, False)):
        worst, _ = limits_of(flight, [bounds([span(240.0, 700.0, size)], shape="bias", unit="m/s")])
        assert (worst.effect is not None, worst.excluded_above is not None) == (known, known)
    assert not worst.within_tolerance


def test_limits_over_the_flight_end_at_the_worst_and_are_mostly_below_the_other(flight: Flight):
    windows = [span(240.0 + 60.0 * k, 360.0 + 60.0 * k, 0.01 * (k + 1)) for k in range(5)]
    kinds = [bounds(windows), bounds(windows, fault="aoa"), bounds(windows, bounds="disagreement")]
    (one,) = limit_courses(flight, kinds)
    known = np.isfinite(one.excluded_above)
    assert (one.fault, one.unit, one.worst) == ("tas", "m/s^2", pytest.approx(0.05))
    assert np.mean(one.excluded_above[known] <= one.mostly) >= 0.95
    # Of two windows the more precise counts; from 340 s on none but the second holds an onset.
    np.testing.assert_allclose(np.interp([285.0, 345.0], one.time_s, one.excluded_above), [0.01, 0.02])
    # Nothing bounds what begins after the last onset of the last window.
    assert one.time_s[known][-1] < 580.0 <= one.time_s[~known][0]
    assert limit_courses(flight, []) == ()


# The scan


def test_a_window_with_a_declared_fault_bounds_no_other(flight: Flight):
    """It shows that fault: its size, nor that of any other, is no limit."""
    windows = [(380.0, 440.0), (540.0, 600.0)]
    looks = scan_flight(flight, windows, thresholds_of(shipped_tables(), RATES, RATES, 1.0))
    fault = replace(event_of("tas", 400.0, "declared"), seen_until_s=430.0)

    def bounded(*events: Event) -> set[tuple[float, float]]:
        return {hidden.window for windows in bounds_of(flight, looks, (), events) for hidden in windows}

    assert bounded() == set(windows)
    assert bounded(fault) == {windows[1]}
    assert bounded(replace(fault, state="suspected")) == set(windows)


def test_what_hides_is_the_estimate_and_what_its_noise_allows(flight: Flight):
    """A flight of which windows show four times what the tables do has twice the noise."""
    one = made_scan(from_s=380.0, to_s=500.0, magnitude=np.array([-0.2, 0.01]), sd=np.array([0.05, 0.02]))
    one = replace(one, onsets_s=np.array([390.0, 400.0]))
    for scale, noise in ((1.0, 1.0), (4.0, 2.0)):
        held = replace(one, rule=thresholds_of(shipped_tables(), RATES, RATES, scale)(KEY))
        (tas,) = (windows for windows in bounds_of(flight, [held], (), ()) if windows[0].fault == "tas")
        np.testing.assert_allclose(tas[0].spreads, EXCEEDED_BY * noise * one.sd["tas"])
        # In one window of twenty, where nine of ten show at most 1.2 times the noise.
        np.testing.assert_allclose(tas[0].spreads, 1.2 * ONE_SIDED_95 * noise * one.sd["tas"], rtol=0.02)
        np.testing.assert_allclose(tas[0].sizes - tas[0].spreads, [0.2, 0.01])


def test_of_several_windows_that_with_the_least_noise_counts_not_the_one_that_shows_the_least(flight: Flight):
    """The least of several limits of 95 % each is none."""
    lucky, precise = span(240.0, 700.0, 0.02), span(240.0, 700.0, 0.05)
    both = bounds([lucky, replace(precise, spreads=0.2 * precise.sizes)])
    worst, grown, _ = limits_of(flight, [both])
    assert worst.excluded_above == 0.05
    assert grown.excluded_above == 0.05
    hidden, declared = hidden_slopes(both, np.array([300.0, 310.0]))
    np.testing.assert_array_equal(hidden, [0.05, 0.05])
    np.testing.assert_array_equal(declared, np.min([lucky.declared, precise.declared], axis=0)[:1].repeat(2))
    assert np.isinf(hidden_slopes(bounds([]), np.array([300.0]))).all()


def made_scan(**changes: Any) -> Scanned:
    changes |= {key: {"tas": changes[key]} for key in ("magnitude", "sd", "declared") if key in changes}
    values: dict[str, Any] = {
        "from_s": 0.0,
        "to_s": 120.0,
        "residuals": ("lift",),
        "lacking": {},
        "statistic": 1.0,
        "fault": "tas",
        "onset_s": 30.0,
        "onsets_s": np.array([30.0]),
        "magnitude": {"tas": np.zeros(1)},
        "sd": {"tas": np.ones(1)},
        "declared": {"tas": np.full(len(changes.get("onsets_s", [30.0])), 9.0)},
        "lasting": (),
        "threshold": 9.0,
        "p_value": None,
        "rule": thresholds_of(shipped_tables(), RATES, RATES, 1.0)(KEY),
        **changes,
    }
    return Scanned(**values)


@pytest.mark.parametrize(("slope", "is_seen"), [(0.8, True), (0.9, False)])
def test_no_size_is_stated_that_no_sensor_errs_by(flight: Flight, slope: float, is_seen: bool):
    """Of the true airspeed 100 m/s: 0.83 m/s^2 in two minutes."""
    scan = made_scan(
        from_s=380.0, to_s=500.0, onsets_s=np.array([390.0]), declared=np.array([slope]), sd=np.full(1, 0.01)
    )
    (tas,) = (windows for windows in bounds_of(flight, [scan], (), ()) if windows[0].fault == "tas")
    assert np.isfinite(tas[0].declared[0]) is np.bool_(is_seen)


@pytest.mark.parametrize(("share", "is_seen"), [(0.9, True), (1.1, False)])
def test_a_static_line_that_takes_all_of_the_airspeed_is_no_small_fault(flight: Flight, share: float, is_seen: bool):
    """What a scan of small faults would show of an error as large as the impact pressure it would not."""
    slope = share * float(np.nanmedian(flight.record.between(240.0, 700.0).air.q_impact)) / 120.0
    scan = made_scan(from_s=380.0, to_s=500.0, onsets_s=np.array([390.0]), declared=np.array([slope]), sd=np.ones(1))
    scan = replace(scan, **{key: {STATIC_LEAK: getattr(scan, key)["tas"]} for key in ("magnitude", "sd", "declared")})
    (leak,) = (windows for windows in bounds_of(flight, [scan], (), ()) if windows[0].fault == STATIC_LEAK)
    assert np.isfinite(leak[0].declared[0]) is np.bool_(is_seen)
    assert np.isfinite(leak[0].sizes[0])


def test_a_window_in_which_a_fault_lasts_fits_no_table():
    """No table is of windows with columns for a fault: the tail is less sure, and the slopes are as they were."""
    threshold = thresholds_of(shipped_tables(), RATES, RATES, 1.0)
    plain, lasting = threshold(KEY), threshold(replace(KEY, beside=True))
    assert lasting.level > 1.2 * plain.level
    assert lasting.null.tail == plain.null.tail.widened
    assert lasting.scale == plain.scale == 1.0


def test_the_windows_of_all_analyses_together_alarm_as_often_as_a_flight_may():
    counts = (160, 80, 40, 50)  # of the parity scan of three lengths, and of the scan for steps
    assert sum(n * rate_of(0.05, n) for n in counts) == pytest.approx(0.05)


# What was not watched


def test_what_is_left_of_stretches():
    assert left_of([(0.0, 10.0), (20.0, 30.0)], [(4.0, 5.0), (9.0, 22.0)]) == [(0.0, 4.0), (5.0, 9.0), (22.0, 30.0)]
    assert left_of([(0.0, 10.0)], []) == [(0.0, 10.0)]
    assert left_of([(0.0, 10.0)], [(-5.0, 15.0)]) == []


def test_time_without_a_phase_is_flight_where_it_follows_flight(flight: Flight):
    phases = (
        Phase(phase="ground", from_s=20.0, to_s=40.0),
        Phase(phase="take-off", from_s=50.0, to_s=60.0),
        Phase(phase="climb", from_s=60.0, to_s=100.0),
        Phase(phase="turn", from_s=70.0, to_s=90.0),
        Phase(phase="cruise", from_s=300.0, to_s=400.0),
        Phase(phase="landing", from_s=400.0, to_s=420.0),
    )
    made = replace(flight, phases=phases, from_s=0.0, to_s=500.0)
    assert flown_of(made) == [(60.0, 400.0)]
    assert flown_of(replace(made, to_s=380.0)) == [(60.0, 380.0)]
    # Where the airspeed is lost for good, nothing says that the flight has ended.
    assert flown_of(replace(made, phases=phases[:-1])) == [(60.0, 500.0)]


def test_windows_of_steps_leave_their_ends_and_short_rests(flight: Flight):
    made = replace(flight, phases=(Phase(phase="cruise", from_s=0.0, to_s=600.0),), from_s=0.0, to_s=600.0)
    windows = [(0.0, 120.0), (90.0, 210.0), (300.0, 420.0), (465.0, 585.0)]
    found = [(one.from_s, one.to_s) for one in unwatched_by_steps(made, windows)]
    assert found == [(195.0, 315.0), (405.0, 480.0), (570.0, 600.0)]
    assert unwatched_by_steps(made, [*windows, (180.0, 330.0), (390.0, 510.0), (480.0, 600.0)]) == []


def test_a_line_that_could_hide_counts_in_the_part_only(flight: Flight):
    unseen = tuple(
        UnseenLine(fault="static_blocked", what="could hide", from_s=first, to_s=last, why="calm")
        for first, last in ((0.0, 280.0), (300.0, 320.0), (660.0, 900.0))
    )
    held = replace(flight.held, unseen=unseen, lacking=("x",))
    found = unwatched_by_lines(replace(flight, held=held))
    assert [(one.from_s, one.to_s) for one in found] == [(240.0, 280.0), (660.0, 700.0)]
    assert found[0].why == "static_blocked could hide: calm"
    assert held.missing(240.0, 700.0) == ("x", "static_blocked could hide in 100 s of the flight: calm")
    assert held.missing(290.0, 310.0) == ("x",)


# Verdict and sentence


EXCLUDED = (row(), row(fault="pitot_icing"))


def slow_verdict(limits, unwatched, recorded) -> str:
    return conclude([evidence_of((), limits, unwatched, recorded)], KINDS).verdicts["slow"]


GAP = Unwatched(from_s=1500.0, to_s=4000.0, why="no airspeed is recorded")


@pytest.mark.parametrize(
    ("limits", "unwatched", "slow"),
    [
        (EXCLUDED, (), "no_fault"),
        (EXCLUDED, (GAP,), "inconclusive"),
        ((*EXCLUDED, row(grows_on=True, within_tolerance=False)), (), "inconclusive"),
        (EXCLUDED[:1], (), "inconclusive"),
        (EXCLUDED[1:], (), "inconclusive"),
        # How far tas may disagree says nothing of its error, and is not asked for where that is known.
        ((row(bounds="disagreement"), EXCLUDED[1], row(within_tolerance=False)), (), "inconclusive"),
        ((*EXCLUDED, row(bounds="disagreement", within_tolerance=False)), (), "no_fault"),
        ((*EXCLUDED, row(shape="bias", within_tolerance=False)), (), "no_fault"),
    ],
)
def test_a_slow_fault_is_excluded_where_every_airspeed_is_bounded_all_the_time(limits, unwatched, slow: str):
    assert slow_verdict(limits, unwatched, {"tas", "aoa"}) == slow


def test_an_airspeed_that_no_residual_reads_needs_its_relation():
    assert slow_verdict(EXCLUDED, (), {"tas", "mach"}) == "inconclusive"
    beside = row(fault="mach", channel="mach", bounds="disagreement")
    assert slow_verdict((*EXCLUDED, beside), (), {"tas", "mach"}) == "no_fault"


def test_a_suspicion_of_a_kind_that_is_not_required_decides_nothing():
    verdicts = dict.fromkeys(KINDS, "inconclusive") | {"slow": "no_fault"}
    assert decide(verdicts, ("slow",)) == "no_fault"
    assert decide(verdicts, ("slow", "abrupt")) == "inconclusive"


def test_where_nothing_was_looked_for_no_sentence_says_that_nothing_was_found():
    verdicts = dict.fromkeys(KINDS, "inconclusive")
    limits = (
        *EXCLUDED,
        row(fault="pitot_icing", holds_in=0.95, effect=1.5),
        row(grows_on=True, effect=7.0, to_s=900.0),
    )
    short = Unwatched(from_s=10.0, to_s=45.0, why="flaps or gear may move")
    said = sentence_of((), limits, [short, GAP], [GAP], verdicts, looked_for_steps=True)
    slow, steps = said.split("; no step")
    assert slow == (
        "a slow fault could reach 1.5 m/s on tas unseen within 60 s in 95 % of the watched flight, 2 m/s on tas from "
        "240 to 300 s, 7 m/s on tas by 900 s if it grows on from 240 s; not checked 1500 to 4000 s (no "
        "airspeed is recorded), 10 to 45 s (flaps or gear may move)"
    )
    assert steps == " or oscillation found; not checked 1500 to 4000 s (no airspeed is recorded)"
    assert "not checked" not in sentence_of((), limits, [], [], verdicts, looked_for_steps=True)
    many = [replace(short, from_s=100.0 * k, to_s=100.0 * k + 35.0) for k in range(5)]
    assert "and 70 s elsewhere" in sentence_of((), limits, many, [], verdicts, looked_for_steps=True)


# The whole


def diagnosed(log: FlightLog, **tolerances: float) -> DiagnoseResult:
    part = {"window": {"from_s": 240.0, "to_s": 700.0}, "tolerances": tolerances, "require": ["slow"]}
    channels = {name: one for name, one in log.channels.items() if name != "elevator"}
    return diagnose_flight(replace(log, channels=channels), Config.model_validate(part))


@pytest.mark.slow
def test_flight_without_an_airspeed_is_no_clean_flight(journey: FlightLog):
    """Every airspeed is missing from 400 to 500 s: what was tolerable all the way is no longer told."""
    wide = {"tas": 60.0, "cas": 40.0, "mach": 0.1}
    healthy = diagnosed(journey, **wide)
    assert (healthy.decision, healthy.verdicts["slow"], healthy.unwatched) == ("no_fault", "no_fault", ())
    assert all(one.within_tolerance for one in healthy.limits if one.channel in AIRSPEEDS and one.bounds == "error")
    inside = (journey.time_s >= 400.0) & (journey.time_s < 500.0)
    lost = {
        name: replace(one, values=frozen_array(np.where(inside & (name in AIRSPEEDS), np.nan, one.values)))
        for name, one in journey.channels.items()
    }
    result = diagnosed(replace(journey, channels=lost), **wide)
    assert (result.decision, result.verdicts["slow"]) == ("inconclusive", "inconclusive")
    ((first, last, why),) = result.unwatched
    assert why == "no airspeed is recorded, or none that is right"
    assert (first, last) == (pytest.approx(380.0, abs=2.0), pytest.approx(500.0, abs=2.0))
    assert "not checked 3" in result.summary
