"""Magnitudes averaged over models: the truth where one fits, and covering intervals where the record integrates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from bfi_cli.config import Config, merge
from bfi_cli.kernels.model_selection import Fit, Penalty
from bfi_cli.kernels.variable_projection import (
    fit_magnitudes,
    single_magnitudes,
    with_unit_root,
    without_signal,
)
from bfi_cli.model.preprocessing import magnitudes
from bfi_cli.model.preprocessing.magnitudes import (
    UNIT_ROOT,
    MagnitudeEstimates,
    averaged_magnitudes,
    estimate_magnitudes,
    magnitudes_of_fit,
    profiled_limits,
    statistic_needed,
)
from bfi_cli.model.preprocessing.regression import RegressionData, build_regression
from bfi_cli.model.preprocessing.signals import Signals

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


def fitted(data: RegressionData, z: float) -> tuple[Fit, Penalty]:
    fit = fit_magnitudes(data.problem(ORDER), (0,), np.array([z]) / data.magnitude_unit)
    penalty = Penalty(n_rows=data.n_rows, n_effective=float(data.n_rows), n_candidates=1, evidence=0.0)
    return penalty.scored(fit), penalty


@pytest.mark.parametrize("shape", UNITS)
def test_evidence_against_a_root_that_is_there_is_rare(shape):
    """Perron's 5 %, at which the constant stands, within three binomial deviations; one or two inputs wander."""
    n, exceeded = 30, 0
    for seed in range(n):
        data = regression(record(seed, shape, 1.0, n_inputs=1 + seed % 2))
        scored, _ = fitted(data, 1.0)
        held = fit_magnitudes(with_unit_root(data.problem(ORDER)), (0,), scored.z)
        exceeded += data.n_rows * (held.log_det - scored.log_det) > UNIT_ROOT
    assert exceeded <= n * 0.05 + 3.0 * np.sqrt(n * 0.05 * 0.95)


@pytest.mark.slow
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
    scored = penalty.scored(fit)
    one = magnitudes_of_fit(data, scored, penalty)
    several = averaged_magnitudes(data, [scored], penalty, np.ones(1))
    assert several.value == pytest.approx(one.value)
    assert several.variance == pytest.approx(one.variance)


def without_fault(data: RegressionData, *, evidence: float = 0.0) -> tuple[Fit, Penalty]:
    """Return the fit with no entry declared, and a penalty that counts a quarter of the rows."""
    fit = fit_magnitudes(data.problem(ORDER), (), np.zeros(0))
    n = data.n_rows
    penalty = Penalty(n_rows=n, n_effective=0.25 * n, n_candidates=3, evidence=evidence)
    return penalty.scored(fit), penalty


def test_half_of_the_squared_change_between_two_rates_is_variance():
    here, there = regression(record(0, "bias", 5.0, pole=0.2)), regression(record(0, "bias", 9.0, pole=0.2))
    scored, penalty = fitted(here, 5.0)
    one, phi = averaged_magnitudes(here, [scored], penalty, np.ones(1)), np.ones(1)
    fit = fit_magnitudes(there.problem(ORDER), (0,), np.array([5.0]) / there.magnitude_unit)
    other = averaged_magnitudes(there, [penalty.scored(fit)], penalty, phi)
    change = float(other.value[0] - one.value[0]) ** 2
    assert change > 10.0 * max(one.variance[0], other.variance[0])
    both = estimate_magnitudes(here, [scored], penalty, phi, there)
    assert both.variance[0] - one.variance[0] == pytest.approx(
        0.5 * (change - max(one.variance[0], other.variance[0])), rel=1e-3
    )
    assert both.value == one.value


@pytest.mark.parametrize(("spread", "phi"), [(1.0, 1.0), (1.0, 3.0), (1000.0, 1.0), (1000.0, 3.0)])
def test_the_minimal_detectable_magnitude_passes_both_tests_with_90_percent_power(spread: float, phi: float):
    """The statistic of a fault 1.28 standard deviations below it, errors correlated over four rows, is the one needed;
    the interval of one excludes zero where its variance holds more than sampling errors.
    """
    n, sampling = 240, 0.04
    penalty = Penalty(n_rows=n, n_effective=n / 4.0, n_candidates=5, evidence=4.6)
    estimates = MagnitudeEstimates(
        value=np.zeros(1),
        variance=np.array([spread * sampling]),
        sampling=np.array([sampling]),
        minimal_detectable=np.full(1, np.nan),
        covariance=np.zeros((0, 0)),
        degrees=50.0,
    )
    found = float(magnitudes._minimal_detectable(estimates, penalty, np.array([phi]))[0])
    below = found - 1.2815515655446004 * 2.0 * np.sqrt(sampling)
    statistic = n * np.log1p(below**2 / (n * sampling / phi))
    needed = 4.0 * phi * (penalty.per_parameter + penalty.per_atom)
    assert statistic_needed(penalty, np.array([phi]))[0] == pytest.approx(needed)
    reach = stats.t.ppf(0.975, 50.0) * np.sqrt(spread * sampling)
    assert statistic >= needed * (1.0 - 1e-9)
    assert below >= reach * (1.0 - 1e-9)
    assert statistic == pytest.approx(needed) or below == pytest.approx(reach)


@pytest.mark.parametrize("phi", [1.0, 2.0])
def test_a_fault_of_the_profiled_limit_reaches_its_statistic_in_the_mean_of_both_signs(phi: float):
    """The parabola at zero is made to promise too much."""
    data = regression(record(4, "bias", 0.0, pole=0.9))
    scored, penalty = without_fault(data)
    estimates = averaged_magnitudes(data, [scored], penalty, np.array([phi]), unit_root=False)
    promised = replace(estimates, minimal_detectable=0.3 * estimates.minimal_detectable)
    limit = profiled_limits(data, scored, promised, penalty, np.array([phi]))[0]
    assert promised.minimal_detectable[0] < limit < np.inf
    problem, without = data.problem(ORDER), scored.log_det
    reached = [
        data.n_rows
        * (
            fit_magnitudes(
                without_signal(problem, 0, sign * limit / float(data.magnitude_unit[0])), (), np.zeros(0)
            ).log_det
            - without
        )
        for sign in (1.0, -1.0)
    ]
    needed = np.sqrt(4.0 * phi * (penalty.per_parameter + penalty.per_atom)) + 2.0 * 1.2815515655446004 * np.sqrt(phi)
    assert np.sqrt(np.mean(reached)) == pytest.approx(needed, rel=0.02)


def test_where_no_multiple_would_be_declared_there_is_no_limit():
    data = regression(record(4, "drift", 0.0, pole=0.97))
    scored, penalty = without_fault(data, evidence=1e5)
    estimates = averaged_magnitudes(data, [scored], penalty, np.ones(1), unit_root=False)
    assert np.isfinite(estimates.minimal_detectable[0])
    assert profiled_limits(data, scored, estimates, penalty, np.ones(1))[0] == np.inf


def test_at_the_evidence_against_the_root_both_models_count_alike():
    """Twice the log likelihood ratio over the effective rows and the overdispersion is then the constant."""
    data = regression(record(2, "drift", 5.0, pole=0.9))
    scored, penalty = fitted(data, 5.0)
    held = fit_magnitudes(with_unit_root(data.problem(ORDER)), (0,), scored.z)
    value, own = single_magnitudes(with_unit_root(data.problem(ORDER)), held, 1)
    z, variance = scored.z.copy(), np.array([0.3])
    for rows in (data.n_rows, data.n_rows / 3.0):
        fewer = replace(penalty, n_effective=rows)
        phi = np.array([rows * (held.log_det - scored.log_det) / UNIT_ROOT])
        mean, total = magnitudes._with_unit_root(data, scored, z, variance, fewer, phi)
        assert mean == pytest.approx(0.5 * (z + value), rel=1e-9)
        assert total == pytest.approx(0.5 * (variance + own) + 0.25 * (z - value) ** 2 / phi, rel=1e-9)
        assert 0.25 * (z - value) ** 2 / phi > 1e-3 * total
