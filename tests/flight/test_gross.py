"""Gross errors of a line: how far its readings leave the flight, how still all else stays, and for how long."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bfi_cli.flight.gross import gross_errors

ROWS = ("altitude", "altitude_rate", "tas", "cas", "pitch")
N = 600
AIRBORNE = (50, 550)


def bench_with(rows: dict[str, float], at: range) -> Any:
    """Return a flight that is predicted but for some seconds, in which rows leave it by standard deviations."""
    innovation = np.zeros((N, len(ROWS)))
    for name, size in rows.items():
        innovation[at, ROWS.index(name)] = size
    airborne = (np.arange(N) >= AIRBORNE[0]) & (np.arange(N) < AIRBORNE[1])
    frame = SimpleNamespace(airborne=airborne)
    model = SimpleNamespace(rows=ROWS, row=ROWS.index, n=N, time_s=np.arange(float(N)), frame=frame)
    return SimpleNamespace(model=model, innovation=innovation)


@pytest.mark.parametrize(
    ("rows", "is_gross"),
    [
        ({"altitude": 8.1, "tas": -6.1}, True),
        ({"altitude": 7.9, "tas": -6.1}, False),  # a height by eight of its standard deviations
        ({"altitude": 8.1, "tas": -5.9}, False),  # an airspeed by six
        ({"altitude": 8.1, "altitude_rate": 8.1}, True),
        ({"tas": 20.0, "cas": 20.0}, False),  # an airspeed alone is no line
        ({"altitude": 8.1, "tas": 6.1, "pitch": 4.9}, True),
        ({"altitude": 8.1, "tas": 6.1, "pitch": 5.1}, False),  # what no pressure moves leaves too
    ],
)
def test_readings_of_a_line_leave_the_flight_by_so_many_standard_deviations(rows: dict[str, float], is_gross: bool):
    assert bool(gross_errors(bench_with(rows, range(300, 305)))) == is_gross


@pytest.mark.parametrize(
    ("at", "is_gross"),
    [
        (range(300, 304), False),  # four seconds of a minute
        (range(300, 365, 13), True),  # five, the last 52 s after the first
        (range(300, 364, 15), False),  # five of more than a minute
        (range(125, 130), True),  # 75 s after take-off
        (range(120, 129), False),  # of which four seconds are so late
        (range(470, 475), True),
        (range(471, 476), False),
    ],
)
def test_gross_errors_are_five_seconds_of_a_minute_of_a_settled_flight(at: range, is_gross: bool):
    assert bool(gross_errors(bench_with({"altitude": 20.0, "tas": 20.0}, at))) == is_gross


@pytest.mark.parametrize(("apart_s", "n"), [(60, 1), (61, 2)])
def test_errors_that_are_a_minute_apart_are_two_events(apart_s: int, n: int):
    bench = bench_with({"altitude": 20.0, "tas": 20.0}, range(200, 205))
    bench.innovation[204 + apart_s : 209 + apart_s] = bench.innovation[200]
    stretches = gross_errors(bench)
    assert len(stretches) == n
    assert stretches[-1].to_s == 209.0 + apart_s
