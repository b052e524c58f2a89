"""Options that several commands share, as decorators, and what they make of a configuration."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from ..printable import printable

if TYPE_CHECKING:
    from ..config import Config
    from ..dictionary import Dictionary
    from ..flightlog import FlightLog

__all__ = [
    "advise",
    "channel_options",
    "configured",
    "exit_code",
    "force_option",
    "inputs_of",
    "json_option",
    "log_argument",
    "log_of",
    "number_or_word",
    "out_options",
    "outside_option",
    "progress_option",
    "series_option",
    "tell",
    "two_numbers",
    "window_options",
]

Command = Callable[..., Any]

# Where a value of the command line stands in the configuration, and the option that gives it.
PLACES = {
    "inputs": "--input",
    "outputs": "--output",
    "channels": "--channel",
    "units": "--unit",
    "window.from_s": "--from",
    "window.to_s": "--to",
    "conditioning.rate_hz": "--rate",
    "window": "--from/--to",
    "model.order": "--order",
    "model.feedthrough": "--feedthrough",
    "method": "--method",
    "risro.sparsity": "--sparsity",
    "dmae.model": "--model",
    "dictionary": "--dictionary",
    "seed": "--seed",
    "strict": "--strict",
    "fail_on": "--fail-on",
    "start_time.shapes": "--shape",
    "start_time.samples": "--samples",
    "start_time.false_alarm": "--false-alarm",
    "start_time.calibration": "--calibration",
    "start_time.ends": "--ends",
    "start_time.frequency_hz": "--frequency",
    "start_time": "--shape",
    "detect.train": "--train",
    "detect.false_alarm": "--false-alarm",
    "detect.method": "--method",
    "detect.turns": "--turns",
    "detect": "--train",
    "diagnosability.magnitude": "--magnitude",
    "diagnosability.magnitudes": "--magnitude",
    "diagnosability.at_limit": "--at-limit",
    "diagnosability.model": "--model",
    "diagnosability.manoeuvres": "--manoeuvre",
    "diagnosability.noise": "--noise",
    "diagnosability.amplitude_rad": "--amplitude",
    "diagnosability.start_s": "--start",
    "diagnosability.step_s": "--step",
    "diagnosability.duration_s": "--duration",
    "diagnosability.turbulence_m_s": "--turbulence",
    "diagnosability.draws": "--draws",
}
MAPS = ("channels", "units")
NO_ANSWER, FAULT_DECLARED = 4, 10


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
            callback=_pairs("tas=kt"),
            help="The unit of a channel that states none, such as tas=kt; repeatable.",
        ),
        click.option(
            "--channel",
            "channel_map",
            multiple=True,
            metavar="STD=NAME",
            callback=_pairs("tas=my_airspeed"),
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


def outside_option(command: Command) -> Command:
    """Add --allow-outside, passed as `allow_outside`."""
    return click.option(
        "--allow-outside",
        is_flag=True,
        help="Read sample files also where they lie outside the folder of the dictionary or configuration.",
    )(command)


def json_option(command: Command) -> Command:
    """Add --json, passed as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, is_eager=True, help="JSON on stdout in place of a table.")(
        command
    )


def series_option(command: Command) -> Command:
    """Add --json and --series, passed as `as_json` and `series`."""

    def with_json(context: click.Context, _option: click.Parameter, given: bool) -> bool:
        if given and not context.params["as_json"]:
            raise click.UsageError("--series is about --json; add --json", context)
        return given

    said = "With --json: what has an entry per sample or onset, too; result.json of --out always has it."
    return json_option(click.option("--series", is_flag=True, callback=with_json, help=said)(command))


def force_option(command: Command) -> Command:
    """Add --force, passed as `force`."""
    return click.option("--force", is_flag=True, help="Replace files that bfi did not write; never an input.")(command)


def out_options(command: Command) -> Command:
    """Add --out and --force, passed as the path `out` and `force`."""
    path = click.Path(path_type=Path)
    return click.option("--out", type=path, metavar="DIR", help="Write result, report, figures and tables.")(
        force_option(command)
    )


def inputs_of(config: Config, *paths: str | None, dictionary: Dictionary | None = None) -> tuple[str, ...]:
    """Return the files that a command reads: `paths` and those that its configuration and dictionary name."""
    asked = config.start_time
    named = {*paths, config.path, asked.samples, asked.calibration}
    if dictionary is not None:
        named |= {dictionary.path, *(atom.file for atom in dictionary.atoms)}
    return tuple(path for path in named if path)


def advise(flight: FlightLog, config: Config) -> tuple[str, ...]:
    """Return as a note which windows a long log has, and tell it, unless one was asked for."""
    from ..flightlog.quality import advice_on_windows

    if (config.window.from_s, config.window.to_s) != (None, None):
        return ()
    note = advice_on_windows(flight)
    if note is None:
        return ()
    tell(note)
    return (note,)


def progress_option(command: Command) -> Command:
    """Add --progress/--no-progress, passed as `progress`: None where neither is given."""
    shown = "Show it on stderr.  [default: on a terminal]"
    return click.option("--progress/--no-progress", default=None, help=shown)(command)


def tell(sentence: str) -> None:
    """Print a note for the person at the terminal to stderr; silent where stderr is none."""
    if sys.stderr.isatty():
        click.echo(printable(sentence), err=True)


def configured(path: str | None, options: Mapping[str, Any], own: Mapping[str, Any] | None = None) -> Config:
    """Return the configuration of a file (the defaults where there is none) with the command line's values in it.

    Parameters
    ----------
    options : of the command; those that several commands have are put in their places, see `_shared`. The channels and
        units given are added to those of the file.
    own : value of the command's other options by place in the configuration, one of `PLACES`; None where not given.

    Raises
    ------
    ConfigError : everything that is wrong, in one line; values of the command line by the option they came with.
    """
    from ..config import Config, load_config, merge

    given = {**_shared(options), **(own or {})}
    config = load_config(path, allow_outside=options["allow_outside"]) if path is not None else Config()
    maps = {place: {**getattr(config, place), **given[place]} for place in MAPS if given.get(place)}
    try:
        return merge(config, {**given, **dict.fromkeys(MAPS), **maps})
    except ConfigError as error:
        raise ConfigError(_by_option(str(error))) from None


def log_of(path: str, group: str | None, config: Config) -> FlightLog:
    """Read the log of an analysis; of one that is large only the window, the time to learn from and the filter's reach.

    Raises
    ------
    LogError : it cannot be read.
    """
    from ..flightlog import read_log
    from ..flightlog.resampling import with_reach

    from_s, to_s, rate = config.window.from_s, config.window.to_s, config.conditioning.rate_hz
    if config.detect.train is not None and from_s is not None:
        from_s = min(from_s, config.detect.train[0])
    from_s, to_s = with_reach(rate if isinstance(rate, float) else None, from_s, to_s)
    names = {"channel_map": dict(config.channels), "unit_map": dict(config.units)}
    return read_log(path, group=group, from_s=from_s, to_s=to_s, **names)


def _shared(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of the options that most analyses of a log have, by place; None for what a command has not."""
    return {
        "inputs": options["inputs"] or None,
        "outputs": options["outputs"] or None,
        "channels": options["channel_map"],
        "units": options["unit_map"],
        "window.from_s": options["from_s"],
        "window.to_s": options["to_s"],
        "conditioning.rate_hz": number_or_word(options["rate"]),
        "model.order": number_or_word(options.get("order")),
        "model.feedthrough": options.get("feedthrough"),
        **{place: options.get(place) for place in ("dictionary", "seed", "strict", "fail_on")},
    }


def exit_code(config: Config, *, trusted: bool, decision: str) -> int:
    """Return the exit code of an answer: 4 for --strict without trust in it, 10 for --fail-on fault with one, 0."""
    if config.strict and not trusted:
        return NO_ANSWER
    return FAULT_DECLARED if config.fail_on == "fault" and decision == "fault" else 0


def two_numbers(text: str | None, what: str, example: str) -> tuple[float, float] | None:
    """Return the numbers of an option's text A:B, None where it was not given.

    Raises
    ------
    ConfigError : it is no such text; `what` it should be, and an `example` with the option's name.
    """
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        if colon:
            return float(first), float(last)
    except ValueError:
        pass
    raise ConfigError(f"{example.partition(' ')[0]}: not {what}, got {text}; write {example}")


def _by_option(complaints: str) -> str:
    """Return complaints about places of the configuration with the options in their stead."""
    _, _, text = complaints.partition(": ")
    return " | ".join(map(_renamed, text.split(" | ")))


def _renamed(complaint: str) -> str:
    place, colon, what = complaint.partition(": ")
    option = PLACES.get(place.partition("[")[0])
    return f"{option}: {what}" if colon and option else f"command line: {complaint}"


def number_or_word(text: str | None) -> int | float | str | None:
    """Return the number an option's text states, else the text."""
    if text is None:
        return None
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            continue
    return text


def _pairs(example: str) -> Callable[[click.Context, click.Parameter, tuple[str, ...]], dict[str, str]]:
    def read(_context: click.Context, option: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
        pairs: dict[str, str] = {}
        for value in values:
            key, sign, right = (part.strip() for part in value.partition("="))
            if not (key and sign and right):
                write = f"write {option.opts[0]} {example}"
                raise click.BadParameter(f"expected {option.metavar}, got '{value}'; {write}", param=option)
            if key in pairs:
                twice = f"'{key}' is given twice, as '{pairs[key]}' and '{right}'; keep one"
                raise click.BadParameter(twice, param=option)
            pairs[key] = right
        return pairs

    return read
