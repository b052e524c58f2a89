"""Faults of the thesis as every method reconstructs them: cases 1 to 3 of its section 5-3, figures 5-5 to 5-12.

Case 1 is a fault of the dictionary (5-5, 5-6), case 2 a bias with a perturbation that the dictionary lacks (5-7 to
5-10), case 3 a fault that starts later than the dictionary's (5-11, 5-12).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..faults import Fault
from ..flightlog import FlightLog
from ..identify.dmae import DmaeSettings
from ..report.content import Curve, Panel, ReportContent, Style, Table, curve
from ..report.text import number
from .page import drawing, joined, load, percent, report_content, table
from .reconstruction import (
    PROGRAM,
    READINGS,
    Reconstruction,
    above,
    by_dmae,
    by_program,
    by_readings,
    by_scan,
    label_of,
    shipped,
)
from .record import Settings, airspeed_panel, fault_starts, records_of, thesis_record, true_fault, with_fault

Views = Mapping[str, Reconstruction]

# Sizes of the perturbation, of figure 5-8.
KAPPAS = tuple(np.round(np.arange(0.0, 0.501, 0.05), 2).tolist())
QUICK_KAPPAS = (0.0, 0.5)  # those at its ends
KAPPA = 0.2  # of figures 5-7, 5-9 and 5-10
ORDERS = tuple(range(3, 81))  # of the thesis's figure 5-9
QUICK_ORDERS = (5, 25, 45, 60)  # some of these
LOW, BEST = 4, 45  # the orders of the thesis: of most of its figures, and the best of figure 5-9
SHOWN = (3, 4, 5, 10, 25, 40, 44, 45, 50, 60, 80)  # in the table of figure 5-9, and those solved with noise too
LISTING_SHARE = 0.01  # of the norm of all magnitudes: what the listing of the sweep over orders counts as a fault
VAF_LIMITS = (-105.0, 105.0)  # of an axis, %: minus 100 is an error as large as twice the power of the signal


def thesis_5_7(settings: Settings) -> ReportContent:
    """Return figure 5-7: a bias of 4 m/s with a perturbation that the dictionary lacks (kappa = 0.2)."""
    page, log = load("thesis")["5-7"], thesis_record(settings)
    faulty = perturbed(log, KAPPA)
    seen = {label: _solved(one, LOW) for label, one in records_of(faulty, settings).items()}
    spans, fault = fault_starts(faulty), curve("", log.time_s, true_fault(faulty))
    panels = (
        airspeed_panel(faulty, spans),
        Panel(x_label="time [s]", y_label="fault [m/s]", curves=(fault,), spans=spans),
    )
    return report_content(
        page,
        {"log": log, "declared": "; ".join(f"{label}: {views['risro'].declared}" for label, views in seen.items())},
        records=[{"record": label, **views} for label, views in seen.items()],
        tables=_method_tables(seen),
        drawings=[drawing(page, "thesis_5_7", panels)],
        simulated=settings.log is None,
        who=tuple(next(iter(seen.values()))),
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
    panels = [
        Panel(
            title=label,
            x_label="kappa [m/s]",
            y_label=f"VAF of the {what} [%]",
            curves=tuple(
                curve(
                    label_of(name), kappas, [getattr(views[name], key) for views in each], style=joined(kappas, "line")
                )
                for name in names
                if name != "sparse_2"
            ),
            y_limits=limits,
        )
        for what, key, limits in (("fault", "vaf_fault", VAF_LIMITS), ("airspeed", "vaf_output", (-5.0, 105.0)))
        for label, each in swept.items()
    ]
    return report_content(
        page,
        {
            "log": clean,
            "kappas": f"{len(kappas)}: {', '.join(f'{kappa:g}' for kappa in kappas)}",
        },
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
        who=names,
    )


def thesis_5_9(settings: Settings) -> ReportContent:
    """Return figure 5-9: orders 3 to 80 at kappa = 0.2, each solved on its own rows."""
    page, clean = load("thesis")["5-9"], thesis_record(settings)
    records = records_of(perturbed(clean, KAPPA), settings)
    whole = QUICK_ORDERS if settings.quick else ORDERS
    orders = {label: whole if i == 0 or settings.quick else SHOWN for i, label in enumerate(records)}
    total, done = sum(map(len, orders.values())), 0
    swept: dict[str, list[Views]] = {}
    for label, log in records.items():
        for order in orders[label]:
            swept.setdefault(label, []).append(by_readings(log, order))
            settings.report(done := done + 1, total)
    program = {label: {name: by_program(log, name) for name in PROGRAM} for label, log in records.items()}

    def count(one: Reconstruction) -> int:
        return len(above(one.magnitudes, LISTING_SHARE))

    rows = [
        (
            *(label, str(order), one.label, percent(one.vaf_fault), number(magnitude_error(log, one)), str(count(one))),
            ", ".join(above(one.magnitudes, LISTING_SHARE)),
        )
        for label, log in records.items()
        for order, views in zip(orders[label], swept[label], strict=True)
        if order in SHOWN
        for one in views.values()
    ]
    panels = []
    for y_label, read, limits in (
        ("VAF of the fault [%]", lambda _, one: one.vaf_fault, VAF_LIMITS),
        ("error [-]", magnitude_error, (5e-3, 5.0)),
        ("faults [-]", lambda _, one: count(one), (0.0, 7.5)),
    ):
        for label, log in records.items():
            at = orders[label]
            drawn = {
                name: [read(log, views[name]) for views in swept[label]] for name in READINGS if name != "sparse_2"
            }
            panels.append(
                Panel(
                    title=label,
                    x_label="order s [-]",
                    y_label=y_label,
                    curves=tuple(
                        curve(label_of(name), at, y, style="line" if len(at) == len(ORDERS) else "points")
                        for name, y in drawn.items()
                    ),
                    levels=tuple((one.label, read(log, one)) for one in program[label].values()),
                    log_y=y_label == "error [-]",
                    y_limits=limits,
                )
            )
    first = next(iter(records))
    at_best = {label: swept[label][orders[label].index(BEST)] for label in records}
    best = {
        name: max(zip(orders[first], swept[first], strict=True), key=lambda pair: pair[1][name].vaf_fault)
        for name in READINGS
    }
    single = {
        name: [str(order) for order, views in zip(orders[first], swept[first], strict=True) if count(views[name]) == 1]
        for name in READINGS
    }
    return report_content(
        page,
        {
            "log": clean,
            "orders": {label: _listed(each) for label, each in orders.items()},
            "solved": "; ".join(f"{label}: {_listed(each)}" for label, each in orders.items()),
            "best": {name: f"{order} ({views[name].vaf_fault:.1f} %)" for name, (order, views) in best.items()},
            "drift": {name: number(one.magnitudes["drift_7.93"], digits=3) for name, one in at_best[first].items()},
            "single": {name: ", ".join(each) or "none" for name, each in single.items()},
            "last": orders[first][-1],
            "end": swept[first][-1],
            "fifth": swept[first][orders[first].index(5)],
        },
        heading=[best["sparse"][0] == BEST and best["sparse"][1]["sparse"].vaf_fault > 50.0],
        records=[
            {
                **at_best[label],
                **program[label],
                "record": label,
                "faults": {
                    name: f"{count(one)}: {', '.join(above(one.magnitudes, LISTING_SHARE)) or 'none'}"
                    for name, one in at_best[label].items()
                },
            }
            for label in records
        ],
        tables=[table(page, "orders", rows)],
        drawings=[drawing(page, "thesis_5_9", panels, across=len(records))],
        simulated=settings.log is None,
        who=(*READINGS, *PROGRAM),
    )


def perturbed(clean: FlightLog, kappa: float) -> FlightLog:
    """Return a record with a bias of 4 m/s and kappa cos(4.5 pi t), which starts at 12 s as in the listing."""
    bias = Fault(shape="bias", name="bias_13.8", magnitude=4.0, onset_s=13.8)
    ripple = Fault(
        shape="cosine", name="perturbation", magnitude=kappa, frequency_hz=2.25, onset_s=12.0, phase_reference="window"
    )
    return with_fault(clean, *((bias, ripple) if kappa else (bias,)))


def magnitude_error(log: FlightLog, one: Reconstruction) -> float:
    """Return the error of the magnitudes, equation 5-1; NaN where no fault of the log is in the dictionary."""
    assert log.truth is not None
    true = {fault.name: fault.magnitude for fault in log.truth.faults if fault.name in one.magnitudes}
    if not true:
        return float("nan")
    off = [z - true.get(name, 0.0) for name, z in one.magnitudes.items()]
    return float(np.linalg.norm(off) / np.linalg.norm(list(true.values())))


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
            (one.label, percent(one.vaf_fault), f"{one.vaf_output:.3f} %", one.declared)
            for one in (*views.values(), *(others if i == 0 else ()))
        ]
        name = "methods" if i == 0 else "noise"
        tables.append(table(load("thesis")["shared"], name, rows, record=label))
    return tables


def _reconstructed(figure: str, settings: Settings) -> ReportContent:
    """Return the page of a faulty log: every method, with and without noise where the log is simulated.

    The page says which fault it is (the perturbed bias where it names none), the order of the readings of algorithm 3,
    the settings of DMAE, and the shapes for which the scan over all starts is made too. DMAE with process noise of the
    fault, which a quick run leaves out, is only tabulated.
    """
    page, shared, name = load("thesis")[figure], load("thesis")["shared"], f"thesis_{figure.replace('-', '_')}"
    clean = thesis_record(settings)
    faulty = with_fault(clean, Fault(**page["fault"])) if "fault" in page else perturbed(clean, KAPPA)
    filters, drift = DmaeSettings(**page["dmae"]), "drift_7.93"
    shapes = () if settings.quick and "quick" in page else page.get("scan", ())
    others = [] if settings.quick else [replace(filters, fault_variance=one) for one in page.get("fault_variances", ())]
    seen: dict[str, Views] = {}
    told: list[dict[str, Any]] = []
    records = records_of(faulty, settings)
    for done, (label, log) in enumerate(records.items(), start=1):
        follower = by_dmae(log, filters, settings)
        scan = {"scan": by_scan(log, settings, shapes=shapes)} if shapes else {}
        views: Views = {**_solved(log, page["order"]), "dmae": follower, **scan}
        afterwards = follower.fault[follower.time_s > fault_starts(log)[0].low + page.get("settled_s", 0.0)]
        seen[label] = views
        told.append(
            {
                **views,
                "record": label,
                "level": float(np.mean(afterwards)),
                "wander": float(np.std(afterwards)),
                "drift": {key: number(one.magnitudes.get(drift, 0.0), digits=4) for key, one in views.items()},
            }
        )
        settings.report(done, len(records))
    tabulated = [
        by_dmae(faulty, one, settings, label=f"DMAE, fault noise {one.fault_variance:g} (m/s)^2") for one in others
    ]
    drawings = []
    for i, (label, log) in enumerate(records.items()):
        true, spans, views = true_fault(log), fault_starts(log)[:1], seen[label]
        # The true fault fills about half of the axis; a reconstruction far outside leaves it.
        low, high = min(float(true.min()), 0.0), max(float(true.max()), 0.0)
        room = 0.6 * (high - low)
        airspeed = airspeed_panel(log, spans)
        panels = [
            replace(airspeed, curves=(*airspeed.curves, *_curves(views, ("sparse", "dmae", "risro"), "airspeed")))
        ]
        for names in (READINGS[:-1], [one for one in views if one not in READINGS[:-1]]):
            panels.append(
                Panel(
                    x_label="time [s]",
                    y_label="fault [m/s]",
                    curves=(curve("true", log.time_s, true), *_curves(views, names, "fault")),
                    spans=spans,
                    y_limits=(low - room, high + room),
                )
            )
        drawings.append(drawing(page, name if i == 0 else f"{name}_noise", panels, caption=name, record=label))
    return report_content(
        page,
        {"log": faulty},
        heading=[HOLDS[figure](one) for one in told],
        records=told,
        tables=_method_tables(seen, tabulated),
        drawings=drawings,
        simulated=settings.log is None,
        notes=(
            *(shipped(settings, shapes) if shapes else page.get("quick", ())),
            *(() if settings.log is None else (shared["dmae_model"],)),
        ),
        who=tuple(next(iter(seen.values()))),
    )


# What the thesis says of a figure, by what is told of a record.
HOLDS: Mapping[str, Callable[[Mapping[str, Any]], bool]] = {
    "5-5": lambda of: min(of[one].vaf_fault for one in ("sparse", "dmae")) > 50.0,
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
        curve(one.label, one.time_s, getattr(one, what), style=look) for one, look in zip(drawn, looks, strict=False)
    )
