"""`bfi start-time`: when a fault started, and of which shape it is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from ..shapes import SCANNED
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
    two_numbers,
    window_options,
)
from .output import emit
from .progress import stages

if TYPE_CHECKING:
    from ..config import Config

__all__ = ["SHAPES", "command", "scan_config"]

SHAPES = f"{', '.join(SCANNED[:-1])} or {SCANNED[-1]}; repeatable.  [default: bias, drift, sine]"
DRAWINGS, TABLES = ("profile", "outputs"), ("faults", "profile", "shapes")
METHODS = {"scan": "ml", "thesis": "risro"}


@click.command("start-time")
@log_argument
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration; the command line wins.")
@click.option("--shape", "shapes", multiple=True, metavar="NAME", help=SHAPES)
@click.option("--false-alarm", type=float, metavar="P", help="Accepted rate of false alarms.  [default: 0.01]")
@click.option("--calibration", metavar="FILE|self|gaussian", help="Of the threshold.  [default: the shipped table]")
@click.option("--ends/--no-ends", default=None, help="Search for the end of the fault too.")
@click.option("--samples", metavar="FILE", help="CSV of time, value: a shape of your own, with --shape samples.")
@click.option("--frequency", metavar="LO:HI", help="Of oscillations, Hz.  [default: 3/window to 0.2 x rate]")
@click.option("--method", help="scan, or thesis (one solve per onset, as published).  [default: scan]")
@click.option("--input", "inputs", multiple=True, metavar="NAME", help="An input; repeatable.  [default: elevator]")
@click.option("--output", "outputs", multiple=True, metavar="NAME", help="An output; repeatable.  [default: tas]")
@window_options
@channel_options
@click.option("--rate", metavar="HZ|none|auto", help="Rate of the analysis; none is the log's own.  [default: auto]")
@click.option("--order", metavar="N|auto", help="Number of lags of the model.  [default: auto]")
@click.option("--feedthrough/--no-feedthrough", default=None, help="Inputs act in the same sample too.")
@click.option("--seed", type=int, metavar="N", help="Of random steps.  [default: 0]")
@outside_option
@out_options
@click.option("--strict", is_flag=True, default=None, help="Exit 4 where there is no trustworthy answer.")
@click.option("--fail-on", metavar="fault", help="Exit 10 where a fault is declared.")
@progress_option
@series_option
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say when a fault started in LOG, which shape it has, how large it is and how sure that is."""
    from ..files import check_folder
    from ..onset import find_onset, onset_content, onset_document
    from ..provenance import provenance
    from ..report.files import content_names

    config = scan_config(config_path, options)
    inputs = inputs_of(config, log)
    if options["out"] is not None:
        check_folder(options["out"], content_names(DRAWINGS, TABLES), inputs=inputs, force=options["force"])
    flight = log_of(log, options["group"], config)
    notes = advise(flight, config)
    with stages(wanted=options["progress"]) as progress:
        result = find_onset(flight, config, progress)
    result = replace(result, notes=(*notes, *result.notes))
    origin = provenance(log_sha256=flight.sha256, config_sha256=config.sha256, seed=config.seed)
    document = onset_document(result, origin)
    emit(onset_content(document), document, options, origin=origin, inputs=inputs)
    trusted = result.decision != "not_identifiable" and result.p_value is not None
    context.exit(exit_code(config, trusted=trusted, decision=result.decision))


def scan_config(path: str | None, options: dict[str, Any]) -> Config:
    """Return the configuration that the options of `start-time` and `calibrate` make."""
    return configured(
        path,
        options,
        {
            "method": _method(options.get("method")),
            "start_time.shapes": options["shapes"] or None,
            "start_time.samples": options["samples"],
            "start_time.false_alarm": options.get("false_alarm"),
            "start_time.calibration": options.get("calibration"),
            "start_time.ends": options["ends"],
            "start_time.frequency_hz": two_numbers(options["frequency"], "a band", "--frequency 0.1:2, in Hz"),
        },
    )


def _method(word: str | None) -> str | None:
    if word is not None and word not in METHODS:
        raise ConfigError(f"--method: not a method, got {word}; known: {', '.join(METHODS)}")
    return METHODS.get(word or "")
