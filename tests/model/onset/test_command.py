"""`bfi start-time` and `bfi calibrate`: documents, files, exit codes, complaints."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.image import imread
from noted import texts
from screens import check_screen

from bfi_cli.model.onset import onset_content, onset_document
from bfi_cli.model.onset.report import onset_from_document
from bfi_cli.serialization import Provenance, from_plain

DATA = Path(__file__).parents[3] / "data"
BIAS, CLEAN = DATA / "citation_bias.h5", DATA / "citation_clean.h5"
QUICK = ("--rate", "10", "--order", "4", "--shape", "bias")
FAULT_KEYS = {"shape", "channel", "magnitude", "unit", "physical", "sd", "ci95", "onset_s", "onset_ci95", "offset_s"}
KEYS = {"kind", "schema", "decision", "false_alarm", "p_value", "statistic", "threshold", "calibration", "faults"}


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where a calibration is written by the first test that needs it."""
    return tmp_path_factory.mktemp("calibration") / "table.json"


@pytest.fixture
def calibrated(bfi, table: Path) -> Path:
    """Return the table of steps of a quarter of a second through the clean flight."""
    if not table.exists():
        outcome = bfi("calibrate", CLEAN, "-o", table, "--length", 16, "--step", 0.25, *QUICK)
        assert (outcome.code, outcome.stderr) == (0, "")
    return table


def test_a_table_says_what_is_wrong_with_it(bfi, tmp_path: Path):
    outcome = bfi("calibrate", CLEAN, "-o", tmp_path / "few.json", "--length", 16, "--step", 5, *QUICK)
    assert outcome.code == 0
    few, *_ = texts(json.loads((tmp_path / "few.json").read_text())["notes"])
    assert "windows are too few, bfi start-time asks for 20" in few


@pytest.mark.parametrize(
    "words",
    [("start-time",), ("start-time", "--rate", "none"), ("identify",), ("identify", "-d", "airdata")],
    ids=" ".join,
)
def test_a_record_that_is_too_long_for_one_model_is_refused(bfi, tmp_path: Path, words: tuple[str, ...]):
    path, rng = tmp_path / "day.csv", np.random.default_rng(0)
    time_s, elevator = np.arange(0.0, 25_000.0), 0.03 * rng.choice([-1.0, 1.0], 25_000)
    columns = np.column_stack([time_s, elevator, 100.0 + elevator + 0.01 * rng.standard_normal(25_000)])
    np.savetxt(path, columns, delimiter=",", header="time,elevator,tas", comments="", fmt="%.5g")
    outcome = bfi(words[0], path, *words[1:])
    assert (outcome.code, outcome.stdout) == (3, "")
    assert outcome.stderr.strip() == (
        f"{path}: 25000 rows at 1 Hz are too many to search with one model (at most 20000); choose a part with "
        "--from/--to, or give bfi diagnose for the whole record"
    )


def test_stated_onsets_in_a_record_that_is_too_long_for_one_model_are_refused(bfi, tmp_path: Path):
    path, n = tmp_path / "day.h5", 360_001
    with h5py.File(path, "w") as file:
        for name, values in (("time", np.arange(n) / 100.0), ("tas", np.arange(n)), ("elevator", np.arange(n))):
            file.create_dataset(name, data=values, dtype=np.float64)
    for rate, words in (("none", "360001 rows at 100 Hz"), (101, "363601 rows at 101 Hz")):
        outcome = bfi("identify", path, "-d", "thesis", "--rate", rate)
        assert (outcome.code, outcome.stdout) == (3, "")
        assert outcome.stderr.strip() == (
            f"{path}: {words} are too many for one model (at most 360000); leave out --rate or give a lower one, "
            "choose a part with --from/--to, or give bfi diagnose for the whole record"
        )


@pytest.mark.parametrize("log", [BIAS, CLEAN])
def test_a_faulty_and_a_healthy_log_are_one_screen(bfi, calibrated: Path, log: Path):
    command = ("start-time", log, *QUICK, "--from", 5, "--to", 21, "--calibration", calibrated)
    content = onset_content(json.loads(bfi(*command, "--json", "--series").stdout))
    check_screen(bfi(*command).stdout.splitlines(), content)


def test_the_document(bfi, calibrated: Path):
    outcome = bfi(
        "start-time", BIAS, *QUICK, "--from", 5, "--to", 21, "--calibration", calibrated, "--json", "--series"
    )
    document = json.loads(outcome.stdout)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert set(document) >= KEYS | {"profile", "notes", "provenance", "log", "model"}
    assert (document["kind"], document["decision"]) == ("start-time", "fault")
    assert document["false_alarm"] == 0.01
    n_windows = len(json.loads(calibrated.read_text())["tables"][0]["statistics"]["bias"])
    assert document["calibration"] == {
        "source": str(calibrated),
        "matches": True,
        "n_windows": n_windows,
        "length_s": pytest.approx(16.0, abs=2.0),
    }
    # So clear a step that no number of windows is rarer than one in all of them and this.
    assert document["p_value"] == pytest.approx(1.0 / (n_windows + 1))
    (fault,) = document["faults"]
    assert set(fault) >= FAULT_KEYS
    assert fault["onset_s"] == pytest.approx(13.8, abs=0.011)
    assert fault["magnitude"] == pytest.approx(4.0, abs=0.05)
    profile = document["profile"]
    assert profile["shape"] == ["bias"]
    assert len(profile["onset_s"]) == len(profile["statistic"][0]) == len(profile["magnitude"][0])
    origin = from_plain(Provenance, document["provenance"], where="provenance")
    assert onset_document(onset_from_document(document), origin) == document


@pytest.mark.slow
def test_the_files(bfi, calibrated: Path, tmp_path: Path):
    outcome = bfi("start-time", BIAS, *QUICK, "--calibration", calibrated, "--out", tmp_path / "deep" / "out", "--json")
    files = {path.name: path.read_bytes() for path in (tmp_path / "deep" / "out").iterdir()}
    figures = {f"{name}{end}" for name in ("profile", "outputs", "hidden") for end in (".svg", ".png", "_figure.csv")}
    tables = {f"{name}.csv" for name in ("faults", "candidates", "profile", "shapes")}
    assert set(files) == {*figures, *tables, "report.html", "result.json"}
    assert b"true airspeed reads 4.0" in files["report.html"]
    whole = json.loads(files["result.json"])
    assert json.loads(outcome.stdout) == {key: whole[key] for key in whole if key not in ("series", "profile")}
    (row,) = csv.DictReader(io.StringIO(files["faults.csv"].decode().removeprefix("# written by bfi\n")))
    assert float(row["onset_s"]) == pytest.approx(13.8, abs=0.011)
    assert float(row["onset_low_s"]) < float(row["onset_s"]) < float(row["onset_high_s"])
    assert imread(io.BytesIO(files["profile.png"])).std() > 0.05


@pytest.mark.usefixtures("undrawn")
def test_a_stored_result_is_drawn_again(bfi, calibrated: Path, tmp_path: Path):
    bfi("start-time", BIAS, *QUICK, "--calibration", calibrated, "--out", tmp_path / "out")
    outcome = bfi("report", tmp_path / "out" / "result.json", "--out", tmp_path / "again", "--json", "--series")
    assert json.loads(outcome.stdout) == json.loads((tmp_path / "out" / "result.json").read_text())
    for name in ("profile_figure.csv", "report.html"):
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()
    document = json.loads(outcome.stdout)
    del document["series"]
    (tmp_path / "damaged.json").write_text(json.dumps(document))
    damaged = bfi("report", tmp_path / "damaged.json")
    assert (damaged.code, damaged.stderr.count("\n")) == (2, 1)
    assert "damaged.json: no key 'series'; the file is damaged" in damaged.stderr


def test_the_terminal(bfi, calibrated: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "dumb")
    lines = bfi("start-time", BIAS, *QUICK, "--calibration", calibrated).stdout.splitlines()
    assert lines[0].startswith("FAULT  true airspeed reads 4.0")
    # A command to paste is folded by the terminal.
    assert max(len(line) for line in lines if not line.startswith("To decide")) <= 80


@pytest.mark.first_rows(2)
@pytest.mark.parametrize(
    ("log", "options", "code"),
    [
        (BIAS, ("--fail-on", "fault"), 10),
        (BIAS, ("--strict", "--to", "28"), 4),
        (CLEAN, ("--fail-on", "fault"), 0),
        (BIAS, ("--strict", "--from", "5", "--to", "21"), 0),
    ],
)
def test_exit_codes(bfi, calibrated: Path, log: Path, options: tuple[str, ...], code: int):
    assert bfi("start-time", log, *QUICK, "--calibration", calibrated, *options).code == code


@pytest.mark.parametrize(
    ("options", "code", "complaint"),
    [
        (("--method", "newton"), 2, "--method: not one of the choices, got 'newton'; known: scan, thesis"),
        (("--frequency", "2"), 2, "--frequency: not a band, got 2; write --frequency 0.1:2, in Hz"),
        (("--calibration", "none.json"), 2, "none.json"),
        (("--calibration", "self"), 3, "--calibration self needs"),
        (("--output", "cas"), 3, "no channel 'cas'"),
        (("--shape", "cosine"), 2, "--shape: not one of the choices"),
        (("--shape", "samples"), 2, "the shape samples has no file"),
        (("--samples", "x.csv"), 2, "shapes has no samples"),
        (("--shape", "samples", "--samples", "none.csv"), 2, "none.csv"),
        (("--false-alarm", "2"), 2, "--false-alarm: "),
    ],
)
def test_complaints_are_one_line(bfi, options: tuple[str, ...], code: int, complaint: str):
    outcome = bfi("start-time", BIAS, *QUICK, *options)
    assert (outcome.code, outcome.stdout) == (code, "")
    assert complaint in outcome.stderr
    assert outcome.stderr.count("\n") == 1


def test_calibrate_joins_windows(bfi, calibrated: Path, tmp_path: Path):
    path = tmp_path / "t.json"
    path.write_bytes(calibrated.read_bytes())
    bfi("calibrate", CLEAN, "-o", path, "--length", 16, "--step", 4, "--append", *QUICK)
    (joined,) = json.loads(path.read_text())["tables"]
    assert len(joined["statistics"]["bias"]) > 25 + 1


def test_calibrate_where_no_window_fits(bfi, tmp_path: Path):
    outcome = bfi("calibrate", CLEAN, "-o", tmp_path / "t.json", "--length", 60, *QUICK)
    assert outcome.code == 3
    assert "no window" in outcome.stderr
    assert not (tmp_path / "t.json").exists()
