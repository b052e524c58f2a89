"""The form without noise: few channels, values that are no deviations, and failures that spread (paper H, eq. 30)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from noted import texts

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.detection import detect_faults
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array

TRAINED = merge(Config(), {"detect.train": (0.0, 8.0)})


def with_gain(log: FlightLog, *channels: str, gain: float = 0.9, from_s: float = 12.0) -> FlightLog:
    changed = {
        name: replace(
            log.channel(name), values=frozen_array(np.where(log.time_s < from_s, 1.0, gain) * log.channel(name).values)
        )
        for name in channels
    }
    return replace(log, channels={**log.channels, **changed})


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("outputs", [("aoa",), ("altitude",), ("aoa", "pitch"), ("altitude", "tas_rate")])
def test_outputs_that_do_not_hold_all_states_need_more_lags_and_raise_no_alarm(
    flown: Callable[..., FlightLog], outputs: tuple[str, ...]
):
    """Outputs y(i) = Omega z(i) with enough lags in z, whatever the number of outputs."""
    result = detect_faults(flown(noise=0.0), merge(TRAINED, {"outputs": outputs}))
    assert (result.method, result.alarms) == ("exact", ())


@pytest.mark.first_rows(3)
@pytest.mark.parametrize("name", ["citation", "b747"])
@pytest.mark.parametrize("channels", [("pitch_rate",), ("aoa",), ("aoa", "pitch_rate")])
def test_only_what_fails_is_declared_though_healthy_channels_leave_round_off(name: str, channels: tuple[str, ...]):
    time_s = time_axis(duration_s=20.0)
    log = simulate(find_model(name), manoeuvre("3211", time_s), rng=np.random.default_rng(0))
    result = detect_faults(with_gain(log, *channels), TRAINED)
    assert {(one.channel, one.time_s) for one in result.alarms} == {(channel, 12.0) for channel in channels}
    assert result.method == "exact"


def test_the_level_flown_at_does_not_matter(flown: Callable[..., FlightLog]):
    """A constant is part of the past: absolute altitudes do as well as deviations."""
    log = flown(noise=0.0)
    high = replace(
        log,
        channels={
            **log.channels,
            "altitude": replace(log.channel("altitude"), values=frozen_array(log.channel("altitude").values + 3000.0)),
        },
    )
    assert detect_faults(high, TRAINED).alarms == ()
    found = detect_faults(with_gain(high, "aoa"), TRAINED).alarms
    assert [(one.channel, one.time_s) for one in found] == [("aoa", 12.0)]


@pytest.mark.slow
def test_noise_is_told_where_the_exact_form_is_asked_for(flown: Callable[..., FlightLog]):
    result = detect_faults(flown(), merge(TRAINED, {"detect.method": "exact"}))
    assert "the healthy time is not explained to round-off" in texts(result.notes)[0]
    result = detect_faults(flown(), merge(TRAINED, {"detect.method": "exact"}))
    assert {one.state for one in result.candidates} <= {"declared", "not_seen"}


@pytest.mark.slow
def test_a_step_beyond_the_limit_is_declared_at_its_very_sample(flown: Callable[..., FlightLog]):
    """Hardly more than the limit does at any sample that the claim covers."""
    log = flown(noise=0.0)
    for one in detect_faults(log, TRAINED).candidates:
        assert one.state == "excluded"
        fault = Fault(shape="bias", channel=one.channel, magnitude=1.01 * one.excluded_above, onset_s=12.0)
        assert ("declared", 12.0) in [
            (each.state, alarm.time_s)
            for result in [detect_faults(inject(log, [fault]), TRAINED)]
            for each, alarm in zip(
                [c for c in result.candidates if c.channel == one.channel], result.alarms, strict=False
            )
        ]
