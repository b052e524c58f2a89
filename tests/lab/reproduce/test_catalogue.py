"""Names, documents and what every reproduction has in common."""

from __future__ import annotations

import importlib
import inspect
import json
import re
from collections.abc import Callable

import pytest
from noted import texts

from bfi_cli.errors import ConfigError, LogError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject
from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.catalogue import (
    ABSENT,
    REPRODUCTIONS,
    find,
    list_content,
    reproduce_content,
    reproduce_document,
    run,
    summary_content,
)
from bfi_cli.lab.reproduce.record import thesis_record
from bfi_cli.report.content import ReportContent
from bfi_cli.serialization import provenance, to_plain

OURS = (
    *("fir", "thesis-table-2-1", "thesis-5-1", "thesis-5-2", "thesis-5-3", "thesis-5-4", "thesis-5-7", "thesis-5-13"),
    *("thesis-A-1", "thesis-A-2", "thesis-A-3", "thesis-A-4", "isolation-noise", "sparsity"),
)
# Every figure and table of the three papers: the thesis, the F-16 paper, the paper on the null space.
PRINTED = (
    *("thesis-2-1", "thesis-2-2", *(f"thesis-5-{i}" for i in range(1, 17)), *(f"thesis-A-{i}" for i in range(1, 5))),
    *("thesis-table-2-1", "thesis-table-5-1", "thesis-table-5-2", "thesis-table-B-1"),
    *("f16-1", "f16-2", "f16-3", "f16-table1", "f16-table2", "hankel-b747"),
)
SOURCE = re.compile(r"\((table |figure |listing|sections? )?[\dA]-\d|figure [\dA]-\d|^-$")


def test_every_figure_and_table_of_the_papers_has_a_page_or_a_reason_why_not(made: Callable[[str], ReportContent]):
    assert set(PRINTED) == {*REPRODUCTIONS, *ABSENT} - {"benchmark", "fir", "isolation-noise", "sparsity"}
    assert not set(REPRODUCTIONS) & set(ABSENT)
    with pytest.raises(ConfigError, match="reproduce: thesis-2-2 has no page, it is a block diagram"):
        find("thesis-2-2")
    assert [row[0] for row in made("thesis-table-2-1").tables[0].rows] == [
        *("abrupt blockage", "gradual blockage", "partial water blockage")
    ]


@pytest.mark.parametrize("name", REPRODUCTIONS)
def test_every_name_has_a_function_that_takes_settings(name: str):
    entry = REPRODUCTIONS[name]
    module = importlib.import_module(f"bfi_cli.lab.reproduce.{entry.module}")
    first, *further = inspect.signature(getattr(module, entry.function)).parameters.values()
    assert first.name == "settings"
    assert all(one.default is not one.empty for one in further)


def test_a_name_is_found_in_any_case_and_a_wrong_one_is_answered_with_the_nearest():
    assert find("Thesis-a-1") == "thesis-A-1"
    with pytest.raises(ConfigError, match="got 'thesis-5-31'; did you mean 'thesis-5-3'"):
        run("thesis-5-31", Settings())


@pytest.mark.slow
@pytest.mark.parametrize("name", OURS)
def test_the_document_alone_gives_the_content_back(name: str, made: Callable[[str], ReportContent]):
    content = made(name)
    document = json.loads(json.dumps(reproduce_document(name, content, provenance(log_sha256=""))))
    assert (document["kind"], document["schema"], document["name"]) == ("reproduce", 4, name)
    assert texts(document["notes"]) == list(texts(content.notes))
    assert to_plain(reproduce_content(document)) == to_plain(content)


@pytest.mark.slow
@pytest.mark.parametrize("name", OURS)
def test_published_and_ours_stand_first_each_published_value_with_its_place(
    name: str, made: Callable[[str], ReportContent]
):
    content = made(name)
    first = content.tables[0]
    assert (first.name, first.heads) == ("comparison", ("quantity", "printed", "computed here"))
    published = [row[1] for row in first.rows]
    assert [text for text in published if not SOURCE.search(text)] == []
    assert any(text != "-" for text in published)
    assert all(len(cell) <= 60 for row in first.rows for cell in row)
    assert content.drawings
    assert all(panel.curves for drawing in content.drawings for panel in drawing.panels)
    assert texts(content.notes)


@pytest.mark.slow
def test_names_that_share_figures_share_the_function_and_every_figure_is_drawn(made: Callable[[str], ReportContent]):
    drawn = {drawing.name for name in OURS for drawing in made(name).drawings}
    figures = {name.lower().replace("-", "_") for name in OURS if name.startswith("thesis")}
    assert figures <= drawn
    assert len({(REPRODUCTIONS[f"thesis-A-{i}"].function) for i in range(1, 5)}) == 1


def test_the_list_and_the_summary_name_everything(made: Callable[[str], ReportContent]):
    assert [row[0] for row in list_content().tables[0].rows] == list(REPRODUCTIONS)
    summary = summary_content([("fir", made("fir")), ("thesis-5-1", LogError("log.csv: too short"))])
    assert summary.verdict == "Made 1 of 2 figures and tables; not thesis-5-1."
    assert summary.tables[0].rows[0][2:] == (made("fir").heading, made("fir").verdict)
    assert summary.tables[0].rows[1][2:] == ("not made", "log.csv: too short")


def test_a_log_that_carries_faults_is_refused():
    faulty = inject(thesis_record(Settings()), [Fault(shape="bias", onset_s=10.0)])
    with pytest.raises(LogError, match="got a log with 1 injected; give the fault-free one"):
        run("thesis-5-1", Settings(log=faulty))
