"""What a declared fault leaves of others: its signature as a nuisance, and the kinds that may stand in its place.

1. What could hide beside declared faults is sought in the record less these, each of which may still have any
   magnitude: to first order a magnitude moves the prediction errors along the fault's signature filtered by the
   predictor, which joins the regressors.
2. A declared fault may be another of another kind, as two drifts are a ramp that holds. So each, and all that are
   declared on one output together, are put back, and a fault of another kind is sought in their place.
3. A change of thrust or wind that the inputs do not show looks like a fault of the output. What the log's other
   channels explain is no fault: a fault that is declared stands out with all trusted channels as inputs, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ...config import Config, merge
from ...errors import LogError
from ...faults import FaultEstimate
from ...faults.shapes import SCANNED, SCANNED_AS, SHAPES, Shape
from ...flightlog import FlightLog
from ...kernels import ONE_SIDED_95, FloatArray
from ...kernels.onset.scan import Scan, largest_statistic
from ...quantities.text import instant
from ..preprocessing.window import with_inputs_of
from .claims import standing_out_hz
from .estimate import Estimate, as_scanned, estimate, subtract_faults, unit_signals
from .scan import lasting_peak, scan_of
from .scan_record import ScanRecord, prepare_record
from .shapes import ShapeHypothesis, constants_s, hypothesis_of, signal, subsample_index, waveform

# Shapes, of kinds of their own, that may stand in place of a declared fault.
RIVALS: tuple[Shape, ...] = tuple(name for name in SCANNED if name != "samples")
# One shape is told from another where the record is this many times as likely with it, for each of the onsets at which
# it could have begun: where the other is true that happens in one record of so many.
CERTAIN = 100.0
# A weak fault may be another that explains half of what it explains, at least.
HALF = 0.5
# Share of the statistic that is wanted from which on a shape is also sought between the samples of the scan, and an
# oscillation with its phase free. In windows of recorded flights at 2 Hz that added up to nine tenths.
HOPEFUL = 0.5
# Frequencies that stand out which are tried.
STANDING_OUT = 3
# A scan knows no cosine: it is a sine a quarter of a period further.
QUARTER = 0.5 * np.pi


def known_faults(record: ScanRecord, faults: Sequence[FaultEstimate]) -> list[Estimate]:
    """Return faults that another source declared and that are subtracted from a record, as the scan knows faults.

    Those are left out whose signal no scan has, and that begin before the record.
    """
    factor, known = record.sampling.factor, []
    for declared in faults:
        fault, start = declared.fault, record.native(declared.fault.onset_s)
        form = hypothesis_of(fault, record.settings.outputs)
        if form is None or start < 0:
            continue
        form = replace(form, phase_rad=fault.phase_rad + (QUARTER if fault.shape == "cosine" else 0.0))
        z = declared.magnitude * (fault.slope or 1.0) / float(record.unit[form.output])
        end = None if fault.offset_s is None else subsample_index(record.native(fault.offset_s), factor)
        known.append(
            Estimate(
                form=form,
                onset_s=fault.onset_s,
                onset_ci95=(fault.onset_s, fault.onset_s),
                offset_s=fault.offset_s,
                z=z,
                sd=declared.sd,
                onset_spread=0.0,
                signal=z * signal(form, record.sampling, subsample_index(start, factor), end),
                statistic=np.nan,
                among=(fault.shape,),
            )
        )
    return known


def scans_beside(record: ScanRecord, y: FloatArray, declared: Sequence[Estimate], order: int) -> tuple[Scan, ...]:
    """Return, for every output, the factorised record less declared faults, which may still have any magnitude.

    Parameters
    ----------
    y : (n_samples, n_outputs) the outputs less the faults, scaled.
    order : of the model.
    """
    nuisances = _sensitivities(record, y, declared, order)
    return tuple(scan_of(record, y, order, output=i, nuisances=nuisances) for i in range(y.shape[1]))


def _sensitivities(record: ScanRecord, y: FloatArray, declared: Sequence[Estimate], order: int) -> FloatArray | None:
    """Return (n_rows, n) the changes of the prediction errors with the magnitudes; None where nothing is declared."""
    if not declared:
        return None
    n, theta = len(y), np.zeros((*y.shape, len(declared)))
    for i, fault in enumerate(declared):
        theta[:, fault.form.output, i] = fault.signal / (np.abs(fault.signal).max() or 1.0)
    changes = theta[order:].copy()
    for lag, K in enumerate(record.likelihood(y, order).fault_free.K, start=1):
        changes -= np.einsum("io,koj->kij", K, theta[order - lag : n - lag])
    return changes.reshape(n - order, -1)


def rivals_of(declared: Sequence[Estimate]) -> set[tuple[Shape, int]]:
    """Return shape and output of what may stand in place of declared faults: of another kind, and in their `among`."""
    return {
        (shape, fault.form.output)
        for fault in declared
        for shape in fault.among
        if SHAPES[shape].kind != SHAPES[fault.form.shape].kind
    }


def with_rivals(
    record: ScanRecord,
    y: FloatArray,
    declared: Sequence[Estimate],
    tolerances: Mapping[str, float],
    *,
    order: int,
    seen: Mapping[int, Sequence[float]],
) -> list[Estimate]:
    """Return declared faults, with the shapes of other kinds that would explain the record about as well in `among`.

    Parameters
    ----------
    y : (n_samples, n_outputs) the outputs less all declared faults, scaled; order : of the model.
    tolerances : by output, SI. A fault whose error is surely within it hides nothing that limits are about.
    seen : by output, frequencies that stand out in the record with all of them, where they are known.
    """
    among = [dict.fromkeys(fault.among or (fault.form.shape,)) for fault in declared]
    for output in {fault.form.output for fault in declared}:
        on_output = [i for i, fault in enumerate(declared) if fault.form.output == output]
        without = scan_of(record, y, order, output=output)
        channel, scale, _ = record.output(output)
        for group in dict.fromkeys((*((i,) for i in on_output), tuple(on_output))):
            replaced = [declared[i] for i in group]
            kinds = {SHAPES[fault.form.shape].kind for fault in replaced}
            put_back = subtract_faults(y, *(replace(fault, signal=-fault.signal) for fault in replaced))
            scan = scan_of(record, put_back, order, output=output)
            wanted = scan.n_rows * float(np.log(scan.rss0 / without.rss0))
            dispersion = max(lasting_peak(record, without, fault.form).profile.dispersion for fault in replaced)
            wanted = max(wanted - 2.0 * dispersion * float(np.log(CERTAIN * scan.n_rows)), HALF * wanted)
            for shape in RIVALS:
                looked_for = SCANNED_AS.get(shape, shape) in record.settings.shapes
                if SHAPES[shape].kind in kinds or not looked_for:
                    continue
                rivals = _rivals(record, put_back, scan, shape, replaced, seen.get(output), wanted)
                if any(not _largest_error(rival) < tolerances[channel] / scale for rival in rivals):
                    for i in group:
                        among[i][shape] = None
    return [replace(fault, among=tuple(shapes)) for fault, shapes in zip(declared, among, strict=True)]


def _largest_error(fault: Estimate) -> float:
    """Return the largest error, scaled, that a fault makes at the upper end of the 95 % interval of its magnitude."""
    return float(np.abs(fault.signal).max()) * (1.0 + ONE_SIDED_95 * fault.sd / abs(fault.z))


def _rivals(
    record: ScanRecord,
    y: FloatArray,
    scan: Scan,
    shape: Shape,
    replaced: Sequence[Estimate],
    seen: Sequence[float] | None,
    wanted: float,
) -> list[Estimate]:
    """Return the faults of a shape in outputs y that reach a statistic, one for each of its constants.

    They are sought at the onsets of the scan, and where none suffices but the best may, between these.
    """
    forms = list(_forms(record, scan, shape, replaced, seen))
    statistics = [_statistic(record, scan, form) for form in forms]
    if max(statistics, default=0.0) >= wanted:
        reached = (form for form, statistic in zip(forms, statistics, strict=True) if statistic >= wanted)
        return [as_scanned(record, lasting_peak(record, scan, form)) for form in reached]
    if max(statistics, default=0.0) < HOPEFUL * wanted:
        return []
    between = estimate(record, y, lasting_peak(record, scan, forms[int(np.argmax(statistics))]), order=scan.order)
    return [between] if between.statistic >= wanted else []


def _forms(
    record: ScanRecord, scan: Scan, shape: Shape, replaced: Sequence[Estimate], seen: Sequence[float] | None
) -> Iterator[ShapeHypothesis]:
    """Give the hypotheses of a shape: its constants on a grid, or the frequencies of claims that stand out.

    A ramp that holds is two drifts, from its start and, the other way, from its end: it has every such duration, too.
    """
    output = replaced[0].form.output
    parameters: list[float | None] = [None]
    if shape == "sine":
        parameters = [*standing_out_hz(record, scan, seen=seen)[:STANDING_OUT]]
    elif shape in SCANNED_AS:
        parameters = [*constants_s(record.settings.duration_s)]
        if shape == "ramp_hold":
            apart_s = [abs(a.onset_s - b.onset_s) for a, b in combinations(replaced, 2)]
            parameters += [seconds for seconds in apart_s if seconds > 0.0]
    for parameter in parameters:
        yield ShapeHypothesis(shape=shape, output=output, parameter=parameter)


def _statistic(record: ScanRecord, scan: Scan, form: ShapeHypothesis) -> float:
    """Return the largest statistic of a hypothesis over the onsets that the scan covers."""
    onsets = record.admitted_onsets(scan, form)
    return largest_statistic(scan, waveform(form, record.sampling), onsets) if onsets.size else 0.0


# Share of its statistic that a fault keeps where the other channels are inputs, too. With the elevator alone it kept 1
# to 29 % of that of the six false alarms in 137 windows of two recorded flights, and 49 % or more of that of 39 steps,
# drifts and oscillations in 19 of them: what is in the output alone stands out the more, the less else is unexplained.
LEAST_SHARE = 0.4
# Seconds by which the onset may differ: one sample of the usual rate of the scan, and its low-pass.
NEAR_S = 1.5


def unconfirmed(
    log: FlightLog, record: ScanRecord, estimates: Sequence[Estimate], config: Config, *, order: int
) -> dict[int, str]:
    """Return, by the index of each estimate that the log's other channels explain, why it is only suspected.

    Empty where all trusted channels are inputs already, or where the window has too few samples for them.

    Parameters
    ----------
    log : with all its channels.
    record : of the window with the inputs of the configuration; estimates : declared in it.
    order : of the model that is left without the faults.
    """
    with_all = with_inputs_of(log, merge(config, {"inputs": ("auto",)})) if estimates else config
    more = [name for name in with_all.inputs if name not in config.inputs]
    if not more:
        return {}
    alike = {"inputs": (*config.inputs, *more), "conditioning.rate_hz": record.window.same_rate}
    try:
        wider = prepare_record(log, merge(with_all, alike))
    except LogError:
        return {}
    if wider.y.shape != record.y.shape or order > max(wider.orders):
        return {}
    doubts = {}
    for i, fault in enumerate(estimates):
        others = [other for other in estimates if other is not fault]
        statistic = _statistic_of(wider, subtract_faults(wider.y, *others), fault, order)
        if statistic < LEAST_SHARE * fault.statistic:
            doubts[i] = (
                f"the {fault.form.shape} from {instant(fault.onset_s)} s is only suspected: its statistic falls from "
                f"{fault.statistic:.3g} to {statistic:.3g} with {', '.join(more)} as inputs"
            )
    return doubts


def _statistic_of(record: ScanRecord, y: FloatArray, fault: Estimate, order: int) -> float:
    """Return the statistic of a fault as it was estimated, or of one that begins near it where that is larger."""
    likelihood = record.likelihood(y, order)
    same = likelihood.statistic(likelihood.fit(unit_signals(y, [fault])))
    if fault.offset_s is not None:
        return same
    profile = lasting_peak(record, scan_of(record, y, order, output=fault.form.output), fault.form).profile
    near = np.abs(record.onsets_s(profile.onsets) - fault.onset_s) <= NEAR_S
    return max(same, float(profile.statistic[near].max(initial=0.0)))
