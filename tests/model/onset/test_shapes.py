"""The shapes of the scan against the faults of a log: they must be the same signals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.config import StartTime
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.kernels.low_pass import WHITE, Lowpass, decimate, lost_samples
from bfi_cli.model.onset.shapes import Sampling, ShapeHypothesis, fault_of, shape_hypotheses, waveform

N, RATE_HZ = 80, 10.0
CAUSAL = Lowpass(half_width=2, cutoff=1.2, kind="causal")
FORMS = (
    ShapeHypothesis(shape="bias", output=0),
    ShapeHypothesis(shape="drift", output=0),
    ShapeHypothesis(shape="sine", output=0, parameter=0.7),
    ShapeHypothesis(shape="lagged_bias", output=0, parameter=1.3),
    ShapeHypothesis(shape="ramp_hold", output=0, parameter=0.8),
)
shapes = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.shape)


def conditioned(fault: Fault, sampling: Sampling) -> np.ndarray:
    """Return the fault as the conditioning of a log would leave it, row 0 at 0 s."""
    factor = sampling.factor
    first, last = lost_samples(factor, sampling.lowpass) if factor > 1 else (0, 0)
    native = np.arange(-first, (N - 1) * factor + 1 + last) / (RATE_HZ * factor)
    return decimate(unit_signal(fault, native, window_start_s=0.0), factor, sampling.lowpass)


@shapes
@settings(max_examples=12)
@given(
    factor=st.integers(1, 12),
    onset=st.integers(10, 60),
    part=st.floats(0, 0.999),
    lowpass=st.sampled_from((WHITE, CAUSAL)),
)
def test_a_shape_is_the_conditioned_fault(form, factor, onset, part, lowpass):
    phase = -int(part * factor)
    sampling = Sampling(n_samples=N, rate_hz=RATE_HZ, factor=factor, lowpass=lowpass)
    wave = waveform(form, sampling, phase)
    start = onset - sampling.lead
    ours = np.zeros(N)
    ours[start:] = wave.unit * wave.samples[: N - start]
    fault = fault_of(form, "tas", magnitude=1.0, onset_s=(onset + phase / factor) / RATE_HZ)
    np.testing.assert_allclose(ours, conditioned(fault, sampling), atol=1e-9)


@shapes
@settings(max_examples=12)
@given(factor=st.integers(1, 12), onset=st.integers(10, 30), duration=st.integers(20, 30))
def test_a_shape_less_its_tail_is_the_conditioned_fault_that_ends(form, factor, onset, duration):
    sampling = Sampling(n_samples=N, rate_hz=RATE_HZ, factor=factor, lowpass=WHITE)
    wave, start = waveform(form, sampling), onset - sampling.lead
    ours = np.zeros(N)
    ours[start:] = wave.samples[: N - start]
    for weight, tail in zip(wave.weights[:, duration], wave.tails, strict=True):
        ours[start + duration :] -= weight * tail[: N - start - duration]
    until = (onset + duration) / RATE_HZ
    fault = fault_of(form, "tas", magnitude=1.0, onset_s=onset / RATE_HZ, offset_s=until)
    np.testing.assert_allclose(wave.unit * ours, conditioned(fault, sampling), atol=1e-9)


def test_every_shape_is_looked_for_on_every_output():
    found = shape_hypotheses(StartTime(shapes=("bias", "lagged_bias")), 2, 10.0)
    assert {(form.shape, form.output) for form in found} == {(s, i) for s in ("bias", "lagged_bias") for i in (0, 1)}
    assert {form.parameter for form in found if form.shape == "lagged_bias"} == {0.5, 1.0, 2.0}


def test_a_sine_without_frequency_is_no_signal():
    with pytest.raises(ValueError, match="needs its parameter"):
        waveform(
            ShapeHypothesis(shape="sine", output=0), Sampling(n_samples=N, rate_hz=RATE_HZ, factor=1, lowpass=WHITE)
        )
