"""Before the flight: which of several manoeuvres of a model tells most of the faults of a dictionary."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..aircraft import find_model, flight_of
from ..config import Config
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog
from ..kernels import FloatArray
from .assess import UNIT, DiagnosabilityResult, Magnitudes, ManoeuvreScore, finite, result_of
from .signatures import FaultSignatures, apart_bits, divergences, minimal_detectable, signatures

# Standard errors of the paired difference, about 95 % confidence; it only decides whether a note asks for more draws.
CLEAR = 2.0
FLOWN = ("amplitude_rad", "start_s", "step_s", "duration_s", "rate_hz", "turbulence_m_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFlights:
    """Flights of a model that differ in their manoeuvre; every manoeuvre meets the same draws of noise and gusts.

    Attributes
    ----------
    model, manoeuvres : by name, see `bfi_cli.aircraft`.
    noise_sd : by output, in its unit.
    draws : of the noise, for each manoeuvre.

    Raises
    ------
    ConfigError : no manoeuvre, one twice, or no draw.
    """

    model: str
    manoeuvres: tuple[str, ...] = ("3211", "doublet", "multisine")
    noise_sd: Mapping[str, float] = field(default_factory=dict)
    amplitude_rad: float = 0.035
    start_s: float = 0.2
    step_s: float = 1.0
    duration_s: float = 31.72
    rate_hz: float = 100.0
    turbulence_m_s: float = 0.0
    draws: int = 5
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.manoeuvres or len(set(self.manoeuvres)) < len(self.manoeuvres):
            given = ", ".join(self.manoeuvres) or "none"
            raise ConfigError(f"--manoeuvre: needs one or more, each once, got {given}; name each once")
        if self.draws < 1:
            raise ConfigError(f"--draws: must be 1 or more, got {self.draws}; each is a record with its own noise")

    def record(self, name: str, draw: int) -> FlightLog:
        """Return the record of a manoeuvre with a draw of the noise.

        Raises
        ------
        ConfigError : no such model, manoeuvre or output, or a number that is out of range.
        """
        given = {key: getattr(self, key) for key in FLOWN}
        rng = np.random.default_rng([self.seed, draw])
        return flight_of(find_model(self.model), name, rng=rng, noise_sd=self.noise_sd, **given)


def flights_of(config: Config) -> ModelFlights:
    """Return the flights a configuration states.

    Raises
    ------
    ConfigError : it names no model, or see `ModelFlights`.
    """
    stated = config.diagnosability
    if stated.model is None:
        raise ConfigError("diagnosability.model: names no model; give one, such as citation")
    given = stated.model_dump(exclude={"magnitude", "magnitudes", "at_limit", "noise"})
    return ModelFlights(**given, noise_sd=stated.noise, seed=config.seed)


def assess_manoeuvres(
    flights: ModelFlights,
    dictionary: Dictionary,
    config: Config,
    *,
    magnitudes: Magnitudes = UNIT,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> DiagnosabilityResult:
    """Return the assessment of the best manoeuvre, with the score of every one, best first.

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
    flown: dict[str, list[FaultSignatures]] = {}
    problems: dict[str, LogError] = {}
    for n, name in enumerate(flights.manoeuvres):
        try:
            for draw in range(flights.draws):
                record = signatures(flights.record(name, draw), dictionary, config, tolerant=False)
                flown.setdefault(name, []).append(record)
                report(n * flights.draws + draw + 1, len(flights.manoeuvres) * flights.draws)
        except LogError as problem:
            problems[name] = problem
            flown.pop(name, None)
    if not flown:
        raise next(iter(problems.values()))
    everything = [record for records in flown.values() for record in records]
    values = magnitudes.of_atoms(everything[0].names, minimal_detectable(everything))
    by_record = {name: _record_scores(records, values) for name, records in flown.items()}
    scores = []
    for name, records in flown.items():
        bits, mean = divergences(records, values), float(np.mean(by_record[name]))
        spread = float(np.std(by_record[name], ddof=1) / np.sqrt(len(records))) if len(records) > 1 else None
        live = np.flatnonzero(np.isfinite(bits.apart))
        weakest = min(live, key=lambda j: bits.apart[j], default=None)
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
    if len(scores) > 1 and flights.draws > 1:  # all manoeuvres have met the same draws
        ahead = by_record[scores[0].name] - by_record[scores[1].name]
        if not np.mean(ahead) > CLEAR * np.std(ahead, ddof=1) / np.sqrt(len(ahead)):
            names = f"'{scores[0].name}' is not clearly better than '{scores[1].name}'"
            notes.append(f"{names}: give more --draws to tell them apart")
    return result_of(
        flown[scores[0].name],
        values,
        dictionary=dictionary.path,
        in_limits=magnitudes.in_limits,
        manoeuvres=(*scores, *unusable),
        notes=notes,
    )


def _record_scores(records: Sequence[FaultSignatures], magnitudes: FloatArray) -> FloatArray:
    """Return the score of each record: the mean over the faults that can be looked for."""
    live = [j for j in range(len(magnitudes)) if j not in records[0].reasons and np.isfinite(magnitudes[j])]
    return np.array([np.sum(apart_bits(record, magnitudes)[live]) / max(len(live), 1) for record in records])
