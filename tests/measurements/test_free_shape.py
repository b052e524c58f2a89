"""Faults of unknown shape on a nonlinear Citation simulation: their course, and none where there is none.

The inputs are elevator, pitch and longitudinal acceleration. From the elevator alone the airspeed nearly integrates,
and what `bfi identify` must do there is to say so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits
from trials import not_below, sized

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.identify import identify_faults

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

NOISE = 0.02
ONSET_S = 12.0  # in the window, after the manoeuvre
INPUTS = ("elevator", "pitch", "longitudinal_acc")
SEEDS = range(sized(100))


def two_slopes(t: np.ndarray) -> np.ndarray:
    """0.6 m/s^2 for five seconds, then 0.15."""
    return 0.6 * np.minimum(t, 5.0) + 0.15 * np.maximum(t - 5.0, 0.0)


def decaying_step(t: np.ndarray) -> np.ndarray:
    """5 m/s that decay with a time constant of five seconds."""
    return 5.0 * np.exp(-t / 5.0)


def half_sine(t: np.ndarray) -> np.ndarray:
    """A bump of 4 m/s that lasts ten seconds."""
    return np.where(t <= 10.0, 4.0 * np.sin(np.pi * t / 10.0), 0.0)


def nothing(t: np.ndarray) -> np.ndarray:
    return np.zeros_like(t)


@dataclass(frozen=True)
class Outcome:
    state: str | None
    vaf: float
    covered: float


def run(seed: int, *, log: FlightLog, course: Callable[[np.ndarray], np.ndarray], inputs: Sequence[str]) -> Outcome:
    """Identify one noisy copy of the log with a fault."""
    since = log.time_s - log.time_s[0] - ONSET_S
    fault = np.where(since >= 0.0, course(np.maximum(since, 0.0)), 0.0)
    noise = NOISE * np.random.default_rng([23, seed]).standard_normal(len(fault))
    tas = log.channel("tas")
    faulty = replace(tas, values=frozen_array(tas.values + fault + noise))
    dictionary = load_dictionary({"relative_to": "window", "atoms": [{"shape": "free", "onset_s": ONSET_S}]})
    config = merge(Config(), {"inputs": tuple(inputs)})
    with threadpool_limits(1):
        result = identify_faults(replace(log, channels={**log.channels, "tas": faulty}), dictionary, config)
    series, true = result.outputs[0], np.interp(result.time_s, log.time_s, fault)
    on = result.time_s - log.time_s[0] > ONSET_S
    inside = np.abs(series.fault - true)[on] <= 1.96 * series.fault_sd[on]
    vaf = 100.0 * (1.0 - np.sum((series.fault - true) ** 2) / max(float(np.sum(true**2)), 1e-12))
    return Outcome(result.candidates[0].state, float(vaf), float(np.mean(inside)))


@pytest.fixture(scope="module")
def log(flights: Path) -> FlightLog:
    return read_log(flights / "de3211_1.mat").window(19.0, 50.7)


def run_all(log: FlightLog, course: Callable[[np.ndarray], np.ndarray], inputs: Sequence[str]) -> list[Outcome]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(partial(run, log=log, course=course, inputs=inputs), SEEDS))


@pytest.mark.parametrize("course", [two_slopes, decaying_step, half_sine])
def test_the_course_is_found(log: FlightLog, course: Callable[[np.ndarray], np.ndarray]) -> None:
    outcomes = run_all(log, course, INPUTS)
    declared = [one for one in outcomes if one.state == "declared"]
    vaf = [one.vaf for one in declared]
    print(
        f"\n{course.__name__}: declared in {len(declared)} of {len(outcomes)}, fault VAF {np.median(vaf):.1f} % in the "
        f"median, {np.quantile(vaf, 0.1):.1f} % in the worst tenth, {np.mean(np.array(vaf) >= 90.0):.0%} at 90 % and "
        f"more; the band covers {np.mean([one.covered for one in declared]):.0%}"
    )
    assert not_below(len(declared) / len(outcomes), 0.9, len(outcomes))
    assert np.median(vaf) >= 90.0


def test_without_a_fault_none_is_declared(log: FlightLog) -> None:
    for inputs in (INPUTS, ("elevator",)):
        outcomes = run_all(log, nothing, inputs)
        share = float(np.mean([one.state != "declared" for one in outcomes]))
        print(f"\n{', '.join(inputs)}: no fault of unknown shape declared in {share:.1%} of {len(outcomes)}")
        assert not_below(share, 0.97, len(outcomes))


@pytest.mark.parametrize("course", [two_slopes, decaying_step, half_sine])
def test_from_the_elevator_alone_no_course_is_made_up(
    log: FlightLog, course: Callable[[np.ndarray], np.ndarray]
) -> None:
    outcomes = run_all(log, course, ("elevator",))
    wrong = [one for one in outcomes if one.state == "declared" and one.vaf < 90.0]
    print(f"\n{course.__name__} from the elevator: {len(wrong)} of {len(outcomes)} courses made up")
    assert not_below(1.0 - len(wrong) / len(outcomes), 0.95, len(outcomes))
