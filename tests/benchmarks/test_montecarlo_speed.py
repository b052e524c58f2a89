"""The sweep of figure 5-4 against algorithm 3 written out plainly, called for every trial: one core, the same flags."""

from __future__ import annotations

import runpy
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bfi_cli.dictionary import signals
from bfi_cli.kernels.lagged import lagged
from bfi_cli.lab.montecarlo import load_sweep, run_sweep
from bfi_cli.lab.montecarlo.flight import record_of
from bfi_cli.lab.montecarlo.scenarios import Sweep
from bfi_cli.model.risro import THRESHOLD

pytestmark = pytest.mark.benchmarks

ROOT = Path(__file__).parents[2]
ORDER, BAR = 4, 20
FloatArray = NDArray[np.float64]

plain_varx = runpy.run_path(str(ROOT / "tests" / "kernels" / "plain_risro.py"))["plain_varx"]


@pytest.fixture
def sweep(tmp_path: Path) -> Sweep:
    text = (ROOT / "configs" / "montecarlo_thesis.yaml").read_text()
    path = tmp_path / "sweep.yaml"
    path.write_text(
        text.replace("[risro, ml]", "risro\n  risro.sparsity: none").replace(
            "dictionary: ", f"dictionary: {ROOT / 'configs'}/", 1
        ),
    )
    return load_sweep(path)


def plain_flags(y: FloatArray, u: FloatArray, theta: FloatArray) -> NDArray[np.bool_]:
    """Return which faults 50 steps declare, from no fault and the predictor that goes with it."""
    y, scale = (y - y.mean(axis=0)) / y.std(axis=0), np.sqrt(np.mean(theta**2, axis=0))
    past = lagged(y, range(1, ORDER + 1))
    X = np.hstack([np.ones((len(past), 1)), lagged(u, range(1, ORDER + 1)), past])
    K = np.linalg.lstsq(X, y[ORDER:], rcond=None)[0][-ORDER:, 0]
    z = plain_varx(u, y, theta / scale, order=ORDER, start=(np.zeros(theta.shape[2]), K))
    z = z / scale[0]
    return np.abs(z) > THRESHOLD * np.linalg.norm(z)


def test_seven_times_a_hundred_trials(sweep: Sweep, capsys: pytest.CaptureFixture[str]):
    setting = sweep.scenarios[0].setting
    log = record_of(setting, np.random.default_rng(0))
    u, y = log.signals(["elevator"]), log.signals(["tas"])
    u = (u - u.mean(axis=0)) / u.std(axis=0)
    names = [atom.name for atom in setting.dictionary.atoms]
    theta = signals(setting.dictionary.resolved(0.0), log.time_s, ["tas"], window_start_s=0.0)
    with threadpool_limits(1):
        run_sweep(load_sweep(sweep.path, trials=1))
        start = time.perf_counter()
        rows = [row for row, _ in run_sweep(sweep)]
        ours = time.perf_counter() - start
        magnitudes = [np.array([row.truth.get(name, 0.0) for name in names]) for row in rows]
        start = time.perf_counter()
        plain = [plain_flags(y + theta @ z, u, theta) for z in magnitudes]
        theirs = time.perf_counter() - start
    right = [bool(np.array_equal(flags, z != 0.0)) for flags, z in zip(plain, magnitudes, strict=True)]
    same = [
        row.isolated == isolated and set(row.estimate or ()) == {names[j] for j in np.flatnonzero(flags)}
        for row, isolated, flags in zip(rows, right, plain, strict=True)
    ]
    assert len(rows) == 700
    with capsys.disabled():
        print(
            f"\n700 trials: plain {theirs:.1f} s, sweep {ours:.2f} s, ratio {theirs / ours:.1f} (bar {BAR}); isolated "
            f"{np.mean([row.isolated for row in rows]):.1%} and {np.mean(right):.1%}, same flags in {np.mean(same):.1%}"
        )
    assert all(same)
