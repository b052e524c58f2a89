"""How far a long loop is: the part of it that is done, 0 to 1, told to a function that the caller gives.

A loop hands its own loops shares of what it was given, so that what is told at the top never falls and ends at 1. Of
work whose length is not known before it is done, such as a search that goes on until no fault is left, every stage has
a name and is told from 0 to 1 by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate, count, pairwise
from typing import TypeVar

__all__ = ["Progress", "Report", "Step", "parts", "shares", "silent", "steps", "unseen"]

T = TypeVar("T")
Report = Callable[[float], None]
Progress = Callable[[str, float], None]
Step = Callable[[], None]


def silent(_done: float) -> None:
    """Tell nobody."""


def unseen(_stage: str, _done: float) -> None:
    """Tell nobody."""


def shares(report: Report, *weights: float) -> list[Report]:
    """Return what each of several pieces of work reports to, their lengths in proportion to the weights."""
    ends = [end / sum(weights) for end in accumulate(weights)]
    return [_between(report, low, high) for low, high in pairwise([0.0, *ends])]


def _between(report: Report, low: float, high: float) -> Report:
    return lambda done: report(low + (high - low) * done if done < 1.0 else high)


def parts(report: Report, items: Sequence[T]) -> Iterator[tuple[T, Report]]:
    """Yield the items of a loop and what the work on each reports to; an item is done when the next is asked for."""
    n = len(items)
    for k, item in enumerate(items):
        yield item, _between(report, k / n, (k + 1) / n)
        report((k + 1) / n)


def steps(report: Report, about: int) -> Step:
    """Return what a loop of unknown length calls at each step: half is said to be done after `about`, never all."""
    done = count(1)

    def step() -> None:
        n = next(done)
        report(n / (n + about))

    return step
