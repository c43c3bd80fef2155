"""Readings of poses with their slopes: the forward model that the decoder inverts.

With m the magnet's axis, -J m its polarisation (J < 0 if the north pole points up), p a point of an element and s the
shift of the magnet's centre, the field is

    B = -B_magnet(x; m),    x = p - (0, 0, H) - s.

With G = grad B, which is symmetric, and g = G n, a motion of the magnet by ds and a turn by dw change a reading B.n
by

    d(B.n) = -g.ds + (B x n - x x g).dw,

because the field moves and turns with the magnet. The decoder knows the tilt as a function of the shift: the sensor
is a body of revolution, so a magnet shifted along e = (s_x, s_y)/rho leans towards e, by the angle t = tau rho with
tau(rho^2, s_z) in rad/mm: a polynomial that is held near the range of its samples, because beyond them it would turn
the magnet several times, and each turn would have poses of its own. With v = tau (s_x, s_y), the silicone at the
magnet turns e_z to m = (sinc(|v|) v, cos(|v|)).

The magnet of a made sensor lies off its place in the silicone, by an offset o, and leans by a v of its own. Its
centre moves by s + R o, where the rotation R turns e_z to m, and its axis follows from the sum of both v. The slope
of a reading along s_j is then -g.d(s + R o)/ds_j + (dm/ds_j).[(B x n - x x g) x m].

Arrays of poses that are given to numba have them in their first axis, all others in their last. Lengths in mm, B in
T, angles in rad.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.cylinder import compiled_functions, cylinder_series, disc_series
from analytic.hall import Mode, plates_of, rotated
from analytic.parts import Element, of_design
from geometry.arrays import Array, Ints
from geometry.compiled import compiled
from geometry.design import BadInput, Design
from geometry.loads import rotation_of

lengths, unit_field = compiled_functions().lengths, compiled_functions().unit_field

Vector = tuple[float, float, float]
Tilt = tuple[Array, float, float]
"""Coefficients c[i, j] of tau = sum c[i, j] rho^(2i) s_z^j, and its least and largest value, rad/mm."""

NO_TILT: Tilt = (np.zeros((1, 1)), 0.0, 0.0)
"""The magnet does not tilt."""
Mount = tuple[Array, Array]
"""Offset of a magnet in the silicone, shape (3,), mm, and its rotation vector (rx, ry) there, shape (2,), rad."""

CENTRED: Mount = (np.zeros(3), np.zeros(2))
"""The magnet lies where the design has it."""


@dataclass(frozen=True, slots=True, eq=False)
class Forward:
    """A design's elements, and the tilt of its magnet as a function of its shift.

    Attributes
    ----------
    elements : k elements.
    mode : "component" (readings B.n) or "magnitude" (readings |B|), as in `analytic.hall.readings`.
    kernel : arguments of `read`: points at which the elements sample the field, relative to the magnet's centre at
        rest, mm, their directions n, and the element of each; one over the number of points of each element; tau and
        the mount; whether the mode is "magnitude"; radius and half height of the magnet, mm, and J, T; the series of
        `analytic.cylinder`.
    """

    design: Design
    elements: tuple[Element, ...]
    tau: Tilt
    mode: Mode
    kernel: tuple[Any, ...]


def model(
    design: Design,
    tau: Tilt = NO_TILT,
    *,
    elements: Sequence[Element] | None = None,
    mode: Mode = "component",
    mount: Mount = CENTRED,
) -> Forward:
    """Return the forward model of a design.

    Parameters
    ----------
    tau : `NO_TILT` ignores the tilt, as the paper does.
    elements, mode : as in `analytic.hall.readings`.
    mount : of the magnet of a made sensor.

    Raises
    ------
    BadInput
        The design has no magnet, there are fewer than three elements, or one of them lies inside the beam.
    """
    if not design.shape.has_magnet:
        raise BadInput(
            "this design has no magnet (magnet_diameter is 0), so there is no pose to decode: give it a magnet"
        )
    chosen = of_design(design) if elements is None else tuple(elements)
    if len(chosen) < 3:
        raise BadInput(f"a pose needs at least three readings; got {len(chosen)} elements: add elements")
    for element in chosen:
        x, y, z = element.position
        if 0 < z < design.L and x * x + y * y < design.R**2 - max(z - design.H, 0.0) ** 2:
            way = "larger l0 or f, smaller c" if design.hall_layout == "three" else "larger l0 or chip_x"
            raise BadInput(f"{element.name} lies inside the beam, at ({x:g}, {y:g}, {z:g}) mm: move it out ({way})")
    return Forward(design, chosen, tau, mode, _kernel(design, chosen, (tau, *mount), mode))


def _kernel(
    design: Design, elements: Sequence[Element], motion: tuple[Tilt, Array, Array], mode: Mode
) -> tuple[Any, ...]:
    points, owners = plates_of(elements)
    normals = np.array([element.direction for element in elements], dtype=np.float64)[owners]
    share = 1 / np.bincount(owners)
    radius, half = design.magnet_diameter / 2, design.magnet_height / 2
    series = cylinder_series(half / radius), disc_series()
    return (
        *(points - [0.0, 0.0, design.H], normals, owners, share),
        *(motion, mode == "magnitude", radius, half, -design.polarisation, *series),
    )


def readings_with_slopes(forward: Forward, shift: Array) -> tuple[Array, Array]:
    """Return the readings at shifts of the magnet, and their slopes.

    shift : shape (3, n), mm.

    Returns
    -------
    values : B.n, or |B|, of each element, shape (k, n), T.
    slopes : slope of element k's reading along s_j at [j, k, n], shape (3, k, n), T/mm.

    Raises
    ------
    BadInput
        A point of an element lies on the magnet's rim, where the field is infinite.
    """
    n, k = shift.shape[1], len(forward.elements)
    values, slopes = np.empty((n, k)), np.empty((n, k, 3))
    read(np.ascontiguousarray(shift.T), forward.kernel, values, slopes)
    _check(values)
    return values.T, slopes.transpose(2, 1, 0)


def readings_at(forward: Forward, shift: Array) -> Array:
    """Return the readings of `readings_with_slopes` alone, shape (k, n), T."""
    values = np.empty((shift.shape[1], len(forward.elements)))
    read(np.ascontiguousarray(shift.T), forward.kernel, values, np.empty((0, 0, 3)))
    _check(values)
    return values.T


def slopes_at(design: Design, shift: Vector, tilt: tuple[float, float]) -> tuple[Array, Array]:
    """Return the slopes of the elements' readings B.n by small displacements and rotations of the magnet.

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
    elements = of_design(design)
    kernel = _kernel(design, elements, (NO_TILT, *CENTRED), "component")
    values, by_shift, by_turn = np.empty((1, len(elements))), *np.empty((2, 1, len(elements), 3))
    upright = np.array([0.0, 0.0, 1.0])
    read_poses(np.array([shift], dtype=float), rotated(upright, np.array([tilt])), kernel, values, by_shift, by_turn)
    _check(values)
    return by_shift[0], by_turn[0]


def readings_of_sensors(
    points: Array, normals: Array, owners: Ints, size: Array, shift: Array, axis: Array, *, slopes: bool = True
) -> tuple[Array, Array, Array]:
    """Return the readings of n sensors in p poses each, and their slopes, over the remanence; NaN without a field.

    Parameters
    ----------
    points, normals : where the elements sample the field, relative to the magnet's centre at rest, mm, and their
        directions, shape (n, m, 3). owners : the element of each of the m points, ascending.
    size : diameter and height of the magnets, shape (n, 2), mm.
    shift, axis : displacement of the magnet, mm, and its axis, (0, 0, 1) at rest, shape (n, p, 3).

    Returns
    -------
    values, by_shift, by_turn : shape (n, p, k), 1, and (n, p, k, 3), 1/mm and 1/rad, as `slopes_at` returns them; the
        slopes are empty if they are not wanted.
    """
    half = size / 2
    series = np.array([cylinder_series(h / r) for r, h in half.tolist()])
    share = 1 / np.bincount(owners)
    values = np.empty((*shift.shape[:2], len(share)))
    by_shift, by_turn = np.empty((2, *(values.shape if slopes else (len(points), 0, len(share))), 3))
    arrays = tuple(map(np.ascontiguousarray, (points, normals, half, series, shift, axis)))
    _read_sensors(arrays, (owners, share, (NO_TILT, *CENTRED), disc_series()), (values, by_shift, by_turn))
    return values, by_shift, by_turn


@compiled
def _read_sensors(of_sensors, common, answers):
    points, normals, half, series, shift, axis = of_sensors
    (owners, share, motion, disc), (values, by_shift, by_turn) = common, answers
    for s in range(len(points)):
        magnet = half[s, 0], half[s, 1], -1.0, series[s], disc
        kernel = (points[s], normals[s], owners, share, motion, False, *magnet)
        read_poses(shift[s], axis[s], kernel, values[s], by_shift[s], by_turn[s])


def _check(values: Array) -> None:
    if np.isnan(values).any():
        raise BadInput(
            "the field is infinite on the magnet's rim (r = radius, |z| = height/2), where a point of an element "
            "lies: move the point off it"
        )


def rotation(tau: Tilt, shift: Array) -> Array:
    """Return the tilt at shifts (3, n), mm, as rotation vectors (rx, ry) of `analytic.hall.field_at`, (2, n), rad."""
    t = np.empty(shift.shape[1])
    _leans(tau, shift, t)
    return np.array(rotation_of(t * shift[0], t * shift[1]))


@compiled
def _leans(tau, shift, t):
    for p in range(len(t)):
        t[p] = held(tau, shift[0, p] * shift[0, p] + shift[1, p] * shift[1, p], shift[2, p])[0]


def magnets_at(forward: Forward, shift: Array) -> tuple[Array, Array]:
    """Return the displacement of the magnet, mm, and its axis, (n, 3) each, at shifts (3, n) of its place, mm."""
    (moved, axis), slopes = np.empty((2, shift.shape[1], 3)), np.empty((2, shift.shape[1], 3, 3))
    place_magnets(forward.kernel[4], np.ascontiguousarray(shift.T), moved, axis, *slopes)
    return moved, axis


@compiled
def read(shift, kernel, values, slopes):
    """Fill the readings (n, k), T, at shifts (n, 3), mm, and, if it is not empty, their slopes (n, k, 3), T/mm.

    Where the field is not defined they are NaN.
    """
    n, k = len(shift), values.shape[1]
    moved, axis, by_place, by_axis = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 3))
    place_magnets(kernel[4], shift, moved, axis, by_place, by_axis)
    by_shift, by_turn = np.empty((len(slopes), k, 3)), np.empty((len(slopes), k, 3))
    read_poses(moved, axis, kernel, values, by_shift, by_turn)
    for p in range(len(slopes)):
        slopes_by_place(by_shift[p], by_turn[p], axis[p], by_place[p], by_axis[p], slopes[p])


@compiled
def slopes_by_place(by_shift, by_turn, axis, by_place, by_axis, slopes):
    """Fill the slopes (k, 3) of readings along s_j in a pose, from those of `read_poses` and of `place_magnets`."""
    for i in range(len(slopes)):
        g, turn = by_shift[i], cross(by_turn[i], axis)
        for j in range(3):
            d, e = by_place[j], by_axis[j]
            slopes[i, j] = d[0] * g[0] + d[1] * g[1] + d[2] * g[2] + e[0] * turn[0] + e[1] * turn[1] + e[2] * turn[2]


@compiled
def held(tau, u, w):
    """Return tau and its slopes along u and w.

    Beyond its range tau nears a limit as far off as the range is wide: steadily, because a kink would be a fold.
    """
    coefficients, least, most = tau
    t, t_u, t_w = polynomial(coefficients, u, w)
    edge, room = min(max(t, least), most), most - least
    if t == edge:
        return t, t_u, t_w
    bend = math.tanh((t - edge) / room)
    share = 1 - bend * bend
    return edge + room * bend, share * t_u, share * t_w


@compiled
def place_magnets(motion, shift, moved, axis, by_place, by_axis):
    """Fill displacement and axis of the magnet (n, 3) at shifts (n, 3), mm, and their slopes along s_j at [n, j]."""
    tau, offset, tilt = motion
    for p in range(len(shift)):
        x, y, m, e = shift[p, 0], shift[p, 1], axis[p], by_axis[p]
        t, t_u, t_z = held(tau, x * x + y * y, shift[p, 2])
        grow = (2 * x * t_u, 2 * y * t_u, t_z)
        by_v = ((t + x * grow[0], y * grow[0]), (x * grow[1], t + y * grow[1]), (x * grow[2], y * grow[2]))
        lean(t * x, t * y, by_v, m, e)
        # R o = (o_x + a m_x, o_y + a m_y, o_z m_z - q), q = o_x m_x + o_y m_y, a = o_z - q/(1 + m_z)
        q, down = offset[0] * m[0] + offset[1] * m[1], max(1 + m[2], 1e-9)
        a = offset[2] - q / down
        moved[p, 0] = x + offset[0] + a * m[0]
        moved[p, 1] = y + offset[1] + a * m[1]
        moved[p, 2] = shift[p, 2] + offset[2] * m[2] - q
        for j in range(3):
            d_q = offset[0] * e[j, 0] + offset[1] * e[j, 1]
            d_a = (q / down * e[j, 2] - d_q) / down
            by_place[p, j, 0] = a * e[j, 0] + d_a * m[0]
            by_place[p, j, 1] = a * e[j, 1] + d_a * m[1]
            by_place[p, j, 2] = offset[2] * e[j, 2] - d_q
            by_place[p, j, j] += 1.0
        lean(t * x + tilt[1], t * y - tilt[0], by_v, m, e)


@compiled
def lean(x, y, by_v, axis, by_axis):
    """Fill the axis (3,) that leans by v = (x, y), rad, and its slopes [j, i], for slopes (3, 2) of v."""
    square = x * x + y * y
    angle = math.sqrt(square)
    cos = math.cos(angle)
    # near 0 the closed form of the slope of sin(t)/t is 0/0
    small = square < 1e-6
    sinc = 1 - square / 6 if small else math.sin(angle) / angle
    bend = square / 60 - 1 / 6 if small else (cos - sinc) / (2 * square)
    axis[0], axis[1], axis[2] = sinc * x, sinc * y, cos
    for j in range(3):
        d_x, d_y = by_v[j]
        d_square = 2 * (x * d_x + y * d_y)
        by_axis[j, 0], by_axis[j, 1] = sinc * d_x + bend * d_square * x, sinc * d_y + bend * d_square * y
        by_axis[j, 2] = -sinc / 2 * d_square


@compiled
def read_poses(shift, axis, kernel, values, by_shift, by_turn):
    """Fill the readings (n, k) of poses, and, if they are not empty, -g and B x n - x x g, shape (n, k, 3).

    The magnet's centre is displaced by shift (n, 3), mm, and its axis is m, shape (n, 3).
    """
    points, normals, owners, share, _, magnitude, radius, half, J, series, disc = kernel
    slope = len(by_shift) > 0
    values[:], by_shift[:], by_turn[:] = 0.0, 0.0, 0.0
    for p in range(len(shift)):
        m = axis[p]
        x, u, rho, zeta = placed(points[0], shift[p], m)
        lean, along, lean_z, along_z = math.nan, math.nan, math.nan, math.nan
        for i in range(len(points)):
            k, n = owners[i], (normals[i, 0], normals[i, 1], normals[i, 2])
            new = i == 0
            for j in range(3):
                new = new or points[i, j] != points[i - 1, j]
            # the axes of a chip share their point
            if new:
                x, u, rho, zeta = placed(points[i], shift[p], m)
                place = lengths(rho, 0.0, zeta, radius, half)
                lean, along, lean_z, along_z = unit_field(place, half / radius, series, disc, slope)
            b_u, b_m = J * lean * (rho / radius), J * along
            B = (b_u * u[0] + b_m * m[0], b_u * u[1] + b_m * m[1], b_u * u[2] + b_m * m[2])
            if magnitude:
                # n = B/|B|, since then B.n = |B|
                size = math.sqrt(B[0] * B[0] + B[1] * B[1] + B[2] * B[2])
                size = size if size > 0 else 1.0
                n = (B[0] / size, B[1] / size, B[2] / size)
            on_m, on_u = n[0] * m[0] + n[1] * m[1] + n[2] * m[2], n[0] * u[0] + n[1] * u[1] + n[2] * u[2]
            values[p, k] += share[k] * (b_u * on_u + b_m * on_m)
            if slope:
                # B_r/r, dB_r/dz = dB_z/dr and dB_z/dz, T/mm; dB_r/dr = -(dB_z/dz + B_r/r) by div B = 0
                ring, rz, zz = lean * J / radius, lean_z * (rho / radius) * J / radius, along_z * J / radius
                g_u, g_m = (-zz - 2 * ring) * on_u + rz * on_m, (zz - ring) * on_m + rz * on_u
                g = (
                    ring * n[0] + g_u * u[0] + g_m * m[0],
                    ring * n[1] + g_u * u[1] + g_m * m[1],
                    ring * n[2] + g_u * u[2] + g_m * m[2],
                )
                turn, arm = cross(B, n), cross(x, g)
                for j in range(3):
                    by_shift[p, k, j] -= share[k] * g[j]
                    by_turn[p, k, j] += share[k] * (turn[j] - arm[j])


@compiled
def placed(point, shift, m):
    """Return a point relative to the magnet's centre, its unit vector across the axis, its distance and height."""
    x = (point[0] - shift[0], point[1] - shift[1], point[2] - shift[2])
    zeta = m[0] * x[0] + m[1] * x[1] + m[2] * x[2]
    u, v, w = x[0] - zeta * m[0], x[1] - zeta * m[1], x[2] - zeta * m[2]
    rho = math.sqrt(u * u + v * v + w * w)
    scale = 1 / rho if rho > 0 else 1.0
    return x, (u * scale, v * scale, w * scale), rho, zeta


@compiled
def cross(a, b):
    """Return the vector product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def polynomial(c, u, w):
    """Return p = sum c[i, j] u^i w^j and its slopes along u and w, by Horner's rule."""
    p, p_u, p_w = 0.0, 0.0, 0.0
    for i in range(len(c) - 1, -1, -1):
        q, q_w = 0.0, 0.0
        for j in range(c.shape[1] - 1, -1, -1):
            q_w = q_w * w + q
            q = q * w + c[i, j]
        p_u = p_u * u + p
        p_w = p_w * u + q_w
        p = p * u + q
    return p, p_u, p_w
