"""Sines of many frequencies and onsets, screened together.

From s samples after its onset on, a lagged copy of a sine of angle w is the imaginary part of a number times
exp(i w k); before that it is few numbers, which the onset does not change. So running sums of the record's rows times
exp(i w k), from each sample on, give the inner products of a sine with the record for all onsets.

What tells an onset are the samples right after it, which may hold anything but are the same for all frequencies, and
the sine and cosine from there on, which change little with the onset. The share of the residuals that both explain says
at which onsets a sine is worth its screen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import ComplexArray, FloatArray, IntArray
from ..progress import Report, parts, silent
from .profile import CACHE_DOUBLES, profile_polynomial, screen
from .scan import Scan, difference, largest_magnitude

# Numbers of the running sums that are made together, 1.6 MB: more leave the processor's cache, and take a third longer.
TOGETHER = 100_000
# Onsets at which a sine is screened, those that promise most.
MOST_ONSETS = 64
# Logarithm of the ratio of what is left of the record from one border to the next, at which sine and cosine are known.
CLOSER = 0.05
# A Gram matrix whose smallest eigenvalue is below this share of its trace is rounding.
ROUNDING = 1e-9


def screen_at(scan: Scan, frequencies: FloatArray, onsets: Sequence[IntArray], report: Report = silent) -> FloatArray:
    """Return the largest screened statistic (n_frequencies,) of each sine over its onsets, 0 where it has none.

    Of many onsets those that promise most are screened.

    Parameters
    ----------
    scan : from `prepare_scan`.
    frequencies : (n_frequencies,) cycles per sample; onsets : per frequency, samples.
    report : called with the fraction that is done.
    """
    lowest, several = np.zeros(len(frequencies)), max(1, TOGETHER // scan.Q.size)
    most = max(1, CACHE_DOUBLES // (scan.order + scan.n_outputs) ** 2)
    for first, _ in parts(report, range(0, len(frequencies), several)):
        angles, at = 2.0 * np.pi * frequencies[first : first + several], onsets[first : first + several]
        sines = Sines(scan, angles)
        at = [
            sines.most_promising(k, candidates) if len(candidates) > MOST_ONSETS else candidates
            for k, candidates in enumerate(at)
        ]
        k, onset = np.repeat(np.arange(len(at)), [len(candidates) for candidates in at]), np.concatenate(at)
        for some in (slice(i, i + most) for i in range(0, len(k), most)):
            F = screen(profile_polynomial(*sines.inner_products(k[some], onset[some]), scan.W), sines.bound[k[some]])
            np.minimum.at(lowest, first + k[some], F)
    return -scan.n_rows * lowest


class Sines:
    """Sines of some angles, (n_angles,) radians per sample, and their inner products with a record.

    `tables` has, per difference, (n_base + m, n_angles * n_samples) [Q0 Q1]' times the sine that starts at each sample,
    and `bound`, (n_angles,), the largest magnitude of each.
    """

    def __init__(self, scan: Scan, angles: FloatArray) -> None:
        n, s = scan.n_samples, scan.order
        self.scan = scan
        turning = np.exp(1j * np.outer(angles, np.arange(n)))
        self.bound = largest_magnitude(scan, np.abs(turning.imag).max(axis=1))
        sums = np.cumsum((scan.Q[:, None] * turning)[..., ::-1], axis=-1)[..., ::-1]
        self.tables = [sums.imag * turning.real - sums.real * turning.imag]
        for _ in range(scan.degree):
            # A shape less the same one sample later.
            self.tables.append(self.tables[-1].copy())
            self.tables[-1][..., :-1] -= self.tables[-2][..., 1:]
        self.tables = [table.reshape(len(scan.Q), -1) for table in self.tables]
        squares = np.ones(n) if scan.weights is None else scan.weights**2
        self.squares, self.remaining = squares, np.cumsum(squares[::-1])[::-1]
        self.doubled = np.cumsum((squares * turning**2)[:, ::-1], axis=1)[:, ::-1]
        self.turning = turning
        left = n * np.exp(-CLOSER * np.arange(1 + int(np.log(n) / CLOSER)))
        self.borders = np.unique((n - left).astype(np.intp))
        self.steady_share = self._explained_by_both(sums[..., self.borders])
        # Copies at lags s .. 0, differenced: the difference of exp(i w k) is exp(i w k) (1 - exp(-i w)).
        lags, degrees = np.arange(s, -1, -1), np.array(scan.degrees)
        turned, half = angles[:, None], 0.5 * angles[:, None]
        self.steady = np.exp(-1j * turned * (lags + 0.5 * degrees)) * (2j * np.sin(half)) ** degrees
        # The copies in the samples 1 .. s - 1 after the onset, (n_angles, s - 1, s + 1).
        since = np.arange(1, s)[:, None] - lags
        copies = np.where(since < 0, 0.0, np.sin(turned[..., None] * since))
        self.early = difference(copies.transpose(2, 0, 1), scan.degree).transpose(1, 2, 0)

    def _explained_by_both(self, sums: ComplexArray) -> FloatArray:
        """Return the share (n_angles, n_borders) of the residuals that sine and cosine from a border on explain."""
        n_regressors = len(self.scan.Q) - self.scan.n_outputs
        known, errors = sums[:n_regressors], sums[n_regressors:]
        total, doubled = self.remaining[self.borders], self.doubled[:, self.borders]
        cosine = 0.5 * (total + doubled.real) - np.einsum("rkb,rkb->kb", known.real, known.real)
        sine = 0.5 * (total - doubled.real) - np.einsum("rkb,rkb->kb", known.imag, known.imag)
        both = 0.5 * doubled.imag - np.einsum("rkb,rkb->kb", known.real, known.imag)
        determinant = cosine * sine - both**2
        sound = determinant > ROUNDING * (cosine + sine) ** 2
        explained = errors.real**2 * sine + errors.imag**2 * cosine - 2.0 * errors.real * errors.imag * both
        return np.where(sound, explained.sum(axis=0) / np.where(sound, determinant, 1.0), 1.0)

    def most_promising(self, k: int, onsets: IntArray) -> IntArray:
        """Return `MOST_ONSETS` of the onsets of a sine, or as many as there are."""
        if len(onsets) <= MOST_ONSETS:
            return onsets
        border = np.searchsorted(self.borders, onsets, side="right") - 1
        share = self.scan.impulses()[onsets] + self.steady_share[k, border]
        return onsets[np.sort(np.argpartition(-share, MOST_ONSETS)[:MOST_ONSETS])]

    def inner_products(self, k: IntArray, onset: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return C and S of `profile_polynomial` for pairs (n_pairs,) of angle and onset."""
        scan, s = self.scan, self.scan.order
        begin = onset + s
        C = np.empty((len(scan.Q), s + 1, len(k)))
        for j, degree in enumerate(scan.degrees):
            C[:, j] = np.take(self.tables[degree], k * scan.n_samples + begin - j, axis=1)
        turned = (self.steady[k] * np.conj(self.turning[k, onset])[:, None]).T
        common, changing = self.remaining[begin], self.doubled[k, begin]
        early = self.early[k].transpose(1, 2, 0)
        weights = self.squares[onset + np.arange(1, s)[:, None]]
        S = np.empty((s + 1, s + 1, len(k)))
        for i in range(s + 1):
            steady = 0.5 * np.real(turned[i] * (np.conj(turned[i:]) * common - turned[i:] * changing))
            steady += np.einsum("ln,ljn->jn", weights * early[:, i], early[:, i:])
            steady -= np.einsum("qn,qjn->jn", C[: scan.n_base, i], C[: scan.n_base, i:])
            S[i, i:] = S[i:, i] = steady
        return C[scan.n_base :], S
