"""Static relations over the windows of a flight: what they found, and which channels they clear."""

from __future__ import annotations

from collections.abc import Sequence

from ..kernels.progress import Report, silent
from ..parity.static_relations import StaticRelations, find_static, relation_series
from ..parity.windows import Window, overlaps
from .events import Draft, join
from .flight import Flight

__all__ = ["StaticWindows", "drafts_of_relations", "find_relations", "intact_channels"]

StaticWindows = Sequence[tuple[Window, StaticRelations]]


def find_relations(flight: Flight, *, report: Report = silent) -> StaticWindows:
    """Return what the static relations say on every window of two minutes, of one in a shorter flight."""
    series = relation_series(flight.log)
    windows = flight.windows((120.0,))[120.0] or flight.windows((60.0,))[60.0]
    answers = []
    for k, window in enumerate(windows):
        report(k / len(windows))
        answers.append((window, find_static(flight.log, *window, series=series)))
    return answers


def drafts_of_relations(answers: StaticWindows) -> list[Draft]:
    """Return what the static relations found, windows that overlap joined."""
    drafts = [
        Draft(finding=finding, window=window, until_s=window[1])
        for window, answer in answers
        for finding in answer.findings
    ]
    return join(drafts)


def intact_channels(static: StaticWindows, window: Window) -> dict[str, bool]:
    """Return by channel whether every static relation that it stands in is intact over a window."""
    found: dict[str, bool] = {}
    for where, answer in static:
        for relation in answer.relations if overlaps(window, [where]) else ():
            whole = relation.statistic < relation.threshold or relation.effect < relation.least_effect
            for name in relation.channels:
                found[name] = found.get(name, True) and whole
    return found
