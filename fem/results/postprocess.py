"""From a state of a path to a solution: force, pose of the magnet and fields, in the user's units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem.model import angular_fields, coulomb_friction, plate_contact, rigid_inclusion, single_order
from fem.model.gradient_recovery import Recovery, build_recovery
from fem.model.symmetry_models import Discretisation
from fem.results.diagnostics import Margin, diagnose
from fem.scene import Scene
from fem.solution import Field, RadiusSource, Solution, Stop
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.loads import Load, Response

DIFFERENCE = 1e-6
"""Motion over D of the central difference for the pose of a beam without magnet: its square and the rounding of the
pose over it are both far below a mesh's error."""


def read(
    state: PathState,
    scene: Scene,
    load: Load,
    stop: Stop = "",
    *,
    iterations: int = 0,
    seconds: float = 0.0,
    margin: Margin | None = None,
    touched: bool = False,
) -> Solution:
    """Return the solution at a state of a path towards a load of a scene.

    Parameters
    ----------
    iterations, seconds : Newton iterations and time spent on the state.
    stop, margin, touched : see `fem.results.diagnostics.diagnose`.
    """
    d, nodal = state.d, state.d.system.state(state.q)
    design, friction, (radius, radius_from) = scene.design, state.friction, contact_size(state)
    D, E = design.D, design.E_now
    solution = Solution(
        load=reached_load(state, load, scene) if stop else load,
        response=read_response(state, scene, radius),
        energy=state.energy * d.symmetry * E * D**3,
        model=d.model,
        dofs=d.system.size,
        newton_iterations=iterations,
        seconds=seconds,
        field=Field(
            mesh=replace(d.mesh, doflocs=d.mesh.doflocs * D),
            u=nodal.u * D,
            p=nodal.p * E,
            vertices=d.system.corner_nodes,
            angles=d.elements.angles,
        ),
        dissipated=state.dissipated * d.symmetry * E * D**3,
        slip_share=None if friction is None else coulomb_friction.slip_share(friction, state.skin.weights),
        radius_from=radius_from,
    )
    return diagnose(solution, state, scene, stop, margin, touched=touched)


def reached_load(state: PathState, load: Load, scene: Scene) -> Load:
    """Return the load that a path has reached on its way to another one."""
    depth, *along = state.position * scene.design.D
    x, y = np.array(along) @ scene.turn
    moved = {"shear_x": float(x), "shear_y": float(y)} if load.shears_tip or any(along) else {}
    return replace(load, depth=max(float(depth), 0.0), **moved)


def read_response(state: PathState, scene: Scene, radius: float | None) -> Response:
    """Return the force and the pose of the magnet in the user's frame and units; `radius` of `contact_size`."""
    d, nodal, turn, design = state.d, state.d.system.state(state.q), scene.turn.T, scene.design
    D = design.D
    total = tip_force(state) * design.E_now * D**2
    shift, tilt = read_pose(d, nodal.u, state.q)
    # components that symmetry forbids contain only rounding errors
    if d.model == "axisymmetric":
        shift[0] = tilt[0] = 0.0
    if d.mirrored:
        shift[1] = tilt[1] = 0.0
    force, shift_xy, tilt_xy = turn @ total[:2] + 0.0, turn @ shift[:2] * D + 0.0, turn @ tilt + 0.0
    return Response(
        force=(float(force[0]), float(force[1]), float(total[2])),
        shift=(float(shift_xy[0]), float(shift_xy[1]), float(shift[2]) * D),
        tilt=float(tilt_xy[0]),
        contact_radius=(radius or 0.0) * D,
        tilt_y=float(tilt_xy[1]),
    )


def contact_size(state: PathState) -> tuple[float | None, RadiusSource | None]:
    """Return the contact radius over D and what it follows from, see `fem.solution.Solution`; None in a grip."""
    if state.grip:
        return None, None
    at = state.skin, state.u, state.plate
    if state.sheared:
        return plate_contact.equal_area_radius(*at), "area"
    from_gap = None if state.d.revolved and state.tilt else plate_contact.gap_radius(*at)
    return (plate_contact.hertz_radius(*at), "pressure") if from_gap is None else (from_gap, "gap")


def tip_force(state: PathState) -> Array:
    """Return the force (3,) on the tip in the model's frame, over E D^2; z is positive in compression."""
    d = state.d
    x, y, z = d.symmetry * plate_contact.resultant(state.skin, state.u, state.plate)
    # components that symmetry forbids contain only sums of radial tractions and rounding errors
    return np.array([0.0 if d.model == "axisymmetric" else -x, 0.0 if d.mirrored else -y, z])


def read_pose(d: Discretisation, u: Array, q: Array) -> tuple[Array, Array]:
    """Return the displacement (3,) of the magnet's centre over D, and its tilt (2,), angles from z to x and y, rad.

    Without a rigid magnet: displacement of the material point at the centre, and rotation of the polar decomposition
    there.
    """
    system = d.system
    if system.rigid:
        motion = np.zeros(6)
        motion[system.components] = system.motion(q)
        return motion[:3], _tilt_angles(rigid_inclusion.axis(system.motion(q)))
    if d.model == "axisymmetric":
        return d.centre(u)[0], np.zeros(2)
    return recover_pose(d.centre, u)


def recover_pose(centre: Recovery, u: Array) -> tuple[Array, Array]:
    """Return displacement (3,) and rotation (2,) of the material point at the magnet's centre, see `read_pose`."""
    shift, G = centre(u)
    U, _, Vt = np.linalg.svd(np.eye(3) + G)
    return shift, _tilt_angles((U @ Vt)[:, 2])


def pose_slopes(state: PathState, V: Array) -> Array:
    """Return shift along x and z over D, and tilt, rad, of the magnet for small motions V (n, m), shape (3, m).

    The state may be axisymmetric, of order 1 (`fem.model.single_order`), or have all harmonics.
    """
    system, pose = state.d.system, np.zeros((3, V.shape[1]))
    if system.rigid:
        motions = np.zeros((6, V.shape[1]))
        motions[system.components] = V[system.n_free : system.n_free + system.n_rigid]
        return motions[[0, 2, 3]]
    for i, v in enumerate(V.T):
        step = DIFFERENCE / float(np.abs(v).max())
        ahead, behind = (_point_pose(state, state.q + way * step * v) for way in (1.0, -1.0))
        pose[:, i] = (ahead - behind) / (2 * step)
    return pose


def _point_pose(state: PathState, q: Array) -> Array:
    """Return shift along x and z and tilt (3,) of the material point at the magnet's centre, without a magnet."""
    d, u = state.d, state.d.system.state(q).u
    if d.model == "axisymmetric":
        return np.array([0.0, d.centre(u)[0][2], 0.0])
    if d.elements.angles.of_one_order:
        fields = replace(d.elements, angles=angular_fields.fourier_fields(1))
        shift, tilt = recover_pose(build_recovery(fields, d.shape.H, mirrored=True), single_order.raise_fields(u))
    else:
        shift, tilt = recover_pose(d.centre, u)
    return np.array([shift[0], shift[2], tilt[0]])


def _tilt_angles(axis: Array) -> Array:
    """Return the rotation (2,) that carries z to a direction (3,): its components towards x and y, rad."""
    across = float(np.hypot(axis[0], axis[1]))
    return np.zeros(2) if across == 0 else np.arctan2(across, axis[2]) * axis[:2] / across
