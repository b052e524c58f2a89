"""`bfi info`: what a log holds and what it is good for."""

from __future__ import annotations

from functools import partial
from typing import Any

import click

from ..flightlog import inspect_log, read_log
from ..flightlog.report import info_content, info_document
from ..provenance import provenance
from .options import (
    CHANNELS,
    channel_options,
    json_option,
    log_argument,
    out_options,
    units_of,
    units_option,
    window_options,
)
from .output import emit

__all__ = ["command"]

TABLES = ("channels", "derived", "phases", "excitation", "windows", "segments")


@click.command("info")
@log_argument
@channel_options
@window_options
@units_option
@out_options
@json_option
def command(log: str, *, from_s: float | None, to_s: float | None, units: str | None, **options: Any) -> None:
    """Show channels, units, rate, gaps, held samples, excitation of a log, its phases and windows to analyse."""
    if options["out"] is not None:
        from ..files import check_folder
        from ..report.files import content_names

        check_folder(options["out"], content_names(("phases",), TABLES), inputs=(log,), force=options["force"])
    source = {key: options[key] for key in CHANNELS}
    flight = read_log(log, from_s=from_s, to_s=to_s, **source).window(from_s, to_s)
    origin = provenance(log_sha256=flight.sha256)
    document = info_document(inspect_log(flight), origin)
    emit(partial(info_content, document), document, options, units=units_of(units), origin=origin, inputs=(log,))
