"""`bfi diagnose`: which air-data fault hit a flight, when, how large and how sure, in one go."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from typing import Any

import click

from .options import CHANNELS, config_of, doubts, exit_code, inputs_of, log_argument, log_of, units_of, with_options
from .output import emit
from .progress import stages

__all__ = ["command"]


@click.command("diagnose")
@log_argument
@with_options(
    *("config_path", "from_s", "to_s", *CHANNELS, "recorder", "require", "tolerance"),
    *("diagnose_false_alarm", "diagnose_calibration", "allow_outside", "units"),
    *("out", "force", "strict", "fail_on", "progress", "as_json", "series"),
    from_s="Start of the part that is diagnosed.  [default: take-off]",
    to_s="End of it, in the log's seconds.  [default: landing]",
    strict="Exit 4 where the log cannot tell.",
    fail_on="Exit 10 where a fault is declared.",
)
@click.option(
    "--workers", metavar="N", type=click.IntRange(min=1), help="Processes; the numbers are the same.  [default: cores]"
)
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, workers: int | None, **options: Any) -> None:
    """Say which air-data fault hit the flight of LOG, when, how large and how sure: every analysis that it allows.

    Pressures that must agree, lines that must not hold still, and lift, climb, inertial acceleration and ground speed,
    which bound the air data without a model of the aircraft; steps and oscillations by the scan over all onsets.
    """
    config = config_of(config_path, options)
    inputs = inputs_of(config, log)
    with stages(wanted=options["progress"]) as progress:
        progress("reading the log", 0.0)  # before what takes a second to import
        from ..config import merge
        from ..diagnose import diagnose_content, diagnose_document, diagnose_flight
        from ..files import check_folder
        from ..parity.record import USED
        from ..provenance import provenance
        from ..report.files import content_names

        if options["out"] is not None:
            names = content_names(("timeline",), ("events", "deviations", "limits", "phases"))
            check_folder(options["out"], names, inputs=inputs, force=options["force"])
        # The whole log, whatever part is diagnosed: the rest of the flight tells the aircraft's angle of zero lift.
        flight = log_of(log, merge(config, {"window": {"from_s": None, "to_s": None}}))
        questions = doubts(flight, USED)
        result = diagnose_flight(flight, config, workers=workers or os.cpu_count() or 1, progress=progress)
    result = replace(result, notes=(*questions, *result.notes))
    origin = provenance(log_sha256=flight.sha256, config_sha256=config.sha256)
    document = diagnose_document(result, origin)
    units = units_of(config.shown_units)
    emit(partial(diagnose_content, document), document, options, units=units, origin=origin, inputs=inputs)
    context.exit(exit_code(result, config))
