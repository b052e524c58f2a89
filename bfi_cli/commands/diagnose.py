"""`bfi diagnose`: which air-data fault hit a flight, when, how large and how sure, in one go."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from .analysis import Answer, Asked, analysis, log_of
from .fleet import answer_fleet
from .options import ANSWER, CHANNELS, FLEET, fleet_argument
from .output import note


@analysis(
    "diagnose",
    fleet_argument,
    *("config_path", "from_s", "to_s", *CHANNELS, "fix_units", "recorder", "require", "tolerance"),
    *("diagnose_false_alarm", "diagnose_calibration", "judge", "events", "prove", "seed", *ANSWER, *FLEET),
    click.option(
        "--events-csv",
        metavar="FILE",
        type=click.Path(path_type=Path),
        help="Write a row for each event, for PlotJuggler or a spreadsheet.",
    ),
    "by",
    many=answer_fleet,
    from_s="Start of the part that is diagnosed.  [default: take-off]",
    to_s="End of it, in the log's seconds.  [default: landing]",
    strict="Exit 4 where the log cannot tell.",
    fail_on="Exit 10 where a fault is declared; deviation: also where an error within its tolerance is.",
)
def command(asked: Asked) -> Answer:
    """Say which air-data fault hit the flight of each LOG, when, how large and how sure: every analysis that it allows.

    Pressures that must agree, lines that must not hold still, and lift, climb, inertial acceleration and ground speed,
    which bound the air data without a model of the aircraft; steps and oscillations by the scan over all onsets.

    Of several logs, or a folder of logs, a line each, faults first; --out DIR keeps what is done, and continues.
    """
    from ..config import merge
    from ..files import aside, check_files
    from ..flight import diagnose_content, diagnose_document
    from ..flight.report import events_csv
    from ..library import diagnose

    asked.check_out(("timeline",), ("events", "deviations", "limits", "phases", "proved"), zoom=True)
    listed = asked.options["events_csv"]
    if listed is not None:
        check_files([listed], inputs=asked.inputs, force=asked.options["force"], option="--events-csv")
    # The whole log, whatever part is diagnosed: the angle of zero lift is estimated from the rest of the flight.
    flight = log_of(asked.log, merge(asked.config, {"window": {"from_s": None, "to_s": None}}))
    result = diagnose(
        flight, asked.config, workers=asked.workers, prove=asked.proving(), progress=asked.progress, tell=note
    )
    if listed is not None:
        with aside(listed.parent, place=listed, option="--events-csv") as new:
            (new / listed.name).write_bytes(events_csv(result.events))
    return Answer(
        document=partial(diagnose_document, result),
        content=diagnose_content,
        log_sha256=flight.sha256,
        decided=result,
        deviates=bool(result.deviations),
        log=flight,
    )
