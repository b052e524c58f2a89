"""A random linear system whose states are measured, and failures of its sensors."""

from __future__ import annotations

import numpy as np


def flown(n: int = 120, *, n_y: int = 3, n_u: int = 2, seed: int = 0):
    """Return (y, u) of x(k+1) = A x(k) + B u(k), y = T x + D u with a regular T, driven by white noise."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n_y, n_y))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    B, D = rng.standard_normal((n_y, n_u)), rng.standard_normal((n_y, n_u))
    T = np.linalg.qr(rng.standard_normal((n_y, n_y)))[0]
    u, x = rng.standard_normal((n, n_u)), np.zeros((n, n_y))
    for k in range(n - 1):
        x[k + 1] = A @ x[k] + B @ u[k]
    return x @ T.T + u @ D.T, u


def failed(y, k: int, channels, *, gain: float = 0.9, lasting: int | None = None):
    """Return y with a gain in some channels from sample k on."""
    y = y.copy()
    y[k : None if lasting is None else k + lasting, list(channels)] *= gain
    return y
