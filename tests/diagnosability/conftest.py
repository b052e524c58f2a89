"""Fault-free flights of the linear Citation, and the dictionary of the thesis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.diagnosability import DiagnosabilityResult, assess, assess_manoeuvres
from bfi_cli.dictionary import Dictionary, load_dictionary
from bfi_cli.flightlog import FlightLog

# What is compared with theory are the faults at their exact onsets.
QUICK = merge(Config(), {"conditioning.rate_hz": 10.0, "model.order": 4})
EXACT = merge(Config(), {"onset_tolerance_s": 0.0})
THESIS = Path(__file__).parents[2] / "configs" / "thesis_dictionary.yaml"


@pytest.fixture(scope="session")
def thesis() -> Dictionary:
    return load_dictionary(THESIS)


@pytest.fixture(scope="session")
def fly() -> Callable[..., FlightLog]:
    def flown(*, seed: int = 0, **noise_sd: float) -> FlightLog:
        deflection = manoeuvre("3211", time_axis())
        return simulate(find_model("citation"), deflection, rng=np.random.default_rng(seed), noise_sd=noise_sd)

    return flown


@pytest.fixture(scope="session")
def flight(fly: Callable[..., FlightLog]) -> FlightLog:
    """A flight with 0.02 m/s of noise on the airspeed."""
    return fly(tas=0.02)


@pytest.fixture(scope="session")
def at_unit(flight: FlightLog, thesis: Dictionary) -> DiagnosabilityResult:
    return assess(flight, thesis, EXACT)


@pytest.fixture(scope="session")
def progress() -> list[tuple[int, int]]:
    """What `compared` was told of its progress."""
    return []


@pytest.fixture(scope="session")
def compared(thesis: Dictionary, progress: list[tuple[int, int]]) -> DiagnosabilityResult:
    """Three manoeuvres, one of them useless, two draws of 0.02 m/s of noise."""
    stated = {"model": "citation", "manoeuvres": ["none", "doublet", "3211"], "noise": {"tas": 0.02}, "draws": 2}
    config = merge(QUICK, {f"diagnosability.{key}": value for key, value in stated.items()})
    return assess_manoeuvres(thesis, config, report=lambda done, total: progress.append((done, total)))
