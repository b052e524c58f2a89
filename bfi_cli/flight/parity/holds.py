"""Pressure lines that do not move with the flight: a blocked pitot tube, a blocked static port, lines that leak.

A trapped pressure is a line in time but for the noise of its transducer and the steps of the record; the same pressure
in flight is moved by the air and by the aircraft. After a hold the channels that follow from the pressure are missing:
no signature is fitted, and no size is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...flightlog import FlightLog
from ...flightlog.phases import Phase
from ...kernels import BoolArray
from ...kernels.runs import runs
from .finding import Finding
from .leaks import LANDING, LEFT, begins_within, brakes, pitot_leaks, static_leaks
from .lines import (
    BAND,
    CALMEST,
    LENGTH_S,
    METRES,
    POINT_S,
    SMEARED_S,
    Lines,
    PressureLine,
    Stretches,
    channels_after,
    edge_of,
    lines_of,
    stretches_of,
    touching_runs,
)

FAULT = {"p_total": "pitot_blocked", "p_static": "static_blocked"}
PRESSURES = {fault: pressure for pressure, fault in FAULT.items()}
Untold = tuple[float, float, str]
# A still stretch strays at most by this share of what the calmest twentieth of the log's moving stretches does. Where
# already the limit is this share of that, steps and noise hide the calm: a total pressure must then be without any
# motion, and a static one must stop at once.
STILL, HIDDEN, MOTIONLESS = 1.0 / 3.0, 0.5, 0.1
# Steps of the static pressure, m of altitude, above which level flight may stay within one: with 0.30 m no stretch of
# three recorded flights (two Citations, a Cessna 172) is still, with 0.5 m one in a hundred, with 6 m every second.
COARSE_M = 0.35
# LONGER [lengths of a stretch]: run of still stretches that is compared as a whole with flight as long.
LONGER = 2.0
# COARSE_PA [Pa]: step of the total pressure (airspeed, temperature) within which calm flight may stay: 1.0
# Pa with the 0.032 m/s of a recorded Citation, of which no stretch is still; from 0.05 m/s on some are.
COARSE_PA = 1.5
LANDED, STEADY = "the aircraft has landed", "a steady climb or descent is a line too"
AT_REST = "nothing moves beyond the noise of the record: calm air, an aircraft at rest or a record that stands still"
TOO_CALM = "the calmest flight of the log moves by {:.2g} Pa, too calm to tell"
STEPS_HIDE = "the steps or the noise of the record hide how calm flight moves"
TOO_LITTLE = "the log has too little flight that moves to tell it from calm air"
FEWEST_MOVING_S = 60.0  # of moving stretches; with fewer the log does not say how still its flight is
# m over the length of a stretch: altitude that is held, and as much as a trapped pressure drifts with the temperature
# of its line, where a degree is 30 m.
LEVEL_M = 30.0
# m/s^2 at which an aircraft levels off at most (a recorded Citation: 2.3), and s before, over which its rate is taken.
LEVELLING, STOPPING_S = 3.0, 2.0
# The time that a pressure in flight takes to leave that band is counted up to this, s, in so many times it before.
LONGEST_PASSAGE_S, PASSAGES = 20.0, 16
# s after the onset of a hold, in which an aircraft that has landed loses its airspeed.
AFTER_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class UnseenLine:
    """A stretch of flight in which a blocked line "could hide", or "was not looked for", and why."""

    fault: str
    what: str
    from_s: float
    to_s: float
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Holds:
    """What the pressure lines of a window say.

    Attributes
    ----------
    findings : in the order of their onsets. The statistic of a hold is the limit over the standard deviation about its
        line, at most 1000, its threshold 1; of a pitot line that leaks, the share of the impact pressure that was lost,
        its threshold 85 %; of a static line that leaks, the change of its vertical speed at the onset, m/s, its
        threshold 4 m/s. The evidence of a leak holds its time constant, s.
    untold : by pressure, (from_s, to_s, why) of stretches that are still, but not told from calm air.
    unseen : stretches of flight in which a blocked line would not have been seen.
    lacking : sentences on what the log lacks for a line.
    """

    findings: tuple[Finding, ...]
    untold: Mapping[str, tuple[Untold, ...]]
    unseen: tuple[UnseenLine, ...]
    lacking: tuple[str, ...]

    def missing(self, from_s: float = -np.inf, to_s: float = np.inf) -> tuple[str, ...]:
        """Return sentences on what was not watched in a part of the window, or is seen less well, and why."""
        sentences = list(self.lacking)
        for fault, what, why in dict.fromkeys((line.fault, line.what, line.why) for line in self.unseen):
            alike = [line for line in self.unseen if (line.fault, line.why) == (fault, why)]
            seconds = sum(max(0.0, min(line.to_s, to_s) - max(line.from_s, from_s)) for line in alike)
            if seconds >= LENGTH_S[PRESSURES[fault]]:
                sentences.append(f"{fault} {what} in {seconds:.0f} s of the flight: {why}")
        return tuple(sentences)


def find_holds(
    log: FlightLog,
    from_s: float,
    to_s: float,
    *,
    lines: Lines | None = None,
    phases: Sequence[Phase] | None = None,
) -> Holds:
    """Return the holds and leaks of the pressure lines in a window.

    Parameters
    ----------
    log : the whole log rather than the window, which shows its steps, its noise and how still its flight is.
    lines : of the same log by `lines_of`, where many windows are looked at; None to make them.
    phases : of the log, None to find them.
    """
    lines = lines_of(log, phases) if lines is None else lines
    untold: dict[str, tuple[Untold, ...]] = {}
    unseen: list[UnseenLine] = []
    findings: list[Finding] = []
    to_cabin = static_leaks(log, lines, from_s, to_s)
    leaks, landings = pitot_leaks(log, lines, from_s, to_s)
    for pressure in FAULT:
        line = lines.of(pressure)
        if line is None:
            continue
        other = lines.of("p_static" if pressure == "p_total" else "p_total")
        held, unwatched, still = _holds_of(log, lines, line, other, from_s, to_s)
        if pressure == "p_total":
            # A leaking tube ends at the static pressure, which may rest.
            low_at = [low_s for _, low_s in leaks]
            held = [finding for finding in held if not any(low_s <= finding.onset_s + POINT_S for low_s in low_at)]
            still += landings
        untold[pressure] = tuple(still)
        unseen += _unseen(lines, line, unwatched, still)
        findings += held
        # A trapped tube loses its airspeed in a descent, a trapped port in a climb.
        leaks = [(leak, low_s) for leak, low_s in leaks if not any(finding.onset_s < low_s for finding in held)]
        if pressure == "p_static":
            leaks = [(_or_blocked_port(log, lines, line, leak, low_s), low_s) for leak, low_s in leaks]
    findings += [leak for leak, _ in leaks]
    # While the static line shows the cabin it holds, and no impact pressure tells of the pitot tube.
    beside = (finding for finding in findings if not any(begins_within(finding, leak) for leak in to_cabin))
    ordered = sorted([*beside, *to_cabin], key=lambda finding: finding.onset_s)
    return Holds(findings=tuple(ordered), untold=untold, unseen=tuple(unseen), lacking=lines.missing)


def _unseen(
    lines: Lines, line: PressureLine, unwatched: Sequence[tuple[float, float]], untold: Sequence[Untold]
) -> Iterator[UnseenLine]:
    """Yield where in flight a blocked line would not have been seen."""
    fault, channels, length_s = FAULT[line.pressure], " and ".join(line.made_of), LENGTH_S[line.pressure]
    gaps = f"gaps and missing samples of {channels} leave less than {length_s:.0f} s at once"
    for first_s, last_s in unwatched:
        yield UnseenLine(fault=fault, what="was not looked for", from_s=first_s, to_s=last_s, why=gaps)
    hides = np.zeros(len(lines.time_s), dtype=bool)
    for start_s, end_s, why in untold:
        if why not in (LANDED, LANDING, STEADY):
            hides |= (lines.time_s >= start_s) & (lines.time_s <= end_s)
    calm = f"{channels} moved no more than in calm air, or than the steps of the record hide"
    for first_s, last_s in _stretches(lines, hides & lines.flies):
        yield UnseenLine(fault=fault, what="could hide", from_s=first_s, to_s=last_s, why=calm)


def _stretches(lines: Lines, marked: BoolArray) -> tuple[tuple[float, float], ...]:
    """Return the times from which to which blocks are marked."""
    return tuple(
        (float(lines.time_s[first]) - 0.5 * lines.step_s, float(lines.time_s[end - 1]) + 0.5 * lines.step_s)
        for first, end in runs(marked)
    )


def _or_blocked_port(log: FlightLog, lines: Lines, line: PressureLine, leak: Finding, low_s: float) -> Finding:
    """Return a leak of the pitot tube, or that or a blocked static port where the static pressure rests meanwhile.

    In a climb a blocked port loses the airspeed too; in coarse steps, or beside gaps, its hold may not be told.
    """
    during = (lines.time_s >= leak.onset_s) & (lines.time_s <= low_s) & np.isfinite(line.values)
    moved = METRES * np.ptp(line.values[during]) / np.median(line.values[during]) if during.any() else 0.0
    at = int(np.searchsorted(lines.time_s, leak.onset_s))
    rests = BAND * METRES * line.sd_at(at) / float(line.values[at])
    if moved > rests:
        return leak
    return replace(leak, among=(leak.fault, "static_blocked"), channels=channels_after(log, "p_static"))


def _holds_of(
    log: FlightLog, lines: Lines, line: PressureLine, other: PressureLine | None, from_s: float, to_s: float
) -> tuple[list[Finding], tuple[tuple[float, float], ...], list[Untold]]:
    """Return where a line held, where gaps leave no stretch in flight, and where it is still but may be in calm air."""
    length_s = LENGTH_S[line.pressure]
    stretches = stretches_of(lines, line, length_s, from_s, to_s)
    other_stretches = None if other is None else stretches_of(lines, other, length_s, from_s, to_s)
    calm = _calm(lines, line, stretches, stretches.still)
    findings: list[Finding] = []
    untold: list[Untold] = []
    for first, last in touching_runs(stretches.still & stretches.inside, stretches.n):
        # The stillest stretch of a run tells whether the line holds, and where: of a tube one in which the aircraft
        # moves, where the hold lasts until it has landed.
        stray = stretches.sd[first : last + 1] / stretches.limit[first : last + 1]
        if line.pressure == "p_total" and other_stretches is not None:
            moves = other_stretches.moves[first : last + 1]
            stray = np.where(moves | ~moves.any(), stray, np.inf)
        best = first + int(np.argmin(stray))
        onset = edge_of(lines, line, first + stretches.n // 2, -1)
        why = doubt_of(log, lines, line, stretches, other_stretches, calm, (first, best, last), onset)
        if why and other is not None and line.pressure == "p_total":
            why = _doubt_of_whole(log, lines, (line, other), (first, last + stretches.n), onset) and why
        if why:
            untold.append((float(lines.time_s[first]), float(lines.time_s[last + stretches.n - 1]), why))
            continue
        last_s = lines.offset_s(edge_of(lines, line, last + stretches.n // 2, 1), to_s)
        end_s = None if last_s is None else last_s + 0.5 * lines.step_s  # over with its last block
        left_s = float(lines.time_s[onset])
        if findings and (findings[-1].offset_s is None or left_s <= findings[-1].offset_s):
            # The line goes on beyond stretches in which noise hid it.
            findings[-1] = replace(findings[-1], offset_s=end_s)
            continue
        evidence = {line.pressure: float(stretches.sd[best])}
        if other is not None:
            evidence[other.pressure] = float(np.std(other.values[best : best + stretches.n]))
        # Seen backwards in time the pressure leaves the line at the onset, or later where it moves slowly: at most so
        # much as it took to leave such a band in the flight before.
        latest_s = left_s + _passage_s(lines, line, onset) + lines.step_s
        fault = FAULT[line.pressure]
        hold = Finding(
            fault=fault,
            among=(fault,),
            channels=channels_after(log, line.pressure),
            stage="holds",
            shape=fault,
            onset_s=left_s,
            onset_ci95=(left_s - SMEARED_S - lines.step_s, latest_s),
            offset_s=end_s,
            statistic=float(stretches.limit[best] / max(stretches.sd[best], 1e-3 * stretches.limit[best])),
            threshold=1.0,
            evidence=evidence,
        )
        findings.append(hold)
    flies = lines.flies & (lines.time_s >= from_s) & (lines.time_s < to_s)
    return findings, _stretches(lines, flies & ~_covered(lines, stretches.inside, stretches.n)), untold


def _doubt_of_whole(
    log: FlightLog, lines: Lines, both: tuple[PressureLine, PressureLine], run: tuple[int, int], onset: int
) -> str:
    """Return what else keeps a run of still stretches still as a whole, "" where nothing does.

    Calm flight stays within the steps of a record for half a minute, and leaves them in several.
    """
    line, _ = both
    length_s = (run[1] - run[0]) * lines.step_s - POINT_S
    if length_s < LONGER * LENGTH_S[line.pressure]:
        return TOO_LITTLE
    stretches, others = (stretches_of(lines, each, length_s, -np.inf, np.inf) for each in both)
    first = run[0]
    # A total pressure that the static one does not stir an autopilot holds as well.
    if not stretches.still[first] or stretches.limit[first] > HIDDEN * others.sd[first]:
        return TOO_LITTLE
    calm = _calm(lines, line, stretches, stretches.still)
    return doubt_of(log, lines, line, stretches, others, calm, (first, first, first), onset)


def doubt_of(
    log: FlightLog,
    lines: Lines,
    line: PressureLine,
    stretches: Stretches,
    other_stretches: Stretches | None,
    calm: float | None,
    run: tuple[int, int, int],
    onset: int,
) -> str:
    """Return what else than a trapped pressure keeps a run of stretches still, "" where nothing else does.

    The rivals of a trapped line are a landing, a record or an aircraft at rest, a steady climb, and flight that is calm
    or that the steps and the noise of the record hide. How still flight is the log tells, or, where it does not, the
    total pressure by the static one, and the static pressure by how fast it stops.

    Parameters
    ----------
    calm : how far the calmest flight strays from a line, Pa, None where the log has too little.
    run : its first stretch, the stillest, and the last.
    """
    first, best, last = run
    sd, limit, static = float(stretches.sd[best]), float(stretches.limit[best]), line.pressure == "p_static"
    coarse = _altitude_step_m(lines, best) > COARSE_M
    coarse_airspeed = not static and _airspeed_step_sd(lines, line, best) > COARSE_PA
    if coarse_airspeed or (static and coarse):
        # The other still stretches are calm flight within a step as well as holds; those between which the line never
        # moves in flight, as before and after a landing, are one hold.
        moves = np.flatnonzero(stretches.inside & ~stretches.still)
        before, after = moves[moves < first].max(initial=-1), moves[moves > last].min(initial=len(stretches.sd))
        every = np.arange(len(stretches.sd))
        calm = _calm(lines, line, stretches, (every > before) & (every < after))
    # The total pressure moves at least as the static one does, unless speed is traded for it.
    stirred = other_stretches is not None and limit <= HIDDEN * float(other_stretches.sd[best])
    is_reliable = _stopped(lines, line, onset) if static else stirred
    moving = 1.0 / HIDDEN if coarse else 1.0  # times its limit, by which the other line strays at least
    hidden = calm is None or limit > HIDDEN * calm
    calmest = np.inf if calm is None else calm
    stillest = MOTIONLESS * calmest if hidden else STILL * calmest
    rivals = (
        (LANDED, static and _has_landed(log, lines, line, onset)),
        (AT_REST, other_stretches is not None and not other_stretches.sd[best] > moving * other_stretches.limit[best]),
        (STEADY, stretches.rise[best] > LEVEL_M),
        (TOO_LITTLE, calm is None and not is_reliable),
        (STEPS_HIDE, static and hidden and not is_reliable),
        (TOO_CALM.format(calmest), sd > stillest and not (static and hidden)),
        (STEPS_HIDE, coarse_airspeed and not (limit <= calmest < np.inf and sd <= MOTIONLESS * calmest)),
    )
    return next((why for why, explains in rivals if explains), "")


def _altitude_step_m(lines: Lines, at: int) -> float:
    """Return the step of the static pressure in a block, m of altitude."""
    static = lines.of("p_static")
    # Rounding errs by the step over the root of 12.
    return 0.0 if static is None else float(METRES * np.sqrt(12.0) * static.step_sd[at] / static.values[at])


def _airspeed_step_sd(lines: Lines, total: PressureLine, at: int) -> float:
    """Return what the steps of airspeed and temperature make of the total pressure in a block, Pa."""
    static = lines.of("p_static")
    assert static is not None
    return float(np.sqrt(max(total.step_sd[at] ** 2 - static.step_sd[at] ** 2, 0.0)))


def _covered(lines: Lines, marked: BoolArray, n: int) -> BoolArray:
    """Return the blocks that lie within marked stretches of n blocks."""
    return np.convolve(marked, np.ones(n)) > 0.5 if marked.size else np.zeros(len(lines.time_s), dtype=bool)


def _calm(lines: Lines, line: PressureLine, stretches: Stretches, still: BoolArray) -> float | None:
    """Return how far the calmest flight strays, Pa: of stretches besides still ones and those that touch them.

    A trapped tube with slow noise is in part beyond its limit. What is nearly still and touches a still stretch is of
    it, and no calm flight, where that strays as much more again. A static pressure is as still where an autopilot holds
    the altitude.
    """
    if line.pressure == "p_static":
        return _calmest(lines, line, stretches, still)
    nearly = stretches.whole & (stretches.sd <= stretches.limit / STILL)
    held = np.zeros(len(still), dtype=bool)
    for first, last in touching_runs(nearly, stretches.n):
        held[first : last + 1] = still[first : last + 1].any()
    calm = _calmest(lines, line, stretches, held)
    if calm is not None and held.any() and stretches.limit[held].max() <= STILL**2 * calm:
        return calm
    return _calmest(lines, line, stretches, still)


def _calmest(lines: Lines, line: PressureLine, stretches: Stretches, still: BoolArray) -> float | None:
    """Return how far the calmest of the stretches besides still ones stray, of level flight for the static pressure."""
    held = np.concatenate([[0], np.cumsum(_covered(lines, still, stretches.n))])
    first = np.arange(len(stretches.sd))
    moving = stretches.whole & (held[first + stretches.n] == held[first])
    if line.pressure == "p_static":
        moving &= stretches.rise < LEVEL_M
    moving_samples = sum(end - 1 - first + stretches.n for first, end in runs(moving))
    if moving_samples * lines.step_s < FEWEST_MOVING_S:
        return None
    return float(np.quantile(stretches.sd[moving], CALMEST))


def _has_landed(log: FlightLog, lines: Lines, line: PressureLine, onset: int) -> bool:
    """Say whether the airspeed goes too after a hold of the static pressure, and other sensors show why."""
    q, t = lines.q_impact, lines.time_s
    if q is None:
        return False
    typical = float(np.nanmedian(q[lines.flies]))
    after = (t >= t[onset]) & (t <= t[onset] + AFTER_S) & (q < LEFT * typical)
    if not after.any():
        return False
    return brakes(log, float(t[onset]), float(t[after][0]), float(q[onset]), float(line.values[onset])) is not False


def _stopped(lines: Lines, line: PressureLine, onset: int) -> bool:
    """Say whether a climb or descent ends faster than an aircraft levels off.

    One that levels off goes the last step h of the record unseen, at LEVELLING m/s^2 in the root of 2 h / LEVELLING s.
    """
    before = max(0, onset - max(2, round(STOPPING_S / lines.step_s)))
    if before == onset:
        return False
    seconds = lines.time_s[onset] - lines.time_s[before]
    moved = METRES * abs(line.values[onset] / line.values[before] - 1.0)
    step = _altitude_step_m(lines, onset)
    return bool((moved - step) / seconds > LEVELLING * (np.sqrt(2.0 * step / LEVELLING) + 0.5 * seconds))


def _passage_s(lines: Lines, line: PressureLine, onset: int) -> float:
    """Return the longest time that the line took in the flight before to leave its band, s."""
    most = max(1, round(LONGEST_PASSAGE_S / lines.step_s))
    x = line.values[max(0, onset - PASSAGES * most) : onset]
    if len(x) < 2 * most:
        return LONGEST_PASSAGE_S
    band = BAND * line.sd_at(onset)
    away = np.abs(np.lib.stride_tricks.sliding_window_view(x, most) - x[: len(x) - most + 1, None]) > band
    passage = np.where(away.any(axis=1), np.argmax(away, axis=1), most)
    return float(np.quantile(passage, 0.975)) * lines.step_s
