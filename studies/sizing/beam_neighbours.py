"""Candidates as beams of an array: what their neighbours add to the decoded force, estimated and proved.

**Estimate**, for n sensors at once, of a beam among eight neighbours that stand in a square of a pitch. Each of them
is in one of the poses of the required loads at the least E, drawn with a fixed seed. What a neighbour adds to a
reading is the exact field of its magnet less that at rest, which taring removes. To first order in these changes db,

    ignoring:      dF = dF/ds (db/ds)^-1 db
    subtracting:   dF = dF/ds (db/ds)^-1 sum_j (db/ds_j) ds_j,    ds_j = (db/ds)^-1 db of the neighbour j,

where s is the state of a beam (depth, shear and across); decoded jointly, nothing is left. The magnets themselves
push each other, as dipoles side by side do; what that changes with their shifts counts in full as a force.

**Proof**: as `magtip array` has it, by `studies.sensing.crosstalk`: random loads on all beams of a square of
`SIDE` x `SIDE`, exact fields, the same decoders, which reject a field where that is required, forces of exact
magnets, and the pitch at which neighbours snap together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analytic.inverse.forward_model import readings_of_sensors
from analytic.magnet import MU_0
from geometry.array_design import POLARITIES, layout_of, poles_of
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.output.records import FlatRow
from studies.sensing import crosstalk
from studies.sensing.array_readings import Grid
from studies.sensing.disturbed_loads import loads_of
from studies.simulation import mechanics_sources

if TYPE_CHECKING:
    from studies.parts.requirements import Requirements
    from studies.sizing.sensor_arrays import Sensors

SIDE = 3
"""Rows and columns of the array: of a beam with all of its nearest neighbours."""
LEAST_FRAMES, SEED = 96, 1
"""Least number of drawn states of all beams, with which the second pass is within a factor of two, and their seed."""
OTHERS = np.delete(layout_of(SIDE, SIDE), SIDE**2 // 2, axis=0)
"""Places of the neighbours about the beam in the middle, over the pitch."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """p poses of n magnets: displacement, mm, and axis (n, p, 3), and the motions and turns (n, p, 3, 3) by a change
    of the state along the last axis, 1 and rad D/mm."""

    shift: Array
    axis: Array
    moves: Array
    turns: Array

    def first(self, count: int) -> Poses:
        """Return the first poses."""
        return Poses(self.shift[:, :count], self.axis[:, :count], self.moves[:, :count], self.turns[:, :count])


def polarities(needed: Requirements) -> tuple[str, ...]:
    """Return the polarities that an array may have."""
    return POLARITIES if needed.polarity == "any" else (needed.polarity,)


def estimated(sensors: Sensors, poses: Poses, states: Array, forces: Array, needed: Requirements) -> dict[str, Array]:
    """Return the largest errors of the force by neighbours of each decoder, and by the magnets' forces, (n,), N.

    They are those of the polarity with the least sum for the required decoder; NaN where a pose is unknown.

    Parameters
    ----------
    states : change of a state by one of the readings (n, p, 3, k), mm/T. forces : by states (n, p, 3, 3), N/mm.
    """
    assert needed.pitch is not None
    n, p = poses.shift.shape[:2]
    own = np.tile(np.arange(p), math.ceil(LEAST_FRAMES / p))
    random = np.random.default_rng(SEED)
    other = random.integers(p, size=(len(own), len(OTHERS)))
    # the frame in which a neighbour finds itself, as the beam in the middle of its own ones
    seen = other + p * random.integers(len(own) // p, size=other.shape)
    added, slopes = _of_each(sensors, poses, needed.pitch)
    shift = poses.shift[:, other] - poses.shift[:, own][:, :, None]
    apart = needed.pitch * np.linalg.norm(OTHERS, axis=1)
    pushes = np.einsum("jab,nfjb->nfja", _stiffness(), shift) / apart[:, None] ** 5
    strength = (sensors.remanence[:, 1] * math.pi / 4 * sensors.magnet[:, 0] ** 2 * sensors.magnet[:, 1]) ** 2
    strength = strength * 1e-6 / (4 * math.pi * MU_0)
    least, kept = np.full(n, np.inf), dict[str, Array]()
    for polarity in polarities(needed):
        signs = np.delete(poles := poles_of(polarity, SIDE, SIDE), SIDE**2 // 2) * poles[SIDE**2 // 2]
        by_state, eight = forces[:, own], list(enumerate(signs.tolist()))
        first = sum(sign * added[:, other[:, j], j] for j, sign in eight)
        found = (states[:, own] @ first[..., None])[..., 0]
        left = sum(sign * (slopes[:, other[:, j], j] @ found[:, seen[:, j], :, None])[..., 0] for j, sign in eight)
        second = (states[:, own] @ left[..., None])[..., 0]
        error = {
            "neighbours_ignoring": _largest(by_state, found),
            "neighbours_subtracting": _largest(by_state, second),
            "neighbours_jointly": 0 * _largest(by_state, found),
            "magnets": strength * np.linalg.norm(np.einsum("j,nfja->nfa", signs, pushes), axis=-1).max(axis=1),
        }
        total = np.nan_to_num(error[f"neighbours_{needed.decoder}"] + error["magnets"], nan=1e300)
        kept = {name: np.where(total < least, value, kept.get(name, value)) for name, value in error.items()}
        least = np.minimum(least, total)
    return kept


def _largest(by_state: Array, change: Array) -> Array:
    return np.asarray(np.linalg.norm((by_state @ change[..., None])[..., 0], axis=-1).max(axis=1))


def _stiffness() -> Array:
    """Return dF/ds of two equal dipoles side by side, over mu0 m^2/(4 pi r^5), by neighbours (8, 3, 3)."""
    towards = np.column_stack([OTHERS, np.zeros(len(OTHERS))]) / np.linalg.norm(OTHERS, axis=1)[:, None]
    return np.asarray(15 * towards[:, :, None] * towards[:, None] - np.diag([3.0, 3.0, 9.0]))


def _of_each(sensors: Sensors, poses: Poses, pitch: float) -> tuple[Array, Array]:
    """Return what each neighbour in each pose adds to the readings since rest (n, p, 8, k), T, and its slopes along
    its state (n, p, 8, k, 3), T/mm."""
    s, (n, p) = sensors, poses.shift.shape[:2]
    k, places = int(s.owners[-1]) + 1, np.column_stack([pitch * OTHERS, np.zeros(len(OTHERS))])
    points = (s.points[:, None] - places[:, None]).reshape(n, -1, 3)
    normals = np.repeat(s.normals[:, None], len(places), axis=1).reshape(points.shape)
    owners = (s.owners + k * np.arange(len(places))[:, None]).ravel()
    unknown = np.isnan(poses.shift[..., :1])
    up = np.broadcast_to([0.0, 0.0, 1.0], (n, 1, 3))
    shift = np.concatenate([np.where(unknown, 0.0, poses.shift), 0 * up], axis=1)
    axis = np.concatenate([np.where(unknown, up, poses.axis), up], axis=1)
    field, by_shift, by_turn = readings_of_sensors(points, normals, owners, s.magnet, shift, axis)
    added = np.where(unknown, np.nan, field[:, :-1] - field[:, -1:])
    slopes = by_shift[:, :-1] @ poses.moves + by_turn[:, :-1] @ poses.turns / s.D[:, None, None, None]
    J = s.remanence[:, 0, None, None]
    return (J * added).reshape(n, p, len(places), k), (J[..., None] * slopes).reshape(n, p, len(places), k, 3)


def proved(design: Design, needed: Requirements) -> FlatRow:
    """Return the row of `magtip array` for a design, of the polarity with the least cross-talk that can stand.

    Its `status` is the first reason why none can, where that is so, and its errors are NaN then.
    """
    assert needed.pitch is not None
    source = mechanics_sources.source_of(design)
    coder, field = crosstalk.beams_decoder(design, source.law, needed)
    loads, full, _ = loads_of(coder, needed)
    count = crosstalk.FRAMES * SIDE**2
    drawn = crosstalk.random_loads(coder, loads, count)
    force, shift = (rows.reshape(crosstalk.FRAMES, SIDE**2, 3) for rows in drawn)
    rows = []
    for polarity in polarities(needed):
        grid = Grid(SIDE, SIDE, needed.pitch, polarity)
        array = grid.array(coder, needed.pitch, polarity, ambient=field is not None)
        row = crosstalk.errors_of_array(coder, array, polarity, (force, shift), full, field)
        change = crosstalk.change_of_forces(array, shift) if row["status"] == "ok" else math.nan
        own = {"rejects_ambient": crosstalk.rejected(coder, array), "mechanics": source.name}
        rows.append(row | {"magnets_change_N": change} | own)
    return min(rows, key=lambda row: _total(row, needed))


def _total(row: FlatRow, needed: Requirements) -> float:
    total = float(row[f"{needed.decoder}_N"]) + float(row["magnets_change_N"])
    return math.inf if math.isnan(total) else total


def figures_of(row: FlatRow) -> dict[str, float]:
    """Return the figures of a proof; a share of readings without a force has no error that is known."""
    found = {"magnets": float(row["magnets_change_N"])}
    for name in crosstalk.DECODERS:
        lost = row[f"{name}_no_force_percent"] > 0
        found[f"neighbours_{name}"] = math.nan if lost else float(row[f"{name}_N"])
    return found


def reason_of(design: Design, needed: Requirements) -> tuple[FlatRow, str]:
    """Return the proof of a design, and why its array cannot be, "" if it can."""
    try:
        row = proved(design, needed)
    except BadInput as error:
        return {}, str(error)
    return row, "" if row["status"] == "ok" else f"in the array {row['status']}"
