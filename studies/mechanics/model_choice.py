"""The cheapest model whose measured error meets a tolerance, for a design and its loads (option --tolerance).

The errors come from `magtip validate errors trade`: every model on twenty-four designs against extrapolated
references, by kind of scene and by region of the loads. They are frozen in model_choice.json beside this module, with
the versions of the models: statements of another version do not count. Force, shift and tilt count as vectors,
relative to the reference; readings in percent of full scale; and of a shear the force along it, relative to itself.
A choice meets the tolerance in all of them.

The force along a shear vanishes where the press buckles, so that its relative error has no bound that holds for all
loads. Its measured bound is therefore relative to the larger one of this force and that of the unpressed beam
(`analytic.buckling.sideways_stiffness`), and `unmet` compares the answer with it: finite elements that do not meet
the tolerance are solved again at a finer accuracy.

Formulas and the surrogate are chosen only inside their ranges and those of the study. The surrogate must meet the
tolerance twice: its measured bound, as that of every model, because few of the study's designs lie near any other
one; and the half widths of its 90 % intervals for the loads in question, because these are wide where its training
beams are sparse. Half widths alone would not do: one case in ten lies beyond them, and they do not contain readings.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from analytic import beam, buckling
from fem import physics_version
from fem.physics_version import PHYSICS
from fem.scene import Model, choose_model, press_limits
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet, Response
from studies.quantities import shown

Kind = Literal["press", "glued shear", "friction"]
DATA = Path(__file__).with_name("model_choice.json")
"""Statements of the rule, written by `magtip validate errors trade` and copied by hand after a look at its report."""
LIGHT, NEAR = 0.06, 0.15
"""Depth of a light press and largest shear of region "near", over D."""
SHALLOWEST, FARTHEST, DEEPEST = 0.01, 0.3, 0.5
"""Least depth and largest shear of the study over D; its deep press, as a share of the way to the deepest one."""
THIN = 0.2
"""Thickness over D of the silicone between magnet and base, below which the base is thin: the magnet then moves so
little that its shift is hard to resolve."""
LENGTHS, LEAST_NU = (0.6, 6.0), 0.45
"""Range of L/D, and least Poisson's ratio, of the study."""
SMALL = 0.13
"""Largest section of a small magnet, diameter times height over D^2: the error of formulas grows with the section."""
ANY_REGION = "any"
"""Region of the statements about tetrahedra, which ran on too few designs to tell regions apart."""
SURROGATE = "surrogate"
"""Name of the surrogate among the models."""
SOLVED: tuple[Model, ...] = ("axisymmetric", "harmonic", "half", "full")
REFERENCE: dict[Kind, Model] = {"press": "axisymmetric", "glued shear": "harmonic", "friction": "harmonic"}
"""Finite-element models of the rule, and the model of the references of each kind."""
VERSION_LOADS = (Load(depth=0.4), Load(depth=0.8, shear_x=0.8, friction="stick"))
"""Loads whose answers tell versions of formulas and of the surrogate apart."""
UNMET = "beyond_tolerance"
"""Status of a state that is not known to meet its tolerance."""
FINER = {"quick": "standard", "standard": "fine"}
"""Next finer accuracy of the finite elements."""
BEYOND = 2.0
"""Factor on a bound for designs, loads or scenes that the study does not contain."""
CONTACT_POWER = 0.75
"""Power of the depth with which the error of a light press grows: as in the rules of
`fem.results.error_estimates`, it grows about with the contact radius to the power -1.5."""


@dataclass(frozen=True, slots=True)
class Statement:
    """Bounds of the errors of one model, for one kind of scene in one region; fractions.

    model, level : finite-element model and its accuracy, "formula" and its level, or "surrogate" and "shipped".
    cost : CPU seconds over those of the section model at level standard, median.
    force, shift, tilt, readings : bounds of the errors; None where the scene has no such quantity.
    sideways : bound of the error of the force along the shear, over the larger one of it and that of the unpressed
        beam.
    """

    kind: Kind
    region: str
    model: str
    level: str
    designs: int
    states: int
    cost: float
    force: float
    shift: float
    tilt: float | None = None
    readings: float | None = None
    sideways: float | None = None

    def bound(self, *, readings: bool) -> float:
        """Return the largest bound; that of the readings counts only for a design with a magnet."""
        others = (self.tilt, self.sideways, self.readings if readings else None)
        return max(self.force, self.shift, *(value for value in others if value is not None))


@dataclass(frozen=True, slots=True)
class Choice:
    """The model that a tolerance asks for.

    level_or_accuracy : level of the formulas, accuracy of the finite elements, or "shipped" for the surrogate.
    model : model of the finite elements, "formula" for formulas, "surrogate" for the surrogate.
    bound : largest expected error of force, shift, tilt, readings and, with a shear, the force along it: a fraction.
    sideways : expected error of the force along the shear, over the larger one of it and that of the unpressed beam.
    tolerance : that is asked for; NaN if none is.
    """

    level_or_accuracy: str
    model: str
    bound: float
    reason: str
    sideways: float = 0.0
    tolerance: float = math.nan

    @property
    def name(self) -> str:
        """Model and level, as tables and JSON show them."""
        return f"{self.model} {self.level_or_accuracy}"


@dataclass(frozen=True, slots=True)
class Region:
    """Where a load lies in the study.

    growth : factor on the bounds for what lies beyond the study; 1 inside.
    beyond : what lies beyond the study, in words; empty inside.
    """

    kind: Kind
    name: str
    growth: float = 1.0
    beyond: str = ""


Bound = tuple[float, float]
"""Largest bound of the errors under a load, and that of the force along the shear as in `Statement`."""


@functools.cache
def _shipped() -> dict[str, Any]:
    return dict(json.loads(DATA.read_text("utf-8")))


@functools.cache
def statements() -> tuple[Statement, ...]:
    """Return the statements of the rule about models of today's version, with references of today's version."""
    old, every = outdated(), (Statement(**each) for each in _shipped()["statements"])
    return tuple(each for each in every if not {each.model, REFERENCE[each.kind]} & set(old))


@functools.cache
def outdated() -> tuple[str, ...]:
    """Return the models whose version is another one today than that on which the rule rests."""
    return tuple(physics_version.outdated(_shipped().get("versions", {}), versions()))


@functools.cache
def versions() -> dict[str, str]:
    """Return the version of each model on which the rule rests.

    That of finite elements is the version of their physics. Formulas and the surrogate have a digest of their answers
    to a few loads to five digits. Half widths are no part of it: no bound rests on them, and `choose` takes those of
    the file in use.
    """
    from studies.beam import surrogate_response

    found: dict[str, str] = {model: str(PHYSICS[model]) for model in SOLVED}
    cases = [(design, load) for design in (paper(), replace(paper(), L=14.0)) for load in VERSION_LOADS]
    formulas = [beam.solve(*case, level) for case in cases for level in beam.LEVELS]
    found["formula"] = _digest([value for one in formulas for value in (*one.force, *one.shift, one.tilt)])
    try:
        estimates = [surrogate_response.respond(*case) for case in cases]
    except BadInput as refusal:
        return found | {SURROGATE: str(refusal)}
    values = [value for one in estimates for value in (*one.response.force, *one.response.shift, one.response.tilt)]
    return found | {SURROGATE: _digest(values)}


def _digest(values: Sequence[float]) -> str:
    return hashlib.sha256(" ".join(f"{value:.5g}" for value in values).encode()).hexdigest()[:16]


def choose(
    design: Design,
    loads: Sequence[Load],
    tolerance: float,
    magnet: Magnet = "rigid",
    *,
    formulas: bool = True,
    rule: Sequence[Statement] | None = None,
) -> Choice:
    """Return the cheapest model whose measured errors meet a tolerance under all loads of a path.

    Parameters
    ----------
    tolerance : largest relative error of force, shift, tilt, readings and force along a shear, between 0 and 1.
    formulas : whether formulas and the surrogate may be chosen, which compute no deformed body.
    """
    if not 0 < tolerance < 1:
        raise BadInput(f"tolerance must lie between 0 and 1; got {tolerance:g}")
    choices = []
    for choice in _choices(statements() if rule is None else rule, design, loads, magnet, formulas=formulas):
        if choice.bound <= tolerance:
            left_out = ""
            if rule is None and outdated():
                left_out = f"; the study has other versions of {', '.join(outdated())}, which are left out"
            return replace(choice, reason=choice.reason + left_out, tolerance=tolerance)
        choices.append(choice)
    if not choices:
        old = f", and those of {', '.join(outdated())} are of another version" if outdated() else ""
        raise BadInput(
            f"the study of errors has no run of model {choose_model(loads, 'auto')} for {kind_of(loads)}{old}: "
            "choose an accuracy instead of a tolerance"
        )
    best = min(choices, key=lambda choice: choice.bound)
    raise BadInput(
        f"no model is known to meet the tolerance {shown(tolerance, 'percent', 2)} for these loads: the smallest "
        f"tolerance that is met is {shown(rounded_up(best.bound, 2), 'percent', 2)}, by model {best.name}"
    )


def finer(
    design: Design,
    loads: Sequence[Load],
    choice: Choice,
    magnet: Magnet = "rigid",
    *,
    rule: Sequence[Statement] | None = None,
) -> Choice | None:
    """Return the finite elements at the next finer accuracy; None if there is none whose errors are known."""
    choices = _choices(statements() if rule is None else rule, design, loads, magnet, formulas=False)
    level = FINER.get(choice.level_or_accuracy, "")
    found = next((each for each in choices if each.level_or_accuracy == level), None)
    return None if found is None else replace(found, tolerance=choice.tolerance)


def unmet(
    choice: Choice,
    design: Design,
    load: Load,
    along_N: float | None,
    estimates: Mapping[str, float | None] | None = None,
) -> str:
    """Return why an answer is not known to meet the choice's tolerance, "" if it is.

    Parameters
    ----------
    along_N : force along the shear by the answer.
    estimates : relative error estimates of the answer by quantity: force, shift and, with a shear, tilt and sideways.
        One that is unknown does not meet the tolerance. None for formulas, which have none.
    """
    errors: dict[str, float | None] = {}
    if load.shears_tip:
        expected = math.inf if along_N is None else sideways_error(choice.sideways, design, load, along_N)
        errors["the expected error of the force along the shear"] = expected
    if estimates is not None:
        names = {"force": "force", "shift": "shift"}
        if load.shears_tip:
            names |= {"tilt": "tilt", "sideways": "force along the shear"}
        errors |= {f"the error estimate of the {word}": estimates.get(name) for name, word in names.items()}
    for name, error in errors.items():
        if error is None or math.isnan(error):
            return f"{name} is unknown"
        if error > choice.tolerance:
            size = (
                "that of a force which nearly vanishes"
                if math.isinf(error)
                else shown(rounded_up(error, 2), "percent", 2)
            )
            return f"{name}, {size}, exceeds the tolerance {shown(choice.tolerance, 'percent', 2)}"
    return ""


def sideways_error(share: float, design: Design, load: Load, along_N: float) -> float:
    """Return the expected relative error of a force along the shear.

    Parameters
    ----------
    share : bound of the error over the larger one of this force and that of the unpressed beam.
    along_N : the force by the answer, whose true value may be smaller by the error.

    >>> from geometry.design import paper
    >>> sideways_error(0.01, paper(), Load(1.0, 1.0, friction="stick"), 0.0)
    inf
    """
    lost = share * max(abs(along_N), buckling.sideways_stiffness(design) * load.shear)
    return lost / (abs(along_N) - lost) if abs(along_N) > lost else math.inf


def _choices(
    rule: Sequence[Statement], design: Design, loads: Sequence[Load], magnet: Magnet, *, formulas: bool
) -> Iterator[Choice]:
    fem, kind = choose_model(loads, "auto"), kind_of(loads)
    places = [(load, region(design, load, magnet, kind)) for load in loads]
    own: dict[tuple[str, str], list[Statement]] = {}
    for each in rule:
        if each.kind == kind:
            own.setdefault((each.model, each.level), []).append(each)
    names = sorted(own, key=lambda name: max(each.cost for each in own[name]))

    def choice(model: str, level: str) -> list[Choice]:
        known, bounds = own[model, level], list[Bound]()
        for load, place in places:
            if (bound := _bound(known, design, load, place, magnet)) is None:
                return []
            bounds.append(bound)
        largest, sideways = (max(values) for values in zip(*bounds, strict=True))
        beyond = list(dict.fromkeys(place.beyond for _, place in places if place.beyond))
        where = f"{kind} ({', '.join(dict.fromkeys(place.name for _, place in places))})"
        least = shown(rounded_up(largest, 2), "percent", 2) if math.isfinite(largest) else "no bound"
        reason = f"this is the cheapest model whose measured error for {where} is within {least}"
        if beyond:
            reason += f"; the study does not contain {', '.join(beyond)}, so its errors are multiplied"
        if model == SURROGATE:
            reason += ", and so are the half widths of its 90 % intervals for these loads"
        designs = max(each.designs for each in known)
        if kind == "friction" and designs:
            reason += f"; Coulomb friction was studied on {designs} designs only"
        return [Choice(level, model, largest, reason, sideways)]

    if formulas:
        # all formulas take milliseconds: of these the most accurate one counts
        cheap = [one for model, level in names if model == "formula" for one in choice(model, level)]
        yield from sorted(cheap, key=lambda each: each.bound)[:1]
    for model, level in names:
        if model == fem or (model == SURROGATE and formulas):
            yield from choice(model, level)


def region(design: Design, load: Load, magnet: Magnet, kind: Kind | None = None) -> Region:
    """Return kind and region of a load, with a factor for what lies beyond the study.

    `kind`: of the whole path; default: that of the load.

    >>> from geometry.design import paper
    >>> region(paper(), Load(depth=0.4), "rigid").name
    'depth to 0.06 D'
    """
    first, most = press_limits(design, magnet)
    deepest = first + DEEPEST * (most - first)
    kind = kind or kind_of([load])
    # loads of the study are rounded to four digits
    slack, slender = 1 + 1e-3, design.L / design.D
    shallow = SHALLOWEST * design.D / load.depth / slack if load.depth else 1.0
    factors = {
        f"L/D = {slender:.3g}": 1.0 if LENGTHS[0] / slack <= slender <= LENGTHS[1] * slack else BEYOND,
        f"nu = {design.nu:g}": 1.0 if design.nu >= LEAST_NU else BEYOND,
        f"depths below {SHALLOWEST:g} D": max(shallow, 1.0) ** CONTACT_POWER,
        f"depths beyond {deepest / design.D:.2g} D": max(load.depth / deepest / slack, 1.0),
        f"shears beyond {FARTHEST:g} D": max(load.shears_tip * load.shear / (FARTHEST * design.D) / slack, 1.0),
    }
    factors |= dict.fromkeys(load.beyond("depth", "shear_x", "shear_y", "friction"), BEYOND)
    growth = math.prod(factors.values())
    beyond = ", ".join(name for name, factor in factors.items() if factor > 1)
    return Region(kind, _region_name(design, load, magnet, kind, slack), growth, beyond)


def kind_of(loads: Sequence[Load]) -> Kind:
    """Return the kind of scene of a path of loads; grips count as glued shears.

    >>> kind_of([Load(depth=1.0, shear_x=1.0, friction=0.3)]), kind_of([Load(depth=1.0, shear_x=1.0)])
    ('friction', 'press')
    """
    if any(load.coulomb is not None for load in loads):
        return "friction"
    return "glued shear" if any(load.shears_tip for load in loads) else "press"


def _region_name(design: Design, load: Load, magnet: Magnet, kind: Kind, slack: float) -> str:
    D = design.D
    if kind == "friction":
        return "friction"
    height = design.magnet_height if magnet == "rigid" and design.shape.has_magnet else 0.0
    if design.H - height / 2 < THIN * D:
        return "thin base"
    if kind == "glued shear":
        return f"shear to {NEAR if load.shear <= NEAR * D * slack else FARTHEST:g} D"
    if load.depth > press_limits(design, magnet)[0] * slack:
        return "deep"
    return f"depth to {LIGHT:g} D" if load.depth <= LIGHT * D * slack else "depth to D/4"


def _bound(known: Sequence[Statement], design: Design, load: Load, place: Region, magnet: Magnet) -> Bound | None:
    """Return the bound of a model and level, of which all statements are given; None where it has none.

    Finite elements that the study ran on a few designs only may lack a region: then the largest bound of the kind
    holds. Formulas and the surrogate have no bound outside their range, and the surrogate at least its half widths.
    """
    model, level, has_magnet = known[0].model, known[0].level, design.shape.has_magnet
    if model not in ("formula", SURROGATE):
        exact = [each for each in known if each.region in (place.name, ANY_REGION)] or known
        largest = max(each.bound(readings=magnet == "rigid" and has_magnet) for each in exact)
        return place.growth * largest, place.growth * max(each.sideways or 0.0 for each in exact)
    name = formula_region(design, place.name) if model == "formula" else place.name
    own = next((each for each in known if each.region == name), None)
    if own is None or place.beyond:
        return None
    if model == "formula":
        if (magnet == "ignored" and has_magnet) or beam.outside(design, load, level):
            return None
        response, largest = beam.solve(design, load, level), own.bound(readings=has_magnet)
    else:
        from studies.beam import surrogate_response

        (estimate,) = surrogate_response.respond_all([(design, load, magnet)])
        if isinstance(estimate, str):
            return None
        largest = max(own.bound(readings=True), *(width for width in estimate.errors.values() if width is not None))
        response = estimate.response
    if not load.shears_tip:
        return largest, 0.0
    # the error of a force along the shear that was not measured has no bound
    if own.sideways is None:
        return None
    along = sideways_error(own.sideways, design, load, along_shear(load, response))
    return max(largest, along), own.sideways


def along_shear(load: Load, response: Response) -> float:
    """Return the force along the shear, N."""
    x, y = load.direction
    return x * response.force[0] + y * response.force[1]


def formula_region(design: Design, name: str) -> str:
    """Return the region of a formula: that of the load, without a magnet, with a small one or with a large one."""
    if not design.shape.has_magnet:
        return f"{name}, no magnet"
    small = design.magnet_diameter * design.magnet_height <= SMALL * design.D**2 * (1 + 1e-9)
    return f"{name}, small magnet" if small else f"{name}, large magnet"


def rounded_up(value: float, digits: int) -> float:
    """Return a positive number rounded up to some significant digits, so that it holds as printed.

    >>> rounded_up(0.01231, 2)
    0.013
    """
    places = digits - 1 - math.floor(math.log10(value))
    return round(math.ceil(value * math.pow(10, places) - 1e-9) / math.pow(10, places), 12)
