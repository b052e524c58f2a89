"""Which channel fails, and when: the null-space detector, exact for noise-free data and by parity residuals with noise.

`preparation` makes a record of the log, `nullspace` is the criterion of the paper for data without noise, `parity` the
one for noisy data, whose residuals are those of `predictor`; `detect` chooses and makes the result.
"""

from __future__ import annotations

from .detect import detect_faults
from .preparation import DetectSettings, settings_of
from .report import detect_content, detect_document
from .result import Alarm, Calibration, ChannelSeries, DetectResult, ParityModel

__all__ = [
    "Alarm",
    "Calibration",
    "ChannelSeries",
    "DetectResult",
    "DetectSettings",
    "ParityModel",
    "detect_content",
    "detect_document",
    "detect_faults",
    "settings_of",
]
