"""Which fault explains a window that the scan declares: its names, course, onset and magnitude."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...faults.shapes import SHAPES
from ...kernels import CHI_SQUARE_95, FloatArray
from ...kernels.likelihood_ratio import likelihood_ratio
from .record import STATIC_LEAK, Hypothesis, Record, hypotheses, without_fault
from .scan import FIRST_ONSET_S, WindowScan, fault_signatures, residual_values

Course = Callable[[FloatArray], FloatArray]

# Twice a log-likelihood ratio, so dispersed, by which a fault may explain a window worse and still be the one: so much,
# or that share of the best; but none that explains less than half. Tried on those flights with a drift of the airspeed
# where nothing but `tas` tells it: it keeps the truth in 95 % of the sets; 10 makes half of them sets of three.
CLOSE, CLOSE_SHARE = 5.0, 0.03
FITTED_WITHIN = 5.0  # times that, by a linear look at every course, of the best: what is fitted again
LEAST_SHARE = 0.5  # of the best, below which nothing explains a window
REFINED = 0.25  # of the window, to both sides of the onset that a linear look finds, in steps of a second
# STEPS, CONVERGED: Gauss-Newton steps, and the share of its sd by which the last may move the magnitude: a loss of a
# tenth of the impact pressure takes three, one of six tenths six.
STEPS, CONVERGED = 12, 0.02
# The commoner of faults that explain a window as well comes first, by odds of ten to one a step: what probes and lines
# lose to ice, water and leaks, which grows; then a vane that drifts, for vanes stick or bend at once, a line that gains
# pressure, and a static line that leaks; then an inertial sensor or the satellite receiver. A commoner fault that is
# near with these odds only is the last of the set: of 15 drifts of an only airspeed an accelerometer explained 3 better
# by 8 to 15.
INERTIAL = ("pitch", "normal_acc", "longitudinal_acc", "altitude_rate", "ground_speed")
RARER = 4.6  # 2 ln 10
# What another course than a ramp must gain: it was chosen from several (2 ln 4.5; chosen by hand, not tuned). Of these
# so many are fitted, the best by a linear look.
PRICE, TRIED = 3.0, 3
# Between the onsets at which a step is fitted, s: of a second within which it begins the mean shows a part of it.
STEP_S = 0.25
# TAILS: factor on the sd of magnitude and onset: 95 % of the magnitudes of twelve trials on those flights lie within
# 1.9 to 3.2 of them, in the median 2.6, where a normal distribution has 1.96.
TAILS = 1.3


def course_for(shape: str, constant_s: float | None) -> Course | None:
    """Return the course of magnitude 1 of a shape, of the seconds since the onset; None for one that is not fitted."""
    entry = SHAPES.get(shape)
    course = None if entry is None or (constant_s is None and entry.parameter is not None) else entry.course
    return None if course is None else lambda t: course(t, constant_s or 0.0)


# Shapes with their constants in s, where they have one, from which the best fit starts.
COURSES: tuple[tuple[str, float | None], ...] = (
    ("drift", None),
    ("bias", None),
    *(("lagged_bias", seconds) for seconds in (3.0, 6.0, 12.0, 24.0)),
    *(("ramp_hold", seconds) for seconds in (10.0, 20.0, 40.0, 80.0, 160.0)),
)
# FINER: ratios of a constant from one that is tried to the next, while that explains the window better.
FINER = (1.2, 1.05)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaultByOnset:
    """A fault of one course, by onset.

    Attributes
    ----------
    constant_s : of the course, where it has one.
    onsets_s, ratios, magnitudes, sds : (n_onsets,); the ratio is twice the log-likelihood ratio.
    parts : by residual, of the best ratio.
    besides : (n_besides, 4) onsets, ratios, magnitudes and standard deviations of the same shape with other constants.
    rivals : (n_rivals, 2) onsets and ratios of other shapes.
    """

    fault: Hypothesis
    shape: str
    constant_s: float | None
    onsets_s: FloatArray
    ratios: FloatArray
    magnitudes: FloatArray
    sds: FloatArray
    parts: Mapping[str, float]
    besides: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    rivals: FloatArray = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def best(self) -> int:
        """Index of the onset that suits it best."""
        return int(np.argmax(self.ratios))

    @property
    def ratio(self) -> float:
        return float(self.ratios[self.best])

    @property
    def onset_s(self) -> float:
        return float(self.onsets_s[self.best])

    @property
    def magnitude(self) -> float:
        return float(self.magnitudes[self.best])

    @property
    def alike(self) -> FloatArray:
        """Onsets, ratios, magnitudes and standard deviations, (n, 4), by onset and constant, where there are any."""
        rows = np.vstack([np.column_stack([self.onsets_s, self.ratios, self.magnitudes, self.sds]), self.besides])
        return np.asarray(rows[np.isfinite(rows).all(axis=1)])

    @property
    def sd(self) -> float:
        """Standard deviation of the magnitude over the onsets and constants that may be true, by likelihood."""
        _, ratios, magnitudes, sds = self.alike.T
        if not ratios.size:
            return np.inf
        share = np.exp(0.5 * (ratios - ratios.max()))
        squares = sds**2 + (magnitudes - self.magnitude) ** 2
        return TAILS * float(np.sqrt(share @ squares / share.sum()))

    @property
    def onset_ci95(self) -> tuple[float, float]:
        """The onsets that explain the window about as well, of whatever shape, half a step wider."""
        mine = np.column_stack([self.onsets_s, self.ratios])
        onsets_s, ratios = np.vstack([mine, self.besides[:, :2], self.rivals]).T
        near = onsets_s[ratios >= self.ratio - CHI_SQUARE_95 * TAILS**2]
        step = float(self.onsets_s[1] - self.onsets_s[0]) if len(self.onsets_s) > 1 else 1.0
        return float(near.min()) - 0.5 * step, float(near.max()) + 0.5 * step

    def amount(self, time_s: FloatArray) -> FloatArray:
        """Return the error over time, in the unit of the hypothesis."""
        return self.magnitude * _course(self.shape, self.constant_s)(time_s - self.onset_s)


def explain(scan: WindowScan, record: Record, *, ruled_out: Collection[str] = ()) -> tuple[FaultByOnset, ...]:
    """Return the faults that explain a window about as well as the best of them, the likeliest first.

    Every fault is fitted again about the record that is corrected for it, since a loss of a tenth of the impact
    pressure is no small change. Each has the course that suits it best.

    Parameters
    ----------
    ruled_out : faults that other relations of the log contradict; one is kept where nothing else explains the window.
    """
    looks = {
        hypothesis: _linear_looks(scan, record, hypothesis)
        for hypothesis in hypotheses(record)
        if hypothesis.fault in scan.faults
    }
    nearest = {hypothesis: max(ratio for ratio, _, _ in by_course) for hypothesis, by_course in looks.items()}
    best = max(nearest.values())
    least = best - FITTED_WITHIN * max(CLOSE, CLOSE_SHARE * best)
    contenders = [hypothesis for hypothesis, ratio in nearest.items() if ratio >= least]
    # Where none of those that may be is a candidate after all, those that are ruled out are, then the others.
    for group in (
        [hypothesis for hypothesis in contenders if hypothesis.fault not in ruled_out],
        contenders,
        list(looks),
    ):
        fits = [_best_course(scan, record, hypothesis, looks[hypothesis]) for hypothesis in group]
        if any(np.isfinite(fit.ratio) for fit in fits):
            break
    fits.sort(key=lambda fit: -fit.ratio)
    close = min(max(CLOSE, CLOSE_SHARE * fits[0].ratio), LEAST_SHARE * max(fits[0].ratio, 0.0))
    likeliest = max(_with_odds(fit) for fit in fits)
    kept = [fit for fit in fits if fit.ratio >= fits[0].ratio - close or _with_odds(fit) >= likeliest - close]
    ranked = sorted(kept, key=lambda fit: (fit.ratio < fits[0].ratio - close, -_with_odds(fit)))
    return tuple(_with_best_constant(scan, record, fit) for fit in ranked)


def _with_odds(fit: FaultByOnset) -> float:
    """Return the ratio less what its fault is rarer than ice in a probe."""
    fault = fit.fault.fault
    vane_drifts = fault == "aoa" and fit.shape != "bias"
    line_gains = fault == "q_impact" and fit.magnitude > 0.0
    steps = 2 if fault in INERTIAL else int(fault == STATIC_LEAK or vane_drifts or line_gains)
    return fit.ratio - RARER * steps


def corrected(record: Record, fit: FaultByOnset) -> Record:
    """Return a record as it would be without a fault."""
    return without_fault(record, fit.fault.fault, fit.amount(record.time_s))


def effects(record: Record, fit: FaultByOnset) -> dict[str, float]:
    """Return by channel the largest error of a fault in a record."""
    clean = corrected(record, fit)
    errors = {name: values - clean.channels[name] for name, values in record.channels.items()}
    wrong = {name: error for name, error in errors.items() if np.any(np.nan_to_num(error))}
    return {name: float(error[np.nanargmax(np.abs(error))]) for name, error in wrong.items()}


Look = tuple[float, float, tuple[str, float | None]]  # ratio, onset in s, course


def _linear_looks(
    scan: WindowScan, record: Record, hypothesis: Hypothesis, courses: Sequence[tuple[str, float | None]] = COURSES
) -> list[Look]:
    """Return by course the largest ratio of a small fault over the onsets of the scan, and where it is."""
    since_s = record.time_s[:, None] - scan.onsets_s[None, :]
    every = np.hstack([_course(*course)(since_s) for course in courses])
    small = likelihood_ratio(scan.residuals, _signatures(scan, record, hypothesis, every))
    ratios = (scan.weights @ small.parts(small.magnitude)).reshape(len(courses), -1)
    best = np.argmax(ratios, axis=1)
    return [(float(ratios[k, best[k]]), float(scan.onsets_s[best[k]]), course) for k, course in enumerate(courses)]


def _best_course(scan: WindowScan, record: Record, hypothesis: Hypothesis, looks: Sequence[Look]) -> FaultByOnset:
    """Return the fit of the course that suits a fault best, of a ramp and those nearest by a linear look.

    A static line that leaks goes to the pressure of what it leaks to, with a lag.
    """
    leaks = hypothesis.fault == STATIC_LEAK
    first = [] if leaks else list(looks[:1])
    others = sorted((look for look in looks[1:] if not leaks or look[2][0] == "lagged_bias"), key=lambda look: -look[0])
    # A look at whole seconds does not see all of a step.
    tried = [*others[:TRIED], *(look for look in others[TRIED:] if look[2][0] == "bias")]
    fits = [fit_course(scan, record, hypothesis, *course, near_s=near_s) for _, near_s, course in (*first, *tried)]
    best = max(fits[len(first) :], key=lambda fit: fit.ratio)
    best = best if not first or best.ratio > fits[0].ratio + PRICE else fits[0]
    rivals = [np.column_stack([fit.onsets_s, fit.ratios]) for fit in fits if fit.shape != best.shape]
    return replace(best, rivals=np.vstack([best.rivals, *rivals]))


def _with_best_constant(scan: WindowScan, record: Record, fit: FaultByOnset) -> FaultByOnset:
    """Return a fit with the time constant or duration that suits it best, beside those that were tried."""
    if fit.constant_s is None:
        return fit
    best, besides = fit, []
    for ratio in (step**sign for step in FINER for sign in (1.0, -1.0)):
        while FIRST_ONSET_S / 10.0 <= (constant := ratio * (best.constant_s or 0.0)) <= scan.length_s:
            tried = fit_course(scan, record, fit.fault, fit.shape, constant, near_s=best.onset_s)
            besides.append(min(tried, best, key=lambda other: other.ratio).alike)
            if tried.ratio <= best.ratio:
                break
            best = tried
    return replace(best, besides=np.vstack([np.empty((0, 4)), *besides]))


def _course(shape: str, constant_s: float | None) -> Course:
    course = course_for(shape, constant_s)
    assert course is not None
    return course


def fit_course(
    scan: WindowScan,
    record: Record,
    hypothesis: Hypothesis,
    shape: str,
    constant: float | None,
    *,
    near_s: float | None = None,
) -> FaultByOnset:
    """Return a fault of one course, fitted by Gauss-Newton steps at the onsets about `near_s`.

    One that leaves what the equations of air data hold for has ratios of minus infinity.

    Parameters
    ----------
    near_s : s on the log's axis; None for the onset that a linear look finds the best.
    """
    if near_s is None:
        ((_, near_s, _),) = _linear_looks(scan, record, hypothesis, [(shape, constant)])
    first, last = float(scan.onsets_s[0]), float(scan.onsets_s[-1])
    weights = scan.weights
    # By whole steps from there, also where the window ends the stretch.
    reach_s = np.floor(REFINED * scan.length_s)
    before_s, after_s = min(reach_s, np.floor(near_s - first)), min(reach_s, np.floor(last - near_s))
    step_s = STEP_S if shape == "bias" else 1.0
    onsets_s = near_s + np.arange(-before_s, after_s + step_s, step_s)
    since_s = record.time_s[:, None] - onsets_s[None, :]
    courses = np.clip(since_s + 0.5, 0.0, 1.0) if shape == "bias" else _course(shape, constant)(since_s)
    recorded = [residual_values(record, record, scan.constants, kind) for kind in scan.kinds]
    k, magnitude = 0, 0.0
    for step in range(STEPS):
        amount = magnitude * courses[:, k]
        # A loss of the pressure that is taken out divides by what is left of it: its slope is steeper by as much.
        left_over = 1.0 + amount if hypothesis.fault == "q_impact" else np.ones(len(amount))
        try:
            clean = without_fault(record, hypothesis.fault, amount) if step else record
            signatures = _signatures(scan, clean, hypothesis, courses / left_over[:, None])
            cleaned = [residual_values(clean, record, scan.constants, kind) for kind in scan.kinds]
        except ValueError:
            # Without such a fault the record would leave the air that the equations hold for: it is no candidate.
            ratios, magnitudes = np.full(len(onsets_s), -np.inf), np.zeros(len(onsets_s))
            break
        residuals = []
        for j, residual in enumerate(scan.residuals):
            # A correction that takes all lift or airspeed away explains nothing by it.
            values = np.where(np.isfinite(cleaned[j]), cleaned[j], recorded[j])[scan.known[j]]
            y = residual.whitened(values + magnitude * signatures[j][:, k])
            cost = residual.cost + float(residual.values @ residual.values - y @ y)
            residuals.append(replace(residual, values=y, cost=cost))
        linear = likelihood_ratio(residuals, signatures)
        magnitudes, sds = linear.weighted(weights)
        parts = weights[:, None] * linear.parts(magnitudes)
        ratios = parts.sum(axis=0)
        before_k, before_magnitude = k, magnitude
        k = int(np.argmax(ratios))
        magnitude = _bounded(hypothesis, float(magnitudes[k]), courses[:, k])
        if k == before_k and abs(magnitude - before_magnitude) < CONVERGED * sds[k]:
            break
    return FaultByOnset(
        fault=hypothesis,
        shape=shape,
        constant_s=constant,
        onsets_s=onsets_s,
        ratios=ratios,
        magnitudes=magnitudes,
        sds=sds,
        parts={kind.name: float(part) for kind, part in zip(scan.kinds, parts[:, k], strict=True)},
    )


def _signatures(scan: WindowScan, record: Record, hypothesis: Hypothesis, courses: FloatArray) -> list[FloatArray]:
    """Return by residual (n, n_courses) what a fault makes of it, 0 of one that it leaves alone."""
    every = fault_signatures(scan, record, [hypothesis], courses)
    return [values.sum(axis=1) for _, values in every]


def _bounded(hypothesis: Hypothesis, magnitude: float, course: FloatArray) -> float:
    """Return a magnitude that leaves some of a pressure: the linear one may take more than there is."""
    largest = float(np.max(np.abs(course), initial=0.0))
    if hypothesis.fault != "q_impact" or magnitude * largest > -0.9:
        return magnitude
    return -0.9 / largest
