"""The assessment of a log, and the result of any number of records of one flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..dictionary import Dictionary
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels.distinguishability import window_bits
from .judged import in_samples, judge, limits_of
from .measured import Measured, measure
from .result import DiagnosabilityResult, DiagnosedAtom, ManoeuvreScore
from .sizes import UNIT, Sizes

__all__ = ["assess", "finite", "result_of"]

FloatArray = NDArray[np.float64]

HARDLY = 0.1
DEVIATIONS = np.logspace(-1.0, 4.0, 76)
MOST_NAMED = 5


def assess(log: FlightLog, dictionary: Dictionary, config: Config, *, sizes: Sizes = UNIT) -> DiagnosabilityResult:
    """Say how well each fault of a dictionary could be seen in a log, and told from the others.

    The predictor is that of the log without fault terms, so a fault counts by what its inputs and lags leave of it.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`; faults injected into it are taken out, others are in the way.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`.
    sizes : of the faults.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : a magnitude is given for a fault that the dictionary does not have.
    """
    records = [measure(log, dictionary, config)]
    magnitudes = sizes.magnitudes(records[0].names, limits_of(records))
    return result_of(records, magnitudes, dictionary=dictionary.path, in_limits=sizes.in_limits)


def result_of(
    records: Sequence[Measured],
    magnitudes: FloatArray,
    *,
    dictionary: str,
    in_limits: bool,
    manoeuvres: tuple[ManoeuvreScore, ...] = (),
    notes: Sequence[str] = (),
) -> DiagnosabilityResult:
    """Return the result of records of one flight with different noise.

    Parameters
    ----------
    records : one or more, with the same entries.
    magnitudes : (n_atoms,) root mean squares.
    manoeuvres, notes : to go with it.
    """
    first = records[0]
    found, limits = judge(records, magnitudes), limits_of(records)
    numbers = {
        "magnitude": magnitudes,
        "divergence_bits": found.divergence,
        "sample_bits": in_samples(records, magnitudes),
        "minimal_detectable": limits,
        "apart_bits": np.where(np.array(found.most_like) < 0, np.nan, found.apart),
    }
    atoms = tuple(
        _atom(first, j, found.most_like[j], {key: finite(values[j]) for key, values in numbers.items()})
        for j in range(len(first.names))
    )
    return DiagnosabilityResult(
        log=first.log,
        model=first.model,
        dictionary=dictionary,
        draws=len(records),
        in_limits=in_limits,
        limit_deviations=float(np.mean([record.deviations for record in records])),
        atoms=atoms,
        between=frozen_array(found.between),
        deviations=frozen_array(DEVIATIONS),
        bits=frozen_array(np.mean([window_bits(record.separation, DEVIATIONS) for record in records], axis=0)),
        manoeuvres=manoeuvres,
        best=manoeuvres[0].name if manoeuvres else None,
        notes=(*notes, *_hard(atoms), *dict.fromkeys(note for record in records for note in record.notes)),
    )


def finite(value: float) -> float | None:
    """Return None for a number that is not finite."""
    return float(value) if np.isfinite(value) else None


def _atom(record: Measured, j: int, other: int, numbers: Mapping[str, float | None]) -> DiagnosedAtom:
    return DiagnosedAtom(
        name=record.names[j],
        channel=record.faults[j].channel,
        live=j not in record.reasons,
        note=record.reasons.get(j),
        unit=record.units[j],
        most_like=record.names[other] if other >= 0 else None,
        **numbers,
    )


def _hard(atoms: Sequence[DiagnosedAtom]) -> list[str]:
    """Name what can hardly be seen, and what can be seen but hardly told from another."""
    said = []
    for atom in atoms:
        size = f"'{atom.name}' of {atom.magnitude or 0.0:.3g} {atom.unit}".rstrip()
        if atom.divergence_bits is not None and atom.divergence_bits < HARDLY:
            said.append(f"{size} can hardly be seen ({atom.divergence_bits:.2g} bit)")
        elif atom.apart_bits is not None and atom.apart_bits < HARDLY:
            said.append(f"{size} can be seen but hardly told from '{atom.most_like}' ({atom.apart_bits:.2g} bit)")
    more = len(said) - MOST_NAMED
    return [*said[:MOST_NAMED], *([f"{more} more faults are as hard; see the table"] if more > 0 else [])]
