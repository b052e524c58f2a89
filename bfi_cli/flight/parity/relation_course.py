"""The course of a channel's error in a static relation: its onset to a tenth of a second, and where it stops growing.

`find_static` looks for steps and ramps at whole seconds. A step within a second moves the mean of that second by a part
only, and noise that hardly changes from one second to the next is scanned by that one; a ramp that stops, and what
lags, are neither.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ...faults.shapes import SHAPES
from ...kernels import FloatArray
from ...kernels.compiled import special
from .explain import PRICE
from .finding import CHI_SQUARE, Finding
from .static_relations import AVERAGED, BLOCK_S, MARGIN_S, RelationSeries

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

    every_s, coarse_s = (np.arange(from_s + MARGIN_S, to_s, by_s).tolist() for by_s in (FINER_S[0], COARSE_S))
    for shape in ("bias", "drift", "ramp_hold", "lagged_bias"):
        if shape == "bias":
            sharp_s = (*every_s, *np.arange(*finding.onset_ci95, FINER_S[2]).tolist())  # as where it was found
            scan((shape, drawn_out_s, at_s) for drawn_out_s in DRAWN_OUT_S for at_s in sharp_s)
        elif shape == "drift":
            scan((shape, None, at_s) for at_s in every_s)
        elif shape == "ramp_hold":
            scan((shape, end_s - at_s, at_s) for at_s in coarse_s for end_s in coarse_s)
        else:
            begins_s = [course[2] for course in (best_of("bias"), best_of("ramp_hold")) if course is not None]
            scan((shape, lag_s, at_s) for at_s in np.add.outer(begins_s, ABOUT_S).flat for lag_s in LAGS_S)
        for step_s in FINER_S:
            if (likeliest := best_of(shape)) is not None:
                scan(_about(likeliest, step_s))
    names, (statistic, magnitude, sd) = list(scanned), np.array([*scanned.values()]).T
    best = int(np.argmax(statistic - [PRICE if shape in HELD else 0.0 for shape, _, _ in names]))
    shape, constant, onset_s = names[best]
    same = np.array([course[0] == shape for course in names]) & np.isfinite(sd)
    if not same[best]:
        return finding
    share = np.exp(0.5 * (statistic[same] - statistic[best]))
    squares = sd[same] ** 2 + (magnitude[same] - magnitude[best]) ** 2
    reached = float(np.max(np.abs(_averaged(names[best], time_s))))
    steps = AVERAGED * series.noise_sd / (float(np.median(np.abs(effect))) * reached)
    near_s = np.array([course[2] for course in names])[same & (statistic >= statistic[best] - CHI_SQUARE)]
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
