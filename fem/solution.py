"""What a solve returns, in the user's units, and how it is read off a path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.contact import coulomb_friction, plate_contact
from fem.discretisation import elements, rigid_inclusion
from fem.discretisation.symmetry_models import Discretisation
from fem.results import diagnostics
from fem.results.diagnostics import Facts, Status
from fem.solvers.load_stepping import Path
from fem.solvers.newton import Stop
from geometry.design import Design
from geometry.loads import Load, Response

Array = NDArray[np.float64]


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
    status, message : "ok", or why not and what to try; they follow from `facts`, by `fem.results.diagnostics`.
    error_estimate, shift_error_estimate, tilt_error_estimate, sideways_error_estimate : relative errors of the force,
        of the magnet's shift, of its tilt, and of the force along the shear alone, from the mesh (and the harmonics);
        None where they were not estimated or there is nothing.
    dofs, newton_iterations, seconds : what it cost since the state before.
    facts : what else is known of the state; whoever decides by it looks here and not at the message.
    """

    load: Load
    response: Response
    energy: float
    status: Status
    message: str
    model: str
    error_estimate: float | None
    shift_error_estimate: float | None
    tilt_error_estimate: float | None
    sideways_error_estimate: float | None
    dofs: int
    newton_iterations: int
    seconds: float
    field: Field
    facts: Facts
    dissipated: float = 0.0
    slip_share: float | None = None


def slides(load: Load) -> bool:
    """Whether a load moves the tip sideways (a frictionless plate does not)."""
    rough = load.friction == "stick" if isinstance(load.friction, str) else load.friction > 0
    return bool(load.shear_x or load.shear_y) and (load.grip is not None or rough)


def along(load: Load) -> tuple[float, float]:
    """Unit vector of the line along which a load shears, with x > 0 or (0, 1); without a shear (1, 0).

    Along an axis it is exact, so that nothing of a response is across it.

    >>> along(Load(shear_y=-2.0)), along(Load(shear_x=-3.0, shear_y=4.0))
    ((0.0, 1.0), (0.6, -0.8))
    """
    x, y = load.shear_x, load.shear_y
    length = math.copysign(math.hypot(x, y), x or y)
    return (x / length + 0.0, y / length + 0.0) if length else (1.0, 0.0)


def coulomb(loads: Sequence[Load]) -> float | None:
    """Coefficient of friction of a path's loads, None for a frictionless or glued plate."""
    mu = loads[0].friction
    return None if isinstance(mu, str) or mu == 0 else float(mu)


def read(
    path: Path, design: Design, load: Load, direction: Array, stop: Stop, seconds: float, *, watch: bool = False
) -> Solution:
    """The present state of a path that was to reach a load.

    Parameters
    ----------
    direction : (2,) unit vector in the user's frame along which the model's x axis points.
    stop : why the path stopped short; empty if it did not.
    watch : look whether an axisymmetric press is stable sideways.
    """
    D, d = design.D, path.d
    turn = np.array([[direction[0], -direction[1]], [direction[1], direction[0]]])
    if stop:
        depth, shear = float(path.position[0]) * D, turn @ path.position[1:] * D
        moved = {"shear_x": float(shear[0]), "shear_y": float(shear[1])} if slides(load) else {}
        load = replace(load, depth=depth, **moved)
    state = d.system.state(path.q)
    plate = path.plate()
    residual, _, _ = plate_contact.traction(path.skin, state.u, plate)
    total = d.symmetry * np.einsum("kq,kqi->i", path.skin.weights, residual) * design.E * D**2
    shift, tilt = pose(d, state.u, path.q)
    if d.model == "axisymmetric":
        total[0] = shift[0] = tilt[0] = 0.0  # radial tractions, and rounding
    if d.model != "full":
        total[1] = shift[1] = tilt[1] = 0.0
    force, shift_xy, tilt_xy = turn @ -total[:2] + 0.0, turn @ shift[:2] * D + 0.0, turn @ tilt + 0.0
    radius = plate_contact.patch_radius if path.sheared else plate_contact.contact_radius
    response = Response(
        force=(float(force[0]), float(force[1]), float(total[2])),
        shift=(float(shift_xy[0]), float(shift_xy[1]), float(shift[2]) * D),
        tilt=float(tilt_xy[0]),
        contact_radius=0.0 if path.grip else radius(path.skin, state.u, plate) * D,
        tilt_y=float(tilt_xy[1]),
    )
    slip_share = coulomb_friction.slip_share(path.friction, path.skin.weights) if path.friction is not None else None
    known = diagnostics.gather(path, D, load, stop, response, slip_share, watch=watch)
    return Solution(
        load=load,
        response=response,
        energy=path.energy * d.symmetry * design.E * D**3,
        status=diagnostics.status(known),
        message=diagnostics.sentence(known, design, load, response, slip_share, d.model),
        model=d.model,
        error_estimate=None,
        shift_error_estimate=None,
        tilt_error_estimate=None,
        sideways_error_estimate=None,
        dofs=d.system.size,
        newton_iterations=path.iterations,
        seconds=seconds,
        field=Field(
            mesh=type(d.mesh)(d.mesh.doflocs * D, d.mesh.t),
            u=state.u * D,
            p=state.p * design.E,
            vertices=d.system.corner_nodes,
            angles=d.elements.angles,
        ),
        facts=known,
        dissipated=path.dissipated * d.symmetry * design.E * D**3,
        slip_share=slip_share,
    )


def pose(d: Discretisation, u: Array, q: Array) -> tuple[Array, Array]:
    """Displacement (3,) of the magnet's centre, and its rotation (2,) as angles that carry z towards x and y.

    Without a rigid magnet: the material point at the centre, and the rotation of the polar decomposition there.
    """
    system = d.system
    if system.rigid:
        motion = system.motion(q)
        place = {1: [2], 3: [0, 2], 6: [0, 1, 2]}[len(motion)]
        shift = np.zeros(3)
        shift[place] = motion[: len(place)]
        return shift, _angles(rigid_inclusion.axis(motion))
    shift, G = d.centre(u)
    return shift, np.zeros(2) if d.model == "axisymmetric" else _angles(_rotation(G)[:, 2])


def _rotation(G: Array) -> Array:
    """Rotation (3, 3) of the polar decomposition of 1 + G."""
    U, _, Vt = np.linalg.svd(np.eye(3) + G)
    return np.asarray(U @ Vt)


def _angles(axis: Array) -> Array:
    """Rotation (2,) that carries z to a direction (3,): towards x, towards y."""
    across = float(np.hypot(axis[0], axis[1]))
    return np.zeros(2) if across == 0 else np.arctan2(across, axis[2]) * axis[:2] / across
