"""The problem that every method of a comparison is given, and the methods of this program that other commands run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...analysis import identify, start_time
from ...config import Config, merge
from ...decision import KINDS
from ...detection import detect_faults
from ...dictionary import Dictionary
from ...errors import ConfigError
from ...faults import Decision, Fault, FaultEstimate
from ...flightlog import FlightLog
from ...model.identify import identify_faults
from ...model.preprocessing.defaults import default_inputs
from ...model.result import IdentifyResult
from ..dmae import dmae_of
from .result import SPREAD_S, Statement, Suspect


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """What every method is given.

    Attributes
    ----------
    log : the whole log, part : its window, both without the truth.
    dictionary : of the faults to look for, None for any fault.
    config : with channels of the log in place of defaults that it lacks; asked : as the user stated it.
    """

    log: FlightLog
    part: FlightLog
    dictionary: Dictionary | None
    config: Config
    asked: Config


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A method; `needs` are the channels that it cannot work without, each with its alternatives."""

    summary: str
    state: Callable[[Problem], Statement]
    needs: tuple[tuple[str, ...], ...] = ()


def by_likelihood(problem: Problem) -> Statement:
    """State what `bfi identify` does."""
    config = merge(problem.config, {"method": "ml"})
    result, _ = identify(problem.log, problem.dictionary, config)
    return _identified(result)


def by_search(problem: Problem) -> Statement:
    """State what `bfi start-time` does, which is given no dictionary.

    The score is the largest fall of the BIC by a shape, not the statistic: in noise a search over many frequencies has
    a larger statistic than a search over steps.
    """
    result = start_time(problem.log, merge(problem.config, {"method": "ml"}))
    falls = [
        float(profile.statistic.max())
        - (2 if profile.frequency_hz is None else 3) * float(np.log(profile.statistic.size))
        for profile in result.profiles
    ]
    return Statement(
        decision=result.decision, suspects=tuple(map(_suspect, result.faults)), score=max(falls, default=None)
    )


def by_entries(problem: Problem, *, method: str) -> Statement:
    """State which entries of the dictionary a method declares, without the search over all onsets."""
    if problem.dictionary is None or not problem.dictionary.exact.atoms:
        raise ConfigError("needs a dictionary whose entries state their onsets; give one with --dictionary")
    config = merge(problem.config, {"method": method})
    if "inputs" not in problem.asked.model_fields_set:
        config = merge(config, {"inputs": default_inputs(problem.log, merge(problem.asked, {"method": method}))})
    return _identified(identify_faults(problem.log, problem.dictionary.exact, config))


def by_two_filters(problem: Problem) -> Statement:
    """State a fault from the time at which DMAE finds it more probable than none; the filters know no shape.

    The score is the largest logarithm of the odds, which the floor of the probabilities bounds.
    """
    if problem.config.dmae.model is None:
        raise ConfigError("needs a linear model of the aircraft; name one with --model")
    _, run = dmae_of(problem.part, problem.config)
    probable = float(run.probability.max())
    score = float(np.log(probable) - np.log1p(-probable))
    if run.onset_s is None:
        return Statement(decision="no_fault", score=score)
    suspect = Suspect(channel=run.channel, onset_s=run.onset_s, declared_s=run.onset_s)
    return Statement(decision="fault", suspects=(suspect,), score=score)


def plain_model(problem: Problem) -> tuple[IdentifyResult, bool]:
    """Return the ARX model without faults, and whether it was given the entries of the dictionary."""
    config, part = merge(problem.config, {"method": "arx-residual"}), problem.part
    if problem.dictionary is not None and problem.dictionary.exact.atoms:
        return identify_faults(problem.log, problem.dictionary.exact, config), True
    # The window is prepared for an entry, which no method states.
    middle_s = 0.5 * float(part.time_s[0] + part.time_s[-1])
    entry = Fault(shape="bias", channel=config.outputs[0], onset_s=middle_s, name="unused")
    dictionary = Dictionary(atoms=(entry,), relative_to="log", sha256="", path="no dictionary")
    return identify_faults(problem.log, dictionary, config), False


def by_residual(problem: Problem) -> Statement:
    """State the first residual of each output beyond five robust standard deviations, or the dictionary's entry for it.

    The score is the largest residual over its standard deviation.
    """
    result, named = plain_model(problem)
    alarms = {residual.channel: residual.plain_alarms_s for residual in result.residuals if residual.plain_alarms_s}
    stated = {estimate.fault.channel: _suspect(estimate) for estimate in reversed(result.faults) if named}
    suspects = []
    for channel, times in alarms.items():
        entry = stated.get(channel)
        if entry is None or (entry.onset_s is not None and times[0] < entry.onset_s - SPREAD_S):
            suspects.append(Suspect(channel=channel, onset_s=times[0], declared_s=times[0]))
        if entry is not None:
            nearest = int(np.argmin(np.abs(np.array(times) - (entry.onset_s or 0.0))))
            suspects.append(replace(entry, declared_s=times[nearest]))
    sizes = [
        np.nanmax(np.abs(output.plain_residual)) / residual.plain_sd
        for output, residual in zip(result.outputs, result.residuals, strict=True)
        if residual.plain_sd > 0.0
    ]
    decision: Decision = "fault" if suspects else "no_fault"
    return Statement(decision=decision, suspects=tuple(suspects), score=max(map(float, sizes), default=None))


def by_null_space(problem: Problem) -> Statement:
    """State what `bfi detect` does, with its default inputs and outputs unless the user named some.

    The score is the largest statistic over its threshold.
    """
    window = problem.config.window
    config = merge(problem.asked, {"window.from_s": window.from_s, "window.to_s": window.to_s})
    result = detect_faults(problem.log, config)
    suspects = tuple(
        Suspect(
            channel=alarm.channel, shape="bias", onset_s=alarm.onset_s, magnitude=alarm.size, declared_s=alarm.time_s
        )
        for alarm in result.alarms
    )
    # The verdict on abrupt faults: the detector does not look for the other kinds, whose verdicts are inconclusive.
    over = [
        series.statistic[np.isfinite(series.statistic)] / series.threshold
        for series in result.series
        if series.threshold > 0.0
    ]
    score = max((float(ratios.max()) for ratios in over if ratios.size), default=None)
    return Statement(decision=result.verdicts[KINDS[0]], suspects=suspects, score=score)


def _identified(result: IdentifyResult) -> Statement:
    """State the identified faults; the score is the largest magnitude of an entry over its standard deviation.

    For a method without standard deviations it is twice the log of the likelihood ratio of all declared faults.
    """
    sizes = [
        abs(candidate.magnitude) / candidate.sd
        for candidate in result.candidates
        if candidate.magnitude is not None and candidate.sd is not None and candidate.sd > 0.0
    ]
    suspects = tuple(map(_suspect, result.faults))
    score = max(sizes) if sizes else _gain(result) if result.outputs else None
    return Statement(decision=result.decision, suspects=suspects, score=score)


def _gain(result: IdentifyResult) -> float:
    """Return twice the log of the likelihood ratio of the model with the declared faults to that without any."""
    gain = 0.0
    for output in result.outputs:
        known = np.isfinite(output.prediction_error) & np.isfinite(output.plain_residual)
        squares, plain = (
            float(np.sum(errors[known] ** 2)) for errors in (output.prediction_error, output.plain_residual)
        )
        gain += np.count_nonzero(known) * float(np.log(plain / squares)) if 0.0 < squares < plain else 0.0
    return gain


def _suspect(estimate: FaultEstimate) -> Suspect:
    fault = estimate.fault
    return Suspect(
        channel=fault.channel,
        shape=fault.shape,
        name=estimate.name,
        onset_s=fault.onset_s,
        offset_s=fault.offset_s,
        magnitude=estimate.magnitude,
    )
