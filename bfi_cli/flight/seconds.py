"""What the flight model measures: the channels of a log once a second, with the rounding of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..airdata import AirData, channels_of, static_temperature
from ..flightlog import FlightLog
from ..kernels import MAD, BoolArray, FloatArray
from ..kernels.runs import bridged, mean_of_stretches
from .parity.record import Record, over_seconds, record_of, roundings_of, seconds_of_samples

GROUND_VELOCITY = frozenset(("velocity_north", "velocity_east"))
ANGLES = ("yaw", "track")  # that jump by a turn
BESIDE = ("gps_altitude", "baro_setting", "ground_speed")  # channels that no residual of a record needs
# Mach numbers beyond which a temperature that is computed from a total one would divide by little.
LEAST_MACH, MOST_MACH = 0.0, 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seconds:
    """A log once a second.

    Attributes
    ----------
    record : the channels that air data are made of.
    channels : (n,) by standard name, those of the record and beside them headings, geometric height and setting.
    rounding : by name (n,) the standard deviation that the steps of a channel leave in the mean of a second.
    recorded : the names of the log.
    """

    record: Record
    channels: Mapping[str, FloatArray]
    rounding: Mapping[str, FloatArray]
    recorded: frozenset[str]

    @property
    def time_s(self) -> FloatArray:
        """(n,) middles of the seconds."""
        return self.record.time_s

    @property
    def air(self) -> AirData:
        """Pressures and temperature, (n,) each."""
        return self.record.air

    def taken(self, rows: slice) -> Seconds:
        """Return some of the seconds."""
        record = self.record.taken(rows)
        channels, rounding = (
            {name: values[rows] for name, values in of.items()} for of in (self.channels, self.rounding)
        )
        return replace(self, record=record, channels=channels, rounding=rounding)

    def with_channels(self, channels: Mapping[str, FloatArray]) -> Seconds:
        """Return the seconds with other values of some channels."""
        changed = {name: values for name, values in channels.items() if name in self.channels}
        inside = {name: values for name, values in changed.items() if name in self.record.channels}
        record = replace(self.record, channels={**self.record.channels, **inside})
        return replace(self, record=record, channels={**self.channels, **changed})


def seconds_of(log: FlightLog) -> Seconds | None:
    """Return a log once a second; None where it has no airspeed or no static pressure."""
    record = record_of(log)
    channels = dict(record.channels)
    if "altitude_rate" not in log.channels:
        channels.pop("altitude_rate", None)  # computed from the altitude, it measures nothing beside it
    seconds, n = seconds_of_samples(log)
    expected = log.rate_hz
    for name in ANGLES:
        if name in log.channels:
            values = log.channels[name].values
            cosine, sine = (over_seconds(part, seconds, n, expected) for part in (np.cos(values), np.sin(values)))
            channels[name] = np.arctan2(sine, cosine)
    for name in BESIDE:
        if name in log.channels:
            channels[name] = over_seconds(log.channels[name].values, seconds, n, expected)
    if not channels.keys() >= GROUND_VELOCITY:  # one component alone is no velocity
        channels = {name: values for name, values in channels.items() if name not in GROUND_VELOCITY}
    else:
        channels.pop("ground_speed", None)  # the size of what is weighed
    if "tas" not in channels or not {"altitude", "p_static"} & channels.keys():
        return None
    others = [name for name in channels if name in log.channels and name not in record.channels]
    roundings = {**record.rounding, **roundings_of(log, others, seconds, n)}
    rounding = {name: each.sd for name, each in roundings.items()}
    return Seconds(record=record, channels=channels, rounding=rounding, recorded=frozenset(log.channels))


def filled(values: FloatArray, otherwise: float = 0.0) -> FloatArray:
    """Return values with straight lines over what is missing."""
    return bridged(values) if np.isfinite(values).any() else np.full(values.shape, otherwise)


def smoothed(values: FloatArray, width: int) -> FloatArray:
    """Return (n,) means over `width` samples about each, an odd number."""
    return mean_of_stretches(np.pad(values, width // 2, mode="edge"), width)


def rate_of(values: FloatArray, width: int = 3) -> FloatArray:
    """Return the rate of change per second of values without gaps, of means over `width` samples."""
    return np.gradient(smoothed(values, width)) if values.size > 1 else np.zeros(values.shape)


def spread(values: FloatArray, where: BoolArray) -> float:
    """Return the standard deviation of Gaussian values by their median distance from the median."""
    part = values[where & np.isfinite(values)]
    return MAD * float(np.median(np.abs(part - np.median(part)))) if part.size else 0.0


def temperature_of(seconds: Seconds) -> FloatArray | None:
    """Return the static air temperature, K, recorded or from the total one; None where the log has neither."""
    channels = seconds.channels
    if "sat" in channels:
        return channels["sat"]
    if "tat" not in channels:
        return None
    air = seconds.air
    made = channels_of(air.p_static, air.q_impact, air.tat)
    mach = np.clip(np.nan_to_num(made["mach"]), LEAST_MACH, MOST_MACH)
    known = np.where(channels["tat"] > 0.0, channels["tat"], np.nan)
    return static_temperature(known, mach)
