"""When did a fault start, of which shape is it and how large: the scan over all onsets (docs/theory.md, 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...first_use import import_on_first_use

if TYPE_CHECKING:
    from .decision import calibration_windows, table_of_windows, windows_of
    from .detection import find_onset, search_onsets
    from .report import onset_content, onset_document
    from .result import CalibrationUse, OnsetResult, OnsetSeries, ShapeProfile
    from .search import OnsetSearch

__all__ = ["CalibrationUse", "OnsetResult", "OnsetSearch", "OnsetSeries", "ShapeProfile"]
__all__ += ["calibration_windows", "find_onset", "onset_content", "onset_document"]
__all__ += ["search_onsets", "table_of_windows", "windows_of"]

__getattr__ = import_on_first_use(
    __name__,
    {
        "decision": ("calibration_windows", "table_of_windows", "windows_of"),
        "detection": ("find_onset", "search_onsets"),
        "report": ("onset_content", "onset_document"),
        "result": ("CalibrationUse", "OnsetResult", "OnsetSeries", "ShapeProfile"),
        "search": ("OnsetSearch",),
    },
)
