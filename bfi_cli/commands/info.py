"""`bfi info`: what a log holds and what it is good for."""

from __future__ import annotations

from functools import partial
from typing import Any

import click

from ..flightlog import inspect_log, read_log
from ..flightlog.defects import find_defects
from ..flightlog.recorder import with_seen_recorder
from ..flightlog.report import info_content, info_document
from ..provenance import provenance
from .options import CHANNELS, config_of, inputs_of, log_argument, source_of, units_of, with_options
from .output import emit

__all__ = ["command"]

TABLES = ("channels", "derived", "phases", "excitation", "windows", "segments")


@click.command("info")
@log_argument
@with_options("config_path", *CHANNELS, "from_s", "to_s", "allow_outside", "units", "out", "force", "as_json")
def command(log: str, *, config_path: str | None, **options: Any) -> None:
    """Show channels, units, rate, gaps, held samples, excitation of a log, its phases and windows to analyse.

    Of a configuration file counts what says how the log is read, its window and the units to show.
    """
    config = config_of(config_path, options)
    inputs, window = inputs_of(config, log), config.window
    if options["out"] is not None:
        from ..files import check_folder
        from ..report.files import content_names

        check_folder(options["out"], content_names(("phases",), TABLES), inputs=inputs, force=options["force"])
    flight = read_log(log, from_s=window.from_s, to_s=window.to_s, **source_of(config))
    flight = flight.window(window.from_s, window.to_s)
    origin = provenance(log_sha256=flight.sha256, config_sha256=config.sha256)
    document = info_document(inspect_log(flight), origin, find_defects(with_seen_recorder(flight)))
    units = units_of(config.shown_units)
    emit(partial(info_content, document), document, options, units=units, origin=origin, inputs=inputs)
