"""The predictor of a log without fault terms, and from which magnitude on it would show a fault."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..flightlog import FlightLog
from ..kernels.coherence import detectable_deviations
from ..kernels.covariance import FitRows, single_additions, unfold
from ..kernels.model_selection import Penalty
from ..kernels.variable_projection import Fit, fit_magnitudes
from ..kernels.whiteness import effective_rows, exceedances
from .regression import RegressionData, build_regression
from .summary import ModelSummary, model_summary
from .window import PreparedWindow

__all__ = ["FaultFreeModel", "about_the_log", "detectable_at", "fit_fault_free", "without_injected_faults"]

FloatArray = NDArray[np.float64]

# What "minimal detectable" means everywhere: declared with 90 % power at 1 % of false alarms shared by the dictionary.
FALSE_ALARM = 0.01
POWER = 0.9
CLEANED = "the faults injected into the log are taken out of it: this is about the log before they were injected"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaultFreeModel:
    """The fit without fault terms, laid over its rows with the signatures of the live atoms, magnitudes in SI.

    Attributes
    ----------
    regression : without atoms; fit : of the order with the best criterion.
    unfolded : over the rows, outputs scaled by `regression.unit`.
    sd : (n_live,) standard deviation of each magnitude if that fault alone is added, NaN where the log shows nothing.
    deviations : how many of these a magnitude needs to be detectable, see `detectable_at`.
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
    charge = penalty.per_parameter + penalty.per_atom
    return detectable_deviations(penalty.n_candidates, charge=charge, false_alarm=FALSE_ALARM, power=POWER)


def without_injected_faults(log: FlightLog) -> FlightLog:
    """Return the log with the clean signals it carries in place of those with injected faults."""
    clean = {} if log.truth is None else log.truth.clean
    restored = [replace(log.channel(name), values=values) for name, values in clean.items()]
    return replace(log, channels={**log.channels, **{channel.name: channel for channel in restored}}, truth=None)


def fit_fault_free(window: PreparedWindow, config: Config) -> FaultFreeModel:
    """Fit the window without fault terms and lay the signatures of its live atoms over the rows.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    regression = build_regression(window.signals, (), config)
    penalty = Penalty(
        n_rows=regression.n_rows,
        n_effective=float(regression.n_rows),
        n_candidates=len(window.live),
        evidence=config.selection.evidence,
        extended=config.selection.criterion == "ebic",
    )
    fits = [fit_magnitudes(regression.problem(order), ()) for order in regression.orders]
    best = min(fits, key=penalty.criterion)
    effective = effective_rows(unfold(regression.layout, best).weighted_error)
    penalty = replace(penalty, n_effective=min(penalty.n_effective, max(effective, 2.0 * best.n_parameters)))
    best = min(fits, key=penalty.criterion)
    theta = window.signals.theta[:, :, list(window.live)] / regression.unit[:, None]
    unfolded = unfold(replace(regression.layout, theta=theta), best)
    return FaultFreeModel(
        regression=regression,
        fit=best,
        unfolded=unfolded,
        sd=np.sqrt(single_additions(best, unfolded).variance),
        deviations=detectable_at(penalty),
        model=model_summary(
            unfolded.error * regression.unit,
            order=best.order,
            rate_hz=window.signals.rate_hz,
            feedthrough=regression.layout.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
        ),
    )


def about_the_log(log: FlightLog, window: PreparedWindow, fitted: FaultFreeModel) -> list[str]:
    """Name the faults that the log cannot show, and say where it makes limits too large (a fault) or small (no noise).

    Parameters
    ----------
    log : as it was read.
    window : of the log without its injected faults; fitted : its model.
    """
    said = [
        f"'{window.names[j]}' leaves nothing that the model's own inputs and lags do not explain; move its onset into "
        "the window"
        for j, size in zip(window.live, fitted.sd, strict=True)
        if not np.isfinite(size)
    ]
    if window.exact:
        said.append("the log has no noise: the minimal detectable magnitudes are those of round-off")
    else:
        for name, error in zip(window.outputs, fitted.unfolded.error.T, strict=True):
            beyond = exceedances(error)
            if beyond.size:
                more = f" and {beyond.size - 1} more samples" if beyond.size > 1 else ""
                said.append(
                    f"'{name}' jumps away from its prediction at {fitted.regression.rows_s[beyond[0]]:.6g} s{more}: if "
                    "that is a fault, the minimal detectable magnitudes are too large; choose a log or window without "
                    "one"
                )
    if log.truth is not None and log.truth.clean:
        said.append(CLEANED)
    return said
