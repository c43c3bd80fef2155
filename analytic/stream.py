"""Decoding of one row of readings at a time, for a real-time loop: the results of `analytic.decode`, sooner.

A NumPy operation takes microseconds even for arrays of three numbers. Here the table lookup and the Newton steps for
a single row use Python's floats instead. Rows that this fast method cannot decode go to `analytic.decode.decode`: a
fold nearby, several poses, more than three elements, or elements with plates. Of several poses it then chooses the
one nearest to the last pose.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import NamedTuple

import numpy as np

from analytic.decode import EDGE, Decoder, Status, decode
from analytic.inverse.damped_newton import GOAL
from analytic.inverse.response_surface import ZERO_DEPTH, ZERO_FORCE
from analytic.inverse.start_table import APART, BINS, CORRECTIONS, MARGIN, monomials
from analytic.magnet import meridian_field
from geometry.loads import rotation_of

__all__ = ["Sample", "Stream"]

Vector = tuple[float, float, float]

STEPS = 8
"""Largest number of Newton steps before a row goes to `decode`; from a corrected start one mostly suffices."""
REACH = 0.5 + MARGIN
"""Largest distance from a cell's centre, in units of its edges, at which the enlarged cell contains a point."""


class Sample(NamedTuple):
    """Result of one row of readings; NaN where there is no pose. Units as in `analytic.decode.Decoded`."""

    status: Status
    shift: Vector
    tilt: tuple[float, float]
    force: Vector
    multiplicity: int


NAN3 = (math.nan, math.nan, math.nan)
"""A vector without a value."""


class Stream:
    """Decoder of a time series, one row at a time; of several poses it chooses the one nearest to the last.

    Parameters
    ----------
    coder : as returned by `analytic.decode.decoder`.
    """

    def __init__(self, coder: Decoder) -> None:
        # lists, because indexing a NumPy array costs more than the arithmetic on one number
        self.coder = coder
        forward, design = coder.forward, coder.forward.design
        self.last: Vector = (0.0, 0.0, 0.0)
        self.simple = len(forward.owners) == 3 and forward.mode == "component"
        points = forward.points - [0.0, 0.0, design.H]
        self.points = list(zip(points.tolist(), forward.normals.tolist(), strict=True))
        self.magnet = meridian_field(design.magnet_diameter / 2, design.magnet_height, -design.polarisation)
        self.tau = forward.tau.tolist() if forward.tau.any() else []
        self.rails = [((e.low - e.null) / e.gain, (e.high - e.null) / e.gain) for e in forward.elements]
        table = coder.table
        self.edges, self.edge = table.bin_edges.tolist(), table.cell_size.tolist()
        self.maps, self.centres = table.maps.transpose(1, 0, 2).tolist(), table.centre.tolist()
        self.turns = table.cell_sign.tolist()
        self.low, self.high = (coder.low - EDGE).tolist(), (coder.high + EDGE).tolist()
        self.apart = APART * math.hypot(*self.edge)

    def step(self, field: Vector) -> Sample:
        """Decode one row of readings, B.n of each element, T.

        Raises
        ------
        BadInput
            The number of readings differs from the number of elements.
        """
        shift = None
        if self.simple and len(field) == 3:
            inside = all(low < b < high for b, (low, high) in zip(field, self.rails, strict=True))
            start = self._start(field) if inside else None
            shift = None if start is None else self._newton(field, *start)
        if shift is None:
            return self._decode_in_full(field)
        self.last = shift
        turn = self._tau(shift[0] ** 2 + shift[1] ** 2, shift[2])[0]
        force = NAN3 if self.coder.mechanics is None else self._force(shift)
        # with mechanics, the force is NaN only where the plate would have to pull
        pulls = self.coder.mechanics is not None and math.isnan(force[2])
        return Sample("tension" if pulls else "ok", shift, rotation_of(turn * shift[0], turn * shift[1]), force, 1)

    def _decode_in_full(self, field: Vector) -> Sample:
        """Decode a row by `analytic.decode.decode`."""
        decoded = decode(self.coder, np.asarray(field, dtype=np.float64)[None], near=self.last)
        x, y, z = decoded.shift[0].tolist()
        if decoded.multiplicity[0]:
            self.last = (x, y, z)
        rx, ry = decoded.tilt[0].tolist()
        f_x, f_y, f_n = decoded.force[0].tolist()
        return Sample(decoded.status[0], (x, y, z), (rx, ry), (f_x, f_y, f_n), int(decoded.multiplicity[0]))

    def _start(self, field: Vector) -> tuple[list[float], float] | None:
        """Return the only start in the table and its curvature bound; None if there is no start, or more than one."""
        table = self.coder.table
        index = 0
        for edges, b in zip(self.edges, field, strict=True):
            index = index * BINS + bisect_left(edges, b)
        # each cell that contains the readings: distance from its centre, index, position in it
        hits: list[tuple[float, int, list[float]]] = []
        for cell in table.members[table.first[index] : table.first[index + 1]].tolist():
            u: list[float] = []
            for a, b, c, d in self.maps[cell]:
                u.append(a * field[0] + b * field[1] + c * field[2] + d)
                if not -REACH <= u[-1] <= REACH:
                    break
            else:
                hits.append((max(map(abs, u)), cell, u))
        if not hits:
            return None
        # cells on both sides of a fold mean several poses; sign 0 is a folded cell, where the linear map is no guide
        signs = {self.turns[cell] for _, cell, _ in hits}
        if len(signs) > 1 or 0 in signs:
            return None
        _, cell, u = min(hits)
        best = self._shift_in_cell(cell, u)
        if any(math.dist(self._shift_in_cell(other, v), best) > self.apart for _, other, v in hits):
            return None
        correction, v = table.correction[:, :, cell], u
        for _ in range(CORRECTIONS):
            q = correction.dot(monomials(*v)).tolist()
            v = [u[0] - q[0], u[1] - q[1], u[2] - q[2]]
        return self._shift_in_cell(cell, v), float(table.curvature[cell])

    def _shift_in_cell(self, cell: int, u: list[float]) -> list[float]:
        """Return the shift, mm, at the position u in a cell, in units of its edges."""
        return [c + v * e for c, v, e in zip(self.centres[cell], u, self.edge, strict=True)]

    def _newton(self, field: Vector, s: list[float], curvature: float) -> Vector | None:
        """Return the pose from a start; None if undamped Newton steps do not converge, or converge outside."""
        last = math.inf
        for _ in range(STEPS):
            rows, f = self._slopes_and_residuals(s, field)
            # solve J (p, q, r) = -f by cofactors
            (a, b, c), (d, e, g), (h, i, j) = rows
            A, B, C = e * j - g * i, g * h - d * j, d * i - e * h
            det = a * A + b * B + c * C
            if det == 0:
                return None
            p = -(A * f[0] + (c * i - b * j) * f[1] + (b * g - c * e) * f[2]) / det
            q = -(B * f[0] + (a * j - c * h) * f[1] + (c * d - a * g) * f[2]) / det
            r = -(C * f[0] + (b * h - a * i) * f[1] + (a * e - b * d) * f[2]) / det
            length = math.sqrt(p * p + q * q + r * r)
            if not length < min(0.5, last):
                return None
            s = [s[0] + p, s[1] + q, s[2] + r]
            bend = curvature if last == math.inf else length / min(last, 1e-2) ** 2
            if length < 1e-3 * GOAL or bend * length**2 < GOAL:
                good = all(low <= v <= high for low, v, high in zip(self.low, s, self.high, strict=True))
                return (s[0], s[1], s[2]) if good else None
            last = length
        return None

    def _slopes_and_residuals(self, s: list[float], field: Vector) -> tuple[list[list[float]], list[float]]:
        """Return the slopes of each reading at the shift s, T/mm, and its residual, T.

        The formulas are those of `analytic.inverse.forward_model`.
        """
        m, lean = self._axis(s)
        rows, residuals = [], []
        for (point, n), read in zip(self.points, field, strict=True):
            x = [point[0] - s[0], point[1] - s[1], point[2] - s[2]]
            zeta = m[0] * x[0] + m[1] * x[1] + m[2] * x[2]
            u = [x[0] - zeta * m[0], x[1] - zeta * m[1], x[2] - zeta * m[2]]
            rho = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
            if rho > 0:
                u = [u[0] / rho, u[1] / rho, u[2] / rho]
            b_r, b_z, rr, ring, rz, zz = self.magnet(rho, zeta)
            along = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
            out = n[0] * u[0] + n[1] * u[1] + n[2] * u[2]
            on_u, on_m = (rr - ring) * out + rz * along, (zz - ring) * along + rz * out
            g = [ring * n[k] + on_u * u[k] + on_m * m[k] for k in range(3)]
            row = [-g[0], -g[1], -g[2]]
            if lean:
                B = [b_r * u[k] + b_z * m[k] for k in range(3)]
                v = _cross(B, n)
                w = _cross(x, g)
                turn = _cross([v[0] - w[0], v[1] - w[1], v[2] - w[2]], m)
                for j in range(3):
                    row[j] += lean[j][0] * turn[0] + lean[j][1] * turn[1] + lean[j][2] * turn[2]
            rows.append(row)
            residuals.append(b_r * out + b_z * along - read)
        return rows, residuals

    def _axis(self, s: list[float]) -> tuple[list[float], list[list[float]]]:
        """Return the magnet's axis m and its slopes dm_i/ds_j at [j][i], 1/mm; no slopes if it does not tilt."""
        if not self.tau:
            return [0.0, 0.0, 1.0], []
        x, y, z = s
        u = x * x + y * y
        t, t_u, t_z = self._tau(u, z)
        square = t * t * u
        angle = math.sqrt(square)
        cos = math.cos(angle)
        small = square < 1e-6
        sinc = 1 - square / 6 if small else math.sin(angle) / angle
        bend = square / 60 - 1 / 6 if small else (cos - sinc) / (2 * square)
        k = sinc * t
        lean = []
        for grow, wide in ((2 * x * t_u, 2 * x), (2 * y * t_u, 2 * y), (t_z, 0.0)):
            d_square = 2 * t * u * grow + t * t * wide
            d_k = sinc * grow + t * bend * d_square
            lean.append([x * d_k, y * d_k, -sinc / 2 * d_square])
        lean[0][0] += k
        lean[1][1] += k
        return [k * x, k * y, cos], lean

    def _tau(self, u: float, w: float) -> tuple[float, float, float]:
        """Return tau, rad/mm, and its slopes along u = rho^2 and w = s_z."""
        return _polynomial(self.tau, u, w)

    def _force(self, shift: Vector) -> Vector:
        """Return the force on the tip, N, as `analytic.inverse.response_surface.force_and_load` does."""
        law = self.coder.mechanics
        assert law is not None
        x, y, w = shift
        u = x * x + y * y
        k, n = _polynomial(law.lateral.tolist(), u, w)[0], _polynomial(law.normal.tolist(), u, w)[0]
        least = law.errors[2] + ZERO_FORCE
        if w < 0 and n < -least:
            return NAN3
        if (w >= 0 or n <= least) and _polynomial(law.depth.tolist(), u, math.cbrt(max(-w, 0.0)))[0] <= ZERO_DEPTH:
            return 0.0, 0.0, 0.0
        return x * k, y * k, max(n, 0.0)


def _cross(a: list[float], b: list[float]) -> list[float]:
    """Return the vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _polynomial(c: list[list[float]], u: float, w: float) -> tuple[float, float, float]:
    """Return the value and slopes that `analytic.inverse.polynomials.polynomial` returns."""
    p = p_u = p_w = 0.0
    for row in reversed(c):
        q, q_w = 0.0, 0.0
        for value in reversed(row):
            q_w = q_w * w + q
            q = q * w + value
        p_u = p_u * u + p
        p_w = p_w * u + q_w
        p = p * u + q
    return p, p_u, p_w
