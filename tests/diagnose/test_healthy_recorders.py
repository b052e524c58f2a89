"""Healthy flights of recorders and aircraft that no threshold was made on: nothing is declared."""

from __future__ import annotations

from pathlib import Path

import pytest

from bfi_cli.config import Config
from bfi_cli.diagnose.diagnose import diagnose_flight
from bfi_cli.flightlog import read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]


@pytest.mark.parametrize("name", ["reader_samples/g1000_c172.csv", "px4_flight3"])
def test_nothing_is_declared(flights: Path, name: str) -> None:
    """The Cessna's wind changes by 5 m/s within half an hour of training, the drone flies at 15 m/s."""
    result = diagnose_flight(read_log(flights / name), Config())
    assert [one.fault for one in result.events if one.state == "declared"] == []
    assert result.decision != "fault"
