"""The rules by which two autopilots stop trusting an airspeed sensor, as state machines over samples.

Written from the published sources, not translated from them:

- PX4-Autopilot, src/lib/airspeed_validator/AirspeedValidator.cpp as it is with the first-principle check,
  parameters of src/modules/airspeed_selector/airspeed_selector_params.c: ASPD_FS_INNOV 5 m/s, ASPD_FS_INTEG 10 m,
  ASPD_FS_T_STOP 1 s, ASPD_FS_T_START -1 s (never again), ASPD_FP_T_WINDOW 2 s, ASPD_DO_CHECKS 7 (missing, stuck and
  innovation; load factor and first principle are off), FW_AIRSPD_STALL 7 m/s, FW_THR_TRIM 0.6, FW_PSP_OFF 0.
- ArduPilot, libraries/AP_Airspeed/AP_Airspeed_Health.cpp and AP_Airspeed.cpp: ARSPD_WIND_MAX 0
  (off), ARSPD_WIND_GATE 5, with the bits to disable and to enable again of ARSPD_OPTIONS set.

Every function is given the samples that the autopilot has, (n,), in flight throughout, and returns (n,) booleans.
"""

from __future__ import annotations

import numpy as np

from . import BoolArray, FloatArray

# PX4: seconds without a new value, and without a changed one.
MISSING_S, STUCK_S = 1.0, 2.0
# PX4: the innovation check counts from this many seconds after the wind is first estimated; its time steps are limited.
WIND_SETTLES_S, LEAST_STEP_S, LARGEST_STEP_S = 5.0, 0.01, 0.2
# PX4: share of a new load factor in its running mean, the bounds of that, and where it fails.
LOAD_SHARE, LOAD_LEAST, LOAD_MOST, LOAD_FAILS = 0.05, 0.25, 2.0, 1.1
STANDARD_GRAVITY = 9.81  # m/s^2, as PX4 has it
# PX4: time constants of the filters of airspeed rate, throttle and pitch, s, and how far above trim a throttle is high.
RATE_S, THROTTLE_S, PITCH_S, HIGH_THROTTLE = 5.0, 0.5, 1.5, 0.05
# PX4: m/s^2 below which an airspeed does not grow (kIASDerivateThreshold), as AirspeedValidator.hpp of the fork
# EnigmaAerospace/PX4-Autopilot has it at 4c4a4e4, where kHighThrottleDelta is 0.05 too.
GROWS = 0.1
# ArduPilot: seconds between checks, factors of the health after a bad and a good one, where the sensor is disabled and
# enabled again, and the part of the gate that a disabled one must keep.
CHECK_S, BAD, GOOD, DISABLED, ENABLED, STRICTER = 0.2, 0.90, 0.98, 0.1, 0.95, 0.7


def px4_missing(time_s: FloatArray, airspeed: FloatArray) -> BoolArray:
    """Fail where the last value (not NaN) is older than a second."""
    last_s = np.maximum.accumulate(np.where(np.isfinite(airspeed), time_s, time_s[0]))
    return np.asarray(time_s - last_s > MISSING_S)


def px4_stuck(time_s: FloatArray, airspeed: FloatArray) -> BoolArray:
    """Fail where the value has not changed for more than two seconds; NaN is no change."""
    changed_s, held, failed = time_s[0], airspeed[0], np.zeros(len(time_s), dtype=bool)
    for k, value in enumerate(airspeed):
        if np.isfinite(value) and not abs(value - held) <= np.finfo(np.float32).eps:
            changed_s, held = time_s[k], value
        failed[k] = time_s[k] - changed_s > STUCK_S
    return failed


def px4_innovation(
    time_s: FloatArray, innovation: FloatArray, *, threshold: float = 5.0, integral: float = 10.0
) -> BoolArray:
    """Fail where the integral of what the innovation, m/s, exceeds the threshold by is larger than `integral`, m.

    One sample within the threshold empties the integral, and so does one that is unknown (NaN), where the state stays.
    """
    failed, state, total, before_s = np.zeros(len(time_s), dtype=bool), False, 0.0, time_s[0]
    for k, value in enumerate(np.abs(innovation)):
        step_s = float(np.clip(time_s[k] - before_s, LEAST_STEP_S, LARGEST_STEP_S))
        before_s = time_s[k]
        if time_s[k] - time_s[0] < WIND_SETTLES_S:
            state, total = False, 0.0
        elif not np.isfinite(value):
            total = 0.0
        else:
            total = total + step_s * (value - threshold) if value > threshold else 0.0
            state = total > integral
        failed[k] = state
    return failed


def px4_load_factor(airspeed: FloatArray, force: FloatArray, *, stall: float = 7.0) -> BoolArray:
    """Fail where the mean of load factor over (airspeed / stall speed) squared exceeds 1.1: no such lift there.

    Parameters
    ----------
    force : specific force along body z, m/s^2, 9.81 in level flight; either sign.
    """
    ratio, failed = 0.5, np.zeros(len(airspeed), dtype=bool)
    lift = (np.maximum(airspeed, 0.7) / max(stall, 1.0)) ** 2
    for k, value in enumerate(np.abs(force) / STANDARD_GRAVITY / lift):
        ratio = float(np.clip((1.0 - LOAD_SHARE) * ratio + LOAD_SHARE * value, LOAD_LEAST, LOAD_MOST))
        failed[k] = ratio > LOAD_FAILS
    return failed


def px4_first_principle(
    time_s: FloatArray,
    airspeed: FloatArray,
    throttle: FloatArray,
    pitch: FloatArray,
    *,
    trim: float = 0.6,
    most: float = 1.0,
    level_pitch: float = 0.0,
    window_s: float = 2.0,
) -> BoolArray:
    """Fail where for longer than the window the airspeed does not grow, nose down with more throttle than in trim.

    A sample of which one value is unknown (NaN) changes nothing.

    Parameters
    ----------
    throttle : 0 to 1; trim, most : of cruise, and the largest.
    pitch, level_pitch : rad, of level flight.
    """
    failed, known = np.zeros(len(time_s), dtype=bool), np.isfinite(airspeed + throttle + pitch)
    last = int(np.argmax(known))
    rate, lever, nose, passed_s = 0.0, throttle[last], pitch[last], time_s[last]
    for k in range(last + 1, len(time_s)):
        if not known[k]:
            failed[k] = failed[k - 1]
            continue
        step_s = time_s[k] - time_s[last]
        if step_s > 1.0:
            rate, lever, nose, passed_s = 0.0, throttle[k], pitch[k], time_s[k]
        elif step_s > 0.0:
            rate += step_s / (RATE_S + step_s) * ((airspeed[k] - airspeed[last]) / step_s - rate)
            lever += step_s / (THROTTLE_S + step_s) * (throttle[k] - lever)
            nose += step_s / (PITCH_S + step_s) * (pitch[k] - nose)
        if not (rate < GROWS and lever > min(trim + HIGH_THROTTLE, most) and nose < level_pitch):
            passed_s = time_s[k]
        failed[k], last = time_s[k] - passed_s > window_s, k
    return failed


def px4_invalid(
    time_s: FloatArray,
    *,
    missing: BoolArray,
    stuck: BoolArray,
    innovation: BoolArray,
    load_factor: BoolArray,
    first_principle: BoolArray,
    stop_s: float = 1.0,
    start_s: float = -1.0,
) -> BoolArray:
    """Declare an airspeed invalid from failed checks.

    At once where it is missing or stuck, or innovation and load factor fail together; where one check fails, after
    longer than `stop_s`. Valid again longer than `start_s` after the last failure, never where that is not positive.
    """
    invalid, state, passed_s, failed_s = np.zeros(len(time_s), dtype=bool), False, time_s[0], -np.inf
    any_failed = stuck | innovation | load_factor | first_principle
    at_once = stuck | (innovation & load_factor) | missing
    for k, now_s in enumerate(time_s):
        if any_failed[k]:
            failed_s = now_s
        else:
            passed_s = now_s
        if missing[k]:
            failed_s = now_s
        if not state:
            state = bool(at_once[k] or now_s - passed_s > stop_s)
        elif start_s > 0.0 and now_s - failed_s > start_s:
            state = False
        invalid[k] = state
    return invalid


def ardupilot_disabled(
    time_s: FloatArray,
    airspeed: FloatArray,
    ground_speed: FloatArray,
    test_ratio: FloatArray,
    *,
    wind_max: float = 0.0,
    gate: float = 5.0,
) -> BoolArray:
    """Disable a sensor whose health, a running share of good checks, falls below 0.1, until it is above 0.95.

    A check, of which there are no two within 0.2 s, is bad where airspeed and ground speed differ by more than
    `wind_max`, m/s, or the innovation is larger than `gate` standard deviations (0.7 times that while it is disabled);
    0 switches either off. Without a positive airspeed there is no check.

    Parameters
    ----------
    test_ratio : size of the innovation over its standard deviation; NaN counts as 0.
    """
    disabled, state, health, checked_s = np.zeros(len(time_s), dtype=bool), False, 1.0, -np.inf
    ratio = np.nan_to_num(np.abs(test_ratio))
    for k, now_s in enumerate(time_s):
        if now_s - checked_s > CHECK_S + 1e-9:  # a millisecond clock counts whole milliseconds
            checked_s = now_s
            if airspeed[k] > 0.0 and np.isfinite(ground_speed[k]):
                far = wind_max > 0.0 and abs(airspeed[k] - ground_speed[k]) > wind_max
                inconsistent = gate > 0.0 and ratio[k] > gate * (STRICTER if state else 1.0)
                health = BAD * health if far or inconsistent else GOOD * health + 1.0 - GOOD
                state = health <= ENABLED if state else health < DISABLED
        disabled[k] = state
    return disabled


def wind_innovation(
    time_s: FloatArray,
    airspeed: FloatArray,
    velocity: FloatArray,
    *,
    noise: float = 1.4,
    drift: float = 0.1,
    gate: float = 4.0,
    initial: float = 5.0,
) -> tuple[FloatArray, FloatArray]:
    """Return innovation and its standard deviation, (n,) each, of an airspeed against ground velocity less the wind.

    A Kalman filter with the horizontal wind as its state, a random walk, like those of both autopilots but without
    their sideslip and scale; its first wind is none.

    Parameters
    ----------
    velocity : (n, 3) over ground, m/s; the horizontal components first.
    noise : of the airspeed, m/s (ASPD_TAS_NOISE); drift : of the wind, m/s in a second (ASPD_WIND_NSD).
    gate : standard deviations beyond which an airspeed is not fused (ASPD_TAS_GATE).
    initial : standard deviation of the first wind, m/s.
    """
    wind, P = np.zeros(2), initial**2 * np.eye(2)
    innovation, sd = np.full((2, len(time_s)), np.nan)
    for k in range(len(time_s)):
        if k:
            P = P + drift**2 * (time_s[k] - time_s[k - 1]) * np.eye(2)
        through_air = velocity[k] - [*wind, 0.0]
        speed = float(np.linalg.norm(through_air))
        if speed == 0.0 or not np.isfinite(airspeed[k]):
            continue
        H = -through_air[:2] / speed
        PH = P @ H
        variance = float(H @ PH) + noise**2
        innovation[k], sd[k] = airspeed[k] - speed, np.sqrt(variance)
        if abs(innovation[k]) <= gate * sd[k]:
            gain = PH / variance
            wind = wind + gain * innovation[k]
            P = P - np.outer(gain, PH)
    return innovation, sd
