"""Magnitudes in SI units with variances that admit what a single model does not know about itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..faults import Decision
from ..kernels.covariance import covariance, single_additions, unfold
from ..kernels.model_selection import Penalty, ScoredFit
from ..kernels.progress import Report, parts, silent
from ..kernels.variable_projection import Fit
from ..preprocessing.fault_free_model import detectable_at
from ..preprocessing.regression import RegressionData
from .result import SolverSummary

__all__ = ["MagnitudeEstimates", "MethodResult", "averaged_magnitudes", "magnitudes_of_fit", "with_rate_spread"]

FloatArray = NDArray[np.float64]

CONFIDENCE = 0.95
# Orders whose criterion is further from the best weigh less than exp(-10) and are not worth their time.
CLOSE = 20.0
# Of the squared change between two rates, half is the variance of either.
RATE_WEIGHT = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagnitudeEstimates:
    """Of every live atom in SI: the estimate if declared, else what adding it alone would give (NaN where not known).

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
    """What a method of identification finds, whatever its model is.

    Attributes
    ----------
    atoms : the declared ones, ascending indices into the live entries of the window.
    magnitudes : of all live entries.
    error : (n_rows, n_outputs) prediction error with the declared faults, SI, of the last rows of the window;
        plain_error : of the model without faults.
    order, feedthrough : of the model; condition_number : of its regressors, NaN where it has none.
    orders, criterion_no_fault, criterion_best : the order selection curve, empty for one order.
    decision : None to decide by what is declared and what could have been seen.
    converged : the solver of the answer did; else there is no interval and no verdict.
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
    decision: Decision | None = None
    converged: bool = True
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
    report : told how far it is.
    """
    criteria = np.array([scored.criterion for scored in fits])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    best = int(np.argmin(criteria))
    keep = [n for n in range(len(fits)) if criteria[n] - criteria[best] < CLOSE]
    layers = {n: _at_order(regression, fits[n].fit, overdispersion) for n, _ in parts(report, keep)}
    value, _, cov = layers[best]
    spread = np.array([layers[n][1] + (layers[n][0] - value) ** 2 for n in keep])
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
    """Return the magnitudes with what they change at half the rate, as far as sampling does not explain it.

    Parameters
    ----------
    coarse : of the same support at half the rate.
    active : the support; penalty : the criterion it was chosen by.
    """
    excess = (coarse.value - estimates.value) ** 2 - np.maximum(estimates.variance, coarse.variance)
    variance = estimates.variance + RATE_WEIGHT * np.nan_to_num(np.maximum(excess, 0.0))
    wider = np.sqrt(variance / np.where(estimates.variance > 0, estimates.variance, 1.0))[list(active)]
    return MagnitudeEstimates(
        value=estimates.value,
        variance=variance,
        minimal_detectable=detectable_at(penalty) * np.sqrt(variance),
        covariance=estimates.covariance * np.outer(wider, wider),
        degrees=estimates.degrees,
    )


def _at_order(
    regression: RegressionData, fit: Fit, overdispersion: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return magnitudes and variances of all atoms at one fit, and the covariance of its support, in SI."""
    unfolded = unfold(regression.layout, fit)
    single = single_additions(fit, unfolded)
    scaled = covariance(fit, unfolded)
    value, variance = single.magnitude.copy(), single.variance.copy()
    active = list(fit.atoms)
    value[active], variance[active] = fit.z, np.diag(scaled)
    unit = regression.magnitude_unit
    wider = np.sqrt(overdispersion[active]) * unit[active]
    return value * unit, variance * overdispersion * unit**2, scaled * np.outer(wider, wider)
