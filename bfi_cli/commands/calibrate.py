"""`bfi calibrate`: the scan's statistic on logs without a fault, for thresholds and p-values."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..notes import Note
from .analysis import inputs_of, log_of
from .options import MODEL, SIGNALS, config_of, fleet_argument, with_options
from .output import note, show_lines, stages


@click.command("calibrate")
@with_options(
    fleet_argument,
    click.option(
        *("-o", "out"), required=True, metavar="FILE", type=click.Path(path_type=Path), help="The table to write."
    ),
    *("config_path", "length_s", "step_s", "shapes", "ends", "samples", "frequency", *SIGNALS, *MODEL),
    *("allow_outside", "recursive", "list_file"),
    click.option("--append", is_flag=True, help="Keep what FILE holds; windows scanned alike are joined."),
    *("progress", "force", "as_json"),
)
def command(logs: tuple[str, ...], out: Path, config_path: str | None, **options: Any) -> None:
    """Scan windows of fault-free LOGs of one aircraft and write the distribution of the statistic to FILE.

    Of whole flights those count in which the aircraft flies, where an airspeed shows it.

    Where the logs have air data, FILE also holds the aircraft's angle of zero lift and the tables of bfi diagnose.
    """
    from ..config import merge
    from ..decision.calibration import join_tables, load_tables, save_tables
    from ..errors import LogError
    from ..files import aside, check_files
    from ..flight.parity.calibration import calibrate_air_data
    from ..model.onset import calibration_windows, table_of_windows
    from ..model.preprocessing.defaults import default_inputs
    from ..report.calibration import table_lines, table_notes
    from ..serialization import provenance

    config = config_of(config_path, options)
    logs = _logs_of_aircraft(logs, options["recursive"], options["list_file"])
    appended = options["append"] and out.exists()
    if appended:
        load_tables(out)
    check_files([out], inputs=inputs_of(config, *logs), force=appended or options["force"], option="-o")
    flights = [log_of(log, config) for log in logs]
    if "inputs" not in config.model_fields_set:
        config = merge(config, {"inputs": default_inputs(flights[0], config)})
    with stages(wanted=options["progress"]) as progress:
        progress("air data", 0.0)
        air_data, reason = calibrate_air_data(flights), None
        try:
            windows = calibration_windows(flights, config)
            table = table_of_windows(windows, config, partial(progress, f"{len(windows)} windows"))
        except LogError as error:
            if air_data is None:
                raise
            table, reason = None, str(error)
    origin = provenance(log_sha256=" ".join(flight.sha256 for flight in flights), config_sha256=config.sha256)
    tables = load_tables(out) if appended else ()
    notes: tuple[Note, ...] = (Note.limit(f"only for bfi diagnose, no onset scan: {reason}"),)
    if table is not None:
        tables = join_tables(tables, table)
        notes = table_notes(tables[-1], [flight.path for flight in flights])
    text = save_tables(tables, origin, notes, air_data=air_data)
    with aside(out.parent, place=out, option="-o") as new:
        (new / out.name).write_text(text + "\n", encoding="utf-8")
    for sentence in (f"wrote {out}", *(remark.text for remark in notes)):
        note(sentence)
    lines = [*([] if table is None else table_lines(table)), *([] if air_data is None else air_data.lines())]
    show_lines(json.loads(text), lines, as_json=options["as_json"])


def _logs_of_aircraft(paths: tuple[str, ...], recursive: bool, listed: str | None) -> tuple[str, ...]:
    """Return the logs that are named, of files, folders and a list.

    Raises
    ------
    ConfigError : they are of several aircraft.
    """
    from ..errors import ConfigError
    from ..fleet import logs_of

    if not paths and listed is None:
        context = click.get_current_context()
        raise click.MissingParameter(ctx=context, param=context.command.params[0])
    logs = logs_of(paths, recursive=recursive, listed=listed)
    aircraft = sorted({log.aircraft for log in logs} - {""})
    if len(aircraft) > 1:
        raise ConfigError(
            f"bfi calibrate: the logs are of {len(aircraft)} aircraft, {', '.join(aircraft[:3])}; give those of one"
        )
    return tuple(log.path for log in logs)
