"""The content of a report in every rendering: what it holds is shown, on a terminal, in files and on the page."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from bfi_cli.notes import Note
from bfi_cli.report.content import Curve, Drawing, HeatMap, Panel, ReportContent, Span, Table, curve
from bfi_cli.report.figures import draw
from bfi_cli.report.files import content_files
from bfi_cli.report.html import render_content
from bfi_cli.report.terminal import MAX_ROWS, print_content
from bfi_cli.serialization import from_plain, provenance, to_plain

X = np.linspace(0.0, 1.0, 5)
STYLES = ("line", "dashed", "dotted", "wide", "points", "steps", "bars", "intervals", "faint_intervals")
CURVES = tuple(curve(f"curve {style}", X, X + i, style=style, low=X, high=X + 2 * i) for i, style in enumerate(STYLES))
PANEL = Panel(
    title="a panel",
    x_label="onset [s]",
    y_label="statistic [-]",
    curves=CURVES,
    levels=(("threshold", 2.0),),
    spans=(Span(label="fault", low=0.2, high=0.4), Span(label="fault", low=0.6, high=0.6)),
)
MAP = HeatMap(
    title="a map", rows=("a", "b"), columns=("c",), values=(np.array([0.25]), np.array([np.nan])), label="bit"
)
DRAWING = Drawing(name="profile", caption="What <is> seen.", panels=(PANEL, PANEL, PANEL), heat_maps=(MAP,), across=2)
CONTENT = ReportContent(
    category="Onset of a fault",
    title="flight_$1$.h5",
    heading="Fault found",
    verdict="A bias of 1 m/s.",
    tone="fault",
    facts=(("Window", "0 to 1 s"),),
    tables=(Table(name="faults", title="Faults", heads=("shape", "onset"), rows=(("bias", "0.5 s"),)),),
    drawings=(DRAWING,),
    notes=(Note.limit("mind <this>"),),
)


def test_every_curve_level_span_and_map_is_drawn():
    axes = draw(DRAWING).axes
    names = axes[0].get_legend_handles_labels()[1]
    assert set(names) == {*(one.label for one in CURVES), "threshold", "fault"}
    assert len(names) == len(set(names))
    assert [one.get_title(loc="left") for one in axes if one.images] == ["a map"]
    assert [text.get_text() for one in axes for text in one.texts] == ["0.25"]


def test_panels_stand_where_the_solver_put_them_to_a_millionth():
    """Its last digits differ from run to run, and with them the names in the SVG."""
    for axes in draw(DRAWING).axes:
        bounds = axes.get_position().bounds
        assert bounds == pytest.approx([round(number, 6) for number in bounds], rel=1e-14)


def test_a_curve_is_drawn_as_given():
    only = Panel(x_label="", y_label="", curves=(curve("one", X, X**2),), log_y=True, y_limits=(1e-3, 2.0))
    (axes,) = draw(Drawing(name="one", caption="", panels=(only,))).axes
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), X**2)
    assert (axes.get_yscale(), axes.get_ylim()) == ("log", (1e-3, 2.0))


def test_a_drawing_of_nothing_is_a_figure():
    assert draw(Drawing(name="none", caption="", panels=(Panel(x_label="", y_label="", curves=()),))).axes


@pytest.mark.slow
def test_the_files_of_a_report():
    files = content_files(CONTENT, {"kind": "test", "value": np.nan}, provenance(log_sha256=""))
    assert set(files) == {
        *("profile.svg", "profile.png", "profile_figure.csv", "faults.csv", "report.html", "result.json")
    }
    assert json.loads(files["result.json"]) == {"kind": "test", "value": None}
    points = list(csv.DictReader(files["profile_figure.csv"].decode().splitlines()[1:]))
    assert len(points) == 3 * len(STYLES) * X.size + 2
    last = {"panel": "a map", "curve": "b", "x_is": "", "x": "c", "y_is": points[-1]["y_is"], "y": ""}
    assert points[-1] == last | {"low": "", "high": ""}
    assert files["faults.csv"] == b"# written by bfi\nshape,onset\nbias,0.5 s\n"


def test_the_report_shows_it_all_and_escapes_it():
    page = render_content(CONTENT, provenance(log_sha256=""), {"profile": b"<svg/>"})
    for text in ("Onset of a fault", "A bias of 1 m/s.", "0.5", "mind &lt;this&gt;", "What &lt;is&gt; seen.", "Window"):
        assert text in page
    assert page.count("http") == page.count("http-equiv")
    assert page.lstrip().startswith("<!DOCTYPE html>")


def test_the_terminal_shows_it_all_and_cuts_long_tables():
    rows = tuple((f"row{i}", "x") for i in range(MAX_ROWS + 2))
    long = ReportContent(
        category="",
        title="",
        heading="",
        verdict="so",
        tables=(Table(name="t", title="T", heads=("a", "b"), rows=rows),),
    )
    console = Console(record=True, width=100, file=io.StringIO(), force_terminal=True)
    print_content(CONTENT, console)
    print_content(long, console)
    text = console.export_text()
    for expected in ("A bias of 1 m/s.", "Faults", "0.5 s", "mind <this>", "0 to 1 s", "row0", "and 2 more"):
        assert expected in text
    assert f"row{MAX_ROWS}" not in text


def test_a_content_survives_json():
    again = from_plain(ReportContent, json.loads(json.dumps(to_plain(CONTENT))), where="x")
    assert to_plain(again) == to_plain(CONTENT)
    assert isinstance(again.drawings[0].panels[0].curves[0], Curve)


@pytest.mark.parametrize("style", STYLES)
def test_gaps_are_left_out(style):
    gap = curve("gap", X, np.where(X > 0.5, np.nan, X), style=style)
    assert draw(Drawing(name="gap", caption="", panels=(Panel(x_label="", y_label="", curves=(gap,)),))).axes


def test_boxes_are_drawn_at_their_quantiles():
    quantiles = np.array([1.0, 2.0, 4.0, 5.0, 8.0, 9.0])
    boxes = curve("boxes", np.repeat([1.0, 2.0], 6), np.concatenate([quantiles, 10.0 * quantiles]), style="boxes")
    (axes,) = draw(Drawing(name="b", caption="", panels=(Panel(x_label="", y_label="", curves=(boxes,)),))).axes
    drawn = {float(y) for line in axes.lines for y in line.get_ydata()}
    assert drawn == {*quantiles, *(10.0 * quantiles)}


def test_intervals_lie_on_their_side_and_ticks_and_notes_stand_where_they_are_put():
    one = curve("one", [3.0], [1.0], style="intervals", low=[2.0], high=[5.0])
    panel = Panel(
        x_label="",
        y_label="",
        curves=(one,),
        y_limits=(2.5, -0.5),
        y_ticks=(("a", 0.0), ("b", 1.0)),
        side_notes=(("3 m/s", 1.0),),
        x_limits=(-2000.0, 2000.0),
        linear_x=1.0,
    )
    (axes,) = draw(Drawing(name="i", caption="", panels=(panel,))).axes
    ((segment,),) = [bars.get_segments() for bars in axes.collections]
    np.testing.assert_allclose(segment, [[2.0, 1.0], [5.0, 1.0]])
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["a", "b"]
    assert axes.get_yticks().tolist() == [0.0, 1.0]
    assert [(note.get_text(), note.get_position()[1]) for note in axes.texts] == [("3 m/s", 1.0)]
    assert (axes.get_xscale(), axes.get_xlim()) == ("symlog", (-2000.0, 2000.0))
    assert axes.get_xticks().tolist() == [-1000.0, -100.0, -10.0, -1.0, 0.0, 1.0, 10.0, 100.0, 1000.0]


def test_what_is_nearly_one_does_not_read_one():
    values = tuple(np.array([value]) for value in (1.0, 0.9996, 0.996, 0.5))
    heat_map = HeatMap(title="", rows=("a", "b", "c", "d"), columns=("e",), values=values, label="")
    axes = draw(Drawing(name="m", caption="", heat_maps=(heat_map,))).axes[0]
    assert [text.get_text() for text in axes.texts] == ["1", "0.999", "0.996", "0.5"]


@pytest.mark.slow
def test_data_wins_over_the_table_of_its_name():
    content = replace(CONTENT, data={"faults.csv": {"onset_s": np.array([0.123456789]), "name": ["bias"]}})
    files = content_files(content, {}, provenance(log_sha256=""), stored="summary.json")
    assert files["faults.csv"] == b"# written by bfi\nonset_s,name\n0.123456789,bias\n"
    assert "result.json" not in files
    assert "summary.json" in files
