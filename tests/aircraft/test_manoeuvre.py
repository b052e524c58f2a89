"""Manoeuvres as pure functions of time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.aircraft import MANOEUVRES, manoeuvre, time_axis
from bfi_cli.errors import ConfigError

TIME = time_axis()


def test_3211_is_the_sequence_of_the_thesis_listing():
    """20 zeros, then 300, 200, 100, 100 samples with changing sign, then zeros to sample 3172."""
    pattern = np.repeat([0.0, 1.0, -1.0, 1.0, -1.0, 0.0], [20, 300, 200, 100, 100, 2452])
    np.testing.assert_array_equal(manoeuvre("3211", TIME, amplitude_rad=0.5), 0.5 * pattern)


def test_doublet_is_one_step_each_way():
    pattern = np.repeat([0.0, 1.0, -1.0, 0.0], [100, 50, 50, 2972])
    np.testing.assert_array_equal(manoeuvre("doublet", TIME, amplitude_rad=1.0, start_s=1.0, step_s=0.5), pattern)


def test_none_leaves_the_control_alone():
    assert not manoeuvre("none", TIME).any()


@pytest.mark.parametrize("name", [name for name in MANOEUVRES if name != "none"])
def test_the_default_amplitude_is_reached_and_not_passed(name: str):
    assert np.abs(manoeuvre(name, TIME)).max() == pytest.approx(0.035, rel=1e-3)


@pytest.mark.parametrize("name", MANOEUVRES)
def test_nothing_moves_before_the_start(name: str):
    moving = manoeuvre(name, TIME, start_s=2.0)
    assert not moving[TIME < 2.0].any()


@given(
    name=st.sampled_from(sorted(MANOEUVRES)),
    start=st.integers(0, 1000),
    step=st.sampled_from([0.1, 0.3, 0.5, 1.0, 1.7]),
    scale=st.floats(-2.0, 2.0),
)
def test_manoeuvres_are_pure_shift_invariant_and_homogeneous(name: str, start: int, step: float, scale: float):
    reference = manoeuvre(name, TIME, start_s=0.0, step_s=step, amplitude_rad=1.0)
    shifted = manoeuvre(name, TIME + start / 100.0, start_s=start / 100.0, step_s=step, amplitude_rad=1.0)
    np.testing.assert_allclose(shifted, reference, rtol=0, atol=1e-9)
    backwards = manoeuvre(name, TIME[::-1], start_s=0.0, step_s=step, amplitude_rad=scale)
    np.testing.assert_allclose(backwards[::-1], scale * reference, rtol=0, atol=1e-15)


@pytest.mark.parametrize("rate_hz", [10.0, 25.0, 50.0, 200.0])
@pytest.mark.parametrize("name", MANOEUVRES)
def test_a_rate_samples_the_same_signal(name: str, rate_hz: float):
    fast, slow = time_axis(rate_hz=1000.0), time_axis(rate_hz=rate_hz)
    every = round(1000.0 / rate_hz)
    np.testing.assert_allclose(manoeuvre(name, slow), manoeuvre(name, fast)[::every][: slow.size], rtol=0, atol=1e-12)


def test_multisine_has_only_its_lines_all_equal():
    time_s = time_axis(duration_s=10.0)
    spectrum = np.abs(np.fft.rfft(manoeuvre("multisine", time_s, amplitude_rad=1.0, start_s=0.0)))
    lines = spectrum[1:17]
    np.testing.assert_allclose(lines, lines[0], rtol=1e-9)
    assert np.delete(spectrum, range(1, 17)).max() < 1e-9 * lines[0]


def test_schroeder_phases_keep_the_crest_factor_below_two():
    signal = manoeuvre("multisine", time_axis(duration_s=10.0), start_s=0.0)
    crest = np.abs(signal).max() / np.sqrt(np.mean(signal**2))
    assert crest < 2.0  # equal phases would give sqrt(2 x 16)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("3-2-1-1", {}, "manoeuvre: unknown, got '3-2-1-1'; did you mean '3211'?"),
        (
            "3211",
            {"step_s": 0.0},
            "manoeuvre: needs finite numbers and a positive step, got amplitude 0.035, start 0.2 s, step 0 s; "
            "change --amplitude, --start or --step",
        ),
        (
            "none",
            {"start_s": np.nan},
            "manoeuvre: needs finite numbers and a positive step, got amplitude 0.035, start nan s, step 1 s; "
            "change --amplitude, --start or --step",
        ),
    ],
)
def test_a_manoeuvre_that_cannot_be_flown_is_refused(name: str, settings: dict[str, float], message: str):
    with pytest.raises(ConfigError) as caught:
        manoeuvre(name, TIME, **settings)
    assert str(caught.value) == message
