"""Fixtures that more than one test file uses."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

from bfi_cli.commands import run_command

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Tests of the laboratory, which no analysis of a log needs.
LABORATORY = ("tests/lab/", "tests/aircraft/f16/")

# Of a property 25 examples are tried, those of every other run; BFI_FULL=1 draws 500 new ones. None has a time limit.
FULL = os.environ.get("BFI_FULL") == "1"
settings.register_profile("bfi", deadline=None, derandomize=not FULL, max_examples=500 if FULL else 25)
settings.load_profile("bfi")
threadpool_limits(1)
# Answers are as wide as in a pipe, whatever terminal the tests are started from.
os.environ.pop("COLUMNS", None)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell's background job ignores interruptions, and so would every program that a test starts and interrupts.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command line returned and printed."""

    code: int
    stdout: str
    stderr: str


def is_whole(config: pytest.Config) -> bool:
    """Return whether no files are named, so that all are imported."""
    return config.args_source is pytest.Config.ArgsSource.TESTPATHS


def pytest_configure(config: pytest.Config) -> None:
    """Keep what is compiled, also where the environment does not: assertions of 55 000 lines take ten seconds."""
    gc.disable()  # until all is collected
    if is_whole(config):
        sys.dont_write_bytecode = False
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_collection_finish() -> None:
    """Look for garbage seldom, and not among what is collected, where that takes a twentieth of the time."""
    gc.collect()
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 10, 10)


def is_left_out(path: Path, config: pytest.Config) -> bool:
    """Return whether a file is the laboratory's, of which the fast set runs nothing and so need not import it."""
    is_fast = is_whole(config) and config.option.markexpr in config.getini("addopts")
    return is_fast and path.relative_to(config.rootpath).as_posix().startswith(LABORATORY)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import what may run alone."""
    return is_left_out(collection_path, config) or None


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Let each worker begin to import at a place of its own, so that it finds compiled what the others began with."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if workers > 1 and is_whole(session.config):
        files = sorted(Path(__file__).parent.rglob("test_*.py"))
        files = [path for path in files if not is_left_out(path, session.config)]
        first = int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw")) * len(files) // workers
        for path in (*files[first:], *files[:first]):
            pytest.Module.from_parent(session, path=path).obj  # noqa: B018, which imports it


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Mark as slow the rows of a test after those it names as its first ones, and what is the laboratory's."""
    seen: Counter[str] = Counter()
    for item in items:
        if item.nodeid.startswith(LABORATORY):
            item.add_marker("lab")
        if (first := item.get_closest_marker("first_rows")) is not None:
            test = item.nodeid.partition("[")[0]
            seen[test] += 1
            if seen[test] > first.args[0]:
                item.add_marker("slow")


@pytest.fixture
def bfi(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Run the command line in this process: `bfi("info", path)`."""

    def run(*argv: object) -> Outcome:
        words = [str(word) for word in argv]
        monkeypatch.setattr("sys.argv", ["bfi", *words])
        capsys.readouterr()
        code = run_command(words)
        printed = capsys.readouterr()
        return Outcome(code, printed.out, printed.err)

    return run


@pytest.fixture
def unscanned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the scan beside the identification, two thirds of the time, where a test does not look at it."""
    monkeypatch.setattr("bfi_cli.analysis.MOST_SAMPLES", 0)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pages of all figures blank where a test looks at the other files."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    def blank(drawing: object) -> Figure:
        figure = Figure(figsize=(1.0, 1.0))
        FigureCanvasAgg(figure)
        return figure

    monkeypatch.setattr("bfi_cli.report.figures.draw", blank)


@pytest.fixture
def vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw figures as SVG alone, and labels where they fall."""

    def unplaced(figure: Figure) -> Figure:
        figure.set_layout_engine("none")
        return figure

    monkeypatch.setattr("bfi_cli.report.figures.fix_places", unplaced)
    monkeypatch.setattr("bfi_cli.report.style.to_png", lambda figure: b"")


@pytest.fixture(scope="session")
def flights() -> Path:
    """Return the folder of recorded flights that lies beside the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "flights"
    if not folder.is_dir() and os.environ.get("CI") != "true":
        pytest.skip(f"the recorded flights are not at {folder}")
    return folder
