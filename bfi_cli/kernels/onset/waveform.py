"""Fault shapes as the onset scan sees them: samples from the onset on, and what is left of them when the fault ends.

A fault that acts on [t1, t2) is its shape from t1 minus a *tail* from t2. For every shape here the tail, whatever the
duration t2 - t1, is a combination of one or two fixed signals that start at t2: a step for a bias, a ramp and a step
for a drift, a sine and a cosine for a sine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waveform:
    """A shape of unit magnitude over the samples of a record.

    Attributes
    ----------
    samples : (n_samples,) h(l) at l samples after the onset, divided by `unit`.
    unit : factor that makes `samples` the signal of magnitude 1; a drift counts in samples so that its sums are exact.
    tails : (n_tails, n_samples) signals from the end on, divided by `unit`.
    weights : (n_tails, n_samples + 1) share of each tail after a duration of 0..n_samples samples.
    shortest : durations below this many samples are not in the span of the tails.
    """

    samples: FloatArray
    unit: float
    tails: FloatArray
    weights: FloatArray
    shortest: int = 1

    def largest(self, lengths: IntArray) -> FloatArray:
        """Return the largest error that a magnitude of 1 makes within `lengths` samples after the onset."""
        largest: FloatArray = np.maximum.accumulate(np.abs(self.samples * self.unit))[lengths - 1]
        return largest


def bias(n_samples: int) -> Waveform:
    """Return a step of 1."""
    ones = np.ones((1, n_samples + 1))
    return Waveform(samples=ones[0, 1:], unit=1.0, tails=ones[:, 1:], weights=ones)


def drift(n_samples: int, *, step_s: float) -> Waveform:
    """Return a ramp of 1 per second, `step_s` the time between samples."""
    count, ones = np.arange(n_samples + 1.0), np.ones(n_samples + 1)
    tails = np.stack([count[:-1], ones[1:]])
    return Waveform(samples=count[:-1], unit=step_s, tails=tails, weights=np.stack([ones, count]))


def sine(n_samples: int, *, angle: float, phase: float = 0.0) -> Waveform:
    """Return sin(angle * l + phase), `angle` in radians per sample, `phase` that at the onset."""
    at = angle * np.arange(n_samples + 1.0)
    plain = np.sin(at), np.cos(at)
    sin, cos = (np.sin(at + phase), np.cos(at + phase)) if phase else plain
    return Waveform(samples=sin[:-1], unit=1.0, tails=np.stack(plain)[:, :-1], weights=np.stack([cos, sin]))


def lagged_bias(n_samples: int, *, constant: float) -> Waveform:
    """Return 1 - exp(-l / constant), the time constant in samples."""
    rise = -np.expm1(-np.arange(n_samples + 1.0) / constant)
    tails = np.stack([rise[:-1], np.ones(n_samples)])
    return Waveform(samples=rise[:-1], unit=1.0, tails=tails, weights=np.stack([1.0 - rise, rise]))


def ramp_hold(n_samples: int, *, duration: float) -> Waveform:
    """Return a ramp that reaches 1 after `duration` samples and stays there; it ends only after that."""
    return sampled(np.minimum(np.arange(n_samples) / duration, 1.0), constant_from=int(np.ceil(duration)))


def sampled(samples: FloatArray, *, constant_from: int | None = None) -> Waveform:
    """Return any shape; it ends only after `constant_from` samples, from where on it is constant.

    Parameters
    ----------
    samples : (n_samples,) over the whole record.
    constant_from : by default found from the samples.
    """
    samples = np.array(samples, dtype=np.float64)
    n, changes = len(samples), np.flatnonzero(np.diff(samples))
    shortest = constant_from or (int(changes[-1]) + 1 if changes.size else 1)
    weights = np.full((1, n + 1), samples[-1])
    return Waveform(samples=samples, unit=1.0, tails=np.ones((1, n)), weights=weights, shortest=shortest)
