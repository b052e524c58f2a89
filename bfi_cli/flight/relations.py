"""Relations between channels over a flight: static ones, and airspeeds that other signs of flight overrule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..flightlog.phases import Disagreement
from ..kernels.progress import Report, silent
from ..quantities.channels import STANDARD
from .events import Draft, clusters, errors_of_rivals, join
from .flight import Flight
from .naming import channels_of
from .parity import Finding
from .parity.relation_course import with_course, with_onset_of_samples
from .parity.sampled import unit_of
from .parity.sensors import altitude_step_within
from .parity.static_relations import MARGIN_S, StaticRelations, find_static
from .parity.windows import Window, overlaps

StaticWindows = Sequence[tuple[Window, StaticRelations]]

# Windows of two minutes in a row in which a drift is described: a longer one tells a slow onset better, and holds more
# of what a healthy relation follows.
LONGEST = 4
# Seconds of a part of a flight that tell what begins at its start: those of a short window without its margin.
STARTING_S = 52.0
# Seconds to both sides of the onset of an airspeed that is overruled: their smoothing.
ONSET_S = 5.0
# Seconds beside it that are shown.
AROUND_S = 60.0


def find_relations(flight: Flight, *, report: Report = silent) -> StaticWindows:
    """Return what the static relations say on every window of two minutes, of one in a shorter flight."""
    windows = flight.windows(120.0) or flight.windows(60.0)
    answers = []
    for k, window in enumerate(windows):
        report(k / len(windows))
        answers.append((window, find_static(flight.log, *window, series=flight.series)))
    return answers


def drafts_of_relations(flight: Flight, answers: StaticWindows) -> list[Draft]:
    """Return what the static relations found, windows that overlap joined.

    A drift changes its relation in every window that follows; the first of these, with what came before, tell it.
    """
    broken = [(window, answer.findings[0]) for window, answer in answers if answer.findings]
    drafts = []
    for run in clusters([window for window, _ in broken]):
        members = [Draft(finding=broken[k][1], window=broken[k][0], until_s=broken[k][0][1]) for k in run]
        (joined,) = join(members)
        if joined.finding.magnitude is None:
            drafts.append(_stuck(flight, joined, members))
            continue
        if len(members) > 2:
            joined = _from_the_start(flight, joined, members[0])
        drafts.append(_less_refuted(flight, _with_course(flight, joined)))
    return drafts


def drafts_at_start(flight: Flight, answers: StaticWindows) -> list[Draft]:
    """Return what begins too near the start of a part of a flight for its windows, by what is recorded before it too.

    A change needs both sides.
    """
    window = (flight.from_s - MARGIN_S, flight.from_s + STARTING_S)
    known = any(answer.findings for beside, answer in answers if overlaps(window, [beside]))
    if known or not flight.is_part:
        return []
    drafts = drafts_of_relations(flight, [(window, find_static(flight.log, *window, series=flight.series))])
    return [draft for draft in drafts if 0.0 <= draft.finding.onset_s - flight.from_s < MARGIN_S]


def _less_refuted(flight: Flight, draft: Draft) -> Draft:
    """Return a draft of a step, without the altitude among what may be at fault where its recorded rate denies that."""
    finding, size = draft.finding, errors_of_rivals(draft.finding).get("altitude")
    if size is None or finding.shape != "bias" or "altitude_rate" not in flight.recorded:
        return draft
    without = flight.held_stretches
    if size <= altitude_step_within(flight.record, flight.phases, without, finding.onset_ci95):
        return draft
    return replace(draft, finding=replace(finding, among=tuple(name for name in finding.among if name != "altitude")))


def _stuck(flight: Flight, joined: Draft, members: Sequence[Draft]) -> Draft:
    """Return the draft of a stuck sensor, from the window that shows its onset best to the end that the last one shows.

    What is stuck has the course of its twin. Windows that begin when it is stuck already do not tell since when.
    """
    same = [
        draft for draft in members if (draft.finding.fault, draft.finding.magnitude) == (joined.finding.fault, None)
    ]
    begins = [draft for draft in same if np.isfinite(draft.finding.onset_ci95[0])]
    best = max(begins, key=lambda draft: draft.finding.statistic) if begins else same[0]
    effect = {best.finding.fault: max(draft.finding.effect[best.finding.fault] for draft in same)}
    first_s, last_s = best.finding.onset_ci95
    finding = replace(
        best.finding,
        onset_ci95=(max(first_s, flight.from_s), last_s),
        offset_s=same[-1].finding.offset_s,
        effect=effect,
    )
    return replace(joined, finding=finding, window=best.window)


def _with_course(flight: Flight, draft: Draft) -> Draft:
    """Return a draft with the course of its error, from the relation that shows it best.

    A ramp that still grows where the window ends may stop later: the window goes on while it does.
    """
    finding = draft.finding
    shown = [
        relation_series
        for relation_series in flight.series[0]
        if relation_series.relation.declares and finding.fault in relation_series.effects
    ]
    best = max(shown, key=lambda relation_series: finding.evidence.get(relation_series.relation.name, 0.0))
    (first_s, last_s), length_s = draft.window, draft.window[1] - draft.window[0]
    _, end_s = flight.stretch_of(draft.window)
    while True:
        described = with_course(best, finding, (first_s, last_s), unit_of(flight.log, finding.fault))
        if described.shape != "drift" or last_s >= min(end_s, first_s + LONGEST * length_s):
            dated = with_onset_of_samples(best, described, flight.log)
            return replace(draft, finding=dated, window=(first_s, last_s), until_s=max(draft.until_s, last_s))
        last_s = min(last_s + 0.5 * length_s, end_s)


def _from_the_start(flight: Flight, joined: Draft, first: Draft) -> Draft:
    """Return the draft of a run of windows in a longer one, about the first of these, where that names the same."""
    length_s = first.window[1] - first.window[0]
    window = (
        max(flight.stretch_of(first.window)[0], first.window[0] - length_s),
        min(joined.until_s, first.window[0] + LONGEST * length_s),
    )
    answer = find_static(flight.log, *window, series=flight.series)
    if not answer.findings or not {*answer.findings[0].among} & {*joined.finding.among}:
        return replace(joined, finding=first.finding, window=first.window)
    return replace(joined, finding=answer.findings[0], window=window)


def intact_channels(static: StaticWindows, window: Window) -> dict[str, bool]:
    """Return by channel whether every static relation that it stands in is intact over a window."""
    beside = [relation for where, answer in static if overlaps(window, [where]) for relation in answer.relations]
    broken = {name for relation in beside if relation.changes for name in relation.channels}
    return {name: name not in broken for relation in beside for name in relation.channels}


def drafts_of_disagreements(flight: Flight, held: Sequence[Draft]) -> list[Draft]:
    """Return the airspeeds that are overruled as faults: one alone by itself, all together as one of their line.

    Parameters
    ----------
    held : what the pressure lines show; where that names the line too it is the better description.
    """
    together: dict[tuple[float, float], list[Disagreement]] = {}
    drafts = []
    for disagreement in flight.disagreements:
        if disagreement.to_s <= flight.from_s or disagreement.from_s >= flight.to_s:
            continue
        if disagreement.alone:
            drafts.append(_overruled(flight, disagreement, (disagreement.channel,), (disagreement.channel,)))
        else:
            together.setdefault((disagreement.from_s, disagreement.to_s), []).append(disagreement)
    for (from_s, to_s), those in together.items():
        if not any(draft.from_s < to_s and draft.until_s > from_s for draft in held):
            alone = () if len(those) > 1 or "p_total" in flight.recorded else (those[0].channel,)
            among = (*alone, "pitot_leak", "pitot_blocked")
            drafts.append(_overruled(flight, those[0], among, channels_of("q_impact", flight.recorded)))
    return drafts


def _overruled(flight: Flight, disagreement: Disagreement, among: tuple[str, ...], channels: tuple[str, ...]) -> Draft:
    """Return one stretch as a fault, without an end: an airspeed that may be that of a flight again may still err."""
    finding = Finding(
        fault=among[0],
        among=among,
        channels=channels,
        stage="sensors",
        shape="bias" if among[0] in STANDARD else among[0],
        unit=STANDARD[disagreement.channel].unit if among[0] in STANDARD else "",
        onset_s=disagreement.from_s,
        # What falls slowly has begun before it says "ground".
        onset_ci95=(disagreement.from_s - disagreement.least_s - ONSET_S, disagreement.latest_s + ONSET_S),
        statistic=disagreement.to_s - disagreement.from_s,
        threshold=disagreement.least_s,
        doubt=""
        if disagreement.certain
        else "at least as many signs of the log say that the aircraft is on the ground",
        effect={} if disagreement.error is None else {disagreement.channel: abs(disagreement.error)},
    )
    window = flight.around(disagreement.from_s, disagreement.to_s, AROUND_S)
    return Draft(finding=finding, window=window, until_s=min(flight.to_s, disagreement.to_s))
