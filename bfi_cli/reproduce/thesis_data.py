"""The thesis's data: its faults (table 2-1), its record (5-1) and its dictionary (5-2)."""

from __future__ import annotations

from ..config import Config
from ..dictionary import signals
from ..faults import Fault
from ..identify import identify_faults
from ..report.content import Panel, ReportContent, curve
from ..report.text import number, quantity
from ..shapes import SHAPES
from .page import drawing, fill, load, report_content, table
from .reconstruction import declared
from .record import (
    NOISE_M_S,
    Settings,
    airspeed_panel,
    fault_starts,
    thesis_dictionary,
    thesis_record,
    true_fault,
    with_fault,
    with_noise,
)


def thesis_5_1(settings: Settings) -> ReportContent:
    """Return figure 5-1: the control input and the airspeed."""
    page, log, given = load("thesis")["5-1"], thesis_record(settings), settings.log is not None
    answer = identify_faults(log, thesis_dictionary(), Config())
    values = {name: log.channel(name).values for name in ("elevator", "tas")}
    panels = [
        Panel(x_label="time [s]", y_label=f"{name} [{unit}]", curves=(curve("", log.time_s, values[name]),))
        for name, unit in (("elevator", "rad"), ("tas", "m/s"))
    ]
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
        drawings=[drawing(page, "thesis_5_1", panels)],
        notes=[one.text for one in log.notes],
        simulated=settings.log is None,
    )


def thesis_5_2(settings: Settings) -> ReportContent:
    """Return figure 5-2: the signals of the dictionary, with the smallest magnitude of each that could be found."""
    page, log, dictionary = load("thesis")["5-2"], thesis_record(settings), thesis_dictionary()
    answer = identify_faults(with_noise(log, NOISE_M_S, seed=settings.seed), dictionary, Config())
    smallest = {one.name: quantity(one.minimal_detectable, one.unit) for one in answer.candidates}
    start_s = float(log.time_s[0])
    theta = signals(dictionary.resolved(start_s), log.time_s, ["tas"], window_start_s=start_s)[:, 0]
    rows, shown, panels = [], [], []
    for i, (atom, (expression, published_s)) in enumerate(zip(dictionary.atoms, page["signals"], strict=True), start=1):
        rows.append(fill(page["row"], i=i, expression=expression, published_s=published_s, onset_s=atom.onset_s))
        shown.append((f"theta {i}", str(atom.name), expression, smallest[str(atom.name)]))
        signal = curve("", log.time_s, theta[:, i - 1])
        panels.append(Panel(title=f"theta {i}", x_label="time [s]", y_label="[-]", curves=(signal,)))
    return report_content(
        page,
        {"log": log, "noise": NOISE_M_S, "smallest": smallest, "model": answer.model},
        rows=rows,
        tables=[table(page, "signals", shown, noise=NOISE_M_S)],
        drawings=[drawing(page, "thesis_5_2", panels, across=2)],
        simulated=settings.log is None,
    )


def thesis_table_2_1(settings: Settings) -> ReportContent:
    """Return table 2-1: what blocks a pitot probe and the signal that stands for it, drawn on the record's airspeed."""
    page, log = load("thesis")["2-1"], thesis_record(settings)
    rows, panels = [], []
    for blockage, printed, spec in page["faults"]:
        fault = Fault(**spec)
        faulty = with_fault(log, fault)
        rows.append((blockage, f"{printed} (table 2-1)", f"{fault.shape}: {SHAPES[fault.shape].formula.rstrip('.')}"))
        signal = (curve("", log.time_s, true_fault(faulty)),)
        panels += [
            Panel(title=blockage, x_label="time [s]", y_label="fault [m/s]", curves=signal),
            airspeed_panel(faulty, fault_starts(faulty)),
        ]
    return report_content(
        page,
        {"log": log},
        rows=rows,
        drawings=[drawing(page, "thesis_table_2_1", panels, across=2)],
        simulated=settings.log is None,
    )
