"""Kinds of fault in an audit: entries whose onsets are searched, on a log with the limits of that search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..config import Config, merge
from ..decision import Candidate
from ..dictionary import Dictionary, dead_sentences
from ..errors import DictionaryError
from ..faults import Fault, magnitude_unit, physical
from ..flightlog import FlightLog
from ..onset import OnsetResult, search_onsets
from .result import Audit, AuditedAtom


def searched_on_log(clean: FlightLog, dictionary: Dictionary, config: Config) -> tuple[OnsetResult | None, list[str]]:
    """Return the search of a log without faults for the kinds of a dictionary, and why kinds are left out of it.

    The result is None where all are.
    """
    part = clean.window(config.window.from_s, config.window.to_s)
    start_s, stop_s = float(part.time_s[0]), float(part.time_s[-1])
    kinds = dictionary.searched.resolved(start_s)
    reasons = [dead_reason_of_kind(one, start_s, stop_s, config.outputs) for one in kinds]
    live = [one for one, reason in zip(kinds, reasons, strict=True) if not reason]
    searched = search_onsets(clean, merge(config, {"method": "ml"}), kinds=live) if live else None
    return searched, reasons


def without_signals(dictionary: Dictionary, config: Config, searched: OnsetResult | None = None) -> Audit:
    """Return the audit of a dictionary that states no onset, its entries left out: there is no signal to compare.

    Parameters
    ----------
    searched : the search of the log, None without a log.
    """
    start_s, stop_s = config.window.from_s or 0.0, config.window.to_s
    log = None if searched is None else searched.log
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        start_s=start_s if log is None else log.start_s,
        stop_s=log.stop_s if log is not None else start_s if stop_s is None else stop_s,
        rate_hz=np.nan if log is None else log.rate_hz,
        n_samples=0 if log is None else log.n_samples,
        why="no entry states its onset" if log is None else "that of the search over all onsets",
        log_path=None if log is None else log.path,
        native_rate_hz=None if log is None else log.native_rate_hz,
        model=None if searched is None else searched.model,
    )


def dead_reason_of_kind(fault: Fault, start_s: float, stop_s: float, outputs: Sequence[str]) -> str:
    """Say why a kind of fault, its onsets on the axis of the log, is not looked for in a window; "" where it is."""
    first_s, last_s = fault.onset_range_s or (start_s, stop_s)
    if fault.channel not in outputs:
        return dead_sentences([fault], start_s, stop_s, outputs=outputs)[0]
    if first_s >= stop_s or last_s <= start_s:
        window = f"outside of the window ({start_s:.6g} to {stop_s:.6g} s)"
        return f"'{fault.name}' begins between {first_s:.6g} and {last_s:.6g} s, {window}; move its onset_s"
    return ""


def with_kinds(
    audit: Audit,
    dictionary: Dictionary,
    units: Mapping[str, str],
    reasons: Sequence[str] = (),
    searched: OnsetResult | None = None,
) -> Audit:
    """Return the audit of the entries that state their onsets with the kinds of fault added, in the dictionary's order.

    Parameters
    ----------
    units : by channel.
    reasons : why kinds are left out, "" where they are not; nothing without a log.
    searched : the search of the log for the others.

    Raises
    ------
    DictionaryError : nothing is left to be looked for.
    """
    limits = {} if searched is None else {one.name: one for one in searched.candidates}
    left_out = iter(reasons or [""] * len(dictionary.atoms))
    stated, atoms = iter(audit.atoms), []
    for fault in dictionary.resolved(audit.start_s):
        if fault.onset_range_s is None:
            atoms.append(next(stated))
        else:
            atoms.append(_kind(fault, units.get(fault.channel, ""), next(left_out), limits.get(fault.name or "")))
    if not any(one.live for one in atoms):
        raise DictionaryError(f"{dictionary.path}: no live atom: {atoms[0].note}")
    return replace(audit, atoms=tuple(atoms), notes=(*audit.notes, *(() if searched is None else searched.notes)))


def _kind(fault: Fault, unit: str, reason: str, limit: Candidate | None) -> AuditedAtom:
    name, z = fault.name or fault.shape, None if limit is None else limit.minimal_detectable_scan
    said = reason or (None if limit is None or limit.note is None else f"limit of '{name}': {limit.note}")
    return AuditedAtom(
        name=name,
        fault=fault,
        live=not reason,
        note=said,
        unit=magnitude_unit(fault, unit),
        channel_unit=unit,
        minimal_detectable=z,
        minimal_physical=None if z is None else physical(fault, z, unit),
    )
