"""What ordinarily happens is told by its name and is no fault, and a fault that looks like it is not explained away.

Ordinary causes act in tours of three aircraft of JSBSim: `ordinary_trials.RIVALS` have a signature (a landing is told
by the phases), `OTHERS` are noise, or mended in the reading. What is smaller than what the flight shows without it
(`is_visible`) is printed and stands in no bar. Faults are made in parts of recorded flights of three aircraft. A few
trials run, whose answers are known; BFI_FULL=1 takes 20 seeds of every cause and aircraft and of every fault, on which
the bars stand:
`BFI_FULL=1 pytest -s -m slow -o faulthandler_timeout=28800 tests/measurements/test_ordinary_causes.py`.
"""

from __future__ import annotations

from collections import defaultdict
from functools import partial
from pathlib import Path

import pytest
from bars import FULL, fewest, upper_limit
from cut_faults import Trial as FaultTrial
from jsbsim_trials import AIRCRAFT
from ordinary_trials import (
    IMITATED,
    OTHERS,
    RECORDED,
    RIVALS,
    CauseAnswer,
    CauseTrial,
    FaultAnswer,
    answer_to_cause,
    answer_to_fault,
)
from trials import spread

pytestmark = pytest.mark.slow

SEEDS = 20
NAMED, DECLARED, EXPLAINED_AWAY = 0.9, 0.02, 0.02
SHORT_CAUSES = (
    CauseTrial(aircraft="c172p", cause="flaps", seed=0),
    CauseTrial(aircraft="c172p", cause="wake", seed=0),
)
SHORT_FAULTS = (
    FaultTrial(aircraft="citation_20180312_f1.h5", kind="altitude step", seed=0),
    FaultTrial(aircraft="g1000_c172_110812.h5", kind="pitch drift", seed=0),
    FaultTrial(aircraft="sr22t_220417_135002.h5", kind="pitch drift", seed=0),
)
STATES = ("declared", "suspected", "missed")
NO_FLAPS = ("f16",)  # whose flaps no pilot moves


def every_cause() -> list[CauseTrial]:
    return [
        CauseTrial(aircraft=aircraft, cause=cause, seed=seed)
        for cause in (*RIVALS, *OTHERS)
        for aircraft in AIRCRAFT
        for seed in range(SEEDS)
        if not (cause == "flaps" and aircraft in NO_FLAPS)
    ]


def test_what_ordinarily_happens_is_told_and_no_fault() -> None:
    answers = spread(answer_to_cause, every_cause() if FULL else SHORT_CAUSES)
    causes = defaultdict[str, list[CauseAnswer]](list)
    for answer in answers:
        causes[answer.trial.cause].append(answer)
        print(answer.trial.cause, answer.trial.aircraft, answer.trial.seed, answer.named, answer.said, sep=" | ")
    for cause, those in causes.items():
        named, declared = sum(answer.named for answer in those), sum(answer.declared for answer in those)
        seen = sum(answer.visible for answer in those)
        suspected, others = sum(answer.suspected for answer in those), sum(answer.others for answer in those)
        print(
            f"{cause}: n {len(those)}, {seen} visible, {named} told, {declared} declared, {suspected} suspected", end=""
        )
        print(f", {others} others")
    if not FULL:  # of these every answer is known
        assert [answer.named for answer in answers] == [True] * len(SHORT_CAUSES)
        assert not any(answer.declared for answer in answers)
        return
    declared = sum(answer.declared for answer in answers)
    assert declared <= len(answers) - fewest(len(answers), 1.0 - DECLARED)
    seen = {cause: [answer.named for answer in causes[cause] if answer.visible] for cause in RIVALS}
    missed = {cause: told.count(False) for cause, told in seen.items() if told}
    assert not {cause: n for cause, n in missed.items() if len(seen[cause]) - n < fewest(len(seen[cause]), NAMED)}


@pytest.mark.realdata
def test_a_fault_that_an_ordinary_cause_imitates_is_not_explained_away(flights: Path) -> None:
    every = [FaultTrial(aircraft=a, kind=kind, seed=k) for k in range(SEEDS) for kind in IMITATED for a in RECORDED]
    trials = every if FULL else SHORT_FAULTS
    answers = [answer for answer in spread(partial(answer_to_fault, folder=flights), trials) if answer]
    kinds = defaultdict[str, list[FaultAnswer]](list)
    for answer in answers:
        kinds[answer.trial.kind].append(answer)
        print(answer.trial.kind, answer.trial.aircraft, answer.trial.seed, answer.state, answer.said, sep=" | ")
    for kind, those in kinds.items():
        states = {state: sum(answer.state == state for answer in those) for state in STATES}
        away = sum(answer.explained_away for answer in those)
        print(f"{kind} against {those[0].cause}: n {len(those)}, {states}, {away} explained away")
    away = sum(answer.explained_away for answer in answers)
    print(f"n {len(answers)}: {away} explained away, at most {upper_limit(away, len(answers)):.1%}")
    if not FULL:  # of these every answer is known
        assert away == 0
        assert answers[0].state == "suspected"
    assert away <= len(answers) - fewest(len(answers), 1.0 - EXPLAINED_AWAY)
