"""What windows of a flight found, joined into events: one fault is one event, whichever analyses saw it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..decision import beyond_tolerance
from .flight import Flight
from .naming import hypothesis_of
from .parity import Finding
from .parity.explain import course_for
from .parity.windows import Window, overlaps

# A finding belongs to an event that began at most this long after it: onsets of slow faults are uncertain by as much.
# Twice the standard deviation of 7.5 s that the Cramer-Rao bound leaves a drift in 240 s (docs/theory.md, 15.7).
BEFORE_S = 15.0
# Relative, of the frequency of an oscillation where it begins and where it ends.
# The peak of a window of 120 s is as wide at 0.17 Hz.
FREQUENCY_TOLERANCE = 0.05
# Share of what a fault has grown to by which a step back may miss where it came from: so much where the intervals say
# nothing, standard deviations of both where they do, and never more than that share, which would be a part of a return.
# Chosen by hand, not tuned.
STEP_BACK, SURE, MOST_LEFT = 0.1, 3.0, 0.5
# The order of trust: what a line or a relation shows is exact, what windows of a regression show is not. A line that is
# held goes before the relations that it disturbs.
RANK = {stage: rank for rank, stage in enumerate(("sensors", "holds", "static relations", "parity", "scan"))}
# Those that see errors which last; a line that is held is told with its end, and a step or an oscillation is over.
LASTING = ("sensors", "static relations", "parity")


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A finding with its window, and until when windows show it; `also` what other analyses found of it.

    `lasting` are the faults that began before its window and were left out.
    """

    finding: Finding
    window: Window
    until_s: float
    also: tuple[Finding, ...] = ()
    lasting: tuple[str, ...] = ()

    @property
    def from_s(self) -> float:
        return min(self.finding.onset_s, self.finding.onset_ci95[0])


def clusters(windows: Sequence[Window]) -> list[list[int]]:
    """Return the indices of windows that overlap each other, directly or through others, in order of time."""
    order = sorted(range(len(windows)), key=lambda k: windows[k])
    runs: list[list[int]] = []
    end = float("-inf")
    for k in order:
        if windows[k][0] < end:
            runs[-1].append(k)
        else:
            runs.append([k])
        end = max(end, windows[k][1])
    return runs


def join(drafts: Sequence[Draft]) -> list[Draft]:
    """Return the drafts of one analysis with those of overlapping windows joined; the strongest describes them."""
    joined = []
    for cluster in clusters([draft.window for draft in drafts]):
        members = [drafts[k] for k in cluster]
        best = max(
            members, key=lambda draft: (not draft.finding.doubt, draft.finding.statistic / draft.finding.threshold)
        )
        until_s = max(draft.until_s for draft in members)
        joined.append(replace(best, until_s=until_s))
    return joined


def merge_stages(drafts: Sequence[Draft], small: Sequence[Draft] = ()) -> list[Draft]:
    """Return the drafts of all analyses as events: what overlaps in time and in what errs is one fault.

    The most trusted analysis describes it. A scan for steps watches the airspeed alone and is disturbed by whatever is
    wrong with its inputs, so that it joins any event of its time.

    Parameters
    ----------
    small : drafts that are surely within the tolerances; they join the others, which do not join them.
    """
    events: list[Draft] = []
    # What is only suspected describes no event that is certain.
    order = partial(sorted, key=lambda draft: (not is_certain(draft), RANK[draft.finding.stage], draft.finding.onset_s))
    for draft in (*order(drafts), *order(small)):
        for k, event in enumerate(events):
            if explains(event, draft):
                best, other = (draft, event) if _sizes_better(draft, event) else (event, draft)
                events[k] = replace(
                    best,
                    until_s=max(event.until_s, draft.until_s),
                    also=(*best.also, other.finding, *other.also),
                )
                break
        else:
            events.append(draft)
    return sorted(events, key=lambda event: event.finding.onset_s)


def _sizes_better(draft: Draft, event: Draft) -> bool:
    """Return whether a draft is the same change as an event, of the same trust, and tells its size better."""
    a, b = draft.finding, event.finding
    if a.sd is None or b.sd is None or "drift" in (a.shape, b.shape):
        return False
    same = (a.fault, a.stage, a.doubt) == (b.fault, b.stage, b.doubt)
    return same and overlaps(a.onset_ci95, [b.onset_ci95]) and a.sd < b.sd


def with_ends(drafts: Sequence[Draft]) -> list[Draft]:
    """Return the drafts of the scan with each oscillation and its end as one.

    Inside of an oscillation no window shows a change; where it ends the next one does, of the same frequency.
    """
    ended_drafts: list[Draft] = []
    for draft in sorted(drafts, key=lambda draft: draft.finding.onset_s):
        last = ended_drafts[-1] if ended_drafts else None
        if last is not None and last.finding.offset_s is None and _same_frequency(last.finding, draft.finding):
            ended = replace(last.finding, offset_s=draft.finding.onset_s)
            ended_drafts[-1] = replace(last, finding=ended, until_s=draft.until_s, also=(*last.also, draft.finding))
        else:
            ended_drafts.append(draft)
    return ended_drafts


def is_certain(draft: Draft) -> bool:
    """Return whether a draft is above its threshold and beyond doubt."""
    finding = draft.finding
    return not finding.doubt and (finding.stage != "parity" or finding.statistic > finding.threshold)


def as_one(events: Sequence[Draft]) -> list[Draft]:
    """Return events in which what errs once and errs again is one: a sensor that failed may fail further, or recover.

    A step back to where it was is its end, and what errs after that is another event. A single channel's error that
    changes no more is not seen by any analysis, so that nothing else says how long it lasts.
    """
    faults: list[Draft] = []
    for event in events:
        for k, earlier in enumerate(faults):
            begun = is_certain(earlier) and earlier.finding.offset_s is None
            if begun and _fails_further(event.finding, earlier.finding):
                back = is_return(event.finding, earlier.finding)
                finding = replace(earlier.finding, offset_s=event.finding.onset_s) if back else earlier.finding
                faults[k] = replace(
                    earlier,
                    finding=finding,
                    until_s=max(earlier.until_s, event.until_s),
                    also=(*earlier.also, event.finding, *event.also),
                )
                break
        else:
            faults.append(event)
    return faults


def _fails_further(finding: Finding, earlier: Finding) -> bool:
    """Return whether an event of the slow kind names the sensor of an earlier one, or cannot tell it from that."""
    if finding.stage not in LASTING or earlier.stage not in LASTING:
        return False
    return hypothesis_of(finding.fault)[0] == hypothesis_of(earlier.fault)[0] or (
        len(finding.among) > 1 and earlier.fault in finding.among
    )


def is_return(finding: Finding, earlier: Finding) -> bool:
    """Return whether a finding is the end of an earlier one: its sensor goes back to where it was before that.

    It goes back at once or within seconds, in the other direction, by what the earlier fault has grown to by then.
    """
    since_s, course = finding.onset_s - earlier.onset_s, course_for(earlier.shape, earlier.constant_s)
    if finding.magnitude is None or earlier.magnitude is None or earlier.offset_s is not None or since_s <= 0.0:
        return False
    (sensor, sign), (failed, sign_of_failure) = hypothesis_of(finding.fault), hypothesis_of(earlier.fault)
    if (
        sensor != failed
        or finding.shape == "drift"
        or course is None
        or course_for(finding.shape, finding.constant_s) is None
    ):
        return False
    grown = float(course(np.array([since_s]))[0])
    size, step = sign_of_failure * earlier.magnitude * grown, sign * finding.magnitude
    # Both are shares of an impact pressure, the second of what the first has left.
    left = (1.0 + size) * (1.0 + step) - 1.0 if sensor == "q_impact" else size + step
    sd = float(np.hypot(finding.sd or 0.0, grown * (earlier.sd or 0.0)))
    return size * step < 0.0 and abs(left) <= min(max(STEP_BACK * abs(size), SURE * sd), MOST_LEFT * abs(size))


def _same_frequency(finding: Finding, other: Finding) -> bool:
    if finding.frequency_hz is None or other.frequency_hz is None or finding.fault != other.fault:
        return False
    return abs(finding.frequency_hz - other.frequency_hz) <= FREQUENCY_TOLERANCE * finding.frequency_hz


def explains(event: Draft, draft: Draft) -> bool:
    """Return whether an event accounts for what another analysis found at its time: by its stage, or by what errs."""
    overlaps = draft.from_s <= event.until_s and draft.until_s >= event.from_s - BEFORE_S
    if not overlaps:
        return False
    # While a line is held, whatever is compared with its pressure disagrees.
    if event.finding.stage == "holds":
        return draft.finding.onset_ci95[1] >= event.from_s - BEFORE_S
    if event.finding.stage == "sensors":  # it lasts as long as the flight, and nothing else uses the channel
        return False
    if draft.finding.stage == "scan":
        if event.finding.stage == "scan" and event.window == draft.window:  # a search names each of its faults once
            return False
        # Relations between channels say nothing of an oscillation that all of them have, but of one that errs alone.
        swings = draft.finding.frequency_hz is not None and event.finding.frequency_hz is None
        named = event.finding.fault in draft.finding.among
        return named or not (swings and event.finding.stage == "static relations")
    alike = {*draft.finding.among, *draft.finding.channels} & {*event.finding.among, *event.finding.channels}
    return bool(alike)


def beyond_its_tolerance(flight: Flight, draft: Draft) -> bool | None:
    """Return whether the error of a draft surely exceeds, or surely keeps within, the tolerances of its channels.

    The ends of the 95 % interval of its size decide, by the channel that is nearest to its tolerance or furthest beyond
    it. None where the interval holds that, where no size or no tolerance is known, and where another channel that may
    be the one at fault would err by more than its own.
    """
    share, finding = _share(flight, draft), draft.finding
    if share is None or finding.magnitude is None or finding.sd is None:
        return None
    surely = beyond_tolerance(share, finding.magnitude, finding.sd, 1.0)
    other = _share(flight, replace(draft, finding=replace(finding, effect=errors_of_rivals(finding))))
    return None if surely is False and other is not None and other > 1.0 else surely


def errors_of_rivals(finding: Finding) -> dict[str, float]:
    """Return the largest error of every other channel that may be the one at fault."""
    return {
        name: size * abs(finding.effect.get(finding.fault, 0.0))
        for name, size in finding.rivals.items()
        if name in finding.among
    }


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
    finding = draft.finding
    until_s = draft.until_s if finding.offset_s is None else finding.offset_s
    shown_s, until_s = draft.window[1] - finding.onset_s, until_s - finding.onset_s
    grown = growth(finding.shape, finding.constant_s, shown_s=shown_s, until_s=until_s)
    shares = [
        abs(size) * grown / tolerance
        for channel, size in finding.effect.items()
        if (tolerance := flight.tolerance(channel, draft.window)) is not None and tolerance > 0.0
    ]
    return max(shares, default=None)
