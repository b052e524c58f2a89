"""The sentences of notes, of a result or of its document."""

from __future__ import annotations


def texts(notes):
    return type(notes)(one["text"] if isinstance(one, dict) else one.text for one in notes)
