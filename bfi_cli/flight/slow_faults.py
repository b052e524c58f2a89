"""Slow faults: runs of windows in which the parity scan stands out, each described in the window that suits it.

A fault that has begun may last to the end of the flight, and whatever its channel is compared with then disagrees. So
the strongest run is named first; what it names is a nuisance in all later windows, which are scanned again, and the
strongest of what still stands out is next. Where that is the return of a sensor that failed, the windows after it have
no nuisance. Each that was named before is then described again with the others in the model, and what they explain
goes: before a vane was known to be wrong, the angle of zero lift was wrong in the whole flight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..kernels.progress import Report, silent
from ..notes import Note
from .events import Draft, beyond_its_tolerance, clusters, is_certain, is_return
from .flight import Flight, LastingFault
from .looks import Scanned, rate_of, scale_of, scan_flight, thresholds_of
from .naming import contradicted, finding_of_fit, hypotheses_of, hypothesis_of
from .parity import LENGTHS_S, FaultByOnset, Threshold, WindowScan, explain, scan_window
from .parity.explain import course_for
from .parity.scan import without_lasting
from .parity.windows import Window, overlaps, windows_in
from .relations import StaticWindows, intact_channels

# A fault that the scan sees near a window's start may have begun before it: the window is moved, or begins earlier
# where the one moved would lose too much of the fault.
NEAR_START_S = 20.0
# Where in the window that describes an event its onset lies.
ONSET_SHARE = 0.4
MOVES = 3  # of that window at most; chosen by hand, it mostly rests after one
# Windows in which the return of a sensor is sought; of those that stand out so many are explained, since the first tell
# it where there is one.
RETURN_S, MOST_EXPLAINED = 120.0, 12
# Faults of one flight; with more of them it is the log that is wrong.
MOST = 6
SHOWN = 3  # of what is set aside, in a sentence


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlowFaults:
    """What the parity scan says of a flight.

    Attributes
    ----------
    flight : with the faults that may last.
    scanned : every window.
    scale : by how much the thresholds are raised.
    notes : what was set aside.
    """

    flight: Flight
    drafts: tuple[Draft, ...]
    scanned: tuple[Scanned, ...]
    scale: float
    notes: tuple[Note, ...] = ()


def find_slow_faults(
    flight: Flight, before: Sequence[Draft], static: StaticWindows, *, report: Report = silent
) -> SlowFaults:
    """Return the slow faults of a flight, the strongest found first.

    Parameters
    ----------
    before : what pressure lines and static relations found; while a line is held, whatever is compared with it
        disagrees, and a channel that broke a relation may stay wrong.
    """
    held = [(draft.from_s, draft.until_s) for draft in before if draft.finding.stage == "holds"]
    # What is surely small hides in no residual: nothing is left out for it.
    exact = (draft for draft in before if draft.finding.stage == "static relations" and not draft.finding.doubt)
    known = [draft for draft in exact if beyond_its_tolerance(flight, draft) is not False]
    for draft in known:
        if draft.finding.shape != "bias":  # a constant is a nuisance of every residual anyway
            back = next((other for other in known if is_return(other.finding, draft.finding)), None)
            flight = flight.with_lasting(_lasting(draft, back))
    start, named, undone, stood_out = flight, list[Named](), list[Draft](), list[Draft]()
    answer = _scan_all(flight, report)
    for _ in range(2 * MOST):
        drafts = [fault.as_told for fault in named]
        reported = [*known, *drafts, *(fault.back for fault in named if fault.back is not None)]
        runs = _runs_that_stand_out(answer.scanned, held, reported)
        described = [fault for run in runs if (fault := _described(flight, run, static)) is not None]
        certain = [fault for fault in described if is_certain(fault.draft) and not _is_among(fault.draft, undone)]
        if not certain or len(drafts) == MOST:
            break
        strongest = max(certain, key=lambda fault: fault.strength)
        begun_s = strongest.draft.finding.onset_ci95[1]
        stood_out += [fault.draft for fault in certain if fault.draft.finding.onset_s > begun_s]
        candidates = _with_named(named, strongest, flight, answer)
        named = _name_again(start, candidates, answer, static)
        undone += [fault.draft for fault in candidates if not _is_among(fault.draft, [kept.draft for kept in named])]
        flight = _with_all(start, named)
        answer = _scan_all(flight, silent, before=answer)
    rest = [fault.draft for fault in described]
    return replace(answer, drafts=(*drafts, *rest), notes=_set_aside(stood_out, [*reported, *rest], drafts))


def _runs_that_stand_out(
    scanned: Sequence[Scanned], held: Sequence[Window], reported: Sequence[Draft]
) -> list[list[Scanned]]:
    """Return the runs of windows that stand out, without those that may hold an onset which is told already.

    Parameters
    ----------
    held : stretches in which a pressure line is held.
    """
    onsets = [draft.finding.onset_ci95 for draft in reported]
    flagged = [
        scan
        for scan in scanned
        if scan.statistic > scan.rule.suspected
        and not overlaps(scan.window, held)
        and not any(scan.from_s < last_s and first_s < scan.to_s for first_s, last_s in onsets)
    ]
    return [[flagged[k] for k in run] for run in clusters([scan.window for scan in flagged])]


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """A fault that was named, and the return of its sensor, None where none was found.

    It was held against `threshold`, at an angle of zero lift, rad, None where that was free.
    """

    draft: Draft
    threshold: Threshold
    zero_lift: float | None
    back: Draft | None = None

    @property
    def strength(self) -> float:
        """By how many times it exceeds its threshold."""
        return self.draft.finding.statistic / self.draft.finding.threshold

    @property
    def as_told(self) -> Draft:
        """The fault with its end."""
        if self.back is None:
            return self.draft
        return replace(self.draft, finding=replace(self.draft.finding, offset_s=self.back.finding.onset_s))


def _with_all(start: Flight, named: Sequence[Named]) -> Flight:
    """Return the flight in which all of these faults are known."""
    for fault in named:
        start = start.with_lasting(_lasting(fault.draft, fault.back))
    return start


def _name_again(start: Flight, named: Sequence[Named], answer: SlowFaults, static: StaticWindows) -> list[Named]:
    """Return the faults named so far, each described with the others in the model, without those that these explain.

    The weakest goes first. One that is described in the same model already stays as it is.
    """
    kept = list(named)
    for fault in sorted(named, key=lambda fault: fault.strength):
        everything = _with_all(start, kept)
        flight = _with_all(start, [other for other in kept if other is not fault])
        flight = replace(flight, zero_lift=everything.zero_lift, zero_lift_from=everything.zero_lift_from)
        draft, k = fault.draft, kept.index(fault)
        # Another that begins in its window before it is in the model from there on.
        latest_s = draft.finding.onset_s - NEAR_START_S
        from_s = max([draft.window[0], *(lasting.from_s for lasting in flight.lasting if lasting.from_s <= latest_s)])
        window = (from_s, draft.window[1])
        if (flight.zero_lift, flight.lasting_in(window)) == (fault.zero_lift, draft.lasting):
            continue
        again = _name_fault(flight, window, draft.finding.onset_s, fault.threshold, static, until_s=draft.until_s)
        if again is None or not is_certain(again.draft):
            del kept[k]
        elif hypotheses_of(again.draft.finding) == hypotheses_of(draft.finding):
            kept[k] = replace(again, back=fault.back)
        else:
            kept[k] = replace(again, back=_return_of(flight, again.draft, answer))
    return kept


def _with_named(named: Sequence[Named], strongest: Named, flight: Flight, answer: SlowFaults) -> list[Named]:
    """Return the faults named so far with another, which may be the return of one of them, or one of them its return.

    What was found after an end as if the fault still lasted is left out, since it can be found without that.
    """
    going = [fault for fault in named if fault.back is None]
    ended = next((fault for fault in going if is_return(strongest.draft.finding, fault.draft.finding)), None)
    begun_after = next((fault for fault in going if is_return(fault.draft.finding, strongest.draft.finding)), None)
    if ended is not None:
        others, pair = [fault for fault in named if fault is not ended], replace(ended, back=strongest.draft)
    else:
        others = [fault for fault in named if fault is not begun_after]
        back = _return_of(flight, strongest.draft, answer) if begun_after is None else begun_after.draft
        pair = replace(strongest, back=back)
    if pair.back is None:
        return [*others, pair]
    end_s = pair.back.finding.onset_s
    return [*(fault for fault in others if not (fault.draft.lasting and fault.draft.window[0] >= end_s)), pair]


def _return_of(flight: Flight, draft: Draft, scanned: SlowFaults) -> Draft | None:
    """Return the return of a sensor that failed to where it was before, None where none is found.

    The windows after the onset are scanned with the fault taken out as if it lasted. There a return is a step of the
    same sensor the other way, by what the fault has grown to. A course that grows is known in its own window only, and
    for as long again.

    Parameters
    ----------
    scanned : the windows, before the fault was known.
    """
    finding = draft.finding
    course = course_for(finding.shape, finding.constant_s)
    if finding.magnitude is None or course is None:
        return None
    (fault,) = hypotheses_of(replace(finding, among=(finding.fault,)))
    _, sign = hypothesis_of(finding.fault)
    first_s, (from_s, to_s) = finding.onset_s + NEAR_START_S, draft.window
    last_s = to_s + (to_s - from_s) if finding.shape == "drift" else flight.stretch_of(draft.window)[1]
    explained = 0
    for look in scanned.scanned:
        window, threshold = look.window, look.rule
        if round(window[1] - window[0]) != RETURN_S or window[1] <= first_s or window[0] >= last_s:
            continue
        part = flight.record.between(*window)
        amount = sign * finding.magnitude * course(part.time_s - finding.onset_s)
        # A fault of a size that no subsonic flight leaves cannot have lasted until here: nothing is known then.
        part = without_lasting(part, fault, amount)
        scan = scan_window(part, zero_lift=flight.zero_lift, only=look.residuals)
        if scan is None or scan.statistic < threshold.level or explained == MOST_EXPLAINED:
            continue
        explained += 1
        fits = explain(scan, part)
        back = finding_of_fit(fits, part, threshold, flight.recorded, scan)
        if back.onset_s > finding.onset_ci95[1] and is_return(back, finding):
            return Draft(finding=back, window=window, until_s=window[1])
    return None


def _set_aside(stood_out: Sequence[Draft], reported: Sequence[Draft], lasting: Sequence[Draft]) -> tuple[Note, ...]:
    """Return a sentence on what stood out after a fault until what that may still do was left out."""
    gone = [draft for draft in stood_out if not any(_same_onset(draft, other) for other in reported)]
    strongest: list[Draft] = []
    for draft in sorted(gone, key=lambda draft: -draft.finding.statistic / draft.finding.threshold):
        if not any(_same_onset(draft, other) for other in strongest):
            strongest.append(draft)
    if not strongest:
        return ()
    faults = ", ".join(f"{draft.finding.fault} from {draft.finding.onset_s:.0f} s" for draft in strongest[:SHOWN])
    last = " and ".join(dict.fromkeys(draft.finding.fault for draft in lasting))
    return (Note.limit(f"after {last} fails, {faults} cannot be told from its after-effects and is not reported"),)


def _is_among(draft: Draft, others: Sequence[Draft]) -> bool:
    """Return whether one of the other drafts names the same fault."""
    names = hypotheses_of(draft.finding)
    return any(hypotheses_of(other.finding) == names and _same_onset(other, draft) for other in others)


def _same_onset(draft: Draft, other: Draft) -> bool:
    (first, last), (begun, ended) = draft.finding.onset_ci95, other.finding.onset_ci95
    return first <= ended and begun <= last


def _scan_all(flight: Flight, report: Report, *, before: SlowFaults | None = None) -> SlowFaults:
    """Return every window scanned, with its threshold, without drafts.

    Parameters
    ----------
    before : with other faults known; windows that these do not concern are kept.
    """
    every = [window for length_s in LENGTHS_S for window in flight.windows(length_s)]
    kept = before.scanned if before is not None and before.flight.zero_lift == flight.zero_lift else ()
    scale = scale_of(flight) if before is None else before.scale
    n_windows = {length_s: len(windows_in(flight.counted, length_s)) for length_s in LENGTHS_S}
    rates = {length_s: rate_of(flight.false_alarm, n) for length_s, n in n_windows.items()}
    # What a healthy flight shows once in the mean is suspected.
    suspicions = {length_s: rate_of(1.0, n) for length_s, n in n_windows.items()}
    threshold = thresholds_of(flight.tables, rates, suspicions, scale)
    scanned = scan_flight(flight, every, threshold, kept=kept, report=report)
    return SlowFaults(flight=flight, drafts=(), scanned=tuple(scanned), scale=scale)


def _lasting(draft: Draft, back: Draft | None = None) -> LastingFault:
    """Return what a fault is to later windows; `back` is its return, where one was found."""
    first_s, last_s = draft.finding.onset_ci95
    until_s = np.inf if back is None else back.finding.onset_ci95[1]
    return LastingFault(faults=hypotheses_of(draft.finding), begun_s=first_s, from_s=last_s, until_s=until_s)


def _described(flight: Flight, run: Sequence[Scanned], static: StaticWindows) -> Named | None:
    """Return what the windows of a run say, in the window in which their fault begins well inside.

    Of these it is the one with the most evidence: a long window may be nearer its threshold and tell more. A window
    that begins after the fault shows a ramp from its own start on, and often more of it.
    """
    first_s, until_s = min(scan.from_s for scan in run), max(scan.to_s for scan in run)
    early = [scan for scan in run if scan.from_s <= first_s + max(LENGTHS_S)]
    inside = [scan for scan in early if _well_inside(scan.onset_s, scan.window)]
    clearest = max(inside or early, key=lambda scan: scan.statistic)
    return _name_fault(flight, clearest.window, clearest.onset_s, clearest.rule, static, until_s=until_s)


def _name_fault(
    flight: Flight, window: Window, onset_s: float, threshold: Threshold, static: StaticWindows, *, until_s: float
) -> Named | None:
    """Return the fault that a window shows, told where its onset lies well inside; None without a residual."""
    window, scan = _around(flight, onset_s, window, threshold)
    if scan is None:
        return None
    fits = _explained(flight, window, scan, static)
    # The onset as fitted may lie nearer to the start than the linear look had it.
    other, scan_of_other = _around(flight, fits[0].onset_s, window, threshold)
    if scan_of_other is not None and other != window:
        window, scan = other, scan_of_other
        fits = _explained(flight, window, scan, static)
    finding = finding_of_fit(fits, flight.record.between(*window), threshold, flight.recorded, scan)
    draft = Draft(finding=finding, window=window, until_s=max(until_s, window[1]), lasting=flight.lasting_in(window))
    return Named(draft=draft, threshold=threshold, zero_lift=flight.zero_lift)


def _well_inside(onset_s: float, window: Window) -> bool:
    return onset_s - window[0] >= NEAR_START_S and window[1] - onset_s >= NEAR_START_S


def _explained(flight: Flight, window: Window, scan: WindowScan, static: StaticWindows) -> tuple[FaultByOnset, ...]:
    ruled_out = contradicted(intact_channels(static, window))
    return explain(scan, flight.record.between(*window), ruled_out=ruled_out)


def _around(flight: Flight, onset_s: float, window: Window, threshold: Threshold) -> tuple[Window, WindowScan | None]:
    """Return the window, moved or begun earlier until the onset lies well inside while it stands out, and its scan."""
    low, high = next((stretch for stretch in flight.stretches if stretch[0] <= onset_s < stretch[1]), window)
    # Not back to before a fault that is named already, nor its end: the window would show that.
    known_s = (time_s for fault in flight.lasting for time_s in (fault.from_s, fault.until_s))
    low = max(low, *(time_s for time_s in known_s if time_s <= window[0]), -np.inf)
    scan = flight.scan(window)
    for _ in range(MOVES):
        length_s = window[1] - window[0]
        if _well_inside(onset_s, window):
            break
        start_s = min(max(low, onset_s - ONSET_SHARE * length_s), high - length_s)
        if abs(start_s - window[0]) < 1.0:
            break
        ends = [start_s + length_s, window[1]] if start_s < window[0] else [start_s + length_s]
        for end_s in ends:
            moved = flight.scan((start_s, end_s))
            if moved is not None and moved.statistic > threshold.suspected:
                window, scan, (_, onset_s) = (start_s, end_s), moved, moved.strongest
                break
        else:
            break
    return window, scan
