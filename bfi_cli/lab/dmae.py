"""Double-model adaptive estimation: the benchmark of the thesis, for a fault of one sensor and a known aircraft model.

Two Kalman filters run on the log, one of the aircraft as it is and one that estimates a fault of the sensor too. Their
likelihoods say whether there is a fault; the second one says how large it is at every sample, whatever its shape. A
fault so slow that the aircraft could have moved like that is put down to the aircraft (figure 5-6 of the thesis).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..aircraft import MODELS, Discretisation, LinearModel, discretise
from ..config import Config
from ..errors import ConfigError, LogError
from ..faults import did_you_mean
from ..flightlog import FlightLog, require_usable
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.kalman import FAULT, NO_FAULT, Gaussian, RandomWalk, StateSpace, double_model, state_and_fault
from ..kernels.low_pass import decimate
from ..kernels.model_selection import Penalty
from ..kernels.progress import Progress, unseen
from ..kernels.whiteness import effective_rows
from ..model.preprocessing.magnitudes import MagnitudeEstimates
from ..model.preprocessing.regression import RegressionData
from ..model.preprocessing.window import PreparedWindow
from ..model.result import SolverSummary
from ..model.selection import MethodResult
from ..notes import Note
from ..quantities.text import instant

Variances = float | Sequence[float]
Reference = Literal["trim", "start"]

START_S = 1.0  # over which "start" averages: many samples of noise, and no manoeuvre yet
# Variance of the noise of a measured output where the configuration has none: 0.01 (m/s)^2 in the thesis; of angles
# and their rates (0.01 rad)^2, 0.6 degrees, so that attitude and vanes tell a slow fault of the airspeed from motion.
NOISE, ANGULAR_NOISE = 0.01, 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class DmaeSettings:
    """What the filters assume; the defaults are those of the thesis's figures 5-5 and 5-6.

    Attributes
    ----------
    process_variance : Q of one sample, one number or one per state, in the states' units squared.
    measurement_variance : R, one number or one per measured output.
    fault_variance : process noise of the fault per sample; 0 for a fault that is constant between restarts.
    adaptive_window : samples over which the process noise of the fault follows its innovations; None for not at all.
        With 20 slow sinusoids are followed too, at the price of an offset that wanders with every large step.
    initial_variance : of the state at the first sample, one number or one per state.
    prior_fault : probability of a fault before the first sample.
    floor : neither probability falls below it.
    reset_value, reset_variance : of the fault, where the filter with it restarts.
    discretisation : of the model.
    """

    process_variance: Variances = 4e-6
    measurement_variance: Variances = 0.01
    fault_variance: float = 0.0
    adaptive_window: int | None = None
    initial_variance: Variances = 0.01
    prior_fault: float = 0.05
    floor: float = 0.001
    reset_value: float = 1e-3
    reset_variance: float = 100.0
    discretisation: Discretisation = "zoh"

    def __post_init__(self) -> None:
        rules = {
            "process_variance": (_least(self.process_variance) >= 0, "must be finite and not negative"),
            "measurement_variance": (_least(self.measurement_variance) > 0, "must be finite and positive"),
            "fault_variance": (_least(self.fault_variance) >= 0, "must be finite and not negative"),
            "adaptive_window": (self.adaptive_window is None or self.adaptive_window >= 1, "must be at least 1 sample"),
            "initial_variance": (_least(self.initial_variance) >= 0, "must be finite and not negative"),
            "prior_fault": (0 < self.prior_fault < 1, "must lie between 0 and 1"),
            "floor": (0 < self.floor < 0.5, "must lie between 0 and 0.5"),
            "reset_value": (np.isfinite(self.reset_value), "must be finite"),
            "reset_variance": (_least(self.reset_variance) > 0, "must be finite and positive"),
        }
        for key, (kept, rule) in rules.items():
            if not kept:
                raise ConfigError(f"dmae: {key}: {rule}, got {getattr(self, key)}; change it")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DmaeResult:
    """State and fault of every sample, the two hypotheses mixed by their probabilities; row k knows samples 0 to k.

    Attributes
    ----------
    time_s : (n_samples,) of the log.
    channel, unit : the sensor that may be faulty.
    measured : (n_samples,) the log's channel.
    fault, fault_sd : (n_samples,) the fault, exactly zero under the hypothesis of none, whose probability does not
        fall below `floor`; the sd is therefore at least sqrt(floor) times the fault.
    fault_if_any : (n_samples,) the fault as the filter with a fault sees it, whatever its probability.
    probability : (n_samples,) of a fault.
    states : names of the columns of `state` and `state_sd`, (n_samples, n_x), absolute values.
    outputs : names of the measured outputs, the columns of `estimate` (n_samples, n_y), free of the fault.
    innovation, innovation_sd : (n_samples, 2, n_y), of the filter without and of that with a fault.
    onset_s : of the first sample at which a fault is more probable than not; None where there is none.
    """

    time_s: FloatArray
    channel: str
    unit: str
    measured: FloatArray
    fault: FloatArray
    fault_sd: FloatArray
    fault_if_any: FloatArray
    probability: FloatArray
    states: tuple[str, ...]
    state: FloatArray
    state_sd: FloatArray
    outputs: tuple[str, ...]
    estimate: FloatArray
    innovation: FloatArray
    innovation_sd: FloatArray
    onset_s: float | None


def dmae(
    log: FlightLog,
    model: LinearModel,
    *,
    channel: str = "tas",
    measured: Sequence[str] | None = None,
    reference: Reference = "trim",
    settings: DmaeSettings | None = None,
) -> DmaeResult:
    """Estimate the fault of one sensor over a log.

    Parameters
    ----------
    log : at a uniform rate, with the model's inputs and the measured outputs, absolute values.
    model : of the aircraft, see `bfi_cli.aircraft`; the log's rate discretises it.
    channel : the sensor that may be faulty, an output of the model.
    measured : the outputs the filters see; by default `channel` alone, as in the thesis.
    reference : what the model's deviations count from: its own trim, or the mean of the log's first second ("start";
        for a log that was not flown at the model's trim).
    settings : of the filters.

    Raises
    ------
    ConfigError : the model has no such output, or the settings do not fit it.
    LogError : the log cannot be used.

    Notes
    -----
    Algorithm 1 of the thesis, equations 2-10 and 5-4. With a single measured output only the model tells motion from
    fault, so the split rests on the process noise: what is slow enough for it becomes motion.
    """
    settings, measured = settings or DmaeSettings(), tuple(measured or (channel,))
    _check_outputs(model, channel, measured)
    require_usable(log, [*model.inputs, *measured])
    # What the deviations of every state, input and output count from.
    origin = {name: model.trim.get(name, 0.0) for name in (*model.states, *model.inputs, *measured)}
    if reference == "start":
        first = log.time_s < log.time_s[0] + START_S
        origin |= {name: float(log.channel(name).values[first].mean()) for name in (*model.inputs, *measured)}
    y = log.signals(measured) - [origin[name] for name in measured]
    u = log.signals(model.inputs) - [origin[name] for name in model.inputs]
    A, B, C, D = discretise(model, rate_hz=log.rate_hz, rule=settings.discretisation)
    rows, n_x = [model.outputs.index(name) for name in measured], len(model.states)
    Q = _diagonal("process_variance", settings.process_variance, n_x)
    R = _diagonal("measurement_variance", settings.measurement_variance, len(rows))
    system = StateSpace(A=A, B=B, C=C[rows], D=D[rows], Q=Q, R=R)
    initial = Gaussian(mean=np.zeros(n_x), covariance=_diagonal("initial_variance", settings.initial_variance, n_x))
    try:
        run = double_model(
            system,
            y,
            u,
            channel=measured.index(channel),
            initial=initial,
            prior_fault=settings.prior_fault,
            floor=settings.floor,
            fault=RandomWalk(
                value=settings.reset_value,
                variance=settings.reset_variance,
                step_variance=settings.fault_variance,
                window=settings.adaptive_window,
            ),
        )
    except ValueError as problem:
        raise ConfigError(f"dmae: {problem}; bring the variances of the settings closer together") from None
    both = state_and_fault(run)
    sd = np.sqrt(np.diagonal(both.covariance, axis1=1, axis2=2))
    estimate = both.mean[:, :-1] @ system.C.T + u @ system.D.T
    probability = run.probability[:, FAULT]
    innovation_sd = [np.sqrt(np.diagonal(each.innovation_covariance, axis1=1, axis2=2)) for each in run.filters]
    return DmaeResult(
        time_s=log.time_s,
        channel=channel,
        unit=log.channel(channel).unit,
        measured=log.channel(channel).values,
        fault=frozen_array(both.mean[:, -1]),
        fault_sd=frozen_array(sd[:, -1]),
        fault_if_any=frozen_array(run.filters[FAULT].mean[:, -1]),
        probability=frozen_array(probability),
        states=model.states,
        state=frozen_array(both.mean[:, :-1] + [origin[name] for name in model.states]),
        state_sd=frozen_array(sd[:, :-1]),
        outputs=measured,
        estimate=frozen_array(estimate + [origin[name] for name in measured]),
        innovation=frozen_array(np.stack([each.innovation for each in run.filters], axis=1)),
        innovation_sd=frozen_array(np.stack(innovation_sd, axis=1)),
        onset_s=float(log.time_s[np.argmax(probability > 0.5)]) if np.any(probability > 0.5) else None,
    )


def _check_outputs(model: LinearModel, channel: str, measured: Sequence[str]) -> None:
    for name in (channel, *measured):
        if name not in model.outputs:
            raise ConfigError(f"dmae: model '{model.name}' has no output '{name}'{did_you_mean(name, model.outputs)}")
    if channel not in measured or len(set(measured)) < len(measured):
        raise ConfigError(
            f"dmae: measured: must name every output once, and '{channel}' among them, got {', '.join(measured)}; "
            "change it"
        )


def _diagonal(key: str, variances: Variances, n: int) -> FloatArray:
    values = np.atleast_1d(np.asarray(variances, dtype=np.float64))
    if values.shape not in ((1,), (n,)):
        raise ConfigError(f"dmae: {key}: must be one number or {n}, got {values.size}; change it")
    return np.diag(np.broadcast_to(values, n))


def _least(variances: Variances) -> float:
    """Return the least of the variances, NaN where one is not finite or there is none."""
    values = np.atleast_1d(np.asarray(variances, dtype=np.float64))
    return float(values.min()) if values.size and np.isfinite(values).all() else float("nan")


def dmae_of(log: FlightLog, config: Config) -> tuple[LinearModel, DmaeResult]:
    """Estimate the fault of the first output with the model and the variances of a configuration, and return both.

    Raises
    ------
    ConfigError : there is no linear model of that name, or the output is none of its outputs.
    LogError : the log lacks an input or an output of the model.
    """
    rules = config.dmae
    model = MODELS.get(rules.model or "")
    if not isinstance(model, LinearModel):
        linear = [name for name, known in MODELS.items() if isinstance(known, LinearModel)]
        raise ConfigError(f"dmae.model: no linear model, got '{rules.model}'{did_you_mean(rules.model, linear)}")
    missing = [name for name in (*model.inputs, *model.outputs) if name not in log.channels]
    if missing:
        raise LogError(
            f"{log.path}: method dmae needs {', '.join(missing)} of the model '{model.name}'; the log has: "
            f"{', '.join(sorted(log.channels))}; map them with --channel, or give another --model"
        )
    default = {name: ANGULAR_NOISE if model.units.get(name, "").startswith("rad") else NOISE for name in model.outputs}
    run = dmae(
        log,
        model,
        channel=config.outputs[0],
        measured=model.outputs,
        reference=rules.reference,
        settings=DmaeSettings(
            process_variance=rules.process_variance,
            measurement_variance=tuple(rules.measurement_variance.get(n, default[n]) for n in model.outputs),
            fault_variance=rules.fault_variance,
            adaptive_window=rules.adaptive_window,
        ),
    )
    return model, run


def identify_by_dmae(
    window: PreparedWindow, _regression: RegressionData, config: Config, _progress: Progress = unseen
) -> MethodResult:
    """Estimate the course of a fault of the output at the log's own rate, and what of the dictionary explains it.

    A fault is declared where its hypothesis becomes more probable than that of none. The course is then filtered as the
    dictionary is, and entries are added one by one, each by least squares, for as long as that lowers the BIC; errors
    are correlated over many samples, so their effective number counts and no intervals are given.

    Raises
    ------
    ConfigError, LogError : see `dmae_of`.
    """
    log = window.log
    model, run = dmae_of(log, config)

    def at_rate(x: FloatArray) -> FloatArray:
        return decimate(x, window.signals.factor, window.lowpass)

    course = at_rate(run.fault)
    theta = window.signals.theta[:, 0, list(window.live)]
    atoms, z = _explained(course, theta, config) if run.onset_s is not None else ((), np.zeros(0))
    value = np.full(len(window.live), np.nan)
    value[list(atoms)] = z
    output = model.outputs.index(run.channel)
    if run.onset_s is None:
        notes: tuple[Note, ...] = (
            Note.method(
                f"the probability of a fault of '{run.channel}' never exceeds {float(run.probability.max()):.3g}"
            ),
        )
    else:
        rest = course - theta[:, list(atoms)] @ z
        share = 100.0 * (1.0 - float(rest @ rest) / float(course @ course))
        notes = (
            Note.method(
                f"a fault of '{run.channel}' is more probable than not from {instant(run.onset_s)} s on, with a "
                f"probability of {run.probability[-1]:.3g} at the end of the window"
            ),
            Note.limit(
                f"the entries of the dictionary explain {share:.3g} % of the fault's estimated course; their "
                "magnitudes have no intervals"
            ),
        )
    error = [at_rate(run.innovation[:, hypothesis, output])[:, None] for hypothesis in (NO_FAULT, FAULT)]
    return MethodResult(
        atoms=atoms,
        magnitudes=MagnitudeEstimates.without_variances(value, len(atoms)),
        error=error[NO_FAULT if run.onset_s is None else FAULT],
        plain_error=error[NO_FAULT],
        order=len(model.states),
        feedthrough=bool(np.any(model.D)),
        condition_number=np.nan,
        solver=SolverSummary(
            method=config.method,
            termination="one pass of both filters over the samples",
            iterations=log.n_samples,
            condition_number=np.nan,
        ),
        fires=run.onset_s is not None,
        notes=notes,
    )


def _explained(course: FloatArray, theta: FloatArray, config: Config) -> tuple[tuple[int, ...], FloatArray]:
    """Return the atoms that explain a fault's course (n_samples,) by BIC, forward from none, and their magnitudes."""

    def fitted(atoms: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        z = np.asarray(np.linalg.lstsq(theta[:, atoms], course, rcond=None)[0], dtype=np.float64)
        return z, course - theta[:, atoms] @ z

    rules, atoms, rest = config.selection, list[int](), course
    most = theta.shape[1] if rules.max_active is None else min(rules.max_active, theta.shape[1])
    while len(atoms) < most:
        others = [j for j in range(theta.shape[1]) if j not in atoms]
        trials = {j: fitted([*atoms, j])[1] for j in others}
        best = min(others, key=lambda j: float(trials[j] @ trials[j]))
        left = trials[best]
        rows = effective_rows(left[:, None])
        penalty = Penalty(
            n_rows=len(left),
            n_effective=rows,
            n_candidates=theta.shape[1],
            evidence=rules.evidence,
            extended=rules.criterion == "ebic",
        )
        fall = rows * float(np.log(float(rest @ rest) / max(float(left @ left), np.finfo(float).tiny)))
        if fall <= penalty.per_fault:
            break
        atoms, rest = [*atoms, best], left
    chosen = sorted(atoms)
    return tuple(chosen), fitted(chosen)[0]
