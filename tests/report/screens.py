"""The first screen of an answer, and the bar that it keeps."""

from __future__ import annotations

import io

from rich.console import Console

from bfi_cli.report.terminal import print_screen

LINES, FAULT_COLUMNS, NOTES, ROWS = 25, 100, 3, 8


def screen(content, width=100):
    file = io.StringIO()
    print_screen(content, Console(file=file, width=width, color_system=None))
    return [line.rstrip() for line in file.getvalue().splitlines()]


def check_screen(lines, content):
    """Check lines of a screen against the content of the answer."""
    faults = content.screen.faults
    several = len(faults) > 1
    assert lines[0].startswith(f"{content.screen.head}:" if faults else content.verdict[:40])
    shown = lines[1 : 1 + len(faults)] if several else lines[: len(faults)]
    assert all(len(line) <= FAULT_COLUMNS for line in shown)
    if several:
        assert [line[:10] for line in shown] == [f"  {fault[:8]}" for fault in faults]
    assert len(lines) <= LINES
    notes = [line for line in lines if line.startswith(("Limit ", "Advice ", "Method "))]
    assert len(notes) <= NOTES
    assert notes == sorted(notes, key=lambda line: not line.startswith("Limit "))
    assert len({one.text for one in content.notes}) == len(content.notes)
    heads = [k for k, line in enumerate(lines) if line.startswith("could hide ")]
    assert all(lines[k + 1 :].index("") <= ROWS for k in heads if "" in lines[k:])
    assert "--verbose" in lines[-1]
