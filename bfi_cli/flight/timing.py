"""When a fault begins and ends, by its own likelihood: the profile of all rows of the flight model over its onsets.

A finder places what it takes for its own fault; under another fault the same readings begin elsewhere. At every second
about the proposed onset the fault begins at once, and nothing else jumps. What the law of the fault leaves unexplained
widens the profile: log densities are divided by the dispersion at the best onset (quasi-likelihood; McCullagh and
Nelder 1989, 9.2).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .bench import CHECK_S, JUMP_S, SHOWN_S, Bench, Place, place_of
from .judge import GROWTHS_S, channel_faults, ordinary_of, weights_of_channel
from .lines import ICINGS, LAWS, LEAKS, Law, has_lines, weights_of_laws
from .weight import Ordinary, Weight

REACH_S = 60  # to both sides of a proposed onset or end, in which it is sought: beyond it another fault begins
COARSE_S = 5  # between the seconds that are tried first; then every second between the neighbours of the best
FEWEST_S = 5  # of a fault that are weighed
TAIL = 0.025  # share of the likelihood to each side of an interval
# Before what may be the end of a fault, in which its onset is sought, and between the onsets that are tried first: an
# error that lasts shows at any of them.
EARLIER_S, EARLIER_STEP_S = 420, 30
# Seconds in which an error grew that is over, and shares of these that are tried beside the best: of `GROWTHS_S` the
# finer ones.
GROWN_S = (0.0, 10.0, 20.0, 40.0, 60.0, 80.0, 110.0, 150.0, 200.0, np.inf)
BESIDE = (0.75, 0.82, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3)
# OCTAVE [1]: shares of a time constant of `LEAKS`, whose neighbours are half and twice as long, tried beside the best.
OCTAVE = (0.71, 0.84, 1.0, 1.19, 1.41)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Onset of a fault, s, with its 95 % interval, and its end, None where none is known.

    Attributes
    ----------
    weight : what the fault is worth as it begins and ends there.
    """

    onset_s: float
    onset_ci95: tuple[float, float]
    offset_s: float | None
    weight: Weight


Course = float | Law  # of a channel the seconds of its growth, of a line its law


@dataclass(frozen=True, slots=True, kw_only=True)
class _Peak:
    """The best of some places, those that bound 95 % of the likelihood, and what the fault is worth at the best."""

    best: Place
    first: Place
    last: Place
    weight: Weight
    course: Course


def timing_of(
    bench: Bench,
    weight: Weight,
    onset_s: float,
    offset_s: float | None,
    *,
    until_s: float = np.inf,
    latest_s: float = -np.inf,
) -> Timing | None:
    """Return when a fault begins and ends; None where the place is not flown for long enough.

    Parameters
    ----------
    weight : of the fault, about where a finder proposes it.
    until_s : what comes later is not weighed.
    latest_s : until when an onset is sought where that is later than about the proposed one.
    """
    flown = bench.model.time_s[min(bench.checks)] + CHECK_S
    earlier_s = int(np.clip(onset_s - flown, 0, REACH_S))
    place = place_of(bench, onset_s, offset_s, until_s, earlier_s=earlier_s)
    if place is None or not _is_weighed(place, weight.fault):
        return None
    fault, proposed = weight.fault, place.onset
    later = max(proposed + REACH_S, int(np.searchsorted(bench.model.time_s, latest_s)) - place.first)
    last = min(later, (place.n if place.offset is None else place.offset) - FEWEST_S)
    course: Course | None = weight.growth_s
    if course is None:
        # A course of ice that stays moves the onset where the ice takes another: the straight one tells it.
        course = _law(place, fault, (*LAWS, *LEAKS), proposed, place.offset, ordinary_of(place))
    part = place.until(last + SHOWN_S)
    ordinary = ordinary_of(part.at(proposed, part.offset, jumps=JUMP_S))
    onsets = range(proposed - earlier_s, last + 1)
    places = [part.at(second, part.offset) for second in onsets]
    begins = _peak(fault, (course,), places, ordinary)
    if begins is not None and isinstance(course, Law) and course.time_constant_s is not None:
        between = [replace(course, time_constant_s=share * course.time_constant_s) for share in OCTAVE]
        near = range(begins.first.onset - COARSE_S, begins.last.onset + COARSE_S + 1)
        begins = _peak(fault, between, [place for place in places if place.onset in near], ordinary)
    if begins is None:
        return None
    ends = None
    if place.offset is not None and place.offset < place.n:  # an end behind what is weighed stays as proposed
        part = place.until(place.offset + REACH_S + SHOWN_S)
        ordinary = ordinary_of(part.at(begins.best.onset, part.offset, jumps=JUMP_S))
        ends = _end(fault, begins, part, REACH_S, ordinary)
    return _timing(begins, ends, offset_s)


def _end(fault: str, begins: _Peak, part: Place, reach_s: int, ordinary: Ordinary) -> _Peak | None:
    """Return when a fault ends that begins at a second of a part with an end."""
    assert part.offset is not None
    onset = begins.best.onset
    seconds = range(max(onset + FEWEST_S, part.offset - reach_s), min(part.offset + reach_s, part.n - 1) + 1)
    return _peak(fault, (begins.course,), [part.at(onset, second) for second in seconds], ordinary)


def _timing(begins: _Peak, ends: _Peak | None, offset_s: float | None) -> Timing:
    time_s = begins.best.bench.model.time_s[begins.best.first :]
    known = begins.weight
    if ends is not None:
        assert ends.best.offset is not None
        offset_s, known = float(time_s[ends.best.offset] - 0.5), ends.weight
    # A reading is the mean of the second about its time: a step that it shows in full began in the second before that,
    # what grows from nothing within it.
    return Timing(
        onset_s=float(time_s[begins.best.onset] - 0.5),
        onset_ci95=(float(time_s[begins.first.onset] - 1.0), float(time_s[begins.last.onset] + 0.5)),
        offset_s=offset_s,
        weight=known,
    )


def begun_before(
    bench: Bench, faults: Collection[str], end_s: float, *, sure: float, until_s: float = np.inf
) -> Timing | None:
    """Return when a fault began that is over at a time; None where one that begins then explains the flight as well.

    Parameters
    ----------
    faults : that may be over.
    end_s : where a finder proposes the fault: what comes back steps there, too.
    sure : log density by which a fault that is over must explain the flight better, and better than none.
    until_s : what comes later is not weighed.
    """
    flown = bench.model.time_s[min(bench.checks)] + CHECK_S
    earlier_s = int(np.clip(end_s - flown, 0, EARLIER_S))
    place = place_of(bench, end_s, None, until_s, earlier_s=earlier_s)
    if place is None:
        return None
    end = place.onset
    place = place.until(end + SHOWN_S)
    onsets = range(end - earlier_s, end - FEWEST_S, EARLIER_STEP_S)
    if not onsets:
        return None
    ordinary, started = ordinary_of(place), [place.at(second, end) for second in onsets]
    over: dict[str, tuple[Place, Weight]] = {}
    for fault in faults:
        if not _is_weighed(place, fault):
            continue
        courses = _first_courses(place, fault)
        at, weight = _best_place(fault, courses, started, ordinary)
        if weight.refused or weight.margin <= sure:
            continue
        _, begins = _best_place(fault, courses, [place.at(end + beside, None) for beside in (-1, 0, 1)], ordinary)
        if begins.refused or weight.margin > sure + begins.margin:
            over[fault] = at, weight
    most = max((weight.margin for _, weight in over.values()), default=0.0)
    peaks = [
        (fault, peak)
        for fault, (at, weight) in over.items()
        if weight.margin > most - sure * weight.dispersion and (peak := _onset_of_over(at, fault, earlier_s, ordinary))
    ]
    if not peaks:
        return None
    fault, onset = max(peaks, key=lambda pair: pair[1].weight.rank)
    return _timing(onset, _end(fault, onset, place.at(end, end), COARSE_S, ordinary), end_s)


def _first_courses(place: Place, fault: str) -> Sequence[Course]:
    """Return the courses of a fault that are tried first."""
    return GROWTHS_S if fault in channel_faults(place.bench.model) else [law for law in LAWS if law.fault == fault]


def _best_place(
    fault: str, courses: Sequence[Course], places: Sequence[Place], ordinary: Ordinary
) -> tuple[Place, Weight]:
    """Return the place at which a fault is worth most, by the best of its courses."""
    weights = [weight for weight, _ in _weights(fault, courses, places, ordinary)]
    return max(zip(places, weights, strict=True), key=lambda at: at[1].rank)


def _onset_of_over(began: Place, fault: str, earlier_s: int, ordinary: Ordinary) -> _Peak | None:
    """Return when a fault with an end began that began about a place."""
    end = began.offset
    assert end is not None

    def peak(courses: Sequence[Course], about: int) -> _Peak | None:
        near = range(max(about - EARLIER_STEP_S, end - earlier_s), min(about + EARLIER_STEP_S, end - FEWEST_S) + 1)
        return _peak(fault, courses, [began.at(second, end) for second in near], ordinary)

    if fault not in channel_faults(began.bench.model):
        laws = (*LAWS, *ICINGS, *LEAKS)
        return peak([_law(began, fault, laws, began.onset, end, ordinary)], began.onset)
    onset = peak(GROWN_S, began.onset)
    if onset is not None and not isinstance(onset.course, Law) and 0.0 < onset.course < np.inf:
        return peak([share * onset.course for share in BESIDE], onset.best.onset)
    return onset


def _law(place: Place, fault: str, laws: Sequence[Law], onset: int, offset: int | None, ordinary: Ordinary) -> Law:
    """Return which of some laws a line goes on by that fails about a second of a part."""
    reach_s = EARLIER_STEP_S // 2
    seconds = range(max(onset - reach_s, 0), onset + reach_s + 1, COARSE_S)
    about = [place.at(second, offset) for second in seconds if second < place.n - FEWEST_S]
    weights = _weights(fault, [law for law in laws if law.fault == fault], about, ordinary)
    law = max(weights, key=lambda pair: pair[0].rank)[1]
    assert isinstance(law, Law)
    return law


def _is_weighed(place: Place, fault: str) -> bool:
    """Return whether the model knows a fault, as one of a line or of a channel."""
    lines = has_lines(place.bench.model) and any(law.fault == fault for law in LAWS)
    return lines or fault in channel_faults(place.bench.model)


def _weights(
    fault: str, courses: Sequence[Course], places: Sequence[Place], ordinary: Ordinary
) -> list[tuple[Weight, Course]]:
    """Return what a fault is worth at places, each by the best of its courses."""
    laws = [course for course in courses if isinstance(course, Law)]
    growths = [course for course in courses if not isinstance(course, Law)]
    by_course = [weights_of_channel(fault, growth_s, places, ordinary) for growth_s in growths]
    if laws:
        weights = weights_of_laws([(law, place) for law in laws for place in places], ordinary)
        by_course += [weights[k : k + len(places)] for k in range(0, len(weights), len(places))]
    used: list[Course] = [*growths, *laws]
    best = [max(range(len(used)), key=lambda j: by_course[j][k].rank) for k in range(len(places))]
    return [(by_course[j][k], used[j]) for k, j in enumerate(best)]


def _peak(fault: str, courses: Sequence[Course], places: Sequence[Place], ordinary: Ordinary) -> _Peak | None:
    """Return the best of places in the order of time, and those between which 95 % of the likelihood lie."""
    if not places:
        return None
    weighed: dict[int, tuple[Weight, Course]] = {}

    def weigh(some: Sequence[int]) -> list[Weight]:
        weights = _weights(fault, courses, [places[k] for k in some], ordinary)
        weighed.update(zip(some, weights, strict=True))
        return [weight for weight, _ in weights]

    best, first, last = likeliest(len(places), weigh)
    weight, course = weighed[best]
    return _Peak(best=places[best], first=places[first], last=places[last], weight=weight, course=course)


def likeliest(n: int, weigh: Callable[[Sequence[int]], Sequence[Weight]]) -> tuple[int, int, int]:
    """Return the place with the largest margin of n in the order of time, and those that bound 95 % of the likelihood.

    Parameters
    ----------
    weigh : to what a fault is worth at some of the places; of these every fifth and all about the best are asked for.
    """
    weights: dict[int, Weight] = {}

    def best() -> int:
        return max(weights, key=lambda k: weights[k].margin)

    coarse = range(0, n, COARSE_S)
    weights.update(zip(coarse, weigh(coarse), strict=True))
    about = range(max(best() - COARSE_S, 0), min(best() + COARSE_S, n - 1) + 1)
    fine = [k for k in about if k not in weights]
    if fine:
        weights.update(zip(fine, weigh(fine), strict=True))
    peak, weighed = best(), sorted(weights)
    profile = np.interp(range(n), weighed, [weights[k].margin for k in weighed])
    share = np.exp((profile - profile.max()) / weights[peak].repeated)
    below = np.cumsum(share) / share.sum()
    first, last = int(np.searchsorted(below, TAIL)), int(np.searchsorted(below, 1.0 - TAIL))
    return peak, min(first, peak), max(min(last, n - 1), peak)
