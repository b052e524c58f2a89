"""Progress of long work: the fraction that is done, 0 to 1, is passed to a function that the caller gives.

A loop gives each inner loop a share of its own fraction, so that the fraction at the top never falls and ends at 1.
Work of unknown length, such as a search that ends when no fault is left, consists of named stages; the fraction of each
stage runs from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate, count, pairwise
from typing import TypeVar

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
    done = count(1)

    def step() -> None:
        n = next(done)
        report(n / (n + about))

    return step
