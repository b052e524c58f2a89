"""Sequential detection of faults by a scan over all onsets, their joint re-estimation, and backward elimination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from ..config import Config
from ..decision import decide, summarise, verdicts_of
from ..errors import ConfigError
from ..faults import Fault, magnitude_unit
from ..flightlog import FlightLog
from ..kernels import FloatArray
from ..kernels.normal import TWO_SIDED_95
from ..kernels.progress import Progress, Report, parts, shares, unseen
from ..preprocessing.advice import what_would_help
from ..preprocessing.tolerance import tolerances_of
from ..preprocessing.window import with_inputs_of
from ..report.text import instant, quantity
from .claims import OLDER_NOTE, claims_of, covered_s, limits_near_onsets
from .confirmation import unconfirmed
from .decision import Rule, Verdict, rule_for
from .estimate import Estimate, as_scanned, estimate, subtract_faults
from .magnitudes import measure
from .result import OnsetFault, OnsetResult, assemble_result
from .scan import HypothesisScan, lasting_peak, scan_hypotheses, scan_hypothesis, scan_of
from .scan_record import Likelihood, ScanRecord, prepare_record
from .shapes import fault_of
from .thesis import find_onset_as_published

# A bound on the time rather than on what a log may hold (docs/theory.md, 9.4).
MOST_FAULTS = 5
# Rounds of re-estimation, which end earlier once no onset moves and no magnitude by a tenth of its standard deviation.
MOST_ROUNDS = 4
UNMOVED = 0.1  # of a standard deviation
# An update may raise twice the negative log-likelihood by this much per sample, so that round-off does not stop the
# refinement; the losses that it must reject, an onset too close to the ends for another order, are far larger.
SLACK = 1e-3
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
    briefly: bool = False,
    faults: Sequence[Fault] = (),
) -> OnsetResult:
    """Say when a fault started, of which shape it is and how large, by a scan over all onsets.

    1. Scan the record: every shape at every onset, the order of the model chosen together with the shape.
    2. Compare the statistic that stands out most with its null distribution. While it exceeds its threshold, estimate
       the fault at the log's own samples, re-estimate those before it, subtract all of them and scan again.
    3. Refine all faults jointly, each estimated with the others subtracted, until none moves.
    4. Leave each out in turn, the weakest first, and drop it where the others explain the record as well.
    5. Doubt those that do not stand out where all trusted channels of the log are inputs: they are suspected.
    6. Estimate the magnitudes of those that remain at the rate of an estimate. Where the interval of one holds zero, it
       is suspected.
    7. Turn the thresholds into magnitudes at every onset: what could not have been seen decides between "no fault"
       and "inconclusive".

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    config : see `bfi_cli.config.Config`; `start_time` holds what is special to the scan, and method `risro` is the
        published search, one solution per onset.
    progress : called with the name of the stage and the fraction of it that is done.
    briefly : after step 1 the fault that stands out most is declared as the scan has it, on its grid of onsets, and
        nothing more is sought: enough to tell whether there is one.
    faults : of a dictionary, for which the result says how large each would have to be for the scan.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    ConfigError : the calibration cannot be used, or the method does not do what is asked.
    """
    if config.method not in ("ml", "risro"):
        raise ConfigError(f"method: start-time has ml and risro, got {config.method}; give --method scan or thesis")
    config = with_inputs_of(log, config)
    with threadpool_limits(1):
        if config.method == "risro":
            return find_onset_as_published(log, config, progress)
        record = prepare_record(log, config, partial(progress, "the window"))
        first = scan_hypotheses(record, record.y, report=partial(progress, "scan of all onsets"))
        rule = rule_for(log, record, config, order=first.order, progress=progress)
        if briefly:
            verdicts, estimates, order = _at_a_glance(record, first, rule)
        else:
            verdicts, estimates, last = detect_sequentially(record, first, rule, progress)
            order = last.fault_free_order
            if estimates:
                estimates = refine_jointly(record, estimates, order, partial(progress, "every fault again"))
            eliminate(record, verdicts, estimates, order, rule, progress)
        doubts = unconfirmed(log, record, estimates, config, order=order)
        if not briefly:
            kept = [i for i in range(len(estimates)) if i not in doubts]
            sizes = measure(log, record, [estimates[i] for i in kept], config, partial(progress, "magnitudes"))
            for i, one in zip(kept, sizes, strict=True):
                estimates[i] = one
                if abs(one.z) <= TWO_SIDED_95 * one.sd:
                    doubts[i] = _may_be_nothing(record, one)
        doubted = {(estimates[i].form.shape, estimates[i].form.output): said for i, said in doubts.items()}
        verdicts = [one for i, one in enumerate(verdicts) if i not in doubts]
        estimates = [one for i, one in enumerate(estimates) if i not in doubts]
        tolerances = tolerances_of(log, record.window.log, config.outputs, config)
        of_limits = partial(progress, "what could not have been seen")
        limiting, of_faults = shares(of_limits, 2, len(faults) / 8)
        candidates = claims_of(
            record, first, estimates, rule, tolerances, order=order, doubted=doubted, report=limiting
        )
        of_dictionary = limits_near_onsets(
            record,
            estimates,
            rule,
            faults,
            config.onset_tolerance_s,
            tolerances,
            order=order,
            order_as_measured=first.order,
            report=of_faults,
        )
        of_limits(1.0)
    by_kind = verdicts_of(candidates)
    verdict = verdicts[0] if verdicts else rule.verdict(first)
    p_values = [own.p_value if rule.use.matches else None for own in verdicts]
    result = assemble_result(record, first, estimates, p_values, order=order, series_order=first.fault_free_order)
    notes = [*doubts.values(), *rule.notes]
    if rule.use.matches and verdict.p_value <= rule.null.rarest:
        n_windows = rule.use.n_windows
        notes.append(f"the p-value is at most {verdict.p_value:.2g}: {n_windows} windows can show none that is less")
    notes += _notes(record, result.faults, first.order)
    if not estimates and not rule.use.matches:
        profile = next(profile for profile in result.profiles if profile.shape == verdict.shape)
        best = int(profile.statistic.argmax())
        size = f"{profile.magnitude[best]:.3g} {profile.unit}".rstrip()
        notes.insert(
            0,
            f"the strongest suspect is a {profile.shape} of {size} on {profile.channel} from "
            f"{instant(profile.onset_s[best])} s, statistic {profile.statistic[best]:.3g} against "
            f"{verdict.threshold:.3g}; a table for these settings "
            "(bfi calibrate), or --calibration gaussian, may decide otherwise",
        )
    helps = what_would_help(record.window.log, config, by_kind)
    earliest_s, latest_s = covered_s(record, order)
    notes.append(f"limits hold at 95 % for onsets from {instant(earliest_s)} to {instant(latest_s)} s; {OLDER_NOTE}")
    notes += [helps] if helps else []
    return replace(
        result,
        decision=decide(by_kind, config.require),
        verdicts=by_kind,
        candidates=candidates,
        summary=summarise(by_kind, candidates),
        covered_s=(earliest_s, latest_s),
        of_dictionary=of_dictionary,
        false_alarm=rule.false_alarm,
        p_value=verdict.p_value if rule.use.matches else None,
        statistic=verdict.statistic,
        threshold=verdict.threshold,
        calibration=rule.use,
        profiles=tuple(replace(profile, threshold=rule.threshold(profile.shape)) for profile in result.profiles),
        notes=tuple(notes),
    )


def _may_be_nothing(record: ScanRecord, fault: Estimate) -> str:
    """Return why a fault that the scan declares is only suspected: the interval of its magnitude holds zero."""
    channel, scale = record.settings.outputs[fault.form.output], float(record.unit[fault.form.output])
    form = fault_of(fault.form, channel, magnitude=1.0, onset_s=0.0)
    unit = magnitude_unit(form, record.window.log.channel(channel).unit)
    low, high = (scale * (fault.z + reach * fault.sd) for reach in (-TWO_SIDED_95, TWO_SIDED_95))
    return (
        f"the {fault.form.shape} on {channel} from {instant(fault.onset_s)} s that the scan declares is "
        f"{quantity(scale * fault.z, unit)} with a 95 % interval from {low:.3g} to {high:.3g}, which holds zero: it is "
        "suspected"
    )


def _at_a_glance(record: ScanRecord, first: HypothesisScan, rule: Rule) -> tuple[list[Verdict], list[Estimate], int]:
    """Return the fault that stands out most as the scan has it, if one does, and the order of the model."""
    verdict = rule.verdict(first)
    if not verdict.significant:
        return [], [], first.fault_free_order
    return [verdict], [as_scanned(record, verdict.significant[0])], first.order


def detect_sequentially(
    record: ScanRecord, first: HypothesisScan, rule: Rule, progress: Progress
) -> tuple[list[Verdict], list[Estimate], HypothesisScan]:
    """Return the faults in the order of their evidence, and the scan that no longer shows one.

    Whenever a fault is added, those before it are re-estimated: what an error of the first leaves behind looks like a
    fault.
    """
    verdicts: list[Verdict] = []
    faults: list[Estimate] = []
    y, last = record.y, first
    while len(faults) < MOST_FAULTS and (verdict := rule.verdict(last)).significant:
        verdicts.append(verdict)
        n = len(verdicts)
        report = partial(progress, f"fault {n}")
        measuring, again = shares(report, 1, n - 1)
        faults.append(estimate_likeliest(record, y, verdict, last.order, measuring))
        if n > 1:
            faults = refine_jointly(record, faults, last.order, again)
        report(1.0)
        y = subtract_faults(record.y, *faults)
        stage = f"scan of all onsets without {n} fault{'s' * (n > 1)}"
        last = scan_hypotheses(record, y, report=partial(progress, stage))
    return verdicts, faults, last


def estimate_likeliest(record: ScanRecord, y: FloatArray, verdict: Verdict, order: int, report: Report) -> Estimate:
    """Return the fault of the likeliest shape, or an oscillation that explains more once its phase has been freed.

    The scan knows only oscillations of phase 0 at their onset, so one of another phase may look less likely than a
    step. It is preferred where its frequency is known and its gain exceeds the charge for its further parameters,
    multiplied by the dispersion that the first shape leaves.
    """
    likeliest = verdict.significant[0]
    of_steps, of_likeliest, of_sine = shares(report, 1, 2, 2)
    biases = [peak for peak in verdict.significant if peak.form.shape == "bias"]
    steps = [estimate(record, y, peak, order=order, report=own) for peak, own in parts(of_steps, biases)]
    jump_s = steps[0].onset_s if steps else None
    if likeliest.form.shape == "bias":
        first = steps[0]
    else:
        first = estimate(record, y, likeliest, order=order, jump_s=jump_s, report=of_likeliest)
    for peak in verdict.significant[1:]:
        if peak.form.shape == "sine":
            oscillation = estimate(record, y, peak, order=order, jump_s=jump_s, report=of_sine)
            more = (1 + peak.n_parameters - likeliest.n_parameters) * float(np.log(len(y) - order))
            charge = more * _dispersion(record, subtract_faults(y, first), first, order)
            better = oscillation.frequency_is_known and oscillation.statistic > first.statistic + charge
            return oscillation if better else first
    return first


def refine_jointly(record: ScanRecord, faults: list[Estimate], order: int, report: Report) -> list[Estimate]:
    """Re-estimate every fault with the others subtracted, and all magnitudes together, until none moves.

    The order stays the one chosen after all faults had been subtracted. An update that lowers the likelihood is
    rejected: a higher order leaves out more onsets near the ends of the record, the true one perhaps among them.
    """
    misfit = _misfit(record, faults, order)
    for _, of_round in parts(report, range(MOST_ROUNDS)):
        before = faults
        for i, own in parts(of_round, range(len(before))):
            moved = [*faults[:i], reestimate(record, faults, i, order, own), *faults[i + 1 :]]
            if len(moved) > 1:
                z = np.array([fault.z for fault in moved])
                theta = np.zeros((*record.y.shape, len(z)))
                for j, fault in enumerate(moved):
                    theta[:, fault.form.output, j] = fault.signal / fault.z
                best = Likelihood(record=record, y=record.y, order=order).fit(theta, z).z
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
    return estimate(record, y, peak, order=order, dispersion=dispersion, report=measuring)


def eliminate(
    record: ScanRecord, verdicts: list[Verdict], faults: list[Estimate], order: int, rule: Rule, progress: Progress
) -> None:
    """Remove from both lists, one by one, the faults without which the others explain the record as well.

    A fault detected early may have stood for a part of a later one, as a step does for an oscillation that does not
    begin at zero.
    """
    dropped = True
    while dropped and len(faults) > 1:
        dropped = False
        report = partial(progress, f"{len(faults)} faults, each left out")
        whole = _misfit(record, faults, order)
        for i, own in parts(report, sorted(range(len(faults)), key=lambda k: faults[k].statistic)):
            others = refine_jointly(record, faults[:i] + faults[i + 1 :], order, own)
            if _misfit(record, others, order) - whole < rule.threshold(faults[i].form.shape):
                report(1.0)
                faults[:], dropped = others, True
                del verdicts[i]
                break


def _dispersion(record: ScanRecord, y: FloatArray, fault: Estimate, order: int) -> float:
    """Return the mean statistic, over all onsets, of a fault's shape in a record less that fault; 1 for white errors.

    A fault that ends is scanned as one that lasts: the largest statistic of many ends exceeds 1 for white errors too.
    """
    rest = lasting_peak(record, scan_of(record, y, order, output=fault.form.output), fault.form)
    return max(1.0, float(np.mean(rest.profile.statistic)))


def _misfit(record: ScanRecord, faults: list[Estimate], order: int) -> float:
    """Return twice the negative log-likelihood of the record less the faults."""
    likelihood = Likelihood(record=record, y=subtract_faults(record.y, *faults), order=order)
    return likelihood.n_rows * likelihood.fit(np.zeros((*record.y.shape, 0))).log_det


def _notes(record: ScanRecord, faults: Sequence[OnsetFault], order: int) -> list[str]:
    notes = [
        f"rate {record.settings.rate_hz:.4g} Hz: {record.window.rate.reason}",
        f"onsets are sought from {instant(covered_s(record, order)[0])} s on; the model absorbs an earlier fault",
    ]
    notes += [record.window.recorder] if record.window.recorder else []
    changes = np.abs(np.diff(record.u, axis=0))
    large = changes >= MOST * changes.max(axis=0, initial=0.0)
    moves_s = record.time_s[1:][large[:, large.mean(axis=0) <= RARE].any(axis=1)]
    for fault in faults:
        low, high = fault.onset_ci95
        if ((moves_s >= low - BESIDE_S) & (moves_s <= high + BESIDE_S)).any():
            notes.append(
                f"'{fault.estimate.name}' begins while the inputs move most, where an error of the model looks like a "
                "fault; see whether another --rate or more --input confirm it"
            )
        if high - low > HARDLY_KNOWN * record.settings.duration_s:
            notes.append(f"the onset of '{fault.estimate.name}' is hardly known: {instant(low)} to {instant(high)} s")
    return notes
