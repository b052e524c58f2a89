"""`bfi detect`: document, files, exit codes, complaints, and the report drawn again."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from noted import texts
from screens import check_screen, screen

from bfi_cli.config import Config, merge
from bfi_cli.detection import detect_content, detect_document, detect_faults
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, read_log, write_log
from bfi_cli.serialization import provenance

QUICK = merge(Config(), {"detect.train": (0.0, 8.0), "conditioning.rate_hz": 10.0})


@pytest.fixture(scope="module")
def failing(flown: Callable[..., FlightLog], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("detect") / "failing.h5"
    write_log(flown(Fault(shape="bias", channel="aoa", magnitude=0.02, onset_s=12.0)), path)
    return path


@pytest.fixture(scope="module")
def healthy(flown: Callable[..., FlightLog], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("detect") / "healthy.h5"
    write_log(flown(seed=4), path)
    return path


@pytest.fixture(scope="module")
def detected(failing: Path) -> dict[str, Any]:
    result = detect_faults(read_log(failing), QUICK)
    return detect_document(result, provenance(log_sha256=""))


def test_the_document(bfi, failing: Path):
    outcome = bfi("detect", failing, "--train", "0:8", "--json", "--series")
    document = json.loads(outcome.stdout)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert (document["kind"], document["schema"], document["decision"]) == ("detect", 4, "fault")
    assert document["ready_s"] == pytest.approx(8.0)
    alarm = document["alarms"][0]
    assert {"channel", "time_s", "statistic", "threshold"} <= set(alarm)
    assert alarm["channel"] == "aoa"
    assert set(document) >= {"notes", "provenance", "log", "calibration", "series"}
    assert document["verdicts"] == {"abrupt": "fault", "oscillating": "inconclusive", "slow": "inconclusive"}
    assert [one["channel"] for one in document["candidates"]] == document["outputs"]
    (declared,) = (one for one in document["candidates"] if one["state"] == "declared")
    assert (declared["channel"], declared["magnitude"]) == ("aoa", alarm["size"])


def test_a_failing_and_a_healthy_log_are_one_screen(bfi, failing: Path, healthy: Path, detected: dict[str, Any]):
    result = detect_faults(read_log(healthy), QUICK)
    for document in (detected, detect_document(result, provenance(log_sha256=""))):
        content = detect_content(document)
        check_screen(screen(content), content)
    outcome = bfi("detect", failing, "--train", "0:8", "--rate", 10)
    assert outcome.stdout.splitlines()[0] == screen(detect_content(detected), 120)[0]
    assert "Channels watched" not in outcome.stdout
    assert "Channels watched" in bfi("detect", failing, "--train", "0:8", "--rate", 10, "--verbose").stdout


@pytest.mark.parametrize(
    ("size", "ci95", "said"),
    [
        (0.02, [0.0175, 0.0225], "angle of attack reads 1.1 deg too high"),
        (0.02, [-0.0175, 0.0575], "angle of attack fails, size not determined,"),
        (0.02, [-9.0, 9.0], "angle of attack fails, size not determined,"),
        (None, None, "angle of attack fails, size not determined,"),
    ],
)
def test_a_size_is_told_as_far_as_it_is_known(detected, size: float | None, ci95: object, said: str):
    (alarm,) = detected["alarms"]
    content = detect_content({**detected, "alarms": [{**alarm, "size": size, "ci95": ci95}]})
    assert content.verdict.startswith(f"{said} from ")
    (row,) = next(table.rows for table in content.tables if table.name == "alarms")
    assert row[-1].startswith("not determined" if "not determined" in said else "1.15 deg (1.00 to 1.29)")


def test_the_kinds_required_decide(bfi, healthy: Path):
    plain = json.loads(bfi("detect", healthy, "--train", "0:8", "--rate", 10, "--require", "abrupt", "--json").stdout)
    assert (plain["decision"], plain["verdicts"]["abrupt"]) == ("no_fault", "no_fault")
    strict = bfi("detect", healthy, "--train", "0:8", "--rate", 10, "--strict", "--json")
    assert (strict.code, json.loads(strict.stdout)["decision"]) == (4, "inconclusive")


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_the_tolerance_decides_what_is_excluded(bfi, healthy: Path, tmp_path: Path):
    limit = {one["channel"]: one["excluded_above"] for one in json.loads(_plain(bfi, healthy))["candidates"]}
    for factor, state, decision in ((1.01, "excluded", "no_fault"), (0.99, "not_seen", "inconclusive")):
        stated = ("--tolerance", f"aoa={factor * limit['aoa']!r}")
        document = json.loads(_plain(bfi, healthy, *stated))
        states = {one["channel"]: one["state"] for one in document["candidates"]}
        assert (states["aoa"], document["decision"]) == (state, decision)
    assert any(note.startswith("for steps of aoa: a longer healthy time") for note in texts(document["notes"]))
    (unseen,) = (one for one in document["candidates"] if one["state"] == "not_seen")
    assert re.fullmatch(r"worst for a step at [0-9.]+ s; [0-9.]+ deg at most for 95 % of the onsets", unseen["note"])
    answer = bfi("detect", healthy, "--train", "0:8", *stated, "--out", tmp_path / "out").stdout
    assert answer.startswith("CANNOT TELL  steps of angle of attack of up to ")
    assert 'class="verdict inconclusive' in (tmp_path / "out" / "report.html").read_text("utf-8")


def _plain(bfi, log: Path, *options: str) -> str:
    return bfi("detect", log, "--train", "0:8", "--require", "abrupt", *options, "--json").stdout


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_the_files_and_the_report_again(bfi, failing: Path, tmp_path: Path):
    outcome = bfi("detect", failing, "--train", "0:8", "--out", tmp_path / "out", "--fail-on", "fault")
    assert outcome.code == 10
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names >= {"result.json", "report.html", "detection.png", "detection.svg", "alarms.csv", "channels.csv"}
    assert names >= {"hidden.png", "hidden.svg", "candidates.csv"}
    assert bfi("report", tmp_path / "out" / "result.json", "--out", tmp_path / "again").code == 0
    for name in ("hidden_figure.csv", "detection_figure.csv", "candidates.csv", "report.html"):
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()


@pytest.mark.slow
def test_every_key_of_the_configuration_acts_and_the_command_line_wins(bfi, failing: Path, tmp_path: Path):
    file = tmp_path / "c.yaml"
    file.write_text(
        "inputs: [elevator_inner_left]\noutputs: [aoa, pitch]\nwindow: {from_s: 1, to_s: 18}\n"
        "conditioning: {rate_hz: 10}\nrecorder: {edge_hz: 20}\n"
        "detect: {train: [1, 9], false_alarm: 0.05, method: parity, turns: false}\n"
    )
    document = json.loads(bfi("detect", failing, "-c", file, "--json").stdout)
    options = ("--input", "elevator_inner_left", "--output", "aoa", "--output", "pitch", "--from", 1, "--to", 18)
    more = ("--rate", 10, "--recorder", 20, "--train", "1:9", "--false-alarm", 0.05, "--method", "parity", "--no-turns")
    other = json.loads(bfi("detect", failing, *options, *more, "--json").stdout)
    for one in (document, other):
        del one["provenance"]
    assert document == other
    assert (document["train"], document["false_alarm"], document["log"]["rate_hz"]) == ([1.0, 9.0], 0.05, 10.0)
    won = json.loads(bfi("detect", failing, "-c", file, "--train", "2:8", "--output", "aoa", "--json").stdout)
    assert (won["train"], won["outputs"], won["inputs"]) == ([2.0, 8.0], ["aoa"], ["elevator_inner_left"])


def test_strict_asks_for_a_threshold_that_is_known_to_hold(bfi, failing: Path, tmp_path: Path):
    short = bfi("detect", failing, "--train", "0:8", "--strict", "--fail-on", "fault", "--json")
    assert (short.code, json.loads(short.stdout)["is_calibrated"]) == (4, False)
    exact = bfi("simulate", "b747", "-o", tmp_path / "clean.h5", "--duration", 20)
    assert exact.code == 0
    clean = bfi("detect", tmp_path / "clean.h5", "--require", "abrupt", "--strict", "--json")
    assert (clean.code, json.loads(clean.stdout)["is_calibrated"]) == (0, True)


@pytest.mark.slow
def test_what_comes_next_is_a_command_that_runs(bfi, failing: Path):
    document = json.loads(bfi("detect", failing, "--train", "0:8", "--json").stdout)
    words = document["commands"][0].split()
    assert words[:2] == ["bfi", "identify"]
    outcome = bfi(*words[1:], "--rate", "10", "--order", "2", "--json")
    assert outcome.code == 0, outcome.stderr
    assert json.loads(outcome.stdout)["decision"] in ("fault", "no_fault", "inconclusive")


@pytest.mark.parametrize(
    ("options", "code", "complaint"),
    [
        (("--train", "8"), 2, "--train: not a stretch of time, got 8; write --train 1160:1500, in s"),
        (("--train", "0:99"), 2, "--train: 0:99 is not inside the window"),
        (("--train", "8:2"), 2, "--train: must end after it starts, got 8 to 2 s"),
        (("--rate", "banana"), 2, "--rate: not a number or one of the choices, got 'banana'"),
        (("--recorder", "banana"), 2, "--recorder: not a number or one of the choices, got 'banana'"),
        (("--recorder", "-1"), 2, "--recorder: must be greater than 0, got -1"),
        (("--output", "cas"), 3, "no channel 'cas'"),
        (("--method", "hankel"), 2, "--method: not one of the choices, got 'hankel'"),
        (("--false-alarm", "0"), 2, "--false-alarm: must be greater than 0, got 0.0"),
        (("--tolerance", "cas=1"), 2, "--tolerance: 'cas' is no output of this analysis; known: tas_rate, aoa,"),
        (("--output", "aoa", "--input", "aoa"), 2, "command line: 'aoa' is both an input and an output"),
    ],
)
def test_complaints_are_one_line(bfi, failing: Path, options: tuple[str, ...], code: int, complaint: str):
    outcome = bfi("detect", failing, *options)
    assert (outcome.code, outcome.stdout) == (code, "")
    assert complaint in outcome.stderr
    assert outcome.stderr.count("\n") == 1
