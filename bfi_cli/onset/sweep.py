"""All shapes at all onsets, the order of the model chosen together with the shape (METHOD section 5, Order)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.onset_ends import peaks, scan_ends
from ..kernels.onset_frequency import MIN_CYCLES, scan_frequency, scan_frequency_ends
from ..kernels.onset_profile import screen
from ..kernels.onset_scan import Profile, default_onsets, in_blocks, magnitude_bound, scan_shape, stack_onsets
from ..kernels.onset_shapes import sine
from ..kernels.onset_tables import Scan, prepare_scan, tabulate
from ..kernels.progress import Report, parts, shares, silent
from .record import ScanRecord
from .shapes import Form, waveform

__all__ = [
    "Peak",
    "Sweep",
    "best_of",
    "charged",
    "criterion",
    "lasting_peak",
    "peak_of",
    "plain_criterion",
    "scan_of",
    "sweep",
]

FloatArray = NDArray[np.float64]

GRID = 0.5
PER_PERIOD = 6
SUSPECTS = 8
# How long the search for a frequency takes, in scans of one shape; for the estimate of the time left only.
SEARCH = 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peak:
    """One form at all onsets.

    Attributes
    ----------
    form : with the frequency found.
    profile : over the onsets, which are conditioned samples of the record; with an end, at the best end.
    end : conditioned sample, None where the fault lasts.
    """

    form: Form
    profile: Profile
    end: int | None

    @property
    def statistic(self) -> float:
        """Largest over the onsets."""
        return float(self.profile.statistic[self.profile.best])

    @property
    def onset(self) -> int:
        """Conditioned sample of the best onset."""
        return int(self.profile.onsets[self.profile.best])

    @property
    def n_parameters(self) -> int:
        """What was sought: magnitude, onset, end, and frequency or time constant."""
        return 2 + (self.end is not None) + (self.form.parameter is not None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweep:
    """All forms at the order chosen.

    Attributes
    ----------
    order : chosen; plain_order : the one chosen without a fault.
    peaks : one per form.
    orders, plain : tried, and the criterion of each without a fault.
    with_fault : the criterion of each with its best fault.
    """

    order: int
    plain_order: int
    peaks: tuple[Peak, ...]
    orders: tuple[int, ...]
    plain: tuple[float, ...]
    with_fault: tuple[float, ...]

    def of(self, shape: str) -> Peak:
        """Return the best peak of a shape."""
        return max((peak for peak in self.peaks if peak.form.shape == shape), key=lambda peak: peak.statistic)


def sweep(record: ScanRecord, y: FloatArray, order: int | None = None, report: Report = silent) -> Sweep:
    """Scan every form over every onset.

    Parameters
    ----------
    record : how, and the inputs.
    y : (n_samples, n_outputs) scaled outputs, less what is explained already.
    order : of the model; None to choose it together with the shape by the Bayesian information criterion.
    report : told how far it is.
    """
    orders = record.orders if order is None else (order,)
    several = len(orders) > 1
    preparing, choosing, peaking, again = shares(report, 1, 10 * several, 15, 20 * (several and record.settings.ends))
    scans = [
        [scan_of(record, y, s, output=i, first=max(orders)) for i in range(y.shape[1])]
        for s, _ in parts(preparing, orders)
    ]
    plain = [plain_criterion(record, of_outputs[0]) for of_outputs in scans]
    best = _best_of_orders(record, scans, plain, choosing) if several else plain
    chosen = orders[int(np.argmin(np.minimum(plain, best)))]
    found = _peaks(record, y, chosen, peaking)
    if record.settings.ends and several:
        comparing, peaking = shares(again, 1, 3)
        best = np.minimum(best, _with(record, y, best_of(found), plain, comparing)).tolist()
        if (better := orders[int(np.argmin(np.minimum(plain, best)))]) != chosen:
            chosen, found = better, _peaks(record, y, better, peaking)
    report(1.0)
    return Sweep(
        order=chosen,
        plain_order=orders[int(np.argmin(plain))],
        peaks=found,
        orders=orders,
        plain=tuple(plain),
        with_fault=tuple(best),
    )


def _best_of_orders(
    record: ScanRecord, scans: Sequence[Sequence[Scan]], plain: Sequence[float], report: Report
) -> list[float]:
    """Return the criterion of every order with its best fault.

    A sine is tried at the frequencies that stand out at the lowest order, where its trace is largest, and at the order
    that is best without a fault.
    """
    looking, comparing = shares(report, 3, 6 if record.settings.ends else 1)
    suspects: dict[int, list[float]] = {}
    for form, of_form in parts(looking, record.forms):
        if form.shape == "sine" and form.output not in suspects:
            looked = [*{0, int(np.argmin(plain))}]
            found = [f for k, own in parts(of_form, looked) for f in _standing_out(record, scans[k][form.output], own)]
            suspects[form.output] = sorted(set(found))
    return [
        min(
            criterion(base, *_quick(record, of[form.output], form, suspects, own))
            for form, own in parts(of_order, record.forms)
        )
        for (of, base), of_order in parts(comparing, list(zip(scans, plain, strict=True)))
    ]


def _standing_out(record: ScanRecord, scan: Scan, report: Report) -> list[float]:
    """Return the frequencies, cycles per sample, of the highest peaks of a coarse grid."""
    low, high = (f / record.sampling.rate_hz for f in record.band_hz)
    grid = np.linspace(low, high, 1 + int(np.ceil((high - low) * scan.n_samples / GRID)))
    statistic = np.array([_screened(scan, float(f), own) for f, own in parts(report, list(grid))])
    return [float(grid[k]) for k in peaks(statistic, SUSPECTS)]


def _peaks(record: ScanRecord, y: FloatArray, order: int, report: Report) -> tuple[Peak, ...]:
    scans = [scan_of(record, y, order, output=i) for i in range(y.shape[1])]
    lengths = [SEARCH if form.shape == "sine" and form.parameter is None else 1 for form in record.forms]
    of_forms = zip(record.forms, shares(report, *lengths), strict=True)
    return tuple(peak_of(record, scans[form.output], form, own) for form, own in of_forms)


def _with(record: ScanRecord, y: FloatArray, peak: Peak, plain: Sequence[float], report: Report) -> list[float]:
    """Return the criterion of every order with the form of a peak, its start and end sought anew.

    The coarse grid of frequencies knows no ends, so that an order too high, which absorbs a short oscillation, may be
    chosen by it.
    """
    found = []
    for (order, base), own in parts(report, list(zip(record.orders, plain, strict=True))):
        scan = scan_of(record, y, order, output=peak.form.output, first=max(record.orders))
        span = scan_ends(scan, waveform(peak.form, record.sampling.shorter(scan.n_samples).sharp()), report=own)
        found.append(criterion(base, span.statistic, peak.n_parameters * float(np.log(scan.n_rows))))
    return found


def scan_of(record: ScanRecord, y: FloatArray, order: int, *, output: int, first: int | None = None) -> Scan:
    """Return the factorised record for faults of one output.

    Parameters
    ----------
    first : the first row of the regression is this sample; `order` if None. The same for all orders to be compared.
    """
    skip = (first or order) - order
    return prepare_scan(
        record.u[skip:],
        y[skip:],
        order=order,
        feedthrough=record.feedthrough,
        channel=output,
        floor=record.floor,
    )


def plain_criterion(record: ScanRecord, scan: Scan) -> float:
    """Return n log det of the residuals plus log n per parameter, without a fault."""
    n_inputs: int = record.u.shape[1]
    regressors = 1 + n_inputs * (scan.order + record.feedthrough) + scan.n_outputs * scan.order
    return scan.n_rows * float(np.log(scan.rss0)) + scan.n_outputs * regressors * float(np.log(scan.n_rows))


def criterion(plain: float, statistic: float, charge: float) -> float:
    """Return the criterion with a fault; `charge` is the sum of log n over its parameters."""
    return plain - statistic + charge


def _quick(
    record: ScanRecord, scan: Scan, form: Form, suspects: dict[int, list[float]], report: Report
) -> tuple[float, float]:
    """Return the statistic of a form, for a sine a lower bound from the suspects, and the charge of its parameters."""
    charge = float(np.log(scan.n_rows))
    if form.shape != "sine":
        sampling, n_parameters = record.sampling.shorter(scan.n_samples), 3 if form.parameter else 2
        if record.settings.ends:
            span = scan_ends(scan, waveform(form, sampling.sharp()), report=report)
            return span.statistic, (n_parameters + 1) * charge
        found = scan_shape(scan, waveform(form, sampling), report=report)
        return float(found.statistic.max()), n_parameters * charge
    return max(_screened(scan, f, own) for f, own in parts(report, suspects[form.output])), 3 * charge


def _screened(scan: Scan, frequency: float, report: Report) -> float:
    wave = sine(scan.n_samples, angle=2.0 * np.pi * frequency)
    onsets = default_onsets(scan)[:: max(1, int(1.0 / (PER_PERIOD * frequency)))]
    onsets = onsets[onsets <= scan.n_samples - MIN_CYCLES / frequency]
    if not onsets.size:
        return 0.0
    tables, bound = tabulate(scan, wave.samples), magnitude_bound(scan, wave, scan.n_samples - onsets)
    found = in_blocks(scan, bound, lambda b: screen(stack_onsets(scan, tables, onsets[b]), bound[b]), report)
    return float(-scan.n_rows * found.F.min())


def peak_of(record: ScanRecord, scan: Scan, form: Form, report: Report = silent) -> Peak:
    """Return the exact scan of a form over the record; a sine without a frequency at its best one."""
    if form.shape == "sine" and form.parameter is None:
        searching, report = shares(report, SEARCH, 1)
        form = replace(form, parameter=_frequency(record, scan, searching))
    if record.settings.ends:
        span = scan_ends(scan, waveform(form, record.sampling.sharp()), report=report)
        return Peak(form=form, profile=span.over_starts, end=span.end)
    return lasting_peak(record, scan, form, report)


def lasting_peak(record: ScanRecord, scan: Scan, form: Form, report: Report = silent) -> Peak:
    """Return the exact scan of a form that does not end, with its frequency."""
    found = scan_shape(scan, waveform(form, record.sampling), report=report)
    return Peak(form=form, profile=replace(found, onsets=found.onsets + record.sampling.lead), end=None)


def _frequency(record: ScanRecord, scan: Scan, report: Report) -> float:
    rate_hz = record.sampling.rate_hz
    band = (record.band_hz[0] / rate_hz, record.band_hz[1] / rate_hz)
    if record.settings.ends:
        return float(rate_hz * scan_frequency_ends(scan, band, report=report).frequency)
    return float(rate_hz * scan_frequency(scan, band, report=report).frequency)


def best_of(peaks: Sequence[Peak]) -> Peak:
    """Return the peak with the least criterion."""
    return min(peaks, key=charged)


def charged(peak: Peak) -> float:
    """Return what a peak adds to the criterion: log n per parameter less its statistic."""
    return peak.n_parameters * float(np.log(len(peak.profile.onsets))) - peak.statistic
