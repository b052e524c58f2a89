"""Which null distribution a decision rests on, and whether a sweep stands out of it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

from ..calibration import CalibrationTable, Null, differences, load_tables, nearest, null_of
from ..config import Config
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..kernels.progress import Report, silent
from .result import CalibrationUse
from .scan_record import ScanRecord
from .sweep import Peak, Sweep, bic_change
from .windows import earlier_windows, gaussian_table, table_of_windows

__all__ = ["Rule", "Verdict", "rule_for"]

SHIPPED = "shipped.json"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdict:
    """The decision on a sweep.

    Attributes
    ----------
    shape : the one that stands out most; statistic, threshold : its own.
    p_value : of the largest standardised statistic.
    significant : peaks above their thresholds, the likeliest first; none where there is no fault.
    """

    shape: str
    statistic: float
    threshold: float
    p_value: float
    significant: tuple[Peak, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """A null distribution and where it comes from.

    Attributes
    ----------
    use : for the reader; notes : what limits it.
    """

    null: Null
    use: CalibrationUse
    shapes: tuple[str, ...]
    false_alarm: float
    notes: tuple[str, ...]

    def verdict(self, sweep: Sweep) -> Verdict:
        """Decide at the wanted rate of false alarms."""
        peaks = {shape: sweep.of(shape) for shape in self.shapes}
        standing = {shape: self.null.standardised(shape, peak.statistic) for shape, peak in peaks.items()}
        top = max(standing, key=lambda shape: standing[shape])
        p_value = self.null.p_value(standing[top])
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
    log : the whole, for its own earlier part.
    record : the window.
    order : of the model, for a simulation.
    report : told how far it is.

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
