"""When did a fault start, of which shape is it and how large: the scan over all onsets (METHOD section 5)."""

from .answer import find_onset
from .null import table_of_windows, windows_of
from .result import CalibrationUse, OnsetFault, OnsetResult, ShapeProfile

__all__ = [
    "CalibrationUse",
    "OnsetFault",
    "OnsetResult",
    "ShapeProfile",
    "find_onset",
    "table_of_windows",
    "windows_of",
]
