"""The judge on a flight that is made up: what is injected wins, and a healthy place lets nothing win."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_journeys import WIND, made_journey

from bfi_cli.airdata import calibrated_airspeed, impact_pressure_of_cas, pressure_at
from bfi_cli.faults import parse_spec
from bfi_cli.flight import lines
from bfi_cli.flight.bench import Bench, bench_of, place_of, places_of, run_place
from bfi_cli.flight.fit import fitted_levels
from bfi_cli.flight.gross import gross_errors, swings_of
from bfi_cli.flight.judge import (
    Judgement,
    channel_faults,
    explains,
    is_on_ground,
    is_set,
    judge,
    judge_place,
    ordinary_of,
    rows_of,
)
from bfi_cli.flight.lines import rests_about
from bfi_cli.flight.model import FlightModel, flight_model
from bfi_cli.flight.seconds import filled, seconds_of
from bfi_cli.flight.tables import LEVELS
from bfi_cli.flight.weight import ALIKE, DECLARED, beside, memory
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.injection import inject
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.bounded_filter import Stack, filter_stack

ONSET_S = 420.0
STEP = f"bias,channel=tas,magnitude=4,onset_s={ONSET_S}"


def model_of(log: FlightLog) -> FlightModel:
    seconds = seconds_of(log)
    assert seconds is not None
    model = flight_model(seconds)
    assert model is not None
    return model


@pytest.fixture(scope="module")
def journey() -> FlightLog:
    return made_journey(rate_hz=2.0).window(None, 540.0)


@pytest.fixture(scope="module")
def healthy(journey: FlightLog) -> Bench:
    return bench_of(model_of(journey))


@pytest.fixture(scope="module")
def with_fault(journey: FlightLog) -> Callable[[str], Bench]:
    @cache
    def bench(spec: str) -> Bench:
        log = inject(journey, [parse_spec(spec, unit_of=lambda name: journey.channel(name).unit)])
        return bench_of(model_of(log))

    return bench


@pytest.fixture(scope="module")
def judged(with_fault: Callable[[str], Bench]) -> Callable[[str, str], Judgement]:
    """Return what is judged at the onset of a fault, made once for each: `judged(spec, fault)`."""

    @cache
    def at_the_onset(spec: str, fault: str) -> Judgement:
        judgement = judge(with_fault(spec), ONSET_S, None, named=(fault,))
        assert judgement is not None
        return judgement

    return at_the_onset


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("at_s", [ONSET_S, 350.0, 500.0])
def test_nothing_wins_on_a_healthy_flight(healthy: Bench, at_s: float) -> None:
    judgement = judge(healthy, at_s, None)
    assert judgement is not None
    assert all(one.margin < DECLARED for one in judgement.weights if not one.refused)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("spec", "fault", "size"),
    [
        (STEP, "tas", 4.0),
        (f"bias,channel=aoa,magnitude=0.03,onset_s={ONSET_S}", "aoa", 0.03),
        (f"pitot_leak,time_constant_s=60,onset_s={ONSET_S}", "pitot_leak", None),
        (f"drift,channel=cas,magnitude=0.05,onset_s={ONSET_S}", "cas", None),
        (f"bias,channel=normal_acc,magnitude=1,onset_s={ONSET_S}", "normal_acc", 1.0),
        (f"pitot_blocked,onset_s={ONSET_S}", "pitot_blocked", None),
        (f"static_blocked,onset_s={ONSET_S}", "static_blocked", None),
    ],
)
def test_what_is_injected_is_the_best_explanation(
    judged: Callable[[str, str], Judgement], spec: str, fault: str, size: float | None
) -> None:
    judgement = judged(spec, fault)
    weight = judgement.weight(fault)
    assert weight is not None
    assert weight.margin > DECLARED
    assert fault in judgement.among
    if size is not None:
        assert weight.sd is not None
        assert weight.size == pytest.approx(size, abs=max(5.0 * weight.sd, 0.05 * size))


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("is_made", [True, False])
def test_a_static_temperature_follows_the_airspeed_that_it_is_made_of(journey: FlightLog, is_made: bool) -> None:
    """Made of a total one and the Mach number that a blocked tube shows, it speaks for the tube, and no other line."""
    without = {name: channel for name, channel in journey.channels.items() if name != "tat"}
    log = inject(replace(journey, channels=without), [parse_spec(f"pitot_blocked,onset_s={ONSET_S}")])
    if is_made:
        made = inject(journey, [parse_spec(f"pitot_blocked,onset_s={ONSET_S}")])
        log = replace(made, channels={name: made.channels[name] for name in without})
    judgement = judge(bench_of(model_of(log)), ONSET_S, None)
    assert judgement is not None
    weight, leak = judgement.weights[0], judgement.weight("static_leak")
    assert weight.fault == "pitot_blocked"
    assert weight.heats == is_made
    assert weight.shares["sat"] > (DECLARED if is_made else -ALIKE)
    assert leak is not None
    assert leak.shares["sat"] < weight.shares["sat"] + ALIKE


@pytest.mark.first_rows(1)
def test_a_static_temperature_refutes_no_line_whose_airspeed_stays_out_until_its_end(journey: FlightLog) -> None:
    """What is read there is told by the fault, not by a straight line to what is read after it."""
    end_s = ONSET_S + 60.0
    log = inject(journey, [parse_spec(f"static_blocked,onset_s={ONSET_S},offset_s={end_s}")])
    out = (log.time_s > end_s - 20.0) & (log.time_s < end_s)
    tas = replace(log.channel("tas"), values=frozen_array(np.where(out, np.nan, log.channel("tas").values)))
    judgement = judge(bench_of(model_of(replace(log, channels={**log.channels, "tas": tas}))), ONSET_S, end_s)
    assert judgement is not None
    assert judgement.weights[0].fault == "static_blocked"
    assert judgement.weights[0].shares["sat"] > -ALIKE


def with_ground_speed_alone(log: FlightLog) -> FlightLog:
    """Return a log whose ground velocity is a ground speed, without its direction."""
    north, east = (log.channel(name) for name in ("velocity_north", "velocity_east"))
    size = replace(north, name="ground_speed", values=frozen_array(np.hypot(north.values, east.values)))
    kept = {name: channel for name, channel in log.channels.items() if not name.startswith("velocity")}
    return replace(log, channels={**kept, "ground_speed": size, "yaw": heading_of(log)})


def heading_of(log: FlightLog) -> Channel:
    north, east = (log.channel(name) for name in ("velocity_north", "velocity_east"))
    through_air = np.arctan2(east.values - WIND[1], north.values - WIND[0])
    return replace(log.channel("roll"), name="yaw", values=frozen_array(through_air))


@pytest.mark.first_rows(1)
def test_a_ground_speed_tells_the_airspeed_by_the_heading_where_no_track_is_recorded(journey: FlightLog) -> None:
    healthy = with_ground_speed_alone(journey)
    model = model_of(healthy)
    assert "ground_speed" in model.rows
    assert model.frame.wind == pytest.approx(WIND, abs=0.5)
    track = np.arctan2(*(filled(model_of(journey).seconds.channels[f"velocity_{to}"]) for to in ("east", "north")))
    flown = model.frame.airborne
    assert np.abs(np.angle(np.exp(1j * (model.coefficients.track - track))))[flown].max() < 0.05
    log = with_ground_speed_alone(inject(journey, [parse_spec(f"pitot_blocked,onset_s={ONSET_S}")]))
    judgement = judge(bench_of(model_of(log)), ONSET_S, None)
    assert judgement is not None
    assert judgement.weights[0].fault == "pitot_blocked"
    assert judgement.weights[0].shares["ground_speed"] > -ALIKE


@pytest.mark.first_rows(1)
def test_the_steps_of_an_altitude_refute_no_trapped_tube(journey: FlightLog) -> None:
    """Its static pressure is that of the height that is flown: a transponder's altitude is recorded in 100 ft."""
    log = inject(journey, [parse_spec(f"pitot_blocked,onset_s={ONSET_S},offset_s=500")])
    altitude = log.channel("altitude")
    steps = np.round(altitude.values / 30.48) * 30.48
    coarse = replace(altitude, values=frozen_array(steps))
    kept = {name: log.channels[name] for name in ("tas", "tat", "pitch", "roll", "velocity_north", "velocity_east")}
    judgement = judge(bench_of(model_of(replace(log, channels={**kept, "altitude": coarse}))), ONSET_S, 500.0)
    assert judgement is not None
    assert judgement.weights[0].fault == "pitot_blocked"
    assert judgement.weights[0].dispersion < 2.0


@pytest.mark.parametrize("fault", ["pitot_icing", "static_leak", "static_blocked"])
def test_what_a_line_would_show_at_a_place_is_that_of_the_whole_flight(
    monkeypatch: pytest.MonkeyPatch, healthy: Bench, fault: str
) -> None:
    place = place_of(healthy, 280.0, 290.0)
    assert place is not None
    course = 1e-3 * np.arange(place.n)
    course += healthy.model.coefficients.height[place.part] if fault == "static_blocked" else 0.0
    about = lines._corrected(place, fault, course)
    y, Z = about.y[place.inside], about.Z[place.inside]
    assert about.n < healthy.model.n
    monkeypatch.setattr("bfi_cli.flight.bench.SMOOTHED_S", healthy.model.n)
    whole = lines._corrected(place, fault, course)
    np.testing.assert_allclose(y, whole.y[place.inside], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(Z, whole.Z[place.inside], rtol=0.0, atol=1e-9)


def test_a_calibrated_airspeed_of_another_altitude_is_the_derivative_of_its_equation(healthy: Bench) -> None:
    """At a Mach number the impact pressure goes with the static one."""
    c = healthy.model.coefficients
    ratio = impact_pressure_of_cas(c.cas_share * c.airspeed) / pressure_at(c.height)
    above, below = (calibrated_airspeed(ratio * pressure_at(c.height + metres)) for metres in (1.0, -1.0))
    flown = healthy.model.frame.airborne
    np.testing.assert_allclose(c.cas_by_height[flown], 0.5 * (above - below)[flown], rtol=1e-3)
    assert channel_faults(healthy.model)["altitude"]["cas"][flown].min() > 0.0


@pytest.mark.slow
def test_spans_of_one_place_are_judged_on_the_same_samples(with_fault: Callable[[str], Bench]) -> None:
    """A fault without its end gains what no ordinary cause may explain there: with the ordinary it is worth less."""
    bench = with_fault(f"bias,channel=tas,magnitude=4,onset_s={ONSET_S},offset_s=520")
    places = places_of(bench, [(ONSET_S, 520.0), (ONSET_S, None)])
    with_end, without = ((ordinary := ordinary_of(place), judge_place(place, ordinary)) for place in places)
    same = judge(bench, ONSET_S, 520.0)
    assert same is not None
    assert with_end[1].weights[0].margin == pytest.approx(same.weights[0].margin)
    worth, least = (ordinary.log_likelihood + judged.weights[0].margin for ordinary, judged in (with_end, without))
    assert worth > least + DECLARED
    assert places_of(bench, [(1e4, None)]) == []
    assert places_of(bench, [(300.0, 330.0), (535.0, None)]) == []  # the second begins where the part ends


@pytest.mark.parametrize("lag_s", [0.0, lines.THERMOMETER_S, None])
@pytest.mark.parametrize("fault", ["pitot_leak", "pitot_icing", "static_leak"])
def test_a_line_that_loses_nothing_leaves_the_temperature_as_it_is(
    healthy: Bench, fault: str, lag_s: float | None
) -> None:
    """Without a fault its row is that of the flight, which nothing can gain by."""
    place = place_of(healthy, ONSET_S, None)
    assert place is not None
    law = next(law for law in lines.LAWS if law.fault == fault)
    rows = lines._with_heat(lines._about((law, place), np.zeros(place.n), 2), lag_s)
    sat = healthy.model.row("sat")
    np.testing.assert_allclose(rows.y[:, sat], healthy.y[place.part, sat], atol=1e-9)
    np.testing.assert_allclose(rows.R[:, sat], place.R[:, sat], atol=1e-9)
    np.testing.assert_allclose(rows.Z[:, sat], healthy.model.Z[place.part, sat], atol=1e-9)


@pytest.mark.parametrize(("strays", "speed", "until_s"), [(1, 50.0, 301.0), (2, 50.0, 200.0), (2, 0.0, 301.0)])
def test_a_trapped_pressure_strays_from_itself_once_and_never_twice(strays: int, speed: float, until_s: float) -> None:
    """It rests from 100 to 300 s, but for seconds in which it is ten standard deviations away, or nothing is read."""
    moves = 50.0 * np.abs(np.clip(np.arange(400.0), 100.0, 300.0) - np.arange(400.0))
    pressure = 9e4 + moves + np.random.default_rng(0).standard_normal(400)
    away = slice(200, 200 + strays)
    pressure[away] += 10.0
    y = np.full((400, 2), 50.0)
    y[away, 0] = speed
    air = SimpleNamespace(p_total=pressure, p_static=9e4 + 50.0 * np.arange(400.0))
    seconds = SimpleNamespace(air=air, rounding={}, channels={}, record=SimpleNamespace(airspeed="tas"))
    frame = SimpleNamespace(airborne=np.ones(400, dtype=bool), middle_speed=50.0)
    rows = ("tas", "altitude")
    model = SimpleNamespace(
        n=400,
        time_s=np.arange(400.0),
        rows=rows,
        row=rows.index,
        frame=frame,
        seconds=seconds,
        coefficients=SimpleNamespace(height=np.full(400, 1000.0), airspeed=np.full(400, 50.0)),
        y=y,
    )
    bench: Any = SimpleNamespace(model=model)
    assert [*rests_about(bench, 150.0)] == [("pitot_blocked", 100.0, until_s)]


def test_errors_of_first_order_say_the_same_for_their_memory() -> None:
    """Of a correlation of 0.8 between neighbours the mean is known as that of a ninth of the samples."""
    rng, size = np.random.default_rng(0), np.zeros(20000)
    for k in range(1, size.size):
        size[k] = 0.8 * size[k - 1] + 0.1 * rng.standard_normal()
    place: Any = SimpleNamespace(
        during=np.arange(size.size) >= 100, bench=SimpleNamespace(model=SimpleNamespace(row={"tas": 0}.get))
    )
    assert memory(place, size[:, None], ["tas"]) == pytest.approx(9.0, rel=0.15)
    assert memory(place, rng.standard_normal((size.size, 1)), ["tas"]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_a_layer_of_other_air_refutes_no_line(journey: FlightLog) -> None:
    """A temperature of its own sensor jumps by 3 K while the tube ices, as it does in any flight."""
    iced = inject(journey, [parse_spec(f"pitot_icing,magnitude=0.006,onset_s={ONSET_S}")])
    layer = 3.0 * (journey.time_s > ONSET_S - 2.0)
    colder = {
        name: replace(iced.channels[name], values=frozen_array(iced.channels[name].values - layer))
        for name in ("sat", "tat")
    }
    judgement = judge(bench_of(model_of(replace(iced, channels={**iced.channels, **colder}))), ONSET_S, None)
    assert judgement is not None
    assert judgement.weights[0].fault == "pitot_icing"
    assert judgement.weights[0].margin > DECLARED


def test_what_may_happen_beside_a_fault_may_happen_without_one(journey: FlightLog) -> None:
    """Where a front is met as a climb begins an error of no size is worth nothing: no flight has that error."""
    since_s = np.maximum(journey.time_s - ONSET_S, 0.0)
    front, climb = {"velocity_north": 20.0, "velocity_east": -15.0}, {"altitude": 8.0 * since_s}
    added = {name: size * (since_s > 0.0) for name, size in {**front, "altitude_rate": 8.0}.items()} | climb
    moved = {name: journey.channel(name).values + more for name, more in added.items()}
    channels = {name: replace(journey.channels[name], values=frozen_array(moved[name])) for name in moved}
    place = place_of(bench_of(model_of(replace(journey, channels={**journey.channels, **channels}))), ONSET_S, None)
    assert place is not None
    ordinary = ordinary_of(place)
    assert ordinary.cause
    for row in ("altitude", "sat"):
        run = run_place(place, shocks=beside(place, ordinary, [row])[:, None])
        assert run.log_likelihood[0] <= np.nansum(ordinary.log_density) + 1e-6


@pytest.mark.slow
def test_a_blocked_tube_is_seen_where_one_airspeed_is_in_whole_knots(journey: FlightLog) -> None:
    """Airspeeds of the same pressures are held against each other, by the rounding of the coarser one."""
    knot = 1852.0 / 3600.0
    blocked = inject(journey, [parse_spec(f"pitot_blocked,onset_s={ONSET_S}")])
    tas = blocked.channel("tas")
    coarse = replace(tas, values=frozen_array(np.round(tas.values / knot) * knot))
    bench = bench_of(model_of(replace(blocked, channels={**blocked.channels, "tas": coarse})))
    judgement = judge(bench, ONSET_S, None)
    assert judgement is not None
    assert judgement.weights[0].fault == "pitot_blocked"
    assert judgement.weights[0].margin > DECLARED
    assert judgement.weights[0].shares["tas"] > -DECLARED


def test_without_an_attitude_no_parabola_is_a_gross_error(healthy: Bench) -> None:
    model = healthy.model
    innovation = healthy.innovation.copy()
    part = slice(400, 420)
    innovation[part, [model.row(name) for name in ("altitude", "altitude_rate", "tas")]] = 20.0
    for name in model.rows:
        if name not in ("altitude", "altitude_rate", "tas", "cas", "mach"):
            innovation[part, model.row(name)] = 0.0
    assert gross_errors(replace(healthy, innovation=innovation))
    unseen = replace(model, rows=tuple("yaw" if name == "pitch" else name for name in model.rows))
    assert not gross_errors(replace(healthy, model=unseen, innovation=innovation))


@pytest.mark.slow
def test_a_step_of_the_altitude_is_as_well_an_altimeter_that_is_set(with_fault: Callable[[str], Bench]) -> None:
    bench = with_fault(f"bias,channel=altitude,magnitude=40,onset_s={ONSET_S}")
    judgement = judge(bench, ONSET_S, None)
    assert judgement is not None
    assert judgement.cause == "altimeter_set"
    assert judgement.gain > DECLARED
    assert explains(bench, judgement.cause, rows_of(bench, ("altitude",)))
    weight = judgement.weight("altitude")
    assert weight is not None
    assert abs(weight.margin) < DECLARED


def test_margins_are_the_sums_of_their_shares_and_the_set_is_within_ten_to_one(
    judged: Callable[[str, str], Judgement],
) -> None:
    judgement = judged(STEP, "tas")
    assert all(one.margin == pytest.approx(sum(one.shares.values()), rel=1e-9) for one in judgement.weights)
    best = judgement.weights[0].margin
    assert judgement.among == tuple(
        one.fault for one in judgement.weights if not one.refused and one.margin >= best - ALIKE
    )


@pytest.mark.slow
def test_rows_of_a_known_fault_testify_no_more(with_fault: Callable[[str], Bench]) -> None:
    bench = with_fault(STEP)
    known = bench.without(rows_of(bench, ("tas",)), ONSET_S - 20.0, np.inf)
    judgement = judge(known, ONSET_S, None)
    assert judgement is not None
    assert all(one.margin < DECLARED for one in judgement.weights if not one.refused)


@pytest.mark.parametrize("name", ["cas", "mach"])
def test_the_row_of_the_airspeed_is_that_of_the_one_that_is_recorded(journey: FlightLog, name: str) -> None:
    others = {"tas", "cas", "mach"} - {name}
    channels = {at: channel for at, channel in journey.channels.items() if at not in others}
    assert rows_of(bench_of(model_of(replace(journey, channels=channels))), (name,)) == ("tas",)


def test_what_the_ground_shows_is_no_place_in_flight(healthy: Bench) -> None:
    assert is_on_ground(healthy, 20.0)
    assert not is_on_ground(healthy, ONSET_S)
    assert place_of(healthy, 20.0, None) is None


@pytest.mark.parametrize(("share", "is_read"), [(0.38, True), (0.32, False)])
def test_an_airspeed_that_shows_a_third_of_its_usual_one_reads_nothing(
    healthy: Bench, share: float, is_read: bool
) -> None:
    """No aircraft flies at a tenth of the lift it usually has: what such a reading says ends with its first minute."""
    model, y = healthy.model, healthy.y.copy()
    y[model.time_s >= ONSET_S, model.row("tas")] = share * model.frame.middle_speed
    place, whole = (place_of(bench, ONSET_S, None) for bench in (replace(healthy, y=y), healthy))
    assert place is not None
    assert whole is not None
    assert (place.n == whole.n) is is_read
    assert is_read or place.n - place.onset == 60


@pytest.mark.slow
def test_a_channel_that_is_missing_is_a_row_that_is_missing(journey: FlightLog) -> None:
    slim = replace(journey, channels={name: one for name, one in journey.channels.items() if name != "aoa"})
    model, whole = model_of(slim), model_of(journey)
    assert set(whole.rows) - set(model.rows) == {"aoa"}
    assert judge(bench_of(model), ONSET_S, None) is not None


def test_the_levels_of_a_flight_explain_it_better_than_typical_ones(journey: FlightLog) -> None:
    model = model_of(journey)
    levels = fitted_levels(model)
    first = int(np.flatnonzero(model.frame.airborne)[0])

    def log_likelihood(values: dict[str, float]) -> float:
        R, Q = model.noise(values)
        stack = Stack(y=model.y[first:, None], Z=model.Z[first:, None], R=R[first:, None], Q=Q[first:, None])
        run = filter_stack(stack, model.transition(), mean=model.start, covariance=model.start_covariance())
        return float(run.log_likelihood[0])

    assert log_likelihood(levels) > log_likelihood(model.levels)
    assert all(LEVELS[name].lowest <= value <= LEVELS[name].highest for name, value in levels.items())
    assert all(value == LEVELS[name].typical for name, value in levels.items() if not LEVELS[name].fitted)


def test_readings_of_a_line_that_come_and_go_are_found_with_their_ends(journey: FlightLog) -> None:
    """The static pressure is moved for three seconds of every eight: all that follows from it leaves and returns."""
    channels = dict(journey.channels)
    inside = (journey.time_s >= ONSET_S) & (journey.time_s < ONSET_S + 40.0) & ((journey.time_s - ONSET_S) % 8.0 < 3.0)
    moved = {"altitude": -60.0, "tas": -20.0, "cas": -18.0, "mach": -0.06, "altitude_rate": -15.0}
    for name, size in moved.items():
        channels[name] = replace(channels[name], values=channels[name].values + size * inside)
    bench = bench_of(model_of(replace(journey, channels=channels)))
    (gross,) = gross_errors(bench)
    assert gross.from_s == pytest.approx(ONSET_S, abs=3.0)
    assert gross.to_s == pytest.approx(ONSET_S + 35.0, abs=6.0)
    swings = swings_of(bench, gross)
    assert swings is not None
    weights, errors = swings
    assert weights[0].fault == "static_leak"
    assert weights[0].margin > DECLARED
    assert errors["altitude"] == pytest.approx(-60.0, abs=25.0)  # the aircraft itself moves by 12 m


def test_a_healthy_flight_has_no_gross_errors(healthy: Bench) -> None:
    assert gross_errors(healthy) == ()


def stamped(*, airborne_from_s: float = 0.0, knob_s: float = 0.0) -> Any:
    """Return a model of which only the time in flight, and when a knob is turned, is known."""
    time_s = np.arange(200.0)
    frame = SimpleNamespace(airborne=time_s >= airborne_from_s)
    second = partial(FlightModel.second, SimpleNamespace(time_s=time_s))
    return SimpleNamespace(model=SimpleNamespace(time_s=time_s, frame=frame, knob=time_s == knob_s, second=second))


def test_what_begins_within_ten_seconds_of_flight_is_no_matter_of_the_ground():
    bench = stamped(airborne_from_s=100.0)
    assert is_on_ground(bench, 0.0)  # before the middle of the first second
    assert is_on_ground(bench, 99.4)
    assert not is_on_ground(bench, 99.6)  # within a second that is flown
    landed: Any = SimpleNamespace(
        model=SimpleNamespace(**{**vars(bench.model), "frame": SimpleNamespace(airborne=bench.model.time_s < 100.0)})
    )
    assert not is_on_ground(landed, 109.4)
    assert is_on_ground(landed, 109.6)


@pytest.mark.parametrize(("at_s", "told"), [(115.0, True), (116.0, False), (85.0, True), (84.0, False)])
def test_a_setting_is_of_an_onset_within_fifteen_seconds(at_s: float, told: bool):
    assert is_set(stamped(knob_s=100.0), at_s) == told
