"""A log before it is analysed, as `bfi info` shows it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..faults.filters import Filter
from ..kernels.quantisation import repeat_fraction
from ..notes import Note
from ..quantities.channels import INPUTS, STANDARD, quantity_of
from ..quantities.text import quantity
from .derived import DERIVED, missing_for, pressures_of
from .excitation import Excitation, ExcitedWindow, excitation_of, ranked_windows, samples_in_flight
from .phases import Phase, note_on_rotors, phases_of
from .plausible import doubt_about
from .quality import gap_starts, held_hz, is_uniform, time_jitter
from .record import Channel, FlightLog, Segment

ODD = 3.0  # a sensor is named as the odd one of three at so many times the distance between the other two


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelReport:
    """One channel.

    Attributes
    ----------
    n_nan : samples that are NaN or infinite.
    held_fraction : fraction of samples that repeat the one before, 0 where the channel is not held.
    hold_period_s : time between two values of a held channel, None where it is not held.
    quantum : quantisation step in `unit`, None where there is none.
    min, max : over the finite samples, None where there are none.
    own_rate_hz : rate of the signal in the file, None where it is that of the log.
    pressures : the air-data pressures that the channel follows from: a fault of their lines shows in it.
    """

    name: str
    unit: str
    source: str
    own_rate_hz: float | None
    n_nan: int
    held_fraction: float
    hold_period_s: float | None
    quantum: float | None
    min: float | None
    max: float | None
    pressures: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DerivableChannel:
    """A channel that follows from others; `lacks` are those of them that the log lacks, alternatives joined by "or"."""

    name: str
    unit: str
    description: str
    lacks: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogReport:
    """A log as `bfi info` shows it.

    Attributes
    ----------
    jitter : largest deviation of a time step from the median, relative to it, gaps left out.
    gaps : (start_s, stop_s), the last sample before and the first after each gap.
    phases : of the flight, none where the log has no airspeed.
    clock : the moment from which the times count, see `Epoch.iso`; None for a log without a clock.
    filters : the low-pass filters that the log went through, None where nothing is known of them.
    """

    path: str
    n_samples: int
    start_s: float
    stop_s: float
    rate_hz: float
    uniform: bool
    jitter: float
    gaps: tuple[tuple[float, float], ...]
    channels: tuple[ChannelReport, ...]
    derived: tuple[DerivableChannel, ...]
    excitation: tuple[Excitation, ...]
    windows: tuple[ExcitedWindow, ...]
    phases: tuple[Phase, ...]
    segments: tuple[Segment, ...]
    filters: tuple[Filter, ...] | None
    notes: tuple[Note, ...]
    clock: str | None = None


def inspect_log(log: FlightLog) -> LogReport:
    """Return the report on a log before it is analysed."""
    channels, questions, phases = [], [], phases_of(log)
    flying = samples_in_flight(log, phases)
    for channel in log.channels.values():
        values = channel.values  # of a large file read here, once
        is_finite = np.isfinite(values)
        finite = values if is_finite.all() else values[is_finite]
        held = held_hz(log, channel)
        report = ChannelReport(
            name=channel.name,
            unit=channel.unit,
            source=channel.source,
            own_rate_hz=None if channel.own_rate_hz is None else float(f"{channel.own_rate_hz:.6g}"),
            n_nan=values.size - finite.size,
            held_fraction=0.0 if held is None else repeat_fraction(finite),
            hold_period_s=None if held is None else 1.0 / held,
            quantum=channel.step,
            min=float(finite.min()) if finite.size else None,
            max=float(finite.max()) if finite.size else None,
            pressures=pressures_of(log, channel.name),
        )
        channels.append(report)
        questions.append(doubt_about(channel))
    derived = (
        DerivableChannel(
            name=name,
            unit=STANDARD[name].unit,
            description=STANDARD[name].description,
            lacks=missing_for(name, log.channels),
        )
        for name in DERIVED
        if name not in log.channels
    )
    start_s, stop_s = log.ends()
    return LogReport(
        path=log.path,
        n_samples=log.n_samples,
        start_s=start_s,
        stop_s=stop_s,
        rate_hz=float(f"{log.rate_hz:.9g}"),
        uniform=is_uniform(log.time_s),
        jitter=time_jitter(log.time_s),
        gaps=tuple((float(log.time_s[k]), float(log.time_s[k + 1])) for k in gap_starts(log.time_s)),
        channels=tuple(channels),
        derived=tuple(derived),
        excitation=tuple(excitation_of(log, name, flying) for name in INPUTS if name in log.channels),
        windows=ranked_windows(log, phases),
        phases=phases,
        segments=log.segments,
        filters=log.filters,
        clock=None if log.epoch is None else log.epoch.iso,
        notes=(*log.notes, *note_on_rotors(phases), *_sensors_of_one_quantity(log), *filter(None, questions)),
    )


def _sensors_of_one_quantity(log: FlightLog) -> Iterator[Note]:
    """Yield notes on the differences between sensors of one quantity, and on the odd sensor of three."""
    sensors: dict[str, list[Channel]] = {}
    for name, channel in log.channels.items():
        sensors.setdefault(quantity_of(name), []).append(channel)
    for first, *others in sensors.values():
        for other in others:
            apart = other.values - first.values
            known = apart[np.isfinite(apart)]
            if known.size:
                median, unit = float(np.median(known)), "" if first.unit == "1" else first.unit
                most = float(np.quantile(np.abs(known - median), 0.95))
                yield Note.method(
                    f"{first.name} and {other.name} are two sensors of one quantity: the second reads "
                    f"{quantity(abs(median), unit)} {'less' if median < 0.0 else 'more'} in the median, "
                    f"within {quantity(most, unit)} of that for 95 % of the samples"
                )
    for several in sensors.values():
        if len(several) < 3:
            continue
        between = {}
        for pair in combinations(several, 2):
            size = np.abs(pair[0].values - pair[1].values)
            between[pair] = float(np.quantile(size[np.isfinite(size)], 0.95)) if np.isfinite(size).any() else np.nan
        for odd in several:
            nearest = min(size for pair, size in between.items() if odd in pair)
            rest = max(size for pair, size in between.items() if odd not in pair)
            if nearest > ODD * rest:
                *before, last = [sensor.name for sensor in several if sensor is not odd]
                unit = "" if odd.unit == "1" else odd.unit
                yield Note.method(
                    f"{odd.name} agrees with neither {', '.join(before)} nor {last}: it is up to "
                    f"{quantity(nearest, unit)} from the nearest, these up to {quantity(rest, unit)} from each other "
                    "in 95 % of the samples"
                )
