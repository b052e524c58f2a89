"""Magnitudes in SI units, whose variances include what a single model does not know (docs/theory.md, 5.2).

That is the spread between orders of the model, between a model whose roots are free and one that holds a root at 1, and
between two rates; and how much a magnitude varies beyond what white prediction errors explain, the overdispersion:
gusts, thrust changes and nonlinear dynamics let a slow shape explain the prediction error at any onset better than
white noise would. The mean over onsets of z^2 / var(z) is 1 for white noise; where it is more, variances and thresholds
are multiplied by it, as in quasi-likelihood (McCullagh and Nelder 1989).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...config import Config
from ...errors import LogError
from ...faults import Fault
from ...kernels import ONE_SIDED_90, FloatArray
from ...kernels.compiled import special
from ...kernels.covariance import Regressors, covariance, regressors_of_support, single_additions, unfold
from ...kernels.model_selection import Penalty, least_criterion
from ...kernels.progress import Report, parts, shares, silent
from ...kernels.variable_projection import Fit, fit_magnitudes, log_dets_beside, single_magnitudes, with_unit_root
from .regression import RegressionData, build_regression, fault_free_fits
from .signals import decimate_native
from .window import PreparedWindow, regression_of, shifts_within, signals_of_faults, with_onsets

CONFIDENCE = 0.95  # of intervals
CLOSE = 20.0  # orders whose criterion is further from the best weigh less than exp(-10) and are not worth their time
RATE_WEIGHT = 0.5  # of the squared change between two rates, half is the variance of either
# Twice the log likelihood ratio against a root at 1 from which on the model without it counts more: what 5 % of the
# records that have the root and a slow fault exceed in a simulation, 11 to 12 without an input, 13 to 20 with one to
# three that wander (docs/theory.md, 5.2; Perron 1989 for records whose trend breaks). Half of them exceed 4 to 7: the
# logarithm of the number of rows, the price of a parameter in BIC, would rule a root out that is there.
UNIT_ROOT = 16.0
# LARGEST_EXPONENT: largest that double precision holds; evidence may be asked for that no fault can show.
LARGEST_EXPONENT = 500.0
# Factors on a minimal detectable magnitude at which the profile is asked, until it would be declared; and for how many
# entries that is done at most, since it takes some fits for each.
MULTIPLES = (1.0, 1.2, 1.5, 1.9, 2.4, 3.0, 4.0, 6.0, 10.0)
MOST_PROFILED = 40
# Neighbouring onsets say much the same: 33 of them in a window of 30 to 120 s are 1 to 3 s apart. The first and the
# last tenth are left out, where a fault acts on the lags alone or on too few samples.
N_ONSETS = 33
INSIDE = (0.1, 0.9)
# MOST_VALUES: values of the signals that are added at once, where they are not in stretches, for memory.
MOST_VALUES = 4 * 10**6
# Entries for which it is asked what the factor would be, were they declared: it takes a fit for each.
MOST_DECLARED = 40


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagnitudeEstimates:
    """Magnitudes of all live atoms in SI: of a declared atom its estimate, of another that of the atom added alone.

    They are NaN where the method does not estimate them.

    Attributes
    ----------
    value, variance, minimal_detectable : (n_live,).
    sampling : (n_live,) the part of the variance that is sampling error, at the best order, the overdispersion in it.
    covariance : (n_declared, n_declared).
    degrees : of freedom of the intervals, NaN where there are none.
    """

    value: FloatArray
    variance: FloatArray
    sampling: FloatArray
    minimal_detectable: FloatArray
    covariance: FloatArray
    degrees: float

    @classmethod
    def without_variances(cls, value: FloatArray, n_declared: int) -> MagnitudeEstimates:
        """Return magnitudes (n_live,) of which nothing else is known."""
        unknown = np.full(len(value), np.nan)
        return cls(
            value=value,
            variance=unknown,
            sampling=unknown,
            minimal_detectable=unknown,
            covariance=np.full((n_declared, n_declared), np.nan),
            degrees=np.nan,
        )

    @property
    def quantile(self) -> float:
        """How many standard deviations a 95 % interval reaches to each side."""
        return float(special.stdtrit(self.degrees, 0.5 + CONFIDENCE / 2.0))


def estimate_magnitudes(
    regression: RegressionData,
    fits: Sequence[Fit],
    penalty: Penalty,
    dispersion: FloatArray,
    coarse: RegressionData | None,
    report: Report = silent,
) -> MagnitudeEstimates:
    """Return the magnitudes of a support, averaged over models, with the spread to half the rate.

    Parameters
    ----------
    fits, penalty, dispersion : as in `averaged_magnitudes`.
    coarse : the regression at half the rate, None where there is none.
    report : receives the progress.
    """
    here, fitting, there = shares(report, 1, 1, 1)
    estimates = averaged_magnitudes(regression, fits, penalty, dispersion, report=here)
    if coarse is None:
        return estimates
    active = list(fits[0].atoms)
    coarse_penalty = replace(penalty, n_rows=coarse.n_rows, n_effective=float(coarse.n_rows))
    start = estimates.value[active] / coarse.magnitude_unit[active]
    scored = []
    for order, _ in parts(fitting, coarse.orders):
        scored.append(coarse_penalty.scored(coarse.fitted(order, active, start)))
    other = averaged_magnitudes(coarse, scored, coarse_penalty, dispersion, report=there)
    # What sampling does not explain of the change between the rates.
    excess = (other.value - estimates.value) ** 2 - np.maximum(estimates.variance, other.variance)
    variance = estimates.variance + RATE_WEIGHT * np.nan_to_num(np.maximum(excess, 0.0))
    wider = _widening(variance, estimates.variance)[active]
    estimates = replace(estimates, variance=variance, covariance=estimates.covariance * np.outer(wider, wider))
    return replace(estimates, minimal_detectable=_minimal_detectable(estimates, penalty, dispersion))


def averaged_magnitudes(
    regression: RegressionData,
    fits: Sequence[Fit],
    penalty: Penalty,
    overdispersion: FloatArray,
    *,
    unit_root: bool = True,
    report: Report = silent,
) -> MagnitudeEstimates:
    """Return the magnitudes at the best order, with the spread between models added to their variances.

    At each order the model is averaged with the one that holds a root at 1; orders are weighted by their criteria. The
    covariance of each model is multiplied by the overdispersion, and the evidence against the root divided by it.

    Parameters
    ----------
    fits : of one support at every order.
    penalty : the criterion they are scored by.
    overdispersion : (n_live,) see `overdispersion`.
    unit_root : average with the model that holds the root.
    report : receives the progress.
    """
    criteria = np.array([fit.criterion for fit in fits])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    best = int(np.argmin(criteria))
    keep = [n for n in range(len(fits)) if criteria[n] - criteria[best] < CLOSE]
    values, variances, covariances, sampling = {}, {}, {}, {}
    for n, _ in parts(report, keep):
        fit = fits[n]
        unfolded = unfold(regression.layout, fit)
        (z, variance), scaled = single_additions(fit, unfolded), covariance(fit, unfolded)
        active = list(fit.atoms)
        unit = regression.magnitude_unit
        z[active], variance[active] = fit.z, np.diag(scaled)
        sampling[n] = variance * overdispersion * unit**2
        wider = np.sqrt(overdispersion[active])
        if unit_root and fit.order > 1:
            free = variance[active]
            z, variance = _with_unit_root(regression, fit, z, variance, penalty, overdispersion)
            wider *= _widening(variance[active], free)
        values[n], variances[n] = z * unit, variance * overdispersion * unit**2
        covariances[n] = scaled * np.outer(wider * unit[active], wider * unit[active])
    value, cov = values[best], covariances[best]
    spread = np.array([variances[n] + (values[n] - value) ** 2 for n in keep])
    weight = weights[keep, None] * np.isfinite(spread)
    total = weight.sum(axis=0)
    variance = np.where(total > 0.0, np.nansum(weight * np.nan_to_num(spread), axis=0), np.nan)
    variance /= np.where(total > 0.0, total, 1.0)
    fit, n_outputs = fits[best], regression.layout.y.shape[1]
    wider = _widening(variance[list(fit.atoms)], np.diag(cov))
    estimates = MagnitudeEstimates(
        value=value,
        variance=variance,
        sampling=sampling[best],
        minimal_detectable=np.full(len(value), np.nan),
        covariance=cov * np.outer(wider, wider),
        degrees=max(penalty.n_effective - fit.n_parameters / n_outputs, 2.0),
    )
    return replace(estimates, minimal_detectable=_minimal_detectable(estimates, penalty, overdispersion))


def _widening(variance: FloatArray, before: FloatArray) -> FloatArray:
    """Return the factors on standard deviations whose variances were `before`; of a variance of 0, their root."""
    return np.asarray(np.sqrt(variance / np.where(before > 0.0, before, 1.0)))


def statistic_needed(penalty: Penalty, overdispersion: FloatArray) -> FloatArray:
    """Return (n_live,) the statistic over all rows from which on an atom passes criterion and overdispersion test."""
    return penalty.per_fault * overdispersion * penalty.n_rows / penalty.n_effective


def _minimal_detectable(estimates: MagnitudeEstimates, penalty: Penalty, overdispersion: FloatArray) -> FloatArray:
    """Return (n_live,) the magnitudes that are declared with 90 % power, by both tests that decide.

    1. The statistic must reach what criterion and overdispersion ask for; it is n log(1 + z^2 / (n var z)).
    2. The magnitude must exceed the half width of its interval, whose variance holds more than sampling errors.
    """
    n, correlated = penalty.n_rows, np.sqrt(penalty.n_rows / penalty.n_effective)
    white = np.sqrt(estimates.sampling / overdispersion)
    scatter = ONE_SIDED_90 * correlated * np.sqrt(estimates.sampling)
    needed = np.minimum(statistic_needed(penalty, overdispersion) / n, LARGEST_EXPONENT)
    by_statistic = white * np.sqrt(n * np.expm1(needed)) + scatter
    by_interval = estimates.quantile * np.sqrt(estimates.variance) + scatter
    return np.asarray(np.maximum(by_statistic, by_interval))


def profiled_limits(
    regression: RegressionData, fit: Fit, estimates: MagnitudeEstimates, penalty: Penalty, overdispersion: FloatArray
) -> FloatArray:
    """Return (n_live,) minimal detectable magnitudes by the likelihood profile, infinite where no multiple tried is
    enough; no smaller than those of `estimates`.

    A fault m added to the record and analysed without it leaves the likelihood that the record has at -m: that tells
    its statistic exactly, where a model that nearly integrates absorbs it (`kernels.onset.scan` does the same for
    the scan). The mean of both signs must reach what the criterion and 90 % power ask for.

    Parameters
    ----------
    fit : of the chosen support and order; entries of it keep their limits.
    """
    limits, rows = estimates.minimal_detectable.copy(), regression.n_rows
    if len(limits) > MOST_PROFILED:
        return limits
    problem = regression.problem(fit.order)
    fit = fit_magnitudes(problem, fit.atoms, fit.z)
    correlated = np.sqrt(penalty.n_rows / penalty.n_effective)
    roots = np.sqrt(statistic_needed(penalty, overdispersion)) + ONE_SIDED_90 * correlated * np.sqrt(overdispersion)
    left = np.setdiff1d(np.flatnonzero(np.isfinite(limits)), fit.atoms).astype(np.intp)
    below = np.zeros((2, len(limits)))  # multiple and root of the statistic: nearly a line between two of them
    for multiple in MULTIPLES:
        z = multiple * limits[left] / regression.magnitude_unit[left]
        falls = rows * (log_dets_beside(problem, left.tolist(), z, fit) - fit.log_det)
        root = np.sqrt(np.maximum(falls.mean(axis=1), 0.0))
        enough = root >= roots[left]
        done, (at, low) = left[enough], below[:, left[enough]]
        limits[done] *= np.maximum(1.0, at + (roots[done] - low) / (root[enough] - low) * (multiple - at))
        left = left[~enough]
        below[0, left], below[1, left] = multiple, root[~enough]
    limits[left] = np.inf
    return limits


def limits_within_tolerance(
    window: PreparedWindow,
    regression: RegressionData,
    config: Config,
    fits: Sequence[Fit],
    penalty: Penalty,
    overdispersion: FloatArray,
    coarse: RegressionData | None,
    report: Report = silent,
) -> FloatArray:
    """Return (n_live,) minimal detectable magnitudes for onsets as well as they are known, NaN where these are exact.

    An entry that begins otherwise than the dictionary states is found by the search of its onset
    (`model.selection`), whose price it pays; the worst of the ends of the tolerance counts.

    Parameters
    ----------
    fits : of the chosen support at every order; entries of it have none.
    coarse : the regression at half the rate, None where there is none.
    report : receives the progress.
    """
    best = least_criterion(fits)
    limits = np.full(len(window.live), np.nan)
    absent = {entry: n for n, entry in enumerate(window.live) if n not in best.atoms}
    shifts = {entry: shifts_within(window, entry, config.onset_tolerance_s) for entry in absent}

    def limits_at(moves: dict[int, float], report: Report) -> FloatArray:
        moving, sizing = shares(report, 1, 1)
        moved = with_onsets(window, moves)
        there = regression.with_dictionary(
            moved.signals.theta, regression.atoms, moving, slopes=moved.signals.slopes, same=best.atoms
        )
        charged = searched(penalty, max(shifts_s.size for shifts_s in shifts.values()))
        at_half = None
        if coarse is not None:
            native, rate = moved.native, (coarse.signals.factor, window.lowpass)
            theta, _ = native.theta_decimated(*rate)
            slopes = native.slopes_at(*rate)
            at_half = coarse.with_dictionary(theta, coarse.atoms, slopes=slopes, same=best.atoms)
        estimates = estimate_magnitudes(there, fits, charged, overdispersion, at_half, sizing)
        return profiled_limits(there, best, estimates, charged, overdispersion)

    for end, share in parts(report, (0, -1)):
        moves = {entry: float(shifts_s[end]) for entry, shifts_s in shifts.items() if shifts_s.size}
        if moves:
            moved = [absent[entry] for entry in moves]
            limits[moved] = np.fmax(limits[moved], limits_at(moves, share)[moved])
    return limits


def searched(penalty: Penalty, n_onsets: int) -> Penalty:
    """Return the penalty of an entry whose onset was chosen among `n_onsets` beside the stated one.

    Each onset counts as a candidate, and a fault at another time than stated needs as much evidence once more.
    Without that, 6 instead of 3 of 137 fault-free windows of two recorded flights raised an alarm, the elevator the
    only input.
    """
    return replace(penalty, evidence=2.0 * penalty.evidence + 2.0 * float(np.log(n_onsets + 1)))


def fault_free_limits(window: PreparedWindow, config: Config) -> tuple[FloatArray, FloatArray]:
    """Return (n_live,) the minimal detectable magnitudes of a window without a fault, for onsets as well as they are
    known and for the exact ones.

    `identify_faults` states the same where it declares nothing.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    regression = regression_of(window, config)
    scored, penalty = fault_free_fits(regression, config, len(window.live))
    best = least_criterion(scored)
    dispersion = overdispersion(window, regression, best)
    dispersion = overdispersion_if_declared(window, regression, best, dispersion)
    coarse = at_half_rate(window, regression, config)
    estimates = estimate_magnitudes(regression, scored, penalty, dispersion, coarse)
    exactly = profiled_limits(regression, best, estimates, penalty, dispersion)
    within = limits_within_tolerance(window, regression, config, scored, penalty, dispersion, coarse)
    return np.fmax(exactly, within), exactly


def _with_unit_root(
    regression: RegressionData,
    fit: Fit,
    z: FloatArray,
    variance: FloatArray,
    penalty: Penalty,
    overdispersion: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Average (n_live,) magnitudes and variances of a fit, scaled, with those of the same order with a root at 1."""
    n_outputs, problem = regression.layout.y.shape[1], with_unit_root(regression.problem(fit.order))
    held = regression.fitted(fit.order, fit.atoms, fit.z, unit_root=True)
    value, value_variance = single_magnitudes(problem, held, len(z))
    ratio = penalty.n_effective * (held.log_det - fit.log_det) / overdispersion
    weight = special.expit(0.5 * (n_outputs * UNIT_ROOT - ratio))
    weight = np.where(np.isfinite(value_variance), weight, 0.0)
    value, value_variance = np.where(weight > 0.0, value, z), np.where(weight > 0.0, value_variance, variance)
    mean = (1.0 - weight) * z + weight * value
    spread = (1.0 - weight) * (z - mean) ** 2 + weight * (value - mean) ** 2
    # The spread is no sampling error, so that the overdispersion does not act on it.
    return mean, (1.0 - weight) * variance + weight * value_variance + spread / overdispersion


def magnitudes_of_fit(regression: RegressionData, fit: Fit, penalty: Penalty) -> MagnitudeEstimates:
    """Return the magnitudes of one fit, nothing averaged."""
    dispersion = np.ones(len(regression.atoms))
    return averaged_magnitudes(regression, [penalty.scored(fit)], penalty, dispersion, unit_root=False)


def at_half_rate(
    window: PreparedWindow, regression: RegressionData, config: Config, report: Report = silent
) -> RegressionData | None:
    """Return the regression at half the rate; None where the record is exact, so nothing is to be learnt, or short."""
    if window.exact_at_rate:
        return None
    try:
        signals, _ = decimate_native(window.native, 2 * window.signals.factor, window.lowpass)
        return build_regression(signals, regression.atoms, config, orders=regression.orders, report=report)
    except LogError:
        return None


def overdispersion(window: PreparedWindow, regression: RegressionData, fit: Fit, report: Report = silent) -> FloatArray:
    """Return (n_live,) factors, at least 1: how much the variance of a magnitude exceeds that of white errors.

    Parameters
    ----------
    window : with the dictionary.
    regression : of the window; fit : the chosen one of it.
    report : receives the progress.
    """
    known = dict[Fault, float]()
    adding = regressors_of_support(regression.layout, fit)
    factors = np.ones(len(window.live))
    for (n, entry), _ in parts(report, list(enumerate(window.live))):
        family = _family(window.faults[entry])
        if family not in known:
            known[family] = _factor(window, regression, adding, family)
        factors[n] = known[family]
    return factors


def overdispersion_if_declared(
    window: PreparedWindow, regression: RegressionData, fit: Fit, dispersion: FloatArray
) -> FloatArray:
    """Return (n_live,) the factors that an entry would be tested by, were it declared: at least those of a fit.

    Beside a slow oscillation that is fitted, what its phase leaves stands out more than before. Dictionaries with many
    entries keep the factors of the fit.

    Parameters
    ----------
    fit, dispersion : of the chosen support, by `overdispersion`; entries of it keep theirs.
    """
    if len(dispersion) > MOST_DECLARED:
        return dispersion
    factors, problem = dispersion.copy(), regression.problem(fit.order)
    for n in (n for n in range(len(window.live)) if n not in fit.atoms):
        declared = fit_magnitudes(problem, (*fit.atoms, n), np.append(fit.z, 0.0))
        family = _family(window.faults[window.live[n]])
        factors[n] = max(
            factors[n], _factor(window, regression, regressors_of_support(regression.layout, declared), family)
        )
    return factors


def _family(fault: Fault) -> Fault:
    """Return the nameless fault of magnitude 1 at 0 s that stands for all which differ from it by their onset only."""
    return replace(fault.later(-fault.onset_s), name=None, magnitude=1.0)


def _elsewhere(window: PreparedWindow, family: Fault) -> Iterator[FloatArray]:
    """Yield the signals of a shape at onsets spread over the window, in parts; those of a short record are kept."""
    if family in window.elsewhere:
        yield window.elsewhere[family]
        return
    time_s, n_values = window.native.time_s, N_ONSETS * len(window.signals.y)
    onsets = time_s[0] + np.linspace(*INSIDE, N_ONSETS) * (time_s[-1] - time_s[0])
    for part in np.array_split(onsets, min(N_ONSETS, -(-n_values // MOST_VALUES))):
        shifted = signals_of_faults(window, [family.later(onset) for onset in part.tolist()])
        if n_values * len(window.live) <= MOST_VALUES:
            window.elsewhere[family] = shifted
        yield shifted


def _factor(window: PreparedWindow, regression: RegressionData, adding: Regressors, family: Fault) -> float:
    """Return the mean over onsets of z^2 / var(z) of a shape that is added to a fit, at least 1."""
    squares = np.empty(0)
    # Each shifted signal is added alone to the fit.
    for shifted in _elsewhere(window, family):
        z, variance = adding.each_of(shifted / regression.unit[:, None])
        squares = np.append(squares, z**2 / variance)
    seen = squares[np.isfinite(squares)]
    return max(1.0, float(np.mean(seen))) if seen.size else 1.0
