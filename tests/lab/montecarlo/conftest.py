"""Small sweeps that take a second, as files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bfi_cli.lab.montecarlo import Sweep, load_sweep

DICTIONARY = """
relative_to: window
channel: tas
atoms:
  - {name: bias, shape: bias, onset_s: 12}
  - {name: sine, shape: sine, frequency_hz: 0.5, onset_s: 6}
  - {name: drift, shape: drift, slope: 0.2, onset_s: 8}
"""
RECORD = "record: {model: citation, rate_hz: 10, duration_s: 30}\ndictionary: dictionary.yaml\n"
SWEEPS = {
    "noisy": f"{RECORD}noise: {{tas: [0.01, 0.05]}}\nactive: [0, 2]\ntrials: 3\nidentify: {{model: {{order: 4}}}}\n",
    "fast": f"{RECORD}active: [1, 2]\ntrials: 6\n"
    "identify: {conditioning: {rate_hz: none}, model: {order: 4}, method: risro, risro: {sparsity: none}}\n",
    "failing": f"{RECORD}active: 1\ntrials: 2\nidentify: {{method: risro}}\ngrid: {{model.order: [4, 90]}}\n",
}


@pytest.fixture
def written(tmp_path: Path) -> Callable[[str], Path]:
    """Write a sweep, by name or as text, and return its path."""

    def write(text: str) -> Path:
        (tmp_path / "dictionary.yaml").write_text(DICTIONARY)
        path = tmp_path / "sweep.yaml"
        path.write_text(SWEEPS.get(text, text))
        return path

    return write


@pytest.fixture
def sweep(written: Callable[[str], Path]) -> Callable[..., Sweep]:
    """Load a sweep, by name or as text."""
    return lambda text, **given: load_sweep(written(text), **given)
