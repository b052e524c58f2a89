"""The page to zoom: one file that fetches nothing, runs nothing but its own script, and holds what was drawn."""

from __future__ import annotations

import html
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from bfi_cli.report.content import Block, Drawing, Lane, Panel, ReportContent, curve
from bfi_cli.report.figures import draw
from bfi_cli.report.log import lane_panel
from bfi_cli.report.zoom import render_zoom

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(1)>\"'&lt;\u202e\u2028\x1b[31m"
T = np.arange(0.0, 100.0, 0.1)


def content(*, name: str = "tas", values: np.ndarray = T, blocks: tuple[Block, ...] = ()) -> ReportContent:
    band = Block(label=name, low=10.0, high=60.0, shade="sky")
    lanes = (Lane(label=name, blocks=(band,)), Lane(label="events", blocks=blocks))
    panels = (
        Panel(x_label="time [s]", y_label="", curves=(), lanes=lanes, x_limits=(0.0, 100.0), height=0.3, clock=True),
        Panel(
            x_label="time [s]",
            y_label=f"{name}\n[m/s]",
            curves=(curve(name, T, values),),
            bands=(band,),
            x_limits=(0.0, 100.0),
            height=0.5,
        ),
    )
    drawing = Drawing(name="channels", caption=f"Channels of {name}.", panels=panels, shared_x=True)
    return ReportContent(
        category="Flight log", title=name, heading="Channels", verdict=name, drawings=(drawing,), zoom=(drawing,)
    )


class Page(HTMLParser):
    """Collects tags and the text of each script."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[str] = []
        self.scripts: list[str] = []
        self.inside = False
        self.attributes: list[tuple[str, str | None]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        if self.inside_script(tag):
            self.scripts.append("")

    def inside_script(self, tag: str) -> bool:
        self.inside = tag == "script"
        return self.inside

    def handle_endtag(self, tag: str) -> None:
        self.inside = False

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.scripts[-1] += data


def data_of(text: str) -> dict:
    return json.loads(Page(text).scripts[0])


def test_the_page_fetches_nothing_and_forbids_to() -> None:
    text = render_zoom(content())
    page = Page(text)
    outside = text.replace("http://www.w3.org/2000/svg", "")  # the name of a language, which is not fetched
    assert not re.search(
        r"https?:|//[a-z]+\.|@import|url\((?!#)|\bfetch\(|XMLHttp|import\(|\beval\(|innerHTML", outside
    )
    assert not [key for key, _ in page.attributes if key in ("src", "href", "action", "srcset") or key.startswith("on")]
    (policy,) = [value for key, value in page.attributes if key == "content" and value and "default-src" in value]
    assert policy.startswith("default-src 'none';")
    assert page.tags.count("script") == 2


def test_names_run_nothing() -> None:
    event = Block(label=HOSTILE, low=5.0, high=5.0, shade="fault")
    text = render_zoom(content(name=HOSTILE, blocks=(event,)))
    page = Page(text)
    assert page.tags.count("script") == 2
    assert "img" not in page.tags
    assert page.scripts[1] == Page(render_zoom(content())).scripts[1]
    assert all(letter.isprintable() or letter == "\n" for letter in text)
    data = data_of(text)
    shown = r"</script><script>alert(1)</script><img src=x onerror=alert(1)>" + "\"'&lt;" + r"\u202e\u2028\x1b[31m"
    assert data["panels"][1]["label"] == [shown, "[m/s]"]
    assert data["panels"][0]["lanes"][1]["blocks"][0][0] == shown
    assert html.escape("<img src=x onerror=alert(1)>") in text


def test_the_page_holds_what_is_drawn() -> None:
    values = np.sin(T) * 1e4 + 1e-3
    values[17] = np.nan
    data = data_of(render_zoom(content(values=values)))
    lanes, panel = data["panels"]
    assert data["limits"] == [0.0, 100.0]
    assert data["step"] == pytest.approx(0.1)
    assert lanes["lanes"][0]["blocks"] == [["tas", 10.0, 60.0, "sky"]]
    np.testing.assert_allclose(panel["curves"][0]["x"], T, atol=1e-4)
    assert panel["curves"][0]["y"][17] is None
    drawn = np.array([np.nan if one is None else one for one in panel["curves"][0]["y"]])
    np.testing.assert_allclose(drawn, values, atol=1e4 * 1e-7 * 10)


@pytest.mark.parametrize("values", [np.zeros(T.size), np.full(T.size, np.nan), 1e300 * T, 1e-300 * T])
def test_any_numbers_can_be_shown(values: np.ndarray) -> None:
    assert len(data_of(render_zoom(content(values=values)))["panels"][1]["curves"][0]["y"]) == T.size


def test_lanes_are_drawn_with_their_names_and_the_clock() -> None:
    wide, narrow = (Block(label=name, low=a, high=b, shade="sky") for name, a, b in (("wide", 0, 50), ("thin", 50, 51)))
    late = Block(label="late event", low=99.0, high=99.0, shade="fault")
    lanes = (Lane(label="phase", blocks=(wide, narrow)), Lane(label="event", blocks=(late,)))
    panel = Panel(x_label="time [s]", y_label="", curves=(), lanes=lanes, x_limits=(0.0, 100.0), height=0.3, clock=True)
    figure = draw(Drawing(name="lanes", caption="", panels=(panel,)))
    (axes,) = figure.axes
    (upper,) = axes.child_axes
    assert [text.get_text() for text in axes.get_yticklabels()] == ["event", "phase"]
    # What fits stands in its block, an event beside itself within the axes, what does not fit in the key.
    assert {text.get_text(): text.get_ha() for text in axes.texts} == {"wide": "center", "late event": "right"}
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["thin"]
    assert [text.get_text() for text in upper.get_xticklabels()][:3] == ["0:00", "0:15", "0:30"]


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("n", [1, 2, 20])
def test_any_number_of_lanes_finds_room(n: int) -> None:
    """A layout without room would be a warning, and here an error."""
    blocks = tuple(Block(label=f"block {i}", low=i, high=i + 1.0, shade="sky") for i in range(12))
    panel = lane_panel([Lane(label=f"lane {i}", blocks=blocks) for i in range(n)], (0.0, 1e5))
    (axes,) = draw(Drawing(name="lanes", caption="", panels=(panel,))).axes
    assert len(axes.get_yticks()) == n


def test_panels_of_a_shared_axis_move_together() -> None:
    figure = draw(content().drawings[0])
    first, last = figure.axes
    assert first.get_xlim() == last.get_xlim() == (0.0, 100.0)
    assert (first.get_xlabel(), last.get_xlabel()) == ("", "time [s]")
    assert last.get_ylabel() == "tas\n[m/s]"
