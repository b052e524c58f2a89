"""Values that no aircraft shows, which mostly have another unit than the log says: asked about, not refused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..channels import STANDARD
from ..notes import Note
from .record import LARGEST_VALUE, Channel, FlightLog, FloatArray

SURFACES = ("elevator", "aileron", "rudder", "stabiliser", "elevator_trim", "flaps")
# What nothing but a rocket exceeds, in the unit of `channels.STANDARD`, and the unit that the values may rather have.
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
# Temperatures of the air below it are none in kelvin.
COLDEST_K = 150.0
# Channels whose rate is recorded beside them, which together tell how long a second of the time axis is. Of three
# recorded flights altitude and roll have correlations of 0.93 to 0.999 with the integrals of their rates and ratios of
# 0.91 to 1.1, over one of these numbers of samples; the pitch, which turns change, 0.45 to 0.78.
WITH_RATES = (("altitude", "altitude_rate"), ("roll", "roll_rate"))
STRIDES, LEAST_CORRELATION, LOOKED_AT = (1, 10, 100), 0.9, 500_000
# Ratios further apart than this speak of the channels, nearer to 1 than that of nothing.
ALIKE, RIGHT = 1.15, 1.5
# Of the samples: single spikes are no unit.
USUAL = 0.99


def doubts_about(log: FlightLog, names: Sequence[str]) -> tuple[Note, ...]:
    """Return a question for each of the channels whose values cannot be, or whose unit nobody has stated.

    Parameters
    ----------
    names : standard names, or names in the file; those that the log lacks are passed over.
    """
    here = [channel for name in dict.fromkeys(names) if (channel := log.find(name)) is not None]
    questions = [doubt for channel in here if (doubt := doubt_about(channel)) is not None]
    if assumed := assumed_units(here):
        questions.append(
            Note.advice(f"the log states no unit for {assumed}: is the one in brackets right? --unit NAME=UNIT")
        )
    return tuple(questions)


def assumed_units(channels: Iterable[Channel]) -> str:
    """Return the channels whose unit nobody has stated, each with the one that it is taken to have; "" for none."""
    bare = [one.name for one in channels if one.source_unit is None and one.name in STANDARD]
    return ", ".join(f"{name} ({STANDARD[name].unit})" for name in bare if STANDARD[name].unit != "1")


def doubt_about(channel: Channel) -> Note | None:
    """Return a question about a channel whose usual values no aircraft shows, None where they can be."""
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
    """Return how many seconds a second of the time axis is, less than 0 where the record runs backwards.

    None where it is one, or where fewer than two channels with their rates tell it, or these differ: one alone may be
    in another unit.
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
    """Return what a channel changes by over what its rate says; None where they do not follow each other."""
    travelled = np.concatenate([[0.0], np.cumsum(np.nan_to_num(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)))])
    best, found = LEAST_CORRELATION, None
    for stride in STRIDES:
        changed, said = values[stride:] - values[:-stride], travelled[stride:] - travelled[:-stride]
        good = np.isfinite(changed) & (np.abs(changed) < LARGEST_VALUE) & (np.abs(said) < LARGEST_VALUE)
        changed, said = changed[good], said[good]
        spread = np.sqrt(float(changed @ changed) * float(said @ said)) if changed.size >= stride else 0.0
        if spread > 0.0 and abs(float(changed @ said)) > best * spread:
            best, found = abs(float(changed @ said)) / spread, float(changed @ said) / float(said @ said)
    return found
