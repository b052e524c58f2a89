"""Events from where the faults begin that explain them: of a line at rest, of a return, by the likelihood of onsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from ..airdata import DEPENDS_ON
from ..kernels import TWO_SIDED_95
from ..quantities.channels import STANDARD, per_second
from .bench import Bench, places_of
from .judge import (
    FROZEN,
    Judgement,
    judge,
    judge_place,
    ordinary_of,
)
from .lines import rests_about, weight_of_line
from .naming import channels_of
from .parity.finding import Stage
from .result import Event
from .timing import Timing, begun_before, timing_of
from .weight import DECLARED, Weight

SLOW = ("pitot_icing", "static_leak", "pitot_leak")
MODEL: Stage = "flight model"
LOSSES = ("pitot_icing", "pitot_leak", "pitot_water", "q_impact")  # of an impact pressure
# What comes back to a line: a gain of impact pressure, and a fall of the static one.
ENDED_BY = {"q_impact": ("pitot_icing", "pitot_leak", "static_leak"), "static_leak": ("static_leak",)}
EXACT = {"static relations", "sensors"}  # analyses by what holds exactly, or to the last bit
# Of a pressure line its finder describes the course; the model tells which line it is.
LINES = (frozenset((*LOSSES, "pitot_blocked")), frozenset(("static_blocked", "static_leak")))
# Moves of an event to where a fault begins, at most, s by which one is none, and the dispersion of a course from which
# on its place is sought anew: an error twice its noise is none that it describes.
MOVES, RESTS_S, UNDESCRIBED = 6, 3.0, 4.0


def best_as_named(judgement: Judgement, event: Event) -> Weight:
    """Return the weight of the best of the faults that an event may be, of which the model knows one."""
    return max(weights_as_named(judgement, event), key=attrgetter("rank"))


def where_it_begins(bench: Bench, event: Event, judgement: Judgement, until_s: float) -> tuple[Event, Judgement]:
    """Return an event where the fault that explains it best begins, and what its place is worth there.

    A finder places what it takes for its own fault. Names are compared each at its own onset, until the best of them
    moves the place no more. So is its end: what it takes for a return may be none of another.
    """
    without_end = replace(event, offset_s=None)
    lasts = None if event.offset_s is None else judgement_of(bench, without_end, until_s)
    if lasts is not None and lasts.weights[0].margin > judgement.weights[0].margin:
        event, judgement = without_end, lasts
    for _ in range(MOVES):
        contenders = {each.fault: each for each in (best_as_named(judgement, event), judgement.weights[0])}
        timings = [
            timing
            for each in contenders.values()
            if (timing := timing_of(bench, each, event.onset_s, event.offset_s, until_s=until_s)) is not None
        ]
        if not timings:
            break
        best = max(timings, key=lambda timing: timing.weight.rank)
        if abs(best.onset_s - event.onset_s) < RESTS_S and best.offset_s == event.offset_s:
            break
        moved = replace(event, onset_s=best.onset_s, onset_ci95=best.onset_ci95, offset_s=best.offset_s)
        there = judgement_of(bench, moved, until_s)
        if there is None or not weights_as_named(there, event):
            break
        event, judgement = moved, there
    return event, judgement


def where_it_is_trapped(bench: Bench, event: Event, judgement: Judgement, until_s: float) -> tuple[Event, Judgement]:
    """Return a line that is seen to rest with the interval in which it is trapped: in calm flight it rests before.

    From where it is seen to rest it is placed to where the flight contradicts that.
    """
    weights = weights_as_named(judgement, event)
    timing = timing_of(bench, weights[0], event.onset_s, event.offset_s, until_s=until_s) if weights else None
    if timing is None or timing.weight.refused or timing.weight.margin <= DECLARED:
        return event, judgement
    (earliest_s, latest_s), (first_s, last_s) = event.onset_ci95, timing.onset_ci95
    event = replace(event, onset_ci95=(min(earliest_s, first_s), max(latest_s, last_s)))
    if most_as_named(judgement, event) > DECLARED:
        return event, judgement
    moved = replace(event, onset_s=timing.onset_s)
    there = judgement_of(bench, moved, until_s)
    return (event, judgement) if there is None else (moved, there)


def judgement_of(bench: Bench, event: Event, until_s: float) -> Judgement | None:
    """Return what the flight model says of the place of an event, up to a time."""
    held = event.fault if event.shape == "frozen" else ""
    return judge(bench, event.onset_s, event.offset_s, until_s=until_s, named=event.among, frozen=held)


def weights_as_named(judgement: Judgement, event: Event) -> list[Weight]:
    """Return the weights of the faults that an event may be."""
    names = (FROZEN,) if event.shape == "frozen" else _names(event)
    return [weight for name in names if (weight := judgement.weight(name)) is not None]


def most_as_named(judgement: Judgement, event: Event) -> float:
    """Return the margin of the best of the faults that an event may be."""
    return max((weight.margin for weight in weights_as_named(judgement, event) if not weight.refused), default=-np.inf)


def dated(bench: Bench, event: Event, judgement: Judgement, until_s: float) -> Event:
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


def as_trapped(bench: Bench, event: Event, until_s: float) -> Event:
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
        resting = timed(bench, rest, replace(timing, onset_ci95=within))
        judgement = judgement_of(bench, resting, until_s)
        if judgement is not None and judgement.weights[0].fault == fault:
            gain, trapped = more, resting
    return trapped


def timing_if_over(bench: Bench, event: Event, until_s: float) -> Timing | None:
    """Return from when to when a fault lasts of which an event is the return, None where it is none."""
    if event.offset_s is not None or event.magnitude is None or "holds" in event.stages or event.shape == "drift":
        return None
    faults = ENDED_BY.get(event.fault, ()) if line_of(event) else (event.fault,)
    return begun_before(bench, faults, event.onset_s, sure=DECLARED, until_s=until_s)


def from_its_onset(bench: Bench, event: Event, timing: Timing) -> Event:
    """Return an event that is the return of a fault as that fault."""
    fault, weight = timing.weight.fault, timing.weight
    if weight.growth_s not in (None, np.inf) and event.magnitude is not None:
        # By what the reading comes back the finder measures, beside its own relations.
        as_returned = replace(weight, size=-event.magnitude, sd=event.sd, dispersion=1.0, memory_s=1.0)
        timing = replace(timing, weight=as_returned)
    return replace(
        timed(bench, event, timing),
        among=tuple(dict.fromkeys((fault, *(name for name in event.among if name != event.fault)))),
        note=f"its return at {event.onset_s:.0f} s stood out first",
    )


def timed(bench: Bench, event: Event, timing: Timing) -> Event:
    """Return an event as a fault from when that begins to when it ends."""
    moved = replace(
        event,
        onset_s=timing.onset_s,
        onset_ci95=timing.onset_ci95,
        offset_s=timing.offset_s,
        seen_until_s=max(event.seen_until_s, timing.onset_s),
    )
    return described(bench, moved, timing.weight)


def described(bench: Bench, event: Event, weight: Weight) -> Event:
    """Return an event with the name, the course and the size of a fault; of a line no size is told."""
    line, growth_s = weight.growth_s is None, weight.growth_s or 0.0
    channels = channels_of(weight.fault, bench.model.seconds.recorded)
    channels = with_temperature(channels, weight) if line else channels
    lasts_s = max((event.seen_until_s if event.offset_s is None else event.offset_s) - event.onset_s, 1.0)
    drifts = growth_s == np.inf
    per = lasts_s if drifts else 1.0
    magnitude = None if line else weight.size / per
    sd = None if line or weight.wide_sd is None else weight.wide_sd / per
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


def with_temperature(channels: Sequence[str], weight: Weight) -> tuple[str, ...]:
    """Return the channels that a fault of a line makes wrong: a static temperature where it is made of them."""
    if weight.heats:
        return (*channels,) if "sat" in channels else (*channels, "sat")
    return tuple(name for name in channels if name != "sat")


def _names(event: Event) -> tuple[str, ...]:
    """Return the faults of the flight model that an event may be."""
    return tuple(dict.fromkeys((event.fault, *line_of(event), *event.among)))


def line_of(event: Event) -> frozenset[str]:
    """Return the faults of the pressure line that an event is of, none where it is of a channel."""
    return next((line for line in LINES if event.fault in line), frozenset())
