"""Which fields of a recorder's messages, or columns of its tables, are channels, and under which names.

One table serves every recorder, those whose messages have separate clocks and those that write tables (`layouts`).
`scale * value + offset` of a field is the channel in the unit of the table, with the signs and conventions of
`bfi_cli.quantities.channels`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..epoch import Epoch, epoch_of_clock, utc_of_gps
from ..errors import LogError
from ..notes import Note
from ..quantities.channels import REPEATED, STANDARD
from ..quantities.units import DEGREE, G
from .raw import Asked, FloatArray, RawLog, Track

Recorder = Literal[
    "px4", "ardupilot", "mavlink", "garmin", "dynon", "xplane", "inav", "flightgear", "igc", "dashlink", "sidpac"
]
RECORDERS: dict[Recorder, str] = {
    "px4": "PX4",
    "ardupilot": "ArduPilot",
    "mavlink": "MAVLink",
    "garmin": "Garmin",
    "dynon": "Dynon SkyView",
    "xplane": "X-Plane",
    "inav": "INAV blackbox",
    "flightgear": "FlightGear",
    "igc": "IGC",
    "dashlink": "DASHlink",
    "sidpac": "SIDPAC",
}


# Fields that hold UTC: microseconds since 1970 (PX4, and SYSTEM_TIME of MAVLink), or weeks and ms of GPS (ArduPilot).
UTC = frozenset({"time_utc_usec", "unix_usec", "GWk", "GMS"})


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
    """A field of a topic that is a standard channel: `scale * value + offset` is it, in `unit`.

    `channel` is "" of a field that is none, though another recorder's channel has its name.
    """

    topic: str
    field: str
    channel: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


# A line with the recorder, then lines of topic.field, channel, unit, and scale and offset if they are not 1 and 0.
# The first source of a channel that is as fast as the log's time base is used, see `rates.one_base`.
# PX4: message definitions of PX4-Autopilot (msg/*.msg), 1.9 to 1.15. Body axes are forward, right, down. The control of
# pitch is positive nose up, an elevator positive trailing edge down.
# ArduPilot: messages of ArduPlane 3.9 to 4.5 (LogStructure.h). Angles of ATT are degrees, their scale makes them rad.
# Commands of AETR run to 4500, positive nose up.
# MAVLink: common.xml; the airspeed of VFR_HUD is the indicated one of a fixed wing, accelerations are in 1e-3 g.
# Tables (topic `csv`, `mat` or `B`): the first of the table that a log has is the channel; names are compared by
# `layouts.plain_name`, and the unit is that of the file where the channel can have it, then without the scale but for
# its sign. A channel "-" says that a column is none. Of `normal_acc` the level-flight median tells the convention.
# Garmin G1000, Perspective, NXi, G3X, GDU 460, TXi: short names, and the long ones of G3X. AOA is an index, no angle;
# Flaps are notches. HDG and TRK are magnetic: on two flights of a Cessna 172 with a G1000 the direction of the
# positions less TRK is MagVar within 0.1 degree. The GPS Ground Track of a G3X is true: with a variation of -12.8
# degrees it is that of the positions within 0.5.
# Dynon: SkyView user data logs (SkyView Classic and HDX system installation guide). Its angle of attack is a share.
# X-Plane 10 to 12: Data.txt. Of two clocks the simulated time is that of the flight.
# INAV: Blackbox.md, blackbox.c and osd.c, `blackbox_decode` of blackbox-tools. Body axes are forward, left, up, so that
# pitch and its rate are positive nose down; an acceleration unit is 1/2048 g, the airspeed that of air at sea level.
# FlightGear: paths of the property tree, and names of the protocol `playback`. `airspeed-kt` is the calibrated one,
# body axes are forward, right, down.
# IGC: FAI, Technical Specification for GNSS Flight Recorders, appendix A: km/h, m, degrees, degrees Celsius.
# DASHlink: parameters of NASA's sample flight data of a BAe 146; temperatures state DEG, static pressure IN.
# SIDPAC: `fdata` of Klein and Morelli, Aircraft System Identification: feet, degrees, g.
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
csv.TAS                  tas                 kt
csv.True_Airspeed        tas                 kt
csv.IAS                  ias                 kt
csv.Indicated_Airspeed   ias                 kt
csv.GndSpd               ground_speed        kt
csv.GPS_Ground_Speed     ground_speed        kt
csv.GPSVelN              velocity_north      m/s
csv.GPS_Velocity_N       velocity_north      m/s
csv.GPSVelE              velocity_east       m/s
csv.GPS_Velocity_E       velocity_east       m/s
csv.TRK                  magnetic_track      deg
csv.GPS_Ground_Track     track               deg
csv.MagVar               magnetic_variation  deg
csv.Magnetic_Variation   magnetic_variation  deg
csv.AltP                 altitude            ft
csv.AltPress             altitude            ft
csv.Pressure_Altitude    altitude            ft
csv.AltB                 baro_altitude       ft
csv.AltInd               baro_altitude       ft
csv.Baro_Altitude        baro_altitude       ft
csv.BaroA                baro_setting        inHg
csv.Baro                 baro_setting        inHg
csv.Baro_Setting         baro_setting        inHg
csv.AltMSL               gps_altitude        ft
csv.AltGPS               gps_altitude        ft
csv.GPS_Altitude         gps_altitude        ft
csv.RALT                 radio_altitude      ft
csv.Radar_Altitude       radio_altitude      ft
csv.VSpd                 altitude_rate       ft/min
csv.Vertical_Speed       altitude_rate       ft/min
csv.VSpdG                gps_altitude_rate   ft/min
csv.GPSVelU              gps_altitude_rate   m/s
csv.GPS_Velocity_U       gps_altitude_rate   m/s
csv.Pitch                pitch               deg
csv.Roll                 roll                deg
csv.HDG                  yaw                 deg
csv.Magnetic_Heading     yaw                 deg
csv.LatAc                lateral_acc         g
csv.Lateral_Acceleration  lateral_acc        g
csv.NormAc               normal_acc          g
csv.Normal_Acceleration  normal_acc          g
csv.OAT                  sat                 degC
csv.Outside_Air_Temp     sat                 degC
csv.Latitude             latitude            deg
csv.Longitude            longitude           deg
csv.AOA                  -                   1
csv.AOA_Cp               -                   1
csv.Flaps                -                   1
csv.Flap_Position        -                   1
dynon
csv.Session_Time         time                s
csv.True_Airspeed        tas                 kt
csv.Indicated_Airspeed   ias                 kt
csv.Ground_Speed         ground_speed        kt
csv.Ground_Track         track               deg
csv.Mag_Var              magnetic_variation  deg
csv.Pressure_Altitude    altitude            ft
csv.GPS_Altitude         gps_altitude        ft
csv.Barometer_Setting    baro_setting        inHg
csv.Vertical_Speed       altitude_rate       ft/min
csv.Pitch                pitch               deg
csv.Roll                 roll                deg
csv.Magnetic_Heading     yaw                 deg
csv.Lateral_Accel        lateral_acc         g
csv.Vertical_Accel       normal_acc          g
csv.OAT                  sat                 degC
csv.Latitude             latitude            deg
csv.Longitude            longitude           deg
csv.Angle_of_Attack      -                   %
csv.Turn_Rate            -                   deg/s
xplane
csv.totl_time            time                s
csv.missn_time           time                s
csv.real_time            time                s
csv.Vtrue_ktas           tas                 kt
csv.Vind_kias            ias                 kt
csv.Vtrue_ktgs           ground_speed        kt
csv.Mach_ratio           mach                1
csv.VVI_fpm              altitude_rate       ft/min
csv.p-alt_ftMSL          altitude            ft
csv.alt_ind              baro_altitude       ft
csv.alt_ftmsl            gps_altitude        ft
csv.CG_ftMSL             gps_altitude        ft
csv.alt_ftagl            radio_altitude      ft
csv.gear_ftagl           radio_altitude      ft
csv.pitch_deg            pitch               deg
csv.roll_deg             roll                deg
csv.hding_true           yaw                 deg
csv.hding_mag            yaw                 deg
csv.hpath_true           track               deg
csv.vpath_deg            flight_path_angle   deg
csv.alpha_deg            aoa                 deg
csv.beta_deg             sideslip            deg
csv.Q_rad/s              pitch_rate          rad/s
csv.P_rad/s              roll_rate           rad/s
csv.R_rad/s              yaw_rate            rad/s
csv.Gload_axial          longitudinal_acc    g
csv.Gload_side           lateral_acc         g
csv.Gload_norml          normal_acc          g
csv.AMprs_inHG           p_static            inHg
csv.AMtmp_degC           sat                 degC
csv.lat_deg              latitude            deg
csv.lon_deg              longitude           deg
csv.elev_surf            elevator            1
csv.ailrn_surf           aileron             1
csv.ruddr_surf           rudder              1
csv.thro1_part           throttle            1
inav
csv.time                 time                us
csv.AirSpeed             ias                 cm/s
csv.BaroAlt              baro_altitude       cm
csv.GPS_altitude         gps_altitude        m
csv.GPS_speed            ground_speed        cm/s
csv.GPS_ground_course    track               deg
csv.GPS_velned[0]        velocity_north      cm/s
csv.GPS_velned[1]        velocity_east       cm/s
csv.navVel[0]            velocity_north      cm/s
csv.navVel[1]            velocity_east       cm/s
csv.navVel[2]            altitude_rate       cm/s
csv.GPS_coord[0]         latitude            deg
csv.GPS_coord[1]         longitude           deg
csv.wind[0]              wind_north          cm/s
csv.wind[1]              wind_east           cm/s
csv.attitude[0]          roll                deg     0.1
csv.attitude[1]          pitch               deg    -0.1
csv.attitude[2]          yaw                 deg     0.1
csv.gyroADC[0]           roll_rate           deg/s
csv.gyroADC[1]           pitch_rate          deg/s  -1
csv.gyroADC[2]           yaw_rate            deg/s  -1
csv.accSmooth[0]         longitudinal_acc    g       {1 / 2048}
csv.accSmooth[1]         lateral_acc         g      -{1 / 2048}
csv.accSmooth[2]         normal_acc          g       {1 / 2048}
csv.rcCommand[3]         throttle            1       1e-3  -1
flightgear
csv.Time                                                        time               s
csv./instrumentation/airspeed-indicator/true-speed-kt           tas                kt
csv./fdm/jsbsim/velocities/vtrue-kts                            tas                kt
csv./velocities/airspeed-kt                                     cas                kt
csv./fdm/jsbsim/velocities/vc-kts                               cas                kt
csv./instrumentation/airspeed-indicator/indicated-speed-kt      ias                kt
csv.airspeed-kt                                                 cas                kt
csv.airspeed-indicator_indicated-speed-kt                       ias                kt
csv./velocities/mach                                            mach               1
csv./velocities/groundspeed-kt                                  ground_speed       kt
csv.groundspeed-kt                                              ground_speed       kt
csv.gps_indicated-ground-speed-kt                               ground_speed       kt
csv./velocities/speed-north-fps                                 velocity_north     ft/s
csv./velocities/speed-east-fps                                  velocity_east      ft/s
csv./velocities/vertical-speed-fps                              altitude_rate      ft/s
csv.vertical-speed-fps                                          altitude_rate      ft/s
csv./instrumentation/altimeter/pressure-alt-ft                  altitude           ft
csv.altimeter_pressure-alt-ft                                   altitude           ft
csv./instrumentation/altimeter/indicated-altitude-ft            baro_altitude      ft
csv.altimeter_indicated-altitude-ft                             baro_altitude      ft
csv./instrumentation/altimeter/setting-inhg                     baro_setting       inHg
csv./position/altitude-ft                                       gps_altitude       ft
csv.altitude-ft                                                 gps_altitude       ft
csv./position/altitude-agl-ft                                   radio_altitude     ft
csv./position/latitude-deg                                      latitude           deg
csv./position/longitude-deg                                     longitude          deg
csv.latitude-deg                                                latitude           deg
csv.longitude-deg                                               longitude          deg
csv.pitch-deg                                                   pitch              deg
csv.roll-deg                                                    roll               deg
csv.heading-deg                                                 yaw                deg
csv.side-slip-deg                                               sideslip           deg
csv./orientation/pitch-deg                                      pitch              deg
csv./orientation/roll-deg                                       roll               deg
csv./orientation/heading-deg                                    yaw                deg
csv./orientation/track-deg                                      track              deg
csv./orientation/alpha-deg                                      aoa                deg
csv./orientation/side-slip-deg                                  sideslip           deg
csv./orientation/p-body                                         roll_rate          rad/s
csv./orientation/q-body                                         pitch_rate         rad/s
csv./orientation/r-body                                         yaw_rate           rad/s
csv./accelerations/pilot/x-accel-fps_sec                        longitudinal_acc   ft/s^2
csv./accelerations/pilot/y-accel-fps_sec                        lateral_acc        ft/s^2
csv./accelerations/pilot/z-accel-fps_sec                        normal_acc         ft/s^2
csv./accelerations/nlf                                          normal_acc         g
csv./environment/pressure-inhg                                  p_static           inHg
csv./environment/temperature-degc                               sat                degC
csv./environment/wind-from-north-fps                            wind_north         ft/s   -1
csv./environment/wind-from-east-fps                             wind_east          ft/s   -1
csv./surface-positions/elevator-pos-norm                        elevator           1
csv./surface-positions/rudder-pos-norm                          rudder             1
csv.elevator                                                    elevator           1
csv.rudder                                                      rudder             1
csv.aileron                                                     aileron            1
csv.throttle                                                    throttle           1
csv.flaps                                                       -                  1
csv./controls/engines/engine/throttle                           throttle           1
csv./controls/engines/engine[0]/throttle                        throttle           1
igc
B.pressure_altitude      altitude            m
B.gnss_altitude          gps_altitude        m
B.latitude               latitude            deg
B.longitude              longitude           deg
B.TAS                    tas                 km/h
B.IAS                    ias                 km/h
B.GSP                    ground_speed        km/h
B.TRT                    track               deg
B.TRM                    magnetic_track      deg
B.HDT                    yaw                 deg
B.HDM                    yaw                 deg
B.OAT                    sat                 degC
dashlink
mat.ALT       altitude            ft
mat.BAL1      baro_altitude       ft
mat.RALT      radio_altitude      ft
mat.TAS       tas                 kt
mat.CAS       cas                 kt
mat.MACH      mach                1
mat.GS        ground_speed        kt
mat.TRK       track               deg
mat.TRKM      magnetic_track      deg
mat.ALTR      altitude_rate       ft/min
mat.IVV       gps_altitude_rate   ft/min
mat.PTCH      pitch               deg
mat.ROLL      roll                deg
mat.TH        yaw                 deg
mat.MH        yaw                 deg
mat.AOAC      aoa                 deg
mat.AOA1      aoa                 deg
mat.AOA1      aoa_1               deg
mat.AOA2      aoa_2               deg
mat.VRTG      normal_acc          g
mat.LONG      longitudinal_acc    g
mat.LATG      lateral_acc         g
mat.PS        p_static            inHg
mat.PSA       p_static            hPa
mat.PT        p_total             hPa
mat.PI        q_impact            hPa
mat.TAT       tat                 degC
mat.SAT       sat                 degC
mat.LATP      latitude            deg
mat.LONP      longitude           deg
mat.ELEV.1    elevator            deg
mat.AIL.1     aileron             deg
mat.RUDD      rudder              deg
mat.PTRM      elevator_trim       deg
mat.LGDN      gear                1
mat.FF.1      fuel_flow           lb/h
mat.DA        -                   deg
mat.FLAP      -                   1
sidpac
mat.fdata(:,1)   time              s
mat.fdata(:,2)   tas               ft/s
mat.fdata(:,3)   sideslip          deg
mat.fdata(:,4)   aoa               deg
mat.fdata(:,5)   roll_rate         deg/s
mat.fdata(:,6)   pitch_rate        deg/s
mat.fdata(:,7)   yaw_rate          deg/s
mat.fdata(:,8)   roll              deg
mat.fdata(:,9)   pitch             deg
mat.fdata(:,10)  yaw               deg
mat.fdata(:,11)  longitudinal_acc  g
mat.fdata(:,12)  lateral_acc       g
mat.fdata(:,13)  normal_acc        g
mat.fdata(:,14)  elevator          deg
mat.fdata(:,15)  aileron           deg
mat.fdata(:,16)  rudder            deg
mat.fdata(:,28)  mach              1
mat.fdata(:,30)  altitude          ft
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
    _rows.append(ChannelMap(_topic, _field, _channel.strip("-"), _unit, *map(float, _numbers)))


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


def _epoch_of(topics: Sequence[Topic]) -> Epoch | None:
    """Return from when the times of the messages count, as a satellite receiver tells it; None where none does."""
    for topic in topics:
        fields = {name: np.asarray(values, dtype=np.float64) for name, values in topic.fields.items() if name in UTC}
        if microseconds := fields.keys() & {"time_utc_usec", "unix_usec"}:
            moments_s = 1e-6 * fields[microseconds.pop()]
        elif {"GWk", "GMS"} <= fields.keys():
            moments_s = utc_of_gps(fields["GWk"], 1e-3 * fields["GMS"])
        else:
            continue
        if (epoch := epoch_of_clock(moments_s, topic.time_s, is_utc=True, is_dated=True)) is not None:
            return epoch
    return None


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
                    why=f"by the table of {RECORDERS[recorder]}",
                    unit_from=f"table of {RECORDERS[recorder]}",
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
    logs = []
    for part in parts:
        epoch = _epoch_of(part)
        tracks = tracks_of(recorder, [completed(topic) for topic in part], wanted)
        if tracks:
            logs.append(RawLog(columns=[replace(track, epoch=epoch) for track in tracks], notes=tuple(notes)))
    if not logs:
        has = ", ".join(topic.label for topic in topics) or "none"
        raise LogError(f"{path}: no channels in its messages ({has}); give a log that was recorded in flight")
    return logs[0] if len(parts) == 1 else replace(logs[0], boots=tuple(logs))
