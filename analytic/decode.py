"""From readings back to the pose of the magnet and the load on the tip. Lengths in mm, B in T, forces in N.

The decoder finds all poses in the workspace that have the readings. A table of the workspace gives one start for each
possible pose (`analytic.inverse.start_table`). From each start, damped Newton steps on the exact forward model lead
to a pose (`analytic.inverse.damped_newton`); equal poses count once. A converged iteration does not prove that the
pose is the right one: several poses can have the same readings. The decoder then returns all of them, with
status "ambiguous".

With A = dB/ds (k, 3), the pose's covariance is P C P' with P = (A'WA)^-1 A'W. C is the covariance of the readings:
the variance of each is that of `analytic.reading_noise`. The condition number is that of A in the 2-norm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.hall import Mode, at_rail
from analytic.inverse import observability, response_surface, start_table, start_table_construction
from analytic.inverse.forward_model import NO_TILT, Forward, model, rotation
from analytic.inverse.pose_search import EXACT, Search
from analytic.inverse.response_surface import Mechanics
from analytic.parts import Element
from geometry.arrays import Array
from geometry.design import BadInput, Design

Status = Literal[
    "ok", "ambiguous", "out_of_workspace", "saturated", "not_finite", "inconsistent", "tension", "uncalibrated"
]

CELLS = (24, 24, 12)
"""Number of the table's cells along x, y and z: half as many along z, because the workspace is half as high."""
EDGE = 1e-6
"""Distance outside the workspace up to which a pose still counts as inside, mm: rounding on its faces."""
PAD = 0.01
"""Margin of the table around the workspace, over its size, so that poses on its faces lie inside a cell."""
DOUBT = 5.0
"""Largest misfit of each of more than three readings over its standard deviation, from noise and tolerances."""
SHARE = 0.02
"""Largest misfit of a reading without noise, over its span in the workspace, if there are more than three."""


@dataclass(frozen=True, slots=True, eq=False)
class Decoder:
    """A forward model with its workspace, its table of starts and, for the loads, its mechanics.

    Attributes
    ----------
    low, high : corners of the workspace, shape (3,), mm.
    sigma : standard deviation of each reading from noise and converter, shape (k,), T.
    tolerance : largest misfit of each reading if there are more than three, shape (k,), T.
    """

    forward: Forward
    mechanics: Mechanics | None
    low: Array
    high: Array
    table: start_table.StartTable
    search: Search
    sigma: Array
    tolerance: Array


class Poses(NamedTuple):
    """All poses of several rows of readings: shift, shape (3, p), mm, and slopes dB/ds, shape (3, k, p), T/mm.

    `owner` is the row of each pose, shape (p,), ascending; `misfit` are the rows with a converged pose that does not
    fit its readings.
    """

    shift: Array
    slopes: Array
    owner: NDArray[np.int64]
    misfit: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """One row for each row of readings; NaN where there is no pose.

    Attributes
    ----------
    status : "ok" (one pose); "ambiguous" (several poses; the result is the one nearest to the pose before, or to
        rest); "out_of_workspace" (no pose in the workspace has these readings); "saturated" (a reading at a rail);
        "not_finite" (a reading is NaN or infinite); "inconsistent" (more than three readings, which no pose has
        together); "tension" (one pose, but by the mechanics the plate would have to pull there: no load). Only
        `magtip decode` gives "uncalibrated" (one pose, but tolerances of a sensor at rest explain its force).
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

    Raises
    ------
    BadInput
        The design has no magnet, there are fewer than three elements, an element lies inside the beam, the workspace
        is empty, or the field is not defined at a point of it.
    """
    tau = NO_TILT if law is None or ignore_tilt else law.tau
    forward = model(design, tau, elements=elements, mode=mode)
    low, high = response_surface.workspace(design, law) if workspace is None else map(np.asarray, workspace)
    if low.shape != (3,) or high.shape != (3,) or not (np.isfinite(high - low) & (low < high)).all():
        raise BadInput("the workspace must have a positive size along x, y and z, in mm: raise its reach or its sink")
    pad = PAD * (high - low)
    table = start_table_construction.build(forward, low - pad, high + pad, cells)
    sigma = np.array([element.noise_T for element in forward.elements])
    explained = np.hypot(sigma, deviation)
    tolerance = np.where(explained > 0, DOUBT * explained, SHARE * table.span)
    weights = sigma.min() / sigma if sigma.all() else np.ones(len(sigma))
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    search = Search(forward, table, low - EDGE, high + EDGE, weights, tolerance)
    return Decoder(forward, law, low, high, table, search, sigma, tolerance)


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
    rows = np.asarray(readings, dtype=np.float64)
    if rows.ndim != 2:
        raise BadInput(f"readings must have shape (n, {len(coder.forward.elements)}); got {rows.shape}")
    check_count(coder, rows.shape[1])
    finite = np.asarray(np.isfinite(rows).all(axis=1))
    saturated = finite & at_rail(coder.forward.elements, rows.T)
    poses, slopes, owner, misfit = _solve(coder, rows, np.flatnonzero(finite & ~saturated))
    multiplicity = np.bincount(owner, minlength=len(rows))
    first = np.cumsum(multiplicity) - multiplicity
    chosen = _choose(poses, first, multiplicity, np.zeros(3) if near is None else np.asarray(near, float), follow)
    status: list[Status] = [
        "ok" if many == 1 else "ambiguous" if many else "out_of_workspace" for many in multiplicity
    ]
    cases: list[tuple[Status, NDArray[np.bool_]]] = [
        ("inconsistent", np.isin(np.arange(len(rows)), misfit) & (multiplicity == 0)),
        ("saturated", saturated),
        ("not_finite", np.asarray(~finite)),
    ]
    for name, flags in cases:
        for k in np.flatnonzero(flags).tolist():
            status[k] = name
    return _result(coder, status, poses, slopes, owner, multiplicity, chosen)


def check_count(coder: Decoder, given: int) -> None:
    """Raise BadInput if the number of readings in a row differs from the number of the decoder's elements."""
    count = len(coder.forward.elements)
    if given != count:
        raise BadInput(f"readings must have shape (n, {count}), a column for each element; got {given} columns")


def _solve(coder: Decoder, target: Array, index: NDArray[np.int64]) -> Poses:
    """Find all poses of the rows `index` of readings, (n, k), T."""
    found = [coder.search(target[row]) for row in index.tolist()]
    counts = [len(shifts) for shifts, _, _ in found]
    k = target.shape[1]
    return Poses(
        shift=np.concatenate([np.empty((0, 3)), *(shifts for shifts, _, _ in found)]).T.copy(),
        slopes=np.concatenate([np.empty((0, k, 3)), *(slopes for _, slopes, _ in found)]).transpose(2, 1, 0).copy(),
        owner=np.repeat(index, counts),
        misfit=index[[misfit for _, _, misfit in found]],
    )


def fits(coder: Decoder, residual: Array, slopes: Array) -> NDArray[np.bool_]:
    """Return whether poses fit their readings, shape (n,), from residuals (k, n), T, and slopes (3, k, n), T/mm."""
    if len(residual) == 3:
        return np.asarray(np.sqrt((residual**2).sum(axis=0)) <= EXACT * np.sqrt((slopes**2).sum(axis=(0, 1))))
    return np.asarray((np.abs(residual) <= coder.tolerance[:, None]).all(axis=0))


def _choose(
    poses: Array, first: NDArray[np.int64], multiplicity: NDArray[np.int64], near: Array, follow: bool
) -> NDArray[np.int64]:
    """Return the index of the pose chosen for each row, -1 for none; row k has its poses from index first[k] on."""
    chosen = np.where(multiplicity > 0, first, -1)
    # for each row the latest row, itself included, that has a pose
    latest = np.maximum.accumulate(np.where(multiplicity > 0, np.arange(len(multiplicity)), -1))
    for k in np.flatnonzero(multiplicity > 1):
        last = near if not follow or k == 0 or latest[k - 1] < 0 else poses[:, chosen[latest[k - 1]]]
        candidates = poses[:, first[k] : first[k] + multiplicity[k]]
        chosen[k] += ((candidates.T - last) ** 2).sum(axis=1).argmin()
    return chosen


def _result(
    coder: Decoder,
    status: list[Status],
    poses: Array,
    slopes: Array,
    owner: NDArray[np.int64],
    multiplicity: NDArray[np.int64],
    chosen: NDArray[np.int64],
) -> Decoded:
    """Return the rows of the result; rows with "tension" get this status here."""
    n, decoded = len(status), chosen >= 0
    s, A = poses[:, chosen[decoded]], slopes[:, :, chosen[decoded]]

    def rows(values: Array) -> Array:
        """Return values of the chosen poses (j, m) as rows (n, j), NaN where a row has no pose."""
        table = np.full((n, len(values)), np.nan)
        table[decoded] = values.T
        return table

    no_value = np.full((3, s.shape[1]), np.nan)
    spread = observability.spread(coder.sigma, A)
    force, load, noise_N = no_value, no_value, no_value
    if coder.mechanics is not None:
        force, load, slopes_N = response_surface.force_and_load(coder.mechanics, s)
        for k in np.flatnonzero(decoded)[np.isnan(force[2])].tolist():
            status[k] = "tension" if status[k] == "ok" else status[k]
        noise_N = np.sqrt((np.einsum("jin,jkn->ikn", slopes_N, spread) ** 2).sum(axis=1))
    return Decoded(
        status=status,
        shift=rows(s),
        tilt=rows(rotation(coder.forward.tau, s)),
        force=rows(force),
        load=rows(load),
        condition=rows(observability.condition(A)[None])[:, 0],
        multiplicity=multiplicity,
        noise_mm=rows(np.sqrt((spread**2).sum(axis=1))),
        noise_N=rows(noise_N),
        poses=np.ascontiguousarray(poses.T),
        owner=owner,
    )
