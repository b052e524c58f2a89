"""Holds and leaks of pressure lines: named where the line shows them, and not where the air is calm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_flights import made_flight
from made_logs import made_log
from scipy.ndimage import gaussian_filter1d

from bfi_cli.airdata import G, air_data_of, channels_of, impact_pressure_of_cas, pressure_at, total_temperature
from bfi_cli.faults import Fault
from bfi_cli.flight.parity.holds import doubt_of, find_holds
from bfi_cli.flight.parity.leaks import brakes
from bfi_cli.flight.parity.lines import Stretches, edge_of, lines_of
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.record import frozen_array

FROM_S, TO_S, ONSET_S = 240.0, 360.0, 300.0
BLOCKED = {"pitot_blocked": "p_total", "static_blocked": "p_static"}
STEPS = {"altitude": 0.3048, "cas": 0.0322}


def trapped(shape: str, *, noise_pa: float, steps: dict[str, float] | None = None) -> FlightLog:
    """Return a flight whose line is trapped before its transducer adds noise and the record its steps."""
    log = made_flight(names=("p_static", "q_impact", "tat"))
    static, impact, tat = (np.array(log.channels[name].values) for name in ("p_static", "q_impact", "tat"))
    total, on, rng = static + impact, log.time_s >= ONSET_S, np.random.default_rng(1)
    held = static if shape == "static_blocked" else total
    held[on] = held[on][0]
    static = static + noise_pa * rng.standard_normal(on.size)
    total = total + noise_pa * rng.standard_normal(on.size)
    made = channels_of(static, np.maximum(total - static, 0.0), tat)
    values = {name: made[name] for name in ("altitude", "cas")}
    for name, step in (steps or {}).items():
        values[name] = np.round(values[name] / step) * step
    return made_log(log.time_s, {"altitude": "m"}, **values)


@pytest.mark.parametrize("shape", BLOCKED)
@pytest.mark.parametrize("window", [(FROM_S, TO_S), (0.0, 600.0)], ids=["window", "whole log"])
def test_without_noise_a_trapped_line_is_named(shape: str, window: tuple[float, float]):
    fault = Fault(shape=shape, onset_s=ONSET_S, offset_s=430.0)
    (found,) = find_holds(inject(made_flight(), [fault]), *window).findings
    assert (found.fault, found.among, found.stage) == (shape, (shape,), "holds")
    assert found.magnitude is None
    assert found.onset_s == pytest.approx(ONSET_S, abs=1.5)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    if window == (FROM_S, TO_S):
        assert found.offset_s is None
    else:
        assert found.offset_s == pytest.approx(430.0, abs=1.5)
    follows = {"cas", "mach", "tas", "sat"} | ({"altitude"} if shape == "static_blocked" else set())
    assert set(found.channels) == follows


@pytest.mark.parametrize("shape", BLOCKED)
@pytest.mark.parametrize(("noise_pa", "steps"), [(0.0, STEPS), (2.0, STEPS), (8.0, None)])
def test_a_transducer_and_a_record_make_it_less_still(shape: str, noise_pa: float, steps: dict[str, float] | None):
    (found,) = find_holds(trapped(shape, noise_pa=noise_pa, steps=steps), FROM_S, TO_S).findings
    assert found.fault == shape
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]


@pytest.mark.parametrize(("noise_pa", "steps"), [(1.0, STEPS), (8.0, None)])
def test_a_recorder_that_smooths_noise_moves_no_onset(noise_pa: float, steps: dict[str, float] | None):
    """A line that is fitted to a short stretch strays by slow noise far from it."""
    log = trapped("pitot_blocked", noise_pa=noise_pa, steps=steps)
    smooth = {name: gaussian_filter1d(np.asarray(one.values), 2.5) for name, one in log.channels.items()}
    (found,) = find_holds(made_log(log.time_s, {"altitude": "m"}, **smooth), 0.0, 600.0).findings
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]


def test_slow_noise_of_a_trapped_tube_is_no_calm_flight():
    """It strays beyond the limit of white noise in most of its stretches, and by a tenth of what flight does."""
    log, rng, values = trapped("pitot_blocked", noise_pa=0.0), np.random.default_rng(3), {}
    for name, size in {"altitude": 0.37, "cas": 0.15}.items():
        slow = size * gaussian_filter1d(rng.standard_normal(log.n_samples), 3.0)
        values[name] = log.channels[name].values + slow
    (found,) = find_holds(made_log(log.time_s, {"altitude": "m"}, **values), 0.0, 600.0).findings
    assert found.fault == "pitot_blocked"
    assert found.onset_s == pytest.approx(ONSET_S, abs=3.0)


@pytest.mark.parametrize("time_constant_s", [2.0, 10.0])
def test_a_leak_is_named_with_its_time_constant(time_constant_s: float):
    fault = Fault(shape="pitot_leak", onset_s=ONSET_S, time_constant_s=time_constant_s)
    (found,) = find_holds(inject(made_flight(), [fault]), FROM_S, TO_S).findings
    assert found.fault == "pitot_leak"
    assert found.evidence["time_constant_s"] == pytest.approx(time_constant_s, rel=0.15)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.statistic > found.threshold


@pytest.mark.parametrize("steps", [None, STEPS])
@pytest.mark.parametrize(("time_constant_s", "cabin_altitude_m"), [(1.0, 2000.0), (5.0, None), (5.0, 1200.0)])
def test_a_static_line_that_leaks_to_the_cabin_is_named_with_its_time_constant(
    time_constant_s: float, cabin_altitude_m: float | None, steps: dict[str, float] | None
):
    """In a cabin at a lower pressure the airspeed grows, at a higher one none is left: no leak of the pitot tube."""
    leak = Fault(
        shape="static_leak", onset_s=ONSET_S, time_constant_s=time_constant_s, cabin_altitude_m=cabin_altitude_m
    )
    log = inject(made_flight(steps=steps, noise_pa=0.5 if steps else 0.0), [leak])
    (found,) = find_holds(log, 0.0, 600.0).findings
    assert (found.fault, found.offset_s) == ("static_leak", None)
    assert found.evidence["time_constant_s"] == pytest.approx(time_constant_s, rel=0.15)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.onset_s == pytest.approx(ONSET_S, abs=1.0)
    assert found.statistic > found.threshold


def test_missing_samples_far_away_hide_no_leak():
    leak = Fault(shape="static_leak", onset_s=ONSET_S, time_constant_s=5.0, cabin_altitude_m=1200.0)
    log = inject(made_flight(names=("altitude", "cas")), [leak])
    altitude = np.array(log.channels["altitude"].values)
    altitude[1000:1020] = np.nan
    broken = replace(log.channels["altitude"], values=frozen_array(altitude))
    (found,) = find_holds(replace(log, channels={**log.channels, "altitude": broken}), 0.0, 600.0).findings
    assert found.fault == "static_leak"


@pytest.mark.parametrize(("rate_hz", "gap_s"), [(1, 10), (1, 5), (10, 8)])
def test_a_climb_within_a_gap_is_no_leak(rate_hz: int, gap_s: int):
    """Cruise, a climb that the record lacks, and cruise again, through a record of ten feet."""
    time_s = np.arange(600 * rate_hz) / rate_hz
    altitude = 1000.0 + np.clip(6.0 * (time_s - 300.0), 0.0, 6.0 * gap_s)
    cas = 60.0 + np.sin(time_s / 3.0)
    kept = (time_s <= 300.0) | (time_s >= 300.0 + gap_s)
    values = {"altitude": np.round(altitude / 3.048)[kept] * 3.048, "cas": cas[kept]}
    assert find_holds(made_log(time_s[kept], {"altitude": "m"}, **values), 0.0, 600.0).findings == ()


@pytest.mark.parametrize("time_constant_s", [3.0, 5.0])
def test_an_altitude_that_steps_with_the_aircraft_is_no_leak(time_constant_s: float):
    """A drone goes to another altitude at once, through a record of ten feet: its total pressure goes with it."""
    flight = made_flight(climbs_m=0.0, air_pa=15.0, names=("altitude", "cas"))
    altitude = 200.0 - 60.0 * np.expm1(-np.maximum(flight.time_s - ONSET_S, 0.0) / time_constant_s)
    values = {"altitude": np.round(altitude / 3.048) * 3.048, "cas": flight.channels["cas"].values}
    found = find_holds(made_log(flight.time_s, {"altitude": "m"}, **values), 0.0, 600.0).findings
    assert not [one for one in found if one.fault == "static_leak"]


def test_a_blocked_port_after_a_capture_of_altitude_does_not_leak():
    """An autopilot captures an altitude along an exponential too, which begins at the rate of the climb."""
    flight = made_flight(climbs_m=0.0, air_pa=15.0, names=("altitude", "cas"))
    since = np.maximum(flight.time_s - 240.0, 0.0)
    altitude = 1000.0 + 8.0 * np.minimum(flight.time_s, 240.0) + 80.0 * -np.expm1(-since / 10.0)
    log = made_log(flight.time_s, {"altitude": "m"}, altitude=altitude, cas=flight.channels["cas"].values)
    assert not [one for one in find_holds(log, 0.0, 600.0).findings if one.fault == "static_leak"]


@pytest.mark.parametrize("steps", [None, STEPS])
def test_without_a_fault_nothing_is_found(steps: dict[str, float] | None):
    log = made_flight(steps=steps, noise_pa=1.0)
    answer = find_holds(log, 0.0, 600.0)
    assert answer.findings == ()
    assert {*answer.untold} == {"p_total", "p_static"}
    assert answer.unseen == ()


def calm_flight(blocked: tuple[float, float] | None) -> FlightLog:
    """Return twenty minutes of smooth air at 1 Hz, in steps of 4 ft and a quarter of a knot."""
    time_s, rng = np.arange(1200.0), np.random.default_rng(3)
    altitude = 900.0 + 150.0 * np.sin(time_s / 95.0) + rng.normal(0.0, 0.3, 1200)
    impact = impact_pressure_of_cas(150.0 + 4.0 * np.sin(time_s / 25.0) + rng.normal(0.0, 0.05, 1200))
    static = pressure_at(altitude)
    total = static + impact
    if blocked is not None:
        held = (time_s >= blocked[0]) & (time_s < blocked[1])
        total[held] = total[held][0]
    made = channels_of(static, total - static, np.full(1200, 285.0))
    cas, altitude = np.round(made["cas"] / 0.129) * 0.129, np.round(made["altitude"] / 1.219) * 1.219
    return made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=cas)


def test_a_tube_that_is_blocked_for_minutes_is_no_calm_of_half_a_minute():
    (tube,) = find_holds(calm_flight((480.0, 720.0)), 0.0, 1200.0).findings
    assert tube.fault == "pitot_blocked"
    assert tube.onset_ci95[0] <= 480.0 <= tube.onset_ci95[1]
    assert tube.offset_s == pytest.approx(720.0, abs=3.0)
    assert find_holds(calm_flight(None), 0.0, 1200.0).findings == ()


@pytest.mark.parametrize("wanders_m", [2.0, 3.0])
def test_what_a_held_line_reaches_does_not_widen_its_band(wanders_m: float):
    """A port that is blocked at the end of a gentle flight was not blocked from its begin on: not for a wave before."""
    time_s, onset_s, wave_s = np.arange(900.0), 800.0, 2.0 * np.pi * 20.0
    altitude = 1000.0 + wanders_m * np.where(time_s < onset_s, np.sin((time_s - onset_s) * 2.0 * np.pi / wave_s), 0.0)
    altitude += np.random.default_rng(2).normal(0.0, 0.2, time_s.size)
    rounded = np.round(altitude / 1.219) * 1.219
    lines = lines_of(made_log(time_s, {"altitude": "m"}, altitude=rounded, cas=90.0 + np.sin(time_s / 3.0)))
    static = lines.of("p_static")
    assert static is not None
    held_from_s = float(lines.time_s[edge_of(lines, static, int(np.searchsorted(lines.time_s, 850.0)), -1)])
    assert onset_s - wave_s < held_from_s <= onset_s


def test_a_flight_in_which_nothing_moves_tells_nothing():
    answer = find_holds(made_flight(climbs_m=0.0, air_pa=0.0, speed=100.0, names=("altitude", "cas")), 0.0, 20.0)
    assert answer.findings == ()
    time_s = np.arange(3000) / 10.0
    trimmed = made_log(time_s, {"altitude": "m"}, altitude=np.full(3000, 3000.0), cas=np.full(3000, 90.0))
    answer = find_holds(trimmed, 0.0, 300.0)
    assert answer.findings == ()
    assert all("nothing moves" in untold[0][2] for untold in answer.untold.values())


@pytest.mark.parametrize("climb_s", [0.0, 200.0])
def test_an_altitude_that_is_held_within_a_step_is_no_blocked_port(climb_s: float):
    """A climb that levels off at 0.1 g into a flight without a movement of one foot, through a record of one foot."""
    flight = made_flight(climbs_m=0.0, air_pa=15.0, names=("altitude", "cas"))
    time_s = flight.time_s
    rate = np.clip(0.1 * 9.8 * (climb_s - time_s), 0.0, 6.0)
    altitude = 1000.0 + np.concatenate([[0.0], np.cumsum(rate[1:]) / 10.0])
    log = made_log(
        time_s, {"altitude": "m"}, altitude=np.round(altitude / 0.3048) * 0.3048, cas=flight.channels["cas"].values
    )
    answer = find_holds(log, 0.0, 600.0)
    assert answer.findings == ()
    assert "too little flight that moves" in answer.untold["p_static"][0][2]


def coarse_flight(altitude: np.ndarray, step_m: float) -> FlightLog:
    """Return a flight of ten minutes at 10 Hz whose altitude comes in steps, with an airspeed that moves."""
    time_s = np.arange(6000) / 10.0
    rounded = np.round(altitude / step_m) * step_m
    return made_log(
        time_s, {"altitude": "m"}, altitude=rounded, cas=90.0 + np.sin(time_s / 3.0) + np.sin(time_s / 11.0)
    )


def levelling_flight(step_m: float, levelling: float) -> FlightLog:
    """Return a climb of 10 m/s that levels off at 200 s into flight within half a metre of a step's middle."""
    time_s = np.arange(6000) / 10.0
    above = np.cumsum(np.clip(levelling * (200.0 - time_s), 0.0, 10.0)) / 10.0
    altitude = 100.0 * step_m + above - above[-1] + 0.25 * np.sin(time_s / 5.0)
    return coarse_flight(altitude, step_m)


@pytest.mark.first_rows(4)
@pytest.mark.parametrize("step_m", [0.61, 3.048, 7.62, 30.48])
@pytest.mark.parametrize("levelling", [0.5, 2.3])
def test_level_flight_within_a_coarse_step_is_no_blocked_port(step_m: float, levelling: float):
    answer = find_holds(levelling_flight(step_m, levelling), 0.0, 600.0)
    assert answer.findings == ()
    if step_m > 1.0:
        assert any(sentence.startswith("static_blocked could hide in") for sentence in answer.missing())


def test_a_steady_climb_in_coarse_steps_is_no_blocked_port():
    time_s = np.arange(6000) / 10.0
    altitude = 1000.0 + np.where(time_s < 300.0, 5.0 * time_s, 1500.0 + 9.0 * (time_s - 300.0))
    answer = find_holds(coarse_flight(altitude, 3.048), 0.0, 600.0)
    assert answer.findings == ()
    assert answer.missing() == ()


@pytest.mark.parametrize("step_m", [0.3048, 3.048])
def test_a_fast_climb_that_stops_at_once_is_a_blocked_port_in_coarse_steps_too(step_m: float):
    altitude = 1000.0 + 20.0 * np.minimum(np.arange(6000) / 10.0, ONSET_S)
    (found,) = find_holds(coarse_flight(altitude, step_m), 0.0, 600.0).findings
    assert found.fault == "static_blocked"
    assert found.onset_s == pytest.approx(ONSET_S, abs=2.0)


def test_a_climb_that_stops_at_once_is_a_blocked_port():
    flight = made_flight(climbs_m=0.0, air_pa=15.0, names=("altitude", "cas"))
    altitude = 1000.0 + 6.0 * np.minimum(flight.time_s, ONSET_S)
    log = made_log(flight.time_s, {"altitude": "m"}, altitude=altitude, cas=flight.channels["cas"].values)
    (found,) = find_holds(log, 0.0, 600.0).findings
    assert found.fault == "static_blocked"


@pytest.mark.parametrize("faster", [35.0, 10.0], ids=["a transport", "a glider"])
def test_a_landing_is_neither_leak_nor_hold(faster: float):
    """A glider touches down at nearly the airspeed that it flies at."""
    time_s = np.arange(8000) / 10.0
    left = np.maximum(600.0 - time_s, 0.0)
    altitude = 150.0 + 4.0 * left + 3.0 * np.sin(time_s / 4.0) * (left > 0.0)
    speed = 55.0 + faster * np.clip(left / 200.0, 0.0, 1.0) + 1.5 * np.sin(time_s / 7.0) * (left > 0.0)
    cas = np.where(left > 0.0, speed, np.maximum(55.0 - 3.0 * (time_s - 600.0), 0.0))
    log = made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=cas)
    answer = find_holds(log, 0.0, 800.0)
    assert answer.findings == ()
    assert any("landing" in why for *_, why in answer.untold["p_total"])
    # The same loss of airspeed with a ground speed that goes on.
    ground = made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=cas, ground_speed=np.full(8000, 90.0))
    (found,) = [one for one in find_holds(ground, 0.0, 800.0).findings if one.fault == "pitot_leak"]
    assert found.onset_s == pytest.approx(603.0, abs=5.0)


def test_a_hard_landing_is_no_port_that_stops_at_once():
    """An aircraft that comes down at 8 m/s stops as no levelling off does, and then brakes for half a minute."""
    time_s, rng = np.arange(1000.0), np.random.default_rng(5)
    altitude = np.interp(time_s, (0.0, 60.0, 240.0, 800.0, 894.0), (420.0, 420.0, 1100.0, 1100.0, 420.0))
    altitude += np.where((time_s > 60.0) & (time_s < 890.0), 20.0 * np.sin(time_s / 20.0), 0.0)
    altitude = np.where(time_s >= 894.0, 420.0, altitude)
    ground = np.interp(time_s, (0.0, 20.0, 50.0, 880.0, 900.0, 960.0), (0.0, 0.0, 80.0, 80.0, 55.0, 0.0))
    cas = np.maximum(ground + rng.normal(0.0, 0.3, time_s.size), 0.0)
    log = made_log(time_s, {"altitude": "m"}, altitude=np.round(altitude / 1.219) * 1.219, cas=cas, ground_speed=ground)
    assert find_holds(log, 0.0, 1000.0).findings == ()


def test_a_tube_that_is_still_blocked_after_the_landing_is_named():
    time_s = np.arange(8000) / 10.0
    left = np.maximum(600.0 - time_s, 0.0)
    altitude = 150.0 + 0.5 * left + 3.0 * np.sin(time_s / 4.0) * (left > 0.0)
    cas = (70.0 + 1.5 * np.sin(time_s / 7.0)) * (left > 0.0)
    log = made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=cas, ground_speed=1.1 * cas)
    (found,) = find_holds(inject(log, [Fault(shape="pitot_blocked", onset_s=300.0)]), 0.0, 800.0).findings
    assert (found.fault, found.offset_s) == ("pitot_blocked", None)
    assert found.onset_s == pytest.approx(300.0, abs=2.0)


@pytest.mark.parametrize("climbs", [0.0, 1.0])
def test_an_airspeed_that_is_lost_after_a_descent_is_a_leak_where_the_flight_goes_on(climbs: float):
    time_s = np.arange(8000) / 10.0
    altitude = 900.0 + 4.0 * np.maximum(500.0 - time_s, 0.0) + climbs * np.maximum(time_s - 700.0, 0.0)
    altitude += 3.0 * np.sin(time_s / 4.0)
    cas = (70.0 + 1.5 * np.sin(time_s / 7.0)) * np.exp(-np.maximum(time_s - 520.0, 0.0) / 12.0)
    log = made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=cas)
    found = [finding.fault for finding in find_holds(log, 0.0, 800.0).findings]
    assert found == (["pitot_leak"] if climbs else [])


def test_a_log_with_tas_alone_finds_a_blocked_tube_and_says_what_it_costs():
    fault = Fault(shape="pitot_blocked", onset_s=ONSET_S, offset_s=430.0)
    log = inject(made_flight(), [fault])
    log = replace(log, channels={name: log.channels[name] for name in ("altitude", "tas", "tat")})
    answer = find_holds(log, FROM_S, TO_S)
    assert [one.fault for one in answer.findings] == ["pitot_blocked"]
    assert any("harder to see than with cas or mach" in why for why in answer.missing())


def test_what_the_log_lacks_is_said():
    flight = made_flight()
    without = replace(flight, channels={name: one for name, one in flight.channels.items() if name != "altitude"})
    assert "lacks altitude or p_static" in find_holds(without, FROM_S, TO_S).missing()[0]
    rest = made_log(flight.time_s, {}, altitude=np.zeros(flight.n_samples), cas=np.zeros(flight.n_samples))
    assert "shows no flight" in find_holds(rest, FROM_S, TO_S).missing()[0]


def test_gaps_and_missing_samples_are_no_holds():
    log = made_flight()
    values = np.array(log.channels["cas"].values)
    values[2500:2900] = np.nan
    broken = replace(log, channels={**log.channels, "cas": replace(log.channels["cas"], values=frozen_array(values))})
    assert find_holds(broken, 0.0, 600.0).findings == ()
    gap = log.take((log.time_s < 250.0) | (log.time_s > 320.0))
    assert find_holds(gap, 0.0, 600.0).findings == ()


def changed(log: FlightLog, **signals: np.ndarray) -> FlightLog:
    channels = {name: replace(log.channels[name], values=frozen_array(values)) for name, values in signals.items()}
    return replace(log, channels={**log.channels, **channels})


def test_single_missing_samples_hide_no_blocked_port():
    log = inject(made_flight(names=("altitude", "cas")), [Fault(shape="static_blocked", onset_s=ONSET_S)])
    altitude = np.array(log.channels["altitude"].values)
    altitude[::20] = np.nan
    answer = find_holds(changed(log, altitude=altitude), 0.0, 600.0)
    assert [one.fault for one in answer.findings] == ["static_blocked"]
    assert answer.missing() == ()
    assert answer.unseen == ()


def test_how_long_gaps_keep_a_port_from_being_watched_is_said():
    log = made_flight(names=("altitude", "cas"))
    answer = find_holds(log.take(log.time_s % 35.0 >= 3.0), 0.0, 600.0)
    assert answer.findings == ()
    (sentence,) = answer.missing()  # 30 s are enough for a pitot tube
    assert sentence.startswith("static_blocked was not looked for in 5")


@pytest.mark.parametrize("period_s", [2.0, 5.0, 20.0])
def test_a_channel_that_is_held_between_slow_samples_is_not_watched(period_s: float):
    log = made_flight(names=("altitude", "cas"), noise_pa=1.0, steps=STEPS)
    held = np.arange(log.n_samples) // round(10 * period_s) * round(10 * period_s)
    slow = {name: log.channels[name].values[held] for name in ("altitude", "cas")}
    answer = find_holds(changed(log, **slow), 0.0, 600.0)
    assert answer.findings == ()
    assert f"is renewed every {period_s:.3g} s only" in answer.missing()[0]


def test_windows_of_one_log_share_its_lines():
    log = inject(made_flight(), [Fault(shape="pitot_blocked", onset_s=ONSET_S, offset_s=430.0)])
    lines = lines_of(log)
    assert find_holds(log, FROM_S, TO_S, lines=lines) == find_holds(log, FROM_S, TO_S)
    assert find_holds(log, 0.0, ONSET_S, lines=lines).findings == ()


def test_slow_flight_at_the_level_of_the_sea_has_its_pressures():
    """What the tests above take for granted: the made flight's channels are those of its pressures."""
    log = made_flight(names=("altitude", "cas", "p_static", "q_impact", "tat", "sat", "mach"))
    value = {name: one.values for name, one in log.channels.items()}
    np.testing.assert_allclose(pressure_at(value["altitude"]), value["p_static"], rtol=1e-12)
    np.testing.assert_allclose(impact_pressure_of_cas(value["cas"]), value["q_impact"], rtol=1e-10)
    np.testing.assert_allclose(total_temperature(value["sat"], value["mach"]), value["tat"], rtol=1e-12)


@pytest.mark.parametrize("knots", [0.5, 1.0, 2.0])
def test_speed_that_is_held_within_a_coarse_step_is_no_blocked_tube(knots: float):
    """An autopilot holds the speed in smooth air for two times two minutes, and the altitude within half a metre."""
    time_s = np.arange(9000) / 10.0
    step = knots * 0.5144
    held = ((time_s > 200.0) & (time_s < 320.0)) | ((time_s > 500.0) & (time_s < 620.0))
    moving = 4.0 * np.sin(time_s / 9.0) + 3.0 * np.sin(time_s / 17.0)
    cas = step * round(90.0 / step) + np.where(held, 0.1 * step * np.sin(time_s / 5.0), moving)
    altitude = 3000.0 + 0.4 * np.sin(time_s / 4.0)
    log = made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=np.round(cas / step) * step)
    answer = find_holds(log, 0.0, 900.0)
    assert answer.findings == ()
    assert any(sentence.startswith("pitot_blocked could hide in") for sentence in answer.missing())


def test_airspeed_lost_while_the_static_pressure_rests_may_be_a_blocked_port_in_a_climb():
    flight = made_flight(climbs_m=0.0, air_pa=15.0, names=("altitude", "cas"))
    leak = Fault(shape="pitot_leak", onset_s=ONSET_S, time_constant_s=5.0)
    log = inject(flight, [leak])
    altitude = np.round(np.asarray(log.channels["altitude"].values) / 30.48) * 30.48
    rounded = replace(log.channels["altitude"], values=frozen_array(altitude))
    (found,) = find_holds(replace(log, channels={**log.channels, "altitude": rounded}), 0.0, 600.0).findings
    assert found.among == ("pitot_leak", "static_blocked")
    assert set(found.channels) == {"altitude", "cas"}
    (found,) = find_holds(inject(made_flight(), [leak]), 0.0, 600.0).findings
    assert found.among == ("pitot_leak",)


def test_a_port_that_opens_in_coarse_steps_is_no_certain_leak():
    """A port that was blocked in a climb opens, and the pressure jumps to level flight within a step."""
    time_s = np.arange(6000) / 10.0
    opened = -np.expm1(-np.maximum(time_s - ONSET_S, 0.0))
    static = pressure_at(1000.0 + 160.0 * opened)
    total = pressure_at(np.full(6000, 1000.0)) + impact_pressure_of_cas(90.0 + np.sin(time_s / 3.0))
    made = channels_of(static, total - static, np.full(6000, 288.0))
    altitude = np.round(made["altitude"] / 10.0) * 10.0
    log = made_log(time_s, {"altitude": "m"}, altitude=altitude, cas=made["cas"])
    (found,) = find_holds(log, 0.0, 600.0).findings
    assert found.fault == "static_leak"
    assert "rests before it too" in found.doubt


def test_a_tube_that_leaks_in_a_descent_is_no_static_line():
    """What the static pressure gains is the descent, which began before the leak."""
    leak = Fault(shape="pitot_leak", onset_s=260.0, time_constant_s=15.0)
    (found,) = find_holds(inject(made_flight(speed=45.0, climbs_m=60.0, air_pa=10.0), [leak]), 0.0, 600.0).findings
    assert found.among == ("pitot_leak",)


@pytest.mark.parametrize(
    "course",
    [
        ((1200.0, 4000.0), (1230.0, 630.0), (1700.0, 560.0), (1720.0, 100.0)),
        ((1200.0, 4000.0), (1230.0, 620.0), (1600.0, 580.0), (1680.0, 100.0)),
    ],
    ids=["fast", "slowly"],
)
def test_what_is_lost_of_a_rest_of_impact_pressure_is_no_leak(course: tuple[tuple[float, float], ...]):
    """The tube is blocked and the aircraft descends: most is lost before the last of it falls as an exponential."""
    time_s = np.arange(0.0, 2000.0, 0.1)
    q_impact = np.interp(time_s, *zip(*course, strict=True))
    made = channels_of(80_000.0 + 200.0 * np.sin(0.05 * time_s), q_impact, np.full(time_s.size, 288.0))
    log = made_log(time_s, {"altitude": "m"}, altitude=made["altitude"], cas=made["cas"])
    assert not [one for one in find_holds(log, 0.0, 2000.0).findings if one.fault == "pitot_leak"]


@pytest.mark.parametrize("time_constant_s", [20.0, 50.0, 90.0])
def test_a_tube_that_leaks_slowly_is_named_with_its_time_constant(time_constant_s: float):
    flight = made_flight()
    leak = Fault(shape="pitot_leak", onset_s=ONSET_S, time_constant_s=time_constant_s)
    (found,) = find_holds(inject(flight, [leak]), 0.0, 600.0).findings
    assert found.among == ("pitot_leak",)
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]
    assert found.evidence["time_constant_s"] == pytest.approx(time_constant_s, rel=0.25)


def test_ice_that_closes_a_tube_at_an_even_rate_is_no_leak():
    ice = Fault(shape="pitot_icing", onset_s=ONSET_S, magnitude=0.009)
    held = find_holds(inject(made_flight(), [replace(ice, offset_s=ONSET_S + 108.0)]), 0.0, 600.0)
    assert not [one for one in held.findings if one.fault == "pitot_leak"]


def test_a_static_line_that_takes_all_impact_pressure_is_no_leak_of_the_tube():
    """The cabin's pressure is beyond the total pressure, and a part of the line still follows the one outside."""
    flight = made_flight(names=("altitude", "cas"))
    t = flight.time_s
    air = air_data_of({name: one.values for name, one in flight.channels.items()})
    gained = 6_000.0 * np.where(t < ONSET_S, 0.0, -np.expm1(-np.maximum(t - ONSET_S, 0.0) / 5.0))
    made = channels_of(air.p_static + gained, np.maximum(air.q_impact - gained, 0.0), air.tat)
    log = made_log(t, {"altitude": "m"}, altitude=made["altitude"], cas=made["cas"])
    (found,) = find_holds(log, 0.0, 600.0).findings
    assert found.fault == "static_leak"
    assert found.onset_ci95[0] <= ONSET_S <= found.onset_ci95[1]


@pytest.mark.parametrize(
    ("limit", "sd", "doubted"),
    [(1.4, 0.95, False), (1.4, 1.05, True), (1.6, 0.28, False), (1.6, 0.35, True), (1.6, 0.8, True)],
)
def test_how_still_a_line_must_be_goes_by_the_calm_of_the_flight_and_the_noise_of_the_record(limit, sd, *, doubted):
    """Calm flight strays by 3 Pa: a third of that is still; where noise is half of it, a tenth."""

    def stretch(sd: float, limit: float) -> Stretches:
        one, yes = np.ones(1), np.ones(1, dtype=bool)
        return Stretches(sd=sd * one, limit=limit * one, rise=0.0 * one, whole=yes, inside=yes, n=60)

    log = made_flight(seconds=60.0)
    lines = lines_of(log)
    line = lines.of("p_total")
    assert line is not None
    why = doubt_of(log, lines, line, stretch(sd, limit), stretch(9.0, 1.0), 3.0, (0, 0, 0), 0)
    assert bool(why) is doubted


@pytest.mark.parametrize(("metres", "held"), [(26.0, True), (35.0, False)])
def test_a_trapped_pressure_drifts_with_a_degree_of_its_line_and_what_goes_on_faster_is_flight(
    metres: float, held: bool
) -> None:
    """In the half minute of a stretch: a degree of 265 K is 1 / 265 of the pressure, which is that of 29 m."""
    flight = made_flight(names=("p_static", "q_impact", "tat"))
    static, impact, tat = (flight.channels[name].values for name in ("p_static", "q_impact", "tat"))
    total, since_s = static + impact, flight.time_s - ONSET_S
    at_onset = total[since_s >= 0.0][0]
    drifting = at_onset * (1.0 + metres * G / (287.05 * 265.0) * since_s / 30.0)
    made = channels_of(static, np.maximum(np.where(since_s >= 0.0, drifting, total) - static, 1.0), tat)
    log = made_log(flight.time_s, {"altitude": "m"}, altitude=made["altitude"], cas=made["cas"])
    answer = find_holds(log, FROM_S, TO_S)
    assert [finding.fault for finding in answer.findings] == (["pitot_blocked"] if held else [])
    assert any("steady" in why for *_, why in answer.untold["p_total"]) is not held


@pytest.mark.parametrize(("climbs_by", "leaks"), [(0.13, True), (-0.13, True), (0.17, False), (-0.17, False)])
def test_a_cabin_climbs_a_little_while_a_line_leaks_to_it(climbs_by: float, leaks: bool) -> None:
    """What rests at quite another pressure than the exponential goes to is no cabin into which the line leaks."""
    flight = made_flight(names=("p_static", "q_impact", "tat"))
    static, impact, tat = (flight.channels[name].values for name in ("p_static", "q_impact", "tat"))
    since_s = flight.time_s - ONSET_S
    outside = static[since_s >= 0.0][0]
    change = pressure_at(2500.0) - outside
    gone = -np.expm1(-np.maximum(since_s, 0.0) / 5.0) + climbs_by * np.clip((since_s - 21.0) / 5.0, 0.0, 1.0)
    line = np.where(since_s >= 0.0, outside + change * gone, static)
    made = channels_of(line, np.maximum(static + impact - line, 1.0), tat)
    log = made_log(flight.time_s, {"altitude": "m"}, altitude=made["altitude"], cas=made["cas"])
    faults = [finding.fault for finding in find_holds(log, 0.0, 600.0).findings]
    assert ("static_leak" in faults) is leaks


@pytest.mark.parametrize(("slower_by", "answer"), [(0.12, False), (0.18, None), (0.27, None), (0.34, True)])
def test_an_aircraft_brakes_that_loses_half_of_what_its_airspeed_loses(slower_by: float, answer: bool | None) -> None:
    """15 % of the impact pressure are 39 % of the speed: half of the 61 % that it loses are 31 %, a quarter 15 %."""
    time_s, speed, p_static = np.arange(60.0), 80.0, 80_000.0
    level = 0.5 * p_static / (287.05 * 265.0) * speed**2
    rate = slower_by * speed / 20.0
    ground_speed = speed - rate * np.clip(time_s - 20.0, 0.0, 20.0)
    assert brakes(made_log(time_s, {}, ground_speed=ground_speed), 20.0, 40.0, level, p_static) is answer
    units = {"longitudinal_acc": "m/s^2", "pitch": "rad"}
    pitch = np.full(60, 0.05)
    felt = made_log(time_s, units, longitudinal_acc=G * np.sin(pitch) - rate, pitch=pitch)
    assert brakes(felt, 20.0, 40.0, level, p_static) is answer
    assert brakes(made_log(time_s, {}, cas=ground_speed), 20.0, 40.0, level, p_static) is None


@pytest.mark.realdata
def test_a_tube_that_stays_blocked_over_landings_is_no_calm_flight(flights: Path):
    """True airspeed in whole knots: what is still after the next take-off is the same hold, not how calm it flies."""
    log = read_log(flights / "reader_samples" / "g1000_c172.csv")
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1])
    assert find_holds(log, start_s, stop_s).findings == ()
    blocked = inject(log, [Fault(shape="pitot_blocked", onset_s=51_500.0)])
    found = find_holds(blocked, start_s, stop_s).findings
    assert {one.fault for one in found} == {"pitot_blocked"}
    assert found[0].onset_s == pytest.approx(51_500.0, abs=5.0)
