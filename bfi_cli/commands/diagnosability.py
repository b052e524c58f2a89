"""`bfi diagnosability`: how well each fault can be seen and told from the others, in a log or before the flight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigError
from .options import (
    channel_options,
    configured,
    inputs_of,
    log_of,
    number_or_word,
    out_options,
    outside_option,
    progress_option,
    series_option,
    window_options,
)
from .output import emit
from .progress import progress

if TYPE_CHECKING:
    from ..config import Config
    from ..diagnosability import DiagnosabilityResult
    from ..dictionary import Dictionary

__all__ = ["command"]

FLIGHT = {
    "manoeuvres": "--manoeuvre",
    "noise": "--noise",
    "amplitude_rad": "--amplitude",
    "start_s": "--start",
    "step_s": "--step",
    "duration_s": "--duration",
    "turbulence_m_s": "--turbulence",
    "draws": "--draws",
}


@click.command("diagnosability")
@click.argument("log", metavar="[LOG]", type=click.Path(), required=False)
@click.option("-c", "--config", "config_path", metavar="FILE", help="YAML configuration; the command line wins.")
@click.option("-d", "--dictionary", metavar="FILE", help="YAML dictionary of the faults.")
@click.option(
    "--magnitude",
    "magnitudes",
    multiple=True,
    metavar="Z|NAME=Z",
    help="Root mean square of all magnitudes, or of one fault's; repeatable.  [default: 1]",
)
@click.option(
    "--at-limit", is_flag=True, default=None, help="Magnitudes count in minimal detectable ones: 1 is at the limit."
)
@click.option("--model", metavar="NAME", help="Fly this model of bfi simulate in place of a LOG.")
@click.option(
    "--manoeuvre",
    "manoeuvres",
    multiple=True,
    metavar="NAME",
    help="To compare; repeatable.  [default: 3211, doublet, multisine]",
)
@click.option("--noise", multiple=True, metavar="NAME=SD", help="White noise of a model's output; repeatable.")
@click.option("--amplitude", "amplitude_rad", type=float, metavar="RAD", help="Largest deflection.  [default: 0.035]")
@click.option("--start", "start_s", type=float, metavar="S", help="When the manoeuvre starts.  [default: 0.2]")
@click.option("--step", "step_s", type=float, metavar="S", help="The manoeuvre's unit step.  [default: 1]")
@click.option("--duration", "duration_s", type=float, metavar="S", help="Length of the flight.  [default: 31.72]")
@click.option("--turbulence", "turbulence_m_s", type=float, metavar="SIGMA", help="Dryden gusts, m/s.  [default: 0]")
@click.option("--draws", type=int, metavar="N", help="Of the noise, for each manoeuvre.  [default: 5]")
@click.option("--input", "inputs", multiple=True, metavar="NAME", help="An input; repeatable.  [default: elevator]")
@click.option("--output", "outputs", multiple=True, metavar="NAME", help="An output; repeatable.  [default: tas]")
@window_options
@channel_options
@click.option("--rate", metavar="HZ|none|auto", help="Rate of the analysis; none is the log's own.  [default: auto]")
@click.option("--order", metavar="N|auto", help="Number of lags of the model.  [default: auto]")
@click.option("--feedthrough/--no-feedthrough", default=None, help="Inputs act in the same sample too.")
@click.option("--seed", type=int, metavar="N", help="Of the noise of a model.  [default: 0]")
@outside_option
@out_options
@progress_option
@series_option
def command(log: str | None, config_path: str | None, **options: Any) -> None:
    """Say how well each fault of a dictionary can be seen in LOG, a log without faults, and told from the others.

    Divergences are in bits: 0 cannot be told, 1 is certain. Before a flight, --model in place of LOG compares
    manoeuvres: --model citation --noise tas=0.01 --manoeuvre 3211 --manoeuvre doublet.
    """
    from ..diagnosability import diagnosability_content, diagnosability_document
    from ..files import check_folder
    from ..provenance import provenance
    from ..report.files import content_names

    config = _config(config_path, options)
    _check(log, config, options)
    dictionary = config.load_dictionary(allow_outside=options["allow_outside"])
    if dictionary is None:
        raise ConfigError("--dictionary: no dictionary given; name one, such as configs/thesis_dictionary.yaml")
    inputs = inputs_of(config, log, dictionary=dictionary)
    if options["out"] is not None:
        names = content_names(("divergence", "information", "manoeuvres"), ("faults", "manoeuvres"))
        check_folder(options["out"], names, inputs=inputs, force=options["force"])
    result, log_sha256 = _assessed(log, dictionary, config, options)
    origin = provenance(
        log_sha256=log_sha256, config_sha256=config.sha256, dictionary_sha256=dictionary.sha256, seed=config.seed
    )
    document = diagnosability_document(result, origin)
    emit(diagnosability_content(document), document, options, origin=origin, inputs=inputs)


def _check(log: str | None, config: Config, options: Mapping[str, Any]) -> None:
    if log is None and config.diagnosability.model is None:
        raise click.UsageError("needs a LOG or a --model, got nothing; give one of the two")
    if log is not None:
        if options["model"] is not None:
            raise click.UsageError("needs a LOG or a --model, got both; give one of the two")
        for key, option in FLIGHT.items():
            if options[key] not in (None, ()):
                raise click.UsageError(f"{option} is about the flight of a model; give --model in place of the log")


def _assessed(
    log: str | None, dictionary: Dictionary, config: Config, options: Mapping[str, Any]
) -> tuple[DiagnosabilityResult, str]:
    from threadpoolctl import threadpool_limits

    from ..diagnosability import assess, assess_manoeuvres, flights_of, magnitudes_of

    magnitudes = magnitudes_of(config)
    if log is not None:
        flight = log_of(log, options["group"], config)
        with threadpool_limits(1):
            return assess(flight, dictionary, config, magnitudes=magnitudes), flight.sha256
    with threadpool_limits(1), progress("records", wanted=options["progress"]) as report:
        return assess_manoeuvres(flights_of(config), dictionary, config, magnitudes=magnitudes, report=report), ""


def _by_name(example: str, texts: tuple[str, ...], *, bare: bool = False) -> dict[str, float]:
    """Return number by name of texts NAME=NUMBER; the name of a number alone is "", where that is allowed."""
    option = example.partition(" ")[0]
    found: dict[str, float] = {}
    for text in texts:
        name, _, size = ("", "", text) if bare and "=" not in text else text.rpartition("=")
        value = number_or_word(size.strip())
        if not isinstance(value, int | float) or not (name.strip() or (bare and "=" not in text)):
            raise ConfigError(f"{option}: not a size, got '{text}'; write {example}")
        if name.strip() in found:
            raise ConfigError(f"{option}: '{name.strip() or 'all'}' is given twice, got {' '.join(texts)}; keep one")
        found[name.strip()] = float(value)
    return found


def _config(path: str | None, options: Mapping[str, Any]) -> Config:
    sizes = _by_name("--magnitude 0.5 or --magnitude NAME=0.5", options["magnitudes"], bare=True)
    noise = _by_name("--noise tas=0.01", options["noise"])
    flown = {f"diagnosability.{key}": options[key] for key in ("model", *FLIGHT) if options[key] not in (None, ())}
    return configured(
        path,
        options,
        {
            "diagnosability.magnitude": sizes.pop("", None),
            "diagnosability.magnitudes": sizes or None,
            "diagnosability.at_limit": options["at_limit"],
            **flown,
            "diagnosability.noise": noise or None,
        },
    )
