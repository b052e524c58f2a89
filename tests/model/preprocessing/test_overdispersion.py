"""Overdispersion: 1 for white errors, more where a shape stands out, and the same by two roads for a declared entry."""

from __future__ import annotations

import numpy as np
import pytest
from made_logs import made_log

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import FlightLog
from bfi_cli.kernels.variable_projection import fit_magnitudes
from bfi_cli.model.preprocessing.magnitudes import overdispersion, overdispersion_if_declared
from bfi_cli.model.preprocessing.window import prepare_window, regression_of

ORDER = 2
DICTIONARY = load_dictionary(
    {
        "channel": "tas",
        "atoms": [
            {"name": "bias", "shape": "bias", "onset_s": 50},
            {"name": "sine", "shape": "sine", "onset_s": 50, "frequency_hz": 0.05},
            {"name": "later", "shape": "sine", "onset_s": 70, "frequency_hz": 0.05},
        ],
    }
)
CONFIG = merge(
    Config(),
    {
        "inputs": ("elevator",),
        "model.orders": (ORDER,),
        "conditioning.rate_hz": "none",
        "conditioning.variance": "constant",
    },
)


def flight(seed: int, wave: float) -> FlightLog:
    """Return two minutes of an output that an elevator drives, with a slow wave beside white errors."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(600) / 5.0
    elevator, tas = 0.05 * rng.standard_normal(600), np.zeros(600)
    for k in range(1, 600):
        tas[k] = 0.7 * tas[k - 1] + 4.0 * elevator[k - 1] + 0.1 * rng.standard_normal()
    tas += 100.0 + wave * np.cos(2.0 * np.pi * 0.05 * time_s)
    return made_log(time_s, {"elevator": "rad", "tas": "m/s"}, elevator=elevator, tas=tas)


@pytest.mark.parametrize("wave", [0.0, 0.3])
def test_an_entry_would_be_tested_by_the_factor_of_the_fit_that_has_it(wave: float):
    window = prepare_window(flight(1, wave), DICTIONARY, CONFIG)
    regression = regression_of(window, CONFIG)
    problem = regression.problem(ORDER)
    none = fit_magnitudes(problem, ())
    dispersion = overdispersion(window, regression, none)
    declared = overdispersion_if_declared(window, regression, none, dispersion)
    for n in range(len(window.live)):
        alone = overdispersion(window, regression, fit_magnitudes(problem, (n,)))
        assert declared[n] == pytest.approx(max(dispersion[n], alone[n]), rel=1e-9)
    assert dispersion[1] == dispersion[2], "one family"
    assert (dispersion.max() < 3.0) == (wave == 0.0)


def test_declared_entries_keep_their_factor():
    window = prepare_window(flight(2, 0.3), DICTIONARY, CONFIG)
    regression = regression_of(window, CONFIG)
    fit = fit_magnitudes(regression.problem(ORDER), (1,))
    dispersion = overdispersion(window, regression, fit)
    declared = overdispersion_if_declared(window, regression, fit, dispersion)
    assert declared[1] == dispersion[1]
    assert (declared >= dispersion).all()
