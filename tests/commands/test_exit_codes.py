"""Exit codes of an answer, and the first line that says why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bfi_cli.commands.analysis import exit_code_of
from bfi_cli.config import Config, merge

CLEAN = Path(__file__).parents[2] / "data" / "citation_clean.h5"


@pytest.mark.parametrize(
    ("fail_on", "decision", "deviates", "code"),
    [
        (None, "fault", True, 0),
        ("fault", "fault", False, 10),
        ("fault", "no_fault", True, 0),
        ("deviation", "fault", False, 10),
        ("deviation", "inconclusive", True, 10),
        ("deviation", "no_fault", False, 0),
    ],
)
def test_what_fail_on_asks_for(fail_on: str | None, decision: str, deviates: bool, code: int):
    config = merge(Config(), {"fail_on": fail_on})
    assert exit_code_of(decision, config, is_trusted=True, deviates=deviates) == code
    strict = merge(config, {"strict": True})
    assert exit_code_of(decision, strict, is_trusted=False, deviates=deviates) == 4


@pytest.mark.usefixtures("unscanned")
def test_the_first_line_says_why_an_answer_is_not_trusted(bfi: Callable, tmp_path: Path):
    file = tmp_path / "c.yaml"
    file.write_text("dictionary: {atoms: [{shape: drift, onset_s: 8}]}\nmodel: {order: 2}\n")
    plain, strict = (bfi("identify", CLEAN, "-c", file, "--rate", 4, *more) for more in ((), ("--strict",)))
    assert (plain.code, strict.code) == (0, 4)
    (first, *_), (why, *_) = plain.stdout.splitlines(), strict.stdout.splitlines()
    assert why.startswith(first)
    assert why.endswith("; --strict: steps, oscillations, slow errors not excluded")
