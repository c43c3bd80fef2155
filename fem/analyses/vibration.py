"""Steady vibration of the sensor about a pressed, or pressed and sheared, state at rest.

The plate moves by s Re exp(i omega t) along z or x about a state in which all branches of the silicone are relaxed.
With g = G* / G0 the complex modulus over the instantaneous one, and rest = G(infinity) / G0,

    K*(omega) = K + (g(omega) - rest) / rest K_iso - omega^2 M,        K* q = b s,

where K is the full tangent of the state at rest (silicone, springs of the contact, magnet), K_iso its part from the
tangent of the isochoric law without geometric stiffness, and M the consistent mass of silicone and magnet. The stress
of the state at rest does not vibrate, so its geometric stiffness stays real. The bulk does not relax, and the springs
of the plate do not either. `fem.solve.reduced_basis` has the solutions. The state at rest has the long-term modulus;
where the design's E is the instantaneous one, the state is that of `relaxed`.

About an axisymmetric press the orders of the angle are not coupled (`fem.model.single_order`): a motion of
the plate along z has order 0, one along x has order 1. About all other states (sheared, under a tilted plate,
gripped, with Coulomb friction) all harmonics form one system, with both motions as its loads; x is the direction of
the shear.

Contact is frozen: points in touch keep their normal springs, whatever the sign of their motion, and glued points
their tangential ones too. With Coulomb friction all points in touch stick, those that have slipped too; fem/README.md
has the reason, and the limits. A grip moves along x only, and its skin is free along z. With q the
unknowns and s the motion of the plate, the energy's second derivatives are

    Pi_qq = K,    Pi_qs = -b,    Pi_ss = k_held,        so    K q = b s,    F = k_held s - b . q

is the force on the tip, with the signs of `geometry.loads.Response`: positive in compression and along x.

The free sensor has no plate: its base is shaken instead, and q is the motion relative to the base. A unit motion r
of the base loads it by lambda M r (`fem.solve.reduced_basis` has lambda).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fem.accuracy import STANDARD, Accuracy
from fem.analyses.modes import (
    eigen,
    find_contact,
    frequency_unit,
    inertia_of_magnet,
    pressed_sensor,
    refuse_unstable,
)
from fem.model import coulomb_friction, element_assembly, plate_contact, single_order
from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate
from fem.results.error_estimates import solve_coarser
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import pose_slopes, read
from fem.scene import Model, Scene, choose_model, relaxed, turns
from fem.solution import Solution
from fem.solve.load_case_models import path_models
from fem.solve.load_stepping import Path
from fem.solve.newton import STOPPED, NoStateError
from fem.solve.path_state import PathState, about
from fem.solve.press import Press
from fem.solve.reduced_basis import ACCEPTED, Complex, Problem, SmallSystem, reduce
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from geometry.relaxation import Relaxation, lame, relaxation_of

__all__ = ["VibratingSensor", "Vibration", "vibrating_scene", "vibrating_sensor"]

Motion = Literal["z", "x"]
MOTIONS: tuple[Motion, ...] = ("z", "x")
"""Directions in which the plate, or the base of the free sensor, moves: z along its depth, x along the shear."""
DISPLACEMENT = {"z": np.array([0.0, 0.0, -1.0]), "x": np.array([1.0, 0.0, 0.0])}
"""Displacements by a unit motion."""
ROUNDED = 1e-9
"""Relative rounding of a frequency at an end of the band."""
LOWEST = 2
"""Number of natural frequencies without damping of each system."""
BELOW = np.geomspace(1e-12, 1.0, 49)
"""Frequencies over the lowest one of a band at which it is known whether the basis carries them too."""
ANGLES = 8
"""Angles in a quarter turn at which the pressure of order 1 is compared with that of the press."""
LOST_AREA = 0.25
"""Share of the contact area that loses its pressure at the kept amplitude. At the edge of the contact the pressure at
rest falls to 0 and its change with frozen contact is largest, so every amplitude opens some of the area. In Hertz's
contact p_0 ~ (1 - r^2/a^2)^(1/2) and dp ~ (1 - r^2/a^2)^(-1/2): the open share is amplitude / (2 depth), and any
other share follows in proportion. The first element opens at an amplitude that falls to 0 with its size."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One linear system, driven by motions of the plate or of the base.

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
    """Solve for the state under the scene's load, and return it with the systems of all motions of the plate."""
    (load,) = scene.loads
    if scene.model == "harmonic":
        path = Path(path_models(scene))
        reached = path.advance(path.rest, scene.position(load))
        state = reached.state
        if reached.stop:
            depth, along, _ = state.position * scene.design.D
            raise NoStateError(
                f"the path stops at depth {depth:.4g} mm, shear {along:.4g} mm ({STOPPED[reached.stop]}): take a "
                "smaller load"
            )
        plate, motions = state.plate, MOTIONS[1:] if load.grip is not None else MOTIONS
        if plate.friction is not None:
            plate = replace(plate, friction=coulomb_friction.expect_sticking(plate.friction))
        return state, [build_block(scene, state, plate, motions)]
    press = pressed_sensor(scene, find_contact(scene))
    free = press.edge is None
    glued = not free and load.friction == "stick"
    blocks = [_press_block(scene, press, 0, glued=glued)]
    if glued or free:  # a frictionless plate transmits no motion along x
        blocks.append(_press_block(scene, press, 1, glued=glued))
    return press.state, blocks


def _press_block(scene: Scene, press: Press, order: int, *, glued: bool) -> Block:
    """Return the system of order 0 or 1 about a press, or about the free sensor."""
    state = about(press.state, single_order.build(press.state.d, order)) if order else press.state
    plate = press.glue(state) if glued else state.plate
    return build_block(scene, state, None if press.edge is None else plate, MOTIONS[order : order + 1])


def build_block(scene: Scene, state: PathState, plate: Plate | None, motions: tuple[Motion, ...]) -> Block:
    """Return the system about a state for some motions."""
    system, inertia = state.d.system, inertia_of_magnet(scene)
    at_state = system.state(state.q)
    M = system.mass(1.0, inertia, at_state)
    if plate is None:
        here, held = system.assemble(at_state, None), np.zeros((len(motions), len(motions)))
        b = np.stack([_inertial_load(system, at_state, inertia, motion) for motion in motions], axis=1)
    else:
        plate = replace(plate, pressed=plate_contact.overlap(state.skin, at_state.u, plate) > 0)
        here, b, held = plate_loads(state, plate, motions)
    R = system.relaxing_stiffness(at_state)
    return Block(state, plate, motions, Problem(here.tangent, R, M, b, system.size - system.n_pressure), held)


def plate_loads(state: PathState, plate: Plate, motions: tuple[Motion, ...]) -> tuple[Assembly, Array, Array]:
    """Return the assembly at a state, the loads b (n, k) of unit motions of its plate, and k_held (k, k)."""
    system = state.d.system
    at_state = system.state(state.q)
    here, moved = system.assemble(at_state, plate), [_moved(plate, motion) for motion in motions]
    # the springs are linear: moving the plate with the body held changes the residual by the load
    loads = [here.residual - system.assemble(at_state, displaced, tangent=False).residual for displaced in moved]
    forces = [plate_contact.resultant(state.skin, at_state.u, each)[[0, 2]] * [-1, 1] for each in (plate, *moved)]
    held = np.stack([force - forces[0] for force in forces[1:]], axis=1)
    return here, np.stack(loads, axis=1), held[[("x", "z").index(motion) for motion in motions]]


def _moved(plate: Plate, motion: Motion) -> Plate:
    """Return the plate or grip moved by D along z (deeper) or x."""
    along, normal = plate.frame @ DISPLACEMENT[motion], plate.frame[2]
    shear = plate.shear + along[:2]
    # where the moved plane meets the axis
    height = None if plate.height is None else plate.height + along[2] / normal[2]
    return replace(plate, shear=shear, height=height)


def _inertial_load(system: System, state: State, inertia: Array, motion: Motion) -> Array:
    """Return M r (n,) for the unit motion r of the whole sensor along x or z, in a model of order 0 or 1."""
    e = system.elements
    moved = np.zeros(system.fixed.shape)
    # u_z = z_0 in the axisymmetric model, u_x = w_-1 in that of order 1
    moved[:, 1 if motion == "z" else 2] = 1.0
    forces = np.zeros(system.fixed.shape)
    np.add.at(forces, e.cells, np.einsum("mfagb,mbg->maf", element_assembly.mass(e, 1.0), moved[e.cells]))
    load = np.concatenate([forces[system.free], np.zeros(system.n_rigid + system.n_pressure)])
    if system.rigid:
        by_motion = system.rigid.derivative(system.motion(state.q))
        load[system.n_free : system.n_free + system.n_rigid] = np.einsum("nf,nfr->r", forces[system.glued], by_motion)
        load[system.n_free] += inertia[0]  # the magnet's first unknown is its displacement along the motion
    return load


@dataclass(frozen=True, slots=True, eq=False)
class ContactPressure:
    """Pressure between tip and plate: at rest, and its change with small motions; means over the lines of facets.

    area : (k,) areas that touch, over D^2; about an axisymmetric press up to a common factor.
    static : (k,) pressures at rest, over E.
    by_unknowns, by_motion : changes (k, m) for motions V of the body, and (k, j) for the plate's motions, over E.
    """

    area: Array
    static: Array
    by_unknowns: Array
    by_motion: Array


def read_pressure(block: Block, V: Array) -> ContactPressure:
    """Return the pressure of the contact area for small motions V (n, m) of a body under a plate."""
    state, plate, skin = block.state, block.plate, block.state.skin
    assert plate is not None
    system, en = state.d.system, plate.stiffness
    at_state = system.state(state.q)
    t = skin.angles
    overlap = plate_contact.overlap(skin, at_state.u, plate)
    weights = skin.weights * (overlap > 0)

    def over_lines(values: Array) -> Array:
        """Return the integrals of values (k, q) over the touching points of each facet's line, at every angle."""
        return np.asarray((weights * values).reshape(len(values), -1, t).sum(axis=1).ravel())

    area = over_lines(np.ones(weights.shape))
    divisor = np.where(area > 0, area, 1.0)
    pressure = en * over_lines(overlap) / divisor
    # the skin's displacement is linear in the unknowns, that of the magnet's surface is not
    normal = plate.frame[2]
    moves = [over_lines(skin.displacement(system.state(state.q + v).u - at_state.u) @ normal) for v in V.T]
    changes = en * np.stack(moves, axis=1) / divisor[:, None]
    plate_moves = en * np.array([[-normal @ DISPLACEMENT[motion] for motion in block.motions]] * len(area))
    if system.elements.angles.of_one_order:  # the first of its two angles is 0, where the cosine is 1
        cosines = np.cos((np.arange(ANGLES) + 0.5) * np.pi / (2 * ANGLES))
        pressure, area, plate_moves = (
            np.repeat(values[::t], ANGLES, axis=0) for values in (pressure, area, plate_moves)
        )
        changes = (changes[::t, None] * cosines[:, None]).reshape(len(area), -1)
    touching = area > 0
    return ContactPressure(area[touching], pressure[touching], changes[touching], plate_moves[touching])


@dataclass(frozen=True, slots=True, eq=False)
class Vibration:
    """Steady vibration under each motion of the plate, as complex amplitudes over that of the plate.

    About the free sensor the base is shaken, and shift and tilt are those relative to the base.

    Attributes
    ----------
    frequency : (f,) Hz.
    motions : k directions in which plate or grip move: "z" along the depth, "x" along the shear (x without a shear).
    force : (f, k, 2) force on the tip along this x and z, positive as in `Response`, N/mm; NaN without a plate.
    shift : (f, k, 2) displacement of the magnet's centre along this x and z, mm/mm.
    tilt : (f, k) lean of the magnet from z towards this x, rad/mm.
    kept_amplitude : (f, k) amplitude of the motion at which LOST_AREA of the contact area loses its pressure within
        each cycle, mm; NaN without a plate and for a grip. It needs some elements across the contact.
    """

    frequency: Array
    motions: tuple[Motion, ...]
    force: Complex
    shift: Complex
    tilt: Complex
    kept_amplitude: Array


@dataclass(frozen=True, slots=True, eq=False)
class ReducedBlock:
    """One linear system on the span of a reduced basis of m vectors, and what is read from it.

    motions, held : as of its `Block`; held is None about the free sensor.
    small : the system.
    pose : (3, m) shift along x and z over D, and lean, by the unknowns.
    pressure : that of the contact area; None without one, and for a grip.
    undamped : (LOWEST,) lowest natural frequencies without damping, over `fem.analyses.modes.frequency_unit`.
    factorisations, error : number with which the basis was built, and its largest error in the band.
    """

    motions: tuple[Motion, ...]
    held: Array | None
    small: SmallSystem
    pose: Array
    pressure: ContactPressure | None
    undamped: Array
    factorisations: int
    error: float


@dataclass(frozen=True, slots=True, eq=False)
class VibratingSensor:
    """A sensor about a state at rest, for motions at any frequency in a range.

    Attributes
    ----------
    scene : the problem, with the long-term modulus.
    state : the state at rest.
    relaxation : branches of the silicone.
    band : lowest and highest frequency for which the sensor was prepared, Hz.
    reduced_blocks : linear systems of all motions.
    errors_below : those of the reduced bases at the frequencies BELOW of the band.
    coarser : the same sensor on a coarser mesh, for estimates of errors at any frequency; None without one.
    """

    scene: Scene
    state: Solution
    relaxation: Relaxation
    band: tuple[float, float]
    reduced_blocks: tuple[ReducedBlock, ...]
    errors_below: Array
    coarser: VibratingSensor | None = None

    @property
    def factorisations(self) -> int:
        """Number of factorisations that all frequencies took."""
        return sum(part.factorisations for part in self.reduced_blocks)

    @property
    def error(self) -> float:
        """Largest error of the reduced bases, relative, see `fem.solve.reduced_basis`."""
        return max(part.error for part in self.reduced_blocks)

    def at(self, frequencies: Sequence[float] | Array) -> Vibration:
        """Return the vibration at frequencies (f,), Hz, in the band, or below it where the basis carries them.

        The static limit is always in the basis.

        Raises
        ------
        BadInput
            A frequency is above the band, up to which the mesh was checked, or one below it is not carried.
        """
        f = np.asarray(frequencies, dtype=np.float64)
        self._check_frequencies(f)
        answers = [_solve_part(part, self.scene, self.relaxation, f) for part in self.reduced_blocks]
        columns = (np.concatenate(values, axis=1) for values in zip(*answers, strict=True))
        return Vibration(f, tuple(motion for part in self.reduced_blocks for motion in part.motions), *columns)

    def _check_frequencies(self, f: Array) -> None:
        low, high = self.band
        outside = f[~((low * (1 - ROUNDED) <= f) & (f <= high * (1 + ROUNDED)))]
        below = bool((outside < low).all()) and bool((outside >= 0).all())
        if below and len(outside):
            after = np.searchsorted(low * BELOW, outside).clip(0, len(BELOW) - 1)
            errors = np.maximum(self.errors_below[after], self.errors_below[np.maximum(after - 1, 0)])
            outside = outside[errors > ACCEPTED]
        if len(outside):
            raise BadInput(
                f"this sensor was prepared for vibrations of {low:g} to {high:g} Hz; got {outside[0]:g} Hz: prepare "
                "it for a band that contains this frequency"
            )

    def static_stiffness(self) -> dict[str, float]:
        """Return the force along each motion over the motion at rest, N/mm; empty about the free sensor."""
        E, D, still = self.scene.design.E_now, self.scene.design.D, np.zeros(1)
        stiffness: dict[str, float] = {}
        for part in self.reduced_blocks:
            if part.held is not None:
                force = part.held - part.small.b.T @ part.small.solve(still.astype(complex), still)[0].real
                stiffness |= {motion: float(force[k, k]) * E * D for k, motion in enumerate(part.motions)}
        return stiffness

    def undamped(self) -> dict[str, tuple[float, ...]]:
        """Return the LOWEST natural frequencies without damping, Hz, of the motions "z", "x", or "z and x"."""
        unit = frequency_unit(self.scene.design)
        return {
            " and ".join(part.motions): tuple(float(value) * unit for value in part.undamped)
            for part in self.reduced_blocks
        }


def highest_frequency(design: Design, accuracy: Accuracy) -> float:
    """Return the highest frequency that the mesh of an accuracy level carries, Hz, for a design at rest."""
    speed = 1e3 * math.sqrt(1e6 * lame(design.E_now, design.nu)[0] / design.density)  # mm/s
    # five quadratic elements of length h to a shear wave make its speed wrong by (2 pi h / length)^4 / 1440 = 0.2 %
    # (Ainsworth 2004)
    return speed / (5 * accuracy.section_size * design.D)


def vibration_model(load: Load) -> Model:
    """Return the model of a state about which the sensor vibrates.

    Motions about a press have orders of their own if its contact is glued or frictionless; the state of Coulomb
    friction and that of a grip are in one model with all harmonics.
    """
    return "harmonic" if load.coulomb is not None or load.grip is not None else choose_model((load,), "auto")


def check_vibration(design: Design, load: Load, band: tuple[float, float], accuracy: Accuracy) -> None:
    """Refuse a band (lowest, highest), Hz, that rises not or exceeds what the mesh carries, and loads of other kinds.

    Raises
    ------
    BadInput
    """
    low, high = band
    if not 0 < low < high < math.inf:
        raise BadInput(f"frequencies must rise from above 0 Hz; got {low:g} to {high:g} Hz")
    if load.imperfection:
        raise BadInput("a vibration has no imperfection, which is a load that never rests: leave it out")
    if turns((load,)):
        raise BadInput(
            "a vibration needs a plane of symmetry: under a tilted plate the shear must be along x; leave out shear_y"
        )
    if load.plate_tilt and load.friction == "stick" and load.depth and not load.shear:
        raise BadInput(
            "under a tilted plate the contact area is glued by a shear only: give a shear along x, friction none, or "
            "a friction coefficient"
        )
    most = highest_frequency(relaxed(design, relaxation_of(design)), accuracy)
    if high > most:
        raise BadInput(
            f"the mesh of accuracy {accuracy.name} carries shear waves up to {most:.4g} Hz; got frequencies up to "
            f"{high:g} Hz: take a finer accuracy or lower frequencies"
        )


def vibrating_sensor(
    design: Design,
    load: Load,
    band: tuple[float, float],
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    check: bool = True,
    estimate: bool = False,
) -> VibratingSensor:
    """Solve for a state at rest, and prepare its vibrations at frequencies in a band (lowest, highest), Hz.

    Parameters
    ----------
    load : a press, with friction "none" or "stick" (the contact area is then glued to the plate for the vibration); a
        press and a shear in any direction with "stick"; either with a friction coefficient; a tilted plate; a grip;
        or depth 0: the free sensor, whose base is shaken.
    check : call `check_vibration`; not for other meshes that this one is compared with.
    estimate : solve on a coarser mesh too, for `fem.results.error_estimates.estimate_vibration`.

    Raises
    ------
    BadInput
        The band or the load is out of range.
    NoStateError
        The load is not reached, or the state there is unstable.
    """
    if check:
        check_vibration(design, load, band, accuracy)
    scene = vibrating_scene(design, load, accuracy, magnet)
    find = functools.partial(_solve_sensor, load=load, band=band, relaxation=relaxation_of(design))
    sensor = find(scene)
    return replace(sensor, coarser=solve_coarser(scene, find)) if estimate else sensor


def vibrating_scene(design: Design, load: Load, accuracy: Accuracy, magnet: Magnet) -> Scene:
    """Return the problem of the state at rest about which a sensor vibrates, with the long-term modulus."""
    free = not load.depth and load.grip is None
    model: Model = "axisymmetric" if free else vibration_model(load)
    return Scene(relaxed(design, relaxation_of(design)), (Load() if free else load,), accuracy, magnet, model)


def _solve_sensor(scene: Scene, load: Load, band: tuple[float, float], relaxation: Relaxation) -> VibratingSensor:
    path_state, blocks = build_blocks(scene)
    # so many frequencies that the solution holds everywhere between them
    f = np.geomspace(*band, 200)
    c, eigenvalues = _coefficients(scene, relaxation, f)
    below = _coefficients(scene, relaxation, band[0] * BELOW)
    reduced_blocks, errors = [], np.zeros(len(BELOW))
    for block in blocks:
        system = reduce(block.problem, c, eigenvalues)
        refuse_unstable(system.stability, load.depth)
        errors = np.maximum(errors, system.errors(*below))
        presses = block.plate is not None and block.plate.height is not None
        reduced_blocks.append(
            ReducedBlock(
                block.motions,
                None if block.plate is None else block.held,
                system.small,
                pose_slopes(block.state, system.V),
                read_pressure(block, system.V) if presses else None,
                np.sqrt(eigen(block.problem.K, block.problem.M, LOWEST)[0]),
                system.factorisations,
                system.error,
            )
        )
    state = _read_state(path_state, scene, load)
    return VibratingSensor(scene, state, relaxation, band, tuple(reduced_blocks), errors)


def _read_state(state: PathState, scene: Scene, load: Load) -> Solution:
    """Return the state at rest with the diagnosis of a static solve, but for the plate that sticks: here it acts."""
    told = load if load.shears_tip or load.friction != "stick" else replace(load, friction="none")
    sideways = SidewaysModel(state.d, scene.accuracy.section_size)
    return replace(read(state, scene, told, margin=sideways.margin), load=load)


def _coefficients(scene: Scene, relaxation: Relaxation, f: Array) -> tuple[Complex, Array]:
    """Return c = (g - rest) / rest and lambda = omega^2 rho D^2 / E at frequencies (f,), Hz."""
    c = relaxation.complex_modulus(2 * np.pi * f) / relaxation.rest - 1
    return np.asarray(c, dtype=np.complex128), (f / frequency_unit(scene.design)) ** 2


def _solve_part(
    part: ReducedBlock, scene: Scene, relaxation: Relaxation, f: Array
) -> tuple[Complex, Complex, Complex, Array]:
    """Return force, shift, tilt and kept amplitude of `Vibration` for the motions of one part."""
    D, E = scene.design.D, scene.design.E_now
    c, eigenvalues = _coefficients(scene, relaxation, f)
    y = part.small.solve(c, eigenvalues)
    k = len(part.motions)
    force = np.full((len(f), 2, k), np.nan, dtype=np.complex128)
    amplitude = np.full((len(f), k), np.nan)
    if part.held is None:
        y = y * eigenvalues[:, None, None]
    else:
        rows = [("x", "z").index(motion) for motion in part.motions]
        force[:] = 0.0
        force[:, rows] = (part.held - part.small.b.T @ y) * E * D
        if part.pressure is not None:
            amplitude = _kept_amplitude(part.pressure, y) * D
    pose = part.pose @ y
    swap = (0, 2, 1)
    return force.transpose(swap), pose[:, :2].transpose(swap), pose[:, 2] / D, amplitude


def _kept_amplitude(pressure: ContactPressure, y: Complex) -> Array:
    """Return the amplitude (f, k) over D at which LOST_AREA of the contact area loses its pressure in a cycle."""
    changes = np.abs(pressure.by_unknowns @ y + pressure.by_motion)
    amplitudes = pressure.static[:, None] / np.where(changes > 0, changes, np.finfo(float).tiny)
    order = np.argsort(amplitudes, axis=1)
    rising = np.take_along_axis(amplitudes, order, axis=1)
    area = np.cumsum(pressure.area[order], axis=1) / pressure.area.sum()
    # the area that a line stands for lies half below and half above its own amplitude; that of the edge is 0
    middle = area - pressure.area[order] / (2 * pressure.area.sum())
    amplitude = np.empty((len(y), y.shape[2]))
    for i, j in np.ndindex(amplitude.shape):
        amplitude[i, j] = np.interp(LOST_AREA, np.append(0.0, middle[i, :, j]), np.append(0.0, rising[i, :, j]))
    return amplitude
