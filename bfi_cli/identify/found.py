"""What a method of identification found, before it is laid out."""

from __future__ import annotations

from dataclasses import dataclass

from scipy import special

from ..kernels.model_selection import ScoredFit
from ..result import SolverSummary
from .estimation import Magnitudes

__all__ = ["Found", "interval_quantile"]

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What either method hands on: the support, its fit, magnitudes of all live atoms, and how it was computed.

    Attributes
    ----------
    scored : the fit on the support; plain : the fault-free fit.
    magnitudes : of all live atoms, in SI.
    orders, criterion_no_fault, criterion_best : the order selection curve, empty for one order.
    """

    scored: ScoredFit
    plain: ScoredFit
    magnitudes: Magnitudes
    orders: tuple[int, ...]
    criterion_no_fault: tuple[float, ...]
    criterion_best: tuple[float, ...]
    solver: SolverSummary
    notes: tuple[str, ...]


def interval_quantile(estimates: Magnitudes) -> float:
    """Return how many standard deviations a 95 % interval reaches to each side."""
    return float(special.stdtrit(estimates.degrees, 0.5 + CONFIDENCE / 2.0))
