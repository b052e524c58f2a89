"""Progress of long work: the fraction that is done, 0 to 1, is passed to a function that the caller gives.

A loop gives each inner loop a share of its own fraction, so that the fraction at the top never falls and ends at 1.
Work of unknown length, such as a search that ends when no fault is left, consists of named stages; the fraction of each
stage runs from 0 to 1.

An iteration ends by its iterates and their misfits alone, and says why.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import accumulate, pairwise
from typing import Protocol, TypeVar

import numpy as np

from ..kernels import EPS, FloatArray

T = TypeVar("T")
Report = Callable[[float], None]
Progress = Callable[[str, float], None]
Step = Callable[[], None]


def silent(_done: float) -> None:
    """Report nothing."""


def unseen(_stage: str, _done: float) -> None:
    """Report nothing."""


def shares(report: Report, *weights: float) -> list[Report]:
    """Return one report for each of several pieces of work, whose durations are in proportion to the weights."""
    ends = [end / sum(weights) for end in accumulate(weights)]
    return [_between(report, low, high) for low, high in pairwise([0.0, *ends])]


def _between(report: Report, low: float, high: float) -> Report:
    return lambda done: report(low + (high - low) * done if done < 1.0 else high)


def parts(report: Report, items: Sequence[T]) -> Iterator[tuple[T, Report]]:
    """Yield the items of a loop, each with the report for the work on it; it is done when the next is requested."""
    n = len(items)
    for k, item in enumerate(items):
        yield item, _between(report, k / n, (k + 1) / n)
        report((k + 1) / n)


def steps(report: Report, about: int) -> Step:
    """Return a function for each step of a loop of unknown length; it reports 1/2 after `about` steps and never 1."""
    done = itertools.count(1)

    def step() -> None:
        n = next(done)
        report(n / (n + about))

    return step


# Steps without a smaller misfit before the misfit is taken to have reached its floor. Chosen without tuning record:
# fewer may stop where the misfit only pauses, more cost time.
PATIENCE = 8
# Misfit relative to the data's norm that is a sum of rounding errors.
ROUND_OFF = 10 * EPS
# Misfit relative to the data's norm, which is the misfit of X = 0, at which the iteration is given up.
RUNAWAY = 1e6


class Termination(Enum):
    """Why an iteration ended; the value is the sentence shown to the user."""

    CONVERGED = "converged"
    FIXED = "ran the fixed number of iterations asked for, without a test of convergence"
    MAX_ITERATIONS = "reached the iteration limit before converging"
    STAGNATED = "the fit stopped improving while the estimate kept moving"
    DIVERGED = "the fit grew worse without bound"
    RANK_LOST = "the estimate lost rank, so the next sketch is not defined"


class Iterate(Protocol):
    """What `iterate` needs of an iterate: the estimate, and the norm of what it leaves unexplained."""

    @property
    def X(self) -> FloatArray: ...

    @property
    def misfit(self) -> float: ...


S = TypeVar("S", bound=Iterate)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppingRule:
    """When to stop.

    Attributes
    ----------
    max_iterations : at most so many steps.
    tolerance : on the relative change of X in one step.
    fixed : make exactly `max_iterations` steps (unless the arithmetic breaks down) and return the last.
    """

    max_iterations: int = 50
    tolerance: float = 1e-10
    fixed: bool = False


def iterate(
    step: Callable[[S], S | None],
    start: S,
    *,
    scale: float,
    settings: StoppingRule,
    between: Callable[[S], S] | None = None,
) -> tuple[S, int, Termination]:
    """Return an iterate, the number of steps made, and why no more were.

    Steps are made until X settles, the data are reproduced to round-off, or nothing more can be gained.

    X has settled when its relative change is below the tolerance, or below its root once the misfit has not improved
    (relatively, by the tolerance) for eight steps: along an ill-conditioned direction round-off keeps X trembling.
    A converged or fixed run returns its last iterate, any other the one with the smallest misfit.

    Parameters
    ----------
    step : next iterate, None where it is not defined.
    start : first iterate; its misfit is not looked at.
    scale : norm of the data, to which the misfit is compared.
    settings : when to stop.
    between : applied after every step but the last; convergence is tested before it.
    """
    previous, best, waited = start, start, 0
    for count in range(1, settings.max_iterations + 1):
        origin = previous if between is None or count == 1 else between(previous)
        current = step(origin)
        if current is None:
            return best, count, Termination.RANK_LOST
        if not np.isfinite(current.misfit) or (not settings.fixed and current.misfit > RUNAWAY * scale):
            return best, count, Termination.DIVERGED
        improved = count == 1 or current.misfit < best.misfit * (1 - settings.tolerance)
        best, waited = (current, 0) if improved else (best, waited + 1)
        if not settings.fixed:
            change = float(np.linalg.norm(current.X - previous.X) / (np.linalg.norm(current.X) or 1.0))
            done = change <= settings.tolerance or current.misfit <= ROUND_OFF * scale
            if done or (waited >= PATIENCE and change <= settings.tolerance**0.5):
                return current, count, Termination.CONVERGED
            if waited >= PATIENCE:
                return best, count, Termination.STAGNATED
        previous = current
    if settings.fixed:
        return previous, settings.max_iterations, Termination.FIXED
    return best, settings.max_iterations, Termination.MAX_ITERATIONS
