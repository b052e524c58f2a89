"""What ordinarily happens in a flight, added to a log: `bfi inject --ordinary CAUSE@S[:SIZE]`.

A cause is a row of `INJECTED`: how large it is, and one of three functions, which gives what channels read more, by how
much the impact pressure in the tube moves, or the times that the clock writes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..airdata import SEA_LEVEL_PRESSURE, altitude_of
from ..errors import LogError
from ..faults.ordinary import Making, Occurrence
from ..kernels import FloatArray
from ..quantities.text import instant
from .record import FlightLog

TURNED_S = 3.0  # in which a knob is turned, ten clicks of it
# RISES_S, SETTLES_S [s]: in which a gyro's error is there, and time constant of its erection: 30 to 200 s.
RISES_S, SETTLES_S = 5.0, 60.0
WAKE_S, EDDY_S = 30.0, 0.5  # how long a wake is crossed, and memory of its eddies
PAIR_S = 10  # samples between two pairs of a repeated and a skipped stamp


@dataclass(frozen=True, slots=True, kw_only=True)
class Injected(Making):
    """An ordinary cause of a log; of the functions of a log, a time and a size a row has one.

    Attributes
    ----------
    channels : by channel (n_samples,) what it reads more.
    impact : (n_samples,) share by which the impact pressure is larger.
    stamps : (n_samples,) times, s.
    """

    channels: Callable[[FlightLog, float, float], Mapping[str, FloatArray]] | None = None
    impact: Callable[[FlightLog, float, float], FloatArray] | None = None
    stamps: Callable[[FlightLog, float, float], FloatArray] | None = None


def _set_altimeter(log: FlightLog, at_s: float, size: float) -> dict[str, FloatArray]:
    turned = np.clip((log.time_s - at_s) / TURNED_S, 0.0, 1.0) * size
    setting = log.channels["baro_setting"].values if "baro_setting" in log.channels else SEA_LEVEL_PRESSURE
    name = next((name for name in ("baro_altitude", "altitude") if _is_recorded(log, name)), "")
    if not name:
        raise _lacks(log, "altimeter_set", "baro_altitude")
    changes = {name: altitude_of(setting) - altitude_of(setting + turned)}
    return changes | ({"baro_setting": turned} if "baro_setting" in log.channels else {})


def _erect(log: FlightLog, at_s: float, size: float) -> dict[str, FloatArray]:
    if not _is_recorded(log, "pitch"):
        raise _lacks(log, "attitude_settles", "pitch")
    since = log.time_s - at_s
    decay = np.exp(-np.maximum(since - RISES_S, 0.0) / SETTLES_S)
    return {"pitch": size * np.clip(since / RISES_S, 0.0, 1.0) * decay}


def _wake(log: FlightLog, at_s: float, size: float) -> FloatArray:
    """Return twice the share of the airspeed by which eddies move it: the impact pressure goes with its square."""
    from scipy.signal import lfilter

    speed = next((name for name in ("tas", "cas", "ias") if _is_recorded(log, name)), "")
    if not speed:
        raise _lacks(log, "wake", "tas")
    keeps = float(np.exp(-1.0 / (EDDY_S * log.rate_hz)))
    white = np.random.default_rng(abs(round(1000.0 * at_s))).standard_normal(log.n_samples)
    eddies = np.asarray(lfilter([np.sqrt(1.0 - keeps**2)], [1.0, -keeps], white))
    crossed = (log.time_s >= at_s) & (log.time_s < at_s + WAKE_S)
    flown = float(np.nanquantile(log.channels[speed].values, 0.9))
    return np.where(crossed, 2.0 * size / max(flown, 1.0) * eddies, 0.0)


def _repeat_and_skip(log: FlightLog, at_s: float, size: float) -> FloatArray:
    """Return times of which a sample's is that of the one before it, so that one is skipped after it."""
    stamps = log.time_s.copy()
    first = int(np.searchsorted(log.time_s, at_s))
    late = np.arange(first, log.n_samples, PAIR_S)[: max(round(abs(size)), 1)]
    late = late[late > 0]
    stamps[late] = log.time_s[late - 1]
    return stamps


INJECTED: Mapping[str, Injected] = {
    "altimeter_set": Injected(
        text="the altimeter's knob is turned by so much", size=500.0, unit="Pa", channels=_set_altimeter
    ),
    "attitude_settles": Injected(
        text="a gyro horizon errs in pitch and erects, with a time constant of a minute",
        size=0.05,
        unit="rad",
        channels=_erect,
    ),
    "wake": Injected(text="a wake moves the airspeed for 30 s, standard deviation", size=3.0, unit="m/s", impact=_wake),
    "clock": Injected(
        text="the clock repeats a sample's time and skips the next, so often",
        size=5.0,
        unit="",
        stamps=_repeat_and_skip,
    ),
}


def _is_recorded(log: FlightLog, name: str) -> bool:
    return name in log.channels and not log.channels[name].derived_from


def _lacks(log: FlightLog, cause: str, channel: str) -> LogError:
    has = ", ".join(sorted(log.channels))
    return LogError(f"{log.path}: '{cause}' needs {channel}; the log has: {has}; map one with --channel {channel}=NAME")


def check_within(log: FlightLog, occurrence: Occurrence) -> None:
    """Check that an ordinary cause lies in the log.

    Raises
    ------
    LogError : it does not.
    """
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1])
    if not start_s <= occurrence.at_s <= stop_s:
        span = f"the log has {instant(start_s)} to {instant(stop_s)} s"
        at = f"{log.path}: '{occurrence.cause}' at {instant(occurrence.at_s)} s"
        raise LogError(f"{at} is outside: {span}; give a time in it")
