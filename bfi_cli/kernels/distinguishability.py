"""How far a fault separates the prediction errors of a record from those without it, in bits.

The paper on diagnosability (see `density`) compares the densities of single residuals, as if the fault moved each of
them alike. A fault with a time course of its own does not: a bias leaves one large prediction error and then next to
none, and among all samples of a window that one hardly counts. `sample_bits` is that index.

What a window says of a fault lies in one number, the prediction error along the fault's filtered signature: every
direction at right angles to it has the same density with the fault and without. White errors have the same density
along any direction of norm 1, so all of them are samples of it. A fault of magnitude z moves it by z in units of the
magnitude's standard deviation. `window_bits` compares the density without the fault to that of a fault whose magnitude
is normally distributed with that root mean square: a fixed one would give 1 bit to the last digit as soon as it is
easily seen. The Jensen-Shannon divergence is then the information, of 1 bit, that the window has on whether the fault
is there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from . import FloatArray
from .density import Density, convolve, kernel_density
from .divergence import jensen_shannon_quadrature

# Kernels of a density: of more samples, so many order statistics evenly through them; the quadrature costs the square.
MOST_SAMPLES = 512
# Sizes of the fault in deviations: from 0.03, where next to nothing is seen of it, to three million, powers of ten.
DECADES = (-1.5, 6.5)
PER_DECADE = 3
# Bits nearer to 0 or 1 are the quadrature's error.
ACCURACY = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Distinguishability:
    """The information of a window on a fault, against the fault's size.

    Attributes
    ----------
    errors : density of the standardised prediction errors.
    deviations : (n,) root mean square of the magnitude in units of its standard deviation, ascending.
    bits : (n,) Jensen-Shannon divergence, ascending from 0 to 1.
    """

    errors: Density
    deviations: FloatArray
    bits: FloatArray


def distinguishability(errors: FloatArray) -> Distinguishability:
    """Return the information against the size of a fault.

    Parameters
    ----------
    errors : prediction errors of the record without the fault, whitened between outputs, any shape and scale; where
        they are all alike (no noise) a Gaussian stands for them.
    """
    errors = np.asarray(errors, dtype=np.float64).reshape(-1)
    spread = float(np.sqrt(np.mean(errors**2)))
    density = _density(errors / spread if spread > 0.0 else errors)
    density = density or Density(samples=np.zeros(1), bandwidths=np.ones(1), pilot_bandwidth=1.0, exponent=0.0)
    low, high = DECADES
    deviations = np.logspace(low, high, round((high - low) * PER_DECADE) + 1)
    bits = [jensen_shannon_quadrature(density, convolve(density, float(d))) for d in deviations]
    return Distinguishability(errors=density, deviations=deviations, bits=np.maximum.accumulate(bits))


def window_bits(known: Distinguishability, deviations: FloatArray) -> FloatArray:
    """Return the information at sizes of any shape, 0 below the range and for NaN, 1 above it.

    Monotone cubic interpolation of the logarithmic odds over the logarithm of the size, to about 1e-3 of the value.
    """
    from scipy.interpolate import PchipInterpolator

    inside = (known.bits > ACCURACY) & (known.bits < 1.0 - ACCURACY)
    at = np.nan_to_num(np.asarray(deviations, dtype=np.float64), nan=0.0, posinf=np.inf)
    sizes = known.deviations[inside]
    curve = PchipInterpolator(np.log(sizes), special.logit(known.bits[inside]))
    bits = special.expit(curve(np.log(np.clip(at, sizes[0], sizes[-1]))))
    return np.where(at < sizes[0], 0.0, np.where(at > sizes[-1], 1.0, bits))


def sample_bits(errors: FloatArray, traces: FloatArray) -> FloatArray:
    """Return the divergence of single prediction errors with a fault from those without, as the paper compares them.

    Parameters
    ----------
    errors : (n_rows,) of one output without the fault.
    traces : (n_rows, n_faults) what each fault adds to them, NaN at samples outside it.

    Returns
    -------
    (n_faults,), NaN where the fault shows in fewer than three samples, or the errors are all alike.
    """
    without = _density(errors)
    present = [_density((errors + trace)[np.isfinite(trace)]) for trace in traces.T]
    bits = [jensen_shannon_quadrature(without, one) if without and one else np.nan for one in present]
    return np.array(bits, dtype=np.float64)


def _density(samples: FloatArray) -> Density | None:
    """Return the density of the samples, thinned where they are many; None where they have none."""
    if samples.size > MOST_SAMPLES:
        samples = np.sort(samples)[np.linspace(0, samples.size - 1, MOST_SAMPLES).round().astype(int)]
    try:
        return kernel_density(samples)
    except ValueError:
        return None
