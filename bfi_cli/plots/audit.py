"""What a dictionary's atoms leave to be seen, how alike they are, and how large each must be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..wording import quantity
from .envelope import thinned
from .style import BLACK, BLUE, GREY, Look, page, plain, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..audit import Audit, AuditedAtom, Signatures

__all__ = ["MAX_ROWS", "plot_audit"]

MAX_ROWS = 24
NUMBERED = 12
ROW_IN, LEAST_IN = 0.24, 1.5
SQUARE_IN, LEFT_IN = 2.22, 1.75
NAME_LETTERS = 20
DARK = 0.55


@styled
def plot_audit(audit: Audit) -> Figure:
    """Draw the signatures of the live atoms, their mutual coherence and, on a log, the least that can be detected.

    A dictionary of more than `MAX_ROWS` live atoms shows the signatures and limits of the first ones only.

    Parameters
    ----------
    audit : with signatures.
    """
    signatures = audit.signatures
    if signatures is None:
        raise ValueError("the audit holds no signatures to draw")
    n = min(len(signatures.names), MAX_ROWS)
    figure, grid = page([max(LEAST_IN, ROW_IN * n), SQUARE_IN], widths=(1.0, 1.0), gap_in=0.66, left_in=LEFT_IN)
    traces = figure.add_subplot(grid[0, :])
    _draw_signatures(traces, signatures, n)
    what = "raw signals" if audit.model is None else "filtered signatures, off the model's regressors"
    more = f", first {n} of {len(signatures.names)}" if n < len(signatures.names) else ""
    traces.set_title(f"{what}, each to its own scale{more}", loc="left")
    _draw_coherence(figure.add_subplot(grid[1, 0]), signatures)
    if audit.model is not None:
        _draw_limits(figure.add_subplot(grid[1, 1]), audit)
    return figure


def _draw_signatures(axes: Axes, signatures: Signatures, n: int) -> None:
    for row in range(n):
        values = signatures.values[:, row]
        peak = float(np.max(np.abs(values), initial=0.0)) or 1.0
        shown = thinned(values)
        axes.axhline(row, color=GREY, lw=0.4)
        axes.plot(signatures.time_s[shown], row - 0.45 * values[shown] / peak, color=BLUE, lw=0.8)
    axes.set_yticks(range(n), labels=_numbered(signatures.names[:n]))
    axes.set(ylim=(n - 0.4, -0.6), xlim=(signatures.time_s[0], signatures.time_s[-1]))
    axes.set_xlabel("time [s]")
    axes.set_ylabel("dictionary entry")
    axes.grid(axis="y", visible=False)


def _numbered(names: Sequence[str]) -> list[str]:
    return [f"{plain(name, NAME_LETTERS)}  {j}" for j, name in enumerate(names, 1)]


def _draw_coherence(axes: Axes, signatures: Signatures) -> None:
    n = len(signatures.names)
    axes.imshow(np.ma.masked_invalid(signatures.coherence), cmap="Greys", vmin=0.0, vmax=1.0, aspect="equal")
    axes.grid(visible=False)
    axes.set_title("coherence [-]", loc="left")
    marked = range(n) if n <= NUMBERED else [0, *range(_step(n) - 1, n, _step(n))]
    axes.set_xticks(marked, labels=[str(j + 1) for j in marked])
    axes.set_yticks(marked, labels=_numbered(signatures.names) if n <= NUMBERED else [str(j + 1) for j in marked])
    axes.set_ylabel("dictionary entry")
    axes.set_xlabel("dictionary entry")
    if n <= NUMBERED:
        for (row, column), value in np.ndenumerate(signatures.coherence):
            look: Look = {"ha": "center", "va": "center", "fontsize": 6.5}
            axes.text(column, row, _cell(value), color="white" if value > DARK else BLACK, **look)


def _step(n: int) -> int:
    """Return the distance of the entries whose numbers are written, at most ten of them."""
    return next(step for step in (5, 10, 20, 50, 100, 200, 500, 1000) if n <= 10 * step or step == 1000)


def _cell(value: float) -> str:
    if math.isnan(value):
        return "-"
    return "1" if value > 1.0 - 1e-9 else f"{min(value, 0.99):.2f}".removeprefix("0")


def _draw_limits(axes: Axes, audit: Audit) -> None:
    """Draw in noise of the channel, whatever the units of the magnitudes; these are written beside the bars."""
    atoms = audit.live[:MAX_ROWS]
    sizes = [_in_noise(atom, audit) for atom in atoms]
    known = [size for size in sizes if math.isfinite(size)] or [1.0]
    low, high = min(known) / 3.0, max(known)
    axes.set_xscale("log")
    axes.set_xlim(low, high * (high / low) ** 0.8)
    for row, (atom, size) in enumerate(zip(atoms, sizes, strict=True)):
        end = size if math.isfinite(size) else low
        axes.barh(row, end - low, left=low, color=BLUE, height=0.55)
        axes.annotate(plain(_limit(atom)), (end, row), (3, 0), textcoords="offset points", va="center", fontsize=6.5)
    axes.set_yticks(range(len(atoms)), labels=[str(j + 1) for j in range(len(atoms))])
    axes.set_ylim(max(len(atoms), 4) - 0.4, -0.6)
    axes.set_title("least that can be detected", loc="left")
    axes.set_xlabel("largest excursion / prediction error SD [-]")
    axes.set_ylabel("dictionary entry")
    axes.grid(axis="y", visible=False)


def _in_noise(atom: AuditedAtom, audit: Audit) -> float:
    noise = audit.model.noise_sd.get(atom.fault.channel, 0.0) if audit.model is not None else 0.0
    return atom.minimal_peak / noise if atom.minimal_peak and noise > 0.0 else math.nan


def _limit(atom: AuditedAtom) -> str:
    return "nothing is seen" if atom.minimal_physical is None else quantity(*atom.minimal_physical)
