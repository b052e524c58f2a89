"""Words that a reader had to read twice, and that no text, document or stored answer has any more."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PLACES = ("README.md", "docs/*.md", "docs/examples/*.py", "bfi_cli/**/*.py", "tests/lock/answers/*.json")
REPLACED = (
    "excluded only if the declared fault is right",
    "no calibration table fits",
    "neither p-value nor false-alarm rate is known",
    "not watched for that",
    "a declared fault hides others",
    "is declared beside these events",
    "another one starts too near",
    "earlier ones cannot be excluded",
    "earlier ones pass for normal",
    "what would help with",
)


@pytest.mark.parametrize("place", PLACES)
def test_sentences_that_were_replaced_are_gone(place: str):
    paths = sorted(ROOT.glob(place))
    assert paths
    texts = {path: " ".join(path.read_text("utf-8").split()) for path in paths}
    found = [
        f"{path.relative_to(ROOT)}: {words}" for path, text in texts.items() for words in REPLACED if words in text
    ]
    assert found == []
