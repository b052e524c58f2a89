"""A progress bar on stderr with the estimated time left, of a count or of successive stages."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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
