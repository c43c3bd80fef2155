"""The springs of an upright plate without friction or glue on a section, in one loop that numba compiles.

It computes what `plate_contact.assemble_springs` computes with NumPy, whose calls take most of the time on the some
hundred skin points of a section.
"""

import numpy as np

from fem.laws_compiled import compiled


@compiled
def press(nodes, spread, weights, points, u, height, stiffness, chosen, pressed, forces, matrices):
    """Write the nodal forces and stiffness of the springs of plate and base; return their energy.

    Parameters
    ----------
    nodes, weights, points : (k, f), (k, q) and (k, q, 3), see `fem.discretisation.elements.Surface`.
    spread : (f fields, q) displacements of a facet's points along z by its nodal fields.
    u : (n, fields) nodal fields.
    height, stiffness : of the plate.
    chosen, pressed : whether the points in contact are those of the mask (k, q); otherwise those that overlap.
    forces : (k, f fields), nodes first.
    matrices : (k, fields f, fields f), fields first; (0, 0, 0) for none.
    """
    (k, q), f, fields, energy = weights.shape, nodes.shape[1], u.shape[1], 0.0
    nodal, order = np.empty(f * fields), np.empty(f * fields, dtype=np.int64)
    for a in range(f):
        for i in range(fields):
            order[a * fields + i] = i * f + a
    for facet in range(k):
        for a in range(f):
            for i in range(fields):
                nodal[a * fields + i] = u[nodes[facet, a], i]
        for x in range(q):
            upward = 0.0
            for n in range(len(nodal)):
                upward += nodal[n] * spread[n, x]
            w, overlap = weights[facet, x], points[facet, x, 2] - height + upward
            below = points[facet, x, 2] + upward
            slope, pressure, base = 0.0, 0.0, 0.0
            if pressed[facet, x] if chosen else overlap > 0.0:
                slope, pressure = stiffness, stiffness * overlap
            if below < 0.0:
                slope, base = slope + stiffness, stiffness * below
            if slope == 0.0:
                continue
            energy += w * (pressure * pressure + base * base) / (2.0 * stiffness)
            for n in range(len(nodal)):
                forces[facet, n] += w * (pressure + base) * spread[n, x]
            if len(matrices) == 0:
                continue
            for n in range(len(nodal)):
                for m in range(len(nodal)):
                    matrices[facet, order[n], order[m]] += w * slope * spread[n, x] * spread[m, x]
    return energy
