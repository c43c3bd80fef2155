"""Array types of the annotations. The shape and the unit of an array are in the docstring of its function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
