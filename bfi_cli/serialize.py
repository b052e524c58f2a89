"""JSON and CSV text of a document."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence

from .plain import to_plain
from .printable import printable

__all__ = ["to_csv", "to_json"]


def to_json(document: object, *, indent: int | None = 1) -> str:
    r"""Return a document as JSON text; dataclasses and arrays become objects and lists, NaN and infinities null.

    Letters of any script stand as they are, what is not printable as `\u001b`: the text can be shown, and reads back
    as it was.

    Parameters
    ----------
    indent : None for everything on one line without blanks.
    """
    separators = (",", ":") if indent is None else None
    text = json.dumps(to_plain(document), indent=indent, separators=separators, ensure_ascii=False, allow_nan=False)
    if text.isascii() and "\x7f" not in text:  # JSON itself escapes the other controls; most documents end here
        return text
    return text.translate({ord(c): json.dumps(c)[1:-1] for c in set(text) if c != "\n" and not c.isprintable()})


def to_csv(rows: Iterable[Sequence[object]]) -> str:
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
