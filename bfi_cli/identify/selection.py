"""The support and the order that an identification chose, with everything else that was visited."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.covariance import FitRows
from ..kernels.model_selection import OrderSearch, Penalty, ScoredFit

__all__ = ["Selection"]


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
