"""The plain test of the one-step residual, the baseline of every method of identification.

A model without fault terms (ARX) is fitted at the order with the best criterion; a residual of more than five robust
standard deviations is an alarm. The test sees every abrupt step at its very sample and never a slow drift, and it knows
no shape: of the dictionary it names what begins where an alarm does.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..config import Config
from ..kernels.progress import Progress, unseen
from ..kernels.variable_projection import fit_magnitudes
from ..kernels.whiteness import exceedances
from ..notes import Note
from .maximum_likelihood import none_of, select
from .preprocessing.magnitudes import magnitudes_of_fit
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow
from .result import SolverSummary
from .selection import MethodResult

# Samples between an alarm and the onset of the entry it stands for: the low-pass of the analysis spreads a step over
# one to either side.
NEAR = 1.5


def identify_by_residual(
    window: PreparedWindow, regression: RegressionData, config: Config, progress: Progress = unseen
) -> MethodResult:
    """Test the residual of the fault-free model, and name the entries of the dictionary that begin where it alarms.

    1. Fit the model without faults at every order and keep the best by the criterion of the configuration.
    2. An alarm is a residual of more than five robust standard deviations.
    3. Of the entries that begin at an alarm, that which explains most alone is declared, with its own magnitude.
    """
    plain = select(window, regression, none_of(config.selection), partial(progress, "the model without faults"))
    fit, error = plain.best, plain.unfolded.error
    estimates = magnitudes_of_fit(regression, plain.best, plain.penalty)
    rows_s = window.signals.time_s[-len(error) :]
    alarms_s = np.unique(np.concatenate([rows_s[exceedances(column)] for column in error.T]))
    statistic = np.nan_to_num(np.abs(estimates.value) / np.sqrt(estimates.variance))
    onsets_s = np.array([window.faults[j].onset_s for j in window.live])
    declared = set()
    for onset_s in np.unique(onsets_s):
        if np.any(np.abs(alarms_s - onset_s) <= NEAR / window.signals.rate_hz):
            beginning = np.flatnonzero(onsets_s == onset_s)
            declared.add(int(beginning[np.argmax(statistic[beginning])]))
    atoms = tuple(sorted(declared))
    # The declared magnitudes, each estimated alone, in one fit; the model stays that without faults.
    z = estimates.value[list(atoms)] / regression.magnitude_unit[list(atoms)]
    with_faults = fit_magnitudes(regression.problem(fit.order), atoms, z, max_iterations=1)
    together = magnitudes_of_fit(regression, with_faults, plain.penalty)
    unfolded = regression.unfold(with_faults)
    shown = ", ".join(f"{time_s:.6g}" for time_s in alarms_s[:5])
    return MethodResult(
        atoms=atoms,
        magnitudes=together,
        error=unfolded.error * regression.unit,
        plain_error=error * regression.unit,
        order=fit.order,
        feedthrough=regression.layout.feedthrough,
        condition_number=unfolded.condition_number,
        solver=SolverSummary(
            method=config.method,
            termination="one fit without faults for every order",
            iterations=len(regression.orders),
            condition_number=unfolded.condition_number,
        ),
        fires=alarms_s.size > 0,
        notes=(
            Note.limit(
                f"the residual exceeds five standard deviations {alarms_s.size} times"
                + (f", first at {shown} s" if alarms_s.size else "")
                + "; the test sees no slow fault and knows no shape: entries are named by their onset alone"
            ),
        ),
    )
