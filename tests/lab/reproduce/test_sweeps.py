"""Monte Carlo figures: exact without noise, the same trials for every method, the record of a log as good as ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.kernels.risro_varx import SparseStage, published_updates
from bfi_cli.lab.montecarlo import load_sweep
from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.page import load
from bfi_cli.lab.reproduce.reconstruction import method_config
from bfi_cli.lab.reproduce.record import thesis_record
from bfi_cli.lab.reproduce.sweeps import Thin, swept
from bfi_cli.report.content import ReportContent

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[3] / "configs"
ONE = Thin(trials=1, active=(1, 7), noise=(0.0, 1e-4))


def rates(content: ReportContent) -> list[dict[str, str]]:
    table = next(table for table in content.tables if table.name == "rates")
    return [dict(zip(table.heads, row, strict=True)) for row in table.rows]


@pytest.mark.parametrize("name", ["thesis-5-3", "thesis-A-1", "isolation-noise"])
def test_without_noise_every_method_is_exact_on_the_linear_simulation(name: str, made: Callable[[str], ReportContent]):
    clean = [row for row in rates(made(name)) if row["noise m/s"] == "0"]
    assert clean
    for row in clean:
        assert row["isolated %"].startswith("100 "), row
        assert float(row["mean error"]) < 1e-8, row


def test_with_noise_the_published_rule_declares_what_is_not_there_and_never_misses(
    made: Callable[[str], ReportContent],
):
    """Table 5-2 has seven signals: with all of them active nothing is left to be declared wrongly."""
    for row in rates(made("thesis-A-1")):
        if row["noise m/s"] != "0" and row["active"] == "7":
            assert row["false alarms %"].startswith("0 "), row
    published = [row for row in rates(made("isolation-noise")) if row["method"] == "published, no stage"]
    noisy = [row for row in published if row["noise m/s"] == "0.05"]
    assert all(row["isolated %"].startswith("0 ") and row["false alarms %"].startswith("100 ") for row in noisy)


def test_all_methods_and_noises_meet_the_same_faults_and_seeds():
    sweep = load_sweep(Path(str(CONFIGS)).parent / "bfi_cli/lab/reproduce/thesis_sweep.yaml", trials=2)
    seeds: dict[tuple[int, int], set[int]] = {}
    for trial in sweep.trials():
        seeds.setdefault((trial.scenario.n_active, trial.number), set()).add(trial.seed)
    assert set(map(len, seeds.values())) == {1}


def test_a_log_of_the_user_goes_the_way_of_the_simulated_record():
    """Two roads to one number: the record flown by the sweep, and the same flight handed over as a log."""
    ours = swept("thesis", Settings(quick=True), compare=("rank_only",), quick=ONE)
    given = swept("thesis", Settings(quick=True, log=thesis_record(Settings())), compare=("rank_only",), quick=ONE)
    assert [ours.words(noise) for noise in ours.noises] == ["no noise", "noise 0.0001 m/s"]
    assert [given.words(noise) for noise in given.noises] == ["as recorded", "0.0001 m/s of noise added"]
    for one, other in zip(ours.cells, given.cells, strict=True):
        assert (one.method, one.noise, one.active) == (other.method, other.noise, other.active)
        assert one.summary.isolation_rate == other.summary.isolation_rate
        if one.noise:
            assert one.summary.magnitude_error == pytest.approx(other.summary.magnitude_error, rel=1e-4)


def test_the_listing_is_the_algorithm_with_a_stage_that_moves_nothing():
    settings = method_config("listing")
    stage = SparseStage(kind="exp-l0", p0=settings.risro.p0, r=settings.risro.r)
    z = np.array([5.0, 1e-9, -3.0, 0.0])
    moved, updates = published_updates(z, stage)
    np.testing.assert_array_equal(moved, z)
    assert updates == 0
    assert settings.method == "risro-as-published"


def test_one_update_of_the_stage_takes_six_hundredths_off_what_is_nearly_zero():
    """Alpha = 1, R = 10, P = I as in section 5-3 of the thesis, one of seven signals active."""
    z = np.array([5.0, *([1e-6] * 6)])
    moved, updates = published_updates(z, SparseStage(kind="exp-l0"))
    assert updates == 1
    np.testing.assert_allclose(moved[1:], -0.06, rtol=0, atol=0.005)


def test_the_methods_differ_in_what_they_say_and_in_nothing_else():
    common = {"conditioning": {"rate_hz": "none", "variance": "constant"}, "model": {"order": 4}}
    methods = load("methods")
    for name in ("rank_only", "sparse", "sparse_2", "listing"):
        assert {**methods[name], "risro": {}} == {**common, "method": "risro-as-published", "risro": {}}
    stage = {"sparsity": "exp-l0", "alpha": 1.0, "r": 10.0, "p0": 1.0}
    assert methods["sparse"]["risro"] == {**stage, "updates": 1}
    assert methods["sparse_2"]["risro"] == {**stage, "updates": 2}
    assert methods["imposed"] == {**common, "method": "risro", "risro": {"sparsity": "none"}}
    assert methods["likelihood"] == {**common, "method": "ml"}
    assert (methods["risro"], methods["default"]) == ({"method": "risro"}, {})


@pytest.mark.parametrize("name", ["thesis-5-3", "thesis-A-1", "isolation-noise"])
def test_a_page_says_how_many_trials_and_which_points_were_made(name: str, made: Callable[[str], ReportContent]):
    facts = dict(made(name).facts)
    assert facts["Trials"].startswith("1 per point, seed 0")
    assert facts["Points"].split("; ")[1].startswith("no noise")


def test_a_mean_stands_beside_its_median_and_no_line_goes_through_two_points(made: Callable[[str], ReportContent]):
    content = made("thesis-5-3")
    errors, isolation = content.drawings
    assert [panel.title for panel in errors.panels[:2]] == ["no noise, mean", "no noise, median and quartiles"]
    for panel in (*errors.panels, *isolation.panels):
        assert {one.style for one in panel.curves} == {"points"}
    for one in rates(content):  # one trial per point
        assert one["mean error"] == one["median error"]


def test_means_are_those_of_the_trials():
    found = swept("thesis", Settings(quick=True), compare=("rank_only",), quick=replace(ONE, trials=2))
    for cell in found.cells:
        ends = cell.summary.magnitude_error
        assert cell.mean_error == pytest.approx(0.5 * (2.0 * ends["p50"]), rel=1e-4)  # of two trials they agree


def test_progress_counts_every_trial():
    heard: list[tuple[int, int]] = []
    settings = Settings(quick=True, report=lambda done, total: heard.append((done, total)))
    swept("thesis", settings, compare=("rank_only",), quick=ONE)
    assert heard == [(done, 4) for done in range(5)]


def test_two_workers_give_the_same_numbers():
    thin = Thin(trials=2, active=(1, 4), noise=(1e-4,))
    one, two = (
        swept("thesis", Settings(quick=True, workers=n), compare=("sparse", "likelihood"), quick=thin) for n in (1, 2)
    )
    for here, there in zip(one.cells, two.cells, strict=True):
        assert here.summary.magnitude_error == there.summary.magnitude_error
        assert here.summary.isolation_rate == there.summary.isolation_rate
