"""Blind identification of an FIR system: its impulse response and its input from its output alone (thesis chapter 3).

The output is y(k) = sum_i b_i u(k-i), i = 1..n_taps, and the unknown input u(k) = theta(k) z lies in a dictionary of
known signals. The data determine only the product b z^T (b and z up to a factor), a matrix of rank 1: RISRO keeps the
rank, the nuclear norm penalises singular values instead, which shrinks them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...dictionary import signals
from ...errors import ConfigError, DictionaryError
from ...flightlog.record import frozen_array
from ...kernels import FloatArray
from ...kernels.progress import Termination
from ...kernels.risro import risro
from ...quantities.text import number
from ...report.content import Panel, ReportContent, curve
from .page import drawing, joined, load, report_content, table
from .record import Settings, thesis_dictionary, thesis_record, trials_of

# An arbitrary filter, and three arbitrary faults by their number in the dictionary.
TAPS = np.array([1.0, 0.5, -0.3])
SIZES = {1: 4.0, 2: 2.0, 6: 1.0}
METHODS = {"RISRO": None, "nuclear norm, penalty 0.001": 1e-3, "nuclear norm, penalty 1e-06": 1e-6}  # penalties
RISRO, NUCLEAR, WEAK = METHODS
N_SAMPLES, N_ATOMS, MOST_CYCLES = 1000, 7, 5  # of a random dictionary
# Over the output.
NOISES, QUICK_NOISES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), (1e-4, 1e-2)
SHARES, QUICK_SHARES = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001), (1.0, 0.03, 0.001)  # of white noise in a dictionary
TRIALS, QUICK_TRIALS = 100, 3  # of each noise
SWEEP_NOISE = 1e-2  # over the output, in the sweep over condition numbers
EPS = float(np.finfo(float).eps)
SAME = 1e-12  # two atoms are one where the cosine between them differs from 1 by less than round-off of their samples
LEAST = 1e-17  # what a log axis shows of an error of zero
CHECK_EVERY = 10  # steps between two looks at the duality gap, which costs as much as a step
# Boyd et al. (2011), section 3.4.1: the penalty parameter changes by 2 where one residual is ten times the other.
IMBALANCE, RESCALE = 10.0, 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuclearSolution:
    """The minimiser X, (p1, p2), exactly of low rank, with the number of steps and the reason of termination.

    `gap` is the duality gap over 1/2 ||y||^2, a bound on how far the objective lies above its minimum.
    """

    X: FloatArray
    gap: float
    iterations: int
    termination: Termination


def nuclear_least_squares(
    A: FloatArray, y: FloatArray, *, penalty: float, max_iterations: int = 20_000, tolerance: float = 1e-10
) -> NuclearSolution:
    """Minimise 1/2 ||y - A(X)||^2 + penalty ||X||_* over X, the convex stand-in for a rank constraint (section 3-1).

    The penalty lowers every singular value of the unpenalised solution by the same amount (exactly for orthonormal
    covariates), so that directions stay and sizes shrink. The solver is the alternating direction method of multipliers
    on the singular value decomposition of the covariates, whose steps do not depend on the number of samples; it stops
    on the duality gap, which bounds the distance to the minimum.

    Parameters
    ----------
    A : (n, p1, p2) covariates, A(X)_k = <A_k, X>.
    y : (n,).
    penalty : positive; X is zero from `largest_penalty` on.
    max_iterations, tolerance : limit of the steps, and the `gap` to stop at; round-off allows about 1e-12 at best.

    Raises
    ------
    ValueError : shapes disagree or the penalty is not positive.
    """
    if A.ndim != 3 or y.shape != (len(A),):
        raise ValueError(f"A must be (n, p1, p2) and y (n,), got {A.shape} and {y.shape}")
    if not penalty > 0:
        raise ValueError(f"the penalty must be positive, got {penalty:g}")
    # The covariates as U diag(values) V^T.
    U, values, Vt = np.linalg.svd(A.reshape(len(A), -1), full_matrices=False)
    shape, b, scale = A.shape[1:], U.T @ y, float(y @ y) / 2.0 or 1.0
    X, price = np.zeros(shape), np.zeros(shape)
    rho, gap = float(np.median(values**2)) or 1.0, np.inf
    termination, count = Termination.MAX_ITERATIONS, 0
    for count in range(1, max_iterations + 1):
        before, target = X, X - price
        # The minimiser of 1/2 ||y - A(X)||^2 + rho/2 ||X - target||^2.
        step = values * (b - values * (Vt @ target.ravel())) / (values**2 + rho)
        fitted = target + (Vt.T @ step).reshape(shape)
        X = soft_threshold(fitted + price, penalty / rho)
        price = price + fitted - X
        if count % CHECK_EVERY == 0 or count == max_iterations:
            # The duality gap: the residual, shortened until feasible, is the dual point.
            residual = b - values * (Vt @ X.ravel())
            steepest = float(np.linalg.norm((Vt.T @ (values * residual)).reshape(shape), 2))
            dual = residual * min(1.0, penalty / steepest) if steepest > 0.0 else residual
            objective = residual @ residual / 2.0 + penalty * np.linalg.norm(X, "nuc")
            gap = float(objective - dual @ (b - dual / 2.0)) / scale
            if gap <= tolerance:
                termination = Termination.CONVERGED
                break
            infeasible, moved = float(np.linalg.norm(fitted - X)), float(np.linalg.norm(X - before))
            factor = 1.0
            if infeasible > IMBALANCE * moved:
                factor = RESCALE
            elif moved > IMBALANCE * infeasible:
                factor = 1.0 / RESCALE
            rho, price = rho * factor, price / factor
    return NuclearSolution(X=X, gap=gap, iterations=count, termination=termination)


def soft_threshold(X: FloatArray, by: float) -> FloatArray:
    """Return X with its singular values lowered by `by`, those below it zero: the proximal map of by ||X||_*."""
    U, values, Vt = np.linalg.svd(X, full_matrices=False)
    return np.asarray((U * np.maximum(values - by, 0.0)) @ Vt)


def largest_penalty(A: FloatArray, y: FloatArray) -> float:
    """Return the smallest penalty at which the minimiser is zero: the spectral norm of sum_k y_k A_k."""
    return float(np.linalg.norm(np.tensordot(y, A, axes=1), 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirResult:
    """An impulse response and an input.

    Attributes
    ----------
    product : (n_taps, n_atoms) b z^T, of rank 1.
    taps : (n_taps,) b, of unit norm and with its largest entry positive.
    magnitudes : (n_atoms,) z, so that product = taps magnitudes^T.
    rank_one_share : largest singular value of the solution over the sum of all; 1 for a method that keeps rank 1.
    shrinkage : fraction by which the product is too small: product / (1 - shrinkage) fits the output best; 0 for RISRO.
    misfit, vaf : 2-norm of y minus its reconstruction, and 100 (1 - misfit^2 / ||y||^2), over the rows used.
    condition_number : of the lagged dictionary, columns scaled to unit norm; infinite if it lacks rank.
    termination : reason of the end of the iteration.
    """

    product: FloatArray
    taps: FloatArray
    magnitudes: FloatArray
    rank_one_share: float
    shrinkage: float
    misfit: float
    vaf: float
    condition_number: float
    termination: Termination


def identify_fir(y: FloatArray, theta: FloatArray, *, n_taps: int, penalty: float | None = None) -> FirResult:
    """Identify an FIR system and its input from its output (equations 3-1 to 3-16 of the thesis).

    Parameters
    ----------
    y : (n_samples,) output.
    theta : (n_samples, n_atoms) dictionary of the input.
    n_taps : length of the impulse response; the first `n_taps` samples only serve as past.
    penalty : of the nuclear norm, over the smallest one that gives zero, whose best approximation of rank 1 is
        returned; atoms count by their root mean square. None for RISRO, which keeps rank 1.

    Raises
    ------
    ConfigError : too few samples.
    DictionaryError : an atom is zero in the window, or equals another up to a factor.
    """
    most = (len(y) - theta.shape[1] + 1) // 2
    if not 1 <= n_taps <= most:
        raise ConfigError(
            f"fir: n_taps: {theta.shape[1]} atoms and {len(y)} samples allow 1 to {most} taps, got {n_taps}; "
            "take fewer taps or more samples"
        )
    scale = _atom_scales(theta[:-1])
    # Row k of the covariates holds theta(k-1) to theta(k-n_taps) (T, equation 3-7). By QR the problem has as few rows
    # as it has columns, and one.
    past = np.lib.stride_tricks.sliding_window_view(theta[:-1] / scale, n_taps, axis=0)
    flat = np.ascontiguousarray(past[:, :, ::-1].transpose(0, 2, 1)).reshape(len(y) - n_taps, -1)
    R = np.asarray(np.linalg.qr(np.column_stack([flat, y[n_taps:]]), mode="r"), dtype=np.float64)
    A, target = R[:, :-1].reshape(-1, n_taps, theta.shape[1]), R[:, -1]
    if penalty is None:
        solution = risro(A, target, rank=1)
        X, termination = solution.factors.X, solution.termination
    else:
        weight = penalty * (largest_penalty(A, target) or 1.0)
        relaxed = nuclear_least_squares(A, target, penalty=weight)
        X, termination = relaxed.X, relaxed.termination
    # The nearest matrix of rank 1.
    U, values, Vt = np.linalg.svd(X, full_matrices=False)
    X, total = values[0] * np.outer(U[:, 0], Vt[0]), float(values.sum())
    lagged = R[:, :-1] / (np.linalg.norm(R[:, :-1], axis=0) + EPS)
    spread = np.linalg.svd(lagged, compute_uv=False)
    dependent = len(R) < lagged.shape[1] or spread[-1] <= EPS * lagged.shape[1] * spread[0]
    fitted = np.tensordot(A, X)
    misfit, power, agreement = float(np.linalg.norm(target - fitted)), target @ target, fitted @ target
    product = X / scale
    taps = np.linalg.svd(product, full_matrices=False)[0][:, 0]
    taps = np.asarray(taps * np.sign(taps[np.argmax(np.abs(taps))]))
    return FirResult(
        product=frozen_array(product),
        taps=frozen_array(taps),
        magnitudes=frozen_array(product.T @ taps),
        rank_one_share=float(values[0]) / total if total else 1.0,
        shrinkage=float(1.0 - fitted @ fitted / agreement) if agreement > 0.0 else 0.0,
        misfit=misfit,
        vaf=float(100.0 * (1.0 - misfit**2 / (power or 1.0))),
        condition_number=float("inf") if dependent else float(spread[0] / spread[-1]),
        termination=termination,
    )


def _atom_scales(theta: FloatArray) -> FloatArray:
    """Return (n_atoms,) root mean squares; a zero atom, or one equal to another, is refused."""
    scale = np.sqrt(np.mean(theta**2, axis=0))
    for j in np.flatnonzero(scale == 0.0):
        raise DictionaryError(f"fir: theta[:, {j}] is zero in the whole window; leave it out")
    cosine = np.triu((theta / scale).T @ (theta / scale) / len(theta), 1)
    for i, j in np.argwhere(np.abs(cosine) > 1.0 - SAME):
        raise DictionaryError(f"fir: theta[:, {j}] equals theta[:, {i}] up to a factor; leave one out")
    return np.asarray(scale)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """A point of a sweep.

    Attributes
    ----------
    theta : (n_samples, n_atoms) dictionary; None to draw one in every trial.
    white : share of white noise in a drawn dictionary; the rest is slow oscillations, whose lags are nearly equal.
    noise : of the output, over its standard deviation.
    """

    theta: FloatArray | None
    white: float
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """A point of a sweep: its abscissa, the errors, (n_trials, n_methods), and the median of their bound."""

    x: float
    errors: FloatArray
    bound: float

    @property
    def risro(self) -> float:
        """The median error of RISRO."""
        return float(np.median(self.errors[:, list(METHODS).index(RISRO)]))


def run(trial: tuple[Problem, tuple[int, ...]]) -> list[float]:
    """Return the errors by method, their first-order bound and the condition number, of a problem and a trial's seed.

    The seed determines the noise of the output, and the dictionary if the problem has none.
    """
    problem, seed = trial
    rng = np.random.default_rng(seed)
    theta = slow_and_white(problem.white, rng) if problem.theta is None else problem.theta
    z = z_of(theta.shape[1])
    clean = output(theta, z)
    sd = problem.noise * float(np.std(clean))
    y = clean + sd * rng.standard_normal(len(clean))
    solutions = [identify_fir(y, theta, n_taps=len(TAPS), penalty=penalty) for penalty in METHODS.values()]
    return [*(error(solution.product, z) for solution in solutions), bound(theta, z, sd), solutions[0].condition_number]


def z_of(n_atoms: int) -> FloatArray:
    """Return (n_atoms,) the true magnitudes, three of them not zero."""
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
    """Return the example of chapter 3 on the thesis's dictionary, with sweeps over condition number and noise."""
    page, time_s = load("fir"), thesis_record(settings).time_s
    start_s = float(time_s[0])
    theta = signals(thesis_dictionary().resolved(start_s), time_s, ["tas"], window_start_s=start_s)[:, 0]
    z = z_of(theta.shape[1])
    truth = np.outer(TAPS, z)
    y = output(theta, z)
    solutions = {label: identify_fir(y, theta, n_taps=len(TAPS), penalty=penalty) for label, penalty in METHODS.items()}
    ours = {label: error(solution.product, z) for label, solution in solutions.items()}
    # The product summed over the taps, which the output determines well, and its differences between taps, badly.
    rows, parts = [], {}
    for label, solution in solutions.items():
        off = solution.product - truth
        common = float(np.linalg.norm(off.sum(axis=0)) / np.linalg.norm(truth.sum(axis=0)))
        differing = float(np.linalg.norm(off - off.mean(axis=0)) / np.linalg.norm(truth - truth.mean(axis=0)))
        parts[label] = {"common": 100.0 * common, "differing": 100.0 * differing}
        numbers = (ours[label], solution.vaf, solution.rank_one_share, solution.shrinkage, common, differing)
        rows.append((label, *(number(value, digits=6 if i == 1 else 2) for i, value in enumerate(numbers))))
    exact, noisy, by_noise = _sweeps(theta, settings)
    relaxed = solutions[NUCLEAR]
    values = {
        "risro": ours[RISRO],
        "nuclear": ours[NUCLEAR],
        "weak": ours[WEAK],
        "off": 100.0 * ours[NUCLEAR],
        "n_samples": len(theta),
        "magnitudes": ", ".join(f"{magnitude:g}" for magnitude in z),
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
    points = []
    for problem, outcomes in zip(problems, trials_of(run, problems, n_trials, settings), strict=True):
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
