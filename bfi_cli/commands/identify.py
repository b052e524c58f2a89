"""`bfi identify`: which faults of a dictionary are in a log."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..identify.methods import METHODS
from .answered import show
from .options import (
    advise,
    channel_options,
    configured,
    exit_code,
    inputs_of,
    log_argument,
    log_of,
    out_options,
    outside_option,
    progress_option,
    series_option,
    tell,
    window_options,
)
from .progress import stages

if TYPE_CHECKING:
    from ..config import Config
    from ..dictionary import Dictionary
    from ..flightlog import FlightLog
    from ..identify.result import IdentifyResult
    from ..kernels.progress import Progress

__all__ = ["command"]

ONSET_SAMPLES = 1.5


@click.command("identify")
@log_argument
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration; the command line wins.")
@click.option(
    "-d", "--dictionary", metavar="FILE", help="YAML dictionary of the faults to look for.  [default: the onset scan]"
)
@click.option("--input", "inputs", multiple=True, metavar="NAME", help="An input; repeatable.  [default: elevator]")
@click.option("--output", "outputs", multiple=True, metavar="NAME", help="An output; repeatable.  [default: tas]")
@window_options
@channel_options
@click.option("--rate", metavar="HZ|none|auto", help="Rate of the analysis; none is the log's own.  [default: auto]")
@click.option("--order", metavar="N|auto", help="Number of lags of the model.  [default: auto]")
@click.option("--feedthrough/--no-feedthrough", default=None, help="Inputs act in the same sample too.")
@click.option("--method", metavar="NAME", help=f"How: {', '.join(METHODS)}.  [default: ml]")
@click.option("--sparsity", metavar="KIND", help="Stage of method risro: none, l1, lp, exp-l0.  [default: exp-l0]")
@click.option("--model", metavar="NAME", help="A linear model of bfi simulate, for method dmae.")
@click.option("--seed", type=int, metavar="N", help="Of random steps.  [default: 0]")
@outside_option
@out_options
@click.option("--strict", is_flag=True, default=None, help="Exit 4 where there is no trustworthy answer.")
@click.option("--fail-on", metavar="fault", help="Exit 10 where a fault is declared.")
@progress_option
@series_option
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say which faults of a dictionary are in LOG, how large they are and how sure that is.

    Without a dictionary the scan over all onsets (bfi start-time) proposes the faults.
    """
    from ..documents import identify_document
    from ..files import check_folder, replace_files
    from ..identify import identify_faults
    from ..output import IDENTIFY_NAMES, identify_files
    from ..provenance import provenance
    from ..tables import print_identify

    own = {"method": "method", "risro.sparsity": "sparsity", "dmae.model": "model"}
    config = configured(config_path, options, {place: options[name] for place, name in own.items()})
    dictionary = config.load_dictionary(allow_outside=options["allow_outside"])
    inputs = inputs_of(config, log, dictionary=dictionary)
    if options["out"] is not None:
        check_folder(options["out"], IDENTIFY_NAMES, inputs=inputs, force=options["force"])
    flight = log_of(log, options["group"], config)
    notes = advise(flight, config)
    with stages(wanted=options["progress"]) as progress:
        if dictionary is None:
            result, dictionary = _without_dictionary(flight, config, progress)
        else:
            result = identify_faults(flight, dictionary, config, progress)
    result = replace(result, notes=(*notes, *result.notes))
    origin = provenance(
        log_sha256=flight.sha256,
        config_sha256=config.sha256,
        dictionary_sha256=dictionary.sha256,
        seed=config.seed,
    )
    if options["out"] is not None:
        with stages(wanted=options["progress"]) as progress:
            files = identify_files(result, origin, partial(progress, "figures"))
        replace_files(files, options["out"], inputs=inputs, force=options["force"])
        tell(f"wrote {options['out'] / 'report.html'}")
    document = identify_document(result, origin)
    show(
        document,
        lambda console: print_identify(console, result),
        as_json=options["as_json"],
        series=options["series"],
    )
    context.exit(exit_code(config, trusted=result.decision != "not_identifiable", decision=result.decision))


def _without_dictionary(flight: FlightLog, config: Config, progress: Progress) -> tuple[IdentifyResult, Dictionary]:
    """Identify what the onset scan proposes; where that is nothing, say how large each shape would have had to be.

    The evidence asked for is then that of the scan, so that its minimal detectable magnitudes are shown.
    """
    from ..config import merge
    from ..identify import identify_faults
    from ..onset import compare_with_injected, find_onset, propose_dictionary

    scanned = find_onset(flight, merge(config, {"method": "ml"}), progress)
    dictionary = propose_dictionary(scanned)
    if scanned.faults:
        told = f"no dictionary: {len(scanned.faults)} found by the onset scan; their onsets are taken as known here"
    else:
        highest = max(profile.threshold or 0.0 for profile in scanned.profiles)
        config = merge(config, {"selection.evidence": highest, "method": "ml"})
        told = (
            f"no dictionary: the onset scan finds no fault at a false-alarm rate of {100.0 * scanned.false_alarm:.3g} "
            "%; the candidates are each shape at its most suspicious onset"
        )
    result = identify_faults(flight, dictionary, config, progress)
    notes = (told, *scanned.notes, *(note for note in result.notes if note not in scanned.notes))
    truth = result.truth
    if truth is not None:
        tolerance_s = ONSET_SAMPLES / result.log.rate_hz
        truth = compare_with_injected(truth, result.faults, scanned.truth or (), tolerance_s=tolerance_s)
    return replace(result, notes=notes, truth=truth), dictionary
