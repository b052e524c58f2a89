"""Faults that err by 1.2 tolerances, from any time of a window on, are not answered by "no fault".

Five windows run, one of every second flight; BFI_FULL=1 takes 500.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from bars import FULL, not_above
from tolerance_trials import FLIGHTS, report, trial, wrong_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

NUMBERS = range(500) if FULL else range(0, len(FLIGHTS), 2)


def test_no_fault_is_not_said_of_an_error_of_1_2_tolerances(flights: Path) -> None:
    rows = [trial(number) for number in NUMBERS]
    report(rows)
    assert FULL or not any(row["verdict"] == "no_fault" for row in rows)  # of these every answer is known
    # Whether the answer claims anything of the onset or not.
    assert not_above(sum(row["verdict"] == "no_fault" for row in rows) / len(rows), 0.01, len(rows))
    assert not_above(len(wrong_of(rows)) / len(rows), 0.01, len(rows))
