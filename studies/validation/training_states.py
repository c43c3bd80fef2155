"""Finite-element states of beams, from the store or solved: presses, first modes, critical depths and glued shears.

A shear begins at a depth between `SHALLOWEST_SHEAR` and the deepest press, but before the tip would buckle sideways:
beyond that depth an equilibrium depends on the path. So presses come first, and tell each beam's critical depth.

The finite elements have an error of their own. Answers bring estimates of it for force, shift and tilt; for the other
quantities it is taken for the difference from the same state on the coarser mesh (`States.compared`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.scene import Scene
from geometry.arrays import Array
from geometry.loads import Load, Response
from studies.exploration.needed_paths import Solver
from studies.exploration.solved_paths import Answer
from studies.surrogate import surrogate_range
from studies.surrogate.prediction import first_zero
from studies.validation.training_beams import DIAMETER_MM, Beams

SAFE = 0.95
"""Deepest shear over the critical depth."""


@dataclass(frozen=True, slots=True)
class States:
    """States of beams at their depths or shears: arrays of shape (n, k), NaN where a solve failed.

    Attributes
    ----------
    depth, shear : position over D.
    quantities : by name, forces over E D^2, lengths over D, tilt in rad, frequencies over `frequency_unit`.
    errors : by name, estimated errors of the finite elements themselves; a name or a number (NaN) is missing where
        the error is unknown.
    """

    depth: Array
    shear: Array
    quantities: Mapping[str, Array]
    errors: Mapping[str, Array]

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Which beams have all their states, shape (n,)."""
        return np.asarray(~np.isnan(next(iter(self.quantities.values()))).any(axis=1))

    def kept(self, rows: NDArray[Any]) -> States:
        """Return the states of some beams."""
        parts = ({name: q[rows] for name, q in part.items()} for part in (self.quantities, self.errors))
        return States(self.depth[rows], self.shear[rows], *parts)

    def joined(self, other: States) -> States:
        """Return the states of the beams of both."""
        parts = (
            {name: np.concatenate([q, theirs[name]]) for name, q in mine.items()}
            for mine, theirs in ((self.quantities, other.quantities), (self.errors, other.errors))
        )
        return States(np.concatenate([self.depth, other.depth]), np.concatenate([self.shear, other.shear]), *parts)

    def compared(self, coarse: States) -> States:
        """Return these states with errors, where they have none, that are the differences from coarser ones."""
        differences = {name: np.abs(q - coarse.quantities[name]) for name, q in self.quantities.items()}
        return replace(self, errors=differences | dict(self.errors))


def presses(solver: Solver, beams: Beams, depths: Array) -> States:
    """Return the states of frictionless presses to depths over D, shape (n, k), rising."""
    scenes = [
        Scene(beams.design(k), tuple(Load(depth=float(x) * DIAMETER_MM) for x in row), solver.accuracy)
        for k, row in enumerate(depths)
    ]
    return _states(depths, np.zeros_like(depths), solver.answers(scenes))


def shears(solver: Solver, beams: Beams, depth: Array, shears: Array) -> States:
    """Return the states of glued shears, over D, shape (n, k), rising, each at one depth, shape (n,)."""
    scenes = []
    for k, row in enumerate(shears):
        at = float(depth[k]) * DIAMETER_MM
        loads = tuple(Load(depth=at, shear_x=float(x) * DIAMETER_MM, friction="stick") for x in row)
        scenes.append(Scene(beams.design(k), loads, solver.accuracy, model="harmonic"))
    return _states(np.broadcast_to(depth[:, None], shears.shape), shears, solver.answers(scenes))


def critical_depths(solver: Solver, beams: Beams) -> States:
    """Return the critical depths over D, at most the deepest press of the surrogate; NaN where a search fails."""
    scenes = [Scene(beams.design(k), (Load(depth=1.0),), solver.accuracy) for k in range(len(beams))]
    deepest = surrogate_range.deepest(beams.L, beams.diameter, beams.height).tolist()
    found = []
    for (answer,), most in zip(solver.answers(scenes, "critical depth"), deepest, strict=True):
        depth = answer.values.get("critical_depth_over_D")
        if depth is None and answer.values.get("stable_to_over_D", 0.0) >= most - 1e-9:
            depth = most
        found.append(math.nan if depth is None else min(depth, most))
    return _single("depth", found)


def first_modes(solver: Solver, beams: Beams) -> States:
    """Return the lowest natural frequencies of the unloaded beams over `frequency_unit`."""
    rest, ratios = (Load(depth=0.0),), beams.density_ratio
    scenes = []
    for k in range(len(beams)):
        design = beams.design(k)
        design = replace(design, magnet_density=float(ratios[k]) * design.density)
        scenes.append(Scene(design, rest, solver.accuracy, model="axisymmetric"))
    lowest = [(answer.values.get("frequency") or [np.nan])[0] for (answer,) in solver.answers(scenes, "modes")]
    return _single("frequency", lowest)


def shear_depth(beams: Beams, press: States) -> Array:
    """Return the depth of each beam's shear, over D, shape (n,), above the depth at which its press buckles."""
    low = np.sqrt(surrogate_range.SHALLOWEST_SHEAR)
    critical = first_zero(press.depth, np.nan_to_num(press.quantities["sideways_ratio"], nan=-1.0))
    most = np.minimum(surrogate_range.deepest(beams.L, beams.diameter, beams.height), SAFE * critical)
    high = np.maximum(np.sqrt(most), low)
    return np.asarray(np.round((low + (high - low) * beams.share) ** 2, 5))


def _single(name: str, values: Sequence[float]) -> States:
    """Return the states of a quantity that each beam has once."""
    column = np.array(values, dtype=float)[:, None]
    none = np.zeros_like(column)
    return States(none, none, {name: column}, {})


def _states(depth: Array, shear: Array, answers: Sequence[Sequence[Answer]]) -> States:
    """Return the quantities of answers, which are for D = DIAMETER_MM and E = 1 MPa, with the known errors."""
    D = DIAMETER_MM

    def table(read: Callable[[Answer, Response], Any]) -> Array:
        rows = [[np.nan if a.response is None else read(a, a.response) for a in row] for row in answers]
        return np.array(rows, dtype=float)

    force, length = 1 / D**2, 1 / D
    quantities = {
        "force_x": force * table(lambda _, r: r.force[0]),
        "force_z": force * table(lambda _, r: r.force[2]),
        "shift_x": length * table(lambda _, r: r.shift[0]),
        "shift_z": length * table(lambda _, r: r.shift[2]),
        "tilt": table(lambda _, r: r.tilt),
        "contact_radius": length * table(lambda _, r: r.contact_radius),
        "strain": table(lambda a, _: a.values["largest_strain"]),
        "sideways_ratio": table(lambda a, _: a.values.get("sideways_stiffness_ratio")),
    }
    of_force, of_shift = (np.hypot(quantities[f"{name}_x"], quantities[f"{name}_z"]) for name in ("force", "shift"))
    errors = {
        "force_x": np.abs(quantities["force_x"]) * table(lambda a, _: a.estimates.get("sideways")),
        "force_z": of_force * table(lambda a, _: a.error_estimate),
        "shift_x": of_shift * table(lambda a, _: a.estimates.get("shift")),
        "shift_z": of_shift * table(lambda a, _: a.estimates.get("shift")),
        "tilt": np.abs(quantities["tilt"]) * table(lambda a, _: a.estimates.get("tilt")),
    }
    return States(depth, shear, quantities, errors)
