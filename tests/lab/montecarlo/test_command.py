"""`bfi montecarlo` from end to end: the same files for any number of workers, stopped and continued, on a cluster."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from noted import texts

from bfi_cli.journal import lines_of_journal
from bfi_cli.lab.montecarlo import running
from bfi_cli.lab.montecarlo.running import open_journal
from bfi_cli.lab.montecarlo.trial import COLUMNS
from bfi_cli.serialization import provenance

ROOT = Path(__file__).parents[3]
FILES = {f"{name}{end}" for name in ("isolation", "magnitude_error") for end in (".png", ".svg", "_figure.csv")} | {
    *("trials.csv", "trials.jsonl", "timings.csv", "summary.json", "scenarios.csv", "decisions.csv", "report.html")
}
# Files with the seconds that trials took, or the moment of the run.
TIMED = {"trials.jsonl", "timings.csv", "summary.json", "report.html"}
RUN = "from bfi_cli.commands import main; main()"


@pytest.fixture
def montecarlo(bfi: Callable, undrawn: None, written: Callable, tmp_path: Path) -> Callable[..., Path]:
    """Run a sweep into a folder of its own, which is returned; the pages of its figures are blank."""

    def run(text: str, name: str, *argv: object, code: int = 0) -> Path:
        outcome = bfi("montecarlo", "-c", written(text), "--out", tmp_path / name, *argv)
        assert outcome.code == code, outcome.stderr
        if code == 0:
            assert outcome.stderr == ""
        return tmp_path / name

    return run


def stop_after(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def interrupted(trial: object) -> object:
        calls.append(trial)
        if len(calls) > n:
            raise KeyboardInterrupt
        return genuine(trial)

    genuine = running.run_trial
    monkeypatch.setattr(running, "run_trial", interrupted)


def test_two_scenarios_from_end_to_end(bfi: Callable, written: Callable, tmp_path: Path):
    outcome = bfi("montecarlo", "-c", written("fast"), "--out", tmp_path / "out", "--json")
    assert (outcome.code, outcome.stderr) == (0, "")
    document = json.loads(outcome.stdout)
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == document
    assert (document["kind"], document["schema"], texts(document["notes"])) == ("montecarlo", 4, [])
    assert document["provenance"]["seed"] == 0
    assert len(document["provenance"]["config_sha256"]) == 64
    assert [scenario["name"] for scenario in document["scenarios"]] == ["active=1", "active=2"]
    for scenario in document["scenarios"]:
        assert scenario["isolation_rate"]["count"] == scenario["isolation_rate"]["of"] == 6
        assert scenario["isolation_rate"]["ci95"] == pytest.approx([0.6097, 1.0], abs=1e-4)
        assert scenario["missed_detection_rate"]["rate"] == scenario["false_alarm_rate"]["rate"] == 0.0
        assert scenario["magnitude_error"]["max"] < 1e-6
        assert scenario["coverage"]["rate"] is None
        assert {key: share["count"] for key, share in scenario["decisions"].items()} == {
            "fault": 6,
            "no_fault": 0,
            "inconclusive": 0,
        }
        assert scenario["wrong_no_fault_rate"]["count"] == 0
        assert scenario["detection_delay_s"] is None
    with (tmp_path / "out" / "trials.csv").open() as file:
        assert next(file) == "# written by bfi\n"
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == 12
    for row in rows:
        truth, estimate = json.loads(row["truth"]), json.loads(row["estimate"])
        assert estimate == pytest.approx(truth, rel=1e-6)
        assert (row["decision"], row["isolated"], row["error"]) == ("fault", "true", "")
        assert json.loads(row["states"]) == dict.fromkeys(truth, "declared")
        assert {row[kind] for kind in ("abrupt", "oscillating", "slow")} == {"fault", "inconclusive"}
        assert json.loads(row["wrong_no_fault"]) == []


@pytest.mark.slow  # processes start in seconds; test_engine and test_trial say it in the quick set
def test_workers_do_not_change_a_byte(montecarlo: Callable[..., Path]):
    one, two = (montecarlo("fast", f"{n}", "--trials", 6, "--workers", n) for n in (1, 2))
    for name in FILES - TIMED:
        assert (one / name).read_bytes() == (two / name).read_bytes(), name


def test_stopped_and_continued_is_not_stopped(montecarlo: Callable[..., Path], monkeypatch: pytest.MonkeyPatch):
    whole = montecarlo("fast", "whole")
    for n in (5, 3):
        with monkeypatch.context() as patch:
            stop_after(n, patch)
            part = montecarlo("fast", "part", *(["--resume"] if n == 3 else []), code=130)
        assert {path.name for path in part.iterdir()} == {"trials.jsonl"}
    (_, *lines), (_, *all_lines) = (lines_of_journal(folder / "trials.jsonl") for folder in (part, whole))
    assert len(lines) == 5 + 3
    assert [line["row"] for line in lines] == [line["row"] for line in all_lines[:8]]
    assert "add --resume to continue it" in complaint(montecarlo, "fast", "part")
    again = montecarlo("fast", "part", "--resume")
    assert {path.name for path in again.iterdir()} == FILES
    for name in FILES - TIMED:
        assert (again / name).read_bytes() == (whole / name).read_bytes(), name
    assert len((again / "timings.csv").read_text().splitlines()) == 14


def complaint(montecarlo: Callable[..., Path], *argv: object) -> str:
    """Return what the command says when it refuses."""
    with pytest.raises(AssertionError) as said:
        montecarlo(*argv)
    return str(said.value)


@pytest.mark.parametrize("torn", [1, 17, 160])
def test_a_torn_line_is_done_again(
    montecarlo: Callable[..., Path], sweep: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, torn: int
):
    whole = (montecarlo("fast", "whole") / "trials.csv").read_bytes()
    with monkeypatch.context() as patch:
        stop_after(7, patch)
        montecarlo("fast", "part", code=130)
    journal = tmp_path / "part" / "trials.jsonl"
    journal.write_bytes(journal.read_bytes()[:-torn])
    assert (montecarlo("fast", "part", "--resume") / "trials.csv").read_bytes() == whole


def test_a_finished_sweep_is_continued_with_more_trials(
    montecarlo: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
):
    longer = (montecarlo("fast", "longer") / "trials.csv").read_bytes()
    montecarlo("fast", "part", "--trials", 4)
    seen = []
    genuine = running.run_trial
    monkeypatch.setattr(running, "run_trial", lambda trial: seen.append(trial.number) or genuine(trial))
    assert (montecarlo("fast", "part", "--resume") / "trials.csv").read_bytes() == longer
    assert seen == [4, 4, 5, 5]
    montecarlo("fast", "part", "--resume")
    assert seen == [4, 4, 5, 5]
    shorter = complaint(montecarlo, "fast", "part", "--resume", "--trials", 5)
    assert "has 6 trials per scenario, got --trials 5" in shorter


def test_another_sweep_is_not_continued(montecarlo: Callable[..., Path], monkeypatch: pytest.MonkeyPatch):
    with monkeypatch.context() as patch:
        stop_after(2, patch)
        montecarlo("fast", "part", code=130)
    assert "of another configuration, seed, log or version" in complaint(
        montecarlo, "fast", "part", "--resume", "--seed", 1
    )


def test_failing_trials_are_rows_and_a_note(bfi: Callable, written: Callable):
    outcome = bfi("montecarlo", "-c", written("failing"), "--json")
    document = json.loads(outcome.stdout)
    assert outcome.code == 0
    good, bad = document["scenarios"]
    assert (good["failed"], bad["failed"]) == (0, 2)
    assert (bad["isolation_rate"]["rate"], bad["false_alarm_rate"]["rate"], bad["magnitude_error"]) == (0.0, None, None)
    (note,) = texts(document["notes"])
    assert note.startswith("2 of 2 trials of 'model.order=90' failed")


def test_table_on_a_terminal(bfi: Callable, written: Callable, monkeypatch: pytest.MonkeyPatch):
    path = written("fast")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "100")
    outcome = bfi("montecarlo", "-c", path, "--trials", 3, "--progress")
    assert outcome.code == 0
    assert "active=1" in outcome.stdout
    assert "100 (43.9-100)" in outcome.stdout
    assert "6/6" in outcome.stderr


@pytest.mark.parametrize(
    ("argv", "code", "words"),
    [
        ([], 2, "--config is missing; give --config CONFIG"),
        (["-c", "fast", "--workers", 2, "--scheduler", "tcp://h:1"], 2, "exclude each other; keep one"),
        (["-c", "fast", "--resume"], 2, "give --out DIR"),
        (["-c", "fast", "--workers", 0], 2, "--workers: too small, got 0; give 1 or more"),
        (["-c", "fast", "--trials", "x"], 2, "--trials: not a whole number"),
        (["-c", "missing.yaml"], 2, "missing.yaml: cannot be read"),
        (["-c", "nochannel"], 3, "noise: no channel 'tass'; citation has:"),
        (["-c", "nolog"], 3, "nothing.h5"),
        (["-c", "fast", "--out", "/dev/null/x"], 2, "give another --out"),
    ],
)
def test_complaints(bfi: Callable, written: Callable, argv: list, code: int, words: str):
    texts = {
        "fast": "fast",
        "nochannel": "record: {model: citation}\ndictionary: dictionary.yaml\nactive: 1\nnoise: {tass: 1}\n",
        "nolog": "record: {log: nothing.h5}\ndictionary: dictionary.yaml\nactive: 1\n",
    }
    outcome = bfi("montecarlo", *(written(texts[word]) if word in texts else word for word in argv))
    assert outcome.code == code, outcome.stderr
    assert words in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert outcome.stdout == ""


def test_a_journal_without_rows_is_no_obstacle(montecarlo: Callable[..., Path], sweep: Callable, tmp_path: Path):
    origin = provenance(log_sha256="", config_sha256="")
    with open_journal(tmp_path / "part", sweep("fast"), digest="x", origin=origin, resume=False)[0]:
        pass
    assert {path.name for path in montecarlo("fast", "part").iterdir()} == FILES


@pytest.mark.slow
def test_a_cluster_of_two_workers_does_not_change_a_byte(montecarlo: Callable[..., Path]):
    distributed = pytest.importorskip("distributed")
    one = montecarlo("noisy", "one")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, processes=True, dashboard_address="127.0.0.1:0", silence_logs=50
    ) as cluster:
        two = montecarlo("noisy", "two", "--scheduler", cluster.scheduler_address)
    assert (one / "trials.csv").read_bytes() == (two / "trials.csv").read_bytes()


@pytest.mark.slow
def test_ctrl_c(montecarlo: Callable[..., Path], written: Callable, tmp_path: Path):
    whole = (montecarlo("noisy", "whole", "--trials", 12) / "trials.csv").read_bytes()
    for workers in (1, 2):
        out = tmp_path / f"part_{workers}"
        argv = [sys.executable, "-c", RUN, "montecarlo", "-c", written("noisy"), "--out", out, "--trials", 12]
        process = subprocess.Popen(
            [*map(str, argv), "--workers", str(workers)],
            cwd=ROOT,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        journal = out / "trials.jsonl"
        for _ in range(1200):
            if journal.exists() and len(journal.read_bytes().splitlines()) > 10:
                break
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        assert process.communicate(timeout=60)[1] == "bfi: interrupted\n"
        assert process.returncode == 130
        assert 10 < len(journal.read_bytes().splitlines()) < 4 * 12 + 1
        assert (montecarlo("noisy", out.name, "--trials", 12, "--resume") / "trials.csv").read_bytes() == whole
