"""Relative errors of a solution, estimated from its difference to a companion that is solved more coarsely.

The rules are those of `fem.error_estimate_rules`; `magtip accuracy` holds the estimates against much finer meshes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fem.error_estimate_rules import (
    DEPTH_POWER,
    FAR_SHEAR,
    FRICTION_SHEAR,
    LEAST_RADIUS,
    ON_LIMIT,
    RESPONSE_RULES,
    STICK_SHEAR,
    SURE_SHARE,
    UNUSUAL,
    ErrorRule,
    LoadCase,
    press_limits,
)
from fem.scene import Scene
from fem.solution import Estimates
from geometry.loads import Load, Response

NOTHING = 1e-12
"""Tilts (rad) and numbers of a tangent below this are rounding, which no error is relative to; forces and shifts are
small at small loads."""


def estimate_response(one: Response, other: Response, load: Load, scene: Scene, model: str) -> Estimates:
    """Errors of a response to one of a scene's loads, from its companion's.

    Parameters
    ----------
    one, other : the response, and its companion's.
    load : which the response answers; less than one of the scene where the path stopped on the way.
    scene : of the response.
    model : that the response was read from; before a shear it may have no harmonics yet.
    """
    case, accuracy = load_case(load, scene), scene.accuracy
    rules = RESPONSE_RULES[case, scene.magnet]
    if load.imperfection and not load.shears_tip and one.shift[0] * other.shift[0] < 0:
        other = _mirrored(other)
    edge = accuracy.solid_size if scene.solid else accuracy.section_size
    radius = max(one.contact_radius / scene.design.D, LEAST_RADIUS)
    growth = _growth_beyond_study(case, load, scene)
    # what a second harmonic changes is all missing from an answer with one
    sure = 1.0 if model == "harmonic" and accuracy.harmonics == 1 else SURE_SHARE

    def estimate(
        rule: ErrorRule, value: Sequence[float], companion: Sequence[float], base: float, nothing: float = 0.0
    ) -> float | None:
        difference = _relative_difference(value, companion, nothing)
        return None if difference is None else _bounded_error(rule, difference, edge, base, growth, sure)

    tilt = estimate(rules.tilt, (one.tilt, one.tilt_y), (other.tilt, other.tilt_y), radius, NOTHING)
    upright = not load.shears_tip and not load.plate_tilt and not load.imperfection
    sideways, along = None, _force_along_shear(one, load)
    if along:
        rule = RESPONSE_RULES[case if load.coulomb is None else "friction", scene.magnet].sideways
        assert rule is not None  # all cases with a shear have one
        sideways = estimate(rule, (along,), (_force_along_shear(other, load),), abs(along) / math.hypot(*one.force))
    return Estimates(
        force=estimate(rules.force, one.force, other.force, radius),
        shift=estimate(rules.shift, one.shift, other.shift, radius),
        # what tetrahedra tilt by under an upright press is noise
        tilt=None if tilt is None or (upright and tilt > 1) else tilt,
        sideways=sideways,
    )


def estimate_number(rule: ErrorRule, one: float, other: float | None, edge: float, base: float) -> float | None:
    """Error of a number, from its companion's; None where it is 0 or the companion has none.

    Parameters
    ----------
    rule : one of `fem.error_estimate_rules.TANGENT_RULES`, whose base is told there.
    edge : edge length of the section over D.
    """
    difference = None if other is None else _relative_difference((one,), (other,), NOTHING)
    return None if difference is None else _bounded_error(rule, difference, edge, base)


def load_case(load: Load, scene: Scene) -> LoadCase:
    """The kind of a scene's load that a rule is for, see RESPONSE_RULES.

    >>> from geometry.design import paper
    >>> load_case(Load(depth=0.5), Scene(paper(), (Load(depth=0.5),)))
    'press'
    """
    if scene.solid:
        return "solid" if load.plate_tilt or scene.sideways else "solid press"
    if load.coulomb is not None:
        return "friction"
    if not scene.sideways:
        return "deep" if load.depth > ON_LIMIT * press_limits(scene.design, scene.magnet)[0] else "press"
    if not load.shears_tip:
        return "pressed"
    if load.grip is not None:
        return "grip"
    return "far" if load.shear > ON_LIMIT * STICK_SHEAR * scene.design.D else "stick"


def _growth_beyond_study(case: LoadCase, load: Load, scene: Scene) -> float:
    """How much more than by its rule to expect of a load beyond those of the study, see DEPTH_POWER."""
    first, deepest = press_limits(scene.design, scene.magnet)
    depth = load.depth / (deepest if case == "deep" else first)
    farthest = FAR_SHEAR if case == "far" else STICK_SHEAR if load.coulomb is None else FRICTION_SHEAR
    shear = load.shear / (farthest * scene.design.D) if load.shears_tip else 0.0
    return math.pow(max(depth, 1.0), DEPTH_POWER) * max(shear, 1.0)


def _mirrored(response: Response) -> Response:
    """The response that leans to the other side: an imperfect press may give way to either."""
    x, y, z = response.shift
    return replace(response, shift=(-x, -y, z), tilt=-response.tilt, tilt_y=-response.tilt_y)


def _force_along_shear(response: Response, load: Load) -> float:
    """Component of the force along a load's shear, N; 0 where the load does not shear the tip."""
    if not load.shears_tip:
        return 0.0
    return (response.force[0] * load.shear_x + response.force[1] * load.shear_y) / load.shear


def _relative_difference(one: Sequence[float], other: Sequence[float], nothing: float) -> float | None:
    """Length of the difference of two vectors over that of the first; None if that is no longer than `nothing`."""
    size = math.hypot(*one)
    return None if size <= nothing else math.dist(one, other) / size


def _bounded_error(
    rule: ErrorRule, difference: float, edge: float, base: float, growth: float = 1.0, sure: float = SURE_SHARE
) -> float:
    """The error that a rule expects at an edge length over D, times a growth, and no less than what is sure."""
    usual = rule.usual(edge, base)
    return max(growth * rule.expected(usual, difference), sure * difference, difference - UNUSUAL * usual)
