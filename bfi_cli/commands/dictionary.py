"""`bfi dictionary`: audit of a fault dictionary, by itself or on a log."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import click

from .analysis import Answer, Asked, analysis
from .options import CHANNELS, FILES, OPTIONS
from .output import note

LOG_OPTIONS = ("inputs", "outputs", "order", *CHANNELS)


def _check(options: Mapping[str, Any]) -> None:
    """Refuse options about a log without one, and the one about an audit without a log."""
    if not options["dictionary"]:
        raise click.UsageError("the name FILE is empty; give a dictionary, such as airdata or a YAML file")
    for name in LOG_OPTIONS if options["log"] is None else ():
        if options[name]:
            raise click.UsageError(f"{OPTIONS[name].flags[0]} is about a log; give one after the dictionary")
    if options["log"] is not None and options["duration_s"] is not None:
        raise click.UsageError("--duration is for an audit without a log; give --from and --to")


@analysis(
    "dictionary",
    click.argument("dictionary", metavar="FILE", type=click.Path()),
    click.argument("log", metavar="[LOG]", type=click.Path(), required=False),
    *("config_path", "inputs", "outputs", "from_s", "to_s", "duration_s", *CHANNELS, "rate", "order"),
    *(*FILES, "as_json", "series"),
    check=_check,
)
def command(asked: Asked) -> Answer:
    """Say what the faults of the dictionary FILE are, which are alike, and on a LOG how large each must be."""
    from ..audit import audit_content, audit_dictionary, audit_document, audit_on_log
    from ..audit.report import DRAWINGS, TABLES

    dictionary, log_sha256 = asked.dictionary, ""
    assert dictionary is not None
    asked.check_out(DRAWINGS, TABLES)
    if asked.has_log:
        from ..library import noted, ready_log
        from ..threads import one_thread

        log, config, notes, findings = ready_log(asked.flight(), asked.config, note)
        dictionary, log_sha256 = asked.dictionary_of(config) or dictionary, log.sha256
        with one_thread():
            audit = noted(audit_on_log(log, dictionary, config), notes, findings)
    else:
        audit = audit_dictionary(dictionary, asked.config, duration_s=asked.config.audit.duration_s)
    return Answer(
        document=partial(audit_document, audit),
        content=audit_content,
        log_sha256=log_sha256,
        dictionary=dictionary,
    )
