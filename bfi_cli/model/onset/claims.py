"""What a scan over all onsets says of the shapes that it looked for: declared, suspected, excluded or not seen.

The rule that decides, a threshold on the statistic, is turned into the magnitude that a fault of each shape would have
needed at every onset (`kernels.onset.scan`). The worst onset counts: a claim that there is no step above a size holds
from three orders of samples after the window's start to two before its end.

A claim that there is no step means no lag and no ramp either, and these are followed by the model rather than predicted
wrong: a threshold would ask for several times the tolerance. What excludes them is the record itself, by how much
likelier it is without such a fault than with one, whatever its onset. Limits are at 95 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...decision import (
    KINDS,
    MOSTLY,
    NOT_EXACT,
    UNTESTED,
    Candidate,
    candidate_of,
    untested,
    with_limit,
)
from ...faults import Fault
from ...faults.shapes import SCANNED, SHAPES, Kind, Shape
from ...kernels import ONE_SIDED_90, ONE_SIDED_95, BoolArray, FloatArray, IntArray
from ...kernels.onset.frequency import PEAKS, frequency_grid, screen_grid
from ...kernels.onset.profile import peaks
from ...kernels.onset.scan import (
    ENDING,
    SPAN,
    STARTING,
    Profile,
    Scan,
    excluded_error,
    likelihood_ratios,
    mean_ratios,
    profile_with_deviances,
    scan_shape,
    undeclared_magnitudes,
)
from ...kernels.onset.waveform import Waveform
from ...kernels.progress import Report, parts, shares, silent
from ...quantities.text import instant
from ..preprocessing.defaults import is_any
from .decision import Rule
from .estimate import Estimate
from .scan import HypothesisScan, Peak
from .scan_record import ScanRecord
from .shapes import LARGEST_SHARE, ShapeHypothesis, fault_of, hypothesis_of, waveform

# A claim of no oscillation holds for those with at least so many cycles in the window, of which two are left after the
# onset: slower ones are bends, which a change of thrust or wind makes as well. With four cycles in place of six the
# claim could be made in 67 instead of 80 % of 39 fault-free windows of two recorded flights.
CLAIMED_CYCLES, CYCLES_LEFT = 6.0, 2.0
# Frequencies spread over the band, for the sizes that a claim covers; those that stand out are looked at beside them.
FREQUENCIES = 8
# Steps by which the equation of `likelier_by` is solved: from the fourth on they move its root by less than 1e-3.
STEPS = 6
# Onsets, spread over the window, at which the size that would be declared is sought: its median over them is stated.
SIZED = 25
# Of more hypotheses than the first, one of so many onsets as the second is looked at, and all of them for as many that
# hide most, and as many that are likeliest. Chosen without tuning.
FULL, GLANCED = 2, 5
# Lags and ramps that a claim about steps covers.
BUILT_UP: tuple[Shape, ...] = tuple(name for name, shape in SHAPES.items() if shape.claimed_s)
# Shapes that are excluded by the likelihood of the record, not by the size that they would have needed: at the worst of
# many onsets and frequencies that is several times the tolerance, while the record as a whole leaves no doubt: the
# claim that there is no oscillation can be made in all instead of half of the fault-free windows of two recorded
# flights (docs/theory.md, 8.5).
WEIGHED: tuple[Shape, ...] = tuple(name for name in SCANNED if SHAPES[name].kind != "slow")
# A size is excluded where the record is at most so many times as likely with such a fault as without, in the mean over
# onsets and signs. Where one onset is known, a fault of z standard deviations is excluded with a probability of up to
# Phi(-z / 2 - q^2 / 2 z), at most Phi(-q) = 5 %, which unknown onsets meet too (docs/theory.md, 8.5). A shape is
# suspected where faults beyond the tolerance explain the record better than none does.
EXCLUDED, SUSPECTED = 0.5 * math.exp(-0.5 * ONE_SIDED_95**2), 1.0
# Errors at which the likelihood is asked, in tolerances: limits from a thousandth to a hundred of them.
PER_DECADE = 6
ERRORS = np.geomspace(0.001, 100.0, 5 * PER_DECADE + 1)


@dataclass(frozen=True, kw_only=True, eq=False)  # without slots, so that it keeps its times
class Limits:
    """The sizes of a hypothesis that the scan would declare, and excludes, by onset: scaled.

    Attributes
    ----------
    record : of the scan; form : the hypothesis; profile : over the onsets that a claim covers.
    sized : over the onsets, all or some, at which there are (n_sized,):
    declared : magnitude that is declared with 90 % power, infinite where none is.
    seen : largest error of the magnitude that is declared or suspected with 90 % power.
    excluded : magnitude beyond which the record excludes the fault, infinite where none is; effect : its largest error.
    ratios : (n_errors, n_onsets) likelihood ratios of the record with a fault that makes an error of `ERRORS`
        tolerances against none; None where sizes alone exclude.
    tolerance : of the channel.
    """

    record: ScanRecord
    form: ShapeHypothesis
    profile: Profile
    sized: Profile
    declared: FloatArray
    seen: FloatArray
    excluded: FloatArray
    effect: FloatArray
    ratios: FloatArray | None = None
    tolerance: float = np.nan

    @cached_property
    def onset_s(self) -> FloatArray:
        """(n_onsets,) the onsets that a claim covers, on the log's axis."""
        return self.record.onsets_s(self.profile.onsets + self.record.sampling.lead)

    def hidden(self, near: BoolArray | None = None) -> tuple[float, float]:
        """Return magnitude and error that are excluded at the worst of the onsets, those `near` (n_onsets,) or all.

        Likelihood ratios are averaged over them.
        """
        if self.ratios is None:
            worst = int(np.argmax(self.effect if near is None else np.where(near, self.effect, -1.0)))
            return float(self.excluded[worst]), float(self.effect[worst])
        ratios = self.ratios if near is None else self.ratios[:, near]
        error = excluded_error(self.tolerance * ERRORS, ratios.mean(axis=1), EXCLUDED)
        return error, error

    def near(self, onset_s: float, near_s: float) -> tuple[tuple[float, float], FloatArray] | None:
        """Return what is `hidden` at the onsets near one, and the errors that are `seen` there; None without any."""
        near = np.abs(self.onset_s - onset_s) <= near_s
        if not near.any():
            return None
        sized_s = self.record.onsets_s(self.sized.onsets + self.record.sampling.lead)
        return self.hidden(near), self.seen[np.abs(self.onset_s[near][:, None] - sized_s).argmin(axis=1)]

    @property
    def beyond(self) -> float:
        """How much likelier the record is with a fault beyond the tolerance than without; 0 without ratios."""
        if self.ratios is None:
            return 0.0
        errors = self.tolerance * ERRORS
        means = mean_ratios(errors, self.ratios)
        return float(np.interp(np.log(self.tolerance), np.log(errors[: len(means)]), means))


def claims_of(
    record: ScanRecord,
    first: HypothesisScan,
    last: HypothesisScan,
    estimates: Sequence[Estimate],
    rule: Rule,
    tolerances: Mapping[str, float],
    scans: Sequence[Scan],
    *,
    order: int,
    rivals: Collection[tuple[Shape, int]] = (),
    doubted: Mapping[tuple[Shape, int], str],
    claims: Collection[Kind] = KINDS,
    report: Report = silent,
) -> tuple[Candidate, ...]:
    """Return one candidate per shape and channel, and of lags and ramps where steps are looked for.

    Parameters
    ----------
    first : scan of the outputs as measured; last : of the outputs less the faults.
    estimates : the declared faults; rule : by which they were.
    tolerances : by output; scans : of each, see `rivals.scans_beside`.
    order : of the model that is left without the faults.
    rivals : shape and output of what may stand in place of a declared fault: it is suspected.
    claims : kinds of fault of which limits are sought; of others there is a candidate where it stands out.
    doubted : why a shape on an output that stands out is not declared.
    report : called with the fraction that is done.
    """
    settings, covered = record.settings, covered_s(record, order)
    # A claim about steps covers lags and ramps too.
    beside = [shape for shape in BUILT_UP if shape not in settings.shapes and "bias" in settings.shapes]
    candidates = []
    wanted = [
        (shape, i) for i in range(record.y.shape[1]) for shape in (*settings.shapes, *beside) if record.may_be(shape, i)
    ]
    for (shape, output), share in parts(report, wanted):
        channel, scale, unit = record.output(output)
        alike = (fault for fault in estimates if (fault.form.shape, fault.form.output) == (shape, output))
        declared, peak = next(alike, None), None if shape in beside else first.of(shape, output)
        if peak is None:
            constant_s = claimed_constants_s(shape, settings.duration_s)[0]
            form = ShapeHypothesis(shape=shape, output=output, parameter=constant_s)
        else:
            form = peak.form if declared is None else declared.form
        called = shape if len(settings.outputs) == 1 else f"{shape} on {channel}"
        candidate = candidate_of(
            fault_of(form, channel),
            unit,
            name=record.names.get((shape, output), called),
            kind=SHAPES[shape].kind,
            declared=declared is not None,
            magnitude=None if declared is None else scale * declared.z,
            sd=None if declared is None else scale * declared.sd,
            tolerance=tolerances[channel],
        )
        first_s, last_s = record.onsets_of(shape, output)
        span_s = max(covered[0], first_s), min(covered[1], last_s)
        if declared is None:
            suspicion = doubted.get((shape, output))
            if suspicion is None and peak is not None:
                suspicion = _suspicion(rule, first, estimates, peak)
            if suspicion is None and (shape, output) in rivals:
                suspicion = f"a {shape} in place of what is declared would explain the log nearly as well"
            if candidate.kind in claims:
                seen = last.standing_out.get(output)
                candidate = _bounded(record, scans[output], rule, candidate, form, peak, seen, share)
            elif suspicion is None:
                continue
            if suspicion is not None:
                candidate = replace(candidate, state="suspected", note=suspicion)
            candidate = replace(candidate, onsets_checked=(span_s,) if span_s[0] <= span_s[1] else ())
        if candidate.state != "suspected":
            candidate = replace(candidate, note=_narrowed(candidate, span_s, covered))
        candidates.append(candidate)
    return tuple(candidates)


def _narrowed(candidate: Candidate, span_s: tuple[float, float], covered: tuple[float, float]) -> str | None:
    """Return the note of a claim, with its onsets where the dictionary asks for fewer than the window could tell."""
    if span_s[0] > span_s[1]:
        return UNTESTED
    if span_s == covered:
        return candidate.note
    onsets = f"that begins from {instant(span_s[0])} to {instant(span_s[1])} s"
    return f"{candidate.note} {onsets}" if candidate.note and candidate.shape == "sine" else onsets


def _bounded(
    record: ScanRecord,
    scan: Scan,
    rule: Rule,
    candidate: Candidate,
    form: ShapeHypothesis,
    peak: Peak | None,
    seen: Sequence[float] | None,
    report: Report,
) -> Candidate:
    """Return a candidate with its likeliest magnitude and its limits; a shape that is weighed may be suspected.

    Parameters
    ----------
    form : its hypothesis; peak : of the shape where it is looked for; seen : see `standing_out_hz`.
    """
    searching, looking = shares(report, 1, 2)
    forms, is_weighed = _claimed(record, scan, form, seen, searching), form.shape in WEIGHED
    if not forms:
        return replace(candidate, note="the window is too short for an oscillation")
    assert candidate.tolerance is not None
    # Every onset counts for the hypotheses that hide most only: fewer onsets tell which these are.
    every = GLANCED if is_weighed and len(forms) > FULL else 1
    looks = glances = [
        limits
        for claimed, _ in parts(looking, forms)
        if (limits := _limits(record, scan, claimed, rule, candidate.tolerance, every=every)) is not None
    ]
    if not glances:
        return candidate if peak is None or is_weighed else _with_magnitude(record, candidate, form, peak.profile)
    if every > 1:
        keys: tuple[Callable[[Limits], Any], ...] = (Limits.hidden, lambda limits: limits.beyond)
        worst = {limits for key in keys for limits in sorted(glances, key=key)[-FULL:]}
        looks = []
        for limits in (limits for limits in glances if limits in worst):
            wave, onsets = waveform(limits.form, record.sampling), _covered(record, scan, limits.form)
            profile, ratios = _weighed(scan, wave, onsets, limits.tolerance)
            looks.append(replace(limits, profile=profile, ratios=ratios))
    likeliest = max(looks, key=lambda limits: (limits.beyond, float(limits.profile.statistic.max())))
    covers, named = _in_words(
        form.shape, [claimed.parameter or 0.0 for claimed in forms], likeliest.form.parameter or 0.0
    )
    candidate = replace(_with_magnitude(record, candidate, form, likeliest.profile), note=covers)
    if likeliest.beyond >= SUSPECTED:
        note = (
            f"the log is {likeliest.beyond:.2g} times as likely with {named} beyond the tolerance as without, most of "
            f"all from {instant(likeliest.onset_s[likeliest.profile.best])} s on; see --shape {form.shape}"
        )
        candidate = replace(candidate, state="suspected", note=note)
    if form.shape in record.settings.shapes:
        median = float(np.median([np.median(limits.declared) for limits in glances]))
        candidate = replace(candidate, minimal_detectable_scan=float(record.unit[form.output]) * median)
    hidden = max((limits.hidden() for limits in looks), key=lambda hidden: hidden[1])
    return _with_hidden(record, candidate, form, hidden, np.concatenate([limits.seen for limits in glances]))


def _with_hidden(
    record: ScanRecord,
    candidate: Candidate,
    form: ShapeHypothesis,
    hidden: tuple[float, float],
    seen: FloatArray,
    slope: float = 1.0,
) -> Candidate:
    """Return a candidate with the limits of a scan; with none where its channel may read nothing but the fault.

    Parameters
    ----------
    hidden, seen : scaled magnitude and error that are excluded, and errors that are seen, see `Limits`.
    slope : magnitude of the hypothesis for a magnitude of 1 of the candidate.
    """
    excluded, effect = hidden
    scale, tolerance = float(record.unit[form.output]), candidate.tolerance or 0.0
    # What is scanned as another shape is seen by the likelihood of faults beyond the tolerance.
    least = 0.0 if form.shape in record.settings.shapes else tolerance / scale
    if is_any(scale * effect, record.window.log, candidate.channel):
        return with_limit(candidate, None, None)
    seen_above = scale * max(least, effect, float(np.quantile(seen, MOSTLY, method="higher")))
    return with_limit(candidate, scale * effect, scale / slope * excluded, seen_above)


def _with_magnitude(record: ScanRecord, candidate: Candidate, form: ShapeHypothesis, profile: Profile) -> Candidate:
    """Return a candidate with the magnitude of the likeliest onset of a profile."""
    scale, best = float(record.unit[form.output]), profile.best
    return replace(candidate, magnitude=scale * float(profile.z[best]), sd=scale * float(profile.sd[best]))


def _in_words(shape: Shape, values: Sequence[float], likeliest: float) -> tuple[str | None, str]:
    """Return of which frequencies, time constants or durations a claim is, and the likeliest of its hypotheses."""
    if shape == "sine":
        return f"of {min(values):.2g} to {max(values):.2g} Hz", f"an oscillation of {likeliest:.3g} Hz"
    if shape not in BUILT_UP:
        return None, "a step"
    return f"over up to {max(values):.3g} s", f"a {'lag' if shape == 'lagged_bias' else 'ramp'} over {likeliest:.3g} s"


def claims_near_onsets(
    record: ScanRecord,
    rule: Rule,
    faults: Sequence[Fault],
    tolerance_s: float,
    tolerances: Mapping[str, float],
    scans: Sequence[Scan],
    *,
    order: int,
    report: Report = silent,
) -> tuple[Candidate, ...]:
    """Return one candidate per fault of a dictionary, excluded at the worst of the onsets that it may have.

    Parameters
    ----------
    faults : of the dictionary; `tolerances`, `scans` and `order` as in `claims_of`.
    tolerance_s : how far the onset of a fault may be from that of the dictionary.
    report : called with the fraction that is done.
    """
    form_limits = dict[ShapeHypothesis, Limits | None]()
    # An onset lies between two samples of the analysis.
    near_s = tolerance_s + 1.0 / record.settings.rate_hz
    earliest_s, latest_s = covered_s(record, order)
    candidates = []
    for fault, _ in parts(report, faults):
        candidate = candidate_of(fault, "", tolerance=tolerances.get(fault.channel), onset_s=fault.onset_s)
        form = hypothesis_of(fault, record.settings.outputs)
        if not earliest_s <= fault.onset_s <= latest_s:
            candidates.append(untested(candidate))
        elif form is None or form.shape not in (*record.settings.shapes, *BUILT_UP):
            candidates.append(replace(candidate, note=NOT_EXACT.format(": the scan does not look for it")))
        else:
            if form not in form_limits:
                scan, tolerance = scans[form.output], tolerances[fault.channel]
                form_limits[form] = _limits(record, scan, form, rule, tolerance, is_suspected=False)
            limits = form_limits[form]
            near = None if limits is None else limits.near(fault.onset_s, near_s)
            slope = abs(fault.slope or 1.0)
            candidates.append(
                untested(candidate) if near is None else _with_hidden(record, candidate, form, *near, slope)
            )
    return tuple(candidates)


def _claimed(
    record: ScanRecord, scan: Scan, form: ShapeHypothesis, seen: Sequence[float] | None, report: Report
) -> list[ShapeHypothesis]:
    """Return the hypotheses that a claim about a shape must cover: its frequencies, time constants or durations.

    Frequencies are some in the whole band, those that stand out most on the scan's grid, between which others hardly
    stand out more, and the likeliest.

    Parameters
    ----------
    form : the likeliest of the shape; seen : see `standing_out_hz`.
    """
    if form.shape in BUILT_UP:
        values = claimed_constants_s(form.shape, record.settings.duration_s)
    elif form.shape == "sine":
        low, high = claimed_band_hz(record.band_hz, record.settings.duration_s)
        if low >= high:
            return []
        likeliest = [form.parameter] if form.parameter is not None and low <= form.parameter <= high else []
        spread, stand_out = np.geomspace(low, high, FREQUENCIES), standing_out_hz(record, scan, report, seen=seen)
        values = sorted({*spread.tolist(), *stand_out, *likeliest})
    else:
        return [scanned for scanned in record.forms if (scanned.shape, scanned.output) == (form.shape, form.output)]
    return [replace(form, parameter=value) for value in values]


def claimed_band_hz(band_hz: tuple[float, float], duration_s: float) -> tuple[float, float]:
    """Return the lowest and the highest frequency of a claim about oscillations; none where they are not in order.

    Parameters
    ----------
    band_hz : of the oscillations that are looked for; duration_s : of the window.
    """
    low, high = band_hz
    return max(low, CLAIMED_CYCLES / duration_s), high


def claimed_constants_s(shape: Shape, duration_s: float) -> list[float]:
    """Return the time constants or durations of the lags or ramps that a claim about steps covers, ascending."""
    return sorted({min(seconds, LARGEST_SHARE * duration_s) for seconds in SHAPES[shape].claimed_s})


def standing_out_hz(
    record: ScanRecord, scan: Scan, report: Report = silent, *, seen: Sequence[float] | None = None
) -> list[float]:
    """Return the frequencies of a claim about oscillations that stand out on the grid of the scan, the most first.

    Parameters
    ----------
    seen : those that stand out, cycles per sample, where they are known.
    """
    low, high = claimed_band_hz(record.band_hz, record.settings.duration_s)
    rate_hz = record.sampling.rate_hz
    if low >= high:
        return []
    if seen is not None:
        return [rate_hz * frequency for frequency in seen if rate_hz * frequency >= low][:PEAKS]
    grid = frequency_grid(scan, record.band)
    claimed = rate_hz * grid >= low
    stands_out = peaks(np.where(claimed, screen_grid(scan, grid, report), 0.0), PEAKS)
    return [float(rate_hz * grid[k]) for k in stands_out if claimed[k]]


def _covered(record: ScanRecord, scan: Scan, form: ShapeHypothesis) -> IntArray:
    """Return the onsets that a claim looks at; of an oscillation those with cycles left.

    Every sample is an onset, for a sample beside it a fault is hardly seen: with every third sample a sixth of the lags
    and ramps of five standard deviations that were in simulated records were excluded.
    """
    onsets = record.admitted_onsets(scan, form)
    if form.shape == "sine" and form.parameter is not None:
        onsets = onsets[onsets <= scan.n_samples - CYCLES_LEFT * record.sampling.rate_hz / form.parameter]
    return onsets


def likelier_by(n_onsets: int) -> float:
    """Return the standard deviations by which a fault stands out of a record that is as likely with as without it.

    Its onset is one of so many, of either sign, and its size anywhere in `SPAN`: by Laplace's method
    exp(s^2 / 2) = 2 n s ln(SPAN) / sqrt(2 pi).
    """
    deviations = 1.0
    for _ in range(STEPS):
        deviations = math.sqrt(2.0 * math.log(2.0 * n_onsets * deviations * math.log(SPAN) / math.sqrt(2.0 * math.pi)))
    return deviations


def _limits(
    record: ScanRecord,
    scan: Scan,
    form: ShapeHypothesis,
    rule: Rule,
    tolerance: float,
    *,
    every: int = 1,
    is_suspected: bool = True,
) -> Limits | None:
    """Return the limits of a hypothesis; None where there is no onset that a claim covers.

    Parameters
    ----------
    rule : above whose statistics a fault is declared, and suspected; tolerance : of the channel.
    every : of so many onsets one is looked at.
    is_suspected : whether a fault is suspected too where the record is likelier with it.
    """
    wave, onsets = waveform(form, record.sampling), _covered(record, scan, form)[::every]
    if onsets.size == 0:
        return None
    suspicion, least, ratios = rule.suspicion(form.shape), 0.0, None
    if form.shape in WEIGHED:
        least = tolerance / float(record.unit[form.output])
        profile, ratios = _weighed(scan, wave, onsets, least)
        sized = profile.take(np.linspace(0, len(onsets) - 1, min(SIZED, len(onsets))).astype(np.intp))
        if is_suspected:
            suspicion = min(suspicion, profile.dispersion * likelier_by(every * len(onsets)) ** 2)
    else:
        profile = sized = scan_shape(scan, wave, onsets)
    dispersion = profile.dispersion

    def with_power(statistic: float) -> float:
        return (math.sqrt(statistic) + ONE_SIDED_90 * math.sqrt(dispersion)) ** 2

    declared, suspected, admitted = undeclared_magnitudes(
        scan,
        wave,
        sized,
        power=with_power(rule.threshold(form.shape)),
        suspicion=with_power(suspicion),
        doubt=ONE_SIDED_95**2 * dispersion,
    )
    excluded, largest = np.maximum(declared, admitted), wave.largest(scan.n_samples - sized.onsets)
    return Limits(
        record=record,
        form=form,
        profile=profile,
        sized=sized,
        declared=declared,
        seen=np.minimum(declared * largest, np.maximum(suspected * largest, least)),
        excluded=excluded,
        effect=excluded * largest,
        ratios=ratios,
        tolerance=tolerance / float(record.unit[form.output]),
    )


def _weighed(scan: Scan, wave: Waveform, onsets: IntArray, tolerance: float) -> tuple[Profile, FloatArray]:
    """Return profile and likelihood ratios of a waveform over (n_onsets,) onsets, see `Limits`."""
    magnitudes = tolerance * ERRORS[:, None] / wave.largest(scan.n_samples - onsets)
    profile, both_signs = profile_with_deviances(scan, wave, onsets, magnitudes)
    return profile, likelihood_ratios(both_signs, dispersion=profile.dispersion)


def _suspicion(rule: Rule, first: HypothesisScan, estimates: Sequence[Estimate], peak: Peak) -> str | None:
    """Return why a shape that is not declared is suspected, None where it is not.

    A shape that stood out in the record as measured is suspected where it explains the record worse than the declared
    faults by less than fault-free records show.
    """
    shape, threshold, suspicion = peak.form.shape, rule.threshold(peak.form.shape), rule.suspicion(peak.form.shape)
    exceeds = f"its statistic {peak.statistic:.3g} exceeds the threshold"
    if not estimates and peak.statistic > threshold:
        return f"{exceeds} {threshold:.3g}, but it was declined"
    if not estimates and peak.statistic > suspicion:
        nearest = f"{suspicion:.3g} of the nearest calibration"
        return f"{exceeds} {nearest}, but not {threshold:.3g}, which counts where none fits"
    explained = max((other.statistic for other in first.peaks if other.form.output == peak.form.output), default=0.0)
    if estimates and peak.statistic > threshold > explained - peak.statistic:
        return (
            f"a {shape} alone would explain the log nearly as well (statistic {peak.statistic:.3g}, the best "
            f"{explained:.3g})"
        )
    return None


def covered_s(record: ScanRecord, order: int) -> tuple[float, float]:
    """Return the first and the last onset that the scan searches, and for which its claims hold."""
    lead = record.sampling.lead
    return record.onset_s(STARTING * order + lead), record.onset_s(len(record.time_s) - ENDING * order + lead)
