"""Dynamic inversion of the F-16, and the observer of its rates: exact where the model is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.aircraft.f16 import STATES, Body, Flights, Inversion, Observation, derivatives, observe
from bfi_cli.aircraft.f16.airframe import SURFACE_LIMITS
from bfi_cli.aircraft.f16.closed_loop import inverted_kinematics
from bfi_cli.aircraft.f16.loads import conditions_at
from bfi_cli.aircraft.f16.motion import translation

N = 80
DEG = np.pi / 180.0
GAINS = np.array([[9.0], [6.0], [8.0]])


def states(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low = [110.0, 0.0, -0.1, -1.0, -0.8, -3.0, -0.3, -0.2, -0.1, 0.0, 0.0, 1e3, 10.0]
    high = [200.0, 0.5, 0.1, 1.0, 0.8, 3.0, 0.3, 0.2, 0.1, 0.0, 0.0, 5e3, 90.0]
    return rng.uniform(low, high, (N, len(STATES))).T


def commanded(x: np.ndarray, seed: int) -> np.ndarray:
    return x[[1, 2, 3]] + np.random.default_rng(seed).uniform(-0.03, 0.03, (3, N))


def test_the_rates_give_the_angles_the_wanted_change():
    x, wanted = states(0), np.random.default_rng(0).uniform(-0.5, 0.5, (3, N))
    x[6:9] = inverted_kinematics(x, wanted)
    u = np.zeros((6, N))
    at = conditions_at(x, Body())
    of_forces = translation(x, at.accelerations(at.coefficients(x[6:9], u), at.thrust_force(u)))
    change = derivatives(x, u, Body())
    np.testing.assert_allclose(change[1:3] - of_forces[1:], wanted[:2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(change[3], wanted[2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("cg", [0.35, 0.30])
def test_within_the_stops_the_inner_loop_is_a_first_order_lag(cg: float):
    """d(p, q, r)/dt = k (commanded - measured) on the nominal aircraft, eq. 5 and 6."""
    body = Body(cg=cg)
    inversion = Inversion(body=body, rate_limits=(1e-9, 1e-9, 1e-9))
    x = states(1)
    at = conditions_at(x, body)
    u = inversion.controls(x, x[6:9], commanded(x, 1), throttle=0.5, at=at)
    free = (np.abs(u[:3]) < np.array(SURFACE_LIMITS)[:, None] - 1e-9).all(axis=0)
    assert np.count_nonzero(free) > N // 4
    np.testing.assert_allclose(u[4:, free], 0.0, rtol=0, atol=1e-12)
    change = derivatives(x, u, body)[6:9]
    np.testing.assert_allclose(change[:, free], -10.0 * x[6:9, free], rtol=0, atol=1e-7)


def test_the_nozzle_gives_the_pitch_that_the_elevator_cannot():
    x = states(2)
    x[6:9] *= np.array([[0.0], [6.0], [0.0]])
    x[12] = 90.0
    body = Body()
    missing = []
    for limit in (0.0, 0.26, 1.5):
        inversion = Inversion(body=body, nozzle_limit=limit, rate_limits=(1e-9, 1e-9, 1e-9))
        u = inversion.controls(x, x[6:9], commanded(x, 2), throttle=0.9, at=conditions_at(x, body))
        assert np.abs(u[4:]).max() <= limit + 1e-12
        missing.append(np.abs(derivatives(x, u, body)[7] + 10.0 * x[7]))
    without, some, plenty = missing
    assert without.max() > 0.1
    assert (some <= without + 1e-7).all()
    assert some.sum() < without.sum()
    assert (plenty <= some + 1e-7).all()
    reached = (without > 1e-3) & (plenty < 1e-7)
    assert np.count_nonzero(reached) > 0


def command(aoa_deg: float, roll_deg: float) -> object:
    def at(t: float) -> np.ndarray:
        return DEG * np.array([[aoa_deg], [0.0], [roll_deg * min(t, 1.0)]])

    return at


def fly(noise: np.ndarray | float = 0.0, fault_deg_s: float = 0.0, **settings: object) -> Flights:
    given = {"command": command(9.0, 20.0), "observer_gain": GAINS, "duration_s": 3.0, "step_s": 0.1}
    setting = Observation(**{**given, **settings})
    samples = round(setting.duration_s / setting.record_s)
    bias = DEG * fault_deg_s * np.array([[1.0], [0.0], [0.0]])
    return observe(
        setting,
        variation=np.zeros((3, 1)),
        noise=np.zeros((samples, 3, 1)) + noise,
        fault=lambda t: bias * (t > 2.0 - 1e-9),
    )


def test_the_closed_loop_follows_its_commands():
    x = fly(duration_s=5.0).states[-1, :, 0]
    assert x[1] / DEG == pytest.approx(9.0, abs=0.05)
    assert x[2] / DEG == pytest.approx(0.0, abs=0.05)
    assert x[3] / DEG == pytest.approx(20.0, abs=0.05)


def test_roll_follows_as_two_loops_of_gain_10_and_2():
    """From wings level with aoa small: the ramp's answer of 20 / (s^2 + 10 s + 20), but for the kinematic coupling."""
    flown = fly(command=lambda t: DEG * np.array([[5.72], [0.0], [5.0]]), duration_s=3.0)
    t = flown.time_s
    slow, fast = -5.0 + np.sqrt(5.0), -5.0 - np.sqrt(5.0)
    step = 1.0 + (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (slow - fast)
    np.testing.assert_allclose(flown.states[:, 3, 0] / DEG, 5.0 * step, rtol=0, atol=0.1)


@pytest.mark.parametrize("from_measured", [True, False])
def test_an_observer_that_knows_everything_has_no_residual(from_measured: bool):
    flown = fly(from_measured=from_measured)
    assert np.abs(flown.states[:, 6:9]).max() > 0.05
    assert np.abs(flown.residual).max() < 1e-13


def test_a_fault_appears_at_its_onset_in_full():
    flown = fly(fault_deg_s=2.0)
    before, at_onset = flown.residual[:20, 0, 0] / DEG, flown.residual[20, 0, 0] / DEG
    assert np.abs(before).max() < 1e-11
    assert at_onset == pytest.approx(2.0, rel=1e-9)


def test_the_residual_of_noise_begins_with_the_noise():
    noise = 1e-3 * np.random.default_rng(0).standard_normal((30, 3, 1))
    flown = fly(noise=noise)
    np.testing.assert_allclose(flown.residual[0], noise[0], rtol=1e-12)


def test_flights_side_by_side_are_those_alone():
    rng = np.random.default_rng(1)
    noise, variation = 1e-3 * rng.standard_normal((20, 3, 3)), rng.uniform(-0.2, 0.2, (3, 3))
    setting = Observation(command=command(9.0, 20.0), observer_gain=GAINS, duration_s=2.0, step_s=0.1)
    bias = DEG * np.eye(3)
    together = observe(setting, variation=variation, noise=noise, fault=lambda t: bias)
    for i in range(3):
        alone = observe(setting, variation=variation[:, [i]], noise=noise[:, :, [i]], fault=lambda t, i=i: bias[:, [i]])
        np.testing.assert_allclose(together.residual[:, :, [i]], alone.residual, rtol=0, atol=1e-12)


def test_halving_the_step_takes_the_error_to_an_eighth_or_less():
    coarse, middle, fine = (fly(fault_deg_s=2.0, step_s=step).residual for step in (0.1, 0.05, 0.025))
    assert np.abs(middle - fine).max() < np.abs(coarse - middle).max() / 8.0
    assert np.abs(middle - fine).max() < 1e-3 * DEG


def test_the_progress_is_told():
    told: list[tuple[int, int]] = []
    setting = Observation(command=command(5.0, 0.0), observer_gain=GAINS, duration_s=0.5, step_s=0.1)
    zero = np.zeros((3, 1))
    observe(setting, variation=zero, noise=np.zeros((5, 3, 1)), fault=lambda t: zero, report=lambda *n: told.append(n))
    assert told == [(k, 5) for k in range(1, 6)]


@pytest.mark.slow
def test_a_larger_gain_makes_a_smaller_residual_of_a_wrong_model():
    setting = Observation(command=command(9.0, 20.0), observer_gain=GAINS, duration_s=3.0, step_s=0.05)
    wrong, zero = np.array([[0.1], [0.25], [0.2]]), np.zeros((3, 1))
    sizes = [
        np.std(
            observe(
                replace(setting, observer_gain=k * GAINS),
                variation=wrong,
                noise=np.zeros((30, 3, 1)),
                fault=lambda t: zero,
            ).residual[:, 1]
        )
        for k in (1.0, 2.0, 4.0)
    ]
    assert sizes[0] > sizes[1] > sizes[2] > 0.0
