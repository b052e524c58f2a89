"""Sensors that step by themselves: an airspeed, a temperature probe, an altimeter, a normal accelerometer, a pitch.

What is computed from a temperature follows a probe that is wrong, so that no relation between these channels breaks;
but no air changes by some kelvin within seconds at one altitude. The mean of a normal acceleration over two minutes is
that of gravity, bank and little else, since the climb is no other afterwards than before by more than its own change.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...airdata import G, air_data_of, climb_angle
from ...airdata.relations import load
from ...flightlog import FlightLog
from ...flightlog.phases import Phase
from ...kernels import MAD, TWO_SIDED_95, BoolArray, FloatArray, IntArray
from ...kernels.quantisation import find_quantum
from .finding import Finding, as_good, squares_by_onset
from .record import STEP_S, Record
from .windows import Window, flight_stretches, within

# Mean acceleration along the path over a second that no flight has, m/s^2: thrust, drag and slope of 1 g together with
# the largest design gust, 20 m/s (66 ft/s, 14 CFR 23.333). 14 healthy flights of seven aircraft have at most 6.7.
FASTEST, SECOND_S = 3.0 * G, 1.0
BESIDE_S = 5.0  # of the medians before and after such a step, and between two
# USUAL_S [s]: before a step, whose median tells whether it leads away from what the airspeed was, or back to it.
USUAL_S = 300.0
# BACK: share of a step that may be left after one that leads back: more is a part of a return, and another error.
BACK = 0.5
# LEAST_READ [m/s]: 20 kt, below which airspeed indicators read nothing, so that what comes after is no share of it.
LEAST_READ = 10.0
AT_ONCE_EVIDENCE, PITCH_EVIDENCE = "airspeed at once", "pitch against climb and lift"
# s of the means before and after a step of the temperature, and between them, which a probe and a recorder take to
# follow.
PROBE_MEAN_S, PROBE_GAP_S = 4, 2
# K, and K per m of altitude meanwhile, in which air can be layered. Off a lapse rate the static temperature of both
# recorded Citations changes by at most 1.6 K within these seconds in level flight and by 2.5 K in 55 m of climb.
AIR_K, LAYERED = 3.0, 0.1
# m, steps of the altitude, and share of its change, by which it does not change beside its rate: at most 4.7 m in the
# flights of three recorders.
ALTIMETER_M, ALTIMETER_STEPS, SHARE = 8.0, 3.0, 0.1
# The share of it that one second of a step has at least, in two of which its sample and the recorder's low-pass lie.
AT_ONCE = 0.4
# Times what the flight usually shows, that a step is; s after which it must still be there.
UNUSUAL, LASTS_S = 10.0, 30
# Times the usual change, beyond which one has no part in the fit of what follows, which is made so many times; chosen
# without a tuning record: of normal changes one in twenty thousand is left out.
STANDS_OUT, FITS = 6.0, 4
# s of the means before and after a step of the normal acceleration, with less bank than this, rad: in a turn, bank is
# not known well enough. Such means of both Citations differ by at most 0.10 m/s^2, nine tenths by less than 0.03.
LOAD_MEAN_S, LARGEST_BANK, FEWEST = 120, np.radians(20.0), 0.6
LEAST_STEP, UNUSUAL_LOAD = 0.15, 10.0
ALIKE_S = 10.0  # over which errors of the means are alike, where an onset is sought
# s of the means of pitch and climb before and after a step of the pitch, between them, and of those of the jump itself.
# A wing that holds its speed and its load climbs by as much as it pitches, within a second or two.
PITCH_MEAN_S, PITCH_GAP_S, JUMP_MEAN_S = 8, 3, 3
# Share of the step that one second of it has, and by which the jump may miss the whole: flaps take some seconds.
IN_A_SECOND, ALL_AT_ONCE = 0.6, 0.4
# Times what the flight usually shows beside climb and lift, and times the jump that nine tenths of the minutes beside
# keep below: of 14 healthy flights of six aircraft none reaches 2.7 of both, without the SR22T none 2.4
# (tests/measurements/test_told_levels.py).
UNUSUAL_PITCH, UNUSUAL_JUMP, BESIDE_JUMP_S = 3.0, 3.0, 60
SETTLES = "flaps that move at once, or an attitude that settles, would show the same"
STEEP_BANK = np.radians(45.0)  # beyond which lift is no more that of climb and load


def sensor_steps(
    log: FlightLog, record: Record, phases: Sequence[Phase], *, without: Sequence[Window]
) -> tuple[Finding, ...]:
    """Return the steps of an airspeed, a temperature probe, an altimeter, a normal accelerometer and a pitch.

    Parameters
    ----------
    without : stretches in which the static line is held or leaks.
    """
    return (
        *airspeed_steps(log, phases),
        *probe_steps(record, phases, log.channels.keys()),
        *altimeter_steps(record, phases, without),
        *accelerometer_steps(record, phases),
        *pitch_steps(record, phases),
    )


def airspeed_steps(log: FlightLog, phases: Sequence[Phase]) -> tuple[Finding, ...]:
    """Return the steps of airspeeds that are faster than any flight; what several do at once, the pitot line does."""
    flown = within(log.time_s, flight_stretches(phases))
    names = [name for name in ("tas", "cas", "ias") if name in log.channels]
    steps = {name: _airspeed_steps(log, log.channels[name].values, flown) for name in names}
    findings = []
    for name, step in [(channel, each) for channel in names for each in steps[channel]]:
        alike = {other: twin for other in names for twin in steps[other] if abs(twin.onset_s - step.onset_s) < SECOND_S}
        if name != next(iter(alike)):
            continue
        lost = step.after < step.before
        fault, size, sd, unit = name, step.size, step.sd, "m/s"
        if len(names) > 1 and len(alike) == len(names):
            if not lost and step.before < LEAST_READ:
                continue
            share = (max(step.after, 0.0) / max(step.before, LEAST_READ)) ** 2 - 1.0  # of the impact pressure
            fault, size, unit = ("pitot_icing", abs(share), "1") if lost else ("q_impact", share, "1")
            sd *= 2.0 * max(step.after, step.sd) / step.before**2
        finding = _step(
            fault,
            size,
            sd=sd,
            unit=unit,
            onsets_s=(step.onset_s, step.onset_s - 1.0 / log.rate_hz, step.onset_s + 1.0 / log.rate_hz),
            statistic=step.statistic,
            words=AT_ONCE_EVIDENCE,
        )
        among = (fault, "pitot_icing") if len(names) == 1 and lost else (fault,)
        effect = {other: twin.size for other, twin in alike.items()}
        findings.append(replace(finding, among=among, channels=tuple(alike), effect=effect, offset_s=step.until_s))
    return tuple(findings)


@dataclass(frozen=True, slots=True, kw_only=True)
class _AirspeedStep:
    """A step of an airspeed: m/s usually, before and after it, and the error of their difference.

    Its onset and, where another leads back, its end, s.
    """

    onset_s: float
    until_s: float | None = None
    usual: float
    before: float
    after: float
    sd: float

    @property
    def leads_back(self) -> bool:
        """Whether the airspeed comes back by it to what it was."""
        return abs(self.after - self.usual) < abs(self.before - self.usual)

    @property
    def size(self) -> float:
        return self.after - self.before

    @property
    def statistic(self) -> float:
        return abs(self.size) / (FASTEST * SECOND_S)


def _airspeed_steps(log: FlightLog, values: FloatArray, flown: BoolArray) -> list[_AirspeedStep]:
    """Return the steps of an airspeed (n,) that it keeps for seconds, in or out of flight."""
    lag, beside = (max(1, round(seconds * log.rate_hz)) for seconds in (SECOND_S, BESIDE_S))
    if len(values) <= lag:
        return []
    # A gap, in which an aircraft may speed up by any amount, is no step.
    follows = log.time_s[lag:] - log.time_s[:-lag] < 1.5 * lag / log.rate_hz
    change = np.where((flown[lag:] | flown[:-lag]) & follows, np.abs(values[lag:] - values[:-lag]), np.nan)
    steps: list[_AirspeedStep] = []
    for k in _peaks(change / (FASTEST * SECOND_S), beside):
        onset = k + 1 + int(np.nanargmax(np.abs(np.diff(values[k : k + lag + 1]))))
        sides = slice(max(0, onset - beside), onset), slice(onset + lag - 1, onset + lag - 1 + beside)
        near_s = 1.5 * (beside + lag) / log.rate_hz
        near = (np.abs(log.time_s[side] - log.time_s[onset]) < near_s for side in sides)
        before, after = (
            values[side][known & np.isfinite(values[side])] for side, known in zip(sides, near, strict=True)
        )
        if min(before.size, after.size) < FEWEST * beside:
            continue
        spreads = [float(np.ptp(np.quantile(side, (0.16, 0.84)))) / 2.0 for side in (before, after)]
        level, left = float(np.median(before)), float(np.median(after))
        sd = max(float(np.linalg.norm(spreads)) / float(np.sqrt(BESIDE_S)), 1e-3 * abs(left - level))
        usual = float(np.nanmedian(values[max(0, onset - round(USUAL_S * log.rate_hz)) : onset]))
        step = _AirspeedStep(onset_s=float(log.time_s[onset]), usual=usual, before=level, after=left, sd=sd)
        if step.statistic <= 1.0:
            continue
        # One that leads back ends what began by another such step, or a loss that others describe.
        begun = steps[-1] if steps and not steps[-1].leads_back and steps[-1].until_s is None else None
        if begun is not None and abs(step.after - begun.usual) <= BACK * abs(begun.size):
            steps[-1] = replace(begun, until_s=step.onset_s)
        elif begun is not None or not step.leads_back:
            steps.append(step)
    return steps


def probe_steps(record: Record, phases: Sequence[Phase], recorded: Collection[str]) -> tuple[Finding, ...]:
    """Return the steps of the air temperature that no air has: a probe, with all that is computed from it."""
    channels = record.channels
    heat = next((name for name in ("tat", "sat") if name in recorded), None)
    if heat is None or "altitude" not in channels:
        return ()
    # What a probe without a speed shows is taken for the air's: the speed's own steps then hide some.
    sat = channels["sat"] if "sat" in channels else channels["tat"]
    if "sat" not in channels and "mach" in channels:
        sat = air_data_of({name: channels[name] for name in ("altitude", "mach", "tat")}).sat
    speed = 340.0 * channels["mach"] if "mach" in channels else channels["tas"]
    flies = within(record.time_s, flight_stretches(phases))
    warmer, higher, faster = (
        _difference(np.where(flies, x, np.nan), PROBE_MEAN_S, PROBE_GAP_S) for x in (sat, channels["altitude"], speed)
    )
    unexplained, usual = _less_what_follows(warmer, np.column_stack([higher, faster]))
    least = np.maximum(AIR_K, UNUSUAL * usual) + LAYERED * np.abs(higher)
    reach_s = 0.5 * (PROBE_MEAN_S + PROBE_GAP_S)
    findings = []
    for k in _lasting_peaks(unexplained, least, sat):
        step, warmth = float(unexplained[k]), float(channels["sat" if "sat" in channels else heat][k])
        size = step * float(channels[heat][k] / warmth)
        faster_by = 0.5 * float(channels["tas"][k] if "tas" in channels else 0.0) * step / warmth
        effects = {"tat": size, "sat": step, "tas": faster_by}
        finding = _step(
            heat,
            size,
            sd=max(usual, 1e-3 * abs(size)),
            unit="K",
            onsets_s=(float(record.time_s[k]), float(record.time_s[k]) - reach_s, float(record.time_s[k]) + reach_s),
            statistic=abs(step) / float(least[k]),
            words="temperature against the altitude",
        )
        names = tuple(name for name in ("tat", "sat", "tas") if name in recorded)
        findings.append(replace(finding, channels=names, effect={name: effects[name] for name in names}))
    return tuple(findings)


def altimeter_steps(record: Record, phases: Sequence[Phase], without: Sequence[Window]) -> tuple[Finding, ...]:
    """Return the steps of the altitude that its rate does not have: an altimeter, or what is set on it.

    Parameters
    ----------
    without : stretches in which the static line is held or leaks: then both read what the line does.
    """
    excess, unexplained, least, sd = _altitude_beside_rate(record, phases, without)
    at_once = np.nan_to_num(np.abs(np.diff(excess)))  # by which a step changes, and what is held does not
    findings = []
    for k in _lasting_peaks(unexplained, least, excess):
        first = max(0, k - PROBE_MEAN_S)
        onset = first + int(np.argmax(at_once[first : k + PROBE_MEAN_S]))
        # With the onset between the two means: at the peak a part of one may be from before it.
        at = onset + 1 if np.isfinite(unexplained[onset + 1]) else k
        size = float(unexplained[at])
        if abs(size) > least[at] and at_once[onset] > AT_ONCE * abs(size):
            onset_s = float(record.time_s[onset]) + 0.5 * STEP_S
            findings.append(
                _step(
                    "altitude",
                    size,
                    sd=max(float(sd[at]), 1e-3 * abs(size)),
                    unit="m",
                    onsets_s=(onset_s, onset_s - STEP_S, onset_s + STEP_S),
                    statistic=abs(size) / float(least[at]),
                    words="altitude against its rate",
                )
            )
    return tuple(findings)


def altitude_step_within(
    record: Record, phases: Sequence[Phase], without: Sequence[Window], onsets_s: tuple[float, float]
) -> float:
    """Return the size of step of the altitude, m, that its rate allows with an onset in an interval, infinite for any.

    Parameters
    ----------
    without : see `altimeter_steps`.
    """
    _, unexplained, least, _ = _altitude_beside_rate(record, phases, without)
    reach_s = PROBE_MEAN_S + PROBE_GAP_S
    about = within(record.time_s, [(onsets_s[0] - reach_s, onsets_s[1] + reach_s)])
    allowed = np.abs(unexplained[about]) + least[about]
    return float(allowed.max()) if allowed.size and np.isfinite(allowed).all() else np.inf


def _altitude_beside_rate(
    record: Record, phases: Sequence[Phase], without: Sequence[Window]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the altitude less the integral of its rate, its changes, how large a step's must be, and their errors.

    A rate that lags makes a change of the altitude that follows a change of the rate; it is taken off. All are (n,),
    NaN where they are not known.
    """
    channels = record.channels
    if not {"altitude", "altitude_rate"} <= channels.keys():
        unknown = np.full(len(record.time_s), np.nan)
        return unknown, unknown, unknown, unknown
    watched = within(record.time_s, flight_stretches(phases)) & ~within(record.time_s, without)
    rate = np.where(watched, channels["altitude_rate"], np.nan)
    climbed = STEP_S * (np.cumsum(np.nan_to_num(rate)) - 0.5 * np.nan_to_num(rate))
    excess = np.where(np.isfinite(rate), channels["altitude"] - climbed, np.nan)
    change, faster, by_rate = (_difference(x, PROBE_MEAN_S, PROBE_GAP_S) for x in (excess, rate, climbed))
    unexplained, usual = _less_what_follows(change, faster[:, None])
    quantum = find_quantum(channels["altitude"][np.isfinite(channels["altitude"])]) or 0.0
    least = max(ALTIMETER_M, UNUSUAL * usual, ALTIMETER_STEPS * quantum) + SHARE * np.abs(by_rate)
    return excess, unexplained, np.where(np.isfinite(unexplained), least, np.nan), np.hypot(usual, SHARE * by_rate)


def _less_what_follows(change: FloatArray, follows: FloatArray) -> tuple[FloatArray, float]:
    """Return (n,) changes less what follows others, (n, n_others), and their usual size; NaN where few are known.

    What is fitted leaves out the changes that stand out, which else would hide a part of themselves.
    """
    known = np.isfinite(change) & np.isfinite(follows).all(axis=1)
    if np.count_nonzero(known) < LASTS_S:
        return np.full(len(change), np.nan), np.nan
    fitted = known
    for _ in range(FITS):
        unexplained = change - follows @ np.linalg.lstsq(follows[fitted], change[fitted], rcond=None)[0]
        usual = MAD * float(np.median(np.abs(unexplained[known])))
        fitted = known & (np.abs(unexplained) <= STANDS_OUT * usual) if usual > 0.0 else known
    return unexplained, usual


def _lasting_peaks(changes: FloatArray, least: FloatArray, values: FloatArray) -> list[int]:
    """Return the samples at which a change of values is largest and above the least; a spike is none.

    The step is there half a minute later, but for half of it.
    """
    lasting = []
    for k in _peaks(np.abs(changes) / least, 2 * (PROBE_MEAN_S + PROBE_GAP_S)):
        before, after = values[max(0, k - LASTS_S) : k - 2], values[k + 2 : k + LASTS_S]
        known = np.isfinite(before).any() and np.isfinite(after).any()
        if known and (np.nanmedian(after) - np.nanmedian(before)) / changes[k] > 0.5:
            lasting.append(k)
    return lasting


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
    state = record.state
    states = (state, replace(state, rates={**state.rates, "altitude_rate": np.gradient(by_attitude, record.time_s)}))
    excess, other = (np.where(level, channels["normal_acc"] - load(each), np.nan) for each in states)
    shown, confirmed = (_difference(course, LOAD_MEAN_S, 0) for course in (excess, other))
    change = np.where(np.abs(confirmed) < np.abs(shown), np.where(confirmed * shown > 0.0, confirmed, 0.0), shown)
    known = np.isfinite(change)
    if np.count_nonzero(known) < 2 * LOAD_MEAN_S:
        return ()
    # A step is in 240 s of differences, much of a short flight: the lower quartile, as of a normal distribution.
    usual = float(np.quantile(np.abs(change[known]), 0.25)) / 0.3186
    least = max(LEAST_STEP, UNUSUAL_LOAD * usual)
    findings = []
    for k in _peaks(np.abs(change) / least, LOAD_MEAN_S):
        first, last = max(0, k - LOAD_MEAN_S), min(len(excess), k + LOAD_MEAN_S)
        onset, low, high = (first + place for place in _onset(excess[first:last]))
        if not abs(change[onset]) >= least:  # it splits what turns leave of a stretch, and says nothing
            onset, low, high = k, first, last - 1
        size = float(shown[onset])
        onset_s, low_s, high_s = (record.time_s[[onset, low, high]] - 0.5 * STEP_S).tolist()
        findings.append(
            _step(
                "normal_acc",
                size,
                sd=float(np.quantile(np.abs(shown[np.abs(shown) < 0.5 * abs(size)]), 0.95)) / TWO_SIDED_95,
                unit="m/s^2",
                onsets_s=(onset_s, low_s - STEP_S, high_s + STEP_S),
                statistic=float(abs(change[onset])) / least,
                words="normal_acc against climb and bank",
            )
        )
    return tuple(findings)


def pitch_steps(record: Record, phases: Sequence[Phase]) -> tuple[Finding, ...]:
    """Return the steps of the pitch within a second that neither climb nor lift follow."""
    channels = record.channels
    if not {"pitch", "roll", "tas", "altitude"} <= channels.keys():
        return ()
    flies = within(record.time_s, flight_stretches(phases)) & (np.abs(channels["roll"]) < STEEP_BANK)
    force = channels["normal_acc"] + G if "normal_acc" in channels else G / np.cos(channels["roll"])
    speed = np.maximum(channels["tas"], LEAST_READ)
    # The climb is that of the altitude: a rate may lag by seconds.
    courses = channels["pitch"], np.gradient(channels["altitude"], record.time_s) / speed, force / speed**2
    pitch, climb, lift = (np.where(flies, course, np.nan) for course in courses)
    change, climbs, lifts = (_difference(course, PITCH_MEAN_S, PITCH_GAP_S) for course in (pitch, climb, lift))
    unexplained, usual = _less_what_follows(change, np.column_stack([climbs, lifts]))
    jump, second = _difference(pitch, JUMP_MEAN_S, 0), np.nan_to_num(np.abs(np.diff(pitch, prepend=np.nan)))
    size, off = np.abs(unexplained), np.abs(jump - unexplained)
    ratio = np.zeros(len(pitch))
    for k in np.flatnonzero((size > UNUSUAL_PITCH * usual) & (off < ALL_AT_ONCE * size)).tolist():
        beside = np.abs(np.arange(len(pitch)) - k)
        others = np.abs(jump[(beside <= BESIDE_JUMP_S) & (beside > 2 * JUMP_MEAN_S) & np.isfinite(jump)])
        if others.size and second[k - 1 : k + 2].max() > IN_A_SECOND * abs(jump[k]):
            unusual = float(np.quantile(others, 0.9)) * UNUSUAL_JUMP
            ratio[k] = min(size[k] / (UNUSUAL_PITCH * usual), abs(jump[k]) / unusual if unusual > 0.0 else np.inf)
    findings = []
    for k in _peaks(ratio, PITCH_MEAN_S + PITCH_GAP_S):
        onset_s = float(record.time_s[k - 1 + int(np.argmax(second[k - 1 : k + 2]))]) - 0.5 * STEP_S
        step = _step(
            "pitch",
            float(unexplained[k]),
            sd=max(usual, 1e-3 * float(size[k])),
            unit="rad",
            onsets_s=(onset_s, onset_s - STEP_S, onset_s + STEP_S),
            statistic=float(ratio[k]),
            words=PITCH_EVIDENCE,
        )
        findings.append(replace(step, doubt=SETTLES))
    return tuple(findings)


def _step(
    channel: str,
    size: float,
    *,
    sd: float,
    unit: str,
    onsets_s: tuple[float, float, float],
    statistic: float,
    words: str,
) -> Finding:
    """Return the finding of a channel that steps; `onsets_s` are the onset and the ends of its interval."""
    return Finding(
        fault=channel,
        among=(channel,),
        channels=(channel,),
        stage="static relations",
        shape="bias",
        magnitude=size,
        sd=sd,
        unit=unit,
        onset_s=onsets_s[0],
        onset_ci95=onsets_s[1:],
        statistic=statistic,
        threshold=1.0,
        effect={channel: size},
        evidence={words: round(statistic, 2)},
    )


def _difference(values: FloatArray, n: int, gap: int) -> FloatArray:
    """Return the mean of n values from a sample on, or `gap` later, less that of n before; NaN with too few."""
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    change = np.full(len(values), np.nan)
    k = np.arange(n + gap, len(values) - n - gap)
    if not k.size:
        return change

    def mean(first: IntArray) -> FloatArray:
        seen = count[first + n] - count[first]
        return np.where(seen >= FEWEST * n, (total[first + n] - total[first]) / np.maximum(seen, 1), np.nan)

    change[k] = mean(k + gap) - mean(k - n - gap)
    return change


def _peaks(ratio: FloatArray, apart: int) -> list[int]:
    """Return the samples at which a ratio is above 1 and the largest within so many to both sides."""
    left, peaks = np.nan_to_num(ratio), []
    while left.size and left.max() > 1.0:
        k = int(np.argmax(left))
        peaks.append(k)
        left[max(0, k - apart) : k + apart + 1] = 0.0
    return sorted(peaks)


def _onset(values: FloatArray) -> tuple[int, int, int]:
    """Return where a step splits values best, and the first and last place that does as well."""
    known = np.flatnonzero(np.isfinite(values))
    after = np.tri(len(known), len(known) - 1, -1)
    squares, _ = squares_by_onset(values[known], after)
    near = as_good(squares, len(known), ALIKE_S)
    return tuple(known[[int(np.argmin(squares)) + 1, near[0], near[-1] + 1]].tolist())
