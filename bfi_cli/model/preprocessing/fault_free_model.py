"""The model of a log without fault terms, and the magnitude from which on a fault would be detected with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...config import Config
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.atom_signals import some_of
from ...kernels.coherence import detectable_deviations
from ...kernels.covariance import FitRows, single_additions, unfold
from ...kernels.model_selection import Penalty, least_criterion
from ...kernels.variable_projection import Fit
from ...kernels.whiteness import exceedances
from ...notes import Note
from ...quantities.text import instant
from ..result import ModelSummary, noise_of
from .regression import RegressionData, build_regression, fault_free_fits
from .window import PreparedWindow

# "Minimal detectable" everywhere: declared with 90 % power at 1 % of false alarms shared by the dictionary.
FALSE_ALARM = 0.01
POWER = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaultFreeModel:
    """The fit without fault terms over the rows of the regression, with the signatures of the live atoms.

    Attributes
    ----------
    regression : without atoms; fit : of the order with the best criterion.
    unfolded : `fit` on the rows of the regression, outputs scaled by `regression.unit`.
    sd : (n_live,) standard deviation of each magnitude in SI if that fault alone is added, NaN where its signature
        vanishes.
    deviations : how many of these make a magnitude detectable, see `detectable_at`.
    model : for the reader.
    """

    regression: RegressionData
    fit: Fit
    unfolded: FitRows
    sd: FloatArray
    deviations: float
    model: ModelSummary

    @property
    def error(self) -> FloatArray:
        """(n_rows, n_outputs) prediction error in SI units."""
        return self.unfolded.error * self.regression.unit


def detectable_at(penalty: Penalty) -> float:
    """Return how many standard deviations of a magnitude make it detectable under a criterion."""
    return detectable_deviations(penalty.n_candidates, charge=penalty.per_fault, false_alarm=FALSE_ALARM, power=POWER)


def without_injected_faults(log: FlightLog) -> FlightLog:
    """Return the log with the clean signals it carries in place of those with injected faults."""
    clean = {log.channel(name).name: values for name, values in (log.truth.clean if log.truth else {}).items()}
    return replace(log.with_values(clean), truth=None)


def fit_fault_free(window: PreparedWindow, config: Config) -> FaultFreeModel:
    """Fit the window without fault terms, and give the signatures of its live atoms on the rows of the fit.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    regression = build_regression(window.signals, (), config, orders=window.orders)
    fits, penalty = fault_free_fits(regression, config, len(window.live))
    best = least_criterion(fits)
    theta = some_of(window.signals.theta, window.live) / regression.unit[:, None]
    unfolded = unfold(replace(regression.layout, theta=theta), best)
    return FaultFreeModel(
        regression=regression,
        fit=best,
        unfolded=unfolded,
        sd=np.sqrt(single_additions(best, unfolded)[1]),
        deviations=detectable_at(penalty),
        model=ModelSummary(
            order=best.order,
            rate_hz=window.signals.rate_hz,
            feedthrough=regression.layout.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
            noise_sd=noise_of(unfolded.error * regression.unit, config.outputs),
        ),
    )


def about_the_log(log: FlightLog, window: PreparedWindow, fitted: FaultFreeModel) -> list[Note]:
    """Return notes on the faults that the log cannot show, and on what makes its limits too large or too small.

    A fault in the log makes them too large, a log without noise too small.

    Parameters
    ----------
    log : as it was read.
    window : of the log without its injected faults; fitted : its model.
    """
    notes = [
        Note.limit(
            f"the inputs and lags of the model explain all of '{window.names[j]}', so no magnitude of it can be "
            "detected; move its onset into the window"
        )
        for j, sd in zip(window.live, fitted.sd, strict=True)
        if not np.isfinite(sd)
    ]
    if window.exact:
        notes.append(Note.limit("the log has no noise: the minimal detectable magnitudes are those of round-off"))
    for name, error in zip(window.outputs, fitted.unfolded.error.T, strict=True) if not window.exact else ():
        beyond = exceedances(error)
        if beyond.size:
            more = f" and {beyond.size - 1} more samples" if beyond.size > 1 else ""
            notes.append(
                Note.limit(
                    f"'{name}' jumps away from its prediction at {instant(fitted.regression.rows_s[beyond[0]])} s"
                    f"{more}: if that is a fault, the minimal detectable magnitudes are too large; choose a log or "
                    "window without one"
                )
            )
    if log.truth is not None and log.truth.clean:
        notes.append(Note.method("the injected faults are taken out: this is about the log before them"))
    return notes
