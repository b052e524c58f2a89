"""Monte Carlo figures: 5-3 and 5-4 of the thesis, A-1 to A-4 on its sparsity stage, and isolation against noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..config import merge
from ..flightlog import write_log
from ..montecarlo import check_records, load_sweep, run_sweep, summarise
from ..montecarlo.definition import RecordedLog
from ..montecarlo.scenarios import digest_of_parts
from ..montecarlo.summary import Proportion, ScenarioSummary, proportion
from ..notes import Note
from ..report.content import Curve, Drawing, ReportContent, Span, curve
from ..report.text import number
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


def swept(name: str, settings: Settings, *, compare: Sequence[str], quick: Thin) -> Swept:
    """Run a shipped sweep for several methods, which meet the same faults and the same noise.

    Parameters
    ----------
    name : of the YAML file beside this one, without "_sweep".
    compare : names in `methods.yaml`.
    quick : what is left of it where `settings.quick`.

    Raises
    ------
    LogError, ConfigError, SweepError : the record cannot be used, or a worker died.
    """
    plain = load_sweep(FOLDER / f"{name}_sweep.yaml", seed=settings.seed)
    with TemporaryDirectory(prefix="bfi-") as folder:
        record = None
        if settings.log is not None:  # as a file that every worker can read
            record = RecordedLog(log=str(Path(folder) / "record.h5"))
            write_log(replace(thesis_record(settings), segments=()), Path(record.log))
        scenarios = []
        for scenario in plain.scenarios:
            if settings.quick and not (scenario.n_active in quick.active and scenario.axes["noise.tas"] in quick.noise):
                continue
            setting = scenario.setting
            source = record or setting.record
            for method in compare:
                config = merge(setting.config, load("methods")[method], where="methods.yaml")
                parts = [setting.digest, source.model_dump(mode="json"), config.model_dump(mode="json")]
                name, axes = f"{scenario.name} method={method}", {**scenario.axes, "method": method}
                changed = replace(setting, digest=digest_of_parts(parts), record=source, config=config)
                scenarios.append(replace(scenario, name=name, axes=axes, setting=changed))
        n_trials = settings.trials_or(plain.n_trials, quick.trials)
        sweep = replace(plain, n_trials=n_trials, scenarios=tuple(scenarios))
        check_records(sweep)
        total = n_trials * len(scenarios)
        done = run_sweep(sweep, workers=settings.workers, report=lambda count: settings.report(count, total))
    summary = summarise(sweep, done)
    errors: dict[str, list[float]] = {one.name: [] for one in summary.scenarios}
    for row, _ in done:
        if row.magnitude_error is not None:
            errors[row.scenario].append(row.magnitude_error)
    cells = [
        Cell(
            method=one.axes["method"],
            noise=one.axes["noise.tas"],
            active=one.axes["active"],
            summary=one,
            mean_error=float(np.mean(errors[one.name])) if errors[one.name] else math.nan,
        )
        for one in summary.scenarios
    ]
    return Swept(cells=tuple(cells), trials=n_trials, recorded=record is not None, notes=summary.notes)


def percent(share: Proportion) -> str:
    """Return "96 % (90 to 98)", the rate with its 95 % Wilson interval."""
    if share.rate is None or share.ci95 is None:
        return "-"
    low, high = (100.0 * end for end in share.ci95)
    return f"{100.0 * share.rate:.0f} % ({low:.0f} to {high:.0f})"


def pooled(cells: Sequence[Cell]) -> Proportion:
    """Return how many of all trials of several cells are isolated."""
    count, of = (sum(getattr(cell.summary.isolation_rate, key) for cell in cells) for key in ("count", "of"))
    return proportion(count, of)


def rate_curve(label: str, x: Sequence[float], shares: Sequence[Proportion]) -> Curve:
    """Return rates in % with their intervals as bars; a line only through three points and more."""
    ends = [share.ci95 or (math.nan, math.nan) for share in shares]
    return curve(
        label,
        x,
        [100.0 * (math.nan if share.rate is None else share.rate) for share in shares],
        style=joined(x, "bars"),
        low=[100.0 * low for low, _ in ends],
        high=[100.0 * high for _, high in ends],
    )


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
            one.summary.isolation_rate.rate is not None and low <= one.summary.isolation_rate.rate <= high
            for one, other in zip(result.of("rank_only", noise), result.of("sparse", noise), strict=True)
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
        drawings.append(draw(page, figure, result, [one for one in page["who"] if one not in left_out]))
    return _sweep_page(page, result, settings, heading=alike, drawings=drawings)


def _errors(page: Page, name: str, result: Swept, methods: Sequence[str]) -> Drawing:
    """Return the magnitude error against the number of active faults: means, beside them medians with quartiles."""
    panels = []
    for noise in result.noises:
        means, medians = [], []
        for label, cells, at in _beside(result, methods, noise):
            means.append(curve(label, at, np.maximum([one.mean_error for one in cells], LEAST_ERROR), style="points"))
            low, middle, high = (
                np.maximum([(one.summary.magnitude_error or {}).get(key, math.nan) for one in cells], LEAST_ERROR)
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
                rate_curve(label, at, [cell.summary.isolation_rate for cell in cells])
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
    return [(label, cells, [one.active + d for one in cells]) for (label, cells), d in zip(every, aside, strict=True)]


def _sweep_page(
    page: Page, result: Swept, settings: Settings, *, heading: object, drawings: Sequence[Drawing]
) -> ReportContent:
    """Return a page with the rates and errors of every method at every noise."""
    compared: list[dict[str, object]] = []
    parts = []
    for noise in result.noises:
        words, cells = result.words(noise), {method: result.of(method, noise) for method in page["who"]}
        for method, of in cells.items():
            said = {"label": label_of(method), "noise": words, "few": of[0].active, "many": of[-1].active}
            errors = [number(cell.mean_error, digits=2) for cell in (of[0], of[-1])]
            shares = " ".join(f"{100.0 * (cell.summary.isolation_rate.rate or 0.0):.0f}" for cell in of)
            for what, computed in (("error", " and ".join(errors)), ("isolation", f"{shares} %")):
                quantity = fill(page["quantities"][what], **said)
                compared.append(
                    {"quantity": quantity, "printed": page["printed"][what].get(method, "-"), "computed": computed}
                )
        isolated = ", ".join(f"{label_of(method)} {percent(pooled(of))}" for method, of in cells.items())
        parts.append(f"{words.capitalize()}, isolated: {isolated}.")
    body = []
    for cell in result.cells:
        one = cell.summary
        rates = [percent(share) for share in (one.isolation_rate, one.false_alarm_rate, one.missed_detection_rate)]
        bare = [text.replace(" % ", " ").replace(" to ", "-") for text in rates]
        errors = [number(value, digits=2) for value in (cell.mean_error, (one.magnitude_error or {}).get("p50"))]
        body.append((label_of(cell.method), f"{cell.noise:g}", str(cell.active), *bare, *errors))
    active = sorted({cell.active for cell in result.cells})
    before = [load("thesis")["shared"]["stand_in"], page["simulated"]] if settings.log is None else []
    return report_content(
        {**page, "notes": [*before, *page["notes"]]},
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
        notes=[one.text for one in result.notes],
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
            cells = [[one for one in result.of(method, noise) if one.active in shown] for noise in result.noises]
            curves.append(rate_curve(label_of(method), at, [pooled(part) for part in cells]))
        panels.append(panel(page, "isolation", curves, title=title, spans=spans))
    rule, *_, ours = (pooled(result.of(method, result.noises[-1])).rate or 0.0 for method in methods)
    drawings = [drawing(page, "isolation_noise", panels, across=2)]
    return _sweep_page(page, result, settings, heading=rule < ours, drawings=drawings)
