"""`bfi convert`: any readable log to HDF5, CSV or MCAP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..files import check_files
from ..flightlog import read_log, resample
from ..flightlog.resampling import with_reach
from .options import CHANNELS, log_argument, with_options
from .output import write_and_show


@click.command("convert")
@with_options(
    log_argument,
    *("out_file", "force"),
    click.option("--rate", "rate_hz", type=float, metavar="HZ", help="Low-pass filter and resample to this rate."),
    click.option(
        "--corrected",
        metavar="RESULT.json",
        type=click.Path(path_type=Path),
        help="Without the faults that this result of diagnose declares, measured channels and flags of events beside.",
    ),
    *(*CHANNELS, "from_s", "to_s", "units", "as_json"),
)
def command(
    *,
    log: str,
    rate_hz: float | None,
    corrected: Path | None,
    from_s: float | None,
    to_s: float | None,
    **options: Any,
) -> None:
    """Write a log as HDF5 or CSV, under standard names and in SI units, resampled with --rate.

    As OUT.mcap it opens in Foxglove and PlotJuggler: one topic of JSON messages with the channels.
    """
    inputs: list[str | Path] = [log] if corrected is None else [log, corrected]
    check_files([options["out_file"]], inputs=inputs, force=options["force"])
    first_s, last_s = with_reach(rate_hz, from_s, to_s)
    flight = read_log(log, from_s=first_s, to_s=last_s, **{name: options[name] for name in CHANNELS})
    flight = flight.window(from_s, to_s) if rate_hz is None else resample(flight, rate_hz, from_s=from_s, to_s=to_s)
    if corrected is not None:
        from ..flight.corrected import corrected_log, events_to_correct

        flight = corrected_log(flight, events_to_correct(corrected, flight))
    write_and_show(flight, options, kind="convert", log_sha256=flight.sha256)
