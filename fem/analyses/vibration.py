"""Steady vibration of the sensor about a pressed, or pressed and sheared, state at rest.

The plate moves by s Re exp(i omega t) along z or x about a state in which all branches of the silicone are relaxed.
With g = G* / G0 the complex modulus over the instantaneous one, and rest = G(infinity) / G0,

    K*(omega) = K + (g(omega) - rest) / rest K_iso - omega^2 M,        K* q = b s,

where K is the full tangent of the state at rest (silicone, springs of the contact, magnet), K_iso its part from the
tangent of the isochoric law without geometric stiffness, and M the consistent mass of silicone and magnet. The stress
of the state at rest does not vibrate, so its geometric stiffness stays real. The bulk does not relax, and the springs
of the plate do not either. `fem.analyses.vibration_blocks` has b and the force, `fem.solve.reduced_basis` the
solutions.

The state at rest has the long-term modulus. Where the design's E is the instantaneous one, the state is that of
`relaxed`.

Limits: contact and gluing stay as they are in the state; the plate is rigid and has no mass; amplitudes are small.
The mesh must carry the shortest shear wave, of length c / f with the wave speed c = (G / rho)^(1/2) at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.accuracy import STANDARD, Accuracy
from fem.analyses.modes import eigen, frequency_unit
from fem.analyses.vibration_blocks import (
    Block,
    ContactPressure,
    Motion,
    build_blocks,
    read_pose,
    read_pressure,
)
from fem.model.material import lame
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.scene import Model, Scene, choose_model, turns
from fem.solution import Solution
from fem.solve.newton import NoStateError
from fem.solve.path_state import PathState
from fem.solve.reduced_basis import Complex, ReducedSystem, reduce
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from geometry.prony import Relaxation
from geometry.relaxation import relaxation_of

__all__ = ["VibratingSensor", "Vibration", "vibrating_sensor"]

FEWEST = 5.0
"""Fewest elements to the length of a shear wave: quadratic elements of length h then have waves that are wrong by
(2 pi h / length)^4 / 1440 = 0.2 % in speed (Ainsworth 2004)."""
BETWEEN = 200
"""Frequencies between the lowest and the highest one for which a solution holds beside those requested."""
LOST_AREA = 0.25
"""Share of the contact area that loses its pressure at the kept amplitude. At the edge of the contact the pressure at
rest falls to 0 and its change with frozen contact is largest, so every amplitude opens some of the area. In Hertz's
contact p_0 ~ (1 - r^2/a^2)^(1/2) and dp ~ (1 - r^2/a^2)^(-1/2): the open share is amplitude / (2 depth), and any
other share follows in proportion. The first element opens at an amplitude that falls to 0 with its size."""


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
class _Part:
    """One block, its reduced system, and what is read from the span of its basis."""

    block: Block
    system: ReducedSystem
    pose: Array
    pressure: ContactPressure | None


@dataclass(frozen=True, slots=True, eq=False)
class VibratingSensor:
    """A sensor about a state at rest, for motions at any frequency in a range.

    Attributes
    ----------
    scene : the problem, with the long-term modulus.
    state : the state at rest.
    relaxation : branches of the silicone.
    parts : linear systems of all motions.
    """

    scene: Scene
    state: Solution
    relaxation: Relaxation
    parts: tuple[_Part, ...]

    @property
    def factorisations(self) -> int:
        """Number of factorisations that all frequencies took."""
        return sum(part.system.factorisations for part in self.parts)

    @property
    def error(self) -> float:
        """Largest error of the reduced bases, relative, see `fem.solve.reduced_basis`."""
        return max(part.system.error for part in self.parts)

    def at(self, frequencies: Sequence[float] | Array) -> Vibration:
        """Return the vibration at frequencies (f,), Hz, in the range for which the sensor was prepared."""
        f = np.asarray(frequencies, dtype=np.float64)
        answers = [_solve_part(part, self.scene, self.relaxation, f) for part in self.parts]
        columns = (np.concatenate(values, axis=1) for values in zip(*answers, strict=True))
        return Vibration(f, tuple(motion for part in self.parts for motion in part.block.motions), *columns)

    def static_stiffness(self) -> dict[str, float]:
        """Return the force along each motion over the motion at rest, N/mm; empty about the free sensor."""
        E, D, still = self.scene.design.E, self.scene.design.D, np.zeros(1)
        stiffness: dict[str, float] = {}
        for part in self.parts:
            if part.block.plate is not None:
                force = part.block.held - part.system.b.T @ part.system.solve(still.astype(complex), still)[0].real
                stiffness |= {motion: float(force[k, k]) * E * D for k, motion in enumerate(part.block.motions)}
        return stiffness

    def undamped(self, count: int = 2) -> dict[str, tuple[float, ...]]:
        """Return the lowest natural frequencies without damping, Hz, of the motions "z", "x", or "z and x"."""
        unit = frequency_unit(self.scene.design)
        return {
            " and ".join(part.block.motions): tuple(
                float(value) * unit for value in np.sqrt(eigen(part.block.problem.K, part.block.problem.M, count)[0])
            )
            for part in self.parts
        }


def relaxed(design: Design, relaxation: Relaxation) -> Design:
    """Return the design whose E and nu are those at rest: the bulk modulus stays, the shear modulus relaxes.

    >>> from geometry.design import paper
    >>> from geometry.prony import Relaxation
    >>> import dataclasses
    >>> relaxed(dataclasses.replace(paper(), nu=0.5, modulus="instantaneous"), Relaxation((0.5,), (1.0,))).E
    0.5
    """
    if design.modulus == "long-term" or relaxation.rest == 1:
        return design
    mu, inverse_K = lame(design.E, design.nu)
    mu *= relaxation.rest
    # 9 / E = 3 / mu + 1 / K and 2 mu (1 + nu) = E
    E = 9 / (3 / mu + inverse_K)
    return replace(design, E=E, nu=E / (2 * mu) - 1)


def highest_frequency(design: Design, accuracy: Accuracy) -> float:
    """Return the highest frequency that the mesh of an accuracy level carries, Hz, for a design at rest."""
    speed = 1e3 * math.sqrt(1e6 * lame(design.E, design.nu)[0] / design.density)  # mm/s
    return speed / (FEWEST * accuracy.section_size * design.D)


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
) -> VibratingSensor:
    """Solve for a state at rest, and prepare its vibrations at frequencies in a band (lowest, highest), Hz.

    Parameters
    ----------
    load : a press, with friction "none" or "stick" (the contact area is then glued to the plate for the vibration); a
        press and a shear in any direction with "stick"; either with a friction coefficient; a tilted plate; a grip;
        or depth 0: the free sensor, whose base is shaken.
    check : call `check_vibration`; not for a coarser mesh that only estimates errors.

    Raises
    ------
    BadInput
        The band or the load is out of range.
    NoStateError
        The load is not reached, or the state there is unstable.
    """
    if check:
        check_vibration(design, load, band, accuracy)
    relaxation = relaxation_of(design)
    at_rest = relaxed(design, relaxation)
    free = not load.depth and load.grip is None
    model: Model = "axisymmetric" if free else vibration_model(load)
    scene = Scene(at_rest, (Load() if free else load,), accuracy, magnet, model)
    path_state, blocks = build_blocks(scene)
    f = np.geomspace(*band, BETWEEN)
    c, eigenvalues = _coefficients(scene, relaxation, f)
    parts = []
    for block in blocks:
        system = reduce(block.problem, c, eigenvalues)
        if not system.stability.is_stable:
            how = "is unstable" if system.stability.is_unstable else "may be unstable: its stiffness does not tell"
            raise NoStateError(f"the state at depth {load.depth:g} mm {how}: take a smaller depth")
        presses = block.plate is not None and block.plate.height is not None
        pressure = read_pressure(block, system.V) if presses else None
        parts.append(_Part(block, system, read_pose(block, system.V), pressure))
    return VibratingSensor(scene, _read_state(path_state, scene, load), relaxation, tuple(parts))


def _read_state(state: PathState, scene: Scene, load: Load) -> Solution:
    """Return the state at rest with the diagnosis of a static solve, but for the plate that sticks: here it acts."""
    sideways = SidewaysModel(state.d) if state.d.model == "axisymmetric" else None
    told = load if load.shears_tip or load.friction != "stick" else replace(load, friction="none")
    return replace(read(state, scene, told, sideways=sideways), load=load)


def _coefficients(scene: Scene, relaxation: Relaxation, f: Array) -> tuple[Complex, Array]:
    """Return c = (g - rest) / rest and lambda = omega^2 rho D^2 / E at frequencies (f,), Hz."""
    c = relaxation.complex_modulus(2 * np.pi * f) / relaxation.rest - 1
    return np.asarray(c, dtype=np.complex128), (f / frequency_unit(scene.design)) ** 2


def _solve_part(
    part: _Part, scene: Scene, relaxation: Relaxation, f: Array
) -> tuple[Complex, Complex, Complex, Array]:
    """Return force, shift, tilt and kept amplitude of `Vibration` for the motions of one part."""
    D, E, system, block = scene.design.D, scene.design.E, part.system, part.block
    c, eigenvalues = _coefficients(scene, relaxation, f)
    y = system.solve(c, eigenvalues)
    k = len(block.motions)
    force = np.full((len(f), 2, k), np.nan, dtype=np.complex128)
    kept = np.full((len(f), k), np.nan)
    if block.plate is None:
        y = y * eigenvalues[:, None, None]
    else:
        rows = [("x", "z").index(motion) for motion in block.motions]
        force[:] = 0.0
        force[:, rows] = (block.held - system.b.T @ y) * E * D
        if part.pressure is not None:
            kept = _kept_amplitude(part.pressure, y) * D
    pose = part.pose @ y
    swap = (0, 2, 1)
    return force.transpose(swap), pose[:, :2].transpose(swap), pose[:, 2] / D, kept


def _kept_amplitude(pressure: ContactPressure, y: Complex) -> Array:
    """Return the amplitude (f, k) over D at which LOST_AREA of the contact area loses its pressure in a cycle."""
    changes = np.abs(pressure.by_unknowns @ y + pressure.by_motion)
    amplitudes = pressure.at_rest[:, None] / np.where(changes > 0, changes, np.finfo(float).tiny)
    order = np.argsort(amplitudes, axis=1)
    rising = np.take_along_axis(amplitudes, order, axis=1)
    area = np.cumsum(pressure.area[order], axis=1) / pressure.area.sum()
    # the area that a line stands for lies half below and half above its own amplitude; that of the edge is 0
    middle = area - pressure.area[order] / (2 * pressure.area.sum())
    kept = np.empty((len(y), y.shape[2]))
    for i, j in np.ndindex(kept.shape):
        kept[i, j] = np.interp(LOST_AREA, np.append(0.0, middle[i, :, j]), np.append(0.0, rising[i, :, j]))
    return kept
