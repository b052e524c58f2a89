"""A fault dictionary: the faults that an analysis looks for, as YAML, as single faults and as the signals they add."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    create_model,
    model_validator,
)
from pydantic_core import InitErrorDetails, core_schema

from ..errors import DictionaryError
from ..faults import Fault, shown
from ..faults.filters import recorded_signals
from ..faults.shapes import IN_DICTIONARY, PARAMETERS, SEARCHED, SHAPES
from ..faults.validation import (
    SENTENCE_LETTERS,
    Number,
    Positive,
    Rules,
    Text,
    deferred,
    editor_schema,
    path_beside,
    validate,
)
from ..kernels.low_pass import IDENTITY, Response
from ..printable import shortened
from ..quantities.text import instant
from ..yaml12 import load_yaml, read_text

__all__ = ["SHIPPED", "Dictionary", "DictionaryDocument", "dead_reason", "dead_reason_of_kind", "dead_sentences"]
__all__ += ["expand", "is_shipped", "json_schema", "load_dictionary", "no_signal", "signals"]

FloatArray = NDArray[np.float64]

# Limit of the faults, a hundred times those of any published dictionary; their YAML fits the limits of `yaml12`.
MAX_ATOMS = 10_000
# Shipped dictionaries by their names.
SHIPPED = {name: Path(__file__).parent / f"{name}.yaml" for name in ("airdata", "thesis")}
# Channel of entries if neither they, nor the dictionary, nor the analysis state one.
CHANNEL = "tas"


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


class Interval(Rules):
    """What a kind of fault may have: any number between two, where one is left out any above or below the other."""

    first: Number | None = Field(None, alias="from")
    """The least."""
    last: Number | None = Field(None, alias="to")
    """The largest."""

    @model_validator(mode="after")
    def _has_a_length(self) -> Interval:
        first, last = self.ends()
        if last <= first:
            raise ValueError(f"to must be after from ({first:g}), got {last:g}; swap them")
        return self

    def ends(self) -> tuple[float, float]:
        """Return both ends, infinite where they are left out."""
        return -math.inf if self.first is None else self.first, math.inf if self.last is None else self.last


def _kind_of_numbers(value: object) -> str:
    if isinstance(value, list | tuple):
        return "<list>"
    if isinstance(value, Interval) or (isinstance(value, dict) and {"from", "to"} & set(value)):
        return "<interval>"
    return "<range>" if isinstance(value, dict | Range) else "<number>"


def _scalars(value: object) -> tuple[Any, ...]:
    if isinstance(value, Interval):
        return tuple(end for end in (value.first, value.last) if end is not None)
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


def _no_magnitude(value: Any) -> None:
    if value is not None:
        raise ValueError(f"this fault is whole and has none, got {shown(value)}; leave it out")


def _existing(file: str, info: ValidationInfo) -> str:
    path = path_beside(file, info, "dictionary")  # first, so that nobody learns whether a file outside exists
    with contextlib.suppress(OSError):  # a name that is too long
        if Path(path).is_file():
            return path
    raise ValueError(f"no such file, got {shown(path)}; give a CSV file of time, value")


One = Annotated[Number, Tag("<number>")]
Several = Annotated[tuple[Number, ...], Field(min_length=1), Tag("<list>")] | Annotated[Range, Tag("<range>")]
Between = Annotated[Interval, Tag("<interval>")]
Numbers = Annotated[One | Several, Discriminator(_kind_of_numbers)]
NumbersOrInterval = Annotated[One | Several | Between, Discriminator(_kind_of_numbers)]
NumberOrInterval = Annotated[
    One | Between,
    Discriminator(lambda value: "<interval>" if _kind_of_numbers(value) == "<interval>" else "<number>"),
]
Names = Annotated[
    Annotated[Text, Tag("<name>")] | Annotated[tuple[Text, ...], Field(min_length=1), Tag("<list>")],
    Discriminator(lambda value: "<list>" if isinstance(value, list | tuple) else "<name>"),
]
Form = Literal["atom", "grid"]
N = TypeVar("N")
C = TypeVar("C")
F = TypeVar("F")


class _Entry(Rules, Generic[N, C, F]):
    name: Text | None = None
    """What results call it; default shape_channel_onset. In a grid, what replaces the shape in that."""
    channel: C | None = None
    """The faulty channel; default the dictionary's `channel`. Of a pressure line, the output to look for it in."""
    magnitude: N | None = None
    """The multiplier; for `bfi inject`, an analysis estimates it."""
    onset_s: F | None = None
    """When it starts, s, or between which times ({from, to}); left out, at any time. See `relative_to`."""
    offset_s: N | None = None
    """When it ends, s; default never."""

    @model_validator(mode="after")
    def _ends_after_start(self) -> _Entry[N, C, F]:
        onset, offset = self.onset_s or 0.0, self.offset_s
        if isinstance(onset, float | int) and isinstance(offset, float | int) and offset <= onset:
            raise ValueError(f"offset_s must be after onset_s ({onset:g} s), got {offset:g} s")
        return self


def _is_searched(shape: str, onset_s: object) -> bool:
    """Say whether an entry with such an onset is a kind of fault, which is searched."""
    return isinstance(onset_s, Interval) or (onset_s is None and shape in SEARCHED)


def _complete(entry: Any) -> Any:
    """Refuse an entry with an onset that lacks a key of its shape, and a kind of fault that no analysis searches."""
    if isinstance(entry.onset_s, Interval) and entry.shape not in SEARCHED:
        raise ValueError(f"onset_s: a {entry.shape} is not searched, give its onset; searched: {', '.join(SEARCHED)}")
    searched = _is_searched(entry.shape, entry.onset_s)
    if searched and entry.offset_s is not None:
        raise ValueError("offset_s: a fault that is searched lasts; leave it out, or give its onset_s")
    complaints: list[InitErrorDetails] = []
    for key in SHAPES[entry.shape].keys:
        value = getattr(entry, key.name)
        if not searched and key.required and value is None:
            complaints.append({"type": "missing", "loc": (key.name,), "input": {}})
        elif not searched and isinstance(value, Interval):
            complaints.append({"type": "float_type", "loc": (key.name,), "input": value.model_dump(by_alias=True)})
    if complaints:
        raise ValidationError.from_exception_data("entry", complaints)
    return entry


@cache
def _entry_of(name: str, form: Form) -> type[Rules]:
    """Return the model of the entries of one shape; the JSON schema calls it LaggedBias, in grids LaggedBiasGrid."""
    numbers: Any = Numbers if form == "grid" else Number
    numbers_or_interval: Any = NumbersOrInterval if form == "grid" else NumberOrInterval
    names: Any = Names if form == "grid" else Text
    values = {
        "number": numbers,
        "positive": Annotated[numbers, AfterValidator(_positive)],
        "nonzero": Annotated[numbers, AfterValidator(_nonzero)],
        "reference": Literal["onset", "window"],
        "file": Annotated[Text, AfterValidator(_existing)],
    }
    fields: dict[str, Any] = {}
    for key in sorted(SHAPES[name].keys, key=lambda key: not key.required):
        value = values[key.rule]
        kind, default = (value, ...) if key.required else (value | None, None)
        if key.name in PARAMETERS and name in SEARCHED:
            kind, default = Annotated[numbers_or_interval, AfterValidator(_positive)] | None, None
        fields[key.name] = (kind, Field(default, description=key.description))
    if not SHAPES[name].has_magnitude and SHAPES[name].lines is not None:
        whole = Annotated[None, BeforeValidator(_no_magnitude)]
        fields["magnitude"] = (whole, Field(None, description="None: this fault is whole."))
    shape = {"shape": (Literal[name], ...)}
    # Messages and the schema list the keys in this order, those of an oscillation first.
    fields = fields | shape if SHAPES[name].kind == "oscillating" else shape | fields
    complete: dict[str, Any] = {"complete": model_validator(mode="after")(_complete)}
    base: Any = _Entry
    base = base[numbers, names, numbers_or_interval]
    title = _title(name, form)
    made = create_model(title, __base__=base, __module__=__name__, __validators__=complete, **fields)
    return cast("type[Rules]", made)


def _title(name: str, form: Form) -> str:
    return "".join(word.capitalize() for word in name.split("_")) + ("Grid" if form == "grid" else "")


def __getattr__(title: str) -> type[Rules]:
    """Return the model of a title, for pickle, when a configuration goes to another process."""
    form: Form = "grid" if title.endswith("Grid") else "atom"
    for name in IN_DICTIONARY:
        if _title(name, form) == title:
            return _entry_of(name, form)
    raise AttributeError(f"module {__name__!r} has no attribute {title!r}")


@dataclass(frozen=True)
class _ByShape:
    """Marks entries that are validated by the model of their shape, which is made when the first such entry is met."""

    form: Form

    def models(self) -> Iterator[type[Rules]]:
        """Yield the models of all shapes."""
        return (_entry_of(name, self.form) for name in IN_DICTIONARY)

    def __get_pydantic_core_schema__(self, _source: object, _handler: object) -> core_schema.CoreSchema:
        choices = {name: deferred(partial(_entry_of, name, self.form)) for name in IN_DICTIONARY}
        return core_schema.tagged_union_schema(choices, "shape")


AtomEntry = Annotated[Any, _ByShape("atom")]
GridEntry = Annotated[Any, _ByShape("grid")]


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

    @model_validator(mode="before")
    @classmethod
    def _is_told_by_a_log(cls, given: Any) -> Any:
        for part in ("atoms", "grids"):
            entries = given.get(part) if isinstance(given, Mapping) else None
            for i, entry in enumerate(entries if isinstance(entries, list | tuple) else ()):
                shape = entry.get("shape") if isinstance(entry, Mapping) else None
                if isinstance(shape, str) and shape in SHAPES and shape not in IN_DICTIONARY:
                    raise ValueError(
                        f"{part}[{i}].shape: no log tells the signal of a trapped line, which keeps no trace of the "
                        f"pressure outside, got '{shape}'; use bfi diagnose, which holds the line's pressure against "
                        "lift and altitude"
                    )
        return given


def is_shipped(name: str) -> bool:
    """Say whether a name is that of a dictionary of `SHIPPED`; a file of that name takes precedence."""
    return name in SHIPPED and not Path(name).is_file()


def expand(document: DictionaryDocument, channel: str = CHANNEL) -> tuple[Fault, ...]:
    """Return one fault per atom and per combination of a grid, in the order of the document.

    Combinations that would end before they start are left out. Faults without a name are called shape_channel_onset,
    with the other keys a grid runs over appended, and a number where that is still not unique.

    Parameters
    ----------
    channel : of entries without a channel in a document without one.

    Raises
    ------
    ValueError : a name stands twice, there are no atoms or too many, or a grid has no possible combination.
    """
    if not document.atoms and not document.grids:
        raise ValueError("no faults; add atoms or grids")
    taken: dict[str, int] = {}
    for i, atom in enumerate(document.atoms):
        if atom.name and taken.setdefault(atom.name, i) != i:
            raise ValueError(f"atoms[{i}].name: '{atom.name}' is also atoms[{taken[atom.name]}]; choose another")
    total = len(document.atoms) + sum(math.prod(map(len, _axes(grid).values())) for grid in document.grids)
    if total > MAX_ATOMS:
        raise ValueError(f"{total} faults are more than {MAX_ATOMS}; give larger steps")
    names = set(taken)
    channel = document.channel if "channel" in document.model_fields_set else channel
    faults = [fault for atom in document.atoms for fault in _faults(atom, channel, names, is_grid=False)]
    for i, grid in enumerate(document.grids):
        combinations = list(_faults(grid, channel, names, is_grid=True))
        if not combinations:
            raise ValueError(f"grids[{i}]: every offset_s is before every onset_s; swap them")
        faults += combinations
    return tuple(faults)


def _axes(entry: Any) -> dict[str, tuple[Any, ...]]:
    """Return the keys of a grid that hold several values, with their values."""
    values = {key: getattr(entry, key) for key in type(entry).model_fields}
    ranged = {key: value.values() if isinstance(value, Range) else value for key, value in values.items()}
    return {key: value for key, value in ranged.items() if isinstance(value, tuple)}


def _faults(entry: Any, channel: str, taken: set[str], *, is_grid: bool) -> Iterator[Fault]:
    """Yield the faults of an atom or a grid; their new names are added to `taken`."""
    axes = _axes(entry)
    fixed = {key: getattr(entry, key) for key in type(entry).model_fields if key not in axes}
    given = {"channel": channel, "onset_s": 0.0} | {key: value for key, value in fixed.items() if value is not None}
    if searched := _is_searched(entry.shape, entry.onset_s):
        given |= {"onset_s": 0.0, "onset_range_s": (entry.onset_s or Interval()).ends()}
        for key in [key for key in PARAMETERS if isinstance(given.get(key), Interval)]:
            given["parameter_range"] = given.pop(key).ends()
    longer = [key for key, values in axes.items() if len(values) > 1 and key not in ("channel", "onset_s")]
    for combination in itertools.product(*axes.values()):
        fault = given | dict(zip(axes, combination, strict=True))
        if fault.get("offset_s", math.inf) <= fault["onset_s"]:
            continue
        if is_grid or "name" not in given:
            stem = f"{fault.get('name', fault['shape'])}_{fault['channel']}"
            stem += "" if searched else f"_{fault['onset_s']:.12g}"
            stem += "".join(f"_{key}_{fault[key]:.12g}" for key in longer)
            numbered = (f"{stem}_{i}" for i in itertools.count(2))
            fault["name"] = next(name for name in itertools.chain([stem], numbered) if name not in taken)
            taken.add(fault["name"])
        yield Fault(**fault)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dictionary:
    """The faults to look for, each with a unique name.

    Attributes
    ----------
    atoms : times as stated, see `relative_to`; grids are expanded.
    relative_to : "window" (times count from the start of the analysed window) or "log" (the log's time axis).
    sha256 : of the file, or of the canonical JSON of an inline dictionary.
    path : where it was read from, for messages.
    """

    atoms: tuple[Fault, ...]
    relative_to: Literal["window", "log"]
    sha256: str
    path: str

    @property
    def exact(self) -> Dictionary:
        """The entries whose onsets are stated."""
        return replace(self, atoms=tuple(fault for fault in self.atoms if fault.onset_range_s is None))

    @property
    def searched(self) -> Dictionary:
        """The kinds of fault, whose onsets are not known."""
        return replace(self, atoms=tuple(fault for fault in self.atoms if fault.onset_range_s is not None))

    def resolved(self, window_start_s: float) -> tuple[Fault, ...]:
        """Return the atoms with onset and offset on the log's time axis."""
        return self.atoms if self.relative_to == "log" else tuple(fault.later(window_start_s) for fault in self.atoms)


# A command reads its dictionary for the digest, and again when the log has said on which channel its entries act.
@lru_cache(maxsize=1)
def _parsed(text: str, where: str) -> Any:
    return load_yaml(text, where=where, error=DictionaryError)


def load_dictionary(
    source: str | Path | Mapping[str, Any] | DictionaryDocument,
    *,
    where: str | None = None,
    folder: Path | None = None,
    allow_outside: bool = False,
    channel: str = CHANNEL,
) -> Dictionary:
    """Return the dictionary of a YAML file, of a mapping, or of a validated document.

    Parameters
    ----------
    source : a `str` is a path, or the name of a dictionary of `SHIPPED`.
    where : name of the dictionary in messages; default the path, or "dictionary".
    folder : to which the sample files of a mapping are relative, default the working directory; those of a file are
        relative to the file.
    allow_outside : sample files may lie outside that folder. They may in any case for a mapping without a folder, whose
        sample files the caller names.
    channel : of entries without a channel in a dictionary without one.

    Raises
    ------
    DictionaryError : all complaints in one line. Sample files are only checked to exist.
    """
    sha256 = None
    if isinstance(source, str | Path):
        path = Path(source)
        if isinstance(source, str) and is_shipped(source):
            where, path = where or source, SHIPPED[source]
        elif path.name == str(source) and not path.suffix and not path.exists():
            raise DictionaryError(
                f"{source}: no such file or shipped dictionary; the shipped ones are {', '.join(SHIPPED)}"
            )
        text = read_text(path, error=DictionaryError)
        where, folder, sha256 = where or str(path), path.parent, hashlib.sha256(path.read_bytes()).hexdigest()
        source = _parsed(text, where)
    where = where or "dictionary"
    document = source
    if not isinstance(document, DictionaryDocument):
        context = {} if folder is None else {"folder": folder, "allow_outside": allow_outside}
        document = validate(DictionaryDocument, source, where=where, error=DictionaryError, context=context)
    try:
        atoms = expand(document, channel)
    except ValueError as problem:
        raise DictionaryError(f"{where}: {shortened(str(problem), SENTENCE_LETTERS)}") from None
    canonical = document.model_dump_json(exclude_unset=True).encode()
    return Dictionary(
        atoms=atoms,
        relative_to=document.relative_to,
        sha256=sha256 or hashlib.sha256(canonical).hexdigest(),
        path=where,
    )


def signals(
    faults: Sequence[Fault],
    time_s: FloatArray,
    outputs: Sequence[str],
    *,
    window_start_s: float,
    response: Response = IDENTITY,
) -> FloatArray:
    """Return (n_samples, n_outputs, n_atoms): what each fault at magnitude 1 adds to each output.

    Parameters
    ----------
    faults : with times on the axis of `time_s`, see `Dictionary.resolved`.
    time_s : (n_samples,) seconds.
    outputs : channel names.
    window_start_s : see `bfi_cli.faults.unit_signal`.
    response : of the filters that the log went through.

    Raises
    ------
    DictionaryError : a fault acts on a channel that is no output, or a sample file cannot be used.
    """
    columns = np.zeros((np.size(time_s), len(outputs), len(faults)))
    for fault in faults:
        if fault.channel not in outputs:
            name = f"'{fault.called}'"
            raise DictionaryError(f"dictionary: {name} acts on {_not_an_output(fault.channel, outputs)}")
    made = recorded_signals(faults, np.asarray(time_s), response, window_start_s=window_start_s)
    for j, fault in enumerate(faults):
        columns[:, outputs.index(fault.channel), j] = made[:, j]
    return columns


def dead_reason(fault: Fault, start_s: float, stop_s: float, *, outputs: Sequence[str] | None = None) -> str | None:
    """Return why a fault leaves no trace in a window, as a sentence; None where it may leave one.

    Parameters
    ----------
    fault : with times on the log's axis, see `Dictionary.resolved`.
    start_s, stop_s : the analysed window.
    outputs : the analysed channels; None to skip their check.
    """
    return next(iter(dead_sentences([fault], start_s, stop_s, outputs=outputs)), None)


def dead_reason_of_kind(fault: Fault, start_s: float, stop_s: float, outputs: Sequence[str]) -> str | None:
    """Return why a kind of fault, its onsets on the axis of the log, is not searched in a window; None where it is."""
    first_s, last_s = fault.onset_range_s or (start_s, stop_s)
    if fault.channel not in outputs:
        return dead_reason(fault, start_s, stop_s, outputs=outputs)
    if first_s < stop_s and last_s > start_s:
        return None
    window = f"outside of the window ({instant(start_s)} to {instant(stop_s)} s)"
    return f"'{fault.name}' begins between {instant(first_s)} and {instant(last_s)} s, {window}; move its onset_s"


def dead_sentences(
    faults: Sequence[Fault], start_s: float, stop_s: float, *, outputs: Sequence[str] | None = None
) -> tuple[str, ...]:
    """Return why faults leave no trace in a window, a sentence for each reason, with all faults of that reason.

    Parameters
    ----------
    faults, start_s, stop_s, outputs : see `dead_reason`; faults that may leave a trace are not mentioned.
    """
    heard = [fault for fault in faults if outputs is None or fault.channel in outputs]
    sentences = [
        f"'{fault.name}' is a kind of fault, searched by bfi identify alone; give its onset_s"
        for fault in heard
        if fault.onset_range_s is not None
    ]
    heard = [fault for fault in heard if fault.onset_range_s is None]
    late = [fault for fault in heard if fault.onset_s >= stop_s]
    early = [fault for fault in heard if fault.offset_s is not None and fault.offset_s <= start_s]
    starts, ends = [fault.onset_s for fault in late], [fault.offset_s or 0.0 for fault in early]

    def named(group: Sequence[Fault]) -> str:
        return ", ".join(f"'{fault.called}'" for fault in group)

    for group, verb, key, times_s, where in (
        (late, "start", "onset", starts, f"after the window ends ({instant(stop_s)} s)"),
        (early, "end", "offset", ends, f"before the window starts ({instant(start_s)} s)"),
    ):
        if group:
            s, move = ("s", f"its {key}") if len(group) == 1 else ("", f"their {key}s")
            times = " to ".join(f"{time_s:g}" for time_s in dict.fromkeys((min(times_s), max(times_s))))
            sentences.append(f"{named(group)} {verb}{s} at {times} s, {where}; move {move} or widen the window")
    mute = [fault for fault in faults if outputs is not None and fault.channel not in outputs]
    for channel in dict.fromkeys(fault.channel for fault in mute):
        group = [fault for fault in mute if fault.channel == channel]
        sentences.append(f"{named(group)} act{'s' * (len(group) == 1)} on {_not_an_output(channel, outputs or ())}")
    return tuple(sentences)


def no_signal(fault: Fault) -> str:
    """Return, as a sentence, why a fault without a signal is left out of an analysis of signals without a log."""
    if SHAPES[fault.shape].acts_on == "course":
        return f"'{fault.called}' has no signal of its own; bfi identify estimates its course"
    if SHAPES[fault.shape].lines is not None:
        return f"'{fault.called}' follows from the pressures that the log shows; give the log"
    return f"'{fault.called}' is a share of what the log shows; give the log"


def _not_an_output(channel: str, outputs: Sequence[str]) -> str:
    return f"'{channel}', which is no output ({', '.join(outputs)}); add --output {channel}"


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of the dictionary's YAML, for editors."""
    return editor_schema(DictionaryDocument, "bfi fault dictionary")
