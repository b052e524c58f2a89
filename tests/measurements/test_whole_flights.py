"""`bfi diagnose` on whole recorded flights with one fault each, at random times, made from first principles.

Faults pass the recorder's low-pass and last to the end in half of the trials, where their kind allows. One trial of
two kinds runs by default, in a flight each, of which no other event may be declared; BFI_FULL=1 runs twelve of all
fifteen, and both flights without a fault, on which the bars stand:
`BFI_FULL=1 pytest -s -m slow -o faulthandler_timeout=14400 tests/measurements/test_whole_flights.py`. BFI_KINDS,
BFI_PLACEMENTS and BFI_SEED choose others.
"""

from __future__ import annotations

import os
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from flight_faults import KINDS
from shipped_parity import FLIGHTS
from trials import spread
from whole_flight_trials import Answer, Trial, answer_of

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

PLACEMENTS = int(os.environ.get("BFI_PLACEMENTS", "12" if FULL else "1"))
SEED = int(os.environ.get("BFI_SEED", "0"))
HARD = ("static_leak partial", "probe")
# By kind the flight and the seed that run without BFI_FULL=1. The other kinds are in test_lasting_faults and, window by
# window, in test_diagnose.
ALONE = {"aoa step": (0, 1), "tas spikes": (1, 0)}


def trials(flights: Path) -> list[Trial]:
    only = os.environ.get("BFI_KINDS")
    if not FULL and only is None:
        return [Trial(path=flights / FLIGHTS[k], kind=kind, seed=seed) for kind, (k, seed) in ALONE.items()]
    chosen = only.split(",") if only else KINDS
    kinds = [name for name in KINDS if name in chosen]
    made = [
        Trial(path=flights / FLIGHTS[(k + j) % 2], kind=kind, seed=k, base=SEED)
        for j, kind in enumerate(kinds)
        for k in range(PLACEMENTS)
    ]
    return made + [Trial(path=flights / name, kind=None, seed=0) for name in FLIGHTS]


def test_one_fault_in_a_whole_flight(flights: Path) -> None:
    by_kind: dict[str, list[Answer]] = defaultdict(list)
    for one in spread(answer_of, trials(flights)):
        by_kind[one.trial.kind or "healthy"].append(one)
    every = [one for answers in by_kind.values() for one in answers]
    for kind, answers in by_kind.items():
        for one in answers:
            about = "" if one.truth is None else f"{one.truth.about} from {one.truth.onset_s:.1f} s"
            if one.truth is not None and one.truth.offset_s is not None:
                about += f" to {one.truth.offset_s:.0f} s"
            mark = "" if one.named or one.truth is None else " MISSED"
            print(f"{kind}{mark}: {one.trial.path.name[9:17]} {about}: {one.said}; extra {', '.join(one.extra)}")
    print(f"{'kind':24s} named  onset off  covered  extra")
    for kind, answers in by_kind.items():
        off = [abs(one.onset_error_s) for one in answers if one.onset_error_s is not None]
        covered = [one.covered for one in answers if one.covered is not None]
        print(
            f"{kind:24s} {sum(one.named for one in answers)}/{len(answers)}"
            f"  {np.median(off) if off else np.nan:8.2f} s  {sum(covered)}/{len(covered)}"
            f"  {sum(len(one.extra) for one in answers)}"
        )
    hours = sum(one.hours for one in every)
    extra = sum(len(one.extra) for one in every)
    print(f"{extra} extra events beyond the tolerance in {hours:.1f} h of flight, {extra / hours:.2f} an hour")
    if "healthy" not in by_kind:  # of these every answer is known
        assert all(one.named for one in every)
        assert extra == 0
        return
    assert sum(len(one.extra) for one in by_kind["healthy"]) == 0
    for kind, answers in by_kind.items():
        if kind == "healthy":
            continue
        n, wanted = len(answers), 0.7 if kind in HARD else 0.9
        assert not_below(sum(one.named for one in answers) / n, wanted, n), kind
        covered = [one.covered for one in answers if one.covered is not None]
        assert not covered or not_below(sum(covered) / len(covered), 0.88, len(covered)), kind
    # A Poisson count of the wanted rate is above this in 2.5 % of cases.
    assert extra <= 0.3 * hours + 2.0 * np.sqrt(0.3 * hours)
