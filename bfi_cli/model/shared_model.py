"""Whether other records of an aircraft follow the model of a record, so that they may be explained together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from ..config import Config, merge
from ..dictionary import Dictionary
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..kernels import FloatArray
from ..kernels.progress import Progress, unseen
from ..kernels.variable_projection import Fit, fit_magnitudes
from ..methods import METHODS
from ..notes import Note
from ..threads import one_thread
from .maximum_likelihood import identify_by_likelihood
from .preprocessing.regression import RegressionData, build_regression
from .preprocessing.window import PreparedWindow, prepare_window, regression_of, selects_support


def with_those_that_share(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen
) -> tuple[FlightLog, tuple[Note, ...]]:
    """Return the log with those of its earlier records that follow the same model, and notes on them.

    A record of another trim or another aircraft would bend the model, and a fault that is not there would mend it.
    Each record is tested by itself, with the faults that are likeliest with all of them: one model for log and record,
    each with its own constants, against a model for each, by the criterion that selects the faults. Where the log has a
    fault that no entry explains, its model seems to be another, and it is analysed alone.

    Raises
    ------
    ConfigError : the method knows its model.
    LogError, DictionaryError : see `bfi_cli.model.preprocessing.window.prepare_window`.
    """
    if METHODS[config.method].needs:
        raise ConfigError(
            f"--together: method {config.method} is given its model and learns none, got {len(log.earlier)} further "
            "logs; leave them out"
        )
    with one_thread():
        likeliest = merge(config, {"method": "ml"})
        log = replace(log, earlier_weights=_weights(log, dictionary, likeliest))
        window = prepare_window(log, dictionary, likeliest, selects=selects_support(likeliest))
        regression = regression_of(window, likeliest)
        atoms = identify_by_likelihood(window, regression, likeliest, progress).atoms
        shares = [_shares(window, regression, atoms, k, likeliest) for k in range(len(log.earlier))]
    kept, weights = tuple(compress(log.earlier, shares)), tuple(compress(log.earlier_weights, shares))
    left_out = [record.path for record, is_shared in zip(log.earlier, shares, strict=True) if not is_shared]
    notes = []
    if kept:
        own_s, more_s = (sum(part.n_samples / part.rate_hz for part in some) for some in ((window.log,), kept))
        named = ", ".join(record.path for record in kept)
        notes.append(
            Note.method(
                f"one model for {own_s:.4g} s of this log and {more_s:.4g} s of {named}, "
                "which count as free of faults; the search over all onsets looks at this log alone"
            )
        )
    if left_out:
        notes.append(
            Note.limit(
                f"left out of --together: {', '.join(left_out)}, whose motion follows another model than this log's "
                "(another trim, another aircraft, or a fault that no entry explains)"
            )
        )
    return replace(log, earlier=kept, earlier_weights=weights), tuple(notes)


def _weights(log: FlightLog, dictionary: Dictionary, config: Config) -> tuple[float, ...]:
    """Return how many times as quiet as a log each of its earlier records is, in the mean of the outputs.

    Each is predicted by a model of its own, of the order that suits the log with the faults that are likeliest in it.
    """
    window = prepare_window(replace(log, earlier_weights=()), dictionary, config, selects=selects_support(config))
    signals = replace(window.signals, earlier=())
    regression = build_regression(signals, window.live, config, orders=window.orders)
    outcome = identify_by_likelihood(window, regression, config)
    order = (outcome.order,)
    fit = fit_magnitudes(build_regression(signals, window.live, config, orders=order).problem(*order), outcome.atoms)
    weights = []
    for record in window.signals.earlier:
        both = build_regression(replace(signals, earlier=(record,)), window.live, config, orders=order)
        rows = both.layout.earlier
        assert rows is not None
        covariance = _covariance(np.hstack([rows.u, rows.past]), rows.y, rows.n_rows, both.floor)
        weights.append(float(np.mean(np.sqrt(np.diag(fit.sigma) / np.diag(covariance)))))
    return tuple(weights)


def _shares(window: PreparedWindow, regression: RegressionData, atoms: tuple[int, ...], k: int, config: Config) -> bool:
    """Say whether one model explains a window with some faults and its k-th earlier record, by the BIC.

    Each of the three models has the order that suits it best.
    """
    both, alone = (
        build_regression(replace(window.signals, earlier=some), window.live, config, orders=regression.orders)
        for some in ((window.signals.earlier[k],), ())
    )
    rows = both.layout.earlier
    assert rows is not None
    fits = [fit_magnitudes(alone.problem(order), atoms) for order in alone.orders]
    shortest = min(fits, key=lambda fit: fit.bic(alone.n_rows))
    independent = alone.effective_rows(alone.unfold(shortest).weighted_error) / alone.n_rows
    price = float(np.log(independent * both.n_rows))
    shared = [fit_magnitudes(both.problem(order), atoms) for order in both.orders]
    n_outputs = rows.y.shape[1]
    others = []
    for order in both.orders:
        n_u = rows.u.shape[1] * (order + both.layout.feedthrough) // (both.layout.first + both.layout.feedthrough)
        X = np.hstack([rows.u[:, :n_u], rows.past[:, : order * n_outputs]])
        # Its coefficients but for the constant, which is its own in either case, and the covariance of its noise.
        n_parameters = n_outputs * X.shape[1] + n_outputs * (n_outputs + 1) // 2
        log_det = float(np.linalg.slogdet(_covariance(X, rows.y, rows.n_rows, both.floor))[1])
        others.append(independent * rows.n_rows * log_det + n_parameters * price)

    def least(fits: Sequence[Fit], n_rows: int) -> float:
        return min(independent * n_rows * fit.log_det + fit.n_parameters * price for fit in fits)

    return bool(least(shared, both.n_rows) <= least(fits, alone.n_rows) + min(others))


def _covariance(X: FloatArray, y: FloatArray, n_rows: int, floor: float) -> FloatArray:
    """Return the covariance of what regressors leave of outputs."""
    error = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    return np.asarray(error.T @ error / n_rows + floor**2 * np.eye(y.shape[1]))
