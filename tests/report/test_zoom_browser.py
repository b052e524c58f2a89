"""The page to zoom as a person uses it: in a headless browser, with a real mouse and real keys, without a network."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bfi_cli.report.content import Block, Drawing, Lane, Panel, ReportContent, curve
from bfi_cli.report.log import lane_panel
from bfi_cli.report.zoom import render_zoom

playwright = pytest.importorskip("playwright.sync_api")

HOSTILE = "<img src=x onerror=\"document.title='run'\">"
T = np.arange(0.0, 200.0, 0.1)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def content() -> ReportContent:
    """Return two logs of one airspeed, an altitude of one, a limit, and an event from 80 s to 100 s."""
    fault = Block(label=HOSTILE, low=80.0, high=100.0, shade="fault")
    lanes = (Lane(label="phase", blocks=(Block(label="cruise", low=0.0, high=200.0, shade="sky"),)),)
    event = (Lane(label="event", blocks=(fault,)),)
    airspeeds = (curve("a.h5", T, 100.0 + T), curve("b.h5", T, 300.0 - T))
    altitude = (curve("a.h5", T, 2.0 * T, low=2.0 * T - 5.0, high=2.0 * T + 5.0),)
    onset = (Block(label="", low=80.0, high=80.0, shade="fault"),)
    settings: dict[str, Any] = {"x_label": "time [s]", "x_limits": (0.0, 200.0), "bands": onset, "height": 0.6}
    drawing = Drawing(
        name="channels",
        caption="",
        panels=(
            lane_panel((*lanes, *event), (0.0, 200.0)),
            Panel(y_label="tas\n[m/s]", curves=airspeeds, **settings),
            Panel(y_label=f"{HOSTILE}\n[m]", curves=altitude, levels=((HOSTILE, 200.0),), **settings),
        ),
        shared_x=True,
    )
    texts = {"category": "Flight logs", "title": "two", "heading": "Channels", "verdict": ""}
    return ReportContent(**texts, drawings=(), zoom=(drawing,))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    installed = next(filter(None, map(shutil.which, BROWSERS)), None)
    with playwright.sync_playwright() as driver:
        try:
            started = driver.chromium.launch(executable_path=installed, args=["--no-sandbox"])
        except playwright.Error as error:
            pytest.skip(f"no browser can be started: {str(error).splitlines()[0]}")
        yield started
        started.close()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "zoom.html"
    path.write_text(render_zoom(content()), "utf-8")
    return path


@pytest.fixture
def page(browser: Any, file: Path) -> Iterator[Any]:
    """Open the page; whatever it asks of a network, or its script complains of, fails the test."""
    context = browser.new_context(viewport={"width": 1200, "height": 900}, offline=True)
    page, wrong = context.new_page(), list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: wrong.append(asked.url) if asked.url != file.as_uri() else None)
    page.goto(file.as_uri())
    yield page
    context.close()
    assert wrong == []


def place(page: Any, time_s: float, *, panel: int = 1) -> tuple[float, float]:
    """Return where a time of the view stands in a panel, pixels of the window."""
    low, high = view(page)
    box = page.locator("#panels > svg").nth(panel).bounding_box()
    left, right = 92.0, 14.0
    share = (time_s - low) / (high - low)
    return box["x"] + left + share * (box["width"] - left - right), box["y"] + 0.5 * box["height"]


def view(page: Any) -> tuple[float, float]:
    page.evaluate("() => new Promise(requestAnimationFrame)")
    low, high = page.locator("#view").inner_text().replace("−", "-").replace(" s", "").split(" to ")
    return float(low), float(high)


def shown(page: Any) -> list[list[float]]:
    """Return the values at the time line, by panel and curve."""
    texts = page.locator("#panels .now").evaluate_all(
        "all => all.map(one => [...one.querySelectorAll('tspan')].map(t => t.textContent))"
    )
    return [[float(one.split()[0].replace("−", "-")) for one in panel] for panel in texts]


@pytest.mark.slow
def test_one_time_line_goes_through_all_panels(page: Any) -> None:
    page.mouse.move(*place(page, 60.0))
    lines = page.locator("#panels .hair").evaluate_all(
        "all => all.map(one => [one.getAttribute('visibility'), one.getBoundingClientRect().x])"
    )
    assert [seen for seen, _ in lines] == ["visible"] * 3
    assert max(x for _, x in lines) - min(x for _, x in lines) < 1e-6
    (_, (first, second), (height,)) = shown(page)
    assert (first, second, height) == pytest.approx((160.0, 240.0, 120.0), abs=0.5)
    assert float(page.locator("#cursor").inner_text().split()[0]) == pytest.approx(60.0, abs=0.2)
    page.mouse.move(5, 5)
    assert shown(page) == [[], [], []]


@pytest.mark.slow
def test_a_click_keeps_a_second_line_and_values_show_their_change(page: Any) -> None:
    page.mouse.click(*place(page, 40.0))
    page.mouse.move(*place(page, 140.0, panel=2))
    text = page.locator("#panels .now").nth(2).text_content()
    assert float(text.partition("(+")[2].rstrip(")")) == pytest.approx(200.0, abs=1.0)
    after, since = page.locator("#cursor").inner_text().split(", ")[1].split(" s after ")
    assert (float(after), float(since.split()[0])) == pytest.approx((100.0, 40.0), abs=0.5)
    page.mouse.click(*place(page, 40.0))
    assert page.locator("#panels .pin").first.get_attribute("visibility") == "hidden"


@pytest.mark.slow
def test_the_wheel_the_mouse_and_the_keys_zoom_and_move(page: Any) -> None:
    assert view(page) == (0.0, 200.0)
    page.mouse.move(*place(page, 150.0))
    page.mouse.wheel(0, -500)
    low, high = view(page)
    assert high - low < 110.0
    assert (150.0 - low) / (high - low) == pytest.approx(0.75, abs=0.02)
    at = place(page, 150.0)
    page.mouse.down()
    page.mouse.move(at[0] + 120.0, at[1], steps=3)
    page.mouse.up()
    moved = view(page)
    assert moved[0] < low - 5.0
    assert moved[1] - moved[0] == pytest.approx(high - low, abs=0.2)
    page.keyboard.press("Home")
    assert view(page) == (0.0, 200.0)
    page.get_by_role("button", name="+").click()
    assert view(page) == (50.0, 150.0)


@pytest.mark.slow
def test_a_button_released_outside_holds_nothing(page: Any) -> None:
    x, y = place(page, 100.0)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, 5)
    page.mouse.up()
    page.get_by_role("button", name="+").click()
    before = view(page)
    page.mouse.move(x, y)
    page.mouse.move(x + 200.0, y, steps=3)
    assert view(page) == before == (50.0, 150.0)


@pytest.mark.slow
def test_an_event_that_is_clicked_is_seen_closer(page: Any) -> None:
    page.locator("#panels rect[data-low='80']").click()
    low, high = view(page)
    assert 60.0 < low < 80.0 < 100.0 < high < 120.0


@pytest.mark.slow
def test_channels_and_logs_are_chosen_by_click(page: Any) -> None:
    panels, curves = page.locator("#panels > svg"), page.locator("#panels path.curve")
    assert curves.count() == 3
    page.get_by_role("button", name="b.h5").click()
    view(page)
    assert curves.count() == 2
    page.locator("#channels button").nth(1).click()
    view(page)
    assert [panels.nth(i).is_visible() for i in range(3)] == [True, False, True]
    assert panels.nth(2).get_by_text("time [s]").is_visible()
    page.locator("#channels button").nth(1).click()
    page.get_by_role("button", name="b.h5").click()
    view(page)
    assert (curves.count(), panels.nth(1).is_visible()) == (3, True)


@pytest.mark.slow
def test_any_channel_is_drawn_against_any_other_over_the_time_in_view(page: Any) -> None:
    assert not page.locator("#xy").is_visible()
    page.select_option("#across", label="tas [m/s] a.h5")
    page.select_option("#up", label="tas [m/s] b.h5")
    view(page)
    drawn = page.locator("#xy path.curve")
    # 300 - t against 100 + t: one straight line from the upper left to the lower right.
    first, last = (drawn.get_attribute("d")[1:].split("L")[i].split() for i in (0, -1))
    assert float(first[0]) < float(last[0])
    assert float(first[1]) < float(last[1])
    # The time line follows the pointer in the view: at its middle t is 100 s.
    box = drawn.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert shown(page)[1] == pytest.approx([200.0, 200.0], abs=0.5)
    before = drawn.get_attribute("d").count("L")
    page.get_by_role("button", name="+").click()
    view(page)
    assert drawn.get_attribute("d").count("L") == pytest.approx(before / 2, abs=2)
    page.select_option("#across", label="off")
    view(page)
    assert not page.locator("#xy").is_visible()


@pytest.mark.slow
def test_events_and_limits_are_marked(page: Any) -> None:
    assert page.locator("#panels line[stroke-dasharray='5 3']").count() == 2
    level = page.locator("#panels .level")
    assert level.count() == 1
    # Of a range of -5 to 405 with its margins, 200 stands in the middle.
    box = page.locator("#panels > svg").nth(2).locator("rect[fill=none]").bounding_box()
    assert level.bounding_box()["y"] == pytest.approx(box["y"] + box["height"] / 2, abs=2.0)


@pytest.mark.slow
def test_names_are_shown_and_run_nothing(page: Any) -> None:
    assert page.title() != "run"
    assert page.locator("img").count() == 0
    assert page.get_by_role("button", name=HOSTILE).count() == 1
