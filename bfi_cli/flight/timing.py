"""When a fault begins and ends, by its own likelihood: the profile of all rows of the flight model over its onsets.

A finder places what it takes for its own fault; under another fault the same readings begin elsewhere. At every second
about the proposed onset the fault begins at once, and nothing else jumps. What the law of the fault leaves unexplained
widens the profile: log densities are divided by the dispersion at the best onset (quasi-likelihood; McCullagh and
Nelder 1989, 9.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .bench import CHECK_S, JUMP_S, SHOWN_S, Bench, Place, place_of
from .judge import channel_faults, ordinary_of, weights_of_channel
from .lines import LAWS, LEAKS, has_lines, weights_of_laws
from .weight import Ordinary, Weight

REACH_S = 60  # to both sides of a proposed onset or end, in which it is sought: beyond it another fault begins
COARSE_S = 5  # between the seconds that are tried first; then every second between the neighbours of the best
FEWEST_S = 5  # of a fault that are weighed
TAIL = 0.025  # share of the likelihood to each side of an interval


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Peak:
    """The best of some places, those that bound 95 % of the likelihood, and what the fault is worth at the best."""

    best: Place
    first: Place
    last: Place
    weight: Weight


def timing_of(
    bench: Bench, weight: Weight, onset_s: float, offset_s: float | None, *, until_s: float = np.inf
) -> Timing | None:
    """Return when a fault begins and ends; None where the place is not flown for long enough.

    Parameters
    ----------
    weight : of the fault, about where a finder proposes it.
    until_s : what comes later is not weighed.
    """
    flown = bench.model.time_s[min(bench.checks)] + CHECK_S
    earlier_s = int(np.clip(onset_s - flown, 0, REACH_S))
    place = place_of(bench, onset_s, offset_s, until_s, earlier_s=earlier_s)
    if place is None or not _is_weighed(place, weight.fault):
        return None
    time_s, proposed = bench.model.time_s[place.part], place.onset
    last = min(proposed + REACH_S, (place.n if place.offset is None else place.offset) - FEWEST_S)
    part = place.until(last + SHOWN_S)
    ordinary = ordinary_of(part.at(proposed, part.offset, jumps=JUMP_S))
    begins = _peak(weight, [part.at(second, part.offset) for second in range(proposed - earlier_s, last + 1)], ordinary)
    if begins is None:
        return None
    offset, known = offset_s, begins.weight
    if place.offset is not None:
        first = max(begins.best.onset + FEWEST_S, place.offset - REACH_S)
        part = place.until(place.offset + REACH_S + SHOWN_S)
        ordinary = ordinary_of(part.at(begins.best.onset, part.offset, jumps=JUMP_S))
        seconds = range(first, min(place.offset + REACH_S, part.n - 1) + 1)
        ends = _peak(weight, [part.at(begins.best.onset, second) for second in seconds], ordinary)
        if ends is not None:
            assert ends.best.offset is not None
            offset, known = float(time_s[ends.best.offset] - 0.5), ends.weight
    # A reading is the mean of the second about its time: a step that it shows in full began in the second before that,
    # what grows from nothing within it.
    return Timing(
        onset_s=float(time_s[begins.best.onset] - 0.5),
        onset_ci95=(float(time_s[begins.first.onset] - 1.0), float(time_s[begins.last.onset] + 0.5)),
        offset_s=offset,
        weight=known,
    )


def _is_weighed(place: Place, fault: str) -> bool:
    """Return whether the model knows a fault, as one of a line or of a channel."""
    lines = has_lines(place.bench.model) and any(law.fault == fault for law in LAWS)
    return lines or fault in channel_faults(place)


def _weights(weight: Weight, places: Sequence[Place], ordinary: Ordinary) -> list[Weight]:
    """Return what a fault is worth at places: of a line by the best of its laws, of a channel as it grew."""
    if weight.growth_s is not None:
        return list(weights_of_channel(weight.fault, weight.growth_s, places, ordinary))
    laws = [law for law in (*LAWS, *LEAKS) if law.fault == weight.fault]
    weights = weights_of_laws([(law, place) for place in places for law in laws], ordinary)
    by_place = (weights[k : k + len(laws)] for k in range(0, len(weights), len(laws)))
    return [max(some, key=lambda weight: weight.margin) for some in by_place]


def _peak(weight: Weight, places: Sequence[Place], ordinary: Ordinary) -> _Peak | None:
    """Return the best of places in the order of time, and those between which 95 % of the likelihood lie."""
    if not places:
        return None
    tried: dict[int, Weight] = {}
    coarse = range(0, len(places), COARSE_S)
    tried.update(zip(coarse, _weights(weight, [places[k] for k in coarse], ordinary), strict=True))
    best = max(tried, key=lambda k: tried[k].margin)
    fine = [k for k in range(max(best - COARSE_S, 0), min(best + COARSE_S, len(places) - 1) + 1) if k not in tried]
    if fine:
        tried.update(zip(fine, _weights(weight, [places[k] for k in fine], ordinary), strict=True))
    best = max(tried, key=lambda k: tried[k].margin)
    known = sorted(tried)
    profile = np.interp(range(len(places)), known, [tried[k].margin for k in known])
    share = np.exp((profile - profile.max()) / tried[best].dispersion)
    below = np.cumsum(share) / share.sum()
    first, last = int(np.searchsorted(below, TAIL)), int(np.searchsorted(below, 1.0 - TAIL))
    return _Peak(
        best=places[best],
        first=places[min(first, best)],
        last=places[max(min(last, len(places) - 1), best)],
        weight=tried[best],
    )
