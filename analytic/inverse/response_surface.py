"""The mechanics that the decoder needs: tilt, force and load as functions of the magnet's shift, from any model.

The silicone between base and magnet is a spring, so the forces are smooth functions of the magnet's pose, whatever
happens at the tip. With u the lateral shift, w the vertical one (negative when the magnet sinks), U = u^2, and all
lateral quantities along the shift (a body of revolution), least squares over samples Load -> Response give

    tilt = u tau(U, w),  F_t = u k(U, w),  F_n = n(U, w),  depth = r d(U, r),  shear = u g(U, r),  r = (-w)^(1/3),

tau, k, n, d, g polynomials. The depth of a contact goes like (-w)^(2/3) near first touch, hence r. mm, N, rad.

The normal force and the depth grow as the magnet sinks, and a plate does not pull. A polynomial through few samples
may do otherwise between them, so n and d are of the highest orders with which, on the lines between the samples and
rest, dn/dw < 0, dd/dr > 0 and neither is negative; how far they then are from the samples is in `Mechanics.errors`.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.inverse.forward_model import polynomial
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Response

Sample = tuple[Load, Response]
Powers = list[tuple[int, int]]

ORDERS = (2, 6)
"""Highest powers of U and of w or r, where there are samples enough."""

EXACT = 1e-20
"""Sum of squares of a fit's errors, over that of the values, that counts as rounding."""
SHARES = (0.25, 0.5, 0.75)
"""Of the way between two samples, where a fit is looked at."""
MOST_ENDS = 60
"""Samples between which lines are drawn; there are some thousand of these."""

ZERO_FORCE = 1e-9
"""Force that counts as rounding, N."""
ZERO_DEPTH = 1e-9
"""Depth that counts as rounding, mm: the plate does not touch."""


@dataclass(frozen=True, slots=True, eq=False)
class Mechanics:
    """Polynomials c[i, j] of U^i w^j, or of U^i r^j.

    Attributes
    ----------
    tau, lateral, normal, depth, shear : rad/mm, N/mm, N, mm and 1.
    reach, sink : greatest lateral shift and greatest sinking of the samples, mm.
    errors : worst error of tilt (rad), lateral force and normal force (N), depth and shear (mm) at the samples.
    """

    tau: Array
    lateral: Array
    normal: Array
    depth: Array
    shear: Array
    reach: float
    sink: float
    errors: tuple[float, float, float, float, float]


def of_formula(
    solve: Callable[[Load], Response], depth: float, shear: float, counts: tuple[int, int] = (12, 4)
) -> Mechanics:
    """From a model that answers at once, sampled up to a depth and a shear, mm; loads that it refuses are left out.

    >>> from analytic.beam import solve
    >>> from geometry.design import paper
    >>> found = of_formula(lambda load: solve(paper(), load), 3.0, 3.0)
    >>> round(found.sink, 3), max(found.errors) < 1e-10
    (1.667, True)
    """
    # denser towards first touch, where everything bends most
    depths = depth * np.linspace(0, 1, counts[0] + 1) ** 1.5
    loads = [
        Load(depth=float(d), shear_x=shear * k / counts[1], friction="stick")
        for d in depths
        for k in range(counts[1] + 1)
    ]
    samples = []
    for load in loads:
        with contextlib.suppress(BadInput):
            samples.append((load, solve(load)))
    return of_samples(samples)


def of_samples(samples: Iterable[Sample]) -> Mechanics:
    """From responses to loads, by formulas, finite elements or a test bench; the rest state is added.

    Raises
    ------
    BadInput
        There are no samples with shear or none with a press, or a lateral motion is not along the shear.
    """
    rows = np.array([_row(load, response) for load, response in samples]).reshape(-1, 7)
    u, w, tilt, f_t, f_n, depth, shear = rows.T
    moved = u > 1e-9 * np.abs(rows[:, :2]).max(initial=0.0)
    if not moved.any() or not (w < 0).any():
        raise BadInput("the states must contain both presses and shears: add the missing ones")
    U, r = u * u, np.cbrt(-w)
    steps = len(set(np.round(depth, 9)) - {0.0})
    # half as many powers as depths: a polynomial through all of them swings in between
    high = min(ORDERS[1], 1 + steps // 2)
    shears = len(set(np.round(shear, 9)) - {0.0})
    wide = min(ORDERS[0], shears - 1)
    m, rest = moved, np.zeros(1)
    tau = _fit(U[m], w[m], tilt[m] / u[m], (wide, max(high - 1, 0)))
    lateral = _fit(U[m], w[m], f_t[m] / u[m], (wide, max(high - 1, 0)))
    U_between, w_between = _between(u, w)
    normal = _rising(
        (np.append(U, rest), np.append(w, rest)), np.append(f_n, rest), (wide, high), (U_between, w_between), -1
    )
    deep = _rising((U, r), depth, (wide, max(high, 3)), (U_between, np.cbrt(-w_between)), 1)
    sheared = _fit(U[m], r[m], shear[m] / u[m], (wide, max(high - 1, 0)))
    errors = (
        _worst(u * polynomial(tau, U, w)[0], tilt),
        _worst(u * polynomial(lateral, U, w)[0], f_t),
        _worst(polynomial(normal, U, w)[0], f_n),
        _worst(polynomial(deep, U, r)[0], depth),
        _worst(u * polynomial(sheared, U, r)[0], shear * m),
    )
    return Mechanics(tau, lateral, normal, deep, sheared, float(u.max()), float(-w.min()), errors)


def forces(mechanics: Mechanics, shift: Array) -> tuple[Array, Array]:
    """Force on the tip (F_x, F_y, F_n), shape (3, n), N, and its slopes dF_i/ds_j at [j, i, n], N/mm."""
    x, y, w = shift
    U = x * x + y * y
    k, k_u, k_w = polynomial(mechanics.lateral, U, w)
    n, n_u, n_w = polynomial(mechanics.normal, U, w)
    slopes = np.stack(
        [
            np.stack([k + 2 * x * x * k_u, 2 * x * y * k_u, 2 * x * n_u]),
            np.stack([2 * x * y * k_u, k + 2 * y * y * k_u, 2 * y * n_u]),
            np.stack([x * k_w, y * k_w, n_w]),
        ]
    )
    return np.stack([x * k, y * k, n]), slopes


def normal_force(mechanics: Mechanics, w: Array, normal: Array) -> Array:
    """The normal force, shape (n,), N, at vertical shifts (n,), mm, of a plate that presses or does not touch.

    0 above rest and where it is negative by no more than the fit's own error; NaN where the plate would have to pull:
    there the polynomials are far from all samples.
    """
    pulls = (w < 0) & (normal < -(mechanics.errors[2] + ZERO_FORCE))
    return np.asarray(np.where(pulls, np.nan, np.maximum(normal, 0.0)))


def load(mechanics: Mechanics, shift: Array) -> Array:
    """Depth and shear of the plate (depth, shear_x, shear_y) that moves the magnet so, shape (3, n), mm.

    Above the rest position the depth is 0.
    """
    x, y, w = shift
    U, r = x * x + y * y, np.cbrt(np.maximum(-w, 0.0))
    ratio = polynomial(mechanics.shear, U, r)[0]
    return np.stack([np.maximum(polynomial(mechanics.depth, U, r)[0], 0.0), x * ratio, y * ratio])


def force_and_load(mechanics: Mechanics, shift: Array) -> tuple[Array, Array, Array]:
    """Force on the tip, N, and load (depth, shear_x, shear_y), mm, at shifts (3, n), mm; and the force's slopes.

    A plate that does not touch carries nothing: where the depth is 0 and no press sinks the magnet, force and load
    are 0, whatever the polynomials of the sideways force say. Where the plate would have to pull, both are NaN.

    Returns
    -------
    force, load : shape (3, n).
    slopes : as in `forces`.
    """
    force, slopes = forces(mechanics, shift)
    moved = load(mechanics, shift)
    pressed = (shift[2] < 0) & (force[2] > mechanics.errors[2] + ZERO_FORCE)
    force[2] = normal_force(mechanics, shift[2], force[2])
    pulled = np.isnan(force[2])
    free = ~pulled & ~pressed & (moved[0] <= ZERO_DEPTH)
    for values in (force, moved):
        values[:, pulled] = np.nan
        values[:, free] = 0.0
    return force, moved, slopes


def workspace(design: Design, mechanics: Mechanics | None = None) -> tuple[Array, Array]:
    """Box of the magnet's shifts to decode in, low and high, shape (3,), mm.

    Sideways by 3/8 D and down by 3/8 D (3 mm for the paper's sensor, as its table has it), as far as the magnet stays
    above the base and the mechanics have samples; and up by D/80, so that noise at rest stays inside.
    """
    side = 3 / 8 * design.D
    sink = min(side, design.H - design.magnet_height / 2)
    if mechanics is not None:
        side, sink = min(side, mechanics.reach), min(sink, mechanics.sink)
    return np.array([-side, -side, -sink]), np.array([side, side, design.D / 80])


def _row(load: Load, response: Response) -> list[float]:
    """u, w, tilt, lateral and normal force, depth and shear, lateral values along the shear."""
    amount = load.shear
    e = (load.shear_x / amount, load.shear_y / amount) if amount else (1.0, 0.0)
    shift, force = response.shift, response.force

    def along(x: float, y: float) -> float:
        return x * e[0] + y * e[1]

    aside = abs(shift[0] * e[1] - shift[1] * e[0])
    if load.plate_tilt or not aside <= 1e-3 * (math.hypot(*shift) or 1.0):
        raise BadInput(
            "every state must have an upright plate, and a magnet that moves along the shear: leave other states out"
        )
    u = along(shift[0], shift[1]) if amount else 0.0
    tilt = along(response.tilt, response.tilt_y) if amount else 0.0
    lateral = along(force[0], force[1]) if amount else 0.0
    return [u, shift[2], tilt, lateral, force[2], load.depth, amount]


def _between(u: Array, w: Array) -> tuple[Array, Array]:
    """U and w on the lines between the samples and the rest state, shape (n,), as far as these sink."""
    points = np.unique(np.column_stack([np.append(u, 0.0), np.append(w, 0.0)]), axis=0)
    points = points[np.unique(np.linspace(0, len(points) - 1, MOST_ENDS).astype(int))]
    first, second = (points[ends] for ends in np.triu_indices(len(points), 1))
    places = np.concatenate([second, *(first + share * (second - first) for share in SHARES)])
    aside, sunk = places[places[:, 1] < 0].T
    return aside * aside, sunk


def _rising(
    places: tuple[Array, Array], values: Array, orders: tuple[int, int], between: tuple[Array, Array], sign: int
) -> Array:
    """The closest fit without a constant that is positive between the samples and rises there with sign times w (r).

    Besides the highest orders all lower ones are tried, and those whose mixed terms U^i w^j end at a lower j: shears
    at one depth alone say nothing of the others. If none will do, as for samples that fall, it is the lowest of all.
    """
    found, least = _solved(*places, values, [(0, 1)]), math.inf
    # of fits that differ by rounding the first is taken
    exact = float((EXACT * values**2).sum())
    for powers in _choices(*orders):
        if len(powers) <= len(values):
            c = _solved(*places, values, powers)
            misfit = max(float(((polynomial(c, *places)[0] - values) ** 2).sum()), exact)
            p, _, slope = polynomial(c, *between)
            if misfit < least and (p > 0).all() and (sign * slope > 0).all():
                found, least = c, misfit
    return found


def _choices(wide: int, high: int) -> list[Powers]:
    """Sets of powers (i, j) of U and w up to some orders, the largest first."""
    sets = {
        tuple((i, j) for i in range(a + 1) for j in range(b + 1) if (i, j) != (0, 0) and (i == 0 or j <= mixed))
        for a in range(wide + 1)
        for b in range(1, high + 1)
        for mixed in range(b + 1)
    }
    return sorted((list(powers) for powers in sets), key=lambda powers: (len(powers), powers), reverse=True)


def _fit(u: Array, w: Array, values: Array, orders: tuple[int, int]) -> Array:
    """Least squares, with fewer powers where there are not enough samples."""
    wide, high = orders
    while (wide + 1) * (high + 1) > len(values) and (wide or high):
        wide, high = (wide - 1, high) if wide else (wide, high - 1)
    return _solved(u, w, values, [(i, j) for i in range(wide + 1) for j in range(high + 1)])


def _solved(u: Array, w: Array, values: Array, powers: Powers) -> Array:
    """Least squares with some powers."""
    scale_u, scale_w = (float(np.abs(v).max(initial=0.0)) or 1.0 for v in (u, w))
    columns = np.column_stack([(u / scale_u) ** i * (w / scale_w) ** j for i, j in powers])
    found = np.linalg.lstsq(columns, values, rcond=1e-12)[0]
    c = np.zeros(np.max(powers, axis=0) + 1)
    for (i, j), value in zip(powers, found, strict=True):
        c[i, j] = value / (scale_u**i * scale_w**j)
    return c


def _worst(found: Sequence[float] | Array, true: Sequence[float] | Array) -> float:
    return float(np.abs(np.asarray(found) - np.asarray(true)).max(initial=0.0))
