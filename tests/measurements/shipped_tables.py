"""Make the calibration tables that are shipped: python tests/measurements/shipped_tables.py FOLDER_OF_FLIGHTS."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import bfi_cli
from bfi_cli.config import Config, merge
from bfi_cli.decision.calibration import CalibrationTable, save_tables
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.model.onset import table_of_windows, windows_of
from bfi_cli.serialization import provenance

FLIGHTS = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")
INPUTS = (("elevator",), ("elevator", "pitch", "longitudinal_acc"), ("auto",))
SPAN_S, STEP_S = (700.0, 4200.0), 60.0
LENGTHS_S = (120.0, 240.0)
STEEPEST_PITCH = np.deg2rad(30.0)
SHIPPED = Path(bfi_cli.__file__).parent / "onset" / "shipped.json"


def windows(log: FlightLog, length_s: float) -> list[tuple[float, float]]:
    """Return the windows of the flight without take-off, landing and parabola."""
    span = merge(Config(), {"window.from_s": SPAN_S[0], "window.to_s": SPAN_S[1]})
    every = windows_of(log, span, length_s=length_s, step_s=STEP_S)
    return [w for w in every if np.abs(log.window(*w).channel("pitch").values).max() < STEEPEST_PITCH]


def table(logs: list[FlightLog], length_s: float, inputs: tuple[str, ...]) -> CalibrationTable:
    """Return the table of one setting, at the rate that the recorder's edge asks for."""
    pieces = [(log, window) for log in logs for window in windows(log, length_s)]
    print(f"{length_s:g} s, {', '.join(inputs)}: {len(pieces)} windows", file=sys.stderr)
    return table_of_windows(pieces, merge(Config(), {"inputs": inputs}))


def main(folder: Path) -> None:
    """Write the file of the package."""
    logs = [read_log(folder / name) for name in FLIGHTS]
    tables = [table(logs, length_s, inputs) for length_s in LENGTHS_S for inputs in INPUTS]
    origin = provenance(log_sha256=" ".join(log.sha256 for log in logs))
    text = save_tables(tables, replace(origin, command="python tests/measurements/shipped_tables.py FOLDER"))
    SHIPPED.write_text(text + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
