"""Flights with one fault each, made once, and what the diagnosis says of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from made_diagnoses import Diagnoses
from made_journeys import made_journey

from bfi_cli.flightlog import FlightLog, write_log


def without(log: FlightLog, *names: str) -> FlightLog:
    """Return a log without some of its channels."""
    return replace(log, channels={name: one for name, one in log.channels.items() if name not in names})


@pytest.fixture(scope="session")
def journey() -> FlightLog:
    return made_journey()


@pytest.fixture(scope="session")
def hangar(tmp_path_factory: pytest.TempPathFactory, journey: FlightLog) -> Path:
    """Return a folder with the healthy flight, without the elevator, so that no scan for steps takes its time."""
    folder = tmp_path_factory.mktemp("hangar")
    write_log(without(journey, "elevator"), folder / "healthy.h5")
    return folder


@pytest.fixture(scope="session")
def known() -> dict[str, dict[str, Any]]:
    return {}


@pytest.fixture
def diagnoses(hangar: Path, bfi: Callable, known: dict[str, dict[str, Any]]) -> Diagnoses:
    return Diagnoses(hangar, bfi, known)
