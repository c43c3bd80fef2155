"""Relative errors of an answer, estimated from its difference to the answer on a coarser mesh.

A state on a section is solved again on a mesh that is coarser everywhere (`Scene.coarser`), an analysis on one with
longer edges (`estimated`). A rule expects the error from the relative difference d of both answers.

With the edge length h of the mesh, and a base b that measures how hard the state is to resolve,

    usual difference    u = m (h / D)^p / b^q
    expected error      c u^(1 - s) max(d, LEAST_OVER_USUAL u)^s

Where a contact ends between two integration points is random, which causes errors of either sign. Where they prevail,
u is a better measure of the error than d, and s is small; with s = 1 the expected error is c d, with a floor.

The constants are in error_rules.csv beside this module (all numbers are of dimension 1), by scene, by magnet (rigid,
ignored, or any) or motion of a vibration (z, x), and by quantity. Each row has the version of the answers that its
evidence is of (`fem.physics_version`), the study, and the commit whose solves it used; fem/README.md says how the
constants were found. A row of another version than today's is no rule: the estimate is then unknown.

Scenes and their bases:

- press, deep: frictionless presses above and below the first depth of `press_limits`; pressed: a press before a
  shear, on its mesh, which is refined where the contact ends; stick, far: shears of a glued plate up to STICK_SHEAR
  and beyond; grip: a shear of a grip that ends on the dome, whose force is all along the shear; wall grip: of one
  that ends on the cylinder, where the mesh has no node at its edge, so that b is the free length below it over D;
  friction: any state with Coulomb friction, where the coarser solve also takes longer load steps. Elsewhere b is the
  contact radius over D, at least LEAST_RADIUS. The quantity sideways is the force along the shear alone, and its base
  the share of that component in the whole force: slip depends on the normal force, beside which it may be small.
  Upright presses have no tilt; their rule of the tilt is that of the shift. NUMBERS have the same base, but
  dissipated the energy that slip has dissipated over the stored one, of which some small share is lost or won by the
  load increments. A share that slips has an absolute error.
- tilted: a tilted plate, on sections, that presses, sticks or rubs. solid, solid press: tetrahedra refined
  where the contact ends, and not, as in an upright press; with friction their rule of sideways is that of friction.
- critical: depth and force at which a press buckles; b is the depth over D, at least LEAST_DEPTH. small shear:
  stiffness, shift and tilt; b is the contact radius over D, at least LEAST_RADIUS. modes: frequency and pressed
  frequency; b = 1 / (omega D (rho / E)^(1/2)).
- vibrating press, vibrating shear: gains of a vibration away from resonances, about a press or about a state that is
  sheared, tilted or held; b = 1. force is the force over the motion, shift and reading the magnet's shift and the
  reading of an element over the force, base the shift over that of the base of the free sensor.
"""

from __future__ import annotations

import csv
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from fem.accuracy import longer_edges
from fem.physics_version import PHYSICS, outdated
from fem.scene import Scene, press_limits
from fem.solution import Estimates, Solution
from geometry.arrays import Array
from geometry.bad_input import BadInput
from geometry.loads import Load, Response

VibrationQuantity = Literal["force", "shift", "reading", "base"]

ANY = "any"
"""Variant of a rule that holds with and without a rigid magnet."""
TABLE = Path(__file__).with_name("error_rules.csv")
LEAST_OVER_USUAL = 0.2
"""Lower bound of the actual difference, over the usual one: two meshes may agree by chance. Of the 2920 differences
in the study 11 % are smaller."""
LEAST_RADIUS = 0.06
"""Contact radius over D below which the usual difference no longer grows. The lightest presses of the study have
0.07; below, the mesh is graded to the contact (`fem.solve.load_case_models`)."""
LEAST_DEPTH = 0.15
"""Critical depth over D below which the usual difference no longer decreases: slender beams buckle at smaller depths
than the study has, whose smallest is 0.12."""
CERTAIN_SHARE = 0.25
"""Least estimated error over the actual difference: a mesh that converges with order 4, faster than the meshes here,
has the error d / (COARSER^4 - 1) = 0.25 d."""
UNUSUAL = 8.0
"""Actual over usual difference above which a state is unlike those of the study, where 1.5 % of 2920 differences are
larger. The excess counts as error."""

STICK_SHEAR, FAR_SHEAR, FRICTION_SHEAR = 0.15, 0.6, 0.25
"""Largest shears over D of the scenes stick (and grip), far and friction: the largest of the study."""
ON_LIMIT = 1.001
"""Load over such a limit up to which it counts as on the limit: the loads of the study are rounded to four digits."""
ORDER_POWER = 5.0
"""Power of the number of orders with which errors under a tilted plate decrease, for a load that has fewer orders
than it needs (`fem.scene.Scene.orders_needed`). On the paper's sensor under 40 degrees at D/40, which
needs 11, forces with 4, 5, 6 and 8 orders were off by 22, 13, 7 and about 1 %."""
DEPTH_POWER = 1.5
"""Power of the depth with which errors are expected to grow beyond the deepest presses of the study. At four times
the largest depth of scene press (`magtip solve paper --depth 3.6`) the force at level standard differs from that at
fine by five times what its rule expects, and 4^1.5 = 8. Beyond the largest shears errors are expected to grow in
proportion to the shear."""


@dataclass(frozen=True, slots=True)
class ErrorRule:
    """Relative error of one quantity from its relative difference d to the coarser mesh, see the module docstring.

    m : usual difference at an edge length of D and a base of 1.
    p : order with which the usual difference decreases with the edge length.
    q : power of the base with which it decreases; negative where it grows.
    c : expected error over the usual difference, where the actual difference is the usual one.
    s : weight of the actual difference in the expected error, as an exponent: from 0 (only u) to 1 (only d).
    """

    m: float
    p: float
    q: float
    c: float
    s: float

    def usual(self, edge: float, base: float) -> float:
        """Return the usual difference u at an edge length over D."""
        return self.m * math.pow(edge, self.p) / math.pow(base, self.q)

    def expected(self, usual: float, difference: float) -> float:
        """Return the expected error from the usual difference u and the actual difference d.

        >>> ErrorRule(m=1.0, p=2.0, q=0.0, c=2.0, s=0.5).expected(usual=0.25, difference=1.0)
        1.0
        """
        return self.c * math.pow(usual, 1 - self.s) * math.pow(max(difference, LEAST_OVER_USUAL * usual), self.s)


def table_rows() -> list[dict[str, str]]:
    """Return the rows of error_rules.csv."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@functools.cache
def error_rules() -> Mapping[tuple[str, str, str], ErrorRule | None]:
    """Return the rules by scene, magnet or motion, and quantity; None where the answers have changed since."""
    today: dict[str, int] = dict(PHYSICS.items())
    return {
        (row["scene"], row["variant"], row["quantity"]): None
        if outdated({row["model"]: int(row["version"])}, {row["model"]: today[row["model"]]})
        else ErrorRule(*(float(row[name]) for name in ("m", "p", "q", "c", "s")))
        for row in table_rows()
    }


def scene_of_rules(case: str) -> str:
    """Return the scene in the table of a load case: tilted plates share one."""
    return "tilted" if case.startswith("tilted ") else case


def error_rule(scene: str, variant: str, quantity: str) -> ErrorRule | None:
    """Return a rule; None without one, and where the answers have changed since its study.

    >>> error_rule("modes", "rigid", "torsion") is None
    True
    """
    rules, scene = error_rules(), scene_of_rules(scene)
    return rules.get((scene, variant, quantity)) or rules.get((scene, ANY, quantity))


ROUNDING = 1e-12
"""Tilts (rad) and numbers of a tangent below this are rounding errors, to which no error is relative. Forces and
shifts have no such bound: they are small at small loads."""


Answer = TypeVar("Answer", bound=Any)


def estimated(
    scene: Scene,
    solve: Callable[[Scene], Answer],
    estimate: Callable[[Answer, Answer, Scene], object],
    found: Callable[[Answer], bool] = lambda _: True,
) -> Answer:
    """Return the answer for a scene, a dataclass with the field `estimates`, and those from a second solve.

    The second mesh is that of `fem.accuracy.longer_edges`. `found` tells whether an answer has something to estimate.
    """
    answer = solve(scene)
    coarse = solve_coarser(scene, solve) if found(answer) else None
    return answer if coarse is None else replace(answer, estimates=estimate(answer, coarse, scene))


def solve_coarser(scene: Scene, solve: Callable[[Scene], Answer]) -> Answer | None:
    """Return the answer of an analysis for a scene on the mesh for its error estimates; None where that has none."""
    try:
        return solve(replace(scene, accuracy=longer_edges(scene.accuracy)))
    except BadInput:  # the press may stop earlier or become unstable on the coarser mesh
        return None


NUMBERS = ("contact_radius", "energy", "strain", "pressure", "crease", "dissipated", "slip_share")
"""Numbers of a state beside its response. Where a scene has no rule for one of them, its error is unknown."""


Numbers = dict[str, float | None]


def numbers_of(state: Solution) -> Numbers:
    """Return the NUMBERS of a state; None where there is none."""
    facts, slips = state.facts, state.slip_share
    return {
        "contact_radius": state.response.contact_radius or None,
        "energy": state.energy,
        "strain": facts.largest_strain,
        "pressure": facts.contact_pressure,
        "crease": facts.crease_ratio,
        "dissipated": None if slips is None else state.dissipated,
        "slip_share": slips,
    }


def estimate_state(found: Solution, coarse: Solution, scene: Scene) -> Estimates:
    """Return the estimated errors of a state of a scene, from the state on the coarser mesh."""
    one, other = ((state.response, numbers_of(state)) for state in (found, coarse))
    return estimate_numbers_of(one, other, found.load, scene, found.model)


def estimate_numbers_of(
    found: tuple[Response, Numbers], coarse: tuple[Response, Numbers], load: Load, scene: Scene, model: str
) -> Estimates:
    """Return the estimated errors of the response and the NUMBERS under one load, see `estimate_response`."""
    estimates = estimate_response(found[0], coarse[0], load, scene, model)
    case = load_case(load, scene)
    usual_base = _base(case, found[0], load, scene)
    growth, more = _growth_beyond_study(case, load, scene), dict[str, float | None]()
    for name in NUMBERS:
        value, other = found[1][name], coarse[1][name]
        if name == "slip_share" and value is not None and other is not None:
            value, other = 1.0, 1.0 + other - value  # a share, which may be 0, has an absolute error
        base = (value or 0.0) / (found[1]["energy"] or 1.0) if name == "dissipated" else usual_base
        rule = error_rule(case, scene.magnet, name) if base > 0 else None
        more[name] = relative_error(rule, (value,), (other,), _edge(scene), base, rounding=0.0, growth=growth)
    return replace(estimates, **more)


def estimate_response(found: Response, coarse: Response, load: Load, scene: Scene, model: str) -> Estimates:
    """Return the estimated errors of the response to one load of a scene, from that on the coarser mesh.

    load : of the response; less than the scene's where the path stopped early.
    model : of the response; before a shear it may still be axisymmetric.
    """
    case, accuracy = load_case(load, scene), scene.accuracy
    if load.imperfection and not load.shears_tip and found.shift[0] * coarse.shift[0] < 0:
        # an imperfect press may buckle to either side
        x, y, z = coarse.shift
        coarse = replace(coarse, shift=(-x, -y, z), tilt=-coarse.tilt, tilt_y=-coarse.tilt_y)
    edge, usual_base = _edge(scene), _base(case, found, load, scene)
    growth = _growth_beyond_study(case, load, scene)
    # the coarser solve of a model with one harmonic has two: the whole difference is an error of the model
    certain = 1.0 if model == "harmonic" and accuracy.harmonics == 1 else CERTAIN_SHARE

    error = functools.partial(relative_error, edge=edge, growth=growth, certain=certain)
    of_force, of_shift, of_tilt = (error_rule(case, scene.magnet, name) for name in ("force", "shift", "tilt"))
    tilt = error(of_tilt, (found.tilt, found.tilt_y), (coarse.tilt, coarse.tilt_y), base=usual_base)
    upright = not load.shears_tip and not load.plate_tilt and not load.imperfection
    sideways, along = None, _force_along_shear(found, load)
    if along:
        of_case = load.coulomb is None or case == "tilted friction"
        rule = error_rule(case if of_case else "friction", scene.magnet, "sideways")
        coarse_along, share = _force_along_shear(coarse, load), abs(along) / math.hypot(*found.force)
        base = usual_base if case == "wall grip" else share
        sideways = error(rule, (along,), (coarse_along,), base=base, rounding=0.0)
    return Estimates(
        force=error(of_force, found.force, coarse.force, base=usual_base, rounding=0.0),
        shift=error(of_shift, found.shift, coarse.shift, base=usual_base, rounding=0.0),
        # the tilt of tetrahedra under an upright press is mesh noise
        tilt=None if tilt is None or (upright and tilt > 1) else tilt,
        sideways=sideways,
    )


def _edge(scene: Scene) -> float:
    return scene.accuracy.solid_size if scene.solid else scene.accuracy.section_size


def _base(case: str, response: Response, load: Load, scene: Scene) -> float:
    """Return the base of a state's rules, over D: the free length below a wall grip, else the contact radius."""
    D, L = scene.design.D, scene.design.L
    if case == "wall grip":
        return (L - (load.grip or 0.0)) / D
    return max(response.contact_radius / D, LEAST_RADIUS)


def relative_error(
    rule: ErrorRule | None,
    value: Sequence[float | None],
    coarse: Sequence[float | None],
    edge: float,
    base: float,
    *,
    rounding: float = ROUNDING,
    growth: float = 1.0,
    certain: float = CERTAIN_SHARE,
) -> float | None:
    """Return the estimated error of a vector over its length; None where that is 0, or the rule or a number unknown.

    value, coarse : the vector, and the vector on the coarser mesh.
    edge, base : edge length of the mesh over D, and base of the rule.
    rounding : length up to which a vector is 0.
    growth, certain : factor on the error that the rule expects, and least error over the difference.
    """
    # None becomes NaN, which any sum keeps, so that a vector that is known in part has no estimate
    numbers, coarse_numbers = ([math.nan if x is None else x for x in vector] for vector in (value, coarse))
    size, distance = math.hypot(*numbers), math.dist(numbers, coarse_numbers)
    if rule is None or not size > rounding or math.isnan(distance):
        return None
    difference, usual = distance / size, rule.usual(edge, base)
    return max(growth * rule.expected(usual, difference), certain * difference, difference - UNUSUAL * usual)


def estimate_numbers(
    kind: str, numbers: Mapping[str, tuple[float | None, float | None]], scene: Scene, base: float
) -> Estimates:
    """Return the estimated errors of a critical state or a small shear, `kind`, from the numbers on both meshes.

    That of a number without a rule is None.
    """
    edge, magnet = scene.accuracy.section_size, scene.magnet
    return Estimates(
        **{
            name: relative_error(error_rule(kind, magnet, name), (number,), (coarse,), edge, base)
            for name, (number, coarse) in numbers.items()
        }
    )


def estimate_vibration(
    quantity: VibrationQuantity, motion: str, difference: Array, amplification: Array, scene: Scene
) -> Array:
    """Return the estimated relative errors (f,) of a gain of a vibration.

    Parameters
    ----------
    quantity : see the module docstring.
    motion : of the plate, or of the base: "z" or "x".
    difference : (f,) relative differences to the coarser mesh.
    amplification : (f,) factors by which resonances amplify an error and a difference.
    scene : of the vibrating sensor.
    """
    load = scene.loads[0]
    moved = load.shears_tip or bool(load.plate_tilt) or load.grip is not None or load.coulomb is not None
    rule = error_rule("vibrating shear" if moved else "vibrating press", motion, quantity)
    if rule is None:
        return np.full(len(difference), np.nan)
    edge = scene.accuracy.section_size
    each = [relative_error(rule, (1.0, 0.0), (1.0, d), edge, 1.0) for d in (difference / amplification).tolist()]
    return amplification * np.array(each, dtype=np.float64)


def load_case(load: Load, scene: Scene) -> str:
    """Return the load case of a scene's load by which its rules are selected.

    >>> from geometry.design import paper
    >>> load_case(Load(depth=0.5), Scene(paper(), (Load(depth=0.5),)))
    'press'
    """
    if scene.solid:
        return "solid" if load.plate_tilt or scene.sideways else "solid press"
    if load.plate_tilt:
        return (
            "tilted friction" if load.coulomb is not None else "tilted stick" if load.shears_tip else "tilted press"
        )
    if load.coulomb is not None:
        return "friction"
    if not scene.sideways:
        return "deep" if load.depth > ON_LIMIT * press_limits(scene.design, scene.magnet)[0] else "press"
    if not load.shears_tip:
        return "pressed"
    if load.grip is not None:
        return "grip" if load.grip < scene.design.R else "wall grip"
    return "far" if load.shear > ON_LIMIT * STICK_SHEAR * scene.design.D else "stick"


def _growth_beyond_study(case: str, load: Load, scene: Scene) -> float:
    """Return the factor on the expected error for a load beyond those of the study, see DEPTH_POWER."""
    first, deepest = press_limits(scene.design, scene.magnet)
    depth = load.depth / (deepest if case == "deep" else first)
    farthest = FAR_SHEAR if case == "far" else STICK_SHEAR if load.coulomb is None else FRICTION_SHEAR
    shear = load.shear / (farthest * scene.design.D) if load.shears_tip else 0.0
    growth = math.pow(max(depth, 1.0), DEPTH_POWER) * max(shear, 1.0)
    if case in ("tilted press", "tilted stick", "tilted friction") and load.depth:
        depth = load.depth / scene.design.D
        growth *= math.pow(scene.orders_needed(depth) / scene.harmonics_at(depth), ORDER_POWER)
    return growth


def _force_along_shear(response: Response, load: Load) -> float:
    """Return the component of the force along a load's shear, N; 0 where the load does not shear the tip."""
    if not load.shears_tip:
        return 0.0
    return (response.force[0] * load.shear_x + response.force[1] * load.shear_y) / load.shear
