"""The solids of a sensor and its mould, as the fabrication choices define them, and their triangles."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from geometry.array_design import ArrayDesign
from geometry.arrays import Vector
from geometry.base import SHAPES, ArrayPlan, Base, Plan
from geometry.design import BadInput, Design
from geometry.fabrication.solid_files import check_tolerance
from geometry.mold import Mold
from studies.inputs import user_input
from studies.inputs.option_groups import Fabrication

if TYPE_CHECKING:
    from build123d import Solid

    from studies.parts.catalogues import Mix

COLOURS = {
    "beam": "wheat",
    "silicone": "wheat",
    "magnet": "silver",
    "base": "lightsteelblue",
    "mold_a": "goldenrod",
    "mold_b": "slategray",
    "mold_b1": "slategray",
    "mold_b2": "cadetblue",
    "jig": "darkseagreen",
    "jig_plunger": "peru",
    "jig_bar": "rosybrown",
    "jig_gauge": "khaki",
    "stand": "thistle",
    "fixture": "lightsalmon",
    "array_base": "lightsteelblue",
}
"""Colours of the parts in STEP and 3MF files and in the picture; Hall elements have `HALL_ELEMENT_COLOUR`."""

HALL_ELEMENT_COLOUR, REVERSED = "darkslategray", "royalblue"
"""Colours of Hall elements, and of the magnets of an array that lie the other way up than the design's."""

USUAL_FACETS, FINEST_FACETS = 2000, 100000
"""D over the facet tolerance: the default, and the greatest value, beyond which a part has millions of triangles."""


@dataclass(frozen=True, slots=True)
class FabricationChoices:
    """How a sensor is fabricated, beside its design.

    Attributes
    ----------
    mold, base : settings of the mould and of the base.
    tolerance : largest distance of the facets from the surface, mm; None: D/2000.
    silicone : what the recipe says of the mix and the cure; None: that the data sheet tells.
    rated : required press force and force along the plate, N; None: none are stated.
    array : for which one base is made; None: a single sensor. Its beams are cast in one mould, unless the maker gives
        that columns, rows or a split.
    """

    mold: Mold = field(default_factory=Mold)
    base: Base = field(default_factory=Base)
    tolerance: float | None = None
    silicone: Mix | None = None
    rated: tuple[float, float] | None = None
    array: ArrayDesign | None = None

    def of(self, design: Design) -> FabricationChoices:
        """Return the choices for an array of another design, such as a variant."""
        array = self.array and dataclasses.replace(self.array, design=design)
        return dataclasses.replace(
            self, array=array, mold=dataclasses.replace(self.mold, array=array if self.mold.array else None)
        )


@dataclass(frozen=True, slots=True)
class FabricatedSolids:
    """All solids of a sensor and its mould.

    Attributes
    ----------
    sensor : silicone, magnet, base and beam (the outer form of silicone and magnet), in the sensor's frame.
    bodies : the Hall elements, in the sensor's frame.
    plan : plan of the base; None if the elements do not fit into the base, and then `missing` gives the reason.
    whole : plan of the one base of an array, of whose beams `plan` is then; None without one, and where one was
        wanted `no_array` gives the reason.
    mold : mold_a, and mold_b or its halves mold_b1 and mold_b2, closed, in the mould's frame.
    A, B : upper and lower part of the mould; B is not split.
    bench : stand, under B in the mould's frame, and fixture, under the base in the sensor's, or array_base, of an
        array, in the frame of that.
    jig : jig (part C), jig_plunger and jig_bar in the mould's frame, the plunger on the axis, and jig_gauge as it is
        printed; empty without a jig, and then `no_jig` gives the reason if one was wanted.
    """

    sensor: dict[str, Solid]
    bodies: dict[str, Solid]
    plan: Plan | None
    missing: str
    mold: dict[str, Solid]
    A: Solid
    B: Solid
    jig: dict[str, Solid]
    no_jig: str
    bench: dict[str, Solid]
    whole: ArrayPlan | None = None
    no_array: str = ""


def parse_fabrication_choices(
    options: Fabrication,
    silicone: Mix | None = None,
    given: Mapping[str, Any] = {},
    rated: tuple[float, float] | None = None,
    array: ArrayDesign | None = None,
) -> FabricationChoices:
    """Return the fabrication choices that the options state, with the silicone that they name; those of the base may
    hold the name of a shape. What they leave open is that of a design file, see `user_input.fabrication_of`.

    >>> given = Fabrication(process="sla", mold=["columns=3", "shrink=0.01"], base=["round"])
    >>> choices = parse_fabrication_choices(given)
    >>> choices.mold.columns, choices.base.shape
    (3, 'round')
    """
    if options.tolerance is not None:
        check_tolerance(options.tolerance)
    if any(text.partition("=")[0].strip() == "process" for text in options.mold or []):
        raise BadInput("process is not a key of --mold: give --process fdm or --process sla")
    mold = {**given.get("mold", {}), **user_input.parse_choices("--mold", options.mold or [], Mold)}
    texts = [f"shape={text}" if text in SHAPES else text for text in options.base or []]
    base = {**given.get("base", {}), **user_input.parse_choices("--base", texts, Base)}
    user_input.check_keys("fabrication: base", base, [spec.name for spec in dataclasses.fields(Base)])
    user_input.check_keys("fabrication: mold", mold, user_input.keys_of(Mold))
    process = options.process or given.get("process", "fdm")
    # a maker who gives columns, rows or a split casts the beams a few at a time
    cast = None if {"columns", "rows", "split"} & mold.keys() else array
    mold |= {"process": process, "array": cast}
    return FabricationChoices(Mold(**mold), Base(**base), options.tolerance, silicone, rated, array)


def make_solids(design: Design, choices: FabricationChoices) -> FabricatedSolids:
    """Build all solids of the sensor and its mould.

    Raises
    ------
    BadInput
        The mould or the base cannot be built for this design.
    """
    from geometry import base, cad, mold
    from geometry.fabrication import bench_parts, hall_elements, magnet_jig, mold_solids

    beam = cad.beam(design)
    sensor = {"beam": beam, "silicone": beam}
    if design.shape.has_magnet:
        # the cut shares its faces with beam and magnet, so the kernel triangulates each face only once
        sensor["magnet"] = cad.magnet(design)
        sensor["silicone"] = cad.cut(beam, sensor["magnet"])
    # a default base that cannot hold the elements is left out; one that the user has set is an error
    plan, missing, bodies = None, "", {}
    whole, no_array = array_plan_of(choices)
    try:
        plan = whole.one if whole else base.plan(design, choices.base, choices.mold.process)
        sensor["base"], bodies = base.base(plan), hall_elements.bodies(design)
    except BadInput as error:
        if choices.base != Base():
            raise
        missing = f"no base and no assembly: {error}"
    A, B = mold_solids.closed_mold(design, choices.mold, beam)
    halves = mold_solids.halves(design, choices.mold, B) if choices.mold.split else {"mold_b": B}
    lengths, no_jig = magnet_jig.planned(design, choices.mold)
    jig = magnet_jig.solids(design, choices.mold, lengths) if lengths else {}
    s = mold.sizes(design, choices.mold)
    bench = bench_parts.solids(s, None if whole else plan, choices.mold, choices.base.cell)
    if whole:
        bench["array_base"] = base.array_base(whole)
    return FabricatedSolids(
        sensor, bodies, plan, missing, {"mold_a": A, **halves}, A, B, jig, no_jig, bench, whole, no_array
    )


def array_plan_of(choices: FabricationChoices) -> tuple[ArrayPlan | None, str]:
    """Return the plan of the one base of an array; None without an array, or with the reason why there is none."""
    from geometry import base

    if choices.array is None:
        return None, ""
    try:
        return base.array_plan(choices.array, choices.base, choices.mold.process), ""
    except BadInput as error:
        return None, f"no base for the whole array: {error}"


def coloured_parts(solids: FabricatedSolids) -> dict[str, tuple[Solid, str]]:
    """Return the parts of the assembled sensor, or of all beams of an array on their base, each with its colour."""
    from geometry.cad import moved

    if solids.whole:
        array, found = solids.whole.array, {"base": (solids.bench["array_base"], COLOURS["array_base"])}
        for k, ((x, y), pole) in enumerate(zip(array.places.tolist(), array.poles.tolist(), strict=True), 1):
            single = {"silicone": COLOURS["silicone"], "magnet": COLOURS["magnet"] if pole > 0 else REVERSED}
            for name, colour in single.items():
                if name in solids.sensor:
                    found[f"{name} {k}"] = moved(solids.sensor[name], (x, y, 0.0)), colour
            for name, body in solids.bodies.items():
                found[f"{name} of beam {k}"] = moved(body, (x, y, 0.0)), HALL_ELEMENT_COLOUR
        return found
    parts = {name: part for name, part in solids.sensor.items() if name != "beam"} | solids.bodies
    return {name: (part, COLOURS.get(name, HALL_ELEMENT_COLOUR)) for name, part in parts.items()}


def array_scene(solids: FabricatedSolids) -> tuple[dict[str, tuple[Solid, str]], dict[str, Vector]] | None:
    """Return the parts of an array for a picture, the first row in the plane y = 0, and labels; None of one sensor.

    Labels name a magnet of each pole.
    """
    from geometry.cad import moved

    if not solids.whole:
        return None
    array, design = solids.whole.array, solids.whole.array.design
    row = float(array.places[:, 1].min())
    parts = {name: (moved(part, (0.0, -row, 0.0)), colour) for name, (part, colour) in coloured_parts(solids).items()}
    points: dict[str, Vector] = {}
    for k, (x, y) in enumerate(array.places.tolist(), 1):
        north = array.of_beam(k - 1).magnet_north
        label = f"magnet {k}, north {north}"
        if y == row and f"magnet {k}" in parts and not any(name.endswith(north) for name in points):
            parts[label] = parts.pop(f"magnet {k}")
            points[label] = x, -design.magnet_diameter / 2, design.H
    return parts, points


def casting_parts(
    design: Design, choices: FabricationChoices, solids: FabricatedSolids
) -> tuple[dict[str, tuple[Solid, str]], dict[str, Vector]]:
    """Return the jig on B with casts, magnets, plungers, bar and screws, each with its colour, and points for labels.

    A row of cavities lies in the plane y = 0 of the mould's frame, moved along y.
    """
    from geometry.cad import moved
    from geometry.fabrication import magnet_jig
    from geometry.mold import SEAT, sizes

    s, jig = sizes(design, choices.mold), magnet_jig.lengths(design, choices.mold)
    _, row = min(s.centres, key=lambda centre: abs(centre[1]))
    parts = {
        "mould B": (moved(solids.B, (0.0, -row, 0.0)), COLOURS["mold_b"]),
        "jig": (moved(solids.jig["jig"], (0.0, -row, 0.0)), COLOURS["jig"]),
        "bar": (moved(solids.jig["jig_bar"], (0.0, -row, 0.0)), COLOURS["jig_bar"]),
    }
    single = {
        "magnet": (magnet_jig.magnet_in_pocket(design, s), COLOURS["magnet"]),
        "cast": (magnet_jig.cast(s), COLOURS["beam"]),
        "plunger": (solids.jig["jig_plunger"], COLOURS["jig_plunger"]),
    }
    in_row = [x for x, y in s.centres if y == row]
    for k, x in enumerate(in_row):
        parts |= {
            name if k == 0 else f"{name} {k + 1}": (moved(part, (x, 0.0, 0.0)), colour)
            for name, (part, colour) in single.items()
        }
    screw = magnet_jig.screw(s, jig)
    for k, lug in enumerate(s.lugs):
        x, y = lug.at(s.reach[1])
        parts["screw" if k == 0 else f"screw {k + 1}"] = moved(screw, (x, y - row, 0.0)), "whitesmoke"
    x = min(in_row)
    points = {
        "mould B": (x - (s.R + s.outer) / 2, 0.0, -SEAT),
        "jig": (x - s.rim + 0.5, 0.0, jig.lid / 2),
        "bar": (x - s.rim + 0.5, 0.0, jig.top + jig.bar / 2),
        "plunger": (x + (jig.vent + jig.tip) / 2, 0.0, jig.lid / 2),
        "cast": (x - (s.R + s.pin_radius) / 2, 0.0, -s.pin_depth),
        "magnet": (x, -design.magnet_diameter / 2, -jig.depth - design.magnet_height / 2),
    }
    return parts, points


def triangulated_parts(
    design: Design, choices: FabricationChoices, solids: FabricatedSolids
) -> dict[str, tuple[Solid, Any]]:
    """Return each part that is exported, with its triangles.

    Printed parts stand as they are printed; the others are in the sensor's frame.

    Raises
    ------
    MeshError
        See `geometry.fabrication.solid_files.facets`.
    """
    from geometry.fabrication import solid_files
    from geometry.fabrication.printability import standing

    parts = {name: part for name, part in solids.sensor.items() if name != "base"}
    parts |= {"base": standing(solids.sensor["base"])} if solids.plan and not solids.whole else {}
    turned = ("mold_a", "jig", "jig_plunger")
    printed = solids.mold | solids.jig | solids.bench
    parts |= {name: standing(part, upside_down=name in turned) for name, part in printed.items()}
    tolerance = facet_tolerance(design, choices)
    return {name: (part, solid_files.facets(name, part, tolerance)) for name, part in parts.items()}


def facet_tolerance(design: Design, choices: FabricationChoices) -> float:
    """Return the largest distance of the facets from the surface, mm.

    Raises
    ------
    BadInput
        The tolerance is so small that a part would have millions of facets.
    """
    tolerance = design.D / USUAL_FACETS if choices.tolerance is None else choices.tolerance
    if not tolerance >= design.D / FINEST_FACETS:
        raise BadInput(
            f"tolerance must be at least D/{FINEST_FACETS} = {design.D / FINEST_FACETS:g} mm, "
            f"to avoid millions of triangles; got {tolerance:g} mm"
        )
    return tolerance
