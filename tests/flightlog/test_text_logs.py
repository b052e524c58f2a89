"""CSV logs as people and recorders write them: units, commas, clocks, text, Garmin."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_logs import write_text
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.raw import ReadRequest
from bfi_cli.flightlog.text import read_csv

KT, FT = 1852.0 / 3600.0, 0.3048
G1000 = """\
#airframe_info, log_version="1.00", airframe_name="Cessna 172S", mode=NORMAL,
#yyy-mm-dd, hh:mm:ss,   hh:mm,  ident, ft Baro, deg C,     kt,     G,   deg, enum
  Lcl Date, Lcl Time, UTCOfst, AtvWpt,    AltB,   OAT,    TAS, NormAc, Pitch, GPSfix
"""
G3X = """\
#airframe_info,log_version="1.03",product="GDU 460"
Date (yyyy-mm-dd),Time (hh:mm:ss),Pressure Altitude (ft),True Airspeed (kt),Normal Acceleration (G),Ident,Vib (ips)
Lcl Date,Lcl Time,AltP,TAS,NormAc,AtvWpt,Vib
"""


def g1000(seconds: list[int], *, day: str = "2011-07-01", hour: int = 13) -> str:
    rows = [
        f"{day}, {hour:02d}:{s // 60:02d}:{s % 60:02d},  -05:00, {'' if k < 3 else 'KCKN'}, {1000.0 + k}, 15.0, "
        f"{100 + k}, {0.01 * k}, {0.1 * k}, 3D\n"
        for k, s in enumerate(seconds)
    ]
    return G1000 + "".join(rows)


@pytest.mark.parametrize("sign", ["  ", ",", ";", "\t"])
def test_a_table_without_a_header_has_the_names_that_are_given(tmp_path: Path, sign: str):
    rows = [sign.join((f"{0.1 * k:.1f}", f"{100 + k}", f"{k % 3}")) for k in range(30)]
    path = tmp_path / "table.txt"
    path.write_text("\n".join(rows) + "\n")
    log = read_log(path, columns=("time", "tas", "elevator"), unit_map={"tas": "kt"})
    np.testing.assert_allclose(log.channel("tas").values, KT * (100.0 + np.arange(30)), rtol=1e-12)
    assert log.n_samples == 30
    with pytest.raises(LogError, match=r"no header, line 1 holds numbers; .*--columns"):
        read_log(path)
    with pytest.raises(LogError, match=r"line 1 has 3 columns, --columns names 2; name them all"):
        read_log(path, columns=("time", "tas"))
    path.write_text(sign.join(("time", "tas", "elevator")) + "\n" + "\n".join(rows))
    assert set(read_log(path).channels) == {"tas", "elevator"}
    with pytest.raises(LogError, match=r"line 1 is a header; leave out --columns"):
        read_log(path, columns=("time", "tas", "elevator"))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_text_of_two_bytes_a_character(tmp_path: Path, encoding: str):
    text = "time [s],tas [kt],elevator [deg]\n" + "".join(f"{0.1 * k:.1f},{100 + k},{k % 3}\n" for k in range(30))
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode(encoding))
    np.testing.assert_allclose(read_log(path).channel("tas").values, KT * (100.0 + np.arange(30)), rtol=1e-12)
    path.write_bytes(text.encode(encoding)[:-1])
    with pytest.raises(LogError, match=r"log\.csv: damaged UTF-16.* text; save it as UTF-8"):
        read_log(path)


def test_a_g1000_log(tmp_path: Path):
    log = read_log(write_text(tmp_path / "a.csv", g1000(list(range(20)))))
    assert log.time_s.tolist() == [13 * 3600.0 + k for k in range(20)]
    k = np.arange(20.0)
    expected = {
        "tas": KT * (100 + k),
        "altitude": FT * (1000.0 + k),
        "normal_acc": 9.80665 * 0.01 * k,
        "pitch": np.deg2rad(0.1 * k),
        "sat": np.full(20, 288.15),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(log.channels[name].values, values, rtol=1e-12, atol=1e-12)
    assert "time counts from midnight of 2011-07-01" in texts(log.notes)
    assert {"'UTCOfst' holds text and is left out", "'AtvWpt' holds text and is left out"} <= set(texts(log.notes))


def test_repeated_and_missing_seconds_and_a_last_line_cut_off(tmp_path: Path):
    text = g1000([0, 1, 1, 2, 3, 5, 6, 7])
    log = read_log(write_text(tmp_path / "a.csv", text + "2011-07-01, 13:00:08, -05:"))
    assert (log.time_s - 13 * 3600.0).tolist() == [0, 1, 2, 3, 5, 6, 7]
    np.testing.assert_allclose(log.channels["tas"].values / KT, [100, 101, 103, 104, 105, 106, 107])
    notes = " ".join(texts(log.notes))
    for words in ("line 12 is cut off", "repeat the second before are left out: 1"):
        assert words in notes


def test_a_g3x_log_with_rows_before_its_clock_is_set(tmp_path: Path):
    rows = "".join(f"2024-05-01,10:00:{k:02d},{5000 + k},{150 + k},0.1,,{k}\n" for k in range(10))
    log = read_log(write_text(tmp_path / "a.csv", G3X + ",,5000,150,0,,0\n" * 2 + rows))
    np.testing.assert_allclose(log.channels["tas"].values, KT * (150 + np.arange(10)))
    np.testing.assert_allclose(log.channels["altitude"].values, FT * (5000 + np.arange(10)))
    assert log.time_s[0] == 36000.0
    assert "2 rows without a time are left out" in texts(log.notes)


def test_midnight_is_passed_with_and_without_a_date(tmp_path: Path):
    dated = g1000([0, 1, 2], hour=23).replace("23:00:02", "00:00:02").replace("2011-07-01, 00", "2011-07-02, 00")
    assert np.diff(read_log(write_text(tmp_path / "a.csv", dated)).time_s).tolist() == [1.0, 3601.0]
    clock = "UTC,tas\n" + "".join(
        f"{h:02d}:{m:02d}:{s:02d}.5,90\n" for h, m, s in ((23, 59, 58), (23, 59, 59), (0, 0, 0))
    )
    log = read_log(write_text(tmp_path / "b.csv", clock))
    assert log.time_s.tolist() == [86398.5, 86399.5, 86400.5]


def test_a_clock_of_whole_seconds_with_many_rows_each(tmp_path: Path):
    rows = "".join(f"12:00:{k // 5:02d},{k}\n" for k in range(2, 53))
    log = read_log(write_text(tmp_path / "a.csv", "clock,tas\n" + rows))
    np.testing.assert_allclose(log.time_s - 43200.0, np.arange(2, 53) / 5.0, atol=1e-9)
    assert any("a regular clock of 5 Hz" in note for note in texts(log.notes))


@pytest.mark.parametrize(
    ("stamp", "first"),
    [
        ("2024-05-01T12:00:{:05.2f}Z", 43200.0),
        ("2024-05-01T12:00:{:05.2f}+02:00", 36000.0),
        ("2024-05-01 12:00:{:05.2f}", 43200.0),
        ("12:00:{:05.2f}", 43200.0),
    ],
)
def test_dates_and_times_of_day(stamp: str, first: float, tmp_path: Path):
    rows = "".join(f"{stamp.format(0.25 * k)},{90 + k}\n" for k in range(8))
    log = read_log(write_text(tmp_path / "a.csv", "when,tas\n" + rows))
    np.testing.assert_allclose(log.time_s, first + 0.25 * np.arange(8), atol=1e-6)


def test_a_clock_beside_a_time_axis_is_left_out(tmp_path: Path):
    log = read_log(write_text(tmp_path / "a.csv", "clock,time,tas\n12:00:00,0,1\n12:00:01,1,2\n"))
    assert log.time_s.tolist() == [0.0, 1.0]
    assert "'clock' holds dates or times beside the time axis and is left out" in texts(log.notes)


def test_a_line_of_units(tmp_path: Path):
    log = read_log(write_text(tmp_path / "a.csv", "time,tas,aoa,what\ns,kt,deg,furlong\n0,100,3,1\n1,101,4,2\n"))
    np.testing.assert_allclose(log.channels["tas"].values, [100 * KT, 101 * KT])
    np.testing.assert_allclose(log.channels["aoa"].values, np.deg2rad([3, 4]))
    assert log.channels["what"].unit == ""


@given(values=st.lists(st.floats(-1e6, 1e6).map(lambda x: round(x, 3)), min_size=2, max_size=20))
def test_decimal_commas_are_the_numbers_with_points(values: list[float], tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "commas.csv"
    rows = "".join(f"{k},5;{value!r}\n".replace(".", ",") for k, value in enumerate(values))
    log = read_log(write_text(path, "time;tas\n" + rows))
    assert log.time_s.tolist() == [k + 0.5 for k in range(len(values))]
    assert log.channels["tas"].values.tolist() == values


ROWS = [f"{k},{90 + k}.5,{k % 3}" for k in range(40)]
HEAD = "time,tas,aoa"


def with_cells(column: int, cells: dict[int, str]) -> list[str]:
    """Return the rows with other texts in a column, by row."""
    split = [row.split(",") for row in ROWS]
    for k, cell in cells.items():
        split[k][column] = cell
    return [",".join(row) for row in split]


OFF_LATER, ALL_TEXT = (with_cells(2, dict.fromkeys(range(k, 40), text)) for k, text in ((15, "OFF"), (0, "CRUISE")))
ODD_TABLES: dict[str, tuple[str, list[str], set[str], int, str]] = {
    # Header, rows, the channels that are read, their samples, and a part of a note.
    "text in a number column": (HEAD, with_cells(1, {5: "---"}), {"tas", "aoa"}, 40, "'tas': 1 cell is not a number"),
    "marks of no value": (HEAD, with_cells(1, dict.fromkeys(range(9), "*")), {"tas", "aoa"}, 40, "first '*' in line 2"),
    "empty and N/A": (HEAD, with_cells(1, {3: "", 4: " N/A ", 5: "NaN", 6: "null"}), {"tas", "aoa"}, 40, ""),
    "an underscore": (HEAD, with_cells(2, {7: "1_0"}), {"tas", "aoa"}, 40, "the first '1_0'"),
    "a decimal comma in quotes": (HEAD, with_cells(2, {7: '"1,5"'}), {"tas", "aoa"}, 40, "the first '1 5' in line 9"),
    "numbers that turn to text": (HEAD, OFF_LATER, {"tas"}, 40, "text in 25"),
    "text, then numbers": (HEAD, with_cells(2, dict.fromkeys(range(9), "INIT")), {"tas", "aoa"}, 40, "9 cells"),
    "text": (HEAD, ALL_TEXT, {"tas"}, 40, "'aoa' holds text and is left out"),
    "a blank name": ("time,tas,aoa,,n1", [f"{row},7,{row[0]}" for row in ROWS], {"tas", "aoa", "n1"}, 40, "'column 4'"),
    "a name twice": ("time,tas,tas", ROWS, {"tas"}, 40, "'column 3' is a second 'tas' and is left out"),
    "a name twice by units": ("time,tas [kt],tas [m/s]", ROWS, {"tas"}, 40, "'column 3' is a second 'tas'"),
    "a missing name": ("time,tas,aoa", [f"{row},7" for row in ROWS], {"tas", "aoa"}, 40, "header 3 names: the last"),
    "missing names": ("time,tas", [f"{row},x" for row in ROWS], {"tas"}, 40, "the last 2 of each row is left out"),
    "numbers of rows": (HEAD, [f'"{k}",{row}' for k, row in enumerate(ROWS)], {"tas", "aoa"}, 40, "first of"),
    "a delimiter at each end": (HEAD + ",", [f"{row}," for row in ROWS], {"tas", "aoa"}, 40, ""),
    "a row cut short": (HEAD, [*ROWS[:20], "20,1", *ROWS[21:]], {"tas", "aoa"}, 40, "1 rows of another length"),
    "a row too long": (HEAD, [*ROWS[:20], "20,1,1,1", *ROWS[21:]], {"tas", "aoa"}, 40, "first in line 22"),
    "a last row cut off": (HEAD, [*ROWS, "40,1"], {"tas", "aoa"}, 40, "line 42 is cut off and is left out"),
    "NUL at the end": (HEAD, [*ROWS, "\0" * 5000], {"tas", "aoa"}, 40, "from line 42 on hold NUL bytes"),
    "NUL after a cut row": (HEAD, [*ROWS, "40,1" + "\0" * 99], {"tas", "aoa"}, 40, "from line 42 on hold NUL bytes"),
    "comments and empty lines": (HEAD, [*ROWS[:9], "", "# fine", "  ", *ROWS[9:]], {"tas", "aoa"}, 40, ""),
    "all quoted": (HEAD, ['"' + row.replace(",", '","') + '"' for row in ROWS], {"tas", "aoa"}, 40, ""),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD_TABLES)
def test_a_cell_or_row_that_does_not_fit_is_left_out(name: str, tmp_path: Path):
    header, rows, channels, n, note = ODD_TABLES[name]
    log = read_log(write_text(tmp_path / "a.csv", "\n".join([header, *rows]) + "\n"))
    assert set(log.channels) == channels
    assert log.n_samples == n
    assert note in " / ".join(texts(log.notes))
    tas = log.channels["tas"].values / (KT if "[kt]" in header else 1.0)
    known = np.isfinite(tas)
    np.testing.assert_allclose(tas[known], log.time_s[known] + 90.5, rtol=1e-15)
    assert known.sum() >= 31
    if not note:
        assert not any("left out" in text for text in texts(log.notes))


@pytest.mark.parametrize(
    ("header", "rows", "asked", "message"),
    [
        (HEAD, OFF_LATER, {"channel_map": {"aoa": "aoa"}}, "line 17, column 'aoa': not a number, got 'OFF'; mend"),
        (HEAD, ALL_TEXT, {"unit_map": {"aoa": "deg"}}, "line 2, column 'aoa': not a number, got 'CRUISE'"),
        ("time,TAS,TAS", ROWS, {"channel_map": {"tas": "TAS"}}, "columns 2 and 3 are both named 'TAS'; rename"),
        ("time,tas,tas", ROWS, {"keep": ("tas",)}, "columns 2 and 3 are both named 'tas'"),
        (HEAD, [*ROWS[:20], "20,1", "21,1", "22,1", *ROWS[23:]], {}, "line 22 has 2 values, the header names 3"),
        (HEAD, [f"{row},x" if k % 2 else row for k, row in enumerate(ROWS)], {}, "line 3 has 4 values"),
        ("clock,tas", ["12:00:00,90", "12,91"], {"channel_map": {"time": "clock"}}, "'clock': not a time of"),
        ("time;tas", ["0.5;1.5", "1.5;1,5"], {"channel_map": {"tas": "tas"}}, "line 3, column 'tas': not a"),
    ],
)  # fmt: skip
def test_what_was_asked_for_and_is_unusable_is_refused(header, rows, asked, message: str, tmp_path: Path):
    path = write_text(tmp_path / "a.csv", "\n".join([header, *rows]) + "\n")
    with pytest.raises(LogError) as caught:
        read_log(path, **asked)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


NUMBERS = st.floats(allow_nan=False, width=64).map(repr) | st.integers(-(10**25), 10**25).map(str)
NUMBERS |= st.tuples(st.text("0123456789", min_size=1, max_size=25), st.text("0123456789", max_size=25)).map(".".join)


@given(rows=st.lists(st.tuples(NUMBERS, NUMBERS | st.sampled_from(["", " ", "-", "NaN"])), min_size=2, max_size=9))
def test_numbers_are_those_of_float_to_the_last_bit(rows, tmp_path_factory: pytest.TempPathFactory):
    path = write_text(
        tmp_path_factory.getbasetemp() / "bits.csv",
        "time,x,y\n" + "".join(f"{k}, {x} ,{y}\n" for k, (x, y) in enumerate(rows)),
    )
    columns = {track.source: track.values for track in read_csv(str(path), ReadRequest()).columns}
    for values, texts_of in zip((columns["x"], columns["y"]), zip(*rows, strict=True), strict=True):
        expected = [float(text) if text.strip(" -") else np.nan for text in texts_of]
        np.testing.assert_array_equal(values, expected)


def test_a_text_of_many_blocks_is_read_as_row_by_row(tmp_path: Path):
    rng = np.random.default_rng(5)
    values = np.column_stack([0.01 * np.arange(60_000), rng.normal(size=(60_000, 2))])
    rows = [",".join(map(repr, row)) for row in values.tolist()]
    rows[40_000:40_002] = ["# seen", rows[40_000].replace(rows[40_000].split(",")[1], "---"), rows[40_001]]
    log = read_log(
        write_text(
            tmp_path / "a.csv",
            "time,x,mode,y\n" + "\n".join(r.replace(",", ",A,", 2).replace(",A,", ",", 1) for r in rows),
        )
    )
    values[40_000, 1] = 0.5 * (values[39_999, 1] + values[40_001, 1])
    np.testing.assert_allclose(log.channels["x"].values, values[:, 1])
    np.testing.assert_array_equal(log.channels["y"].values, values[:, 2])
    assert "'x': 1 cell is not a number, the first '---' in line 40003: left out" in texts(log.notes)


@given(data=st.data())
def test_a_damaged_garmin_log_is_read_or_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "damaged.csv"
    whole = bytearray(g1000(list(range(30))).encode())
    for _ in range(data.draw(st.integers(0, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(1, len(whole)))])
    try:
        log = read_log(path)
    except LogError:
        return
    assert log.n_samples >= 2


@pytest.mark.realdata
def test_a_recorded_g1000_log_against_the_csv_module(flights: Path):
    path = flights / "reader_samples" / "g1000_c172.csv"
    with open(path, encoding="latin-1") as file:
        lines = list(csv.reader(file, skipinitialspace=True))[2:]
    names, rows = [name.strip() for name in lines[0]], [row for row in lines[1:] if len(row) == len(lines[0])]
    seconds = [sum(f * int(p) for f, p in zip((3600, 60, 1), row[1].split(":"), strict=True)) for row in rows]
    seconds[0] -= 1  # of the only second that is written twice the first is the one before
    log = read_log(path)
    # Of 144 seconds that are missing each is interpolated; the others are what the file says.
    recorded = np.isin(log.time_s, np.array(seconds, float))
    assert np.count_nonzero(~recorded) == 144
    assert set(np.diff(log.time_s)) == {1.0}
    np.testing.assert_array_equal(log.time_s[recorded], np.array(seconds, float))
    for name, source, factor in (("tas", "TAS", KT), ("baro_altitude", "AltB", FT), ("normal_acc", "NormAc", 9.80665)):
        theirs = np.array([float(row[names.index(source)]) for row in rows])
        np.testing.assert_allclose(log.channels[name].values[recorded], factor * theirs, rtol=1e-12)
    assert abs(float(np.median(log.channels["normal_acc"].values))) < 0.5
