"""The scan on simulated flights: exact without noise, invariant to units, and what it says of wrong shapes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bars import FULL
from noted import texts

from bfi_cli.config import Config, StartTime, merge
from bfi_cli.decision import KINDS, decide
from bfi_cli.errors import ConfigError, LogError
from bfi_cli.faults import Fault
from bfi_cli.flightlog.record import FlightLog, frozen_array
from bfi_cli.model.onset import find_onset
from bfi_cli.model.onset.scan import scan_hypotheses
from bfi_cli.model.onset.scan_record import prepare_record
from bfi_cli.model.onset.shapes import shape_hypotheses
from bfi_cli.model.preprocessing.defaults import is_any

BIAS = Fault(shape="bias", magnitude=1.0, onset_s=15.0)
BETWEEN = replace(BIAS, onset_s=15.04)  # between two samples of the analysis
DRIFT = Fault(shape="drift", magnitude=0.25, onset_s=16.0)
SINE = Fault(shape="sine", magnitude=0.5, frequency_hz=0.7, onset_s=10.0)
FAULTS = pytest.mark.parametrize("fault", [BIAS, DRIFT], ids=lambda fault: fault.shape)


@pytest.fixture(scope="module")
def of_bias(flown, settings):
    """Return what is found of a step in noise, between two samples of the analysis."""
    return find_onset(flown(BETWEEN), settings())


@pytest.fixture(scope="module")
def without_noise(flown, settings):
    """Return a function that gives what is found without noise, each fault looked for once."""
    return cache(lambda fault: find_onset(flown(fault, noise=0.0), settings()))


@pytest.mark.first_rows(1)
@FAULTS
def test_without_noise_the_fault_is_found_as_it_is(without_noise, fault):
    result = without_noise(fault)
    (found,) = result.faults
    assert (result.decision, found.fault.shape) == ("fault", fault.shape)
    assert found.fault.onset_s == pytest.approx(fault.onset_s, abs=0.02)
    assert found.magnitude == pytest.approx(fault.magnitude, rel=5e-3)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("fault", "order"), [(DRIFT, 4), (BIAS, "auto"), (DRIFT, "auto")])
def test_with_noise_the_interval_holds_the_onset(flown, settings, fault, order):
    result = find_onset(flown(fault, seed=0), settings(order))
    (found,) = result.faults
    low, high = found.onset_ci95
    assert found.fault.shape == fault.shape
    assert low <= fault.onset_s <= high
    assert high - low < 0.5
    assert found.fault.onset_s == pytest.approx(fault.onset_s, abs=0.1)


def test_an_onset_between_two_samples_of_the_analysis(of_bias):
    assert of_bias.faults[0].fault.onset_s == pytest.approx(BETWEEN.onset_s, abs=0.011)
    assert of_bias.log.rate_hz == 10.0


def test_units_and_offset_of_the_output_change_nothing_but_the_magnitude(flown, settings, of_bias):
    log = flown(BETWEEN)
    tas = log.channel("tas")
    changed = replace(log, channels={**log.channels, "tas": replace(tas, values=frozen_array(7.0 - 3.0 * tas.values))})
    other = find_onset(changed, settings())
    assert other.statistic == pytest.approx(of_bias.statistic, rel=1e-6)
    assert other.faults[0].onset_ci95 == of_bias.faults[0].onset_ci95
    assert other.faults[0].magnitude == pytest.approx(-3.0 * of_bias.faults[0].magnitude, rel=1e-6)


@pytest.mark.slow
def test_the_magnitude_of_a_large_fault_scales(flown, settings):
    small, large = (find_onset(flown(replace(BIAS, magnitude=z)), settings()).faults[0] for z in (1.0, 50.0))
    assert large.magnitude - small.magnitude == pytest.approx(49.0, abs=0.1)


def test_no_fault(flown, settings):
    result = find_onset(flown(), settings("auto"))
    assert result.faults == ()
    assert result.decision == decide(result.verdicts, KINDS) != "fault"
    assert {one.shape for one in result.candidates} >= {"bias", "drift"}
    assert result.statistic < result.threshold
    assert result.p_value > result.false_alarm


@pytest.mark.slow
def test_an_oscillation_of_unknown_frequency_and_phase(flown, settings):
    phased = replace(SINE, phase_rad=1.9)
    result = find_onset(flown(phased), settings(2, shapes=("bias", "sine"), frequency_hz=(0.6, 0.9)))
    (found,) = result.faults
    assert found.fault.frequency_hz == pytest.approx(0.7, abs=0.002)
    assert found.fault.phase_rad == pytest.approx(1.9, abs=0.05)
    assert found.fault.onset_s == pytest.approx(10.0, abs=0.011)
    assert found.magnitude == pytest.approx(0.5, rel=0.02)


@pytest.mark.slow
def test_a_bias_and_an_oscillation_of_another_phase_leave_nothing(flown, settings):
    phased = replace(SINE, phase_rad=-1.2, magnitude=2.0)
    result = find_onset(flown(BIAS, phased), settings(shapes=("bias", "sine"), frequency_hz=(0.3, 1.2)))
    found = {one.fault.shape: one.magnitude for one in result.faults}
    assert len(result.faults) == 2
    assert abs(found["sine"]) == pytest.approx(2.0, rel=0.01)
    assert found["bias"] == pytest.approx(1.0, rel=0.02)


def test_a_fault_that_begins_with_the_manoeuvre_is_said_to(flown, settings, of_bias):
    begins = find_onset(flown(replace(BIAS, onset_s=3.2)), settings())
    for result, said in ((begins, True), (of_bias, False)):
        assert result.decision == "fault"
        assert any("begins while the inputs move most" in note for note in texts(result.notes)) is said


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("onset_s", [2.0, 31.3])
def test_a_step_near_an_end_of_the_record_keeps_its_size(flown, settings, onset_s):
    """The order chosen without the fault may not look that close to the ends; what it finds instead is not taken."""
    (found,) = find_onset(flown(replace(BIAS, onset_s=onset_s)), settings("auto")).faults
    assert found.fault.onset_s == pytest.approx(onset_s, abs=0.02)
    assert found.magnitude == pytest.approx(1.0, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slope", "start_s", "stop_s"),
    [
        pytest.param(-1.0, 9.0, 14.0, marks=pytest.mark.skipif(not FULL, reason="only where BFI_FULL=1 is set")),
        (0.2, 12.0, 22.0),
    ],
)
def test_a_drift_that_ends_is_found_though_the_filter_smears_its_end(flown, settings, slope, start_s, stop_s):
    fault = replace(DRIFT, magnitude=slope, onset_s=start_s, offset_s=stop_s)
    log = flown(fault).window(None if FULL else 7.0, None if FULL else 26.0)
    found = max(find_onset(log, settings("auto", ends=True)).faults, key=lambda one: one.statistic)
    low, high = found.ci95
    assert low <= slope <= high
    assert high - low < 0.3 * abs(slope)
    assert found.onset_ci95[0] <= start_s <= found.onset_ci95[1]
    assert found.fault.onset_s == pytest.approx(start_s, abs=0.3)
    assert found.fault.offset_s == pytest.approx(stop_s, abs=0.03)


def test_two_faults(flown, settings):
    later = replace(BIAS, magnitude=-2.0, onset_s=24.0)
    result = find_onset(flown(BIAS, later), settings(shapes=("bias",)))
    found = {round(one.fault.onset_s, 1): one.magnitude for one in result.faults}
    assert found == {15.0: pytest.approx(1.0, abs=0.05), 24.0: pytest.approx(-2.0, abs=0.05)}


def test_the_fault_lies_where_its_profile_is_highest(without_noise):
    result = without_noise(BIAS)
    profile = next(one for one in result.profiles if one.shape == "bias")
    best = int(np.argmax(profile.statistic))
    assert profile.onset_s[best] == pytest.approx(15.0, abs=0.1)
    assert profile.magnitude[best] == pytest.approx(1.0, abs=0.05)
    assert profile.statistic.max() == pytest.approx(result.statistic)


def test_a_table_of_other_settings_gives_no_p_value(flown, settings):
    config = settings()
    config = config.model_copy(update={"model": config.model.model_copy(update={"order": 3})})
    result = find_onset(flown(BIAS), config)
    assert (result.decision, result.p_value, result.faults[0].p_value) == ("fault", None, None)
    assert result.calibration.matches is False
    assert any("order 4 instead of 3" in note for note in texts(result.notes))


@pytest.mark.slow
def test_a_simulated_calibration_is_seeded(flown, settings):
    config = settings(2, shapes=("bias",))
    config = config.model_copy(update={"start_time": config.start_time.model_copy(update={"calibration": "gaussian"})})
    one, same = (find_onset(flown(BIAS), config) for _ in range(2))
    other = find_onset(flown(BIAS), config.model_copy(update={"seed": 5}))
    assert one.threshold == same.threshold != other.threshold
    assert 5.0 < one.threshold < 40.0
    assert (one.calibration.source, one.calibration.matches) == ("gaussian", True)


def test_self_calibration_needs_a_past(flown, settings):
    config = settings()
    config = config.model_copy(update={"start_time": config.start_time.model_copy(update={"calibration": "self"})})
    with pytest.raises(LogError, match=r"--calibration self needs .* before the window"):
        find_onset(flown(BIAS), config)


def test_a_shape_no_table_has(flown, settings):
    config = settings(shapes=("bias",))
    start_time = config.start_time.model_copy(update={"shapes": ("bias", "drift")})
    with pytest.raises(ConfigError, match="has all of bias, drift"):
        find_onset(flown(BIAS), config.model_copy(update={"start_time": start_time}))


@pytest.mark.slow
def test_start_and_end_between_two_samples_of_the_analysis(flown, settings):
    pulse = replace(BIAS, offset_s=20.04)
    (found,) = find_onset(flown(pulse), settings(shapes=("bias",), ends=True)).faults
    assert found.fault.onset_s == pytest.approx(15.0, abs=0.011)
    assert found.fault.offset_s == pytest.approx(20.04, abs=0.021)
    assert found.magnitude == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_a_fault_is_found_on_the_output_that_has_it(flown):
    aoa = Fault(shape="bias", channel="aoa", magnitude=0.02, onset_s=12.0)
    written = {
        "outputs": ("tas", "aoa"),
        "conditioning": {"rate_hz": 10.0},
        "model": {"order": 2},
        "start_time": {"shapes": ("bias",), "calibration": "gaussian"},
    }
    result = find_onset(flown(aoa), Config.model_validate(written))
    strongest = result.faults[0]
    assert strongest.fault.channel == "aoa"
    assert strongest.fault.onset_s == pytest.approx(12.0, abs=0.011)
    assert strongest.magnitude == pytest.approx(0.02, rel=0.05)
    assert strongest.unit == "rad"


def test_frequencies_above_what_the_rate_resolves(flown, settings):
    with pytest.raises(ConfigError, match=r"--frequency: 8 Hz is more than a rate of 10 Hz resolves"):
        settings(shapes=("sine",), frequency_hz=(1.0, 8.0))


def test_a_window_too_short_for_two_ends(flown, settings):
    config = settings(12, shapes=("bias",), ends=True)
    short = config.model_copy(update={"window": config.window.model_copy(update={"from_s": 4.0, "to_s": 11.5})})
    with pytest.raises(LogError, match="too few to look for start and end at order 12"):
        find_onset(flown(BIAS), short)


@pytest.mark.parametrize("shape", ["lagged_bias", "ramp_hold"])
def test_slow_shapes(flown, settings, shape):
    key = {"lagged_bias": "time_constant_s", "ramp_hold": "duration_s"}[shape]
    record = prepare_record(flown(Fault(shape=shape, magnitude=2.0, onset_s=12.0, **{key: 2.0})), settings())
    forms = shape_hypotheses(StartTime(shapes=(shape,)), 1, record.settings.duration_s)
    found = scan_hypotheses(replace(record, forms=forms), record.y, 4).of(shape)
    assert found.form.parameter == 2.0
    assert record.onset_s(found.onset) == pytest.approx(12.0, abs=0.11)
    assert record.unit[0] * found.profile.z[found.profile.best] == pytest.approx(2.0, rel=0.05)


def test_a_shape_of_ones_own(flown, tmp_path):
    file = tmp_path / "hump.csv"
    times = np.arange(0.0, 6.0, 0.05)
    file.write_text("".join(f"{t},{np.sin(np.pi * t / 6.0) ** 2}\n" for t in times))
    fault = Fault(shape="samples", file=str(file), magnitude=1.5, onset_s=12.0)
    record = prepare_record(
        flown(fault),
        Config.model_validate(
            {"conditioning": {"rate_hz": 10.0}, "start_time": {"shapes": ("samples",), "samples": str(file)}}
        ),
    )
    found = scan_hypotheses(record, record.y, 4).of("samples")
    assert record.onset_s(found.onset) == pytest.approx(12.0, abs=0.11)
    assert record.unit[0] * found.profile.z[found.profile.best] == pytest.approx(1.5, rel=0.02)


@pytest.mark.parametrize(
    ("channel", "error", "expected"),
    [("tas", 108.0, False), ("tas", 109.0, True), ("pitch", 109.0, False), ("pitch", np.inf, True)],
)
def test_an_error_may_be_any_where_it_exceeds_all_that_a_speed_reads(flown, channel, error, expected):
    log = flown(replace(BIAS, magnitude=4.0, onset_s=8.0)).window(0.0, 12.0)
    assert is_any(error, log, channel) is expected


@pytest.mark.slow
def test_a_limit_beyond_all_that_a_speed_reads_is_none(flown):
    """Nothing is said by "12.3 m/s could hide" of an airspeed that reads 10 at most."""
    log = flown(replace(BIAS, magnitude=4.0, onset_s=8.0)).window(0.0, 12.0)
    asked = {"conditioning.rate_hz": 10.0, "model.order": 12, "start_time.shapes": ("bias", "drift")}

    def limit_of_drifts(log: FlightLog) -> float | None:
        result = find_onset(log, merge(Config(), {**asked, "tolerances": {"tas": 3.0}}))
        assert result.decision == "fault"
        return next(one.effect for one in result.candidates if one.shape == "drift")

    limit = limit_of_drifts(log)
    assert limit is not None
    tas = log.channel("tas")
    low = frozen_array(tas.values - tas.values.max() + 0.8 * limit)
    assert limit_of_drifts(replace(log, channels={**log.channels, "tas": replace(tas, values=low)})) is None
