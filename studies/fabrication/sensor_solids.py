"""All solids of a sensor and its mould, as a maker chooses them, and their triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from geometry.base import Base, Plan
from geometry.design import BadInput, Design
from geometry.fabrication.solid_files import check_tolerance
from geometry.mold import Mold
from studies.inputs import user_input

if TYPE_CHECKING:
    from build123d import Solid

    from geometry.fabrication.solid_files import Facets

COLOURS = {
    "beam": "wheat",
    "silicone": "wheat",
    "magnet": "silver",
    "base": "lightsteelblue",
    "mold_a": "goldenrod",
    "mold_b": "slategray",
    "mold_b1": "slategray",
    "mold_b2": "cadetblue",
}
"""Of the parts, in STEP files and in the picture; Hall elements have `OTHER`."""

OTHER = "darkslategray"

SHARE, FINEST = 2000, 100000
"""The facets' tolerance is D over the first unless it is given, and at least D over the second."""


@dataclass(frozen=True, slots=True)
class Making:
    """What a maker chooses: mould, base, and the facets' tolerance, mm (None: D/2000)."""

    mold: Mold = field(default_factory=Mold)
    base: Base = field(default_factory=Base)
    tolerance: float | None = None


@dataclass(frozen=True, slots=True)
class Things:
    """All solids of a sensor.

    Attributes
    ----------
    sensor : silicone, magnet and base where they are in the sensor's frame; beam, the outer form.
    bodies : the Hall elements, in the sensor's frame.
    plan : of the base; None where it has no place for the elements, and `missing` says why.
    mold : mold_a, and mold_b or its halves, closed, in the mould frame; A and B, the parts not split.
    """

    sensor: dict[str, Solid]
    bodies: dict[str, Solid]
    plan: Plan | None
    missing: str
    mold: dict[str, Solid]
    A: Solid
    B: Solid


def making_of(process: str, mold: Sequence[str], base: Sequence[str], tolerance: float | None) -> Making:
    """A maker's choices from texts KEY=VALUE.

    >>> making_of("sla", ["columns=3", "shrink=0.01"], [], None).mold.columns
    3
    """
    if tolerance is not None:
        check_tolerance(tolerance)
    if any(text.partition("=")[0].strip() == "process" for text in mold):
        raise BadInput("process is not a key of --mold: give --process fdm or --process sla")
    chosen = user_input.parse_choices("--mold", mold, Mold)
    return Making(Mold(process=process, **chosen), Base(**user_input.parse_choices("--base", base, Base)), tolerance)


def things(design: Design, making: Making) -> Things:
    """Make all solids.

    Raises
    ------
    BadInput
        Something about the mould does not go with the design.
    """
    from geometry import base, cad
    from geometry.fabrication import hall_bodies, mold_solids

    beam = cad.beam(design)
    sensor = {"beam": beam, "silicone": beam}
    if design.shape.has_magnet:
        # cut from the same solids it has their faces, and these are given triangles once
        sensor["magnet"] = cad.magnet(design)
        sensor["silicone"] = cad.cut(beam, sensor["magnet"])
    plan, missing, bodies = None, "", {}
    try:
        plan = base.plan(design, making.base, making.mold.process)
        sensor["base"], bodies = base.base(design, making.base, making.mold.process), hall_bodies.bodies(design)
    except BadInput as error:
        if making.base != Base():
            raise
        missing = f"no base and no assembly: {error}"
    A, B = mold_solids.parts(design, making.mold, beam)
    halves = mold_solids.halves(design, making.mold, B) if making.mold.split else {"mold_b": B}
    return Things(sensor, bodies, plan, missing, {"mold_a": A, **halves}, A, B)


def coloured(made: Things) -> dict[str, tuple[Solid, str]]:
    """The parts of the assembled sensor, each with its colour."""
    together = {name: part for name, part in made.sensor.items() if name != "beam"} | made.bodies
    return {name: (part, COLOURS.get(name, OTHER)) for name, part in together.items()}


def printed(made: Things) -> dict[str, Solid]:
    """What is printed, each as it stands on the printer's bed."""
    from geometry.fabrication.printability import standing

    stood = {"base": standing(made.sensor["base"])} if made.plan else {}
    stood |= {name: standing(part, upside_down=name == "mold_a") for name, part in made.mold.items()}
    return stood


def shaped(design: Design, making: Making, made: Things) -> dict[str, tuple[Solid, Facets]]:
    """What gets files of its own, each with its triangles: what is printed as it stands, the rest as it is.

    Raises
    ------
    RuntimeError
        See `geometry.fabrication.solid_files.facets`.
    """
    from geometry.fabrication import solid_files

    plain = {name: part for name, part in made.sensor.items() if name != "base"}
    tolerance = fineness(design, making)
    return {
        name: (part, solid_files.facets(name, part, tolerance)) for name, part in {**plain, **printed(made)}.items()
    }


def fineness(design: Design, making: Making) -> float:
    """Tolerance of all triangles, mm.

    Raises
    ------
    BadInput
        It would take millions of them.
    """
    tolerance = design.D / SHARE if making.tolerance is None else making.tolerance
    if not tolerance >= design.D / FINEST:
        raise BadInput(
            f"tolerance must be at least D/{FINEST} = {design.D / FINEST:g} mm, to avoid millions of triangles; got "
            f"{tolerance:g} mm"
        )
    return tolerance
