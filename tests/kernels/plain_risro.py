"""Algorithm 3 written out plainly: every A_k kept, every sketch formed, one `lstsq` per step. Oracle and yardstick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bfi_cli.kernels.lagged import lagged

FloatArray = NDArray[np.float64]


def covariates(y: FloatArray, theta: FloatArray, order: int) -> FloatArray:
    """Return A (n_rows, n_atoms + 1, order + 1) of one output, y (n_samples,), theta (n_samples, n_atoms)."""
    n, n_atoms = theta.shape
    A = np.zeros((n - order, n_atoms + 1, order + 1))
    for i in range(order):
        A[:, :n_atoms, i] = -theta[order - i - 1 : n - i - 1]
        A[:, n_atoms, i] = y[order - i - 1 : n - i - 1]
    A[:, :n_atoms, order] = theta[order:]
    return A


def plain_risro(
    A: FloatArray, y: FloatArray, T: FloatArray, *, U: FloatArray, V: FloatArray, steps: int
) -> list[FloatArray]:
    """Return X after every step, from the orthonormal bases U (p1, r) and V (p2, r)."""
    n, p1, p2 = A.shape
    r, m = U.shape[1], T.shape[1]
    iterates = []
    for _ in range(steps):
        U_perp = np.linalg.qr(U, mode="complete")[0][:, r:]
        V_perp = np.linalg.qr(V, mode="complete")[0][:, r:]
        AV = (A.reshape(n * p1, p2) @ V).reshape(n, p1, r)
        A_B = np.matmul(U.T, AV).reshape(n, -1)
        A_D1 = np.matmul(U_perp.T, AV).reshape(n, -1)
        A_D2 = np.matmul(np.matmul(U.T, A), V_perp).reshape(n, -1)
        x = np.linalg.lstsq(np.hstack([T, A_B, A_D1, A_D2]), y, rcond=None)[0][m:]
        B = x[: r * r].reshape(r, r)
        D_1 = x[r * r : r * p1].reshape(p1 - r, r)
        D_2 = x[r * p1 :].reshape(r, p2 - r).T
        X_U = U @ B + U_perp @ D_1
        X_V = V @ B.T + V_perp @ D_2
        iterates.append(X_U @ np.linalg.pinv(B) @ X_V.T)
        U, V = np.linalg.qr(X_U)[0], np.linalg.qr(X_V)[0]
    return iterates


def plain_varx(
    u: FloatArray,
    y: FloatArray,
    theta: FloatArray,
    *,
    order: int,
    start: tuple[FloatArray, FloatArray],
    steps: int = 50,
) -> FloatArray:
    """Return z of one output after `steps` steps from (z, K)."""
    z, K = start
    T = np.hstack([np.ones((len(y) - order, 1)), lagged(u, range(1, order + 1))])
    U, V = (np.append(x, 1.0)[:, None] for x in (z, K))
    U, V = U / np.linalg.norm(U), V / np.linalg.norm(V)
    X = plain_risro(covariates(y[:, 0], theta[:, 0], order), y[order:, 0], T, U=U, V=V, steps=steps)[-1]
    return X[:-1, -1]
