"""The flight of a log, ready for every analysis: its channels, phases, windows and angle of zero lift."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..airdata import IMPACT_SOURCES
from ..config import Config, Diagnose
from ..errors import ConfigError, LogError
from ..faults import did_you_mean, shown
from ..faults.ordinary import Occurrence
from ..flightlog import FlightLog
from ..flightlog.defects import Defect, find_defects, with_bridges, without_defects
from ..flightlog.ordinary import check_within
from ..flightlog.phases import AIRBORNE, NO_AIRSPEED, Disagreement, Phase, find_phases, spans_of
from ..flightlog.plausible import IN_FLIGHT, impossible_median, sentence_of_impossible
from ..flightlog.quality import with_seen_recorder
from ..model.preprocessing.defaults import AIRSPEEDS, FIXED, tolerance_of
from ..quantities.channels import STANDARD, quantity_of
from .parity import (
    RESIDUALS,
    Finding,
    ParityTable,
    Record,
    WindowScan,
    configuration_changes,
    record_of,
    scan_window,
    shipped_tables,
    windows_in,
    zero_lift_of,
)
from .parity.calibration import load_air_data
from .parity.credibility import coarse_positions, credibility_of
from .parity.frozen import frozen_sensors, without_frozen
from .parity.holds import Holds, find_holds
from .parity.record import USED
from .parity.relation_series import Series, relation_series
from .parity.sensors import sensor_steps
from .parity.windows import Window, flight_stretches, overlaps, within
from .plausibility import Implausible
from .tables import ORDINARY

STALLS = "the aircraft stalls meanwhile"
# Beside a held line, where the filters of the recorder and the leak itself still act.
BRIDGE_S = 10.0
# Between two pieces of one hold: an airspeed that comes and goes about nothing.
UNHELD_S = 60.0
WITHOUT_LIFT = tuple(kind.name for kind in RESIDUALS if kind.name != "lift")
# Where an angle of zero lift that no calibration gives is from.
OUTSIDE, WHOLE, NOWHERE = "the flight outside the window", "the whole flight", "free in every window"
BEFORE, BESIDE = "the flight before the fault", "the flight before and after the fault"
ORIGINS = (OUTSIDE, WHOLE, BEFORE, BESIDE, NOWHERE)
# The inputs of the scan for steps and its tables: the surface, and what bounds the airspeed whatever the surface does.
INPUTS = ("elevator", "pitch", "longitudinal_acc")
# Faults that spoil the angle of zero lift where they last.
TELL_ZERO_LIFT = {"aoa", "normal_acc", *IMPACT_SOURCES}
# m/s^2 by which the mean rate of the airspeed may differ from that of the accelerometers: two degrees of attitude.
# Gravity that was taken out of the longitudinal acceleration is its sine of the pitch, as much in a climb.
MEAN_RATE = 0.35


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingFault:
    """A fault that was found and may last to the end of the log, where no return of its sensor was found.

    Attributes
    ----------
    faults : hypotheses of the parity scan.
    begun_s, from_s : the earliest and the latest that it began.
    until_s : the latest that it ended, infinite where it may last.
    """

    faults: tuple[str, ...]
    begun_s: float
    from_s: float
    until_s: float = np.inf

    def is_in(self, window: Window) -> bool:
        """Return whether it began before a window and may still last in it."""
        return self.from_s <= window[0] < self.until_s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """What every step of a diagnosis needs: the log, its seconds, its phases, and the tables of its thresholds.

    Attributes
    ----------
    phases : of the whole flight; disagreements : airspeeds that contradict them.
    counted : phases over whose windows the rate of false alarms is shared.
    from_s, to_s : the part that is diagnosed, s on the log's time; is_part : whether that is less than the log.
    zero_lift : angle of attack of zero lift, rad, and where it is from; None where it is free in every window.
    moved : stretches in which flaps are out, or where none are recorded may move.
    held : pressure lines that are held.
    unused : sentences on channels that are not what their names say, or do not follow the flight, and were left out.
    resting : sensors that are frozen.
    not_credible : channels that do not follow the flight; unusable : residuals that are not used.
    stepped : steps of an airspeed, a temperature probe, an altimeter or an accelerometer.
    series : the static relations through the log.
    defects : dropouts, spikes and readings that stay still; `log` has no values there.
    lasting : faults found so far, which later windows are not to find again.
    """

    log: FlightLog
    record: Record
    phases: Sequence[Phase]
    counted: Sequence[Phase]
    disagreements: Sequence[Disagreement]
    from_s: float
    to_s: float
    is_part: bool
    zero_lift: float | None
    zero_lift_from: str
    tables: Sequence[ParityTable]
    false_alarm: float
    moved: Sequence[Window]
    held: Holds
    tolerances: Mapping[str, float]
    unused: tuple[str, ...]
    series: Series
    resting: tuple[Finding, ...] = ()
    not_credible: tuple[Implausible, ...] = ()
    stepped: tuple[Finding, ...] = ()
    unusable: tuple[str, ...] = ()
    defects: tuple[Defect, ...] = ()
    lasting: tuple[LastingFault, ...] = ()
    # By channel, it and the airspeeds that its tolerance depends on, and by window that, after their first use.
    _alike: dict[str, FlightLog] = field(init=False, repr=False, default_factory=dict)
    _seen: dict[tuple[str, Window], float] = field(init=False, repr=False, default_factory=dict)

    @property
    def recorded(self) -> Collection[str]:
        return self.log.channels.keys()

    @property
    def stretches(self) -> list[Window]:
        """The flight between take-off and landing, within the part that is diagnosed."""
        return flight_stretches(self.part_phases)

    @property
    def held_stretches(self) -> list[Window]:
        """Stretches in which a pressure line is held, or leaks."""
        return held_stretches(self.held.findings)

    @property
    def part_phases(self) -> tuple[Phase, ...]:
        """Phases of the part that is diagnosed, cut to it."""
        return tuple(
            replace(phase, from_s=max(phase.from_s, self.from_s), to_s=min(phase.to_s, self.to_s))
            for phase in self.phases
            if phase.to_s > self.from_s and phase.from_s < self.to_s
        )

    def tolerance(self, channel: str, window: Window) -> float | None:
        """Return the largest error of a channel that may stay unseen in a window, None where it has none."""
        if channel in self.tolerances:
            return self.tolerances[channel]
        if channel not in self.log.channels:
            return None
        if (fixed := FIXED.get(quantity_of(channel))) is not None:
            return fixed
        if channel not in self._alike:
            names = {channel} if quantity_of(channel) in AIRSPEEDS else {channel, *AIRSPEEDS} & self.log.channels.keys()
            self._alike[channel] = replace(self.log, channels={name: self.log.channels[name] for name in names})
        if (channel, window) not in self._seen:
            alike = self._alike[channel]
            self._seen[channel, window] = tolerance_of(alike, alike.window(*window), channel)
        return self._seen[channel, window]

    def stretch_of(self, window: Window) -> Window:
        """Return the first of the stretches that a window lies in, itself where it lies in none."""
        return next((stretch for stretch in self.stretches if overlaps(window, [stretch])), window)

    def around(self, from_s: float, to_s: float, beside_s: float) -> Window:
        """Return a stretch with so many seconds on either side, as far as they are in the part that is diagnosed."""
        return max(from_s - beside_s, self.from_s), min(to_s + beside_s, self.to_s)

    def windows(self, length_s: float, step_s: float | None = None) -> list[Window]:
        """Return the windows of a length within the part that is diagnosed."""
        return windows_in(self.part_phases, length_s, step_s=step_s)

    def scan(self, window: Window) -> WindowScan | None:
        """Return the parity scan of a window, without the lift where flaps may move."""
        usable = WITHOUT_LIFT if overlaps(window, self.moved) else tuple(kind.name for kind in RESIDUALS)
        return scan_window(
            self.record.between(*window),
            zero_lift=self.zero_lift,
            only=tuple(name for name in usable if name not in self.unusable),
            lasting=self.lasting_in(window),
            whole=self.record,
        )

    def lasting_in(self, window: Window) -> tuple[str, ...]:
        """Return the faults known so far that began before a window and may last in it."""
        return tuple(dict.fromkeys(name for fault in self.lasting if fault.is_in(window) for name in fault.faults))

    def with_lasting(self, fault: LastingFault) -> Flight:
        """Return the flight in which a fault is known, its angle of zero lift from the time without it.

        A fault that was known already is the same but for its end.
        """
        others = tuple(
            other for other in self.lasting if (other.faults, other.begun_s) != (fault.faults, fault.begun_s)
        )
        flight = replace(self, lasting=(*others, fault))
        if self.zero_lift_from not in ORIGINS or not TELL_ZERO_LIFT & {*fault.faults}:
            return flight
        zero_lift, origin = _zero_lift(flight)
        return replace(flight, zero_lift=zero_lift, zero_lift_from=origin)


def flight_of(log: FlightLog, config: Config) -> Flight:
    """Return the flight of a log, ready for every analysis.

    Raises
    ------
    LogError : the log has no part in flight, or no airspeed.
    ConfigError : the calibration cannot be used, or a tolerance is of a channel that the log does not have.
    """
    frozen, log = _without_frozen(log)
    log = with_seen_recorder(log)
    defects = find_defects(log)
    whole, log = with_bridges(log, defects), without_defects(log, defects)
    start_s, stop_s = log.span_s
    from_s = start_s if config.window.from_s is None else config.window.from_s
    to_s = stop_s if config.window.to_s is None else config.window.to_s
    log.window(from_s, to_s)  # refuses one without samples
    _check_channels(log, config)
    _check_causes(log, config.diagnose)
    phases, disagreements = find_phases(whole)
    if not spans_of(phases, AIRBORNE):
        raise LogError(
            f"{log.path}: no part of the log is in flight between take-off and landing; give a log of a flight, or "
            "map its airspeed with --channel"
        )
    recorded = lru_cache(maxsize=1)(record_of)  # most logs lose no channel below
    resting = frozen_sensors(log, recorded(log), phases)
    log = without_frozen(log, resting)
    # What one airspeed says against all others is no sign of a pressure line.
    overruled = {disagreement.channel for disagreement in disagreements if disagreement.alone}
    held = find_holds(without(log, *overruled), start_s, stop_s, phases=phases)
    held = replace(held, findings=_doubted_in_stalls(_until_free(held.findings, phases, stop_s), phases))
    coarse = coarse_positions(log)
    if coarse:
        log = without(log, "latitude", "longitude")
    log, unlike = without_other_conventions(log, phases, recorded)
    credible = credibility_of(recorded(log), phases, without=held_stretches(held.findings))
    if credible.findings:
        log = without(log, *credible.unused)
    record = recorded(log)
    calibration = None if config.diagnose.calibration is None else load_air_data(config.diagnose.calibration)
    flight = Flight(
        log=log,
        record=record,
        phases=phases,
        counted=phases,
        disagreements=disagreements,
        from_s=from_s,
        to_s=to_s,
        is_part=(from_s, to_s) != (start_s, stop_s),
        zero_lift=None if calibration is None else calibration.zero_lift_rad,
        zero_lift_from=str(config.diagnose.calibration),
        tables=shipped_tables() if calibration is None else (*calibration.tables, *shipped_tables()),
        false_alarm=config.diagnose.false_alarm,
        moved=configuration_changes(phases, record),
        held=held,
        tolerances=config.tolerances,
        unused=(*frozen, *([coarse] if coarse else ()), *unlike, *credible.sentences),
        resting=resting,
        not_credible=credible.findings,
        series=relation_series(log, phases),
        stepped=sensor_steps(log, record, phases, without=held_stretches(held.findings)),
        unusable=credible.unusable,
        defects=defects,
    )
    if flight.zero_lift is None:
        zero_lift, origin = _zero_lift(flight)
        flight = replace(flight, zero_lift=zero_lift, zero_lift_from=origin)
    return flight


def held_stretches(held: Sequence[Finding]) -> list[Window]:
    """Return the stretches in which a pressure line is held, or leaks."""
    return [(finding.onset_ci95[0] - BRIDGE_S, finding.until_s + BRIDGE_S) for finding in held]


def _check_causes(log: FlightLog, config: Diagnose) -> None:
    """Refuse causes that no flight has, times without samples, and causes that nothing would be weighed against.

    Raises
    ------
    ConfigError : a cause is not in `ORDINARY`, or the judge is off.
    LogError : a time is not in the log.
    """
    for k, known in enumerate(config.events):
        place = f"diagnose.events[{k}]"
        if known.cause not in ORDINARY:
            what = f"not an ordinary cause, got {shown(known.cause)}{did_you_mean(known.cause, list(ORDINARY))}"
            raise ConfigError(f"{place}.cause: {what}")
        if not config.judge:
            raise ConfigError(f"{place}: nothing is weighed without the judge; leave out --no-judge or the event")
        check_within(log, Occurrence(cause=known.cause, at_s=known.at_s))


def _check_channels(log: FlightLog, config: Config) -> None:
    has = ", ".join(sorted(log.channels))
    if not {"tas", *IMPACT_SOURCES} & set(map(quantity_of, log.channels)):
        raise LogError(
            f"{log.path}: no airspeed and no impact pressure that changes; the log has: {has}; map one with --channel"
        )
    for name in config.tolerances:
        if name not in log.channels:
            raise ConfigError(f"--tolerance: '{name}' is no channel, the log has: {has}; leave it out")


def _zero_lift(flight: Flight) -> tuple[float | None, str]:
    """Return the angle of zero lift, rad, and what it was taken from: outside of the window where that tells it.

    Stretches in which a pressure line is held, and what follows a fault that may last, are left out.
    """
    without = flight.held_stretches
    spoilt: list[Window] = [
        (fault.begun_s, fault.until_s) for fault in flight.lasting if TELL_ZERO_LIFT & {*fault.faults}
    ]
    without += spoilt
    outside = (OUTSIDE, [*without, (flight.from_s, flight.to_s)])
    lasts = any(end_s == np.inf for _, end_s in spoilt)
    rest = WHOLE if not spoilt else BEFORE if lasts else BESIDE
    for origin, left_out in (*([outside] if flight.is_part else []), (rest, without)):
        angle = zero_lift_of(flight.record, flight.phases, without=left_out)
        if angle is not None:
            return angle, origin
    return None, NOWHERE


def _without_frozen(log: FlightLog) -> tuple[list[str], FlightLog]:
    """Return the log without the channels that hold one value although they are looked at, and a sentence on each."""
    sentences = {}
    for name in (name for name in (*USED, *INPUTS) if name in log.channels):
        values = log.channels[name].values
        known = np.isfinite(values)
        known = values if known.all() else values[known]
        if not known.size or known.min() == known.max():
            held = "holds one value" if known.size else "holds no number"
            sentences[name] = f"'{name}' is not used: it {held} through the whole log"
    return list(sentences.values()), without(log, *sentences)


def _until_free(holds: Sequence[Finding], phases: Sequence[Phase], stop_s: float) -> tuple[Finding, ...]:
    """Return the holds with those joined between which the airspeed reads nothing.

    A total pressure that is trapped below the static one leaves no airspeed: that is no end of the hold.
    """
    lost = spans_of(phases, (NO_AIRSPEED,))
    last: dict[str, Finding] = {}
    ended: list[Finding] = []
    for finding in sorted(holds, key=lambda finding: finding.onset_s):
        earlier, hold = last.get(finding.fault), finding
        if earlier is not None and _reaches(earlier, finding.onset_s):
            hold = replace(earlier, offset_s=None if earlier.offset_s is None else finding.offset_s)
        elif earlier is not None:
            ended.append(earlier)
        for first, end in lost if finding.fault == "pitot_blocked" else ():
            if hold.offset_s is not None and hold.offset_s < end and _reaches(hold, first):
                hold = replace(hold, offset_s=end if end < stop_s - BRIDGE_S else None)
        last[finding.fault] = hold
    return tuple(sorted((*ended, *last.values()), key=lambda finding: finding.onset_s))


def _doubted_in_stalls(findings: Sequence[Finding], phases: Sequence[Phase]) -> tuple[Finding, ...]:
    """Return the findings, those of a leak that ends with a stall doubted: the aircraft loses its airspeed then."""
    stalls = spans_of(phases, ("stall",))
    return tuple(
        replace(finding, doubt=finding.doubt or STALLS)
        if finding.fault.endswith("_leak")
        and finding.offset_s is not None
        and any(from_s <= finding.offset_s <= to_s + BRIDGE_S for from_s, to_s in stalls)
        else finding
        for finding in findings
    )


def _reaches(hold: Finding, time_s: float) -> bool:
    return hold.offset_s is None or hold.offset_s >= time_s - UNHELD_S


def without_other_conventions(
    log: FlightLog, phases: Sequence[Phase], recorded: Callable[[FlightLog], Record] = record_of
) -> tuple[FlightLog, tuple[str, ...]]:
    """Return the log without channels whose median or mean over the flight no aircraft has, and a sentence on each."""
    sentences = []
    flown = within(log.time_s, flight_stretches(phases))
    for name, channel in log.channels.items():
        if name in IN_FLIGHT and channel.unit in (STANDARD[name].unit, ""):
            middle = impossible_median(name, channel.values[flown])
            if middle is not None:
                sentences.append(sentence_of_impossible(name, middle))
                log = without(log, name)
    record = recorded(log)
    if record.gained is not None and "tas" in record.channels:
        off = _mean_rate(record, phases)
        if abs(off) > MEAN_RATE:
            sentences.append(
                f"'longitudinal_acc' is not used: with the attitude it gives {off:.2g} m/s^2 more than the airspeed "
                "gains in the mean over the flight; it should be the specific force along body x, forward"
            )
            log = without(log, "longitudinal_acc")
    return log, tuple(sentences)


def without(log: FlightLog, *names: str) -> FlightLog:
    """Return a log without some of its channels."""
    left = {name: channel for name, channel in log.channels.items() if name not in names}
    return log if len(left) == len(log.channels) else replace(log, channels=left)


def _mean_rate(record: Record, phases: Sequence[Phase]) -> float:
    """Return by how much the accelerometers' mean rate of the airspeed exceeds the airspeed's, m/s^2."""
    gained, seconds = 0.0, 0.0
    for first, last in flight_stretches(phases):
        part = record.between(first, last)
        assert part.gained is not None
        excess = part.gained - part.channels["tas"]
        left = np.flatnonzero(np.isfinite(excess))
        if left.size > 1:
            gained += float(excess[left[-1]] - excess[left[0]])
            seconds += float(part.time_s[left[-1]] - part.time_s[left[0]])
    return gained / seconds if seconds > 0.0 else 0.0
