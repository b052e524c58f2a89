"""Trials of faults of unknown shape: one log, courses added to its airspeed, what `identify` answered."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits
from trials import sized, spread

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model import identify_faults

NOISE = 0.02
ONSET_S = 12.0  # in the window, after the manoeuvre
INPUTS = ("elevator", "pitch", "longitudinal_acc")
SEEDS = range(sized(100, 0.03))


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


def run_all(log: FlightLog, course: Callable[[np.ndarray], np.ndarray], inputs: Sequence[str]) -> list[Outcome]:
    return spread(partial(run, log=log, course=course, inputs=inputs), SEEDS)
