"""What several measurements share: tables of thresholds of the recorded flights."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def tables(flights: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder, common to all workers, of the tables of thresholds, made where they are asked for."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "tables"
    folder.mkdir(exist_ok=True)
    return folder
