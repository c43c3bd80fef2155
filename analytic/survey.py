"""Quality of a layout of Hall elements over the workspace, pose by pose on a grid. Lengths in mm, B in T.

A survey computes at each pose:

- the condition number of J = dB/ds and the sign of det J (if there are more than three readings, of their three
  directions of largest variation), where an ambient field is rejected without what a uniform one explains;
- the number of poses in the workspace that have the same readings, and the distance to the farthest of them;
- the noise of the decoded pose and force: the standard deviation along the worst direction, which is the root of the
  largest eigenvalue of the covariance;
- whether an element is saturated, and whether the magnet or the beam's estimated wall meets an element or the base.

If det J has different signs at neighbouring poses, a fold lies between them: on it, condition number and noise are
infinite, and poses on its two sides have the same readings. A workspace without a fold can still hold ambiguous
poses.

With mechanics, the tilt is known only within their samples: poses farther aside, above rest or of a negative depth
are not `known`. The share of a set of poses in the workspace is their weight by the trapezoidal rule over the known
poses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic import decode, hall
from analytic.clearance import lowest_point, magnet_gaps, wall_gaps
from analytic.decode import Decoder
from analytic.force_resolution import force_resolution
from analytic.inverse import forward_model, pose_search, response_surface
from geometry.arrays import Array
from geometry.design import BadInput

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """Result at each of the n poses of a grid, with x as the slowest index; k elements.

    Attributes
    ----------
    counts : number of grid points along x, y and z.
    shift : shape (3, n), mm; tilt : rotation vector, shape (2, n), rad.
    readings : B.n of each element, shape (k, n), T.
    weight : weights of the poses in a share, shape (n,); 0 where not known, with sum 1.
    saturated : whether any element is saturated, shape (n,); by_element : the same for each element, shape (k, n).
    magnet_hits, wall_hits : whether the magnet, or the beam's wall, meets each element, shape (k, n).
    grounded : whether the magnet would reach below the base plane, shape (n,).
    sign : sign of det J, -1, 0 or 1, shape (n,).
    condition, noise_mm, noise_N : shape (n,); the noise is NaN without noise, noise_N without mechanics.
    axis_noise_N : standard deviations of F_x, F_y and F_n, shape (3, n); NaN without mechanics or if an element has
        no noise, infinite where the readings do not determine a component.
    multiplicity : number of poses with the same readings, this one included, shape (n,); 0 where not computed.
    alike_mm : distance to the farthest of them, shape (n,).
    """

    counts: tuple[int, int, int]
    shift: Array
    tilt: Array
    readings: Array
    weight: Array
    saturated: Bools
    by_element: Bools
    magnet_hits: Bools
    wall_hits: Bools
    grounded: Bools
    sign: NDArray[np.int8]
    condition: Array
    noise_mm: Array
    noise_N: Array
    axis_noise_N: Array
    multiplicity: NDArray[np.int64]
    alike_mm: Array

    @property
    def blocked(self) -> Bools:
        """Whether the magnet or the wall meets an element or the base, shape (n,)."""
        return np.asarray(self.grounded | self.magnet_hits.any(axis=0) | self.wall_hits.any(axis=0))

    @property
    def usable(self) -> Bools:
        """Whether a pose is known, not blocked and not saturated, shape (n,)."""
        return np.asarray((self.weight > 0) & ~self.blocked & ~self.saturated)

    def share(self, flags: Bools) -> float:
        """Return the share of the workspace that the flagged poses, shape (n,), have, 0 to 1."""
        return float(self.weight[flags].sum())

    @property
    def folded(self) -> bool:
        """Whether det J has different signs at neighbouring usable poses."""
        for axis in range(3):
            sign, usable = (np.moveaxis(v.reshape(self.counts), axis, 0) for v in (self.sign, self.usable))
            if ((sign[1:] != sign[:-1]) & usable[1:] & usable[:-1]).any():
                return True
        return False


def survey(
    coder: Decoder, counts: tuple[int, int, int], *, multiplicity: bool = True, clearance: float = 0.0
) -> Survey:
    """Survey the decoder's workspace on a grid that includes its faces.

    Parameters
    ----------
    counts : number of grid points along x, y and z.
    multiplicity : whether to search for other poses with the same readings, which takes most of the time.
    clearance : smallest distance of an element's plate from the magnet and from the wall, mm.
    """
    axes = [np.linspace(a, b, n) for a, b, n in zip(coder.low, coder.high, counts, strict=True)]
    shift = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    return at_poses(coder, shift, _weights(counts), counts, multiplicity=multiplicity, clearance=clearance)


def at_poses(
    coder: Decoder,
    shift: Array,
    weight: Array,
    counts: tuple[int, int, int],
    *,
    multiplicity: bool = True,
    clearance: float = 0.0,
) -> Survey:
    """Survey given poses.

    Parameters
    ----------
    shift : shape (3, n), mm, in the order of a grid with x as the slowest index.
    weight : weight of each pose in a share, shape (n,); need not have sum 1.
    counts, multiplicity, clearance : as in `survey`.

    Raises
    ------
    BadInput
        None of the poses is known.
    """
    forward = coder.forward
    values, slopes = forward_model.readings_with_slopes(forward, shift)
    tilt = forward_model.rotation(forward.tau, shift)
    weight = np.where(known(coder, shift), weight, 0.0)
    if not weight.sum() > 0:
        raise BadInput("the tilt is not known at any pose in the workspace: give states over more depths and shears")
    by_element = hall.at_rail(forward.elements, values)
    saturated = by_element.any(axis=0)
    magnet_hits, wall_hits, grounded = collisions(coder, shift, tilt, clearance)
    told = decode.told_slopes(coder, slopes)
    noise_mm, noise_N, axis_noise_N = _noise(coder, shift, told)
    count, far = np.zeros(shift.shape[1], dtype=np.int64), np.zeros(shift.shape[1])
    if multiplicity:
        decodable = np.flatnonzero((weight > 0) & ~saturated)
        count[decodable], far[decodable] = equal_readings(coder, shift[:, decodable], values[:, decodable])
    return Survey(
        counts=counts,
        shift=shift,
        tilt=tilt,
        readings=values,
        weight=weight / weight.sum(),
        saturated=np.asarray(saturated),
        by_element=by_element,
        magnet_hits=magnet_hits,
        wall_hits=wall_hits,
        grounded=grounded,
        sign=np.sign(np.linalg.det(np.einsum("ik,jkn->nij", coder.table.basis, slopes))).astype(np.int8),
        condition=decode.condition(told),
        noise_mm=noise_mm,
        noise_N=noise_N,
        axis_noise_N=axis_noise_N,
        multiplicity=count,
        alike_mm=far,
    )


def known(coder: Decoder, shift: Array) -> Bools:
    """Return whether shifts (3, n), mm, lie where the mechanics give the tilt, shape (n,); True without a tilt."""
    law = coder.mechanics
    if law is None or not coder.forward.tau[0].any():
        return np.ones(shift.shape[1], dtype=np.bool_)
    x, y, w = shift
    aside = x * x + y * y
    r = np.cbrt(np.maximum(-w, 0.0))
    depth = np.polynomial.polynomial.polyval2d(aside, r, law.depth)
    rest = (aside == 0) & (w == 0)
    return np.asarray(rest | ((w < 0) & (depth >= 0) & (aside <= (law.reach * (1 + 1e-9)) ** 2)))


def equal_readings(coder: Decoder, shift: Array, readings: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the number of poses with the readings of each given pose, and the distance to the farthest of them, mm.

    shift, readings : poses, shape (3, n), mm, and their readings, shape (k, n), T; none at a rail.
    """
    decoded = decode.decode(coder, readings.T)
    distance = np.linalg.norm(decoded.poses - shift.T[decoded.owner], axis=1)
    far, near = np.zeros(shift.shape[1]), np.full(shift.shape[1], np.inf)
    np.maximum.at(far, decoded.owner, distance)
    np.minimum.at(near, decoded.owner, distance)
    # right beside a fold the decoder can miss the given pose itself, which has these readings nevertheless
    return decoded.multiplicity + (near > pose_search.SAME * coder.forward.design.D), far


def collisions(coder: Decoder, shift: Array, tilt: Array, clearance: float = 0.0) -> tuple[Bools, Bools, Bools]:
    """Return where the magnet and the beam's wall meet the elements, and where the magnet meets the base.

    Parameters
    ----------
    shift, tilt : poses, shape (3, n), mm, and rotation vectors, shape (2, n), rad.
    clearance : smallest permitted distance of an element's plate from the magnet and from the wall, mm.

    Returns
    -------
    magnet, wall : for each element, shape (k, n).
    base : shape (n,).
    """
    design = coder.forward.design
    shifts, tilts = np.ascontiguousarray(shift.T), np.ascontiguousarray(tilt.T)
    magnet, wall = [], []
    for element in coder.forward.elements:
        gap = magnet_gaps(design, element.position, shifts, tilts)
        magnet.append((gap < element.plate / 2 + clearance) | (gap == 0))
        aside, deep = wall_gaps(design, element.position, shifts), -element.position[2]
        # an element inside the base lies `deep` below the wall, which may extend over it
        wall.append(aside < clearance if deep <= 0 else np.hypot(np.maximum(aside, 0.0), deep) < clearance)
    # at the lowest pose of the workspace the magnet may touch the base: rounding must not make that a collision
    grounded = lowest_point(design, tilts) + design.H + shift[2] < -1e-9 * design.H
    return np.array(magnet), np.array(wall), np.asarray(grounded)


def _noise(coder: Decoder, shift: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """Return the standard deviations of shift, mm, and force, N, along their worst directions, each of shape (n,).

    The third result is those of the force's components, shape (3, n), N.
    """
    spread = decode.spread(coder.sigma, slopes)
    noise_mm = _largest_singular_value(spread)
    if coder.mechanics is None:
        return noise_mm, np.full_like(noise_mm, np.nan), np.full_like(shift, np.nan)
    force_slopes = response_surface.forces(coder.mechanics, shift)[1]
    force_spread = np.einsum("jin,jkn->ikn", force_slopes, spread)
    axes = np.full_like(shift, np.nan)
    if (coder.sigma > 0).all():
        axes = force_resolution(slopes.transpose(2, 1, 0), force_slopes.transpose(2, 1, 0), coder.sigma).T
    return noise_mm, _largest_singular_value(force_spread), axes


def _largest_singular_value(spread: Array) -> Array:
    """Return the largest singular values of (3, k, n), shape (n,); infinite on a fold, NaN without noise."""
    rows = np.moveaxis(spread, 2, 0)
    if np.isnan(rows).all():
        return np.full(len(rows), np.nan)
    # on a fold A'A is singular, so the spread is not finite, and LAPACK would fail on it
    broken: Bools = np.logical_not(np.isfinite(rows).all(axis=(1, 2)))
    values = np.linalg.svd(np.where(broken[:, None, None], 0.0, rows), compute_uv=False)[:, 0]
    return np.asarray(np.where(broken, np.inf, values))


def _weights(counts: tuple[int, int, int]) -> Array:
    """Return the weights of the trapezoidal rule on a grid, shape (n,), with sum 1."""
    rules = []
    for n in counts:
        rule = np.ones(n)
        rule[[0, -1]] = 0.5
        rules.append(rule / rule.sum())
    return np.asarray(np.einsum("i,j,k->ijk", *rules).ravel())


def least_difference(coder: Decoder, surveyed: Survey, apart: float) -> float:
    """Return the smallest difference of readings between two poses that lie at least `apart` from each other.

    The difference is the 2-norm of the readings' differences, each over its noise. Sequential quadratic programming
    starts from the four best pairs of the survey's grid. It finds local minima, so the result is an upper bound.

    Parameters
    ----------
    surveyed : a survey of the decoder's workspace; only its known poses count.
    apart : smallest distance of the two poses, mm.
    """
    known = surveyed.weight > 0
    s, r = surveyed.shift[:, known].T, (surveyed.readings / coder.sigma[:, None])[:, known].T
    pairs: list[tuple[float, int, int]] = []
    for i in range(len(s) - 1):
        far = ((s[i + 1 :] - s[i]) ** 2).sum(axis=1) >= apart**2
        if far.any():
            square = np.where(far, ((r[i + 1 :] - r[i]) ** 2).sum(axis=1), np.inf)
            j = int(square.argmin())
            pairs.append((float(square[j]), i, i + 1 + j))
    best = [(s[i], s[j]) for _, i, j in sorted(pairs)[:4]]
    return min(_least_from(coder, first, second, apart) for first, second in best)


def _least_from(coder: Decoder, first: Array, second: Array, apart: float) -> float:
    """Minimise the difference from a pair of poses (3,), mm; return infinity if only unknown poses result."""
    from scipy.optimize import minimize

    def squared_difference(pair: Array) -> tuple[float, Array]:
        """Return the square of the difference of readings, and its gradient (6,), 1/mm."""
        values, slopes = forward_model.readings_with_slopes(coder.forward, np.ascontiguousarray(pair.reshape(2, 3).T))
        difference = (values[:, 0] - values[:, 1]) / coder.sigma
        rows = 2 * np.einsum("jkn,k->nj", slopes / coder.sigma[:, None], difference)
        return float((difference**2).sum()), np.concatenate([rows[0], -rows[1]])

    def constraint(pair: Array) -> float:
        """Return a value that is 0 or more for poses at least `apart` from each other."""
        return float(((pair[:3] - pair[3:]) ** 2).sum() / apart**2 - 1)

    def constraint_gradient(pair: Array) -> Array:
        direction = 2 * (pair[:3] - pair[3:]) / apart**2
        return np.concatenate([direction, -direction])

    def allowed(pair: Array) -> bool:
        return constraint(pair) >= -1e-6 and bool(known(coder, np.ascontiguousarray(pair.reshape(2, 3).T)).all())

    # a pair of the grid is farther apart than required; moved together to `apart`, its readings mostly differ less
    half = (second - first) * (apart / np.linalg.norm(second - first)) / 2
    centre = (first + second) / 2
    pairs = [np.concatenate([first, second]), np.concatenate([centre - half, centre + half])]
    start = min(pairs, key=lambda pair: squared_difference(pair)[0])
    # the solver's tolerance is absolute, so the objective is scaled to 1 at the start
    size = max(squared_difference(start)[0], 1e-300)
    optimum = minimize(
        lambda pair: tuple(v / size for v in squared_difference(pair)),
        start,
        jac=True,
        bounds=list(zip(np.tile(coder.low, 2), np.tile(coder.high, 2), strict=True)),
        constraints={"type": "ineq", "fun": constraint, "jac": constraint_gradient},
        method="SLSQP",
        options={"maxiter": 50},
    )
    # the solver may stop at a worse or forbidden pair, so both starting pairs compete with its result
    return min((float(np.sqrt(squared_difference(p)[0])) for p in (*pairs, optimum.x) if allowed(p)), default=np.inf)
