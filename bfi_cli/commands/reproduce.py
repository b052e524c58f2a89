"""`bfi reproduce`: a published figure or table, ours beside theirs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from ..errors import BfiError, ConfigError
from .options import CHANNELS, OPTIONS, with_options
from .output import check_out, emit, progress, write

if TYPE_CHECKING:
    from ..flightlog import FlightLog
    from ..lab.reproduce import Settings
    from ..report.content import ReportContent
    from ..serialization import Provenance

LOG_OPTIONS = {name: OPTIONS[name].flags[0] for name in ("from_s", "to_s", *CHANNELS)}


@click.command("reproduce")
@click.argument("name", required=False, default="list", metavar="[NAME]")
@click.option("--log", "log_path", metavar="FILE", help="Fault-free record.  [default: a simulated one]")
@click.option("--quick", is_flag=True, help="Few trials, short sweeps: seconds instead of minutes.")
@click.option("--trials", type=click.IntRange(min=1), metavar="N", help="Per point.  [default: as published]")
@click.option("--seed", type=click.IntRange(min=0), default=0, metavar="N", help="Of all random numbers.  [default: 0]")
@click.option("--workers", type=click.IntRange(min=1), default=1, metavar="N", help="Processes.  [default: 1]")
@click.option("--set", "choices", multiple=True, metavar="KEY=VALUE", help="An open choice of f16-table2; repeatable.")
@with_options("from_s", "to_s", *CHANNELS, "out", "force", "progress", "as_json", "series")
@click.pass_context
def command(context: click.Context, /, name: str, **options: Any) -> None:
    """Make the published figure or table NAME again, ours beside theirs.

    Without NAME, or with "list", the names are listed; "all" makes every one, each in a folder of its own in --out.
    """
    from ..lab.reproduce import Settings
    from ..lab.reproduce.catalogue import REPRODUCTIONS, find, list_content, reproduce_document, run
    from ..serialization import provenance

    if name not in ("list", "all"):
        name = find(name)
    if options["choices"] and not name.startswith("f16-"):
        raise ConfigError(f"--set: {name} leaves no choice open, f16-table2 does; leave --set out")
    inputs = () if options["log_path"] is None else (options["log_path"],)
    check_out(options, inputs)
    for figure in REPRODUCTIONS if name == "all" and options["out"] is not None else ():
        check_out({**options, "out": options["out"] / figure}, inputs)
    log = _log(options)
    settings = Settings(log=log, **{key: options[key] for key in ("quick", "trials", "seed", "workers", "choices")})
    origin = provenance(log_sha256=log.sha256 if log else "", seed=settings.seed)
    code = 0
    if name == "list":
        content = list_content()
    elif name == "all":
        content, code = _every(settings, origin, options, inputs)
    else:
        with progress(name, wanted=options["progress"]) as report:
            content = run(name, replace(settings, report=report))
    document = reproduce_document(name, content, origin)
    emit(lambda _: content, document, options, origin=origin, inputs=inputs)
    context.exit(code)


def _log(options: dict[str, Any]) -> FlightLog | None:
    if options["log_path"] is None:
        for key, option in LOG_OPTIONS.items():
            if options[key]:
                raise ConfigError(f"{option}: is about the record of --log, and there is none; give --log FILE")
        return None
    from ..flightlog import read_log

    log = read_log(options["log_path"], **{name: options[name] for name in LOG_OPTIONS})
    return log.window(options["from_s"], options["to_s"])


def _every(
    settings: Settings, origin: Provenance, options: dict[str, Any], inputs: tuple[str, ...]
) -> tuple[ReportContent, int]:
    """Make every reproduction, write each to a folder of `out`, and return the summary and the exit code."""
    from ..lab.reproduce.catalogue import REPRODUCTIONS, reproduce_document, run, summary_content

    shared: dict[tuple[str, str], ReportContent | BfiError] = {}
    made: list[tuple[str, ReportContent | BfiError]] = []
    for name, entry in REPRODUCTIONS.items():
        place = (entry.module, entry.function)
        if place not in shared:
            with progress(name, wanted=options["progress"]) as report:
                try:
                    shared[place] = run(name, replace(settings, report=report))
                except BfiError as error:
                    shared[place] = error
        outcome = shared[place]
        made.append((name, outcome))
        if options["out"] is not None and not isinstance(outcome, BfiError):
            there = {**options, "out": options["out"] / name}
            write(outcome, reproduce_document(name, outcome, origin), there, origin=origin, inputs=inputs)
    codes = [outcome.exit_code for _, outcome in made if isinstance(outcome, BfiError)]
    return summary_content(made), max(codes, default=0)
