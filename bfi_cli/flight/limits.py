"""What a diagnosis excludes: per fault and shape the largest that may hide in the worst stretch of the flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Literal

import numpy as np

from ..decision import MOSTLY
from ..kernels import BoolArray, FloatArray, IntArray
from ..quantities.channels import LARGEST_ERROR, STANDARD, per_second
from .flight import Flight
from .judge import REFERENCES, WIDE
from .looks import Scanned
from .parity import Bound, Hidden
from .parity.lines import METRES
from .parity.record import STATIC_LEAK, UNITS, Record
from .parity.windows import Window, overlaps, within
from .relations import StaticWindows
from .result import Event, FlightLimit, LimitCourse
from .tables import ROWS

AIRSPEEDS = ("tas", "cas", "ias", "mach")
PITOT_LINE = "pitot_icing"
# Limits are compared over stretches of this length, by which the onsets that windows of 60 s cover (40 s each, every
# 30 s) overlap, so that each lies within those of one window.
BIN_S = 10.0
# Standard deviations by which a slope exceeds its estimate in 5 % of windows at most: 1.645 of a normal distribution
# times 1.2. By fault and length, the quantiles of 90 % of healthy windows of two recorded flights are 0.8 to 1.3 times
# those of a normal distribution, 1.0 in the median.
EXCEEDED_BY = 2.0


Bounds = Sequence[Hidden]  # the windows that bound a fault of a shape


def bounds_of(
    flight: Flight,
    scanned: Sequence[Scanned],
    static: StaticWindows,
    events: Sequence[Event],
) -> tuple[Bounds, ...]:
    """Return by fault and shape the windows that bound it, of the parity scan and of the static relations.

    Windows with a declared fault are left out: they exclude no other of its size. What may last excludes nothing of its
    own after it. A limit of the scan holds at 95 % for a fault of any onset.
    """
    left_out = declared_stretches(events)
    bounds: dict[tuple[str, str, Bound], list[Hidden]] = {}
    largest, plausible = cache(partial(_largest_error, flight)), cache(partial(_plausible, flight))

    def offer(hidden: Hidden) -> None:
        (from_s, to_s), grows, most = hidden.window, hidden.shape == "drift", largest(hidden.channel, hidden.fault)
        sizes, declared = hidden.sizes, np.maximum(hidden.sizes, hidden.declared)
        reached = declared * hidden.scale * (to_s - from_s if grows else 1.0)
        bounded = replace(
            hidden,
            declared=np.where(reached <= min(most, plausible(hidden.fault)), declared, np.inf),
            sizes=np.where(sizes * hidden.scale * (to_s - hidden.onsets_s if grows else 1.0) <= most, sizes, np.inf),
            tolerance=flight.tolerance(hidden.channel, hidden.window),
        )
        bounds.setdefault((hidden.fault, hidden.shape, hidden.bounds), []).append(bounded)

    for scan in scanned:
        if overlaps(scan.window, left_out):
            continue
        part = flight.record.between(*scan.window)
        for name in (name for name in scan.magnitude if name not in scan.lasting):
            hidden = _drift_of(flight, scan, name, part)
            offer(hidden)
            if name in AIRSPEEDS and name == flight.record.airspeed and "q_impact" not in scan.magnitude:
                # Where one airspeed stands for the line, what bounds the channel bounds a loss of impact pressure.
                scale = 0.5 * _speed(part, name)
                sized = {key: getattr(hidden, key) / scale for key in ("sizes", "spreads", "declared")}
                offer(replace(hidden, fault=PITOT_LINE, unit="1/s", scale=scale, **sized))
    for window, answer in static:
        for hidden in () if overlaps(window, left_out) else answer.limits:
            offer(hidden)
    return tuple(map(tuple, bounds.values()))


def declared_stretches(events: Sequence[Event]) -> list[Window]:
    """Return where a fault is declared, beside which no other of its size is excluded."""
    return [event.shown_s for event in events if event.state == "declared" and event.stages[0] != "sensors"]


def _plausible(flight: Flight, fault: str) -> float:
    """Return the error of a channel beyond which it is not taken for one of its sensor.

    That of the altitude, m, is the height of the impact pressure where a static line errs: then no airspeed is left, or
    half as much again, which is nothing of what a small fault makes of it.
    """
    if fault != STATIC_LEAK:
        return ROWS[fault].plausible if fault in ROWS else np.inf
    flown = within(flight.record.time_s, flight.stretches)
    share = (flight.record.air.q_impact / flight.record.air.p_static)[flown]
    return METRES * float(np.nanmedian(share)) if np.isfinite(share).any() else np.inf


def _is_weighed(fault: str) -> bool:
    """Say whether the model of the flight weighs a fault that the scan shows, without which none is declared.

    A reference is named by a finder alone: of what the scan shows, an airspeed or a line is.
    """
    return fault not in REFERENCES and fault in (*WIDE, *AIRSPEEDS, "q_impact", STATIC_LEAK)


def limits_of(flight: Flight, bounds: Sequence[Bounds]) -> tuple[FlightLimit, ...]:
    """Return per fault and shape what the worst stretch of the watched flight excludes, and what most of it does.

    Of the windows over a stretch that with the least error over its tolerance counts, of the stretches the one with the
    most. A third limit is that of a fault that grows on until a later window would have shown it.
    """
    rows = [row for bound in bounds for row in _rows(flight, bound)]
    return tuple(
        sorted(
            (_soonest_seen(row, rows) for row in rows),
            key=lambda row: (row.bounds != "error", row.shape, row.fault, -row.holds_in, row.grows_on),
        )
    )


def _soonest_seen(row: FlightLimit, rows: Sequence[FlightLimit]) -> FlightLimit:
    """Return a row with the least error that shows its fault: as an error of the channel, or in a disagreement."""
    if row.grows_on:
        return row
    alike = [
        other
        for other in rows
        if (other.fault, other.shape, other.holds_in, other.grows_on) == (row.fault, row.shape, row.holds_in, False)
        and other.seen_effect is not None
    ]
    best = min(alike, key=lambda other: other.seen_effect or 0.0, default=row)
    return replace(row, seen_above=best.seen_above, seen_effect=best.seen_effect, seen_within_s=best.seen_within_s)


def hidden_slopes(windows: Bounds, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n_starts,) the steepest drifts that may begin unseen in the stretches from these times on.

    The second are those that a window would declare with 90 % power.
    """
    if not windows:
        return np.full(len(starts), np.inf), np.full(len(starts), np.inf)
    sizes, declared, spreads, _, _ = _limits_by_window(windows, starts)
    return np.asarray(sizes[np.arange(len(starts)), np.argmin(spreads, axis=1)]), declared.min(axis=1)


def limit_courses(flight: Flight, bounds: Sequence[Bounds]) -> tuple[LimitCourse, ...]:
    """Return the limits over time of drifts of every airspeed, and of icing, that the scan of the flight bounds."""
    starts, courses = _stretches(flight), []
    for windows in bounds:
        bound = windows[0]
        if bound.shape != "drift" or bound.bounds != "error" or bound.fault not in (*AIRSPEEDS, PITOT_LINE):
            continue
        sizes, _, spreads, _, inside = _limits_by_window(windows, starts)
        best = np.argmin(np.where(inside, spreads, np.inf), axis=1)
        slopes = np.where(inside, sizes, np.nan)[np.arange(len(starts)), best]
        known = np.sort(slopes[np.isfinite(slopes)])
        if known.size:
            mostly, worst = known[[int(np.ceil(MOSTLY * len(known))) - 1, -1]].tolist()
            middle_s = starts + 0.5 * BIN_S
            course = LimitCourse(
                fault=bound.fault, unit=bound.unit, time_s=middle_s, excluded_above=slopes, mostly=mostly, worst=worst
            )
            courses.append(course)
    return tuple(courses)


def _rows(flight: Flight, bounds: Bounds) -> list[FlightLimit]:
    windows, starts = sorted(bounds, key=lambda hidden: hidden.window[1]), _stretches(flight)
    grows = windows[0].shape == "drift"
    sizes, declared, spreads, reach, inside = _limits_by_window(windows, starts)
    k = np.flatnonzero(inside.any(axis=1))
    if not k.size:
        return []
    sizes, declared, spreads, reach, inside = sizes[k], declared[k], spreads[k], reach[k], inside[k]
    tolerances = np.array([hidden.tolerance or 1.0 for hidden in windows])
    per_tolerance = reach / tolerances
    best = np.argmin(np.where(inside, spreads, np.inf) * np.where(inside, per_tolerance, 1.0), axis=1)
    at_best = (np.arange(len(k)), best)
    shares = sizes[at_best] * per_tolerance[at_best]
    order = np.argsort(shares, kind="stable")
    # What is declared may be so by another window than that which excludes most.
    lengths = np.array([hidden.window[1] - hidden.window[0] if grows else 1.0 for hidden in windows])
    errors = np.where(inside, declared, np.inf) * lengths * np.array([hidden.scale for hidden in windows])
    declared_shares = errors / tolerances
    soonest = np.argmin(declared_shares, axis=1)
    by_share = np.argsort(declared_shares.min(axis=1), kind="stable")
    rows = []
    for holds_in, rank in ((1.0, len(k) - 1), (MOSTLY, int(np.ceil(MOSTLY * len(k))) - 1)):
        at, seen_at = order[rank], by_share[rank]
        hidden, size, seen = windows[best[at]], float(sizes[at, best[at]]), (seen_at, soonest[seen_at])
        row = _row(flight, hidden, size, size * float(reach[at, best[at]]), hidden.window, holds_in=holds_in)
        if np.isfinite(declared_shares[seen]):
            from_s, to_s = windows[seen[1]].window
            above, effect = float(declared[seen]), float(errors[seen])
            row = replace(row, seen_above=above, seen_effect=effect, seen_within_s=to_s - from_s)
        rows.append(row)
    if grows:
        size, share, first, last = _grown(sizes, spreads, per_tolerance, best)
        effect = share * float(tolerances[last])
        span = (float(starts[k[first]]), windows[last].window[1])
        rows.append(_row(flight, windows[last], size, effect, span, grows_on=True))
    return rows


def _stretches(flight: Flight) -> FloatArray:
    """Return where the stretches begin over which limits are compared."""
    return np.arange(flight.from_s, flight.to_s - BIN_S + 1e-6, BIN_S)


def _limits_by_window(
    windows: Bounds, starts: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return by stretch and window the largest sizes that may begin there, those that are declared, their spreads, and
    the error by size 1.

    What begins before a window and grows shows in it as from its first onset on; the fifth is true only for the
    stretches that a window covers itself. All are (n_stretches, n_windows).
    """
    n_onsets = np.array([len(hidden.onsets_s) for hidden in windows])
    begin, number = np.cumsum(n_onsets) - n_onsets, np.repeat(np.arange(len(windows)), n_onsets)
    onsets_s = np.concatenate([hidden.onsets_s for hidden in windows])

    def onsets_before(borders_s: FloatArray, side: Literal["left", "right"]) -> IntArray:
        """Return (n_stretches, n_windows) how many onsets of each window lie before the border of each stretch."""
        counts = np.zeros((len(borders_s) + 1, len(windows)), dtype=np.intp)
        np.add.at(counts, (np.searchsorted(borders_s, onsets_s, side=side), number), 1)
        return np.cumsum(counts, axis=0)[:-1]

    first = np.maximum(onsets_before(starts, "left") - 1, 0)
    last = onsets_before(starts + BIN_S - 1e-6, "right")
    by_onset = [[getattr(hidden, name) for hidden in windows] for name in ("sizes", "declared", "spreads")]
    # An entry more, so that a stretch of onsets may end with the last.
    joined = np.array([np.append(np.concatenate(values), np.inf) for values in by_onset])
    limits = np.full((3, *last.shape), np.inf)
    k, j = np.nonzero((last > 0) & (last < n_onsets))
    edges = np.column_stack([begin[j] + first[k, j], begin[j] + last[k, j] + 1])
    if len(edges):
        limits[:, k, j] = np.maximum.reduceat(joined, edges.ravel(), axis=1)[:, ::2]
    sizes, declared, spreads = np.where(last == 0, joined[:, None, begin], limits)
    to_s, scale = (np.array(values) for values in zip(*((h.window[1], h.scale) for h in windows), strict=True))
    reach = scale * (to_s - starts[:, None] if windows[0].shape == "drift" else np.ones(last.shape))
    inside = starts[:, None] >= np.array([hidden.window[0] for hidden in windows]) - 1e-6
    return sizes, declared, spreads, reach, inside & np.isfinite(sizes)


def _grown(
    sizes: FloatArray, spreads: FloatArray, per_tolerance: FloatArray, best: IntArray
) -> tuple[float, float, int, int]:
    """Return size and share of tolerance of a fault that grows on, its stretch, and the window it is hidden from last.

    A fault that grew to the end of a window is hidden where its size is less than the limit of the most telling of that
    window and all that ended before it. It may stop just before the next window ends: the worst of all such ends
    counts.

    Parameters
    ----------
    sizes, spreads, per_tolerance : (n_stretches, n_windows) windows in the order of their ends; the last is the error
        by size 1 at its end, over its tolerance.
    best : (n_stretches,) the window from whose end on it grows.
    """
    each = np.arange(sizes.shape[1])
    is_best = np.isfinite(sizes) & (spreads <= np.minimum.accumulate(spreads, axis=1))
    telling = np.maximum.accumulate(np.where(is_best, each, -1), axis=1)
    least = np.where(telling >= 0, np.take_along_axis(sizes, np.maximum(telling, 0), axis=1), np.inf)
    before = np.concatenate([np.full((len(sizes), 1), np.inf), least[:, :-1]], axis=1)
    unseen = np.where(each > best[:, None], before, np.where(each == best[:, None], least, 0.0))
    shares = unseen * per_tolerance
    first, last = np.unravel_index(int(np.argmax(shares)), shares.shape)
    return float(unseen[first, last]), float(shares[first, last]), int(first), int(last)


def _row(
    flight: Flight,
    hidden: Hidden,
    size: float,
    effect: float,
    span: Window,
    *,
    holds_in: float = 1.0,
    grows_on: bool = False,
) -> FlightLimit:
    any_size = effect > _largest_error(flight, hidden.channel, hidden.fault)
    return FlightLimit(
        fault=hidden.fault,
        shape=hidden.shape,
        channel=hidden.channel,
        bounds=hidden.bounds,
        holds_in=holds_in,
        grows_on=grows_on,
        excluded_above=None if any_size else size,
        unit=hidden.unit,
        effect=None if any_size else effect,
        effect_unit=_unit(flight, hidden.channel),
        tolerance=hidden.tolerance,
        within_tolerance=not any_size and hidden.tolerance is not None and effect <= hidden.tolerance,
        from_s=span[0],
        to_s=span[1],
    )


def _largest_error(flight: Flight, channel: str, fault: str) -> float:
    """Return the error beyond which a limit says nothing: of an airspeed its median in flight, all of what it shows.

    Nothing climbs faster than it flies. A tube that ices has lost all of its impact pressure where half of the airspeed
    is gone to first order.
    """
    largest = LARGEST_ERROR.get(channel, np.inf)
    speed = channel if channel in AIRSPEEDS else flight.record.airspeed
    values = flight.record.channels.get(speed, np.empty(0))
    if channel not in (*AIRSPEEDS, "ground_speed", "altitude_rate") or not values.size:
        return largest
    flown = values[within(flight.record.time_s, flight.stretches) & np.isfinite(values)]
    share = 0.5 if fault == PITOT_LINE else 1.0
    return min(largest, share * float(np.median(flown))) if flown.size else largest


def _drift_of(flight: Flight, scan: Scanned, fault: str, part: Record) -> Hidden:
    """Return what a window of the scan leaves unseen of a hypothesis, a drift of what that is called.

    Parameters
    ----------
    part : the seconds of the window.
    """
    name, channel, scale = fault, fault, 1.0
    if fault == "q_impact":
        # A share of the impact pressure is half as large a share of the airspeed.
        name, channel = PITOT_LINE, next((airspeed for airspeed in AIRSPEEDS if airspeed in flight.recorded), "tas")
        scale = 0.5 * _speed(part, channel)
    elif fault == STATIC_LEAK:
        channel = "altitude"
        scale = METRES / float(np.nanmedian(part.air.p_static))
    sizes, spreads = not_excluded(scan.magnitude[fault], scan.sd[fault], scan.rule.scale)
    return Hidden(
        fault=name,
        shape="drift",
        channel=channel,
        unit=per_second(UNITS[fault]),
        bounds="error",
        window=scan.window,
        onsets_s=scan.onsets_s,
        sizes=sizes,
        declared=scan.declared[fault] if _is_weighed(fault) else np.full_like(sizes, np.inf),
        spreads=spreads,
        scale=scale,
    )


def not_excluded(magnitude: FloatArray, sd: FloatArray, scale: float) -> tuple[FloatArray, FloatArray]:
    """Return the largest sizes that estimates leave at 95 %, and what of these their noise makes.

    The statistic, which a rougher flight raises by a scale, goes with the square of a size.
    """
    spreads = EXCEEDED_BY * np.sqrt(scale) * sd
    return np.abs(magnitude) + spreads, spreads


def _speed(part: Record, channel: str) -> float:
    return float(np.nanmean(part.channels[channel]))


def _unit(flight: Flight, channel: str) -> str:
    return STANDARD[channel].unit if channel in STANDARD else flight.log.channels[channel].unit
