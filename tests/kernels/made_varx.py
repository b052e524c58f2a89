"""Random stable predictors, records flown with them, and least squares with nothing clever, as oracles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bfi_cli.kernels.lagged import lagged

RADIUS = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """y = c + sum B_i u(k-i) + sum K_i y(k-i) + e: B (order + 1, n_y, n_u) from lag 0, K (order, n_y, n_y) from 1."""

    c: np.ndarray
    B: np.ndarray
    K: np.ndarray

    def fly(self, n: int, rng: np.random.Generator, *, noise_sd: object = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return u (n, n_u), white, and y (n, n_y)."""
        order, n_y = len(self.K), len(self.c)
        u = rng.standard_normal((n, self.B.shape[2]))
        y = np.zeros((n, n_y))
        e = np.asarray(noise_sd) * rng.standard_normal((n, n_y))
        for k in range(order, n):
            y[k] = self.c + self.B[0] @ u[k] + e[k]
            for i in range(1, order + 1):
                y[k] += self.B[i] @ u[k - i] + self.K[i - 1] @ y[k - i]
        return u, y


def made(rng: np.random.Generator, *, order: int = 2, n_u: int = 1, n_y: int = 1, feedthrough: bool = False) -> Made:
    """Draw a predictor whose slowest pole has modulus `RADIUS`."""
    K = rng.standard_normal((order, n_y, n_y))
    companion = np.eye(order * n_y, k=-n_y)
    companion[:n_y] = np.hstack(list(K))
    radius = np.abs(np.linalg.eigvals(companion)).max()
    K *= (RADIUS / radius) ** np.arange(1, order + 1)[:, None, None]
    B = rng.standard_normal((order + 1, n_y, n_u))
    B[0] *= feedthrough
    return Made(c=rng.standard_normal(n_y), B=B, K=K)


def wave(n: int, onset: int, shape: str) -> np.ndarray:
    """Return a step, a ramp (to 1 at the end) or an oscillation that starts at sample `onset`."""
    k = np.maximum(np.arange(n) - onset, 0)
    signal = {"step": np.ones(n), "ramp": k / (n - onset), "wave": np.sin(0.7 * k)}[shape]
    return np.where(np.arange(n) >= onset, signal, 0.0)


def dictionary(n: int, *, n_y: int = 1, n_atoms: int = 3) -> np.ndarray:
    """Return theta (n, n_y, n_atoms), shapes, onsets and outputs in turn."""
    theta = np.zeros((n, n_y, n_atoms))
    for j in range(n_atoms):
        shape = ("step", "wave", "ramp")[j % 3]
        theta[:, j % n_y, j] = wave(n, round(n * (0.25 + 0.5 * j / n_atoms)), shape)
    return theta


def explicit_error(u, y, theta, z, *, order: int, feedthrough: bool, first: int | None = None) -> np.ndarray:
    """Return the prediction error of the least-squares VARX of the corrected outputs."""
    corrected = y - theta @ z
    rows = len(y) - (order if first is None else first)
    lags = range(0 if feedthrough else 1, order + 1)
    X = np.hstack(
        [np.ones((rows, 1)), lagged(u, lags, first=first or order), lagged(corrected, range(1, order + 1), first=first)]
    )
    now = corrected[-rows:]
    return now - X @ np.linalg.lstsq(X, now, rcond=None)[0]
