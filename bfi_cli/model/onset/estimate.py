"""From the peak of a scan to an onset with its interval and a magnitude with its standard deviation.

The scans know onsets on conditioned samples only, and of faults that end only sharp edges. That suffices to detect a
fault but not to estimate it: here starts and ends lie on the log's own samples, smeared by the filter as in the record.

The scan's rate and order are those at which most faults are detected. An estimate needs more of what the recorder left
above its edge, and its interval the spread between rates and between models with and without a root at 1, which a
single model does not show (docs/theory.md, 5.2): so magnitudes of what is declared are estimated together at the rate
of an estimate, as `identify` would with their onsets given.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...config import Config
from ...decision import estimate_of
from ...dictionary import Dictionary
from ...errors import DictionaryError, LogError
from ...faults import FaultEstimate
from ...faults.filters import BETWEEN_RECORDERS, alternatives, response_of
from ...faults.shapes import Shape
from ...flightlog import FlightLog
from ...kernels import TWO_SIDED_95, FloatArray
from ...kernels.model_selection import Penalty, least_criterion
from ...kernels.onset import waveform as waveforms
from ...kernels.onset.scan import Scan, scan_shape
from ...kernels.progress import Report, Step, parts, shares, silent, steps
from ...kernels.variable_projection import fit_magnitudes
from ..preprocessing.magnitudes import at_half_rate, estimate_magnitudes, overdispersion
from ..preprocessing.regression import scored_by
from ..preprocessing.window import prepare_window, regression_of
from .scan import Peak, lasting_peak, scan_of
from .scan_record import DECIMALS, ScanRecord
from .shapes import ShapeHypothesis, SubsampleIndex, fault_of, signal, subsample_index, waveform

if TYPE_CHECKING:
    from .oscillation import OscillationSearch, Sinusoid

# Quantile of the normal distribution for an interval of 95 %; an onset's holds what is within its square of the best
# statistic (chi-square of one degree of freedom).
DROP = TWO_SIDED_95**2
# Starts tried per conditioned sample: a bound on the time where the log's own rate is far higher.
MOST_PHASES = 10
# Conditioned samples to either side of the scan's onset that are refined: the filter smears a start over a few.
BESIDE = 2
# Of a fault that ends: every third conditioned sample is tried as a start, and start and end are refined so often.
# Set by trial; a stride within the filter's smear skips no maximum.
STRIDE = 3
ROUNDS = 2
# Fits and scans after which an estimate is reported as half done. On the logs of data/ a step takes 5 to 10 of them,
# an oscillation 350 to 850; with a number between them the bar moves for both.
STEPS = 150


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """One fault, magnitudes scaled.

    Attributes
    ----------
    form : the hypothesis, with its frequency or time constant.
    onset_s, onset_ci95 : on the log's axis; NaN where there is no interval.
    offset_s : time at which the fault ends, None where it lasts.
    z, sd : magnitude and its standard deviation, which includes `onset_spread`, that of the magnitude over the likely
        onsets.
    signal : (n_samples,) what the fault adds to its output, conditioned and scaled.
    statistic : of its shape at this onset.
    frequency_is_known : False for an oscillation whose frequency the record hardly tells, so that other slow shapes
        would explain it as well.
    among : shapes that explain the record about as well, its own first.
    highest, p_value : the peak that stood out most where the scan declared it, and the p-value of that; None where the
        method has no test.
    """

    form: ShapeHypothesis
    onset_s: float
    onset_ci95: tuple[float, float]
    offset_s: float | None
    z: float
    sd: float
    onset_spread: float
    signal: FloatArray
    statistic: float
    frequency_is_known: bool = True
    among: tuple[Shape, ...] = ()
    highest: Peak | None = None
    p_value: float | None = None


def as_scanned(record: ScanRecord, peak: Peak) -> Estimate:
    """Return the fault of a peak as the scan has it, on its samples and without an interval of the onset."""
    best, onset_s = peak.profile.best, record.onset_s(peak.onset)
    z = float(peak.profile.z[best])
    end = None if peak.end is None else (peak.end, 0)
    return Estimate(
        form=peak.form,
        onset_s=onset_s,
        onset_ci95=(float("nan"), float("nan")),
        offset_s=None if end is None else record.onset_s(*end),
        z=z,
        sd=float(peak.profile.sd[best]),
        signal=z * signal(peak.form, record.sampling, (peak.onset, 0), end),
        statistic=peak.statistic,
        onset_spread=0.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SubsampleProfile:
    """A profile over onsets that may lie between the conditioned samples; arrays are (n_onsets,)."""

    places: tuple[SubsampleIndex, ...]
    onset_s: FloatArray
    z: FloatArray
    sd: FloatArray
    statistic: FloatArray

    @property
    def best(self) -> int:
        """Index of the largest statistic."""
        return int(np.argmax(self.statistic))


def subtract_faults(y: FloatArray, *faults: Estimate) -> FloatArray:
    """Return outputs y (n_samples, n_outputs), scaled, less what the faults add to them."""
    y = y.copy()
    for fault in faults:
        y[:, fault.form.output] -= fault.signal
    return y


def declared_faults(
    record: ScanRecord, estimates: Sequence[Estimate], tolerances: Mapping[str, float]
) -> tuple[FaultEstimate, ...]:
    """Return faults in SI; `tolerances` are those of the outputs."""
    faults = []
    for estimate in estimates:
        channel, scale, unit = record.output(estimate.form.output)
        magnitude, onset_s, offset_s = scale * estimate.z, estimate.onset_s, estimate.offset_s
        faults.append(
            estimate_of(
                fault_of(estimate.form, channel, magnitude=magnitude, onset_s=onset_s, offset_s=offset_s),
                magnitude,
                scale * estimate.sd,
                unit,
                effect=scale * float(np.abs(estimate.signal).max()),
                tolerance=tolerances[channel],
                onset_ci95=estimate.onset_ci95,
                statistic=estimate.statistic,
                p_value=estimate.p_value,
                among=estimate.among,
            )
        )
    return tuple(faults)


def unit_signals(y: FloatArray, faults: Sequence[Estimate]) -> FloatArray:
    """Return (n_samples, n_outputs, n_faults) what the faults would add to the outputs y with a magnitude of 1."""
    theta = np.zeros((*y.shape, len(faults)))
    for i, fault in enumerate(faults):
        theta[:, fault.form.output, i] = fault.signal / fault.z
    return theta


def estimate(
    record: ScanRecord,
    y: FloatArray,
    peak: Peak,
    *,
    order: int,
    dispersion: float = 1.0,
    jump_s: float | None = None,
    least: float = 0.0,
    report: Report = silent,
) -> Estimate:
    """Return the fault of a peak.

    Parameters
    ----------
    y : (n_samples, n_outputs) the outputs that were scanned.
    order : of the model.
    dispersion : ratio of the mean statistic of other onsets to that of white noise, at least 1.
    jump_s : onset of a step, on the log's axis: an oscillation of another phase than 0 may begin there.
    least : statistic that counts: an oscillation that is far from it is returned as the scan has it, with its frequency
        not known.
    report : called with the fraction that is done.
    """
    step, form, drop = steps(report, STEPS), peak.form, DROP * dispersion
    record, peak, sd_of_recorder = with_likeliest_recorder(record, y, peak, order=order, dispersion=dispersion)
    if form.shape == "sine":
        from .oscillation import HOPELESS, estimate_oscillation, oscillation_search

        search = oscillation_search(record.likelihood(y, order, step), peak)
        jump = None if jump_s is None else record.native(jump_s)
        sinusoid = estimate_oscillation(search, dispersion=dispersion, jump=jump, least=least)
        if sinusoid.statistic < HOPELESS * least:
            report(1.0)
            return replace(as_scanned(record, peak), statistic=sinusoid.statistic, frequency_is_known=False)
        form = replace(form, parameter=sinusoid.frequency_hz, phase_rad=sinusoid.phase_rad)
        fine = _profile_of_starts(record, search, sinusoid, order)
        end = None if sinusoid.end is None else subsample_index(sinusoid.end, record.sampling.factor)
        z, frequency_is_known = sinusoid.z, sinusoid.frequency_is_known
    else:
        scan = scan_of(record, y, order, output=form.output)
        end = None if peak.end is None else (peak.end, 0)
        if end is not None and record.sampling.factor > 1:
            fine, end = _move_start_and_end(record, scan, form, (peak.onset, 0), end, drop, step)
        else:
            fine = _profile_between_samples(record, scan, peak, drop, step)
        z, frequency_is_known = float(fine.z[fine.best]), True
    report(1.0)
    best, missing = fine.best, fine.statistic.max() - fine.statistic
    inside = np.flatnonzero(missing <= drop)
    # The spread of the magnitude is its change over the likely onsets; it is not known where the best onset has no sd.
    sd = spread = float("nan")
    seen = np.isfinite(fine.sd)
    if seen[best]:
        weight = np.exp(-0.5 * missing / dispersion)[seen]
        weight /= weight.sum()
        spread = float(weight @ (fine.z[seen] - fine.z[best]) ** 2) + sd_of_recorder**2
        sd = float(np.sqrt(dispersion * (weight @ fine.sd[seen] ** 2) + spread))
    # The interval ends at the first onsets, on either side, that the profile no longer admits.
    step_s = -_phases(record).step / record.sampling.native_hz
    edges = np.concatenate([fine.onset_s[:1] - step_s, fine.onset_s, fine.onset_s[-1:] + step_s])
    return Estimate(
        form=form,
        onset_s=float(fine.onset_s[best]),
        onset_ci95=(round(float(edges[inside[0]]), DECIMALS), round(float(edges[inside[-1] + 2]), DECIMALS)),
        offset_s=None if end is None else record.onset_s(*end),
        z=z,
        sd=sd,
        onset_spread=float(np.sqrt(spread)),
        signal=z * signal(form, record.sampling, fine.places[best], end),
        statistic=float(fine.statistic[best]),
        frequency_is_known=frequency_is_known,
    )


def with_likeliest_recorder(
    record: ScanRecord, y: FloatArray, peak: Peak, *, order: int, dispersion: float
) -> tuple[ScanRecord, Peak, float]:
    """Return record and peak with the recorder that explains a fault best, where the log's recorder is uncertain.

    Its third value is the spread of the magnitude over the recorders, each weighted by its likelihood; 0 for a recorder
    that is known. A step shows the recorder's response; an oscillation does not, and a fault that ends is left alone.

    Parameters
    ----------
    y : (n_samples, n_outputs) the outputs that were scanned.
    order : of the model.
    dispersion : of the statistic, see `estimate`.
    """
    chains = alternatives(record.window.filters)
    if not chains or peak.end is not None or peak.form.shape == "sine":
        return record, peak, 0.0
    scan = scan_of(record, y, order, output=peak.form.output)
    responses = [response_of(chain, record.sampling.native_hz) for chain in chains]
    records = [
        record,
        *(replace(record, sampling=replace(record.sampling, response=response)) for response in responses),
    ]
    peaks = []
    for through in records:
        nearby = np.arange(peak.onset - BESIDE, peak.onset + BESIDE + 1) - through.sampling.lead
        nearby = nearby[(nearby >= scan.order) & (nearby < scan.n_samples - scan.order)]
        waves = (waveform(peak.form, through.sampling, phase) for phase in _phases(through))
        best = max((scan_shape(scan, wave, nearby) for wave in waves), key=lambda profile: profile.statistic.max())
        peaks.append((float(best.statistic.max()), float(best.z[best.best])))
    statistic, z = np.array(peaks).T
    likeliest = int(np.argmax(statistic))
    weight = np.exp(0.5 * (statistic - statistic[likeliest]) / dispersion)
    spread = float(np.sqrt(np.sum(weight * (z - z[likeliest]) ** 2) / np.sum(weight)))
    chosen = records[likeliest]
    spread = float(np.hypot(spread, BETWEEN_RECORDERS * z[likeliest]))
    return chosen, lasting_peak(chosen, scan, peak.form) if likeliest else peak, spread


def _phases(record: ScanRecord) -> range:
    """Return the phases that are tried, see `shapes.waveform`."""
    factor = record.sampling.factor
    return range(0, -factor, -max(1, -(-factor // MOST_PHASES)))


def _profile_of_starts(
    record: ScanRecord, search: OscillationSearch, sinusoid: Sinusoid, order: int
) -> SubsampleProfile:
    """Return the profile of an oscillation over starts: every conditioned sample within half a period of its start, and
    the log's own samples near it.
    """
    factor = record.sampling.factor
    half = int(np.ceil(0.5 * record.sampling.native_hz / sinusoid.frequency_hz))
    near = range(-BESIDE * factor, BESIDE * factor + 1, -_phases(record).step)
    earliest = (order + record.sampling.lead) * factor
    latest = (record.sampling.n_samples - order) * factor if sinusoid.end is None else sinusoid.end - factor
    offsets = {*range(-half, half + 1, factor), *near, 0}
    starts = sorted(sinusoid.start + k for k in offsets if k == 0 or earliest <= sinusoid.start + k < latest)
    statistic, amplitude = search.profile(sinusoid, starts)
    statistic[starts.index(sinusoid.start)] = max(sinusoid.statistic, statistic.max())
    places = [subsample_index(start, factor) for start in starts]
    return _profile(record, places, amplitude, np.full(len(starts), sinusoid.sd), statistic)


def _profile_between_samples(record: ScanRecord, scan: Scan, peak: Peak, drop: float, step: Step) -> SubsampleProfile:
    """Return the profile of a peak, where it matters at onsets between the conditioned samples."""
    profiles = [(0, peak.profile)]
    if record.sampling.factor > 1:
        close = np.flatnonzero(peak.profile.statistic >= peak.profile.statistic.max() - drop)
        nearby = peak.profile.onsets[max(int(close[0]) - BESIDE, 0) : int(close[-1]) + BESIDE + 1]
        profiles = []
        for phase in _phases(record):
            step()
            profile = scan_shape(scan, waveform(peak.form, record.sampling, phase), nearby - record.sampling.lead)
            profiles.append((phase, replace(profile, onsets=nearby)))
    places = [(int(k), phase) for phase, profile in profiles for k in profile.onsets]
    values = (np.concatenate([getattr(x, name) for _, x in profiles]) for name in ("z", "sd", "statistic"))
    ranked = np.argsort([record.onset_s(*place) for place in places])
    return _profile(record, [places[i] for i in ranked], *(value[ranked] for value in values))


def _profile(
    record: ScanRecord, places: Sequence[SubsampleIndex], z: FloatArray, sd: FloatArray, statistic: FloatArray
) -> SubsampleProfile:
    onset_s = np.array([record.onset_s(*place) for place in places])
    return SubsampleProfile(places=tuple(places), onset_s=onset_s, z=z, sd=sd, statistic=statistic)


def _move_start_and_end(
    record: ScanRecord,
    scan: Scan,
    form: ShapeHypothesis,
    start: SubsampleIndex,
    end: SubsampleIndex,
    drop: float,
    step: Step,
) -> tuple[SubsampleProfile, SubsampleIndex]:
    """Move end and start in turn to the likeliest of the log's own samples; return the profile over starts and the end.

    The scan knew sharp edges only, which the filter smears, so that its start may be far off: starts are tried over the
    whole record once more.
    """
    sampling, phases = record.sampling, _phases(record)

    def profile(spans: Sequence[tuple[SubsampleIndex, SubsampleIndex]]) -> SubsampleProfile:
        points = []
        for begun, ended in spans:
            step()
            first = begun[0] - sampling.lead
            samples = np.zeros(sampling.n_samples)
            samples[: sampling.n_samples - first] = signal(form, sampling, begun, ended)[first:]
            points.append(scan_shape(scan, waveforms.sampled(samples), np.array([first])))
        z, sd, statistic = (
            np.array([getattr(point, name)[0] for point in points]) for name in ("z", "sd", "statistic")
        )
        return _profile(record, [begun for begun, _ in spans], z, sd, statistic)

    def allowed(places: set[SubsampleIndex]) -> list[SubsampleIndex]:
        earliest, latest = scan.order + sampling.lead, scan.n_samples - scan.order
        return sorted((at for at in places if earliest <= at[0] < latest), key=lambda at: record.onset_s(*at))

    def best_end() -> SubsampleIndex:
        ends = [(min(end[0] + k, sampling.n_samples - 1), phase) for k in range(-1, BESIDE) for phase in phases]
        factor = sampling.factor
        ends = [at for at in ends if at[0] * factor + at[1] > start[0] * factor + start[1]]
        return ends[profile([(start, at) for at in ends]).best]

    end = best_end()
    every = allowed({start, *((k, 0) for k in range(0, end[0] - 1, STRIDE))})
    coarse = profile([(at, end) for at in every])
    missing = coarse.statistic.max() - coarse.statistic
    close = [at for at, less in zip(every, missing, strict=True) if less <= drop]
    start = every[coarse.best]
    for _ in range(ROUNDS):
        end = best_end()
        near = range(start[0] - BESIDE, start[0] + BESIDE + 1)
        places = allowed({*close, *((k, phase) for k in near for phase in phases)})
        fine = profile([(at, end) for at in places if at[0] < end[0] - 1])
        start = fine.places[fine.best]
    return fine, end


def measure(
    log: FlightLog, record: ScanRecord, faults: Sequence[Estimate], config: Config, report: Report = silent
) -> list[Estimate]:
    """Return faults with their magnitudes estimated together at the rate of an estimate, onsets and shapes kept.

    They stay as they are where the window is too short for that rate, or cannot tell the faults from each other there,
    and where the recorder is uncertain: each was then measured with the likeliest of several.

    Parameters
    ----------
    log : the whole log, of which the record is the window that `config` states.
    report : receives the progress.
    """
    if not faults:
        return []
    if any(low_pass.uncertain for low_pass in record.window.filters):
        return list(faults)
    atoms = []
    for n, fault in enumerate(faults, 1):
        channel, _, _ = record.output(fault.form.output)
        atom = fault_of(fault.form, channel, onset_s=fault.onset_s, offset_s=fault.offset_s)
        atoms.append(replace(atom, name=f"fault {n}"))
    dictionary = Dictionary(atoms=tuple(atoms), relative_to="log", sha256="", path="start-time")
    preparing, fitting, elsewhere, halving, sizing = shares(report, 1, 1, 2, 1, 2)
    try:
        window = prepare_window(log, dictionary, config, preparing)
        regression = regression_of(window, config)
    except (DictionaryError, LogError):
        return list(faults)
    if len(window.live) < len(faults):
        return list(faults)
    units = np.array([float(record.unit[fault.form.output]) for fault in faults])
    start = np.array([fault.z for fault in faults]) * units / regression.magnitude_unit
    rows = float(regression.n_rows)
    penalty = Penalty(n_rows=regression.n_rows, n_effective=rows, n_candidates=len(faults), evidence=0.0)
    fits = [
        fit_magnitudes(regression.problem(order), range(len(faults)), start)
        for order, _ in parts(fitting, regression.orders)
    ]
    scored, penalty = scored_by(regression, fits, penalty)
    dispersion = overdispersion(window, regression, least_criterion(scored), elsewhere)
    coarse = at_half_rate(window, regression, config, halving)
    estimates = estimate_magnitudes(regression, scored, penalty, dispersion, coarse, sizing)
    z, sd = estimates.value / units, np.sqrt(estimates.variance) / units
    return [
        replace(
            fault,
            z=float(z[n]),
            sd=float(np.hypot(sd[n], fault.onset_spread)),
            signal=fault.signal * (float(z[n]) / fault.z),
        )
        for n, fault in enumerate(faults)
    ]
