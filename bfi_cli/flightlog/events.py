"""The events that the result of an analysis names: which fault, on which channels, from when to when."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ConfigError
from ..serialization import check_schema, mapping, member

Plain = Mapping[str, Any]

GIVE = "give the result.json of bfi identify, start-time, detect or diagnose"
# Under which key a kind of document has its events, and under which it has what is suspected.
KEYS = {
    "identify": ("faults", "candidates"),
    "start-time": ("faults", "candidates"),
    "detect": ("alarms", "candidates"),
    "diagnose": ("events", None),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A fault that an analysis declares or suspects.

    Attributes
    ----------
    analysis : the kind of document that names it.
    state : "declared" or "suspected".
    onset_s, offset_s : on the log's time axis; the offset is None where the fault lasts.
    """

    analysis: str
    name: str
    channels: tuple[str, ...]
    state: str
    onset_s: float
    offset_s: float | None


def read_events(path: str) -> tuple[tuple[Event, ...], str]:
    """Return the declared and suspected events of a stored document in order of time, and the sha256 of its log.

    Raises
    ------
    ConfigError : the file cannot be read, is not JSON, or is no document with events.
    """
    try:
        document = json.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {(error.strerror or str(error)).lower()}; {GIVE}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; {GIVE}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not JSON ({error}); {GIVE}") from None
    if not isinstance(document, Mapping) or "kind" not in document:
        raise ConfigError(f"{path}: not a result of this program, it has no 'kind'; {GIVE}")
    kind = document["kind"]
    if not isinstance(kind, str) or kind not in KEYS:
        raise ConfigError(f"{path}: kind is '{kind}', which has no events; {GIVE}")
    check_schema(document, where=path)
    sha256 = mapping(member(document, "provenance", where=path), where=f"{path}: provenance").get("log_sha256")
    try:
        found = sorted(_events(document, kind, path), key=lambda one: one.onset_s)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"{path}: damaged, {error!r}; run bfi {kind} again") from None
    return tuple(found), sha256 if isinstance(sha256, str) else ""


def _events(document: Plain, kind: str, where: str) -> Iterator[Event]:
    declared, others = KEYS[kind]
    for entry in member(document, declared, where=where):
        onset_s = entry.get("onset_s") if entry.get("onset_s") is not None else entry.get("time_s")
        state = entry.get("state", "declared")
        if onset_s is not None and state in ("declared", "suspected"):
            yield _event(entry, kind, state, onset_s)
    for entry in document.get(others, ()) if others else ():
        if entry.get("state") == "suspected" and entry.get("onset_s") is not None:
            yield _event(entry, kind, "suspected", entry["onset_s"])


def _event(entry: Plain, kind: str, state: str, onset_s: float) -> Event:
    """Return an entry as an event; a fault is called by its name, else by its shape, an alarm by what it is."""
    channels = entry.get("channels") or ([entry["channel"]] if entry.get("channel") else [])
    times = [float(one) for one in (onset_s, entry.get("offset_s")) if one is not None]
    if not isinstance(channels, list) or not all(map(math.isfinite, times)):
        raise ValueError(f"no channels and times, {channels!r:.40}, {times}")
    name = str(entry.get("fault") or entry.get("name") or entry.get("shape") or "alarm")
    places, offset_s = tuple(map(str, channels)), times[1] if len(times) > 1 else None
    return Event(analysis=kind, name=name, channels=places, state=state, onset_s=times[0], offset_s=offset_s)
