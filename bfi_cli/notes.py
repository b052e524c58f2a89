"""Notes beside an answer: sentences for its reader, by their purpose."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

__all__ = ["NOTE_KINDS", "Note", "NoteKind", "unique"]

NoteKind = Literal["limit", "method", "advice"]
NOTE_KINDS: tuple[NoteKind, ...] = get_args(NoteKind)


@dataclass(frozen=True, slots=True)
class Note:
    """A sentence for the reader of an answer.

    Attributes
    ----------
    kind : "limit" narrows what the answer claims, "method" says how it was computed, "advice" what the reader can do.
    """

    kind: NoteKind
    text: str

    @classmethod
    def limit(cls, text: str) -> Note:
        """Return a note on what the answer does not cover."""
        return cls("limit", text)

    @classmethod
    def method(cls, text: str) -> Note:
        """Return a note on how the answer was computed."""
        return cls("method", text)

    @classmethod
    def advice(cls, text: str) -> Note:
        """Return a note on what the reader can do."""
        return cls("advice", text)


def unique(notes: Iterable[Note]) -> tuple[Note, ...]:
    """Return the notes in their order, each sentence once, as a document lists them."""
    first: dict[str, Note] = {}
    for note in notes:
        first.setdefault(note.text, note)
    return tuple(first.values())
