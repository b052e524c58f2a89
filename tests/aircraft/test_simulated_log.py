"""Simulated logs: seeds, noise, independent streams, quantisation."""

from __future__ import annotations

import numpy as np
import pytest
from noted import texts
from scipy import stats

from bfi_cli.aircraft import MODELS, Dryden, manoeuvre, response, simulate, time_axis
from bfi_cli.errors import ConfigError
from bfi_cli.flightlog.record import FlightLog

CITATION = MODELS["citation"]
ELEVATOR = manoeuvre("3211", time_axis())
NOISE = {"tas": 0.05, "aoa": 0.001, "pitch": 0.002, "pitch_rate": 0.003}
TRIM = np.array([100.0, 0.0, 0.0, 0.0])
TURBULENCE = Dryden(sigma_m_s=1.0)
FALSE_ALARM = 1e-6


def fly(seed: int = 0, **settings: object) -> FlightLog:
    return simulate(CITATION, ELEVATOR, rng=np.random.default_rng(seed), **settings)


def noise(log: FlightLog, without: FlightLog) -> np.ndarray:
    return log.signals(CITATION.outputs) - without.signals(CITATION.outputs)


def test_without_disturbances_the_log_is_trim_plus_response():
    log = fly()
    expected = response(CITATION, ELEVATOR[:, None], rate_hz=100.0) + TRIM
    np.testing.assert_array_equal(log.signals(CITATION.outputs), expected)
    np.testing.assert_array_equal(log.channel("elevator").values, ELEVATOR)


def test_the_default_record_has_the_length_and_rate_of_the_thesis():
    log = fly()
    assert log.n_samples == 3172
    assert log.rate_hz == pytest.approx(100.0, rel=1e-9)
    np.testing.assert_allclose(log.time_s, np.arange(3172) * 0.01, rtol=1e-14)


def test_channels_carry_names_and_units_and_are_read_only():
    channels = fly().channels
    assert {name: channel.unit for name, channel in channels.items()} == {
        "elevator": "rad",
        "tas": "m/s",
        "aoa": "rad",
        "pitch": "rad",
        "pitch_rate": "rad/s",
    }
    assert not any(channel.values.flags.writeable for channel in channels.values())


def test_the_same_seed_gives_the_same_bits_and_another_seed_other_noise():
    settings = {"noise_sd": NOISE, "turbulence": TURBULENCE}
    one, same, other = fly(1, **settings), fly(1, **settings), fly(2, **settings)
    np.testing.assert_array_equal(one.signals(CITATION.outputs), same.signals(CITATION.outputs))
    assert (one.signals(CITATION.outputs) != other.signals(CITATION.outputs)).all()


def test_one_generator_gives_new_noise_at_every_call():
    rng = np.random.default_rng(0)
    first, second = (simulate(CITATION, ELEVATOR, rng=rng, noise_sd=NOISE) for _ in range(2))
    assert (first.channel("tas").values != second.channel("tas").values).any()


def test_noise_has_the_stated_variance_and_no_correlation_between_outputs():
    added = noise(fly(3, noise_sd=NOISE), fly())
    n = added.shape[0]
    ratio = np.sum(added**2, axis=0) / np.array([NOISE[name] ** 2 for name in CITATION.outputs])
    low, high = stats.chi2.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], n)
    assert (ratio > low).all()
    assert (ratio < high).all()
    correlation = np.corrcoef(added.T)[np.triu_indices(4, 1)]
    assert np.abs(correlation).max() < stats.norm.isf(FALSE_ALARM / 2) / np.sqrt(n)


def test_noise_is_white():
    added = noise(fly(4, noise_sd=NOISE), fly())
    n = added.shape[0]
    correlation = np.sum(added[1:] * added[:-1], axis=0) / np.sum(added**2, axis=0)
    assert np.abs(correlation).max() < stats.norm.isf(FALSE_ALARM / 2) / np.sqrt(n)


def test_turbulence_does_not_change_the_measurement_noise():
    calm = noise(fly(5, noise_sd=NOISE), fly(5))
    rough = noise(fly(5, noise_sd=NOISE, turbulence=TURBULENCE), fly(5, turbulence=TURBULENCE))
    np.testing.assert_allclose(rough, calm, rtol=0, atol=1e-12)


def test_noise_on_one_output_does_not_change_that_of_another():
    alone = fly(6, noise_sd={"pitch": 0.002}).channel("pitch").values
    np.testing.assert_array_equal(alone, fly(6, noise_sd=NOISE).channel("pitch").values)


def test_turbulence_superposes_on_the_manoeuvre():
    still = simulate(CITATION, np.zeros(3172), rng=np.random.default_rng(7), turbulence=TURBULENCE)
    moving = fly(7, turbulence=TURBULENCE)
    parts = still.signals(CITATION.outputs) + fly().signals(CITATION.outputs) - TRIM
    np.testing.assert_allclose(moving.signals(CITATION.outputs), parts, rtol=0, atol=1e-11)


def test_quantised_values_lie_on_the_grid_within_half_a_step():
    exact, coarse = fly(8, noise_sd=NOISE), fly(8, noise_sd=NOISE, quantum={"tas": 0.03})
    tas = coarse.channel("tas").values
    np.testing.assert_allclose(tas / 0.03, np.round(tas / 0.03), rtol=0, atol=1e-9)
    assert np.abs(tas - exact.channel("tas").values).max() <= 0.015 * (1 + 1e-9)
    assert np.unique(tas).size < exact.n_samples / 2
    np.testing.assert_array_equal(coarse.channel("aoa").values, exact.channel("aoa").values)


def test_zero_noise_and_zero_quantum_are_none():
    log = fly(9, noise_sd={"tas": 0.0}, quantum={"tas": 0.0})
    np.testing.assert_array_equal(log.channel("tas").values, fly().channel("tas").values)


def test_the_bilinear_rule_reaches_the_log():
    log = fly(discretisation="bilinear")
    expected = response(CITATION, ELEVATOR[:, None], rate_hz=100.0, rule="bilinear")[:, 0] + 100.0
    np.testing.assert_array_equal(log.channel("tas").values, expected)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"noise_sd": {"cas": 0.1}}, "citation: noise: no output 'cas'; the model has: tas, aoa, pitch, pitch_rate"),
        ({"noise_sd": {"tas": -0.1}}, "citation: noise of tas: must be 0 or more, got -0.1 m/s; give 0 for none"),
        ({"quantum": {"aoa": np.nan}}, "citation: quantum of aoa: must be 0 or more, got nan rad; give 0 for none"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, object], message: str):
    with pytest.raises(ConfigError, match=message):
        fly(**settings)


@pytest.mark.parametrize(
    "settings",
    [{"duration_s": 0.01}, {"rate_hz": 0.0}, {"duration_s": np.nan}, {"duration_s": np.inf}, {"rate_hz": 1e9}],
)
def test_a_record_has_a_sensible_length(settings: dict[str, float]):
    with pytest.raises(ConfigError, match=r"simulate: a log has 2 to 10,000,000 samples, got .*; change --duration or"):
        time_axis(**settings)


def test_leaving_the_linear_range_is_noted():
    """The thesis's listing flies 0.5 rad."""
    far = simulate(CITATION, manoeuvre("3211", time_axis(), amplitude_rad=0.5), rng=np.random.default_rng(0))
    assert texts(fly().notes) == ()
    assert texts(far.notes) == (
        "aoa moves up to 0.87 rad from its trim; a linear model holds for about 0.1 rad",
        "pitch moves up to 2.5 rad from its trim; a linear model holds for about 0.3 rad",
    )
