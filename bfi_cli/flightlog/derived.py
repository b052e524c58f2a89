"""Channels derived from recorded ones: pressures, and airspeeds from lift, attitude and ground velocity.

They are derived from the whole log when an analysis needs them, so that the angle of zero lift or the wind may be
estimated in the flight before the window.

Others follow without a parameter, an altitude of the standard atmosphere from another: an altimeter shows
h(p) - h(setting), with h the altitude of a pressure in the standard atmosphere (ICAO Doc 7488; the setting of an
airfield is the pressure with which it shows the elevation there): turning the knob moves every altitude by the same
amount, 0.083 m per Pa at 1013 hPa.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..airdata import (
    DEPENDS_ON,
    IMPACT_SOURCES,
    KINEMATICS,
    PRESSURES,
    STATIC_SOURCES,
    air_data_of,
    altitude_of,
    climb_angle,
    constant_wind,
    ground_velocity,
    kinematic_acceleration,
    lift_speed,
    zero_lift_angle,
)
from ..errors import LogError
from ..kernels import MAD, BoolArray
from ..kernels.quantisation import find_quantum
from ..kernels.runs import runs
from ..notes import Note
from ..quantities.channels import STANDARD, quantity_of
from ..quantities.text import instant
from .record import Channel, FlightLog, FloatArray, frozen_array

# Pa: settings of an altimeter; a barometric scale ends at 28.1 and 31.0 inHg (SAE AS8009), airfields at 5000 m are set
# by QFE.
SETTINGS = (50_000.0, 108_000.0)
# s: clicks of the knob this close are one change; so long before and after it, and in so many samples, the flight is a
# parabola.
TOGETHER_S, CLIMB_S, FEWEST_BESIDE = 5.0, 8.0, 4
# Lengths of the fit on either side of a change in which others are made without one, and the fewest of these.
NEAR, FEWEST_PLACES = 8, 10
# APART: share of a change that records of altitude and setting differ by; so long, s, one of them is behind the other:
# a recorder of 1 Hz reads them up to a sample apart.
APART, BEHIND_S = 0.15, 1.0
# Share of a change beyond which the reading is that of neither setting.
BETWEEN = 0.25
# Log-likelihood ratio, in nats, of an altitude that follows the setting over one that does not, from which it does: 1
# in 150. A change speaks for no more than `MOST_NATS`, so that one jump of another cause does not decide alone against
# many.
FOLLOWS, MOST_NATS = 5.0, 20.0
# m, of a change below which it tells nothing: less than a click of 0.01 inHg (2.8 m) is rounding of the setting.
LEAST_CHANGE_M = 2.0


def pressure_altitude(baro_altitude: FloatArray, setting: FloatArray) -> FloatArray:
    """Return the pressure altitude, m, of an altimeter's reading, m, and setting, Pa; both (n_samples,).

    NaN where the setting is none, see `SETTINGS`; a setting that is missing for some samples is the one before. What a
    change of the setting adds is rounded to the steps of the reading, so that these are the steps of the result too.
    """
    known = (setting >= SETTINGS[0]) & (setting <= SETTINGS[1])
    if not known.any():
        return np.full(baro_altitude.shape, np.nan)
    last = np.maximum.accumulate(np.where(known, np.arange(known.size), -1))
    held = setting[np.where(last < 0, np.argmax(known), last)]
    shift = altitude_of(np.clip(held, PRESSURES[0], PRESSURES[1]))
    step = find_quantum(baro_altitude[np.isfinite(baro_altitude)])
    if step is not None:
        shift = shift[0] + step * np.round((shift - shift[0]) / step)
    return np.asarray(baro_altitude + shift)


def follows_setting(time_s: FloatArray, altitude: FloatArray, setting: FloatArray) -> bool:
    """Say whether an altitude moves with the setting of an altimeter where that is changed.

    About each change the part b of what the setting should move is fitted beside a parabola, which the flight is; the
    same fit at places near it where nothing is set tells its standard deviation. A change says how much likelier its b
    is with a mean of 1 than of 0.

    Parameters
    ----------
    time_s, altitude, setting : (n,) s, m and Pa.
    """
    known = np.isfinite(altitude) & np.isfinite(setting) & (setting >= SETTINGS[0]) & (setting <= SETTINGS[1])
    time_s, altitude = time_s[known], altitude[known]
    shown = -altitude_of(setting[known])
    clicks = np.flatnonzero(np.diff(shown))
    if not clicks.size:
        return False
    step_s = float(np.median(np.diff(time_s)))
    beside = max(FEWEST_BESIDE, round(CLIMB_S / step_s))
    evidence = 0.0
    for group in np.split(clicks, np.flatnonzero(np.diff(time_s[clicks]) > TOGETHER_S) + 1):
        first, last = int(group[0]) + 1 - beside, int(group[-1]) + 1 + beside
        if first < 0 or last > time_s.size or np.ptp(shown[first:last]) < LEAST_CHANGE_M:
            continue
        from_middle = np.linspace(-1.0, 1.0, last - first)
        flight = np.linalg.qr(np.column_stack([np.ones_like(from_middle), from_middle, from_middle**2]))[0]
        course = shown[first:last] - flight @ (flight.T @ shown[first:last])
        weights = course / float(course @ course)
        around = max(0, first - NEAR * (last - first)), last + NEAR * (last - first)
        places = np.lib.stride_tricks.sliding_window_view(altitude[slice(*around)], last - first)
        settings = np.lib.stride_tricks.sliding_window_view(shown[slice(*around)], last - first)
        quiet = places[np.ptp(settings, axis=1) == 0.0]
        if len(quiet) < FEWEST_PLACES:
            continue
        sd = float(np.hypot(MAD * np.median(np.abs(quiet @ weights)), APART))
        behind = max(1, round(BEHIND_S / step_s))
        near = altitude[max(0, first - behind) : last + behind]
        part = float(np.max(np.lib.stride_tricks.sliding_window_view(near, last - first) @ weights))
        evidence += float(np.clip((part - 0.5) / sd**2, -MOST_NATS, MOST_NATS))
    return evidence >= FOLLOWS


def set_altitude(time_s: FloatArray, baro_altitude: FloatArray, setting: FloatArray) -> FloatArray:
    """Return the pressure altitude, m, NaN beside a change of the setting where the reading is of another setting.

    Parameters
    ----------
    time_s, baro_altitude, setting : (n,) s, m and Pa.
    """
    altitude = pressure_altitude(baro_altitude, setting)
    changed = np.abs(np.diff(altitude - baro_altitude, prepend=np.nan))
    clicks = np.flatnonzero(changed > LEAST_CHANGE_M)
    beside = np.zeros(time_s.size, dtype=bool)
    for at_s in 0.5 * (time_s[clicks - 1] + time_s[clicks]):
        beside |= np.abs(time_s - at_s) < BEHIND_S
    values = altitude.copy()
    for first, end in runs(beside):
        if first > 0 and end < time_s.size:
            course = np.interp(time_s[first:end], time_s[[first - 1, end]], altitude[[first - 1, end]])
            off = np.abs(altitude[first:end] - course) > max(BETWEEN * np.nanmax(changed[first:end]), LEAST_CHANGE_M)
            values[first:end][off] = np.nan
    return values


def _same(name: str) -> Callable[[Values], FloatArray]:
    return lambda values: values[name]


# A channel, what it follows from without a parameter, and from these, and "time_s", by name, to (n_samples,) of it; the
# sentence about it, after "'altitude' is "; and whether it is another quantity in its place. The first that a log has
# the channels of is taken.
DIRECT: tuple[tuple[str, tuple[str, ...], Maker, str, bool], ...] = (
    (
        "altitude",
        ("baro_altitude", "baro_setting"),
        lambda values: set_altitude(values["time_s"], values["baro_altitude"], values["baro_setting"]),
        "the pressure altitude of {0} at the setting {1}",
        False,
    ),
    (
        "altitude",
        ("p_static", "baro_altitude"),
        lambda values: altitude_of(np.clip(values["p_static"], PRESSURES[0], PRESSURES[1])),
        "the pressure altitude of {0}",
        False,
    ),
    (
        "altitude",
        ("baro_altitude",),
        _same("baro_altitude"),
        "{0}, by a setting of the altimeter that the log lacks: it steps where the knob is turned",
        True,
    ),
    (
        "altitude_rate",
        ("gps_altitude_rate",),
        _same("gps_altitude_rate"),
        "{0}, of satellites or an inertial system: no fault of the static line moves it",
        True,
    ),
    (
        "track",
        ("magnetic_track", "magnetic_variation"),
        lambda values: np.asarray((values["magnetic_track"] + values["magnetic_variation"]) % (2.0 * np.pi)),
        "{0} from true north, by {1}",
        False,
    ),
    (
        "track",
        ("magnetic_track",),
        _same("magnetic_track"),
        "{0}, from magnetic north: velocities and winds are turned by the variation",
        True,
    ),
    (
        "velocity_north",
        ("ground_speed", "track"),
        lambda values: values["ground_speed"] * np.cos(values["track"]),
        "that of the ground velocity of {0} and {1}",
        False,
    ),
    (
        "velocity_east",
        ("ground_speed", "track"),
        lambda values: values["ground_speed"] * np.sin(values["track"]),
        "that of the ground velocity of {0} and {1}",
        False,
    ),
)


def pressures_of(log: FlightLog, name: str) -> tuple[str, ...]:
    """Return the pressures that a channel of the log follows from, () of any other.

    A static temperature follows from them only where the total one is recorded too, a rate of climb not where it is
    that of satellites or an inertial system.
    """
    channel = log.channels.get(name)
    if channel is None or (name == "sat" and "tat" not in log.channels):
        return ()
    if any(need.startswith("gps_") for need in channel.derived_from):
        return ()
    return DEPENDS_ON.get(name, ())


def with_quantities(log: FlightLog, typed: Collection[str]) -> FlightLog:
    """Return the log with its altitude by its right name, and with the channels of `DIRECT` that it lacks.

    An `altitude` that follows the recorded setting of the altimeter is a `baro_altitude`.

    Parameters
    ----------
    typed : standard names that the user gave to channels, which stay.
    """
    log = _with_baro_altitude(log, typed)
    channels, notes = dict(log.channels), list(log.notes)
    clean = dict(log.truth.clean) if log.truth else {}
    for direct, wanted, make, about, stands_in in DIRECT:
        for number in ("", *(f"_{i}" for i in range(1, 10))):
            name = direct + number
            # The setting is one for all sensors.
            needs = {need: need + number if need + number in STANDARD else need for need in wanted}
            if name not in STANDARD or name in channels or not set(needs.values()) <= channels.keys():
                continue
            if stands_in and any(quantity_of(other) == direct for other in channels):
                continue
            recorded = {"time_s": log.time_s} | {need: channels[here].values for need, here in needs.items()}
            values = frozen_array(make(recorded))
            if not np.isfinite(values).any():
                continue
            sources = tuple(needs.values())
            channels[name] = Channel(
                name=name,
                values=values,
                unit=STANDARD[name].unit,
                source=name,
                source_unit=STANDARD[name].unit,
                derived_from=sources,
            )
            if clean.keys() & set(sources):
                right = {need: clean[here] for need, here in needs.items() if here in clean}
                clean[name] = frozen_array(make(recorded | right))
            named = (f"'{channels[source].source}'" for source in sources)
            words = f"'{name}' is {about.format(*named)}"
            notes.append(Note.limit(words) if stands_in else Note.method(words))
    if len(channels) == len(log.channels):
        return log
    return replace(log, channels=channels, truth=log.truth and replace(log.truth, clean=clean), notes=tuple(notes))


def _with_baro_altitude(log: FlightLog, typed: Collection[str]) -> FlightLog:
    """Return the log with an altitude that follows the knob as `baro_altitude`."""
    if not {"altitude", "baro_setting"} <= log.channels.keys() or {"altitude"} & set(typed):
        return log
    if "baro_altitude" in log.channels or (
        log.truth and any(fault.channel == "altitude" for fault in log.truth.faults)
    ):
        return log
    channel = log.channels["altitude"]
    if not follows_setting(log.time_s, channel.values, log.channels["baro_setting"].values):
        return log

    def renamed(names: Mapping[str, object]) -> dict[str, str]:
        return {name: "baro_altitude" if name == "altitude" else name for name in names}

    channels = {new: log.channels[old] for old, new in renamed(log.channels).items()}
    channels["baro_altitude"] = replace(channel, name="baro_altitude")
    truth = log.truth and replace(
        log.truth, clean={new: log.truth.clean[old] for old, new in renamed(log.truth.clean).items()}
    )
    note = Note.method(
        f"'{channel.source}' steps with '{log.channels['baro_setting'].source}' and is taken for baro_altitude; "
        f"--channel altitude={channel.source} keeps it"
    )
    return replace(log, channels=channels, truth=truth, notes=(*log.notes, note))


Group = tuple[tuple[str, ...], ...]  # alternatives, each of channels that are all needed

# From so much flight before the window, s, the angle of zero lift is better estimated than from the window.
ENOUGH_S = 300.0
# First share of the window, from which scales and the wind are estimated: a fault mostly begins later.
FIRST_PART = 0.25
# Share of the highest airspeed below which an aircraft is not in flight: a stall is flown at 0.35 to 0.5 of it.
SLOWEST_FLIGHT = 0.33


Values = Mapping[str, FloatArray]
Maker = Callable[[Values], FloatArray]  # from recorded channels, (n_samples,) by name, to a derived channel


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


# Groups of channels, each by its alternatives, and from what these are the maker, and in words the parameter that was
# estimated for it, "" for none.
Derivation = tuple[tuple[Group, ...], Callable[[Sources], tuple[Maker, str]]]


def _lift(sources: Sources) -> tuple[Maker, str]:
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


def _over_ground(sources: Sources) -> tuple[Maker, str]:
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


def _stated(needs: tuple[Group, ...], make: Maker) -> Derivation:
    """Return the derivation of a channel without a parameter to estimate."""
    return needs, lambda _: (make, "")


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
    "lift_speed": ((*_each("aoa", "normal_acc", "tas"), STATIC), _lift),
    "kinematic_acc": _computed(kinematic_acceleration, *KINEMATICS),
    "climb_angle": _computed(climb_angle, *KINEMATICS[2:]),
    "ground_airspeed": ((GROUND, *_each("altitude_rate", "tas")), _over_ground),
}


def missing_for(name: str, has: Collection[str]) -> tuple[str, ...]:
    """Return the channels that a log with the channels `has` lacks to derive another, alternatives joined by "or"."""
    lacking = (group for group in DERIVED[name][0] if not any(set(alternative) <= set(has) for alternative in group))
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
        needs, estimate = DERIVED[name]
        try:
            make, words = estimate(sources)
        except ValueError as error:
            raise LogError(
                f"{log.path}: '{name}' cannot be derived: {error}; give a log with {ENOUGH_S:g} s of flight before "
                "--from, or a longer window"
            ) from None
        # The first alternative of each group that the log has.
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
