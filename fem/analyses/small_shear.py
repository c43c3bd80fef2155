"""Small shear of a glued plate about a press: stiffness, shift and tilt of the magnet from one tangent.

The press is solved with the axisymmetric model; then the contact area is glued to the plate. For a sideways
displacement s of the plate, K dq = -dR/ds s in the model of order 1 (`fem.model.single_order`) gives the
response.

The inertia of K tells whether the press is stable with its tip glued to a plate that does not move. Where the two
meshes of an error estimate disagree, nothing is known of it; `magtip stability` also has the depth at which it loses
this stability (the guided critical depth), with its error.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

from fem.accuracy import STANDARD, Accuracy
from fem.analyses.vibration import plate_loads
from fem.model import plate_contact, single_order
from fem.model.symmetry_models import specification
from fem.results.error_estimates import LEAST_RADIUS, estimate_numbers, solve_coarser
from fem.results.lateral_stiffness import integrate_normal_force
from fem.results.postprocess import pose_slopes
from fem.scene import Scene, check_glued
from fem.solution import NOT_ESTIMATED, UNKNOWN, Estimates, Stability, Status
from fem.solve.direct_solver import Solver
from fem.solve.path_state import about
from fem.solve.press import find_press, reach_press
from geometry.design import Design
from geometry.loads import Load, Magnet

__all__ = ["SmallShear", "small_shear"]

EDGE = 0.5
"""Edge length at the edge of the glued area over that of a shear along a path: an infinitesimal shear depends more
on where exactly the press ends. At 1 the stiffness of one design of `magtip validate errors accuracy` was 4.7 % off
at quick."""
ROUGH = 0.3
"""Edge length over D of the mesh on which the edge of the contact is located; it is refined there."""


@dataclass(frozen=True, slots=True)
class SmallShear:
    """Response to a small sideways displacement of a glued plate about a pressed state.

    Attributes
    ----------
    stiffness : tangential force over the plate's displacement, N/mm.
    shift, tilt : displacement of the magnet's centre over the plate's, and its tilt over the plate's displacement,
        rad/mm.
    force, contact_radius : normal force and contact radius of the press, N and mm.
    estimates : estimated errors.
    stability : of the press with its tip glued to a plate that does not move; unknown where two meshes disagree.
    """

    stiffness: float
    shift: float
    tilt: float
    force: float
    contact_radius: float
    estimates: Estimates = NOT_ESTIMATED
    stability: Stability = UNKNOWN

    @property
    def status(self) -> Status:
        """Status of the press with its tip glued.

        >>> [SmallShear(1.0, 0.5, 0.1, 1.0, 1.0, stability=known).status for known in (Stability(0), UNKNOWN)]
        ['ok', 'unknown']
        """
        verdict = self.stability.verdict
        return "ok" if verdict == "stable" else verdict


def small_shear(
    design: Design,
    depth: float,
    magnet: Magnet = "rigid",
    *,
    accuracy: Accuracy = STANDARD,
    estimate: bool = True,
) -> SmallShear:
    """Return stiffness, shift and tilt per mm of shear at a depth in mm, with the contact area glued.

    Parameters
    ----------
    estimate : estimate the errors from a second solve on a mesh with longer edges, with the same glued area: the
        constants of the rules cover the error of its location, not the difference of both solves (fem/README.md).

    Raises
    ------
    BadInput
        The depth is not positive or out of range, the design has no magnet to be rigid, or the press does not
        reach the depth.
    """
    check_glued(design, depth, magnet)
    scene = Scene(design, (Load(depth=depth),), accuracy, magnet)
    rough = specification(scene, max(ROUGH, accuracy.section_size))
    edge = find_press(rough, EDGE * accuracy.section_patch, depth / design.D)
    find = functools.partial(_solve_small_shear, edge=edge)
    found = find(scene)
    coarse = solve_coarser(scene, find) if estimate else None
    if coarse is None:
        return found
    agree = found.stability.verdict == coarse.stability.verdict
    estimates = estimate_small_shear(found, coarse, scene)
    return replace(found, estimates=estimates, stability=found.stability if agree else UNKNOWN)


def estimate_small_shear(found: SmallShear, coarse: SmallShear, scene: Scene) -> Estimates:
    """Return the estimated errors of a small shear, from that on the coarser mesh."""
    names = ("stiffness", "shift", "tilt", "force", "contact_radius")
    numbers = {name: (getattr(found, name), getattr(coarse, name)) for name in names}
    return estimate_numbers("small shear", numbers, scene, max(found.contact_radius / scene.design.D, LEAST_RADIUS))


def _solve_small_shear(scene: Scene, edge: float) -> SmallShear:
    """Return the small shear of a scene, without error estimates.

    edge : where the contact ends, of `find_press`.
    """
    D, E, accuracy = scene.design.D, scene.design.E_now, scene.accuracy
    section = replace(specification(scene, accuracy.section_size), glued=True)
    press = reach_press(section, edge, EDGE * accuracy.section_patch, scene.loads[0].depth / D, D)
    pressed = press.state
    turned = about(pressed, single_order.build(pressed.d, 1))
    plate = press.glue(turned)
    assert plate is not None
    here, b, held = plate_loads(turned, plate, ("x",))
    solver = Solver()
    solver.factorise(here.tangent)
    q = solver.solve(b[:, 0])
    shift, _, tilt = pose_slopes(turned, q[:, None])[:, 0]
    return SmallShear(
        stiffness=float(held[0, 0] - b[:, 0] @ q) * E * D,
        shift=float(shift),
        tilt=float(tilt) / D,
        force=integrate_normal_force(pressed) * E * D**2,
        contact_radius=plate_contact.contact_radius(pressed.skin, pressed.u, pressed.plate) * D,
        stability=solver.stability(turned.d.system.n_pressure),
    )
