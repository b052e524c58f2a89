"""The convention of a normal acceleration, read from its median in level flight.

Recorders write a load factor, that less one, or a specific force along body z, upward or downward, in g or m/s^2. On
the ground as in level flight a load factor is 1, so that the median tells which of these it is; where few samples are
level, in aerobatics or circling, the attitude says which they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..airdata import G
from ..notes import Note
from .record import LARGEST_VALUE, Channel, FloatArray, StoredChannel, frozen_array

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
        return replace(channel, values=convention.change(channel.values), unit="m/s^2", source_unit=unit)
    return StoredChannel(
        name=channel.name,
        unit="m/s^2",
        source=channel.source,
        source_unit=unit,
        own_rate_hz=channel.own_rate_hz,
        read=lambda rows: convention.change(channel.between(rows)),
        rows=slice(0, channel.n_samples),
    )
