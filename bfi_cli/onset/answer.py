"""The scan from end to end: take in, scan, decide, take the fault off, scan again until nothing is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..flightlog import FlightLog
from .decision import Rule, Verdict, rule_for
from .estimate import Estimate, estimate
from .layout import Scanned, laid_out
from .record import ScanRecord, prepare_record
from .result import OnsetResult
from .sweep import Sweep, peak_of, scan_of, sweep
from .thesis import find_onset_as_published

__all__ = ["find_onset"]

FloatArray = NDArray[np.float64]

MOST_FAULTS = 5
ROUNDS = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """One fault as it was first seen."""

    verdict: Verdict
    estimate: Estimate


def find_onset(log: FlightLog, config: Config) -> OnsetResult:
    """Say when a fault started, of which shape it is and how large, by a scan over all onsets.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    config : see `bfi_cli.config.Config`; `start_time` holds what is special to the scan, and method `risro` is the
        published search, one solution per onset.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    ConfigError : the calibration cannot be used, or the method does not do what is asked.
    """
    if config.method == "risro":
        return find_onset_as_published(log, config)
    record = prepare_record(log, config)
    first = sweep(record, record.y)
    rule = rule_for(log, record, config, order=first.order)
    found, last = _until_nothing_is_left(record, first, rule)
    y, estimates = _settled(record, found, last)
    opening = found[0].verdict if found else rule.verdict(first)
    return laid_out(
        record,
        rule,
        Scanned(
            first=first,
            last=last,
            opening=opening,
            verdicts=tuple(one.verdict for one in found),
            estimates=tuple(estimates),
            y=y,
        ),
    )


def _until_nothing_is_left(record: ScanRecord, first: Sweep, rule: Rule) -> tuple[list[_Found], Sweep]:
    """Return the faults in the order of their evidence, and the sweep in which there was none any more."""
    found: list[_Found] = []
    y, seen = record.y, first
    while len(found) < MOST_FAULTS and (verdict := rule.verdict(seen)).peak is not None:
        fault = estimate(record, y, verdict.peak, order=seen.order)
        found.append(_Found(verdict=verdict, estimate=fault))
        y = _less(y, fault)
        seen = sweep(record, y)
    return found, seen


def _settled(record: ScanRecord, found: list[_Found], last: Sweep) -> tuple[FloatArray, list[Estimate]]:
    """Estimate every fault again with the others taken off, at the order chosen when all were."""
    estimates = [one.estimate for one in found]
    order = last.plain_order
    for _ in range(ROUNDS if len(found) > 1 else 1):
        for i, fault in enumerate(estimates):
            others = record.y
            for other in estimates[:i] + estimates[i + 1 :]:
                others = _less(others, other)
            output = fault.form.output
            rest = peak_of(record, scan_of(record, _less(others, fault), order, output=output), fault.form)
            dispersion = max(1.0, float(np.mean(rest.profile.statistic)))
            peak = peak_of(record, scan_of(record, others, order, output=output), fault.form)
            estimates[i] = estimate(record, others, peak, order=order, dispersion=dispersion)
    y = record.y
    for fault in estimates:
        y = _less(y, fault)
    return y, estimates


def _less(y: FloatArray, fault: Estimate) -> FloatArray:
    y = y.copy()
    y[:, fault.form.output] -= fault.signal
    return y
