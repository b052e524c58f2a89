"""What happens when in a flight, as lanes of a figure and rows of a table: phases, windows, segments and events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..report.content import Block, Lane, Shade, Table
from ..report.text import instant
from ..serialization import from_plain
from .phases import HOVER, MANOEUVRES, NO_AIRSPEED, PARTS, TRANSITION, Phase
from .quality import ExcitedWindow
from .record import Segment

Plain = Mapping[str, Any]

SHADES: Mapping[str, Shade] = {
    "ground": "grey",
    "take-off": "rose",
    "climb": "sky",
    "cruise": "white",
    "flight": "white",
    "descent": "green",
    "approach": "yellow",
    "landing": "violet",
    HOVER: "violet",
    TRANSITION: "rose",
    NO_AIRSPEED: "grey",
}
STATES: Mapping[str, Shade] = {"declared": "fault", "suspected": "suspect"}
# Of the width of the axes, what a letter takes.
LETTER = 0.0096
# Lanes of segments that overlap; a table has all of them.
MOST_LANES = 6
# Events that have a lane of their own; the table has all.
MOST_EVENTS = 8


def happenings(document: Plain) -> dict[str, Any]:
    """Return the phases, windows and segments of a document, none where it states none."""
    kinds: dict[str, Any] = {
        "phases": tuple[Phase, ...],
        "windows": tuple[ExcitedWindow, ...],
        "segments": tuple[Segment, ...],
    }
    return {key: from_plain(kind, document.get(key, []), where=key) for key, kind in kinds.items()}


def lanes_of(
    phases: Sequence[Phase],
    windows: Sequence[ExcitedWindow],
    segments: Sequence[Segment],
    events: Sequence[Plain],
    *,
    limits: tuple[float, float],
) -> tuple[Lane, ...]:
    """Return a lane for the parts of the flight, for each kind of manoeuvre, windows by rank, segments and events.

    Parameters
    ----------
    limits : of the time that is shown, s; what lies outside takes no room.
    """
    phases = [one for one in phases if shows(one, limits)]
    events = [one for one in events if one["onset_s"] <= limits[1] and (one["offset_s"] or limits[1]) >= limits[0]]
    rows: list[tuple[str, list[Block]]] = [("phase", bands_of(phases))]
    rows += [(kind, [_block("", one, "black") for one in phases if one.phase == kind]) for kind in MANOEUVRES]
    letter_s = LETTER * (limits[1] - limits[0])
    framed = [_block(str(one.rank), one, "outline") for one in windows if shows(one, limits)]
    named = [_block(one.label, one, "outline") for one in segments if shows(one, limits)]
    rows += [("window", blocks) for blocks in _apart(framed, letter_s)]
    rows += [("segment", blocks) for blocks in _apart(named, letter_s)[:MOST_LANES]]
    rows += [("event", _event(one)) for one in events[:MOST_EVENTS]]
    filled = [(label, blocks) for label, blocks in rows if blocks]
    # Of the lanes of one kind the first is named.
    named_once = [label if i == 0 or filled[i - 1][0] != label else "" for i, (label, _) in enumerate(filled)]
    return tuple(Lane(label=label, blocks=tuple(one)) for label, (_, one) in zip(named_once, filled, strict=True))


def bands_of(phases: Sequence[Phase]) -> list[Block]:
    """Return the parts of the flight as blocks that do not overlap."""
    return [_block(one.phase, one, SHADES[one.phase]) for one in phases if one.phase in SHADES]


def _ends(one: Phase | ExcitedWindow | Segment) -> tuple[float, float]:
    return (one.from_s, one.to_s) if isinstance(one, Phase) else (one.start_s, one.stop_s)


def shows(one: Phase | ExcitedWindow | Segment, limits: tuple[float, float]) -> bool:
    """Say whether a phase or window shares time with the limits."""
    low, high = _ends(one)
    return low < limits[1] and high > limits[0]


def _block(label: str, one: Phase | ExcitedWindow | Segment, shade: Shade) -> Block:
    low, high = _ends(one)
    return Block(label=label, low=low, high=high, shade=shade)


def _apart(blocks: Iterable[Block], letter_s: float) -> list[list[Block]]:
    """Return lanes of the blocks, each on the first on which it and the label within or beside it find room."""
    lanes: list[list[Block]] = []
    free: list[float] = []  # where the last block of each lane and its label end
    for block in sorted(blocks, key=lambda one: (one.low, one.high)):
        label_s = letter_s * (len(block.label) + 1.5)
        end = block.high if label_s < block.high - block.low else block.high + label_s
        lane = next((i for i, last in enumerate(free) if last <= block.low), len(lanes))
        if lane == len(lanes):
            lanes.append([])
            free.append(end)
        lanes[lane].append(block)
        free[lane] = end
    return lanes


def _event(one: Plain) -> list[Block]:
    """Return the block of an event; of short ones, told by `times_s`, one for each."""
    channels = ", ".join(one["channels"])
    label = one["name"] if not channels or channels in one["name"] else f"{one['name']} ({channels})"
    shade, end_s = STATES.get(one["state"], "suspect"), one["offset_s"]
    if times_s := one.get("times_s"):
        return [Block(label="" if k else label, low=t, high=t, shade=shade) for k, t in enumerate(times_s)]
    return [Block(label=label, low=one["onset_s"], high=one["onset_s"] if end_s is None else end_s, shade=shade)]


def phase_table(phases: Sequence[Phase]) -> list[Table]:
    """Return the table of the kinds of phases that there are: how often, how long in all; [] without phases."""
    rows = []
    for kind in (*PARTS, *MANOEUVRES):
        found = [one for one in phases if one.phase == kind]
        if found:
            total = sum(one.to_s - one.from_s for one in found)
            ends = (instant(found[0].from_s), instant(found[-1].to_s))
            rows.append((kind, str(len(found)), f"{total:.0f}", *ends))
    heads = ("phase", "times", "in all [s]", "first from [s]", "last to [s]")
    return [Table(name="phases", title="Phases of the flight", heads=heads, rows=tuple(rows))] if rows else []


def phase_columns(phases: Sequence[Phase]) -> dict[str, list[Any]]:
    """Return the columns of the CSV file of phases, a row each."""
    return {key: [getattr(one, key) for one in phases] for key in ("phase", "from_s", "to_s")}


def window_table(windows: Sequence[ExcitedWindow]) -> list[Table]:
    """Return the table of the windows to analyse, in order of their rank; [] without windows."""
    rows = tuple(
        (str(one.rank), instant(one.start_s), instant(one.stop_s), one.channel, str(one.moves))
        for one in sorted(windows, key=lambda one: one.rank)
    )
    heads = ("rank", "--from", "--to", "input", "moves")
    return [Table(name="windows", title="Windows to analyse", heads=heads, rows=rows)] if rows else []


def event_table(events: Sequence[Plain]) -> list[Table]:
    """Return the table of the events; [] without events."""
    rows = tuple(
        (
            one["name"],
            ", ".join(one["channels"]),
            one["state"],
            instant(one["onset_s"]),
            "" if one["offset_s"] is None else instant(one["offset_s"]),
            one["analysis"],
        )
        for one in events
    )
    heads = ("event", "channels", "state", "from [s]", "to [s]", "analysis")
    return [Table(name="events", title="Events", heads=heads, rows=rows)] if rows else []
