"""Which channel fails, and when: the null-space detector, exact for noise-free data and by parity residuals with noise.

`record` prepares a log, `model` predicts the channels, `watch` declares them one by one, `answer` lays out the result.
"""

from __future__ import annotations

from .answer import detect_faults
from .document import detect_document, detect_exhibit
from .result import Alarm, Calibration, ChannelSeries, DetectResult, ParityModel
from .settings import DetectSettings, settings_of

__all__ = [
    "Alarm",
    "Calibration",
    "ChannelSeries",
    "DetectResult",
    "DetectSettings",
    "ParityModel",
    "detect_document",
    "detect_exhibit",
    "detect_faults",
    "settings_of",
]
