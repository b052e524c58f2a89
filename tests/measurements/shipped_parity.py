"""Make the tables of the parity scan that the package ships: python tests/measurements/shipped_parity.py FOLDER.

FOLDER holds the two recorded flights. Every table holds the windows of both, without take-off, the last descent,
landing and parabola, each with the angle of zero lift of the other flight.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from bfi_cli.flight.parity.calibration import SHIPPED, ParityTable
from bfi_cli.flight.parity.record import Record, record_of
from bfi_cli.flight.parity.residuals import RESIDUALS
from bfi_cli.flight.parity.scan import scan_window
from bfi_cli.flight.parity.windows import LENGTHS_S, configuration_changes, overlaps, windows_in, zero_lift_of
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.flightlog.phases import Phase, phases_of
from bfi_cli.serialization import provenance, to_json

FLIGHTS = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")


def clean_windows(phases: Sequence[Phase], length_s: float, step_s: float | None = None) -> list[tuple[float, float]]:
    """Return the windows in which flaps and gear stay where they are."""
    moved = configuration_changes(phases)
    every = windows_in(phases, length_s, step_s=step_s)
    return [one for one in every if not overlaps(one, moved)]


def statistics(
    record: Record, windows: Sequence[tuple[float, float]], residuals: Sequence[str], zero_lift: float | None
) -> list[float]:
    """Return the statistic of every window with these residuals alone."""
    scans = (scan_window(record.between(*one), zero_lift=zero_lift, only=residuals) for one in windows)
    return [one.statistic for one in scans if one is not None and len(one.kinds) == len(residuals)]


def main(folder: Path) -> None:
    """Write the file of the package."""
    logs: list[FlightLog] = [read_log(folder / name) for name in FLIGHTS]
    records, phases = [record_of(log) for log in logs], [phases_of(log) for log in logs]
    angles = [zero_lift_of(*pair) for pair in zip(records, phases, strict=True)]
    tables = []
    for length_s in LENGTHS_S:
        for size in range(1, len(RESIDUALS) + 1):
            for residuals in combinations([kind.name for kind in RESIDUALS], size):
                for known in (True, False) if "lift" in residuals else (True,):
                    found, used = [], []
                    for k, record in enumerate(records):
                        windows = clean_windows(phases[k], length_s)
                        one = statistics(record, windows, residuals, angles[1 - k] if known else None)
                        found += one
                        used += [FLIGHTS[k]] if one else []
                    tables.append(
                        ParityTable(
                            residuals=residuals,
                            length_s=length_s,
                            knows_zero_lift=known,
                            statistics=np.sort(np.round(found, 3)),
                            logs=tuple(used),
                        )
                    )
                    print(length_s, residuals, known, len(found), np.round(np.quantile(found, (0.5, 0.85, 1.0)), 1))
    origin = provenance(log_sha256=" ".join(log.sha256 for log in logs))
    document = {"kind": "parity-tables", "schema": 1, "tables": tables}
    command = "python tests/measurements/shipped_parity.py FOLDER"
    SHIPPED.write_text(to_json({**document, "provenance": replace(origin, command=command)}) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
