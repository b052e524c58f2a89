"""The answer on each log of a fleet: its line, and its rows of the tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..epoch import Epoch
from ..flight.plausibility.constants import ConstantError
from ..flightlog.phases import PARTS
from ..notes import Note
from ..quantities.text import counted, instant, number
from ..report.content import ReportContent
from ..report.first_screen import State
from ..serialization import Provenance, document_of

# Order of the lines: what needs a reader first.
RANKS: Mapping[State, int] = {"fault": 0, "suspected": 1, "deviation": 2, "cannot_tell": 3, "no_fault_found": 4}
UNREAD = len(RANKS)
# Lines of the first screen that say what could hide, the first that is there.
HIDES = ("Still possible", "Would have been found")
IN_FLIGHT = {*PARTS} - {"ground"}
# What the row of a flight says of its first event.
NAMED = ("fault", "shape", "onset_s", "onset_clock", "magnitude", "unit", "low", "high")


@dataclass(frozen=True, slots=True, kw_only=True)
class LogAnswer:
    """The answer on a log.

    Attributes
    ----------
    log : its path; aircraft : "" where it is not known; folder : of its results.
    key : digest of the log's bytes, the version and the configuration that the answer is of; "" for an answer that is
        not kept.
    sha256 : of the log, "" where it could not be read.
    error : why there is no answer, "" where there is; error_code : the exit code for it.
    rank : in the order of lines, least first.
    decision : of the analysis, "" of one that decides nothing; is_trusted : whether `--strict` accepts it.
    state : of its headline, "fault" or "no_fault_found", "" without one.
    summary : the first fault with onset and size, or what there is to say; hidden : what could hide, "" for nothing.
    flight : the log's row of the table `flights`, by column.
    rows : its rows of the second table, by column.
    constants : its rows of the table `constants`: the constant error of every relation.
    """

    log: str
    folder: str
    key: str
    sha256: str
    aircraft: str = ""
    error: str = ""
    error_code: int = 0
    rank: int = UNREAD
    decision: str = ""
    state: str = ""
    is_trusted: bool = True
    summary: str = ""
    hidden: str = ""
    flight: Mapping[str, Any]
    rows: tuple[Mapping[str, Any], ...] = ()
    constants: tuple[Mapping[str, Any], ...] = ()


def answer_of_diagnosis(document: Mapping[str, Any], content: ReportContent) -> dict[str, Any]:
    """Return what a document of `bfi diagnose`, and its content, say of a flight: fields of `LogAnswer`."""
    clock = document["log"].get("clock")
    events = [{"state": event["state"], **_event(event, clock)} for event in document["events"]]
    deviations = [{"state": "deviation", **_event(deviation, clock)} for deviation in document["deviations"]]
    states = [event["state"] for event in events]
    screen = content.screen
    assert screen is not None
    hidden = next((f"{label.lower()}: {parts[0]}" for label, parts in screen.lines.items() if label in HIDES), "")
    named = next(iter([*events, *deviations]), {})
    return {
        "rank": RANKS[screen.state],
        "decision": document["decision"],
        "state": screen.state,
        "summary": screen.text,
        "hidden": hidden,
        "flight": {
            **_span(document),
            "decision": document["decision"],
            "state": screen.state,
            **{kind: document["verdicts"].get(kind) for kind in ("abrupt", "oscillating", "slow")},
            "declared": states.count("declared"),
            "suspected": states.count("suspected"),
            "deviations": len(deviations),
            "ordinary": len(document.get("ordinary", ())),
            "contradictions": len(document.get("plausibility", ())),
            **{key: named.get(key) for key in NAMED},
            "could_hide": hidden or None,
        },
        "rows": (*events, *deviations),
    }


def _event(event: Mapping[str, Any], clock: str | None) -> dict[str, Any]:
    """Return an event of a document in plain cells; `clock` is that of its log, see `Epoch.iso`."""
    low, high = event["ci95"] or (None, None)
    effect = next(iter(event["effect"].items()), (None, None))
    same = ("fault", "kind", "shape", "magnitude", "unit", "onset_s", "offset_s", "statistic", "threshold", "p_value")
    return {
        **{key: event[key] for key in same},
        **{key: event.get(key) for key in ("margin", "beyond_tolerance", "frequency_hz", "count")},
        "among": " ".join(event["among"]),
        "channels": " ".join(event["channels"]),
        "onset_clock": None if clock is None else Epoch.from_iso(clock).moments([event["onset_s"]])[0],
        "low": low,
        "high": high,
        "onset_low_s": event["onset_ci95"][0],
        "onset_high_s": event["onset_ci95"][1],
        "effect_channel": effect[0],
        "effect": effect[1],
    }


def rows_of_constants(errors: Iterable[ConstantError]) -> tuple[dict[str, Any], ...]:
    """Return the rows of a log in the table `constants`."""
    same = ("channel", "by", "value", "unit")
    return tuple(
        {**{key: getattr(error, key) for key in same}, "low": error.ci95[0], "high": error.ci95[1]} for error in errors
    )


def answer_of_info(document: Mapping[str, Any], content: ReportContent) -> dict[str, Any]:
    """Return what a document of `bfi info` says of a log: fields of `LogAnswer`."""
    span = _span(document)
    counts = {key: len(document[key]) for key in ("channels", "gaps", "defects", "plausibility")}
    wrong = {"contradiction": counts["plausibility"], "defect": counts["defects"], "gap": counts["gaps"]}
    complaints = ", ".join(counted(n, noun) for noun, n in wrong.items() if n)
    flown = span["flight_s"]
    in_flight = f"{instant(round(flown))} s in flight" if flown else "no flight"
    size = f"{span['n_samples']} samples at {number(span['rate_hz'])} Hz, {in_flight}, {counts['channels']} channels"
    rows = [
        {key: channel[key] for key in ("name", "unit", "source", "min", "max", "n_nan")}
        for channel in document["channels"]
    ]
    return {
        "rank": RANKS["suspected" if counts["plausibility"] else "cannot_tell" if complaints else "no_fault_found"],
        "summary": f"{size}; {complaints}" if complaints else size,
        "flight": {
            **span,
            "uniform": document["uniform"],
            "channels": counts["channels"],
            "gaps": counts["gaps"],
            "defects": counts["defects"],
            "contradictions": counts["plausibility"],
        },
        "rows": tuple(rows),
    }


def _span(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the length of a log, and how much of it is flight, s."""
    phases: Sequence[Mapping[str, Any]] = document["phases"]
    clock = document["log"].get("clock")
    epoch = None if clock is None else Epoch.from_iso(clock)
    return {
        **{key: document["log"][key] for key in ("start_s", "stop_s", "n_samples", "rate_hz")},
        "since_1970_s": epoch.since_1970_s + document["log"]["start_s"] if epoch and epoch.is_dated else None,
        "flight_s": sum((phase["to_s"] - phase["from_s"] for phase in phases if phase["phase"] in IN_FLIGHT), 0.0),
    }


def unread_document(path: str, error: str, provenance: Provenance) -> dict[str, Any]:
    """Return the document in place of that of a log without an answer."""
    return document_of("unread", {"log": {"path": path}, "error": error}, (Note.limit(error),), provenance)
