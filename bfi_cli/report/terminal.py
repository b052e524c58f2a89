"""The content of a report as tables on a terminal or in a text file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..printable import printable, shortened
from .content import ReportContent
from .first_screen import MOST_ROWS

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
# Columns from which a first screen keeps to its rows.
LEAST_WIDTH = 100
FEW = 3  # parts of a line, one for each kind of fault
COLOURS = {"fault": "bold red", "no_fault": "bold green", "inconclusive": "bold yellow", None: "bold"}


def print_content(content: ReportContent, console: Console) -> None:
    """Print verdict, tables, facts and notes, at most as wide as the console.

    On a terminal long tables and many notes are cut; a pipe gets all of them, for grep.
    """
    from rich.table import Table
    from rich.text import Text

    if content.screen is not None:
        print_screen(content, console)
    else:
        console.print(Text(printable(content.verdict), style=COLOURS[content.tone]))
    max_rows, max_notes = (MAX_ROWS, MAX_NOTES) if console.is_terminal else (None, None)
    for table in content.tables:
        console.print(Text(f"\n{printable(table.title)}", style="dim"))
        rows = table.rows[:max_rows]
        _print_table(console, table.heads, [[shortened(cell, CELL_LETTERS) for cell in row] for row in rows])
        if len(rows) < len(table.rows):
            console.print(f"   and {len(table.rows) - len(rows)} more; a pipe and --out get all\n", highlight=False)
    notes = [note.text for note in content.notes[:max_notes]]
    if len(notes) < len(content.notes):
        notes.append(f"{len(content.notes) - len(notes)} more notes; a pipe and --out get all")
    grid = Table.grid(padding=(0, 2))
    for name, value in (*content.facts, *(("Note", note) for note in notes)):
        grid.add_row(Text(shortened(name, NAME_LETTERS), style="dim"), Text(printable(value), overflow="fold"))
    console.print(grid)


def print_screen(content: ReportContent, console: Console) -> None:
    """Print the first screen of an answer: the headline, and a line for each kind of what else a reader needs.

    Of a line with many parts those are printed that fit in a row, and how many more there are. A part that is wider is
    folded; the last lines are left out where that takes more rows than a screen has.
    """
    from rich.text import Text

    screen = content.screen
    assert screen is not None
    first = Text(printable(screen.first), style=COLOURS[content.tone])
    console.print(first)
    rows = len(first.wrap(console, console.width))
    for label, parts in screen.lines.items():
        fitting = Text(f"  {_fitting(label, parts, console.width)}", style="not dim")
        row = Text(label, style="dim").append_text(fitting)
        rows += len(row.wrap(console, console.width))
        if rows > MOST_ROWS and console.width >= LEAST_WIDTH:
            break
        # Who pastes a command takes it as it is: the terminal folds it.
        console.print(row, soft_wrap=console.is_terminal and label == "To decide")


def _fitting(label: str, parts: Sequence[str], width: int) -> str:
    """Return the parts of a line that fit in a row, the first always, and how many more there are.

    A line of few parts may take two rows.
    """
    parts = [printable(part) for part in parts]
    room = (2 if len(parts) <= FEW else 1) * width - len(label) - 2
    for n in range(len(parts), 1, -1):
        more = f"; {len(parts) - n} more: --verbose" if n < len(parts) else ""
        if len(text := "; ".join(parts[:n]) + more) <= room:
            return text
    return parts[0] + (f"; {len(parts) - 1} more: --verbose" if parts[1:] else "")


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
