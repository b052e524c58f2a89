"""Air data as one system: faults found where pressures, lift, attitude, inertia and ground velocity disagree."""

from .calibration import ParityTable, ScanKey, Threshold, shipped_tables, table_for, threshold_of
from .explain import FaultByOnset, corrected, effects, explain
from .finding import Bound, Finding, Hidden
from .record import Record, record_of
from .residuals import RESIDUALS, available
from .scan import WindowScan, scan_window
from .windows import LENGTHS_S, configuration_changes, windows_in, zero_lift_of

__all__ = ["LENGTHS_S", "RESIDUALS", "Bound", "FaultByOnset", "Finding", "Hidden", "ParityTable", "Record", "ScanKey"]
__all__ += [
    "Threshold",
    "WindowScan",
    "available",
    "configuration_changes",
    "corrected",
    "effects",
    "explain",
    "record_of",
    "scan_window",
    "shipped_tables",
]
__all__ += ["table_for", "threshold_of", "windows_in", "zero_lift_of"]
