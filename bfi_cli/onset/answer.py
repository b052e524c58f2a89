"""The scan from end to end: take in, scan, decide, take the fault off, scan again until nothing is left."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..config import Config
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..kernels.progress import Progress, Report, parts, shares, unseen
from .decision import Rule, Verdict, rule_for
from .estimate import Estimate, estimate
from .joint import Likelihood
from .layout import Scanned, laid_out
from .record import ScanRecord, prepare_record
from .result import OnsetResult
from .sweep import Sweep, lasting_peak, peak_of, scan_of, sweep
from .thesis import find_onset_as_published

__all__ = ["find_onset"]

FloatArray = NDArray[np.float64]

MOST_FAULTS = 5
MOST_ROUNDS = 4
UNMOVED = 0.1
SLACK = 1e-3


def find_onset(log: FlightLog, config: Config, progress: Progress = unseen) -> OnsetResult:
    """Say when a fault started, of which shape it is and how large, by a scan over all onsets.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    config : see `bfi_cli.config.Config`; `start_time` holds what is special to the scan, and method `risro` is the
        published search, one solution per onset.
    progress : told the name of every stage and how far it is.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    ConfigError : the calibration cannot be used, or the method does not do what is asked.
    """
    with threadpool_limits(1):
        if config.method not in ("ml", "risro"):
            raise ConfigError(f"method: start-time has ml and risro, got {config.method}; give --method scan or thesis")
        published = config.method == "risro"
        return find_onset_as_published(log, config, progress) if published else _found(log, config, progress)


def _found(log: FlightLog, config: Config, progress: Progress) -> OnsetResult:
    record = prepare_record(log, config, partial(progress, "the window"))
    first = sweep(record, record.y, report=partial(progress, "scan of all onsets"))
    rule = rule_for(log, record, config, order=first.order, report=partial(progress, "threshold"))
    verdicts, estimates, last = _until_nothing_is_left(record, first, rule, progress)
    if estimates:
        estimates = _settled(record, estimates, last.plain_order, partial(progress, "every fault again"))
    while len(estimates) > 1:
        leaving = partial(progress, f"{len(estimates)} faults, each left out")
        if (fewer := _without_one(record, estimates, last.plain_order, rule, leaving)) is None:
            break
        i, estimates = fewer
        del verdicts[i]
    y = _less(record.y, *estimates)
    opening = verdicts[0] if verdicts else rule.verdict(first)
    return laid_out(
        record,
        rule,
        Scanned(
            first=first,
            last=last,
            opening=opening,
            verdicts=tuple(verdicts),
            estimates=tuple(estimates),
            y=y,
        ),
    )


def _until_nothing_is_left(
    record: ScanRecord, first: Sweep, rule: Rule, progress: Progress
) -> tuple[list[Verdict], list[Estimate], Sweep]:
    """Return the faults in the order of their evidence, and the sweep in which there was none any more.

    Each is estimated again as soon as another is known: what an error of the first leaves behind looks like a fault.
    """
    verdicts: list[Verdict] = []
    found: list[Estimate] = []
    y, seen = record.y, first
    while len(found) < MOST_FAULTS and (verdict := rule.verdict(seen)).beyond:
        verdicts.append(verdict)
        n = len(verdicts)
        report = partial(progress, f"fault {n}")
        measuring, again = shares(report, 1, n - 1)
        found.append(_likeliest(record, y, verdict, seen.order, measuring))
        if n > 1:
            found = _settled(record, found, seen.order, again)
        report(1.0)
        y = _less(record.y, *found)
        seen = sweep(record, y, report=partial(progress, f"scan of all onsets without {n} fault{'s' * (n > 1)}"))
    return verdicts, found, seen


def _likeliest(record: ScanRecord, y: FloatArray, verdict: Verdict, order: int, report: Report) -> Estimate:
    """Return the fault of the likeliest shape; of an oscillation that is known only once its phase has been freed.

    What the first shape leaves unexplained counts against the freedom of the other.
    """
    likeliest = verdict.beyond[0]
    of_steps, of_likeliest, of_sine = shares(report, 1, 2, 2)
    biases = [peak for peak in verdict.beyond if peak.form.shape == "bias"]
    steps = [estimate(record, y, peak, order=order, report=own) for peak, own in parts(of_steps, biases)]
    jump_s = steps[0].onset_s if steps else None
    if likeliest.form.shape == "bias":
        first = steps[0]
    else:
        first = estimate(record, y, likeliest, order=order, jump_s=jump_s, report=of_likeliest)
    for peak in verdict.beyond[1:]:
        if peak.form.shape == "sine":
            sine = estimate(record, y, peak, order=order, jump_s=jump_s, report=of_sine)
            freedom = (1 + peak.n_parameters - likeliest.n_parameters) * float(np.log(len(y) - order))
            charge = freedom * _dispersion(record, _less(y, first), first, order)
            better = sine.is_told and sine.statistic > first.statistic + charge
            return sine if better else first
    return first


def _dispersion(record: ScanRecord, y: FloatArray, fault: Estimate, order: int) -> float:
    """Return the mean statistic of a shape in a record that no longer holds it; white errors make it 1.

    Of a fault that ends the shape without an end is asked: at the best end of many even white errors make it more.
    """
    rest = lasting_peak(record, scan_of(record, y, order, output=fault.form.output), fault.form)
    return max(1.0, float(np.mean(rest.profile.statistic)))


def _settled(record: ScanRecord, estimates: list[Estimate], order: int, report: Report) -> list[Estimate]:
    """Estimate every fault again with the others taken off, at the order chosen when all were, until none moves.

    What explains the record worse than before is not taken: another order may not look where the fault begins.
    """
    misfit = _misfit(record, estimates, order)
    for _, of_round in parts(report, range(MOST_ROUNDS)):
        before = estimates
        for i, own in parts(of_round, range(len(before))):
            fault = _again(record, estimates, i, order, own)
            moved = _jointly(record, [*estimates[:i], fault, *estimates[i + 1 :]], order)
            reached = _misfit(record, moved, order)
            if reached <= misfit + SLACK * len(record.y):
                misfit, estimates = reached, moved
        if not any(map(_moved, before, estimates)):
            break
    report(1.0)
    return estimates


def _without_one(
    record: ScanRecord, estimates: list[Estimate], order: int, rule: Rule, report: Report
) -> tuple[int, list[Estimate]] | None:
    """Return which fault is not needed, and the others without it; None where all are.

    What was found first may have stood for a part of what was found later, as a step does for an oscillation that does
    not begin at zero.
    """
    whole = _misfit(record, estimates, order)
    weakest_first = sorted(range(len(estimates)), key=lambda k: estimates[k].statistic)
    for i, own in parts(report, weakest_first):
        others = _settled(record, estimates[:i] + estimates[i + 1 :], order, own)
        if _misfit(record, others, order) - whole < rule.threshold(estimates[i].form.shape):
            report(1.0)
            return i, others
    return None


def _misfit(record: ScanRecord, estimates: list[Estimate], order: int) -> float:
    """Return twice the negative log-likelihood of the record less the faults."""
    fit = Likelihood(record=record, y=_less(record.y, *estimates), order=order).fit(np.zeros((*record.y.shape, 0)))
    return (len(record.y) - order) * fit.log_det


def _again(record: ScanRecord, estimates: list[Estimate], i: int, order: int, report: Report) -> Estimate:
    """Return one of the faults estimated anew; its deviation admits what its shape shows elsewhere in the record."""
    others = _less(record.y, *estimates[:i], *estimates[i + 1 :])
    fault, output = estimates[i], estimates[i].form.output
    dispersion = _dispersion(record, _less(others, fault), fault, order)
    scanning, measuring = shares(report, 1, 2)
    peak = peak_of(record, scan_of(record, others, order, output=output), fault.form, scanning)
    return estimate(record, others, peak, order=order, dispersion=dispersion, report=measuring)


def _jointly(record: ScanRecord, estimates: list[Estimate], order: int) -> list[Estimate]:
    """Return the faults with the magnitudes that explain the record best together."""
    if len(estimates) < 2:
        return estimates
    z = np.array([fault.z for fault in estimates])
    theta = np.zeros((*record.y.shape, len(z)))
    for j, fault in enumerate(estimates):
        theta[:, fault.form.output, j] = fault.signal / fault.z
    best = Likelihood(record=record, y=record.y, order=order).fit(theta, z).z
    return [
        replace(fault, z=float(new), signal=fault.signal * (new / fault.z))
        for fault, new in zip(estimates, best, strict=True)
    ]


def _moved(before: Estimate, after: Estimate) -> bool:
    return before.onset_s != after.onset_s or not abs(before.z - after.z) <= UNMOVED * after.sd


def _less(y: FloatArray, *faults: Estimate) -> FloatArray:
    y = y.copy()
    for fault in faults:
        y[:, fault.form.output] -= fault.signal
    return y
