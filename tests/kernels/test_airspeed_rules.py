"""The rules of the autopilots on hand-made sequences: each fires and clears at the sample that its source says."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.airspeed_rules import (
    ardupilot_disabled,
    px4_first_principle,
    px4_innovation,
    px4_invalid,
    px4_load_factor,
    px4_missing,
    px4_stuck,
    wind_innovation,
)

T = np.arange(400) * 0.125  # exact in binary
MOVING = 20.0 + 0.01 * np.arange(400.0)


def first(failed: np.ndarray) -> int:
    return int(np.argmax(failed)) if failed.any() else -1


def stretch(failed: np.ndarray) -> tuple[int, int]:
    """Return the first row that fails and the first one after it that does not."""
    start = first(failed)
    return start, start + int(np.argmin(failed[start:]))


def test_missing_fires_later_than_a_second_after_the_last_value_and_clears_with_the_next():
    speed = MOVING.copy()
    speed[100:150] = np.nan  # last value at row 99
    assert stretch(px4_missing(T, speed)) == (99 + 9, 150)
    assert not px4_missing(T, MOVING).any()


def test_stuck_fires_later_than_two_seconds_after_the_last_change_and_clears_with_the_next():
    speed = MOVING.copy()
    speed[100:150] = speed[100]
    assert stretch(px4_stuck(T, speed)) == (100 + 17, 150)
    speed[117] += 1.0
    assert first(px4_stuck(T, speed)) == 118 + 17  # row 118 changes back


def test_the_innovation_must_exceed_its_threshold_until_the_integral_is_full():
    innovation = np.zeros(400)
    innovation[100:300] = -9.0  # 4 m/s beyond: 0.5 m a row, more than 10 m in the 21st
    assert stretch(px4_innovation(T, innovation)) == (120, 300)
    innovation[119] = 5.0  # not beyond the threshold: the integral is emptied
    assert first(px4_innovation(T, innovation)) == 140
    assert not px4_innovation(T, np.full(400, 5.0)).any()
    innovation[:] = 100.0  # more than 10 m in the first row that counts, 5 s after the start
    assert first(px4_innovation(T, innovation)) == 40


def test_the_state_of_the_innovation_check_stays_where_it_is_unknown():
    innovation = np.zeros(400)
    innovation[100:130] = 9.0
    innovation[130:200] = np.nan
    assert stretch(px4_innovation(T, innovation)) == (120, 200)


def test_the_load_factor_ratio_is_a_running_mean():
    """From 0.5 towards r the mean is r - (r - 0.5) 0.95^n."""
    failed = px4_load_factor(np.full(400, 7.0), np.full(400, -2.0 * 9.81))
    n = int(np.floor(np.log(0.9 / 1.5) / np.log(0.95))) + 1
    assert first(failed) == n - 1
    assert not px4_load_factor(np.full(400, 7.0), np.full(400, 1.1 * 9.81)).any()
    # Held at 2, the most; then half the load that the stall speed bears.
    airspeed = np.where(np.arange(400) < 200, 7.0, 14.0)
    force = np.where(np.arange(400) < 200, 40.0, 2.0) * 9.81
    falling = int(np.ceil(np.log(0.6 / 1.5) / np.log(0.95)))
    assert stretch(px4_load_factor(airspeed, force)) == (0, 200 + falling - 1)


def test_an_airspeed_that_does_not_grow_nose_down_under_power_fires_after_its_window():
    throttle, pitch, speed = np.full(400, 0.8), np.full(400, -0.1), np.full(400, 20.0)
    assert first(px4_first_principle(T, speed, throttle, pitch)) == 17
    assert not px4_first_principle(T, speed, np.full(400, 0.6), pitch).any()
    assert not px4_first_principle(T, speed, throttle, np.full(400, 0.1)).any()
    # The rate is filtered: 1 m/s^2 from row 100 on exceeds 0.1 m/s^2 once 1 - (40/41)^n does.
    speed[100:] += 0.125 * np.arange(1, 301)
    n = int(np.floor(np.log(0.9) / np.log(5.0 / 5.125))) + 1
    assert stretch(px4_first_principle(T, speed, throttle, pitch)) == (17, 100 + n - 1)


def test_an_unknown_airspeed_changes_nothing_for_the_first_principle_check():
    speed, throttle, pitch = np.full(400, 20.0), np.full(400, 0.9), np.full(400, -0.1)
    speed[:3] = speed[60:64] = np.nan
    failed = px4_first_principle(T, speed, throttle, pitch)
    assert first(failed) == 3 + 17
    assert failed[20:].all()
    speed[100:] += 0.125 * np.arange(1, 301)  # it is watched after the gap as before
    assert not px4_first_principle(T, speed, throttle, pitch)[200:].any()


@pytest.mark.parametrize(
    ("failing", "start"),
    [
        ({"missing"}, 100),
        ({"stuck"}, 100),
        ({"innovation", "load_factor"}, 100),
        ({"innovation"}, 99 + 9),
        ({"load_factor"}, 99 + 9),
        ({"first_principle"}, 99 + 9),
    ],
)
def test_one_failed_check_waits_and_a_worse_one_does_not(failing: set[str], start: int):
    names = ("missing", "stuck", "innovation", "load_factor", "first_principle")
    rows = (np.arange(400) >= 100) & (np.arange(400) < 200)
    checks = {name: rows & (name in failing) for name in names}
    never = px4_invalid(T, **checks)
    assert first(never) == start
    assert never[start:].all()
    assert stretch(px4_invalid(T, **checks, start_s=2.0)) == (start, 199 + 17)


def test_ardupilot_disables_below_a_tenth_and_enables_above_95_percent():
    time_s = np.arange(1000) * 0.25
    ground, ratio = np.full(1000, 20.0), np.zeros(1000)
    speed = np.where((np.arange(1000) >= 100) & (np.arange(1000) < 200), 35.0, 20.0)
    assert 0.9**22 < 0.1 < 0.9**21
    up = int(np.floor(np.log(0.05 / (1.0 - 0.9**100)) / np.log(0.98))) + 1
    assert stretch(ardupilot_disabled(time_s, speed, ground, ratio, wind_max=10.0)) == (121, 199 + up)
    assert not ardupilot_disabled(time_s, speed, ground, ratio).any()  # off by default
    assert not ardupilot_disabled(time_s, speed, ground, ratio, wind_max=15.0).any()


def test_ardupilot_asks_a_disabled_sensor_for_a_smaller_innovation():
    time_s, steady = np.arange(1000) * 0.25, np.full(1000, 20.0)
    ratio = np.where(np.arange(1000) < 100, 6.0, 4.0)
    disabled = ardupilot_disabled(time_s, steady, steady, ratio)
    assert first(disabled) == 21
    assert disabled[21:].all()
    assert not ardupilot_disabled(time_s, steady, steady, np.full(1000, 4.0)).any()


def test_ardupilot_checks_no_more_often_than_every_200_ms():
    time_s = np.arange(2000) * 0.05
    disabled = ardupilot_disabled(time_s, np.full(2000, 20.0), np.full(2000, 20.0), np.full(2000, 9.0))
    assert first(disabled) == 21 * 5


def test_the_wind_of_a_circling_aircraft_is_found():
    time_s = np.arange(1200) * 0.1
    heading = 0.1 * time_s
    through_air = 20.0 * np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1)
    innovation, sd = wind_innovation(time_s, np.full(1200, 20.0), through_air + np.array([3.0, -4.0, 0.0]))
    assert np.abs(innovation[900:]).max() < 0.1
    assert (sd >= 1.4).all()
