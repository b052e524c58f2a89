"""The recorder as a nuisance parameter: where its low-pass is uncertain, the fault itself tells it best.

A step shows the response of the recorder, which the spectra of an excerpt tell to a few tens of per cent only; without
a fault nothing depends on it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..config import Config, merge
from ..dictionary import Dictionary
from ..errors import DictionaryError, LogError
from ..faults.filters import BETWEEN_RECORDERS, alternatives, recorder_low_passes
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..notes import Note
from .magnitudes import MethodResult
from .maximum_likelihood import identify_by_likelihood
from .preprocessing.regression import RegressionData
from .preprocessing.window import PreparedWindow, prepare_window, regression_of, selects_support


def with_likeliest_recorder(
    log: FlightLog,
    dictionary: Dictionary,
    config: Config,
    window: PreparedWindow,
    regression: RegressionData,
    outcome: MethodResult,
    progress: Progress = unseen,
) -> tuple[PreparedWindow, RegressionData, MethodResult]:
    """Return window, regression and outcome with the recorder of least criterion, where the log's is uncertain.

    The variance of every magnitude gains its spread over the recorders, each weighted by its likelihood, and what lies
    between them. What is declared depends on the recorder, so that the faults are selected anew for each, at the rate
    and orders of the first.

    Parameters
    ----------
    window, regression, outcome : with the recorder that the spectra of the log suggest.
    """
    chains = alternatives(window.filters)
    if not chains or not outcome.atoms:
        return window, regression, outcome
    alike = merge(config, {"conditioning.rate_hz": window.same_rate, "model.orders": regression.orders})
    trials = [(window, regression, outcome)]
    for k, chain in enumerate(chains):
        progress("the recorder", k / len(chains))
        recorder = recorder_low_passes(chain)[0]
        stated = merge(alike, {"recorder.edge_hz": recorder.edge_hz, "recorder.kind": recorder.kind})
        try:
            other = prepare_window(log, dictionary, stated, selects=selects_support(stated))
            factorised = regression_of(other, stated)
            identified = identify_by_likelihood(other, factorised, stated, exclusive=True)
        except (DictionaryError, LogError):
            continue
        if other.live == window.live and factorised.n_rows == regression.n_rows:
            trials.append((other, factorised, identified))
    outcomes = [result for _, _, result in trials]
    likeliest, likeliest_regression, best = min(trials, key=lambda trial: trial[2].criterion)
    value = best.magnitudes.value
    weight = np.exp(-0.5 * np.array([result.criterion - best.criterion for result in outcomes]) / best.dispersion)
    same = np.array([result.atoms == best.atoms for result in outcomes])
    others = np.array([result.magnitudes.value for result in outcomes])[same]
    spread = (weight[same, None] * (others - value) ** 2).sum(axis=0) / weight[same].sum()
    variance = best.magnitudes.variance + spread + (BETWEEN_RECORDERS * value) ** 2
    recorder = recorder_low_passes(likeliest.filters)[0]
    note = Note.method(
        f"the recorder's low-pass is uncertain; the fault suits {recorder.kind} with gain one half at "
        f"{recorder.edge_hz:.3g} Hz best of {len(trials)}, and the intervals hold their spread"
    )
    chosen = replace(best, magnitudes=replace(best.magnitudes, variance=variance), notes=(*best.notes, note))
    return replace(likeliest, recorder=window.recorder), likeliest_regression, chosen
