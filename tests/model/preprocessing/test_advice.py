"""Advice on the first screen is a command that works as it stands, and decides more."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bfi_cli import Config, merge, read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.preprocessing import defaults

DATA = Path(__file__).parents[3] / "data"
CLEAN = DATA / "citation_clean.h5"
OPEN = {"abrupt": "no_fault", "oscillating": "inconclusive", "slow": "inconclusive"}


def advised(document: dict[str, Any]) -> list[str]:
    (note,) = [note["text"] for note in document["notes"] if ": bfi " in note["text"]]
    return shlex.split(note.partition(": bfi ")[2])


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (("start-time", CLEAN, "--input", "elevator"), ["--input", "auto"]),
        (("start-time", CLEAN), ["--require", "abrupt,oscillating"]),
        (("identify", CLEAN, "-d", "airdata", "--to", "30"), ["--to", "30", "--require", "abrupt,oscillating"]),
    ],
)
def test_the_command_that_is_advised_works_and_decides(bfi: Callable, words: tuple[Any, ...], options: list[str]):
    asked = json.loads(bfi(*words, "--json").stdout)
    command = advised(asked)
    assert command[:2] == [words[0], str(CLEAN)]
    assert command[-len(options) :] == options
    outcome = bfi(*command, "--json")
    assert outcome.code == 0
    answer = json.loads(outcome.stdout)
    more_inputs = set(answer["model"]["inputs"]) > set(asked["model"]["inputs"])
    assert more_inputs or (asked["decision"], answer["decision"]) == ("inconclusive", "no_fault")


def test_a_longer_window_is_taken_from_the_same_flight(monkeypatch: pytest.MonkeyPatch):
    log = read_log(CLEAN)
    log = replace(log, time_s=frozen_array(np.arange(log.n_samples) * 0.5))
    monkeypatch.setattr(defaults, "airborne_stretches", lambda _: [(100.0, 900.0)])
    names = tuple(name for name in defaults.TRUSTED if name in log.channels)
    config = merge(Config(), {"inputs": names, "window.from_s": 120.0, "window.to_s": 240.0})
    note = defaults.what_would_help(log, config, OPEN)
    assert note is not None
    assert note.text.endswith(f"take a longer window: bfi start-time {CLEAN} --from 100 --to 300")
    beside = merge(config, {"window.from_s": 20.0, "window.to_s": 90.0})
    note = defaults.what_would_help(log, beside, OPEN)
    assert note is not None
    assert note.text.endswith("record for longer")
