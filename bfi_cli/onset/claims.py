"""What a scan over all onsets says of the shapes that it looked for: declared, suspected, excluded or not seen.

The rule that decides, a threshold on the statistic, is turned into the magnitude that a fault of each shape would have
needed at every onset (`kernels.onset.limits`). The worst onset counts: a claim that there is no step above a size holds
from three orders of samples after the window's start to two before its end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..faults import Fault, magnitude_unit
from ..kernels import FloatArray
from ..kernels.onset.limits import undeclared_magnitudes
from ..kernels.onset.scan import ENDING, STARTING, Profile, Scan, default_onsets, scan_shape
from ..kernels.progress import Report, parts, silent
from ..verdicts import Candidate, kind_of, state_of
from .decision import Rule
from .estimate import Estimate, subtract_faults
from .result import ScanLimit
from .scan import HypothesisScan, Peak, scan_of
from .scan_record import ScanRecord
from .shapes import ShapeHypothesis, fault_of, waveform

__all__ = ["OLDER_NOTE", "POWER", "claims_of", "covered_s", "limits_near_onsets"]

# Quantiles of the normal distribution: 90 % power, and the one-sided 99 % limit.
POWER, LIMIT = 1.2815515655446004, 2.3263478740408408
# A claim of no oscillation holds for those with at least so many cycles in the window, of which two are left after the
# onset: slower ones are bends, which a change of thrust or wind makes as well. With four cycles in place of six the
# claim could be made in 67 instead of 80 % of 39 fault-free windows of two recorded flights.
CLAIMED_CYCLES, CYCLES_LEFT = 6.0, 2.0
FREQUENCIES = 8
# Of the onsets every so many are looked at: magnitudes change slowly with the onset, over several orders of samples.
STRIDE = 3
# Shapes that a scan for steps and drifts misses, watched though not looked for: a statistic of one of them above this
# share of a step's threshold makes steps suspected. Of 39 fault-free windows of two recorded flights a tenth exceeds
# a third; ramps of 10 s that the scan missed were above it in most cases.
WATCHED = (("lagged_bias", 5.0), ("lagged_bias", 10.0), ("ramp_hold", 5.0), ("ramp_hold", 10.0))
WATCH_SHARE, WATCH_LEAST = 0.4, 15.0
# Of a shape that the scan does not look for, the one that it is.
LIKE = {"cosine": "sine"}
OLDER_NOTE = "a fault that began before the window is never excluded: the model's constant can explain it"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """What is known of one hypothesis at the onsets that a claim covers: magnitudes scaled, (n_onsets,).

    Attributes
    ----------
    profile : over the onsets.
    onset_s : on the log's axis.
    detected : magnitude that would be declared with 90 % power.
    excluded : magnitude beyond which the record excludes the fault, infinite where none is; effect : its largest error.
    """

    profile: Profile
    onset_s: FloatArray
    detected: FloatArray
    excluded: FloatArray
    effect: FloatArray

    @property
    def worst(self) -> int:
        """Index of the onset where the hidden error is largest."""
        return int(np.argmax(self.effect))


def claims_of(
    record: ScanRecord,
    first: HypothesisScan,
    estimates: Sequence[Estimate],
    rule: Rule,
    tolerances: Mapping[str, float],
    *,
    order: int,
    report: Report = silent,
) -> tuple[Candidate, ...]:
    """Return one candidate per shape and channel, and those of further shapes that are suspected.

    Parameters
    ----------
    first : scan of the outputs as measured.
    estimates : the declared faults; rule : by which they were.
    tolerances : by output.
    order : of the model that is left without the faults.
    report : called with the fraction that is done.
    """
    settings, log = record.settings, record.window.log
    y = subtract_faults(record.y, *estimates)
    scans = [scan_of(record, y, order, output=i) for i in range(y.shape[1])]
    candidates = []
    for (shape, output), _ in parts(report, [(s, i) for i in range(y.shape[1]) for s in settings.shapes]):
        channel, scale = settings.outputs[output], float(record.unit[output])
        peak = max(
            (one for one in first.peaks if (one.form.shape, one.form.output) == (shape, output)),
            key=lambda one: one.statistic,
        )
        own = [one for one in estimates if (one.form.shape, one.form.output) == (shape, output)]
        forms = _claimed(record, peak)
        every = (_limits(record, scans[output], form, rule.threshold(shape)) for form in forms)
        limits = [one for one in every if one is not None]
        worst = max(limits, key=lambda one: float(one.effect.max()), default=None)
        likeliest = max((one.profile for one in limits), key=lambda one: one.statistic.max(), default=peak.profile)
        z, sd = float(likeliest.z[likeliest.best]), float(likeliest.sd[likeliest.best])
        if own:
            z, sd = own[0].z, own[0].sd
        fault = fault_of(own[0].form if own else peak.form, channel, magnitude=1.0, onset_s=0.0)
        unit = log.channel(channel).unit
        excluded = effect = detectable = None
        if worst is not None and not own:
            detectable = _finite(scale * float(np.median([np.median(one.detected) for one in limits])))
            excluded = _finite(scale * float(worst.excluded[worst.worst]))
            effect = _finite(scale * float(worst.effect[worst.worst]))
        suspicion = None if own else _suspicion(rule, first, estimates, peak, order)
        state = state_of(
            declared=bool(own), suspected=suspicion is not None, effect=effect, tolerance=tolerances[channel]
        )
        note = suspicion
        if note is None and shape == "sine" and not own:
            band = [form.parameter or 0.0 for form in forms]
            note = f"of {min(band):.2g} to {max(band):.2g} Hz" if band else "the window is too short for an oscillation"
        candidates.append(
            Candidate(
                name=shape if len(settings.outputs) == 1 else f"{shape} on {channel}",
                shape=shape,
                channel=channel,
                kind=kind_of(fault, declared=bool(own)),
                state=state,
                magnitude=_finite(scale * z),
                unit=magnitude_unit(fault, unit),
                sd=_finite(scale * sd),
                minimal_detectable_scan=detectable,
                excluded_above=excluded,
                effect=effect,
                tolerance=tolerances[channel],
                channel_unit=unit,
                note=note,
            )
        )
    return (*candidates, *_watched(record, scans, estimates, rule, tolerances))


def limits_near_onsets(
    record: ScanRecord,
    estimates: Sequence[Estimate],
    rule: Rule,
    faults: Sequence[Fault],
    tolerance_s: float,
    *,
    order: int,
) -> tuple[ScanLimit | None, ...]:
    """Return what the scan says of faults of a dictionary, the worst of the onsets that each may have.

    None for a fault of a shape that is not looked for, or whose channel is no output, or whose onset is not covered.

    Parameters
    ----------
    faults : of the dictionary; `estimates` and `order` as in `claims_of`.
    tolerance_s : how far the onset of a fault may be from that of the dictionary.
    """
    y, known = subtract_faults(record.y, *estimates), dict[ShapeHypothesis, Limits | None]()
    scans = [scan_of(record, y, order, output=i) for i in range(y.shape[1])]
    # Onsets are looked at in strides, so those of a stride to either side are counted too.
    near_s = tolerance_s + STRIDE / record.settings.rate_hz
    found: list[ScanLimit | None] = []
    for fault in faults:
        shape = LIKE.get(fault.shape, fault.shape)
        if shape not in record.settings.shapes or fault.channel not in record.settings.outputs:
            found.append(None)
            continue
        output = record.settings.outputs.index(fault.channel)
        parameter = fault.frequency_hz or fault.time_constant_s or fault.duration_s
        form = ShapeHypothesis(shape=shape, output=output, parameter=parameter, file=fault.file)
        if form not in known:
            known[form] = _limits(record, scans[output], form, rule.threshold(shape))
        limits = known[form]
        near = np.zeros(0, dtype=bool) if limits is None else np.abs(limits.onset_s - fault.onset_s) <= near_s
        if limits is None or not near.any():
            found.append(None)
            continue
        # A fault with a slope is so many times that of the hypothesis.
        scale, slope = float(record.unit[output]), abs(fault.slope or 1.0)
        worst = int(np.argmax(np.where(near, limits.effect, -1.0)))
        found.append(
            ScanLimit(
                minimal_detectable=_finite(scale / slope * float(limits.detected[near].max())),
                excluded_above=_finite(scale / slope * float(limits.excluded[worst])),
                effect=_finite(scale * float(limits.effect[worst])),
            )
        )
    return tuple(found)


def _claimed(record: ScanRecord, peak: Peak) -> list[ShapeHypothesis]:
    """Return the hypotheses that a claim about a shape must cover: frequencies, time constants or durations."""
    forms = [one for one in record.forms if (one.shape, one.output) == (peak.form.shape, peak.form.output)]
    if peak.form.shape != "sine":
        return forms
    low, high = record.band_hz
    low = max(low, CLAIMED_CYCLES / record.settings.duration_s)
    if low >= high:
        return []
    bare = replace(peak.form, phase_rad=0.0, anchor=None)
    return [replace(bare, parameter=float(f)) for f in np.geomspace(low, high, FREQUENCIES)]


def _limits(record: ScanRecord, scan: Scan, form: ShapeHypothesis, threshold: float) -> Limits | None:
    """Return the limits of a hypothesis at every onset; None where none is covered."""
    sampling = replace(record.sampling, n_samples=scan.n_samples)
    wave, onsets = waveform(form, sampling), default_onsets(scan)
    last = scan.n_samples - ENDING * scan.order
    if form.shape == "sine" and form.parameter is not None:
        last = min(last, int(scan.n_samples - CYCLES_LEFT * sampling.rate_hz / form.parameter))
    onsets = onsets[onsets <= last]
    onsets = np.unique(np.append(onsets[::STRIDE], onsets[-1:]))
    if onsets.size == 0:
        return None
    profile = scan_shape(scan, wave, onsets)
    dispersion = max(1.0, float(np.mean(profile.statistic)))
    detected, admitted = undeclared_magnitudes(
        scan,
        wave,
        profile,
        power=(np.sqrt(threshold) + POWER * np.sqrt(dispersion)) ** 2,
        doubt=LIMIT**2 * dispersion,
    )
    excluded = np.maximum(detected, admitted)
    reach: FloatArray = np.maximum.accumulate(np.abs(wave.samples * wave.unit))[scan.n_samples - 1 - onsets]
    return Limits(
        profile=profile,
        onset_s=np.array([record.onset_s(int(k) + record.sampling.lead) for k in onsets]),
        detected=detected,
        excluded=excluded,
        effect=excluded * reach,
    )


def _suspicion(rule: Rule, first: HypothesisScan, estimates: Sequence[Estimate], peak: Peak, order: int) -> str | None:
    """Return why a shape that is not declared is suspected, None where it is not.

    A shape that stood out in the record as measured, and would explain it about as well as the declared faults do, is
    suspected where the difference is less than what fault-free records show.
    """
    shape, threshold = peak.form.shape, rule.threshold(peak.form.shape)
    if peak.statistic <= threshold:
        if not estimates and peak.statistic > threshold / rule.raised:
            return (
                f"its statistic of {peak.statistic:.3g} exceeds what the nearest calibration asks for "
                f"({threshold / rule.raised:.3g}), but not what is asked for where none fits ({threshold:.3g})"
            )
        return None
    explained = max((one.statistic for one in first.peaks if one.form.output == peak.form.output), default=0.0)
    if not estimates:
        return f"the {shape} of {peak.statistic:.3g} exceeds its threshold of {threshold:.3g}, but was declined"
    if explained - peak.statistic < threshold:
        return (
            f"a {shape} alone would explain the log nearly as well (statistic {peak.statistic:.3g}, the best "
            f"{explained:.3g})"
        )
    return None


def _watched(
    record: ScanRecord,
    scans: Sequence[Scan],
    estimates: Sequence[Estimate],
    rule: Rule,
    tolerances: Mapping[str, float],
) -> tuple[Candidate, ...]:
    """Return lags and ramps that were not looked for but stand out of the record less its faults, as suspected."""
    if "bias" not in record.settings.shapes:
        return ()
    level = max(WATCH_SHARE * rule.threshold("bias"), WATCH_LEAST)
    found = []
    for output, scan in enumerate(scans):
        channel, scale = record.settings.outputs[output], float(record.unit[output])
        unit = record.window.log.channel(channel).unit
        for shape, parameter in WATCHED:
            if shape in record.settings.shapes or parameter > record.settings.duration_s / 4.0:
                continue
            form = ShapeHypothesis(shape=shape, output=output, parameter=parameter)
            sampling = replace(record.sampling, n_samples=scan.n_samples)
            profile = scan_shape(scan, waveform(form, sampling), default_onsets(scan)[::STRIDE])
            best = profile.best
            if profile.statistic[best] <= level:
                continue
            onset_s = record.onset_s(int(profile.onsets[best]) + record.sampling.lead)
            found.append((float(profile.statistic[best]), form, channel, scale, unit, profile, onset_s))
    if not found:
        return ()
    statistic, form, channel, scale, unit, profile, onset_s = max(found, key=lambda one: one[0])
    z, sd = scale * float(profile.z[profile.best]), scale * float(profile.sd[profile.best])
    fault = fault_of(form, channel, magnitude=1.0, onset_s=onset_s)
    word = "lag" if form.shape == "lagged_bias" else "ramp"
    return (
        Candidate(
            name=form.shape,
            shape=form.shape,
            channel=channel,
            kind="abrupt",
            state="suspected",
            magnitude=_finite(z),
            unit=magnitude_unit(fault, unit),
            sd=_finite(sd),
            tolerance=tolerances[channel],
            channel_unit=unit,
            note=(
                f"not looked for, but a {word} over {form.parameter:g} s from {onset_s:.6g} s has a statistic of "
                f"{statistic:.3g}; see --shape {form.shape}"
            ),
        ),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def covered_s(record: ScanRecord, order: int) -> tuple[float, float]:
    """Return the first and the last onset for which the claims hold."""
    return record.onset_s(STARTING * order), record.onset_s(len(record.time_s) - ENDING * order)
