"""What a finder proposes is declared no more surely than all that is recorded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_journeys import made_journey
from test_surprises import event_of

from bfi_cli.config import Config
from bfi_cli.faults import parse_spec
from bfi_cli.flight import proposals
from bfi_cli.flight.flight import flight_of
from bfi_cli.flight.gross import Gross
from bfi_cli.flight.weighing import weigh_events
from bfi_cli.flight.weight import DECLARED, Weight
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.injection import inject
from bfi_cli.flightlog.record import frozen_array

CHANNELS = ("cas", "altitude", "pitch")
FROM_S, TO_S, STEP_M = 200.0, 230.0, 10.0
ONSET_S, END_S = 420.0, 540.0
# What tells a step: without a temperature, of which every law of a line has several.
FEW = ("tas", "cas", "altitude", "pitch", "roll", "aoa", "normal_acc", "velocity_north", "velocity_east")


def made_part(from_s: float, to_s: float, names: tuple[str, ...] = FEW) -> FlightLog:
    log = made_journey(rate_hz=1.0).window(from_s, to_s)
    return replace(log, channels={name: log.channels[name] for name in names})


def test_a_line_that_seems_to_rest_between_coarse_steps_is_not_declared_against_the_record() -> None:
    log = made_part(0.0, 440.0, CHANNELS)
    coarse = np.round(log.channels["altitude"].values / STEP_M) * STEP_M
    channels = {**log.channels, "altitude": replace(log.channels["altitude"], values=frozen_array(coarse))}
    hold = replace(
        event_of("static_blocked", FROM_S, "declared"),
        channels=("altitude", "cas"),
        stages=("holds",),
        shape="static_blocked",
        offset_s=TO_S,
        window_s=(FROM_S, TO_S),
    )
    flight = flight_of(replace(log, channels=channels), Config())
    (answer,) = weigh_events(flight, [hold], Config().diagnose).events
    assert answer.margin is not None
    assert -DECLARED < answer.margin < 0.0
    assert answer.state == "suspected"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "proposed", "at_s"),
    [("pitot_blocked", "sat", 521.0), ("static_blocked", "static_leak", 480.0), ("pitot_blocked", "tas", 450.0)],
)
def test_a_line_that_rests_is_told_from_its_onset_to_its_end_whatever_of_it_stands_out(
    fault: str, proposed: str, at_s: float
) -> None:
    """Of a static temperature that is made of the airspeed a blocked tube gives back a step, and nothing else is."""
    made = made_part(200.0, 600.0, (*FEW, "sat", "tat"))
    blocked = inject(made, [parse_spec(f"{fault},onset_s={ONSET_S},offset_s=520")])
    log = replace(blocked, channels={name: blocked.channels[name] for name in blocked.channels if name != "tat"})
    step = replace(event_of(proposed, at_s, "declared"), stages=("static relations",))
    step = replace(step, channels=("altitude",) if fault == "static_blocked" else (proposed,))
    (answer,) = weigh_events(flight_of(log, Config()), [step], Config().diagnose).events
    assert answer.fault == fault
    assert answer.state == "declared"
    assert answer.onset_ci95[0] <= ONSET_S <= answer.onset_ci95[1]
    assert answer.offset_s == pytest.approx(520.0, abs=3.0)
    assert "sat" in answer.channels  # beside a port that rests it errs by 0.26 K, of 0.03 K of noise


def test_what_is_within_its_tolerance_is_told_where_the_record_confirms_it() -> None:
    healthy = made_part(330.0, 510.0)
    small = replace(event_of("tas", ONSET_S, "declared"), stages=("static relations",), beyond_tolerance=False)
    faulty = inject(healthy, [parse_spec(f"bias,channel=tas,magnitude=0.5,onset_s={ONSET_S}")])
    answers = {log: weigh_events(flight_of(log, Config()), [small], Config().diagnose) for log in (healthy, faulty)}
    assert answers[healthy].events == ()
    (refuted,) = answers[healthy].notes
    assert f"'tas' from {ONSET_S:.0f} s was proposed and is refuted" in refuted.text
    (event,) = answers[faulty].events
    assert event.margin is not None
    assert event.margin > DECLARED


@pytest.mark.parametrize(("fault", "n"), [("altitude_rate", 1), ("tas", 1), ("static_leak", 0), ("pitot_icing", 0)])
def test_an_error_of_one_channel_is_none_of_several_that_leave_together(
    fault: str, n: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    gross = Gross(from_s=FROM_S, to_s=TO_S, seconds=20)
    replaced = {
        "gross_errors": lambda bench: (gross,),
        "oscillating_events": lambda *given: (),
        "_event_of_gross": lambda *given: event_of("static_leak", FROM_S, "declared"),
    }
    for name, function in replaced.items():
        monkeypatch.setattr(proposals, name, function)
    lasting = replace(event_of(fault, FROM_S - 5.0, "declared"), channels=("tas", "altitude_rate"))
    given: Any = None
    assert len([*proposals.swinging_events(given, given, [lasting])]) == n


@pytest.mark.parametrize(("size", "proposed"), [(6.3, True), (0.5, False)])
def test_a_step_beyond_its_tolerance_that_no_finder_proposes_is_found_by_the_model(size: float, proposed: bool) -> None:
    healthy = made_part(300.0, 510.0)
    faulty = inject(healthy, [parse_spec(f"bias,channel=tas,magnitude={size},onset_s={ONSET_S}")])
    events = weigh_events(flight_of(faulty, Config()), [], Config().diagnose).events
    assert [event.fault for event in events] == (["tas"] if proposed else [])
    for event in events:
        assert event.state == "declared"
        assert event.stages == ("flight model",)
        assert event.onset_ci95[0] <= ONSET_S <= event.onset_ci95[1]
        assert event.magnitude == pytest.approx(size, abs=0.3)
        assert event.ci95 is not None


def test_the_model_proposes_no_step_of_what_an_event_has_wrong_already() -> None:
    healthy = made_part(330.0, 510.0)
    faulty = inject(healthy, [parse_spec(f"drift,channel=tas,magnitude=0.1,onset_s={ONSET_S}")])
    drift = replace(event_of("tas", ONSET_S, "declared"), shape="drift", stages=("static relations",))
    (answer,) = weigh_events(flight_of(faulty, Config()), [drift], Config().diagnose).events
    assert answer.fault == "tas"
    assert answer.shape == "drift"
    assert answer.margin is not None
    assert answer.margin > 10.0 * DECLARED  # of all that follows


def test_the_model_proposes_no_step_whose_return_a_finder_proposes(monkeypatch: pytest.MonkeyPatch) -> None:
    for courses in ("GROWTHS_S", "GROWN_S"):  # a step is told apart from what grows elsewhere
        monkeypatch.setattr(f"bfi_cli.flight.timing.{courses}", (0.0,))
    healthy = made_part(200.0, 600.0)
    faulty = inject(healthy, [parse_spec(f"bias,channel=aoa,magnitude=0.05,onset_s={ONSET_S},offset_s={END_S}")])
    back = replace(event_of("aoa", END_S, "suspected"), stages=("parity",), shape="bias", magnitude=-0.05)
    (answer,) = weigh_events(flight_of(faulty, Config()), [back], Config().diagnose).events
    assert answer.onset_s == pytest.approx(ONSET_S, abs=2.0)
    assert answer.offset_s == pytest.approx(END_S, abs=2.0)
    assert answer.state == "declared"


def test_what_comes_later_and_is_larger_makes_no_fault_of_a_suspicion() -> None:
    """A step of altitude that no finder proposes is nothing that an airspeed, suspected minutes before, explains."""
    log = made_part(200.0, 640.0, ("tas", "altitude", "pitch", "velocity_north", "velocity_east"))
    log = inject(log, [parse_spec(f"bias,channel=altitude,magnitude=100,onset_s={END_S}")])
    suspicion = replace(event_of("tas", 300.0, "suspected"), among=("tas", "static_leak"), stages=("parity",))
    flight = flight_of(log, Config())
    answers = {answer.fault: answer for answer in weigh_events(flight, [suspicion], Config().diagnose).events}
    assert answers["altitude"].onset_s == pytest.approx(END_S, abs=2.0)
    assert "altimeter_set" in answers["altitude"].among
    assert {answer.state for answer in answers.values()} == {"suspected"}


@pytest.mark.parametrize("is_recorded", [True, False])
def test_where_recorded_flaps_move_a_change_of_lift_is_theirs(is_recorded: bool) -> None:
    """It is told where no flaps are recorded, and nothing that needs telling where they are."""
    moved = [parse_spec(f"bias,channel={name},magnitude=0.05,onset_s={ONSET_S}") for name in ("aoa", "pitch")]
    log = inject(made_part(300.0, 560.0), moved)
    if is_recorded:
        flaps = replace(log.channels["aoa"], values=frozen_array(np.where(log.time_s < ONSET_S, 0.0, 0.2)))
        log = replace(log, channels={**log.channels, "flaps": replace(flaps, name="flaps")})
    answer = weigh_events(flight_of(log, Config()), (), Config().diagnose)
    assert answer.events == ()
    assert [event.cause for event in answer.ordinary] == ([] if is_recorded else ["flaps"])


def test_what_swings_behind_a_trapped_tube_is_no_water_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    end_s = 500.0
    log = inject(made_part(360.0, 540.0), [parse_spec(f"pitot_blocked,onset_s={ONSET_S},offset_s={end_s}")])
    water = replace(event_of("pitot_water", ONSET_S + 30.0, "declared"), shape="sine", offset_s=end_s - 20.0)
    monkeypatch.setattr(proposals, "oscillating_events", lambda *args: [water])
    hold = replace(
        event_of("pitot_blocked", ONSET_S, "declared"), stages=("holds",), shape="pitot_blocked", offset_s=end_s
    )
    events = weigh_events(flight_of(log, Config()), [hold], Config().diagnose).events
    assert [event.fault for event in events] == ["pitot_blocked"]


@pytest.mark.parametrize(("fault", "size"), [("pitot_icing", -0.36), ("pitot_leak", np.log(0.64))])
def test_an_airspeed_that_reads_four_fifths_has_lost_a_third_of_its_impact_pressure(fault: str, size: float):
    """V goes with its root: 80 m/s are read of 100."""
    model = SimpleNamespace(n=500, second=int, coefficients=SimpleNamespace(airspeed=np.full(500, 80.0)))
    event = replace(event_of(fault, 100.0, "declared"), channels=("tas",))
    loss = Weight(fault=fault, margin=1e3, shares={}, size=size)
    bench: Any = SimpleNamespace(model=model)
    assert proposals._airspeed_error(bench, event, loss) == {"tas": pytest.approx(-20.0)}
