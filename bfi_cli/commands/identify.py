"""`bfi identify`: which faults of a dictionary are in a log."""

from __future__ import annotations

from functools import partial

from .analysis import Answer, Asked, analysis, saying_first
from .options import ANSWER, MODEL, SIGNALS, VERDICT, log_argument


@analysis(
    "identify",
    log_argument,
    *("config_path", "dictionary", "onset_tolerance", *SIGNALS, "fix_units", *MODEL, *VERDICT),
    *("method", "sparsity", "model", "seed", *ANSWER),
)
def command(asked: Asked) -> Answer:
    """Say which faults of a dictionary are in LOG, how large they are and how sure that is.

    Without a dictionary the scan over all onsets (bfi start-time) proposes the faults.
    """
    from ..analysis import identify
    from ..identify.document import identify_document
    from ..identify.report import DRAWINGS, TABLES, identify_content

    asked.check_out(DRAWINGS, TABLES)
    flight, asked = asked.read()
    with saying_first(asked.findings):
        result, dictionary = identify(flight, asked.dictionary, asked.config, asked.progress)
    result = asked.noted(result)
    return Answer(
        document=partial(identify_document, result),
        content=lambda _document, units: identify_content(result, units),
        log_sha256=flight.sha256,
        dictionary=dictionary,
        decided=result,
    )
