"""The configuration of an analysis: its sections, the document they make, and reading one."""

from .document import (
    STRONG_EVIDENCE,
    Config,
    Detect,
    Diagnosability,
    DictionarySource,
    Natural,
    StartTime,
    json_schema,
    load_config,
    merge,
)

__all__ = ["STRONG_EVIDENCE", "Config", "Detect", "Diagnosability", "DictionarySource", "Natural", "StartTime"]
__all__ += ["json_schema", "load_config", "merge"]
