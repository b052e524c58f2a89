"""Missing samples interpolated, and logs resampled to another rate through a low-pass.

What is missing for half a second is interpolated, longer stretches only where the user asks for it. A log at
another rate is laid on a uniform grid, low-passed and decimated, every channel alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np

from ..errors import ConfigError, LogError
from ..faults.filters import Filter
from ..kernels.low_pass import decimate, lost_samples
from ..kernels.quantisation import Hold
from ..kernels.runs import bridged, runs
from ..notes import Note
from ..quantities.text import instant
from .quality import hold_of, is_uniform
from .raw import ANGLES, FLAGS
from .record import FlightLog, FloatArray, StoredChannel, frozen_array

LONGEST_BRIDGE = 4.5  # median time steps: up to three missing samples are interpolated
SAME_RATE = 1e-3  # relative error of a recorder's clock
UNEVEN_RATE = 0.05  # how far the median step of an uneven axis may be from its mean
MARGIN_PERIODS = 12.0  # of the new rate, a little more than what the sinc reaches
LARGEST_DENOMINATOR = 1000  # of the ratio of two rates: within 1e-6 of any ratio
SINC_LOBES = 10  # half the length of the sinc in its own periods
CUTOFF = 0.8  # of the sinc, over the new Nyquist frequency
KAISER_BETA = 8.0  # of the sinc's window: a stop band 80 dB down
# Share of a step by which a clock may wander: a stretch of just the length asked for is filled.
BESIDE = 0.02
# What is missing for so many seconds is interpolated: air data change little within them, and the seconds of a flight
# that diagnoses are counted in keep at least half their samples.
BRIDGED_S = 0.5
# Share of samples up to which a clock is even with rows missing, or a channel has gaps and not a lower rate. A Garmin
# G1000 at 1 Hz misses one row in 45.
MOST_MISSING = 0.05
FEWEST_SAMPLES = 20  # of which a single one is that share
MOST_NAMED = 5  # channels in a note
# With more double steps in a row the clock runs at half its rate.
MOST_IN_A_ROW = 3


def resample(log: FlightLog, rate_hz: float, *, from_s: float | None = None, to_s: float | None = None) -> FlightLog:
    """Return the log at another rate, each channel and each clean signal through the same linear-phase low-pass.

    An uneven time axis is first interpolated onto a uniform grid, a held channel between its own values. The samples
    at the edges that lack full filter support are dropped, so give the window here rather than cut it before. Where a
    channel is NaN in the support of the filter, the result is NaN.

    Parameters
    ----------
    rate_hz : the new rate, at most the log's own; samples are then 1/rate_hz apart within the clock's error (0.1 %).
    from_s, to_s : window on the log's time axis, of which the samples outside are used by the filter only.

    Raises
    ------
    ConfigError : a rate that is not positive.
    LogError : a gap of more than a few samples, a rate above the log's, too few samples.
    """
    return resample_with(log, np.empty((log.n_samples, 0)), rate_hz, from_s=from_s, to_s=to_s)[0]


def resample_with(
    log: FlightLog, extra: FloatArray, rate_hz: float, *, from_s: float | None = None, to_s: float | None = None
) -> tuple[FlightLog, FloatArray]:
    """Return the log at another rate, see `resample`, and signals of the same time axis through the same filter.

    Parameters
    ----------
    extra : (n_samples, ...), finite and never held, such as what the faults of a dictionary add.
    rate_hz, from_s, to_s : see `resample`.

    Raises
    ------
    ConfigError, LogError : see `resample`.
    """
    if not (math.isfinite(rate_hz) and rate_hz > 0.0):
        raise ConfigError(f"--rate: must be a positive number, got {rate_hz:g} Hz; give one like {log.rate_hz:.4g}")
    span = float(log.time_s[-1] - log.time_s[0])
    if rate_hz * span < 1.0:
        raise LogError(f"{log.path}: {span:.4g} s long, shorter than one step at {rate_hz:g} Hz; give a higher --rate")
    tolerance = SAME_RATE if is_uniform(log.time_s) else UNEVEN_RATE
    if rate_hz > log.rate_hz * (1.0 + tolerance):
        raise LogError(
            f"{log.path}: recorded at {log.rate_hz:.4g} Hz, it cannot be resampled to {rate_hz:g} Hz; "
            f"give --rate {log.rate_hz:.4g} or less"
        )
    part = log.window(*with_reach(rate_hz, from_s, to_s))
    holds = dict[str, Hold]()
    for name, channel in part.channels.items():
        hold = hold_of(part, channel.values)
        if hold is None and (whole := hold_of(log, log.channels[name].values)) is not None:  # the part is too short
            samples_before = (part.time_s[0] - log.time_s[0]) * log.rate_hz
            hold = replace(whole, phase=(whole.phase - samples_before) % whole.period)
        if hold is not None:
            holds[name] = hold
    first = int(np.searchsorted(log.time_s, part.time_s[0]))
    resampled, filtered = part, extra.reshape(log.n_samples, -1)[first : first + part.n_samples]
    if holds or not is_uniform(part.time_s) or abs(part.rate_hz / rate_hz - 1.0) >= SAME_RATE:
        grid = _grid(part, rate_hz)
        # Beyond the last value of a held channel nothing is interpolated.
        last_s = min([part.time_s[-1], *(_renewals(part, hold)[-1] for hold in holds.values())])
        grid = grid[grid <= float(last_s) + 1e-9]
        try:
            resampled, filtered = _through_filter(part, filtered, grid, rate_hz, holds=holds)
        except ValueError as error:
            raise LogError(f"{log.path}: {error}; give a higher --rate or a longer window") from None
    cut = resampled.window(from_s, to_s)
    first = int(np.searchsorted(resampled.time_s, cut.time_s[0]))
    return cut, filtered[first : first + cut.n_samples].reshape(cut.n_samples, *extra.shape[1:])


def with_reach(rate_hz: float | None, from_s: float | None, to_s: float | None) -> tuple[float | None, float | None]:
    """Return a window widened by the support of the filter that resamples to this rate."""
    margin = MARGIN_PERIODS / rate_hz if rate_hz else 0.0
    return None if from_s is None else from_s - margin, None if to_s is None else to_s + margin


def _grid(log: FlightLog, rate_hz: float) -> FloatArray:
    """Return the log's time axis if it is uniform, else a uniform axis at a multiple of the new rate."""
    span = float(log.time_s[-1] - log.time_s[0])
    if is_uniform(log.time_s):
        return np.asarray(log.time_s[0] + np.linspace(0.0, span, log.n_samples))
    step = np.diff(log.time_s)
    k = int(np.argmax(step))
    if step[k] > LONGEST_BRIDGE * np.median(step):
        raise LogError(
            f"{log.path}: gap of {step[k]:.4g} s from {instant(log.time_s[k])} s to {instant(log.time_s[k + 1])} s; "
            "choose a window beside it with --from/--to"
        )
    fine = rate_hz * math.ceil(log.rate_hz / rate_hz - SAME_RATE)
    return np.asarray(log.time_s[0] + np.arange(math.floor(span * fine * (1.0 + 1e-12)) + 1) / fine)


def _renewals(log: FlightLog, hold: Hold) -> FloatArray:
    """Return the times at which the channel got a new value, the first at or before the log's start."""
    step = 1.0 / log.rate_hz
    first = hold.phase - hold.period * math.ceil(hold.phase / hold.period)
    count = math.floor(((log.time_s[-1] - log.time_s[0]) / step - first) / hold.period) + 1
    return np.asarray(log.time_s[0] + step * (first + hold.period * np.arange(count)))


def _through_filter(
    log: FlightLog, extra: FloatArray, grid: FloatArray, rate_hz: float, *, holds: Mapping[str, Hold]
) -> tuple[FlightLog, FloatArray]:
    """Return the log and the signals `extra`, (n_samples, n), laid on a grid, low-passed and decimated to the rate.

    Row i of the result stands at row `lead + i * stride` of the grid and uses `lead` rows of it to either side.
    """
    step = float(np.mean(np.diff(grid))) if grid.size > 1 else 1.0 / log.rate_hz
    ratio = 1.0 / (step * rate_hz)
    factor = round(ratio)
    lowpass: Callable[[FloatArray], FloatArray]
    if abs(ratio - factor) <= SAME_RATE * ratio:
        lowpass, lead, stride = partial(decimate, factor=factor), float(lost_samples(factor)[0]), float(factor)
    else:
        part = Fraction(1.0 / ratio).limit_denominator(LARGEST_DENOMINATOR)
        up, down = part.numerator, part.denominator
        lowpass, lead, stride = partial(_polyphase, up=up, down=down), SINC_LOBES * down / up, down / up
    centre = lead + stride * np.arange(lowpass(np.zeros(grid.size)).size)

    def new(name: str, values: FloatArray) -> FloatArray:
        bad = ~np.isfinite(values)
        values = np.zeros(values.shape) if bad.all() else bridged(values, log.time_s)
        filtered = lowpass(_on_grid(log, values, grid, hold=holds.get(name)))
        if bad.any():  # every row of the result is NaN that a NaN of the grid reaches
            touched = np.interp(grid, log.time_s, bad.astype(np.float64)) > 0.0
            count = np.concatenate([[0], np.cumsum(touched)])
            first = np.floor(centre - lead).astype(np.intp).clip(0, grid.size)
            stop = (np.ceil(centre + lead).astype(np.intp) + 1).clip(0, grid.size)
            filtered[count[stop] > count[first]] = np.nan
        return frozen_array(filtered)

    filtered = np.zeros((centre.size, extra.shape[1]))
    for j in np.flatnonzero(np.any(extra, axis=0)):
        filtered[:, j] = lowpass(_on_grid(log, extra[:, j], grid, hold=None))
    notes = [
        Note.limit(
            f"'{name}' has new values at {log.rate_hz / hold.period:.3g} Hz only; at {rate_hz:g} Hz those between are "
            "interpolated"
        )
        for name, hold in holds.items()
        if log.rate_hz / hold.period < rate_hz * (1.0 - SAME_RATE)
    ]
    time_s = frozen_array(grid[0] + step * centre)
    converted = Filter(
        kind="sinc", edge_hz=0.5 * CUTOFF * rate_hz, rate_hz=1.0 / step, stage="convert", source="of the conversion"
    )
    filters = (*(log.filters or ()), converted)
    return log.changed(new, time_s=time_s, filters=filters, notes=(*log.notes, *notes)), filtered


def _on_grid(log: FlightLog, values: FloatArray, grid: FloatArray, *, hold: Hold | None) -> FloatArray:
    if hold is None and is_uniform(log.time_s):
        return values[: grid.size]
    from scipy.interpolate import CubicSpline

    if hold is None:
        return np.asarray(CubicSpline(log.time_s, values)(grid))
    renewed = _renewals(log, hold)
    middle = renewed + 0.5 * (hold.period - 1.0) / log.rate_hz
    nearest = np.searchsorted(log.time_s, middle - 0.5 / log.rate_hz).clip(max=log.n_samples - 1)
    return np.asarray(CubicSpline(renewed, values[nearest])(grid))


def _polyphase(x: FloatArray, up: int, down: int) -> FloatArray:
    """Resample by up/down < 1 with a windowed sinc, dropping the rows without full support."""
    from scipy import signal

    half = SINC_LOBES * down
    last = (x.size - 1) * up // down
    if last < 2 * SINC_LOBES:
        raise ValueError(f"{x.size} samples are fewer than the filter of the resampling by {up}/{down} needs")
    taps = signal.firwin(2 * half + 1, CUTOFF / down, window=("kaiser", KAISER_BETA))
    for phase in range(up):  # each must pass a constant unchanged: an airspeed is a large one
        taps[phase::up] /= taps[phase::up].sum()
    return np.asarray(signal.upfirdn(taps, x, up, down)[2 * SINC_LOBES : last + 1])


def with_filled(log: FlightLog, longest_s: float) -> FlightLog:
    """Return the log with stretches of NaN of up to `longest_s` interpolated linearly, and a note on each channel.

    A stretch at an end of the log stays NaN. Angles take the shorter way round; flags keep their last value. The clean
    signal of a channel with an injected fault is filled alike.
    """
    stretches: dict[str, list[float]] = {}

    def filled(name: str, values: FloatArray) -> FloatArray:
        out, lengths_s = _filled(name, values, log, longest_s)
        stretches.setdefault(name, lengths_s)
        return out

    changed, notes = log.changed(filled), list(log.notes)
    for name, lengths_s in stretches.items():
        if lengths_s:
            count = "1 stretch" if len(lengths_s) == 1 else f"{len(lengths_s)} stretches"
            notes.append(
                Note.method(f"'{name}': {count} of up to {max(lengths_s):.3g} s without samples interpolated (--fill)")
            )
    return replace(changed, notes=tuple(notes))


def with_short_gaps(log: FlightLog) -> FlightLog:
    """Return the log with what is missing for up to `BRIDGED_S`, or a single sample, interpolated, and notes.

    Rows are missing where a step of an even clock is several periods long, samples of a channel where they are NaN.
    Longer gaps stay, and so do logs whose clock is uneven apart from that and channels of which much is missing: these
    have samples less often. Channels that are still in their file stay as they are.
    """
    if log.n_samples < FEWEST_SAMPLES:
        return log
    return _with_samples(_with_rows(log))


def _longest(log: FlightLog) -> int:
    """Return the most samples in a row that are interpolated."""
    return max(1, math.floor(BRIDGED_S * log.rate_hz * (1.0 + BESIDE)))


def _with_rows(log: FlightLog) -> FlightLog:
    """Return the log with the rows that are missing for a short time, interpolated, and a note."""
    step = np.diff(log.time_s) * log.rate_hz
    periods = np.round(step)
    whole = np.abs(step - periods) <= BESIDE * periods
    short = whole & (periods >= 2.0) & (periods <= _longest(log) + 1.0)
    single = whole & (periods == 1.0)
    even = short.sum() <= MOST_MISSING * step.size and short.sum() + single.sum() >= (1.0 - MOST_MISSING) * step.size
    for first, stop in runs(short):
        short[first:stop] = stop - first <= MOST_IN_A_ROW
    if not even or not short.any():
        return log
    count = np.where(short, periods - 1.0, 0.0).astype(np.intp)  # of rows that are missing after each row
    at = np.repeat(np.arange(1, log.n_samples), count)
    place = np.arange(at.size) - np.repeat(np.cumsum(count) - count, count) + 1.0
    part = place / np.repeat(count + 1.0, count)
    time_s = np.insert(log.time_s, at, log.time_s[at - 1] + part * (log.time_s[at] - log.time_s[at - 1]))
    missing = np.insert(np.zeros(log.n_samples, dtype=bool), at, True)
    longer = replace(log, time_s=frozen_array(time_s), channels={}, truth=None)
    longest_s = _longest(log) / log.rate_hz

    def with_holes(name: str, values: FloatArray) -> FloatArray:
        inserted = np.insert(values, at, np.nan)
        filled, _ = _filled(name, inserted, longer, longest_s)
        # Samples that are NaN in the file stay NaN.
        return frozen_array(np.where(missing, filled, inserted))

    first_s = log.time_s[at[0] - 1]
    note = Note.method(f"{at.size} missing samples, the first after {instant(first_s)} s, are interpolated")
    return log.changed(with_holes, time_s=longer.time_s, notes=(*log.notes, note))


def _with_samples(log: FlightLog) -> FlightLog:
    """Return the log with the samples of its channels that are missing for a short time, interpolated, and a note."""
    longest, filled = _longest(log), dict[str, int]()
    channels = {
        name: channel
        for name, channel in log.channels.items()
        if not (isinstance(channel, StoredChannel) and channel.is_stored)
    }

    def bridged_of(name: str, values: FloatArray) -> FloatArray:
        short = [(a, b) for a, b in runs(np.isnan(values)) if b - a <= longest and a > 0 and b < values.size]
        if not short or sum(b - a for a, b in short) > MOST_MISSING * values.size:
            return values
        out, lengths_s = _filled(name, values, log, longest / log.rate_hz)
        if lengths_s:
            filled.setdefault(name, sum(b - a for a, b in short))
        return out

    part = replace(log, channels=channels).changed(bridged_of)
    if not filled:
        return log
    named = [f"{n} of '{name}'" for name, n in filled.items()]
    more = f" and of {len(named) - MOST_NAMED} more channels" if len(named) > MOST_NAMED else ""
    note = Note.method(f"missing samples are interpolated: {', '.join(named[:MOST_NAMED])}{more}")
    return replace(part, channels={**log.channels, **part.channels}, notes=(*log.notes, note))


def _filled(name: str, values: FloatArray, log: FlightLog, longest_s: float) -> tuple[FloatArray, list[float]]:
    """Return the filled values, and the lengths, s, of the stretches that were filled."""
    out, lengths_s = values.copy(), []
    for start, stop in runs(np.isnan(values)):
        if start == 0 or stop == values.size:
            continue
        # From the last sample before to the first after, less one step, so that a gap of the clock within counts.
        at = log.time_s[start - 1 : stop + 1]
        length_s = float(at[-1] - at[0]) - 1.0 / log.rate_hz
        if not length_s <= longest_s + BESIDE / log.rate_hz:
            continue
        lengths_s.append(length_s)
        before, after = values[start - 1], values[stop]
        if name in FLAGS:
            out[start:stop] = before
            continue
        turns = 2.0 * np.pi * float(np.round((after - before) / (2.0 * np.pi))) if name in ANGLES else 0.0
        part = (at[1:-1] - at[0]) / (at[-1] - at[0])
        between = before + (after - turns - before) * part
        # The first half in the turn of the value before, the second half in that of the value after.
        out[start:stop] = np.where(part < 0.5, between, between + turns)
    return (frozen_array(out) if lengths_s else values), lengths_s
