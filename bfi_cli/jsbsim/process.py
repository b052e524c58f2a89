"""Run a flight in a separate process and folder, and read its answer."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import ConfigError
from ..kernels import FloatArray
from ..kernels.progress import Report, silent
from ..programs import guarded
from .channels import FLOWN

PACKAGE_FOLDER = Path(__file__).resolve().parents[2]
# Seconds between two readings of the part of the flight that is done.
LOOK_S = 0.1


def run(
    who: str,
    request: Mapping[str, Any],
    arrays: Mapping[str, FloatArray] | None = None,
    report: Report = silent,
) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return the answer of JSBSim to a request: values and arrays by name.

    Parameters
    ----------
    who : start of the messages.
    request : see `bfi_cli.jsbsim.flight.main`.
    arrays : `sticks` and `gusts` of a flight.
    report : called with the part of the flight that is done.

    Raises
    ------
    ConfigError : JSBSim is not installed, or cannot fly the request.
    """
    if find_spec("jsbsim") is None:
        raise ConfigError(f"{who}: needs the package jsbsim, which is not installed; pip install 'bfi-cli[jsbsim]'")
    paths = [str(PACKAGE_FOLDER), *filter(None, [os.environ.get("PYTHONPATH")])]
    with TemporaryDirectory(prefix="bfi-jsbsim-") as name:
        folder = Path(name)
        (folder / "request.json").write_text(json.dumps(dict(request)), encoding="utf-8")
        if arrays is not None:
            np.savez(folder / "request.npz", sticks=arrays["sticks"], gusts=arrays["gusts"])
        words = [sys.executable, "-P", "-m", "bfi_cli.jsbsim.flight", str(folder)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        silence = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        with guarded(words, cwd=folder, env=environment, **silence) as flight:  # it ends where the wait is interrupted
            code = _wait(flight, folder / FLOWN, report)
        answer_file = folder / "answer.json"
        if not answer_file.is_file():
            raise ConfigError(f"{who}: JSBSim stopped, exit code {code}; give another aircraft or start")
        answer = json.loads(answer_file.read_text(encoding="utf-8"))
        if "error" in answer:
            raise ConfigError(f"{who}: {answer['error']}")
        flown: dict[str, FloatArray] = {}
        if (folder / "answer.npz").is_file():
            with np.load(folder / "answer.npz") as stored:
                flown = {key: stored[key] for key in stored.files}
        return answer, flown


def _wait(flight: subprocess.Popen[bytes], flown: Path, report: Report) -> int:
    """Return the exit code of a flight; until it ends, call `report` with the number in the file `flown`."""
    while True:
        with suppress(subprocess.TimeoutExpired):
            return flight.wait(LOOK_S)
        with suppress(OSError, ValueError):  # not there yet, or being written
            report(float(flown.read_text(encoding="ascii")))
