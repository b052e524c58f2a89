"""Files of recorders and made in their layouts are read, to the last digit, as `csv` and `scipy` read them."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from bfi_cli.flightlog import read_log

pytestmark = pytest.mark.realdata

KT, FT, G, DEG, INHG = 1852.0 / 3600.0, 0.3048, 9.80665, np.pi / 180.0, 3386.389


def load(values: np.ndarray) -> np.ndarray:
    return values * G - G


# By file: its delimiter, the line of its header and the first of its rows, and by channel the column and its SI value.
Rows = dict[str, tuple[str, float | Callable[[np.ndarray], np.ndarray]]]
SKYVIEW: Rows = {
    "tas": ("True Airspeed (knots)", KT),
    "ias": ("Indicated Airspeed (knots)", KT),
    "ground_speed": ("Ground Speed (knots)", KT),
    "altitude": ("Pressure Altitude (ft)", FT),
    "gps_altitude": ("GPS Altitude (feet)", FT),
    "altitude_rate": ("Vertical Speed (ft/min)", FT / 60.0),
    "pitch": ("Pitch (deg)", DEG),
    "roll": ("Roll (deg)", DEG),
    "yaw": ("Magnetic Heading (deg)", DEG),
    "normal_acc": ("Vertical Accel(g)", load),
    "sat": ("OAT (deg C)", lambda values: values + 273.15),
    "latitude": ("Latitude (deg)", DEG),
}
FILES: dict[str, tuple[str, int, int, str, Rows]] = {
    "cases/skyview.csv": (",", 0, 1, "Session Time", SKYVIEW),
    "cases/sky_healthy.csv": (",", 0, 1, "Session Time", {**SKYVIEW, "track": ("Ground Track (deg)", DEG)}),
    "cases/xplane_Data.txt": (
        "|",
        0,
        1,
        "_totl,_time",
        {
            "tas": ("Vtrue,_ktas", KT),
            "ias": ("_Vind,_kias", KT),
            "ground_speed": ("Vtrue,_ktgs", KT),
            "gps_altitude": ("__alt,ftmsl", FT),
            "altitude_rate": ("__VVI,__fpm", FT / 60.0),
            "pitch": ("pitch,__deg", DEG),
            "roll": ("_roll,__deg", DEG),
            "yaw": ("hding,_true", DEG),
            "aoa": ("alpha,__deg", DEG),
        },
    ),
    "cases/inav_blackbox.csv": (
        ",",
        0,
        1,
        "time (us)",
        {
            "ias": ("AirSpeed", 0.01),
            "baro_altitude": ("BaroAlt (cm)", 0.01),
            "ground_speed": ("GPS_speed (m/s)", 1.0),
            "altitude_rate": ("navVel[2]", 0.01),
            "roll": ("attitude[0]", 0.1 * DEG),
            "pitch": ("attitude[1]", -0.1 * DEG),
            "yaw": ("attitude[2]", 0.1 * DEG),
            "normal_acc": ("accSmooth[2]", lambda values: load(values / 2048.0)),
        },
    ),
    "flights/reader_samples/g3x_homebuilt.csv": (
        ",",
        1,
        3,
        "Time (hh:mm:ss)",
        {
            "tas": ("True Airspeed (kt)", KT),
            "ias": ("Indicated Airspeed (kt)", KT),
            "ground_speed": ("GPS Ground Speed (kt)", KT),
            "altitude": ("Pressure Altitude (ft)", FT),
            "baro_altitude": ("Baro Altitude (ft)", FT),
            "gps_altitude": ("GPS Altitude (ft)", FT),
            "radio_altitude": ("Radar Altitude (ft)", FT),
            "baro_setting": ("Baro Setting (inch Hg)", INHG),
            "velocity_east": ("GPS Velocity E (m/sec)", 1.0),
            "velocity_north": ("GPS Velocity N (m/sec)", 1.0),
            "altitude_rate": ("Vertical Speed (ft/min)", FT / 60.0),
            "pitch": ("Pitch (deg)", DEG),
            "roll": ("Roll (deg)", DEG),
            "lateral_acc": ("Lateral Acceleration (G)", G),
            "normal_acc": ("Normal Acceleration (G)", load),
            "sat": ("Outside Air Temp (deg C)", lambda values: values + 273.15),
        },
    ),
}


def number(cell: str) -> float:
    clock = cell.split(":")
    if len(clock) == 3:
        return 3600.0 * int(clock[0]) + 60.0 * int(clock[1]) + float(clock[2])
    return float(cell) if cell.strip() else np.nan


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_read_as_typed(flights: Path, name: str):
    sign, header, first, clock, channels = FILES[name]
    with open(flights.parent / name, encoding="latin-1") as file:
        lines = list(csv.reader(file, delimiter=sign))
    names = [cell.strip() for cell in lines[header]]

    def column(source: str) -> np.ndarray:
        return np.array([number(row[names.index(source)]) for row in lines[first:]])

    log = read_log(flights.parent / name)
    assert "aoa" not in log.channels or "aoa" in channels
    times = column(clock) * (1e-6 if clock.endswith("(us)") else 1.0)
    here = np.isin(np.round(log.time_s, 6), np.round(times, 6))  # a single missing second is filled
    assert np.count_nonzero(here) == times.size
    for channel, (source, change) in channels.items():
        values = column(source)
        expected = change(values) if callable(change) else change * values
        got = log.channels[channel].values[here]
        np.testing.assert_allclose(got, expected, rtol=1e-14, atol=1e-13, err_msg=channel)


def test_dashlink_structs_are_read_as_typed(flights: Path):
    path = flights.parent / "cases" / "dashlink_layout.mat"
    file, log = loadmat(path, simplify_cells=True), read_log(path)
    scales = {"tas": ("TAS", KT), "cas": ("CAS", KT), "altitude": ("ALT", FT), "mach": ("MACH", 1.0)}
    scales |= {"aoa": ("AOA1", DEG), "ground_speed": ("GS", KT), "longitudinal_acc": ("LONG", G)}
    np.testing.assert_allclose(log.time_s, np.arange(2400) / 4.0)
    for channel, (source, scale) in scales.items():
        np.testing.assert_allclose(log.channels[channel].values, scale * file[source]["data"], rtol=1e-14)
    # Slower ones are held, each between its samples.
    np.testing.assert_allclose(log.channels["p_static"].values[::2], INHG * file["PS"]["data"], rtol=1e-14)
    assert abs(float(np.median(log.channels["normal_acc"].values))) < 0.1


def test_the_simulated_citation_is_read_as_typed(flights: Path):
    path = flights / "de3211_1.mat"
    file, log = loadmat(path, simplify_cells=True), read_log(path)
    np.testing.assert_allclose(log.channels["tas"].values, file["vtas"].ravel(), rtol=1e-14)
    np.testing.assert_allclose(log.channels["normal_acc"].values, -file["Az"].ravel() - G, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "clock"),
    [
        ("flights/reader_samples/g1000_c172.csv", "2011-07-01T00:00:00"),
        ("flights/reader_samples/g3x_homebuilt.csv", "2026-03-27T00:00:00"),
        ("flights/reader_samples/sample_log_small.ulg", "2021-04-21T06:30:38.142Z"),
        ("flights/reader_samples/pilot_0004.bin", "2025-01-03T13:43:56.663Z"),
        ("flights/reader_samples/vtol.tlog", "2018-08-08T13:55:36.883Z"),
        ("cases/skyview.csv", "2021-06-01T14:58:20"),
        ("cases/inav_blackbox.csv", None),
        ("flights/px4_swiss1.h5", None),
    ],
)
def test_the_clock_of_a_recorded_log(flights: Path, name: str, clock: str | None):
    epoch = read_log(flights.parent / name).epoch
    assert (None if epoch is None else epoch.iso) == clock
