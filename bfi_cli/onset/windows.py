"""Calibration tables, the statistics of a scan without a fault: of simulated records, or of windows of logs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..calibration import FEWEST_WINDOWS, CalibrationSettings, CalibrationTable
from ..config import Config, merge
from ..errors import LogError
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels.lagged import lagged
from ..kernels.progress import Report, parts, silent
from .scan_record import ScanRecord, prepare_record
from .sweep import Sweep, sweep

__all__ = ["Windows", "calibration_windows", "earlier_windows", "gaussian_table", "table_of_windows", "windows_of"]

FloatArray = NDArray[np.float64]
Windows = list[tuple[float, float]]

# Simulated records of a Gaussian table: twice the fewest windows that a table needs.
TRIALS = 40
# Largest modulus of a pole of the simulated model: a fitted one may grow slightly where the true one does not.
STABLE = 0.999
# Length of the windows of a calibration where none is given: that of the shipped tables.
LENGTH_S = 120.0
# Windows that a sample of the log's earlier part belongs to: they give more statistics than windows apart.
OVERLAPPING = 4


def gaussian_table(record: ScanRecord, order: int, *, seed: int, report: Report = silent) -> CalibrationTable:
    """Return the table of records simulated with the model fitted without a fault and white Gaussian errors.

    Parameters
    ----------
    record : its inputs are kept.
    order : of the model, and of the scans.
    seed : of the errors.
    report : told how far it is.
    """
    rng = np.random.default_rng(seed)
    model = record.without_fault(record.y, order)
    n_outputs = record.y.shape[1]
    first = 0 if record.feedthrough else 1
    X = np.hstack([np.ones((len(model.error), 1)), lagged(record.u, range(first, order + 1), first=order)])
    driven, past = X @ model.coefficients[: X.shape[1]], model.coefficients[X.shape[1] :]
    _, scale, axes = np.linalg.svd(model.error / np.sqrt(len(model.error)), full_matrices=False)
    # The output lags are shrunk, lag by lag, until the recursion does not grow.
    companion = np.eye(order * n_outputs, k=-n_outputs)
    companion[:n_outputs] = past.T
    radius = float(np.abs(np.linalg.eigvals(companion)).max())
    shrink = min(1.0, STABLE / radius) if radius > 1.0 else 1.0
    past = past * np.repeat(shrink ** np.arange(1, order + 1), n_outputs)[:, None]
    sweeps = []
    with threadpool_limits(1):
        for _, own in parts(report, range(TRIALS)):
            expected = driven + rng.standard_normal(model.error.shape) @ (scale[:, None] * axes)
            y = record.y.copy()
            for k in range(order, len(y)):
                y[k] = expected[k - order] + y[k - 1 :: -1][:order].reshape(-1) @ past
            sweeps.append(sweep(record, y, order, own))
    return _table(record.settings, sweeps, ("simulated",))


def calibration_windows(logs: Sequence[FlightLog], config: Config) -> list[tuple[FlightLog, tuple[float, float]]]:
    """Return log, start and end of every window of a calibration, of the length and the step of the configuration."""
    parts_of_logs = [log.window(config.window.from_s, config.window.to_s) for log in logs]
    shortest_s = min(part.n_samples / part.rate_hz for part in parts_of_logs)
    length_s = config.calibrate.length_s or min(LENGTH_S, shortest_s)
    step_s = config.calibrate.step_s or 0.5 * length_s
    return [(log, window) for log in logs for window in windows_of(log, config, length_s=length_s, step_s=step_s)]


def windows_of(log: FlightLog, config: Config, *, length_s: float, step_s: float) -> Windows:
    """Return (from_s, to_s) of the windows of a length that fit between the configured start and end."""
    part = log.window(config.window.from_s, config.window.to_s)
    first = float(part.time_s[0])
    return _tiles(first, float(part.time_s[-1]) + 1.0 / part.rate_hz - first, length_s, step_s)


def earlier_windows(log: FlightLog, config: Config) -> Windows:
    """Return windows of the analysed length in the part of the log before the analysed window.

    Raises
    ------
    LogError : there are too few.
    """
    part = log.window(config.window.from_s, config.window.to_s)
    length_s, first = part.n_samples / part.rate_hz, float(log.time_s[0])
    before = float(part.time_s[0]) - first
    windows = _tiles(first, before, length_s, length_s / OVERLAPPING)
    if len(windows) < FEWEST_WINDOWS:
        needed = (1.0 + (FEWEST_WINDOWS - 1) / OVERLAPPING) * length_s
        raise LogError(
            f"{log.path}: --calibration self needs {needed:.4g} s before the window, got {before:.4g} s; "
            "choose a later --from or a shorter window, or give a table of bfi calibrate"
        )
    return windows


def _tiles(first: float, duration_s: float, length_s: float, step_s: float) -> Windows:
    n = int(np.floor((duration_s - length_s) / step_s + 1e-9)) + 1  # 1e-9 of a step is round-off in the times
    return [(first + i * step_s, first + i * step_s + length_s) for i in range(n)]


def table_of_windows(
    pieces: Sequence[tuple[FlightLog, tuple[float, float]]],
    config: Config,
    report: Report = silent,
) -> CalibrationTable:
    """Return the table of windows of logs that hold no fault; those that cannot be analysed are counted.

    Parameters
    ----------
    pieces : log, and start and end of the window on its axis.
    report : told how far it is.

    Raises
    ------
    LogError : none can; the reason is that of the last.
    """
    settings: CalibrationSettings | None = None
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


def _table(
    settings: CalibrationSettings, sweeps: list[Sweep], logs: tuple[str, ...], n_unusable: int = 0
) -> CalibrationTable:
    return CalibrationTable(
        settings=settings,
        statistics={shape: frozen_array([one.of(shape).statistic for one in sweeps]) for shape in settings.shapes},
        logs=logs,
        n_unusable=n_unusable,
    )
