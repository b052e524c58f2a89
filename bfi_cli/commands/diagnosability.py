"""`bfi diagnosability`: how well each fault can be seen and told from the others, in a log or before the flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from .options import MODEL, OPTIONS, SIGNALS, config_of, inputs_of, log_of, settled, units_of, with_options
from .output import emit
from .progress import progress

if TYPE_CHECKING:
    from ..config import Config

__all__ = ["command"]

FLIGHT = ("manoeuvres", "noise", "amplitude_rad", "start_s", "unit_step_s", "flight_s", "turbulence_m_s", "draws")


@click.command("diagnosability")
@click.argument("log", metavar="[LOG]", type=click.Path(), required=False)
@with_options(
    *("config_path", "dictionary", "magnitudes", "at_limit", "flown_model", *FLIGHT, *SIGNALS, *MODEL, "seed"),
    *("allow_outside", "units", "out", "force", "progress", "as_json", "series"),
    dictionary="YAML dictionary of the faults.",
    seed="Random seed of the noise of a model.  [default: 0]",
)
def command(log: str | None, config_path: str | None, **options: Any) -> None:
    """Say how well each fault of a dictionary can be seen in LOG, a log without faults, and told from the others.

    Divergences are in bits: 0 cannot be told, 1 is certain. Before a flight, --model in place of LOG compares
    manoeuvres: --model citation --noise tas=0.01 --manoeuvre 3211 --manoeuvre doublet.
    """
    from threadpoolctl import threadpool_limits

    from .. import diagnosability
    from ..files import check_folder
    from ..provenance import provenance
    from ..report.files import content_names

    config = config_of(config_path, {**options, "magnitude": options["magnitudes"].pop("", None)})
    _check_flight(log, config, options)
    dictionary = config.load_dictionary(allow_outside=options["allow_outside"])
    if dictionary is None:
        raise ConfigError("--dictionary: no dictionary given; name one, such as airdata or a YAML file")
    inputs = inputs_of(config, log, dictionary=dictionary)
    if options["out"] is not None:
        names = content_names(("divergence", "information", "manoeuvres"), ("faults", "manoeuvres"))
        check_folder(options["out"], names, inputs=inputs, force=options["force"])
    log_sha256 = ""
    with threadpool_limits(1):
        if log is not None:
            flight = log_of(log, config)
            config, notes = settled(flight, config)
            dictionary = config.load_dictionary(allow_outside=options["allow_outside"]) or dictionary
            result = diagnosability.assess(flight, dictionary, config)
            result = replace(result, notes=(*notes, *result.notes))
            log_sha256 = flight.sha256
        else:
            with progress("records", wanted=options["progress"]) as report:
                result = diagnosability.assess_manoeuvres(dictionary, config, report=report)
    origin = provenance(
        log_sha256=log_sha256, config_sha256=config.sha256, dictionary_sha256=dictionary.sha256, seed=config.seed
    )
    document = diagnosability.diagnosability_document(result, origin)
    content_in, units = partial(diagnosability.diagnosability_content, document), units_of(config.shown_units)
    emit(content_in, document, options, units=units, origin=origin, inputs=inputs)


def _check_flight(log: str | None, config: Config, options: Mapping[str, Any]) -> None:
    """Check that either a log or the flight of a model is asked for."""
    if log is None and config.diagnosability.model is None:
        raise click.UsageError("needs a LOG or a --model, got nothing; give one of the two")
    if log is not None and options["flown_model"] is not None:
        raise click.UsageError("needs a LOG or a --model, got both; give one of the two")
    for name in FLIGHT if log is not None else ():
        if options[name] not in (None, (), {}):
            flag = OPTIONS[name].flags[0]
            raise click.UsageError(f"{flag} is about the flight of a model; give --model in place of the log")
