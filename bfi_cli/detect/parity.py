"""Detection by parity residuals: declare the channel whose failure explains most of them, then monitor the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..kernels import FloatArray
from ..kernels.exponential_tail import block_maxima, fit_tail, white_excess, white_level
from ..kernels.parity import Drops, largest_drops
from .predictor import Predictor, fit_predictor
from .preparation import DecimatedRecord

__all__ = ["DetectionThreshold", "Failure", "MonitoringPass", "detect_sequentially"]

# Rows and seconds that a step is looked back for: a failure that shows later is found by later onsets.
SHORTEST_WINDOW, WINDOW_S = 10, 1.0
# Rows a deviate has to last: a gust is over in one, a failure is not (docs/theory.md, 11.2).
LASTING = 2
# On the level of white noise. With it 1 of 400 healthy flights of the Boeing 747 alarms (docs/validation.md).
ALLOWANCE = 1.1
# Quantile of the held-back deviates by which a channel is scaled (docs/theory.md, 11.3).
HIGH = 0.95
# Independent onsets in the window of a row, of which the largest deviate of white noise is the maximum.
WHITE_ONSETS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionThreshold:
    """The deviate above which a channel is declared, and where it comes from.

    Attributes
    ----------
    level : (n_outputs,).
    white : the level of white noise; tail : that of the held-back deviates, None where they are no heavier.
    scale : (n_outputs,) factors on it.
    maxima : (n_blocks,) largest scaled deviates of blocks of the held-back rows.
    """

    level: FloatArray
    white: float
    tail: float | None
    scale: FloatArray
    maxima: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MonitoringPass:
    """One pass over the record with some of the channels.

    Attributes
    ----------
    channels : indices of the outputs watched; window : rows a step is looked back for.
    """

    channels: tuple[int, ...]
    model: Predictor
    drops: Drops
    threshold: DetectionThreshold
    window: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A channel declared: index of the output, sample of the decision, of the onset, deviate, its level, step in SI."""

    output: int
    sample: int
    onset: int
    deviate: float
    level: float
    size: float


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
        drops = largest_drops(model.errors, model.basis, window=window)
        # The deviate that counts is the least one over the last rows.
        padded = np.vstack([np.zeros((LASTING - 1, len(channels))), drops.deviate])
        drops = replace(drops, deviate=np.lib.stride_tricks.sliding_window_view(padded, LASTING, axis=0).min(axis=2))
        threshold = _threshold(model, drops, window, false_alarm)
        passes.append(
            MonitoringPass(channels=tuple(channels), model=model, drops=drops, threshold=threshold, window=window)
        )
        failure = _first_failure(passes[-1], failures[-1].onset if failures else 0)
        if failure is None:
            break
        failures.append(failure)
        channels.remove(failure.output)
    return failures, passes


def _threshold(model: Predictor, drops: Drops, window: int, false_alarm: float) -> DetectionThreshold:
    """Return the level of white noise, or that of the held-back deviates where these are significantly heavier."""
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
        return DetectionThreshold(level=white * reached, white=white, tail=None, scale=reached, maxima=maxima)
    level = tail.level(max(n_watched / window, 1.0), false_alarm)
    return DetectionThreshold(level=scale * max(level, white), white=white, tail=level, scale=scale, maxima=maxima)


def _first_failure(monitored: MonitoringPass, begin: int) -> Failure | None:
    """Return the first time after sample `begin` at which a deviate is above its level; its size is told after that."""
    model, drops = monitored.model, monitored.drops
    at = model.samples[model.errors.start :]
    watched = (np.arange(len(at)) >= model.n_healthy - model.errors.start) & (at >= begin)
    above = np.flatnonzero(watched & (drops.deviate > monitored.threshold.level).any(axis=1))
    if not above.size:
        return None
    row = int(above[0])
    k = int(drops.deviate[row].argmax())
    clearest = row + int(drops.deviate[row : row + monitored.window, k].argmax())
    return Failure(
        output=monitored.channels[k],
        sample=int(at[row]),
        onset=int(at[row] - drops.age[row, k]),
        deviate=float(drops.deviate[row, k]),
        level=float(monitored.threshold.level[k]),
        size=float(drops.size[clearest, k] * model.unit[k]),
    )
