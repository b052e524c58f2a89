"""Claims about faults in a report: the table of candidates, and the figure of limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..decision import Candidate, shown_limit
from ..kernels import TWO_SIDED_95
from ..printable import shortened
from ..quantities.channels import Conversion
from ..quantities.text import SI, Units, change, number, quantity, with_unit
from .content import Curve, Drawing, Panel, Span, Style, Table, curve

CANDIDATE_HEADS = ("fault", "state", "magnitude", "min. detectable", "could hide", "channel", "note")
CANDIDATE_COLUMNS = (
    *("name", "shape", "channel", "kind", "state", "magnitude", "unit", "sd", "minimal_detectable"),
    *("minimal_detectable_scan", "excluded_above", "effect", "tolerance", "channel_unit", "note"),
    *("physical_scale", "physical_unit"),
)
# Letters of a name in a table, and the order of its rows.
NAME_LETTERS = 40
STATES = {"declared": 0, "suspected": 1, "not_seen": 2, "excluded": 3, None: 4}
WORDS = {"not_seen": "not seen", None: "left out"}
STYLES: Mapping[str, Style] = {"excluded": "rows_green", "not seen": "rows_orange", "suspected": "rows_red"}
# Rows of the figure of limits; of more candidates the worst of each shape are drawn, and the worst with a limit.
MOST_ROWS = 12
# Range of the axis of that figure: factors below and above the tolerance, and above the largest limit.
BELOW, ABOVE, ROOM = 30.0, 4.0, 1.3
HIDDEN_CAPTION = (
    "The largest error of each fault on its channel within the window that the log does not contradict. A bar that "
    "ends before the grey area is excluded. A bar that reaches into the grey area is not seen: an error beyond the "
    "tolerance could be there."
)


def shown_meaning(candidate: Candidate, units: Units) -> tuple[float, Conversion]:
    """Return the physical value of a magnitude of 1, in SI, and how that is shown; see `Candidate.meaning`."""
    scale, unit = candidate.meaning
    if candidate.shape == "drift" and not unit and candidate.channel_unit:  # of a result that does not say the slope
        return scale, Conversion(1.0, "x slope")
    return scale, units.of(unit, channel=candidate.channel, channel_unit=candidate.channel_unit)


def candidate_tables(candidates: Sequence[Candidate], units: Units = SI) -> tuple[Table, ...]:
    """Return the table of the candidates, declared and suspected first; () without candidates."""
    rows = []
    for candidate in sorted(candidates, key=lambda candidate: STATES[candidate.state]):
        scale, shown = shown_meaning(candidate, units)
        factor = scale / shown.factor
        size = number(
            None if candidate.magnitude is None else factor * candidate.magnitude,
            spread=None if candidate.sd is None else TWO_SIDED_95 * abs(factor) * candidate.sd,
            extra=1,
        )
        limit = (
            candidate.minimal_detectable
            if candidate.minimal_detectable is not None
            else candidate.minimal_detectable_scan
        )
        hidden = "-" if candidate.state in ("declared", None) else shown_limit(candidate, units) or "any"
        rows.append(
            (
                shortened(candidate.name, NAME_LETTERS),
                WORDS.get(candidate.state, str(candidate.state)),
                with_unit(size, shown.unit),
                change(None if limit is None else abs(scale) * limit, shown),
                hidden,
                candidate.channel,
                units.sentence(candidate.note or "", channel=candidate.channel),
            )
        )
    title = "What was looked for, declared first"
    return (Table(name="candidates", title=title, heads=CANDIDATE_HEADS, rows=tuple(rows)),) if rows else ()


def candidate_columns(candidates: Sequence[Candidate]) -> dict[str, list[Any]]:
    """Return the columns of the CSV file of the candidates."""
    return {key: [getattr(candidate, key) for candidate in candidates] for key in CANDIDATE_COLUMNS}


def hidden_drawing(candidates: Sequence[Candidate], units: Units = SI) -> tuple[Drawing, ...]:
    """Return the figure of the largest hidden errors, one panel per channel; () without limits."""
    panels = []
    for channel in dict.fromkeys(candidate.channel for candidate in candidates):
        shown = _rows(
            [candidate for candidate in candidates if candidate.channel == channel and candidate.state is not None]
        )
        tolerance = next((candidate.tolerance for candidate in shown if candidate.tolerance), None)
        if tolerance is not None and any(candidate.is_unseen for candidate in shown):
            panels.append(_panel(channel, shown, tolerance, units))
    return (Drawing(name="hidden", caption=HIDDEN_CAPTION, panels=tuple(panels)),) if panels else ()


def _rows(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates to draw: all, or of many the declared, the suspected and the worst of each shape.

    The worst of a shape is that without a limit, if any; the worst with a limit is drawn too.
    """
    if len(candidates) <= MOST_ROWS:
        return list(candidates)
    worst: dict[str, Candidate] = {}
    bounded: dict[str, Candidate] = {}
    for candidate in sorted(
        candidates, key=lambda candidate: -(math.inf if candidate.limit is None else candidate.limit)
    ):
        worst.setdefault(candidate.shape, candidate)
        if candidate.limit is not None:
            bounded.setdefault(candidate.shape, candidate)
    seen = [candidate for candidate in candidates if candidate.state in ("declared", "suspected")]
    kept = {id(candidate) for candidate in [*seen[:MOST_ROWS], *worst.values(), *bounded.values()]}
    return [candidate for candidate in candidates if id(candidate) in kept]


def _panel(channel: str, shown: Sequence[Candidate], tolerance: float, units: Units) -> Panel:
    axis = units.of(shown[0].channel_unit, channel=channel)
    unit, limit = axis.unit, tolerance / axis.factor
    known = [candidate.limit / axis.factor for candidate in shown if candidate.limit is not None]
    low = min([limit / BELOW, *(0.5 * size for size in known)])
    high = ROOM * max([ABOVE * limit, *known])
    bars: dict[str, list[tuple[float, float]]] = {"excluded": [], "not seen": [], "suspected": []}
    notes: list[tuple[str, float]] = []
    for row, candidate in enumerate(shown):
        place = float(row)
        if candidate.state == "declared":
            notes.append(("declared", place))
            continue
        end = high if candidate.limit is None else candidate.limit / axis.factor
        bars[WORDS.get(candidate.state, str(candidate.state))].append((end, place))
        notes.append((shown_limit(candidate, units) or "any size", place))
    curves: list[Curve] = [
        curve(name, [end for end, _ in ends], [place for _, place in ends], style=STYLES[name])
        for name, ends in bars.items()
        if ends
    ]
    return Panel(
        x_label=f"largest hidden error on {shortened(channel, 28)} [{unit or '-'}]",
        y_label="fault looked for",
        curves=tuple(curves),
        spans=(Span(label=f"beyond the tolerance of {quantity(limit, unit)}", low=limit, high=high),),
        log_x=True,
        x_limits=(low, high),
        y_limits=(len(shown) - 0.5, -0.5),
        y_ticks=tuple((candidate.name, float(row)) for row, candidate in enumerate(shown)),
        side_notes=tuple(notes),
        height=0.3 + 0.11 * max(len(shown), 3),
    )
