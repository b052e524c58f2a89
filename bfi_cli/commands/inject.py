"""`bfi inject`: add faults to a log."""

from __future__ import annotations

from typing import Any

import click

from ..errors import ConfigError, LogError
from .options import CHANNELS, log_argument, with_options
from .output import write_and_show

ORDINARY = """
    What ordinarily happens at a second of the log, of SIZE, in SI or with its unit; repeatable: altimeter_set (Pa),
    attitude_settles (a gyro horizon erects, rad), wake (for 30 s, m/s), clock (repeats and skips samples in pairs, how
    often)."""


@click.command("inject")
@with_options(
    log_argument,
    click.option("--fault", "specs", metavar="SPEC", multiple=True, help="A fault to add; repeatable."),
    click.option("--ordinary", "causes", metavar="CAUSE@S[:SIZE]", multiple=True, help=ORDINARY),
    click.option(
        "--through-recorder/--no-through-recorder",
        default=None,
        help="Pass the faults through the low-pass filters that the log went through.  "
        "[default: where these are known]",
    ),
    *("out_file", "force", *CHANNELS, "units", "as_json"),
)
def command(
    *, log: str, specs: tuple[str, ...], causes: tuple[str, ...], through_recorder: bool | None, **options: Any
) -> None:
    """Add faults, and what ordinarily happens, to LOG and store the truth beside them; what it already carries stays.

    SPEC is a shape and its keys, times in the log's own seconds: bias,channel=tas,magnitude=4,onset_s=13.8. A fault of
    a pressure line, as pitot_blocked,onset_s=1432, changes every channel that follows from the pressure.
    """
    from ..faults import parse_spec
    from ..faults.ordinary import parse_occurrence
    from ..files import check_files
    from ..flightlog import inject, read_log
    from ..flightlog.ordinary import INJECTED
    from ..kernels.low_pass import IDENTITY

    if not (specs or causes):
        raise ConfigError("bfi inject: nothing to add; give --fault SPEC or --ordinary CAUSE@S")
    faults = [parse_spec(spec) for spec in specs]
    ordinary = [parse_occurrence(text, where="--ordinary", makings=INJECTED) for text in causes]
    inputs = [log, *(fault.file for fault in faults if fault.file)]
    check_files([options["out_file"]], inputs=inputs, force=options["force"])
    clean = read_log(log, **{name: options[name] for name in CHANNELS})
    faults = [parse_spec(spec, unit_of=lambda name: clean.channel(name).unit) for spec in specs]
    if through_recorder and not clean.filters:
        raise LogError(
            f"{clean.path}: --through-recorder: neither stated nor shown by the log, got no filter; "
            "state it in the file's attribute filters, or leave the option out"
        )
    faulty = inject(clean, faults, ordinary=ordinary, response=IDENTITY if through_recorder is False else None)
    write_and_show(faulty, options, kind="inject", log_sha256=clean.sha256)
