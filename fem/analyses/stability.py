"""Sideways stability of a pressed body of revolution, from one harmonic about the axisymmetric state.

The press is solved with the axisymmetric model. It becomes unstable sideways at the depth where its lateral stiffness
passes through zero, see `fem.results.lateral_stiffness`.

There are two cases: a frictionless plate, on which the tip is free to slide, and a plate to which the contact area is
glued (a guided tip).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from fem.accuracy import QUICK, STANDARD, Accuracy
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.symmetry_models import MeshSpecification, specification
from fem.results.error_estimates import LEAST_DEPTH, estimate_numbers, estimated
from fem.results.lateral_stiffness import SidewaysModel, integrate_normal_force
from fem.scene import Scene, silicone_on_axis
from fem.solution import NOT_ESTIMATED, Estimates
from fem.solve.load_case_models import PRESS_FILLET
from fem.solve.load_stepping import Path, PathModels
from fem.solve.path_state import PathState
from fem.solve.press import EDGE_SHARE, find_press, measure_contact_edge
from geometry.design import Design
from geometry.loads import Load, Magnet

__all__ = ["Critical", "critical"]

DEEPEST = 0.5
"""Depth over the silicone's height up to which an instability is searched for."""
STEP = 0.05
"""Depth between two states that are checked, over D, or over the critical depth of another mesh near it."""
KAPPA = 10 * SECTION_KAPPA
"""Stiffness number of the plate: ten times that of other sections, because elements are this small where a deep
contact ends (see `fem.model.plate_contact`). With a softer plate the press of a wide magnet seemed unstable at
level fine from 0.33 D on."""
RIM = 0.25
"""Edge length where the contact ends, over that of a glued area; at most EDGE_SHARE of the contact radius. With
larger elements the lateral stiffness depends on where in an element the contact ends, and a critical depth scatters
by 2 %."""

UNREACHED = "the press does not converge beyond {} mm; it is stable up to there"
UNCOUNTED = (
    "the press is stable up to {} mm; beyond, its stability is unknown: the pivots of its stiffness do not tell"
)
"""Limitations of a search that ends before its last depth."""


@dataclass(frozen=True, slots=True)
class Critical:
    """Depth at which a press becomes unstable sideways.

    Attributes
    ----------
    depth, force : critical depth, mm, and force, N; None where no sideways instability was found.
    stable_to : depth up to which the press is known to be stable, mm.
    message : why the search ended before its last depth; empty if it found an instability or reached that depth.
    estimates : estimated errors.
    """

    depth: float | None
    force: float | None
    stable_to: float
    message: str
    estimates: Estimates = NOT_ESTIMATED


def critical(
    design: Design,
    magnet: Magnet = "rigid",
    *,
    guided: bool = False,
    accuracy: Accuracy = STANDARD,
    deepest: float | None = None,
    estimate: bool = True,
) -> Critical:
    """Return the depth at which a press becomes unstable sideways.

    A coarse mesh gives a first estimate of the depth. A second mesh, refined where the contact ends at that depth,
    gives the zero of the lateral stiffness (see `fem.results.lateral_stiffness`).

    Parameters
    ----------
    guided : the contact area is glued to the plate, which itself cannot move sideways.
    deepest : largest depth of the search, mm; default: half of the silicone's height.

    Raises
    ------
    BadInput
        The depth does not fit the design, or the design has no magnet to be rigid.
    """
    deepest = DEEPEST * silicone_on_axis(design, magnet) if deepest is None else deepest
    scene = Scene(design, (Load(depth=deepest),), accuracy, magnet)
    find = functools.partial(_find_critical, guided=guided)
    if not estimate:
        return find(scene)
    return estimated(scene, find, estimate_critical, lambda state: state.depth is not None)


def estimate_critical(found: Critical, coarse: Critical, scene: Scene) -> Estimates:
    """Return the estimated errors of a critical state, from that on the coarser mesh."""
    numbers = {"depth": (found.depth, coarse.depth), "force": (found.force, coarse.force)}
    base = max((found.depth or 0.0) / scene.design.D, LEAST_DEPTH)
    return estimate_numbers("critical", numbers, scene, base)


def _find_critical(scene: Scene, guided: bool) -> Critical:
    D = scene.design.D
    end = scene.loads[0].depth / D
    rough = _fine_section(replace(scene, accuracy=QUICK))
    # a search from rest always has a result
    found, _ = _search(rough, guided, 0.0, min(STEP, end / 8), end) or NOWHERE
    if found.depth is not None:
        edge = find_press(rough, RIM * scene.accuracy.section_patch, found.depth)
        found, now = _search_near(_fine_section(scene, edge), guided, found.depth, end)
        # where the radius at which the contact ends has changed by 2 %, it needs another mesh
        if found.depth is not None and abs(now / edge - 1) > 0.02:
            found, _ = _search_near(_fine_section(scene, now), guided, found.depth, end)
    stable = found.stable_to * D
    if found.depth is None or found.force is None:
        return Critical(None, None, stable, found.message.format(f"{stable:.4g}"))
    return Critical(found.depth * D, found.force * scene.design.E_now * D**2, stable, "")


def _fine_section(scene: Scene, edge: float | None = None) -> MeshSpecification:
    """Return the axisymmetric section, refined at the undeformed radius `edge` over D at which the contact ends."""
    size, patch = scene.accuracy.section_size, RIM * scene.accuracy.section_patch
    rim = None if edge is None else (edge, min(patch, EDGE_SHARE * edge))
    return replace(specification(scene, size), fillet=PRESS_FILLET, rim=rim)


class _StoppedError(Exception):
    """The press does not reach a depth, or its stability there is unknown."""


Found = tuple[Critical, float]
"""Result on one mesh, in units of D and E, its message with room for the depth in mm; and the undeformed radius at
which the contact ends at the critical depth."""
NOWHERE: Found = Critical(None, None, 0.0, UNREACHED), 0.0


def _search_near(section: MeshSpecification, guided: bool, depth: float, end: float) -> Found:
    """Find the first instability near a depth; start from rest if the press is unstable or fails before that depth.

    An unstable state may lie on another branch, from which unloading does not return to the stable one.
    """
    found = _search(section, guided, (1 - STEP) * depth, STEP * depth, end)
    return found or _search(section, guided, 0.0, depth / 4, end) or NOWHERE


def _search(section: MeshSpecification, guided: bool, start: float, step: float, end: float) -> Found | None:
    """Find the first instability on one mesh.

    None where the press does not reach the depth `start`, or is not known to be stable there.

    start, step, end : first depth, step and last depth of the search, over D; a start of 0 is the state at rest.
    """
    path, known = Path(PathModels(section, kappa=KAPPA)), dict[float, float]()
    state, sideways = path.rest, SidewaysModel(path.rest.d, section.size)

    def press(depth: float) -> PathState:
        nonlocal state
        reached = path.advance(state, np.array([depth, 0.0, 0.0]))
        state = reached.state
        if reached.stop:
            raise _StoppedError(UNREACHED)
        return state

    def stiffness(depth: float) -> float:
        """Return the lateral stiffness, negative wherever there is an unstable direction."""
        if depth not in known:
            lateral, stability = sideways.measure(press(depth), guided=guided)
            # a negative stiffness is a direction of lower energy, however many the pivots count
            if stability.is_unknown and not lateral < 0:
                raise _StoppedError(UNCOUNTED)
            # with several unstable directions the stiffness may be positive again: the count decides its sign
            known[depth] = lateral if stability.is_stable else -abs(lateral)
        return known[depth]

    stable, depth = 0.0, start or step
    try:
        while stiffness(depth) > 0:
            if depth >= end:
                return Critical(None, None, depth, ""), 0.0
            stable, depth = depth, min(depth + step, end)
        if start and not stable:
            return None
        # the bracket begins at rest if the first step is already unstable
        if not stable:
            known[stable] = sideways.stiffness_at_rest
        depth = float(brentq(stiffness, stable, depth, rtol=1e-4))
        press(depth)
    except _StoppedError as stopped:
        return None if start and not stable else (Critical(None, None, stable, str(stopped)), 0.0)
    stable = max(depth for depth, value in known.items() if value > 0)
    return Critical(depth, integrate_normal_force(state), stable, ""), measure_contact_edge(state)
