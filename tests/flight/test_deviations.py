"""What is surely within the tolerance is small, counted until the last window that shows it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bfi_cli.flight.diagnose import events_of
from bfi_cli.flight.events import Draft, beyond_its_tolerance, errors_of_rivals, largest_first
from bfi_cli.flight.looks import rate_of
from bfi_cli.flight.parity import LENGTHS_S, Finding

TOLERANCES = {"tas": 3.0, "aoa": 0.02}
FLIGHT: Any = SimpleNamespace(tolerance=lambda channel, window: TOLERANCES.get(channel))


def draft(magnitude: float | None, sd: float = 0.0, *, until_s: float = 160.0, **changes: Any) -> Draft:
    """Return a drift from 100 s on in a window to 160 s."""
    values: dict[str, Any] = {
        "fault": "tas",
        "among": ("tas",),
        "channels": ("tas",),
        "stage": "parity",
        "shape": "drift",
        "magnitude": magnitude,
        "sd": sd,
        "unit": "m/s^2",
        "onset_s": 100.0,
        "onset_ci95": (97.0, 103.0),
        "effect": {} if magnitude is None else {"tas": 60.0 * magnitude},
        "statistic": 60.0,
        "threshold": 30.0,
        **changes,
    }
    return Draft(finding=Finding(**values), window=(40.0, 160.0), until_s=until_s)


def test_a_slope_that_is_small_within_its_window_may_grow_beyond_the_tolerance():
    assert beyond_its_tolerance(FLIGHT, draft(-0.0026)) is False
    assert beyond_its_tolerance(FLIGHT, draft(-0.0026, until_s=1240.0)) is False
    assert beyond_its_tolerance(FLIGHT, draft(-0.0026, until_s=1265.0)) is True
    assert beyond_its_tolerance(FLIGHT, draft(-0.0026, until_s=1265.0, offset_s=900.0)) is False
    # A step grows no more.
    assert beyond_its_tolerance(FLIGHT, draft(2.9, until_s=9e3, shape="bias", effect={"tas": 2.9})) is False


def test_the_interval_decides_and_where_it_holds_the_tolerance_nothing_is_said():
    assert beyond_its_tolerance(FLIGHT, draft(0.04, sd=0.004)) is False
    assert beyond_its_tolerance(FLIGHT, draft(0.04, sd=0.006)) is None
    assert beyond_its_tolerance(FLIGHT, draft(0.06, sd=0.006)) is None
    assert beyond_its_tolerance(FLIGHT, draft(0.06, sd=0.004)) is True


def test_the_channel_furthest_beyond_decides():
    effect = {"tas": 0.6, "aoa": 0.03}
    assert beyond_its_tolerance(FLIGHT, draft(0.01, effect=effect)) is True


@pytest.mark.parametrize(
    ("ratio", "among", "expected"), [(0.1, ("aoa",), None), (0.01, ("aoa",), False), (0.1, (), False)]
)
def test_an_error_is_small_only_if_it_is_for_every_channel_that_may_be_at_fault(ratio, among, expected):
    one = draft(0.4, shape="bias", effect={"tas": 0.4}, among=("tas", *among), rivals={"aoa": ratio})
    assert beyond_its_tolerance(FLIGHT, one) is expected
    assert errors_of_rivals(one.finding) == pytest.approx(dict.fromkeys(among, 0.4 * ratio))


def test_what_has_no_size_is_not_said_to_be_small():
    assert beyond_its_tolerance(FLIGHT, draft(None)) is None


def test_events_come_by_effect_over_tolerance():
    small, large, unknown = draft(0.01), draft(0.2), draft(None)
    vane = draft(1e-3, fault="aoa", effect={"aoa": 0.06})
    assert largest_first(FLIGHT, [small, vane, large, unknown]) == [unknown, large, vane, small]


@pytest.mark.parametrize("counts", [(120, 60, 30), (7, 3, 1)])
def test_a_healthy_flight_alarms_at_most_at_its_level(counts: tuple[int, ...]):
    """The sum over all windows of all analyses, however they depend on each other: three lengths, and steps."""
    of_lengths = sum(n * rate_of(0.05, n) for n in counts)
    assert len(counts) == len(LENGTHS_S)
    assert of_lengths + 44 * rate_of(0.05, 44) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("statistic", "p_value", "state"), [(33.0, None, "suspected"), (33.1, None, "declared"), (11.0, 0.01, "declared")]
)
def test_a_step_that_no_shipped_table_fits_is_doubted_up_to_what_healthy_windows_show(
    statistic: float, p_value: float | None, state: str
):
    """3.3 times the threshold of an aircraft: by so much the largest of 129 healthy windows differs with the inputs."""
    step = draft(8.0, 0.1, stage="scan", shape="bias", statistic=statistic, threshold=10.0, p_value=p_value)
    flight: Any = SimpleNamespace(tolerance=FLIGHT.tolerance, recorded=("tas",), moved=())
    (event,) = events_of(flight, [step])
    assert event.state == state
