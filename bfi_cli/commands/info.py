"""`bfi info`: what a log holds and what it is good for."""

from __future__ import annotations

from functools import partial

from .analysis import Answer, Asked, analysis, source_of
from .fleet import answer_fleet
from .options import CHANNELS, FILES, FLEET, fleet_argument
from .output import note


@analysis(
    "info",
    fleet_argument,
    *("config_path", *CHANNELS, "fix_units", "from_s", "to_s", "explain", *FILES, "as_json", *FLEET),
    many=answer_fleet,
)
def command(asked: Asked) -> Answer:
    """Show channels, units, rate, gaps, held samples, excitation of each LOG, its phases and windows to analyse.

    Of a configuration file counts what says how the log is read, its window and the units to show.

    Of several logs, or a folder of logs, a line each; --out DIR keeps what is done, and continues.
    """
    from ..flightlog import inspect_log, read_log
    from ..flightlog.defects import find_defects
    from ..flightlog.quality import with_seen_recorder
    from ..library import with_findings
    from ..report.log import explained, info_content, info_document

    tables = ("channels", "derived", "phases", "excitation", "windows", "segments", "explain")
    asked.check_out(("phases",), tables)
    window = asked.config.window
    flight = read_log(asked.log, from_s=window.from_s, to_s=window.to_s, **source_of(asked.config))
    flight, findings = with_findings(flight.window(window.from_s, window.to_s), asked.config, note)
    report, defects = inspect_log(flight), find_defects(with_seen_recorder(flight))
    return Answer(
        document=partial(
            info_document, report, defects, findings, explain=explained(flight) if asked.options["explain"] else None
        ),
        content=info_content,
        log_sha256=flight.sha256,
    )
