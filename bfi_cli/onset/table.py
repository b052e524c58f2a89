"""The answer of `bfi start-time` on a terminal, and in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..wording import describe, interval, number, shortened
from .result import OnsetFault, OnsetResult

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["print_onset", "summary_rows", "verdict"]

COLOURS = {"fault": "bold red", "no_fault": "bold green", "not_identifiable": "bold yellow"}


def print_onset(console: Console, result: OnsetResult) -> None:
    """Print the verdict, the faults, every shape at its best onset, and the notes."""
    from rich.table import Table
    from rich.text import Text

    console.print(Text(verdict(result), style=COLOURS[result.decision]))
    if result.faults:
        console.print(_faults(result))
    console.print(_shapes(result))
    grid = Table.grid(padding=(0, 2))
    for name, value in (*summary_rows(result), *(("Note", note) for note in result.notes)):
        grid.add_row(Text(name, style="dim"), Text(value))
    console.print(grid)


def verdict(result: OnsetResult) -> str:
    """Return the answer in one sentence."""
    if not result.faults:
        return f"No fault stands out at a false-alarm rate of {number(100.0 * result.false_alarm)} %."
    said = "; ".join(f"{describe(one.estimate)}, onset {_onset(one)}" for one in result.faults)
    return f"Fault: {said}." if len(result.faults) == 1 else f"{len(result.faults)} faults: {said}."


def _onset(one: OnsetFault) -> str:
    return f"{interval(one.onset_ci95)} s"


def summary_rows(result: OnsetResult) -> list[tuple[str, str]]:
    """Return log, model and calibration as (name, value)."""
    log, model, use = result.log, result.model, result.calibration
    rows = [
        ("Log", log.path),
        ("Window", f"{log.start_s:.6g} to {log.stop_s:.6g} s, {log.n_samples} samples at {number(log.rate_hz)} Hz"),
        ("Model", f"VARX of order {model.order}, inputs {', '.join(model.inputs)}"),
        ("Noise", ", ".join(f"{name} {number(sd, digits=2)}" for name, sd in model.noise_sd.items())),
    ]
    if use is not None:
        fits = "made for these settings" if use.matches else "made for other settings"
        rows.append(("Calibration", f"{use.source}, {use.n_windows} windows, {fits}"))
        rows.append(("p-value", number(result.p_value, digits=2)))
    return rows


def _faults(result: OnsetResult) -> Table:
    heads = ("fault", "channel", "onset", "95 % interval", "until", "magnitude", "95 % interval")
    body = []
    for one in result.faults:
        estimate, fault = one.estimate, one.estimate.fault
        spread = 0.5 * (one.onset_ci95[1] - one.onset_ci95[0])
        until = "-" if fault.offset_s is None else f"{fault.offset_s:.5g} s"
        size = number(estimate.magnitude, spread=1.96 * estimate.sd, extra=1)
        shape = fault.shape if fault.frequency_hz is None else f"{fault.shape} {number(fault.frequency_hz)} Hz"
        when = (f"{number(fault.onset_s, spread=spread)} s", interval(one.onset_ci95), until)
        body.append((shape, fault.channel, *when, f"{size} {estimate.unit}".rstrip(), interval(estimate.ci95)))
    return _table(heads, body)


def _shapes(result: OnsetResult) -> Table:
    heads = ("shape", "channel", "best onset", "magnitude", "statistic", "threshold")
    body = []
    for one in result.profiles:
        best = int(one.statistic.argmax())
        shape = one.shape if one.frequency_hz is None else f"{one.shape} {number(one.frequency_hz)} Hz"
        size = f"{number(float(one.magnitude[best]))} {one.unit}".rstrip()
        peak = number(float(one.statistic[best]))
        body.append((shape, one.channel, f"{one.onset_s[best]:.5g} s", size, peak, number(one.threshold)))
    return _table(heads, body)


def _table(heads: Sequence[str], body: Sequence[Sequence[str]]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for head in heads:
        table.add_column(head, overflow="fold")
    for row in body:
        table.add_row(*(Text(shortened(cell, 40)) for cell in row))
    return table
