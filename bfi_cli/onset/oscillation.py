"""An oscillation measured: frequency, start, end and, where the record asks for one, a phase at its onset.

The scan looks for phase 0 at the onset. Around what it finds, frequency and phase are refined by Gauss-Newton steps
with the phase free, as magnitudes of a sine and of a cosine (METHOD section 5), and start and end by the likelihood at
the log's own samples. Then phase 0 is asked for again: it is given up where the record says so clearly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..config import STRONG_EVIDENCE
from ..kernels.onset.frequency import MIN_CYCLES
from ..kernels.variable_projection import Fit
from .joint import Likelihood
from .record import ScanRecord
from .shapes import Form, Place, signal
from .sweep import Peak

__all__ = ["Sinusoid", "measured", "place", "statistics"]

FloatArray = NDArray[np.float64]

BESIDE = (-0.8, -0.4, 0.0, 0.4, 0.8)
MIDDLE = len(BESIDE) // 2
APART = 0.4
MOST_FREQUENCIES = 120
CLIMBED = 2
LARGEST_STEP = 0.3
DIFFERENCE = 0.01
ITERATIONS = 8
SETTLED = 1e-4
PARTS = 12
ROUNDS = 2
WORSE = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sinusoid:
    """A sine on [start, end), samples of the log's own rate from the first conditioned one; None where it lasts.

    Attributes
    ----------
    phase_rad : at the start; 0 where it is not `free`.
    z, sd : amplitude, scaled; statistic : 2 log of the likelihood ratio.
    sizes : magnitudes of its signals, scaled, None before a fit.
    frequency_sd_hz : standard deviation of the frequency, infinite before a fit; duration_s : to its end.
    """

    frequency_hz: float
    start: int
    end: int | None
    free: bool
    phase_rad: float
    z: float
    sd: float
    statistic: float
    sizes: FloatArray | None = None
    frequency_sd_hz: float = np.inf
    duration_s: float = np.nan

    @property
    def is_told_by_the_record(self) -> bool:
        """Whether the frequency is known as well as an oscillation of this statistic tells it (Cramer-Rao bound).

        A slow one that does no more than bend the record at its start is not: any other bend would do.
        """
        bound = np.sqrt(12.0) / (2.0 * np.pi * self.duration_s * np.sqrt(max(self.statistic, 1.0)))
        return bool(self.frequency_sd_hz < WORSE * bound)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    """What is searched: a likelihood, the shape's output, the least and largest start, and the likelihood without."""

    likelihood: Likelihood
    form: Form
    first: int
    last: int
    log_det: float

    @property
    def record(self) -> ScanRecord:
        return self.likelihood.record

    @property
    def native_hz(self) -> float:
        return self.record.sampling.rate_hz * self.record.sampling.factor

    def signals(self, one: Sinusoid) -> FloatArray:
        """(n_samples, 1) of phase 0 at the start, or (n_samples, 2): sine and cosine, phase 0 amid the pulse."""
        factor = self.record.sampling.factor
        middle = (one.start + (self.last if one.end is None else one.end)) // 2
        forms = [replace(self.form, parameter=one.frequency_hz)]
        if one.free:
            forms = [replace(forms[0], phase_rad=phase, anchor=middle) for phase in (0.0, 0.5 * np.pi)]
        end = None if one.end is None else place(one.end, factor)
        return np.stack([signal(f, self.record.sampling, place(one.start, factor), end) for f in forms], axis=1)

    def fit(self, one: Sinusoid) -> Fit:
        return self.likelihood.on_output(self.signals(one), self.form.output, one.sizes)

    def statistic(self, fit: Fit) -> float:
        return self.likelihood.n_rows * (self.log_det - fit.log_det)

    def duration_s(self, one: Sinusoid) -> float:
        return ((self.last if one.end is None else one.end) - one.start) / self.native_hz


def measured(likelihood: Likelihood, peak: Peak, *, dispersion: float = 1.0, jump: int | None = None) -> Sinusoid:
    """Return the oscillation near a peak of the scan.

    Parameters
    ----------
    likelihood : of the record that was scanned, at the order of the peak.
    dispersion : how many times the statistic exceeds what white noise would make it, at least 1.
    jump : sample of the log's own rate at which a step was seen: an oscillation that does not begin at zero begins with
        one, and its other frequencies and phases have hills of their own.
    """
    search, begin = _search(likelihood, peak)
    step = 1.0 / search.duration_s(begin)
    near = [replace(begin, frequency_hz=begin.frequency_hz + k * step) for k in BESIDE]
    low, high = likelihood.record.band_hz
    near = [one for one in near if one is near[MIDDLE] or low <= one.frequency_hz <= high]
    tried = [_tuned(search, one) for one in [*near, *_from_jump(search, begin, jump)]]
    free = max(tried, key=lambda one: one.statistic)
    for _ in range(ROUNDS):
        free = _tuned(search, _shifted(search, free))
    tied = _tied(search, free, begin)
    wanted = dispersion * (float(np.log(likelihood.n_rows)) + STRONG_EVIDENCE)
    return free if free.statistic > tied.statistic + wanted else tied


def _from_jump(search: _Search, begin: Sinusoid, jump: int | None) -> list[Sinusoid]:
    """Return the likeliest sinusoids that begin at a sample, over the frequencies of the band nearest to the peak's."""
    last = search.last if begin.end is None else begin.end
    if jump is None or not search.first <= jump < last:
        return []
    begun = replace(begin, start=jump)
    duration_s, (low, high) = search.duration_s(begun), search.record.band_hz
    frequencies = np.arange(max(low, MIN_CYCLES / duration_s), high, APART / duration_s)
    nearest = np.argsort(np.abs(frequencies - begin.frequency_hz))[:MOST_FREQUENCIES]
    return _ranked(search, [replace(begun, frequency_hz=float(frequencies[k])) for k in nearest])[:CLIMBED]


def _search(likelihood: Likelihood, peak: Peak) -> tuple[_Search, Sinusoid]:
    record, order = likelihood.record, likelihood.order
    factor, lead, n = record.sampling.factor, record.sampling.lead, record.sampling.n_samples
    assert peak.form.parameter is not None
    search = _Search(
        likelihood=likelihood,
        form=replace(peak.form, phase_rad=0.0),
        first=(order + lead) * factor,
        last=(n - 1 - order) * factor,
        log_det=likelihood.on_output(np.zeros((n, 0)), peak.form.output).log_det,
    )
    begin = Sinusoid(
        frequency_hz=peak.form.parameter,
        start=peak.onset * factor,
        end=None if peak.end is None else peak.end * factor,
        free=True,
        phase_rad=0.0,
        z=float(peak.profile.z[peak.profile.best]),
        sd=np.nan,
        statistic=peak.statistic,
    )
    return search, begin


def _tuned(search: _Search, one: Sinusoid) -> Sinusoid:
    """Return the sinusoid with amplitude, phase and frequency at their maximum, start and end kept (Gauss-Newton)."""
    duration_s, (lowest, highest) = search.duration_s(one), search.record.band_hz
    delta, limit = DIFFERENCE / duration_s, LARGEST_STEP / duration_s
    lowest = min(max(lowest, MIN_CYCLES / duration_s), highest)
    signals, start = search.signals(one), one.sizes
    for _ in range(ITERATIONS):
        z = search.likelihood.on_output(signals, search.form.output, start).z
        slope = [search.signals(replace(one, frequency_hz=one.frequency_hz + d)) @ z for d in (-delta, delta)]
        change = (slope[1] - slope[0])[:, None] / (2.0 * delta)
        size = float(np.linalg.norm(change)) or 1.0
        fit = search.likelihood.on_output(np.hstack([signals, change / size]), search.form.output, np.append(z, 0.0))
        step = float(np.clip(fit.z[-1] / size, -limit, limit))
        one = replace(one, frequency_hz=float(np.clip(one.frequency_hz + step, lowest, highest)))
        signals, start = search.signals(one), fit.z[:-1]
        if abs(step) < SETTLED * limit:
            break
    one = _with_size(search, one, signals, fit)
    return replace(one, frequency_sd_hz=_deviation(fit) / size, duration_s=duration_s)


def _deviation(joint: Fit) -> float:
    """Return the standard deviation of the last magnitude; infinite where the record says nothing of it."""
    information = joint.information
    rest, cross = information[:-1, :-1], information[:-1, -1]
    own = float(information[-1, -1] - cross @ np.linalg.pinv(rest, hermitian=True) @ cross)
    return 1.0 / float(np.sqrt(own)) if own > 0.0 else np.inf


def _with_size(search: _Search, one: Sinusoid, signals: FloatArray, joint: Fit) -> Sinusoid:
    """Return the sinusoid with amplitude, its deviation (the frequency's in it), phase at the start and statistic."""
    k = signals.shape[1]
    fit = search.likelihood.on_output(signals, search.form.output, joint.z[:k])
    covariance = np.linalg.pinv(joint.information, hermitian=True)[:k, :k]
    z = float(np.linalg.norm(fit.z)) if one.free else float(fit.z[0])
    along = fit.z / z if z else np.ones(k)
    phase = 0.0
    if one.free:
        middle = (one.start + (search.last if one.end is None else one.end)) // 2
        turned = replace(
            search.form,
            parameter=one.frequency_hz,
            phase_rad=float(np.arctan2(fit.z[1], fit.z[0])),
            anchor=middle,
        )
        phase = turned.phase_at(one.start, search.native_hz)
    sd = float(np.sqrt(along @ covariance @ along))
    return replace(one, z=z, sd=sd, phase_rad=phase, statistic=search.statistic(fit), sizes=fit.z)


def _shifted(search: _Search, one: Sinusoid) -> Sinusoid:
    """Move start, then end, to where the statistic is largest: by parts of a period first, by single samples last."""
    period = search.native_hz / one.frequency_hz
    stride, reach = max(1, round(period / PARTS)), PARTS // 2
    while True:
        starts = (one.start + k * stride for k in range(-reach, reach + 1))
        latest = (search.last if one.end is None else one.end) - MIN_CYCLES * period
        one = _best_of(search, [one, *(replace(one, start=k) for k in starts if search.first <= k <= latest)])
        if one.end is not None:
            ends = (one.end + k * stride for k in range(-reach, reach + 1))
            earliest = one.start + MIN_CYCLES * period
            one = _best_of(search, [one, *(replace(one, end=k) for k in ends if earliest <= k <= search.last)])
        if stride == 1:
            return one
        stride, reach = max(1, stride // 4), 4


def _best_of(search: _Search, candidates: Sequence[Sinusoid]) -> Sinusoid:
    fits = [search.fit(one) for one in candidates]
    best = int(np.argmin([fit.log_det for fit in fits]))
    return replace(candidates[best], sizes=fits[best].z)


def _tied(search: _Search, free: Sinusoid, begin: Sinusoid) -> Sinusoid:
    """Return the best sinusoid of phase 0 at its start, sought where the free one passes zero."""
    period = search.native_hz / free.frequency_hz
    since = free.phase_rad / (2.0 * np.pi) * period
    crossings = [round(free.start - since + 0.5 * k * period) for k in range(-2, 4)]
    latest = (search.last if free.end is None else free.end) - MIN_CYCLES * period
    starts = [k for k in crossings if search.first <= k <= latest]
    candidates = [replace(free, free=False, start=k, sizes=None) for k in starts]
    ranked = _ranked(search, [*candidates, replace(begin, free=False)])[:ROUNDS]
    found = []
    for one in ranked:
        one = _tuned(search, one)
        for stride in (4, 2, 1):
            beside = [one.start + k * stride for k in (-1, 0, 1)]
            near = [replace(one, start=k) for k in beside if search.first <= k < (one.end or search.last)]
            one = max((_tuned(search, nearby) for nearby in near), key=lambda nearby: nearby.statistic, default=one)
        found.append(one)
    return max(found, key=lambda one: one.statistic)


def _ranked(search: _Search, candidates: Sequence[Sinusoid]) -> list[Sinusoid]:
    fits = [search.fit(one) for one in candidates]
    return [replace(candidates[int(k)], sizes=fits[int(k)].z) for k in np.argsort([fit.log_det for fit in fits])]


def statistics(likelihood: Likelihood, peak: Peak, one: Sinusoid, starts: Sequence[int]) -> FloatArray:
    """Return (statistic, amplitude), (2, n_starts), of the sinusoid begun at other samples; a free phase stays in time.

    Parameters
    ----------
    starts : samples of the log's own rate.
    """
    search, _ = _search(likelihood, peak)
    found = []
    for start in starts:
        fit = search.fit(replace(one, start=start))
        found.append((search.statistic(fit), float(np.linalg.norm(fit.z)) if one.free else float(fit.z[0])))
    return np.array(found).T


def place(sample: int, factor: int) -> Place:
    """Return the conditioned sample and the phase of a sample of the log's own rate, see `shapes.waveform`."""
    conditioned = -(-sample // factor)
    return conditioned, sample - conditioned * factor
