"""Types of arrays, by what they hold."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Indices = NDArray[np.intp]
Booleans = NDArray[np.bool_]
