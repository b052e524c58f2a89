"""Which fault explains a window that the scan declares: its names, course, onset and magnitude."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.likelihood_ratio import likelihood_ratio
from .record import STATIC_LEAK, Hypothesis, Record, hypotheses, without_fault
from .scan import FIRST_ONSET_S, LAST_ONSET_S, WindowScan, fault_signatures, residual_values

__all__ = ["COURSES", "Fit", "corrected", "effects", "explain"]

FloatArray = NDArray[np.float64]
Course = Callable[[FloatArray], FloatArray]

# Standard deviation of what healthy windows of 120 s show of a ramp in each residual, in those of its noise model, and
# how it grows with the length: gusts, turns and changes of trim are no stationary noise. Root mean squares over 190
# windows of 60 to 240 s of two flights of a Cessna Citation, which agree within a fifth (docs/theory.md, 15.7).
DISPERSION, DISPERSION_GROWTH = {"lift": 1.9, "climb": 2.1, "kinematics": 1.3, "ground_speed": 2.8}, 0.3
# Twice a log-likelihood ratio, so dispersed, by which a fault may explain a window worse and still be the one: so much,
# or that share of the best; but none that explains less than half. Tried on those flights with a drift of the airspeed
# where nothing but `tas` tells it: it keeps the truth in 95 % of the sets; 10 makes half of them sets of three.
CLOSE, CLOSE_SHARE = 5.0, 0.03
FITTED_WITHIN = 5.0  # times that, by the linear look, of the best: what is fitted again
REFINED = 0.25  # of the window, to both sides of the onset that a linear look finds, in steps of a second
# Of Gauss-Newton, which end where one moves the magnitude by less than this part of its standard deviation: a loss of a
# tenth of the impact pressure takes three, one of six tenths six.
STEPS, CONVERGED = 12, 0.02
# Of faults that explain a window as well, the commoner comes first, by odds of ten to one a step: what probes and lines
# lose to ice, water and leaks, which grows; then a vane that drifts, for vanes stick or bend at once, a line that gains
# pressure, and a static line that leaks; then an inertial sensor or the satellite receiver. A commoner fault that is
# near with these odds only is the last of the set: of 15 drifts of an only airspeed an accelerometer explained 3 better
# by 8 to 15.
INERTIAL = ("pitch", "normal_acc", "longitudinal_acc", "altitude_rate", "ground_speed")
RARER = 4.6  # 2 ln 10
# What another course than a ramp must gain: it was chosen from several.
PRICE = 3.0  # 2 ln 4.5: from one of eight courses; chosen by hand, not tuned
CHI_SQUARE_95 = 3.84  # with one degree of freedom
# Of the standard deviations of magnitude and onset: 95 % of the magnitudes of twelve trials on those flights lie within
# 1.9 to 3.2 of them, in the median 2.6, where a normal distribution has 1.96.
TAILS = 1.3


def _lag(seconds: float) -> Course:
    return lambda t: -np.expm1(-np.maximum(t, 0.0) / seconds)


def _hold(seconds: float) -> Course:
    return lambda t: np.clip(t / seconds, 0.0, 1.0)


# By shape, with its constant in s where it has one: the course of magnitude 1, of the seconds since the onset.
COURSES: Mapping[tuple[str, float | None], Course] = {
    ("drift", None): lambda t: np.maximum(t, 0.0),
    ("bias", None): lambda t: np.clip(t + 0.5, 0.0, 1.0),  # of a sample, the part after the onset
    **{("lagged_bias", seconds): _lag(seconds) for seconds in (3.0, 6.0, 12.0, 24.0, 48.0, 96.0)},
    **{("ramp_hold", seconds): _hold(seconds) for seconds in (10.0, 20.0, 40.0)},
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A fault of one course, by onset.

    Attributes
    ----------
    constant_s : of the course, where it has one.
    onsets_s, ratios, magnitudes, sds : (n_onsets,); the ratio is twice the log-likelihood ratio.
    parts : by residual, of the best ratio.
    """

    fault: Hypothesis
    shape: str
    constant_s: float | None
    onsets_s: FloatArray
    ratios: FloatArray
    magnitudes: FloatArray
    sds: FloatArray
    parts: Mapping[str, float]

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
    def sd(self) -> float:
        return TAILS * float(self.sds[self.best])

    @property
    def onset_ci95(self) -> tuple[float, float]:
        """The onsets that explain the window about as well, half a step wider."""
        near = self.onsets_s[self.ratios >= self.ratio - CHI_SQUARE_95 * TAILS**2]
        step = float(self.onsets_s[1] - self.onsets_s[0]) if len(self.onsets_s) > 1 else 1.0
        return float(near.min()) - 0.5 * step, float(near.max()) + 0.5 * step

    def amount(self, time_s: FloatArray) -> FloatArray:
        """Return the error over time, in the unit of the hypothesis."""
        return self.magnitude * COURSES[self.shape, self.constant_s](time_s - self.onset_s)


def explain(scan: WindowScan, record: Record, *, ruled_out: Collection[str] = ()) -> tuple[Fit, ...]:
    """Return the faults that explain a window about as well as the best of them, the likeliest first.

    Every fault is fitted again about the record that is corrected for it, since a loss of a tenth of the impact
    pressure is no small change. Each has the course that suits it best.

    Parameters
    ----------
    ruled_out : faults that other relations of the log contradict; one is kept where nothing else explains the window.
    """
    weights = _weights(scan)
    linear = {name: float((weights @ one.parts).max()) for name, one in scan.ratios.items()}
    best = max(linear.values())
    contenders = [
        one
        for one in hypotheses(record)
        if linear.get(one.fault, -np.inf) >= best - FITTED_WITHIN * max(CLOSE, CLOSE_SHARE * best)
    ]
    fits = [_best_course(scan, record, one) for one in contenders if one.fault not in ruled_out]
    if not fits:
        fits = [_best_course(scan, record, one) for one in contenders]
    fits.sort(key=lambda fit: -fit.ratio)
    close = min(max(CLOSE, CLOSE_SHARE * fits[0].ratio), 0.5 * max(fits[0].ratio, 0.0))
    likeliest = max(_with_odds(fit) for fit in fits)
    kept = [fit for fit in fits if fit.ratio >= fits[0].ratio - close or _with_odds(fit) >= likeliest - close]
    return tuple(sorted(kept, key=lambda fit: (fit.ratio < fits[0].ratio - close, -_with_odds(fit))))


def _with_odds(fit: Fit) -> float:
    """Return the ratio less what its fault is rarer than the commonest."""
    return fit.ratio - RARER * _rarity(fit)


def _rarity(fit: Fit) -> int:
    """Return how many steps rarer a fault is than ice in a probe."""
    if fit.fault.fault in INERTIAL:
        return 2
    vane_drifts = fit.fault.fault == "aoa" and fit.shape != "bias"
    if fit.fault.fault == STATIC_LEAK:
        return 1
    line_gains = fit.fault.fault == "q_impact" and fit.magnitude > 0.0
    return int(vane_drifts or line_gains)


def corrected(record: Record, fit: Fit) -> Record:
    """Return a record as it would be without a fault."""
    return without_fault(record, fit.fault.fault, fit.amount(record.time_s))


def effects(record: Record, fit: Fit) -> dict[str, float]:
    """Return by channel the largest error of a fault in a record."""
    clean = corrected(record, fit)
    found = {}
    for name, values in record.channels.items():
        error = values - clean.channels[name]
        if np.any(np.nan_to_num(error)):
            found[name] = float(error[np.nanargmax(np.abs(error))])
    return found


def _weights(scan: WindowScan) -> FloatArray:
    """Return by residual what a log-likelihood is worth of what its noise model says."""
    growth = (_length_s(scan) / 120.0) ** DISPERSION_GROWTH
    return np.array([(growth * DISPERSION[kind.name]) ** -2.0 for kind in scan.kinds])


def _length_s(scan: WindowScan) -> float:
    return FIRST_ONSET_S + float(scan.onsets_s[-1] - scan.onsets_s[0]) + LAST_ONSET_S


def _best_course(scan: WindowScan, record: Record, hypothesis: Hypothesis) -> Fit:
    if hypothesis.fault == STATIC_LEAK:  # goes to the pressure of what it leaks to
        lags = [fit_course(scan, record, hypothesis, *key) for key in COURSES if key[0] == "lagged_bias"]
        best = max(lags, key=lambda fit: fit.ratio)
        # Time constants between those tried explain it as well as the neighbours, in some other size.
        near = [fit.magnitude for fit in lags if fit.ratio >= best.ratio - CHI_SQUARE_95 * TAILS**2]
        step = 0.25 * min((abs(fit.magnitude - best.magnitude) for fit in lags if fit is not best), default=0.0)
        return replace(best, sds=np.hypot(best.sds, max(np.ptp(near) / CHI_SQUARE_95**0.5, step)))
    ramp, *others = (fit_course(scan, record, hypothesis, shape, constant) for shape, constant in COURSES)
    other = max(others, key=lambda fit: fit.ratio)
    return other if other.ratio > ramp.ratio + PRICE else ramp


def fit_course(scan: WindowScan, record: Record, hypothesis: Hypothesis, shape: str, constant: float | None) -> Fit:
    """Return a fault of one course, fitted by Gauss-Newton steps at the onsets about the best of all."""
    first, last = float(scan.onsets_s[0]), float(scan.onsets_s[-1])
    coarse = COURSES[shape, constant](record.time_s[:, None] - scan.onsets_s[None, :])
    linear = likelihood_ratio(scan.residuals, fault_signatures(scan, record, hypothesis, coarse))
    weights = _weights(scan)
    near_s = float(scan.onsets_s[int(np.argmax(weights @ linear.parts))])
    # Whole seconds from there, also where the window ends the stretch.
    reach_s = np.floor(REFINED * _length_s(scan))
    before_s, after_s = min(reach_s, np.floor(near_s - first)), min(reach_s, np.floor(last - near_s))
    onsets_s = near_s + np.arange(-before_s, after_s + 1.0)
    courses = COURSES[shape, constant](record.time_s[:, None] - onsets_s[None, :])
    before = np.array([float(one.values @ one.values) for one in scan.residuals])
    costs = np.array([one.cost for one in scan.residuals])
    recorded = [
        residual_values(record, record, scan.constants, kind)[seen]
        for kind, seen in zip(scan.kinds, scan.known, strict=True)
    ]
    k, magnitude = 0, 0.0
    for step in range(STEPS):
        amount = magnitude * courses[:, k]
        clean = without_fault(record, hypothesis.fault, amount) if step else record
        shown, power, left = (np.zeros((len(scan.kinds), len(onsets_s))) for _ in range(3))
        # A loss of the pressure that is taken out divides by what is left of it: its slope is steeper by as much.
        left_over = 1.0 + amount if hypothesis.fault == "q_impact" else np.ones(len(amount))
        signatures = fault_signatures(scan, clean, hypothesis, courses / left_over[:, None])
        for j, (kind, seen) in enumerate(zip(scan.kinds, scan.known, strict=True)):
            residual, signature = scan.residuals[j], signatures[j]
            values = residual_values(clean, record, scan.constants, kind)[seen]
            # A correction that takes all lift or airspeed away explains nothing by it.
            y = residual.whitened(np.where(np.isfinite(values), values, recorded[j]))
            if signature is None:
                left[j] = float(y @ y)
                continue
            columns = residual.whitened(signature)
            y = y + magnitude * columns[:, k]
            shown[j], power[j], left[j] = columns.T @ y, np.einsum("ij,ij->j", columns, columns), float(y @ y)
        total = weights @ power
        seen_at = total > 0.0
        magnitudes = np.where(seen_at, (weights @ shown) / np.where(seen_at, total, 1.0), 0.0)
        left = left - 2.0 * magnitudes * shown + magnitudes**2 * power
        parts = weights[:, None] * (costs[:, None] + before[:, None] - left)
        ratios = parts.sum(axis=0)
        before_k, before_magnitude = k, magnitude
        k = int(np.argmax(ratios))
        magnitude = _bounded(hypothesis, float(magnitudes[k]), courses[:, k])
        if k == before_k and abs(magnitude - before_magnitude) ** 2 * total[k] < CONVERGED**2:
            break
    return Fit(
        fault=hypothesis,
        shape=shape,
        constant_s=constant,
        onsets_s=onsets_s,
        ratios=ratios,
        magnitudes=magnitudes,
        sds=np.where(seen_at, 1.0 / np.sqrt(np.where(seen_at, total, 1.0)), np.inf),
        parts={kind.name: float(part) for kind, part in zip(scan.kinds, parts[:, k], strict=True)},
    )


def _bounded(hypothesis: Hypothesis, magnitude: float, course: FloatArray) -> float:
    """Return a magnitude that leaves some of a pressure: the linear one may take more than there is."""
    largest = float(np.max(np.abs(course), initial=0.0))
    if hypothesis.fault != "q_impact" or magnitude * largest > -0.9:
        return magnitude
    return -0.9 / largest
