"""Factorisation K = L D L^T of a symmetric band matrix without exchange of pivots, in loops that numba compiles.

Row k of the upper triangle holds the columns k .. end[k], one after the other from `start[k]` on in an array U. The
ends never decrease, so the factors lie in the same places, and PANEL rows after each other have the same end, so that
they are eliminated from the later rows together. One more unknown, the last, may be coupled with all others: its
column is kept apart (`edge`), and eliminated at the end.
"""

import numpy as np

from geometry.compiled import compiled

PANEL = 4
"""Rows that are eliminated together."""


@compiled
def factorise(entries, places, start, end, count, smallest, U, inverse, edge, solved):
    """Factorise a matrix; return the number of negative pivots, or -1 where one is too small.

    Parameters
    ----------
    entries, places : (nnz,) upper triangle, and positions of its entries in [U, edge].
    start, end : (n,) rows of U, see the module docstring; n is a multiple of PANEL.
    count : number of rows of the matrix; those after them fill the last panel.
    smallest : least pivot over the largest entry of its row.
    U : entries of the band, overwritten by the factors.
    inverse : (n,) inverse pivots.
    edge : (n + 1,) last column of the matrix, and its pivot after elimination; (0,) for none.
    solved : (n,) edge over the band matrix.
    """
    size, n, negative = len(U), len(start), 0
    # loops, where an assignment to a slice would take numba longer to compile
    for i in range(size):
        U[i] = 0.0
    for i in range(len(edge)):
        edge[i] = 0.0
    for e in range(len(entries)):
        if places[e] < size:
            U[places[e]] += entries[e]
        else:
            edge[places[e] - size] += entries[e]
    for k in range(n):
        largest = 0.0
        for j in range(start[k], start[k] + end[k] + 1 - k):
            largest = max(largest, abs(U[j]))
        inverse[k] = smallest * largest
        if k >= count:
            U[start[k]] = 1.0
    for k in range(0, n, PANEL):
        width = end[k] + 1 - k
        first, second, third, fourth = (
            U[start[k] : start[k] + width],
            U[start[k + 1] - 1 : start[k + 1] - 1 + width],
            U[start[k + 2] - 2 : start[k + 2] - 2 + width],
            U[start[k + 3] - 3 : start[k + 3] - 3 + width],
        )
        for p in range(PANEL):
            at = start[k + p] - p
            if not abs(U[at + p]) > inverse[k + p]:
                return -1
            negative += U[at + p] < 0
            inverse[k + p] = 1 / U[at + p]
            for other in range(p + 1, PANEL):
                below, factor = start[k + other], U[at + other] * inverse[k + p]
                source, row = U[at + other : at + width], U[below : below + width - other]
                for j in range(len(row)):
                    row[j] -= factor * source[j]
        d0, d1, d2, d3 = inverse[k], inverse[k + 1], inverse[k + 2], inverse[k + 3]
        # two rows at a time, which read the same four
        for i in range(PANEL, width - 1, 2):
            a, b, c, d = first[i] * d0, second[i] * d1, third[i] * d2, fourth[i] * d3
            e, f, g, h = first[i + 1] * d0, second[i + 1] * d1, third[i + 1] * d2, fourth[i + 1] * d3
            at, below = start[k + i], start[k + i + 1]
            U[at] -= a * first[i] + b * second[i] + c * third[i] + d * fourth[i]
            row, next_row = U[at + 1 : at + width - i], U[below : below + width - i - 1]
            r0, r1, r2, r3 = first[i + 1 :], second[i + 1 :], third[i + 1 :], fourth[i + 1 :]
            for j in range(len(row)):
                x0, x1, x2, x3 = r0[j], r1[j], r2[j], r3[j]
                row[j] -= a * x0 + b * x1 + c * x2 + d * x3
                next_row[j] -= e * x0 + f * x1 + g * x2 + h * x3
        if (width - PANEL) % 2:
            i = width - 1
            U[start[k + i]] -= first[i] ** 2 * d0 + second[i] ** 2 * d1 + third[i] ** 2 * d2 + fourth[i] ** 2 * d3
    if len(edge) > 0:
        for k in range(n):
            solved[k] = edge[k]
        solve_band(U, start, end, inverse, solved)
        largest, pivot = abs(edge[n]), edge[n]
        for k in range(n):
            pivot -= edge[k] * solved[k]
            largest = max(largest, abs(edge[k]))
        if not abs(pivot) > smallest * largest:
            return -1
        edge[n] = pivot
        negative += pivot < 0
    return negative


@compiled
def solve_band(U, start, end, inverse, x):
    """Replace a right side (n,) by the solution of the band matrix."""
    n = len(start)
    for k in range(n):
        x[k] *= inverse[k]
        factor, width = x[k], end[k] - k
        row, later = U[start[k] + 1 : start[k] + 1 + width], x[k + 1 : k + 1 + width]
        if factor != 0.0:
            for j in range(width):
                later[j] -= row[j] * factor
    for k in range(n - 1, -1, -1):
        width = end[k] - k
        row, later = U[start[k] + 1 : start[k] + 1 + width], x[k + 1 : k + 1 + width]
        # four sums, which the processor adds at the same time
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        whole = width // 4 * 4
        for j in range(0, whole, 4):
            a += row[j] * later[j]
            b += row[j + 1] * later[j + 1]
            c += row[j + 2] * later[j + 2]
            d += row[j + 3] * later[j + 3]
        for j in range(whole, width):
            a += row[j] * later[j]
        x[k] -= inverse[k] * (a + b + c + d)


@compiled
def solve(U, start, end, inverse, edge, solved, order, right, x):
    """Write the solutions x (n, m) of right sides (n, m); row i of the band is the unknown order[i]."""
    own = np.zeros(len(start))
    inner = len(order) - (len(edge) > 0)
    for column in range(right.shape[1]):
        for i in range(len(own)):
            own[i] = 0.0
        for i in range(inner):
            own[i] = right[order[i], column]
        solve_band(U, start, end, inverse, own)
        if len(edge) > 0:
            last = right[order[inner], column]
            for i in range(inner):
                last -= edge[i] * own[i]
            last /= edge[len(start)]
            x[order[inner], column] = last
            for i in range(inner):
                own[i] -= last * solved[i]
        for i in range(inner):
            x[order[i], column] = own[i]


@compiled
def order_unknowns(pointers, columns, dense):
    """Return an order (n,) of the unknowns with a narrow band, without those of more than `dense` neighbours.

    The order is that of Cuthill and McKee: from one end of the body, each unknown's neighbours follow it, those with
    few neighbours first.

    Parameters
    ----------
    pointers, columns : rows of the upper triangle.
    """
    n = len(pointers) - 1
    degree = np.zeros(n, dtype=np.int64)
    for i in range(n):
        for e in range(pointers[i], pointers[i + 1]):
            if columns[e] != i:
                degree[i] += 1
                degree[columns[e]] += 1
    first = np.zeros(n + 1, dtype=np.int64)
    for i in range(n):
        first[i + 1] = first[i] + degree[i]
    neighbours, filled = np.empty(first[n], dtype=np.int64), first[:n].copy()
    for i in range(n):
        for e in range(pointers[i], pointers[i + 1]):
            j = columns[e]
            if j != i:
                neighbours[filled[i]], neighbours[filled[j]] = j, i
                filled[i] += 1
                filled[j] += 1
    order, done, ordered = np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.bool_), 0
    for i in range(n):
        done[i] = degree[i] > dense
    for i in range(n):
        if done[i]:
            continue
        # of each connected part: the last unknown reached from anywhere lies at an end
        begin = i
        for _ in range(2):
            reached = done.copy()
            after = _follow(begin, first, neighbours, degree, reached, order, ordered)
            begin = order[after - 1]
        ordered = _follow(begin, first, neighbours, degree, done, order, ordered)
    return order[:ordered]


@compiled
def _follow(begin, first, neighbours, degree, done, order, ordered):
    """Append all unknowns that are connected with `begin` to an order; return how many it then has."""
    order[ordered], done[begin] = begin, True
    at, end = ordered, ordered + 1
    while at < end:
        i, own = order[at], end
        for e in range(first[i], first[i + 1]):
            j = neighbours[e]
            if not done[j]:
                done[j] = True
                # sorted by the number of neighbours, as they are inserted
                place = end
                while place > own and degree[order[place - 1]] > degree[j]:
                    order[place] = order[place - 1]
                    place -= 1
                order[place] = j
                end += 1
        at += 1
    return end


@compiled
def lay_out(pointers, columns, order, end, start, places):
    """Write the layout of `factorise` to end, start (n,) and places (nnz,); return the entries of U.

    Unknowns that `order` does not contain have the position of the edge.
    """
    unknowns, n, count = len(pointers) - 1, len(end), len(order)
    position = np.full(unknowns, n)
    for k in range(count):
        position[order[k]] = k
    for k in range(n):
        end[k] = k
    for i in range(unknowns):
        for e in range(pointers[i], pointers[i + 1]):
            a, b = position[i], position[columns[e]]
            if max(a, b) < n:
                end[min(a, b)] = max(end[min(a, b)], max(a, b))
    for k in range(1, n):
        end[k] = max(end[k], end[k - 1])
    size = 0
    for k in range(n):
        end[k] = end[k // PANEL * PANEL + PANEL - 1]
        start[k] = size
        size += end[k] + 1 - k
    for i in range(unknowns):
        for e in range(pointers[i], pointers[i + 1]):
            a, b = min(position[i], position[columns[e]]), max(position[i], position[columns[e]])
            places[e] = start[a] + b - a if b < n else size + a
    return size
