"""Flights made up for the tests of air data: pressures that move, and every channel that follows from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from made_logs import made_log

from bfi_cli.airdata import (
    channels_of,
    impact_pressure_of_mach,
    isa_temperature,
    pressure_at,
    speed_of_sound,
    total_temperature,
)
from bfi_cli.flightlog import FlightLog

UNITS = {"altitude": "m", "mach": "1", "tat": "K", "sat": "K", "p_static": "Pa", "p_total": "Pa", "q_impact": "Pa"}
RECORDED = ("altitude", "cas", "mach", "tas", "tat", "sat")


def made_flight(
    *,
    seconds: float = 600.0,
    rate_hz: float = 10.0,
    speed: float = 110.0,
    climbs_m: float = 200.0,
    air_pa: float = 40.0,
    names: Collection[str] = RECORDED,
    steps: Mapping[str, float] | None = None,
    noise_pa: float = 0.0,
    seed: int = 0,
) -> FlightLog:
    """Return a flight without faults.

    Parameters
    ----------
    speed : true airspeed about which the aircraft flies, m/s.
    climbs_m : by which it climbs and descends; air_pa : by which the air moves both pressures within seconds.
    steps : of the recorded values by channel; noise_pa : white noise of both transducers.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    altitude = 2000.0 + climbs_m * np.sin(2.0 * np.pi * time_s / 180.0)
    sat = isa_temperature(altitude) + 4.0
    tas = speed * (1.0 + 0.05 * np.sin(2.0 * np.pi * time_s / 75.0 + 1.0))
    p_static, mach = pressure_at(altitude), tas / speed_of_sound(sat)
    static_gust, gust = (air_pa * _gusts(rng, time_s) for _ in range(2))
    p_static = p_static + 0.3 * static_gust + noise_pa * rng.standard_normal(time_s.size)
    q_impact = np.maximum(
        impact_pressure_of_mach(mach, p_static) + gust + noise_pa * rng.standard_normal(time_s.size), 1.0
    )
    tat = total_temperature(sat, mach)
    made = channels_of(p_static, q_impact, tat, rate_of=time_s) | {"tat": tat}
    signals = {name: made[name] for name in names}
    for name, step in (steps or {}).items():
        signals[name] = np.round(signals[name] / step) * step
    return made_log(time_s, UNITS, **signals)


def _gusts(rng: np.random.Generator, time_s: np.ndarray) -> np.ndarray:
    """Return a smooth signal of unit size with periods of 2 to 60 s."""
    frequency = 1.0 / rng.uniform(2.0, 60.0, 40)
    phase = rng.uniform(0.0, 2.0 * np.pi, 40)
    return np.asarray(np.sin(2.0 * np.pi * frequency * time_s[:, None] + phase).sum(axis=1) / np.sqrt(20.0))
