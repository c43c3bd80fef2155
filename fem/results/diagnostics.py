"""Facts of a state beside its response: why its path stopped, where it became unstable, and what limits its use.

`gather` collects the facts and `classify` derives the status; `fem.results.state_messages` puts the facts into words.
`diagnose` does all three, for static states and for states in time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal, TypeVar

import numpy as np

from fem.model import elements
from fem.model.material import strains
from fem.model.symmetry_models import Discretisation
from fem.results import material_stability, silicone_strain
from fem.results.lateral_stiffness import StabilityMargin
from fem.results.state_messages import describe
from fem.scene import Scene
from fem.solution import Diagnosed, Facts, Remark, Status
from fem.solve.depth_ranges import harmonics_missing
from fem.solve.newton import Stop
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.loads import Response

Found = TypeVar("Found", bound=Diagnosed)
Margin = Callable[[PathState], StabilityMargin]
BUCKLED = 0.01
"""Sideways shift of the magnet over D, or its tilt in rad, beyond which a frictionless press has left the symmetric
state; asymmetry of the mesh alone causes less than a third of this."""
NEAR = 0.9
"""Depth over the estimated critical depth beyond which a press is reported as close to it."""
FLAT = 0.5
"""Least volume ratio J at the integration points below which the elements are searched for inverted silicone."""
FOLD_GRID, OFF_CORNER, FOLD_BATCH = 6, 1e-6, 256
"""Search for inverted silicone. FOLD_GRID: grid steps along the side of a triangle (half as many for a tetrahedron).
OFF_CORNER: relative distance of the grid from the corners. FOLD_BATCH: elements per batch."""


def diagnose(
    found: Found,
    state: PathState,
    scene: Scene,
    stop: Stop = "",
    margin: Margin | None = None,
    *,
    touched: bool = False,
) -> Found:
    """Return a state that was read from one of a path, with its facts, and status and message that follow from them.

    Parameters
    ----------
    stop : why the path ended before the requested load; empty if it did not.
    margin : returns the distance of an axisymmetric press from sideways buckling; None: no check.
    touched : whether the tip has carried a force before, so that a plate without force has left it.
    """
    facts = gather(state, found, scene.design.D, stop, margin, touched=touched)
    if state.d.revolved:
        facts = replace(facts, harmonics_missing=harmonics_missing(scene, float(state.position[0])))
    found = replace(found, facts=facts, status=classify(facts))
    return replace(found, message=describe(found, scene.design))


def gather(
    state: PathState, found: Diagnosed, D: float, stop: Stop, margin: Margin | None, *, touched: bool
) -> Facts:
    """Return the facts of a path's state.

    Parameters
    ----------
    found : read from the state, still without facts.
    D : diameter of the beam, mm.
    stop, margin, touched : as in `diagnose`.
    """
    onset, between = _onset_range(state, D)
    upright = not stop and not state.stability.is_unstable and onset is None and found.load.depth > 0
    upright = upright and found.response.force[2] > 0
    checked = upright and state.d.model == "axisymmetric" and not state.sheared
    near = margin(state) if margin and checked else None
    remark = None if stop else _choose_remark(state, found, D, near, touched=touched)
    # a path that stops because the law loses stability does so in the next state, which it cannot reach: there the
    # strains are extrapolated
    reach = material_stability.REACH if stop or state.stability.is_unstable or onset else 1.0
    u = state.u
    stretches = material_stability.find_loss(state.d.system, u, reach)
    return Facts(
        stop=stop,
        stability=state.stability,
        onset=onset,
        onset_mm=between,
        weak_at=None if stretches is None else (float(stretches[0]), float(stretches[1]), float(stretches[2])),
        inverted_share=inverted_share(state.d, u) if state.least_J < FLAT else 0.0,
        remark=remark,
        sideways_stiffness_ratio=None if near is None else near.ratio,
        critical_depth=None if near is None or near.critical_depth is None else near.critical_depth * D,
        crease_ratio=None if stop else material_stability.crease_ratio(state),
        largest_strain=silicone_strain.largest_strain(state.d.elements, u),
    )


def classify(facts: Facts) -> Status:
    """Return the status that follows from the facts.

    >>> from fem.solve.inertia import Stability
    >>> classify(Facts()), classify(Facts(stability=Stability(2))), classify(Facts("no_convergence"))
    ('ok', 'unstable', 'not_converged')
    >>> classify(Facts(remark="guided_only")), classify(Facts(crease_ratio=3.0))
    ('unstable', 'unstable')
    """
    if facts.stop:
        return "not_converged"
    if facts.remark == "no_touch":
        return "no_contact"
    if facts.verdict == "unstable":
        return "unstable"
    return "ok"


def inverted_share(d: Discretisation, u: Array) -> float:
    """Return the share of the silicone's volume that is inverted (det F <= 0), on a grid of points in each element.

    Inverted spots lie between integration points, where every J is positive.
    """
    dim = d.elements.dim
    n = FOLD_GRID // (dim - 1)
    grid = np.indices((n + 1,) * dim).reshape(dim, -1)
    # inversion begins at corners, but a corner on the axis has no 1 / r: the grid stays slightly inside
    points = 1 / (dim + 1) + (1 - OFF_CORNER) * (grid[:, grid.sum(axis=0) <= n] / n - 1 / (dim + 1))
    e = elements.build(d.mesh, axisymmetric=d.revolved, angles=d.elements.angles, points=points)
    folded = whole = 0.0
    for at in range(0, len(e.cells), FOLD_BATCH):
        part = slice(at, at + FOLD_BATCH)
        G = elements.gradient(e, part, u)
        J, volumes = 1 + strains(G.reshape(9, -1))[0], elements.volumes(e, part).ravel()
        folded, whole = folded + float(volumes[J <= 0].sum()), whole + float(volumes.sum())
    return folded / whole


def _onset_range(state: PathState, D: float) -> tuple[Literal["depth", "shear"] | None, tuple[float, float] | None]:
    """Return which coordinate changed when the path became unstable, and between which values, mm."""
    if state.onset is None:
        return None, None
    before, after = state.onset
    if before[0] != after[0]:
        return "depth", (float(before[0]) * D, float(after[0]) * D)
    return "shear", (float(np.linalg.norm(before[1:])) * D, float(np.linalg.norm(after[1:])) * D)


def _choose_remark(
    state: PathState, found: Diagnosed, D: float, near: StabilityMargin | None, *, touched: bool
) -> Remark | None:
    """Return the most important limitation of an answer; None if there is none."""
    load, normal, sheared = found.load, found.response.force[2], state.sheared
    pressed = load.depth > 0
    if pressed and not normal > 0 and not sheared and not touched:
        return "no_touch"
    if state.stability.is_unstable or state.onset is not None:
        return None
    if (touched or state.friction is not None) and pressed and not normal > 0:
        return "touch_lost"
    if pressed and normal < 0:
        return "pulled"
    if pressed and not sheared and not load.plate_tilt and _distance_from_axis(found.response, D) > BUCKLED:
        return "leaning" if load.imperfection else "given_way"
    if load.shear and not sheared:
        return "slides_over"
    if near and near.stability.is_unstable:
        return "guided_only"
    if near and near.critical_depth is not None and load.depth > NEAR * near.critical_depth * D:
        return "nearly_guided_only"
    if state.friction is not None:
        slips = found.slip_share
        if slips:
            return "full_slip" if slips == 1 and sheared else "part_slips"
    if near and near.stability.is_unknown:
        return "guided_unknown"
    return "idle_stick" if load.friction == "stick" and not sheared else None


def _distance_from_axis(response: Response, D: float) -> float:
    """Return how far the magnet has left the axis: its sideways shift over D or its tilt, whichever is larger."""
    return max(math.hypot(*response.shift[:2]) / D, math.hypot(response.tilt, response.tilt_y))
