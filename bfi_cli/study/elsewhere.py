"""Does a fault stand out from what the same shape would find at other onsets of the same window?

Gusts, thrust changes and nonlinear dynamics make a prediction error explain slow shapes at any onset better than white
noise would (METHOD section 5, Decision). The mean over onsets of the squared deviation in units of its own variance is
1 for white noise; where it is more, variances and thresholds are multiplied by it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..faults import Fault, unit_signal
from ..kernels.bilinear import Fit
from ..kernels.covariance import single_additions, unfold
from ..kernels.decimation import Lowpass, decimate
from ..kernels.progress import Report, parts, silent
from .intake import Intake
from .scaled import Study

__all__ = ["overdispersion"]

FloatArray = NDArray[np.float64]

N_ONSETS = 33
INSIDE = (0.1, 0.9)


def overdispersion(intake: Intake, study: Study, fit: Fit, lowpass: Lowpass, report: Report = silent) -> FloatArray:
    """Return (n_live,) factors, at least 1: how much the variance of a magnitude exceeds that of white errors.

    Parameters
    ----------
    intake : the log and its dictionary.
    study : the scaled record; fit : the chosen one.
    lowpass : of the conditioning.
    report : told how far it is.
    """
    known: dict[Fault, float] = {}
    factors = np.ones(len(study.live))
    for (n, entry), _ in parts(report, list(enumerate(study.live))):
        family = _family(intake.faults[entry])
        if family not in known:
            known[family] = _mean_square(intake, study, fit, _signals(intake, study, family, lowpass))
        factors[n] = known[family]
    return factors


def _family(fault: Fault) -> Fault:
    """The fault without its name, place and size."""
    lasting = None if fault.offset_s is None else fault.offset_s - fault.onset_s
    return replace(fault, name=None, magnitude=1.0, onset_s=0.0, offset_s=lasting)


def _signals(intake: Intake, study: Study, family: Fault, lowpass: Lowpass) -> FloatArray:
    """Return (n_samples, n_outputs, N_ONSETS): the family at onsets across the window, conditioned and scaled."""
    time_s = intake.record.time_s
    onsets = time_s[0] + np.linspace(*INSIDE, N_ONSETS) * (time_s[-1] - time_s[0])
    raw = np.empty((len(time_s), N_ONSETS))
    for n, onset in enumerate(onsets):
        offset = None if family.offset_s is None else float(onset + family.offset_s)
        shifted = replace(family, onset_s=float(onset), offset_s=offset)
        raw[:, n] = unit_signal(shifted, time_s, window_start_s=intake.window_start_s)
    channels = [intake.log.channel(name).name for name in intake.outputs]
    place = channels.index(intake.log.channel(family.channel).name)
    conditioned = decimate(raw, intake.choice.factor, lowpass)
    theta = np.zeros((len(conditioned), len(channels), N_ONSETS))
    theta[:, place] = conditioned / study.unit[place]
    return theta


def _mean_square(intake: Intake, study: Study, fit: Fit, theta: FloatArray) -> float:
    layout = replace(study.layout, theta=np.concatenate([study.layout.theta[:, :, list(fit.atoms)], theta], axis=2))
    same = replace(fit, atoms=tuple(range(len(fit.atoms))))
    added = single_additions(same, unfold(layout, same))
    squares = (added.magnitude**2 / added.variance)[len(fit.atoms) :]
    seen = squares[np.isfinite(squares)]
    return max(1.0, float(np.mean(seen))) if seen.size else 1.0
