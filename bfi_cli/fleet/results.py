"""The files of a fleet beside the folders of its logs: tables, summary, index page."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote

from ..notes import Note
from ..printable import SHOWN, shortened
from ..quantities.text import counted, instant
from ..report.listing import Listing, render_listing
from ..serialization import Provenance, document_of, to_json
from .answers import LogAnswer
from .store import SUMMARY
from .tables import table_file, table_names, tables_of
from .trends import FleetTrend, sentence_of_trend, trend_drawing

INDEX = "index.html"
# Letters of a cell of the index: with eight cells and their tags less than 500 bytes a row, 5 MB at 10 000 logs.
PATH_LETTERS, TEXT_LETTERS, HIDDEN_LETTERS = 60, 100, 50
TITLES = {"diagnose": "Diagnosis of a fleet", "info": "Logs of a fleet"}


def fleet_names(kind: str) -> tuple[str, ...]:
    """Return the names of the files that `fleet_files` makes."""
    return (*table_names(kind), INDEX, SUMMARY)


def fleet_files(
    kind: str, answers: Sequence[LogAnswer], origin: Provenance, trends: Sequence[FleetTrend] | None = None
) -> dict[str, bytes]:
    """Return the bytes of every file of a fleet by its name; `trends` of aircraft where they are asked for."""
    files = dict(table_file(table) for table in tables_of(kind, answers, trends))
    files[SUMMARY] = to_json(summary_of_fleet(kind, answers, tuple(files), origin)).encode() + b"\n"
    files[INDEX] = index_page(kind, answers, origin, trends or ()).encode("utf-8", SHOWN)
    return files


def remove_left_over(kind: str, out: Path, files: Collection[str]) -> None:
    """Remove the tables of an earlier result that are not among `files`, in either format."""
    for name in {name for pair in table_names(kind).items() for name in pair} - {*files}:
        with contextlib.suppress(OSError):
            (out / name).unlink()


def summary_of_fleet(
    kind: str, answers: Sequence[LogAnswer], tables: Sequence[str], origin: Provenance
) -> dict[str, Any]:
    """Return the document of a fleet: what was done, and how many logs have which answer."""
    unread = sum(bool(answer.error) for answer in answers)
    body = {
        "analysis": kind,
        "n_logs": len(answers),
        "n_unread": unread,
        "decisions": dict(sorted(Counter(answer.decision for answer in answers if answer.decision).items())),
        "states": dict(sorted(Counter(answer.state for answer in answers if answer.state).items())),
        "tables": list(tables),
    }
    notes = [Note.limit(f"{counted(unread, 'log')} could not be read")] if unread else []
    return document_of("fleet", body, notes, origin)


def index_page(kind: str, answers: Sequence[LogAnswer], origin: Provenance, trends: Sequence[FleetTrend] = ()) -> str:
    """Return the page of a fleet: counts, trends that are declared, and a row for each log that leads to its report."""
    has_aircraft = any(answer.aircraft for answer in answers)
    columns = {
        "log": [shortened(answer.log, PATH_LETTERS) for answer in answers],
        "aircraft": [shortened(answer.aircraft, PATH_LETTERS) for answer in answers],
        "state": ["not read" if answer.error else answer.state.replace("_", " ") for answer in answers],
        "answer": [shortened(answer.error or answer.summary, TEXT_LETTERS) for answer in answers],
        "onset [s]": ["" if (at := answer.flight.get("onset_s")) is None else instant(at) for answer in answers],
        "clock": [(answer.flight.get("onset_clock") or "").replace("T", " ") for answer in answers],
        "size": [_cell(answer.flight.get("magnitude")) for answer in answers],
        "unit": [answer.flight.get("unit") or "" for answer in answers],
        "in flight [min]": [_cell(answer.flight.get("flight_s"), 60.0) for answer in answers],
        "what could hide": [shortened(answer.hidden, HIDDEN_LETTERS) for answer in answers],
    }
    diagnosis_columns = ("state", "onset [s]", "clock", "size", "unit", "what could hide")
    left_out = {*(() if has_aircraft else ("aircraft",)), *(diagnosis_columns if kind != "diagnose" else ())}
    left_out |= set() if any(columns["clock"]) else {"clock"}
    shown = {head: cells for head, cells in columns.items() if head not in left_out}
    faults = Counter(str(answer.flight["fault"]) for answer in answers if answer.flight.get("declared"))
    counts = Counter("not read" if answer.error else answer.state or "read" for answer in answers)
    return render_listing(
        Listing(
            title=TITLES[kind],
            facts=(
                ("Logs", str(len(answers))),
                *((name.replace("_", " ").capitalize(), str(n)) for name, n in sorted(counts.items())),
                *((f"Trend of {trend.aircraft}", sentence_of_trend(trend)) for trend in trends if trend.is_declared),
                *((f"First fault {name.replace('_', ' ')}", str(n)) for name, n in faults.most_common()),
            ),
            heads=tuple(shown),
            rows=tuple(zip(*shown.values(), strict=True)) if answers else (),
            links=tuple(
                "" if answer.error else quote(str(PurePosixPath(answer.folder, "report.html"))) for answer in answers
            ),
            tones=tuple("unread" if answer.error else answer.decision for answer in answers),
            drawing=trend_drawing(trends),
        ),
        origin,
    )


def _cell(value: float | None, divisor: float = 1.0) -> str:
    return "" if value is None else f"{value / divisor:.6g}"
