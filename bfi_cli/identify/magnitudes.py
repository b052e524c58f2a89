"""Magnitudes in SI units, whose variances include the spread between orders and rates of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..kernels.covariance import covariance, single_additions, unfold
from ..kernels.model_selection import Penalty, ScoredFit
from ..kernels.progress import Report, parts, silent
from ..preprocessing.fault_free_model import detectable_at
from ..preprocessing.regression import RegressionData
from .result import SolverSummary

__all__ = ["MagnitudeEstimates", "MethodResult", "averaged_magnitudes", "magnitudes_of_fit", "with_rate_spread"]

FloatArray = NDArray[np.float64]

CONFIDENCE = 0.95
CLOSE = 20.0  # orders whose criterion is further from the best weigh less than exp(-10) and are not worth their time
RATE_WEIGHT = 0.5  # of the squared change between two rates, half is the variance of either


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagnitudeEstimates:
    """Magnitudes of all live atoms in SI: of a declared atom its estimate, of another that of the atom added alone.

    They are NaN where the method does not estimate them.

    Attributes
    ----------
    value, variance, minimal_detectable : (n_live,).
    covariance : (n_declared, n_declared).
    degrees : of freedom of the intervals, NaN where there are none.
    """

    value: FloatArray
    variance: FloatArray
    minimal_detectable: FloatArray
    covariance: FloatArray
    degrees: float

    @property
    def quantile(self) -> float:
        """How many standard deviations a 95 % interval reaches to each side."""
        return float(special.stdtrit(self.degrees, 0.5 + CONFIDENCE / 2.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MethodResult:
    """The result of a method of identification, whatever its model is.

    Attributes
    ----------
    atoms : the declared ones, ascending indices into the live entries of the window.
    magnitudes : of all live entries.
    error : (n_rows, n_outputs) prediction error with the declared faults, SI, of the last rows of the window;
        plain_error : of the model without faults.
    order, feedthrough : of the model; condition_number : of its regressors, NaN where it has none.
    orders, criterion_no_fault, criterion_best : the order selection curve, empty for one order.
    converged : the solver of the answer did; else there is no interval and no verdict.
    fires : the method says that there is a fault, whatever is declared.
    declined : of live entries that were favoured and then declined, why.
    needed : (n_live,) statistic, n_rows log of the ratio of determinants, from which on an entry is declared; None
        where the method has no such rule.
    """

    atoms: tuple[int, ...]
    magnitudes: MagnitudeEstimates
    error: FloatArray
    plain_error: FloatArray
    order: int
    feedthrough: bool
    condition_number: float
    solver: SolverSummary
    orders: tuple[int, ...] = ()
    criterion_no_fault: tuple[float, ...] = ()
    criterion_best: tuple[float, ...] = ()
    converged: bool = True
    fires: bool = False
    declined: Mapping[int, str] = field(default_factory=dict)
    needed: FloatArray | None = None
    notes: tuple[str, ...] = ()


def averaged_magnitudes(
    regression: RegressionData,
    fits: Sequence[ScoredFit],
    penalty: Penalty,
    overdispersion: FloatArray,
    report: Report = silent,
) -> MagnitudeEstimates:
    """Return the magnitudes at the best order, with the spread between orders added to their variances.

    The covariance of each order is multiplied by the overdispersion; the spread is weighted by the criteria.

    Parameters
    ----------
    fits : of one support at every order.
    penalty : the criterion they are scored by.
    overdispersion : (n_live,) see `bfi_cli.preprocessing.overdispersion`.
    report : receives the progress.
    """
    criteria = np.array([scored.criterion for scored in fits])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    best = int(np.argmin(criteria))
    keep = [n for n in range(len(fits)) if criteria[n] - criteria[best] < CLOSE]
    values, variances, covariances = {}, {}, {}
    for n, _ in parts(report, keep):
        fit = fits[n].fit
        unfolded, active = unfold(regression.layout, fit), list(fit.atoms)
        single, scaled = single_additions(fit, unfolded), covariance(fit, unfolded)
        z, variance, unit = single.magnitude.copy(), single.variance.copy(), regression.magnitude_unit
        z[active], variance[active] = fit.z, np.diag(scaled)
        wider = np.sqrt(overdispersion[active]) * unit[active]
        values[n], variances[n] = z * unit, variance * overdispersion * unit**2
        covariances[n] = scaled * np.outer(wider, wider)
    value, cov = values[best], covariances[best]
    spread = np.array([variances[n] + (values[n] - value) ** 2 for n in keep])
    weight = weights[keep, None] * np.isfinite(spread)
    total = weight.sum(axis=0)
    variance = np.where(total > 0.0, np.nansum(weight * np.nan_to_num(spread), axis=0), np.nan)
    variance /= np.where(total > 0.0, total, 1.0)
    fit, n_outputs = fits[best].fit, regression.layout.y.shape[1]
    active, own = list(fit.atoms), np.diag(cov)
    wider = np.sqrt(variance[active] / np.where(own > 0.0, own, 1.0))
    return MagnitudeEstimates(
        value=value,
        variance=variance,
        minimal_detectable=detectable_at(penalty) * np.sqrt(variance),
        covariance=cov * np.outer(wider, wider),
        degrees=max(penalty.n_effective - fit.n_parameters / n_outputs, 2.0),
    )


def magnitudes_of_fit(regression: RegressionData, scored: ScoredFit, penalty: Penalty) -> MagnitudeEstimates:
    """Return the magnitudes of one fit, nothing averaged."""
    return averaged_magnitudes(regression, [scored], penalty, np.ones(len(regression.atoms)))


def with_rate_spread(
    estimates: MagnitudeEstimates, coarse: MagnitudeEstimates, active: Sequence[int], penalty: Penalty
) -> MagnitudeEstimates:
    """Return the magnitudes with the part of their change at half the rate that sampling does not explain.

    Parameters
    ----------
    coarse : of the same support at half the rate.
    active : the support; penalty : the criterion it was chosen by.
    """
    excess = (coarse.value - estimates.value) ** 2 - np.maximum(estimates.variance, coarse.variance)
    variance = estimates.variance + RATE_WEIGHT * np.nan_to_num(np.maximum(excess, 0.0))
    wider = np.sqrt(variance / np.where(estimates.variance > 0, estimates.variance, 1.0))[list(active)]
    return replace(
        estimates,
        variance=variance,
        minimal_detectable=detectable_at(penalty) * np.sqrt(variance),
        covariance=estimates.covariance * np.outer(wider, wider),
    )
