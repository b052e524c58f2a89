"""The report of a file of `bfi calibrate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..decision.calibration import FEWEST_WINDOWS, check_calibration, null_of
from .content import ReportContent, Table, notes_of


def calibration_content(document: Mapping[str, Any], *, where: str = "the calibration") -> ReportContent:
    """Return what the report of a file of `bfi calibrate` holds: the thresholds of every table in it."""
    tables, rows = check_calibration(document, where=where), []
    for table in tables:
        settings, enough = table.settings, table.n_windows >= FEWEST_WINDOWS
        null = null_of(table, settings.shapes) if enough else None
        for shape in settings.shapes:
            limits = ("-", "-") if null is None else (f"{null.median[shape]:.4g}", f"{null.threshold(shape, 0.01):.4g}")
            rows.append((shape, str(table.n_windows), *limits, f"{settings.duration_s:g}", f"{settings.rate_hz:g}"))
    heads = ("shape", "windows", "median", "1 % false alarms above", "length, s", "rate, Hz")
    return ReportContent(
        category="Calibration of the onset scan",
        title=str(document["provenance"]["command"]),
        heading=f"{len(tables)} tables",
        verdict=f"{sum(table.n_windows for table in tables)} windows without a fault in {len(tables)} tables.",
        tables=(Table(name="thresholds", title="Thresholds", heads=heads, rows=tuple(rows)),),
        notes=notes_of(document),
    )
