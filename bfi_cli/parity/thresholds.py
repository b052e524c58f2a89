"""Tables of the parity scan's statistic on healthy windows, and the thresholds and p-values that follow.

One table for every set of residuals, window length, and whether the angle of zero lift is known; the statistic is the
largest over all faults and onsets. The shipped tables are counted on two flights of one aircraft: on another, whose own
windows mostly show more, the thresholds rise with them (`scaled`).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..decision.calibration import Null, null_from
from ..serialization import from_plain

FloatArray = NDArray[np.float64]

SHIPPED = Path(__file__).parent / "shipped.json"
# Of a table's length, by which a window may differ. With twice the length the statistics of the shipped tables grow by
# 1.7 in their upper tenth, with a tenth more by 8 %.
LENGTH_TOLERANCE = 0.1
# Where no table fits, the tail of the nearest counts as known from so few excesses. Chosen by hand: the threshold of
# one false alarm in a hundred rises by a quarter, that of one in ten thousand doubles. None fits a window in which a
# fault lasts, since columns for that take noise away as well. Of 469 windows of two flights without a fault, each of
# six faults left out, the largest has 0.69 of its threshold (1.44 by the table).
EXCESSES_UNFIT = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanKey:
    """What the statistic of a window depends on; `beside` whether faults that last are left out of it."""

    residuals: tuple[str, ...]
    length_s: float
    knows_zero_lift: bool
    beside: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParityTable:
    """The statistic on windows without a fault, (n_windows,), by what it depends on."""

    residuals: tuple[str, ...]
    length_s: float
    knows_zero_lift: bool
    statistics: FloatArray
    logs: tuple[str, ...]

    def fits(self, key: ScanKey) -> bool:
        alike = set(self.residuals) == set(key.residuals) and not key.beside
        known = self.knows_zero_lift == key.knows_zero_lift or "lift" not in key.residuals
        return alike and known and abs(self.length_s - key.length_s) <= LENGTH_TOLERANCE * key.length_s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Threshold:
    """What a window's statistic is held against.

    Attributes
    ----------
    level : above which a fault is declared; suspected : above which it is suspected.
    null : the distribution without one; scale : by which the table's statistics were raised.
    """

    level: float
    suspected: float
    null: Null
    scale: float = 1.0

    def p_value(self, statistic: float) -> float:
        """Return the probability of a healthy window to show as much."""
        return self.null.p_value(self.null.standardised("largest", statistic / self.scale))


@cache
def shipped_tables() -> tuple[ParityTable, ...]:
    """Return the tables that come with the program."""
    document = json.loads(SHIPPED.read_text(encoding="utf-8"))
    return from_plain(tuple[ParityTable, ...], document["tables"], where=str(SHIPPED))


def table_for(tables: Sequence[ParityTable], key: ScanKey) -> ParityTable | None:
    """Return the table that fits, None where none does."""
    return next((one for one in tables if one.fits(key)), None)


def _null_of(table: ParityTable, tables: Sequence[ParityTable]) -> Null:
    """Return the distribution of a table, with the tail that its residuals have in windows of all lengths.

    What exceeds the start of the tail, over that start, has the same mean at 60, 120 and 240 s (0.62, 0.87, 0.73 with
    all residuals of the two recorded flights), and the few long windows tell it badly. They lie over the same stretches
    as the short ones, so that as many excesses count as the length with the most has.
    """
    alike = (one for one in tables if one.residuals == table.residuals and one.logs == table.logs)
    tails = [
        null_from({"largest": one.statistics}).tail for one in alike if one.knows_zero_lift == table.knows_zero_lift
    ]
    relative = sum(one.k * one.mean / one.start for one in tails) / sum(one.k for one in tails)
    null = null_from({"largest": table.statistics})
    k = max(one.k for one in tails)
    return replace(null, tail=replace(null.tail, mean=relative * null.tail.start, k=k))


def threshold_of(
    tables: Sequence[ParityTable],
    key: ScanKey,
    *,
    false_alarm: float,
    suspicion: float | None = None,
    scale: float = 1.0,
) -> Threshold:
    """Return the threshold for a window.

    Parameters
    ----------
    false_alarm, suspicion : wanted probabilities of an alarm, and of a suspicion, in a healthy window; None for the
        same.
    scale : of the statistics of this flight against those of the tables.
    """
    rates = (false_alarm, false_alarm if suspicion is None else suspicion)
    table = table_for(tables, key)
    nearest = table or min(
        tables,
        key=lambda one: (
            len(set(one.residuals) ^ set(key.residuals)),
            abs(np.log(one.length_s / key.length_s)),
            one.knows_zero_lift != key.knows_zero_lift,
        ),
    )
    null = _null_of(nearest, tables)
    if table is None:
        null = replace(null, tail=replace(null.tail, k=min(null.tail.k, EXCESSES_UNFIT)))
    level, suspected = (scale * null.threshold("largest", rate) for rate in rates)
    return Threshold(level=level, suspected=min(level, suspected), null=null, scale=scale)
