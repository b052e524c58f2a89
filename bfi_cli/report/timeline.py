"""The timeline of a flight as lanes of a figure and rows of tables: phases, windows, segments and events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..flightlog.excitation import ExcitedWindow
from ..flightlog.phases import HOVER, MANOEUVRES, NO_AIRSPEED, PARTS, TRANSITION, Phase
from ..flightlog.record import Segment
from ..quantities.text import instant
from .content import Block, Lane, Shade, Table

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
# Width of a letter over the width of the axes.
LETTER = 0.0096
# Lanes of segments that overlap; a table has all of them.
MOST_LANES = 6
# Events that have a lane of their own; the table has all.
MOST_EVENTS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Happening:
    """An event with a lane: a fault from its onset to its end, or short faults that begin at `times_s`."""

    label: str
    state: str
    onset_s: float
    offset_s: float | None
    times_s: tuple[float, ...] = ()

    @property
    def blocks(self) -> list[Block]:
        """Its stretch of time, or an instant for each short fault, of which the first has the label."""
        shade = STATES.get(self.state, "suspect")
        if self.times_s:
            labels = [self.label, *[""] * (len(self.times_s) - 1)]
            return [Block(label=name, low=t, high=t, shade=shade) for name, t in zip(labels, self.times_s, strict=True)]
        end_s = self.onset_s if self.offset_s is None else self.offset_s
        return [Block(label=self.label, low=self.onset_s, high=end_s, shade=shade)]


def lanes_of(
    phases: Sequence[Phase],
    windows: Sequence[ExcitedWindow],
    segments: Sequence[Segment],
    events: Sequence[Happening],
    *,
    limits: tuple[float, float],
) -> tuple[Lane, ...]:
    """Return a lane for the parts of the flight, for each kind of manoeuvre, windows by rank, segments and events.

    Parameters
    ----------
    limits : first and last time shown, s; nothing outside takes up a lane.
    """
    phases = [phase for phase in phases if shows(phase, limits)]
    events = [event for event in events if event.onset_s <= limits[1] and (event.offset_s or limits[1]) >= limits[0]]
    rows: list[tuple[str, list[Block]]] = [("phase", bands_of(phases))]
    rows += [(kind, [_block("", phase, "black") for phase in phases if phase.phase == kind]) for kind in MANOEUVRES]
    letter_s = LETTER * (limits[1] - limits[0])
    framed = [_block(str(window.rank), window, "outline") for window in windows if shows(window, limits)]
    named = [_block(segment.label, segment, "outline") for segment in segments if shows(segment, limits)]
    rows += [("window", blocks) for blocks in _apart(framed, letter_s)]
    rows += [("segment", blocks) for blocks in _apart(named, letter_s)[:MOST_LANES]]
    rows += [("event", event.blocks) for event in events[:MOST_EVENTS]]
    filled = [(label, blocks) for label, blocks in rows if blocks]
    # Only the first lane of a kind has a label.
    named_once = [label if i == 0 or filled[i - 1][0] != label else "" for i, (label, _) in enumerate(filled)]
    return tuple(Lane(label=label, blocks=tuple(blocks)) for label, (_, blocks) in zip(named_once, filled, strict=True))


def lines_at(state: str, times_s: Iterable[float | None]) -> list[Block]:
    """Return upright lines at the onset and the end of an event, as far as they are known."""
    return [
        Block(label="", low=time_s, high=time_s, shade=STATES.get(state, "suspect"))
        for time_s in times_s
        if time_s is not None
    ]


def bands_of(phases: Sequence[Phase]) -> list[Block]:
    """Return the parts of the flight as blocks that do not overlap."""
    return [_block(phase.phase, phase, SHADES[phase.phase]) for phase in phases if phase.phase in SHADES]


def _ends(stretch: Phase | ExcitedWindow | Segment) -> tuple[float, float]:
    return (stretch.from_s, stretch.to_s) if isinstance(stretch, Phase) else (stretch.start_s, stretch.stop_s)


def shows(stretch: Phase | ExcitedWindow | Segment, limits: tuple[float, float]) -> bool:
    """Say whether a phase or window shares time with the limits."""
    low, high = _ends(stretch)
    return low < limits[1] and high > limits[0]


def _block(label: str, stretch: Phase | ExcitedWindow | Segment, shade: Shade) -> Block:
    low, high = _ends(stretch)
    return Block(label=label, low=low, high=high, shade=shade)


def _apart(blocks: Iterable[Block], letter_s: float) -> list[list[Block]]:
    """Return lanes of the blocks: each block on the first lane with room for it and the label in or beside it."""
    lanes: list[list[Block]] = []
    free: list[float] = []  # where the last block of each lane and its label end
    for block in sorted(blocks, key=lambda block: (block.low, block.high)):
        label_s = letter_s * (len(block.label) + 1.5)
        end = block.high if label_s < block.high - block.low else block.high + label_s
        lane = next((i for i, last in enumerate(free) if last <= block.low), len(lanes))
        if lane == len(lanes):
            lanes.append([])
            free.append(end)
        lanes[lane].append(block)
        free[lane] = end
    return lanes


def phase_table(phases: Sequence[Phase]) -> list[Table]:
    """Return the table of the kinds of phases, how often and how long in all; [] without phases."""
    rows, times_s = [], []
    for kind in (*PARTS, *MANOEUVRES):
        parts = [phase for phase in phases if phase.phase == kind]
        if parts:
            total = sum(part.to_s - part.from_s for part in parts)
            ends = (instant(parts[0].from_s), instant(parts[-1].to_s))
            rows.append((kind, str(len(parts)), f"{total:.0f}", *ends))
            times_s.append((parts[0].from_s, parts[-1].to_s))
    heads = ("phase", "times", "in all [s]", "first from [s]", "last to [s]")
    title = "Phases of the flight"
    table = Table(name="phases", title=title, heads=heads, rows=tuple(rows), times_s=tuple(times_s), last_time=4)
    return [table] if rows else []


def phase_columns(phases: Sequence[Phase]) -> dict[str, list[Any]]:
    """Return the columns of the CSV file of phases, a row each."""
    return {key: [getattr(phase, key) for phase in phases] for key in ("phase", "from_s", "to_s")}


def window_table(windows: Sequence[ExcitedWindow]) -> list[Table]:
    """Return the table of the windows to analyse, in order of their rank; [] without windows."""
    ranked = sorted(windows, key=lambda window: window.rank)
    rows = tuple(
        (str(window.rank), instant(window.start_s), instant(window.stop_s), window.channel, str(window.moves))
        for window in ranked
    )
    times_s = tuple((window.start_s, window.stop_s) for window in ranked)
    heads = ("rank", "--from", "--to", "input", "moves")
    title = "Windows to analyse"
    return [Table(name="windows", title=title, heads=heads, rows=rows, times_s=times_s, last_time=2)] if rows else []
