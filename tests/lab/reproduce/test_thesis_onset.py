"""Figures 5-14 to 5-16 of the thesis: the start of a bias and of a drift, and the wrong shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bars import FULL

from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, read_log, resample
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.record import thesis_record
from bfi_cli.lab.reproduce.thesis_onset import thesis_5_14, thesis_5_15, thesis_5_16
from bfi_cli.model.onset import find_onset
from bfi_cli.report.content import ReportContent

pytestmark = pytest.mark.slow

QUICK = Settings(quick=True)
EXACT, NOISY, STATISTIC = 1, 2, 3  # panels of a page with two records
READINGS = (
    "published, M = 1",
    "published, M = 2",
    "published, no stage",
    "listing",
    "ours, no stage",
    "ours, with stage",
)
IMPOSED = "ours, no stage"


@pytest.fixture(scope="module")
def bias(made: Callable[[str], ReportContent]) -> ReportContent:
    return made("thesis-5-14")


@pytest.fixture(scope="module")
def drift(made: Callable[[str], ReportContent]) -> ReportContent:
    return made("thesis-5-15")


@pytest.fixture(scope="module")
def wrong(made: Callable[[str], ReportContent]) -> ReportContent:
    return made("thesis-5-16")


def curve(content: ReportContent, panel: int, label: str) -> tuple[np.ndarray, np.ndarray]:
    found = next(one for one in content.drawings[0].panels[panel].curves if one.label == label)
    return found.x, found.y


def row(content: ReportContent, name: str) -> tuple[str, ...]:
    return next(cells[1:] for cells in content.tables[0].rows if cells[0] == name)


@pytest.mark.parametrize(("name", "start"), [("bias", 15.0), pytest.param("drift", 16.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("label", READINGS)
def test_without_noise_the_magnitude_of_every_reading_peaks_at_the_start(
    request: pytest.FixtureRequest, name: str, start: float, label: str
):
    starts, z = curve(request.getfixturevalue(name), EXACT, label)
    best = int(np.argmax(np.abs(z)))
    assert starts[best] == pytest.approx(start)
    assert z[best] == pytest.approx(5.0, abs=1e-4)
    assert np.abs(np.delete(z, best)).max() < 1.0


def test_our_statistic_peaks_there_too_above_its_threshold(bias: ReportContent, drift: ReportContent):
    for content, shape, start in ((bias, "bias", 15.0), (drift, "drift", 16.0)):
        starts, statistic = curve(content, STATISTIC, shape)
        thresholds = dict(content.drawings[0].panels[STATISTIC].levels)
        assert starts[np.argmax(statistic)] == pytest.approx(start, abs=0.1)
        assert statistic.max() > thresholds[f"threshold, {shape}"]
    assert row(bias, "scan over all starts, ours, no noise")[1].startswith("bias of 5 m/s from 15 s")
    assert row(drift, "scan over all starts, ours, no noise")[1].startswith("drift of 0.25 m/s^2 from 16 s")


def test_the_heading_follows_from_the_noisy_record_too(bias: ReportContent, drift: ReportContent):
    """The shipped threshold of a quick run is that of real flights: the weak drift in noise stays below it."""
    assert bias.heading == "Start found by the scan"
    assert drift.heading == "Start found by the scan without noise only"
    starts, z = curve(drift, NOISY, "published, M = 1")
    assert abs(starts[np.argmax(np.abs(z))] - 16.0) > 0.2


def test_a_log_of_ones_own_and_another_road_to_its_magnitudes():
    """The reproduction's own solves against `bfi start-time --method thesis`, at 20 Hz on a time axis that is moved."""
    log = resample(thesis_record(QUICK), 20.0)
    log = replace(log, time_s=frozen_array(np.round(log.time_s, 6) + 250.0), filters=())
    content = thesis_5_14(Settings(log=log, quick=True))
    starts, z = curve(content, EXACT, IMPOSED)
    onset_s = float(log.time_s[0]) + 15.0
    assert starts[np.argmax(np.abs(z))] == pytest.approx(onset_s)
    assert row(content, "scan over all starts, ours, as recorded")[1].startswith(f"bias of 5 m/s from {onset_s:.5g} s")
    faulty = inject(log, [Fault(shape="bias", magnitude=5.0, onset_s=onset_s)])
    rules = {"method": "risro", "conditioning.rate_hz": "none", "model.order": 4, "start_time.shapes": ["bias"]}
    for label, sparsity in ((IMPOSED, "none"), ("ours, with stage", "exp-l0")):
        starts, z = curve(content, EXACT, label)
        scan = find_onset(faulty, merge(Config(), {**rules, "risro.sparsity": sparsity})).profiles[0]
        same = [int(np.argmin(np.abs(scan.onset_s - start))) for start in starts]
        np.testing.assert_allclose(z, scan.magnitude[same], rtol=1e-4, atol=1e-4)


def test_drifts_for_a_bias_are_erroneously_high_and_biases_for_a_drift_are_not(wrong: ReportContent):
    _, high = curve(wrong, 0, "published, M = 1")
    _, low = curve(wrong, 1, "published, M = 1")
    assert np.abs(high).max() > 1000.0
    assert np.median(np.abs(high)) > 1.0
    assert np.abs(low).max() < 0.01


def test_our_stage_finds_no_drift_in_a_bias_where_algorithm_3_finds_a_huge_one(wrong: ReportContent):
    peaks = {cells[:4]: cells[4] for cells in next(one for one in wrong.tables if one.name == "peaks").rows}
    for record in ("no noise", "noise 0.01 m/s"):
        assert peaks["bias", record, "drift", "ours, with stage"] == "0 at every start"
        assert abs(float(peaks["bias", record, "drift", "published, M = 1"].split()[0])) > 1000.0
    assert peaks["drift", "noise 0.01 m/s", "bias", "ours, with stage"] == "0 at every start"


def test_ours_does_not_declare_the_wrong_shape(wrong: ReportContent):
    assert wrong.heading == "The scan declares no wrong shape"
    for name in ("bias", "drift"):
        found = row(wrong, f"{name}, declared by the scan, ours, no noise")[1]
        assert found.startswith(f"{name} of")
        assert ";" not in found


@pytest.mark.skipif(not FULL, reason="only where BFI_FULL=1 is set")
def test_with_noise_only_ours_finds_the_drift():
    content = thesis_5_15(Settings())
    starts, z = curve(content, EXACT, IMPOSED)
    assert len(starts) == 251
    assert starts[np.argmax(np.abs(z))] == pytest.approx(16.0)
    for label in READINGS:
        starts, z = curve(content, NOISY, label)
        assert abs(starts[np.argmax(np.abs(z))] - 16.0) > 0.2
    found = row(content, "scan over all starts, ours, noise 0.01 m/s")[1]
    assert found.startswith("drift of 0.26 m/s^2 from 16 s")
    assert content.heading == "Start found by the scan"


def test_the_wrong_shape_with_noise(wrong: ReportContent):
    content = thesis_5_16(Settings()) if FULL else wrong
    assert content.heading == "The scan declares no wrong shape"
    noisy = replace(content, drawings=content.drawings[1:])
    assert np.abs(curve(noisy, 0, "published, M = 1")[1]).max() > 1000.0
    assert np.abs(curve(noisy, 1, IMPOSED)[1]).max() < 0.1


@pytest.mark.realdata
def test_a_nonlinear_simulation_shows_the_same(flights):
    settings = Settings(log=read_log(flights / "de3211_1.mat").window(19.0, 50.72), quick=True)
    bias, wrong = thesis_5_14(settings), thesis_5_16(settings)
    starts, z = curve(bias, EXACT, IMPOSED)
    assert starts[np.argmax(np.abs(z))] == pytest.approx(34.0)
    assert row(bias, "scan over all starts, ours, as recorded")[1].startswith("bias of 5 from 34 s")
    assert wrong.heading == "The scan declares no wrong shape"
    assert np.abs(curve(wrong, 0, IMPOSED)[1]).max() > 1000.0
