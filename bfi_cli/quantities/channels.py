"""Standard channel names with their SI units, these channels in other recorders, and units as people write them.

Signs are those of the recorder: nothing here changes the sign of a signal.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import LogError
from ..printable import shortened


@dataclass(frozen=True, slots=True, kw_only=True)
class StandardChannel:
    """A signal the program knows: its name, SI unit ("1" for a ratio) and description.

    `quantity` is the quantity that it measures: `tas` for `tas_2`, its second sensor; else the name itself.
    """

    name: str
    quantity: str
    unit: str
    description: str
    aliases: tuple[str, ...]


NAME_LETTERS = 40  # of a channel that is not standard, in a sentence
# The largest possible error of a reading, in the standard unit: for an airspeed the speed of sound at sea level (ISO
# 2533), for an angle half a turn, for a height and a pressure the whole atmosphere that is flown in. An analysis whose
# limit exceeds it says nothing about the channel.
LARGEST_ERROR = {
    **dict.fromkeys(("tas", "cas", "ias", "ground_speed", "altitude_rate", "gps_altitude_rate"), 340.294),
    "mach": 1.0,
    **dict.fromkeys(("aoa", "sideslip", "pitch", "roll", "yaw", "flight_path_angle"), math.pi),
    **dict.fromkeys(("altitude", "baro_altitude", "gps_altitude", "radio_altitude"), 30_000.0),
    **dict.fromkeys(("p_static", "p_total", "q_impact"), 110_000.0),
}
# Without one of these an airspeed is bounded by other airspeeds only, and a vane or an attitude by nothing.
INDEPENDENT = frozenset(
    {"altitude", "p_static", "altitude_rate", "normal_acc", "longitudinal_acc"}
    | {"velocity_north", "velocity_east", "latitude", "longitude"}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class NameMatch:
    """A recorder's name matched: `unit` is that in the name, `rank` is 0 for the standard name itself."""

    name: str
    unit: str | None
    rank: int


_TABLE = """
time s | time since the start of the log | t time_s elapsed_time timestamp totl_time timeus=us
tas m/s | true airspeed | vtas v_tas true_airspeed vtrue v_true true_air_speed airspeed_true
tas_rate m/s^2 | rate of change of true airspeed | vdot v_dot tas_dot vtas_dot tas_acceleration
cas m/s | calibrated airspeed | vcas v_cas calibrated_airspeed computed_airspeed
ias m/s | indicated airspeed | vias v_ias indicated_airspeed vind
ground_speed m/s | ground speed | gs groundspeed gnd_speed gndspd gps_speed gps_spd
track rad | track over ground, from true north | true_track track_true gps_track ground_track track_angle \
course_over_ground cog
magnetic_track rad | track over ground, from magnetic north | track_magnetic trk_mag mag_track
magnetic_variation rad | magnetic north, east of true north | magvar mag_var magnetic_declination
velocity_north m/s | ground velocity, to the north | vel_n v_north vn velocity_n vel_north
velocity_east m/s | ground velocity, to the east | vel_e v_east ve velocity_e vel_east
wind_north m/s | velocity of the wind, north | windspeed_north
wind_east m/s | velocity of the wind, east | windspeed_east
mach 1 | Mach number | mach_number ma mach_ratio
aoa rad | angle of attack | alpha angle_of_attack vane_aoa aoa_vane alpha_vane
sideslip rad | angle of sideslip | beta aos angle_of_sideslip vane_beta sideslip_angle
p_static Pa | static pressure | ps static_pressure baro_pressure pstat
p_total Pa | total pressure | pt total_pressure pitot_pressure ptot
q_impact Pa | impact pressure | qc impact_pressure differential_pressure
altitude m | pressure altitude | alt h hp press_alt pressure_altitude pressure_alt altitude_std alt_std palt altp
baro_altitude m | altitude by the setting of the altimeter | baro_alt alt_baro altitude_baro barometric_altitude \
baroaltitude baro_corrected_altitude bc_alt bcalt indicated_altitude alt_ind altind altb altitude_qnh
baro_setting Pa | setting of the altimeter | baro_set altimeter_setting kollsman_setting qnh baroa=inHg
gps_altitude m | geometric altitude, of satellites or an inertial system | gps_alt gps_height gnss_altitude \
altitude_gps alt_gps altgps altitude_msl alt_msl altmsl msl_altitude altitude_ellipsoid alt_ellipsoid \
ellipsoid_height geometric_altitude geoaltitude inertial_altitude alt_ftmsl=ft
radio_altitude m | height above the ground, of a radio altimeter | radio_alt radio_height radar_altitude radar_alt \
radalt ralt altitude_radio alt_radio alt_ftagl=ft
altitude_rate m/s | rate of climb | alt_rate hdot vertical_speed vvi climb_rate rate_of_climb roc vs
gps_altitude_rate m/s | rate of climb, of satellites or an inertial system | gps_vertical_speed \
inertial_vertical_speed gps_vspd vspdg
pitch rad | pitch attitude | theta pitch_angle
roll rad | roll attitude | phi roll_angle bank bank_angle
yaw rad | heading | psi yaw_angle heading true_heading hding_true heading_true
pitch_rate rad/s | body pitch rate | q pitchspeed
roll_rate rad/s | body roll rate | p rollspeed
yaw_rate rad/s | body yaw rate | r yawspeed
longitudinal_acc m/s^2 | specific force along body x | ax long_acc n_x nx acceleration_longitudinal gload_axial=g
lateral_acc m/s^2 | specific force along body y | ay lat_acc n_y ny acceleration_lateral gload_side=g
normal_acc m/s^2 | specific force along body z | az norm_acc vert_acc n_z nz acceleration_normal gload_norml=g
flight_path_angle rad | flight path angle | gamma fpa
tat K | total air temperature | total_air_temperature total_temperature
sat K | static air temperature | oat static_air_temperature outside_air_temperature air_temperature
elevator rad | elevator deflection | de delta_e elevator_deflection elev elev_surf
aileron rad | aileron deflection | da delta_a aileron_deflection ailrn ailrn_surf
rudder rad | rudder deflection | dr delta_r rudder_deflection ruddr ruddr_surf
stabiliser rad | stabiliser incidence | stabilizer stab ih delta_ih stab_trim stabilizer_trim
elevator_inner_right rad | right inner elevator | elevator_inboard_right delta_eir
elevator_inner_left rad | left inner elevator | elevator_inboard_left delta_eil
elevator_outer_right rad | right outer elevator | elevator_outboard_right delta_eor
elevator_outer_left rad | left outer elevator | elevator_outboard_left delta_eol
elevator_trim rad | elevator trim tab | dte delta_te elevator_dte elev_trim
throttle 1 | throttle lever | pla power_lever delta_t throttle_lever thro1_part
thrust_command_1 rad | thrust command, engine 1 | delta_eng1
thrust_command_2 rad | thrust command, engine 2 | delta_eng2
thrust_command_3 rad | thrust command, engine 3 | delta_eng3
thrust_command_4 rad | thrust command, engine 4 | delta_eng4
thrust N | engine thrust | thrust_total tc_total
flaps rad | flap deflection | flap df delta_f flap_position
gear 1 | landing gear, 1 is down | landing_gear gear_position
column_force N | pull force on the control column | column_fe stick_force fe
fuel_flow kg/s | fuel flow | fmf fuel_mass_flow
latitude rad | latitude | lat gps_lat
longitude rad | longitude | lon gps_long gps_lon
lift_speed m/s | airspeed that the lift shows |
kinematic_acc m/s^2 | rate of change of airspeed in still air |
climb_angle rad | angle of the motion through the air above the horizon |
ground_airspeed m/s | airspeed that ground velocity and a constant wind show |
valid_airspeed 1 | 1 where the airspeed can be trusted |
hover 1 | of a VTOL, 1 where its rotors carry it, 0.5 in transition, 0 where its wing does |
"""

INPUTS = (
    *("elevator", "elevator_inner_right", "elevator_inner_left", "elevator_outer_right", "elevator_outer_left"),
    *("stabiliser", "elevator_trim", "throttle", "thrust", *(f"thrust_command_{engine}" for engine in range(1, 5))),
    *("aileron", "rudder"),
)
STANDARD: dict[str, StandardChannel] = {}
_ALIAS: dict[str, tuple[str, str | None]] = {}
for _line in _TABLE.strip().splitlines():
    _head, _description, _aliases = (part.strip() for part in _line.split("|"))
    _name, _si = _head.split()
    STANDARD[_name] = StandardChannel(
        name=_name, quantity=_name, unit=_si, description=_description, aliases=tuple(_aliases.split())
    )
    for _alias in (_name, *_aliases.split()):
        _spelling, _, _unit = _alias.partition("=")
        _ALIAS[_spelling] = (_name, _unit or None)

# Quantities with several sensors in one aircraft; two elevators are two surfaces.
REPEATED = (
    *("tas", "cas", "ias", "mach", "aoa", "sideslip", "p_static", "p_total", "q_impact", "altitude", "altitude_rate"),
    *("baro_altitude", "gps_altitude", "gps_altitude_rate", "radio_altitude", "pitch", "roll", "yaw", "tat", "sat"),
)
# Number of the sensor by the word or number after the name.
_WHICH = {
    **{str(number): number for number in range(1, 10)},
    **dict.fromkeys(("captain", "capt", "left", "lh"), 1),
    **dict.fromkeys(("first_officer", "fo", "right", "rh"), 2),
    **dict.fromkeys(("standby", "stby", "backup"), 3),
}
for _name in REPEATED:
    _one = STANDARD[_name]
    for _number in range(1, 10):
        _sensor, _words = f"{_name}_{_number}", f"{_one.description}, sensor {_number}"
        STANDARD[_sensor] = StandardChannel(
            name=_sensor, quantity=_name, unit=_one.unit, description=_words, aliases=()
        )
        if _name in LARGEST_ERROR:
            LARGEST_ERROR[_sensor] = LARGEST_ERROR[_name]
    for _alias in (_name, *_one.aliases):
        _spelling, _, _unit = _alias.partition("=")
        # Two letters and a number, ps_1 or ma_2, may be anything.
        if len(_spelling) > 2:
            for _word, _number in _WHICH.items():
                for _between in ("_", "") if _word.isdigit() else ("_",):
                    _ALIAS[f"{_spelling}{_between}{_word}"] = (f"{_name}_{_number}", _unit or None)


def unit_of(name: str, other: str = "") -> str:
    """Return the SI unit of a standard channel, `other` of any other channel."""
    return STANDARD[name].unit if name in STANDARD else other


def channel_in_words(name: str) -> str:
    """Return the full name of a channel, "true airspeed" for tas; of one that is not standard the name."""
    return STANDARD[name].description if name in STANDARD else shortened(name, NAME_LETTERS)


def quantity_of(name: str) -> str:
    """Return the quantity that a standard channel measures, `tas` for `tas_2`; any other name itself."""
    return STANDARD[name].quantity if name in STANDARD else name


_PREFIX = re.compile(
    r"^(?:(?P<air>dadc|adc|adiru|adahrs|fms|arsp)|(?P<motion>gps|gnss|ahrs|irs|iru|ins|imu|att))\d*_(?:b_|body_)?"
)
# Altitude and rate of climb of an instrument that measures motion and no pressure; what only air
# tells is no channel of it.
_OF_MOTION = {"altitude": "gps_altitude", "altitude_rate": "gps_altitude_rate"}
_OF_AIR = frozenset(("tas", "tas_rate", "cas", "ias", "mach", "p_static", "p_total", "q_impact", "tat", "sat"))
_OF_AIR |= {"baro_altitude", "baro_setting", "radio_altitude"}


def match_name(source: str) -> NameMatch | None:
    """Return the standard channel a recorder's name stands for, None where none is known.

    Case, punctuation, the prefix of the instrument ("Dadc1_") and a trailing unit ("tas_kt") do not matter. The prefix
    of an instrument without a pressure makes no channel of the air: "ins_alt" is a `gps_altitude`, "gps_tas" unknown.
    """
    if source in STANDARD:
        return NameMatch(name=source, unit=None, rank=0)
    if source.lower() in STANDARD:
        return NameMatch(name=source.lower(), unit=None, rank=1)
    camel = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", source)
    for text in dict.fromkeys((source, camel)):
        plain = re.sub(r"[^0-9a-z]+", "_", text.lower()).strip("_")
        if match := _match_spelling(plain) or _match_behind_prefix(plain):
            return match
    return None


def _match_behind_prefix(spelling: str) -> NameMatch | None:
    """Return the channel of a spelling behind the prefix of its instrument, None of one that it cannot measure."""
    prefix = _PREFIX.match(spelling)
    match = _match_spelling(spelling[prefix.end() :]) if prefix else None
    if prefix is None or match is None or prefix["motion"] is None:
        return match
    quantity = quantity_of(match.name)
    if quantity in _OF_AIR:
        return None
    return replace(match, name=_OF_MOTION.get(quantity, quantity) + match.name.removeprefix(quantity))


def _match_spelling(spelling: str) -> NameMatch | None:
    if spelling in _ALIAS:
        name, unit = _ALIAS[spelling]
        return NameMatch(name=name, unit=unit, rank=2)
    tokens = spelling.split("_")
    for i in range(1, len(tokens)):
        base, unit = "_".join(tokens[:i]), "_".join(tokens[i:])
        if base in _ALIAS:
            name = _ALIAS[base][0]
            stated = "m/s" if unit == "ms" and STANDARD[name].unit == "m/s" else unit
            if si_unit(stated) == STANDARD[name].unit:
                return NameMatch(name=name, unit=stated, rank=3)
    return None


def meant_channel(name: str, known: Collection[str]) -> str | None:
    """Return the channel among `known` that a person may mean by a name, None where none is similar."""
    match = match_name(name)
    spelled = name.lower()
    like = [airspeed for airspeed in ("tas", "cas", "ias") if "speed" in spelled and "air" in spelled]
    like += [
        channel for channel in known if match and quantity_of(channel) == match.name
    ]  # tas_1 where there is no tas
    close = [] if match else difflib.get_close_matches(spelled, known, n=1)
    return next((channel for channel in (match.name if match else "", *like, *close) if channel in known), None)


def split_unit(header: str) -> tuple[str, str | None]:
    """Split "tas [kt]" or "tas (kt)" into name and unit.

    "accel[0]" is a name, a number glued to it being an index; so is "aoa (left)", which is no known unit.
    """
    parts = re.fullmatch(r"(.*?\S)(\s*)([\[(])([^\[\]()]*)[\])]", header.strip())
    if parts is None:
        return header.strip(), None
    name, blank, bracket, unit = parts[1], parts[2], parts[3], parts[4].strip()
    is_index = unit.isdigit() and not blank
    if is_index or (bracket == "(" and si_unit(unit) is None):
        return header.strip(), None
    return name, unit


FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Conversion:
    """A unit in which values are written or shown: value in SI = factor * value + offset.

    Attributes
    ----------
    si : the SI unit, "" for a log that states none.
    offset : of readings; differences, limits and rates have none.
    name : that is shown; "" for the SI unit, and where several spellings are known.
    """

    factor: float
    si: str
    offset: float = 0.0
    name: str = ""

    @property
    def unit(self) -> str:
        """The unit that is shown."""
        return self.name or self.si

    def reading(self, value: float | None) -> float | None:
        """Return a reading in the unit shown, None for None."""
        return None if value is None else (value - self.offset) / self.factor

    def change(self, value: float | None) -> float | None:
        """Return a difference of two readings: a fault, a limit, a standard deviation; None for None."""
        return None if value is None else value / self.factor

    def readings(self, values: ArrayLike) -> FloatArray:
        """Return readings of any shape; the same array where nothing changes."""
        if self.offset == 0.0:
            return self.changes(values)
        return (np.asarray(values, dtype=np.float64) - self.offset) / self.factor

    def changes(self, values: ArrayLike) -> FloatArray:
        """Return differences of readings, of any shape; the same array where nothing changes."""
        array = np.asarray(values, dtype=np.float64)
        return array if self.factor == 1.0 else array / self.factor


# Exact by definition: the international foot, inch and pound (1959), the standard gravity (CGPM 1901).
DEGREE, FOOT, INCH, G, POUND = math.pi / 180.0, 0.3048, 0.0254, 9.80665, 0.45359237
PSI = POUND * G / INCH**2

CONVERSIONS = (
    (Conversion(1.0, "1"), "1 - ratio none no_unit no_units dimensionless part mach norm bool flag"),
    (Conversion(0.01, "1"), "% percent pct"),
    (Conversion(1.0, "s"), "s sec secs second seconds"),
    (Conversion(1e-3, "s"), "ms msec millisecond milliseconds"),
    (Conversion(1e-6, "s"), "us usec microsecond microseconds"),
    (Conversion(1e-9, "s"), "ns nsec nanosecond nanoseconds"),
    (Conversion(60.0, "s"), "min minute minutes"),
    (Conversion(3600.0, "s"), "h hr hour hours"),
    (Conversion(1.0, "m"), "m meter meters metre metres"),
    (Conversion(1000.0, "m"), "km kilometer kilometers kilometre kilometres"),
    (Conversion(0.01, "m"), "cm"),
    (Conversion(1e-3, "m"), "mm"),
    (Conversion(FOOT, "m"), "ft foot feet ftmsl ft_msl ft_baro ft_wgs"),
    (Conversion(INCH, "m"), "in inch inches"),
    (Conversion(1852.0, "m"), "nm nmi"),
    (Conversion(1.0, "m/s"), "m/s mps m/sec ms-1 m_s meter/second meters/second metre/second metres/second"),
    (Conversion(FOOT, "m/s"), "ft/s fps ft/sec feet/second foot/second ft_s"),
    (Conversion(FOOT / 60.0, "m/s"), "ft/min fpm feet/minute feet/min ft_min"),
    (Conversion(1.0 / 3.6, "m/s"), "km/h kmh kph kmph km/hr km_h"),
    (Conversion(1852.0 / 3600.0, "m/s"), "kt kts kn knot knots ktas kias kcas ktgs"),
    (Conversion(0.01, "m/s"), "cm/s"),
    (Conversion(0.44704, "m/s"), "mph mi/h miles/hour"),
    (Conversion(1.0, "rad"), "rad radian radians rads"),
    (Conversion(DEGREE, "rad"), "deg degree degrees degs"),
    (Conversion(1e-3, "rad"), "mrad"),
    (Conversion(1.0, "rad/s"), "rad/s rad/sec radians/second rps rad_s"),
    (Conversion(DEGREE, "rad/s"), "deg/s deg/sec degree/second degrees/second degs/s dps deg_s"),
    (Conversion(2.0 * math.pi / 60.0, "rad/s"), "rpm rev/min"),
    (Conversion(1.0, "rad/s^2"), "rad/s2 rad/sec2"),
    (Conversion(DEGREE, "rad/s^2"), "deg/s2 deg/sec2"),
    (Conversion(1.0, "m/s^2"), "m/s2 m/s/s m/sec2 mps2 m_s2"),
    (Conversion(G, "m/s^2"), "g gs g0"),
    (Conversion(FOOT, "m/s^2"), "ft/s2 ft/sec2"),
    (Conversion(1.0, "Pa"), "pa pascal pascals n/m2"),
    (Conversion(100.0, "Pa"), "hpa mbar mb millibar millibars hectopascal"),
    (Conversion(1000.0, "Pa"), "kpa kilopascal"),
    (Conversion(1e5, "Pa"), "bar"),
    (Conversion(3386.389, "Pa"), "inhg in_hg inch_hg"),
    (Conversion(PSI, "Pa"), "psi psia psid lbf/in2"),
    (Conversion(PSI / 144.0, "Pa"), "psf lbf/ft2"),
    (Conversion(1.0, "K"), "k kelvin degk deg_k"),
    (Conversion(1.0, "K", 273.15), "degc c celsius deg_c degrees_c degrees_celsius"),
    (Conversion(5.0 / 9.0, "K", 459.67 * 5.0 / 9.0), "degf f fahrenheit deg_f degrees_f degrees_fahrenheit"),
    (Conversion(1.0, "N"), "n newton newtons"),
    (Conversion(POUND * G, "N"), "lbf pound_force"),
    (Conversion(1.0, "kg"), "kg kilogram kilograms"),
    (Conversion(POUND, "kg"), "lb lbs pound pounds"),
    (Conversion(1.0, "kg/s"), "kg/s kg/sec"),
    (Conversion(POUND / 3600.0, "kg/s"), "lb/h lbs/h lb/hr lbs/hr pph"),
    (Conversion(1.0 / 3600.0, "kg/s"), "kg/h kg/hr"),
    (Conversion(1.0, "Hz"), "hz hertz"),
    (Conversion(1.0, "V"), "v volt volts"),
    (Conversion(1.0, "A"), "a amp ampere amps"),
)
CASE_MATTERS = {"kN": Conversion(1000.0, "N"), "MPa": Conversion(1e6, "Pa"), "mPa": Conversion(1e-3, "Pa")}
BY_SPELLING = {spelling: conversion for conversion, spellings in CONVERSIONS for spelling in spellings.split()}
# "5kt", "1.5e1 ft", "0.01 1/s", "0.01/s": a number and a unit, which begins with no digit but that of "1/".
AMOUNT = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>(?:(?<=\s)1\s*/|[^\d\s.]).*)")
# "deg/s" is the rate of "deg", "1/s^2" that of "1/s^1".
RATE = re.compile(r"(?P<of>.+?)\s*/\s*s(?:ec)?(?:\^?(?P<power>[1-9]))?")
RESPELL = str.maketrans({"°": "deg", "º": "deg", "µ": "u", "μ": "u", "²": "2", "·": ".", "⁻": "-", "¹": "1"})


def to_si(values: ArrayLike, unit: str, *, where: str = "unit") -> tuple[FloatArray, str]:
    """Convert values to SI units and radians.

    Parameters
    ----------
    values : any shape.
    unit : as people write it ("kt", "deg/s", "°C", "ft/min"); "" leaves the values alone.
    where : start of the error message.

    Returns
    -------
    The converted copy, exactly equal to `values` where the unit is SI already, and its SI unit ("" for "").

    Raises
    ------
    LogError : the unit is not known.
    """
    array = np.array(values, dtype=np.float64)
    if not unit.strip():
        return array, ""
    conversion = conversion_of(unit, where)
    if conversion.factor != 1.0:
        array *= conversion.factor
    if conversion.offset:
        array += conversion.offset
    return array, conversion.si


def conversion_of(unit: str, where: str = "unit", *, stated: str | None = None) -> Conversion:
    """Return the conversion of a unit.

    Parameters
    ----------
    where : start of the error message; stated : the unit that it names.

    Raises
    ------
    LogError : the unit is not known.
    """
    conversion = _conversion(unit)
    if conversion is None:
        close = difflib.get_close_matches(_plain(stated or unit), BY_SPELLING, n=1, cutoff=0.6)
        hint = f"did you mean '{close[0]}'?" if close else "give an SI unit, or one like kt, ft, deg, degC, hPa, g"
        raise LogError(f"{where}: unknown unit '{stated or unit}'; {hint}")
    return conversion


def change_in_si(text: str) -> tuple[float, str]:
    """Return a difference with its unit, "5kt", "0.5 kt/s", "0.01 1/s" or "2 degC", in SI, and its SI unit.

    Offsets, as that of degC, do not apply. Rates of any known unit are known, and rates of these, "m/s^3".

    Raises
    ------
    ValueError : the text is no number with a unit.
    LogError : the unit is not known.
    """
    amount = AMOUNT.fullmatch(text.strip())
    if amount is None:
        raise ValueError(text)
    unit, rates = amount["unit"].strip(), 0
    stem = f"1{unit}" if unit.startswith("/") else unit
    while _conversion(stem) is None and (rate := RATE.fullmatch(stem.translate(RESPELL))) is not None:
        power = int(rate["power"] or 1)
        stem = f"{rate['of'].strip()}/s^{power - 1}" if power > 1 else rate["of"].strip()
        rates += 1
    conversion = conversion_of(stem, stated=unit)
    si = conversion.si
    for _ in range(rates):
        si = per_second(si)
    return conversion.factor * float(amount["number"]), si


def per_second(unit: str) -> str:
    """Return the unit of the rate of a quantity in `unit`: "m/s^2" for "m/s", "1/s" for ""."""
    stem, power = split_rates(unit or "1")
    return f"{stem}/s" if not power else f"{stem}/s^{power + 1}"


def split_rates(unit: str) -> tuple[str, int]:
    """Return an SI unit without its divisions by seconds, and how many these are: ("m", 2) for "m/s^2"."""
    rate = re.fullmatch(r"(.+?)/s(?:\^(\d+))?", unit)
    return (unit, 0) if rate is None else (rate[1], int(rate[2] or 1))


def si_unit(unit: str) -> str | None:
    """Return the SI unit a spelling converts to, None where it is not known."""
    conversion = _conversion(unit)
    return None if conversion is None else conversion.si


def _conversion(unit: str) -> Conversion | None:
    stripped = unit.strip().strip("[]()<>").strip()
    if stripped in CASE_MATTERS:
        return CASE_MATTERS[stripped]
    plain = _plain(stripped)
    return BY_SPELLING.get(plain) or BY_SPELLING.get(plain.replace("_", ""))


def _plain(unit: str) -> str:
    """Lower-case spelling with one sign for "per", no sign for "to the power of" and "_" for a blank."""
    text = unit.translate(RESPELL).lower().strip()
    text = re.sub(r"(?:\s+|_)per(?:\s+|_)", "/", text)
    text = re.sub(r"(\*\*|\^)(?=-?\d)", "", text)
    text = re.sub(r"(?<=[a-z])[ .*]s-(?=[12])", "/s", text)
    text = re.sub(r"/s1$", "/s", text)
    return re.sub(r"\s+", "" if "/" in text else "_", text)
