"""The air data of a log as one system: its pressures and temperature, and what every channel makes of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .airspeed import (
    GAS_CONSTANT,
    HALF,
    HIGHEST,
    LOWEST,
    POWER,
    PRESSURES,
    SEA_LEVEL_PRESSURE,
    SEA_LEVEL_SPEED_OF_SOUND,
    SONIC_RATIO,
    SONIC_SHARE,
    FloatArray,
    G,
    altitude_of,
    calibrated_airspeed,
    impact_pressure_of_cas,
    impact_pressure_of_mach,
    isa_temperature,
    mach_number,
    mach_of_tas,
    pressure_at,
    speed_of_sound,
    static_temperature,
    total_temperature,
    true_airspeed,
)

# The pressures that a channel follows from; `tas` from a temperature too, `sat` where it was made of a recorded `tat`.
BOTH = ("p_static", "p_total")
DEPENDS_ON: Mapping[str, tuple[str, ...]] = {
    "p_static": ("p_static",),
    "altitude": ("p_static",),
    "baro_altitude": ("p_static",),
    "altitude_rate": ("p_static",),
    "p_total": ("p_total",),
    "q_impact": BOTH,
    "cas": BOTH,
    "ias": BOTH,
    "mach": BOTH,
    "tas": BOTH,
    "tas_rate": BOTH,
    "sat": BOTH,
}
# The sensors that a channel comes from: what moves it when it fails. A channel that is not here has its own.
SENSORS: Mapping[str, frozenset[str]] = {
    **dict.fromkeys(("p_static", "altitude", "baro_altitude", "altitude_rate"), frozenset({"static port"})),
    "p_total": frozenset({"pitot line"}),
    **dict.fromkeys(("q_impact", "cas", "ias", "mach"), frozenset({"static port", "pitot line"})),
    **dict.fromkeys(("tas", "tas_rate", "sat"), frozenset({"static port", "pitot line", "temperature probe"})),
    "tat": frozenset({"temperature probe"}),
}
# What the static and the impact pressure are taken from, the best first.
STATIC_SOURCES = ("p_static", "altitude")
IMPACT_SOURCES = ("q_impact", "p_total", "cas", "mach", "ias", "tas")
# What a sensor of an aircraft at rest may show below nothing; it is taken for nothing. m/s, Mach, Pa.
REST = {"cas": 5.0, "ias": 5.0, "tas": 5.0, "mach": 0.015, "q_impact": 100.0}
# K; beyond what any air has that an aircraft flies in, or its probe shows, up to Mach 1.
COLDEST, HOTTEST = 150.0, 400.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Impossible:
    """Samples whose values no subsonic flight has: where they are (n_samples,), and what is wrong with them."""

    where: NDArray[np.bool_]
    channel: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AirData:
    """Pressures and temperature, (n_samples,) each, NaN where they are missing or impossible.

    Attributes
    ----------
    p_static, q_impact : static and impact pressure, Pa.
    tat : total temperature, K.
    made_of : the channels that each was taken from; empty for the temperature of the standard atmosphere.
    impossible : what was left out.
    """

    p_static: FloatArray
    q_impact: FloatArray
    tat: FloatArray
    made_of: Mapping[str, tuple[str, ...]]
    impossible: tuple[Impossible, ...]

    def taken(self, rows: slice) -> AirData:
        """Return some of the samples."""
        impossible = (replace(wrong, where=wrong.where[rows]) for wrong in self.impossible)
        return replace(
            self,
            p_static=self.p_static[rows],
            q_impact=self.q_impact[rows],
            tat=self.tat[rows],
            impossible=tuple(wrong for wrong in impossible if wrong.where.any()),
        )

    @property
    def p_total(self) -> FloatArray:
        """Total pressure, Pa."""
        return self.p_static + self.q_impact

    @property
    def mach(self) -> FloatArray:
        """Mach number."""
        return mach_number(self.q_impact, self.p_static)

    @property
    def sat(self) -> FloatArray:
        """Static temperature, K."""
        return static_temperature(self.tat, self.mach)


SUBSONIC = "the equations hold below Mach 1"


class _Domain:
    """Channels within what their equations hold for, and what was left out of them."""

    def __init__(self, channels: Mapping[str, FloatArray]) -> None:
        self.channels = channels
        self.left_out: list[Impossible] = []

    def without(self, values: FloatArray, wrong: NDArray[np.bool_], channel: str, why: str) -> FloatArray:
        """Return values without wrong ones, which are said to be of a channel."""
        if np.any(wrong):
            self.left_out.append(Impossible(where=wrong, channel=channel, why=why))
        return np.where(wrong, np.nan, values)

    def within(self, name: str, least: float, most: float, why: str) -> FloatArray:
        """Return a channel between two values, and what an instrument at rest shows beyond the first as that."""
        values = self.channels[name]
        wrong = (values < least - REST.get(name, 0.0)) | (values > most)
        return self.without(np.clip(values, least, most), wrong, name, why)


def _impact_pressure(
    known: _Domain, source: str, p_static: FloatArray, tat: FloatArray | None, otherwise: FloatArray
) -> FloatArray:
    """Return the impact pressure that a channel stands for, of a true airspeed at `tat`, or at a static temperature."""
    if source == "q_impact":
        q_impact = known.within("q_impact", 0.0, np.inf, "an impact pressure is not negative")
    elif source == "p_total":
        q_impact = known.channels["p_total"] - p_static
        below = q_impact < -REST["q_impact"]
        q_impact = known.without(np.maximum(q_impact, 0.0), below, "p_total", "it is below the static pressure")
    elif source in ("cas", "ias"):
        why = f"0 to 340.3 m/s, {SUBSONIC}"
        q_impact = impact_pressure_of_cas(known.within(source, 0.0, SEA_LEVEL_SPEED_OF_SOUND, why))
    elif source == "mach":
        q_impact = impact_pressure_of_mach(known.within("mach", 0.0, 1.0, SUBSONIC), p_static)
    else:
        sound = speed_of_sound(otherwise if tat is None else tat)
        fastest = sound * (SONIC_SHARE if tat is not None else 1.0)
        tas = known.within("tas", 0.0, np.inf, SUBSONIC)
        tas = known.without(tas, tas > fastest, "tas", SUBSONIC)
        q_impact = impact_pressure_of_mach(mach_of_tas(tas, tat) if tat is not None else tas / sound, p_static)
    # Below the level of the sea it is the calibrated airspeed that reaches the speed of sound first.
    fastest = SONIC_RATIO * np.minimum(p_static, SEA_LEVEL_PRESSURE)
    return known.without(q_impact, q_impact > fastest, source, f"with the static pressure, {SUBSONIC}")


def air_data_of(channels: Mapping[str, FloatArray]) -> AirData:
    """Return the pressures and the temperature that recorded channels, (n_samples,) by standard name, stand for.

    The temperature is that of `tat`, else of `sat`, else of `tas` over `mach`, else the standard atmosphere's.

    Raises
    ------
    ValueError : nothing stands for the static, or for the impact pressure.
    """
    for name, sources in (("p_static", STATIC_SOURCES), ("q_impact", IMPACT_SOURCES)):
        if not set(sources) & channels.keys():
            raise ValueError(f"{name}: needs {' or '.join(sources)}, got none of them")
    known = _Domain(channels)
    if "p_static" in channels:
        source = "p_static"
        low, high = PRESSURES
        why = f"a static pressure lies between {low:.0f} and {high:.0f} Pa ({HIGHEST:g} and {LOWEST:g} m)"
        p_static = known.within("p_static", low, high, why)
    else:
        source = "altitude"
        p_static = pressure_at(known.within("altitude", LOWEST, HIGHEST, f"known between {LOWEST:g} and {HIGHEST:g} m"))
    made_of: dict[str, tuple[str, ...]] = {"p_static": (source,)}

    isa = isa_temperature(altitude_of(p_static))
    tat, sat = (
        known.within(name, COLDEST, HOTTEST, "no air temperature in kelvin") if name in channels else None
        for name in ("tat", "sat")
    )
    source = next(name for name in IMPACT_SOURCES if name in channels)
    made_of["q_impact"] = (source,)
    q_impact = _impact_pressure(known, source, p_static, tat, isa if sat is None else sat)

    mach = mach_number(q_impact, p_static)
    if tat is not None:
        made_of["tat"] = ("tat",)
    elif sat is not None:
        made_of["tat"] = ("sat",)
        tat = total_temperature(sat, mach)
    elif source != "tas" and "tas" in channels:
        made_of["tat"] = ("tas",)
        sound = np.divide(channels["tas"], mach, out=np.full(mach.shape, np.nan), where=mach > 0.05)
        shown = (sound / speed_of_sound(1.0)) ** 2 * (1.0 + HALF * mach**2)
        tat = np.where((shown > COLDEST) & (shown < HOTTEST), shown, total_temperature(isa, mach))
    else:
        made_of["tat"] = ()
        tat = total_temperature(isa, mach)
    return AirData(p_static=p_static, q_impact=q_impact, tat=tat, made_of=made_of, impossible=tuple(known.left_out))


def channels_of(
    p_static: FloatArray, q_impact: FloatArray, tat: FloatArray, *, rate_of: FloatArray | None = None
) -> dict[str, FloatArray]:
    """Return every channel that follows from pressures and total temperature, (n_samples,) by standard name.

    Parameters
    ----------
    rate_of : (n_samples,) seconds, increasing, for the rates of altitude and airspeed; None for none. Of a single
        sample the rates are 0.

    Raises
    ------
    ValueError : the pressures are not those of subsonic flight.
    """
    mach, altitude = mach_number(q_impact, p_static), altitude_of(p_static)
    tas = true_airspeed(mach, tat)
    made = {
        "p_static": p_static,
        "altitude": altitude,
        "p_total": p_static + q_impact,
        "q_impact": q_impact,
        "cas": calibrated_airspeed(q_impact),
        "mach": mach,
        "tas": tas,
        "sat": static_temperature(tat, mach),
    }
    made["ias"] = made["cas"]
    if rate_of is not None:
        for name, values in (("altitude_rate", altitude), ("tas_rate", tas)):
            made[name] = np.gradient(values, rate_of) if len(rate_of) > 1 else np.zeros(len(rate_of))
    return made


def fault_distribution(
    channel: str,
    p_static: ArrayLike,
    p_total: ArrayLike,
    tat: ArrayLike,
    *,
    held: Literal["total", "static"] = "total",
) -> FloatArray:
    """Return (..., 2) the derivatives of a channel by static and total pressure, [a11, a12] of T 2-5.

    Parameters
    ----------
    channel : one of `DEPENDS_ON`, but for the rates.
    p_static, p_total : where it is linearised, Pa.
    tat : total temperature there, K.
    held : the temperature that stays as it is while the pressures err. An air-data computer measures the total one;
        T 2-3 holds the static one, through its constant A_o. It matters for `tas` (and `sat`) only.

    Raises
    ------
    ValueError : pressures that are not those of subsonic flow, or of an aircraft at rest, where an airspeed has no
        derivative.
    """
    p_static, p_total = np.asarray(p_static, dtype=np.float64), np.asarray(p_total, dtype=np.float64)
    q_impact = p_total - p_static
    mach = mach_number(q_impact, p_static)
    if np.any(mach == 0.0):
        raise ValueError("q_impact: an airspeed has no derivative at rest, got 0 Pa")

    def by_ratio(ratio: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the derivative of a Mach number, or of cas / a0, by 1 + q_impact / p."""
        return np.asarray(ratio ** (1.0 / POWER - 1.0) / (2.0 * HALF * POWER * speed))

    zero, unity = np.zeros(mach.shape), np.ones(mach.shape)
    if channel in ("p_static", "p_total", "q_impact"):
        slopes = {"p_static": (unity, zero), "p_total": (zero, unity), "q_impact": (-unity, unity)}[channel]
    elif channel in ("altitude", "baro_altitude"):
        slopes = (-GAS_CONSTANT * isa_temperature(altitude_of(p_static)) / (G * p_static), zero)
    elif channel in ("cas", "ias"):
        speed = calibrated_airspeed(q_impact) / SEA_LEVEL_SPEED_OF_SOUND
        slope = by_ratio(1.0 + q_impact / SEA_LEVEL_PRESSURE, speed) * SEA_LEVEL_SPEED_OF_SOUND / SEA_LEVEL_PRESSURE
        slopes = (-slope, slope)
    else:
        sat, warming, by_mach = static_temperature(tat, mach), 1.0 + HALF * mach**2, unity
        if channel == "tas":
            by_mach = speed_of_sound(sat) / (warming if held == "total" else 1.0)
        elif channel == "sat":
            by_mach = -2.0 * HALF * mach * sat / warming if held == "total" else zero
        slope = by_mach * by_ratio(p_total / p_static, mach) / p_static
        slopes = (-slope * p_total / p_static, slope)
    return np.stack(np.broadcast_arrays(*slopes), axis=-1)
