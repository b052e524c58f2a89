"""`bfi plot`: the channels of a log over time, with the phases of the flight, windows to analyse and known events."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import click

from ..errors import ConfigError
from ..notes import Note
from .analysis import Answer, Asked, analysis, source_of
from .options import CHANNELS, logs_argument, pairs

MAPPED = pairs("tas=my_airspeed")
OF_THE_FILE = tuple(key for key in CHANNELS if key != "channel_map")  # that one shares --channel with what to draw


def _channels(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> Any:
    """Return the names in the file of channels that are given as STD=NAME; the others, `channels`, are to be drawn.

    A name in a file may hold an equals sign; a standard name is one plain word.
    """
    mapped = tuple(text for text in texts if re.match(r"\s*\w+\s*=", text))
    context.params["channels"] = tuple(text for text in texts if text not in mapped)
    return MAPPED(context, option, mapped)


def _check(options: Mapping[str, Any]) -> None:
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
    *("config_path", *OF_THE_FILE, "from_s", "to_s", "allow_outside"),
    click.option(
        *("--events", "results"),
        metavar="RESULT.json",
        multiple=True,
        type=click.Path(),
        help="Draw what this result of identify, start-time, detect or diagnose declares and suspects; repeatable.",
    ),
    *("units", "out", "force", "as_json", "series"),
    check=_check,
    out="Write figures, zoom.html, report, tables and result; needed without --json.",
)
def command(asked: Asked) -> Answer:
    """Draw the channels of one LOG, or of several over each other, before anything is analysed.

    Above the channels stand the phases of the flight, its manoeuvres, the windows that are worth an analysis, ranked,
    and the events of stored results. zoom.html shows the same in a browser, to zoom and to move; it needs no network.
    Of a configuration file counts what says how the logs are read, its window and the units to show.
    """
    from ..flightlog import read_log
    from ..flightlog.plot import MOST_PANELS, plot_content, plot_document, read_events

    names, window = asked.options["channels"], asked.config.window
    pages = range(1, -(-len(names) // MOST_PANELS))
    figures = ("channels", *(f"channels_{i + 1}" for i in pages))
    asked.check_out(figures, ("events", "windows", "phases"), zoom=True)
    found = [(path, *read_events(path)) for path in asked.options["results"]]
    reading = {"from_s": window.from_s, "to_s": window.to_s, **source_of(asked.config)}
    flights = [read_log(log, **reading) for log in asked.options["logs"]]
    known = {flight.sha256 for flight in flights}
    events = sorted((event for _, events, _ in found for event in events), key=lambda one: one.onset_s)
    notes = [
        Note.method(f"{path} is the result of another log than those drawn, its events may not fit")
        for path, _, sha256 in found
        if sha256 and sha256 not in known
    ]
    return Answer(
        document=lambda origin: plot_document(
            flights, names, events, origin, from_s=window.from_s, to_s=window.to_s, notes=notes
        ),
        content=plot_content,
        log_sha256=" ".join(flight.sha256 for flight in flights),
    )
