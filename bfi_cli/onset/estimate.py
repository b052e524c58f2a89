"""From the peak of a scan to an onset with its interval and a magnitude with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.onset_scan import Profile, scan_shape
from ..kernels.onset_shapes import Waveform
from .record import ScanRecord
from .shapes import Form, waveform
from .sweep import Peak, scan_of

__all__ = ["Estimate", "estimate", "signal"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

DROP = 3.841458820694124
NORMAL = 1.959963984540054
MOST_PHASES = 10
BESIDE = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """One fault, magnitudes scaled.

    Attributes
    ----------
    form : with its frequency or time constant.
    onset_s, onset_ci95 : on the log's axis.
    offset_s : None where the fault lasts.
    z, sd : magnitude; the spread over the onsets in question is in `sd`.
    signal : (n_samples,) what it adds to its output, conditioned and scaled.
    statistic : of its shape at this onset.
    """

    form: Form
    onset_s: float
    onset_ci95: tuple[float, float]
    offset_s: float | None
    z: float
    sd: float
    signal: FloatArray
    statistic: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fine:
    """A profile over onsets between the conditioned samples, increasing in time."""

    samples: IntArray
    phases: IntArray
    onset_s: FloatArray
    z: FloatArray
    sd: FloatArray
    statistic: FloatArray
    step_s: float

    @property
    def best(self) -> int:
        return int(np.argmax(self.statistic))


def estimate(record: ScanRecord, y: FloatArray, peak: Peak, *, order: int, dispersion: float = 1.0) -> Estimate:
    """Return the fault of a peak.

    Parameters
    ----------
    y : (n_samples, n_outputs) what was scanned.
    order : of the model.
    dispersion : how many times the statistic of other onsets exceeds what white noise would make it, at least 1.
    """
    fine = _fine(record, y, peak, order=order, drop=DROP * dispersion)
    best, missing = fine.best, fine.statistic.max() - fine.statistic
    inside = np.flatnonzero(missing <= DROP * dispersion)
    weight = np.exp(-0.5 * missing / dispersion)
    seen = np.isfinite(fine.sd)
    spread = np.where(seen, fine.sd, 0.0) ** 2 * dispersion + (fine.z - fine.z[best]) ** 2
    variance = np.sum((weight * spread)[seen]) / np.sum(weight[seen]) if seen[best] else np.nan
    return Estimate(
        form=peak.form,
        onset_s=float(fine.onset_s[best]),
        onset_ci95=(
            float(fine.onset_s[inside[0]]) - fine.step_s,
            float(fine.onset_s[inside[-1]]) + fine.step_s,
        ),
        offset_s=None if peak.end is None else record.onset_s(peak.end),
        z=float(fine.z[best]),
        sd=float(np.sqrt(variance)),
        signal=float(fine.z[best]) * signal(record, peak, int(fine.samples[best]), int(fine.phases[best])),
        statistic=float(fine.statistic[best]),
    )


def signal(record: ScanRecord, peak: Peak, sample: int, phase: int = 0) -> FloatArray:
    """Return (n_samples,) what a fault of magnitude 1 adds to its output, conditioned.

    Parameters
    ----------
    sample, phase : of the onset, see `ScanRecord.onset_s`.
    """
    wave, lead, n = waveform(peak.form, record.sampling, phase), record.sampling.lead, record.sampling.n_samples
    start = sample - lead
    found = np.zeros(n)
    found[start:] = wave.samples[: n - start]
    if peak.end is not None:
        end = peak.end - lead
        for weight, tail in zip(wave.weights[:, end - start], wave.tails, strict=True):
            found[end:] -= weight * tail[: n - end]
    return found * wave.unit


def _fine(record: ScanRecord, y: FloatArray, peak: Peak, *, order: int, drop: float) -> _Fine:
    """Return the profile around its maximum, the onsets between the conditioned samples added where they matter."""
    coarse, lead, factor = peak.profile, record.sampling.lead, record.sampling.factor
    if factor == 1 or peak.end is not None:
        return _joined(record, [(0, coarse)], 1.0 / record.sampling.rate_hz)
    scan = scan_of(record, y, order, output=peak.form.output)
    close = np.flatnonzero(coarse.statistic >= coarse.statistic.max() - drop)
    nearby = _between(coarse, int(close[0]) - BESIDE, int(close[-1]) + BESIDE)
    stride = max(1, -(-factor // MOST_PHASES))
    found = []
    for phase in range(0, -factor, -stride):
        wave: Waveform = waveform(peak.form, record.sampling, phase)
        found.append((phase, scan_shape(scan, wave, nearby - lead)))
    moved = [(phase, _shifted(one, lead)) for phase, one in found]
    return _joined(record, moved, stride / factor / record.sampling.rate_hz)


def _between(profile: Profile, first: int, last: int) -> IntArray:
    return profile.onsets[max(first, 0) : last + 1]


def _shifted(profile: Profile, lead: int) -> Profile:
    return Profile(
        onsets=profile.onsets + lead,
        z=profile.z,
        sd=profile.sd,
        rss=profile.rss,
        rss0=profile.rss0,
        statistic=profile.statistic,
    )


def _joined(record: ScanRecord, profiles: list[tuple[int, Profile]], step_s: float) -> _Fine:
    samples = np.concatenate([profile.onsets for _, profile in profiles])
    phases = np.concatenate([np.full(len(profile.onsets), phase) for phase, profile in profiles])
    onset_s = np.array([record.onset_s(int(k), int(p)) for k, p in zip(samples, phases, strict=True)])
    z, sd, statistic = (np.concatenate([getattr(x, name) for _, x in profiles]) for name in ("z", "sd", "statistic"))
    ranked = np.argsort(onset_s)
    return _Fine(
        samples=samples[ranked],
        phases=phases[ranked],
        onset_s=onset_s[ranked],
        z=z[ranked],
        sd=sd[ranked],
        statistic=statistic[ranked],
        step_s=step_s,
    )
