"""The scan of a record: every hypothesis at every onset, the order of the model chosen together with the shape.

Order and shape have the least Bayesian information criterion, ``n log det - statistic + log n`` per parameter: an
order chosen without the fault would be so high that it absorbs an oscillation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...kernels import FloatArray
from ...kernels.onset.frequency import (
    frequency_grid,
    promised,
    scan_frequency,
    scan_frequency_ends,
    screen_grid,
    screen_sines,
    standing_out,
)
from ...kernels.onset.scan import (
    Profile,
    Scan,
    default_onsets,
    largest_statistic,
    prepare_scan,
    scan_shape,
    screen_shape,
)
from ...kernels.progress import Report, parts, shares, silent
from .scan_record import ScanRecord
from .shapes import ShapeHypothesis, waveform

if TYPE_CHECKING:
    from ...kernels.onset.pairs import PairScan

# Duration of the search for a frequency, in scans of a shape of known frequency: for the progress only.
SEARCH = 20
# Factorised records that are kept: of some orders and outputs, as measured and less the faults estimated last.
REMEMBERED = 12
# SCREENED [1]: threshold over the screen of a window in which a fault may still stand out. Of 89 windows of three
# aircraft in which one does the screen is at least 0.96 of the threshold (tests/measurements/test_screens.py).
SCREENED = 4.0
# PROMISED [1]: threshold over what a sine of the grid promises, from which on it is screened: one of a frequency amid
# two of them, a quarter of its peak's width beside both, has 1 / sinc(1/4)^2 = 1.23 times their statistic.
PROMISED = 1.25


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peak:
    """One hypothesis at all onsets.

    Attributes
    ----------
    form : the hypothesis; a sine has its likeliest frequency.
    profile : over the onsets, which are conditioned samples of the record; of a fault that ends, at the best end.
    end : conditioned sample at which the fault ends, None where it lasts.
    """

    form: ShapeHypothesis
    profile: Profile
    end: int | None

    @property
    def statistic(self) -> float:
        """The largest statistic over the onsets."""
        return float(self.profile.statistic[self.profile.best])

    @property
    def onset(self) -> int:
        """Conditioned sample of the best onset."""
        return int(self.profile.onsets[self.profile.best])

    @property
    def n_parameters(self) -> int:
        """Number of parameters that were sought: magnitude, onset, end, and frequency or time constant."""
        return 2 + (self.end is not None) + (self.form.parameter is not None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HypothesisScan:
    """All hypotheses at the order chosen together with the best of them.

    Attributes
    ----------
    order : of the model; fault_free_order : the order that would be chosen without a fault.
    peaks : one per hypothesis.
    orders : those that were compared.
    without_fault, with_fault : the criterion of each order, without a fault and with its best one.
    standing_out : by output, the frequencies, cycles per sample, that stand out at some order, the most at this one
        first; none where a scan of one order has not compared them.
    """

    order: int
    fault_free_order: int
    peaks: tuple[Peak, ...]
    orders: tuple[int, ...]
    without_fault: tuple[float, ...]
    with_fault: tuple[float, ...]
    standing_out: Mapping[int, tuple[float, ...]]

    def of(self, shape: str, output: int | None = None) -> Peak:
        """Return the best peak of a shape, over all outputs or on `output`."""
        peaks = (peak for peak in self.peaks if peak.form.shape == shape and output in (None, peak.form.output))
        return max(peaks, key=lambda peak: peak.statistic)


def scan_hypotheses(
    record: ScanRecord, y: FloatArray, order: int | None = None, report: Report = silent, *, climbs: bool = False
) -> HypothesisScan:
    """Scan every hypothesis over every onset.

    Parameters
    ----------
    record : its inputs, hypotheses and orders.
    y : (n_samples, n_outputs) scaled outputs, less the faults that are already estimated.
    order : of the model; None to choose it together with the shape by the Bayesian information criterion.
    report : called with the fraction that is done.
    climbs : whether orders beyond one that is worse with a fault than another nearer to the best without are left out.
    """
    orders = record.orders if order is None else (order,)
    several = len(orders) > 1
    preparing, choosing, peaking, again = shares(report, 1, 10 * several, 15, 20 * (several and record.settings.ends))
    scans = [
        [scan_of(record, y, s, output=i, first=max(orders)) for i in range(y.shape[1])]
        for s, _ in parts(preparing, orders)
    ]
    without_fault = [fault_free_bic(record, order_scans[0]) for order_scans in scans]
    seen: list[dict[int, tuple[float, ...]]] = [{} for _ in orders]
    best = without_fault
    if several:
        best, seen = _bic_with_fault(record, scans, without_fault, choosing, climbs=climbs)
    at = int(np.argmin(np.minimum(without_fault, best)))
    own_grid = seen[at] if at in _screened(without_fault) else {}
    chosen, scanned = orders[at], _scan_at_order(record, y, orders[at], own_grid, peaking)
    if record.settings.ends and several:
        # The coarse grid of frequencies knows no ends, so it may choose an order too high, which absorbs a short
        # oscillation: start and end of the best hypothesis are sought anew at every order.
        comparing, peaking = shares(again, 1, 3)
        peak, criteria = min(scanned, key=bic_change), []
        for (s, base), share in parts(comparing, list(zip(orders, without_fault, strict=True))):
            scan = scan_of(record, y, s, output=peak.form.output, first=max(orders))
            charge = peak.n_parameters * float(np.log(scan.n_rows))
            criteria.append(base - _scan_with_ends(record, scan, peak.form, share).statistic + charge)
        best = np.minimum(best, criteria).tolist()
        if (better := orders[int(np.argmin(np.minimum(without_fault, best)))]) != chosen:
            chosen, scanned = better, _scan_at_order(record, y, better, {}, peaking)
    report(1.0)
    return HypothesisScan(
        order=chosen,
        fault_free_order=orders[int(np.argmin(without_fault))],
        peaks=scanned,
        orders=orders,
        without_fault=tuple(without_fault),
        with_fault=tuple(best),
        standing_out=seen[at],
    )


def _screened(without_fault: Sequence[float]) -> list[int]:
    """Return the indices of the orders at which the whole grid of frequencies is screened."""
    return sorted({0, int(np.argmin(without_fault))})


def _bic_with_fault(
    record: ScanRecord,
    scans: Sequence[Sequence[Scan]],
    without_fault: Sequence[float],
    report: Report,
    *,
    climbs: bool,
) -> tuple[list[float], list[dict[int, tuple[float, ...]]]]:
    """Return the criterion of every order with its best fault, and the frequencies that stand out, by output.

    That of an order that is left out, see `scan_hypotheses`, is infinite.

    A sine is tried at the frequencies that stand out at the lowest order, where its trace is largest, and at the order
    that is best without a fault. That takes half the time of the whole grid at every order and chose the same order in
    all trials made. The statistic of a sine at these frequencies is a lower bound.
    """
    looking, comparing = shares(report, 3, 6 if record.settings.ends else 1)
    candidates: dict[int, FloatArray] = {}
    for form, form_share in parts(looking, record.forms):
        if form.shape == "sine" and form.output not in candidates:
            frequencies = set[float]()
            for k, order_share in parts(form_share, _screened(without_fault)):
                scan = scans[k][form.output]
                frequencies.update(standing_out(scan, frequency_grid(scan, record.band), order_share))
            candidates[form.output] = np.array(sorted(frequencies))
    best, seen = [np.inf] * len(scans), [dict[int, tuple[float, ...]]() for _ in scans]
    begin, order_shares = int(np.argmin(without_fault)), iter(shares(comparing, *[1.0] * len(scans)))
    for side in (range(begin, -1, -1), range(begin + 1, len(scans))):
        for k in side:
            best[k], seen[k] = _with_best_fault(record, scans[k], without_fault[k], candidates, next(order_shares))
            if climbs and best[k] > min(best):
                break
    comparing(1.0)
    return best, seen


def _with_best_fault(
    record: ScanRecord, scans: Sequence[Scan], base: float, candidates: Mapping[int, FloatArray], report: Report
) -> tuple[float, dict[int, tuple[float, ...]]]:
    """Return the criterion of an order with its best fault, and by output the frequencies as they stand out.

    Parameters
    ----------
    scans : by output; base : the criterion without a fault; candidates : by output, the frequencies that are tried.
    """
    criteria, ranked = [], dict[int, tuple[float, ...]]()
    for form, share in parts(report, record.forms):
        scan, n_parameters = scans[form.output], 3 if form.parameter or form.shape == "sine" else 2
        if form.shape == "sine":
            screened = screen_sines(scan, candidates[form.output], share)
            statistic = float(screened.max())
            ranked[form.output] = tuple(candidates[form.output][np.argsort(-screened)].tolist())
        elif record.settings.ends:
            statistic = _scan_with_ends(record, scan, form, share).statistic
            n_parameters += 1
        else:
            statistic = largest_statistic(scan, waveform(form, replace(record.sampling, n_samples=scan.n_samples)))
        criteria.append(base - statistic + n_parameters * float(np.log(scan.n_rows)))
    return min(criteria), ranked


def _scan_at_order(
    record: ScanRecord, y: FloatArray, order: int, seen: Mapping[int, Sequence[float]], report: Report
) -> tuple[Peak, ...]:
    """Return the exact scan of every hypothesis at an order.

    Parameters
    ----------
    seen : by output, the frequencies that stand out, where they are known.
    """
    scans = [scan_of(record, y, order, output=i) for i in range(y.shape[1])]
    lengths = [SEARCH if form.shape == "sine" and form.parameter is None else 1 for form in record.forms]
    form_shares = zip(record.forms, shares(report, *lengths), strict=True)
    return tuple(
        scan_hypothesis(record, scans[form.output], form, share, begin=seen.get(form.output))
        for form, share in form_shares
    )


def scan_of(
    record: ScanRecord,
    y: FloatArray,
    order: int,
    *,
    output: int,
    first: int | None = None,
    nuisances: FloatArray | None = None,
) -> Scan:
    """Return the factorised record for faults of one output, kept from an earlier call where y is the same.

    Parameters
    ----------
    first : the first row of the regression is this sample; `order` if None. The same for all orders to be compared.
    nuisances : (n_rows, n) further regressors, None for none.
    """
    key = hash(y.tobytes()), order, output, first or order, None if nuisances is None else hash(nuisances.tobytes())
    if key not in record.scans:
        rows = slice((first or order) - order, None)
        while len(record.scans) >= REMEMBERED:
            del record.scans[next(iter(record.scans))]
        record.scans[key] = prepare_scan(
            record.u[rows],
            y[rows],
            order=order,
            feedthrough=record.layout.feedthrough,
            channel=output,
            weights=None if record.layout.weights is None else record.layout.weights[rows],
            floor=record.floor,
            nuisances=nuisances,
        )
    return record.scans[key]


def fault_free_bic(record: ScanRecord, scan: Scan) -> float:
    """Return n log det of the residuals plus log n per parameter, without a fault."""
    n_inputs: int = record.u.shape[1]
    regressors = 1 + n_inputs * (scan.order + record.layout.feedthrough) + scan.n_outputs * scan.order
    return scan.n_rows * float(np.log(scan.rss0)) + scan.n_outputs * regressors * float(np.log(scan.n_rows))


def scan_hypothesis(
    record: ScanRecord,
    scan: Scan,
    form: ShapeHypothesis,
    report: Report = silent,
    *,
    begin: Sequence[float] | None = None,
) -> Peak:
    """Return the exact scan of a hypothesis over the record; the likeliest frequency of a sine is sought if unknown.

    Parameters
    ----------
    begin : frequencies that stand out, cycles per sample, where they are known.
    """
    rate_hz, ends = record.sampling.rate_hz, record.settings.ends
    if form.shape == "sine" and form.parameter is None:
        searching, report = shares(report, SEARCH, 1)
        if ends:
            frequency = scan_frequency_ends(scan, record.band, report=searching)
        else:
            frequency = scan_frequency(scan, record.band, report=searching, begin=begin)
        form = replace(form, parameter=float(rate_hz * frequency))
    if ends:
        pair = _scan_with_ends(record, scan, form, report)
        return Peak(form=form, profile=pair.over_starts, end=pair.end)
    return lasting_peak(record, scan, form, report)


def _scan_with_ends(record: ScanRecord, scan: Scan, form: ShapeHypothesis, report: Report) -> PairScan:
    """Return the best start and end of a hypothesis, whose edges are sharp."""
    from ...kernels.onset.pairs import scan_ends

    sharp = replace(record.sampling, n_samples=scan.n_samples, factor=1)
    return scan_ends(scan, waveform(form, sharp), report=report)


def lasting_peak(record: ScanRecord, scan: Scan, form: ShapeHypothesis, report: Report = silent) -> Peak:
    """Return the exact scan of a hypothesis, a sine with its frequency, of a fault that does not end."""
    admitted, wave = record.admitted_onsets(scan, form), waveform(form, record.sampling)
    profile = scan_shape(scan, wave, admitted if admitted.size else default_onsets(scan)[:1], report=report)
    if not admitted.size:  # too near an end for a claim: it neither stands out nor is excluded
        profile = replace(profile, statistic=np.zeros(1))
    return Peak(form=form, profile=replace(profile, onsets=profile.onsets + record.sampling.lead), end=None)


def may_exceed(record: ScanRecord, y: FloatArray, thresholds: Mapping[str, float]) -> bool:
    """Return whether the statistic of some shape may exceed its threshold.

    That is whether its screen exceeds it over `SCREENED`, and what it promises, where that is known, over `PROMISED`.

    Parameters
    ----------
    record : True where orders or ends are to be compared, which no screen does.
    y : (n_samples, n_outputs) scaled outputs.
    thresholds : by shape.
    """
    if record.settings.ends or len(record.orders) > 1:
        return True
    forms = (form for form in record.forms if form.shape in thresholds)
    return any(
        promise_of(record, y, form) > thresholds[form.shape] / PROMISED
        and screened(record, y, form) > thresholds[form.shape] / SCREENED
        for form in forms
    )


def promise_of(record: ScanRecord, y: FloatArray, form: ShapeHypothesis) -> float:
    """Return about the largest statistic that a sine of the record's band may have; infinite for another shape."""
    if form.shape != "sine" or form.parameter is not None:
        return np.inf
    scan = scan_of(record, y, record.orders[0], output=form.output)
    return float(promised(scan, frequency_grid(scan, record.band)).max())


def screened(record: ScanRecord, y: FloatArray, form: ShapeHypothesis) -> float:
    """Return the largest statistic of a hypothesis by its screen, at the first order and for a fault that lasts."""
    scan = scan_of(record, y, record.orders[0], output=form.output)
    if form.shape == "sine" and form.parameter is None:
        return float(screen_grid(scan, frequency_grid(scan, record.band)).max())
    return screen_shape(scan, waveform(form, record.sampling), record.admitted_onsets(scan, form))


def bic_change(peak: Peak) -> float:
    """Return what a peak adds to the criterion: log n per parameter less its statistic."""
    return peak.n_parameters * float(np.log(len(peak.profile.onsets))) - peak.statistic
