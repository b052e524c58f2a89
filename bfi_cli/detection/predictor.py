"""The regression that predicts the watched channels from the past, chosen on the healthy time by how well it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..kernels import FloatArray
from ..kernels.lagged import lagged
from ..kernels.parity import past_basis
from ..kernels.recursive_least_squares import PRIOR, RecursiveResiduals, predictive_score, recursive_residuals
from .preparation import DecimatedRecord
from .result import ParityModel

# Lags tried: short pasts whole, long ones by the components that move more than EDGE times the noise. Candidates only:
# the healthy time decides between them (docs/theory.md, 11.2).
SHORT_PASTS, LONG_PASTS, EDGE = (1, 2, 4, 6), (10, 20), 1.5
# Weights of a row relative to the next that are tried, likewise: a memory without end down to one of fifty rows.
FORGETTING = (1.0, 0.998, 0.995, 0.99, 0.98)
# Lags of the inputs beside lag 0; their means and first moments between samples hold what happens in between.
INPUT_LAGS = 2
# Rows more than regressors, so that the first predictions have a variance.
SPARE = 5
# An input that moves less in the healthy time, relative to its extent, rests there and is scaled by its extent.
STILL = 1e-6
# Standard deviation of a coefficient of which the healthy time tells nothing. Without it 35 of 40 healthy
# flights of a Boeing 747 raised an alarm when the phugoid followed the manoeuvre, with it none (docs/theory.md, 11.2).
UNSEEN_SD = 0.1
# Least prediction error, relative to an output's spread: data without noise have none.
RELATIVE_FLOOR = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Predictor:
    """The regression of the watched channels on the rows before, and its errors.

    Attributes
    ----------
    samples : (n_rows,) the sample each row predicts; rows of the healthy and of the watched time.
    n_healthy : rows of the healthy time; those from `errors.start` on are predicted, not fitted.
    summary : samples of the past, directions of it, weight of a row relative to the next, prediction errors.
    basis : (at least lags * n_outputs, r) maps the stacked past to the last r regressors.
    unit : (n_outputs,) standard deviation of the noise, the unit of the errors.
    X, Y : (n_rows, n_regressors) and (n_rows, n_outputs), the regression.
    """

    samples: NDArray[np.intp]
    n_healthy: int
    summary: ParityModel
    basis: FloatArray
    unit: FloatArray
    errors: RecursiveResiduals
    X: FloatArray
    Y: FloatArray

    @property
    def predicted(self) -> NDArray[np.intp]:
        """Samples of the rows that are predicted, not fitted."""
        return self.samples[self.errors.start :]

    @property
    def n_held_back(self) -> int:
        """Rows of the healthy time that are predicted, not fitted."""
        return self.n_healthy - self.errors.start


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scaled:
    """Outputs in units of their noise, inputs in units of their motion; the first `n_healthy` samples are healthy."""

    y: FloatArray
    u: FloatArray
    weak: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    n_healthy: int
    unit: FloatArray

    @property
    def half(self) -> int:
        """The healthy sample from which on samples are predicted."""
        return self.n_healthy // 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LaggedRows:
    """Regressors [1 | inputs | components of the past] and outputs, from sample `first` on.

    `prior` is one over the standard deviation to which each coefficient is known, see `recursive_residuals`; `basis`
    maps the stacked past to its components.
    """

    X: FloatArray
    Y: FloatArray
    prior: FloatArray
    basis: FloatArray
    first: int


def fit_predictor(samples: DecimatedRecord, channels: Sequence[int]) -> Predictor:
    """Predict the channels, each row from the rows before it.

    Past and forgetting are those with which the second half of the healthy time is predicted best.

    Parameters
    ----------
    channels : which outputs are watched; the others are no regressors either.

    Raises
    ------
    LogError : the healthy time is too short for any model.
    """
    data = _scaled(samples, channels)
    n_beside = 1 + (INPUT_LAGS + 1) * int(np.count_nonzero(~data.weak))  # regressors beside the past
    # Lags and rank that half of the healthy time can fit: short pasts whole, long ones without their null space.
    pasts = []
    for lags in (*SHORT_PASTS, *LONG_PASTS):
        spare = data.half - max(lags, INPUT_LAGS) - n_beside - len(channels) - SPARE
        if spare > 0:
            edge = 0.0 if lags in SHORT_PASTS else EDGE
            rank = past_basis(data.y[: data.n_healthy], lags=lags, edge=edge)[0].shape[1]
            if 0 < rank <= spare:
                pasts.append((lags, rank))
    if not pasts:
        needed = 2 * (INPUT_LAGS + n_beside + 2 * len(channels) + SPARE)
        raise LogError(
            f"{samples.path}: the healthy time has {data.n_healthy} samples at {samples.rate_hz:.4g} Hz, {needed} are "
            "needed; give a longer --train, a higher --rate, or fewer channels"
        )
    lags, rank = max(pasts, key=lambda past: _score(data, *past, forgetting=1.0))
    forgetting = max(FORGETTING, key=lambda weight: _score(data, lags, rank, forgetting=weight))
    chosen = _rows(data, lags, rank)
    rows = _with_unseen(data, chosen)
    kept = data.kept[rows.first :]
    X, Y = rows.X[kept], rows.Y[kept]
    return Predictor(
        samples=rows.first + np.flatnonzero(kept),
        n_healthy=data.n_healthy - rows.first,
        summary=ParityModel(
            lags=lags,
            rank=rank,
            n_stacked=lags * len(channels),
            forgetting=forgetting,
            n_fitted=data.n_healthy - rows.first,
            noise_sd={samples.outputs[k]: float(unit) for k, unit in zip(channels, data.unit, strict=True)},
        ),
        basis=rows.basis,
        unit=data.unit,
        errors=recursive_residuals(X, Y, start=data.half - rows.first, forgetting=forgetting, prior=rows.prior),
        X=X,
        Y=Y,
    )


def _with_unseen(data: _Scaled, chosen: _LaggedRows) -> _LaggedRows:
    """Return the rows with a regressor more for each direction of the past that in the healthy time is noise alone.

    The healthy time does not tell how the outputs depend on such a direction, and noise in the regressors makes the
    dependence look like zero. With a coefficient known to UNSEEN_SD only, a prediction becomes less certain the further
    the past moves along the direction, and the coefficient is learnt then.
    """
    q = data.y.shape[1]
    n_lags = len(chosen.basis) // q
    longest = max(n_lags, LONG_PASTS[0])
    if data.half - longest - int(np.count_nonzero(chosen.prior == PRIOR)) - q < SPARE:
        longest = n_lags
    seen = past_basis(data.y[: data.n_healthy], lags=longest, edge=EDGE)[0]
    unseen = np.linalg.qr(seen, mode="complete")[0][:, seen.shape[1] :]
    first = max(chosen.first, longest)
    past = lagged(data.y, range(1, longest + 1), first=first) @ unseen
    basis = np.pad(chosen.basis, ((0, (longest - n_lags) * q), (0, 0)))
    later = first - chosen.first
    return _LaggedRows(
        X=np.hstack([chosen.X[later:], past]),
        Y=chosen.Y[later:],
        prior=np.append(chosen.prior, np.full(unseen.shape[1], 1.0 / UNSEEN_SD)),
        basis=np.hstack([basis, unseen]),
        first=first,
    )


def _scaled(samples: DecimatedRecord, channels: Sequence[int]) -> _Scaled:
    n = int(np.count_nonzero(samples.healthy))
    y = samples.y[:, list(channels)] - samples.y[:n, list(channels)].mean(axis=0)
    u = samples.u - samples.u[:n].mean(axis=0)
    extent, spread = np.abs(u).max(axis=0, initial=0.0), u[:n].std(axis=0)
    u = u / np.where(spread > STILL * extent, spread, np.where(extent > 0.0, extent, 1.0))
    spread = y[:n].std(axis=0)
    spread = np.where(spread > 0.0, spread, np.maximum(np.abs(y).max(axis=0), np.finfo(float).tiny))
    # The noise is what one lag of all channels leaves of each.
    scaled = y[:n] / spread
    X = np.hstack([np.ones((n - 1, 1)), lagged(scaled, [1]), u[1:n]])
    left = scaled[1:] - X @ np.linalg.lstsq(X, scaled[1:], rcond=None)[0]
    noise_sd = np.sqrt(np.sum(left**2, axis=0) / max(len(X) - X.shape[1], 1))
    unit = spread * np.maximum(noise_sd, RELATIVE_FLOOR)
    return _Scaled(y=y / unit, u=u, weak=samples.weak, kept=samples.healthy | samples.watched, n_healthy=n, unit=unit)


def _score(data: _Scaled, lags: int, rank: int, *, forgetting: float) -> float:
    rows = _rows(data, lags, rank)
    healthy = slice(data.n_healthy - rows.first)
    start = data.half - rows.first
    X, Y = rows.X[healthy], rows.Y[healthy]
    return predictive_score(recursive_residuals(X, Y, start=start, forgetting=forgetting, prior=rows.prior))


def _rows(data: _Scaled, lags: int, rank: int) -> _LaggedRows:
    first = max(lags, INPUT_LAGS)
    basis, spread = past_basis(data.y[: data.n_healthy], lags=lags, rank=rank)
    basis = basis / spread
    past = lagged(data.y, range(1, lags + 1), first=first) @ basis
    inputs = lagged(data.u, range(INPUT_LAGS + 1), first=first) if data.u.shape[1] else np.zeros((len(past), 0))
    X = np.hstack([np.ones((len(past), 1)), inputs, past])
    prior = np.full(X.shape[1], PRIOR)
    prior[1 : 1 + inputs.shape[1]][np.tile(data.weak, INPUT_LAGS + 1)] = 1.0 / UNSEEN_SD
    return _LaggedRows(X=X, Y=data.y[first:], prior=prior, basis=basis, first=first)
