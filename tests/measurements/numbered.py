"""Trials that are drawn from their own number, run from the command line and continued where they were left."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def run_numbered(trial: Callable[[int], Row], report: Callable[[list[Row]], None]) -> None:
    """Run the trials that --results does not hold yet, and report all that it holds."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=60)
    parser.add_argument("--results", type=Path, required=True)
    asked = parser.parse_args()
    rows = [json.loads(line) for line in asked.results.read_text().splitlines()] if asked.results.exists() else []
    known = {row["number"] for row in rows}
    with asked.results.open("a") as file:
        for number in range(asked.first, asked.last):
            if number not in known:
                rows.append(trial(number))
                file.write(json.dumps(rows[-1]) + "\n")
                file.flush()
    report(rows)
