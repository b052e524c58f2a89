"""A dictionary in stretches, as a long record has it, gives the answer of the same dictionary sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config, merge
from bfi_cli.flightlog import inject
from bfi_cli.model import identify_faults
from bfi_cli.model.preprocessing import signals
from bfi_cli.model.preprocessing.window import prepare_window

# A magnitude is the end of an iteration, whose tolerance is 1e-9 of its own standard deviation and more.
RELATIVE = 1e-9


def with_fault(log, thesis, name, magnitude, shift_s=0.0):
    atom = next(one for one in thesis.resolved(float(log.time_s[0])) if one.name == name)
    return inject(log, [replace(atom, magnitude=magnitude, onset_s=atom.onset_s + shift_s)])


def same_answer(one, other):
    assert one.decision == other.decision
    assert one.verdicts == other.verdicts
    assert [fault.fault for fault in one.faults] == [fault.fault for fault in other.faults]
    assert texts(one.notes) == texts(other.notes)
    assert one.model.order == other.model.order
    for ours, theirs in zip(one.candidates, other.candidates, strict=True):
        assert (ours.name, ours.state, ours.note) == (theirs.name, theirs.state, theirs.note)
        for key in ("magnitude", "sd", "minimal_detectable", "excluded_above"):
            a, b = getattr(ours, key), getattr(theirs, key)
            assert (a is None) == (b is None)
            if a is not None:
                # An estimate near zero is known to its standard deviation; of two outputs it is found by iteration,
                # which ends a few 1e-9 of it away.
                tolerance = 10.0 * RELATIVE
                np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * (theirs.sd or 0.0))
    for ours, theirs in zip(one.outputs, other.outputs, strict=True):
        scale = float(np.ptp(theirs.measured))
        for key in ("fault", "fault_sd", "prediction_error", "plain_residual", "corrected", "predicted"):
            np.testing.assert_allclose(getattr(ours, key), getattr(theirs, key), rtol=0, atol=RELATIVE * scale)


@pytest.mark.parametrize(
    ("name", "shift_s", "settings"),
    [
        ("bias_13.8", 0.0, {"model.order": 4}),
        pytest.param("bias_13.8", 0.0, {}, marks=pytest.mark.slow),
        pytest.param("bias_13.8", 0.4, {}, marks=pytest.mark.slow),
        pytest.param("bias_13.8", 0.0, {"conditioning.rate_hz": "none"}, marks=pytest.mark.slow),
        pytest.param("drift_7.93", -0.3, {"conditioning.rate_hz": 25.0}, marks=pytest.mark.slow),
        pytest.param("bias_13.8", 0.0, {"outputs": ("tas", "pitch_rate")}, marks=pytest.mark.slow),
        pytest.param("bias_13.8", 0.0, {"method": "arx-residual"}, marks=pytest.mark.slow),
        pytest.param("bias_13.8", 0.0, {"method": "risro"}, marks=pytest.mark.slow),
    ],
)
def test_stretches_give_the_answer_of_samples(flight, thesis, monkeypatch, name, shift_s, settings):
    log, config = with_fault(flight(3), thesis, name, 2.0, shift_s), merge(Config(), settings)
    whole = identify_faults(log, thesis, config)
    monkeypatch.setattr(signals, "PIECEWISE", 0)
    assert prepare_window(log, thesis, config).signals.theta.in_stretches
    same_answer(identify_faults(log, thesis, config), whole)
