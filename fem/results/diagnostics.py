"""What is known of a state beside its answer: why its path stopped, where it turned unstable, what to beware of.

`gather` looks at a path, `status` follows from what it finds, and `sentence` is the one place where it becomes text.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem.discretisation import element_integrals, elements
from fem.discretisation.symmetry_models import Discretisation
from fem.material import strain
from fem.results import material_stability
from fem.results.lateral_stiffness import Margin, lateral, margin
from fem.solvers.load_stepping import Path
from fem.solvers.newton import STOPPED, Stop
from geometry.design import LAWS, Design
from geometry.loads import Load, Response

Array = NDArray[np.float64]
Status = Literal["ok", "not_converged", "unstable", "no_contact"]
Remark = Literal[
    "no_touch",
    "touch_lost",
    "pulled",
    "leaning",
    "given_way",
    "slides_over",
    "guided_only",
    "nearly_guided_only",
    "full_slip",
    "part_slips",
    "idle_stick",
]

BUCKLED = 0.01
"""Sideways shift of the magnet over D, or its tilt, beyond which a frictionless press is no longer the symmetric one;
mesh noise alone stays below a third of it."""
NEAR = 0.9
"""Depth over the expected critical one from which a press is said to be near it."""
FLAT = 0.5
"""Least volume ratio J at the points of integration below which it is looked for silicone that is inside out."""
FOLDED = 1e-6
"""Share of the silicone that is inside out which is worth a word."""
FOLD_GRID, OFF_CORNER, FOLD_BATCH = 6, 1e-6, 256
"""Steps along a triangle's side (a tetrahedron's: half as many) where it is looked, how far off its corners, and
elements at a time."""


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of a state beside its numbers.

    Attributes
    ----------
    stop : why the path ended short of the load; empty if it did not.
    unstable_directions : of the state; None where it is not known.
    onset, onset_mm : what moved when the path turned unstable, and between which of its values (from, to), mm; None
        where the path did not, or where nobody looked.
    weak_at : principal stretches, the largest first, at which the law loses stability in the state, or just beyond
        one that stopped or is unstable; None if nowhere.
    inside_out_share : share of the silicone's volume with det F <= 0; 0 where J at the points of integration is
        above FLAT.
    remark : what a user should know of the answer, None if nothing. "given_way" is a tip that left the symmetric
        press to a side that the mesh chose, "leaning" one that an imperfection led there, "guided_only" a section
        whose tip would give way if it were free to slide, "nearly_guided_only" one that is close to that, "pulled" a
        glued plate that pulls at the tip.
    sideways_stiffness_ratio : stiffness of a frictionless press's tip, free to slide, against a force sideways, over
        that of the unpressed beam; 0 where it gives way sideways. None where nobody looked (see
        `fem.results.lateral_stiffness`).
    critical_depth : where that is to be expected, mm, to some 10 % (see `fem.results.lateral_stiffness`); None far
        from it, before or past it. `fem.stability` finds it, with an error estimate.
    """

    stop: Stop = ""
    unstable_directions: int | None = None
    onset: Literal["depth", "shear"] | None = None
    onset_mm: tuple[float, float] | None = None
    weak_at: tuple[float, float, float] | None = None
    inside_out_share: float = 0.0
    remark: Remark | None = None
    sideways_stiffness_ratio: float | None = None
    critical_depth: float | None = None


def gather(
    path: Path, D: float, load: Load, stop: Stop, response: Response, slip_share: float | None, *, watch: bool
) -> Facts:
    """The facts of a path's present state.

    Parameters
    ----------
    D : the beam's diameter, mm.
    load, response : of that state.
    stop : why the path ended before the load that was asked for; empty if it did not.
    watch : look whether an axisymmetric press is stable sideways.
    """
    onset, between = _onset(path, D)
    upright = not stop and not path.unstable and onset is None and load.depth > 0 and response.force[2] > 0
    watched = watch and upright and path.d.model == "axisymmetric" and not path.sheared
    near = margin(path) if watched and path.friction is None else None
    gives_way = bool(near.unstable if near else watched and lateral(path).unstable)
    remark = None if stop else _remark(path, D, load, response, slip_share, near, gives_way=gives_way)
    # a good state may hold points beyond; where a path goes wrong they are beyond in the state that it did not reach
    reach = material_stability.REACH if stop or path.unstable or onset else 1.0
    stretches = material_stability.lost(path.d.system, path.u, reach)
    return Facts(
        stop=stop,
        unstable_directions=path.unstable,
        onset=onset,
        onset_mm=between,
        weak_at=None if stretches is None else (float(stretches[0]), float(stretches[1]), float(stretches[2])),
        inside_out_share=inside_out(path.d, path.u) if path.flattest < FLAT else 0.0,
        remark=remark,
        sideways_stiffness_ratio=None if near is None else near.ratio,
        critical_depth=None if near is None or near.critical_depth is None else near.critical_depth * D,
    )


def status(facts: Facts) -> Status:
    """What became of a state.

    >>> status(Facts()), status(Facts(unstable_directions=2)), status(Facts("no_convergence", 2))
    ('ok', 'unstable', 'not_converged')
    """
    if facts.stop:
        return "not_converged"
    if facts.remark == "no_touch":
        return "no_contact"
    if facts.unstable_directions or facts.onset or facts.remark == "given_way":
        return "unstable"
    return "ok"


def sentence(
    facts: Facts, design: Design, load: Load, response: Response, slip_share: float | None, model: str
) -> str:
    """The facts in words, with what to try; empty where all is well."""
    weak = _weak(facts, design)
    parts = []
    if facts.stop:
        remedy = weak or "try a smaller load or another accuracy"
        parts.append(f"stopped at {_place(load)}: {STOPPED[facts.stop]}; {remedy}")
    if facts.onset or (status(facts) == "unstable" and facts.unstable_directions):
        parts.append(_instability(facts))
    if weak and not facts.stop:
        parts.append(weak)
    if facts.remark:
        parts.append(_remark_text(facts.remark, load, response, slip_share, model, facts.critical_depth))
    if facts.inside_out_share >= FOLDED:
        parts.append(
            f"{facts.inside_out_share:.1g} of the silicone is inside out between points of integration, at edges "
            "like the clamp's: forces and the magnet's motion hold, displacements there do not"
        )
    return "; ".join(parts)


def inside_out(d: Discretisation, u: Array) -> float:
    """Share of the silicone's volume that is inside out (det F <= 0), on a grid of points in each element.

    Such spots lie between points of integration, where every J is positive.
    """
    dim = d.elements.dim
    n = FOLD_GRID // (dim - 1)
    grid = np.indices((n + 1,) * dim).reshape(dim, -1)
    # corners are where it begins; on the axis 1 / r has no value
    points = 1 / (dim + 1) + (1 - OFF_CORNER) * (grid[:, grid.sum(axis=0) <= n] / n - 1 / (dim + 1))
    e = elements.build(d.mesh, axisymmetric=d.revolved, angles=d.elements.angles, points=points)
    folded = whole = 0.0
    for at in range(0, len(e.cells), FOLD_BATCH):
        part = slice(at, at + FOLD_BATCH)
        J, volumes = 1 + strain(element_integrals.gradient(e, part, u)).Jm1, element_integrals.volumes(e, part)
        folded, whole = folded + float(volumes[J <= 0].sum()), whole + float(volumes.sum())
    return folded / whole


def _onset(path: Path, D: float) -> tuple[Literal["depth", "shear"] | None, tuple[float, float] | None]:
    """What moved when the path turned unstable, and between which of its values, mm."""
    if path.onset is None:
        return None, None
    before, after = path.onset
    if before[0] != after[0]:
        return "depth", (float(before[0]) * D, float(after[0]) * D)
    return "shear", (float(np.linalg.norm(before[1:])) * D, float(np.linalg.norm(after[1:])) * D)


def _remark(
    path: Path,
    D: float,
    load: Load,
    response: Response,
    slip_share: float | None,
    near: Margin | None,
    *,
    gives_way: bool,
) -> Remark | None:
    """What a user should know of an answer: first of all what it is not."""
    normal, sheared = response.force[2], path.sheared
    pressed = load.depth > 0
    if pressed and not normal > 0 and not sheared:
        return "no_touch"
    if path.unstable or path.onset is not None:
        return None
    if path.friction is not None and pressed and not normal > 0:
        return "touch_lost"
    if pressed and normal < 0:
        return "pulled"
    if pressed and not sheared and not load.plate_tilt and _aside(response, D) > BUCKLED:
        return "leaning" if load.imperfection else "given_way"
    if (load.shear_x or load.shear_y) and not sheared:
        return "slides_over"
    if gives_way:
        return "guided_only"
    if near and near.critical_depth is not None and load.depth > NEAR * near.critical_depth * D:
        return "nearly_guided_only"
    if path.friction is not None:
        return "full_slip" if slip_share == 1 and sheared else "part_slips" if slip_share else None
    return "idle_stick" if load.friction == "stick" and not sheared else None


def _aside(response: Response, D: float) -> float:
    """How far the magnet has left the axis: its sideways shift over D or its tilt, the larger one."""
    return max(math.hypot(*response.shift[:2]) / D, math.hypot(response.tilt, response.tilt_y))


def _place(load: Load) -> str:
    """Where the load is."""
    shear = math.hypot(load.shear_x, load.shear_y)
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


def _remark_text(
    remark: Remark, load: Load, response: Response, slip_share: float | None, model: str, critical: float | None
) -> str:
    """A remark in words."""
    shift, tilt = math.hypot(*response.shift[:2]), math.hypot(response.tilt, response.tilt_y)
    aside = f"shift {shift:.2g} mm, tilt {tilt:.2g} rad"
    at = f", at about {critical:.3g} mm, give or take a tenth (now {load.depth:.4g} mm)" if critical else ""
    leads = f"the branch to which an imperfection of {load.imperfection:g} N leads"
    remedy = (
        "the plate has not reached it to within rounding: take a larger depth"
        if model == "axisymmetric"
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
        "part_slips": f"{slip_share or 0:.2g} of the area in contact slips",
        "idle_stick": "stick acts once the plate shears: the press itself is frictionless",
    }
    return texts[remark]
