"""The shipped benchmark: what each method declares and names by its own threshold, and at one rate of false alarms.

A few methods, faults and trials run; BFI_FULL=1 runs the whole sweep, 200 trials of ten methods, in an hour and a half,
and 60 minutes drawn from a recorded flight.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from bars import FULL, not_above, not_below

from bfi_cli.lab.montecarlo import load_sweep, run_sweep, summarise
from bfi_cli.lab.montecarlo.summary import ScenarioSummary

pytestmark = pytest.mark.slow

SWEEP = Path(__file__).parents[2] / "configs" / "benchmark.yaml"
METHODS, FAULTS = ("risro", "mf2d", "arx-residual", "glr"), ("none", "bias_1", "bias_0.5+sine_0.2")
TRIALS, MINUTES = 3, 12


def test_every_method_on_the_same_trials() -> None:
    sweep = load_sweep(SWEEP)
    if not FULL:
        kept = [one for one in sweep.scenarios if one.axes["compare"] in METHODS and one.axes["inject"] in FAULTS]
        sweep = replace(sweep, n_trials=TRIALS, scenarios=tuple(kept))
    summary = summarise(sweep, run_sweep(sweep, workers=2 if FULL else 1))
    of = {(one.axes["compare"], one.axes["inject"]): one for one in summary.scenarios}
    for (method, fault), one in of.items():
        print(f"{method:14s} {fault:18s} declared {shown(one, 'fault')}, isolated {one.isolation_rate.rate}")
    n = sweep.n_trials
    if not FULL:  # of these every answer is known
        assert {shown(one, "fault") for (_, fault), one in of.items() if fault == "none"} == {0.0}
        assert {shown(one, "fault") for (_, fault), one in of.items() if fault == "bias_1"} == {1.0}
        assert {of["risro", fault].isolation_rate.rate for fault in FAULTS} == {1.0}
    for method in {method for method, _ in of}:
        assert not_above(shown(of[method, "none"], "fault"), 0.02, n), method
        assert not_below(shown(of[method, "bias_1"], "fault"), 0.98, n), method
    for fault in ("bias_1", "bias_0.5+sine_0.2"):
        assert not_below(of["risro", fault].isolation_rate.rate or 0.0, 0.98, n), fault


@pytest.mark.realdata
def test_on_minutes_of_a_recorded_flight(flights: Path, tmp_path: Path) -> None:
    """Minutes in which the elevator does not move are refused, and count for no method."""
    log = flights / "citation_20180312_f1.h5"
    lines = [line for line in SWEEP.read_text().splitlines() if not line.startswith(("record:", "noise:"))]
    recorded = tmp_path / "recorded.yaml"
    recorded.write_text(f"record: {{log: {log}, from_s: 900, to_s: 4200, length_s: 60.0}}\n" + "\n".join(lines))
    sweep = replace(load_sweep(recorded), n_trials=60 if FULL else MINUTES)
    if not FULL:
        kept = [one for one in sweep.scenarios if one.axes["compare"] in METHODS and one.axes["inject"] in FAULTS[:2]]
        sweep = replace(sweep, scenarios=tuple(kept))
    summary = summarise(sweep, run_sweep(sweep, workers=2 if FULL else 1))
    of = {(one.axes["compare"], one.axes["inject"]): one for one in summary.scenarios}
    for (method, fault), one in of.items():
        print(f"{method:14s} {fault:18s} declared {one.decisions['fault']}, isolated {one.isolation_rate.count}")
    n = of["risro", "none"].decisions["fault"].of
    assert not_above(shown(of["risro", "none"], "fault"), 0.05, n)
    assert not_below(shown(of["risro", "bias_1"], "fault"), 0.95, n)


def shown(one: ScenarioSummary, decision: str) -> float:
    """Return the share of the trials with a decision."""
    return one.decisions[decision].rate or 0.0
