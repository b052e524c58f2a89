"""Residuals that a healthy log keeps at a constant: lift, climb, kinematics and ground speed (docs/theory.md, 15.7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...airdata import (
    IMPACT_SOURCES,
    KINEMATICS,
    STATIC_SOURCES,
    G,
    climb_angle,
    constant_wind,
    kinematic_acceleration,
)
from ...kernels import FloatArray
from .record import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class Constants:
    """What is taken as constant over a window.

    Attributes
    ----------
    speed : mean true airspeed, m/s.
    zero_lift : angle of attack of zero lift, rad, and whether it is known; a nuisance otherwise.
    wind : m/s to the north and to the east, where the residual is linearised.
    """

    speed: float
    zero_lift: float
    knows_zero_lift: bool
    wind: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualKind:
    """A residual: values(record) less the integral of rate(record), in `unit`.

    Attributes
    ----------
    needs : groups of channels, of each group one is enough.
    reads : every channel that its values and its rate may depend on; by_speed : it goes with `Constants.speed`.
    nuisances : (n, m) columns beside the constant, and the prior standard deviation of each.
    levels : of the fast noise, from which one is chosen; slow : from times, (n, n) covariance of the slow noise.
        The levels of the recorded flights of a Cessna Citation lie inside by a factor of three (docs/theory.md, 15.7).
    dispersion : standard deviation of what healthy windows of 120 s show of a ramp, in those of the noise model: gusts,
        turns and changes of trim are no stationary noise. Root mean squares over 190 windows of 60 to 240 s of the
        flights, which agree within a fifth.
    """

    name: str
    unit: str
    needs: tuple[tuple[str, ...], ...]
    reads: frozenset[str]
    values: Callable[[Record, Constants], FloatArray]
    rate: Callable[[Record], FloatArray] | None
    nuisances: Callable[[Record, Constants], tuple[FloatArray, FloatArray]] | None
    levels: FloatArray
    slow: Callable[[FloatArray], FloatArray]
    dispersion: float
    by_speed: bool = False


def _exponential(sd: float, seconds: float) -> Callable[[FloatArray], FloatArray]:
    return lambda t: sd**2 * np.exp(-np.abs(t[:, None] - t[None, :]) / seconds)


def _lift(record: Record, constants: Constants) -> FloatArray:
    channels = record.channels
    impact, force = record.air.q_impact, channels["normal_acc"] + G
    angle = channels["aoa"] - constants.zero_lift
    known = (impact > 0.0) & (force > 0.0) & (angle > 0.0)
    logarithm = np.log(
        np.where(known, impact, np.nan) * np.where(known, angle, np.nan) / np.where(known, force, np.nan)
    )
    return np.asarray(0.5 * constants.speed * logarithm)


def _zero_lift_column(record: Record, constants: Constants) -> tuple[FloatArray, FloatArray]:
    if constants.knows_zero_lift:
        return np.empty((len(record.time_s), 0)), np.empty(0)
    angle = record.channels["aoa"] - constants.zero_lift
    column = 0.5 * constants.speed / np.where(angle > 0.0, angle, np.nan)
    return column[:, None], np.array([np.inf])


def _climb(record: Record, constants: Constants) -> FloatArray:
    channels = record.channels
    rise = np.sin(climb_angle(channels["aoa"], channels["pitch"], channels["roll"]))
    speed = np.where(channels["tas"] > LEAST_SPEED, channels["tas"], np.nan)
    return np.degrees(record.climb_rate / speed - rise)


def _horizontal(record: Record) -> FloatArray:
    squared = record.channels["tas"] ** 2 - record.climb_rate**2
    return np.sqrt(np.where(squared > 0.0, squared, np.nan))


def _through_air(record: Record, constants: Constants) -> FloatArray:
    velocity = np.column_stack([record.channels["velocity_north"], record.channels["velocity_east"]])
    return np.asarray(velocity - np.asarray(constants.wind))


def _ground(record: Record, constants: Constants) -> FloatArray:
    return np.asarray(_horizontal(record) - np.linalg.norm(_through_air(record, constants), axis=1))


LEAST_SPEED = 1.0  # m/s; what is slower does not fly
WIND_SD = 50.0  # m/s, a jet stream; it decides only what a flight straight ahead leaves open, the wind across


def _wind_columns(record: Record, constants: Constants) -> tuple[FloatArray, FloatArray]:
    through = _through_air(record, constants)
    size = np.linalg.norm(through, axis=1)
    ahead = through / np.where(size > 0.0, size, np.nan)[:, None]
    altitude = record.channels.get("altitude", np.empty(0))
    if not np.isfinite(altitude).any():
        return ahead, np.array([WIND_SD, WIND_SD])
    height = altitude - np.nanmean(altitude)
    return np.column_stack([ahead, ahead * height[:, None]]), np.array([WIND_SD, WIND_SD, SHEAR_SD, SHEAR_SD])


# m/s^2, of a longitudinal accelerometer's bias, or of gravity along it by 0.3 degrees of attitude.
BIAS_SD = 0.05
# 1/s, of the wind over altitude: 10 m/s in 1000 m are common outside of the lowest layers.
SHEAR_SD = 0.01
AIR = (STATIC_SOURCES, IMPACT_SOURCES)
# What pressures and temperature are made of.
AIR_DATA = frozenset((*STATIC_SOURCES, *IMPACT_SOURCES, "tat", "sat"))
# How the dispersion grows with the length of a window, on the same flights.
DISPERSION_GROWTH = 0.3
# Levels and slow parts: METHOD of the trials on two flights of a Cessna Citation, tried on two further ones.
RESIDUALS = (
    ResidualKind(
        name="lift",
        unit="m/s",
        needs=(*AIR, ("aoa",), ("normal_acc",), ("tas",)),
        reads=AIR_DATA | {"aoa", "normal_acc"},
        values=_lift,
        rate=None,
        nuisances=_zero_lift_column,
        levels=np.geomspace(0.1, 5.0, 12),
        slow=_exponential(0.3, 30.0),
        dispersion=1.9,
        by_speed=True,
    ),
    ResidualKind(
        name="climb",
        unit="deg",
        needs=(("tas",), ("aoa",), ("pitch",), ("roll",), ("altitude_rate",)),
        reads=AIR_DATA | {"aoa", "pitch", "roll", "altitude_rate"},
        values=_climb,
        rate=None,
        nuisances=None,
        levels=np.geomspace(0.1, 5.0, 12),
        slow=_exponential(0.15, 30.0),
        dispersion=2.1,
    ),
    ResidualKind(
        name="kinematics",
        unit="m/s",
        needs=(("tas",), *((name,) for name in KINEMATICS)),
        reads=frozenset(("tas", *KINEMATICS)),
        values=lambda record, constants: record.channels["tas"],
        rate=lambda record: kinematic_acceleration(*(record.channels[name] for name in KINEMATICS)),
        nuisances=lambda record, constants: ((record.time_s - record.time_s[0])[:, None], np.array([BIAS_SD])),
        levels=np.geomspace(0.1, 2.0, 8),
        slow=lambda t: 0.3**2 * np.minimum(t[:, None], t[None, :]),  # a random walk
        dispersion=1.3,
    ),
    ResidualKind(
        name="ground_speed",
        unit="m/s",
        needs=(("tas",), ("altitude_rate",), ("velocity_north",), ("velocity_east",)),
        reads=AIR_DATA | {"altitude_rate", "velocity_north", "velocity_east"},
        values=_ground,
        rate=None,
        nuisances=_wind_columns,
        levels=np.geomspace(0.05, 2.0, 10),
        slow=_exponential(0.6, 120.0),
        dispersion=2.8,
    ),
)


def available(has: Mapping[str, object]) -> tuple[tuple[ResidualKind, ...], dict[str, str]]:
    """Return the residuals that a log with these channels allows, and what each of the others lacks."""
    kinds, lacking = [], {}
    for kind in RESIDUALS:
        missing = [" or ".join(group) for group in kind.needs if not any(name in has for name in group)]
        if missing:
            lacking[kind.name] = ", ".join(missing)
        else:
            kinds.append(kind)
    return tuple(kinds), lacking


def weights_of(kinds: Sequence[ResidualKind], length_s: float) -> FloatArray:
    """Return (n_kinds,) what a log-likelihood is worth of what the noise model says, in a window of a length."""
    growth = (length_s / 120.0) ** DISPERSION_GROWTH
    return np.array([(growth * kind.dispersion) ** -2.0 for kind in kinds])


def constants_of(record: Record, *, zero_lift: float | None) -> Constants:
    """Return what a window takes as constant.

    Parameters
    ----------
    zero_lift : rad, where it is known from elsewhere.
    """
    channels = record.channels
    wind = (0.0, 0.0)
    if {"velocity_north", "velocity_east", "altitude_rate"} <= channels.keys():
        north, east, horizontal = channels["velocity_north"], channels["velocity_east"], _horizontal(record)
        if np.isfinite(north + east + horizontal).any():
            wind = constant_wind(north, east, horizontal)
    return Constants(
        speed=float(np.nanmean(channels["tas"])),
        # Where it is linearised; any wing with camber has it a few degrees below zero.
        zero_lift=np.radians(-1.5) if zero_lift is None else zero_lift,
        knows_zero_lift=zero_lift is not None,
        wind=wind,
    )
