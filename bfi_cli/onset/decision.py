"""The null distribution a decision rests on, how it is counted, and whether a scan stands out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ..calibration import (
    FEWEST_WINDOWS,
    CalibrationSettings,
    CalibrationTable,
    Null,
    differences,
    load_tables,
    nearest,
    null_of,
)
from ..config import Config, merge
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels.lagged import lagged
from ..kernels.progress import Report, parts, silent
from .result import CalibrationUse
from .scan import HypothesisScan, Peak, bic_change, scan_hypotheses
from .scan_record import ScanRecord, prepare_record

Windows = list[tuple[float, float]]

SHIPPED = "shipped.json"
# Simulated records of a Gaussian table: twice the fewest windows that a table needs.
TRIALS = 2 * FEWEST_WINDOWS
# Largest modulus of a pole of the simulated model: a fitted one may grow slightly where the true one does not.
STABLE = 0.999
# Length of the windows of a calibration where none is given: that of the shipped tables.
LENGTH_S = 120.0
# Windows that a sample of the log's earlier part belongs to: they give more statistics than windows apart.
OVERLAPPING = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdict:
    """The decision on a scan.

    Attributes
    ----------
    shape : the shape that stands out most; statistic, threshold : its own.
    p_value : of the largest standardised statistic.
    significant : peaks above their thresholds, the likeliest first; empty where there is no fault.
    """

    shape: str
    statistic: float
    threshold: float
    p_value: float
    significant: tuple[Peak, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """A null distribution, and the rate of false alarms at which it decides.

    Attributes
    ----------
    use : where the distribution comes from; notes : what limits it.
    """

    null: Null
    use: CalibrationUse
    shapes: tuple[str, ...]
    false_alarm: float
    notes: tuple[str, ...]

    def verdict(self, scan: HypothesisScan) -> Verdict:
        """Decide at the wanted rate of false alarms."""
        peaks = {shape: scan.of(shape) for shape in self.shapes}
        standardised = {shape: self.null.standardised(shape, peak.statistic) for shape, peak in peaks.items()}
        top = max(standardised, key=lambda shape: standardised[shape])
        p_value = self.null.p_value(standardised[top])
        beyond = [peak for shape, peak in peaks.items() if peak.statistic > self.threshold(shape)]
        return Verdict(
            shape=top,
            statistic=peaks[top].statistic,
            threshold=self.threshold(top),
            p_value=p_value,
            significant=tuple(sorted(beyond, key=bic_change)) if p_value < self.false_alarm else (),
        )

    def threshold(self, shape: str) -> float:
        """Return the statistic of a shape above which it is a fault."""
        return self.null.threshold(shape, self.false_alarm)


def rule_for(log: FlightLog, record: ScanRecord, config: Config, *, order: int, report: Report = silent) -> Rule:
    """Return the rule the configuration asks for.

    Parameters
    ----------
    log : the whole log, of which `self` calibrates on the part before the window.
    record : the window.
    order : of the model that `gaussian` simulates.
    report : called with the fraction that is done.

    Raises
    ------
    ConfigError : the table cannot be read, or no table has these shapes.
    LogError : the log has too little before the window.
    """
    source, notes = config.start_time.calibration or "shipped", []
    table: CalibrationTable | None = None
    match source:
        case "gaussian":
            table = gaussian_table(record, order, seed=config.seed, report=report)
            notes.append(
                "the threshold assumes white Gaussian errors, which real flights do not have: false alarms are more "
                "frequent than stated"
            )
        case "self":
            windows = earlier_windows(log, config)
            table = table_of_windows([(log, window) for window in windows], config, report)
            notes.append(
                f"calibrated on {table.n_windows} overlapping windows before the analysed one, taken to be fault-free"
            )
        case "shipped" if config.start_time.calibration is None:
            with resources.as_file(resources.files(__package__).joinpath(SHIPPED)) as path:
                table = nearest(load_tables(path), record.settings)
        case path:
            table = nearest(load_tables(path), record.settings)
    if table is None:
        raise ConfigError(
            f"--calibration: no {source} table has all of {', '.join(record.settings.shapes)}; "
            "make one with bfi calibrate, or give --calibration gaussian"
        )
    differ = differences(table, record.settings)
    if differ:
        where = f"no calibration fits the settings; the nearest ({table.n_windows} windows) has {', '.join(differ)}"
        notes.append(f"{where}: no p-value is given, and the rate of false alarms is not known")
    return Rule(
        null=null_of(table, record.settings.shapes),
        use=CalibrationUse(source=source, matches=not differ, n_windows=table.n_windows),
        shapes=record.settings.shapes,
        false_alarm=config.start_time.false_alarm,
        notes=tuple(notes),
    )


def gaussian_table(record: ScanRecord, order: int, *, seed: int, report: Report = silent) -> CalibrationTable:
    """Return the table of records simulated with the model fitted without a fault and white Gaussian errors.

    Where the rows of the record are weighted, the errors are as unequal as the weights say.

    Parameters
    ----------
    record : its inputs are kept.
    order : of the model, and of the scans.
    seed : of the errors.
    report : called with the fraction that is done.
    """
    rng = np.random.default_rng(seed)
    model = record.without_fault(record.y, order)
    n_outputs = record.y.shape[1]
    first = 0 if record.feedthrough else 1
    X = np.hstack([np.ones((len(model.error), 1)), lagged(record.u, range(first, order + 1), first=order)])
    driven, past = X @ model.coefficients[: X.shape[1]], model.coefficients[X.shape[1] :]
    _, scale, axes = np.linalg.svd(model.weighted_error / np.sqrt(len(model.error)), full_matrices=False)
    sizes = np.ones((len(model.error), 1)) if record.weights is None else 1.0 / record.weights[order:, None]
    # The output lags are shrunk, lag by lag, until the recursion does not grow.
    companion = np.eye(order * n_outputs, k=-n_outputs)
    companion[:n_outputs] = past.T
    radius = float(np.abs(np.linalg.eigvals(companion)).max())
    shrink = min(1.0, STABLE / radius) if radius > 1.0 else 1.0
    past = past * np.repeat(shrink ** np.arange(1, order + 1), n_outputs)[:, None]
    scans = []
    with threadpool_limits(1):
        for _, own in parts(report, range(TRIALS)):
            expected = driven + sizes * (rng.standard_normal(model.error.shape) @ (scale[:, None] * axes))
            y = record.y.copy()
            for k in range(order, len(y)):
                y[k] = expected[k - order] + y[k - 1 :: -1][:order].reshape(-1) @ past
            scans.append(scan_hypotheses(record, y, order, own))
    return _table(record.settings, scans, ("simulated",))


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
    pieces: Sequence[tuple[FlightLog, tuple[float, float]]], config: Config, report: Report = silent
) -> CalibrationTable:
    """Return the table of windows of logs that hold no fault; those that cannot be analysed are counted.

    Parameters
    ----------
    pieces : log, and start and end of the window on its axis.
    report : called with the fraction that is done.

    Raises
    ------
    LogError : no window can be analysed; the reason is that of the last.
    """
    settings: CalibrationSettings | None = None
    scans: list[HypothesisScan] = []
    names: dict[str, None] = {}
    n_unusable = 0
    problem: LogError | None = None
    for (log, (from_s, to_s)), own in parts(report, pieces):
        try:
            record = prepare_record(log, merge(config, {"window": {"from_s": from_s, "to_s": to_s}}))
            if settings is not None and record.settings.orders != settings.orders:
                raise LogError(f"{log.path}: the window from {from_s:g} s is shorter than the others")
            with threadpool_limits(1):
                scans.append(scan_hypotheses(record, record.y, report=own))
        except LogError as unusable:
            n_unusable, problem = n_unusable + 1, unusable
            continue
        settings = settings or record.settings
        names[Path(log.path).name] = None
    if settings is None:
        raise problem or LogError("calibration: no window; give a longer log or shorter windows")
    return _table(settings, scans, tuple(names), n_unusable)


def _table(
    settings: CalibrationSettings, scans: list[HypothesisScan], logs: tuple[str, ...], n_unusable: int = 0
) -> CalibrationTable:
    statistics = {shape: frozen_array([scan.of(shape).statistic for scan in scans]) for shape in settings.shapes}
    return CalibrationTable(settings=settings, statistics=statistics, logs=logs, n_unusable=n_unusable)
