"""Simulated flights of the Citation and the thesis's dictionary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import Config
from bfi_cli.dictionary import Dictionary, load_dictionary
from bfi_cli.flightlog import FlightLog, inject

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
NOISE = {"tas": 0.02, "aoa": 2e-4, "pitch": 2e-4, "pitch_rate": 2e-4}


@cache
def _flown(seed: int, scale: float) -> FlightLog:
    return simulate(
        MODELS["citation"],
        manoeuvre("3211", time_axis()),
        rng=np.random.default_rng(seed),
        noise_sd={name: scale * sd for name, sd in NOISE.items()},
    )


@pytest.fixture(scope="session")
def flight() -> Callable[..., FlightLog]:
    """Return a function that gives the thesis's 31.72 s at 100 Hz: `flight()` without noise, `flight(seed)` with."""

    def fly(seed: int | None = None, *, noise: float = 1.0) -> FlightLog:
        return _flown(0, 0.0) if seed is None else _flown(seed, noise)

    return fly


@pytest.fixture(scope="session")
def thesis() -> Dictionary:
    """Return the seven signals of the thesis."""
    return load_dictionary(CONFIGS / "thesis_dictionary.yaml")


@pytest.fixture(scope="session")
def faulty() -> Callable[..., FlightLog]:
    """Return a function that injects entries of a dictionary by name: `faulty(log, dictionary, bias_13.8=4.0)`."""

    def add(log: FlightLog, dictionary: Dictionary, magnitudes: dict[str, float]) -> FlightLog:
        atoms = {atom.name: atom for atom in dictionary.resolved(float(log.time_s[0]))}
        return inject(log, [replace(atoms[name], magnitude=z) for name, z in magnitudes.items()])

    return add


@pytest.fixture(scope="session")
def exact() -> Callable[..., Config]:
    """Return a function that gives the settings for a noise-free record: its own rate, order 4."""

    def settings(method: str = "ml") -> Config:
        return Config.model_validate({"method": method, "conditioning": {"rate_hz": "none"}, "model": {"order": 4}})

    return settings
