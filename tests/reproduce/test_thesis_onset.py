"""Figures 5-14 to 5-16 of the thesis: the start of a bias and of a drift, and the wrong shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.exhibit import Exhibit
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, read_log, resample
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.onset import find_onset
from bfi_cli.reproduce import Settings
from bfi_cli.reproduce.record import thesis_record
from bfi_cli.reproduce.thesis_onset import thesis_5_14, thesis_5_15, thesis_5_16

QUICK = Settings(quick=True)
PUBLISHED, STATISTIC = 1, 2


@pytest.fixture(scope="module")
def bias() -> Exhibit:
    return thesis_5_14(QUICK)


@pytest.fixture(scope="module")
def drift() -> Exhibit:
    return thesis_5_15(QUICK)


@pytest.fixture(scope="module")
def wrong() -> Exhibit:
    return thesis_5_16(QUICK)


def curve(exhibit: Exhibit, panel: int, label: str) -> tuple[np.ndarray, np.ndarray]:
    found = next(one for one in exhibit.drawings[0].panels[panel].curves if one.label == label)
    return found.x, found.y


def row(exhibit: Exhibit, name: str) -> tuple[str, ...]:
    return next(cells[1:] for cells in exhibit.tables[0].rows if cells[0] == name)


@pytest.mark.parametrize(("name", "start"), [("bias", 15.0), ("drift", 16.0)])
def test_the_published_magnitude_peaks_at_the_start(request: pytest.FixtureRequest, name: str, start: float):
    starts, z = curve(request.getfixturevalue(name), PUBLISHED, "no noise")
    best = int(np.argmax(np.abs(z)))
    assert starts[best] == pytest.approx(start)
    assert z[best] == pytest.approx(5.0, abs=1e-4)
    assert np.abs(np.delete(z, best)).max() < 1.0


def test_our_statistic_peaks_there_too_above_its_threshold(bias: Exhibit, drift: Exhibit):
    for exhibit, shape, start in ((bias, "bias", 15.0), (drift, "drift", 16.0)):
        starts, statistic = curve(exhibit, STATISTIC, shape)
        thresholds = dict(exhibit.drawings[0].panels[STATISTIC].levels)
        assert starts[np.argmax(statistic)] == pytest.approx(start, abs=0.1)
        assert statistic.max() > thresholds[f"threshold, {shape}"]
        assert exhibit.heading == "Start found"
    assert row(bias, "scan over all starts, ours, no noise")[1].startswith("bias of 5 m/s from 15 s")
    assert row(drift, "scan over all starts, ours, no noise")[1].startswith("drift of 0.25 m/s^2 from 16 s")


def test_a_log_of_ones_own_and_another_road_to_its_magnitudes():
    """The reproduction's own solves against `bfi start-time --method thesis`, at 20 Hz on a time axis that is moved."""
    log = resample(thesis_record(QUICK), 20.0)
    log = replace(log, time_s=frozen_array(np.round(log.time_s, 6) + 250.0))
    exhibit = thesis_5_14(Settings(log=log, quick=True))
    starts, z = curve(exhibit, PUBLISHED, "as recorded")
    onset_s = float(log.time_s[0]) + 15.0
    assert starts[np.argmax(np.abs(z))] == pytest.approx(onset_s)
    assert row(exhibit, "scan over all starts, ours, as recorded")[1].startswith(f"bias of 5 m/s from {onset_s:.5g} s")
    faulty = inject(log, [Fault(shape="bias", magnitude=5.0, onset_s=onset_s)])
    rules = {"method": "risro", "conditioning.rate_hz": "none", "model.order": 4, "start_time.shapes": ["bias"]}
    scan = find_onset(faulty, merge(Config(), {**rules, "risro.sparsity": "none"})).profiles[0]
    same = [int(np.argmin(np.abs(scan.onset_s - start))) for start in starts]
    np.testing.assert_allclose(z, scan.magnitude[same], rtol=1e-4, atol=1e-4)


def test_drifts_for_a_bias_are_erroneously_high_and_biases_for_a_drift_are_not(wrong: Exhibit):
    _, high = curve(wrong, 0, "no noise")
    _, low = curve(wrong, 1, "no noise")
    assert np.abs(high).max() > 1000.0
    assert np.median(np.abs(high)) > 1.0
    assert np.abs(low).max() < 0.01


def test_ours_does_not_declare_the_wrong_shape(wrong: Exhibit):
    assert wrong.heading == "The wrong shape is not declared"
    for name in ("bias", "drift"):
        found = row(wrong, f"{name}, declared by ours, no noise")[1]
        assert found.startswith(f"{name} of")
        assert ";" not in found


@pytest.mark.slow
def test_with_noise_only_ours_finds_the_drift():
    exhibit = thesis_5_15(Settings())
    noisy, exact = "noise 0.01 m/s", "no noise"
    starts, z = curve(exhibit, PUBLISHED, exact)
    assert len(starts) == 251
    assert starts[np.argmax(np.abs(z))] == pytest.approx(16.0)
    starts, z = curve(exhibit, PUBLISHED, noisy)
    assert abs(starts[np.argmax(np.abs(z))] - 16.0) > 0.2
    assert row(exhibit, f"scan over all starts, ours, {noisy}")[1].startswith("drift of 0.26 m/s^2 from 16 s")
    assert exhibit.heading == "Start found"


@pytest.mark.slow
def test_the_wrong_shape_with_noise():
    exhibit = thesis_5_16(Settings())
    assert exhibit.heading == "The wrong shape is not declared"
    assert np.abs(curve(exhibit, 0, "noise 0.01 m/s")[1]).max() > 1000.0
    assert np.abs(curve(exhibit, 1, "noise 0.01 m/s")[1]).max() < 0.1


@pytest.mark.slow
@pytest.mark.realdata
def test_a_nonlinear_simulation_shows_the_same(flights):
    settings = Settings(log=read_log(flights / "de3211_1.mat").window(19.0, 50.72), quick=True)
    bias, wrong = thesis_5_14(settings), thesis_5_16(settings)
    starts, z = curve(bias, PUBLISHED, "as recorded")
    assert starts[np.argmax(np.abs(z))] == pytest.approx(34.0)
    assert row(bias, "scan over all starts, ours, as recorded")[1].startswith("bias of 5 from 34 s")
    assert wrong.heading == "The wrong shape is not declared"
    assert np.abs(curve(wrong, 0, "as recorded")[1]).max() > 1000.0
