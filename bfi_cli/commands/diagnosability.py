"""`bfi diagnosability`: how well each fault can be seen and told from the others, in a log or before the flight."""

from __future__ import annotations

from functools import partial

import click

from ..errors import ConfigError
from .analysis import Answer, Asked, analysis
from .options import FILES, MODEL, OPTIONS, SIGNALS
from .output import note

FLIGHT = ("manoeuvres", "noise", "amplitude_rad", "start_s", "unit_step_s", "flight_s", "turbulence_m_s", "draws")


@analysis(
    "diagnosability",
    click.argument("log", metavar="[LOG]", type=click.Path(), required=False),
    *("config_path", "dictionary", "magnitudes", "at_limit", "flown_model", *FLIGHT, *SIGNALS, *MODEL, "seed"),
    *(*FILES, "progress", "as_json", "series"),
    dictionary="YAML dictionary of the faults.",
    seed="Random seed of the noise of a model.  [default: 0]",
)
def command(asked: Asked) -> Answer:
    """Say how well each fault of a dictionary can be seen in LOG, a log without faults, and told from the others.

    Divergences are in bits: 0 cannot be told, 1 is certain. Before a flight, --model in place of LOG compares
    manoeuvres: --model citation --noise tas=0.01 --manoeuvre 3211 --manoeuvre doublet.
    """
    from .. import diagnosability
    from ..library import noted, ready_log
    from ..threads import one_thread

    _check_flight(asked)
    dictionary, log_sha256 = asked.dictionary, ""
    if dictionary is None:
        raise ConfigError("--dictionary: no dictionary given; name one, such as airdata or a YAML file")
    asked.check_out(("divergence", "information", "manoeuvres"), ("faults", "manoeuvres"))
    with one_thread():
        if asked.has_log:
            log, config, notes, findings = ready_log(asked.flight(), asked.config, note)
            dictionary, log_sha256 = asked.dictionary_of(config) or dictionary, log.sha256
            result = noted(diagnosability.assess(log, dictionary, config), notes, findings)
        else:
            result = diagnosability.assess_manoeuvres(
                dictionary,
                asked.config,
                report=lambda done, total: asked.progress("records", done / total),
            )
    return Answer(
        document=partial(diagnosability.diagnosability_document, result),
        content=diagnosability.diagnosability_content,
        log_sha256=log_sha256,
        dictionary=dictionary,
    )


def _check_flight(asked: Asked) -> None:
    """Check that either a log or the flight of a model is asked for."""
    if not asked.has_log and asked.config.diagnosability.model is None:
        raise click.UsageError("needs a LOG or a --model, got nothing; give one of the two")
    if asked.has_log and asked.options["flown_model"] is not None:
        raise click.UsageError("needs a LOG or a --model, got both; give one of the two")
    for name in FLIGHT if asked.has_log else ():
        if asked.options[name] not in (None, (), {}):
            flag = OPTIONS[name].flags[0]
            raise click.UsageError(f"{flag} is about the flight of a model; give --model in place of the log")
