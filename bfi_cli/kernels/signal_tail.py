"""What a fault is far from its onset, its bends and its end: a line and an exponential, whatever filters it."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np

from . import FloatArray

# Time constants that a filter may reach beside a sample: e^50 of a signal is far from the largest number.
LONGEST_REACH = 50.0


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
