"""The set of touching points of a press on a section, settled within a Newton step by one loop that numba compiles.

It computes what `active_set.settle_contact` computes with NumPy, from the factors of `band_factors`: with
K' = L D L^T the compliance of the points is G = Y^T D^-1 Y, where Y = L^-1 B^T begins at the first unknown of a
point. The skin's unknowns come late in the band, so that little is left to compute.
"""

import numpy as np

from fem.solvers.band_compiled import solve_band
from geometry.compiled import compiled


@compiled
def settle(
    nodes, shape, heights, weights, number, u, step, stiffness, chosen, pressed, position, start, end, U, inverse,
    edge, solved, Y, G, limits
):  # fmt: skip
    """Return the settled step (n,), or the plain one where the set of points does not settle.

    Parameters
    ----------
    nodes, shape, weights : (k, 3), (q, 3) and (k, q), see `fem.discretisation.elements.Surface`.
    heights : (k, q) heights of the points over the plate at rest.
    number : (nodes, 2) numbers of the unknowns; u : (nodes, 2) displacements.
    step : (n,) plain step, from the unknowns to less than these.
    chosen, pressed : whether the springs in the factors are those of the mask (k, q), or of the points that overlap.
    position : (n,) rows of the unknowns in the band; the arguments after it as in `band_compiled.factorise`.
    Y, G : (MOST_POINTS, n) and (MOST_POINTS, MOST_POINTS) arrays to work in.
    limits : MOST_POINTS, MOST_ROUNDS, MOST_EXCHANGES and PATIENCE of `active_set`.
    """
    (k, q), rows, most = weights.shape, len(start), limits[0]
    acting, plain = np.empty(k * q, dtype=np.bool_), np.empty(k * q)
    _measure_overlaps(nodes, shape, heights, number, u, np.zeros(len(step)), plain)
    for i in range(k * q):
        acting[i] = pressed[i // q, i % q] if chosen else plain[i] > 0
    _measure_overlaps(nodes, shape, heights, number, u, step, plain)
    now, settled, member, count = np.empty(k * q), step, np.zeros(k * q, dtype=np.bool_), 0
    _measure_overlaps(nodes, shape, heights, number, u, step, now)
    points, first, by_edge = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64), np.zeros(most)
    own = np.empty(rows)
    for _ in range(limits[1]):
        before = count
        for i in range(k * q):
            if (now[i] > 0) != acting[i] and not member[i]:
                if count == most:
                    return step
                points[count], member[i] = i, True
                count += 1
        if count == before:
            break
        for r in range(before, count):
            first[r] = _spread(nodes, shape, number, position, points[r], q, 1.0, Y[r], True)
            if len(edge) > 0:
                for row in range(first[r], rows):
                    by_edge[r] += Y[r, row] * solved[row]
            _eliminate(start, end, U, inverse, first[r], Y[r])
            for s in range(r + 1):
                work = by_edge[r] * by_edge[s] / edge[rows] if len(edge) > 0 else 0.0
                for row in range(max(first[r], first[s]), rows):
                    work += Y[r, row] * Y[s, row] * inverse[row]
                G[r, s], G[s, r] = work, work
        force = np.zeros(count)
        if not _exchange(G, plain, acting, stiffness, weights, points[:count], now, limits, force):
            return step
        into_edge = 0.0
        for row in range(rows):
            own[row] = 0.0
        for r in range(count):
            _spread(nodes, shape, number, position, points[r], q, force[r], own, False)
            into_edge += force[r] * by_edge[r]
        solve_band(U, start, end, inverse, own)
        last = -into_edge / edge[rows] if len(edge) > 0 else 0.0
        settled = np.empty(len(step))
        for i in range(len(position)):
            row = position[i]
            change = last if row == rows else own[row] - (last * solved[row] if len(edge) > 0 else 0.0)
            settled[i] = step[i] - change
        _measure_overlaps(nodes, shape, heights, number, u, settled, now)
    return settled


@compiled
def _measure_overlaps(nodes, shape, heights, number, u, step, overlaps):
    """Write the overlaps (k q,) after a step."""
    q = len(shape)
    for facet in range(len(nodes)):
        for x in range(q):
            overlap = 0.0
            for a in range(3):
                node = nodes[facet, a]
                i = number[node, 1]
                overlap += shape[x, a] * (u[node, 1] - (step[i] if i >= 0 else 0.0))
            overlaps[facet * q + x] = heights[facet, x] + overlap


@compiled
def _spread(nodes, shape, number, position, point, q, force, own, alone):
    """Add a force on a point to rows (n,) of the band, which are 0 before if `alone`; return the first of them."""
    if alone:
        for row in range(len(own)):
            own[row] = 0.0
    first = len(own)
    for a in range(3):
        i = number[nodes[point // q, a], 1]
        if i >= 0:
            own[position[i]] += force * shape[point % q, a]
            first = min(first, position[i])
    return first


@compiled
def _eliminate(start, end, U, inverse, first, y):
    """Replace y (n,), which is 0 before row `first`, by L^-1 y."""
    for k in range(first, len(start)):
        factor = y[k] * inverse[k]
        if factor != 0.0:
            row, later = U[start[k] + 1 : start[k] + 1 + end[k] - k], y[k + 1 : end[k] + 1]
            for j in range(len(row)):
                later[j] -= row[j] * factor


@compiled
def _exchange(G, plain, acting, stiffness, weights, points, now, limits, force):
    """Write the forces (m,) that replace the springs that switch; return whether the set settles."""
    m, q = len(points), weights.shape[1]
    pressed, wrong = np.empty(m, dtype=np.bool_), np.empty(m, dtype=np.bool_)
    for r in range(m):
        pressed[r] = now[points[r]] > 0
    least, patience = m + 1, limits[3]
    M = np.empty((m, m))
    for _ in range(limits[2]):
        for r in range(m):
            i = points[r]
            flip = 0.0
            if pressed[r] != acting[i]:
                spring = stiffness * weights[i // q, i % q]
                flip = spring if acting[i] else -spring
            force[r] = flip * plain[i]
            for s in range(m):
                M[r, s] = (1.0 if r == s else 0.0) - flip * G[r, s]
        if not _solve_dense(M, force):
            return False
        count, last = 0, 0
        for r in range(m):
            overlap = plain[points[r]]
            for s in range(m):
                overlap += G[r, s] * force[s]
            wrong[r] = (overlap > 0) != pressed[r]
            if wrong[r]:
                count, last = count + 1, r
        if count == 0:
            return True
        # all wrong points at once mostly settle in a few exchanges, but may cycle; one at a time never does
        patience = limits[3] if count < least else patience - 1
        least = min(least, count)
        for r in range(m):
            if wrong[r] and (patience >= 0 or r == last):
                pressed[r] = not pressed[r]
    return False


@compiled
def _solve_dense(M, x):
    """Replace x (m,) by M^-1 x, overwriting M; return False where M is singular."""
    m = len(x)
    for k in range(m):
        pivot = k
        for i in range(k + 1, m):
            if abs(M[i, k]) > abs(M[pivot, k]):
                pivot = i
        if not abs(M[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, m):
                M[k, j], M[pivot, j] = M[pivot, j], M[k, j]
            x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, m):
            factor = M[i, k] / M[k, k]
            if factor != 0.0:
                for j in range(k + 1, m):
                    M[i, j] -= factor * M[k, j]
                x[i] -= factor * x[k]
    for k in range(m - 1, -1, -1):
        for j in range(k + 1, m):
            x[k] -= M[k, j] * x[j]
        x[k] /= M[k, k]
    return True
