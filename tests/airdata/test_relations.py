"""A relation is one row: plausibility, parity and the search for short defects use it from the table alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight

from bfi_cli.airdata import impact_pressure_of_mach, relations
from bfi_cli.airdata.relations import DOMAIN, RELATIONS, Relation, State, relatives
from bfi_cli.flight.parity.relation_series import WORTH
from bfi_cli.flight.parity.static_relations import find_static
from bfi_cli.flight.plausibility import implausible_channels
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.defects import RELATIVES
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.quantities.channels import STANDARD

TOTAL = Relation(
    lambda s: s.values["p_total"],
    lambda s: s.values["p_static"] + impact_pressure_of_mach(s.values["mach"], s.values["p_static"]),
    name="p_total by mach",
    needs=("p_total", "mach", "p_static"),
    tolerance=100.0,
)
ONSET_S = 300.0


def with_added(log: FlightLog, channel: str, added: np.ndarray | float) -> FlightLog:
    changed = replace(log.channels[channel], values=frozen_array(log.channels[channel].values + added))
    return replace(log, channels={**log.channels, channel: changed})


@pytest.fixture
def flight() -> FlightLog:
    return made_flight(names=("p_total", "mach", "p_static", "tas"))


@pytest.mark.parametrize("rows", [RELATIONS, (*RELATIONS, TOTAL)], ids=["without", "with"])
def test_a_row_is_used_by_plausibility_and_parity(
    flight: FlightLog, rows: tuple[Relation, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relations, "RELATIONS", rows)
    lasting = implausible_channels(with_added(flight, "p_total", 900.0))
    steps = find_static(with_added(flight, "p_total", 200.0 * (flight.time_s >= ONSET_S)), 240.0, 360.0)
    if TOTAL not in rows:
        assert not lasting
        assert not steps.findings
        return
    (finding,) = lasting
    assert (finding.channels, finding.what) == (("p_total",), "offset")
    (step,) = steps.findings
    assert "p_total" in step.among
    assert [relation.name for relation in steps.relations if relation.changes] == [TOTAL.name]
    assert step.onset_s == pytest.approx(ONSET_S, abs=1.0)


def test_a_row_of_two_channels_of_one_line_makes_them_predict_each_other() -> None:
    airspeeds = ("tas", "cas", "ias", "mach", "q_impact")
    expected = {name: {*airspeeds} - {name} for name in airspeeds} | {
        "altitude": {"p_static", "+altitude_rate"},
        "p_static": {"altitude", "+altitude_rate"},
    }
    assert {name: {*RELATIVES[name]} - {"+tas_rate"} for name in expected} == expected
    row = Relation(
        lambda s: s.values["baro_altitude"],
        lambda s: s.values["altitude"],
        name="baro_altitude",
        needs=("baro_altitude", "altitude"),
    )
    assert {*relatives((*RELATIONS, row))["baro_altitude"]} == {"altitude", "p_static", "+altitude_rate"}


@pytest.mark.parametrize("row", RELATIONS, ids=lambda row: " ".join((row.name, *row.needs)))
def test_a_row_says_what_each_analysis_needs(row: Relation) -> None:
    assert {*row.needs, *row.beside} <= STANDARD.keys()
    assert row.name or row.lasts
    if row.name:
        assert not row.timed
        assert not row.beside
        assert {*row.needs} <= DOMAIN.keys()
        assert (row.worth[1] or STANDARD[row.needs[0]].unit) in WORTH


@pytest.mark.parametrize("row", [row for row in RELATIONS if row.name], ids=lambda row: " ".join(row.needs))
def test_a_healthy_flight_keeps_a_row_that_a_computer_keeps(row: Relation) -> None:
    names = ("tas", "mach", "cas", "ias", "altitude", "p_static", "q_impact", "p_total", "tat", "sat")
    log = made_flight(names=names)
    state = State(values={name: log.channels[name].values for name in names}, rates={}, time_s=log.time_s)
    np.testing.assert_allclose(row.reading(state), row.expected(state), rtol=1e-9)
