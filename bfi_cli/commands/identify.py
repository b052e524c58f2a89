"""`bfi identify`: which faults of a dictionary are in a log."""

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


@click.command("identify")
@log_argument
@with_options(
    *(
        "config_path",
        "dictionary",
        "onset_tolerance",
        *SIGNALS,
        *MODEL,
        *VERDICT,
        "method",
        "sparsity",
        "model",
        "seed",
    ),
    *("allow_outside", "units", "out", "force", "strict", "fail_on", "progress", "as_json", "series"),
)
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say which faults of a dictionary are in LOG, how large they are and how sure that is.

    Without a dictionary the scan over all onsets (bfi start-time) proposes the faults.
    """
    config = config_of(config_path, options)
    dictionary = config.load_dictionary(allow_outside=options["allow_outside"])
    inputs = inputs_of(config, log, dictionary=dictionary)
    with stage("reading the log", wanted=options["progress"]):
        # What is imported here takes as long as a short log.
        from ..analysis import identify
        from ..files import check_folder
        from ..identify.document import identify_document
        from ..identify.report import DRAWINGS, TABLES, identify_content
        from ..provenance import provenance
        from ..report.files import content_names

        if options["out"] is not None:
            check_folder(options["out"], content_names(DRAWINGS, TABLES), inputs=inputs, force=options["force"])
        flight = log_of(log, config)
    config, notes = settled(flight, config)
    if dictionary is not None:  # its entries may act on the output, which is known now
        dictionary = config.load_dictionary(allow_outside=options["allow_outside"])
    with stages(wanted=options["progress"]) as progress:
        result, dictionary = identify(flight, dictionary, config, progress)
    result = replace(result, notes=(*notes, *result.notes))
    origin = provenance(
        log_sha256=flight.sha256, config_sha256=config.sha256, dictionary_sha256=dictionary.sha256, seed=config.seed
    )
    document = identify_document(result, origin)
    units = units_of(config.shown_units)
    emit(partial(identify_content, result), document, options, units=units, origin=origin, inputs=inputs)
    context.exit(exit_code(result, config))
