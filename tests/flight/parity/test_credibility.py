"""What does not follow the flight at all is named, and what fails during it or is hidden by gusts is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flight import made_log

from bfi_cli.airdata import EARTH_RADIUS, G, climb_angle, vane_angle
from bfi_cli.flight.parity import Record
from bfi_cli.flight.parity.credibility import agreements, coarse_positions, credibility_of
from bfi_cli.flightlog.phases import Phase

N = 900
T = np.arange(float(N)) + 0.5
FLIGHT = [Phase(phase="cruise", from_s=0.0, to_s=float(N))]
RNG = np.random.default_rng(3)


def wave(amplitude: float, periods: tuple[float, ...]) -> np.ndarray:
    return amplitude * sum(np.sin(2.0 * np.pi * T / period + k) for k, period in enumerate(periods)) / len(periods)


def drone() -> Record:
    """Return a drone of 16 m/s that climbs, speeds up and circles: every channel from one motion."""
    speed = 16.0 + wave(3.0, (37.0, 91.0))
    slope, bank = wave(0.15, (29.0, 53.0)), wave(0.9, (83.0, 127.0))
    lift = (speed * np.gradient(slope, T) + G * np.cos(slope)) / np.cos(bank)
    p_static = 95_000.0 + 0.0 * T
    q_impact = 0.6 * speed**2
    aoa = np.radians(-3.0) + 0.9 * lift / q_impact
    pitch = np.arcsin(np.cos(aoa) * np.sin(slope) + np.sin(aoa) * np.cos(slope) * np.cos(bank))
    along = np.gradient(speed, T) + G * np.sin(slope)
    heading = np.cumsum(G * np.tan(bank) / speed)
    channels = {
        "tas": speed,
        "p_static": p_static,
        "q_impact": q_impact,
        "altitude_rate": speed * np.sin(slope),
        "aoa": aoa,
        "pitch": pitch,
        "roll": np.arcsin(np.cos(slope) * np.sin(bank) / np.cos(pitch)),
        "normal_acc": lift * np.cos(aoa) - along * np.sin(aoa) - G,
        "longitudinal_acc": along * np.cos(aoa) + lift * np.sin(aoa),
        "velocity_north": speed * np.cos(slope) * np.cos(heading) + 4.0,
        "velocity_east": speed * np.cos(slope) * np.sin(heading) - 2.0,
    }
    return Record(time_s=T, channels=channels, gained=None, airspeed="tas")


def with_channel(record: Record, **channels: np.ndarray) -> Record:
    return replace(record, channels={**record.channels, **channels})


def noisy_vane(record: Record, scale: float) -> np.ndarray:
    aoa = record.channels["aoa"]
    return aoa.mean() + scale * (aoa - aoa.mean()) + 0.6 * aoa.std() * np.random.default_rng(14).standard_normal(N)


def test_the_angle_that_attitude_and_climb_tell_is_that_of_the_climb_angle():
    aoa, pitch, roll = RNG.uniform(-0.3, 0.3, (3, N))
    rate = 20.0 * np.sin(climb_angle(aoa, pitch, roll))
    np.testing.assert_allclose(vane_angle(rate, np.full(N, 20.0), pitch, roll), aoa, atol=1e-12)


def test_every_channel_of_a_healthy_flight_is_what_the_others_say():
    record = drone()
    every = {one.relation.residual: one for one in agreements(record, FLIGHT)}
    assert set(every) == {"climb", "lift", "load", "kinematics", "ground_speed"}
    for one in every.values():
        assert one.holds
        assert not one.fails
        assert one.correlation > 0.9
        assert not one.relation.has_scale or one.scale == pytest.approx(1.0, abs=0.15)
    assert credibility_of(record, FLIGHT).sentences == ()


@pytest.mark.parametrize("scale", [0.13, 2.2])
def test_a_vane_of_another_scale_is_the_finding_and_nothing_else(scale: float):
    record = drone()
    found = credibility_of(with_channel(record, aoa=noisy_vane(record, scale)), FLIGHT)
    (finding,) = found.findings
    assert (finding.channels, finding.rivals, finding.what, finding.fixed) == (("aoa",), (), "unrelated", True)
    assert finding.factor_ci95 is not None
    sd = (1.0 / finding.factor_ci95[1] - 1.0 / finding.factor) / 1.96
    assert abs(1.0 / finding.factor - scale) < 3.0 * abs(sd) + 0.02
    assert found.unused == ("aoa",)
    assert f"scale {1.0 / finding.factor:.2f}" in found.sentences[0]
    assert "gusts" not in finding.text


@pytest.mark.parametrize(("name", "scale"), [("normal_acc", 0.2), ("longitudinal_acc", 0.2), ("velocity", 0.3)])
def test_what_follows_in_another_scale_is_told_from_what_it_is_held_against(name: str, scale: float):
    record = drone()
    names = ("velocity_north", "velocity_east") if name == "velocity" else (name,)
    scaled = {one: scale * record.channels[one] for one in names}
    found = credibility_of(with_channel(record, **scaled), FLIGHT)
    (finding,) = found.findings
    assert {*names} <= {*finding.channels}


@pytest.mark.parametrize("onset", [0.35, 0.6])
@pytest.mark.parametrize("shape", ["frozen", "bias", "drift", "scale"])
def test_what_begins_during_the_flight_is_left_to_those_who_tell_its_onset(shape: str, onset: float):
    record, k = drone(), round(onset * N)
    aoa = record.channels["aoa"].copy()
    after = {"frozen": aoa[k], "bias": aoa[k:] + 0.1, "drift": aoa[k:] + 5e-4 * T[: N - k], "scale": 0.1 * aoa[k:]}
    aoa[k:] = after[shape]
    assert not credibility_of(with_channel(record, aoa=aoa), FLIGHT).findings


def test_gusts_that_attitude_does_not_see_are_no_fault_of_a_vane_that_the_lift_confirms():
    record = drone()
    gusts = np.convolve(RNG.standard_normal(N), np.ones(8) / np.sqrt(8.0), "same")
    gusty = with_channel(record, altitude_rate=record.channels["altitude_rate"] + 6.0 * gusts)
    found = credibility_of(with_channel(gusty, normal_acc=record.channels["normal_acc"]), FLIGHT)
    assert "aoa" not in found.unused
    assert {"climb"} <= {*found.unusable} or found.findings[0].channels == ("altitude_rate",)


def test_without_the_lift_gusts_leave_a_vane_in_doubt():
    record = drone()
    del record.channels["normal_acc"]
    still = with_channel(record, aoa=np.radians(4.0) + 0.01 * RNG.standard_normal(N))
    (finding,) = credibility_of(still, FLIGHT).findings
    assert finding.channels == ("aoa",)
    assert "altitude_rate" in finding.rivals
    assert "or " in finding.text


def test_an_airspeed_that_fails_early_accuses_none_of_those_that_show_it():
    record = drone()
    stuck = {name: np.full(N, record.channels[name].mean()) for name in ("tas", "q_impact")}
    assert credibility_of(with_channel(record, **stuck), FLIGHT).findings == ()


@pytest.mark.parametrize(("gusts_m_s", "hide"), [(1.3, True), (1.7, False)])
def test_moderate_gusts_turn_the_air_by_their_share_of_the_airspeed(gusts_m_s: float, hide: bool):
    """They are what the climb shows of a vane that rests; more than that they do not hide."""
    record, period_s = drone(), 30.0
    seen = np.sinc(5.0 / period_s)  # of a sine, in means of five seconds
    climb = gusts_m_s / seen * np.sqrt(2.0) * np.sin(2.0 * np.pi * T / period_s)
    level = {name: np.zeros(N) for name in ("pitch", "roll", "aoa")}
    resting = with_channel(record, tas=np.full(N, 16.0), altitude_rate=climb, **level)
    (agreement,) = [other for other in agreements(resting, FLIGHT) if other.relation.residual == "climb"]
    assert agreement.by_gusts is hide


def test_an_airspeed_that_rests_at_zero_tells_no_speed():
    record = drone()
    lost = with_channel(record, tas=np.zeros(N))
    assert [one.gusts for one in agreements(lost, FLIGHT) if one.gusts] == []


def test_stretches_that_are_left_out_do_not_count():
    record = drone()
    aoa = np.where((T > 30.0) & (T < 870.0), 0.1, record.channels["aoa"])
    assert credibility_of(with_channel(record, aoa=aoa), FLIGHT).unused == ("aoa",)
    assert not credibility_of(with_channel(record, aoa=aoa), FLIGHT, without=[(30.0, 870.0)]).findings


def test_a_flight_that_hardly_moves_says_nothing():
    record = drone()
    calm = with_channel(
        record, **{name: values.mean() + 1e-3 * RNG.standard_normal(N) for name, values in record.channels.items()}
    )
    found = credibility_of(calm, FLIGHT)
    assert (found.findings, found.sentences, found.unusable) == ((), (), ())


@pytest.mark.parametrize(
    ("step_m", "every_s", "coarse"), [(0.0, 0.1, False), (1.1, 1.0, False), (11.0, 0.1, True), (0.0, 4.0, True)]
)
def test_positions_in_coarse_steps_make_no_ground_speed(step_m: float, every_s: float, *, coarse: bool):
    t = np.floor(np.arange(3000) / 10.0 / every_s) * every_s
    north, east = 70.0 * t + 300.0 * np.sin(0.01 * t), 60.0 * t + 300.0 * np.cos(0.013 * t)
    latitude, longitude = 0.9 + north / EARTH_RADIUS, 0.1 + east / EARTH_RADIUS
    if step_m:
        step = step_m / EARTH_RADIUS
        latitude, longitude = step * np.round(latitude / step), step * np.round(longitude / step)
    log = made_log(300.0, latitude=latitude, longitude=longitude)
    channels = {name: one for name, one in log.channels.items() if not name.startswith("velocity")}
    assert coarse_positions(log) == ""
    assert bool(coarse_positions(replace(log, channels=channels))) is coarse
