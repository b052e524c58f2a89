"""The form for noisy records: watch the parity residuals, declare the channel whose failure explains most, go on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.exponential_tail import block_maxima, fit_tail, white_excess, white_level
from ..kernels.parity import Drops, largest_drops
from .model import Predicted, predicted
from .record import Sampled

__all__ = ["Failure", "Threshold", "Watched", "watch"]

FloatArray = NDArray[np.float64]

SHORTEST_WINDOW, WINDOW_S = 10, 1.0
RECENT = 60
LASTING = 2
ALLOWANCE = 1.1
HIGH = 0.95
WHITE_ONSETS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Threshold:
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
class Watched:
    """One pass over the record with some of the channels.

    Attributes
    ----------
    channels : indices of the outputs watched; window : rows a step is looked back for.
    """

    channels: tuple[int, ...]
    model: Predicted
    drops: Drops
    threshold: Threshold
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


def watch(
    path: str, samples: Sampled, *, false_alarm: float, report: Callable[[int, int], None]
) -> tuple[list[Failure], list[Watched]]:
    """Watch all channels until one fails, then the others from there on, until none fails any more.

    Raises
    ------
    LogError : the healthy time is too short for any model.
    """
    channels = list(range(samples.y.shape[1]))
    failures: list[Failure] = []
    passes: list[Watched] = []
    begin = 0
    while channels:
        report(len(passes), samples.y.shape[1])
        passes.append(_passed(path, samples, channels, false_alarm))
        failure = _first_failure(passes[-1], begin)
        if failure is None:
            break
        failures.append(failure)
        begin = failure.onset
        channels.remove(failure.output)
    return failures, passes


def _passed(path: str, samples: Sampled, channels: Sequence[int], false_alarm: float) -> Watched:
    model = predicted(path, samples, channels)
    window = max(SHORTEST_WINDOW, round(WINDOW_S * samples.rate_hz))
    drops = largest_drops(model.errors, model.basis, window=window, recent=RECENT)
    drops = replace(drops, deviate=_lasting(drops.deviate))
    return Watched(
        channels=tuple(channels),
        model=model,
        drops=drops,
        threshold=_threshold(model, drops, window, false_alarm),
        window=window,
    )


def _lasting(deviate: FloatArray) -> FloatArray:
    """Return the least deviate of each channel over the last rows: a gust is over in a row, a failure is not."""
    held = np.vstack([np.zeros((LASTING - 1, deviate.shape[1])), deviate])
    return np.asarray(np.lib.stride_tricks.sliding_window_view(held, LASTING, axis=0).min(axis=2))


def _threshold(model: Predicted, drops: Drops, window: int, false_alarm: float) -> Threshold:
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
        return Threshold(level=white * reached, white=white, tail=None, scale=reached, maxima=maxima)
    level = tail.level(max(n_watched / window, 1.0), false_alarm)
    return Threshold(level=scale * max(level, white), white=white, tail=level, scale=scale, maxima=maxima)


def _first_failure(seen: Watched, begin: int) -> Failure | None:
    """Return the first time after sample `begin` at which a deviate is above its level; its size is told after that."""
    model, drops = seen.model, seen.drops
    at = model.samples[model.errors.start :]
    watched = (np.arange(len(at)) >= model.n_healthy - model.errors.start) & (at >= begin)
    above = np.flatnonzero(watched & (drops.deviate > seen.threshold.level).any(axis=1))
    if not above.size:
        return None
    row = int(above[0])
    k = int(drops.deviate[row].argmax())
    clearest = row + int(drops.deviate[row : row + seen.window, k].argmax())
    return Failure(
        output=seen.channels[k],
        sample=int(at[row]),
        onset=int(at[row] - drops.age[row, k]),
        deviate=float(drops.deviate[row, k]),
        level=float(seen.threshold.level[k]),
        size=float(drops.size[clearest, k] * model.unit[k]),
    )
