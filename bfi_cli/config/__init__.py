"""The configuration of an analysis: its sections, the document they make, and reading one."""

from __future__ import annotations

from .document import Config, DictionarySource, json_schema, load_config, merge
from .sections import STRONG_EVIDENCE, Detect, Diagnosability, Natural, StartTime

__all__ = [
    "STRONG_EVIDENCE",
    "Config",
    "Detect",
    "Diagnosability",
    "DictionarySource",
    "Natural",
    "StartTime",
    "json_schema",
    "load_config",
    "merge",
]
