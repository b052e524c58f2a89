"""Fixtures that more than one test file uses."""

from __future__ import annotations

import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

from bfi_cli.commands import run_command

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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Mark the rows of a test as slow that come after those it names as its first ones."""
    seen: Counter[str] = Counter()
    for item in items:
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


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Let the programs that tests start share compiled modules, where the environment keeps none beside the sources."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with pytest.MonkeyPatch.context() as patch:
        if os.environ.get("PYTHONDONTWRITEBYTECODE"):
            patch.delenv("PYTHONDONTWRITEBYTECODE")
            patch.setenv("PYTHONPYCACHEPREFIX", str(shared / "compiled"))
        yield


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


@pytest.fixture(scope="session")
def flights() -> Path:
    """Return the folder of recorded flights that lies beside the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "flights"
    if not folder.is_dir() and os.environ.get("CI") != "true":
        pytest.skip(f"the recorded flights are not at {folder}")
    return folder
