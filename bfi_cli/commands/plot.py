"""`bfi plot`: the channels of a log over time, with the phases of the flight, windows to analyse and known events."""

from __future__ import annotations

import re
from functools import partial
from typing import Any

import click

from ..errors import ConfigError
from .options import CHANNELS, config_of, inputs_of, pairs, source_of, units_of, with_options
from .output import emit

__all__ = ["command"]

MAPPED = pairs("tas=my_airspeed")
OF_THE_FILE = tuple(key for key in CHANNELS if key != "channel_map")  # that one shares --channel with what to draw


def _channels(context: click.Context, option: click.Parameter, texts: tuple[str, ...]) -> Any:
    """Return the channels to draw, and the names in the file of those that are given as STD=NAME.

    A name in a file may hold an equals sign; a standard name is one plain word.
    """
    mapped = tuple(text for text in texts if re.match(r"\s*\w+\s*=", text))
    return tuple(text for text in texts if text not in mapped), MAPPED(context, option, mapped)


@click.command("plot")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path())
@click.option(
    "--channel",
    "channels",
    metavar="NAME|STD=NAME",
    multiple=True,
    callback=_channels,
    help="Draw this channel; repeatable. STD=NAME takes the channel NAME of the file as STD.  [default: airspeed, "
    "altitude, attitude, angle of attack, normal acceleration, elevator, throttle]",
)
@with_options("config_path", *OF_THE_FILE, "from_s", "to_s", "allow_outside")
@click.option(
    "--events",
    "results",
    metavar="RESULT.json",
    multiple=True,
    type=click.Path(),
    help="Draw what this result of identify, start-time, detect or diagnose declares and suspects; repeatable.",
)
@with_options(
    *("units", "out", "force", "as_json", "series"),
    out="Write figures, zoom.html, report, tables and result; needed without --json.",
)
def command(
    logs: tuple[str, ...],
    channels: tuple[tuple[str, ...], dict[str, str]],
    results: tuple[str, ...],
    config_path: str | None,
    **options: Any,
) -> None:
    """Draw the channels of one LOG, or of several over each other, before anything is analysed.

    Above the channels stand the phases of the flight, its manoeuvres, the windows that are worth an analysis, ranked,
    and the events of stored results. zoom.html shows the same in a browser, to zoom and to move; it needs no network.
    Of a configuration file counts what says how the logs are read, its window and the units to show.
    """
    if options["out"] is None and not options["as_json"]:
        raise ConfigError("bfi plot: --out is missing; give --out DIR, or --json for phases and windows alone")
    from ..flightlog import read_log
    from ..flightlog.events import read_events
    from ..flightlog.plot import MOST_PANELS, plot_content, plot_document
    from ..provenance import provenance

    names, channel_map = channels
    config = config_of(config_path, {**options, "channel_map": channel_map})
    inputs, from_s, to_s = (*inputs_of(config, *logs), *results), config.window.from_s, config.window.to_s
    if options["out"] is not None:
        from ..files import check_folder
        from ..report.files import content_names

        pages = range(1, -(-len(names) // MOST_PANELS))
        files = content_names(
            ("channels", *(f"channels_{i + 1}" for i in pages)), ("events", "windows", "phases"), zoom=True
        )
        check_folder(options["out"], files, inputs=inputs, force=options["force"])
    found = [(path, *read_events(path)) for path in results]
    flights = [read_log(log, from_s=from_s, to_s=to_s, **source_of(config)) for log in logs]
    known = {flight.sha256 for flight in flights}
    origin = provenance(log_sha256=" ".join(flight.sha256 for flight in flights), config_sha256=config.sha256)
    document = plot_document(
        flights,
        names,
        sorted((event for _, events, _ in found for event in events), key=lambda one: one.onset_s),
        origin,
        from_s=from_s,
        to_s=to_s,
        notes=[
            f"{path} is the result of another log than those drawn, its events may not fit"
            for path, _, sha256 in found
            if sha256 and sha256 not in known
        ],
    )
    content_in, units = partial(plot_content, document), units_of(config.shown_units)
    emit(content_in, document, options, units=units, origin=origin, inputs=inputs)
