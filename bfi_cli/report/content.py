"""The content of a report: a verdict, facts, tables, drawings and notes, as plain data for every rendering.

An analysis makes the content from its document; this package renders it on a terminal, as figures, as CSV files and as
HTML, so that all show the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..notes import Note
from ..quantities.text import SI, Units
from ..serialization import from_plain
from .first_screen import Screen

FloatArray = NDArray[np.float64]
# Lists or arrays of a CSV file by column.
Columns = Mapping[str, Any]
Style = Literal[
    "line",
    "dashed",
    "dotted",
    "wide",
    "points",
    "steps",
    "bars",
    "intervals",
    "faint_intervals",
    "boxes",
    "rows_green",
    "rows_orange",
    "rows_red",
]
Tone = Literal["fault", "no_fault", "inconclusive"]
# Colours of stretches of time, most of them light; "outline" is an empty frame, "fault" and "suspect" are bright.
Shade = Literal[
    "grey", "white", "sky", "green", "yellow", "rose", "violet", "blue", "black", "outline", "fault", "suspect"
]
# Labels of an axis and where they stand.
Ticks = tuple[tuple[str, float], ...]

# Points of a thinned curve: twice the pixels across a page at 150 dots per inch.
MAX_POINTS = 2000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One line of a panel.

    Attributes
    ----------
    label : in the legend, "" for none.
    x, y : (n,); NaN leaves a gap. In style "boxes" each box is six rising numbers at the same x: the 5, 25, 50, 75 and
        95 % quantiles and the largest value.
    style : "wide" is a broad grey line behind others; "intervals" and "faint_intervals" are points with horizontal
        error bars; "rows_..." are horizontal bars that end at x.
    low, high : (n,) ends of a band (line styles) or of error bars (points, bars, intervals), None for none.
    """

    label: str
    x: FloatArray
    y: FloatArray
    style: Style = "line"
    low: FloatArray | None = None
    high: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A shaded stretch of the x axis, from `low` to `high` (equal for a line)."""

    label: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A stretch of the x axis with its colour, from `low` to `high` (equal for an instant)."""

    label: str
    low: float
    high: float
    shade: Shade


@dataclass(frozen=True, slots=True, kw_only=True)
class Lane:
    """A row of blocks that do not overlap, named at its left."""

    label: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    x_label, y_label : with units in brackets.
    levels : (label, y) of horizontal dashed lines, thresholds.
    spans : stretches of the x axis.
    x_limits, y_limits : of the axes, None to fit the curves; y_limits from high to low for an axis that points down.
    linear_x, linear_y : the axis is linear up to this size and logarithmic beyond it, on both sides of 0.
    x_ticks, y_ticks : (label, place); () for automatic ticks.
    side_notes : (text, y) of notes to the right of the axes.
    height : relative to other panels.
    lanes : rows of blocks from top to bottom, in place of curves and numbers on the y axis; x_limits are needed.
    bands : blocks behind the curves, over the whole height; instants are upright lines.
    clock : x is a time in s, shown above the axes in hours, minutes and seconds too; midnight_s : the x at which the
        clock of the day shows 0:00, None where there is no such clock.
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
    x_limits: tuple[float, float] | None = None
    linear_x: float | None = None
    linear_y: float | None = None
    x_ticks: Ticks = ()
    y_ticks: Ticks = ()
    side_notes: Ticks = ()
    height: float = 1.0
    lanes: tuple[Lane, ...] = ()
    bands: tuple[Block, ...] = ()
    clock: bool = False
    midnight_s: float | None = None


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

    Panels of a `shared_x` have one x axis, numbered below the last of them.

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
    shared_x: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; `name` is that of its CSV file.

    Attributes
    ----------
    heads : one text per column.
    rows : texts, as many per row as there are heads.
    times_s : by row a time of the log, or the first and the last of a stretch, None where it is not known; () for a
        table without times; last_time : its last column with these times.
    """

    name: str
    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    times_s: tuple[tuple[float | None, ...], ...] = ()
    last_time: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportContent:
    """The report of an answer.

    Attributes
    ----------
    category : kind of document, "Onset of a fault".
    title : the log, or the name of the figure.
    heading, verdict : the answer in two or three words, and in a sentence; those of its `screen` where it has one.
    tone : decides the colour of the verdict, None where nothing is decided.
    lead : number of drawings, 0 or 1, that a page shows beside the verdict.
    facts : (name, value) rows.
    notes : for the reader, in their order.
    screen : printed first, None to print everything.
    zoom : drawings of curves and lanes for the page that can be zoomed, with more points than the figures.
    data : CSV files at full precision by name, lists or arrays by column, or a function that returns these when the
        file is written; they replace the file of a table with that name.
    """

    category: str
    title: str
    heading: str = ""
    verdict: str = ""
    tone: Tone | None = None
    lead: int = 0
    facts: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    notes: tuple[Note, ...] = ()
    screen: Screen | None = None
    zoom: tuple[Drawing, ...] = ()
    data: Mapping[str, Columns | Callable[[], Columns]] = field(default_factory=dict)

    def headed(self, screen: Screen) -> ReportContent:
        """Return the report with its first screen, which gives heading and verdict."""
        return replace(self, heading=screen.head, verdict=screen.text, screen=screen)


def notes_of(document: Mapping[str, Any], units: Units = SI) -> tuple[Note, ...]:
    """Return the notes of a document with their amounts in `units`; plain sentences of schema 2 are methods."""
    return shown_notes(from_plain(tuple[Note, ...], document["notes"], where="notes"), units)


def shown_notes(notes: Iterable[Note], units: Units) -> tuple[Note, ...]:
    """Return notes with the amounts in `units`."""
    return tuple(replace(note, text=units.sentence(note.text)) for note in notes)


def curve(
    label: str,
    x: Sequence[float] | FloatArray,
    y: Sequence[float] | FloatArray,
    *,
    style: Style = "line",
    low: Sequence[float] | FloatArray | None = None,
    high: Sequence[float] | FloatArray | None = None,
) -> Curve:
    """Return a curve of sequences of numbers."""
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


# Samples of a signal that are thinned at once, for memory.
AT_ONCE = 1_000_000


def thinned(x: FloatArray, *, max_points: int = MAX_POINTS) -> NDArray[np.intp]:
    """Return the samples to draw: the least and the greatest of each of `max_points / 2` equal stretches, in order.

    Parameters
    ----------
    x : (n_samples,), NaN where there is no value.

    Returns
    -------
    (n,) increasing indices, all of them where the signal is short; the first and the last are always among them.
    """
    if x.size <= max_points:
        return np.arange(x.size)
    stretch = -(-x.size // (max_points // 2))
    at_once = max(1, AT_ONCE // stretch) * stretch
    kept = [np.array([0, x.size - 1])]
    for start in range(0, x.size, at_once):
        part = x[start : start + at_once]
        table = np.concatenate([part, np.full(-part.size % stretch, np.nan)]).reshape(-1, stretch)
        unknown, first = np.isnan(table), start + np.arange(0, table.size, stretch)
        for extreme, other in ((np.argmin, np.inf), (np.argmax, -np.inf)):
            kept.append(first + extreme(np.where(unknown, other, table) if unknown.any() else table, axis=1))
    return np.unique(np.concatenate(kept))
