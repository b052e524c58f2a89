"""The answer of an analysis as tables on a terminal or in a text file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from . import rows
from .exhibit import Exhibit
from .identify.result import IdentifyResult
from .printable import printable, shortened
from .wording import verdict

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["MAX_CANDIDATES", "print_exhibit", "print_identify"]

MAX_CANDIDATES = 24
MAX_ROWS = 60
# Columns of a table that a narrow terminal keeps: what fails, where and when come first.
KEPT = 3
# Letters that the lines of a table take at its edges and between two columns.
FRAME, GAP = 2, 3
NAME_LETTERS, CELL_LETTERS = 32, 60
COLOURS = {"fault": "bold red", "no_fault": "bold green", "not_identifiable": "bold yellow", None: "bold"}


def print_identify(console: Console, result: IdentifyResult) -> None:
    """Print the verdict, the faults, the dictionary, the model and the notes to `console`, at most as wide as it is.

    A dictionary of more than `MAX_CANDIDATES` entries is cut to the declared ones and the first of the others.
    """
    from rich.text import Text

    console.print(Text(printable(verdict(result)), style=COLOURS[result.decision]))
    if result.faults:
        _print_faults(console, result)
    if result.candidates:
        _print_candidates(console, result)
    _print_facts(console, result)


def print_exhibit(console: Console, exhibit: Exhibit) -> None:
    """Print verdict, tables, facts and notes; a table of more than `MAX_ROWS` rows is cut."""
    from rich.text import Text

    console.print(Text(printable(exhibit.verdict), style=COLOURS[exhibit.tone]))
    for one in exhibit.tables:
        console.print(Text(f"\n{printable(one.title)}", style="dim"))
        body = [[shortened(cell, CELL_LETTERS) for cell in row] for row in one.rows[:MAX_ROWS]]
        _print_table(console, one.heads, body, folded=range(len(one.heads)))
        if len(one.rows) > MAX_ROWS:
            console.print(f"   and {len(one.rows) - MAX_ROWS} more; all are in --out\n", highlight=False)
    console.print(_pairs([*exhibit.facts, *(("Note", note) for note in exhibit.notes)]))


def _print_faults(console: Console, result: IdentifyResult) -> None:
    heads = ("fault", "channel", "from", "magnitude", "95 % interval", "physical value")
    body = [(row[0], *row[2:6], row[7]) for row in rows.fault_rows(result)]
    _print_table(console, heads, body, folded=(0, 1, 2))


def _print_candidates(console: Console, result: IdentifyResult) -> None:
    heads = ("", "dictionary", "magnitude", "sd", "min. detectable", "note")
    listed = rows.candidate_rows(result)
    shown = sorted(listed, key=lambda entry: not entry[0])[:MAX_CANDIDATES]
    body = [("*" if active else "", row[0], *row[2:]) for active, row in shown]
    _print_table(console, heads, body, folded=(1, 5))
    if len(listed) > len(shown):
        console.print(f"   and {len(listed) - len(shown)} more; all are in --json and --out\n", highlight=False)


def _print_facts(console: Console, result: IdentifyResult) -> None:
    facts = [*rows.summary_rows(result)[:2], *rows.model_rows(result), *rows.truth_rows(result)]
    for channel, noise, vaf, whiteness, _, alarms in rows.residual_rows(result):
        facts.append((f"Residual of {channel}", f"SD {noise}, VAF {vaf}, whiteness {whiteness}"))
        facts.append((f"Plain 5-sigma test, {channel}", alarms))
    facts += [("Note", note) for note in result.notes]
    console.print(_pairs(facts))


def _print_table(
    console: Console, heads: Sequence[str], body: Sequence[Sequence[str]], *, folded: Sequence[int]
) -> None:
    """Print a table; where it is too narrow for the words of all columns, the last ones are left out and named.

    Parameters
    ----------
    folded : columns whose cells may be folded between words.
    """
    n = len(heads)
    while True:
        widths = _widths([heads[:n], *(row[:n] for row in body)], folded, console.width - FRAME - GAP * (n - 1))
        if n <= KEPT or widths is not None:
            break
        n -= 1
    console.print(_table(heads[:n], [row[:n] for row in body], widths))
    if n < len(heads):
        console.print(f"   without room for: {', '.join(heads[n:])}\n", style="dim")


def _widths(lines: Sequence[Sequence[str]], folded: Sequence[int], room: int) -> list[int] | None:
    """Return a width per column, the first ones as wide as their cells; None where words would have to be broken."""
    from rich.cells import cell_len

    columns = list(zip(*lines, strict=True))
    whole = [max(map(cell_len, cells)) for cells in columns]
    words = [max((cell_len(word) for cell in cells for word in cell.split()), default=0) for cells in columns]
    widths = [words[i] if i in folded else whole[i] for i in range(len(columns))]
    for i, width in enumerate(widths):
        widths[i] = min(whole[i], width + max(room - sum(widths), 0))
    return widths if sum(widths) <= room else None


def _pairs(facts: Sequence[tuple[str, ...]]) -> Table:
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 2))
    for name, value in facts:
        grid.add_row(Text(shortened(name, NAME_LETTERS), style="dim"), Text(printable(value)))
    return grid


def _table(heads: Sequence[str], body: Iterable[Sequence[str]], widths: Sequence[int] | None) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, head in enumerate(heads):
        table.add_column(Text(printable(head)), overflow="fold", width=None if widths is None else widths[i])
    for row in body:
        table.add_row(*(Text(printable(cell)) for cell in row))
    return table
