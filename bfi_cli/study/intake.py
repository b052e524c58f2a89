"""From a log, a dictionary and a configuration to the record an analysis works on, or to the line that says why not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..conditioning import Choice, Conditioned, Record, choose_factor, condition, is_exact
from ..config import Config
from ..dictionary import Dictionary, dead_reason, signals
from ..errors import DictionaryError, ExcitationError, LogError
from ..faults import Fault
from ..flightlog import FlightLog, require_usable, resample
from ..flightlog.quality import hold_of
from ..flightlog.record import Channel, frozen_array
from ..flightlog.timing import is_uniform
from ..kernels.decimation import WHITE, Lowpass
from ..kernels.progress import Report, shares, silent
from .memory import slowed
from .scaled import left_out

__all__ = ["Intake", "lowpass_of", "take_in"]

FloatArray = NDArray[np.float64]

STILL_ANGLE = 5e-4
STILL_RELATIVE = 1e-6
SMALLEST = 1e-30
SAME = 1e-3
PASSENGER = "dictionary "


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Intake:
    """The window, conditioned, and which dictionary entries can be looked for in it.

    Attributes
    ----------
    log : the window, at the rate before conditioning.
    faults : every dictionary entry, times on the log's axis; names : their names.
    reasons : why an entry is left out, by index; live : the others.
    record : at the log's own rate; conditioned : as analysed; choice : of the rate.
    window_start_s : what `phase_reference: window` counts from.
    native_rate_hz : of the log as it was read.
    outputs : names of the outputs.
    exact : a VARX explains the record to round-off at its own rate.
    """

    log: FlightLog
    faults: tuple[Fault, ...]
    names: tuple[str, ...]
    reasons: Mapping[int, str]
    live: tuple[int, ...]
    record: Record
    conditioned: Conditioned
    choice: Choice
    window_start_s: float
    native_rate_hz: float
    outputs: tuple[str, ...]
    exact: bool


def take_in(log: FlightLog, dictionary: Dictionary, config: Config, report: Report = silent) -> Intake:
    """Cut, check and condition a log; `report` is told how far it is.

    Raises
    ------
    LogError, ExcitationError : the log cannot be analysed.
    DictionaryError : no entry of the dictionary can be seen in the window.
    """
    part = log.window(config.window.from_s, config.window.to_s)
    report(0.0)
    window_start_s = float(part.time_s[0])
    native_rate_hz = part.rate_hz
    faults = dictionary.resolved(window_start_s)
    names = tuple(fault.name or fault.shape for fault in faults)
    stop_s = float(part.time_s[-1]) + 1.0 / part.rate_hz
    reasons = {
        j: reason
        for j, fault in enumerate(faults)
        if (reason := dead_reason(fault, window_start_s, stop_s, outputs=config.outputs)) is not None
    }
    seen = {j: fault for j, fault in enumerate(faults) if j not in reasons}
    if _reached_by_decimation(part, config):
        theta = _signals(part.time_s, seen, config, window_start_s)
    else:
        part, theta = _resampled(log, seen, config, window_start_s)
    _require_movement(part, config)
    record = _record(part, config, np.insert(theta, _gaps(reasons), 0.0, axis=2))
    exact = is_exact(record)
    choosing, comparing = shares(report, 1, 1)
    choice = _choice(record, seen, config, exact=exact, report=choosing)
    conditioned = condition(record, choice.factor, lowpass_of(config))
    reasons |= left_out(conditioned, names, [j for j in range(len(faults)) if j not in reasons], comparing)
    live = tuple(j for j in range(len(faults)) if j not in reasons)
    if not live:
        first = reasons[min(reasons)] if reasons else "it has no entry; add one"
        raise DictionaryError(f"{dictionary.path}: no live atom: {first}")
    return Intake(
        log=part,
        faults=faults,
        names=names,
        reasons=reasons,
        live=live,
        record=record,
        conditioned=conditioned,
        choice=choice,
        window_start_s=window_start_s,
        native_rate_hz=native_rate_hz,
        outputs=config.outputs,
        exact=exact,
    )


def lowpass_of(config: Config) -> Lowpass:
    """Return the filter of a configuration."""
    return Lowpass(half_width=WHITE.half_width, cutoff=WHITE.cutoff, kind=config.conditioning.filter)


def _reached_by_decimation(part: FlightLog, config: Config) -> bool:
    """Say whether the window can be analysed as it is, decimated or not; otherwise it has to be resampled."""
    names = [*config.inputs, *config.outputs]
    rate = config.conditioning.rate_hz
    require_usable(part, names, resampling=isinstance(rate, float))
    if not isinstance(rate, float):
        return True
    ratio = part.rate_hz / rate
    whole = ratio > 1.0 - SAME and abs(ratio - round(ratio)) < SAME * ratio
    return whole and is_uniform(part.time_s) and not any(hold_of(part, part.channel(n).values) for n in names)


def _resampled(
    log: FlightLog, faults: Mapping[int, Fault], config: Config, window_start_s: float
) -> tuple[FlightLog, FloatArray]:
    """Resample the window and, as channels of it, the dictionary: both must pass the same filter."""
    rate = config.conditioning.rate_hz
    assert isinstance(rate, float)
    raw = _signals(log.time_s, faults, config, window_start_s)
    places = [(i, j) for i in range(raw.shape[1]) for j in range(raw.shape[2]) if np.any(raw[:, i, j])]
    passengers = {
        f"{PASSENGER}{i} {j}": Channel(name="", values=frozen_array(raw[:, i, j]), unit="", source="")
        for i, j in places
    }
    loaded = replace(log, channels={**log.channels, **passengers})
    resampled = resample(loaded, rate, from_s=config.window.from_s, to_s=config.window.to_s)
    theta = np.zeros((resampled.n_samples, *raw.shape[1:]))
    for i, j in places:
        theta[:, i, j] = resampled.channels[f"{PASSENGER}{i} {j}"].values
    channels = {name: channel for name, channel in resampled.channels.items() if not name.startswith(PASSENGER)}
    analysed = replace(resampled, channels=channels)
    require_usable(analysed, [*config.inputs, *config.outputs])
    return analysed, theta


def _signals(time_s: FloatArray, faults: Mapping[int, Fault], config: Config, window_start_s: float) -> FloatArray:
    return signals(list(faults.values()), time_s, list(config.outputs), window_start_s=window_start_s)


def _gaps(reasons: Mapping[int, str]) -> list[int]:
    """Where `np.insert` puts the columns of the entries left out."""
    return [j - n for n, j in enumerate(sorted(reasons))]


def _require_movement(log: FlightLog, config: Config) -> None:
    still = [name for name in config.inputs if _is_still(log, name)]
    if len(still) == len(config.inputs):
        channel = log.channel(still[0])
        moved = float(np.ptp(channel.values))
        raise ExcitationError(
            f"{log.path}: '{still[0]}' does not move (range {moved:.4g} {channel.unit}); without excitation the "
            "dynamics cannot be told from a drift; choose a window with a manoeuvre"
        )
    for name in config.outputs:
        values = log.channel(name).values
        if np.ptp(values) <= max(STILL_RELATIVE * np.max(np.abs(values)), SMALLEST):
            raise LogError(
                f"{log.path}: output '{name}' does not change (stays at {values[0]:.6g}); "
                "choose another --output or window"
            )


def _is_still(log: FlightLog, name: str) -> bool:
    channel = log.channel(name)
    moved = float(np.ptp(channel.values))
    if channel.unit == "rad":
        return moved < STILL_ANGLE
    return moved <= max(STILL_RELATIVE * float(np.max(np.abs(channel.values))), SMALLEST)


def _record(log: FlightLog, config: Config, theta: FloatArray) -> Record:
    return Record(
        path=log.path,
        rate_hz=log.rate_hz,
        time_s=log.time_s,
        u=log.signals(config.inputs),
        y=log.signals(config.outputs),
        theta=theta,
    )


def _choice(record: Record, faults: dict[int, Fault], config: Config, *, exact: bool, report: Report) -> Choice:
    rate_hz = config.conditioning.rate_hz
    if rate_hz == "auto":
        choice = choose_factor(record, list(faults.values()), exact=exact)
        return choice if exact else slowed(record, choice, faults, config, lowpass_of(config), report)
    if isinstance(rate_hz, float):
        return Choice(factor=max(1, round(record.rate_hz / rate_hz)), reason="asked for")
    return Choice(factor=1, reason="the log's own rate, as asked for")
