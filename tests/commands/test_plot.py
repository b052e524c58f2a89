"""`bfi plot` on small real files: what it writes, what its document holds, what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from noted import texts

from bfi_cli.flightlog.phases import PARTS
from bfi_cli.report.content import MAX_POINTS

RATE_HZ = 5.0
T = np.arange(0.0, 900.0, 1.0 / RATE_HZ)
CONTENT = {"channels.svg", "channels.png", "channels_figure.csv", "phases.csv", "windows.csv", "report.html"}


def write_flight(path: Path, *, tas_offset: float = 0.0, **attributes: float) -> Path:
    """Write a flight at 50 m/s: a take-off at 100 s, a climb, a cruise with strokes of the elevator, a landing."""
    tas = 50.0 * np.interp(T, [0, 90, 105, 130, 780, 800, 815, 900], [0, 0, 0.65, 1, 1, 0.7, 0, 0])
    height = np.interp(T, [0, 110, 300, 560, 800, 900], [0, 0, 1000, 1000, 0, 0])
    strokes = 0.05 * np.sign(np.sin(2 * np.pi * T / 5.0)) * ((T > 400.0) & (T < 460.0))
    with h5py.File(path, "w") as file:
        for name, unit, values in (
            ("time", "s", T),
            ("tas", "m/s", tas + tas_offset * (T > 450.0)),
            ("altitude", "m", 200.0 + height),
            ("pitch", "rad", 0.05 + 0.0 * T),
            ("elevator", "rad", strokes),
            ("sat", "K", 280.0 - 0.0065 * height),
        ):
            file[name] = values
            file[name].attrs["units"] = unit
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(tmp_path_factory.mktemp("flight") / "flight.h5")


def result(path: Path, **document: object) -> Path:
    whole = {"kind": "diagnose", "schema": 2, "events": [], "provenance": {"log_sha256": ""}, **document}
    path.write_text(json.dumps(whole))
    return path


def event(name: str, onset_s: float, **more: object) -> dict[str, object]:
    return {"fault": name, "channels": ["tas"], "state": "declared", "onset_s": onset_s, "offset_s": None, **more}


def document_of(bfi: Callable, *argv: object) -> dict:
    outcome = bfi("plot", *argv, "--json")
    assert (outcome.code, outcome.stderr) == (0, "")
    return json.loads(outcome.stdout)


def test_the_files_of_a_plot(bfi: Callable, log: Path, tmp_path: Path) -> None:
    outcome = bfi("plot", log, "--out", tmp_path / "out")
    assert outcome.code == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == CONTENT | {"zoom.html", "result.json"}
    assert "Windows to analyse" in outcome.stdout
    assert "take-off" in outcome.stdout


def test_the_document_of_the_contract(bfi: Callable, log: Path) -> None:
    document = document_of(bfi, log)
    assert (document["kind"], document["schema"], "series" in document) == ("plot", 4, False)
    parts = [one for one in document["phases"] if one["phase"] in PARTS]
    assert [one["phase"] for one in parts][:4] == ["ground", "take-off", "climb", "cruise"]
    assert all(set(one) == {"phase", "from_s", "to_s"} for one in parts)
    (window,) = document["windows"]
    assert 380.0 < window["start_s"] < 400.0 < 460.0 < window["stop_s"] < 490.0
    assert window["rank"] == 1
    assert [one["name"] for one in document["channels"]] == ["tas", "altitude", "pitch", "elevator"]
    assert len(document["provenance"]["log_sha256"]) == 64


def test_the_phases_are_those_of_info(bfi: Callable, log: Path) -> None:
    info = json.loads(bfi("info", log, "--json").stdout)
    document = document_of(bfi, log)
    assert (document["phases"], document["windows"]) == (info["phases"], info["windows"])


@pytest.mark.usefixtures("undrawn")
def test_a_stored_plot_is_drawn_again_as_it_was(bfi: Callable, log: Path, tmp_path: Path) -> None:
    bfi("plot", log, "--out", tmp_path / "out")
    assert bfi("report", tmp_path / "out" / "result.json", "--out", tmp_path / "again").code == 0
    for path in (tmp_path / "out").iterdir():
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes(), path.name


def test_channels_are_drawn_in_the_order_asked_for_also_derived_and_mapped(bfi: Callable, log: Path) -> None:
    named = document_of(bfi, log, "--channel", "sat", "--channel", "p_static", "--channel", "tas")
    assert [one["name"] for one in named["channels"]] == ["sat", "p_static", "tas"]
    assert any("'p_static' is derived from altitude" in note for note in texts(named["notes"]))
    mapped = document_of(bfi, log, "--channel", "roll=pitch")
    assert [one["name"] for one in mapped["channels"]] == ["tas", "altitude", "roll", "elevator"]


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_more_channels_than_a_page_holds_go_on_a_second_one(bfi: Callable, log: Path, tmp_path: Path) -> None:
    names = ["tas", "altitude", "pitch", "elevator", "sat", "p_static", "p_total", "q_impact", "cas", "time_of_day"]
    path = tmp_path / "many.h5"
    write_flight(path)
    with h5py.File(path, "a") as file:
        file["cas"], file["time_of_day"] = 0.9 * file["tas"][()], T
    argv = [word for name in names for word in ("--channel", name)]
    bfi("plot", path, *argv, "--out", tmp_path / "out")
    assert {"channels.svg", "channels_2.svg"} <= {one.name for one in (tmp_path / "out").iterdir()}


def test_a_part_of_a_flight_knows_the_phases_of_the_whole(bfi: Callable, log: Path) -> None:
    document = document_of(bfi, log, "--from", 320, "--to", 480)
    whole = document_of(bfi, log)
    assert document["phases"] == [one for one in whole["phases"] if one["from_s"] < 480 and one["to_s"] > 320]
    assert (document["from_s"], document["to_s"], document["logs"][0]["n_samples"]) == (320, 480, 800)


@pytest.mark.usefixtures("undrawn")
def test_a_long_curve_keeps_its_spike(bfi: Callable, tmp_path: Path) -> None:
    path = tmp_path / "spike.csv"
    values = np.zeros(60_000)
    values[31_234] = 7.0
    rows = "".join(f"{k / 100.0},{value}\n" for k, value in enumerate(values))
    path.write_text(f"time [s],tas [m/s]\n{rows}")
    bfi("plot", path, "--out", tmp_path / "out")
    (series,) = json.loads((tmp_path / "out" / "result.json").read_text())["series"]
    assert len(series["values"]) < 10_000
    assert (max(series["values"]), series["time_s"][series["values"].index(7.0)]) == (7.0, 312.34)
    drawn = [row for row in (tmp_path / "out" / "channels_figure.csv").read_text().splitlines() if ",7.0," in row]
    assert len(drawn) == 1
    assert len((tmp_path / "out" / "channels_figure.csv").read_text().splitlines()) < MAX_POINTS + 10


@pytest.mark.usefixtures("undrawn")
def test_no_line_is_drawn_over_a_gap(bfi: Callable, tmp_path: Path) -> None:
    path = tmp_path / "gap.csv"
    times = [t for t in np.arange(0.0, 4000.0, 0.1) if not 1000.0 < t < 1200.0]
    path.write_text("time [s],tas [m/s]\n" + "".join(f"{t:.1f},{50 + t % 7}\n" for t in times))
    bfi("plot", path, "--out", tmp_path / "out")
    (series,) = json.loads((tmp_path / "out" / "result.json").read_text())["series"]
    inside = [value for t, value in zip(series["time_s"], series["values"], strict=True) if 1000.5 < t < 1199.5]
    assert inside == [None]
    assert series["time_s"] == sorted(series["time_s"])
    rows = (tmp_path / "out" / "channels_figure.csv").read_text().splitlines()
    assert [row for row in rows if ",,," in row]


@pytest.mark.usefixtures("undrawn")
def test_two_logs_are_laid_over_each_other(bfi: Callable, log: Path, tmp_path: Path) -> None:
    other = write_flight(tmp_path / "other.h5", tas_offset=-5.0)
    out = tmp_path / "out"
    bfi("plot", log, other, "--channel", "tas", "--out", out)
    document = json.loads((out / "result.json").read_text())
    first, second = document["series"]
    assert [one["path"] for one in document["logs"]] == [str(log), str(other)]
    assert (first["log"], second["log"]) == (0, 1)
    difference = np.array(second["values"]) - np.array(first["values"])
    assert set(np.round(difference, 6)) == {0.0, -5.0}
    assert f"phases and windows are those of {log}" in texts(document["notes"])
    labels = {row.split(",")[1] for row in (out / "channels_figure.csv").read_text().splitlines()[2:]}
    assert labels == {"flight.h5", "other.h5"}


def test_a_channel_named_must_be_in_every_log(bfi: Callable, log: Path, tmp_path: Path) -> None:
    path = tmp_path / "few.csv"
    path.write_text("time [s],tas [m/s]\n" + "".join(f"{t},50\n" for t in range(20)))
    outcome = bfi("plot", log, path, "--channel", "elevator", "--json")
    assert (outcome.code, outcome.stdout) == (3, "")
    assert f"{path}: no channel 'elevator'; the log has: tas; map one with" in outcome.stderr
    assert document_of(bfi, log, path)["logs"][1]["path"] == str(path)


@pytest.mark.usefixtures("undrawn")
def test_the_events_of_a_result(bfi: Callable, log: Path, tmp_path: Path) -> None:
    events = [
        event("pitot_icing", 430.0, offset_s=520.0),
        event("aoa", 600.0, state="suspected"),
        event("roll", 100.0, state="excluded"),
    ]
    document = document_of(bfi, log, "--events", result(tmp_path / "r.json", events=events))
    assert [(one["name"], one["state"], one["onset_s"], one["offset_s"]) for one in document["events"]] == [
        ("pitot_icing", "declared", 430.0, 520.0),
        ("aoa", "suspected", 600.0, None),
    ]
    late = document_of(bfi, log, "--events", tmp_path / "r.json", "--to", 200)
    assert "2 of 2 events lie outside 0 to 200 s" in texts(late["notes"])


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        ("identify", {"faults": [{"name": "icing", "shape": "drift", "channel": "tas", "onset_s": 4.0}]}, "icing"),
        ("start-time", {"faults": [{"shape": "bias", "channel": "tas", "onset_s": 4.0, "offset_s": None}]}, "bias"),
        ("detect", {"alarms": [{"channel": "tas", "time_s": 5.0, "onset_s": 4.0}]}, "alarm"),
        (
            "start-time",
            {"faults": [], "candidates": [{"name": "x", "channel": "tas", "state": "suspected", "onset_s": 4.0}]},
            "x",
        ),
    ],
)
def test_every_analysis_that_knows_a_time_has_events(
    bfi: Callable, log: Path, tmp_path: Path, kind: str, content: dict, expected: str
) -> None:
    path = tmp_path / "r.json"
    path.write_text(json.dumps({"kind": kind, "schema": 2, "provenance": {"log_sha256": ""}, **content}))
    (one,) = document_of(bfi, log, "--events", path)["events"]
    assert (one["analysis"], one["name"], one["channels"], one["onset_s"]) == (kind, expected, ["tas"], 4.0)


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
@pytest.mark.usefixtures("undrawn")
def test_the_result_of_an_analysis_is_drawn(bfi: Callable, tmp_path: Path) -> None:
    data = Path(__file__).parents[2] / "data" / "citation_bias.csv"
    assert bfi("start-time", data, "--rate", "10", "--order", "4", "--out", tmp_path / "onset").code == 0
    document = document_of(bfi, data, "--events", tmp_path / "onset" / "result.json")
    (found,) = [one for one in document["events"] if one["state"] == "declared"]
    assert found["onset_s"] == pytest.approx(13.8, abs=0.5)
    assert not any("another log" in note for note in texts(document["notes"]))


def test_the_result_of_another_log_is_named(bfi: Callable, log: Path, tmp_path: Path) -> None:
    path = result(tmp_path / "r.json", provenance={"log_sha256": "0" * 64})
    (note,) = [note for note in texts(document_of(bfi, log, "--events", path)["notes"]) if "another log" in note]
    assert note.startswith(str(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "r.json: not JSON"),
        ("[1]", "r.json: not a result of this program, it has no 'kind'; give the result.json of"),
        ('{"kind": "info"}', "r.json: kind is 'info', which has no events; give the result.json of"),
        ('{"kind": "detect", "schema": 1}', "r.json: schema is 1, this program reads 4; run bfi detect again"),
        ('{"kind": "detect", "schema": 2}', "r.json: no key 'provenance'; the file is damaged"),
        ('{"kind": "detect", "schema": 2, "provenance": {}}', "r.json: no key 'alarms'; the file is damaged"),
        ('{"kind": "detect", "schema": 2, "provenance": {}, "alarms": 3}', "r.json: damaged, "),
        (
            '{"kind": "detect", "schema": 2, "provenance": {}, "alarms": [{"channel": "tas", "time_s": NaN}]}',
            "r.json: damaged, ",
        ),
        (
            '{"kind": "diagnose", "schema": 2, "provenance": {}, "events": [{"channels": "tas", "onset_s": 1}]}',
            "r.json: damaged, ",
        ),
    ],
)
def test_what_is_no_result_with_events_is_refused(
    bfi: Callable, log: Path, tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "r.json").write_text(text)
    outcome = bfi("plot", log, "--events", tmp_path / "r.json", "--out", tmp_path / "out")
    assert (outcome.code, outcome.stdout) == (2, "")
    assert message in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


ABSURD = {
    "largest float": lambda tas: np.where(T > 450.0, np.finfo(np.float64).max, -tas),
    "infinite": lambda tas: np.where(T > 450.0, np.inf, tas),
    "not a number": lambda tas: np.nan * tas,
    "tiny": lambda tas: 1e-310 * tas,
    "1e300": lambda tas: 1e300 * tas,
    "constant": lambda tas: 7.0 + 0.0 * tas,
}


@pytest.mark.first_rows(2)
@pytest.mark.usefixtures("vectors")
@pytest.mark.parametrize("kind", ABSURD)
def test_absurd_values_are_left_out_of_the_curve_and_named(bfi: Callable, tmp_path: Path, kind: str) -> None:
    path = write_flight(tmp_path / "absurd.h5")
    with h5py.File(path, "a") as file:
        file["tas"][:] = ABSURD[kind](file["tas"][()])
    assert bfi("plot", path, "--channel", "tas", "--channel", "altitude", "--out", tmp_path / "out").code == 0
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    drawn = np.array(next(one for one in document["series"] if one["channel"] == "tas")["values"], dtype=float)
    assert not (np.abs(drawn) > 1e30).any()
    named = [note for note in texts(document["notes"]) if "'tas' is no measurement in" in note]
    assert len(named) == (kind in ("largest float", "1e300", "infinite"))


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("step_s", [1e-9, 1e9], ids=["nanoseconds", "decades"])
def test_a_time_axis_of_any_length_is_drawn(bfi: Callable, tmp_path: Path, step_s: float) -> None:
    with h5py.File(tmp_path / "two.h5", "w") as file:
        file["time"], file["tas"] = step_s * np.arange(2.0), np.array([50.0, 51.0])
    outcome = bfi("plot", tmp_path / "two.h5", "--unit", "time=s", "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("vectors")
def test_logs_of_clocks_decades_apart_are_laid_over_each_other(bfi: Callable, log: Path, tmp_path: Path) -> None:
    other = write_flight(tmp_path / "other.h5")
    with h5py.File(other, "a") as file:
        file["time"][:] = T + 1.7e9
    document = document_of(bfi, log, other)
    assert document["to_s"] - document["from_s"] == pytest.approx(1.7e9 + T[-1])
    assert bfi("plot", log, other, "--out", tmp_path / "out").code == 0
    aligned = document_of(bfi, log, other, "--align", "auto")
    assert aligned["to_s"] == pytest.approx(T[-1], abs=0.1)


@pytest.mark.realdata
def test_recorded_flights(bfi: Callable, flights: Path, tmp_path: Path) -> None:
    """A jet, a drone and a training aircraft at 10, 5 and 1 Hz."""
    for name in ("citation_20190312_123416.h5", "px4_flight3", "reader_samples/g1000_c172.csv"):
        out = tmp_path / Path(name).name
        assert bfi("plot", flights / name, "--out", out).code == 0
        document = json.loads((out / "result.json").read_text())
        assert document["phases"]
        assert len(document["channels"]) >= 5


def test_a_log_without_time_or_with_missing_samples_is_drawn_as_asked(bfi: Callable, log: Path, tmp_path: Path) -> None:
    path = write_flight(tmp_path / "bare.h5")
    with h5py.File(path, "a") as file:
        del file["time"]
        file["pitch"][1000:1003] = np.nan
    document = document_of(bfi, path, "--sample-rate", RATE_HZ, "--fill", 1)
    assert [note for note in texts(document["notes"]) if "--sample-rate 5 Hz" in note]
    assert [note for note in texts(document["notes"]) if "'pitch'" in note and "interpolated" in note]
    assert document["phases"] == document_of(bfi, log)["phases"]


@pytest.mark.first_rows(1)
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("align", ["auto", "12.4"])
def test_two_recorders_of_one_flight_differ_by_what_one_of_them_errs(
    bfi: Callable, log: Path, tmp_path: Path, align: str
) -> None:
    other, out = write_flight(tmp_path / "other.h5", tas_offset=-5.0), tmp_path / "out"
    with h5py.File(other, "a") as file:
        file["time"][:] = T - 12.4
        del file["sat"]
    assert bfi("plot", log, other, "--diff", "--align", align, "--out", out).code == 0
    document = json.loads((out / "result.json").read_text())
    tas, height, *_ = document["differences"]
    assert (tas["channel"], tas["unit"], tas["largest"]) == ("tas", "m/s", pytest.approx(-5.0, abs=0.5))
    assert abs(height["mean"]) < 0.1
    (drawn,) = [one for one in document["series"] if one["log"] is None and one["channel"] == "tas"]
    settled = [value for t, value in zip(drawn["time_s"], drawn["values"], strict=True) if 500.0 < t < 700.0]
    np.testing.assert_allclose(settled, -5.0, atol=1e-3)
    assert (out / "differences.csv").is_file()
    assert "\\u0394 tas" in (out / "zoom.html").read_text()
    assert bfi("report", out / "result.json", "--out", tmp_path / "again").code == 0
    assert (tmp_path / "again" / "zoom.html").read_bytes() == (out / "zoom.html").read_bytes()


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        (["--diff"], 2, "bfi plot: --diff is about two logs, got 1; give two"),
        (["--align", "1"], 2, "bfi plot: --align is about two logs, got 1; give two"),
        (["LOG", "--align", "soon"], 2, "--align: not a shift, got 'soon'; write --align 3.2, in s, or --align auto"),
        (["LOG", "--diff", "--align", "nan"], 2, "--align: not a shift, got 'nan'"),
        (["LOG", "--diff", "--align", "1e6"], 3, "shares no time with"),
        (["LOG", "--align", "1e300"], 2, "become those of no flight, 1e+300 s to 1e+300 s; give a smaller shift, or"),
        (["LOG", "--align", "-2e12"], 2, "become those of no flight, -2e+12 s to -2e+12 s; give a smaller shift, or"),
    ],
)
def test_what_cannot_be_subtracted_is_refused(
    bfi: Callable, log: Path, argv: list[str], code: int, message: str
) -> None:
    outcome = bfi("plot", log, *(log if word == "LOG" else word for word in argv), "--json")
    assert (outcome.code, outcome.stdout) == (code, "")
    assert message in outcome.stderr


def test_events_of_the_second_log_move_with_its_clock(bfi: Callable, log: Path, tmp_path: Path) -> None:
    other = write_flight(tmp_path / "other.h5", tas_offset=-5.0)
    found = {"events": [event("aoa", 440.0, offset_s=500.0)]}
    paths = []
    for path in (log, other):
        sha256 = document_of(bfi, path)["logs"][0]["sha256"]
        paths.append(result(tmp_path / f"{path.stem}.json", provenance={"log_sha256": sha256}, **found))
    argv = [log, other, "--events", paths[0], "--events", paths[1], "--align", 30]
    assert [(one["onset_s"], one["offset_s"]) for one in document_of(bfi, *argv)["events"]] == [
        (440.0, 500.0),
        (470.0, 530.0),
    ]
