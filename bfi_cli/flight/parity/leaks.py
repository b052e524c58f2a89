"""Pressure lines that leak: a pitot tube with an open drain, a static line that is open to the cabin."""

from __future__ import annotations

import numpy as np

from ...airdata import G, ground_speed_of
from ...flightlog import FlightLog
from ...kernels import BoolArray, FloatArray
from ...kernels.runs import runs
from .finding import AS_GOOD, Finding, as_good, squares_by_onset
from .lines import (
    LENGTH_S,
    METRES,
    SMEARED_S,
    STOPPED_AT,
    Lines,
    PressureLine,
    channels_after,
    edge_of,
    stretches_of,
    touching_runs,
)
from .relaxation import ALIKE, Relaxation, relaxations

# Less than this share of the impact pressure in flight is left on the ground, and in a tube with an open drain.
LEFT = 0.15
# Shares of the loss of airspeed that the ground speed, or the accelerometer, shows up to which the aircraft does not
# brake, and from which it does.
NO_BRAKING, BRAKING = 0.25, 0.5
# What names no other source was set with 137 windows of two Citation flights, their landings and those of a Cessna 172
# and a drone in view (docs/theory.md, 15.6): what is counted there is in-sample.
FREED = "the static pressure rests before it too: it may be a blocked port that opens"
LANDING = "the impact pressure is lost as in a landing"
# These constants were set on both recorded Citations with leaks of 2 to 60 s (docs/theory.md, 15.6), except where a
# reason is given.
# A leak with an open drain takes all of the impact pressure: how long, s, nearly none is left at least.
LEAST_LOW_S = 5.0
# Time constants, s, that are tried, the shortest first: the flight before a fast fall may be slower by itself. An
# aircraft at idle loses speed as slowly as a leak of a time constant longer than the last.
TIME_CONSTANTS_S = (16.0, 32.0, 64.0, 120.0)
# Time constants of the fall to where nearly none is left, and of the level before it, in which the speed is taken to be
# constant, s at least.
FALL, LEVEL, LEAST_LEVEL_S = -float(np.log(LEFT)), 0.5, 15.0
# The fall is fitted down to this share of that, as an exponential, from so many blocks; its misfit in ln q: a tenth of
# a speed that changes meanwhile.
FITTED_TO, FEWEST_OF_FALL, MISFIT_OF_LOG = 0.2, 12, 0.2
# NO_ROLL: share of the median impact pressure in flight above which no landing roll begins: a touch-down has 0.36.
NO_ROLL = 0.5
# s before the onset, whose median is the level.
LEVEL_S = 5.0
# A static line that leaks to the cabin holds still within so many time constants and s of the onset, up to the longest,
# at the pressure that the leak goes to but for this share of the change, by which a cabin may climb meanwhile.
STILL_AFTER, STILL_AFTER_S, LONGEST_STILL_AFTER_S, SAME_LEVEL = 15.0, 15.0, 465.0, 0.15
# The total pressure stays on its course meanwhile: it changes by at most this share of the static pressure's change
# within so many time constants, where a climb changes both alike.
LARGEST_SHARE_OF_TOTAL, COMPARED = 0.5, 2.0
# s before its onset, from which on what the pitot line shows is the leak's.
BEFORE_LEAK_S = 5.0
# FASTEST_ICE_S [s]: in which no ice takes all of the impact pressure.
FASTEST_ICE_S = 30.0
# m; an aircraft that has landed does not climb or descend by this in the minute after, and came down by more within the
# last minute: 15 m are 5 s of a glide of 3 degrees at 60 m/s.
FLYING_M, AFTER_S, DESCENT_S = 15.0, 60.0, 60.0


def begins_within(finding: Finding, leak: Finding) -> bool:
    """Say whether a finding begins while a static line leaks."""
    return leak.onset_s - BEFORE_LEAK_S <= finding.onset_s <= leak.until_s


def brakes(log: FlightLog, from_s: float, to_s: float, level: float, p_static: float) -> bool | None:
    """Say whether ground speed or acceleration show that the aircraft slows down with its airspeed; None for neither.

    Parameters
    ----------
    level : impact pressure before, Pa; about 0.4 of the speed is left at `to_s`.
    p_static : static pressure, Pa.
    """
    has = {name: channel.values for name, channel in log.channels.items()}
    speed = ground_speed_of(has)
    if speed is not None:
        before, after = np.interp([from_s, to_s], log.time_s, speed)
        share = (before - after) / max((1.0 - np.sqrt(LEFT)) * before, 1e-9)
    elif {"longitudinal_acc", "pitch"} <= has.keys():
        meanwhile = (log.time_s >= from_s) & (log.time_s <= to_s)
        if not meanwhile.any() or not level > 0.0:
            return None
        ahead = float(np.mean(has["longitudinal_acc"][meanwhile] - G * np.sin(has["pitch"][meanwhile])))
        share = -ahead * (to_s - from_s) / ((1.0 - np.sqrt(LEFT)) * np.sqrt(2.0 * level * G * METRES / p_static))
    else:
        return None
    return None if NO_BRAKING < share < BRAKING else bool(share >= BRAKING)


def static_leaks(log: FlightLog, lines: Lines, from_s: float, to_s: float) -> list[Finding]:
    """Return the static pressures that go from their course to the cabin's at once, and hold it.

    An aircraft that levels off reaches its altitude as an exponential too, but from the rate at which it climbed, with
    its total pressure; and without a leak the pressure it holds is not still.
    """
    line, total = lines.of("p_static"), lines.of("p_total")
    if line is None or total is None:
        return []
    t = lines.time_s
    stretches = stretches_of(lines, line, LENGTH_S["p_static"], float(t[0]), np.inf)
    # With the cabin's pressure there may be no airspeed, and nothing that shows the flight.
    is_still = stretches.sd <= stretches.limit
    still = np.flatnonzero(is_still)
    if not still.size:
        return []
    following = still[np.minimum(np.searchsorted(still, np.arange(len(t))), still.size - 1)]
    soon = (following >= np.arange(len(t))) & (t[following] - t <= LONGEST_STILL_AFTER_S)
    held = touching_runs(is_still, stretches.n)
    least_jump = STOPPED_AT / METRES * line.values
    leaks: list[Finding] = []
    for relaxation in relaxations(t, line.values, soon & (t >= from_s - 1e-6) & (t < to_s), least_jump):
        first = int(following[relaxation.onset])
        rests = float(np.mean(line.values[first : first + stretches.n]))
        in_time = t[first] - t[relaxation.onset] <= STILL_AFTER * relaxation.time_constant_s + STILL_AFTER_S
        same = abs(rests - relaxation.level) <= SAME_LEVEL * abs(relaxation.change)
        if not (in_time and same and _leaves_total(lines, line, total, relaxation)):
            continue
        # The line that is held goes on to the last of the stretches that touch.
        last = next(last for _, last in held if last >= first)
        leak = Finding(
            fault="static_leak",
            among=("static_leak",),
            channels=channels_after(log, "p_static"),
            stage="holds",
            shape="static_leak",
            onset_s=float(t[relaxation.onset]),
            onset_ci95=(relaxation.from_s - SMEARED_S, relaxation.to_s + SMEARED_S),
            offset_s=lines.offset_s(edge_of(lines, line, last + stretches.n // 2, 1), to_s),
            statistic=METRES * abs(relaxation.jump) / float(line.values[relaxation.onset]),
            threshold=STOPPED_AT,
            evidence={"time_constant_s": relaxation.time_constant_s},
            doubt=FREED if any(first <= relaxation.onset <= last + stretches.n for first, last in held) else "",
        )
        if not any(begins_within(leak, earlier) for earlier in leaks):
            leaks.append(leak)
    return leaks


def _leaves_total(lines: Lines, line: PressureLine, total: PressureLine, relaxation: Relaxation) -> bool:
    """Say whether a relaxation of the static pressure began in flight and did not take the total pressure with it.

    Where the cabin's pressure is above the total pressure there is no airspeed left, and none of the latter to see.
    """
    t, q = lines.time_s, lines.q_impact
    last = int(np.searchsorted(t, t[relaxation.onset] + COMPARED * relaxation.time_constant_s))
    before = (t >= t[relaxation.onset] - LEVEL_S) & (t < t[relaxation.onset])
    if q is None or last >= len(t) or not before.any():
        return False
    level = float(np.median(q[before]))
    if not level > LEFT * float(np.nanmedian(q[lines.flies])):
        return False
    if q[last] < LEFT * level:
        return True
    share = (total.values[last] - total.values[relaxation.onset]) / (line.values[last] - line.values[relaxation.onset])
    return bool(abs(share) <= LARGEST_SHARE_OF_TOTAL)


def pitot_leaks(
    log: FlightLog, lines: Lines, from_s: float, to_s: float
) -> tuple[list[tuple[Finding, float]], list[tuple[float, float, str]]]:
    """Return the exponential losses of impact pressure, each with when it is low, and what may be landings."""
    t, q = lines.time_s, lines.q_impact
    static = lines.of("p_static")
    if q is None or static is None or not lines.flies.any():
        return [], []
    typical = float(np.nanmedian(q[lines.flies]))
    within = (t >= from_s - 1e-6) & (t < to_s)
    leaks, landings = [], []
    for first, end in runs((q < LEFT * typical) & within):
        last = end - 1
        fall = _fall(t, q, first, last, LEFT * typical, within)
        if fall is None:
            continue
        onset_s, onset_ci95, time_constant_s = fall
        level = float(np.nanmedian(q[within & (t >= onset_s - LEVEL_S) & (t <= onset_s)]))
        after = slice(first, min(last + 1, first + round(AFTER_S / lines.step_s)))
        p_static = static.values[after]
        metres = METRES * np.ptp(p_static) / np.mean(p_static)
        slows = brakes(log, onset_s, float(t[first]), level, float(np.mean(p_static)))
        rolls = level <= NO_ROLL * typical or _came_down_for_good(t, static.values, onset_s, first, last)
        if slows or (slows is None and rolls and metres <= FLYING_M):
            landings.append((onset_s, float(t[last]), LANDING))
            continue
        if _grows_evenly(t, q, onset_s, first):
            continue
        lost = 1.0 - float(np.nanmin(q[first : last + 1])) / level
        # A tube that leaks loses its total pressure; a static line takes the impact pressure away by what it gains.
        is_static = _share_gained(t, q, static.values, onset_s, first) > LARGEST_SHARE_OF_TOTAL
        line, fault = ("p_static", "static_leak") if is_static else ("p_total", "pitot_leak")
        finding = Finding(
            fault=fault,
            among=(fault,),
            channels=channels_after(log, line),
            stage="holds",
            shape=fault,
            onset_s=onset_s,
            onset_ci95=onset_ci95,
            offset_s=lines.offset_s(last, to_s),
            statistic=lost,
            threshold=1.0 - LEFT,
            evidence={"time_constant_s": time_constant_s} if fault == "pitot_leak" else {},
        )
        leaks.append((finding, float(t[first])))
    return leaks, landings


def _came_down_for_good(t: FloatArray, p_static: FloatArray, onset_s: float, first: int, last: int) -> bool:
    """Say whether an aircraft descended to where it loses its airspeed, and stays there until that returns.

    It may have landed: one that flies on without an airspeed descends before the log ends.

    Parameters
    ----------
    first, last : blocks between which nearly none is left.
    """
    above = METRES * (1.0 - p_static / float(p_static[first]))
    before = above[(t >= onset_s - DESCENT_S) & (t <= onset_s)]
    return bool(np.nanmax(before, initial=0.0) > FLYING_M and np.nanmax(np.abs(above[first : last + 1])) <= FLYING_M)


def _share_gained(t: FloatArray, q: FloatArray, p_static: FloatArray, onset_s: float, first: int) -> float:
    """Return the share of a loss of impact pressure that the static pressure gains beside its steady climb or descent.

    Parameters
    ----------
    first : block in which nearly none is left.
    """
    from_s = onset_s - max(LEAST_LEVEL_S, LEVEL * (float(t[first]) - onset_s))
    part = np.flatnonzero((t >= from_s) & (np.arange(len(t)) <= first) & np.isfinite(q) & np.isfinite(p_static))
    at, falls = t[part] - onset_s, t[part] >= onset_s
    level = float(np.median(q[part][~falls])) if not falls.all() else float(q[part][0])
    design = np.column_stack([np.ones(len(at)), at, np.where(falls, level - q[part], 0.0)])
    return float(np.linalg.lstsq(design, p_static[part], rcond=None)[0][2])


def _fall(
    t: FloatArray, q: FloatArray, first: int, last: int, low: float, within: BoolArray
) -> tuple[float, tuple[float, float], float] | None:
    """Return onset, its interval and the time constant of an exponential fall to `low`; None where it is none.

    ln q is a constant, then a line: least squares over every onset.
    """
    if t[last] - t[first] < LEAST_LOW_S:
        return None
    ending = first
    while ending < last and q[ending + 1] > FITTED_TO * low and q[ending + 1] <= q[ending]:
        ending += 1
    kinks = (_kink(t, q, first, ending, low, within, longest_s) for longest_s in TIME_CONSTANTS_S)
    fit = next((kink for kink in kinks if kink is not None), None)
    if fit is None:
        return None
    at, squares, time_constant_s = fit
    onset_s = float(at[int(np.argmin(squares)) + 2])
    # Speed that changes meanwhile is no white noise: a fifth of the blocks count, and a fifth of the time constant.
    near_s = at[as_good(squares, len(at), ALIKE) + 2]
    half_s = max(float(at[1] - at[0]), MISFIT_OF_LOG * time_constant_s)
    return onset_s, (min(float(near_s[0]), onset_s - half_s), max(float(near_s[-1]), onset_s + half_s)), time_constant_s


def _kink(
    t: FloatArray, q: FloatArray, first: int, ending: int, low: float, within: BoolArray, longest_s: float
) -> tuple[FloatArray, FloatArray, float] | None:
    """Return the times of a fall, the squares left by every onset, and the time constant of the best of these, s.

    None where the best is no fall, or one of a longer time constant.

    Parameters
    ----------
    first, ending : block in which `low` is reached, and to which it is fitted.
    longest_s : time constant, by which the stretch before goes that is looked at.
    """
    before_s = max((FALL + LEVEL) * longest_s, FALL * longest_s + LEAST_LEVEL_S)
    part = np.flatnonzero(within & (t >= t[first] - before_s) & (t <= t[ending]) & (q > FITTED_TO * low))
    # What was slow before, as in a take-off, is no level to fall from.
    slow = part[(q[part] < low) & (part < first)]
    part = part[part > slow[-1]] if slow.size else part
    if len(part) < FEWEST_OF_FALL:
        return None
    # The speed before the onset is a constant for a while only, which the second fit takes.
    onset_s = t[part[int(np.argmin(_kinks(t[part], np.log(q[part]))[0])) + 2]]
    part = part[t[part] >= onset_s - max(LEAST_LEVEL_S, LEVEL * longest_s)]
    if len(part) < FEWEST_OF_FALL:
        return None
    at, y = t[part], np.log(q[part])
    squares, rates = _kinks(at, y)
    k = int(np.argmin(squares))
    falls = rates[k] * np.maximum(at - at[k + 2], 0.0)
    rest = y + falls - (y + falls).mean()
    # What begins where nearly none is left is no fall to that: it was lost before, as in a descent with a blocked tube.
    if at[k + 2] >= t[first] or not rates[k] > 0.0 or np.sqrt(np.mean(rest[k + 2 :] ** 2)) > MISFIT_OF_LOG:
        return None
    time_constant_s = float(1.0 / rates[k])
    return (at, squares, time_constant_s) if time_constant_s <= longest_s else None


def _grows_evenly(t: FloatArray, q: FloatArray, onset_s: float, first: int) -> bool:
    """Say whether a loss in proportion to the time since some onset, as that of ice, explains q better than a leak."""
    seconds = float(t[first]) - onset_s
    from_s = onset_s - max(LEAST_LEVEL_S, LEVEL * seconds)
    part = np.flatnonzero((t >= from_s) & (np.arange(len(t)) <= first) & (q > 0.0))
    if len(part) < FEWEST_OF_FALL or seconds < FASTEST_ICE_S:
        return False
    at, y = t[part], q[part]
    design = np.column_stack([np.ones(len(at)), -np.maximum(at - onset_s, 0.0)])
    leak = np.exp(design @ np.linalg.lstsq(design, np.log(y), rcond=None)[0])
    return len(part) / ALIKE * float(np.log(np.sum((y - leak) ** 2) / _kinks(at, y)[0].min())) > AS_GOOD


def _kinks(at: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what is left of squares by a constant that falls along a line from each inner point on, and how fast."""
    return squares_by_onset(y, -np.maximum(at[:, None] - at[2:-2], 0.0))
