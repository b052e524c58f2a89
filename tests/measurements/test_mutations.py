"""The tool for mutations: what it says of a change, and that its changes are Python."""

from __future__ import annotations

from pathlib import Path

import mutations
import pytest
from mutations import LINES, ROOT, Line, tried

WRITTEN = "A = 1\nB = 2  # of two\nC = 2\n"


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a tree with one module, whose tests fail where A is 3."""
    (tmp_path / "bfi_cli").mkdir()
    (tmp_path / "bfi_cli" / "one.py").write_text(WRITTEN)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_one.py").write_text("")
    monkeypatch.setattr(mutations, "passes", lambda copy, files: "A = 3" not in (copy / "bfi_cli/one.py").read_text())
    return tmp_path


@pytest.mark.parametrize(
    ("line", "answers"),
    [
        (Line("one.py", "A = 1", ("A = 3", "A = 4"), ("tests/test_*.py",)), ["caught", "NOT CAUGHT"]),
        (Line("one.py", "B = 2", ("B = 3",), ("tests/test_*.py",)), ["NOT CAUGHT"]),
        (Line("one.py", "A = 2", ("A = 3",), ("tests/test_*.py",)), ["stale: 0 lines have the text"]),
        (Line("one.py", " = 2", (" = 3",), ("tests/test_*.py",)), ["stale: 2 lines have the text"]),
        (Line("two.py", "A = 1", ("A = 3",), ("tests/test_*.py",)), ["stale: 0 lines have the text"]),
        (Line("one.py", "A = 1", ("A = 3",), ("tests/test_two*.py",)), ["no test file"]),
    ],
)
def test_each_change_is_tried_and_taken_back(copy: Path, line: Line, answers: list[str]):
    assert tried(copy, line, {}) == answers
    assert (copy / "bfi_cli" / "one.py").read_text() == WRITTEN


def test_tests_that_fail_without_a_change_say_nothing(copy: Path):
    (copy / "bfi_cli" / "one.py").write_text("A = 3\nB = 2\n")
    assert tried(copy, Line("one.py", "B = 2", ("B = 3",), ("tests/test_*.py",)), {}) == [
        "the tests fail without a change"
    ]


@pytest.mark.parametrize("line", LINES, ids=lambda one: f"{one.file}: {one.text[:30]}")
def test_a_change_is_another_line_of_python(line: Line):
    path = ROOT / "bfi_cli" / line.file
    assert line.changed
    assert line.text not in line.changed
    before = path.read_text("utf-8")
    assert before.count(line.text) == 1
    for changed in line.changed:
        compile(before.replace(line.text, changed), line.file, "exec")
