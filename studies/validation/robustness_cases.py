"""The cases of `extremes`: designs and loads at the limits of the input ranges, with their checks and bounds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fem.accuracy import QUICK, STANDARD, Accuracy
from geometry.design import paper
from geometry.loads import Load
from studies.validation import robustness_checks
from studies.validation.robustness_checks import NO_MAGNET, Case, press

SEED = 2016
MAY_STOP = ("ok", "not_converged")
"""Expected statuses of a path that need not reach its last load."""
ANY_CLEAR = (*MAY_STOP, "unstable")
"""Expected statuses if so little silicone is left above a magnet that the press passes an onset of instability."""
BEYOND = ("ok", "unstable")
"""Expected statuses of a press that is deeper than its tip stays upright, or than its skin stays smooth."""
BOUNDS = {
    "quick": {"hertz": 0.02, "bar": 0.01, "mesh": 0.03, "shear": 0.01},
    "standard": {"hertz": 0.005, "bar": 0.005, "mesh": 0.01, "shear": 0.005},
}
"""Bounds of the checks that depend on the mesh, by accuracy level."""
WORK, SIMILAR, LIMIT, PATH, CONE = 2e-3, 1e-9, 1e-4, 1e-6, 1e-2
"""Bounds of the checks that do not depend on the mesh."""


def cases(*, quick: bool = False) -> list[Case]:
    """Return all cases; if quick, at quick accuracy and without the slow ones."""
    a = QUICK if quick else STANDARD
    every_time = [*_stiffness_and_size(a), *_shapes(a), *_presses(a), *_shears(a, quick=quick)]
    return [*every_time, *([] if quick else [*_rubbing(), *_tetrahedra()]), *_samples(a, 4 if quick else 12)]


def _stiffness_and_size(a: Accuracy) -> list[Case]:
    lengths = {D: {name: getattr(paper(), name) * D / 8 for name in robustness_checks.LENGTHS} for D in (1.0, 50.0)}
    hertz, deep = BOUNDS[a.name]["hertz"], press(3.528, 3.564, 3.6)
    return [
        *(
            Case(f"E = {E:g} MPa", press(1.0), robustness_checks.similarity, SIMILAR, a, {"E": E})
            for E in (1e-3, 1e3)
        ),
        *(
            Case(f"D = {D:g} mm, similar", press(D / 8), robustness_checks.similarity, SIMILAR, a, changes)
            for D, changes in lengths.items()
        ),
        *(
            Case(
                f"D = {D:g} mm, E = {E:g} MPa, touch",
                press(1e-9),
                robustness_checks.hertz,
                hertz,
                a,
                {"E": E} | lengths[D],
            )
            for D, E in ((1.0, 1e3), (50.0, 1e-3))
        ),
        *(
            Case(f"nu = {nu:g}, depth 0.4 L", deep, robustness_checks.work, WORK, a, {"nu": nu}, ends=BEYOND)
            for nu in (0.0, 0.3, 0.49999, 0.5)
        ),
        Case(
            "nu = 0.49999, depth 0.4 L: limit",
            press(3.6),
            robustness_checks.incompressible,
            LIMIT,
            a,
            {"nu": 0.49999},
            ends=BEYOND,
        ),
        Case("depth 0.4 L: inverted share", press(3.6), robustness_checks.folded, 0.0, a, ends=BEYOND),
    ]


def _shapes(a: Accuracy) -> list[Case]:
    bounds, largest = BOUNDS[a.name], robustness_checks.largest_height({})
    short, long = {"L": 4.05, **NO_MAGNET}, {"L": 80.0}
    heights = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    near = press(0.98, 0.99, 1.0)
    thin = {"magnet_height": 0.2}
    return [
        Case("L = D/2 + 0.05 mm", near, robustness_checks.work, WORK, a, short, "ignored"),
        Case(
            "L = D/2 + 0.05 mm: other model",
            press(0.5),
            robustness_checks.half_model,
            bounds["mesh"],
            a,
            short,
            "ignored",
        ),
        Case(
            "L = D/2 + 0.05 mm with the magnet",
            near,
            robustness_checks.work,
            WORK,
            a,
            {"L": 4.05},
            ends=("bad_input",),
        ),
        Case("L = 10 D", press(1.96, 1.98, 2.0), robustness_checks.work, WORK, a, long),
        Case("L = 10 D: slender", press(2.0), robustness_checks.bar, bounds["bar"], a, long),
        Case("magnet 0.2 mm high", near, robustness_checks.work, WORK, a, thin),
        Case(
            "magnet 6 mm high",
            press(0.99, 1.0, 1.01),
            robustness_checks.work,
            WORK,
            a,
            {"magnet_height": 6.0},
            ends=BEYOND,
        ),
        *(
            Case(name, near, robustness_checks.work, WORK, a, {"magnet_height": height}, ends=ANY_CLEAR)
            for name, height in (
                ("magnet 6.3 mm high", 6.3),
                (f"magnet {largest:.4g} mm high, the largest", largest),
            )
        ),
        # only to 0.5 mm: beyond it presses on the largest magnets are unstable, and forces are not ordered by size
        Case(
            "magnet 0.2 mm high to the largest",
            press(0.5),
            robustness_checks.ordered("magnet_height", heights),
            1.0,
            a,
            {"magnet_height": largest},
        ),
    ]


def _presses(a: Accuracy) -> list[Case]:
    hertz, alone = BOUNDS[a.name]["hertz"], BOUNDS[a.name]["mesh"]
    fine = [2 + 0.2 * i for i in range(12)]
    twelve = [0.25 * i for i in range(1, 13)]
    return [
        Case("depth 1e-9 mm", press(1e-9), robustness_checks.hertz, hertz, a),
        Case("depth 1e-9 mm, all silicone", press(1e-9), robustness_checks.hertz, hertz, a, magnet="ignored"),
        Case("depth 1e-9 mm, then 3 mm", press(1e-9, 3.0), robustness_checks.alone, alone, a, ends=MAY_STOP),
        Case(
            "3 mm in one step, or by 3.5 mm and back", press(3.0), robustness_checks.other_path(*press(3.5)), PATH, a
        ),
        Case(
            "0.25 to 3 mm in one step or 11",
            press(0.25, 3.0),
            robustness_checks.other_path(*press(*twelve[:-1])),
            PATH,
            a,
        ),
        Case(
            "2 to 4.4 mm in one step or 12",
            press(2.0, 4.4),
            robustness_checks.other_path(*press(*fine)),
            PATH,
            a,
            ends=ANY_CLEAR,
        ),
        Case("depth 3 mm: inverted share", press(3.0), robustness_checks.folded, 0.0, a),
        Case(
            "depth of 90 % of the silicone above the magnet",
            press(2.646, 2.673, 2.7),
            robustness_checks.work,
            WORK,
            a,
        ),
        Case(
            "depth of 90 % of all silicone on the axis",
            press(2.0, 6.3),
            robustness_checks.alone,
            alone,
            a,
            ends=MAY_STOP,
        ),
        Case(
            "depth 0.9 L, all silicone",
            press(2.0, 8.1),
            robustness_checks.alone,
            alone,
            a,
            {},
            "ignored",
            ends=MAY_STOP,
        ),
    ]


def _shears(a: Accuracy, *, quick: bool) -> list[Case]:
    bound, n = BOUNDS[a.name]["shear"], 4 if quick else 8
    stick = tuple(Load(depth=1.0, shear_x=8 * i / n, friction="stick") for i in range(n + 1))
    grip = tuple(Load(grip=2.0, shear_x=8 * i / n) for i in range(n + 1))
    gripped = Case(
        "grip to 1.0 D, all silicone", grip, robustness_checks.work, bound, a, magnet="ignored", ends=MAY_STOP
    )
    if quick:
        return [gripped]
    return [
        gripped,
        Case("grip to 1.0 D", grip, robustness_checks.work, bound, a, ends=MAY_STOP),
        Case("press 1 mm, stick to 1.0 D", stick, robustness_checks.work, bound, a, ends=MAY_STOP),
        Case(
            "press 1 mm, stick to 1.0 D, half model",
            stick,
            robustness_checks.work,
            bound,
            QUICK,
            model="half",
            ends=MAY_STOP,
        ),
    ]


def _rubbing() -> list[Case]:
    """Return cases with Coulomb friction, each with its shear as one load."""

    def case(name: str, mu: float, depth: float, shear: float, a: Accuracy = QUICK, **changes: float) -> Case:
        loads = tuple(Load(depth=depth, shear_x=x, friction=mu) for x in (0.0, shear))
        return Case(f"friction {mu:g}: {name}", loads, robustness_checks.cone, CONE, a, changes, ends=MAY_STOP)

    largest = _rounded(0.99 * robustness_checks.largest_height({}))
    return [
        case("shear to 1.0 D", 0.01, 1.0, 8.0),
        case("shear to 1.0 D", 10.0, 1.0, 8.0),
        case("press 3 mm, shear 4 mm", 0.3, 3.0, 4.0),
        case("first touch, 1e-6 mm", 0.3, 1e-6, 1e-5),
        case("nu = 0.49999", 0.5, 1.0, 4.0, nu=0.49999),
        case("magnet 0.2 mm high", 0.5, 1.0, 4.0, magnet_height=0.2),
        case(f"magnet {largest:g} mm high", 0.2, 1.0, 2.0, magnet_height=largest),
        case("8 harmonics", 0.1, 1.0, 1.0, replace(QUICK, section_size=0.2, harmonics=8)),
    ]


def _tetrahedra() -> list[Case]:
    """Return cases of the half model, whose mesh is not adapted to the contact, and whose press can buckle."""
    measure, hertz = robustness_checks.work, BOUNDS["quick"]["hertz"]
    return [
        Case(
            "depth 1e-9 mm, half model",
            press(1e-9),
            measure,
            hertz,
            QUICK,
            {},
            "ignored",
            "half",
            ends=("no_contact",),
        ),
        Case(
            "L = 4 D, half model", press(4.0), measure, 1.0, QUICK, {"L": 32.0}, "ignored", "half", ends=("unstable",)
        ),
    ]


def _samples(a: Accuracy, count: int) -> list[Case]:
    """Return random cases from a fixed seed that combine extremes; every second magnet is the largest that fits."""
    return [_sample(i, np.random.default_rng([SEED, i]), a) for i in range(1, count + 1)]


def _sample(i: int, rng: np.random.Generator, a: Accuracy) -> Case:
    D = _rounded(50 ** rng.uniform())
    L = _rounded(D / 2 + 0.05 + (9.5 * D - 0.05) * 0.01 ** rng.uniform())
    E, nu = _rounded(10 ** rng.uniform(-3, 3)), float(rng.choice([0.3, 0.49, 0.4998, 0.49999, 0.5]))
    shape = {"D": D, "L": L, "l0": L, "magnet_diameter": _rounded(D * rng.uniform(0.1, 0.8))}
    shape["magnet_edge_radius"] = _rounded(0.025 * shape["magnet_diameter"])
    height = robustness_checks.largest_height(shape) * (0.99 if i % 2 else rng.uniform(0.1, 0.9))
    fits = height > 2.5 * shape["magnet_edge_radius"]
    shape |= {"magnet_height": _rounded(height)} if fits else NO_MAGNET
    room = min(L - shape["magnet_height"], D)
    depth = _rounded(room * 10 ** rng.uniform(-8, math.log10(0.4)) if i % 3 == 0 else room * rng.uniform(0.05, 0.4))
    return Case(
        f"sample {i}: depth {depth:g} mm",
        press(0.98 * depth, 0.99 * depth, depth),
        robustness_checks.work,
        WORK,
        a,
        {"E": E, "nu": nu, **shape},
        "rigid" if fits else "ignored",
        ends=MAY_STOP,
    )


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
