"""One factorisation of a record, its inner products with a signature at every onset, profiles of a shape, and limits.

Regressors that no fault of the scanned channel touches (constant, inputs, lags of the other outputs) have the basis Q0,
called the base here. The outputs at lag 0 and the scanned channel's lags, less their projection on the base ("off the
base"), are Q1 R1. Lag i of the signature with onset tau is the shape started at tau + i, so that one row of a table per
sample serves all lags and onsets.

Lags are taken as differences: with D = 1 - q, q the delay, the columns are 1 at lag s, D at lag s - 1, D^2 at lags
s - 2 .. 0. This spans the same space, lag 0 stays the only column with the current sample, and bias and drift become
one ramp, one step and exact impulses, so that nothing cancels.

A fault m added to a record, and analysed without a fault term, leaves the residual sum of squares that the record
itself has at the magnitude -m. So the profile of the record at hand tells how large a fault could be without being
declared, the adaptation of the model to that fault included: dynamics that nearly integrate absorb a slow drift of any
size, and the profile is flat there, where a standard deviation from the curvature at its minimum is not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import numpy as np

from .. import TINY, ComplexArray, FloatArray, IntArray
from ..compiled import einsum, lapack
from ..lagged import lagged
from ..progress import Report, parts, silent
from .profile import CACHE_DOUBLES, ProfilePolynomial, log_ratio, minimise, profile_polynomial, screen
from .waveform import Waveform

PANEL = 32  # columns that LAPACK treats together: the speed only
# Below this share of the largest, a pivot of the scaled base is round-off: 1e5 times the precision of a double.
RANK_TOLERANCE = 1e-11
# White noise that noise-free outputs are taken to carry, relative to the rms of their part orthogonal to the base.
FLOOR = 1e-9
# A shape with no more nonzero samples than this is correlated by shifts, which are exact; others by FFT.
SPARSE = 4
# Orders s between the record's start and the first onset, and between the last and the record's end: an onset nearer
# than s to either has its minimum at an infinite magnitude.
STARTING, ENDING = 3, 2
# Onsets of a shape that are profiled exactly where only the largest statistic is asked for, and pairs of a sweep.
FINALISTS = 48
# Bound on a fault, in peak-to-peak ranges of its output (docs/theory.md, 9.2).
GENEROUS = 10.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """A record made ready for any shape and onset.

    Attributes
    ----------
    Q : (n_base + m, n_samples) rows of [Q0 Q1]' times the weights of the samples, zero in the first s samples;
        m = s + n_outputs.
    weights : (n_samples,) by which rows are multiplied, None for 1.
    W : (s + 1, m) rows of R1^-1 that belong to the scanned channel, lags s .. 0 in differences.
    n_base : rank of the base.
    order : s; n_outputs : of the record; degree : highest difference of the lag columns.
    rss0 : without a fault: the residual sum of squares, for several outputs the determinant of the residuals' products.
    span : peak to peak of the scanned channel.
    screened : statistics of the grids of frequencies that were screened.
    profiled : profiles that were made, by the shape and the onsets; tabulated : tables of the shape that was asked for
        last.
    """

    Q: FloatArray
    weights: FloatArray | None
    W: FloatArray
    n_base: int
    order: int
    n_outputs: int
    degree: int
    rss0: float
    span: float
    screened: dict[bytes, FloatArray] = field(init=False, repr=False, default_factory=dict)
    profiled: dict[int, Profile] = field(init=False, repr=False, default_factory=dict)
    tabulated: dict[int, ShapeTables] = field(init=False, repr=False, default_factory=dict)
    _spectra: dict[str, ComplexArray] = field(init=False, repr=False, default_factory=dict)
    _shares: dict[str, FloatArray] = field(init=False, repr=False, default_factory=dict)

    def spectrum(self, name: Literal["Q", "weights"]) -> ComplexArray:
        """Return the Fourier transform of the rows of Q, or of the squared weights, made once for all shapes."""
        if name not in self._spectra:
            rows = self.Q
            if name == "weights":
                assert self.weights is not None
                rows = self.weights[None] ** 2
            self._spectra[name] = np.fft.rfft(rows, padded_length(self.n_samples), axis=1)
        return self._spectra[name]

    def impulses(self) -> FloatArray:
        """Return the share (n_samples,) of the residuals that impulses in the samples 1 .. s after each explain.

        It is that of free coefficients of the lagged copies there, whatever the shape; 0 beyond the last such sample,
        and 1 where the impulses are explained by the regressors themselves.
        """
        if "impulses" not in self._shares:
            s, n_regressors = self.order, len(self.Q) - self.n_outputs
            squares = np.ones(self.n_samples) if self.weights is None else self.weights**2
            at = np.arange(self.n_samples - s)[:, None] + np.arange(1, s + 1)
            near = (self.Q.T / np.sqrt(squares)[:, None])[at]
            known, errors = near[..., :n_regressors], near[..., n_regressors:]
            free, vectors = np.linalg.eigh(np.eye(s) - known @ known.transpose(0, 2, 1))
            turned = vectors.transpose(0, 2, 1) @ errors
            lost = free < RANK_TOLERANCE
            explained = np.sum(turned**2 / np.where(lost, 1.0, free)[..., None], axis=(1, 2))
            self._shares["impulses"] = np.append(np.where(lost.any(axis=1), 1.0, explained), np.zeros(s))
        return self._shares["impulses"]

    @property
    def n_samples(self) -> int:
        """Samples of the record."""
        return int(self.Q.shape[1])

    @property
    def n_rows(self) -> int:
        """Rows of the regression."""
        return self.n_samples - self.order

    @property
    def degrees(self) -> list[int]:
        """The difference taken by each column, lags s .. 0."""
        return [min(j, self.degree) for j in range(self.order + 1)]


def prepare_scan(
    u: FloatArray,
    y: FloatArray,
    *,
    order: int,
    feedthrough: bool = True,
    channel: int = 0,
    weights: FloatArray | None = None,
    floor: float | None = None,
    nuisances: FloatArray | None = None,
) -> Scan:
    """Factorise a record for scanning faults in one of its outputs.

    Parameters
    ----------
    u : (n_samples, n_inputs), y : (n_samples, n_outputs).
    order : the number of lags s, at least 1.
    feedthrough : inputs act in the same sample too.
    channel : the output that may be faulty.
    weights : (n_samples,) by which rows are multiplied, None for 1.
    floor : standard deviation of a white noise the outputs are taken to carry besides their own, in the units of y;
        by default 1e-9 of each output's rms off the base. Without any, noise-free data divide zero by zero.
    nuisances : (n_samples - order, n) further regressors of the rows, None for none.

    Raises
    ------
    ValueError : shapes disagree, a value is not finite, or there are fewer rows than regressors.
    """
    u, y = np.asarray(u, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if u.ndim != 2 or y.ndim != 2 or len(u) != len(y):
        raise ValueError(f"u and y must be (n_samples, n_channels) of equal length, got {u.shape} and {y.shape}")
    if not (np.isfinite(u).all() and np.isfinite(y).all()):
        raise ValueError("u and y must be finite, got NaN or infinite values; repair or cut them first")
    if not 0 <= channel < y.shape[1]:
        raise ValueError(f"channel must lie in 0..{y.shape[1] - 1}, got {channel}")
    if order < 1 or len(y) - order <= 1 + (order + 1) * (u.shape[1] + y.shape[1]):
        raise ValueError(f"order must be at least 1 with more rows than regressors, got {order} for {len(y)} samples")
    y = y - y.mean(axis=0)
    others, n_others, degree = np.delete(y, channel, axis=1), y.shape[1] - 1, min(2, order)

    # Q0, an orthonormal basis of the base; directions lost in rounding are left out.
    base = np.hstack(
        [lagged(u, range(0 if feedthrough else 1, order + 1)), lagged(others, range(1, order + 1), first=order)]
    )
    if nuisances is not None:
        base = np.hstack([base, nuisances])
    base = np.hstack([np.ones((len(base), 1)), base - base.mean(axis=0)])
    rows = np.ones(len(base)) if weights is None else weights[order:]
    base *= rows[:, None]
    norms = np.linalg.norm(base, axis=0)
    base = base[:, norms > 0.0] / norms[norms > 0.0]
    n_columns = base.shape[1]
    packed, _, tau, _, _ = lapack.dgeqp3(base, lwork=2 * n_columns + PANEL * (n_columns + 1))
    diagonal = np.abs(np.diag(packed))
    Q0 = lapack.dorgqr(packed, tau, lwork=PANEL * n_columns)[0][:, diagonal > RANK_TOLERANCE * diagonal[0]]

    # Q1 and R1 of [lags s..1 | other outputs | lag 0], differenced and off Q0, with rows for the floor below.
    stacked = np.hstack([lagged(others, [0], first=order), lagged(y[:, [channel]], range(order, -1, -1))])
    stacked *= rows[:, None]
    off = stacked - Q0 @ (Q0.T @ stacked)
    rms = np.sqrt(np.mean(off**2, axis=0)) if floor is None else np.full(off.shape[1], floor / FLOOR)
    noise = np.diag(FLOOR * np.sqrt(len(off)) * np.maximum(rms, TINY**0.25))
    columns = np.vstack([stacked, noise])
    columns[:, n_others:] = difference(columns[:, n_others:].T, degree).T
    columns = columns[:, np.r_[n_others : n_others + order, :n_others, -1]]
    top = columns[: len(off)]
    for _ in range(2):  # once loses digits where the base explains nearly all
        top -= Q0 @ (Q0.T @ top)
    Q1, R1 = np.linalg.qr(columns)

    m = order + y.shape[1]
    Q = np.zeros((Q0.shape[1] + m, len(y)))
    Q[: -m or None, order:], Q[-m:, order:] = Q0.T * rows, Q1[: len(off)].T * rows
    return Scan(
        Q=Q,
        weights=weights,
        W=np.asarray(lapack.dtrtri(R1)[0])[np.r_[:order, m - 1]],
        n_base=Q0.shape[1],
        order=order,
        n_outputs=y.shape[1],
        degree=degree,
        rss0=float(np.prod(np.diag(R1)[order:] ** 2)),
        span=float(np.ptp(y[:, channel])),
    )


def difference(rows: FloatArray, degree: int) -> FloatArray:
    """Replace rows of lags s .. 0 by 1 at lag s, D at lag s - 1, ... D^degree at the others, D the first difference."""
    rows = rows.copy()
    for d in range(degree):
        rows[d + 1 :] = rows[d + 1 :] - rows[d:-1]
    return rows


# P, per difference 0..degree (n_base + m, n_samples): [Q0 Q1]' times a shape started at each sample. G, by the
# differences (a, b) of two lags and the samples d the second starts before the first, (n_samples,): their inner product
# off the base, at the first's start.
ShapeTables = tuple[tuple[FloatArray, ...], dict[tuple[int, int, int], FloatArray]]


def tabulate(scan: Scan, h: FloatArray) -> ShapeTables:
    """Return the tables of a shape h (n_samples,) that lasts to the end of the record, kept until another's are."""
    key = hash(h.tobytes())
    if key not in scan.tabulated:
        scan.tabulated.clear()
        scan.tabulated[key] = _tables(scan, h)
    return scan.tabulated[key]


def _tables(scan: Scan, h: FloatArray) -> ShapeTables:
    n, degrees, n_base = scan.n_samples, scan.degrees, scan.n_base
    P = correlations(scan, h)
    shapes = [np.diff(h, n=d, prepend=np.zeros(d)) for d in range(scan.degree + 1)]
    keys = list(dict.fromkeys((a, b, j) for i, a in enumerate(degrees) for j, b in enumerate(degrees[i:])))
    products = np.zeros((len(keys), n))
    for product, (a, b, d) in zip(products, keys, strict=True):
        product[: n - d] = shapes[a][: n - d] * shapes[b][d:]
    G = dict(zip(keys, _summed(scan, products), strict=True))
    for (a, b, d), table in G.items():
        table[:d] = 0.0
        table[d:] -= einsum("qk,qk->k", P[a][:n_base, d:], P[b][:n_base, : n - d])
    return P, G


@cache
def padded_length(n: int) -> int:
    """Return the least product of twos, threes and fives that is 2 n or more: a transform of that length is fast."""
    powers = range(2 * n.bit_length())
    return int(min(odd << ((2 * n - 1) // odd).bit_length() for i in powers for j in powers if (odd := 3**i * 5**j)))


def _summed(scan: Scan, products: FloatArray) -> FloatArray:
    """Return the sums (n_products, n) over k of the squared weights[k] times products[:, k - start] for all starts."""
    n = scan.n_samples
    if scan.weights is None:
        return np.ascontiguousarray(np.cumsum(products, axis=1)[:, ::-1])
    size = padded_length(n)
    sums = np.asarray(
        np.fft.irfft(scan.spectrum("weights") * np.conj(np.fft.rfft(products, size, axis=1)), size, axis=1)[:, :n]
    )
    for k in np.flatnonzero(np.count_nonzero(products, axis=1) <= SPARSE):
        sums[k] = _correlated(scan, "weights", products[k])[0]
    return sums


def correlations(scan: Scan, h: FloatArray) -> tuple[FloatArray, ...]:
    """Return P of the `ShapeTables` of a shape h (n_samples,)."""
    P = [_correlated(scan, "Q", np.diff(h, n=scan.degree, prepend=np.zeros(scan.degree)))]
    for _ in range(scan.degree):
        P.append(np.ascontiguousarray(np.cumsum(P[-1][:, ::-1], axis=1)[:, ::-1]))
    return tuple(P[::-1])


def _correlated(scan: Scan, name: Literal["Q", "weights"], h: FloatArray) -> FloatArray:
    """Return the sum over k of rows[:, k] h(k - start) for all starts, h zero beyond its end.

    Parameters
    ----------
    name : of the rows: those of Q, or the squared weights.
    """
    n, at = scan.n_samples, np.flatnonzero(h)
    if len(at) <= SPARSE:
        rows = scan.Q if name == "Q" else np.asarray(scan.weights)[None] ** 2
        total = np.zeros_like(rows)
        for k in at:
            total[:, : n - k] += h[k] * rows[:, k:]
        return total
    size = padded_length(n)
    spectrum = scan.spectrum(name) * np.conj(np.fft.rfft(h, size))
    return np.asarray(np.fft.irfft(spectrum, size, axis=1)[:, :n])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """The best magnitude of one shape at each onset.

    Attributes
    ----------
    onsets : (n_onsets,) samples.
    z : (n_onsets,) magnitudes; sd : (n_onsets,) from the curvature, NaN where there is none.
    rss : (n_onsets,) and rss0 without a fault: residual sums of squares, for several outputs the determinant of the
        residuals' products.
    statistic : (n_onsets,) n_rows log(rss0 / rss), never negative.
    """

    onsets: IntArray
    z: FloatArray
    sd: FloatArray
    rss: FloatArray
    rss0: float
    statistic: FloatArray

    @property
    def best(self) -> int:
        """Index of the largest statistic."""
        return int(np.argmax(self.statistic))

    @property
    def dispersion(self) -> float:
        """Mean of the statistic over the onsets, which is 1 for white noise; at least 1."""
        return max(1.0, float(np.mean(self.statistic)))

    def take(self, some: IntArray) -> Profile:
        """Return the profile at some of its onsets, (n_some,) indices."""
        columns = {name: getattr(self, name)[some] for name in ("onsets", "z", "sd", "rss", "statistic")}
        return Profile(rss0=self.rss0, **columns)


def default_onsets(scan: Scan) -> IntArray:
    """Return the onsets at which the minimum over z is well defined: 3 s from the start, 2 s before the end."""
    return np.arange(STARTING * scan.order, scan.n_samples - ENDING * scan.order + 1)


def magnitude_bound(scan: Scan, waveform: Waveform, lengths: IntArray) -> FloatArray:
    """Return the largest |z|, in samples of the waveform, of a fault that acts for `lengths` samples."""
    return largest_magnitude(scan, np.maximum.accumulate(np.abs(waveform.samples))[lengths - 1])


def largest_magnitude(scan: Scan, reach: FloatArray) -> FloatArray:
    """Return the largest |z| of shapes whose largest samples are `reach`."""
    return np.asarray(GENEROUS * scan.span / np.maximum(reach, TINY**0.25))


def scan_shape(scan: Scan, waveform: Waveform, onsets: IntArray | None = None, *, report: Report = silent) -> Profile:
    """Return the exact profile over the magnitude of a fault that lasts to the end of the record, made once.

    Parameters
    ----------
    scan : from `prepare_scan`.
    waveform : of the same number of samples, see `waveform`.
    onsets : samples, each in s..n_samples - s - 1; `default_onsets` if None.
    report : called with the fraction that is done.
    """
    onsets = default_onsets(scan) if onsets is None else np.asarray(onsets, dtype=np.intp)
    if waveform.samples.shape != (scan.n_samples,):
        raise ValueError(f"the shape has {len(waveform.samples)} samples, the record {scan.n_samples}")
    first, last = scan.order, scan.n_samples - scan.order - 1
    if onsets.size and not (first <= onsets.min() and onsets.max() <= last):
        raise ValueError(f"onsets must lie in {first}..{last}, got {onsets.min()}..{onsets.max()}")
    key = hash((waveform.samples.tobytes(), waveform.unit, onsets.tobytes()))
    if key not in scan.profiled:
        tables, bound = tabulate(scan, waveform.samples), magnitude_bound(scan, waveform, scan.n_samples - onsets)

        def block_minimum(block: slice) -> FloatArray:
            return minimise(stack_onsets(scan, tables, onsets[block]), bound[block])

        minimum = in_blocks(scan, len(bound), block_minimum, report)
        scan.profiled[key] = in_units(scan, waveform, onsets, minimum)
    report(1.0)
    return scan.profiled[key]


def largest_statistic(scan: Scan, waveform: Waveform, onsets: IntArray | None = None) -> float:
    """Return the largest statistic of `scan_shape` among the onsets that a screen at one magnitude ranks first."""
    onsets = default_onsets(scan) if onsets is None else onsets
    tables, bound = tabulate(scan, waveform.samples), magnitude_bound(scan, waveform, scan.n_samples - onsets)
    first = np.sort(np.argsort(_screened(scan, tables, onsets, bound))[:FINALISTS])
    return float(-scan.n_rows * minimise(stack_onsets(scan, tables, onsets[first]), bound[first])[1].min())


def screen_shape(scan: Scan, waveform: Waveform, onsets: IntArray) -> float:
    """Return the largest statistic over onsets (n_onsets,) at one magnitude each, at most that of `scan_shape`."""
    tables, bound = tabulate(scan, waveform.samples), magnitude_bound(scan, waveform, scan.n_samples - onsets)
    return float(-scan.n_rows * _screened(scan, tables, onsets, bound).min(initial=0.0))


def _screened(scan: Scan, tables: ShapeTables, onsets: IntArray, bound: FloatArray) -> FloatArray:
    return in_blocks(scan, len(bound), lambda b: screen(stack_onsets(scan, tables, onsets[b]), bound[b]))


def stack_onsets(scan: Scan, tables: ShapeTables, onsets: IntArray) -> ProfilePolynomial:
    """Return RSS over the magnitude at some onsets, from the tables of a shape."""
    return profile_polynomial(*inner_products(scan, tables, onsets), scan.W)


def inner_products(scan: Scan, tables: ShapeTables, onsets: IntArray) -> tuple[FloatArray, FloatArray]:
    """Gather C and S of `profile_polynomial` at some onsets from the tables of a shape."""
    (P, G), s, degrees = tables, scan.order, scan.degrees
    C = np.stack([P[a][scan.n_base :, onsets + s - j] for j, a in enumerate(degrees)], axis=1)
    S = np.empty((s + 1, s + 1, len(onsets)))
    for i, a in enumerate(degrees):
        for j in range(i, s + 1):
            S[i, j] = S[j, i] = G[a, degrees[j], j - i][onsets + s - i]
    return C, S


def in_blocks(scan: Scan, n: int, made: Callable[[slice], FloatArray], report: Report = silent) -> FloatArray:
    """Return (..., n) what is made of a long stack, in blocks that stay in the processor's cache."""
    size = max(1, CACHE_DOUBLES // (scan.order + scan.n_outputs) ** 2)
    return np.concatenate([made(slice(i, i + size)) for i, _ in parts(report, range(0, max(n, 1), size))], axis=-1)


def in_units(scan: Scan, waveform: Waveform, onsets: IntArray, minimum: FloatArray) -> Profile:
    """Return what `minimise` gives as a profile, magnitudes in their own unit instead of samples of the waveform."""
    z, F, curvature = minimum
    bent = np.where(curvature > 0.0, curvature, np.nan)
    return Profile(
        onsets=onsets,
        z=z / waveform.unit,
        sd=np.sqrt(2.0 / (bent * scan.n_rows)) / waveform.unit,
        rss=scan.rss0 * np.exp(F),
        rss0=scan.rss0,
        statistic=np.maximum(-scan.n_rows * F, 0.0),
    )


# Magnitudes tried, relative to the one that a parabola through the minimum gives; between them the root of the
# deviance, which is nearly linear in the magnitude, is interpolated.
GRID = np.array([0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.2, 3.5, 6.0, 12.0, 30.0, 100.0])
# Distances from the minimum in its standard deviations, times the root of the deviance asked for.
BESIDE = np.array([0.0, 0.5, 1.0, 1.5, 2.5])
# Faults larger than an error are counted up to so many times as large: what hides a larger one hides these as well.
SPAN = 10.0
# Logarithm of the largest likelihood ratio that is told from larger ones.
LARGEST_EXPONENT = 500.0


def profile_with_deviances(
    scan: Scan, waveform: Waveform, onsets: IntArray, magnitudes: FloatArray
) -> tuple[Profile, FloatArray]:
    """Return the exact profile of a shape, and the statistic by which a record disagrees with faults of +m and of -m.

    Parameters
    ----------
    onsets : (n_onsets,) samples.
    magnitudes : (n_magnitudes, n_onsets), m in the unit of the shape.

    Returns
    -------
    profile : over the onsets.
    deviances : (2, n_magnitudes, n_onsets) n_rows log(RSS(+m) / RSS(0)), and of -m.
    """
    tables, both = tabulate(scan, waveform.samples), np.concatenate([magnitudes, -magnitudes]) * waveform.unit
    bound = magnitude_bound(scan, waveform, scan.n_samples - onsets)

    def block_profile(block: slice) -> FloatArray:
        stack = stack_onsets(scan, tables, onsets[block])
        return np.concatenate([minimise(stack, bound[block]), log_ratio(stack, both[:, block])])

    made = in_blocks(scan, len(onsets), block_profile)
    return in_units(scan, waveform, onsets, made[:3]), scan.n_rows * made[3:].reshape(2, *magnitudes.shape)


def deviances(scan: Scan, waveform: Waveform, onsets: IntArray, magnitudes: FloatArray) -> FloatArray:
    """Return the second of `profile_with_deviances` alone."""
    tables, both = tabulate(scan, waveform.samples), np.concatenate([magnitudes, -magnitudes]) * waveform.unit

    def block_ratios(block: slice) -> FloatArray:
        return log_ratio(stack_onsets(scan, tables, onsets[block]), both[:, block])

    return scan.n_rows * in_blocks(scan, len(onsets), block_ratios).reshape(2, *magnitudes.shape)


def undeclared_magnitudes(
    scan: Scan, waveform: Waveform, profile: Profile, *, power: float, suspicion: float, doubt: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the magnitudes that would be declared, that would be suspected, and that the record does not admit.

    Parameters
    ----------
    profile : of the shape at the onsets that are asked for.
    power, suspicion : statistics that a fault needs to be declared, and to be suspected, with the wanted power.
    doubt : statistic by which the record must disagree with a magnitude to exclude it.

    Returns
    -------
    Three arrays (n_onsets,): the first magnitude from which on every larger one reaches `power`, and `suspicion`, in
    the mean of both signs, and the first from which on both signs reach `doubt` beyond the best magnitude; infinite
    where none does.
    """
    seen = np.isfinite(profile.sd)
    linear = np.where(seen, profile.sd, 0.0)
    bound = magnitude_bound(scan, waveform, scan.n_samples - profile.onsets) / waveform.unit
    first = np.where(seen, np.sqrt(power) * linear, bound)
    # Not held within the scan's bound on magnitudes: the span of a record with such a fault would be larger.
    m = GRID[:, None] * np.maximum(first, 1e-9 * bound)
    # Beside the best magnitude, which a grid would step over where a fault is in the record.
    beside = np.abs(profile.z) + BESIDE[:, None] * np.sqrt(doubt) * linear
    m = np.sort(np.vstack([m, np.maximum(beside, m[:1])]), axis=0)
    plus, minus = deviances(scan, waveform, profile.onsets, m)
    reached = 0.5 * (plus + minus)
    against = np.minimum(plus, minus) + profile.statistic
    needed = np.repeat([power, suspicion, doubt], m.shape[1])
    declared, suspected, admitted = np.split(
        _from_there_on(np.tile(m, 3), np.hstack([reached, reached, against]), needed), 3
    )
    return declared, suspected, admitted


def _from_there_on(m: FloatArray, deviance: FloatArray, needed: FloatArray) -> FloatArray:
    """Return the first magnitude from which on the deviance is at least `needed`, interpolated in its root."""
    root, wanted = np.sqrt(np.maximum(deviance, 0.0)), np.sqrt(needed)
    below = root < wanted
    last = len(m) - 1 - np.argmax(below[::-1], axis=0)
    every = np.arange(m.shape[1])
    none, all_ = ~below.any(axis=0), below[-1]
    k = np.minimum(last, len(m) - 2)
    low, high = root[k, every], root[k + 1, every]
    part = np.divide(wanted - low, high - low, out=np.ones_like(low), where=high > low)
    magnitude = m[k, every] + np.clip(part, 0.0, 1.0) * (m[k + 1, every] - m[k, every])
    # Below the smallest magnitude tried the root falls in proportion.
    small = m[0] * np.divide(wanted, root[0], out=np.ones_like(root[0]), where=root[0] > 0.0)
    return np.where(all_, np.inf, np.where(none, small, magnitude))


def likelihood_ratios(both_signs: FloatArray, *, dispersion: float) -> FloatArray:
    """Return (n_magnitudes, n_onsets) how much likelier a record is with a fault than without, the mean of both signs.

    Parameters
    ----------
    both_signs : (2, n_magnitudes, n_onsets) see `deviances`.
    dispersion : by which deviances are divided, 1 for white errors.
    """
    exponents = np.clip(-0.5 * both_signs / dispersion, -LARGEST_EXPONENT, LARGEST_EXPONENT)
    return np.asarray(np.exp(exponents).mean(axis=0))


def mean_ratios(errors: FloatArray, ratios: FloatArray) -> FloatArray:
    """Return the mean likelihood ratio of the faults of each size up to `SPAN` times as large, at an unknown onset.

    It is the Bayes factor of such a fault against none where onsets are equally likely, and so are equal ratios of
    sizes.

    Parameters
    ----------
    errors : (n_errors,) sizes at equal ratios.
    ratios : (n_errors, n_onsets).

    Returns
    -------
    (n_kept,) of the first errors, those whose `SPAN` is within `errors`.
    """
    log_error = np.log(errors)
    width = int(np.ceil(np.log(SPAN) / (log_error[1] - log_error[0]) - 1e-9))
    mean = ratios.mean(axis=1)
    weights = np.ones(width + 1)
    weights[[0, -1]] = 0.5  # the trapezoidal rule
    return np.convolve(mean, weights / width, mode="valid")


def excluded_error(errors: FloatArray, means: FloatArray, most: float) -> float:
    """Return the least error from which on the mean likelihood ratio is at most `most`, infinite where there is none.

    Parameters
    ----------
    errors : (n_errors,); means : (n_kept,) of the first of them, see `mean_ratios`.
    """
    above = np.flatnonzero(means > most)
    if above.size == 0:
        return float(errors[0])
    last = int(above[-1])
    if last == len(means) - 1:
        return float("inf")
    high, low = np.log(means[last]), np.log(max(float(means[last + 1]), TINY))
    part = (high - np.log(most)) / (high - low)
    return float(errors[last] * (errors[last + 1] / errors[last]) ** part)
