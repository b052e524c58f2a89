"""`bfi diagnose` on parts of flights in which an airspeed swings: alone, or with all others as by water in the line.

As `test_cut_faults`, with sines of 4 to 10 m/s at 0.055 to 0.42 Hz. Of tours of JSBSim no size counts: the low-pass
that the fault has passed shows nowhere else in them. Three trials run; BFI_FULL=1 takes two seeds of every kind and
aircraft.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from bars import FULL, fewest
from cut_faults import AIRCRAFT, OSCILLATIONS, RECORDED, Trial, answer_to_oscillation
from trials import spread

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

SEEDS = (1, 2)
SHORT = (
    Trial(aircraft="g1000_c172_110812.h5", kind="pitot_water", seed=1),
    Trial(aircraft="sr22t_220417_135002.h5", kind="tas sine", seed=1),
    Trial(aircraft="citation_20190312_123416.h5", kind="cas sine", seed=1),
)
NAMED, COVERED = 0.9, 0.91


def test_an_airspeed_that_swings_is_named(flights: Path) -> None:
    every = [Trial(aircraft=a, kind=kind, seed=k) for k in SEEDS for kind in OSCILLATIONS for a in AIRCRAFT]
    work = partial(answer_to_oscillation, folder=flights)
    answers = [answer for answer in spread(work, every if FULL else SHORT) if answer]
    for answer in answers:
        print(answer.trial.aircraft, answer.trial.kind, answer.truth.about, answer.state, answer.events, sep=" | ")
    named, wrong = sum(answer.state != "missed" for answer in answers), sum(answer.wrong for answer in answers)
    onsets = [answer.onset_covered for answer in answers if answer.onset_covered is not None]
    of_recorded = (answer for answer in answers if answer.trial.aircraft in RECORDED)
    sizes = [answer.covered for answer in of_recorded if answer.covered is not None]
    hours, others = sum(answer.hours for answer in answers), sum(answer.others for answer in answers)
    print(f"n {len(answers)}: {named} named, {wrong} wrong, {others} others in {hours:.1f} h")
    print(f"onsets {sum(onsets)} of {len(onsets)}, sizes {sum(sizes)} of {len(sizes)} in their intervals")
    assert named >= fewest(len(answers), NAMED)
    assert not wrong
    assert sum(onsets) >= fewest(len(onsets), COVERED)
    assert sum(sizes) >= fewest(len(sizes), COVERED)
