"""What may be shown: every character is printable, what was printable is as it was, other text stays telling."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.printable import printable, shortened

ANY = st.text(st.characters(exclude_categories=[]))


@given(ANY)
def test_the_result_is_printable_and_printing_it_again_changes_nothing(text):
    assert printable(text).isprintable()
    assert printable(printable(text)) == printable(text)


@given(ANY)
def test_printable_text_is_as_it_was(text):
    kept = "".join(letter for letter in text if letter.isprintable())
    assert printable(kept) == kept


@given(ANY, ANY)
def test_different_text_without_backslashes_and_bytes_stays_different(one, other):
    """A backslash is not doubled, and a byte that is no UTF-8 looks like the character of that number."""
    if not any(letter == "\\" or 0xDC80 <= ord(letter) < 0xDD00 for letter in one + other):
        assert (printable(one) == printable(other)) == (one == other)


@given(ANY, st.integers(3, 60))
def test_shortened_is_printable_and_no_longer_than_asked(text, width):
    assert shortened(text, width).isprintable()
    assert len(shortened(text, width)) <= width
    if len(printable(text)) <= width:
        assert shortened(text, width) == printable(text)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\nb\tc\rd", r"a\nb\tc\rd"),
        ("\x00\x07\x1b[31m\x7f", r"\x00\x07\x1b[31m\x7f"),
        ("\x85\x9b31m\xa0", r"\x85\x9b31m\xa0"),
        ("\u202etas\u2066\u200b\ufeff", r"\u202etas\u2066\u200b\ufeff"),
        ("\u2028\u2029\u3000", r"\u2028\u2029\u3000"),
        ("\U000e0001\U0010ffff\ue000", r"\U000e0001\U0010ffff\ue000"),
        (b"log\xff\x9b.csv".decode("utf-8", "surrogateescape"), r"log\xff\x9b.csv"),
        ("\ud800", r"\ud800"),
        ("20 °C, µ, é, 速度, Ω", "20 °C, µ, é, 速度, Ω"),
        ("[red]x[/red] <b> $a$ \\n", "[red]x[/red] <b> $a$ \\n"),
    ],
)
def test_examples(text, shown):
    assert printable(text) == shown
