"""`bfi compare`: the table, the document, methods that cannot run, and executables of others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

LOG = Path(__file__).parents[3] / "data" / "citation_bias.h5"
QUICK = ("--only", "arx-residual", "--only", "null-space")


def program(folder: Path, body: str) -> Path:
    path = folder / "program"
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return path


def outcomes(text: str) -> dict:
    return {one["method"]: one for one in json.loads(text)["outcomes"]}


def test_methods_are_scored_against_the_injected_fault(bfi, tmp_path: Path):
    made = bfi("compare", LOG, *QUICK, "--only", "dmae", "--model", "citation", "--json")
    assert (made.code, made.stderr) == (0, "")
    document = json.loads(made.stdout)
    assert (document["kind"], document["schema"]) == ("compare", 4)
    assert [one["name"] for one in document["truth"]] == ["bias_13.8"]
    found = outcomes(made.stdout)
    assert list(found) == ["dmae", "arx-residual", "null-space"]
    assert {name: one["score"]["isolated"] for name, one in found.items()} == {
        "dmae": "channel",
        "arx-residual": "channel",
        "null-space": "fault",
    }
    assert all(abs(one["score"]["onset_error_s"]) <= 0.15 for one in found.values())
    assert set(found["dmae"]["agrees"]) == {"arx-residual", "null-space"}


@pytest.mark.slow
def test_the_report_of_a_stored_document_is_that_of_the_command(bfi, tmp_path: Path):
    made = bfi("compare", LOG, *QUICK, "--out", tmp_path / "made")
    drawn = bfi("report", tmp_path / "made" / "result.json", "--out", tmp_path / "drawn")
    assert (made.code, drawn.code) == (0, 0)
    assert drawn.stdout.splitlines()[0] == made.stdout.splitlines()[0]
    files = [{path.name for path in (tmp_path / folder).iterdir()} for folder in ("made", "drawn")]
    assert files[0] == files[1]
    assert files[0] >= {"result.json", "report.html", "comparison.png", "methods.csv"}


def test_a_method_without_what_it_needs_stands_in_the_table_with_the_reason(bfi):
    made = bfi("compare", LOG, "--only", "risro", "--only", "dmae")
    assert made.code == 0
    assert "needs a dictionary whose entries state their onsets" in made.stdout
    assert "needs a linear model of the aircraft" in made.stdout


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("exit 3", "ends with exit code 3"),
        ("echo no; echo first >&2; echo 'no licence' >&2; exit 3", "exit code 3; its last line on stderr: no licence"),
        (
            "echo wait >&2; exec sleep 600",
            "still runs after 2 s; give a longer --timeout; its last line on stderr: wait",
        ),
        ("exec sleep 600 > /dev/null 2>&1", "still runs after 2 s"),
        ("kill -9 $$", "ends with exit code 137"),
        ("exec yes", "writes more than 2 MB; a statement has some hundred bytes"),
        ("yes >&2 & echo nonsense; sleep 0.1", "writes no JSON, got b'nonsense"),
        ("""echo '{"decision": "no_fault", "suspects": [{"channel": "tas"}]}'""", "no_fault with 1 suspect; declare"),
        (
            """echo '{"decision": "fault", "suspects": [{"channel": "tas", "onset_s": 9, "offset_s": 4}]}'""",
            "tas ends at 4 s, before its onset at 9 s",
        ),
        ("echo nonsense", "writes no JSON, got b'nonsense"),
        ("echo '[1]'", "not a mapping"),
        ("""echo '{"decision": "perhaps"}'""", "'perhaps'"),
        ("""echo '{"decision": "fault", "suspects": [{"onset_s": 1.0}]}'""", "no key 'channel'"),
    ],
)
def test_a_program_that_crashes_hangs_or_writes_nonsense_is_one_line(bfi, tmp_path: Path, body: str, reason: str):
    path = program(tmp_path, body)
    made = bfi(
        "compare", LOG, "--only", "mine", "--program", f"mine={path}", "--timeout", 2 if "600" in body else 60, "--json"
    )
    assert (made.code, made.stderr) == (0, "")
    one = outcomes(made.stdout)["mine"]
    assert one["statement"] is None
    assert reason in one["reason"]
    assert "\n" not in one["reason"]


def test_a_program_that_is_not_there_is_one_line(bfi, tmp_path: Path):
    made = bfi("compare", LOG, "--only", "mine", "--program", f"mine={tmp_path / 'none'}", "--json")
    assert made.code == 0
    assert "does not start" in outcomes(made.stdout)["mine"]["reason"]


def test_a_program_is_given_the_log_without_the_truth_and_is_scored(bfi, tmp_path: Path):
    said = '{"decision": "fault", "suspects": [{"channel": "tas", "shape": "bias", "onset_s": 14.0, "magnitude": 5.0}]}'
    path = program(tmp_path, f"cp \"$1\" '{tmp_path}/given.h5'; echo '{said}'")
    made = bfi("compare", LOG, "--only", "mine", "--program", f"mine={path}", "--json")
    score = outcomes(made.stdout)["mine"]["score"]
    assert (score["isolated"], score["false_alarms"]) == ("fault", 0)
    assert (score["onset_error_s"], score["magnitude_error"]) == pytest.approx((0.2, 0.25))
    info = json.loads(bfi("info", tmp_path / "given.h5", "--json").stdout)
    assert {one["name"] for one in info["channels"]} >= {"tas", "elevator"}
    assert "bias_13.8" not in (tmp_path / "given.h5").read_bytes().decode("latin-1")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--only", "mll"), "--only: no method 'mll'; did you mean 'ml'?"),
        (("--program", "ml=./x"), "--program: 'ml' is a method of this program"),
        (("--program", "x"), "--program: expected NAME=PATH, got 'x'"),
    ],
)
def test_names_that_cannot_be_are_refused(bfi, options: tuple[str, ...], message: str):
    made = bfi("compare", LOG, *options)
    assert (made.code, made.stdout) == (2, "")
    assert made.stderr.startswith(message)


def test_an_input_that_is_named_and_not_there_is_refused_and_no_reason(bfi):
    made = bfi("compare", LOG, "--only", "arx-residual", "--input", "stick")
    assert (made.code, made.stdout) == (3, "")
    assert "no channel 'stick'" in made.stderr
