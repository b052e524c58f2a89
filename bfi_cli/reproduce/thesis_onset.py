"""When did it start, the thesis's way beside the scan: figures 5-14 (bias), 5-15 (drift), 5-16 (the wrong shape)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..exhibit import Curve, Drawing, Exhibit, Panel, Span, Table, curve
from ..faults import Fault, Shape, unit_signal
from ..flightlog import FlightLog, inject
from ..identify.risro import solve
from ..kernels.lagged import compress
from ..onset import OnsetResult, find_onset
from ..wording import number
from .answer import with_noise
from .record import stand_in, thesis_record
from .settings import Settings, comparison
from .thesis_reconstruction import dated
from .thesis_solutions import SETTLED
from .thesis_threshold import COPIES, NOISE_M_S, SHIPPED, scanning

__all__ = ["thesis_5_14", "thesis_5_15", "thesis_5_16"]

FloatArray = NDArray[np.float64]

ORDER = 4
BIAS = Fault(shape="bias", magnitude=5.0, onset_s=15.0)
DRIFT = Fault(shape="drift", magnitude=5.0, slope=0.05, onset_s=16.0)
FIRST_S, LAST_S, STEP_S, QUICK_STEP_S = 14.5, 17.0, 0.01, 0.1
SHAPES = ("bias", "drift")
UNIT = {"bias": "m/s", "drift": "0.05 m/s^2"}
TIMES = {"bias": "m/s", "drift": "x 0.05 m/s^2"}
CLEAN, NOISY = "no noise", f"noise {NOISE_M_S:g} m/s"

CAPTION = (
    "From above: the fault; the magnitude that the published method finds for every assumed start, solved anew each "
    "time, order 4 at the log's own rate; the likelihood-ratio statistic of our scan over all starts at 10 Hz with its "
    "threshold, both shapes; the magnitude at each start."
)
WRONG_CAPTION = (
    "Above the magnitude that the published method finds with the wrong dictionary, a drift for the bias of 5-14 "
    "and a bias for the drift of 5-15; below the statistic of our scan, which compares both shapes."
)
BATCH = (
    "The listing cuts 4 s around the fault out of its flight; in the simulated record the elevator rests by then, so "
    "the whole record is used. The starts are those of the figure's axis, 14.5 to 17 s."
)
PEAK = (
    "The published peak is one of the magnitude, which has no scale of its own: nothing says how large a peak noise "
    "would make, and a wrong start or shape may have the larger one. The statistic compares how well the record is "
    "explained, and its threshold is that of a stated rate of false alarms."
)
NOISE_100_HZ = (
    "Four lags at 100 Hz are 0.04 s of memory: on the simulated record 0.01 m/s of white noise hides a drift of "
    "0.25 m/s^2 from them, and the published magnitude has no peak at 16 s. Filtered and decimated to 10 Hz, with an "
    "order chosen together with the shape, the same record shows start and slope."
)
WRONG = (
    "The thesis proposes to try biases first and drifts after them. Here both shapes are compared: the one that "
    "explains the record best is declared, and taken off before anything else is."
)
QUICK = "Quick: starts 0.1 s apart, and the record without noise alone."
COUNTED = f"The thresholds are those of {COPIES} fault-free copies of the record with {NOISE_M_S:g} m/s of noise."


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Case:
    """A record with one fault: the published magnitudes by shape over the starts, and the scan."""

    label: str
    log: FlightLog
    starts_s: FloatArray
    magnitude: dict[str, FloatArray]
    scan: OnsetResult

    def peak(self, shape: str) -> tuple[float, float]:
        """Return start and magnitude of the published peak."""
        best = int(np.argmax(np.abs(self.magnitude[shape])))
        return float(self.starts_s[best]), float(self.magnitude[shape][best])

    @property
    def declared(self) -> str:
        """What the scan says."""
        return "; ".join(map(dated, self.scan.faults)) or "none"


def thesis_5_14(settings: Settings) -> Exhibit:
    """Return figure 5-14: the start of a bias of 5 m/s at 15 s.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    return _right_shape(settings, BIAS, figure="5-14", notes=(PEAK,))


def thesis_5_15(settings: Settings) -> Exhibit:
    """Return figure 5-15: the start of a drift of 0.25 m/s^2 at 16 s.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    return _right_shape(settings, DRIFT, figure="5-15", notes=(NOISE_100_HZ, PEAK))


def thesis_5_16(settings: Settings) -> Exhibit:
    """Return figure 5-16: a bias looked for with drifts, a drift looked for with biases.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the faults.
    """
    biases = _cases(settings, BIAS, ("drift",), step=0, of=2)
    drifts = _cases(settings, DRIFT, ("bias",), step=1, of=2)
    rows = [
        *(_wrong_row(one, "bias", "drift", "false alarms, erroneously high (figure 5-16a)") for one in biases),
        *(_wrong_row(one, "drift", "bias", "about 0 (figure 5-16b)") for one in drifts),
        *((f"bias, declared by ours, {one.label}", "-", one.declared) for one in biases),
        *((f"drift, declared by ours, {one.label}", "-", one.declared) for one in drifts),
    ]
    wrong = any(_others(one, "bias") for one in biases) or any(_others(one, "drift") for one in drifts)
    return Exhibit(
        kicker="Reproduction",
        title="Thesis, figure 5-16: the start sought with the wrong shape",
        heading="A wrong shape is declared" if wrong else "The wrong shape is not declared",
        verdict=f"Drifts for a bias: the published magnitude reaches {_peak(biases[0], 'drift')}; biases for a "
        f"drift: {_peak(drifts[0], 'bias')}; ours declares {biases[-1].declared}, and {drifts[-1].declared}.",
        facts=(("Record", biases[0].log.path),),
        tables=(comparison(rows), _statistics((*biases, *drifts))),
        drawings=(_wrong_drawing(biases, drifts),),
        notes=(WRONG, PEAK, *_setting(settings)),
    )


def _setting(settings: Settings) -> tuple[str, ...]:
    simulated = settings.log is None
    counted = COUNTED if simulated and not settings.quick else SHIPPED
    told = (counted, *((BATCH,) if simulated else ()), *((QUICK,) if settings.quick else ()))
    return *told, *stand_in(settings)


def _others(case: _Case, shape: str) -> bool:
    return any(one.estimate.fault.shape != shape for one in case.scan.faults)


def _wrong_row(case: _Case, fault: str, shape: str, published: str) -> tuple[str, str, str]:
    return f"{fault} looked for with {shape} signals, largest magnitude, {case.label}", published, _peak(case, shape)


def _peak(case: _Case, shape: str) -> str:
    start_s, z = case.peak(shape)
    return f"{number(z)} {TIMES[shape]} at {start_s:.5g} s"


def _right_shape(settings: Settings, fault: Fault, *, figure: str, notes: Sequence[str]) -> Exhibit:
    shape = fault.shape
    cases = _cases(settings, fault, (shape,), step=0, of=1)
    true_s = cases[0].scan.truth[0].onset_s if cases[0].scan.truth else fault.onset_s
    published = f"{fault.onset_s:g} s (figure {figure})"
    rows = [
        ("fault", f"{shape} from {fault.onset_s:g} s (figure {figure})", f"{_size(fault)} from {true_s:g} s"),
        *((f"peak of the magnitude, {one.label}", published, _peak(one, shape)) for one in cases),
        *((f"scan over all starts, ours, {one.label}", "-", one.declared) for one in cases),
    ]
    found = all(len(one.scan.faults) == 1 and not _others(one, shape) for one in cases)
    return Exhibit(
        kicker="Reproduction",
        title=f"Thesis, figure {figure}: the start of a {shape}",
        heading="Start found" if found else "Start not found",
        verdict=f"The published magnitude peaks at {_peak(cases[0], shape)} ({cases[0].label}); ours declares "
        f"{cases[-1].declared} ({cases[-1].label}).",
        facts=(("Record", cases[0].log.path), ("Scan", f"order {cases[-1].scan.model.order} at 10 Hz")),
        tables=(comparison(rows), _statistics(cases)),
        drawings=(_drawing(figure, cases, shape),),
        notes=(*notes, *_setting(settings)),
    )


def _size(fault: Fault) -> str:
    times = "m/s" if fault.slope is None else f"x {fault.slope:g} t"
    return f"{fault.shape} of {fault.magnitude:g} {times}"


def _cases(settings: Settings, fault: Fault, shapes: Sequence[Shape], *, step: int, of: int) -> tuple[_Case, ...]:
    """Return the record with a fault, simulated ones with and without noise."""
    clean = thesis_record(settings)
    start_s = float(clean.time_s[0])
    log = inject(clean, [replace(fault, onset_s=fault.onset_s + start_s)])
    simulated = settings.log is None
    records = {CLEAN if simulated else "as recorded": log}
    if simulated and not settings.quick:
        records[NOISY] = with_noise(log, NOISE_M_S, seed=settings.seed)
    apart = QUICK_STEP_S if settings.quick else STEP_S
    starts_s = start_s + np.round(np.arange(FIRST_S, LAST_S + 0.5 * apart, apart), 2)
    cases = []
    with scanning(settings, SHAPES) as config:
        for n, (label, record) in enumerate(records.items(), start=1):
            magnitude: dict[str, FloatArray] = {shape: _magnitudes(record, shape, starts_s) for shape in shapes}
            scan = find_onset(record, config)
            cases.append(_Case(label=label, log=record, starts_s=starts_s, magnitude=magnitude, scan=scan))
            settings.report(step * len(records) + n, of * len(records))
    return tuple(cases)


def _magnitudes(log: FlightLog, shape: Shape, starts_s: FloatArray) -> FloatArray:
    """Return (n_starts,) the magnitude of the published method, the whole problem solved anew for every start."""
    u, y = (log.channel(name).values - log.channel(name).values.mean() for name in ("elevator", "tas"))
    u, unit = u / (np.std(u) or 1.0), float(np.std(y))
    found = []
    for start_s in starts_s.tolist():
        fault = Fault(shape=shape, onset_s=start_s, slope=DRIFT.slope if shape == "drift" else None)
        theta = unit_signal(fault, log.time_s, window_start_s=float(log.time_s[0]))
        data = compress(u[:, None], y[:, None] / unit, theta[:, None, None], order=ORDER)
        found.append(unit * float(solve(data, SETTLED).z[0]))
    return np.array(found)


def _statistics(cases: Sequence[_Case]) -> Table:
    rows = []
    for case in cases:
        fault = case.scan.truth[0].shape if case.scan.truth else "-"
        for one in case.scan.profiles:
            best = int(one.statistic.argmax())
            values = (one.statistic[best], one.threshold, one.magnitude[best])
            shown = tuple(number(None if value is None else float(value)) for value in values)
            rows.append((fault, case.label, one.shape, f"{one.onset_s[best]:.5g} s", *shown))
    heads = ("fault", "record", "shape looked for", "best start", "statistic", "threshold", "magnitude")
    return Table(name="statistics", title="Our scan, before any fault is taken off", heads=heads, rows=tuple(rows))


def _drawing(figure: str, cases: Sequence[_Case], shape: str) -> Drawing:
    log, spans = cases[0].log, _start(cases[0])
    assert log.truth is not None
    true = log.channel("tas").values - log.truth.clean["tas"]
    published = tuple(_published(one, shape) for one in cases)
    sizes = tuple(
        curve(one.label, p.onset_s, p.magnitude) for one in cases for p in one.scan.profiles if p.shape == shape
    )
    unit = next(p.unit for p in cases[0].scan.profiles if p.shape == shape)
    x_label = "assumed start [s]"
    panels = (
        Panel(x_label="time [s]", y_label="fault [m/s]", curves=(curve("", log.time_s, true),), spans=spans),
        Panel(x_label=x_label, y_label=f"published [{UNIT[shape]}]", curves=published, spans=spans),
        _statistic_panel(cases[-1]),
        Panel(x_label=x_label, y_label=f"ours [{unit}]", curves=sizes, spans=spans),
    )
    return Drawing(name=f"thesis_{figure.replace('-', '_')}", caption=CAPTION, panels=panels)


def _wrong_drawing(biases: Sequence[_Case], drifts: Sequence[_Case]) -> Drawing:
    panels = tuple(
        Panel(
            title=title,
            x_label="assumed start [s]",
            y_label=f"published [{UNIT[shape]}]",
            curves=tuple(_published(one, shape) for one in cases),
            spans=_start(cases[0]),
        )
        for title, shape, cases in (("a bias with drifts", "drift", biases), ("a drift with biases", "bias", drifts))
    )
    ours = (_statistic_panel(biases[-1]), _statistic_panel(drifts[-1]))
    return Drawing(name="thesis_5_16", caption=WRONG_CAPTION, panels=(*panels, *ours), across=2)


def _published(case: _Case, shape: str) -> Curve:
    return curve(case.label, case.starts_s, case.magnitude[shape])


def _statistic_panel(case: _Case) -> Panel:
    return Panel(
        x_label="assumed start [s]",
        y_label="statistic [-]",
        curves=tuple(curve(one.shape, one.onset_s, one.statistic) for one in case.scan.profiles),
        levels=tuple((f"threshold, {p.shape}", p.threshold) for p in case.scan.profiles if p.threshold is not None),
        spans=_start(case),
    )


def _start(case: _Case) -> tuple[Span, ...]:
    return tuple(Span(label="start", low=one.onset_s, high=one.onset_s) for one in case.scan.truth or ())
