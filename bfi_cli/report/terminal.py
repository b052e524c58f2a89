"""The content of a report as tables on a terminal or in a text file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..printable import printable, shortened
from .content import ReportContent
from .text import capital, counted

if TYPE_CHECKING:
    from rich.console import Console

MAX_ROWS, MAX_NOTES = 60, 20  # what a screen holds without much scrolling; the report has all
# Columns of a table that a narrow terminal keeps: the first tell what fails, where and when.
KEPT = 3
# Width of a table's edges, and of the space between two columns.
FRAME, GAP = 2, 3
NAME_LETTERS, CELL_LETTERS = 32, 240
# Longest word of a table that is not broken.
WORD_LETTERS = 60
# Lines of the first screen on a terminal of 24 lines and its prompt, most and fewest rows and most notes of them, and
# the lines around the rows: heads, an empty line on either side, and the line that says where the rest is.
SCREEN_LINES, SCREEN_ROWS, FEWEST_ROWS, SCREEN_NOTES, AROUND_TABLE = 25, 8, 3, 3, 4
KEPT_WHOLE = 2  # first column that is not folded, after fault and channel
FAULT_LETTERS = 93  # with its head or indent at most 100 columns
COLOURS = {"fault": "bold red", "no_fault": "bold green", "inconclusive": "bold yellow", None: "bold"}


def print_content(content: ReportContent, console: Console) -> None:
    """Print verdict, tables, facts and notes, at most as wide as the console.

    On a terminal long tables and many notes are cut; a pipe gets all of them, for grep.
    """
    from rich.table import Table
    from rich.text import Text

    console.print(Text(printable(content.verdict), style=COLOURS[content.tone]))
    max_rows, max_notes = (MAX_ROWS, MAX_NOTES) if console.is_terminal else (None, None)
    for one in content.tables:
        console.print(Text(f"\n{printable(one.title)}", style="dim"))
        rows = one.rows[:max_rows]
        _print_table(console, one.heads, [[shortened(cell, CELL_LETTERS) for cell in row] for row in rows])
        if len(rows) < len(one.rows):
            console.print(f"   and {len(one.rows) - len(rows)} more; a pipe and --out get all\n", highlight=False)
    notes = [note.text for note in content.notes[:max_notes]]
    if len(notes) < len(content.notes):
        notes.append(f"{len(content.notes) - len(notes)} more notes; a pipe and --out get all")
    grid = Table.grid(padding=(0, 2))
    for name, value in (*content.facts, *(("Note", note) for note in notes)):
        grid.add_row(Text(shortened(name, NAME_LETTERS), style="dim"), Text(printable(value), overflow="fold"))
    console.print(grid)


def print_screen(content: ReportContent, console: Console) -> None:
    """Print the first screen of an answer: verdict, faults, errors that could hide, notes, and where the rest is.

    A fault takes one line. The errors that could hide take the lines that are left.
    """
    from rich.table import Table
    from rich.text import Text

    screen = content.screen
    assert screen is not None
    lines = [Text(_in_one_line(printable(one))) for one in screen.faults]
    if len(lines) == 1:
        lines = [Text(f"{screen.head}: ").append_text(lines[0])]
    elif lines:
        lines = [Text(f"{screen.head}:"), *(Text("  ").append_text(one) for one in lines)]
    for line in lines:
        line.stylize(COLOURS[content.tone])
    rest = f"{capital(screen.summary)}." if screen.summary else ""
    verdict = Text(printable(rest)) if lines else Text(printable(content.verdict), style=COLOURS[content.tone])
    limits, advice = ([one for one in content.notes if one.kind == kind] for kind in ("limit", "advice"))
    notes = [*limits[: SCREEN_NOTES - bool(advice)], *advice][:SCREEN_NOTES]
    grid = Table.grid(padding=(0, 2))
    for one in notes:
        grid.add_row(Text(one.kind.capitalize(), style="dim"), Text(printable(one.text), overflow="fold"))
    above: list[Text] = [*lines, *([verdict] if rest or not lines else [])]
    wrapped = [len(one.wrap(console, console.width)) for one in above]
    taken = sum(wrapped) + len(console.render_lines(grid, pad=False)) + AROUND_TABLE
    for line in above:
        console.print(line)
    every = screen.hidden.rows if screen.hidden else ()
    rows = every[: max(FEWEST_ROWS, min(SCREEN_ROWS, SCREEN_LINES - taken))]
    if screen.hidden is not None:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
        for k, head in enumerate(screen.hidden.heads):
            table.add_column(head, no_wrap=k >= KEPT_WHOLE, overflow="fold")
        for row in rows:
            table.add_row(*(Text(printable(cell)) for cell in row))
        console.print(Text())
        console.print(table)
    if notes:
        console.print(Text())
        console.print(grid)
    left_out = {"row": len(every) - len(rows), "note": len(content.notes) - len(notes)}
    more = " and ".join(counted(n, f"more {what}") for what, n in left_out.items() if n)
    console.print(Text(f"{more or 'Tables and facts'}: --verbose, or a report with --out DIR", style="dim"))


def _in_one_line(fault: str) -> str:
    """Return a fault in one line; of a long one the brackets are left out, the last first."""
    while len(fault) > FAULT_LETTERS and (shorter := re.sub(r" \([^()]*\)(?!.*\()", "", fault)) != fault:
        fault = shorter
    return shortened(fault, FAULT_LETTERS)


def _print_table(console: Console, heads: Sequence[str], body: Sequence[Sequence[str]]) -> None:
    """Print a table; on a console too narrow for its words the last columns are left out and named."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    n = len(heads)
    while True:
        widths = _widths([heads[:n], *(row[:n] for row in body)], console.width - FRAME - GAP * (n - 1))
        if n <= KEPT or widths is not None:
            break
        n -= 1
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, head in enumerate(heads[:n]):
        table.add_column(Text(printable(head)), overflow="fold", width=None if widths is None else widths[i])
    for row in body:
        table.add_row(*map(Text, row[:n]))
    console.print(table)
    if n < len(heads):
        console.print(f"   without room for: {', '.join(heads[n:])}\n", style="dim")


def _widths(lines: Sequence[Sequence[str]], room: int) -> list[int] | None:
    """Return a width per column, the first columns as wide as their cells; None where words would have to be broken.

    Texts are folded between words; a column whose cells all begin with a number is not folded.
    """
    from rich.cells import cell_len

    columns = list(zip(*lines, strict=True))
    whole = [max(map(cell_len, cells)) for cells in columns]
    words = [max((cell_len(word) for cell in cells for word in cell.split()), default=0) for cells in columns]
    for i, (_, *cells) in enumerate(columns):
        if all(cell[:1] in "-0123456789" for cell in cells):
            words[i] = max([words[i], *map(cell_len, cells)])
    widths = [min(width, WORD_LETTERS) for width in words]
    for i, width in enumerate(widths):
        widths[i] = min(whole[i], width + max(room - sum(widths), 0))
    return widths if sum(widths) <= room else None
