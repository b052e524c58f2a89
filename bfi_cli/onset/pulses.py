"""Faults between the conditioned samples: profiles over any start, end and frequency, the filter's smear included.

The scans of the kernels know onsets on samples, and with an end only sharp edges; what that costs is small for finding
a fault and large for measuring an oscillation, whose phase starts at its onset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels import onset_shapes
from ..kernels.onset_scan import default_onsets, scan_shape
from ..kernels.onset_tables import Scan
from .record import ScanRecord
from .shapes import Form, Place, signal
from .sweep import Peak

__all__ = ["Fine", "phases", "pulses", "step_s", "tuned", "within"]

FloatArray = NDArray[np.float64]
Top = tuple[float, Form, Place, Place | None]

MOST_PHASES = 10
STEP = 0.1
STEPS = 6
HALVINGS = 6
TUNING_PHASES = 3
LEAST_CYCLES = 1.0
REACH, STRIDE = 3, 4
TOPS = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fine:
    """A profile over onsets between the conditioned samples, `step_s` apart near its maximum."""

    places: tuple[Place, ...]
    onset_s: FloatArray
    z: FloatArray
    sd: FloatArray
    statistic: FloatArray
    step_s: float

    @property
    def best(self) -> int:
        """Index of the largest statistic."""
        return int(np.argmax(self.statistic))


def phases(record: ScanRecord, most: int = MOST_PHASES) -> range:
    """Return the phases, see `shapes.waveform`, at most so many."""
    factor = record.sampling.factor
    return range(0, -factor, -max(1, -(-factor // most)))


def step_s(record: ScanRecord) -> float:
    """Return the time between two neighbouring phases."""
    return -phases(record).step / record.sampling.factor / record.sampling.rate_hz


def pulses(record: ScanRecord, scan: Scan, form: Form, spans: Sequence[tuple[Place, Place | None]]) -> Fine:
    """Return the profile over starts and ends, in the order given; the starts are its places."""
    sampling = record.sampling
    found = []
    for start, end in spans:
        first = start[0] - sampling.lead
        samples = np.zeros(sampling.n_samples)
        samples[: sampling.n_samples - first] = signal(form, sampling, start, end)[first:]
        found.append(scan_shape(scan, onset_shapes.sampled(samples), np.array([first])))
    z, sd, statistic = (np.array([getattr(one, name)[0] for one in found]) for name in ("z", "sd", "statistic"))
    places = tuple(start for start, _ in spans)
    onset_s = np.array([record.onset_s(*place) for place in places])
    return Fine(places=places, onset_s=onset_s, z=z, sd=sd, statistic=statistic, step_s=step_s(record))


def tuned(record: ScanRecord, scan: Scan, peak: Peak) -> tuple[Form, Place, Place | None]:
    """Return a sine with its frequency, start and end, sought anew around a peak.

    A pulse of the same duration is slid over the onsets at frequencies beside the one found; then frequency, start
    and end are improved in turn.
    """
    assert peak.form.parameter is not None
    end = record.sampling.n_samples - 1 if peak.end is None else peak.end
    duration_s = (end - peak.onset) / record.sampling.rate_hz
    f0, step = peak.form.parameter, STEP / duration_s
    tops = [
        _slid(record, scan, replace(peak, form=replace(peak.form, parameter=frequency)))
        for k in range(-STEPS, STEPS + 1)
        if (frequency := f0 + k * step) * duration_s > LEAST_CYCLES and frequency < 0.5 * record.sampling.rate_hz
    ]
    ranked = sorted(tops, key=lambda top: -top[0])[:TOPS]
    return max((_climbed(record, scan, top, step) for top in ranked), key=lambda top: top[0])[1:]


def _climbed(record: ScanRecord, scan: Scan, top: Top, step: float) -> Top:
    """Improve frequency, start and end in turn, by smaller and smaller steps."""
    statistic, form, start, end = top
    for halving in range(HALVINGS):
        step *= 0.5
        form = _best_form(record, scan, form, (start, end), step)
        statistic, start, end = _moved(record, scan, form, (start, end), stride=max(1, STRIDE >> halving))
    return statistic, form, start, end


def _slid(record: ScanRecord, scan: Scan, peak: Peak) -> Top:
    """Return statistic, form, start and end of the best onset near the peak's, the duration kept."""
    sampling, onsets = record.sampling, default_onsets(scan)
    assert peak.form.parameter is not None
    reach = sampling.rate_hz / peak.form.parameter
    near = onsets[np.abs(onsets + sampling.lead - peak.onset) <= reach]
    if not near.size:
        near = onsets[np.argmin(np.abs(onsets + sampling.lead - peak.onset)), None]
    best: Top | None = None
    for phase in phases(record, TUNING_PHASES):
        start: Place = (int(near[0]) + sampling.lead, phase)
        end = None if peak.end is None else (start[0] + peak.end - peak.onset, phase)
        samples = np.zeros(sampling.n_samples)
        samples[: sampling.n_samples - int(near[0])] = _endless(peak.form, record, start, end)
        profile = scan_shape(scan, onset_shapes.sampled(samples), near)
        k = int(profile.onsets[profile.best]) - int(near[0])
        stop = None if end is None else (min(end[0] + k, sampling.n_samples - 1), phase)
        top = float(profile.statistic.max()), peak.form, (start[0] + k, phase), stop
        best = top if best is None or top[0] > best[0] else best
    assert best is not None
    return best


def _endless(form: Form, record: ScanRecord, start: Place, end: Place | None) -> FloatArray:
    """Return the signal from where the filter shows it first to the end of the record."""
    return signal(form, record.sampling, start, end)[start[0] - record.sampling.lead :]


def _best_form(record: ScanRecord, scan: Scan, form: Form, span: tuple[Place, Place | None], step: float) -> Form:
    assert form.parameter is not None
    forms = [replace(form, parameter=form.parameter + k * step) for k in (-1, 0, 1)]
    return max(forms, key=lambda one: float(pulses(record, scan, one, [span]).statistic[0]))


def _moved(
    record: ScanRecord, scan: Scan, form: Form, span: tuple[Place, Place | None], *, stride: int
) -> tuple[float, Place, Place | None]:
    """Return statistic, start and end, both moved by up to `REACH` strides of phases to where it is largest."""
    start, end = span
    starts = _beside(record, scan, start, stride)
    fine = pulses(record, scan, form, [(one, end) for one in starts])
    start = starts[fine.best]
    if end is None:
        return float(fine.statistic.max()), start, None
    ends = _beside(record, scan, end, stride)
    fine = pulses(record, scan, form, [(start, one) for one in ends])
    return float(fine.statistic.max()), start, ends[fine.best]


def _beside(record: ScanRecord, scan: Scan, place: Place, stride: int) -> list[Place]:
    factor, apart = record.sampling.factor, -phases(record).step
    native = [place[0] * factor + place[1] + k * stride * apart for k in range(-REACH, REACH + 1)]
    places = [(-(-one // factor), one - -(-one // factor) * factor) for one in native]
    return within(record, scan, places)


def within(record: ScanRecord, scan: Scan, places: Sequence[Place]) -> list[Place]:
    """Return the places at which a scan allows an onset, in the order of time."""
    lead, s = record.sampling.lead, scan.order
    kept = [place for place in places if s + lead <= place[0] < scan.n_samples - s]
    return sorted(kept, key=lambda place: record.onset_s(*place))
