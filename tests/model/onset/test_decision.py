"""Where the threshold comes from by default: a table that fits, the log's own flight, the nearest table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noted import texts
from scipy.signal import lfilter

from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.flightlog import Channel, FlightLog, inject
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import find_onset
from bfi_cli.model.onset.decision import FEWEST_WINDOWS, MOST_WINDOWS, calibration_windows, own_windows, rule_for
from bfi_cli.model.onset.scan_record import prepare_record

LENGTH_S, FROM_S = 20.0, 200.0
GROUND_S, FLIGHT_S = 60.0, 400.0
CONFIG = merge(
    Config(),
    {
        "start_time.shapes": ("bias",),
        "model.order": 4,
        "conditioning.rate_hz": 5.0,
        "window": {"from_s": FROM_S, "to_s": FROM_S + LENGTH_S},
    },
)


@pytest.fixture(scope="module")
def log() -> FlightLog:
    """Return a minute at rest, a flight of 400 s in gusts with a moving elevator, a minute at rest, at 10 Hz."""
    rate_hz, rng = 10.0, np.random.default_rng(3)
    n = round((FLIGHT_S + 2.0 * GROUND_S) * rate_hz)
    time_s = np.arange(n) / rate_hz
    flies = (time_s >= GROUND_S) & (time_s < GROUND_S + FLIGHT_S)
    elevator = 0.05 * np.sign(np.sin(0.9 * time_s) + np.sin(0.37 * time_s))
    tas = lfilter([1.0], [1.0, -1.9, 0.91], 5.0 * elevator + 0.02 * rng.standard_normal(n))
    values = {"tas": flies * (100.0 + tas) + 0.02 * rng.standard_normal(n), "elevator": elevator}
    units = {"tas": "m/s", "elevator": "rad"}
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=units[name], source=name)
        for name, one in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels, filters=())


def without_a_past(log: FlightLog) -> FlightLog:
    return log.window(FROM_S - 30.0, FROM_S + LENGTH_S + 30.0)


def test_own_windows_fly_apart_from_the_analysed_one(log: FlightLog):
    (windows,) = own_windows(log, CONFIG, [LENGTH_S])
    assert len(windows) >= FEWEST_WINDOWS
    for from_s, to_s in windows:
        assert to_s - from_s == pytest.approx(LENGTH_S)
        assert GROUND_S < from_s < to_s < GROUND_S + FLIGHT_S
        assert to_s <= FROM_S + 1e-9 or from_s >= FROM_S + LENGTH_S - 1e-9
    starts = np.diff([from_s for from_s, _ in windows])
    assert np.all(starts >= 0.5 * LENGTH_S - 1e-6)


def test_where_the_past_is_long_enough_nothing_later_is_used(log: FlightLog):
    late = merge(CONFIG, {"window": {"from_s": 400.0, "to_s": 410.0}})
    (windows,) = own_windows(log, late, [10.0])
    assert len(windows) >= FEWEST_WINDOWS
    assert max(to_s for _, to_s in windows) <= 400.0 + 1e-9


def test_many_windows_are_spread(log: FlightLog):
    late = merge(CONFIG, {"window": {"from_s": 400.0, "to_s": 405.0}})
    (windows,) = own_windows(log, late, [5.0])
    assert len(windows) == MOST_WINDOWS
    assert windows[0][0] < 100.0 < 380.0 < windows[-1][1]


def test_the_default_calibrates_on_the_log_where_no_table_fits(log: FlightLog):
    stages: list[str] = []
    faulty = inject(log, [Fault(shape="bias", channel="tas", magnitude=3.0, onset_s=210.0)])
    result = find_onset(faulty, CONFIG, lambda stage, _done: stages.append(stage))
    use = result.calibration
    assert (use.source, use.matches) == ("self", True)
    assert use.n_windows >= FEWEST_WINDOWS
    assert use.length_s == pytest.approx(LENGTH_S, rel=0.1)
    assert result.decision == "fault"
    assert result.faults[0].fault.onset_s == pytest.approx(210.0, abs=0.5)
    assert result.p_value >= 1.0 / (use.n_windows + 1)
    note = next(note for note in texts(result.notes) if note.startswith("calibrated on"))
    assert f"{use.n_windows} overlapping windows of 20 s of the log itself, on both sides" in note
    assert any("windows of the log" in stage for stage in stages)


@pytest.mark.slow
def test_the_threshold_decides_at_any_rate_of_false_alarms(log: FlightLog):
    """Of a few dozen windows none can be as rare as one in a million: the tail is followed, and a note says so."""
    config = merge(CONFIG, {"start_time.false_alarm": 1e-6})
    faulty = inject(log, [Fault(shape="bias", channel="tas", magnitude=50.0, onset_s=210.0, offset_s=222.0)])
    result = find_onset(faulty, config)
    n_windows = result.calibration.n_windows
    assert result.statistic > result.threshold
    assert result.decision == "fault"
    assert result.faults[0].p_value == result.p_value == 1.0 / (n_windows + 1)
    least = f"{100.0 / (n_windows + 1):.3g} %"
    assert f"{n_windows} windows cannot show a false-alarm rate below {least}; the threshold for 0.0001 % is " in str(
        texts(result.notes)
    )
    assert f"the p-value is at most {result.p_value:.2g}, " in str(texts(result.notes))


@pytest.mark.slow
def test_auto_is_the_default(log: FlightLog):
    record = prepare_record(log, CONFIG)
    named = merge(CONFIG, {"start_time.calibration": "auto"})
    one, other = (rule_for(log, record, config, order=4) for config in (CONFIG, named))
    assert (one.source, one.matches, one.table.n_windows, texts(one.notes)) == (
        (other.source, other.matches, other.table.n_windows, texts(other.notes))
    )
    assert one.threshold("bias") == other.threshold("bias")


@pytest.mark.slow
def test_a_flight_too_short_for_its_windows_lends_shorter_ones(log: FlightLog):
    longer = merge(CONFIG, {"window": {"from_s": FROM_S, "to_s": FROM_S + 60.0}})
    rule = rule_for(log, prepare_record(log, longer), longer, order=4)
    assert (rule.source, rule.matches) == ("self", False)
    assert rule.table.settings.duration_s < 45.0
    assert rule.threshold("bias") > 1.1 * rule.suspicion("bias")
    assert "this log has" in texts(rule.notes)[1]
    assert "window length" in texts(rule.notes)[1]
    assert find_onset(log, longer).p_value is None


def test_without_a_flight_the_nearest_table_has_a_wider_tail(log: FlightLog):
    short = without_a_past(log)
    rule = rule_for(short, prepare_record(short, CONFIG), CONFIG, order=4)
    assert (rule.source, rule.matches) == ("shipped", False)
    assert rule.null.tail == rule.counted.tail.widened
    assert rule.threshold("bias") > 1.1 * rule.suspicion("bias")
    assert "20 further windows of 20 s in flight are needed, this log has 4" in texts(rule.notes)[1]
    assert "with a wider tail" in texts(rule.notes)[1]


def test_the_ground_is_no_calibration(log: FlightLog):
    """At rest the statistic is another: two minutes of it among the windows would move the threshold."""
    ground = log.window(0.0, GROUND_S)
    still = Channel(name="tas", values=frozen_array(np.zeros(ground.n_samples)), unit="m/s", source="tas")
    assert list(own_windows(replace(ground, channels={**ground.channels, "tas": still}), Config(), [5.0])) == [[]]


def test_a_calibration_counts_what_flies_of_whole_flights(log: FlightLog):
    """Rest before take-off and after landing raised the threshold of a recorded flight five times."""
    whole = Config()
    starts = [from_s for _, (from_s, _) in calibration_windows([log, log], whole)]
    assert len(starts) == 2 * len({*starts})
    assert min(starts) >= GROUND_S
    assert max(starts) + 120.0 <= GROUND_S + FLIGHT_S
    part = merge(whole, {"window": {"from_s": 300.0, "to_s": 500.0}})
    (first, *_, last) = calibration_windows([log], merge(part, {"calibrate.length_s": LENGTH_S}))
    assert first[1] == (300.0, 300.0 + LENGTH_S)
    assert 400.0 < last[1][1] <= GROUND_S + FLIGHT_S


def test_where_no_airspeed_tells_when_it_flies_a_calibration_counts_everything(log: FlightLog):
    whole = merge(Config(), {"calibrate.length_s": LENGTH_S})
    without = replace(log, channels={"elevator": log.channels["elevator"]})
    assert calibration_windows([without], whole)[0][1] == (0.0, LENGTH_S)
