"""The course of a channel's error in a static relation: its onset to a tenth of a second, and where it stops growing.

`find_static` looks for steps and ramps at whole seconds. A step within a second moves the mean of that second by a part
only, and noise that hardly changes from one second to the next is scanned by that one; a ramp that stops, and what
lags, are neither. When a step begins the log's own samples about it tell.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...faults.filters import response_of
from ...faults.shapes import SHAPES
from ...flightlog import FlightLog
from ...flightlog.quality import held_hz, recorder_filters
from ...kernels import CHI_SQUARE_95, FloatArray
from ...kernels.compiled import special
from ...kernels.low_pass import Kind, Response, low_pass
from ...kernels.whiteness import autocorrelation
from .explain import PRICE
from .finding import Finding, as_good, squares_by_onset
from .relation_series import AVERAGED, BLOCK_S, RelationSeries, beside_line
from .static_relations import MARGIN_S

Candidate = tuple[str, float | None, float]  # shape; duration, time constant, or what draws a step out; onset; in s

# PARTS [s]: times within a second at which a course is averaged over it.
PARTS = (np.arange(10) + 0.5) / 10.0 - 0.5
# s, standard deviations of the low-pass of a recorder, which draws a step out: a Gaussian of 0.25 s is that of the
# recorded Citation, one of 0.5 s twice as slow.
DRAWN_OUT_S = (0.0, 0.25, 0.5)
SHARP_S, ROUNDING_S = 1e-9, 1e-6  # of a step that is not drawn out, and of times that are computed
# s, the shortest duration and time constant; and so many of them the window holds after the onset: less of a lag is a
# drift.
SHORTEST_S, HELD = {"ramp_hold": 3.0, "lagged_bias": 1.0}, {"ramp_hold": 1.0, "lagged_bias": 2.0}
# A lag is sharp in onset and time constant, so that it is first tried where a step and a ramp begin, s.
LAGS_S, ABOUT_S = (1.0, 1.5, 2.2, 3.3, 5.0, 7.5, 11.0, 17.0, 25.0, 40.0), 0.25 * np.arange(-12, 13)
# s, between the onsets and the ends of ramps that are tried first; then about the best of these, so many on both sides.
COARSE_S, FINER_S, SPREAD = 10.0, (2.0, 0.5, 0.1, 0.02), 6
# Twice the log-likelihood that a step's onset loses at the ends of 95 %, -2 ln(1 - 0.95^0.5): the time of a sharp step
# is no regular parameter (B. E. Hansen, Sample splitting and threshold estimation, Econometrica 68, 2000, theorem 1).
SHARP_CHANGE = 7.35
# What may draw a step out beside the recorder, such as the sensor, with no delay and with some, Hz of gain one half.
DRAWN_OUT_BY: tuple[Kind, ...] = ("gaussian", "causal")
DRAWN_OUT_HZ = (0.4, 0.75, 1.5, 3.0, 6.0)
FINE, FEWEST_BESIDE = 5, 4  # onsets that are tried in a step of the samples, and samples to both sides that tell one


def with_course(series: RelationSeries, finding: Finding, window: tuple[float, float], unit: str) -> Finding:
    """Return a finding of a window with the course that explains its relation best: a step, drift, ramp or lag.

    The interval of its size goes over all onsets and durations that may be true, each by its likelihood.

    Parameters
    ----------
    series : the relation that shows it.
    unit : of the channel that errs.
    """
    from_s, to_s = window
    part = series.between(from_s, to_s, shows=finding.fault)
    time_s, effect = part.time_s, part.effects[finding.fault]
    if len(time_s) <= part.nuisances.shape[1] + 1:
        return finding
    scanned: dict[Candidate, tuple[float, float, float]] = {}  # statistic, magnitude and its standard deviation

    def scan(candidates: Iterable[Candidate]) -> None:
        """Scan those of some courses that the window tells."""
        new = [
            (shape, constant_s, at_s)
            for shape, constant_s, at_s in dict.fromkeys(candidates)
            if from_s + MARGIN_S <= at_s <= to_s - MARGIN_S
            and (shape not in HELD or SHORTEST_S[shape] <= (constant_s or 0.0) <= (to_s - at_s) / HELD[shape])
        ]
        if new := [course for course in new if course not in scanned]:
            changes = part.scan(np.column_stack([effect * _averaged(course, time_s) for course in new]))
            scanned.update(zip(new, zip(changes.statistic, changes.amplitude, changes.sd, strict=True), strict=True))

    def best_of(shape: str) -> Candidate | None:
        alike = (course for course in scanned if course[0] == shape)
        return max(alike, key=lambda course: scanned[course][0], default=None)

    for shape in ("bias", "drift", "ramp_hold", "lagged_bias"):
        begins_s = [course[2] for course in (best_of("bias"), best_of("ramp_hold")) if course is not None]
        scan(_first(shape, finding, window, begins_s))
        for step_s in FINER_S:
            if (likeliest := best_of(shape)) is not None:
                scan(_about(likeliest, step_s))
    names, (statistic, magnitude, sd) = list(scanned), np.array([*scanned.values()]).T
    prices = [PRICE if shape in HELD else 0.0 for shape, _, _ in names]
    best = int(np.argmax(statistic - prices))
    if finding.fault in series.speeds:
        without = series.without(finding.fault, magnitude[best] * _averaged(names[best], series.time_s))
        part = without.between(from_s, to_s, shows=finding.fault)
        changes = part.scan(np.column_stack([effect * _averaged(course, time_s) for course in names]))
        statistic, magnitude, sd = changes.statistic, changes.amplitude, changes.sd
        best = int(np.argmax(statistic - prices))
    shape, constant, onset_s = names[best]
    same = np.array([course[0] == shape for course in names]) & np.isfinite(sd)
    if not same[best]:
        return finding
    share = np.exp(0.5 * (statistic[same] - statistic[best]))
    squares = sd[same] ** 2 + (magnitude[same] - magnitude[best]) ** 2
    reached = float(np.max(np.abs(_averaged(names[best], time_s))))
    steps = AVERAGED * series.noise_sd / (float(np.median(np.abs(effect))) * reached)
    near_s = np.array([course[2] for course in names])[same & (statistic >= statistic[best] - CHI_SQUARE_95)]
    return replace(
        finding,
        shape=shape,
        constant_s=constant if shape in HELD else None,
        magnitude=float(magnitude[best]),
        sd=float(np.hypot(np.sqrt(share @ squares / share.sum()), steps)),
        unit=SHAPES[shape].magnitude_unit(unit, slope=None),
        effect={finding.fault: abs(float(magnitude[best])) * reached},
        onset_s=onset_s,
        onset_ci95=(float(near_s.min()) - 0.5 * BLOCK_S, float(near_s.max()) + 0.5 * BLOCK_S),
    )


def _first(shape: str, finding: Finding, window: tuple[float, float], begins_s: Sequence[float]) -> Iterator[Candidate]:
    """Yield the courses of a shape that are tried first in a window.

    Parameters
    ----------
    begins_s : where a step and a ramp begin, about which a lag is tried.
    """
    every_s, coarse_s = (np.arange(window[0] + MARGIN_S, window[1], by_s).tolist() for by_s in (FINER_S[0], COARSE_S))
    if shape == "bias":
        sharp_s = (*every_s, *np.arange(*finding.onset_ci95, FINER_S[2]).tolist())  # as where it was found
        yield from ((shape, drawn_out_s, at_s) for drawn_out_s in DRAWN_OUT_S for at_s in sharp_s)
    elif shape == "drift":
        yield from ((shape, None, at_s) for at_s in every_s)
    elif shape == "ramp_hold":
        yield from ((shape, end_s - at_s, at_s) for at_s in coarse_s for end_s in coarse_s)
    else:
        yield from ((shape, lag_s, at_s) for at_s in np.add.outer(begins_s, ABOUT_S).flat for lag_s in LAGS_S)


def _about(candidate: Candidate, step_s: float) -> Iterator[Candidate]:
    """Yield courses that begin, and end or lag, some steps before and after another."""
    shape, constant_s, onset_s = candidate
    about_s = (step_s * np.arange(-SPREAD, SPREAD + 1)).tolist()
    if shape in HELD and constant_s is not None:
        yield from ((shape, constant_s + later_s - by_s, onset_s + by_s) for by_s in about_s for later_s in about_s)
    else:
        constants = DRAWN_OUT_S if shape == "bias" else (None,)
        yield from ((shape, constant, onset_s + by_s) for constant in constants for by_s in about_s)


def _averaged(candidate: Candidate, time_s: FloatArray) -> FloatArray:
    """Return the means of a course over blocks about times, (n,)."""
    shape, constant, onset_s = candidate
    since_s = time_s[:, None] + BLOCK_S * PARTS - onset_s
    if shape == "drift":
        return np.asarray(np.maximum(since_s, 0.0).mean(axis=1))
    if shape == "bias":
        # A sample at the onset itself has the whole step.
        return np.asarray(special.ndtr((since_s + ROUNDING_S) / (constant or SHARP_S)).mean(axis=1))
    if shape == "lagged_bias":
        return np.asarray(-np.expm1(-np.maximum(since_s, 0.0) / (constant or 1.0)).mean(axis=1))
    return np.asarray(np.clip(since_s / (constant or 1.0), 0.0, 1.0).mean(axis=1))


def with_onset_of_samples(series: RelationSeries, finding: Finding, log: FlightLog) -> Finding:
    """Return a step with the onset, and its interval, that the samples of its relation show.

    A step beside a line is sought about where means of a second show it, behind the recorder's low-pass, and behind a
    further one. Slow noise makes fewer samples independent. What a sample is the first to show, or a value that is
    held, may have begun at any time since the one before, and half a sample later behind a filter of samples.

    Parameters
    ----------
    log : of which the relation was made.
    """
    first_s, last_s = finding.onset_ci95[0] - BLOCK_S, finding.onset_ci95[1] + BLOCK_S
    about = slice(*np.searchsorted(log.time_s, (first_s - MARGIN_S, last_s + MARGIN_S)).tolist())
    values = series.relation.of({name: log.channels[name].between(about) for name in series.relation.needs})
    known = np.isfinite(values)
    time_s, y = log.time_s[about][known], values[known]
    beside = min(np.count_nonzero(time_s < first_s), np.count_nonzero(time_s > last_s))
    if finding.shape != "bias" or beside < FEWEST_BESIDE:
        return finding
    onsets_s = np.arange(first_s, last_s, max(1.0 / (FINE * log.rate_hz), FINER_S[-1]))
    y, rest, squares = beside_line(y, time_s), y, np.full(onsets_s.size, np.inf)
    for response in _drawn_out(log):
        lag_s = (np.arange(len(response.taps)) - response.before) / (FINE * log.rate_hz)
        steps = np.concatenate([[0.0], np.cumsum(response.taps)])
        after = np.searchsorted(lag_s, time_s[:, None] - onsets_s + ROUNDING_S, side="right")
        courses = beside_line(steps[after], time_s)
        left, sizes = squares_by_onset(y, courses)
        k = int(np.argmin(left))
        if left[k] < squares.min():
            rest = y - sizes[k] * courses[:, k]
        squares = np.minimum(squares, left)
    if np.argmin(squares) in (0, onsets_s.size - 1):  # no step is there that the samples show
        return finding
    alike = autocorrelation(rest, min(int(MARGIN_S * log.rate_hz), rest.size - 2))
    alike = alike[: np.argmax(np.append(alike, -1.0) <= 0.0)]
    near = as_good(
        squares + max(0.0, rest.size * series.noise_sd**2 - float(squares.min())),
        rest.size,
        (1.0 + 2.0 * float(alike.sum())) * SHARP_CHANGE / CHI_SQUARE_95,
    )
    own_hz = [held_hz(log, log.channels[name]) or log.rate_hz for name in finding.among if name in series.effects]
    first_s, last_s = float(onsets_s[near[0]]) - 1.0 / min(own_hz), float(onsets_s[near[-1]]) + 0.5 / log.rate_hz
    return replace(finding, onset_s=float(onsets_s[np.argmin(squares)]), onset_ci95=(first_s, last_s))


def _drawn_out(log: FlightLog) -> list[Response]:
    """Return what may draw a step out, at `FINE` times the rate of a log: the recorder, and further low-passes."""
    rate_hz = FINE * log.rate_hz
    recorder = response_of(recorder_filters(log)[0], rate_hz)
    others = [low_pass(kind, edge_hz, rate_hz) for kind in DRAWN_OUT_BY for edge_hz in DRAWN_OUT_HZ]
    return [recorder, *(recorder.then(other) for other in others)]
