"""Condition (30) of paper H on systems of two channels: which failures blame a healthy channel, which are not seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..exhibit import Table
from ..kernels.nullspace import criteria

__all__ = ["blamed", "condition_table"]

FloatArray = NDArray[np.float64]

N_SAMPLES, WIDTH, ONSET = 60, 10, 30
COUPLED = np.array([[0.9, 0.3], [-0.2, 0.8]])
DIAGONAL = np.diag([0.9, 0.8])
SEEN = 1e-6


def blamed(A: FloatArray, gains: tuple[float, float], *, onset: int = ONSET, step: int | None = None) -> FloatArray:
    """Return (2, n_outputs): the criteria at the sample of the failure, and the largest until the window has passed.

    The outputs are the states of x(k+1) = A x(k) + b u(k), driven by two sines or, from the sample `step` on, by a
    first step; sensor k reads gains[k] times its state from `onset` on.
    """
    i = np.arange(N_SAMPLES)
    u = np.asarray(np.sin(0.5 * i) + np.sin(1.3 * i) if step is None else i >= step, dtype=np.float64)
    y = np.ones((N_SAMPLES, 2))
    for k in range(N_SAMPLES - 1):
        y[k + 1] = A @ y[k] + u[k]
    y[onset:] *= gains
    found = criteria(y, u[:, None], width=WIDTH).channel
    at = max(onset, ONSET)
    return np.array([found[at], found[at : at + WIDTH].max(axis=0)])


def condition_table() -> Table:
    """Return what the two sensors show for failures that hold and break condition (30), and for unseen ones."""
    one, same = (0.9, 1.0), (0.9, 0.9)
    cases = (
        ("coupled channels, gain of the first", "no", blamed(COUPLED, one)),
        ("independent channels (diagonal), gain of the first", "yes", blamed(DIAGONAL, one)),
        ("coupled channels, the same gain of both", "yes", blamed(COUPLED, same)),
        ("gain of the first from before the record on", "no", blamed(COUPLED, one, onset=0)),
        ("gain of the first as an input moves for the first time", "no", blamed(COUPLED, one, step=ONSET)),
    )
    rows = [(what, holds, *(_shown(value) for value in found.T.ravel())) for what, holds, found in cases]
    heads = ("failure", "(30) holds", "first, at once", "first, later", "second, at once", "second, later")
    title = "Condition (30) on two channels without redundancy; later = largest until the window has passed"
    return Table(name="condition_30", title=title, heads=heads, rows=tuple(rows))


def _shown(value: float) -> str:
    return f"{value:.1e}" if value > SEEN else "round-off"
