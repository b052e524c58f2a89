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

from ..config import Config
from ..decision import candidate_of
from ..errors import ConfigError
from ..flightlog import FlightLog
from ..kernels.lagged import compress
from ..kernels.onset.scan import Profile, default_onsets
from ..kernels.progress import Progress, parts, unseen
from ..kernels.risro_varx import sparse_varx
from ..kernels.variable_projection import project_inputs
from ..notes import Note
from ..preprocessing.regression import decides_by_rule, solve, stage_of
from ..preprocessing.tolerance import tolerances_of
from .estimate import Estimate
from .result import OnsetResult, assemble_result
from .scan import HypothesisScan, Peak, fault_free_bic, scan_of
from .scan_record import prepare_record
from .shapes import fault_of, signal

# The shapes of known form of the published figures.
SHAPES = ("bias", "drift")
# Round-off beside the outputs, whose standard deviation is 1.
ROUND_OFF = 1e-10
NOTE = "the published method declares the peak of the magnitude; it has no test of whether there is a fault at all"

STAGE_NOTE = (
    "every onset is solved anew and the largest magnitude declared; the sparsity stage ({kind}) sets the magnitude to "
    "zero at {zeros} of {n} onsets"
)


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
    onsets, tiny = default_onsets(scan), np.finfo(float).tiny
    stage = None if decides_by_rule(config) else stage_of(config)
    price = float(np.log(scan.n_rows)) + config.selection.evidence
    forms = [form for form in record.forms if form.shape in SHAPES]
    form_of = {form.shape: form for form in forms}
    peaks = []
    for form, of_form in parts(partial(progress, "a solution for every onset"), forms):
        z, rss = np.zeros(len(onsets)), np.zeros(len(onsets))
        for k, (sample, _) in enumerate(parts(of_form, onsets.tolist())):
            theta = signal(form, record.sampling, (sample, 0))[:, None, None]
            data = compress(u, y, theta, order=order, feedthrough=record.feedthrough)
            solution = solve(data, config)
            z[k], rss[k] = float(solution.z[0]), solution.misfit**2
            if stage is None:
                continue
            problem = project_inputs(data, order, floor=ROUND_OFF)
            visits = sparse_varx(problem, solution, n_atoms=1, stage=stage, price=price)
            fall = scan.n_rows * np.log(np.maximum(scan.rss0, tiny) / np.maximum(rss[k], tiny))
            if fall < price or not any(support for went in visits for support in went.supports):
                z[k], rss[k] = 0.0, scan.rss0
        statistic = scan.n_rows * np.log(np.maximum(scan.rss0, tiny) / np.maximum(rss, tiny))
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
    estimate = Estimate(
        form=peak.form,
        onset_s=record.onset_s(sample),
        onset_ci95=(float("nan"), float("nan")),
        offset_s=None,
        z=z_best,
        sd=float("nan"),
        onset_spread=float("nan"),
        signal=z_best * signal(peak.form, record.sampling, (sample, 0)),
        statistic=float(peak.profile.statistic[best]),
    )
    estimates = [estimate] if z_best else []
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
    notes = [Note.limit(NOTE)]
    if stage is not None:
        zeros = sum(int(np.sum(peak.profile.z == 0.0)) for peak in peaks)
        notes = [Note.limit(STAGE_NOTE.format(kind=stage.kind, zeros=zeros, n=len(peaks) * len(onsets)))]
    if left:
        notes.append(Note.limit(f"the published method is for steps and ramps; left out: {left}"))
    tolerances = tolerances_of(log, record.window.log, config.outputs, config)
    result = assemble_result(
        record, curve, estimates, [None] * len(estimates), tolerances, order=order, series_order=order
    )
    # The published method has no interval and no test, so it excludes nothing.
    candidates = []
    for shown in result.profiles:
        own = next((one for one in result.faults if one.fault.shape == shown.shape), None)
        fault = fault_of(form_of[shown.shape], shown.channel)
        best = int(np.argmax(np.abs(shown.magnitude)))
        unit, size = log.channel(shown.channel).unit, float(shown.magnitude[best])
        candidates.append(candidate_of(fault, unit, name=shown.shape, declared=own is not None, magnitude=size))
    return replace(
        result,
        candidates=tuple(candidates),
        false_alarm=wanted.false_alarm,
        method="thesis",
        notes=tuple(notes),
    )
