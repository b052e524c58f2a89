"""What a scan claims: sizes that would be declared, the level of its limits, the onsets covered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import optimize, stats

from bfi_cli import kernels
from bfi_cli.config import Config, merge
from bfi_cli.decision import candidate_of
from bfi_cli.kernels.onset.scan import Scan
from bfi_cli.model.onset import claims
from bfi_cli.model.onset.scan import scan_of
from bfi_cli.model.onset.scan_record import ScanRecord, prepare_record
from bfi_cli.model.onset.shapes import ShapeHypothesis, fault_of, waveform

ORDER, RATE_HZ = 4, 10.0
BIAS = ShapeHypothesis(shape="bias", output=0, parameter=None, file=None)
LAG = replace(BIAS, shape="lagged_bias", parameter=5.0)


@pytest.fixture(scope="module")
def record(flown: Callable) -> ScanRecord:
    asked = {"conditioning.rate_hz": RATE_HZ, "model.order": ORDER, "start_time.shapes": ("bias", "sine")}
    return prepare_record(flown(), merge(Config(), asked))


def signal_of(record: ScanRecord, form: ShapeHypothesis, onset: int) -> np.ndarray:
    """Return (n_samples, 1) what a fault of magnitude 1, which begins to act at a sample, adds to the scaled output."""
    wave, n = waveform(form, record.sampling), record.sampling.n_samples
    theta = np.zeros((n, 1))
    theta[onset:, 0] = wave.unit * wave.samples[: n - onset]
    return theta


def sized(record: ScanRecord, scan: Scan, threshold: float, suspicion: float) -> claims.Limits:
    """Return the sizes of a step at every onset, whatever the record says of them by its likelihood."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims, "WEIGHED", ())
        limits = claims._limits(record, scan, BIAS, rule_of(threshold, suspicion), 1.0)
    assert limits is not None
    return limits


def rule_of(threshold: float, suspicion: float) -> Any:
    """Return a rule that declares and suspects every shape from two statistics on."""
    return SimpleNamespace(threshold=lambda _shape: threshold, suspicion=lambda _shape: suspicion)


@pytest.mark.parametrize("threshold", [30.0, 90.0])
def test_a_fault_of_the_size_that_is_seen_exceeds_the_threshold_by_90_percent_power(record: ScanRecord, threshold):
    """Its root, in the mean of both signs, lies 1.28 standard deviations of the scatter above the threshold's."""
    y = record.y + 0.03 * signal_of(record, BIAS, 100)
    scan = scan_of(record, y, ORDER, output=0)
    limits = sized(record, scan, threshold, threshold)
    phi = float(limits.profile.statistic.mean())
    assert phi > 1.2
    for i in range(0, len(limits.onset_s), 60):
        m, onset = limits.declared[i], int(limits.profile.onsets[i])
        without, kept = [], []
        for sign in (1.0, -1.0):
            faulty = y + sign * m * signal_of(record, BIAS, onset)
            without.append(scan_of(record, faulty, ORDER, output=0).rss0)
            kept.append(scan.rss0)
        statistic = scan.n_rows * np.mean(np.log(np.array(without) / kept))
        assert np.sqrt(statistic) == pytest.approx(np.sqrt(threshold) + 1.2815516 * np.sqrt(phi), rel=0.02)


@pytest.mark.parametrize("size", [0.01, 0.03])
def test_a_size_is_excluded_at_95_percent_above_the_likeliest(record: ScanRecord, size: float):
    """Where next to any fault would be declared, what the record does not admit is what is left of the limit."""
    onset = 150
    y = record.y + size * signal_of(record, BIAS, onset)
    limits = sized(record, scan_of(record, y, ORDER, output=0), 1e-6, 1e-6)
    phi = max(1.0, float(limits.profile.statistic.mean()))
    i = int(limits.profile.best)
    assert limits.profile.onsets[i] == onset
    z, sd = float(limits.profile.z[i]), float(limits.profile.sd[i])
    assert (limits.excluded[i] - abs(z)) / (sd * np.sqrt(phi)) == pytest.approx(1.6448536, rel=0.02)
    assert limits.excluded[i] > limits.declared[i]


def test_of_one_onset_5_percent_of_faults_of_the_worst_size_are_excluded():
    """A standard normal deviate about the fault's size in standard deviations; the ratio is the mean of both signs."""

    def missed(z: float) -> float:
        x = np.arccosh(claims.EXCLUDED * np.exp(0.5 * z**2)) / z if claims.EXCLUDED * np.exp(0.5 * z**2) > 1.0 else 0.0
        return float(stats.norm.cdf(x - z) - stats.norm.cdf(-x - z))

    worst = max(map(missed, np.linspace(0.5, 8.0, 751)))
    assert 0.03 < worst <= 0.05
    np.testing.assert_allclose(stats.norm.cdf([kernels.ONE_SIDED_90, kernels.ONE_SIDED_95]), [0.9, 0.95], rtol=1e-12)


@pytest.mark.parametrize("form", [BIAS, LAG])
def test_no_onset_that_is_covered_is_passed_over(record: ScanRecord, form: ShapeHypothesis):
    """A fault that begins between two onsets that are looked at looks like neither."""
    scan = scan_of(record, record.y, ORDER, output=0)
    onset_s = record.onsets_s(claims._covered(record, scan, form) + record.sampling.lead)
    np.testing.assert_allclose(np.diff(onset_s), 1.0 / RATE_HZ, atol=1e-6)
    earliest_s, latest_s = claims.covered_s(record, ORDER)
    assert (onset_s[0], onset_s[-1]) == pytest.approx((earliest_s, latest_s), abs=1e-6)


def test_oscillations_that_are_claimed_have_six_cycles_of_which_two_are_left(record: ScanRecord):
    scan = scan_of(record, record.y, ORDER, output=0)
    forms = claims._claimed(record, scan, replace(BIAS, shape="sine"), None, lambda _: None)
    lowest = min(form.parameter or 0.0 for form in forms)
    assert lowest == pytest.approx(6.0 / record.settings.duration_s, rel=1e-9)
    slow = replace(BIAS, shape="sine", parameter=lowest)
    last = int(claims._covered(record, scan, slow)[-1])
    assert scan.n_samples - last - 1 < 2.0 * RATE_HZ / lowest <= scan.n_samples - last


def test_a_lag_is_suspected_where_the_record_is_likelier_with_one_beyond_the_tolerance(record: ScanRecord):
    tolerance = 2.0
    scaled = tolerance / float(record.unit[0])
    theta = signal_of(record, LAG, 150)

    def beyond(z: float) -> float:
        scan = scan_of(record, record.y + z * theta, ORDER, output=0)
        limits = claims._limits(record, scan, LAG, rule_of(30.0, 20.0), tolerance)
        assert limits is not None
        return limits.beyond

    middle = optimize.brentq(lambda z: np.log(beyond(z)), 0.0, 3.0 * scaled, xtol=1e-3)
    for z, suspected in ((0.99 * middle, False), (1.01 * middle, True)):
        assert (beyond(z) >= 1.0) is suspected
        assert 0.5 < beyond(z) < 2.0
        scan = scan_of(record, record.y + z * theta, ORDER, output=0)
        looked_for = candidate_of(fault_of(LAG, "tas", magnitude=1.0, onset_s=0.0), "m/s", tolerance=tolerance)
        candidate = claims._bounded(record, scan, rule_of(30.0, 20.0), looked_for, LAG, None, None, lambda _: None)
        assert (candidate.state == "suspected") is suspected
        # What is scanned as a step is seen as a fault beyond the tolerance, or not at all.
        assert candidate.minimal_detectable_scan is None
        assert candidate.seen_above is not None
        assert candidate.seen_above >= max(tolerance, candidate.effect or 0.0)


def test_limits_near_an_onset_are_of_the_onsets_within_the_tolerance(record: ScanRecord):
    scan = scan_of(record, record.y, ORDER, output=0)
    limits = sized(record, scan, 30.0, 20.0)
    i = len(limits.onset_s) // 2
    near = np.abs(np.arange(len(limits.onset_s)) - i) <= 10
    found = limits.near(float(limits.onset_s[i]), 10.5 / RATE_HZ)
    assert found is not None
    (_, effect), _ = found
    assert effect == limits.effect[near].max()
    assert limits.near(float(limits.onset_s[-1]) + 5.0, 1.0) is None
