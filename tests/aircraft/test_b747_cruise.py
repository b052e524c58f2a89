"""The Boeing 747 of MF2D's example in SI is the printed model in ft, s and hundredths of a radian."""

from __future__ import annotations

import numpy as np
import pytest

from bfi_cli.aircraft import find_model, manoeuvre

# Bryson's numbers as they are printed: speeds along and down the body, pitch rate, pitch; elevator.
A = np.array([[-0.003, 0.039, 0, -0.322], [-0.065, -0.319, 7.74, 0], [0.0201, -0.101, -0.429, 0], [0, 0, 1, 0]])
B = np.array([[0.01], [-0.18], [-1.16], [0.0]])
C = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 7.74]])


@pytest.mark.parametrize("frequency_rad_s", [0.0, 0.05, 1.0, 20.0])
def test_its_frequency_response_is_the_printed_one(frequency_rad_s: float) -> None:
    model, s = find_model("b747-mf2d"), 1j * frequency_rad_s * np.eye(4)
    printed = C @ np.linalg.solve(s - A, B)
    ours = model.C @ np.linalg.solve(s - model.A, model.B)
    np.testing.assert_allclose(ours, printed * 0.3048 / 0.01, rtol=1e-12)


def test_a_steady_pitch_angle_climbs_with_the_sine_of_the_airspeed() -> None:
    model = find_model("b747-mf2d")
    assert model.C[1, model.states.index("pitch")] == pytest.approx(model.airspeed_m_s, rel=1e-12)


def test_its_input_is_two_pairs_of_opposite_3211() -> None:
    time_s = np.arange(0.05, 110.0, 0.1)
    pair = [(6, -1), (4, 1), (2, -1), (2, 1), (6, 0), (6, 1), (4, -1), (2, 1), (2, -1), (16, 0)]
    expected = np.concatenate([np.full(round(10 * length), sign) for length, sign in [(10, 0), *pair, *pair]])
    made = manoeuvre("3211-pairs", time_s, amplitude_rad=-0.005, start_s=10.0, step_s=2.0)
    np.testing.assert_array_equal(made, 0.005 * expected)
