"""The configuration of an analysis: every key with its default, checked whole, never changed after."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, PrivateAttr, StrictBool, Tag, ValidationInfo, model_validator

from .dictionary import Dictionary, DictionaryDocument, expand, load_dictionary
from .dictionary.validation import Number, Positive, Rules, Text, Whole, editor_schema, validated
from .errors import ConfigError
from .yaml12 import load_yaml, read_text

__all__ = ["Config", "StartTime", "json_schema", "load_config", "merge"]


def _word_or_number(value: object) -> str:
    return "<word>" if isinstance(value, str) else "<number>"


def _path_or_document(value: object) -> str:
    return "<path>" if isinstance(value, str | Path) else "<document>"


def _distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(set(values)) < len(values):
        raise ValueError(f"a value stands twice, got {list(values)}; keep one")
    return values


def _beside_config(path: str, info: ValidationInfo) -> str:
    return str(Path((info.context or {}).get("folder", "")) / path)


def _expandable(document: DictionaryDocument) -> DictionaryDocument:
    expand(document)
    return document


Natural = Annotated[Whole, Field(ge=1)]
Names = Annotated[tuple[Text, ...], Field(min_length=1), AfterValidator(_distinct)]
Rate = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[Literal["none", "auto"], Tag("<word>")],
    Discriminator(_word_or_number),
]
Order = Annotated[
    Annotated[Natural, Tag("<number>")] | Annotated[Literal["auto"], Tag("<word>")],
    Discriminator(_word_or_number),
]
DictionarySource = Annotated[
    Annotated[Text, AfterValidator(_beside_config), Tag("<path>")]
    | Annotated[DictionaryDocument, AfterValidator(_expandable), Tag("<document>")],
    Discriminator(_path_or_document),
]


class Window(Rules):
    """The part of the log to analyse, s on its own time axis."""

    from_s: Number | None = None
    """Default the start of the log."""
    to_s: Number | None = None
    """Default the end of the log."""

    @model_validator(mode="after")
    def _is_not_empty(self) -> Window:
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"to_s must be after from_s ({self.from_s:g} s), got {self.to_s:g} s")
        return self


class Conditioning(Rules):
    """What happens to inputs, outputs and dictionary alike before the analysis."""

    rate_hz: Rate = "auto"
    """The rate to decimate to; none for the log's own; auto chooses."""
    detrend: Literal["constant", "none"] = "constant"
    """Whether the mean of every signal is taken off."""
    filter: Literal["linear-phase", "causal"] = "linear-phase"
    """The low-pass in front of the decimation; causal lets nothing of a fault appear before its onset."""


class Model(Rules):
    """The VARX model."""

    order: Order = "auto"
    """Number of lags; auto chooses among `orders` together with the faults."""
    orders: Annotated[tuple[Natural, ...], Field(min_length=1), AfterValidator(_distinct)] = (2, 4, 6, 8, 12)
    """The orders to choose from."""
    feedthrough: StrictBool | None = None
    """Whether an input acts in the same sample too; default true, false with method risro."""


class Risro(Rules):
    """Settings of method risro."""

    as_published: StrictBool = False
    """The algorithm to the letter, its slips included."""
    max_iterations: Natural = 50
    tolerance: Positive = 1e-10
    """Stop at this relative change of the iterate and of the misfit."""
    sparsity: Literal["none", "l1", "lp", "exp_l0"] = "none"
    """The norm of the pseudo-measurement stage."""
    alpha: Positive = 1.0
    """Steepness of the exponential norm."""
    r: Positive = 10.0
    """Variance of the pseudo-measurement."""
    p0: Positive = 1.0
    """Initial variance of a magnitude."""
    updates: Annotated[Whole, Field(ge=0)] = 1
    """Pseudo-measurement updates per iteration."""


class Selection(Rules):
    """How the active faults are told from the others."""

    criterion: Literal["ebic", "bic"] = "ebic"
    evidence: Annotated[Number, Field(ge=0)] = 4.6
    """How far a fault must lower the criterion; twice the log Bayes factor, 4.6 is ten to one, strong (Jeffreys)."""
    max_active: Natural | None = None
    """At most so many faults; default no limit."""
    threshold: Annotated[Positive, Field(lt=1)] | None = None
    """The rule |z| / norm(z) > threshold in place of the criterion."""


class StartTime(Rules):
    """The scan over all onsets."""

    shapes: Annotated[
        tuple[Literal["bias", "drift", "sine", "lagged_bias", "ramp_hold", "samples"], ...],
        Field(min_length=1),
        AfterValidator(_distinct),
    ] = ("bias", "drift", "sine")
    """What to look for: bias, drift, sine, lagged_bias, ramp_hold, samples."""
    samples: Annotated[Text, AfterValidator(_beside_config)] | None = None
    """CSV of time (s after the onset), value: the shape samples; a file relative to this one."""
    false_alarm: Annotated[Positive, Field(lt=1)] = 0.01
    """Accepted probability of declaring a fault where there is none."""
    calibration: Text | None = None
    """A table of `bfi calibrate`, self, or gaussian; default the shipped table."""
    ends: StrictBool = False
    """Whether the end of the fault is searched for too."""
    frequency_hz: tuple[Positive, Positive] | None = None
    """[low, high] of the oscillations; default 3 / window length to 0.2 x rate."""

    @model_validator(mode="after")
    def _samples_are_looked_for(self) -> StartTime:
        if self.samples is None and "samples" in self.shapes:
            raise ValueError("the shape samples has no file; give samples a CSV of time, value")
        if self.samples is not None and "samples" not in self.shapes:
            raise ValueError(f"samples names {self.samples}, but shapes has no samples; add it")
        return self

    @model_validator(mode="after")
    def _frequencies_increase(self) -> StartTime:
        if self.frequency_hz is not None and self.frequency_hz[1] <= self.frequency_hz[0]:
            low, high = self.frequency_hz
            raise ValueError(f"frequency_hz must be [low, high], got [{low:g}, {high:g}]")
        return self


class Config(Rules):
    """Configuration of bfi."""

    inputs: Names = ("elevator",)
    """The inputs, by standard channel name."""
    outputs: Names = ("tas",)
    """The sensors that may be faulty."""
    channels: Mapping[Text, Text] = Field(default_factory=dict)
    """Standard name: name in the log."""
    units: Mapping[Text, Text] = Field(default_factory=dict)
    """Name in the log: the unit it does not state."""
    window: Window = Window()
    conditioning: Conditioning = Conditioning()
    model: Model = Model()
    method: Literal["ml", "risro"] = "ml"
    """Maximum likelihood, or rank-constrained least squares."""
    risro: Risro = Risro()
    selection: Selection = Selection()
    dictionary: DictionarySource | None = None
    """A file, relative to this one, or the dictionary itself."""
    start_time: StartTime = StartTime()
    seed: Annotated[Whole, Field(ge=0)] = 0
    strict: StrictBool = False
    """Whether an answer that cannot be trusted is exit code 4."""
    fail_on: Literal["fault"] | None = None
    """Exit code 10 when a fault is declared."""

    _path: str | None = PrivateAttr(default=None)
    _sha256: str | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _inputs_are_not_outputs(self) -> Config:
        for name in self.inputs:
            if name in self.outputs:
                raise ValueError(f"'{name}' is both an input and an output; keep one")
        return self

    @property
    def path(self) -> str | None:
        """The file it was read from, None for the defaults."""
        return self._path

    @property
    def sha256(self) -> str | None:
        """Of the file, None for the defaults."""
        return self._sha256

    def load_dictionary(self) -> Dictionary | None:
        """Return the dictionary the configuration names or holds, None where there is none.

        Raises
        ------
        DictionaryError : see `bfi_cli.dictionary.load_dictionary`.
        """
        if self.dictionary is None or isinstance(self.dictionary, str):
            return None if self.dictionary is None else load_dictionary(self.dictionary)
        return load_dictionary(self.dictionary, where=f"{self.path or 'configuration'}: dictionary")


def load_config(path: str | Path) -> Config:
    """Return the configuration of a YAML file; an empty file is the defaults.

    Raises
    ------
    ConfigError : everything that is wrong with it, in one line.
    """
    path = Path(path)
    data = load_yaml(read_text(path, error=ConfigError), where=str(path), error=ConfigError)
    context = {"folder": path.parent}
    config = validated(Config, {} if data is None else data, where=str(path), error=ConfigError, context=context)
    return _with_origin(config, str(path), hashlib.sha256(path.read_bytes()).hexdigest())


def merge(config: Config, overrides: Mapping[str, Any], *, where: str = "command line") -> Config:
    """Return the configuration with values of the command line in place of its own.

    Parameters
    ----------
    overrides : value by dotted path ("model.order"); None means not given. Paths are relative to the working directory.

    Raises
    ------
    ConfigError : everything that is wrong with the values, in one line, by the rules of the file.
    """
    data = config.model_dump(exclude_unset=True)
    for dotted, value in overrides.items():
        if value is not None:
            *parents, key = dotted.split(".")
            _branch(data, parents)[key] = value
    return _with_origin(validated(Config, data, where=where, error=ConfigError), config.path, config.sha256)


def _branch(data: dict[str, Any], parents: list[str]) -> dict[str, Any]:
    for parent in parents:
        below = data.get(parent)
        data[parent] = dict(below) if isinstance(below, Mapping) else {}
        data = data[parent]
    return data


def _with_origin(config: Config, path: str | None, sha256: str | None) -> Config:
    config._path, config._sha256 = path, sha256
    return config


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of the configuration's YAML, for editors."""
    return editor_schema(Config, "bfi configuration")
