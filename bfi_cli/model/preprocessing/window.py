"""A window of a log made ready for an analysis: cut, checked, filtered and decimated together with the dictionary."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...config import Config, merge
from ...dictionary import Dictionary, dead_reason, no_signal
from ...errors import DictionaryError, ExcitationError, LogError
from ...faults import Fault
from ...faults.filters import Filter, recorder_low_passes, response_of
from ...faults.shapes import SHAPES
from ...flightlog import Channel, FlightLog, require_usable, resample, resample_with
from ...flightlog.derived import with_derived
from ...flightlog.injection import added_by, line_signals
from ...flightlog.quality import held_hz, is_uniform, recorder_filters
from ...kernels import FloatArray
from ...kernels.atom_signals import amplitudes
from ...kernels.low_pass import WHITE, Lowpass, Response
from ...kernels.progress import Report, parts, silent
from ..result import LogSummary, log_summary
from .regression import RegressionData, build_regression, longest_order
from .signals import (
    EXACT_SAMPLES,
    LogSignal,
    NativeSignals,
    Purpose,
    Signals,
    candidate_orders,
    choose_rate,
    decimate_native,
    is_exact,
    require_one_model,
)

# Inputs of "auto": what moves a longitudinal motion, and what else of it a log may show. In recorded flights they cut
# the largest statistic of healthy windows from 129 to 39 and made the thresholds of two flights agree; the price is
# that a fault of one of them is taken for one of the output (docs/theory.md, 10.2).
TRUSTED = ("elevator", "pitch", "longitudinal_acc", "n1_left", "aoa", "normal_acc", "pitch_rate")
STILL_ANGLE = 5e-4  # rad: a control surface that moves by less than 0.03 degrees does not excite an aircraft
STILL_RELATIVE = 1e-6  # of the largest value: a constant stored in single precision moves by less
SMALLEST = 1e-30  # the travel of a signal that is zero
SAME_RATE = 1e-3  # relative error of a clock, within which a rate is a whole part of the log's
# Conditioned samples between the onsets that are tried where they are known to a tolerance only: the low-pass leaves a
# step a sample wide, so that the nearest of them misses the true onset by a quarter.
ONSET_STEP = 0.5
CONSTANT = 1e-9  # of an atom's largest value: a travel this small is round-off
DEPENDENT = 1e-7  # of an atom's norm: a part this small that earlier atoms do not explain is round-off


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedWindow:
    """The window in SI units, with the entries of the dictionary that can be identified in it.

    Attributes
    ----------
    log : the window, at the rate before decimation.
    names : of the dictionary's entries.
    reasons : why an entry is left out, by index; live : the indices of the others but for
    free : the indices of the entries of unknown course, whose signals are zero.
    native : signals at the log's own rate; signals : filtered by `lowpass` and decimated.
    largest : (n_faults,) the largest value of every entry's signal at the log's own rate.
    rate_reason : why the signals have their rate.
    filters : that the log went through, the recorder's first.
    recorder : a sentence on it, and on channels that are derived from others; recorder_hz : its edge, None where there
        is none or none is known.
    window_stop_s : a sample after the last.
    native_rate_hz : of the log as it was read.
    exact : a VARX explains the record to round-off at its own rate.
    orders : of the model, to choose from.
    sizes : by entry of a pressure line, the magnitude to which its signal is the secant; others have the derivative.
    elsewhere : by shape, its signals at other onsets, (n_samples, n_outputs, n_onsets), of a short record.
    """

    log: FlightLog
    names: tuple[str, ...]
    reasons: Mapping[int, str]
    live: tuple[int, ...]
    free: tuple[int, ...]
    native: NativeSignals
    signals: Signals
    largest: FloatArray
    rate_reason: str
    filters: tuple[Filter, ...]
    recorder: str
    recorder_hz: float | None
    lowpass: Lowpass
    window_stop_s: float
    native_rate_hz: float
    exact: bool
    orders: tuple[int, ...]
    sizes: Mapping[int, float] = field(default_factory=dict)
    elsewhere: dict[Fault, FloatArray] = field(init=False, repr=False, default_factory=dict)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Every entry of the dictionary, times on the log's axis."""
        return self.native.faults

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.native.outputs

    @property
    def response(self) -> Response:
        """Response of all filters that the log went through, at the rate of `native`."""
        return self.native.response

    @property
    def window_start_s(self) -> float:
        """What `phase_reference: window` counts from."""
        return self.native.window_start_s

    @property
    def exact_at_rate(self) -> bool:
        """Whether a VARX explains the record to round-off at the rate of the analysis."""
        return self.exact and self.signals.factor == 1

    @property
    def same_rate(self) -> float | str:
        """What `conditioning.rate_hz` has to be for another window to be analysed at the rate of this one."""
        return "none" if self.signals.factor == 1 else self.signals.rate_hz

    @property
    def summary(self) -> LogSummary:
        """What was analysed."""
        return log_summary(
            self.log.path,
            self.signals.time_s,
            rate_hz=self.signals.rate_hz,
            native_rate_hz=self.native_rate_hz,
            epoch=self.log.epoch,
        )


def prepare_window(
    log: FlightLog,
    dictionary: Dictionary,
    config: Config,
    report: Report = silent,
    *,
    purpose: Purpose = "estimate",
    courses: bool = False,
    selects: bool = False,
) -> PreparedWindow:
    """Cut, check, filter and decimate a log, and the signals of a dictionary with it; `report` receives the progress.

    Parameters
    ----------
    purpose : of the analysis, for which its rate is chosen.
    courses : it estimates entries of unknown course, which else are left out.
    selects : it estimates a few entries that it selects; else all at once, and combinations of others are left out.

    Raises
    ------
    LogError, ExcitationError : the log cannot be analysed.
    DictionaryError : no entry of the dictionary can be seen in the window.
    """
    from_s, to_s, rate_hz = config.window.from_s, config.window.to_s, config.conditioning.rate_hz
    used, known = [*config.inputs, *config.outputs], len(log.notes)
    log = with_derived(log, used, from_s=from_s, to_s=to_s)
    part = log.window(from_s, to_s)
    report(0.0)
    native_rate_hz, span = part.rate_hz, part.span_s
    faults = dictionary.resolved(span[0])
    filters, about_recorder = recorder_filters(log, config.recorder.edge_hz, config.recorder.kind)
    resamples = must_resample(part, used, rate_hz)
    native, reasons, free = _signals_of_entries(
        log if resamples else part, faults, config, span, response_of(filters, native_rate_hz), courses=courses
    )
    if resamples:
        assert not isinstance(rate_hz, str)
        part, theta = resample_with(log, native.theta_between(slice(None)), rate_hz, from_s=from_s, to_s=to_s)
        require_usable(part, used)
        filters = (*filters, *(part.filters or ())[len(log.filters or ()) :])
        native = replace(
            native,
            log=part,
            response=response_of(filters, part.rate_hz),
            log_signals={j: signal.at(part.time_s, log.time_s) for j, signal in native.log_signals.items()},
            resampled={j: theta[:, :, j] for j in native.seen},
        )
    _require_movement(part, config)
    native = replace(native, earlier=_earlier_signals(log, part.rate_hz, config, resamples=resamples))
    lowpass = replace(WHITE, kind=config.conditioning.filter)
    exact = is_exact(native.between(slice(EXACT_SAMPLES)))
    recorder_hz = min((low_pass.edge_hz for low_pass in recorder_low_passes(filters)), default=None)
    seen = [faults[j] for j in native.seen]
    factor, reason = choose_rate(native, seen, exact=exact, asked=rate_hz, recorder_hz=recorder_hz, purpose=purpose)
    require_one_model(log.path, span[1] - span[0], native.rate_hz / factor, purpose=purpose)
    decimated, largest = decimate_native(native, factor, lowpass)
    names = tuple(fault.called for fault in faults)
    reasons |= unusable_atoms(decimated.theta, names, native.seen, report, selects=selects)
    live = tuple(j for j in native.seen if j not in reasons)
    if not live and not free:
        first = reasons[min(reasons)] if reasons else "it has no entry; add one"
        raise DictionaryError(f"{dictionary.path}: no live atom: {first}")
    longest = longest_order(len(decimated.time_s), n_inputs=len(config.inputs), n_outputs=len(config.outputs))
    return PreparedWindow(
        log=part,
        names=names,
        reasons=reasons,
        live=live,
        free=free,
        native=native,
        signals=decimated,
        largest=largest,
        rate_reason=reason,
        filters=filters,
        recorder="; ".join(filter(None, (about_recorder, *(note.text for note in log.notes[known:])))),
        recorder_hz=recorder_hz,
        lowpass=lowpass,
        window_stop_s=span[1],
        native_rate_hz=native_rate_hz,
        exact=exact,
        orders=candidate_orders(config, decimated.rate_hz, recorder_hz, longest),
    )


def _earlier_signals(log: FlightLog, rate_hz: float, config: Config, *, resamples: bool) -> tuple[NativeSignals, ...]:
    """Return the signals of the earlier records of a log.

    Parameters
    ----------
    rate_hz : of the window; resamples : it was resampled to it.

    Raises
    ------
    LogError : a record cannot be analysed, or has another rate.
    """
    used, made = [*config.inputs, *config.outputs], []
    weights = log.earlier_weights or (1.0,) * len(log.earlier)
    for earlier_log, weight in zip(log.earlier, weights, strict=True):
        try:
            part = with_derived(earlier_log, used)
            require_usable(part, used, resampling=resamples)
            if resamples:
                part = resample(part, rate_hz)
                require_usable(part, used)
        except LogError as problem:
            raise LogError(f"--together: {problem}") from None
        if abs(part.rate_hz / rate_hz - 1.0) > SAME_RATE:
            raise LogError(
                f"--together: {part.path}: recorded at {part.rate_hz:.4g} Hz, {log.path} at {rate_hz:.4g} Hz; "
                f"give --rate {min(part.rate_hz, rate_hz):.4g} or less"
            )
        made.append(NativeSignals(log=part, inputs=config.inputs, outputs=config.outputs, weight=weight))
    return tuple(made)


def _signals_of_entries(
    log: FlightLog,
    faults: tuple[Fault, ...],
    config: Config,
    span: tuple[float, float],
    response: Response,
    *,
    courses: bool,
) -> tuple[NativeSignals, dict[int, str], tuple[int, ...]]:
    """Return a log with what makes the signals of a dictionary, why entries are left out, and those of unknown course.

    Parameters
    ----------
    span : of the window, s.
    courses : those of unknown course are not left out.
    """
    dead = ((j, dead_reason(fault, *span, outputs=config.outputs)) for j, fault in enumerate(faults))
    reasons = {j: reason for j, reason in dead if reason is not None}
    unknown = [j for j, fault in enumerate(faults) if j not in reasons and SHAPES[fault.shape].acts_on == "course"]
    free = tuple(unknown) if courses else ()
    reasons |= {j: no_signal(faults[j]) for j in unknown if j not in free}
    log_signals: dict[int, LogSignal] = {}
    for j, fault in enumerate(faults):
        if j not in reasons and SHAPES[fault.shape].acts_on not in ("channel", "course"):
            try:
                log_signals[j] = _log_signal(log, fault, response, config.outputs)
            except (DictionaryError, LogError) as problem:
                if SHAPES[fault.shape].lines is None:
                    raise
                reasons[j] = str(problem).removeprefix(f"{log.path}: ")
    seen = tuple(j for j in range(len(faults)) if j not in reasons and j not in free)
    native = NativeSignals(
        log=log,
        inputs=config.inputs,
        outputs=config.outputs,
        faults=faults,
        seen=seen,
        window_start_s=span[0],
        response=response,
        log_signals=log_signals,
    )
    return native, reasons, free


def with_inputs_of(log: FlightLog, config: Config) -> Config:
    """Return the configuration with the trusted channels of the log in place of the input "auto".

    Those that are not finite throughout the window are left out, as the outputs are.

    Raises
    ------
    LogError : the log has none of them.
    """
    if config.inputs != ("auto",):
        return config
    part = log.window(config.window.from_s, config.window.to_s)
    names = [name for name in TRUSTED if name in part.channels and name not in config.outputs]
    inputs = tuple(name for name in names if np.isfinite(part.channels[name].values).all())
    if not inputs:
        raise LogError(f"{log.path}: --input auto: none of {', '.join(TRUSTED)} is in the log; name an --input")
    return merge(config, {"inputs": inputs})


def regression_of(window: PreparedWindow, config: Config, report: Report = silent) -> RegressionData:
    """Return the regression of a window with all its live entries.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    return build_regression(window.signals, window.live, config, orders=window.orders, report=report)


def shifts_within(window: PreparedWindow, entry: int, tolerance_s: float) -> FloatArray:
    """Return the times by which an entry may begin later than the dictionary states, half a sample apart, s.

    0 is not among them, nor what would begin outside the window. None where it begins before the window, or where a
    model explains the window to round-off: what differs from it by round-off says nothing about onsets.
    """
    start_s, stop_s = float(window.native.time_s[0]), float(window.native.time_s[-1])
    onset_s = window.faults[entry].onset_s
    if tolerance_s <= 0.0 or window.exact_at_rate or not start_s < onset_s < stop_s:
        return np.zeros(0)
    native_s = 1.0 / window.native.rate_hz
    step_s = native_s * max(1, round(ONSET_STEP / window.signals.rate_hz / native_s))
    far = int(np.floor(tolerance_s / step_s * (1.0 + SAME_RATE)))
    shifts = step_s * np.concatenate([np.arange(-far, 0), np.arange(1, far + 1)])
    return np.asarray(shifts[(onset_s + shifts > start_s) & (onset_s + shifts < stop_s)])


def signals_of_faults(window: PreparedWindow, faults: Sequence[Fault], sizes: Sequence[float] = ()) -> FloatArray:
    """Return (n_samples, n_outputs, n_faults) the signals of faults, as those of the window.

    That of a fault of a pressure line whose signal the log cannot tell is 0.

    Parameters
    ----------
    sizes : of each fault, see `PreparedWindow.sizes`; default 0.
    """
    log_signals = dict[int, LogSignal]()
    stated = list[int]()
    for i, (fault, size) in enumerate(zip(faults, sizes or [0.0] * len(faults), strict=True)):
        if SHAPES[fault.shape].acts_on == "channel":
            stated.append(i)
        else:
            with contextlib.suppress(DictionaryError, LogError):
                log_signals[i] = _log_signal(
                    window.log, fault, window.response, window.outputs, size=size, with_slopes=False
                )
    made = window.native.with_faults(faults, (*stated, *log_signals), log_signals)
    return made.theta_decimated(window.signals.factor, window.lowpass)[0]


def with_onsets(window: PreparedWindow, shifts_s: Mapping[int, float]) -> PreparedWindow:
    """Return the window with entries that begin and end later by some seconds.

    Parameters
    ----------
    shifts_s : seconds by entry.
    """
    moved = {entry: window.faults[entry].later(shift_s) for entry, shift_s in shifts_s.items()}
    return _with_entries(window, moved, window.sizes) if shifts_s else window


def with_sizes(window: PreparedWindow, sizes: Mapping[int, float]) -> PreparedWindow:
    """Return the window with the signals of entries of a pressure line taken as the secants to some magnitudes.

    Parameters
    ----------
    sizes : by entry; that of an entry not among them is its derivative.

    Raises
    ------
    DictionaryError, LogError : the log does not tell the signal of a fault of such a magnitude.
    """
    return _with_entries(window, {entry: window.faults[entry] for entry in {*sizes, *window.sizes}}, sizes)


def _with_entries(window: PreparedWindow, faults: Mapping[int, Fault], sizes: Mapping[int, float]) -> PreparedWindow:
    """Return the window with faults in place of some entries, those of pressure lines as secants to some sizes."""
    native, entries, largest = window.native, list(faults), window.largest.copy()
    log_signals = {
        entry: _log_signal(window.log, fault, window.response, window.outputs, size=sizes.get(entry, 0.0))
        for entry, fault in faults.items()
        if SHAPES[fault.shape].acts_on != "channel"
    }
    alone = native.with_faults(
        list(faults.values()),
        range(len(faults)),
        {n: log_signals[j] for n, j in enumerate(entries) if j in log_signals},
    )
    rate, theta = (window.signals.factor, window.lowpass), window.signals.theta.copy()
    theta[:, :, list(entries)], largest[entries] = alone.theta_decimated(*rate)
    made = native.with_others(faults, log_signals)
    return replace(
        window,
        native=made,
        signals=replace(window.signals, theta=theta, slopes=made.slopes_at(*rate)),
        largest=largest,
        sizes=dict(sizes),
    )


def must_resample(part: FlightLog, names: Sequence[str], rate_hz: float | str) -> bool:
    """Check the channels, and say whether the log must be resampled because decimation cannot bring it to the rate.

    It must for a rate that is no whole part of the log's, an uneven time step, or held samples.

    Parameters
    ----------
    part : the window.
    rate_hz : asked for; "none" and "auto" never resample.

    Raises
    ------
    LogError : a channel cannot be analysed, see `require_usable`.
    """
    require_usable(part, names, resampling=not isinstance(rate_hz, str))
    if isinstance(rate_hz, str):
        return False
    ratio = part.rate_hz / rate_hz
    whole = ratio > 1.0 - SAME_RATE and abs(ratio - round(ratio)) < SAME_RATE * ratio
    held = (held_hz(part, part.channel(name)) is not None for name in names)
    return not whole or not is_uniform(part.time_s) or any(held)


def _log_signal(
    log: FlightLog,
    fault: Fault,
    response: Response,
    outputs: Sequence[str],
    *,
    size: float = 0.0,
    with_slopes: bool = True,
) -> LogSignal:
    """Return the signal of a fault that depends on what the log shows.

    Raises
    ------
    LogError, DictionaryError : the log does not tell it, see `bfi_cli.flightlog.injection.line_signals`.
    """
    names = [log.channel(name).name for name in outputs]
    values, slopes = np.zeros((log.n_samples, len(names))), np.zeros((log.n_samples, len(names)))
    if SHAPES[fault.shape].lines is None:
        channel = log.channel(fault.channel).name
        added = added_by(log, replace(fault, magnitude=1.0, channel=channel), response)
        values[:, names.index(channel)] = added.get(channel, 0.0)
        return LogSignal(values=values)
    made = line_signals(log, fault, response, size=size, with_slopes=with_slopes)
    channel = log.channel(fault.channel).name
    if made and channel not in made:
        follow = ", ".join(made)
        raise DictionaryError(f"'{fault.called}' does not change '{channel}'; name one of its channel: {follow}")
    for k, name in enumerate(names):
        if name in made:
            values[:, k], slopes[:, k] = made[name].values, made[name].slopes
    return LogSignal(values=values, slopes=slopes)


def moves(channel: Channel) -> bool:
    """Say whether the numbers of a channel differ by more than a constant does that is stored in single precision."""
    low, high = float(np.fmin.reduce(channel.values)), float(np.fmax.reduce(channel.values))
    return high - low > max(STILL_RELATIVE * max(abs(low), abs(high)), SMALLEST)


def require_outputs_move(log: FlightLog, outputs: Sequence[str]) -> None:
    """Refuse a log of which an output does not move.

    Raises
    ------
    LogError : one does not.
    """
    for name in outputs:
        if moves(still := log.channel(name)):
            continue
        size = f"{still.values[0]:.6g} {still.unit}".rstrip()
        raise LogError(
            f"{log.path}: output '{name}' does not change (stays at {size}); choose another --output or window"
        )


def _require_movement(log: FlightLog, config: Config) -> None:
    """Refuse a window in which no input moves, or an output does not."""

    def is_still(channel: Channel) -> bool:
        return float(np.ptp(channel.values)) < STILL_ANGLE if channel.unit == "rad" else not moves(channel)

    if all(is_still(log.channel(name)) for name in config.inputs):
        first, channel = config.inputs[0], log.channel(config.inputs[0])
        raise ExcitationError(
            f"{log.path}: '{first}' does not move (range {np.ptp(channel.values):.4g} {channel.unit}); without "
            "excitation the dynamics cannot be told from a drift; choose a window with a manoeuvre"
        )
    require_outputs_move(log, config.outputs)


def selects_support(config: Config) -> bool:
    """Say whether the method selects a few entries of a dictionary, which need not be told apart from all others."""
    return config.method == "ml" and config.selection.threshold is None


def unusable_atoms(
    theta: FloatArray,
    names: Sequence[str],
    indices: Sequence[int],
    report: Report = silent,
    *,
    selects: bool = False,
) -> dict[int, str]:
    """Return why an atom cannot be identified, by index: it is zero, a constant, or a combination of earlier atoms.

    Parameters
    ----------
    theta : (n_samples, n_outputs, n_atoms) signals of all dictionary entries; names : of all of them.
    indices : the entries to look at; earlier ones are kept.
    report : receives the progress.
    selects : a few atoms are estimated together, so that one may be a combination of others, but not the same as one.
    """
    reasons: dict[int, str] = {}
    n_samples, n_outputs, n_atoms = theta.shape
    constants, flat = np.kron(np.ones((n_samples, 1)), np.eye(n_outputs)), theta.reshape(-1, n_atoms)
    travels, peaks = np.ptp(theta, axis=0).max(axis=0), amplitudes(theta).max(axis=0)
    first = constants.shape[1]
    bases = np.empty((len(flat), first + len(indices)), order="F")
    bases[:, :first] = constants / np.linalg.norm(constants, axis=0)
    kept: list[int] = []
    for j, _ in parts(report, indices):
        signal, name = flat[:, j], names[j]
        size = float(np.linalg.norm(signal))
        if size == 0.0:
            reasons[j] = f"'{name}' is zero in the window; move its onset or widen the window"
            continue
        if travels[j] <= CONSTANT * peaks[j]:
            reasons[j] = (
                f"'{name}' does not change in the window, so the model's constant explains it; move its onset inside"
            )
            continue
        basis = bases[:, : first + len(kept)]
        if selects:
            rest = signal
            is_kept = np.abs(basis[:, first:].T @ signal).max(initial=0.0) < (1.0 - DEPENDENT) * size
        else:
            rest = signal - basis @ (basis.T @ signal)
            rest -= basis @ (basis.T @ rest)
            is_kept = bool(np.linalg.norm(rest) > DEPENDENT * size)
        if is_kept:
            bases[:, first + len(kept)] = rest / np.linalg.norm(rest)
            kept.append(j)
            continue
        likeness = [abs(float(signal @ flat[:, i])) / float(np.linalg.norm(flat[:, i])) for i in kept]
        nearest = names[kept[int(np.argmax(likeness))] if kept else j]
        if likeness and max(likeness) >= (1.0 - DEPENDENT) * size:
            reasons[j] = f"'{name}' is the same signal as '{nearest}' in the window; only the latter is kept"
        else:
            reasons[j] = f"'{name}' is a combination of the entries before it in the window (nearest '{nearest}')"
    return reasons
