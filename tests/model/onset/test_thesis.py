"""The published search: right on the thesis's own examples, and honest about what it lacks."""

from __future__ import annotations

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config
from bfi_cli.errors import ConfigError
from bfi_cli.faults import Fault
from bfi_cli.model.onset import find_onset, onset_document
from bfi_cli.serialization import provenance

SETTINGS = {"method": "risro", "conditioning": {"rate_hz": 5.0}, "model": {"order": 2, "feedthrough": True}}


def config(**start_time: object) -> Config:
    return Config.model_validate({**SETTINGS, "start_time": start_time})


def test_the_peak_of_the_magnitude_is_the_step(flown):
    result = find_onset(flown(Fault(shape="bias", magnitude=2.0, onset_s=15.0)), config(shapes=("bias", "sine")))
    (found,) = result.faults
    assert found.fault.onset_s == pytest.approx(15.0, abs=0.21)
    assert found.magnitude == pytest.approx(2.0, rel=0.1)
    assert (result.method, result.p_value, result.threshold, result.calibration) == ("thesis", None, None, None)
    assert any("left out: sine" in note for note in texts(result.notes))
    document = onset_document(result, provenance(log_sha256=""))["faults"][0]
    assert document["onset_ci95"] is document["ci95"] is document["sd"] is None


@pytest.mark.slow
def test_it_heeds_the_sparsity_settings(flown):
    """The stage leaves the peak as it is and puts most other onsets to zero; without a fault it declares none."""
    log = flown(Fault(shape="bias", magnitude=2.0, onset_s=15.0))
    with_stage, without, published = (
        find_onset(log, Config.model_validate({**SETTINGS, "risro": rules, "start_time": {"shapes": ("bias",)}}))
        for rules in ({}, {"sparsity": "none"}, {"as_published": True})
    )
    (kept,), (whole,), (letter,) = with_stage.profiles, without.profiles, published.profiles
    best = int(np.argmax(np.abs(whole.magnitude)))
    assert kept.magnitude[best] == pytest.approx(whole.magnitude[best], rel=1e-6)
    assert np.all((kept.magnitude == 0.0) | np.isclose(kept.magnitude, whole.magnitude, rtol=1e-6))
    assert np.mean(kept.magnitude == 0.0) > 0.25
    assert not np.allclose(letter.magnitude, whole.magnitude)
    assert "no test of whether" in texts(without.notes)[0]
    assert "sets the magnitude to zero at" in texts(with_stage.notes)[0]
    silent = find_onset(flown(), config(shapes=("bias",)))
    assert (silent.decision, silent.faults) == ("inconclusive", ()), "a method without a test excludes nothing"


@pytest.mark.slow
def test_its_profile_is_that_of_the_scan(flown, settings):
    log = flown(Fault(shape="bias", magnitude=2.0, onset_s=15.0))
    scan = settings(2, shapes=("bias",))
    slower = scan.model_copy(update={"conditioning": scan.conditioning.model_copy(update={"rate_hz": 5.0})})
    ours, theirs = (find_onset(log, one).profiles[0] for one in (slower, config(shapes=("bias",))))
    best = int(ours.statistic.argmax())
    same = theirs.onset_s.tolist().index(ours.onset_s[best])
    assert theirs.magnitude[same] == pytest.approx(ours.magnitude[best], rel=1e-4)
    assert theirs.statistic[same] == pytest.approx(ours.statistic[best], rel=5e-3)


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"outputs": ("tas", "aoa")}, "works on one output, got 2"),
        ({"start_time": {"ends": True}}, "finds no ends"),
        ({"start_time": {"shapes": ("sine",)}}, "knows bias and drift only, got sine"),
    ],
)
def test_what_it_cannot_do(flown, changed: dict[str, object], complaint: str):
    with pytest.raises(ConfigError, match=complaint):
        find_onset(flown(), Config.model_validate({**SETTINGS, **changed}))
