"""Problems of viscoelasticity in time: a cube, the silicone beam at a held depth, and a viscoelastic half space.

Branches and laws are those of `fem.model.viscoelasticity`. Times are in s.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import skfem
from scipy.spatial.transform import Rotation

from analytic.viscoelastic_contact import indentation
from fem.accuracy import LEVELS, QUICK
from fem.analyses.timed_path import TimeControl, TimedLoad, TimedState, ViscousLaw, follow
from fem.equilibrium import solve as solve_load
from fem.model import elements, material, viscoelasticity
from fem.model.nonlinear_system import System
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.viscoelasticity import Branches, History, PointState
from geometry.arrays import Array
from geometry.design import Design, paper
from geometry.loads import Load
from geometry.relaxation import Relaxation, relaxation_of
from studies.validation.solid_problems import SKIN, Mask, NotSolvedError, solve

TWO = Branches(np.array([0.3, 0.2]), np.array([0.5, 4.0]), 1.0)
"""Branches of the cubes, with the shear modulus 1 in the fast limit."""
OGDEN_PA, EXPONENTS = (6.3e5, 1.2e3, -1e4), (1.3, 5.0, -2.0)
"""Constants of the Ogden law of Holzapfel's block: mu_i, Pa, and alpha_i."""
SLOW = 1e-7
"""1/K of cubes, small enough for their volume and large enough to determine the pressure."""


def cube() -> elements.Elements:
    """Return a unit cube of six tetrahedra for each eighth."""
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 2)] * 3))
    return elements.build(mesh, axisymmetric=False)


def stresses(
    e: elements.Elements,
    fixed: Mask,
    law: material.Law,
    branches: Branches,
    motion: Sequence[tuple[float, Array]],
    viscous: ViscousLaw = "prony",
) -> Iterator[Array]:
    """Yield V sigma (3, 3) of a unit cube after each step (length in s, displacements)."""
    system, q = System(e, None, 1.0, SLOW, fixed, law=law), None
    history = viscoelasticity.at_rest(viscous, branches, (1, *e.weights.shape))
    for dt, moved in motion:
        stepped = system.with_prescribed(moved, np.zeros((len(system.corner_nodes), 1)))
        stepped.viscous = history.overstress(dt)
        answer = solve(stepped, moved) if q is None else solve(stepped, q=q)
        q = answer.state.q
        history = history.advance(viscoelasticity.measure(system.elements, law, system.mu, answer.state.u), dt)
        yield np.asarray(answer.assembly.forces.T @ (e.nodes + answer.state.u))


def sheared(amount: float, e: elements.Elements) -> Array:
    """Return the displacements u_x = amount z."""
    u = np.zeros(e.nodes.shape)
    u[:, 0] = amount * e.nodes[:, 2]
    return u


def _faces(e: elements.Elements) -> Mask:
    outer = np.asarray(((e.nodes < SKIN) | (e.nodes > 1 - SKIN)).any(axis=1))
    return np.repeat(outer[:, None], 3, axis=1)


def relaxing_cube(_: int) -> tuple[float, ...]:
    """Return sigma_xz and sigma_xx - sigma_zz over mu0 G(t)/G(0) of a cube sheared at once, after 0, 0.3, 3 s."""
    e = cube()
    motion = [(dt, sheared(0.8, e)) for dt in (0.0, 0.3, 2.7)]
    relaxation = Relaxation(tuple(TWO.shares.tolist()), tuple(TWO.times.tolist()))
    moduli = relaxation.modulus([0.0, 0.3, 3.0])
    parts = [
        (sigma[0, 2] / G, (sigma[0, 0] - sigma[2, 2]) / G)
        for sigma, G in zip(stresses(e, _faces(e), material.neo_hookean, TWO, motion), moduli, strict=True)
    ]
    return tuple(float(value) for pair in parts for value in pair)


def turned_cube(_: int) -> tuple[float, ...]:
    """Return 1 less the difference of a turned sheared cube's stresses, turned back, to those of a sheared cube.

    The difference is over the largest stress, for both laws. The cube turns by 2 rad about the axis (1, 2, 2) / 3 in
    eight steps, through which its shear goes to 0.6 and back.
    """
    e, axis = cube(), np.array([1.0, 2.0, 2.0]) / 3
    amounts = 0.6 * np.sin(math.pi / 8 * np.arange(1, 9))
    turns = [Rotation.from_rotvec(2 / 8 * i * axis).as_matrix() for i in range(1, 9)]
    upright = [(0.2, sheared(float(amount), e)) for amount in amounts]
    turned = [(dt, (e.nodes + u) @ R.T - e.nodes) for (dt, u), R in zip(upright, turns, strict=True)]

    def difference(viscous: ViscousLaw) -> float:
        first, second = (
            np.array(list(stresses(e, _faces(e), material.neo_hookean, TWO, motion, viscous)))
            for motion in (upright, turned)
        )
        back = [R.T @ sigma @ R for R, sigma in zip(turns, second, strict=True)]
        return 1 - float(np.abs(np.array(back) - first).max() / np.abs(first).max())

    return difference("prony"), difference("finite")


def cyclic_cube(n: int) -> tuple[float, float]:
    """Return storage and loss modulus of a cube in small cyclic shear, 0.2 Hz, over the exact ones.

    A cycle has n steps; the last of six is read.
    """
    e, size, omega = cube(), 1e-3, 0.4 * math.pi
    dt, count = 2 * math.pi / omega / n, 6 * n
    times = dt * np.arange(1, count + 1)
    motion = [(dt, sheared(size * math.sin(omega * t), e)) for t in times]
    stress = np.array([sigma[0, 2] for sigma in stresses(e, _faces(e), material.neo_hookean, TWO, motion)])
    measured = 2j * (stress[-n:] / size * np.exp(-1j * omega * times[-n:])).mean()
    relaxation = Relaxation(tuple(TWO.shares.tolist()), tuple(TWO.times.tolist()))
    exact = complex(relaxation.complex_modulus(omega))
    return float(measured.real / exact.real), float(measured.imag / exact.imag)


def holzapfel_block(n: int) -> tuple[float, float]:
    """Return the Cauchy stress of Holzapfel's block at 16 s, Pa, and the share of it that has relaxed at 20 s.

    A cube of 0.1 m is moved along z by A sin(pi t / 2), with A = 0.01 m in the first cycle and 0.01 m more in each
    of the three others, in n steps each; then it is held. tau = 0.4 and 0.2 s, and both branches are as stiff as the
    silicone at rest (beta = 1).
    """
    e = cube()
    slow = sum(mu * a for mu, a in zip(OGDEN_PA, EXPONENTS, strict=True)) / 2
    shares = tuple(mu * a / 2 / slow for mu, a in zip(OGDEN_PA, EXPONENTS, strict=True))

    law = functools.partial(material.ogden, alphas=EXPONENTS, shares=shares)
    fixed = e.nodes < SKIN
    fixed[:, 2] |= e.nodes[:, 2] > 1 - SKIN
    times = 4 / n * np.arange(1, 4 * n + 1)
    sizes = 0.1 * np.ceil(times / 4 - 1e-9)
    strains = [*(sizes * np.sin(math.pi / 2 * times)), *np.zeros(n // 4)]
    steps = [4 / n] * (4 * n) + [16 / n] * (n // 4)
    branches = Branches(np.array([1 / 3, 1 / 3]), np.array([0.4, 0.2]), 3.0)
    motion = [(dt, e.nodes * [0.0, 0.0, strain]) for dt, strain in zip(steps, strains, strict=True)]
    axial = [slow * float(sigma[2, 2] - sigma[0, 0]) for sigma in stresses(e, fixed, law, branches, motion)]
    return axial[4 * n - 1], 1 - axial[-1] / axial[4 * n - 1]


def silicone(nu: float = 0.5) -> Design:
    """Return the paper's sensor with two branches, E in the fast limit."""
    return replace(paper(), nu=nu, prony="0.3:0.5 0.2:4", modulus="instantaneous")


def _solved(states: Iterator[TimedState]) -> list[TimedState]:
    passed = list(states)
    if passed[-1].status not in ("ok", "unstable"):
        raise NotSolvedError(passed[-1].message)
    return passed


def held_beam(_: int) -> tuple[float, ...]:
    """Return F(t) / F(0) over G(t) / G(0) of the silicone beam pressed by 1 mm at once, at 0.3 and 2 s."""
    design, times = silicone(), (0.0, 0.3, 2.0)
    loads = [TimedLoad(t, Load(1.0)) for t in times]
    forces = [
        one.response.force[2]
        for one in _solved(follow(design, loads, QUICK, magnet="ignored", steps=TimeControl(kappa=1e6)))
    ]
    moduli = relaxation_of(design).modulus(times)
    return tuple(float(force / forces[0] / G) for force, G in zip(forces[1:], moduli[1:], strict=True))


def indented_half_space(level: str) -> tuple[float, ...]:
    """Return the force of a ramp and of its release over Lee and Radok's and Ting's, with the mesh's error removed.

    The beam without magnet touches a plate by 1e-4 mm within 1 s, which goes back at the same speed: at 0.5 and 1 s,
    and at 1.1 s. The mesh's error is that of the elastic beam at the full depth.
    """
    design, top = silicone(), 1e-4
    times, depths = np.array([0.0, 0.5, 1.0, 1.1]), top * np.array([0.0, 0.5, 1.0, 0.9])
    loads = [TimedLoad(float(t), Load(float(d))) for t, d in zip(times[1:], depths[1:], strict=True)]
    states = _solved(follow(design, loads, LEVELS[level], magnet="ignored", steps=TimeControl(largest_step=0.01)))
    G0 = design.E / 3
    exact = indentation(relaxation_of(design), G0, design.R, times, depths).force
    elastic = solve_load(design, Load(top), LEVELS[level], magnet="ignored").response.force[2]
    mesh = elastic / (16 / 3 * math.sqrt(design.R) * G0 * top**1.5)
    return tuple(float(one.response.force[2] / force / mesh) for one, force in zip(states, exact[1:], strict=True))


def limits(_: int) -> tuple[float, ...]:
    """Return the forces of a very fast and of a very slow press by 1 mm over those of elastic solves, law by law.

    The plate's springs follow the modulus of the design, so a slow press has those of the elastic design here.
    """
    design, ratios = silicone(0.4998), []
    mu, bulk = design.E / (2 * (1 + design.nu)), design.E / (3 * (1 - 2 * design.nu))
    for share, duration in ((1.0, 1e-6), (0.5, 1e7)):
        G = share * mu
        elastic = replace(design, E=9 * bulk * G / (3 * bulk + G), nu=(3 * bulk - 2 * G) / (2 * (3 * bulk + G)))
        exact = solve_load(elastic, Load(1.0), QUICK).response.force[2]
        for law in ("prony", "finite"):
            kappa = SECTION_KAPPA * elastic.E / design.E
            (state,) = _solved(
                follow(design, [TimedLoad(duration, Load(1.0))], QUICK, law=law, steps=TimeControl(kappa=kappa))
            )
            ratios.append(state.response.force[2] / exact)
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
        values += [(last.stored + last.dissipated) / last.work, last.response.force[0]]
    return tuple(values)


def balance(n: int) -> tuple[float, float]:
    """Return the shares of the work that are stored or dissipated in `sheared_beam`, for both laws."""
    first, _, second, _ = sheared_beam(n)
    return first, second


Friction = float | Literal["none", "stick"]


@functools.lru_cache
def touched_beam(n: int, law: ViscousLaw, friction: Friction) -> tuple[float, float]:
    """Return 1 less the largest error of the energy balance over the largest work, and 1 less negative dissipation.

    Without friction a plate presses the beam by 1 mm and goes back, in n time steps each way. With friction it moves
    after a quick press by 0.5 mm to one side, where a cycle begins, to the other and back, in n time steps each way;
    the error is that of the cycle. The dissipation is that of the silicone and of slip.
    """
    accuracy = replace(QUICK, section_size=0.3, section_patch=0.1, harmonics=1)
    loads, begin = [TimedLoad(1.0, Load(1.0)), TimedLoad(2.0, Load(0.0))], 0.0
    if friction != "none":
        way, begin = (0.0, 0.5, -0.5, 0.5), 1.25
        loads = [TimedLoad(0.25 + i, Load(1.0, x, friction=friction)) for i, x in enumerate(way)]
    path = follow(silicone(0.4998), loads, accuracy, law=law, steps=TimeControl(0.9, 1 / n), every_step=True)
    states = _solved(path)
    before = [0.0, *(one.balance for one in states if one.time <= begin)]
    error = np.max([abs(one.balance - before[-1]) for one in states if one.time >= begin])
    lost = np.array([(0.0, 0.0), *((one.dissipated, one.friction_dissipated) for one in states)])
    gained = np.diff(lost, axis=0)
    negative = float(np.maximum(-gained, 0.0).sum() / gained.sum())
    return 1 - float(error / np.max([one.work for one in states])), 1 - negative


def touching(n: int, friction: Friction = "none") -> tuple[float, ...]:
    """Return the values of `touched_beam` for both laws."""
    return (*touched_beam(n, "prony", friction), *touched_beam(n, "finite", friction))


def change(n: int) -> tuple[float, float]:
    """Return how the forces in `sheared_beam` change with steps of half the length, N, for both laws."""
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
    branches = Branches(np.array([0.5]), np.array([1.0]), 1.0)
    point = deformed(0.0)
    history = viscoelasticity.at_rest(law, branches, point.J.shape)
    work, stored = [], [_stored(history, point)]
    stress = history.stress(point)
    for i in range(1, CYCLES * n + 1):
        after = deformed(math.sin(2 * math.pi * i / n))
        history = history.advance(after, 2 * math.pi / (rate * n))
        reached = history.stress(after)
        work.append(viscoelasticity.contract(stress + reached, after.C - point.C).ravel() / 4)
        stored.append(_stored(history, after))
        point, stress = after, reached
    return np.array(work)[-n:], np.array(work)[-n:] - np.diff(stored, axis=0)[-n:]


def _stored(history: History, point: PointState) -> Array:
    """Return the stored energy of each point."""
    alone = np.eye(point.J.size).reshape(-1, *point.J.shape)
    return np.array([history.stored(replace(point, weights=weights)) for weights in alone])


def signs(law: ViscousLaw, n: int) -> tuple[Array, Array]:
    """Return the least work of a cycle over its moved work, and the least dissipation of a step over the most work.

    Returns
    -------
    tuple
        Two (points,), over all `RATES`.
    """
    cycles = [point_cycle(law, rate, n) for rate in RATES]
    closed = [work.sum(axis=0) / np.abs(work).sum(axis=0) for work, _ in cycles]
    steps = [lost.min(axis=0) / np.abs(work).max(axis=0) for work, lost in cycles]
    return np.min(closed, axis=0), np.min(steps, axis=0)


def negative_dissipation(n: int) -> tuple[float, ...]:
    """Return 1 less the negative parts: of closed cycles by both laws, and of steps by the law "finite"."""
    (linear, _), (finite, steps) = signs("prony", n), signs("finite", n)
    return tuple(1 - float(np.maximum(0.0, -values.min())) for values in (linear, finite, steps))
