"""Times of a log as clock times in its report."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.epoch import DAY_S, Epoch
from bfi_cli.notes import Note
from bfi_cli.report.clock import with_clock
from bfi_cli.report.content import Drawing, Panel, ReportContent, Table
from bfi_cli.report.figures import draw
from bfi_cli.report.first_screen import Screen

START_S = 47_920.0
ROWS = (("ground", "48000", "48100", "x"), ("turn", "50000.5", "-", "y"))
TABLE = Table(
    name="events",
    title="Events",
    heads=("what", "from [s]", "to [s]", "size"),
    rows=ROWS,
    times_s=((48_000.0, 48_100.0), (50_000.5, None)),
    last_time=2,
)
PANEL = Panel(x_label="time [s]", y_label="tas", curves=(), x_limits=(START_S, START_S + 3600.0), clock=True)
CONTENT = ReportContent(
    category="A flight",
    title="log.csv",
    heading="Fault",
    verdict="A bias from 50000.5 s.",
    facts=(("Flight", "47920 to 54267 s"),),
    tables=(TABLE, replace(TABLE, times_s=())),
    drawings=(Drawing(name="timeline", caption="x", panels=(PANEL,)),),
    data={
        "events.csv": {"onset_s": [48_000.0, 50_000.5], "offset_s": [48_100.0, None], "duration_s": [100.0, 3.0]},
        "series.csv": lambda: {"time [s]": np.array([48_000.0])},
    },
)


def shown(clock: str | None, content: ReportContent = CONTENT, *, days: float = 0.0) -> ReportContent:
    return with_clock(content, clock, start_s=START_S, stop_s=54_267.0 + DAY_S * days)


def test_a_log_without_a_clock_is_shown_as_it_was():
    assert shown(None) is CONTENT


def test_the_clock_stands_behind_the_times_of_a_table_and_in_the_facts():
    content = shown("2011-07-01T00:00:00")
    table, other = content.tables
    assert table.heads == ("what", "from [s]", "to [s]", "clock", "size")
    assert [row[3] for row in table.rows] == ["13:20:00.0 to 13:21:40.0", "13:53:20.5"]
    assert [(*row[:3], *row[4:]) for row in table.rows] == list(ROWS)
    assert other == CONTENT.tables[1]
    assert content.facts == (("Clock", "2011-07-01 13:18:40 to 15:04:27"), *CONTENT.facts)
    assert content.verdict == CONTENT.verdict
    assert shown("2011-07-01T00:00:00Z").tables[0].heads[3] == "clock [UTC]"


def test_csv_files_have_the_moment_behind_each_time():
    data = shown("2011-07-01T00:00:00Z").data
    columns = {name: made() if callable(made) else made for name, made in data.items()}
    assert list(columns["events.csv"]) == ["onset_s", "onset_clock", "offset_s", "offset_clock", "duration_s"]
    assert columns["events.csv"]["onset_clock"] == ["2011-07-01T13:20:00.000Z", "2011-07-01T13:53:20.500Z"]
    assert columns["events.csv"]["offset_clock"] == ["2011-07-01T13:21:40.000Z", ""]
    assert columns["series.csv"]["time_clock"] == ["2011-07-01T13:20:00.000Z"]


@pytest.mark.parametrize(
    ("clock", "days"),
    [("2011-06-30T00:00:00", ("2011-06-30", "2011-07-01")), ("00:00:00", ("day 1", "day 2"))],
)
def test_a_log_of_more_than_a_day_has_its_dates(clock: str, days: tuple[str, str]):
    late = replace(TABLE, times_s=((48_000.0, 48_100.0), (48_000.0, 48_000.0 + DAY_S)))
    table = shown(clock, replace(CONTENT, tables=(late,)), days=1.0).tables[0]
    first, second = days
    assert [row[3] for row in table.rows] == [
        f"{first} 13:20:00 to 13:21:40",
        f"{first} 13:20:00 to {second} 13:20:00",
    ]


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("a bias from 1721484013.8 s", "a bias from 14:00:13.8"),
        (
            "from 1721484013.800 s (1721484013.790 to 1721484013.810 s)",
            "from 14:00:13.800 (14:00:13.790 to 14:00:13.810)",
        ),
        ("1721484000 s to 1721484031 s", "14:00:00 to 14:00:31"),
        ("give --from 1721484000 --to 1721484031", None),
        ("'bias_1721484013.8' is 'from 1721484013 s'", None),
        ("a drift of 1721484013 s/m, 40 s and 86400 s", None),
    ],
)
def test_sentences_of_an_axis_since_1970_have_clock_times(sentence: str, expected: str | None):
    expected = sentence if expected is None else expected
    content = replace(
        CONTENT,
        verdict=sentence,
        notes=(Note.limit(sentence),),
        screen=Screen(
            state="fault",
            channel="tas",
            text=sentence,
            lines={"Also": (sentence,)},
        ),
    )
    epoch = Epoch(since_1970_s=0.0, is_utc=True).iso
    made = with_clock(content, epoch, start_s=1_721_484_000.0, stop_s=1_721_484_031.7)
    assert made.screen is not None
    assert {made.verdict, made.notes[0].text, made.screen.text, *made.screen.lines["Also"]} == {expected}
    of_a_day = with_clock(content, "2024-07-20T00:00:00Z", start_s=50_400.0, stop_s=50_431.7)
    assert of_a_day.verdict == sentence


def test_figures_number_the_hours_of_the_day():
    def labels(content: ReportContent) -> list[str]:
        (axes,) = draw(content.drawings[0]).axes
        (upper,) = axes.child_axes
        return [text.get_text() for text in upper.get_xticklabels()]

    assert "13:30:00" in labels(CONTENT)
    late = replace(PANEL, x_limits=(DAY_S - 600.0, DAY_S + 600.0))
    content = replace(CONTENT, drawings=(replace(CONTENT.drawings[0], panels=(late,)),))
    assert "24:00:00" in labels(content)
    ticks = labels(shown("00:00:00", content))
    assert "00:00:00" in ticks
    assert all(re.fullmatch(r"\d\d:\d\d:\d\d", tick) for tick in ticks)
    # An axis that counts from no midnight is numbered at whole minutes all the same.
    early = replace(content, drawings=(replace(content.drawings[0], panels=(PANEL,)),))
    assert {tick[-2:] for tick in labels(shown("2011-07-01T11:58:20.500Z", early))} == {"00"}


def test_a_damaged_clock_of_a_document_is_refused():
    with pytest.raises(ValueError, match="no moment"):
        shown("yesterday")
