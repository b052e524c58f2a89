"""Flight logs: reading, what they are good for, known faults, another rate, writing.

A log has one time axis and channels under standard names in SI units and radians; see `record.FlightLog`.
"""

from .injection import inject
from .px4 import is_log_folder
from .quality import LogReport, inspect_log, require_usable
from .read import digest_of_log, read_log
from .record import Channel, FlightLog, Segment, Truth
from .resampling import resample, resample_with
from .write import write_log

__all__ = ["Channel", "FlightLog", "LogReport", "Segment", "Truth", "digest_of_log", "inject", "inspect_log"]
__all__ += ["is_log_folder", "read_log", "require_usable", "resample", "resample_with", "write_log"]
