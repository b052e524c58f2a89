"""MCAP logs of robots and ground stations: the numbers of JSON messages are the channels, each topic has its clock.

The package mcap parses the file (extra `mcap`). Times are those at which messages were logged, not published.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..channels import match_name, split_unit
from ..errors import LogError
from ..files import MCAP
from ..units import si_unit
from .raw import (
    DAY_S,
    Asked,
    FloatArray,
    RawLog,
    Track,
    choose_group,
    from_midnight,
    parsing,
    require_few,
    require_memory,
    time_column,
)

# Limit of a message, bytes: those of a flight log have some hundred, images a million.
LARGEST_MESSAGE = 10**6
# Limit of nested objects, whose names are joined by dots.
DEEPEST = 4


def is_mcap(head: bytes) -> bool:
    """Say whether a file begins as MCAP does."""
    return head.startswith(MCAP)


def read_mcap(path: str, asked: Asked) -> RawLog:
    """Read the numbers in the JSON messages of all topics, or of the topic that `asked.group` names.

    Raises
    ------
    LogError : the package mcap is not installed; damaged, no such topic, no numbers, more than memory holds.
    """
    try:
        from mcap.reader import NonSeekingReader
    except ImportError:
        raise LogError(f"{path}: an MCAP file, and mcap is not installed; pip install 'bfi-cli[mcap]'") from None
    topics: dict[str, tuple[list[float], dict[str, list[float]]]] = {}
    left_out: dict[str, str] = {}
    units: dict[str, str] = {}
    n_values = 0
    with parsing(path, "MCAP file"), open(path, "rb") as file:
        # No record is longer than the file: without the limit the package allocates whatever a damaged length states.
        reader = NonSeekingReader(file, record_size_limit=os.path.getsize(path))
        for schema, channel, message in reader.iter_messages(log_time_order=True):
            name = channel.topic.strip("/")
            values = _numbers(channel.message_encoding, message.data)
            if values is None:
                left_out[name] = f"has messages of '{channel.message_encoding}', not of JSON numbers,"
                continue
            if name not in topics:
                units |= {f"{name}/{field}": unit for field, unit in _units(b"" if schema is None else schema.data)}
            times, fields = topics.setdefault(name, ([], {}))
            for field, value in values.items():
                known = fields.setdefault(field, [])
                known += [math.nan] * (len(times) - len(known))
                known.append(value)
                n_values += 1
            times.append(1e-9 * message.log_time)
            require_memory(path, 32 * n_values, "its messages", "export fewer topics")
    signals = {name: topic for name, topic in topics.items() if topic[1]}
    require_few(path, sum(len(fields) for _, fields in signals.values()), "fields")
    if asked.group is not None or not signals:
        chosen = choose_group(path, asked.group and asked.group.strip("/"), list(signals), has_signals=False)
        signals = {name: topic for name, topic in signals.items() if name == chosen}
    first_s = min(times[0] for times, _ in signals.values())
    zero_s = DAY_S * math.floor(first_s / DAY_S)
    notes = (from_midnight(zero_s),) if zero_s else ()
    names = [field for _, fields in signals.values() for field in fields]
    columns = []
    for topic, (times, fields) in signals.items():
        time_s = np.array(times) - zero_s
        for field, known in fields.items():
            source, unit = split_unit(field if names.count(field) == 1 else f"{topic}/{field}")
            column_values: FloatArray = np.array(known + [math.nan] * (len(times) - len(known)))
            column = Track(source=source, values=column_values, unit=unit or units.get(f"{topic}/{field}"))
            if len(signals) == 1:
                columns.append(column)
            elif (match := match_name(source)) is None or match.name != "time":
                columns.append(replace(column, time_s=time_s))
    if len(signals) == 1 and time_column(columns, asked) is None:
        columns.insert(0, Track(source="time", values=time_s, unit="s", channel="time"))
    return RawLog(columns=columns, notes=notes, left_out=left_out)


def _units(schema: bytes) -> Iterator[tuple[str, str]]:
    """Yield the fields of a JSON schema that state a unit, as `unit`, `units` or the whole of their description."""
    try:
        properties = json.loads(schema or b"{}").get("properties", {})
        stated = [
            (name, [one.get(key) for key in ("unit", "units", "description")]) for name, one in properties.items()
        ]
    except (ValueError, RecursionError, AttributeError):
        return
    for name, texts in stated:
        unit = next((text for text in texts if isinstance(text, str) and si_unit(text) is not None), None)
        if unit is not None:
            yield name, unit


def _numbers(encoding: str, data: bytes) -> dict[str, float] | None:
    """Return the numbers of a message by their names, None where it is no JSON object."""
    if encoding != "json" or len(data) > LARGEST_MESSAGE:
        return None
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return dict(_opened("", message, 0)) if isinstance(message, dict) else None


def _opened(prefix: str, message: Mapping[str, Any], depth: int) -> Iterator[tuple[str, float]]:
    for name, value in message.items():
        if isinstance(value, bool | int | float):
            yield f"{prefix}{name}", float(value) if abs(value) < 1e300 else math.nan
        elif isinstance(value, dict) and depth < DEEPEST:
            yield from _opened(f"{prefix}{name}.", value, depth + 1)
