"""What a method of identification returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..kernels import FloatArray
from ..kernels.model_selection import least_criterion
from ..kernels.termination import Termination
from ..notes import Note
from .preprocessing.magnitudes import MagnitudeEstimates
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow
from .result import SolverSummary
from .selection import Selection


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FreeOutcome:
    """What is said of an entry of unknown course.

    Attributes
    ----------
    entry : of the dictionary; output : the index of the output it acts on.
    declared : it is in the log, and its course can be told; suspected : it is, and its course cannot.
    value, sd : (n_samples,) of the course at the samples of the window, SI; of one that is not declared as well.
    note : why it is not declared.
    """

    entry: int
    output: int
    declared: bool
    suspected: bool
    value: FloatArray
    sd: FloatArray
    note: str | None = None

    @property
    def peak(self) -> int:
        """The sample at which it is largest."""
        return int(np.argmax(np.abs(self.value)))


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
    remarks : of live entries, what is said of one that nothing declares in the end.
    needed : (n_live,) statistic, n_rows log of the ratio of determinants, from which on an entry is declared; None
        where the method has no such rule.
    criterion : of the answer, twice the negative log-likelihood and its price, by which recorders are compared;
        dispersion : the largest ratio of a declared entry's statistic at other onsets to that of white errors.
    free : what is said of the entries of unknown course, in the order of `PreparedWindow.free`.
    analysed : window and regression with the entries that begin otherwise than the dictionary states moved to where
        they were found; None where there are none.
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
    remarks: Mapping[int, Note] = field(default_factory=dict)
    needed: FloatArray | None = None
    analysed: tuple[PreparedWindow, RegressionData] | None = None
    criterion: float = np.nan
    dispersion: float = 1.0
    notes: tuple[Note, ...] = ()
    free: tuple[FreeOutcome, ...] = ()


def result_of_selection(
    regression: RegressionData, selection: Selection, magnitudes: MagnitudeEstimates, solver: SolverSummary, **more: Any
) -> MethodResult:
    """Return the result of a method that selects a support at every order and fits it.

    Parameters
    ----------
    more : further attributes of the result.
    """
    fit, searches = selection.best.fit, selection.searches
    plain = [search.of(()) for search in searches]
    lowest = least_criterion(scored for scored in plain if scored is not None)
    several = len(searches) > 1
    return MethodResult(
        atoms=fit.atoms,
        magnitudes=magnitudes,
        error=regression.unfold(fit).error * regression.unit,
        plain_error=regression.unfold(lowest.fit).error * regression.unit,
        order=fit.order,
        feedthrough=regression.layout.feedthrough,
        condition_number=selection.unfolded.condition_number,
        solver=solver,
        orders=regression.orders if several else (),
        criterion_no_fault=tuple(np.nan if scored is None else scored.criterion for scored in plain) if several else (),
        criterion_best=tuple(search.best.criterion for search in searches) if several else (),
        **{"converged": fit.termination is Termination.CONVERGED, **more},
    )
