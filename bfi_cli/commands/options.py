"""The options with a key in the configuration or of several commands, one row each, and the configuration from them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from ..methods import METHODS

if TYPE_CHECKING:
    from ..config import Config

Command = Callable[..., Any]
Callback = Callable[[click.Context, click.Parameter, Any], Any]

# The methods of `bfi start-time` as --method calls them, and as the key `method` does.
SCAN_METHODS = {"scan": "ml", "thesis": "risro"}


def pairs(example: str, convert: Callable[[str], Any] = str, *, bare: bool = False) -> Callback:
    """Return a callback that reads texts NAME=VALUE of a repeatable option into a dict of values by name.

    Parameters
    ----------
    example : a correct text, for messages.
    convert : from a text to the value; raises ValueError for a text that is no value.
    bare : a value may stand without a name; its name is "".
    """

    def read(_context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> dict[str, Any]:
        flag, given = option.opts[0], dict[str, str]()
        for text in texts:
            # The name of a channel in a file may hold an equals sign, and so may the name of a fault.
            name, sign, value = (part.strip() for part in (text.partition if convert is str else text.rpartition)("="))
            try:
                if not value or bool(name) != bool(sign) or not (sign or bare):
                    raise ValueError
                convert(value)
            except ValueError:
                what = f"expected {option.metavar}, got '{text}'"
                raise ConfigError(f"{flag}: {what}; write {flag} {example}") from None
            if name in given:
                what = f"'{name or 'all'}' is given twice, as '{given[name]}' and '{value}'"
                raise ConfigError(f"{flag}: {what}; keep one")
            given[name] = value
        return {name: convert(value) for name, value in given.items()}

    return read


def _two_numbers(what: str, example: str) -> Callback:
    """Return a callback that reads a text A:B into its numbers; `what` names the option's value in messages."""

    def read(_context: click.Context, option: click.Parameter, text: str | None) -> tuple[float, float] | None:
        if text is None:
            return None
        first, _, last = text.partition(":")
        try:
            return float(first), float(last)
        except ValueError:
            flag = option.opts[0]
            raise ConfigError(f"{flag}: not {what}, got {text}; write {flag} {example}") from None

    return read


def _number_or_word(_context: click.Context, _option: click.Parameter, text: str | None) -> int | float | str | None:
    for number in (int, float):
        with contextlib.suppress(ValueError):
            return text if text is None else number(text)
    return text


def _choice(values: Callable[[], Mapping[str, str]]) -> Callback:
    """Return a callback that reads one of some words as its value; `values` is called where a word is given."""

    def read(_context: click.Context, option: click.Parameter, word: str | None) -> str | None:
        if word is None:
            return None
        from ..faults import did_you_mean, shown

        if word not in (known := values()):
            what = f"not one of the choices, got {shown(word)}{did_you_mean(word, list(known))}"
            raise ConfigError(f"{option.opts[0]}: {what}")
        return known[word]

    return read


def _systems_of_units() -> dict[str, str]:
    from ..quantities.text import UNITS

    return {name: name for name in UNITS}


def _tolerances(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> dict[str, float | str]:
    """Return numbers, in SI, and texts with a unit, which the configuration converts."""
    given: dict[str, float | str] = {}
    for name, text in pairs("tas=2.6, or tas=5kt")(context, option, texts).items():
        try:
            given[name] = float(text)
        except ValueError:
            given[name] = text
    return given


def _magnitudes(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> dict[str, float]:
    """Return magnitudes by name; the one without a name is that of the option `magnitude`."""
    given: dict[str, float] = pairs("0.5 or --magnitude NAME=0.5", float, bare=True)(context, option, texts)
    context.params["magnitude"] = given.pop("", None)
    return given


def _events(_context: click.Context, _option: click.Parameter, texts: tuple[str, ...]) -> list[dict[str, str | float]]:
    """Return ordinary causes with their times, s."""
    if not texts:
        return []
    from ..faults.ordinary import parse_occurrence

    stated = [parse_occurrence(text, where="--event") for text in texts]
    return [{"cause": occurrence.cause, "at_s": occurrence.at_s} for occurrence in stated]


def _with_json(context: click.Context, _option: click.Parameter, given: bool) -> bool:
    if given and not context.params["as_json"]:
        raise click.UsageError("--series is about --json; add --json", context)
    return given


KINDS: Mapping[str, Mapping[str, Any]] = {
    "text": {},
    "texts": {"multiple": True},
    "number": {"type": float},
    "positive": {"type": click.FloatRange(min=0, min_open=True)},
    "whole": {"type": int},
    "count": {"type": click.IntRange(min=1)},
    "flag": {"is_flag": True},
    "fleet_key": {"type": click.Choice(["aircraft"])},
    "choice": {"default": None},  # --this/--no-this, None where neither is given
    "request": {"is_flag": True, "default": None},  # flag; unset means the configuration's value
    "path": {"type": click.Path(path_type=Path)},
    "new_file": {"type": click.Path(path_type=Path), "required": True},
    "json": {"is_flag": True, "is_eager": True},
    "series": {"is_flag": True, "callback": _with_json},
    "number_or_word": {"callback": _number_or_word},
    "channels": {"multiple": True, "callback": pairs("tas=my_airspeed")},
    "units": {"multiple": True, "callback": pairs("tas=kt")},
    "noise": {"multiple": True, "callback": pairs("tas=0.01", float)},
    "tolerances": {"multiple": True, "callback": _tolerances},
    "shown_units": {"callback": _choice(_systems_of_units)},
    "kinds": {"callback": lambda _context, _option, text: tuple(map(str.strip, text.split(","))) if text else ()},
    "magnitudes": {"multiple": True, "callback": _magnitudes},
    "events": {"multiple": True, "callback": _events},
    "band": {"callback": _two_numbers("a band", "0.1:2, in Hz")},
    "stretch": {"callback": _two_numbers("a stretch of time", "1160:1500, in s")},
    "scan_method": {"callback": _choice(lambda: SCAN_METHODS)},
}

# One row per option: its name as argument of the command, its flags, its key in the configuration ("-" for an option of
# a single call, such as --out), its metavar and its kind; below, its help.
TABLE = f"""
config_path  -c,--config  -  FILE  text
    YAML configuration; the command line wins.
dictionary  -d,--dictionary  dictionary  FILE  text
    YAML dictionary of the faults to look for.  [default: the onset scan]
inputs  --input  inputs  NAME  texts
    An input; repeatable; auto is every trusted channel.  [default: auto; of published methods elevator]
outputs  --output  outputs  NAME  texts
    An output; repeatable.  [default: tas]
from_s  --from  window.from_s  S  number
    Start of the window.
to_s  --to  window.to_s  S  number
    End of the window, in the log's seconds.
channel_map  --channel  channels  STD=NAME  channels
    Take the channel NAME of the file as STD, such as tas=my_airspeed; repeatable.
unit_map  --unit  units  NAME=UNIT  units
    The unit of a channel that states none, such as tas=kt; repeatable.
fix_units  --fix-units  fix_units  -  request
    Read channels in the unit and with the sign that the other channels show, where that is certain.
group  --group  group  NAME  text
    HDF5 group or MATLAB struct that holds the channels.
sample_rate_hz  --sample-rate  sample_rate_hz  HZ  positive
    Samples per second of a log that has no time axis.
columns  --columns  columns  NAMES  kinds
    Names of the columns of a table of numbers without a header, time,elevator,tas.
keep  --keep  keep  NAME  texts
    Keep a channel of another number of samples, as even over the log; repeatable.
fill_s  --fill  fill_s  S  positive
    Interpolate stretches of missing samples (NaN) up to this long.  [default: none]
boot  --boot  boot  N  whole
    Which part of a log whose clock starts again.  [default: the one with the longest flight]
rate  --rate  conditioning.rate_hz  HZ|none|auto  number_or_word
    Rate of the analysis; none is the log's own.  [default: auto]
order  --order  model.order  N|auto  number_or_word
    Number of lags of the model.  [default: auto]
feedthrough  --feedthrough/--no-feedthrough  model.feedthrough  -  choice
    Inputs act in the same sample too.
recorder  --recorder  recorder.edge_hz  HZ|none|auto  number_or_word
    Where the recorder's low-pass has half its gain; auto takes what the log states or shows.  [default: auto]
onset_tolerance  --onset-tolerance  onset_tolerance_s  S  number
    How well the onsets of the dictionary are known.  [default: 1]
require  --require  require  KINDS  kinds
    Kinds of fault that must be excluded for a no_fault: abrupt,oscillating,slow.  [default: all]
tolerance  --tolerance  tolerances  CHANNEL=VALUE  tolerances
    Largest error that may stay unseen, SI or with unit, tas=5kt; repeatable.  [default: by channel, tas 3 % or 5 kt]
together  --together  -  -  flag
    Further logs of this aircraft without a fault, FILE or FILE@FROM:TO, share its model with LOG.
method  --method  method  NAME  text
    Method of identification: {", ".join(METHODS)}.  [default: ml]
sparsity  --sparsity  risro.sparsity  KIND  text
    Stage of method risro: none, l1, lp, exp-l0.  [default: exp-l0]
model  --model  dmae.model  NAME  text
    A linear model of bfi simulate, for method dmae.
seed  --seed  seed  N  whole
    Random seed.  [default: 0]
shapes  --shape  start_time.shapes  NAME  texts
    {{scanned}}; repeatable.  [default: bias, drift, sine]
false_alarm  --false-alarm  start_time.false_alarm  P  number
    Accepted rate of false alarms.  [default: 0.01]
calibration  --calibration  start_time.calibration  auto|FILE|self|gaussian  text
    Where the threshold comes from: a table, the log's own windows, or white noise.  [default: auto]
ends  --ends/--no-ends  start_time.ends  -  choice
    Search for the end of the fault too.
samples  --samples  start_time.samples  FILE  text
    CSV of time, value: a shape of your own, with --shape samples.
frequency  --frequency  start_time.frequency_hz  LO:HI  band
    Band of the oscillations, Hz.  [default: 3/window to 0.2 x rate]
scan_method  --method  method  -  scan_method
    scan, or thesis (one solve per onset, as published).  [default: scan]
length_s  --length  calibrate.length_s  S  positive
    Length of a window.  [default: 120, or the whole of a shorter log]
step_s  --step  calibrate.step_s  S  positive
    Time between the starts of windows.  [default: half a window]
train  --train  detect.train  A:B  stretch
    Time known to be healthy.  [default: the first third of the flight in the window]
detect_false_alarm  --false-alarm  detect.false_alarm  P  number
    Accepted rate of false alarms per record.  [default: 0.01]
detect_method  --method  detect.method  auto|exact|parity  text
    Method of detection; exact is for data without any noise.  [default: auto]
diagnose_false_alarm  --false-alarm  diagnose.false_alarm  P  number
    Accepted rate of false alarms of a whole healthy flight.  [default: 0.05]
diagnose_calibration  --calibration  diagnose.calibration  FILE  text
    Air data of this aircraft by bfi calibrate: angle of zero lift, thresholds.  [default: the flight, shipped tables]
judge  --judge/--no-judge  diagnose.judge  -  choice
    Weigh events in one likelihood of all channels, against ordinary causes.  [default: judge]
events  --event  diagnose.events  CAUSE@S  events
    What is known to have happened, as flaps@4780: no fault is seen in it; repeatable.
turns  --turns/--no-turns  detect.turns  -  choice
    Explain turns by roll and yaw_rate.  [default: turns]
magnitude  --magnitude  diagnosability.magnitude  Z  number
    The magnitude that --magnitude gives without a name.
magnitudes  --magnitude  diagnosability.magnitudes  Z|NAME=Z  magnitudes
    Root mean square of all magnitudes, or of one fault's; repeatable.  [default: 1]
at_limit  --at-limit  diagnosability.at_limit  -  request
    Give magnitudes as multiples of the minimal detectable magnitude.
flown_model  --model  diagnosability.model  NAME  text
    Fly this model of bfi simulate in place of a LOG.
manoeuvres  --manoeuvre  diagnosability.manoeuvres  NAME  texts
    Manoeuvre to compare; repeatable.  [default: 3211, doublet, multisine]
noise  --noise  diagnosability.noise  NAME=SD  noise
    White noise of a model's output; repeatable.
amplitude_rad  --amplitude  diagnosability.amplitude_rad  RAD  number
    Largest deflection.  [default: 0.035]
start_s  --start  diagnosability.start_s  S  number
    When the manoeuvre starts.  [default: 0.2]
unit_step_s  --step  diagnosability.step_s  S  number
    The manoeuvre's unit step.  [default: 1]
flight_s  --duration  diagnosability.duration_s  S  number
    Length of the flight.  [default: 31.72]
turbulence_m_s  --turbulence  diagnosability.turbulence_m_s  SIGMA  number
    Dryden gusts, m/s.  [default: 0]
draws  --draws  diagnosability.draws  N  whole
    Draws of the noise for each manoeuvre.  [default: 5]
duration_s  --duration  audit.duration_s  S  number
    Length of the window; only without a LOG.
allow_outside  --allow-outside  -  -  flag
    Read sample files also where they lie outside the folder of the dictionary or configuration.
units  --units  shown_units  si|aviation  shown_units
    Units of tables, figures and reports; aviation: kt, ft, ft/min, deg, degC, hPa. Files stay SI.  [default: si]
out_file  -o,--output  -  OUT  new_file
    The file to write, .h5, .csv or .mcap.
out  --out  -  DIR  path
    Write result, report, figures and tables.
force  --force  -  -  flag
    Replace files that bfi did not write; never an input.
strict  --strict  strict  -  request
    Exit 4 where there is no trustworthy answer.
fail_on  --fail-on  fail_on  fault|deviation  text
    Exit 10 where a fault is declared; deviation: an error within its tolerance too.
progress  --progress/--no-progress  -  -  choice
    Show progress on stderr.  [default: on a terminal]
verbose  --verbose,-v  -  -  flag
    Print every table, fact and note of the answer, not its first screen
explain  --explain  -  -  flag
    For every column of the file what it was taken for, in which unit, and why.
recursive  --recursive  -  -  flag
    Of a folder, the logs of the folders within too.
list_file  --list  -  FILE  text
    Logs to analyse, a path a line or CSV with a column log, and aircraft where known; - is stdin.
prove  --prove  -  -  flag
    Add faults of the stated limits to LOG, 20 of each kind at random onsets, and count those that are found.
by  --by  -  aircraft  fleet_key
    Compare the flights of each aircraft: constant errors that change from flight to flight.
jsonl  --jsonl  -  FILE  path
    Write a document a line as they come, without what has an entry per sample.
workers  --workers  -  N  count
    Processes; the numbers are the same.  [default: cores]
scheduler  --scheduler  -  ADDRESS  text
    Dask scheduler whose workers analyse the logs.
as_json  --json  -  -  json
    JSON on stdout in place of a table.
series  --series  -  -  series
    With --json: what has an entry per sample or onset, too; result.json of --out always has it.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """A row of the table; `key` is None without a key in the configuration, `settings` are those of `click.option`."""

    flags: tuple[str, ...]
    key: str | None
    settings: Mapping[str, Any]


def _rows() -> dict[str, Option]:
    lines, rows = TABLE.strip().splitlines(), {}
    for head, words in zip(lines[::2], lines[1::2], strict=True):
        name, flags, key, metavar, kind = head.split()
        settings = {"metavar": None if metavar == "-" else metavar, "help": words.strip(), **KINDS[kind]}
        rows[name] = Option(flags=(*flags.split(","), name), key=None if key == "-" else key, settings=settings)
    return rows


OPTIONS = _rows()
# The long flag of every key, for messages.
FLAGS = {row.key: row.flags[-2].partition("/")[0] for row in OPTIONS.values() if row.key}
CHANNELS = ("channel_map", "unit_map", "group", "sample_rate_hz", "columns", "keep", "fill_s", "boot")
SIGNALS = ("inputs", "outputs", "from_s", "to_s", *CHANNELS, "rate", "recorder")
MODEL = ("order", "feedthrough")
VERDICT = ("require", "tolerance")
FILES = ("allow_outside", "units", "out", "force")
FLEET = ("recursive", "list_file", "jsonl", "workers", "scheduler")
ANSWER = (*FILES, "strict", "fail_on", "progress", "verbose", "as_json", "series")
# Options by their heading in `--help`, the most used first.
HELP_GROUPS: Mapping[str, tuple[str, ...]] = {
    "Common options": (
        *("config_path", "dictionary", "inputs", "outputs", "from_s", "to_s"),
        *("tolerance", "units", "out", "as_json"),
    ),
    "Reading the log": (*CHANNELS, "fix_units", "explain", "allow_outside"),
    "Model and method": (
        *(
            "rate",
            "recorder",
            *MODEL,
            "together",
            "method",
            "scan_method",
            "detect_method",
            "sparsity",
            "model",
            "seed",
        ),
        *("flown_model", "manoeuvres", "noise", "amplitude_rad", "start_s", "unit_step_s", "flight_s"),
        *("turbulence_m_s", "draws"),
    ),
    "Search and decision": (
        *("onset_tolerance", "shapes", "frequency", "samples", "ends", "train", "turns", "false_alarm"),
        *("detect_false_alarm", "diagnose_false_alarm", "calibration", "diagnose_calibration", "judge"),
        "events",
        *("magnitudes", "at_limit", "duration_s", "length_s", "step_s", "require", "prove"),
    ),
    "Many logs": (*FLEET, "by"),
    "Output": ("verbose", "series", "strict", "fail_on", "force", "progress"),
}


def with_options(*options: str | Command, **words: str) -> Callable[[Command], Command]:
    """Return the decorator that adds options to a command, in this order.

    Parameters
    ----------
    options : names of `OPTIONS`, and decorators of click for options of this command alone.
    words : by name, the help in place of the table's, for an option with a special meaning in this command.
    """

    def add(command: Command) -> Command:
        for option in reversed(options):
            if not isinstance(option, str):
                command = option(command)
                continue
            row = OPTIONS[option]
            text = words.get(option, row.settings["help"])
            if "{scanned}" in text:  # imports numpy, for which other commands need not wait
                from ..faults.shapes import SCANNED

                text = text.format(scanned=f"{', '.join(SCANNED[:-1])} or {SCANNED[-1]}")
            command = click.option(*row.flags, **{**row.settings, "help": text})(command)
        return command

    return add


class GroupedCommand(click.Command):
    """A command whose help lists its options by topic, the most used first."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        options = [parameter for parameter in self.get_params(ctx) if isinstance(parameter, click.Option)]
        rows = {option.name: row for option in options if (row := option.get_help_record(ctx)) is not None}
        for title, names in HELP_GROUPS.items():
            if group := [rows.pop(name) for name in names if name in rows]:
                with formatter.section(title):
                    formatter.write_dl(group)
        if rows:  # --help, and options of this command alone
            with formatter.section("Other options"):
                formatter.write_dl(list(rows.values()))


log_argument = click.argument("log", metavar="LOG", type=click.Path())
# Where none is given, --list may name them.
fleet_argument = click.argument("logs", metavar="LOG...", nargs=-1, type=click.Path())
logs_argument = click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path())


def config_of(path: str | None, given: Mapping[str, Any]) -> Config:
    """Return the configuration of a file, or the defaults, merged with the values of the command line.

    Parameters
    ----------
    given : the command's options by their names in `OPTIONS`. Channels, units and tolerances are added to those of the
        file, every other value replaces that of the file.

    Raises
    ------
    ConfigError : all complaints in one line, those about the command line by option.
    """
    from ..config import Config, load_config, merge

    config = load_config(path, allow_outside=given["allow_outside"]) if path is not None else Config()
    named = {OPTIONS[name].key: value for name, value in given.items() if name in OPTIONS}
    values = {key: value for key, value in named.items() if key and value is not None and value not in ((), {}, [])}
    flags = {key: FLAGS[key] for key in values}
    for key in {"channels", "units", "tolerances"} & values.keys():
        flags |= {f"{key}.{name}": FLAGS[key] for name in values[key]}
        values[key] = {**getattr(config, key), **values[key]}
    try:
        return merge(config, values, flags=flags)
    except ConfigError as error:
        complaints = str(error).partition(": ")[2].split(" | ")
        raise ConfigError(" | ".join(_by_option(complaint, values) for complaint in complaints)) from None


def _by_option(complaint: str, values: Mapping[str, Any]) -> str:
    """Return a complaint about a key, or about a whole section, with the options given for it in place of the key."""
    place, colon, what = complaint.partition(": ")
    key = place.partition("[")[0]
    section, _, name = key.partition(".")
    if name and section in values:  # an entry of a mapping
        key, what = section, f"{name}: {what}"
    flags = [
        flag
        for config_key, flag in FLAGS.items()
        if config_key in values and (config_key == key or config_key.startswith(f"{key}."))
    ]
    return f"{'/'.join(flags)}: {what}" if colon and flags else f"command line: {complaint}"
