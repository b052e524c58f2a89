"""The report: one file that fetches nothing, escapes everything and says what was found."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from made_results import fault_result, inconclusive_result, no_fault_result, two_output_result

from bfi_cli.model.report import identify_content
from bfi_cli.notes import Note
from bfi_cli.report.figures import draw
from bfi_cli.report.html import render_content
from bfi_cli.report.style import to_svg

VOID = {"meta", "img", "wbr"}


class Page(HTMLParser):
    """Collects tags, attributes and text, and insists that every tag is closed in turn."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.links, self.text, self.open = [], [], "", []
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.links += [value for key, value in attrs if key in ("src", "href", "data", "action", "srcset")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text += data.replace("\u00a0", " ")


def report(result, provenance, figures=None):
    return render_content(identify_content(result), provenance, figures or {"outputs": b"<svg/>"})


@pytest.mark.first_rows(1)
def test_refers_to_nothing_outside_itself(drawn, provenance, vectors):
    html = report(drawn, provenance, vectors)
    page = Page(html)
    assert not re.search(r"https?://|//[a-z]|@import|url\(", html.replace("data:image/svg+xml", ""))
    assert len(page.links) == len(vectors)
    assert all(link.startswith("data:image/svg+xml;base64,") for link in page.links)
    assert "script" not in page.tags


@pytest.mark.parametrize("hostile", ["<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "&lt;b&gt;"])
def test_names_out_of_a_file_are_escaped(hostile, provenance):
    made = fault_result(channel=hostile)
    estimate = replace(made.faults[0], name=hostile, unit=hostile)
    candidates = tuple(replace(candidate, name=hostile, note=hostile) for candidate in made.candidates)
    log = replace(made.log, path=hostile)
    made = replace(made, faults=(estimate,), candidates=candidates, log=log, notes=(Note.limit(hostile),))
    page = Page(report(made, replace(provenance, command=hostile)))
    assert "script" not in page.tags
    assert page.tags.count("img") == 1
    assert page.text.count(hostile) >= 6


@pytest.mark.slow
def test_size_does_not_grow_with_the_log(provenance):
    made = fault_result(n_samples=50_000)
    html = report(made, provenance, {one.name: to_svg(draw(one)) for one in identify_content(made).drawings})
    assert len(html.encode()) < 3_000_000


def test_says_what_was_found_and_how_sure(provenance):
    text = Page(report(fault_result(), provenance)).text
    assert "true airspeed reads 4.00 m/s too high from 13.8 s (size, 95 %: 3.99 to 4.02)" in text
    assert "Still possible a slow error of up to 4.4 m/s" in text
    for part in ("3.989 to 4.017", "0.033 m/s", "99.998 %", "left out: it starts at 40 s", "4, first at 13.8 s"):
        assert part in text


def test_shows_where_the_numbers_come_from(result, provenance):
    text = Page(report(result, provenance)).text
    for part in (provenance.log_sha256, provenance.dictionary_sha256, provenance.command, provenance.date, "scipy"):
        assert part in text


@pytest.mark.parametrize(
    ("made", "known"), [(fault_result(), True), (two_output_result(), False), (inconclusive_result(), False)]
)
def test_truth_is_shown_where_it_is_known(made, known, provenance):
    assert ("Against the injected truth" in Page(report(made, provenance)).text) is known


def test_no_fault_has_no_fault_table(provenance):
    html = report(no_fault_result(), provenance)
    assert "physical value" not in html
    assert "No fault found" in html


def test_prints_on_a4(provenance):
    assert "size: A4" in report(fault_result(), provenance)


def test_notes_stand_by_kind_and_in_the_order_of_the_document(provenance):
    notes = (Note.advice("look"), Note.method("so"), Note.limit("one"), Note.limit("two"))
    page = report(replace(fault_result(), notes=notes), provenance)
    heads = [page.index(f"<h3>{title}</h3>") for title in ("Limits", "How it was computed", "What you can do")]
    assert heads == sorted(heads)
    assert heads[0] < page.index("<li>one</li>") < page.index("<li>two</li>") < heads[1] < page.index("<li>so</li>")
    assert heads[2] < page.index("<li>look</li>")
