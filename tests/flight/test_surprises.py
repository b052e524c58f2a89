"""Ordinary causes that no finder proposes: what moves as they do is told, what a fault does as well is left alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_events import event_of
from made_journeys import WIND, made_journey

from bfi_cli.faults import parse_spec
from bfi_cli.flight.bench import Bench, Place, bench_of
from bfi_cli.flight.judge import ordinary_of
from bfi_cli.flight.model import flight_model
from bfi_cli.flight.result import Event, OrdinaryEvent
from bfi_cli.flight.seconds import seconds_of
from bfi_cli.flight.surprises import (
    ICY,
    PROPOSED,
    TOLD,
    ChangeGains,
    change_gains,
    slow_losses,
    sudden_errors,
    sudden_winds,
    surprising_events,
)
from bfi_cli.flight.tables import ALTIMETER_SET
from bfi_cli.flight.weight import Ordinary
from bfi_cli.flightlog.injection import inject
from bfi_cli.flightlog.phases import Phase
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels import FloatArray

AT_S = 420.0
# From cruise on, and the longer part in which flaps are told from what a manoeuvre makes of the lift.
CRUISE, FROM_TAKE_OFF, WHOLE = (200.0, AT_S + 120.0), (None, AT_S + 160.0), (None, None)
# Where no whole flight is asked for: a temperature, of which every law of a line has several, and what adds little.
LEFT_OUT = ("sat", "tat", "elevator", "longitudinal_acc")
FLAPS = {"aoa": -0.03, "pitch": -0.03}  # of which the lift is the same
KNOB = {"altitude": 60.0}


def front(since: FloatArray) -> FloatArray:
    """A wind that changes by 8 m/s in 10 s."""
    return 8.0 * np.clip(since / 10.0, 0.0, 1.0)


def erection(since: FloatArray, size: float = 0.06) -> FloatArray:
    """An error of a gyro horizon that comes in 5 s and settles within a minute."""
    return size * np.clip(since / 5.0, 0.0, 1.0) * np.exp(-np.maximum(since - 5.0, 0.0) / 60.0)


def gusts_from_the_side(since: FloatArray) -> FloatArray:
    """What gusts make of a heading: two thirds of a degree for a few seconds."""
    return 0.012 * np.convolve(np.random.default_rng(5).standard_normal(since.size), np.ones(3) / np.sqrt(3.0), "same")


def bench_with(
    steps: Mapping[str, float | Callable[[FloatArray], FloatArray]], part: tuple[float | None, float | None] = CRUISE
) -> Bench:
    """Return a flight in which some channels read more from a time on: by a constant, or by a course."""
    log = made_journey(rate_hz=1.0).window(*part)
    since = log.time_s - AT_S
    channels = {name: log.channels[name] for name in log.channels if part == WHOLE or name not in LEFT_OUT}
    if "yaw" in steps:
        north, east = (
            channels[f"velocity_{to}"].values - blows for to, blows in zip(("north", "east"), WIND, strict=True)
        )
        channels["yaw"] = replace(channels["roll"], values=frozen_array(np.arctan2(east, north)))
    for name, size in steps.items():
        more = size(since) if callable(size) else size * (since >= 0.0)
        channels[name] = replace(channels[name], values=frozen_array(channels[name].values + more))
    seconds = seconds_of(replace(log, channels=channels))
    assert seconds is not None
    model = flight_model(seconds)
    assert model is not None
    return bench_of(model)


def told_in(bench: Bench, *, phases: Sequence[Phase] = (), beside: Sequence[Event] = ()) -> list[OrdinaryEvent]:
    return list(surprising_events(bench, phases, beside, change_gains(bench)))


@pytest.fixture(scope="module")
def with_flaps() -> Bench:
    return bench_with(FLAPS, FROM_TAKE_OFF)


@pytest.fixture(scope="module")
def with_knob() -> Bench:
    return bench_with(KNOB)


def test_nothing_surprises_in_a_healthy_flight() -> None:
    assert told_in(bench_with({}, WHOLE)) == []


def test_flaps_are_told_with_time_and_size(with_flaps: Bench) -> None:
    (event,) = told_in(with_flaps)
    assert (event.cause, event.looks_like, event.unit) == ("flaps", "", "rad")
    assert event.from_s == pytest.approx(AT_S, abs=3.0)
    assert event.magnitude == pytest.approx(-0.03, rel=0.25)
    assert event.evidence["gain"] > TOLD
    assert event.evidence["margin"] < 0.0


def test_a_jump_is_worth_most_where_it_is(with_flaps: Bench) -> None:
    gains = change_gains(with_flaps).causes["flaps"].max(axis=0)
    assert with_flaps.model.time_s[np.argmax(gains)] == pytest.approx(AT_S, abs=2.0)


def test_nothing_is_told_where_the_rows_are_no_functions_of_the_states(with_flaps: Bench) -> None:
    phase = Phase(phase="parabola", from_s=AT_S - 20.0, to_s=AT_S + 20.0)
    assert list(told_in(with_flaps, phases=(phase,))) == []


@pytest.mark.parametrize(("channel", "told"), [("tas", False), ("yaw", True)])
def test_nothing_is_told_while_air_data_are_wrong(with_flaps: Bench, channel: str, told: bool) -> None:
    declared = event_of(channel, AT_S - 100.0, "declared")
    assert bool(list(told_in(with_flaps, beside=[declared]))) == told


@pytest.mark.parametrize(("beside", "told"), [((), False), ((("pitch", AT_S),), False), ((("altitude", AT_S),), True)])
def test_what_an_error_of_a_channel_does_as_well_is_told_beside_its_suspicion_alone(
    with_knob: Bench, beside: tuple[tuple[str, float], ...], told: bool
) -> None:
    events: list[OrdinaryEvent] = told_in(with_knob, beside=[event_of(*each) for each in beside])
    assert [(event.cause, event.looks_like) for event in events] == ([("altimeter_set", "altitude")] if told else [])
    for event in events:
        assert event.magnitude == pytest.approx(60.0, rel=0.1)


def test_gusts_from_the_side_make_no_deviation_of_the_compass() -> None:
    """A heading that swings is none that errs: in the loadings it had a scale and a deviation cancel its own swings."""
    bench = bench_with({"yaw": gusts_from_the_side})
    end = max(bench.checks)
    mean, covariance = bench.checks[end]
    for name in ("tas_scale", "deviation_sine", "deviation_cosine"):
        k = bench.model.state(name)
        assert abs(mean[k]) < 3.0 * np.sqrt(covariance[k, k]), name


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("channels", "cause", "size"),
    [
        ({"velocity_north": front, "yaw": np.zeros_like}, "wind", 8.0),
        ({"pitch": erection}, "attitude_settles", 0.04),
    ],
)
def test_what_comes_within_seconds_is_told(
    channels: Mapping[str, Callable[[FloatArray], FloatArray]], cause: str, size: float
) -> None:
    (event,) = told_in(bench_with(channels))
    assert (event.cause, event.looks_like) == (cause, "")
    assert event.from_s == pytest.approx(AT_S, abs=10.0)
    assert event.magnitude == pytest.approx(size, rel=0.3)


@pytest.mark.parametrize(
    ("over_none", "over_another", "told"),
    [(17.0, 5e20, False), (23.0, 5e20, True), (60.0, 5e3, False), (60.0, 3e4, True)],
)
def test_a_cause_is_told_that_is_clearly_better_than_none_and_ten_thousand_times_as_likely_as_another(
    with_flaps: Bench, monkeypatch: pytest.MonkeyPatch, over_none: float, over_another: float, told: bool
) -> None:
    """Flaps whose log density were so much above none, and that were so many times as likely as another cause."""

    def weighed(place: Place) -> Ordinary:
        return replace(ordinary_of(place), gain=over_none, lead=float(np.log(over_another)))

    monkeypatch.setattr("bfi_cli.flight.surprises.ordinary_of", weighed)
    assert [event.cause for event in told_in(with_flaps)] == (["flaps"] if told else [])


@pytest.mark.parametrize(("size", "told"), [(0.21, True), (0.25, False)])
def test_an_attitude_settles_by_nine_degrees_at_most(size: float, told: bool) -> None:
    """Of the error some two thirds are seen where its jump is read, in half a minute in which it settles."""
    events = told_in(bench_with({"pitch": lambda since: erection(since, size)}))
    assert [event.cause for event in events] == (["attitude_settles"] if told else [])
    for event in events:
        assert np.degrees(event.magnitude) == pytest.approx(7.8, abs=0.8)


@pytest.mark.parametrize(("course", "is_sudden"), [(lambda since: 8.0 * (since >= 0.0), True), (front, False)])
def test_a_wind_that_changes_at_once_is_no_front(course: Callable[[FloatArray], FloatArray], is_sudden: bool) -> None:
    bench = bench_with({"velocity_north": course, "yaw": np.zeros_like})
    sudden = list(sudden_winds(bench, (), change_gains(bench)))
    assert [at_s for at_s, _ in sudden] == ([pytest.approx(AT_S, abs=1.0)] if is_sudden else [])


STEPS = {"tas": 4.0, "mach": 0.02, "pitch": 0.1, "aoa": 0.03, "normal_acc": 1.5, "altitude_rate": 6.0}


@pytest.mark.parametrize(("channel", "size"), STEPS.items())
def test_a_channel_that_errs_from_one_second_on_is_proposed_there(channel: str, size: float) -> None:
    bench = bench_with({channel: size})
    ((name, at_s, gain),) = sudden_errors(bench, (), change_gains(bench))
    assert (name, at_s) == (channel, pytest.approx(AT_S, abs=2.0))
    assert gain > PROPOSED


@pytest.mark.parametrize(
    "steps", [{}, FLAPS, {"velocity_north": front}, {"pitch": lambda since: erection(since, 0.02)}]
)
def test_what_is_ordinary_is_no_error_of_a_channel(steps: Mapping[str, Any]) -> None:
    bench = bench_with(steps, FROM_TAKE_OFF)
    assert list(sudden_errors(bench, (), change_gains(bench))) == []


def test_a_step_of_altitude_is_proposed_beside_a_knob_that_nobody_recorded() -> None:
    altitude, tas = np.zeros((2, 580)), np.zeros((2, 580))
    altitude[0, 100], tas[0, 300] = 100.0, 100.0
    bench: Any = SimpleNamespace(model=SimpleNamespace(time_s=np.arange(580.0)))
    causes = {"": np.zeros((2, 580)), ALTIMETER_SET: altitude, "wind": tas}
    proposed = sudden_errors(bench, (), ChangeGains(causes=causes, faults={"altitude": altitude, "tas": tas}, ice=tas))
    assert list(proposed) == [("altitude", 100.0, 100.0)]


@pytest.mark.parametrize(("spec", "proposes"), [("pitot_icing,magnitude=0.003", True), ("", False)])
def test_ice_is_proposed_about_its_onset(spec: str, proposes: bool) -> None:
    log = made_journey(rate_hz=1.0)
    if spec:
        log = inject(log, [parse_spec(f"{spec},onset_s={AT_S}")])
    seconds = seconds_of(log.window(200.0, AT_S + 200.0))
    assert seconds is not None
    model = flight_model(seconds)
    assert model is not None
    bench = bench_of(model)
    losses = list(slow_losses(bench, change_gains(bench)))
    assert bool(losses) == proposes
    for at_s, gain in losses[:1]:
        assert at_s == pytest.approx(AT_S, abs=90.0)
        assert gain > ICY


@pytest.mark.parametrize(("gain", "proposed"), [(ICY + 6.0, [(300.0, ICY + 1.0)]), (ICY + 4.0, [])])
def test_ice_is_proposed_from_a_log_density_over_any_ordinary_change(gain: float, proposed: list[Any]) -> None:
    none, front, ice = np.zeros((2, 580)), np.zeros((2, 580)), np.zeros(580)
    front[0, 300], ice[300] = 5.0, gain
    bench: Any = SimpleNamespace(model=SimpleNamespace(time_s=np.arange(580.0)))
    gains = ChangeGains(causes={"": none, "wind": front}, faults={}, ice=ice)
    assert list(slow_losses(bench, gains)) == proposed
