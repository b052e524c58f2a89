"""Logs of many messages, each with a separate clock: which of their fields are channels, and under which names.

One table serves every such recorder. `scale * value + offset` of a field is the channel in the unit of the table, with
the signs and conventions of `bfi_cli.channels`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..channels import REPEATED, STANDARD
from ..errors import LogError
from ..notes import Note
from ..units import DEGREE, G
from .raw import Asked, FloatArray, RawLog, Track

Recorder = Literal["px4", "ardupilot", "mavlink", "garmin"]
RECORDERS: dict[Recorder, str] = {"px4": "PX4", "ardupilot": "ArduPilot", "mavlink": "MAVLink", "garmin": "Garmin"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Topic:
    """The messages of one kind: times in seconds, and (n_messages,) values of each field in the recorder's unit.

    Attributes
    ----------
    name : of the kind; instance : number of the sensor that sent the messages, 0 for the first.
    boot : (n_messages,) number of restarts of the recorder's clock before each message, None where there is none.
    """

    name: str
    instance: int
    time_s: FloatArray
    fields: Mapping[str, NDArray[np.number]]
    boot: NDArray[np.intp] | None = None

    def part(self, keep: NDArray[np.bool_]) -> Topic:
        """Return the messages where `keep` is true."""
        fields = {name: values[keep] for name, values in self.fields.items()}
        boot = None if self.boot is None else self.boot[keep]
        return replace(self, time_s=self.time_s[keep], fields=fields, boot=boot)

    @property
    def label(self) -> str:
        """The prefix of a field's name: "airspeed", "airspeed_1" for the second sensor."""
        return self.name if self.instance == 0 else f"{self.name}_{self.instance}"


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """A field of a topic that is a standard channel: `scale * value + offset` is it, in `unit`."""

    topic: str
    field: str
    channel: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


# A line with the recorder, then lines of topic.field, channel, unit, and scale and offset if they are not 1 and 0.
# Of several sources of a channel the first as fast as the log's time base is used, see `rates.one_base`.
# PX4: message definitions of PX4-Autopilot (msg/*.msg), 1.9 to 1.15. Body axes are forward, right, down. The control of
# pitch is positive nose up, an elevator positive trailing edge down.
# ArduPilot: messages of ArduPlane 3.9 to 4.5 (LogStructure.h). Angles of ATT are degrees, their scale makes them rad.
# Commands of AETR run to 4500, positive nose up.
# MAVLink: common.xml; the airspeed of VFR_HUD is the indicated one of a fixed wing, accelerations are in 1e-3 g.
# Garmin G1000 and G3X: the names of their columns; the first of the table that a log has is the channel. NormAc is the
# load factor less one, 0 in level flight. TRK is magnetic in a G1000: on two flights of a Cessna 172 the direction of
# the positions less TRK is MagVar within 0.1 degree. AltB is by the setting BaroA.
_TABLE = f"""
px4
airspeed_validated.true_airspeed_m_s          tas               m/s
airspeed.true_airspeed_m_s                    tas               m/s
airspeed_validated.calibrated_airspeed_m_s    cas               m/s
airspeed_validated.equivalent_airspeed_m_s    cas               m/s
airspeed_validated.indicated_airspeed_m_s     ias               m/s
airspeed.indicated_airspeed_m_s               ias               m/s
airspeed_validated.airspeed_sensor_measurement_valid  valid_airspeed  1
differential_pressure.differential_pressure_pa           q_impact  Pa
differential_pressure.differential_pressure_filtered_pa  q_impact  Pa
vtol_vehicle_status.hover                     hover             1
vehicle_status.hover                          hover             1
vehicle_air_data.baro_alt_meter               baro_altitude     m
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
vehicle_local_position.vz                     gps_altitude_rate  m/s    -1
vehicle_gps_position.vel_n_m_s                velocity_north    m/s
vehicle_gps_position.vel_e_m_s                velocity_east     m/s
vehicle_gps_position.vel_d_m_s                gps_altitude_rate  m/s    -1
vehicle_gps_position.vel_m_s                  ground_speed      m/s
vehicle_gps_position.altitude_msl_m           gps_altitude      m
vehicle_gps_position.alt                      gps_altitude      m       1e-3
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
BARO.Alt            baro_altitude     m
BARO.Press          p_static          Pa
GPS.VelN            velocity_north    m/s
GPS.VelE            velocity_east     m/s
GPS.Spd             ground_speed      m/s
GPS.Lat             latitude          deg
GPS.Lng             longitude         deg
GPS.Alt             gps_altitude      m
GPS.VZ              gps_altitude_rate  m/s    -1
XKF1.VN             velocity_north    m/s
XKF1.VE             velocity_east     m/s
XKF1.VD             gps_altitude_rate  m/s    -1
NKF1.VN             velocity_north    m/s
NKF1.VE             velocity_east     m/s
NKF1.VD             gps_altitude_rate  m/s    -1
XKF2.VWN            wind_north        m/s
XKF2.VWE            wind_east         m/s
NKF2.VWN            wind_north        m/s
NKF2.VWE            wind_east         m/s
AOA.AOA             aoa               deg
AOA.SSA             sideslip          deg
QTUN.hover          hover             1
AETR.Ail            aileron           1       {1 / 4500}
AETR.Elev           elevator          1       {-1 / 4500}
AETR.Rudd           rudder            1       {1 / 4500}
AETR.Thr            throttle          1       0.01
mavlink
VFR_HUD.airspeed           ias               m/s
VFR_HUD.groundspeed        ground_speed      m/s
VFR_HUD.throttle           throttle          1       0.01
EXTENDED_SYS_STATE.hover   hover             1
HEARTBEAT.hover            hover             1
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
LOCAL_POSITION_NED.vz      gps_altitude_rate  m/s    -1
GLOBAL_POSITION_INT.vx     velocity_north    m/s     0.01
GLOBAL_POSITION_INT.vy     velocity_east     m/s     0.01
GLOBAL_POSITION_INT.vz     gps_altitude_rate  m/s    -0.01
GLOBAL_POSITION_INT.alt    gps_altitude      m       1e-3
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
csv.AltB       baro_altitude  ft
csv.AltInd     baro_altitude  ft
csv.BaroA      baro_setting   inHg
csv.Baro       baro_setting   inHg
csv.AltMSL     gps_altitude   ft
csv.AltGPS     gps_altitude   ft
csv.RALT       radio_altitude  ft
csv.VSpd       altitude_rate  ft/min
csv.VSpdG      gps_altitude_rate  ft/min
csv.TRK        magnetic_track  deg
csv.MagVar     magnetic_variation  deg
csv.Pitch      pitch          deg
csv.Roll       roll           deg
csv.HDG        yaw            deg
csv.LatAc      lateral_acc    g
csv.NormAc     normal_acc     g
csv.OAT        sat            degC
csv.Latitude   latitude       deg
csv.Longitude  longitude      deg
"""


# Quantities whose topics have an instance for each sensor; instances of attitude and climb are cores of one estimator.
SENSED = frozenset(REPEATED) - {"pitch", "roll", "yaw", "altitude_rate", "gps_altitude_rate"}
_MAPS: dict[str, list[ChannelMap]] = {}
for _line in _TABLE.strip().splitlines():
    _place, *_words = _line.split()
    if not _words:
        _rows = _MAPS.setdefault(_place, [])
        continue
    _channel, _unit, *_numbers = _words
    _topic, _, _field = _place.partition(".")
    _rows.append(ChannelMap(_topic, _field, _channel, _unit, *map(float, _numbers)))


def maps_of(recorder: Recorder) -> tuple[ChannelMap, ...]:
    """Return the fields of a recorder that are standard channels, the better source of a channel first."""
    return tuple(_MAPS[recorder])


def fields_of(recorder: Recorder) -> dict[str, tuple[str, ...]]:
    """Return the fields to read of a recorder's topics, by topic."""
    fields: dict[str, tuple[str, ...]] = {}
    for row in _MAPS[recorder]:
        fields[row.topic] = (*fields.get(row.topic, ()), row.field)
    return fields


def topics_of(sources: Iterable[str]) -> set[str]:
    """Return the topics of fields `topic.field`, each also without the number of a sensor behind its name."""
    labels = {source.partition(".")[0] for source in sources if "." in source}
    return labels | {re.sub(r"_\d+$", "", label) for label in labels}


def notes_on(damaged: int, empty: Sequence[str] = ()) -> list[Note]:
    """Return the notes on a file with `damaged` bytes and `empty` topics, none where it has neither."""
    notes = [Note.limit(f"{damaged} bytes are damaged or cut off and were skipped")] if damaged else []
    if empty:
        notes.append(Note.method(f"topics without samples are left out: {', '.join(dict.fromkeys(empty))}"))
    return notes


def completed(topic: Topic) -> Topic:
    """Return a topic with further fields that follow from its fields.

    `roll`, `pitch` and `yaw`, rad, sequence 3-2-1, from the quaternion `q[0..3]`, scalar first, body to
    north-east-down; `VelN` and `VelE` from the speed `Spd` on the course `GCrs`, degrees from north; `hover` from the
    state of a VTOL.
    """
    made: dict[str, NDArray[np.number]] = {}
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        if all(f"q[{i}]" in topic.fields for i in range(4)):
            q = np.array([topic.fields[f"q[{i}]"] for i in range(4)], dtype=np.float64)
            w, x, y, z = q / np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
            made |= {
                "roll": np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2)),
                "pitch": np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
                "yaw": np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)),
            }
        if {"Spd", "GCrs"} <= topic.fields.keys():
            course = DEGREE * np.asarray(topic.fields["GCrs"], dtype=np.float64)
            made |= {"VelN": topic.fields["Spd"] * np.cos(course), "VelE": topic.fields["Spd"] * np.sin(course)}
        hover = _hover_of(topic)
        if hover is not None and hover.any():
            made["hover"] = hover
    return replace(topic, fields={**topic.fields, **made})


def _hover_of(topic: Topic) -> FloatArray | None:
    """Return (n_messages,) 1 where the rotors of a VTOL carry it, 0.5 in transition, else 0; None where nothing tells.

    PX4: `vehicle_vtol_state` (1.14 on) and `vtol_state` of MAVLink are MAV_VTOL_STATE: 1 and 2 transition, 3 hover,
    4 flight on the wing; before, two flags; a `vehicle_type` of 1 is one carried by rotors. ArduPlane: modes 17 to 23
    (QSTABILIZE to QACRO); a quadplane writes QTUN while its rotors carry it, and only then.
    """
    fields = topic.fields
    for name in ("vehicle_vtol_state", "vtol_state"):
        if name in fields:
            return np.select([fields[name] == 3, np.isin(fields[name], (1, 2))], [1.0, 0.5], 0.0)
    for hovers, changes in (("vtol_in_rw_mode", "vtol_in_trans_mode"), ("vehicle_type", "in_transition_mode")):
        if {hovers, changes} <= fields.keys():
            is_vtol = fields.get("is_vtol", np.ones(1)) != 0
            return np.where(is_vtol, np.select([fields[changes] != 0, fields[hovers] == 1], [0.5, 1.0], 0.0), 0.0)
    if {"custom_mode", "type", "autopilot"} <= fields.keys():
        is_plane = (fields["autopilot"] == 3) & np.isin(fields["type"], (1, *range(19, 26)))
        return np.where(is_plane & (fields["custom_mode"] >= 17) & (fields["custom_mode"] <= 23), 1.0, 0.0)
    return np.ones(topic.time_s.size) if topic.name == "QTUN" else None


def tracks_of(recorder: Recorder, topics: Sequence[Topic], wanted: Sequence[str]) -> list[Track]:
    """Return the signals of a log; of several sources of a channel the preferred comes first.

    The second sensor of `tas` is `tas_2`.

    Parameters
    ----------
    wanted : further fields, as `topic.field`, that become signals under that name.
    """

    def mapped() -> Iterator[Track]:
        for row in _MAPS[recorder]:
            sources = [topic for topic in topics if topic.name == row.topic and row.field in topic.fields]
            for number, topic in enumerate(sorted(sources, key=lambda topic: topic.instance), start=1):
                further = f"{row.channel}_{number}"
                is_sensor = number > 1 and row.channel in SENSED and further in STANDARD
                with np.errstate(over="ignore", invalid="ignore"):
                    values = row.scale * np.asarray(topic.fields[row.field], dtype=np.float64) + row.offset
                yield Track(
                    source=f"{topic.label}.{row.field}",
                    channel=further if is_sensor else row.channel,
                    unit=row.unit,
                    time_s=topic.time_s,
                    values=values,
                )

    tracks = list(mapped())
    have = {track.source for track in tracks}
    for topic in topics:
        for name, values in topic.fields.items():
            source = f"{topic.label}.{name}"
            if source in wanted and source not in have:
                tracks.append(Track(source=source, time_s=topic.time_s, values=np.asarray(values, dtype=np.float64)))
    return tracks


def log_of_topics(
    path: str,
    recorder: Recorder,
    topics: Sequence[Topic],
    asked: Asked,
    *,
    more: Sequence[str] = (),
    notes: Sequence[Note] = (),
) -> RawLog:
    """Return the log of a recorder whose messages have separate clocks.

    Parameters
    ----------
    more : fields, as `topic.field`, that become signals beside the channels and the fields in `asked`.
    notes : on the topics.

    Raises
    ------
    LogError : no signals.
    """
    parts = [topics]
    boots = sorted({int(k) for topic in topics if topic.boot is not None for k in np.unique(topic.boot)})
    if len(boots) > 1:
        parts = [[t if t.boot is None else t.part(t.boot == boot) for t in topics] for boot in boots]
        parts = [[topic for topic in part if topic.time_s.size > 1] for part in parts]
    wanted = (*asked.sources, *more)
    tracks = [tracks_of(recorder, [completed(topic) for topic in part], wanted) for part in parts]
    logs = [RawLog(columns=columns, notes=tuple(notes)) for columns in tracks if columns]
    if not logs:
        has = ", ".join(topic.label for topic in topics) or "none"
        raise LogError(f"{path}: no channels in its messages ({has}); give a log that was recorded in flight")
    return logs[0] if len(parts) == 1 else replace(logs[0], boots=tuple(logs))
