"""What a window says that it would see, against what it finds of faults of these sizes that are added to it."""

from __future__ import annotations

from pathlib import Path

import pytest
from bars import FULL, not_below

from bfi_cli import Config, read_log, start_time
from bfi_cli.decision import Proof
from bfi_cli.proof import Proving

DATA = Path(__file__).parents[2] / "data"
WANTED = 0.9
LOGS = ("citation_clean.h5", "citation_bias.h5", "citation_two_faults.h5")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=LOGS if FULL else LOGS[:1])
def proofs(request: pytest.FixtureRequest) -> dict[str, Proof]:
    answer = start_time(read_log(DATA / request.param), Config(), prove=Proving(workers=2))
    print(f"\n{request.param}: {[(proof.kind, proof.size, proof.n_seen, proof.n_added) for proof in answer.proved]}")
    return {proof.kind: proof for proof in answer.proved}


@pytest.mark.parametrize("kind", ["abrupt", "oscillating"])
def test_faults_of_the_size_that_is_seen_are_found(proofs: dict[str, Proof], kind: str) -> None:
    if kind not in proofs:
        pytest.skip(f"a fault of this kind is declared: nothing is said of further {kind} ones")
    proof = proofs[kind]
    assert not_below(proof.n_seen / proof.n_added, WANTED, proof.n_added)
