"""Does sparsity help? Rules that choose the active faults, on the same data: isolation rate and time of each.

Every rule starts from the compressed data of one order, those of bfi identify at 10 Hz; its time includes that of
RISRO if it needs RISRO. Atoms are those of the thesis, or steps at regular starts; their number and the noise vary.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from time import process_time
from typing import Any

import numpy as np

from ...aircraft import find_model, flight_of
from ...config import STRONG_EVIDENCE, Config, merge
from ...dictionary import Dictionary
from ...faults import Fault
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.model_selection import Penalty, Proposal, Visited, least_criterion, refine_supports, search_orders
from ...kernels.risro_varx import SparseStage, risro_varx
from ...kernels.variable_projection import Fit, ProjectedRegression, fit_magnitudes
from ...model.preprocessing.regression import RegressionData, build_regression
from ...model.preprocessing.window import prepare_window
from ...model.risro import THRESHOLD
from ...model.selection import proposals_of, stage_runs
from ...report.content import Panel, ReportContent, curve
from ..montecarlo.counts import Proportion, curve_of_shares, proportion, with_interval
from .page import Page, drawing, joined, load, panel, report_content, table
from .record import Settings, thesis_dictionary, thesis_record, trials_of, with_fault, with_noise

Support = tuple[int, ...]

# At 100 Hz lags span so little time that white noise becomes a drift; order 6 is among those that identify tries.
RATE_HZ, ORDER = 10.0, 6
STEPS_S = 120.0  # duration of the record of the dictionaries of steps
THESIS_ATOMS = 7  # in the dictionary of its table 5-2
NOISES, QUICK_NOISES = (1e-4, 1e-3, 0.01, 0.05, 0.2), (0.01,)  # m/s, on the thesis's atoms
SIZES, QUICK_SIZES = (10, 20, 40, 80), (20,)  # numbers of steps
STEP_NOISES = (0.2, 0.5)  # m/s, on the steps
TRIALS, QUICK_TRIALS = 100, 2
MOST_ACTIVE, LARGEST = 3, 10  # active faults, and their integer magnitudes
PUBLISHED = SparseStage(kind="exp-l0", alpha=1.0, r=10.0, p0=1.0, updates=1)
BESIDE = 1.03  # factor between points of successive rules, so that they do not hide each other


@dataclass(frozen=True, slots=True)
class Point:
    """A dictionary of so many atoms, seven being the thesis's, white noise (m/s), and whether there are faults."""

    n_atoms: int
    noise: float
    faulty: bool = True


@dataclass(frozen=True, slots=True)
class Problem:
    """The data of a trial, the same with inputs projected out, the penalty of an atom, and the true support."""

    regression: RegressionData
    projected: ProjectedRegression
    penalty: Penalty
    truth: Support


@cache
def _clean(n_atoms: int) -> tuple[FlightLog, Dictionary]:
    """Return the fault-free record and the dictionary of a number of atoms."""
    if n_atoms == THESIS_ATOMS:
        return thesis_record(Settings()), thesis_dictionary()
    rng = np.random.default_rng(0)
    log = flight_of(find_model("citation"), "3211", rng=rng, duration_s=STEPS_S, rate_hz=RATE_HZ)
    starts = np.linspace(4.0, STEPS_S - 4.0, n_atoms)
    atoms = [
        Fault(shape="bias", channel="tas", onset_s=round(float(start_s), 1), name=f"step_{start_s:.1f}")
        for start_s in starts
    ]
    return log, replace(thesis_dictionary(), atoms=tuple(atoms))


def problem_of(point: Point, seed: Sequence[int]) -> Problem:
    """Return a trial of a point: its faults and its noise are drawn by the seed alone."""
    log, dictionary = _clean(point.n_atoms)
    rng = np.random.default_rng([*seed])
    n_active = int(rng.integers(1, MOST_ACTIVE + 1)) if point.faulty else 0
    truth = tuple(sorted(rng.choice(point.n_atoms, n_active, replace=False).tolist()))
    sizes = rng.integers(1, LARGEST + 1, n_active) * rng.choice([-1.0, 1.0], n_active)
    faults = [replace(dictionary.atoms[j], magnitude=float(size)) for j, size in zip(truth, sizes, strict=True)]
    log = with_noise(with_fault(log, *faults) if faults else log, point.noise, seed=int(rng.integers(2**31)))
    config = merge(Config(), {"conditioning.rate_hz": RATE_HZ, "model.feedthrough": False})
    window = prepare_window(log, dictionary, config)
    regression = build_regression(window.signals, range(point.n_atoms), config, orders=[ORDER])
    n_rows = regression.n_rows
    penalty = Penalty(n_rows=n_rows, n_effective=float(n_rows), n_candidates=point.n_atoms, evidence=STRONG_EVIDENCE)
    return Problem(regression, regression.problem(ORDER), penalty, truth)


def _by_rule(of: Problem, z: FloatArray) -> Support:
    """Return the support by the thesis's rule: the magnitudes above a thousandth of the norm of all, in SI units."""
    si = z * of.regression.magnitude_unit
    return _above(np.abs(si) / np.linalg.norm(si), THRESHOLD)


def _above(values: FloatArray, threshold: float) -> Support:
    return tuple(np.flatnonzero(values > threshold).tolist())


def _in_deviations(of: Problem) -> tuple[Fit, FloatArray]:
    """Return the fit of all atoms from RISRO's solution, and its magnitudes over their standard deviations."""
    whole = risro_varx(of.regression.data)
    fit = fit_magnitudes(of.projected, range(len(whole.z)), whole.z, max_iterations=1)
    return fit, np.abs(fit.z) / np.sqrt(np.diag(np.linalg.pinv(fit.information)))


def _cheapest(of: Problem, proposals: Sequence[Proposal]) -> Support:
    """Return the proposed support with the best criterion, after atoms are dropped one by one while it falls."""
    atoms = range(of.penalty.n_candidates)
    searches, _ = refine_supports([of.projected], atoms, of.penalty, proposals=proposals, dropping_only=True)
    return _likeliest(*searches)


def _likeliest(visited: Visited) -> Support:
    """Return the support with the best criterion."""
    return least_criterion(visited.values()).atoms


def _by_lasso(of: Problem, *, adaptive: bool) -> Support:
    """Return the best support on the lasso path of the problem linearised at RISRO's solution.

    The adaptive path (Zou 2006) weighs each atom by its magnitude there.
    """
    fit, _ = _in_deviations(of)
    K = fit.K[:, 0, 0]
    corrected = of.projected.y[:, :, 0] - of.projected.theta @ fit.z
    base = corrected[:, 1:]
    G = np.append(1.0, -K) @ of.projected.theta
    y = corrected[:, 0] - base @ K + G @ fit.z
    Q = np.linalg.qr(base)[0]
    G, y = G - Q @ (Q.T @ G), y - Q @ (Q.T @ y)
    weights = np.abs(fit.z) if adaptive else 1.0 / np.maximum(np.linalg.norm(G, axis=0), np.finfo(float).tiny)
    most = min(LARGEST + THESIS_ATOMS, G.shape[1])
    proposals = []
    for support in lasso_supports(G * weights, y, most=most):
        z = np.asarray(np.linalg.lstsq(G[:, support], y, rcond=None)[0], dtype=np.float64)
        proposals.append((ORDER, support, z))
    return _cheapest(of, proposals)


def lasso_supports(X: FloatArray, y: FloatArray, *, most: int) -> list[Support]:
    """Return the supports along the lasso path, from the empty one to the first with more than `most` atoms.

    Least angle regression with the lasso's drops (Efron, Hastie, Johnstone, Tibshirani 2004).
    """
    beta, active, supports = np.zeros(X.shape[1]), list[int](), list[Support]()
    correlation = X.T @ y
    smallest, dropped = 1e-9 * float(np.max(np.abs(correlation))), -1
    for _ in range(4 * most):
        if dropped < 0:
            outside = np.abs(correlation)
            outside[active] = -1.0
            active.append(int(np.argmax(outside)))
        C = float(np.max(np.abs(correlation[active])))
        if smallest > C or len(active) > most:
            break
        XA = X[:, active]
        direction = np.linalg.lstsq(XA.T @ XA, np.sign(correlation[active]), rcond=None)[0]
        slope = X.T @ (XA @ direction)
        others = np.setdiff1d(np.arange(len(beta)), [*active, dropped])
        with np.errstate(divide="ignore", invalid="ignore"):
            joins = np.concatenate(
                [(C - correlation[others]) / (1.0 - slope[others]), (C + correlation[others]) / (1.0 + slope[others])]
            )
            leaves = -beta[active] / direction
        join = np.min(joins[joins > 1e-12 * C], initial=C)
        leave = np.min(leaves[leaves > 1e-12 * C], initial=np.inf)
        step = min(join, leave)
        beta[active] += step * direction
        dropped = active.pop(int(np.argmin(np.where(leaves > 1e-12 * C, leaves, np.inf)))) if leave < join else -1
        if dropped >= 0:
            beta[dropped] = 0.0
        correlation = X.T @ (y - X @ beta)
        supports.append(tuple(sorted(active)))
    return supports


# What is compared, by the names of `rules` in sparsity.yaml.
RULES: Mapping[str, Callable[[Problem], Support]] = {
    "rule": lambda of: _by_rule(of, risro_varx(of.regression.data).z),
    "published": lambda of: _by_rule(of, risro_varx(of.regression.data, sparse=PUBLISHED, as_published=True).z),
    "three": lambda of: _above(_in_deviations(of)[1], 3.0),
    "price": lambda of: _above(_in_deviations(of)[1], float(np.sqrt(of.penalty.per_parameter + of.penalty.per_atom))),
    "lasso": lambda of: _by_lasso(of, adaptive=False),
    "adaptive": lambda of: _by_lasso(of, adaptive=True),
    # The exponential stage from its two starts, as method risro does.
    "stage": lambda of: _cheapest(of, proposals_of(stage_runs(of.regression, of.penalty, orders=[ORDER])[1])),
    "search": lambda of: _likeliest(*search_orders([of.projected], range(of.penalty.n_candidates), of.penalty)),
}


def run(trial: tuple[Point, tuple[int, ...]]) -> list[tuple[bool, float]]:
    """Return for every rule whether its support is the true one, and its seconds."""
    of = problem_of(*trial)
    outcomes = []
    for rule in RULES.values():
        begin = process_time()
        support = rule(of)
        outcomes.append((support == of.truth, process_time() - begin))
    return outcomes


def sparsity(settings: Settings) -> ReportContent:
    """Return isolation and time of every rule against noise and the size of the dictionary."""
    page, names = load("sparsity"), list(RULES)
    labels: Mapping[str, str] = page["rules"]
    noises, sizes = (QUICK_NOISES, QUICK_SIZES) if settings.quick else (NOISES, SIZES)
    groups = {"atoms of the thesis": [Point(THESIS_ATOMS, noise) for noise in noises]}
    groups |= {f"steps, noise {noise:g} m/s": [Point(size, noise) for size in sizes] for noise in STEP_NOISES}
    without = [Point(THESIS_ATOMS, QUICK_NOISES[0], False), Point(sizes[-1], STEP_NOISES[0], False)]
    points = [*(point for each in groups.values() for point in each), *without]
    n_trials = settings.trials_or(TRIALS, QUICK_TRIALS)
    every = trials_of(run, points, n_trials, settings)
    counts, ms = every[..., 0].sum(axis=1).astype(int), 1e3 * np.median(every[..., 1], axis=1)
    rates = [[proportion(int(count), n_trials) for count in row] for row in counts]
    shares = [dict(zip(names, map(with_interval, row), strict=True)) for row in rates]
    last = len(points) - len(without) - 1  # of the largest dictionary of steps, in the most noise
    records = [
        {"where": _words(point), "label": labels[name], "share": shares[i][name], "ms": f"{ms[i, j]:.3g}"}
        for i, point in enumerate(points)
        for j, name in enumerate(names)
    ]
    return report_content(
        page,
        {
            "order": ORDER,
            "rate": RATE_HZ,
            "active": f"1 to {MOST_ACTIVE}",
            "largest": LARGEST,
            "trials": n_trials,
            "seed": settings.seed,
            "points": "; ".join(map(_words, points)),
            "size": points[last].n_atoms,
            "noise": points[last].noise,
            "shown": shares[last],
            "seconds": {name: f"{ms[last, j]:.3g}" for j, name in enumerate(names)},
        },
        heading=bool(counts[last, names.index("stage")] > counts[last, names.index("rule")]),
        records=[record for i in (0, last) for record in records[i * len(names) : (i + 1) * len(names)]],
        tables=[table(page, "rates", [tuple(record.values()) for record in records])],
        drawings=[
            drawing(page, "sparsity", _panels(page, "sparsity", groups, lambda k, j: rates[k][j]), across=2),
            drawing(page, "sparsity_time", _panels(page, "sparsity_time", groups, lambda k, j: ms[k, j]), across=2),
        ],
    )


def _panels(
    page: Page, name: str, groups: Mapping[str, Sequence[Point]], read: Callable[[int, int], Any]
) -> list[Panel]:
    """Return the panels of a figure: of every group, first the rules for magnitudes, then those for supports.

    Parameters
    ----------
    read : from the numbers of a point and a rule to the share of trials, or to the time.
    """
    labels, panels, k = list(page["rules"].values()), [], 0
    for title, points in groups.items():
        noisy = points[0].n_atoms == THESIS_ATOMS
        x = np.array([point.noise if noisy else point.n_atoms for point in points])
        half = len(labels) // 2
        for first in (0, half):
            curves = []
            for j in range(first, first + half):
                beside, values = x * BESIDE ** (j - first), [read(k + i, j) for i in range(len(points))]
                if isinstance(values[0], Proportion):
                    curves.append(curve_of_shares(labels[j], beside.tolist(), values, style=joined(x, "bars")))
                else:
                    curves.append(curve(labels[j], beside, values, style=joined(x, "line")))
            x_label = "noise [m/s]" if noisy else "atoms [-]"
            panels.append(panel(page, name, curves, title=title, x_label=x_label, log_x=noisy))
        k += len(points)
    return panels


def _words(point: Point) -> str:
    """Return "thesis's 7 atoms, 0.01 m/s"."""
    atoms = f"thesis's {point.n_atoms} atoms" if point.n_atoms == THESIS_ATOMS else f"{point.n_atoms} steps"
    return f"{atoms}, {point.noise:g} m/s" + ("" if point.faulty else ", no fault")
