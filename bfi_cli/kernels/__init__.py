"""Arrays in, arrays out: numpy and scipy only, no files, no configuration; what is wrong is a `ValueError`."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]
