"""What every shape keeps: it is injected, identified, looked for, diagnosed and reported; one entry adds a shape."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.commands import run_command
from bfi_cli.faults.shapes import IN_DICTIONARY, SCANNED, SHAPES
from bfi_cli.flightlog import Channel, read_log, write_log

CLEAN = Path(__file__).parents[2] / "data" / "citation_clean.h5"
QUICK = ("--rate", "10", "--order", "2", "--json", "--series")
HEAD = "SHAPES: Mapping[str, FaultShape] = {\n"
# It rises to 1 as the square of what a lag has left to rise: a row as somebody may add it.
ENTRY = """    "late_bias": FaultShape(
        signal=lambda elapsed_s, *, time_constant_s: (1.0 - np.exp(-elapsed_s / time_constant_s)) ** 2,
        formula="(1 - exp(-(t - onset) / time constant))^2.",
        kind="abrupt",
        label="late bias",
        says="reads {size} too {side} after a slow start",
        keys=(TIME_CONSTANT,),
        is_scanned=True,
        stands_out_as="bias",
    ),
"""
# Runs the command lines of a JSON list with the entry in the table of shapes, and prints their exit codes.
WITH_ENTRY = """
import importlib.machinery, json, sys
loader, (head, entry, lines) = importlib.machinery.SourceFileLoader, json.loads(sys.stdin.read())
get_code = loader.get_code

def with_entry(self, name):
    if name != "bfi_cli.faults.shapes":
        return get_code(self, name)
    return compile(self.get_source(name).replace(head, head + entry), self.path, "exec")

loader.get_code = with_entry
from bfi_cli.commands import run_command
print("codes", [run_command(line) for line in lines])
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a log of half a minute at 20 Hz that has both pressures, and a course of samples."""
    folder, log = tmp_path_factory.mktemp("shapes"), read_log(CLEAN).take(slice(None, None, 5))
    beside = {"altitude": ("m", 3000.0 + 2.0 * log.time_s), "tat": ("K", np.full(log.n_samples, 270.0))}
    made = {key: Channel(name=key, source=key, unit=unit, values=x) for key, (unit, x) in beside.items()}
    write_log(replace(log, channels={**log.channels, **made}), folder / "clean.h5")
    (folder / "course.csv").write_text("0,0\n2,1\n")
    return folder


def lines_of(shape: str, folder: Path) -> list[list[str]]:
    """Return the command lines that take a shape from its fault to a report."""
    entry = SHAPES.get(shape, SHAPES["lagged_bias"])
    slowly_s = 8.0 if entry.lines is None else 60.0
    values = {"frequency_hz": 0.5, "time_constant_s": slowly_s, "duration_s": 3.0, "file": f"{folder}/course.csv"}
    keys = {key.name: values[key.name] for key in entry.keys if key.required}
    size = {"magnitude": 4.0 if entry.acts_on == "channel" else 0.02} if entry.has_magnitude else {}
    channel = {} if entry.lines is not None else {"channel": "tas"}
    spec = ",".join([shape, *(f"{key}={value}" for key, value in {"onset_s": 12, **channel, **size, **keys}.items())])
    log, atoms = f"{folder}/{shape}.h5", f"{folder}/{shape}.json"
    Path(atoms).write_text(json.dumps({"relative_to": "log", "atoms": [{"shape": shape, "onset_s": 12.0, **keys}]}))
    lines = [["inject", f"{folder}/clean.h5", "--fault", spec, "-o", log]]
    if entry.acts_on == "course":  # nobody knows what to inject
        lines, log = [], f"{folder}/clean.h5"
    if shape in IN_DICTIONARY or shape not in SHAPES:
        lines.append(["identify", log, "-d", atoms, "--output", "tas", "--from", "4", "--to", "24", *QUICK])
    if shape in SCANNED or shape not in SHAPES:
        sampled = ["--samples", values["file"]] if shape == "samples" else []
        lines.append(["start-time", log, "--shape", shape, *sampled, "--calibration", "gaussian", *QUICK])
    # Of a shape that is added, that it is searched for is all there is to see.
    only = ["--config", atoms.replace(".json", ".yaml")] if shape not in SHAPES else []
    if only:
        Path(only[-1]).write_text(f"start_time: {{shapes: [{shape}]}}\n")
    return [*lines, ["diagnose", log, "--workers", "1", "--json", "--series", *only]]


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.usefixtures("undrawn")
def test_every_shape_goes_through_every_command(shape: str, folder: Path, capsys: pytest.CaptureFixture[str]):
    for line in lines_of(shape, folder):
        capsys.readouterr()
        assert (run_command(line), line[0]) == (0, line[0]), capsys.readouterr().err
        printed = capsys.readouterr().out
        if line[0] == "inject":
            assert [fault.shape for fault in read_log(line[-1]).truth.faults] == [shape]
        elif line[0] == "start-time":
            assert shape in {row["shape"] for row in json.loads(printed)["candidates"]}
        if line[0] != "inject":
            document = folder / f"{shape}_{line[0]}.json"
            document.write_text(printed)
            assert run_command(["report", str(document), "--out", str(folder / f"{shape}_{line[0]}")]) == 0


def test_a_line_that_loses_all_its_pressure_has_a_signal(folder: Path):
    log, atoms = str(folder / "empty.h5"), folder / "empty.json"
    keys = {"onset_s": 12.0, "time_constant_s": 2.0}
    atoms.write_text(json.dumps({"relative_to": "log", "atoms": [{"shape": "static_leak", **keys}]}))
    spec = ",".join(["static_leak", *(f"{key}={value}" for key, value in keys.items())])
    assert run_command(["inject", str(folder / "clean.h5"), "--fault", spec, "-o", log]) == 0
    assert run_command(["identify", log, "-d", str(atoms), "--output", "tas", *QUICK]) == 0


def test_a_shape_is_added_by_one_entry(folder: Path):
    words = json.dumps((HEAD, ENTRY, lines_of("late_bias", folder)))
    run = subprocess.run([sys.executable, "-c", WITH_ENTRY], input=words, capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == f"codes {[0] * 4}", run.stderr
    assert '"late_bias"' in run.stdout
