"""Constant errors over the flights of an aircraft: what each flight tells, and a trend of them."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_fleet import flight, flown, make_fleet

from bfi_cli.fleet import LogAnswer, rows_of_constants, trends_of
from bfi_cli.fleet.logs import aircraft_in
from bfi_cli.fleet.trends import trend_drawing, trend_rows
from bfi_cli.flight.plausibility.constants import ConstantError, constant_errors


def error(value: float) -> ConstantError:
    return ConstantError(channel="tas", by="circles", value=value, unit="m/s", ci95=(value - 0.1, value + 0.1))


def answers(values: np.ndarray, aircraft: str = "N1") -> list[LogAnswer]:
    rows = [rows_of_constants((error(float(value)),)) for value in values]
    answer = LogAnswer(log="", folder="", key="", sha256="", aircraft=aircraft, flight={})
    return [replace(answer, log=f"{k}.csv", constants=row) for k, row in enumerate(rows)]


@pytest.mark.parametrize("error_m_s", [-1.5, 0.0, 0.4])
def test_an_error_of_the_airspeed_is_what_circles_tell(error_m_s: float):
    found = {(one.channel, one.by): one for one in constant_errors(flown(error_m_s=error_m_s, gust_m_s=0.0))}
    assert found["tas", "circles"].value == pytest.approx(error_m_s, abs=0.02)
    found = {(one.channel, one.by): one for one in constant_errors(flown(error_m_s=error_m_s, gust_m_s=0.7))}
    low, high = found["tas", "circles"].ci95
    assert low - 0.3 <= error_m_s <= high + 0.3


def test_a_vane_is_held_against_pitch_and_climb():
    found = {one.channel: one for one in constant_errors(flown(vane_rad=0.02))}
    assert found["aoa"].value == pytest.approx(0.02, abs=1e-3)
    assert found["aoa"].unit == "rad"


def test_nothing_is_told_of_what_does_not_fly():
    log = flown()
    still = log.changed(lambda _, values: np.zeros_like(values), notes=())
    assert constant_errors(still) == ()


def test_a_trend_is_that_of_the_flights_in_order():
    values = 0.05 * np.arange(20) + 0.01 * np.random.default_rng(0).normal(size=20)
    (trend,) = trends_of(answers(values))
    assert trend.is_declared
    assert trend.ci95[0] <= 0.05 <= trend.ci95[1]
    (row,) = trend_rows([trend])
    assert (row["aircraft"], row["n_flights"], row["declared"]) == ("N1", 20, True)
    assert row["last"] - row["first"] == pytest.approx(19 * trend.slope)
    drawing = trend_drawing([trend])
    assert drawing is not None
    assert len(drawing.panels) == 1


def test_clocks_order_the_flights_where_all_have_one():
    values = 0.05 * np.arange(20)
    mixed = np.random.default_rng(1).permutation(20)
    flights = [replace(answers(values)[k], flight={"since_1970_s": 1e9 + 1e5 * k}) for k in mixed]
    assert trends_of(flights)[0].values == pytest.approx(tuple(values))
    flights[3] = replace(flights[3], flight={})
    assert trends_of(flights)[0].values == pytest.approx(tuple(values[mixed]))


def test_aircraft_are_apart_and_few_flights_tell_nothing():
    up, down = answers(0.1 * np.arange(10)), answers(-0.1 * np.arange(10), "N2")
    found = {one.aircraft: one.slope for one in trends_of([*up, *down, *answers(np.arange(6.0), "N3")])}
    assert found == pytest.approx({"N1": 0.1, "N2": -0.1})
    assert trends_of(answers(np.arange(20.0), "")) == ()
    assert trend_drawing([]) is None


@pytest.mark.parametrize(
    ("head", "aircraft"),
    [
        ('#airframe_info,log_version="1.00",aircraft_ident="D-EABC",system_id="1"\n', "D-EABC"),
        ('#airframe_info, airframe_name="Cessna 172S", system_id="24B6", mode=NORMAL, \n', "24B6"),
        ('#airframe_info, aircraft_ident="", system_id=" "\n', ""),
        ("time,tas\n0,1\n", ""),
        ("", ""),
    ],
)
def test_the_aircraft_of_a_header(head: str, aircraft: str, tmp_path: Path):
    (tmp_path / "log.csv").write_text(head)
    assert aircraft_in(str(tmp_path / "log.csv")) == aircraft
    assert aircraft_in(str(tmp_path)) == aircraft_in(str(tmp_path / "absent.csv")) == ""


@pytest.mark.usefixtures("undrawn")
def test_by_aircraft(bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    n = 10
    logs = make_fleet(tmp_path / "logs", n, broken=0)
    for k, path in enumerate(logs):
        path.write_text(flight(seed=k))
    (tmp_path / "list.csv").write_text("log,aircraft\n" + "".join(f"{path},N1\n" for path in logs))
    growing = iter(0.1 * np.arange(n))
    monkeypatch.setattr(
        "bfi_cli.flight.plausibility.constants.constant_errors", lambda _: (error(float(next(growing))),)
    )
    out = tmp_path / "out"
    words = ("--list", tmp_path / "list.csv", "--by", "aircraft", "--workers", 1, "--out", out)
    outcome = bfi("diagnose", *words)
    assert outcome.code == 0
    last = "N1: tas by circles changes by 0.1 m/s a flight (0.1 to 0.1) over 10 flights, 0.9 m/s in all"
    assert outcome.stdout.splitlines()[-1] == last
    with (out / "trends.csv").open(newline="") as file:
        assert next(file) == "# written by bfi\n"
        (row,) = csv.DictReader(file)
    assert (row["aircraft"], row["n_flights"], row["declared"]) == ("N1", "10", "true")
    page = (out / "index.html").read_text()
    assert page.count("data:image/svg+xml;base64,") == 1
    assert "tas by circles changes by 0.1 m/s a flight" in page
    # Of a call without it, no trends are left.
    assert bfi("diagnose", *words[:2], *words[4:]).code == 0
    assert not (out / "trends.csv").exists()
    assert len((out / "constants.csv").read_text().splitlines()) == 2 + n
    refused = bfi("diagnose", tmp_path / "logs", "--by", "aircraft")
    assert (refused.code, refused.stderr) == (
        2,
        "--by aircraft: no log states its aircraft; give --list FILE with columns log and aircraft\n",
    )
