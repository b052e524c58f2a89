"""Small logs, each of one kind that is easily answered wrongly: what `diagnose` says of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bfi_cli import diagnose
from bfi_cli.flightlog import read_log

pytestmark = pytest.mark.realdata

SESSION_TIME = {"channel_map": {"time": "Session Time"}, "unit_map": {"Session Time": "s"}}
# By log the options of reading, and what is declared: fault, shape, onset and end, s, and how often it is lost.
CASES: dict[str, tuple[dict[str, Any], set[tuple[str, str, int, int | None, int | None]]]] = {
    "kckn_circuit.csv": ({}, set()),
    "cruise_fl350.csv": ({"unit_map": {"ground_speed": "kt"}}, set()),
    "roll_jumps.csv": ({}, set()),
    "step_60kt.csv": ({}, {("ias", "bias", 400, None, None)}),
    "iced_60s.csv": ({}, {("ias", "bias", 400, 460, None)}),
    "sky_static_blocked.csv": (SESSION_TIME, {("static_blocked", "static_blocked", 700, None, None)}),
    "sky_healthy.csv": (SESSION_TIME, set()),
    "px4_dropouts.h5": ({}, {(name, "dropout", 400, 823, 22) for name in ("tas", "ias")}),
    "px4_flat_11s.h5": ({}, {(name, "frozen", 600, 612, None) for name in ("tas", "ias")}),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_declared_of_a_small_log(flights: Path, name: str):
    path = flights.parent / "cases" / name
    if not path.exists():
        pytest.skip(f"the small logs are not at {path.parent}")
    options, expected = CASES[name]
    events = {
        (
            event.fault,
            event.shape,
            round(event.onset_s),
            None if event.offset_s is None else round(event.offset_s),
            event.count,
        )
        for event in diagnose(read_log(path, **options)).events
        if event.state == "declared" and event.fault != "q_impact"
    }
    assert events == expected
