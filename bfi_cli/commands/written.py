"""What the commands that make a log have in common: the file, and a few lines or a JSON document about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .answered import show_lines
from .options import force_option

if TYPE_CHECKING:
    from ..faults import Fault
    from ..flightlog import FlightLog
    from ..provenance import Provenance

__all__ = ["SCHEMA", "log_document", "log_lines", "out_option", "write_and_show"]

SCHEMA = 1


def out_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add -o/--output, the log file to write, and --force, passed as the path `out` and `force`."""
    path = click.Path(path_type=Path)
    return click.option(
        "-o", "--output", "out", required=True, metavar="OUT", type=path, help="The file to write, .h5 or .csv."
    )(force_option(command))


def write_and_show(log: FlightLog, out: Path, *, kind: str, as_json: bool, log_sha256: str = "", seed: int = 0) -> None:
    """Write a log to `out`, and print what it holds: the JSON document of `kind`, or lines.

    Parameters
    ----------
    log_sha256 : of the log it was made from, "" where there was none.
    seed : of the random steps.
    """
    from ..flightlog import write_log
    from ..provenance import provenance

    write_log(log, out)
    log = replace(log, path=str(out))
    document = log_document(log, provenance(log_sha256=log_sha256, seed=seed), kind=kind)
    show_lines(document, log_lines(log), as_json=as_json)


def log_document(log: FlightLog, provenance: Provenance, *, kind: str) -> dict[str, Any]:
    """Return the JSON document of a command that makes a log; `truth` is None where the log carries none."""
    from ..faults import fault_to_dict

    return {
        "kind": kind,
        "schema": SCHEMA,
        "path": log.path,
        "n_samples": log.n_samples,
        "rate_hz": log.rate_hz,
        "channels": [{"name": channel.name, "unit": channel.unit} for channel in log.channels.values()],
        "truth": None if log.truth is None else {"faults": [fault_to_dict(fault) for fault in log.truth.faults]},
        "notes": log.notes,
        "provenance": provenance,
    }


def log_lines(log: FlightLog) -> list[str]:
    """Return what the log holds: a summary, then one line per fault and note."""
    names = ", ".join(f"{channel.name} [{channel.unit or '?'}]" for channel in log.channels.values())
    faults = log.truth.faults if log.truth else ()
    return [
        f"{log.path}: {log.n_samples} samples at {log.rate_hz:.6g} Hz: {names}",
        *(_fault_line(log, fault) for fault in faults),
        *(f"note: {note}" for note in log.notes),
    ]


def _fault_line(log: FlightLog, fault: Fault) -> str:
    from ..faults import magnitude_unit

    unit = magnitude_unit(fault, log.channel(fault.channel).unit)
    until = "" if fault.offset_s is None else f" until {fault.offset_s:g} s"
    label = fault.shape if fault.name is None else f"{fault.name} ({fault.shape})"
    size = f"{fault.magnitude:g} {unit}".rstrip()
    return f"fault: {label} on {fault.channel}, magnitude {size}, from {fault.onset_s:g} s{until}"
