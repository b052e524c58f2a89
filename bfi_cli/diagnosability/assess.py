"""How well the faults of a dictionary can be diagnosed in a log: the result, and how it is assembled from records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..config import Config, Diagnosability
from ..decision import finite
from ..dictionary import Dictionary
from ..errors import ConfigError
from ..faults import did_you_mean, meaning
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.divergence import window_bits
from ..notes import Note
from ..preprocessing.summary import LogSummary, ModelSummary
from .signatures import FaultSignatures, divergences, minimal_detectable, signatures, single_sample_bits

# In bits. A fault of which the window tells less is named in a note; nothing else depends on it.
HARDLY = 0.1
# Magnitudes over their standard deviation at which curves are drawn, from 0 bits to 1 bit, 15 to a decade.
DEVIATIONS = np.logspace(-1.0, 4.0, 76)
# Faults that the notes name one by one, so that the table stays in sight.
MOST_NAMED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedAtom:
    """One entry of the dictionary; numbers are None where it is left out, or the record does not tell them.

    Attributes
    ----------
    live : whether it can be looked for in the window; note : why not.
    magnitude : root mean square at which it is assessed, in `unit`; channel_unit : of its channel, "" where not known.
    physical_scale, physical_unit : what a magnitude of 1 means, where it multiplies a slope; else None.
    divergence_bits : information of the window on whether the fault is there, 0 to 1.
    sample_bits : divergence of single prediction errors from the onset on, as the paper compares them; None in a large
        dictionary too.
    minimal_detectable : magnitude declared with 90 % power if it is the only fault.
    most_like : the entry it is most easily taken for.
    apart_bits : information on whether it is this fault or that entry, whatever the size of that entry's fault.
    """

    name: str
    channel: str
    live: bool
    note: str | None
    magnitude: float | None
    unit: str
    divergence_bits: float | None
    sample_bits: float | None
    minimal_detectable: float | None
    most_like: str | None
    apart_bits: float | None
    channel_unit: str = ""
    physical_scale: float | None = None
    physical_unit: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ManoeuvreScore:
    """A manoeuvre flown on a model, the mean over draws of the noise.

    Attributes
    ----------
    bits : mean over the faults of `DiagnosedAtom.apart_bits`; None where the flight could not be used.
    standard_error : of it over the draws; None for one draw.
    weakest, weakest_bits : the fault with the fewest of these bits, and their number.
    divergence_bits, minimal_detectable : of each fault, in the order of the atoms.
    problem : why the flight could not be used.
    """

    name: str
    bits: float | None = None
    standard_error: float | None = None
    weakest: str | None = None
    weakest_bits: float | None = None
    divergence_bits: tuple[float | None, ...]
    minimal_detectable: tuple[float | None, ...]
    problem: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiagnosabilityResult:
    """The whole answer of `bfi diagnosability`.

    Attributes
    ----------
    dictionary : where it was read from.
    draws : number of records behind the numbers, 1 for a log.
    in_limits : whether the magnitudes were given as multiples of the minimal detectable ones.
    limit_deviations : the minimal detectable magnitude in its standard deviations.
    atoms : every entry.
    between : (n_atoms, n_atoms) bits, NaN for entries left out.
    deviations, bits : (n,) magnitude over its standard deviation, and the information at it.
    manoeuvres : best first, empty for a log; best : the name of the first, None for a log.
    """

    log: LogSummary
    model: ModelSummary
    dictionary: str
    draws: int
    in_limits: bool
    limit_deviations: float
    atoms: tuple[DiagnosedAtom, ...]
    between: FloatArray
    deviations: FloatArray
    bits: FloatArray
    manoeuvres: tuple[ManoeuvreScore, ...]
    best: str | None
    notes: tuple[Note, ...]


def magnitudes_of(names: Sequence[str], limits: FloatArray, stated: Diagnosability) -> FloatArray:
    """Return (n_atoms,) root mean squares of the magnitudes at which faults are assessed.

    They are not finite where they are multiples of a limit that is not.

    Parameters
    ----------
    names : of the entries; limits : (n_atoms,) their minimal detectable magnitudes.

    Raises
    ------
    ConfigError : one is stated for a name that is none of the dictionary's.
    """
    for name in stated.magnitudes:
        if name not in names:
            raise ConfigError(f"--magnitude: no entry of the dictionary, got '{name}'{did_you_mean(name, names)}")
    values = np.array([stated.magnitudes.get(name, stated.magnitude) for name in names])
    return values * limits if stated.at_limit else values


def assess(log: FlightLog, dictionary: Dictionary, config: Config) -> DiagnosabilityResult:
    """Say how well each fault of a dictionary could be seen in a log, and told from the others.

    The predictor is that of the log without fault terms: only what the predictor does not explain of a fault counts.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`; faults injected into it are taken out, others are in the way.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`; its section `diagnosability` has the magnitudes of the faults.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : a magnitude is given for a fault that the dictionary does not have.
    """
    records = [signatures(log, dictionary, config)]
    stated = config.diagnosability
    values = magnitudes_of(records[0].names, minimal_detectable(records), stated)
    return result_of(records, values, dictionary=dictionary.path, in_limits=stated.at_limit)


def result_of(
    records: Sequence[FaultSignatures],
    magnitudes: FloatArray,
    *,
    dictionary: str,
    in_limits: bool,
    manoeuvres: tuple[ManoeuvreScore, ...] = (),
    notes: Sequence[Note] = (),
) -> DiagnosabilityResult:
    """Return the result of records of one flight with different noise.

    Parameters
    ----------
    records : one or more, with the same entries.
    magnitudes : (n_atoms,) root mean squares.
    manoeuvres, notes : to go with it.
    """
    first, bits = records[0], divergences(records, magnitudes)
    limits, in_sample = minimal_detectable(records), single_sample_bits(records, magnitudes)
    meant = list(map(meaning, first.faults, first.channel_units))
    atoms = tuple(
        DiagnosedAtom(
            name=first.names[j],
            channel=first.faults[j].channel,
            live=j not in first.reasons,
            note=first.reasons.get(j),
            magnitude=finite(magnitudes[j]),
            unit=first.units[j],
            divergence_bits=finite(bits.whole[j]),
            sample_bits=finite(in_sample[j]),
            minimal_detectable=finite(limits[j]),
            most_like=first.names[other] if other >= 0 else None,
            apart_bits=finite(bits.apart[j]) if other >= 0 else None,
            channel_unit=first.channel_units[j],
            physical_scale=meant[j][0],
            physical_unit=meant[j][1],
        )
        for j, other in enumerate(bits.most_like)
    )
    hard = []
    for atom in atoms:
        scale, unit = (1.0, atom.unit) if atom.physical_scale is None else (atom.physical_scale, atom.physical_unit)
        size = f"'{atom.name}' of {abs(scale) * (atom.magnitude or 0.0):.3g} {unit}".rstrip()
        if atom.divergence_bits is not None and atom.divergence_bits < HARDLY:
            hard.append(f"{size} can hardly be seen ({atom.divergence_bits:.2g} bit)")
        elif atom.apart_bits is not None and atom.apart_bits < HARDLY:
            hard.append(f"{size} can be seen but hardly told from '{atom.most_like}' ({atom.apart_bits:.2g} bit)")
    if len(hard) > MOST_NAMED:
        hard[MOST_NAMED:] = [f"{len(hard) - MOST_NAMED} more faults are as hard; see the table"]
    curves = [window_bits(record.separation, DEVIATIONS) for record in records]
    return DiagnosabilityResult(
        log=first.log,
        model=first.model,
        dictionary=dictionary,
        draws=len(records),
        in_limits=in_limits,
        limit_deviations=float(np.mean([record.deviations for record in records])),
        atoms=atoms,
        between=frozen_array(bits.between),
        deviations=frozen_array(DEVIATIONS),
        bits=frozen_array(np.mean(curves, axis=0)),
        manoeuvres=manoeuvres,
        best=manoeuvres[0].name if manoeuvres else None,
        notes=(*notes, *map(Note.limit, hard), *(note for record in records for note in record.notes)),
    )
