"""What a diagnosis excludes: per fault and shape the largest that may hide in the worst stretch of the flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from ..airdata import air_data_of
from ..channels import LARGEST_ERROR, STANDARD
from ..parity import Bound, Threshold, scan_window
from ..parity.lines import METRES
from ..parity.record import STATIC_LEAK
from ..parity.scan import with_lasting
from ..parity.windows import Window, flight_stretches, overlaps, within
from .events import TRACE
from .flight import Flight
from .looks import Scanned
from .relations import StaticWindows
from .result import Event, FlightLimit, Look

__all__ = ["AIRSPEEDS", "PITOT_LINE", "Bounds", "Hidden", "bounds_of", "hidden_slopes", "limits_of"]
__all__ += ["tried_out"]

FloatArray = NDArray[np.float64]

AIRSPEEDS = ("tas", "cas", "ias", "mach")
PITOT_LINE = "pitot_icing"
# Limits are compared over stretches of this length, by which the onsets that windows of 60 s cover (40 s each, every
# 30 s) overlap, so that each lies within those of one window.
BIN_S = 10.0
# Of the flight time that is watched, in which the second limit of each fault holds: what a reader can rely on, as
# the worst stretch of an hour tells of itself only.
MOSTLY = 0.95
# Of hypotheses that are no channels.
UNITS = {"q_impact": "1", "ground_speed": "m/s", STATIC_LEAK: "Pa"}
# The faults that a verdict rests on, whose limits are tried out; by how much a slope is raised at once. On two recorded
# flights the medians are 1.03 to 1.09 in all, the most 4.4 (docs/theory.md, 15.8).
DECIDING, RAISED = (*AIRSPEEDS, "q_impact"), (1.03, 2.0)
# Of the error that a window leaves, for another over the same stretch to be tried out, or less than is tolerable: that
# takes as long as a scan. With 0.7 it took a sixth longer for limits a few per cent smaller.
MUCH_LESS = 0.5
PER_SECOND = {"1": "1/s", "m/s": "m/s^2", "rad": "rad/s", "m/s^2": "m/s^3", "Pa": "Pa/s"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hidden:
    """What one window leaves unseen of a fault.

    Attributes
    ----------
    onsets_s : (n,) that it shows; sizes : (n,) the largest that may begin there unseen, infinite where any may.
    scale : error on the channel by a fault of size 1, after a second where it grows.
    tolerance : of the channel in this window, None where it has none.
    largest : the error beyond which any size may hide.
    tried : of the scan by how much sizes are raised until a fault of that size, tried out, is declared; None where they
        are exact.
    """

    window: Window
    onsets_s: FloatArray
    sizes: FloatArray
    scale: float
    tolerance: float | None
    largest: float = np.inf
    tried: Callable[[], float] | None = None

    def raised(self, factor: float) -> Hidden:
        """Return the same with sizes so many times as large, any where the error is beyond the largest."""
        sizes = factor * self.sizes
        reach = (self.window[1] - self.onsets_s) * self.scale
        return replace(self, sizes=np.where(sizes * reach <= self.largest, sizes, np.inf), tried=None)

    @property
    def watched(self) -> list[Window]:
        """The onsets that it covers; a fault that grew before the first of them shows as one from there on."""
        edges = np.flatnonzero(np.diff(np.isfinite(self.sizes).astype(np.int8), prepend=0, append=0)).tolist()
        return [
            (float(self.onsets_s[first]) if first else self.window[0], float(self.onsets_s[end - 1]))
            for first, end in zip(edges[::2], edges[1::2], strict=True)
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bounds:
    """The windows that bound a fault of a shape."""

    fault: str
    shape: str
    channel: str
    unit: str
    bounds: Bound
    windows: tuple[Hidden, ...]


def bounds_of(
    flight: Flight,
    looks: Sequence[tuple[Scanned, Threshold, Look]],
    static: StaticWindows,
    events: Sequence[Event],
) -> tuple[Bounds, ...]:
    """Return by fault and shape the windows that bound it, of the parity scan and of the static relations.

    Windows with a declared fault are left out: they exclude no other of its size. What may last excludes nothing of its
    own after it. Of the scan a size counts as seen where it would be declared from this window alone.
    """
    left_out = [
        (one.onset_s, one.seen_until_s if one.offset_s is None else one.offset_s)
        for one in events
        if one.state == "declared" and one.stages[0] != "sensors"
    ]
    found: dict[tuple[str, str, Bound], Bounds] = {}
    tolerance = cache(flight.tolerance)
    largest = cache(lambda channel: _largest_error(flight, channel))

    def offer(
        kind: Bounds,
        window: Window,
        onsets_s: FloatArray,
        sizes: FloatArray,
        scale: float = 1.0,
        tried: Callable[[], float] | None = None,
    ) -> None:
        reach = window[1] - onsets_s if kind.shape == "drift" else 1.0
        hidden = Hidden(
            window=window,
            onsets_s=onsets_s,
            sizes=np.where(sizes * scale * reach <= largest(kind.channel), sizes, np.inf),
            scale=scale,
            tolerance=tolerance(kind.channel, window),
            largest=largest(kind.channel),
            tried=tried,
        )
        key = (kind.fault, kind.shape, kind.bounds)
        known = found.get(key, kind)
        found[key] = replace(known, windows=(*known.windows, hidden))

    for one, threshold, _ in looks:
        window = (one.from_s, one.to_s)
        told = () if overlaps(window, left_out) else one.magnitude
        level = threshold.level * (TRACE if one.lasting else 1.0)
        for name in [name for name in told if name not in one.lasting]:
            kind, scale = _drift_of(flight, name, window)
            sizes = one.hidden_slopes(name, level)
            most = largest(kind.channel) / scale
            tried = cache(partial(_raised_by, flight, one, name, level, sizes, most)) if name in DECIDING else None
            offer(kind, window, one.onsets_s, sizes, scale, tried)
            if name in AIRSPEEDS and name == flight.record.airspeed and "q_impact" not in one.magnitude:
                # Where one airspeed stands for the line, what bounds the channel bounds a loss of impact pressure.
                line, scale = replace(kind, fault=PITOT_LINE, unit="1/s"), 0.5 * _speed(flight, window, name)
                offer(line, window, one.onsets_s, sizes / scale, scale, tried)
    for window, answer in static:
        for limit in () if overlaps(window, left_out) else answer.limits:
            kind = Bounds(
                fault=limit.fault,
                shape=limit.shape,
                channel=limit.channel,
                unit=limit.unit,
                bounds=limit.bounds,
                windows=(),
            )
            offer(kind, window, np.array(limit.onsets_s), np.array(limit.sizes))
    return tuple(replace(one, windows=tried_out(flight, one)) for one in found.values())


def _raised_by(flight: Flight, one: Scanned, fault: str, level: float, sizes: FloatArray, most: float) -> float:
    """Return by how much the slopes of a window are raised until faults of these slopes, tried out in it, are declared.

    A large fault is not linear in what it makes of a residual, and changes the wind and the level of noise that fit.
    It is tried in the middle of the window, of both signs; infinite where none up to an error of `most` is declared.
    """
    part = flight.record.between(one.from_s, one.to_s)
    k = len(sizes) // 2
    if not np.isfinite(sizes[k]):
        return np.inf
    course = sizes[k] * np.maximum(part.time_s - one.onsets_s[k], 0.0)

    def statistic(factor: float) -> float:
        try:
            faulty = with_lasting(part, fault, factor * course)
            scan = scan_window(
                faulty,
                zero_lift=flight.zero_lift,
                only=one.residuals,
                lasting=one.lasting,
                fault=fault,
                onset_s=float(one.onsets_s[k]),
            )
        except ValueError:  # of that size it is no flight
            return 0.0
        return 0.0 if scan is None else scan.statistic

    factor = RAISED[0]
    for sign in (1.0, -1.0):
        while factor * course[-1] <= most and (shown := statistic(sign * factor)) < level:
            factor *= float(np.clip(RAISED[0] * np.sqrt(level / max(shown, 1e-9)), *RAISED))
    return factor if factor * course[-1] <= most else np.inf


def tried_out(flight: Flight, one: Bounds) -> tuple[Hidden, ...]:
    """Return the windows: tried out those that leave about the least, the others raised by the most of these."""
    windows, starts = list(one.windows), _stretches(flight)
    shares = np.array([_of_window(hidden, starts, one.shape)[2] for hidden in windows])
    untried, most = np.array([hidden.tried is not None for hidden in windows]), 1.0
    while untried.any():
        known = np.min(shares[~untried], axis=0, initial=np.inf)
        untold = np.where(untried[:, None], shares, np.inf)
        least = np.min(untold, axis=0)
        best = np.argmin(untold, axis=0)[(least < MUCH_LESS * known) | ((least <= 1.0) & (known > 1.0))]
        if not best.size:
            break
        j = int(np.bincount(best).argmax())  # that counts over most stretches
        tried = windows[j].tried
        assert tried is not None
        factor = tried()
        most = max(most, factor) if np.isfinite(factor) else most
        windows[j], untried[j] = windows[j].raised(factor), False
        shares[j] = _of_window(windows[j], starts, one.shape)[2]
    return tuple(hidden if hidden.tried is None else hidden.raised(most) for hidden in windows)


def limits_of(flight: Flight, bounds: Sequence[Bounds]) -> tuple[FlightLimit, ...]:
    """Return per fault and shape what the worst stretch of the watched flight excludes, and what most of it does.

    Of the windows over a stretch that with the least error over its tolerance counts, of the stretches the one with the
    most. A third limit is that of a fault that grows on until a later window would have shown it.
    """
    rows = [row for one in bounds for row in _rows(flight, one)]
    return tuple(
        sorted(rows, key=lambda row: (row.bounds != "error", row.shape, row.fault, -row.holds_in, row.grows_on))
    )


def hidden_slopes(one: Bounds, starts: FloatArray) -> FloatArray:
    """Return (n_starts,) the steepest drifts that may begin unseen in the stretches from these times on."""
    every = [_of_window(hidden, starts, one.shape)[0] for hidden in one.windows]
    return np.asarray(np.min([*every, np.full(len(starts), np.inf)], axis=0))


def _rows(flight: Flight, one: Bounds) -> list[FlightLimit]:
    windows, starts = sorted(one.windows, key=lambda hidden: hidden.window[1]), _stretches(flight)
    if not windows:
        return []
    sizes, reach, shares = (
        np.stack(column, axis=1)
        for column in zip(*(_of_window(hidden, starts, one.shape) for hidden in windows), strict=True)
    )
    k = np.flatnonzero(np.isfinite(shares).any(axis=1))
    if not k.size:
        return []
    best = np.argmin(shares[k], axis=1)
    order = np.argsort(shares[k, best], kind="stable")
    rows = []
    for holds_in, at in ((1.0, order[-1]), (MOSTLY, order[int(np.ceil(MOSTLY * len(order))) - 1])):
        hidden, size = windows[best[at]], float(sizes[k[at], best[at]])
        effect = size * float(reach[k[at], best[at]])
        rows.append(_row(flight, one, hidden, size, effect, hidden.window, holds_in=holds_in))
    if one.shape == "drift":
        tolerances = [hidden.tolerance or 1.0 for hidden in windows]
        size, effect, first, last = _grown(sizes[k], reach[k], best, tolerances)
        span = (float(starts[k[first]]), windows[last].window[1])
        rows.append(_row(flight, one, windows[last], size, effect, span, grows_on=True))
    return rows


def _stretches(flight: Flight) -> FloatArray:
    """Return where the stretches begin over which limits are compared."""
    return np.arange(flight.from_s, flight.to_s - BIN_S + 1e-6, BIN_S)


def _of_window(hidden: Hidden, starts: FloatArray, shape: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return by stretch the largest sizes that may begin there unseen, the error by size 1, and the share of tolerance.

    What begins before a window and grows shows in it as from its first onset on; only for the stretches that a window
    covers itself the third, (n_stretches,) as all of them, is finite.
    """
    sizes = np.full(len(starts), np.inf)
    first = np.searchsorted(hidden.onsets_s, starts, side="right") - 1
    last = np.searchsorted(hidden.onsets_s, starts + BIN_S - 1e-6)
    sizes[last == 0] = hidden.sizes[0]
    for k in np.flatnonzero((last > 0) & (last < len(hidden.onsets_s))).tolist():
        sizes[k] = hidden.sizes[max(first[k], 0) : last[k] + 1].max()
    reach = hidden.scale * (hidden.window[1] - starts if shape == "drift" else np.ones(len(starts)))
    inside = np.isfinite(sizes) & (starts >= hidden.window[0] - 1e-6)
    shares = np.full(len(starts), np.inf)
    shares[inside] = sizes[inside] * reach[inside] / (hidden.tolerance or 1.0)
    return sizes, reach, shares


def _grown(
    sizes: FloatArray, reach: FloatArray, best: NDArray[np.intp], tolerances: Sequence[float]
) -> tuple[float, float, int, int]:
    """Return size and error of a fault that grows on, its stretch, and the window that it is hidden from last.

    A fault that grew to the end of a window is hidden where its size is less than what that window and all that ended
    before it show. It may stop just before the next window ends: the worst of all such ends counts.

    Parameters
    ----------
    sizes, reach : (n_stretches, n_windows) windows in the order of their ends; reach is the error by size 1 at its end.
    best : (n_stretches,) the window from whose end on it grows.
    """
    least = np.minimum.accumulate(sizes, axis=1)
    before = np.concatenate([np.full((len(sizes), 1), np.inf), least[:, :-1]], axis=1)
    later = np.arange(sizes.shape[1]) > best[:, None]
    at_best = np.arange(sizes.shape[1]) == best[:, None]
    unseen = np.where(later, before, np.where(at_best, least, 0.0))
    errors = unseen * reach
    first, last = np.unravel_index(int(np.argmax(errors / tolerances)), errors.shape)
    return float(unseen[first, last]), float(errors[first, last]), int(first), int(last)


def _row(
    flight: Flight,
    one: Bounds,
    hidden: Hidden,
    size: float,
    effect: float,
    span: Window,
    *,
    holds_in: float = 1.0,
    grows_on: bool = False,
) -> FlightLimit:
    any_size = effect > _largest_error(flight, one.channel)
    return FlightLimit(
        fault=one.fault,
        shape=one.shape,
        channel=one.channel,
        bounds=one.bounds,
        holds_in=holds_in,
        grows_on=grows_on,
        excluded_above=None if any_size else size,
        unit=one.unit,
        effect=None if any_size else effect,
        effect_unit=_unit(flight, one.channel),
        tolerance=hidden.tolerance,
        within_tolerance=not any_size and hidden.tolerance is not None and effect <= hidden.tolerance,
        from_s=span[0],
        to_s=span[1],
    )


def _largest_error(flight: Flight, channel: str) -> float:
    """Return the error beyond which a limit says nothing: of an airspeed its median in flight, all of what it shows."""
    largest = LARGEST_ERROR.get(channel, np.inf)
    values = flight.record.channels.get(channel, np.empty(0))
    if channel not in AIRSPEEDS or not values.size:
        return largest
    flown = values[within(flight.record.time_s, flight_stretches(flight.part_phases)) & np.isfinite(values)]
    return min(largest, float(np.median(flown))) if flown.size else largest


def _drift_of(flight: Flight, fault: str, window: Window) -> tuple[Bounds, float]:
    """Return what a hypothesis of the scan is called as a drift, and the error of its channel by 1 after a second."""
    name, channel, scale = fault, fault, 1.0
    if fault == "q_impact":
        # A share of the impact pressure is half as large a share of the airspeed.
        name, channel = PITOT_LINE, next((one for one in AIRSPEEDS if one in flight.recorded), "tas")
        scale = 0.5 * _speed(flight, window, channel)
    elif fault == STATIC_LEAK:
        channel = "altitude"
        scale = METRES / float(np.nanmedian(air_data_of(flight.record.between(*window).channels).p_static))
    unit = UNITS.get(fault) or STANDARD[fault].unit
    kind = Bounds(fault=name, shape="drift", channel=channel, unit=PER_SECOND[unit], bounds="error", windows=())
    return kind, scale


def _speed(flight: Flight, window: Window, channel: str) -> float:
    return float(np.nanmean(flight.record.between(*window).channels[channel]))


def _unit(flight: Flight, channel: str) -> str:
    return STANDARD[channel].unit if channel in STANDARD else flight.log.channels[channel].unit
