"""Rows, states, levels and ordinary causes hang together: what a table names exists, and one row is an addition."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.flight.tables import LEVELS, MANOEUVRE, ORDINARY, ROWS, STATES, Coefficients
from bfi_cli.quantities.channels import STANDARD

N = 5
WIDENED = {"", "activity", "gusts", "turns"}


@pytest.fixture(scope="module")
def coefficients() -> Coefficients:
    course = np.linspace(1.0, 2.0, N)
    return Coefficients(
        **dict.fromkeys(("airspeed", "slow_airspeed", "cas_share", "cas_by_height", "load_factor", "height"), course),
        **dict.fromkeys(("heading", "steady_heading", "track", "bank", "cos_bank", "position_m"), course),
        lift_slope=0.06,
        middle=1.5,
        rates=dict.fromkeys(ROWS, course),
    )


@pytest.mark.parametrize("name", ROWS)
def test_a_row_loads_states_that_exist(name: str, coefficients: Coefficients) -> None:
    row = ROWS[name]
    loads = row.loads(coefficients)
    assert loads
    assert loads.keys() <= STATES.keys()
    assert all(np.shape(load) in ((), (N,)) and np.isfinite(load).all() for load in loads.values())
    assert row.channel in STANDARD
    assert row.level in LEVELS
    assert row.widened in WIDENED
    assert row.plausible > 0.0


@pytest.mark.parametrize("name", STATES)
def test_a_state_is_moved_by_levels_that_exist_and_seen_by_a_row(name: str, coefficients: Coefficients) -> None:
    state = STATES[name]
    assert state.start > 0.0
    assert {state.level, state.climb_level} <= {"", *LEVELS}
    assert state.widened in WIDENED
    drives_a_seen_state = name in ("climb", "climb_rate")
    assert drives_a_seen_state or any(name in row.loads(coefficients) for row in ROWS.values())


def test_every_level_is_used_and_lies_in_its_range() -> None:
    used = {row.level for row in ROWS.values()} | {one.level for one in STATES.values()}
    used |= {one.climb_level for one in STATES.values()}
    assert used - {""} == LEVELS.keys()
    assert all(0.0 < one.lowest <= one.typical <= one.highest for one in LEVELS.values())


@pytest.mark.parametrize("name", ORDINARY)
def test_an_ordinary_cause_moves_a_row_and_has_its_words(name: str, coefficients: Coefficients) -> None:
    cause = ORDINARY[name]
    assert cause.text
    assert cause.jumps.keys() <= STATES.keys()
    assert all(sd > 0.0 for sd in cause.jumps.values())
    assert set(cause.needs) <= ROWS.keys()
    assert cause.unless in ("", *STANDARD)
    assert set(cause.noisy) <= STANDARD.keys()
    assert not cause.jumps.keys() & MANOEUVRE.keys()  # what a pilot does at any time explains nothing by itself
    assert not cause.jumps or any(set(cause.jumps) & row.loads(coefficients).keys() for row in ROWS.values())
