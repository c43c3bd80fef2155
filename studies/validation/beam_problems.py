"""Clamped cylinders: large deflection (elastica), small deflection and vibration (Timoshenko's beam).

The cylinders consist of Fourier elements with two harmonics on a rectangular section; these represent rigid rotations
of a cross-section exactly. Diameter and Young's modulus are 1. The load is a uniform dead traction along x on the
flat end. Rows of rectangles become thinner towards the clamp.
"""

from __future__ import annotations

import math

import numpy as np
import skfem
from scipy.linalg import expm
from scipy.optimize import brentq

from fem.analyses.modes import eigen
from fem.model import angular_fields, elements
from fem.model.elements import Elements
from fem.model.material import lame
from fem.model.nonlinear_system import State, System
from fem.model.symmetry_models import on_axis
from studies.validation.solid_problems import SKIN, body, facet_loads, ramp, solve

HARMONICS = 2
AREA, INERTIA = math.pi / 4, math.pi / 64
"""Area and second moment of area of the cross-section, D = 1."""
GRADING = 1.5
"""Row i of n ends at (i / n)^GRADING of the length."""
SMALL = 1e-7
"""Tip force F of the linear problems, as F / (E D^2) (L / D)^2: small enough for linear strain."""


def elastica(slenderness: int, loads: tuple[float, ...]) -> tuple[float, ...]:
    """Return deflection w / L and shortening u / L at the tip of a cylinder of given L / D for each P L^2 / (E I).

    With nu = 0 the clamp does not hinder the contraction of the section. Shear, finite strain and warping at the
    clamp change the answer by terms of order (D / L)^2, so that the elastica is the limit of large L / D.
    """
    system, e = cylinder(slenderness, 0.0, across=2, along=slenderness)
    unit, tip = system.dead * INERTIA / slenderness**2, _tip(e)
    steps = sorted({*np.linspace(0, max(loads), 9)[1:], *loads})
    answers = dict(zip(steps, ramp(system, unit, steps), strict=True))
    motions = [_tip_motion(answers[load].state, tip) for load in loads]
    return tuple(value / slenderness for w, u in motions for value in (w, -u))


def tip_stiffness(slenderness: int, nu: float, *, rows: int = 4, bonded: bool = True) -> float:
    """Return the tip stiffness at small strain over Timoshenko's 1 / (L^3 / (3 E I) + L / (kappa G A)).

    Timoshenko's clamp lets the cross-section change its shape. A bonded base does not: it stiffens about one diameter
    of the beam, and more so for larger nu. If not bonded, the base only stays plane with its centre fixed, and the
    reaction is a uniform traction on it.
    """
    system, e = cylinder(slenderness, nu, across=rows, along=rows * slenderness, bonded=bonded)
    force = SMALL / slenderness**2
    system.dead = force * system.dead
    deflection = _tip_motion(solve(system).state, _tip(e))[0]
    return force / deflection * compliance(slenderness, nu)


def vibration(slenderness: int, nu: float, *, rows: int, count: int) -> list[float]:
    """Return the `count` lowest bending frequencies over those of Timoshenko's clamped and free beam."""
    system, _ = cylinder(slenderness, nu, across=rows, along=rows * slenderness)
    K = system.assemble(system.state(np.zeros(system.size)), None).tangent
    # three times as many modes, since torsion and extension lie between the bending frequencies
    values, vectors = eigen(K, system.mass(1.0, np.zeros(0)), 3 * count)
    sideways = np.abs([*angular_fields.orders(HARMONICS), *range(HARMONICS + 1)]) == 1
    bends = np.broadcast_to(sideways, system.free.shape)[system.free]
    shapes = np.abs(vectors[: system.n_free]).T
    bending = [float(value) for value, x in zip(values, shapes, strict=True) if x[bends].max() > x[~bends].max()]
    return [math.sqrt(a) / b for a, b in zip(bending, frequencies(slenderness, nu, count), strict=False)]


def frequencies(slenderness: float, nu: float, count: int) -> list[float]:
    """Return the angular frequencies of Timoshenko's clamped and free beam, D = E = rho = 1.

    Along the beam w' = phi + g, phi' = m, m' = -omega^2 phi - kappa G A g / I and g' = -omega^2 w / (kappa G), with
    w = phi = 0 at the clamp and m = g = 0 at the end. The first frequency of a slender beam is 3.516 sqrt(I / A) /
    L^2:

    >>> round(frequencies(100.0, 0.3, 1)[0] * 1e4 / math.sqrt(INERTIA / AREA), 3)
    3.516
    """
    kappa_G = 6 * (1 + nu) / (7 + 6 * nu) / (2 * (1 + nu))
    stiff = kappa_G * AREA / INERTIA

    def residual(omega: float) -> float:
        # the determinant of the end conditions m = g = 0 vanishes at a frequency
        A = np.array([[0, 1, 0, 1], [0, 0, 1, 0], [0, -(omega**2), 0, -stiff], [-(omega**2) / kappa_G, 0, 0, 0]])
        return float(np.linalg.det(expm(slenderness * A)[2:, 2:]))

    # the step is less than a third of the first frequency, so that no two roots share an interval
    step = math.sqrt(INERTIA / AREA) / slenderness**2
    roots: list[float] = []
    omega = step
    while len(roots) < count:
        if residual(omega) * residual(omega + step) < 0:
            roots.append(float(brentq(residual, omega, omega + step, rtol=1e-12)))
        omega += step
    return roots


def compliance(slenderness: float, nu: float) -> float:
    """Return Timoshenko's tip deflection under a unit load, D = E = 1; kappa = 6 (1 + nu) / (7 + 6 nu), Cowper 1966.

    >>> round(compliance(1e3, 0.5) * 3 * INERTIA / 1e9, 5)
    1.0
    """
    kappa, G = 6 * (1 + nu) / (7 + 6 * nu), 1 / (2 * (1 + nu))
    return slenderness**3 / (3 * INERTIA) + slenderness / (kappa * G * AREA)


def cylinder(
    slenderness: float, nu: float, *, across: int, along: int, bonded: bool = True
) -> tuple[System, Elements]:
    """Return a cylinder of given L / D, clamped at z = 0, under a unit load at the end.

    The section has `across` rectangles along the radius and `along` along the axis.
    """
    rows = slenderness * np.linspace(0, 1, along + 1) ** GRADING
    flat = skfem.MeshTri.init_tensor(np.linspace(0, 0.5, across + 1), rows)
    mesh = skfem.MeshTri2.from_mesh(flat).with_boundaries(
        {"end": lambda x: x[1] > slenderness - SKIN, "base": lambda x: x[1] < SKIN}
    )
    e = elements.build(mesh, axisymmetric=True, harmonics=HARMONICS)
    base, axis = e.nodes[:, 1] < SKIN, e.nodes[:, 0] < SKIN
    fixed = np.repeat(base[:, None], e.angles.fields, axis=1)
    load = facet_loads(mesh, e, "end", (1 / AREA, 0, 0))
    if not bonded:
        load += facet_loads(mesh, e, "base", (-1 / AREA, 0, 0))
        fixed[base & ~axis, : len(angular_fields.orders(HARMONICS))] = False
    fixed[np.ix_(axis, ~on_axis(HARMONICS))] = True
    return body(e, fixed, *lame(1.0, nu), dead=load), e


def _tip(e: Elements) -> int:
    """Return the node where the axis meets the end."""
    return int(np.argmax(e.nodes[:, 1] - 1e3 * e.nodes[:, 0]))


def _tip_motion(state: State, tip: int) -> tuple[float, float]:
    """Return the displacement along x and z of a node on the axis: the fields w_-1 and z_0."""
    k = list(angular_fields.orders(HARMONICS))
    return float(state.u[tip, k.index(-1)]), float(state.u[tip, len(k)])
