"""The audited entries of a dictionary: those that state an onset, and the kinds of fault that do not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..config import Config, merge
from ..decision import Candidate
from ..dictionary import Dictionary, dead_reason_of_kind
from ..errors import DictionaryError
from ..faults import Fault, did_you_mean, magnitude_unit, physical
from ..flightlog import FlightLog
from ..kernels import FloatArray
from ..model.onset import OnsetSearch, search_onsets
from ..model.preprocessing.signals import SAMPLES_PER_CYCLE
from ..model.result import LogSummary, ModelSummary
from ..notes import Note
from ..quantities.channels import STANDARD
from .comparison import Signatures, absorbed, most_like

# A window shows three cycles of an oscillation and five time constants of a lagged bias (0.7 % short of its end), with
# 10 s of margin, the order of a longitudinal manoeuvre; less than half a cycle is monotonic or nearly so.
MARGIN_S, CYCLES, TIME_CONSTANTS, FEWEST_CYCLES = 10.0, 3.0, 5.0, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditedAtom:
    """One dictionary entry.

    Attributes
    ----------
    fault : with times on the axis of the window.
    live : it can be looked for in the window.
    note : the problem with it and the remedy, None without a problem.
    unit : of its magnitude; channel_unit : of its channel; "" where not known, or a pure number.
    minimal_detectable : magnitude declared with 90 % power if it is the only fault; None without a log, or unseen.
    minimal_physical : (value, unit) of that magnitude; minimal_peak : the most it moves the output in the window.
    visible : norm of its filtered signature off the regressors over that before; None without a log.
    most_coherent_with : the live atom with the largest coherence; coherence : of the two.
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
class Audit:
    """The answer of `bfi dictionary`.

    Attributes
    ----------
    path : of the dictionary; relative_to : what its times count from.
    window : of the signals compared, its path "" without a log; why : the reason for window and rate.
    model : that without fault terms, None without a log.
    signatures : None where there are too many to compare.
    notes : on the dictionary as a whole and on the log; each atom has its own note besides.
    """

    path: str
    relative_to: Literal["window", "log"]
    window: LogSummary
    why: str
    model: ModelSummary | None = None
    atoms: tuple[AuditedAtom, ...] = ()
    signatures: Signatures | None = None
    notes: tuple[Note, ...] = ()

    @property
    def fastest_hz(self) -> float | None:
        """The highest frequency of the dictionary, None where nothing oscillates."""
        return fastest_hz(atom.fault for atom in self.atoms)

    @property
    def all_notes(self) -> tuple[Note, ...]:
        """The notes on single atoms, then the others."""
        return (*(Note.limit(atom.note) for atom in self.atoms if atom.note is not None), *self.notes)


def fastest_hz(faults: Iterable[Fault]) -> float | None:
    """Return the highest frequency among the faults, None where none oscillates."""
    return max((fault.frequency_hz for fault in faults if fault.frequency_hz is not None), default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditWindow:
    """A window, s; `rate_hz` of its samples and `lags` of the model, None where neither is chosen."""

    start_s: float
    stop_s: float
    rate_hz: float | None = None
    lags: int | None = None


def same_definition(faults: Sequence[Fault]) -> dict[int, int]:
    """Return by index of a fault the earlier fault with the same definition, name and magnitude aside, if any."""
    first: dict[Fault, int] = {}
    places = [first.setdefault(replace(fault, name=None, magnitude=1.0), j) for j, fault in enumerate(faults)]
    return {j: i for j, i in enumerate(places) if i != j}


def span_of(faults: Sequence[Fault], from_s: float | None, *, from_zero: bool) -> AuditWindow:
    """Return a window that shows every fault: each until it ends or has unfolded, 10 s more.

    An oscillation has unfolded after three cycles, a lagged bias after five time constants, a ramp after its duration.

    Parameters
    ----------
    faults : not empty.
    from_s : where it starts, s; None to choose.
    from_zero : choose 0 s; else 10 s before the earliest onset, where that is later.
    """
    if from_s is None:
        from_s = 0.0 if from_zero else max(0.0, min(fault.onset_s for fault in faults) - MARGIN_S)
    stops = [from_s]
    for fault in faults:
        cycles = CYCLES / fault.frequency_hz if fault.frequency_hz else 0.0
        unfolded = fault.onset_s + max(cycles, TIME_CONSTANTS * (fault.time_constant_s or 0.0), fault.duration_s or 0.0)
        stops.append(unfolded if fault.offset_s is None else fault.offset_s)
    return AuditWindow(start_s=from_s, stop_s=max(stops) + MARGIN_S)


def oddities(fault: Fault, span: AuditWindow) -> Iterator[str]:
    """Yield why a fault does not show its shape in a window: too short, too slow, too fast, or too early."""
    name = f"'{fault.called}'"
    stop_s = span.stop_s if fault.offset_s is None else min(fault.offset_s, span.stop_s)
    shown_s = stop_s - max(fault.onset_s, span.start_s)
    if fault.frequency_hz is not None and fault.frequency_hz * shown_s < FEWEST_CYCLES:
        cycles = f"{fault.frequency_hz * shown_s:.2g} of a cycle"
        yield f"{name} shows only {cycles} in the window and looks like a drift; widen the window"
    if fault.time_constant_s is not None and fault.time_constant_s > shown_s:
        settling = f"settles in {fault.time_constant_s:g} s but shows for {shown_s:.3g} s"
        yield f"{name} {settling} and looks like a drift; widen the window"
    if fault.duration_s is not None and fault.onset_s + fault.duration_s >= stop_s:
        yield f"{name} never holds in the window and looks like a drift; widen the window or shorten duration_s"
    if span.rate_hz is None:
        return
    if fault.frequency_hz is not None and SAMPLES_PER_CYCLE * fault.frequency_hz > span.rate_hz * (1.0 + 1e-6):
        per_cycle = f"{span.rate_hz / fault.frequency_hz:.2g} samples per cycle at {span.rate_hz:.4g} Hz"
        yield f"{name} has only {per_cycle}; give --rate {SAMPLES_PER_CYCLE * fault.frequency_hz:.4g} or more"
    for word, seconds in (("settles", fault.time_constant_s), ("ends its ramp", fault.duration_s)):
        if seconds is not None and seconds * span.rate_hz < 1.0:
            yield f"{name} {word} within a sample at {span.rate_hz:.4g} Hz and looks like a bias; give a higher --rate"


def unknown_channels(faults: Sequence[Fault]) -> list[str]:
    """Return a sentence on each channel that is no standard channel, for an audit without a log."""
    sentences = []
    for name in dict.fromkeys(fault.channel for fault in faults if fault.channel not in STANDARD):
        hint = did_you_mean(name, list(STANDARD))
        hint = hint if "did you mean" in hint else "; the log must have it under that name"
        sentences.append(f"'{name}' is no standard channel name{hint}")
    return sentences


def reasons_of(faults: Sequence[Fault], names: Sequence[str], reasons: Mapping[int, str]) -> dict[int, str]:
    """Return the reasons, with a more exact one for an entry with the definition of an entry that is live."""
    twins = {j: i for j, i in same_definition(faults).items() if j in reasons and i not in reasons}
    worded = {j: f"'{names[j]}' is defined as '{names[i]}' is; drop one of them" for j, i in twins.items()}
    return {**reasons, **worded}


def remarks_of(
    faults: Mapping[int, Fault], span: AuditWindow, values: FloatArray | None, *, largest_model: int, n_outputs: int
) -> dict[int, list[str]]:
    """Return the remarks on each live fault, by index; a fault without remarks has no entry.

    Parameters
    ----------
    faults : the live ones, by index.
    span : the window.
    values : (n_samples, n_live) on their own channels; None where there are too many to look at.
    largest_model, n_outputs : see `absorbed`.
    """
    remarks: dict[int, list[str]] = {}
    for n, (j, fault) in enumerate(faults.items()):
        sentences, name = list(oddities(fault, span)), fault.called
        lost = f"the first {span.lags} samples, which the model's lags use up"
        # It starts after the window does, but before the first row of the model.
        early = bool(span.rate_hz and span.lags and 0.0 < (fault.onset_s - span.start_s) * span.rate_hz < span.lags)
        taken = None
        if values is not None:
            when = f"after {lost}" if early else "over the whole window"
            taken = absorbed(name, values[:, n], largest_model=largest_model, n_outputs=n_outputs, when=when)
        if taken is not None:
            sentences.append(taken)
        elif early:
            sentences.append(f"'{name}' starts within {lost}; start the window earlier")
        if sentences:
            remarks[j] = sentences
    return remarks


def entries(
    faults: Sequence[Fault],
    units: Sequence[str],
    reasons: Mapping[int, str],
    remarks: Mapping[int, Sequence[str]],
    signatures: Signatures | None,
    limits: Sequence[tuple[float, float, float]] | None = None,
) -> tuple[AuditedAtom, ...]:
    """Return one entry per fault of the dictionary, in its order.

    Parameters
    ----------
    faults, units : (n_atoms,) with the unit of each fault's channel.
    reasons : by index why an entry is left out; remarks : by index the remarks on a live entry.
    signatures : of the live entries.
    limits : on a log, of each live entry: the minimal detectable magnitude, NaN where nothing is seen, the most a
        magnitude of 1 moves its output, and `AuditedAtom.visible`.
    """
    place = {j: n for n, j in enumerate(j for j in range(len(faults)) if j not in reasons)}
    atoms = []
    for j, (fault, unit) in enumerate(zip(faults, units, strict=True)):
        n = place.get(j)
        sentences = [reasons[j]] if n is None else remarks.get(j, ())
        other, coherence = (None, None) if signatures is None or n is None else most_like(signatures, n)
        least, most, visible = (np.nan, np.nan, None) if limits is None or n is None else limits[n]
        z = float(least) if np.isfinite(least) else None
        audited = _audited(fault, unit, "; ".join(sentences) or None, z, live=n is not None)
        peak = None if z is None else z * float(most)
        atoms.append(
            replace(audited, minimal_peak=peak, visible=visible, most_coherent_with=other, coherence=coherence)
        )
    return tuple(atoms)


def _audited(fault: Fault, unit: str, note: str | None, least: float | None, *, live: bool) -> AuditedAtom:
    """Return an entry on a channel of some unit, with its minimal detectable magnitude."""
    return AuditedAtom(
        name=fault.called,
        fault=fault,
        live=live,
        note=note,
        unit=magnitude_unit(fault, unit),
        channel_unit=unit,
        minimal_detectable=least,
        minimal_physical=None if least is None else physical(fault, least, unit),
    )


def searched_on_log(
    clean: FlightLog, dictionary: Dictionary, config: Config
) -> tuple[OnsetSearch | None, list[str | None]]:
    """Return the search of a log without faults for the kinds of a dictionary, and why each kind is left out of it.

    The search is None where all kinds are left out.
    """
    start_s, stop_s = clean.window(config.window.from_s, config.window.to_s).ends()
    kinds = dictionary.searched.resolved(start_s)
    reasons = [dead_reason_of_kind(fault, start_s, stop_s, config.outputs) for fault in kinds]
    live = [kind for kind, reason in zip(kinds, reasons, strict=True) if reason is None]
    searched = search_onsets(clean, merge(config, {"method": "ml"}), kinds=live) if live else None
    return searched, reasons


def without_signals(dictionary: Dictionary, config: Config, searched: OnsetSearch | None = None) -> Audit:
    """Return the audit of a dictionary that states no onset, its entries left out: there is no signal to compare.

    Parameters
    ----------
    searched : the search of the log, None without a log.
    """
    start_s, stop_s = config.window.from_s or 0.0, config.window.to_s
    stop_s = start_s if stop_s is None else stop_s
    none = LogSummary(path="", rate_hz=np.nan, native_rate_hz=np.nan, n_samples=0, start_s=start_s, stop_s=stop_s)
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        window=none if searched is None else searched.record.window.summary,
        why="no entry states its onset" if searched is None else "that of the search over all onsets",
        model=None if searched is None else searched.model,
    )


def with_kinds(
    audit: Audit,
    dictionary: Dictionary,
    units: Mapping[str, str],
    reasons: Sequence[str | None] = (),
    searched: OnsetSearch | None = None,
) -> Audit:
    """Return the audit of the entries that state their onsets with the kinds of fault added, in the dictionary's order.

    Parameters
    ----------
    units : by channel.
    reasons : why kinds are left out, None where they are not; nothing without a log.
    searched : the search of the log for the others.

    Raises
    ------
    DictionaryError : nothing is left to be looked for.
    """
    limits = {} if searched is None else {candidate.name: candidate for candidate in searched.evidence.candidates}
    left_out = iter(reasons or [None] * len(dictionary.atoms))
    stated, atoms = iter(audit.atoms), []
    for fault in dictionary.resolved(audit.window.start_s):
        if fault.onset_range_s is None:
            atoms.append(next(stated))
        else:
            atoms.append(_kind(fault, units.get(fault.channel, ""), next(left_out), limits.get(fault.name or "")))
    if not any(atom.live for atom in atoms):
        raise DictionaryError(f"{dictionary.path}: no live atom: {atoms[0].note}")
    return replace(
        audit, atoms=tuple(atoms), notes=(*audit.notes, *(() if searched is None else searched.evidence.notes))
    )


def _kind(fault: Fault, unit: str, reason: str | None, limit: Candidate | None) -> AuditedAtom:
    note = reason
    if limit is not None and limit.note is not None:
        note = reason or f"limit of '{fault.called}': {limit.note}"
    return _audited(fault, unit, note, None if limit is None else limit.minimal_detectable_scan, live=not reason)
