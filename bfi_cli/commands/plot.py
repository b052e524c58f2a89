"""`bfi plot`: the channels of a log over time, with the phases of the flight, windows to analyse and known events."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import click

from ..errors import ConfigError
from ..notes import Note
from .analysis import Answer, Asked, analysis, source_of
from .options import CHANNELS, logs_argument, pairs

MAPPED = pairs("tas=my_airspeed")
FILE_OPTIONS = tuple(key for key in CHANNELS if key != "channel_map")  # here --channel also names channels to draw


def _channels(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> Any:
    """Return the names in the file of channels given as STD=NAME; the other texts become `channels`, those to draw.

    A name in a file may hold an equals sign; a standard name is a plain word.
    """
    mapped = tuple(text for text in texts if re.match(r"\s*\w+\s*=", text))
    context.params["channels"] = tuple(text for text in texts if text not in mapped)
    return MAPPED(context, option, mapped)


def _shift(_context: click.Context, _option: click.Parameter, text: str | None) -> float | str | None:
    """Return seconds, "auto" or None."""
    if text in (None, "auto"):
        return text
    try:
        if math.isfinite(shift := float(str(text))):
            return shift
    except ValueError:
        pass
    raise ConfigError(f"--align: not a shift, got '{text}'; write --align 3.2, in s, or --align auto")


def _check(options: Mapping[str, Any]) -> None:
    if (options["diff"] or options["align"] is not None) and len(options["logs"]) != 2:
        flag = "--diff" if options["diff"] else "--align"
        raise ConfigError(f"bfi plot: {flag} is about two logs, got {len(options['logs'])}; give two")
    if options["out"] is None and not options["as_json"]:
        raise ConfigError("bfi plot: --out is missing; give --out DIR, or --json for phases and windows alone")


@analysis(
    "plot",
    logs_argument,
    click.option(
        *("--channel", "channel_map"),
        metavar="NAME|STD=NAME",
        multiple=True,
        callback=_channels,
        help="Draw this channel; repeatable. STD=NAME takes the channel NAME of the file as STD.  [default: airspeed, "
        "altitude, attitude, angle of attack, normal acceleration, elevator, throttle]",
    ),
    *("config_path", *FILE_OPTIONS, "from_s", "to_s", "allow_outside"),
    click.option(
        *("--events", "results"),
        metavar="RESULT.json",
        multiple=True,
        type=click.Path(),
        help="Draw what this result of identify, start-time, detect or diagnose declares and suspects; repeatable.",
    ),
    click.option("--diff", is_flag=True, help="Of two logs, draw the channels of the second less those of the first."),
    click.option(
        "--align",
        metavar="S|auto",
        callback=_shift,
        help="Add this many seconds to the times of the second log; auto: those for which their channels agree best.",
    ),
    *("units", "out", "force", "as_json", "series"),
    check=_check,
    out="Write figures, zoom.html, report, tables and result; needed without --json.",
)
def command(asked: Asked) -> Answer:
    """Draw the channels of one LOG, or of several over each other, before anything is analysed.

    Above the channels stand the phases of the flight, its manoeuvres, the windows that are worth an analysis, ranked,
    and the events of stored results. zoom.html shows the same in a browser, to zoom and to move; it needs no network.
    With --diff two recorders of one flight are compared, on common time.
    Of a configuration file counts what says how the logs are read, its window and the units to show.
    """
    from ..flightlog import read_log
    from ..report.difference import shifted, time_shift
    from ..report.log_plots import (
        MOST_PANELS,
        channels_to_plot,
        moved,
        plot_content,
        plot_document,
        plot_logs,
        read_events,
        shared_channels,
    )

    names, window, diff = asked.options["channels"], asked.config.window, asked.options["diff"]
    align, shift_s = asked.options["align"], 0.0
    pages = range(1, -(-len(names) // MOST_PANELS))
    kinds = ("channels", "differences") if diff else ("channels",)
    figures = tuple(name for kind in kinds for name in (kind, *(f"{kind}_{i + 1}" for i in pages)))
    asked.check_out(figures, (*kinds[1:], "events", "windows", "phases"), zoom=True)
    results = [(path, *read_events(path)) for path in asked.options["results"]]
    # Logs with different clocks are read whole: the window is known only after the shift.
    part = {"from_s": window.from_s, "to_s": window.to_s} if align is None else {}
    reading = {**part, **source_of(asked.config)}
    flights = [read_log(log, **reading) for log in asked.options["logs"]]
    known = {flight.sha256 for flight in flights}
    events = [event for _, events, _ in results for event in events]
    if align is not None:
        first, second = flights
        chosen = shared_channels(first, second, channels_to_plot(first, names, events))
        shift_s = time_shift(first, second, chosen) if align == "auto" else align
        flights[1] = shifted(second, shift_s)
        from_second = [sha256 == second.sha256 != first.sha256 for _, events, sha256 in results for _ in events]
        events = [moved(event, shift_s) if late else event for event, late in zip(events, from_second, strict=True)]
    events.sort(key=lambda event: event.onset_s)
    notes = [
        Note.method(f"{path} is the result of another log than those drawn, its events may not fit")
        for path, _, sha256 in results
        if sha256 and sha256 not in known
    ]
    part_s = (window.from_s, window.to_s)
    result = plot_logs(flights, names, events, part_s=part_s, diff=diff, shift_s=shift_s, notes=notes)
    return Answer(
        document=partial(plot_document, result),
        content=plot_content,
        log_sha256=" ".join(flight.sha256 for flight in flights),
    )
