"""Declared faults as entries of a document and back, in a sentence, and as columns of a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from ..faults import Fault, FaultEstimate
from ..faults.shapes import SHAPES
from ..quantities.text import Shown, Units, instant, number
from ..serialization import mapping, member, to_plain

# Keys of an entry from the fault; name and magnitude are those of the estimate.
FAULT_KEYS = tuple(
    field.name for field in fields(Fault) if field.name not in ("name", "magnitude", "onset_range_s", "parameter_range")
)
ENDS = {"ci95": ("ci95_low", "ci95_high"), "onset_ci95": ("onset_low_s", "onset_high_s")}


def fault_entry(estimate: FaultEstimate, keys: Sequence[str] = FAULT_KEYS) -> dict[str, Any]:
    """Return the entry of a document; `keys` are those of the fault, an interval without both ends is None."""
    entry = to_plain(estimate)
    fault = entry.pop("fault")
    if SHAPES[fault["shape"]].kind != "oscillating":
        fault["phase_rad"] = fault["phase_reference"] = None
    for key in ENDS:
        if entry[key] is not None and None in entry[key]:
            entry[key] = None
    physical = {key: entry.pop(f"physical_{key}") for key in ("value", "unit")}
    return {**entry, "physical": physical, **{key: fault[key] for key in keys}}


def plain_estimate(entry: object, *, where: str) -> dict[str, Any]:
    """Return the plain `FaultEstimate` of an entry of a document, the inverse of `fault_entry`.

    Raises
    ------
    ConfigError : a key is missing.
    """
    plain = mapping(entry, where=where)
    fault = {key: plain[key] for key in FAULT_KEYS if plain.get(key) is not None}
    return {
        **plain,
        "fault": {**fault, "name": member(plain, "name", where=where)},
        "ci95": member(plain, "ci95", where=where) or [None, None],
        "physical_value": member(plain, "physical.value", where=where),
        "physical_unit": member(plain, "physical.unit", where=where),
    }


def meaning(estimate: FaultEstimate, units: Units, channel_unit: str) -> tuple[float, Shown]:
    """Return the physical value of a magnitude of 1, in the unit that is shown, and that unit."""
    shown = units.of(estimate.physical_unit, channel=estimate.fault.channel, channel_unit=channel_unit)
    return (estimate.physical_value / estimate.magnitude if estimate.magnitude else 1.0) / shown.factor, shown


def kind_in_words(shape: str, frequency_hz: float | None) -> str:
    """Return "2.25 Hz sine"."""
    label = SHAPES[shape].label
    return label if frequency_hz is None else f"{number(frequency_hz)} Hz {label}"


def until(fault: Fault) -> str:
    """Return " to 20 s", "" of a fault that lasts."""
    return "" if fault.offset_s is None else f" to {instant(fault.offset_s)} s"


def half(ends: tuple[float, float] | None) -> float:
    """Return half the width of an interval, NaN for None."""
    return math.nan if ends is None else 0.5 * (ends[1] - ends[0])


def fault_columns(faults: Sequence[FaultEstimate], names: Sequence[str]) -> dict[str, list[Any]]:
    """Return columns of estimates, of their faults and of the ends of their intervals, by name."""
    ends = {end: (key, i) for key, pair in ENDS.items() for i, end in enumerate(pair)}

    def cell(estimate: FaultEstimate, name: str) -> Any:
        if name not in ends:
            return getattr(estimate if hasattr(estimate, name) else estimate.fault, name)
        key, i = ends[name]
        both = getattr(estimate, key)
        return None if both is None else both[i]

    return {name: [cell(estimate, name) for estimate in faults] for name in names}
