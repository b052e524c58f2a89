"""Simulated flights with faults, and a calibration that fits them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import Config
from bfi_cli.decision.calibration import CalibrationTable, save_tables
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.model.onset.scan_record import prepare_record
from bfi_cli.serialization import provenance


@pytest.fixture(scope="session")
def flown() -> Callable[..., FlightLog]:
    """Return a function that flies the thesis's 31.72 s at 100 Hz: `flown(fault, ..., seed=1, noise=0.01)`."""

    def fly(*faults: Fault, seed: int = 1, noise: float = 0.01) -> FlightLog:
        log = simulate(
            MODELS["citation"],
            manoeuvre("3211", time_axis()),
            rng=np.random.default_rng(seed),
            noise_sd={"tas": noise},
        )
        return inject(log, list(faults)) if faults else log

    return fly


@pytest.fixture(scope="session")
def settings(tmp_path_factory: pytest.TempPathFactory, flown: Callable[..., FlightLog]) -> Callable[..., Config]:
    """Return a function that gives a configuration at 10 Hz whose table is what white noise gives: `settings()`."""

    def make(order: int | str = 4, shapes: tuple[str, ...] = ("bias", "drift"), **start_time: object) -> Config:
        written = {
            "conditioning": {"rate_hz": 10.0},
            "model": {"order": order},
            "start_time": {"shapes": shapes, **start_time},
        }
        record = prepare_record(flown(), Config.model_validate(written))
        path = tmp_path_factory.mktemp("calibration") / "table.json"
        path.write_text(save_tables([white_table(record.settings)], provenance(log_sha256="")))
        written["start_time"]["calibration"] = str(path)
        return Config.model_validate(written)

    return make


def white_table(settings: object, n: int = 200) -> CalibrationTable:
    """Return a table whose statistics have the mean and spread seen on records of white noise."""
    rng = np.random.default_rng(0)
    statistics = {shape: 8.0 + 2.5 * rng.exponential(size=n) for shape in settings.shapes}
    return CalibrationTable(settings=settings, statistics=statistics, logs=("white noise",))
