"""The flight of a log, ready for every analysis: its channels, phases, windows and angle of zero lift."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..airdata import IMPACT_SOURCES
from ..config import Config
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog
from ..flightlog.phases import Phase, phases_of
from ..flightlog.record import frozen_array
from ..flightlog.recorder import with_seen_recorder
from ..parity import (
    LENGTHS_S,
    Finding,
    ParityTable,
    Record,
    configuration_changes,
    record_of,
    shipped_tables,
    windows_in,
    zero_lift_of,
)
from ..parity.calibration import load_air_data
from ..parity.holds import Holds, find_holds
from ..parity.record import USED
from ..parity.windows import Window, clean_up_time, flight_stretches
from .conventions import without_other_conventions
from .glances import INPUTS

__all__ = ["Flight", "flight_of"]

FloatArray = NDArray[np.float64]

# Beside a held line, where the filters of the recorder and the leak itself still act.
BRIDGE_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """What every step of a diagnosis needs: the log, its seconds, its phases, and how its windows are judged.

    Attributes
    ----------
    phases : of the part that is diagnosed; whole : of the whole flight, where only a part is.
    from_s, to_s : that part, s on the log's time.
    zero_lift : angle of attack of zero lift, rad, and where it is from; None where it is free in every window.
    moved : stretches in which flaps and gear may move.
    unused : sentences on channels that are not what their names say, and were left out.
    """

    log: FlightLog
    record: Record
    phases: tuple[Phase, ...]
    whole: Sequence[Phase] | None
    from_s: float
    to_s: float
    zero_lift: float | None
    zero_lift_from: str
    tables: Sequence[ParityTable]
    false_alarm: float
    moved: Sequence[Window]
    held: Holds
    tolerances: Mapping[str, float]
    unused: tuple[str, ...]

    @property
    def recorded(self) -> Collection[str]:
        return self.log.channels.keys()

    @property
    def without_lift(self) -> Sequence[Window]:
        """Stretches in which flaps may move and none are recorded."""
        return () if "flaps" in self.recorded else self.moved

    @property
    def stretches(self) -> list[Window]:
        """What of the part that is diagnosed is flown, without take-off, approach, landing and parabolas."""
        cut = [(max(first, self.from_s), min(last, self.to_s)) for first, last in flight_stretches(self.phases)]
        return [(first, last) for first, last in cut if last > first]

    def windows(self, lengths: Sequence[float] = LENGTHS_S, step_s: float | None = None) -> dict[float, list[Window]]:
        """Return the windows of every length within the part that is diagnosed."""
        cut = [replace(one, from_s=max(one.from_s, self.from_s), to_s=min(one.to_s, self.to_s)) for one in self.phases]
        return {length_s: windows_in(cut, length_s, step_s=step_s) for length_s in lengths}


def flight_of(log: FlightLog, config: Config) -> Flight:
    """Return the flight of a log, ready for every analysis.

    Raises
    ------
    LogError : the log has no part in flight, or no airspeed.
    ConfigError : the calibration cannot be used, or a tolerance is of a channel that the log does not have.
    """
    frozen, log = _without_frozen(log)
    log = with_seen_recorder(log)
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1]) + 1.0 / log.rate_hz
    from_s = start_s if config.window.from_s is None else config.window.from_s
    to_s = stop_s if config.window.to_s is None else config.window.to_s
    log.window(from_s, to_s)  # refuses one without samples
    _check_channels(log, config)
    held = find_holds(log, start_s, stop_s)
    phases = phases_of(_bridged(log, held.findings))
    if not flight_stretches(phases):
        raise LogError(
            f"{log.path}: no part of the log is in flight between take-off and approach; give a log of a flight, or "
            "map its airspeed with --channel"
        )
    log, unlike = without_other_conventions(log, phases)
    record = record_of(log)
    own = None if config.diagnose.calibration is None else load_air_data(config.diagnose.calibration)
    tables: Sequence[ParityTable] = shipped_tables() if own is None else (*own.tables, *shipped_tables())
    outside: list[Window] = [] if (from_s, to_s) == (start_s, stop_s) else [(from_s, to_s)]
    zero_lift, origin = None if own is None else own.zero_lift_rad, str(config.diagnose.calibration)
    if zero_lift is None:
        trapped = [
            (one.onset_ci95[0] - BRIDGE_S, stop_s if one.offset_s is None else one.offset_s + BRIDGE_S)
            for one in held.findings
        ]
        zero_lift, origin = _zero_lift(record, phases, outside=outside, trapped=trapped)
    return Flight(
        log=log,
        record=record,
        phases=tuple(one for one in phases if one.to_s > from_s and one.from_s < to_s),
        whole=phases if outside else None,
        from_s=from_s,
        to_s=to_s,
        zero_lift=zero_lift,
        zero_lift_from=origin,
        tables=tables,
        false_alarm=config.diagnose.false_alarm,
        moved=configuration_changes(phases, clean_up_s=clean_up_time(phases, record)),
        held=held,
        tolerances=config.tolerances,
        unused=(*frozen, *unlike),
    )


def _check_channels(log: FlightLog, config: Config) -> None:
    has = ", ".join(sorted(log.channels))
    if not {"tas", *IMPACT_SOURCES} & log.channels.keys():
        raise LogError(
            f"{log.path}: no airspeed and no impact pressure that changes; the log has: {has}; map one with --channel"
        )
    for name in config.tolerances:
        if name not in log.channels:
            raise ConfigError(f"--tolerance: '{name}' is no channel, the log has: {has}; leave it out")


def _zero_lift(
    record: Record, phases: Sequence[Phase], *, outside: Sequence[Window], trapped: Sequence[Window]
) -> tuple[float | None, str]:
    """Return the angle of zero lift, rad, and what it was taken from: outside of the window where that tells it.

    Parameters
    ----------
    outside : the window, where a part of the flight is diagnosed; trapped : where a pressure line is held.
    """
    attempts = [("the whole flight", trapped)]
    if outside:
        attempts.insert(0, ("the flight outside the window", [*outside, *trapped]))
    for origin, without in attempts:
        angle = zero_lift_of(record, phases, without=without)
        if angle is not None:
            return angle, origin
    return None, "free in every window"


def _without_frozen(log: FlightLog) -> tuple[list[str], FlightLog]:
    """Return the log without the channels that hold one value although they are looked at, and a sentence on each."""
    frozen = [name for name in (*USED, *INPUTS) if name in log.channels and _never_moves(log.channels[name].values)]
    frozen = list(dict.fromkeys(frozen))
    said = []
    for name in frozen:
        held = "holds one value" if np.isfinite(log.channels[name].values).any() else "holds no number"
        said.append(f"'{name}' {held} through the whole log: it was not used")
    return said, replace(log, channels={name: one for name, one in log.channels.items() if name not in frozen})


def _never_moves(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    return known.size == 0 or float(known.min()) == float(known.max())


def _bridged(log: FlightLog, held: Sequence[Finding]) -> FlightLog:
    """Return the log with straight lines where a pressure line is held, which can make a flight look like a landing."""
    channels = dict(log.channels)
    for one in held:
        until_s = float(log.time_s[-1]) if one.offset_s is None else one.offset_s
        hidden = (log.time_s >= one.onset_ci95[0] - BRIDGE_S) & (log.time_s <= until_s + BRIDGE_S)
        for name in {*one.channels} & channels.keys():
            values = channels[name].values
            known = ~hidden & np.isfinite(values)
            if known.any():
                filled = np.where(hidden, np.interp(log.time_s, log.time_s[known], values[known]), values)
                channels[name] = replace(channels[name], values=frozen_array(filled))
    return replace(log, channels=channels)
