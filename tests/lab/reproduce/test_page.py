"""The text of pages: names filled, three cells in every row of a comparison, published values with their place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from bfi_cli.lab.reproduce.page import fill, load

FAMILIES = ("thesis", "sparsity", "fir", "f16_table2", "hankel_b747")
PLACE = re.compile(r"\(.*(-\d+|table II|section IV|figure 1|example)\)|figure [\dA]-\d|^-$|^\{")


def pages() -> Iterator[tuple[str, Any]]:
    for family in FAMILIES:
        text = load(family)
        yield from text.items() if "title" not in text else [(family, text)]


PAGES = {name: page for name, page in pages() if name != "shared"}


def rows(page: Any) -> list[Any]:
    single = [page["row"]] if "row" in page else []
    return [*single, *(row for key, text in page.items() if key == "rows" or key.endswith("_rows") for row in text)]


def test_names_are_filled_in_text_and_in_lists_of_it():
    assert fill("{x:.1f} %", x=1.25) == "1.2 %"
    assert fill([["a", "{b[c d]}"]], b={"c d": 3}) == (("a", "3"),)
    with pytest.raises(KeyError):
        fill("{missing}", x=1)


@pytest.mark.parametrize("name", PAGES)
def test_a_row_compares_a_quantity_a_published_value_with_its_place_and_ours(name: str):
    for row in rows(PAGES[name]):
        assert len(row) == 3
        assert all(isinstance(cell, str) for cell in row)
        assert PLACE.search(row[1]), row


@pytest.mark.parametrize("name", [name for name, page in PAGES.items() if "printed" in page])
def test_what_a_sweep_compares_has_its_place_too(name: str):
    page = PAGES[name]
    assert set(page["printed"]) == set(page["quantities"])
    for printed in page["printed"].values():
        assert set(printed) <= set(page["who"])
        assert all(PLACE.search(text) for text in printed.values())


@pytest.mark.parametrize("name", [name for name in PAGES if name != "5-15"])
def test_a_page_has_what_every_page_shows(name: str):
    page = PAGES[name]
    assert page["title"]
    assert ("heading" in page) != ("headings" in page)
    assert page["verdict"]
    assert page["captions"]
    assert page["notes"] is not None
    assert all(len(fact) == 2 for fact in page.get("facts", ()))
