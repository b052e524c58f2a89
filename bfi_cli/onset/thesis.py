"""The published search for an onset, for comparison: RISRO solved anew for every onset, the peak of the magnitude.

The thesis (section 5-6, figures 5-14 to 5-16) does this for a fault of known shape and reads the onset off a figure; it
has no test of whether there is a fault. Of several shapes, the one that explains the record best at its peak is taken.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..config import Config
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..kernels.lagged import compress
from ..kernels.onset.scan import Profile, default_onsets
from ..kernels.progress import Progress, parts, unseen
from ..kernels.risro_varx import risro_varx
from ..kernels.termination import StoppingRule
from .estimate import Estimate
from .result import OnsetResult, assemble_result
from .scan import HypothesisScan, Peak, fault_free_bic, scan_of
from .scan_record import prepare_record
from .shapes import signal

__all__ = ["find_onset_as_published"]

# The shapes of known form of the published figures.
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
    wanted = config.start_time
    if len(config.outputs) > 1:
        raise ConfigError(f"--method thesis: works on one output, got {len(config.outputs)}; give one --output")
    if wanted.ends:
        raise ConfigError("--method thesis: finds no ends; leave --ends out, or give --method scan")
    if not set(wanted.shapes) & set(SHAPES):
        raise ConfigError(f"--method thesis: knows {' and '.join(SHAPES)} only, got {', '.join(wanted.shapes)}")
    record = prepare_record(log, config, partial(progress, "the window"))
    u, y, orders = record.u, record.y, record.orders
    plain = [fault_free_bic(record, scan_of(record, y, s, output=0, first=max(orders))) for s in orders]
    order = orders[int(np.argmin(plain))]
    scan = scan_of(record, y, order, output=0)
    onsets, rules, floor = default_onsets(scan), config.risro, np.finfo(float).tiny
    stopping = StoppingRule(max_iterations=rules.max_iterations, tolerance=rules.tolerance)
    forms = [form for form in record.forms if form.shape in SHAPES]
    peaks = []
    for form, of_form in parts(partial(progress, "a solution for every onset"), forms):
        solved = []
        for sample, _ in parts(of_form, onsets.tolist()):
            theta = signal(form, record.sampling, (sample, 0))[:, None, None]
            data = compress(u, y, theta, order=order, feedthrough=record.feedthrough)
            solved.append(risro_varx(data, settings=stopping, as_published=rules.as_published))
        z = np.array([float(one.z[0]) for one in solved])
        rss = np.array([one.misfit**2 for one in solved])
        statistic = scan.n_rows * np.log(np.maximum(scan.rss0, floor) / np.maximum(rss, floor))
        profile = Profile(
            onsets=onsets,
            z=z,
            sd=np.full(len(z), np.nan),
            rss=rss,
            rss0=scan.rss0,
            statistic=np.maximum(statistic, 0.0),
        )
        peaks.append(Peak(form=form, profile=profile, end=None))
    largest = [int(np.argmax(np.abs(peak.profile.z))) for peak in peaks]
    peak, best = min(zip(peaks, largest, strict=True), key=lambda pair: pair[0].profile.rss[pair[1]])
    sample, z_best = int(peak.profile.onsets[best]), float(peak.profile.z[best])
    onset_s, step_s = record.onset_s(sample), 1.0 / record.sampling.rate_hz
    estimate = Estimate(
        form=peak.form,
        onset_s=onset_s,
        onset_ci95=(onset_s - step_s, onset_s + step_s),
        offset_s=None,
        z=z_best,
        sd=float("nan"),
        signal=z_best * signal(peak.form, record.sampling, (sample, 0)),
        statistic=float(peak.profile.statistic[best]),
    )
    criteria = tuple(plain)
    curve = HypothesisScan(
        order=order,
        fault_free_order=order,
        peaks=tuple(peaks),
        orders=orders,
        without_fault=criteria,
        with_fault=criteria,
    )
    left = ", ".join(shape for shape in wanted.shapes if shape not in SHAPES)
    notes = (NOTE, f"the published method is for steps and ramps; left out: {left}") if left else (NOTE,)
    result = assemble_result(record, curve, [estimate], [None], order=order, series_order=order)
    return replace(result, false_alarm=wanted.false_alarm, method="thesis", notes=notes)
