"""Flight logs: reading, what they are good for, known faults, another rate, writing.

A log has one time axis and channels under standard names in SI units and radians; see `record.FlightLog`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..first_use import import_on_first_use

if TYPE_CHECKING:
    from .formats import digest_of_log, is_log_folder
    from .injection import inject, without_line_fault
    from .inspection import LogReport, inspect_log
    from .quality import is_told_by_physics, recorder_filters, require_usable
    from .read import read_log
    from .record import Channel, FlightLog, Segment, Truth
    from .resampling import resample, resample_with
    from .write import write_log

__all__ = ["Channel", "FlightLog", "LogReport", "Segment", "Truth", "digest_of_log", "inject", "inspect_log"]
__all__ += ["is_log_folder", "is_told_by_physics", "read_log", "recorder_filters", "require_usable", "resample"]
__all__ += ["resample_with", "without_line_fault", "write_log"]

__getattr__ = import_on_first_use(
    __name__,
    {
        "formats": ("digest_of_log", "is_log_folder"),
        "injection": ("inject", "without_line_fault"),
        "inspection": ("LogReport", "inspect_log"),
        "quality": ("is_told_by_physics", "recorder_filters", "require_usable"),
        "read": ("read_log",),
        "record": ("Channel", "FlightLog", "Segment", "Truth"),
        "resampling": ("resample", "resample_with"),
        "write": ("write_log",),
    },
)
