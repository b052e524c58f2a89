"""The statistic without a fault: from simulated records, or from windows of logs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..calibration import FEWEST_WINDOWS
from ..calibration import CalibrationSettings as Settings
from ..calibration import CalibrationTable as Table
from ..config import Config, merge
from ..errors import LogError
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels.lagged import lagged
from ..kernels.progress import Report, parts, silent
from .record import ScanRecord, prepare_record
from .sweep import Sweep, sweep

__all__ = ["Windows", "earlier_windows", "gaussian_table", "table_of_windows", "windows_of"]

FloatArray = NDArray[np.float64]
Windows = list[tuple[float, float]]

TRIALS = 40
STABLE = 0.999
OVERLAPPING = 4


def gaussian_table(record: ScanRecord, order: int, *, seed: int, report: Report = silent) -> Table:
    """Return the table of records simulated with the model fitted without a fault and white Gaussian errors.

    Parameters
    ----------
    record : its inputs are kept.
    order : of the model, and of the scans.
    seed : of the errors.
    report : told how far it is.
    """
    rng = np.random.default_rng(seed)
    model = _fitted(record, order)
    with threadpool_limits(1):
        sweeps = [
            sweep(record, _simulated(record, model, order, rng), order, own) for _, own in parts(report, range(TRIALS))
        ]
    return _table(record.settings, sweeps, ("simulated",))


def _fitted(record: ScanRecord, order: int) -> tuple[FloatArray, FloatArray]:
    """Return coefficients (n_regressors, n_outputs) on [1, input lags, output lags], and the residuals."""
    X = np.hstack([_driven(record, order), lagged(record.y, range(1, order + 1))])
    coefficients = np.asarray(np.linalg.lstsq(X, record.y[order:], rcond=None)[0], dtype=np.float64)
    return coefficients, record.y[order:] - X @ coefficients


def _driven(record: ScanRecord, order: int) -> FloatArray:
    first = 0 if record.feedthrough else 1
    return np.hstack([np.ones((len(record.y) - order, 1)), lagged(record.u, range(first, order + 1), first=order)])


def _simulated(
    record: ScanRecord, model: tuple[FloatArray, FloatArray], order: int, rng: np.random.Generator
) -> FloatArray:
    coefficients, error = model
    n_outputs = error.shape[1]
    past = coefficients[-order * n_outputs :]
    driven = _driven(record, order) @ coefficients[: -order * n_outputs]
    root = np.linalg.svd(error / np.sqrt(len(error)), full_matrices=False)
    driven += rng.standard_normal(error.shape) @ (root[1][:, None] * root[2])
    past = _stabilised(past, order)
    y = record.y.copy()
    for k in range(order, len(y)):
        y[k] = driven[k - order] + y[k - 1 :: -1][:order].reshape(-1) @ past
    return y


def _stabilised(past: FloatArray, order: int) -> FloatArray:
    """Shrink (order * n_outputs, n_outputs) coefficients, lag by lag, until the recursion does not grow."""
    n = past.shape[1]
    companion = np.eye(order * n, k=-n)
    companion[:n] = past.T
    radius = float(np.abs(np.linalg.eigvals(companion)).max())
    shrink = min(1.0, STABLE / radius) if radius > 1.0 else 1.0
    return past * np.repeat(shrink ** np.arange(1, order + 1), n)[:, None]


def windows_of(log: FlightLog, config: Config, *, length_s: float, step_s: float) -> Windows:
    """Return (from_s, to_s) of the windows of a length that fit between the configured start and end."""
    part = log.window(config.window.from_s, config.window.to_s)
    first, last = float(part.time_s[0]), float(part.time_s[-1]) + 1.0 / part.rate_hz
    n = int(np.floor((last - first - length_s) / step_s + 1e-9)) + 1
    return [(first + i * step_s, first + i * step_s + length_s) for i in range(n)]


def earlier_windows(log: FlightLog, config: Config) -> Windows:
    """Return windows of the analysed length in the part of the log before the analysed window.

    Raises
    ------
    LogError : there are too few.
    """
    part = log.window(config.window.from_s, config.window.to_s)
    length_s = part.n_samples / part.rate_hz
    before = float(part.time_s[0]) - float(log.time_s[0])
    step_s = length_s / OVERLAPPING
    n = int(np.floor((before - length_s) / step_s + 1e-9)) + 1
    if n < FEWEST_WINDOWS:
        needed = (1.0 + (FEWEST_WINDOWS - 1) / OVERLAPPING) * length_s
        raise LogError(
            f"{log.path}: --calibration self needs {needed:.4g} s before the window, got {before:.4g} s; "
            "choose a later --from or a shorter window, or give a table of bfi calibrate"
        )
    first = float(log.time_s[0])
    return [(first + i * step_s, first + i * step_s + length_s) for i in range(n)]


def table_of_windows(
    pieces: Sequence[tuple[FlightLog, tuple[float, float]]],
    config: Config,
    report: Report = silent,
) -> Table:
    """Return the table of windows of logs that hold no fault; those that cannot be analysed are counted.

    Parameters
    ----------
    pieces : log, and start and end of the window on its axis.
    report : told how far it is.

    Raises
    ------
    LogError : none can; the reason is that of the last.
    """
    settings: Settings | None = None
    sweeps: list[Sweep] = []
    names: dict[str, None] = {}
    n_unusable = 0
    problem: LogError | None = None
    for (log, (from_s, to_s)), own in parts(report, pieces):
        try:
            record = prepare_record(log, merge(config, {"window": {"from_s": from_s, "to_s": to_s}}))
            if settings is not None and record.settings.orders != settings.orders:
                raise LogError(f"{log.path}: the window from {from_s:g} s is shorter than the others")
            with threadpool_limits(1):
                sweeps.append(sweep(record, record.y, report=own))
        except LogError as unusable:
            n_unusable, problem = n_unusable + 1, unusable
            continue
        settings = settings or record.settings
        names[Path(log.path).name] = None
    if settings is None:
        raise problem or LogError("calibration: no window; give a longer log or shorter windows")
    return _table(settings, sweeps, tuple(names), n_unusable)


def _table(settings: Settings, sweeps: list[Sweep], logs: tuple[str, ...], n_unusable: int = 0) -> Table:
    return Table(
        settings=settings,
        statistics={shape: frozen_array([one.of(shape).statistic for one in sweeps]) for shape in settings.shapes},
        logs=logs,
        n_unusable=n_unusable,
    )
