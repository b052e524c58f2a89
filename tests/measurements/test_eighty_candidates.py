"""Four of eighty steps, twenty seeds, `bfi identify` by its defaults: support, sizes, and processor time."""

from __future__ import annotations

from time import process_time

import numpy as np
import pytest
from bars import not_below
from trials import sized

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.analysis import identify
from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject

pytestmark = pytest.mark.slow

SEEDS, N_ATOMS, ACTIVE, DURATION_S = range(sized(20, 0.2)), 80, 4, 120.0


def test_four_of_eighty_steps_by_default():
    onsets = np.linspace(6.0, 112.0, N_ATOMS)
    atoms = [{"name": f"step_{j:02d}", "shape": "bias", "onset_s": round(float(at), 3)} for j, at in enumerate(onsets)]
    dictionary = load_dictionary({"channel": "tas", "atoms": atoms})
    time_s = time_axis(duration_s=DURATION_S, rate_hz=20.0)
    flown = manoeuvre("multisine", time_s)
    exact, errors, seconds = 0, [], []
    for seed in SEEDS:
        rng = np.random.default_rng([80, seed])
        log = simulate(find_model("citation"), flown, rng=rng, rate_hz=20.0, noise_sd={"tas": 0.02})
        active = np.sort(rng.choice(N_ATOMS, ACTIVE, replace=False))
        sizes = rng.choice([-1.0, 1.0], ACTIVE) * rng.uniform(0.5, 3.0, ACTIVE)
        faults = [
            Fault(shape="bias", channel="tas", onset_s=float(dictionary.atoms[j].onset_s), magnitude=z)
            for j, z in zip(active, sizes, strict=True)
        ]
        log = inject(log, faults)
        began = process_time()
        result, _ = identify(log, dictionary, Config())
        seconds.append(process_time() - began)
        found = {one.name: one.magnitude for one in result.faults}
        truth = {f"step_{j:02d}": z for j, z in zip(active, sizes, strict=True)}
        exact += found.keys() == truth.keys()
        errors += [abs(found[name] / z - 1.0) for name, z in truth.items() if name in found]
        if found.keys() != truth.keys():
            print(f"\nseed {seed}: {truth} -> {found}")
    print(
        f"\nexact {exact} of {len(SEEDS)}, median error {np.median(errors):.2%}, CPU {np.median(seconds):.2f} s, "
        f"at most {max(seconds):.2f} s"
    )
    assert not_below(exact / len(SEEDS), 0.99, len(SEEDS))
    assert np.median(errors) <= 0.015
