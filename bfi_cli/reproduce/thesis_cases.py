"""Faults of the thesis reconstructed by the published method, DMAE and the default method.

A fast and a slow sinusoid (figures 5-5, 5-6), a perturbed bias (5-10), faults that start too late (5-11, 5-12).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..faults import Fault
from ..flightlog import FlightLog
from ..identify.dmae import DmaeSettings
from ..report.content import Panel, ReportContent, Style, curve
from ..report.text import number
from .page import drawing, exhibit, fill, load, percent, table
from .reconstruction import Reconstruction, by_default, by_dmae, by_published, by_scan, shipped
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
from .thesis_perturbed import BEST, KAPPA, LOW, perturbed

__all__ = ["thesis_5_5", "thesis_5_6", "thesis_5_10", "thesis_5_11", "thesis_5_12"]

Views = tuple[Reconstruction, ...]

# Q and R as the thesis prints them for each figure; 5-12 prints none and takes those of 5-11.
SINUSOIDS = DmaeSettings(process_variance=0.4e-5, measurement_variance=0.01)
PERTURBED = DmaeSettings(process_variance=0.24e-4, measurement_variance=0.005)
SHIFTED = DmaeSettings(process_variance=0.4e-6, measurement_variance=1e-3)
FAULT_VARIANCES = (3e-4, 0.05)  # (m/s)^2 per sample: with these DMAE has the published VAF of airspeed, and of fault
SETTLED_S = 1.5  # after the start of the slow sinusoid, when DMAE's fault has come to its level

FAST = Fault(shape="sine", name="sine_1.15", magnitude=5.0, frequency_hz=1.15, onset_s=6.35, phase_reference="window")
SLOW = Fault(shape="sine", name="sine_0.35", magnitude=4.0, frequency_hz=0.35, onset_s=5.29, phase_reference="window")
LATE_SINE = Fault(shape="sine", magnitude=1.0, frequency_hz=1.15, onset_s=15.86, phase_reference="window")
LATE_DRIFT = Fault(shape="drift", magnitude=1.0, slope=0.23, onset_s=15.86)
STYLES: tuple[Style, ...] = ("dashed", "line", "dotted", "dashed")


def thesis_5_5(settings: Settings) -> ReportContent:
    """Return figure 5-5: a sinusoid of 1.15 Hz, which the published method, DMAE and ours all follow.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    log, see = with_fault(thesis_record(settings), FAST), _methods(settings, LOW, SINUSOIDS)
    found = see(log)
    followed = found[1].vaf_fault > 50.0
    follows = load("thesis")["5-5"]["follows"][followed]
    others = _with_fault_noise(log, settings)
    return _reconstructed("5-5", log, found, settings, again=see, others=others, heading=followed, follows=follows)


def thesis_5_6(settings: Settings) -> ReportContent:
    """Return figure 5-6: a sinusoid of 0.35 Hz, which DMAE detects and mistakes for a bias.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    log, see = with_fault(thesis_record(settings), SLOW), _methods(settings, LOW, SINUSOIDS)
    _, dmae, _ = found = see(log)
    settled = dmae.fault[dmae.time_s > fault_starts(log)[0].low + SETTLED_S]
    level, wander = float(np.mean(settled)), float(np.std(settled))
    return _reconstructed(
        "5-6",
        log,
        found,
        settings,
        again=see,
        others=_with_fault_noise(log, settings),
        heading=wander < 0.1 * abs(level),
        level=number(level, digits=3),
        wander=number(wander, digits=2),
    )


def thesis_5_10(settings: Settings) -> ReportContent:
    """Return figure 5-10: the perturbed bias reconstructed at order 45, beside DMAE.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    log, see = perturbed(thesis_record(settings), KAPPA), _methods(settings, BEST, PERTURBED)
    found = see(log)
    return _reconstructed("5-10", log, found, settings, again=see, heading=found[0].vaf_fault > 50.0)


def thesis_5_11(settings: Settings) -> ReportContent:
    """Return figure 5-11: a sinusoid that starts 9.5 s after the dictionary's; harmless for DMAE.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    page = load("thesis")["5-11"]
    log, see = with_fault(thesis_record(settings), LATE_SINE), _methods(settings, LOW, SHIFTED)
    found = see(log)
    scan = () if settings.quick else (by_scan(log, settings, shapes=("bias", "drift", "sine")),)
    return _reconstructed(
        "5-11",
        log,
        (*found, *scan),
        settings,
        again=see,
        heading=found[1].vaf_fault > 50.0,
        notes=(page["shipped"],) if scan else (),
        scan=scan[0].found if scan else page["left_out"],
        scan_too=fill(page["scan_too"], scan=scan[0].found) if scan else "",
    )


def thesis_5_12(settings: Settings) -> ReportContent:
    """Return figure 5-12: a drift that starts later than the dictionary's, order 45: not detected.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    log, see = with_fault(thesis_record(settings), LATE_DRIFT), _methods(settings, BEST, SHIFTED)

    def again(record: FlightLog) -> Views:
        return *see(record), by_scan(record, settings, shapes=("bias", "drift"))

    found = again(log)
    missed = found[0].vaf_fault < 50.0
    notes = shipped(settings)
    return _reconstructed("5-12", log, found, settings, again=again, heading=missed, notes=notes, scan=found[-1])


def _methods(settings: Settings, order: int, filters: DmaeSettings) -> Callable[[FlightLog], Views]:
    """Return what gives the published method at an order, DMAE and ours on a log."""
    return lambda log: (by_published(log, order), by_dmae(log, filters, settings), by_default(log))


def _with_fault_noise(log: FlightLog, settings: Settings) -> Views:
    """Return DMAE with process noise of the fault, which a quick run leaves out."""
    tuned = {f"DMAE, fault noise {size:g} (m/s)^2": replace(SINUSOIDS, fault_variance=size) for size in FAULT_VARIANCES}
    return () if settings.quick else tuple(by_dmae(log, one, settings, label=label) for label, one in tuned.items())


def _reconstructed(
    figure: str,
    log: FlightLog,
    found: Views,
    settings: Settings,
    *,
    again: Callable[[FlightLog], Views],
    heading: object,
    others: Views = (),
    notes: Sequence[str] = (),
    **values: object,
) -> ReportContent:
    """Return the page of a faulty log: every method, the same with noise, the figure.

    Parameters
    ----------
    found : the published method, DMAE, ours and further reconstructions, which are drawn.
    others : reconstructions that are only tabulated.
    again : makes those of the table with noise, which a quick run and a log of the user's own have none of.
    """
    page, shared = load("thesis")[figure], load("thesis")["shared"]
    tables = {"methods": (*found, *others)}
    if settings.log is None and not settings.quick:
        tables["noise"] = again(with_noise(log, NOISE_M_S, seed=settings.seed))
    true, spans = true_fault(log), fault_starts(log)[:1]
    curves = [curve("true", log.time_s, true)]
    curves += [curve(one.label, one.time_s, one.fault, style=look) for one, look in zip(found, STYLES, strict=False)]
    # The true fault fills about half of the axis; a reconstruction far outside leaves it.
    low, high = min(float(true.min()), 0.0), max(float(true.max()), 0.0)
    room = 0.6 * (high - low)
    faults = Panel(
        x_label="time [s]",
        y_label="fault [m/s]",
        curves=tuple(curves),
        spans=spans,
        y_limits=(low - room, high + room),
    )
    return exhibit(
        page,
        {"log": log, "published": found[0], "dmae": found[1], "ours": found[2], **values},
        heading=heading,
        tables=[
            table(
                page,
                name,
                [(one.label, percent(one.vaf_fault), percent(one.vaf_output), one.found) for one in views],
                noise=NOISE_M_S,
            )
            for name, views in tables.items()
        ],
        drawings=[drawing(page, f"thesis_{figure.replace('-', '_')}", (airspeed_panel(log, spans), faults))],
        notes=(*notes, *(() if settings.log is None else (shared["dmae_model"],)), *stand_in(settings)),
    )
