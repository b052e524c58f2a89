"""Dryden gusts: stationarity, variance, spectrum; and how a wind enters a model."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from bfi_cli.aircraft import MODELS, Dryden, dryden_gusts, response, with_gusts
from bfi_cli.aircraft.simulate import DRYDEN_A, DRYDEN_C, DRYDEN_P
from bfi_cli.errors import ConfigError

CITATION = MODELS["citation"]
AIRSPEED, LENGTH = 100.0, 500.0
TIME_CONSTANT = LENGTH / AIRSPEED
FALSE_ALARM = 1e-6


def gusts(n: int, *, seed: int = 0, sigma: float = 1.5, rate_hz: float = 10.0) -> np.ndarray:
    dryden = Dryden(sigma_m_s=sigma, scale_length_m=LENGTH)
    return dryden_gusts(dryden, n, airspeed_m_s=AIRSPEED, rate_hz=rate_hz, rng=np.random.default_rng(seed))


def chi_square_bounds(freedom: int) -> tuple[float, float]:
    low, high = stats.chi2.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], freedom) / freedom
    return float(low), float(high)


def spectrum(angular_frequency: np.ndarray) -> np.ndarray:
    """Two-sided Dryden spectra of unit variance, along and across, of MIL-F-8785C."""
    x = (angular_frequency * TIME_CONSTANT) ** 2
    return TIME_CONSTANT * np.column_stack([2.0 / (1.0 + x), (1.0 + 3.0 * x) / (1.0 + x) ** 2])


def test_the_stated_covariance_solves_the_lyapunov_equation():
    drive = np.array([[np.sqrt(2.0), 0.0], [0.0, 0.0], [0.0, 1.0]])
    balance = DRYDEN_A @ DRYDEN_P + DRYDEN_P @ DRYDEN_A.T + drive @ drive.T
    np.testing.assert_allclose(balance, np.zeros((3, 3)), rtol=0, atol=1e-14)


@pytest.mark.parametrize("lag", [0.0, 0.01, 0.3, 1.0, 4.0])
def test_the_autocorrelation_is_drydens(lag: float):
    correlation = DRYDEN_C @ expm(DRYDEN_A * lag) @ DRYDEN_P @ DRYDEN_C.T
    np.testing.assert_allclose(correlation, np.diag([np.exp(-lag), np.exp(-lag) * (1 - lag / 2)]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("rate_hz", [0.5, 10.0, 1000.0])
def test_first_and_last_sample_have_the_stated_variance(rate_hz: float):
    trials = np.stack([gusts(12, seed=seed, rate_hz=rate_hz)[[0, -1]] for seed in range(400)])
    ratio = np.mean(trials**2, axis=0) / 1.5**2
    low, high = chi_square_bounds(400)
    assert (ratio > low).all()
    assert (ratio < high).all()


def test_the_periodogram_follows_the_spectrum_in_every_band():
    n, rate_hz = 20_000, 20.0
    tapered = gusts(n, sigma=1.0, rate_hz=rate_hz) * np.sqrt(8 / 3) * np.hanning(n)[:, None]
    frequency = 2.0 * np.pi * np.fft.rfftfreq(n, 1.0 / rate_hz)
    periodogram = np.abs(np.fft.rfft(tapered, axis=0)) ** 2 / (n * rate_hz)
    for start in (6, 60, 200, 600):  # 0.006 to 0.8 Hz; the Hann window halves the freedom of 2 per line
        band = slice(start, start + start // 2 * 2)
        ratio = np.mean(periodogram[band] / spectrum(frequency[band]), axis=0)
        low, high = chi_square_bounds(start // 2 * 2)
        assert (ratio > low).all()
        assert (ratio < high).all()


def test_the_two_gusts_are_uncorrelated_and_scale_with_the_intensity():
    one = np.stack([gusts(1, seed=seed)[0] for seed in range(400)])
    assert abs(stats.pearsonr(one[:, 0], one[:, 1]).pvalue) > FALSE_ALARM
    np.testing.assert_allclose(gusts(50, sigma=3.0), 2.0 * gusts(50, sigma=1.5), rtol=1e-12)
    assert not gusts(50, sigma=0.0).any()


@pytest.mark.parametrize("wind", [(7.0, 0.0), (0.0, 3.0), (-2.0, 1.0)])
def test_a_steady_wind_leaves_the_aircraft_trimmed_in_the_air(wind: tuple[float, float]):
    """Galilei: moving with the air is an equilibrium in which no air-data sensor shows anything."""
    model = with_gusts(CITATION)
    x0 = np.array([-wind[0], -wind[1] / CITATION.airspeed_m_s, 0.0, 0.0])
    u = np.tile([0.0, *wind], (100, 1))
    assert np.abs(response(model, u, rate_hz=100.0, x0=x0)).max() < 1e-12


def test_a_headwind_gust_is_first_read_in_full_and_then_lost():
    model = with_gusts(CITATION)
    u = np.tile([0.0, 5.0, 0.0], (30_000, 1))
    tas = response(model, u, rate_hz=10.0)[:, 0]
    assert tas[0] == pytest.approx(5.0, rel=1e-12)
    assert abs(tas[-1]) < 1e-6


def test_an_updraught_raises_the_angle_of_attack_by_its_ratio_to_the_airspeed():
    model = with_gusts(MODELS["citation-short-period"])
    aoa, pitch_rate = response(model, np.array([[0.0, 0.0, 2.0]]), rate_hz=100.0)[0]
    assert aoa == pytest.approx(0.02, rel=1e-12)
    assert pitch_rate == 0.0


def test_a_model_without_airspeed_does_not_feel_a_headwind():
    model = with_gusts(MODELS["citation-short-period"])
    assert not model.B[:, model.inputs.index("headwind_gust")].any()
    assert model.B[:, model.inputs.index("updraught")].all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sigma_m_s": -1.0}, "turbulence: the intensity must be 0 or more, got -1 m/s; change it"),
        ({"sigma_m_s": np.nan}, "turbulence: the intensity must be 0 or more, got nan m/s; change it"),
        (
            {"sigma_m_s": 1.0, "scale_length_m": 0.0},
            "turbulence: the scale length must be positive, got 0 m; change it",
        ),
    ],
)
def test_an_impossible_turbulence_is_refused(settings: dict[str, float], message: str):
    with pytest.raises(ConfigError, match=message):
        Dryden(**settings)
