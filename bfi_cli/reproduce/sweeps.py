"""Monte Carlo figures: 5-3 and 5-4 of the thesis, A-1 to A-4 on its sparsity stage, and isolation against noise."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..config import merge
from ..exhibit import Curve, Drawing, Exhibit, Panel, Span, Table, curve
from ..flightlog import write_log
from ..montecarlo import check_records, load_sweep, run_sweep, summarise, wilson
from ..montecarlo.definition import RecordedLog
from ..montecarlo.summary import Proportion, ScenarioSummary
from ..wording import number
from .page import FOLDER, Page, drawing, exhibit, fill, load, table
from .record import Settings, stand_in, thesis_record

__all__ = ["Cell", "Swept", "Thin", "isolation_noise", "swept", "thesis_a", "thesis_monte_carlo"]

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
    """One method at one noise (m/s) and one number of active faults."""

    method: str
    noise: float
    active: int
    summary: ScenarioSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """All cells, trials per cell, and what the sweep has to say (failed trials)."""

    cells: tuple[Cell, ...]
    trials: int
    notes: tuple[str, ...]

    def of(self, method: str, noise: float) -> list[Cell]:
        """Return the cells of a method at a noise, by number of active faults."""
        return [cell for cell in self.cells if (cell.method, cell.noise) == (method, noise)]

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
            for method in compare:
                setting = scenario.setting
                source = record or setting.record
                config = merge(setting.config, load("methods")[method], where="methods.yaml")
                parts = [setting.digest, source.model_dump(mode="json"), config.model_dump(mode="json")]
                digest = hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
                scenarios.append(
                    replace(
                        scenario,
                        name=f"{scenario.name} method={method}",
                        axes={**scenario.axes, "method": method},
                        setting=replace(setting, digest=digest, record=source, config=config),
                    )
                )
        n_trials = settings.trials_or(plain.n_trials, quick.trials)
        sweep = replace(plain, n_trials=n_trials, scenarios=tuple(scenarios))
        check_records(sweep)
        total = n_trials * len(scenarios)
        done = run_sweep(sweep, workers=settings.workers, report=lambda count: settings.report(count, total))
    summary = summarise(sweep, done)
    cells = [
        Cell(method=one.axes["method"], noise=one.axes["noise.tas"], active=one.axes["active"], summary=one)
        for one in summary.scenarios
    ]
    return Swept(cells=tuple(cells), trials=n_trials, notes=summary.notes)


def percent(share: Proportion) -> str:
    """Return "96 % (90 to 98)", the rate with its 95 % Wilson interval."""
    if share.rate is None or share.ci95 is None:
        return "-"
    low, high = (100.0 * end for end in share.ci95)
    return f"{100.0 * share.rate:.0f} % ({low:.0f} to {high:.0f})"


def noise_words(noise: float) -> str:
    """Return "no noise", or "noise 0.01 m/s"."""
    return f"noise {noise:g} m/s" if noise else "no noise"


def pooled(cells: Sequence[Cell]) -> Proportion:
    """Return how many of all trials of several cells are isolated."""
    count, of = (sum(getattr(cell.summary.isolation, key) for cell in cells) for key in ("count", "of"))
    return Proportion(count=count, of=of, rate=count / of if of else None, ci95=wilson(count, of))


def rates_table(page: Page, swept: Swept, labels: Mapping[str, str]) -> Table:
    """Return a row per cell, methods by their `labels`, rates as "96 (90-98)"."""
    rows = []
    for cell in swept.cells:
        one = cell.summary
        rates = [percent(share) for share in (one.isolation, one.false_alarm, one.missed_detection)]
        bare = [text.replace(" % ", " ").replace(" to ", "-") for text in rates]
        error = number(one.magnitude_error.get("p50"), digits=2)
        rows.append((labels[cell.method], f"{cell.noise:g}", str(cell.active), *bare, error))
    return table(page, "rates", rows)


def error_panel(swept: Swept, labels: Mapping[str, str], *, noise: float) -> Panel:
    """Return median magnitude error against the number of active faults, quartiles as bars."""
    curves = []
    for label, cells, at in _beside(swept, labels, noise):
        low, middle, high = (
            [float(np.maximum(cell.summary.magnitude_error.get(key, math.nan), LEAST_ERROR)) for cell in cells]
            for key in ("p25", "p50", "p75")
        )
        curves.append(curve(label, at, middle, style="points", low=low, high=high))
    return Panel(
        title=noise_words(noise),
        x_label="active faults [-]",
        y_label="relative magnitude error [-]",
        curves=tuple(curves),
        log_y=True,
    )


def isolation_panel(swept: Swept, labels: Mapping[str, str], *, noise: float) -> Panel:
    """Return the isolation rate against the number of active faults, with Wilson intervals."""
    return Panel(
        title=noise_words(noise),
        x_label="active faults [-]",
        y_label="isolated [%]",
        curves=tuple(
            rate_curve(label, at, [cell.summary.isolation for cell in cells])
            for label, cells, at in _beside(swept, labels, noise)
        ),
        y_limits=(-3.0, 103.0),
    )


def _beside(swept: Swept, labels: Mapping[str, str], noise: float) -> list[tuple[str, list[Cell], list[float]]]:
    """Return the label of every method, its cells, and their numbers of active faults moved a little aside."""
    found = [(label, swept.of(method, noise)) for method, label in labels.items()]
    aside = [SPREAD * (i - 0.5 * (len(found) - 1)) for i in range(len(found))]
    return [(label, cells, [one.active + d for one in cells]) for (label, cells), d in zip(found, aside, strict=True)]


def rate_curve(label: str, x: Sequence[float], shares: Sequence[Proportion]) -> Curve:
    """Return rates in % with their intervals as bars."""
    ends = [share.ci95 or (math.nan, math.nan) for share in shares]
    return curve(
        label,
        x,
        [100.0 * (math.nan if share.rate is None else share.rate) for share in shares],
        style="bars",
        low=[100.0 * low for low, _ in ends],
        high=[100.0 * high for _, high in ends],
    )


def thesis_monte_carlo(settings: Settings) -> Exhibit:
    """Return figures 5-3 and 5-4: magnitude error and isolation against the number of active faults.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    page = load("thesis")["5-3"]
    found = swept("thesis", settings, compare=tuple(page["methods"]), quick=QUICK)
    captions = page["captions"]
    return _sweep_page(
        page,
        found,
        settings,
        heading=(pooled(found.of("sparse", found.noises[0])).rate or 0.0) >= NEARLY_ALL,
        drawings=[
            _against_active("thesis_5_3", captions["thesis_5_3"], found, page["methods"], panel=error_panel),
            _against_active("thesis_5_4", captions["thesis_5_4"], found, page["methods"], panel=isolation_panel),
        ],
    )


def thesis_a(settings: Settings) -> Exhibit:
    """Return figures A-1 to A-4: the same with and without the sparsity stage, and as the published listing runs.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    page = load("thesis")["A"]
    found = swept("thesis", settings, compare=tuple(page["methods"]), quick=QUICK)
    # The stage changes nothing where rates without it lie in the intervals of those with it, at every point.
    pairs = [
        (one.summary.isolation.rate, other.summary.isolation.ci95)
        for noise in found.noises
        for one, other in zip(found.of("rank_only", noise), found.of("sparse", noise), strict=True)
    ]
    alike = all(rate is not None and ends is not None and ends[0] <= rate <= ends[1] for rate, ends in pairs)
    drawings, captions = [], page["captions"]
    for figure, stage, what, panel in (
        ("thesis_a_1", "without", "errors", error_panel),
        ("thesis_a_2", "having", "errors", error_panel),
        ("thesis_a_3", "without", "isolation", isolation_panel),
        ("thesis_a_4", "having", "isolation", isolation_panel),
    ):
        left_out = ("sparse", "listing") if stage == "without" else ("rank_only",)
        labels = {method: label for method, label in page["methods"].items() if method not in left_out}
        drawings.append(_against_active(figure, f"{captions[stage]} {captions[what]}", found, labels, panel=panel))
    return _sweep_page(page, found, settings, heading=alike, drawings=drawings)


def _against_active(
    name: str, caption: str, found: Swept, labels: Mapping[str, str], *, panel: Callable[..., Panel]
) -> Drawing:
    """Return errors or isolation against the number of active faults, a panel per noise."""
    return Drawing(name=name, caption=caption, panels=tuple(panel(found, labels, noise=one) for one in found.noises))


def _sweep_page(page: Page, found: Swept, settings: Settings, *, heading: bool, drawings: list[Drawing]) -> Exhibit:
    """Return a page with the rates and errors of every method at every noise."""
    labels: Mapping[str, str] = page["methods"]
    rows, parts = [], []
    for noise in found.noises:
        cells = {method: found.of(method, noise) for method in labels}
        ends = {
            method: [number(cell.summary.magnitude_error.get("p50"), digits=2) for cell in (of[0], of[-1])]
            for method, of in cells.items()
        }
        shares = {
            method: " ".join(f"{100.0 * (cell.summary.isolation.rate or 0.0):.0f}" for cell in of)
            for method, of in cells.items()
        }
        few, *_, many = (cell.active for cell in next(iter(cells.values())))
        rows += fill(
            page["noise_rows"],
            noise=noise_words(noise),
            few=few,
            many=many,
            errors={method: " and ".join(both) for method, both in ends.items()},
            shares={method: f"{share} %" for method, share in shares.items()},
        )
        isolated = ", ".join(f"{label} {percent(pooled(cells[method]))}" for method, label in labels.items())
        parts.append(f"isolated with {noise_words(noise)}: {isolated}")
    verdict = "; ".join(parts)
    return exhibit(
        page,
        {
            "verdict": f"{verdict[:1].upper()}{verdict[1:]}.",
            "record": page["record"] if settings.log is None else settings.log.path,
            "trials": found.trials,
            "seed": settings.seed,
        },
        heading=heading,
        rows=rows,
        tables=[rates_table(page, found, labels)],
        drawings=drawings,
        before=(*stand_in(settings), page["simulated"]) if settings.log is None else (),
        notes=found.notes,
    )


def isolation_noise(settings: Settings) -> Exhibit:
    """Return the curves of isolation against noise for 1, 2 and 4 active faults, the thesis's rule and our default.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    page = load("isolation_noise")
    labels: Mapping[str, str] = page["methods"]
    found = swept("isolation_noise", settings, compare=tuple(labels), quick=QUICK_NOISE)
    rows, parts = [], []
    for noise in found.noises:
        shares = {label: percent(pooled(found.of(method, noise))) for method, label in labels.items()}
        words = noise_words(noise)
        rows += [fill(page["row"], noise=words, label=label, share=share) for label, share in shares.items()]
        parts.append(f"{words}: " + ", ".join(f"{share} by the {label}" for label, share in shares.items()))
    numbers = sorted({cell.active for cell in found.cells})
    panels = []
    for title, shown in (("all trials", numbers), *((f"{n} active", [n]) for n in numbers)):
        curves = []
        for i, (method, label) in enumerate(labels.items()):
            at = [max(noise, AT_ZERO) * ASIDE**i for noise in found.noises]
            cells = [[one for one in found.of(method, noise) if one.active in shown] for noise in found.noises]
            curves.append(rate_curve(label, at, [pooled(part) for part in cells]))
        panels.append(
            Panel(
                title=title,
                x_label="noise [m/s]",
                y_label="isolated [%]",
                curves=tuple(curves),
                log_x=True,
                spans=(Span(label="no noise", low=AT_ZERO, high=AT_ZERO),) if 0.0 in found.noises else (),
                y_limits=(-3.0, 103.0),
            )
        )
    rule, ours = (pooled(found.of(method, found.noises[-1])).rate or 0.0 for method in labels)
    return exhibit(
        page,
        {
            "shares": "; ".join(parts),
            "record": page["record"] if settings.log is None else settings.log.path,
            "trials": found.trials,
            "seed": settings.seed,
        },
        heading=rule < ours,
        rows=rows,
        tables=[rates_table(page, found, labels)],
        drawings=[drawing(page, "isolation_noise", panels, across=2)],
        before=(*stand_in(settings), page["simulated"]) if settings.log is None else (),
        notes=found.notes,
    )
