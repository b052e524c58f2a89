"""Shape free: found with its course, given up for a named shape that fits, and refused where it cannot be told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import DictionaryError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import Channel, frozen_array
from bfi_cli.model import identify_faults
from bfi_cli.model.report import identify_content
from bfi_cli.model.result import IdentifyResult

RATE_HZ, N, ONSET_S = 10.0, 500, 20.0
TIME_S = np.arange(N) / RATE_HZ
AFTER = TIME_S >= ONSET_S
BUMP = np.where(AFTER, np.sin(np.pi * (TIME_S - ONSET_S) / 25.0), 0.0)
CONFIG = merge(Config(), {"conditioning.rate_hz": "none", "model.order": 2, "onset_tolerance_s": 0.0})
FREE = {"name": "course", "shape": "free", "onset_s": ONSET_S}


def flown(seed: int, fault: np.ndarray | float = 0.0, *, pole: float = 0.7) -> FlightLog:
    """Return an airspeed that an elevator drives through a pole, and a fault that is in no truth."""
    rng = np.random.default_rng(seed)
    elevator, speed = 0.05 * rng.standard_normal(N), np.zeros(N)
    error = 0.02 * rng.standard_normal(N)
    for k in range(1, N):
        speed[k] = pole * speed[k - 1] + 10.0 * elevator[k - 1] + error[k]
    values = {"elevator": elevator, "tas": 100.0 + speed + fault}
    units = {"elevator": "rad", "tas": "m/s"}
    return FlightLog(
        path="made.h5",
        time_s=frozen_array(TIME_S),
        channels={
            name: Channel(name=name, values=frozen_array(one), unit=units[name], source=name)
            for name, one in values.items()
        },
        filters=(),
    )


def identified(log: FlightLog, *beside: dict[str, object], config: Config = CONFIG) -> IdentifyResult:
    return identify_faults(log, load_dictionary({"atoms": [FREE, *beside]}), config)


def states(result: IdentifyResult) -> dict[str, str | None]:
    return {one.name: one.state for one in result.candidates}


@cache
def found() -> IdentifyResult:
    return identified(flown(1, 2.0 * BUMP), {"name": "step", "shape": "bias", "onset_s": ONSET_S})


def test_a_course_that_no_shape_has_is_found_and_drawn() -> None:
    result = found()
    assert states(result)["course"] == "declared"
    series = result.outputs[0]
    assert np.sum((series.fault - 2.0 * BUMP) ** 2) <= 0.1 * np.sum((2.0 * BUMP) ** 2)
    assert not series.fault[~AFTER].any()
    assert np.mean(np.abs(series.fault - 2.0 * BUMP)[AFTER] <= 1.96 * series.fault_sd[AFTER]) >= 0.8
    np.testing.assert_allclose(series.corrected, series.measured - series.fault)
    (fault,) = result.faults
    assert fault.ci95[0] <= 2.0 <= fault.ci95[1]
    assert (fault.unit, fault.physical_unit) == ("m/s", "m/s")
    assert (result.decision, result.verdicts["slow"]) == ("fault", "fault")


def test_it_is_drawn_with_its_band() -> None:
    content = identify_content(found())
    assert "its shape unknown" in content.verdict
    (drawing,) = (one for one in content.drawings if one.name == "fault")
    (drawn,) = drawing.panels[0].curves
    assert drawn.low is not None
    assert max(drawn.y) > 1.5


def test_a_named_shape_that_fits_is_cheaper() -> None:
    result = identified(flown(2, 2.0 * AFTER), {"name": "step", "shape": "bias", "onset_s": ONSET_S})
    assert states(result) == {"course": "not_seen", "step": "declared"}
    (course,) = (one for one in result.candidates if one.name == "course")
    assert "no evidence for it" in (course.note or "")


@pytest.mark.slow
def test_a_named_fault_elsewhere_stays_beside_it() -> None:
    early = 1.5 * (TIME_S >= 8.0)
    result = identified(flown(4, 2.0 * BUMP + early), {"name": "early", "shape": "bias", "onset_s": 8.0})
    assert states(result) == {"course": "declared", "early": "declared"}
    (bias,) = (one for one in result.faults if one.name == "early")
    assert abs(bias.magnitude - 1.5) < 0.1
    assert np.sum((result.outputs[0].fault - 2.0 * BUMP - early) ** 2) <= 0.1 * np.sum((2.0 * BUMP) ** 2)


@pytest.mark.slow
def test_beside_a_named_fault_that_begins_late_the_output_is_drawn_as_measured() -> None:
    log = flown(4, 2.0 * BUMP + 0.3 * (TIME_S >= 8.5))
    early = {"name": "early", "shape": "bias", "onset_s": 8.0}
    result = identified(log, early, config=merge(CONFIG, {"onset_tolerance_s": 1.0}))
    assert states(result) == {"course": "declared", "early": "declared"}
    assert {one.name: one.fault.onset_s for one in result.faults}["early"] == pytest.approx(8.5, abs=0.11)
    np.testing.assert_array_equal(result.outputs[0].measured, log.channel("tas").values)


@pytest.mark.slow
def test_fault_free_records_are_given_no_course() -> None:
    declared = [states(identified(flown(seed)))["course"] == "declared" for seed in range(100, 103)]
    assert np.mean(declared) <= 0.03 + 2.0 * np.sqrt(0.03 * 0.97 / len(declared))


@pytest.mark.slow
def test_where_the_dynamics_integrate_no_course_is_made_up() -> None:
    """A pole at 1 turns white errors into a walk of its own, of which a smooth course is a part."""
    said = [identified(flown(seed, 1.0 * BUMP, pole=1.0)) for seed in range(2)]
    for result in said:
        (course,) = result.candidates
        assert course.state != "declared" or np.sum((result.outputs[0].fault - BUMP) ** 2) <= 0.5 * np.sum(BUMP**2)
    assert {states(result)["course"] for result in said} & {"suspected", "not_seen"}


@pytest.mark.parametrize("onset_s", [0.1, 48.5])
def test_too_few_samples_on_a_side_are_named(onset_s: float) -> None:
    log = flown(5, 2.0 * BUMP)
    result = identify_faults(log, load_dictionary({"atoms": [FREE | {"onset_s": onset_s}]}), CONFIG)
    (course,) = result.candidates
    assert course.state == "not_seen"
    assert "not identifiable" in (course.note or "")
    assert "choose a longer window around it" in (course.note or "")


@pytest.mark.slow
def test_of_two_courses_the_better_one_is_declared() -> None:
    result = identified(flown(6, 2.0 * BUMP), FREE | {"name": "later", "onset_s": 26.0})
    assert states(result)["course"] == "declared"
    assert states(result)["later"] in ("not_seen", "suspected")


def test_a_method_without_courses_and_several_outputs_are_refused() -> None:
    with pytest.raises(DictionaryError, match="a fault of unknown shape is estimated by --method ml on one output"):
        identified(flown(7), config=merge(CONFIG, {"method": "risro"}))


@pytest.mark.slow
def test_the_injected_fault_is_the_course_that_begins_with_it() -> None:
    fault = Fault(shape="ramp_hold", channel="tas", magnitude=3.0, duration_s=6.0, onset_s=ONSET_S, name="ramp")
    result = identified(inject(flown(8), [fault]))
    assert result.truth is not None
    assert (result.truth.isolated, result.truth.missed, result.truth.false_alarms) == (True, (), ())
    assert (result.truth.vaf_fault["tas"] or 0.0) >= 90.0
    assert (result.truth.magnitude_error or 1.0) < 0.3


@pytest.mark.slow
def test_the_scan_is_not_made_beside_a_course() -> None:
    log = flown(1, 2.0 * BUMP)
    result = identify(log, load_dictionary({"atoms": [FREE]}), CONFIG)[0]
    assert result.scan.note == "not scanned: a fault of unknown shape is declared"
    assert result.decision == "fault"


def test_nobody_can_inject_it() -> None:
    with pytest.raises(DictionaryError, match="shape 'free' has no course of its own; give one that has, as samples"):
        inject(flown(9), [Fault(shape="free", channel="tas", onset_s=ONSET_S)])
