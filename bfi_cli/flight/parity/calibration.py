"""Tables of the parity scan's statistic on healthy windows, shipped or of `bfi calibrate`, and what follows from them.

One table for every set of residuals, window length, and whether the angle of zero lift is known; the statistic is the
largest over all faults and onsets. The shipped tables are counted on two flights of one aircraft: on another, whose own
windows mostly show more, the thresholds rise with them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...decision.calibration import (
    FEWEST_WINDOWS,
    Null,
    calibration_document,
    check_digest,
    null_from,
    wrong_statistics,
)
from ...errors import ConfigError
from ...flightlog import FlightLog
from ...flightlog.phases import phases_of
from ...kernels import FloatArray
from ...serialization import from_plain
from .record import record_of
from .residuals import RESIDUALS
from .scan import scan_window
from .windows import LENGTHS_S, configuration_changes, overlaps, windows_in, zero_lift_of

# Windows of a short flight follow each other more closely, so that there are enough for a table.
CLOSEST_S = 5.0
# rad; cambered wings and their incidence on the fuselage make a few degrees.
MOST_ZERO_LIFT = 0.35
SHIPPED = Path(__file__).parent / "shipped.json"
# LENGTH_TOLERANCE: share of a table's length by which a window may differ. With twice the length the statistics grow by
# 1.7 in their upper tenth, with a tenth more by 8 %.
LENGTH_TOLERANCE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class AirDataCalibration:
    """The air data of an aircraft without a fault.

    Attributes
    ----------
    zero_lift_rad : angle of attack of zero lift, None where the flights do not tell it.
    tables : of the parity scan.
    """

    zero_lift_rad: float | None
    tables: tuple[ParityTable, ...]

    def lines(self) -> list[str]:
        """Return what a reader is told of it."""
        lines = []
        if self.zero_lift_rad is not None:
            lines.append(f"angle of attack of zero lift: {np.degrees(self.zero_lift_rad):.2f} deg")
        for table in self.tables:
            level = null_from({"largest": table.statistics}).threshold("largest", 0.01)
            names = ", ".join(table.residuals)
            lines.append(
                f"{names}: {len(table.statistics)} windows of {table.length_s:g} s, 1 % false alarms above {level:.4g}"
            )
        return lines or ["air data: too few windows for thresholds"]


def calibrate_air_data(logs: Sequence[FlightLog]) -> AirDataCalibration | None:
    """Return what healthy flights say, None where they have no air data that residuals could be made of.

    Windows in which flaps and gear move are left out. Of several flights, each is scanned with the angle of zero lift
    of all; tables with fewer windows than a threshold needs are not kept.
    """
    flights = [(record_of(log), phases_of(log)) for log in logs]
    known = [angle for record, phases in flights if (angle := zero_lift_of(record, phases)) is not None]
    zero_lift = float(np.mean(known)) if known else None
    statistics: dict[tuple[tuple[str, ...], float], list[float]] = {}
    for record, phases in flights:
        moved = configuration_changes(phases, record)
        for length_s in LENGTHS_S:
            for step_s in (None, CLOSEST_S):
                every = windows_in(phases, length_s, step_s=step_s)
                windows = [window for window in every if not overlaps(window, moved)]
                if len(windows) >= FEWEST_WINDOWS:
                    break
            for window in windows:
                scan = scan_window(record.between(*window), zero_lift=zero_lift)
                if scan is not None:
                    names = tuple(kind.name for kind in scan.kinds)
                    statistics.setdefault((names, length_s), []).append(scan.statistic)
    tables = tuple(
        ParityTable(
            residuals=names,
            length_s=length_s,
            knows_zero_lift=zero_lift is not None,
            statistics=np.sort(values),
            logs=tuple(Path(log.path).name for log in logs),
        )
        for (names, length_s), values in statistics.items()
        if len(values) >= FEWEST_WINDOWS
    )
    return AirDataCalibration(zero_lift_rad=zero_lift, tables=tables) if statistics else None


def load_air_data(path: str | Path) -> AirDataCalibration:
    """Return the air data of a file made by `bfi calibrate`.

    Raises
    ------
    ConfigError : it cannot be read, is something else, or holds none.
    """
    return air_data_in(calibration_document(path), where=str(path))


def air_data_in(document: Mapping[str, Any], *, where: str) -> AirDataCalibration:
    """Return the air data of a document of `bfi calibrate`, its keys and its numbers checked.

    Raises
    ------
    ConfigError : it holds none, or what no scan counts.
    """
    if not document.get("air_data"):
        raise ConfigError(f"{where}: holds no air data; run bfi calibrate again on flights that have them")
    air_data = from_plain(AirDataCalibration, document["air_data"], where=f"{where}: air_data")
    check_digest(document, where=where)
    wrong = [f"tables[{k}]: {why}" for k, table in enumerate(air_data.tables) if (why := _wrong_with(table))]
    angle = air_data.zero_lift_rad
    if angle is not None and not abs(angle) <= MOST_ZERO_LIFT:
        wrong.insert(0, f"zero_lift_rad is {angle:.4g}, not an angle of zero lift")
    if wrong:
        raise ConfigError(f"{where}: air_data: {wrong[0]}; run bfi calibrate again")
    return air_data


def _wrong_with(table: ParityTable) -> str | None:
    """Return in what the key of a table, or its numbers, make no sense."""
    known = {kind.name for kind in RESIDUALS}
    if not table.residuals or not set(table.residuals) <= known:
        return f"residuals is {', '.join(table.residuals) or 'empty'}, known: {', '.join(sorted(known))}"
    if not (np.isfinite(table.length_s) and table.length_s > 0.0):
        return f"length_s is {table.length_s}, not a positive number"
    if table.statistics.ndim == 1 and np.any(np.diff(table.statistics) < 0.0):
        return "its statistics do not rise"
    wrong = wrong_statistics(table.statistics)
    return None if wrong is None else f"statistics: {wrong}"


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
    return next((table for table in tables if table.fits(key)), None)


def _null_of(table: ParityTable, tables: Sequence[ParityTable]) -> Null:
    """Return the distribution of a table, with the tail that its residuals have in windows of all lengths.

    What exceeds the start of the tail, over that start, has the same mean at 60, 120 and 240 s (0.62, 0.87, 0.73 with
    all residuals of the two recorded flights), and the few long windows tell it badly. They lie over the same stretches
    as the short ones, so that as many excesses count as the length with the most has.
    """
    alike = (other for other in tables if other.residuals == table.residuals and other.logs == table.logs)
    tails = [
        null_from({"largest": other.statistics}).tail
        for other in alike
        if other.knows_zero_lift == table.knows_zero_lift
    ]
    relative = sum(tail.k * tail.mean / tail.start for tail in tails) / sum(tail.k for tail in tails)
    null = null_from({"largest": table.statistics})
    k = max(tail.k for tail in tails)
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
        key=lambda candidate: (
            len(set(candidate.residuals) ^ set(key.residuals)),
            abs(np.log(candidate.length_s / key.length_s)),
            candidate.knows_zero_lift != key.knows_zero_lift,
        ),
    )
    null = _null_of(nearest, tables)
    if table is None:
        # None fits a window in which a fault lasts either, since columns for that take noise away as well: of 469
        # windows of two flights without a fault, each of six faults left out, the largest has 0.69 of its threshold,
        # 1.44 by the table itself.
        null = replace(null, tail=null.tail.widened)
    level, suspected = (scale * null.threshold("largest", rate) for rate in rates)
    return Threshold(level=level, suspected=min(level, suspected), null=null, scale=scale)
