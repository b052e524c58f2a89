"""The JSON document of a reproduction: its exhibit, stored plain, so that it can be drawn again without its data."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import ConfigError
from ..faults import shown
from ..provenance import Provenance
from ..report.content import ReportContent, Table
from ..serialization import from_plain, mapping, member, to_plain
from .catalogue import REPRODUCTIONS

__all__ = ["REPRODUCE_SCHEMA", "list_exhibit", "reproduce_document", "reproduce_exhibit", "summary_exhibit"]

REPRODUCE_SCHEMA = 1


def reproduce_document(name: str, exhibit: ReportContent, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi reproduce NAME --json`.

    Parameters
    ----------
    name : of the reproduction, "all" or "list".
    """
    body = to_plain(exhibit)
    body["kicker"] = body.pop("category")  # as schema 1 calls it
    del body["data"]
    return {
        "kind": "reproduce",
        "schema": REPRODUCE_SCHEMA,
        "name": name,
        "exhibit": body,
        "notes": list(exhibit.notes),
        "provenance": to_plain(provenance),
    }


def reproduce_exhibit(document: Mapping[str, Any], *, where: str = "reproduce") -> ReportContent:
    """Return the exhibit of a document, the inverse of `reproduce_document`.

    Raises
    ------
    ConfigError : a key is missing, or a value is of another kind.
    """
    body = mapping(member(document, "exhibit", where=where), where=f"{where}: exhibit")
    whole = {**body, "category": member(document, "exhibit.kicker", where=where), "data": {}}
    exhibit = from_plain(ReportContent, whole, where=f"{where}: exhibit")
    for name in [one.name for one in exhibit.drawings] + [one.name for one in exhibit.tables]:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
            raise ConfigError(f"{where}: exhibit: {shown(name)} is no name of a file; run the command again")
    return exhibit


def summary_exhibit(made: Sequence[tuple[str, ReportContent | Exception]]) -> ReportContent:
    """Return the summary of several reproductions, each by its name; an error stands for one that could not be made."""
    failed = [name for name, one in made if isinstance(one, Exception)]
    rows = tuple(
        (name, REPRODUCTIONS[name].title, *(("not made", str(one)) if isinstance(one, Exception) else _said(one)))
        for name, one in made
    )
    several = f"{len(made) - len(failed)} of {len(made)} figures and tables"
    return ReportContent(
        category="Reproductions",
        title="Published figures and tables, ours beside theirs",
        heading=f"{len(made) - len(failed)} made",
        verdict=f"Made {several}" + (f"; not {', '.join(failed)}." if failed else "."),
        tables=(Table(name="summary", title="Summary", heads=("name", "what", "outcome", "in a sentence"), rows=rows),),
    )


def _said(exhibit: ReportContent) -> tuple[str, str]:
    return exhibit.heading, exhibit.verdict


def list_exhibit() -> ReportContent:
    """Return the names there are."""
    rows = tuple((name, entry.title) for name, entry in REPRODUCTIONS.items())
    return ReportContent(
        category="Reproductions",
        title="Published figures and tables, ours beside theirs",
        heading=f"{len(rows)} figures and tables",
        verdict="bfi reproduce NAME makes one of these, bfi reproduce all every one.",
        tables=(Table(name="reproductions", title="Names", heads=("name", "what"), rows=rows),),
    )
