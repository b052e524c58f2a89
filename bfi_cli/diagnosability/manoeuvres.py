"""Before the flight: which of several manoeuvres of a model tells most of the faults of a dictionary."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..aircraft import find_model, flight_of
from ..config import Config
from ..decision import finite
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog
from ..notes import Note
from .assess import DiagnosabilityResult, ManoeuvreScore, magnitudes_of, result_of
from .signatures import FaultSignatures, apart_bits, divergences, minimal_detectable, signatures

# Standard errors of the paired difference, about 95 % confidence; it only decides whether a note asks for more draws.
CLEAR = 2.0


def flown(config: Config, name: str, draw: int) -> FlightLog:
    """Return the record of a manoeuvre of the configuration's model, with a draw of noise and gusts.

    Every manoeuvre meets the same draws.

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
    return result_of(
        usable[scores[0].name],
        values,
        dictionary=dictionary.path,
        in_limits=stated.at_limit,
        manoeuvres=(*scores, *unusable),
        notes=notes,
    )
