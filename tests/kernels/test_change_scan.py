"""The scan for a change against dense generalised least squares, and its invariances."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.kernels.change_scan import CORRELATIONS, scan_changes, steps_and_ramps

N = 90
TIME_S = np.delete(np.arange(N + 6, dtype=float), [20, 21, 22, 50, 51, 70])
ONSETS_S = np.arange(8.0, 80.0, 4.0)
CANDIDATES = np.hstack(steps_and_ramps(TIME_S, ONSETS_S))
NUISANCES = np.column_stack([np.ones(N), np.sin(TIME_S / 9.0), 1e6 * np.cos(TIME_S / 17.0)])


def record(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    y = np.zeros(N)
    for k in range(1, N):
        y[k] = 0.8 * y[k - 1] + rng.standard_normal()
    return y


def test_the_statistic_is_that_of_dense_least_squares():
    y, floor = record(0), 0.1

    def log_likelihood(design: np.ndarray, correlation: float) -> tuple[float, np.ndarray]:
        covariance = correlation ** np.abs(TIME_S[:, None] - TIME_S)
        factor = np.linalg.cholesky(covariance)
        white, target = np.linalg.solve(factor, design), np.linalg.solve(factor, y)
        estimate = np.linalg.lstsq(white, target, rcond=None)[0]
        squares = float(np.sum((target - white @ estimate) ** 2))
        variance = max(squares / N, floor**2)
        return -0.5 * (N * np.log(variance) + squares / variance) - np.log(np.diag(factor)).sum(), estimate

    scan = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=floor)
    none = max(log_likelihood(NUISANCES, one)[0] for one in CORRELATIONS)
    for j in (0, 7, len(ONSETS_S) + 5):
        design = np.column_stack([NUISANCES, CANDIDATES[:, j]])
        best, estimate = max((log_likelihood(design, one) for one in CORRELATIONS), key=lambda both: both[0])
        assert scan.statistic[j] == pytest.approx(2.0 * (best - none), rel=1e-7, abs=1e-7)
        assert scan.amplitude[j] == pytest.approx(estimate[-1], rel=1e-7)


def test_free_nuisances_leave_it_as_it_is():
    y = record(1)
    one = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=0.1)
    other = scan_changes(y + NUISANCES @ [50.0, -3.0, 2e-5], TIME_S, NUISANCES, CANDIDATES, floor=0.1)
    np.testing.assert_allclose(other.statistic, one.statistic, atol=1e-8)
    np.testing.assert_allclose(other.amplitude, one.amplitude, atol=1e-9)


def test_units_do_not_matter():
    y = record(2)
    one = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=0.1)
    other = scan_changes(1e-4 * y, TIME_S, NUISANCES, CANDIDATES, floor=1e-5)
    np.testing.assert_allclose(other.statistic, one.statistic, atol=1e-8)
    np.testing.assert_allclose(other.amplitude, 1e-4 * one.amplitude, rtol=1e-8)
    np.testing.assert_allclose(other.sd, 1e-4 * one.sd, rtol=1e-8)


@pytest.mark.parametrize("j", [6, len(ONSETS_S) + 6])
def test_a_change_without_noise_is_found_exactly(j):
    scan = scan_changes(0.3 * CANDIDATES[:, j], TIME_S, NUISANCES, CANDIDATES, floor=1e-9)
    assert int(np.argmax(scan.statistic)) == j
    assert scan.amplitude[j] == pytest.approx(0.3, rel=1e-9)


def test_the_leverage_bounds_what_an_error_of_any_course_changes():
    """It is reached by the error that has the sign of every coefficient."""
    rng, y = np.random.default_rng(5), record(4)
    one = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=1e-3)
    same = np.zeros(CANDIDATES.shape[1], dtype=bool)
    for course in (*rng.uniform(-1.0, 1.0, (20, N)), np.sign(np.sin(TIME_S / 7.0)), np.ones(N)):
        other = scan_changes(y + 1e-6 * course, TIME_S, NUISANCES, CANDIDATES, floor=1e-3)
        moved = np.abs(other.amplitude - one.amplitude)
        close = moved <= 1.001e-6 * one.leverage
        assert np.mean(close) > 0.95  # the others changed to another correlation of the noise
        same |= moved > 0.0
    assert same.all()
    ones = scan_changes(y, TIME_S, np.ones((N, 1)), CANDIDATES[:, 9:10], floor=1e3)
    step = CANDIDATES[:, 9] - CANDIDATES[:, 9].mean()
    np.testing.assert_allclose(ones.leverage, np.abs(step).sum() / (step @ step), rtol=1e-9)


def test_nothing_at_all_is_no_change():
    scan = scan_changes(np.zeros(N), TIME_S, NUISANCES, CANDIDATES, floor=1e-9)
    np.testing.assert_allclose(scan.statistic, 0.0, atol=1e-9)
    assert scan.noise_sd == 1e-9


def test_a_candidate_that_the_nuisances_imitate_says_nothing():
    scan = scan_changes(record(3), TIME_S, np.column_stack([NUISANCES, CANDIDATES[:, 4]]), CANDIDATES, floor=0.1)
    assert scan.statistic[4] == 0.0
    assert scan.sd[4] == np.inf
    assert np.isfinite(scan.sd[0])


def test_a_size_lies_between_none_and_free():
    y = record(4)
    free = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=0.1)
    without = scan_changes(y, TIME_S, NUISANCES[:, :2], CANDIDATES, floor=0.1)
    for size, like in ((1e6, free), (1e-12, without)):
        sizes = np.array([np.inf, np.inf, size])
        scan = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=0.1, sizes=sizes)
        np.testing.assert_allclose(scan.statistic, like.statistic, atol=1e-4)


def test_the_statistic_of_one_candidate_is_a_chi_square():
    """Within four binomial standard deviations of 5 %, the profile over the correlation adding a little."""
    trials = 400
    above = 0
    for seed in range(trials):
        scan = scan_changes(record(100 + seed), TIME_S, np.ones((N, 1)), CANDIDATES[:, 9:10], floor=1e-3)
        above += scan.statistic[0] > 3.84
    assert 0.02 < above / trials < 0.11


@pytest.mark.parametrize(("n", "floor", "message"), [(N, 0.0, "floor"), (4, 0.1, "more samples")])
def test_what_cannot_be_scanned_is_refused(n, floor, message):
    with pytest.raises(ValueError, match=message):
        scan_changes(np.zeros(n), TIME_S[:n], NUISANCES[:n], CANDIDATES[:n], floor=floor)


@pytest.mark.parametrize("floor", [0.1, 3.0], ids=["noise", "least noise"])
def test_a_hidden_size_is_where_the_statistic_of_the_worse_sign_reaches_the_threshold(floor: float):
    y, declared_at = record(5), 25.0
    scan = scan_changes(y, TIME_S, NUISANCES, CANDIDATES, floor=floor, declared_at=declared_at)
    for j in (0, 9, len(ONSETS_S), len(ONSETS_S) + 10):

        def least(size: float, j: int = j) -> float:
            changed = (y + sign * size * CANDIDATES[:, j] for sign in (1.0, -1.0))
            scans = (scan_changes(one, TIME_S, NUISANCES, CANDIDATES[:, j : j + 1], floor=floor) for one in changed)
            return min(float(one.statistic[0]) for one in scans)

        assert least(scan.hidden[j]) == pytest.approx(declared_at, rel=1e-6)
        assert least(1.01 * scan.hidden[j]) > declared_at > least(0.99 * scan.hidden[j])


def test_what_the_nuisances_imitate_may_hide_at_any_size():
    nuisances = np.column_stack([NUISANCES, CANDIDATES[:, 4]])
    scan = scan_changes(record(3), TIME_S, nuisances, CANDIDATES, floor=0.1, declared_at=25.0)
    assert scan.hidden[4] == np.inf
    assert np.isfinite(scan.hidden[9])
