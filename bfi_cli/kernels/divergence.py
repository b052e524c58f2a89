"""How far a fault separates the prediction errors of a record from those without it: a divergence, in bits.

Equation numbers are those of Wang, Tang, Chen, "Quantitative Evaluation of Sensor Fault Diagnosability of F-16 High
Maneuvering Fighter". Densities are adaptive kernels after Abramson; (20) prints 1/(2 pi) for the constant of a Gaussian
kernel, and 1/sqrt(2 pi) is used here, so that a density integrates to 1.

The Jensen-Shannon divergence of two densities is 0 bits where they are one and 1 bit where nothing is common to both.
It has the factors 1/2 of (15) in both terms and logarithms to base 2, which the range (0, 1) of its source asks for;
(17) as printed lacks the halves and estimates twice the divergence.

The paper compares the densities of single residuals, as if a fault moved all of
them alike; `sample_bits` is that index. But a bias, for instance, leaves one large prediction error and then next to
none, and among all samples of a window the large one hardly counts.

All that a window tells of a fault is in one number, the prediction error along the fault's filtered signature: along
every direction orthogonal to it the density is the same with the fault and without. White errors have the same density
along any direction of norm 1, so that each of them is a sample of it. A fault of magnitude z shifts that number by z
over the standard deviation of the magnitude. `window_bits` compares the density without the fault with that of a fault
whose magnitude is normally distributed with a given root mean square; a fixed magnitude would give 1 bit to the last
digit as soon as it is easily seen. The divergence is then how much of the 1 bit, whether the fault is there or not,
the window tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from . import EPS, FloatArray
from .compiled import special

# Fewest samples from which a bandwidth is estimated.
FEWEST = 3
# Distances between points and kernels that are held at a time: half a megabyte, which stays in the cache.
BLOCK = 1 << 16
# Sums of exponentials this far from overflow and underflow need no scaling by the largest.
SMALL = 1e-250
# The exponents a of (22) to choose from. They end at 1 because on a multimodal residual the likelihood may rise beyond
# any sensible exponent.
EXPONENTS = np.linspace(0.0, 1.0, 21)
HALF_LOG_2_PI = 0.5 * np.log(2.0 * np.pi)
# Bandwidths from its centre at which a kernel ends: beyond, 2e-19 of it.
REACH = 9.0
# Bandwidths that a kernel's centre or end must lie from the last edge to become an edge itself.
CLOSE = 2.0
# Error of the whole integral that the panels share equally, and bisections of a panel at most.
TOLERANCE = 1e-8
ROUNDS = 30
# Kronrod's 15 nodes on [-1, 1] from the centre outwards, their weights, and the weights of Gauss's 7 among them.
NODES = (
    0.0, 0.207784955007898467600689403773245, 0.405845151377397166906606412076961,
    0.586087235467691130294144691693013, 0.741531185599394439863864773280788, 0.864864423359769072789712788640926,
    0.949107912342758524526189684047851, 0.991455371120812639206854697526329,
)  # fmt: skip
KRONROD = (
    0.209482141084727828012999174891714, 0.204432940075298892414161999234649, 0.190350578064785409913256402421014,
    0.169004726639267902826583426598550, 0.140653259715525918745189590510238, 0.104790010322250183839876322541518,
    0.063092092629978553290700663189204, 0.022935322010529224963732008058970,
)  # fmt: skip
GAUSS = (
    0.417959183673469387755102040816327, 0.0, 0.381830050505118944950369775488975, 0.0,
    0.279705391489276667901467771423780, 0.0, 0.129484966168869693270611432679082, 0.0,
)  # fmt: skip
# Kernels of a density: more samples are thinned to so many evenly spaced order statistics, since the quadrature costs
# the square of their number. Chosen without tuning record; fewer would thin the tails.
MOST_SAMPLES = 512
# Sizes of the fault in deviations: from 0.03, where next to nothing is seen of it, to three million, powers of ten.
DECADES = (-1.5, 6.5)
PER_DECADE = 3
# Bits nearer to 0 or 1 are the quadrature's error.
ACCURACY = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Density:
    """The mean of Gaussian kernels, one per sample; a Gaussian is one kernel.

    Attributes
    ----------
    samples : (n,) centres of the kernels.
    bandwidths : (n,) standard deviation of each, h_i of (21).
    pilot_bandwidth : h of (24), before the local factors.
    exponent : a of (22), 0 where all kernels are alike.
    """

    samples: FloatArray
    bandwidths: FloatArray
    pilot_bandwidth: float
    exponent: float


def kernel_density(samples: FloatArray, *, exponent: float | None = 0.5, bandwidth: float | None = None) -> Density:
    """Return the adaptive kernel density of samples, (19) with (21)-(24).

    Parameters
    ----------
    samples : (n,) of any unit, three or more.
    exponent : a of (22), 0 for one bandwidth everywhere; None for the one of 0, 0.05 .. 1 with the
        largest leave-one-out likelihood (25).
    bandwidth : in place of the rule of thumb (24), in the samples' unit.

    Raises
    ------
    ValueError : too few samples, all of them equal, not finite, or a setting that is out of range.
    """
    samples = _checked(samples)
    spread = float(np.std(samples, ddof=1))
    low, high = np.percentile(samples, [25.0, 75.0])
    # (24); where half the samples are equal, the standard deviation alone is the spread.
    narrow = min(spread, (high - low) / 1.34) if high > low else spread
    h = float(0.9 * narrow * samples.size**-0.2) if bandwidth is None else bandwidth
    if not (np.isfinite(h) and h > 0.0):
        raise ValueError(f"bandwidth must be positive, got {h:g}")
    # (22) and (23): local factors of geometric mean 1, from the preliminary estimate with the own kernel included.
    alike = Density(samples=samples, bandwidths=np.full(samples.size, h), pilot_bandwidth=h, exponent=0.0)
    relative = log_density(alike, samples)
    relative = relative - np.mean(relative)
    if exponent is None:
        exponent = float(EXPONENTS[np.argmax([_left_out(samples, h * np.exp(-a * relative)) for a in EXPONENTS])])
    if not (np.isfinite(exponent) and exponent >= 0.0):
        raise ValueError(f"exponent must not be negative, got {exponent:g}")
    return _density(samples, h * np.exp(-exponent * relative), pilot_bandwidth=h, exponent=float(exponent))


def gaussian_density(samples: FloatArray) -> Density:
    """Return the Gaussian with the samples' mean and standard deviation.

    Raises
    ------
    ValueError : see `kernel_density`.
    """
    samples = _checked(samples)
    spread = float(np.std(samples, ddof=1))
    return _density(np.array([np.mean(samples)]), np.array([spread]), pilot_bandwidth=spread, exponent=0.0)


def log_density(density: Density, points: FloatArray) -> FloatArray:
    """Return the natural logarithm of the density at points of any shape; finite however far out."""
    points = np.asarray(points, dtype=np.float64)
    weights = -np.log(density.bandwidths)
    most = float(np.max(weights))
    logarithms = np.empty(points.size)
    for rows in _blocks(points.size, density.samples.size):
        off = (points.reshape(-1)[rows, None] - density.samples) / density.bandwidths
        logarithms[rows] = _log_sum_exp(-0.5 * off * off + (weights - most))
    return np.asarray(logarithms.reshape(points.shape) + (most - np.log(density.samples.size) - HALF_LOG_2_PI))


def draw(density: Density, n: int, *, rng: np.random.Generator) -> FloatArray:
    """Return (n,) independent values of the density."""
    kernel = rng.integers(density.samples.size, size=n)
    return np.asarray(density.samples[kernel] + density.bandwidths[kernel] * rng.standard_normal(n))


def convolve(density: Density, sd: float) -> Density:
    """Return the density of a value with an independent Gaussian one of mean 0 and deviation `sd` added."""
    if not (np.isfinite(sd) and sd >= 0.0):
        raise ValueError(f"a deviation must not be negative, got {sd:g}")
    wider = np.hypot(density.bandwidths, sd)
    pilot = float(np.hypot(density.pilot_bandwidth, sd))
    return _density(density.samples, wider, pilot_bandwidth=pilot, exponent=density.exponent)


def _checked(samples: FloatArray) -> FloatArray:
    samples = np.asarray(samples, dtype=np.float64)
    if samples.ndim != 1 or samples.size < FEWEST:
        raise ValueError(f"a density needs {FEWEST} samples or more in one dimension, got shape {samples.shape}")
    if not np.isfinite(samples).all():
        raise ValueError("samples must be finite, got NaN or infinite values; cut them first")
    if np.ptp(samples) <= 8.0 * EPS * np.max(np.abs(samples)):
        raise ValueError(f"samples must differ, got {samples.size} times {samples[0]:.6g}; they have no density")
    return samples


def _density(samples: FloatArray, bandwidths: FloatArray, *, pilot_bandwidth: float, exponent: float) -> Density:
    samples = samples.copy()
    for array in (samples, bandwidths):
        array.setflags(write=False)
    return Density(samples=samples, bandwidths=bandwidths, pilot_bandwidth=pilot_bandwidth, exponent=exponent)


def _left_out(samples: FloatArray, bandwidths: FloatArray) -> float:
    """Return the sum of the logarithms of (25), without the terms that do not depend on the bandwidths."""
    total = 0.0
    for rows in _blocks(samples.size, samples.size):
        off = (samples[rows, None] - samples) / bandwidths
        exponents = -0.5 * off * off - np.log(bandwidths)
        exponents[np.arange(len(exponents)), np.arange(samples.size)[rows]] = -np.inf
        total += float(np.sum(_log_sum_exp(exponents)))
    return total


def _log_sum_exp(exponents: FloatArray) -> FloatArray:
    """Return the logarithm of the sum of exponentials of each row, scaled by the largest only where that is needed."""
    total = np.sum(np.exp(exponents), axis=1)
    far = ~((total > SMALL) & (total < 1.0 / SMALL))
    total[far] = 1.0
    logarithms = np.log(total)
    if np.any(far):
        top = np.max(exponents[far], axis=1, keepdims=True)
        logarithms[far] = top[:, 0] + np.log(np.sum(np.exp(exponents[far] - top), axis=1))
    return np.asarray(logarithms)


def _blocks(n_points: int, n_kernels: int) -> Iterator[slice]:
    """Yield ranges of points whose distances to all kernels fit into the cache."""
    size = max(1, BLOCK // n_kernels)
    yield from (slice(start, start + size) for start in range(0, n_points, size))


def jensen_shannon_quadrature(p: Density, q: Density) -> float:
    """Return J(p, q) of (15) in bits, in [0, 1], to about 1e-10.

    Adaptive Gauss-Kronrod quadrature on panels that end where kernels do, so that none falls between two nodes.
    """
    # Centres and ends of the kernels of both, ascending, those close to the last left out.
    widths = np.concatenate([p.bandwidths, q.bandwidths])
    centres = np.concatenate([p.samples, q.samples])
    points = np.concatenate([centres - REACH * widths, centres, centres + REACH * widths])
    order = np.argsort(points, kind="stable")
    kept = [float(points[order[0]])]
    for point, width in zip(points[order].tolist(), np.tile(widths, 3)[order].tolist(), strict=True):
        if point - kept[-1] > CLOSE * width:
            kept.append(point)
    edges = np.array(kept)
    left, right = edges[:-1], edges[1:]
    nodes = np.concatenate([-np.array(NODES[:0:-1]), NODES])
    kronrod, gauss = (np.concatenate([w[:0:-1], w]) for w in (KRONROD, GAUSS))
    total = 0.0
    for bisections_left in range(ROUNDS, -1, -1):
        # The integral of (15) over each panel in nats, and its difference from the rule of seven nodes.
        half = 0.5 * (right - left)
        points = 0.5 * (left + right)[:, None] + half[:, None] * nodes
        log_p, log_q = log_density(p, points), log_density(q, points)
        log_mean = np.logaddexp(log_p, log_q) - np.log(2.0)
        height = 0.5 * (np.exp(log_p) * (log_p - log_mean) + np.exp(log_q) * (log_q - log_mean))
        rough = (half * np.abs(height @ (kronrod - gauss)) > TOLERANCE / edges.size) & (bisections_left > 0)
        total += float(np.sum((half * (height @ kronrod))[~rough]))
        if not np.any(rough):
            break
        middle = 0.5 * (left[rough] + right[rough])
        left, right = np.concatenate([left[rough], middle]), np.concatenate([middle, right[rough]])
    return float(np.clip(total / np.log(2.0), 0.0, 1.0))


def jensen_shannon_montecarlo(p: Density, q: Density, n: int, *, rng: np.random.Generator) -> tuple[float, float]:
    """Return J(p, q) in bits by (17) with its halves, and the standard error.

    The error has the variances where (18) prints second moments, and the factor 1/4 of the halves. The value is not
    forced into [0, 1]: it has no bias.

    Parameters
    ----------
    n : values drawn from each density, two or more.

    Raises
    ------
    ValueError : fewer than two.
    """
    if n < 2:
        raise ValueError(f"a standard error needs 2 values or more, got {n}")
    terms = []
    for mine, other in ((p, q), (q, p)):
        points = draw(mine, n, rng=rng)
        log_p = log_density(mine, points)
        # log(2 p / (p + q)), at most 1 bit.
        terms.append(1.0 + (log_p - np.logaddexp(log_p, log_density(other, points))) / np.log(2.0))
    value = 0.5 * sum(float(np.mean(term)) for term in terms)
    variance = 0.25 * sum(float(np.var(term, ddof=1)) / n for term in terms)
    return value, float(np.sqrt(variance))


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
    """Return the information of a window as a function of the size of a fault.

    Parameters
    ----------
    errors : prediction errors of the record without the fault, whitened between outputs, any shape and scale; where
        they are all alike (no noise) a Gaussian density is used.
    """
    errors = np.asarray(errors, dtype=np.float64).reshape(-1)
    spread = float(np.sqrt(np.mean(errors**2)))
    density = _thinned_density(errors / spread if spread > 0.0 else errors)
    density = density or Density(samples=np.zeros(1), bandwidths=np.ones(1), pilot_bandwidth=1.0, exponent=0.0)
    low, high = DECADES
    deviations = np.logspace(low, high, round((high - low) * PER_DECADE) + 1)
    bits = [jensen_shannon_quadrature(density, convolve(density, float(d))) for d in deviations]
    return Distinguishability(errors=density, deviations=deviations, bits=np.maximum.accumulate(bits))


def window_bits(known: Distinguishability, deviations: FloatArray) -> FloatArray:
    """Return the information at an array of sizes, 0 below the tabulated range and for NaN, 1 above it.

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
    without = _thinned_density(errors)
    present = [_thinned_density((errors + trace)[np.isfinite(trace)]) for trace in traces.T]
    bits = [jensen_shannon_quadrature(without, faulty) if without and faulty else np.nan for faulty in present]
    return np.array(bits, dtype=np.float64)


def _thinned_density(samples: FloatArray) -> Density | None:
    """Return the density of the samples, thinned where they are many; None where they have none."""
    if samples.size > MOST_SAMPLES:
        samples = np.sort(samples)[np.linspace(0, samples.size - 1, MOST_SAMPLES).round().astype(int)]
    try:
        return kernel_density(samples)
    except ValueError:
        return None
