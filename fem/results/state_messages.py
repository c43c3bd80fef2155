"""What a user should know of a state, in words, with what to try: the one place where facts become text."""

from __future__ import annotations

import math

from fem.solution import Facts, Remark, Solution
from fem.solvers.newton import STOPPED
from geometry.design import LAWS, Design
from geometry.loads import Load

FOLDED = 1e-6
"""Share of the silicone that is inside out which is worth a word."""


def describe(solution: Solution, design: Design) -> str:
    """The facts of a solution in words, with what to try; empty where all is well."""
    facts, weak = solution.facts, _weak(solution.facts, design)
    parts = []
    if facts.stop:
        remedy = weak or "try a smaller load or another accuracy"
        parts.append(f"stopped at {_place(solution.load)}: {STOPPED[facts.stop]}; {remedy}")
    if facts.onset or (solution.status == "unstable" and facts.unstable_directions):
        parts.append(_instability(facts))
    if weak and not facts.stop:
        parts.append(weak)
    if facts.remark:
        parts.append(_remark_text(facts.remark, solution))
    if facts.inside_out_share >= FOLDED:
        parts.append(
            f"{facts.inside_out_share:.1g} of the silicone is inside out between points of integration, at edges "
            "like the clamp's: forces and the magnet's motion hold, displacements there do not"
        )
    return "; ".join(parts)


def _place(load: Load) -> str:
    """Where the load is."""
    shear = load.shear
    return f"depth {load.depth:.4g} mm" + (f", shear {shear:.4g} mm" if shear else "")


def _instability(facts: Facts) -> str:
    """Where the first unstable direction appeared, and how many there are."""
    n = facts.unstable_directions
    count = f"{n} unstable direction{'s' if n != 1 else ''}" if n else "past it now"
    if facts.onset_mm is None:
        return f"{count}: the state is an equilibrium that does not last"
    low, high = facts.onset_mm
    return (
        f"unstable since a {facts.onset} between {low:.4g} and {high:.4g} mm ({count}): "
        "beyond that the answer may depend on the path"
    )


def _weak(facts: Facts, design: Design) -> str:
    """Where the law itself loses stability in the present state or just beyond it: what is to be said of it."""
    if facts.weak_at is None:
        return ""
    numbers = ", ".join(
        f"{name} = {value:g}" for name, value in zip(LAWS[design.law], design.law_numbers, strict=True)
    )
    return (
        f"the law {design.law} with {numbers} loses stability (Drucker) at principal stretches of "
        f"{', '.join(f'{value:.3g}' for value in facts.weak_at)}, to which this load leads: choose other numbers, "
        "such as magtip fit finds stable, or a smaller load"
    )


def _remark_text(remark: Remark, solution: Solution) -> str:
    """A remark in words."""
    load, response, critical = solution.load, solution.response, solution.facts.critical_depth
    shift, tilt = math.hypot(*response.shift[:2]), math.hypot(response.tilt, response.tilt_y)
    aside = f"shift {shift:.2g} mm, tilt {tilt:.2g} rad"
    at = f", at about {critical:.3g} mm, give or take a tenth (now {load.depth:.4g} mm)" if critical else ""
    leads = f"the branch to which an imperfection of {load.imperfection:g} N leads"
    remedy = (
        "the plate has not reached it to within rounding: take a larger depth"
        if solution.model == "axisymmetric"
        else "choose model axisymmetric, whose mesh follows the contact"
    )
    texts: dict[Remark, str] = {
        "no_touch": f"depth {load.depth:g} mm touches no integration point of this mesh: {remedy}",
        "touch_lost": "the tip has lost touch with the plate: it carries no load any more",
        "pulled": "the glued plate pulls at the tip by now: a real one would peel off or slip before",
        "leaning": f"the tip leans aside ({aside}): {leads}",
        "given_way": f"the tip has given way sideways under the frictionless plate ({aside}; the mesh decides to "
        "which side): the symmetric press is unstable",
        "slides_over": "the frictionless plate slides over the tip: the shear has no effect",
        "guided_only": "a tip that is free to slide on a frictionless plate gives way sideways before this depth"
        f"{at}: the answer is that of a guided one (magtip stability says at which depth)",
        "nearly_guided_only": f"a tip that is free to slide on a frictionless plate gives way sideways soon{at}: "
        "magtip stability says at which depth",
        "full_slip": "full slip: all that touches the plate slides",
        "part_slips": f"{solution.slip_share or 0:.2g} of the area in contact slips",
        "idle_stick": "stick acts once the plate shears: the press itself is frictionless",
    }
    return texts[remark]
