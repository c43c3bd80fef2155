"""Sideways stability of a pressed body of revolution, from one harmonic about the axisymmetric state.

A press is followed with the axisymmetric model. It turns unstable sideways at the depth where its lateral stiffness
passes through zero, see `fem.results.lateral_stiffness`.

Two plates are told apart: a frictionless one, on which the tip is free to slide, and one to which the patch in
contact is glued (a guided tip).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from fem.accuracy import QUICK, STANDARD, Accuracy, coarser
from fem.contact.contact_extent import EDGE_SHARE, find_contact_edge, measure_contact_edge
from fem.discretisation.mesh_specification import MeshSpecification, specification
from fem.error_estimate_rules import LEAST_DEPTH, TANGENT_RULES
from fem.error_estimates import estimate_number
from fem.results.lateral_stiffness import SidewaysModel, integrate_normal_force, measure_lateral_stiffness
from fem.scene import Scene
from fem.solvers.load_case_models import PRESS_FILLET
from fem.solvers.load_stepping import Path
from geometry.design import Design
from geometry.loads import Load, Magnet

DEEPEST = 0.5
"""Depth over the silicone's height up to which an instability is looked for."""
STEP = 0.05
"""Depth over D between two states that are checked."""
TOLERANCE = 1e-4
"""Relative width of the interval in which a critical depth lies."""
AROUND = 0.05
"""Steps in which a critical depth is looked for around that of another mesh, over the depth."""
MOVED = 0.02
"""Relative change of the radius at which the contact ends that asks for another mesh."""
KAPPA = 3e5
"""Stiffness of the plate: ten times that of other sections, for elements this small where a deep contact ends (see
`fem.contact.plate_contact`). With less a wide magnet's press seemed unstable at level fine from 0.33 D on."""
RIM = 0.25
"""Edge length where the contact ends, over that of a glued patch, at most EDGE_SHARE of the contact's radius. In
larger elements the lateral stiffness scatters with the place where the contact ends: a critical depth by 2 %."""


@dataclass(frozen=True, slots=True)
class CriticalEstimates:
    """Estimates of the relative errors of a critical depth and force from the mesh; None where there are none."""

    depth: float | None = None
    force: float | None = None


@dataclass(frozen=True, slots=True)
class Critical:
    """Where a press turns unstable.

    Attributes
    ----------
    depth, force : mm and N, None where no sideways instability was found.
    stable_to : depth up to which there is none, mm.
    message : what to know; empty if nothing.
    estimates : of the errors.
    """

    depth: float | None
    force: float | None
    stable_to: float
    message: str
    estimates: CriticalEstimates = CriticalEstimates()


def critical(
    design: Design,
    magnet: Magnet = "rigid",
    *,
    guided: bool = False,
    accuracy: Accuracy = STANDARD,
    deepest: float | None = None,
    estimate: bool = True,
) -> Critical:
    """The depth at which a press turns unstable sideways.

    A coarse mesh first, then one that is fine where the contact ends at that depth. There the lateral stiffness is
    followed to its zero (see `fem.results.lateral_stiffness`).

    Parameters
    ----------
    guided : the patch in contact is glued to the plate, which itself cannot move sideways.
    deepest : where to stop looking, mm; default: half of the silicone's height.

    Raises
    ------
    BadInput
        The depth does not fit the design, or the design has no magnet to be rigid.
    """
    room = design.L - (design.magnet_height if magnet == "rigid" else 0.0)
    deepest = DEEPEST * room if deepest is None else deepest
    scene = Scene(design, (Load(depth=deepest),), accuracy, magnet)
    state = _find_critical(scene, guided)
    if not estimate or state.depth is None:
        return state
    companion = _find_critical(replace(scene, accuracy=coarser(accuracy)), guided)
    return replace(state, estimates=estimate_critical(state, companion, scene))


def estimate_critical(one: Critical, other: Critical, scene: Scene) -> CriticalEstimates:
    """Errors of a critical state, from what a mesh coarser by COARSER says of it."""
    if one.depth is None or one.force is None:
        return CriticalEstimates()
    magnet, edge, base = scene.magnet, scene.accuracy.section_size, max(one.depth / scene.design.D, LEAST_DEPTH)
    return CriticalEstimates(
        depth=estimate_number(TANGENT_RULES["critical depth", magnet], one.depth, other.depth, edge, base),
        force=estimate_number(TANGENT_RULES["critical force", magnet], one.force, other.force, edge, base),
    )


def _find_critical(scene: Scene, guided: bool) -> Critical:
    D = scene.design.D
    end = scene.loads[0].depth / D
    rough = fine_section(replace(scene, accuracy=QUICK))
    first = _find_on_mesh(rough, guided, 0.0, min(STEP, end / 8), end)
    if first is None or isinstance(first, float):
        return _report_none(first or 0.0, end, D)
    edge = find_contact_edge(rough, RIM * scene.accuracy.section_patch, first.depth)
    found = _find_near(fine_section(scene, edge), guided, first.depth, end)
    if not isinstance(found, float) and abs(found.edge / edge - 1) > MOVED:
        found = _find_near(fine_section(scene, found.edge), guided, found.depth, end)
    if isinstance(found, float):
        return _report_none(found, end, D)
    return Critical(found.depth * D, found.force * scene.design.E * D**2, found.stable * D, "")


def fine_section(scene: Scene, edge: float | None = None) -> MeshSpecification:
    """The axisymmetric section, fine at the undeformed radius `edge` over D at which the contact ends."""
    size, patch = scene.accuracy.section_size, RIM * scene.accuracy.section_patch
    rim = None if edge is None else (edge, min(patch, EDGE_SHARE * edge))
    return replace(specification(scene, size, size / 2), fillet=PRESS_FILLET, rim=rim)


@dataclass(frozen=True, slots=True)
class _CriticalState:
    """A critical state in units of D and E: depth, normal force, undeformed radius at which the contact ends.

    `stable` is the greatest depth that was found stable.
    """

    depth: float
    force: float
    edge: float
    stable: float


class _StoppedError(ArithmeticError):
    """The press does not reach a depth."""


def _find_near(section: MeshSpecification, guided: bool, depth: float, end: float) -> _CriticalState | float:
    """Find the first instability near a depth; start from rest if the press is unstable or fails before that depth.

    An unstable state may lie on another branch, from which unloading does not return to the stable one.
    """
    for start in ((1 - AROUND) * depth, 0.0):
        found = _find_on_mesh(section, guided, start, AROUND * depth if start else depth / 4, end)
        if found is not None:
            return found
    return 0.0


def _find_on_mesh(
    section: MeshSpecification, guided: bool, start: float, step: float, end: float
) -> _CriticalState | float | None:
    """The first instability, looked for from a depth on in steps; the depth reached if there is none.

    None where the press does not come to the start, or is unstable there.
    """
    path = Path(section.build(), kappa=KAPPA)
    try:
        return _search_path(path, SidewaysModel(replace(section, harmonics=1).build), guided, start, step, end)
    finally:
        path.close()


def _search_path(
    path: Path, sideways: SidewaysModel, guided: bool, start: float, step: float, end: float
) -> _CriticalState | float | None:
    """The first instability that a path comes to: see `_find_on_mesh`."""
    known: dict[float, float] = {}

    def stiffness(depth: float) -> float:
        """Lateral stiffness, with a minus wherever there is an unstable direction."""
        if depth not in known:
            if path.go(depth, np.zeros(2)):
                raise _StoppedError
            now = measure_lateral_stiffness(sideways, path.state, guided=guided)
            known[depth] = -abs(now.stiffness) if now.unstable else abs(now.stiffness)
        return known[depth]

    stable, depth = 0.0, start or step
    try:
        while stiffness(depth) > 0:
            if depth >= end:
                return depth
            stable, depth = depth, min(depth + step, end)
        if start and not stable:
            return None
        if not stable:
            known[stable] = sideways.stiffness_at_rest
        depth = float(brentq(stiffness, stable, depth, rtol=TOLERANCE))
        path.go(depth, np.zeros(2))
    except _StoppedError:
        return stable or (None if start else 0.0)
    stable = max(depth for depth, value in known.items() if value > 0)
    return _CriticalState(depth, integrate_normal_force(path.state), measure_contact_edge(path.state), stable)


def _report_none(reached: float, end: float, D: float) -> Critical:
    message = (
        "" if reached >= end else f"the press does not converge beyond {reached * D:.4g} mm; it is stable up to there"
    )
    return Critical(None, None, reached * D, message)
