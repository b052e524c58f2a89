"""Blind identification of an FIR system: its impulse response and its input from its output alone (thesis chapter 3).

The output is y(k) = sum_i b_i u(k-i), i = 1..n_taps, and the unknown input u(k) = theta(k) z lies in a dictionary of
known signals. Only the product b z^T can be told from the data (b and z up to a factor), and it is a matrix of rank 1:
`risro` keeps it one, `nuclear` asks for a small nuclear norm instead and pays with shrunken values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from .errors import ConfigError, DictionaryError
from .faults import did_you_mean
from .flightlog.record import frozen_array
from .kernels.nuclear_norm import NuclearSolution, largest_penalty, nuclear_least_squares
from .kernels.risro import RisroSolution, risro
from .kernels.termination import Termination

__all__ = ["FirResult", "identify_fir"]

FloatArray = NDArray[np.float64]
Method = Literal["risro", "nuclear"]

EPS = float(np.finfo(float).eps)
# Two atoms are one where the cosine between them differs from 1 by less than round-off of their samples.
SAME = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirResult:
    """An impulse response and an input.

    Attributes
    ----------
    product : (n_taps, n_atoms) b z^T, of rank 1.
    taps : (n_taps,) b, of unit norm and with its largest entry positive.
    magnitudes : (n_atoms,) z, so that product = taps magnitudes^T.
    input : (n_samples,) theta z.
    rank_one_share : largest singular value of the matrix found over their sum; 1 where the method keeps rank 1.
    shrinkage : how much of its size the product has lost, as a fraction: product / (1 - shrinkage) fits the output
        best; 0 for `risro`.
    misfit, vaf : 2-norm of y minus its reconstruction, and 100 (1 - misfit^2 / ||y||^2), over the rows used.
    condition_number : of the lagged dictionary, columns scaled to unit norm; infinite where it lacks rank.
    method, penalty : how it was found; the penalty over the smallest one that gives zero, None for `risro`.
    iterations, termination : steps made, and why no more were.
    """

    product: FloatArray
    taps: FloatArray
    magnitudes: FloatArray
    input: FloatArray
    rank_one_share: float
    shrinkage: float
    misfit: float
    vaf: float
    condition_number: float
    method: Method
    penalty: float | None
    iterations: int
    termination: Termination


def identify_fir(
    y: FloatArray,
    theta: FloatArray,
    *,
    n_taps: int,
    method: Method = "risro",
    penalty: float = 1e-3,
    max_iterations: int | None = None,
    tolerance: float = 1e-10,
) -> FirResult:
    """Identify an FIR system and its input from its output (equations 3-1 to 3-16 of the thesis).

    Parameters
    ----------
    y : (n_samples,) output.
    theta : (n_samples, n_atoms) dictionary of the input.
    n_taps : length of the impulse response; the first `n_taps` samples only serve as past.
    method : "risro" (rank 1 kept) or "nuclear" (nuclear norm penalised; its best approximation of rank 1 is returned).
    penalty : of "nuclear", over the smallest one that gives zero; atoms count by their root mean square.
    max_iterations : default 50 for "risro", 20 000 for "nuclear".
    tolerance : relative change of the product to stop at, or the duality gap of "nuclear" over 1/2 ||y||^2.

    Raises
    ------
    ConfigError : shapes or settings do not fit.
    DictionaryError : an atom is zero in the window, or equals another up to a factor.
    """
    y, theta = np.asarray(y, dtype=np.float64), np.asarray(theta, dtype=np.float64)
    _check(y, theta, n_taps=n_taps, method=method, penalty=penalty)
    scale = _atom_scales(theta[:-1])
    # Row k of the covariates holds theta(k-1) to theta(k-n_taps) (T, equation 3-7). By QR the problem has as few rows
    # as it has columns, and one.
    past = np.lib.stride_tricks.sliding_window_view(theta[:-1] / scale, n_taps, axis=0)
    flat = np.ascontiguousarray(past[:, :, ::-1].transpose(0, 2, 1)).reshape(len(y) - n_taps, -1)
    R = np.asarray(np.linalg.qr(np.column_stack([flat, y[n_taps:]]), mode="r"), dtype=np.float64)
    A, target = R[:, :-1].reshape(-1, n_taps, theta.shape[1]), R[:, -1]
    limits: dict[str, Any] = {"tolerance": tolerance}
    if max_iterations is not None:
        limits["max_iterations"] = max_iterations
    solution: RisroSolution | NuclearSolution
    if method == "risro":
        solution = risro(A, target, rank=1, **limits)
        X = solution.factors.X
    else:
        weight = penalty * (largest_penalty(A, target) or 1.0)
        solution = nuclear_least_squares(A, target, penalty=weight, **limits)
        X = solution.X
    # The nearest matrix of rank 1.
    U, values, Vt = np.linalg.svd(X, full_matrices=False)
    X, total = values[0] * np.outer(U[:, 0], Vt[0]), float(values.sum())
    fitted = np.tensordot(A, X)
    misfit, power, agreement = float(np.linalg.norm(target - fitted)), target @ target, fitted @ target
    product = X / scale
    taps = np.linalg.svd(product, full_matrices=False)[0][:, 0]
    taps = np.asarray(taps * np.sign(taps[np.argmax(np.abs(taps))]))
    magnitudes = product.T @ taps
    return FirResult(
        product=frozen_array(product),
        taps=frozen_array(taps),
        magnitudes=frozen_array(magnitudes),
        input=frozen_array(theta @ magnitudes),
        rank_one_share=float(values[0]) / total if total else 1.0,
        shrinkage=float(1.0 - fitted @ fitted / agreement) if agreement > 0.0 else 0.0,
        misfit=misfit,
        vaf=float(100.0 * (1.0 - misfit**2 / (power or 1.0))),
        condition_number=_condition(A),
        method=method,
        penalty=None if method == "risro" else penalty,
        iterations=solution.iterations,
        termination=solution.termination,
    )


def _check(y: FloatArray, theta: FloatArray, *, n_taps: int, method: str, penalty: float) -> None:
    if theta.ndim != 2 or theta.shape[1] < 1 or y.shape != (len(theta),):
        raise ConfigError(
            f"fir: y must be (n_samples,) and theta (n_samples, n_atoms), got {y.shape} and {theta.shape}"
        )
    if method not in get_args(Method):
        raise ConfigError(f"fir: method: unknown, got '{method}'{did_you_mean(method, get_args(Method))}")
    if not (np.isfinite(y).all() and np.isfinite(theta).all()):
        raise ConfigError("fir: y and theta must be finite numbers; cut the samples that are not")
    unknown = n_taps + theta.shape[1] - 1
    if not 1 <= n_taps <= len(y) - unknown:
        raise ConfigError(
            f"fir: n_taps: {theta.shape[1]} atoms and {len(y)} samples allow 1 to "
            f"{(len(y) - theta.shape[1] + 1) // 2} taps, got {n_taps}; take fewer taps or more samples"
        )
    if not 0.0 < penalty < 1.0:
        raise ConfigError(f"fir: penalty: must lie between 0 and 1, got {penalty:g}; change it")


def _atom_scales(theta: FloatArray) -> FloatArray:
    """Return (n_atoms,) root mean squares, all atoms being alive and different."""
    scale = np.sqrt(np.mean(theta**2, axis=0))
    for j in np.flatnonzero(scale == 0.0):
        raise DictionaryError(f"fir: theta[:, {j}] is zero in the whole window; leave it out")
    cosine = np.triu((theta / scale).T @ (theta / scale) / len(theta), 1)
    for i, j in np.argwhere(np.abs(cosine) > 1.0 - SAME):
        raise DictionaryError(f"fir: theta[:, {j}] equals theta[:, {i}] up to a factor; leave one out")
    return np.asarray(scale)


def _condition(A: FloatArray) -> float:
    flat = A.reshape(len(A), -1)
    if len(flat) < flat.shape[1]:
        return float("inf")
    values = np.linalg.svd(flat / (np.linalg.norm(flat, axis=0) + EPS), compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > EPS * flat.shape[1] * values[0] else float("inf")
