"""Blind fault identification of air-data sensors, from one flight log.

The model
---------
Measured output ``y = y_true + f``, fault ``f(k) = theta(k) z``, and for the fault-corrected output ``yf = y - f`` a
VARX in predictor form of order s::

    yf(k) = c + sum_i B_i u(k-i) + sum_i K_i yf(k-i) + e(k),    i = 1..s (B also 0 with feedthrough)

Symbols
-------
y        outputs, (n_samples, n_outputs)
u        inputs, (n_samples, n_inputs)
theta    dictionary signals, (n_samples, n_outputs, n_atoms); an atom is one entry of the dictionary
z        magnitudes, (n_atoms,)
B, K     predictor Markov parameters; K[i - 1] multiplies yf(k - i)
order    the number of lags s

Conventions
-----------
Time is axis 0. SI units and radians everywhere; another unit is in the name (``rate_hz``). ``onset_s`` and ``offset_s``
are seconds on the log's own time axis. Elevator positive is trailing edge down. Sensor faults add to the measurement.

Words: *identification* of a model is ``fit_`` or ``estimate_``, ``identify_`` is for faults only; *isolation* is which
fault, *detection* whether and when. ``prediction_error`` belongs to a model, ``residual`` to a fault indicator.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .config import Config, load_config, merge
    from .detection import DetectResult
    from .dictionary import Dictionary, load_dictionary
    from .errors import BfiError, ConfigError, DictionaryError, ExcitationError, LogError
    from .faults import Fault
    from .flight import DiagnoseResult
    from .flightlog import FlightLog, inject, inspect_log, read_log, resample, write_log
    from .lab.compare import ComparisonResult
    from .library import compare, detect, diagnose, identify, simulate, start_time
    from .model import identify_faults
    from .model.onset import OnsetResult, find_onset
    from .model.result import IdentifyResult

__version__ = "0.2.0"

_HOME = {
    "config": ("Config", "load_config", "merge"),
    "detection": ("DetectResult",),
    "dictionary": ("Dictionary", "load_dictionary"),
    "errors": ("BfiError", "ConfigError", "DictionaryError", "ExcitationError", "LogError"),
    "faults": ("Fault",),
    "flight": ("DiagnoseResult",),
    "flightlog": ("FlightLog", "inject", "inspect_log", "read_log", "resample", "write_log"),
    "lab.compare": ("ComparisonResult",),
    "library": ("compare", "detect", "diagnose", "identify", "simulate", "start_time"),
    "model": ("identify_faults",),
    "model.result": ("IdentifyResult",),
    "model.onset": ("OnsetResult", "find_onset"),
}
# Names of 0.2.0, and what takes their place.
_REPLACED = {"find_onset": "start_time", "identify_faults": "identify"}

__all__ = [
    "BfiError",
    "ComparisonResult",
    "Config",
    "ConfigError",
    "DetectResult",
    "DiagnoseResult",
    "Dictionary",
    "DictionaryError",
    "ExcitationError",
    "Fault",
    "FlightLog",
    "IdentifyResult",
    "LogError",
    "OnsetResult",
    "__version__",
    "compare",
    "detect",
    "diagnose",
    "find_onset",
    "identify",
    "identify_faults",
    "inject",
    "inspect_log",
    "load_config",
    "load_dictionary",
    "merge",
    "read_log",
    "resample",
    "simulate",
    "start_time",
    "write_log",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that `bfi --help` imports none of them."""
    for module, names in _HOME.items():
        if name in names:
            if name in _REPLACED:
                instead = f"bfi_cli.{name} goes with the next version; call bfi_cli.{_REPLACED[name]}"
                warnings.warn(instead, DeprecationWarning, stacklevel=2)
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
