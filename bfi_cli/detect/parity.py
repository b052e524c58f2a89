"""Detection by parity residuals: predict the watched channels, declare the one that fails, monitor the others.

The residuals are those of a regression on the past, chosen on the healthy time by how well it predicts. The channel is
declared whose failure explains most of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..kernels import FloatArray
from ..kernels.exponential_tail import block_maxima, fit_tail, white_excess, white_level
from ..kernels.lagged import lagged
from ..kernels.parity import Drops, StepHeight, largest_drops, past_basis, step_height
from ..kernels.recursive_least_squares import PRIOR, RecursiveResiduals, predictive_score, recursive_residuals
from ..kernels.running import running_weights
from .preparation import DecimatedRecord

# A step is sought among the onsets of the last rows, or of the last second if that is more: a failure that shows later
# is detected as a step with a later onset.
SHORTEST_WINDOW, WINDOW_S = 10, 1.0
# Rows a deviate has to last: a gust is over in one, a failure is not (docs/theory.md, 11.2).
LASTING = 2
# Errors whose running size, over PATCH_S to each side, spreads by more are no white noise of one size: gusts came and
# went. It spreads by 1.15 at most in 150 flights of the simulated Boeing 747 with white noise, by 1.41 at least in 188
# runs on two recorded flights.
UNEQUAL = 1.3
# In gusts: seconds whose typical error enlarges the variance, and rows a deviate has to last. Chosen together with the
# factor below on two recorded flights, with four choices of channels (docs/theory.md, 11.3).
PATCH_S, LASTING_IN_GUSTS = 10.0, 3
# Factor on the level in gusts, for those the healthy time has not met. Of a hundred healthy windows one exceeds 1.12
# times the level of its own healthy time on one recorded flight, 1.32 times on the other, 1.20 times on both together;
# at the rate of their recorder 1.00, 1.32 and 1.15 times (tests/measurements/test_detect_recorded).
UNSEEN_GUSTS = 1.2
# Factor on the level of white noise. With it 1 of 400 healthy flights of the Boeing 747 alarms (docs/validation.md).
ALLOWANCE = 1.1
# Quantile of the held-back deviates by which a channel is scaled (docs/theory.md, 11.3).
HIGH = 0.95
# Independent onsets in the window of a row, of which the largest deviate of white noise is the maximum.
WHITE_ONSETS = 3.0
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
    lags, rank, forgetting : samples of the past, directions of it, weight of a row relative to the next.
    basis : (at least lags * n_outputs, r) maps the stacked past to the last r regressors.
    unit : (n_outputs,) standard deviation of the noise, the unit of the errors.
    X, Y : (n_rows, n_regressors) and (n_rows, n_outputs), the regression.
    """

    samples: NDArray[np.intp]
    n_healthy: int
    lags: int
    rank: int
    forgetting: float
    basis: FloatArray
    unit: FloatArray
    errors: RecursiveResiduals
    X: FloatArray
    Y: FloatArray


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
class _Rows:
    """Regressors [1 | inputs | components of the past] and outputs, from sample `first` on.

    `prior` is one over the standard deviation to which each coefficient is known, see `recursive_residuals`; `basis`
    maps the stacked past to its components.
    """

    X: FloatArray
    Y: FloatArray
    prior: FloatArray
    basis: FloatArray
    first: int


def fit_predictor(path: str, samples: DecimatedRecord, channels: Sequence[int]) -> Predictor:
    """Predict the channels, each row from the rows before it.

    Past and forgetting are those with which the second half of the healthy time is predicted best.

    Parameters
    ----------
    path : of the log, for messages.
    channels : which outputs are watched; the others are no regressors either.

    Raises
    ------
    LogError : the healthy time is too short for any model.
    """
    data = _scaled(samples, channels)
    # Lags and rank that half of the healthy time can fit: short pasts whole, long ones without their null space.
    pasts = []
    for lags in (*SHORT_PASTS, *LONG_PASTS):
        spare = data.half - max(lags, INPUT_LAGS) - _n_regressors(data, 0) - len(channels) - SPARE
        if spare > 0:
            edge = 0.0 if lags in SHORT_PASTS else EDGE
            rank = past_basis(data.y[: data.n_healthy], lags=lags, edge=edge)[0].shape[1]
            if 0 < rank <= spare:
                pasts.append((lags, rank))
    if not pasts:
        needed = 2 * (INPUT_LAGS + _n_regressors(data, len(channels)) + len(channels) + SPARE)
        raise LogError(
            f"{path}: the healthy time has {data.n_healthy} samples at {samples.rate_hz:.4g} Hz, {needed} are needed; "
            "give a longer --train, a higher --rate, or fewer channels"
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
        lags=lags,
        rank=rank,
        forgetting=forgetting,
        basis=rows.basis,
        unit=data.unit,
        errors=recursive_residuals(X, Y, start=data.half - rows.first, forgetting=forgetting, prior=rows.prior),
        X=X,
        Y=Y,
    )


def _with_unseen(data: _Scaled, chosen: _Rows) -> _Rows:
    """Return the rows with one more regressor per direction in which a long healthy past did not stand out of noise.

    The healthy time does not tell how the outputs depend on such a direction, and noise in the regressors makes the
    dependence look like zero. With a coefficient known to UNSEEN_SD only, a prediction becomes less certain the further
    the past moves along the direction, and the coefficient is learnt then.
    """
    q = data.y.shape[1]
    own = len(chosen.basis) // q
    longest = max(own, LONG_PASTS[0])
    if data.half - longest - int(np.count_nonzero(chosen.prior == PRIOR)) - q < SPARE:
        longest = own
    seen = past_basis(data.y[: data.n_healthy], lags=longest, edge=EDGE)[0]
    unseen = np.linalg.qr(seen, mode="complete")[0][:, seen.shape[1] :]
    first = max(chosen.first, longest)
    past = lagged(data.y, range(1, longest + 1), first=first) @ unseen
    basis = np.pad(chosen.basis, ((0, (longest - own) * q), (0, 0)))
    later = first - chosen.first
    return _Rows(
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


def _n_regressors(data: _Scaled, rank: int) -> int:
    return 1 + (INPUT_LAGS + 1) * int(np.count_nonzero(~data.weak)) + rank


def _score(data: _Scaled, lags: int, rank: int, *, forgetting: float) -> float:
    rows = _rows(data, lags, rank)
    healthy = slice(data.n_healthy - rows.first)
    start = data.half - rows.first
    X, Y = rows.X[healthy], rows.Y[healthy]
    return predictive_score(recursive_residuals(X, Y, start=start, forgetting=forgetting, prior=rows.prior))


def _rows(data: _Scaled, lags: int, rank: int) -> _Rows:
    first = max(lags, INPUT_LAGS)
    basis, spread = past_basis(data.y[: data.n_healthy], lags=lags, rank=rank)
    basis = basis / spread
    past = lagged(data.y, range(1, lags + 1), first=first) @ basis
    inputs = lagged(data.u, range(INPUT_LAGS + 1), first=first) if data.u.shape[1] else np.zeros((len(past), 0))
    X = np.hstack([np.ones((len(past), 1)), inputs, past])
    prior = np.full(X.shape[1], PRIOR)
    prior[1 : 1 + inputs.shape[1]][np.tile(data.weak, INPUT_LAGS + 1)] = 1.0 / UNSEEN_SD
    return _Rows(X=X, Y=data.y[first:], prior=prior, basis=basis, first=first)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionThreshold:
    """The deviate above which a channel is declared, and where it comes from.

    Attributes
    ----------
    level : (n_outputs,).
    white : the level of white noise; tail : that of the held-back deviates, None where they are too few to tell.
    gusts : factor on both where the errors change in size, 1 where they do not.
    scale : (n_outputs,) factors on it.
    maxima : (n_blocks,) largest scaled deviates of blocks of the held-back rows.
    """

    level: FloatArray
    white: float
    tail: float | None
    gusts: float
    scale: FloatArray
    maxima: FloatArray

    @property
    def common(self) -> float:
        """The level before it is scaled for a channel."""
        return self.gusts * max(self.white, self.tail or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MonitoringPass:
    """One pass over the record with some of the channels.

    Attributes
    ----------
    channels : indices of the outputs watched.
    drops : whose deviate is the least one over as many rows as it has to last, those whose older steps it tells.
    window : rows in which a step is sought.
    decided : (n,) the rows of the drops on which this pass decided, up to the one of its failure.
    """

    channels: tuple[int, ...]
    model: Predictor
    drops: Drops
    threshold: DetectionThreshold
    window: int
    decided: NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A channel that fails: index of the output, samples of decision and onset, deviate and its level.

    `size` and `ci95` are of the step, in SI; None where the record does not determine it.
    """

    output: int
    sample: int
    onset: int
    deviate: float
    level: float
    size: float | None
    ci95: tuple[float, float] | None


def detect_sequentially(
    path: str, samples: DecimatedRecord, *, false_alarm: float, report: Callable[[int, int], None]
) -> tuple[list[Failure], list[MonitoringPass]]:
    """Monitor all channels until one fails, then the others from there on, until none fails any more.

    Raises
    ------
    LogError : the healthy time is too short for any model.
    """
    channels = list(range(samples.y.shape[1]))
    window = max(SHORTEST_WINDOW, round(WINDOW_S * samples.rate_hz))
    failures: list[Failure] = []
    passes: list[MonitoringPass] = []
    while channels:
        report(len(passes), samples.y.shape[1])
        model = fit_predictor(path, samples, channels)
        patch = round(PATCH_S * samples.rate_hz)
        weights = running_weights(model.errors.residual, patch)
        gusty = bool(weights.max() > UNEQUAL * weights.min())
        lasting = LASTING_IN_GUSTS if gusty else LASTING
        patch = patch if gusty else 0
        drops = largest_drops(model.errors, model.basis, window=window, patch=patch, n_old=lasting)
        # The deviate that counts is the least one over the last rows.
        padded = np.vstack([np.zeros((lasting - 1, len(channels))), drops.deviate])
        drops = replace(drops, deviate=np.lib.stride_tricks.sliding_window_view(padded, lasting, axis=0).min(axis=2))
        threshold = _threshold(model, drops, window, false_alarm, gusts=UNSEEN_GUSTS if gusty else 1.0)
        # The first row, after the onset of the failure before, whose deviate is above its level.
        at = model.samples[model.errors.start :]
        begin = failures[-1].onset if failures else 0
        decided = np.flatnonzero((np.arange(len(at)) >= model.n_healthy - model.errors.start) & (at >= begin))
        above = decided[(drops.deviate[decided] > threshold.level).any(axis=1)]
        passes.append(
            MonitoringPass(
                channels=tuple(channels),
                model=model,
                drops=drops,
                threshold=threshold,
                window=window,
                decided=decided[decided <= above[0]] if above.size else decided,
            )
        )
        if not above.size:
            break
        row = int(above[0])
        k = int(drops.deviate[row].argmax())
        height = _height(samples, model, row - int(drops.age[row, k]), k)
        failures.append(
            Failure(
                output=channels.pop(k),
                sample=int(at[row]),
                onset=int(at[row] - drops.age[row, k]),
                deviate=float(drops.deviate[row, k]),
                level=float(threshold.level[k]),
                size=None if height is None else height.height * float(model.unit[k]),
                ci95=None
                if height is None
                else (height.low * float(model.unit[k]), height.high * float(model.unit[k])),
            )
        )
    return failures, passes


def _height(samples: DecimatedRecord, model: Predictor, onset: int, output: int) -> StepHeight | None:
    """Return the height of a step in one of the watched outputs; None where the record does not determine it.

    What goes on growing is no step and has no height: it is told over one stretch after the onset, and must be the same
    over the next where the record has one.

    Parameters
    ----------
    onset : row of the errors at which it begins to show; the filters smear it over `smear_s` to each side.
    """
    start, smear = model.errors.start, int(np.ceil(samples.smear_s * samples.rate_hz)) + 1
    begin, n_shared = start + onset - smear, max(SHORTEST_WINDOW, round(WINDOW_S * samples.rate_hz))

    def height_after(n_free: int) -> StepHeight | None:
        rows = model.samples[max(begin, 0) : begin + n_free + n_shared]
        if begin <= start or len(rows) < n_free + n_shared or rows[-1] - rows[0] >= len(rows):
            return None
        return step_height(
            model.X,
            model.Y,
            model.errors.coefficients,
            model.basis,
            start=start,
            begin=begin,
            n_free=n_free,
            n_shared=n_shared,
            output=output,
        )

    first, then = height_after(2 * smear), height_after(2 * smear + n_shared)
    if first is None or then is None:
        return first
    apart = np.hypot(first.high - first.height, then.high - then.height)
    return first if abs(first.height - then.height) <= apart else None


def _threshold(model: Predictor, drops: Drops, window: int, false_alarm: float, *, gusts: float) -> DetectionThreshold:
    """Return the level of white noise, or that of the held-back deviates where these are heavier, times `gusts`."""
    n_held = model.n_healthy - model.errors.start
    n_watched, q = len(drops.deviate) - n_held, drops.deviate.shape[1]
    white = ALLOWANCE * white_level(max(n_watched, 1) * q * window, false_alarm)
    held = drops.deviate[min(window, n_held) : n_held]
    usual = white_level(WHITE_ONSETS, 1.0 - HIGH)
    scale = np.maximum(np.quantile(held, HIGH, axis=0) / usual, 1.0) if len(held) else np.ones(q)
    maxima = block_maxima(held / scale, window)
    tail = fit_tail(maxima, white=white_excess(WHITE_ONSETS * q * window))
    if tail is None:
        reached = np.maximum(ALLOWANCE * held.max(axis=0, initial=0.0) / white, 1.0)
        scale, level = reached, None
    else:
        level = tail.level(false_alarm / max(n_watched / window, 1.0))
    return DetectionThreshold(
        level=scale * (gusts * max(white, level or 0.0)),
        white=white,
        tail=level,
        gusts=gusts,
        scale=scale,
        maxima=maxima,
    )
