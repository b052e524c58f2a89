"""What the default method says of a record of a reproduction, in a few words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..identify.result import IdentifyResult
from ..wording import number

__all__ = ["declared", "model_of", "said", "with_noise"]


def with_noise(log: FlightLog, sd: float, *, seed: int) -> FlightLog:
    """Return the log with white noise of standard deviation `sd` (m/s) on its airspeed."""
    channel = log.channel("tas")
    noise = np.random.default_rng(seed).standard_normal(log.n_samples)
    noisy = replace(channel, values=frozen_array(channel.values + sd * noise))
    return replace(log, channels={**log.channels, channel.name: noisy})


def declared(answer: IdentifyResult) -> str:
    """Return "bias_13.8 4.003", "none", or that it cannot be told."""
    if answer.decision == "not_identifiable":
        return "not identifiable"
    return ", ".join(f"{one.name} {number(one.magnitude)}" for one in answer.faults) or "none"


def said(answer: IdentifyResult) -> str:
    """Return the same as a clause."""
    if answer.decision == "not_identifiable":
        return "the default method says that it cannot tell"
    return f"the default method declares {declared(answer) if answer.faults else 'no fault'}"


def model_of(answer: IdentifyResult) -> str:
    """Return order and rate of the model behind the answer."""
    return f"order {answer.model.order} at {answer.model.rate_hz:g} Hz, maximum likelihood"
