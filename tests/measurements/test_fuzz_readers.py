"""Damaged logs: every reader's files cut short and with bytes altered are read or refused, never worse."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from bars import FULL
from damaged_logs import read_all
from made_dataflash import dataflash_bytes
from made_layouts import LAYOUTS
from made_px4 import px4_topics, write_ulog
from made_tdms import write_tdms
from made_tlog import tlog_bytes
from scipy.io import savemat

from bfi_cli.faults import parse_spec
from bfi_cli.flightlog import inject, read_log, write_log

pytestmark = pytest.mark.slow

N = 300
CUTS, FLIPS = (100, 200) if FULL else (25, 25)
# Of a layout of a recorder, which other formats' readers read: fewer by default, and small files in little memory, as
# MCAP, whose damaged messages may be logged days after the others.
LAYOUT_CUTS, LAYOUT_FLIPS = (100, 200) if FULL else (6, 10)
LARGEST_KB, LARGEST_LAYOUT_KB = 10**6, 2 * 10**5
# Of 300 files of a format, or 50. On one (an altered text attribute of variable length) the HDF5 library itself ends
# the process, which nothing in the same process can prevent.
MOST_ENDED = {"contiguous": 2, "with_truth": 2, "matlab_73": 2, "flight_data_accessor": 2}
TIME = np.arange(N) / 10.0
SIGNALS = {"time": TIME, "elevator": 0.02 * np.sin(TIME**1.3), "tas": 100.0 + np.cumsum(np.sin(TIME**1.3)) / 50.0}


def contiguous(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in SIGNALS.items():
            file[name] = values
        file["tas"].attrs["units"] = "m/s"


def with_truth(path: Path) -> None:
    contiguous(path)
    write_log(inject(read_log(path), [parse_spec("bias,channel=tas,magnitude=4,onset_s=13.8")]), path)


def text(path: Path) -> None:
    rows = "".join(f"{t!r},{u!r},{y!r}\n" for t, u, y in zip(*(v.tolist() for v in SIGNALS.values()), strict=True))
    path.write_text("time [s],elevator [rad],tas [m/s]\n" + rows)


def matlab(path: Path) -> None:
    savemat(path, SIGNALS)


def matlab_compressed(path: Path) -> None:
    savemat(path, {"flight": {n: {"data": v, "units": "m/s"} for n, v in SIGNALS.items()}}, do_compression=True)


def matlab_73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in SIGNALS.items():
            file[f"flight/{name}/data"] = values[None, :]
            file[f"flight/{name}/units"] = np.array([[ord(c)] for c in "m/s"], dtype=np.uint16)
    with open(path, "r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))


def ulog(path: Path) -> None:
    write_ulog(path, {key: one for key, one in px4_topics().items() if key[0] in ("airspeed", "actuator_controls_0")})


def dataflash(path: Path) -> None:
    path.write_bytes(dataflash_bytes(("ARSP", "AETR")))


def tlog(path: Path) -> None:
    path.write_bytes(tlog_bytes())


def tdms(path: Path) -> None:
    write_tdms(path, SIGNALS["tas"], SIGNALS["elevator"], segments=4)


def tdms_rates(path: Path) -> None:
    write_tdms(path, SIGNALS["tas"], SIGNALS["elevator"], rate_hz=(10.0, 25.0))


def garmin(path: Path) -> None:
    rows = "".join(f"2024-05-01, 12:{k // 60:02d}:{k % 60:02d}, {100 + k % 7}, {k % 5}, KCKN\n" for k in range(N))
    path.write_text(
        "#airframe_info\n#yyyy-mm-dd, hh:mm:ss, kt, deg, ident\nLcl Date, Lcl Time, TAS, Pitch, To\n" + rows
    )


def utf_16(path: Path) -> None:
    text(path)
    path.write_bytes(path.read_text().encode("utf-16"))


def flight_data_accessor(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, source, rate_hz in (("Airspeed True", "tas", 10.0), ("Elevator", "elevator", 5.0)):
            group = file.create_group(f"series/{name}")
            group["data"] = SIGNALS[source][:: round(10.0 / rate_hz)]
            group["mask"] = np.zeros(len(group["data"]), dtype=bool)
            group.attrs.update({"frequency": rate_hz, "supf_offset": 0.0, "units": "kt" if source == "tas" else "rad"})


def mcap(path: Path) -> None:
    contiguous(path)
    write_log(read_log(path), path.with_suffix(".mcap"))
    path.with_suffix(".mcap").replace(path)


FORMATS = (
    contiguous,
    with_truth,
    text,
    garmin,
    matlab,
    matlab_compressed,
    matlab_73,
    ulog,
    dataflash,
    tlog,
    tdms,
    tdms_rates,
    utf_16,
    flight_data_accessor,
    mcap,
    *LAYOUTS.values(),
)


def damaged(whole: bytes, cuts: int, flips: int) -> list[bytes]:
    """Return a file cut at even parts of its length, and with one to four of its bytes altered, the same ever."""
    rng = np.random.default_rng(0)
    cut = [whole[: len(whole) * k // cuts] for k in range(cuts)]
    altered = []
    for _ in range(flips):
        file = bytearray(whole)
        for at in rng.integers(0, len(whole), rng.integers(1, 5)):
            file[at] ^= int(rng.integers(1, 256))
        altered.append(bytes(file))
    return cut + altered


@pytest.mark.parametrize("write", FORMATS)
def test_a_damaged_file_is_read_or_refused_in_one_line(write: Callable[[Path], object], tmp_path: Path):
    (tmp_path / "dictionary.yaml").write_text("atoms:\n  - {shape: bias, onset_s: 13.8}\n")
    write(tmp_path / "whole.h5")
    is_layout = write in LAYOUTS.values()
    counts = (LAYOUT_CUTS, LAYOUT_FLIPS) if is_layout else (CUTS, FLIPS)
    files = damaged((tmp_path / "whole.h5").read_bytes(), *counts)
    for k, content in enumerate(files):
        (tmp_path / str(k)).write_bytes(content)
    outcomes, largest = read_all(tmp_path, len(files))
    print(write.__name__, dict(Counter(o.partition("\n")[0] for o in outcomes)), f"{largest / 1000:.0f} MB")
    wrong = {k: came for k, came in enumerate(outcomes) if came not in ("read", "refused")}
    ended = [k for k, came in wrong.items() if came.startswith("ended by signal")]
    assert len(ended) <= MOST_ENDED.get(write.__name__, 0)
    assert {k: came for k, came in wrong.items() if k not in ended} == {}
    assert largest < (LARGEST_LAYOUT_KB if is_layout or write is mcap else LARGEST_KB)
