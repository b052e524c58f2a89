"""One trial: draw faults, add them, identify, compare. A function of a module, so that any worker can run it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import BfiError
from ..identify import identify_faults
from ..identify.methods import METHODS
from ..truth import compare_faults
from .flight import faulty, record_of
from .row import ERROR_DIGITS, Row, rounded
from .scenarios import Trial
from .shared import SharedRecord, declared_magnitudes, shared_record

__all__ = ["draw", "run_trial"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Answer:
    """Decision and magnitudes; intervals are None where the method has none."""

    decision: str
    estimate: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]] | None


def run_trial(trial: Trial) -> Row:
    """Return the row of a trial; it depends on the trial alone. A trial that fails is a row that says why."""
    faults, *streams = np.random.default_rng(trial.seed).spawn(3)
    truth = draw(trial, faults)
    row = Row(scenario=trial.scenario.name, trial=trial.number, seed=trial.seed, truth=truth)
    try:
        answer = _answer(trial, truth, streams)
    except BfiError as error:
        return _failed(row, str(error))
    except Exception as error:
        return _failed(row, f"a defect of ours, {error!r}")
    return _compared(row, answer)


def draw(trial: Trial, rng: np.random.Generator) -> dict[str, float]:
    """Return magnitude by name of the faults of a trial, in the order of the dictionary."""
    atoms = trial.scenario.setting.dictionary.atoms
    active = np.sort(rng.choice(len(atoms), trial.scenario.n_active, replace=False))
    sizes = rng.choice(trial.scenario.sizes, trial.scenario.n_active)
    return {atoms[j].name or atoms[j].shape: float(z) for j, z in zip(active, sizes, strict=True)}


def _answer(trial: Trial, truth: Mapping[str, float], streams: list[np.random.Generator]) -> _Answer:
    setting = trial.scenario.setting
    shared = shared_record(setting)
    if shared is not None and (found := _from_shared(shared, trial, truth)):
        return _Answer(decision="fault", estimate=found, intervals=None)
    log = faulty(record_of(setting, streams[0]), setting, truth, streams[1])
    result = identify_faults(log, setting.dictionary, setting.config)
    intervals = {fault.name: fault.ci95 for fault in result.faults}
    return _Answer(
        decision=result.decision,
        estimate={fault.name: fault.magnitude for fault in result.faults},
        intervals=intervals if METHODS[setting.config.method].intervals else None,
    )


def _from_shared(shared: SharedRecord, trial: Trial, truth: Mapping[str, float]) -> dict[str, float]:
    """Return the declared magnitudes; none, where the whole answer must say whether the data could tell."""
    z = declared_magnitudes(shared, np.array([truth.get(name, 0.0) for name in shared.names]), trial.scenario.setting)
    return {name: float(value) for name, value in zip(shared.names, z, strict=True) if value}


def _compared(row: Row, answer: _Answer) -> Row:
    truth, estimate = row.truth, answer.estimate
    comparison, hits = compare_faults(estimate, truth), None
    error = comparison.magnitude_error
    if answer.intervals is not None:
        both = [(truth[name], *ends) for name, ends in answer.intervals.items() if name in truth]
        hits = [low <= z <= high for z, low, high in both]
    return Row(
        scenario=row.scenario,
        trial=row.trial,
        seed=row.seed,
        truth=truth,
        estimate={name: rounded(z) for name, z in estimate.items()},
        decision=answer.decision,
        isolated=comparison.isolated,
        false_alarms=comparison.false_alarms,
        missed=comparison.missed,
        magnitude_error=None if error is None else rounded(error, ERROR_DIGITS),
        intervals=None if hits is None else len(hits),
        covered=None if hits is None else sum(hits),
    )


def _failed(row: Row, why: str) -> Row:
    return Row(scenario=row.scenario, trial=row.trial, seed=row.seed, truth=row.truth, error=" ".join(why.split()))
