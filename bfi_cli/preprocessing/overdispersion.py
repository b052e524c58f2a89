"""How much a magnitude varies beyond what white prediction errors explain: a fault against its shape at other onsets.

Gusts, thrust changes and nonlinear dynamics let a slow shape explain the prediction error at any onset better than
white noise would. The mean over onsets of z^2 / var(z) is 1 for white noise; where it is more, variances and thresholds
are multiplied by it, as in quasi-likelihood (McCullagh and Nelder 1989; docs/theory.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..faults import Fault
from ..kernels.piecewise import PiecewiseSignals
from ..kernels.progress import Report, parts, silent
from ..kernels.variable_projection import Fit, fit_magnitudes
from .regression import Adding, RegressionData
from .window import PreparedWindow, signals_of_faults

FloatArray = NDArray[np.float64]

# Neighbouring onsets say much the same: 33 of them in a window of 30 to 120 s are 1 to 3 s apart. The first and the
# last tenth are left out, where a fault acts on the lags alone or on too few samples.
N_ONSETS = 33
INSIDE = (0.1, 0.9)
# Of the signals that are added at once, where they are not in stretches, for memory.
MOST_VALUES = 10**6
# Entries for which it is asked what the factor would be, were they declared: it takes a fit for each.
MOST_DECLARED = 40


def overdispersion(window: PreparedWindow, regression: RegressionData, fit: Fit, report: Report = silent) -> FloatArray:
    """Return (n_live,) factors, at least 1: how much the variance of a magnitude exceeds that of white errors.

    Parameters
    ----------
    window : with the dictionary.
    regression : of the window; fit : the chosen one of it.
    report : receives the progress.
    """
    known = dict[Fault, float]()
    adding = regression.adding_to(fit)
    factors = np.ones(len(window.live))
    for (n, entry), _ in parts(report, list(enumerate(window.live))):
        family = _family(window.faults[entry])
        if family not in known:
            known[family] = _factor(window, regression, adding, family)
        factors[n] = known[family]
    return factors


def overdispersion_if_declared(
    window: PreparedWindow, regression: RegressionData, fit: Fit, dispersion: FloatArray, report: Report = silent
) -> FloatArray:
    """Return (n_live,) the factors that an entry would be tested by, were it declared: at least those of a fit.

    Beside a slow oscillation that is fitted, what its phase leaves stands out more than before. Dictionaries with many
    entries keep the factors of the fit.

    Parameters
    ----------
    fit, dispersion : of the chosen support, by `overdispersion`; entries of it keep theirs.
    report : receives the progress.
    """
    if len(dispersion) > MOST_DECLARED:
        return dispersion
    factors, problem = dispersion.copy(), regression.problem(fit.order)
    others = [n for n in range(len(window.live)) if n not in fit.atoms]
    for n, _ in parts(report, others):
        declared = fit_magnitudes(problem, (*fit.atoms, n), np.append(fit.z, 0.0))
        family = _family(window.faults[window.live[n]])
        factors[n] = max(factors[n], _factor(window, regression, regression.adding_to(declared), family))
    return factors


def _family(fault: Fault) -> Fault:
    """Return what all faults have in common that differ by their onset only."""
    lasting = None if fault.offset_s is None else fault.offset_s - fault.onset_s
    return replace(fault, name=None, magnitude=1.0, onset_s=0.0, offset_s=lasting)


def _factor(window: PreparedWindow, regression: RegressionData, adding: Adding, family: Fault) -> float:
    """Return the mean over onsets of z^2 / var(z) of a shape that is added to a fit, at least 1."""
    time_s = window.native.time_s
    onsets = time_s[0] + np.linspace(*INSIDE, N_ONSETS) * (time_s[-1] - time_s[0])
    is_piecewise = isinstance(window.signals.theta, PiecewiseSignals)
    n_parts = 1 if is_piecewise else min(N_ONSETS, -(-N_ONSETS * len(window.signals.y) // MOST_VALUES))
    lasting, squares = family.offset_s, np.empty(0)
    # Each shifted signal is added alone to the fit.
    for some in np.array_split(onsets, n_parts):
        shifted = [
            replace(family, onset_s=onset, offset_s=None if lasting is None else onset + lasting)
            for onset in some.tolist()
        ]
        added = adding.each_of(regression.over_unit(signals_of_faults(window, shifted)[0]))
        squares = np.append(squares, added.magnitude**2 / added.variance)
    seen = squares[np.isfinite(squares)]
    return max(1.0, float(np.mean(seen))) if seen.size else 1.0
