"""Start a flight in a process and a folder of its own, and read what it gives."""

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
from .channels import FLOWN

PACKAGE_FOLDER = Path(__file__).resolve().parents[2]


# Seconds between two looks at how far a flight is.
LOOK_S = 0.1


def run(
    who: str,
    request: Mapping[str, Any],
    arrays: Mapping[str, FloatArray] | None = None,
    report: Report = silent,
) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return what a request to JSBSim gives: values and arrays by name.

    Parameters
    ----------
    who : what the messages begin with.
    request : see `bfi_cli.jsbsim.flight.main`.
    arrays : of a flight, its `sticks` and `gusts`.
    report : told the part of the flight that is flown.

    Raises
    ------
    ConfigError : JSBSim is not installed, or cannot fly what is asked for.
    """
    if find_spec("jsbsim") is None:
        raise ConfigError(f"{who}: needs the package jsbsim, which is not installed; pip install 'bfi-cli[jsbsim]'")
    paths = [str(PACKAGE_FOLDER), *filter(None, [os.environ.get("PYTHONPATH")])]
    with TemporaryDirectory(prefix="bfi-jsbsim-") as name:
        folder = Path(name)
        (folder / "request.json").write_text(json.dumps(dict(request)), encoding="utf-8")
        if arrays is not None:
            np.savez(folder / "request.npz", sticks=arrays["sticks"], gusts=arrays["gusts"])
        flight = subprocess.Popen(
            [sys.executable, "-P", "-m", "bfi_cli.jsbsim.flight", str(folder)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            code = _wait(flight, folder / FLOWN, report)
        finally:  # also where the wait is interrupted
            flight.kill()
            flight.wait()
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
    """Return the exit code of a flight, and tell `report` the number that it leaves in the file `flown`."""
    while True:
        with suppress(subprocess.TimeoutExpired):
            return flight.wait(LOOK_S)
        with suppress(OSError, ValueError):  # not there yet, or being written
            report(float(flown.read_text(encoding="ascii")))
