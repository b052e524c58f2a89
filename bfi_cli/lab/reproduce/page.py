"""A page of a reproduction: its text from YAML, filled with what was computed, and its tables and drawings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Sized
from functools import cache
from pathlib import Path
from typing import Any

from ...notes import Note
from ...quantities.text import capital
from ...report.content import Curve, Drawing, Panel, ReportContent, Style, Table
from ...yaml12 import load_yaml

FOLDER = Path(__file__).parent
Page = Mapping[str, Any]


@cache
def load(name: str) -> Page:
    """Return a YAML file of this package, read once.

    A page has a title, a heading (or `headings` by outcome), a verdict, `facts`, `rows` of (quantity, published, ours),
    `captions` and `tables` by name, and `notes`. A `sentence` and `record_rows` are repeated for every record; {Record}
    is its name with a capital letter. `who` are its methods, explained by `who` in thesis.yaml, and `panels` the axes
    of its figures. `report_content` fills the `{names}`.
    """
    loaded: Page = load_yaml(FOLDER / f"{name}.yaml")
    return loaded


def fill(text: Any, **values: object) -> Any:
    """Return text, or lists of text, with every {name} replaced by its value, as `str.format` does."""
    return text.format_map(values) if isinstance(text, str) else tuple(fill(part, **values) for part in text)


def report_content(
    page: Page,
    values: Mapping[str, object],
    *,
    heading: object = (),
    records: Sequence[Mapping[str, object]] = (),
    tables: Sequence[Table] = (),
    drawings: Sequence[Drawing] = (),
    notes: Sequence[str] = (),
    simulated: bool = False,
) -> ReportContent:
    """Return a page, the table of published and computed numbers first.

    Parameters
    ----------
    values : of the `{names}` in the page.
    heading : for every record, without noise first, whether the page's heading `true` holds; or a key of its
        `headings`; or () for a page with a single `heading`.
    records : for each record the values of the `{names}` in `record_rows`, which are added to the comparison, and in
        `sentence`, which the verdict joins; `record` is its name.
    notes : after those of the page.
    simulated : the record is a simulation: the page's notes on that come first, and the note on it last.
    """
    shared = load("thesis")["shared"]
    rows = [row for record in records for row in fill(page.get("record_rows", ()), **record)]
    if "sentence" in page:
        named = ({**record, "Record": capital(str(record["record"]))} for record in records)
        values = {**values, "verdict": " ".join(fill(page["sentence"], **record) for record in named)}
    comparison = Table(
        name="comparison",
        title="Printed and computed",
        heads=("quantity", "printed", "computed here"),
        rows=(*fill(page.get("rows", ()), **values), *rows),
    )
    if isinstance(heading, Sequence):
        head = page["headings"][any(heading)] if heading else page["heading"]
        if any(heading) and not all(heading):
            head = f"{head} {'without' if heading[0] else 'with'} noise only"
    else:
        head = page["headings"][heading]
    return ReportContent(
        category="Reproduction",
        title=fill(page["title"], **values),
        heading=fill(head, **values),
        verdict=fill(page["verdict"], **values),
        facts=(*fill(page.get("facts", ()), **values), *(fill(shared["who"][name]) for name in page.get("who", ()))),
        tables=(comparison, *tables),
        drawings=tuple(drawings),
        notes=tuple(
            map(
                Note.method,
                (
                    *(page.get("simulated", ()) if simulated else ()),
                    *fill(page["notes"], **values),
                    *notes,
                    *([shared["stand_in"]] if simulated else ()),
                ),
            )
        ),
    )


def table(page: Page, name: str, rows: Iterable[Sequence[str]], **values: object) -> Table:
    """Return a table with the title and the heads that the page has for it."""
    text = page["tables"][name]
    heads = fill(text["heads"], **values)
    return Table(name=name, title=fill(text["title"], **values), heads=heads, rows=tuple(map(tuple, rows)))


def drawing(
    page: Page, name: str, panels: Iterable[Panel], *, across: int = 1, caption: str | None = None, **values: object
) -> Drawing:
    """Return a figure with the caption that the page has for it, or for the name `caption`."""
    text = fill(page["captions"][caption or name], **values)
    return Drawing(name=name, caption=text, panels=tuple(panels), across=across)


def panel(page: Page, name: str, curves: Iterable[Curve], **settings: Any) -> Panel:
    """Return a panel with the axes that the page has for it, its `panels`, and further settings."""
    axes = {key: tuple(value) if isinstance(value, list) else value for key, value in page["panels"][name].items()}
    return Panel(**{**axes, **settings}, curves=tuple(curves))


def joined(x: Sized, style: Style) -> Style:
    """Return the style of a curve of the points `x`: `style` from three points on, below that points."""
    return style if len(x) > 2 else "points"


def percent(value: float) -> str:
    """Return "86.0 %"."""
    return f"{value:.1f} %"
