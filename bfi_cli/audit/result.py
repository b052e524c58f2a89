"""What an audit found: plain frozen data that renders to tables, JSON, CSV and a figure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from ..faults import Fault
from ..kernels import FloatArray
from ..notes import Note
from ..preprocessing.summary import ModelSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditedAtom:
    """One dictionary entry.

    Attributes
    ----------
    fault : its times on the axis of the window.
    live : it can be looked for in the window.
    note : what is wrong with it and what to do, None where nothing is.
    unit : of its magnitude; channel_unit : of its channel; "" where not known, or a pure number.
    minimal_detectable : magnitude declared with 90 % power if it is the only fault; None without a log, or unseen.
    minimal_physical : (value, unit) of that magnitude; minimal_peak : the most it moves the output in the window.
    visible : norm of its filtered signature off the regressors over that before; None without a log.
    most_coherent_with : the live atom most like it; coherence : with that one.
    """

    name: str
    fault: Fault
    live: bool
    note: str | None
    unit: str
    channel_unit: str
    minimal_detectable: float | None = None
    minimal_physical: tuple[float, str] | None = None
    minimal_peak: float | None = None
    visible: float | None = None
    most_coherent_with: str | None = None
    coherence: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signatures:
    """What the live atoms leave to be seen: on a log filtered by its predictor and off its regressors, else as defined.

    Attributes
    ----------
    names : (n_live,).
    time_s : (n_rows,); values : (n_rows, n_live), each on its own channel.
    coherence : (n_live, n_live), NaN where an atom leaves nothing.
    rank, condition_number : of those that leave something, each scaled to norm 1.
    """

    names: tuple[str, ...]
    time_s: FloatArray
    values: FloatArray
    coherence: FloatArray
    rank: int
    condition_number: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Audit:
    """The whole answer of `bfi dictionary`.

    Attributes
    ----------
    path : of the dictionary; relative_to : what its times count from.
    start_s, stop_s, rate_hz, n_samples : of the signals compared; why : how window and rate came about.
    log_path, native_rate_hz, model : None without a log; the model is the one without fault terms.
    signatures : None where there are too many to compare.
    notes : on the dictionary as a whole and on the log; those on single atoms are with them.
    """

    path: str
    relative_to: Literal["window", "log"]
    start_s: float
    stop_s: float
    rate_hz: float
    n_samples: int
    why: str
    log_path: str | None = None
    native_rate_hz: float | None = None
    model: ModelSummary | None = None
    atoms: tuple[AuditedAtom, ...] = ()
    signatures: Signatures | None = None
    notes: tuple[Note, ...] = ()

    @property
    def fastest_hz(self) -> float | None:
        """The highest frequency of the dictionary, None where nothing oscillates."""
        return fastest_hz(one.fault for one in self.atoms)

    @property
    def all_notes(self) -> tuple[Note, ...]:
        """The notes on single atoms, then the others."""
        return (*(Note.limit(atom.note) for atom in self.atoms if atom.note is not None), *self.notes)


def fastest_hz(faults: Iterable[Fault]) -> float | None:
    """Return the highest frequency among the faults, None where none oscillates."""
    return max((fault.frequency_hz for fault in faults if fault.frequency_hz is not None), default=None)
