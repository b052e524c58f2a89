"""Pressure lines that do not move with the flight: a blocked pitot tube, a blocked static port, lines that leak.

A trapped pressure is a line in time but for the noise of its transducer and the steps of the record; the same pressure
in flight is moved by the air and by the aircraft. After a hold the channels that follow from the pressure are missing:
no signature is fitted, and no size is told.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..airdata import DEPENDS_ON, IMPACT_SOURCES, STATIC_SOURCES, G, air_data_of
from ..flightlog import FlightLog
from ..kernels.stillness import noise_of_second_differences, sd_about_lines
from .finding import Finding
from .relaxation import Relaxation, relaxations
from .sampled import Blocks, airborne, quanta_of

__all__ = ["Holds", "LineReport", "Lines", "find_holds", "lines_of"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BLOCK_S = 0.5
# Points of a stretch are means over this long: steps and noise of a trapped line mostly average, motion does not.
POINT_S = 2.5
LENGTH_S = {"p_total": 30.0, "p_static": 40.0}
FAULT = {"p_total": "pitot_blocked", "p_static": "static_blocked"}
FEWEST_POINTS = 5  # of a stretch; with fewer a line passes through anything
# Times the standard deviation that steps and noise make. The step of a slow signal errs by its full standard deviation,
# which hardly varies; white noise of 12 points varies by a fifth, but is the lesser part.
LARGEST = 1.25
# A still stretch strays at most by this share of what the calmest twentieth of the log's moving stretches does. Where
# already the limit is this share of that, steps and noise hide the calm and only a stretch without any motion counts.
STILL, CALMEST, HIDDEN, MOTIONLESS = 1.0 / 3.0, 0.05, 0.5, 0.1
STILL_WORDS = (
    "nothing moves beyond the noise of the record: calm air, an aircraft at rest or a record that stands still"
)
FEWEST_MOVING_S = 60.0  # of them; with fewer the log does not say how still its flight is
# Noise is that of the calmest twentieth of pieces of 5 s.
PIECE_S = 5.0
# Of the pressure; what float32 keeps of an altitude or an airspeed is better.
ROUNDING = 1e-7
# m over the length of a stretch: altitude that is held.
LEVEL_M = 30.0
# m/s. A climb faster than this that ends within a block is no levelling off, which takes a second per m/s^2 of lift.
STOPPED_AT = 4.0
GAS_CONSTANT, TYPICAL_TEMPERATURE = 287.05, 265.0  # for m of altitude of a pressure, to a tenth
# Times the noise of a sample beside the line, within which a line still holds.
BAND = 4.0
# The time that a pressure in flight takes to leave that band is counted up to this, s, in so many times it before.
LONGEST_PASSAGE_S, PASSAGES = 20.0, 16
SMEARED_S = 0.5  # by which a recorder's low-pass moves the edge of a hold
# Of the median impact pressure in flight, from which on the aircraft may fly.
BORNE = 0.3
# A leak with an open drain takes all of the impact pressure: less than this share of that in flight is left.
LEFT = 0.15
# s; how long it stays there at least, and how long the fall to there may take with the level before it.
LONGEST_FALL_S = (5.0, 60.0)
# The fall is fitted down to this share of that, as an exponential with a time constant of at most this, s, from so many
# blocks; its misfit in ln q: a tenth of a speed that changes meanwhile.
LONGEST_LEVEL_S = 15.0  # s before the onset, in which the speed is taken to be constant
FITTED_TO, LONGEST_TIME_CONSTANT_S, FEWEST_OF_FALL, LARGEST_MISFIT = 0.2, 16.0, 12, 0.2
# Of the median impact pressure in flight, above which no landing roll begins: a touch-down has 0.36.
NO_ROLL = 0.5
# s before the onset, whose median is the level. Shares of the loss of airspeed that the ground speed, or the
# accelerometer, shows up to which the aircraft does not brake, and from which it does.
LEVEL_S, SLOWED = 5.0, (0.25, 0.5)
# A static line that leaks to the cabin holds still within so many time constants and s of the onset, up to the longest,
# at the pressure that the leak goes to but for this share of the change, by which a cabin may climb meanwhile.
STILL_AFTER, STILL_AFTER_S, LONGEST_STILL_AFTER_S, SAME_LEVEL = 15.0, 15.0, 465.0, 0.15
# The total pressure stays on its course meanwhile: it changes by at most this share of the static pressure's change
# within so many time constants, where a climb changes both alike.
LARGEST_SHARE_OF_TOTAL, COMPARED = 0.5, 2.0
# s before its onset, from which on what the pitot line shows is the leak's.
BEFORE_LEAK_S = 5.0
# m; an aircraft that has landed does not climb or descend by this in the minute after.
FLYING_M, AFTER_S = 15.0, 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LineReport:
    """How a pressure line was watched in a window.

    Attributes
    ----------
    pressure : "p_total" or "p_static"; made_of : the channels that it was taken from.
    limit_pa : standard deviation about a line, Pa, below which a stretch is still: from the steps of the record and the
        noise of the transducer, the median over the window. NaN where there is no flight in it.
    calm_pa : the same of the calmest twentieth of the log's moving stretches (for the static pressure, in level
        flight); None where the log has too few.
    watched_s : time within stretches that moved.
    untold : (from_s, to_s, why) of stretches that are still, but not told from calm air.
    """

    pressure: str
    made_of: tuple[str, ...]
    limit_pa: float
    calm_pa: float | None
    watched_s: float
    untold: tuple[tuple[float, float, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Holds:
    """What the pressure lines of a window say.

    Attributes
    ----------
    findings : in the order of their onsets. The statistic of a hold is the limit over the standard deviation about its
        line, at most 1000, its threshold 1; of a pitot line that leaks, the share of the impact pressure that was lost,
        its threshold 85 %; of a static line that leaks, the change of its vertical speed at the onset, m/s, its
        threshold 4 m/s. The evidence of a leak holds its time constant, s.
    lines : how each was watched.
    missing : sentences on what was not watched, or is seen less well, and why.
    """

    findings: tuple[Finding, ...]
    lines: tuple[LineReport, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Line:
    """One pressure of a log, once in a block: `step_sd` (n,) of its recorded steps, `noise_sd` of a block, Pa."""

    pressure: str
    made_of: tuple[str, ...]
    values: FloatArray
    step_sd: FloatArray
    noise_sd: float
    point_noise_sd: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lines:
    """The pressure lines of a whole log, for `find_holds` on many of its windows.

    Attributes
    ----------
    time_s : (n,) seconds; flies : (n,) whether the aircraft flies for certain; borne : (n,) whether it may.
    step_s : between blocks, s.
    q_impact : (n,) Pa, None where it is not known.
    """

    time_s: FloatArray
    flies: BoolArray
    borne: BoolArray
    step_s: float
    q_impact: FloatArray | None
    lines: tuple[_Line, ...]
    missing: tuple[str, ...]


def lines_of(log: FlightLog) -> Lines:
    """Return the pressure lines of a log, their steps and their noise."""
    blocks = Blocks.of(log.time_s, BLOCK_S)
    step_s = max(BLOCK_S, float(np.median(np.diff(blocks.time_s))) if len(blocks.time_s) > 1 else BLOCK_S)
    flies = airborne(log, blocks.time_s)
    names = {*STATIC_SOURCES, *IMPACT_SOURCES, "tat", "sat"} & log.channels.keys()
    missing: list[str] = []
    unwatched = Lines(
        time_s=blocks.time_s, flies=flies, borne=flies, step_s=step_s, q_impact=None, lines=(), missing=()
    )
    if not set(STATIC_SOURCES) & names:
        missing.append("the pressure lines are not watched: the log lacks altitude or p_static")
    elif not flies.any():
        missing.append("the pressure lines are not watched: the log shows no flight")
    elif step_s > POINT_S:
        why = f"it has a sample every {step_s:g} s, one every {POINT_S:g} s at least is needed"
        missing.append(f"the pressure lines are not watched: {why}")
    if missing:
        return replace(unwatched, missing=tuple(missing))
    values = {name: blocks.mean(log.channels[name].values) for name in names}
    has_impact = bool(set(IMPACT_SOURCES) & names)
    if not has_impact:
        values["q_impact"] = np.zeros(len(blocks.time_s))
        missing.append("the pitot tube is not watched: the log lacks an airspeed, mach, q_impact or p_total")
    air = air_data_of(values)
    if not np.isfinite(air.p_static + air.q_impact)[flies].any():
        missing.append("the pressure lines are not watched: no sample in flight has both pressures")
        return replace(unwatched, missing=tuple(missing))
    if air.made_of["q_impact"] == ("tas",) and has_impact:
        heat = [name for name in ("tat", "sat") if name in names]
        missing.append(
            "the total pressure is that of tas, altitude and "
            + (f"{heat[0]}, whose steps hide what moves less" if heat else "the temperature of the standard atmosphere")
            + ": a blocked pitot tube is found less often than with cas or mach"
        )
    quanta = quanta_of(log, names)
    lines = []
    for pressure, sources in (("p_static", ()), ("p_total", air.made_of["q_impact"])):
        if pressure == "p_total" and not has_impact:
            continue
        used = dict.fromkeys((*air.made_of["p_static"], *sources))
        if sources == ("tas",):
            used |= dict.fromkeys(
                air.made_of["tat"] if air.made_of["tat"] else [n for n in ("tat", "sat") if n in names]
            )
        own = np.asarray(getattr(air, pressure))
        steps = np.zeros(len(own))
        for name in used.keys() & quanta.keys():
            moved = air_data_of({**values, name: values[name] + quanta[name]})
            steps = steps + (np.asarray(getattr(moved, pressure)) - own) ** 2 / 12.0
        noise = noise_of_second_differences(np.where(flies, own, np.nan), max(2, round(PIECE_S / step_s)), CALMEST)
        # A step that the log does not show may be as slow as a stretch is long: its noise then does not average.
        averaged = max(1, round(POINT_S / step_s)) if used.keys() <= quanta.keys() else 1
        lines.append(
            _Line(
                pressure=pressure,
                made_of=tuple(used),
                values=own,
                step_sd=np.sqrt(steps + (ROUNDING * own) ** 2),
                noise_sd=noise,
                point_noise_sd=noise / np.sqrt(averaged),
            )
        )
    return replace(
        unwatched,
        borne=air.q_impact >= BORNE * np.nanmedian(air.q_impact[flies]) if has_impact else flies,
        q_impact=np.asarray(air.q_impact) if has_impact else None,
        lines=tuple(lines),
        missing=tuple(missing),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stretches:
    """All stretches of a line, by their first block: sd about a line, the limit of it, both Pa, and what is known.

    Attributes
    ----------
    whole : in flight and without gaps; inside : also within the window. n : blocks of a stretch.
    """

    sd: FloatArray
    limit: FloatArray
    rise: FloatArray
    whole: BoolArray
    inside: BoolArray
    n: int

    @property
    def still(self) -> BoolArray:
        return self.whole & (self.sd <= self.limit)


def _stretches(lines: Lines, line: _Line, length_s: float, from_s: float, to_s: float) -> _Stretches:
    stride = max(1, round(POINT_S / lines.step_s))
    n_points = max(FEWEST_POINTS, round(length_s / (stride * lines.step_s)))
    n = n_points * stride
    sd = sd_about_lines(line.values, n_points, stride)
    m = len(sd)
    first, last = np.arange(m), np.arange(m) + n - 1
    limit = LARGEST * np.hypot(line.step_sd[first], line.point_noise_sd) if m else np.zeros(0)
    span = lines.time_s[last] - lines.time_s[first]
    # A trapped line shows no flight after a while: the beginning of a stretch counts.
    borne, early = np.concatenate([[0.0], np.cumsum(lines.borne)]), max(1, n // 4)
    whole = (span <= (n - 1) * lines.step_s + 1.0) & (borne[first + early] - borne[first] >= 0.5 * early)
    whole &= np.isfinite(sd)
    inside = whole & (lines.time_s[first] >= from_s - 1e-6) & (lines.time_s[last] < to_s)
    height = GAS_CONSTANT * TYPICAL_TEMPERATURE / G * np.abs(line.values[last] / line.values[first] - 1.0)
    return _Stretches(sd=sd, limit=limit, rise=height, whole=whole, inside=inside, n=n)


def find_holds(log: FlightLog, from_s: float, to_s: float, *, lines: Lines | None = None) -> Holds:
    """Return the holds and leaks of the pressure lines in a window.

    Parameters
    ----------
    log : the whole log rather than the window, which shows its steps, its noise and how still its flight is.
    lines : of the same log by `lines_of`, where many windows are looked at; None to make them.
    """
    lines = lines_of(log) if lines is None else lines
    by_name = {line.pressure: line for line in lines.lines}
    reports: list[LineReport] = []
    findings: list[Finding] = []
    to_cabin = _static_leaks(log, lines, from_s, to_s)
    leaks, landings = _leaks(log, lines, from_s, to_s)
    for pressure in FAULT:
        if pressure not in by_name:
            continue
        line = by_name[pressure]
        other = by_name["p_static" if pressure == "p_total" else "p_total"] if len(by_name) == 2 else None
        report, held = _holds_of(log, lines, line, other, from_s, to_s)
        if pressure == "p_total":
            # A leaking tube ends at the static pressure, which may rest.
            low_at = [low_s for _, low_s in leaks]
            held = [one for one in held if not any(low_s <= one.onset_s + POINT_S for low_s in low_at)]
            report = replace(report, untold=(*report.untold, *landings))
        reports.append(report)
        findings += held
        # A trapped tube loses its airspeed in a descent, a trapped port in a climb.
        leaks = [(leak, low_s) for leak, low_s in leaks if not any(one.onset_s < low_s for one in held)]
    # While the static line shows the cabin it holds, and no impact pressure tells of the pitot tube.
    others = [one for one in (*findings, *(leak for leak, _ in leaks)) if not any(_within(one, of) for of in to_cabin)]
    findings = sorted([*others, *to_cabin], key=lambda one: one.onset_s)
    return Holds(findings=tuple(findings), lines=tuple(reports), missing=lines.missing)


def _holds_of(
    log: FlightLog, lines: Lines, line: _Line, other: _Line | None, from_s: float, to_s: float
) -> tuple[LineReport, list[Finding]]:
    """Return how a line was watched, and where it held."""
    length_s = LENGTH_S[line.pressure]
    own = _stretches(lines, line, length_s, from_s, to_s)
    beside = None if other is None else _stretches(lines, other, length_s, from_s, to_s)
    calm = _calm(lines, line, own)
    findings, untold = [], []
    for first, last in _joined(_runs(own.still & own.inside), own.n):
        # The stillest stretch of a run tells whether the line holds, and where.
        best = first + int(np.argmin(own.sd[first : last + 1] / own.limit[first : last + 1]))
        sd = float(own.sd[best])
        span = (float(lines.time_s[first]), float(lines.time_s[last + own.n - 1]))
        moves = beside is not None and bool(beside.sd[best] > beside.limit[best])
        # The total pressure moves at least as the static one does, unless speed is traded for it.
        shown = moves and beside is not None and bool(own.limit[best] <= HIDDEN * beside.sd[best])
        onset = _edge(lines, line, first + own.n // 2, -1)
        if line.pressure == "p_static" and _has_landed(log, lines, line, onset, from_s):
            untold.append((*span, "the aircraft has landed"))
        elif beside is not None and not moves:
            untold.append((*span, STILL_WORDS))
        elif calm is not None and sd > calm * (STILL if own.limit[best] <= HIDDEN * calm else MOTIONLESS):
            untold.append((*span, f"the calmest flight of the log moves by {calm:.2g} Pa, too calm to tell"))
        elif calm is None and not (shown if line.pressure == "p_total" else _stopped(lines, line, onset)):
            untold.append((*span, "the log has too little flight that moves to tell it from calm air"))
        else:
            end = _edge(lines, line, last + own.n // 2, 1)
            findings.append(_hold(log, lines, line, other, onset, end, own, best, to_s))
    watched = own.inside & ~own.still
    covered = np.zeros(len(lines.time_s) + 1)
    np.add.at(covered, np.flatnonzero(watched), 1.0)
    np.add.at(covered, np.minimum(np.flatnonzero(watched) + own.n, len(lines.time_s)), -1.0)
    report = LineReport(
        pressure=line.pressure,
        made_of=line.made_of,
        limit_pa=float(np.median(own.limit[own.inside])) if own.inside.any() else np.nan,
        calm_pa=calm,
        watched_s=float(np.count_nonzero(np.cumsum(covered) > 0.5) * lines.step_s),
        untold=tuple(untold),
    )
    return report, findings


def _runs(marked: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last index of every run of true values."""
    edges = np.flatnonzero(np.diff(marked.astype(np.int8), prepend=0, append=0))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def _joined(runs: list[tuple[int, int]], n: int) -> list[tuple[int, int]]:
    """Return runs of stretches of n blocks, those joined whose stretches touch."""
    joined: list[tuple[int, int]] = []
    for first, last in runs:
        if joined and first <= joined[-1][1] + n:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined


def _calm(lines: Lines, line: _Line, own: _Stretches) -> float | None:
    """Return how far the calmest of the moving stretches stray, of level flight for the static pressure."""
    near = np.zeros(len(lines.time_s) + 1)
    np.add.at(near, np.flatnonzero(own.still), 1.0)
    np.add.at(near, np.minimum(np.flatnonzero(own.still) + own.n, len(lines.time_s)), -1.0)
    held = np.concatenate([[0], np.cumsum(np.cumsum(near)[:-1] > 0.5)])
    first = np.arange(len(own.sd))
    moving = own.whole & (held[first + own.n] == held[first])
    if line.pressure == "p_static":
        moving &= own.rise < LEVEL_M
    runs = sum(last - first + own.n for first, last in _runs(moving))
    if runs * lines.step_s < FEWEST_MOVING_S:
        return None
    return float(np.quantile(own.sd[moving], CALMEST))


def _edge(lines: Lines, line: _Line, middle: int, way: int) -> int:
    """Return the last block that is still on the line of a stretch around `middle`, going one way."""
    half = max(2, round(0.4 * LENGTH_S[line.pressure] / lines.step_s / 2.0))
    around = np.arange(max(0, middle - half), min(len(lines.time_s), middle + half + 1))
    at = lines.time_s[around] - lines.time_s[middle]
    design = np.column_stack([np.ones(len(at)), at])
    level = np.linalg.lstsq(design, line.values[around] - line.values[middle], rcond=None)[0]
    at = lines.time_s - lines.time_s[middle]
    off = np.abs(line.values - line.values[middle] - level[0] - level[1] * at)
    # Two blocks in a row: one of noise may stray.
    away = ~(off <= BAND * float(np.hypot(line.step_sd[middle], line.noise_sd)))
    away = away[middle:] if way > 0 else away[middle::-1]
    twice = np.flatnonzero(away[:-1] & away[1:])
    return middle + way * (max(0, int(twice[0]) - 1) if twice.size else len(away) - 1)


def _has_landed(log: FlightLog, lines: Lines, line: _Line, onset: int, from_s: float) -> bool:
    """Say whether the airspeed goes too after a hold of the static pressure, and other sensors show why."""
    q, t = lines.q_impact, lines.time_s
    if q is None:
        return False
    typical = float(np.nanmedian(q[lines.flies]))
    after = (t >= t[onset]) & (t <= t[onset] + AFTER_S) & (q < LEFT * typical)
    if not after.any():
        return False
    return _brakes(log, float(t[onset]), float(t[after][0]), float(q[onset]), float(line.values[onset])) is not False


def _stopped(lines: Lines, line: _Line, onset: int) -> bool:
    """Say whether a climb or descent ends within a block."""
    before = max(0, onset - max(2, round(2.0 / lines.step_s)))
    if before == onset:
        return False
    fall = np.abs(line.values[onset] / line.values[before] - 1.0) / (lines.time_s[onset] - lines.time_s[before])
    return bool(GAS_CONSTANT * TYPICAL_TEMPERATURE / G * fall > STOPPED_AT)


def _passage_s(lines: Lines, line: _Line, onset: int) -> float:
    """Return the longest time that the line took in the flight before to leave its band, s."""
    most = max(1, round(LONGEST_PASSAGE_S / lines.step_s))
    x = line.values[max(0, onset - PASSAGES * most) : onset]
    if len(x) < 2 * most:
        return LONGEST_PASSAGE_S
    band = BAND * float(np.hypot(line.step_sd[onset], line.noise_sd))
    away = np.abs(np.lib.stride_tricks.sliding_window_view(x, most) - x[: len(x) - most + 1, None]) > band
    passage = np.where(away.any(axis=1), np.argmax(away, axis=1), most)
    return float(np.quantile(passage, 0.975)) * lines.step_s


def _hold(
    log: FlightLog,
    lines: Lines,
    line: _Line,
    other: _Line | None,
    onset: int,
    end: int,
    own: _Stretches,
    best: int,
    to_s: float,
) -> Finding:
    """Return the finding of a hold between two blocks.

    Seen backwards in time the pressure leaves the line at the onset, or later where it moves slowly: the onset is at
    most so much after that as this pressure took to leave such a band in the flight before.
    """
    left_s = float(lines.time_s[onset])
    limit, sd = float(own.limit[best]), float(own.sd[best])
    lasts = lines.time_s[end] >= min(to_s, float(lines.time_s[-1])) - 2.0 * lines.step_s
    fault = FAULT[line.pressure]
    evidence = {line.pressure: sd}
    if other is not None:
        evidence[other.pressure] = float(np.std(other.values[best : best + own.n]))
    return Finding(
        fault=fault,
        among=(fault,),
        channels=_channels(log, line.pressure),
        stage="holds",
        shape=fault,
        magnitude=None,
        sd=None,
        unit="",
        onset_s=left_s,
        onset_ci95=(left_s - SMEARED_S - lines.step_s, left_s + _passage_s(lines, line, onset) + lines.step_s),
        offset_s=None if lasts else float(lines.time_s[end]),
        statistic=min(limit / sd, 1000.0) if sd > 0.0 else 1000.0,
        threshold=1.0,
        evidence=evidence,
    )


def _channels(log: FlightLog, pressure: str) -> tuple[str, ...]:
    return tuple(
        name
        for name in log.channels
        if pressure in DEPENDS_ON.get(name, ()) and not (name == "sat" and "tat" not in log.channels)
    )


def _within(finding: Finding, leak: Finding) -> bool:
    """Say whether a finding begins while a static line leaks."""
    end_s = np.inf if leak.offset_s is None else leak.offset_s
    return leak.onset_s - BEFORE_LEAK_S <= finding.onset_s <= end_s


def _static_leaks(log: FlightLog, lines: Lines, from_s: float, to_s: float) -> list[Finding]:
    """Return the static pressures that go from their course to the cabin's at once, and hold it.

    An aircraft that levels off reaches its altitude as an exponential too, but from the rate at which it climbed, with
    its total pressure; and without a leak the pressure it holds is not still.
    """
    by_name = {one.pressure: one for one in lines.lines}
    if by_name.keys() < FAULT.keys():
        return []
    line, total = by_name["p_static"], by_name["p_total"]
    t = lines.time_s
    own = _stretches(lines, line, LENGTH_S["p_static"], float(t[0]), np.inf)
    # With the cabin's pressure there may be no airspeed, and nothing that shows the flight.
    still = np.flatnonzero(own.sd <= own.limit)
    if not still.size:
        return []
    following = still[np.minimum(np.searchsorted(still, np.arange(len(t))), still.size - 1)]
    soon = (following >= np.arange(len(t))) & (t[following] - t <= LONGEST_STILL_AFTER_S)
    least_jump = STOPPED_AT * G / (GAS_CONSTANT * TYPICAL_TEMPERATURE) * line.values
    found: list[Finding] = []
    for one in relaxations(t, line.values, soon & (t >= from_s - 1e-6) & (t < to_s), least_jump):
        first = int(following[one.onset])
        rests = float(np.mean(line.values[first : first + own.n]))
        in_time = t[first] - t[one.onset] <= STILL_AFTER * one.time_constant_s + STILL_AFTER_S
        same = abs(rests - one.level) <= SAME_LEVEL * abs(one.change)
        if in_time and same and _leaves_total(lines, line, total, one):
            # The line that is held goes on to the last of the stretches that touch.
            _, last = next(run for run in _joined(_runs(own.sd <= own.limit), own.n) if run[1] >= first)
            end = _edge(lines, line, last + own.n // 2, 1)
            leak = _static_leak(log, lines, one, float(one.jump / least_jump[one.onset]), end, to_s)
            found += [] if any(_within(leak, earlier) for earlier in found) else [leak]
    return found


def _leaves_total(lines: Lines, line: _Line, total: _Line, one: Relaxation) -> bool:
    """Say whether a relaxation of the static pressure began in flight and did not take the total pressure with it.

    Where the cabin's pressure is above the total pressure there is no airspeed left, and none of the latter to see.
    """
    t, q = lines.time_s, lines.q_impact
    last = int(np.searchsorted(t, t[one.onset] + COMPARED * one.time_constant_s))
    before = (t >= t[one.onset] - LEVEL_S) & (t < t[one.onset])
    if q is None or last >= len(t) or not before.any() or not lines.borne[before].all():
        return False
    if q[last] < LEFT * float(np.median(q[before])):
        return True
    share = (total.values[last] - total.values[one.onset]) / (line.values[last] - line.values[one.onset])
    return bool(abs(share) <= LARGEST_SHARE_OF_TOTAL)


def _static_leak(log: FlightLog, lines: Lines, one: Relaxation, statistic: float, end: int, to_s: float) -> Finding:
    t = lines.time_s
    lasts = t[end] >= min(to_s, float(t[-1])) - 2.0 * lines.step_s
    return Finding(
        fault="static_leak",
        among=("static_leak",),
        channels=_channels(log, "p_static"),
        stage="holds",
        shape="static_leak",
        magnitude=None,
        sd=None,
        unit="",
        onset_s=float(t[one.onset]),
        onset_ci95=(one.from_s - SMEARED_S, one.to_s + SMEARED_S),
        offset_s=None if lasts else float(t[end]),
        statistic=STOPPED_AT * abs(statistic),
        threshold=STOPPED_AT,
        evidence={"time_constant_s": one.time_constant_s},
    )


def _leaks(
    log: FlightLog, lines: Lines, from_s: float, to_s: float
) -> tuple[list[tuple[Finding, float]], list[tuple[float, float, str]]]:
    """Return the exponential losses of nearly all impact pressure, each with its end, and what may be landings."""
    t, q = lines.time_s, lines.q_impact
    if q is None or not lines.flies.any():
        return [], []
    typical = float(np.nanmedian(q[lines.flies]))
    within = (t >= from_s - 1e-6) & (t < to_s)
    found, untold = [], []
    for first, last in _runs((q < LEFT * typical) & within):
        fall = _fall(t, q, first, last, LEFT * typical, within)
        if fall is None:
            continue
        onset_s, onset_ci95, time_constant_s = fall
        level = float(np.nanmedian(q[within & (t >= onset_s - LEVEL_S) & (t <= onset_s)]))
        after = slice(first, min(last + 1, first + round(AFTER_S / lines.step_s)))
        p_static = next(line.values for line in lines.lines if line.pressure == "p_static")[after]
        metres = GAS_CONSTANT * TYPICAL_TEMPERATURE / G * np.ptp(p_static) / np.mean(p_static)
        brakes = _brakes(log, onset_s, float(t[first]), level, float(np.mean(p_static)))
        if brakes or (brakes is None and not (level > NO_ROLL * typical or metres > FLYING_M)):
            why = "the impact pressure is lost as in a landing"
            untold.append((onset_s, float(t[last]), why))
            continue
        lasts = last + 1 >= len(t) or not within[last + 1]
        lost = 1.0 - float(np.nanmin(q[first : last + 1])) / level
        finding = Finding(
            fault="pitot_leak",
            among=("pitot_leak",),
            channels=_channels(log, "p_total"),
            stage="holds",
            shape="pitot_leak",
            magnitude=None,
            sd=None,
            unit="",
            onset_s=onset_s,
            onset_ci95=onset_ci95,
            offset_s=None if lasts else float(t[last]),
            statistic=lost,
            threshold=1.0 - LEFT,
            evidence={"time_constant_s": time_constant_s},
        )
        found.append((finding, float(t[first])))
    return found, untold


def _fall(
    t: FloatArray, q: FloatArray, first: int, last: int, low: float, within: BoolArray
) -> tuple[float, tuple[float, float], float] | None:
    """Return onset, its interval and the time constant of an exponential fall to `low`; None where it is none.

    ln q is a constant, then a line: least squares over every onset.
    """
    if t[last] - t[first] < LONGEST_FALL_S[0]:
        return None
    ending = first
    while ending < last and q[ending + 1] > FITTED_TO * low and q[ending + 1] <= q[ending]:
        ending += 1
    part = np.flatnonzero(within & (t >= t[first] - LONGEST_FALL_S[1]) & (t <= t[ending]) & (q > FITTED_TO * low))
    flown = np.flatnonzero(q[part] < low)
    # What was slow before, as in a take-off, is no level to fall from.
    slow = part[flown[part[flown] < first]]
    part = part[part > slow[-1]] if slow.size else part
    if len(part) < FEWEST_OF_FALL:
        return None
    # The speed before the onset is a constant for a while only, which the second fit takes.
    squares, _ = _kinks(t[part], np.log(q[part]))
    part = part[t[part] >= t[part[int(np.argmin(squares)) + 2]] - LONGEST_LEVEL_S]
    if len(part) < FEWEST_OF_FALL:
        return None
    squares, fits = _kinks(t[part], np.log(q[part]))
    k = int(np.argmin(squares))
    at = t[part]
    rate, misfit = fits[k]
    if not rate > 1.0 / LONGEST_TIME_CONSTANT_S or misfit > LARGEST_MISFIT:
        return None
    # Speed that changes meanwhile is no white noise: a fifth of the blocks count, and a fifth of the time constant.
    near = at[np.flatnonzero(squares <= squares[k] * (1.0 + 5.0 * 3.84 / len(part))) + 2]
    onset_s, time_constant_s = float(at[k + 2]), float(1.0 / rate)
    half_s = max(float(at[1] - at[0]), LARGEST_MISFIT * time_constant_s)
    return onset_s, (min(float(near[0]), onset_s - half_s), max(float(near[-1]), onset_s + half_s)), time_constant_s


def _kinks(at: FloatArray, y: FloatArray) -> tuple[FloatArray, list[tuple[float, float]]]:
    """Return what is left of squares by a constant that becomes a line at each inner point, its slope and misfit."""
    squares, fits = [], []
    for k in range(2, len(at) - 2):
        design = np.column_stack([np.ones(len(at)), -np.maximum(at - at[k], 0.0)])
        fitted = np.linalg.lstsq(design, y, rcond=None)[0]
        rest = y - design @ fitted
        squares.append(float(rest @ rest))
        fits.append((float(fitted[1]), float(np.sqrt(np.mean(rest[k:] ** 2)))))
    return np.array(squares), fits


def _brakes(log: FlightLog, from_s: float, to_s: float, level: float, p_static: float) -> bool | None:
    """Say whether ground speed or acceleration show that the aircraft slows down with its airspeed; None for neither.

    Parameters
    ----------
    level : impact pressure before, Pa; about 0.4 of the speed is left at `to_s`.
    p_static : static pressure, Pa.
    """
    has = log.channels
    if "ground_speed" in has or {"velocity_north", "velocity_east"} <= has.keys():
        if "ground_speed" in has:
            speed = has["ground_speed"].values
        else:
            speed = np.hypot(has["velocity_north"].values, has["velocity_east"].values)
        before, after = np.interp([from_s, to_s], log.time_s, speed)
        share = (before - after) / max((1.0 - np.sqrt(LEFT)) * before, 1e-9)
        return None if SLOWED[0] < share < SLOWED[1] else bool(share >= SLOWED[1])
    if {"longitudinal_acc", "pitch"} <= has.keys():
        meanwhile = (log.time_s >= from_s) & (log.time_s <= to_s)
        ahead = has["longitudinal_acc"].values[meanwhile] - G * np.sin(has["pitch"].values[meanwhile])
        if not ahead.size:
            return None
        lost = (1.0 - np.sqrt(LEFT)) * np.sqrt(2.0 * level * GAS_CONSTANT * TYPICAL_TEMPERATURE / p_static)
        share = -float(np.mean(ahead)) * (to_s - from_s) / lost
        return None if SLOWED[0] < share < SLOWED[1] else bool(share >= SLOWED[1])
    return None
