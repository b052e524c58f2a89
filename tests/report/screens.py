"""The first screen of an answer, and the bar that it keeps."""

from __future__ import annotations

import io
from typing import get_args

from rich.console import Console

from bfi_cli.report.first_screen import MOST_ROWS, Label, State
from bfi_cli.report.terminal import print_screen

HEADS = tuple(state.replace("_", " ").upper() for state in get_args(State))
LABELS = get_args(Label)


def screen(content, width=100):
    file = io.StringIO()
    print_screen(content, Console(file=file, width=width, color_system=None))
    return [line.rstrip() for line in file.getvalue().splitlines()]


def check_screen(lines, content):
    """Check lines of a screen against the content of the answer: rows, and labels of the closed list, in its order."""
    assert len(lines) <= MOST_ROWS
    assert lines[0].startswith(HEADS)
    assert lines[0].startswith(f"{content.heading.upper()}  {content.verdict[:40]}")
    shown = [label for label in content.screen.lines if any(line.startswith(f"{label}  ") for line in lines)]
    assert shown == [*content.screen.lines][: len(shown)]
    places = [LABELS.index(label) for label in shown]
    assert places == sorted(set(places))
    assert len({one.text for one in content.notes}) == len(content.notes)
