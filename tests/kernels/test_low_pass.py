"""Responses of recorders: unit gain, half gain at the edge, and the filters of scipy they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from bfi_cli.kernels.low_pass import IDENTITY, RECORDERS, decimated, low_pass

RATE = 10.0


def gain(response, f_hz: float) -> float:
    k = np.arange(len(response.taps)) - response.before
    return abs(np.sum(response.taps * np.exp(-2j * np.pi * f_hz * k / RATE)))


@pytest.mark.parametrize("kind", [*RECORDERS, "sinc"])
@pytest.mark.parametrize("edge_hz", [0.4, 1.0, 2.0])
def test_gain_is_one_at_rest_and_a_half_at_the_edge(kind, edge_hz):
    response = low_pass(kind, edge_hz, RATE)
    assert gain(response, 0.0) == pytest.approx(1.0, rel=1e-12)
    # The bilinear transform and the window move an edge near Nyquist by a few per cent.
    assert gain(response, edge_hz) == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize("kind", ["gaussian", "fir", "butterworth", "sinc"])
def test_zero_phase_responses_are_symmetric(kind):
    response = low_pass(kind, 0.8, RATE)
    np.testing.assert_allclose(response.taps, response.taps[::-1], atol=1e-5)
    assert response.before == response.after


def test_a_causal_response_begins_with_its_input():
    assert low_pass("causal", 1.0, RATE).before == 0


def test_a_step_is_that_of_scipy():
    x = np.repeat([0.0, 1.0], 200)
    sos = signal.butter(4, 1.3, fs=RATE, output="sos")
    response = low_pass("butterworth", 1.3, RATE)
    filtered = response.filtered(x)
    expected = signal.sosfiltfilt(sos, x)[response.after : len(x) - response.before]
    np.testing.assert_allclose(filtered, expected, atol=1e-4)


def test_an_edge_near_nyquist_changes_nothing():
    assert low_pass("gaussian", 0.46 * RATE, RATE).changes_nothing


def test_one_after_the_other_is_the_convolution():
    first, second = low_pass("gaussian", 0.7, RATE), low_pass("causal", 1.5, RATE)
    x = np.random.default_rng(0).standard_normal((300, 2))
    both = first.then(second).filtered(x)
    np.testing.assert_allclose(both, second.filtered(first.filtered(x)), atol=1e-12)
    np.testing.assert_allclose(IDENTITY.then(first).taps, first.taps, rtol=0, atol=0)


@pytest.mark.parametrize("kind", ["gaussian", "causal"])
def test_a_decimated_response_makes_the_same_step(kind):
    fine, factor = low_pass(kind, 0.7, 100.0), 10
    coarse = decimated(fine, factor)
    x = np.repeat([0.0, 1.0], 1000)
    of_fine = np.interp(
        np.arange(60, 140) * factor, np.arange(len(x))[fine.after : len(x) - fine.before], fine.filtered(x)
    )
    of_coarse = coarse.filtered(x[::factor])[60 - coarse.after :][:80]
    np.testing.assert_allclose(of_coarse, of_fine, atol=1e-4)
