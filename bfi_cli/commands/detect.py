"""`bfi detect`: which channel of a log fails, and when, without a dictionary."""

from __future__ import annotations

from functools import partial

from .analysis import Answer, Asked, analysis
from .options import ANSWER, CHANNELS, VERDICT, log_argument
from .output import note


@analysis(
    "detect",
    log_argument,
    *("config_path", "train", "inputs", "outputs", "detect_false_alarm", "detect_method", "turns"),
    *("from_s", "to_s", *CHANNELS, "fix_units", "rate", "recorder", *VERDICT, *ANSWER),
    inputs="An input; repeatable.  [default: controls and accelerations]",
    outputs="An output to watch; repeatable.  [default: of the log]",
    require="Kinds of fault that must be excluded for a no_fault; only abrupt ones are looked for.  [default: all]",
    strict="Exit 4 where the log cannot tell, or the threshold cannot be trusted.",
    fail_on="Exit 10 where a channel fails.",
)
def command(asked: Asked) -> Answer:
    """Say which channel of LOG fails, and when: null-space detection, without a model and without a dictionary.

    What is healthy is learnt from the time --train; the threshold is calibrated on a part of it that was held back.
    """
    from ..detection import detect_content, detect_document
    from ..library import detect

    asked.check_out(("hidden", "detection"), ("alarms", "candidates", "channels"))
    flight = asked.flight()
    result = detect(flight, asked.config, progress=asked.progress, tell=note)
    return Answer(
        document=partial(detect_document, result),
        content=detect_content,
        log_sha256=flight.sha256,
        decided=result,
    )
