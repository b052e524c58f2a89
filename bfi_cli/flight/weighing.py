"""Events before one likelihood: what the finders propose is weighed against ordinary causes and against its rivals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from ..airdata import DEPENDS_ON
from ..config import Diagnose, KnownCause
from ..flightlog import FlightLog
from ..flightlog.phases import AIRBORNE, NO_AIRSPEED, spans_of
from ..kernels import TWO_SIDED_95
from ..kernels.runs import runs, within
from ..notes import Note
from ..quantities.channels import STANDARD, per_second
from .bench import AFTER_S, Bench, bench_of, place_of, places_of
from .flight import Flight
from .gross import FEWEST_S, Gross, gross_errors, swings_of
from .judge import (
    AFTER_END_S,
    BEFORE_NEXT_S,
    FROZEN,
    REFERENCES,
    SET_WITHIN_S,
    Judgement,
    causes_of,
    explains,
    is_on_ground,
    is_set,
    judge,
    judge_place,
    ordinary_of,
    rows_of,
    weights_of_channel,
    with_known,
)
from .lines import rests_about, weight_of_line
from .model import flight_model
from .naming import channels_of, repeat_advice
from .noise import noisy_events
from .oscillations import is_same_oscillation, oscillating_events
from .parity.finding import Stage
from .parity.record import over_seconds, seconds_of_samples
from .parity.sensors import AT_ONCE_EVIDENCE, PITCH_EVIDENCE
from .parity.windows import flight_stretches, overlaps
from .result import Event, OrdinaryEvent
from .seconds import filled, seconds_of
from .surprises import (
    TWINS,
    ChangeGains,
    change_gains,
    slow_losses,
    sudden_errors,
    sudden_winds,
    surprising_events,
)
from .tables import ALTIMETER_SET, FLAPS, ON_GROUND
from .tables import ORDINARY as CAUSES
from .timing import Timing, begun_before, timing_of
from .weight import ALIKE, Weight

# Log density over the best ordinary explanation above which a fault is declared: none of 14 healthy flights of seven
# aircraft has one of its own proposals above it (tests/measurements/test_judge.py).
DECLARED = 20.0
# Times as much, above which what a finder only suspects is declared: twice what a healthy light aircraft showed.
SURE = 15.0
# Seconds by which a next fault must be later to be left out of what is weighed.
APART_S = 60.0
SLOW = ("pitot_icing", "static_leak", "pitot_leak")
# About a candidate, in which no level of the flight's noise is taken.
ABOUT_S = 90.0
# Shapes that the seconds of a flight do not show: what is over within one, and what swings.
UNWEIGHED = ("dropout", "spikes", "frozen", "offset", "sine", "cosine", "pitot_water")
# Analyses that see no more of a flight than its model does; the others know inputs, or accelerations at the log's rate.
SEES_NO_MORE = {"static relations", "sensors", "flight model"}
MODEL: Stage = "flight model"
# About a stretch of gross errors: when an event that lasts is of it, what is shown, and how well its onset is known.
BESIDE_S, AROUND_S, ONSET_S = 60.0, 60.0, 3.0
LOSSES = ("pitot_icing", "pitot_leak", "pitot_water", "q_impact")  # of an impact pressure
# What comes back to a line: a gain of impact pressure, and a fall of the static one.
ENDED_BY = {"q_impact": ("pitot_icing", "pitot_leak", "static_leak"), "static_leak": ("static_leak",)}
# MOVING [1]: share of its travel by which a recorded flap or gear moves within a second: 3 % takes half a minute.
MOVING = 0.03
SIZED_S = 5  # before and after a step, when its size is read
EXACT = {"static relations", "sensors"}  # analyses by what holds exactly, or to the last bit
AIRSPEEDS = ("tas", "cas", "ias", "mach")
TEMPERATURES = ("sat", "tat")
# Of a pressure line its finder describes the course; the model tells which line it is.
LINES = (frozenset((*LOSSES, "pitot_blocked")), frozenset(("static_blocked", "static_leak")))
INERTIAL = "kinematics"  # the residual of the parity scan that rests on accelerometers
# A channel speaks against a fault by this share of all that is said, and at least by so much log density.
LOUD, AUDIBLE = 0.05, 3.0
# Moves of an event to where a fault begins, at most, s by which one is none, and the dispersion of a course from which
# on its place is sought anew: an error twice its noise is none that it describes.
MOVES, RESTS_S, UNDESCRIBED = 6, 3.0, 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighing:
    """Events that stand, ordinary ones, and what is said of those that were refuted."""

    events: tuple[Event, ...]
    ordinary: tuple[OrdinaryEvent, ...] = ()
    notes: tuple[Note, ...] = ()


def weigh_events(flight: Flight, events: Sequence[Event], config: Diagnose) -> Weighing:
    """Return events with their margins: declared, suspected, ordinary, or refuted by what else is recorded.

    Parameters
    ----------
    config : `events` are ordinary causes that the engineer states; without `judge` events stay as proposed.
    """
    if not config.judge:
        return Weighing(events=tuple(events))
    answer = _weighed_events(flight, events, config.events)
    return replace(answer, ordinary=(*map(_stated, config.events), *answer.ordinary))


def _weighed_events(flight: Flight, events: Sequence[Event], causes: Sequence[KnownCause]) -> Weighing:
    bench = _bench(flight, [event for event in events if _can_be_weighed(event)], causes)
    if bench is None:
        return Weighing(events=tuple(events))
    swinging = tuple(_swinging_events(flight, bench, events))
    events = [event for event in events if not any(is_same_oscillation(event, other) for other in swinging)]
    # What is only suspected, or within its tolerance, hides no other.
    hiding = [event for event in swinging if event.state == "declared" and event.beyond_tolerance is not False]
    gains, unweighed = change_gains(bench), bench
    known = [*hiding]
    bench = reduce(with_known, known, bench)
    events, returns = _placed_events(flight, bench, events, swinging, gains)
    answers: list[Event | OrdinaryEvent | Note] = list(events)
    # What is certain is in the model before the rest is weighed, what finders hold so first, in the order of time; a
    # line is before a channel about its onset, which may be its own, and one that is seen to rest before any other.
    order = [k for k, event in enumerate(events) if _can_be_weighed(event)]
    earlier_s = {k: APART_S * (bool(_line(events[k])) + ("holds" in events[k].stages)) for k in order}
    seen_s = {k: returns.get(k, events[k].onset_s) for k in order}
    order.sort(key=lambda k: (events[k].state != "declared", events[k].stages == (MODEL,), seen_s[k] - earlier_s[k]))
    for k in order:
        event = events[k]
        cause = next((cause for cause in known if _follows(bench, event, cause)), None)
        if cause is not None:
            # A line that is seen to rest is no after-effect of what only makes the same channels wrong.
            answers[k] = event if "holds" in event.stages and cause.stages != (MODEL,) else _after(event, cause)
            continue
        line = _line(event)
        rest = [events[j] for j in order if j != k and isinstance(answers[j], Event)]
        if k in returns:
            alike = [other for other in rest if _line(other) or other.fault == event.fault]
            cause = next((other for other in alike if abs(other.onset_s - event.onset_s) < APART_S), None)
            if cause is not None:
                answers[k] = _after(event, cause)
                continue
        others = [other.onset_s for other in (*hiding, *(each for each in rest if not line or _line(each) != line))]
        beside = [*(other.onset_s for other in known), *(seen_s[j] for j in order if j != k)]
        later_s = min((at_s for at_s in beside if at_s > event.onset_s + APART_S), default=np.inf)
        alone = not any(event.onset_s - APART_S < at_s < event.onset_s + AFTER_S for at_s in others)
        answer = answers[k] = _weighed(
            flight, bench, event, min(later_s - BEFORE_NEXT_S, flight.to_s), causes, known, may_be_sure=alone
        )
        if isinstance(answer, Event) and answer.state == "declared" and answer.margin is not None:
            # A later fault of its channels was this one, grown.
            for j, later in enumerate(answers):
                if not isinstance(later, Event) or later not in known or later.onset_s <= answer.onset_s:
                    continue
                is_of_it = _line(later) == _line(answer) or {*later.channels} <= {*answer.channels}
                if is_of_it and _follows(bench, later, answer):
                    answers[j] = _after(later, answer)
            known.append(answer)
            bench = with_known(bench, answer)
    for k, event in enumerate(events):
        if event.beyond_tolerance is False and _is_course(event):
            answers[k] = _weighed_deviation(bench, event, known, flight.to_s)
        cause = next((cause for cause in known if _is_its_jump(event, cause)), None)
        if cause is not None:
            answers[k] = _after(event, cause)
    gains = gains if bench is unweighed else change_gains(bench)
    stand = [*swinging, *(answer for answer in answers if isinstance(answer, Event))]
    late = _weighed_again(flight, bench, stand, causes, known, gains)
    return _weighing(flight, bench, (*swinging, *answers, *late), gains)


def _is_its_jump(event: Event, known: Event) -> bool:
    """Return whether a channel jumps out where a line that it is made of fails, or comes back."""
    if event.shape != "spikes" or not _line(known) or not {*event.channels} <= {*known.channels}:
        return False
    return any(-1.0 <= event.onset_s - at_s <= AFTER_END_S for at_s in (known.onset_s, known.until_s))


def _weighed_again(
    flight: Flight,
    bench: Bench,
    stand: Sequence[Event],
    causes: Sequence[KnownCause],
    known: Sequence[Event],
    gains: ChangeGains,
) -> Iterator[Event]:
    """Yield the steps that the model suspects where what a finder proposed has not stood."""
    for step in _sudden_errors(flight, bench, stand, gains):
        later_s = min((other.onset_s for other in stand if other.onset_s > step.onset_s), default=np.inf)
        until_s = min(later_s - BEFORE_NEXT_S, flight.to_s)
        step = replace(step, state="suspected")
        answer = _weighed(flight, bench, step, until_s, causes, known, may_be_sure=False)
        if isinstance(answer, Event):
            yield answer


def _placed_events(
    flight: Flight, bench: Bench, events: Sequence[Event], swinging: Sequence[Event], gains: ChangeGains
) -> tuple[list[Event], dict[int, float]]:
    """Return all events, each from its fault's onset, and by the number of each that was a return when that was."""
    placed = [*events, *_sudden_losses(flight, bench, (*swinging, *events), gains)]
    returns: dict[int, float] = {}
    for k, event in enumerate(placed):
        if _can_be_weighed(event):
            placed[k] = _as_trapped(bench, event, flight.to_s)
            begun = _begun_before(bench, placed[k], flight.to_s)
            if begun is not None:
                returns[k] = placed[k].onset_s
                placed[k] = _from_its_onset(bench, placed[k], begun)
    placed += _slow_losses(flight, bench, (*swinging, *placed), gains)
    return [*placed, *_sudden_errors(flight, bench, (*swinging, *placed), gains)], returns


def _weighing(
    flight: Flight, bench: Bench, answers: Sequence[Event | OrdinaryEvent | Note], gains: ChangeGains
) -> Weighing:
    """Return the answers by what they are, with what is ordinary where no finder looked.

    Parameters
    ----------
    gains : of `surprises.change_gains`.
    """
    stand = tuple(answer for answer in answers if isinstance(answer, Event))
    ordinary = [answer for answer in answers if isinstance(answer, OrdinaryEvent)]
    surprising = surprising_events(bench, flight.phases, stand, gains)
    noisy = noisy_events(flight.log, flight.phases, stand)
    ordinary += [event for event in (*surprising, *noisy) if not _is_told(event, ordinary, stand)]
    notes = tuple(answer for answer in answers if isinstance(answer, Note))
    return Weighing(events=stand, ordinary=tuple(ordinary), notes=notes)


def _swinging_events(flight: Flight, bench: Bench, events: Sequence[Event]) -> Iterator[Event]:
    """Yield what comes and goes: gross errors of a line that no event of a line is of, and oscillations.

    An error of one channel is none of several that leave together, however large its finder holds it to be.
    """
    line_events = [event for event in events if _line(event) and event.state == "declared" and _has_course(event)]
    for gross in gross_errors(bench):
        if not any(_is_of(event, gross) for event in line_events):
            swinging = _event_of_gross(flight, bench, gross)
            if swinging is not None:
                yield swinging
    # Behind a tube that is trapped, heights that swing make airspeeds swing.
    holds = [event for event in events if "holds" in event.stages and event.state == "declared"]
    held = [(event.onset_s, event.until_s) for event in holds]
    for swinging in oscillating_events(flight, bench, DECLARED):
        if not overlaps((swinging.onset_s, swinging.until_s), held):
            yield swinging


def _sudden_losses(flight: Flight, bench: Bench, events: Sequence[Event], gains: ChangeGains) -> Iterator[Event]:
    """Yield a suspected pitot line where the wind would change at once and no event is: fronts take some seconds."""
    events = list(events)
    for at_s, gain in sudden_winds(bench, flight.phases, gains):
        if not _is_about(at_s, events) and place_of(bench, at_s, None, flight.to_s) is not None:
            loss, speed = _proposed(flight, "q_impact", at_s, {"ground_speed": gain}), bench.model.coefficients.airspeed
            at = int(np.searchsorted(bench.model.time_s, at_s))
            before, after = speed[max(at - SIZED_S, 0)], speed[min(at + SIZED_S, bench.model.n - 1)]
            events.append(replace(loss, magnitude=float((after / before) ** 2 - 1.0), unit="1"))
            yield events[-1]


def _slow_losses(flight: Flight, bench: Bench, events: Sequence[Event], gains: ChangeGains) -> Iterator[Event]:
    """Yield a pitot line that loses by degrees where no event of a line is, from when it begins."""
    lines = [event for event in events if _line(event) and event.state == "declared"]
    for at_s, gain in slow_losses(bench, gains):
        if any(event.onset_s - APART_S < at_s < event.until_s + APART_S for event in lines):
            continue
        place = place_of(bench, at_s, None, flight.to_s)
        if place is None:
            continue
        straight = weight_of_line(place, ordinary_of(place), "pitot_icing")
        if straight.refused or straight.margin < SURE * DECLARED:
            continue
        event = replace(_proposed(flight, "pitot_icing", at_s, {"q_impact": gain}), state="declared")
        judgement = _judgement(bench, event, flight.to_s)
        if judgement is None or _sure_loss(judgement) is None:
            continue
        event, judgement = _where_it_begins(bench, event, judgement, flight.to_s)
        loss = _sure_loss(judgement)
        timing = None if loss is None else timing_of(bench, loss, event.onset_s, None, until_s=flight.to_s)
        if timing is not None:
            lines.append(_timed(bench, event, timing))
            yield lines[-1]


def _sure_loss(judgement: Judgement) -> Weight | None:
    """Return the loss of impact pressure that explains a place best, worth what alone declares it; None where none is.

    What its course leaves unexplained, and for how long readings err alike, counts against it.
    """
    weight = judgement.weights[0]
    least = SURE * DECLARED * weight.dispersion * weight.memory_s
    return weight if weight.fault in LOSSES and not weight.refused and weight.margin > least else None


def _sudden_errors(flight: Flight, bench: Bench, events: Sequence[Event], gains: ChangeGains) -> Iterator[Event]:
    """Yield the steps surely beyond a tolerance where no event is, from when they begin.

    The flight has to show a step surer by the logarithm of how many were tried, one of every channel at every second.
    """
    events, flown = list(events), spans_of(flight.phases, AIRBORNE)
    for fault, at_s, gain in sudden_errors(bench, events, gains):
        event = _proposed(flight, fault, at_s, {fault: gain})
        # What is only suspected of other channels hides no step that is sure.
        hiding = [other for other in events if other.state == "declared" or {*other.channels} & {*event.channels}]
        if _is_about(at_s, hiding) or any(_follows(bench, event, other) for other in events):
            continue
        if not within(np.array([at_s]), flown).any():
            continue
        later_s = min((other.onset_s for other in events if other.onset_s > at_s), default=np.inf)
        until_s = min(later_s - BEFORE_NEXT_S, flight.to_s)
        place = place_of(bench, at_s, None, until_s)
        if place is None:
            continue
        ordinary = ordinary_of(place, without=TWINS.get(fault))
        (step,) = weights_of_channel(fault, 0.0, [place], ordinary)
        least = abs(step.size) - TWO_SIDED_95 * (step.sd or 0.0)
        surer = DECLARED + float(np.log(len(gains.faults) * bench.model.n))
        if step.margin < surer or least < (flight.tolerance(fault, event.window_s) or np.inf):
            continue
        timing = timing_of(bench, step, at_s, None, until_s=until_s)
        if timing is None or _is_about(timing.onset_s, hiding):
            continue
        judgement = judge_place(place, ordinary, named=event.among)
        clearly = judgement.weights[0].margin - DECLARED * judgement.weights[0].dispersion
        among = (each.fault for each in judgement.weights if not each.refused and each.margin >= clearly)
        event = replace(_timed(bench, event, timing), among=tuple(dict.fromkeys((fault, *among))), state="declared")
        events.append(_as_trapped(bench, event, flight.to_s))
        yield events[-1]


def _is_about(at_s: float, events: Iterable[Event]) -> bool:
    """Return whether an event begins or ends about a time."""
    limits_s = (limit_s for event in events for limit_s in (event.onset_s, event.offset_s) if limit_s is not None)
    return any(abs(at_s - limit_s) < APART_S for limit_s in limits_s)


def _proposed(flight: Flight, fault: str, at_s: float, evidence: Mapping[str, float]) -> Event:
    """Return a suspected step that the flight model proposes."""
    return Event(
        fault=fault,
        among=(fault,),
        channels=channels_of(fault, flight.recorded),
        state="suspected",
        kind="abrupt",
        stages=(MODEL,),
        shape="bias",
        effect={},
        beyond_tolerance=None,
        onset_s=at_s,
        onset_ci95=(at_s - 1.0, at_s + 1.0),
        offset_s=None,
        seen_until_s=at_s,
        window_s=flight.around(at_s, at_s, AROUND_S),
        magnitude=None,
        unit="",
        statistic=0.0,
        threshold=0.0,
        evidence=evidence,
    )


def _is_told(event: OrdinaryEvent, others: Iterable[OrdinaryEvent], stand: Iterable[Event]) -> bool:
    """Return whether an ordinary event is told: by its cause, or as the fault that the model proposed in its place."""
    same = any(abs(event.from_s - other.from_s) < APART_S for other in others if other.cause == event.cause)
    return same or _is_about(event.from_s, [other for other in stand if other.stages[0] == MODEL])


def _after(event: Event, cause: Event) -> Note:
    """Return what is said of an event that is an after-effect."""
    at_s, since_s = (f"{entry.onset_s:.0f} s" for entry in (event, cause))
    return Note.method(f"what looks like '{event.fault}' from {at_s} follows from '{cause.fault}' from {since_s}")


def _has_course(event: Event) -> bool:
    """Return whether an event is more than the gross errors of a minute: it lasts, or its line is seen to rest."""
    return "holds" in event.stages or event.offset_s is None or event.offset_s > event.onset_s + APART_S


def _can_be_weighed(event: Event) -> bool:
    """Return whether an event is weighed against every other: what is surely within its tolerance hides none."""
    return _is_course(event) and event.beyond_tolerance is not False


def _is_course(event: Event) -> bool:
    """Return whether the seconds of a flight show the course of an event."""
    held = event.shape == "frozen" and "static relations" in event.stages
    return (held or event.shape not in UNWEIGHED) and event.frequency_hz is None


def _weighed_deviation(bench: Bench, event: Event, known: Sequence[Event], to_s: float) -> Event | Note:
    """Return an event within its tolerance with its margin, a note where the model does not confirm it."""
    cause = next((cause for cause in known if _follows(bench, event, cause)), None)
    if cause is not None:
        return _after(event, cause)
    judgement = _judgement(bench, event, to_s)
    weights = [] if judgement is None else _weights(judgement, event)
    if judgement is None or not weights:
        return event
    weight = _best_as_named(judgement, event)
    return replace(event, margin=weight.margin) if weight.margin > DECLARED else _refuted(event, weight)


def _bench(flight: Flight, events: Iterable[Event], causes: Iterable[KnownCause]) -> Bench | None:
    """Return the flight model of a log; None where it has too little for one."""
    seconds = seconds_of(flight.log)
    if seconds is None:
        return None
    lost = spans_of(flight.phases, (NO_AIRSPEED,))
    model = flight_model(seconds, flown=within(seconds.time_s, [*flight_stretches(flight.phases), *lost]))
    if model is None:
        return None
    about = np.zeros(model.n, dtype=bool)
    for event in events:
        for at_s in (event.onset_s, event.offset_s):
            if at_s is not None:
                about |= np.abs(model.time_s - at_s) < ABOUT_S
    return bench_of(
        model,
        without=about if about[model.frame.airborne].mean() < 0.5 else None,
        causes=[*((known.cause, known.at_s) for known in causes), *((FLAPS, at_s) for at_s in _moves_s(flight.log))],
    )


def _moves_s(log: FlightLog) -> Iterator[float]:
    """Yield when recorded flaps or gear begin to move and when they stop, between which no more than JUMP_S passes."""
    for name in ("flaps", "gear"):
        if name in log.channels:
            position = filled(over_seconds(log.channels[name].values, *seconds_of_samples(log), log.rate_hz))
            for first, end in runs(np.abs(np.diff(position)) > MOVING * np.ptp(position)):
                yield from (float(log.time_s[0]) + at for at in dict.fromkeys((first, end)))


def _follows(bench: Bench, event: Event, known: Event) -> bool:
    """Return whether an event shows nothing but what a known fault makes wrong meanwhile.

    Its channels are measured by those of the fault, or it begins within gross errors of a line, which move what is
    made of an airspeed as well: a static temperature.
    """
    rows = rows_of(bench, event.channels)
    measured = bool(rows) and set(rows) <= set(rows_of(bench, known.channels))
    if known.frequency_hz is not None:
        # A window that swings shows whatever slow course the phases of its ends make.
        return measured and overlaps(event.window_s, [(known.onset_s, known.until_s)])
    if known.stages == (MODEL,):
        return known.onset_s - BESIDE_S < event.onset_s < known.until_s + BESIDE_S
    return measured and known.onset_ci95[0] - BEFORE_NEXT_S <= event.onset_s and event.onset_ci95[0] < known.until_s


def _weighed(
    flight: Flight,
    bench: Bench,
    event: Event,
    until_s: float,
    causes: Sequence[KnownCause],
    known_faults: Sequence[Event],
    *,
    may_be_sure: bool,
) -> Event | OrdinaryEvent | Note:
    """Return what an event is after it was weighed."""
    if (
        is_on_ground(bench, event.onset_s)
        and not within(np.array([event.onset_s]), flight_stretches(flight.phases)).any()
    ):
        return _ordinary(event, ON_GROUND, {})
    judgement = _judgement(bench, event, until_s)
    if event.offset_s is None and EXACT & {*event.stages} and event.window_s[1] < until_s:
        # An equation that is broken shows no end of it: the fault may be over after what its finder saw.
        seen = _judgement(bench, event, event.window_s[1])
        if seen is not None and (judgement is None or _most(seen, event) > _most(judgement, event)):
            judgement = seen
    if judgement is not None and "holds" in event.stages:
        event, judgement = _where_it_is_trapped(bench, event, judgement, until_s)
    if judgement is None:
        return _unweighed(event)
    if not _weights(judgement, event):
        return event
    would_be_renamed = _would_be_renamed(judgement, event)
    if would_be_renamed or judgement.weights[0].dispersion > UNDESCRIBED:
        moved, there = _where_it_begins(bench, event, judgement, until_s)
        if _would_be_renamed(there, moved):
            return _renamed(bench, moved, there.weights[0], there.among, until_s)
        # What holds exactly is placed by its finder, under its own name.
        if not {*event.stages} <= EXACT:
            event, judgement = moved, there
    weight, best = _best_as_named(judgement, event), judgement.weights[0]
    going_on = (fault for fault in known_faults if fault.fault == best.fault and fault.onset_s < event.onset_s)
    cause = next(going_on, None)
    if cause is not None and best.margin > _margin_as_named(judgement, event, weight) + DECLARED * best.dispersion:
        return _after(event, cause)
    # A number that is entered steps at once, as no knob that is turned: the model takes neither for the fault.
    has_twin = event.stages == (MODEL,) and TWINS.get(event.fault) in causes_of(bench.model)
    if weight.margin > DECLARED and not weight.refused and not has_twin:
        return _confirmed(_dated(bench, event, judgement, until_s), weight, judgement, may_be_sure=may_be_sure)
    known = _stated_cause(bench, event, weight, causes)
    if known is not None:
        return _ordinary(event, known.cause, {"margin": weight.margin}, stated=True)
    rival = _rival(bench, event, weight, judgement)
    if _knows_more(bench, event, rival):
        return replace(event, margin=weight.margin)
    # A line that is seen to rest is suspected at least: the model knows its course no better than its finder.
    if rival and (weight.margin > -DECLARED or "holds" in event.stages) and not weight.refused:
        among = tuple(dict.fromkeys((weight.fault, *event.among)))
        named = event if weight.fault == event.fault else _renamed(bench, event, weight, among, until_s)
        return replace(
            named,
            state="suspected",
            margin=weight.margin,
            among=(*named.among, rival),
            refuted_by=_against(weight),
            note=f"that {CAUSES[rival].text} explains it as well",
        )
    if rival:
        return _ordinary(event, rival, {"gain": judgement.gain, "margin": weight.margin})
    return _without_rival(event, weight)


def _unweighed(event: Event) -> Event:
    """Return an event of which too little is flown before it to weigh it.

    How much a residual moves on a healthy flight is known for most of a flight, not for its first minute.
    """
    if event.state != "declared" or event.stages != ("parity",):
        return event
    return replace(event, state="suspected", note="too little of the flight is recorded before it to confirm it")


def _would_be_renamed(judgement: Judgement, event: Event) -> bool:
    """Return whether another fault explains the place of what is declared clearly better than its finder's name."""
    best = judgement.weights[0]
    as_named = _margin_as_named(judgement, event, _best_as_named(judgement, event))
    may_be_renamed = _may_be_renamed(event, best, as_named) and event.state == "declared"
    # What neither course describes speaks for neither: log densities over their dispersion.
    return may_be_renamed and best.margin > max(DECLARED, as_named + DECLARED * best.dispersion)


def _best_as_named(judgement: Judgement, event: Event) -> Weight:
    """Return the weight of the best of the faults that an event may be, of which the model knows one."""
    return max(_weights(judgement, event), key=lambda weight: (not weight.refused, weight.margin))


def _where_it_begins(bench: Bench, event: Event, judgement: Judgement, until_s: float) -> tuple[Event, Judgement]:
    """Return an event where the fault that explains it best begins, and what its place is worth there.

    A finder places what it takes for its own fault. Names are compared each at its own onset, until the best of them
    moves the place no more. So is its end: what it takes for a return may be none of another.
    """
    without_end = replace(event, offset_s=None)
    lasts = None if event.offset_s is None else _judgement(bench, without_end, until_s)
    if lasts is not None and lasts.weights[0].margin > judgement.weights[0].margin:
        event, judgement = without_end, lasts
    for _ in range(MOVES):
        contenders = {each.fault: each for each in (_best_as_named(judgement, event), judgement.weights[0])}
        timings = [
            timing
            for each in contenders.values()
            if (timing := timing_of(bench, each, event.onset_s, event.offset_s, until_s=until_s)) is not None
        ]
        if not timings:
            break
        best = max(timings, key=lambda timing: (not timing.weight.refused, timing.weight.margin))
        if abs(best.onset_s - event.onset_s) < RESTS_S and best.offset_s == event.offset_s:
            break
        moved = replace(event, onset_s=best.onset_s, onset_ci95=best.onset_ci95, offset_s=best.offset_s)
        there = _judgement(bench, moved, until_s)
        if there is None or not _weights(there, event):
            break
        event, judgement = moved, there
    return event, judgement


def _where_it_is_trapped(bench: Bench, event: Event, judgement: Judgement, until_s: float) -> tuple[Event, Judgement]:
    """Return a line that is seen to rest with the interval in which it is trapped: in calm flight it rests before.

    From where it is seen to rest it is placed to where the flight contradicts that.
    """
    weights = _weights(judgement, event)
    timing = timing_of(bench, weights[0], event.onset_s, event.offset_s, until_s=until_s) if weights else None
    if timing is None or timing.weight.refused or timing.weight.margin <= DECLARED:
        return event, judgement
    (earliest_s, latest_s), (first_s, last_s) = event.onset_ci95, timing.onset_ci95
    event = replace(event, onset_ci95=(min(earliest_s, first_s), max(latest_s, last_s)))
    if _most(judgement, event) > DECLARED:
        return event, judgement
    moved = replace(event, onset_s=timing.onset_s)
    there = _judgement(bench, moved, until_s)
    return (event, judgement) if there is None else (moved, there)


def _margin_as_named(judgement: Judgement, event: Event, weight: Weight) -> float:
    """Return what an event is worth under its finder's name; an error of a channel that the model lacks is worth none.

    Parameters
    ----------
    weight : of the best of the faults that it may be; where none of them is the best of all, this counts.
    """
    if judgement.weights[0].fault not in event.among:
        return weight.margin
    return _margin_of(judgement, event.fault)


def _margin_of(judgement: Judgement, fault: str) -> float:
    """Return what a fault is worth; of one that the model lacks nothing."""
    weight = judgement.weight(fault)
    return 0.0 if weight is None else weight.margin


def _knows_more(bench: Bench, event: Event, rival: str) -> bool:
    """Return whether a finder knows what the model does not.

    Accelerations at the log's rate, an airspeed that changes faster than any flight, a pitch within a second, in which
    neither flaps move nor an attitude settles, equations between a temperature and airspeeds, of which the model takes
    any jump for a cold layer; and without a ground velocity a lost airspeed is as well a change of speed. Inertia knows
    no more of a wind that changes: it moves the airspeed against what the accelerations say, as an error of it does.
    """
    if {AT_ONCE_EVIDENCE, PITCH_EVIDENCE} & event.evidence.keys():
        return True
    if event.fault in TEMPERATURES and EXACT & {*event.stages}:
        return True
    by_lift = event.fault in (*LOSSES, *AIRSPEEDS) and not {"velocity_north", "ground_speed"} & {*bench.model.rows}
    inertial = event.evidence.get(INERTIAL, 0.0) > DECLARED and rival != "wind"
    return (by_lift or inertial) and not set(event.stages) <= SEES_NO_MORE


def _judgement(bench: Bench, event: Event, until_s: float) -> Judgement | None:
    """Return what the flight model says of the place of an event, up to a time."""
    held = event.fault if event.shape == "frozen" else ""
    return judge(bench, event.onset_s, event.offset_s, until_s=until_s, named=event.among, frozen=held)


def _weights(judgement: Judgement, event: Event) -> list[Weight]:
    """Return the weights of the faults that an event may be."""
    names = (FROZEN,) if event.shape == "frozen" else _names(event)
    return [weight for name in names if (weight := judgement.weight(name)) is not None]


def _most(judgement: Judgement, event: Event) -> float:
    """Return the margin of the best of the faults that an event may be."""
    return max((weight.margin for weight in _weights(judgement, event) if not weight.refused), default=-np.inf)


def _may_be_renamed(event: Event, best: Weight, as_named: float) -> bool:
    """Return whether the model may call an event another fault than its finder does.

    A line that is seen to rest or to run out is named by its own physics, unless the flight bears out another fault of
    a line alone; and of an equation between air data the channels that break it are known. What only fits best may be
    another that the model knows of. A receiver of satellites errs so rarely that it stays one of a set unless its
    finder names it first.
    """
    fault, is_line = best.fault, any(best.fault in line for line in LINES)
    if event.shape == "frozen" or (fault in REFERENCES and fault != event.fault):
        return False
    if "holds" in event.stages:
        return is_line and as_named < DECLARED and best.dispersion < UNDESCRIBED
    if event.stages == (MODEL,):
        return is_line  # of all channels it proposed the best
    return fault in event.among or not EXACT & {*event.stages}


def _dated(bench: Bench, event: Event, judgement: Judgement, until_s: float) -> Event:
    """Return a line that goes on losing with its onset by the flight; the windows of its finder tell it less well.

    Of a loss that has come to rest the finder knows the course, and the straight one of the model is none of it.
    """
    weight = judgement.weight(event.fault)
    goes_on = event.fault in SLOW and event.shape == "drift"
    if not goes_on or weight is None or {*event.stages} & {*EXACT, "holds", MODEL}:
        return event
    timing = timing_of(bench, weight, event.onset_s, event.offset_s, until_s=until_s)
    if timing is None or timing.weight.refused or timing.weight.margin <= DECLARED:
        return event
    return replace(event, onset_s=timing.onset_s, onset_ci95=timing.onset_ci95)


def _confirmed(event: Event, weight: Weight, judgement: Judgement, *, may_be_sure: bool) -> Event:
    """Return an event that the record confirms, with every other fault that explains it about as well."""
    alike = judgement.among if weight.fault in judgement.among else event.among
    family = _line(event)
    among = [name for name in alike if name != FROZEN and name not in family]
    # What an equation leaves open stays open for every fault that the record does not refute.
    near = [rival.fault for rival in judgement.weights if not rival.refused and rival.margin > 0.0]
    among = [*(name for name in event.among if name in family or name in near), *among]
    # Of a line its finder describes the course: another fault of it is told where the record clearly prefers that.
    if weight.fault in family and weight.margin > _margin_of(judgement, event.fault) + DECLARED * weight.dispersion:
        among.append(weight.fault)
    # What a window alone left open is told by the whole record.
    sure = event.state == "declared" or (may_be_sure and weight.margin > SURE * DECLARED)
    return replace(
        event,
        channels=_with_temperature(event.channels, weight) if weight.fault in family else event.channels,
        state="declared" if sure else "suspected",
        margin=weight.margin,
        among=tuple(dict.fromkeys((event.fault, *among))),
        refuted_by=_against(weight),
        note=event.note if event.state == "declared" or not sure else "",
    )


def _rival(bench: Bench, event: Event, weight: Weight, judgement: Judgement) -> str:
    """Return the ordinary cause that explains an event by its channels or by what they disagree with, "" for none."""
    broken = (name for name, value in event.evidence.items() if value > AUDIBLE)
    moved = rows_of(bench, (weight.fault, *event.channels, *broken))
    if judgement.gain > DECLARED and explains(bench, judgement.cause, moved):
        return judgement.cause
    return ALTIMETER_SET if "altitude" in moved and is_set(bench, event.onset_s) else ""


def _without_rival(event: Event, weight: Weight) -> Event | Note:
    """Return an event that is neither confirmed nor ordinary: refuted, suspected, or beyond what the model can tell."""
    if event.stages == (MODEL,) and weight.margin <= DECLARED:
        return _refuted(event, weight)  # it proposed what it does not confirm
    against = _against(weight)
    sees_no_more = "holds" in event.stages or set(event.stages) <= SEES_NO_MORE
    if not (_could_tell(event, weight) or sees_no_more or weight.margin < -DECLARED):
        return replace(event, margin=weight.margin)
    # What a finder declares is taken back by as much as what it suspects needs to be declared.
    least = -SURE * DECLARED if event.state == "declared" else 0.0
    if (weight.margin < least or weight.refused) and "static relations" not in event.stages:
        return _refuted(event, weight)
    note = (
        f"{' and '.join(against)} contradict it" if weight.margin < 0.0 and against else "no fault explains it as well"
    )
    note += f": log density {weight.margin:+.1f} beside the best ordinary explanation"
    return replace(event, state="suspected", margin=weight.margin, refuted_by=against, note=note)


def _refuted(event: Event, weight: Weight) -> Note:
    """Return what is said of an event that is none."""
    against = _against(weight)
    because = f"{' and '.join(against)} contradict it" if against else "a flight without it does as well"
    return Note.method(
        f"'{event.fault}' from {event.onset_s:.0f} s was proposed and is refuted: {weight.refused or because} "
        f"(log density {weight.margin:+.0f} beside no fault)"
    )


def _renamed(bench: Bench, event: Event, best: Weight, among: tuple[str, ...], until_s: float) -> Event:
    """Return an event as the fault that explains its place best, from when that fault itself begins."""
    timing = timing_of(bench, best, event.onset_s, event.offset_s, until_s=until_s)
    described = _described(bench, event, best) if timing is None else _timed(bench, event, timing)
    return replace(
        described,
        among=tuple(name for name in among if name != FROZEN),
        state="declared",
        margin=best.margin,
        refuted_by=_against(best),
        note=f"first taken for '{event.fault}'",
        repeat=repeat_advice(among),
    )


def _as_trapped(bench: Bench, event: Event, until_s: float) -> Event:
    """Return an event, as a line that rests about it where that explains the flight better than what is proposed."""
    rests = () if "holds" in event.stages else tuple(rests_about(bench, event.onset_s))
    if not rests or not {*event.channels} & DEPENDS_ON.keys():
        return event
    gain, trapped = 0.0, event
    for fault, from_s, to_s in rests:
        rest = replace(event, fault=fault, among=(fault,), onset_s=from_s, offset_s=to_s)
        places = places_of(bench, [(each.onset_s, each.offset_s) for each in (event, rest)], until_s)
        if not places:
            continue
        proposed, there = ((place, ordinary_of(place)) for place in places)
        weight = weight_of_line(*there, fault)
        if weight.margin <= DECLARED:
            continue
        as_proposed = judge_place(*proposed, named=event.among).weights[0].margin
        more = weight.margin + there[1].log_likelihood - max(DECLARED, as_proposed) - proposed[1].log_likelihood
        if more <= gain:
            continue
        timing = timing_of(bench, weight, from_s, to_s, until_s=until_s, latest_s=to_s)
        if timing is None:
            continue
        # A line may rest before the flight contradicts it, and seems to for a while in the steps of its record.
        within = min(from_s - 1.0, timing.onset_ci95[0]), timing.onset_ci95[1]
        timed = _timed(bench, rest, replace(timing, onset_ci95=within))
        judgement = _judgement(bench, timed, until_s)
        if judgement is not None and judgement.weights[0].fault == fault:
            gain, trapped = more, timed
    return trapped


def _begun_before(bench: Bench, event: Event, until_s: float) -> Timing | None:
    """Return from when to when a fault lasts of which an event is the return, None where it is none."""
    if event.offset_s is not None or event.magnitude is None or "holds" in event.stages or event.shape == "drift":
        return None
    faults = ENDED_BY.get(event.fault, ()) if _line(event) else (event.fault,)
    return begun_before(bench, faults, event.onset_s, sure=DECLARED, until_s=until_s)


def _from_its_onset(bench: Bench, event: Event, timing: Timing) -> Event:
    """Return an event that is the return of a fault as that fault."""
    fault, weight = timing.weight.fault, timing.weight
    if weight.growth_s not in (None, np.inf) and event.magnitude is not None:
        # By what the reading comes back the finder measures, beside its own relations.
        as_returned = replace(weight, size=-event.magnitude, sd=event.sd, dispersion=1.0, memory_s=1.0)
        timing = replace(timing, weight=as_returned)
    return replace(
        _timed(bench, event, timing),
        among=tuple(dict.fromkeys((fault, *(name for name in event.among if name != event.fault)))),
        note=f"its return at {event.onset_s:.0f} s stood out first",
    )


def _timed(bench: Bench, event: Event, timing: Timing) -> Event:
    """Return an event as a fault from when that begins to when it ends."""
    timed = replace(
        event,
        onset_s=timing.onset_s,
        onset_ci95=timing.onset_ci95,
        offset_s=timing.offset_s,
        seen_until_s=max(event.seen_until_s, timing.onset_s),
    )
    return _described(bench, timed, timing.weight)


def _described(bench: Bench, event: Event, weight: Weight) -> Event:
    """Return an event with the name, the course and the size of a fault; of a line no size is told."""
    line, growth_s = weight.growth_s is None, weight.growth_s or 0.0
    channels = channels_of(weight.fault, bench.model.seconds.recorded)
    channels = _with_temperature(channels, weight) if line else channels
    lasts_s = max((event.seen_until_s if event.offset_s is None else event.offset_s) - event.onset_s, 1.0)
    drifts = growth_s == np.inf
    per = lasts_s if drifts else 1.0
    magnitude = None if line else weight.size / per
    # What its course leaves unexplained widens the interval of its size as it does that of its onset.
    sd = None if line or weight.sd is None else weight.sd / per * np.sqrt(weight.dispersion * weight.memory_s)
    unit = "" if line else STANDARD[weight.fault].unit
    half = None if sd is None else TWO_SIDED_95 * sd
    return replace(
        event,
        fault=weight.fault,
        channels=channels,
        shape=weight.fault if line else "drift" if drifts else "ramp_hold" if growth_s else "bias",
        kind="slow" if growth_s or weight.fault in SLOW else "abrupt",
        constant_s=growth_s if 0.0 < growth_s < np.inf else None,
        magnitude=magnitude,
        unit=per_second(unit) if drifts and unit else unit,
        sd=sd,
        ci95=None if magnitude is None or half is None else (magnitude - half, magnitude + half),
        effect={name: size for name, size in event.effect.items() if name in channels}
        if line
        else {weight.fault: weight.size},
        stages=tuple(dict.fromkeys((*event.stages, MODEL))),
    )


def _with_temperature(channels: Sequence[str], weight: Weight) -> tuple[str, ...]:
    """Return the channels that a fault of a line makes wrong: a static temperature where it is made of them."""
    if weight.heats:
        return (*channels,) if "sat" in channels else (*channels, "sat")
    return tuple(name for name in channels if name != "sat")


def _stated_cause(bench: Bench, event: Event, weight: Weight, causes: Sequence[KnownCause]) -> KnownCause | None:
    """Return the stated cause that an event is of: about its onset, and of what moves its channels or its rivals'."""
    moved = rows_of(bench, (weight.fault, *event.channels, *event.among))
    from_s, to_s = event.onset_ci95[0] - SET_WITHIN_S, event.onset_ci95[1] + SET_WITHIN_S
    return next(
        (known for known in causes if from_s <= known.at_s <= to_s and explains(bench, known.cause, moved)), None
    )


def _stated(known: KnownCause) -> OrdinaryEvent:
    """Return a stated cause that looked like no fault."""
    return OrdinaryEvent(
        **dict.fromkeys(("to_s", "magnitude", "ci95")),
        cause=known.cause,
        from_s=known.at_s,
        unit="",
        looks_like="",
        evidence={},
        stated=True,
    )


def _ordinary(event: Event, cause: str, evidence: Mapping[str, float], *, stated: bool = False) -> OrdinaryEvent:
    return OrdinaryEvent(
        cause=cause,
        from_s=event.onset_s,
        to_s=event.offset_s,
        magnitude=event.magnitude,
        unit=event.unit,
        ci95=event.ci95,
        looks_like=event.fault,
        evidence=evidence,
        stated=stated,
    )


def _is_of(event: Event, gross: Gross) -> bool:
    """Return whether a stretch of gross errors lies in an event of an air-data channel, or where that lets go."""
    begins_s = gross.to_s if "holds" in event.stages else gross.from_s  # a line that is held is seen a while later
    return (
        event.onset_ci95[0] < begins_s
        and (event.offset_s is None or event.offset_s > gross.from_s - BESIDE_S)
        and bool(set(event.channels) & DEPENDS_ON.keys())
    )


def _event_of_gross(flight: Flight, bench: Bench, gross: Gross) -> Event | None:
    """Return a line whose readings come and go; None where an ordinary cause explains it as well."""
    swings = swings_of(bench, gross)
    if swings is None or swings[0][0].margin <= DECLARED:
        return None
    (best, *others), errors = swings
    channels = channels_of(best.fault, flight.recorded)
    from_s, to_s = max(gross.from_s - AROUND_S, flight.from_s), min(gross.to_s + AROUND_S, flight.to_s)
    tolerances = {name: flight.tolerance(name, (from_s, to_s)) for name in errors}
    return Event(
        fault=best.fault,
        among=(best.fault, *(weight.fault for weight in others if weight.margin >= best.margin - ALIKE)),
        channels=channels,
        state="declared",
        kind="abrupt",
        stages=(MODEL,),
        shape=best.fault,
        effect=errors,
        beyond_tolerance=any(abs(errors[name]) > (size or np.inf) for name, size in tolerances.items()),
        onset_s=gross.from_s,
        onset_ci95=(gross.from_s - ONSET_S, gross.from_s + ONSET_S),
        offset_s=gross.to_s,
        seen_until_s=gross.to_s,
        window_s=(from_s, to_s),
        statistic=float(gross.seconds),
        threshold=float(FEWEST_S),
        evidence=best.shares,
        note="its readings leave the flight and come back, while all that no pressure moves stays",
        margin=best.margin,
        refuted_by=_against(best),
    )


def _names(event: Event) -> tuple[str, ...]:
    """Return the faults of the flight model that an event may be."""
    return tuple(dict.fromkeys((event.fault, *_line(event), *event.among)))


def _line(event: Event) -> frozenset[str]:
    """Return the faults of the pressure line that an event is of, none where it is of a channel."""
    return next((line for line in LINES if event.fault in line), frozenset())


def _against(weight: Weight) -> tuple[str, ...]:
    """Return the channels that speak against a fault, the loudest first."""
    total = sum(abs(value) for value in weight.shares.values())
    return tuple(name for name, value in weight.shares.items() if value < -max(LOUD * total, AUDIBLE))


def _could_tell(event: Event, weight: Weight) -> bool:
    """Return whether a fault of the size that its finder says would have been declared.

    Of an error of known standard deviation the expected log density is half its square in standard deviations.
    """
    if weight.refused or weight.sd is None:
        return True
    size = abs(event.effect.get(weight.fault, event.magnitude or 0.0))
    return bool(0.5 * (size / max(weight.sd, 1e-12)) ** 2 > 2.0 * DECLARED)
