"""Reproductions in their shortest form, made once per session, whose workers share them."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from functools import cache

import pytest

from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.catalogue import REPRODUCTIONS, run
from bfi_cli.report.content import ReportContent

SHORTEST = Settings(quick=True, trials=1)


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], ReportContent]:
    """Make a reproduction by its name with one trial per point; names that share a function share the work."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "reproductions"
    folder.mkdir(exist_ok=True)
    first = {(entry.module, entry.function): name for name, entry in reversed(REPRODUCTIONS.items())}

    @cache
    def make(name: str) -> ReportContent:
        path = folder / name
        if not path.exists():
            unfinished = folder / f"{name}.{os.getpid()}"
            unfinished.write_bytes(pickle.dumps(run(name, SHORTEST)))
            unfinished.replace(path)  # another worker may make the same one
        content: ReportContent = pickle.loads(path.read_bytes())
        return content

    return lambda name: make(first[REPRODUCTIONS[name].module, REPRODUCTIONS[name].function])
