"""The message of a state: its facts in words, with the remedy. All facts become text here and nowhere else."""

from __future__ import annotations

import math

from fem.solution import CREASE, Diagnosed, Facts, Remark
from fem.solve.newton import STOPPED
from geometry.design import LAWS, Design
from geometry.loads import Load

FOLDED = 1e-6
"""Share of inverted silicone above which the message mentions it; smaller shares are single corners."""


def describe(solution: Diagnosed, design: Design) -> str:
    """Return the facts of a state in words, with the remedy; empty if there is nothing to report."""
    facts, weak = solution.facts, _describe_weakness(solution.facts, design)
    parts = []
    if facts.stop:
        remedy = weak or "try a smaller load or another accuracy"
        parts.append(f"stopped at {_describe_load(solution.load)}: {STOPPED[facts.stop]}; {remedy}")
    if facts.onset or (solution.status == "unstable" and facts.stability.is_unstable):
        parts.append(_describe_instability(facts))
        if solution.model == "axisymmetric" and not facts.creased:
            parts.append(
                "the free skin is not compressed far enough to crease, so it cannot be told whether the silicone or "
                "the mesh is unstable: compare another accuracy"
            )
    if facts.creased:
        parts.append(
            f"the free skin creases: its stretch normal to itself is {facts.crease_ratio:.2g} times that along it "
            f"(a neo-Hookean solid creases from {CREASE:g} on); the depth at which a crease opens, and the force "
            "beyond, depend on the mesh"
        )
    if weak and not facts.stop:
        parts.append(weak)
    if facts.remark:
        parts.append(_describe_remark(facts.remark, solution))
    if facts.stability.is_unknown and solution.status == "ok":
        reason = "a contact that slips does" if solution.slip_share else "its pivots do"
        parts.append(f"whether this equilibrium is stable is not known ({reason} not tell)")
    if facts.harmonics_missing:
        parts.append(
            f"so light a touch of so steep a plate needs {facts.harmonics_missing} harmonics more than the most that "
            "a model has: the error estimates are wider; press deeper or tilt less"
        )
    if facts.inverted_share >= FOLDED:
        parts.append(
            f"{100 * facts.inverted_share:.1g} % of the silicone is inverted (J <= 0) between integration points, "
            "at edges such as the clamp's: forces and the magnet's shift are reliable, "
            "displacements at these edges are not"
        )
    return "; ".join(parts)


def _describe_load(load: Load) -> str:
    """Return the depth and shear of a load in words."""
    shear = load.shear
    return f"depth {load.depth:.4g} mm" + (f", shear {shear:.4g} mm" if shear else "")


def _describe_instability(facts: Facts) -> str:
    """Return where the first unstable direction appeared, and how many there are."""
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


def _describe_remark(remark: Remark, solution: Diagnosed) -> str:
    """Return a remark in words."""
    load, response, critical = solution.load, solution.response, solution.facts.critical_depth
    shift, tilt = math.hypot(*response.shift[:2]), math.hypot(response.tilt, response.tilt_y)
    aside = f"shift {shift:.2g} mm, tilt {tilt:.2g} rad"
    at = f"at a depth of about {critical:.3g} mm (+-10 %; now {load.depth:.4g} mm)" if critical else ""
    leads = f"this branch is selected by the imperfection of {load.imperfection:g} N"
    remedy = (
        "the depth is below the rounding error: take a larger depth"
        if solution.model == "axisymmetric"
        else "choose model axisymmetric, whose mesh follows the contact"
    )
    texts: dict[Remark, str] = {
        "no_touch": f"depth {load.depth:g} mm brings no integration point of this mesh into contact: {remedy}",
        "touch_lost": "the tip has lost contact with the plate and carries no load",
        "pulled": "the plate that sticks pulls on the tip: a real plate would peel off or slip earlier",
        "leaning": f"the beam leans sideways ({aside}): {leads}",
        "given_way": f"the beam has buckled sideways under the frictionless plate ({aside}; the mesh determines the "
        "direction): the symmetric press is unstable",
        "slides_over": "the frictionless plate slides over the tip, so the shear has no effect: "
        "choose friction stick or a coefficient",
        "guided_only": f"a beam whose tip slides freely on the plate buckles sideways {at or 'before this depth'}: "
        "this solution holds the tip on the axis (magtip stability computes the critical depth)",
        "guided_unknown": "whether a beam whose tip slides freely on the plate would buckle sideways is not known",
        "nearly_guided_only": f"a beam whose tip slides freely on the plate buckles sideways {at or 'soon'}: "
        "magtip stability computes the critical depth",
        "full_slip": "full slip: the whole contact area slides",
        "part_slips": f"{100 * (solution.slip_share or 0):.2g} % of the contact area slips",
        "idle_stick": "friction stick acts only during a shear: this press is frictionless",
    }
    return texts[remark]
