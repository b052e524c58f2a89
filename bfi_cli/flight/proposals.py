"""What the flight model itself proposes beside the finders, and every event from the onset of its fault."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..airdata import DEPENDS_ON
from ..flightlog.phases import AIRBORNE, spans_of
from ..kernels import TWO_SIDED_95
from ..kernels.runs import within
from .bench import AFTER_S, Bench, place_of
from .flight import Flight
from .gross import FEWEST_S, Gross, gross_errors, swings_of
from .judge import (
    BEFORE_NEXT_S,
    Judgement,
    judge_place,
    ordinary_of,
    rows_of,
    weights_of_channel,
)
from .lines import PITOT_ICING, PITOT_LEAK, weight_of_line
from .naming import channels_of
from .oscillations import oscillating_events
from .parity.windows import overlaps
from .placing import (
    LOSSES,
    MODEL,
    as_trapped,
    from_its_onset,
    judgement_of,
    line_of,
    timed,
    timing_if_over,
    where_it_begins,
)
from .result import Event
from .surprises import (
    TWINS,
    ChangeGains,
    slow_losses,
    sudden_errors,
    sudden_winds,
)
from .timing import timing_of
from .weight import ALIKE, DECLARED, SURE, Weight, refuting

# Seconds by which a next fault must be later to be left out of what is weighed.
APART_S = 60.0
# Shapes that the seconds of a flight do not show: what is over within one, and what swings.
UNWEIGHED = ("dropout", "spikes", "frozen", "offset", "sine", "cosine", "pitot_water")
# About a stretch of gross errors: when an event that lasts is of it, what is shown, and how well its onset is known.
BESIDE_S, AROUND_S, ONSET_S = 60.0, 60.0, 3.0
SIZED_S = 5  # before and after a step, when its size is read


def placed_events(
    flight: Flight, bench: Bench, events: Sequence[Event], swinging: Sequence[Event], gains: ChangeGains
) -> tuple[list[Event], dict[int, float]]:
    """Return all events, each from its fault's onset, and by the number of each that was a return when that was."""
    placed = [*events, *_sudden_losses(flight, bench, (*swinging, *events), gains)]
    returns: dict[int, float] = {}
    for k, event in enumerate(placed):
        if can_be_weighed(event):
            placed[k] = as_trapped(bench, event, flight.to_s)
            begun = timing_if_over(bench, placed[k], flight.to_s)
            if begun is not None:
                returns[k] = placed[k].onset_s
                placed[k] = from_its_onset(bench, placed[k], begun)
    placed += _slow_losses(flight, bench, (*swinging, *placed), gains)
    return [*placed, *error_events(flight, bench, (*swinging, *placed), gains)], returns


def swinging_events(flight: Flight, bench: Bench, events: Sequence[Event]) -> Iterator[Event]:
    """Yield what comes and goes: gross errors of a line that no event of a line is of, and oscillations.

    An error of one channel is none of several that leave together, however large its finder holds it to be.
    """
    line_events = [event for event in events if line_of(event) and event.state == "declared" and _has_course(event)]
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
        if not is_about(at_s, events) and place_of(bench, at_s, None, flight.to_s) is not None:
            loss, speed = _proposed(flight, "q_impact", at_s, {"ground_speed": gain}), bench.model.coefficients.airspeed
            at = int(np.searchsorted(bench.model.time_s, at_s))
            before, after = speed[max(at - SIZED_S, 0)], speed[min(at + SIZED_S, bench.model.n - 1)]
            events.append(replace(loss, magnitude=float((after / before) ** 2 - 1.0), unit="1"))
            yield events[-1]


def _slow_losses(flight: Flight, bench: Bench, events: Sequence[Event], gains: ChangeGains) -> Iterator[Event]:
    """Yield a pitot line that loses by degrees where no event of a line is, from when it begins."""
    lines = [event for event in events if line_of(event) and event.state == "declared"]
    for at_s, gain in slow_losses(bench, gains):
        if any(event.onset_s - APART_S < at_s < event.until_s + APART_S for event in lines):
            continue
        place = place_of(bench, at_s, None, flight.to_s)
        if place is None:
            continue
        straight = weight_of_line(place, ordinary_of(place), PITOT_ICING)
        if straight.refused or straight.margin < SURE * DECLARED:
            continue
        event = replace(_proposed(flight, PITOT_ICING, at_s, {"q_impact": gain}), state="declared")
        judgement = judgement_of(bench, event, flight.to_s)
        if judgement is None or _sure_loss(judgement) is None:
            continue
        event, judgement = where_it_begins(bench, event, judgement, flight.to_s)
        loss = _sure_loss(judgement)
        if loss is None:
            continue
        timing = timing_of(bench, loss, event.onset_s, None, until_s=flight.to_s)
        if timing is not None:
            event, seen_s = timed(bench, event, timing), float(bench.model.time_s[place.end - 1])
            shown = flight.around(event.onset_s, seen_s, AROUND_S)
            effect = _airspeed_error(bench, event, loss)
            lines.append(replace(event, effect=effect, seen_until_s=seen_s, window_s=shown))
            yield lines[-1]


def _airspeed_error(bench: Bench, event: Event, loss: Weight) -> dict[str, float]:
    """Return by how much a loss of impact pressure, as V^2, makes the airspeed wrong in its later half, m/s."""
    model, first = bench.model, bench.model.second(event.onset_s)
    left = np.exp(loss.size) if loss.fault == PITOT_LEAK else 1.0 + loss.size
    end = min(first + AFTER_S, model.n)
    read = float(np.median(model.coefficients.airspeed[(first + end) // 2 : end]))
    return {"tas" if "tas" in event.channels else model.seconds.record.airspeed: read * (1.0 - 1.0 / np.sqrt(left))}


def _sure_loss(judgement: Judgement) -> Weight | None:
    """Return the loss of impact pressure that explains a place best, worth what alone declares it; None where none is.

    What its course leaves unexplained, and for how long readings err alike, counts against it.
    """
    weight = judgement.weights[0]
    least = SURE * DECLARED * weight.repeated
    return weight if weight.fault in LOSSES and not weight.refused and weight.margin > least else None


def error_events(flight: Flight, bench: Bench, events: Sequence[Event], gains: ChangeGains) -> Iterator[Event]:
    """Yield the steps surely beyond a tolerance where no event is, from when they begin.

    The flight has to show a step surer by the logarithm of how many were tried, one of every channel at every second.
    """
    events, flown = list(events), spans_of(flight.phases, AIRBORNE)
    for fault, at_s, gain in sudden_errors(bench, events, gains):
        event = _proposed(flight, fault, at_s, {fault: gain})
        # What is only suspected of other channels hides no step that is sure.
        hiding = [other for other in events if other.state == "declared" or {*other.channels} & {*event.channels}]
        if is_about(at_s, hiding) or any(follows(bench, event, other) for other in events):
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
        least = abs(step.size) - TWO_SIDED_95 * (step.wide_sd or 0.0)
        surer = DECLARED + float(np.log(len(gains.faults) * bench.model.n))
        if step.margin < surer or least < (flight.tolerance(fault, event.window_s) or np.inf):
            continue
        timing = timing_of(bench, step, at_s, None, until_s=until_s)
        if timing is None or is_about(timing.onset_s, hiding):
            continue
        judgement = judge_place(place, ordinary, named=event.among)
        clearly = judgement.weights[0].margin - DECLARED * judgement.weights[0].dispersion
        among = (each.fault for each in judgement.weights if not each.refused and each.margin >= clearly)
        event = replace(timed(bench, event, timing), among=tuple(dict.fromkeys((fault, *among))), state="declared")
        events.append(as_trapped(bench, event, flight.to_s))
        yield events[-1]


def is_about(at_s: float, events: Iterable[Event]) -> bool:
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


def _has_course(event: Event) -> bool:
    """Return whether an event is more than the gross errors of a minute: it lasts, or its line is seen to rest."""
    return "holds" in event.stages or event.offset_s is None or event.offset_s > event.onset_s + APART_S


def can_be_weighed(event: Event) -> bool:
    """Return whether an event is weighed against every other: what is surely within its tolerance hides none."""
    return is_course(event) and event.beyond_tolerance is not False


def is_course(event: Event) -> bool:
    """Return whether the seconds of a flight show the course of an event."""
    held = event.shape == "frozen" and "static relations" in event.stages
    return (held or event.shape not in UNWEIGHED) and event.frequency_hz is None


def follows(bench: Bench, event: Event, known: Event) -> bool:
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
        refuted_by=refuting(best),
    )
