"""When did a fault start, of which shape is it and how large: the scan over all onsets (METHOD section 5)."""

from .answer import find_onset
from .document import onset_document, onset_tables
from .exhibit import onset_exhibit
from .null import table_of_windows, windows_of
from .proposal import compared, proposed
from .result import CalibrationUse, OnsetFault, OnsetResult, OnsetSeries, ShapeProfile

__all__ = [
    "CalibrationUse",
    "OnsetFault",
    "OnsetResult",
    "OnsetSeries",
    "ShapeProfile",
    "compared",
    "find_onset",
    "onset_document",
    "onset_exhibit",
    "onset_tables",
    "proposed",
    "table_of_windows",
    "windows_of",
]
