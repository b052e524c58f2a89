"""Sensors that fail by themselves: a vane that rests, a temperature probe and a normal accelerometer that step.

What is computed from a temperature follows a probe that is wrong, so that no relation between these channels breaks;
but no air changes by some kelvin within seconds at one altitude. The mean of a normal acceleration over two minutes is
that of gravity, bank and little else, since the climb is no other afterwards than before by more than its own change.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..airdata import climb_angle, static_temperature
from ..flightlog import FlightLog
from ..flightlog.holds import find_quantum
from ..flightlog.phases import Phase
from ..kernels.normal import CHI_SQUARE_95, MAD, TWO_SIDED_95
from .credibility import climbing_load, still_air_angle
from .finding import Finding
from .record import Record
from .windows import flight_stretches, within

__all__ = ["accelerometer_steps", "frozen_vanes", "probe_steps", "without_frozen"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# s that a vane rests at least, and times the longest rest in 99 % of the flight beside: coarse vanes rest in calm air.
RESTS_S, RESTS, USUAL = 30.0, 5.0, 0.99
# rad, by which attitude and climb say that it should move meanwhile: half a degree, and so many of its own steps.
SHOULD_MOVE, STEPS = np.radians(0.5), 2.0
# s of the means before and after a step of the temperature, and between them, which a probe and a recorder take to
# follow.
PROBE_MEAN_S, PROBE_GAP_S = 4, 2
# K, and K per m of altitude meanwhile, in which air can be layered. Off a lapse rate the static temperature of both
# recorded Citations changes by at most 1.6 K within these seconds in level flight and by 2.5 K in 55 m of climb.
AIR_K, LAYERED = 3.0, 0.1
# Times what the flight usually shows, that a step is; s after which it must still be there.
UNUSUAL, LASTS_S = 10.0, 30
# s of the means before and after a step of the normal acceleration, with less bank than this, rad: in a turn, bank is
# not known well enough. Such means of both Citations differ by at most 0.10 m/s^2, nine tenths by less than 0.03.
LOAD_MEAN_S, LARGEST_BANK, FEWEST = 120, np.radians(20.0), 0.6
LEAST_STEP, UNUSUAL_LOAD = 0.15, 10.0
# s over which errors of the means are alike, where an onset is sought.
ALIKE_S = 10.0


def frozen_vanes(log: FlightLog, record: Record, phases: Sequence[Phase]) -> tuple[Finding, ...]:
    """Return the stretches in which the angle of attack holds one value while the aircraft changes its own."""
    if not {"aoa", "tas", "altitude_rate", "pitch", "roll"} <= record.channels.keys():
        return ()
    values, rate_hz = log.channels["aoa"].values, log.rate_hz
    quantum = find_quantum(values[np.isfinite(values)]) or 0.0
    flies = within(log.time_s, flight_stretches(phases))
    runs = [run for run in _rests(values) if flies[run[0] : run[1]].mean() > 0.5]
    seconds = np.array([(end - first) / rate_hz for first, end in runs])
    reference = still_air_angle(record)
    found = []
    for k in np.flatnonzero(seconds >= RESTS_S).tolist():
        first, end = runs[k]
        others = np.delete(seconds, k)
        usual_s = _usual(others, float(np.count_nonzero(flies)) / rate_hz - float(seconds[k]))
        onset_s, until_s = float(log.time_s[first]), float(log.time_s[end - 1])
        meanwhile = reference[within(record.time_s, [(onset_s, until_s)])]
        meanwhile = meanwhile[np.isfinite(meanwhile)]
        if seconds[k] < RESTS * usual_s or meanwhile.size < 0.5 * RESTS_S:
            continue
        low, high = np.quantile(meanwhile, (0.05, 0.95))
        if high - low < max(SHOULD_MOVE, STEPS * quantum):
            continue
        lasts = end >= len(values)
        found.append(
            Finding(
                fault="aoa",
                among=("aoa",),
                channels=("aoa",),
                stage="sensors",
                shape="frozen",
                magnitude=None,
                sd=None,
                unit="",
                onset_s=onset_s,
                onset_ci95=(onset_s - 1.0 / rate_hz - PROBE_GAP_S, onset_s + 1.0 / rate_hz),
                offset_s=None if lasts else until_s,
                statistic=float(seconds[k]),
                threshold=max(RESTS_S, RESTS * usual_s),
                effect={"aoa": float(max((values[first] - low, values[first] - high), key=abs))},
                evidence={"rests_s": float(seconds[k])},
            )
        )
    return tuple(found)


def _rests(values: FloatArray) -> list[tuple[int, int]]:
    """Return first and end of every run of samples that are the same."""
    same = np.concatenate([[False], values[1:] == values[:-1], [False]])
    edges = np.flatnonzero(np.diff(same.astype(np.int8)))
    return [(int(first), int(last) + 1) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _usual(seconds: FloatArray, flown_s: float) -> float:
    """Return the length of rest that all but a hundredth of the time flown lies below."""
    order = np.sort(seconds)[::-1]
    return (
        float(order[min(int(np.searchsorted(np.cumsum(order), (1.0 - USUAL) * flown_s)), len(order) - 1)])
        if len(order)
        else 0.0
    )


def probe_steps(record: Record, phases: Sequence[Phase], recorded: Collection[str]) -> tuple[Finding, ...]:
    """Return the steps of the air temperature that no air has: a probe, with all that is computed from it."""
    channels = record.channels
    heat = next((name for name in ("tat", "sat") if name in recorded), None)
    if heat is None or "altitude" not in channels:
        return ()
    # Of a probe without a speed what it shows is taken for the air's: the speed's own steps then hide some.
    if "sat" in channels:
        sat = channels["sat"]
    else:
        sat = (
            static_temperature(channels["tat"], np.maximum(channels["mach"], 0.0))
            if "mach" in channels
            else channels["tat"]
        )
    speed = 340.0 * channels["mach"] if "mach" in channels else channels["tas"]
    flies = within(record.time_s, flight_stretches(phases))
    warmer, higher, faster = (
        _difference(np.where(flies, x, np.nan), PROBE_MEAN_S, PROBE_GAP_S) for x in (sat, channels["altitude"], speed)
    )
    follows = np.column_stack([higher, faster])
    known = np.isfinite(warmer) & np.isfinite(follows).all(axis=1)
    if np.count_nonzero(known) < LASTS_S:
        return ()
    own = warmer - follows @ np.linalg.lstsq(follows[known], warmer[known], rcond=None)[0]
    usual = MAD * float(np.median(np.abs(own[known])))
    least = np.maximum(AIR_K, UNUSUAL * usual) + LAYERED * np.abs(higher)
    return tuple(
        _probe_finding(record, recorded, heat, int(k), float(own[k]), usual, float(least[k]))
        for k in _peaks(np.abs(own) / least, PROBE_MEAN_S + PROBE_GAP_S)
        if _lasts(own, sat, int(k))
    )


def _lasts(own: FloatArray, sat: FloatArray, k: int) -> bool:
    """Return whether a step is there half a minute later, but for half of it: a spike is none."""
    before, after = sat[max(0, k - LASTS_S) : k - 2], sat[k + 2 : k + LASTS_S]
    if not (np.isfinite(before).any() and np.isfinite(after).any()):
        return False
    return bool((np.nanmedian(after) - np.nanmedian(before)) / own[k] > 0.5)


def _probe_finding(
    record: Record, recorded: Collection[str], heat: str, k: int, step: float, usual: float, least: float
) -> Finding:
    onset_s, reach_s = float(record.time_s[k]), 0.5 * (PROBE_MEAN_S + PROBE_GAP_S)
    warmth = record.channels["sat"][k] if "sat" in record.channels else record.channels[heat][k]
    size = step * float(record.channels[heat][k] / warmth)
    speed = float(record.channels["tas"][k]) if "tas" in record.channels else 0.0
    return Finding(
        fault=heat,
        among=(heat,),
        channels=tuple(name for name in ("tat", "sat", "tas") if name in recorded),
        stage="static relations",
        shape="bias",
        magnitude=size,
        sd=max(usual, 1e-3 * abs(size)),
        unit="K",
        onset_s=onset_s,
        onset_ci95=(onset_s - reach_s, onset_s + reach_s),
        statistic=abs(step) / least,
        threshold=1.0,
        effect={
            name: value
            for name, value in (("tat", size), ("sat", step), ("tas", 0.5 * speed * step / float(warmth)))
            if name in recorded
        },
        evidence={"temperature against the altitude": round(abs(step) / least, 2)},
    )


def accelerometer_steps(record: Record, phases: Sequence[Phase]) -> tuple[Finding, ...]:
    """Return the steps of the normal acceleration that neither climb nor bank explain.

    The climb is that of the altitude and that of attitude and airspeed: a static line that leaks makes a climb of the
    one, and a vane that steps one of the other.
    """
    channels = record.channels
    if not {"normal_acc", "altitude_rate", "pitch", "roll", "tas"} <= channels.keys():
        return ()
    level = within(record.time_s, flight_stretches(phases)) & (np.abs(channels["roll"]) < LARGEST_BANK)
    aoa = channels.get("aoa", np.zeros(len(record.time_s)))
    by_attitude = channels["tas"] * np.sin(climb_angle(aoa, channels["pitch"], channels["roll"]))
    excess = np.where(level, channels["normal_acc"] - climbing_load(record), np.nan)
    other = np.where(level, channels["normal_acc"] - climbing_load(record, by_attitude), np.nan)
    shown, confirmed = (_difference(one, LOAD_MEAN_S, 0) for one in (excess, other))
    change = np.where(np.abs(confirmed) < np.abs(shown), np.where(confirmed * shown > 0.0, confirmed, 0.0), shown)
    known = np.isfinite(change)
    if np.count_nonzero(known) < 2 * LOAD_MEAN_S:
        return ()
    # A step is in 240 s of differences, much of a short flight: the lower quartile, as of a normal distribution.
    usual = float(np.quantile(np.abs(change[known]), 0.25)) / 0.3186
    least = max(LEAST_STEP, UNUSUAL_LOAD * usual)
    found = []
    for k in _peaks(np.abs(change) / least, LOAD_MEAN_S):
        first, last = max(0, k - LOAD_MEAN_S), min(len(excess), k + LOAD_MEAN_S)
        onset, low, high = _onset(excess[first:last])
        if not abs(change[first + onset]) >= least:  # it splits what turns leave of a stretch, and says nothing
            onset, low, high = k - first, 0, last - first - 1
        size = float(shown[first + onset])
        times = record.time_s[[first + onset, first + low, min(first + high, len(excess) - 1)]] - 0.5
        found.append(
            Finding(
                fault="normal_acc",
                among=("normal_acc",),
                channels=("normal_acc",),
                stage="static relations",
                shape="bias",
                magnitude=size,
                sd=float(np.quantile(np.abs(shown[np.abs(shown) < 0.5 * abs(size)]), 0.95)) / TWO_SIDED_95,
                unit="m/s^2",
                onset_s=float(times[0]),
                onset_ci95=(float(times[1]) - 1.0, float(times[2]) + 1.0),
                statistic=float(abs(change[first + onset])) / least,
                threshold=1.0,
                effect={"normal_acc": size},
                evidence={"normal_acc against climb and bank": round(float(abs(change[first + onset])) / least, 2)},
            )
        )
    return tuple(found)


def _difference(values: FloatArray, n: int, gap: int) -> FloatArray:
    """Return the mean of n values from a sample on, or `gap` later, less that of n before; NaN with too few."""
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    change = np.full(len(values), np.nan)
    k = np.arange(n + gap, len(values) - n - gap)
    if not k.size:
        return change

    def mean(first: NDArray[np.intp]) -> FloatArray:
        seen = count[first + n] - count[first]
        return np.where(seen >= FEWEST * n, (total[first + n] - total[first]) / np.maximum(seen, 1), np.nan)

    change[k] = mean(k + gap) - mean(k - n - gap)
    return change


def _peaks(ratio: FloatArray, apart: int) -> list[int]:
    """Return the samples at which a ratio is above 1 and the largest within so many to both sides."""
    left, found = np.nan_to_num(ratio), []
    while left.size and left.max() > 1.0:
        k = int(np.argmax(left))
        found.append(k)
        left[max(0, k - apart) : k + apart + 1] = 0.0
    return sorted(found)


def _onset(values: FloatArray) -> tuple[int, int, int]:
    """Return where a step splits values best, and the first and last place that does as well."""
    known = np.flatnonzero(np.isfinite(values))
    x = values[known]
    n = np.arange(1, len(x))
    before, after = np.cumsum(x)[:-1] / n, np.cumsum(x[::-1])[:-1][::-1] / n[::-1]
    gained = (before - after) ** 2 * n * n[::-1] / len(x)
    k = int(np.argmax(gained))
    spread = float(np.sum((x - x.mean()) ** 2) - gained[k]) / len(x)
    near = np.flatnonzero(gained >= gained[k] - CHI_SQUARE_95 * ALIKE_S * spread)
    return int(known[k + 1]), int(known[near[0]]), int(known[near[-1] + 1])


def without_frozen(log: FlightLog, found: Sequence[Finding]) -> FlightLog:
    """Return a log without the samples in which a channel is frozen."""
    channels = dict(log.channels)
    for one in found:
        until_s = np.inf if one.offset_s is None else one.offset_s
        gone = (log.time_s >= one.onset_ci95[0]) & (log.time_s <= until_s)
        values = np.where(gone, np.nan, channels[one.fault].values)
        values.setflags(write=False)
        channels[one.fault] = replace(channels[one.fault], values=values)
    return replace(log, channels=channels)
