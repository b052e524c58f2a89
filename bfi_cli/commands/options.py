"""Options that several commands share, as decorators."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import click

__all__ = ["channel_options", "json_option", "log_argument", "window_options"]

Command = Callable[..., Any]


def log_argument(command: Command) -> Command:
    """Add the argument LOG, passed as `log`."""
    return click.argument("log", metavar="LOG", type=click.Path())(command)


def channel_options(command: Command) -> Command:
    """Add --channel, --unit and --group, passed as the dicts `channel_map`, `unit_map` and the name `group`."""
    for option in (
        click.option("--group", metavar="NAME", help="HDF5 group or MATLAB struct that holds the channels."),
        click.option(
            "--unit",
            "unit_map",
            multiple=True,
            metavar="NAME=UNIT",
            callback=_pairs,
            help="The unit of a channel that states none, such as tas=kt; repeatable.",
        ),
        click.option(
            "--channel",
            "channel_map",
            multiple=True,
            metavar="STD=NAME",
            callback=_pairs,
            help="Take the channel NAME of the file as STD, such as tas=my_airspeed; repeatable.",
        ),
    ):
        command = option(command)
    return command


def window_options(command: Command) -> Command:
    """Add --from and --to, seconds on the log's own time axis, passed as `from_s` and `to_s`."""
    command = click.option("--to", "to_s", type=float, metavar="S", help="End of the window, in the log's seconds.")(
        command
    )
    return click.option("--from", "from_s", type=float, metavar="S", help="Start of the window.")(command)


def json_option(command: Command) -> Command:
    """Add --json, passed as `as_json`: true also where stdout is not a terminal."""
    return click.option(
        "--json",
        "as_json",
        is_flag=True,
        callback=lambda _context, _option, given: given or not sys.stdout.isatty(),
        help="JSON on stdout (the default when stdout is not a terminal).",
    )(command)


def _pairs(_context: click.Context, option: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for value in values:
        key, sign, right = (part.strip() for part in value.partition("="))
        if not (key and sign and right):
            raise click.BadParameter(f"expected {option.metavar}, got '{value}'", param=option)
        if key in pairs:
            raise click.BadParameter(f"'{key}' is given twice, as '{pairs[key]}' and '{right}'", param=option)
        pairs[key] = right
    return pairs
