"""From the peak of a scan to an onset with its interval and a magnitude with its standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.onset_scan import Profile, scan_shape
from ..kernels.onset_tables import Scan
from ..kernels.progress import Report, Step, silent, steps
from .joint import Likelihood
from .oscillation import Sinusoid, measured, place, statistics
from .pulses import Fine, phases, pulses, step_s, within
from .record import DECIMALS, ScanRecord
from .shapes import Form, Place, signal, waveform
from .sweep import Peak, scan_of

__all__ = ["DROP", "NORMAL", "Estimate", "estimate"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

DROP = 3.841458820694124
NORMAL = 1.959963984540054
BESIDE = 2
STRIDE = 3
ROUNDS = 2
# Fits and scans after which an estimate is said to be half done: about the median of those of the shipped logs.
STEPS = 150


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
    is_told : the record tells the frequency of an oscillation; if not, other slow shapes do as well.
    """

    form: Form
    onset_s: float
    onset_ci95: tuple[float, float]
    offset_s: float | None
    z: float
    sd: float
    signal: FloatArray
    statistic: float
    is_told: bool = True


def estimate(
    record: ScanRecord,
    y: FloatArray,
    peak: Peak,
    *,
    order: int,
    dispersion: float = 1.0,
    jump_s: float | None = None,
    report: Report = silent,
) -> Estimate:
    """Return the fault of a peak.

    Parameters
    ----------
    y : (n_samples, n_outputs) what was scanned.
    order : of the model.
    dispersion : how many times the statistic of other onsets exceeds what white noise would make it, at least 1.
    jump_s : where a step was seen, on the log's axis: where an oscillation of another phase than 0 may begin.
    report : told how far it is.
    """
    step = steps(report, STEPS)
    if peak.form.shape == "sine":
        likelihood = Likelihood(record=record, y=y, order=order, step=step)
        one = measured(
            likelihood,
            peak,
            dispersion=dispersion,
            jump=None if jump_s is None else record.native(jump_s),
        )
        form = replace(peak.form, parameter=one.frequency_hz, phase_rad=one.phase_rad)
        fine, end = _around(likelihood, peak, one)
        z, is_told = one.z, one.is_told_by_the_record
    else:
        scan = scan_of(record, y, order, output=peak.form.output)
        form, (fine, end) = peak.form, _refined(record, scan, peak, DROP * dispersion, step)
        z, is_told = float(fine.z[fine.best]), True
    report(1.0)
    best, missing = fine.best, fine.statistic.max() - fine.statistic
    inside = np.flatnonzero(missing <= DROP * dispersion)
    return Estimate(
        form=form,
        onset_s=float(fine.onset_s[best]),
        onset_ci95=(_beyond(fine, int(inside[0]), -1), _beyond(fine, int(inside[-1]), 1)),
        offset_s=None if end is None else record.onset_s(*end),
        z=z,
        sd=_spread(fine, np.exp(-0.5 * missing / dispersion), dispersion),
        signal=z * signal(form, record.sampling, fine.places[best], end),
        statistic=float(fine.statistic[best]),
        is_told=is_told,
    )


def _around(likelihood: Likelihood, peak: Peak, one: Sinusoid) -> tuple[Fine, Place | None]:
    """Return the profile over the start of an oscillation, and its end."""
    record = likelihood.record
    factor = record.sampling.factor
    half = int(np.ceil(0.5 * record.sampling.rate_hz * factor / one.frequency_hz))
    stride = -phases(record).step
    offsets = {*range(-half, half + 1, factor), *range(-BESIDE * factor, BESIDE * factor + 1, stride), 0}
    earliest = (likelihood.order + record.sampling.lead) * factor
    latest = (record.sampling.n_samples - likelihood.order) * factor if one.end is None else one.end - factor
    starts = sorted(one.start + k for k in offsets if k == 0 or earliest <= one.start + k < latest)
    statistic, z = statistics(likelihood, peak, one, starts)
    statistic[starts.index(one.start)] = max(one.statistic, statistic.max())
    places = tuple(place(start, factor) for start in starts)
    fine = Fine(
        places=places,
        onset_s=np.array([record.onset_s(*at) for at in places]),
        z=z,
        sd=np.full(len(z), one.sd),
        statistic=statistic,
        step_s=step_s(record),
    )
    return fine, None if one.end is None else place(one.end, factor)


def _beyond(fine: Fine, last: int, side: int) -> float:
    """Return the first onset that the profile does not admit, beyond the last that it does."""
    k = last + side
    onset_s = fine.onset_s[k] if 0 <= k < len(fine.onset_s) else fine.onset_s[last] + side * fine.step_s
    return round(float(onset_s), DECIMALS)


def _spread(fine: Fine, weight: FloatArray, dispersion: float) -> float:
    """Return the standard deviation of the magnitude, its change with the onset included; NaN where there is none."""
    seen = np.isfinite(fine.sd)
    if not seen[fine.best]:
        return float("nan")
    squares = dispersion * fine.sd[seen] ** 2 + (fine.z[seen] - fine.z[fine.best]) ** 2
    return float(np.sqrt(np.sum(weight[seen] * squares) / np.sum(weight[seen])))


def _refined(record: ScanRecord, scan: Scan, peak: Peak, drop: float, step: Step) -> tuple[Fine, Place | None]:
    """Return the profile with the onsets between the conditioned samples where they matter, and the end."""
    if record.sampling.factor == 1:
        end = None if peak.end is None else (peak.end, 0)
        return _joined(record, [(0, peak.profile)], 1.0 / record.sampling.rate_hz), end
    if peak.end is not None:
        return _ending(record, scan, peak.form, ((peak.onset, 0), (peak.end, 0)), drop, step)
    close = np.flatnonzero(peak.profile.statistic >= peak.profile.statistic.max() - drop)
    nearby = peak.profile.onsets[max(int(close[0]) - BESIDE, 0) : int(close[-1]) + BESIDE + 1]
    return _lasting(record, scan, peak.form, nearby, step), None


def _lasting(record: ScanRecord, scan: Scan, form: Form, nearby: IntArray, step: Step) -> Fine:
    lead = record.sampling.lead
    found = []
    for phase in phases(record):
        step()
        profile = scan_shape(scan, waveform(form, record.sampling, phase), nearby - lead)
        found.append((phase, replace(profile, onsets=nearby)))
    return _joined(record, found, step_s(record))


def _ending(
    record: ScanRecord, scan: Scan, form: Form, span: tuple[Place, Place], drop: float, step: Step
) -> tuple[Fine, Place]:
    """Move end and start in turn between the conditioned samples; the search for both knew sharp edges only.

    The filter smears the edges, so the best start of sharp ones may be far off: starts everywhere are asked again.
    """
    start, end = span
    end = _best_end(record, scan, form, start, end, step)
    every = within(record, scan, [*{start, *((k, 0) for k in range(0, end[0] - 1, STRIDE))}])
    coarse = pulses(record, scan, form, [(one, end) for one in every], step)
    missing = coarse.statistic.max() - coarse.statistic
    close = [one for one, less in zip(every, missing, strict=True) if less <= drop]
    start = every[coarse.best]
    for _ in range(ROUNDS):
        end = _best_end(record, scan, form, start, end, step)
        near = range(start[0] - BESIDE, start[0] + BESIDE + 1)
        places = within(record, scan, [*{*close, *((k, phase) for k in near for phase in phases(record))}])
        fine = pulses(record, scan, form, [(one, end) for one in places if one[0] < end[0] - 1], step)
        start = fine.places[fine.best]
    return fine, end


def _best_end(record: ScanRecord, scan: Scan, form: Form, start: Place, end: Place, step: Step) -> Place:
    latest, factor = record.sampling.n_samples - 1, record.sampling.factor
    ends = [(min(end[0] + k, latest), phase) for k in range(-1, BESIDE) for phase in phases(record)]
    ends = [one for one in ends if one[0] * factor + one[1] > start[0] * factor + start[1]]
    return ends[pulses(record, scan, form, [(start, one) for one in ends], step).best]


def _joined(record: ScanRecord, profiles: Sequence[tuple[int, Profile]], step: float) -> Fine:
    places = [(int(k), phase) for phase, profile in profiles for k in profile.onsets]
    onset_s = np.array([record.onset_s(*place) for place in places])
    ranked = np.argsort(onset_s)
    z, sd, statistic = (np.concatenate([getattr(x, name) for _, x in profiles]) for name in ("z", "sd", "statistic"))
    return Fine(
        places=tuple(places[i] for i in ranked),
        onset_s=onset_s[ranked],
        z=z[ranked],
        sd=sd[ranked],
        statistic=statistic[ranked],
        step_s=step,
    )
