"""Sequential detection of faults by a scan over all onsets, their joint re-estimation, and backward elimination."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...config import Config, merge
from ...decision import KINDS, Evidence, conclude
from ...errors import ConfigError
from ...faults import Fault, FaultEstimate
from ...faults.filters import recorder_low_passes
from ...faults.shapes import SCANNED_AS, Kind
from ...flightlog import FlightLog
from ...kernels import TWO_SIDED_95, FloatArray
from ...kernels.progress import Progress, Report, parts, shares, silent, unseen
from ...notes import Note
from ...quantities.text import instant, quantity
from ...threads import one_thread
from ..preprocessing.defaults import manoeuvres_of, tolerances_of, what_would_help
from ..preprocessing.window import with_inputs_of
from .claims import claims_near_onsets, claims_of, covered_s
from .decision import Rule, rule_for
from .estimate import Estimate, declared_faults, estimate, measure, subtract_faults, unit_signals
from .rivals import known_faults, rivals_of, scans_beside, unconfirmed, with_rivals
from .scan import HypothesisScan, Peak, bic_change, lasting_peak, scan_hypotheses, scan_hypothesis, scan_of
from .scan_record import ScanRecord, prepare_record
from .search import OnsetSearch

if TYPE_CHECKING:
    from .result import OnsetResult

# A bound on the time rather than on what a log may hold (docs/theory.md, 9.4).
MOST_FAULTS = 5
# Rounds of re-estimation, which end earlier once no onset moves and no magnitude by a tenth of its standard deviation.
MOST_ROUNDS = 4
UNMOVED = 0.1  # of a standard deviation
# An update may raise twice the negative log-likelihood by this much per sample, so that round-off does not stop the
# refinement; the losses that it must reject, an onset too close to the ends for another order, are far larger.
SLACK = 1e-3
# A kind of fault is told from another where its criterion is lower by this much, ten to one by the likelihoods.
NOT_TOLD = 2.0 * float(np.log(10.0))
# Time constants tried between two of the grid, which are a factor of two apart: a sixth apart in their logarithm.
FINER = 4
# An input moves most where it changes by half of the most it ever does, if that is in no more than 5 % of the samples;
# a fault is beside it within 1.5 s, the time in which an error of the model dies out. Chosen without tuning.
MOST, RARE, BESIDE_S = 0.5, 0.05, 1.5
# An interval of an onset longer than this share of the window says hardly more than that there is a fault.
HARDLY_KNOWN = 0.25


def find_onset(
    log: FlightLog,
    config: Config,
    progress: Progress = unseen,
    *,
    beside: Sequence[Evidence] = (),
    false_alarm: float | None = None,
) -> OnsetResult:
    """Say when a fault started, of which shape it is and how large, by a scan over all onsets.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    config : see `bfi_cli.config.Config`; `start_time` holds what is special to the scan, and method `risro` is the
        published search, one solution per onset.
    progress : called with the name of the stage and the fraction of it that is done.
    beside : evidence of other sources on the same window.
    false_alarm : rate of all sources together; None where it is that of the scan.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    ConfigError : the calibration cannot be used, or the method does not do what is asked.
    """
    if config.method not in ("ml", "risro"):
        raise ConfigError(f"method: start-time has ml and risro, got {config.method}; give --method scan or thesis")
    config = with_inputs_of(log, config)
    published = config.method == "risro"
    with one_thread():
        if published:
            from .thesis import search_as_published

            searched = search_as_published(log, config, progress)
        else:
            searched = search_onsets(log, config, progress)
    flown = () if published else (manoeuvres_of(log, config.outputs),)
    conclusion = conclude([searched.evidence, *beside, *flown], config.require)
    helps = None if published else what_would_help(log, config, conclusion.verdicts)
    source_notes = [note for source in (searched.evidence, *beside) for note in source.notes]
    notes = [*conclusion.notes, *source_notes, *filter(None, [helps])]
    from .result import onset_result

    return onset_result(searched, conclusion, false_alarm or config.start_time.false_alarm, notes)


def search_onsets(
    log: FlightLog,
    config: Config,
    progress: Progress = unseen,
    *,
    kinds: Sequence[Fault] = (),
    entries: Sequence[Fault] = (),
    claims: Collection[Kind] = KINDS,
    known: Sequence[FaultEstimate] = (),
) -> OnsetSearch:
    """Search a window for faults by a scan over all onsets, and return the evidence without a conclusion.

    1. Scan the record: every shape at every onset, the order of the model chosen together with the shape.
    2. Compare the statistic that stands out most with its null distribution. While it exceeds its threshold, estimate
       the fault at the log's own samples, named by the likeliest of the kinds that it may be, re-estimate those before
       it, subtract all of them and scan again.
    3. Refine all faults jointly, each estimated with the others subtracted, until none moves.
    4. Leave each out in turn, the weakest first, and drop it where the others explain the record as well.
    5. Doubt those that do not stand out where all trusted channels of the log are inputs: they are suspected.
    6. Estimate the magnitudes of those that remain at the rate of an estimate. Where the interval of one holds zero, it
       is suspected.
    7. Turn the thresholds into magnitudes at every onset: what could not have been seen decides between "no fault"
       and "inconclusive".

    Parameters
    ----------
    kinds : entries of a dictionary whose onsets are searched, on the axis of the log; without them every kind is.
    entries : with stated onsets, for each of which the result says how large it would have to be for the scan.
    claims : the kinds of fault of which limits are sought.
    known : faults that were subtracted from the log; limits leave their magnitudes free.
    """
    config = with_inputs_of(log, config)
    with one_thread():
        record = prepare_record(log, config, partial(progress, "the window"), entries=kinds)
        config = merge(config, {"start_time.shapes": record.settings.shapes}) if kinds else config
        scanning = partial(progress, "scan of all onsets")
        first = scan_hypotheses(record, record.y, report=scanning, climbs=bool(entries))
        rule = rule_for(log, record, config, order=first.order, progress=progress)
        estimates, last = detect_sequentially(record, first, rule, progress)
        order = last.fault_free_order
        if estimates:
            estimates = refine_jointly(record, estimates, order, partial(progress, "every fault again"))
        estimates = eliminate(record, estimates, order, rule, progress)
        estimates, doubted = _measured(log, record, estimates, config, progress, order=order)
        tolerances = tolerances_of(log, record.window.log, config.outputs, config)
        limits_report = partial(progress, "what could not have been seen")
        entries_report, limiting = shares(limits_report, len(entries) / 8, 2)
        y, declared = subtract_faults(record.y, *estimates), [*known_faults(record, known), *estimates]
        scans = scans_beside(record, y, declared, order)
        entry_claims = claims_near_onsets(
            record, rule, entries, config.onset_tolerance_s, tolerances, scans, order=order, report=entries_report
        )
        seen = {} if known else first.standing_out
        declared = with_rivals(record, y, declared, tolerances, order=order, seen=seen)
        estimates = declared[len(declared) - len(estimates) :]
        candidates = claims_of(
            record,
            first,
            last,
            estimates,
            rule,
            tolerances,
            scans,
            rivals=rivals_of(declared),
            doubted={(fault.form.shape, fault.form.output): why for fault, why in doubted},
            claims=claims,
            order=order,
            report=limiting,
        )
        limits_report(1.0)
    highest, p_value = (estimates[0].highest, estimates[0].p_value) if estimates else rule.highest(first)
    faults, covered = declared_faults(record, estimates, tolerances), covered_s(record, order)
    notes = [*(Note.limit(why) for _, why in doubted), *rule.notes, *_notes(record, faults, rule, p_value)]
    if not estimates and not rule.matches:
        notes.append(_strongest_suspect(record, rule, first))
    return OnsetSearch(
        method="scan",
        record=record,
        scan=first,
        estimates=tuple(estimates),
        evidence=Evidence(source="scan", faults=faults, candidates=candidates, notes=tuple(notes)),
        order=order,
        series_order=first.fault_free_order,
        rule=rule,
        highest=highest,
        p_value=p_value,
        covered_s=covered,
        entry_claims=entry_claims,
        rivals=frozenset((shape, config.outputs[output]) for shape, output in rivals_of(declared)),
    )


def _measured(
    log: FlightLog, record: ScanRecord, estimates: Sequence[Estimate], config: Config, progress: Progress, *, order: int
) -> tuple[list[Estimate], list[tuple[Estimate, str]]]:
    """Return the faults that are declared, with their magnitudes, and those that are only suspected, each with why."""
    doubts = unconfirmed(log, record, estimates, config, order=order)
    suspected = [(estimates[i], why) for i, why in doubts.items()]
    kept = [fault for i, fault in enumerate(estimates) if i not in doubts]
    declared = []
    for fault in measure(log, record, kept, config, partial(progress, "magnitudes")):
        if abs(fault.z) <= TWO_SIDED_95 * fault.sd:
            suspected.append((fault, _may_be_nothing(record, fault)))
        else:
            declared.append(fault)
    return declared, suspected


def _may_be_nothing(record: ScanRecord, fault: Estimate) -> str:
    """Return why a fault that the scan declares is only suspected: the interval of its magnitude holds zero."""
    channel, scale, unit = record.magnitude(fault.form)
    low, high = (scale * (fault.z + reach * fault.sd) for reach in (-TWO_SIDED_95, TWO_SIDED_95))
    return (
        f"the {fault.form.shape} of {quantity(scale * fault.z, unit)} on {channel} from {instant(fault.onset_s)} s is "
        f"only suspected: the 95 % interval of its size, {low:.3g} to {high:.3g}, contains zero"
    )


def detect_sequentially(
    record: ScanRecord, first: HypothesisScan, rule: Rule, progress: Progress
) -> tuple[list[Estimate], HypothesisScan]:
    """Return the faults in the order of their evidence, and the scan that no longer shows one.

    Whenever a fault is added, those before it are re-estimated: what an error of the first leaves behind looks like a
    fault.
    """
    faults: list[Estimate] = []
    y, last = record.y, first
    while len(faults) < MOST_FAULTS and (significant := rule.significant(last)):
        if _begins_with_another(record, significant[0], faults):
            break
        n = len(faults) + 1
        report = partial(progress, f"fault {n}")
        measuring, again = shares(report, 1, n - 1)
        highest, p_value = rule.highest(last)
        fault = estimate_likeliest(record, y, significant, last.order, measuring)
        faults.append(replace(fault, highest=highest, p_value=p_value))
        if n > 1:
            faults = refine_jointly(record, faults, last.order, again)
        report(1.0)
        y = subtract_faults(record.y, *faults)
        stage = f"scan of all onsets without {n} fault{'s' * (n > 1)}"
        last = scan_hypotheses(record, y, report=partial(progress, stage))
    return faults, last


def _begins_with_another(record: ScanRecord, peak: Peak, faults: Sequence[Estimate]) -> bool:
    """Say whether a peak lies within the response of an uncertain recorder to a fault of its channel.

    Faults that begin together are rivals, not a sum: what a wrong recorder leaves of a fault is no second fault.
    """
    edges = [low_pass.edge_hz for low_pass in recorder_low_passes(record.window.filters) if low_pass.uncertain]
    onset_s = record.onset_s(peak.onset)
    return any(
        abs(onset_s - fault.onset_s) <= 1.0 / min(edges) and fault.form.output == peak.form.output
        for fault in faults
        if edges
    )


def estimate_likeliest(
    record: ScanRecord, y: FloatArray, significant: Sequence[Peak], order: int, report: Report
) -> Estimate:
    """Return the fault of the likeliest kind that what stands out may be.

    The shapes above their thresholds compete with the lags and ramps that show as steps, and with an oscillation whose
    phase has been freed: the scan knows only oscillations of phase 0 at their onset, so that an oscillation of another
    phase may look less likely than a step. Each is estimated at the log's own samples, with the likeliest recorder
    where that is uncertain. Of those with about the least criterion the simplest is named, and `among` has the others.
    """
    log_n = float(np.log(len(y) - order))
    steps_report, rivals_report = shares(report, 1, 3)
    peaks = sorted(
        [*significant, *_rival_peaks(record, y, significant, order)],
        key=lambda peak: (peak.form.shape != "bias", bic_change(peak)),
    )
    criteria: list[tuple[float, Estimate]] = []
    jump_s, dispersion = None, 1.0
    for n, peak in enumerate(peaks):
        n_parameters = peak.n_parameters + (peak.form.shape == "sine")
        lowest = min((criterion for criterion, _ in criteria), default=np.inf)
        least = max(0.0, (n_parameters * log_n - NOT_TOLD) * dispersion - lowest)
        report_step = steps_report if n == 0 else silent
        fault = estimate(record, y, peak, order=order, jump_s=jump_s, least=least, report=report_step)
        if n == 0:
            dispersion = _dispersion(record, subtract_faults(y, fault), fault, order)
        if peak.form.shape == "bias" and jump_s is None:
            jump_s = fault.onset_s
        is_last_and_alone = not criteria and n == len(peaks) - 1
        nameable = record.may_be(peak.form.shape, peak.form.output) and fault.frequency_is_known
        if nameable or is_last_and_alone:
            criteria.append((n_parameters * log_n * dispersion - fault.statistic, fault))
    rivals_report(1.0)
    least = min(criterion for criterion, _ in criteria)
    alike = [fault for criterion, fault in criteria if criterion - least <= NOT_TOLD * dispersion]
    best = min(alike, key=lambda fault: (fault.form.parameter is not None, -fault.statistic))
    best = _with_likeliest_constant(record, y, best, order)
    among = tuple(dict.fromkeys((best.form.shape, *(fault.form.shape for fault in alike))))
    return replace(best, among=among)


def _rival_peaks(record: ScanRecord, y: FloatArray, significant: Sequence[Peak], order: int) -> list[Peak]:
    """Return the best lag and the best ramp on every output on which anything stands out."""
    outputs = {peak.form.output for peak in significant}
    peaks: dict[tuple[str, int], list[Peak]] = {}
    for form in record.rivals:
        if form.output in outputs:
            peak = lasting_peak(record, scan_of(record, y, order, output=form.output), form)
            peaks.setdefault((form.shape, form.output), []).append(peak)
    return [max(group, key=lambda peak: peak.statistic) for group in peaks.values()]


def _with_likeliest_constant(record: ScanRecord, y: FloatArray, fault: Estimate, order: int) -> Estimate:
    """Return a lag or a ramp with its likeliest time constant or duration, and its magnitude's spread over these.

    Those between the neighbours on the grid are tried, each weighted by its likelihood.
    """
    form = fault.form
    stated = len({rival.parameter for rival in record.rivals if rival.shape == form.shape}) == 1
    if form.shape not in SCANNED_AS or form.parameter is None or stated:
        return fault
    scan = scan_of(record, y, order, output=form.output)
    forms = [replace(form, parameter=form.parameter * 2.0 ** (k / FINER)) for k in range(-FINER, FINER + 1)]
    peaks = [lasting_peak(record, scan, form) for form in forms]
    best = max(peaks, key=lambda peak: peak.statistic)
    likeliest = estimate(record, y, best, order=order)
    dispersion = _dispersion(record, subtract_faults(y, likeliest), likeliest, order)
    weight = np.array([np.exp(0.5 * (peak.statistic - best.statistic) / dispersion) for peak in peaks])
    z = np.array([peak.profile.z[peak.profile.best] for peak in peaks])
    spread = float(weight @ (z - best.profile.z[best.profile.best]) ** 2 / weight.sum())
    return replace(
        likeliest,
        sd=float(np.sqrt(likeliest.sd**2 + spread)),
        onset_spread=float(np.sqrt(likeliest.onset_spread**2 + spread)),
    )


def refine_jointly(record: ScanRecord, faults: list[Estimate], order: int, report: Report) -> list[Estimate]:
    """Re-estimate every fault with the others subtracted, and all magnitudes together, until none moves.

    The order stays the one chosen after all faults had been subtracted. An update that lowers the likelihood is
    rejected: a higher order leaves out more onsets near the ends of the record, the true one perhaps among them.
    """
    misfit = _misfit(record, faults, order)
    for _, round_share in parts(report, range(MOST_ROUNDS)):
        before = faults
        for i, share in parts(round_share, range(len(before))):
            moved = [*faults[:i], reestimate(record, faults, i, order, share), *faults[i + 1 :]]
            if len(moved) > 1:
                z = np.array([fault.z for fault in moved])
                best = record.likelihood(record.y, order).fit(unit_signals(record.y, moved), z).z
                moved = [
                    replace(fault, z=float(new), signal=fault.signal * (new / fault.z))
                    for fault, new in zip(moved, best, strict=True)
                ]
            reached = _misfit(record, moved, order)
            if reached <= misfit + SLACK * len(record.y):
                misfit, faults = reached, moved
        if all(
            old.onset_s == new.onset_s and abs(old.z - new.z) <= UNMOVED * new.sd
            for old, new in zip(before, faults, strict=True)
        ):
            break
    report(1.0)
    return faults


def reestimate(record: ScanRecord, faults: list[Estimate], i: int, order: int, report: Report) -> Estimate:
    """Return fault i estimated anew, its standard deviation enlarged by the dispersion of its shape in the record."""
    y = subtract_faults(record.y, *faults[:i], *faults[i + 1 :])
    form = faults[i].form
    dispersion = _dispersion(record, subtract_faults(y, faults[i]), faults[i], order)
    scanning, measuring = shares(report, 1, 2)
    peak = scan_hypothesis(record, scan_of(record, y, order, output=form.output), form, scanning)
    again = estimate(record, y, peak, order=order, dispersion=dispersion, report=measuring)
    return replace(again, among=faults[i].among, highest=faults[i].highest, p_value=faults[i].p_value)


def eliminate(record: ScanRecord, faults: list[Estimate], order: int, rule: Rule, progress: Progress) -> list[Estimate]:
    """Return the faults without those, the weakest first, without which the others explain the record as well.

    A fault detected early may have stood for a part of a later one, as a step does for an oscillation that does not
    begin at zero.
    """
    if len(faults) < 2:
        return faults
    report = partial(progress, f"{len(faults)} faults, each left out")
    whole = _misfit(record, faults, order)
    for i, share in parts(report, sorted(range(len(faults)), key=lambda k: faults[k].statistic)):
        others = refine_jointly(record, faults[:i] + faults[i + 1 :], order, share)
        if _misfit(record, others, order) - whole < rule.threshold(faults[i].form.shape):
            report(1.0)
            return eliminate(record, others, order, rule, progress)
    return faults


def _dispersion(record: ScanRecord, y: FloatArray, fault: Estimate, order: int) -> float:
    """Return the mean statistic, over all onsets, of a fault's shape in a record less that fault; 1 for white errors.

    A fault that ends is scanned as if it lasted: the largest statistic over many ends exceeds 1 for white errors too.
    """
    rest = lasting_peak(record, scan_of(record, y, order, output=fault.form.output), fault.form)
    return rest.profile.dispersion


def _misfit(record: ScanRecord, faults: list[Estimate], order: int) -> float:
    """Return twice the negative log-likelihood of the record less the faults."""
    likelihood = record.likelihood(subtract_faults(record.y, *faults), order)
    return likelihood.n_rows * likelihood.fault_free.log_det


def _strongest_suspect(record: ScanRecord, rule: Rule, scan: HypothesisScan) -> Note:
    """Return the note on what stands out most, where a table of other settings lets nothing be declared."""
    peak, _ = rule.highest(scan)
    threshold = rule.threshold(peak.form.shape)
    channel, scale, unit = record.magnitude(peak.form)
    size = f"{scale * float(peak.profile.z[peak.profile.best]):.3g} {unit}".rstrip()
    return Note.limit(
        f"the strongest suspect is a {peak.form.shape} of {size} on {channel} from "
        f"{instant(record.onset_s(peak.onset))} s, statistic {peak.statistic:.3g} against "
        f"{threshold:.3g}; a table for these settings (bfi calibrate), or --calibration gaussian, may decide "
        "otherwise"
    )


def _notes(record: ScanRecord, faults: Sequence[FaultEstimate], rule: Rule, p_value: float | None) -> list[Note]:
    """Return notes on p-value and record, and on onsets that are hardly known or beside large moves of the inputs."""
    notes = []
    if p_value is not None and p_value <= rule.null.rarest:
        n_windows = rule.table.n_windows
        notes.append(Note.method(f"the p-value is at most {p_value:.2g}, the least that {n_windows} windows can show"))
    notes.append(Note.method(f"rate {record.settings.rate_hz:.4g} Hz: {record.window.rate_reason}"))
    notes += [Note.method(record.window.recorder)] if record.window.recorder else []
    changes = np.abs(np.diff(record.u, axis=0))
    large = changes >= MOST * changes.max(axis=0, initial=0.0)
    moves_s = record.time_s[1:][large[:, large.mean(axis=0) <= RARE].any(axis=1)]
    for fault in faults:
        low, high = fault.onset_span_s
        if ((moves_s >= low - BESIDE_S) & (moves_s <= high + BESIDE_S)).any():
            notes.append(
                Note.limit(
                    f"'{fault.name}' begins while the inputs move most, where model errors look like faults; confirm "
                    "it at another --rate or with more --input"
                )
            )
        if high - low > HARDLY_KNOWN * record.settings.duration_s:
            notes.append(Note.limit(f"the onset of '{fault.name}' is uncertain: {instant(low)} to {instant(high)} s"))
    return notes
