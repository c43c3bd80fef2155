"""The linear systems of small vibrations, against nonlinear solves and by invariants."""

import copy
import functools
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.accuracy import QUICK
from fem.analyses import vibration_blocks
from fem.analyses.small_shear import small_shear
from fem.model import element_integrals, material, plate_contact
from fem.scene import Scene
from fem.solve.direct_solver import Solver
from fem.solve.newton import newton
from geometry.design import paper
from geometry.loads import Load

LAWS = {
    "neo-hookean": material.neo_hookean,
    "mooney-rivlin": material.law("mooney-rivlin", (0.4,)),
    "yeoh": material.law("yeoh", (0.1, 0.01)),
    "ogden": material.law("ogden", (1.3, -2.0, 0.3)),
}
PRESSED, GLUED = Load(depth=1.0), Load(depth=1.0, friction="stick")
SHEARED = Load(depth=1.0, shear_x=0.5, friction="stick")


@functools.cache
def blocks(load, magnet="rigid"):
    return vibration_blocks.build_blocks(Scene(paper(), (load,), QUICK, magnet))[1]


def whole(upper):
    return (upper + sp.triu(upper, 1).T).tocsc()


def static(block):
    """Unknowns (n, k), and force of the plate (k, k), for unit motions at rest."""
    x = spla.spsolve(whole(block.problem.K), block.problem.b).reshape(block.problem.b.shape)
    return x, block.held - block.problem.b.T @ x


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("load", [PRESSED, SHEARED])
def test_the_relaxing_stiffness_is_the_change_of_the_second_piola_stress(law, load):
    path = blocks(load)[0].state
    system = copy.copy(path.d.system)
    # the loops of the solve have its law
    system.__dict__.pop("_loops", None)
    system.law, state = LAWS[law], system.state(path.q)
    e, along = system.elements, np.zeros(system.size)
    along[: system.n_free] = np.random.default_rng(1).normal(size=system.n_free)
    v = system.state(along).u - system.state(np.zeros(system.size)).u

    def work(step):
        """Stress at u + step v, times the change of the strain at u along v."""
        G = element_integrals.gradient(e, slice(None), state.u + step * v)
        _, P, _ = material.evaluate(LAWS[law], G, system.mu, tangent=False)
        inverse = np.linalg.inv(np.moveaxis(G, (0, 1), (-2, -1)) + np.eye(3))
        S = np.einsum("mqJi,iLmq->JLmq", inverse, P)
        F = element_integrals.gradient(e, slice(None), state.u) + np.eye(3)[:, :, None, None]
        dE = np.einsum("iJ...,iL...->JL...", F, element_integrals.gradient(e, slice(None), v))
        return np.einsum("JLmq,JLmq,mq->", S, dE, element_integrals.volumes(e))

    step = 1e-7
    expected = (work(step) - work(-step)) / (2 * step)
    upper = system.relaxing_stiffness(state)
    assert 2 * along @ (upper @ along) - along**2 @ upper.diagonal() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("load", "motion"), [(PRESSED, 0), (SHEARED, 0), (SHEARED, 1)])
def test_the_static_stiffness_is_the_slope_of_the_force_with_frozen_contact(load, motion):
    block = blocks(load)[0]
    state, system, step, solver = block.state, block.state.d.system, 1e-5, Solver()
    change = {"z": np.array([0.0, 1.0]), "x": np.array([1.0, 0.0])}[block.motions[motion]]
    forces = []
    for way in (step, -step):
        shear = block.plate.shear + np.array([way * change[0], 0.0])
        moved = replace(block.plate, height=block.plate.height - way * change[1], shear=shear)
        reached = newton(system, solver, state.q, moved, moved.pressed)
        assert not reached.reason
        traction = plate_contact.springs(state.skin, reached.state.u, moved).traction
        forces.append(np.einsum("kq,kqi->i", state.skin.weights, traction) * [-1, 1, 1])
    solver.close()
    slope = (forces[0] - forces[1]) / (2 * step)
    expected = slope[[{"z": 2, "x": 0}[name] for name in block.motions]]
    assert static(block)[1][:, motion] == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_shift_and_tilt_of_a_slow_motion_along_x_are_those_of_a_small_shear(magnet):
    block = blocks(GLUED, magnet)[1]
    x, force = static(block)
    shift, _, tilt = vibration_blocks.read_pose(block, x)[:, 0]
    small = small_shear(paper(), 1.0, magnet, accuracy=replace(QUICK, section_size=0.1), estimate=False)
    # the meshes differ
    assert force[0, 0] * paper().E * paper().D == pytest.approx(small.stiffness, rel=0.01)
    assert shift == pytest.approx(small.shift, rel=0.01)
    assert tilt / paper().D == pytest.approx(small.tilt, rel=0.01)


def test_forces_are_reciprocal_about_a_sheared_state():
    force = static(blocks(SHEARED)[0])[1]
    assert force[0, 1] == pytest.approx(force[1, 0], rel=1e-8)
    assert abs(force[0, 1]) > 1e-3 * force[0, 0]


def test_the_pressure_of_the_contact_sums_to_the_force():
    block = blocks(PRESSED)[0]
    x, force = static(block)
    pressure = vibration_blocks.read_pressure(block, x)
    change = (pressure.by_unknowns + pressure.by_motion)[:, 0]
    assert pressure.area @ change == pytest.approx(force[0, 0], rel=1e-9)


@pytest.mark.parametrize("order", [0, 1])
def test_a_shaken_base_loads_the_free_sensor_with_its_whole_mass(order):
    """The work of the load on the rigid motion along it is the mass of silicone and magnet."""
    block, design = blocks(Load())[order], paper()
    system, load = block.state.d.system, block.problem.b[:, 0]
    u, moves = np.zeros(system.fixed.shape), system.free & False
    moves[:, (1, 2)[order]] = True
    u[moves & system.free] = 1.0
    r = system.unknowns(
        u, np.zeros((len(system.corner_nodes), system.elements.angles.pressures)), np.eye(2)[0][: system.n_rigid]
    )
    core = np.pi * design.magnet_diameter**2 / 4 * design.magnet_height
    mass = (
        design.magnet_density / design.density * core + np.sum(system.elements.weights) * 2 * np.pi * design.D**3
    ) / design.D**3
    # the clamped nodes of the lowest elements do not move in r
    assert mass * 0.97 < load @ r < mass


def test_a_free_slide_transmits_no_motion_along_x():
    assert [block.motions for block in blocks(PRESSED)] == [("z",)]
    assert [block.motions for block in blocks(GLUED)] == [("z",), ("x",)]
