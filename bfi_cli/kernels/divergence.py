"""The Jensen-Shannon divergence of two densities, in bits: 0 where they are one, 1 where nothing is common to both.

With the factors 1/2 of (15) in both terms and logarithms to base 2, which the range (0, 1) of its source asks for;
(17) as printed lacks the halves and estimates twice the divergence. Source: see `density`.
"""

from __future__ import annotations

import numpy as np

from . import FloatArray
from .density import Density, draw, log_density

# Bandwidths from its centre at which a kernel ends: beyond, 2e-19 of it.
REACH = 9.0
# Bandwidths that a kernel's centre or end must lie off the last edge to make one.
CLOSE = 2.0
# Error of the whole integral that the panels share equally, and bisections of a panel at most.
TOLERANCE = 1e-8
ROUNDS = 30
# Kronrod's 15 nodes on [-1, 1] from the centre outwards, their weights, and the weights of Gauss's 7 among them.
NODES = (
    0.0, 0.207784955007898467600689403773245, 0.405845151377397166906606412076961,
    0.586087235467691130294144691693013, 0.741531185599394439863864773280788, 0.864864423359769072789712788640926,
    0.949107912342758524526189684047851, 0.991455371120812639206854697526329,
)  # fmt: skip
KRONROD = (
    0.209482141084727828012999174891714, 0.204432940075298892414161999234649, 0.190350578064785409913256402421014,
    0.169004726639267902826583426598550, 0.140653259715525918745189590510238, 0.104790010322250183839876322541518,
    0.063092092629978553290700663189204, 0.022935322010529224963732008058970,
)  # fmt: skip
GAUSS = (
    0.417959183673469387755102040816327, 0.0, 0.381830050505118944950369775488975, 0.0,
    0.279705391489276667901467771423780, 0.0, 0.129484966168869693270611432679082, 0.0,
)  # fmt: skip


def jensen_shannon_quadrature(p: Density, q: Density) -> float:
    """Return J(p, q) of (15) in bits, in [0, 1], to about 1e-10.

    Adaptive Gauss-Kronrod quadrature on panels that end where kernels do, so that none falls between two nodes.
    """
    # Centres and ends of the kernels of both, ascending, those close to the last left out.
    widths = np.concatenate([p.bandwidths, q.bandwidths])
    centres = np.concatenate([p.samples, q.samples])
    points = np.concatenate([centres - REACH * widths, centres, centres + REACH * widths])
    order = np.argsort(points, kind="stable")
    kept = [float(points[order[0]])]
    for point, width in zip(points[order].tolist(), np.tile(widths, 3)[order].tolist(), strict=True):
        if point - kept[-1] > CLOSE * width:
            kept.append(point)
    edges = np.array(kept)
    left, right = edges[:-1], edges[1:]
    total = 0.0
    for _ in range(ROUNDS):
        value, error = _panels(p, q, left, right)
        rough = error > TOLERANCE / edges.size
        total += float(np.sum(value[~rough]))
        if not np.any(rough):
            break
        middle = 0.5 * (left[rough] + right[rough])
        left, right = np.concatenate([left[rough], middle]), np.concatenate([middle, right[rough]])
    else:
        total += float(np.sum(_panels(p, q, left, right)[0]))
    return float(np.clip(total / np.log(2.0), 0.0, 1.0))


def jensen_shannon_montecarlo(p: Density, q: Density, n: int, *, rng: np.random.Generator) -> tuple[float, float]:
    """Return J(p, q) in bits by (17) with its halves, and the standard error.

    The error has the variances where (18) prints second moments, and the factor 1/4 of the halves. The value is not
    forced into [0, 1]: it has no bias.

    Parameters
    ----------
    n : values drawn from each density, two or more.

    Raises
    ------
    ValueError : fewer than two.
    """
    if n < 2:
        raise ValueError(f"a standard error needs 2 values or more, got {n}")
    terms = []
    for mine, other in ((p, q), (q, p)):
        points = draw(mine, n, rng=rng)
        own = log_density(mine, points)
        # log(2 p / (p + q)), at most 1 bit.
        terms.append(1.0 + (own - np.logaddexp(own, log_density(other, points))) / np.log(2.0))
    value = 0.5 * sum(float(np.mean(term)) for term in terms)
    variance = 0.25 * sum(float(np.var(term, ddof=1)) / n for term in terms)
    return value, float(np.sqrt(variance))


def _panels(p: Density, q: Density, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The integral of (15) over each panel, natural logarithm, and how far seven nodes are from it."""
    nodes = np.concatenate([-np.array(NODES[:0:-1]), NODES])
    kronrod, gauss = (np.concatenate([w[:0:-1], w]) for w in (KRONROD, GAUSS))
    half = 0.5 * (right - left)
    points = 0.5 * (left + right)[:, None] + half[:, None] * nodes
    log_p, log_q = log_density(p, points), log_density(q, points)
    log_mean = np.logaddexp(log_p, log_q) - np.log(2.0)
    height = 0.5 * (np.exp(log_p) * (log_p - log_mean) + np.exp(log_q) * (log_q - log_mean))
    return half * (height @ kronrod), half * np.abs(height @ (kronrod - gauss))
