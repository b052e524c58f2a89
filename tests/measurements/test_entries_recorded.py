"""A fault in minutes of recorded flights, and a dictionary that has it: named by its entry, or by nothing.

Excerpts of 160 s of the logs of four recorders, each drawn from its own number, with trusted channels as inputs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below

from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flightlog import FlightLog, inject, read_log
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.flightlog.quality import recorder_filters
from bfi_cli.model.result import IdentifyResult

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

FLIGHTS = Path(__file__).resolve().parents[3] / "shared" / "flights"
RECORDERS = (
    "citation_20180312_f1.h5",
    "sr22t_220417_125002.h5",
    "gnxi_pa28_240720.h5",
    "citation_20190305_v4.h5",
)
EACH = 25 if FULL else 2
LENGTH_S, BESIDE_S = 160.0, 5.0
SHAPES = {"bias": {}, "drift": {"slope": 0.1}, "lagged_bias": {"time_constant_s": 3.0}, "sine": {"frequency_hz": 0.1}}
ENTRY, OTHERS = "there", 3


def excerpt(log: FlightLog, rng: np.random.Generator) -> tuple[FlightLog, Fault, float]:
    """Return part of a flight with a fault of 1.5 to 4 m/s, the fault and the start of the window."""
    first, last = max(airborne_stretches(log), key=lambda stretch: stretch[1] - stretch[0])
    start = float(rng.uniform(first + 60.0, last - LENGTH_S - 60.0))
    part = log.window(start - BESIDE_S, start + LENGTH_S + BESIDE_S)
    shape = str(rng.choice(list(SHAPES)))
    onset_s = start + float(rng.uniform(0.3, 0.7)) * LENGTH_S
    fault = Fault(shape=shape, channel="tas", magnitude=float(rng.uniform(1.5, 4.0)), onset_s=onset_s, **SHAPES[shape])
    response = response_of(recorder_filters(part, "auto", "auto")[0], part.rate_hz)
    return inject(part, [fault], response=response), fault, start


def identified(log: FlightLog, fault: Fault, start: float, rng: np.random.Generator) -> IdentifyResult:
    """Return what is said with a dictionary that has the fault, and some of other onsets and shapes."""
    entries = [{"name": ENTRY, "shape": fault.shape, "onset_s": fault.onset_s, **SHAPES[fault.shape]}]
    for k in range(OTHERS):
        shape = str(rng.choice(list(SHAPES)))
        onset_s = start + float(rng.uniform(0.1, 0.9)) * LENGTH_S
        entries.append({"name": f"other_{k}", "shape": shape, "onset_s": onset_s, **SHAPES[shape]})
    dictionary = load_dictionary({"channel": "tas", "relative_to": "log", "atoms": entries})
    window = {"window.from_s": start, "window.to_s": start + LENGTH_S, "inputs": ["auto"]}
    return identify(log, dictionary, merge(Config(), window))[0]


def test_a_fault_of_the_dictionary_is_named_by_its_entry_or_by_nothing(capsys: pytest.CaptureFixture[str]):
    if not FLIGHTS.is_dir():
        pytest.skip(f"no recorded flights at {FLIGHTS}")
    names, n = {"entry": 0, "nothing": 0, "otherwise": 0}, 0
    for k, recorder in enumerate(RECORDERS):
        log = read_log(FLIGHTS / recorder)
        for number in range(EACH):
            rng = np.random.default_rng([k, number])
            faulty, fault, start = excerpt(log, rng)
            result = identified(faulty, fault, start, rng)
            declared = {one.name for one in result.faults}
            names["nothing" if not declared else "entry" if declared == {ENTRY} else "otherwise"] += 1
            n += 1
            contradicted = [f"'{name}' is not declared" for name in declared]
            assert not any(words in note.text for note in result.notes for words in contradicted)
            assert {one.name for one in result.candidates if one.state == "declared"} >= declared & {ENTRY}
    with capsys.disabled():
        print(f"\n{n} excerpts: {names}")
    assert FULL or names["otherwise"] == 0  # of these every answer is known
    assert not_below(1.0 - names["otherwise"] / n, 0.95, n)
