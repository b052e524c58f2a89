"""Steps of the indicated airspeed in two flights of a drone, half of which no linear row describes.

No relation shows them: what is found the flight model proposes, or the signs of flight. Three steps run, whose answers
are known; BFI_FULL=1 counts 12 of each size, without a bar:
`BFI_FULL=1 pytest -s -m slow tests/measurements/test_drone_steps.py`.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from bars import FULL

from bfi_cli import Fault, diagnose, inject, read_log
from bfi_cli.errors import LogError

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

NAMES, SIZES, ONSETS, NEAR_S = ("px4_swiss1", "px4_swiss_flow"), (6.0, 9.0), 6, 3.0


def said_of(path: Path, size: float, onset_s: float) -> str:
    """Return what is said of a step: the state of its event, missed, or refused."""
    try:
        answer = diagnose(inject(read_log(path), [Fault(shape="bias", channel="ias", magnitude=size, onset_s=onset_s)]))
    except LogError:
        return "refused"
    for event in answer.events:
        first_s, last_s = event.onset_ci95
        if "ias" in (event.fault, *event.among) and first_s - NEAR_S <= onset_s <= last_s + NEAR_S:
            covers = event.ci95 is not None and event.ci95[0] <= size <= event.ci95[1]
            print(path.stem, size, round(onset_s, 1), event.fault, event.magnitude, event.onset_s, covers, sep=" | ")
            return event.state
    return "missed"


@pytest.mark.parametrize(
    ("name", "size", "onset_s", "state"),
    [
        ("px4_swiss1", 9.0, 75.3, "declared"),
        ("px4_swiss_flow", 9.0, 90.8, "declared"),
        ("px4_swiss1", -9.0, 90.3, "suspected"),
    ],
)
def test_a_large_step_of_a_drone_is_found(name: str, size: float, onset_s: float, state: str, flights: Path) -> None:
    assert said_of(flights / f"{name}.h5", size, onset_s) == state


@pytest.mark.skipif(not FULL, reason="it has no bar: only where BFI_FULL=1 is set")
def test_how_many_steps_of_a_drone_are_found(flights: Path) -> None:
    rng, said = np.random.default_rng(7), Counter[tuple[str, float, str]]()
    for name in NAMES:
        for size in np.repeat(SIZES, ONSETS).tolist():
            onset_s = float(rng.uniform(60.0, 120.0))
            said[name, size, said_of(flights / f"{name}.h5", size * float(rng.choice([-1.0, 1.0])), onset_s)] += 1
    for what, n in sorted(said.items()):
        print(*what, n)
    assert said.total() == len(NAMES) * len(SIZES) * ONSETS
