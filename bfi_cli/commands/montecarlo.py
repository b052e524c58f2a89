"""`bfi montecarlo`: sweeps of many trials, rates with intervals, tables, figures."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .answered import show
from .options import inputs_of, json_option, out_options, outside_option, progress_option, tell
from .progress import progress

if TYPE_CHECKING:
    from ..montecarlo import Summary, Sweep
    from ..montecarlo.row import Row
    from ..provenance import Provenance

__all__ = ["command"]

NAMES = (
    *("trials.csv", "timings.csv", "summary.json"),
    *("isolation.svg", "isolation.png", "magnitude_error.svg", "magnitude_error.png"),
)


@click.command("montecarlo")
@click.option("-c", "--config", "config_path", metavar="CONFIG", required=True, help="YAML file of the sweep.")
@click.option("--trials", type=click.IntRange(min=1), metavar="N", help="Per scenario.  [default: of CONFIG, or 100]")
@click.option(
    "--seed", type=click.IntRange(min=0), metavar="N", help="Of all random numbers.  [default: of CONFIG, or 0]"
)
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes.  [default: 1]")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers run the trials.")
@click.option("--resume", is_flag=True, help="Continue a stopped sweep, or a finished one with more --trials.")
@outside_option
@out_options
@progress_option
@json_option
def command(config_path: str, out: Path | None, **options: Any) -> None:
    """Add known faults to a record many times, identify them, and count how often the answer is right.

    CONFIG names the record, the dictionary and what varies; configs/montecarlo_thesis.yaml is an example. The numbers
    are the same for any number of workers, and for a sweep that was stopped and continued.
    """
    from ..files import check_folder, replace_files
    from ..montecarlo import check_records, digest_of, load_sweep, summarise, summary_document
    from ..montecarlo.table import print_summary

    if options["workers"] is not None and options["scheduler"] is not None:
        raise click.UsageError("--workers and --scheduler exclude each other; keep one")
    if options["resume"] and out is None:
        raise click.UsageError("--resume needs the folder of the stopped sweep; give --out DIR")
    sweep = load_sweep(config_path, **{key: options[key] for key in ("trials", "seed", "allow_outside")})
    inputs, force = _inputs(sweep), options["force"]
    if out is not None:
        check_folder(out, NAMES, inputs=inputs, force=force)
    records = check_records(sweep)
    digest = digest_of(sweep, records)
    total = sweep.n_trials * len(sweep.scenarios)
    with progress("trials", wanted=options["progress"]) as report:
        done, journal = _run(sweep, out, digest, options, lambda count: report(count, total))
    summary = summarise(sweep, done)
    origin = _origin(sweep, records)
    document = summary_document(summary, origin, digest=digest)
    if out is not None:
        replace_files(_files(summary, done, document), out, inputs=inputs, force=force)
        journal.remove()
        tell(f"wrote {out / 'summary.json'}")
    show(document, lambda console: print_summary(console, summary), as_json=options["as_json"])


def _inputs(sweep: Sweep) -> tuple[str, ...]:
    """Return the files that a sweep reads."""
    named = {sweep.path}
    for setting in {id(scenario.setting): scenario.setting for scenario in sweep.scenarios}.values():
        named.update(inputs_of(setting.config, getattr(setting.record, "log", None), dictionary=setting.dictionary))
    return tuple(named)


def _run(
    sweep: Sweep, out: Path | None, digest: str, options: dict[str, Any], report: Callable[[int], None]
) -> tuple[list[tuple[Row, float]], Any]:
    from ..montecarlo import Journal, run_sweep

    resume, force = options["resume"], options["force"]
    opened = nullcontext() if out is None else Journal(out, sweep, digest=digest, resume=resume, force=force)
    with opened as journal:
        try:
            done = run_sweep(
                sweep,
                journal=journal,
                workers=options["workers"] or sweep.workers,
                scheduler=options["scheduler"] if options["workers"] else options["scheduler"] or sweep.scheduler,
                report=report,
            )
        except KeyboardInterrupt:
            if out is not None:
                tell(f"stopped; bfi montecarlo -c {sweep.path} --out {out} --resume continues")
            raise
    return done, journal


def _origin(sweep: Sweep, records: dict[str, str]) -> Provenance:
    from ..provenance import provenance

    dictionaries = sorted({scenario.setting.dictionary.sha256 for scenario in sweep.scenarios})
    return provenance(
        log_sha256=" ".join(records.values()),
        config_sha256=sweep.sha256,
        dictionary_sha256=" ".join(dictionaries),
        seed=sweep.seed,
    )


def _files(summary: Summary, done: list[tuple[Row, float]], document: dict[str, Any]) -> dict[str, bytes]:
    from ..montecarlo.journal import TIMING_COLUMNS, timing_cells
    from ..montecarlo.row import COLUMNS
    from ..plots.montecarlo import MONTECARLO_FIGURES
    from ..plots.style import to_png, to_svg
    from ..serialize import to_csv, to_json

    files = {
        "trials.csv": to_csv(COLUMNS, (row.cells() for row, _ in done)),
        "timings.csv": to_csv(TIMING_COLUMNS, (timing_cells(*pair) for pair in done)),
    }
    for name, plot in MONTECARLO_FIGURES.items():
        figure = plot(summary)
        files |= {f"{name}.svg": to_svg(figure), f"{name}.png": to_png(figure)}
    return {**files, "summary.json": to_json(document).encode() + b"\n"}
