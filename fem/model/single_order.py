"""Models of one order n of the angle about an axisymmetric state of a section: displacements like cos n theta.

About an axisymmetric state the tangent of a section with harmonics is block diagonal: the orders n = 0, 1, 2, ... are
not coupled. The block of order n >= 1 has the fields w_n, w_-n, z_n and p_n of `fem.model.elements` as
unknowns. The fields w_0, z_0 and p_0 of the state are prescribed. The integral over the angle of a product of two
functions of order n is a sum over the angles 0 and pi / (2 n): at the first one cosines are 1 and sines are 0, at the
second one it is the other way round. Only the tangent and differences of residuals are integrated so, not a residual
of order 1 itself, which is zero.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from fem.model import angular_fields, elements, rigid_inclusion
from fem.model.angular_fields import Angles
from fem.model.elements import SAME_PLACE, Surface
from fem.model.nonlinear_system import State, System
from fem.model.symmetry_models import Discretisation
from geometry.arrays import Array, read_only


@functools.lru_cache(maxsize=8)
def build(low: Discretisation, order: int) -> Discretisation:
    """Return the model of one order n >= 1 on the mesh of an axisymmetric model; `linearise` gives it a state."""
    base, angles = low.system, angular_fields.order_fields(order)
    e = replace(base.elements, angles=angles)
    clamped, on_axis = np.all(base.fixed, axis=1), e.nodes[:, 0] < SAME_PLACE
    fixed = np.tile(clamped[:, None], angles.fields)
    # on the axis only w_-1 can differ from zero, a sideways displacement
    fixed[on_axis] = True
    if order == 1:
        fixed[on_axis & ~clamped, 2] = False
    fixed[:, [0, 3]] = True
    magnet = None
    if base.rigid is not None and order == 1:
        magnet = base.glued, rigid_inclusion.sideways(e.nodes[base.glued] - [0, low.shape.H], angles)
    else:  # the magnet moves with orders 0 and 1 only
        fixed[base.glued] = True
    held = np.zeros((len(e.nodes), 2))
    held[~on_axis, 1] = np.nan
    system = System(
        e,
        revolve_surface(base.skin, angles),
        (base.mu[:, 0], base.inverse_K[:, 0]),
        fixed,
        magnet,
        law=base.law,
        prescribed=(np.zeros(fixed.shape), held),
    )
    read_only(vars(system))
    return replace(low, model="harmonic", system=system)


def linearise(d: Discretisation, low: State) -> Discretisation:
    """Return a model of one order about an axisymmetric state; its unknowns there are zero."""
    u, p = np.zeros(d.system.fixed.shape), np.zeros((len(low.p), 2))
    u[:, [0, 3]], p[:, 0] = low.u, low.p[:, 0]
    return replace(d, system=d.system.with_prescribed(u, p))


def raise_fields(u: Array) -> Array:
    """Return the fields (nodes, 6) of a section with one harmonic, from those of order 1 (nodes, 5)."""
    raised = np.zeros((len(u), 6))
    raised[:, [2, 3, 1, 4, 5]] = u
    return raised


def revolve_surface(surface: Surface, angles: Angles) -> Surface:
    """Return the skin of an axisymmetric section with points at several angles."""
    return elements.revolve(surface.nodes, surface.shape, surface.weights / (2 * np.pi), surface.points, angles)
