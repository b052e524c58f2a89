"""Notes: a sentence and what it is for; in a document each once, and those of older documents are read as methods."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_results import fault_result, no_fault_result

from bfi_cli.errors import ConfigError
from bfi_cli.model.report import content_of_document
from bfi_cli.model.result import identify_document, identify_from_document
from bfi_cli.notes import NOTE_KINDS, Note, unique
from bfi_cli.serialization import OLDEST_READ, SCHEMA, check_schema, from_plain, provenance, to_plain

NOTES = (Note.limit("a"), Note.method("b"), Note.advice("c"))


def test_each_constructor_makes_its_kind():
    assert tuple(one.kind for one in NOTES) == NOTE_KINDS


def test_the_first_of_equal_sentences_stays():
    assert unique((*NOTES, Note.advice("a"), *NOTES)) == NOTES


def test_notes_are_plain_data_and_back():
    plain = to_plain(NOTES)
    assert plain[0] == {"kind": "limit", "text": "a"}
    assert from_plain(tuple[Note, ...], plain, where="x") == NOTES
    with pytest.raises(ConfigError, match="not 'limit' or 'method' or 'advice'"):
        from_plain(Note, {"kind": "rumour", "text": "a"}, where="x")


@pytest.mark.parametrize("make", [fault_result, no_fault_result])
def test_a_document_lists_no_note_twice(make):
    result = make()
    document = identify_document(replace(result, notes=result.notes * 2), provenance(log_sha256=""))
    assert document["notes"] == to_plain(result.notes)


def test_a_document_of_plain_sentences_is_read():
    document = identify_document(fault_result(), provenance(log_sha256=""))
    before = {**document, "schema": 2, "notes": [one["text"] for one in document["notes"]]}
    old, _ = identify_from_document(before)
    assert old.notes == tuple(Note.method(text) for text in before["notes"])
    assert content_of_document(before).verdict == content_of_document(document).verdict


@pytest.mark.parametrize("kind", ["identify", "diagnose", "info", "calibration"])
def test_a_document_has_this_schema_or_an_older_one_that_is_read(kind: str):
    oldest = OLDEST_READ.get(kind, 1)
    for schema in range(oldest, SCHEMA + 1):
        check_schema({"kind": kind, "schema": schema}, where="x.json")
    for schema in (oldest - 1, SCHEMA + 1, None, "3"):
        with pytest.raises(ConfigError, match=rf"x.json: schema is {schema}, this program reads 4; run bfi {kind}"):
            check_schema({"kind": kind, "schema": schema}, where="x.json")
