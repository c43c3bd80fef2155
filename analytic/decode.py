"""From readings back to the pose of the magnet and the load on the tip. Lengths in mm, B in T, forces in N.

All poses in the workspace that give the readings are looked for: a table of the workspace gives a start on each
sheet (`analytic.inverse.start_table`), damped Newton steps on the exact forward model go on from there
(`analytic.inverse.damped_newton`), and those that arrive at the same place are counted once. That an iteration
converges is no proof that it found the right pose; where there are several, all of them are given, and the status
says so.

With A = dB/ds (k, 3), the pose's covariance is P C P' with P = (A'WA)^-1 A'W and C that of the readings, whose
variance is noise^2 + step^2/12 of each element. The condition number is that of A in the 2-norm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.hall import Mode
from analytic.inverse import damped_newton, observability, response_surface, start_table, start_table_construction
from analytic.inverse.forward_model import NO_TILT, Forward, model, rotation
from analytic.inverse.response_surface import Mechanics
from analytic.parts import Element
from geometry.arrays import Array
from geometry.design import BadInput, Design

Status = Literal["ok", "ambiguous", "out_of_workspace", "saturated", "not_finite", "inconsistent", "tension"]

CELLS = (24, 24, 12)
"""Of the table, along x, y and z."""
EDGE = 1e-6
"""How far outside the workspace a pose is still taken as in it, mm."""
PAD = 0.01
"""How far the table goes beyond the workspace, over its size."""
SAME = 1e-5
"""Poses closer than this are one, mm."""
EXACT = 1e-7
"""Greatest misfit of an exact pose, mm: of the readings over the norm of their slopes."""
DOUBT = 5.0
"""Greatest misfit of more than three readings, over their noise."""
SHARE = 0.02
"""The same, over the span of readings in the workspace, of elements that are said to have no noise."""
BLOCK = 4096
"""Readings worked on at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Decoder:
    """A forward model with its workspace, its table and, for the loads, its mechanics.

    Attributes
    ----------
    low, high : the workspace, shape (3,), mm.
    sigma : standard deviation of the readings from noise and converter, shape (k,), T.
    tolerance : greatest misfit of a reading, where there are more than three, shape (k,), T.
    """

    forward: Forward
    mechanics: Mechanics | None
    low: Array
    high: Array
    table: start_table.StartTable
    sigma: Array
    tolerance: Array


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """One row for each row of readings; NaN where there is no pose.

    Attributes
    ----------
    status : "ok"; "ambiguous" (several poses; the one given is the nearest to the one before, or to rest);
        "out_of_workspace" (no pose in it gives these readings); "saturated" (a reading at a rail); "not_finite";
        "inconsistent" (more than three readings, and none of the poses explains them all); "tension" (one pose, but
        by the mechanics the plate would have to pull there, so that its load is not known).
    shift : shape (n, 3), mm.
    tilt : rotation vector (rx, ry), shape (n, 2), rad.
    force, load : (F_x, F_y, F_n), N, and (depth, shear_x, shear_y), mm, shape (n, 3); NaN without mechanics
        and where the plate would have to pull, 0 where it does not touch.
    condition : of dB/ds, shape (n,).
    multiplicity : how many poses in the workspace give the readings, shape (n,).
    noise_mm, noise_N : standard deviations of shift and force, shape (n, 3); NaN if no element has any noise.
    poses, owner : the shifts of all poses, shape (m, 3), mm, and the row of each, shape (m,), in order.
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
) -> Decoder:
    """Prepare to decode; takes some tenths of a second.

    Parameters
    ----------
    law : tilt, forces and loads from the shift; without it the magnet does not tilt and there are no forces.
    ignore_tilt : as the paper does, with forces by the law all the same.
    elements, mode : as in `analytic.hall.readings`.
    workspace : low and high shift, shape (3,), mm; `mechanics.workspace` by default.

    Raises
    ------
    BadInput
        No magnet, fewer than three elements, one of them inside the beam, an empty workspace, or one in which
        the field is not defined.
    """
    tau = NO_TILT if law is None or ignore_tilt else law.tau
    forward = model(design, tau, elements=elements, mode=mode)
    low, high = response_surface.workspace(design, law) if workspace is None else map(np.asarray, workspace)
    if low.shape != (3,) or high.shape != (3,) or not (np.isfinite(high - low) & (low < high)).all():
        raise BadInput("the workspace must have a positive size along x, y and z, in mm: raise its reach or its sink")
    pad = PAD * (high - low)
    table = start_table_construction.build(forward, low - pad, high + pad, cells)
    gain = np.array([e.gain for e in forward.elements])
    sigma = np.array([np.hypot(e.noise, e.step / np.sqrt(12)) for e in forward.elements]) / gain
    tolerance = np.where(sigma > 0, DOUBT * sigma, SHARE * table.span)
    return Decoder(forward, law, np.array(low, dtype=float), np.array(high, dtype=float), table, sigma, tolerance)


def field_of(elements: Sequence[Element], outputs: ArrayLike) -> Array:
    """B.n, T, from the elements' outputs (V, or T for a chip), shape (n, k)."""
    null, gain = (np.array([getattr(e, name) for e in elements]) for name in ("null", "gain"))
    return np.asarray((np.asarray(outputs, dtype=np.float64) - null) / gain)


def decode(coder: Decoder, readings: ArrayLike, *, near: ArrayLike | None = None, follow: bool = False) -> Decoded:
    """Decode readings.

    Parameters
    ----------
    readings : B.n of each element (see `field_of`), shape (n, k), T; rows with NaN and rows at a rail get no pose.
    near : shift to which the pose of an ambiguous first reading shall be nearest, shape (3,), mm; rest by default.
    follow : the rows are a stream: where a row is ambiguous, the pose nearest to that of the row before is taken.

    Raises
    ------
    BadInput
        The readings have another shape.
    """
    given = np.asarray(readings, dtype=np.float64)
    count = len(coder.forward.elements)
    if given.ndim != 2 or given.shape[1] != count:
        raise BadInput(f"readings must have shape (n, {count}), a column for each element; got {given.shape}")
    target = np.ascontiguousarray(given.T)
    finite = np.asarray(np.isfinite(target).all(axis=0))
    full = finite & at_rail(coder.forward.elements, target)
    index = np.flatnonzero(finite & ~full)
    blocks = [_solve(coder, target, index[i : i + BLOCK]) for i in range(0, len(index), BLOCK)]
    poses = np.concatenate([b[0] for b in blocks] or [np.empty((3, 0))], axis=1)
    slopes = np.concatenate([b[1] for b in blocks] or [np.empty((3, count, 0))], axis=2)
    owner = np.concatenate([b[2] for b in blocks] or [np.empty(0, dtype=np.int64)])
    misfit = np.concatenate([b[3] for b in blocks] or [np.empty(0, dtype=np.int64)])
    multiplicity = np.bincount(owner, minlength=len(given))
    begin = np.cumsum(multiplicity) - multiplicity
    chosen = _choose(poses, begin, multiplicity, np.zeros(3) if near is None else np.asarray(near, float), follow)
    status: list[Status] = [
        "ok" if many == 1 else "ambiguous" if many else "out_of_workspace" for many in multiplicity
    ]
    cases: list[tuple[Status, NDArray[np.bool_]]] = [
        ("inconsistent", np.isin(np.arange(len(given)), misfit) & (multiplicity == 0)),
        ("saturated", full),
        ("not_finite", np.asarray(~finite)),
    ]
    for name, flags in cases:
        for k in np.flatnonzero(flags).tolist():
            status[k] = name
    return _result(coder, status, poses, slopes, owner, multiplicity, chosen)


def _solve(
    coder: Decoder, target: Array, index: NDArray[np.int64]
) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """All poses of the readings with these numbers: shifts, slopes and owners; and the numbers of misfits."""
    part = target[:, index]
    owner, start, curvature = start_table.starts(coder.table, part)
    if len(target) > 3:
        # where readings contradict each other, steps do not square the error
        curvature[:] = start_table.STEEP
    noisy = coder.sigma.all()
    weights = coder.sigma.min() / coder.sigma if noisy else np.ones(len(target))
    pad = 3 * coder.table.cell_size
    s, f, A, done = damped_newton.refine(
        coder.forward, start, part[:, owner], weights, coder.low - pad, coder.high + pad, curvature
    )
    low, high = coder.low[:, None] - EDGE, coder.high[:, None] + EDGE
    inside = done & ((s >= low) & (s <= high)).all(axis=0)
    good = inside & fits(coder, f, A)
    misfit = index[owner[inside & ~good]]
    s, A, owner = s[:, good], A[:, :, good], owner[good]
    if np.any(owner[1:] == owner[:-1]):
        kept = _distinct(s, owner)
        s, A, owner = s[:, kept], A[:, :, kept], owner[kept]
    return s, A, index[owner], misfit


def fits(coder: Decoder, residual: Array, slopes: Array) -> NDArray[np.bool_]:
    """Whether readings are explained, shape (n,), by residuals (k, n), T, and slopes (3, k, n), T/mm, of poses."""
    if len(residual) == 3:
        return np.asarray(np.sqrt((residual**2).sum(axis=0)) <= EXACT * np.sqrt((slopes**2).sum(axis=(0, 1))))
    return np.asarray((np.abs(residual) <= coder.tolerance[:, None]).all(axis=0))


def _distinct(s: Array, owner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices that leave out a pose that an earlier one of the same reading already is."""
    kept = np.ones(len(owner), dtype=np.bool_)
    for lag in range(1, len(owner)):
        same = owner[lag:] == owner[:-lag]
        if not same.any():
            break
        near = same & kept[:-lag] & (np.abs(s[:, lag:] - s[:, :-lag]).max(axis=0) < SAME)
        kept[lag:] &= ~near
    return np.flatnonzero(kept)


def _choose(
    poses: Array, begin: NDArray[np.int64], many: NDArray[np.int64], near: Array, follow: bool
) -> NDArray[np.int64]:
    """Which pose of each reading is given: its index, -1 for none."""
    chosen = np.where(many > 0, begin, -1)
    # the last row before each that has a pose
    before = np.maximum.accumulate(np.where(many > 0, np.arange(len(many)), -1))
    for k in np.flatnonzero(many > 1):
        last = near if not follow or k == 0 or before[k - 1] < 0 else poses[:, chosen[before[k - 1]]]
        some = poses[:, begin[k] : begin[k] + many[k]]
        chosen[k] += ((some.T - last) ** 2).sum(axis=1).argmin()
    return chosen


def at_rail(elements: Sequence[Element], field: Array) -> NDArray[np.bool_]:
    """Whether an element's output lies at a rail, shape (n,), for B.n of the elements, shape (k, n), T."""
    found = np.zeros(field.shape[1], dtype=np.bool_)
    for element, b in zip(elements, field, strict=True):
        # a converter's or the arithmetic's last digit must not hide a rail
        slack = 1e-12 * (element.high - element.low)
        output = element.null + element.gain * b
        found |= (output <= element.low + slack) | (output >= element.high - slack)
    return found


def _result(
    coder: Decoder,
    status: list[Status],
    poses: Array,
    slopes: Array,
    owner: NDArray[np.int64],
    multiplicity: NDArray[np.int64],
    chosen: NDArray[np.int64],
) -> Decoded:
    n, some = len(status), chosen >= 0
    s, A = poses[:, chosen[some]], slopes[:, :, chosen[some]]

    def rows(values: Array) -> Array:
        """Values of the poses (j, m) as rows (n, j)."""
        found = np.full((n, len(values)), np.nan)
        found[some] = values.T
        return found

    blank = np.full((3, s.shape[1]), np.nan)
    noisy = observability.spread(coder.sigma, A)
    force, load, noise = blank, blank, blank
    if coder.mechanics is not None:
        force, load, slope = response_surface.force_and_load(coder.mechanics, s)
        for k in np.flatnonzero(some)[np.isnan(force[2])].tolist():
            status[k] = "tension" if status[k] == "ok" else status[k]
        noise = np.sqrt((np.einsum("jin,jkn->ikn", slope, noisy) ** 2).sum(axis=1))
    return Decoded(
        status=status,
        shift=rows(s),
        tilt=rows(rotation(coder.forward.tau, s)),
        force=rows(force),
        load=rows(load),
        condition=rows(observability.condition(A)[None])[:, 0],
        multiplicity=multiplicity,
        noise_mm=rows(np.sqrt((noisy**2).sum(axis=1))),
        noise_N=rows(noise),
        poses=np.ascontiguousarray(poses.T),
        owner=owner,
    )
