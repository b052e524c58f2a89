"""What a log says that it would show, against what is found of faults of these sizes that are added to it.

The first of the logs, one window and one flight run, with few faults of each kind; BFI_FULL=1 takes all.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from window_trials import CITATION, LENGTH_S, flight_log, starts_s

from bfi_cli import Config, diagnose, merge, proof, read_log, start_time
from bfi_cli.decision import KINDS, Proof
from bfi_cli.proof import flight_claims

DATA = Path(__file__).parents[2] / "data"
WANTED = 0.9
LOGS = ("citation_clean.h5", "citation_bias.h5", "citation_two_faults.h5")

# Five flights of four aircraft, and windows of two others.
FLIGHTS = (
    "sr22t_220417_125002.h5",
    "g1000_c172_110812.h5",
    "citation_20190312_123416.h5",
    "sr22t_220825_142831.h5",
    "citation_20180312_f1.h5",
)
N_WINDOWS = 10 if FULL else 1

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=LOGS if FULL else LOGS[:1])
def proofs(request: pytest.FixtureRequest) -> dict[str, Proof]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof, "ADDED", proof.ADDED if FULL else 6)
        answer = start_time(read_log(DATA / request.param), Config(), prove=True)
    print(f"\n{request.param}: {[(proof.kind, proof.size, proof.n_seen, proof.n_added) for proof in answer.proved]}")
    return {proof.kind: proof for proof in answer.proved}


@pytest.mark.parametrize("kind", ["abrupt", "oscillating"])
def test_faults_of_the_size_that_is_seen_are_found(proofs: dict[str, Proof], kind: str) -> None:
    if kind not in proofs:
        pytest.skip(f"a fault of this kind is declared: nothing is said of further {kind} ones")
    proof = proofs[kind]
    assert FULL or proof.n_seen >= 5  # of six, of which every answer is known
    assert not_below(proof.n_seen / proof.n_added, WANTED, proof.n_added)


def counts(proofs: list[Proof]) -> None:
    """Hold what is found of each kind of fault against the bar, and print it."""
    for kind in KINDS:
        same_kind = [proof for proof in proofs if proof.kind == kind]
        if same_kind:
            n_seen, n_added = (sum(getattr(proof, key) for proof in same_kind) for key in ("n_seen", "n_added"))
            print(f"{kind}: {n_seen} of {n_added}")
            assert not_below(n_seen / n_added, WANTED, n_added)


@pytest.mark.realdata
def test_windows_of_recorded_flights_find_what_they_say(flights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "ADDED", 6)
    proofs: list[Proof] = []
    for number in range(N_WINDOWS):
        rng = np.random.default_rng([99, number])
        name = CITATION[number % 2]
        from_s = float(rng.choice(starts_s(name)))
        config = merge(Config(), {"window.from_s": from_s, "window.to_s": from_s + LENGTH_S})
        answer = start_time(flight_log(name), config, prove=True)
        print(
            name, from_s, [(proof.kind, round(proof.size, 2), proof.n_seen, proof.n_added) for proof in answer.proved]
        )
        proofs += answer.proved
    counts(proofs)


@pytest.mark.realdata
@pytest.mark.parametrize("name", FLIGHTS if FULL else FLIGHTS[:1])
def test_flights_show_what_they_say(flights: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(proof, "ADDED", 4 if FULL else 1)
    log = read_log(flights / name)
    if not FULL:  # the first claims of half a flight, which are true
        log = log.window(None, 1500.0)
        monkeypatch.setattr(proof, "flight_claims", lambda *given: flight_claims(*given)[:2])
    answer = diagnose(log, Config(), prove=True)
    for entry in answer.proved:
        print(name, entry.kind, entry.channel, f"{entry.size:.3g}", entry.unit, entry.n_seen, entry.n_added)
    assert FULL or [entry.n_seen for entry in answer.proved] == [1, 1]
    counts(list(answer.proved))
