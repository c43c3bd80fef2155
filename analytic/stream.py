"""Readings one at a time, for a loop that waits for each: what `analytic.decode` finds, in a fraction of its time.

NumPy takes microseconds for an operation, whatever the length of its arrays. Here a single row of readings is looked
up in the table, and Newton's steps are taken, in Python's own numbers. A row that this does not settle (a fold
nearby, several poses, more elements than three, plates) goes to `decode`, with the pose before as its warm start.
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

Vector = tuple[float, float, float]

STEPS = 8
REACH = 0.5 + MARGIN


class Sample(NamedTuple):
    """What one row of readings says; NaN where there is no pose. Units as in `analytic.decode.Decoded`."""

    status: Status
    shift: Vector
    tilt: tuple[float, float]
    force: Vector
    multiplicity: int


NAN3 = (math.nan, math.nan, math.nan)


class Stream:
    """Decodes row after row; of several poses it takes the one nearest to the last.

    Parameters
    ----------
    coder : as `analytic.decode.decoder` makes it.
    """

    def __init__(self, coder: Decoder) -> None:
        self.coder = coder
        forward, design = coder.forward, coder.forward.design
        self.last: Vector = (0.0, 0.0, 0.0)
        self.simple = len(forward.owners) == 3 and forward.mode == "component"
        points = forward.points - [0.0, 0.0, design.H]
        self.points = list(zip(points.tolist(), forward.normals.tolist(), strict=True))
        self.magnet = meridian_field(design.magnet_diameter / 2, design.magnet_height, -design.remanence)
        self.tau = forward.tau.tolist() if forward.tau.any() else []
        self.rails = [((e.low - e.null) / e.gain, (e.high - e.null) / e.gain) for e in forward.elements]
        table = coder.table
        self.edges, self.edge = table.bin_edges.tolist(), table.cell_size.tolist()
        self.maps, self.centres = table.maps.transpose(1, 0, 2).tolist(), table.centre.tolist()
        self.turns = table.cell_sign.tolist()
        self.low, self.high = (coder.low - EDGE).tolist(), (coder.high + EDGE).tolist()
        self.apart = APART * math.hypot(*self.edge)

    def step(self, field: Vector) -> Sample:
        """Decode B.n of the elements, T.

        Raises
        ------
        BadInput
            There is another number of readings than of elements.
        """
        shift = None
        if self.simple and len(field) == 3:
            inside = all(low < b < high for b, (low, high) in zip(field, self.rails, strict=True))
            start = self._start(field) if inside else None
            shift = None if start is None else self._newton(field, *start)
        if shift is None:
            return self._slowly(field)
        self.last = shift
        turn = self._tau(shift[0] ** 2 + shift[1] ** 2, shift[2])[0]
        force = NAN3 if self.coder.mechanics is None else self._force(shift)
        # a known force is lost only where the plate would have to pull
        pulls = self.coder.mechanics is not None and math.isnan(force[2])
        return Sample("tension" if pulls else "ok", shift, rotation_of(turn * shift[0], turn * shift[1]), force, 1)

    def _slowly(self, field: Vector) -> Sample:
        found = decode(self.coder, np.asarray(field, dtype=np.float64)[None], near=self.last)
        x, y, z = found.shift[0].tolist()
        if found.multiplicity[0]:
            self.last = (x, y, z)
        rx, ry = found.tilt[0].tolist()
        f_x, f_y, f_n = found.force[0].tolist()
        return Sample(found.status[0], (x, y, z), (rx, ry), (f_x, f_y, f_n), int(found.multiplicity[0]))

    def _start(self, field: Vector) -> tuple[list[float], float] | None:
        """The only start that the table gives with its curvature, or None."""
        table = self.coder.table
        index = 0
        for edges, b in zip(self.edges, field, strict=True):
            index = index * BINS + bisect_left(edges, b)
        found: list[tuple[float, int, list[float]]] = []
        for cell in table.members[table.first[index] : table.first[index + 1]].tolist():
            u: list[float] = []
            for a, b, c, d in self.maps[cell]:
                u.append(a * field[0] + b * field[1] + c * field[2] + d)
                if not -REACH <= u[-1] <= REACH:
                    break
            else:
                found.append((max(map(abs, u)), cell, u))
        if not found:
            return None
        turns = {self.turns[cell] for _, cell, _ in found}
        if len(turns) > 1 or 0 in turns:
            return None
        _, cell, u = min(found)
        best = self._place(cell, u)
        if any(math.dist(self._place(other, v), best) > self.apart for _, other, v in found):
            return None
        bends, v = table.correction[:, :, cell], u
        for _ in range(CORRECTIONS):
            q = bends.dot(monomials(*v)).tolist()
            v = [u[0] - q[0], u[1] - q[1], u[2] - q[2]]
        return self._place(cell, v), float(table.curvature[cell])

    def _place(self, cell: int, u: list[float]) -> list[float]:
        """Shift, mm, of a place in a cell."""
        return [c + v * e for c, v, e in zip(self.centres[cell], u, self.edge, strict=True)]

    def _newton(self, field: Vector, s: list[float], curve: float) -> Vector | None:
        """The pose from a start, or None if Newton's undamped steps do not settle, or settle outside."""
        last = math.inf
        for _ in range(STEPS):
            rows, f = self._seen(s, field)
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
            bend = curve if last == math.inf else length / min(last, 1e-2) ** 2
            if length < 1e-3 * GOAL or bend * length**2 < GOAL:
                good = all(low <= v <= high for low, v, high in zip(self.low, s, self.high, strict=True))
                return (s[0], s[1], s[2]) if good else None
            last = length
        return None

    def _seen(self, s: list[float], field: Vector) -> tuple[list[list[float]], list[float]]:
        """Slopes of each reading, T/mm, and what the readings lack, T; formulas as in `inverse.forward_model`."""
        m, lean = self._axis(s)
        rows, lack = [], []
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
            lack.append(b_r * out + b_z * along - read)
        return rows, lack

    def _axis(self, s: list[float]) -> tuple[list[float], list[list[float]]]:
        """The magnet's axis, and its slopes dm_i/ds_j at [j][i]; none if it does not tilt."""
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
        return _polynomial(self.tau, u, w)

    def _force(self, shift: Vector) -> Vector:
        law = self.coder.mechanics
        assert law is not None
        x, y, w = shift
        u = x * x + y * y
        k, n = _polynomial(law.lateral.tolist(), u, w)[0], _polynomial(law.normal.tolist(), u, w)[0]
        # as `analytic.inverse.response_surface.force_and_load`
        least = law.errors[2] + ZERO_FORCE
        if w < 0 and n < -least:
            return NAN3
        if (w >= 0 or n <= least) and _polynomial(law.depth.tolist(), u, math.cbrt(max(-w, 0.0)))[0] <= ZERO_DEPTH:
            return 0.0, 0.0, 0.0
        return x * k, y * k, max(n, 0.0)


def _cross(a: list[float], b: list[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _polynomial(c: list[list[float]], u: float, w: float) -> tuple[float, float, float]:
    """As `analytic.inverse.forward_model.polynomial`."""
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
