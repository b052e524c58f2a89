"""Does a fault stand out from what the same shape would find at other onsets of the same window?

Gusts, thrust changes and nonlinear dynamics make a prediction error explain slow shapes at any onset better than white
noise would. The mean over onsets of the squared deviation in units of its own variance is 1 for white noise; where it
is more, variances and thresholds are multiplied by it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..faults import Fault
from ..filters import recorded_signal
from ..kernels.covariance import single_additions, unfold
from ..kernels.decimation import decimate
from ..kernels.progress import Report, parts, silent
from ..kernels.variable_projection import Fit
from .regression import RegressionData
from .window import PreparedWindow

__all__ = ["overdispersion"]

FloatArray = NDArray[np.float64]

# Neighbouring onsets say much the same: 33 of them in a window of 30 to 120 s are 1 to 3 s apart. The first and the
# last tenth are left out, where a fault acts on the lags alone or on too few samples.
N_ONSETS = 33
INSIDE = (0.1, 0.9)


def overdispersion(window: PreparedWindow, regression: RegressionData, fit: Fit, report: Report = silent) -> FloatArray:
    """Return (n_live,) factors, at least 1: how much the variance of a magnitude exceeds that of white errors.

    Parameters
    ----------
    window : with the dictionary.
    regression : of the window; fit : the chosen one of it.
    report : told how far it is.
    """
    known: dict[Fault, float] = {}
    factors = np.ones(len(window.live))
    for (n, entry), _ in parts(report, list(enumerate(window.live))):
        fault = window.faults[entry]
        lasting = None if fault.offset_s is None else fault.offset_s - fault.onset_s
        family = replace(fault, name=None, magnitude=1.0, onset_s=0.0, offset_s=lasting)
        if family not in known:
            known[family] = _mean_square(regression, fit, _at_other_onsets(window, regression, family))
        factors[n] = known[family]
    return factors


def _at_other_onsets(window: PreparedWindow, regression: RegressionData, family: Fault) -> FloatArray:
    """Return (n_samples, n_outputs, N_ONSETS): the fault at onsets across the window, filtered and scaled."""
    time_s = window.native.time_s
    onsets = time_s[0] + np.linspace(*INSIDE, N_ONSETS) * (time_s[-1] - time_s[0])
    raw = np.empty((len(time_s), N_ONSETS))
    for n, onset in enumerate(onsets):
        offset = None if family.offset_s is None else float(onset + family.offset_s)
        shifted = replace(family, onset_s=float(onset), offset_s=offset)
        raw[:, n] = recorded_signal(shifted, time_s, window.response, window_start_s=window.window_start_s)
    channels = [window.log.channel(name).name for name in window.outputs]
    output = channels.index(window.log.channel(family.channel).name)
    filtered = decimate(raw, window.rate.factor, window.lowpass)
    theta = np.zeros((len(filtered), len(channels), N_ONSETS))
    theta[:, output] = filtered / regression.unit[output]
    return theta


def _mean_square(regression: RegressionData, fit: Fit, theta: FloatArray) -> float:
    """Return the mean of z^2 / var(z) over the signals `theta`, each added alone to the fit."""
    declared = regression.layout.theta[:, :, list(fit.atoms)]
    layout = replace(regression.layout, theta=np.concatenate([declared, theta], axis=2))
    same = replace(fit, atoms=tuple(range(len(fit.atoms))))
    added = single_additions(same, unfold(layout, same))
    squares = (added.magnitude**2 / added.variance)[len(fit.atoms) :]
    seen = squares[np.isfinite(squares)]
    return max(1.0, float(np.mean(seen))) if seen.size else 1.0
