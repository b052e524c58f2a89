"""Sines at many frequencies and onsets, screened only where a bound says that they may stand out.

The lagged copies of a sine of angle w from onset tau span s - 1 impulses right after the onset, and sine and cosine of
w from tau + s on. Three relaxations of the statistic follow, each cheaper than the statistic itself; none is ever
smaller, so a sine whose bound is below the statistic that is asked for need not be screened (docs/theory.md, 9.3).

1. Let the signature's lags take any coefficients. The share of the residuals that they explain is at most that of the
   impulses, which is the same for all frequencies, plus that of sine and cosine, over 1 - c, c the cosine between both.
2. What sine and cosine have off the regressors changes slowly with the onset: it is known at the borders of blocks, and
   a bound on it in between.
3. The coefficients are not free: they are the dynamics [v; 1] times the magnitude. A change v of the dynamics costs
   |v|^2, so that a sine can reach the statistic that is asked for with a small v only, and what it explains differs
   little from what it explains at v = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import BoolArray, FloatArray, IntArray
from ..progress import Report, parts, silent
from .profile import CACHE_DOUBLES, profile_polynomial, screen
from .scan import Scan, default_onsets, in_blocks, inner_products, largest_magnitude, magnitude_bound, tabulate
from .waveform import sine

ComplexArray = NDArray[np.complex128]

# Samples between borders: more make the bounds of short oscillations loose, fewer cost time and memory.
BLOCK = 16
# Frequencies that are bounded together, so that what is known at the borders takes some 200 MB at 20 000 samples.
TOGETHER = 32
# Where more than this share of the onsets of a sine have to be screened, tables of all onsets are made: an onset then
# takes a third to a fifth of the time of one by itself (25 to 105 rows, 1250 and 3000 samples).
CROWDED = 0.3
# A Gram matrix whose smallest eigenvalue is below this share of its trace, or a share of the residuals this close to 1,
# is rounding: no bound follows from it.
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SineScreen:
    """What the bounds of all frequencies have in common; impulses are those of samples 1..s - 1 after an onset.

    Attributes
    ----------
    onsets : (n_onsets,) all that may be asked for.
    rows : (n_blocks * BLOCK, n_base + m) rows of the record's `Q`, zeros after its end.
    squares : (n_blocks * BLOCK,) squared weights; remaining : (n_blocks * BLOCK + 1,) their sums from each sample on.
    impulses : (n_onsets,) share of the residuals that the impulses explain off the regressors.
    leverage : (n_onsets,) largest share of an impulse that the regressors explain; own_leverage : that the scanned
        channel's lags explain.
    """

    scan: Scan
    onsets: IntArray
    rows: FloatArray
    squares: FloatArray
    remaining: FloatArray
    impulses: FloatArray
    leverage: FloatArray
    own_leverage: FloatArray

    def statistics(
        self, frequencies: FloatArray, allowed: Sequence[IntArray], above: float, report: Report = silent
    ) -> FloatArray:
        """Return the largest screened statistic of each sine where it exceeds `above`, elsewhere 0.

        Parameters
        ----------
        frequencies : (n_frequencies,) cycles per sample.
        allowed : per frequency, indices of the `onsets` that are asked for.
        above : statistic; the lower it is, the more sines have to be screened.
        report : called with the fraction that is done.
        """
        found = np.zeros(len(frequencies))
        for first, _ in parts(report, range(0, len(frequencies), TOGETHER)):
            some = slice(first, first + TOGETHER)
            within = np.zeros((len(self.onsets), len(frequencies[some])), dtype=bool)
            for k, indices in enumerate(allowed[some]):
                within[indices, k] = True
            onset, of = (np.asarray(index) for index in np.nonzero(within))
            sines = Sines.at(self, frequencies[some])
            likely = sines.may_exceed(onset, of, above)
            crowded = np.bincount(of[likely], minlength=within.shape[1]) > CROWDED * within.sum(axis=0)
            several = (first + np.flatnonzero(crowded)).tolist()
            found[several] = screen_tabulated(
                self.scan, frequencies[several].tolist(), [self.onsets[allowed[k]] for k in several]
            )
            likely &= ~crowded[of]
            if likely.any():
                np.maximum.at(found, first + of[likely], sines.screened(onset[likely], of[likely]))
        return np.where(found > above, found, 0.0)


def screen_tabulated(
    scan: Scan, frequencies: Sequence[float], onsets: Sequence[IntArray], report: Report = silent
) -> FloatArray:
    """Return the largest screened statistic of each sine over its onsets, of which there are some, by tables.

    Short stacks of several sines are screened as one.

    Parameters
    ----------
    frequencies : (n_frequencies,) cycles per sample; onsets : per frequency, samples.
    report : called with the fraction that is done.
    """
    most = max(1, CACHE_DOUBLES // (scan.order + scan.n_outputs) ** 2)
    lowest = np.zeros(len(frequencies))
    stacked: list[tuple[int, tuple[FloatArray, FloatArray], FloatArray]] = []
    waiting = 0

    def screen_stacked() -> None:
        C, S = (np.concatenate([products[i] for _, products, _ in stacked], axis=-1) for i in range(2))
        bounds = [bound for *_, bound in stacked]
        F = screen(profile_polynomial(C, S, scan.W), np.concatenate(bounds))
        begins = np.cumsum([0, *map(len, bounds[:-1])])
        np.minimum.at(lowest, [k for k, *_ in stacked], np.minimum.reduceat(F, begins))

    for (k, (frequency, at)), _ in parts(report, list(enumerate(zip(frequencies, onsets, strict=True)))):
        waveform = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
        tables, bound = tabulate(scan, waveform.samples), magnitude_bound(scan, waveform, scan.n_samples - at)
        for some in (slice(first, first + most) for first in range(0, len(at), most)):
            if stacked and waiting + len(bound[some]) > most:
                screen_stacked()
                stacked, waiting = [], 0
            stacked.append((k, inner_products(scan, tables, at[some]), bound[some]))
            waiting += len(bound[some])
    if stacked:
        screen_stacked()
    return -scan.n_rows * lowest


def prepare_screen(scan: Scan) -> SineScreen:
    """Return what the bounds of all frequencies have in common."""
    n, s, onsets = scan.n_samples, scan.order, default_onsets(scan)
    n_regressors = len(scan.Q) - scan.n_outputs
    length = BLOCK * (1 + -(-n // BLOCK))
    rows, squares = np.zeros((length, len(scan.Q))), np.zeros(length)
    rows[:n], squares[:n] = scan.Q.T, 1.0 if scan.weights is None else scan.weights**2
    at = onsets[:, None] + np.arange(1, s)
    size = np.sqrt(squares[at])
    near = rows[at] / size[:, :, None]
    known, own, errors = near[..., :n_regressors], near[..., scan.n_base : n_regressors], near[..., n_regressors:]
    hat = known @ known.transpose(0, 2, 1)
    leverage, own_leverage = _largest_eigenvalue(hat), _largest_eigenvalue(own @ own.transpose(0, 2, 1))
    impulses = np.ones(len(onsets))
    sound = leverage < 1.0 - ROUNDING
    if s > 1:
        solved = np.linalg.solve(np.eye(s - 1) - hat[sound], errors[sound])
        impulses[sound] = np.einsum("nir,nir->n", errors[sound], solved)
    else:
        impulses[:] = 0.0
    return SineScreen(
        scan=scan,
        onsets=onsets,
        rows=rows,
        squares=squares,
        remaining=np.append(np.cumsum(squares[::-1])[::-1], 0.0),
        impulses=impulses,
        leverage=leverage,
        own_leverage=own_leverage,
    )


def _largest_eigenvalue(matrices: FloatArray) -> FloatArray:
    """Return the largest eigenvalue (n,) of symmetric matrices (n, k, k), 0 for k = 0."""
    if not matrices.shape[1]:
        return np.zeros(len(matrices))
    return np.asarray(np.linalg.eigvalsh(matrices)[:, -1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sines:
    """Sines of some frequencies: correlations with the record at the borders, and their lagged copies.

    Methods take pairs of onset and frequency, (n_pairs,) indices of the screen's `onsets` and of the frequencies.

    Attributes
    ----------
    angles : (n_frequencies,) radians per sample.
    turning : (n_blocks * BLOCK, n_frequencies) exp(i w k).
    correlations : (n_blocks, n_frequencies, n_base + m) sums of rows times exp(i w k) from each border on.
    doubled : (n_blocks, n_frequencies) sums of squared weights times exp(2 i w k).
    steady : (n_frequencies, s + 1) from s samples after the onset on, a lagged copy is the imaginary part of this times
        exp(i w (k - onset)).
    early : (n_frequencies, s - 1, s + 1) the lagged copies in the samples 1..s - 1 after the onset.
    """

    screen: SineScreen
    angles: FloatArray
    turning: ComplexArray
    correlations: ComplexArray
    doubled: ComplexArray
    steady: ComplexArray
    early: FloatArray

    @classmethod
    def at(cls, screen: SineScreen, frequencies: FloatArray) -> Sines:
        scan, angles = screen.scan, 2.0 * np.pi * frequencies
        n_rows, n_frequencies, n_blocks = screen.rows.shape[1], len(angles), len(screen.rows) // BLOCK
        within = np.exp(1j * np.outer(np.arange(BLOCK), angles))
        borders = np.exp(1j * np.outer(BLOCK * np.arange(n_blocks), angles))
        parts_of_both = np.hstack([within.real, within.imag])
        blocks = np.ascontiguousarray(screen.rows.reshape(n_blocks, BLOCK, n_rows).transpose(0, 2, 1))
        sums = (blocks.reshape(-1, BLOCK) @ parts_of_both).reshape(n_blocks, n_rows, 2 * n_frequencies)
        correlations = (sums[..., :n_frequencies] + 1j * sums[..., n_frequencies:]) * borders[:, None]
        doubled = (screen.squares.reshape(n_blocks, BLOCK) @ within**2) * borders**2
        # Copies at lags s .. 0, differenced: the difference of exp(i w k) is exp(i w k) (1 - exp(-i w)).
        lags, degrees = np.arange(scan.order, -1, -1), np.array(scan.degrees)
        turned, half = angles[:, None], 0.5 * angles[:, None]
        steady = np.exp(-1j * turned * (lags + 0.5 * degrees)) * (2j * np.sin(half)) ** degrees
        since = np.arange(1, scan.order)[:, None] - lags
        copies = [
            np.where(since < 0, 0.0, np.sin(turned[..., None] * since)),
            np.where(since < 1, 0.0, 2.0 * np.sin(half)[..., None] * np.cos(turned[..., None] * (since - 0.5))),
            np.where(since < 1, 0.0, -4.0 * np.sin(half)[..., None] ** 2 * np.sin(turned[..., None] * (since - 1)))
            + np.where(since == 1, np.sin(turned)[..., None], 0.0),
        ]
        return cls(
            screen=screen,
            angles=angles,
            turning=(borders[:, None] * within).reshape(-1, n_frequencies),
            correlations=np.cumsum(correlations[::-1], axis=0)[::-1].transpose(0, 2, 1),
            doubled=np.cumsum(doubled[::-1], axis=0)[::-1],
            steady=steady,
            early=np.choose(degrees, copies),
        )

    def may_exceed(self, onset: IntArray, k: IntArray, above: float) -> BoolArray:
        """Return whether sines (n_pairs,) may have a statistic above `above`; where not, none of any magnitude has."""
        screen, scan = self.screen, self.screen.scan
        n_regressors, wanted = len(scan.Q) - scan.n_outputs, -np.expm1(-above / scan.n_rows)

        # At the borders.
        cosine, sine, both, explained_by_all, explained_by_own = self._at_borders()
        middle, half = 0.5 * (cosine + sine), np.hypot(0.5 * (cosine - sine), both)
        smallest = middle - half
        sound = smallest > ROUNDING * screen.remaining[:-1:BLOCK, None]
        root = np.sqrt(np.where(sound, smallest, 1.0))
        determinant = np.where(sound, cosine * sine - both**2, 1.0)

        # From the nearest border to the first steady sample.
        begin = screen.onsets[onset] + scan.order
        border = (begin + BLOCK // 2) // BLOCK
        there = border, k
        change = np.sqrt(np.abs(screen.remaining[begin] - screen.remaining[border * BLOCK])) / root[there]
        left = np.maximum(1.0 - change, ROUNDING)
        leverage = screen.leverage[onset]
        free = np.maximum(1.0 - leverage, ROUNDING)
        explained = np.sqrt(explained_by_all)[there] / root[there] + change
        angle = np.sqrt(leverage / free) * explained / left
        apart = np.maximum(1.0 - angle, ROUNDING)

        # Relaxation 1 and 2: the share that free coefficients explain.
        steady, errors = np.zeros(len(k)), []
        for row in range(n_regressors, len(scan.Q)):
            from_here = np.cumsum((screen.rows[:, [row]] * self.turning)[::-1], axis=0)[::-1][begin, k]
            errors.append(from_here)
            steady = steady + (
                from_here.real**2 * sine[there]
                + from_here.imag**2 * cosine[there]
                - 2.0 * from_here.real * from_here.imag * both[there]
            )
        share = (screen.impulses[onset] + steady / determinant[there] / left**2) / apart
        bounded = sound[there] & (change < 1.0) & (angle < 1.0) & (leverage < 1.0 - ROUNDING) & (share < 1.0)
        likely: BoolArray = ~bounded | (share > wanted)
        if scan.n_outputs > 1:
            return likely

        # Relaxation 3, where that did not suffice: dynamics within |v| <= far.
        at = np.flatnonzero(likely & bounded)
        onset, k, there = onset[at], k[at], (border[at], k[at])
        share, left, apart, change = share[at], left[at], apart[at], change[at]
        of_own = (np.sqrt(explained_by_own)[there] / root[there] + change) / left
        tangent = np.sqrt((of_own**2 + screen.own_leverage[onset] / free[at]) / apart)
        far = np.sqrt((share - wanted) * (1.0 + tangent**2)) + tangent * np.sqrt(share)

        squares = cosine[there], sine[there], both[there]
        size, explained_most = self._explained(onset, k, errors[0][at], squares, change=change, apart=apart, far=far)
        likely[at] = (size <= 0.0) | (explained_most**2 >= wanted * np.maximum(size, 0.0) ** 2)
        return likely

    def _at_borders(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return what cosine and sine are from each border on, each (n_blocks, n_frequencies).

        Their squares and their product off the regressors, and the squares of both that all regressors and that
        the lags of the scanned channel explain.
        """
        screen, scan = self.screen, self.screen.scan
        known = self.correlations[..., : len(scan.Q) - scan.n_outputs]
        of_cosine, of_sine, of_both = (
            np.einsum("bfj,bfj->bf", a, b)
            for a, b in ((known.real, known.real), (known.imag, known.imag), (known.real, known.imag))
        )
        own = known[..., scan.n_base :]
        explained_by_own = np.einsum("bfj,bfj->bf", own.real, own.real) + np.einsum("bfj,bfj->bf", own.imag, own.imag)
        remaining = screen.remaining[:-1:BLOCK, None]
        cosine = 0.5 * (remaining + self.doubled.real) - of_cosine
        sine = 0.5 * (remaining - self.doubled.real) - of_sine
        return cosine, sine, 0.5 * self.doubled.imag - of_both, of_cosine + of_sine, explained_by_own

    def _explained(
        self,
        onset: IntArray,
        k: IntArray,
        error: ComplexArray,
        squares: tuple[FloatArray, FloatArray, FloatArray],
        *,
        change: FloatArray,
        apart: FloatArray,
        far: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the least size of signatures, and the most that they explain, with dynamics within |v| <= far.

        Parameters
        ----------
        error : (n_pairs,) sums of the residual times exp(i w k) from the first steady sample on.
        squares : (n_pairs,) of cosine, of sine and their product at the nearest border, see `_at_borders`.
        change : (n_pairs,) from that border to the first steady sample; apart : 1 - c of relaxation 1.
        """
        screen, scan = self.screen, self.screen.scan
        early, response = self.early @ scan.W, self.steady @ scan.W
        turned = response[k] * np.conj(self.turning[screen.onsets[onset], k])[:, None]
        correlated = np.imag(turned * error[:, None])
        if scan.order > 1:
            after = screen.onsets[:, None] + np.arange(1, scan.order)
            near, weights = screen.rows[after, -1], screen.squares[after]
            for f in np.unique(k):
                of_f = k == f
                correlated[of_f] += near[onset[of_f]] @ early[f]
            at_zero = np.einsum("pl,pl->p", weights[onset], early[k, :, -1] ** 2)
            spectral = np.linalg.norm(early[..., :-1], ord=2, axis=(1, 2)) ** 2
            of_change = weights.max(axis=1)[onset] * spectral[k]
        else:
            at_zero = of_change = np.zeros(len(onset))
        a, b, c = squares
        power = turned.imag**2 * a[:, None] + turned.real**2 * b[:, None] + 2.0 * turned.imag * turned.real * c[:, None]
        left, free = np.maximum(1.0 - change, ROUNDING), np.maximum(1.0 - screen.leverage[onset], ROUNDING)
        at_zero = apart * (free * at_zero + left**2 * power[:, -1])
        of_change = (2.0 - apart) * (of_change + (1.0 + change) ** 2 * power[:, :-1].sum(axis=1))
        size = np.sqrt(at_zero) - far * np.sqrt(of_change)
        return size, np.abs(correlated[:, -1]) + far * np.linalg.norm(correlated[:, :-1], axis=1)

    def screened(self, onset: IntArray, k: IntArray) -> FloatArray:
        """Return the screened statistic (n_pairs,) of sines."""
        screen_of, scan = self.screen, self.screen.scan
        reach = np.abs(np.sin(np.outer(np.arange(scan.n_samples), self.angles)))
        np.maximum.accumulate(reach, axis=0, out=reach)
        bound = largest_magnitude(scan, reach[scan.n_samples - 1 - screen_of.onsets[onset], k])

        def screened(some: slice) -> FloatArray:
            C, S = self.products(onset[some], k[some])
            return screen(profile_polynomial(C[scan.n_base :], S, scan.W), bound[some])

        return -scan.n_rows * in_blocks(scan, len(bound), screened)

    def products(self, onset: IntArray, k: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the inner products of the lagged copies of sines.

        Returns
        -------
        C : (n_base + m, s + 1, n_pairs) with [Q0 Q1]; S : (s + 1, s + 1, n_pairs) with each other, off the base.
        """
        screen, scan = self.screen, self.screen.scan
        start = screen.onsets[onset]
        begin = start + scan.order
        border = -(-begin // BLOCK)
        # From the first steady sample to the next border, one by one.
        between = begin[:, None] + np.arange(BLOCK)
        phases = np.where(
            between < BLOCK * border[:, None], self.turning[np.minimum(between, len(self.turning) - 1), k[:, None]], 0.0
        )
        between = np.minimum(between, len(screen.rows) - 1)
        rows, squares = screen.rows[between], screen.squares[between]
        correlations = self.correlations[border, k]
        correlations = correlations + np.einsum("pl,plj->pj", phases.real, rows)
        correlations += 1j * np.einsum("pl,plj->pj", phases.imag, rows)
        doubled = self.doubled[border, k] + np.einsum("pl,pl->p", phases**2, squares)
        turned = self.steady[k] * np.conj(self.turning[start, k])[:, None]
        C = np.imag(correlations[:, :, None] * turned[:, None])
        first, second = turned[:, :, None], turned[:, None]
        S = 0.5 * np.real(
            first * np.conj(second) * screen.remaining[begin][:, None, None] - first * second * doubled[:, None, None]
        )
        after = start[:, None] + np.arange(1, scan.order)
        early = self.early[k]
        C += screen.rows[after].transpose(0, 2, 1) @ early
        S += early.transpose(0, 2, 1) @ (screen.squares[after][:, :, None] * early)
        base = C[:, : scan.n_base]
        S -= base.transpose(0, 2, 1) @ base
        return np.ascontiguousarray(C.transpose(1, 2, 0)), np.ascontiguousarray(S.transpose(1, 2, 0))
