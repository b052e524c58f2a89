"""The constant error of each relation of a flight, whatever its size: what is compared between flights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...airdata import relations as table
from ...airdata.relations import NAMES, Relation, State
from ...flightlog import FlightLog
from ...kernels import TWO_SIDED_95, FloatArray
from ...quantities.channels import STANDARD
from .implausible import FEWEST, NEEDS, circle_scales
from .misfits import seconds_of

# What has the wind, which is another in each flight, in the relations of `relations`; circles are free of it.
OVER_GROUND = {"ground_speed", "velocity_north", "velocity_east", "latitude", "longitude", "track"}
PIECES = 8  # of a flight, whose medians tell how well the median of the whole is known; as many as `search` takes
LEAST_SECONDS = 10 * PIECES  # in which a relation must hold: a median of ten in each piece


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantError:
    """By how much a channel differs from what others imply, over a flight.

    Attributes
    ----------
    channel : that is read; by : the channels that imply what it should read, "circles" for turns over the ground.
    value, unit : the channel less what is implied, in its SI unit.
    ci95 : 95 % interval, within the flight.
    """

    channel: str
    by: str
    value: float
    unit: str
    ci95: tuple[float, float]


def constant_errors(log: FlightLog) -> tuple[ConstantError, ...]:
    """Return the constant error of every relation of levels that a flight tells of, () where nothing flies."""
    seconds = seconds_of(log, NAMES)
    errors = [] if seconds is None else list(_by_relations(seconds))
    if log.channels.keys() >= {*NEEDS} and (by_circles := _by_circles(log)) is not None:
        errors.append(by_circles)
    return tuple(errors)


def _by_relations(seconds: State) -> Iterator[ConstantError]:
    """Yield the error of every relation of levels, each channel by the same others once."""
    known = set[tuple[str, str]]()
    for relation in table.RELATIONS:
        if (
            relation.tolerance is None
            or OVER_GROUND & {*relation.needs}
            or not {*relation.needs} <= seconds.values.keys()
        ):
            continue
        label = (relation.needs[0], " ".join(sorted(relation.needs[1:])))
        if label not in known and (error := _constant_error(relation, seconds, label)) is not None:
            known.add(label)
            yield error


def _constant_error(relation: Relation, seconds: State, label: tuple[str, str]) -> ConstantError | None:
    with np.errstate(all="ignore"):
        difference = relation.reading(seconds) - relation.expected(seconds)
    difference = difference[np.isfinite(difference)]
    if difference.size < LEAST_SECONDS:
        return None
    pieces = np.array([np.median(piece) for piece in np.array_split(difference, PIECES)])
    half = TWO_SIDED_95 * float(pieces.std(ddof=1)) / math.sqrt(PIECES)
    value = float(np.median(difference))
    channel, by = label
    return ConstantError(
        channel=channel, by=by, value=value, unit=STANDARD[channel].unit, ci95=(value - half, value + half)
    )


def _by_circles(log: FlightLog) -> ConstantError | None:
    """Return the error of the true airspeed at its median, by turns over the ground."""
    scales: FloatArray = circle_scales(log)
    if scales.size < FEWEST:
        return None
    # Reading times scale is the airspeed; half the circles may be of a gust.
    errors = float(np.nanmedian(log.channels["tas"].values)) * (1.0 - scales)
    half = TWO_SIDED_95 * float(errors.std(ddof=1)) / math.sqrt(scales.size)
    value = float(np.median(errors))
    return ConstantError(channel="tas", by="circles", value=value, unit="m/s", ci95=(value - half, value + half))
