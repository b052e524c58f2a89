"""A scale error in a dictionary: a share of what the channel shows, found, told from a bias, and scored."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.audit import audit_dictionary, audit_on_log
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import Channel, frozen_array
from bfi_cli.kernels.variable_projection import fit_magnitudes
from bfi_cli.model import identify_faults
from bfi_cli.model.preprocessing.window import prepare_window, regression_of

N, ONSET_S = 600, 25.0
TIME_S = np.arange(N) / 10.0
SCALE = {"name": "scale", "shape": "scale", "onset_s": ONSET_S}
BIAS = {"name": "bias", "shape": "bias", "onset_s": ONSET_S}
SWEEP = """
record: [{model: citation}]
dictionary: {relative_to: window, atoms: [{name: scale, shape: scale, onset_s: 12}]}
noise: {tas: 0.02}
active: 1
magnitudes: [0.03, -0.05]
trials: 4
"""
CONFIG = merge(Config(), {"conditioning.rate_hz": "none", "model.orders": (2, 4)})


def flown(seed: int) -> FlightLog:
    """Return an airspeed that moves by twenty metres per second, so that a share of it is no constant."""
    rng = np.random.default_rng(seed)
    elevator, speed = 0.05 * np.sign(np.sin(0.4 * TIME_S)) + 0.01 * rng.standard_normal(N), np.zeros(N)
    for k in range(1, N):
        speed[k] = 0.95 * speed[k - 1] + 10.0 * elevator[k - 1] + 0.02 * rng.standard_normal()
    values = {"elevator": (elevator, "rad"), "tas": (60.0 + speed, "m/s")}
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=unit, source=name)
        for name, (one, unit) in values.items()
    }
    return FlightLog(path="made.h5", time_s=frozen_array(TIME_S), channels=channels, filters=())


def scaled(log: FlightLog, share: float) -> FlightLog:
    return inject(log, [Fault(shape="scale", channel="tas", magnitude=share, onset_s=ONSET_S, name="scale")])


def test_its_signal_is_the_reading_from_the_onset_on() -> None:
    log = flown(0)
    window = prepare_window(log, load_dictionary({"atoms": [SCALE]}), CONFIG)
    wanted = np.where(TIME_S >= ONSET_S, log.channel("tas").values, 0.0)
    np.testing.assert_allclose(window.native.theta_between(slice(None))[:, 0, 0], wanted, rtol=1e-12)


def test_through_a_recorder_its_signal_is_what_injection_adds() -> None:
    log = replace(flown(0), filters=(Filter(kind="gaussian", edge_hz=0.75, rate_hz=10.0),))
    window = prepare_window(log, load_dictionary({"atoms": [SCALE]}), CONFIG)
    added = scaled(log, 1.0).channel("tas").values - log.channel("tas").values
    np.testing.assert_allclose(window.native.theta_between(slice(None))[:, 0, 0], added, atol=1e-9)


@pytest.mark.parametrize("share", [0.03, -0.03])
def test_it_is_found_with_its_share_and_told_from_a_bias(share: float) -> None:
    result = identify_faults(scaled(flown(0), share), load_dictionary({"atoms": [SCALE, BIAS]}), CONFIG)
    (fault,) = result.faults
    assert (fault.name, fault.unit, fault.physical_unit) == ("scale", "", "1")
    # The share is of what the channel shows, which has the error in it.
    assert abs(fault.magnitude - share / (1.0 + share)) <= 4.0 * fault.sd
    assert fault.sd < 0.1 * abs(share)
    assert result.truth is not None
    assert result.truth.isolated


def test_a_bias_is_not_taken_for_it() -> None:
    log = inject(flown(4), [Fault(shape="bias", channel="tas", magnitude=2.0, onset_s=ONSET_S, name="bias")])
    result = identify_faults(log, load_dictionary({"atoms": [SCALE, BIAS]}), CONFIG)
    assert [fault.name for fault in result.faults] == ["bias"]


def test_without_it_none_is_declared() -> None:
    """Nor an output that is scaled down to nothing and lifted by a bias, whose errors would be the smallest."""
    for seed in range(10, 12):
        result = identify_faults(flown(seed), load_dictionary({"atoms": [SCALE, BIAS]}), CONFIG)
        assert not result.faults


def test_the_density_counts_how_much_the_output_was_scaled() -> None:
    regression = regression_of(prepare_window(flown(5), load_dictionary({"atoms": [SCALE]}), CONFIG), CONFIG)
    problem = regression.problem(2)
    rows = int(np.sum(regression.rows_s >= ONSET_S))
    for share in (0.5, -0.3):
        at = np.array([share / regression.magnitude_unit[0]])
        counted, plain = (
            fit_magnitudes(one, (0,), at, max_iterations=0).log_det for one in (problem, replace(problem, scaling={}))
        )
        np.testing.assert_allclose(counted - plain, -2.0 * rows / problem.n_rows * np.log(1.0 - share), rtol=1e-9)


@pytest.mark.slow
def test_a_sweep_adds_it_and_scores_it(tmp_path: Path, bfi: Callable[..., object]) -> None:
    (tmp_path / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    bfi("montecarlo", "--config", tmp_path / "sweep.yaml", "--out", tmp_path / "out")
    with (tmp_path / "out" / "trials.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 4
    for row in rows:
        assert row["error"] == ""
        assert row["isolated"] == "true"
        (share,) = json.loads(row["truth"]).values()
        assert json.loads(row["estimate"])["scale"] == pytest.approx(share / (1.0 + share), rel=0.05)


def test_without_a_log_its_audit_asks_for_one() -> None:
    audit = audit_dictionary(load_dictionary({"atoms": [SCALE, BIAS]}), Config())
    (scale,) = (one for one in audit.atoms if one.name == "scale")
    assert "is a share of what the log shows; give the log" in str(scale)
    on_log = audit_on_log(flown(6), load_dictionary({"atoms": [SCALE, BIAS]}), CONFIG)
    (scale,) = (one for one in on_log.atoms if one.name == "scale")
    assert "give the log" not in str(scale)
