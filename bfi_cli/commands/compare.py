"""`bfi compare`: every method on one log, side by side."""

from __future__ import annotations

from functools import partial

import click

from ..errors import ConfigError
from .analysis import Answer, Asked, analysis
from .options import FILES, MODEL, SIGNALS, log_argument, pairs
from .output import note


@analysis(
    "compare",
    log_argument,
    *("config_path", "dictionary", *SIGNALS, "fix_units", *MODEL, "model", "seed"),
    click.option("--only", metavar="NAME", multiple=True, help="Run this method; repeatable.  [default: all]"),
    click.option(
        "--program",
        "programs",
        metavar="NAME=PATH",
        multiple=True,
        callback=pairs("mine=./my_method"),
        help="Run this executable too: it reads a log file and writes JSON; repeatable.",
    ),
    click.option(
        "--timeout",
        "timeout_s",
        metavar="S",
        type=click.FloatRange(min=0, min_open=True),
        default=60.0,
        show_default=True,
        help="Longest time of a program of --program.",
    ),
    *(*FILES, "progress", "verbose", "as_json", "series"),
    dictionary="YAML dictionary of the faults to look for.  [default: any fault]",
)
def command(asked: Asked) -> Answer:
    """Run every method on LOG and compare what they say, against the injected faults where the log knows them.

    A method that lacks a channel, a model or a dictionary stands in the table with the reason.
    """
    from ..faults import did_you_mean
    from ..lab.compare import PEERS, compare_content, compare_document
    from ..lab.compare.programs import program_peer
    from ..library import compare

    programs = asked.options["programs"]
    peers = {**PEERS, **{name: program_peer(path, asked.options["timeout_s"]) for name, path in programs.items()}}
    for name in asked.options["only"]:
        if name not in peers:
            raise ConfigError(f"--only: no method '{name}'{did_you_mean(name, list(peers))}")
    if taken := PEERS.keys() & programs.keys():
        raise ConfigError(f"--program: '{sorted(taken)[0]}' is a method of this program; give another name")
    wanted = {*(asked.options["only"] or peers), *programs}
    asked.check_out(("comparison",), ("methods", "refused"))
    flight = asked.flight()
    result = compare(
        flight,
        config=asked.config,
        peers={name: peer for name, peer in peers.items() if name in wanted},
        allow_outside=asked.options["allow_outside"],
        progress=asked.progress,
        tell=note,
    )
    return Answer(
        document=partial(compare_document, result),
        content=compare_content,
        log_sha256=flight.sha256,
        dictionary=asked.dictionary,
    )
