"""Types of the annotations, and arrays that are kept. Docstrings of functions have their shapes and units."""

import dataclasses
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Point = tuple[float, float]
Vector = tuple[float, float, float]
Kept = TypeVar("Kept")


def read_only(value: Kept) -> Kept:
    """Return a value that a process keeps for later calls; its arrays, also those in it, can no longer be written.

    >>> read_only((np.zeros(2), {"one": np.ones(1)}))[1]["one"].flags.writeable
    False
    """
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, list | tuple):
        for each in value:
            read_only(each)
    elif isinstance(value, dict):
        read_only(list(value.values()))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        read_only([getattr(value, spec.name) for spec in dataclasses.fields(value)])
    return value
