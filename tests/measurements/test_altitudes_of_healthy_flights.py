"""Diagnoses of healthy flights: no setting of an altimeter and no geometric altitude is taken for a fault.

Where every altitude is read as one quantity four of them, and the PA-28, end with an altitude at fault.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from bars import FULL

from bfi_cli.quantities.channels import quantity_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

ALTITUDES = {"altitude", "baro_altitude", "gps_altitude", "radio_altitude"}
FLIGHTS = (
    *("sr22t_210623_141501", "sr22t_220825_142831", "sr22t_220417_125002", "sr22t_220417_135002"),
    *("g1000_c172_110812", "g3x_homebuilt_mfd", "g3x_homebuilt_pfd2", "px4_swiss1", "px4_swiss_flow"),
    *("citation_20170308_084248", "citation_20180312_f1", "citation_20190305_v4", "citation_20190312_123416"),
)


@pytest.mark.parametrize("name", FLIGHTS if FULL else FLIGHTS[:2])
def test_no_altitude_of_a_healthy_flight_is_at_fault(bfi: Callable, flights: Path, name: str) -> None:
    document = json.loads(bfi("diagnose", flights / f"{name}.h5", "--workers", 1, "--json").stdout)
    declared = [one for one in document["events"] if one["state"] == "declared"]
    print(f"\n{name}: {len(declared)} declared", [(one["fault"], one["shape"], one["onset_s"]) for one in declared])
    assert not [one for one in declared if quantity_of(one["fault"]) in ALTITUDES]


def test_the_real_loss_of_a_line_stays_declared(bfi: Callable, flights: Path) -> None:
    """A PA-28, whose indicated airspeed and altitude fell from 9256 to 9306 s while the ground speed did not."""
    document = json.loads(bfi("diagnose", flights / "gnxi_pa28_240720.h5", "--workers", 1, "--json").stdout)
    declared = [one for one in document["events"] if one["state"] == "declared"]
    assert declared
    assert all(9250.0 < one["onset_s"] < 9310.0 for one in declared)
