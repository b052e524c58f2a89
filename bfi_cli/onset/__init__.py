"""When did a fault start, of which shape is it and how large: the scan over all onsets (docs/theory.md, 9)."""

from .detection import find_onset
from .document import onset_document
from .report import onset_content
from .result import (
    CalibrationUse,
    OnsetFault,
    OnsetResult,
    OnsetSeries,
    ShapeProfile,
    compare_with_injected,
    propose_dictionary,
)
from .windows import table_of_windows, windows_of

__all__ = [
    "CalibrationUse",
    "OnsetFault",
    "OnsetResult",
    "OnsetSeries",
    "ShapeProfile",
    "compare_with_injected",
    "find_onset",
    "onset_content",
    "onset_document",
    "propose_dictionary",
    "table_of_windows",
    "windows_of",
]
