"""The alternating direction method of multipliers: relaxation and step size (Boyd et al. 2011, sections 3.4.1, 3.4.3).

The step size balances the primal and the dual residual; it goes at once to where both would be equal.
"""

from __future__ import annotations

import numpy as np

# Between 1.5 and 1.8 in the experiments that Boyd et al. cite (section 3.4.3).
RELAXATION = 1.6
# Ratio of the relative residuals from which on the step size changes, and the factor by which it changes at most (Boyd
# et al.: 10 and 2).
UNBALANCED, LARGEST_CHANGE = 5.0, 10.0


def step_change(primal: float, dual: float) -> float:
    """Return the factor on the step size that balances two relative residuals, 1 where they are near each other."""
    uneven = primal / max(dual, 1e-300)
    if 1.0 / UNBALANCED <= uneven <= UNBALANCED:
        return 1.0
    return float(np.clip(np.sqrt(uneven), 1.0 / LARGEST_CHANGE, LARGEST_CHANGE))
