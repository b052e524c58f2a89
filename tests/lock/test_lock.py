"""Answers are those that are stored, but for provenance; what changes on purpose is stored anew by relock.py."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_lines import FAST, LINES, ROUNDED
from locked_answers import (
    ELSEWHERE,
    NUMBERS,
    STORED,
    answer,
    decisive,
    differences,
    differences_from_stored,
    plain,
    store,
    stored,
)


@pytest.fixture(scope="session")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which the command lines are run."""
    return tmp_path_factory.mktemp("lock")


@pytest.mark.parametrize("name", [pytest.param(line, marks=() if line in FAST else pytest.mark.slow) for line in LINES])
def test_an_answer_is_the_one_that_is_stored(name: str, workshop: Path) -> None:
    listed = [str(line) for line in differences_from_stored(name, answer(name, workshop))]
    remedy = f"where that is meant: python tests/lock/relock.py {name}"
    assert not listed, "\n    ".join([f"bfi {LINES[name]}", *listed, remedy])


def test_every_stored_answer_is_of_a_command_line() -> None:
    assert {path.stem for path in STORED.glob("*.json")} == set(LINES)
    assert set(FAST) <= set(LINES)


def test_what_hangs_on_rounding_is_held_to_what_it_decides_on_another_processor() -> None:
    assert set(LINES) >= ROUNDED
    before = stored("identify_thesis")
    (fault,) = before["document"]["faults"]
    faults = {"a digit": [{**fault, "sd": 2.0 * fault["sd"]}], "a name": [{**fault, "name": "drift"}]}
    after = {key: {**before, "document": {**before["document"], "faults": it}} for key, it in faults.items()}
    assert decisive(after["a digit"]) == decisive(before) != decisive(after["a name"])
    assert differences_from_stored("identify_thesis", after["a digit"])
    assert not differences_from_stored("identify_thesis", {**after["a digit"], "arithmetic": "another"})
    assert differences_from_stored("identify_thesis", {**after["a name"], "arithmetic": "another"})


@pytest.mark.parametrize(
    ("before", "after", "listed"),
    [
        ({"a": 1.0}, {"a": 1.0 + 0.5 * NUMBERS}, []),
        ({"a": 1.0}, {"a": 1.0 + 2.0 * NUMBERS}, ["a: 1.0 -> 1.000000002"]),
        ({"a": 1e-14}, {"a": -3e-15}, []),
        ({"a": 1.0}, {"a": 1}, []),
        ({"a": True}, {"a": 1}, ["a: true -> 1"]),
        ({"a": None}, {"a": 0.0}, ["a: null -> 0.0"]),
        ({"a": {"b": "x"}}, {"a": {"b": "y"}}, ['a.b: "x" -> "y"']),
        ({"a": 1}, {"b": 1}, ["a: 1 -> nothing", "b: nothing -> 1"]),
        ({"a": [1.0, 2.0]}, {"a": [1.0, 4.0]}, ["a (1 of 2 numbers, by up to 0.5 of them): [1.0,2.0] -> [1.0,4.0]"]),
        ({"a": [1.0, 2.0]}, {"a": [1.0]}, ["a: [1.0,2.0] -> [1.0]"]),
        ({"a": [[1.0], [2.0]]}, {"a": [[1.0]]}, ["a[1]: [2.0] -> nothing"]),
        (
            {"faults": [{"name": "drift", "sd": 1.0}]},
            {"faults": [{"name": "bias", "sd": 2.0}, {"name": "drift", "sd": 3.0}]},
            ["faults[drift].sd: 1.0 -> 3.0", 'faults[bias]: nothing -> {"name":"bias","sd":2.0}'],
        ),
        (
            {"notes": [{"kind": "limit", "text": "short"}]},
            {"notes": [{"kind": "advice", "text": "short"}]},
            ['notes[short].kind: "limit" -> "advice"'],
        ),
        ({"notes": ["a", "b"]}, {"notes": ["b"]}, ['notes[0]: "a" -> "b"', 'notes[1]: "b" -> nothing']),
    ],
)
def test_what_differs_is_listed_key_by_key(before: Any, after: Any, listed: list[str]) -> None:
    assert [str(line) for line in differences(before, after)] == listed
    assert not list(differences(before, before))


def test_a_difference_is_one_line_of_bounded_length() -> None:
    (line,) = differences({"text": ""}, {"text": "word " * 1000})
    assert len(str(line)) < 200


def test_what_is_stored_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("locked_answers.STORED", tmp_path / "answers")
    document = plain({"kind": "x", "schema": 3, "n": [1 / 3, None], "inner": {"provenance": {}, "text": "α\n"}})
    for after in ({"code": 0, "stderr": "", "document": document}, {"code": 3, "stderr": "x\n", "document": None}):
        store("x", after)
        assert stored("x") == after
    assert document == {"kind": "x", "n": [0.333333333333, None], "inner": {"text": "α\n"}}
    assert json.loads((tmp_path / "answers" / "x.json").read_text("utf-8"))["code"] == 3


def test_numbers_of_other_arithmetic_are_compared_less_closely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("locked_answers.STORED", tmp_path)
    document = {"n": 1.0, "word": "a"}
    store("x", {"arithmetic": "here", "document": document})
    near, far = ({"n": 1.0 + part * ELSEWHERE, "word": "a"} for part in (0.5, 2.0))
    for where, listed in (("here", ["document.n"]), ("elsewhere", [])):
        assert [line.where for line in differences_from_stored("x", {"arithmetic": where, "document": near})] == listed
        assert len(differences_from_stored("x", {"arithmetic": where, "document": far})) == 1
        assert differences_from_stored("x", {"arithmetic": where, "document": {**document, "word": "b"}})
