"""`bfi identify`: which faults of a dictionary are in a log."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import click

from .answered import show
from .options import MODEL, SIGNALS, advise, config_of, exit_code, inputs_of, log_argument, log_of, tell, with_options
from .progress import stages

__all__ = ["command"]


@click.command("identify")
@log_argument
@with_options(
    *("config_path", "dictionary", *SIGNALS, *MODEL, "method", "model", "seed"),
    *("allow_outside", "out", "force", "strict", "fail_on", "progress", "as_json", "series"),
)
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say which faults of a dictionary are in LOG, how large they are and how sure that is.

    Without a dictionary the scan over all onsets (bfi start-time) proposes the faults.
    """
    from ..documents import identify_document
    from ..files import check_folder, replace_files
    from ..identify import identify_faults
    from ..identify.from_scan import identify_from_scan
    from ..output import IDENTIFY_NAMES, identify_files
    from ..provenance import provenance
    from ..tables import print_identify

    config = config_of(config_path, options)
    dictionary = config.load_dictionary(allow_outside=options["allow_outside"])
    inputs = inputs_of(config, log, dictionary=dictionary)
    if options["out"] is not None:
        check_folder(options["out"], IDENTIFY_NAMES, inputs=inputs, force=options["force"])
    flight = log_of(log, config)
    notes = advise(flight, config)
    with stages(wanted=options["progress"]) as progress:
        if dictionary is None:
            result, dictionary = identify_from_scan(flight, config, progress)
        else:
            result = identify_faults(flight, dictionary, config, progress)
    result = replace(result, notes=(*notes, *result.notes))
    origin = provenance(
        log_sha256=flight.sha256, config_sha256=config.sha256, dictionary_sha256=dictionary.sha256, seed=config.seed
    )
    if options["out"] is not None:
        with stages(wanted=options["progress"]) as progress:
            files = identify_files(result, origin, partial(progress, "figures"))
        replace_files(files, options["out"], inputs=inputs, force=options["force"])
        tell(f"wrote {options['out'] / 'report.html'}")
    document = identify_document(result, origin)
    show(
        document, lambda console: print_identify(console, result), as_json=options["as_json"], series=options["series"]
    )
    context.exit(exit_code(result, config))
