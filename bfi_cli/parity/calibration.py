"""What a file of `bfi calibrate` says of the air data of an aircraft: angle of zero lift, and tables of the scan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..decision.calibration import FEWEST_WINDOWS, calibration_document, check_digest, null_from, wrong_statistics
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..flightlog.phases import phases_of
from ..serialization import from_plain
from .record import record_of
from .residuals import RESIDUALS
from .scan import scan_window
from .thresholds import ParityTable
from .windows import LENGTHS_S, clean_up_time, configuration_changes, overlaps, windows_in
from .zero_lift import zero_lift_of

# Windows of a short flight follow each other more closely, so that there are enough for a table.
CLOSEST_S = 5.0
# rad; cambered wings and their incidence on the fuselage make a few degrees.
MOST_ZERO_LIFT = 0.35


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
        said = []
        if self.zero_lift_rad is not None:
            said.append(f"angle of attack of zero lift: {np.degrees(self.zero_lift_rad):.2f} deg")
        for table in self.tables:
            level = null_from({"largest": table.statistics}).threshold("largest", 0.01)
            names = ", ".join(table.residuals)
            said.append(
                f"{names}: {len(table.statistics)} windows of {table.length_s:g} s, 1 % false alarms above {level:.4g}"
            )
        return said or ["air data: too few windows for thresholds"]


def calibrate_air_data(logs: Sequence[FlightLog]) -> AirDataCalibration | None:
    """Return what healthy flights say, None where they have no air data that residuals could be made of.

    Windows in which flaps and gear move are left out. Of several flights, each is scanned with the angle of zero lift
    of all; tables with fewer windows than a threshold needs are not kept.
    """
    records, phases = [record_of(log) for log in logs], [phases_of(log) for log in logs]
    angles = [zero_lift_of(record, parts) for record, parts in zip(records, phases, strict=True)]
    known = [angle for angle in angles if angle is not None]
    zero_lift = float(np.mean(known)) if known else None
    found: dict[tuple[tuple[str, ...], float], list[float]] = {}
    for record, parts in zip(records, phases, strict=True):
        for length_s in LENGTHS_S:
            moved = configuration_changes(parts, clean_up_s=clean_up_time(parts, record))
            for step_s in (None, CLOSEST_S):
                windows = [one for one in windows_in(parts, length_s, step_s=step_s) if not overlaps(one, moved)]
                if len(windows) >= FEWEST_WINDOWS:
                    break
            for window in windows:
                scan = scan_window(record.between(*window), zero_lift=zero_lift)
                if scan is not None:
                    names = tuple(kind.name for kind in scan.kinds)
                    found.setdefault((names, length_s), []).append(scan.statistic)
    tables = tuple(
        ParityTable(
            residuals=names,
            length_s=length_s,
            knows_zero_lift=zero_lift is not None,
            statistics=np.sort(values),
            logs=tuple(Path(log.path).name for log in logs),
        )
        for (names, length_s), values in found.items()
        if len(values) >= FEWEST_WINDOWS
    )
    return AirDataCalibration(zero_lift_rad=zero_lift, tables=tables) if found else None


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
    found = from_plain(AirDataCalibration, document["air_data"], where=f"{where}: air_data")
    check_digest(document, where=where)
    wrong = [f"tables[{k}]: {why}" for k, table in enumerate(found.tables) if (why := _wrong_with(table))]
    angle = found.zero_lift_rad
    if angle is not None and not abs(angle) <= MOST_ZERO_LIFT:
        wrong.insert(0, f"zero_lift_rad is {angle:.4g}, not an angle of zero lift")
    if wrong:
        raise ConfigError(f"{where}: air_data: {wrong[0]}; run bfi calibrate again")
    return found


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
