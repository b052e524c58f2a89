"""Files in the layouts of recorders, made of one flight, with the names and units that the recorders' manuals give."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from scipy.io import savemat

KT, FT, G, DEG, INHG = 1852.0 / 3600.0, 0.3048, 9.80665, np.pi / 180.0, 3386.389
N = 300
T = np.arange(N) / 2.0
# What is recorded, in the units of most recorders: kt, ft, ft/min, degrees, g, degrees Celsius.
TAS = 100.0 + 8.0 * np.sin(T / 20.0)
IAS = np.round(0.93 * TAS, 2)
ALTITUDE = 3000.0 + np.round(100.0 * np.sin(T / 50.0))
PITCH = np.round(3.0 + 2.0 * np.sin(T / 10.0), 2)
ROLL = np.round(5.0 * np.sin(T / 7.0), 2)
LOAD = np.round(1.0 + 0.02 * np.sin(T / 3.0), 4)
SI = {
    "tas": KT * np.round(TAS, 3),
    "ias": KT * IAS,
    "altitude": FT * ALTITUDE,
    "pitch": DEG * PITCH,
    "roll": DEG * ROLL,
    "normal_acc": G * (LOAD - 1.0),
}
Table = dict[str, object]
Expected = Mapping[str, object]


def lines_of(columns: Table, delimiter: str = ",") -> str:
    """Return rows of cells: arrays to the digits that they need, other values in every row."""
    rows = []
    for k in range(N):
        cells = (one[k] if isinstance(one, np.ndarray | list) else one for one in columns.values())
        rows.append(delimiter.join(f"{cell:.10g}" if isinstance(cell, float) else str(cell) for cell in cells))
    return "\n".join(rows) + "\n"


def text(columns: Table, *above: str, delimiter: str = ",") -> str:
    return "\n".join([*above, delimiter.join(columns), lines_of(columns, delimiter)])


def clock(k: int) -> str:
    return f"13:{k // 60:02d}:{k % 60:02d}"


CLOCK = [clock(k) for k in range(N)]


def g1000(path: Path) -> Expected:
    """G1000, Perspective and NXi: names in the third line, units above them; the load factor less one."""
    columns: Table = {
        "  Lcl Date": "2024-05-01",
        " Lcl Time": CLOCK,
        " UTCOfst": "-05:00",
        " AtvWpt": "KCKN",
        "    AltB": ALTITUDE,
        " BaroA": 29.92,
        "  AltMSL": ALTITUDE + 12.0,
        "   OAT": 15.5,
        "    IAS": IAS,
        " GndSpd": TAS + 5.0,
        "    VSpd": 120.0,
        "  Pitch": PITCH,
        "   Roll": ROLL,
        "  LatAc": 0.01,
        " NormAc": LOAD - 1.0,
        "   HDG": 90.5,
        "   TRK": 91.0,
        "  AltGPS": ALTITUDE - 80.0,
        " TAS": np.round(TAS, 3),
        " MagVar": 3.0,
        " E1 OilT": 164.4,
    }
    units = (
        "yyy-mm-dd, hh:mm:ss,   hh:mm,  ident, ft Baro,  inch,  ft msl, deg C,     kt,     kt,     fpm,    deg,    deg,"
    )
    units += "      G,      G,   deg,   deg,  ft wgs,  kt,    deg,   deg F"
    path.write_text(text(columns, '#airframe_info, log_version="1.00", airframe_name="Cessna 172S",', f"#{units}"))
    return {
        **{name: SI[name] for name in ("tas", "ias", "pitch", "roll", "normal_acc")},
        "baro_altitude": FT * ALTITUDE,
        "baro_setting": INHG * 29.92,
        "gps_altitude": FT * (ALTITUDE + 12.0),
        "sat": 288.65,
        "ground_speed": KT * (TAS + 5.0),
        "altitude_rate": 120.0 * FT / 60.0,
        "lateral_acc": 0.01 * G,
        "yaw": 90.5 * DEG,
        "magnetic_track": 91.0 * DEG,
        "magnetic_variation": 3.0 * DEG,
        "E1 OilT": (164.4 + 459.67) * 5.0 / 9.0,
    }


def g3x(path: Path) -> Expected:
    """G3X, GDU 460: long names with units and short ones, some blank; a load factor, and an index of incidence."""
    columns: list[tuple[str, str, object]] = [
        ("Date (yyyy-mm-dd)", "Lcl Date", "2024-05-01"),
        ("Time (hh:mm:ss)", "Lcl Time", CLOCK),
        ("GPS Altitude (ft)", "AltGPS", ALTITUDE + 12.0),
        ("GPS Time of Week (sec)", "", 512919.4 + np.arange(N)),
        ("GPS Velocity E (m/sec)", "GPSVelE", 51.5),
        ("GPS Velocity N (m/sec)", "", -2.5),
        ("Pressure Altitude (ft)", "AltP", ALTITUDE),
        ("Baro Altitude (ft)", "AltInd", ALTITUDE + 30.0),
        ("Indicated Airspeed (kt)", "IAS", IAS),
        ("True Airspeed (kt)", "", np.round(TAS, 3)),
        ("Pitch (deg)", "Pitch", PITCH),
        ("Roll (deg)", "Roll", ROLL),
        ("Normal Acceleration (G)", "NormAc", LOAD),
        ("AOA Cp", "", -0.12),
        ("AOA", "AOA", 0.4),
        ("Baro Setting (inch Hg)", "Baro", 29.95),
        ("Outside Air Temp (deg C)", "OAT", 28.0),
        ("Flap Position", "Flaps", 2.0),
        ("COM Frequency 1 (MHz)", "COM1", ["123.075" if k % 100 else "123.075 RX" for k in range(N)]),
        ("Terrain Alert", "", ""),
    ]
    upper, lower = (",".join(column[i] for column in columns) for i in (0, 1))
    rows = lines_of({str(i): column[2] for i, column in enumerate(columns)})
    path.write_text(f'#airframe_info,log_version="1.00",product="GDU 460"\n{upper}\n{lower}\n{rows}')
    return {
        **SI,
        "baro_altitude": FT * (ALTITUDE + 30.0),
        "gps_altitude": FT * (ALTITUDE + 12.0),
        "velocity_east": 51.5,
        "velocity_north": -2.5,
        "baro_setting": INHG * 29.95,
        "sat": 301.15,
        "AOA": 0.4,
        "AOA Cp": -0.12,
        "Flaps": 2.0,
    }


def txi(path: Path) -> Expected:
    """TXi: the date and the positions are blank before a fix, and indices follow the columns."""
    blank = 5
    columns: Table = {
        "  Lcl Date": [*[" " * 10] * blank, *["2024-05-01"] * (N - blank)],
        " Lcl Time": [*[" " * 8] * blank, *CLOCK[blank:]],
        " UTCOfst": "-04:00",
        "     Latitude": [*[""] * blank, *["41.0000000"] * (N - blank)],
        "  AltInd": ALTITUDE,
        "    IAS": IAS,
        " OnGrnd": 0,
        " LogIdx": list(range(N)),
    }
    units = "yyy-mm-dd, hh:mm:ss,   hh:mm,      degrees,      ft,     kt,  bool,      #"
    path.write_text(text(columns, '#airframe_info, log_version="1.03", unit="GDU1",', f"#{units}"))
    return {"baro_altitude": FT * ALTITUDE[blank:], "ias": KT * IAS[blank:], "latitude": 41.0 * DEG}


def skyview(path: Path) -> Expected:
    """Dynon SkyView: seconds of the session, a date beside them, and an angle of attack in per cent."""
    columns: Table = {
        "Session Time": 100.0 + T,
        "GPS Fix Quality": 2,
        "GPS Date & Time": [f"2021-06-01 15:00:{k // 2 % 60:02d}" for k in range(N)],
        "Latitude (deg)": 40.1,
        "Longitude (deg)": -88.1,
        "GPS Altitude (feet)": ALTITUDE + 12.0,
        "Ground Speed (knots)": TAS + 5.0,
        "Ground Track (deg)": 91.0,
        "Mag Var (deg)": -3.0,
        "Pitch (deg)": PITCH,
        "Roll (deg)": ROLL,
        "Magnetic Heading (deg)": 90.5,
        "Indicated Airspeed (knots)": IAS,
        "Pressure Altitude (ft)": ALTITUDE,
        "Turn Rate (deg/s)": 0.5,
        "Lateral Accel (g)": 0.01,
        "Vertical Accel(g)": LOAD,
        "Angle of Attack (%)": 40.0,
        "Vertical Speed (ft/min)": 120.0,
        "OAT (deg C)": 15.5,
        "True Airspeed (knots)": np.round(TAS, 3),
        "Barometer Setting (inHg)": 29.92,
        "Density Altitude (ft)": 3500.0,
        "Transponder Status": "ALT",
    }
    path.write_text(text(columns))
    return {
        **SI,
        "time": 100.0 + T,
        "latitude": 40.1 * DEG,
        "longitude": -88.1 * DEG,
        "gps_altitude": FT * (ALTITUDE + 12.0),
        "ground_speed": KT * (TAS + 5.0),
        "track": 91.0 * DEG,
        "magnetic_variation": -3.0 * DEG,
        "yaw": 90.5 * DEG,
        "lateral_acc": 0.01 * G,
        "altitude_rate": 120.0 * FT / 60.0,
        "sat": 288.65,
        "baro_setting": INHG * 29.92,
        "Angle of Attack": 0.4,
        "Turn Rate": 0.5 * DEG,
    }


def xplane(path: Path) -> Expected:
    """X-Plane: names padded to five characters, bars between the columns and behind the last, a blank line above."""
    columns: Table = {
        "   _real,_time ": 7.0 + 1.1 * T,
        "   _totl,_time ": T,
        "   _Vind,_kias ": IAS,
        "   _Vind,_keas ": IAS,
        "   Vtrue,_ktas ": np.round(TAS, 3),
        "   Vtrue,_ktgs ": TAS + 5.0,
        "   _Mach,ratio ": 0.15,
        "   __VVI,__fpm ": 120.0,
        "   Gload,norml ": LOAD,
        "   Gload,axial ": 0.05,
        "   pitch,__deg ": PITCH,
        "   _roll,__deg ": ROLL,
        "   hding,_true ": 90.5,
        "   hding,__mag ": 93.5,
        "   alpha,__deg ": 2.5,
        "   _beta,__deg ": -0.5,
        "   hpath,_true ": 91.0,
        "   vpath,__deg ": 0.5,
        "   ____Q,rad/s ": 0.01,
        "   ____P,rad/s ": 0.02,
        "   ____R,rad/s ": 0.03,
        "   __lat,__deg ": 40.1,
        "   __alt,ftmsl ": ALTITUDE + 12.0,
        "   p-alt,ftMSL ": ALTITUDE,
        "   __alt,__ind ": ALTITUDE - 30.0,
        "   thro1,_part ": 0.7,
        "   _gear,__rat ": 1.0,
        "   _elev,yoke1 ": 0.1,
    }
    rows = "".join(f" {line} | \n" for line in lines_of(columns, " | ").splitlines())
    path.write_text(f"\n{'|'.join(columns)}| \n{rows}")
    return {
        **SI,
        "time": T,
        "ground_speed": KT * (TAS + 5.0),
        "mach": 0.15,
        "altitude_rate": 120.0 * FT / 60.0,
        "longitudinal_acc": 0.05 * G,
        "yaw": 90.5 * DEG,
        "aoa": 2.5 * DEG,
        "sideslip": -0.5 * DEG,
        "track": 91.0 * DEG,
        "flight_path_angle": 0.5 * DEG,
        "baro_altitude": FT * (ALTITUDE - 30.0),
        "pitch_rate": 0.01,
        "roll_rate": 0.02,
        "yaw_rate": 0.03,
        "latitude": 40.1 * DEG,
        "gps_altitude": FT * (ALTITUDE + 12.0),
        "throttle": 0.7,
        "_elev,yoke1": 0.1,
    }


def inav(path: Path) -> Expected:
    """`blackbox_decode` of INAV: quoted names, units of its options in some, raw numbers in the others."""
    columns: Table = {
        "loopIteration": list(range(0, 2 * N, 2)),
        "time (us)": list(range(12_000_000, 12_000_000 + 500_000 * N, 500_000)),
        "rcCommand[3]": 1600,
        "gyroADC[0]": 2,
        "gyroADC[1]": -3,
        "gyroADC[2]": 4,
        "accSmooth[0]": 205,
        "accSmooth[1]": -41,
        "accSmooth[2]": np.round(2048 * LOAD),
        "attitude[0]": np.round(10.0 * ROLL),
        "attitude[1]": np.round(-10.0 * PITCH),
        "attitude[2]": 905,
        "AirSpeed": np.round(10.0 * IAS),
        "BaroAlt (cm)": np.round(100.0 * FT * ALTITUDE),
        "navVel[0]": -250,
        "navVel[1]": 5150,
        "navVel[2]": 60,
        "GPS_coord[0]": 40.1,
        "GPS_coord[1]": -88.1,
        "GPS_altitude": 920,
        "GPS_speed (m/s)": 51.5,
        "GPS_ground_course": 91.0,
        "wind[0]": -120,
        "flightModeFlags (flags)": "ARM|ANGLE",
    }
    path.write_text(",".join(f'"{name}"' for name in columns) + "\n" + lines_of(columns))
    return {
        "time": 12.0 + T,
        "throttle": 0.6,
        "roll_rate": 2.0 * DEG,
        "pitch_rate": 3.0 * DEG,
        "yaw_rate": -4.0 * DEG,
        "longitudinal_acc": G * 205.0 / 2048.0,
        "lateral_acc": G * 41.0 / 2048.0,
        "normal_acc": G * (np.round(2048.0 * LOAD) / 2048.0 - 1.0),
        "roll": DEG * np.round(10.0 * ROLL) / 10.0,
        "pitch": -DEG * np.round(-10.0 * PITCH) / 10.0,
        "yaw": 90.5 * DEG,
        "ias": np.round(10.0 * IAS) / 100.0,
        "baro_altitude": np.round(100.0 * FT * ALTITUDE) / 100.0,
        "velocity_north": -2.5,
        "velocity_east": 51.5,
        "altitude_rate": 0.6,
        "latitude": 40.1 * DEG,
        "longitude": -88.1 * DEG,
        "gps_altitude": 920.0,
        "ground_speed": 51.5,
        "track": 91.0 * DEG,
        "wind_north": -1.2,
    }


def flightgear(path: Path) -> Expected:
    """The logger of FlightGear: `Time`, and the paths of properties without a title."""
    columns: Table = {
        "Time": T,
        "/velocities/airspeed-kt": IAS,
        "/instrumentation/airspeed-indicator/true-speed-kt": np.round(TAS, 3),
        "/velocities/vertical-speed-fps": 2.0,
        "/velocities/speed-north-fps": -8.0,
        "/position/altitude-ft": ALTITUDE + 12.0,
        "/instrumentation/altimeter/pressure-alt-ft": ALTITUDE,
        "/instrumentation/altimeter/setting-inhg": 29.92,
        "/orientation/pitch-deg": PITCH,
        "/orientation/roll-deg": ROLL,
        "/orientation/heading-deg": 90.5,
        "/orientation/alpha-deg": 2.5,
        "/orientation/q-body": 0.01,
        "/accelerations/pilot/z-accel-fps_sec": -G / FT * LOAD,
        "/environment/temperature-degc": 15.5,
        "/environment/pressure-inhg": 26.8,
        "/surface-positions/elevator-pos-norm": -0.1,
        "my title": 1.0,
    }
    path.write_text(text(columns))
    return {
        **{name: SI[name] for name in ("tas", "altitude", "pitch", "roll", "normal_acc")},
        "time": T,
        "cas": KT * IAS,
        "altitude_rate": 2.0 * FT,
        "velocity_north": -8.0 * FT,
        "gps_altitude": FT * (ALTITUDE + 12.0),
        "baro_setting": INHG * 29.92,
        "yaw": 90.5 * DEG,
        "aoa": 2.5 * DEG,
        "pitch_rate": 0.01,
        "sat": 288.65,
        "p_static": 26.8 * INHG,
        "elevator": -0.1,
        "my title": 1.0,
    }


def igc(path: Path) -> Expected:
    """An IGC file with extensions, a fix each second over midnight, and fixes without a GNSS altitude."""
    metres, speed = np.round(FT * ALTITUDE).astype(int), np.round(10.0 * TAS).astype(int)
    lines = ["AXXXABC FLIGHT:1", "HFDTEDATE:010524,01", "HFFXA035", "I053638FXA3940SIU4145TAS4649IAS5050TDS"]
    for k in range(N):
        second = 86_400 - 100 + k
        stamp = f"{second // 3600 % 24:02d}{second // 60 % 60:02d}{second % 60:02d}"
        altitude = f"{metres[k] - 920:05d}" if metres[k] >= 920 else f"-{920 - metres[k]:04d}"
        tail = f"03509{10 * speed[k]:05d}{speed[k]:04d}5"
        lines.append(f"B{stamp}4006000N08806123W{'AV'[k >= N - 3]}{altitude}{metres[k] + 12:05d}{tail}")
        lines += ["E120000PEV", "LXXX nothing"] * (k == 100)
    path.write_text("\r\n".join([*lines, "G0123456789ABCDEF"]) + "\r\n")
    gnss = np.where(np.arange(N) < N - 3, metres + 12.0, np.nan)
    return {
        "time": 86_400.0 - 100.0 + np.arange(N) + 0.5,
        "latitude": 40.1 * DEG,
        "longitude": -(88.0 + 6.123 / 60.0) * DEG,
        "altitude": metres - 920.0,
        "gps_altitude": gnss,
        "tas": speed / 36.0,
        "ias": speed / 36.0,
        "FXA": 35.0,
        "SIU": 9.0,
    }


def parameter(values: np.ndarray, rate: float, unit: str, words: str) -> dict[str, object]:
    return {"data": values[:, None], "Rate": rate, "Units": unit, "Description": words, "Alpha": words}


def dashlink(path: Path) -> Expected:
    """NASA's DASHlink: a struct for each parameter, each at its rate."""
    fast = np.repeat(PITCH, 4)
    savemat(
        path,
        {
            "ALT": parameter(ALTITUDE, 4.0, "FEET", "PRESSURE ALTITUDE LSP"),
            "BAL1": parameter(ALTITUDE + 30.0, 4.0, "FEET", "BARO CORRECT ALTITUDE LSP"),
            "RALT": parameter(np.repeat(ALTITUDE, 2), 8.0, "FEET", "RADIO ALTITUDE LSP"),
            "TAS": parameter(np.round(TAS, 3), 4.0, "KNOTS", "TRUE AIRSPEED LSP"),
            "CAS": parameter(IAS, 4.0, "KNOTS", "COMPUTED AIRSPEED LSP"),
            "GS": parameter(TAS + 5.0, 4.0, "KNOTS", "GROUND SPEED LSP"),
            "TRK": parameter(np.full(N, 91.0), 4.0, "DEG", "TRACK ANGLE TRUE LSP"),
            "TH": parameter(np.full(N, 90.5), 4.0, "DEG", "TRUE HEADING LSP"),
            "PTCH": parameter(fast, 16.0, "DEG", "PITCH ANGLE LSP"),
            "ROLL": parameter(ROLL, 4.0, "DEG", "ROLL ANGLE LSP"),
            "AOAC": parameter(np.full(N, 2.5), 4.0, "DEG", "CORRECTED ANGLE OF ATTACK"),
            "AOA1": parameter(np.full(N, 2.6), 4.0, "DEG", "ANGLE OF ATTACK 1"),
            "VRTG": parameter(LOAD, 4.0, "G", "VERTICAL ACCELERATION"),
            "LONG": parameter(np.full(N, 0.05), 4.0, "G", "LONGITUDINAL ACCELERATION"),
            "TAT": parameter(np.full(N // 4, 15.5), 1.0, "DEG", "TOTAL AIR TEMPERATURE"),
            "PS": parameter(np.full(N // 2, 26.8), 2.0, "IN", "STATIC PRESSURE LSP"),
            "PT": parameter(np.full(N // 2, 930.0), 2.0, "MB", "TOTAL PRESSURE LSP"),
            "ELEV_1": parameter(np.full(N // 4, -1.5), 1.0, "DEG", "ELEVATOR POSITION LEFT"),
            "DA": parameter(np.full(N, 0.5), 4.0, "DEG", "DRIFT ANGLE"),
            "FLAP": parameter(np.full(N // 4, 3.0), 1.0, "COUNTS", "T.E. FLAP POSITION"),
            "VAR_1107": parameter(np.full(N // 16, 4.0), 0.25, "<units>", "SYNC WORD FOR SUBFRAME 1"),
        },
    )
    return {
        **{name: SI[name] for name in ("tas", "altitude", "roll", "normal_acc")},
        "time": np.arange(N) / 4.0,
        "cas": KT * IAS,
        "baro_altitude": FT * (ALTITUDE + 30.0),
        "ground_speed": KT * (TAS + 5.0),
        "track": 91.0 * DEG,
        "yaw": 90.5 * DEG,
        "aoa": 2.5 * DEG,
        "aoa_1": 2.6 * DEG,
        "longitudinal_acc": 0.05 * G,
        "tat": 288.65,
        "p_static": 26.8 * INHG,
        "p_total": 93_000.0,
        "elevator": -1.5 * DEG,
        "DA": 0.5 * DEG,
        "FLAP": 3.0,
    }


def sidpac(path: Path) -> Expected:
    """SIDPAC: the matrix `fdata` of 90 columns, zero where nothing was recorded; a specific force downward."""
    fdata = np.zeros((N, 90))
    columns = {1: T, 2: KT / FT * TAS, 4: 2.5, 6: 1.5, 8: ROLL, 9: PITCH, 13: -LOAD, 14: -1.5, 28: 0.15, 30: ALTITUDE}
    for k, values in columns.items():
        fdata[:, k - 1] = values
    fdata[:, 76] = 310.0
    savemat(path, {"fdata": fdata, "t": T[:, None], "npts": float(N)})
    return {
        **{name: SI[name] for name in ("altitude", "pitch", "roll", "normal_acc")},
        "time": T,
        "tas": KT * TAS,
        "aoa": 2.5 * DEG,
        "pitch_rate": 1.5 * DEG,
        "elevator": -1.5 * DEG,
        "mach": 0.15,
        "fdata(:,77)": 310.0,
    }


def ae4320(path: Path) -> Expected:
    """The simulated Citation of course AE4320: rows, SI, a specific force downward."""
    values = {
        "t": T,
        "vtas": KT * TAS,
        "hp": FT * ALTITUDE,
        "theta": DEG * PITCH,
        "Az": -G * LOAD,
        "de": -0.02 + 0.0 * T,
    }
    savemat(path, {name: one[None, :] for name, one in values.items()})
    return {
        **{name: SI[name] for name in ("altitude", "pitch", "normal_acc")},
        "time": T,
        "tas": KT * TAS,
        "elevator": -0.02,
    }


LAYOUTS: Mapping[str, Callable[[Path], Expected]] = {
    one.__name__: one for one in (g1000, g3x, txi, skyview, xplane, inav, flightgear, igc, dashlink, sidpac, ae4320)
}
