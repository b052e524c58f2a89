"""The Boeing 747 of the paper, 20 s with a 3-2-1-1 on the elevators."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject

TRAIN = (0.0, 8.0)


@pytest.fixture(scope="session")
def flown() -> Callable[..., FlightLog]:
    """Return a function that flies it with noise relative to each channel's spread, and faults."""
    time_s = time_axis(duration_s=20.0)
    clean = simulate(find_model("b747"), manoeuvre("3211", time_s), rng=np.random.default_rng(0))
    spread = {name: float(one.values.std()) for name, one in clean.channels.items()}

    def fly(*faults: Fault, seed: int = 0, noise: float = 0.01) -> FlightLog:
        model = find_model("b747")
        log = simulate(
            model,
            manoeuvre("3211", time_s),
            rng=np.random.default_rng(seed),
            noise_sd={name: noise * spread[name] for name in model.outputs},
        )
        return inject(log, list(faults)) if faults else log

    return fly
