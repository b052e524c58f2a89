"""Every reproduction by its name, and the JSON document from which its report is drawn again without its data."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from ...errors import ConfigError
from ...faults import did_you_mean, shown
from ...report.content import ReportContent, Table
from ...serialization import Provenance, document_of, from_plain, mapping, member, to_plain
from .page import load
from .record import Settings


class Entry(NamedTuple):
    """A reproduction: what it shows, and the function of a module of this package that makes it."""

    title: str
    module: str
    function: str


REPRODUCTIONS = {name: Entry(*entry) for name, entry in load("catalogue")["pages"].items()}
# Figures and tables of the papers without a reproduction, and the reason.
ABSENT: Mapping[str, str] = load("catalogue")["absent"]


def find(name: str) -> str:
    """Return the name of a reproduction as it is listed, whatever the case of `name`.

    Raises
    ------
    ConfigError : no such reproduction, or a figure of a paper that nothing computes.
    """
    known = {figure.lower(): figure for figure in (*REPRODUCTIONS, *ABSENT)}
    if name.lower() not in known:
        raise ConfigError(
            f"reproduce: no such figure, got '{name}'{did_you_mean(name, (*REPRODUCTIONS, 'all', 'list'))}"
        )
    name = known[name.lower()]
    if name in ABSENT:
        raise ConfigError(f"reproduce: {name} has no page, it is {ABSENT[name]}; give one of bfi reproduce list")
    return name


def run(name: str, settings: Settings) -> ReportContent:
    """Make a reproduction.

    Raises
    ------
    ConfigError : no reproduction of that name.
    LogError, DictionaryError : the log of the settings cannot be used for it.
    """
    entry = REPRODUCTIONS[find(name)]
    module = importlib.import_module(f"{__package__}.{entry.module}")
    make: Callable[[Settings], ReportContent] = getattr(module, entry.function)
    return make(settings)


def reproduce_document(name: str, content: ReportContent, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi reproduce NAME --json`.

    Parameters
    ----------
    name : of the reproduction, "all" or "list".
    """
    body = to_plain(content)
    body["kicker"] = body.pop("category")  # as schema 1 calls it
    del body["data"]
    return document_of("reproduce", {"name": name, "exhibit": body}, content.notes, provenance)


def reproduce_content(document: Mapping[str, Any], *, where: str = "reproduce") -> ReportContent:
    """Return the content of a document, the inverse of `reproduce_document`.

    Raises
    ------
    ConfigError : a key is missing, or a value is of another kind.
    """
    body = mapping(member(document, "exhibit", where=where), where=f"{where}: exhibit")
    whole = {**body, "category": member(document, "exhibit.kicker", where=where), "data": {}}
    content = from_plain(ReportContent, whole, where=f"{where}: exhibit")
    for name in [drawing.name for drawing in content.drawings] + [table.name for table in content.tables]:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
            raise ConfigError(f"{where}: exhibit: {shown(name)} is no name of a file; run the command again")
    return content


def summary_content(made: Sequence[tuple[str, ReportContent | Exception]]) -> ReportContent:
    """Return the summary of several reproductions, content or error by name."""
    failed = [name for name, content in made if isinstance(content, Exception)]
    rows = tuple(
        (name, REPRODUCTIONS[name].title, "not made", str(content))
        if isinstance(content, Exception)
        else (name, REPRODUCTIONS[name].title, content.heading, content.verdict)
        for name, content in made
    )
    several = f"{len(made) - len(failed)} of {len(made)} figures and tables"
    return ReportContent(
        category="Reproductions",
        title="Published figures and tables, ours beside theirs",
        heading=f"{len(made) - len(failed)} made",
        verdict=f"Made {several}" + (f"; not {', '.join(failed)}." if failed else "."),
        tables=(Table(name="summary", title="Summary", heads=("name", "what", "outcome", "in a sentence"), rows=rows),),
    )


def list_content() -> ReportContent:
    """Return the list of the reproductions."""
    rows = tuple((name, entry.title) for name, entry in REPRODUCTIONS.items())
    return ReportContent(
        category="Reproductions",
        title="Published figures and tables, ours beside theirs",
        heading=f"{len(rows)} figures and tables",
        verdict="bfi reproduce NAME makes one of these, bfi reproduce all every one.",
        tables=(
            Table(name="reproductions", title="Names", heads=("name", "what"), rows=rows),
            Table(
                name="absent", title="Without a page", heads=("figure or table", "it is"), rows=tuple(ABSENT.items())
            ),
        ),
    )
