"""Relative errors of an answer, estimated from its difference to the answer on a coarser mesh.

`estimated` solves again on the coarser mesh. The rules are those of `fem.results.error_estimate_rules`; `magtip
validate accuracy` compares the estimates with the errors against much finer meshes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from fem.results.error_estimate_rules import (
    DEPTH_POWER,
    FAR_SHEAR,
    FRICTION_SHEAR,
    LEAST_RADIUS,
    ON_LIMIT,
    ORDER_POWER,
    STICK_SHEAR,
    SURE_SHARE,
    UNUSUAL,
    ErrorRule,
    LoadCase,
    VibrationQuantity,
    error_rule,
    press_limits,
)
from fem.scene import Scene
from fem.solution import Estimates
from fem.solve.load_case_models import harmonics_at, orders_needed
from geometry.arrays import Array
from geometry.bad_input import BadInput
from geometry.loads import Load, Response

ROUNDING = 1e-12
"""Tilts (rad) and numbers of a tangent below this are rounding errors, to which no error is relative. Forces and
shifts have no such bound: they are small at small loads."""


class WithEstimates(Protocol):
    """A dataclass with a field `estimates`."""

    __dataclass_fields__: ClassVar[dict[str, Any]]


Answer = TypeVar("Answer", bound=WithEstimates)


def estimated(
    scene: Scene,
    solve: Callable[[Scene], Answer],
    estimate: Callable[[Answer, Answer, Scene], object],
    found: Callable[[Answer], bool] = lambda _: True,
) -> Answer:
    """Return the answer for a scene with its estimates from a second solve on a mesh coarser by COARSER.

    Parameters
    ----------
    estimate : returns the estimates of an answer from the one on the coarser mesh.
    found : whether an answer has something to estimate.
    """
    answer, coarser = solve(scene), scene.coarser()
    try:
        coarse = solve(coarser) if coarser is not None and found(answer) else None
    except BadInput:  # the press may stop earlier or become unstable on the coarser mesh
        coarse = None
    return answer if coarse is None else replace(answer, estimates=estimate(answer, coarse, scene))


def estimate_response(found: Response, coarse: Response, load: Load, scene: Scene, model: str) -> Estimates:
    """Return the estimated errors of the response to one load of a scene.

    Parameters
    ----------
    found, coarse : the response, and the response on the coarser mesh.
    load : load of the response; less than the scene's where the path stopped early.
    scene : scene of the response.
    model : model of the response; before a shear it may still be axisymmetric.
    """
    case, accuracy = load_case(load, scene), scene.accuracy
    if load.imperfection and not load.shears_tip and found.shift[0] * coarse.shift[0] < 0:
        coarse = _mirrored(coarse)
    edge = accuracy.solid_size if scene.solid else accuracy.section_size
    radius = max(found.contact_radius / scene.design.D, LEAST_RADIUS)
    growth = _growth_beyond_study(case, load, scene)
    # the coarser solve of a model with one harmonic has two: the whole difference is an error of the model
    sure = 1.0 if model == "harmonic" and accuracy.harmonics == 1 else SURE_SHARE

    def estimate(
        name: str,
        value: Sequence[float],
        coarse_value: Sequence[float],
        base: float = radius,
        case: LoadCase = case,
        rounding: float = 0.0,
    ) -> float | None:
        difference = _relative_difference(value, coarse_value, rounding)
        rule = error_rule(case, scene.magnet, name)
        return (
            None if difference is None or rule is None else _bounded_error(rule, difference, edge, base, growth, sure)
        )

    tilt = estimate("tilt", (found.tilt, found.tilt_y), (coarse.tilt, coarse.tilt_y), rounding=ROUNDING)
    upright = not load.shears_tip and not load.plate_tilt and not load.imperfection
    sideways, along = None, _force_along_shear(found, load)
    if along:
        of_case = load.coulomb is None or case == "tilted friction"
        share = abs(along) / math.hypot(*found.force)
        sideways = estimate(
            "sideways", (along,), (_force_along_shear(coarse, load),), share, case if of_case else "friction"
        )
    return Estimates(
        force=estimate("force", found.force, coarse.force),
        shift=estimate("shift", found.shift, coarse.shift),
        # the tilt of tetrahedra under an upright press is mesh noise
        tilt=None if tilt is None or (upright and tilt > 1) else tilt,
        sideways=sideways,
    )


def estimate_number(
    rule: ErrorRule | None, number: float | None, coarse: float | None, edge: float, base: float
) -> float | None:
    """Return the estimated error of a number; None where it is 0, or one of both meshes has none.

    Parameters
    ----------
    number, coarse : the number, and the number on the coarser mesh.
    edge : edge length of the section over D.
    base : base of the rule.
    """
    if rule is None or number is None or coarse is None:
        return None
    difference = _relative_difference((number,), (coarse,), ROUNDING)
    return None if difference is None else _bounded_error(rule, difference, edge, base)


def estimate_numbers(
    kind: str, numbers: Mapping[str, tuple[float | None, float | None]], scene: Scene, base: float
) -> Estimates:
    """Return the estimated errors of numbers of a critical state or a small shear.

    Parameters
    ----------
    kind : scene of the rules.
    numbers : by quantity, the number and that on the coarser mesh.
    """
    edge, magnet = scene.accuracy.section_size, scene.magnet
    return Estimates(
        **{
            name: estimate_number(error_rule(kind, magnet, name), number, coarse, edge, base)
            for name, (number, coarse) in numbers.items()
        }
    )


def estimate_vibration(
    quantity: VibrationQuantity, motion: str, difference: Array, amplification: Array, scene: Scene
) -> Array:
    """Return the estimated relative errors (f,) of a gain of a vibration.

    Parameters
    ----------
    quantity : see `fem.results.error_estimate_rules`.
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
    each = [_bounded_error(rule, d, edge, 1.0) for d in (difference / amplification).tolist()]
    return amplification * each


def load_case(load: Load, scene: Scene) -> LoadCase:
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
        return "grip"
    return "far" if load.shear > ON_LIMIT * STICK_SHEAR * scene.design.D else "stick"


def _growth_beyond_study(case: LoadCase, load: Load, scene: Scene) -> float:
    """Return the factor on the expected error for a load beyond those of the study, see DEPTH_POWER."""
    first, deepest = press_limits(scene.design, scene.magnet)
    depth = load.depth / (deepest if case == "deep" else first)
    farthest = FAR_SHEAR if case == "far" else STICK_SHEAR if load.coulomb is None else FRICTION_SHEAR
    shear = load.shear / (farthest * scene.design.D) if load.shears_tip else 0.0
    growth = math.pow(max(depth, 1.0), DEPTH_POWER) * max(shear, 1.0)
    if case in ("tilted press", "tilted stick", "tilted friction") and load.depth:
        depth = load.depth / scene.design.D
        growth *= math.pow(orders_needed(scene, depth) / harmonics_at(scene, depth), ORDER_POWER)
    return growth


def _mirrored(response: Response) -> Response:
    """Return the response that leans to the other side: an imperfect press may buckle to either."""
    x, y, z = response.shift
    return replace(response, shift=(-x, -y, z), tilt=-response.tilt, tilt_y=-response.tilt_y)


def _force_along_shear(response: Response, load: Load) -> float:
    """Return the component of the force along a load's shear, N; 0 where the load does not shear the tip."""
    if not load.shears_tip:
        return 0.0
    return (response.force[0] * load.shear_x + response.force[1] * load.shear_y) / load.shear


def _relative_difference(value: Sequence[float], coarse: Sequence[float], rounding: float) -> float | None:
    """Return the distance of two vectors over the length of the first; None if that is at most `rounding`."""
    size = math.hypot(*value)
    return None if size <= rounding else math.dist(value, coarse) / size


def _bounded_error(
    rule: ErrorRule, difference: float, edge: float, base: float, growth: float = 1.0, sure: float = SURE_SHARE
) -> float:
    """Return the error that a rule expects, times a growth factor, at least `sure` times the difference.

    Parameters
    ----------
    edge, base : edge length over D, and base of the rule.
    """
    usual = rule.usual(edge, base)
    return max(growth * rule.expected(usual, difference), sure * difference, difference - UNUSUAL * usual)
