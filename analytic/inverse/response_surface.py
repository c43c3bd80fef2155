"""Mechanics for the decoder: tilt, force and load as polynomials of the magnet's shift, fitted to any model.

The silicone between base and magnet acts as a spring, so the forces are smooth functions of the magnet's pose,
however the load acts on the tip. Let u be the lateral shift, w the vertical shift (negative when the magnet sinks)
and U = u^2. The sensor is a body of revolution, so all lateral quantities point along the lateral shift. Least
squares over samples Load -> Response give

    tilt = u tau(U, w),  F_t = u k(U, w),  F_n = n(U, w),  depth = r d(U, r),  shear = u g(U, r),  r = (-w)^(1/3),

with polynomials tau, k, n, d and g. Near first touch the depth grows as (-w)^(2/3), hence r. Units mm, N, rad.

The normal force and the depth grow as the magnet sinks, and a plate cannot pull. A polynomial through few samples can
violate both between them. So n and d are the closest fits for which dn/dw < 0, dd/dr > 0, n > 0 and d > 0 hold on the
lines between all samples and rest; `Mechanics.errors` gives their distance from the samples.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.inverse.polynomials import least_squares, monotonic_fit, polynomial
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Response

Sample = tuple[Load, Response]

ORDERS = (2, 6)
"""Highest powers of U and of w or r, if there are enough samples."""

SHARES = (0.25, 0.5, 0.75)
"""Fractions of the line between two samples at which the signs of a fit and of its slope are checked."""
MOST_ENDS = 60
"""Largest number of samples whose connecting lines are checked: 60 samples give 1770 lines, more cost time."""

ZERO_FORCE = 1e-9
"""Normal force up to which the plate exerts none, N: rounding."""
ZERO_DEPTH = 1e-9
"""Depth up to which the plate does not touch, mm: rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Mechanics:
    """Tilt, force and load as polynomials of the magnet's shift, with their range and their errors.

    Attributes
    ----------
    tau, lateral, normal : coefficients c[i, j] of U^i w^j in tau (rad/mm), k (N/mm) and n (N).
    depth, shear : coefficients c[i, j] of U^i r^j in the depth r d (mm; c[0, 0] = 0) and in g (1).
    reach, sink : largest lateral shift and largest sinking of the samples, mm.
    errors : largest error at the samples of tilt (rad), lateral force, normal force (N), depth and shear (mm).
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
    """Fit the mechanics to a model that answers within milliseconds; loads that the model refuses are left out.

    Parameters
    ----------
    solve : response of the model to a load.
    depth, shear : largest depth and shear of the samples, mm.
    counts : number of intervals of depth and of shear.

    Examples
    --------

    >>> from analytic.beam import solve
    >>> from geometry.design import paper
    >>> mechanics = of_formula(lambda load: solve(paper(), load), 3.0, 3.0)
    >>> round(mechanics.sink, 3), max(mechanics.errors) < 1e-10
    (1.667, True)
    """
    # denser towards first touch, where the curves bend most
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
    """Fit the mechanics to samples (load, response) from formulas, finite elements or a test bench, and to rest.

    Raises
    ------
    BadInput
        The samples contain no shear or no press, shears of unlike friction, a grip, a tilted plate, or a magnet that
        does not move along the shear.
    """
    samples = list(samples)
    contacts = sorted({str(load.friction) for load, _ in samples if load.shear})
    if len(contacts) > 1:
        raise BadInput(f"the shears must all have one friction; got {' and '.join(contacts)}: leave the others out")
    rows = np.array([_row(load, response) for load, response in samples]).reshape(-1, 7)
    u, w, tilt, f_t, f_n, depth, shear = rows.T
    moved = u > 1e-9 * np.abs(rows[:, :2]).max(initial=0.0)
    if not moved.any() or not (w < 0).any():
        raise BadInput("the states must contain both presses and shears: add the missing ones")
    U, r = u * u, np.cbrt(-w)
    steps = len(set(np.round(depth, 9)) - {0.0})
    # half as many powers as depths: a polynomial through all samples would oscillate between them
    high = min(ORDERS[1], 1 + steps // 2)
    shears = len(set(np.round(shear, 9)) - {0.0})
    wide = min(ORDERS[0], shears - 1)
    # tilt, lateral force and shear are 0 at u = 0 for any coefficients, so only sheared samples determine them
    m, rest = moved, np.zeros(1)
    tau = least_squares(U[m], w[m], tilt[m] / u[m], (wide, max(high - 1, 0)))
    lateral = least_squares(U[m], w[m], f_t[m] / u[m], (wide, max(high - 1, 0)))
    U_between, w_between = _between(u, w)
    normal = monotonic_fit(
        (np.append(U, rest), np.append(w, rest)), np.append(f_n, rest), (wide, high), (U_between, w_between), -1
    )
    deep = monotonic_fit((U, r), depth, (wide, max(high, 3)), (U_between, np.cbrt(-w_between)), 1)
    sheared = least_squares(U[m], r[m], shear[m] / u[m], (wide, max(high - 1, 0)))
    errors = (
        _worst(u * polynomial(tau, U, w)[0], tilt),
        _worst(u * polynomial(lateral, U, w)[0], f_t),
        _worst(polynomial(normal, U, w)[0], f_n),
        _worst(polynomial(deep, U, r)[0], depth),
        _worst(u * polynomial(sheared, U, r)[0], shear * m),
    )
    return Mechanics(tau, lateral, normal, deep, sheared, float(u.max()), float(-w.min()), errors)


def forces(mechanics: Mechanics, shift: Array) -> tuple[Array, Array]:
    """Return the polynomials' force on the tip and its slopes at shifts (3, n), mm.

    Returns
    -------
    force : (F_x, F_y, F_n), shape (3, n), N.
    slopes : dF_i/ds_j at [j, i, n], shape (3, 3, n), N/mm.
    """
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
    """Return the normal force of a plate that cannot pull, shape (n,), N.

    A negative force becomes 0 above rest and where the fit's error explains it. It becomes NaN where the plate would
    have to pull: there the polynomials are far from all samples.

    Parameters
    ----------
    w : vertical shift of the magnet, shape (n,), mm.
    normal : normal force by the polynomial, shape (n,), N.
    """
    pulls = (w < 0) & (normal < -(mechanics.errors[2] + ZERO_FORCE))
    return np.asarray(np.where(pulls, np.nan, np.maximum(normal, 0.0)))


def load(mechanics: Mechanics, shift: Array) -> Array:
    """Return the load (depth, shear_x, shear_y), shape (3, n), mm, that shifts the magnet by `shift`, (3, n), mm.

    The depth is 0 where the magnet is above its position at rest.
    """
    x, y, w = shift
    U, r = x * x + y * y, np.cbrt(np.maximum(-w, 0.0))
    ratio = polynomial(mechanics.shear, U, r)[0]
    return np.stack([np.maximum(polynomial(mechanics.depth, U, r)[0], 0.0), x * ratio, y * ratio])


def force_and_load(mechanics: Mechanics, shift: Array) -> tuple[Array, Array, Array]:
    """Return force on the tip and load at shifts (3, n), mm, of a plate that cannot pull, and the force's slopes.

    A plate that does not touch exerts no force: where the depth is 0 and no normal force presses the magnet down,
    force and load are 0, whatever the polynomial of the lateral force gives. Where the plate would have to pull, both
    are NaN.

    Returns
    -------
    force, load : (F_x, F_y, F_n), N, and (depth, shear_x, shear_y), mm, shape (3, n).
    slopes : as in `forces`.
    """
    force, slopes = forces(mechanics, shift)
    plate = load(mechanics, shift)
    pressed = (shift[2] < 0) & (force[2] > mechanics.errors[2] + ZERO_FORCE)
    force[2] = normal_force(mechanics, shift[2], force[2])
    pulled = np.isnan(force[2])
    free = ~pulled & ~pressed & (plate[0] <= ZERO_DEPTH)
    for values in (force, plate):
        values[:, pulled] = np.nan
        values[:, free] = 0.0
    return force, plate, slopes


def workspace(design: Design, mechanics: Mechanics | None = None) -> tuple[Array, Array]:
    """Return the workspace, the box of shifts that the decoder searches: low and high, shape (3,), mm.

    It extends by 3/8 D sideways and down, which gives the 3 mm of the look-up table for the paper's sensor. It is
    limited to shifts that keep the magnet above the base and lie within the samples of the mechanics. Upwards it
    extends by D/80, so that noise at rest stays inside.
    """
    side = 3 / 8 * design.D
    sink = min(side, design.H - design.magnet_height / 2)
    if mechanics is not None:
        side, sink = min(side, mechanics.reach), min(sink, mechanics.sink)
    return np.array([-side, -side, -sink]), np.array([side, side, design.D / 80])


def _row(load: Load, response: Response) -> list[float]:
    """Return u, w, tilt, lateral force, normal force, depth and shear, with lateral values along the shear."""
    amount = load.shear
    e = (load.shear_x / amount, load.shear_y / amount) if amount else (1.0, 0.0)
    shift, force = response.shift, response.force

    def along(x: float, y: float) -> float:
        """Return the component along the shear."""
        return x * e[0] + y * e[1]

    aside = abs(shift[0] * e[1] - shift[1] * e[0])
    if load.grip is not None or load.plate_tilt or not aside <= 1e-3 * (math.hypot(*shift) or 1.0):
        raise BadInput(
            "every state must have an upright plate, no grip, and a magnet that moves along the shear: leave other "
            "states out"
        )
    u = along(shift[0], shift[1]) if amount else 0.0
    tilt = along(response.tilt, response.tilt_y) if amount else 0.0
    lateral = along(force[0], force[1]) if amount else 0.0
    return [u, shift[2], tilt, lateral, force[2], load.depth, amount]


def _between(u: Array, w: Array) -> tuple[Array, Array]:
    """Return U and w, shape (n,), at points below rest on the lines between all samples and rest."""
    points = np.unique(np.column_stack([np.append(u, 0.0), np.append(w, 0.0)]), axis=0)
    points = points[np.unique(np.linspace(0, len(points) - 1, MOST_ENDS).astype(int))]
    first, second = (points[ends] for ends in np.triu_indices(len(points), 1))
    places = np.concatenate([second, *(first + share * (second - first) for share in SHARES)])
    aside, sunk = places[places[:, 1] < 0].T
    return aside * aside, sunk


def _worst(fitted: Sequence[float] | Array, true: Sequence[float] | Array) -> float:
    """Return the largest error of a fit at the samples."""
    return float(np.abs(np.asarray(fitted) - np.asarray(true)).max(initial=0.0))
