"""The answer of a command: files where a folder is given; on stdout a table, or a JSON document with --json."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import ConfigError
from .options import tell
from .progress import stages

if TYPE_CHECKING:
    from rich.console import Console

    from ..exhibit import Exhibit
    from ..provenance import Provenance

__all__ = ["give", "show", "show_lines"]

# Columns of a pipe or a file, where COLUMNS does not say otherwise: what the widest of the tables needs.
PIPE_COLUMNS = 120


def give(
    exhibit: Exhibit,
    document: Mapping[str, Any],
    options: Mapping[str, Any],
    *,
    origin: Provenance,
    inputs: Sequence[str],
    extra: Mapping[str, bytes] | None = None,
) -> None:
    """Write the files of an answer to the folder of --out, if given, and print the answer.

    Parameters
    ----------
    exhibit, document : the same answer, laid out and as JSON.
    options : of the command: `out`, `force`, `as_json`, `series`, `progress`.
    origin : its provenance.
    inputs : the files that the command reads.
    extra : further files by name; they win over those of the exhibit, as a table in full precision does.
    """
    if options["out"] is not None:
        from ..files import replace_files
        from ..output import exhibit_files

        with stages(wanted=options["progress"]) as progress:
            files = exhibit_files(exhibit, document, origin, partial(progress, "figures"))
        replace_files({**files, **(extra or {})}, options["out"], inputs=inputs, force=options["force"])
        tell(f"wrote {options['out'] / 'report.html'}")

    def draw(console: Console) -> None:
        from ..tables import print_exhibit

        print_exhibit(console, exhibit)

    show(document, draw, as_json=options["as_json"], series=options["series"])


def show(document: Mapping[str, Any], draw: Callable[[Console], None], *, as_json: bool, series: bool = False) -> None:
    """Print an answer to stdout.

    Parameters
    ----------
    draw : prints the tables of the document to a console as wide as the terminal, without colours in a pipe.
    series : print what has an entry per sample or onset, too; in JSON only.
    """
    if as_json:
        from ..serialize import to_json, without_series

        ascii_only = not (sys.stdout.encoding or "utf-8").lower().startswith("utf")
        _print(to_json(document if series else without_series(document), ascii_only=ascii_only) + "\n")
        return
    from rich.console import Console

    on_terminal = sys.stdout.isatty()
    columns = shutil.get_terminal_size((80 if on_terminal else PIPE_COLUMNS, 24)).columns
    console = Console(width=columns, force_terminal=on_terminal, highlight=False, markup=False, emoji=False)
    with console.capture() as captured:
        draw(console)
    text = captured.get()
    _print(text if on_terminal else "".join(f"{line.rstrip()}\n" for line in text.splitlines()))


def show_lines(document: Mapping[str, Any], lines: Sequence[str], *, as_json: bool) -> None:
    """Print an answer whose table is a few lines."""

    def draw(console: Console) -> None:
        from rich.text import Text

        from ..printable import printable

        # A pipe gets each line whole, for grep; a terminal gets it broken between words.
        console.print(Text("\n".join(map(printable, lines))), soft_wrap=not console.is_terminal)

    show(document, draw, as_json=as_json)


def _print(text: str) -> None:
    """Write to stdout all that is left to write, so that a full disk is met here."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ConfigError(f"stdout: cannot be written, {reason}; free some space, or write elsewhere") from error
