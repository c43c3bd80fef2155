"""The linear systems of small vibrations about a pressed, or pressed and sheared, sensor at rest.

About an axisymmetric press the orders of the angle are not coupled (`fem.model.single_order`): a motion of
the plate along z has order 0, one along x has order 1. About all other states (sheared, under a tilted plate,
gripped, with Coulomb friction) all harmonics form one system, with both motions as its loads; x is the direction of
the shear.

Contact is frozen: points in touch keep their normal springs, whatever the sign of their motion, and glued points
their tangential ones too. With Coulomb friction all points in touch stick: a point that has slipped carries the
largest traction, so it slips on in one half of a small cycle and sticks in the other; after the first cycles its
traction has fallen far enough for it to stick in both. A grip moves along x only, and its skin is free along z. With
q the unknowns and s the motion of the plate, the energy's second derivatives are

    Pi_qq = K,    Pi_qs = -b,    Pi_ss = k_held,        so    K q = b s,    F = k_held s - b . q

is the force on the tip, with the signs of `geometry.loads.Response`: positive in compression and along x.

The free sensor has no plate: its base is shaken instead, and q is the motion relative to the base. A unit motion r
of the base loads it by lambda M r (`fem.solve.reduced_basis` has lambda).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fem.analyses.modes import Press, inertia_of_magnet, solve_press
from fem.equilibrium import start_path
from fem.model import angular_fields, coulomb_friction, element_integrals, plate_contact, single_order
from fem.model.assembled_state import State
from fem.model.elements import Surface
from fem.model.gradient_recovery import build_recovery
from fem.model.nonlinear_system import System
from fem.model.plate_contact import Plate
from fem.results.postprocess import recover_pose
from fem.scene import Scene
from fem.solve.newton import STOPPED, NoStateError
from fem.solve.path_state import PathState, about
from fem.solve.reduced_basis import Problem
from geometry.arrays import Array

Motion = Literal["z", "x"]
"""Direction in which the plate, or the base of the free sensor, moves: z along its depth, x along the shear."""
ANGLES, ORDER_FIELDS = 8, 5
"""Angles in a quarter turn at which the pressure of order 1 is compared with that of the press, and number of fields
of a model of one order."""
DIFFERENCE = 1e-6
"""Motion over D of the central difference for the pose of a beam without magnet."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One linear system, driven by motions of the plate or of the base.

    Attributes
    ----------
    state, plate : state about which the sensor vibrates, in the model of this block, and the plate with its contact
        frozen; None for the free sensor.
    problem : matrices, and a column b for each of the `motions`; over E D, lengths over D.
    held : (k, k) force of the plate by its motion with the body held, over E D.
    """

    state: PathState
    plate: Plate | None
    motions: tuple[Motion, ...]
    problem: Problem
    held: Array


def build_blocks(scene: Scene) -> tuple[PathState, list[Block]]:
    """Solve for the state under the scene's load, and return it with the systems of all motions of the plate.

    Raises
    ------
    NoStateError
        The path stops before the load.
    """
    (load,) = scene.loads
    if scene.model == "harmonic":
        state = _solve_path(scene)
        motions: tuple[Motion, ...] = ("x",) if load.grip is not None else ("z", "x")
        return state, [build_block(scene, state, _sticking(state.plate), motions)]
    press = solve_press(scene)
    glued = press.edge is not None and scene.loads[0].friction == "stick"
    free = press.edge is None
    blocks = [_press_block(scene, press, 0, glued=glued)]
    if glued or free:  # a frictionless plate transmits no motion along x
        blocks.append(_press_block(scene, press, 1, glued=glued))
    return press.state, blocks


def _sticking(plate: Plate) -> Plate:
    """Return the plate whose points in touch all stick."""
    if plate.friction is None:
        return plate
    return replace(plate, friction=coulomb_friction.expect_sticking(plate.friction))


def _solve_path(scene: Scene) -> PathState:
    """Return the state of a load in the harmonic model, whose x axis is the direction of the shear."""
    load, D, (x, y) = scene.loads[0], scene.design.D, scene.direction
    path = start_path(scene)
    try:
        shear = np.array([[x, y], [-y, x]]) @ load.imposed_shear
        reason, state = path.go(load.depth / D, shear / D), path.state
    finally:
        path.close()
    if reason:
        depth, shear = state.position[0] * D, state.position[1] * D
        raise NoStateError(
            f"the path stops at depth {depth:.4g} mm, shear {shear:.4g} mm ({STOPPED[reason]}): take a smaller load"
        )
    return state


def _press_block(scene: Scene, press: Press, order: int, *, glued: bool) -> Block:
    """Return the system of order 0 or 1 about a press, or about the free sensor."""
    state = about(press.state, single_order.build(press.state.d, order)) if order else press.state
    plate = press.glue(state) if glued else state.plate
    return build_block(scene, state, None if press.edge is None else plate, ("x",) if order else ("z",))


def build_block(scene: Scene, state: PathState, plate: Plate | None, motions: tuple[Motion, ...]) -> Block:
    """Return the system about a state for some motions."""
    system, (m, across, _) = state.d.system, inertia_of_magnet(scene)
    at_state = system.state(state.q)
    if plate is not None:
        plate = replace(plate, pressed=plate_contact.overlap(state.skin, at_state.u, plate) > 0)
    inertia = np.array({0: [], 1: [m], 2: [m, across], 3: [m, m, across]}[system.n_rigid])
    M = system.mass(1.0, inertia, at_state)
    here = system.assemble(at_state, plate)
    if plate is None:
        loads = [_inertial_load(system, at_state, inertia, motion) for motion in motions]
        held = np.zeros((len(motions), len(motions)))
    else:
        moved = [_moved(plate, motion) for motion in motions]
        # the springs are linear: moving the plate with the body held changes the residual by the load
        loads = [here.residual - system.assemble(at_state, one, tangent=False).residual for one in moved]
        before = _plate_force(state, at_state, plate)
        held = np.stack([_plate_force(state, at_state, one) - before for one in moved], axis=1)
        held = held[[("x", "z").index(motion) for motion in motions]]
    problem = Problem(
        here.tangent,
        system.relaxing_stiffness(at_state),
        M,
        np.stack(loads, axis=1),
        system.size - system.n_pressure,
    )
    return Block(state, plate, motions, problem, held)


def _motion_vector(motion: Motion) -> Array:
    """Return the displacement (3,) of a unit motion: deeper, or along x."""
    return np.array([0.0, 0.0, -1.0]) if motion == "z" else np.array([1.0, 0.0, 0.0])


def _moved(plate: Plate, motion: Motion) -> Plate:
    """Return the plate or grip moved by D along z (deeper) or x."""
    along, normal = plate.frame @ _motion_vector(motion), plate.frame[2]
    shear = plate.shear + along[:2]
    # where the moved plane meets the axis
    height = None if plate.height is None else plate.height + along[2] / normal[2]
    return replace(plate, shear=shear, height=height)


def _plate_force(state: PathState, nodal: State, plate: Plate) -> Array:
    """Return the force (2,) along x and z on the tip, over E D^2."""
    traction = plate_contact.springs(state.skin, nodal.u, plate).traction
    x, _, z = np.einsum("kq,kqi->i", state.skin.weights, traction)
    return np.array([-x, z])


def _inertial_load(system: System, state: State, inertia: Array, motion: Motion) -> Array:
    """Return M r (n,) for the unit motion r of the whole sensor along x or z, in a model of order 0 or 1."""
    e = system.elements
    moved = np.zeros(system.fixed.shape)
    # u_z = z_0 in the axisymmetric model, u_x = w_-1 in that of order 1
    moved[:, 1 if motion == "z" else 2] = 1.0
    forces = np.zeros(system.fixed.shape)
    np.add.at(forces, e.cells, np.einsum("mfagb,mbg->maf", element_integrals.mass(e, 1.0), moved[e.cells]))
    load = np.concatenate([forces[system.free], np.zeros(system.n_rigid + system.n_pressure)])
    if system.rigid:
        by_motion = system.rigid.derivative(system.motion(state.q))
        load[system.n_free : system.n_free + system.n_rigid] = np.einsum("nf,nfr->r", forces[system.glued], by_motion)
        load[system.n_free] += inertia[0]  # the magnet's first unknown is its displacement along the motion
    return load


def read_pose(block: Block, V: Array) -> Array:
    """Return shift along x and z over D, and tilt, rad, of the magnet for small motions V (n, m), shape (3, m)."""
    system, pose = block.state.d.system, np.zeros((3, V.shape[1]))
    if system.rigid:
        places = {1: [1], 2: [0, 2], 3: [0, 1, 2]}[system.n_rigid]
        pose[places] = V[system.n_free : system.n_free + system.n_rigid]
        return pose
    q = block.state.q
    for i, v in enumerate(V.T):
        step = DIFFERENCE / float(np.abs(v).max())
        ahead, behind = (_point_pose(block.state, q + way * step * v) for way in (1.0, -1.0))
        pose[:, i] = (ahead - behind) / (2 * step)
    return pose


def _point_pose(state: PathState, q: Array) -> Array:
    """Return shift along x and z and tilt (3,) of the material point at the magnet's centre, without a magnet."""
    d, u = state.d, state.d.system.state(q).u
    if d.model == "axisymmetric":
        return np.array([0.0, d.centre(u)[0][2], 0.0])
    if d.elements.angles.fields == ORDER_FIELDS:
        fields = replace(d.elements, angles=angular_fields.fourier_fields(1))
        shift, tilt = recover_pose(build_recovery(fields, d.shape.H, mirrored=True), single_order.raise_fields(u))
    else:
        shift, tilt = recover_pose(d.centre, u)
    return np.array([shift[0], shift[2], tilt[0]])


@dataclass(frozen=True, slots=True, eq=False)
class ContactPressure:
    """Pressure between tip and plate: at rest, and its change with small motions; means over the lines of facets.

    Attributes
    ----------
    area : (k,) areas that touch, over D^2; about an axisymmetric press up to a common factor.
    at_rest : (k,) pressures at rest, over E.
    by_unknowns, by_motion : changes (k, m) for motions V of the body, and (k, j) for the plate's motions, over E.
    """

    area: Array
    at_rest: Array
    by_unknowns: Array
    by_motion: Array


def _rise(skin: Surface, u: Array, normal: Array) -> Array:
    """Return the displacement (k, q) of the skin along the normal of the plate, for nodal fields u."""
    return np.asarray(skin.displacement(u) @ normal) if normal[0] else skin.upward_displacement(u)


def read_pressure(block: Block, V: Array) -> ContactPressure:
    """Return the pressure of the contact area for small motions V (n, m) of a body under a plate."""
    state, plate, skin = block.state, block.plate, block.state.skin
    assert plate is not None
    system, en = state.d.system, plate.stiffness
    at_state = system.state(state.q)
    t = max(skin.angles, len(system.elements.angles.theta))
    overlap = plate_contact.overlap(skin, at_state.u, plate)
    weights = skin.weights * (overlap > 0)

    def over_lines(values: Array) -> Array:
        """Return the integrals of values (k, q) over the touching points of each facet's line, at every angle."""
        return np.asarray((weights * values).reshape(len(values), -1, t).sum(axis=1).ravel())

    area = over_lines(np.ones(weights.shape))
    own = np.where(area > 0, area, 1.0)
    at_rest = en * over_lines(overlap) / own
    # the skin's displacement is linear in the unknowns, that of the magnet's surface is not
    normal = plate.frame[2]
    moves = [over_lines(_rise(skin, system.state(state.q + v).u - at_state.u, normal)) for v in V.T]
    changes = en * np.stack(moves, axis=1) / own[:, None]
    plate_moves = en * np.array([[-normal @ _motion_vector(motion) for motion in block.motions]] * len(area))
    if system.elements.angles.fields == ORDER_FIELDS:  # the first of its two angles is 0, where the cosine is 1
        cosines = np.cos((np.arange(ANGLES) + 0.5) * np.pi / (2 * ANGLES))
        at_rest, area, plate_moves = (
            np.repeat(values[::t], ANGLES, axis=0) for values in (at_rest, area, plate_moves)
        )
        changes = (changes[::t, None] * cosines[:, None]).reshape(len(area), -1)
    touching = area > 0
    return ContactPressure(area[touching], at_rest[touching], changes[touching], plate_moves[touching])
