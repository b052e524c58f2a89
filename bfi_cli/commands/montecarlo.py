"""`bfi montecarlo`: sweeps of many trials, rates with intervals, tables, figures."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from .analysis import inputs_of
from .options import with_options
from .output import check_out, note, progress, show, write

if TYPE_CHECKING:
    from pathlib import Path

    from ..lab.montecarlo import Sweep
    from ..lab.montecarlo.trial import Row
    from ..serialization import Provenance

STORED = "summary.json"


@click.command("montecarlo")
@click.option("-c", "--config", "config_path", metavar="CONFIG", required=True, help="YAML file of the sweep.")
@click.option("--trials", type=click.IntRange(min=1), metavar="N", help="Per scenario.  [default: of CONFIG, or 100]")
@click.option(
    "--seed", type=click.IntRange(min=0), metavar="N", help="Of all random numbers.  [default: of CONFIG, or 0]"
)
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes.  [default: 1]")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers run the trials.")
@click.option("--resume", is_flag=True, help="Continue a stopped sweep, or a finished one with more --trials.")
@with_options("allow_outside", "out", "force", "progress", "as_json")
def command(config_path: str, **options: Any) -> None:
    """Add known faults to a record many times, identify them, and count how often the answer is right.

    CONFIG names the record, the dictionary and what varies; configs/montecarlo_thesis.yaml is an example. The numbers
    are the same for any number of workers, and for a sweep that was stopped and continued.
    """
    from ..lab.montecarlo import (
        check_records,
        digest_of,
        load_sweep,
        montecarlo_content,
        summarise,
        summary_document,
    )
    from ..lab.montecarlo.running import TIMING_COLUMNS, timing_cells
    from ..lab.montecarlo.summary import DRAWINGS, TABLES
    from ..lab.montecarlo.trial import COLUMNS
    from ..serialization import provenance

    if options["workers"] is not None and options["scheduler"] is not None:
        raise click.UsageError("--workers and --scheduler exclude each other; keep one")
    if options["resume"] and options["out"] is None:
        raise click.UsageError("--resume needs the folder of the stopped sweep; give --out DIR")
    sweep = load_sweep(config_path, **{key: options[key] for key in ("trials", "seed", "allow_outside")})
    settings = list({id(scenario.setting): scenario.setting for scenario in sweep.scenarios}.values())
    named = {sweep.path}
    for setting in settings:
        named.update(inputs_of(setting.config, getattr(setting.record, "log", None), dictionary=setting.dictionary))
    inputs = tuple(named)
    check_out(options, inputs, DRAWINGS, TABLES, stored=STORED)
    records = check_records(sweep)
    digest = digest_of(sweep, records)
    origin = provenance(
        log_sha256=" ".join(records.values()),
        config_sha256=sweep.sha256,
        dictionary_sha256=" ".join(sorted({setting.dictionary.sha256 for setting in settings})),
        seed=sweep.seed,
    )
    done = _rows_of(sweep, digest, origin, inputs, options)
    document = summary_document(summarise(sweep, done), origin, digest=digest)
    # Cells are texts already, so that these files are the same to the byte however often the sweep was stopped.
    rows, times = [row.cells() for row, _ in done], [timing_cells(*pair) for pair in done]
    data = {
        "trials.csv": dict(zip(COLUMNS, zip(*rows, strict=True), strict=True)),
        "timings.csv": dict(zip(TIMING_COLUMNS, zip(*times, strict=True), strict=True)),
    }
    content = replace(montecarlo_content(document), data=data)
    write(content, document, options, origin=origin, inputs=inputs, stored=STORED)
    show(document, content, as_json=options["as_json"])


def _rows_of(
    sweep: Sweep, digest: str, origin: Provenance, inputs: tuple[str, ...], options: dict[str, Any]
) -> list[tuple[Row, float]]:
    """Run a sweep, its rows kept in the folder of --out as they come, and return them with their seconds."""
    from ..lab.montecarlo import open_journal, run_sweep

    out: Path | None = options["out"]
    journal = None
    kept: list[tuple[Row, float]] = []
    if out is not None:
        asked = {name: options[name] for name in ("resume", "force")}
        journal, kept = open_journal(out, sweep, digest=digest, origin=origin, inputs=inputs, **asked)
    total = sweep.n_trials * len(sweep.scenarios)
    with progress("trials", wanted=options["progress"]) as report, journal or nullcontext():
        try:
            return run_sweep(
                sweep,
                journal=journal,
                kept=kept,
                workers=options["workers"] or sweep.workers,
                scheduler=options["scheduler"] if options["workers"] else options["scheduler"] or sweep.scheduler,
                report=lambda count: report(count, total),
            )
        except KeyboardInterrupt:
            if out is not None:
                note(f"stopped; bfi montecarlo -c {sweep.path} --out {out} --resume continues")
            raise
