"""The support and the order that an identification chose, with everything else that was visited."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..kernels.covariance import FitRows
from ..kernels.model_selection import OrderSearch, Penalty, ScoredFit
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selection:
    """The selected support: its fit at every order, and everything else that was visited.

    Attributes
    ----------
    best : the fit at the best order.
    fits : of the same support at each order, with their criteria.
    searches : what was visited, by order.
    penalty : the criterion.
    unfolded : `best` over the rows, with the signatures of its support.
    """

    best: ScoredFit
    fits: tuple[ScoredFit, ...]
    searches: tuple[OrderSearch, ...]
    penalty: Penalty
    unfolded: FitRows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selected:
    """A window whose entries begin where they were found, its regression and the selection on it.

    Attributes
    ----------
    shifts_s : by live entry of the selection, how much later it begins than the dictionary states.
    prices : by live entry, what the choice of its onset costs, on the scale of the criterion.
    """

    window: PreparedWindow
    regression: RegressionData
    selection: Selection
    shifts_s: Mapping[int, float] = field(default_factory=dict)
    prices: Mapping[int, float] = field(default_factory=dict)
