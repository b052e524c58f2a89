"""Monte Carlo figures: 5-3 and 5-4 of the thesis, A-1 to A-4 on its sparsity stage, isolation against noise, benchmark.

The benchmark runs every method of `bfi compare` on the same trials, at one rate of false alarms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ...config import merge
from ...errors import LogError
from ...flightlog import write_log
from ...notes import Note
from ...quantities.text import number
from ...report.content import Drawing, ReportContent, Span, curve
from ..montecarlo import Sweep, check_records, load_sweep, run_sweep, summarise
from ..montecarlo.comparison import comparison_drawings, comparison_tables
from ..montecarlo.counts import (
    Proportion,
    ScenarioSummary,
    curve_of_shares,
    proportion,
    share_cell,
    with_interval,
)
from ..montecarlo.definition import RecordedLog
from ..montecarlo.scenarios import Scenario, digest_of_parts
from ..montecarlo.trial import Row
from .page import FOLDER, Page, drawing, fill, joined, load, panel, report_content, table
from .reconstruction import label_of
from .record import Settings, thesis_record

LEAST_ERROR = 1e-16  # what a log axis shows of an error of zero
NEARLY_ALL = 0.99  # of the trials isolated: as published, where no miss and no false alarm is seen in 100 trials
AT_ZERO = 1e-4  # m/s, where a log axis shows the points without noise
ASIDE = 1.06  # how far points of the second method stand aside on it
SPREAD = 0.06  # how far points of different methods stand apart, so that they do not hide each other


@dataclass(frozen=True, slots=True, kw_only=True)
class Thin:
    """What a quick sweep keeps: so many trials of these numbers of active faults and these noises (m/s)."""

    trials: int
    active: Sequence[int]
    noise: Sequence[float]


QUICK = Thin(trials=2, active=(1, 7), noise=(0.0, 1e-4))
QUICK_NOISE = Thin(trials=2, active=(1,), noise=(0.0, 0.05))
# Quick benchmark: methods that take tenths of a second, one fault, and trials enough for a threshold.
QUICK_METHODS, QUICK_FAULTS, QUICK_TRIALS = ("risro", "null-space", "arx-residual", "glr"), ("none", "bias_1"), 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One method at one noise (m/s) and one number of active faults, with the mean of its magnitude errors."""

    method: str
    noise: float
    active: int
    summary: ScenarioSummary
    mean_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """All cells, trials per cell, whether the record is the user's, and what the sweep has to say (failed trials)."""

    cells: tuple[Cell, ...]
    trials: int
    recorded: bool
    notes: tuple[Note, ...]

    def of(self, method: str, noise: float) -> list[Cell]:
        """Return the cells of a method at a noise, by number of active faults."""
        return [cell for cell in self.cells if (cell.method, cell.noise) == (method, noise)]

    def words(self, noise: float) -> str:
        """Return "no noise", or "noise 0.01 m/s"; of the user's record, whose own noise is there too, "as recorded"."""
        if self.recorded:
            return f"{noise:g} m/s of noise added" if noise else "as recorded"
        return f"noise {noise:g} m/s" if noise else "no noise"

    @property
    def noises(self) -> tuple[float, ...]:
        """The noises there are, m/s."""
        return tuple(dict.fromkeys(cell.noise for cell in self.cells))


def run_shipped(
    name: str,
    settings: Settings,
    choose: Callable[[Sequence[Scenario], RecordedLog | None], Iterable[Scenario]],
    *,
    quick_trials: int,
    length_s: float | None = None,
) -> tuple[Sweep, list[tuple[Row, float]]]:
    """Return a shipped sweep as it was run, and its trials.

    Parameters
    ----------
    name : of the YAML file beside this one, without "_sweep".
    choose : returns the scenarios to run, from those of the file and the user's record, None without one.
    quick_trials : trials of a scenario where `settings.quick`.
    length_s : length of the windows of the user's record, None for the whole record.

    Raises
    ------
    LogError, ConfigError, SweepError : the record cannot be used, or a worker died.
    """
    shipped = load_sweep(FOLDER / f"{name}_sweep.yaml", seed=settings.seed)
    with TemporaryDirectory(prefix="bfi-") as folder:
        path, record = Path(folder) / "record.h5", None
        if settings.log is not None:  # as a file that every worker can read
            write_log(replace(thesis_record(settings), segments=()), path)
            record = RecordedLog(log=str(path), length_s=length_s)
        n_trials = settings.trials_or(shipped.n_trials, quick_trials)
        sweep = replace(shipped, n_trials=n_trials, scenarios=tuple(choose(shipped.scenarios, record)))
        try:
            check_records(sweep)
        except LogError as error:
            where = settings.log.path if settings.log else sweep.path
            raise LogError(f"{where}: {str(error).removeprefix(f'{path}: ')}") from None
        total = n_trials * len(sweep.scenarios)
        done = run_sweep(sweep, workers=settings.workers, report=lambda count: settings.report(count, total))
    if settings.log is not None:  # errors of trials name the user's file, not the copy of it
        named = settings.log.path
        done = [
            (replace(row, error=row.error and row.error.replace(str(path), named)), seconds) for row, seconds in done
        ]
    return sweep, done


def swept(name: str, settings: Settings, *, compare: Sequence[str], quick: Thin) -> Swept:
    """Run a shipped sweep for several methods, which meet the same faults and the same noise.

    Parameters
    ----------
    name : see `run_shipped`.
    compare : names in `methods.yaml`.
    quick : the part of it that is run where `settings.quick`.

    Raises
    ------
    LogError, ConfigError, SweepError : see `run_shipped`.
    """

    def by_methods(scenarios: Sequence[Scenario], record: RecordedLog | None) -> Iterable[Scenario]:
        for scenario in scenarios:
            if settings.quick and not (scenario.n_active in quick.active and scenario.axes["noise.tas"] in quick.noise):
                continue
            setting = scenario.setting
            source = record or setting.record
            for method in compare:
                config = merge(setting.config, load("methods")[method], where="methods.yaml")
                parts = [setting.digest, source.model_dump(mode="json"), config.model_dump(mode="json")]
                changed = replace(setting, digest=digest_of_parts(parts), record=source, config=config)
                axes = {**scenario.axes, "method": method}
                yield replace(scenario, name=f"{scenario.name} method={method}", axes=axes, setting=changed)

    sweep, done = run_shipped(name, settings, by_methods, quick_trials=quick.trials)
    summary = summarise(sweep, done)
    errors: dict[str, list[float]] = {scenario.name: [] for scenario in summary.scenarios}
    for row, _ in done:
        if row.magnitude_error is not None:
            errors[row.scenario].append(row.magnitude_error)
    cells = [
        Cell(
            method=scenario.axes["method"],
            noise=scenario.axes["noise.tas"],
            active=scenario.axes["active"],
            summary=scenario,
            mean_error=float(np.mean(errors[scenario.name])) if errors[scenario.name] else math.nan,
        )
        for scenario in summary.scenarios
    ]
    recorded = settings.log is not None
    return Swept(cells=tuple(cells), trials=sweep.n_trials, recorded=recorded, notes=summary.notes)


def pooled(cells: Sequence[Cell]) -> Proportion:
    """Return how many of all trials of several cells are isolated."""
    count, of = (sum(getattr(cell.summary.isolation_rate, key) for cell in cells) for key in ("count", "of"))
    return proportion(count, of)


def thesis_monte_carlo(settings: Settings) -> ReportContent:
    """Return figures 5-3 and 5-4: magnitude error and isolation against the number of active faults."""
    page = load("thesis")["5-3"]
    result = swept("thesis", settings, compare=page["who"], quick=QUICK)
    # As published, no miss and no false alarm is seen.
    isolated = [(pooled(result.of("sparse", noise)).rate or 0.0) >= NEARLY_ALL for noise in result.noises]
    drawings = [
        _errors(page, "thesis_5_3", result, page["who"]),
        _isolation(page, "thesis_5_4", result, page["who"]),
    ]
    return _sweep_page(page, result, settings, heading=isolated, drawings=drawings)


def thesis_a(settings: Settings) -> ReportContent:
    """Return figures A-1 to A-4: the same with and without the sparsity stage, and as the published listing runs."""
    page = load("thesis")["A"]
    result = swept("thesis", settings, compare=page["who"], quick=QUICK)
    # The stage changes nothing where rates without it lie in the intervals of those with it, at every point.
    alike = [
        all(
            cell.summary.isolation_rate.rate is not None and low <= cell.summary.isolation_rate.rate <= high
            for cell, other in zip(result.of("rank_only", noise), result.of("sparse", noise), strict=True)
            for low, high in [other.summary.isolation_rate.ci95 or (math.nan, math.nan)]
        )
        for noise in result.noises
    ]
    drawings = []
    for figure, draw, left_out in (
        ("thesis_a_1", _errors, ("sparse", "listing", "risro")),
        ("thesis_a_2", _errors, ("rank_only",)),
        ("thesis_a_3", _isolation, ("sparse", "listing", "risro")),
        ("thesis_a_4", _isolation, ("rank_only",)),
    ):
        drawings.append(draw(page, figure, result, [method for method in page["who"] if method not in left_out]))
    return _sweep_page(page, result, settings, heading=alike, drawings=drawings)


def _errors(page: Page, name: str, result: Swept, methods: Sequence[str]) -> Drawing:
    """Return the magnitude error against the number of active faults: means, beside them medians with quartiles."""
    panels = []
    for noise in result.noises:
        means, medians = [], []
        for label, cells, at in _beside(result, methods, noise):
            means.append(curve(label, at, np.maximum([cell.mean_error for cell in cells], LEAST_ERROR), style="points"))
            low, middle, high = (
                np.maximum([(cell.summary.magnitude_error or {}).get(key, math.nan) for cell in cells], LEAST_ERROR)
                for key in ("p25", "p50", "p75")
            )
            medians.append(curve(label, at, middle, style="points", low=low, high=high))
        for what, curves in (("mean", means), ("median and quartiles", medians)):
            panels.append(panel(page, "error", curves, title=f"{result.words(noise)}, {what}"))
    return drawing(page, name, panels, across=2)


def _isolation(page: Page, name: str, result: Swept, methods: Sequence[str]) -> Drawing:
    """Return the isolation rate against the number of active faults, with Wilson intervals, a panel per noise."""
    panels = [
        panel(
            page,
            "isolation",
            [
                curve_of_shares(label, at, [cell.summary.isolation_rate for cell in cells], style=joined(at, "bars"))
                for label, cells, at in _beside(result, methods, noise)
            ],
            title=result.words(noise),
        )
        for noise in result.noises
    ]
    return drawing(page, name, panels)


def _beside(result: Swept, methods: Sequence[str], noise: float) -> list[tuple[str, list[Cell], list[float]]]:
    """Return the label of every method, its cells, and their numbers of active faults moved a little aside."""
    aside = [SPREAD * (i - 0.5 * (len(methods) - 1)) for i in range(len(methods))]
    every = [(label_of(method), result.of(method, noise)) for method in methods]
    return [(label, cells, [cell.active + d for cell in cells]) for (label, cells), d in zip(every, aside, strict=True)]


def _sweep_page(
    page: Page, result: Swept, settings: Settings, *, heading: object, drawings: Sequence[Drawing]
) -> ReportContent:
    """Return a page with the rates and errors of every method at every noise."""
    compared: list[dict[str, object]] = []
    parts = []
    for noise in result.noises:
        words, cells = result.words(noise), {method: result.of(method, noise) for method in page["who"]}
        for method, of in cells.items():
            values = {"label": label_of(method), "noise": words, "few": of[0].active, "many": of[-1].active}
            errors = [number(cell.mean_error, digits=2) for cell in (of[0], of[-1])]
            shares = " ".join(f"{100.0 * (cell.summary.isolation_rate.rate or 0.0):.0f}" for cell in of)
            for what, computed in (("error", " and ".join(errors)), ("isolation", f"{shares} %")):
                quantity = fill(page["quantities"][what], **values)
                compared.append(
                    {"quantity": quantity, "printed": page["printed"][what].get(method, "-"), "computed": computed}
                )
        isolated = ", ".join(f"{label_of(method)} {with_interval(pooled(of))}" for method, of in cells.items())
        parts.append(f"{words.capitalize()}, isolated: {isolated}.")
    body = []
    for cell in result.cells:
        summary = cell.summary
        rates = map(share_cell, (summary.isolation_rate, summary.false_alarm_rate, summary.missed_detection_rate))
        errors = [number(value, digits=2) for value in (cell.mean_error, (summary.magnitude_error or {}).get("p50"))]
        body.append((label_of(cell.method), f"{cell.noise:g}", str(cell.active), *rates, *errors))
    active = sorted({cell.active for cell in result.cells})
    return report_content(
        page,
        {
            "verdict": " ".join(parts),
            "record": page["record"] if settings.log is None else settings.log.path,
            "trials": result.trials,
            "seed": settings.seed,
            "points": f"{', '.join(map(str, active))} active; {', '.join(map(result.words, result.noises))}",
        },
        heading=heading,
        records=compared,
        tables=[table(page, "rates", body)],
        drawings=drawings,
        notes=[note.text for note in result.notes],
        simulated=settings.log is None,
    )


def isolation_noise(settings: Settings) -> ReportContent:
    """Return the curves of isolation against noise for 1, 2 and 4 active faults, the thesis's rule and ours."""
    page = load("thesis")["isolation_noise"]
    methods = page["who"]
    result = swept("isolation_noise", settings, compare=methods, quick=QUICK_NOISE)
    numbers = sorted({cell.active for cell in result.cells})
    panels = []
    spans = (Span(label=result.words(0.0), low=AT_ZERO, high=AT_ZERO),) if 0.0 in result.noises else ()
    for title, shown in (("all trials", numbers), *((f"{n} active", [n]) for n in numbers)):
        curves = []
        for i, method in enumerate(methods):
            at = [max(noise, AT_ZERO) * ASIDE**i for noise in result.noises]
            cells = [[cell for cell in result.of(method, noise) if cell.active in shown] for noise in result.noises]
            curves.append(curve_of_shares(label_of(method), at, list(map(pooled, cells)), style=joined(at, "bars")))
        panels.append(panel(page, "isolation", curves, title=title, spans=spans))
    rule, *_, ours = (pooled(result.of(method, result.noises[-1])).rate or 0.0 for method in methods)
    drawings = [drawing(page, "isolation_noise", panels, across=2)]
    return _sweep_page(page, result, settings, heading=rule < ours, drawings=drawings)


def benchmark(settings: Settings) -> ReportContent:
    """Return the tables and figures of the shipped benchmark, on windows of the user's record where there is one.

    Raises
    ------
    LogError : the log has faults, or no minute of flight.
    ConfigError, SweepError : see `run_shipped`.
    """
    page = load("benchmark")
    if settings.log is not None:
        flight = thesis_record(settings)
        if (lasts_s := flight.n_samples / flight.rate_hz) < page["length_s"]:
            raise LogError(
                f"{settings.log.path}: {lasts_s:.4g} s are less than the {page['length_s']:g} s of a trial; give a "
                "longer log, or a later --to"
            )

    def on_record(scenarios: Sequence[Scenario], record: RecordedLog | None) -> Iterable[Scenario]:
        for scenario in scenarios:
            axes, setting = scenario.axes, scenario.setting
            if settings.quick and not (axes["compare"] in QUICK_METHODS and axes["inject"] in QUICK_FAULTS):
                continue
            if record is not None:  # a flight has noise already
                digest = digest_of_parts([setting.digest, record.length_s])
                setting = replace(setting, record=record, noise=(), digest=digest)
            yield replace(scenario, setting=setting)

    sweep, done = run_shipped("benchmark", settings, on_record, quick_trials=QUICK_TRIALS, length_s=page["length_s"])
    summary = summarise(sweep, done)
    methods, faults = ({scenario.axes[axis] for scenario in sweep.scenarios} for axis in ("compare", "inject"))
    return ReportContent(
        category=page["category"],
        title=page["title"],
        heading=page["heading"].format(methods=len(methods), faults=len(faults) - 1),
        verdict=page["verdict"].format(trials=sweep.n_trials),
        facts=(("Record", page["record"] if settings.log is None else settings.log.path), ("Seed", str(settings.seed))),
        tables=comparison_tables(summary.scenarios),
        drawings=comparison_drawings(summary.scenarios),
        notes=(
            *map(Note.method, page["notes"]),
            Note.method(page["simulated" if settings.log is None else "recorded"]),
            *summary.notes,
        ),
    )
