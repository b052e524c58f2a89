"""The output of a command: files with --out; on stdout a table, or JSON with --json; notes and progress on stderr."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError, reason_of
from ..printable import printable
from ..quantities.text import IN_FILES, UNITS, Units

if TYPE_CHECKING:
    from rich.console import Console

    from ..flightlog import FlightLog
    from ..report.content import ReportContent
    from ..serialization import Provenance

    ContentIn = Callable[[Units], ReportContent]
    from rich.progress import Progress, ProgressColumn


@contextmanager
def progress(label: str, *, wanted: bool | None = None) -> Iterator[Callable[[int, int], None]]:
    """Yield a function of (done, total) that moves the bar.

    Parameters
    ----------
    label : what is counted, "trials".
    wanted : show the bar; None to show it if stderr is a terminal.
    """
    if not _shown(wanted):
        yield lambda _done, _total: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn

    with _bar(TextColumn(label), BarColumn(), MofNCompleteColumn()) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def stages(*, wanted: bool | None = None) -> Iterator[Callable[[str, float], None]]:
    """Yield a function of (stage, part done) that moves the bar; a new stage starts the bar anew.

    Parameters
    ----------
    wanted : show the bar; None to show it if stderr is a terminal.
    """
    if not _shown(wanted):
        yield lambda _stage, _done: None
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn

    with _bar(TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()) as bar:
        task = bar.add_task("", total=1.0)

        def show(stage: str, done: float) -> None:
            if stage != bar.tasks[0].description:
                bar.reset(task, description=stage)
            bar.update(task, completed=done)

        yield show


@contextmanager
def _bar(*columns: ProgressColumn) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import Progress, TextColumn, TimeRemainingColumn

    bar = Progress(*columns, TextColumn("left"), TimeRemainingColumn(), console=Console(stderr=True))
    try:
        with bar:
            yield bar
    finally:
        # An interruption amid the start of the bar finds the cursor hidden and nothing yet that would show it again.
        bar.console.show_cursor()


def _shown(wanted: bool | None) -> bool:
    return sys.stderr.isatty() if wanted is None else wanted


# Columns of a pipe or a file, unless COLUMNS is set: those of the widest table.
PIPE_COLUMNS = 120
# Whether notes are left to the document.
_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


def check_out(
    options: Mapping[str, Any],
    inputs: Sequence[str],
    drawings: Sequence[str] = (),
    tables: Sequence[str] = (),
    *,
    stored: str = "result.json",
    zoom: bool = False,
) -> None:
    """Check that the files of an answer may be written to the folder of --out, if that is given.

    Parameters
    ----------
    options, inputs : see `emit`; stored : see `write`.
    drawings, tables : names of the figures and tables; zoom : whether a page to zoom is among the files.
    """
    if options["out"] is None:
        return
    from ..files import check_folder
    from ..report.files import content_names

    names = content_names(drawings, tables, stored=stored, zoom=zoom)
    check_folder(options["out"], names, inputs=inputs, force=options["force"])


def emit(
    content_in: ContentIn,
    document: Mapping[str, Any],
    options: Mapping[str, Any],
    *,
    origin: Provenance,
    inputs: Sequence[str],
    units: str = "si",
) -> None:
    """Write the files of an answer to the folder of --out, if given, and print the answer.

    Parameters
    ----------
    content_in, document : the same answer, as a function from units to the report, and as JSON.
    options : of the command: `out`, `force`, `as_json`, and where it has them `series` and `progress`.
    origin : provenance of the answer.
    inputs : the files that the command reads.
    units : name of the units in which the answer is printed and drawn; CSV files are in SI.
    """
    series = options.get("series", False)
    if options["out"] is None and options["as_json"]:
        _print_json(document, series=series)
        return
    content = content_in(UNITS[units])
    plain = content if options["out"] is None else content_in(IN_FILES)
    write(content, document, options, plain=plain, origin=origin, inputs=inputs)
    show(document, content, as_json=options["as_json"], series=series, briefly=not options.get("verbose", True))


def write(
    content: ReportContent,
    document: Mapping[str, Any],
    options: Mapping[str, Any],
    *,
    origin: Provenance,
    inputs: Sequence[str],
    plain: ReportContent | None = None,
    stored: str = "result.json",
) -> None:
    """Write the files of an answer to the folder of --out, if given, the document under the name `stored`.

    `plain` is the content as stored, in SI and radians, where `content` is in other units.
    """
    if options["out"] is None:
        return
    import logging

    from ..files import replace_files
    from ..report.files import content_files

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # a home that cannot be written, fonts read anew
    with stages(wanted=options.get("progress")) as progress:
        files = content_files(content, document, origin, partial(progress, "figures"), plain=plain, stored=stored)
    replace_files(files, options["out"], inputs=inputs, force=options["force"])
    note(f"wrote {options['out'] / 'report.html'}")


def note(sentence: str) -> None:
    """Print a note to stderr if that is a terminal."""
    if sys.stderr.isatty() and not _SILENT.get():
        click.echo(printable(sentence), err=True)


@contextmanager
def without_notes() -> Iterator[None]:
    """Print no notes within the block: those of each of many logs stand in its document."""
    token = _SILENT.set(True)
    try:
        yield
    finally:
        _SILENT.reset(token)


def show(
    document: Mapping[str, Any], content: ReportContent, *, as_json: bool, series: bool = False, briefly: bool = False
) -> None:
    """Print an answer to stdout: the content as wide as the terminal, without colours in a pipe, or the document.

    Parameters
    ----------
    series : include keys with an entry per sample or onset in JSON.
    briefly : print only the first screen of the answer, if it has one.
    """
    if as_json:
        _print_json(document, series=series)
        return
    from ..report.terminal import print_content, print_screen

    _print_rich(partial(print_screen if briefly and content.screen else print_content, content))


def show_lines(document: Mapping[str, Any], lines: Sequence[str], *, as_json: bool) -> None:
    """Print an answer of a few lines, or its document."""
    if as_json:
        _print_json(document)
        return
    from rich.text import Text

    # A pipe gets each line whole, for grep; a terminal gets it broken between words.
    text = Text("\n".join(map(printable, lines)))
    _print_rich(lambda console: console.print(text, soft_wrap=not console.is_terminal))


def _print_json(document: Mapping[str, Any], *, series: bool = False) -> None:
    from ..serialization import to_json, without_series

    ascii_only = not (sys.stdout.encoding or "utf-8").lower().startswith("utf")
    print_text(to_json(document if series else without_series(document), ascii_only=ascii_only) + "\n")


def _print_rich(draw: Callable[[Console], None]) -> None:
    """Call `draw` with a console as wide as the terminal and print its output."""
    from rich.console import Console

    on_terminal = sys.stdout.isatty()
    columns, lines = shutil.get_terminal_size((80 if on_terminal else PIPE_COLUMNS, 24))
    # Without a height a terminal that is dumb is taken to be 80 columns wide.
    console = Console(
        width=columns, height=lines, force_terminal=on_terminal, highlight=False, markup=False, emoji=False
    )
    with console.capture() as captured:
        draw(console)
    text = captured.get()
    print_text(text if on_terminal else "".join(f"{line.rstrip()}\n" for line in text.splitlines()))


def print_text(text: str) -> None:
    """Write to stdout and flush it, so that a full disk raises here."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise ConfigError(
            f"stdout: cannot be written, {reason_of(error)}; free some space, or write elsewhere"
        ) from error


def write_and_show(
    log: FlightLog, options: Mapping[str, Any], *, kind: str, log_sha256: str = "", seed: int = 0
) -> None:
    """Write a log to the file of --output, and print its summary: the JSON document of `kind`, or lines.

    Parameters
    ----------
    options : of the command: `out_file`, `as_json`, and where it has them `units`.
    log_sha256 : of the log it was made from, "" where there was none.
    seed : of the random steps.
    """
    from ..flightlog import write_log
    from ..report.log import log_document, log_lines
    from ..serialization import provenance

    write_log(log, options["out_file"])
    log = replace(log, path=str(options["out_file"]))
    document = log_document(log, provenance(log_sha256=log_sha256, seed=seed), kind=kind)
    show_lines(document, log_lines(log, UNITS[options.get("units") or "si"]), as_json=options["as_json"])
