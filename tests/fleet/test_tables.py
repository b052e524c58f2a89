"""The tables of a fleet: typed columns, the same in both formats."""

from __future__ import annotations

import csv
import io
import sys
from dataclasses import replace

import pytest

from bfi_cli.fleet import LogAnswer, fleet_files
from bfi_cli.fleet.results import index_page
from bfi_cli.fleet.tables import FLIGHTS, SECOND, table_file, table_names, tables_of
from bfi_cli.serialization import provenance

LARGEST_INDEX = 5_000_000  # bytes, at 10 000 logs


def diagnosis(k: int) -> LogAnswer:
    """Return an answer with texts as long as they become."""
    event = {"state": "declared", "fault": "tas", "magnitude": -3.25, "beyond_tolerance": True, "onset_s": 12.5}
    flight = {"start_s": 0.0, "n_samples": 400, "declared": 1, "fault": "tas", "onset_s": 12.5, "magnitude": -3.25}
    return LogAnswer(
        log=f"/data/flights/of_a_long_name/2026/11/aircraft_{k:05d}_recorder.h5",
        folder=f"aircraft_{k:05d}_recorder",
        key="",
        sha256="0" * 64,
        decision="fault",
        state="fault",
        rank=0,
        summary="pitot icing (or a fault of the airspeed) from 1432.5 s to 1920.5 s, 0.0025 1/s, tas -19 m/s"
        + "x" * 100,
        hidden="static leak lagged bias 43 m of altitude and more than a line holds",
        flight={**flight, "unit": "m/s", "flight_s": 3600.0},
        rows=(event,),
    )


UNREAD = LogAnswer(log="b.csv", folder="b", key="", sha256="", error="b.csv: empty; copy it again", flight={})


def test_csv_cells(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert table_names("info") == {"flights.csv": "flights.parquet", "channels.csv": "channels.parquet"}
    assert {*table_names("diagnose").values()} > {"flights.parquet", "events.parquet"}
    flights, events, constants = tables_of("diagnose", [diagnosis(1), UNREAD])
    assert constants.rows == []
    rows = list(csv.DictReader(io.StringIO(table_file(flights)[1].decode().partition("\n")[2])))
    assert list(rows[0]) == ["log", "aircraft", "sha256", "error", *FLIGHTS["diagnose"]]
    assert (rows[0]["onset_s"], rows[0]["declared"], rows[1]["error"]) == ("12.5", "1", "b.csv: empty; copy it again")
    (event,) = csv.DictReader(io.StringIO(table_file(events)[1].decode().partition("\n")[2]))
    assert (event["magnitude"], event["beyond_tolerance"], event["high"]) == ("-3.25", "true", "")


def test_parquet_has_the_types_and_is_the_same_each_time():
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    assert {"flights.parquet", "events.parquet"} < {*table_names("diagnose")}
    for kind in ("diagnose", "info"):
        for table in tables_of(kind, [UNREAD]):
            types = parquet.read_table(io.BytesIO(table_file(table)[1])).schema.types
            expected = {str: pyarrow.string(), float: pyarrow.float64(), int: pyarrow.int64(), bool: pyarrow.bool_()}
            assert types == [expected[one] for one in table.columns.values()]
    flights, events, _ = tables_of("diagnose", [diagnosis(1), UNREAD])
    assert table_file(flights) == table_file(flights)
    (row,) = parquet.read_table(io.BytesIO(table_file(events)[1])).to_pylist()
    assert (row["fault"], row["magnitude"], row["high"]) == ("tas", -3.25, None)


def test_columns_have_a_name_once():
    for kind, columns in FLIGHTS.items():
        assert not {"log", "aircraft", "sha256", "error"} & {*columns}, kind
        assert not {"log", "aircraft"} & {*SECOND[kind][1]}, kind


def test_the_index_of_ten_thousand_logs_is_small():
    row = len(index_page("diagnose", [diagnosis(k) for k in range(200)], provenance(log_sha256="")))
    first = len(index_page("diagnose", [diagnosis(k) for k in range(100)], provenance(log_sha256="")))
    assert first + (row - first) / 100 * 9900 <= LARGEST_INDEX


def test_the_files_of_a_fleet_without_an_answer():
    files = fleet_files("diagnose", [UNREAD], provenance(log_sha256=""))
    assert b"not read" in files["index.html"]


def test_the_index_has_the_clock_of_an_onset_where_a_log_has_it():
    plain = diagnosis(1)
    timed = replace(plain, flight={**plain.flight, "onset_clock": "2011-07-01T14:01:42.500Z"})
    origin = provenance(log_sha256="")
    page = index_page("diagnose", [plain, timed], origin)
    assert "2011-07-01 14:01:42.500Z" in page
    assert ">clock<" in page
    assert ">clock<" not in index_page("diagnose", [plain], origin)
