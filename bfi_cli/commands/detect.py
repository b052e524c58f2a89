"""`bfi detect`: which channel of a log fails, and when, without a dictionary."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import click

from .options import (
    CHANNELS,
    VERDICT,
    config_of,
    doubts,
    exit_code,
    inputs_of,
    log_argument,
    log_of,
    units_of,
    with_options,
)
from .output import emit
from .progress import progress

__all__ = ["command"]


@click.command("detect")
@log_argument
@with_options(
    *("config_path", "train", "inputs", "outputs", "detect_false_alarm", "detect_method", "turns"),
    *("from_s", "to_s", *CHANNELS, "rate", "recorder", *VERDICT),
    *("allow_outside", "units", "out", "force", "strict", "fail_on", "progress", "as_json", "series"),
    inputs="An input; repeatable.  [default: controls and accelerations]",
    outputs="An output to watch; repeatable.  [default: of the log]",
    require="Kinds of fault that must be excluded for a no_fault; only abrupt ones are looked for.  [default: all]",
    strict="Exit 4 where the log cannot tell, or the threshold cannot be trusted.",
    fail_on="Exit 10 where a channel fails.",
)
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say which channel of LOG fails, and when: null-space detection, without a model and without a dictionary.

    What is healthy is learnt from the time --train; the threshold is calibrated on a part of it that was held back.
    """
    from ..detect import detect_content, detect_document, detect_faults
    from ..files import check_folder
    from ..provenance import provenance
    from ..report.files import content_names

    config = config_of(config_path, options)
    inputs = inputs_of(config, log)
    if options["out"] is not None:
        names = content_names(("hidden", "detection"), ("alarms", "candidates", "channels"))
        check_folder(options["out"], names, inputs=inputs, force=options["force"])
    flight = log_of(log, config)
    with progress("channels", wanted=options["progress"]) as report:
        result = detect_faults(flight, config, report=report)
    result = replace(result, notes=(*doubts(flight, (*result.outputs, *result.inputs)), *result.notes))
    origin = provenance(log_sha256=flight.sha256, config_sha256=config.sha256)
    document = detect_document(result, origin)
    units = units_of(config.shown_units)
    emit(partial(detect_content, document), document, options, units=units, origin=origin, inputs=inputs)
    context.exit(exit_code(result, config))
