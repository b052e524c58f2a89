"""A fault dictionary: the faults an analysis looks for, with the signals they would add to each output."""

from .document import (
    SHIPPED,
    Dictionary,
    DictionaryDocument,
    dead_reason,
    dead_sentences,
    expand,
    is_shipped,
    json_schema,
    load_dictionary,
    no_signal,
    signals,
)

__all__ = ["SHIPPED", "Dictionary", "DictionaryDocument", "dead_reason", "dead_sentences", "expand"]
__all__ += ["is_shipped", "json_schema", "load_dictionary", "no_signal", "signals"]
