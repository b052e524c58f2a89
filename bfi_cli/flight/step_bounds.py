"""How large a step of an output physics leaves unseen in a window, by its onset; one of its sensors made it.

A model of a window follows lags and ramps rather than predicts them wrong. Lift, climb and inertia are no model: an
airspeed that gains metres per second within ten seconds asks for a force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..airdata import DEPENDS_ON, SENSORS, isa_temperature
from ..decision import STEPS, OnsetBound
from ..faults.shapes import SHAPES
from ..kernels import FloatArray
from ..kernels.likelihood_ratio import likelihood_ratios
from .flight import Flight
from .limits import PITOT_LINE, declared_stretches, not_excluded
from .looks import Scanned
from .parity import Bound, Record
from .parity.record import STATIC_LEAK, STEP_S, climbing, hypotheses
from .parity.scan import WindowScan, fault_signatures
from .parity.static_relations import hidden_sizes
from .parity.windows import Window, overlaps
from .relations import StaticWindows
from .result import Event

# Lines of pressure by the hypothesis of the scan and by the name of their bounds.
LINES = (("q_impact", PITOT_LINE), (STATIC_LEAK, STATIC_LEAK))
# K, and K per m of altitude, by which air departs from the standard atmosphere within minutes: a front of 3 K, and an
# inversion of 3.5 K in 1000 m where that cools by 6.5. A probe that drifts by more shows it.
FRONT, INVERSION = 3.0, 0.01
# The slowest steps that a claim about steps covers: what builds up faster stands out more.
COURSES = tuple((shape, seconds) for shape in STEPS for seconds in SHAPES[shape].claimed_s or (0.0,))


def step_bounds(
    flight: Flight,
    scanned: Sequence[Scanned],
    static: StaticWindows,
    events: Sequence[Event],
    channels: Sequence[str],
) -> tuple[OnsetBound, ...]:
    """Return how large a step, a lag or a ramp of each channel may be unseen, by onset; none where nothing bounds it.

    Of several windows that in which an onset lies deepest counts, whatever it shows: the least of what they show would
    exclude too much. A window with a declared fault excludes no other.

    Parameters
    ----------
    scanned, static, events : of the flight, see `limits.bounds_of`.
    """
    left_out, scales = declared_stretches(events), {look.window: look.rule.scale for look in scanned}
    by_window = list[tuple[FloatArray, FloatArray, dict[str, FloatArray]]]()
    for window, answer in static:
        scan = None if flight.lasting_in(window) or overlaps(window, left_out) else flight.scan(window)
        if scan is not None and window in scales and not answer.findings:
            onsets_s = np.arange(np.ceil(window[0] / STEP_S) * STEP_S, window[1], STEP_S)[1:]
            depths = np.minimum(onsets_s - window[0], window[1] - onsets_s)
            by_window.append((onsets_s, depths, _errors(flight, scan, window, onsets_s, scales[window], channels)))
    if not by_window:
        return ()
    onsets_s = np.concatenate([onsets_s for onsets_s, _, _ in by_window])
    depths = np.concatenate([depths for _, depths, _ in by_window])
    # By onset, the farthest from the ends of its window first, of which the first of each onset counts.
    order = np.lexsort((-depths, onsets_s))
    at, first = np.unique(onsets_s[order], return_index=True)
    bounds = []
    for channel in channels:
        least = np.concatenate([errors[channel] for _, _, errors in by_window])[order][first]
        if np.isfinite(least).any():
            bounds.append(OnsetBound(channel=channel, onsets_s=at, errors=least))
    return tuple(bounds)


def _errors(
    flight: Flight, scan: WindowScan, window: Window, onsets_s: FloatArray, scale: float, channels: Sequence[str]
) -> dict[str, FloatArray]:
    """Return by channel (n_onsets,) the largest error of a step that one window leaves unseen.

    Parameters
    ----------
    scale : by which the flight shows more than those of the tables.
    """
    record = flight.record.between(*window)

    def courses(time_s: FloatArray) -> FloatArray:
        """Return (n, n_onsets * n_courses) of largest error 1 until the end of what is analysed."""
        columns = []
        for shape, seconds in COURSES:
            course = SHAPES[shape].course
            assert course is not None
            columns.append(course(time_s[:, None] - onsets_s, seconds) / course(flight.to_s - onsets_s, seconds))
        return np.hstack(columns)

    def worst(sizes: FloatArray) -> FloatArray:
        return np.asarray(sizes.reshape(len(COURSES), len(onsets_s)).max(axis=0))

    faults, columns = hypotheses(record), courses(record.time_s)
    signatures = fault_signatures(scan, record, faults, columns, flight.record)
    magnitude, sd = likelihood_ratios(scan.residuals, signatures, len(faults)).weighted(scan.weights)
    sizes, _ = not_excluded(magnitude, sd, scale)
    by_fault = {fault.fault: worst(largest) for fault, largest in zip(faults, sizes, strict=True)}
    related = {channel: hidden_sizes(flight.series, channel, window, courses) for channel in channels}

    def hidden(fault: str, bounds: Bound) -> FloatArray:
        """Return (n_onsets,) the largest size of a fault, infinite where nothing bounds it."""
        name = next((hypothesis for hypothesis, line in LINES if line == fault), fault)
        least = np.full(len(onsets_s), np.inf)
        if bounds == "error" and name in by_fault:
            least = by_fault[name]
        if bounds in related.get(fault, {}):
            least = np.minimum(least, worst(related[fault][bounds]))
        return least

    steps = np.ones(len(onsets_s))
    return {name: error_by_any_sensor(record, name, hidden, steps, is_sudden=True) for name in channels}


def error_by_any_sensor(
    part: Record, channel: str, hidden: Callable[[str, Bound], FloatArray], since_s: FloatArray, *, is_sudden: bool
) -> FloatArray:
    """Return (n,) the largest error of a channel that may hide, whichever of its sensors makes it.

    A fault of the channel alone is bounded by what bounds its error, or by its relations to others: these say nothing
    of the sensors that they share with it, of which the lines of pressure have bounds of their own, and the temperature
    probe that of the air.

    Parameters
    ----------
    hidden : from a fault and what bounds it, (n,) the largest size that may hide, of one that grows by second.
    since_s : (n,) seconds for which it grows, 1 for what does not.
    is_sudden : whether it comes within seconds: a rate that follows from how fast it comes has no bound.
    """
    related = hidden(channel, "disagreement") * since_s
    if "temperature probe" in SENSORS.get(channel, frozenset()):
        related = np.maximum(related, error_of_probe(part, channel))
    errors = np.minimum(hidden(channel, "error") * since_s, related)
    for line, name in LINES:
        grown, at_once = _reach(part, line, channel)
        if grown or at_once:
            reach = np.full(len(since_s), np.inf) if is_sudden and at_once else grown * since_s + at_once
            errors = np.maximum(errors, hidden(name, "error") * reach)
    return errors


def error_of_probe(part: Record, channel: str) -> float:
    """Return the largest error of the true airspeed by a temperature probe that drifts within a window."""
    if channel != "tas" or not ("altitude" in part.channels and {"tat", "sat"} & part.channels.keys()):
        return np.inf
    height = part.channels["altitude"]
    sat = part.air.sat
    warmth, speed = sat - isa_temperature(height), part.channels["tas"] / sat
    if not (np.isfinite(warmth).any() and np.isfinite(speed).any()):
        return np.inf
    change = (
        float(np.nanmax(warmth) - np.nanmin(warmth)) + FRONT + INVERSION * float(np.nanmax(height) - np.nanmin(height))
    )
    return 0.5 * float(np.nanmax(speed)) * change


def _reach(part: Record, fault: str, channel: str) -> tuple[float, float]:
    """Return the largest error of a channel by a fault of a line of size 1, and by one that grows by 1 a second."""
    hypothesis = next((hypothesis for hypothesis in hypotheses(part) if hypothesis.fault == fault), None)
    if hypothesis is None or channel not in DEPENDS_ON or channel not in part.channels:
        return 0.0, 0.0
    turning = climbing(part, hypothesis.size) if fault == STATIC_LEAK and channel == "altitude_rate" else part

    def moved(other: Record) -> float:
        change = np.abs(other.channels[channel] - part.channels[channel])
        return float(np.nanmax(change)) / hypothesis.size if np.isfinite(change).any() else 0.0

    return moved(part.with_small(hypothesis)[0]), moved(turning)
