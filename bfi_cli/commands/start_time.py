"""`bfi start-time`: when a fault started, and of which shape it is."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import click

from .options import (
    MODEL,
    SIGNALS,
    VERDICT,
    config_of,
    exit_code,
    inputs_of,
    log_argument,
    log_of,
    settled,
    units_of,
    with_options,
)
from .output import emit
from .progress import stage, stages

__all__ = ["command"]

DRAWINGS, TABLES = ("hidden", "profile", "outputs"), ("faults", "candidates", "profile", "shapes")


@click.command("start-time")
@log_argument
@with_options(
    *("config_path", "shapes", "false_alarm", "calibration", "ends", "samples", "frequency", "scan_method"),
    *(*SIGNALS, *MODEL, *VERDICT, "seed"),
    *("allow_outside", "units", "out", "force", "strict", "fail_on", "progress", "as_json", "series"),
)
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say when a fault started in LOG, which shape it has, how large it is and how sure that is."""
    config = config_of(config_path, options)
    inputs = inputs_of(config, log)
    with stage("reading the log", wanted=options["progress"]):
        # What is imported here takes as long as a short log.
        from ..analysis import start_time
        from ..files import check_folder
        from ..onset import onset_content, onset_document
        from ..provenance import provenance
        from ..report.files import content_names

        if options["out"] is not None:
            check_folder(options["out"], content_names(DRAWINGS, TABLES), inputs=inputs, force=options["force"])
        flight = log_of(log, config)
    config, notes = settled(flight, config)
    with stages(wanted=options["progress"]) as progress:
        result = start_time(flight, config, progress)
    result = replace(result, notes=(*notes, *result.notes))
    origin = provenance(log_sha256=flight.sha256, config_sha256=config.sha256, seed=config.seed)
    document = onset_document(result, origin)
    units = units_of(config.shown_units)
    emit(partial(onset_content, document), document, options, units=units, origin=origin, inputs=inputs)
    context.exit(exit_code(result, config))
