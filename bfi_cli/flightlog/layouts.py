"""Headers of tables of text: names and units of the columns, and the recorder whose layout they have.

A row of `LAYOUTS` says how the header of a recorder is recognised. What its columns are stands in the table of
`topics`, by names that are compared without regard to case and punctuation.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..errors import LogError
from ..quantities.channels import si_unit, split_unit
from .cells import ABSENT, Lines, cells_of, with_commas
from .raw import ReadRequest, fits, require_few
from .record import Track
from .topics import RECORDERS, Recorder, maps_of

DELIMITERS = ("|", ";", "\t")  # the first that stands in the header and in the row below it; else a comma
# Garmin's first line; the line of units below it is a comment too.
AIRFRAME = "#airframe_info"
# Short names of a G3X that a G1000 has for another channel: the true track here, a magnetic one there.
AMBIGUOUS = frozenset({"TRK"})
# X-Plane pads the two halves of a name to five characters: "_Vind,_kias", "alpha,__deg".
XPLANE = re.compile(r"[^,|]{5},[^,|]{5}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """A recorder, and whether the names of a header are those of its table."""

    recorder: Recorder
    is_header: Callable[[Sequence[str]], bool]


def _has(name: str) -> Callable[[Sequence[str]], bool]:
    return lambda names: name in map(plain_name, names)


# The first that fits. Garmin: G1000, Perspective, NXi, G3X, GDU 460, TXi, where its first line is lost. Dynon: logs of
# SkyView and HDX. X-Plane: `Data.txt`. INAV: `blackbox_decode`. FlightGear: the logger, and `playback`.
LAYOUTS = (
    Header(recorder="garmin", is_header=_has("lcl_date")),
    Header(recorder="dynon", is_header=_has("session_time")),
    Header(recorder="xplane", is_header=lambda names: 2 * sum(map(bool, map(XPLANE.fullmatch, names))) > len(names)),
    Header(recorder="inav", is_header=_has("loopiteration")),
    Header(recorder="flightgear", is_header=lambda names: any(name.startswith("/") for name in names)),
    Header(recorder="flightgear", is_header=_has("airspeed_indicator_indicated_speed_kt")),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Heading:
    """The header of a table.

    Attributes
    ----------
    names, units : of the columns, "" for one that is left out, the units that are known.
    delimiter : between the columns.
    recorder : whose layout it is, None for no known one.
    left_out : by name or place why a column is left out.
    """

    names: tuple[str, ...]
    units: tuple[str | None, ...]
    delimiter: str
    recorder: Recorder | None
    left_out: dict[str, str]


def plain_name(name: str) -> str:
    """Return a name in lower case, with one "_" for each run of other characters than letters and digits."""
    return re.sub(r"[^0-9a-z]+", "_", name.lower()).strip("_")


def heading_of(path: str, lines: Lines, asked: ReadRequest) -> Heading:
    """Return the header of a table and leave its first row the next of the lines.

    Raises
    ------
    LogError : no header, or names that do not fit the columns or the options.
    """
    header = lines.next()
    if header is None:
        raise LogError(f"{path}: no header line, the file holds no text but comments; give a log with channels")
    second = lines.next()
    if _is_spaced(header[1] if asked.columns or second is None else second[1]):
        lines.spaced = True
        header, second = with_commas(header), second and with_commas(second)
    both = header[1], header[1] if second is None else second[1]
    delimiter = next((sign for sign in DELIMITERS if all(sign in line for line in both)), ",")
    if asked.columns:
        lines.put_back(second)
        header, second = (0, _named(path, header, asked.columns, delimiter)), header
    comments = iter(lines.comments)
    garmin = any(text.startswith(AIRFRAME) for text in comments)
    below = next(comments, None)
    if garmin and second is not None and (joined := _two_headers(header[1], second[1], delimiter)):
        header, second = (second[0], joined), lines.next()
    cells = _cells(path, *header, delimiter=delimiter)
    stated = None
    if below is not None:
        stated = _units(below.lstrip("#"), delimiter, len(cells))
    elif second is not None and (stated := _units(second[1], delimiter, len(cells))):
        second = lines.next()
    lines.put_back(second)
    names, left_out = _names(path, [name for name, _ in cells], asked)
    return Heading(
        names=names,
        units=tuple(
            unit or stated_unit for (_, unit), stated_unit in zip(cells, stated or [None] * len(cells), strict=True)
        ),
        delimiter=delimiter,
        recorder="garmin" if garmin else next((layout.recorder for layout in LAYOUTS if layout.is_header(names)), None),
        left_out=left_out,
    )


def with_channels(columns: Sequence[Track], recorder: Recorder) -> list[Track]:
    """Return the columns of a recorder with the channels of its table.

    Of several columns for a channel the first of the table is it. A column that the table has without a channel is
    none. The unit is that of the file where the channel can have it, else that of the table, with its scale.
    """
    places: dict[str, int] = {}
    for i, column in enumerate(columns):
        places.setdefault(plain_name(column.source), i)
    made, taken = list(columns), set[str]()
    for row in maps_of(recorder):
        field = plain_name(row.field)
        if field not in places or row.channel in taken:
            continue
        i = places.pop(field)
        column = made[i]
        if not row.channel:
            made[i] = replace(column, channel="", why=f"no channel by the table of {RECORDERS[recorder]}")
            continue
        taken.add(row.channel)
        is_stated = column.unit is not None and si_unit(column.unit) is not None and fits(row.channel, column.unit)
        scale = math.copysign(1.0, row.scale) if is_stated else row.scale
        made[i] = replace(
            column,
            channel=row.channel,
            why=f"by the table of {RECORDERS[recorder]}",
            unit=column.unit if is_stated else row.unit,
            unit_from=column.unit_from if is_stated else f"table of {RECORDERS[recorder]}",
            values=scale * column.values + (0.0 if is_stated else row.offset),
        )
    return made


def _is_spaced(line: str) -> bool:
    """Say whether a line holds several numbers with blanks between them."""
    cells = line.split()
    return len(cells) > 1 and not any(sign in line for sign in ",;\t|") and all(map(_is_number, cells))


def _named(path: str, first: tuple[int, str], named: Sequence[str], delimiter: str) -> str:
    """Return a header line of the names that `--columns` gives to a table without one."""
    cells = cells_of(first[1], delimiter)
    if not all(_is_number(cell) or cell.strip().lower() in ABSENT for cell in cells):
        raise LogError(f"{path}: line {first[0]} is a header; leave out --columns, or map its names with --channel")
    if len(cells) != len(named):
        raise LogError(f"{path}: line {first[0]} has {len(cells)} columns, --columns names {len(named)}; name them all")
    return delimiter.join(named)


def _two_headers(upper: str, lower: str, delimiter: str) -> str | None:
    """Return the header of a Garmin G3X: the short names of the lower line, the long ones of the upper where these are
    blank or `AMBIGUOUS`, with the units of the upper line; None of a line that is no second header.
    """
    long, short = (cells_of(line, delimiter) for line in (upper, lower))
    short += [""] * (len(long) - len(short))
    if len(long) != len(short) or any(map(_is_number, short)) or not any(map(str.strip, short)):
        return None
    names = []
    for label, brief in zip(long, short, strict=True):
        name, unit = split_unit(label)
        name = name if brief.strip() in AMBIGUOUS else brief.strip() or name
        names.append(f"{name} [{unit}]" if unit else name)
    return delimiter.join(names)


def _units(line: str, delimiter: str, count: int) -> list[str | None] | None:
    """Return the units of a line of units, None for any other line; a unit that is not known is None."""
    cells = [cell.strip().strip("[]()").strip() for cell in cells_of(line, delimiter)]
    stated = [cell for cell in cells[:count] if cell]
    known = {cell for cell in stated if cell != "-" and si_unit(cell) is not None}
    if not stated or any(map(_is_number, stated)) or 2 * sum(cell in known for cell in stated) < len(stated):
        return None
    return [cell if cell in known else None for cell in cells[:count]] + [None] * (count - len(cells))


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _cells(path: str, line: int, text: str, *, delimiter: str) -> list[tuple[str, str | None]]:
    """Return name and unit of each cell of a header.

    Raises
    ------
    LogError : the line holds numbers.
    """
    cells = [cell.strip() for cell in cells_of(text, delimiter)]
    if cells and not cells[-1]:
        cells.pop()
    if any(map(_is_number, cells)):
        raise LogError(
            f"{path}: no header, line {line} holds numbers; write the channels' names above them, or give --columns"
        )
    require_few(path, len(cells), "columns")
    return list(map(split_unit, cells))


def _names(path: str, named: Sequence[str], asked: ReadRequest) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the names of the columns, and by name or place why a column is left out.

    A column that is left out, because it has no name or that of one before it, has the name "".

    Raises
    ------
    LogError : several columns have a name that an option mentions.
    """
    names, places, left_out = list[str](), dict[str, int](), dict[str, str]()
    for i, name in enumerate(named, start=1):
        if name in places and name in asked.sources:
            raise LogError(f"{path}: columns {places[name]} and {i} are both named '{name}'; rename one of them")
        if not name:
            left_out[f"column {i}"] = "has no name"
        elif name in places:
            left_out[f"column {i}"] = f"is a second '{name}'"
        names.append("" if name in places else name)
        places.setdefault(name, i)
    return tuple(names), left_out
