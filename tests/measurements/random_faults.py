"""Random faults of every shape, size, onset and end: each command answers or refuses them, and has no defect.

Every trial is drawn from its own number: python tests/measurements/random_faults.py --first 0 --last 60 --results FILE
runs those that the file does not hold yet and prints the counts of all that it holds.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jsbsim_trials import tour
from numbered import run_numbered

from bfi_cli.aircraft import deviations, find_model, simulate, time_axis
from bfi_cli.commands import run_command
from bfi_cli.errors import BfiError
from bfi_cli.faults import Fault, fault_to_dict, has_channel
from bfi_cli.faults.shapes import SHAPES
from bfi_cli.flightlog import FlightLog, inject, read_log, write_log

FLIGHTS = Path(__file__).resolve().parents[3] / "shared" / "flights"
DATA = Path(__file__).resolve().parents[2] / "data"
SHIPPED = ("citation_bias.h5", "citation_clean.h5", "citation_two_faults.h5", "px4_bias.ulg")
AIRCRAFT = ("c172p", "737", "citation")
# Exit codes of an answer, of one that is not trusted, and of a log that cannot be used.
ALLOWED = {0, 3, 4, 10}
# Commands, and their shares of the trials.
COMMANDS: Mapping[str, float] = {"diagnose": 0.5, "start-time": 0.25, "identify": 0.25}
# A cut has at most so many samples: the scan of a simulated flight at 100 Hz takes minutes.
LENGTHS_S, MOST_SAMPLES = (60.0, 300.0), 6000
# Of the standard deviation of a channel, or of 1 where it rests.
SIZES = (1e-3, 1e4)
WHOLE_SHARE = 0.02  # of the trials on recorded flights, each as long as ten others


@cache
def source(name: str) -> FlightLog:
    """Return a log of `data`, a recorded flight by its file, or minutes of a simulated one."""
    if name not in AIRCRAFT:
        return read_log((DATA if name in SHIPPED else FLIGHTS) / name)
    if name == "citation":
        model, time_s = find_model(name), time_axis(duration_s=120.0, rate_hz=20.0)
        u = deviations(model, "3211-pairs", time_s, amplitude=0.035, start_s=5.0, step_s=1.0)
        return simulate(model, u, rng=np.random.default_rng(0), rate_hz=20.0)
    return tour(name, seed=0, duration_s=300.0)


def drawn_log(rng: np.random.Generator) -> FlightLog:
    """Return a log of `data`, a simulated flight, or a cut of a recorded one where the flights are there."""
    recorded = sorted(path.name for path in FLIGHTS.glob("*.h5"))
    kind = rng.choice(3, p=(0.25, 0.25, 0.5) if recorded else (0.5, 0.5, 0.0))
    name = str(rng.choice((SHIPPED, AIRCRAFT, recorded)[kind]))
    log = source(name)
    if kind == 0 or (kind == 2 and rng.random() < WHOLE_SHARE):
        return log
    first_s, last_s = log.ends()
    length_s = min(float(np.exp(rng.uniform(*np.log(LENGTHS_S)))), last_s - first_s, MOST_SAMPLES / log.rate_hz)
    from_s = float(rng.uniform(first_s, last_s - length_s))
    return log.window(from_s, from_s + length_s)


def drawn_fault(rng: np.random.Generator, log: FlightLog) -> Fault:
    """Return a fault of any shape but those whose course a file holds or nobody knows, of any size, onset and end."""
    shape = str(rng.choice([name for name in SHAPES if name not in ("samples", "free")]))
    entry, (first_s, last_s) = SHAPES[shape], log.ends()
    drawn = {
        "slope": lambda: float(10.0 ** rng.uniform(-4.0, 3.0)),
        "frequency_hz": lambda: float(10.0 ** rng.uniform(-3.0, 1.5)),
        "phase_rad": lambda: float(rng.uniform(-7.0, 7.0)),
        "phase_reference": lambda: "onset",
        "time_constant_s": lambda: float(10.0 ** rng.uniform(-2.0, 3.5)),
        "duration_s": lambda: float(10.0 ** rng.uniform(-2.0, 3.5)),
        "cabin_altitude_m": lambda: float(rng.uniform(-300.0, 4000.0)),
    }
    keys: dict[str, Any] = {key.name: drawn[key.name]() for key in entry.keys if key.required or rng.random() < 0.5}
    if has_channel(shape):
        keys["channel"] = str(rng.choice(sorted(log.channels)))
    if entry.has_magnitude:
        size = 10.0 ** rng.uniform(*np.log10(SIZES)) if entry.acts_on == "channel" else 10.0 ** rng.uniform(-5.0, 1.0)
        if entry.acts_on == "channel":
            size *= float(np.nanstd(log.channel(keys["channel"]).values)) or 1.0
        keys["magnitude"] = float(size) * (1.0 if entry.is_loss else float(rng.choice([-1.0, 1.0])))
    step_s = 1.0 / log.rate_hz
    # In one of five trials at the first or last samples of the log.
    at_edge = rng.random() < 0.2
    onset_s = float(rng.choice([first_s, first_s + step_s, last_s - step_s, last_s])) if at_edge else None
    keys["onset_s"] = float(rng.uniform(first_s, last_s)) if onset_s is None else onset_s
    if rng.random() < 0.5:
        lasts_s = min(float(10.0 ** rng.uniform(-1.0, 3.0)), last_s - keys["onset_s"])
        keys["offset_s"] = keys["onset_s"] + max(lasts_s, step_s)
    return Fault(shape=shape, **keys)


def run(*argv: str) -> tuple[int, str]:
    """Run a command line; return its exit code and what is wrong with it, "" for nothing."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as the command itself does
        code = run_command(argv)
    lines = err.getvalue().splitlines()
    if crash := re.search(r"report it with (\S+)", err.getvalue()):
        text = Path(crash[1]).read_text(encoding="utf-8")
        Path(crash[1]).unlink()
        return code, " | ".join(text.splitlines()[-6:])
    if code not in ALLOWED:
        return code, f"exit {code}: {lines[:2]}"
    if code == 3:
        return code, "" if len(lines) == 1 and not out.getvalue() else f"{len(lines)} lines of error: {lines[:3]}"

    def refuse(name: str) -> float:
        raise ValueError(f"{name} in JSON")

    try:
        json.loads(out.getvalue(), parse_constant=refuse)
    except ValueError as error:
        return code, f"stdout is no JSON document: {error}"
    return code, ""


def trial(number: int) -> dict[str, Any]:
    """Return what came of one log with one to three faults, given to one command."""
    rng = np.random.default_rng([36, number])
    log, command = drawn_log(rng), str(rng.choice(list(COMMANDS), p=list(COMMANDS.values())))
    faults = [drawn_fault(rng, log) for _ in range(rng.choice([1, 2, 3], p=[0.6, 0.25, 0.15]))]
    row: dict[str, Any] = {
        "number": number,
        "log": Path(log.path).name,
        "span_s": log.ends(),
        "command": command,
        "faults": [fault_to_dict(fault) for fault in faults],
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.h5"
        try:
            write_log(inject(log, faults), path)
        except BfiError as error:
            return row | {"code": None, "wrong": "", "refused": str(error)}
        code, wrong = run(command, str(path), "--json")
    return row | {"code": code, "wrong": wrong}


def report(rows: list[dict[str, Any]]) -> None:
    """Print the counts, and what is wrong."""
    codes = Counter(f"{row['command']} {'refused by inject' if row['code'] is None else row['code']}" for row in rows)
    print(f"{len(rows)} trials:", ", ".join(f"{name}: {n}" for name, n in sorted(codes.items())))
    shapes = Counter(fault["shape"] for row in rows for fault in row["faults"])
    print("faults:", ", ".join(f"{name} {n}" for name, n in shapes.most_common()))
    for row in rows:
        if row["wrong"]:
            print(f"  {row['number']}: {row['command']} {row['log']} {row['span_s']} {row['faults']}: {row['wrong']}")


if __name__ == "__main__":
    run_numbered(trial, report)
