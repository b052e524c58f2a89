"""The null distribution a decision rests on, how it is counted, and whether a scan stands out of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from ...config import Config, merge
from ...decision.calibration import (
    FEWEST_WINDOWS,
    TOLERANCES,
    CalibrationSettings,
    CalibrationTable,
    Null,
    differences,
    load_tables,
    nearest,
    null_of,
)
from ...errors import ConfigError, LogError
from ...faults.shapes import SCANNED_AS
from ...flightlog import FlightLog
from ...flightlog.phases import airborne_stretches
from ...flightlog.record import frozen_array
from ...kernels.lagged import lagged
from ...kernels.progress import Progress, Report, parts, silent, unseen
from ...notes import Note
from ...quantities.text import instant
from ...threads import one_thread
from ..preprocessing.defaults import modelled_stretches
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
# Windows of the log itself that a sample of it belongs to: they give more statistics than windows apart. Those that
# share more than half of their samples say little new, but where `self` is asked for a short past must do.
OVERLAPPING = {"auto": 2, "self": 4}
# Nine of them lie in the tail; more take time and say little more.
MOST_WINDOWS = 60
# Where windows of the analysed length are too few, these parts of it are tried. Shorter windows do not show much less:
# on a flight of 262 s the largest statistic of windows of 20 s was 30, of 60 s 19.
SHORTER = tuple(float(share) for share in np.arange(0.95, 0.24, -0.05))
# Shorter ones are not enough for a model of order 8 with one input, which takes half of them.
FEWEST_SAMPLES = 60


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """A null distribution, and the rate of false alarms at which it decides.

    Attributes
    ----------
    table : that was counted; source : of it, "shipped", "self" (windows of the log itself), "gaussian", or its path.
    matches : whether it was made for the settings in use; notes : what limits it.
    counted : the distribution as it was counted; `null` has the wider tail of other settings where these do not fit.
    """

    null: Null
    table: CalibrationTable
    source: str
    matches: bool
    shapes: tuple[str, ...]
    false_alarm: float
    notes: tuple[Note, ...]
    counted: Null

    def significant(self, scan: HypothesisScan) -> list[Peak]:
        """Return the peaks above their thresholds, the likeliest first; none where there is no fault."""
        peaks = (scan.of(shape) for shape in self.shapes)
        return sorted((peak for peak in peaks if peak.statistic > self.threshold(peak.form.shape)), key=bic_change)

    def highest(self, scan: HypothesisScan) -> tuple[Peak, float | None]:
        """Return the peak that stands out most, and the p-value of that; None where the table is of other settings."""
        standardised = {shape: self.null.standardised(shape, scan.of(shape).statistic) for shape in self.shapes}
        shape = max(standardised, key=lambda shape: standardised[shape])
        return scan.of(shape), self.null.p_value(standardised[shape]) if self.matches else None

    def threshold(self, shape: str) -> float:
        """Return the statistic of a shape above which it is a fault; lags and ramps show as steps."""
        return self._threshold(self.null, shape)

    def suspicion(self, shape: str) -> float:
        """Return the statistic of a shape above which it is suspected: its threshold, had the table fitted."""
        return self._threshold(self.counted, shape)

    def _threshold(self, null: Null, shape: str) -> float:
        return null.threshold(shape if shape in null.scale else SCANNED_AS.get(shape, shape), self.false_alarm)


def rule_for(log: FlightLog, record: ScanRecord, config: Config, *, order: int, progress: Progress = unseen) -> Rule:
    """Return the rule the configuration asks for; by default the first of these that there is.

    1. A shipped table that fits.
    2. `FEWEST_WINDOWS` windows of the log itself, see `own_windows`.
    3. As many shorter windows of the log itself, or else the nearest shipped table: a wider tail, no p-value.

    Parameters
    ----------
    log : the whole log.
    record : the window.
    order : of the model that `gaussian` simulates.
    progress : called with the name of the stage and the fraction of it that is done.

    Raises
    ------
    ConfigError : the table cannot be read, or no table has these shapes.
    LogError : the log has too few windows for `self`.
    """
    asked, settings = config.start_time.calibration or "auto", record.settings
    match asked:
        case "gaussian":
            table = gaussian_table(record, order, seed=config.seed, report=partial(progress, "simulated records"))
            note = Note.limit(
                "the threshold assumes white Gaussian errors, which real flights do not have: false alarms are more "
                "frequent than stated"
            )
            return _rule(table, "gaussian", config, note)
        case "self":
            windows = earlier_windows(log, config)
            table = table_of_windows([(log, window) for window in windows], config, _windows_report(progress, windows))
            return _rule(table, "self", config, Note.method(_note_on_own(table, windows, "before the analysed one")))
        case "auto":
            shipped = _shipped_tables()
            fitting = [table for table in shipped if not differences(table, settings)]
            if fitting:
                note = Note.method(
                    f"calibrated on {fitting[0].n_windows} windows of flights recorded and analysed alike"
                )
                return _rule(fitting[0], "shipped", config, note)
            table_of_log, why = own_table(log, record, config, progress)
            if table_of_log is None:
                return _nearest_rule(shipped, "shipped", record, config, why)
            return _nearest_rule([table_of_log], "self", record, config, why)
        case path:
            return _nearest_rule(load_tables(path), path, record, config)


def _rule(table: CalibrationTable, source: str, config: Config, *notes: Note, matches: bool = True) -> Rule:
    shapes, false_alarm = config.start_time.shapes, config.start_time.false_alarm
    null = null_of(table, shapes)
    if matches and false_alarm < null.rarest:
        notes = (
            *notes,
            Note.method(
                f"{table.n_windows} windows cannot show a false-alarm rate below {100.0 * null.rarest:.3g} %; the "
                f"threshold for {100.0 * false_alarm:.3g} % is extrapolated from their tail"
            ),
        )
    return Rule(
        null=null if matches else replace(null, tail=null.tail.widened),
        counted=null,
        table=table,
        source=source,
        matches=matches,
        shapes=shapes,
        false_alarm=false_alarm,
        notes=notes,
    )


def _nearest_rule(
    tables: Sequence[CalibrationTable], source: str, record: ScanRecord, config: Config, why: str = ""
) -> Rule:
    """Return the rule of the nearest table; where it does not fit, with a wider tail and a note that says so."""
    table = nearest(tables, record.settings)
    if table is None:
        raise ConfigError(
            f"--calibration: no {source} table has all of {', '.join(record.settings.shapes)}; "
            "make one with bfi calibrate, or give --calibration gaussian"
        )
    differ = differences(table, record.settings)
    if not differ:
        return _rule(table, source, config, *map(Note.method, filter(None, [why])))
    unknown = Note.limit("false-alarm rate unknown: no comparable healthy flights (bfi calibrate)")
    how = Note.method(
        f"the thresholds are those of the nearest calibration table, with a wider tail{f' ({why})' if why else ''}; "
        f"its {table.n_windows} windows have {', '.join(differ)}"
    )
    return _rule(table, source, config, unknown, how, matches=False)


def shipped_rule(record: ScanRecord, config: Config) -> Rule:
    """Return the rule of the shipped table that fits, else that of the nearest with a wider tail.

    Raises
    ------
    ConfigError : no table has these shapes.
    """
    return _nearest_rule(_shipped_tables(), "shipped", record, config)


@cache
def _shipped_tables() -> tuple[CalibrationTable, ...]:
    """Return the tables that come with the program."""
    return load_tables(Path(__file__).with_name(SHIPPED))


def own_table(
    log: FlightLog, record: ScanRecord, config: Config, progress: Progress = unseen
) -> tuple[CalibrationTable | None, str]:
    """Return the table of windows of the log itself, and a note on them; None and the reason where they are too few.

    Where those of the analysed length are too few, they are the longest shorter ones that are enough.

    Parameters
    ----------
    log : the whole log.
    record : the analysed window; the others are analysed at its rate.
    config : of the analysis.
    """
    from_s, to_s = _analysed(log, config)
    length_s, why = to_s - from_s, ""
    by_length = own_windows(log, config, (length_s, *(length_s * share for share in SHORTER)))
    windows = next(by_length)
    if len(windows) < FEWEST_WINDOWS:
        airborne = "" if airborne_stretches(log) else ", in which no airspeed tells when it flies,"
        needed = f"{FEWEST_WINDOWS} further windows of {length_s:.4g} s in flight are needed"
        why = f"{needed}, this log{airborne} has {len(windows) or 'none'}"
        windows = next((shorter for shorter in by_length if len(shorter) >= FEWEST_WINDOWS), [])
        if not windows or (windows[0][1] - windows[0][0]) * record.settings.rate_hz < FEWEST_SAMPLES:
            return None, why
    pieces, rate_hz = [(log, window) for window in windows], config.conditioning.rate_hz
    alike = merge(config, {"conditioning.rate_hz": record.window.same_rate if rate_hz == "auto" else rate_hz})
    try:
        table = table_of_windows(
            pieces, alike, _windows_report(progress, windows), like=None if why else record.settings
        )
    except LogError as problem:
        return None, why or f"none of the log's {len(windows)} windows in flight can be analysed ({problem})"
    if table.n_windows < FEWEST_WINDOWS:
        few = f"only {table.n_windows} of the log's {len(windows)} windows in flight can be analysed alike"
        return None, why or f"{few}, not {FEWEST_WINDOWS}"
    where = "on both sides of the analysed one" if windows[-1][0] >= to_s else "before the analysed one"
    return table, "; ".join(filter(None, [why, _note_on_own(table, windows, f"{where}, in flight")]))


def _note_on_own(table: CalibrationTable, windows: Windows, where: str) -> str:
    length_s = windows[0][1] - windows[0][0]
    unusable = f"; {table.n_unusable} more could not be analysed alike" if table.n_unusable else ""
    return (
        f"calibrated on {table.n_windows} overlapping windows of {length_s:.4g} s of the log itself, {where}, taken to "
        f"be fault-free{unusable}"
    )


def _windows_report(progress: Progress, windows: Windows) -> Report:
    return partial(progress, f"threshold from {len(windows)} windows of the log")


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
    first = 0 if record.layout.feedthrough else 1
    X = np.hstack([np.ones((len(model.error), 1)), lagged(record.u, range(first, order + 1), first=order)])
    driven, past = X @ model.coefficients[: X.shape[1]], model.coefficients[X.shape[1] :]
    _, scale, axes = np.linalg.svd(model.weighted_error / np.sqrt(len(model.error)), full_matrices=False)
    weights = record.layout.weights
    sizes = np.ones((len(model.error), 1)) if weights is None else 1.0 / weights[order:, None]
    # The output lags are shrunk, lag by lag, until the recursion does not grow.
    companion = np.eye(order * n_outputs, k=-n_outputs)
    companion[:n_outputs] = past.T
    radius = float(np.abs(np.linalg.eigvals(companion)).max())
    shrink = min(1.0, STABLE / radius) if radius > 1.0 else 1.0
    past = past * np.repeat(shrink ** np.arange(1, order + 1), n_outputs)[:, None]
    scans = []
    with one_thread():
        for _, share in parts(report, range(TRIALS)):
            expected = driven + sizes * (rng.standard_normal(model.error.shape) @ (scale[:, None] * axes))
            y = record.y.copy()
            for k in range(order, len(y)):
                y[k] = expected[k - order] + y[k - 1 :: -1][:order].reshape(-1) @ past
            scans.append(scan_hypotheses(record, y, order, share))
    return _table(record.settings, scans, ("simulated",))


def calibration_windows(logs: Sequence[FlightLog], config: Config) -> list[tuple[FlightLog, tuple[float, float]]]:
    """Return log, start and end of every window of a calibration, of the length and the step of the configuration."""
    shortest_s = min(max(stop_s - start_s for start_s, stop_s in _flown(log, config)) for log in logs)
    length_s = config.calibrate.length_s or min(LENGTH_S, shortest_s)
    step_s = config.calibrate.step_s or 0.5 * length_s
    return [(log, window) for log in logs for window in windows_of(log, config, length_s=length_s, step_s=step_s)]


def windows_of(log: FlightLog, config: Config, *, length_s: float, step_s: float) -> Windows:
    """Return (from_s, to_s) of the windows of a length that fit between the configured start and end.

    Where an airspeed shows when the log flies, only those in flight: an aircraft at rest is no measure for it.
    """
    flown = _flown(log, config)
    return [window for start_s, stop_s in flown for window in _tiles(start_s, stop_s, length_s, step_s)]


def _flown(log: FlightLog, config: Config) -> Windows:
    """Return the stretches of the configured window in which a log flies, all of it where no airspeed tells."""
    from_s, to_s = _analysed(log, config)
    stretches = modelled_stretches(log, config.outputs)
    within = [(max(start_s, from_s), min(stop_s, to_s)) for start_s, stop_s in stretches]
    return [(start_s, stop_s) for start_s, stop_s in within if start_s < stop_s] or [(from_s, to_s)]


def own_windows(log: FlightLog, config: Config, lengths_s: Iterable[float]) -> Iterator[Windows]:
    """Yield, for each length, half overlapping windows of it, in flight and outside the analysed window.

    Those before the analysed window where they are enough, since a fault in it may last beyond it; else those on both
    sides. Where there are many, `MOST_WINDOWS` spread over them.
    """
    from_s, to_s = _analysed(log, config)
    stretches = modelled_stretches(log, config.outputs)
    for length_s in lengths_s:
        before, after = [], []
        for start_s, stop_s in stretches:
            before += _tiles(start_s, min(stop_s, from_s), length_s, length_s / OVERLAPPING["auto"])
            after += _tiles(max(start_s, to_s), stop_s, length_s, length_s / OVERLAPPING["auto"])
        windows = before if len(before) >= FEWEST_WINDOWS else before + after
        spread = np.unique(np.linspace(0, len(windows) - 1, min(len(windows), MOST_WINDOWS)).round().astype(int))
        yield [windows[i] for i in spread]


def earlier_windows(log: FlightLog, config: Config) -> Windows:
    """Return overlapping windows of the analysed length that lie before the analysed window.

    Where an airspeed shows when the log flies, only those in flight.

    Raises
    ------
    LogError : there are too few.
    """
    from_s, to_s = _analysed(log, config)
    length_s, first_s = to_s - from_s, float(log.time_s[0])
    stretches = modelled_stretches(log, config.outputs) or [(first_s, from_s)]
    step_s, before = length_s / OVERLAPPING["self"], [(start_s, min(stop_s, from_s)) for start_s, stop_s in stretches]
    windows = [window for start_s, stop_s in before for window in _tiles(start_s, stop_s, length_s, step_s)]
    if len(windows) < FEWEST_WINDOWS:
        needed_s = length_s + (FEWEST_WINDOWS - 1) * step_s
        in_flight_s = sum(max(0.0, stop_s - start_s) for start_s, stop_s in before)
        raise LogError(
            f"{log.path}: --calibration self needs {needed_s:.4g} s in flight before the window, got "
            f"{in_flight_s:.4g} s; choose a later --from or a shorter window, or give a table of bfi calibrate"
        )
    return windows


def _analysed(log: FlightLog, config: Config) -> tuple[float, float]:
    return log.window(config.window.from_s, config.window.to_s).span_s


def _tiles(start_s: float, stop_s: float, length_s: float, step_s: float) -> Windows:
    n = int(np.floor((stop_s - start_s - length_s) / step_s + 1e-9)) + 1  # 1e-9 of a step is round-off in the times
    return [(start_s + i * step_s, start_s + i * step_s + length_s) for i in range(n)]


def table_of_windows(
    pieces: Sequence[tuple[FlightLog, tuple[float, float]]],
    config: Config,
    report: Report = silent,
    *,
    like: CalibrationSettings | None = None,
) -> CalibrationTable:
    """Return the table of windows of logs that hold no fault; those that cannot be analysed are counted.

    Parameters
    ----------
    pieces : log, and start and end of the window on its axis.
    report : called with the fraction that is done.
    like : settings that every window must have; None for those of the first.

    Raises
    ------
    LogError : no window can be analysed; the reason is that of the last.
    """
    settings = like
    scans: list[HypothesisScan] = []
    names: dict[str, None] = {}
    n_unusable = 0
    problem: LogError | None = None
    for (log, (from_s, to_s)), share in parts(report, pieces):
        try:
            record = prepare_record(log, merge(config, {"window": {"from_s": from_s, "to_s": to_s}}))
            made = record.settings
            if settings is not None and (
                made.orders != settings.orders or abs(made.rate_hz / settings.rate_hz - 1.0) > TOLERANCES["rate_hz"]
            ):
                raise LogError(f"{log.path}: the window from {instant(from_s)} s is shorter than the others")
            with one_thread():
                scans.append(scan_hypotheses(record, record.y, report=share))
        except LogError as unusable:
            n_unusable, problem = n_unusable + 1, unusable
            continue
        settings = settings or made
        names[Path(log.path).name] = None
    if settings is None or not scans:
        raise problem or LogError("calibration: no window; give a longer log or shorter windows")
    return _table(settings, scans, tuple(names), n_unusable)


def _table(
    settings: CalibrationSettings, scans: list[HypothesisScan], logs: tuple[str, ...], n_unusable: int = 0
) -> CalibrationTable:
    statistics = {shape: frozen_array([scan.of(shape).statistic for scan in scans]) for shape in settings.shapes}
    return CalibrationTable(settings=settings, statistics=statistics, logs=logs, n_unusable=n_unusable)
