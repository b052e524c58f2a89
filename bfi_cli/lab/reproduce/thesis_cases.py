"""Chapter 5 of the thesis: its record (figure 5-1), its signals (table 2-1, figure 5-2), and cases 1 to 3.

Cases are faults reconstructed by every method (section 5-3): case 1 is a fault of the dictionary (5-5, 5-6), case 2 a
bias with a perturbation that the dictionary lacks (5-7 to 5-10), case 3 a fault that starts later than the dictionary's
(5-11, 5-12).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...config import Config
from ...dictionary import signals
from ...faults import Fault
from ...faults.shapes import SHAPES
from ...flightlog import FlightLog
from ...model import identify_faults
from ...quantities.text import number, quantity
from ...report.content import Curve, Drawing, Panel, ReportContent, Style, Table, curve
from ..dmae import DmaeSettings
from .page import Page, drawing, joined, load, panel, percent, report_content, table
from .reconstruction import (
    PROGRAM,
    READINGS,
    Reconstruction,
    above,
    by_dmae,
    by_program,
    by_readings,
    by_scan,
    declared,
    label_of,
    shipped,
)
from .record import (
    NOISE_M_S,
    Settings,
    airspeed_panel,
    fault_panel,
    fault_starts,
    records_of,
    thesis_dictionary,
    thesis_record,
    true_fault,
    with_fault,
    with_noise,
)

Views = Mapping[str, Reconstruction]

# Sizes of the perturbation, of figure 5-8.
KAPPAS = tuple(np.round(np.arange(0.0, 0.501, 0.05), 2).tolist())
QUICK_KAPPAS = (0.0, 0.5)  # those at its ends
KAPPA = 0.2  # of figures 5-7, 5-9 and 5-10
ORDERS = tuple(range(3, 81))  # of the thesis's figure 5-9
QUICK_ORDERS = (5, 25, 45, 60)  # some of these
LOW, BEST = 4, 45  # the orders of the thesis: of most of its figures, and the best of figure 5-9
SHOWN = (3, 4, 5, 10, 25, 40, 44, 45, 50, 60, 80)  # in the table of figure 5-9, and those solved with noise too
LISTING_SHARE = 0.01  # of the norm of all magnitudes, above which the listing of the sweep over orders counts a fault
DRAWN = tuple(name for name in READINGS if name != "sparse_2")  # the readings of algorithm 3 in the figures of cases


def thesis_5_1(settings: Settings) -> ReportContent:
    """Return figure 5-1: the control input and the airspeed."""
    page, log, given = load("thesis")["5-1"], thesis_record(settings), settings.log is not None
    answer = identify_faults(log, thesis_dictionary(), Config())
    values = {name: log.channel(name).values for name in ("elevator", "tas")}
    return report_content(
        page,
        {
            "log": log,
            "interval_s": 1.0 / log.rate_hz,
            "altitude": page["altitude"][given],
            "declared": declared(answer),
            **{name: f"{number(float(y.min()))} and {number(float(y.max()))}" for name, y in values.items()},
        },
        heading=given,
        drawings=[
            drawing(page, "thesis_5_1", [panel(page, name, [curve("", log.time_s, y)]) for name, y in values.items()])
        ],
        notes=[note.text for note in log.notes],
        simulated=not given,
    )


def thesis_5_2(settings: Settings) -> ReportContent:
    """Return figure 5-2: the signals of the dictionary, with the minimal detectable magnitude of each."""
    page, log, dictionary = load("thesis")["5-2"], thesis_record(settings), thesis_dictionary()
    answer = identify_faults(with_noise(log, NOISE_M_S, seed=settings.seed), dictionary, Config())
    smallest = {
        candidate.name: quantity(candidate.minimal_detectable, candidate.unit) for candidate in answer.candidates
    }
    start_s = float(log.time_s[0])
    theta = signals(dictionary.resolved(start_s), log.time_s, ["tas"], window_start_s=start_s)[:, 0]
    atoms = [
        {"i": i, "name": str(atom.name), "onset_s": atom.onset_s, "expression": expression, "published_s": published_s}
        for i, (atom, (expression, published_s)) in enumerate(zip(dictionary.atoms, page["signals"], strict=True), 1)
    ]
    shown = [(f"theta {atom['i']}", atom["name"], atom["expression"], smallest[atom["name"]]) for atom in atoms]
    panels = [
        panel(page, "signal", [curve("", log.time_s, signal)], title=f"theta {i}")
        for i, signal in enumerate(theta.T, start=1)
    ]
    return report_content(
        page,
        {"log": log, "noise": NOISE_M_S, "smallest": smallest, "model": answer.model},
        records=atoms,
        tables=[table(page, "signals", shown, noise=NOISE_M_S)],
        drawings=[drawing(page, "thesis_5_2", panels, across=2)],
        simulated=settings.log is None,
    )


def thesis_table_2_1(settings: Settings) -> ReportContent:
    """Return table 2-1: blockages of a pitot probe and the signals that model them, added to the record's airspeed."""
    page, log = load("thesis")["2-1"], thesis_record(settings)
    faults, panels = [], []
    for blockage, printed, spec in page["faults"]:
        fault = Fault(**spec)
        faulty = with_fault(log, fault)
        signal = f"{fault.shape}: {SHAPES[fault.shape].formula.rstrip('.')}"
        faults.append({"blockage": blockage, "printed": printed, "signal": signal})
        panels += [fault_panel(faulty, title=blockage), airspeed_panel(faulty, fault_starts(faulty))]
    return report_content(
        page,
        {"log": log},
        records=faults,
        drawings=[drawing(page, "thesis_table_2_1", panels, across=2)],
        simulated=settings.log is None,
    )


def thesis_5_7(settings: Settings) -> ReportContent:
    """Return figure 5-7: a bias of 4 m/s with a perturbation that the dictionary lacks (kappa = 0.2)."""
    page, log = load("thesis")["5-7"], thesis_record(settings)
    faulty = perturbed(log, KAPPA)
    seen = {label: _solved(record, LOW) for label, record in records_of(faulty, settings).items()}
    spans = fault_starts(faulty)
    return report_content(
        page,
        {"log": log, "declared": "; ".join(f"{label}: {views['risro'].declared}" for label, views in seen.items())},
        records=[{"record": label, **views} for label, views in seen.items()],
        tables=_method_tables(seen),
        drawings=[drawing(page, "thesis_5_7", [airspeed_panel(faulty, spans), fault_panel(faulty, spans=spans)])],
        simulated=settings.log is None,
    )


def thesis_5_8(settings: Settings) -> ReportContent:
    """Return figure 5-8: the perturbation's size kappa from 0 to 0.5 at order 4."""
    page, clean = load("thesis")["5-8"], thesis_record(settings)
    kappas = QUICK_KAPPAS if settings.quick else KAPPAS
    swept: dict[str, list[Views]] = {}
    for done, kappa in enumerate(kappas, start=1):
        for label, log in records_of(perturbed(clean, kappa), settings).items():
            swept.setdefault(label, []).append(_solved(log, LOW))
        settings.report(done, len(kappas))
    names = (*READINGS, *PROGRAM)
    rows = [
        (label, f"{kappa:g}", *(percent(views[name].vaf_fault) for name in names))
        for label, each in swept.items()
        for kappa, views in zip(kappas, each, strict=True)
    ]
    style = joined(kappas, "line")
    panels = [
        panel(
            page,
            what,
            [
                curve(label_of(name), kappas, [getattr(views[name], what) for views in each], style=style)
                for name in (*DRAWN, *PROGRAM)
            ],
            title=label,
        )
        for what in page["panels"]
        for label, each in swept.items()
    ]
    return report_content(
        page,
        {"log": clean, "kappas": f"{len(kappas)}: {', '.join(f'{kappa:g}' for kappa in kappas)}"},
        heading=[each[-1]["sparse"].vaf_fault < 50.0 for each in swept.values()],
        records=[
            {
                **each[-1],
                "record": label,
                "kappa": kappas[-1],
                "least": min(views["sparse"].vaf_output for views in each),
                "kept": min(views["default"].vaf_fault for views in each),
            }
            for label, each in swept.items()
        ],
        tables=[table(page, "kappa", rows, **{name: label_of(name) for name in names})],
        drawings=[drawing(page, "thesis_5_8", panels, across=len(swept))],
        simulated=settings.log is None,
    )


def thesis_5_9(settings: Settings) -> ReportContent:
    """Return figure 5-9: orders 3 to 80 at kappa = 0.2, each solved on its own rows."""
    page, clean = load("thesis")["5-9"], thesis_record(settings)
    records = records_of(perturbed(clean, KAPPA), settings)
    whole = QUICK_ORDERS if settings.quick else ORDERS
    orders = {label: whole if i == 0 or settings.quick else SHOWN for i, label in enumerate(records)}
    total, done = sum(map(len, orders.values())), 0
    solved: dict[str, dict[int, Views]] = {label: {} for label in records}
    for label, log in records.items():
        for order in orders[label]:
            solved[label][order] = by_readings(log, order)
            settings.report(done := done + 1, total)
    program = {label: {name: by_program(log, name) for name in PROGRAM} for label, log in records.items()}
    first, *_ = solved.values()
    vafs = {name: {order: views[name].vaf_fault for order, views in first.items()} for name in READINGS}
    best = {name: max(each, key=each.__getitem__) for name, each in vafs.items()}
    single = {
        name: ", ".join(str(order) for order, views in first.items() if len(counted(views[name])) == 1) or "none"
        for name in READINGS
    }
    rows = [
        (
            *(label, str(order), view.label, percent(view.vaf_fault), number(magnitude_error(log, view))),
            *(str(len(counted(view))), ", ".join(counted(view))),
        )
        for label, log in records.items()
        for order, views in solved[label].items()
        if order in SHOWN
        for view in views.values()
    ]
    return report_content(
        page,
        {
            "log": clean,
            "solved": "; ".join(f"{label}: {_listed(each)}" for label, each in orders.items()),
            "best": {name: f"{order} ({vafs[name][order]:.1f} %)" for name, order in best.items()},
            "drift": {name: number(view.magnitudes["drift_7.93"], digits=3) for name, view in first[BEST].items()},
            "single": single,
            "last": max(first),
            "end": first[max(first)],
            "fifth": first[5],
        },
        heading=[best["sparse"] == BEST and vafs["sparse"][BEST] > 50.0],
        records=[
            {
                **solved[label][BEST],
                **program[label],
                "record": label,
                "faults": {
                    name: f"{len(counted(view))}: {', '.join(counted(view)) or 'none'}"
                    for name, view in solved[label][BEST].items()
                },
            }
            for label in records
        ],
        tables=[table(page, "orders", rows)],
        drawings=[_draw_orders(page, records, solved, program)],
        simulated=settings.log is None,
    )


def _draw_orders(
    page: Page,
    records: Mapping[str, FlightLog],
    solved: Mapping[str, Mapping[int, Views]],
    program: Mapping[str, Views],
) -> Drawing:
    """Return VAF, error and number of faults against the order; methods that choose the order as horizontal lines."""
    reads: Mapping[str, Callable[[FlightLog, Reconstruction], float]] = {
        "vaf": lambda _, view: view.vaf_fault,
        "error": magnitude_error,
        "faults": lambda _, view: len(counted(view)),
    }
    panels = []
    for what, read in reads.items():
        for label, log in records.items():
            orders = list(solved[label])
            style: Style = "line" if len(orders) == len(ORDERS) else "points"
            curves = [
                curve(label_of(name), orders, [read(log, views[name]) for views in solved[label].values()], style=style)
                for name in DRAWN
            ]
            levels = tuple((view.label, read(log, view)) for view in program[label].values())
            panels.append(panel(page, what, curves, title=label, levels=levels))
    return drawing(page, "thesis_5_9", panels, across=len(records))


def perturbed(clean: FlightLog, kappa: float) -> FlightLog:
    """Return a record with a bias of 4 m/s and kappa cos(4.5 pi t), which starts at 12 s as in the listing."""
    bias = Fault(shape="bias", name="bias_13.8", magnitude=4.0, onset_s=13.8)
    ripple = Fault(
        shape="cosine", name="perturbation", magnitude=kappa, frequency_hz=2.25, onset_s=12.0, phase_reference="window"
    )
    return with_fault(clean, *((bias, ripple) if kappa else (bias,)))


def magnitude_error(log: FlightLog, reconstruction: Reconstruction) -> float:
    """Return the error of the magnitudes, equation 5-1; NaN where no fault of the log is in the dictionary."""
    assert log.truth is not None
    true = {fault.name: fault.magnitude for fault in log.truth.faults if fault.name in reconstruction.magnitudes}
    if not true:
        return float("nan")
    off = [z - true.get(name, 0.0) for name, z in reconstruction.magnitudes.items()]
    return float(np.linalg.norm(off) / np.linalg.norm(list(true.values())))


def counted(reconstruction: Reconstruction) -> list[str]:
    """Return the faults that the listing of the sweep over orders counts."""
    return above(reconstruction.magnitudes, LISTING_SHARE)


def _solved(log: FlightLog, order: int) -> dict[str, Reconstruction]:
    return by_readings(log, order) | {name: by_program(log, name) for name in PROGRAM}


def _listed(orders: Sequence[int]) -> str:
    first, last = orders[0], orders[-1]
    return f"{first} to {last}" if len(orders) > last - first else ", ".join(map(str, orders))


def _method_tables(seen: Mapping[str, Views], others: Sequence[Reconstruction] = ()) -> list[Table]:
    """Return a table of all methods for every record; `others` belong to the first of them."""
    tables = []
    for i, (label, views) in enumerate(seen.items()):
        rows = [
            (view.label, percent(view.vaf_fault), f"{view.vaf_output:.3f} %", view.declared)
            for view in (*views.values(), *(others if i == 0 else ()))
        ]
        name = "methods" if i == 0 else "noise"
        tables.append(table(load("thesis")["shared"], name, rows, record=label))
    return tables


def _reconstructed(figure: str, settings: Settings) -> ReportContent:
    """Return the page of a faulty log: every method, with and without noise if the log is simulated.

    The page states the fault (default the perturbed bias), the order of the readings of algorithm 3, the settings of
    DMAE, and the shapes of a scan over all starts, if any. DMAE with process noise of the fault is only tabulated, and
    left out of a quick run.
    """
    page, shared, name = load("thesis")[figure], load("thesis")["shared"], f"thesis_{figure.replace('-', '_')}"
    clean = thesis_record(settings)
    faulty = with_fault(clean, Fault(**page["fault"])) if "fault" in page else perturbed(clean, KAPPA)
    filters, drift = DmaeSettings(**page["dmae"]), "drift_7.93"
    shapes = () if settings.quick and "quick" in page else page.get("scan", ())
    seen: dict[str, Views] = {}
    record_values: list[dict[str, Any]] = []
    records = records_of(faulty, settings)
    for done, (label, log) in enumerate(records.items(), start=1):
        follower = by_dmae(log, filters, settings)
        scan = {"scan": by_scan(log, settings, shapes=shapes)} if shapes else {}
        views: Views = {**_solved(log, page["order"]), "dmae": follower, **scan}
        afterwards = follower.fault[follower.time_s > fault_starts(log)[0].low + page.get("settled_s", 0.0)]
        seen[label] = views
        record_values.append(
            {
                **views,
                "record": label,
                "level": float(np.mean(afterwards)),
                "wander": float(np.std(afterwards)),
                "drift": {key: number(view.magnitudes.get(drift, 0.0), digits=4) for key, view in views.items()},
            }
        )
        settings.report(done, len(records))
    tabulated = [
        by_dmae(
            faulty, replace(filters, fault_variance=variance), settings, label=f"DMAE, fault noise {variance:g} (m/s)^2"
        )
        for variance in (() if settings.quick else page.get("fault_variances", ()))
    ]
    return report_content(
        {**page, "who": tuple(next(iter(seen.values())))},
        {"log": faulty},
        heading=[HOLDS[figure](values) for values in record_values],
        records=record_values,
        tables=_method_tables(seen, tabulated),
        drawings=[
            drawing(
                page, name if i == 0 else f"{name}_noise", _views_panels(log, seen[label]), caption=name, record=label
            )
            for i, (label, log) in enumerate(records.items())
        ],
        simulated=settings.log is None,
        notes=(
            *(shipped(settings, shapes) if shapes else page.get("quick", ())),
            *(() if settings.log is None else (shared["dmae_model"],)),
        ),
    )


def _views_panels(log: FlightLog, views: Views) -> list[Panel]:
    """Return the reconstructed airspeeds and faults, on axes about the true fault that others may leave."""
    true, spans = true_fault(log), fault_starts(log)[:1]
    # The true fault fills about half of the axis.
    low, high = min(float(true.min()), 0.0), max(float(true.max()), 0.0)
    room = 0.6 * (high - low)
    airspeed = airspeed_panel(log, spans)
    others = [name for name in views if name not in READINGS[:-1]]
    return [
        replace(airspeed, curves=(*airspeed.curves, *_curves(views, ("sparse", "dmae", "risro"), "airspeed"))),
        *(
            fault_panel(log, "true", _curves(views, names, "fault"), spans=spans, y_limits=(low - room, high + room))
            for names in (READINGS[:-1], others)
        ),
    ]


# The claim of the thesis about a figure, as a condition on the values of a record.
HOLDS: Mapping[str, Callable[[Mapping[str, Any]], bool]] = {
    "5-5": lambda of: min(of[name].vaf_fault for name in ("sparse", "dmae")) > 50.0,
    "5-6": lambda of: bool(of["wander"] < 0.1 * abs(of["level"])),
    "5-10": lambda of: bool(of["sparse"].vaf_fault > 50.0),
    "5-11": lambda of: bool(of["dmae"].vaf_fault > 50.0),
    "5-12": lambda of: bool(of["sparse"].vaf_fault < 50.0),
}
thesis_5_5, thesis_5_6, thesis_5_10, thesis_5_11, thesis_5_12 = (partial(_reconstructed, figure) for figure in HOLDS)


def _curves(views: Views, names: Sequence[str], what: str) -> tuple[Curve, ...]:
    looks: tuple[Style, ...] = ("dashed", "dotted", "line", "dashed", "dotted")
    drawn = [views[name] for name in names if name in views]
    return tuple(
        curve(view.label, view.time_s, getattr(view, what), style=look)
        for view, look in zip(drawn, looks, strict=False)
    )
