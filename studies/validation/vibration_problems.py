"""Problems of steady vibration with known answers: slow limit, resonances, damping, symmetries, full solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq

from fem.accuracy import QUICK, Accuracy
from fem.analyses.modes import frequency_unit, modes
from fem.analyses.vibration import Block, VibratingSensor, build_block, build_blocks, vibrating_sensor
from fem.model import plate_contact
from fem.results.postprocess import pose_slopes
from fem.scene import Scene
from fem.solve.direct_solver import Solver
from fem.solve.newton import newton
from fem.solve.reduced_basis import Complex, Problem, reduce
from geometry.design import paper
from geometry.loads import Load
from geometry.relaxation import relaxation_of
from studies.simulation import resonance_peaks

GLUED = Load(depth=1.0, friction="stick")
SHEARED = Load(depth=1.0, shear_x=0.5, friction="stick")
STEP = 1e-5
"""Motion of the plate, over D, to both sides of a state for the slope of its force."""


def slow_limit(accuracy: Accuracy = QUICK) -> tuple[float, ...]:
    """Return force per mm of the slowest vibration over the slope of the force of nonlinear solves, along z and x.

    The solves move the plate to both sides of a press and shear with the long-term modulus; the contact is frozen.
    """
    sensor = vibrating_sensor(paper(), SHEARED, (1e-6, 1.0), accuracy)
    force, unit = sensor.at([1e-6]).force[0].real, sensor.scene.design.E * sensor.scene.design.D
    (part,) = sensor.parts
    state, plate = part.block.state, part.block.plate
    assert plate is not None
    assert plate.height is not None
    ratios, solver = [], Solver()
    try:
        for motion, (along, down, component) in {"z": (0.0, 1.0, 1), "x": (1.0, 0.0, 0)}.items():
            forces = []
            for way in (STEP, -STEP):
                shear = plate.shear + np.array([way * along, 0.0])
                moved = replace(plate, height=plate.height - way * down, shear=shear)
                reached = newton(state.d.system, solver, state.q, moved, moved.pressed).state
                traction = plate_contact.springs(state.skin, reached.u, moved).traction
                forces.append(np.einsum("kq,kqi->i", state.skin.weights, traction)[[0, 2]] * [-1.0, 1.0])
            slope = (forces[0] - forces[1])[component] / (2 * STEP) * unit
            ratios.append(float(force[part.block.motions.index(motion), component] / slope))
    finally:
        solver.close()
    return tuple(ratios)


def undamped_resonances(accuracy: Accuracy = QUICK) -> tuple[float, ...]:
    """Return frequencies at which the motion of an elastic sensor changes its sign over its natural frequencies.

    Free and pressed, axial and bending.
    """
    ratios = []
    for load in (Load(), GLUED):
        natural = modes(paper(), count=8, depth=load.depth, accuracy=accuracy, estimate=False)
        sensor = vibrating_sensor(replace(paper(), loss_factor=0.0), load, (1.0, 2000.0), accuracy)
        for k, (shape, component) in enumerate((("axial", 1), ("bending", 0))):
            own = natural.frequency[natural.shape.index(shape)]

            def inverse(f: float, k: int = k, component: int = component, sensor: VibratingSensor = sensor) -> float:
                return 1 / float(sensor.at([f]).shift[0, k, component].real)

            ratios.append(float(brentq(inverse, 0.98 * own, 1.02 * own, xtol=1e-9)) / own)
    return tuple(ratios)


def half_power_width(loss: float = 0.01, accuracy: Accuracy = QUICK) -> tuple[float, ...]:
    """Return the half-power width of the free sensor's bending resonance over its frequency and the loss factor.

    Without a load there is no geometric stiffness, and all stiffness of an incompressible solid relaxes.
    """
    sensor = vibrating_sensor(replace(paper(), loss_factor=loss), Load(), (100.0, 1000.0), accuracy)
    (peak, *_) = resonance_peaks.peaks(lambda f: np.abs(sensor.at(f).shift[:, 1, 0]), 100.0, 1000.0)
    assert peak.width is not None
    return (peak.width / peak.frequency / loss,)


def correspondence(accuracy: Accuracy = QUICK) -> tuple[float, ...]:
    """Return 1 plus the relative difference of K*(omega) to K G*(omega) / G(infinity), along z and x.

    The beam is all silicone with nu = 0.5 and without mass. The contact area of a press is glued to the plate, and
    the beam vibrates about its undeformed state, which has no geometric stiffness. The springs of the plate, which do
    not relax in a sensor, relax with the silicone here: their compliance must not count.
    """
    design, answers = replace(paper(), nu=0.5), []
    relaxation = relaxation_of(design)
    g = relaxation.complex_modulus(2 * np.pi * np.array([0.1, 10.0, 1000.0])) / relaxation.rest
    scene = Scene(design, (Load(depth=0.5, friction="stick"),), accuracy, "ignored")
    for pressed in build_blocks(scene)[1]:
        block = _undeformed(scene, pressed)
        system, problem = block.state.d.system, block.problem
        springs = problem.K - system.assemble(system.state(block.state.q), None).tangent
        relaxing = replace(problem, R=(problem.R + springs).tocsr())
        # the first frequency is that of the static stiffness
        factors = np.concatenate([[1.0], g])
        reduced = reduce(relaxing, factors - 1, np.zeros(len(factors)))
        y = reduced.solve(factors - 1, np.zeros(len(factors)))
        Z = factors * block.held[0, 0] - factors**2 * (reduced.b.T @ y)[:, 0, 0]
        answers.append(1 + float(np.abs(Z[1:] / (Z[0].real * g) - 1).max()))
    return tuple(answers)


def _undeformed(scene: Scene, pressed: Block) -> Block:
    """Return the block whose contact area is that of a press, but whose state is undeformed."""
    d, q = pressed.state.d, np.zeros(len(pressed.state.q))
    if pressed.motions == ("x",):  # this model has the press as prescribed displacements and pressures
        at_rest = d.system.with_prescribed(np.zeros(d.system.fixed.shape), np.zeros((len(d.system.corner_nodes), 2)))
        d = replace(d, system=at_rest)
    return build_block(scene, replace(pressed.state, d=d, q=q), pressed.plate, pressed.motions)


def reciprocity_and_passivity(accuracy: Accuracy = QUICK) -> tuple[float, ...]:
    """Return 1 plus the largest asymmetry of the impedance about a sheared state, and the share of frequencies at
    which every motion of the plate takes up work.
    """
    force = vibrating_sensor(paper(), SHEARED, (1.0, 1000.0), accuracy).at(np.geomspace(1.0, 1000.0, 60)).force
    impedance = force[:, :, [1, 0]]
    work = np.linalg.eigvalsh((impedance.imag + impedance.imag.transpose(0, 2, 1)) / 2)
    differences = np.abs(impedance[:, 0, 1] - impedance[:, 1, 0]) / np.abs(impedance).max(axis=(1, 2))
    return 1 + float(differences.max()), float(np.mean(work.min(axis=1) > 0))


def full_solutions(accuracy: Accuracy = QUICK) -> tuple[float, ...]:
    """Return 1 plus the relative difference of the reduced basis to full solutions: force, and pose of the magnet."""
    sensor = vibrating_sensor(paper(), GLUED, (1.0, 1000.0), accuracy)
    unit = frequency_unit(sensor.scene.design)
    forces, poses = list[float](), list[float]()
    for part in sensor.parts:
        for f in (1.0, 600.0, 1000.0):
            g = complex(sensor.relaxation.complex_modulus(2 * np.pi * f)) / sensor.relaxation.rest
            c, eigenvalue = g - 1, (f / unit) ** 2
            x = full_solution(part.block.problem, c, eigenvalue)
            y = part.system.solve(np.array([c]), np.array([eigenvalue]))[0]
            full = part.block.held - part.block.problem.b.T @ x
            reduced = part.block.held - part.system.b.T @ y
            pose = pose_slopes(part.block.state, x.real) + 1j * pose_slopes(part.block.state, x.imag)
            forces.append(float(np.abs(reduced - full).max() / np.abs(full).max()))
            poses.append(float(np.abs(part.pose @ y - pose).max() / np.abs(pose).max()))
    return 1 + float(np.max(forces)), 1 + float(np.max(poses))


def full_solution(problem: Problem, c: complex, eigenvalue: float) -> Complex:
    """Return the solution of A x = b with A = P + i Q, as the symmetric real system [[P, -Q], [-Q, -P]] (x', x'')."""
    K, R, M = (matrix + sp.triu(matrix, 1).T for matrix in (problem.K, problem.R, problem.M))
    P, Q = K + c.real * R - eigenvalue * M, c.imag * R
    A, b = sp.bmat([[P, -Q], [-Q, -P]], format="csr"), np.vstack([problem.b, np.zeros(problem.b.shape)])
    solver = Solver()
    try:
        solver.factorise(sp.triu(A, format="csr"))
        x = solver.solve(b)
        x += solver.solve(b - A @ x)
    finally:
        solver.close()
    return np.asarray(x[: len(problem.b)] + 1j * x[len(problem.b) :])
