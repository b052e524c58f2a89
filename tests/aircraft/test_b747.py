"""The Boeing 747 of the null-space paper: its numbers, its modes and what its outputs measure."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, response
from bfi_cli.aircraft.catalogue import B747, ELEVATORS, ENGINES

RATE_HZ = 100.0


def flown(n: int = 200):
    """Return (y, x, u): every input moved, the states by Euler's rule written out."""
    u = 0.05 * np.random.default_rng(0).standard_normal((n, 9))
    x = np.zeros((n, 5))
    for k in range(n - 1):
        x[k + 1] = x[k] + (B747.A @ x[k] + B747.B @ u[k]) / RATE_HZ
    return response(B747, u, rate_hz=RATE_HZ, rule="euler"), x, u


def test_it_is_in_the_catalogue():
    assert MODELS["b747"] is B747


def test_the_matrices_are_those_of_the_sources():
    """A: Bondarenko and Zybin (2020), A(1,5) as in the test data; B: Varga, FaultDetectionTools."""
    A = [
        [-0.4861, 0.000317, -0.5588, 0, -2.04e-6],
        [0, -0.0199, 3.0796, -9.8048, 8.98e-5],
        [1.0053, -0.0021, -0.5211, 0, 9.30e-6],
        [1, 0, 0, 0, 0],
        [0, 0, -92.6, 92.6, 0],
    ]
    B = [
        [-0.1455, -0.1455, -0.1494, -0.1494, -1.2860, 0.0013, 0.0035, 0.0035, 0.0013],
        [0, 0, 0, 0, -0.3122, 0.1999, 0.1999, 0.1999, 0.1999],
        [-0.0071, -0.0071, -0.0074, -0.0074, -0.0676, -0.0004, -0.0004, -0.0004, -0.0004],
    ]
    np.testing.assert_array_equal(B747.A, A)
    np.testing.assert_array_equal(B747.B[:3], B)
    np.testing.assert_array_equal(B747.B[3:], 0.0)


def test_the_modes_are_the_short_period_and_the_phugoid():
    poles = np.linalg.eigvals(B747.A)
    poles = poles[poles.imag > 0]
    phugoid, short_period = poles[np.argsort(np.abs(poles))]
    assert abs(short_period) == pytest.approx(0.905, abs=5e-4)
    assert -short_period.real / abs(short_period) == pytest.approx(0.564, abs=5e-4)
    assert abs(phugoid) == pytest.approx(0.129, abs=5e-4)
    assert -phugoid.real / abs(phugoid) == pytest.approx(0.023, abs=5e-4)


def test_the_outputs_are_states_and_the_rates_of_states():
    y, x, u = flown()
    named = dict(zip(B747.outputs, y.T, strict=True))
    for name in ("aoa", "pitch", "pitch_rate", "altitude"):
        np.testing.assert_allclose(named[name], x[:, B747.states.index(name)], atol=1e-14)
    for rate, state in (("tas_rate", "tas"), ("altitude_rate", "altitude")):
        slope = np.diff(x[:, B747.states.index(state)]) * RATE_HZ
        np.testing.assert_allclose(named[rate][:-1], slope, atol=1e-10)
    np.testing.assert_array_equal(np.flatnonzero(np.any(B747.D, axis=1)), [B747.outputs.index("tas_rate")])
    assert u.shape[1] == len(B747.inputs)


def test_climb_rate_angle_of_attack_and_pitch_are_one_too_many():
    named = dict(zip(B747.outputs, flown()[0].T, strict=True))
    np.testing.assert_allclose(named["altitude_rate"], 92.6 * (named["pitch"] - named["aoa"]), atol=1e-12)
    assert B747.airspeed_m_s == 92.6


def test_the_inputs_stand_in_the_paper_s_order_and_have_a_unit():
    assert B747.inputs == (*ELEVATORS, "stabiliser", *ENGINES)
    assert {B747.units[name] for name in B747.inputs} == {"rad"}
    assert set(B747.units) == {*B747.states, *B747.inputs, *B747.outputs}
