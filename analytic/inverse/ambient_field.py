"""A uniform ambient field beside the pose, three more unknowns of the decoder.

A field B_a adds N B_a to readings whose elements have the directions N (k, 3). With weights W = diag(w) of the
readings, the field that fits a misfit r best is G r,

    G = (N' W^2 N)^-1 N' W^2,

and what no uniform field explains is M r with M = 1 - N G. Least squares over pose and field together is therefore
that over the pose alone, with misfits M r, slopes M A and the same weights, and its covariance too: A' M' W^2 M A is
what is left of the normal equations when the field is eliminated. The field itself then is G (r - b(s)).

A gradient of the ambient field is not uniform: what it adds to elements apart from each other stays in M r.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytic.parts import Element
from geometry.arrays import Array
from geometry.design import BadInput

FEWEST = 9
"""Readings from which a field is told from a pose: two chips leave three numbers for the pose, which a shift across
the line through them hardly changes."""


def field_fit(elements: Sequence[Element], weights: Array) -> Array:
    """Return G (3, k): the uniform field, T, that fits misfits of k readings, T, best.

    weights : of the readings, shape (k,).

    Raises
    ------
    BadInput
        There are fewer than nine readings, or their directions lie in a plane.
    """
    normals = directions(elements)
    if len(elements) < FEWEST or np.linalg.matrix_rank(normals) < 3:
        raise BadInput(
            f"an ambient field is three more unknowns, which {len(elements)} readings do not tell from a pose: take "
            "three chips of three axes or more (chip_count)"
        )
    return np.asarray(np.linalg.pinv(weights[:, None] * normals) * weights)


def directions(elements: Sequence[Element]) -> Array:
    """Return N (k, 3)."""
    return np.array([element.direction for element in elements], dtype=np.float64)


def field_free(elements: Sequence[Element], fit: Array) -> Array:
    """Return M (k, k), which takes off readings what a uniform field explains; `fit` is G (3, k)."""
    return np.eye(len(elements)) - directions(elements) @ fit


def range_of(free: Array) -> Array:
    """Return an orthonormal basis (k, k - 3) of what is left of readings."""
    return np.asarray(np.linalg.svd(free)[0][:, : len(free) - 3])
