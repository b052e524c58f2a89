"""Thresholds: monotone, scaled, higher where no table fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.flight.parity import LENGTHS_S, RESIDUALS, ParityTable, ScanKey, shipped_tables, table_for, threshold_of

STATISTICS = np.sort(np.random.default_rng(1).exponential(20.0, 80))
TABLE = ParityTable(
    residuals=("lift", "climb"), length_s=120.0, knows_zero_lift=True, statistics=STATISTICS, logs=("made",)
)
KEY = ScanKey(residuals=("climb", "lift"), length_s=120.0, knows_zero_lift=True)
NAMES = [kind.name for kind in RESIDUALS]


def level(false_alarm: float = 0.01, scale: float = 1.0, **other) -> float:
    return threshold_of([TABLE], replace(KEY, **other), false_alarm=false_alarm, scale=scale).level


@given(st.floats(1e-4, 0.3), st.floats(1e-4, 0.3))
def test_a_rarer_false_alarm_has_a_higher_threshold(first, second):
    low, high = sorted((first, second))
    assert level(false_alarm=low) >= level(false_alarm=high)


def test_the_threshold_has_the_p_value_that_was_wanted():
    for wanted in (0.001, 0.01, 0.05, 0.2):
        for scale in (1.0, 2.5):
            threshold = threshold_of([TABLE], KEY, false_alarm=wanted, scale=scale)
            # No less than one in all the windows counted and this one.
            expected = max(wanted, 1.0 / (len(STATISTICS) + 1))
            assert threshold.p_value(threshold.level) == pytest.approx(expected, rel=0.3)
            assert threshold.p_value(1e6) <= threshold.p_value(threshold.level) < threshold.p_value(0.1)


def test_the_flight_scales_the_threshold():
    assert level(scale=1.7) == pytest.approx(1.7 * level())


@pytest.mark.parametrize(
    "other",
    [
        {"residuals": ("lift",)},
        {"length_s": 60.0},
        {"knows_zero_lift": False},
        {"residuals": ("lift", "kinematics")},
        {"beside": True},
    ],
)
def test_where_no_table_fits_the_tail_of_the_nearest_is_less_sure(other):
    for wanted, more in ((0.01, 1.1), (1e-4, 1.5)):
        assert level(**other, false_alarm=wanted) > more * level(false_alarm=wanted)
    # Within what was counted a table is a table.
    assert level(**other, false_alarm=0.3) == level(false_alarm=0.3)


def test_a_table_fits_residuals_in_any_order_and_lengths_within_a_tenth():
    assert table_for([TABLE], replace(KEY, length_s=130.0)) is TABLE
    assert table_for([TABLE], replace(KEY, length_s=140.0)) is None
    assert table_for([TABLE], replace(KEY, knows_zero_lift=False)) is None


def test_without_lift_the_angle_of_zero_lift_is_of_no_account():
    table = ParityTable(
        residuals=("climb",), length_s=60.0, knows_zero_lift=True, statistics=STATISTICS, logs=("made",)
    )
    assert table.fits(ScanKey(residuals=("climb",), length_s=60.0, knows_zero_lift=False))


@pytest.mark.parametrize("length_s", LENGTHS_S)
@pytest.mark.parametrize("known", [True, False])
def test_the_program_ships_a_table_for_every_set_of_residuals(length_s, known):
    tables = shipped_tables()
    for bits in range(1, 2 ** len(NAMES)):
        residuals = tuple(name for k, name in enumerate(NAMES) if bits >> k & 1)
        key = ScanKey(residuals=residuals, length_s=length_s, knows_zero_lift=known)
        table = table_for(tables, key)
        assert table is not None
        assert len(table.statistics) >= 15
        assert np.all(np.diff(table.statistics) >= 0.0)
        assert np.all(np.isfinite(table.statistics))
        assert 5.0 < threshold_of(tables, key, false_alarm=0.01).level < 500.0
