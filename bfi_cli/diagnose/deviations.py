"""How large the error of an event is beside what may be tolerated: what is real but small is no fault of the flight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..decision import beyond_tolerance
from ..parity.explain import course_for
from .events import Draft
from .flight import Flight


def beyond_its_tolerance(flight: Flight, draft: Draft) -> bool | None:
    """Return whether the error of a draft surely exceeds, or surely keeps within, the tolerances of its channels.

    The ends of the 95 % interval of its size decide, by the channel that is nearest to its tolerance or furthest beyond
    it. None where the interval holds that, and where no size or no tolerance is known.
    """
    share, one = _share(flight, draft), draft.finding
    if share is None or one.magnitude is None or one.sd is None:
        return None
    return beyond_tolerance(share, one.magnitude, one.sd, 1.0)


def growth(shape: str, constant_s: float | None, *, shown_s: float, until_s: float) -> float:
    """Return how many times as large the error of a course is after `until_s` as after `shown_s`, at least 1.

    Both are counted from the onset.
    """
    course = course_for(shape, constant_s)
    if course is None:
        return 1.0
    shown, reached = course(np.array([shown_s, max(until_s, shown_s)]))
    return float(reached / shown) if shown > 0.0 else 1.0


def largest_first(flight: Flight, drafts: Sequence[Draft]) -> list[Draft]:
    """Return drafts by what they make of a channel beside its tolerance; those of unknown size are the first."""

    def order(draft: Draft) -> tuple[float, float]:
        share = _share(flight, draft)
        return (-np.inf if share is None else -share, draft.finding.onset_s)

    return sorted(drafts, key=order)


def _share(flight: Flight, draft: Draft) -> float | None:
    """Return the largest error of a draft over the tolerance of its channel, None where nothing tells it.

    What grows in the window that describes it may grow on: until the last window that shows it.
    """
    one = draft.finding
    until_s = draft.until_s if one.offset_s is None else one.offset_s
    shown_s, until_s = draft.window[1] - one.onset_s, until_s - one.onset_s
    grown = growth(one.shape, one.constant_s, shown_s=shown_s, until_s=until_s)
    shares = [
        abs(size) * grown / tolerance
        for channel, size in one.effect.items()
        if (tolerance := flight.tolerance(channel, draft.window)) is not None and tolerance > 0.0
    ]
    return max(shares, default=None)
