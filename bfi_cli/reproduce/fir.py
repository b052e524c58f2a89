"""Blind identification of an FIR system (thesis chapter 3): the product b z^T by RISRO and by the nuclear norm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..dictionary import signals
from ..engine import in_order
from ..exhibit import Drawing, Exhibit, Panel, Table, curve
from ..fir import FirResult, identify_fir
from ..wording import number
from .fir_trial import METHODS, TAPS, Outcome, Problem, Trial, error, output, run, z_of
from .record import thesis_dictionary, thesis_record
from .settings import Settings, comparison

__all__ = ["fir"]

FloatArray = NDArray[np.float64]

NOISES, QUICK_NOISES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), (1e-4, 1e-2)
SHARES, QUICK_SHARES = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001), (1.0, 0.03, 0.001)
TRIALS, QUICK_TRIALS = 100, 3
SWEEP_NOISE = 1e-2
LEAST = 1e-17
RISRO, NUCLEAR, WEAK = METHODS
CONDITION = "condition number [-]"
CONDITION_CAPTION = (
    "Relative error of the product against the condition number of the lagged dictionary (columns of unit norm), for "
    "random dictionaries between white noise and slow oscillations: median and quartiles over the trials. Above "
    "without noise, below with white noise of 1 % of the output; the bound is that of least squares to first order."
)
NOISE_CAPTION = (
    "Relative error of the product against white noise, as a share of the output's standard deviation, for the "
    "dictionary of table 5-2 at the record's rate: median and quartiles over the trials, and the first-order bound."
)
SCALE = (
    "The output fixes the product b z^T alone: b and z trade a factor that nobody can see. The thesis gives no numbers "
    "in its chapter 3; its dictionary of table 5-2 stands for the input here, taps and magnitudes are ours."
)
RANK = (
    "The lagged dictionary of table 5-2 lacks rank (three lags of one sinusoid are dependent), so that plain least "
    "squares has no single answer. The rank of the product makes it unique, and RISRO converges to it all the same; "
    "what the condition number costs is noise, as the bound says, not convergence."
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """A point of a sweep: its place, its errors (n_trials, n_methods), the median of their bound."""

    x: float
    errors: FloatArray
    bound: float

    def median(self, label: str) -> float:
        return float(np.median(self.errors[:, list(METHODS).index(label)]))


def fir(settings: Settings) -> Exhibit:
    """Return the example of chapter 3 on the thesis's dictionary, with sweeps over condition number and noise.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    theta = _thesis_atoms(settings)
    z = z_of(theta.shape[1])
    found = {label: identify_fir(output(theta, z), theta, n_taps=len(TAPS), **how) for label, how in METHODS.items()}
    exact, noisy, by_noise = _sweeps(theta, settings)
    n_trials = settings.trials_or(TRIALS, QUICK_TRIALS)
    ours = {label: error(one.product, z) for label, one in found.items()}
    return Exhibit(
        kicker="Reproduction",
        title="Thesis, chapter 3: blind identification of an FIR system",
        heading="Recovered by RISRO" if ours[RISRO] < 1e-8 else "Not recovered",
        verdict=f"Without noise RISRO has the product of impulse response and magnitudes to {ours[RISRO]:.1e}; the "
        f"nuclear norm is off by {100.0 * ours[NUCLEAR]:.0f} %.",
        facts=(
            ("Dictionary", f"table 5-2, {len(theta)} samples, magnitudes {', '.join(f'{one:g}' for one in z)}"),
            ("Impulse response", ", ".join(f"{tap:g}" for tap in TAPS)),
            ("Trials", f"{n_trials} per point, seed {settings.seed}"),
        ),
        tables=(comparison(_compared(ours, exact, noisy)), _details(found, z)),
        drawings=(
            Drawing(
                name="fir_condition",
                caption=CONDITION_CAPTION,
                panels=(_panel("no noise", CONDITION, exact), _panel("noise 1 %", CONDITION, noisy)),
            ),
            Drawing(name="fir_noise", caption=NOISE_CAPTION, panels=(_panel("", "noise / output [-]", by_noise),)),
        ),
        notes=(SCALE, RANK, _why(found[NUCLEAR], z)),
    )


def _thesis_atoms(settings: Settings) -> FloatArray:
    time_s = thesis_record(settings).time_s
    start_s = float(time_s[0])
    return signals(thesis_dictionary().resolved(start_s), time_s, ["tas"], window_start_s=start_s)[:, 0]


def _sweeps(theta: FloatArray, settings: Settings) -> tuple[list[_Point], list[_Point], list[_Point]]:
    """Return the points over condition numbers without and with noise, and those over noise."""
    noises, shares = (QUICK_NOISES, QUICK_SHARES) if settings.quick else (NOISES, SHARES)
    problems = [Problem(theta=None, white=share, noise=sd) for sd in (0.0, SWEEP_NOISE) for share in shares]
    problems += [Problem(theta=theta, white=0.0, noise=sd) for sd in noises]
    n_trials, n_shares = settings.trials_or(TRIALS, QUICK_TRIALS), len(shares)
    trials = [
        Trial(problem=problem, seed=(settings.seed, i, number))
        for i, problem in enumerate(problems)
        for number in range(n_trials)
    ]
    done: list[Outcome] = []
    for outcome, _ in in_order(run, trials, workers=settings.workers):
        done.append(outcome)
        settings.report(len(done), len(trials))
    points = [_point(problem, done[i * n_trials : (i + 1) * n_trials]) for i, problem in enumerate(problems)]
    return points[:n_shares], points[n_shares : 2 * n_shares], points[2 * n_shares :]


def _point(problem: Problem, outcomes: Sequence[Outcome]) -> _Point:
    condition = float(np.median([one.condition_number for one in outcomes]))
    return _Point(
        x=condition if problem.theta is None else problem.noise,
        errors=np.array([one.errors for one in outcomes]),
        bound=float(np.median([one.bound for one in outcomes])),
    )


def _panel(title: str, x_label: str, points: Sequence[_Point]) -> Panel:
    x = [point.x for point in points]
    errors = np.maximum([point.errors for point in points], LEAST)
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75), axis=1)
    curves = [
        curve(label, x, middle[:, i], style="bars", low=low[:, i], high=high[:, i]) for i, label in enumerate(METHODS)
    ]
    if all(point.bound for point in points):
        curves.append(curve("bound", x, [point.bound for point in points], style="dotted"))
    return Panel(
        title=title, x_label=x_label, y_label="relative error [-]", curves=tuple(curves), log_x=True, log_y=True
    )


def _compared(
    ours: Mapping[str, float], exact: Sequence[_Point], noisy: Sequence[_Point]
) -> list[tuple[str, str, str]]:
    worst = max(point.median(RISRO) for point in exact)
    ends = f"conditions {number(exact[0].x, digits=2)} to {number(exact[-1].x, digits=2)}"
    growth = f"{number(noisy[0].median(RISRO), digits=2)} to {number(noisy[-1].median(RISRO), digits=2)}"
    limits = f"{number(noisy[0].bound, digits=2)} to {number(noisy[-1].bound, digits=2)}"
    return [
        ("error of b z^T, RISRO, no noise", "converges near the truth (3-1)", f"{ours[RISRO]:.1e}"),
        ("the same, nuclear norm, penalty 0.001", "worse than RISRO (3-1)", f"{ours[NUCLEAR]:.2g}"),
        ("the same, nuclear norm, penalty 1e-6", "worse than RISRO (3-1)", f"{ours[WEAK]:.2g}"),
        (f"RISRO, no noise, {ends}", "convergence depends on it (3-1)", f"at most {worst:.1e}"),
        (f"RISRO, noise 1 %, {ends} (median)", "-", growth),
        ("  its first-order bound (root mean square)", "-", limits),
    ]


def _details(found: Mapping[str, FirResult], z: FloatArray) -> Table:
    heads = ("method", "error", "VAF [%]", "share of rank 1", "shrinkage", "sum of the taps", "their differences")
    rows = []
    for label, one in found.items():
        common, differing = _parts(one.product, z)
        numbers = (error(one.product, z), one.vaf, one.rank_one_share, one.shrinkage, common, differing)
        rows.append((label, *(number(value, digits=6 if i == 1 else 2) for i, value in enumerate(numbers))))
    return Table(
        name="fir", title="Table 5-2 without noise; last columns: error of a part", heads=heads, rows=tuple(rows)
    )


def _parts(product: FloatArray, z: FloatArray) -> tuple[float, float]:
    """Return the relative errors of the product summed over the taps, and of what differs between taps."""
    truth = np.outer(TAPS, z)
    off = product - truth
    common = np.linalg.norm(off.sum(axis=0)) / np.linalg.norm(truth.sum(axis=0))
    differing = np.linalg.norm(off - off.mean(axis=0)) / np.linalg.norm(truth - truth.mean(axis=0))
    return float(common), float(differing)


def _why(relaxed: FirResult, z: FloatArray) -> str:
    """Return why the nuclear norm errs on this dictionary, from the product it found."""
    common, differing = _parts(relaxed.product, z)
    size, true_size = np.linalg.norm(relaxed.product, "nuc"), np.linalg.norm(np.outer(TAPS, z), "nuc")
    taps = ", ".join(number(tap, digits=2) for tap in relaxed.taps)
    return (
        "Signals of table 5-2 change little from one sample to the next, so that their lags nearly coincide: the "
        f"output tells the sum of the taps (off by {100.0 * common:.0f} % with the nuclear norm) and hardly their "
        f"differences (off by {100.0 * differing:.0f} %). Among products that fit alike, those with equal taps have "
        f"the least nuclear norm ({number(float(size), digits=3)} found, {number(float(true_size), digits=3)} true), "
        f"and the penalty turns the taps to {taps} while {relaxed.vaf:.2f} % of the output is still explained. A "
        "smaller penalty turns them less."
    )
