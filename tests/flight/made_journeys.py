"""A journey made up for the tests of the diagnosis: from the runway and back to it, every channel from one motion.

The aircraft is a point with a lift that is proportional to angle of attack and impact pressure, in coordinated flight
through a steady wind, so that lift, climb, kinematics and ground speed are constants but for noise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from made_logs import made_log

from bfi_cli.airdata import (
    G,
    channels_of,
    impact_pressure_of_mach,
    isa_temperature,
    pressure_at,
    speed_of_sound,
    total_temperature,
)
from bfi_cli.flightlog import FlightLog, write_log

FloatArray = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

RATE_HZ = 5.0
TAKE_OFF_S, CRUISE_S, DESCENT_S, LANDING_S, END_S = 40.0, 220.0, 720.0, 900.0, 960.0
ZERO_LIFT, LIFT_SLOPE = np.radians(-1.2), 0.02  # rad; m/s^2 per Pa and rad
WARMER = 6.0  # K, than the standard atmosphere
WIND = (6.0, -9.0)  # m/s to the north and to the east
UNITS = {
    "altitude": "m",
    **dict.fromkeys(("tat", "sat"), "K"),
    **dict.fromkeys(("aoa", "pitch", "roll", "elevator"), "rad"),
    **dict.fromkeys(("normal_acc", "longitudinal_acc"), "m/s^2"),
    "mach": "1",
}
NOISE = {
    **dict.fromkeys(("tas", "cas", "altitude_rate"), 0.03),
    **dict.fromkeys(("velocity_north", "velocity_east"), 0.05),
    **dict.fromkeys(("tat", "sat"), 0.03),
    **dict.fromkeys(("aoa", "pitch", "roll", "elevator"), 2e-4),
    **dict.fromkeys(("normal_acc", "longitudinal_acc"), 0.01),
    "altitude": 0.1,
    "mach": 8e-5,
}


def made_journey(*, seed: int = 0, rate_hz: float = RATE_HZ) -> FlightLog:
    """Return the log of a healthy flight of sixteen minutes: cruise from 220 to 720 s at 110 m/s and 1900 m."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(END_S * rate_hz)) / rate_hz
    knots_s = (0.0, 10.0, TAKE_OFF_S, 90.0, 240.0, 380.0, 420.0, 700.0, 760.0, 830.0, LANDING_S, 930.0, END_S)
    knots = (0.0, 0.0, 62.0, 85.0, 110.0, 110.0, 96.0, 110.0, 105.0, 72.0, 58.0, 5.0, 0.0)
    speed = _smooth(np.interp(t, knots_s, knots), 6.0, rate_hz)
    height = np.interp(
        t, (0.0, 45.0, CRUISE_S, DESCENT_S, LANDING_S, END_S), (100.0, 100.0, 1900.0, 1900.0, 100.0, 100.0)
    )
    height = _smooth(height, 6.0, rate_hz)
    aloft = _smooth(((t > 50.0) & (t < 890.0)).astype(np.float64), 4.0, rate_hz)
    height = height + aloft * (12.0 * np.sin(2.0 * np.pi * t / 63.0) + 1.5 * _air(rng, t))
    speed = np.maximum(speed + aloft * 0.8 * _air(rng, t), 0.0)
    turning = np.zeros(t.size)
    for first_s, last_s, rate in ((300.0, 360.0, 0.026), (470.0, 530.0, -0.026), (600.0, 650.0, 0.026)):
        turning += rate * ((t >= first_s) & (t < last_s))
    turning = _smooth(turning, 5.0, rate_hz)
    heading = np.cumsum(turning) / rate_hz

    sat = isa_temperature(height) + WARMER
    p_static, mach = pressure_at(height), speed / speed_of_sound(sat)
    q_impact = impact_pressure_of_mach(mach, p_static)
    tat = total_temperature(sat, mach)
    made = channels_of(p_static, q_impact, tat, rate_of=t)

    # The height above ground grows faster than the pressure altitude in air that is warmer than the standard one.
    rise = np.gradient(height, t) * sat / isa_temperature(height)
    slope = np.arcsin(np.clip(rise / np.maximum(speed, 20.0), -0.5, 0.5))
    along = np.gradient(speed, t) + G * np.sin(slope)
    upward = G * np.cos(slope) + speed * np.gradient(slope, t)
    sideways = speed * np.cos(slope) * turning
    lift, bank = np.hypot(upward, sideways), np.arctan2(sideways, upward)
    load = lift
    for _ in range(4):
        aoa = ZERO_LIFT + np.minimum(load / (LIFT_SLOPE * np.maximum(q_impact, 1.0)), np.radians(9.0))
        load = lift * np.cos(aoa) - along * np.sin(aoa)
    pitch = np.arcsin(np.cos(aoa) * np.sin(slope) + np.sin(aoa) * np.cos(slope) * np.cos(bank))
    signals = {
        **{name: made[name] for name in ("tas", "cas", "mach", "altitude", "altitude_rate")},
        "tat": tat,
        "sat": sat,
        "aoa": aoa,
        "pitch": pitch,
        "roll": np.arcsin(np.cos(slope) * np.sin(bank) / np.cos(pitch)),
        "normal_acc": load - G,
        "longitudinal_acc": along * np.cos(aoa) + lift * np.sin(aoa),
        "velocity_north": speed * np.cos(slope) * np.cos(heading) + WIND[0],
        "velocity_east": speed * np.cos(slope) * np.sin(heading) + WIND[1],
        "elevator": 0.02 - 0.8 * (aoa - 0.05) + 0.004 * _air(rng, t),
    }
    noisy = {name: values + NOISE[name] * rng.standard_normal(t.size) for name, values in signals.items()}
    return made_log(t, UNITS, **noisy)


def write_journey(path: Path, *, seed: int = 0) -> Path:
    """Write the log of a healthy flight and return its path."""
    write_log(made_journey(seed=seed), path)
    return path


def _smooth(values: FloatArray, seconds: float, rate_hz: float) -> FloatArray:
    """Return the mean over a window that has no corners, the ends held."""
    n = 2 * round(seconds * rate_hz) + 1
    window = np.hanning(n + 2)[1:-1]
    padded = np.pad(values, n // 2, mode="edge")
    return np.asarray(np.convolve(padded, window / window.sum(), mode="valid"))


def _air(rng: np.random.Generator, t: FloatArray) -> FloatArray:
    """Return smooth motion of unit size with periods of 4 to 40 s."""
    frequency = 1.0 / rng.uniform(4.0, 40.0, 30)
    phase = rng.uniform(0.0, 2.0 * np.pi, 30)
    return np.asarray(np.sin(2.0 * np.pi * frequency * t[:, None] + phase).sum(axis=1) / np.sqrt(15.0))
