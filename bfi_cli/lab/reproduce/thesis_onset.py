"""The onset of a fault, by the thesis's method and by the scan: figures 5-13 to 5-15, and 5-16 with the wrong shape."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...config import STRONG_EVIDENCE
from ...faults import Fault, unit_signal
from ...faults.shapes import Shape
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.lagged import Compressed, compress
from ...kernels.model_selection import Penalty, least_criterion, refine_supports
from ...kernels.risro_varx import SparseStage, risro_varx, sparse_varx
from ...kernels.variable_projection import project_inputs
from ...model.onset import OnsetResult, find_onset
from ...model.preprocessing.regression import ROUND_OFF, solve
from ...quantities.text import number
from ...report.content import Drawing, Panel, ReportContent, Table, curve
from .page import drawing, fill, load, panel, report_content, table
from .reconstruction import COPIES, READINGS, dated, label_of, method_config, scanning, shipped
from .record import (
    NOISE_M_S,
    Settings,
    airspeed_panel,
    fault_panel,
    fault_starts,
    records_of,
    thesis_record,
    with_fault,
)
from .thesis_cases import LOW

BIAS = Fault(shape="bias", magnitude=5.0, onset_s=15.0)
DRIFT = Fault(shape="drift", magnitude=5.0, slope=0.05, onset_s=16.0)
FIRST_S, LAST_S, STEP_S, QUICK_STEP_S = 14.5, 17.0, 0.01, 0.1  # the axis of the published figures, every sample
METHODS = (*READINGS, "staged")  # solve the problem anew for every start
SHAPES: tuple[Shape, ...] = ("bias", "drift")
UNIT = {"bias": "m/s", "drift": "0.05 m/s^2"}
TIMES = {"bias": "m/s", "drift": "x 0.05 m/s^2"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Case:
    """A record with one fault: magnitudes over the assumed starts of signals of one shape, and the scan.

    `magnitudes`, (n_starts,) each, are those of the readings of algorithm 3 and of our stage, by name.
    """

    label: str
    log: FlightLog
    shape: Shape
    starts_s: FloatArray
    magnitudes: Mapping[str, FloatArray]
    scan: OnsetResult

    def peak(self, name: str = "sparse") -> str:
        """Return the largest magnitude of a method and its start."""
        best = int(np.argmax(np.abs(self.magnitudes[name])))
        if self.magnitudes[name][best] == 0.0:
            return "0 at every start"
        return f"{number(float(self.magnitudes[name][best]))} {TIMES[self.shape]} at {self.starts_s[best]:.5g} s"

    @property
    def declared(self) -> str:
        """The faults that the scan declares, in words."""
        return "; ".join(map(dated, self.scan.faults)) or "none"

    @property
    def shapes(self) -> set[str]:
        """The shapes of the faults that the scan declares."""
        return {estimate.fault.shape for estimate in self.scan.faults}


def thesis_5_13(settings: Settings) -> ReportContent:
    """Return figure 5-13: a bias of 5 m/s from 15 s, whose start is sought."""
    page, log = load("thesis")["5-13"], thesis_record(settings)
    faulty = with_fault(log, BIAS)
    spans, scans = fault_starts(faulty), {}
    with scanning(settings, SHAPES) as config:
        for label, record in records_of(faulty, settings).items():
            scans[label] = find_onset(record, config)
    declared = {label: "; ".join(map(dated, scan.faults)) or "none" for label, scan in scans.items()}
    elevator = panel(page, "elevator", [curve("", log.time_s, log.channel("elevator").values)])
    panels = (elevator, airspeed_panel(faulty, spans), fault_panel(faulty, spans=spans))
    return report_content(
        page,
        {
            "log": log,
            "onset_s": spans[0].low,
            "declared": "; ".join(f"{label}: {words}" for label, words in declared.items()),
        },
        heading=[bool(scan.faults) for scan in scans.values()],
        records=[{"record": label, "declared": words} for label, words in declared.items()],
        drawings=[drawing(page, "thesis_5_13", panels)],
        notes=_about_the_scan(settings)[:1],
        simulated=settings.log is None,
    )


def _right_shape(fault: Fault, figure: str, size: str, settings: Settings) -> ReportContent:
    """Return the page of a fault whose start is sought with signals of the right shape."""
    page = {**load("thesis")["5-14"], **load("thesis")[figure]}
    cases = _cases(settings, fault, fault.shape)
    first = cases[0]
    spans = fault_starts(first.log)
    profiles = [(case.label, p) for case in cases for p in case.scan.profiles if p.shape == fault.shape]
    panels = [
        fault_panel(first.log, spans=spans),
        *map(_magnitudes_panel, cases),
        *map(_statistic_panel, cases),
        Panel(
            x_label="assumed start [s]",
            y_label=f"magnitude, scan [{profiles[0][1].unit}]",
            curves=tuple(curve(label, p.onset_s, p.magnitude) for label, p in profiles),
            spans=spans,
        ),
    ]
    known = {"figure": figure, "shape": fault.shape, "onset_s": fault.onset_s}
    return report_content(
        page,
        {**known, "size": size, "true_s": spans[0].low, "first": first},
        heading=[len(case.scan.faults) == 1 and case.shapes == {fault.shape} for case in cases],
        records=[{**known, **_case_record(case)} for case in cases],
        tables=[_peaks(cases), _statistics(cases)],
        drawings=[drawing(page, f"thesis_{figure.replace('-', '_')}", panels)],
        notes=_about_the_scan(settings),
        simulated=settings.log is None,
    )


thesis_5_14 = partial(_right_shape, BIAS, "5-14", "bias of 5 m/s")
thesis_5_15 = partial(_right_shape, DRIFT, "5-15", "drift of 5 x 0.05 t")


def thesis_5_16(settings: Settings) -> ReportContent:
    """Return figure 5-16: a bias looked for with drifts, a drift looked for with biases."""
    page = load("thesis")["5-16"]
    cases = {
        "bias": _cases(settings, BIAS, "drift", step=0, of=2),
        "drift": _cases(settings, DRIFT, "bias", step=1, of=2),
    }
    every = [case for group in cases.values() for case in group]
    drawings: list[Drawing] = []
    for i, pair in enumerate(zip(*cases.values(), strict=True)):
        titles = [page["titles"][fault] for fault in cases]
        panels = [_magnitudes_panel(case, title=title) for case, title in zip(pair, titles, strict=True)]
        panels += [_statistic_panel(case) for case in pair]
        name = "thesis_5_16" if i == 0 else "thesis_5_16_noise"
        drawings.append(drawing(page, name, panels, across=2, caption="thesis_5_16", record=pair[0].label))
    right = [
        all(case.shapes <= {fault} for fault, case in zip(cases, pair, strict=True))
        for pair in zip(*cases.values(), strict=True)
    ]
    return report_content(
        page,
        {"first": every[0]},
        heading=right,
        records=[
            {"fault": fault, "published": page["published"][fault], **_case_record(case)}
            for fault, group in cases.items()
            for case in group
        ],
        tables=[_peaks(every), _statistics(every)],
        drawings=drawings,
        notes=_about_the_scan(settings),
        simulated=settings.log is None,
    )


def _cases(settings: Settings, fault: Fault, shape: Shape, *, step: int = 0, of: int = 1) -> tuple[_Case, ...]:
    """Return the record with a fault, simulated ones with and without noise.

    Algorithm 3 has signals of one shape and solves the whole problem anew for every start; the scan has both shapes.
    """
    clean = thesis_record(settings)
    records = records_of(with_fault(clean, fault), settings)
    apart = QUICK_STEP_S if settings.quick else STEP_S
    start_s = float(clean.time_s[0])
    starts_s = start_s + np.round(np.arange(FIRST_S, LAST_S + 0.5 * apart, apart), 2)
    cases = []
    with scanning(settings, SHAPES) as config:
        for n, (label, record) in enumerate(records.items(), start=1):
            u, y = (record.channel(name).values - record.channel(name).values.mean() for name in ("elevator", "tas"))
            u, unit = u / (np.std(u) or 1.0), float(np.std(y))
            magnitudes: dict[str, list[float]] = {name: [] for name in METHODS}
            for assumed_s in starts_s.tolist():
                atom = Fault(shape=shape, onset_s=assumed_s, slope=DRIFT.slope if shape == "drift" else None)
                theta = unit_signal(atom, record.time_s, window_start_s=start_s) / unit
                scale = float(np.sqrt(np.mean(theta**2)))  # the published stage sees magnitudes of standardised signals
                data = compress(u[:, None], y[:, None] / unit, theta[:, None, None] / scale, order=LOW)
                for name, values in magnitudes.items():
                    z = _by_stage(data) if name == "staged" else float(solve(data, method_config(name)).z[0])
                    values.append(z / scale)
            cases.append(
                _Case(
                    label=label,
                    log=record,
                    shape=shape,
                    starts_s=starts_s,
                    magnitudes={name: np.array(values) for name, values in magnitudes.items()},
                    scan=find_onset(record, config),
                )
            )
            settings.report(step * len(records) + n, of * len(records))
    return tuple(cases)


def _by_stage(data: Compressed) -> float:
    """Return the magnitude of the data's only atom by our sparsity stage and the criterion, 0 if it is dropped."""
    problem, n_rows = project_inputs(data, LOW, floor=ROUND_OFF), data.n_rows
    penalty = Penalty(n_rows=n_rows, n_effective=float(n_rows), n_candidates=1, evidence=STRONG_EVIDENCE)
    price, stage = penalty.per_parameter + penalty.per_atom, SparseStage(kind="exp-l0")
    visits = sparse_varx(problem, risro_varx(data), n_atoms=1, stage=stage, price=price)
    proposals = [(LOW, support, went.z[list(support)]) for went in visits for support in went.supports]
    (search,), _ = refine_supports([problem], [0], penalty, proposals=proposals, dropping_only=True)
    fit = least_criterion(search.values())
    return float(fit.z[0]) if fit.atoms else 0.0


def _case_record(case: _Case) -> dict[str, object]:
    peaks = {name: case.peak(name) for name in METHODS}
    return {"record": case.label, "shape": case.shape, "declared": case.declared, "peaks": peaks}


def _about_the_scan(settings: Settings) -> tuple[str, ...]:
    """Return the notes on thresholds, record and starts."""
    page = load("thesis")["5-14"]
    counted = fill(page["counted"], copies=COPIES, noise=NOISE_M_S)
    whole = (page["whole"],) if settings.log is None else ()
    quick = (page["quick"],) if settings.quick else ()
    return (*(shipped(settings, SHAPES) or (counted,)), *whole, *quick)


def _peaks(cases: Sequence[_Case]) -> Table:
    rows = []
    for case in cases:
        fault = case.scan.truth[0].shape if case.scan.truth else "-"
        rows += [(fault, case.label, case.shape, label_of(name), case.peak(name)) for name in METHODS]
    return table(load("thesis")["5-14"], "peaks", rows)


def _statistics(cases: Sequence[_Case]) -> Table:
    rows = []
    for case in cases:
        fault = case.scan.truth[0].shape if case.scan.truth else "-"
        for profile in case.scan.profiles:
            best = int(profile.statistic.argmax())
            values = (profile.statistic[best], profile.threshold, profile.magnitude[best])
            shown = tuple(number(None if value is None else float(value)) for value in values)
            rows.append((fault, case.label, profile.shape, f"{profile.onset_s[best]:.5g} s", *shown))
    return table(load("thesis")["5-14"], "statistics", rows)


def _magnitudes_panel(case: _Case, *, title: str = "") -> Panel:
    return Panel(
        title=", ".join(part for part in (title, case.label) if part),
        x_label="assumed start [s]",
        y_label=f"magnitude [{UNIT[case.shape]}]",
        curves=tuple(curve(label_of(name), case.starts_s, case.magnitudes[name]) for name in METHODS),
        spans=fault_starts(case.log),
    )


def _statistic_panel(case: _Case) -> Panel:
    profiles = case.scan.profiles
    return Panel(
        title=f"ours, scan, {case.label}",
        x_label="assumed start [s]",
        y_label="statistic [-]",
        curves=tuple(curve(profile.shape, profile.onset_s, profile.statistic) for profile in profiles),
        levels=tuple(
            (f"threshold, {profile.shape}", profile.threshold) for profile in profiles if profile.threshold is not None
        ),
        spans=fault_starts(case.log),
    )
