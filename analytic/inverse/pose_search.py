"""All poses that have one row of readings: starts from the table, a damped Newton iteration from each.

The starts are those that `analytic.inverse.start_table` explains; the iteration is that of
`analytic.inverse.damped_newton`, for one pose, in loops that numba compiles. Two rules end iterations that would lead
nowhere. A start stands for the poses near it, since every other pose has a start of its own: an iteration that moves
farther than `REACH` cell diagonals from its start ends. So does one whose misfit does not fall to `FALL` of its size
in `STALL` evaluations, as next to a minimum of the misfit that is no pose.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic.cylinder import ALONG, ALONG_Z, LEAN, LEAN_Z, cylinder_series, disc_series
from analytic.cylinder_compiled import compute, correct_gap, set_point, workspace
from analytic.inverse.damped_newton import GOAL, LONGEST, STEPS, STUCK
from analytic.inverse.start_table import APART, BINS, CORRECTIONS, MARGIN, PARTS, STEEP
from geometry.compiled import compiled

if TYPE_CHECKING:
    from analytic.inverse.forward_model import Forward
    from analytic.inverse.start_table import StartTable
    from geometry.arrays import Array

SAME = 1e-5
"""Distance below which two poses count as one, mm: far above the error of a converged pose."""
EXACT = 1e-7
"""Largest misfit of three readings over the norm of their slopes, mm: three readings determine a pose exactly."""
CLOSE = 0.4
"""Starts at a fold, on one side of it, and closer than this many cell diagonals lead to the same pose."""
REACH = 2.5
"""Farthest that an iteration moves from its start, in cell diagonals; nearly all poses lie within 1 of a start."""
STALL, FALL = 6, 0.8
"""Number of evaluations in which the misfit must fall, and to which part of its size. Near a double root, the slowest
case, each full step brings it to a quarter."""


class Search:
    """The arguments of `poses_of` for one decoder.

    Parameters
    ----------
    forward, table : forward model, and table of starts.
    low, high : corners of the workspace, rounding on its faces included, shape (3,), mm.
    weights : of the readings in the misfit, shape (k,).
    tolerance : largest misfit of each reading if there are more than three, shape (k,), T.
    """

    def __init__(
        self, forward: Forward, table: StartTable, low: Array, high: Array, weights: Array, tolerance: Array
    ) -> None:
        design, k = forward.design, len(forward.elements)
        radius, half = design.magnet_diameter / 2, design.magnet_height / 2
        # the way to a pose inside may lead through shifts a little outside
        pad = 3 * table.cell_size
        groups: tuple[tuple[Any, ...], ...] = (
            (
                *(
                    forward.points - [0.0, 0.0, design.H],
                    forward.normals,
                    forward.owners,
                    1 / np.bincount(forward.owners),
                ),
                *(forward.tau, forward.mode == "magnitude", radius, half, -design.polarisation),
                *(cylinder_series(half / radius), disc_series(), workspace()),
            ),
            (
                *(table.basis, table.bin_edges, table.first, table.members, table.maps, table.low, table.high),
                *(table.correction, table.curvature, table.centre, table.cell_sign, table.fold, table.nodes),
                *(table.node_sign, table.parts, table.cell_size),
            ),
            (low, high, low - pad, high + pad, weights, tolerance),
            (np.empty(k), np.empty((k, 3)), np.empty(k), np.empty((k, 3))),
        )
        # one order of memory, so that numba compiles the functions once
        self._arguments = tuple(
            tuple(np.ascontiguousarray(value) if isinstance(value, np.ndarray) else value for value in group)
            for group in groups
        )

    def __call__(self, field: Array) -> tuple[Array, Array, bool]:
        """Return shifts (n, 3), mm, and slopes (n, k, 3), T/mm, of all poses, and whether one was a misfit.

        Parameters
        ----------
        field : B.n of each element, shape (k,), T.
        """
        shifts, slopes, count, misfit = poses_of(np.ascontiguousarray(field), *self._arguments)
        return shifts[:count], slopes[:count], misfit

    def starts(self, field: Array) -> Array:
        """Return the starts for one row of readings: bound of the curvature, 1/mm, and shift, mm, shape (n, 4)."""
        return np.array(starts_of(np.ascontiguousarray(field), self._arguments[1])).reshape(-1, 4)


@compiled
def poses_of(field, model, table, box, scratch):
    """Return the poses of one row of readings.

    Parameters
    ----------
    field : B.n or |B| of k elements, T.
    model, table, box, scratch : as in `Search`.

    Returns
    -------
    shifts, slopes : shape (n, 3), mm, and dB/ds, shape (n, k, 3), T/mm.
    count : number n of poses; the arrays are longer.
    misfit : whether a converged pose in the workspace does not fit the readings.
    """
    low, high, _, _, _, tolerance = box
    # misfit and slopes at the last pose of an iteration, and at its next
    f, A, g, B = scratch
    k = len(field)
    starts = starts_of(field, table)
    shifts, slopes = np.empty((len(starts), 3)), np.empty((len(starts), k, 3))
    diagonal = math.sqrt(table[15][0] ** 2 + table[15][1] ** 2 + table[15][2] ** 2)
    count, misfit = 0, False
    for curvature, x, y, z in starts:
        done, x, y, z, p, q, r = refined(curvature, x, y, z, REACH * diagonal, field, model, box, f, A, g, B)
        # the last step is not followed by an evaluation: its misfit is extrapolated along the slopes
        x, y, z = x + p, y + q, z + r
        if not (done and low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]):
            continue
        size, norm, fits = 0.0, 0.0, True
        for i in range(k):
            rest = f[i] + A[i][0] * p + A[i][1] * q + A[i][2] * r
            size += rest * rest
            norm += A[i][0] ** 2 + A[i][1] ** 2 + A[i][2] ** 2
            fits = fits and abs(rest) <= tolerance[i]
        if not (math.sqrt(size) <= EXACT * math.sqrt(norm) if k == 3 else fits):
            misfit = True
            continue
        known = False
        for j in range(count):
            other = shifts[j]
            known = known or max(abs(other[0] - x), abs(other[1] - y), abs(other[2] - z)) < SAME
        if not known:
            shifts[count, 0], shifts[count, 1], shifts[count, 2] = x, y, z
            for i in range(k):
                for j in range(3):
                    slopes[count, i, j] = A[i][j]
            count += 1
    return shifts, slopes, count, misfit


@compiled
def starts_of(field, table):
    """Return the starts for one row of readings: bound of the curvature, 1/mm, and shift, mm, of each."""
    basis, bins, first, members, maps, low, high, correction = table[:8]
    curvature, centre, sign, fold, nodes, node_sign, parts, edge = table[8:]
    r = [0.0, 0.0, 0.0]
    for i in range(3):
        for j in range(len(field)):
            r[i] += basis[i][j] * field[j]
    index = 0
    for i in range(3):
        index = index * BINS + place(bins[i], r[i])
    # hits in regular cells: distance from the centre, cell, position; corners in folded ones: distance, side, shift
    hits = [(0.0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    folds = [(0.0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    for m in range(first[index], first[index + 1]):
        cell = members[m]
        u = position(maps[0][cell], r)
        if abs(u) > 0.5 + MARGIN:
            continue
        v = position(maps[1][cell], r)
        if abs(v) > 0.5 + MARGIN:
            continue
        w = position(maps[2][cell], r)
        if abs(w) > 0.5 + MARGIN:
            continue
        a, b = low[cell], high[cell]
        # a nearly singular linear map reaches far beyond the cell's readings; the bounding box removes it
        if not (a[0] <= r[0] <= b[0] and a[1] <= r[1] <= b[1] and a[2] <= r[2] <= b[2]):
            continue
        if sign[cell] != 0:
            hits.append((max(abs(u), abs(v), abs(w)), int(cell), u, v, w))
            continue
        c, own, turns, boxes = centre[cell], nodes[fold[cell]], node_sign[fold[cell]], parts[fold[cell]]
        for part in range(PARTS**3):
            a = boxes[part]
            if not (a[0] <= u <= a[3] and a[1] <= v <= a[4] and a[2] <= w <= a[5]):
                continue
            i, j, k = part // PARTS**2, part // PARTS % PARTS, part % PARTS
            for side in (-1, 1):
                near, x, y, z = math.inf, 0.0, 0.0, 0.0
                for corner in range(8):
                    ni, nj, nk = i + corner // 4, j + corner // 2 % 2, k + corner % 2
                    node = (ni * (PARTS + 1) + nj) * (PARTS + 1) + nk
                    p = own[node]
                    distance = max(abs(p[0] - u), abs(p[1] - v), abs(p[2] - w))
                    if turns[node] == side and distance < near:
                        near, x, y, z = distance, ni / PARTS - 0.5, nj / PARTS - 0.5, nk / PARTS - 0.5
                if near < math.inf:
                    folds.append((near, side, c[0] + x * edge[0], c[1] + y * edge[1], c[2] + z * edge[2]))
    hits.sort()
    folds.sort()
    diagonal = math.sqrt(edge[0] ** 2 + edge[1] ** 2 + edge[2] ** 2)
    starts = [(0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    for side in (-1, 1):
        # neighbouring cells overlap by their margins, so one pose often lies in several of them
        x, y, z, count = 0.0, 0.0, 0.0, 0
        for _, cell, u, v, w in hits:
            if sign[cell] != side:
                continue
            c = centre[cell]
            a, b, d = c[0] + u * edge[0], c[1] + v * edge[1], c[2] + w * edge[2]
            if count == 0:
                x, y, z = a, b, d
            elif (a - x) ** 2 + (b - y) ** 2 + (d - z) ** 2 <= (APART * diagonal) ** 2:
                continue
            count += 1
            u, v, w = corrected(correction[cell], u, v, w)
            # readings that contradict each other leave a misfit, with which the convergence is not quadratic
            bend = curvature[cell] if len(field) == 3 else STEEP
            starts.append((bend, c[0] + u * edge[0], c[1] + v * edge[1], c[2] + w * edge[2]))
        begin = len(starts)
        for _, its_side, a, b, d in folds:
            far = its_side == side
            for j in range(begin, len(starts)):
                _, x, y, z = starts[j]
                far = far and (a - x) ** 2 + (b - y) ** 2 + (d - z) ** 2 > (CLOSE * diagonal) ** 2
            if far:
                starts.append((STEEP, a, b, d))
    return starts


@compiled
def place(edges, value):
    """Return the number of edges below a value."""
    low, high = 0, len(edges)
    while low < high:
        middle = (low + high) // 2
        if edges[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def position(row, r):
    """Return the position of readings along one axis of a cell, in units of its edges."""
    return row[0] * r[0] + row[1] * r[1] + row[2] * r[2] + row[3]


@compiled
def corrected(c, u, v, w):
    """Return the position in a cell from that by its linear map, by the coefficients c of q."""
    x, y, z = u, v, w
    for _ in range(CORRECTIONS):
        a, b, d = c[0], c[1], c[2]
        xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
        # the order of `start_table.monomials`
        powers = (1.0, x, y, z, xx, xy, xz, yy, yz, zz)
        cubes = (xx * x, xx * y, xx * z, x * yy, xy * z, x * zz, yy * y, yy * z, y * zz, zz * z)
        p, q, r = 0.0, 0.0, 0.0
        for i in range(10):
            p += a[i] * powers[i] + a[10 + i] * cubes[i]
            q += b[i] * powers[i] + b[10 + i] * cubes[i]
            r += d[i] * powers[i] + d[10 + i] * cubes[i]
        x, y, z = u - p, v - q, w - r
    return x, y, z


@compiled
def refined(curvature, x, y, z, reach, field, model, box, f, A, g, B):
    """Iterate from a start; returns whether it converged, the shift before the last step, and this step, mm.

    f and A are filled with the misfit, T, and the slopes, T/mm, at this shift; g and B are scratch.
    """
    _, _, floor, roof, weights, _ = box
    x0, y0, z0 = x, y, z
    mu, last, bend = 0.0, math.inf, curvature
    size = evaluated(x, y, z, field, model, weights, f, A)
    sizes = [size for _ in range(STALL)]
    for turn in range(STEPS):
        p, q, r = step(f, A, weights, mu)
        length = math.sqrt(p * p + q * q + r * r)
        if last < math.inf:
            bend = length / min(last, 1e-2) ** 2
        # a damped step is short because of its damping, which says nothing of the error
        if size == 0 or (mu == 0 and (length < 1e-3 * GOAL or bend * length * length < GOAL)):
            return True, x, y, z, p, q, r
        if not size < math.inf or (mu > 0 and length < STUCK):
            break
        if turn >= STALL and size > FALL * FALL * sizes[turn % STALL] and length >= 1e-6:
            break
        sizes[turn % STALL] = size
        if (x - x0) ** 2 + (y - y0) ** 2 + (z - z0) ** 2 > reach * reach:
            break
        short = min(1.0, LONGEST / length) if length > 0 else 1.0
        a = min(max(x + short * p, floor[0]), roof[0])
        b = min(max(y + short * q, floor[1]), roof[1])
        c = min(max(z + short * r, floor[2]), roof[2])
        trial = evaluated(a, b, c, field, model, weights, g, B)
        # next to the solution rounding decides whether the misfit shrinks, so short steps are accepted
        if trial < size or (length < 1e-6 and trial <= 4 * size + 1e-30):
            x, y, z, size, last = a, b, c, trial, length
            for i in range(len(field)):
                f[i] = g[i]
                for j in range(3):
                    A[i][j] = B[i][j]
            mu = mu / 10 if mu > 1e-4 else 0.0
        else:
            mu = max(10 * mu, 1e-3)
    return False, x, y, z, 0.0, 0.0, 0.0


@compiled
def step(f, A, weights, mu):
    """Return the step -(A'WA + mu tr(A'WA) I)^-1 A'W f, mm; 0 where the matrix is singular."""
    a, b, c, d, e, h, p, q, r = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(f)):
        w = weights[i] * weights[i]
        x, y, z = A[i][0], A[i][1], A[i][2]
        a, b, c = a + w * x * x, b + w * y * y, c + w * z * z
        d, e, h = d + w * x * y, e + w * x * z, h + w * y * z
        p, q, r = p + w * x * f[i], q + w * y * f[i], r + w * z * f[i]
    extra = mu * (a + b + c)
    a, b, c = a + extra, b + extra, c + extra
    bc, eh, dh = b * c - h * h, e * h - c * d, d * h - b * e
    det = a * bc + d * eh + e * dh
    if not det > 0:
        return 0.0, 0.0, 0.0
    ac, de, ab = a * c - e * e, d * e - a * h, a * b - d * d
    return (
        -(bc * p + eh * q + dh * r) / det,
        -(eh * p + ac * q + de * r) / det,
        -(dh * p + de * q + ab * r) / det,
    )


@compiled
def evaluated(x, y, z, field, model, weights, f, A):
    """Fill f with the misfit of each element, T, and A with its slopes, T/mm; return the sum of weighted squares.

    The formulas are those of `analytic.inverse.forward_model`. The sum is infinite where the field is not defined.
    """
    points, normals, owners, share, tau, magnitude, radius, half, J, series, disc, work = model
    # the magnet's axis, and its slopes along x, y and z
    square = x * x + y * y
    t, t_u, t_z = polynomial(tau, square, z)
    turn = t * t * square
    angle = math.sqrt(turn)
    cos = math.cos(angle)
    small = turn < 1e-6
    sinc = 1 - turn / 6 if small else math.sin(angle) / angle
    bend = turn / 60 - 1 / 6 if small else (cos - sinc) / (2 * turn)
    k = sinc * t
    mx, my, mz = k * x, k * y, cos
    lean = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    for j in range(3):
        grow = 2 * x * t_u if j == 0 else 2 * y * t_u if j == 1 else t_z
        wide = 2 * x if j == 0 else 2 * y if j == 1 else 0.0
        d_turn = 2 * t * square * grow + t * t * wide
        d_k = sinc * grow + t * bend * d_turn
        lean[3 * j], lean[3 * j + 1], lean[3 * j + 2] = x * d_k, y * d_k, -sinc / 2 * d_turn
    lean[0] += k
    lean[4] += k
    for i in range(len(field)):
        f[i] = -field[i]
        A[i][0], A[i][1], A[i][2] = 0.0, 0.0, 0.0
    b_r, b_z, rr, ring, rz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    dx, dy, dz, ux, uy, uz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(points)):
        point, n, owner = points[i], normals[i], owners[i]
        # the elements of a chip read the field at one point
        if i == 0 or point[0] != points[i - 1][0] or point[1] != points[i - 1][1] or point[2] != points[i - 1][2]:
            dx, dy, dz = point[0] - x, point[1] - y, point[2] - z
            zeta = mx * dx + my * dy + mz * dz
            ux, uy, uz = dx - zeta * mx, dy - zeta * my, dz - zeta * mz
            rho = math.sqrt(ux * ux + uy * uy + uz * uz)
            if rho > 0:
                ux, uy, uz = ux / rho, uy / rho, uz / rho
            b_r, b_z, rr, ring, rz, zz = meridian(rho, zeta, radius, half, J, series, disc, work)
            if math.isnan(b_z):
                return math.inf
        Bx, By, Bz = b_r * ux + b_z * mx, b_r * uy + b_z * my, b_r * uz + b_z * mz
        nx, ny, nz = n[0], n[1], n[2]
        if magnitude:
            # n = B/|B|, since then B.n = |B|
            size = math.sqrt(Bx * Bx + By * By + Bz * Bz)
            size = size if size > 0 else 1.0
            nx, ny, nz = Bx / size, By / size, Bz / size
        along, out = nx * mx + ny * my + nz * mz, nx * ux + ny * uy + nz * uz
        on_u, on_m = (rr - ring) * out + rz * along, (zz - ring) * along + rz * out
        gx = ring * nx + on_u * ux + on_m * mx
        gy = ring * ny + on_u * uy + on_m * my
        gz = ring * nz + on_u * uz + on_m * mz
        # (B x n - x x g) x m
        vx = By * nz - Bz * ny - (dy * gz - dz * gy)
        vy = Bz * nx - Bx * nz - (dz * gx - dx * gz)
        vz = Bx * ny - By * nx - (dx * gy - dy * gx)
        tx, ty, tz = vy * mz - vz * my, vz * mx - vx * mz, vx * my - vy * mx
        w, row = share[owner], A[owner]
        f[owner] += w * (b_r * out + b_z * along)
        row[0] += w * (lean[0] * tx + lean[1] * ty + lean[2] * tz - gx)
        row[1] += w * (lean[3] * tx + lean[4] * ty + lean[5] * tz - gy)
        row[2] += w * (lean[6] * tx + lean[7] * ty + lean[8] * tz - gz)
    total = 0.0
    for i in range(len(field)):
        total += (weights[i] * f[i]) ** 2
    return total


@compiled
def meridian(rho, z, radius, half, J, series, disc, work):
    """Return the field at a distance rho from the axis and a height z above the magnet's centre, mm.

    The result is B_r and B_z, T, and dB_r/dr, B_r/r, dB_r/dz and dB_z/dz, T/mm; NaN where the field is not defined.
    """
    w = work[0]
    set_point(0, rho, 0.0, z, radius, half, w)
    correct_gap(0, rho, 0.0, radius, w)
    compute(1, half / radius, series, disc, True, work)
    r, scale, lean, along_z = rho / radius, J / radius, w[LEAN], w[ALONG_Z]
    # div B = 0: dB_r/dr = -(dB_z/dz + B_r/r)
    return J * lean * r, J * w[ALONG], -scale * (along_z + lean), scale * lean, scale * w[LEAN_Z] * r, scale * along_z


@compiled
def polynomial(c: Any, u: float, w: float) -> tuple[float, float, float]:
    """Return the value and slopes that `analytic.inverse.polynomials.polynomial` returns."""
    p, p_u, p_w = 0.0, 0.0, 0.0
    for i in range(len(c) - 1, -1, -1):
        row = c[i]
        q, q_w = 0.0, 0.0
        for j in range(len(row) - 1, -1, -1):
            q_w = q_w * w + q
            q = q * w + row[j]
        p_u = p_u * u + p
        p_w = p_w * u + q_w
        p = p * u + q
    return p, p_u, p_w
