"""Several methods on the same trials: scores at one rate of false alarms, rows, refusals, windows of a flight."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.errors import BfiError, LogError
from bfi_cli.lab.montecarlo import Sweep, load_sweep, run_sweep, run_trial, summarise
from bfi_cli.lab.montecarlo.flight import record_of
from bfi_cli.lab.montecarlo.summary import equal_rate

ROOT = Path(__file__).parents[3]
METHODS = (
    "record: {model: citation, rate_hz: 10, duration_s: 30, turbulence_m_s: 0.05}\ndictionary: dictionary.yaml\n"
    "noise: {tas: 0.02}\nactive: 0\ninject: [null, {shape: bias, magnitude: 2, onset_s: 12}]\ntrials: 4\n"
)


def test_the_threshold_is_exceeded_by_another_healthy_score_no_more_often_than_wanted():
    """Exchangeable scores: the chance is at most P, here of 39 for P = 1/20 exactly P; a binomial bound at 1e-4."""
    rng, exceeded = np.random.default_rng(0), 0
    for _ in range(2000):
        scores = rng.standard_cauchy(40)
        found = equal_rate([], [*scores[:39], *scores[39:], *np.zeros(38)], 0.05)
        assert found.threshold is not None
        exceeded += scores[39] > found.threshold
    assert 64 <= exceeded <= 140


@pytest.mark.parametrize("scale", [1.0, 7.0])
def test_units_of_a_score_do_not_matter(scale: float):
    healthy, faulty = np.arange(40.0), np.arange(20.0, 60.0)
    found = equal_rate(scale * faulty, scale * healthy, 0.1)
    assert found.threshold == scale * 18.0
    assert (found.alarms.count, found.alarms.of) == (20, 20)
    assert (found.detected.count, found.detected.of) == (40, 40)


def test_too_few_healthy_scores_tell_nothing():
    found = equal_rate([9.0], [1.0, 2.0, 3.0, 4.0], 0.05)
    assert found.threshold is None
    assert found.detected.rate is None


@pytest.mark.slow
def test_every_method_meets_the_same_trials_and_a_row_is_what_compare_says(sweep: Callable[..., Sweep]):
    made = sweep(f"{METHODS}compare: {{methods: [arx-residual, glr, dmae], false_alarm: 0.4}}\n")
    rows = {(row.scenario, row.trial): row for row, _ in run_sweep(made)}
    assert len({row.seed for row in rows.values() if row.trial == 0}) == 1
    for (scenario, _), row in rows.items():
        faulty = "inject=bias_2" in scenario
        assert row.truth == ({"bias": 2.0} if faulty else {})
        if "dmae" in scenario:
            assert "needs a linear model of the aircraft" in str(row.error)
        else:
            assert row.error is None
            assert row.decision == ("fault" if faulty else "no_fault")
            assert row.score is not None
            assert row.isolated is (not faulty or "arx-residual" in scenario)  # a change has no shape
    summary = {one.name: one for one in summarise(made, [(row, 0.1) for row in rows.values()]).scenarios}
    found = summary["inject=bias_2 compare=glr"].equal_rate
    assert found is not None
    assert (found.detected.count, found.detected.of) == (4, 4)
    assert summary["inject=bias_2 compare=dmae"].equal_rate is None
    assert summary["inject=bias_2 compare=dmae"].failed == 4


def test_a_program_of_another_stands_beside_the_methods(sweep: Callable[..., Sweep], tmp_path: Path):
    program = tmp_path / "mine"
    said = '{"decision": "fault", "suspects": [{"channel": "tas", "shape": "bias", "onset_s": 12}], "score": 3.5}'
    program.write_text(f"#!/bin/sh\necho '{said}'\n")
    program.chmod(0o755)
    made = sweep(f"{METHODS}compare: {{programs: {{mine: mine}}}}\n")
    rows = [run_trial(trial) for trial in made.trials() if trial.number == 0]
    assert [(row.scenario, row.score, row.isolated) for row in rows] == [
        ("inject=none", 3.5, False),
        ("inject=bias_2", 3.5, True),
    ]


@pytest.mark.parametrize(
    ("compare", "complaint"),
    [
        ("{methods: [arx-residuals]}", "compare.methods[0]: no such method, got 'arx-residuals'; did you mean"),
        ("{}", "compare: no method, got none; name some in methods"),
        ("{methods: [glr], programs: {ml: x}}", "'ml' is a method of this program; choose another name"),
        ("{methods: [glr], false_alarm: 0}", "compare.false_alarm"),
        ("{methods: [glr], timeouts: 3}", "compare.timeouts: unknown key"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(sweep: Callable[..., Sweep], compare: str, complaint: str):
    with pytest.raises(BfiError) as refusal:
        sweep(f"{METHODS}compare: {compare}\n")
    assert complaint in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_the_command_shows_methods_by_faults(bfi: Callable, undrawn: None, written: Callable, tmp_path: Path):
    path = written(f"{METHODS}compare: {{methods: [arx-residual, glr], false_alarm: 0.4}}\n")
    made = bfi("montecarlo", "-c", path, "--out", tmp_path / "out", "--json")
    assert (made.code, made.stderr) == (0, "")
    assert {one["axes"]["compare"] for one in json.loads(made.stdout)["scenarios"]} == {"arx-residual", "glr"}
    table = (tmp_path / "out" / "equal_rate.csv").read_text().splitlines()
    assert table[1] == "method,false alarms,bias_2"
    assert {line.split(",")[0] for line in table[2:]} == {"arx-residual", "glr"}
    assert {"detection.svg", "rates.svg", "isolated.csv"} <= {one.name for one in (tmp_path / "out").iterdir()}


def test_a_window_is_drawn_from_a_flight_in_every_trial(sweep: Callable[..., Sweep]):
    log = ROOT / "data" / "citation_clean.h5"
    text = f"record: {{log: {log}, from_s: 2, length_s: 12}}\ndictionary: dictionary.yaml\nactive: 0\ntrials: 3\n"
    setting = sweep(text).scenarios[0].setting
    windows = [record_of(setting, np.random.default_rng(k)) for k in range(3)]
    assert len({float(one.time_s[0]) for one in windows}) == 3
    for one in windows:
        assert one.time_s[0] >= 2.0
        assert one.time_s[-1] - one.time_s[0] == pytest.approx(12.0, abs=0.011)
    with pytest.raises(LogError, match="length_s: longer than the"):
        record_of(sweep(text.replace("12}", "120}")).scenarios[0].setting, np.random.default_rng(0))


def test_the_shipped_benchmark_is_the_one_that_is_reproduced():
    shipped, reproduced = (
        load_sweep(ROOT / path) for path in ("configs/benchmark.yaml", "bfi_cli/lab/reproduce/benchmark_sweep.yaml")
    )
    assert [one.name for one in shipped.scenarios] == [one.name for one in reproduced.scenarios]
    assert [one.setting.digest for one in shipped.scenarios] == [one.setting.digest for one in reproduced.scenarios]
