"""What a solve returns, in the user's units: the state of each load, its field, and what is known of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.discretisation import elements
from fem.solvers.newton import Stop
from geometry.arrays import Array
from geometry.loads import Load, Response

Status = Literal["ok", "not_converged", "unstable", "no_contact"]
Remark = Literal[
    "no_touch",
    "touch_lost",
    "pulled",
    "leaning",
    "given_way",
    "slides_over",
    "guided_only",
    "nearly_guided_only",
    "full_slip",
    "part_slips",
    "idle_stick",
]


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of a state beside its numbers.

    Attributes
    ----------
    stop : why the path ended short of the load; empty if it did not.
    unstable_directions : of the state; None where it is not known.
    onset, onset_mm : what moved when the path turned unstable, and between which of its values (from, to), mm; None
        where the path did not, or where nobody looked.
    weak_at : principal stretches, the largest first, at which the law loses stability in the state, or just beyond
        one that stopped or is unstable; None if nowhere.
    inverted_share : share of the silicone's volume with det F <= 0; 0 where J at the points of integration is
        above FLAT.
    remark : what a user should know of the answer, None if nothing. "given_way" is a tip that left the symmetric
        press to a side that the mesh chose, "leaning" one that an imperfection led there, "guided_only" a section
        whose tip would give way if it were free to slide, "nearly_guided_only" one that is close to that, "pulled" a
        glued plate that pulls at the tip.
    sideways_stiffness_ratio : stiffness of a frictionless press's tip, free to slide, against a force sideways, over
        that of the unpressed beam; 0 where it gives way sideways. None where nobody looked (see
        `fem.results.lateral_stiffness`).
    critical_depth : where that is to be expected, mm, to some 10 % (see `fem.results.lateral_stiffness`); None far
        from it, before or past it. `fem.stability` finds it, with an error estimate.
    """

    stop: Stop = ""
    unstable_directions: int | None = None
    onset: Literal["depth", "shear"] | None = None
    onset_mm: tuple[float, float] | None = None
    weak_at: tuple[float, float, float] | None = None
    inverted_share: float = 0.0
    remark: Remark | None = None
    sideways_stiffness_ratio: float | None = None
    critical_depth: float | None = None


@dataclass(frozen=True, slots=True)
class Field:
    """The deformed body.

    Attributes
    ----------
    mesh : second order, mm.
    u : (n, dim) nodal displacements, or (n, fields) those of a section with harmonics, mm.
    p : (k, 1) or (k, harmonics + 1) pressures at the vertices, MPa.
    vertices : (k,) nodes of the pressures.
    angles : the functions of the angle that u and p are multiplied by; see `fem.results.revolved_body` for the solid
        body.
    """

    mesh: skfem.Mesh
    u: Array
    p: Array
    vertices: NDArray[np.int64]
    angles: elements.Angles


@dataclass(frozen=True, slots=True)
class Estimates:
    """Estimates of relative errors from the mesh (and the harmonics), see `fem.error_estimates`.

    Those of force, shift and tilt of the magnet as vectors, and that of the force along the shear alone; None where
    they were not estimated, or where there is nothing to be in error.
    """

    force: float | None = None
    shift: float | None = None
    tilt: float | None = None
    sideways: float | None = None


@dataclass(frozen=True, slots=True)
class Solution:
    """One state of a load path.

    Attributes
    ----------
    load : the load that this state carries; less than the one asked for when the solve stopped on the way.
    response, field : the answer, and what it was read from.
    energy : stored in the deformed silicone, N mm; without Coulomb friction its derivative by the depth is the normal
        force.
    dissipated : energy that slipping on the plate has cost since the path began, N mm.
    slip_share : share of the area in contact that slips, None without Coulomb friction or contact.
    status, message : "ok", or why not and what to try; they follow from `facts`, by `fem.results.diagnostics` and
        `fem.results.state_messages`.
    dofs, newton_iterations, seconds : what it cost since the state before.
    facts : what else is known of the state; whoever decides by it looks here and not at the message.
    estimates : of the errors.
    """

    load: Load
    response: Response
    energy: float
    model: str
    dofs: int
    newton_iterations: int
    seconds: float
    field: Field
    facts: Facts = Facts()
    status: Status = "ok"
    message: str = ""
    dissipated: float = 0.0
    slip_share: float | None = None
    estimates: Estimates = Estimates()
