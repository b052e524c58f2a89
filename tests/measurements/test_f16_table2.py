"""Table II of the F-16 diagnosability paper with six seeds, and which of its statements survive other choices."""

from __future__ import annotations

from collections.abc import Iterable
from time import perf_counter

import numpy as np
import pytest

from bfi_cli.reproduce.f16_table2 import BANDWIDTHS, TABLE_2, Case, F16Options, Indices, fly_cases, indices, montecarlo

pytestmark = pytest.mark.slow

CHOSEN = F16Options()
SEEDS = range(6)
EACH, RMS, BANDWIDTH = 0.12, 0.07, 0.12
SEED_SPREAD = np.array([0.06, 0.03, 0.03])


def measured(options: F16Options, *, seeds: Iterable[int]) -> Indices:
    """Fly four flights per seed and return their indices."""
    return indices(fly_cases([Case(options=options, seed=seed) for seed in seeds]), options)


@pytest.fixture(scope="module")
def found() -> Indices:
    return measured(CHOSEN, seeds=SEEDS)


def show(what: str, values: Indices) -> None:
    mean, sd = values.index.mean(axis=0), values.index.std(axis=0, ddof=1)
    cells = "  ".join(f"{m:.3f} ({s:.3f})" for m, s in zip(mean.ravel(), sd.ravel(), strict=True))
    print(f"\n{what}: {cells}; RMS {values.rms:.3f}, worst {values.worst:.3f}")


@pytest.mark.parametrize("reference", ["kde", "gaussian"])
def test_every_index_and_bandwidth_is_near_the_published_one(reference: str):
    values = measured(CHOSEN.model_copy(update={"reference": reference}), seeds=SEEDS)
    show(reference, values)
    ratio = values.bandwidth.mean(axis=0)[:, 1:] / BANDWIDTHS[:, 1:]
    print(f"bandwidths over published: {np.round(ratio.ravel(), 3)}")
    assert values.worst <= EACH
    assert values.rms < RMS
    assert np.abs(ratio - 1.0).max() <= BANDWIDTH
    assert (np.diff(values.index, axis=2) > 0.0).all()
    assert (values.index[:, 0, 1:] > values.index[:, 1, 1:] + 0.1).all()
    if reference == "gaussian":
        assert (values.index[:, :, 0] < 0.2).all()


def test_every_single_seed_keeps_to_the_table_within_the_spread_of_seeds(found: Indices):
    assert (np.abs(found.index - TABLE_2) <= EACH + SEED_SPREAD).all()
    assert (np.abs(found.index - found.index.mean(axis=0)) <= SEED_SPREAD).all()


def test_monte_carlo_agrees_with_quadrature():
    flown = fly_cases([Case(options=CHOSEN, seed=0)])
    value, error = montecarlo(flown[0], CHOSEN, 20_000, rng=np.random.default_rng(0))
    off = np.abs(value - indices(flown, CHOSEN).index[0])
    print(f"\nMonte Carlo, 20000 values: off by {off.max():.4f}, {np.max(off / error):.1f} standard errors")
    assert (off < 4.0 * error).all()


@pytest.mark.parametrize("exponent", [0.0, None])
def test_the_adaptive_bandwidth_does_not_show_in_the_index(found: Indices, exponent: float | None):
    other = measured(CHOSEN.model_copy(update={"exponent": exponent}), seeds=SEEDS)
    show(f"exponent {exponent}", other)
    assert np.abs(other.index - found.index).mean(axis=0).max() <= 0.02


def test_the_integration_step_does_not_matter(found: Indices):
    fine = measured(CHOSEN.model_copy(update={"step_s": 0.005}), seeds=[0])
    print(f"\nstep 0.005 s: {np.abs(fine.index[0] - found.index[0]).max():.4f}")
    assert np.abs(fine.index[0] - found.index[0]).max() <= 0.005


@pytest.mark.parametrize(
    "change",
    [
        *({"noise_deg_s": noise} for noise in (0.02, 0.1)),
        *({"roll_deg": roll} for roll in (0.0, 60.0)),
        {"variation": (-0.10, -0.25, -0.20)},
        {"observer_gain": (10.0, 10.0, 10.0)},
        {"observer_rates": "estimated"},
        {"throttle": 0.5},
        {"nozzle_deg": 0.0},
    ],
    ids=str,
)
def test_the_order_over_time_survives_other_choices(change: dict[str, object]):
    other = measured(CHOSEN.model_copy(update=change), seeds=[0, 1])
    show(str(change), other)
    assert (np.diff(other.index, axis=2) > 0.0).all()
    assert (other.index[:, 0, 1:] > other.index[:, 1, 1:]).all()


def test_how_long_the_four_flights_take():
    """Printed, not asserted: the bar is 10 s on one core."""
    start = perf_counter()
    measured(CHOSEN, seeds=[0])
    print(f"\ntable II with four flights: {perf_counter() - start:.1f} s")
