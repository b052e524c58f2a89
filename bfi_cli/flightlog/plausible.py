"""Values that no aircraft reaches, mostly for a wrong unit: the user is asked, the log is not refused.

The convention of a normal acceleration is read from its median in level flight. Recorders write a load factor, that
less one, or a specific force along body z, upward or downward, in g or m/s^2. On the ground as in level flight a load
factor is 1, so that the median tells which of these it is; where few samples are level, in aerobatics or circling, the
attitude says which they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..airdata import G
from ..notes import Note
from ..quantities.channels import STANDARD
from .record import LARGEST_VALUE, Channel, FlightLog, FloatArray, StoredChannel, frozen_array

NORMAL = "normal_acc"
ACCELERATIONS = ("longitudinal_acc", "lateral_acc", NORMAL)
# rad, of pitch and roll: the lift differs by 6 % at most from that of level flight, a tenth of what the decision bears.
LEVEL = 0.35
# Share of the samples that have to be level, and their number, for them to be looked at alone; else the median of all
# decides. Not tuned: in a turn held throughout or with an attitude in a wrong unit there are none.
LEAST_SHARE, FEWEST = 0.02, 20
# Median of a load factor in level flight, with the error of a sensor and of LEVEL.
ONE = (0.8, 1.25)
# BLOCKS, BLOCK: blocks read of a stored channel, evenly over the log, and samples of each.
BLOCKS, BLOCK = 100, 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Convention:
    """How accelerations are recorded: factor * recorded + offset is m/s^2, of `normal_acc` upward without gravity.

    Attributes
    ----------
    median : of the normal acceleration in level flight, as it is recorded.
    unit : in which it is recorded where none is stated, or a ratio: "g"; else "".
    """

    factor: float
    offset: float
    median: float
    unit: str

    def change(self, values: FloatArray) -> FloatArray:
        """Return recorded values of the normal acceleration as upward ones without gravity, m/s^2, read-only."""
        return frozen_array(self.factor * values + self.offset)


def convention_of(channels: Mapping[str, Channel]) -> Convention | None:
    """Return how the normal acceleration of a log is recorded; None without one, or of one without numbers.

    A median nearer to a weight, upward or downward, than to none has gravity in it. One of about 1 without a unit is in
    g, and so is a ratio.
    """
    if NORMAL not in channels:
        return None
    channel = channels[NORMAL]
    load, *attitude = (
        _looked_at(channels[name], channel.n_samples)
        for name in (NORMAL, "pitch", "roll")
        if name in channels and channels[name].n_samples == channel.n_samples
    )
    known = np.isfinite(load) & (np.abs(load) < LARGEST_VALUE)
    level = known & np.all([np.abs(angle) <= LEVEL for angle in attitude], axis=0) if attitude else known
    if np.count_nonzero(level) < max(FEWEST, LEAST_SHARE * np.count_nonzero(known)):
        level = known
    if not level.any():
        return None
    median = float(np.median(load[level]))
    in_g = channel.unit == "1" or (channel.source_unit is None and ONE[0] <= abs(median) <= ONE[1])
    scale = G if in_g else 1.0
    weights = float(np.sign(median)) if abs(scale * median) > 0.5 * G else 0.0
    # Without gravity in it an acceleration is upward; with it, the weight says which way it counts.
    return Convention(
        factor=scale * (weights or 1.0), offset=-G * abs(weights), median=median, unit="g" if in_g else ""
    )


def with_conventions(channels: Mapping[str, Channel]) -> tuple[dict[str, Channel], Convention | None, tuple[Note, ...]]:
    """Return the channels of a log with the normal acceleration upward without gravity, its convention, and notes.

    Other accelerations without a unit are in that of the normal acceleration, in which one recorder writes all.
    """
    made, convention = dict(channels), convention_of(channels)
    if convention is None:
        return made, None, ()
    for name in ("longitudinal_acc", "lateral_acc"):
        if convention.unit and name in made and made[name].unit in ("", "1"):
            made[name] = _changed(made[name], replace(convention, factor=G, offset=0.0))
    if (convention.factor, convention.offset) == (1.0, 0.0):
        return made, convention, ()
    made[NORMAL] = _changed(channels[NORMAL], convention)
    return made, convention, (Note.method(f"'{channels[NORMAL].source}' {sentence_of(convention)}"),)


def sentence_of(convention: Convention) -> str:
    """Return in words how a normal acceleration is recorded, and what was made of it."""
    median = f"its median in level flight is {convention.median:.3g} {convention.unit or 'm/s^2'}"
    if not convention.offset:
        return f"has no weight in it: {median}"
    upward = convention.factor > 0.0
    return (
        f"has the weight in it, {'upward' if upward else 'downward'}: {median}; {NORMAL} is it "
        f"{'' if upward else 'turned upward, '}less gravity"
    )


def _looked_at(channel: Channel, n_samples: int) -> FloatArray:
    """Return the values of a channel, of one in a file those of blocks of rows."""
    if not isinstance(channel, StoredChannel) or n_samples <= BLOCKS * BLOCK:
        return channel.values
    starts = np.linspace(0, n_samples - BLOCK, BLOCKS).astype(int)
    return np.concatenate([channel.between(slice(int(k), int(k) + BLOCK)) for k in starts])


def _changed(channel: Channel, convention: Convention) -> Channel:
    unit = convention.unit or channel.source_unit
    if not isinstance(channel, StoredChannel):
        step = channel.own_step
        ends = None if step is None else convention.change(np.array([0.0, step]))
        return replace(
            channel,
            values=convention.change(channel.values),
            unit="m/s^2",
            source_unit=unit,
            own_step=None if ends is None else abs(float(ends[1] - ends[0])),
        )
    return StoredChannel(
        name=channel.name,
        unit="m/s^2",
        source=channel.source,
        source_unit=unit,
        own_rate_hz=channel.own_rate_hz,
        read=lambda rows: convention.change(channel.between(rows)),
        rows=slice(0, channel.n_samples),
    )


SURFACES = ("elevator", "aileron", "rudder", "stabiliser", "elevator_trim", "flaps")
# Largest value of an aircraft, in the unit of `channels.STANDARD`, and the unit that larger values probably have.
# Surfaces stop at half a radian, fully extended flaps at 0.8 rad; the fastest jets reach 700 m/s, those with the
# recorders that are read here no 400; no wing flies at 1 rad, and a pitch attitude ends at pi / 2 by definition.
LIMITS = {
    **dict.fromkeys(SURFACES, (1.0, "deg")),
    **dict.fromkeys(("tas", "cas", "ias", "ground_speed"), (400.0, "km/h or kt")),
    **dict.fromkeys(("aoa", "sideslip", "flight_path_angle"), (1.0, "deg")),
    **dict.fromkeys(("pitch", "latitude"), (1.6, "deg")),
    **dict.fromkeys(("roll", "yaw", "longitude"), (6.3, "deg")),
    **dict.fromkeys(("pitch_rate", "roll_rate", "yaw_rate"), (10.0, "deg/s")),
    **dict.fromkeys(("tat", "sat"), (400.0, "degF")),
    "p_static": (110_000.0, "another unit"),
    "altitude": (30_000.0, "ft"),
}
# A temperature of the air below it is not in kelvin.
COLDEST_K = 150.0
# By channel, in the unit of `channels.STANDARD`, between which the median over a flight lies. A wing flies between the
# angle of zero lift of the most cambered sections, -8 degrees, and that of a stall, 20 (Abbott and von Doenhoff, Theory
# of Wing Sections, 1959, app. IV), and a vane is mounted within 10 degrees; a rudder holds no more than 20 degrees of
# sideslip; no flight climbs at 45 degrees or turns at 75 degrees of bank (3.9 g) for half of its time; a gyro is biased
# by 20 degrees/s at most where a circle takes 18 s; air has between 150 and 400 K.
IN_FLIGHT = {
    "aoa": (-0.32, 0.53),
    "sideslip": (-0.53, 0.53),
    "pitch": (-0.79, 0.79),
    "flight_path_angle": (-0.79, 0.79),
    "roll": (-1.31, 1.31),
    **dict.fromkeys(("pitch_rate", "roll_rate", "yaw_rate"), (-0.7, 0.7)),
    **dict.fromkeys(("tat", "sat"), (COLDEST_K, 400.0)),
}
PARTS = 8  # of a flight, as those in which a relation fails throughout (`bfi_cli.flight.plausibility.misfits.PIECES`)
# What a channel may be that is called an angle of attack.
RATHER = {"aoa": "an index of the lift or of the margin to the stall", "sideslip": "a slip-skid ball"}
# Channels and their rates, which tell the length of a second of the time axis. In three recorded flights altitude and
# roll have correlations of 0.93 to 0.999 with the integrals of their rates, and ratios of 0.91 to 1.1, over one of
# these numbers of samples; the pitch, which turns change, 0.45 to 0.78.
WITH_RATES = (("altitude", "altitude_rate"), ("roll", "roll_rate"))
STRIDES, LEAST_CORRELATION, LOOKED_AT = (1, 10, 100), 0.9, 500_000
# Ratios of two channels that differ by more than the first factor contradict each other; a ratio within the second
# factor of 1 is no error of the unit of time.
ALIKE, RIGHT = 1.15, 1.5
# Quantile that is compared with the limits, so that single spikes do not count.
USUAL = 0.99


def doubts_about(log: FlightLog, names: Sequence[str]) -> tuple[Note, ...]:
    """Return a question about each channel with values beyond the limits, and one about units that are not stated.

    Parameters
    ----------
    names : standard names, or names in the file; names that the log lacks are ignored.
    """
    here = [channel for name in dict.fromkeys(names) if (channel := log.find(name)) is not None]
    questions = [doubt for channel in here if (doubt := doubt_about(channel)) is not None]
    if assumed := assumed_units(here):
        questions.append(
            Note.advice(f"the log states no unit for {assumed}: is the one in brackets right? --unit NAME=UNIT")
        )
    return tuple(questions)


def impossible_median(name: str, flown: FloatArray) -> float | None:
    """Return the median of a channel that no aircraft has in flight, None for one that an aircraft may have.

    What runs off during the flight is a fault with an onset: the channel is as impossible in the first of its parts.

    Parameters
    ----------
    flown : (n,) of what is in flight, in the unit of `bfi_cli.quantities.channels.STANDARD`.
    """
    known = flown[np.isfinite(flown)]
    if name not in IN_FLIGHT or known.size < PARTS:
        return None
    low, high = IN_FLIGHT[name]
    middle, first = (float(np.median(part)) for part in (known, known[: known.size // PARTS]))
    return None if low <= middle <= high or low <= first <= high else middle


def sentence_of_impossible(name: str, middle: float) -> str:
    """Return what to say of a channel with a median over the flight that no aircraft has."""
    unit = STANDARD[name].unit
    degrees = f" ({np.degrees(middle):.3g} degrees)" if unit == "rad" else ""
    rather = RATHER.get(name, "in another unit")
    return (
        f"'{name}' is not used: its median in flight is {middle:.3g} {unit}{degrees}, which no aircraft has; it may be "
        f"{rather}"
    )


def assumed_units(channels: Iterable[Channel]) -> str:
    """Return the channels without a stated unit, each with the unit that is assumed; "" for none."""
    bare = [channel.name for channel in channels if channel.source_unit is None and channel.name in STANDARD]
    return ", ".join(f"{name} ({STANDARD[name].unit})" for name in bare if STANDARD[name].unit != "1")


def doubt_about(channel: Channel) -> Note | None:
    """Return a question about a channel with values beyond its limit, None where there is no doubt."""
    name = channel.name
    if name not in LIMITS or channel.unit not in (STANDARD[name].unit, ""):
        return None
    values = channel.values
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    limit, rather = LIMITS[name]
    reached = float(np.quantile(np.abs(finite), USUAL, overwrite_input=True))
    unit, ask = STANDARD[name].unit, f"--unit {channel.source}=UNIT states another"
    if reached > limit:
        return Note.advice(f"'{name}' reaches {reached:.3g} {unit}, which no aircraft does: is it in {rather}? {ask}")
    if unit == "K" and reached < COLDEST_K:
        return Note.advice(f"'{name}' stays below {reached:.3g} K, which no air does: is it in degC? {ask}")
    return None


def time_scale(log: FlightLog) -> float | None:
    """Return how many seconds a second of the time axis lasts, negative where the record runs backwards.

    None where that is about 1, or where it is not confirmed by two channels with their rates: a single channel may have
    another unit.
    """
    middle = max(0, (log.n_samples - LOOKED_AT) // 2)
    rows = slice(middle, middle + LOOKED_AT)
    ratios = []
    for name, rate in WITH_RATES:
        if name in log.channels and rate in log.channels:
            ratio = _ratio(log.channels[name].between(rows), log.channels[rate].between(rows), log.time_s[rows])
            ratios += [] if ratio is None else [ratio]
    if len(ratios) < 2 or not 1.0 / ALIKE < ratios[0] / ratios[1] < ALIKE:
        return None
    mean = 0.5 * (ratios[0] + ratios[1])
    return None if 1.0 / RIGHT < mean < RIGHT else mean


def _ratio(values: FloatArray, rate: FloatArray, time_s: FloatArray) -> float | None:
    """Return the ratio of a channel's changes to the integrals of its rate; None where they do not correlate."""
    travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)))])
    best, ratio = LEAST_CORRELATION, None
    for stride in STRIDES:
        changed, integral = values[stride:] - values[:-stride], travelled[stride:] - travelled[:-stride]
        good = np.isfinite(changed) & (np.abs(changed) < LARGEST_VALUE) & (np.abs(integral) < LARGEST_VALUE)
        changed, integral = changed[good], integral[good]
        spread = np.sqrt(float(changed @ changed) * float(integral @ integral)) if changed.size >= stride else 0.0
        if spread > 0.0 and abs(float(changed @ integral)) > best * spread:
            best = abs(float(changed @ integral)) / spread
            ratio = float(changed @ integral) / float(integral @ integral)
    return ratio
