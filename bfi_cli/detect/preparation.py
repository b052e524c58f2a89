"""The settings of a detection and the record it works on: channels and healthy time, directions of inputs, rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..channels import INPUTS
from ..config import Config
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog, require_usable, resample
from ..kernels.decimation import WHITE, decimate, lost_samples
from ..preprocessing.regression import Signals
from ..preprocessing.sampling_rate import RateChoice, choose_rate, is_exact
from ..preprocessing.window import must_resample
from ..report.text import instant

__all__ = ["DecimatedRecord", "DetectSettings", "PreparedRecord", "decimate_record", "directions", "independent"]
__all__ += ["moments", "prepare_record", "settings_of"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Method = Literal["auto", "exact", "parity"]

# What is watched where the user names nothing, and the controls of the other axes, which then are no inputs.
OUTPUTS = ("tas", "tas_rate", "aoa", "pitch", "pitch_rate", "altitude_rate", "altitude")
LATERAL = ("aileron", "rudder")
# Accelerations feel gusts and thrust at once, which the controls do not: with them 3 of 3 biases of the airspeed are
# localised in recorded flights, with the elevator alone 2 (docs/validation.md).
FELT = ("longitudinal_acc", "normal_acc")
# What a turn needs to be explained, and the outputs that it changes.
BANK = ("roll", "yaw_rate")
LONGITUDINAL = {"aoa", "pitch", "pitch_rate", "altitude_rate", "altitude", "normal_acc"}
TURNS = "what turns do to longitudinal motion is explained by more inputs made of roll and yaw_rate (--no-turns: not)"
# Cosine of the steepest bank, 78 degrees: the load factor of a turn has no bound.
STEEPEST = 0.2
# Relative to the channel's extent: what moves less only shows round-off.
STILL = 1e-9
# Of a column's norm left by the columns before it, above the round-off of their filtering.
DEPENDENT = 1e-6
# Of the largest singular value: inputs that move together differ by their noise.
TOGETHER = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectSettings:
    """Settings of `detect_faults`; times on the log's own axis.

    Attributes
    ----------
    inputs, outputs : channels; where empty, those of the log that suit: controls and accelerations, flight data.
    from_s, to_s : window, None for the ends of the log.
    train : healthy time, None for the first third of the window.
    false_alarm : accepted probability that a healthy record of the monitored length raises an alarm.
    rate_hz : a number, "none" for the log's own, "auto" to choose.
    method : "exact" for data without noise, "parity" for measured data, "auto" to choose.
    turns : what a turn does to longitudinal motion is explained by roll and yaw_rate where the log has them.

    Raises
    ------
    ConfigError : a probability outside (0, 1), a healthy time that ends before it starts, a rate that is not positive.
    """

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    from_s: float | None = None
    to_s: float | None = None
    train: tuple[float, float] | None = None
    false_alarm: float = 0.01
    rate_hz: float | Literal["none", "auto"] = "auto"
    method: Method = "auto"
    turns: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.false_alarm < 1.0:
            raise ConfigError(f"--false-alarm: must lie between 0 and 1, got {self.false_alarm:g}; give one like 0.01")
        if self.train is not None and not self.train[0] < self.train[1]:
            raise ConfigError(
                f"--train: must end after it starts, got {self.train[0]:g}:{self.train[1]:g}; give one like 0:8"
            )
        if not isinstance(self.rate_hz, str) and not self.rate_hz > 0.0:
            raise ConfigError(f"--rate: must be a positive number, none or auto, got {self.rate_hz:g}")
        both = sorted(set(self.inputs) & set(self.outputs))
        if both:
            raise ConfigError(f"--output: '{both[0]}' is both an input and an output; keep one")


def settings_of(config: Config) -> DetectSettings:
    """Return the settings a configuration states; inputs and outputs it leaves to their defaults are those of the log.

    Raises
    ------
    ConfigError : see `DetectSettings`.
    """
    given = config.model_fields_set
    return DetectSettings(
        inputs=config.inputs if "inputs" in given else (),
        outputs=config.outputs if "outputs" in given else (),
        from_s=config.window.from_s,
        to_s=config.window.to_s,
        train=config.detect.train,
        false_alarm=config.detect.false_alarm,
        rate_hz=config.conditioning.rate_hz,
        method=config.detect.method,
        turns=config.detect.turns,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedRecord:
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
class DecimatedRecord:
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
    weak: BoolArray
    healthy: BoolArray
    watched: BoolArray


def prepare_record(log: FlightLog, settings: DetectSettings) -> PreparedRecord:
    """Cut, check and, where the rate asks for it, resample a log.

    Raises
    ------
    LogError : it cannot be analysed.
    ConfigError : the healthy time is not in the log, or leaves nothing to watch.
    """
    part = log.window(settings.from_s, settings.to_s)
    first_s, last_s = float(part.time_s[0]), float(part.time_s[-1])
    train = settings.train or (first_s, first_s + (last_s - first_s) / 3.0)
    start_s = train[0] if settings.train or settings.from_s is None else max(train[0], settings.from_s)
    inputs, outputs = _channels(log.window(start_s, settings.to_s), settings)
    free = all(name in log.channels and name not in (*inputs, *outputs) and _moves(log, name) for name in BANK)
    bank = BANK if settings.turns and free and not LONGITUDINAL.isdisjoint(outputs) else ()
    helping = [name for name in ("pitch_rate",) if bank and name in log.channels and name not in outputs]
    part, needed = log.window(start_s, settings.to_s), (*inputs, *outputs, *bank, *helping)
    if must_resample(part, needed, settings.rate_hz):
        assert not isinstance(settings.rate_hz, str)
        part = resample(log, settings.rate_hz, from_s=start_s, to_s=settings.to_s)
        require_usable(part, needed)
    watch_s = max(train[1], train[1] if settings.from_s is None else settings.from_s)
    first_s, last_s = float(part.time_s[0]), float(part.time_s[-1])
    if train[0] < first_s - 1.0 / part.rate_hz or train[1] > last_s:
        raise ConfigError(
            f"--train: {instant(train[0])}:{instant(train[1])} is not inside the window, {instant(first_s)} s to "
            f"{instant(last_s)} s; change --train, --from or --to"
        )
    if watch_s >= last_s:
        raise ConfigError(f"--train: nothing is left to watch after {instant(watch_s)} s; end it earlier")
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
    return PreparedRecord(
        record=record,
        native_rate_hz=log.rate_hz,
        train=train,
        watch_s=watch_s,
        inputs=inputs,
        outputs=outputs,
        units=tuple(part.channel(name).unit for name in outputs),
        choice=choose_rate(healthy, (), exact=False, asked=settings.rate_hz),
        exact=is_exact(healthy),
        notes=(*_notes(log, settings, train, inputs), *((TURNS,) if bank else ())),
    )


def decimate_record(prepared: PreparedRecord, factor: int) -> DecimatedRecord:
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
    return DecimatedRecord(
        rate_hz=record.rate_hz / factor,
        time_s=time_s,
        reach_s=reach_s,
        y=y,
        u=u[:, kept],
        weak=np.resize(weak, u.shape[1])[kept],
        healthy=time_s + reach_s < prepared.train[1],
        watched=time_s + reach_s >= prepared.watch_s,
    )


def directions(u: FloatArray, healthy: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return (n_samples, k) signals that span the inputs, the strongest first, and which are hardly more than noise.

    Surfaces that move together are logged one by one, each with its own noise: together they say better where they are,
    and their differences say nothing. Inputs that rest in the healthy time stay as they are.

    Parameters
    ----------
    u : (n_samples, n_inputs); healthy : (n_samples,) the healthy time.
    """
    moved = u - u[healthy].mean(axis=0)
    spread, extent = moved[healthy].std(axis=0), np.abs(moved).max(axis=0, initial=0.0)
    rest = np.flatnonzero((spread <= STILL * extent) & (extent > 0.0))
    moving = np.flatnonzero(spread > STILL * extent)
    scaled = moved[:, moving] / spread[moving]
    _, values, V = np.linalg.svd(np.linalg.qr(scaled[healthy], mode="r"), full_matrices=False)
    signals = np.hstack([scaled @ V.T, moved[:, rest]])
    weak = np.append(values <= TOGETHER * values.max(initial=0.0), np.zeros(len(rest), dtype=bool))
    seen = np.abs(signals).max(axis=0, initial=0.0) > DEPENDENT
    return signals[:, seen], weak[seen]


def moments(u: FloatArray, factor: int) -> FloatArray:
    """Return (n_samples, k or 2 k): mean and first moment of each input over the last `factor` samples."""
    if factor == 1 or not u.shape[1]:
        return u
    held = np.vstack([np.repeat(u[:1], factor - 1, axis=0), u])
    windows = np.lib.stride_tricks.sliding_window_view(held, factor, axis=0)
    arms = (np.arange(factor) - 0.5 * (factor - 1)) / factor
    return np.hstack([windows.mean(axis=2), windows @ arms / factor])


def independent(u: FloatArray) -> NDArray[np.intp]:
    """Return which columns of u move and are no combination of those before them."""
    centred = u - u.mean(axis=0) if len(u) else u
    kept: list[int] = []
    for j, size in enumerate(np.ptp(u, axis=0) if u.shape[1] else ()):
        basis = np.linalg.qr(centred[:, kept])[0] if kept else np.zeros((len(u), 0))
        left = centred[:, j] - basis @ (basis.T @ centred[:, j])
        if size > 0.0 and np.linalg.norm(left) > DEPENDENT * np.linalg.norm(centred[:, j]):
            kept.append(j)
    return np.array(kept, dtype=np.intp)


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


def _notes(log: FlightLog, settings: DetectSettings, train: tuple[float, float], inputs: Sequence[str]) -> list[str]:
    notes = []
    if settings.train is None:
        notes.append(
            f"no healthy time was given: the first third of the window, {instant(train[0])} to {instant(train[1])} s, "
            "is taken to be free of faults; a fault that is in it is part of what is normal (--train A:B)"
        )
    elif train[0] > (float(log.time_s[0]) if settings.from_s is None else settings.from_s) + 1.0 / log.rate_hz:
        notes.append(f"what is before the healthy time, before {instant(train[0])} s, is not looked at")
    felt = [name for name in FELT if name in inputs and not settings.inputs]
    if felt:
        names = ", ".join(felt)
        notes.append(f"taken as inputs, and to be right: {names}, which feel gusts and thrust (--input chooses)")
    return notes
