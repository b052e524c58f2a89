"""`bfi detect`: which channel of a log fails, and when, without a dictionary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from .options import (
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
from .progress import progress

if TYPE_CHECKING:
    from ..config import Config

__all__ = ["command"]


@click.command("detect")
@log_argument
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration; the command line wins.")
@click.option("--train", metavar="A:B", help="Time known to be healthy.  [default: the first third of the window]")
@click.option(
    "--input", "inputs", multiple=True, metavar="NAME", help="Repeatable.  [default: controls and accelerations]"
)
@click.option("--output", "outputs", multiple=True, metavar="NAME", help="Watched; repeatable.  [default: of the log]")
@click.option("--false-alarm", type=float, metavar="P", help="Accepted, per record.  [default: 0.01]")
@click.option("--method", metavar="auto|exact|parity", help="exact: no noise at all.  [default: auto]")
@click.option("--turns/--no-turns", default=None, help="Explain turns by roll and yaw_rate.  [default: turns]")
@window_options
@channel_options
@click.option("--rate", metavar="HZ|none|auto", help="Rate of the analysis; none is the log's own.  [default: auto]")
@outside_option
@out_options
@click.option("--strict", is_flag=True, default=None, help="Exit 4 where the threshold cannot be trusted.")
@click.option("--fail-on", metavar="fault", help="Exit 10 where a channel fails.")
@progress_option
@series_option
@click.pass_context
def command(context: click.Context, /, log: str, config_path: str | None, **options: Any) -> None:
    """Say which channel of LOG fails, and when: null-space detection, without a model and without a dictionary.

    What is healthy is learnt from the time --train; the threshold is calibrated on a part of it that was held back.
    """
    from ..detect import detect_content, detect_document, detect_faults
    from ..files import check_folder
    from ..provenance import provenance
    from ..report.files import content_names

    config = _config(config_path, options)
    inputs = inputs_of(config, log)
    if options["out"] is not None:
        names = content_names(("detection",), ("alarms", "channels"))
        check_folder(options["out"], names, inputs=inputs, force=options["force"])
    flight = log_of(log, options["group"], config)
    with progress("channels", wanted=options["progress"]) as report:
        result = detect_faults(flight, config, report=report)
    origin = provenance(log_sha256=flight.sha256, config_sha256=config.sha256)
    document = detect_document(result, origin)
    emit(detect_content(document), document, options, origin=origin, inputs=inputs)
    context.exit(exit_code(config, trusted=result.is_calibrated, decision=result.decision))


def _config(path: str | None, options: dict[str, Any]) -> Config:
    train = two_numbers(options["train"], "a stretch of time", "--train 1160:1500, in s")
    return configured(
        path,
        options,
        {
            "detect.train": train,
            "detect.false_alarm": options["false_alarm"],
            "detect.method": options["method"],
            "detect.turns": options["turns"],
        },
    )
