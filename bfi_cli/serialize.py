"""Documents and tables as the text of files: JSON and CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .files import MARK
from .plain import to_plain
from .printable import printable

__all__ = ["csv_lines", "to_csv", "to_json", "without_series"]

# Keys of what has an entry per sample or onset: gigabytes for a day at 100 Hz. The drawings are those of an exhibit.
SERIES = ("series", "profile", "drawings")


def to_json(document: object, *, indent: int | None = 1, ascii_only: bool = False) -> str:
    r"""Return a document as JSON text; dataclasses and arrays become objects and lists, NaN and infinities null.

    Letters of any script stand as they are, what is not printable as `\u001b`: the text can be shown, and reads back
    as it was.

    Parameters
    ----------
    indent : None for everything on one line without blanks.
    ascii_only : escape letters of other scripts too.
    """
    separators = (",", ":") if indent is None else None
    text = json.dumps(
        to_plain(document), indent=indent, separators=separators, ensure_ascii=ascii_only, allow_nan=False
    )
    if text.isascii() and "\x7f" not in text:  # JSON itself escapes the other controls; most documents end here
        return text
    return text.translate({ord(c): json.dumps(c)[1:-1] for c in set(text) if c != "\n" and not c.isprintable()})


def without_series(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document without what has an entry per sample or onset."""
    return {
        key: without_series(value) if key == "exhibit" else value
        for key, value in document.items()
        if key not in SERIES
    }


def to_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """Return the CSV file of a table; its first line says that this program wrote it."""
    return f"{MARK}\n{csv_lines([columns])}{csv_lines(rows)}".encode()


def csv_lines(rows: Iterable[Sequence[object]]) -> str:
    """Return rows of cells as CSV text; None and numbers that are not finite are empty, text is made printable."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return printable(value) if isinstance(value, str) else value
