"""How large a fault could be without being declared: against records with such a fault added."""

from __future__ import annotations

import numpy as np
import pytest
from plain_onset import plain_rss, record, signal, waveforms

from bfi_cli.kernels.onset.scan import (
    deviances,
    excluded_error,
    likelihood_ratios,
    mean_ratios,
    prepare_scan,
    scan_shape,
    undeclared_magnitudes,
)

N, ORDER = 300, 4
ONSETS = np.array([60, 150, 250])
SHAPES = ("bias", "drift", "sine", "lagged bias", "ramp-hold")


@pytest.mark.parametrize("name", SHAPES)
def test_a_deviance_is_the_log_ratio_of_plain_least_squares(name):
    u, y = record(N)
    waveform, scan = waveforms(N)[name], prepare_scan(*record(N), order=ORDER)
    m = np.array([[0.1, 0.2, 0.3], [2.0, 1.0, 0.5]])
    plus, minus = deviances(scan, waveform, ONSETS, m)
    without = plain_rss(u, y, signal(waveform, 60), z=0.0, order=ORDER)
    for k, j in np.ndindex(m.shape):
        for found, sign in ((plus, 1.0), (minus, -1.0)):
            rss = plain_rss(u, y, signal(waveform, ONSETS[j]), z=sign * m[k, j], order=ORDER)
            assert found[k, j] == pytest.approx(scan.n_rows * np.log(rss / without), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("power", [20.0, 90.0])
def test_a_fault_of_the_limit_reaches_the_statistic_in_the_mean_of_both_signs(name, power):
    """A larger one reaches more; the statistic of a record with the fault is that against the fault left in place."""
    u, y = record(N)
    waveform, scan = waveforms(N)[name], prepare_scan(u, y, order=ORDER)
    profile = scan_shape(scan, waveform, ONSETS)
    limit, suspected, _ = undeclared_magnitudes(scan, waveform, profile, power=power, suspicion=power, doubt=5.4)
    np.testing.assert_array_equal(suspected, limit)
    assert np.isfinite(limit).all()
    for onset, m in zip(ONSETS, limit, strict=True):
        reached = []
        for size in (m, -m, 1.5 * m, -1.5 * m):
            faulty = y + size * signal(waveform, onset)[:, None]
            found = prepare_scan(u, faulty, order=ORDER)
            rest = plain_rss(u, faulty, signal(waveform, onset), z=size, order=ORDER)
            reached.append(found.n_rows * np.log(found.rss0 / rest))
        assert np.mean(reached[:2]) == pytest.approx(power, rel=0.05)
        assert min(reached[2:]) > power


def test_the_second_limit_is_beyond_the_best_magnitude_on_both_sides():
    u, y = record(N)
    waveform = waveforms(N)["bias"]
    y[:, 0] += 0.5 * signal(waveform, 150)
    scan = prepare_scan(u, y, order=ORDER)
    profile = scan_shape(scan, waveform, np.array([150]))
    _, _, admitted = undeclared_magnitudes(scan, waveform, profile, power=50.0, suspicion=25.0, doubt=5.4)
    z, sd = float(profile.z[0]), float(profile.sd[0])
    assert z == pytest.approx(0.5, abs=4 * sd)
    assert abs(z) + 2.0 * sd < admitted[0] < abs(z) + 3.0 * sd


def test_limits_scale_with_the_record_and_not_with_its_level():
    u, y = record(N)
    waveform = waveforms(N)["bias"]
    limits = []
    for scale, level in ((1.0, 0.0), (10.0, 0.0), (1.0, 500.0)):
        scan = prepare_scan(u, scale * y + level, order=ORDER)
        profile = scan_shape(scan, waveform, ONSETS)
        limits.append(np.array(undeclared_magnitudes(scan, waveform, profile, power=40.0, suspicion=20.0, doubt=5.4)))
    np.testing.assert_allclose(limits[1], 10.0 * limits[0], rtol=1e-5)
    np.testing.assert_allclose(limits[2], limits[0], rtol=1e-5)


def test_a_likelihood_ratio_is_that_of_plain_least_squares_in_the_mean_of_both_signs():
    u, y = record(N)
    waveform, scan = waveforms(N)["lagged bias"], prepare_scan(*record(N), order=ORDER)
    m = np.array([[0.05, 0.1, 0.2]])
    found = likelihood_ratios(deviances(scan, waveform, ONSETS, m), dispersion=3.0)
    for j, onset in enumerate(ONSETS):
        rss = [plain_rss(u, y, signal(waveform, onset), z=z, order=ORDER) for z in (0.0, m[0, j], -m[0, j])]
        ratios = [np.exp(-0.5 * scan.n_rows * np.log(one / rss[0]) / 3.0) for one in rss[1:]]
        assert found[0, j] == pytest.approx(np.mean(ratios), rel=1e-5)


def test_the_mean_over_sizes_is_that_of_a_decade():
    """Of a likelihood ratio that is a power of the size the mean over a decade has a closed form."""
    errors = np.geomspace(0.1, 100.0, 301)
    found = mean_ratios(errors, np.stack([errors**-2.0, 3.0 * errors**-2.0], axis=1))
    kept = errors[: len(found)]
    assert kept[-1] == pytest.approx(10.0)
    expected = 2.0 * (kept**-2.0 - (10.0 * kept) ** -2.0) / (2.0 * np.log(10.0))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_an_error_is_excluded_where_all_larger_ones_are():
    errors = np.geomspace(0.1, 10.0, 5)
    assert excluded_error(errors, np.array([1.0, 0.01, 0.5, 0.01, 0.01]), 0.05) > errors[2]
    assert excluded_error(errors, np.array([1.0, 0.1, 0.1, 0.1, 0.05]), 0.05) == pytest.approx(errors[4])
    assert excluded_error(errors, np.full(5, 0.01), 0.05) == errors[0]
    assert excluded_error(errors, np.full(5, 0.06), 0.05) == np.inf
