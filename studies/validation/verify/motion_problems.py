"""Problems in time with known answers: viscoelastic cubes and beams, a half space, steady vibrations of the sensor.

verify_problems.toml describes them, and names what each function returns. Branches and laws are those of
`fem.model.viscoelasticity`. Times are in s.
"""

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from analytic.viscoelastic_contact import indentation
from fem.accuracy import QUICK
from fem.analyses.modes import frequency_unit, modes
from fem.analyses.timed_path import TimeControl, TimedLoad, TimedState, ViscousLaw, follow
from fem.analyses.vibration import VibratingSensor, build_block, build_blocks, vibrating_sensor
from fem.equilibrium import solve as solve_load
from fem.model import elements, material, plate_contact, viscoelasticity
from fem.model.nonlinear_system import System
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.viscoelasticity import PointState
from fem.results.postprocess import pose_slopes
from fem.scene import Scene
from fem.solve.direct_solver import Solver
from fem.solve.newton import newton
from fem.solve.reduced_basis import Complex, Problem, reduce
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import Design, paper
from geometry.loads import Load
from geometry.relaxation import Relaxation, relaxation_of
from studies.mechanics import resonance_peaks
from studies.validation.verify.static_problems import LEVEL, SKIN, Mask, faces, sheared, solve, tetrahedra

TWO = Relaxation((0.3, 0.2), (0.5, 4.0))
"""Branches of the cubes, with the shear modulus 1 in the fast limit."""
OGDEN_PA, EXPONENTS = (6.3e5, 1.2e3, -1e4), (1.3, 5.0, -2.0)
"""Constants of the Ogden law of Holzapfel's block: mu_i, Pa, and alpha_i."""
SLOW = 1e-7
"""1/K of cubes, small enough for their volume and large enough to determine the pressure."""


def stresses(
    e: elements.Elements,
    fixed: Mask,
    law: material.Law,
    branches: Relaxation,
    motion: Sequence[tuple[float, Array]],
    viscous: ViscousLaw = "prony",
    instantaneous: float = 1.0,
) -> Iterator[Array]:
    """Yield V sigma (3, 3) of a unit cube after each step (length in s, displacements)."""
    system, q = System(e, None, (1.0, SLOW), fixed, law=law), None
    history = viscoelasticity.at_rest(viscous, branches, (1, *e.weights.shape), instantaneous)
    for dt, moved in motion:
        stepped = system.with_prescribed(moved, np.zeros((len(system.corner_nodes), 1)))
        stepped.viscous = history.overstress(dt)
        answer = solve(stepped, moved) if q is None else solve(stepped, q=q)
        q = answer.state.q
        history = history.advance(viscoelasticity.measure(system.elements, law, system.mu, answer.state.u), dt)
        yield np.asarray(answer.assembly.forces.T @ (e.nodes + answer.state.u))


def relaxing_cube(_: int) -> list[float]:
    e = tetrahedra(1)
    motion = [(dt, sheared(0.8, e)) for dt in (0.0, 0.3, 2.7)]
    found = zip(stresses(e, faces(e), material.neo_hookean, TWO, motion), TWO.modulus([0.0, 0.3, 3.0]), strict=True)
    return [value for sigma, G in found for value in (sigma[0, 2] / G, (sigma[0, 0] - sigma[2, 2]) / G)]


def turned_cube(_: int) -> tuple[float, ...]:
    e, axis = tetrahedra(1), np.array([1.0, 2.0, 2.0]) / 3
    amounts = 0.6 * np.sin(math.pi / 8 * np.arange(1, 9))
    turns = [Rotation.from_rotvec(2 / 8 * i * axis).as_matrix() for i in range(1, 9)]
    upright = [(0.2, sheared(float(amount), e)) for amount in amounts]
    turned = [(dt, (e.nodes + u) @ R.T - e.nodes) for (dt, u), R in zip(upright, turns, strict=True)]

    def difference(viscous: ViscousLaw) -> float:
        first, second = (
            np.array(list(stresses(e, faces(e), material.neo_hookean, TWO, motion, viscous)))
            for motion in (upright, turned)
        )
        back = [R.T @ sigma @ R for R, sigma in zip(turns, second, strict=True)]
        return 1 - float(np.abs(np.array(back) - first).max() / np.abs(first).max())

    return difference("prony"), difference("finite")


def cyclic_cube(n: int) -> tuple[float, float]:
    e, size, omega = tetrahedra(1), 1e-3, 0.4 * math.pi
    dt, count = 2 * math.pi / omega / n, 6 * n
    times = dt * np.arange(1, count + 1)
    motion = [(dt, sheared(size * math.sin(omega * t), e)) for t in times]
    stress = np.array([sigma[0, 2] for sigma in stresses(e, faces(e), material.neo_hookean, TWO, motion)])
    measured = 2j * (stress[-n:] / size * np.exp(-1j * omega * times[-n:])).mean()
    exact = complex(TWO.complex_modulus(omega))
    return float(measured.real / exact.real), float(measured.imag / exact.imag)


def holzapfel_block(n: int) -> tuple[float, float]:
    e = tetrahedra(1)
    slow = sum(mu * a for mu, a in zip(OGDEN_PA, EXPONENTS, strict=True)) / 2
    shares = tuple(mu * a / 2 / slow for mu, a in zip(OGDEN_PA, EXPONENTS, strict=True))

    law = functools.partial(material.ogden, alphas=EXPONENTS, shares=shares)
    fixed = e.nodes < SKIN
    fixed[:, 2] |= e.nodes[:, 2] > 1 - SKIN
    times = 4 / n * np.arange(1, 4 * n + 1)
    sizes = 0.1 * np.ceil(times / 4 - 1e-9)
    strains = [*(sizes * np.sin(math.pi / 2 * times)), *np.zeros(n // 4)]
    steps = [4 / n] * (4 * n) + [16 / n] * (n // 4)
    branches = Relaxation((1 / 3, 1 / 3), (0.4, 0.2))
    motion = [(dt, e.nodes * [0.0, 0.0, strain]) for dt, strain in zip(steps, strains, strict=True)]
    found = stresses(e, fixed, law, branches, motion, instantaneous=3.0)
    axial = [slow * float(sigma[2, 2] - sigma[0, 0]) for sigma in found]
    return axial[4 * n - 1], 1 - axial[-1] / axial[4 * n - 1]


def silicone(nu: float = 0.5) -> Design:
    """Return the paper's sensor with two branches, E in the fast limit."""
    return replace(paper(), nu=nu, prony="0.3:0.5 0.2:4", modulus="instantaneous")


def _solved(states: Iterator[TimedState]) -> list[TimedState]:
    passed = list(states)
    if passed[-1].solution.status not in ("ok", "unstable"):
        raise SolveFailed(passed[-1].solution.message)
    return passed


def held_beam(_: int) -> Array:
    design, times = silicone(), (0.0, 0.3, 2.0)
    loads = [TimedLoad(t, Load(1.0)) for t in times]
    path = follow(design, loads, QUICK, magnet="ignored", steps=TimeControl(kappa=1e6))
    forces = np.array([one.solution.response.force[2] for one in _solved(path)])
    return np.asarray((forces / forces[0] / relaxation_of(design).modulus(times))[1:])


def indented_half_space(n: int) -> Array:
    design, top = silicone(), 1e-4
    times, depths = np.array([0.0, 0.5, 1.0, 1.1]), top * np.array([0.0, 0.5, 1.0, 0.9])
    loads = [TimedLoad(float(t), Load(float(d))) for t, d in zip(times[1:], depths[1:], strict=True)]
    states = _solved(follow(design, loads, LEVEL[n - 1], magnet="ignored", steps=TimeControl(largest_step=0.01)))
    G0 = design.E / 3
    exact, _ = indentation(relaxation_of(design), G0, design.R, times, depths)
    elastic = solve_load(design, Load(top), LEVEL[n - 1], magnet="ignored").response.force[2]
    mesh = elastic / (16 / 3 * math.sqrt(design.R) * G0 * top**1.5)
    return np.asarray([one.solution.response.force[2] for one in states] / exact[1:] / mesh)


def limits(_: int) -> tuple[float, ...]:
    design, ratios = silicone(0.4998), []
    mu, bulk = design.E / (2 * (1 + design.nu)), design.E / (3 * (1 - 2 * design.nu))
    for share, duration in ((1.0, 1e-6), (0.5, 1e7)):
        G = share * mu
        elastic = replace(design, E=9 * bulk * G / (3 * bulk + G), nu=(3 * bulk - 2 * G) / (2 * (3 * bulk + G)))
        exact = solve_load(elastic, Load(1.0), QUICK).response.force[2]
        for law in ("prony", "finite"):
            kappa = SECTION_KAPPA * elastic.E / design.E
            loads = [TimedLoad(duration, Load(1.0))]
            (state,) = _solved(follow(design, loads, QUICK, law=law, steps=TimeControl(kappa=kappa)))
            ratios.append(state.solution.response.force[2] / exact)
    return tuple(ratios)


@functools.lru_cache
def sheared_beam(n: int) -> tuple[float, ...]:
    """Return stored and dissipated energy over the work, and the force, N, of a gripped tip, for both laws.

    The grip moves by 1 mm to one side, to the other, and back, in n time steps each way. No point touches or leaves
    anything, so the errors have a power of the step.
    """
    accuracy = replace(QUICK, section_size=0.3, section_patch=0.1, harmonics=1)
    loads = [TimedLoad(t, Load(shear_x=x, grip=1.0)) for t, x in ((1.0, 1.0), (2.0, -1.0), (3.0, 1.0))]
    values: list[float] = []
    for law in ("prony", "finite"):
        path = follow(silicone(0.4998), loads, accuracy, law=law, steps=TimeControl(0.9, 1 / n))
        last = _solved(path)[-1]
        values += [(last.solution.energy + last.dissipated) / last.work, last.solution.response.force[0]]
    return tuple(values)


def balance(n: int) -> tuple[float, float]:
    first, _, second, _ = sheared_beam(n)
    return first, second


Friction = float | Literal["none", "stick"]


@functools.lru_cache
def touched_beam(n: int, law: ViscousLaw, friction: Friction) -> tuple[float, float]:
    accuracy = replace(QUICK, section_size=0.3, section_patch=0.1, harmonics=1)
    loads, begin = [TimedLoad(1.0, Load(1.0)), TimedLoad(2.0, Load(0.0))], 0.0
    if friction != "none":
        way, begin = (0.0, 0.5, -0.5, 0.5), 1.25
        loads = [TimedLoad(0.25 + i, Load(1.0, x, friction=friction)) for i, x in enumerate(way)]
    path = follow(silicone(0.4998), loads, accuracy, law=law, steps=TimeControl(0.9, 1 / n), every_step=True)
    states = _solved(path)
    before = [0.0, *(one.balance for one in states if one.time <= begin)]
    error = np.max([abs(one.balance - before[-1]) for one in states if one.time >= begin])
    lost = np.array([(0.0, 0.0), *((one.dissipated, one.solution.dissipated) for one in states)])
    gained = np.diff(lost, axis=0)
    negative = float(np.maximum(-gained, 0.0).sum() / gained.sum())
    return 1 - float(error / np.max([one.work for one in states])), 1 - negative


def change(n: int) -> tuple[float, float]:
    coarse, fine = sheared_beam(n), sheared_beam(2 * n)
    return abs(coarse[1] - fine[1]), abs(coarse[3] - fine[3])


# The sign of the dissipation of a point
#
# A point of an incompressible neo-Hookean silicone with one branch, g = 0.5, is sheared and stretched in a sine wave.
# A step of time dissipates dD = S : dC/2 - dW, with the stored energy W of `fem.model`. By the law "finite" no step
# has dD < 0. By the law "prony" W is exact at small strain only: quick motions of large strain have steps of dD < 0,
# while a closed cycle in steady motion, in which W returns to its value, dissipates.

SHEARS = (0.1, 0.5, 1.5)
"""Largest shears of the cycles."""
STRETCHES = (0.05, 0.3, 0.7)
"""Largest logarithmic strains of the cycles along one axis, without a change of volume."""
RATES = (0.1, 1.0, 10.0)
"""Angular frequencies times the time of the branch."""
CYCLES = 4


def deformed(wave: float) -> PointState:
    """Return the state of all points, (6, 1, shears and stretches, 1), at a share of their largest strains."""
    a, e = wave * np.array(SHEARS), wave * np.array(STRETCHES)
    C = np.zeros((6, 1, len(a) + len(e), 1))
    # F = 1 + a e_x e_z, and F = diag(exp(-e/2), exp(-e/2), exp(e))
    C[:3, 0, : len(a), 0] = np.ones_like(a), np.ones_like(a), 1 + a**2
    C[4, 0, : len(a), 0] = a
    C[:3, 0, len(a) :, 0] = np.exp(-e), np.exp(-e), np.exp(2 * e)
    one, unit = np.ones(C.shape[1:]), np.zeros(C.shape)
    unit[:3] = 1.0
    # a branch that has not flown is the neo-Hookean law
    W, S = viscoelasticity.branch_stress(unit, np.zeros(C.shape[1:]), C, one, one)
    return PointState(C, one, W, S, one, one)


def point_cycle(law: ViscousLaw, rate: float, n: int) -> tuple[Array, Array]:
    """Return work and dissipation (steps, points) in n steps of the last cycle; rate: angular frequency times tau."""
    branches = Relaxation((0.5,), (1.0,))
    point = deformed(0.0)
    history = viscoelasticity.at_rest(law, branches, point.J.shape)
    work, stored = [], [history.density(point).ravel()]
    stress = history.stress(point)
    for i in range(1, CYCLES * n + 1):
        after = deformed(math.sin(2 * math.pi * i / n))
        history = history.advance(after, 2 * math.pi / (rate * n))
        reached = history.stress(after)
        work.append(viscoelasticity.contract(stress + reached, after.C - point.C).ravel() / 4)
        stored.append(history.density(after).ravel())
        point, stress = after, reached
    return np.array(work)[-n:], np.array(work)[-n:] - np.diff(stored, axis=0)[-n:]


@functools.lru_cache
def signs(law: ViscousLaw, n: int) -> tuple[Array, Array]:
    """Return the least work of a cycle over its moved work, and the least dissipation of a step over the most work,
    each (points,), over all `RATES`."""
    cycles = [point_cycle(law, rate, n) for rate in RATES]
    closed = [work.sum(axis=0) / np.abs(work).sum(axis=0) for work, _ in cycles]
    steps = [lost.min(axis=0) / np.abs(work).max(axis=0) for work, lost in cycles]
    return np.min(closed, axis=0), np.min(steps, axis=0)


def negative_dissipation(n: int) -> tuple[float, ...]:
    (linear, _), (finite, steps) = signs("prony", n), signs("finite", n)
    return tuple(1 - float(np.maximum(0.0, -values.min())) for values in (linear, finite, steps))


# Steady vibrations of the paper's sensor at level quick

GLUED = Load(depth=1.0, friction="stick")
SHEARED = Load(depth=1.0, shear_x=0.5, friction="stick")
STEP = 1e-5
"""Motion of the plate, over D, to both sides of a state for the slope of its force."""


def slow_limit(_: int) -> tuple[float, ...]:
    sensor = vibrating_sensor(paper(), SHEARED, (1e-6, 1.0), QUICK)
    force, unit = sensor.at([1e-6]).force[0].real, sensor.scene.design.E * sensor.scene.design.D
    (block,) = build_blocks(sensor.scene)[1]
    state, plate = block.state, block.plate
    assert plate is not None
    assert plate.height is not None
    ratios, solver = [], Solver()
    for motion, (along, down, component) in {"z": (0.0, 1.0, 1), "x": (1.0, 0.0, 0)}.items():
        forces = []
        for way in (STEP, -STEP):
            shear = plate.shear + np.array([way * along, 0.0])
            moved = replace(plate, height=plate.height - way * down, shear=shear)
            reached = newton(state.d.system, solver, state.q, moved, moved.pressed).state
            traction = plate_contact.springs(state.skin, reached.u, moved).traction
            forces.append(np.einsum("kq,kqi->i", state.skin.weights, traction)[[0, 2]] * [-1.0, 1.0])
        slope = (forces[0] - forces[1])[component] / (2 * STEP) * unit
        ratios.append(float(force[block.motions.index(motion), component] / slope))
    return tuple(ratios)


def undamped_resonances(_: int) -> tuple[float, ...]:
    ratios = []
    for load in (Load(), GLUED):
        natural = modes(paper(), count=8, depth=load.depth, accuracy=QUICK, estimate=False)
        sensor = vibrating_sensor(replace(paper(), loss_factor=0.0), load, (1.0, 2000.0), QUICK)
        for k, (shape, component) in enumerate((("axial", 1), ("bending", 0))):
            own = natural.frequency[natural.shape.index(shape)]

            def inverse(f: float, k: int = k, component: int = component, sensor: VibratingSensor = sensor) -> float:
                return 1 / float(sensor.at([f]).shift[0, k, component].real)

            ratios.append(float(brentq(inverse, 0.98 * own, 1.02 * own, xtol=1e-9)) / own)
    return tuple(ratios)


def half_power_width(_: int) -> tuple[float, ...]:
    loss = 0.01
    sensor = vibrating_sensor(replace(paper(), loss_factor=loss), Load(), (100.0, 1000.0), QUICK)
    peak = resonance_peaks.peaks(lambda f: np.abs(sensor.at(f).shift[:, 1, 0]), 100.0, 1000.0)[0]
    assert peak.width is not None
    return (peak.width / peak.frequency / loss,)


def correspondence(_: int) -> tuple[float, ...]:
    design, answers = replace(paper(), nu=0.5), []
    relaxation = relaxation_of(design)
    g = relaxation.complex_modulus(2 * np.pi * np.array([0.1, 10.0, 1000.0])) / relaxation.rest
    scene = Scene(design, (Load(depth=0.5, friction="stick"),), QUICK, "ignored")
    for pressed in build_blocks(scene)[1]:
        d, q = pressed.state.d, np.zeros(len(pressed.state.q))
        if pressed.motions == ("x",):  # this model has the press as prescribed displacements and pressures
            rest = np.zeros(d.system.fixed.shape), np.zeros((len(d.system.corner_nodes), 2))
            d = replace(d, system=d.system.with_prescribed(*rest))
        # the contact area is that of a press, but the state is undeformed
        block = build_block(scene, replace(pressed.state, d=d, q=q), pressed.plate, pressed.motions)
        system, problem = block.state.d.system, block.problem
        R = problem.R.copy()
        R.data += problem.K.data - system.assemble(system.state(block.state.q), None).tangent.data
        # the first frequency is that of the static stiffness
        factors = np.concatenate([[1.0], g])
        reduced = reduce(replace(problem, R=R), factors - 1, np.zeros(len(factors)))
        y = reduced.small.solve(factors - 1, np.zeros(len(factors)))
        Z = factors * block.held[0, 0] - factors**2 * (reduced.small.b.T @ y)[:, 0, 0]
        answers.append(1 + float(np.abs(Z[1:] / (Z[0].real * g) - 1).max()))
    return tuple(answers)


def reciprocity_and_passivity(_: int) -> tuple[float, ...]:
    force = vibrating_sensor(paper(), SHEARED, (1.0, 1000.0), QUICK).at(np.geomspace(1.0, 1000.0, 60)).force
    impedance = force[:, :, [1, 0]]
    work = np.linalg.eigvalsh((impedance.imag + impedance.imag.transpose(0, 2, 1)) / 2)
    differences = np.abs(impedance[:, 0, 1] - impedance[:, 1, 0]) / np.abs(impedance).max(axis=(1, 2))
    return 1 + float(differences.max()), float(np.mean(work.min(axis=1) > 0))


def full_solutions(_: int) -> Array:
    sensor = vibrating_sensor(paper(), GLUED, (1.0, 1000.0), QUICK)
    unit = frequency_unit(sensor.scene.design)
    differences = []
    pairs = zip(sensor.reduced_blocks, build_blocks(sensor.scene)[1], strict=True)
    for (part, block), f in itertools.product(pairs, (1.0, 600.0, 1000.0)):
        g = complex(sensor.relaxation.complex_modulus(2 * np.pi * f)) / sensor.relaxation.rest
        c, eigenvalue = g - 1, (f / unit) ** 2
        x = full_solution(block.problem, c, eigenvalue)
        y = part.small.solve(np.array([c]), np.array([eigenvalue]))[0]
        full = block.held - block.problem.b.T @ x
        reduced = block.held - part.small.b.T @ y
        pose = pose_slopes(block.state, x.real) + 1j * pose_slopes(block.state, x.imag)
        compared = (reduced, full), (part.pose @ y, pose)
        differences.append([np.abs(a - b).max() / np.abs(b).max() for a, b in compared])
    return np.asarray(1 + np.max(differences, axis=0))


def full_solution(problem: Problem, c: complex, eigenvalue: float) -> Complex:
    """Return the solution of A x = b with A = P + i Q, as the symmetric real system [[P, -Q], [-Q, -P]] (x', x'')."""
    K, R, M = (matrix + sp.triu(matrix, 1).T for matrix in (problem.K, problem.R, problem.M))
    P, Q = K + c.real * R - eigenvalue * M, c.imag * R
    A, b = sp.bmat([[P, -Q], [-Q, -P]], format="csr"), np.vstack([problem.b, np.zeros(problem.b.shape)])
    solver = Solver()
    solver.factorise(sp.triu(A, format="csr"))
    x = solver.solve(b)
    x += solver.solve(b - A @ x)
    return np.asarray(x[: len(problem.b)] + 1j * x[len(problem.b) :])
