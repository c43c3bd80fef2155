"""Facts of a state beside its response: why its path stopped, where it became unstable, and what limits its use.

`diagnose` collects the facts, for static states and for states in time, and `describe` puts them into words, with the
remedy: all facts become text here and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from fem.model import elements
from fem.model.material import strains
from fem.model.symmetry_models import Discretisation
from fem.results import silicone_limits
from fem.results.lateral_stiffness import StabilityMargin
from fem.scene import Scene
from fem.solution import CREASE, Facts, Solution, Stop
from fem.solve.newton import STOPPED
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.design import LAWS, Design

Margin = Callable[[PathState], StabilityMargin]
BUCKLED = 0.01
"""Sideways shift of the magnet over D, or its tilt in rad, beyond which a frictionless press has left the symmetric
state; asymmetry of the mesh alone causes less than a third of this."""
FLAT = 0.5
"""Least J at the integration points from which on no inverted spot between them is looked for: elements have had none
there."""
NEAR = 0.9
"""Depth over the estimated critical depth beyond which a press is reported as close to it."""
REMARKS = {
    "no_touch": "depth {load.depth:g} mm brings no integration point of this mesh into contact: {remedy}",
    "touch_lost": "the tip has lost contact with the plate and carries no load",
    "pulled": "the plate that sticks pulls on the tip: a real plate would peel off or slip earlier",
    "leaning": "the beam leans sideways ({aside}): this branch is selected by the imperfection of "
    "{load.imperfection:g} N",
    "given_way": "the beam has buckled sideways under the frictionless plate ({aside}; the mesh determines the "
    "direction): the symmetric press is unstable",
    "slides_over": "the frictionless plate slides over the tip, so the shear has no effect: "
    "choose friction stick or a coefficient",
    "pushed_aside": "the pressed tip pushes along the shear instead of resisting it: before it stuck, "
    "a tip that slides freely would have buckled sideways (magtip stability computes the critical depth)",
    "guided_only": "a beam whose tip slides freely on the plate buckles sideways {before}: "
    "this solution holds the tip on the axis (magtip stability computes the critical depth)",
    "guided_doubtful": "whether a beam whose tip slides freely on the plate has buckled sideways at this depth is "
    "not known: its sideways stiffness is {ratio:.2g} +- {half_width:.2g} of that at rest; it gives way {near} "
    "(magtip stability computes the critical depth)",
    "guided_unknown": "whether a beam whose tip slides freely on the plate would buckle sideways is not known",
    "guided_unchecked": "whether a beam whose tip slides freely on the plate would buckle sideways was not checked, "
    "which a solve with error estimates does",
    "nearly_guided_only": "a beam whose tip slides freely on the plate buckles sideways {soon}: "
    "magtip stability computes the critical depth",
    "full_slip": "full slip: the whole contact area slides",
    "part_slips": "{percent:.2g} % of the contact area slips",
    "idle_stick": "friction stick acts only during a shear: this press is frictionless",
}
"""Sentences of `Facts.remark`."""


def diagnose(
    found: Solution,
    state: PathState,
    scene: Scene,
    stop: Stop = "",
    margin: Margin | None = None,
    *,
    touched: bool = False,
) -> Solution:
    """Return a solution that was read from a state of a path, with its facts, and status and message by them.

    stop : why the path ended before the requested load; empty if it did not.
    margin : returns the distance of an axisymmetric press from sideways buckling; None: no check.
    touched : whether the tip has carried a force before, so that a plate without force has left it.
    """
    D, depth, u = scene.design.D, float(state.position[0]), state.u
    onset, between = _onset_range(state, D)
    upright = not stop and not state.stability.is_unstable and onset is None and found.load.depth > 0
    upright = upright and found.response.force[2] > 0
    checked = upright and state.d.model == "axisymmetric" and not state.sheared
    near = margin(state) if margin and checked else None
    told = not scene.accuracy.estimates_only
    # a path that stops because the law loses stability does so in the next state, which it cannot reach: there the
    # strains are extrapolated
    reach = silicone_limits.REACH if stop or state.stability.is_unstable or onset else 1.0
    stretches = silicone_limits.find_loss(state.d.system, u, reach) if told else None
    facts = Facts(
        stop=stop,
        stability=state.stability,
        onset=onset,
        onset_mm=between,
        weak_at=None if stretches is None else (float(stretches[0]), float(stretches[1]), float(stretches[2])),
        inverted_share=None if state.least_J >= FLAT or not told else inverted_share(state.d, u),
        remark=None
        if stop
        else _choose_remark(state, found, D, near, touched=touched, looked=not checked or bool(near)),
        sideways_stiffness_ratio=None if near is None else near.ratio,
        sideways_half_width=None if near is None else near.half_width,
        critical_depth=None if near is None or near.critical_depth is None else near.critical_depth * D,
        crease_ratio=None if stop else state.crease_ratio,
        largest_strain=silicone_limits.largest_strain(state.d.elements, u),
        contact_pressure=silicone_limits.contact_pressure(state),
        harmonics_missing=scene.orders_needed(depth) - scene.harmonics_at(depth) if state.d.revolved else 0,
    )
    found = replace(found, facts=facts)
    return replace(found, message=describe(found, scene.design))


def inverted_share(d: Discretisation, u: Array) -> float:
    """Return the share of the silicone's volume that is inverted (det F <= 0), on a grid of points in each element.

    Inverted spots lie between integration points, where every J is positive.
    """
    e = d.folding_points
    folded = total = 0.0
    for at in range(0, len(e.cells), silicone_limits.BATCH):
        part = slice(at, at + silicone_limits.BATCH)
        G = elements.gradient(e, part, u)
        J, volumes = 1 + strains(G.reshape(9, -1))[0], elements.volumes(e, part).ravel()
        folded, total = folded + float(volumes[J <= 0].sum()), total + float(volumes.sum())
    return folded / total


def _onset_range(state: PathState, D: float) -> tuple[Literal["depth", "shear"] | None, tuple[float, float] | None]:
    """Return which coordinate changed when the path became unstable, and between which values, mm."""
    if state.onset is None:
        return None, None
    before, after = state.onset
    # a shear with a held normal force changes both
    if np.array_equal(before[1:], after[1:]):
        return "depth", (float(before[0]) * D, float(after[0]) * D)
    return "shear", (float(np.linalg.norm(before[1:])) * D, float(np.linalg.norm(after[1:])) * D)


def _choose_remark(
    state: PathState, found: Solution, D: float, near: StabilityMargin | None, *, touched: bool, looked: bool
) -> str | None:
    load, response, sheared = found.load, found.response, state.sheared
    pressed, normal = load.depth > 0, response.force[2]
    if pressed and not normal > 0 and not sheared and not touched:
        return "no_touch"
    if state.stability.is_unstable or state.onset is not None:
        return None
    if (touched or state.friction is not None) and pressed and not normal > 0:
        return "touch_lost"
    if pressed and normal < 0:
        return "pulled"
    off_axis = max(math.hypot(*response.shift[:2]) / D, math.hypot(response.tilt, response.tilt_y)) > BUCKLED
    if pressed and not sheared and not load.plate_tilt and off_axis:
        return "leaning" if load.imperfection else "given_way"
    if load.shear and not sheared:
        return "slides_over"
    # with slip, or in time, a force against the shear is no sign of buckling: the plate may have moved back
    if sheared and pressed and not touched and load.friction == "stick" and not load.plate_tilt:
        force, shear = response.force, load.imposed_shear
        if force[0] * shear[0] + force[1] * shear[1] < 0:
            return "pushed_aside"
    if near and near.stability.is_unstable:
        return "guided_only"
    if near and near.is_doubtful:
        return "guided_doubtful"
    if near and near.critical_depth is not None and load.depth > NEAR * near.critical_depth * D:
        return "nearly_guided_only"
    if state.friction is not None:
        slips = found.slip_share
        if slips:
            return "full_slip" if slips == 1 and sheared else "part_slips"
    if near and near.stability.is_unknown:
        return "guided_unknown"
    if not looked:
        return "guided_unchecked"
    return "idle_stick" if load.friction == "stick" and not sheared else None


def describe(solution: Solution, design: Design) -> str:
    """Return the facts of a state in words, with the remedy; empty if there is nothing to report."""
    facts, weak = solution.facts, _describe_weakness(solution.facts, design)
    sentences = []
    if facts.stop:
        remedy = weak or "try a smaller load or another accuracy"
        load = solution.load
        sheared = f", shear {load.shear:.4g} mm" if load.shear else ""
        sentences.append(f"stopped at depth {load.depth:.4g} mm{sheared}: {STOPPED[facts.stop]}; {remedy}")
    if facts.onset or (solution.status == "unstable" and facts.stability.is_unstable):
        sentences.append(_describe_instability(facts))
        if solution.model == "axisymmetric" and not facts.creased:
            sentences.append(
                "the free skin is not compressed far enough to crease, so it cannot be told whether the silicone or "
                "the mesh is unstable: compare another accuracy"
            )
    if facts.creased:
        sentences.append(
            f"the free skin creases: its stretch normal to itself is {facts.crease_ratio:.2g} times that along it "
            f"(a neo-Hookean solid creases from {CREASE:g} on); the depth at which a crease opens, and the force "
            "beyond, depend on the mesh"
        )
    if weak and not facts.stop:
        sentences.append(weak)
    if facts.remark:
        sentences.append(_describe_remark(facts.remark, solution))
    if facts.stability.is_unknown and solution.status == "ok":
        reason = "a contact that slips does" if solution.slip_share else "its pivots do"
        sentences.append(f"whether this equilibrium is stable is not known ({reason} not tell)")
    if facts.harmonics_missing:
        sentences.append(
            f"so light a touch of so steep a plate needs {facts.harmonics_missing} harmonics more than the most that "
            "a model has: the error estimates are wider; press deeper or tilt less"
        )
    # smaller shares are single corners
    if facts.inverted_share is not None and facts.inverted_share >= 1e-6:
        sentences.append(
            f"{100 * facts.inverted_share:.1g} % of the silicone is inverted (J <= 0) between integration points, "
            "at edges such as the clamp's: forces and the magnet's shift are reliable, "
            "displacements at these edges are not"
        )
    return "; ".join(sentences)


def _describe_instability(facts: Facts) -> str:
    n = facts.stability.directions
    count = f"{n} unstable direction{'s' if n != 1 else ''}" if n else "past it now"
    if facts.onset_mm is None:
        return f"{count}: this equilibrium is unstable"
    low, high = facts.onset_mm
    return (
        f"unstable since a {facts.onset} between {low:.4g} and {high:.4g} mm ({count}): beyond that the result may "
        f"depend on the path"
    )


def _describe_weakness(facts: Facts, design: Design) -> str:
    """Return where the law loses stability in the present state or just beyond it; empty if nowhere."""
    if facts.weak_at is None:
        return ""
    numbers = ", ".join(
        f"{name} = {value:g}" for name, value in zip(LAWS[design.law], design.law_numbers, strict=True)
    )
    return (
        f"the law {design.law} with {numbers} loses stability (Drucker) at principal stretches of "
        f"{', '.join(f'{value:.3g}' for value in facts.weak_at)}, which this load reaches: take constants that are "
        f"stable there (magtip fit lists the stable stretches) or a smaller load"
    )


def _describe_remark(remark: str, solution: Solution) -> str:
    load, response, critical = solution.load, solution.response, solution.facts.critical_depth
    shift, tilt = math.hypot(*response.shift[:2]), math.hypot(response.tilt, response.tilt_y)
    at = f"at a depth of about {critical:.3g} mm (+-10 %; now {load.depth:.4g} mm)" if critical else ""
    return REMARKS[remark].format(
        load=load,
        aside=f"shift {shift:.2g} mm, tilt {tilt:.2g} rad",
        before=at or "before this depth",
        soon=at or "soon",
        near=at or "near this depth",
        ratio=solution.facts.sideways_stiffness_ratio,
        half_width=solution.facts.sideways_half_width,
        remedy="the depth is below the rounding error: take a larger depth"
        if solution.model == "axisymmetric"
        else "choose model axisymmetric, whose mesh follows the contact",
        percent=100 * (solution.slip_share or 0),
    )
