"""Logs of many messages, each with its own clock: which of their fields are channels, and under which names.

One table serves every such recorder. A field is `scale * value + offset` in the unit of the table, which turns the
recorder's signs and conventions into those of `bfi_cli.channels`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..units import DEGREE, G

FloatArray = NDArray[np.float64]
Recorder = Literal["px4", "ardupilot", "mavlink", "garmin"]
RECORDERS: dict[Recorder, str] = {"px4": "PX4", "ardupilot": "ArduPilot", "mavlink": "MAVLink", "garmin": "Garmin"}
# Angles that leave one end of their range and come back at the other.
ANGLES = frozenset({"roll", "yaw"})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Topic:
    """The messages of one kind: times in seconds, and (n_messages,) values of each field in the recorder's unit.

    Attributes
    ----------
    name : of the kind; instance : which of several sensors of the kind sent them, 0 for the first.
    boot : (n_messages,) how often the recorder's clock had started again before each, None where it never does.
    """

    name: str
    instance: int
    time_s: FloatArray
    fields: Mapping[str, NDArray[np.number]]
    boot: NDArray[np.intp] | None = None

    def of_boot(self, number: int) -> Topic:
        """Return the messages of one boot."""
        if self.boot is None:
            return self
        own = self.boot == number
        fields = {name: values[own] for name, values in self.fields.items()}
        return replace(self, time_s=self.time_s[own], fields=fields, boot=None)

    @property
    def label(self) -> str:
        """What stands before a field's name: "airspeed", "airspeed_1" for the second sensor."""
        return self.name if self.instance == 0 else f"{self.name}_{self.instance}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelMap:
    """A field of a topic that is a standard channel: `scale * value + offset` is it, in `unit`.

    Attributes
    ----------
    is_state : values between two messages are those of the earlier one, and nothing is filtered (flags).
    """

    topic: str
    field: str
    channel: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    is_state: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """One signal with its own times: `channel` is the standard name it has a claim on, None for none.

    Attributes
    ----------
    turn : of an angle that leaves one end of its range and comes back at the other: a full turn in its unit.
    """

    source: str
    channel: str | None
    unit: str | None
    time_s: FloatArray
    values: FloatArray
    is_state: bool = False
    turn: float | None = None


# Recorder, then topic.field, channel, unit, and where they are not 1 and 0 scale and offset; "state" for flags.
# Of several sources of a channel the first that is as fast as the log's base is taken, see `rates.one_base`.
# PX4: message definitions of PX4-Autopilot (msg/*.msg), 1.9 to 1.15. Body axes are forward, right, down. The control of
# pitch is positive nose up, an elevator positive trailing edge down.
# ArduPilot: messages of ArduPlane 3.9 to 4.5 (LogStructure.h). Angles of ATT are degrees, their scale makes them rad.
# Commands of AETR run to 4500, positive nose up.
# MAVLink: common.xml; the airspeed of VFR_HUD is the indicated one of a fixed wing, accelerations are in 1e-3 g.
# Garmin G1000 and G3X: the names of their columns; the first of the table that a log has is the channel. NormAc is the
# load factor less one, 0 in level flight.
_TABLE = f"""
px4
airspeed_validated.true_airspeed_m_s          tas               m/s
airspeed.true_airspeed_m_s                    tas               m/s
airspeed_validated.calibrated_airspeed_m_s    cas               m/s
airspeed_validated.equivalent_airspeed_m_s    cas               m/s
airspeed_validated.indicated_airspeed_m_s     ias               m/s
airspeed.indicated_airspeed_m_s               ias               m/s
airspeed_validated.airspeed_sensor_measurement_valid  valid_airspeed  1  1  0  state
differential_pressure.differential_pressure_pa           q_impact  Pa
differential_pressure.differential_pressure_filtered_pa  q_impact  Pa
vehicle_air_data.baro_alt_meter               altitude          m
vehicle_air_data.baro_pressure_pa             p_static          Pa
vehicle_attitude.pitch                        pitch             rad
vehicle_attitude.roll                         roll              rad
vehicle_attitude.yaw                          yaw               rad
vehicle_angular_velocity.xyz[0]               roll_rate         rad/s
vehicle_angular_velocity.xyz[1]               pitch_rate        rad/s
vehicle_angular_velocity.xyz[2]               yaw_rate          rad/s
sensor_combined.gyro_rad[0]                   roll_rate         rad/s
sensor_combined.gyro_rad[1]                   pitch_rate        rad/s
sensor_combined.gyro_rad[2]                   yaw_rate          rad/s
vehicle_acceleration.xyz[0]                   longitudinal_acc  m/s^2
vehicle_acceleration.xyz[1]                   lateral_acc       m/s^2
vehicle_acceleration.xyz[2]                   normal_acc        m/s^2   -1  {-G}
sensor_combined.accelerometer_m_s2[0]         longitudinal_acc  m/s^2
sensor_combined.accelerometer_m_s2[1]         lateral_acc       m/s^2
sensor_combined.accelerometer_m_s2[2]         normal_acc        m/s^2   -1  {-G}
vehicle_local_position.vx                     velocity_north    m/s
vehicle_local_position.vy                     velocity_east     m/s
vehicle_local_position.vz                     altitude_rate     m/s     -1
vehicle_gps_position.vel_n_m_s                velocity_north    m/s
vehicle_gps_position.vel_e_m_s                velocity_east     m/s
vehicle_gps_position.vel_m_s                  ground_speed      m/s
vehicle_gps_position.latitude_deg             latitude          deg
vehicle_gps_position.longitude_deg            longitude         deg
vehicle_gps_position.lat                      latitude          deg     1e-7
vehicle_gps_position.lon                      longitude         deg     1e-7
airspeed_wind.windspeed_north                 wind_north        m/s
airspeed_wind.windspeed_east                  wind_east         m/s
wind.windspeed_north                          wind_north        m/s
wind.windspeed_east                           wind_east         m/s
wind_estimate.windspeed_north                 wind_north        m/s
wind_estimate.windspeed_east                  wind_east         m/s
actuator_controls_0.control[0]                aileron           1
actuator_controls_0.control[1]                elevator          1       -1
actuator_controls_0.control[2]                rudder            1
actuator_controls_0.control[3]                throttle          1
vehicle_torque_setpoint.xyz[0]                aileron           1
vehicle_torque_setpoint.xyz[1]                elevator          1       -1
vehicle_torque_setpoint.xyz[2]                rudder            1
vehicle_thrust_setpoint.xyz[0]                throttle          1
ardupilot
ARSP.Airspeed       ias               m/s
ARSP.DiffPress      q_impact          Pa
ATT.Pitch           pitch             rad     {DEGREE}
ATT.Roll            roll              rad     {DEGREE}
ATT.Yaw             yaw               rad     {DEGREE}
IMU.GyrX            roll_rate         rad/s
IMU.GyrY            pitch_rate        rad/s
IMU.GyrZ            yaw_rate          rad/s
IMU.AccX            longitudinal_acc  m/s^2
IMU.AccY            lateral_acc       m/s^2
IMU.AccZ            normal_acc        m/s^2   -1  {-G}
BARO.Alt            altitude          m
BARO.Press          p_static          Pa
GPS.VelN            velocity_north    m/s
GPS.VelE            velocity_east     m/s
GPS.Spd             ground_speed      m/s
GPS.Lat             latitude          deg
GPS.Lng             longitude         deg
XKF1.VN             velocity_north    m/s
XKF1.VE             velocity_east     m/s
XKF1.VD             altitude_rate     m/s     -1
NKF1.VN             velocity_north    m/s
NKF1.VE             velocity_east     m/s
NKF1.VD             altitude_rate     m/s     -1
XKF2.VWN            wind_north        m/s
XKF2.VWE            wind_east         m/s
NKF2.VWN            wind_north        m/s
NKF2.VWE            wind_east         m/s
AOA.AOA             aoa               deg
AOA.SSA             sideslip          deg
AETR.Ail            aileron           1       {1 / 4500}
AETR.Elev           elevator          1       {-1 / 4500}
AETR.Rudd           rudder            1       {1 / 4500}
AETR.Thr            throttle          1       0.01
mavlink
VFR_HUD.airspeed           ias               m/s
VFR_HUD.groundspeed        ground_speed      m/s
VFR_HUD.throttle           throttle          1       0.01
ATTITUDE.pitch             pitch             rad
ATTITUDE.roll              roll              rad
ATTITUDE.yaw               yaw               rad
ATTITUDE.rollspeed         roll_rate         rad/s
ATTITUDE.pitchspeed        pitch_rate        rad/s
ATTITUDE.yawspeed          yaw_rate          rad/s
SCALED_IMU.xacc            longitudinal_acc  m/s^2   {1e-3 * G}
SCALED_IMU.yacc            lateral_acc       m/s^2   {1e-3 * G}
SCALED_IMU.zacc            normal_acc        m/s^2   {-1e-3 * G}  {-G}
LOCAL_POSITION_NED.vx      velocity_north    m/s
LOCAL_POSITION_NED.vy      velocity_east     m/s
LOCAL_POSITION_NED.vz      altitude_rate     m/s     -1
GLOBAL_POSITION_INT.vx     velocity_north    m/s     0.01
GLOBAL_POSITION_INT.vy     velocity_east     m/s     0.01
GLOBAL_POSITION_INT.vz     altitude_rate     m/s     -0.01
GLOBAL_POSITION_INT.lat    latitude          deg     1e-7
GLOBAL_POSITION_INT.lon    longitude         deg     1e-7
SCALED_PRESSURE.press_abs  p_static          hPa
SCALED_PRESSURE.press_diff  q_impact         hPa
AOA_SSA.AOA                aoa               deg
AOA_SSA.SSA                sideslip          deg
garmin
csv.TAS        tas            kt
csv.IAS        ias            kt
csv.GndSpd     ground_speed   kt
csv.AltP       altitude       ft
csv.AltB       altitude       ft
csv.AltInd     altitude       ft
csv.VSpd       altitude_rate  ft/min
csv.Pitch      pitch          deg
csv.Roll       roll           deg
csv.HDG        yaw            deg
csv.LatAc      lateral_acc    g
csv.NormAc     normal_acc     g
csv.OAT        sat            degC
csv.Latitude   latitude       deg
csv.Longitude  longitude      deg
"""


def _maps() -> dict[str, tuple[ChannelMap, ...]]:
    maps: dict[str, list[ChannelMap]] = {}
    for line in _TABLE.strip().splitlines():
        words = line.split()
        if len(words) == 1:
            rows = maps.setdefault(words[0], [])
            continue
        (topic, _, name), channel, unit = words[0].partition("."), words[1], words[2]
        numbers = [float(word) for word in words[3:5]]
        rows.append(
            ChannelMap(
                topic=topic,
                field=name,
                channel=channel,
                unit=unit,
                scale=numbers[0] if numbers else 1.0,
                offset=numbers[1] if len(numbers) > 1 else 0.0,
                is_state="state" in words,
            )
        )
    return {recorder: tuple(rows) for recorder, rows in maps.items()}


_MAPS = _maps()


def maps_of(recorder: Recorder) -> tuple[ChannelMap, ...]:
    """Return the fields of a recorder that are standard channels, the better source of a channel first."""
    return _MAPS[recorder]


def fields_of(recorder: Recorder) -> dict[str, tuple[str, ...]]:
    """Return the fields to read of a recorder's topics, by topic."""
    fields: dict[str, tuple[str, ...]] = {}
    for row in maps_of(recorder):
        fields[row.topic] = (*fields.get(row.topic, ()), row.field)
    return fields


def with_angles(topic: Topic) -> Topic:
    """Return a topic that holds a quaternion `q[0..3]` (scalar first, body to north-east-down) with its Euler angles.

    The fields `roll`, `pitch` and `yaw` are in rad, by the sequence 3-2-1; other topics come back as they are.
    """
    if not all(f"q[{i}]" in topic.fields for i in range(4)):
        return topic
    w, x, y, z = (np.asarray(topic.fields[f"q[{i}]"], dtype=np.float64) for i in range(4))
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.sqrt(w**2 + x**2 + y**2 + z**2)
        w, x, y, z = w / size, x / size, y / size, z / size
        angles = {
            "roll": np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2)),
            "pitch": np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            "yaw": np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)),
        }
    return replace(topic, fields={**topic.fields, **angles})


def with_ground_velocity(topic: Topic) -> Topic:
    """Return a topic that holds speed `Spd` and course `GCrs` (degrees from north) with `VelN` and `VelE`."""
    if not {"Spd", "GCrs"} <= topic.fields.keys():
        return topic
    speed, course = topic.fields["Spd"], DEGREE * np.asarray(topic.fields["GCrs"], dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        velocity = {"VelN": speed * np.cos(course), "VelE": speed * np.sin(course)}
    return replace(topic, fields={**topic.fields, **velocity})


def tracks_of(recorder: Recorder, topics: Sequence[Topic], wanted: Sequence[str]) -> list[Track]:
    """Return the signals of a log, the ones with the first claim on a channel first.

    Parameters
    ----------
    wanted : further fields, as `topic.field`, that become signals under that name.
    """
    tracks = list(_mapped(recorder, topics))
    have = {track.source for track in tracks}
    for topic in topics:
        for name, values in topic.fields.items():
            source = f"{topic.label}.{name}"
            if source in wanted and source not in have:
                tracks.append(
                    Track(source=source, channel=None, unit=None, time_s=topic.time_s, values=np.asarray(values, float))
                )
    return tracks


def _mapped(recorder: Recorder, topics: Sequence[Topic]) -> Iterator[Track]:
    for row in maps_of(recorder):
        for topic in sorted((one for one in topics if one.name == row.topic), key=lambda one: one.instance):
            if row.field in topic.fields:
                with np.errstate(over="ignore", invalid="ignore"):
                    values = row.scale * np.asarray(topic.fields[row.field], dtype=np.float64) + row.offset
                yield Track(
                    source=f"{topic.label}.{row.field}",
                    channel=row.channel,
                    unit=row.unit,
                    time_s=topic.time_s,
                    values=values,
                    is_state=row.is_state,
                    turn=2.0 * math.pi if row.channel in ANGLES else None,
                )
