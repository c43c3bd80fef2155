"""Steady vibration about pressed and sheared states, by invariants and against other solves."""

import copy
import functools
import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.accuracy import QUICK, STANDARD
from fem.analyses import vibration
from fem.analyses.small_shear import small_shear
from fem.analyses.vibration import build_blocks
from fem.equilibrium import solve
from fem.model import elements, material
from fem.results.postprocess import pose_slopes
from fem.scene import Scene
from geometry import cad
from geometry.design import BadInput, paper
from geometry.loads import Load
from geometry.relaxation import Relaxation

ROUGH = replace(QUICK, section_size=0.25, section_patch=0.03, harmonics=1)
"""Exact relations hold on any mesh."""
LAWS = {
    "neo-hookean": material.neo_hookean,
    "mooney-rivlin": material.law("mooney-rivlin", (0.4,)),
    "yeoh": material.law("yeoh", (0.1, 0.01)),
    "ogden": material.law("ogden", (1.3, -2.0, 0.3)),
}
PRESSED, GLUED = Load(depth=1.0), Load(depth=1.0, friction="stick")
SHEARED = Load(depth=1.0, shear_x=0.5, friction="stick")


@functools.cache
def sensor(load, *, magnet="rigid", band=(1.0, 1000.0), **fields):
    return vibration.vibrating_sensor(replace(paper(), **fields), load, band, ROUGH, magnet=magnet)


def test_the_bulk_modulus_does_not_relax():
    design = replace(paper(), nu=0.45, modulus="instantaneous")
    at_rest = vibration.relaxed(design, Relaxation((0.4,), (1.0,)))
    bulk, shear = (
        (d.E / (3 * (1 - 2 * d.nu)) for d in (design, at_rest)),
        (d.E / (1 + d.nu) for d in (design, at_rest)),
    )
    one, other = bulk
    assert other == pytest.approx(one, rel=1e-12)
    one, other = shear
    assert other == pytest.approx(0.6 * one, rel=1e-12)


def test_similar_sensors_vibrate_alike():
    """Twice the size at half the frequency, twice the modulus and density: forces per mm are four times as large."""
    one = sensor(GLUED).at([200.0])
    large = {name: 2 * getattr(paper(), name) for name in ("D", "L", "magnet_diameter", "magnet_height")}
    large |= {"magnet_edge_radius": 2 * paper().magnet_edge_radius, "l0": 2 * paper().l0, "f": 2 * paper().f}
    both = {"E": 2 * paper().E, "density": 2 * paper().density, "magnet_density": 2 * paper().magnet_density}
    other = sensor(
        Load(depth=2.0, friction="stick"), band=(1.0, 500.0), loss_low=0.005, loss_high=500.0, **large, **both
    ).at([100.0])
    assert np.abs(other.force[0, 0, 1] / one.force[0, 0, 1]) == pytest.approx(4.0, rel=1e-6)
    assert other.shift == pytest.approx(one.shift, rel=1e-6, abs=1e-6)
    assert other.kept_amplitude == pytest.approx(2 * one.kept_amplitude, rel=1e-6)


def test_contact_is_kept_as_in_a_hertz_contact():
    """The pressure ratio is 2 d (1 - r^2 / a^2): a quarter of the area is lost at d / 2, all force at 2 d / 3."""
    depth = 0.1
    pressed = vibration.vibrating_sensor(
        replace(paper(), loss_factor=0.0), Load(depth=depth), (0.1, 1.0), STANDARD, magnet="ignored"
    )
    slow = pressed.at([0.1])
    assert slow.kept_amplitude[0, 0] == pytest.approx(depth / 2, rel=0.15)  # five elements across the contact
    assert pressed.state.response.force[2] / slow.force[0, 0, 1].real == pytest.approx(2 / 3 * depth, rel=0.03)


@pytest.mark.parametrize(
    ("band", "load", "words"),
    [
        ((0.0, 10.0), GLUED, "rise from above 0"),
        ((10.0, 1.0), GLUED, "rise from above 0"),
        ((1.0, 1e6), GLUED, "carries shear waves"),
        ((1.0, 10.0), Load(depth=1.0, imperfection=1e-3), "no imperfection"),
        ((1.0, 10.0), Load(depth=6.0, friction="stick"), "unstable"),
        ((1.0, 10.0), Load(depth=1.0, shear_y=0.1, friction="stick", plate_tilt=0.1), "plane of symmetry"),
        ((1.0, 10.0), Load(depth=1.0, friction="stick", plate_tilt=0.1), "glued by a shear only"),
    ],
)
def test_bands_and_loads_that_are_refused(band, load, words):
    design = replace(paper(), L=32.0 if words == "unstable" else 9.0)
    with pytest.raises(BadInput, match=words):
        vibration.vibrating_sensor(design, load, band, QUICK)


@pytest.mark.parametrize("frequency", [1e5, 1001.0, math.nan, -1.0])
def test_a_frequency_that_the_sensor_was_not_prepared_for_is_refused(frequency):
    with pytest.raises(BadInput, match=f"prepared for vibrations of 1 to 1000 Hz; got {frequency:g} Hz"):
        sensor(GLUED).at([10.0, frequency])


def test_below_the_band_there_is_the_static_limit_and_what_the_basis_carries():
    """Branches that relax far below the band are not in its basis."""
    lossy = {"prony": "0.5:1e3", "modulus": "long-term"}
    far = sensor(GLUED, band=(100.0, 1000.0), **lossy)
    assert far.at([1e-9]).force[0, 0, 1].real == pytest.approx(far.static_stiffness()["z"], rel=1e-6)
    wide = sensor(GLUED, band=(1e-6, 1000.0), **lossy)
    for frequency in (1e-5, 1e-4, 1.0):
        try:
            found = far.at([frequency]).force
        except BadInput:
            continue
        assert found == pytest.approx(wide.at([frequency]).force, rel=1e-5)


def test_a_shaken_base_moves_the_magnet_like_a_mass_on_a_spring_below_resonance():
    shaken = sensor(Load()).at([5.0, 10.0])
    assert np.abs(shaken.shift[1, 1, 0] / shaken.shift[0, 1, 0]) == pytest.approx(4.0, rel=0.1)
    assert np.isnan(shaken.force).all()


def test_points_that_slip_stick_in_small_cycles():
    """So the friction coefficient hardly matters, and the sensor is nearly that whose contact is glued."""
    slipping = sensor(Load(depth=1.0, friction=0.3)).at([10.0])
    assert slipping.force == pytest.approx(sensor(GLUED).at([10.0]).force, rel=0.05, abs=1e-6)


def test_a_grip_has_the_static_stiffness_of_its_shear():
    step = 1e-3
    shear = solve(paper(), Load(grip=2.0, shear_x=step), ROUGH).response.force[0] / step
    gripped = sensor(Load(grip=2.0, shear_x=step))
    assert gripped.static_stiffness()["x"] == pytest.approx(shear, rel=1e-3)
    assert np.isnan(gripped.at([1.0]).kept_amplitude).all()


@functools.cache
def blocks(load, magnet="rigid"):
    return build_blocks(Scene(paper(), (load,), QUICK, magnet))[1]


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
        G = elements.gradient(e, slice(None), state.u + step * v)
        _, P, _ = material.evaluate(LAWS[law], G, system.mu, tangent=False)
        inverse = np.linalg.inv(np.moveaxis(G, (0, 1), (-2, -1)) + np.eye(3))
        S = np.einsum("mqJi,iLmq->JLmq", inverse, P)
        F = elements.gradient(e, slice(None), state.u) + np.eye(3)[:, :, None, None]
        dE = np.einsum("iJ...,iL...->JL...", F, elements.gradient(e, slice(None), v))
        return np.einsum("JLmq,JLmq,mq->", S, dE, elements.volumes(e))

    step = 1e-7
    expected = (work(step) - work(-step)) / (2 * step)
    upper = system.relaxing_stiffness(state)
    assert 2 * along @ (upper @ along) - along**2 @ upper.diagonal() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_shift_and_tilt_of_a_slow_motion_along_x_are_those_of_a_small_shear(magnet):
    block = blocks(GLUED, magnet)[1]
    x, force = static(block)
    shift, _, tilt = pose_slopes(block.state, x)[:, 0]
    small = small_shear(paper(), 1.0, magnet, accuracy=replace(QUICK, section_size=0.1), estimate=False)
    # the meshes differ
    assert force[0, 0] * paper().E * paper().D == pytest.approx(small.stiffness, rel=0.01)
    assert shift == pytest.approx(small.shift, rel=0.01)
    assert tilt / paper().D == pytest.approx(small.tilt, rel=0.01)


def test_the_pressure_of_the_contact_sums_to_the_force():
    block = blocks(PRESSED)[0]
    x, force = static(block)
    pressure = vibration.read_pressure(block, x)
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
    still = np.zeros((len(system.corner_nodes), system.elements.angles.pressures))
    r = system.unknowns(u, still, np.eye(2)[0][: system.n_rigid])
    core = design.magnet_density / design.density * cad.magnet_volume(design.shape)
    mass = (core + cad.beam_volume(design.shape) - cad.magnet_volume(design.shape)) / design.D**3
    # the clamped nodes of the lowest elements do not move in r
    assert mass * 0.97 < load @ r < mass
