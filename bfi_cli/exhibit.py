"""What an answer shows its reader: a verdict, facts, tables, drawings, notes, as plain data that any rendering takes.

One exhibit becomes the tables of a terminal, the figures, the CSV files and the HTML report, so that every command
shows the same things in every place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Curve", "Drawing", "Exhibit", "HeatMap", "Panel", "Span", "Table", "curve"]

FloatArray = NDArray[np.float64]
Style = Literal["line", "dashed", "dotted", "points", "steps", "bars"]
Tone = Literal["fault", "no_fault", "not_identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One line of a panel.

    Attributes
    ----------
    label : in the legend, "" for none.
    x, y : (n,); NaN leaves a gap.
    low, high : (n,) ends of a band (line styles) or of error bars (points, bars), None for none.
    """

    label: str
    x: FloatArray
    y: FloatArray
    style: Style = "line"
    low: FloatArray | None = None
    high: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A stretch of the x axis that stands out, from `low` to `high` (equal for a line)."""

    label: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    x_label, y_label : with units in brackets.
    levels : (label, y) of horizontal dashed lines, thresholds.
    spans : stretches of the x axis.
    y_limits : of the axis, None to fit what is drawn.
    """

    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    title: str = ""
    log_x: bool = False
    log_y: bool = False
    levels: tuple[tuple[str, float], ...] = ()
    spans: tuple[Span, ...] = ()
    y_limits: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeatMap:
    """A matrix of numbers, each written in its cell; NaN is left empty.

    Attributes
    ----------
    values : one row of numbers per name in `rows`, as many as there are `columns`.
    label : of the colour bar, with the unit.
    """

    title: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    values: tuple[FloatArray, ...]
    label: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """One figure: panels below each other (`across` side by side), then heat maps.

    Attributes
    ----------
    name : of its files, lower case with underscores.
    caption : what is seen, as a flight-test report prints it.
    """

    name: str
    caption: str
    panels: tuple[Panel, ...] = ()
    heat_maps: tuple[HeatMap, ...] = ()
    across: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; `name` is that of its CSV file.

    Attributes
    ----------
    heads : one text per column.
    rows : texts, as many per row as there are heads.
    """

    name: str
    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Exhibit:
    """An answer, laid out.

    Attributes
    ----------
    kicker : what kind of document it is, "Onset of a fault".
    title : what it is about, the log or the figure's name.
    heading, verdict : the answer in two or three words, and in a sentence.
    tone : how the verdict is coloured, None where nothing is decided.
    facts : (name, value) rows.
    notes : sentences for the reader.
    """

    kicker: str
    title: str
    heading: str
    verdict: str
    tone: Tone | None = None
    facts: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    notes: tuple[str, ...] = ()


def curve(
    label: str,
    x: Sequence[float] | FloatArray,
    y: Sequence[float] | FloatArray,
    *,
    style: Style = "line",
    low: Sequence[float] | FloatArray | None = None,
    high: Sequence[float] | FloatArray | None = None,
) -> Curve:
    """Return a curve of any sequences of numbers."""
    return Curve(
        label=label,
        x=_numbers(x),
        y=_numbers(y),
        style=style,
        low=None if low is None else _numbers(low),
        high=None if high is None else _numbers(high),
    )


def _numbers(values: Sequence[float] | FloatArray) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
