"""The predictor of a log without fault terms, and from which magnitude on it would show a fault (METHOD section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..conditioning import is_exact
from ..config import Config
from ..flightlog import FlightLog
from ..kernels.coherence import detectable_deviations
from ..kernels.covariance import FitRows, single_additions, unfold
from ..kernels.model_selection import Penalty
from ..kernels.variable_projection import Fit, fit_magnitudes
from ..kernels.whiteness import effective_rows, exceedances
from .intake import Intake
from .scaled import Study, study_of

__all__ = ["Predicted", "about_the_log", "predicted", "without_injected"]

FloatArray = NDArray[np.float64]

FALSE_ALARM = 0.01
POWER = 0.9
CLEANED = "the faults injected into the log are taken out of it: this is about the log before they were injected"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Predicted:
    """The fit without fault terms, laid over its rows with the signatures of the live atoms, magnitudes in SI.

    Attributes
    ----------
    study : the scaled record; fit : of the order with the best criterion; penalty : that criterion.
    unfolded : over the rows, outputs scaled by `study.unit`.
    sd : (n_live,) standard deviation of each magnitude if that fault alone is added, NaN where the log shows nothing.
    deviations : how many of these a magnitude needs to be declared with 90 % power at 1 % false alarms.
    """

    study: Study
    fit: Fit
    penalty: Penalty
    unfolded: FitRows
    sd: FloatArray
    deviations: float

    @property
    def minimal_detectable(self) -> FloatArray:
        """(n_live,) magnitudes, each fault alone; NaN where the log shows nothing."""
        return self.deviations * self.sd

    @property
    def visible(self) -> FloatArray:
        """(n_live,) norm of each filtered signature off the regressors over that before."""
        left = np.sqrt(np.einsum("koj,koj->j", self.unfolded.signatures, self.unfolded.signatures))
        return np.asarray(left / np.where(self.unfolded.raw_norm > 0.0, self.unfolded.raw_norm, 1.0))


def without_injected(log: FlightLog) -> FlightLog:
    """Return the log with the clean signals it carries in place of those with injected faults."""
    clean = {} if log.truth is None else log.truth.clean
    restored = [replace(log.channel(name), values=values) for name, values in clean.items()]
    return replace(log, channels={**log.channels, **{channel.name: channel for channel in restored}}, truth=None)


def predicted(intake: Intake, config: Config) -> Predicted:
    """Fit the record without fault terms and lay the signatures of its live atoms over the rows.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    conditioned = intake.conditioned
    study = study_of(intake.log.path, conditioned, (), config)
    penalty = Penalty(
        n_rows=study.n_rows,
        n_effective=float(study.n_rows),
        n_candidates=len(intake.live),
        evidence=config.selection.evidence,
        extended=config.selection.criterion == "ebic",
    )
    fits = [fit_magnitudes(study.problem(order), ()) for order in study.orders]
    best = min(fits, key=penalty.criterion)
    effective = effective_rows(unfold(study.layout, best).error)
    penalty = replace(penalty, n_effective=min(penalty.n_effective, max(effective, 2.0 * best.n_parameters)))
    best = min(fits, key=penalty.criterion)
    layout = replace(study.layout, theta=conditioned.theta[:, :, list(intake.live)] / study.unit[:, None])
    unfolded = unfold(layout, best)
    charge = penalty.per_parameter + penalty.per_atom
    return Predicted(
        study=study,
        fit=best,
        penalty=penalty,
        unfolded=unfolded,
        sd=np.sqrt(single_additions(best, unfolded).variance),
        deviations=detectable_deviations(penalty.n_candidates, charge=charge, false_alarm=FALSE_ALARM, power=POWER),
    )


def about_the_log(log: FlightLog, intake: Intake, found: Predicted) -> list[str]:
    """Name the faults that the log cannot show, and say where it makes limits too large (a fault) or small (no noise).

    Parameters
    ----------
    log : as it was read.
    intake : of the log without its injected faults; found : its predictor.
    """
    names = [intake.names[j] for j in intake.live]
    cleaned = [CLEANED] if log.truth is not None and log.truth.clean else []
    return [*_unseen(names, found.sd), *_about_its_noise(intake, found), *cleaned]


def _unseen(names: Sequence[str], sd: FloatArray) -> list[str]:
    return [
        f"'{name}' leaves nothing that the model's own inputs and lags do not explain; move its onset into the window"
        for name, size in zip(names, sd, strict=True)
        if not np.isfinite(size)
    ]


def _about_its_noise(intake: Intake, found: Predicted) -> list[str]:
    if is_exact(intake.record):
        return ["the log has no noise: the minimal detectable magnitudes are those of round-off"]
    time_s = found.study.conditioned.time_s[found.study.layout.first :]
    said = []
    for i, name in enumerate(intake.outputs):
        beyond = exceedances(found.unfolded.error[:, i])
        if beyond.size:
            more = f" and {beyond.size - 1} more samples" if beyond.size > 1 else ""
            said.append(
                f"'{name}' jumps away from its prediction at {time_s[beyond[0]]:.6g} s{more}: if that is a fault, the "
                "minimal detectable magnitudes are too large; choose a log or window without one"
            )
    return said
