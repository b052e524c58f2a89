"""The summary of a sweep as a table on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..printable import printable
from .summary import Proportion, Summary

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["print_summary"]

HEADS = ("scenario", "trials", "isolated", "false alarms", "missed", "coverage", "median error")


def print_summary(console: Console, summary: Summary) -> None:
    """Print a line per scenario, rates in % with their 95 % intervals, and the notes."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for n, head in enumerate(HEADS):
        table.add_column(head, overflow="fold", justify="left" if n == 0 else "right")
    for one in summary.scenarios:
        rates = (one.isolation, one.false_alarm, one.missed_detection, one.coverage)
        error = one.magnitude_error.get("p50")
        cells = (one.name, str(one.trials), *map(_percent, rates), "-" if error is None else f"{error:.2g}")
        table.add_row(*(Text(printable(cell)) for cell in cells))
    console.print(table)
    console.print(Text("Shares in % with their 95 % Wilson intervals.", style="dim"))
    for note in summary.notes:
        console.print(Text(printable(f"Note: {note}")))


def _percent(share: Proportion) -> str:
    if share.rate is None or share.ci95 is None:
        return "-"
    low, high = (100.0 * end for end in share.ci95)
    return f"{100.0 * share.rate:.0f} ({low:.0f}-{high:.0f})"
