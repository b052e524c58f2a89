"""The static and the total pressure of a log in blocks, and how far each strays from straight lines.

A trapped pressure is a line in time but for the noise of its transducer and the steps of the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...airdata import IMPACT_SOURCES, STATIC_SOURCES, G, air_data_of
from ...flightlog import FlightLog
from ...flightlog.derived import pressures_of
from ...flightlog.phases import Phase, airborne
from ...kernels import BoolArray, FloatArray
from ...kernels.quantisation import find_hold
from ...kernels.runs import noise_of_second_differences, runs, sd_about_lines
from .sampled import Blocks, quanta_of

# s of a log of which one mean is taken: five to a point.
BLOCK_S = 0.5
# Points of a stretch are means over this long: steps and noise of a trapped line mostly average, motion does not.
POINT_S = 2.5
# s of a stretch to which a line is fitted; set on the flights of docs/theory.md, 15.6.
LENGTH_S = {"p_total": 30.0, "p_static": 40.0}
FEWEST_POINTS = 5  # of a stretch; with fewer a line passes through anything
# Times the standard deviation that steps and noise make. The step of a slow signal errs by its full standard deviation,
# which hardly varies; white noise of 12 points varies by a fifth, but is the lesser part.
LARGEST = 1.25
# Noise is that of the calmest twentieth of pieces of 5 s.
PIECE_S, CALMEST = 5.0, 0.05
# ROUNDING: share of the pressure; what float32 keeps of an altitude or an airspeed is better.
ROUNDING = 1e-7
# m of altitude for a share of the static pressure, to a tenth: gas constant of air times a typical temperature over g.
METRES = 287.05 * 265.0 / G
# s between new values of a channel at most, beside the log's own rate: what is held longer stands still by itself.
RENEWED_S = 1.25
# Times the noise of a sample beside the line, within which a line still holds.
BAND = 4.0
# BORNE: share of the median impact pressure in flight from which on the aircraft may fly.
BORNE = 0.3
# m/s. A climb faster than this that ends within a block is no levelling off, which takes a second per m/s^2 of lift.
STOPPED_AT = 4.0
# By which a recorder's low-pass moves the edge of a hold.
SMEARED_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressureLine:
    """One pressure of a log, once in a block: `step_sd` (n,) of its recorded steps, `noise_sd` of a block, Pa."""

    pressure: str
    made_of: tuple[str, ...]
    values: FloatArray
    step_sd: FloatArray
    noise_sd: float
    point_noise_sd: float

    def sd_at(self, block: int) -> float:
        """Return what steps and noise make of a block, Pa."""
        return float(np.hypot(self.step_sd[block], self.noise_sd))


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
    lines: tuple[PressureLine, ...]
    missing: tuple[str, ...]

    def of(self, pressure: str) -> PressureLine | None:
        return next((line for line in self.lines if line.pressure == pressure), None)

    def offset_s(self, end: int, to_s: float) -> float | None:
        """Return when what ends in a block is over, None where it lasts to the end of the window or of the log."""
        end_s = float(self.time_s[end])
        return None if end_s >= min(to_s, float(self.time_s[-1])) - 2.0 * self.step_s else end_s


def lines_of(log: FlightLog, phases: Sequence[Phase] | None = None) -> Lines:
    """Return the pressure lines of a log, their steps and their noise; `phases` of the log, None to find them."""
    blocks = Blocks.of(log.time_s, BLOCK_S)
    step_s = max(BLOCK_S, float(np.median(np.diff(blocks.time_s))) if len(blocks.time_s) > 1 else BLOCK_S)
    flies = airborne(log, blocks.time_s, phases)
    names = {*STATIC_SOURCES, *IMPACT_SOURCES, "tat", "sat"} & log.channels.keys()
    t = blocks.time_s
    unwatched = Lines(time_s=t, flies=flies, borne=flies, step_s=step_s, q_impact=None, lines=(), missing=())
    why = ""
    if not set(STATIC_SOURCES) & names:
        why = "the log lacks altitude or p_static"
    elif not flies.any():
        why = "the log shows no flight"
    elif step_s > POINT_S:
        why = f"it has a sample every {step_s:g} s, and needs one every {POINT_S:g} s"
    if why:
        return replace(unwatched, missing=(f"the pressure lines are not watched: {why}",))
    values = {name: blocks.mean(log.channels[name].values) for name in names}
    missing: list[str] = []
    has_impact = bool(set(IMPACT_SOURCES) & names)
    if not has_impact:
        values["q_impact"] = np.zeros(len(blocks.time_s))
        missing.append("the pitot tube is not watched: the log lacks an airspeed, mach, q_impact or p_total")
    air = air_data_of(values)
    if not np.isfinite(air.p_total)[flies].any():
        missing.append("the pressure lines are not watched: no sample in flight has both pressures")
        return replace(unwatched, missing=tuple(missing))
    heats = tuple(name for name in ("tat", "sat") if name in names)
    impact = air.made_of["q_impact"]
    if has_impact and impact == ("tas",):
        impact = ("tas", *(air.made_of["tat"] or heats))
        warmth = (
            f"{heats[0]}, whose steps hide what moves less" if heats else "the temperature of the standard atmosphere"
        )
        missing.append(
            f"the total pressure is computed from tas, altitude and {warmth}: a blocked pitot tube is harder to see "
            "than with cas or mach"
        )
    made_of = {"p_static": air.made_of["p_static"]}
    if has_impact:
        made_of["p_total"] = (*air.made_of["p_static"], *impact)
    quanta, lines = quanta_of(log, names), []
    for pressure, used in made_of.items():
        renewed = {name: renewed_every_s(log, name) for name in used}
        slowest = max(used, key=renewed.__getitem__)
        if renewed[slowest] <= max(RENEWED_S, 1.5 / log.rate_hz):
            lines.append(_line(pressure, used, values, quanta, unwatched))
            continue
        watched = "static port" if pressure == "p_static" else "pitot tube"
        missing.append(f"the {watched} is not watched: '{slowest}' is renewed every {renewed[slowest]:.3g} s only")
    return replace(
        unwatched,
        borne=air.q_impact >= BORNE * np.nanmedian(air.q_impact[flies]) if has_impact else flies,
        q_impact=np.asarray(air.q_impact) if has_impact else None,
        lines=tuple(lines),
        missing=tuple(missing),
    )


def _line(
    pressure: str, used: tuple[str, ...], values: Mapping[str, FloatArray], quanta: Mapping[str, float], blocks: Lines
) -> PressureLine:
    """Return a pressure with its steps and its noise.

    Parameters
    ----------
    used : channels that it is made of; values : (n,) by channel, in blocks; quanta : their steps, where they are known.
    blocks : their times, and in which of them the aircraft flies.
    """
    pressures = np.asarray(getattr(air_data_of(values), pressure))
    steps = np.zeros(len(pressures))
    for name in {*used} & quanta.keys():
        moved = air_data_of({**values, name: values[name] + quanta[name]})
        steps = steps + (np.asarray(getattr(moved, pressure)) - pressures) ** 2 / 12.0
    piece = max(2, round(PIECE_S / blocks.step_s))
    flown = np.where(blocks.flies, pressures, np.nan)
    rounded = ROUNDING * float(np.nanmedian(flown)) if np.isfinite(flown).any() else 0.0
    noise = noise_of_second_differences(flown, piece, CALMEST, rests=rounded)
    # A step that the log does not show may be as slow as a stretch is long: its noise then does not average.
    averaged = max(1, round(POINT_S / blocks.step_s)) if {*used} <= quanta.keys() else 1
    return PressureLine(
        pressure=pressure,
        made_of=used,
        values=pressures,
        step_sd=np.sqrt(steps + (ROUNDING * pressures) ** 2),
        noise_sd=noise,
        point_noise_sd=noise / np.sqrt(averaged),
    )


def renewed_every_s(log: FlightLog, name: str) -> float:
    """Return the period of a channel that is held between its sensor's samples, 0 where it is not."""
    values = log.channels[name].values
    finite = np.isfinite(values)
    hold = find_hold(values[finite], (log.time_s[finite] - log.time_s[0]) * log.rate_hz)
    return 0.0 if hold is None else hold.period / log.rate_hz


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretches:
    """All stretches of a line, by their first block: sd about a line, the limit of it, both Pa, and what is known.

    Attributes
    ----------
    rise : m, between its ends.
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

    @property
    def moves(self) -> BoolArray:
        return self.sd > self.limit


def stretches_of(lines: Lines, line: PressureLine, length_s: float, from_s: float, to_s: float) -> Stretches:
    """Return all stretches of a length, s, and which of them lie within a window."""
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
    rise = METRES * np.abs(line.values[last] / line.values[first] - 1.0)
    return Stretches(sd=sd, limit=limit, rise=rise, whole=whole, inside=inside, n=n)


def touching_runs(marked: BoolArray, n: int) -> list[tuple[int, int]]:
    """Return the first and last of every run of marked stretches of n blocks, those joined whose stretches touch."""
    touching: list[tuple[int, int]] = []
    for first, end in runs(marked):
        before = touching.pop()[0] if touching and first <= touching[-1][1] + n else first
        touching.append((before, end - 1))
    return touching


def edge_of(lines: Lines, line: PressureLine, middle: int, way: int) -> int:
    """Return the last block that is still on the line of a stretch around `middle`, going one way.

    The line of a short stretch is known badly far from it: what it reaches is fitted again, while it reaches further.
    How far a block may be off the stretch itself tells: with what is reached the band would widen for ever.
    """
    t, n = lines.time_s, len(lines.time_s)
    half = max(2, round(0.4 * LENGTH_S[line.pressure] / lines.step_s / 2.0))
    first, last = max(0, middle - half), min(n - 1, middle + half)
    band = 0.0
    while True:
        held, at = slice(first, last + 1), t - t[middle]
        known = np.isfinite(line.values[held])
        design = np.column_stack([np.ones(last + 1 - first), at[held]])[known]
        rises = line.values - line.values[middle]
        level = np.linalg.lstsq(design, rises[held][known], rcond=None)[0]
        off = np.abs(rises - level[0] - level[1] * at)
        rms = float(np.sqrt(np.nanmean(off[held] ** 2)))
        band = band or BAND * max(line.sd_at(middle), rms)
        # Two blocks in a row: one of noise may stray.
        away = ~(off <= band)
        away = away[middle:] if way > 0 else away[middle::-1]
        twice = np.flatnonzero(away[:-1] & away[1:])
        edge = middle + way * (max(0, int(twice[0]) - 1) if twice.size else len(away) - 1)
        if first <= edge <= last:
            return edge
        first, last = min(first, edge), max(last, edge)


def channels_after(log: FlightLog, pressure: str) -> tuple[str, ...]:
    """Return the channels of a log that follow from a pressure."""
    return tuple(name for name in log.channels if pressure in pressures_of(log, name))
