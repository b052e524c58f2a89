"""Contradictions within a document, so that no report is drawn of a stored answer that was edited or damaged."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from ..decision import KINDS
from ..faults import Decision
from ..serialization import DECLARED

Plain = Mapping[str, Any]
DECISIONS = get_args(Decision)
# Share of its ends by which an interval may miss its magnitude: numbers are written to some digits only.
ROUNDING = 1e-6


def contradiction_of(document: Plain) -> str | None:
    """Return the first contradiction in the answer of an analysis, None without any.

    Intervals hold their magnitudes and onsets, ends come after onsets, standard deviations are not negative, and
    probabilities lie between 0 and 1; the decision follows from the verdicts, and faults are declared if and only if
    the decision is "fault".
    """
    if document.get("kind") not in DECLARED:
        return None
    return next(_contradictions(document), None)


def _contradictions(document: Plain) -> Iterator[str]:
    decision, verdicts = document["decision"], document["verdicts"]
    for name, value in (("decision", decision), *((f"verdicts.{kind}", verdicts[kind]) for kind in verdicts)):
        if value not in DECISIONS:
            yield f"{name} is {value!r}, known: {', '.join(DECISIONS)}"
    if set(verdicts) != set(KINDS):
        yield f"verdicts are on {', '.join(verdicts) or 'nothing'}, not on {', '.join(KINDS)}"
    if (decision == "fault") != ("fault" in verdicts.values()):
        yield f"decision is {decision!r}, but the verdicts are {', '.join(map(str, verdicts.values()))}"
    if decision == "no_fault" and "no_fault" not in verdicts.values():
        yield "decision is 'no_fault', but no verdict is"
    key = DECLARED[document["kind"]]
    # What lies within its tolerance is a fault of a window, and a deviation of a flight.
    is_deviation = [key == "events" and entry.get("beyond_tolerance") is False for entry in document[key]]
    declared = [
        entry
        for entry, within in zip(document[key], is_deviation, strict=True)
        if entry.get("state", "declared") == "declared" and not within
    ]
    if decision == "fault" and not declared:
        yield f"decision is 'fault', but '{key}' holds none"
    if decision == "no_fault" and declared:
        yield f"decision is 'no_fault', but '{key}' holds {len(declared)}"
    for entry in declared:
        if entry.get("kind") in verdicts and verdicts[entry["kind"]] != "fault":
            yield f"{key} has a declared fault that is {entry['kind']}, but that verdict is {verdicts[entry['kind']]!r}"
    for name in dict.fromkeys((key, "candidates")):
        for k, entry in enumerate(document.get(name) or ()):
            yield from (f"{name}[{k}]: {what}" for what in _entry_contradictions(entry))


def _entry_contradictions(entry: Plain) -> Iterator[str]:
    for value, interval in (("magnitude", "ci95"), ("onset_s", "onset_ci95")):
        ends = entry.get(interval)
        if ends is None:
            continue
        low, high = (float(end) if end is not None else math.nan for end in ends)
        slack = ROUNDING * max(abs(low), abs(high))
        if high < low - slack:
            yield f"{interval} runs from {low:g} to {high:g}"
        elif entry.get(value) is not None and not low - slack <= float(entry[value]) <= high + slack:
            yield f"{value} {float(entry[value]):g} lies outside of {interval}, {low:g} to {high:g}"
    if entry.get("sd") is not None and not float(entry["sd"]) >= 0.0:
        yield f"sd is {entry['sd']}, which no standard deviation is"
    if entry.get("p_value") is not None and not 0.0 <= float(entry["p_value"]) <= 1.0:
        yield f"p_value is {entry['p_value']}, which no probability is"
    onset, offset = entry.get("onset_s"), entry.get("offset_s")
    if onset is not None and offset is not None and float(offset) < float(onset):
        yield f"it ends at {float(offset):g} s, before it begins at {float(onset):g} s"
    if entry.get("count") is not None and entry["count"] != len(entry.get("times_s") or ()):
        yield f"count is {entry['count']}, but times_s holds {len(entry.get('times_s') or ())}"
