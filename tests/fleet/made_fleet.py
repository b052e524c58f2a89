"""A folder of short logs, good and broken, that are analysed in a second or two."""

from __future__ import annotations

from pathlib import Path

import numpy as np

RATE_HZ, LENGTH_S = 4.0, 100.0


def flight(seed: int = 0) -> str:
    """Return a log in level flight as CSV."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, LENGTH_S, 1.0 / RATE_HZ)
    tas = 90.0 + 2.0 * np.sin(0.2 * time_s) + 0.05 * rng.standard_normal(time_s.size)
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
