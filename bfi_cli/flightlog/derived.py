"""Channels derived from recorded ones: pressures, and airspeeds from lift, attitude and ground velocity.

They are derived from the whole log when an analysis needs them, so that the angle of zero lift or the wind may be
estimated in the flight before the window.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..airdata import (
    IMPACT_SOURCES,
    KINEMATICS,
    STATIC_SOURCES,
    air_data_of,
    climb_angle,
    constant_wind,
    ground_velocity,
    kinematic_acceleration,
    lift_speed,
    zero_lift_angle,
)
from ..errors import LogError
from ..kernels.runs import BoolArray
from ..notes import Note
from ..quantities.channels import STANDARD
from ..quantities.text import instant
from .record import Channel, FlightLog, FloatArray, frozen_array

Group = tuple[tuple[str, ...], ...]  # alternatives, each of channels that are all needed

# From so much flight before the window, s, the angle of zero lift is better estimated than from the window.
ENOUGH_S = 300.0
# First share of the window, from which scales and the wind are estimated: a fault mostly begins later.
FIRST_PART = 0.25
# Share of the highest airspeed below which an aircraft is not in flight: a stall is flown at 0.35 to 0.5 of it.
SLOWEST_FLIGHT = 0.33


Values = Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sources:
    """What a channel is derived from.

    Attributes
    ----------
    values : (n_samples,) of the recorded channels by name.
    time_s : (n_samples,) seconds.
    reference : (n_samples,) the samples from which scale and wind are estimated; earlier : those of the flight before
        the window, for the angle of zero lift, or `reference` where they are too few.
    """

    values: Values
    time_s: FloatArray
    reference: BoolArray
    earlier: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivation:
    """How a channel is derived.

    Attributes
    ----------
    needs : groups of channels, each by its alternatives.
    told_by : from the sources, the function from recorded channels, (n_samples,) by name, to the derived channel, and
        in words the parameter that was estimated for it, "" for none.
    """

    needs: tuple[Group, ...]
    told_by: Callable[[Sources], tuple[Callable[[Values], FloatArray], str]]


def _lift(sources: Sources) -> tuple[Callable[[Values], FloatArray], str]:
    """Return the airspeed that the lift shows; its angle of zero lift and its scale are estimated from the flight."""
    recorded, earlier = sources.values, sources.earlier
    q_impact = air_data_of(recorded).q_impact
    zero_lift = zero_lift_angle(recorded["normal_acc"][earlier], recorded["aoa"][earlier], q_impact[earlier])

    def shape(values: Values) -> FloatArray:
        air = air_data_of(values)
        return lift_speed(values["normal_acc"], values["aoa"], air.p_static, air.sat, zero_lift=zero_lift)

    ratio = (recorded["tas"] / shape(recorded))[sources.reference]
    if not np.isfinite(ratio).any():
        raise ValueError("the lift needs samples in flight with an airspeed, got none")
    scale = float(np.nanmedian(ratio))
    return lambda values: scale * shape(values), f"an angle of zero lift of {np.degrees(zero_lift):.2f} degrees"


def _over_ground(sources: Sources) -> tuple[Callable[[Values], FloatArray], str]:
    """Return the airspeed that ground velocity and a constant wind show."""

    def velocity(values: Values) -> tuple[FloatArray, FloatArray]:
        if {"velocity_north", "velocity_east"} <= values.keys():
            return values["velocity_north"], values["velocity_east"]
        return ground_velocity(sources.time_s, values["latitude"], values["longitude"])

    (north, east), used = velocity(sources.values), sources.reference
    squared = sources.values["tas"] ** 2 - sources.values["altitude_rate"] ** 2
    horizontal = np.sqrt(np.where(squared > 0.0, squared, np.nan))
    wind = constant_wind(north[used], east[used], horizontal[used])

    def airspeed(values: Values) -> FloatArray:
        north, east = velocity(values)
        return np.asarray(np.hypot(np.hypot(north - wind[0], east - wind[1]), values["altitude_rate"]))

    return airspeed, f"a wind of {wind[0]:.1f} m/s to the north and {wind[1]:.1f} m/s to the east"


def _each(*names: str) -> tuple[Group, ...]:
    return tuple(((name,),) for name in names)


def _stated(needs: tuple[Group, ...], make: Callable[[Values], FloatArray]) -> Derivation:
    """Return the derivation of a channel without a parameter to estimate."""
    return Derivation(needs=needs, told_by=lambda _: (make, ""))


def _computed(make: Callable[..., FloatArray], *names: str) -> Derivation:
    return _stated(_each(*names), lambda values: make(*(values[name] for name in names)))


STATIC, IMPACT = (tuple((name,) for name in names) for names in (STATIC_SOURCES, IMPACT_SOURCES))
GROUND: Group = (("velocity_north", "velocity_east"), ("latitude", "longitude"))
DERIVED: Mapping[str, Derivation] = {
    # `air_data_of` needs an impact pressure, on which the static pressure does not depend.
    "p_static": _stated(
        (STATIC,),
        lambda values: (
            air_data_of(
                {name: reading for name, reading in values.items() if name in STATIC_SOURCES}
                | {"q_impact": np.zeros_like(next(iter(values.values())))}
            ).p_static
        ),
    ),
    "p_total": _stated((STATIC, IMPACT), lambda values: air_data_of(values).p_total),
    "q_impact": _stated((STATIC, IMPACT), lambda values: air_data_of(values).q_impact),
    "lift_speed": Derivation(needs=(*_each("aoa", "normal_acc", "tas"), STATIC), told_by=_lift),
    "kinematic_acc": _computed(kinematic_acceleration, *KINEMATICS),
    "climb_angle": _computed(climb_angle, *KINEMATICS[2:]),
    "ground_airspeed": Derivation(needs=(GROUND, *_each("altitude_rate", "tas")), told_by=_over_ground),
}


def missing_for(name: str, has: Collection[str]) -> tuple[str, ...]:
    """Return the channels that a log with the channels `has` lacks to derive another, alternatives joined by "or"."""
    lacking = (group for group in DERIVED[name].needs if not any(set(alternative) <= set(has) for alternative in group))
    return tuple(" or ".join(" and ".join(alternative) for alternative in group) for group in lacking)


def with_derived(
    log: FlightLog, names: Sequence[str], *, from_s: float | None = None, to_s: float | None = None
) -> FlightLog:
    """Return the log with the channels that it lacks and that can be derived; `notes` says from which.

    The angle of zero lift is estimated from the flight before the window, if that is 300 s long, else from the first
    quarter of the window; the scale of an airspeed and the wind from that quarter. Impossible samples outside the
    window become NaN. The clean signal is derived too where the log carries the truth.

    Parameters
    ----------
    names : standard names, or names in the file; channels that the log has, or that cannot be derived, are ignored.
    from_s, to_s : the window that is analysed.

    Raises
    ------
    LogError : a channel that is needed is missing, or has values in the window that no subsonic flight has.
    """
    wanted = [name for name in dict.fromkeys(names) if name in DERIVED and log.find(name) is None]
    for name in wanted:
        if missing := missing_for(name, log.channels):
            has = ", ".join(sorted(log.channels))
            raise LogError(
                f"{log.path}: '{name}' is not recorded, and to derive it the log lacks {', '.join(missing)}; the log "
                f"has: {has}; map one with --channel {missing[0].split()[0]}=NAME"
            )
    if not wanted:
        return log
    recorded = {name: channel.values for name, channel in log.channels.items()}
    inside, reference, earlier = _parts(log, from_s, to_s)
    sources = Sources(values=recorded, time_s=log.time_s, reference=reference, earlier=earlier)
    if {"p_static", "p_total", "q_impact", "lift_speed"} & set(wanted):
        _check_possible(log, recorded, inside)
    channels, clean, notes = dict(log.channels), dict(log.truth.clean if log.truth else {}), list(log.notes)
    for name in wanted:
        try:
            make, words = DERIVED[name].told_by(sources)
        except ValueError as error:
            raise LogError(
                f"{log.path}: '{name}' cannot be derived: {error}; give a log with {ENOUGH_S:g} s of flight before "
                "--from, or a longer window"
            ) from None
        # The first alternative of each group that the log has.
        needs = DERIVED[name].needs
        used = {source for group in needs for source in next(names for names in group if set(names) <= set(recorded))}
        values = frozen_array(make(recorded))
        channels[name] = Channel(name=name, values=values, unit=STANDARD[name].unit, source=name)
        if log.truth is not None and set(log.truth.clean) & used:
            clean[name] = frozen_array(make({**recorded, **clean}))
        notes.append(Note.method(f"'{name}' is derived from {', '.join(sorted(used))}{', with ' * bool(words)}{words}"))
    truth = log.truth and replace(log.truth, clean=clean)
    return replace(log, channels=channels, truth=truth, notes=tuple(notes))


def _parts(log: FlightLog, from_s: float | None, to_s: float | None) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return the samples of the window, of its first quarter in flight, and of the flight before it if long enough."""
    first, last = log.ends(from_s, to_s)
    inside = (log.time_s >= first) & (log.time_s <= last)
    flying = np.ones(log.n_samples, dtype=bool)
    airspeed = next((log.channels[name].values for name in ("tas", "cas", "ias") if name in log.channels), None)
    if airspeed is not None and np.isfinite(airspeed).any():
        flying = airspeed >= SLOWEST_FLIGHT * np.quantile(airspeed[np.isfinite(airspeed)], 0.95)
    reference = inside & flying & (log.time_s <= first + FIRST_PART * (last - first))
    before = flying & (log.time_s < first)
    return inside, reference, before if np.count_nonzero(before) >= ENOUGH_S * log.rate_hz else reference


def _check_possible(log: FlightLog, recorded: Mapping[str, FloatArray], inside: BoolArray) -> None:
    """Refuse values in the window that no subsonic flight has; see `with_derived`."""
    standing_in = {"q_impact": np.zeros(log.n_samples)} if not set(IMPACT_SOURCES) & recorded.keys() else {}
    for fault in air_data_of({**standing_in, **recorded}).impossible:
        wrong = np.flatnonzero(fault.where & inside)
        if wrong.size:
            k, channel = int(wrong[0]), log.channels[fault.channel]
            raise LogError(
                f"{log.path}: '{channel.name}' is {channel.values[k]:.6g} {channel.unit} at sample {k} "
                f"({instant(log.time_s[k])} s), {fault.why}; choose a window without it with --from/--to, or state its "
                f"unit with --unit"
            )
