"""What the bench solves: cases with loads, meshes to choose from, references and goals; and the peers' meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from fem.accuracy import QUICK
from geometry.loads import Magnet

Fields = Mapping[str, float | str]
"""Fields of a load or of an accuracy that differ from the defaults."""

DEPTHS_MM = tuple(0.25 * k for k in range(1, 13))
PRESS_CURVE: tuple[Fields, ...] = tuple({"depth": depth} for depth in DEPTHS_MM)
DEPTH_MM = 1.0
PRESS: tuple[Fields, ...] = ({"depth": DEPTH_MM, "friction": "stick"},)
SHEAR: tuple[Fields, ...] = (*PRESS, {"depth": DEPTH_MM, "shear_x": 3.0, "friction": "stick"})


@dataclass(frozen=True, slots=True)
class Case:
    """A scene that magtip solves.

    Attributes
    ----------
    key : name of the case for `--cases`.
    name, model, magnet, loads : the scene; a load holds the fields of `geometry.loads.Load`.
    ladder : accuracies to choose from, fields of `fem.accuracy.Accuracy`; the cheapest within tolerance counts.
    tolerance_percent : of the force at every load; infinite where it is only reported.
    reference : model and accuracy of the fine solution, or None.
    goal_s, goal_MB : limits of CPU seconds and peak memory, infinite if there is none.
    quick_reference : whether the reduced run has its reference.
    times : goal, how many times as fast as the earlier commit; 0 if there is none.
    """

    key: str
    name: str
    model: str
    magnet: Magnet
    loads: tuple[Fields, ...]
    ladder: tuple[Fields, ...]
    tolerance_percent: float
    reference: tuple[str, Fields] | None
    goal_s: float = math.inf
    goal_MB: float = math.inf
    quick_reference: bool = True
    times: float = 0.0


def _sizes(name: str, *values: float) -> tuple[Fields, ...]:
    return tuple({name: value} for value in values)


RUB: tuple[Fields, ...] = ({"depth": DEPTH_MM, "friction": 0.5}, {"depth": DEPTH_MM, "shear_x": 5.0, "friction": 0.5})

SECTIONS = (0.25, 0.22, 0.2, 0.19, 0.18, 0.16, 0.14, 0.12, 0.1, 0.08, 0.06)
FINE = ("axisymmetric", {"section_size": 0.018})
FINE_SHEAR = ("harmonic", {"section_size": 0.05, "section_patch": 0.0015, "harmonics": 5})
SOLIDS = _sizes("solid_size", 0.25, 0.2, 0.16, 0.14, 0.12)
CURVE, HALF = "press curve to 3 mm", "half model, press 1 mm"

CASES = (
    Case(
        "press-curve",
        CURVE,
        "axisymmetric",
        "ignored",
        PRESS_CURVE,
        _sizes("section_size", *SECTIONS),
        0.5,
        FINE,
        goal_s=0.3,
        times=3.0,
    ),
    Case("half-press", HALF, "half", "ignored", PRESS, SOLIDS, 1.0, FINE, goal_MB=1000),
    Case(
        "half-press-magnet",
        "half model, press 1 mm, rigid magnet",
        "half",
        "rigid",
        PRESS,
        SOLIDS,
        1.0,
        FINE,
        goal_MB=1000,
    ),
    Case(
        "half-shear",
        "press 1 mm, shear 3 mm, rigid magnet",
        "half",
        "rigid",
        SHEAR,
        (
            {"solid_size": 0.16, "solid_patch": 0.04},
            {"solid_size": 0.14, "solid_patch": 0.03},
            {"solid_size": 0.16, "solid_patch": 0.02},
            {"solid_size": 0.14, "solid_patch": 0.015},
        ),
        1.0,
        FINE_SHEAR,
        goal_s=30,
        quick_reference=False,
        times=2.5,
    ),
    Case(
        "shear",
        "press 1 mm, shear 3 mm, rigid magnet",
        "harmonic",
        "rigid",
        SHEAR,
        (
            {"section_size": 0.18, "section_patch": 0.032, "harmonics": 3},
            {"section_size": 0.16, "section_patch": 0.032, "harmonics": 3},
            {"section_size": 0.16, "section_patch": 0.016, "harmonics": 3},
            {"section_size": 0.16, "section_patch": 0.008, "harmonics": 3},
            {"section_size": 0.14, "section_patch": 0.007, "harmonics": 3},
            {"section_size": 0.2, "section_patch": 0.008, "harmonics": 4},
            {"section_size": 0.12, "section_patch": 0.006, "harmonics": 4},
        ),
        0.5,
        FINE_SHEAR,
        goal_s=1.5,
        quick_reference=False,
        times=3.0,
    ),
    Case(
        "friction",
        "press 1 mm, shear 5 mm, friction 0.5 to full slip",
        "harmonic",
        "rigid",
        RUB,
        ({"section_size": QUICK.section_size, "harmonics": QUICK.harmonics},),
        math.inf,
        None,
        goal_s=10,
        times=3.0,
    ),
)
"""What is measured of magtip; a line more is a case more."""

TRIANGLES = tuple((size, tip) for size in SECTIONS for tip in (1.0, 0.6))
"""Meshes for FElupe: edge length in units of D, and that at the tip over magtip's."""

CCX_LADDERS = {
    0.49: (0.3, 0.25, 0.2, 0.16),
    0.4998: (0.2, 0.16, 0.14),
}
"""Meshes for CalculiX, in units of D, for each Poisson's ratio that it is given; the second is the sensor's."""
