"""Arrays in, arrays out: numpy and scipy only, no files, no configuration; what is wrong is a `ValueError`."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]

# Quantiles of the normal distribution, of which intervals, limits and powers are made.
# Standard deviations to both sides of the mean that hold 95 %.
TWO_SIDED_95 = 1.959963984540054
# Standard deviations above the mean below which 90, 95 and 99 % lie.
ONE_SIDED_90, ONE_SIDED_95, ONE_SIDED_99 = 1.2815515655446004, 1.6448536269514722, 2.3263478740408408
# CHI_SQUARE_95: below it lie 95 % of a squared normal deviate (chi-square with one degree of freedom).
CHI_SQUARE_95 = 3.84
# The standard deviation over the median of the absolute deviations.
MAD = 1.4826
# The spacing of numbers at 1, and the smallest of full precision.
EPS, TINY = float(np.finfo(np.float64).eps), float(np.finfo(np.float64).tiny)
