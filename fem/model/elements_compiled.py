"""Loops over the elements that numba compiles: what `nonlinear_system` and `element_integrals` compute in NumPy.

A batch is some elements with all their points and angles. The innermost loops run over the points of a batch, or over
pairs of fields or nodes, because the processor works on four to eight neighbouring numbers at a time. With V, C and D
of `fem.model.elements`, the integral over the angles comes first and the one over the section follows,

    H_JL,fg = sum_t w V_iJf A_iJkL V_kLg,        K_af,bg = sum_JL D_Ja H_JL,fg D_Lb,

and K is added to the entries of the sparse matrix at once. `element_loops` calls these functions for each batch. The
arguments: cells (m, a) and corners (m, c) are the elements' nodes and rows of the pressures; D, M, V and C their
functions, see `fem.model.elements`; u (nodes, f) and p (corners, n) are displacements and pressures.
"""

import numpy as np

from geometry.compiled import compiled


@compiled
def evaluate_gradients(cells, D, V, carried, u, g, G):
    """Write g_Jf = sum_a D_Ja u_af, (3, f, points), and G_iJ = sum_f V_iJf g_Jf, (9, t, points), of a batch.

    carried : (3, 2) range of the fields that have a component i.
    """
    fields, (q, _, a) = u.shape[1], D.shape[1:]
    nodal, slopes = np.empty((a, fields, len(cells) * q)), np.empty((3, a, len(cells) * q))
    for cell in range(len(cells)):
        for point in range(q):
            x = cell * q + point
            for node in range(a):
                for f in range(fields):
                    nodal[node, f, x] = u[cells[cell, node], f]
                for J in range(3):
                    slopes[J, node, x] = D[cell, point, J, node]
    for J in range(3):
        for f in range(fields):
            out = g[J, f]
            for x in range(len(out)):
                out[x] = 0.0
            for node in range(a):
                slope, values = slopes[J, node], nodal[node, f]
                for x in range(len(out)):
                    out[x] += slope[x] * values[x]
    for t in range(len(V)):
        for i in range(3):
            for J in range(3):
                out = G[3 * i + J, t]
                for x in range(len(out)):
                    out[x] = 0.0
                for f in range(carried[i, 0], carried[i, 1]):
                    add_multiple(V[t, i, J, f], g[J, f], out)


@compiled
def add_multiple(factor, values, row):
    """Add factor times values to a row."""
    if factor != 0.0:
        for x in range(len(row)):
            row[x] += factor * values[x]


@compiled
def weigh_points(mu, inverse_K, corners, weights, theta_weights, M, C, p, w, modulus, pressure, weighted, soft):
    """Write weights w, weighted moduli, pressures, and weighted pressures, (t, points) each, and 1/K (points,)."""
    q, (t, points) = weights.shape[1], w.shape
    for x in range(points):
        cell, point = x // q, x % q
        soft[x] = inverse_K[cell]
        for angle in range(t):
            w[angle, x] = weights[cell, point] * theta_weights[angle]
            modulus[angle, x] = w[angle, x] * mu[cell]
            pressure[angle, x] = 0.0
        for n in range(p.shape[1]):
            own = 0.0
            for c in range(len(corners[cell])):
                own += M[point, c] * p[corners[cell, c], n]
            for angle in range(t):
                pressure[angle, x] += C[angle, n] * own
        for angle in range(t):
            weighted[angle, x] = w[angle, x] * pressure[angle, x]


@compiled
def spread(V, carried, P, S):
    """Add S_Jf = sum_i P_iJ V_iJf at one angle, (3, f, points), for P (9, points)."""
    for i in range(3):
        for J in range(3):
            for f in range(carried[i, 0], carried[i, 1]):
                add_multiple(V[i, J, f], P[3 * i + J], S[J, f])


@compiled
def integrate_forces(cells, corners, D, M, V, C, carried, w, pressure, soft, Jm1, W, P, forces, volumes):
    """Add the forces and volumes of a batch to (nodes, f) and (corners, n); return its energy."""
    t, fields, pressures, (q, _, a), points = len(V), V.shape[3], C.shape[1], D.shape[1:], len(soft)
    S, change, energy, own = np.zeros((3, fields, points)), np.zeros((pressures, points)), 0.0, np.empty((3, fields))
    for angle in range(t):
        spread(V[angle], carried, P[:, angle], S)
        for x in range(points):
            energy += W[angle, x] - w[angle, x] * pressure[angle, x] ** 2 * soft[x] / 2
        for n in range(pressures):
            for x in range(points):
                change[n, x] += C[angle, n] * w[angle, x] * (Jm1[angle, x] - pressure[angle, x] * soft[x])
    for cell in range(len(cells)):
        for point in range(q):
            x = cell * q + point
            for J in range(3):
                for f in range(fields):
                    own[J, f] = S[J, f, x]
            for node in range(a):
                row, first, second, third = forces[cells[cell, node]], own[0], own[1], own[2]
                d0, d1, d2 = D[cell, point, 0, node], D[cell, point, 1, node], D[cell, point, 2, node]
                for f in range(fields):
                    row[f] += d0 * first[f] + d1 * second[f] + d2 * third[f]
            for c in range(len(M[0])):
                for n in range(pressures):
                    volumes[corners[cell, c], n] += M[point, c] * change[n, x]
    return energy


@compiled
def integrate_coupling(V, C, carried, w, Jm1, Hm1, Y):
    """Write Y_J,fn = sum_t w cof(F)_iJ V_iJf C_n, (3, f n, points)."""
    (t, points), (_, _, fields), pressures = w.shape, V.shape[1:], C.shape[1]
    cofactor, S = np.empty((9, points)), np.empty((3, fields, points))
    Y[:] = 0.0
    for angle in range(t):
        for e in range(9):
            row, own, one = cofactor[e], Hm1[e, angle], 1.0 if e % 4 == 0 else 0.0
            for x in range(points):
                row[x] = w[angle, x] * (1 + Jm1[angle, x]) * (own[x] + one)
        S[:] = 0.0
        spread(V[angle], carried, cofactor, S)
        for J in range(3):
            for f in range(fields):
                for n in range(pressures):
                    add_multiple(C[angle, n], S[J, f], Y[J, f * pressures + n])


@compiled
def select_tangents(A, i0, i1, k0, k1, out):
    """Copy A (9, 9, t, points) for components i and k of the displacement to (J L, i k t, points)."""
    t = A.shape[2]
    for JL in range(9):
        row = 0
        for i in range(i0, i1):
            for k in range(k0, k1):
                for angle in range(t):
                    own, source = out[JL, row], A[3 * i + JL // 3, 3 * k + JL % 3, angle]
                    for x in range(len(own)):
                        own[x] = source[x]
                    row += 1


@compiled
def combine_tangents(A, terms, factors, H):
    """Write H (9, points, pairs) without angles: for each row JL, pair, iJ, kL of `terms` add its factor times A."""
    H[:] = 0.0
    for n in range(len(terms)):
        JL, pair, iJ, kL = terms[n]
        factor, own, out = factors[n], A[iJ, kL, 0], H[JL]
        for x in range(len(own)):
            out[x, pair] += factor * own[x]


@compiled
def integrate_section(D, H, x, X, K):
    """Add D_Ja H_JL D_Lb of point x to K (a, b pairs); H is (9, points, pairs), X (3, b pairs) is overwritten."""
    pairs, a = H.shape[2], D.shape[1]
    for J in range(3):
        first, second, third = H[3 * J, x], H[3 * J + 1, x], H[3 * J + 2, x]
        for b in range(a):
            d0, d1, d2 = D[0, b], D[1, b], D[2, b]
            row = X[J, b * pairs : (b + 1) * pairs]
            for s in range(pairs):
                row[s] = d0 * first[s] + d1 * second[s] + d2 * third[s]
    first, second, third = X[0], X[1], X[2]
    for node in range(a):
        d0, d1, d2 = D[0, node], D[1, node], D[2, node]
        row = K[node]
        for s in range(len(row)):
            row[s] += d0 * first[s] + d1 * second[s] + d2 * third[s]


@compiled
def stiffness(D, H, first, K):
    """Write K_af,bg of a batch for one group of pairs to K (m, entries) from `first` on; H is (9, points, pairs)."""
    (m, q, _, a), pairs = D.shape, H.shape[2]
    X = np.empty((3, a * pairs))
    for cell in range(m):
        own = K[cell, first : first + a * a * pairs].reshape(a, a * pairs)
        own[:] = 0.0
        for point in range(q):
            integrate_section(D[cell, point], H, cell * q + point, X, own)


@compiled
def coupling(D, M, Y, B):
    """Write M_c sum_J D_Ja Y_J, (m, a, c f n), of a batch, from Y (3, f n, points)."""
    (m, q, _, a), size = D.shape, Y.shape[1]
    c = M.shape[1]
    own = np.empty((3, c * size))
    B[:] = 0.0
    for cell in range(m):
        for point in range(q):
            for J in range(3):
                for corner in range(c):
                    for s in range(size):
                        own[J, corner * size + s] = M[point, corner] * Y[J, s, cell * q + point]
            first, second, third = own[0], own[1], own[2]
            for node in range(a):
                row, slopes = B[cell, node], D[cell, point]
                d0, d1, d2 = slopes[0, node], slopes[1, node], slopes[2, node]
                for s in range(c * size):
                    row[s] += d0 * first[s] + d1 * second[s] + d2 * third[s]


@compiled
def add_symmetric(K, where, cells, offset, number, diagonal, inside, data):
    """Add stiffness K (m, entries) of a batch to the upper triangle of the matrix.

    where : (a, f, b, g) position of each pair of unknowns of an element in its entries.
    offset : (m, a, b) starts of the pairs of nodes; the other arguments as in `sparse_pattern`.
    """
    a, fields = where.shape[:2]
    for cell in range(len(cells)):
        own, entries = cells[cell], K[cell]
        for first in range(a):
            for second in range(a):
                if own[first] > own[second]:
                    continue
                columns, whole = number[own[second]], True
                # the columns of a node without constraints are neighbours
                for g in range(fields):
                    whole &= columns[g] >= 0
                for f in range(fields):
                    i = number[own[first], f]
                    if i < 0:
                        continue
                    start, places = diagonal[i] + offset[cell, first, second], where[first, f, second]
                    if whole and first != second:
                        row = data[start : start + fields]
                        for g in range(fields):
                            row[g] += entries[places[g]]
                        continue
                    for g in range(f if first == second else 0, fields):
                        k = columns[g]
                        if k >= 0:
                            data[start + inside[k]] += entries[places[g]]


@compiled
def add_coupling(B, cells, corners, offset, number, pressure_number, diagonal, inside, data):
    """Add coupling B (m, a, c f n) of displacements and pressures of a batch to the matrix."""
    fields, pressures = number.shape[1], pressure_number.shape[1]
    for cell in range(len(cells)):
        for node in range(cells.shape[1]):
            for f in range(fields):
                i = number[cells[cell, node], f]
                if i < 0:
                    continue
                for c in range(corners.shape[1]):
                    start, begin, whole = diagonal[i] + offset[cell, node, c], (c * fields + f) * pressures, True
                    for n in range(pressures):
                        whole &= pressure_number[corners[cell, c], n] >= 0
                    if whole:
                        row, values = data[start : start + pressures], B[cell, node, begin : begin + pressures]
                        for n in range(pressures):
                            row[n] += values[n]
                        continue
                    for n in range(pressures):
                        k = pressure_number[corners[cell, c], n]
                        if k >= 0:
                            data[start + inside[k]] += B[cell, node, begin + n]


@compiled
def add_motion(
    K, B, T, where, cells, corners, offset, coupled, number, pressure_number, first, diagonal, inside, data
):
    """Add what a batch at the magnet contributes to rows and columns of the magnet's motion.

    Parameters
    ----------
    K, B : stiffness (m, entries) and coupling (m, a, c f n).
    T : (nodes, f, r) derivative of the displacements by the motion.
    offset, coupled : (m, a + 1, a + 1) and (m, a + 1, c) starts of the pairs of blocks; the last block is the motion.
    first : number of the motion's first unknown.
    """
    a, fields, pressures, size = where.shape[0], where.shape[1], pressure_number.shape[1], T.shape[2]
    for cell in range(len(cells)):
        own, entries, start = cells[cell], K[cell], offset[cell]
        for node in range(a):
            for f in range(fields):
                i = number[own[node], f]
                for r in range(size):
                    force, place = 0.0, inside[first + r]
                    for b in range(a):
                        for g in range(fields):
                            slope = T[own[b], g, r]
                            if slope != 0.0:
                                force += slope * entries[where[node, f, b, g]]
                    if i >= 0:
                        data[diagonal[i] + start[node, a] + place] += force
                    for s in range(r + 1):
                        data[diagonal[first + s] + start[a, a] + place] += T[own[node], f, s] * force
                    slope = T[own[node], f, r]
                    if slope != 0.0:
                        for c in range(corners.shape[1]):
                            for n in range(pressures):
                                k = pressure_number[corners[cell, c], n]
                                if k >= 0:
                                    data[diagonal[first + r] + coupled[cell, a, c] + inside[k]] += (
                                        slope * B[cell, node, (c * fields + f) * pressures + n]
                                    )


@compiled
def add_matrices(matrices, nodes, offset, number, diagonal, inside, data):
    """Add the upper triangles of matrices (k, f a, f a), fields first; `nodes` (k, a) are rows of `number`."""
    (count, a), fields = nodes.shape, number.shape[1]
    for matrix in range(count):
        own, block = nodes[matrix], matrices[matrix]
        for node in range(a):
            for f in range(fields):
                i = number[own[node], f]
                if i < 0:
                    continue
                for b in range(a):
                    for g in range(fields):
                        k = number[own[b], g]
                        value = block[f * a + node, g * a + b]
                        if k >= i and value != 0.0:
                            data[diagonal[i] + offset[matrix, node, b] + inside[k]] += value
