"""The signals of the atoms of a dictionary on one record, and what a signal is far from its onset, bends and end."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import FloatArray

# Time constants that a filter may reach beside a sample: e^50 of a signal is far from the largest number.
LONGEST_REACH = 50.0
# Samples up to which the signals of all atoms are squared at once, for memory.
SQUARED = 100_000
# Samples of which means are taken at once, likewise.
MEAN_OF = 65_536


@dataclass(frozen=True, slots=True, kw_only=True)
class Tail:
    """What a signal is from some time on: ``level + rate t + Re(amplitude exp(exponent t))``.

    A filter makes of it another of the same kind, so that a filtered signal of hours is made without filtering.

    Attributes
    ----------
    from_s : the time from which it is that.
    level, rate, amplitude, exponent : per second where they count by time; t are seconds since its own zero of time.
    """

    from_s: float = 0.0
    level: float = 0.0
    rate: float = 0.0
    amplitude: complex = 0.0
    exponent: complex = 0.0

    def at(self, since_s: FloatArray) -> FloatArray:
        """Return (n,) the signal at these seconds."""
        signal = np.asarray(self.level + self.rate * since_s, dtype=np.float64)
        if self.amplitude != 0.0:
            size, phase = cmath.polar(self.amplitude)
            decay, angle = complex(self.exponent).real, complex(self.exponent).imag
            wave = size * np.cos(angle * since_s + phase)
            signal += wave if decay == 0.0 else wave * np.exp(decay * since_s)
        return signal

    def filtered(self, taps: FloatArray, beside_s: FloatArray) -> Tail:
        """Return what a filter makes of it, whose taps act on the signal so many seconds beside.

        Raises
        ------
        ValueError : the filter reaches further than the numbers of an exponential.
        """
        reach = float(np.max(np.abs(complex(self.exponent).real * beside_s), initial=0.0))
        if reach > LONGEST_REACH:
            raise ValueError(f"the filter reaches {reach:.3g} time constants")
        gain = complex(np.sum(taps * np.exp(self.exponent * beside_s)))
        return Tail(
            from_s=self.from_s,
            level=float(self.level * taps.sum() + self.rate * (taps @ beside_s)),
            rate=float(self.rate * taps.sum()),
            amplitude=self.amplitude * gain,
            exponent=self.exponent,
        )


def some_of(theta: FloatArray, atoms: Sequence[int]) -> FloatArray:
    """Return some of the signals (n_samples, n_outputs, n_atoms); those of a range of step 1 without a copy."""
    return theta[:, :, slice(atoms.start, atoms.stop) if isinstance(atoms, range) else list(atoms)]


def amplitudes(theta: FloatArray) -> FloatArray:
    """Return (n_outputs, n_atoms) the largest absolute value of each of the signals (n_samples, n_outputs, n_atoms)."""
    return np.asarray(np.maximum(theta.max(axis=0), -theta.min(axis=0)))


def powers(theta: FloatArray) -> FloatArray:
    """Return (n_atoms,) the root of the mean of the square of each of the signals (n_samples, n_outputs, n_atoms)."""
    if len(theta) <= SQUARED:
        return np.asarray(np.sqrt(np.mean(np.sum(theta**2, axis=1), axis=0)))
    # One by one, for memory.
    each = (theta[:, :, j] for j in range(theta.shape[2]))
    return np.array([np.sqrt(np.mean(np.sum(signals**2, axis=1))) for signals in each])


def acting(theta: FloatArray) -> tuple[tuple[int, int], ...]:
    """Return (output, atom), ascending, of the signals (n_samples, n_outputs, n_atoms) that are not zero everywhere."""
    return tuple((int(i), int(j)) for i, j in np.argwhere(np.any(theta, axis=0)))


def standardised(values: FloatArray, *, centred: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return signals (n_samples, n_signals) with standard deviation 1 and, if centred, mean 0; constants unscaled.

    Returns
    -------
    The signals, and (n_signals,) what was taken off and (n_signals,) the divisor.
    """
    n, parts = len(values), range(0, len(values), MEAN_OF)
    mean = np.sum([np.sum(values[k : k + MEAN_OF], axis=0) for k in parts], axis=0) / n
    squares = np.sum([np.sum((values[k : k + MEAN_OF] - mean) ** 2, axis=0) for k in parts], axis=0)
    deviation = np.sqrt(squares / n)
    center, unit = mean if centred else np.zeros_like(mean), np.where(deviation > 0.0, deviation, 1.0)
    scaled = values - center
    scaled /= unit
    return scaled, center, unit
