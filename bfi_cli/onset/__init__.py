"""When did a fault start, of which shape is it and how large: the scan over all onsets (docs/theory.md, 9)."""

from .detection import find_onset
from .document import onset_document, onset_tables
from .report import onset_exhibit
from .result import (
    CalibrationUse,
    OnsetFault,
    OnsetResult,
    OnsetSeries,
    ShapeProfile,
    propose_dictionary,
)
from .windows import calibration_windows, table_of_windows, windows_of

__all__ = [
    "CalibrationUse",
    "OnsetFault",
    "OnsetResult",
    "OnsetSeries",
    "ShapeProfile",
    "calibration_windows",
    "find_onset",
    "onset_document",
    "onset_exhibit",
    "onset_tables",
    "propose_dictionary",
    "table_of_windows",
    "windows_of",
]
