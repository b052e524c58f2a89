"""The pseudo-measurement stage: a Kalman update that claims a norm of z was measured as zero (thesis algorithm 2).

With h(z) the norm and H its gradient the update is ``z - K h(z)``, ``K = P H' / (H P H' + R)``. The thesis prints the
exponential stage's H as minus the gradient; eq. 3-22 then has the wrong sign and algorithm 3 the right one, which is
the update below. An entry that is exactly zero has no gradient and stays zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from . import FloatArray

Sparsity = Literal["none", "l1", "lp", "exp_l0"]
KINDS: tuple[str, ...] = get_args(Sparsity)


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseStage:
    """Settings of the stage.

    Attributes
    ----------
    kind : the norm: "l1", "lp" (the quasi-norm of exponent p), "exp_l0" (eq. 3-21), or "none".
    alpha : steepness of the exponential.
    p : exponent of "lp", in (0, 1].
    r : variance of the pseudo-measurement; the larger, the weaker the stage.
    p0 : prior variance of each standardised magnitude.
    updates : how many per call.
    """

    kind: Sparsity = "none"
    alpha: float = 1.0
    p: float = 0.5
    r: float = 10.0
    p0: float = 1.0
    updates: int = 1

    def __post_init__(self) -> None:
        """Refuse what has no meaning."""
        if self.kind not in KINDS:
            raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if not (self.alpha > 0 and self.r > 0 and self.p0 >= 0 and 0 < self.p <= 1 and self.updates >= 0):
            raise ValueError(f"need alpha > 0, r > 0, p0 >= 0, 0 < p <= 1, updates >= 0, got {self}")


def pseudo_norm(z: FloatArray, stage: SparseStage) -> tuple[float, FloatArray]:
    """Return the stage's norm of z and its gradient (zero where an entry is zero)."""
    size, sign = np.abs(z), np.sign(z)
    if stage.kind == "exp_l0":
        decay = np.exp(-stage.alpha * size)
        return float(np.sum(1.0 - decay)), stage.alpha * sign * decay
    p = stage.p if stage.kind == "lp" else 1.0
    largest = size.max(initial=0.0)
    if largest == 0.0:
        return 0.0, sign
    norm = largest * np.sum((size / largest) ** p) ** (1.0 / p)
    ratio = np.divide(norm, size, out=np.zeros_like(size), where=size > 0)
    return float(norm), sign * ratio ** (1.0 - p)


def apply_sparsity(z: FloatArray, stage: SparseStage, *, scales: FloatArray | None = None) -> tuple[FloatArray, int]:
    """Return z after the stage's updates, and how many really changed it (eq. 3-20 to 3-22).

    Parameters
    ----------
    z : (n_atoms,) magnitudes.
    stage : the settings.
    scales : (n_atoms,) scale of each dictionary signal; the stage acts on ``z * scales``. None for ones.
    """
    z = np.asarray(z, dtype=np.float64)
    if stage.kind == "none" or not z.size:
        return z, 0
    scales = np.ones_like(z) if scales is None else np.asarray(scales, dtype=np.float64)
    x, P, made = z * scales, stage.p0 * np.eye(z.size), 0
    for _ in range(stage.updates):
        norm, H = pseudo_norm(x, stage)
        PH = P @ H
        gain = PH / (H @ PH + stage.r)
        made += bool(np.any(gain * norm))
        x, P = x - gain * norm, P - np.outer(gain, PH)
    return x / scales, made
