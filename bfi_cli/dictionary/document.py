"""The YAML of a fault dictionary as it is written: atoms by shape, grids of them, and where times count from."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationInfo, model_validator

from ..faults import shown
from ..sample_file import lies_inside
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

    @classmethod
    def model_parametrized_name(cls, params: tuple[Any, ...]) -> str:
        """Return what the JSON schema calls the entry: Bias in `atoms`, BiasGrid in `grids`."""
        return f"{cls.__name__}Grid" if params[0] is Numbers else cls.__name__

    @model_validator(mode="after")
    def _ends_after_start(self) -> _Entry[N, C]:
        onset, offset = self.onset_s or 0.0, self.offset_s
        if isinstance(onset, float | int) and isinstance(offset, float | int) and offset <= onset:
            raise ValueError(f"offset_s must be after onset_s ({onset:g} s), got {offset:g} s")
        return self


class Bias(_Entry[N, C], Generic[N, C]):
    """1 from the onset."""

    shape: Literal["bias"]


class Drift(_Entry[N, C], Generic[N, C]):
    """slope x (t - onset)."""

    shape: Literal["drift"]
    slope: Annotated[N, AfterValidator(_nonzero)] | None = None
    """Per second; default 1, and the magnitude then has the channel's unit per second."""


class _Oscillation(_Entry[N, C], Generic[N, C]):
    frequency_hz: Annotated[N, AfterValidator(_positive)]
    phase_rad: N | None = None
    phase_reference: Literal["onset", "window"] | None = None
    """Where the phase counts from: the onset (default) or the start of the window."""


class Sine(_Oscillation[N, C], Generic[N, C]):
    """sin(2 pi f (t - t0) + phase)."""

    shape: Literal["sine"]


class Cosine(_Oscillation[N, C], Generic[N, C]):
    """cos(2 pi f (t - t0) + phase)."""

    shape: Literal["cosine"]


class LaggedBias(_Entry[N, C], Generic[N, C]):
    """1 - exp(-(t - onset) / time constant)."""

    shape: Literal["lagged_bias"]
    time_constant_s: Annotated[N, AfterValidator(_positive)]


class RampHold(_Entry[N, C], Generic[N, C]):
    """slope x min(t - onset, duration)."""

    shape: Literal["ramp_hold"]
    duration_s: Annotated[N, AfterValidator(_positive)]
    slope: Annotated[N, AfterValidator(_nonzero)] | None = None
    """Per second; default 1 / duration, so that it ends at 1."""


class Samples(_Entry[N, C], Generic[N, C]):
    """The values of a CSV file."""

    shape: Literal["samples"]
    file: Annotated[Text, AfterValidator(_existing)]
    """CSV of time (s after the onset), value; relative to this file."""


AtomEntry = Annotated[
    Bias[Number, Text]
    | Drift[Number, Text]
    | Sine[Number, Text]
    | Cosine[Number, Text]
    | LaggedBias[Number, Text]
    | RampHold[Number, Text]
    | Samples[Number, Text],
    Discriminator("shape"),
]
GridEntry = Annotated[
    Bias[Numbers, Names]
    | Drift[Numbers, Names]
    | Sine[Numbers, Names]
    | Cosine[Numbers, Names]
    | LaggedBias[Numbers, Names]
    | RampHold[Numbers, Names]
    | Samples[Numbers, Names],
    Discriminator("shape"),
]


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
