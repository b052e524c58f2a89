"""The published search for an onset, for comparison: RISRO solved anew for every onset, the peak of the magnitude.

The thesis (section 5-6, figures 5-14 to 5-16) does this for a fault of known shape and reads the onset off a figure; it
has no test of whether there is a fault, and no interval. Of several shapes, the one that explains the record best at
its peak is taken. The sparsity stage acts at every onset as `risro` configures it: as published on RISRO's iterates,
else by setting the magnitude to zero where its supports, or the criterion, leave the atom out.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ...config import Config
from ...decision import Evidence, candidate_of
from ...errors import ConfigError
from ...flightlog import FlightLog
from ...kernels import TINY
from ...kernels.lagged import compress
from ...kernels.onset.scan import Profile, Scan, default_onsets
from ...kernels.progress import Progress, Report, parts, unseen
from ...kernels.risro_varx import SparseStage, sparse_varx
from ...kernels.variable_projection import project_inputs
from ...notes import Note
from ..preprocessing.defaults import tolerances_of
from ..preprocessing.regression import decides_by_rule, solve, stage_of
from .estimate import as_scanned, declared_faults
from .scan import HypothesisScan, Peak, fault_free_bic, scan_of
from .scan_record import ScanRecord, prepare_record
from .search import OnsetSearch
from .shapes import ShapeHypothesis, fault_of, signal

# The shapes of known form of the published figures.
PUBLISHED = ("bias", "drift")
# Round-off beside the outputs, whose standard deviation is 1.
ROUND_OFF = 1e-10
NOTE = "the published method declares the peak of the magnitude; it has no test of whether there is a fault at all"

STAGE_NOTE = (
    "every onset is solved anew and the largest magnitude declared; the sparsity stage ({kind}) sets the magnitude to "
    "zero at {zeros} of {n} onsets"
)


def search_as_published(log: FlightLog, config: Config, progress: Progress = unseen) -> OnsetSearch:
    """Search the onset where the magnitude of a separate solution for every onset is largest.

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
    if not set(wanted.shapes) & set(PUBLISHED):
        raise ConfigError(f"--method thesis: knows {' and '.join(PUBLISHED)} only, got {', '.join(wanted.shapes)}")
    record = prepare_record(log, config, partial(progress, "the window"))
    y, orders = record.y, record.orders
    plain = [fault_free_bic(record, scan_of(record, y, s, output=0, first=max(orders))) for s in orders]
    order = orders[int(np.argmin(plain))]
    scan = scan_of(record, y, order, output=0)
    stage = None if decides_by_rule(config) else stage_of(config)
    forms = [form for form in record.forms if form.shape in PUBLISHED]
    peaks = [
        Peak(form=form, profile=_solved(record, scan, form, config, stage, share), end=None)
        for form, share in parts(partial(progress, "a solution for every onset"), forms)
    ]
    largest = [int(np.argmax(np.abs(peak.profile.z))) for peak in peaks]
    peak, best = min(zip(peaks, largest, strict=True), key=lambda pair: pair[0].profile.rss[pair[1]])
    estimate = as_scanned(record, replace(peak, profile=peak.profile.take(np.array([best]))))
    estimates = [estimate] if estimate.z else []
    curve = HypothesisScan(
        order=order,
        fault_free_order=order,
        peaks=tuple(peaks),
        orders=orders,
        without_fault=tuple(plain),
        with_fault=tuple(plain),
        standing_out={},
    )
    notes = [Note.limit(NOTE)]
    if stage is not None:
        z = np.concatenate([peak.profile.z for peak in peaks])
        notes = [Note.limit(STAGE_NOTE.format(kind=stage.kind, zeros=np.count_nonzero(z == 0.0), n=z.size))]
    if left := ", ".join(shape for shape in wanted.shapes if shape not in PUBLISHED):
        notes.append(Note.limit(f"the published method is for steps and ramps; left out: {left}"))
    # The published method has no interval and no test, so it excludes nothing.
    channel, scale, unit = record.output(0)
    candidates = [
        candidate_of(
            fault_of(scanned.form, channel),
            unit,
            name=scanned.form.shape,
            declared=bool(estimates) and scanned is peak,
            magnitude=scale * float(scanned.profile.z[k]),
        )
        for scanned, k in zip(peaks, largest, strict=True)
    ]
    tolerances = tolerances_of(log, record.window.log, config.outputs, config)
    faults = declared_faults(record, estimates, tolerances)
    return OnsetSearch(
        method="thesis",
        record=record,
        scan=curve,
        estimates=tuple(estimates),
        evidence=Evidence(source="scan", faults=faults, candidates=tuple(candidates), notes=tuple(notes)),
        order=order,
        series_order=order,
    )


def _solved(
    record: ScanRecord, scan: Scan, form: ShapeHypothesis, config: Config, stage: SparseStage | None, report: Report
) -> Profile:
    """Return the profile of a shape by a solution for every onset, with the magnitudes that the stage leaves."""
    price = float(np.log(scan.n_rows)) + config.selection.evidence
    onsets = default_onsets(scan)
    z, rss = np.zeros(len(onsets)), np.zeros(len(onsets))
    for k, (sample, _) in enumerate(parts(report, onsets.tolist())):
        theta = signal(form, record.sampling, (sample, 0))[:, None, None]
        data = compress(record.u, record.y, theta, order=scan.order, feedthrough=record.layout.feedthrough)
        solution = solve(data, config)
        z[k], rss[k] = float(solution.z[0]), solution.misfit**2
        if stage is None:
            continue
        problem = project_inputs(data, scan.order, floor=ROUND_OFF)
        visits = sparse_varx(problem, solution, n_atoms=1, stage=stage, price=price)
        fall = scan.n_rows * np.log(np.maximum(scan.rss0, TINY) / np.maximum(rss[k], TINY))
        if fall < price or not any(support for went in visits for support in went.supports):
            z[k], rss[k] = 0.0, scan.rss0
    statistic = scan.n_rows * np.log(np.maximum(scan.rss0, TINY) / np.maximum(rss, TINY))
    return Profile(
        onsets=onsets,
        z=z,
        sd=np.full(len(z), np.nan),
        rss=rss,
        rss0=scan.rss0,
        statistic=np.maximum(statistic, 0.0),
    )
