"""`bfi info`: what a log holds and what it is good for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from ..flightlog import LogReport, inspect_log, read_log
from ..printable import printable
from ..provenance import provenance
from .answered import show
from .options import channel_options, json_option, log_argument, window_options

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["command"]

SCHEMA = 1


@click.command("info")
@log_argument
@channel_options
@window_options
@json_option
def command(log: str, as_json: bool, from_s: float | None, to_s: float | None, **source: Any) -> None:
    """Show channels, units, rate, gaps, held samples, excitation of a log, and windows to analyse."""
    flight = read_log(log, from_s=from_s, to_s=to_s, **source).window(from_s, to_s)
    report = inspect_log(flight)
    document = _document(report) | {"provenance": provenance(log_sha256=flight.sha256)}
    show(document, lambda console: _draw(console, report), as_json=as_json)


def _document(report: LogReport) -> dict[str, Any]:
    return {
        "kind": "info",
        "schema": SCHEMA,
        "log": {
            "path": report.path,
            "rate_hz": report.rate_hz,
            "n_samples": report.n_samples,
            "start_s": report.start_s,
            "stop_s": report.stop_s,
        },
        "rate_hz": report.rate_hz,
        "uniform": report.uniform,
        "jitter": report.jitter,
        "gaps": [{"start_s": start, "stop_s": stop} for start, stop in report.gaps],
        "channels": report.channels,
        "excitation": report.excitation,
        "windows": report.windows,
        "segments": report.segments,
        "notes": report.notes,
    }


def _draw(console: Console, report: LogReport) -> None:
    from rich.text import Text

    for line in _headline(report):
        console.print(Text(printable(line)), soft_wrap=not console.is_terminal)
    for table in (_channels(report), _excitation(report), _windows(report), _segments(report)):
        if table.row_count:
            console.print(table)
    for note in report.notes:
        console.print(Text(printable(f"note: {note}")), soft_wrap=not console.is_terminal)


def _headline(report: LogReport) -> list[str]:
    step = "uniform" if report.uniform else f"not uniform, off by up to {100 * report.jitter:.3g} %"
    size = f"{report.n_samples} samples at {report.rate_hz:.4g} Hz, {report.start_s:g} s to {report.stop_s:g} s"
    gaps = [f"gap from {start:g} s to {stop:g} s ({stop - start:.3g} s)" for start, stop in report.gaps]
    return [f"{report.path}: {size}, time step {step}", *gaps]


def _table(title: str, rows: Sequence[Mapping[str, str | float | None]]) -> Table:
    """Return a table of rows by column title, text left, numbers right, columns that are empty throughout left out."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    shown = [column for column in (rows[0] if rows else ()) if any(row[column] not in (None, "") for row in rows)]
    for column in shown:
        is_text = any(isinstance(row[column], str) for row in rows)
        table.add_column(column, justify="left" if is_text else "right", no_wrap=column != "note")
    for row in rows:
        table.add_row(*(Text(_cell(row[column])) for column in shown))
    return table


def _cell(value: str | float | None) -> str:
    if value is None or isinstance(value, str):
        return printable(value or "")
    return f"{value:.5g}"


def _channels(report: LogReport) -> Table:
    return _table(
        "channels",
        [
            {
                "name": c.name,
                "in the file": None if c.source == c.name else c.source,
                "unit": c.unit,
                "min": c.min,
                "max": c.max,
                "quantum": c.quantum,
                "NaN": c.n_nan or None,
                "held": None
                if c.hold_period_s is None
                else f"{100 * c.held_fraction:.0f} %, {1 / c.hold_period_s:.3g} Hz",
            }
            for c in report.channels
        ],
    )


def _excitation(report: LogReport) -> Table:
    return _table(
        "inputs, in flight",
        [
            {"name": e.channel, "unit": e.unit, "range": e.range, "moves": e.moves, "bandwidth [Hz]": e.bandwidth_hz}
            for e in report.excitation
        ],
    )


def _windows(report: LogReport) -> Table:
    return _table(
        "windows to analyse",
        [{"--from": w.start_s, "--to": w.stop_s, "input": w.channel, "moves": w.moves} for w in report.windows],
    )


def _segments(report: LogReport) -> Table:
    return _table(
        "segments named in the file",
        [{"label": s.label, "from [s]": s.start_s, "to [s]": s.stop_s, "note": s.note} for s in report.segments],
    )
