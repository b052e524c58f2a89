"""The faulty VARX as a rank-one least squares, compressed (thesis eq. 4-24 and algorithm 3), and its sparse stage.

For one output, with corrected output yf = y - theta z and yf(k) = c + B u lags + K yf lags + e, the measured output is
<A_k, X> beside the base regressors, where X = [z; 1] [K', 1] and A_k = [[-theta lags, theta(k)], [y lags, 0]]: past
signals carry a minus sign. All of it happens on the triangular factor of `lagged.compress`, whose trailing block is A
and y with the base regressors projected out; a step costs the same for any record length.

The corner of A_k is zero, so only the rank condition ties the corner of X to 1. `corner="free"` is the published
algorithm: z and K are X's last column and row as they stand. They are not divided by the corner, which the rest of X
determines poorly or, without a fault, not at all, while the data fix the scale of that column and row.
`corner="imposed"` keeps X = [z; 1] [K', 1], which makes the step the Gauss-Newton step in (z, K).

With several outputs every block of X that belongs to an atom is z_j times the block [K_1 .. K_s, 1] of the outputs
(rank n_outputs overall), which only the imposed form keeps: its step is again the Gauss-Newton step in (z, K). What it
minimises is the prediction error whitened by that of the predictor without a fault (`WhitenedOutputs`), so that neither
the units of the outputs nor their order matter; a fault may act on any output there, so its signals are dense.

The stage makes magnitudes sparse by pseudo-measurements.

A pseudo-measurement claims that a norm of z was measured as zero (Carmi, Gurfil and Kanevsky 2010; thesis algorithm 2).
The published stage takes one such measurement of the whole norm, in whatever units z has. The stage of method risro,
`sparse_supports`, takes one per atom, in units of the atom's own standard deviation, as rows of RISRO's least squares:

    minimise misfit^2 / sigma^2 + (1/R) sum_j rho(|z_j| / s_j),  rho(x) = 1 - exp(-alpha x), x or x^p,

where s_j = sigma / |R_zz[:, j]| is the standard deviation of z_j with the other atoms known. A penalty that is concave
in z^2 lies below its tangent there, so the update "0 = z_j with weight W = rho'(x) / (2 R x) / s_j^2" lowers it.

The constants follow from the price c at which the criterion sells an atom. For orthogonal signatures a nonzero fixed
point obeys x_0 = x + rho'(x) / (2 R), x_0 being the magnitude without the stage. The right side is smallest at some
x_least, below which nothing survives, and its value there is the hard threshold, set to sqrt(c). For the exponential
x_least = ln u / alpha, u = alpha^2 / (2 R); for given R the threshold is largest at u = e, where x_least = 1 / alpha.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from . import FloatArray
from .compiled import einsum, lapack
from .lagged import PANEL, Compressed
from .progress import Iterate, StoppingRule, Termination, iterate
from .triangular import DEFICIENT, NO_SKETCH, least_squares
from .variable_projection import ProjectedRegression, project_inputs, without_signal

if TYPE_CHECKING:
    from .risro import Factors

Sparsity = Literal["none", "l1", "lp", "exp-l0"]
KINDS: tuple[str, ...] = get_args(Sparsity)

# The thesis's settings of its own stage (section 5-3): steepness, variance of the pseudo-measurement, prior variance.
PUBLISHED = {"alpha": 1.0, "r": 10.0, "p0": 1.0}
# Steps of the stage from one start; with seven and with eighty atoms it usually takes 5 to 20.
MAX_STEPS = 40
# In standard deviations, beside the least survivor's two: a magnitude below the first leaves the problem, since its
# weight only grows; steps below the second have settled.
NOTHING, SETTLED = 0.1, 0.01
# A number whose inverse and square are still numbers. No weight is below the second: equal atoms share a magnitude.
SMALLEST, ROUND_OFF = 1e-30, 1e-14


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseStage:
    """Settings of the stage; None is the derived value, in the published stage the thesis's.

    Attributes
    ----------
    kind : the penalty: "l1", "lp" (of exponent p), "exp-l0" (eq. 3-21), or "none".
    alpha : steepness of the exponential.
    p : exponent of "lp", in (0, 1].
    r : variance of the pseudo-measurement; the larger, the weaker the stage.
    p0 : prior variance of a magnitude in units of its own; None for no prior beside the data.
    updates : of the published stage per iteration.
    """

    kind: Sparsity = "none"
    alpha: float | None = None
    p: float = 0.5
    r: float | None = None
    p0: float | None = None
    updates: int = 1

    def __post_init__(self) -> None:
        """Refuse what has no meaning."""
        if self.kind not in KINDS:
            raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        positive = all(value is None or value > 0 for value in (self.alpha, self.r, self.p0))
        if not (positive and 0 < self.p <= 1 and self.updates >= 0):
            raise ValueError(f"need alpha > 0, r > 0, p0 > 0, 0 < p <= 1, updates >= 0, got {self}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SparseSolution:
    """Where the stage went from one start.

    Attributes
    ----------
    supports : the supports it visited, ascending atoms, in the order of their last visit.
    z : (n_atoms,) the last magnitudes, zero for what left the problem; K : (order,).
    iterations : steps made; converged : they settled.
    """

    supports: tuple[tuple[int, ...], ...]
    z: FloatArray
    K: FloatArray
    iterations: int
    converged: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WhitenedOutputs:
    """The regression of `ProjectedRegression` with rows (m) last.

    Attributes
    ----------
    y : (order + 1, n_outputs, m) outputs at lags 0..order.
    theta : (order + 1, n_outputs, n, m) signals of the atoms.
    atoms : (n,) of the dictionary, those with a signal.
    whiten : (n_outputs, n_outputs), measured outputs @ whiten are these.
    """

    y: FloatArray
    theta: FloatArray
    atoms: np.ndarray[tuple[int], np.dtype[np.intp]]
    whiten: FloatArray

    def coefficients(self, K: FloatArray) -> FloatArray:
        """Return (order n_outputs, n_outputs), past corrected outputs to outputs, of K in the outputs' own units.

        Of one output K is (order,), of several (order, n_outputs, n_outputs).
        """
        n_y = len(self.whiten)
        turned = np.linalg.solve(self.whiten, K.reshape(-1, n_y, n_y).transpose(0, 2, 1)) @ self.whiten
        return turned.reshape(-1, n_y)

    def predictor(self, H: FloatArray) -> FloatArray:
        """Return K in the outputs' own units of its coefficients here: the inverse of `coefficients`."""
        n_y = len(self.whiten)
        turned = self.whiten @ H.reshape(-1, n_y, n_y) @ np.linalg.inv(self.whiten)
        return turned.ravel() if n_y == 1 else turned.transpose(0, 2, 1)


def whitened_outputs(problem: ProjectedRegression, z: FloatArray, K: FloatArray) -> WhitenedOutputs:
    """Return the regression in coordinates in which the prediction errors of (z, K) are orthonormal.

    Where these depend on each other, as they do at round-off, each output is divided by its norm.

    Parameters
    ----------
    z : (n_atoms,) of the dictionary.
    K : (order,) of one output, which is left as it is; (order, n_outputs, n_outputs) of several.
    """
    y, (m, n_lags, n_y) = problem.y, problem.y.shape
    if n_y == 1:
        theta = problem.theta.transpose(1, 2, 0)[:, None]
        atoms = np.array([atom for _, atom in problem.signals], dtype=np.intp)
        return WhitenedOutputs(y=y.transpose(1, 2, 0), theta=theta, atoms=atoms, whiten=np.eye(1))
    less = problem
    for present in np.flatnonzero(z):
        less = without_signal(less, int(present), float(z[present]))
    error = less.y[:, 0] - einsum("kic,imc->km", less.y[:, 1:], K)
    norms = np.linalg.norm(y[:, 0], axis=0)
    norms[norms == 0.0] = 1.0
    R, whiten = np.linalg.qr(error / norms)[1], np.diag(1.0 / norms)
    if m >= n_y and np.linalg.cond(R) * DEFICIENT < 1.0:
        whiten = whiten @ np.linalg.inv(R)
    atoms = np.unique(np.array([atom for _, atom in problem.signals], dtype=np.intp))
    theta = np.zeros((n_lags, n_y, len(atoms), m))
    for column, (output, atom) in enumerate(problem.signals):
        signature = problem.theta[:, :, column].T[:, None] * whiten[output][:, None]
        theta[:, :, np.searchsorted(atoms, atom)] += signature
    return WhitenedOutputs(y=(y @ whiten).transpose(1, 2, 0), theta=theta, atoms=atoms, whiten=whiten)


def penalty_constants(stage: SparseStage, price: float) -> tuple[float, float, float]:
    """Return alpha (of "l1" and "lp" the exponent), R and x_least for an atom's price, see the module.

    A given alpha or R takes the place of the derived one.
    """
    threshold = np.sqrt(price)
    if stage.kind == "exp-l0":
        alpha = 2.0 / threshold if stage.alpha is None else stage.alpha
        R = 2.0 / (math.e * price) if stage.r is None else stage.r
        return alpha, R, max(float(np.log(alpha**2 / (2.0 * R))), 0.0) / alpha
    p = stage.p if stage.kind == "lp" else 1.0
    # x + p x^(p-1) / (2R) is least at x^(2-p) = p (1-p) / (2R), where it is x (2-p) / (1-p); for p = 1 it is 1 / (2R).
    if stage.r is not None:
        return p, stage.r, float((p * (1.0 - p) / (2.0 * stage.r)) ** (1.0 / (2.0 - p)))
    least = threshold * (1.0 - p) / (2.0 - p)
    return p, float(p * least ** (p - 1.0) / (2.0 * (threshold - least))), float(least)


def sparse_supports(
    problem: ProjectedRegression,
    z: FloatArray,
    K: FloatArray,
    *,
    stage: SparseStage,
    price: float,
    guarded: bool = False,
) -> SparseSolution:
    """Follow the stage from a start to its fixed point.

    Parameters
    ----------
    problem : with more rows than unknowns. Several outputs are whitened by the prediction error of the start.
    z : (n_atoms,) and K of the start, (order,) of one output, (order, n_outputs, n_outputs) of several.
    price : of an atom in the criterion.
    guarded : the first step is not a plain one of RISRO but takes every magnitude as the least survivor of the
        exponential, whose weight is 1. Where the atoms are many and alike, a plain step makes all of them large.
    """
    shape, R, least = penalty_constants(stage, price)
    prior = 0.0 if stage.p0 is None else 1.0 / stage.p0
    n_atoms, n_y, outputs = len(z), problem.n_outputs, whitened_outputs(problem, z, K)
    live, theta, y, H = outputs.atoms, outputs.theta, outputs.y, outputs.coefficients(K)
    floor_variance, n_past = problem.floor**2 * np.sum(outputs.whiten**2) / n_y, len(H)
    z, dof = z[live], float(len(live))
    supports: dict[tuple[int, ...], None] = {}
    settled, count = not len(live), 0
    while not settled and count < MAX_STEPS:
        # 1. Linearise at (z, K): the columns of K, those of z, and the residual, of every output.
        n, corrected = len(z), (y - z @ theta).reshape(n_past + n_y, -1)
        stacked, predictor = np.empty((n_past + (n + 1) * n_y, y.shape[2])), np.hstack([np.eye(n_y), -H.T])
        stacked[:n_past] = corrected[n_y:]
        signatures = np.tensordot(predictor, theta.reshape(len(corrected), n, -1), axes=1)
        stacked[n_past:-n_y], errors = signatures.reshape(n * n_y, -1), predictor @ corrected
        stacked[-n_y:], residual = errors, errors.ravel()
        size = len(stacked)
        whole = np.triu(lapack.dgeqrt(min(PANEL, size), stacked.T, overwrite_a=True)[0][:size])
        across, below = whole[:n_past, n_past:], whole[n_past:, n_past:]
        triangle = below
        if n_y > 1:
            each = below[:, :-n_y].reshape(len(below), n_y, n), below[:, -n_y:, None]
            rows = np.concatenate(each, axis=2).transpose(1, 0, 2).reshape(-1, n + 1)
            triangle = np.linalg.qr(rows, mode="r")
        R_zz = triangle[:-1, :-1]
        # 2. The unit of each magnitude: its standard deviation with K eliminated and the other atoms known.
        degrees = max(n_y * (problem.n_rows - problem.n_base - n_past) - dof, 1.0)
        sigma = np.sqrt(residual @ residual / degrees + floor_variance)
        norms = np.maximum(np.linalg.norm(R_zz, axis=0), SMALLEST)
        sd = sigma / norms
        # 3. The pseudo-measurements 0 = z_j: their weights are the slope of the penalty at |z_j|, and the prior.
        x = np.maximum(np.abs(z) / sd, SMALLEST)
        slope = shape * (np.exp(-shape * x) if stage.kind == "exp-l0" else x ** (shape - 1.0))
        W = slope / (2.0 * R * x) + prior if count else np.full(n, float(guarded))
        w = norms * np.sqrt(np.maximum(W, ROUND_OFF))
        # 4. The step: least squares over the triangle and the pseudo-measurements below it.
        claims = np.column_stack([np.diag(w), -w * z])
        S = np.triu(lapack.dtpqrt(n, min(PANEL, n + 1), triangle, claims)[0])
        dz = lapack.dtrtrs(S[:n, :n], S[:n, -1])[0]
        left = (across[:, i - n_y] - across[:, i * n : (i + 1) * n] @ dz for i in range(n_y))
        dH = np.column_stack([least_squares(whole[:n_past, :n_past], column)[0] for column in left])
        dof = n - float(np.sum((w[:, None] * lapack.dtrtri(S[:n, :n])[0]) ** 2))
        z, H, count = z + dz, H + dH, count + 1
        if count == 1:
            continue
        # 5. Magnitudes above the least survivor are a support; those that are nothing leave the problem.
        x = np.abs(z) / sd
        supports.pop(support := tuple(live[x > least].tolist()), None)
        supports[support] = None
        keep = x >= NOTHING
        settled = not keep.any() or bool(keep.all() and np.all(np.abs(dz) < SETTLED * sd))
        z, live, theta = z[keep], live[keep], theta if keep.all() else theta[:, :, keep]
    every = np.zeros(n_atoms)
    every[live] = z
    return SparseSolution(
        supports=tuple(supports), z=every, K=outputs.predictor(H), iterations=count, converged=settled
    )


def pseudo_norm(z: FloatArray, stage: SparseStage) -> tuple[float, FloatArray]:
    """Return the published stage's norm of z and its gradient (zero where an entry is zero)."""
    size, sign = np.abs(z), np.sign(z)
    if stage.kind == "exp-l0":
        alpha = PUBLISHED["alpha"] if stage.alpha is None else stage.alpha
        decay = np.exp(-alpha * size)
        return float(np.sum(1.0 - decay)), alpha * sign * decay
    p = stage.p if stage.kind == "lp" else 1.0
    largest = size.max(initial=0.0)
    if largest == 0.0:
        return 0.0, sign
    norm = largest * np.sum((size / largest) ** p) ** (1.0 / p)
    ratio = np.divide(norm, size, out=np.zeros_like(size), where=size > 0)
    return float(norm), sign * ratio ** (1.0 - p)


def published_updates(z: FloatArray, stage: SparseStage) -> tuple[FloatArray, int]:
    """Return z after the updates of the published stage, and how many really changed it (eq. 3-20 to 3-22).

    With h(z) the norm and H its gradient the update is ``z - K h(z)``, ``K = P H' / (H P H' + R)``. The thesis prints
    the exponential stage's H as minus the gradient; eq. 3-22 then has the wrong sign and algorithm 3 the right one,
    which is this. An entry that is exactly zero has no gradient and stays zero.
    """
    z, made = np.array(z, dtype=np.float64), 0
    if stage.kind == "none" or not z.size:
        return z, made
    R = PUBLISHED["r"] if stage.r is None else stage.r
    P = (PUBLISHED["p0"] if stage.p0 is None else stage.p0) * np.eye(z.size)
    for _ in range(stage.updates):
        norm, H = pseudo_norm(z, stage)
        PH = P @ H
        gain = PH / (H @ PH + R)
        made += bool(np.any(gain * norm))
        z, P = z - gain * norm, P - np.outer(gain, PH)
    return z, made


Corner = Literal["free", "imposed"]

# The thesis makes 50 steps and does not test for convergence.
PUBLISHED_STEPS = StoppingRule(max_iterations=50, fixed=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VarxSolution:
    """A VARX and the fault magnitudes that go with it.

    Attributes
    ----------
    z : (n_atoms,) magnitudes, 0 for an atom that is zero in the whole record.
    K : (order,) coefficients of the past corrected outputs, lag 1 first; of several outputs (order, n_outputs,
        n_outputs), where K[i - 1] multiplies yf(k - i).
    misfit : 2-norm of the prediction error of this model; of several outputs whitened, so that the predictor without a
        fault has the root of their number.
    squares : (n_outputs, n_outputs) sums of squares and products of the prediction error, not whitened.
    corner : X's corner; 1 where it is imposed.
    iterations, termination : steps made, and why no more were.
    condition_number : of the last sketched regressor, columns scaled to unit norm.
    updates : pseudo-measurement updates really made.
    """

    z: FloatArray
    K: FloatArray
    misfit: float
    squares: FloatArray
    corner: float
    iterations: int
    termination: Termination
    condition_number: float
    updates: int


def risro_varx(
    data: Compressed,
    *,
    initial: tuple[FloatArray, FloatArray] | None = None,
    corner: Corner = "imposed",
    settings: StoppingRule | None = None,
    as_published: bool = False,
    sparse: SparseStage | None = None,
) -> VarxSolution:
    """Fit a VARX together with the magnitudes of the faults in its record.

    Parameters
    ----------
    data : from `lagged.compress`.
    initial : (z, K) to start from; by default z and K as the unconstrained least squares has them in the last column
        and row of X: the rest of X, far less certain, would spoil the rank-one part of the whole.
    corner : see the module.
    settings : when to stop.
    as_published : 50 steps with a free corner and no stopping, whatever `corner` and `settings` say.
    sparse : the published pseudo-measurement stage, after every step but the last; only `as_published` has it.

    Raises
    ------
    ValueError : a free corner with several outputs, or fewer rows than unknowns.
    """
    columns, rule = data.columns, settings or StoppingRule()
    _check_size(data, one_output=as_published or corner == "free")
    if columns.n_outputs != 1:
        return _several_outputs(project_inputs(data, columns.order), columns.n_atoms, initial, rule)
    corner, rule = ("free", PUBLISHED_STEPS) if as_published else (corner, rule)

    A, y = _covariates(data)
    live = np.array([atom for _, atom in columns.signals], dtype=np.intp)
    start = _start(A, y) if initial is None else (initial[0][live], initial[1])

    stage, updates = sparse if as_published and sparse else SparseStage(), 0

    def sparsify(factors: Factors) -> Factors:
        nonlocal updates
        z, K = _read(factors)
        z, made = published_updates(z, stage)
        updates += made
        return _pair(z, K)

    if corner == "free":
        from .risro import risro

        free = risro(
            A,
            y,
            rank=1,
            initial=_pair(*start),
            max_iterations=rule.max_iterations,
            tolerance=rule.tolerance,
            fixed=rule.fixed,
            between=sparsify if stage.kind != "none" and stage.updates > 0 else None,
        )
        z, K = _read(free.factors)
        misfit, corner_value = _state(A, y, z, K, NO_SKETCH).misfit, float(free.factors.X[-1, -1])
        iterations, termination, condition_number = free.iterations, free.termination, free.condition_number
    else:
        last, iterations, termination = iterate(
            lambda state: _gauss_newton(A, y, state),
            _state(A, y, *start, NO_SKETCH),
            scale=float(np.linalg.norm(y)),
            settings=rule,
        )
        z, K, misfit, corner_value = last.z, last.K, last.misfit, 1.0
        condition_number = float(np.linalg.cond(np.triu(last.sketch)))

    whole = np.zeros(columns.n_atoms)
    whole[live] = z
    return VarxSolution(
        z=whole,
        K=K,
        misfit=misfit,
        squares=np.array([[misfit**2]]),
        corner=corner_value,
        iterations=iterations,
        termination=termination,
        condition_number=condition_number,
        updates=updates,
    )


def _check_size(data: Compressed, *, one_output: bool) -> None:
    columns = data.columns
    if columns.n_outputs != 1 and one_output:
        raise ValueError(f"the published form has one output, got {columns.n_outputs}; impose the corner")
    unknowns = columns.n_base + columns.order * columns.n_outputs + len(columns.signals) + 1
    if data.n_rows < unknowns:
        raise ValueError(f"{data.n_rows} rows are fewer than the {unknowns} unknowns; lower the order")


def _covariates(data: Compressed) -> tuple[FloatArray, FloatArray]:
    """Return the covariates A (n, n_live + 1, s + 1) and y (n,): the trailing block of R."""
    columns, s = data.columns, data.columns.order
    R, n = data.R[columns.n_base :], len(columns.signals)
    A = np.zeros((len(R), n + 1, s + 1))
    A[:, :n, :s] = -R[:, columns.theta_lags].reshape(len(R), s, n).transpose(0, 2, 1)
    A[:, :n, s] = R[:, columns.theta]
    A[:, n, :s] = R[:, columns.y_lags]
    return A, R[:, columns.y.start]


def _several_outputs(
    problem: ProjectedRegression,
    n_atoms: int,
    initial: tuple[FloatArray, FloatArray] | None,
    settings: StoppingRule,
) -> VarxSolution:
    """Return the minimum over (z, K) of the whitened prediction error; see `risro_varx`."""
    y, now, n_y = problem.y.reshape(len(problem.y), -1), problem.y[:, 0], problem.n_outputs
    past, n_past = y[:, n_y:], y.shape[1] - n_y
    z, K = np.zeros(n_atoms), _predictors(past, now).reshape(-1, n_y, n_y).transpose(0, 2, 1)
    outputs = whitened_outputs(problem, z, K)
    atoms = outputs.atoms
    if initial is not None:
        z, K = initial
    elif len(y) >= n_past + problem.theta[0].size:
        # As of one output: z and K where the unconstrained least squares has them by themselves.
        free = _predictors(np.hstack([past, problem.theta.reshape(len(y), -1)]), now)
        K = free[:n_past].reshape(-1, n_y, n_y).transpose(0, 2, 1)
        shares = np.zeros(n_atoms)
        for column, (output, atom) in enumerate(problem.signals, start=n_past):
            z[atom] += free[column, output]
            shares[atom] += 1.0
        z /= np.maximum(shares, 1.0)
    last, iterations, termination = iterate(
        lambda state: _joint_step(outputs, state),
        _joint_state(outputs, z[atoms], outputs.coefficients(K), NO_SKETCH),
        scale=float(np.linalg.norm(outputs.y[0])),
        settings=settings,
    )
    whole = np.zeros(n_atoms)
    whole[atoms] = last.z
    K = outputs.predictor(last.K)
    error = last.error.T @ np.linalg.inv(outputs.whiten)
    return VarxSolution(
        z=whole,
        K=K,
        misfit=last.misfit,
        squares=error.T @ error,
        corner=1.0,
        iterations=iterations,
        termination=termination,
        condition_number=float(np.linalg.cond(np.triu(last.sketch))),
        updates=0,
    )


def _predictors(regressors: FloatArray, outputs: FloatArray) -> FloatArray:
    """Return the least squares of every output, (n_regressors, n_outputs)."""
    return np.column_stack([least_squares(regressors, output)[0] for output in outputs.T])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State(Iterate):
    """An iterate with corner 1, and the triangular factor of the sketch behind it.

    Attributes
    ----------
    K : of one output (order,); of several (n_past, n_outputs), of past corrected outputs to outputs.
    regressors : of one output A times its right factor, (n, n_atoms + 1); of several the past corrected outputs,
        (n_past, n).
    error : of the prediction, (n,), of several outputs (n_outputs, n).
    """

    z: FloatArray
    K: FloatArray
    X: FloatArray
    regressors: FloatArray
    error: FloatArray
    misfit: float
    sketch: FloatArray


def _joint_state(outputs: WhitenedOutputs, z: FloatArray, H: FloatArray, sketch: FloatArray) -> _State:
    corrected = outputs.y - z @ outputs.theta
    past = corrected[1:].reshape(len(H), -1)
    error = corrected[0] - H.T @ past
    X = np.outer(np.append(z, 1.0), np.append(H, 1.0))
    misfit = float(np.linalg.norm(error))
    return _State(z=z, K=H, X=X, regressors=past, error=error, misfit=misfit, sketch=sketch)


def _joint_step(outputs: WhitenedOutputs, state: _State) -> _State:
    """Return the iterate after a step in (z, K)."""
    theta, H, n_y = outputs.theta, state.K, len(outputs.whiten)
    signatures = theta[0] - np.tensordot(H.T, theta[1:].reshape(len(H), *theta.shape[2:]), axes=1)
    S = np.hstack([np.kron(np.eye(n_y), state.regressors.T), signatures.transpose(0, 2, 1).reshape(-1, len(state.z))])
    x, sketch = least_squares(S, state.error.ravel())
    return _joint_state(outputs, state.z + x[H.size :], H + x[: H.size].reshape(n_y, -1).T, sketch)


def sparse_varx(
    problem: ProjectedRegression, whole: VarxSolution | None, *, n_atoms: int, stage: SparseStage, price: float
) -> tuple[SparseSolution, ...]:
    """Follow the sparsity stage from its two starts: converged RISRO, and no fault with the predictor of that.

    Alone either misses a third of the true supports: RISRO fits all atoms at once, and the predictor without a fault
    has absorbed a part of the faults. None where the atoms are too many for the rows.

    Parameters
    ----------
    problem, n_atoms : of the dictionary.
    whole : RISRO's solution; None leaves its start out, and guards the first step of the other.
    stage, price : see `sparse_supports`.
    """
    n_y, past = problem.n_outputs, problem.y[:, 1:].reshape(len(problem.y), -1)
    if len(past) <= past.shape[1] + len(problem.signals):
        return ()
    K = _predictors(past, problem.y[:, 0])
    plain = np.zeros(n_atoms), K[:, 0] if n_y == 1 else K.reshape(-1, n_y, n_y).transpose(0, 2, 1)
    if whole is None:
        return (sparse_supports(problem, *plain, stage=stage, price=price, guarded=True),)
    starts = (whole.z, whole.K), plain
    return tuple(sparse_supports(problem, z, K, stage=stage, price=price) for z, K in starts)


def _state(A: FloatArray, y: FloatArray, z: FloatArray, K: FloatArray, sketch: FloatArray) -> _State:
    left, right = np.append(z, 1.0), np.append(K, 1.0)
    AV = A @ right
    residual = y - AV @ left
    misfit = float(np.linalg.norm(residual))
    return _State(z=z, K=K, X=np.outer(left, right), regressors=AV, error=residual, misfit=misfit, sketch=sketch)


def _gauss_newton(A: FloatArray, y: FloatArray, state: _State) -> _State:
    """Return the iterate after a step in (z, K), the corner of X held at 1."""
    S = np.hstack([state.regressors[:, :-1], (np.append(state.z, 1.0) @ A)[:, :-1]])
    x, sketch = least_squares(S, state.error)
    return _state(A, y, state.z + x[: len(state.z)], state.K + x[len(state.z) :], sketch)


def _start(A: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return z and K of the unconstrained least squares, X's corner being 1; no fault where the rows are too few."""
    if len(A) < A[0].size - 1:
        return np.zeros(A.shape[1] - 1), least_squares(A[:, -1, :-1], y)[0]
    X = np.append(least_squares(A.reshape(len(A), -1)[:, :-1], y)[0], 1.0).reshape(A.shape[1:])
    return X[:-1, -1], X[-1, :-1]


def _pair(z: FloatArray, K: FloatArray) -> Factors:
    from .risro import Factors

    return Factors(left=np.append(z, 1.0)[:, None], right=np.append(K, 1.0)[:, None])


def _read(factors: Factors) -> tuple[FloatArray, FloatArray]:
    """Return z and K, X's last column and row."""
    left, right = factors.left[:, 0], factors.right[:, 0]
    return left[:-1] * right[-1], left[-1] * right[:-1]
