"""The regression of a window: scales, orders, and a fault added to the factor instead of to the record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import LogError
from bfi_cli.faults.filters import Filter, recorded_signal
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.variable_projection import fit_magnitudes
from bfi_cli.model.preprocessing import signals
from bfi_cli.model.preprocessing.regression import build_regression, feasible_orders
from bfi_cli.model.preprocessing.signals import decimate_native
from bfi_cli.model.preprocessing.window import prepare_window, regression_of

ROOT = Path(__file__).parents[3]
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
    faulty = replace(window.signals, y=window.signals.y + np.asarray(window.signals.theta) @ z)
    direct = build_regression(faulty, window.live, config)
    np.testing.assert_allclose(recombined.layout.y, direct.layout.y, atol=1e-12)
    for name in ("center", "unit", "magnitude_unit"):
        np.testing.assert_allclose(getattr(recombined, name), getattr(direct, name), rtol=1e-12, atol=1e-14)
    gram, expected = (one.data.R.T @ one.data.R for one in (recombined, direct))
    np.testing.assert_allclose(gram, expected, atol=1e-10 * expected.max())
    atoms = range(len(window.live))
    one, other = (fit_magnitudes(each.problem(4), atoms).z * each.magnitude_unit for each in (recombined, direct))
    np.testing.assert_allclose(one, other, rtol=1e-6)


@pytest.mark.parametrize("outputs", [["tas"], ["tas", "aoa"]])
def test_channels_filtered_one_by_one_are_those_filtered_together(log, monkeypatch: pytest.MonkeyPatch, outputs):
    config = merge(Config(), {"outputs": outputs, "inputs": ["elevator", "pitch"], "conditioning.rate_hz": 10.0})
    native = prepare_window(log, load_dictionary(THESIS), config).native
    whole, largest = decimate_native(native, 10)
    monkeypatch.setattr(signals, "MOST_AT_ONCE", 100)
    parts, same = decimate_native(native, 10)
    for name in ("time_s", "u", "y", "theta"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(same, largest)


def test_rows_are_weighted_where_gusts_come_and_go(log):
    rng = np.random.default_rng(0)
    tas = log.channel("tas")
    gusts = np.where(log.time_s < 15.0, 0.01, 0.1) * rng.standard_normal(log.n_samples)
    gusty = replace(log, channels={**log.channels, "tas": replace(tas, values=frozen_array(tas.values + gusts))})
    config, dictionary = merge(Config(), {"conditioning.rate_hz": 10.0}), load_dictionary(THESIS)
    weights = regression_of(prepare_window(gusty, dictionary, config), config).layout.weights
    assert weights is not None
    assert np.median(weights[20:120]) > 2.0 * np.median(weights[-120:])
    constant = merge(config, {"conditioning.variance": "constant"})
    assert regression_of(prepare_window(gusty, dictionary, constant), constant).layout.weights is None
    published = merge(config, {"method": "risro-as-published"})
    assert regression_of(prepare_window(gusty, dictionary, published), published).layout.weights is None


@pytest.mark.parametrize("rate_hz", [100.0, 10.0, 7.0, 3.0])
def test_the_response_of_a_window_makes_the_dictionary_at_its_native_rate(log, rate_hz):
    """Two roads to the same step: through the filters on the log's own grid, and through the window's response."""
    recorder = Filter(kind="gaussian", edge_hz=0.75, rate_hz=100.0)
    step = {"relative_to": "log", "atoms": [{"shape": "bias", "channel": "tas", "onset_s": 15.0}]}
    config = merge(Config(), {"conditioning.rate_hz": rate_hz})
    window = prepare_window(replace(log, filters=(recorder,)), load_dictionary(step), config)
    made = recorded_signal(window.faults[0], window.native.time_s, window.response, window_start_s=0.0)
    # A step that begins between two samples is known to half a sample, in which this one rises by 1.6 per second.
    own = window.native.theta_between(slice(None))[:, 0, 0]
    np.testing.assert_allclose(made, own, atol=0.05 + 0.8 / window.native.rate_hz)


def test_orders_need_two_rows_for_each_regressor():
    assert feasible_orders("a.csv", 100, (12, 2, 8), n_inputs=1, n_outputs=1) == (2, 8, 12)
    assert feasible_orders("a.csv", 45, (12, 2, 8), n_inputs=1, n_outputs=1) == (2, 8)
    with pytest.raises(LogError, match=r"^a\.csv: order 12 needs more than the 45 samples .*; give --order 8 or less"):
        feasible_orders("a.csv", 45, (12,), n_inputs=1, n_outputs=1)
