"""Modes, discretisation and response of the linear models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from bfi_cli.aircraft import MODELS, Discretisation, LinearModel, discretise, manoeuvre, response, time_axis

CITATION = MODELS["citation"]
SHORT_PERIOD = MODELS["citation-short-period"]
RATE = 100.0
both_rules = pytest.mark.parametrize("rule", ["zoh", "bilinear"])
LINEAR = {name: model for name, model in MODELS.items() if isinstance(model, LinearModel)}
all_models = pytest.mark.parametrize("model", LINEAR.values(), ids=list(LINEAR))


def oscillations(model: LinearModel) -> np.ndarray:
    """Natural frequency (rad/s) and damping ratio of every pair of complex poles, slowest first."""
    poles = np.linalg.eigvals(model.A)
    poles = poles[poles.imag > 0]
    frequency = np.abs(poles)
    return np.column_stack([frequency, -poles.real / frequency])[np.argsort(frequency)]


def excitation(seed: int, model: LinearModel = CITATION, n: int = 200) -> np.ndarray:
    return 0.05 * np.random.default_rng(seed).standard_normal((n, len(model.inputs)))


def test_short_period_model_has_the_frequency_and_damping_of_its_characteristic_polynomial():
    [[frequency, damping]] = oscillations(SHORT_PERIOD)
    assert frequency**2 == pytest.approx(1.1443 * 1.6400 + 0.9777 * 7.1848, rel=1e-12)
    assert 2 * damping * frequency == pytest.approx(1.1443 + 1.6400, rel=1e-12)


def test_citation_has_a_phugoid_and_a_short_period():
    phugoid, short_period = oscillations(CITATION)
    assert short_period == pytest.approx(oscillations(SHORT_PERIOD)[0], rel=0.01)
    assert phugoid[0] == pytest.approx(np.sqrt(2.0) * 9.81 / CITATION.airspeed_m_s, rel=0.05)  # Lanchester
    assert 0.0 < phugoid[1] < 0.1


@all_models
def test_every_model_is_stable(model: LinearModel):
    assert (
        np.linalg.eigvals(model.A).real.max() < 1e-4
    )  # the altitude of the 747 drifts apart, a factor e in nine hours


def test_bilinear_rule_reproduces_the_discrete_model_of_the_thesis():
    """Eq. 5-5, states in the order pitch rate, airspeed, angle of attack, pitch."""
    A, B, _, _ = discretise(CITATION, rate_hz=RATE, rule="bilinear")
    order = [3, 0, 1, 2]
    printed = [
        [0.9834, 0.0000, -0.0708, -0.0000],
        [-0.0023, 0.9998, 0.0341, -0.0979],
        [0.0096, -0.0000, 0.9883, 0.0000],
        [0.0099, 0.0000, -0.0004, 1.0000],
    ]
    np.testing.assert_allclose(A[np.ix_(order, order)], printed, rtol=0, atol=0.5001e-4)
    np.testing.assert_allclose(B[order, 0], [-0.1136, -0.0044, -0.0017, -0.0006], rtol=0, atol=0.5001e-4)
    assert abs(discretise(CITATION, rate_hz=RATE, rule="zoh")[1][3, 0] + 0.1136) > 0.5001e-4


@all_models
def test_zero_order_hold_is_the_exponential_of_the_augmented_matrix(model: LinearModel):
    n_x, n_u = len(model.states), len(model.inputs)
    augmented = np.zeros((n_x + n_u, n_x + n_u))
    augmented[:n_x] = np.hstack([model.A, model.B])
    exact = expm(augmented / RATE)
    A, B, C, D = discretise(model, rate_hz=RATE)
    np.testing.assert_allclose(np.hstack([A, B]), exact[:n_x], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(C, model.C)
    np.testing.assert_array_equal(D, model.D)


def test_zero_order_hold_agrees_with_the_integrated_differential_equation():
    u = excitation(1, n=20)
    x = [np.zeros(4)]
    for held in u[:-1]:
        step = solve_ivp(
            lambda _, state, held=held: CITATION.A @ state + CITATION.B @ held,
            (0.0, 1.0 / RATE),
            x[-1],
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        )
        x.append(step.y[:, -1])
    np.testing.assert_allclose(response(CITATION, u, rate_hz=RATE), x, rtol=0, atol=1e-11)


def test_bilinear_rule_maps_the_frequency_axis_by_tustin():
    A, B, C, D = discretise(CITATION, rate_hz=RATE, rule="bilinear")
    z = np.exp(1j * 0.3)
    s = 2.0 * RATE * (z - 1.0) / (z + 1.0)
    discrete = C @ np.linalg.solve(z * np.eye(4) - A, B) + D
    continuous = CITATION.C @ np.linalg.solve(s * np.eye(4) - CITATION.A, CITATION.B)
    np.testing.assert_allclose(discrete, continuous, rtol=1e-9)


def test_only_the_bilinear_rule_feeds_the_input_through():
    pulse = np.zeros((3, 1))
    pulse[0] = 1.0
    assert not response(CITATION, pulse, rate_hz=RATE, rule="zoh")[0].any()
    assert response(CITATION, pulse, rate_hz=RATE, rule="bilinear")[0].all()


def test_the_rules_agree_to_second_order_in_the_step():
    def gap(rate_hz: float) -> float:
        u = 0.03 * np.sin(2.0 * np.pi * 0.2 * time_axis(duration_s=10.0, rate_hz=rate_hz))[:, None]
        middle = 0.5 * (u + np.vstack([u[1:], u[-1:]]))
        difference = response(CITATION, middle, rate_hz=rate_hz) - response(
            CITATION, u, rate_hz=rate_hz, rule="bilinear"
        )
        return float(np.abs(difference).max())

    assert gap(50.0) / gap(100.0) == pytest.approx(4.0, rel=0.3)


@both_rules
@all_models
def test_responses_superpose(model: LinearModel, rule: Discretisation):
    one, other = excitation(2, model), excitation(3, model)
    together = response(model, 2.0 * one - 3.0 * other, rate_hz=RATE, rule=rule)
    parts = 2.0 * response(model, one, rate_hz=RATE, rule=rule) - 3.0 * response(model, other, rate_hz=RATE, rule=rule)
    np.testing.assert_allclose(together, parts, rtol=0, atol=1e-12 * np.abs(together).max())


@both_rules
def test_a_later_input_gives_the_same_response_later(rule: Discretisation):
    u = excitation(4)
    later = response(CITATION, np.vstack([np.zeros((30, 1)), u]), rate_hz=RATE, rule=rule)
    np.testing.assert_array_equal(later[30:], response(CITATION, u, rate_hz=RATE, rule=rule))
    assert not later[:30].any()


@both_rules
def test_a_constant_elevator_ends_in_the_steady_state(rule: Discretisation):
    u = np.full((30_000, 1), 0.01)
    y = response(CITATION, u, rate_hz=10.0, rule=rule)
    steady_gain = CITATION.D - CITATION.C @ np.linalg.solve(CITATION.A, CITATION.B)
    np.testing.assert_allclose(y[-1], 0.01 * steady_gain[:, 0], rtol=1e-8, atol=1e-11)
    assert steady_gain[CITATION.outputs.index("pitch_rate"), 0] == pytest.approx(0.0, abs=1e-12)


def test_the_state_stays_at_an_equilibrium_it_starts_from():
    u = np.full((50, 1), 0.01)
    x0 = -np.linalg.solve(CITATION.A, CITATION.B)[:, 0] * 0.01
    y = response(CITATION, u, rate_hz=RATE, x0=x0)
    np.testing.assert_allclose(y, np.tile(x0, (50, 1)), rtol=0, atol=1e-11)


def test_nose_down_elevator_pitches_the_nose_down_and_gains_speed():
    time_s = time_axis(duration_s=3.0)
    u = manoeuvre("doublet", time_s, start_s=0.0, step_s=10.0)[:, None]
    tas, aoa, pitch, pitch_rate = response(CITATION, u, rate_hz=RATE)[-1]
    assert tas > 0 > max(aoa, pitch, pitch_rate)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, np.nan, np.inf])
def test_a_rate_must_be_positive(rate_hz: float):
    with pytest.raises(ValueError, match=r"the rate must be positive, got .* Hz"):
        discretise(CITATION, rate_hz=rate_hz)


def test_the_input_must_have_a_column_per_input():
    with pytest.raises(ValueError, match=r"citation: u has shape \(5, 2\), expected \(n_samples, 1\)"):
        response(CITATION, np.zeros((5, 2)), rate_hz=RATE)


def test_matrices_must_fit_the_names():
    with pytest.raises(ValueError, match=r"citation: B has shape \(4, 1\), the names ask for \(4, 2\)"):
        replace(CITATION, inputs=("elevator", "throttle"))


@all_models
def test_models_are_read_only_and_every_name_has_a_unit(model: LinearModel):
    assert not model.A.flags.writeable
    assert set(model.units) == {*model.states, *model.inputs, *model.outputs}
    assert set(model.trim) <= set(model.units)
