"""Slow faults: runs of windows in which the parity scan stands out, each described in the window that suits it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..parity import LENGTHS_S, Threshold, WindowScan, explain, scan_window
from ..parity.windows import Window, overlaps
from .events import Draft, clusters
from .flight import Flight
from .looks import WITHOUT_LIFT, Scanned
from .naming import contradicted, finding_of_fit
from .relations import StaticWindows, intact_channels
from .result import Look

__all__ = ["drafts_of_parity"]

# A fault that the scan sees near a window's start may have begun before it: the window is moved.
NEAR_START_S = 20.0
# Where in the window that describes an event its onset lies.
ONSET_SHARE = 0.4
MOVES = 3


def drafts_of_parity(
    flight: Flight,
    judgements: Sequence[tuple[Scanned, Threshold, Look]],
    before: Sequence[Draft],
    static: StaticWindows,
) -> list[Draft]:
    """Return one draft for every run of windows that stand out, described in the window that suits it.

    Parameters
    ----------
    before : of the pressure lines; while one is held, whatever is compared with it disagrees.
    """
    held = [(draft.from_s, draft.until_s) for draft in before if draft.finding.stage == "holds"]
    flagged = [
        (one, threshold)
        for one, threshold, _ in judgements
        if one.statistic > threshold.level and not overlaps((one.from_s, one.to_s), held)
    ]
    drafts = []
    for cluster in clusters([(one.from_s, one.to_s) for one, _ in flagged]):
        members = [flagged[k] for k in cluster]
        until_s = max(one.to_s for one, _ in members)
        draft = _described(flight, members, until_s, static)
        if draft is not None:
            drafts.append(draft)
    return drafts


def _described(
    flight: Flight,
    members: Sequence[tuple[Scanned, Threshold]],
    until_s: float,
    static: StaticWindows,
) -> Draft | None:
    """Return what the windows of a run say, in the window in which their fault begins well inside.

    It is the one with the most evidence: a long window may be nearer its threshold and tell more.
    """
    first_s = min(one.from_s for one, _ in members)
    early = [pair for pair in members if pair[0].from_s <= first_s + max(LENGTHS_S)]
    one, threshold = max(early, key=lambda pair: pair[0].statistic)
    window, level, onset_s = (one.from_s, one.to_s), threshold, one.onset_s
    low, high = next((one for one in flight.stretches if one[0] <= onset_s < one[1]), window)
    scan = _scan(flight, window)
    for _ in range(MOVES):
        length_s = window[1] - window[0]
        if onset_s - window[0] >= NEAR_START_S and window[1] - onset_s >= NEAR_START_S:
            break
        start_s = min(max(low, onset_s - ONSET_SHARE * length_s), high - length_s)
        moved = (start_s, start_s + length_s)
        other = _scan(flight, moved)
        if other is None or other.statistic <= level.level or abs(moved[0] - window[0]) < 1.0:
            break
        scan, window = other, moved
        best = max(scan.ratios.values(), key=lambda ratio: float(ratio.ratio.max()))
        onset_s = float(scan.onsets_s[int(np.argmax(best.ratio))])
    if scan is None:
        return None
    record = flight.record.between(*window)
    fits = explain(scan, record, ruled_out=contradicted(intact_channels(static, window)))
    finding = finding_of_fit(fits, record, level, flight.recorded, scan)
    return Draft(finding=finding, window=window, until_s=max(until_s, window[1]), n_windows=len(members))


def _scan(flight: Flight, window: Window) -> WindowScan | None:
    """Return the scan of a window, without the lift where flaps may move."""
    only = WITHOUT_LIFT if overlaps(window, flight.without_lift) else None
    return scan_window(flight.record.between(*window), zero_lift=flight.zero_lift, only=only)
