"""The signals of the atoms of a dictionary on one record, and what a signal is far from its onset, bends and end."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

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


@dataclass(frozen=True, slots=True, eq=False)
class AtomSignals:
    """The signals of the atoms of a dictionary on one record.

    Attributes
    ----------
    array : (n_samples, n_outputs, n_atoms).
    """

    array: FloatArray

    @classmethod
    def none(cls, n_samples: int, n_outputs: int) -> AtomSignals:
        """Return no signals."""
        return cls(np.empty((n_samples, n_outputs, 0)))

    @property
    def n_samples(self) -> int:
        """How many samples each has."""
        return len(self.array)

    @property
    def n_atoms(self) -> int:
        """How many there are."""
        return int(self.array.shape[2])

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_samples, n_outputs, n_atoms)."""
        return self.array.shape

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> FloatArray:
        """Return (n_samples, n_outputs, n_atoms)."""
        return self.array

    def of(self, atoms: Sequence[int]) -> AtomSignals:
        """Return some of the signals; those of a range of step 1 without a copy."""
        some = slice(atoms.start, atoms.stop) if isinstance(atoms, range) else list(atoms)
        return AtomSignals(self.array[:, :, some])

    def over(self, unit: FloatArray) -> AtomSignals:
        """Return the signals over (n_outputs,) the unit of their output."""
        return AtomSignals(self.array / unit[:, None])

    def joined(self, other: AtomSignals) -> AtomSignals:
        """Return these signals, and others of the same record after them."""
        return AtomSignals(np.concatenate([self.array, other.array], axis=2))

    def replaced(self, atoms: Sequence[int], others: AtomSignals) -> AtomSignals:
        """Return the signals with others in place of some."""
        array = self.array.copy()
        array[:, :, list(atoms)] = others.array
        return AtomSignals(array)

    def combined(self, z: FloatArray) -> FloatArray:
        """Return (n_samples, n_outputs) the sum of the signals times (n_atoms,) magnitudes."""
        return np.asarray((self.array.reshape(-1, z.size) @ z).reshape(self.n_samples, -1))

    def peaks(self) -> FloatArray:
        """Return (n_outputs, n_atoms) the largest absolute value of each signal."""
        return np.asarray(np.maximum(self.array.max(axis=0), -self.array.min(axis=0)))

    def travels(self) -> FloatArray:
        """Return (n_outputs, n_atoms) the largest less the least value of each signal."""
        return np.asarray(np.ptp(self.array, axis=0))

    def powers(self) -> FloatArray:
        """Return (n_atoms,) the root of the mean over all samples of the square of each signal."""
        if self.n_samples <= SQUARED:
            return np.asarray(np.sqrt(np.mean(np.sum(self.array**2, axis=1), axis=0)))
        # One by one, for memory.
        each = (self.array[:, :, j] for j in range(self.n_atoms))
        return np.array([np.sqrt(np.mean(np.sum(signals**2, axis=1))) for signals in each])

    def acting(self) -> tuple[tuple[int, int], ...]:
        """Return (output, atom), ascending, of the signals that are not zero everywhere."""
        return tuple((int(i), int(j)) for i, j in np.argwhere(np.any(self.array, axis=0)))

    def active_rows(self, first: int) -> tuple[int, ...]:
        """Return how many samples of each signal, from sample `first` on, are not zero, on all outputs together."""
        return tuple(np.count_nonzero(self.array[first:], axis=(0, 1)).tolist())


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
