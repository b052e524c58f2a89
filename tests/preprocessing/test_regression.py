"""The regression of a window: scales, orders, and a fault added to the factor instead of to the record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.aircraft import Dryden, find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.kernels.variable_projection import fit_magnitudes
from bfi_cli.preprocessing.regression import build_regression, feasible_orders
from bfi_cli.preprocessing.window import prepare_window, regression_of

ROOT = Path(__file__).parents[2]
THESIS = ROOT / "configs" / "thesis_dictionary.yaml"
BOTH = {
    "relative_to": "window",
    "atoms": [
        {"shape": "bias", "channel": "tas", "onset_s": 13.8},
        {"shape": "bias", "channel": "aoa", "onset_s": 9.0},
        {"shape": "drift", "channel": "tas", "onset_s": 12.0},
    ],
}


@pytest.fixture(scope="module")
def log():
    return read_log(ROOT / "data" / "citation_clean.h5")


@pytest.mark.parametrize("detrend", ["constant", "none"])
@pytest.mark.parametrize(("outputs", "dictionary"), [(["tas"], THESIS), (["tas", "aoa"], BOTH)])
def test_a_fault_added_to_the_factor_is_a_fault_added_to_the_record(log, detrend, outputs, dictionary):
    config = merge(Config(), {"outputs": outputs, "conditioning": {"rate_hz": 10.0, "detrend": detrend}})
    window = prepare_window(log, load_dictionary(dictionary), config)
    z = np.random.default_rng(0).standard_normal(len(window.live)) * window.signals.y.std(axis=0).min()
    recombined = regression_of(window, config).with_fault(z)
    faulty = replace(window.signals, y=window.signals.y + window.signals.theta @ z)
    direct = build_regression(faulty, window.live, config)
    np.testing.assert_allclose(recombined.layout.y, direct.layout.y, atol=1e-12)
    for name in ("center", "unit", "magnitude_unit"):
        np.testing.assert_allclose(getattr(recombined, name), getattr(direct, name), rtol=1e-12, atol=1e-14)
    gram, expected = (one.data.R.T @ one.data.R for one in (recombined, direct))
    np.testing.assert_allclose(gram, expected, atol=1e-10 * expected.max())
    atoms = range(len(window.live))
    one, other = (fit_magnitudes(each.problem(4), atoms).z * each.magnitude_unit for each in (recombined, direct))
    np.testing.assert_allclose(one, other, rtol=1e-6)


def test_the_regression_of_the_rate_choice_is_the_one_built_anew():
    """Gusts are predicted by a few lags, so the first rate looked at is the one kept."""
    rng, gusts = np.random.default_rng(5), Dryden(sigma_m_s=0.3)
    log = simulate(find_model("citation"), manoeuvre("3211", time_axis()), rng=rng, turbulence=gusts)
    window = prepare_window(log, load_dictionary(THESIS), Config())
    assert window.regression is not None
    anew = build_regression(window.signals, window.live, Config())
    np.testing.assert_array_equal(regression_of(window, Config()).data.R, anew.data.R)
    assert window.regression.orders == anew.orders
    assert window.regression.signals.rate_hz == window.summary.rate_hz


@pytest.mark.parametrize(
    ("config", "extra"),
    [({"model.order": 4}, {}), ({"conditioning.rate_hz": 10.0}, {}), ({}, {"name": "twin", "onset_s": 13.8})],
)
def test_another_regression_is_built_where_order_rate_or_entries_differ(log, config, extra):
    dictionary = load_dictionary(THESIS)
    if extra:
        dictionary = replace(dictionary, atoms=(*dictionary.atoms, replace(dictionary.atoms[1], **extra)))
    settings = merge(Config(), config)
    window = prepare_window(log, dictionary, settings)
    assert window.regression is None
    regression = regression_of(window, settings)
    assert regression.atoms == window.live
    assert max(regression.orders) == (4 if "model.order" in config else 12)


def test_orders_need_two_rows_for_each_regressor():
    assert feasible_orders("a.csv", 100, (12, 2, 8), n_inputs=1, n_outputs=1) == (2, 8, 12)
    assert feasible_orders("a.csv", 45, (12, 2, 8), n_inputs=1, n_outputs=1) == (2, 8)
    with pytest.raises(LogError, match=r"^a\.csv: order 12 needs more than the 45 samples .*; give --order 8 or less"):
        feasible_orders("a.csv", 45, (12,), n_inputs=1, n_outputs=1)
