"""When did a fault start, of which shape is it and how large: the scan over all onsets (docs/theory.md, 9)."""

from .beside import scan_beside, why_not_scanned, with_limit_of_scan
from .claims import STANDS_FOR
from .decision import calibration_windows, table_of_windows, windows_of
from .detection import find_onset
from .report import onset_content, onset_document
from .result import (
    CalibrationUse,
    OnsetFault,
    OnsetResult,
    OnsetSeries,
    ShapeProfile,
    propose_dictionary,
)

__all__ = ["STANDS_FOR", "CalibrationUse", "OnsetFault", "OnsetResult", "OnsetSeries", "ShapeProfile"]
__all__ += [
    "calibration_windows",
    "find_onset",
    "onset_content",
    "onset_document",
    "propose_dictionary",
    "table_of_windows",
]
__all__ += ["scan_beside", "why_not_scanned", "windows_of", "with_limit_of_scan"]
