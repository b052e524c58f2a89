"""The way of the data: how many kinds of containers hold a series in a run of `identify` and of `diagnose`."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from made_diagnoses import PART

import bfi_cli
from bfi_cli.flightlog import FlightLog, write_log

# A series has a value for more than half of the samples of the shortest window that is analysed: 31.4 and 60 s.
LEAST = 121
# Tables of the program and coefficients of the frequency bound, which no sample of a log is in.
NO_SERIES = {"decision.calibration.Null", "parity.calibration.ParityTable", "kernels.onset.profile.ProfilePolynomial"}
# Kinds of containers today: the next is made of one that is there, and what is saved is taken off.
MOST = {"identify": 20, "diagnose": 43}


def dataclasses_of_package() -> Iterator[type]:
    for module in pkgutil.walk_packages(bfi_cli.__path__, "bfi_cli."):
        if module.name.rpartition(".")[2] == "__main__":
            continue
        for kind in vars(importlib.import_module(module.name)).values():
            if isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind.__module__ == module.name:
                yield kind


def longest(value: object) -> int:
    """Return the samples of an array, or of the longest in a mapping, tuple or list of arrays."""
    if isinstance(value, np.ndarray):
        return value.shape[0] if value.ndim else 0
    if isinstance(value, Mapping):
        return max(map(longest, value.values()), default=0)
    return max(map(longest, value), default=0) if isinstance(value, tuple | list) else 0


@pytest.fixture
def holders(monkeypatch: pytest.MonkeyPatch) -> dict[str, set[str]]:
    """Return the fields that held a series, by kind of container, of all that is run after."""
    held: dict[str, set[str]] = {}

    def watched(kind: type) -> Callable[..., None]:
        made, names = kind.__init__, [field.name for field in dataclasses.fields(kind)]

        def init(self: object, *args: object, **settings: object) -> None:
            made(self, *args, **settings)
            series = {name for name in names if longest(getattr(self, name)) >= LEAST}
            if series:
                own = type(self)
                held.setdefault(f"{own.__module__.removeprefix('bfi_cli.')}.{own.__qualname__}", set()).update(series)

        return init

    for kind in dataclasses_of_package():
        monkeypatch.setattr(kind, "__init__", watched(kind))
    return held


@pytest.mark.slow
def test_few_kinds_of_containers_hold_a_series_in_an_identification(holders: dict[str, set[str]], bfi: Callable):
    assert bfi("identify", "data/citation_bias.h5", "-d", "configs/thesis_dictionary.yaml", "--json").code == 0
    assert {"flightlog.record.FlightLog", "model.result.OutputSeries"} <= {*holders}
    assert len({*holders} - NO_SERIES) <= MOST["identify"], holders


@pytest.mark.slow
def test_few_kinds_of_containers_hold_a_series_in_a_diagnosis(
    holders: dict[str, set[str]], journey: FlightLog, bfi: Callable, tmp_path: Path
):
    write_log(journey, tmp_path / "healthy.h5")
    fault = "shape=drift,channel=tas,magnitude=0.2,onset_s=430"
    assert bfi("inject", tmp_path / "healthy.h5", "--fault", fault, "-o", tmp_path / "drift.h5").code == 0
    holders.clear()
    assert bfi("diagnose", tmp_path / "drift.h5", *PART, "--workers", 1, "--json").code == 0
    assert {"flightlog.record.FlightLog", "flight.result.DiagnoseResult"} <= {*holders}
    assert len({*holders} - NO_SERIES) <= MOST["diagnose"], holders
