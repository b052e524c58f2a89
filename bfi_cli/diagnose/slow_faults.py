"""Slow faults: runs of windows in which the parity scan stands out, each described in the window that suits it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..parity import LENGTHS_S, Fit, Threshold, WindowScan, explain, scan_window
from ..parity.windows import Window, overlaps
from .events import Draft, clusters
from .flight import Flight
from .looks import WITHOUT_LIFT, Scanned
from .naming import contradicted, finding_of_fit
from .relations import StaticWindows, intact_channels
from .result import Look

__all__ = ["drafts_of_parity"]

# A fault that the scan sees near a window's start may have begun before it: the window is moved, or begins earlier
# where the one moved would lose too much of the fault.
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

    Of these it is the one with the most evidence: a long window may be nearer its threshold and tell more. A window
    that begins after the fault shows a ramp from its own start on, and often more of it.
    """
    first_s = min(one.from_s for one, _ in members)
    early = [pair for pair in members if pair[0].from_s <= first_s + max(LENGTHS_S)]
    inside = [pair for pair in early if _well_inside(pair[0].onset_s, (pair[0].from_s, pair[0].to_s))]
    one, threshold = max(inside or early, key=lambda pair: pair[0].statistic)
    window, scan = _around(flight, one.onset_s, (one.from_s, one.to_s), threshold)
    if scan is None:
        return None
    fits = _explained(flight, window, scan, static)
    # The onset as fitted may lie nearer to the start than the linear look had it.
    other, scan_of_other = _around(flight, fits[0].onset_s, window, threshold)
    if scan_of_other is not None and other != window:
        window, scan = other, scan_of_other
        fits = _explained(flight, window, scan, static)
    record = flight.record.between(*window)
    finding = finding_of_fit(fits, record, threshold, flight.recorded, scan)
    return Draft(finding=finding, window=window, until_s=max(until_s, window[1]), n_windows=len(members))


def _well_inside(onset_s: float, window: Window) -> bool:
    return onset_s - window[0] >= NEAR_START_S and window[1] - onset_s >= NEAR_START_S


def _explained(flight: Flight, window: Window, scan: WindowScan, static: StaticWindows) -> tuple[Fit, ...]:
    ruled_out = contradicted(intact_channels(static, window))
    return explain(scan, flight.record.between(*window), ruled_out=ruled_out)


def _around(flight: Flight, onset_s: float, window: Window, threshold: Threshold) -> tuple[Window, WindowScan | None]:
    """Return the window, moved or begun earlier until the onset lies well inside while it stands out, and its scan."""
    low, high = next((one for one in flight.stretches if one[0] <= onset_s < one[1]), window)
    scan = _scan(flight, window)
    for _ in range(MOVES):
        length_s = window[1] - window[0]
        if _well_inside(onset_s, window):
            break
        start_s = min(max(low, onset_s - ONSET_SHARE * length_s), high - length_s)
        if abs(start_s - window[0]) < 1.0:
            break
        ends = [start_s + length_s, window[1]] if start_s < window[0] else [start_s + length_s]
        others = (((start_s, end_s), _scan(flight, (start_s, end_s))) for end_s in ends)
        better = next(((moved, one) for moved, one in others if one and one.statistic > threshold.level), None)
        if better is None:
            break
        window, scan = better
        assert scan is not None
        best = max(scan.ratios.values(), key=lambda ratio: float(ratio.ratio.max()))
        onset_s = float(scan.onsets_s[int(np.argmax(best.ratio))])
    return window, scan


def _scan(flight: Flight, window: Window) -> WindowScan | None:
    """Return the scan of a window, without the lift where flaps may move."""
    only = WITHOUT_LIFT if overlaps(window, flight.without_lift) else None
    return scan_window(flight.record.between(*window), zero_lift=flight.zero_lift, only=only)
