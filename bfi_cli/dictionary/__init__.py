"""A fault dictionary: the faults an analysis looks for, with the signals they would add to each output."""

from .document import (
    Dictionary,
    DictionaryDocument,
    dead_reason,
    expand,
    json_schema,
    load_dictionary,
    no_signal,
    signals,
)

__all__ = [
    "Dictionary",
    "DictionaryDocument",
    "dead_reason",
    "expand",
    "json_schema",
    "load_dictionary",
    "no_signal",
    "signals",
]
