"""Plain detectors on the residual of a model without faults, and the rules of autopilots, as methods to compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...errors import ConfigError, LogError
from ...faults import Decision
from ...flightlog import FlightLog
from ...kernels import BoolArray, FloatArray
from ...kernels.airspeed_rules import (
    STANDARD_GRAVITY,
    ardupilot_disabled,
    px4_first_principle,
    px4_innovation,
    px4_invalid,
    px4_load_factor,
    px4_missing,
    px4_stuck,
    wind_innovation,
)
from ...kernels.change_alarm import (
    ChangeAlarm,
    best_split,
    cumulative_sum,
    cusum_threshold,
    glr_threshold,
    likelihood_ratio,
)
from ...kernels.whiteness import robust_sd
from .peers import Problem, plain_model
from .result import Statement, Suspect

# The airspeed that a rule watches: the first that is there.
AIRSPEED = (("tas", "cas", "ias"),)
# Samples per second at which checks are made: PX4's validator runs every 100 ms, ArduPilot's no more than every 200 ms.
CHECKS_HZ = 10.0
# Seconds after which the likelihood ratio forgets an onset. Chosen without a tuning record.
MEMORY_S = 60.0
# Price of a change point in natural units per log of the number of rows: its place and its mean, by the BIC.
CHANGE_PRICE = 2.0


def by_cumulative_sum(problem: Problem) -> Statement:
    """State a change of the residual's mean by the two-sided cumulative sum, its threshold that of white noise."""

    def detect(x: FloatArray, _rate_hz: float) -> tuple[ChangeAlarm | None, float]:
        sums = cumulative_sum(x)
        return sums.alarm(cusum_threshold(len(x), problem.config.start_time.false_alarm)), float(sums.values.max())

    return _changes(problem, detect)


def by_likelihood_ratio(problem: Problem) -> Statement:
    """State a change of the residual's mean by the generalised likelihood ratio, its threshold that of white noise."""

    def detect(x: FloatArray, rate_hz: float) -> tuple[ChangeAlarm | None, float]:
        lengths = max(1, min(len(x), round(MEMORY_S * rate_hz)))
        ratio = likelihood_ratio(x, lengths)
        threshold = glr_threshold(len(x), lengths, problem.config.start_time.false_alarm)
        return ratio.alarm(threshold), float(ratio.values.max())

    return _changes(problem, detect)


def by_change_points(problem: Problem) -> Statement:
    """State the first change point of the residual's mean by PELT, with the penalty of the BIC.

    The score is the gain of a single change, in natural units.

    Raises
    ------
    ConfigError : the package ruptures is not installed.
    """
    try:
        import ruptures
    except ImportError:
        raise ConfigError("needs the package ruptures; install it with: pip install bfi-cli[compare]") from None

    def detect(x: FloatArray, _rate_hz: float) -> tuple[ChangeAlarm | None, float]:
        # The cost of ruptures is the sum of squares, twice the natural units.
        price = 2.0 * CHANGE_PRICE * float(np.log(len(x)))
        ends = ruptures.Pelt(model="l2", min_size=2, jump=1).fit(x[:, None]).predict(pen=price)
        first, gain = int(ends[0]), best_split(x)
        if first >= len(x):
            return None, gain
        return ChangeAlarm(alarm=len(x) - 1, onset=first, size=float(np.mean(x[first:]))), gain

    statement = _changes(problem, detect)
    # PELT sees the whole window at once, so that there is no time of declaration.
    return replace(statement, suspects=tuple(replace(suspect, declared_s=None) for suspect in statement.suspects))


def _changes(problem: Problem, detect: Callable[[FloatArray, float], tuple[ChangeAlarm | None, float]]) -> Statement:
    """State what a detector says of the standardised residual of every output, the model fitted to the whole window.

    Parameters
    ----------
    detect : from a residual (n,) and its rate to the alarm, and to the largest value of the statistic.
    """
    result, _ = plain_model(problem)
    suspects, scores = [], []
    for output in result.outputs:
        known = np.isfinite(output.plain_residual)
        x, time_s = output.plain_residual[known], result.time_s[known]
        sd = robust_sd(x)
        if not sd > 0.0:
            continue
        alarm, score = detect((x - np.median(x)) / sd, result.log.rate_hz)
        scores.append(score)
        if alarm is not None:
            onset_s, declared_s = float(time_s[alarm.onset]), float(time_s[alarm.alarm])
            suspects.append(Suspect(channel=output.channel, onset_s=onset_s, declared_s=declared_s))
    decision: Decision = "fault" if suspects else "no_fault"
    return Statement(decision=decision, suspects=tuple(suspects), score=max(scores, default=None))


def by_px4(problem: Problem, *, every: bool) -> Statement:
    """State when PX4 would declare the airspeed invalid, with its published parameters.

    The innovation needs the ground velocity, the load factor check `normal_acc`, the first-principle check throttle and
    pitch; a check whose channels the log lacks never fails. The wind filter estimates neither sideslip nor scale, so
    that an innovation settles otherwise than on board. The score is the largest innovation, m/s.

    Parameters
    ----------
    every : with the load factor and first-principle checks, which are off by default.
    """
    name, time_s, values = _sampled(problem.part)
    airspeed, score = values[name], None
    none = np.zeros(len(time_s), dtype=bool)
    checks = {"missing": px4_missing(time_s, airspeed), "stuck": px4_stuck(time_s, airspeed)}
    checks |= dict.fromkeys(("innovation", "load_factor", "first_principle"), none)
    if (innovation := _innovation(time_s, airspeed, values)) is not None:
        checks["innovation"], score = px4_innovation(time_s, innovation[0]), _largest(np.abs(innovation[0]))
    if every and "normal_acc" in values:
        checks["load_factor"] = px4_load_factor(airspeed, values["normal_acc"] + STANDARD_GRAVITY)
    if every and {"throttle", "pitch"} <= values.keys():
        checks["first_principle"] = px4_first_principle(time_s, airspeed, values["throttle"], values["pitch"])
    invalid = px4_invalid(
        time_s,
        missing=checks["missing"],
        stuck=checks["stuck"],
        innovation=checks["innovation"],
        load_factor=checks["load_factor"],
        first_principle=checks["first_principle"],
    )
    return _stated(name, time_s, invalid, score, checks)


def by_ardupilot(problem: Problem) -> Statement:
    """State when ArduPilot would disable the airspeed sensor, with its published parameters.

    The score is the largest innovation over its standard deviation.
    """
    name, time_s, values = _sampled(problem.part)
    innovation = _innovation(time_s, values[name], values)
    if innovation is None:
        raise LogError("needs velocity_north and velocity_east, which the log lacks")
    ground_speed = np.hypot(values["velocity_north"], values["velocity_east"])
    with np.errstate(invalid="ignore"):
        ratio = np.abs(innovation[0]) / innovation[1]
    disabled = ardupilot_disabled(time_s, values[name], ground_speed, ratio)
    return _stated(name, time_s, disabled, _largest(ratio), {"wind_gate": disabled})


def _sampled(log: FlightLog) -> tuple[str, FloatArray, dict[str, FloatArray]]:
    """Return the airspeed's name, the times of the checks, and every channel at these."""
    name = next(name for name in AIRSPEED[0] if name in log.channels)
    step = max(1, round(log.rate_hz / CHECKS_HZ))
    return name, log.time_s[::step], {key: channel.values[::step] for key, channel in log.channels.items()}


def _innovation(
    time_s: FloatArray, airspeed: FloatArray, values: dict[str, FloatArray]
) -> tuple[FloatArray, FloatArray] | None:
    if not {"velocity_north", "velocity_east"} <= values.keys():
        return None
    up = values.get("altitude_rate", np.zeros(len(time_s)))
    return wind_innovation(time_s, airspeed, np.stack([values["velocity_north"], values["velocity_east"], up], axis=1))


def _largest(values: FloatArray) -> float | None:
    """Return the largest of the values that are known, None where none is."""
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else None


def _stated(
    name: str, time_s: FloatArray, failed: BoolArray, score: float | None, checks: Mapping[str, BoolArray]
) -> Statement:
    """Return the statement about a channel that fails, named by the checks that fail when it is first declared."""
    if not failed.any():
        return Statement(decision="no_fault", score=score)
    first = int(np.argmax(failed))
    tripped = " and ".join(check.replace("_", " ") for check, fails in checks.items() if fails[first])
    suspect = Suspect(channel=name, name=tripped or None, declared_s=float(time_s[first]))
    return Statement(decision="fault", suspects=(suspect,), score=score)
