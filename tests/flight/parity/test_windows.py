"""The windows of a flight, and the angle of zero lift that the flight itself tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_flight import ZERO_LIFT, made_record

from bfi_cli.flight.parity import configuration_changes, windows_in, zero_lift_of
from bfi_cli.flight.parity.record import Record, with_fault
from bfi_cli.flight.parity.windows import CLEAN_UP_S, flight_stretches
from bfi_cli.flightlog.phases import RECOVERY_S, Phase


def phases(*parts: tuple[str, float, float]) -> tuple[Phase, ...]:
    return tuple(Phase(phase=name, from_s=first, to_s=last) for name, first, last in parts)


FLIGHT = phases(
    ("ground", 0.0, 300.0),
    ("take-off", 300.0, 330.0),
    ("climb", 330.0, 900.0),
    ("cruise", 900.0, 2000.0),
    ("turn", 1000.0, 1060.0),
    ("parabola", 1500.0, 1530.0),
    ("stall", 1700.0, 1710.0),
    ("descent", 2000.0, 2600.0),
    ("approach", 2600.0, 2800.0),
    ("landing", 2800.0, 2830.0),
    ("ground", 2830.0, 3000.0),
)
spans = st.floats(60.0, 600.0)


def overlaps(window: tuple[float, float], phase: Phase, beyond_s: float = 0.0) -> bool:
    return window[0] < phase.to_s + beyond_s - 1e-9 and window[1] > phase.from_s - beyond_s + 1e-9


@pytest.mark.parametrize("length_s", [60.0, 120.0, 240.0])
def test_no_window_has_a_take_off_a_landing_or_a_parabola(length_s):
    windows = windows_in(FLIGHT, length_s)
    for window in windows:
        assert window[1] - window[0] == pytest.approx(length_s)
        for phase in FLIGHT:
            if phase.phase in ("ground", "take-off", "landing"):
                assert not overlaps(window, phase)
            if phase.phase == "parabola":
                assert not overlaps(window, phase, RECOVERY_S)
    # Turns and stalls are flight like any other.
    assert any(overlaps(one, FLIGHT[4]) for one in windows)
    assert any(overlaps(one, FLIGHT[6]) for one in windows)


@given(spans, st.floats(20.0, 300.0), st.floats(5.0, 100.0))
def test_windows_cover_their_stretch_without_a_gap(span_s, length_s, step_s):
    windows = windows_in(phases(("cruise", 50.0, 50.0 + span_s)), length_s, step_s=min(step_s, length_s))
    if span_s < length_s:
        assert windows == []
        return
    assert windows[0][0] == 50.0
    # What is left over at the end is less than a quarter of a step.
    assert windows[-1][1] <= 50.0 + span_s + 1e-9
    assert 50.0 + span_s - windows[-1][1] <= 0.25 * step_s + 1e-9
    starts = np.array([one[0] for one in windows])
    assert np.all(np.diff(starts) > 0.0)
    assert np.all(np.diff(starts) <= step_s + 1e-9)


def test_half_a_length_is_the_step_where_none_is_said():
    starts = [one[0] for one in windows_in(phases(("flight", 0.0, 600.0)), 120.0)]
    np.testing.assert_allclose(np.diff(starts), 60.0)


def test_parts_that_follow_each_other_are_one_stretch():
    assert flight_stretches(FLIGHT) == [(330.0, 1500.0 - RECOVERY_S), (1530.0 + RECOVERY_S, 2800.0)]
    assert flight_stretches(phases(("climb", 0.0, 100.0), ("cruise", 200.0, 300.0))) == [(0.0, 100.0), (200.0, 300.0)]
    assert flight_stretches(()) == []
    assert windows_in((), 60.0) == []


def test_two_parabolas_close_together_leave_nothing_between_them():
    parts = phases(("cruise", 0.0, 1000.0), ("parabola", 400.0, 420.0), ("parabola", 460.0, 480.0))
    assert flight_stretches(parts) == [(0.0, 400.0 - RECOVERY_S), (480.0 + RECOVERY_S, 1000.0)]


def test_flaps_move_after_take_off_and_from_the_last_descent_on():
    assert configuration_changes(FLIGHT) == [(300.0, 330.0 + CLEAN_UP_S), (2000.0, 2800.0), (2000.0, 2830.0)]
    assert configuration_changes(phases(("cruise", 0.0, 100.0))) == []


ALOFT = phases(("take-off", 0.0, 20.0), ("flight", 20.0, 1000.0))


def test_the_angle_of_zero_lift_is_that_of_the_flight():
    assert zero_lift_of(made_record(1000), ALOFT) == pytest.approx(ZERO_LIFT, abs=1e-9)


def test_what_is_left_out_does_not_move_it():
    record = made_record(1000)
    aoa = record.channels["aoa"].copy()
    aoa[400:700] += np.radians(1.0)
    faulty = replace(record, channels={**record.channels, "aoa": aoa})
    assert zero_lift_of(faulty, ALOFT, without=[(400.0, 700.0)]) == pytest.approx(ZERO_LIFT, abs=1e-9)
    assert zero_lift_of(faulty, ALOFT) != pytest.approx(ZERO_LIFT, abs=1e-3)


def test_parts_of_the_flight_that_disagree_tell_none():
    """A leak that lasts from half of the flight on moves the angle: taken from both it would be wrong before it."""
    record = made_record(1000)
    leak = with_fault(record, "static_leak", 2500.0 * (record.time_s > 500.0))
    assert zero_lift_of(leak, ALOFT) is None
    assert zero_lift_of(leak, ALOFT, without=[(500.0, 1000.0)]) == pytest.approx(ZERO_LIFT, abs=1e-9)


@pytest.mark.parametrize("missing", [("aoa",), ("normal_acc",), ("altitude", "p_static"), ()])
def test_without_channels_or_with_too_little_flight_it_is_not_known(missing):
    record = made_record(1000, without=missing)
    assert (zero_lift_of(record, ALOFT) is None) == bool(missing)
    assert zero_lift_of(record, phases(("flight", 0.0, 290.0))) is None
    assert zero_lift_of(record, ()) is None


def test_without_an_airspeed_it_is_not_known():
    airspeeds = ("tas", "cas", "ias", "mach", "q_impact", "p_total")
    assert zero_lift_of(made_record(1000, without=airspeeds), ALOFT) is None


def test_a_vane_that_does_not_move_tells_none():
    record = made_record(1000)
    still = replace(record, channels={**record.channels, "aoa": np.full(1000, 0.06)})
    assert zero_lift_of(still, ALOFT) is None
    assert zero_lift_of(replace(record, channels={**record.channels, "aoa": np.full(1000, np.nan)}), ALOFT) is None


def test_recorded_flaps_say_when_they_are_out():
    time_s = np.arange(3000.0) + 0.5
    flaps = np.where((time_s > 400.0) & (time_s < 600.0), 0.024, 0.01 * np.sin(time_s))
    record = Record(time_s=time_s, channels={"flaps": flaps}, gained=None, airspeed="")
    ((first_s, last_s),) = configuration_changes(FLIGHT, record)
    assert (first_s, last_s) == (pytest.approx(400.0, abs=1.5), pytest.approx(600.0, abs=1.5))
    unread = replace(record, channels={"flaps": np.full(time_s.size, np.nan)})
    assert configuration_changes(FLIGHT, unread) == configuration_changes(FLIGHT)
