"""From a document to single faults: grids become every combination of their values, every fault gets its own name."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

from ..faults import Fault
from .document import MAX_ATOMS, DictionaryDocument, Range

__all__ = ["expand"]

NAMED_BY = ("channel", "onset_s")


def expand(document: DictionaryDocument) -> tuple[Fault, ...]:
    """Return one fault per atom and per combination of a grid, in the order of the document.

    Combinations that would end before they start are left out. Faults without a name are called shape_channel_onset,
    with the other keys a grid runs over appended, and a number where that is still not unique.

    Raises
    ------
    ValueError : a name stands twice, there are no atoms or too many, or a grid has no possible combination.
    """
    if not document.atoms and not document.grids:
        raise ValueError("no faults; add atoms or grids")
    _check_names(document)
    total = len(document.atoms) + sum(math.prod(map(len, _axes(grid).values())) for grid in document.grids)
    if total > MAX_ATOMS:
        raise ValueError(f"{total} faults are more than {MAX_ATOMS}; give larger steps")
    faults: list[Fault] = []
    taken = {atom.name for atom in document.atoms if atom.name}
    for atom in document.atoms:
        faults.extend(_faults(atom, document.channel, taken, is_grid=False))
    for i, grid in enumerate(document.grids):
        combinations = list(_faults(grid, document.channel, taken, is_grid=True))
        if not combinations:
            raise ValueError(f"grids[{i}]: every offset_s is before every onset_s; swap them")
        faults.extend(combinations)
    return tuple(faults)


def _check_names(document: DictionaryDocument) -> None:
    first: dict[str, int] = {}
    for i, atom in enumerate(document.atoms):
        if atom.name and first.setdefault(atom.name, i) != i:
            raise ValueError(f"atoms[{i}].name: '{atom.name}' is also atoms[{first[atom.name]}]; choose another")


def _axes(entry: Any) -> dict[str, tuple[Any, ...]]:
    values = {key: getattr(entry, key) for key in type(entry).model_fields}
    ranged = {key: value.values() if isinstance(value, Range) else value for key, value in values.items()}
    return {key: value for key, value in ranged.items() if isinstance(value, tuple)}


def _faults(entry: Any, channel: str, taken: set[str], *, is_grid: bool) -> Iterator[Fault]:
    axes = _axes(entry)
    fixed = {key: getattr(entry, key) for key in type(entry).model_fields if key not in axes}
    given = {"channel": channel, "onset_s": 0.0} | {key: value for key, value in fixed.items() if value is not None}
    longer = [key for key, values in axes.items() if len(values) > 1 and key not in NAMED_BY]
    for combination in itertools.product(*axes.values()):
        fault = given | dict(zip(axes, combination, strict=True))
        if fault.get("offset_s", math.inf) <= fault["onset_s"]:
            continue
        if is_grid or "name" not in given:
            fault["name"] = _unique(_name(fault, longer), taken)
            taken.add(fault["name"])
        yield Fault(**fault)


def _name(fault: Mapping[str, Any], longer: list[str]) -> str:
    stem = f"{fault.get('name', fault['shape'])}_{fault['channel']}_{fault['onset_s']:.12g}"
    return stem + "".join(f"_{key}_{fault[key]:.12g}" for key in longer)


def _unique(name: str, taken: set[str]) -> str:
    numbered = (f"{name}_{i}" for i in itertools.count(2))
    return name if name not in taken else next(candidate for candidate in numbered if candidate not in taken)
