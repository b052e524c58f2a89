"""Sensors that hold their reading while others move.

Calm air, a blocked port and a record that hangs hold a reading too: a sensor is frozen where it rests for several times
as long as elsewhere in the flight, and others say that it should move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...airdata import G, air_data_of
from ...airdata.relations import vane
from ...flightlog import FlightLog
from ...flightlog.defects import STILL, WATCHED, unwatched_in
from ...flightlog.derived import pressures_of
from ...flightlog.phases import Phase
from ...flightlog.quality import FEWEST_REPEATS
from ...flightlog.record import frozen_array
from ...kernels import BoolArray, FloatArray, IntArray
from ...kernels.runs import Run, bridged, is_repeated, repeats
from ...quantities.channels import quantity_of
from .finding import Finding
from .record import Record
from .sensors import PROBE_GAP_S
from .windows import flight_stretches, within

# s, and samples, that a frozen sensor rests at least, and times the longest rest in 99 % of the flight beside: coarse
# sensors rest in calm air. Of 50 sensors of six recorders the longest rest of a healthy one is 21 s, of one that rests
# for up to 13 s beside.
RESTS_S, RESTS, USUAL = 20.0, 5.0, 0.99
# SHORT_REST_S [s], SHORT_REPEATS [samples]: of a rest in flight of a sensor of which elsewhere fewer than FEW_ALIKE in
# a row are alike. Of the sensors of 14 flights of seven aircraft that rest for at most 0.7 s beside, none rests for
# more than 2.9 s, 29 samples (a calibrated airspeed at 10 Hz); three times the samples. A reading of 0 is the end of a
# scale.
SHORT_REST_S, SHORT_REPEATS, FEW_ALIKE = 2.0, 100, 5
# Those that hardly rest, s, of which most must move meanwhile: a recorder that hangs holds all of them.
LIVELY_S, MOST = 2.5, 0.75
MOVING = frozenset(WATCHED) - {"tat", "sat"}  # which level flight holds
# By a blocked port, with the rate of climb, which then shows its noise and its offset: less than these.
PORT_HOLDS, CLIMBED_M, CLIMBING_M_S = ("altitude", "p_static"), 20.0, 0.1
# s that a vane should move in meanwhile.
VANE_NEEDS = frozenset({"aoa", "tas", "altitude_rate", "pitch", "roll"})
VANE_RESTS_S = 30.0
# rad, by which attitude and climb say that it should move meanwhile: half a degree, and so many of its own steps.
SHOULD_MOVE, STEPS = np.radians(0.5), 2.0
TURNS_S = 10.0  # over which a heading tells the bank of a turn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rests:
    """When the sensors of a log rest.

    Attributes
    ----------
    runs : by channel, of samples of one value.
    flown_s, watched_s : (n + 1,) seconds of flight, and of what of it is watched, up to each sample.
    """

    log: FlightLog
    runs: Mapping[str, Sequence[Run]]
    flown_s: FloatArray
    watched_s: FloatArray

    def usual_s(self, name: str, run: Run) -> float:
        """Return the length of rest that all but a hundredth of the flight beside a run lies below."""
        seconds = np.diff(self.flown_s[_beside(self.runs[name], run)])[:, 0]
        order = np.sort(seconds[seconds > 0.0])[::-1]
        beside_s = float(self.flown_s[-1]) - float(self.flown_s[run[1]] - self.flown_s[run[0]])
        k = int(np.searchsorted(np.cumsum(order), (1.0 - USUAL) * beside_s))
        return float(order[min(k, len(order) - 1)]) if order.size else 0.0

    def seconds_and_needed(self, name: str, run: Run) -> tuple[float, float]:
        """Return how long a sensor rests and how long it needs to, s: by the flight, or by its samples."""
        values, rate_hz, flown_s = self.log.channels[name].values, self.log.rate_hz, float(self.flown_s[-1])
        seconds, samples_s = float(self.flown_s[run[1]] - self.flown_s[run[0]]), FEWEST_REPEATS / rate_hz
        if seconds >= max(RESTS_S, samples_s) and flown_s - seconds >= RESTS_S:
            return seconds, max(RESTS_S, samples_s, RESTS * self.usual_s(name, run))
        others = _beside(self.runs[name], run)
        longest_s = float(np.diff(self.watched_s[others[values[others[:, 0]] != 0.0]]).max(initial=0.0))
        seconds = float(self.watched_s[run[1]] - self.watched_s[run[0]]) if values[run[0]] != 0.0 else 0.0
        if longest_s * rate_hz >= FEW_ALIKE or self.watched_s[-1] - seconds < RESTS_S:
            return seconds, np.inf
        return seconds, max(SHORT_REST_S, SHORT_REPEATS / rate_hz, RESTS * longest_s)

    def others_move(self, name: str, run: Run) -> bool:
        """Return whether most of the other sensors that hardly rest move.

        A blocked port holds the altitude and its rate at once: of an altitude only its rate counts, a rate is not
        frozen while the altitude rests.
        """
        during = {channel: self.log.channels[channel].values[slice(*run)] for channel in self.log.channels}
        if quantity_of(name) == "altitude_rate" and pressures_of(self.log, name):
            altitudes = [during[channel] for channel in PORT_HOLDS if channel in during]
            if any(np.mean(is_repeated(values)) >= 0.5 for values in altitudes):
                return False
        if quantity_of(name) in PORT_HOLDS:
            rate = during.get("altitude_rate", np.zeros(1))
            climbed = np.cumsum(np.nan_to_num(rate)) / self.log.rate_hz
            climbs = np.ptp(climbed) > max(CLIMBED_M, CLIMBING_M_S * len(rate) / self.log.rate_hz)
            return bool(climbs and np.mean(is_repeated(rate)) < 0.5)
        if quantity_of(name) == "roll" and {"yaw", "tas"} <= during.keys() and not self._turns(name, during):
            return False
        others = [channel for channel in during if channel != name and self.usual_s(channel, run) < LIVELY_S]
        resting = [max((end - first for first, end in repeats(during[channel])), default=0) for channel in others]
        return bool(resting) and float(np.mean(np.array(resting) < 0.5 * (run[1] - run[0]))) >= MOST

    def _turns(self, name: str, during: Mapping[str, FloatArray]) -> bool:
        """Return whether the heading turns as at no bank near the one that a roll holds: at g tan(bank) / V."""
        n = round(TURNS_S * self.log.rate_hz)
        heading, speed = np.unwrap(bridged(during["yaw"])), float(np.nanmedian(during["tas"]))
        if heading.size <= n or not speed > 0.0:
            return False
        rate = (heading[n:] - heading[:-n]) / TURNS_S
        step, least = (self.log.channels[channel].step or 0.0 for channel in (name, "yaw"))
        bank = np.arctan((np.abs(rate) - least / TURNS_S) * speed / G) * np.sign(rate)
        return bool(np.max(np.abs(bank - during[name][0])) > max(SHOULD_MOVE, STEPS * step))


def frozen_sensors(log: FlightLog, record: Record, phases: Sequence[Phase]) -> tuple[Finding, ...]:
    """Return the stretches in which a sensor holds one value to the last bit while others move.

    It rests for several times as long as in all but a hundredth of the flight beside, or where its samples else differ,
    within seconds, as in all of it. Of a vane attitude and climb must say that it should move, of an altitude the rate
    of climb: calm air, and a blocked port, hold these too.
    """
    rests = _Rests(
        log=log,
        runs={name: repeats(channel.values) for name, channel in log.channels.items()},
        flown_s=_seconds_to(within(log.time_s, flight_stretches(phases)), log.rate_hz),
        watched_s=_seconds_to(~within(log.time_s, unwatched_in(phases)), log.rate_hz),
    )
    reference = vane(record.state, "altitude_rate") if record.channels.keys() >= VANE_NEEDS else None
    moving = log.independent([name for name in log.channels if quantity_of(name) in MOVING])
    findings = []
    for name, run in [(channel, each) for channel in moving for each in rests.runs[channel]]:
        first, end = run
        if end - first < FEWEST_REPEATS:
            continue
        seconds, needed = rests.seconds_and_needed(name, run)
        if seconds < needed or not rests.others_move(name, run):
            continue
        if quantity_of(name) == "p_total" and _tube_rests(log, slice(first, end)):
            continue  # `holds` names the tube
        onset_s, until_s = float(log.time_s[first]), float(log.time_s[end - 1])
        effect: dict[str, float] = {}
        if quantity_of(name) == "aoa":
            error = None if reference is None else _error_of_vane(log, record, reference, name, (onset_s, until_s))
            if error is None:
                continue
            effect = {name: error}
        findings.append(
            Finding(
                fault=name,
                among=(name,),
                channels=(name,),
                stage="sensors",
                shape="frozen",
                onset_s=onset_s,
                onset_ci95=(onset_s - 1.0 / log.rate_hz - PROBE_GAP_S, onset_s + 1.0 / log.rate_hz),
                offset_s=None if end >= log.n_samples else until_s,
                statistic=seconds,
                threshold=needed,
                effect=effect,
                evidence={"rests_s": seconds},
            )
        )
    return tuple(findings)


def _beside(runs: Sequence[Run], covered: Run) -> IntArray:
    """Return (n, 2) what is left of runs beside another."""
    first, end = np.array(runs, dtype=np.intp).reshape(-1, 2).T
    pieces = np.column_stack([np.append(first, np.maximum(first, covered[1])), np.append(end, end)])
    pieces[: len(end), 1] = np.minimum(end, covered[0])
    return np.asarray(pieces[pieces[:, 1] > pieces[:, 0]])


def _seconds_to(inside: BoolArray, rate_hz: float) -> FloatArray:
    """Return (n + 1,) the seconds of a stretch of samples up to each."""
    return np.concatenate([[0.0], np.cumsum(inside) / rate_hz])


def _tube_rests(log: FlightLog, stretch: slice) -> bool:
    """Return whether the total pressure rests by an airspeed as well: the tube holds, and no sensor.

    It rests as a frozen reading does, beside the motion that the impact pressure asks of it.
    """
    static = next((name for name in ("p_static", "altitude") if name in log.channels), None)
    speed = next((name for name in ("cas", "ias", "mach") if name in log.channels), None)
    if static is None or speed is None:
        return False
    air = air_data_of({name: log.channels[name].values[stretch] for name in (static, speed)})
    total, impact = (
        np.ptp(np.nanquantile(pressure, (0.05, 0.95))) if np.isfinite(pressure).any() else 0.0
        for pressure in (air.p_total, air.q_impact)
    )
    return bool(total <= STILL * impact)


def _error_of_vane(
    log: FlightLog, record: Record, reference: FloatArray, name: str, during: tuple[float, float]
) -> float | None:
    """Return the largest error of a vane that rests, None where attitude and climb do not say that it should move."""
    values = log.channels[name].values
    meanwhile = reference[within(record.time_s, [during])]
    meanwhile = meanwhile[np.isfinite(meanwhile)]
    if meanwhile.size < 0.5 * VANE_RESTS_S:
        return None
    low, high = np.quantile(meanwhile, (0.05, 0.95))
    if high - low < max(SHOULD_MOVE, STEPS * (log.channels[name].step or 0.0)):
        return None
    held = values[np.searchsorted(log.time_s, during[0])]
    return float(max((held - low, held - high), key=abs))


def without_frozen(log: FlightLog, findings: Sequence[Finding]) -> FlightLog:
    """Return a log without the samples in which a channel is frozen."""
    channels = dict(log.channels)
    for finding in findings:
        gone = (log.time_s >= finding.onset_ci95[0]) & (log.time_s <= finding.until_s)
        channel = channels[finding.fault]
        channels[finding.fault] = replace(channel, values=frozen_array(np.where(gone, np.nan, channel.values)))
    return replace(log, channels=channels)
