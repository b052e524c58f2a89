"""Case 2 of the thesis, a bias with a perturbation the dictionary lacks: figure 5-7, and swept in 5-8 and 5-9."""

from __future__ import annotations

import numpy as np

from ..config import Config
from ..faults import Fault
from ..flightlog import FlightLog
from ..identify import identify_faults
from ..report.content import Curve, Panel, ReportContent, Style, curve
from ..report.text import number
from .page import drawing, exhibit, load, percent, table
from .reconstruction import LISTING, SETTLED, Reconstruction, Solved, by_default, clause, declared, solved
from .record import (
    NOISE_M_S,
    Settings,
    airspeed_panel,
    fault_starts,
    stand_in,
    thesis_dictionary,
    thesis_record,
    true_fault,
    with_fault,
    with_noise,
)

__all__ = ["BEST", "KAPPA", "KAPPAS", "LOW", "ORDERS", "perturbed", "thesis_5_7", "thesis_5_8", "thesis_5_9"]

KAPPAS = tuple(np.round(np.arange(0.0, 0.501, 0.05), 2).tolist())
QUICK_KAPPAS = (0.0, 0.5)
KAPPA = 0.2  # of figures 5-7, 5-9 and 5-10
ORDERS = tuple(range(3, 81))
QUICK_ORDERS = (5, 25, 45, 60)
LOW, BEST = 4, 45  # the orders of the thesis: of most of its figures, and the best of figure 5-9
RUNAWAY = 10.0  # relative error of the magnitudes, twice the end of the figure's axis
SHOWN = (3, 4, 5, 10, 25, 40, 44, 45, 50, 60, 80)
METHODS = {"published, settled": SETTLED, "published, as listed": LISTING}


def perturbed(clean: FlightLog, kappa: float) -> FlightLog:
    """Return a record with a bias of 4 m/s and kappa cos(4.5 pi t), which starts at 12 s as in the listing."""
    bias = Fault(shape="bias", name="bias_13.8", magnitude=4.0, onset_s=13.8)
    ripple = Fault(
        shape="cosine",
        name="perturbation",
        magnitude=kappa,
        frequency_hz=2.25,
        onset_s=12.0,
        phase_reference="window",
    )
    return with_fault(clean, *((bias, ripple) if kappa else (bias,)))


def thesis_5_7(settings: Settings) -> ReportContent:
    """Return figure 5-7: a bias of 4 m/s with a perturbation that the dictionary lacks (kappa = 0.2).

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    page, log = load("thesis")["5-7"], thesis_record(settings)
    faulty = perturbed(log, KAPPA)
    noisy = with_noise(faulty, NOISE_M_S, seed=settings.seed)
    without, answer = (identify_faults(one, thesis_dictionary(), Config()) for one in (faulty, noisy))
    spans, fault = fault_starts(faulty), curve("", log.time_s, true_fault(faulty))
    panels = (
        airspeed_panel(faulty, spans),
        Panel(x_label="time [s]", y_label="fault [m/s]", curves=(fault,), spans=spans),
    )
    return exhibit(
        page,
        {
            "log": log,
            "noise": NOISE_M_S,
            "model": answer.model,
            "clause": clause(answer),
            "without": declared(without),
            "declared": declared(answer),
        },
        drawings=[drawing(page, "thesis_5_7", panels)],
        notes=stand_in(settings),
    )


def thesis_5_8(settings: Settings) -> ReportContent:
    """Return figure 5-8: the perturbation's size kappa from 0 to 0.5 at order 4.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    page, clean = load("thesis")["5-8"], thesis_record(settings)
    kappas = QUICK_KAPPAS if settings.quick else KAPPAS
    swept: dict[str, list[Solved]] = {name: [] for name in METHODS}
    ours: list[Reconstruction] = []
    for done, kappa in enumerate(kappas, start=1):
        log = perturbed(clean, kappa)
        for name, config in METHODS.items():
            swept[name] += solved(log, [LOW], config)
        ours.append(by_default(log))
        settings.report(done, len(kappas))
    rows = [
        (f"{kappa:g}", *(percent(found[i].vaf_fault) for found in swept.values()), percent(own.vaf_fault), own.found)
        for i, (kappa, own) in enumerate(zip(kappas, ours, strict=True))
    ]
    panels = [
        Panel(
            x_label="kappa [m/s]",
            y_label=f"VAF of the {what} [%]",
            curves=(
                *(curve(name, kappas, [getattr(one, key) for one in found]) for name, found in swept.items()),
                curve("ours", kappas, [getattr(one, key) for one in ours], style="dashed"),
            ),
            y_limits=(-5.0, 105.0),
        )
        for what, key in (("fault", "vaf_fault"), ("airspeed", "vaf_output"))
    ]
    settled = swept["published, settled"]
    return exhibit(
        page,
        {
            "log": clean,
            "low": kappas[0],
            "high": kappas[-1],
            "first": settled[0],
            "last": settled[-1],
            "least": min(one.vaf_output for one in settled),
            "ours": ours[-1],
            "kept": min(one.vaf_fault for one in ours),
        },
        heading=settled[-1].vaf_fault < 50.0,
        tables=[table(page, "kappa", rows)],
        drawings=[drawing(page, "thesis_5_8", panels)],
        notes=stand_in(settings),
    )


def thesis_5_9(settings: Settings) -> ReportContent:
    """Return figure 5-9: orders 3 to 80 at kappa = 0.2.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    page, clean, orders = load("thesis")["5-9"], thesis_record(settings), QUICK_ORDERS if settings.quick else ORDERS
    log, total = perturbed(clean, KAPPA), len(METHODS) * len(orders)
    sweeps: dict[str, tuple[Solved, ...]] = {}
    for name, config in METHODS.items():
        sweeps[name] = solved(
            log, orders, config, report=lambda done: settings.report(len(sweeps) * len(orders) + done, total)
        )
    settled, listed = sweeps.values()
    at, ours = {one.order: one for one in settled}, by_default(log)
    rows = [
        (str(one.order), name, percent(one.vaf_fault), number(one.error), str(one.n_listing), ", ".join(one.names))
        for name, found in sweeps.items()
        for one in found
        if one.order in SHOWN
    ]

    def curves(key: str, looks: tuple[Style, ...] = ("line", "line")) -> tuple[Curve, ...]:
        return tuple(
            curve(name, [one.order for one in found], [getattr(one, key) for one in found], style=look)
            for (name, found), look in zip(sweeps.items(), looks, strict=True)
        )

    x_label, n_ours = "order s [-]", float(len(ours.found.split(",")))
    panels = (
        Panel(
            x_label=x_label,
            y_label="VAF of the fault [%]",
            curves=curves("vaf_fault"),
            levels=(("ours", ours.vaf_fault),),
            y_limits=(-5.0, 105.0),
        ),
        Panel(x_label=x_label, y_label="error [-]", curves=curves("error"), log_y=True, y_limits=(5e-3, 5.0)),
        Panel(
            x_label=x_label,
            y_label="faults [-]",
            curves=curves("n_listing", ("steps", "points")),
            levels=(("ours", n_ours),),
            y_limits=(0.0, 7.5),
        ),
    )
    return exhibit(
        page,
        {
            "log": clean,
            "best": max(settled, key=lambda one: one.vaf_fault),
            "at": at[BEST],
            "names": ", ".join(at[BEST].names),
            "fifth": at[5],
            "last": settled[-1],
            "runaways": ", ".join(str(one.order) for one in listed if one.error > RUNAWAY) or "none",
            "ours": ours,
        },
        tables=[table(page, "orders", rows)],
        drawings=[drawing(page, "thesis_5_9", panels)],
        notes=stand_in(settings),
    )
