"""What was analysed and by which model, as every result states it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...epoch import Epoch
from ...kernels import FloatArray

# Rows whose squares are taken at once, for memory.
AT_ONCE = 262_144


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSummary:
    """The analysed window: `rate_hz` and `n_samples` are those of the analysis, times are on the log's own axis.

    `clock` is the moment from which they count, see `Epoch.iso`; None for a log without a clock.
    """

    path: str
    rate_hz: float
    n_samples: int
    start_s: float
    stop_s: float
    native_rate_hz: float
    clock: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSummary:
    """The model behind a result; `orders` and `criterion_...` are the order selection curve, empty for one order."""

    order: int
    rate_hz: float
    feedthrough: bool
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    noise_sd: Mapping[str, float]
    orders: tuple[int, ...] = ()
    criterion_no_fault: tuple[float, ...] = ()
    criterion_best: tuple[float, ...] = ()


def log_summary(
    path: str, time_s: FloatArray, *, rate_hz: float, native_rate_hz: float, epoch: Epoch | None
) -> LogSummary:
    """Return the summary of a window with the samples `time_s` at the rate of the analysis."""
    return LogSummary(
        path=path,
        rate_hz=rate_hz,
        n_samples=len(time_s),
        start_s=float(time_s[0]),
        stop_s=float(time_s[-1]),
        native_rate_hz=native_rate_hz,
        clock=None if epoch is None else epoch.iso,
    )


def noise_of(error: FloatArray, outputs: Sequence[str]) -> dict[str, float]:
    """Return by output the standard deviation of the prediction error of a model, (n_rows, n_outputs)."""
    squares = [np.sum(error[k : k + AT_ONCE] ** 2, axis=0) for k in range(0, len(error), AT_ONCE)]
    return dict(zip(outputs, np.sqrt(np.sum(squares, axis=0) / len(error)).tolist(), strict=True))
