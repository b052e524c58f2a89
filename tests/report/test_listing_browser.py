"""The page of many logs as a person uses it: sorted by a click on a head, filtered by typing, without a network."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

from bfi_cli.report.listing import Listing, render_listing
from bfi_cli.serialization import provenance

playwright = pytest.importorskip("playwright.sync_api")

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ROWS = (("b.csv", "fault", "12.5"), ("a.csv", "", ""), ("C.csv", "no_fault", "-3"), ("<b>d.csv", "fault", "100"))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Open the page; whatever it asks of a network, or its script complains of, fails the test."""
    path = tmp_path_factory.mktemp("listing") / "index.html"
    listing = Listing(
        title="Logs",
        facts=(("Logs", "4"),),
        heads=("log", "decision", "onset [s]"),
        rows=ROWS,
        links=("b/report.html", "", "c/report.html", "d/report.html"),
        tones=tuple(row[1] for row in ROWS),
    )
    path.write_text(render_listing(listing, provenance(log_sha256="")), "utf-8")
    installed = next(filter(None, map(shutil.which, BROWSERS)), None)
    with playwright.sync_playwright() as driver:
        try:
            browser = driver.chromium.launch(executable_path=installed, args=["--no-sandbox"])
        except playwright.Error as error:
            pytest.skip(f"no browser can be started: {str(error).splitlines()[0]}")
        page, wrong = browser.new_context(offline=True).new_page(), list[str]()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda asked: wrong.append(asked.url) if asked.url != path.as_uri() else None)
        page.goto(path.as_uri())
        yield page
        browser.close()
        assert wrong == []


def logs(page: Any) -> list[str]:
    """Return the first cells of the rows that are shown, in order."""
    return page.locator("#logs tbody tr:visible td:first-child").all_inner_texts()


@pytest.mark.slow
def test_a_click_on_a_head_sorts_numbers_by_size_and_texts_by_letter(page: Any):
    page.locator("#logs th button", has_text="onset").click()
    assert logs(page) == ["C.csv", "b.csv", "<b>d.csv", "a.csv"]
    page.locator("#logs th button", has_text="onset").click()
    assert logs(page) == ["<b>d.csv", "b.csv", "C.csv", "a.csv"]
    page.locator("#logs th button", has_text="log").click()
    assert logs(page)[1:] == ["a.csv", "b.csv", "C.csv"]
    assert page.locator("#logs th").first.get_attribute("aria-sort") == "ascending"


@pytest.mark.slow
def test_what_is_typed_is_what_rows_have(page: Any):
    page.locator("#words").fill("FAULT")
    assert sorted(logs(page)) == ["<b>d.csv", "C.csv", "b.csv"]
    page.locator("#words").fill("d.c")
    assert logs(page) == ["<b>d.csv"]
    page.locator("#words").fill("")
    assert len(logs(page)) == 4


@pytest.mark.slow
def test_a_log_leads_to_its_report_and_is_marked(page: Any):
    assert page.locator("a").evaluate_all("all => all.map(one => one.getAttribute('href'))")
    rows = page.locator("#logs tbody tr").evaluate_all("all => all.map(one => one.className)")
    assert sorted(rows) == ["", "fault", "fault", "no_fault"]
