"""Designs, loads, models and reference meshes of the study of cost and error (verb trade).

Twenty-four chosen designs span the range: the paper's, L/D from 0.6 to 6, magnets from none to the largest that
fits, nu from 0.45 to 0.4999, four laws; six of them lie inside the range of the formulas. The rule of
`studies.mechanics.model_choice` follows from them. Further designs, drawn at random in the same range, confirm the
rule.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from fem.accuracy import LEVELS, Accuracy
from fem.results.error_estimates import press_limits
from fem.scene import Model
from geometry.design import Design, paper
from geometry.loads import Load, Magnet
from studies.validation.error_study_cases import Trial, rounded, rows_of

Kind = Literal["press", "glued shear", "friction"]
KINDS: tuple[Kind, ...] = ("press", "glued shear", "friction")
SCENES: dict[Kind, str] = {"press": "press", "glued shear": "stick", "friction": "friction"}
"""Scene of a trial of each kind, see `studies.validation.error_study_cases`."""

SURROGATE, SHIPPED = "surrogate", "shipped"
"""Name of the surrogate among the models, and of its one level."""
CALCULATED = ("formula", SURROGATE)
"""Models without a mesh: they are evaluated in the study's own process, and count inside their ranges only."""
SOLIDS = ("half", "full")
"""Models of tetrahedra."""
MODELS: dict[Kind, tuple[Model, ...]] = {
    "press": ("axisymmetric", "harmonic", "half", "full"),
    "glued shear": ("harmonic", "half", "full"),
    "friction": ("harmonic", "half"),
}
"""Finite-element models of each kind; `full` carries friction too, but a solve takes many minutes."""
SECTION: dict[Kind, Model] = {"press": "axisymmetric", "glued shear": "harmonic", "friction": "harmonic"}
"""Model of the reference, and at level standard the unit of cost."""

STUDIED = 24
"""Number of chosen designs."""
DRAWN = 26
"""Number of random designs of a draw."""
DRAWS = 3
"""Draws of random designs, with L/D from 0.6 to 6, nu from 0.45 and walls of 0.06 D or more. Of the first draw 20 and
of the others 6 designs lie anywhere in the range, the rest inside that of the formulas. The rule was corrected after
each draw but the last."""
CONFIRMED = DRAWN * DRAWS
"""Number of random designs."""

PRESSES, DEEP = (0.12, 0.4, 1.0), 0.5
"""Depths of a press over the largest depth of the rules "press" of `fem.results.error_estimates` (D/4 or less);
and one deep press, as a share of the way from there to the largest depth of the rules "deep"."""
UNDER, SHEARS = (0.1, 0.06, 0.2), (0.05, 0.15, 0.3)
"""Depths under a shear, one for each design by turns, and shears of the glued plate, all over D."""
SLIDES, COEFFICIENTS = (0.04, 0.25), (0.3, 0.6)
"""Shears with Coulomb friction over D, for partial and full slip; coefficients, by turns."""

RUNS: dict[tuple[Kind, Model], tuple[int, int, int]] = {
    ("press", "harmonic"): (4, 4, 2),
    ("press", "half"): (1, 0, 0),
    ("press", "full"): (1, 0, 0),
    ("glued shear", "harmonic"): (STUDIED, STUDIED, 4),
    ("glued shear", "half"): (1, 0, 0),
    ("glued shear", "full"): (1, 0, 0),
    ("friction", "harmonic"): (4, 4, 0),
    ("friction", "half"): (0, 0, 0),
}
"""Number of designs on which a model is run at levels quick, standard and fine; default: all. Chosen by measured
cost, so that the whole study takes less than an hour on one core."""
ORDER = (0, 5, 10, 3, 14, 6, 1, 12, 8, 2, 4, 7, 9, 11, 13, 15, *range(16, STUDIED))
"""Order in which designs are chosen for cells that run on a few only: the first ones span the range."""
SLENDER, COMMON = 3.2, 16
"""References have meshes one step coarser beyond this L/D, where these have as many elements, and, to save time, from
this design on."""
CONFIRMING: dict[Kind, tuple[int, ...]] = {
    "press": tuple(range(CONFIRMED)),
    "glued shear": (0, 2, 4, 6, 8, 10, 20, 22, 24, *(2 * DRAWN + k for k in (6, 8, 10, 12))),
    "friction": (0, 7, 13),
}
"""Numbers of the random designs that confirm the rule of each kind: fewer where a reference costs more."""


def runs_on(kind: Kind, model: Model, level: str, count: int) -> list[int]:
    """Return the numbers of the chosen designs on which a model is run."""
    chosen = [number for number in ORDER if number < count]
    counts = dict(zip(LEVELS, RUNS.get((kind, model), (count,) * len(LEVELS)), strict=True))
    return sorted(chosen[: counts[level]])


def trial(number: int, kind: Kind, model: Model, *, confirm: bool = False) -> Trial:
    """Return the path of loads of a kind on a design, in proportion to the design."""
    design = (confirming_designs() if confirm else designs())[number]
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    return Trial(number, design, magnet, SCENES[kind], model, _loads(number, kind, design, magnet))


def _loads(number: int, kind: Kind, design: Design, magnet: Magnet) -> tuple[Load, ...]:
    first, most = press_limits(design, magnet)
    if kind == "press":
        depths = [share * first for share in PRESSES] + [first + DEEP * (most - first)]
        return tuple(Load(depth=rounded(depth)) for depth in depths)
    D, depth = design.D, rounded(min(UNDER[number % len(UNDER)] * design.D, first))
    if kind == "glued shear":
        return tuple(Load(depth=depth, shear_x=rounded(x * D), friction="stick") for x in SHEARS)
    mu = COEFFICIENTS[number % len(COEFFICIENTS)]
    return tuple(Load(depth=depth, shear_x=rounded(x * D), friction=mu) for x in (0.0, *SLIDES))


DESIGNS = Path(__file__).with_name("trade_designs.csv")
"""The chosen designs after the paper's; those from the 18th on lie inside the range of the formulas."""
RANDOM_DESIGNS = DESIGNS.with_name("trade_random_designs.csv")
LAWS: dict[str, dict[str, Any]] = {
    "mooney": {"law": "mooney-rivlin", "mooney_share": 0.2},
    "yeoh": {"law": "yeoh", "yeoh_2": 0.05},
    "ogden": {"law": "ogden", "ogden_share": 0.25},
}
"""A Mooney-Rivlin, a Yeoh and an Ogden law that are stable in the presses of the study."""


@functools.cache
def designs() -> tuple[Design, ...]:
    """Return the chosen designs, the paper's first."""
    return (paper(), *(_design(**row) for row in rows_of(DESIGNS)))


def _design(
    D: float, L_over_D: float, magnet_diameter_over_D: float, magnet_height_over_D: float, nu: float, law: str
) -> Design:
    """Return a design; its Hall elements lie as in the paper's sensor, over D."""
    L = rounded(L_over_D * D)
    magnet: dict[str, Any] = {
        "magnet_diameter": rounded(magnet_diameter_over_D * D),
        "magnet_height": rounded(magnet_height_over_D * D),
        "magnet_edge_radius": rounded(0.1 * magnet_height_over_D * D),
    }
    elements: dict[str, Any] = {"l0": rounded(L - D / 2 + 0.275 * D), "f": rounded(0.625 * D), "c": rounded(0.25 * D)}
    return Design(D=D, L=L, nu=nu, **magnet, **elements, **LAWS.get(law, {}))


@functools.cache
def confirming_designs() -> tuple[Design, ...]:
    """Return the random designs: L/D and 1/2 - nu uniform in their logarithm; a third has no magnet."""
    rows = [(row, LAWS.get(row.pop("law"), {})) for row in rows_of(RANDOM_DESIGNS)]
    return tuple(Design(**row, **law) for row, law in rows)


Fineness = Literal["rough", "coarser", "usual", "finer"]
"""Meshes of a reference: rough for a quick study; coarser for tolerances of 0.5 % and more; finer for designs that
are also run at level fine."""
STEPS: dict[Kind, tuple[tuple[float, float, int, float], ...]] = {
    "press": tuple((size, 0.001, 0, 1.0) for size in (0.09, 0.064, 0.045, 0.032, 0.0225, 0.016)),
    "glued shear": (
        (0.255, 0.0113, 3, 1.0),
        (0.18, 0.008, 3, 1.0),
        (0.128, 0.0056, 3, 1.0),
        (0.09, 0.004, 3, 1.0),
        (0.064, 0.0028, 4, 1.0),
        (0.045, 0.002, 5, 1.0),
    ),
    "friction": ((0.128, 0.001, 3, 1.4), (0.09, 0.001, 4, 1.0), (0.064, 0.001, 5, 0.7)),
}
"""Section and patch size over D, harmonics and friction step factor of the meshes of references, each sqrt(2) finer
than the one before."""
BEGIN: dict[Kind, dict[Fineness, int]] = {
    "press": {"rough": 0, "coarser": 2, "usual": 3, "finer": 3},
    "glued shear": {"rough": 0, "coarser": 2, "usual": 2, "finer": 3},
    "friction": {"rough": 0, "coarser": 0, "usual": 0, "finer": 0},
}
"""Place of the first of a reference's three meshes in STEPS."""


def references(kind: Kind, fineness: Fineness) -> tuple[Accuracy, Accuracy, Accuracy]:
    """Return the three meshes of a reference, the coarse one first."""
    begin = BEGIN[kind][fineness]
    first, second, third = (
        replace(
            LEVELS["fine"],
            name=f"reference {size:g}",
            section_size=size,
            section_patch=patch,
            harmonics=harmonics,
            friction_step_factor=factor,
        )
        for size, patch, harmonics, factor in STEPS[kind][begin : begin + 3]
    )
    return first, second, third
