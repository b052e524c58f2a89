"""The scan of a window: what it finds without noise, and what it makes of what a log lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flight import ZERO_LIFT, channels_at, log_of, made_log, made_record, ratio_of

from bfi_cli.airdata import KINEMATICS, G
from bfi_cli.flight.parity import record_of, scan_window
from bfi_cli.flight.parity.record import HYPOTHESES, Record, Rounding, hypotheses, with_fault
from bfi_cli.flight.parity.residuals import RESIDUALS, constants_of
from bfi_cli.flight.parity.scan import residual_values

RECORD = made_record()
T = RECORD.time_s
NAMES = [kind.name for kind in RESIDUALS]
PRESSURES = ("cas", "ias", "mach", "q_impact", "p_total", "sat")
# Small against what it errs in, so that the linear scan is exact to a part in a hundred.
SMALL = {"1": 1e-5, "m/s": 5e-3, "Pa": 0.5, "rad": 5e-6, "m/s^2": 5e-4}


def changed(record: Record, **channels: np.ndarray) -> Record:
    return replace(record, channels={**record.channels, **channels})


def test_a_flight_without_noise_and_fault_shows_nothing():
    scan = scan_window(RECORD, zero_lift=ZERO_LIFT)
    assert scan is not None
    assert [kind.name for kind in scan.kinds] == NAMES
    assert scan.lacking == {}
    assert scan.statistic < 1e-3


@pytest.mark.first_rows(13)
@pytest.mark.parametrize("hypothesis", HYPOTHESES, ids=lambda one: one.fault)
@pytest.mark.parametrize("zero_lift", [ZERO_LIFT, None])
def test_a_small_fault_has_its_magnitude_and_its_onset(hypothesis, zero_lift):
    """In whatever residuals it shows, and together."""
    record = (
        made_record()
        if hypothesis.fault in ("cas", "ias", "mach", "q_impact", "p_total")
        else made_record(without=PRESSURES)
    )
    if hypothesis.fault in ("cas", "ias", "mach", "p_total"):
        others = [name for name in (*PRESSURES, "tas") if name != hypothesis.fault]
        record = replace(made_record(without=others), airspeed=hypothesis.fault)
        record = changed(record, tas=RECORD.channels["tas"])
    clean = scan_window(record, zero_lift=zero_lift)
    assert clean is not None
    onset_s = float(clean.onsets_s[12])
    rate = SMALL[hypothesis.unit]
    faulty = with_fault(record, hypothesis.fault, rate * np.maximum(T - onset_s, 0.0))
    alone = [name for name in NAMES if _shows(record, hypothesis.fault, name, zero_lift)]
    if hypothesis.fault in KINEMATICS:
        alone.remove("kinematics")  # their integral at the log's rate is another test's
    assert alone or hypothesis.fault == "longitudinal_acc"
    for only in ([name] for name in alone):
        scan = scan_window(faulty, zero_lift=zero_lift, only=only)
        assert scan is not None
        answer = ratio_of(scan, hypothesis.fault)
        # What a free angle of zero lift leaves over, of second order, is there without the fault as well; and 0.3
        # degrees of it, off as it is, are 6 % of the angle that lifts.
        before = scan_window(record, zero_lift=zero_lift, only=only)
        assert before is not None
        left = ratio_of(before, hypothesis.fault).magnitude[12]
        assert answer.magnitude[12] - left == pytest.approx(rate, rel=0.05 if zero_lift else 0.06), only


def _shows(record: Record, fault: str, name: str, zero_lift: float | None) -> bool:
    scan = scan_window(record, zero_lift=zero_lift, only=[name])
    return scan is not None and fault in scan.faults


def test_kinematics_sees_the_fault_of_an_attitude_in_its_integral():
    """At the log's rate, through the record: a drift of the pitch is an acceleration that grows."""
    log = made_log(121.0)
    values = {name: one.values for name, one in log.channels.items()}
    rate = np.radians(0.02)
    values["pitch"] = values["pitch"] + rate * np.maximum(log.time_s - 46.0, 0.0)
    scan = scan_window(
        record_of(log_of(log.time_s, values)).between(0.0, 120.0), zero_lift=ZERO_LIFT, only=["kinematics"]
    )
    assert scan is not None
    answer = ratio_of(scan, "pitch")
    k = int(np.argmax(answer.ratio))
    assert abs(scan.onsets_s[k] - 46.0) <= 3.0
    assert answer.magnitude[k] == pytest.approx(rate, rel=0.05)


@pytest.mark.parametrize("kind", RESIDUALS, ids=lambda kind: kind.name)
def test_a_constant_error_of_a_residual_changes_nothing(kind):
    """A wrong wind, a bias of what is divided by the speed, an airspeed integrated from another start."""
    rng = np.random.default_rng(1)
    noisy = changed(RECORD, tas=RECORD.channels["tas"] + 0.3 * rng.standard_normal(len(T)))
    plain = scan_window(noisy, zero_lift=ZERO_LIFT, only=[kind.name])
    other = replace(noisy, gained=noisy.gained + 1234.5)
    if kind.name == "lift":
        # Lift in other units of force.
        other = changed(other, q_impact=1.1 * other.channels["q_impact"])
    moved = scan_window(other, zero_lift=ZERO_LIFT, only=[kind.name])
    for fault in ("aoa", "tas"):
        if fault in plain.faults:
            np.testing.assert_allclose(ratio_of(moved, fault).ratio, ratio_of(plain, fault).ratio, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("start_s", [1234.25, -500.0, 1.7e9])
def test_the_time_axis_may_begin_anywhere(start_s):
    rng = np.random.default_rng(2)
    noise = 0.3 * rng.standard_normal(len(T))
    scans = [
        scan_window(
            changed(made_record(start_s=one), tas=RECORD.channels["tas"] + noise),
            zero_lift=ZERO_LIFT,
            only=["kinematics"],
        )
        for one in (0.5,)
    ]
    moved = replace(changed(RECORD, tas=RECORD.channels["tas"] + noise), time_s=T + start_s - 0.5)
    scans.append(scan_window(moved, zero_lift=ZERO_LIFT, only=["kinematics"]))
    np.testing.assert_allclose(scans[1].onsets_s - start_s, scans[0].onsets_s - 0.5, atol=1e-6)
    assert scans[1].statistic == pytest.approx(scans[0].statistic, rel=1e-5)


LACKS = {
    "aoa": {"lift", "climb", "kinematics"},
    "normal_acc": {"lift", "kinematics"},
    "longitudinal_acc": {"kinematics"},
    "pitch": {"climb", "kinematics"},
    "roll": {"climb", "kinematics"},
    "altitude_rate": {"climb", "ground_speed"},
    "velocity_north": {"ground_speed"},
    "velocity_east": {"ground_speed"},
}


@pytest.mark.parametrize("missing", [*sorted(RECORD.channels)])
def test_each_channel_may_be_missing(missing):
    scan = scan_window(made_record(without=(missing,)), zero_lift=ZERO_LIFT)
    if missing == "tas":
        assert scan is None
        return
    assert scan is not None
    assert scan.lacking.keys() == LACKS.get(missing, set())
    assert all(missing in text for text in scan.lacking.values())
    assert {kind.name for kind in scan.kinds} == set(NAMES) - scan.lacking.keys()
    assert missing not in scan.faults or missing == "q_impact"  # the name of the line, too
    assert ("ground_speed" in scan.faults) == (not missing.startswith("velocity") and missing != "altitude_rate")
    assert scan.statistic >= 0.0


@pytest.mark.parametrize("missing", sorted(LACKS))
def test_each_channel_may_be_known_nowhere(missing):
    record = changed(RECORD, **{missing: np.full(len(T), np.nan)})
    if missing in KINEMATICS:
        record = replace(record, gained=np.full(len(T), np.nan))
    scan = scan_window(record, zero_lift=ZERO_LIFT)
    assert scan is not None
    assert LACKS[missing] == scan.lacking.keys()
    for text in scan.lacking.values():
        assert text == f"{missing} without gaps"


@pytest.mark.parametrize("airspeed", ["cas", "mach", "q_impact", "p_total", "ias"])
def test_one_airspeed_of_any_kind_is_enough(airspeed):
    log = made_log(121.0)
    left = {"tas", "cas", "ias", "mach", "q_impact", "p_total"} - {airspeed}
    record = record_of(replace(log, channels={n: c for n, c in log.channels.items() if n not in left}))
    assert record.airspeed == airspeed
    scan = scan_window(record, zero_lift=ZERO_LIFT)
    assert scan is not None
    assert [kind.name for kind in scan.kinds] == NAMES
    assert airspeed in scan.faults
    assert "tas" not in scan.faults


def test_gaps_are_left_out_and_the_rest_says_the_same():
    """Without noise the magnitude is exact over gaps of the ground velocity and of the angle of attack."""
    clean = scan_window(RECORD, zero_lift=ZERO_LIFT)
    onset_s = float(clean.onsets_s[10])
    faulty = with_fault(RECORD, "tas", 5e-3 * np.maximum(T - onset_s, 0.0))
    north, aoa = faulty.channels["velocity_north"].copy(), faulty.channels["aoa"].copy()
    north[60:80] = np.nan
    aoa[[3, 17, 64, 65]] = np.nan
    scan = scan_window(changed(faulty, velocity_north=north, aoa=aoa), zero_lift=ZERO_LIFT)
    assert [kind.name for kind in scan.kinds] == NAMES
    assert scan.known[3].sum() == len(T) - 20
    assert ratio_of(scan, "tas").magnitude[10] == pytest.approx(5e-3, rel=0.02)


def test_too_many_gaps_leave_a_residual_out_and_say_so():
    north = RECORD.channels["velocity_north"].copy()
    north[20:70] = np.nan
    scan = scan_window(changed(RECORD, velocity_north=north), zero_lift=ZERO_LIFT)
    assert scan.lacking == {"ground_speed": "velocity_north without gaps"}


def test_nothing_known_at_all_is_no_scan():
    nothing = {name: np.full(len(T), np.nan) for name in RECORD.channels}
    assert scan_window(replace(RECORD, channels=nothing), zero_lift=ZERO_LIFT) is None
    assert scan_window(RECORD.between(5000.0, 5100.0), zero_lift=ZERO_LIFT) is None


@pytest.mark.parametrize("seconds", [1, 2, 5, 29, 31, 40])
def test_a_window_may_be_too_short_for_an_onset(seconds):
    scan = scan_window(RECORD.between(0.0, float(seconds)), zero_lift=ZERO_LIFT)
    assert (scan is None) == (seconds < 30)


@pytest.mark.parametrize(("name", "moved", "still"), [("flaps", 0.1, 0.01), ("gear", 1.0, 0.1)])
def test_flaps_and_gear_that_move_leave_lift_out(name, moved, still):
    log = made_log(121.0)
    values = {one: channel.values for one, channel in log.channels.items()}
    for size, lacking in ((moved, {"lift"}), (still, set())):
        made = record_of(log_of(log.time_s, values | {name: np.where(log.time_s > 60.0, size, 0.0)}))
        scan = scan_window(made, zero_lift=ZERO_LIFT)
        assert scan is not None
        assert scan.lacking.keys() == lacking
        assert all(name in text for text in scan.lacking.values())


def test_a_log_of_a_sample_in_two_seconds_is_scanned():
    log = made_log(240.0, rate_hz=0.5)
    values = {name: one.values for name, one in log.channels.items()}
    values["tas"] = values["tas"] + 0.2 * np.maximum(log.time_s - 100.0, 0.0)
    record = record_of(log_of(log.time_s, {n: v for n, v in values.items() if n not in PRESSURES}))
    scan = scan_window(record, zero_lift=ZERO_LIFT)
    assert scan is not None
    assert [kind.name for kind in scan.kinds] == NAMES
    k = int(np.argmax(ratio_of(scan, "tas").ratio))
    assert abs(scan.onsets_s[k] - 100.0) <= 3.0
    assert ratio_of(scan, "tas").magnitude[k] == pytest.approx(0.2, rel=0.1)


def test_half_of_a_window_recorded_is_not_enough():
    channels = {name: np.where(np.arange(len(T)) < 60, values, np.nan) for name, values in RECORD.channels.items()}
    assert scan_window(replace(RECORD, channels=channels), zero_lift=ZERO_LIFT) is None


def test_residuals_may_be_chosen():
    scan = scan_window(RECORD, zero_lift=ZERO_LIFT, only=["climb", "lift"])
    assert {kind.name for kind in scan.kinds} == {"climb", "lift"}
    assert scan_window(RECORD, zero_lift=ZERO_LIFT, only=[]) is None


def test_the_record_is_left_as_it_is():
    copies = {name: values.copy() for name, values in RECORD.channels.items()}
    scan_window(RECORD, zero_lift=ZERO_LIFT)
    for name, values in copies.items():
        np.testing.assert_array_equal(RECORD.channels[name], values)


@pytest.mark.parametrize("hypothesis", HYPOTHESES, ids=lambda one: one.fault)
def test_a_fault_that_began_before_the_window_changes_nothing_in_it(hypothesis):
    """Neither its constant nor its drift, where the window is told of it; else it stands out."""
    record = made_record(without=[] if hypothesis.fault in PRESSURES else PRESSURES)
    if hypothesis.fault not in {one.fault for one in hypotheses(record)}:
        record = replace(made_record(without=[one for one in PRESSURES if one != hypothesis.fault]))
    course = SMALL[hypothesis.unit] * (30.0 + (T - T[0]))
    faulty = with_fault(record, hypothesis.fault, course)
    lasting = (hypothesis.fault,)
    clean, told = (scan_window(one, zero_lift=ZERO_LIFT, lasting=lasting) for one in (record, faulty))
    untold = scan_window(faulty, zero_lift=ZERO_LIFT)
    assert clean is not None
    assert told is not None
    assert untold is not None
    assert told.statistic < 0.05 * untold.statistic + 1e-3


def test_of_a_large_fault_that_began_before_the_window_its_square_is_known_as_well():
    """A vane off by 2.4 degrees leaves a hundred-thousandth of what it shows, without its square a hundredth."""
    record = made_record(without=PRESSURES)
    faulty = with_fault(record, "aoa", np.full(len(T), 0.042))
    told, untold = (scan_window(faulty, zero_lift=ZERO_LIFT, lasting=one) for one in (("aoa",), ()))
    assert told is not None
    assert untold is not None
    assert untold.statistic > 30.0
    assert told.statistic < 1e-5 * untold.statistic


def test_a_correction_of_the_accelerometer_is_integrated_exactly_where_it_is_a_straight_line():
    (kind,) = (one for one in RESIDUALS if one.rate is not None)
    still = changed(RECORD, **{name: np.zeros(len(T)) for name in ("aoa", "pitch", "roll", "normal_acc")})
    constants = constants_of(still, zero_lift=ZERO_LIFT)
    since = T - T[0]
    clean = changed(still, longitudinal_acc=still.channels["longitudinal_acc"] - (0.02 + 0.003 * since))
    change = residual_values(clean, still, constants, kind) - residual_values(still, still, constants, kind)
    np.testing.assert_allclose(change - change[0], 0.02 * since + 0.0015 * since**2, atol=1e-9)


def test_the_fault_of_another_sensor_is_still_seen():
    """A vane that was wrong before does not hide what the ground speed says of the airspeed."""
    faulty = changed(RECORD, aoa=RECORD.channels["aoa"] + 0.02)
    faulty = with_fault(faulty, "ground_speed", 0.5 * np.maximum(T - T[40], 0.0))
    scan = scan_window(faulty, zero_lift=ZERO_LIFT, lasting=("aoa",))
    assert scan is not None
    best, _ = scan.strongest
    assert best == "ground_speed"
    assert scan.statistic > 100.0


def test_what_steps_leave_of_a_channel_at_rest_stays_and_of_one_that_moves_is_noise():
    moved = np.array([0.0, 0.0, 0.0, 0.1, 0.1, 3.0, 6.0])
    factor = Rounding(sd=np.full(7, 0.3), moved=moved).factor()
    np.testing.assert_allclose(factor @ factor.T, 0.09 * np.exp(-6.0 * np.abs(moved[:, None] - moved)), atol=1e-12)
    # Over all phases the errors of a signal that moved by a part of a step have this correlation, at its begin.
    phases = np.linspace(0.0, 1.0, 20_000, endpoint=False)
    for part in (0.005, 0.01, 0.02):
        errors = [np.mod(phase, 1.0) - 0.5 for phase in (phases, phases + part)]
        assert 12.0 * np.mean(errors[0] * errors[1]) == pytest.approx(np.exp(-6.0 * part), abs=3.0 * part**2 * 6.0)


def coarse_vane(seed: int, drift: float = 0.0) -> Record:
    """Return a flight in which a vane in steps of 0.35 degrees rests, moves, and drifts by so many rad/s from 70 s."""
    rng, time_s, step = np.random.default_rng(seed), np.arange(120.0), np.radians(0.35)
    calm = {name: np.full(120, values[0]) for name, values in channels_at(time_s[:2]).items()}
    angle = step * (8.0 + rng.uniform(-0.1, 0.1) - 4.0 * np.clip((time_s - 80.0) / 40.0, 0.0, 1.0))
    load = (calm["normal_acc"] + G) * (angle - ZERO_LIFT) / (angle[0] - ZERO_LIFT) - G
    calm["normal_acc"] = load + 0.01 * rng.standard_normal(120)
    shown = angle + drift * np.maximum(time_s - 70.0, 0.0) + 0.15 * step * rng.standard_normal(120)
    return record_of(log_of(time_s, {**calm, "aoa": np.round(shown / step) * step}))


def test_the_steps_of_a_channel_are_no_fault_that_grows():
    """Within a step a vane that rests shows no noise, and where it moves on another error than it had."""
    known, unknown, faulty = [], [], []
    for seed in range(4):
        record = coarse_vane(seed)
        assert record.rounding.keys() == {"aoa"}
        for statistics, each in (
            (known, record),
            (unknown, replace(record, rounding={})),
            (faulty, coarse_vane(seed, drift=0.001)),
        ):
            scan = scan_window(each, zero_lift=ZERO_LIFT, only=("lift",))
            assert scan is not None
            statistics.append(scan.statistic)
    assert sum(known) < 0.3 * sum(unknown)
    assert min(faulty) > 10.0 * max(known)
