"""Which channel fails: exact without noise, the right one with noise, nothing where nothing fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config, merge
from bfi_cli.detection import DetectResult, detect_faults
from bfi_cli.errors import ConfigError, LogError
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array

TRAINED = merge(Config(), {"detect.train": (0.0, 8.0)})
QUICK = merge(TRAINED, {"conditioning.rate_hz": 10.0})
SPREADS = 5.0


def spread(log: FlightLog, channel: str, share: float = 0.01) -> float:
    return share * float(log.channel(channel).values.std())


@pytest.mark.parametrize("channel", ["aoa", "pitch", "pitch_rate", "tas_rate"])
def test_without_noise_the_channel_fails_at_its_very_sample(flown: Callable[..., FlightLog], channel: str):
    step = 0.1 * spread(flown(noise=0.0), channel, 1.0)
    result = detect_faults(
        flown(Fault(shape="bias", channel=channel, magnitude=step, onset_s=12.0), noise=0.0), TRAINED
    )
    first = result.alarms[0]
    assert (result.method, result.decision) == ("exact", "fault")
    assert (first.channel, first.time_s) == (channel, pytest.approx(12.0))
    assert result.ready_s < 0.1


def test_without_noise_and_without_a_failure_nothing_is_declared(flown: Callable[..., FlightLog]):
    result = detect_faults(flown(noise=0.0), merge(TRAINED, {"require": ("abrupt",)}))
    assert (result.method, result.decision, result.alarms, result.commands) == ("exact", "no_fault", (), ())


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("channel", ["aoa", "pitch_rate"])
def test_with_noise_the_right_channel_is_declared_within_a_second(flown: Callable[..., FlightLog], channel: str):
    log = flown()
    step = SPREADS * spread(log, channel)
    result = detect_faults(flown(Fault(shape="bias", channel=channel, magnitude=step, onset_s=12.0), seed=3), TRAINED)
    (alarm,) = result.alarms
    assert result.method == "parity"
    assert alarm.channel == channel
    assert 12.0 <= alarm.time_s <= 13.0
    assert alarm.statistic > alarm.threshold
    assert f"--output {channel}" in result.commands[0]


def test_with_noise_and_without_a_failure_nothing_is_declared(flown: Callable[..., FlightLog]):
    result = detect_faults(flown(seed=4), merge(TRAINED, {"require": ("abrupt",)}))
    assert (result.decision, result.alarms) == ("no_fault", ())
    assert result.calibration.held_back_s[1] <= 8.0
    assert result.ready_s == pytest.approx(8.0)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("noise", [1e-4, 3e-4, 1e-3, 3e-3])
def test_motion_that_the_healthy_time_did_not_hold_is_no_failure(flown: Callable[..., FlightLog], noise: float):
    """The phugoid after the manoeuvre moves where the healthy time's own motion drowned in its noise."""
    healthy = detect_faults(flown(seed=5, noise=noise), TRAINED)
    assert (healthy.method, healthy.alarms) == ("parity", ())
    step = 20.0 * noise * spread(flown(noise=0.0), "pitch", 1.0)
    failing = flown(Fault(shape="bias", channel="pitch", magnitude=step, onset_s=12.0), seed=5, noise=noise)
    first = detect_faults(failing, TRAINED).alarms[0]
    assert first.channel == "pitch"
    assert 12.0 <= first.time_s <= 13.0


def test_units_change_nothing_but_the_size(flown: Callable[..., FlightLog]):
    log = flown(Fault(shape="bias", channel="aoa", magnitude=0.01, onset_s=12.0), seed=1)
    aoa = log.channel("aoa")
    other = replace(log, channels={**log.channels, "aoa": replace(aoa, values=frozen_array(-57.3 * aoa.values))})
    one, two = (detect_faults(each, QUICK) for each in (log, other))
    assert [alarm.channel for alarm in one.alarms] == [alarm.channel for alarm in two.alarms]
    assert [alarm.time_s for alarm in one.alarms] == [alarm.time_s for alarm in two.alarms]
    assert two.alarms[0].statistic == pytest.approx(one.alarms[0].statistic, rel=1e-6)
    assert two.alarms[0].size == pytest.approx(-57.3 * one.alarms[0].size, rel=1e-6)


def test_accelerations_count_as_inputs_unless_others_are_asked_for(flown: Callable[..., FlightLog]):
    log = flown()
    felt = replace(log.channel("tas_rate"), name="longitudinal_acc", source="ax")
    log = replace(log, channels={**log.channels, "longitudinal_acc": felt})
    elevators = tuple(name for name in detect_faults(flown(), QUICK).inputs)
    found = detect_faults(log, QUICK)
    assert found.inputs == (*elevators, "longitudinal_acc")
    assert any(note.startswith("inputs include longitudinal_acc,") for note in texts(found.notes))
    asked = detect_faults(log, merge(QUICK, {"inputs": elevators}))
    assert asked.inputs == elevators
    assert not any("inputs include" in note for note in texts(asked.notes))
    watched = detect_faults(log, merge(QUICK, {"outputs": ("longitudinal_acc", "pitch")}))
    assert (watched.inputs, watched.outputs) == (elevators, ("longitudinal_acc", "pitch"))


@pytest.mark.slow
def test_inputs_with_noise_of_their_own_that_move_together_count_as_one(flown: Callable[..., FlightLog]):
    """Four elevators that were logged one by one predict as well as their mean does."""
    rng, log = np.random.default_rng(1), flown(Fault(shape="bias", channel="aoa", magnitude=0.01, onset_s=12.0))
    names = [name for name in log.channels if name.startswith("elevator")]
    noisy = {
        name: replace(one, values=frozen_array(one.values + 1e-4 * rng.standard_normal(log.n_samples)))
        for name, one in log.channels.items()
        if name in names
    }
    mean = replace(
        noisy[names[0]], name="elevator", values=frozen_array(np.mean([x.values for x in noisy.values()], 0))
    )
    others = {name: one for name, one in log.channels.items() if name not in names}
    four = detect_faults(replace(log, channels={**others, **noisy}), TRAINED)
    one = detect_faults(replace(log, channels={**others, "elevator": mean}), TRAINED)
    assert (four.alarms[0].channel, four.alarms[0].time_s) == (one.alarms[0].channel, one.alarms[0].time_s)
    assert four.alarms[0].statistic == pytest.approx(one.alarms[0].statistic, rel=0.1)


def test_samples_that_a_recorder_filtered_past_the_end_of_the_log_are_not_watched(flown: Callable[..., FlightLog]):
    """What the recorder made of samples it never had looks like a failure of the last half second."""
    recorder = Filter(kind="gaussian", edge_hz=0.75, rate_hz=100.0)
    log = flown(Fault(shape="bias", channel="aoa", magnitude=10.0 * spread(flown(), "aoa"), onset_s=19.5), seed=4)
    assert detect_faults(log, QUICK).decision == "fault"
    result = detect_faults(replace(log, filters=(recorder,)), TRAINED)
    assert (result.decision, result.alarms) == ("inconclusive", ())
    assert any("after the end of the log" in note for note in texts(result.notes))
    inside = detect_faults(replace(log, filters=(recorder,)), merge(TRAINED, {"window.to_s": 18.5}))
    assert not any("after the end of the log" in note for note in texts(inside.notes))


def test_a_healthy_time_too_short_for_the_rate_that_the_recorder_leaves_gives_no_limits(
    flown: Callable[..., FlightLog],
):
    """Eight seconds hold no hundred samples at 2 Hz."""
    log = replace(flown(), filters=(Filter(kind="gaussian", edge_hz=0.75, rate_hz=100.0),))
    fast = detect_faults(log, TRAINED)
    assert (fast.decision, {one.state for one in fast.candidates}) == ("inconclusive", {"not_seen"})
    assert {one.excluded_above for one in fast.candidates} == {None}
    assert any(note.endswith(": a longer healthy time (--train A:B)") for note in texts(fast.notes))


def test_what_is_healthy_is_asked_for(flown: Callable[..., FlightLog]):
    result = detect_faults(flown(), Config())
    assert any("is taken as healthy" in note for note in texts(result.notes))
    assert result.train == (0.0, pytest.approx(20.0 / 3.0, abs=0.01))


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"detect.false_alarm": 2.0}, ConfigError, "detect.false_alarm"),
        ({"detect.train": (8.0, 2.0)}, ConfigError, "must end after it starts"),
        ({"detect.train": (30.0, 40.0)}, (ConfigError, LogError), "30"),
        ({"detect.train": (0.0, 0.2), "detect.method": "parity"}, LogError, "give a longer --train"),
        ({"outputs": ("cas",)}, LogError, "no channel 'cas'"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(flown: Callable[..., FlightLog], settings, error, message: str):
    with pytest.raises(error) as refusal:
        detect_faults(flown(), merge(Config(), settings))
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.fixture(scope="module")
def healthy(flown: Callable[..., FlightLog]) -> DetectResult:
    return detect_faults(flown(seed=4), TRAINED)


def test_statistics_are_finite_where_the_channels_are_watched(healthy: DetectResult):
    after = healthy.time_s > 8.1
    assert all(np.isfinite(one.statistic[after]).all() for one in healthy.series)


def test_healthy_channels_are_excluded_each_and_what_is_not_looked_for_is_said(healthy: DetectResult):
    assert [one.channel for one in healthy.candidates] == list(healthy.outputs)
    assert {one.state for one in healthy.candidates} == {"excluded"}
    assert healthy.verdicts == {"abrupt": "no_fault", "oscillating": "inconclusive", "slow": "inconclusive"}
    assert healthy.summary.startswith("no step above ")
    assert healthy.summary.endswith("an oscillation was not looked for; a slow fault was not looked for")
    for one in healthy.candidates:
        assert 0.0 < one.minimal_detectable <= one.excluded_above
        assert abs(one.magnitude) + 2.3 * one.sd <= one.excluded_above
        assert one.effect == one.excluded_above <= one.tolerance


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("noise", "config"),
    [(0.01, merge(QUICK, {"outputs": ("aoa", "pitch")})), (0.0, TRAINED), (0.01, TRAINED)],
    ids=["quick", "exact", "parity"],
)
def test_twice_what_is_excluded_is_declared(flown: Callable[..., FlightLog], noise: float, config: Config):
    """Of every channel, at onsets drawn from those that the claim covers, in the same record."""
    rng, healthy = np.random.default_rng(6), flown(seed=6, noise=noise)
    for one in detect_faults(healthy, config).candidates:
        onset_s = round(float(rng.uniform(9.0, 18.0)), 2)
        size = float(rng.choice([-2.0, 2.0])) * one.excluded_above
        fault = Fault(shape="bias", channel=one.channel, magnitude=size, onset_s=onset_s)
        states = {each.channel: each.state for each in detect_faults(inject(healthy, [fault]), config).candidates}
        assert states[one.channel] == "declared", (one.channel, onset_s)


def test_a_declared_step_has_its_size_and_leaves_the_others_excluded(flown: Callable[..., FlightLog]):
    log = flown(Fault(shape="bias", channel="aoa", magnitude=0.005, onset_s=12.0), seed=4)
    states = {one.channel: one for one in detect_faults(log, TRAINED).candidates}
    assert states["aoa"].magnitude == pytest.approx(0.005, rel=0.2)
    assert states["aoa"].excluded_above is None
    assert {one.state for name, one in states.items() if name != "aoa"} == {"excluded"}


def test_nothing_is_excluded_where_no_step_has_time_to_show(flown: Callable[..., FlightLog]):
    result = detect_faults(flown(seed=4), merge(TRAINED, {"window.to_s": 8.7}))
    assert {one.state for one in result.candidates} == {"not_seen"}
    assert (result.decision, result.is_trusted) == ("inconclusive", False)
    assert any("a longer time to watch" in note for note in texts(result.notes))
