"""How well the faults of a dictionary can be diagnosed: in a log, or before the flight, by manoeuvres of a model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..aircraft import find_model, flight_of
from ..config import Config, Diagnosability
from ..decision import finite
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..faults import did_you_mean, meaning
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.divergence import window_bits
from ..model.result import LogSummary, ModelSummary
from ..notes import Note
from .signatures import FaultSignatures, apart_bits, divergences, minimal_detectable, signatures, single_sample_bits

# Standard errors of the paired difference, about 95 % confidence, below which a note asks for more draws.
CLEAR = 2.0
# Information in bits below which a note names a fault.
HARDLY = 0.1
# Magnitudes over their standard deviation at which curves are drawn, from 0 bits to 1 bit, 15 to a decade.
DEVIATIONS = np.logspace(-1.0, 4.0, 76)
# Faults that are named in notes.
MOST_NAMED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedAtom:
    """One entry of the dictionary; numbers are None where it is left out, or the record does not tell them.

    Attributes
    ----------
    live : whether it can be looked for in the window; note : the reason if not.
    magnitude : root mean square at which it is assessed, in `unit`; channel_unit : of its channel, "" where not known.
    physical_scale, physical_unit : what a magnitude of 1 means, where it multiplies a slope; else None.
    divergence_bits : information of the window on whether the fault is there, 0 to 1.
    sample_bits : divergence of single prediction errors from the onset on, as the paper compares them; None in a large
        dictionary too.
    minimal_detectable : magnitude declared with 90 % power if it is the only fault.
    most_like : the entry that it is most easily confused with.
    apart_bits : information on whether the fault is this entry or `most_like`, whatever the magnitude of the latter.
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
    """A manoeuvre flown on a model, mean values over draws of the noise.

    Attributes
    ----------
    bits : mean over the faults of `DiagnosedAtom.apart_bits`; None where the flight could not be used.
    standard_error : of `bits` over the draws; None for a single draw.
    weakest, weakest_bits : the fault with the least `apart_bits`, and their number.
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
    """The answer of `bfi diagnosability`.

    Attributes
    ----------
    dictionary : where it was read from.
    draws : number of records behind the numbers, 1 for a log.
    in_limits : whether the magnitudes were given as multiples of the minimal detectable ones.
    limit_deviations : the minimal detectable magnitude over its standard deviation.
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

    A multiple of an infinite limit is infinite.

    Parameters
    ----------
    names : of the entries; limits : (n_atoms,) their minimal detectable magnitudes.

    Raises
    ------
    ConfigError : a magnitude is stated for a name that the dictionary lacks.
    """
    for name in stated.magnitudes:
        if name not in names:
            raise ConfigError(f"--magnitude: no entry of the dictionary, got '{name}'{did_you_mean(name, names)}")
    values = np.array([stated.magnitudes.get(name, stated.magnitude) for name in names])
    return values * limits if stated.at_limit else values


def assess(log: FlightLog, dictionary: Dictionary, config: Config) -> DiagnosabilityResult:
    """Return how well each fault of a dictionary could be seen in a log, and told from the others.

    The predictor is that of the log without fault terms: only the part of a fault that it does not explain counts.

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
    return diagnosability_of(records, values, dictionary=dictionary.path, in_limits=stated.at_limit)


def diagnosability_of(
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
    manoeuvres, notes : added to the result.
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


def flown(config: Config, name: str, draw: int) -> FlightLog:
    """Return the record of a manoeuvre of the configuration's model, with a draw of noise and gusts.

    The draws are the same for every manoeuvre.

    Raises
    ------
    ConfigError : no model, or no such model, manoeuvre or output, or a number that is out of range.
    """
    stated = config.diagnosability
    if stated.model is None:
        raise ConfigError("diagnosability.model: names no model; give one, such as citation")
    given = stated.model_dump(include={"amplitude_rad", "start_s", "step_s", "duration_s", "turbulence_m_s"})
    rng = np.random.default_rng([config.seed, draw])
    return flight_of(find_model(stated.model), name, rng=rng, noise_sd=stated.noise, **given)


def assess_manoeuvres(
    dictionary: Dictionary, config: Config, *, report: Callable[[int, int], None] = lambda _done, _total: None
) -> DiagnosabilityResult:
    """Return the assessment of the best of the manoeuvres of a configuration, with the score of every one, best first.

    Magnitudes given as multiples of the minimal detectable ones are multiples of their geometric mean over the
    manoeuvres, so that every manoeuvre meets the same faults.

    Parameters
    ----------
    report : called with the number of records done, and that of all.

    Raises
    ------
    LogError, ExcitationError : no manoeuvre gives a record that can be used.
    DictionaryError, ConfigError : see `assess`.
    """
    stated, draws = config.diagnosability, config.diagnosability.draws
    usable: dict[str, list[FaultSignatures]] = {}
    problems: dict[str, LogError] = {}
    for n, name in enumerate(stated.manoeuvres):
        try:
            for draw in range(draws):
                record = signatures(flown(config, name, draw), dictionary, config, tolerant=False)
                usable.setdefault(name, []).append(record)
                report(n * draws + draw + 1, len(stated.manoeuvres) * draws)
        except LogError as problem:
            problems[name] = problem
            usable.pop(name, None)
    if not usable:
        raise next(iter(problems.values()))
    everything = [record for records in usable.values() for record in records]
    values = magnitudes_of(everything[0].names, minimal_detectable(everything), stated)
    live = [j for j, value in enumerate(values) if j not in everything[0].reasons and np.isfinite(value)]
    # The score of a record: the mean over the faults that can be looked for.
    by_record = {
        name: np.array([np.sum(apart_bits(record, values)[live]) / max(len(live), 1) for record in records])
        for name, records in usable.items()
    }
    scores = []
    for name, records in usable.items():
        bits, mean = divergences(records, values), float(np.mean(by_record[name]))
        spread = float(np.std(by_record[name], ddof=1) / np.sqrt(len(records))) if len(records) > 1 else None
        weakest = min(np.flatnonzero(np.isfinite(bits.apart)), key=lambda j: bits.apart[j], default=None)
        scores.append(
            ManoeuvreScore(
                name=name,
                bits=mean,
                standard_error=spread,
                weakest=None if weakest is None else records[0].names[weakest],
                weakest_bits=None if weakest is None else float(bits.apart[weakest]),
                divergence_bits=tuple(map(finite, bits.whole)),
                minimal_detectable=tuple(map(finite, minimal_detectable(records))),
            )
        )
    scores.sort(key=lambda score: -(score.bits or 0.0))
    nothing = (None,) * len(values)
    unusable = (
        ManoeuvreScore(name=name, divergence_bits=nothing, minimal_detectable=nothing, problem=str(problem))
        for name, problem in problems.items()
    )
    notes = []
    if len(scores) > 1 and draws > 1:  # all manoeuvres have met the same draws
        ahead = by_record[scores[0].name] - by_record[scores[1].name]
        if not np.mean(ahead) > CLEAR * np.std(ahead, ddof=1) / np.sqrt(len(ahead)):
            names = f"'{scores[0].name}' is not clearly better than '{scores[1].name}'"
            notes.append(Note.advice(f"{names}: give more --draws to tell them apart"))
    return diagnosability_of(
        usable[scores[0].name],
        values,
        dictionary=dictionary.path,
        in_limits=stated.at_limit,
        manoeuvres=(*scores, *unusable),
        notes=notes,
    )
