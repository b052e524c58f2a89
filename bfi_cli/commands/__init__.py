"""The `bfi` command: a lazily loaded click command per file; errors become a line and an exit code here only."""

from __future__ import annotations

import atexit
import contextlib
import errno
import gc
import importlib
import io
import os
import re
import signal
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import TextIO

import click

from .. import __version__
from ..errors import BfiError, reason_of
from ..printable import SHOWN, shortened

__all__ = ["COMMANDS", "cli", "main", "run_command"]

COMMANDS = {
    "info": "Channels, units, rate, gaps, held samples, excitation of a log.",
    "plot": "The channels of a log over time, with the phases of the flight and windows to analyse.",
    "convert": "Any readable log to HDF5 or CSV, resampled, units normalised.",
    "simulate": "A flight log from an aircraft model.",
    "inject": "Add faults to a log; the truth is stored in the file.",
    "dictionary": "Audit a fault dictionary, on a log if one is given.",
    "diagnosability": "How well each fault can be seen and told from the others, in a log or before the flight.",
    "identify": "Which faults of a dictionary are present, how large, how sure.",
    "start-time": "When a fault started (and ended), of which shape: the scan over all onsets.",
    "diagnose": "Which air-data fault hit a whole flight: every analysis that the log allows, one verdict, one report.",
    "calibrate": "The scan's statistic on fault-free logs, for thresholds and p-values.",
    "detect": "Which channel of a log fails, and when, without a dictionary: the null-space detector.",
    "compare": "Every method on one log in one table, against injected faults or each other.",
    "montecarlo": "Sweeps over faults, noise and settings: rates with intervals, tables, figures.",
    "reproduce": "A published figure or table, ours beside theirs.",
    "report": "Draw the report of a stored result.",
}
# Exit codes of the contract; 70 is EX_SOFTWARE of sysexits.h, 130 is 128 plus the number of SIGINT.
USAGE, LOG, DEFECT, INTERRUPTED = 2, 3, 70, 130
# Letters of an error line, 40 rows of a terminal of 100 columns, for long lists of channels; its middle is left out,
# since place and remedy stand at the ends. Quoted values are shortened where they are quoted.
LONGEST_LINE = 4000

# Names of our options in other programs that are not spelt alike.
MEANT = {
    "--start": "--from",
    "--begin": "--from",
    "--end": "--to",
    "--stop": "--to",
    "-o": "--out",
    "--output-dir": "--out",
}

# New objects between searches for circles of references: imports make a hundred thousand that stay, and to search
# them again and again takes an eighth of a short command.
COLLECTED = (200_000, 20, 100)

# Patterns of click's messages about a value, and the messages of this program for them.
VALUES = (
    (r"(?P<got>.+) is not a valid (?:integer|integer range)", "not a whole number, got {got}; give one like 4"),
    (r"(?P<got>.+) is not a valid (?:float|float range)", "not a number, got {got}; give one like 12.5"),
    (r"(?P<got>\S+) is not in the range x>=(?P<low>\S+)", "too small, got {got}; give {low} or more"),
    (r"(?P<got>.+) is not in the range (?P<range>.+)", "out of range, got {got}; give a number of {range}"),
    (r"(?P<got>.+) is not one of (?P<known>.+)", "not one of the choices, got {got}; known: {known}"),
)


class LazyGroup(click.Group):
    """A group that imports a command's module when the command runs, not when help is shown."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        # First, and from few calls: where many lead to numpy's import, a thousand of its calls cross the border between
        # two pieces of the interpreter's stack, and each takes a piece from the system and gives it back.
        importlib.import_module("numpy")
        module = importlib.import_module(f"{__name__}.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            hint = _did_you_mean(args[0], COMMANDS) or f"known: {', '.join(COMMANDS)}"
            raise click.UsageError(f"unknown command '{args[0]}'; {hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands, in the order of the work"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=LazyGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(__version__, prog_name="bfi")
@click.pass_context
def cli(context: click.Context) -> None:
    """Blind fault identification: which air-data fault hit an aircraft, when, how large and how sure, from one log."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help(), err=True)
        context.exit(USAGE)


def main(argv: list[str] | None = None) -> None:
    """Run the command line and exit with a code of the contract (never 1, never a traceback)."""
    if "_BFI_COMPLETE" in os.environ:
        cli(prog_name="bfi")
    code: int | None = None

    def leave() -> None:
        if code is not None:
            with contextlib.suppress(OSError):
                sys.stderr.flush()
            os._exit(code)

    # Registered first, and therefore called last. The system takes all memory back at once; the interpreter would free
    # object by object, which takes a fortieth of a short command. And it would end by the signal, whatever sys.exit
    # says, where an interruption passed through an exec of text, as the making of a dataclass is: scripts are promised
    # 130.
    atexit.register(leave)
    # SIGTERM, and SIGHUP of a terminal that is closed, exit with the shell's code for it, after open files are closed,
    # the workers have ended and the cursor is shown again. What nohup ignores stays ignored.
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda number, _frame: sys.exit(128 + number))
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    gc.set_threshold(*COLLECTED)
    # pydantic would search every installed package for plugins, on which no check of an input may depend.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    _open_streams()
    code = run_command(argv)
    sys.exit(code)


def _open_streams() -> None:
    """Make the standard streams accept any text, and open those that the caller closed, by order of their numbers."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        stream: TextIO | None = getattr(sys, name)
        file: int | None = None
        if stream is None:
            # Closed by the caller. A file of ours would else take its number, and be printed into. Stdout cannot be
            # written then, so that an answer is not lost without a word.
            file = os.open(os.devnull, os.O_WRONLY if name == "stderr" else os.O_RDONLY)
        elif number and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=SHOWN)
            if isinstance(stream.buffer, io.RawIOBase):
                # PYTHONUNBUFFERED: a raw stream forgets what a full disk did not take of a long answer.
                file = stream.fileno()
        if file is not None:
            encoding = "utf-8" if stream is None else stream.encoding
            opened = open(file, "w" if number else "r", encoding=encoding, errors=SHOWN, closefd=False)  # noqa: SIM115
            setattr(sys, name, opened)


def run_command(argv: Sequence[str] | None) -> int:
    """Run one command line and return its exit code; only exceptions that end the interpreter are raised."""
    try:
        with cli.make_context("bfi", list(sys.argv[1:] if argv is None else argv)) as context:
            cli.invoke(context)
        sys.stdout.flush()
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except click.ClickException as error:
        return _complain(_usage(error), USAGE)
    except BfiError as error:
        return _complain(str(error), error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        return _complain("bfi: interrupted", INTERRUPTED)
    except BrokenPipeError:
        _close_output(sys.stdout, sys.stderr)
        return 0
    except MemoryError:
        return _complain("bfi: out of memory; choose a shorter window or a lower --rate", LOG)
    except Exception as error:
        if isinstance(error, OSError) and (error.errno == errno.ENOSPC or not _flushed()):
            what = f"stdout: cannot be written, {reason_of(error)}"
            return _complain(f"{what}; free some space, or write elsewhere", USAGE)
        return _complain(crash_line(error), DEFECT)
    finally:
        _flushed()
    return 0


def _usage(error: click.ClickException) -> str:
    """Return click's complaint about a command line in the words of this program."""
    context = getattr(error, "ctx", None)
    program = context.command_path if context else "bfi"
    text = error.message.strip().rstrip(".")
    match error:
        case click.NoSuchOption(option_name=name):
            known = [option for parameter in context.command.params for option in parameter.opts] if context else []
            meant = f"did you mean '{MEANT[name]}'?" if MEANT.get(name) in known else _did_you_mean(name, known)
            return f"{program}: unknown option '{name}'; {meant or f'see {program} --help'}"
        case click.MissingParameter(param=click.Option(opts=options, metavar=example)):
            return f"{program}: {options[-1]} is missing; give {options[-1]} {example or 'a value'}"
        case click.MissingParameter(param=click.Argument() as argument):
            return f"{program}: {argument.human_readable_name} is missing; see {program} --help"
        case click.BadOptionUsage(option_name=name):
            takes_none = "take a value" in text
            return f"{name}: takes no value; write {name}" if takes_none else f"{name}: no value; write {name} VALUE"
        case click.BadParameter(param=click.Parameter(opts=options)):
            sentences = (
                sentence.format(**m.groupdict()) for pattern, sentence in VALUES if (m := re.fullmatch(pattern, text))
            )
            return f"{options[-1]}: {next(sentences, text)}"
    what = text[:1].lower() + text[1:]
    return f"{program}: {what}" if ";" in what else f"{program}: {what}; see {program} --help"


def _did_you_mean(word: str, known: Iterable[str]) -> str:
    import difflib

    close = difflib.get_close_matches(word, known, n=1)
    return f"did you mean '{close[0]}'?" if close else ""


def _complain(message: str, code: int) -> int:
    try:
        print(shortened(message.strip(), LONGEST_LINE), file=sys.stderr, flush=True)
    except OSError:
        _close_output(sys.stderr)
    return code


def _flushed() -> bool:
    """Flush stdout and return whether that succeeded; after a failure its output is dropped."""
    try:
        sys.stdout.flush()
    except OSError:
        _close_output(sys.stdout)
        return False
    return True


def _close_output(*streams: TextIO) -> None:
    """Redirect streams to the null device, so that the interpreter's last flush of them cannot fail."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in streams:
        with contextlib.suppress(OSError):  # a stream without a file number has no pipe
            os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def crash_line(error: Exception) -> str:
    """Write a crash file for a maintainer, without data of the user; return the line to print."""
    import tempfile

    what = f"bfi: internal error, {type(error).__name__}"
    text = "".join(f"{line}\n" for line in _crash_lines(error))
    try:
        with tempfile.NamedTemporaryFile("wb", prefix="bfi-crash-", suffix=".txt", delete=False) as file:
            file.write(text.encode("utf-8", SHOWN))
    except OSError as full:
        return f"{what}; report it (no crash file, {reason_of(full)})"
    return f"{what}; report it with {file.name}"


def _crash_lines(error: BaseException) -> Iterator[str]:
    """Yield versions, command and options without their values, and per exception the frames and its type.

    The message of an exception, the values of options and the paths of logs are left out: they can hold data.
    """
    import traceback
    from importlib.metadata import version

    python = ".".join(map(str, sys.version_info[:3]))
    yield f"bfi {__version__}, Python {python} on {sys.platform}, numpy {version('numpy')}, scipy {version('scipy')}"
    name = next((word for word in sys.argv[1:] if word in COMMANDS), "")
    command = cli.get_command(click.Context(cli), name)
    known = (
        {flag for parameter in command.params for flag in (*parameter.opts, *parameter.secondary_opts)}
        if command
        else set()
    )
    yield " ".join(["bfi", name, *(flag for word in sys.argv[1:] if (flag := word.partition("=")[0]) in known)])
    chain = [error]
    while (cause := chain[0].__cause__ or chain[0].__context__) is not None and cause not in chain:
        chain.insert(0, cause)
    for exception in chain:
        yield "Traceback (most recent call last):"
        for frame, line in traceback.walk_tb(exception.__traceback__):
            yield f'  File "{frame.f_code.co_filename}", line {line}, in {frame.f_code.co_name}'
        yield type(exception).__name__
