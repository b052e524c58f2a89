"""The page of a fault reconstructed several ways: published numbers, every method, the same with noise, the figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..exhibit import Drawing, Exhibit, Panel, Span, Style, Table, curve
from ..flightlog import FlightLog
from .answer import with_noise
from .record import stand_in
from .settings import Settings, comparison
from .thesis_reconstruction import Reconstruction
from .thesis_threshold import NOISE_M_S

__all__ = ["Page", "percent", "reconstructed"]

FloatArray = NDArray[np.float64]

STYLES: tuple[Style, ...] = ("dashed", "line", "dotted", "dashed")
MODEL_NOTE = (
    "DMAE needs a model of the aircraft: it has the linear Citation of equation 5-4 about the mean of the log's first "
    "second, which this log's aircraft, speed and height may not fit."
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Page:
    """What is said of a figure.

    Attributes
    ----------
    figure : its number in the thesis.
    rows : what, published, ours.
    filters : settings of DMAE.
    """

    figure: str
    title: str
    heading: str
    verdict: str
    rows: Sequence[tuple[str, str, str]]
    notes: tuple[str, ...]
    caption: str
    filters: str


def reconstructed(
    page: Page,
    log: FlightLog,
    found: Sequence[Reconstruction],
    settings: Settings,
    *,
    again: Callable[[FlightLog], Sequence[Reconstruction]],
    others: Sequence[Reconstruction] = (),
) -> Exhibit:
    """Return the exhibit of a faulty log.

    Parameters
    ----------
    found : reconstructions that are drawn; others : that are only tabulated.
    again : makes those of the table with noise, which a quick run and a log of the user's own have none of.
    """
    tables = [comparison(page.rows), _table((*found, *others), name="methods", title="Every method")]
    if settings.log is None and not settings.quick:
        noisy = with_noise(log, NOISE_M_S, seed=settings.seed)
        tables.append(_table(again(noisy), name="noise", title=f"The same with {NOISE_M_S:g} m/s of noise"))
    model = () if settings.log is None else (MODEL_NOTE,)
    return Exhibit(
        kicker="Reproduction",
        title=f"Thesis, figure {page.figure}: {page.title}",
        heading=page.heading,
        verdict=page.verdict,
        facts=(("Record", log.path), ("DMAE", page.filters)),
        tables=tuple(tables),
        drawings=(_drawn(f"thesis_{page.figure.replace('-', '_')}", page.caption, log, found),),
        notes=(*page.notes, *model, *stand_in(settings)),
    )


def _drawn(name: str, caption: str, log: FlightLog, found: Sequence[Reconstruction]) -> Drawing:
    """Return the faulty airspeed with the true one, and the fault with its reconstructions."""
    assert log.truth is not None
    channel = log.channel("tas")
    clean, start = log.truth.clean[channel.name], log.truth.faults[0].onset_s
    spans = (Span(label="start", low=start, high=start),)
    airspeed = (curve("true", log.time_s, clean), curve("measured", log.time_s, channel.values, style="dashed"))
    faults = [curve("true", log.time_s, channel.values - clean)]
    faults += [curve(one.label, one.time_s, one.fault, style=look) for one, look in zip(found, STYLES, strict=False)]
    return Drawing(
        name=name,
        caption=caption,
        panels=(
            Panel(x_label="time [s]", y_label="tas [m/s]", curves=airspeed, spans=spans),
            Panel(
                x_label="time [s]",
                y_label="fault [m/s]",
                curves=tuple(faults),
                spans=spans,
                y_limits=_limits(channel.values - clean),
            ),
        ),
    )


def _limits(fault: FloatArray) -> tuple[float, float]:
    """Return limits in which the true fault fills about half of the axis; a reconstruction far outside leaves it."""
    low, high = min(float(fault.min()), 0.0), max(float(fault.max()), 0.0)
    room = 0.6 * (high - low)
    return low - room, high + room


def _table(found: Sequence[Reconstruction], *, name: str, title: str) -> Table:
    """Return one row per reconstruction."""
    return Table(
        name=name,
        title=title,
        heads=("method", "VAF of the fault", "VAF of the airspeed", "declared"),
        rows=tuple((one.label, percent(one.vaf_fault), percent(one.vaf_output), one.found) for one in found),
    )


def percent(value: float) -> str:
    """Return "86.0 %"."""
    return f"{value:.1f} %"
