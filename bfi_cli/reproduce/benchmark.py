"""The benchmark: every method of `bfi compare` on the same trials, at one rate of false alarms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from ..errors import LogError
from ..flightlog import write_log
from ..montecarlo import check_records, load_sweep, run_sweep, summarise
from ..montecarlo.comparison import comparison_drawings, comparison_tables
from ..montecarlo.definition import RecordedLog
from ..montecarlo.scenarios import Scenario, digest_of_parts
from ..notes import Note
from ..report.content import ReportContent
from ..serialization import to_plain
from .page import FOLDER, load
from .record import Settings, thesis_record

# What a quick run keeps: methods that take tenths of a second, one fault, and trials enough for a threshold.
QUICK_METHODS, QUICK_FAULTS, QUICK_TRIALS = ("risro", "null-space", "arx-residual", "glr"), ("none", "bias_1"), 4


def benchmark(settings: Settings) -> ReportContent:
    """Return the tables and figures of the shipped sweep, or of windows of a flight in place of its record.

    Raises
    ------
    LogError : the log has faults, or no minute of flight.
    ConfigError, SweepError : the record cannot be used, or a worker died.
    """
    page, plain = load("benchmark"), load_sweep(FOLDER / "benchmark_sweep.yaml", seed=settings.seed)
    scenarios = [
        one
        for one in plain.scenarios
        if not settings.quick or (one.axes["compare"] in QUICK_METHODS and one.axes["inject"] in QUICK_FAULTS)
    ]
    with TemporaryDirectory(prefix="bfi-") as folder:
        path = Path(folder) / "record.h5"  # of a flight, as a file that every worker can read
        if settings.log is not None:
            flight = thesis_record(settings)
            if (lasts_s := flight.n_samples / flight.rate_hz) < page["length_s"]:
                raise LogError(
                    f"{settings.log.path}: {lasts_s:.4g} s are less than the {page['length_s']:g} s of a trial; give a "
                    "longer log, or a later --to"
                )
            write_log(replace(flight, segments=()), path)
            record = RecordedLog(log=str(path), length_s=page["length_s"])
            scenarios = [_on_flight(one, record) for one in scenarios]
        n_trials = settings.trials_or(plain.n_trials, QUICK_TRIALS)
        sweep = replace(plain, n_trials=n_trials, scenarios=tuple(scenarios))
        try:
            check_records(sweep)
        except LogError as error:
            where = settings.log.path if settings.log else sweep.path
            raise LogError(f"{where}: {str(error).removeprefix(f'{path}: ')}") from None
        total = n_trials * len(scenarios)
        done = run_sweep(sweep, workers=settings.workers, report=lambda count: settings.report(count, total))
    summary = summarise(sweep, done)
    plain_scenarios = to_plain(summary.scenarios)
    methods = len({one.axes["compare"] for one in scenarios})
    return ReportContent(
        category=page["category"],
        title=page["title"],
        heading=page["heading"].format(methods=methods, faults=len({one.axes["inject"] for one in scenarios}) - 1),
        verdict=page["verdict"].format(trials=n_trials),
        facts=(("Record", page["record"] if settings.log is None else settings.log.path), ("Seed", str(settings.seed))),
        tables=comparison_tables(plain_scenarios),
        drawings=comparison_drawings(plain_scenarios),
        notes=(
            *map(Note.method, page["notes"]),
            Note.method(page["simulated" if settings.log is None else "recorded"]),
            *summary.notes,
        ),
    )


def _on_flight(scenario: Scenario, record: RecordedLog) -> Scenario:
    """Return a scenario on windows of a flight, whose own noise is there."""
    setting = scenario.setting
    digest = digest_of_parts([setting.digest, record.length_s])
    return replace(scenario, setting=replace(setting, record=record, noise=(), digest=digest))
