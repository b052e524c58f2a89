"""What the diagnosis says of a journey with one fault, asked once for each."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["FROM_S", "ONSET_S", "PART", "TO_S", "Diagnoses"]

# Cruise with three turns; what goes before and after tells the angle of zero lift.
PART = ("--from", 240, "--to", 700)
# The shorter part that is asked for most: one turn, and what goes before and after a fault.
FROM_S, TO_S = 330.0, 620.0
ONSET_S = 430.0


@dataclass(frozen=True, slots=True)
class Diagnoses:
    """The documents of flights with a fault, by the fault."""

    folder: Path
    bfi: Callable
    known: dict[str, dict[str, Any]]

    def log(self, fault: str) -> Path:
        """Return the log of the flight with a fault, "" for the healthy one."""
        if not fault:
            return self.folder / "healthy.h5"
        path = self.folder / f"{fault.replace(',', ' ')}.h5"
        if not path.exists():
            assert self.bfi("inject", self.folder / "healthy.h5", "--fault", fault, "-o", path).code == 0
        return path

    def of(self, fault: str) -> dict[str, Any]:
        """Return what `bfi diagnose --json` says of the cruise of a flight with a fault."""
        if fault not in self.known:
            outcome = self.bfi("diagnose", self.log(fault), "--from", FROM_S, "--to", TO_S, "--workers", 1, "--json")
            assert outcome.code == 0, outcome.stderr
            self.known[fault] = json.loads(outcome.stdout)
        return self.known[fault]
