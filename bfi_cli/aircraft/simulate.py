"""A flight log from a model: manoeuvre of the controls, Dryden gusts, measurement noise, quantisation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import ConfigError
from ..faults import did_you_mean
from ..flightlog.record import Channel, FlightLog, Truth, frozen_array
from ..jsbsim.ordinary import GUSTS as GUSTS_BEGIN
from ..kernels import FloatArray
from ..notes import Note
from .model import Discretisation, Flown, LinearModel, NonlinearModel, propagate, response

MAX_SAMPLES = 10_000_000  # a gigabyte of memory for a dozen channels
# Rules of thumb: below the stall of the wing, and sin(pitch) within 2 % of pitch.
LINEAR_RANGE_RAD = {"aoa": 0.1, "pitch": 0.3}
EDGE_TOLERANCE = 1e-9  # in unit steps: a sample at an edge belongs to the step that begins there
THROTTLE_AFTER, THROTTLE_STEPS = 10.0, 5.0  # in unit steps; a 3211 is over after 7
MULTISINE_PERIOD = 10.0  # in unit steps
MULTISINE_LINES = 16  # up to 1.6 per unit step: with a step of 1 s the short period lies among them

GUSTS = ("headwind_gust", "updraught")
# Dryden's filters (MIL-F-8785C): states (u, w1, w2) in time units of scale length / airspeed, driven by white noise to
# the stationary covariance P; the gusts of unit intensity are C x.
DRYDEN_A = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -2.0]])
DRYDEN_P = np.diag([1.0, 0.25, 0.25])
DRYDEN_C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, np.sqrt(3.0)]])


def time_axis(*, duration_s: float = 31.72, rate_hz: float = 100.0) -> FloatArray:
    """Return sample times k / rate from 0, shorter than `duration_s` (3172 samples by default, as the thesis's record).

    Raises
    ------
    ConfigError : fewer than two samples, or more than `MAX_SAMPLES`.
    """
    n = duration_s * rate_hz
    if not (rate_hz > 0 and 1.5 <= n <= MAX_SAMPLES):
        raise ConfigError(
            f"simulate: a log has 2 to {MAX_SAMPLES:,} samples, got {duration_s:g} s at {rate_hz:g} Hz; "
            "change --duration or --rate"
        )
    return np.arange(round(n)) / rate_hz


def manoeuvre(
    name: str, time_s: FloatArray, *, amplitude_rad: float = 0.035, start_s: float = 0.2, step_s: float = 1.0
) -> FloatArray:
    """Return the control deflection at `time_s`, (n,), zero before `start_s`.

    Parameters
    ----------
    name : "3211" (steps of 3, 2, 1, 1 units with changing sign), "3211-pairs" (two of them, the second with the other
        sign, 3 units of rest between and 8 after them, and all of it once more), "doublet" (one unit each way),
        "multisine" (16 lines k/10 per unit with Schroeder's phases, up to the end of the record), or "none".
    time_s : (n,) seconds, any values in any order.
    amplitude_rad : largest deflection; the thesis's listing uses 0.5, far outside the linear range.
    start_s : 0.2 s in the thesis's listing.
    step_s : the unit step.

    Raises
    ------
    ConfigError : no such manoeuvre, a step that is not positive, or a number that is not finite.
    """
    if name not in MANOEUVRES:
        raise ConfigError(f"manoeuvre: unknown, got '{name}'{did_you_mean(name, (*MANOEUVRES, 'tour'))}")
    if not (np.isfinite([amplitude_rad, start_s, step_s]).all() and step_s > 0):
        raise ConfigError(
            f"manoeuvre: needs finite numbers and a positive step, got amplitude {amplitude_rad:g}, "
            f"start {start_s:g} s, step {step_s:g} s; change --amplitude, --start or --step"
        )
    units = (np.asarray(time_s, dtype=np.float64) - start_s) / step_s
    return amplitude_rad * MANOEUVRES[name](units)


def deviations(
    model: LinearModel | NonlinearModel,
    name: str,
    time_s: FloatArray,
    *,
    amplitude: float,
    start_s: float,
    step_s: float,
    throttle: float = 0.0,
) -> FloatArray:
    """Return input deviations, (n, n_u): a manoeuvre of the inputs that it moves, then a doublet of the throttle.

    The throttle's doublet begins `THROTTLE_AFTER` unit steps after the manoeuvre and holds `THROTTLE_STEPS` each way,
    since an engine and the airspeed follow more slowly than the pitch.

    Parameters
    ----------
    name, start_s, step_s : see `manoeuvre`.
    amplitude, throttle : largest deflections, in the units of the inputs.

    Raises
    ------
    ConfigError : see `manoeuvre`; a throttle doublet for a model without a throttle; more than the travel of a control.
    """
    travel = model.travel if isinstance(model, NonlinearModel) else {}
    for what, size, control in (("amplitude", amplitude, model.manoeuvred[0]), ("throttle", throttle, "throttle")):
        most = travel.get(control, np.inf)
        if abs(size) > most:
            unit = f" {model.units[control]}" if model.units[control] != "1" and most != 1.0 else ""
            raise ConfigError(
                f"{model.name}: {what}: more than the travel of the {control}, {most:.3g}{unit} to either side, got "
                f"{size:g}; give a smaller --{what}"
            )
    course = manoeuvre(name, time_s, amplitude_rad=amplitude, start_s=start_s, step_s=step_s)
    u = np.outer(course, [float(name in model.manoeuvred) for name in model.inputs])
    if throttle != 0.0:
        if "throttle" not in model.inputs:
            has = ", ".join(model.inputs)
            raise ConfigError(f"{model.name}: throttle: no such input, it has: {has}; leave out --throttle")
        later, longer = start_s + THROTTLE_AFTER * step_s, THROTTLE_STEPS * step_s
        doublet = manoeuvre("doublet", time_s, amplitude_rad=throttle, start_s=later, step_s=longer)
        u[:, model.inputs.index("throttle")] += doublet
    return u


def _steps(lengths: tuple[int, ...]) -> Callable[[FloatArray], FloatArray]:
    edges = np.cumsum((0, *lengths)) - EDGE_TOLERANCE
    levels = np.array([0.0, *((-1.0) ** np.arange(len(lengths))), 0.0])
    return lambda units: levels[np.searchsorted(edges, units, side="right")]


def _pairs(units: FloatArray) -> FloatArray:
    """Return two 3211 of opposite signs, twice: 50 units in all, of which the sum is zero."""
    single = MANOEUVRES["3211"]
    return np.asarray(sum(sign * single(units - start) for start, sign in ((0, 1), (10, -1), (25, 1), (35, -1))))


def _multisine(units: FloatArray) -> FloatArray:
    """Return a sum of equal cosines with phases of low crest factor (Schroeder 1970), its largest value 1."""
    k = np.arange(1, MULTISINE_LINES + 1)
    phase = -np.pi * k * (k - 1) / MULTISINE_LINES

    def cosines(at: FloatArray) -> FloatArray:
        angle: FloatArray = 2.0 * np.pi * np.multiply.outer(at, k) / MULTISINE_PERIOD + phase
        return np.asarray(np.cos(angle).sum(axis=-1))

    fine = np.linspace(0.0, MULTISINE_PERIOD, 64 * MULTISINE_LINES, endpoint=False)
    return np.where(units >= -EDGE_TOLERANCE, cosines(units) / np.abs(cosines(fine)).max(), 0.0)


MANOEUVRES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "3211": _steps((3, 2, 1, 1)),
    "3211-pairs": _pairs,
    "doublet": _steps((1, 1)),
    "multisine": _multisine,
    "none": np.zeros_like,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Dryden:
    """Gusts of an intensity, m/s, and a scale length, m (533 m in all directions at medium and high altitude).

    Raises
    ------
    ConfigError : the intensity is negative, the scale length not positive, or either is not finite.
    """

    sigma_m_s: float
    scale_length_m: float = 533.4

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sigma_m_s) and self.sigma_m_s >= 0):
            raise ConfigError(f"turbulence: the intensity must be 0 or more, got {self.sigma_m_s:g} m/s; change it")
        if not (np.isfinite(self.scale_length_m) and self.scale_length_m > 0):
            raise ConfigError(
                f"turbulence: the scale length must be positive, got {self.scale_length_m:g} m; change it"
            )


def dryden_gusts(
    dryden: Dryden, n_samples: int, *, airspeed_m_s: float, rate_hz: float, rng: np.random.Generator
) -> FloatArray:
    """Return headwind and upward gust velocity, (n_samples, 2), m/s, stationary from the first sample.

    With T = scale length / airspeed the spectra are sigma^2 2T/(1 + (wT)^2) along and sigma^2 T (1 + 3(wT)^2)/(1 +
    (wT)^2)^2 across the flight path (MIL-F-8785C). The filters are discretised exactly: at every rate the samples have
    variance sigma^2 and autocorrelations exp(-t/T) and exp(-t/T) (1 - t/(2T)).
    """
    from scipy.linalg import expm

    step = airspeed_m_s / (dryden.scale_length_m * rate_hz)
    A = np.asarray(expm(DRYDEN_A * step))
    variances, axes = np.linalg.eigh(DRYDEN_P - A @ DRYDEN_P @ A.T)
    shocks = rng.standard_normal((n_samples + 1, len(A)))
    drive = shocks[1:] @ (axes * np.sqrt(np.maximum(variances, 0.0))).T
    states = propagate(A, drive, x0=np.sqrt(DRYDEN_P) @ shocks[0])
    return np.asarray(dryden.sigma_m_s * states @ DRYDEN_C.T)


def with_gusts(model: LinearModel) -> LinearModel:
    """Return `model` with two more inputs, the gust velocities `GUSTS` in m/s.

    The states are then motion over the ground; aerodynamic forces and air-data sensors depend on the motion through the
    air, tas + headwind and aoa + updraught / airspeed, so that in a steady wind the aircraft stays trimmed in the air.
    Left out are the gust's gradient along the aircraft (a pitch rate), and effects on states that the model lacks.
    """
    to_air = np.zeros((len(model.states), len(GUSTS)))
    if "tas" in model.states:
        to_air[model.states.index("tas"), 0] = 1.0
    if "aoa" in model.states:
        to_air[model.states.index("aoa"), 1] = 1.0 / model.airspeed_m_s
    return replace(
        model,
        B=np.hstack([model.B, model.A @ to_air]),
        D=np.hstack([model.D, model.C @ to_air]),
        inputs=model.inputs + GUSTS,
        units={**model.units, **dict.fromkeys(GUSTS, "m/s")},
    )


def simulate(
    model: LinearModel | NonlinearModel,
    u: FloatArray,
    *,
    rng: np.random.Generator,
    rate_hz: float = 100.0,
    discretisation: Discretisation = "zoh",
    turbulence: Dryden | None = None,
    noise_sd: Mapping[str, float] | None = None,
    quantum: Mapping[str, float] | None = None,
) -> FlightLog:
    """Fly `model` from its trim with the input deviations `u` and return the log.

    Gusts and the noise of each output have separate random streams, so that switching one on or off, or changing its
    size, does not change the others.

    Parameters
    ----------
    model : the aircraft.
    u : (n_samples, n_u), or (n_samples,) for all inputs that a manoeuvre moves; held from its sample to the
        next with "zoh".
    rng : source of all random numbers; each call spawns new streams from it.
    rate_hz : of `u` and of the log.
    discretisation : "zoh", "bilinear" or "euler", see `discretise`.
    turbulence : gusts acting on the aircraft and on its air-data sensors.
    noise_sd : standard deviation of white measurement noise by output, in the output's unit.
    quantum : step of the recorded values by output, in the output's unit; zero for none.

    Returns
    -------
    FlightLog with the inputs and outputs, absolute values; `notes` says where the flight leaves the range of the model.

    Raises
    ------
    ConfigError : a noise or a quantum that is negative or of an output that the model lacks; gusts or a discretisation
        that a nonlinear model lacks, or a manoeuvre that it cannot fly.
    """
    noise_sd, quantum = dict(noise_sd or {}), dict(quantum or {})
    for what, sizes in (("noise", noise_sd), ("quantum", quantum)):
        for name, value in sizes.items():
            if name not in model.outputs:
                has = ", ".join(model.outputs)
                raise ConfigError(f"{model.name}: {what}: no output '{name}'; the model has: {has}")
            if not (np.isfinite(value) and value >= 0):
                raise ConfigError(
                    f"{model.name}: {what} of {name}: must be 0 or more, got {value:g} {model.units[name]}; "
                    "give 0 for none"
                )
    u = np.asarray(u, dtype=np.float64)
    if u.ndim == 1:
        u = np.outer(u, [float(name in model.manoeuvred) for name in model.inputs])
    gust_stream, *noise_streams = rng.spawn(1 + len(model.outputs))
    if isinstance(model, LinearModel):
        winds = None
        if turbulence is not None:
            airspeed = model.airspeed_m_s
            winds = dryden_gusts(turbulence, len(u), airspeed_m_s=airspeed, rate_hz=rate_hz, rng=gust_stream)
        flown = _fly_linear(model, u, winds, rate_hz, discretisation)
    elif turbulence is not None and model.airspeed_m_s is None:
        raise ConfigError(f"{model.name}: turbulence: not modelled, got {turbulence.sigma_m_s:g} m/s; leave it out")
    elif discretisation != "zoh":
        raise ConfigError(f"{model.name}: discretisation: held inputs only, got '{discretisation}'; leave it out")
    else:
        flown = model.fly(u, rate_hz, _gusts(model, turbulence, len(u), rate_hz, gust_stream), model.report)
    signals = dict(zip(model.inputs, flown.inputs.T, strict=True))
    for name, values, stream in zip(model.outputs, flown.outputs.T, noise_streams, strict=True):
        noisy, step = values + noise_sd.get(name, 0.0) * stream.standard_normal(len(u)), quantum.get(name, 0.0)
        signals[name] = np.round(noisy / step) * step if step > 0 else noisy
    channels = {}
    for name, values in signals.items():
        unit, values = model.units[name], frozen_array(values)
        channels[name] = Channel(name=name, values=values, unit=unit, source=name, source_unit=unit)
    time_s = frozen_array(np.arange(len(u)) / rate_hz)
    made = model.ordinary if isinstance(model, NonlinearModel) else ()
    truth = Truth(ordinary=made) if made else None
    return FlightLog(path=model.name, time_s=time_s, channels=channels, truth=truth, filters=(), notes=flown.notes)


def _gusts(
    model: NonlinearModel, turbulence: Dryden | None, n_samples: int, rate_hz: float, rng: np.random.Generator
) -> FloatArray | None:
    """Return gusts of a six-degrees-of-freedom flight, (n, 3): headwind, from the right, upward; None in calm air.

    Across the flight path the spectrum is that of the upward gusts, as at medium and high altitudes. Turbulence that
    begins on the way is added to them.
    """
    if model.airspeed_m_s is None:
        return None
    size = {"airspeed_m_s": model.airspeed_m_s, "rate_hz": rate_hz}
    (across,) = rng.spawn(1)
    parts = [] if turbulence is None else [(turbulence, 0, rng, across)]
    for made in model.ordinary:
        if made.cause == GUSTS_BEGIN and made.size is not None:
            first = min(max(math.ceil(made.at_s * rate_hz), 0), n_samples)
            along, aside = rng.spawn(2)
            parts.append((Dryden(sigma_m_s=abs(made.size)), first, along, aside))
    gusts = np.zeros((n_samples, 3))
    for dryden, first, along, aside in parts:
        ahead = dryden_gusts(dryden, n_samples, rng=along, **size)
        gusts[first:] += np.insert(ahead, 1, dryden_gusts(dryden, n_samples, rng=aside, **size)[:, 1], axis=1)[first:]
    return gusts if parts else None


def _fly_linear(
    model: LinearModel, u: FloatArray, winds: FloatArray | None, rate_hz: float, rule: Discretisation
) -> Flown:
    """Return the flight in absolute values, with a note where it leaves the range of a linear model."""
    flown, moved = (model, u) if winds is None else (with_gusts(model), np.hstack([u, winds]))
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            y = response(flown, moved, rate_hz=rate_hz, rule=rule)
    except np.linalg.LinAlgError:
        raise ConfigError(f"{model.name}: A: has no {rule} discretisation at {rate_hz:g} Hz; change --rate") from None
    if not np.isfinite(y).all():
        first = int(np.argmin(np.isfinite(y).all(axis=1)))
        raise ConfigError(
            f"{model.name}: A: unstable, its outputs are no numbers from {first / rate_hz:g} s on; mend A or shorten "
            "--duration"
        )
    extent = dict(zip(model.outputs, np.abs(y).max(axis=0), strict=True))
    notes = tuple(
        Note.limit(
            f"{name} moves up to {extent[name]:.2g} rad from its trim; a linear model holds for about {limit:g} rad"
        )
        for name, limit in LINEAR_RANGE_RAD.items()
        if extent.get(name, 0.0) > limit
    )
    u_0, y_0 = ([model.trim.get(name, 0.0) for name in names] for names in (model.inputs, model.outputs))
    return Flown(inputs=u + np.array(u_0), outputs=y + np.array(y_0), notes=notes)


def flight_of(
    model: LinearModel | NonlinearModel,
    name: str,
    *,
    rng: np.random.Generator,
    duration_s: float = 31.72,
    rate_hz: float = 100.0,
    turbulence_m_s: float = 0.0,
    discretisation: Discretisation = "zoh",
    noise_sd: Mapping[str, float] | None = None,
    **sizes: float,
) -> FlightLog:
    """Return the log of a manoeuvre by its name, in gusts of an intensity; see `time_axis` and `simulate`.

    Parameters
    ----------
    sizes : amplitude_rad, start_s and step_s of `manoeuvre`.

    Raises
    ------
    ConfigError : no such manoeuvre or output, or a number that is out of range.
    """
    time_s = time_axis(duration_s=duration_s, rate_hz=rate_hz)
    return simulate(
        model,
        manoeuvre(name, time_s, **sizes),
        rng=rng,
        rate_hz=rate_hz,
        discretisation=discretisation,
        turbulence=Dryden(sigma_m_s=turbulence_m_s) if turbulence_m_s else None,
        noise_sd=noise_sd,
    )
