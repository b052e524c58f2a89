"""`bfi diagnose` on flights that nobody tuned on: other aircraft of JSBSim, through recorders as one finds them.

A take-off where the aircraft can, climbs, turns, changes of speed, flaps, settings of the altimeter, an approach and a
landing, in gusts and wind shear (`stranger_flights`, `stranger_trials`). Causes of false answers were sought on the
aircraft of `CAUSES`; those of `REPORT` tell what is left. One flight through two recorders runs, whose answers are
known; BFI_FULL=1 takes every aircraft through every recorder, healthy and with one fault, about two hours:
`BFI_FULL=1 pytest -s -m slow -o faulthandler_timeout=28800 tests/measurements/test_strangers.py`.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest
from bars import FULL
from stranger_trials import CAUSES, LINES, RECORDERS, REPORT, STEPS, Answer, Trial, answer_of, has_sensor
from trials import spread

pytestmark = [pytest.mark.slow, pytest.mark.skipif(find_spec("jsbsim") is None, reason="needs the extra jsbsim")]

SHORT = ("qar", "coarse")
SHORT_AIRCRAFT = "A320"
SHORT_FAULT = Trial(aircraft=SHORT_AIRCRAFT, recorder="efis", fault="altitude")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the folders of the flights and of the logs."""
    return tmp_path_factory.mktemp("strangers"), tmp_path_factory.mktemp("logs")


def test_nothing_is_declared_on_healthy_flights_of_strangers(folders: tuple[Path, Path]) -> None:
    every = [Trial(aircraft=a, recorder=r) for a in (*CAUSES, *REPORT) for r in RECORDERS]
    trials = every if FULL else [Trial(aircraft=SHORT_AIRCRAFT, recorder=r) for r in SHORT]
    answers = [a for a in spread(partial(answer_of, flights=folders[0], folder=folders[1]), trials) if a is not None]
    for answer in answers:
        print(answer.trial.aircraft, answer.trial.recorder, answer.in_words, sep=" | ")
    for by in ("recorder", "aircraft"):
        groups = defaultdict[str, list[Answer]](list)
        for answer in answers:
            groups[getattr(answer.trial, by)].append(answer)
        for name, those in groups.items():
            declared, suspected = sum(bool(a.declared) for a in those), sum(bool(a.suspected) for a in those)
            print(f"{name}: n {len(those)}, {declared} declared, {suspected} suspected")
    assert not any(answer.warned for answer in answers)
    if not FULL:  # of these every answer is known
        assert not any(answer.refused or answer.declared for answer in answers)


def test_one_fault_of_a_stranger_is_named(folders: tuple[Path, Path]) -> None:
    every = [Trial(aircraft=a, recorder=r, fault=f) for a in REPORT for r in RECORDERS for f in (*LINES, *STEPS)]
    trials = [trial for trial in every if has_sensor(trial)] if FULL else [SHORT_FAULT]
    answers = [a for a in spread(partial(answer_of, flights=folders[0], folder=folders[1]), trials) if a is not None]
    told = defaultdict[str, Counter[str]](Counter)
    for answer in (answer for answer in answers if answer.truth is not None):
        print(*vars_of(answer), sep=" | ")
        for group in (answer.trial.fault, answer.trial.recorder, answer.trial.aircraft):
            told[group][answer.named] += 1
    for group, counts in told.items():
        print(f"{group}: n {counts.total()}, {dict(counts)}")
    if not FULL:  # of these every answer is known
        assert [answer.named for answer in answers] == ["named"]


def vars_of(answer: Answer) -> tuple[object, ...]:
    """Return what is printed of an answer."""
    trial = answer.trial
    return trial.aircraft, trial.recorder, trial.fault, answer.truth, answer.named, answer.in_words
