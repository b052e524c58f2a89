"""`bfi start-time`: when a fault started, and of which shape it is."""

from __future__ import annotations

from functools import partial

from .analysis import Answer, Asked, analysis
from .options import ANSWER, MODEL, SIGNALS, VERDICT, log_argument
from .output import note


@analysis(
    "start-time",
    log_argument,
    *("config_path", "shapes", "false_alarm", "calibration", "ends", "samples", "frequency", "scan_method"),
    *(*SIGNALS, "fix_units", *MODEL, *VERDICT, "prove", "seed", "workers", *ANSWER),
)
def command(asked: Asked) -> Answer:
    """Say when a fault started in LOG, which shape it has, how large it is and how sure that is."""
    from ..library import start_time
    from ..model.onset import onset_content, onset_document

    asked.check_out(("hidden", "profile", "outputs"), ("faults", "candidates", "profile", "shapes", "proved"))
    flight = asked.flight()
    result = start_time(flight, asked.config, prove=asked.proving(), progress=asked.progress, tell=note)
    return Answer(
        document=partial(onset_document, result),
        content=onset_content,
        log_sha256=flight.sha256,
        decided=result,
    )
