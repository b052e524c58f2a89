"""An oscillation estimated: frequency, start, end and, where the record asks for one, a phase at its onset.

1. The scan looks for phase 0 at the onset. From its peak, and from a step that was seen, frequency and phase are
   refined by Gauss-Newton steps with the phase free, as magnitudes of a sine and of a cosine (docs/theory.md, 9.3).
2. Start and end are moved to the maximum of the likelihood at the log's own samples, and step 1 is repeated.
3. Phase 0 is asked for again, where the free oscillation passes zero. It is given up where the statistic gains more
   than one parameter and strong evidence ask for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...config import STRONG_EVIDENCE
from ...kernels import FloatArray
from ...kernels.onset.frequency import MIN_CYCLES
from ...kernels.variable_projection import Fit
from .scan import Peak
from .scan_record import Likelihood, ScanRecord
from .shapes import ShapeHypothesis, signal, subsample_index

# Frequencies are counted in 1 / duration: x of them beside the true one, the statistic is sinc^2(x) of its peak (that
# of a rectangular window), 0.88 at 0.2, and bent downwards up to 0.41. So steps of 0.4 lose an eighth at most, and a
# Gauss-Newton step of less than 0.41 from there stays on the peak.
# The phase-0 scan may be off once the phase is free, by less than one width.
BESIDE = (-0.8, -0.4, 0.0, 0.4, 0.8)
# Of the grid from a jump; how many of its frequencies, nearest to the scan's, are tried, and how many refined. Bounds
# on the time, set by trial on simulated flights with one and two faults.
APART = 0.4
MOST_FREQUENCIES = 120
REFINED = 3
# A Gauss-Newton step is no longer than this, and takes its derivative over +-DIFFERENCE, whose error is
# (2 pi 0.01)^2 / 6, less than a thousandth. It ends after ITERATIONS, a bound on the time, or once a step is below
# CONVERGED of the longest: 3e-5 widths, a tenth of the standard deviation of a frequency whose statistic is a million.
LARGEST_STEP = 0.3
DIFFERENCE = 0.01
ITERATIONS = 8
CONVERGED = 1e-4
# Edges are moved in twelfths of a period over half a period to either side, then in ever smaller strides: an edge off
# by more is that of another half wave.
PARTS = 12
# Frequency and edges are refined in turn, and as many candidates of phase 0 are: the second round moves little. Chosen
# without a tuning record.
ROUNDS = 2
# Share of the statistic that counts: of oscillations in windows of recorded flights none gained more than a twentieth
# after its edges had been moved once.
HOPELESS = 0.95
# The frequency is known if its standard deviation is below three times the Cramer-Rao bound: wide enough for coloured
# errors, and too narrow for a bend at the record's start that only resembles an oscillation. Chosen without a tuning
# record.
WORSE = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sinusoid:
    """A sine on [start, end), in samples of the log's own rate counted from the first conditioned sample.

    Attributes
    ----------
    end : None where the oscillation lasts to the end of the record.
    free : whether the phase is estimated; phase_rad : at the start, 0 where it is not estimated.
    z, sd : amplitude, scaled; statistic : 2 log of the likelihood ratio.
    sizes : magnitudes of its signals, scaled, None before a fit.
    frequency_sd_hz : standard deviation of the frequency, infinite before a fit; duration_s : from start to end.
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
    def frequency_is_known(self) -> bool:
        """Whether the standard deviation of the frequency is near the Cramer-Rao bound for this statistic.

        It is far from the bound where a slow oscillation does no more than bend the record at its start, which any
        other slow shape would do as well.
        """
        bound = np.sqrt(12.0) / (2.0 * np.pi * self.duration_s * np.sqrt(max(self.statistic, 1.0)))
        return bool(self.frequency_sd_hz < WORSE * bound)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OscillationSearch:
    """The likelihood that is searched, around a peak of the scan.

    Attributes
    ----------
    form : the hypothesis, of phase 0; begin : the oscillation at the peak.
    first, last : earliest and latest start, samples of the log's own rate.
    """

    likelihood: Likelihood
    form: ShapeHypothesis
    begin: Sinusoid
    first: int
    last: int

    @property
    def record(self) -> ScanRecord:
        """The record that was scanned."""
        return self.likelihood.record

    def end(self, wave: Sinusoid) -> int:
        """Return the sample at which a sinusoid ends, the last where it lasts."""
        return self.last if wave.end is None else wave.end

    def duration_s(self, wave: Sinusoid) -> float:
        """Return the time from start to end, at least that of a sample."""
        return max(self.end(wave) - wave.start, 1) / self.record.sampling.native_hz

    def signals(self, wave: Sinusoid) -> FloatArray:
        """Return (n_samples, 1), phase 0 at the start, or for a free phase (n_samples, 2), sine and cosine.

        These have phase 0 in the middle, where frequency and phase are the least correlated.
        """
        factor, middle = self.record.sampling.factor, (wave.start + self.end(wave)) // 2
        forms = [replace(self.form, parameter=wave.frequency_hz)]
        if wave.free:
            forms = [replace(forms[0], phase_rad=phase, anchor=middle) for phase in (0.0, 0.5 * np.pi)]
        start = subsample_index(wave.start, factor)
        end = None if wave.end is None else subsample_index(wave.end, factor)
        return np.stack([signal(form, self.record.sampling, start, end) for form in forms], axis=1)

    def fit(self, signals: FloatArray, start: FloatArray | None) -> Fit:
        """Return the fit of the magnitudes of signals (n_samples, n_signals) of the output."""
        theta = np.zeros((*self.likelihood.layout.y.shape, signals.shape[1]))
        theta[:, self.form.output] = signals
        return self.likelihood.fit(theta, start)

    def ranked(self, candidates: Sequence[Sinusoid]) -> list[Sinusoid]:
        """Return the candidates with their magnitudes, the likeliest first."""
        fits = [self.fit(self.signals(wave), wave.sizes) for wave in candidates]
        order = np.argsort([fit.log_det for fit in fits], kind="stable")
        return [replace(candidates[int(k)], sizes=fits[int(k)].z) for k in order]

    def profile(self, wave: Sinusoid, starts: Sequence[int]) -> FloatArray:
        """Return (2, n_starts) statistic and amplitude of the sinusoid at other starts, amplitude and phase fitted."""
        points = []
        for start in starts:
            fit = self.fit(self.signals(replace(wave, start=start)), wave.sizes)
            points.append(
                (self.likelihood.statistic(fit), float(np.linalg.norm(fit.z)) if wave.free else float(fit.z[0]))
            )
        return np.array(points).T


def oscillation_search(likelihood: Likelihood, peak: Peak) -> OscillationSearch:
    """Return the search around a peak of the scan, of the record and at the order of `likelihood`."""
    record, order = likelihood.record, likelihood.layout.first
    factor, lead, n = record.sampling.factor, record.sampling.lead, record.sampling.n_samples
    assert peak.form.parameter is not None
    return OscillationSearch(
        likelihood=likelihood,
        form=replace(peak.form, phase_rad=0.0),
        begin=Sinusoid(
            frequency_hz=peak.form.parameter,
            start=peak.onset * factor,
            end=None if peak.end is None else peak.end * factor,
            free=True,
            phase_rad=0.0,
            z=float(peak.profile.z[peak.profile.best]),
            sd=np.nan,
            statistic=peak.statistic,
        ),
        first=(order + lead) * factor,
        last=(n - 1 - order) * factor,
    )


def estimate_oscillation(
    search: OscillationSearch, *, dispersion: float = 1.0, jump: int | None = None, least: float = 0.0
) -> Sinusoid:
    """Return the oscillation near the peak of a search, by the steps named at the head of this file.

    Parameters
    ----------
    dispersion : ratio of the mean statistic of other onsets to that of white noise, at least 1.
    jump : sample of the log's own rate at which a step was seen. An oscillation that does not begin at zero begins with
        a step, and its frequency may be far from that of the scan, which assumes phase 0.
    least : statistic that counts: an oscillation that is far from it once its edges have been moved is left as it is.
    """
    begin, (low, high) = search.begin, search.record.band_hz
    width = 1.0 / search.duration_s(begin)
    near = [(k, replace(begin, frequency_hz=begin.frequency_hz + k * width)) for k in BESIDE]
    tried = [wave for k, wave in near if k == 0.0 or low <= wave.frequency_hz <= high]
    if jump is not None and search.first <= jump < search.end(begin):
        begun = replace(begin, start=jump)
        duration_s = search.duration_s(begun)
        frequencies = np.arange(max(low, MIN_CYCLES / duration_s), high, APART / duration_s)
        nearest = np.argsort(np.abs(frequencies - begin.frequency_hz))[:MOST_FREQUENCIES]
        tried += [replace(begun, frequency_hz=float(frequencies[k])) for k in nearest]
    refined = [_refine_frequency(search, wave) for wave in search.ranked(tried)[:REFINED]]
    free = max(refined, key=lambda wave: wave.statistic)
    for _ in range(ROUNDS):
        free = _refine_frequency(search, _move_edges(search, free))
        if free.statistic < HOPELESS * least:
            return free
    tied = _with_phase_zero(search, free)
    wanted = dispersion * (float(np.log(search.likelihood.n_rows)) + STRONG_EVIDENCE)
    return free if free.statistic > tied.statistic + wanted else tied


def _refine_frequency(search: OscillationSearch, wave: Sinusoid) -> Sinusoid:
    """Return the sinusoid with the likeliest amplitude, phase and frequency, start and end kept (Gauss-Newton)."""
    duration_s, (lowest, highest) = search.duration_s(wave), search.record.band_hz
    delta, limit = DIFFERENCE / duration_s, LARGEST_STEP / duration_s
    lowest = min(max(lowest, MIN_CYCLES / duration_s), highest)
    signals, start = search.signals(wave), wave.sizes
    for _ in range(ITERATIONS):
        sizes = search.fit(signals, start).z
        slope = [search.signals(replace(wave, frequency_hz=wave.frequency_hz + d)) @ sizes for d in (-delta, delta)]
        change = (slope[1] - slope[0])[:, None] / (2.0 * delta)
        size = float(np.linalg.norm(change)) or 1.0
        joint = search.fit(np.hstack([signals, change / size]), np.append(sizes, 0.0))
        step = float(np.clip(joint.z[-1] / size, -limit, limit))
        wave = replace(wave, frequency_hz=float(np.clip(wave.frequency_hz + step, lowest, highest)))
        signals, start = search.signals(wave), joint.z[:-1]
        if abs(step) < CONVERGED * limit:
            break
    # The standard deviation of the amplitude includes the uncertainty of the frequency; that of the frequency is
    # infinite where the record tells nothing of it.
    information, k = joint.information, signals.shape[1]
    covariance = np.linalg.pinv(information, hermitian=True)[:k, :k]
    cross = information[:k, k]
    frequency_information = float(
        information[k, k] - cross @ np.linalg.pinv(information[:k, :k], hermitian=True) @ cross
    )
    fit = search.fit(signals, start)
    z, phase = float(fit.z[0]), 0.0
    if wave.free:
        z, middle = float(np.linalg.norm(fit.z)), (wave.start + search.end(wave)) // 2
        turned = replace(
            search.form, parameter=wave.frequency_hz, phase_rad=float(np.arctan2(fit.z[1], fit.z[0])), anchor=middle
        )
        phase = turned.phase_at(wave.start, search.record.sampling.native_hz)
    along = fit.z / z if z else np.ones(k)
    return replace(
        wave,
        z=z,
        sd=float(np.sqrt(along @ covariance @ along)),
        phase_rad=phase,
        statistic=search.likelihood.statistic(fit),
        sizes=fit.z,
        frequency_sd_hz=(1.0 / float(np.sqrt(frequency_information)) if frequency_information > 0.0 else np.inf) / size,
        duration_s=duration_s,
    )


def _move_edges(search: OscillationSearch, wave: Sinusoid) -> Sinusoid:
    """Move start, then end, to the largest statistic, in strides that shrink from a twelfth of a period to a sample."""
    period = search.record.sampling.native_hz / wave.frequency_hz
    stride, reach = max(1, round(period / PARTS)), PARTS // 2
    while True:
        starts = (wave.start + k * stride for k in range(-reach, reach + 1))
        latest = search.end(wave) - MIN_CYCLES * period
        wave = search.ranked([wave, *(replace(wave, start=k) for k in starts if search.first <= k <= latest)])[0]
        if wave.end is not None:
            ends = (wave.end + k * stride for k in range(-reach, reach + 1))
            earliest = wave.start + MIN_CYCLES * period
            wave = search.ranked([wave, *(replace(wave, end=k) for k in ends if earliest <= k <= search.last)])[0]
        if stride == 1:
            return wave
        stride, reach = max(1, stride // 4), 4


def _with_phase_zero(search: OscillationSearch, free: Sinusoid) -> Sinusoid:
    """Return the likeliest sinusoid of phase 0 at its start, sought at the zero crossings of `free` and at the peak."""
    period = search.record.sampling.native_hz / free.frequency_hz
    since = free.phase_rad / (2.0 * np.pi) * period
    crossings = [round(free.start - since + 0.5 * k * period) for k in range(-2, 4)]
    latest = search.end(free) - MIN_CYCLES * period
    starts = [k for k in crossings if search.first <= k <= latest]
    candidates = [replace(free, free=False, start=k, sizes=None) for k in starts]
    refined = []
    for wave in search.ranked([*candidates, replace(search.begin, free=False)])[:ROUNDS]:
        wave = _refine_frequency(search, wave)
        for stride in (4, 2, 1):
            beside = [wave.start + k * stride for k in (-1, 1)]
            near = [replace(wave, start=k) for k in beside if search.first <= k < (wave.end or search.last)]
            wave = max([wave, *(_refine_frequency(search, at) for at in near)], key=lambda at: at.statistic)
        refined.append(wave)
    return max(refined, key=lambda wave: wave.statistic)
