"""`bfi identify`: which faults of a dictionary are in a log."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from .analysis import Answer, Asked, analysis, source_of
from .options import ANSWER, MODEL, SIGNALS, VERDICT, log_argument
from .output import note

if TYPE_CHECKING:
    from ..config import Config
    from ..flightlog import FlightLog
    from ..model.result import IdentifyResult
    from ..quantities.text import Units
    from ..report.content import ReportContent

DRAWINGS = ("hidden", "outputs", "fault", "magnitudes", "residuals", "orders")
TABLES = ("faults", "candidates", "residuals", "truth", "orders", "series")


def _check(given: Mapping[str, Any]) -> None:
    """Refuse further logs without --together, and --together without any."""
    if given["logs"] and not given["together"]:
        raise ConfigError(
            f"bfi identify: one LOG is analysed at a time, got {1 + len(given['logs'])}; add --together where the "
            "others are healthy flights of the same aircraft, or run them one by one"
        )
    if given["together"] and not given["logs"]:
        raise ConfigError("--together: no further log is given; write bfi identify LOG EARLIER --together")


def _earlier_log(word: str, config: Config) -> FlightLog:
    """Return the log, or the stretch of a log, that `word` names, FILE or FILE@FROM:TO in seconds.

    Raises
    ------
    LogError : the log cannot be read, or has no such stretch.
    """
    from ..flightlog import read_log
    from ..library import with_findings

    stretch = None if Path(word).exists() else re.fullmatch(r"(.+)@([-+.\deE]*):([-+.\deE]*)", word)
    if stretch is None:
        return with_findings(read_log(word, **source_of(config)), config, note)[0]
    path, *ends = stretch.groups()
    try:
        from_s, to_s = (float(end) if end else None for end in ends)
    except ValueError:
        raise ConfigError(f"--together: {word}: not a stretch of seconds, write {path}@100:250") from None
    log = with_findings(read_log(path, **source_of(config)), config, note)[0]
    return replace(log.window(from_s, to_s), path=word)


@analysis(
    "identify",
    log_argument,
    click.argument("logs", metavar="[EARLIER]...", nargs=-1),
    *("config_path", "dictionary", "onset_tolerance", *SIGNALS, "fix_units", *MODEL, *VERDICT),
    *("together", "method", "sparsity", "model", "prove", "seed", "workers", *ANSWER),
    check=_check,
)
def command(asked: Asked) -> Answer:
    """Say which faults of a dictionary are in LOG, how large they are and how sure that is.

    Without a dictionary the scan over all onsets (bfi start-time) proposes the faults.
    """
    from ..library import identify
    from ..model.result import identify_document

    asked.check_out(DRAWINGS, (*TABLES, "proved"))
    flight = asked.flight()
    flight = replace(flight, earlier=tuple(_earlier_log(word, asked.config) for word in asked.options["logs"]))
    result = identify(
        flight,
        config=asked.config,
        allow_outside=asked.options["allow_outside"],
        prove=asked.proving(),
        progress=asked.progress,
        tell=note,
    )
    return Answer(
        document=partial(identify_document, result),
        content=partial(_content_of, result),
        log_sha256=flight.sha256,
        dictionary=asked.dictionary,
        decided=result,
    )


def _content_of(result: IdentifyResult, _: Mapping[str, Any], units: Units) -> ReportContent:
    """Return what the report of a result holds; with --json nothing of it is made."""
    from ..model.report import identify_content

    return identify_content(result, units)
