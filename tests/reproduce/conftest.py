"""Reproductions in their shortest form, made once per session."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from bfi_cli.report.content import ReportContent
from bfi_cli.reproduce import Settings
from bfi_cli.reproduce.catalogue import REPRODUCTIONS, run

SHORTEST = Settings(quick=True, trials=1)


@pytest.fixture(scope="session")
def made() -> Callable[[str], ReportContent]:
    """Make a reproduction by its name with one trial per point; names that share a function share the work."""
    first = {(entry.module, entry.function): name for name, entry in reversed(REPRODUCTIONS.items())}
    make = cache(lambda name: run(name, SHORTEST))
    return lambda name: make(first[REPRODUCTIONS[name].module, REPRODUCTIONS[name].function])
