"""Axisymmetric elements in loops that numba compiles: a section without harmonics, under an upright plate or none.

It has some hundred unknowns, so calls would take longer than what they compute: one loop runs over elements, points
and springs, with the numbers of nodes and components as constants. With the components rr, rz, around, zr, zz of the
gradient (rows 0, 2, 4, 6, 8 of nine) and D of `fem.model.elements`,

    G_rr = D_0 . u_r,  G_rz = D_2 . u_r,  G_around = D_1 . u_r,  G_zr = D_0 . u_z,  G_zz = D_2 . u_z.

`axisymmetric_loops` calls these functions for each batch. The arguments: cells (m, 6) and corners (m, 3) are the
elements' nodes and rows of the pressures; D, M and w (m, q) their functions and weights; u (nodes, 2) and p
(corners,) are displacements and pressures. Nodal fields of an element are u_r of all nodes, then u_z.
"""

import math

import numpy as np

from geometry.compiled import compiled

NODES, CORNERS, FIELDS = 6, 3, 12
"""Nodes, corners and nodal fields of an element."""


@compiled
def _gradient(nodes, d, u):
    """Return the components rr, rz, around, zr and zz of the gradient at a point."""
    rr, rz, around, zr, zz = 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(NODES):
        r, z = u[nodes[a], 0], u[nodes[a], 1]
        rr += d[0, a] * r
        around += d[1, a] * r
        rz += d[2, a] * r
        zr += d[0, a] * z
        zz += d[2, a] * z
    return rr, rz, around, zr, zz


@compiled
def largest_strains(cells, D, u, strains):
    """Write the largest principal nominal strain at each point, (n,), see `fem.results.silicone_strain`."""
    q = D.shape[1]
    for cell in range(len(cells)):
        for point in range(q):
            rr, rz, around, zr, zz = _gradient(cells[cell], D[cell, point], u)
            first, last = (1 + rr) ** 2 + zr * zr, rz * rz + (1 + zz) ** 2
            half, mixed = (first - last) / 2, (1 + rr) * rz + zr * (1 + zz)
            plane = (first + last) / 2 + math.sqrt(half * half + mixed * mixed)
            strains[cell * q + point] = math.sqrt(max(plane, (1 + around) ** 2)) - 1


@compiled
def place_elements(
    cells, corners, number, pressure_number, on_magnet, inner, inner_coupled, near, near_coupled, diagonal, inside,
    outside, stiffness, coupling,
):  # fmt: skip
    """Write the positions of the entries of stiffness (m, 12, 12) and coupling (m, 12, 3) in the upper triangle.

    Parameters
    ----------
    number, pressure_number : numbers of the unknowns, (nodes, 2) and (corners,); -1 where eliminated.
    inner, near, inner_coupled, near_coupled : starts of the pairs of blocks of the elements that do not touch the
        magnet, which come first, and of those that do, whose last block is the magnet; as diagonal and inside, see
        `sparse_pattern`.
    outside : position of entries that are not in the upper triangle.
    """
    for cell in range(len(cells)):
        own, at_magnet = cells[cell], cell >= len(inner)
        offset = near[cell - len(inner)] if at_magnet else inner[cell]
        coupled = near_coupled[cell - len(inner)] if at_magnet else inner_coupled[cell]
        for x in range(FIELDS):
            # u_z of a node on the magnet is the unknown of the magnet
            i, first = number[own[x % NODES], x // NODES], x % NODES
            if x >= NODES and on_magnet[own[first]]:
                first = NODES
            for y in range(FIELDS):
                k, second = number[own[y % NODES], y // NODES], y % NODES
                if y >= NODES and on_magnet[own[second]]:
                    second = NODES
                upper = i >= 0 and k >= i
                stiffness[cell, x, y] = diagonal[i] + offset[first, second] + inside[k] if upper else outside
            for c in range(CORNERS):
                k = pressure_number[corners[cell, c]]
                upper = i >= 0 and k >= i
                coupling[cell, x, c] = diagonal[i] + coupled[first, c] + inside[k] if upper else outside
        # the block of u_r by u_z stands for that of u_z by u_r too
        for x in range(NODES):
            for y in range(NODES, FIELDS):
                stiffness[cell, x, y] = min(stiffness[cell, x, y], stiffness[cell, y, x])


@compiled
def strain_points(cells, corners, D, M, w, u, p, G, Jm1, Hm1, pressure, weighted):
    """Write G and F^-T - 1 (9, n), whose other rows are 0, J - 1, pressures, and pressures times weights (n,).

    Return the least J - 1; nan where any is nan.
    """
    q, least = D.shape[1], np.inf
    for cell in range(len(cells)):
        for point in range(q):
            x, d = cell * q + point, D[cell, point]
            rr, rz, around, zr, zz = _gradient(cells[cell], d, u)
            own = 0.0
            for c in range(CORNERS):
                own += M[point, c] * p[corners[cell, c]]
            pressure[x], weighted[x] = own, w[cell, point] * own
            # determinants less 1 keep their digits at small strains
            plane = rr + zz + rr * zz - rz * zr
            change = plane + around + plane * around
            G[0, x], G[2, x], G[4, x], G[6, x], G[8, x] = rr, rz, around, zr, zz
            inverse = 1 / (1 + plane)
            Hm1[0, x], Hm1[8, x] = (zz - plane) * inverse, (rr - plane) * inverse
            Hm1[2, x], Hm1[6, x] = -zr * inverse, -rz * inverse
            Hm1[4, x] = -around / (1 + around)
            Jm1[x] = change
            if change < least or change != change:
                least = change
    return least


@compiled
def add_elements(
    cells, corners, D, M, w, soft, pressure, Jm1, Hm1, W, P, A, forces, volumes, stiff, coupled, data, tangent
):
    """Add forces (nodes, 2), volumes (corners,) and entries of the tangent of a batch; return its energy.

    Parameters
    ----------
    soft : (m,) 1/K.
    W, P, A : energies (n,), stresses (9, n) and tangents (9, 9, n), times the weights.
    stiff, coupled : (m, 12, 12) and (m, 12, 3) positions of the entries in `data`, whose last number is a dump.
    """
    q, energy = D.shape[1], 0.0
    K, B, X = np.empty((FIELDS, FIELDS)), np.empty((FIELDS, CORNERS)), np.empty((5, FIELDS))
    for cell in range(len(cells)):
        for i in range(FIELDS):
            for j in range(FIELDS):
                K[i, j] = 0.0
            for c in range(CORNERS):
                B[i, c] = 0.0
        for point in range(q):
            x, d = cell * q + point, D[cell, point]
            own, change = pressure[x], w[cell, point] * (Jm1[x] - pressure[x] * soft[cell])
            energy += W[x] - w[cell, point] * own * own * soft[cell] / 2
            for a in range(NODES):
                node, d0, d1, d2 = cells[cell, a], d[0, a], d[1, a], d[2, a]
                forces[node, 0] += d0 * P[0, x] + d2 * P[2, x] + d1 * P[4, x]
                forces[node, 1] += d0 * P[6, x] + d2 * P[8, x]
            for c in range(CORNERS):
                volumes[corners[cell, c]] += M[point, c] * change
            if tangent:
                _add_stiffness(d, A, x, X, K)
                _add_coupling(d, M[point], w[cell, point] * (1 + Jm1[x]), Hm1, x, B)
        if tangent:
            for i in range(FIELDS):
                for j in range(0 if i < NODES else NODES, FIELDS):
                    data[stiff[cell, i, j]] += K[i, j]
                for c in range(CORNERS):
                    data[coupled[cell, i, c]] += B[i, c]
    return energy


@compiled
def _add_stiffness(d, A, x, X, K):
    """Add the stiffness K (12, 12) of point x, without its block of u_z by u_r, which is that of u_r by u_z.

    X (5, 12), the derivative of the stress, is overwritten.
    """
    for row in range(5):
        a0, a2, a4, a6, a8 = A[2 * row, 0, x], A[2 * row, 2, x], A[2 * row, 4, x], A[2 * row, 6, x], A[2 * row, 8, x]
        if row < 3:
            for b in range(NODES):
                X[row, b] = a0 * d[0, b] + a2 * d[2, b] + a4 * d[1, b]
        for b in range(NODES):
            X[row, NODES + b] = a6 * d[0, b] + a8 * d[2, b]
    first, second, third, fourth, last = X[0], X[1], X[2], X[3, NODES:], X[4, NODES:]
    for a in range(NODES):
        d0, d1, d2, row_r, row_z = d[0, a], d[1, a], d[2, a], K[a], K[NODES + a, NODES:]
        for s in range(FIELDS):
            row_r[s] += d0 * first[s] + d2 * second[s] + d1 * third[s]
        for s in range(NODES):
            row_z[s] += d0 * fourth[s] + d2 * last[s]


@compiled
def _add_coupling(d, M, w, Hm1, x, B):
    """Add the coupling B (12, 3) of point x with the pressures; w is its weight times J."""
    h0, h2, h4, h6, h8 = w * (1 + Hm1[0, x]), w * Hm1[2, x], w * (1 + Hm1[4, x]), w * Hm1[6, x], w * (1 + Hm1[8, x])
    for a in range(NODES):
        r, z = d[0, a] * h0 + d[2, a] * h2 + d[1, a] * h4, d[0, a] * h6 + d[2, a] * h8
        for c in range(CORNERS):
            B[a, c] += M[c] * r
            B[NODES + a, c] += M[c] * z


@compiled
def add_springs(nodes, shape, weights, z, u, height, stiffness, chosen, pressed, forces, entries, data, tangent):
    """Add forces and entries of the tangent of the springs of an upright plate and of the base; return their energy.

    Parameters
    ----------
    nodes, shape, weights, z : (k, 3), (q, 3), (k, q) and (k, q) of the skin, see `elements.Surface`.
    height, stiffness : of the plate.
    chosen, pressed : whether the points in contact are those of the mask (k, q); otherwise those that overlap.
    entries : (k, 3, 3) positions of the entries of the facets' u_z in `data`.
    """
    energy = 0.0
    for facet in range(len(nodes)):
        own = nodes[facet]
        for x in range(len(shape)):
            now = z[facet, x]
            upward = 0.0
            for a in range(3):
                upward += shape[x, a] * u[own[a], 1]
            overlap, below, weight = now - height + upward, now + upward, weights[facet, x]
            slope, pressure, base = 0.0, 0.0, 0.0
            if pressed[facet, x] if chosen else overlap > 0.0:
                slope, pressure = stiffness, stiffness * overlap
            if below < 0.0:
                slope, base = slope + stiffness, stiffness * below
            if slope == 0.0:
                continue
            energy += weight * (pressure * pressure + base * base) / (2.0 * stiffness)
            for a in range(3):
                forces[own[a], 1] += weight * (pressure + base) * shape[x, a]
                if tangent:
                    for b in range(3):
                        data[entries[facet, a, b]] += weight * slope * shape[x, a] * shape[x, b]
    return energy


@compiled
def collect(forces, volumes, number, pressure_number, eliminated, first, residual):
    """Add forces (nodes, 2) and volumes (corners,) to the residual (n,) of their unknowns, numbered -1 without.

    Return the norms of the reactions, those forces that are `eliminated`, and of the residual's forces and volumes;
    the volumes begin at `first`.
    """
    reaction, force, volume = 0.0, 0.0, 0.0
    for node in range(len(number)):
        for f in range(2):
            if number[node, f] >= 0:
                residual[number[node, f]] += forces[node, f]
            if eliminated[node, f]:
                reaction += forces[node, f] * forces[node, f]
    for corner in range(len(pressure_number)):
        if pressure_number[corner] >= 0:
            residual[pressure_number[corner]] += volumes[corner]
    for i in range(first):
        force += residual[i] * residual[i]
    for i in range(first, len(residual)):
        volume += residual[i] * residual[i]
    return math.sqrt(reaction), math.sqrt(force), math.sqrt(volume)
