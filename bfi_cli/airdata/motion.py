"""What bounds air data without a model of the aircraft: lift, attitude, inertial acceleration and ground velocity.

Angles in rad; `normal_acc` is upward with gravity taken out (0 in level flight), `longitudinal_acc` the specific force
along body x, forward. Sideslip is neglected.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..kernels import MAD
from ..kernels.runs import block_means
from .airspeed import SEA_LEVEL_PRESSURE, SEA_LEVEL_TEMPERATURE, FloatArray, G

# Fits are made again without samples this many robust standard deviations off: flaps, gear, the ground, gusts.
OUTLYING = 3.5
# Between angle of attack and lift per impact pressure. Noise of the angle lowers the slope by 1 - r^2, 19 % here, which
# at 5 degrees above the angle of zero lift moves that by a degree; a degree costs a third of the detections.
LEAST_CORRELATION = 0.9
# WGS 84: semi-major axis, m, and the square of the eccentricity.
EARTH_RADIUS = 6_378_137.0
ECCENTRICITY_2 = 6.694_379_990_14e-3
# s, of the line through positions whose slope is a velocity: at a rate of turn of 3 degrees per second it is 0.2 % low
# at its ends. In so many cells; of fewer known ones a line says little.
POSITIONS_S, CELLS, FEWEST_POSITIONS = 5.0, 5, 3
WIND_SD = 50.0  # m/s; a jet stream. It decides only what a flight straight ahead leaves open, the wind across
# Cosine of the bank, 70 degrees, below which the load along body z says nothing of the climb.
LEAST_UPRIGHT = 0.3
AIRSPEED_SD = 1.0  # m/s; of true airspeed and ground velocity about a constant wind, gusts included
# What the acceleration along the path is computed of.
KINEMATICS = ("longitudinal_acc", "normal_acc", "aoa", "pitch", "roll")


def kinematic_acceleration(
    longitudinal_acc: FloatArray, normal_acc: FloatArray, aoa: FloatArray, pitch: FloatArray, roll: FloatArray
) -> FloatArray:
    """Return the rate of change of the airspeed in still air, m/s^2, from accelerometers, attitude and aoa."""
    ahead = longitudinal_acc * np.cos(aoa) - normal_acc * np.sin(aoa) - G * np.sin(pitch) * np.cos(aoa)
    return np.asarray(ahead - G * np.sin(aoa) * (1.0 - np.cos(roll) * np.cos(pitch)))


def longitudinal_acceleration(
    tas_rate: FloatArray, normal_acc: FloatArray, aoa: FloatArray, pitch: FloatArray, roll: FloatArray
) -> FloatArray:
    """Return the longitudinal acceleration, m/s^2, of an airspeed's rate in still air."""
    still = kinematic_acceleration(np.zeros_like(pitch), normal_acc, aoa, pitch, roll)
    return np.asarray((tas_rate - still) / np.cos(aoa))


def normal_acceleration(
    climb_acc: FloatArray, pitch: FloatArray, roll: FloatArray, longitudinal_acc: FloatArray | None = None
) -> FloatArray:
    """Return the normal acceleration, m/s^2, of the rate of the climb rate, m/s^2, and attitude; NaN in steep banks.

    Parameters
    ----------
    longitudinal_acc : (n_samples,) m/s^2; None for that of an airspeed that stays, gravity's share.
    """
    ahead = G * np.sin(pitch) if longitudinal_acc is None else longitudinal_acc
    upright = np.cos(roll) * np.cos(pitch)
    upward = climb_acc + G - ahead * np.sin(pitch)
    return np.asarray(upward / np.where(upright > LEAST_UPRIGHT, upright, np.nan) - G)


def ground_speed_of(channels: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return the recorded ground speed, m/s, else the size of the ground velocity; None where the log has neither."""
    if "ground_speed" in channels or not {"velocity_north", "velocity_east"} <= channels.keys():
        return channels.get("ground_speed")
    return np.hypot(channels["velocity_north"], channels["velocity_east"])


def climb_angle(aoa: FloatArray, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """Return the angle, rad, of the motion through the air above the horizon, from attitude and angle of attack."""
    rise = np.cos(aoa) * np.sin(pitch) - np.sin(aoa) * np.cos(roll) * np.cos(pitch)
    return np.asarray(np.arcsin(np.clip(rise, -1.0, 1.0)))


def vane_angle(climb_rate: FloatArray, tas: FloatArray, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """Return the angle of attack, rad, that attitude and rate of climb tell in still air; see `climb_angle`."""
    rise = np.divide(climb_rate, tas, out=np.full(tas.shape, np.nan), where=tas > np.abs(climb_rate))
    ahead, upward = np.sin(pitch), np.cos(roll) * np.cos(pitch)
    # sin(climb angle) = ahead cos(aoa) - upward sin(aoa), a single cosine.
    size = np.hypot(ahead, upward)
    return np.asarray(np.arccos(np.clip(rise / size, -1.0, 1.0)) - np.arctan2(upward, ahead))


def zero_lift_angle(normal_acc: FloatArray, aoa: FloatArray, q_impact: FloatArray) -> float:
    """Return the angle of attack of zero lift, rad, of an aircraft: (normal_acc + g) / q_impact = b0 + b1 aoa.

    Parameters
    ----------
    normal_acc, aoa, q_impact : (n_samples,) of flight; samples that are not finite are left out.

    Raises
    ------
    ValueError : the lift does not follow the angle of attack closely enough to tell, for lack of movement or of flight.
    """
    lift = (normal_acc + G) / np.where(q_impact > 0.0, q_impact, np.nan)
    kept = np.isfinite(lift) & np.isfinite(aoa)
    slope, middle, level = np.nan, np.nan, np.nan
    for _ in range(2):
        if np.count_nonzero(kept) < 10:
            break
        middle, level = float(aoa[kept].mean()), float(lift[kept].mean())
        centred, force = aoa[kept] - middle, lift[kept] - level
        power = float(centred @ centred)
        slope = float(centred @ force) / power if power > 0.0 else np.nan
        correlation = slope * np.sqrt(power / float(force @ force)) if np.any(force) else np.nan
        error = np.abs(lift - level - slope * (aoa - middle))
        kept = error <= OUTLYING * MAD * np.median(error[kept])
    if not slope > 0.0 or not correlation >= LEAST_CORRELATION:
        shown = f"{correlation:.2f}" if slope > 0.0 else "no lift that grows with it"
        raise ValueError(
            f"the angle of zero lift needs a correlation of {LEAST_CORRELATION:g} between aoa and "
            f"(normal_acc + g) / q_impact, got {shown}"
        )
    return middle - level / slope


def lift_speed(
    normal_acc: FloatArray, aoa: FloatArray, p_static: FloatArray, sat: FloatArray, *, zero_lift: float
) -> FloatArray:
    """Return what is proportional to the true airspeed at a lift and an angle of attack; NaN where there is no lift.

    Parameters
    ----------
    p_static, sat : static pressure, Pa, and temperature, K.
    zero_lift : angle of attack of zero lift, rad.
    """
    share = (normal_acc + G) / np.where(aoa > zero_lift, aoa - zero_lift, np.nan)
    thinness = (SEA_LEVEL_PRESSURE / p_static) * (sat / SEA_LEVEL_TEMPERATURE)
    return np.asarray(np.sqrt(np.where(share > 0.0, share, np.nan) * thinness))


def ground_velocity(time_s: FloatArray, latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the velocity to the north and to the east, m/s, of positions in rad on the ellipsoid of WGS 84.

    It is the slope of the line through the positions of `POSITIONS_S` about each sample: a position that repeats, lags
    or jumps by its last digit moves it little. NaN where fewer than `FEWEST_POSITIONS` of the cells there are known.

    Parameters
    ----------
    time_s, latitude, longitude : (n_samples,) s and rad; times do not decrease.
    """
    shape = 1.0 - ECCENTRICITY_2 * np.sin(latitude) ** 2
    meridian = EARTH_RADIUS * (1.0 - ECCENTRICITY_2) / shape**1.5
    parallel = EARTH_RADIUS / np.sqrt(shape) * np.cos(latitude)
    turned, known = longitude.astype(np.float64), np.isfinite(longitude)
    turned[known] = np.unwrap(longitude[known])
    return np.asarray(meridian * _slopes(time_s, latitude)), np.asarray(parallel * _slopes(time_s, turned))


def _slopes(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return (n_samples,) slopes of the lines through the values about each sample, by means over cells; see above.

    A slope is that in the middle of its line, at the ends and beside gaps no less.
    """
    known = np.isfinite(values) & np.isfinite(time_s)
    if np.count_nonzero(known) < FEWEST_POSITIONS:
        return np.full(values.shape, np.nan)
    step_s = (time_s[known][-1] - time_s[known][0]) / (np.count_nonzero(known) - 1)
    width_s = max(POSITIONS_S / CELLS, step_s)
    cell = np.floor((time_s - time_s[known][0]) / width_s + 0.5 * min(step_s / width_s, 1.0)).astype(np.intp)
    cell -= cell.min()
    n, half = int(cell.max()) + 1, CELLS // 2
    origin = values[known][0]
    times, means = (block_means(np.where(known, column, np.nan), cell, n) for column in (time_s, values - origin))
    padded = (np.concatenate([np.full(half, np.nan), column, np.full(half, np.nan)]) for column in (times, means))
    x, y = (np.lib.stride_tricks.sliding_window_view(column, CELLS) for column in padded)
    has = np.isfinite(x)
    number = has.sum(axis=1)
    middles = [np.where(has, column, 0.0).sum(axis=1) / np.maximum(number, 1) for column in (x, y)]
    x, y = (np.where(has, column - middle[:, None], 0.0) for column, middle in zip((x, y), middles, strict=True))
    spread = (x**2).sum(axis=1)
    enough = (number >= FEWEST_POSITIONS) & (spread > 0.0)
    if not enough.any():
        return np.full(values.shape, np.nan)
    slopes = (x * y).sum(axis=1)[enough] / spread[enough]
    return np.where(enough[cell], np.interp(time_s, middles[0][enough], slopes), np.nan)


def constant_wind(north: FloatArray, east: FloatArray, horizontal: FloatArray) -> tuple[float, float]:
    """Return the constant wind, m/s to the north and to the east, that makes airspeeds of ground velocities.

    Least squares of horizontal - |v_ground - w| by Levenberg-Marquardt steps from no wind, with a prior standard
    deviation of 50 m/s, so that a flight straight ahead, which shows the wind along its track only, has none across.

    Parameters
    ----------
    north, east : (n_samples,) ground velocity, m/s.
    horizontal : (n_samples,) horizontal part of the true airspeed, m/s; samples that are not finite are left out.

    Raises
    ------
    ValueError : no sample is left.
    """
    from scipy.optimize import least_squares

    kept = np.isfinite(north) & np.isfinite(east) & np.isfinite(horizontal)
    if not kept.any():
        raise ValueError("a wind needs ground velocity and airspeed, got no sample with both")
    ground, speed = np.column_stack([north[kept], east[kept]]), horizontal[kept]
    prior = AIRSPEED_SD / WIND_SD

    def misfit(wind: FloatArray) -> FloatArray:
        return np.append(speed - np.linalg.norm(ground - wind, axis=1), prior * wind)

    def slopes(wind: FloatArray) -> FloatArray:
        through = ground - wind
        size = np.maximum(np.linalg.norm(through, axis=1), 1e-9)
        # |v - w| falls by the unit vector of v - w times the step of w.
        return np.vstack([through / size[:, None], prior * np.eye(2)])

    # Plain Gauss-Newton steps run away where the flight is straight; Levenberg-Marquardt's are damped.
    wind = least_squares(misfit, np.zeros(2), slopes, method="lm").x
    return float(wind[0]), float(wind[1])
