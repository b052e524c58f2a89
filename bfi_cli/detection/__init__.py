"""Which channel fails, and when: the null-space detector, exact for noise-free data and by parity residuals with noise.

`preparation` makes a record of the log; `exact` applies the criterion of the paper to data without noise, `parity` the
one for noisy data, with the prediction errors of `predictor`; `detect` chooses and draws the conclusion.
"""

from __future__ import annotations

from .detect import detect_faults
from .report import detect_content, detect_document
from .result import Alarm, Calibration, ChannelSeries, DetectResult, ParityModel

__all__ = ["Alarm", "Calibration", "ChannelSeries", "DetectResult", "ParityModel"]
__all__ += ["detect_content", "detect_document", "detect_faults"]
