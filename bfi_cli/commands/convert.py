"""`bfi convert`: any readable log to HDF5 or CSV."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..flightlog import read_log, resample, write_log
from ..flightlog.resampling import with_reach
from .options import channel_options, log_argument, window_options
from .written import echo_written, json_option, out_option

__all__ = ["command"]


@click.command("convert")
@log_argument
@out_option
@click.option("--rate", "rate_hz", type=float, metavar="HZ", help="Low-pass filter and resample to this rate.")
@channel_options
@window_options
@json_option
def command(
    log: str, out: Path, rate_hz: float | None, from_s: float | None, to_s: float | None, as_json: bool, **source: Any
) -> None:
    """Write a log as HDF5 or CSV, under standard names and in SI units, resampled with --rate."""
    first_s, last_s = with_reach(rate_hz, from_s, to_s)
    flight = read_log(log, from_s=first_s, to_s=last_s, **source)
    flight = flight.window(from_s, to_s) if rate_hz is None else resample(flight, rate_hz, from_s=from_s, to_s=to_s)
    write_log(flight, out)
    echo_written(flight, out, kind="convert", log_sha256=flight.sha256, seed=0, as_json=as_json)
