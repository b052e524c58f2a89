"""A method, a reader and a command are each one file and one row of a table: one of each is added and used."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.flightlog import read_log

LOG = Path(__file__).parents[1] / "data" / "citation_bias.h5"
CHANNELS = ("elevator", "tas")
METHOD = '''"""The first entry of a dictionary, whatever the log says."""

from dataclasses import replace

from .arx_residual import identify_by_residual


def identify_by_order(window, regression, config, progress):
    """Name what the residual test estimates, under the name of this method."""
    result = identify_by_residual(window, regression, config, progress)
    return replace(result, solver=replace(result.solver, termination="named the first"))
'''
READER = '''"""Numbers in rows of three after a line."""

import numpy as np

from .raw import RawLog, Track


def is_rows(head):
    """Say whether a file begins as one with rows."""
    return head.startswith(b"ROWS\\n")


def read_rows(path, asked):
    """Return the signals of a file with rows."""
    with open(path, "rb") as file:
        values = np.frombuffer(file.read()[5:]).reshape(-1, 3)
    tracks = [Track(source=name, values=values[:, k + 1], unit=unit) for k, (name, unit) in enumerate(UNITS)]
    return RawLog(columns=[Track(source="time", values=values[:, 0], unit="s"), *tracks])


UNITS = (("elevator", "rad"), ("tas", "m/s"))
'''
COMMAND = '''"""`bfi count`: the samples of a log."""

from ..report.content import ReportContent
from ..serialization import document_of
from .analysis import Answer, Asked, analysis
from .options import CHANNELS, FILES, log_argument


@analysis("count", log_argument, "config_path", "from_s", "to_s", *CHANNELS, *FILES, "as_json")
def command(asked: Asked) -> Answer:
    """Count the samples of LOG."""
    log = asked.flight()
    return Answer(
        document=lambda origin: document_of("count", {"n_samples": log.n_samples}, (), origin),
        content=count_content,
        log_sha256=log.sha256,
    )


def count_content(document, _units=None, *, where="result"):
    """Return what the report of a count holds."""
    return ReportContent(category="Count", title="log", facts=(("Samples", str(document["n_samples"])),))
'''
# Adds the files of a folder to the packages and the rows to their tables, and runs the command lines of a JSON list.
WITH_ROWS = """
import io, json, sys
from contextlib import redirect_stdout
folder, lines = json.loads(sys.stdin.read())
import bfi_cli.analysis, bfi_cli.commands, bfi_cli.flightlog, bfi_cli.model
bfi_cli.analysis.MOST_SAMPLES = 0  # leaves out the scan beside the identification
for package in (bfi_cli.commands, bfi_cli.flightlog, bfi_cli.model):
    package.__path__.append(f"{folder}/{package.__name__.rpartition('.')[2]}")
from bfi_cli.commands import COMMANDS, report, run_command
from bfi_cli.flightlog import formats, rows
from bfi_cli.methods import METHODS, Method
COMMANDS["count"] = "The samples of a log."
METHODS["in-order"] = Method("the first entry (in-order)", "model.in_order:identify_by_order", intervals=False)
formats.WITH_GROUPS += ((rows.is_rows, "rows:read_rows"),)
report.KINDS["count"] = ("commands.count", "count_content")
answers = []
for line in lines:
    with redirect_stdout(io.StringIO()) as printed:
        code = run_command(line)
    answers.append((code, printed.getvalue()))
print(json.dumps(answers))
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return what command lines print that use the files which are added."""
    folder, log = tmp_path_factory.mktemp("rows"), read_log(LOG)
    for name, text in {"model/in_order": METHOD, "flightlog/rows": READER, "commands/count": COMMAND}.items():
        (folder / name).parent.mkdir()
        (folder / f"{name}.py").write_text(text)
    values = np.column_stack([log.time_s, *(log.channel(name).values for name in CHANNELS)])
    (folder / "log.rows").write_bytes(b"ROWS\n" + values.tobytes())
    atoms = [{"name": "step", "shape": "bias", "channel": "tas", "onset_s": 13.8}]
    (folder / "atoms.json").write_text(json.dumps({"relative_to": "log", "atoms": atoms}))
    asked = ["-d", f"{folder}/atoms.json", "--input", "elevator", "--rate", "10", "--order", "6", "--json"]
    lines = {
        "method": ["identify", str(LOG), "--method", "in-order", *asked],
        "rivals": ["compare", str(LOG), "--only", "in-order", *asked],
        "rows": ["identify", f"{folder}/log.rows", *asked],
        "log": ["identify", str(LOG), *asked],
        "command": ["count", f"{folder}/log.rows", "--json", "--out", f"{folder}/out"],
        "report": ["report", f"{folder}/out/result.json"],
        "help": ["--help"],
    }
    words = json.dumps([str(folder), list(lines.values())])
    run = subprocess.run([sys.executable, "-c", WITH_ROWS], input=words, capture_output=True, text=True, check=True)
    given = dict(zip(lines, json.loads(run.stdout), strict=True))
    assert {name: code for name, (code, _) in given.items()} == dict.fromkeys(lines, 0), run.stderr
    return {name: printed for name, (_, printed) in given.items()}


def test_a_method_is_added_by_a_module_and_a_row(answers: dict[str, str]):
    document = json.loads(answers["method"])
    assert (document["solver"]["method"], document["solver"]["termination"]) == ("in-order", "named the first")
    assert [fault["name"] for fault in document["faults"]] == ["step"]
    assert "in-order" in answers["rivals"]


def test_a_reader_is_added_by_a_module_and_a_row(answers: dict[str, str]):
    """What it reads gives the same answer as the log it was made of, to the bit."""
    rows, log = json.loads(answers["rows"]), json.loads(answers["log"])
    for key in ("decision", "faults", "model", "solver"):
        assert rows[key] == log[key], key
    assert rows["vaf"]["output"] == log["vaf"]["output"]
    assert rows["provenance"]["log_sha256"] != log["provenance"]["log_sha256"]


def test_a_command_is_added_by_a_module_and_a_row(answers: dict[str, str]):
    n_samples = read_log(LOG).n_samples
    assert json.loads(answers["command"])["n_samples"] == n_samples
    assert "count" in answers["help"]
    assert f"Samples  {n_samples}" in answers["report"].replace("\xa0", " ")
