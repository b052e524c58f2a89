"""The published search for an onset, for comparison: RISRO solved anew for every onset, the peak of the magnitude.

The thesis (section 5-6, figures 5-14 to 5-16) does this for a fault of known shape and reads the onset off a figure; it
has no test of whether there is a fault. Of several shapes, the one that explains the record best at its peak is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..kernels.lagged import compress
from ..kernels.onset.correlations import Scan
from ..kernels.onset.scan import Profile, default_onsets
from ..kernels.progress import Progress, Report, parts, unseen
from ..kernels.risro_varx import VarxSolution, risro_varx
from ..kernels.termination import StoppingRule
from .estimate import Estimate
from .layout import model_of, onset_fault, series_of, shape_profile, truth_of
from .record import ScanRecord, prepare_record
from .result import OnsetResult
from .shapes import Form, signal
from .sweep import Peak, Sweep, plain_criterion, scan_of

__all__ = ["find_onset_as_published"]

FloatArray = NDArray[np.float64]

SHAPES = ("bias", "drift")
NOTE = "the published method declares the peak of the magnitude; it has no test of whether there is a fault at all"


def find_onset_as_published(log: FlightLog, config: Config, progress: Progress = unseen) -> OnsetResult:
    """Return the onset where the magnitude of a separate solution for every onset is largest.

    Parameters
    ----------
    log, config, progress : see `find_onset`.

    Raises
    ------
    ConfigError : several outputs, a search for ends, or no shape of this method.
    LogError, ExcitationError : the log cannot be used.
    """
    _check(config)
    record = prepare_record(log, config, partial(progress, "the window"))
    forms = [form for form in record.forms if form.shape in SHAPES]
    plain = [plain_criterion(record, _scan(record, order, max(record.orders))) for order in record.orders]
    order = record.orders[int(np.argmin(plain))]
    every = parts(partial(progress, "a solution for every onset"), forms)
    peaks = tuple(_peak(record, form, order, config, own) for form, own in every)
    found = min(peaks, key=lambda peak: peak.profile.rss[_largest(peak)])
    estimate = _estimate(record, found)
    curve = Sweep(
        order=order, plain_order=order, peaks=peaks, orders=record.orders, plain=tuple(plain), with_fault=tuple(plain)
    )
    left = [shape for shape in config.start_time.shapes if shape not in SHAPES]
    return OnsetResult(
        log=record.window.summary,
        decision="fault",
        false_alarm=config.start_time.false_alarm,
        p_value=None,
        statistic=estimate.statistic,
        threshold=None,
        calibration=None,
        faults=(onset_fault(record, estimate, p_value=None),),
        model=model_of(record, curve, record.y - estimate.signal[:, None], order=order),
        method="thesis",
        profiles=tuple(shape_profile(record, peak, None) for peak in peaks),
        time_s=frozen_array(record.time_s),
        series=series_of(record, record.y - estimate.signal[:, None], order=order),
        truth=truth_of(record),
        notes=(NOTE, *_left_out(left)),
    )


def _check(config: Config) -> None:
    asked = config.start_time
    if len(config.outputs) > 1:
        raise ConfigError(f"--method thesis: works on one output, got {len(config.outputs)}; give one --output")
    if asked.ends:
        raise ConfigError("--method thesis: finds no ends; leave --ends out, or give --method scan")
    if not set(asked.shapes) & set(SHAPES):
        raise ConfigError(f"--method thesis: knows {' and '.join(SHAPES)} only, got {', '.join(asked.shapes)}")


def _left_out(shapes: Sequence[str]) -> tuple[str, ...]:
    return (f"the published method is for steps and ramps; left out: {', '.join(shapes)}",) if shapes else ()


def _scan(record: ScanRecord, order: int, first: int) -> Scan:
    return scan_of(record, record.y, order, output=0, first=first)


def _peak(record: ScanRecord, form: Form, order: int, config: Config, report: Report) -> Peak:
    scan = _scan(record, order, order)
    onsets = default_onsets(scan)
    solved = [
        _solve(record, signal(form, record.sampling, (k, 0)), order, config) for k, _ in parts(report, onsets.tolist())
    ]
    z = np.array([float(one.z[0]) for one in solved])
    rss = np.array([one.misfit**2 for one in solved])
    floor = np.finfo(float).tiny
    statistic = scan.n_rows * np.log(np.maximum(scan.rss0, floor) / np.maximum(rss, floor))
    profile = Profile(
        onsets=onsets,
        z=z,
        sd=np.full(len(z), np.nan),
        rss=rss,
        rss0=scan.rss0,
        statistic=np.maximum(statistic, 0.0),
    )
    return Peak(form=form, profile=profile, end=None)


def _solve(record: ScanRecord, theta: FloatArray, order: int, config: Config) -> VarxSolution:
    data = compress(record.u, record.y, theta[:, None, None], order=order, feedthrough=record.feedthrough)
    rules = config.risro
    settings = StoppingRule(max_iterations=rules.max_iterations, tolerance=rules.tolerance)
    return risro_varx(data, settings=settings, as_published=rules.as_published)


def _largest(peak: Peak) -> int:
    return int(np.argmax(np.abs(peak.profile.z)))


def _estimate(record: ScanRecord, peak: Peak) -> Estimate:
    best = _largest(peak)
    sample, z = int(peak.profile.onsets[best]), float(peak.profile.z[best])
    onset_s, step_s = record.onset_s(sample), 1.0 / record.sampling.rate_hz
    return Estimate(
        form=peak.form,
        onset_s=onset_s,
        onset_ci95=(onset_s - step_s, onset_s + step_s),
        offset_s=None,
        z=z,
        sd=float("nan"),
        signal=z * signal(peak.form, record.sampling, (sample, 0)),
        statistic=float(peak.profile.statistic[best]),
    )
