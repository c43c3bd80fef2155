"""Natural frequencies and mode shapes about the unloaded or a pressed state.

(K - omega^2 M) x = 0 has the tangent K of the section model and the consistent mass M of silicone and magnet. About
an axisymmetric state both have one block for each order of the angle (`fem.model.single_order`): axial modes
have order 0, bending modes 1 and ovalling modes 2. Pressures have no mass, so K is the symmetric indefinite matrix of
the static problem. Torsion (u_theta alone) is solved separately. Bending and ovalling modes come in pairs that differ
by a rotation about the axis; each pair is listed once.

The pressed state is that of the frictionless press; its contact area is then glued to the fixed plate, because
friction holds it at small amplitudes. There is no damping, and no mass of air or base.

Lengths are over D and stresses over E: omega = sqrt(lambda E / rho) / D, with the silicone's density rho.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from fem.accuracy import STANDARD, Accuracy
from fem.model import angular_fields, rigid_inclusion, single_order
from fem.model.elements import SAME_PLACE
from fem.model.nonlinear_system import System
from fem.model.symmetry_models import Discretisation, specification
from fem.results.error_estimates import error_rule, estimated, relative_error
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.scene import MOST_MODES, Scene
from fem.solution import STABLE, Stability, Status
from fem.solve.direct_solver import Solver
from fem.solve.newton import NoStateError
from fem.solve.path_state import about
from fem.solve.press import Press, find_press, reach_press
from geometry.arrays import Array
from geometry.cad import magnet_inertia, magnet_volume
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet

__all__ = ["Modes", "modes"]

SHAPES = ("axial", "bending", "ovalling")
"""Names of harmonics 0, 1, 2."""


@dataclass(frozen=True, slots=True)
class Modes:
    """Natural frequencies in rising order, Hz, and the names of their shapes.

    `estimates` are the estimated relative errors from the mesh, None where they were not estimated. `status` and
    `message` are those of the press.
    """

    frequency: tuple[float, ...]
    shape: tuple[str, ...]
    estimates: tuple[float | None, ...] = ()
    status: Status = "ok"
    message: str = ""


def modes(
    design: Design,
    magnet: Magnet = "rigid",
    count: int = 8,
    *,
    depth: float = 0.0,
    accuracy: Accuracy = STANDARD,
    estimate: bool = True,
) -> Modes:
    """Return the lowest modes about a press to a depth in mm; 0 is the free sensor.

    Parameters
    ----------
    estimate : estimate the errors from a second solve on a mesh with longer edges, with the same edge of contact:
        the constants of the rules cover the error of its location, not the difference of both solves (fem/README.md).

    Raises
    ------
    BadInput
        The count or the depth is out of range, or the press does not reach the depth or is unstable there.
    """
    if not 1 <= count <= MOST_MODES:
        raise BadInput(f"count must be between 1 and {MOST_MODES}; got {count}")
    scene = Scene(design, (Load(depth=depth),), accuracy, magnet)
    find = functools.partial(_solve_modes, count=count, told=scene, edge=find_contact(scene))
    return estimated(scene, find, estimate_frequencies) if estimate else find(scene)


def estimate_frequencies(found: Modes, coarse: Modes, scene: Scene) -> tuple[float | None, ...]:
    """Return the estimated errors of frequencies, from those on the coarser mesh.

    The first, second, ... modes of each shape are compared.
    """
    left = {
        name: [f for f, s in zip(coarse.frequency, coarse.shape, strict=True) if s == name]
        for name in set(found.shape)
    }
    rule = error_rule("modes", scene.magnet, "pressed frequency" if scene.loads[0].depth else "frequency")
    edge, unit = scene.accuracy.section_size, frequency_unit(scene.design)
    errors = []
    for frequency, name in zip(found.frequency, found.shape, strict=True):
        value = left[name].pop(0) if left[name] else None
        errors.append(relative_error(rule, (frequency,), (value,), edge, unit / frequency))
    return tuple(errors)


def _solve_modes(scene: Scene, count: int, told: Scene, edge: float | None) -> Modes:
    """Return the lowest modes of a scene, without error estimates.

    told : scene whose status is told; that on the mesh for error estimates is not.
    edge : of `find_contact`.
    """
    press, depth = pressed_sensor(scene, edge), scene.loads[0].depth
    sideways = SidewaysModel(press.state.d, scene.accuracy.section_size)
    models = press.state.d, sideways.orders[0], single_order.build(press.state.d, 2)
    blocks = {
        name: _order_matrices(press, scene, *model) for name, model in zip(SHAPES, enumerate(models), strict=True)
    }
    blocks["torsion"] = _torsion_matrices(press, scene)
    pressures = {name: model.system.n_pressure for name, model in zip(SHAPES, models, strict=True)}
    solvers = {name: _factorised(K) for name, (K, _) in blocks.items()}
    refuse_unstable(sum((s.stability(pressures.get(name, 0)) for name, s in solvers.items()), STABLE), depth)
    values = {name: eigen(*block, math.ceil(count / 2), solvers[name])[0] for name, block in blocks.items()}
    # most blocks have few of the lowest modes: only those that may have more are solved again
    limit = sorted(itertools.chain(*values.values()))[count - 1]
    for name, block in blocks.items():
        if len(values[name]) < count and values[name][-1] < limit:
            values[name], _ = eigen(*block, count, solvers[name])
    lowest = sorted((float(value), name) for name, block_values in values.items() for value in block_values)[:count]
    scale = frequency_unit(scene.design)
    frequencies = tuple(math.sqrt(value) * scale for value, _ in lowest)
    found = Modes(frequencies, tuple(name for _, name in lowest), (None,) * len(lowest))
    if scene is not told:
        return found
    state = read(press.state, scene, scene.loads[0], margin=sideways.margin)
    return replace(found, status=state.status, message=state.message)


def _factorised(K: sp.csr_matrix) -> Solver:
    """Return a solver with the factorisation of a matrix."""
    solver = Solver()
    solver.factorise(K)
    return solver


def refuse_unstable(stability: Stability, depth: float) -> None:
    """Refuse a state at a depth, mm, that is not known to be stable: small motions about it are no vibration."""
    if not stability.is_stable:
        how = "is unstable" if stability.is_unstable else "may be unstable: its stiffness does not tell"
        raise NoStateError(f"the state at depth {depth:g} mm {how}: take a smaller depth")


def frequency_unit(design: Design) -> float:
    """Return the frequency at which omega D (rho / E)^(1/2) is 1, Hz; inputs in mm, MPa and kg/m^3."""
    return math.sqrt(1e6 * design.E_now / design.density) / (1e-3 * design.D) / (2 * math.pi)


def find_contact(scene: Scene) -> float | None:
    """Return where the contact of a press ends, see `find_press`; None for the free sensor."""
    depth, size = scene.loads[0].depth / scene.design.D, scene.accuracy.section_size
    section = specification(scene, size)
    return find_press(section, scene.accuracy.section_patch, depth) if depth else None


def pressed_sensor(scene: Scene, edge: float | None) -> Press:
    """Return the press of a scene, on a mesh refined at the `edge` of its contact."""
    size, patch, D = scene.accuracy.section_size, scene.accuracy.section_patch, scene.design.D
    return reach_press(specification(scene, size), edge, patch, scene.loads[0].depth / D, D)


def inertia_of_magnet(scene: Scene) -> Array:
    """Return the magnet's mass, three times, and its inertia about y, x and z (6,), over those of silicone."""
    design, m, (across, along) = scene.design, magnet_volume(scene.shape), magnet_inertia(scene.shape)
    return design.magnet_density / design.density * np.array([m, m, m, across, across, along])


def _order_matrices(press: Press, scene: Scene, order: int, d: Discretisation) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Return tangent and mass of the block of one order about a press, in its model."""
    state = about(press.state, d) if order else press.state
    system = state.d.system
    K = system.assemble(system.state(state.q), press.glue(state)).tangent
    return K, system.mass(1.0, inertia_of_magnet(scene))


def _torsion_matrices(press: Press, scene: Scene) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Return tangent and mass of torsion about a press, from the axisymmetric model with u_theta."""
    d, low, at_press = press.state.d, press.state.d.system, press.state.d.system.state(press.state.q)
    e = replace(d.elements, angles=angular_fields.torsion_fields())
    # about an axisymmetric state torsion does not couple to the other displacements and the pressures
    fixed = np.ones((len(e.nodes), 3), dtype=bool)
    fixed[:, 1] = low.fixed.all(axis=1) | (e.nodes[:, 0] < SAME_PLACE)
    held = np.zeros((len(e.nodes), 1))
    held[low.corner_nodes] = at_press.p
    system = System(
        e,
        single_order.revolve_surface(low.skin, e.angles),
        (low.mu[:, 0], low.inverse_K[:, 0]),
        fixed,
        (low.glued, rigid_inclusion.of_section(e.nodes[low.glued] - [0, d.shape.H], e.angles)) if low.rigid else None,
        law=low.law,
        prescribed=(np.insert(at_press.u, 1, 0.0, axis=1), held),
    )
    K = system.assemble(system.state(np.zeros(system.size)), press.glue(press.state)).tangent
    M = system.mass(1.0, inertia_of_magnet(scene))
    # the magnet's motion along the axis is not part of torsion either
    twist = np.arange(system.size) != (system.n_free if low.rigid else -1)
    return K[twist][:, twist].tocsr(), M[twist][:, twist].tocsr()


def eigen(K: sp.csr_matrix, M: sp.csr_matrix, count: int, solver: Solver | None = None) -> tuple[Array, Array]:
    """Return the eigenvalues nearest to zero of K x = lambda M x in rising order, and their vectors (n, count).

    K, M : upper triangles (n, n); M may be singular.
    solver : with the factorisation of K; default: a new one.
    """
    M, solver = M.copy(), solver or _factorised(K)
    M.eliminate_zeros()  # most of the pattern is that of pressures and of pairs of different fields
    mass = (M + sp.triu(M, 1).T).tocsr()
    # a first vector in the range of K^-1 M has no part that M does not see
    first = solver.solve(mass @ np.random.default_rng(0).normal(size=K.shape[0]))
    inverse = LinearOperator(K.shape, matvec=solver.solve, dtype=np.float64)
    # the error of an eigenvalue is the square of its relative residual
    values, vectors = eigsh(K, count, mass, sigma=0.0, OPinv=inverse, v0=first, tol=1e-6)
    rising = np.argsort(values)
    return values[rising], vectors[:, rising]
