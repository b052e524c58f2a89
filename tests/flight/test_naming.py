"""From a fit or a peak to a named fault: what errs, which others explain it as well, what tells them apart."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from bfi_cli.airdata import DEPENDS_ON, impact_pressure_of_cas
from bfi_cli.decision.calibration import null_from
from bfi_cli.faults import Fault
from bfi_cli.flight.naming import REPEATS, contradicted, finding_of_fit, finding_of_glance, repeat_advice
from bfi_cli.flight.parity import Finding, Threshold, explain, record_of, scan_window
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.injection import inject
from bfi_cli.model.onset.glance import Glance
from bfi_cli.quantities.channels import STANDARD

ONSET_S, WINDOW = 430.0, (370.0, 490.0)
ONE_AIRSPEED = ("tas", "altitude", "altitude_rate", "aoa", "pitch", "roll", "normal_acc", "longitudinal_acc")
COUNTED = np.random.default_rng(1).exponential(4.0, 200)
THRESHOLD = Threshold(level=20.0, suspected=15.0, null=null_from({"largest": COUNTED}))


def finding(log: FlightLog, fault: str, slope: float) -> Finding:
    if fault == "q_impact":
        spec = Fault(shape="pitot_icing", magnitude=-slope, onset_s=ONSET_S)
    else:
        spec = Fault(shape="drift", channel=fault, magnitude=slope, onset_s=ONSET_S)
    record = record_of(inject(log, [spec]))
    faulty = record.between(*WINDOW)
    scan = scan_window(faulty, zero_lift=np.radians(-1.2))
    assert scan is not None
    fits = explain(scan, faulty)
    return finding_of_fit(fits, faulty, THRESHOLD, log.channels.keys(), scan)


@pytest.fixture(scope="module")
def poor(journey: FlightLog) -> FlightLog:
    """Return a log with one airspeed."""
    return replace(journey, channels={name: journey.channels[name] for name in ONE_AIRSPEED})


def test_a_loss_of_impact_pressure_is_icing_and_counts_up(journey: FlightLog):
    found = finding(journey, "q_impact", -0.0025)
    assert (found.fault, found.among, found.unit) == ("pitot_icing", ("pitot_icing",), "1/s")
    assert found.magnitude == pytest.approx(0.0025, rel=0.05)
    assert set(found.channels) == {"tas", "cas", "mach", "sat"}
    assert found.effect["tas"] < 0.0


def test_a_channel_that_may_err_instead_would_err_by_what_shows_alike(journey: FlightLog):
    """Lift alone tells no vane from an accelerometer: a small error of one is a large one of the other."""
    lift = ("tas", "cas", "altitude", "tat", "aoa", "normal_acc")
    found = finding(replace(journey, channels={name: journey.channels[name] for name in lift}), "aoa", 0.0004)
    assert "normal_acc" in found.among
    assert found.rivals.keys() == {*found.among} - {found.fault}
    slope = 0.02 * float(np.median(impact_pressure_of_cas(journey.window(*WINDOW).channels["cas"].values)))
    assert found.rivals["normal_acc"] == pytest.approx(slope, rel=0.2)  # m/s^2 per rad, as the flight was made


def test_a_gain_of_impact_pressure_is_no_icing(journey: FlightLog):
    found = finding(journey, "q_impact", 0.0025)
    assert found.fault == "q_impact"
    assert found.magnitude == pytest.approx(0.0025, rel=0.05)
    assert found.effect["tas"] > 0.0


@pytest.mark.parametrize(("fault", "slope"), [("aoa", 7e-4), ("pitch", -1e-3), ("altitude_rate", 0.1)])
def test_a_channel_that_errs_alone_is_named(journey: FlightLog, fault: str, slope: float):
    found = finding(journey, fault, slope)
    assert (found.fault, found.channels, found.stage) == (fault, (fault,), "parity")
    assert found.magnitude == pytest.approx(slope, rel=0.1)
    assert abs(found.onset_s - ONSET_S) <= 5.0
    assert found.onset_ci95[0] <= found.onset_s <= found.onset_ci95[1]
    assert found.p_value == pytest.approx(1.0 / (len(COUNTED) + 1))  # beyond all that was counted


def test_one_airspeed_cannot_tell_its_channel_from_its_line(poor: FlightLog):
    assert finding(poor, "tas", -0.1).among[:2] == ("tas", "pitot_icing")
    # Ice takes pressure away, it gives none.
    assert "pitot_icing" not in finding(poor, "tas", 0.1).among


def peak(shape: str, frequency_hz: float | None = None) -> Glance:
    return Glance(
        shape=shape,
        channel="tas",
        magnitude=2.0,
        sd=0.1,
        onset_s=100.0,
        frequency_hz=frequency_hz,
        statistic=80.0,
        threshold=30.0,
        p_value=0.001,
    )


@pytest.mark.parametrize(
    ("shape", "relations", "among"),
    [
        ("bias", True, ("q_impact",)),
        ("bias", False, ("tas", "q_impact")),
        ("sine", True, ("pitot_water",)),
        ("sine", False, ("tas", "pitot_water")),
    ],
)
def test_what_all_airspeeds_show_lies_in_their_line(shape: str, relations: bool, among: tuple[str, ...]):
    found = finding_of_glance(
        peak(shape, 0.3 if shape == "sine" else None),
        ("tas", "cas", "altitude"),
        relations=relations,
        unit="m/s",
    )
    assert (found.fault, found.among) == (among[0], among)
    assert found.channels == (("tas",) if among[0] == "tas" else ("cas", "tas"))
    assert found.effect == {"tas": 2.0}


def test_relations_need_a_second_airspeed():
    found = finding_of_glance(peak("bias"), ("tas", "altitude"), relations=True, unit="m/s")
    assert found.among == ("tas", "q_impact")


def test_an_intact_relation_contradicts_a_fault_of_its_airspeed_only():
    assert contradicted({"tas": True, "mach": False, "tat": True, "altitude": True}) == ("tas",)
    assert contradicted({}) == ()


@pytest.mark.parametrize(("pair", "words"), REPEATS, ids=lambda value: "-".join(sorted(value)) if value else "")
def test_advice_does_not_depend_on_the_order_of_a_set(pair: frozenset[str], words: str):
    assert {repeat_advice(among) for among in permutations(pair)} == {words}
    assert len(pair) == 2
    known = {*STANDARD, *DEPENDS_ON, "pitot_icing", "ground_speed"}
    assert pair <= known


def test_a_single_fault_needs_no_advice_and_any_set_has_one():
    assert repeat_advice(("tas",)) == ""
    assert (
        repeat_advice(("roll", "aoa"))
        == "a second, independent sensor of angle of attack or roll attitude tells them apart"
    )
    lines = repeat_advice(("static_leak", "pitot_icing", "altitude_rate"))
    assert (
        lines == "a second, independent sensor of impact pressure or rate of climb or static pressure tells them apart"
    )
