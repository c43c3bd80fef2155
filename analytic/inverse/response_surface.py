"""Mechanics for the decoder: tilt, force and load as polynomials of the magnet's shift, fitted to any model.

The silicone between base and magnet acts as a spring, so the forces are smooth functions of the magnet's pose,
however the load acts on the tip. Let u be the lateral shift, w the vertical shift (negative when the magnet sinks)
and U = u^2. The sensor is a body of revolution, so all lateral quantities point along the lateral shift. Least
squares over states of any model give

    tilt = u tau(U, w),  F_t = u k(U, w),  F_n = n(U, w),  depth = r d(U, r),  shear = u g(U, r),  r = (-w)^(1/3),

with polynomials tau, k, n, d and g. Near first touch the depth grows as (-w)^(2/3), hence r. Units mm, N, rad.

The normal force and the depth grow as the magnet sinks, and a plate cannot pull. A polynomial through few samples can
violate both between them. So n and d are the closest fits for which dn/dw < 0, dd/dr > 0, n > 0 and d > 0 hold on the
lines between all samples and rest; `Mechanics.errors` gives their distance from the samples.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval2d
from numpy.typing import NDArray

from analytic.inverse.forward_model import Tilt, polynomial
from geometry.arrays import Array
from geometry.compiled import compiled
from geometry.design import BadInput, Design
from geometry.loads import Load, Response

Sample = tuple[Load, Response]
Powers = list[tuple[int, int]]

ORDERS = (2, 6)
"""Highest powers of U and of w or r, if there are enough samples."""


@dataclass(frozen=True, slots=True, eq=False)
class Mechanics:
    """Tilt, force and load as polynomials of the magnet's shift, with their range and their errors.

    Attributes
    ----------
    tau, lateral, normal : coefficients c[i, j] of U^i w^j in tau (rad/mm), k (N/mm) and n (N).
    depth, shear : coefficients c[i, j] of U^i r^j in the depth r d (mm; c[0, 0] = 0) and in g (1).
    reach, sink : largest lateral shift and largest sinking of the samples, mm.
    errors : largest error at the samples of tilt (rad), lateral force, normal force (N), depth and shear (mm).
    lean : least and largest tau of the samples, rad/mm, within which it is held elsewhere.
    slack : normal force, N, that counts as none beside the fit's error: what a calibration leaves unsure at rest.
    """

    tau: Array
    lateral: Array
    normal: Array
    depth: Array
    shear: Array
    reach: float
    sink: float
    errors: tuple[float, ...]
    lean: tuple[float, float] = (-math.inf, math.inf)
    slack: float = 0.0

    @property
    def tilt(self) -> Tilt:
        """Return tau for the forward model."""
        return self.tau, *self.lean


def loads_between(depth: float, shear: float) -> tuple[Array, Array]:
    """Return depths and shears of samples up to the largest ones, each of shape (65,), mm.

    >>> depths, shears = loads_between(3.0, 2.0)
    >>> depths[[0, -1]].tolist(), shears[:5].tolist()
    ([0.0, 3.0], [0.0, 0.5, 1.0, 1.5, 2.0])
    """
    # denser towards first touch, where the curves bend most
    grid = np.meshgrid(depth * np.linspace(0, 1, 13) ** 1.5, shear * np.arange(5) / 4, indexing="ij")
    return grid[0].ravel(), grid[1].ravel()


def of_samples(samples: Iterable[Sample]) -> Mechanics:
    """Fit the mechanics to samples (load, response), each with a shear in a direction of its own.

    Raises
    ------
    BadInput
        As `of_states`, or: the samples contain shears of unlike friction, a grip, a tilted plate, or a magnet that
        does not move along the shear.
    """
    samples = list(samples)
    contacts = sorted({str(load.friction) for load, _ in samples if load.shear})
    if len(contacts) > 1:
        raise BadInput(f"the shears must all have one friction; got {' and '.join(contacts)}: leave the others out")
    return of_states(*np.array([_row(load, response) for load, response in samples]).reshape(-1, 7).T)


def of_states(u: Array, w: Array, tilt: Array, f_t: Array, f_n: Array, depth: Array, shear: Array) -> Mechanics:
    """Fit the mechanics to n states in the plane of their shear, and to rest.

    Parameters
    ----------
    u, w : shifts of the magnet along the shear and upwards, mm.
    tilt, f_t, f_n : tilt towards the shear, rad; force along the shear and normal force, N.
    depth, shear : travels of the plate, mm.

    Raises
    ------
    BadInput
        The states contain no shear or no press.

    >>> from analytic.beam import solve
    >>> from geometry.design import paper
    >>> depth, shear = loads_between(3.0, 3.0)
    >>> loads = [Load(d, s, friction="stick") for d, s in zip(depth.tolist(), shear.tolist(), strict=True)]
    >>> mechanics = of_samples((load, solve(paper(), load)) for load in loads)
    >>> round(mechanics.sink, 3), max(mechanics.errors) < 1e-10
    (1.667, True)
    """
    moved = u > 1e-9 * np.abs([u, w]).max(initial=0.0)
    if not moved.any() or not (w < 0).any():
        raise BadInput("the states must contain both presses and shears: add the missing ones")
    U, r = u * u, np.cbrt(-w)
    # half as many powers as depths: a polynomial through all samples would oscillate between them
    high, high_sheared = (
        min(ORDERS[1], 1 + len(set(np.round(depth[some], 9)) - {0.0}) // 2) for some in (slice(None), moved)
    )
    wide = min(ORDERS[0], len(set(np.round(shear, 9)) - {0.0}) - 1)
    # tilt, lateral force and shear are 0 at u = 0 for any coefficients, so only sheared samples determine them
    tau, lateral, sheared = (
        _least_squares(U[moved], sunk[moved], values[moved] / u[moved], (wide, max(high_sheared - 1, 0)))
        for sunk, values in ((w, tilt), (w, f_t), (r, shear))
    )
    leans = polyval2d(U[moved], w[moved], tau)
    between, rest = _between(u, w), np.zeros(1)
    at_rest = np.append(U, rest), np.append(w, rest)
    normal = _monotonic_fit(at_rest, np.append(f_n, rest), (wide, high), between, -1)
    deep = _monotonic_fit((U, r), depth, (wide, max(high, 3)), (between[0], np.cbrt(-between[1])), 1)
    errors = (
        u * polyval2d(U, w, tau) - tilt,
        u * polyval2d(U, w, lateral) - f_t,
        polyval2d(U, w, normal) - f_n,
        polyval2d(U, r, deep) - depth,
        u * polyval2d(U, r, sheared) - shear * moved,
    )
    worst = tuple(float(np.abs(error).max(initial=0.0)) for error in errors)
    ends = float(u.max()), float(-w.min())
    return Mechanics(tau, lateral, normal, deep, sheared, *ends, worst, lean=(float(leans.min()), float(leans.max())))


def forces(mechanics: Mechanics, shift: Array) -> tuple[Array, Array]:
    """Return the polynomials' force on the tip and its slopes at shifts (3, n), mm, as `force_and_load` does."""
    force, _, slopes = force_and_load(mechanics, shift, contact=False)
    return force, slopes


def force_and_load(mechanics: Mechanics, shift: Array, *, contact: bool = True) -> tuple[Array, Array, Array]:
    """Return force on the tip and load at shifts (3, n), mm, of a plate that cannot pull, and the force's slopes.

    A negative normal force becomes 0 above rest and where the fit's error explains it. Where the plate would have to
    pull, force and load are NaN: there the polynomials are far from all samples. A plate that does not touch exerts
    no force: where the depth is 0 and no normal force presses the magnet down, force and load are 0, whatever the
    polynomial of the lateral force gives.

    contact : False for the polynomials as they are.

    Returns
    -------
    force, load : (F_x, F_y, F_n), N, and (depth, shear_x, shear_y), mm, shape (3, n). The depth is 0 where the magnet
        is above its position at rest.
    slopes : dF_i/ds_j of the polynomials at [j, i, n], shape (3, 3, n), N/mm.
    """
    n = shift.shape[1]
    force, plate, slopes = np.empty((3, n)), np.empty((3, n)), np.empty((3, 3, n))
    law = (mechanics.lateral, mechanics.normal, mechanics.depth, mechanics.shear)
    # rounding, a billionth of what the deepest sample has, counts as no force and as no depth
    deepest = abs(polynomial(mechanics.normal, 0.0, -mechanics.sink)[0])
    least = mechanics.errors[2] + mechanics.slack + 1e-9 * deepest, 1e-9 * mechanics.sink
    fill_loads(np.ascontiguousarray(shift), law, least, contact, force, plate, slopes)
    return force, plate, slopes


@compiled
def fill_loads(shift, law, least, contact, force, plate, slopes):
    """Fill what `force_and_load` returns; a normal force and a depth count from `least`, N and mm."""
    (lateral, normal, depth, shear), (least_force, least_depth) = law, least
    for p in range(shift.shape[1]):
        x, y, w = shift[0, p], shift[1, p], shift[2, p]
        U, r = x * x + y * y, np.cbrt(max(-w, 0.0))
        (k, k_u, k_w), (f, f_u, f_w) = polynomial(lateral, U, w), polynomial(normal, U, w)
        d, g = max(polynomial(depth, U, r)[0], 0.0), polynomial(shear, U, r)[0]
        force[0, p], force[1, p], force[2, p] = x * k, y * k, f
        plate[0, p], plate[1, p], plate[2, p] = d, x * g, y * g
        slopes[0, 0, p], slopes[0, 1, p], slopes[0, 2, p] = k + 2 * x * x * k_u, 2 * x * y * k_u, 2 * x * f_u
        slopes[1, 0, p], slopes[1, 1, p], slopes[1, 2, p] = 2 * x * y * k_u, k + 2 * y * y * k_u, 2 * y * f_u
        slopes[2, 0, p], slopes[2, 1, p], slopes[2, 2, p] = x * k_w, y * k_w, f_w
        if not contact:
            continue
        force[2, p] = max(f, 0.0)
        if w < 0 and f < -least_force:
            force[:, p], plate[:, p] = np.nan, np.nan
        elif (w >= 0 or f <= least_force) and d <= least_depth:
            force[:, p], plate[:, p] = 0.0, 0.0


def shifts_of_forces(
    mechanics: Mechanics, low: Array, high: Array, tangential: Array, normal: Array
) -> tuple[Array, Array]:
    """Return the lateral shift u >= 0 and the vertical shift w, each of shape (n,), mm; NaN where none is found.

    A force has the components F_t = u k(u^2, w) along the shift and F_n = n(u^2, w). Newton steps solve for (u, w),
    from the nearest point of a grid over the workspace. Only stable loads count, where a larger force in each
    direction shifts the magnet farther.

    Parameters
    ----------
    low, high : workspace, shape (3,), mm; shifts outside it do not count.
    tangential, normal : forces F_t >= 0 and F_n >= 0, shape (n,), N.
    """
    from scipy.spatial import cKDTree

    def at(u: Array, w: Array) -> tuple[Array, Array]:
        """Return (F_t, F_n), shape (2, n), and the slopes d(F_t, F_n)/d(u, w), shape (2, 2, n)."""
        force, slopes = forces(mechanics, np.stack([u, np.zeros_like(u), w]))
        # `forces` has the component in its second axis
        return force[[0, 2]], slopes[np.ix_([0, 2], [0, 2])].transpose(1, 0, 2)

    def stable(slopes: Array) -> NDArray[np.bool_]:
        """Return whether F_t grows with u at a fixed w, and F_n with -w at a fixed F_t."""
        (a, b), (c, d) = slopes
        return np.asarray((a > 0) & (a * d - b * c < 0))

    wanted = np.stack([tangential, normal])
    # so close that Newton's steps converge from neighbours
    axes = np.linspace(0, high[0], 41), np.linspace(low[2], 0, 41)
    u, w = (values.ravel() for values in np.meshgrid(*axes))
    force, slopes = at(u, w)
    starts = stable(slopes)
    if not starts.any():
        return np.full_like(tangential, np.nan), np.full_like(normal, np.nan)
    index = cKDTree(force[:, starts].T).query(wanted.T)[1]
    u, w = u[starts][index], w[starts][index]
    # no step may be longer than some cells of the grid of starts: a polynomial bends too much for more
    reach = np.array([high[0], -low[2]])[:, None] / 10
    # from a start of the grid about five steps suffice
    for _ in range(30):
        force, slopes = at(u, w)
        (a, b), (c, d), (t, n) = *slopes, force - wanted
        det = a * d - b * c
        step = np.stack([d * t - b * n, a * n - c * t]) / np.where(det != 0, det, 1.0)
        step /= np.maximum((np.abs(step) / reach).max(axis=0), 1.0)
        u, w = u - step[0], w - step[1]
    force, slopes = at(u, w)
    # a billionth of the largest force is far above rounding, and far below any noise
    scale = float(np.hypot(tangential, normal).max(initial=0.0)) or 1.0
    good: NDArray[np.bool_] = (np.abs(force - wanted) <= 1e-9 * scale).all(axis=0) & stable(slopes)
    edge = 1e-6 * reach[0]
    good &= (np.abs(u) <= high[0] + edge) & (w >= low[2] - edge) & (w <= high[2] + edge) & (u >= -edge)
    return np.where(good, np.maximum(u, 0.0), np.nan), np.where(good, w, np.nan)


def shifts_of_loads(mechanics: Mechanics, low: Array, high: Array, depth: Array, shear: Array) -> tuple[Array, Array]:
    """Return the lateral shift u >= 0 and the vertical shift w, each of shape (n,), mm; NaN where none is found.

    Where the magnet is at (u, w), depth and shear of the plate follow from u and r = (-w)^(1/3). Newton steps solve
    for (u, r), from the nearest point of a grid over the workspace. Under a plate that does not touch the magnet is
    at rest.

    Parameters
    ----------
    low, high : workspace, shape (3,), mm; shifts outside it do not count.
    depth, shear : travels of the plate >= 0, shape (n,), mm.
    """
    from scipy.spatial import cKDTree

    laws = mechanics.depth, mechanics.shear
    (d_U, d_r), (g_U, g_r) = ([polyder(law, axis=k) for k in (0, 1)] for law in laws)

    def at(u: Array, r: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return depth and shear (2, n), and their slopes by u and r, each (n,)."""
        U = u * u
        d, g, by_U, by_r, of_U, of_r = (np.asarray(polyval2d(U, r, c), float) for c in (*laws, d_U, d_r, g_U, g_r))
        return np.stack([d, u * g]), 2 * u * by_U, by_r, g + 2 * U * of_U, u * of_r

    wanted, ends = np.stack([depth, shear]), (float(high[0]), float(np.cbrt(-low[2])))
    u, r = (values.ravel() for values in np.meshgrid(*(np.linspace(0, end, 41) for end in ends)))
    nearest = cKDTree(at(u, r)[0].T).query(wanted.T)[1]
    u, r = u[nearest], r[nearest]
    for _ in range(30):
        reached, a, b, c, d = at(u, r)
        (p, q), det = reached - wanted, a * d - b * c
        step = np.stack([d * p - b * q, a * q - c * p]) / np.where(det != 0, det, 1.0)
        step /= np.maximum((10 * np.abs(step) / np.array(ends)[:, None]).max(axis=0), 1.0)
        u, r = u - step[0], r - step[1]
    edge = 1e-6 * ends[0]
    good = (np.abs(at(u, r)[0] - wanted) <= 1e-9 * ends[0]).all(axis=0) & (u >= -edge) & (u <= ends[0] + edge)
    good &= (r >= -edge) & (r <= ends[1] + edge)
    good, touches = good | (depth == 0), depth > 0
    u, w = np.where(touches, np.maximum(u, 0.0), 0.0), np.where(touches, -(np.maximum(r, 0.0) ** 3), 0.0)
    return np.where(good, u, np.nan), np.where(good, w, np.nan)


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
    e = np.array([load.shear_x, load.shear_y]) / load.shear if load.shear else np.zeros(2)
    shift, force = response.shift, response.force
    aside = abs(shift[0] * e[1] - shift[1] * e[0]) if load.shear else abs(shift[1])
    if load.grip is not None or load.plate_tilt or not aside <= 1e-3 * (math.hypot(*shift) or 1.0):
        raise BadInput(
            "every state must have an upright plate, no grip, and a magnet that moves along the shear: leave other "
            "states out"
        )
    u, tilt, lateral = (float(e @ values[:2]) for values in (shift, (response.tilt, response.tilt_y), force))
    return [u, shift[2], tilt, lateral, force[2], load.depth, load.shear]


def _between(u: Array, w: Array) -> tuple[Array, Array]:
    """Return U and w, shape (n,), at points below rest on the lines between all samples and rest."""
    points = np.unique(np.column_stack([np.append(u, 0.0), np.append(w, 0.0)]), axis=0)
    # the 1770 lines between 60 samples suffice
    points = points[np.unique(np.linspace(0, len(points) - 1, 60).astype(int))]
    first, second = (points[ends] for ends in np.triu_indices(len(points), 1))
    places = np.concatenate([second, *(first + share * (second - first) for share in (0.25, 0.5, 0.75))])
    aside, sunk = places[places[:, 1] < 0].T
    return aside * aside, sunk


def _least_squares(u: Array, w: Array, values: Array, orders: tuple[int, int]) -> Array:
    """Return the least-squares coefficients c[i, j]; with fewer samples than powers, the orders are reduced."""
    wide, high = orders
    while (wide + 1) * (high + 1) > len(values) and (wide or high):
        wide, high = (wide - 1, high) if wide else (wide, high - 1)
    return _coefficients(u, w, values, [(i, j) for i in range(wide + 1) for j in range(high + 1)])


def _monotonic_fit(
    places: tuple[Array, Array], values: Array, orders: tuple[int, int], between: tuple[Array, Array], sign: int
) -> Array:
    """Return the closest fit without a constant that is positive and monotonic between the samples.

    The fits tried include all lower orders, and those whose mixed terms u^i w^j end at a lower j, because samples at
    a single w do not determine them at others. If no fit qualifies, as for samples that decrease, the result
    has the linear term alone.

    Parameters
    ----------
    places, values : u and w of the samples, and the values to fit, each of shape (n,).
    orders : highest powers of u and w.
    between : u and w at which the fit and its slope are checked, each of shape (m,).
    sign : required sign of the slope along w, 1 or -1.
    """
    best, least = _coefficients(*places, values, [(0, 1)]), math.inf
    # of fits that differ by rounding only, the first and largest set of powers wins: the choice is reproducible
    exact = float((1e-20 * values**2).sum())
    for powers in _choices(*orders):
        if len(powers) <= len(values):
            c = _coefficients(*places, values, powers)
            misfit = max(float(((polyval2d(*places, c) - values) ** 2).sum()), exact)
            p, slope = polyval2d(*between, c), polyval2d(*between, polyder(c, axis=1))
            if misfit < least and (p > 0).all() and (sign * slope > 0).all():
                best, least = c, misfit
    return best


def _choices(wide: int, high: int) -> list[Powers]:
    """Return sets of powers (i, j) of u and w up to the orders `wide` and `high`, the largest set first."""
    sets = {
        tuple((i, j) for i in range(a + 1) for j in range(b + 1) if (i, j) != (0, 0) and (i == 0 or j <= mixed))
        for a in range(wide + 1)
        for b in range(1, high + 1)
        for mixed in range(b + 1)
    }
    return sorted((list(powers) for powers in sets), key=lambda powers: (len(powers), powers), reverse=True)


def _coefficients(u: Array, w: Array, values: Array, powers: Powers) -> Array:
    """Return the least-squares coefficients c[i, j] of the given powers (i, j); all others are 0."""
    # columns scaled to 1 keep the condition number low
    scale_u, scale_w = (float(np.abs(v).max(initial=0.0)) or 1.0 for v in (u, w))
    columns = np.column_stack([(u / scale_u) ** i * (w / scale_w) ** j for i, j in powers])
    coefficients = np.linalg.lstsq(columns, values, rcond=1e-12)[0]
    c = np.zeros(np.max(powers, axis=0) + 1)
    for (i, j), value in zip(powers, coefficients, strict=True):
        c[i, j] = value / (scale_u**i * scale_w**j)
    return c
