"""`bfi dictionary`: audit of a fault dictionary, by itself or on a log."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from .answered import show
from .options import CHANNELS, config_of, inputs_of, log_of, tell, with_options

if TYPE_CHECKING:
    from ..audit import Audit
    from ..config import Config
    from ..dictionary import Dictionary
    from ..provenance import Provenance

__all__ = ["command"]

NAMES = ("atoms.csv", "coherence.csv", "audit.svg", "audit.png", "result.json")
OF_A_LOG = {
    "inputs": "--input",
    "outputs": "--output",
    "order": "--order",
    "channel_map": "--channel",
    "unit_map": "--unit",
    "group": "--group",
}


@click.command("dictionary")
@click.argument("file", metavar="FILE", type=click.Path())
@click.argument("log", metavar="[LOG]", type=click.Path(), required=False)
@with_options("config_path", "inputs", "outputs", "from_s", "to_s", "duration_s", *CHANNELS, "rate", "order")
@with_options("allow_outside", "out", "force", "as_json")
def command(file: str, log: str | None, config_path: str | None, **options: Any) -> None:
    """Say what the faults of the dictionary FILE are, which are alike, and on a LOG how large each must be."""
    from ..audit_table import audit_document, print_audit
    from ..dictionary import load_dictionary
    from ..files import check_folder, replace_files
    from ..provenance import provenance

    config = _config(config_path, log, options)
    dictionary = load_dictionary(file, allow_outside=options["allow_outside"])
    inputs = inputs_of(config, file, log, dictionary=dictionary)
    if options["out"] is not None:
        check_folder(options["out"], NAMES, inputs=inputs, force=options["force"])
    audit, log_sha256 = _audited(dictionary, log, config, options)
    origin = provenance(
        log_sha256=log_sha256, config_sha256=config.sha256, dictionary_sha256=dictionary.sha256, seed=config.seed
    )
    if options["out"] is not None:
        written = replace_files(_files(audit, origin), options["out"], inputs=inputs, force=options["force"])
        tell(f"wrote {written[-1]}")
    document = audit_document(audit, origin)
    show(document, lambda console: print_audit(console, audit), as_json=options["as_json"])


def _audited(dictionary: Dictionary, log: str | None, config: Config, options: dict[str, Any]) -> tuple[Audit, str]:
    from ..audit import audit, audit_on_log

    if log is None:
        return audit(dictionary, config, duration_s=config.audit.duration_s), ""
    from threadpoolctl import threadpool_limits

    flight = log_of(log, config)
    with threadpool_limits(1):
        return audit_on_log(flight, dictionary, config), flight.sha256


def _config(path: str | None, log: str | None, options: dict[str, Any]) -> Config:
    if log is None:
        for key, option in OF_A_LOG.items():
            if options[key]:
                raise click.UsageError(f"{option} is about a log; give one after the dictionary")
    elif options["duration_s"] is not None:
        raise click.UsageError("--duration is for an audit without a log; give --from and --to")
    return config_of(path, options)


def _files(audit: Audit, origin: Provenance) -> dict[str, bytes]:
    from ..audit_table import audit_document, audit_tables
    from ..plots.audit import plot_audit
    from ..plots.style import to_png, to_svg
    from ..serialize import to_json

    files = audit_tables(audit)
    if audit.signatures is not None:
        figure = plot_audit(audit)
        files |= {"audit.svg": to_svg(figure), "audit.png": to_png(figure)}
    return {**files, "result.json": to_json(audit_document(audit, origin)).encode() + b"\n"}
