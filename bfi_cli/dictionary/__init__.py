"""A fault dictionary: the faults an analysis looks for, with the signals they would add to each output.

`document` is the YAML as it is written, `expansion` turns grids into single faults, `validation` words the complaints.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import DictionaryError
from ..faults import Fault
from ..filters import recorded_signal
from ..kernels.low_pass import IDENTITY, Response
from ..printable import shortened
from ..yaml12 import load_yaml, read_text
from .document import DictionaryDocument
from .expansion import expand
from .validation import SENTENCE_LETTERS, editor_schema, validated

__all__ = ["Dictionary", "DictionaryDocument", "dead_reason", "expand", "json_schema", "load_dictionary", "signals"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dictionary:
    """The faults to look for, each with a name of its own.

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

    def resolved(self, window_start_s: float) -> tuple[Fault, ...]:
        """Return the atoms with onset and offset on the log's time axis."""
        if self.relative_to == "log":
            return self.atoms
        return tuple(_shifted(atom, window_start_s) for atom in self.atoms)


def _shifted(fault: Fault, shift_s: float) -> Fault:
    offset = None if fault.offset_s is None else fault.offset_s + shift_s
    return replace(fault, onset_s=fault.onset_s + shift_s, offset_s=offset)


def load_dictionary(
    source: str | Path | Mapping[str, Any] | DictionaryDocument,
    *,
    where: str | None = None,
    folder: Path | None = None,
    allow_outside: bool = False,
) -> Dictionary:
    """Return the dictionary of a YAML file, of a mapping, or of a document validated already.

    Parameters
    ----------
    source : a `str` is a path.
    where : what messages call it; default the path, or "dictionary".
    folder : what the sample files of a mapping are relative to, default the working directory; those of a file are
        relative to the file.
    allow_outside : sample files may lie outside that folder. They may for a mapping without a folder: its sample files
        are named by the caller.

    Raises
    ------
    DictionaryError : everything that is wrong, in one line. Sample files are only checked to exist.
    """
    sha256 = None
    if isinstance(source, str | Path):
        path = Path(source)
        text = read_text(path, error=DictionaryError)
        where, folder, sha256 = where or str(path), path.parent, hashlib.sha256(path.read_bytes()).hexdigest()
        source = load_yaml(text, where=where, error=DictionaryError)
    where = where or "dictionary"
    document = source
    if not isinstance(document, DictionaryDocument):
        context = {} if folder is None else {"folder": folder, "allow_outside": allow_outside}
        document = validated(DictionaryDocument, source, where=where, error=DictionaryError, context=context)
    try:
        atoms = expand(document)
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
    for j, fault in enumerate(faults):
        if fault.channel not in outputs:
            raise DictionaryError(f"dictionary: {_not_an_output(fault, outputs)}")
        signal = recorded_signal(fault, time_s, response, window_start_s=window_start_s)
        columns[:, outputs.index(fault.channel), j] = signal
    return columns


def dead_reason(fault: Fault, start_s: float, stop_s: float, *, outputs: Sequence[str] | None = None) -> str | None:
    """Return why the fault leaves no trace in the window, as a sentence; None where it may.

    Parameters
    ----------
    fault : with times on the log's axis, see `Dictionary.resolved`.
    start_s, stop_s : the analysed window.
    outputs : the analysed channels; None not to look.
    """
    name = f"'{fault.name or fault.shape}'"
    if outputs is not None and fault.channel not in outputs:
        return _not_an_output(fault, outputs)
    if fault.onset_s >= stop_s:
        late = f"{name} starts at {fault.onset_s:g} s, after the window ends ({stop_s:g} s)"
        return f"{late}; move its onset or widen the window"
    if fault.offset_s is not None and fault.offset_s <= start_s:
        early = f"{name} ends at {fault.offset_s:g} s, before the window starts ({start_s:g} s)"
        return f"{early}; move its offset or widen the window"
    return None


def _not_an_output(fault: Fault, outputs: Sequence[str]) -> str:
    name = f"'{fault.name or fault.shape}'"
    has = ", ".join(outputs)
    return f"{name} acts on '{fault.channel}', which is no output ({has}); add --output {fault.channel}"


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of the dictionary's YAML, for editors."""
    return editor_schema(DictionaryDocument, "bfi fault dictionary")
