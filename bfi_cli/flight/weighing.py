"""Events before one likelihood: what the finders propose is weighed against ordinary causes and against its rivals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from ..config import Diagnose, KnownCause
from ..flightlog import FlightLog
from ..flightlog.phases import NO_AIRSPEED, spans_of
from ..kernels.runs import runs, within
from ..notes import Note
from .bench import AFTER_S, Bench, bench_of
from .flight import Flight
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
    rows_of,
    with_known,
)
from .model import flight_model
from .naming import repeat_advice
from .noise import noisy_events
from .oscillations import is_same_oscillation
from .parity.record import over_seconds, seconds_of_samples
from .parity.sensors import AT_ONCE_EVIDENCE, PITCH_EVIDENCE
from .parity.windows import flight_stretches
from .placing import (
    EXACT,
    LINES,
    LOSSES,
    MODEL,
    UNDESCRIBED,
    best_as_named,
    dated,
    described,
    judgement_of,
    line_of,
    most_as_named,
    timed,
    weights_as_named,
    where_it_begins,
    where_it_is_trapped,
    with_temperature,
)
from .proposals import (
    APART_S,
    can_be_weighed,
    error_events,
    follows,
    is_about,
    is_course,
    placed_events,
    swinging_events,
)
from .result import Event, OrdinaryEvent
from .seconds import filled, seconds_of
from .surprises import (
    TWINS,
    ChangeGains,
    change_gains,
    surprising_events,
)
from .tables import ALTIMETER_SET, FLAPS, ON_GROUND
from .tables import ORDINARY as CAUSES
from .timing import timing_of
from .weight import AUDIBLE, DECLARED, SURE, Weight, refuting

# About a candidate, in which no level of the flight's noise is taken.
ABOUT_S = 90.0
# Analyses that see no more of a flight than its model does; the others know inputs, or accelerations at the log's rate.
SEES_NO_MORE = {"static relations", "sensors", "flight model"}
# MOVING [1]: share of its travel by which a recorded flap or gear moves within a second: 3 % takes half a minute.
MOVING = 0.03
AIRSPEEDS = ("tas", "cas", "ias", "mach")
TEMPERATURES = ("sat", "tat")
INERTIAL = "kinematics"  # the residual of the parity scan that rests on accelerometers


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
    bench = _bench(flight, [event for event in events if can_be_weighed(event)], causes)
    if bench is None:
        return Weighing(events=tuple(events))
    swinging = tuple(swinging_events(flight, bench, events))
    events = [event for event in events if not any(is_same_oscillation(event, other) for other in swinging)]
    # What is only suspected, or within its tolerance, hides no other.
    hiding = [event for event in swinging if event.state == "declared" and event.beyond_tolerance is not False]
    gains, unweighed = change_gains(bench), bench
    known = [*hiding]
    bench = reduce(with_known, known, bench)
    events, returns = placed_events(flight, bench, events, swinging, gains)
    answers: list[Event | OrdinaryEvent | Note] = list(events)
    # What is certain is in the model before the rest is weighed, what finders hold so first, in the order of time; a
    # line is before a channel about its onset, which may be its own, and one that is seen to rest before any other.
    order = [k for k, event in enumerate(events) if can_be_weighed(event)]
    earlier_s = {k: APART_S * (bool(line_of(events[k])) + ("holds" in events[k].stages)) for k in order}
    seen_s = {k: returns.get(k, events[k].onset_s) for k in order}
    order.sort(key=lambda k: (events[k].state != "declared", events[k].stages == (MODEL,), seen_s[k] - earlier_s[k]))
    for k in order:
        event = events[k]
        cause = next((cause for cause in known if follows(bench, event, cause)), None)
        if cause is not None:
            # A line that is seen to rest is no after-effect of what only makes the same channels wrong.
            answers[k] = event if "holds" in event.stages and cause.stages != (MODEL,) else _after(event, cause)
            continue
        line = line_of(event)
        rest = [events[j] for j in order if j != k and isinstance(answers[j], Event)]
        if k in returns:
            alike = [other for other in rest if line_of(other) or other.fault == event.fault]
            cause = next((other for other in alike if abs(other.onset_s - event.onset_s) < APART_S), None)
            if cause is not None:
                answers[k] = _after(event, cause)
                continue
        others = [other.onset_s for other in (*hiding, *(each for each in rest if not line or line_of(each) != line))]
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
                is_of_it = line_of(later) == line_of(answer) or {*later.channels} <= {*answer.channels}
                if is_of_it and follows(bench, later, answer):
                    answers[j] = _after(later, answer)
            known.append(answer)
            bench = with_known(bench, answer)
    for k, event in enumerate(events):
        if event.beyond_tolerance is False and is_course(event):
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
    if event.shape != "spikes" or not line_of(known) or not {*event.channels} <= {*known.channels}:
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
    for step in error_events(flight, bench, stand, gains):
        later_s = min((other.onset_s for other in stand if other.onset_s > step.onset_s), default=np.inf)
        until_s = min(later_s - BEFORE_NEXT_S, flight.to_s)
        step = replace(step, state="suspected")
        answer = _weighed(flight, bench, step, until_s, causes, known, may_be_sure=False)
        if isinstance(answer, Event):
            yield answer


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


def _is_told(event: OrdinaryEvent, others: Iterable[OrdinaryEvent], stand: Iterable[Event]) -> bool:
    """Return whether an ordinary event is told: by its cause, or as the fault that the model proposed in its place."""
    same = any(abs(event.from_s - other.from_s) < APART_S for other in others if other.cause == event.cause)
    return same or is_about(event.from_s, [other for other in stand if other.stages[0] == MODEL])


def _after(event: Event, cause: Event) -> Note:
    """Return what is said of an event that is an after-effect."""
    at_s, since_s = (f"{entry.onset_s:.0f} s" for entry in (event, cause))
    return Note.method(f"what looks like '{event.fault}' from {at_s} follows from '{cause.fault}' from {since_s}")


def _weighed_deviation(bench: Bench, event: Event, known: Sequence[Event], to_s: float) -> Event | Note:
    """Return an event within its tolerance with its margin, a note where the model does not confirm it."""
    cause = next((cause for cause in known if follows(bench, event, cause)), None)
    if cause is not None:
        return _after(event, cause)
    judgement = judgement_of(bench, event, to_s)
    weights = [] if judgement is None else weights_as_named(judgement, event)
    if judgement is None or not weights:
        return event
    weight = best_as_named(judgement, event)
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
    judgement = judgement_of(bench, event, until_s)
    if event.offset_s is None and EXACT & {*event.stages} and event.window_s[1] < until_s:
        # An equation that is broken shows no end of it: the fault may be over after what its finder saw.
        seen = judgement_of(bench, event, event.window_s[1])
        if seen is not None and (judgement is None or most_as_named(seen, event) > most_as_named(judgement, event)):
            judgement = seen
    if judgement is not None and "holds" in event.stages:
        event, judgement = where_it_is_trapped(bench, event, judgement, until_s)
    if judgement is None:
        return _unweighed(event)
    if not weights_as_named(judgement, event):
        return event
    would_be_renamed = _would_be_renamed(judgement, event)
    if would_be_renamed or judgement.weights[0].dispersion > UNDESCRIBED:
        moved, there = where_it_begins(bench, event, judgement, until_s)
        if _would_be_renamed(there, moved):
            return _renamed(bench, moved, there.weights[0], there.among, until_s)
        # What holds exactly is placed by its finder, under its own name.
        if not {*event.stages} <= EXACT:
            event, judgement = moved, there
    weight, best = best_as_named(judgement, event), judgement.weights[0]
    going_on = (fault for fault in known_faults if fault.fault == best.fault and fault.onset_s < event.onset_s)
    cause = next(going_on, None)
    if cause is not None and best.margin > _margin_as_named(judgement, event, weight) + DECLARED * best.dispersion:
        return _after(event, cause)
    # A number that is entered steps at once, as no knob that is turned: the model takes neither for the fault.
    has_twin = event.stages == (MODEL,) and TWINS.get(event.fault) in causes_of(bench.model)
    if weight.margin > DECLARED and not weight.refused and not has_twin:
        return _confirmed(dated(bench, event, judgement, until_s), weight, judgement, may_be_sure=may_be_sure)
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
            refuted_by=refuting(weight),
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
    as_named = _margin_as_named(judgement, event, best_as_named(judgement, event))
    may_be_renamed = _may_be_renamed(event, best, as_named) and event.state == "declared"
    # What neither course describes speaks for neither: log densities over their dispersion.
    return may_be_renamed and best.margin > max(DECLARED, as_named + DECLARED * best.dispersion)


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


def _confirmed(event: Event, weight: Weight, judgement: Judgement, *, may_be_sure: bool) -> Event:
    """Return an event that the record confirms, with every other fault that explains it about as well."""
    alike = judgement.among if weight.fault in judgement.among else event.among
    family = line_of(event)
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
        channels=with_temperature(event.channels, weight) if weight.fault in family else event.channels,
        state="declared" if sure else "suspected",
        margin=weight.margin,
        among=tuple(dict.fromkeys((event.fault, *among))),
        refuted_by=refuting(weight),
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
    against = refuting(weight)
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
    against = refuting(weight)
    because = f"{' and '.join(against)} contradict it" if against else "a flight without it does as well"
    return Note.method(
        f"'{event.fault}' from {event.onset_s:.0f} s was proposed and is refuted: {weight.refused or because} "
        f"(log density {weight.margin:+.0f} beside no fault)"
    )


def _renamed(bench: Bench, event: Event, best: Weight, among: tuple[str, ...], until_s: float) -> Event:
    """Return an event as the fault that explains its place best, from when that fault itself begins."""
    timing = timing_of(bench, best, event.onset_s, event.offset_s, until_s=until_s)
    renamed = described(bench, event, best) if timing is None else timed(bench, event, timing)
    return replace(
        renamed,
        among=tuple(name for name in among if name != FROZEN),
        state="declared",
        margin=best.margin,
        refuted_by=refuting(best),
        note=f"first taken for '{event.fault}'",
        repeat=repeat_advice(among),
    )


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


def _could_tell(event: Event, weight: Weight) -> bool:
    """Return whether a fault of the size that its finder says would have been declared.

    Of an error of known standard deviation the expected log density is half its square in standard deviations.
    """
    if weight.refused or weight.sd is None:
        return True
    size = abs(event.effect.get(weight.fault, event.magnitude or 0.0))
    return bool(0.5 * (size / max(weight.sd, 1e-12)) ** 2 > 2.0 * DECLARED)
