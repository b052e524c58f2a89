"""What a healthy flight says that would have been found, against what is found of faults 1.5 times as large.

Every statement of most of the flight is tried: a step or a drift of a channel, icing, an error of the static line, each
at a random time that is watched, in ten minutes and more about it. Named alone or in a set, or told as a deviation
where it is surely within its tolerance. The short form tries those of one light aircraft; BFI_FULL=1 all of 14 flights,
`SEEDS` times: `BFI_FULL=1 pytest -s -m slow -o faulthandler_timeout=14400 tests/measurements/test_stated_sizes.py`.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from stated_sizes import Said, drawn, said_of, statements
from test_levels_without_aircraft import AIRCRAFT

from bfi_cli.config import Config
from bfi_cli.flight import diagnose_flight
from bfi_cli.flightlog import read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

SEEDS = 2
SHORT = {"G3X home-built": ("g3x_homebuilt_pfd2",)}
FOUND = ("named", "in a set", "deviation")
WANTED = 0.8


def said_on(path: Path, seed: int) -> list[Said]:
    """Return what is said of a fault of every statement of a healthy flight."""
    log = read_log(path)
    result = diagnose_flight(log, Config())
    every = []
    for number, limit in enumerate(statements(result)):
        added = drawn(limit, result, np.random.default_rng([37, seed, number]))
        if added is not None:
            said = said_of(log, added)
            print(path.stem, seed, added.words, said.named, said.margin, said.others, said.text, sep=" | ", flush=True)
            every.append(said)
    return every


@pytest.mark.parametrize("aircraft", AIRCRAFT if FULL else SHORT)
def test_what_would_have_been_found_is(aircraft: str, flights: Path) -> None:
    names = AIRCRAFT[aircraft] if FULL else SHORT[aircraft]
    said = [
        each for name in names for seed in range(SEEDS if FULL else 1) for each in said_on(flights / f"{name}.h5", seed)
    ]
    counts = Counter(each.named for each in said)
    n, others = len(said), sum(bool(each.others) for each in said)
    print(f"{aircraft}: {dict(counts)} of {n}, other declared events beside {others}")
    found = sum(counts[name] for name in FOUND)
    if not FULL:  # of these every answer is known
        assert (found, others) == (n, 0)
    assert not n or not_below(found / n, WANTED, n)
