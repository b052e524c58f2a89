"""`bfi detect`: which channel of a log fails, and when, without a dictionary."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from .answered import give
from .options import channel_options, json_option, log_argument, number_or_word, window_options
from .progress import progress

if TYPE_CHECKING:
    from ..detect import DetectSettings

__all__ = ["command"]

FAULT_DECLARED = 10
METHODS = ("auto", "exact", "parity")


@click.command("detect")
@log_argument
@click.option("--train", metavar="A:B", help="Time known to be healthy.  [default: the first third of the window]")
@click.option("--input", "inputs", multiple=True, metavar="NAME", help="Repeatable.  [default: those of the log]")
@click.option("--output", "outputs", multiple=True, metavar="NAME", help="Watched; repeatable.  [default: of the log]")
@click.option("--false-alarm", type=float, default=0.01, show_default=True, metavar="P", help="Accepted, per record.")
@click.option("--method", type=click.Choice(METHODS), default="auto", show_default=True, help="exact: no noise at all.")
@click.option("--turns/--no-turns", default=True, show_default=True, help="Explain turns by roll and yaw_rate.")
@window_options
@channel_options
@click.option("--rate", metavar="HZ|none|auto", default="auto", show_default=True, help="Rate of the analysis.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Write result, report, figures and tables.")
@click.option("--fail-on", type=click.Choice(["fault"]), help="Exit 10 where a channel fails.")
@click.option("--progress/--no-progress", default=None, help="Show it on stderr.  [default: on a terminal]")
@json_option
@click.pass_context
def command(context: click.Context, /, log: str, **options: Any) -> None:
    """Say which channel of LOG fails, and when: null-space detection, without a model and without a dictionary.

    What is healthy is learnt from the time --train; the threshold is calibrated on a part of it that was held back.
    """
    from ..detect import detect_document, detect_exhibit, detect_faults
    from ..flightlog import read_log
    from ..provenance import provenance

    settings = _settings(options)
    flight = read_log(log, group=options["group"], channel_map=options["channel_map"], unit_map=options["unit_map"])
    with progress("channels", wanted=options["progress"]) as report:
        result = detect_faults(flight, settings, report=report)
    origin = provenance(log_sha256=flight.sha256)
    document = detect_document(result, origin)
    give(detect_exhibit(document), document, origin=origin, out=options["out"], as_json=options["as_json"])
    context.exit(FAULT_DECLARED if options["fail_on"] and result.decision == "fault" else 0)


def _settings(options: dict[str, Any]) -> DetectSettings:
    from ..detect import DetectSettings

    rate = number_or_word(options["rate"])
    if isinstance(rate, str) and rate not in ("none", "auto"):
        raise ConfigError(f"--rate: not a number or one of the choices, got '{rate}'; give one in Hz, none or auto")
    return DetectSettings(
        inputs=options["inputs"],
        outputs=options["outputs"],
        from_s=options["from_s"],
        to_s=options["to_s"],
        train=_train(options["train"]),
        false_alarm=options["false_alarm"],
        rate_hz=rate if isinstance(rate, str) else float(rate),  # type: ignore[arg-type]
        method=options["method"],
        turns=options["turns"],
    )


def _train(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        if colon:
            return float(first), float(last)
    except ValueError:
        pass
    raise ConfigError(f"--train: not a stretch of time, got {text}; write --train 1160:1500, in s")
