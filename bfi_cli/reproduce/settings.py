"""What every reproduction is given, and the table they all show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..exhibit import Table
from ..flightlog import FlightLog

__all__ = ["Settings", "comparison"]


def _silent(_done: int, _total: int) -> None:
    pass


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Settings:
    """How a figure is to be made.

    Attributes
    ----------
    log : fault-free record to use in place of the simulated one, None for the default.
    quick : few trials, short sweeps: seconds instead of minutes, for tests.
    trials : per point of a Monte Carlo figure, None for the published number (or a few where quick).
    seed : of all random numbers.
    workers : processes of this machine.
    choices : "key=value" for what a reproduction leaves open; f16-table2 has some.
    report : told how much is done, (done, total).
    """

    log: FlightLog | None = None
    quick: bool = False
    trials: int | None = None
    seed: int = 0
    workers: int = 1
    choices: tuple[str, ...] = ()
    report: Callable[[int, int], None] = _silent

    def trials_or(self, published: int, quick: int) -> int:
        """Return how many trials to run."""
        return self.trials if self.trials is not None else quick if self.quick else published


def comparison(rows: Sequence[tuple[str, str, str]]) -> Table:
    """Return the table of (what, published, ours) that stands first in every reproduction."""
    heads = ("quantity", "published", "ours")
    return Table(name="comparison", title="Published and ours", heads=heads, rows=tuple(rows))
