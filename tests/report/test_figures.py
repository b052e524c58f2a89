"""Figures: every axis says what it shows and in which unit, no spike is lost, the same result gives the same bytes."""

import io
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_results import fault_result, no_fault_result, two_output_result
from matplotlib.image import imread

from bfi_cli.model.report import MAX_CANDIDATES, identify_content, shown_candidates
from bfi_cli.report.content import thinned
from bfi_cli.report.figures import draw
from bfi_cli.report.style import to_png, to_svg

UNIT = re.compile(r"\[.+\]$")
CATEGORIES = ("dictionary entry", "fault looked for")


def panels(figure):
    return [axes for axes in figure.axes if axes.axison]


def line(axes, label):
    return next(entry for entry in axes.lines if entry.get_label() == label)


@pytest.mark.first_rows(1)
def test_every_axis_has_a_label_with_its_unit(figures):
    for figure in figures.values():
        for axes in panels(figure):
            assert axes.get_ylabel() in CATEGORIES or UNIT.search(axes.get_ylabel())
            assert not axes.get_xlabel() or UNIT.search(axes.get_xlabel())
        assert UNIT.search(panels(figure)[-1].get_xlabel())


@pytest.mark.slow
def test_nothing_is_cut_at_the_edge_of_the_paper(figures):
    for name, figure in figures.items():
        pixels = imread(io.BytesIO(to_png(figure)))[..., :3]
        edges = (pixels[:2], pixels[-2:], pixels[:, :2], pixels[:, -2:])
        assert all(np.all(edge == 1.0) for edge in edges), name


def figure_of(result, name):
    (drawing,) = (one for one in identify_content(result).drawings if one.name == name)
    return draw(drawing)


@pytest.mark.slow
def test_the_same_result_gives_the_same_bytes():
    for drawing in identify_content(fault_result()).drawings:
        assert to_svg(draw(drawing)) == to_svg(draw(drawing)), drawing.name


@pytest.mark.first_rows(1)
def test_svg_is_whole_and_fetches_nothing(vectors):
    for svg in vectors.values():
        root = ElementTree.fromstring(svg)
        links = [value for node in root.iter() for key, value in node.attrib.items() if key.endswith("href")]
        assert root.tag.endswith("svg")
        assert all(link.startswith("#") for link in links)


@pytest.mark.slow
def test_figures_do_not_depend_on_the_users_settings():
    import matplotlib as mpl

    expected = to_svg(figure_of(fault_result(), "outputs"))
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red", "svg.fonttype": "none"}):
        assert to_svg(figure_of(fault_result(), "outputs")) == expected


@pytest.mark.slow
def test_drawing_leaves_no_global_state():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    to_png(figure_of(fault_result(), "residuals"))
    assert dict(mpl.rcParams) == before


@pytest.mark.slow
def test_one_row_of_panels_per_output():
    made = two_output_result()
    assert len(figure_of(made, "outputs").axes) == 2 + 1
    assert len(figure_of(made, "fault").axes) == 2
    assert len(figure_of(made, "residuals").axes) == 2 * 3


def test_the_lines_are_the_signals_of_the_result():
    made = fault_result()
    series = made.outputs[0]
    axes = figure_of(made, "outputs").axes[0]
    np.testing.assert_array_equal(line(axes, "measured").get_ydata(), series.measured)
    np.testing.assert_array_equal(line(axes, "corrected for the fault").get_ydata(), series.corrected)
    np.testing.assert_array_equal(line(figure_of(made, "fault").axes[0], "injected").get_ydata(), series.true_fault)


def test_an_unknown_truth_is_not_drawn():
    labels = figure_of(two_output_result(), "fault").axes[0].get_legend_handles_labels()[1]
    assert "injected" not in labels
    assert "reconstructed, with 95 % band" in labels


def test_alarm_marks_stand_at_the_alarms():
    made = fault_result()
    marks = figure_of(made, "residuals").axes[0].containers[0].lines[0]
    series = made.outputs[0]
    np.testing.assert_allclose(marks.get_xdata(), made.residuals[0].plain_alarms_s)
    np.testing.assert_allclose(marks.get_ydata(), series.plain_residual[np.isin(made.time_s, marks.get_xdata())])


def test_the_chosen_order_is_marked_at_the_least_criterion():
    mark = figure_of(fault_result(), "orders").axes[0].containers[0].lines[0]
    assert (list(mark.get_xdata()), list(mark.get_ydata())) == ([4], [0.0])


def test_magnitudes_are_drawn_in_units_of_the_minimal_detectable():
    made = fault_result()
    bars = figure_of(made, "magnitudes").axes[0].containers
    drawn = [point for bar in bars for point in zip(*bar.lines[0].get_data(), strict=True)]
    expected = [
        (one.magnitude / one.minimal_detectable, row)
        for row, one in enumerate(made.candidates)
        if one.magnitude is not None
    ]
    np.testing.assert_allclose(drawn, expected)


@pytest.mark.slow
def test_a_large_dictionary_keeps_what_was_declared():
    made = fault_result()
    quiet = [replace(made.candidates[1], name=f"drift_{i}") for i in range(300)]
    many = replace(made, candidates=(*quiet, made.candidates[0]))
    shown = shown_candidates(many)
    assert len(shown) == MAX_CANDIDATES
    assert shown[-1] is made.candidates[0]
    to_png(figure_of(many, "magnitudes"))


@pytest.mark.slow
def test_names_are_never_read_as_mathematics():
    made = fault_result(channel="a$b_{$\\frac<&")
    for drawing in identify_content(made).drawings:
        ElementTree.fromstring(to_svg(draw(drawing)))


def test_noise_free_residuals_are_drawn():
    made = no_fault_result()
    zero = np.zeros_like(made.time_s)
    series = replace(made.outputs[0], prediction_error=zero, plain_residual=zero)
    exact = replace(made, outputs=(series,), residuals=(replace(made.residuals[0], plain_sd=0.0),))
    to_png(figure_of(exact, "residuals"))


@given(
    x=arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6) | st.just(np.nan)),
    max_points=st.integers(4, 100),
)
def test_thinning_keeps_ends_and_extremes(x, max_points):
    kept = thinned(x, max_points=max_points)
    assert np.all(np.diff(kept) > 0)
    assert (kept[0], kept[-1]) == (0, x.size - 1)
    assert kept.size <= max(max_points + 4, min(x.size, max_points))
    if not np.isnan(x).all():
        assert np.nanmin(x[kept]) == np.nanmin(x)
        assert np.nanmax(x[kept]) == np.nanmax(x)


@pytest.mark.slow
def test_a_backend_named_by_the_shell_does_not_matter():
    """What a shell in a notebook hands on: matplotlib is not to be imported with a backend that is not installed."""
    backend = "module://matplotlib_inline.backend_inline"
    program = (
        "import os; from bfi_cli.report.content import Drawing, Panel; from bfi_cli.report.figures import draw; "
        "from bfi_cli.report.style import to_svg; panel = Panel(x_label='', y_label='', curves=()); "
        "to_svg(draw(Drawing(name='x', caption='', panels=(panel,)))); "
        f"assert os.environ['MPLBACKEND'] == {backend!r}"
    )
    environment = {**os.environ, "MPLBACKEND": backend}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
