"""From readings back to the pose of the magnet and the load on the tip. Lengths in mm, B in T, forces in N.

The decoder finds all poses in the workspace that have the readings (`analytic.inverse.pose_search`). A table of the
workspace gives one start for each possible pose. From each start, damped Newton steps on the exact forward model lead
to a pose; equal poses count once. A converged iteration does not prove that the
pose is the right one: several poses can have the same readings. The decoder then returns all of them, with
status "ambiguous".

With A = dB/ds (k, 3), the pose's covariance is P C P' with P = (A'WA)^-1 A'W. C is the covariance of the readings:
the variance of each is that of `analytic.reading_noise`. The condition number is that of A in the 2-norm.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.hall import Mode, rails
from analytic.inverse import ambient_field, pose_search, response_surface
from analytic.inverse.forward_model import CENTRED, NO_TILT, Forward, Mount, model, readings_with_slopes, rotation
from analytic.inverse.pose_search import Goal, StartTable
from analytic.inverse.response_surface import Mechanics
from analytic.parts import Element
from geometry.arrays import Array
from geometry.design import BadInput, Design

Status = (
    pose_search.Status | Literal["tension", "uncalibrated", "frozen", "after_gap", "jump", "untimed", "out_of_range"]
)
"""`out_of_range` is that of a regression, which knows no pose."""
Limit = Literal["depth", "shear", "workspace"]
"""Limit that a pose exceeds: the depth or the shear of the mechanics' samples, or the workspace of the design."""

CELLS = (24, 24, 12)
"""Number of the table's cells along x, y and z: half as many along z, because the workspace is half as high."""


@dataclass(frozen=True, slots=True, eq=False)
class Decoder:
    """A forward model with its workspace, its table of starts and, for the loads, its mechanics.

    Attributes
    ----------
    low, high : corners of the workspace, shape (3,), mm.
    table, goal : starts of the search for poses, and what a pose must fit.
    sigma : standard deviation of each reading from noise and converter, shape (k,), T.
    field_fit : G of `analytic.inverse.ambient_field`, shape (3, k), where an ambient field is rejected, else None.
    """

    forward: Forward
    mechanics: Mechanics | None
    low: Array
    high: Array
    table: StartTable
    goal: Goal
    sigma: Array
    field_fit: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """One row for each row of readings; NaN where there is no pose.

    Attributes
    ----------
    status : one word for each row; README.md of this package says what each means.
    shift : shape (n, 3), mm.
    tilt : rotation vector (rx, ry), shape (n, 2), rad.
    force, load : (F_x, F_y, F_n), N, and (depth, shear_x, shear_y), mm, shape (n, 3); NaN without mechanics
        and where the plate would have to pull, 0 where it does not touch.
    condition : condition number of dB/ds, shape (n,).
    multiplicity : number of poses in the workspace that have the readings, shape (n,).
    noise_mm, noise_N : standard deviations of shift and force, shape (n, 3); NaN if no element has any noise.
    poses, owner : shifts of all poses, shape (m, 3), mm, and the row that each belongs to, shape (m,), ascending.
    """

    status: list[Status]
    shift: Array
    tilt: Array
    force: Array
    load: Array
    condition: Array
    multiplicity: NDArray[np.int64]
    noise_mm: Array
    noise_N: Array
    poses: Array
    owner: NDArray[np.int64]


def decoder(
    design: Design,
    law: Mechanics | None = None,
    *,
    ignore_tilt: bool = False,
    elements: Sequence[Element] | None = None,
    mode: Mode = "component",
    workspace: tuple[ArrayLike, ArrayLike] | None = None,
    cells: tuple[int, int, int] = CELLS,
    deviation: ArrayLike = 0.0,
    mount: Mount = CENTRED,
    reject_ambient: bool = False,
) -> Decoder:
    """Build a decoder, which takes some tenths of a second.

    Parameters
    ----------
    law : mechanics that give tilt, force and load from the shift; without it the magnet does not tilt, and there are
        no forces.
    ignore_tilt : set the tilt to 0, as the paper does; the law still gives the forces.
    elements, mode : as in `analytic.hall.readings`.
    workspace : low and high shift, shape (3,), mm; default: `analytic.inverse.response_surface.workspace`.
    cells : number of cells of the table along x, y and z.
    deviation : standard deviation of each reading over built sensors within their tolerances, shape (k,), T; default:
        the sensor is the design, exactly. Only more than three readings leave a residual that is compared with it.
    mount : as in `analytic.inverse.forward_model.model`.
    reject_ambient : take a uniform ambient field for three more unknowns: poses and loads are then those of the
        readings less what any such field would explain (`analytic.inverse.ambient_field`). It needs nine readings.

    Raises
    ------
    BadInput
        The design has no magnet, there are fewer than three elements, an element lies inside the beam, the workspace
        is empty, or the field is not defined at a point of it.
    """
    tau = NO_TILT if law is None or ignore_tilt else law.tilt
    forward = model(design, tau, elements=elements, mode=mode, mount=mount)
    sigma = np.array([element.noise_T for element in forward.elements])
    weights, field_fit, free = _weights(sigma), None, np.empty((0, 0))
    if reject_ambient:
        field_fit = ambient_field.field_fit(forward.elements, weights)
        free = ambient_field.field_free(forward.elements, field_fit)
    low, high = response_surface.workspace(design, law) if workspace is None else map(np.asarray, workspace)
    if low.shape != (3,) or high.shape != (3,) or not (np.isfinite(high - low) & (low < high)).all():
        raise BadInput("the workspace must have a positive size along x, y and z, in mm: raise its reach or its sink")
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    # poses on the faces of the workspace lie inside a cell of the table, and inside the workspace despite rounding
    pad, edge = 0.01 * (high - low), 1e-7 * design.D
    table, span = pose_search.start_table(forward, low - pad, high + pad, cells, free)
    explained = np.hypot(sigma, deviation)
    if reject_ambient:
        explained = np.sqrt(free**2 @ explained**2)
    cell = (high - low + 2 * pad) / cells
    goal = Goal(
        low=low - edge,
        high=high + edge,
        floor=low - 3 * cell,
        roof=high + 3 * cell,
        weights=weights,
        # of more than three readings; five standard deviations, or 2 % of the range of a reading without noise
        tolerance=np.where(explained > 0, 5 * explained, 0.02 * span),
        # nearly all poses lie within one diagonal of a cell from their start
        reach=2.5 * float(np.linalg.norm(cell)),
        D=design.D,
        rails=rails(forward.elements),
        free=free,
    )
    return Decoder(forward, law, low, high, table, goal, sigma, field_fit)


def field_of(elements: Sequence[Element], outputs: ArrayLike) -> Array:
    """Return B.n, shape (n, k), T, from outputs of the elements, shape (n, k), V (T for a chip)."""
    null, gain = (np.array([getattr(e, name) for e in elements]) for name in ("null", "gain"))
    return np.asarray((np.asarray(outputs, dtype=np.float64) - null) / gain)


def decode(coder: Decoder, readings: ArrayLike, *, near: ArrayLike | None = None, follow: bool = False) -> Decoded:
    """Decode rows of readings to poses and loads.

    Parameters
    ----------
    readings : B.n of each element (see `field_of`), shape (n, k), T; rows with NaN and rows at a rail get no pose.
    near : for an ambiguous row, the pose nearest to this shift is chosen, shape (3,), mm; default: rest.
    follow : the rows are a time series: for an ambiguous row, the pose nearest to that of the last row with a pose is
        chosen, and `near` is for the first row only.

    Raises
    ------
    BadInput
        The readings have a wrong shape.
    """
    rows, count = rows_of(coder, readings), len(coder.forward.elements)
    last = np.zeros(3) if near is None else np.asarray(near, float)
    status: list[Status] = []
    poses, multiplicity = [np.empty((0, 3))], np.zeros(len(rows), dtype=np.int64)
    shift, slopes = np.full((len(rows), 3), np.nan), np.full((len(rows), count, 3), np.nan)
    for k, row in enumerate(rows):
        word, found, slope = pose_search.poses_of(row, coder.forward, coder.table, coder.goal)
        status.append(word)
        multiplicity[k] = len(found)
        if len(found):
            nearest = nearest_of(found, last)
            shift[k], slopes[k] = found[nearest], slope[nearest]
            last = shift[k] if follow else last
            poses.append(found)
    decoded = multiplicity > 0
    s, A = shift[decoded].T, slopes[decoded].transpose(2, 1, 0)
    tilt, force, load, force_slopes = state(coder, s)
    for k in np.flatnonzero(decoded)[np.isnan(force[2])].tolist() if coder.mechanics is not None else []:
        status[k] = "tension" if status[k] == "ok" else status[k]
    errors = spread(coder.sigma, A)

    def filled(values: Array) -> Array:
        """Return values of the decoded rows (j, m) as rows (n, j), NaN where a row has no pose."""
        table = np.full((len(rows), len(values)), np.nan)
        table[decoded] = values.T
        return table

    return Decoded(
        status=status,
        shift=shift,
        tilt=filled(tilt),
        force=filled(force),
        load=filled(load),
        condition=filled(condition(A)[None])[:, 0],
        multiplicity=multiplicity,
        noise_mm=filled(np.sqrt((errors**2).sum(axis=1))),
        noise_N=filled(np.sqrt((np.einsum("jin,jkn->ikn", force_slopes, errors) ** 2).sum(axis=1))),
        poses=np.concatenate(poses),
        owner=np.repeat(np.arange(len(rows)), multiplicity),
    )


def rows_of(coder: Decoder, readings: ArrayLike) -> Array:
    """Return rows of readings as an array (n, k); raise BadInput for another shape."""
    rows, count = np.ascontiguousarray(readings, dtype=np.float64), len(coder.forward.elements)
    if rows.ndim != 2 or rows.shape[1] != count:
        raise BadInput(f"readings must have shape (n, {count}), a column for each element; got {rows.shape}")
    return rows


def ambient_of(coder: Decoder, readings: Array, shift: Array) -> tuple[Array, Array]:
    """Return the uniform field that a decoder rejected from rows of readings, and its standard deviation by noise.

    Parameters
    ----------
    readings, shift : B.n of the elements, (n, k), T, and the pose decoded from them, (n, 3), mm; NaN without one.

    Returns
    -------
    field, deviation : shape (n, 3), T; NaN without a pose, the deviation also without noise.
    """
    G, known = coder.field_fit, np.isfinite(shift[:, 2])
    if G is None:
        raise ValueError("this decoder rejects no ambient field")
    field, deviation = np.full((2, *shift.shape), np.nan)
    values, A = readings_with_slopes(coder.forward, shift[known].T)
    field[known] = (readings[known] - values.T) @ G.T
    # a reading changes the field by itself, and by the pose that follows from it
    moves = spread(coder.sigma, told_slopes(coder, A))
    by_noise = (G * coder.sigma)[..., None] - np.einsum("ik,jkn,jln->iln", G, A, moves)
    deviation[known] = np.sqrt((by_noise**2).sum(axis=1)).T
    return field, deviation


def nearest_of(poses: Array, near: Array) -> int:
    """Return the index of the pose, of (n, 3), mm, that is nearest to a shift."""
    return int(((poses - near) ** 2).sum(axis=1).argmin()) if len(poses) > 1 else 0


def state(coder: Decoder, shift: Array) -> tuple[Array, Array, Array, Array]:
    """Return tilt (2, n), rad, force and load (3, n), N and mm, and slopes of the force, at shifts (3, n), mm."""
    tilt = rotation(coder.forward.tau, shift)
    if coder.mechanics is None:
        return tilt, *np.full((2, *shift.shape), np.nan), np.full((3, *shift.shape), np.nan)
    return tilt, *response_surface.force_and_load(coder.mechanics, shift)


def told_slopes(coder: Decoder, A: Array) -> Array:
    """Return slopes dB/ds of the elements (3, k, n), T/mm, less what a uniform field explains if one is rejected."""
    return np.einsum("ik,jkn->jin", coder.goal.free, A) if len(coder.goal.free) else A


def condition(A: Array) -> Array:
    """Return the condition numbers, in the 2-norm, of slopes dB/ds (3, k, n), shape (n,); infinite on a fold."""
    return np.asarray(np.linalg.cond(np.moveaxis(A, 2, 0)))


def spread(sigma: Array, A: Array) -> Array:
    """Return the error of the pose from one standard deviation of each reading's noise; NaN without noise.

    The pose's covariance is S S' with S the result at one pose.

    Parameters
    ----------
    sigma : standard deviation of each reading, shape (k,), T.
    A : slopes dB/ds, shape (3, k, n), T/mm.

    Returns
    -------
    shape (3, k, n), mm; not finite on a fold.
    """
    if not sigma.any():
        return np.full_like(A, np.nan)
    weights = _weights(sigma)
    u, values, v = np.linalg.svd(np.moveaxis(A, 2, 0).swapaxes(1, 2) * weights[:, None], full_matrices=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        # (A'WA)^-1 A'W by singular values
        return np.asarray(np.einsum("nji,nj,nkj->ikn", v, 1 / values, u) * (weights * sigma)[:, None])


def _weights(sigma: Array) -> Array:
    return sigma.min() / sigma if sigma.all() else np.ones_like(sigma)


def poses_outside(coder: Decoder, readings: Array) -> Array:
    """Return, for each row of readings (n, k), T, the pose with these readings that lies least outside the workspace.

    The poses of a wider box are searched. The mechanics'
    polynomials give the tilt there beyond their samples, so such a pose is a hint to the user and no result.

    Returns
    -------
    shift : shape (n, 3), mm; NaN where no pose is found.
    """
    shifts = np.full((len(readings), 3), np.nan)
    low, high = (1.25 * end for end in response_surface.workspace(coder.forward.design))
    goal = coder.goal._replace(low=low, high=high, floor=low, roof=high)
    # beyond the workspace the magnet may overlap an element, where its field can be undefined
    with contextlib.suppress(BadInput):
        table, _ = pose_search.start_table(coder.forward, low, high, CELLS, coder.goal.free)
        for k, row in enumerate(rows_of(coder, readings)):
            poses = pose_search.poses_of(row, coder.forward, table, goal)[1]
            far = np.maximum(np.maximum(coder.low - poses, poses - coder.high), 0.0).max(axis=1)
            if len(poses):
                shifts[k] = poses[far.argmin()]
    return shifts


def exceeded_limit(coder: Decoder, pose: Array) -> Limit | None:
    """Return the limit of the workspace that a pose (3,), mm, exceeds; None for NaN, which stands for no pose."""
    if not np.isfinite(pose).all():
        return None
    low, high = response_surface.workspace(coder.forward.design)
    # report a limit of the mechanics only if the pose lies within the workspace of the design without mechanics
    if pose[2] < coder.low[2] and coder.low[2] > low[2] and not pose[2] < low[2]:
        return "depth"
    aside = np.abs(pose[:2]).max()
    if aside > coder.high[0] and coder.high[0] < high[0] and not aside > high[0]:
        return "shear"
    return "workspace"
