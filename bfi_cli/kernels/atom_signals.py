"""The signals of the atoms of a dictionary, sample by sample or stretch by stretch.

A fault is sharp at its onset, its bends and its end; between them it is ``level + rate t + Re(amplitude exp(exponent
t))``. So the signals of a dictionary over a day take, in stretches, no more memory than over a minute, and lagged or
filtered copies of tails with the same exponents span a space of a few dimensions (`kernels.lagged` makes use of both).
The channels of such a record are held once, and are centred and scaled as they are asked for (`ScaledSignals`).
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from . import FloatArray

# Time constants that a filter may reach beside a sample: e^50 of a signal is far from the largest number.
LONGEST_REACH = 50.0
# Samples of a signal that are evaluated at once, for memory.
AT_ONCE = 262_144
# Samples up to which the signals of all atoms are squared at once, likewise.
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

    def coefficients(self, since_s: float) -> FloatArray:
        """Return (4,) what it is, time counted from `since_s`, of 1, t, and real and imaginary wave of the exponent.

        The waves are ``exp(decay t) cos(angle t)`` and ``exp(decay t) sin(angle t)``.
        """
        size = complex(self.amplitude) * cmath.exp(self.exponent * since_s)
        return np.array([self.level + self.rate * since_s, self.rate, size.real, -size.imag])

    def scaled(self, factor: float) -> Tail:
        """Return a multiple of it."""
        return replace(
            self, level=self.level * factor, rate=self.rate * factor, amplitude=complex(self.amplitude) * factor
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """A signal on samples start..stop - 1.

    Attributes
    ----------
    made : (stop - start,) its samples, or a tail.
    origin_s : time of the record's sample 0 on the time axis of the tail.
    """

    start: int
    stop: int
    made: FloatArray | Tail
    origin_s: float = 0.0

    def between(self, start: int, stop: int, step_s: float) -> FloatArray:
        """Return its samples from start to stop - 1, which lie within it."""
        if isinstance(self.made, Tail):
            return self.made.at(np.arange(start, stop, dtype=np.float64) * step_s + self.origin_s)
        return self.made[start - self.start : stop - self.start]

    @property
    def is_zero(self) -> bool:
        """Whether all of its samples are zero."""
        if isinstance(self.made, Tail):
            return self.made.level == self.made.rate == self.made.amplitude == 0.0
        return not np.any(self.made)

    def scaled(self, factor: float) -> Stretch:
        """Return a multiple of it."""
        made = self.made.scaled(factor) if isinstance(self.made, Tail) else self.made * factor
        return replace(self, made=made)


# The stretches of one signal, ascending and apart; it is zero beside them.
Stretches = tuple[Stretch, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AtomSignals:
    """The signals of the atoms of a dictionary on one record; as an array (n_samples, n_outputs, n_atoms).

    They are held in that array, or, of a long record, in stretches: then each atom acts on one output.

    Attributes
    ----------
    array : (n_samples, n_outputs, n_atoms), None where they are held in stretches; then
    step_s : from sample to sample; outputs : (n_atoms,) on which each acts; atoms : (n_atoms,) stretches of each.
    """

    n_samples: int
    n_outputs: int
    array: FloatArray | None = None
    step_s: float = 0.0
    outputs: tuple[int, ...] = ()
    atoms: tuple[Stretches, ...] = ()

    @classmethod
    def sampled(cls, array: FloatArray) -> AtomSignals:
        """Return signals that are given sample by sample."""
        return cls(n_samples=array.shape[0], n_outputs=array.shape[1], array=array)

    @classmethod
    def none(cls, n_samples: int, n_outputs: int) -> AtomSignals:
        """Return no signals."""
        return cls.sampled(np.empty((n_samples, n_outputs, 0)))

    @property
    def in_stretches(self) -> bool:
        """Whether they are held in stretches, from which the kernels compute otherwise than from samples."""
        return self.array is None

    @property
    def n_atoms(self) -> int:
        """How many there are."""
        return len(self.atoms) if self.array is None else self.array.shape[2]

    @property
    def shape(self) -> tuple[int, int, int]:
        """(n_samples, n_outputs, n_atoms)."""
        return self.n_samples, self.n_outputs, self.n_atoms

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> FloatArray:
        """Return (n_samples, n_outputs, n_atoms), which a short record has the memory for."""
        return self.between(0, self.n_samples)

    def between(self, start: int, stop: int) -> FloatArray:
        """Return (stop - start, n_outputs, n_atoms) of these samples."""
        if self.array is not None:
            return self.array[start:stop]
        theta = np.zeros((stop - start, self.n_outputs, len(self.atoms)))
        for j, (output, stretches) in enumerate(zip(self.outputs, self.atoms, strict=True)):
            for first, last, values in _within(stretches, start, stop, self.step_s):
                theta[first - start : last - start, output, j] = values
        return theta

    def of(self, atoms: Sequence[int]) -> AtomSignals:
        """Return some of the signals; those of a range of step 1 without a copy."""
        if self.array is not None:
            some = slice(atoms.start, atoms.stop) if isinstance(atoms, range) else list(atoms)
            return replace(self, array=self.array[:, :, some])
        return replace(self, outputs=tuple(self.outputs[j] for j in atoms), atoms=tuple(self.atoms[j] for j in atoms))

    def scaled(self, factors: FloatArray) -> AtomSignals:
        """Return multiples of the signals by (n_atoms,) factors."""
        if self.array is not None:
            return replace(self, array=self.array * factors)
        return replace(
            self,
            atoms=tuple(
                tuple(stretch.scaled(float(factor)) for stretch in stretches)
                for stretches, factor in zip(self.atoms, factors, strict=True)
            ),
        )

    def over(self, unit: FloatArray) -> AtomSignals:
        """Return the signals over (n_outputs,) the unit of their output."""
        if self.array is not None:
            return replace(self, array=self.array / unit[:, None])
        return self.scaled(1.0 / unit[list(self.outputs)])

    def joined(self, other: AtomSignals) -> AtomSignals:
        """Return these signals and others of the same record, held alike, after them."""
        if self.array is not None:
            return replace(self, array=np.concatenate([self.array, np.asarray(other)], axis=2))
        return replace(self, outputs=self.outputs + other.outputs, atoms=self.atoms + other.atoms)

    def replaced(self, atoms: Sequence[int], others: AtomSignals) -> AtomSignals:
        """Return the signals with others, held alike, in place of some."""
        if self.array is not None:
            array = self.array.copy()
            array[:, :, list(atoms)] = np.asarray(others)
            return replace(self, array=array)
        outputs, stretches = list(self.outputs), list(self.atoms)
        for n, j in enumerate(atoms):
            outputs[j], stretches[j] = others.outputs[n], others.atoms[n]
        return replace(self, outputs=tuple(outputs), atoms=tuple(stretches))

    def combined(self, z: FloatArray, start: int, stop: int) -> FloatArray:
        """Return (stop - start, n_outputs) the sum of the signals times (n_atoms,) magnitudes."""
        if self.array is not None:
            return np.asarray((self.array[start:stop].reshape(-1, z.size) @ z).reshape(stop - start, -1))
        total = np.zeros((stop - start, self.n_outputs))
        for output, stretches, size in zip(self.outputs, self.atoms, z.tolist(), strict=True):
            for first, last, values in _within(stretches, start, stop, self.step_s):
                total[first - start : last - start, output] += size * values
        return total

    def filtered(self, K: FloatArray) -> AtomSignals:
        """Return signals in stretches filtered by a predictor, theta(k) - sum K_i theta(k - i), from sample `order` on.

        Parameters
        ----------
        K : (order, n_outputs, n_outputs).

        Returns
        -------
        n_atoms * n_outputs signals: what the first leaves on each output, then the second, ...
        """
        outputs, atoms = list[int](), list[Stretches]()
        for output_of_atom, stretches in zip(self.outputs, self.atoms, strict=True):
            for output in range(self.n_outputs):
                taps = np.append(float(output == output_of_atom), -K[:, output, output_of_atom])
                outputs.append(output)
                atoms.append(self._filtered(stretches, taps))
        return replace(self, outputs=tuple(outputs), atoms=tuple(atoms))

    def peaks(self) -> FloatArray:
        """Return (n_outputs, n_atoms) the largest absolute value of each signal."""
        low, high = self._extremes()
        return np.maximum(high, -low)

    def travels(self) -> FloatArray:
        """Return (n_outputs, n_atoms) the largest less the least value of each signal."""
        low, high = self._extremes()
        return high - low

    def powers(self) -> FloatArray:
        """Return (n_atoms,) the root of the mean over all samples of the square of each signal."""
        if self.array is None:
            return self._powers_of_stretches()
        if self.n_samples <= SQUARED:
            return np.asarray(np.sqrt(np.mean(np.sum(self.array**2, axis=1), axis=0)))
        # One by one, for memory.
        each = (self.array[:, :, j] for j in range(self.n_atoms))
        return np.array([np.sqrt(np.mean(np.sum(signals**2, axis=1))) for signals in each])

    def acting(self) -> tuple[tuple[int, int], ...]:
        """Return (output, atom), ascending, of the signals that are not zero everywhere."""
        if self.array is not None:
            return tuple((int(i), int(j)) for i, j in np.argwhere(np.any(self.array, axis=0)))
        seen = enumerate(zip(self.outputs, self.atoms, strict=True))
        return tuple(sorted((i, j) for j, (i, stretches) in seen if not all(stretch.is_zero for stretch in stretches)))

    def active_rows(self, first: int) -> tuple[int, ...]:
        """Return how many samples of each signal, from sample `first` on, are not zero, on all outputs together."""
        if self.array is not None:
            return tuple(np.count_nonzero(self.array[first:], axis=(0, 1)).tolist())
        counts = []
        for stretches in self.atoms:
            pieces = _within(stretches, first, self.n_samples, self.step_s)
            counts.append(sum(int(np.count_nonzero(values)) for _, _, values in pieces))
        return tuple(counts)

    def _powers_of_stretches(self) -> FloatArray:
        factors = dict[complex, FloatArray]()  # of a block of the functions that a tail is made of
        norms = np.zeros(len(self.atoms))
        for j, stretches in enumerate(self.atoms):
            for stretch in stretches:
                for start in range(stretch.start, stretch.stop, AT_ONCE):
                    stop = min(start + AT_ONCE, stretch.stop)
                    if isinstance(stretch.made, Tail) and stop - start == AT_ONCE:
                        exponent = complex(stretch.made.exponent)
                        if exponent not in factors:
                            factors[exponent] = np.asarray(np.linalg.qr(self._functions(exponent, AT_ONCE), mode="r"))
                        part = factors[exponent] @ stretch.made.coefficients(start * self.step_s + stretch.origin_s)
                    else:
                        part = stretch.between(start, stop, self.step_s)
                    norms[j] = np.hypot(norms[j], np.linalg.norm(part))
        return np.asarray(norms / np.sqrt(self.n_samples))

    def _functions(self, exponent: complex, n: int) -> FloatArray:
        since_s = self.step_s * np.arange(n, dtype=np.float64)
        size = np.exp(exponent.real * since_s)
        wave = size * np.cos(exponent.imag * since_s), size * np.sin(exponent.imag * since_s)
        return np.stack([np.ones(n), since_s, *wave], axis=1)

    def _extremes(self) -> tuple[FloatArray, FloatArray]:
        """Return (n_outputs, n_atoms) the least and the largest value of each signal."""
        if self.array is not None:
            return self.array.min(axis=0), self.array.max(axis=0)
        lowest, highest = np.zeros((2, self.n_outputs, len(self.atoms)))
        for j, (output, stretches) in enumerate(zip(self.outputs, self.atoms, strict=True)):
            covered = sum(stretch.stop - stretch.start for stretch in stretches)
            low, high = (np.inf, -np.inf) if covered == self.n_samples else (0.0, 0.0)
            for stretch in stretches:
                for first, last in _ends_of(stretch):
                    values = stretch.between(first, last, self.step_s)
                    low, high = min(low, float(values.min())), max(high, float(values.max()))
            lowest[output, j], highest[output, j] = low, high
        return lowest, highest

    def _filtered(self, stretches: Stretches, taps: FloatArray) -> Stretches:
        """Return the stretches of a signal filtered by (order + 1,) taps, of lags 0, 1, ..."""
        order, made = len(taps) - 1, list[Stretch]()
        beside_s = -self.step_s * np.arange(order + 1, dtype=np.float64)
        for start, stop, tail in regular_runs(stretches, self.n_samples, order):
            if isinstance(tail, Stretch):
                assert isinstance(tail.made, Tail)
                form = tail.made.filtered(taps, beside_s)
                made.append(Stretch(start=start, stop=stop, made=form, origin_s=tail.origin_s))
            elif tail is None:
                first = max(start - order, 0)
                signal = np.zeros(stop - first)
                for a, b, values in _within(stretches, first, stop, self.step_s):
                    signal[a - first : b - first] = values
                samples = np.convolve(signal, taps)[start - first : stop - first]
                made.append(Stretch(start=start, stop=stop, made=samples))
        return tuple(made)


def regular_runs(stretches: Stretches, n_samples: int, order: int) -> list[tuple[int, int, Stretch | float | None]]:
    """Return (start, stop, what) of the runs of a record on which a signal and its lags up to `order` are alike.

    What they are: a stretch that is a tail; 0.0 for zero; None for a run on which they have no such form.
    """
    pieces, at = list[tuple[int, int, Stretch | float | None]](), 0
    for stretch in stretches:
        if stretch.start > at:
            pieces.append((at, stretch.start, 0.0))
        pieces.append((stretch.start, stretch.stop, stretch if isinstance(stretch.made, Tail) else None))
        at = stretch.stop
    if at < n_samples:
        pieces.append((at, n_samples, 0.0))
    runs = list[tuple[int, int, Stretch | float | None]]()
    for start, stop, what in pieces:
        settled = min(start + order * (start > 0), stop)
        for first, last, form in ((start, settled, None), (settled, stop, what)):
            if first < last and form is None and runs and runs[-1][2] is None:
                runs[-1] = (runs[-1][0], last, None)
            elif first < last:
                runs.append((first, last, form))
    return runs


def signal_of(samples: FloatArray) -> Stretches:
    """Return the stretches of a signal (n_samples,) that is given sample by sample: what lies between its zeros."""
    inside = np.flatnonzero(samples)
    if not inside.size:
        return ()
    start, stop = int(inside[0]), int(inside[-1]) + 1
    return (Stretch(start=start, stop=stop, made=samples[start:stop]),)


def _within(stretches: Stretches, start: int, stop: int, step_s: float) -> list[tuple[int, int, FloatArray]]:
    """Return (start, stop, samples) of the stretches, as far as they lie within some samples."""
    ends = [(stretch, max(stretch.start, start), min(stretch.stop, stop)) for stretch in stretches]
    return [(first, last, stretch.between(first, last, step_s)) for stretch, first, last in ends if first < last]


def _ends_of(stretch: Stretch) -> list[tuple[int, int]]:
    """Return (start, stop) of the parts of a stretch that hold its extremes, none longer than what fits at once."""
    start, stop = stretch.start, stretch.stop
    tail = stretch.made
    if isinstance(tail, Tail) and tail.amplitude == 0.0:  # a line has them at its ends
        return [(start, start + 1), (stop - 1, stop)]
    return [(k, min(k + AT_ONCE, stop)) for k in range(start, stop, AT_ONCE)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScaledSignals:
    """Signals less their centre, over their unit; as an array (n_samples, n_signals).

    Attributes
    ----------
    values : (n_samples, n_signals); center, unit : (n_signals,).
    """

    values: FloatArray
    center: FloatArray
    unit: FloatArray

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_samples, n_signals)."""
        return self.values.shape

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, rows: Any) -> FloatArray:
        """Return the scaled signals of a slice of samples, or what else of all of them is asked for."""
        if not isinstance(rows, slice):
            return np.asarray(np.asarray(self)[rows])
        scaled = self.values[rows] - self.center
        scaled /= self.unit
        return scaled

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> FloatArray:
        """Return (n_samples, n_signals), which a short record has the memory for."""
        return self[:]


# The channels of a record, (n_samples, n_channels).
Channels = FloatArray | ScaledSignals


def standardised(values: FloatArray, *, centred: bool, at_once: bool) -> tuple[Channels, FloatArray, FloatArray]:
    """Return signals (n_samples, n_signals) with standard deviation 1 and, if centred, mean 0; constants unscaled.

    Parameters
    ----------
    at_once : in an array of their own, else as they are asked for.

    Returns
    -------
    The signals, and (n_signals,) what was taken off and (n_signals,) the divisor.
    """
    n, parts = len(values), range(0, len(values), MEAN_OF)
    mean = np.sum([np.sum(values[k : k + MEAN_OF], axis=0) for k in parts], axis=0) / n
    squares = np.sum([np.sum((values[k : k + MEAN_OF] - mean) ** 2, axis=0) for k in parts], axis=0)
    deviation = np.sqrt(squares / n)
    center, unit = mean if centred else np.zeros_like(mean), np.where(deviation > 0.0, deviation, 1.0)
    if not at_once:
        return ScaledSignals(values=values, center=center, unit=unit), center, unit
    scaled = values - center
    scaled /= unit
    return scaled, center, unit
