"""`bfi calibrate`: the scan's statistic on logs without a fault, for thresholds and p-values."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import (
    channel_options,
    force_option,
    inputs_of,
    json_option,
    log_of,
    outside_option,
    progress_option,
    window_options,
)
from .output import note, show_lines
from .progress import stages
from .start_time import SHAPES, scan_config

if TYPE_CHECKING:
    from ..calibration import CalibrationTable
    from ..config import Config
    from ..flightlog import FlightLog

__all__ = ["command"]

LENGTH_S = 120.0
LENGTH = "Of a window.  [default: 120, or the whole of a shorter log]"


@click.command("calibrate")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path())
@click.option("-o", "out", required=True, metavar="FILE", type=click.Path(path_type=Path), help="The table to write.")
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration; the command line wins.")
@click.option("--length", "length_s", type=click.FloatRange(min=0, min_open=True), metavar="S", help=LENGTH)
@click.option(
    "--step",
    "step_s",
    type=click.FloatRange(min=0, min_open=True),
    metavar="S",
    help="Between the starts of windows.  [default: half a window]",
)
@click.option("--shape", "shapes", multiple=True, metavar="NAME", help=SHAPES)
@click.option("--ends/--no-ends", default=None, help="Search for the end of the fault too.")
@click.option("--samples", metavar="FILE", help="CSV of time, value: a shape of your own, with --shape samples.")
@click.option("--frequency", metavar="LO:HI", help="Of oscillations, Hz.  [default: 3/window to 0.2 x rate]")
@click.option("--input", "inputs", multiple=True, metavar="NAME", help="An input; repeatable.  [default: elevator]")
@click.option("--output", "outputs", multiple=True, metavar="NAME", help="An output; repeatable.  [default: tas]")
@window_options
@channel_options
@click.option("--rate", metavar="HZ|none|auto", help="Rate of the analysis; none is the log's own.  [default: auto]")
@click.option("--order", metavar="N|auto", help="Number of lags of the model.  [default: auto]")
@click.option("--feedthrough/--no-feedthrough", default=None, help="Inputs act in the same sample too.")
@outside_option
@click.option("--append", is_flag=True, help="Keep what FILE holds; windows scanned alike are joined.")
@progress_option
@force_option
@json_option
def command(logs: tuple[str, ...], out: Path, config_path: str | None, **options: Any) -> None:
    """Scan windows of fault-free LOGs and write the distribution of the statistic to FILE."""
    from ..calibration import load_tables, merged, save_tables
    from ..files import aside, check_files
    from ..provenance import provenance

    config = scan_config(config_path, options)
    joined = options["append"] and out.exists()
    if joined:
        load_tables(out)
    check_files([out], inputs=inputs_of(config, *logs), force=joined or options["force"], option="-o")
    flights = [log_of(log, options["group"], config) for log in logs]
    length_s = options["length_s"] or min(LENGTH_S, *(_duration_s(flight, config) for flight in flights))
    windows = (length_s, options["step_s"] or 0.5 * length_s)
    table = _table(flights, config, windows, options["progress"])
    kept = load_tables(out) if joined else ()
    origin = provenance(log_sha256=" ".join(flight.sha256 for flight in flights), config_sha256=config.sha256)
    tables = merged(kept, table)
    notes = _notes(tables[-1], flights)
    text = save_tables(tables, origin, notes)
    with aside(out.parent, place=out, option="-o") as new:
        (new / out.name).write_text(text + "\n", encoding="utf-8")
    note(f"wrote {out}")
    for sentence in notes:
        note(sentence)
    show_lines(json.loads(text), _lines(table), as_json=options["as_json"])


def _duration_s(flight: FlightLog, config: Config) -> float:
    part = flight.window(config.window.from_s, config.window.to_s)
    return part.n_samples / part.rate_hz


def _table(
    flights: list[FlightLog], config: Config, windows: tuple[float, float], wanted: bool | None
) -> CalibrationTable:
    from ..onset import table_of_windows, windows_of

    pieces = [
        (flight, window)
        for flight in flights
        for window in windows_of(flight, config, length_s=windows[0], step_s=windows[1])
    ]
    with stages(wanted=wanted) as progress:
        return table_of_windows(pieces, config, partial(progress, f"{len(pieces)} windows"))


def _notes(table: CalibrationTable, flights: list[FlightLog]) -> tuple[str, ...]:
    """Return what a reader of the table should know: too few windows, windows left out, windows unlike the others."""
    from ..calibration import FEWEST_WINDOWS, null_of

    n, notes = table.n_windows, []
    if n < FEWEST_WINDOWS:
        notes.append(f"{n} windows are too few, bfi start-time asks for {FEWEST_WINDOWS}; give more or longer flights")
    unused = [flight.path for flight in flights if Path(flight.path).name not in table.logs]
    if table.n_unusable:
        where = f", among them all of {', '.join(unused)}" if unused else ""
        notes.append(f"{table.n_unusable} windows could not be analysed{where}; bfi info says what ails a log")
    if n >= FEWEST_WINDOWS:
        null = null_of(table, table.settings.shapes)
        for shape, values in table.statistics.items():
            beyond = int((values > 2.0 * null.threshold(shape, 0.001)).sum())
            if beyond:
                notes.append(f"{shape}: {beyond} of {n} windows stand far out, as if they held a fault; leave them out")
    return tuple(notes)


def _lines(table: CalibrationTable) -> list[str]:
    from ..calibration import FEWEST_WINDOWS, null_of

    counted = f"{table.n_windows} windows without a fault, {table.n_unusable} could not be analysed"
    if table.n_windows < FEWEST_WINDOWS:
        return [counted, f"too few for a threshold, {FEWEST_WINDOWS} are needed"]
    null = null_of(table, table.settings.shapes)
    shapes = (
        f"{shape}: median {null.median[shape]:.4g}, 1 % false alarms above {null.threshold(shape, 0.01):.4g}"
        for shape in table.settings.shapes
    )
    return [counted, *shapes]
