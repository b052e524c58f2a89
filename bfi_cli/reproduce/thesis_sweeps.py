"""Monte Carlo figures: 5-3 and 5-4 of the thesis, A-1 to A-4 on its sparsity stage, and isolation against noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..report.content import Drawing, Panel, ReportContent, Span
from ..report.text import number
from .page import Page, drawing, exhibit, fill, load
from .record import Settings, stand_in
from .sweep import (
    Swept,
    Thin,
    error_panel,
    isolation_panel,
    noise_words,
    percent,
    pooled,
    rate_curve,
    rates_table,
    swept,
)

__all__ = ["isolation_noise", "thesis_a", "thesis_monte_carlo"]

QUICK = Thin(trials=2, active=(1, 7), noise=(0.0, 1e-4))
QUICK_NOISE = Thin(trials=2, active=(1,), noise=(0.0, 0.05))
NEARLY_ALL = 0.99  # of the trials isolated: as published, where no miss and no false alarm is seen in 100 trials
AT_ZERO = 1e-4  # m/s, where a log axis shows the points without noise
ASIDE = 1.06  # how far points of the second method stand aside on it


def thesis_monte_carlo(settings: Settings) -> ReportContent:
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


def thesis_a(settings: Settings) -> ReportContent:
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


def _sweep_page(
    page: Page, found: Swept, settings: Settings, *, heading: bool, drawings: list[Drawing]
) -> ReportContent:
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


def isolation_noise(settings: Settings) -> ReportContent:
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
