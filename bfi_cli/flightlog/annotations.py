"""What a file states of a log beside its channels: filters, clock, segments, injected faults and ordinary causes.

Each is a text under its key: in HDF5 an attribute, the last two of the group `truth`; in CSV a comment `# KEY: TEXT`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any, TypeVar

from ..epoch import Epoch
from ..errors import DictionaryError, LogError, first_line
from ..faults import fault_from_dict, fault_to_dict
from ..faults.filters import filters_from_json, filters_to_json
from ..faults.ordinary import Occurrence
from .raw import RawLog
from .record import FlightLog, Segment

ATTRIBUTES, TRUTH_KEYS = ("filters", "clock", "segments"), ("faults", "ordinary")
KEYS = (*ATTRIBUTES, *TRUTH_KEYS)
T = TypeVar("T")


def annotations_of(log: FlightLog, names: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of a log by key, those of which it has any.

    Parameters
    ----------
    names : of its channels in the file.
    """
    texts = {}
    if log.filters is not None:
        texts["filters"] = filters_to_json(log.filters)
    if log.epoch is not None:
        texts["clock"] = log.epoch.iso
    if log.segments:
        entries = [{"label": s.label, "t_start": s.start_s, "t_end": s.stop_s, "note": s.note} for s in log.segments]
        texts["segments"] = json.dumps(entries)
    if log.truth is not None:
        faults = (replace(fault, channel=names.get(fault.channel, fault.channel)) for fault in log.truth.faults)
        known = [{key: value for key, value in fault_to_dict(fault).items() if value is not None} for fault in faults]
        texts["faults"] = json.dumps(known)
        if log.truth.ordinary:
            texts["ordinary"] = json.dumps([asdict(occurrence) for occurrence in log.truth.ordinary])
    return texts


def annotated(log: RawLog, texts: Mapping[str, str], *, where: str, truth: str = "") -> RawLog:
    """Return a log as read with what its file states of it.

    Parameters
    ----------
    texts : by key; without faults the log carries no truth.
    where : the file, and truth : the place in it of the truth, for messages.

    Raises
    ------
    LogError : a text is not what its key asks for.
    """
    columns = log.columns
    try:
        epoch = Epoch.from_iso(texts.get("clock", "").strip())
        columns = [replace(column, epoch=epoch) if column.source == "time" else column for column in columns]
    except ValueError:  # an attribute of another program
        pass
    has_truth = "faults" in texts

    def entries(key: str, make: Callable[..., T], needs: str, **given: str) -> tuple[T, ...]:
        at = f"{where}: {truth * (key in TRUTH_KEYS)}{key}"
        return _entries(texts.get(key) or "[]", at, partial(make, **given), needs)

    fault_place = f"{where}: {truth}faults"
    return replace(
        log,
        columns=columns,
        segments=entries("segments", _segment, "a segment needs the numbers t_start and t_end"),
        filters=filters_from_json(texts["filters"], where=f"{where}: filters") if "filters" in texts else None,
        faults=entries("faults", fault_from_dict, "a fault needs a shape", where=fault_place) if has_truth else None,
        ordinary=entries("ordinary", _occurrence, "it needs cause, and the numbers at_s and size") if has_truth else (),
    )


def _segment(entry: Mapping[str, Any]) -> Segment:
    words = {key: str(entry.get(key, "")) for key in ("label", "note")}
    return Segment(start_s=float(entry["t_start"]), stop_s=float(entry["t_end"]), **words)


def _occurrence(entry: Mapping[str, Any]) -> Occurrence:
    return Occurrence(cause=str(entry["cause"]), at_s=float(entry["at_s"]), size=float(entry["size"]))


def _entries(text: str, where: str, make: Callable[[Mapping[str, Any]], T], needs: str) -> tuple[T, ...]:
    """Return what is made of each object of a JSON list."""
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise LogError(f"{where}: not JSON, {first_line(error)}; mend the file") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise LogError(f"{where}: not a JSON list of objects; mend the file")
    made = []
    for entry in entries:
        try:
            made.append(make(entry))
        except DictionaryError as error:
            raise LogError(str(error)) from None
        except (KeyError, TypeError, ValueError, OverflowError):
            raise LogError(f"{where}: {needs}, got {str(entry)[:80]}; mend the file") from None
    return tuple(made)
