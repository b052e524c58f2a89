"""Magnitudes averaged over models: the truth where one fits, and covering intervals where the record integrates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bfi_cli.config import Config, merge
from bfi_cli.kernels.model_selection import Penalty, ScoredFit
from bfi_cli.kernels.variable_projection import fit_magnitudes, with_unit_root
from bfi_cli.preprocessing.magnitudes import UNIT_ROOT, averaged_magnitudes, magnitudes_of_fit
from bfi_cli.preprocessing.regression import RegressionData, Signals, build_regression

RATE_HZ, DURATION_S, ONSET_S, ORDER = 2.0, 120.0, 60.0, 4
UNITS = {"bias": 1.0, "drift": 0.05}


def record(
    seed: int, shape: str, z: float, *, pole: float = 1.0, walk: float = 0.0, noise: float = 0.3, n_inputs: int = 1
) -> Signals:
    """Return a record of an output that inputs drive, with a fault of magnitude z.

    Parameters
    ----------
    pole : of the response to inputs and noise; 1 integrates them.
    walk : size of the steps of a random walk beside it, as of wind and trim.
    n_inputs : of which the first acts, all of them wandering where the output integrates.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    n, keeps, gain = len(time_s), 1.0 if pole == 1.0 else 0.9, 0.1 if pole == 1.0 else 0.3
    u, y = np.zeros((n, n_inputs)), np.zeros(n)
    for k in range(1, n):
        u[k] = keeps * u[k - 1] + rng.standard_normal(n_inputs)
        y[k] = pole * y[k - 1] + gain * u[k, 0] + noise * rng.standard_normal()
    y += np.cumsum(walk * rng.standard_normal(n))
    after = np.maximum(time_s - ONSET_S, 0.0)
    theta = UNITS[shape] * (after if shape == "drift" else (time_s >= ONSET_S).astype(float))
    return Signals(
        path="made",
        rate_hz=RATE_HZ,
        factor=1,
        time_s=time_s,
        u=u,
        y=(y + z * theta)[:, None],
        theta=theta[:, None, None],
    )


def regression(signals: Signals) -> RegressionData:
    config = merge(Config(), {"conditioning.variance": "constant"})
    return build_regression(signals, (0,), config, orders=(ORDER,))


def fitted(data: RegressionData, z: float) -> tuple[ScoredFit, Penalty]:
    fit = fit_magnitudes(data.problem(ORDER), (0,), np.array([z]) / data.magnitude_unit)
    penalty = Penalty(n_rows=data.n_rows, n_effective=float(data.n_rows), n_candidates=1, evidence=0.0)
    return ScoredFit(criterion=penalty.criterion(fit), fit=fit), penalty


@pytest.mark.parametrize("shape", UNITS)
def test_evidence_against_a_root_that_is_there_is_rare(shape):
    """Perron's 5 %, at which the constant stands, within three binomial deviations; one or two inputs wander."""
    n, exceeded = 60, 0
    for seed in range(n):
        data = regression(record(seed, shape, 1.0, n_inputs=1 + seed % 2))
        scored, _ = fitted(data, 1.0)
        held = fit_magnitudes(with_unit_root(data.problem(ORDER)), (0,), scored.fit.z)
        exceeded += data.n_rows * (held.log_det - scored.fit.log_det) > UNIT_ROOT
    assert exceeded <= n * 0.05 + 3.0 * np.sqrt(n * 0.05 * 0.95)


def test_where_the_wind_wanders_the_interval_of_a_drift_covers():
    """The response forgets and the wind does not: one model, made to choose, is far too sure of what it forgets."""
    n, covered = 60, np.zeros(2)
    for seed in range(n):
        data = regression(record(1000 + seed, "drift", 5.0, pole=0.7, walk=0.3, noise=0.0))
        scored, penalty = fitted(data, 5.0)
        one = magnitudes_of_fit(data, scored, penalty)
        several = averaged_magnitudes(data, [scored], penalty, np.ones(1))
        for i, estimates in enumerate((one, several)):
            reach = estimates.quantile * np.sqrt(estimates.variance[0])
            covered[i] += abs(estimates.value[0] - 5.0) <= reach
            assert estimates.covariance[0, 0] == pytest.approx(estimates.variance[0])
    print(f"one model covers {covered[0] / n:.1%}, the average {covered[1] / n:.1%}")
    assert stats.binom.cdf(covered[0], n, 0.75) < 0.05
    assert stats.binom.cdf(covered[1], n, 0.90) > 0.05


@pytest.mark.parametrize("shape", UNITS)
@pytest.mark.parametrize("seed", range(3))
def test_where_the_root_is_ruled_out_nothing_changes(shape, seed):
    data = regression(record(seed, shape, 5.0, pole=0.2))
    scored, penalty = fitted(data, 5.0)
    one = magnitudes_of_fit(data, scored, penalty)
    several = averaged_magnitudes(data, [scored], penalty, np.ones(1))
    assert several.value == pytest.approx(one.value, rel=1e-4)
    assert several.variance == pytest.approx(one.variance, rel=0.02)


def test_overdispersion_widens_and_weakens_the_evidence_against_the_root():
    data = regression(record(5, "drift", 5.0, pole=0.93))
    scored, penalty = fitted(data, 5.0)
    sds = [
        float(np.sqrt(averaged_magnitudes(data, [scored], penalty, np.array([phi])).variance[0]))
        for phi in (1.0, 2.0, 8.0)
    ]
    assert sds[1] > np.sqrt(2.0) * sds[0] * 0.999
    assert sds[2] > 2.0 * sds[1] * 0.999


def test_an_order_of_1_is_not_averaged():
    signals = record(3, "bias", 5.0)
    data = build_regression(signals, (0,), merge(Config(), {"conditioning.variance": "constant"}), orders=(1,))
    fit = fit_magnitudes(data.problem(1), (0,))
    penalty = Penalty(n_rows=data.n_rows, n_effective=float(data.n_rows), n_candidates=1, evidence=0.0)
    scored = ScoredFit(criterion=penalty.criterion(fit), fit=fit)
    one = magnitudes_of_fit(data, scored, penalty)
    several = averaged_magnitudes(data, [scored], penalty, np.ones(1))
    assert several.value == pytest.approx(one.value)
    assert several.variance == pytest.approx(one.variance)
