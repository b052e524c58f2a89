"""Before the flight: which manoeuvre of a set lets a model show most of the faults."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..aircraft import Dryden, find_model, manoeuvre, simulate, time_axis
from ..config import Config
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog
from .assessing import finite, result_of
from .judged import apart, judge, limits_of
from .measured import Measured, measure
from .result import DiagnosabilityResult, ManoeuvreScore
from .sizes import UNIT, Sizes

__all__ = ["Flights", "assess_manoeuvres", "flights_of"]

FloatArray = NDArray[np.float64]

CLEAR = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Flights:
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
        time_s = time_axis(duration_s=self.duration_s, rate_hz=self.rate_hz)
        settings = {"amplitude_rad": self.amplitude_rad, "start_s": self.start_s, "step_s": self.step_s}
        return simulate(
            find_model(self.model),
            manoeuvre(name, time_s, **settings),
            rng=np.random.default_rng([self.seed, draw]),
            rate_hz=self.rate_hz,
            turbulence=Dryden(sigma_m_s=self.turbulence_m_s) if self.turbulence_m_s else None,
            noise_sd=self.noise_sd,
        )


def _silent(_done: int, _total: int) -> None:
    pass


def flights_of(config: Config) -> Flights:
    """Return the flights a configuration states.

    Raises
    ------
    ConfigError : it names no model, or see `Flights`.
    """
    stated = config.diagnosability
    if stated.model is None:
        raise ConfigError("diagnosability.model: names no model; give one, such as citation")
    return Flights(
        model=stated.model,
        manoeuvres=stated.manoeuvres,
        noise_sd=stated.noise,
        amplitude_rad=stated.amplitude_rad,
        start_s=stated.start_s,
        step_s=stated.step_s,
        duration_s=stated.duration_s,
        turbulence_m_s=stated.turbulence_m_s,
        draws=stated.draws,
        seed=config.seed,
    )


def assess_manoeuvres(
    flights: Flights,
    dictionary: Dictionary,
    config: Config,
    *,
    sizes: Sizes = UNIT,
    report: Callable[[int, int], None] = _silent,
) -> DiagnosabilityResult:
    """Return the assessment of the best manoeuvre, with the score of every one, best first.

    Magnitudes that count in minimal detectable ones count in the geometric mean of them over the manoeuvres: every
    manoeuvre meets the same faults.

    Parameters
    ----------
    report : told how many records are done, (done, total).

    Raises
    ------
    LogError, ExcitationError : no manoeuvre gives a record that can be used.
    DictionaryError, ConfigError : see `assess`.
    """
    flown, problems = _flown(flights, dictionary, config, report)
    if not flown:
        raise next(iter(problems.values()))
    everything = [record for records in flown.values() for record in records]
    magnitudes = sizes.magnitudes(everything[0].names, limits_of(everything))
    scores = [_score(name, records, magnitudes) for name, records in flown.items()]
    scores.sort(key=lambda one: -(one.bits or 0.0))
    unusable = [_unusable(name, problem, len(magnitudes)) for name, problem in problems.items()]
    return result_of(
        flown[scores[0].name],
        magnitudes,
        dictionary=dictionary.path,
        in_limits=sizes.in_limits,
        manoeuvres=(*scores, *unusable),
        notes=_compared(scores, flown, magnitudes),
    )


def _flown(
    flights: Flights, dictionary: Dictionary, config: Config, report: Callable[[int, int], None]
) -> tuple[dict[str, list[Measured]], dict[str, LogError]]:
    flown: dict[str, list[Measured]] = {}
    problems: dict[str, LogError] = {}
    total = len(flights.manoeuvres) * flights.draws
    for n, name in enumerate(flights.manoeuvres):
        try:
            for draw in range(flights.draws):
                record = measure(flights.record(name, draw), dictionary, config)
                flown.setdefault(name, []).append(record)
                report(n * flights.draws + draw + 1, total)
        except LogError as problem:
            problems[name] = problem
            flown.pop(name, None)
    return flown, problems


def _score(name: str, records: Sequence[Measured], magnitudes: FloatArray) -> ManoeuvreScore:
    found, limits = judge(records, magnitudes), limits_of(records)
    kept = [j for j in range(len(magnitudes)) if np.isfinite(found.apart[j])]
    weakest = min(kept, key=lambda j: found.apart[j], default=None)
    each = _each(records, magnitudes)
    several = len(records) > 1
    return ManoeuvreScore(
        name=name,
        bits=float(np.mean(each)),
        standard_error=float(np.std(each, ddof=1) / np.sqrt(len(each))) if several else None,
        weakest=None if weakest is None else records[0].names[weakest],
        weakest_bits=None if weakest is None else float(found.apart[weakest]),
        divergence_bits=tuple(finite(bits) for bits in found.divergence),
        minimal_detectable=tuple(finite(limit) for limit in limits),
        problem=None,
    )


def _each(records: Sequence[Measured], magnitudes: FloatArray) -> FloatArray:
    """The score of each record: the mean over the faults that can be looked for."""
    kept = [j for j in range(len(magnitudes)) if j not in records[0].reasons and np.isfinite(magnitudes[j])]
    return np.array([np.sum(apart(record, magnitudes)[kept]) / max(len(kept), 1) for record in records])


def _unusable(name: str, problem: LogError, n_atoms: int) -> ManoeuvreScore:
    nothing = (None,) * n_atoms
    return ManoeuvreScore(
        name=name,
        bits=None,
        standard_error=None,
        weakest=None,
        weakest_bits=None,
        divergence_bits=nothing,
        minimal_detectable=nothing,
        problem=str(problem),
    )


def _compared(
    scores: Sequence[ManoeuvreScore], flown: Mapping[str, Sequence[Measured]], magnitudes: FloatArray
) -> list[str]:
    """Say where the best manoeuvre is not clearly better than the next; both have met the same draws."""
    if len(scores) < 2 or len(flown[scores[0].name]) < 2:
        return []
    best, second = (_each(flown[score.name], magnitudes) for score in scores[:2])
    ahead = best - second
    if np.mean(ahead) > CLEAR * np.std(ahead, ddof=1) / np.sqrt(len(ahead)):
        return []
    return [f"'{scores[0].name}' is not clearly better than '{scores[1].name}': give more --draws to tell them apart"]
