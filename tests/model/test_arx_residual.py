"""The plain residual test as a method: steps at their sample, nothing of a slow drift, alarms without an entry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, read_log
from bfi_cli.model import identify_faults

CLEAN = Path(__file__).parents[2] / "data" / "citation_clean.h5"
CONFIG = merge(Config(), {"method": "arx-residual", "conditioning.rate_hz": 10.0, "model.order": 6})


def identified(fault: Fault, *atoms: dict[str, object]):
    document = {"relative_to": "log", "atoms": list(atoms)}
    return identify_faults(inject(read_log(CLEAN), [fault]), load_dictionary(document), CONFIG)


def test_a_step_is_named_by_its_onset():
    bias = {"name": "bias", "shape": "bias", "onset_s": 13.8}
    late = {"name": "late", "shape": "bias", "onset_s": 20.0}
    result = identified(Fault(shape="bias", magnitude=4.0, onset_s=13.8), bias, late)
    assert (result.decision, [fault.name for fault in result.faults]) == ("fault", ["bias"])
    assert result.faults[0].magnitude == pytest.approx(4.0, rel=0.05)


def test_a_slow_drift_is_never_seen():
    drift = {"name": "drift", "shape": "drift", "onset_s": 12.0}
    result = identified(Fault(shape="drift", magnitude=0.05, onset_s=12.0), drift)
    assert (result.faults, result.decision) == ((), "inconclusive")


def test_an_alarm_where_no_entry_begins_is_a_fault_without_a_name():
    late = {"name": "late", "shape": "bias", "onset_s": 22.0}
    result = identified(Fault(shape="bias", magnitude=4.0, onset_s=13.8), late)
    assert (result.decision, result.faults) == ("fault", ())
    assert any("exceeds five standard deviations" in note for note in texts(result.notes))
    assert np.isfinite(result.candidates[0].magnitude)
