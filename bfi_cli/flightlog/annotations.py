"""Segments and injected faults as the JSON text that files carry them in."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ..errors import DictionaryError, LogError, first_line
from ..faults import Fault, fault_from_dict, fault_to_dict
from .record import Segment

__all__ = ["faults_from_json", "faults_to_json", "segments_from_json", "segments_to_json"]


def segments_to_json(segments: Sequence[Segment]) -> str:
    """Return the JSON list of `{label, t_start, t_end, note}`."""
    return json.dumps([{"label": s.label, "t_start": s.start_s, "t_end": s.stop_s, "note": s.note} for s in segments])


def segments_from_json(text: str, *, where: str) -> tuple[Segment, ...]:
    """Read the JSON list of `{label, t_start, t_end, note}`.

    Raises
    ------
    LogError : it is not such a list.
    """
    return tuple(_segment(entry, where) for entry in _objects(text, where))


def _segment(entry: dict[str, Any], where: str) -> Segment:
    try:
        start, stop = float(entry["t_start"]), float(entry["t_end"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise LogError(
            f"{where}: a segment needs the numbers t_start and t_end, got {str(entry)[:80]}; mend the file"
        ) from None
    return Segment(label=str(entry.get("label", "")), start_s=start, stop_s=stop, note=str(entry.get("note", "")))


def faults_to_json(faults: Sequence[Fault]) -> str:
    """Return the JSON list of fault objects, keys that are None left out."""
    objects = (fault_to_dict(fault) for fault in faults)
    return json.dumps([{key: value for key, value in entry.items() if value is not None} for entry in objects])


def faults_from_json(text: str, *, where: str) -> tuple[Fault, ...]:
    """Read a JSON list of fault objects.

    Raises
    ------
    LogError : it is not such a list, or one of them is no fault.
    """
    try:
        return tuple(fault_from_dict(entry, where=where) for entry in _objects(text, where))
    except DictionaryError as error:
        raise LogError(str(error)) from None


def _objects(text: str, where: str) -> list[dict[str, Any]]:
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise LogError(f"{where}: not JSON, {first_line(error)}; mend the file") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise LogError(f"{where}: not a JSON list of objects; mend the file")
    return entries
