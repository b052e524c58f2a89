"""What is decided from what a flight model says of places: each rule just inside and just outside of its number."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_events import event_of

from bfi_cli.config import Config
from bfi_cli.flight import placing, proposals, weighing
from bfi_cli.flight.judge import Judgement
from bfi_cli.flight.parity.finding import Stage
from bfi_cli.flight.result import Event
from bfi_cli.flight.timing import Timing
from bfi_cli.flight.weighing import Weighing, weigh_events
from bfi_cli.flight.weight import Weight

N = 1000
ROWS = ("ground_speed", "tas", "altitude", "pitch", "sat")
AT_S = 500.0


def weight(fault: str = "tas", margin: float = 100.0, **changes: Any) -> Weight:
    return Weight(fault=fault, margin=margin, **{"shares": {}, "size": 4.0, "growth_s": 0.0, **changes})


def says(*weights: Weight) -> Judgement:
    return Judgement(weights=weights, cause="", gain=0.0)


@dataclass
class Model:
    """A model of a flight that says of every place what it is told to, and what it was asked.

    Attributes
    ----------
    judged : (onset, until) of the places that were weighed; sought : onsets of those that were sought anew.
    moves : ordinary causes that may explain an event.
    hidden : (from, to) without the rows of a known fault; unlevelled : seconds of which no level of noise was taken.
    """

    judgement: Callable[[float], Judgement] = lambda onset_s: says(weight())
    timing: Callable[[float], Timing | None] = lambda onset_s: None
    judged: list[tuple[float, float]] = field(default_factory=list)
    sought: list[float] = field(default_factory=list)
    hidden: list[tuple[float, float]] = field(default_factory=list)
    moves: tuple[str, ...] = ()
    unlevelled: int = 0


@pytest.fixture
def weighed(monkeypatch: pytest.MonkeyPatch) -> Callable[[Model, Sequence[Event]], Weighing]:
    """Return what weighs events by such a model."""

    def answer(model: Model, events: Sequence[Event]) -> Weighing:
        frame = SimpleNamespace(airborne=np.ones(N, dtype=bool))
        flown: Any = SimpleNamespace(n=N, time_s=np.arange(float(N)), rows=ROWS, frame=frame)
        record = SimpleNamespace(airspeed="tas")
        flown.seconds = SimpleNamespace(recorded=ROWS, time_s=flown.time_s, record=record, channels=())

        def judge(bench: Any, onset_s: float, offset_s: float | None, *, until_s: float, **named: Any) -> Judgement:
            model.judged.append((onset_s, until_s))
            return model.judgement(onset_s)

        def timing_of(bench: Any, fault: Weight, onset_s: float, *args: Any, **until: Any) -> Timing | None:
            model.sought.append(onset_s)
            return model.timing(onset_s)

        def bench_of(of: Any, *, without: Any, causes: Any) -> Any:
            model.unlevelled = 0 if without is None else int(without.sum())
            return bench

        def hide(rows: Any, from_s: float, to_s: float) -> Any:
            model.hidden.append((from_s, to_s))
            return bench

        bench = SimpleNamespace(model=flown, without=hide)
        replaced: dict[str, Any] = {
            "seconds_of": lambda log: flown.seconds,
            "flight_model": lambda seconds, **flown_in: flown,
            "explains": lambda bench, cause, rows: cause in model.moves,
            "bench_of": bench_of,
            "judge": judge,
            "timing_of": timing_of,
        }
        replaced |= dict.fromkeys(("is_on_ground", "is_set"), lambda *args: False)
        nothing = (
            "gross_errors",
            "oscillating_events",
            "sudden_errors",
            "sudden_winds",
            "slow_losses",
            "surprising_events",
            "rests_about",
        )
        replaced |= dict.fromkeys(nothing, lambda *args: ())
        replaced |= {
            "change_gains": lambda bench: None,
            "causes_of": lambda model: {},
            "noisy_events": lambda *args: (),
            "begun_before": lambda *args, **sure: None,
        }
        for name, stub in replaced.items():
            for module in (weighing, proposals, placing):
                monkeypatch.setattr(module, name, stub, raising=False)
        flight: Any = SimpleNamespace(
            log=SimpleNamespace(rate_hz=10.0, channels={}), phases=(), from_s=0.0, to_s=float(N)
        )
        return weigh_events(flight, events, Config().diagnose)

    return answer


@pytest.mark.parametrize(("margin", "state"), [(20.5, "declared"), (19.5, "suspected")])
def test_a_fault_is_declared_from_a_log_density_of_twenty_on(weighed: Any, margin: float, state: str):
    model = Model(judgement=lambda onset_s: says(weight("pitch", margin=margin)))
    (event,) = weighed(model, [event_of("pitch", AT_S, "declared")]).events
    assert event.state == state


@pytest.mark.parametrize(("stage", "state"), [("static relations", "declared"), ("parity", None)])
def test_an_equation_of_a_temperature_is_no_cold_layer(weighed: Any, stage: Stage, state: str | None):
    """The model of a flight takes any jump of the temperature for one of the air, and knows no equation of it."""
    layered = replace(says(weight("sat", margin=-30.0)), cause="temperature", gain=50.0)
    step = replace(event_of("sat", AT_S, "declared"), stages=(stage,), channels=("sat",))
    answer = weighed(Model(judgement=lambda onset_s: layered, moves=("temperature",)), [step])
    assert [event.state for event in answer.events] == ([] if state is None else [state])
    assert [event.cause for event in answer.ordinary] == (["temperature"] if state is None else [])


@pytest.mark.parametrize(("cause", "state"), [("wind", "suspected"), ("flaps", "declared")])
def test_inertia_knows_no_more_of_a_wind_that_changes(weighed: Any, cause: str, state: str):
    """An airspeed moves against the accelerations in a front as by an error; flaps do not move it so."""
    met = replace(says(weight(margin=-5.0)), cause=cause, gain=100.0)
    step = replace(event_of("tas", AT_S, "declared"), evidence={"kinematics": 40.0, "ground_speed": 40.0})
    (event,) = weighed(Model(judgement=lambda onset_s: met, moves=(cause,)), [step]).events
    assert event.state == state
    assert (cause in event.among) is (state == "suspected")


@pytest.mark.parametrize(("margin", "state"), [(-5.0, "suspected"), (25.0, "declared")])
def test_a_line_that_only_seems_to_rest_is_declared_by_no_rate(weighed: Any, margin: float, state: str):
    held = replace(event_of("static_blocked", AT_S, "declared"), stages=("holds",), channels=("altitude",))
    judgement = says(weight("static_blocked", margin=margin, growth_s=None))
    (event,) = weighed(Model(judgement=lambda onset_s: judgement), [held]).events
    assert event.state == state


@pytest.mark.parametrize(
    ("margin", "other_s", "state"),
    [
        (301.0, None, "declared"),
        (299.0, None, "suspected"),  # fifteen times twenty
        (301.0, AT_S - 61.0, "declared"),
        (301.0, AT_S - 59.0, "suspected"),  # beside another what it shows may be that's
    ],
)
def test_what_is_suspected_is_declared_by_fifteen_times_as_much_where_it_is_alone(
    weighed: Any, margin: float, other_s: float | None, state: str
):
    model = Model(judgement=lambda onset_s: says(weight(margin=margin), weight("pitch", margin=10.0)))
    beside = [] if other_s is None else [event_of("pitch", other_s)]
    answers = weighed(model, [event_of("tas", AT_S), *beside]).events
    assert answers[0].state == state


@pytest.mark.parametrize(("apart_s", "until_s"), [(59.0, float(N)), (61.0, AT_S + 41.0)])
def test_a_fault_is_weighed_until_twenty_seconds_before_the_next(weighed: Any, apart_s: float, until_s: float):
    model = Model(judgement=lambda onset_s: says(weight(), weight("pitch")))
    weighed(model, [event_of("tas", AT_S, "declared"), event_of("pitch", AT_S + apart_s, "declared")])
    assert model.judged[0] == (AT_S, until_s)


def test_rows_of_a_known_fault_are_left_out_from_before_it_until_after_it(weighed: Any):
    """Twenty seconds that its onset may be earlier, and ten in which filters still act."""
    model = Model()
    weighed(model, [replace(event_of("tas", AT_S, "declared"), offset_s=600.0)])
    assert model.hidden == [(AT_S - 20.0, 610.0)]


def test_no_level_of_the_noise_is_taken_within_ninety_seconds_of_a_candidate(weighed: Any):
    model = Model()
    weighed(model, [event_of("tas", AT_S)])
    assert model.unlevelled == 179


@pytest.mark.parametrize(
    ("shares", "speaks"),
    [
        ({"tas": 100.0, "pitch": -5.5}, True),
        ({"tas": 100.0, "pitch": -5.1}, False),  # a twentieth of all that is said
        ({"tas": 20.0, "pitch": -3.1}, True),
        ({"tas": 20.0, "pitch": -2.9}, False),  # three
    ],
)
def test_a_channel_speaks_against_a_fault_by_a_share_of_all_that_is_said(
    weighed: Any, shares: dict[str, float], speaks: bool
):
    model = Model(judgement=lambda onset_s: says(weight(shares=shares)))
    (event,) = weighed(model, [event_of("tas", AT_S, "declared")]).events
    assert event.refuted_by == (("pitch",) if speaks else ())


@pytest.mark.parametrize(("dispersion", "is_sought"), [(4.1, True), (3.9, False)])
def test_an_error_twice_its_noise_is_none_that_a_course_describes(weighed: Any, dispersion: float, is_sought: bool):
    model = Model(judgement=lambda onset_s: says(weight(dispersion=dispersion)))
    weighed(model, [event_of("tas", AT_S, "declared")])
    assert bool(model.sought) == is_sought


@pytest.mark.parametrize(("by_s", "n_moves"), [(2.9, 0), (3.1, 6)])
def test_a_place_is_moved_until_it_rests_within_three_seconds_and_no_more_than_six_times(
    weighed: Any, by_s: float, n_moves: int
):
    def later(onset_s: float) -> Timing:
        return Timing(onset_s=onset_s + by_s, onset_ci95=(onset_s, onset_s), offset_s=None, weight=weight())

    model = Model(judgement=lambda onset_s: says(weight(dispersion=5.0)), timing=later)
    weighed(model, [event_of("tas", AT_S, "declared")])
    assert [onset_s for onset_s, _ in model.judged] == pytest.approx([AT_S + k * by_s for k in range(n_moves + 1)])


@pytest.mark.parametrize(("behind", "names"), [(2.30, ("tas", "pitch")), (2.31, ("tas",))])
def test_faults_are_alike_within_ten_to_one(behind: float, names: tuple[str, ...]):
    assert says(weight(), weight("pitch", margin=100.0 - behind)).among == names


def held_line(fault: str, channel: str) -> Event:
    """Return a line that is seen to rest from 500 to 700 s."""
    line = replace(event_of(fault, AT_S, "declared"), shape=fault, stages=("holds",), channels=(channel,))
    return replace(line, offset_s=AT_S + 200.0)


@pytest.mark.parametrize(("before", "onset_s"), [(25.0, AT_S), (15.0, AT_S + 45.0)])
def test_a_line_that_rests_in_calm_flight_is_placed_where_it_is_trapped(weighed: Any, before: float, onset_s: float):
    """Where the flight bears out that it rests from where it is seen to, it begins there, or as late as it may."""
    line = weight("pitot_blocked", growth_s=None)

    def at(onset_s: float) -> Judgement:
        return says(line if onset_s > AT_S else replace(line, margin=before))

    trapped = Timing(onset_s=AT_S + 45.0, onset_ci95=(AT_S + 43.0, AT_S + 47.0), offset_s=None, weight=line)
    model = Model(judgement=at, timing=lambda onset_s: trapped)
    (event,) = weighed(model, [held_line("pitot_blocked", "tas")]).events
    assert (event.state, event.onset_s, event.onset_ci95) == ("declared", onset_s, (AT_S, AT_S + 47.0))
    assert event.offset_s == AT_S + 200.0


@pytest.mark.parametrize(
    ("as_named", "best", "dispersion", "name"),
    [
        (19.0, "pitot_blocked", 3.9, "pitot_blocked"),
        (21.0, "pitot_blocked", 3.9, "static_leak"),
        (19.0, "pitot_blocked", 4.1, "static_leak"),
        (19.0, "tas", 3.9, "static_leak"),
    ],
)
def test_a_line_that_runs_out_is_another_where_the_flight_bears_out_that_alone(
    weighed: Any, as_named: float, best: str, dispersion: float, name: str
):
    rival = weight(best, margin=200.0, growth_s=None if best == "pitot_blocked" else 0.0, dispersion=dispersion)
    both = says(rival, weight("static_leak", margin=as_named, growth_s=None))
    (event,) = weighed(Model(judgement=lambda onset_s: both), [held_line("static_leak", "tas")]).events
    assert event.fault == name


def test_a_line_that_is_seen_to_rest_is_known_before_what_only_fits_as_well(weighed: Any):
    """Ice that a slower finder places a minute before it is what the line shows, and no fault of its own."""
    line = weight("pitot_blocked", growth_s=None)
    model = Model(judgement=lambda onset_s: says(line, weight("pitot_icing", margin=90.0, growth_s=None)))
    ice = replace(event_of("pitot_icing", AT_S - 10.0, "declared"), channels=("tas",))
    (event,) = weighed(model, [ice, held_line("pitot_blocked", "tas")]).events
    assert event.fault == "pitot_blocked"


@pytest.mark.parametrize(("after_s", "stands"), [(-1.1, True), (-0.9, False), (9.9, False), (10.1, True)])
@pytest.mark.parametrize("limit_s", [AT_S, AT_S + 200.0])
def test_what_jumps_out_where_a_line_fails_or_comes_back_is_of_the_line(
    weighed: Any, limit_s: float, after_s: float, stands: bool
):
    model = Model(judgement=lambda onset_s: says(weight("static_blocked", growth_s=None)))
    spike = replace(event_of("altitude", limit_s + after_s, "declared"), shape="spikes")
    events = weighed(model, [held_line("static_blocked", "altitude"), spike]).events
    assert len(events) == (2 if stands else 1)


@pytest.mark.parametrize(
    ("stage", "channel", "earliest_s", "stands"),
    [
        ("holds", "tas", AT_S + 199.0, False),
        ("holds", "tas", AT_S + 201.0, True),
        ("flight model", "tas", AT_S + 199.0, False),  # weighed after the step
        ("flight model", "pitch", AT_S + 199.0, True),
    ],
)
def test_what_steps_back_where_a_line_comes_back_is_of_the_line(
    weighed: Any, stage: Stage, channel: str, earliest_s: float, stands: bool
):
    """A step that may begin before the line is free again is its return."""
    model = Model(judgement=lambda onset_s: says(weight("pitot_blocked", growth_s=None), weight(channel, margin=90.0)))
    line = replace(held_line("pitot_blocked", "tas"), stages=(stage,))
    step = event_of(channel, AT_S + 200.5, "declared")
    step = replace(step, onset_ci95=(earliest_s, AT_S + 202.0), stages=("static relations",))
    names = {event.fault for event in weighed(model, [line, step]).events}
    assert names == ({"pitot_blocked", channel} if stands else {"pitot_blocked"})


@pytest.mark.parametrize(
    ("fault", "shape", "stage", "margin", "is_dated"),
    [
        ("pitot_icing", "drift", "parity", 21.0, True),
        ("pitot_icing", "drift", "parity", 19.0, False),
        ("pitot_icing", "ramp_hold", "parity", 21.0, False),
        ("pitot_icing", "drift", "static relations", 21.0, False),
        ("tas", "drift", "parity", 21.0, False),
    ],
)
def test_a_line_that_goes_on_losing_begins_by_the_flight(
    weighed: Any, fault: str, shape: str, stage: Stage, margin: float, is_dated: bool
):
    """Windows of a minute or more tell no onset of what grows as well as the likelihood does."""
    timing = Timing(
        onset_s=AT_S - 40.0, onset_ci95=(AT_S - 45.0, AT_S - 30.0), offset_s=None, weight=weight(fault, margin=margin)
    )
    model = Model(judgement=lambda onset_s: says(weight(fault)), timing=lambda onset_s: timing)
    (event,) = weighed(model, [replace(event_of(fault, AT_S, "declared"), stages=(stage,), shape=shape)]).events
    assert event.onset_s == (AT_S - 40.0 if is_dated else AT_S)
    assert event.onset_ci95 == ((AT_S - 45.0, AT_S - 30.0) if is_dated else (AT_S, AT_S))


@pytest.mark.parametrize(("stage", "state"), [("parity", "suspected"), ("static relations", "declared")])
def test_what_no_flight_before_it_can_confirm_is_suspected(weighed: Any, stage: Stage, state: str):
    model = Model(judgement=lambda onset_s: None)
    (event,) = weighed(model, [replace(event_of("tas", AT_S, "declared"), stages=(stage,))]).events
    assert event.state == state


def test_what_the_model_proposes_it_has_to_confirm(weighed: Any):
    model = Model(judgement=lambda onset_s: says(weight("tas", margin=19.0)))
    proposed = replace(event_of("tas", AT_S, "suspected"), stages=("flight model",))
    assert weighed(model, [proposed]).events == ()
    assert len(weighed(model, [replace(proposed, stages=("scan",))]).events) == 1
