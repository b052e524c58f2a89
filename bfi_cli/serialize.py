"""Documents and tables as the text of files: JSON and CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .encoding import shown
from .files import MARK
from .plain import to_plain

__all__ = ["to_csv", "to_json", "without_series"]

# Keys of what has an entry per sample or onset: gigabytes for a day at 100 Hz. The drawings are those of an exhibit.
SERIES = ("series", "profile", "drawings")


def to_json(document: Mapping[str, Any], *, ascii_only: bool = False) -> str:
    """Return a document as JSON text; dataclasses and arrays become objects and lists, NaN and infinities null."""
    return json.dumps(to_plain(document), indent=1, ensure_ascii=ascii_only, allow_nan=False)


def without_series(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document without what has an entry per sample or onset."""
    return {
        key: without_series(value) if key == "exhibit" else value
        for key, value in document.items()
        if key not in SERIES
    }


def to_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """Return the CSV file of a table; its first line says that this program wrote it, absent numbers are empty."""
    text = io.StringIO()
    text.write(f"{MARK}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return shown(text.getvalue()).encode()


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return str(value).lower()
    return None if isinstance(value, float) and not math.isfinite(value) else value
