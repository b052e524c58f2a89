"""A folder of short logs, good and broken, that are analysed in a second or two."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array

RATE_HZ, LENGTH_S = 4.0, 100.0


def flight(seed: int = 0, *, lost: bool = False) -> str:
    """Return a log in level flight as CSV; `lost` : its airspeed is lost for 3 s."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, LENGTH_S, 1.0 / RATE_HZ)
    tas = 90.0 + 2.0 * np.sin(0.2 * time_s) + 0.05 * rng.standard_normal(time_s.size)
    tas = np.where(lost & (time_s >= 60.0) & (time_s < 63.0), 0.0, tas)
    columns = (time_s, tas, 3000.0 + 5.0 * np.sin(0.1 * time_s), 0.02 + 0.01 * np.cos(0.2 * time_s))
    rows = zip(*(one.tolist() for one in columns), strict=True)
    head = "time [s],tas [m/s],altitude [m],pitch [rad]\n"
    return head + "".join(",".join(f"{value:.6g}" for value in row) + "\n" for row in rows)


def make_fleet(folder: Path, n: int = 3, broken: int = 1) -> list[Path]:
    """Write logs `flight_K.csv`, and `broken_K.csv` that cannot be read; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"flight_{k}.csv" for k in range(n)]
    for k, path in enumerate(paths):
        path.write_text(flight(seed=k))
    for k in range(broken):
        paths.append(folder / f"broken_{k}.csv")
        paths[-1].write_text("# nothing\n" * (k + 1))
    return sorted(paths)


def flown(
    *, error_m_s: float = 0.0, vane_rad: float = 0.0, gust_m_s: float = 0.3, seed: int = 0, length_s: float = 600.0
) -> FlightLog:
    """Return a flight of turns in a wind of its own, with gusts; its airspeed and its vane err by a constant."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, length_s, 1.0)
    speed = 60.0 + 2.0 * np.sin(0.05 * time_s)
    heading = 2.0 * np.pi * time_s / 80.0
    wind = rng.normal(0.0, 6.0, 2)[:, None] + gust_m_s * rng.normal(size=(2, time_s.size))
    climb = 2.0 * np.sin(0.03 * time_s)
    roll = np.arctan(speed * (2.0 * np.pi / 80.0) / 9.80665)
    path = climb / speed
    aoa = 0.05 + 0.01 * np.sin(0.05 * time_s)
    values = {
        "tas": (speed + error_m_s, "m/s"),
        "velocity_north": (speed * np.cos(heading) + wind[0], "m/s"),
        "velocity_east": (speed * np.sin(heading) + wind[1], "m/s"),
        "altitude": (1500.0 + np.cumsum(climb), "m"),
        "altitude_rate": (climb, "m/s"),
        "roll": (roll, "rad"),
        "pitch": (np.arcsin(np.sin(path)) + aoa * np.cos(roll), "rad"),
        "aoa": (aoa + vane_rad, "rad"),
    }
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=unit, source=name)
        for name, (one, unit) in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels)
