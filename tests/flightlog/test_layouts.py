"""Layouts of recorders are read as typed: names, units, conventions, time."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from made_layouts import KT, LAYOUTS, N, g1000, skyview, xplane
from noted import texts
from scipy.io import loadmat

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.quantities.channels import STANDARD

LOW_PASSED = {"pitch", "radio_altitude"}  # recorded faster than the airspeed


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_is_read_as_typed(tmp_path: Path, layout: str):
    expected = LAYOUTS[layout](tmp_path / "log")
    log = read_log(tmp_path / "log")
    for name, values in expected.items():
        got = log.time_s if name == "time" else log.channel(name).values
        np.testing.assert_allclose(got, np.broadcast_to(values, got.shape), rtol=1e-9, atol=1e-8, err_msg=name)
    recorded = {name for name, channel in log.channels.items() if name in STANDARD and not channel.derived_from}
    assert recorded - expected.keys() == (LOW_PASSED if layout == "dashlink" else set())


def test_a_stated_unit_wins_over_that_of_the_table(tmp_path: Path):
    skyview(tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_text().replace("True Airspeed (knots)", "True Airspeed (km/h)")
    (tmp_path / "log.csv").write_text(text)
    tas = read_log(tmp_path / "log.csv").channels["tas"].values
    (tmp_path / "log.csv").write_text(text.replace("True Airspeed (km/h)", "True Airspeed"))
    np.testing.assert_allclose(read_log(tmp_path / "log.csv").channels["tas"].values, tas * 3.6 * KT, rtol=1e-12)


def test_an_option_wins_over_a_table(tmp_path: Path):
    xplane(tmp_path / "Data.txt")
    log = read_log(tmp_path / "Data.txt", channel_map={"time": "_real,_time", "cas": "_Vind,_kias"})
    assert log.time_s[0] == 7.0
    np.testing.assert_array_equal(log.channels["cas"].values, read_log(tmp_path / "Data.txt").channels["ias"].values)


def test_a_garmin_log_without_its_first_line_is_one(tmp_path: Path):
    g1000(tmp_path / "log.csv")
    lines = (tmp_path / "log.csv").read_text().splitlines(keepends=True)
    whole = read_log(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_text("".join(lines[2:]))
    log = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(log.channels["tas"].values, whole.channels["tas"].values)
    assert log.n_samples == N


def test_what_the_file_does_not_name_keeps_its_name_or_is_left_out_with_a_note(tmp_path: Path):
    LAYOUTS["g3x"](tmp_path / "log.csv")
    log = read_log(tmp_path / "log.csv")
    assert "'COM1': 3 cells are not a number, the first '123.075 RX' in line 4: left out" in texts(log.notes)
    assert "aoa" not in log.channels
    assert "GPS Time of Week" in log.channels


IGC = "AXXX001\nHFDTE010524\n"
FIX = "B1200{:02d}4006000N08806123WA0092000940"


@pytest.mark.parametrize(
    ("lines", "said", "channels"),
    [
        ([FIX.format(k) for k in range(9)], (), {"latitude", "longitude", "altitude", "gps_altitude"}),
        (["I013638FXA", *(f"{FIX.format(k)}035" for k in range(9))], (), {"altitude", "FXA"}),
        (["I013640TAS", *(f"{FIX.format(k)}{'18000' if k else '  xyz'}" for k in range(9))], (), {"tas"}),
        (
            ["I013640TAS", "garbage", *(FIX.format(k) for k in range(9)), "B12zz"],
            ("B records that are damaged are left out: 1",),
            {"altitude", "tas"},
        ),
        (
            [FIX.format(k).replace("A00920", "A00000") for k in range(9)],
            ("'pressure_altitude' is zero throughout and is left out",),
            {"gps_altitude"},
        ),
    ],
)
def test_what_igc_files_hold_and_lack(tmp_path: Path, lines: list[str], said: tuple[str, ...], channels: set[str]):
    (tmp_path / "flight.igc").write_text(IGC + "\n".join(lines) + "\n")
    log = read_log(tmp_path / "flight.igc")
    assert channels <= log.channels.keys()
    assert set(said) <= set(texts(log.notes))
    assert log.n_samples == 9
    assert log.time_s[0] == 43_200.0
    tas = log.channels["tas"].values if "tas" in log.channels else np.empty(0)
    assert set(tas[np.isfinite(tas)]) <= {50.0}  # 180 km/h


def test_a_fix_out_of_order_is_left_out(tmp_path: Path):
    lines = [FIX.format(k // 2) for k in range(90)]  # two a second
    lines.insert(30, FIX.format(12).replace("B1200", "B1150"))
    (tmp_path / "flight.igc").write_text(IGC + "\n".join(lines) + "\n")
    log = read_log(tmp_path / "flight.igc")
    assert log.n_samples == 90
    assert "B records: samples out of order of time are left out, 1 of them" in texts(log.notes)
    assert log.rate_hz == pytest.approx(2.0)


def test_an_igc_file_without_fixes_is_refused(tmp_path: Path):
    (tmp_path / "flight.igc").write_text(f"{IGC}{FIX.format(1)}\n")
    with pytest.raises(LogError, match=r"flight\.igc: 1 fixes, at least 2 are needed; give a file with B records$"):
        read_log(tmp_path / "flight.igc")


def test_repeated_and_blank_names_of_a_layout_refuse_nothing(tmp_path: Path):
    xplane(tmp_path / "Data.txt")
    lines = (tmp_path / "Data.txt").read_text().splitlines(keepends=True)
    lines[1] = lines[1].replace("_gear,__rat", "thro1,_part").replace("_Mach,ratio", " " * 11)
    (tmp_path / "Data.txt").write_text("".join(lines))
    log = read_log(tmp_path / "Data.txt")
    assert "mach" not in log.channels
    np.testing.assert_array_equal(log.channels["throttle"].values, np.full(N, 0.7))


def test_the_altimeter_of_x_plane_stands_in_for_a_pressure_altitude(tmp_path: Path):
    xplane(tmp_path / "Data.txt")
    text = (tmp_path / "Data.txt").read_text().replace("p-alt,ftMSL", "other,____x")
    (tmp_path / "Data.txt").write_text(text)
    log = read_log(tmp_path / "Data.txt")
    assert log.channels["altitude"].derived_from == ("baro_altitude",)
    np.testing.assert_array_equal(log.channels["altitude"].values, log.channels["baro_altitude"].values)


def test_a_column_in_an_unknown_unit_gives_way_to_another(tmp_path: Path):
    rows = "".join(f"{k / 10},{100 + k},{k % 3}\n" for k in range(30))
    (tmp_path / "log.csv").write_text("time,tas [furlong],vtas [kt]\n" + rows)
    log = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(log.channels["tas"].values, KT * (np.arange(30) % 3))
    assert log.left_out["tas"].startswith("is in 'furlong', an unknown unit,; state it with --unit tas=UNIT")


def test_dashlink_structs_in_hdf5_are_those_of_matlab_5(tmp_path: Path):
    LAYOUTS["dashlink"](tmp_path / "old.mat")
    structs = {k: v for k, v in loadmat(tmp_path / "old.mat", simplify_cells=True).items() if isinstance(v, dict)}
    with h5py.File(tmp_path / "new.mat", "w", userblock_size=512) as file:
        for name, struct in structs.items():
            file[f"{name}/data"] = struct["data"][None, :]
            file[f"{name}/Rate"] = np.array([[struct["Rate"]]])
            file[f"{name}/Units"] = np.array([[ord(c)] for c in struct["Units"]], dtype=np.uint16)
    with open(tmp_path / "new.mat", "r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))
    old, new = read_log(tmp_path / "old.mat"), read_log(tmp_path / "new.mat")
    assert old.channels.keys() == new.channels.keys()
    for name, channel in old.channels.items():
        np.testing.assert_array_equal(new.channels[name].values, channel.values, err_msg=name)
