"""Which fault explains a window: exact without noise, and a set where two faults look alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flight import ZERO_LIFT, log_of, made_log, made_record, ratio_of

from bfi_cli.flight.parity import corrected, effects, explain, record_of, scan_window
from bfi_cli.flight.parity.explain import CLOSE, COURSES, RARER, FaultByOnset, course_for, fit_course
from bfi_cli.flight.parity.record import Record, hypotheses, with_fault

RECORD = made_record(start_s=1000.5)
T = RECORD.time_s
ONSET_S = 1046.0  # one of the scan's
ALONE = made_record(start_s=1000.5, without=("cas", "ias", "mach", "q_impact", "p_total", "sat"))


def explained(record: Record, **options):
    """Return the scan of a record, and what explains it."""
    scan = scan_window(record, zero_lift=ZERO_LIFT)
    assert scan is not None
    return scan, explain(scan, record, **options)


@pytest.mark.first_rows(2)
@pytest.mark.parametrize("rate", [-0.008, -0.0005, -0.003, 0.002])
def test_an_icing_of_any_size_is_exact(rate):
    """The linear look is off by a third where 60 % of the impact pressure are lost; Gauss-Newton steps are not."""
    amount = rate * np.maximum(T - ONSET_S, 0.0)
    scan, fits = explained(with_fault(RECORD, "q_impact", amount))
    fit = fits[0]
    assert fit.fault.fault == "q_impact"
    assert len(fits) == 1 or rate == -0.0005  # as small a loss may be an error of the vane
    assert fit.shape == "drift"
    assert fit.onset_s == ONSET_S
    assert fit.magnitude == pytest.approx(rate, rel=1e-3)
    assert fit.onset_ci95[0] <= ONSET_S <= fit.onset_ci95[1]
    assert abs(fit.magnitude - rate) < 0.1 * fit.sd
    np.testing.assert_allclose(fit.amount(T), amount, rtol=1e-3, atol=1e-12)
    if rate == -0.008:
        linear = ratio_of(scan, "q_impact")
        assert abs(linear.magnitude[int(np.argmax(linear.ratio))] / rate - 1.0) > 0.1


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("size", "seconds"), [(600.0, 24.0), (-250.0, 12.0), (1500.0, 48.0)])
def test_a_static_line_that_leaks_in_part_is_named_with_its_amount(size, seconds):
    """The climb that the altitude shows, and attitude does not, tells it from ice."""
    lag = course_for("lagged_bias", seconds)
    assert lag is not None
    faulty = with_fault(RECORD, "static_leak", size * lag(T - ONSET_S))
    _, fits = explained(faulty)
    assert [fit.fault.fault for fit in fits] == ["static_leak"]
    assert (fits[0].shape, fits[0].constant_s) == ("lagged_bias", pytest.approx(seconds, rel=0.05))
    assert abs(fits[0].onset_s - ONSET_S) <= 1.0
    assert fits[0].magnitude == pytest.approx(size, rel=0.02)
    assert {"altitude", "altitude_rate", "tas", "cas"} <= effects(faulty, fits[0]).keys()


def test_the_interval_of_a_leak_holds_time_constants_between_those_tried():
    size, seconds = 800.0, 17.0
    faulty = with_fault(RECORD, "static_leak", -size * np.expm1(-np.maximum(T - ONSET_S, 0.0) / seconds))
    _, fits = explained(faulty)
    assert fits[0].fault.fault == "static_leak"
    assert abs(fits[0].magnitude - size) < 1.96 * fits[0].sd < 0.4 * size


@pytest.mark.first_rows(2)
@pytest.mark.parametrize(
    ("fault", "rate"), [("tas", -0.5), ("tas", 0.3), ("altitude_rate", 0.05), ("ground_speed", 0.2)]
)
def test_a_drift_of_one_channel_is_exact_and_named(fault, rate):
    amount = rate * np.maximum(T - ONSET_S, 0.0)
    faulty = with_fault(ALONE, fault, amount)
    _, fits = explained(faulty)
    assert fits[0].fault.fault == fault
    assert fits[0].onset_s == ONSET_S
    # The wind is the faulty window's, found once.
    assert fits[0].magnitude == pytest.approx(rate, rel=1e-2 if fault == "ground_speed" else 1e-3)
    clean = corrected(faulty, fits[0])
    for name, values in ALONE.channels.items():
        np.testing.assert_allclose(clean.channels[name], values, rtol=1e-2, atol=abs(rate) * 0.2)


@pytest.mark.parametrize(("fault", "rate"), [("aoa", np.radians(0.05)), ("pitch", np.radians(-0.1))])
def test_a_drift_of_an_angle_is_followed_into_the_integral(fault, rate):
    """Of a log at 10 Hz: the integral at its rate and the correction at seconds agree."""
    log = made_log(121.0, start_s=1000.0)
    values = {name: one.values for name, one in log.channels.items()}
    values[fault] = values[fault] + rate * np.maximum(log.time_s - ONSET_S, 0.0)
    _, fits = explained(record_of(log_of(log.time_s, values)))
    assert fits[0].fault.fault == fault
    assert fits[0].magnitude == pytest.approx(rate, rel=0.01)
    assert abs(fits[0].onset_s - ONSET_S) <= 1.0


@pytest.mark.parametrize(
    ("shape", "constant", "size"),
    [("bias", None, 6.0), ("ramp_hold", 20.0, 8.0), ("lagged_bias", 12.0, 8.0), ("drift", None, 0.3)],
)
def test_a_course_is_named(shape, constant, size):
    amount = size * course_for(shape, constant)(T - ONSET_S)
    _, fits = explained(with_fault(ALONE, "tas", amount))
    assert fits[0].fault.fault == "tas"
    assert (fits[0].shape, fits[0].constant_s) == (shape, constant)
    assert fits[0].magnitude == pytest.approx(size, rel=0.01)
    assert abs(fits[0].onset_s - ONSET_S) <= 1.0


@pytest.mark.parametrize("key", COURSES, ids=str)
def test_a_course_is_nothing_before_its_onset_and_never_falls(key):
    t = np.linspace(-50.0, 1200.0, 12501)
    values = course_for(*key)(t)
    assert np.all(values[t <= -0.5] == 0.0)
    assert np.all(np.diff(values) >= 0.0)
    if key[0] != "drift":
        assert values[-1] == pytest.approx(1.0, abs=1e-5)


def test_faults_that_show_in_one_residual_alike_are_a_set():
    """With nothing but lift, an error of the vane and one of the accelerometer explain it about as well."""
    scan = scan_window(RECORD, zero_lift=ZERO_LIFT, only=["lift"])
    assert scan is not None
    faulty = with_fault(RECORD, "normal_acc", 0.02 * np.maximum(T - ONSET_S, 0.0))
    rng = np.random.default_rng(4)
    faulty = replace(
        faulty, channels={**faulty.channels, "aoa": faulty.channels["aoa"] + 2e-3 * rng.standard_normal(len(T))}
    )
    scan = scan_window(faulty, zero_lift=ZERO_LIFT, only=["lift"])
    assert scan is not None
    fits = explain(scan, faulty)
    assert {"aoa", "normal_acc"} <= {fit.fault.fault for fit in fits}
    # An accelerometer after the vane that explains it as well.
    assert [fit.fault.fault for fit in fits].index("aoa") < [fit.fault.fault for fit in fits].index("normal_acc")


def test_a_loss_of_pressure_comes_before_the_vane_and_the_vane_before_the_accelerometer():
    """Ice takes pressure and grows; nothing makes a line gain any, so that a gain goes by how well it explains."""
    noise = 2e-3 * np.random.default_rng(9).standard_normal(len(T))
    for sign in (-1.0, 1.0):
        faulty = with_fault(RECORD, "aoa", sign * 1e-4 * np.maximum(T - ONSET_S, 0.0) + noise)
        scan = scan_window(faulty, zero_lift=ZERO_LIFT, only=["lift"])
        assert scan is not None
        fits = explain(scan, faulty, ruled_out=("tas", "cas", "ias", "mach", "p_total"))
        ratios = {fit.fault.fault: fit.ratio for fit in fits}
        # Without the climb a static line that leaks takes pressure as ice does.
        names = [fit.fault.fault for fit in fits if fit.fault.fault != "static_leak"]
        assert names[2] == "normal_acc"
        if sign < 0.0:
            assert names[:2] == ["q_impact", "aoa"]
            assert ratios["q_impact"] < ratios["aoa"]
        else:
            assert names[:2] == sorted(("q_impact", "aoa"), key=lambda name: -ratios[name])


def test_a_commoner_fault_that_is_near_with_its_odds_only_ends_the_set():
    noise = 2e-3 * np.random.default_rng(9).standard_normal(len(T))
    faulty = with_fault(RECORD, "normal_acc", 0.05 * np.maximum(T - ONSET_S, 0.0))
    faulty = replace(faulty, channels={**faulty.channels, "aoa": faulty.channels["aoa"] + noise})
    scan = scan_window(faulty, zero_lift=ZERO_LIFT, only=["lift"])
    assert scan is not None
    fits = explain(scan, faulty, ruled_out=("tas", "cas", "ias", "mach", "p_total"))
    assert [fit.fault.fault for fit in fits] == ["aoa", "normal_acc", "q_impact"]
    assert CLOSE < fits[0].ratio - fits[2].ratio <= CLOSE + RARER


def test_what_other_relations_rule_out_is_not_named_unless_it_is_all_there_is():
    faulty = with_fault(RECORD, "q_impact", -0.003 * np.maximum(T - ONSET_S, 0.0))
    _, every = explained(faulty)
    _, others = explained(faulty, ruled_out=("cas", "mach", "tas"))
    assert every[0].fault.fault == others[0].fault.fault == "q_impact"
    assert not {"cas", "mach", "tas"} & {fit.fault.fault for fit in others}
    everything = {fit.fault.fault for fit in every}
    _, kept = explained(faulty, ruled_out=everything | set(RECORD.channels) | {"ground_speed", "static_leak"})
    assert kept[0].fault.fault == "q_impact"


def test_the_effects_are_those_of_the_channels_that_err():
    faulty = with_fault(RECORD, "q_impact", -0.003 * np.maximum(T - ONSET_S, 0.0))
    _, fits = explained(faulty)
    found = effects(faulty, fits[0])
    assert found.keys() == {"tas", "cas", "ias", "mach", "q_impact", "p_total", "sat"}
    for name, size in found.items():
        error = faulty.channels[name] - RECORD.channels[name]
        assert size == pytest.approx(error[np.argmax(np.abs(error))], rel=0.01)


def test_the_parts_add_up_to_the_ratio():
    rng = np.random.default_rng(5)
    faulty = with_fault(ALONE, "tas", 0.2 * np.maximum(T - ONSET_S, 0.0) + 0.3 * rng.standard_normal(len(T)))
    scan, fits = explained(faulty)
    for fit in fits:
        assert fit.parts.keys() == {kind.name for kind in scan.kinds}
        assert sum(fit.parts.values()) == pytest.approx(fit.ratio, rel=1e-9)


def test_the_onset_interval_narrows_as_a_fault_grows():
    rng = np.random.default_rng(6)
    noise = 0.4 * rng.standard_normal(len(T))
    widths = []
    for rate in (0.1, 0.4, 1.6):
        _, fits = explained(with_fault(ALONE, "tas", rate * np.maximum(T - ONSET_S, 0.0) + noise))
        assert fits[0].onset_ci95[0] <= ONSET_S <= fits[0].onset_ci95[1]
        widths.append(np.ptp(fits[0].onset_ci95))
    assert widths[0] > widths[1] >= widths[2] >= 1.0


def test_more_than_all_of_a_pressure_is_not_taken():
    """A linear look at a loss of almost everything asks for more than there is."""
    amount = -np.minimum(0.04 * np.maximum(T - 1091.0, 0.0), 0.85)
    _, fits = explained(with_fault(RECORD, "q_impact", amount))
    for fit in fits:
        clean = corrected(with_fault(RECORD, "q_impact", amount), fit)
        assert np.isfinite(clean.channels["tas"]).all()


@pytest.mark.parametrize("later_s", [0.25, 0.5, 0.75])
def test_a_step_within_a_second_is_a_step_and_no_lag(later_s: float):
    """The mean of the second in which it begins shows a part of it."""
    onset_s = ONSET_S + later_s
    _, fits = explained(with_fault(ALONE, "tas", 6.0 * np.clip(T + 0.5 - onset_s, 0.0, 1.0)))
    assert (fits[0].fault.fault, fits[0].shape) == ("tas", "bias")
    assert fits[0].onset_s == pytest.approx(onset_s, abs=0.13)
    assert fits[0].onset_ci95[0] <= onset_s <= fits[0].onset_ci95[1]
    assert fits[0].magnitude == pytest.approx(6.0, rel=0.01)


def test_a_correction_that_takes_all_airspeed_away_explains_nothing():
    """In level flight an error of the climb rate hardly shows; the linear look asks for more than the airspeed."""
    level = {"altitude_rate": np.full(len(T), 1e-3), "tas": np.full(len(T), 110.0)}
    level |= {"velocity_north": 110.0 * np.cos(0.03 * T), "velocity_east": 110.0 * np.sin(0.03 * T)}
    record = Record(time_s=T, channels=level, gained=None, airspeed="tas")
    faulty = with_fault(record, "tas", 0.2 * np.maximum(T - ONSET_S, 0.0))
    scan, fits = explained(faulty)
    assert {fit.fault.fault for fit in fits} == {"tas", "ground_speed"}
    for fit in fits:
        assert abs(fit.magnitude) == pytest.approx(0.2, rel=0.1)
    climb = next(one for one in hypotheses(faulty) if one.fault == "altitude_rate")
    fit = fit_course(scan, faulty, climb, "drift", None)
    assert (fit.magnitude, fit.ratio) == (0.0, pytest.approx(0.0, abs=1e-6))


def test_intervals_are_as_wide_as_the_errors_of_twelve_trials_on_recorded_flights():
    """2.6 standard deviations to both sides in the median, by magnitude and by onset, where a normal law has 1.96."""
    onsets_s, sd = np.arange(0.0, 200.0, 0.1), 7.0
    fit = FaultByOnset(
        fault=hypotheses(ALONE)[0],
        shape="drift",
        constant_s=None,
        onsets_s=onsets_s,
        ratios=400.0 - ((onsets_s - 100.0) / sd) ** 2,
        magnitudes=np.full(onsets_s.shape, 0.1),
        sds=np.full(onsets_s.shape, 0.01),
        parts={},
    )
    assert 1.96 * fit.sd == pytest.approx(2.6 * 0.01, rel=0.03)
    for half in (100.0 - fit.onset_ci95[0], fit.onset_ci95[1] - 100.0):
        assert half == pytest.approx(2.6 * sd, rel=0.03)


def test_a_gain_beyond_mach_1_is_nan_and_no_candidate():
    beyond = with_fault(RECORD, "q_impact", np.where(T > ONSET_S, 30.0, 0.0))
    assert np.isnan(beyond.channels["tas"][T > ONSET_S]).all()
    np.testing.assert_allclose(beyond.channels["tas"][T <= ONSET_S], RECORD.channels["tas"][T <= ONSET_S])
    # A loss of almost everything: taken out as linear, it would be a multiple of what there is.
    faulty = with_fault(RECORD, "q_impact", -np.minimum(0.03 * np.maximum(T - ONSET_S, 0.0), 0.97))
    scan = scan_window(faulty, zero_lift=ZERO_LIFT)
    assert scan is not None
    (line,) = (one for one in hypotheses(faulty) if one.fault == "q_impact")
    for shape, constant in COURSES[:3]:
        assert np.isfinite(fit_course(scan, faulty, line, shape, constant).magnitude)


def test_a_course_that_leaves_the_standard_atmosphere_is_no_candidate():
    """An altitude just below 20 000 m, which a leak of the static line would put above it until its onset."""
    lag = course_for("lagged_bias", 24.0)
    assert lag is not None
    faulty = with_fault(RECORD, "static_leak", 600.0 * lag(T - ONSET_S))
    altitude = faulty.channels["altitude"]
    high = replace(faulty, channels={**faulty.channels, "altitude": altitude - altitude.max() + 19_990.0})
    scan, fits = explained(high)
    assert all(np.isfinite([fit.ratio, fit.magnitude, fit.sd]).all() for fit in fits)
    (leak,) = (one for one in hypotheses(high) if one.fault == "static_leak")
    beyond = fit_course(scan, high, leak, "lagged_bias", 24.0)
    assert (beyond.ratio, beyond.magnitude, beyond.sd) == (-np.inf, 0.0, np.inf)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("seconds", [27.0, 57.0])
def test_the_duration_of_a_ramp_is_fitted_with_its_onset(seconds: float):
    """It is none of those that are tried first; the interval of the size holds what onset and duration leave open."""
    noise = 0.2 * np.random.default_rng(5).standard_normal(len(T))
    faulty = with_fault(ALONE, "tas", 9.0 * np.clip((T - 1040.3) / seconds, 0.0, 1.0) + noise)
    _, fits = explained(faulty)
    fit = fits[0]
    assert (fit.fault.fault, fit.shape) == ("tas", "ramp_hold")
    assert fit.constant_s == pytest.approx(seconds, rel=0.1)
    assert abs(fit.magnitude - 9.0) < 1.96 * fit.sd < 2.0
    assert fit.onset_ci95[0] <= 1040.3 <= fit.onset_ci95[1]


def test_a_rarer_course_is_ten_times_as_rare():
    assert pytest.approx(2.0 * np.log(10.0), rel=1e-2) == RARER
