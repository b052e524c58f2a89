"""When a fault started, the thesis's way beside the scan: figures 5-13 to 5-15, and 5-16 with the wrong shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import Config, merge
from ..faults import Fault, unit_signal
from ..flightlog import FlightLog
from ..identify.risro import solve
from ..kernels.lagged import compress
from ..onset import OnsetResult, find_onset
from ..report.content import Panel, ReportContent, Table, curve
from ..report.text import interval, number
from ..shapes import Shape
from .page import drawing, exhibit, fill, load, table
from .reconstruction import COPIES, SETTLED, dated, scanning, shipped
from .record import (
    NOISE_M_S,
    Settings,
    airspeed_panel,
    fault_starts,
    stand_in,
    thesis_record,
    true_fault,
    with_fault,
    with_noise,
)
from .thesis_perturbed import LOW

__all__ = ["thesis_5_13", "thesis_5_14", "thesis_5_15", "thesis_5_16"]

FloatArray = NDArray[np.float64]

BIAS = Fault(shape="bias", magnitude=5.0, onset_s=15.0)
DRIFT = Fault(shape="drift", magnitude=5.0, slope=0.05, onset_s=16.0)
FIRST_S, LAST_S, STEP_S, QUICK_STEP_S = 14.5, 17.0, 0.01, 0.1  # the axis of the published figures, every sample
SHAPES: tuple[Shape, ...] = ("bias", "drift")
UNIT = {"bias": "m/s", "drift": "0.05 m/s^2"}
TIMES = {"bias": "m/s", "drift": "x 0.05 m/s^2"}
SCAN = {"conditioning.rate_hz": 10.0, "model.order": 4, "start_time.shapes": list(SHAPES)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Case:
    """A record with one fault: the published magnitudes over the starts of signals of one shape, and the scan."""

    label: str
    log: FlightLog
    shape: Shape
    starts_s: FloatArray
    magnitude: FloatArray
    scan: OnsetResult

    @property
    def peak(self) -> str:
        """The largest published magnitude and its start."""
        best = int(np.argmax(np.abs(self.magnitude)))
        return f"{number(float(self.magnitude[best]))} {TIMES[self.shape]} at {self.starts_s[best]:.5g} s"

    @property
    def declared(self) -> str:
        """What the scan says."""
        return "; ".join(map(dated, self.scan.faults)) or "none"

    def has_other_than(self, shape: str) -> bool:
        """Say whether the scan declares a fault of another shape."""
        return any(one.estimate.fault.shape != shape for one in self.scan.faults)


def thesis_5_13(settings: Settings) -> ReportContent:
    """Return figure 5-13: a bias of 5 m/s from 15 s, whose start is to be found.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    page, log = load("thesis")["5-13"], thesis_record(settings)
    faulty = with_fault(log, BIAS)
    spans = fault_starts(faulty)
    scan = find_onset(with_noise(faulty, NOISE_M_S, seed=settings.seed), merge(Config(), SCAN))
    found = [
        fill(page["found"], shape=fault.shape, onset_s=fault.onset_s, interval=interval(one.onset_ci95))
        for one in scan.faults
        for fault in (one.estimate.fault,)
    ]
    elevator, fault = curve("", log.time_s, log.channel("elevator").values), curve("", log.time_s, true_fault(faulty))
    panels = (
        Panel(x_label="time [s]", y_label="elevator [rad]", curves=(elevator,)),
        airspeed_panel(faulty, spans),
        Panel(x_label="time [s]", y_label="fault [m/s]", curves=(fault,), spans=spans),
    )
    return exhibit(
        page,
        {
            "log": log,
            "noise": NOISE_M_S,
            "onset_s": spans[0].low,
            "found": "; ".join(found) or "nothing",
            "sizes": ", ".join(f"{number(one.estimate.magnitude)} {one.estimate.unit}" for one in scan.faults) or "-",
        },
        heading=bool(scan.faults),
        drawings=[drawing(page, "thesis_5_13", panels)],
        notes=stand_in(settings),
    )


def thesis_5_14(settings: Settings) -> ReportContent:
    """Return figure 5-14: the start of a bias of 5 m/s at 15 s.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    return _right_shape(settings, BIAS, "5-14", size="bias of 5 m/s")


def thesis_5_15(settings: Settings) -> ReportContent:
    """Return figure 5-15: the start of a drift of 0.25 m/s^2 at 16 s.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    return _right_shape(settings, DRIFT, "5-15", size="drift of 5 x 0.05 t")


def _right_shape(settings: Settings, fault: Fault, figure: str, *, size: str) -> ReportContent:
    """Return the page of a fault that is looked for with signals of its own shape."""
    page = {**load("thesis")["5-14"], **load("thesis")[figure]}
    cases = _cases(settings, fault, fault.shape)
    first, last = cases[0], cases[-1]
    spans, x_label = fault_starts(first.log), "assumed start [s]"
    profiles = [(one.label, p) for one in cases for p in one.scan.profiles if p.shape == fault.shape]
    true = curve("", first.log.time_s, true_fault(first.log))
    sizes = tuple(curve(label, p.onset_s, p.magnitude) for label, p in profiles)
    panels = (
        Panel(x_label="time [s]", y_label="fault [m/s]", curves=(true,), spans=spans),
        _published_panel(cases),
        _statistic_panel(last),
        Panel(x_label=x_label, y_label=f"ours [{profiles[0][1].unit}]", curves=sizes, spans=spans),
    )
    known = {"figure": figure, "shape": fault.shape, "onset_s": fault.onset_s}
    return exhibit(
        page,
        {**known, "peak": first.peak, "size": size, "true_s": spans[0].low, "first": first, "last": last},
        heading=all(len(one.scan.faults) == 1 and not one.has_other_than(fault.shape) for one in cases),
        rows=[
            fill(page[row], label=one.label, peak=one.peak, declared=one.declared, **known)
            for row in ("peak_row", "scan_row")
            for one in cases
        ],
        tables=[_statistics(cases)],
        drawings=[drawing(page, f"thesis_{figure.replace('-', '_')}", panels)],
        notes=_about_the_scan(settings),
    )


def thesis_5_16(settings: Settings) -> ReportContent:
    """Return figure 5-16: a bias looked for with drifts, a drift looked for with biases.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the faults.
    """
    page = load("thesis")["5-16"]
    cases = {
        "bias": _cases(settings, BIAS, "drift", step=0, of=2),
        "drift": _cases(settings, DRIFT, "bias", step=1, of=2),
    }
    published = [_published_panel(found, title=page["panels"][fault]) for fault, found in cases.items()]
    return exhibit(
        page,
        {
            "drift_peak": cases["bias"][0].peak,
            "bias_peak": cases["drift"][0].peak,
            **{fault: found[-1] for fault, found in cases.items()},
        },
        heading=any(one.has_other_than(fault) for fault, found in cases.items() for one in found),
        rows=[
            fill(
                page[row],
                fault=fault,
                shape=one.shape,
                label=one.label,
                published=page["published"][fault],
                peak=one.peak,
                declared=one.declared,
            )
            for row in ("peak_row", "scan_row")
            for fault, found in cases.items()
            for one in found
        ],
        tables=[_statistics([one for found in cases.values() for one in found])],
        drawings=[
            drawing(
                page,
                "thesis_5_16",
                (*published, *(_statistic_panel(found[-1]) for found in cases.values())),
                across=2,
            )
        ],
        notes=_about_the_scan(settings),
    )


def _cases(settings: Settings, fault: Fault, shape: Shape, *, step: int = 0, of: int = 1) -> tuple[_Case, ...]:
    """Return the record with a fault, simulated ones with and without noise.

    The published method has signals of one shape and solves the whole problem anew for every start; the scan has both.
    """
    clean = thesis_record(settings)
    log, simulated = with_fault(clean, fault), settings.log is None
    records = {"no noise" if simulated else "as recorded": log}
    if simulated and not settings.quick:
        records[f"noise {NOISE_M_S:g} m/s"] = with_noise(log, NOISE_M_S, seed=settings.seed)
    apart = QUICK_STEP_S if settings.quick else STEP_S
    start_s = float(clean.time_s[0])
    starts_s = start_s + np.round(np.arange(FIRST_S, LAST_S + 0.5 * apart, apart), 2)
    cases = []
    with scanning(settings, SHAPES) as config:
        for n, (label, record) in enumerate(records.items(), start=1):
            u, y = (record.channel(name).values - record.channel(name).values.mean() for name in ("elevator", "tas"))
            u, unit = u / (np.std(u) or 1.0), float(np.std(y))
            magnitude = []
            for assumed_s in starts_s.tolist():
                atom = Fault(shape=shape, onset_s=assumed_s, slope=DRIFT.slope if shape == "drift" else None)
                theta = unit_signal(atom, record.time_s, window_start_s=start_s)
                data = compress(u[:, None], y[:, None] / unit, theta[:, None, None], order=LOW)
                magnitude.append(unit * float(solve(data, SETTLED).z[0]))
            cases.append(
                _Case(
                    label=label,
                    log=record,
                    shape=shape,
                    starts_s=starts_s,
                    magnitude=np.array(magnitude),
                    scan=find_onset(record, config),
                )
            )
            settings.report(step * len(records) + n, of * len(records))
    return tuple(cases)


def _about_the_scan(settings: Settings) -> tuple[str, ...]:
    """Return the notes on thresholds, record and starts."""
    page = load("thesis")["5-14"]
    counted = fill(page["counted"], copies=COPIES, noise=NOISE_M_S)
    whole = (page["whole"],) if settings.log is None else ()
    quick = (page["quick"],) if settings.quick else ()
    return (*(shipped(settings) or (counted,)), *whole, *quick, *stand_in(settings))


def _statistics(cases: Sequence[_Case]) -> Table:
    rows = []
    for case in cases:
        fault = case.scan.truth[0].shape if case.scan.truth else "-"
        for one in case.scan.profiles:
            best = int(one.statistic.argmax())
            values = (one.statistic[best], one.threshold, one.magnitude[best])
            shown = tuple(number(None if value is None else float(value)) for value in values)
            rows.append((fault, case.label, one.shape, f"{one.onset_s[best]:.5g} s", *shown))
    return table(load("thesis")["5-14"], "statistics", rows)


def _published_panel(cases: Sequence[_Case], *, title: str = "") -> Panel:
    return Panel(
        title=title,
        x_label="assumed start [s]",
        y_label=f"published [{UNIT[cases[0].shape]}]",
        curves=tuple(curve(one.label, one.starts_s, one.magnitude) for one in cases),
        spans=fault_starts(cases[0].log),
    )


def _statistic_panel(case: _Case) -> Panel:
    profiles = case.scan.profiles
    return Panel(
        x_label="assumed start [s]",
        y_label="statistic [-]",
        curves=tuple(curve(one.shape, one.onset_s, one.statistic) for one in profiles),
        levels=tuple((f"threshold, {one.shape}", one.threshold) for one in profiles if one.threshold is not None),
        spans=fault_starts(case.log),
    )
