"""From a log and the settings to the record a detector works on, or to the line that says why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUTS
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog, require_usable, resample
from ..kernels.decimation import WHITE, decimate, lost_samples
from ..preprocessing.regression import Signals
from ..preprocessing.sampling_rate import RateChoice, choose_rate, is_exact
from ..preprocessing.window import must_resample
from ..wording import instant
from .inputs import directions, independent, moments
from .settings import DetectSettings

__all__ = ["Prepared", "Sampled", "prepare", "sampled"]

FloatArray = NDArray[np.float64]

OUTPUTS = ("tas", "tas_rate", "aoa", "pitch", "pitch_rate", "altitude_rate", "altitude")
LATERAL = ("aileron", "rudder")
FELT = ("longitudinal_acc", "normal_acc")
BANK = ("roll", "yaw_rate")
LONGITUDINAL = {"aoa", "pitch", "pitch_rate", "altitude_rate", "altitude", "normal_acc"}
TURNS = "what turns do to longitudinal motion is explained by more inputs made of roll and yaw_rate (--no-turns: not)"
STEEPEST = 0.2
STILL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """The window from the start of the healthy time on, at the log's own rate.

    Attributes
    ----------
    record : inputs and outputs, no dictionary.
    train : healthy time; watch_s : from when on the outputs are watched.
    inputs, outputs, units : names, and the unit of each output.
    choice : of the rate.
    exact : a linear model explains the healthy time to round-off.
    """

    record: Signals
    native_rate_hz: float
    train: tuple[float, float]
    watch_s: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    choice: RateChoice
    exact: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampled:
    """The record at the rate of the analysis.

    Attributes
    ----------
    time_s : (n,) of the samples; reach_s : how much later the last sample is that each of them was made of.
    y : (n, n_outputs).
    u : (n, k) mean and first moment, since the sample before, of each direction the inputs move in.
    weak : (k,) which of them are hardly more than noise in the healthy time.
    healthy : (n,) samples of the healthy time; watched : (n,) samples that are watched.
    """

    rate_hz: float
    time_s: FloatArray
    reach_s: float
    y: FloatArray
    u: FloatArray
    weak: NDArray[np.bool_]
    healthy: NDArray[np.bool_]
    watched: NDArray[np.bool_]


def prepare(log: FlightLog, settings: DetectSettings) -> Prepared:
    """Cut, check and, where the rate asks for it, resample a log.

    Raises
    ------
    LogError : it cannot be analysed.
    ConfigError : the healthy time is not in the log, or leaves nothing to watch.
    """
    part = log.window(settings.from_s, settings.to_s)
    train = settings.train or _first_third(part)
    start_s = train[0] if settings.train or settings.from_s is None else max(train[0], settings.from_s)
    inputs, outputs = _channels(log.window(start_s, settings.to_s), settings)
    bank = BANK if settings.turns and _turns(log, inputs, outputs) else ()
    helping = [name for name in ("pitch_rate",) if bank and name in log.channels and name not in outputs]
    part = _at_rate(log, settings, start_s, (*inputs, *outputs, *bank, *helping))
    watch_s = max(train[1], train[1] if settings.from_s is None else settings.from_s)
    _require_times(part, train, watch_s)
    record = Signals(
        path=part.path,
        rate_hz=part.rate_hz,
        factor=1,
        time_s=part.time_s,
        u=np.column_stack([np.zeros((part.n_samples, 0)), *_inputs(part, inputs, bank)]),
        y=part.signals(outputs),
        theta=np.zeros((part.n_samples, len(outputs), 0)),
    )
    before = part.time_s < train[1]
    healthy = replace(
        record, time_s=part.time_s[before], u=record.u[before], y=record.y[before], theta=record.theta[before]
    )
    exact = is_exact(healthy)
    return Prepared(
        record=record,
        native_rate_hz=log.rate_hz,
        train=train,
        watch_s=watch_s,
        inputs=inputs,
        outputs=outputs,
        units=tuple(part.channel(name).unit for name in outputs),
        choice=choose_rate(healthy, (), exact=False, asked=settings.rate_hz),
        exact=exact,
        notes=(*_notes(log, settings, train), *_trusted(settings, inputs), *((TURNS,) if bank else ())),
    )


def sampled(prepared: Prepared, factor: int) -> Sampled:
    """Return the record filtered and decimated by `factor`.

    Between two samples an input may move in any way; its mean and first moment over that time say nearly all of what it
    does to rigid-body motion, a single value at the sample does not.

    Raises
    ------
    LogError : the window is shorter than the filter.
    """
    record = prepared.record
    signals, weak = directions(record.u, record.time_s < prepared.train[1])
    try:
        y, u = decimate(record.y, factor, WHITE), decimate(moments(signals, factor), factor, WHITE)
    except ValueError as problem:
        raise LogError(f"{record.path}: {problem}; give a higher --rate or a longer window") from None
    first, last = lost_samples(factor, WHITE) if factor > 1 else (0, 0)
    time_s, reach_s = record.time_s[first::factor][: len(y)], last / record.rate_hz
    kept = independent(u)
    return Sampled(
        rate_hz=record.rate_hz / factor,
        time_s=time_s,
        reach_s=reach_s,
        y=y,
        u=u[:, kept],
        weak=np.resize(weak, u.shape[1])[kept],
        healthy=time_s + reach_s < prepared.train[1],
        watched=time_s + reach_s >= prepared.watch_s,
    )


def _first_third(part: FlightLog) -> tuple[float, float]:
    start, stop = float(part.time_s[0]), float(part.time_s[-1])
    return start, start + (stop - start) / 3.0


def _channels(part: FlightLog, settings: DetectSettings) -> tuple[tuple[str, ...], tuple[str, ...]]:
    inputs = settings.inputs or tuple(
        name
        for name in (*INPUTS, *FELT)
        if name not in (*LATERAL, *settings.outputs) and name in part.channels and _moves(part, name)
    )
    outputs = settings.outputs or tuple(
        name for name in OUTPUTS if name in part.channels and name not in inputs and _moves(part, name)
    )
    if not outputs:
        has = ", ".join(sorted(part.channels))
        raise LogError(f"{part.path}: no output to watch; the log has: {has}; name some with --output")
    for name in outputs:
        if not _moves(part, name):
            raise LogError(
                f"{part.path}: output '{name}' does not change (stays at {part.channel(name).values[0]:.6g}); "
                "choose other --output or another window"
            )
    return inputs, outputs


def _turns(log: FlightLog, inputs: Sequence[str], outputs: Sequence[str]) -> bool:
    free = all(name in log.channels and name not in (*inputs, *outputs) for name in BANK)
    return free and not LONGITUDINAL.isdisjoint(outputs) and all(_moves(log, name) for name in BANK)


def _inputs(part: FlightLog, inputs: Sequence[str], bank: Sequence[str]) -> list[FloatArray]:
    """Return the inputs and, where the log has the bank angle, what a turn adds to longitudinal motion.

    The pitch angle changes with q cos(roll) - r sin(roll), not with q; the load factor of a turn is 1 / cos(roll).
    """
    signals = [part.channel(name).values for name in inputs]
    if bank:
        roll, yaw_rate = (part.channel(name).values for name in bank)
        level = np.maximum(np.cos(roll), STEEPEST)
        signals += [yaw_rate * np.sin(roll), 1.0 / level - 1.0]
        if "pitch_rate" in part.channels:
            signals.append(part.channel("pitch_rate").values * (1.0 - level))
    return signals


def _moves(part: FlightLog, name: str) -> bool:
    values = part.channel(name).values
    finite = values[np.isfinite(values)]
    return bool(finite.size and np.ptp(finite) > STILL * np.max(np.abs(finite)))


def _at_rate(log: FlightLog, settings: DetectSettings, start_s: float, names: Sequence[str]) -> FlightLog:
    """Return the part from `start_s` on, resampled where the wanted rate cannot be reached by decimation."""
    part = log.window(start_s, settings.to_s)
    if not must_resample(part, names, settings.rate_hz):
        return part
    assert not isinstance(settings.rate_hz, str)
    part = resample(log, settings.rate_hz, from_s=start_s, to_s=settings.to_s)
    require_usable(part, names)
    return part


def _require_times(part: FlightLog, train: tuple[float, float], watch_s: float) -> None:
    first, last = float(part.time_s[0]), float(part.time_s[-1])
    if train[0] < first - 1.0 / part.rate_hz or train[1] > last:
        raise ConfigError(
            f"--train: {instant(train[0])}:{instant(train[1])} is not inside the window, {instant(first)} s to "
            f"{instant(last)} s; change --train, --from or --to"
        )
    if watch_s >= last:
        raise ConfigError(f"--train: nothing is left to watch after {instant(watch_s)} s; end it earlier")


def _trusted(settings: DetectSettings, inputs: Sequence[str]) -> tuple[str, ...]:
    felt = [name for name in FELT if name in inputs and not settings.inputs]
    if not felt:
        return ()
    return (f"taken as inputs, and to be right: {', '.join(felt)}, which feel gusts and thrust (--input chooses)",)


def _notes(log: FlightLog, settings: DetectSettings, train: tuple[float, float]) -> tuple[str, ...]:
    notes = []
    if settings.train is None:
        notes.append(
            f"no healthy time was given: the first third of the window, {instant(train[0])} to {instant(train[1])} s, "
            "is taken to be free of faults; a fault that is in it is part of what is normal (--train A:B)"
        )
    elif train[0] > (float(log.time_s[0]) if settings.from_s is None else settings.from_s) + 1.0 / log.rate_hz:
        notes.append(f"what is before the healthy time, before {instant(train[0])} s, is not looked at")
    return tuple(notes)
