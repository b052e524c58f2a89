"""Two numbers of distributions beside the normal one, from their series: `scipy.special` takes longer to import."""

from __future__ import annotations

import math

from . import TWO_SIDED_95

# Terms of a series end where one is smaller than this share of its sum.
ROUND_OFF = 1e-16
# Newton's method ends with a step of this share of the quantile: the next would be of its square.
SETTLED = 1e-8
MOST_STEPS = 50


def student_two_sided_95(degrees: float) -> float:
    """Return the size below which 95 % of the values of Student's t lie.

    The distribution function is concave, so that Newton's method from the normal quantile below ends at the root.

    Parameters
    ----------
    degrees : of freedom, positive; NaN where there is none.
    """
    half, t = 0.5 * degrees, TWO_SIDED_95
    log_beta = math.lgamma(0.5) + math.lgamma(half) - math.lgamma(half + 0.5)
    for _ in range(MOST_STEPS):
        # The incomplete beta function by its series (Abramowitz and Stegun 1964, 26.5.4), whose terms are positive.
        y = t**2 / (degrees + t**2)
        term = total = 1.0
        n = 0
        while term > ROUND_OFF * total:
            term *= y * (half + 0.5 + n) / (1.5 + n)
            total += term
            n += 1
        log_density = half * math.log1p(-y) - log_beta
        inside = 2.0 * total * math.sqrt(y) * math.exp(log_density)
        step = (0.95 - inside) / (2.0 * math.exp(log_density) * math.sqrt((1.0 - y) / degrees))
        t += step
        if abs(step) <= SETTLED * t:
            break
    return t


def chi_square_tail(degrees: int, x: float) -> float:
    """Return the probability that a chi-square deviate exceeds x (Abramowitz and Stegun 1964, 26.4.4 and 26.4.5)."""
    half, k = 0.5 * x, 0.5 * (degrees % 2)
    total = math.erfc(math.sqrt(half)) if degrees % 2 else 0.0
    term = math.exp(-half) * half**k / math.gamma(k + 1.0)
    for _ in range(degrees // 2):
        total += term
        k += 1.0
        term *= half / k
    return total
