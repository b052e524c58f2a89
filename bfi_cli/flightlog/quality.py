"""Quality of a log: rate, gaps, held samples, quantisation, recorder's low-pass, excitation and windows to analyse."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..faults.filters import Filter
from ..kernels import BoolArray
from ..kernels.low_pass import Kind, recorder_from_jumps, recorder_from_spectra
from ..kernels.quantisation import Hold, find_hold, may_be_held, repeat_fraction
from ..kernels.runs import repeats, shared, within
from ..notes import Note
from ..quantities.channels import INDEPENDENT, INPUTS, STANDARD, quantity_of
from ..quantities.text import instant, quantity
from .derived import DERIVED, missing_for, pressures_of
from .phases import HOVER, NO_AIRSPEED, TRANSITION, Phase, note_on_rotors, phases_of, spans_of
from .plausible import doubt_about
from .rates import AS_FAST, GAP
from .record import LARGEST_VALUE, Channel, FlightLog, FloatArray, Segment

UNEVEN = 0.02  # share of the median time step by which a uniform clock may wander
PIECE = 1_000_000  # samples whose steps are computed at once, for memory
MOSTLY = 0.5  # share of a window on the ground from which the user is told
# In a longer record, s, the dynamics change and a scan takes minutes, so that so many windows are suggested.
LONG_S, MOST_NAMED = 600.0, 3
# Length of the means in which moves are counted, s: shorter than a pilot's stroke, longer than the sensor's noise.
BLOCK_S = 0.25
ODD = 3.0  # a sensor is named as the odd one of three at so many times the distance between the other two
MOVE = 0.05  # share of an input's range that counts as a move
POWER = 0.95  # share of an input's variance below its bandwidth
SEGMENT_S = 60.0  # slower changes are those of the trim
# Time kept before the first and after the last move; moves further apart than both together belong to two windows.
BEFORE_S, AFTER_S = 5.0, 15.0
FEWEST_MOVES = 3  # a window with fewer holds a single correction, no manoeuvre
MOST_WINDOWS = 10  # suggested in all
# A window with more than this share on the ground, or in phases that no linear model follows, ranks after the others.
UNFIT, UNFIT_SHARE = ("ground", "take-off", "landing", "stall", "parabola", HOVER, TRANSITION, NO_AIRSPEED), 0.05
# Samples that are looked at: three hours at 10 Hz hold hundreds of jumps.
MOST_SAMPLES = 108_000
# Relative difference of two edges beyond which they contradict each other: the accuracy of the spectra.
SAME_EDGE = 0.2
UNKNOWN = "it is unknown whether the recorder low-passed the log; no low-pass is assumed (--recorder HZ states one)"
# Samples of one value from which a sensor may be frozen for good (`bfi_cli.flight.parity.sensors`).
FEWEST_REPEATS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelReport:
    """One channel.

    Attributes
    ----------
    n_nan : samples that are NaN or infinite.
    held_fraction : fraction of samples that repeat the one before, 0 where the channel is not held.
    hold_period_s : time between two values of a held channel, None where it is not held.
    quantum : quantisation step in `unit`, None where there is none.
    min, max : over the finite samples, None where there are none.
    own_rate_hz : rate of the signal in the file, None where it is that of the log.
    pressures : the air-data pressures that the channel follows from: a fault of their lines shows in it.
    """

    name: str
    unit: str
    source: str
    own_rate_hz: float | None
    n_nan: int
    held_fraction: float
    hold_period_s: float | None
    quantum: float | None
    min: float | None
    max: float | None
    pressures: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DerivableChannel:
    """A channel that follows from others; `lacks` are those of them that the log lacks, alternatives joined by "or"."""

    name: str
    unit: str
    description: str
    lacks: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """How an input moves.

    Attributes
    ----------
    range : between its 0.5 % and 99.5 % quantiles, in `unit`.
    moves : number of travels in one direction by more than 5 % of that range.
    bandwidth_hz : 95 % of the variance about the mean of each minute lies below it; None for an input at rest.
    """

    channel: str
    unit: str
    range: float
    moves: int
    bandwidth_hz: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitedWindow:
    """A stretch without gaps in which `channel` moves `moves` times; the one of rank 1 is the best to analyse."""

    start_s: float
    stop_s: float
    channel: str
    moves: int
    rank: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class LogReport:
    """A log as `bfi info` shows it.

    Attributes
    ----------
    jitter : largest deviation of a time step from the median, relative to it, gaps left out.
    gaps : (start_s, stop_s), the last sample before and the first after each gap.
    phases : of the flight, none where the log has no airspeed.
    clock : the moment from which the times count, see `Epoch.iso`; None for a log without a clock.
    filters : the low-pass filters that the log went through, None where nothing is known of them.
    """

    path: str
    n_samples: int
    start_s: float
    stop_s: float
    rate_hz: float
    uniform: bool
    jitter: float
    gaps: tuple[tuple[float, float], ...]
    channels: tuple[ChannelReport, ...]
    derived: tuple[DerivableChannel, ...]
    excitation: tuple[Excitation, ...]
    windows: tuple[ExcitedWindow, ...]
    phases: tuple[Phase, ...]
    segments: tuple[Segment, ...]
    filters: tuple[Filter, ...] | None
    notes: tuple[Note, ...]
    clock: str | None = None


def median_step(time_s: FloatArray) -> float:
    """Return the median time step, s, in the memory of one array of the steps."""
    return float(np.median(np.diff(time_s), overwrite_input=True))


def gap_starts(time_s: FloatArray) -> NDArray[np.intp]:
    """Return the samples after which a gap begins: at least one sample is missing."""
    return np.flatnonzero(np.diff(time_s) > GAP * median_step(time_s))


def time_jitter(time_s: FloatArray) -> float:
    """Return the largest deviation of a time step from the median step, relative to it, gaps left out."""
    relative = np.diff((time_s - time_s[0]) / median_step(time_s))
    return float(np.max(np.abs(relative[relative <= GAP] - 1.0), initial=0.0))


def _uneven_step(time_s: FloatArray) -> int | None:
    """Return the first k whose step t[k] - t[k-1] is off by more than 2 % and single-precision rounding, else None."""
    median, starts = median_step(time_s), range(0, len(time_s) - 1, PIECE)
    parts = (time_s[k : k + PIECE + 1] for k in starts)
    is_single = all(np.array_equal(part.astype(np.float32), part) for part in parts)
    largest = np.float32(max(abs(float(time_s.min())), abs(float(time_s.max()))))
    rounding = 2.0 * float(np.spacing(largest)) if is_single else 0.0
    for start in starts:
        step = np.diff(time_s[start : start + PIECE + 1])
        bad = np.abs(step - median) > UNEVEN * median + rounding
        if bad.any():
            return start + int(np.argmax(bad)) + 1
    return None


def is_uniform(time_s: FloatArray) -> bool:
    """Say whether the samples lie on a uniform grid."""
    return _uneven_step(time_s) is None


def inspect_log(log: FlightLog) -> LogReport:
    """Return the report on a log before it is analysed."""
    channels, questions, phases = [], [], phases_of(log)
    flying = _flying(log, phases)
    for channel in log.channels.values():
        values = channel.values  # of a large file read here, once
        is_finite = np.isfinite(values)
        finite = values if is_finite.all() else values[is_finite]
        held = held_hz(log, channel)
        report = ChannelReport(
            name=channel.name,
            unit=channel.unit,
            source=channel.source,
            own_rate_hz=None if channel.own_rate_hz is None else float(f"{channel.own_rate_hz:.6g}"),
            n_nan=values.size - finite.size,
            held_fraction=0.0 if held is None else repeat_fraction(finite),
            hold_period_s=None if held is None else 1.0 / held,
            quantum=channel.step,
            min=float(finite.min()) if finite.size else None,
            max=float(finite.max()) if finite.size else None,
            pressures=pressures_of(log, channel.name),
        )
        channels.append(report)
        questions.append(doubt_about(channel))
    derived = (
        DerivableChannel(
            name=name,
            unit=STANDARD[name].unit,
            description=STANDARD[name].description,
            lacks=missing_for(name, log.channels),
        )
        for name in DERIVED
        if name not in log.channels
    )
    start_s, stop_s = log.ends()
    return LogReport(
        path=log.path,
        n_samples=log.n_samples,
        start_s=start_s,
        stop_s=stop_s,
        rate_hz=float(f"{log.rate_hz:.9g}"),
        uniform=is_uniform(log.time_s),
        jitter=time_jitter(log.time_s),
        gaps=tuple((float(log.time_s[k]), float(log.time_s[k + 1])) for k in gap_starts(log.time_s)),
        channels=tuple(channels),
        derived=tuple(derived),
        excitation=tuple(_excitation(log, name, flying) for name in INPUTS if name in log.channels),
        windows=ranked_windows(log, phases),
        phases=phases,
        segments=log.segments,
        filters=log.filters,
        clock=None if log.epoch is None else log.epoch.iso,
        notes=(*log.notes, *note_on_rotors(phases), *_sensors_of_one_quantity(log), *filter(None, questions)),
    )


def _sensors_of_one_quantity(log: FlightLog) -> Iterator[Note]:
    """Yield notes on the differences between sensors of one quantity, and on the odd sensor of three."""
    sensors: dict[str, list[Channel]] = {}
    for name, channel in log.channels.items():
        sensors.setdefault(quantity_of(name), []).append(channel)
    for first, *others in sensors.values():
        for other in others:
            apart = other.values - first.values
            known = apart[np.isfinite(apart)]
            if known.size:
                median, unit = float(np.median(known)), "" if first.unit == "1" else first.unit
                most = float(np.quantile(np.abs(known - median), 0.95))
                yield Note.method(
                    f"{first.name} and {other.name} are two sensors of one quantity: the second reads "
                    f"{quantity(abs(median), unit)} {'less' if median < 0.0 else 'more'} in the median, "
                    f"within {quantity(most, unit)} of that for 95 % of the samples"
                )
    for several in sensors.values():
        if len(several) < 3:
            continue
        between = {}
        for pair in combinations(several, 2):
            size = np.abs(pair[0].values - pair[1].values)
            between[pair] = float(np.quantile(size[np.isfinite(size)], 0.95)) if np.isfinite(size).any() else np.nan
        for odd in several:
            nearest = min(size for pair, size in between.items() if odd in pair)
            rest = max(size for pair, size in between.items() if odd not in pair)
            if nearest > ODD * rest:
                *before, last = [sensor.name for sensor in several if sensor is not odd]
                unit = "" if odd.unit == "1" else odd.unit
                yield Note.method(
                    f"{odd.name} agrees with neither {', '.join(before)} nor {last}: it is up to "
                    f"{quantity(nearest, unit)} from the nearest, these up to {quantity(rest, unit)} from each other "
                    "in 95 % of the samples"
                )


def advice_on_windows(log: FlightLog) -> str | None:
    """Return a sentence that names the windows with the most moves; None where the log is not long."""
    duration_s = float(log.time_s[-1] - log.time_s[0])
    if duration_s <= LONG_S:
        return None
    windows = _suggested_windows(log, phases_of(log), at_most=MOST_NAMED)
    named = [f"--from {w.start_s:.10g} --to {w.stop_s:.10g} ({w.channel})" for w in windows]
    return f"the record is {duration_s / 60.0:.0f} min long; windows to take: {', '.join(named) or 'none stands out'}"


def advice_on_the_ground(
    log: FlightLog, from_s: float | None, to_s: float | None, *, suspects: Collection[str] = ()
) -> str | None:
    """Return a sentence where most of the window is on the ground, None elsewhere.

    Parameters
    ----------
    from_s, to_s : the window; None for the ends of the log.
    suspects : see `bfi_cli.flightlog.phases.phases_of`.
    """
    first, last = log.ends(from_s, to_s)
    phases = phases_of(log, suspects=suspects)
    if not shared((first, last), spans_of(phases, ("ground",))) > MOSTLY * (last - first):
        return None
    flown = [phase for phase in phases if phase.phase not in UNFIT]
    aloft = f" (in flight from {instant(flown[0].from_s)} to {instant(flown[-1].to_s)} s)" if flown else ""
    return (
        f"the aircraft is on the ground for most of the window, {instant(first)} to {instant(last)} s{aloft}: its "
        "airspeed is wind and noise, and the answer is not about a flight"
    )


def hold_of(log: FlightLog, values: FloatArray) -> Hold | None:
    """Return the clock of a held signal (n_samples,) of the log, NaN left out; None where it is not held."""
    finite = np.isfinite(values)
    known = values if finite.all() else values[finite]
    if not may_be_held(known):
        return None
    position = log.time_s - log.time_s[0]
    position /= median_step(log.time_s)
    return find_hold(known, position[finite])


def held_hz(log: FlightLog, channel: Channel) -> float | None:
    """Return the rate at which a held channel has new values, None for a channel that is not held.

    The rate of a signal with a separate clock is that of the file; otherwise the repeated values tell it.
    """
    if channel.own_rate_hz is not None and channel.own_rate_hz < AS_FAST * log.rate_hz:
        return channel.own_rate_hz
    hold = hold_of(log, channel.values)
    return None if hold is None else log.rate_hz / hold.period


def require_usable(log: FlightLog, names: Sequence[str], *, resampling: bool = False) -> None:
    """Check that the channels can be analysed.

    Parameters
    ----------
    names : standard names, or names in the file.
    resampling : the log is resampled afterwards, so an uneven time step and held samples do not matter.

    Raises
    ------
    LogError : a channel is missing, holds NaN or absurd values, repeats its values, or the time step is not uniform.
    """
    channels = [log.channel(name) for name in names]
    for channel in channels:
        values, place = channel.values, f"{log.path}: '{channel.name}' is"
        huge = np.flatnonzero(np.isfinite(values) & (np.abs(values) > LARGEST_VALUE))
        if huge.size:
            raise LogError(
                f"{place} no measurement at sample {huge[0]} ({instant(log.time_s[huge[0]])} s), got "
                f"{values[huge[0]]:.3g} {channel.unit}; choose a window without it with --from/--to"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise LogError(
                f"{place} not a number at sample {bad[0]} ({instant(log.time_s[bad[0]])} s), {bad.size} of "
                f"{log.n_samples} samples in all; choose a window without them with --from/--to"
            )
    if resampling:
        return
    k = _uneven_step(log.time_s)
    if k is not None:
        step = float(log.time_s[k] - log.time_s[k - 1])
        raise LogError(
            f"{log.path}: time step is not uniform: {step:.4g} s at sample {k}, {1.0 / log.rate_hz:.4g} s elsewhere; "
            "give --rate to resample, or cut the window with --from/--to"
        )
    for channel in channels:
        if (held := held_hz(log, channel)) is not None:
            rate, repeated = f"{held:.3g}", 100.0 * repeat_fraction(channel.values)
            raise LogError(
                f"{log.path}: '{channel.name}' repeats its value {repeated:.0f} % of the time (held samples, about "
                f"{rate} Hz); give --rate {rate} to decimate"
            )


def _flying(log: FlightLog, phases: Sequence[Phase]) -> BoolArray:
    """Return (n_samples,) which samples are not on the ground."""
    return ~within(log.time_s, spans_of(phases, ("ground",)))


def _excitation(log: FlightLog, name: str, flying: BoolArray) -> Excitation:
    """Return how an input moves in flight, NaN left out; a parked elevator, at its stop, would widen the range."""
    channel = log.channels[name]
    x = channel.values[flying & np.isfinite(channel.values)]
    extent = _extent(x)
    size, bandwidth_hz = min(x.size, round(SEGMENT_S * log.rate_hz)), None
    if extent > 0.0 and size >= 8:
        pieces = x[: x.size // size * size].reshape(-1, size)
        pieces = (pieces - pieces.mean(axis=1, keepdims=True)) * np.hanning(size)
        power = np.cumsum((np.abs(np.fft.rfft(pieces, axis=1)) ** 2).sum(axis=0))
        if power[-1] > 0.0:
            bandwidth_hz = float(np.searchsorted(power, POWER * power[-1]) * log.rate_hz / size)
    moves = _move_times(log, name, flying).size
    return Excitation(channel=name, unit=channel.unit, range=extent, moves=moves, bandwidth_hz=bandwidth_hz)


def _extent(x: FloatArray) -> float:
    return float(np.ptp(np.quantile(x, [0.005, 0.995]))) if x.size else 0.0


def _move_times(log: FlightLog, name: str, flying: BoolArray) -> FloatArray:
    """Return the times at which moves begin: runs of block means that change one way by more than the threshold."""
    values = log.channels[name].values
    good = flying & np.isfinite(values)
    x, t = (values, log.time_s) if good.all() else (values[good], log.time_s[good])
    size = max(1, round(BLOCK_S * log.rate_hz))
    n = x.size // size
    travel = np.diff(x[: n * size].reshape(n, size).mean(axis=1))
    if not travel.size or (extent := _extent(x)) == 0.0:
        return np.empty(0)
    way = np.sign(travel)
    starts = np.flatnonzero(np.concatenate([[True], way[1:] != way[:-1]]))
    runs = np.add.reduceat(travel, starts)
    return np.asarray(t[starts[np.abs(runs) > MOVE * extent] * size])


def ranked_windows(log: FlightLog, phases: Sequence[Phase]) -> tuple[ExcitedWindow, ...]:
    """Return the suggested windows in order of time, ranked by flight first, then by the number of moves."""
    unfit = spans_of(phases, UNFIT)

    def worth(window: ExcitedWindow) -> tuple[bool, int, float]:
        inside = shared((window.start_s, window.stop_s), unfit)
        return inside > UNFIT_SHARE * (window.stop_s - window.start_s), -window.moves, window.start_s

    windows = _suggested_windows(log, phases, at_most=MOST_WINDOWS)
    ranks = {window: rank for rank, window in enumerate(sorted(windows, key=worth), start=1)}
    return tuple(replace(window, rank=ranks[window]) for window in windows)


def _suggested_windows(log: FlightLog, phases: Sequence[Phase], *, at_most: int) -> tuple[ExcitedWindow, ...]:
    """Return the stretches without gaps in which the first input with moves has them, in order of time.

    In a log without inputs the pitch attitude is used instead.

    Parameters
    ----------
    at_most : the stretches with the most moves are kept.
    """
    before, flying = gap_starts(log.time_s), _flying(log, phases)
    inputs = [name for name in INPUTS if name in log.channels]
    for name in inputs or [name for name in ("pitch",) if name in log.channels]:
        times = _move_times(log, name, flying)
        # Two windows where the input rests for longer than the margins, or the log has a gap.
        rests, windows = np.diff(times) > BEFORE_S + AFTER_S, []
        for start_s in log.time_s[before]:
            rests |= (times[:-1] <= start_s) & (times[1:] > start_s)
        for group in np.split(times, np.flatnonzero(rests) + 1):
            if group.size >= FEWEST_MOVES:
                low = max([log.time_s[0], *(stop for stop in log.time_s[before + 1] if stop <= group[0])])
                high = min([log.time_s[-1], *(start for start in log.time_s[before] if start >= group[-1])])
                start_s = round(float(max(low, group[0] - BEFORE_S)), 3)
                stop_s = round(float(min(high, group[-1] + AFTER_S)), 3)
                windows.append(ExcitedWindow(start_s=start_s, stop_s=stop_s, channel=name, moves=group.size))
        if windows:
            best = sorted(windows, key=lambda w: -w.moves)[:at_most]
            return tuple(sorted(best, key=lambda w: w.start_s))
    return ()


def is_told_by_physics(log: FlightLog, outputs: Sequence[str]) -> bool:
    """Return whether physics may show a fault of an output: other channels bound it, or it may be frozen."""
    if not log.channels.keys().isdisjoint(INDEPENDENT):
        return True
    rests = (repeats(log.channels[name].values) for name in outputs if name in log.channels)
    return any(end - first >= FEWEST_REPEATS for spans in rests for first, end in spans)


def with_seen_recorder(log: FlightLog) -> FlightLog:
    """Return the log with the recorder's filter as its channels show it, unless the file states filters.

    Jumps of one quantum show kind and edge; if they are as sharp as the samples there is no filter. Without jumps, a
    common cut-off in the spectra of most channels shows a filter, whose kind and edge are then uncertain.
    """
    if log.filters is not None or not is_uniform(log.time_s):
        return log
    values = [channel.between(slice(0, MOST_SAMPLES)) for channel in log.channels.values()]
    if jumps := recorder_from_jumps(values, log.rate_hz):
        if jumps.kind is None or jumps.edge_hz is None:
            return replace(log, filters=())
        kind, edge_hz, source = jumps.kind, jumps.edge_hz, f"seen in {jumps.n_jumps} jumps of one quantum"
    elif spectra := recorder_from_spectra(values, log.rate_hz):
        others = ", ".join(f"{kind} {edge_hz:.3g} Hz" for kind, edge_hz in spectra.others)
        source = (
            f"uncertain: from the spectra of {spectra.n_channels} channels, which other kinds would fit with {others}"
        )
        kind, edge_hz = spectra.kind, spectra.edge_hz
    else:
        return log
    seen = Filter(kind=kind, edge_hz=edge_hz, rate_hz=log.rate_hz, source=source, uncertain=jumps is None)
    return replace(log, filters=(seen,))


def recorder_filters(
    log: FlightLog, edge_hz: float | str = "auto", kind: Kind | Literal["auto"] = "auto"
) -> tuple[tuple[Filter, ...], str]:
    """Return the filters that a fault of the aircraft went through, recorder first, and a sentence on the recorder.

    A stated filter is used even where the log shows another, which the sentence then mentions.

    Parameters
    ----------
    edge_hz : of the recorder; "none" for no filter, "auto" for what the log states or shows.
    kind : of the recorder; "auto" for what the log states or shows, a Gaussian where only the edge is known.
    """
    known = log.filters or ()
    later = tuple(low_pass for low_pass in known if low_pass.stage != "recorder")
    recorders = [low_pass for low_pass in known if low_pass.stage == "recorder"]
    if edge_hz == "none":
        return later, " ".join(
            f"no recorder's low-pass is assumed, as stated; {_contrary(low_pass)}" for low_pass in recorders
        )
    if not isinstance(edge_hz, str):
        shape: Kind = "gaussian" if kind == "auto" else kind
        rate_hz = later[0].rate_hz if later else log.rate_hz
        stated = Filter(kind=shape, edge_hz=edge_hz, rate_hz=rate_hz, source="as stated")
        contrary = [
            _contrary(low_pass) for low_pass in recorders if abs(low_pass.edge_hz - edge_hz) > SAME_EDGE * edge_hz
        ]
        return (stated, *later), "; ".join([_sentence(stated), *contrary])
    if kind != "auto":
        recorders = [replace(low_pass, kind=kind) for low_pass in recorders]
    if log.filters is None:
        return (), UNKNOWN
    return (*recorders, *later), " ".join(map(_sentence, recorders))


def _contrary(low_pass: Filter) -> str:
    return f"but the log has one ({low_pass.kind}, gain one half at {low_pass.edge_hz:.3g} Hz, {low_pass.source})"


def _sentence(low_pass: Filter) -> str:
    return (
        f"faults are taken through the recorder's low-pass ({low_pass.kind}, gain one half at "
        f"{low_pass.edge_hz:.3g} Hz, {low_pass.source}); --recorder states another"
    )
