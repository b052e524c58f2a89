"""The configuration of an analysis: every key with its default, checked whole, never changed after."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, PrivateAttr, StrictBool, Tag, model_validator

from ..dictionary import Dictionary, DictionaryDocument, expand, load_dictionary
from ..dictionary.validation import Rules, Text, Whole, editor_schema, validated
from ..errors import ConfigError
from ..faults import did_you_mean, shown
from ..identify.methods import METHODS
from ..yaml12 import load_yaml, read_text
from .sections import (
    AuditOfDictionary,
    Calibrate,
    Conditioning,
    Detect,
    Diagnosability,
    Dmae,
    Model,
    Names,
    PathText,
    Risro,
    Selection,
    StartTime,
    Window,
    beside_config,
)

__all__ = ["Config", "DictionarySource", "json_schema", "load_config", "merge"]


def _path_or_document(value: object) -> str:
    return "<path>" if isinstance(value, str | Path) else "<document>"


def _expandable(document: DictionaryDocument) -> DictionaryDocument:
    expand(document)
    return document


def _registered(name: str) -> str:
    if name not in METHODS:
        raise ValueError(f"not one of the choices, got {shown(name)}{did_you_mean(name, list(METHODS))}")
    return name


DictionarySource = Annotated[
    Annotated[PathText, AfterValidator(beside_config), Tag("<path>")]
    | Annotated[DictionaryDocument, AfterValidator(_expandable), Tag("<document>")],
    Discriminator(_path_or_document),
]


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
    group: Text | None = None
    """HDF5 group or MATLAB struct that holds the channels."""
    window: Window = Window()
    conditioning: Conditioning = Conditioning()
    model: Model = Model()
    method: Annotated[Text, AfterValidator(_registered)] = "ml"
    """How faults are identified: ml, maximum likelihood, or another registered method, see bfi identify --help."""
    risro: Risro = Risro()
    dmae: Dmae = Dmae()
    selection: Selection = Selection()
    dictionary: DictionarySource | None = None
    """A file, relative to this one, or the dictionary itself."""
    start_time: StartTime = StartTime()
    calibrate: Calibrate = Calibrate()
    detect: Detect = Detect()
    diagnosability: Diagnosability = Diagnosability()
    audit: AuditOfDictionary = AuditOfDictionary()
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
    def feedthrough(self) -> bool:
        """Whether an input acts in the same sample too, as asked for or as the method has it."""
        return METHODS[self.method].feedthrough if self.model.feedthrough is None else self.model.feedthrough

    @property
    def path(self) -> str | None:
        """The file it was read from, None for the defaults."""
        return self._path

    @property
    def sha256(self) -> str | None:
        """Of the file, None for the defaults."""
        return self._sha256

    def load_dictionary(self, *, allow_outside: bool = False) -> Dictionary | None:
        """Return the dictionary the configuration names or holds, None where there is none.

        Parameters
        ----------
        allow_outside : the sample files of a dictionary may lie outside its folder.

        Raises
        ------
        DictionaryError : see `bfi_cli.dictionary.load_dictionary`.
        """
        if self.dictionary is None or isinstance(self.dictionary, str):
            source = self.dictionary
            return None if source is None else load_dictionary(source, allow_outside=allow_outside)
        return load_dictionary(self.dictionary, where=f"{self.path or 'configuration'}: dictionary")


def load_config(path: str | Path, *, allow_outside: bool = False) -> Config:
    """Return the configuration of a YAML file; an empty file is the defaults.

    Parameters
    ----------
    allow_outside : sample files may lie outside the file's folder.

    Raises
    ------
    ConfigError : everything that is wrong with it, in one line.
    """
    path = Path(path)
    data = load_yaml(read_text(path, error=ConfigError), where=str(path), error=ConfigError)
    context = {"folder": path.parent, "allow_outside": allow_outside}
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
