"""How well a layout of Hall elements tells the magnet's poses apart, over the workspace. Lengths in mm, B in T.

At each pose of a grid: the condition number and the sign of det J, J = dB/ds (of the three directions in which the
readings vary most, where there are more than three); how many poses in the workspace read alike, and how far the
farthest of them is; the noise of the decoded pose and force, as the standard deviation along the worst direction
(root of the largest eigenvalue of the covariance); whether an element is saturated, and whether the magnet or the
beam's estimated wall runs into an element or the base.

Where det J changes its sign between neighbours, a fold runs through the workspace: on it condition number and noise
are infinite, and poses on its two sides read alike. No fold does not mean that poses are unique.

A tilt that follows from mechanics is known only as far as these were sampled: poses farther aside, above rest, or of
a negative depth are not `known`. Shares are by the trapezoidal rule over the known poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic import decode, hall
from analytic.clearance import lowest, magnet_gaps, wall_gaps
from analytic.decode import Decoder
from analytic.inverse import forward_model, observability, response_surface
from analytic.inverse.polynomials import polynomial
from geometry.arrays import Array
from geometry.design import BadInput

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """One entry for each pose of a grid, x outermost.

    Attributes
    ----------
    counts : of the grid along x, y and z.
    shift : shape (3, n), mm; tilt : rotation vector, shape (2, n), rad.
    readings : B.n of each element, shape (k, n), T.
    weight : of the poses in a share, shape (n,); 0 where not known, their sum 1.
    saturated : shape (n,); by_element the same of each element, shape (k, n).
    magnet_hits, wall_hits : of each element, shape (k, n).
    grounded : the magnet would reach below the base plane.
    sign : of det J, -1, 0 or 1.
    condition, noise_mm, noise_N : shape (n,); the noise is NaN without noise, noise_N without mechanics.
    multiplicity : number of poses that read alike, itself counted; 0 where it was not looked for.
    alike_mm : distance to the farthest of them.
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
    multiplicity: NDArray[np.int64]
    alike_mm: Array

    @property
    def blocked(self) -> Bools:
        """Something stands in the way of this pose."""
        return np.asarray(self.grounded | self.magnet_hits.any(axis=0) | self.wall_hits.any(axis=0))

    @property
    def usable(self) -> Bools:
        """Known, free and not saturated."""
        return np.asarray((self.weight > 0) & ~self.blocked & ~self.saturated)

    def share(self, flags: Bools) -> float:
        """Of the workspace, 0 to 1."""
        return float(self.weight[flags].sum())

    @property
    def folded(self) -> bool:
        """Whether det J changes its sign between neighbouring poses that are usable."""
        return _changes(self.sign.reshape(self.counts), self.usable.reshape(self.counts))


def survey(
    coder: Decoder, counts: tuple[int, int, int], *, multiplicity: bool = True, clearance: float = 0.0
) -> Survey:
    """Survey the decoder's workspace on a grid of so many poses along x, y and z, its faces included.

    Parameters
    ----------
    multiplicity : whether to look for other poses, which takes most of the time.
    clearance : least distance of an element's plate from the magnet and from the wall, mm.
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
    """Survey poses (3, n), mm, in the order of a grid of so many along x, y and z, with weights (n,).

    Raises
    ------
    BadInput
        None of the poses is known.
    """
    ahead = coder.forward
    values, slopes = forward_model.readings_with_slopes(ahead, shift)
    tilt = forward_model.rotation(ahead.tau, shift)
    weight = np.where(known(coder, shift), weight, 0.0)
    if not weight.sum() > 0:
        raise BadInput("the tilt is not known at any pose in the workspace: give states over more depths and shears")
    by_element = np.array(
        [hall.at_rail([e], b[None]) for e, b in zip(ahead.elements, values, strict=True)], dtype=np.bool_
    )
    saturated = by_element.any(axis=0)
    magnet_hits, wall_hits, grounded = hits(coder, shift, tilt, clearance)
    noise_mm, noise_N = _noise(coder, shift, slopes)
    many, far = np.zeros(shift.shape[1], dtype=np.int64), np.zeros(shift.shape[1])
    if multiplicity:
        asked = np.flatnonzero((weight > 0) & ~saturated)
        many[asked], far[asked] = alike(coder, shift[:, asked], values[:, asked])
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
        sign=determinant_sign(coder, slopes),
        condition=observability.condition(slopes),
        noise_mm=noise_mm,
        noise_N=noise_N,
        multiplicity=many,
        alike_mm=far,
    )


def known(coder: Decoder, shift: Array) -> Bools:
    """Whether the mechanics know the tilt there, shape (n,), of shifts (3, n), mm; everywhere if there is no tilt."""
    law = coder.mechanics
    if law is None or not coder.forward.tau.any():
        return np.ones(shift.shape[1], dtype=np.bool_)
    x, y, w = shift
    aside = x * x + y * y
    r = np.cbrt(np.maximum(-w, 0.0))
    depth = polynomial(law.depth, aside, r)[0]
    rest = (aside == 0) & (w == 0)
    return np.asarray(rest | ((w < 0) & (depth >= 0) & (aside <= (law.reach * (1 + 1e-9)) ** 2)))


def alike(coder: Decoder, shift: Array, readings: Array) -> tuple[NDArray[np.int64], Array]:
    """How many poses in the workspace give a pose's readings, and the distance to the farthest of them, mm.

    A pose that the decoder loses, right beside a fold, is counted all the same.

    Parameters
    ----------
    shift, readings : shape (3, n), mm, and (k, n), T; none at a rail.
    """
    found = decode.decode(coder, readings.T)
    way = np.linalg.norm(found.poses - shift.T[found.owner], axis=1)
    far, near = np.zeros(shift.shape[1]), np.full(shift.shape[1], np.inf)
    np.maximum.at(far, found.owner, way)
    np.minimum.at(near, found.owner, way)
    return found.multiplicity + (near > decode.SAME), far


def hits(coder: Decoder, shift: Array, tilt: Array, room: float = 0.0) -> tuple[Bools, Bools, Bools]:
    """Whether the magnet, and the beam's wall, meet each element, shape (k, n); whether the magnet meets the base.

    `room` is left around the elements' plates, mm; the wall may lean over an element that lies so deep in the base.
    """
    design = coder.forward.design
    places, turns = np.ascontiguousarray(shift.T), np.ascontiguousarray(tilt.T)
    magnet, wall = [], []
    for element in coder.forward.elements:
        gap = magnet_gaps(design, element.position, places, turns)
        magnet.append((gap < element.plate / 2 + room) | (gap == 0))
        aside, deep = wall_gaps(design, element.position, places), -element.position[2]
        # the wall may lean over an element in the base
        wall.append(aside < room if deep <= 0 else np.hypot(np.maximum(aside, 0.0), deep) < room)
    # the lowest pose of the workspace may touch the base but for rounding
    grounded = lowest(design, turns) + design.H + shift[2] < -1e-9 * design.H
    return np.array(magnet), np.array(wall), np.asarray(grounded)


def determinant_sign(coder: Decoder, slopes: Array) -> NDArray[np.int8]:
    """Sign of det J of slopes (3, k, n), shape (n,)."""
    det = np.linalg.det(np.einsum("ik,jkn->nij", coder.table.basis, slopes))
    return np.asarray(np.sign(det), dtype=np.int8)


def _noise(coder: Decoder, shift: Array, slopes: Array) -> tuple[Array, Array]:
    """Standard deviations of shift, mm, and force, N, along their worst directions."""
    spread = observability.spread(coder.sigma, slopes)
    lengths = _largest(spread)
    if coder.mechanics is None:
        return lengths, np.full_like(lengths, np.nan)
    force = response_surface.forces(coder.mechanics, shift)[1]
    return lengths, _largest(np.einsum("jin,jkn->ikn", force, spread))


def _largest(spread: Array) -> Array:
    """Largest singular values of (3, k, n), shape (n,); infinite on a fold, NaN without noise."""
    rows = np.moveaxis(spread, 2, 0)
    if np.isnan(rows).all():
        return np.full(len(rows), np.nan)
    broken: Bools = np.logical_not(np.isfinite(rows).all(axis=(1, 2)))
    values = np.linalg.svd(np.where(broken[:, None, None], 0.0, rows), compute_uv=False)[:, 0]
    return np.asarray(np.where(broken, np.inf, values))


def _weights(counts: tuple[int, int, int]) -> Array:
    """Of the trapezoidal rule."""
    rules = []
    for n in counts:
        rule = np.ones(n)
        rule[[0, -1]] = 0.5
        rules.append(rule / rule.sum())
    return np.asarray(np.einsum("i,j,k->ijk", *rules).ravel())


def _changes(sign: NDArray[np.int8], usable: Bools) -> bool:
    """Whether neighbours on a grid, both usable, differ."""
    for axis in range(3):
        a, b = (np.moveaxis(v, axis, 0) for v in (sign, usable))
        if ((a[1:] != a[:-1]) & b[1:] & b[:-1]).any():
            return True
    return False
