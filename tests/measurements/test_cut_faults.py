"""`bfi diagnose` on parts of 600 to 1600 s of flights of eight aircraft with one fault each, at random times.

Two flights of the Citation, three of light aircraft and tours of three aircraft of JSBSim; faults are made from first
principles, pass the air-data chain and, where the rate has room for it, a recorder's low-pass. A fault counts where it
makes an error of `cut_faults.LEAST`. One trial of three kinds runs, whose answers are known; BFI_FULL=1 takes three
seeds of every kind and aircraft, on which the bars stand:
`BFI_FULL=1 pytest -s -m slow -o faulthandler_timeout=14400 tests/measurements/test_cut_faults.py`.
"""

from __future__ import annotations

from collections import defaultdict
from functools import partial
from pathlib import Path

import pytest
from bars import FULL, LEVEL, fewest
from cut_faults import AIRCRAFT, KINDS, Answer, Trial, answer_of
from scipy import stats
from trials import spread

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

SEEDS = 3
SHORT = (
    Trial(aircraft="g1000_c172_110812.h5", kind="pitot_leak", seed=0),
    Trial(aircraft="citation_20180312_f1.h5", kind="pitot_blocked", seed=0),
    Trial(aircraft="citation_20180312_f1.h5", kind="cas step", seed=0),
)
NAMED, WRONG, OTHERS_PER_HOUR, COVERED = 0.9, 0.03, 0.1, 0.91


def test_one_fault_in_a_part_of_a_flight_is_named(flights: Path) -> None:
    every = [Trial(aircraft=a, kind=kind, seed=k) for k in range(SEEDS) for kind in KINDS for a in AIRCRAFT]
    answers = [answer for answer in spread(partial(answer_of, folder=flights), every if FULL else SHORT) if answer]
    kinds = defaultdict[str, list[Answer]](list)
    for answer in answers:
        kinds[answer.trial.kind].append(answer)
        print(answer.trial.aircraft, answer.trial.kind, answer.trial.seed, answer.state, answer.events, sep=" | ")
    for kind, those in kinds.items():
        named, wrong = sum(answer.state != "missed" for answer in those), sum(answer.wrong for answer in those)
        print(f"{kind}: {named} of {len(those)} named, {wrong} wrong names")
    named, wrong = sum(answer.state != "missed" for answer in answers), sum(answer.wrong for answer in answers)
    hours, others = sum(answer.hours for answer in answers), sum(answer.others for answer in answers)
    onsets = [answer.onset_covered for answer in answers if answer.onset_covered is not None]
    sizes = [answer.covered for answer in answers if answer.covered is not None]
    print(f"n {len(answers)}: {named} named, {wrong} wrong, {others} others in {hours:.1f} h")
    print(f"onsets {sum(onsets)} of {len(onsets)}, sizes {sum(sizes)} of {len(sizes)} in their intervals")
    if not FULL:  # of these every answer is known
        assert (named, wrong, others) == (len(SHORT), 0, 0)
    assert named >= fewest(len(answers), NAMED)
    assert len(answers) - wrong >= fewest(len(answers), 1.0 - WRONG)
    assert others <= stats.poisson.ppf(1.0 - LEVEL, OTHERS_PER_HOUR * hours)
    assert sum(onsets) >= fewest(len(onsets), COVERED)
    assert sum(sizes) >= fewest(len(sizes), COVERED)
