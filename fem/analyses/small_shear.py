"""Small shear of a glued plate about a press: stiffness, shift and tilt of the magnet from one tangent.

The press is solved with the axisymmetric model; then the contact area is glued to the plate. For a sideways
displacement s of the plate, K dq = -dR/ds s in the model of order 1 (`fem.model.single_order`) gives the
response.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem.accuracy import QUICK, STANDARD, Accuracy
from fem.model import angular_fields, plate_contact, single_order
from fem.model.assembled_state import Assembly
from fem.model.gradient_recovery import build_recovery
from fem.model.mesh_specification import MeshSpecification, specification
from fem.results.error_estimate_rules import LEAST_RADIUS
from fem.results.error_estimates import estimate_numbers, estimated
from fem.results.lateral_stiffness import integrate_normal_force
from fem.results.postprocess import recover_pose
from fem.scene import Scene
from fem.solution import NOT_ESTIMATED, Estimates
from fem.solve.contact_extent import find_press
from fem.solve.direct_solver import Solver
from fem.solve.load_stepping import Path
from fem.solve.newton import STOPPED, NoStateError
from fem.solve.path_state import PathState, about, glue
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load

__all__ = ["SmallShear", "small_shear"]

EDGE = 0.5
"""Edge length at the edge of the glued area over that of a shear along a path: an infinitesimal shear depends more
on where exactly the press ends. At 1 the stiffness of one design of `magtip validate accuracy` was 4.7 % off at
quick."""
ROUGH = 0.3
"""Edge length over D of the mesh on which the edge of the contact is located; it is refined there."""


@dataclass(frozen=True, slots=True)
class SmallShear:
    """Response to a small sideways displacement of a glued plate about a pressed state.

    Attributes
    ----------
    stiffness : tangential force over the plate's displacement, N/mm.
    shift, tilt : displacement of the magnet's centre over the plate's, and its tilt over the plate's displacement,
        rad/mm.
    force, contact_radius : normal force and contact radius of the press, N and mm.
    estimates : estimated errors.
    """

    stiffness: float
    shift: float
    tilt: float
    force: float
    contact_radius: float
    estimates: Estimates = NOT_ESTIMATED


def small_shear(
    design: Design,
    depth: float,
    magnet: Magnet = "rigid",
    *,
    accuracy: Accuracy = STANDARD,
    estimate: bool = True,
) -> SmallShear:
    """Return stiffness, shift and tilt per mm of shear at a depth in mm, with the contact area glued.

    Parameters
    ----------
    estimate : estimate the errors from a second solve on a mesh coarser by COARSER.

    Raises
    ------
    BadInput
        The depth is not positive or out of range, the design has no magnet to be rigid, or the press does not
        reach the depth.
    """
    check_depth(design, depth, magnet)
    scene = Scene(design, (Load(depth=depth),), accuracy, magnet)
    return estimated(scene, _solve_small_shear, estimate_small_shear) if estimate else _solve_small_shear(scene)


def estimate_small_shear(one: SmallShear, other: SmallShear, scene: Scene) -> Estimates:
    """Return the estimated errors of a small shear, from that on a mesh coarser by COARSER."""
    numbers = {name: (getattr(one, name), getattr(other, name)) for name in ("stiffness", "shift", "tilt")}
    return estimate_numbers("small shear", numbers, scene, max(one.contact_radius / scene.design.D, LEAST_RADIUS))


def _solve_small_shear(scene: Scene) -> SmallShear:
    """Return the small shear of a scene, without error estimates."""
    D, accuracy = scene.design.D, scene.accuracy
    depth = scene.loads[0].depth / D
    rough = replace(QUICK, section_size=max(ROUGH, accuracy.section_size))
    edge, press = find_press(_section(replace(scene, accuracy=rough)), EDGE * accuracy.section_patch, depth)
    rim = edge, min(EDGE * accuracy.section_patch, edge / 4)
    section = replace(_section(scene), rim=rim, glued=True)
    path = Path(section.build(), rough=press)
    try:
        reason, pressed = path.go(depth, np.zeros(2)), path.state
    finally:
        path.close()
    if reason:
        raise NoStateError(
            f"the press stops at depth {pressed.position[0] * D:.4g} mm ({STOPPED[reason]}): take a smaller depth"
        )
    glued = glue(about(pressed, single_order.build(pressed.d, 1)), edge)
    system, plate = glued.d.system, glued.plate
    at_press = system.assemble(system.state(glued.q), plate)
    # the springs are linear: moving the plate with the body fixed changes their forces by the load of a unit shear
    moved = replace(plate, shear=np.array([1.0, 0.0]))
    before, after = (
        plate_contact.assemble_springs(glued.skin, glued.u, one, tangent=False)[0] for one in (plate, moved)
    )
    forces, load = np.zeros(system.fixed.shape), np.zeros(system.size)
    np.add.at(forces, glued.skin.nodes, before - after)
    load[: system.n_free] = forces[system.free]
    return _read_small_shear(scene.design, pressed, glued, _solve_linear(at_press, load))


def _section(scene: Scene) -> MeshSpecification:
    """Return the section of a press from which a small shear starts."""
    return specification(scene, scene.accuracy.section_size, scene.accuracy.section_size / 2)


def check_depth(design: Design, depth: float, magnet: Magnet) -> None:
    """Refuse a depth, mm, at which there is no contact area to shear."""
    check_load(design, Load(depth=depth), magnet)
    if not depth > 0:
        raise BadInput(f"depth must be above 0 mm for a shear, which needs a contact area; got {depth:g} mm")


def _solve_linear(assembly: Assembly, right: Array) -> Array:
    """Solve a tangent's linear system for one right-hand side (n,)."""
    solver = Solver()
    try:
        solver.factorise(assembly.tangent)
        return solver.solve(right)
    finally:
        solver.close()


def _read_small_shear(design: Design, pressed: PathState, glued: PathState, step: Array) -> SmallShear:
    """Return the response from the linear solution `step` per unit of shear, about a press that is glued."""
    skin, plate, D = glued.skin, glued.plate, design.D
    assert plate.tied is not None
    # the displacement of the skin is linear in the unknowns, that of the magnet's surface is not
    du = glued.d.system.state(step).u - glued.u
    along = skin.displacement(du)[..., 0]
    stiffness = float(np.sum((skin.weights * plate.stiffness * (1 - along))[plate.tied]))
    shift, tilt = _read_pose(glued, step)
    return SmallShear(
        stiffness=stiffness * design.E * D,
        shift=shift,
        tilt=tilt / D,
        force=integrate_normal_force(pressed) * design.E * D**2,
        contact_radius=plate_contact.contact_radius(pressed.skin, pressed.u, pressed.plate) * D,
    )


def _read_pose(glued: PathState, step: Array) -> tuple[float, float]:
    """Return shift and tilt of the magnet per unit of shear, over D and in rad, from the linear solution `step`."""
    system, small = glued.d.system, 1e-6
    if system.rigid:
        shift, tilt = system.motion(step)
        return float(shift), float(tilt)
    fields = replace(system.elements, angles=angular_fields.fourier_fields(1))
    recovery = build_recovery(fields, glued.d.shape.H, mirrored=True)
    states = (system.state(way * step) for way in (small, -small))
    (ahead, tilt2), (behind, tilt1) = (recover_pose(recovery, single_order.raise_fields(s.u)) for s in states)
    return float(ahead[0] - behind[0]) / (2 * small), float(tilt2[0] - tilt1[0]) / (2 * small)
