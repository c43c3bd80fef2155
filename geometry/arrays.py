"""Types of the annotations. The shape and the unit of an array are in the docstring of its function."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Point = tuple[float, float]
Vector = tuple[float, float, float]
