"""A flight log from a model: manoeuvre, gusts, measurement noise, quantisation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from ..flightlog.record import Channel, FlightLog, frozen_array
from .model import Discretisation, Flown, LinearModel, NonlinearModel, response
from .turbulence import Dryden, dryden_gusts, with_gusts

__all__ = ["simulate", "time_axis"]

FloatArray = NDArray[np.float64]

MAX_SAMPLES = 10_000_000  # a gigabyte of memory for a dozen channels
# Rules of thumb: below the stall of the wing, and sin(pitch) within 2 % of pitch.
LINEAR_RANGE_RAD = {"aoa": 0.1, "pitch": 0.3}


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
    """Fly `model` from its trim with the input deviations `u` and record it.

    Gusts and the noise of every output have random streams of their own, so switching one on or off, or changing its
    size, leaves the others as they are.

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
    FlightLog with the inputs and outputs, absolute values; `notes` says where the model is left behind.

    Raises
    ------
    ConfigError : a noise or a quantum of an output the model does not have, or negative; gusts or a discretisation for
        a nonlinear model, or a manoeuvre that it cannot fly.
    """
    noise_sd, quantum = dict(noise_sd or {}), dict(quantum or {})
    for what, sizes in (("noise", noise_sd), ("quantum", quantum)):
        _require_sizes(model, sizes, what=what)
    u = np.asarray(u, dtype=np.float64)
    if u.ndim == 1:
        moved = model.manoeuvred or model.inputs[:1]
        u = np.outer(u, [float(name in moved) for name in model.inputs])
    gust_stream, *noise_streams = rng.spawn(1 + len(model.outputs))
    if isinstance(model, LinearModel):
        flown = _fly_linear(model, u, rate_hz=rate_hz, rule=discretisation, gusts=turbulence, rng=gust_stream)
    elif turbulence is not None:
        raise ConfigError(f"{model.name}: turbulence: not modelled, got {turbulence.sigma_m_s:g} m/s; leave it out")
    elif discretisation != "zoh":
        raise ConfigError(f"{model.name}: discretisation: held inputs only, got '{discretisation}'; leave it out")
    else:
        flown = model.fly(u, rate_hz)
    signals = dict(zip(model.inputs, flown.inputs.T, strict=True))
    for name, values, stream in zip(model.outputs, flown.outputs.T, noise_streams, strict=True):
        noisy, step = values + noise_sd.get(name, 0.0) * stream.standard_normal(len(u)), quantum.get(name, 0.0)
        signals[name] = np.round(noisy / step) * step if step > 0 else noisy
    channels = {
        name: Channel(
            name=name, values=frozen_array(values), unit=model.units[name], source=name, source_unit=model.units[name]
        )
        for name, values in signals.items()
    }
    time_s = frozen_array(np.arange(len(u)) / rate_hz)
    return FlightLog(path=model.name, time_s=time_s, channels=channels, notes=flown.notes)


def _require_sizes(model: LinearModel | NonlinearModel, sizes: Mapping[str, float], *, what: str) -> None:
    for name, value in sizes.items():
        if name not in model.outputs:
            raise ConfigError(f"{model.name}: {what}: no output '{name}'; the model has: {', '.join(model.outputs)}")
        if not (np.isfinite(value) and value >= 0):
            raise ConfigError(
                f"{model.name}: {what} of {name}: not a size, got {value:g} {model.units[name]}; "
                "give a positive number, or 0 for none"
            )


def _fly_linear(
    model: LinearModel,
    u: FloatArray,
    *,
    rate_hz: float,
    rule: Discretisation,
    gusts: Dryden | None,
    rng: np.random.Generator,
) -> Flown:
    """Return the flight in absolute values, with a note where it leaves the range of a linear model."""
    flown, moved = model, u
    if gusts is not None:
        winds = dryden_gusts(gusts, len(u), airspeed_m_s=model.airspeed_m_s, rate_hz=rate_hz, rng=rng)
        flown, moved = with_gusts(model), np.hstack([u, winds])
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
        f"{name} moves up to {extent[name]:.2g} rad from its trim; a linear model holds for about {limit:g} rad"
        for name, limit in LINEAR_RANGE_RAD.items()
        if extent.get(name, 0.0) > limit
    )
    u_0, y_0 = ([model.trim.get(name, 0.0) for name in names] for names in (model.inputs, model.outputs))
    return Flown(inputs=u + np.array(u_0), outputs=y + np.array(y_0), notes=notes)
