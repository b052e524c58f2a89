"""The rows of a text table as columns of numbers, clocks and dates.

Blocks of rows go through `numpy.loadtxt`; a column that it cannot read (clocks, dates, text among numbers) is read cell
by cell. A cell that does not fit its column is NaN, a row that does not fit the header is left out; both are counted.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from itertools import chain
from typing import Literal, TextIO

import numpy as np

from ..epoch import DAY_S
from ..errors import LogError
from ..notes import Note
from .raw import FloatArray

# A "moment" has a date and a time of an unknown zone, a "utc_moment" states its offset from UTC, which is taken out.
Kind = Literal["number", "clock", "date", "moment", "utc_moment"]
# Numbers, counted from 1, and texts of lines.
Block = tuple[Sequence[int], list[str]]

ABSENT = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
CLOCK = re.compile(r"(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")
DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
EPOCH = date(1970, 1, 1).toordinal()
NULS = re.compile("\0+")
# Characters. The longest lines are the JSON of the faults of a log; a row of 10 000 channels has 250 000.
LONGEST_LINE = 10**6
# Characters read at once. The first block is small: it tells which columns are numbers.
FIRST_BLOCK, BLOCK = 2**14, 2**19
# Share of the rows: with more rows of another length the header is that of another table. A damaged card loses single
# rows; a header that lacks or repeats a name makes every row odd.
MOST_RAGGED = 0.05
WHAT = {
    "clock": "a time of day",
    "date": "a date",
    "moment": "a date and time",
    "utc_moment": "a date and time with its offset from UTC",
}


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, quoted or not."""
    if '"' in line:
        try:
            return next(csv.reader([line], delimiter=delimiter))
        except csv.Error:
            pass
    return line.split(delimiter)


def with_commas(line: tuple[int, str]) -> tuple[int, str]:
    """Return number and text of a line with commas in place of the blanks between its columns."""
    return line[0], line[1] if "," in line[1] else ",".join(line[1].split())


class Lines:
    """The lines of a text that are neither empty nor comments, numbered: the first singly, the rest in blocks.

    Attributes
    ----------
    comments : lines that begin with "#", in order, as they are read.
    damaged : numbers of the lines that hold NUL bytes, which a recorder leaves that lost its power.
    spaced : whether blanks stand between the columns, for which commas are put in lines that are yet to be returned.
    """

    def __init__(self, path: str, file: TextIO) -> None:
        self.comments: list[str] = []
        self.damaged: list[int] = []
        self._path, self._file = path, file
        self._blocks = self._read()
        self._ahead: Block = ([], [])
        self.spaced = False

    def next(self) -> tuple[int, str] | None:
        """Return number and text of the next line, None after the last."""
        while not self._ahead[1]:
            block = next(self._blocks, None)
            if block is None:
                return None
            self._ahead = block
        numbers, texts = self._ahead
        self._ahead = numbers[1:], texts[1:]
        line = numbers[0], texts[0]
        return with_commas(line) if self.spaced else line

    def put_back(self, line: tuple[int, str] | None) -> None:
        """Return a line again, before the others."""
        if line is not None:
            numbers, texts = self._ahead
            self._ahead = [line[0], *numbers], [line[1], *texts]

    def blocks(self) -> Iterator[Block]:
        """Yield the lines that were not yet returned."""
        for numbers, texts in chain([self._ahead] if self._ahead[1] else [], self._blocks):
            yield numbers, [with_commas((0, text))[1] for text in texts] if self.spaced else texts

    def _read(self) -> Iterator[Block]:
        """Yield the lines in blocks.

        Raises
        ------
        LogError : a line of more than `LONGEST_LINE` characters.
        """
        rest, number, size = "", 1, FIRST_BLOCK
        while True:
            read = self._file.read(size)
            text, size = rest + read, BLOCK
            if "\0" in text:
                text = NULS.sub("\0", text)
            texts = text.split("\n")
            rest = texts.pop() if read else ""
            if max(len(rest), len(texts[0]) if texts else 0) > LONGEST_LINE:
                number += len(texts) if len(rest) > LONGEST_LINE else 0
                raise LogError(
                    f"{self._path}: line {number} is longer than {LONGEST_LINE} characters; write a line for each "
                    "sample, or export the log again"
                )
            numbers: Sequence[int] = range(number, number + len(texts))
            number += len(texts)
            if "#" in text or "\0" in text or "" in texts:
                kept = [(k, line) for k, line in zip(numbers, texts, strict=True) if self._is_row(k, line)]
                numbers, texts = [k for k, _ in kept], [line for _, line in kept]
            if texts:
                yield numbers, texts
            if not read:
                return

    def _is_row(self, number: int, text: str) -> bool:
        if text.lstrip().startswith("#"):
            self.comments.append(text)
            return False
        if "\0" in text:
            self.damaged.append(number)
            return False
        return bool(text.strip())


@dataclass(slots=True)
class Column:
    """A column while its rows are read.

    Attributes
    ----------
    name : "" for a column that is left out unread.
    kind : of most cells in the first block that holds any but text; None before that.
    n_known, n_odd : cells of that kind, and of another that are not empty; first_odd : line and text of the first.
    by_cell : whether numpy cannot read the column.
    """

    name: str
    kind: Kind | None = None
    n_known: int = 0
    n_odd: int = 0
    first_odd: tuple[int, str] = (0, "")
    by_cell: bool = False
    parts: list[FloatArray] = field(default_factory=list)

    @property
    def is_text(self) -> bool:
        """Whether at least half of what the column holds does not fit its kind."""
        return self.n_odd > 0 and self.n_odd >= self.n_known

    @property
    def values(self) -> FloatArray:
        """(n_rows,) numbers."""
        return np.concatenate([np.empty(0), *self.parts])

    @property
    def why_text(self) -> str:
        """Why the column is no signal, as `RawLog.left_out` states it."""
        line, cell = self.first_odd
        some = f" in {self.n_odd} of {self.n_odd + self.n_known} cells, the first '{cell}' in line {line},"
        return f"holds text{some if self.n_known else ''}"

    def add(self, values: FloatArray) -> None:
        """Add numbers, NaN where a cell is empty."""
        self.parts.append(values)
        known = int(np.count_nonzero(~np.isnan(values)))
        self.n_known += known
        if known and self.kind is None:
            self.kind = "number"

    def add_cells(self, numbers: Sequence[int], cells: Sequence[str], *, comma: bool) -> None:
        """Add cells of the lines of these numbers; clocks, dates and moments become seconds."""
        try:
            if self.kind in (None, "number") and not any("_" in cell for cell in cells):
                self.add(np.array([float(cell) for cell in cells]))
                return
        except ValueError:
            pass
        known = {cell: _read(cell.strip(), comma=comma) for cell in set(cells)}
        if self.kind is None:
            kinds = Counter(kind for cell in cells if (kind := known[cell][0]) is not None)
            self.kind = kinds.most_common(1)[0][0] if kinds else None
        fits = {cell: value for cell, (kind, value) in known.items() if kind is not None and kind == self.kind}
        self.add(np.array([fits.get(cell, math.nan) for cell in cells]))
        odd = [k for k, cell in enumerate(cells) if cell not in fits and cell.strip().lower() not in ABSENT]
        if odd and not self.n_odd:
            self.first_odd = numbers[odd[0]], cells[odd[0]].strip()[:40]
        self.n_odd += len(odd)
        self.by_cell = bool(odd) or self.kind not in (None, "number")


def _read(cell: str, *, comma: bool) -> tuple[Kind | None, float]:
    """Return the kind of a cell, None for text and for one that is empty, and its number."""
    if cell.lower() in ABSENT:
        return None, math.nan
    try:
        if "_" not in cell:  # which Python reads as a part of a number
            return "number", float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        pass
    if clock := CLOCK.fullmatch(cell):
        hours, minutes, seconds = clock[1], clock[2], clock[3].replace(",", ".")
        return "clock", 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
    try:
        if DATE.fullmatch(cell):
            return "date", DAY_S * (date.fromisoformat(cell).toordinal() - EPOCH)
        if DATE.match(cell):
            moment = datetime.fromisoformat(cell)
            if moment.tzinfo is None:
                return "moment", moment.replace(tzinfo=UTC).timestamp()
            return "utc_moment", moment.timestamp()
    except (ValueError, OverflowError):
        pass
    return None, math.nan


def _with_nan(texts: Sequence[str], delimiter: str) -> list[str]:
    """Return rows with "nan" in their empty cells."""
    filled = list(texts)
    codes = np.frombuffer("\n".join(["", *texts, ""]).encode(), dtype=np.uint8)
    is_end = codes == ord("\n")
    is_edge = is_end | (codes == ord(delimiter))
    empty = np.flatnonzero(is_edge[:-1] & is_edge[1:])
    for k in np.unique(np.searchsorted(np.flatnonzero(is_end), empty, side="right") - 1).tolist():
        filled[k] = delimiter.join(cell or "nan" for cell in filled[k].split(delimiter))
    return filled


class Table:
    """A table of named columns.

    Parameters
    ----------
    names : of the columns, "" for a column that nobody can name, which is not read.
    comma : whether a comma in a number is a decimal comma.
    """

    def __init__(self, path: str, names: Sequence[str], delimiter: str, *, comma: bool) -> None:
        self.path, self.delimiter, self.comma = path, delimiter, comma
        self.columns = [Column(name=name) for name in names]
        self.n_rows = 0
        self.notes: list[Note] = []
        self._before, self._width = 0, len(names)  # columns before the first name, and in all
        self._ragged: list[tuple[int, int]] = []
        self._last = 0
        sign = re.escape(delimiter)
        words = "|".join(re.escape(word) for word in sorted(ABSENT, key=len, reverse=True))
        self._absent = re.compile(rf"([{sign}\n]) *(?:{words}) *(?=[{sign}\n])", re.IGNORECASE)
        self._has_absent = False

    def read(self, lines: Lines) -> None:
        """Read all rows.

        Raises
        ------
        LogError : more than a few rows of another length than the header.
        """
        for numbers, texts in lines.blocks():
            if not self.n_rows:
                self._fit_header(texts)
            if not self._add_at_once(texts):
                self._add(*self._rows_of_one_length(numbers, texts))
            self._last = numbers[-1]
        if damaged := lines.damaged:
            self.notes.append(Note.limit(f"{len(damaged)} lines from line {damaged[0]} on hold NUL bytes: left out"))
        n = self._width
        if self._ragged and self._ragged[-1][0] == self._last and self._ragged[-1][1] < n and self.n_rows > 1:
            self.notes.append(Note.limit(f"line {self._last} is cut off and is left out"))
            self._ragged.pop()
        if self._ragged:
            line, length = self._ragged[0]
            if len(self._ragged) > MOST_RAGGED * self.n_rows:
                more = "" if len(self._ragged) == 1 else f", and {len(self._ragged)} lines are like it"
                raise LogError(
                    f"{self.path}: line {line} has {length} values, the header names {n} channels{more}; mend the line"
                )
            self.notes.append(
                Note.limit(
                    f"{len(self._ragged)} rows of another length than the header, the first in line {line}, are left "
                    "out"
                )
            )

    def require_numbers(self, names: Collection[str]) -> None:
        """Check that columns of these names are no text, and note the cells of the others that do not fit.

        Raises
        ------
        LogError : a column of `names` holds text.
        """
        for column in self.columns:
            if not column.n_odd:
                continue
            name, (line, cell) = column.name, column.first_odd
            what = WHAT.get(str(column.kind), "a number")
            if column.is_text and name in names:
                raise LogError(
                    f"{self.path}: line {line}, column '{name}': not {what}, got '{cell}'; mend the cell or empty it"
                )
            if not column.is_text:
                cells = "1 cell is" if column.n_odd == 1 else f"{column.n_odd} cells are"
                self.notes.append(
                    Note.limit(f"'{name}': {cells} not {what}, the first '{cell}' in line {line}: left out")
                )

    def _fit_header(self, texts: Sequence[str]) -> None:
        """Add columns without a name where the rows are longer than the header."""
        lengths = Counter(len(cells_of(text, self.delimiter)) for text in texts)
        n, (width, _) = self._width, lengths.most_common(1)[0]
        rows = [cells for text in texts if len(cells := cells_of(text, self.delimiter)) == width]
        if width <= n or all(not cell.strip() for row in rows for cell in row[n:]) or len(rows) < 2:
            return
        # R writes the names of the rows, in quotes, without a name above them.
        quoted = all(re.match(r'"[^"]*"', text) for text in texts)
        self._before = 1 if quoted and width == n + 1 else 0
        self._width, more = width, width - n - self._before
        place = "first" if self._before else f"last {more}" if more > 1 else "last"
        self.notes.append(
            Note.limit(f"the rows have {width} values and the header {n} names: the {place} of each row is left out")
        )

    def _add_at_once(self, texts: list[str]) -> bool:
        """Add rows that are all of the length of the header and hold nothing but numbers; False where they do not."""
        if len(self.columns) < self._width or any(column.by_cell or not column.name for column in self.columns):
            return False
        if texts[0].count(self.delimiter) != self._width - 1:
            return False
        values = self._numbers(texts, None)
        if values is None or values.shape != (len(texts), self._width):
            return False
        self.n_rows += len(texts)
        for column, numbers in zip(self.columns, values.T, strict=True):
            column.add(numbers)
        return True

    def _rows_of_one_length(self, numbers: Sequence[int], texts: list[str]) -> Block:
        """Return the rows of the length of the header, with their quotes taken off."""
        n, sign = self._width, self.delimiter
        counts = [text.count(sign) for text in texts]
        if counts.count(n - 1) == len(counts) and not any('"' in text for text in texts):
            return numbers, texts
        rows, places = [], []
        for number, text, count in zip(numbers, texts, counts, strict=True):
            if count != n - 1 or '"' in text:
                cells = cells_of(text, sign)
                if len(cells) != n and not (len(cells) == n + 1 and not cells[-1].strip()):
                    if text.strip():
                        self._ragged.append((number, len(cells)))
                    continue
                if '"' in text:
                    text = sign.join(cell.replace(sign, " ") for cell in cells)
            places.append(number)
            rows.append(text)
        return places, rows

    def _add(self, numbers: Sequence[int], texts: list[str]) -> None:
        if not texts:
            return
        self.n_rows += len(texts)
        named = [k for k, column in enumerate(self.columns) if column.name]
        at_once = [k for k in named if not self.columns[k].by_cell]
        values = self._numbers(texts, [self._before + k for k in at_once])
        if values is not None:
            for i, k in enumerate(at_once):
                self.columns[k].add(values[:, i])
            named = [k for k in named if self.columns[k].by_cell]
        if named:
            rows = [text.split(self.delimiter) for text in texts]
            for k in named:
                cells = [row[self._before + k] for row in rows]
                self.columns[k].add_cells(numbers, cells, comma=self.comma)

    def _numbers(self, texts: list[str], columns: Sequence[int] | None) -> FloatArray | None:
        """Return the numbers of some columns, (n_rows, n_columns), None where numpy cannot read one of them.

        Parameters
        ----------
        columns : None for all, of rows of one length, which numpy checks.
        """
        if columns is not None and not columns:
            return None

        def read(texts: list[str]) -> FloatArray:
            return np.loadtxt(texts, delimiter=self.delimiter, comments=None, usecols=columns, ndmin=2)

        if self.comma:
            texts = "\n".join(texts).replace(",", ".").split("\n")
        if not self._has_absent:
            try:
                return read(texts)
            except ValueError:
                pass
        texts = _with_nan(texts, self.delimiter)
        try:
            values = read(texts)
        except ValueError:
            try:
                values = read(self._absent.sub(r"\1nan", "\n".join(["", *texts, ""])).split("\n")[1:-1])
            except ValueError:
                return None
        self._has_absent = True
        return values
