"""The YAML of a fault dictionary as it is written: atoms by shape, grids of them, and where times count from."""

from __future__ import annotations

import math
from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeVar, cast

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationInfo, create_model, model_validator

from ..faults import shown
from ..sample_file import lies_inside
from ..shapes import SHAPES
from .validation import Number, Positive, Rules, Text

__all__ = ["MAX_ATOMS", "AtomEntry", "DictionaryDocument", "GridEntry", "Range"]

MAX_ATOMS = 10_000


class Range(Rules):
    """Equally spaced numbers; `stop` is included where the steps reach it."""

    start: Number
    stop: Number
    step: Positive

    @model_validator(mode="after")
    def _is_countable(self) -> Range:
        if self.stop < self.start:
            raise ValueError(f"stop must not be before start ({self.start:g}), got {self.stop:g}")
        if (self.stop - self.start) / self.step > MAX_ATOMS:
            raise ValueError(f"more than {MAX_ATOMS} values; give a larger step")
        return self

    def values(self) -> tuple[float, ...]:
        """Return the numbers, rounded to twelve digits so that 3 x 2.6 reads 7.8."""
        count = math.floor((self.stop - self.start) / self.step + 1e-9) + 1
        return tuple(float(f"{self.start + i * self.step:.12g}") for i in range(count))


def _kind_of_numbers(value: object) -> str:
    if isinstance(value, list | tuple):
        return "<list>"
    return "<range>" if isinstance(value, dict | Range) else "<number>"


def _kind_of_names(value: object) -> str:
    return "<list>" if isinstance(value, list | tuple) else "<name>"


def _scalars(value: object) -> tuple[Any, ...]:
    if isinstance(value, Range):
        return value.values()
    return value if isinstance(value, tuple) else (value,)


def _positive(value: Any) -> Any:
    if any(number <= 0 for number in _scalars(value)):
        raise ValueError(f"must be greater than 0, got {min(_scalars(value)):g}")
    return value


def _nonzero(value: Any) -> Any:
    if any(number == 0 for number in _scalars(value)):
        raise ValueError("must not be 0, got 0; leave it out for the default")
    return value


def _existing(file: str, info: ValidationInfo) -> str:
    context = info.context or {}
    folder = Path(context.get("folder", ""))
    path = folder / file
    try:
        is_outside, found = "folder" in context and not lies_inside(path, folder), path.is_file()
    except (OSError, ValueError):
        is_outside, found = False, False
    if is_outside and not context.get("allow_outside"):  # said first: whether the file exists is not told
        raise ValueError(f"{shown(file)} lies outside the dictionary's folder; move it there or give --allow-outside")
    if not found:
        raise ValueError(f"no such file, got {shown(str(path))}; give a CSV file of time, value")
    return str(path)


Numbers = Annotated[
    Annotated[Number, Tag("<number>")]
    | Annotated[tuple[Number, ...], Field(min_length=1), Tag("<list>")]
    | Annotated[Range, Tag("<range>")],
    Discriminator(_kind_of_numbers),
]
Names = Annotated[
    Annotated[Text, Tag("<name>")] | Annotated[tuple[Text, ...], Field(min_length=1), Tag("<list>")],
    Discriminator(_kind_of_names),
]
N = TypeVar("N")
C = TypeVar("C")


class _Entry(Rules, Generic[N, C]):
    name: Text | None = None
    """What results call it; default shape_channel_onset. In a grid, what replaces the shape in that."""
    channel: C | None = None
    """The faulty channel; default the dictionary's `channel`."""
    magnitude: N | None = None
    """The multiplier; for `bfi inject`, an analysis estimates it."""
    onset_s: N | None = None
    """When it starts, s; default 0. See `relative_to`."""
    offset_s: N | None = None
    """When it ends, s; default never."""

    @model_validator(mode="after")
    def _ends_after_start(self) -> _Entry[N, C]:
        onset, offset = self.onset_s or 0.0, self.offset_s
        if isinstance(onset, float | int) and isinstance(offset, float | int) and offset <= onset:
            raise ValueError(f"offset_s must be after onset_s ({onset:g} s), got {offset:g} s")
        return self


def _entry_of(name: str, number: Any, names: Any, suffix: str) -> type[Rules]:
    """Return the model of the entries of one shape; the JSON schema calls it LaggedBias, in grids LaggedBiasGrid."""
    values = {
        "number": number,
        "positive": Annotated[number, AfterValidator(_positive)],
        "nonzero": Annotated[number, AfterValidator(_nonzero)],
        "reference": Literal["onset", "window"],
        "file": Annotated[Text, AfterValidator(_existing)],
    }
    fields: dict[str, Any] = {}
    for key in sorted(SHAPES[name].keys, key=lambda key: not key.required):
        value = values[key.rule]
        kind, default = (value, ...) if key.required else (value | None, None)
        fields[key.name] = (kind, Field(default, description=key.description))
    shape = {"shape": (Literal[name], ...)}
    # Messages and the schema list the keys in this order: an oscillation's own first.
    fields = fields | shape if SHAPES[name].kind == "oscillating" else shape | fields
    title = "".join(word.capitalize() for word in name.split("_")) + suffix
    made = create_model(title, __base__=_Entry[number, names], __module__=__name__, **fields)
    globals()[title] = made  # where pickle looks for it, when a configuration goes to another process
    return cast("type[Rules]", made)


if TYPE_CHECKING:
    AtomEntry = _Entry[Number, Text]
    GridEntry = _Entry[Numbers, Names]
else:
    ATOMS = reduce(or_, (_entry_of(name, Number, Text, "") for name in SHAPES))
    GRIDS = reduce(or_, (_entry_of(name, Numbers, Names, "Grid") for name in SHAPES))
    AtomEntry = Annotated[ATOMS, Discriminator("shape")]
    GridEntry = Annotated[GRIDS, Discriminator("shape")]


class DictionaryDocument(Rules):
    """A fault dictionary: the faults to look for."""

    channel: Text = "tas"
    """The channel of atoms that name none."""
    relative_to: Literal["window", "log"] = "log"
    """Times count from the start of the analysed window, or are on the log's time axis."""
    atoms: tuple[AtomEntry, ...] = ()
    """One fault each."""
    grids: tuple[GridEntry, ...] = ()
    """Many faults each: every combination of the values given as a list or as {start, stop, step}."""
