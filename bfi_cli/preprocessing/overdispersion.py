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
from ..kernels.variable_projection import Fit
from .regression import RegressionData
from .window import PreparedWindow, signals_of_faults

__all__ = ["overdispersion"]

FloatArray = NDArray[np.float64]

# Neighbouring onsets say much the same: 33 of them in a window of 30 to 120 s are 1 to 3 s apart. The first and the
# last tenth are left out, where a fault acts on the lags alone or on too few samples.
N_ONSETS = 33
INSIDE = (0.1, 0.9)
# Of the signals that are added at once, where they are not in stretches, for memory.
MOST_VALUES = 10**6


def overdispersion(window: PreparedWindow, regression: RegressionData, fit: Fit, report: Report = silent) -> FloatArray:
    """Return (n_live,) factors, at least 1: how much the variance of a magnitude exceeds that of white errors.

    Parameters
    ----------
    window : with the dictionary.
    regression : of the window; fit : the chosen one of it.
    report : receives the progress.
    """
    time_s, known = window.native.time_s, dict[Fault, float]()
    onsets = time_s[0] + np.linspace(*INSIDE, N_ONSETS) * (time_s[-1] - time_s[0])
    adding = regression.adding_to(fit)
    is_piecewise = isinstance(window.signals.theta, PiecewiseSignals)
    n_parts = 1 if is_piecewise else min(N_ONSETS, -(-N_ONSETS * len(window.signals.y) // MOST_VALUES))
    factors = np.ones(len(window.live))
    for (n, entry), _ in parts(report, list(enumerate(window.live))):
        fault = window.faults[entry]
        lasting = None if fault.offset_s is None else fault.offset_s - fault.onset_s
        family = replace(fault, name=None, magnitude=1.0, onset_s=0.0, offset_s=lasting)
        if family not in known:
            squares = np.empty(0)
            # Each shifted signal is added alone to the fit.
            for some in np.array_split(onsets, n_parts):
                shifted = [
                    replace(family, onset_s=onset, offset_s=None if lasting is None else onset + lasting)
                    for onset in some.tolist()
                ]
                added = adding.each_of(regression.over_unit(signals_of_faults(window, shifted)[0]))
                squares = np.append(squares, added.magnitude**2 / added.variance)
            seen = squares[np.isfinite(squares)]
            known[family] = max(1.0, float(np.mean(seen))) if seen.size else 1.0
        factors[n] = known[family]
    return factors
