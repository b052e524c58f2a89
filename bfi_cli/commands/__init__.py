"""The `bfi` command: one lazily loaded click command per file; errors are printed and turned into exit codes here only."""

from __future__ import annotations

import importlib
import sys
import tempfile
import traceback
from pathlib import Path

import click

from .. import __version__
from ..errors import BfiError

__all__ = ["cli", "main"]

COMMANDS = {
    "info": "Channels, units, rate, gaps, held samples, excitation of a log.",
    "convert": "Any readable log to HDF5 or CSV, resampled, units normalised.",
    "simulate": "A flight log from an aircraft model.",
    "inject": "Add faults to a log; the truth is stored in the file.",
    "dictionary": "Audit a fault dictionary, on a log if one is given.",
    "identify": "Which faults of a dictionary are present, how large, how sure.",
    "report": "Draw the report of a stored result.",
}


class LazyGroup(click.Group):
    """A group that imports a command's module when the command runs, not when help is shown."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"{__name__}.{cmd_name}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands, in the order of the work"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="bfi")
def cli() -> None:
    """Blind fault identification: which air-data fault hit an aircraft, when, how large and how sure, from one log."""


def main(argv: list[str] | None = None) -> None:
    """Run the command line and exit with a code of the contract (never 1, never a traceback)."""
    sys.exit(_run(argv))


def _run(argv: list[str] | None) -> int:
    try:
        outcome = cli.main(args=argv, standalone_mode=False)
        return outcome if isinstance(outcome, int) else 0
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except click.ClickException as error:
        return _complain(f"bfi: {_one_line(error.format_message())}", 2)
    except BfiError as error:
        return _complain(_one_line(str(error)), error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        return _complain("bfi: interrupted", 130)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except Exception as error:
        return _complain(_crash(error), 70)


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _complain(message: str, code: int) -> int:
    click.echo(message, err=True)
    return code


def _crash(error: Exception) -> str:
    with tempfile.NamedTemporaryFile("w", prefix="bfi-crash-", suffix=".txt", delete=False) as file:
        file.write(f"bfi {__version__}\n{' '.join(sys.argv)}\n")
        traceback.print_exception(error, file=file)
    return f"bfi: a defect of ours, {_one_line(repr(error))}; please report it with {Path(file.name)}"
