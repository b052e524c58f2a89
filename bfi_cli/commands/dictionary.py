"""`bfi dictionary`: audit of a fault dictionary, by itself or on a log."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from .options import CHANNELS, config_of, inputs_of, log_of, settled, units_of, with_options
from .output import emit

if TYPE_CHECKING:
    from ..audit import Audit
    from ..config import Config
    from ..dictionary import Dictionary

__all__ = ["command"]

OF_A_LOG = {
    "inputs": "--input",
    "outputs": "--output",
    "order": "--order",
    "channel_map": "--channel",
    "unit_map": "--unit",
    "group": "--group",
    "sample_rate_hz": "--sample-rate",
    "fill_s": "--fill",
    "boot": "--boot",
}


@click.command("dictionary")
@click.argument("file", metavar="FILE", type=click.Path())
@click.argument("log", metavar="[LOG]", type=click.Path(), required=False)
@with_options("config_path", "inputs", "outputs", "from_s", "to_s", "duration_s", *CHANNELS, "rate", "order")
@with_options("allow_outside", "units", "out", "force", "as_json", "series")
def command(file: str, log: str | None, config_path: str | None, **options: Any) -> None:
    """Say what the faults of the dictionary FILE are, which are alike, and on a LOG how large each must be."""
    from ..audit import audit_content, audit_document
    from ..audit.report import DRAWINGS, TABLES
    from ..dictionary import load_dictionary
    from ..files import check_folder
    from ..provenance import provenance
    from ..report.files import content_names

    config = _config(config_path, log, options)
    dictionary = load_dictionary(file, allow_outside=options["allow_outside"], channel=config.default_channel)
    inputs = inputs_of(config, file, log, dictionary=dictionary)
    if options["out"] is not None:
        check_folder(options["out"], content_names(DRAWINGS, TABLES), inputs=inputs, force=options["force"])
    audit, log_sha256 = _audited(dictionary, log, config, options["allow_outside"])
    origin = provenance(
        log_sha256=log_sha256, config_sha256=config.sha256, dictionary_sha256=dictionary.sha256, seed=config.seed
    )
    document = audit_document(audit, origin)
    units = units_of(config.shown_units)
    emit(partial(audit_content, document), document, options, units=units, origin=origin, inputs=inputs)


# Seconds in which kinds of fault are shown without a log, where neither the command nor their onsets say.
SHOWN_S = 60.0


def _audited(dictionary: Dictionary, log: str | None, config: Config, allow_outside: bool) -> tuple[Audit, str]:
    from ..audit import audit_dictionary, audit_on_log
    from ..dictionary import load_dictionary

    if log is None:
        ends = [end for one in dictionary.searched.atoms for end in one.onset_range_s or () if math.isfinite(end)]
        stop_s = config.audit.duration_s or max([SHOWN_S, *ends])
        audited = dictionary.at_onsets(0.0, stop_s) if dictionary.searched.atoms else dictionary
        return audit_dictionary(audited, config, duration_s=config.audit.duration_s), ""
    from threadpoolctl import threadpool_limits

    flight = log_of(log, config)
    config, notes = settled(flight, config)
    dictionary = load_dictionary(dictionary.path, allow_outside=allow_outside, channel=config.default_channel)
    if dictionary.searched.atoms:
        part = flight.window(config.window.from_s, config.window.to_s)
        dictionary = dictionary.at_onsets(float(part.time_s[0]), float(part.time_s[-1]))
    with threadpool_limits(1):
        audit = audit_on_log(flight, dictionary, config)
    return replace(audit, notes=(*notes, *audit.notes)), flight.sha256


def _config(path: str | None, log: str | None, options: dict[str, Any]) -> Config:
    if log is None:
        for key, option in OF_A_LOG.items():
            if options[key]:
                raise click.UsageError(f"{option} is about a log; give one after the dictionary")
    elif options["duration_s"] is not None:
        raise click.UsageError("--duration is for an audit without a log; give --from and --to")
    return config_of(path, options)
