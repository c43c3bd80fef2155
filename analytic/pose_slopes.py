"""Slopes of the Hall readings by the magnet's pose: the linear readings of a magnet that vibrates about any pose.

With G = grad B, the field at a point p at rest in space of a magnet at c that moves by ds and turns by dw is

    dB = dw x B - G (dw x (p - c)) - G ds,

because the field moves and turns with the magnet. A reading is B.n, averaged over the element's plate.
"""

from __future__ import annotations

import numpy as np

from analytic.hall import FLIP, in_magnet_frame, plates, rotated
from analytic.magnet import cylinder_field_jacobian
from analytic.parts import of_design
from geometry.arrays import Array
from geometry.design import BadInput, Design

Vector = tuple[float, float, float]


def slopes_at(design: Design, shift: Vector, tilt: tuple[float, float]) -> tuple[Array, Array]:
    """Return the slopes of the elements' readings B.n by small displacements and rotations of the magnet.

    Parameters
    ----------
    shift, tilt : pose about which the magnet moves, mm and rad, as in `analytic.hall.field_at`.

    Returns
    -------
    by_shift : dB.n/ds_j of element k at [k, j], T/mm.
    by_rotation : dB.n/dw_j at [k, j], T/rad; w is a rotation vector in the sensor's frame, added to the pose.

    Raises
    ------
    BadInput
        The design has no magnet, or a point of an element lies where the field is not defined.
    """
    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0), so there are no readings: give it a magnet")
    layout = of_design(design)
    points, owners = plates(layout)
    normals = np.array([element.direction for element in layout])[owners]
    local = in_magnet_frame(points, design, shift, tilt)
    magnet = design.magnet_diameter / 2, design.magnet_height, design.polarisation
    b, jacobian = cylinder_field_jacobian(local, *magnet)
    turn = rotated(np.eye(3), np.broadcast_to(np.asarray(tilt), (3, 2))).T * FLIP  # magnet's frame to the sensor's
    B = b @ turn.T
    g = np.einsum("ij,njk,lk,nl->ni", turn, jacobian, turn, normals)  # G n
    arms = points - np.array([0.0, 0.0, design.H]) - np.asarray(shift)
    # n . (dw x B) = dw . (B x n), and n . G (dw x a) = dw . (a x G n)
    by_rotation = np.cross(B, normals) - np.cross(arms, g)
    starts, count = np.searchsorted(owners, np.arange(len(layout))), np.bincount(owners)[:, None]
    return np.add.reduceat(-g, starts) / count, np.add.reduceat(by_rotation, starts) / count
