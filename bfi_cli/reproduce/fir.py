"""Blind identification of an FIR system (thesis chapter 3): the product b z^T by RISRO and by the nuclear norm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dictionary import signals
from ..engine import in_order
from ..fir import identify_fir
from ..report.content import Panel, ReportContent, curve
from ..report.text import number
from .page import drawing, joined, load, report_content, table
from .record import Settings, thesis_dictionary, thesis_record

__all__ = ["METHODS", "TAPS", "Problem", "bound", "error", "fir", "output", "run", "slow_and_white"]

FloatArray = NDArray[np.float64]

# A filter and three faults, by their number in the dictionary, that nothing singles out.
TAPS = np.array([1.0, 0.5, -0.3])
SIZES = {1: 4.0, 2: 2.0, 6: 1.0}
METHODS: Mapping[str, Mapping[str, Any]] = {
    "RISRO": {"method": "risro"},
    "nuclear norm, penalty 0.001": {"method": "nuclear", "penalty": 1e-3},
    "nuclear norm, penalty 1e-06": {"method": "nuclear", "penalty": 1e-6},
}
RISRO, NUCLEAR, WEAK = METHODS
N_SAMPLES, N_ATOMS, MOST_CYCLES = 1000, 7, 5  # of a random dictionary
# Over the output.
NOISES, QUICK_NOISES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), (1e-4, 1e-2)
SHARES, QUICK_SHARES = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001), (1.0, 0.03, 0.001)  # of white noise in a dictionary
TRIALS, QUICK_TRIALS = 100, 3  # of each noise
SWEEP_NOISE = 1e-2  # over the output, in the sweep over condition numbers
LEAST = 1e-17  # what a log axis shows of an error of zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """A point of a sweep.

    Attributes
    ----------
    theta : (n_samples, n_atoms) dictionary; None for one drawn anew in every trial.
    white : then the share of white noise in it; the rest is slow oscillations, of which lags nearly coincide.
    noise : of the output, over its standard deviation.
    """

    theta: FloatArray | None
    white: float
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """A point of a sweep: its place, its errors (n_trials, n_methods), the median of their bound."""

    x: float
    errors: FloatArray
    bound: float

    @property
    def risro(self) -> float:
        """The median error of RISRO."""
        return float(np.median(self.errors[:, list(METHODS).index(RISRO)]))


def run(trial: tuple[Problem, tuple[int, ...]]) -> list[float]:
    """Return of a problem and the seed of a trial the errors by method, their first-order bound, the condition number.

    The seed is all that is random: a dictionary where the problem has none, and the noise of the output.
    """
    problem, seed = trial
    rng = np.random.default_rng(seed)
    theta = slow_and_white(problem.white, rng) if problem.theta is None else problem.theta
    z = z_of(theta.shape[1])
    clean = output(theta, z)
    sd = problem.noise * float(np.std(clean))
    y = clean + sd * rng.standard_normal(len(clean))
    solutions = [identify_fir(y, theta, n_taps=len(TAPS), **how) for how in METHODS.values()]
    return [*(error(one.product, z) for one in solutions), bound(theta, z, sd), solutions[0].condition_number]


def z_of(n_atoms: int) -> FloatArray:
    """Return (n_atoms,) the true magnitudes, of which three are not zero."""
    return np.array([SIZES.get(j, 0.0) for j in range(n_atoms)])


def output(theta: FloatArray, z: FloatArray) -> FloatArray:
    """Return (n_samples,) y(k) = sum_i b_i u(k-i), i = 1.., of the input u = theta z that was zero before (eq. 3-2)."""
    return np.convolve(theta @ z, np.concatenate([[0.0], TAPS]))[: len(theta)]


def error(product: FloatArray, z: FloatArray) -> float:
    """Return the relative Frobenius error of a product b z^T."""
    truth = np.outer(TAPS, z)
    return float(np.linalg.norm(product - truth) / np.linalg.norm(truth))


def bound(theta: FloatArray, z: FloatArray, sd: float) -> float:
    """Return the root mean square of that error to first order: least squares over the tangent space at the truth.

    Parameters
    ----------
    sd : of white noise on the output.
    """
    if sd == 0.0:
        return 0.0
    n, p = len(theta), len(TAPS)
    lags = np.hstack([theta[p - lag : n - lag] for lag in range(1, p + 1)])
    tangent = np.hstack([np.kron(np.eye(p), z[:, None]), np.kron(TAPS[:, None], np.eye(len(z)))])
    basis = np.linalg.svd(tangent, full_matrices=False)[0][:, : p + len(z) - 1]
    values = np.linalg.svd(lags @ basis, compute_uv=False)
    return float(sd * np.sqrt(np.sum(values**-2.0)) / np.linalg.norm(np.outer(TAPS, z)))


def slow_and_white(white: float, rng: np.random.Generator) -> FloatArray:
    """Return (N_SAMPLES, N_ATOMS) signals of unit power: one to five cycles, with a share of white noise."""
    phase = rng.uniform(0.0, 2.0 * np.pi, N_ATOMS)
    cycles = rng.uniform(1.0, MOST_CYCLES, N_ATOMS)
    slow = np.sqrt(2.0) * np.sin(2.0 * np.pi * np.outer(np.arange(N_SAMPLES) / N_SAMPLES, cycles) + phase)
    return np.asarray(np.sqrt(1.0 - white**2) * slow + white * rng.standard_normal((N_SAMPLES, N_ATOMS)))


def fir(settings: Settings) -> ReportContent:
    """Return the example of chapter 3 on the thesis's dictionary, with sweeps over condition number and noise.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    page, time_s = load("fir"), thesis_record(settings).time_s
    start_s = float(time_s[0])
    theta = signals(thesis_dictionary().resolved(start_s), time_s, ["tas"], window_start_s=start_s)[:, 0]
    z = z_of(theta.shape[1])
    truth = np.outer(TAPS, z)
    solutions = {
        label: identify_fir(output(theta, z), theta, n_taps=len(TAPS), **how) for label, how in METHODS.items()
    }
    ours = {label: error(one.product, z) for label, one in solutions.items()}
    # The product summed over the taps, which the output tells, and what differs between taps, which it hardly does.
    rows, parts = [], {}
    for label, one in solutions.items():
        off = one.product - truth
        common = float(np.linalg.norm(off.sum(axis=0)) / np.linalg.norm(truth.sum(axis=0)))
        differing = float(np.linalg.norm(off - off.mean(axis=0)) / np.linalg.norm(truth - truth.mean(axis=0)))
        parts[label] = {"common": 100.0 * common, "differing": 100.0 * differing}
        numbers = (ours[label], one.vaf, one.rank_one_share, one.shrinkage, common, differing)
        rows.append((label, *(number(value, digits=6 if i == 1 else 2) for i, value in enumerate(numbers))))
    exact, noisy, by_noise = _sweeps(theta, settings)
    relaxed = solutions[NUCLEAR]
    values = {
        "risro": ours[RISRO],
        "nuclear": ours[NUCLEAR],
        "weak": ours[WEAK],
        "off": 100.0 * ours[NUCLEAR],
        "n_samples": len(theta),
        "magnitudes": ", ".join(f"{one:g}" for one in z),
        "taps": ", ".join(f"{tap:g}" for tap in TAPS),
        "trials": settings.trials_or(TRIALS, QUICK_TRIALS),
        "points": f"{len(exact)} condition numbers, {len(by_noise)} noises",
        "seed": settings.seed,
        "well": number(exact[0].x, digits=2),
        "ill": number(exact[-1].x, digits=2),
        "worst": max(point.risro for point in exact),
        "growth": f"{number(noisy[0].risro, digits=2)} to {number(noisy[-1].risro, digits=2)}",
        "limits": f"{number(noisy[0].bound, digits=2)} to {number(noisy[-1].bound, digits=2)}",
        "size": number(float(np.linalg.norm(relaxed.product, "nuc")), digits=3),
        "true_size": number(float(np.linalg.norm(truth, "nuc")), digits=3),
        "turned": ", ".join(number(tap, digits=2) for tap in relaxed.taps),
        "vaf": relaxed.vaf,
        **parts[NUCLEAR],
    }
    condition = "condition number [-]"
    return report_content(
        page,
        values,
        heading=ours[RISRO] < 1e-8,
        tables=[table(page, "fir", rows)],
        drawings=[
            drawing(
                page, "fir_condition", (_panel("no noise", condition, exact), _panel("noise 1 %", condition, noisy))
            ),
            drawing(page, "fir_noise", [_panel("", "noise / output [-]", by_noise)]),
        ],
    )


def _sweeps(theta: FloatArray, settings: Settings) -> tuple[list[_Point], list[_Point], list[_Point]]:
    """Return the points over condition numbers without and with noise, and those over noise."""
    noises, shares = (QUICK_NOISES, QUICK_SHARES) if settings.quick else (NOISES, SHARES)
    problems = [Problem(theta=None, white=share, noise=sd) for sd in (0.0, SWEEP_NOISE) for share in shares]
    problems += [Problem(theta=theta, white=0.0, noise=sd) for sd in noises]
    n_trials, n_shares = settings.trials_or(TRIALS, QUICK_TRIALS), len(shares)
    trials = [(problem, (settings.seed, i, k)) for i, problem in enumerate(problems) for k in range(n_trials)]
    done: list[list[float]] = []
    for outcome, _ in in_order(run, trials, workers=settings.workers):
        done.append(outcome)
        settings.report(len(done), len(trials))
    points = []
    for problem, outcomes in zip(problems, np.array(done).reshape(len(problems), n_trials, -1), strict=True):
        bounds, condition = np.median(outcomes[:, -2:], axis=0).tolist()
        x = condition if problem.theta is None else problem.noise
        points.append(_Point(x=x, errors=outcomes[:, :-2], bound=bounds))
    return points[:n_shares], points[n_shares : 2 * n_shares], points[2 * n_shares :]


def _panel(title: str, x_label: str, points: Sequence[_Point]) -> Panel:
    """Return median errors with their quartiles, and the bound where there is noise."""
    x = [point.x for point in points]
    errors = np.maximum([point.errors for point in points], LEAST)
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75), axis=1)
    curves = [
        curve(label, x, middle[:, i], style=joined(x, "bars"), low=low[:, i], high=high[:, i])
        for i, label in enumerate(METHODS)
    ]
    if all(point.bound for point in points):
        curves.append(curve("bound", x, [point.bound for point in points], style=joined(x, "dotted")))
    return Panel(
        title=title, x_label=x_label, y_label="relative error [-]", curves=tuple(curves), log_x=True, log_y=True
    )
