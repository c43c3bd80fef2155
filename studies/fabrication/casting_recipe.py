"""The README.md of an exported folder: what to print, how to cast, and how much silicone each pour takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analytic import magnet as magnet_field
from geometry.base import Plan
from geometry.design import Design
from geometry.fabrication import board_drawing
from geometry.mold import BOLT, EAR_DEPTH, Mold, pours, sizes
from studies.fabrication.fabrication_rows import Cure, Dowels, FabricationRow, Recipe, Screws, Silicone

if TYPE_CHECKING:
    from geometry.fabrication.solid_files import Exported
    from studies.fabrication.sensor_solids import FabricationChoices
    from studies.simulation.design_summary import OuterSize

MARK = "# Magnetic force sensor, D = "
"""First words of the file, by which `magtip cad` recognises a README.md that it wrote itself."""

WASTE = 0.5
"""Surplus of silicone for vents and rim, as a share of what fills the mould."""

CUP = 2000.0
"""Silicone that stays in a mixing cup, mm³; it is added to what is mixed for each pour."""


@dataclass(frozen=True, slots=True)
class Material:
    """A material that a mould is printed from; `limit` is its softening temperature, °C."""

    process: str
    name: str
    limit: float


MATERIALS = (
    Material("fdm", "PLA", 55.0),
    Material("fdm", "PETG", 70.0),
    Material("fdm", "ABS or ASA", 90.0),
    Material("sla", "standard resin", 60.0),
    Material("sla", "high-temperature resin", 200.0),
)
"""Heat deflection temperatures that vendors commonly state, rounded down; the data sheet of the material decides."""

MAGNET_LIMIT = 80.0
"""Working limit of common sintered NdFeB, grade N without a further letter, °C; grades M, H and SH withstand more."""

MARGIN = 10.0
"""Least difference between the temperature of a cure and the limits of mould and magnet, K."""

PAPER_CURE = 80.0
"""Temperature at which the paper cures the silicone for 1 h, °C; no cure is hotter."""


NUT = 6.0
"""Length of a screw beside the two ears, mm: an M3 nut, two washers and a turn of thread."""


def cure(limit: float) -> float:
    """Return the hottest cure for a material or a magnet whose limit is `limit`, °C.

    >>> cure(55.0), cure(200.0)
    (45.0, 80.0)
    """
    return min(PAPER_CURE, limit - MARGIN)


def recipe_of(design: Design, choices: FabricationChoices) -> Recipe:
    """Return the temperatures and dowels of a casting."""
    magnet = MAGNET_LIMIT if design.shape.has_magnet else None
    cures = tuple(
        Cure(
            material.name,
            material.limit,
            cure(material.limit),
            None if magnet is None else cure(min(material.limit, magnet)),
        )
        for material in MATERIALS
        if material.process == choices.mold.process
    )
    s, apart = sizes(design, choices.mold), magnet_field.resting_distance(design)
    if s.ears is None:
        return Recipe(magnet, cures, None, silicone=choices.silicone, magnets_apart_mm=apart)
    length = 2 * EAR_DEPTH
    dowels = Dowels(2, s.dowel, length, s.dowel_hole)
    screws = Screws(2 * len(s.ears.bolt_z), f"M{BOLT:g}", length + NUT)
    return Recipe(magnet, cures, dowels, screws, choices.silicone, apart)


def neighbours_push(design: Design, mold: Mold) -> tuple[float, float] | None:
    """Return the force between the magnets of neighbouring cavities, N and over a magnet's weight.

    None where there is no neighbour, or where its magnet stays in its pocket by itself.
    """
    (x, y), *others = sizes(design, mold).centres
    apart = magnet_field.resting_distance(design)
    pitch = min((math.hypot(u - x, v - y) for u, v in others), default=math.inf)
    if apart is None or pitch >= apart:
        return None
    force = magnet_field.repulsion(design.magnet_diameter / 2, design.magnet_height, design.remanence, pitch)
    return force, force / magnet_field.weight(design)


def size_sentence(size: OuterSize) -> str:
    """State the outer size of the assembled sensor in a sentence, or that of the beam if there is no base."""
    if size.assembled_size_mm is None:
        return f"There is no base and so no assembled size; the beam is {_sides(size.beam_size_mm)} mm (x, y, z)."
    leads = size.leads_below_base_mm
    out = f"; the leads, as drawn, extend {leads:.4g} mm below it" if leads else ""
    return (
        f"Assembled, with base and Hall elements: {_sides(size.assembled_size_mm)} mm (x, y, z); z is the "
        f"total height from the base's underside{out}."
    )


def _sides(size: Sequence[float]) -> str:
    return " x ".join(f"{side:.4g}" for side in size)


def text(
    design: Design,
    choices: FabricationChoices,
    fabricated: FabricationRow,
    recipe: Recipe,
    size: OuterSize,
    plan: Plan | None,
    picture: str,
    command: str,
) -> str:
    """Return the README.md of one design; it names `command` as its origin."""
    d = design
    lines = [
        f"{MARK}{d.D:g} mm, L = {d.L:g} mm",
        "",
        f"Written by `{command}`. Lengths are mm.",
        "",
        size_sentence(size),
        "",
        *([f"![the sensor, cut open]({picture})", ""] if picture else []),
        *_files(fabricated.parts, plan),
        *_printing(design, choices, recipe, plan),
        *_casting(design, choices, recipe),
        *_assembly(design, plan),
        *_checks(fabricated),
    ]
    return "\n".join(lines) + "\n"


def _files(parts: Sequence[Exported], plan: Plan | None) -> list[str]:
    frames = {"beam": "outer form", "silicone": "beam less magnet", "magnet": "", "base": "print", "mold_a": "print"}
    lines = [
        "## Files",
        "",
        "| part (.step, .stl, .3mf) | for | volume (mm³) | error of the triangles' volume |",
        "|---|---|---:|---:|",
    ]
    for part in parts:
        use = frames.get(part.name, "print") or "buy"
        lines.append(f"| {part.name} | {use} | {part.volume_mm3:.6g} | {part.relative_error:.1e} |")
    lines += ["", "Parts to print lie as they are printed, on z = 0; the others are in the sensor's frame."]
    lines.append("`mold.step` shows the closed mould, `mold.svg` its drawing.")
    if plan:
        lines.append("`assembly.step` shows the whole sensor with named, coloured parts; `sensor.svg` and `base.svg`")
        lines.append(
            "are dimensioned drawings on A4. `board.dxf` (R2010, mm, seen from above) has the base's outline"
        )
        lines.append("and the elements' pads for a board: check the pads against your data sheet.")
    return [*lines, ""]


def _printing(design: Design, choices: FabricationChoices, recipe: Recipe, plan: Plan | None) -> list[str]:
    m = choices.mold
    b = "both halves of B" if m.split else "B (mold_b)"
    lines = [
        "## Print",
        "",
        f"- Process: {m.printing.name}. No supports: A (mold_a) with its lid down, {b} on the foot"
        + (", the base with its underside down." if plan else "."),
        "- Layers of 0.1 mm or finer in the cavity: every step of it shows on the sensor's skin.",
    ]
    if m.process == "sla":
        lines.append(
            "- Platinum silicone does not cure on most fresh resins: wash, cure under UV, bake for some hours at "
            "the temperature of the first cure below, and varnish the mould; try a drop first."
        )
    if m.marks:
        lines.append(
            "- The letter A is on the lid, B on the foot; N or S on the foot is the pole of the magnet that faces up "
            "when it is glued into its pocket."
        )
    lines.append("- The cure decides the material: see the temperatures under Cast.")
    if recipe.dowels and recipe.screws:
        pins, screws = recipe.dowels, recipe.screws
        lines.append(
            f"- Two pins of Ø{pins.diameter_mm:g} x {pins.length_mm:g} mm lie across the split, in holes of "
            f"Ø{pins.hole_mm:.3g} mm in the ears; {screws.count} screws {screws.thread} x {screws.length_mm:g} mm "
            "with washers and nuts clamp the ears along the seam. Tighten them before each pour, in turn, until no "
            "light shows through the seam; a film of petroleum jelly on it keeps thin silicone from creeping in."
        )
    return [*lines, ""]


def _casting(design: Design, choices: FabricationChoices, recipe: Recipe) -> list[str]:
    m = choices.mold
    steps = [*_first_pour(m, recipe), *_second_pour(design, m, recipe), _demoulding(m)]
    larger = 100 * (1 / (1 - m.shrink) - 1)
    return [
        *_mixes(design, m),
        "",
        *(f"{k}. {step}" for k, step in enumerate(steps, 1)),
        "",
        *_temperatures(recipe),
        (
            f"Cavity and pin are {larger:.3g} % larger than the part, for {100 * m.shrink:g} % of linear shrinkage; "
            "the fit of A on B is not scaled."
        ),
        "",
    ]


def _mixes(design: Design, m: Mold) -> list[str]:
    """Return the table of what to mix for each pour."""
    count = m.columns * m.rows
    lines = [
        "## Cast",
        "",
        f"{count} {'cavity' if count == 1 else 'cavities'}. What to mix holds {100 * WASTE:g} % for vents and",
        f"spills, and {CUP / 1000:g} mL that the cup keeps.",
        "",
        "| pour | stays in the parts (mL) | mix (mL) | mix (g) |",
        "|---|---:|---:|---:|",
    ]
    for name, one in zip(("first: the beam round the pin", "second: over the magnet"), pours(design, m), strict=True):
        volume = count * one
        if volume > 0:
            mix = (1 + WASTE) * volume + CUP
            lines.append(f"| {name} | {volume / 1e3:.3f} | {mix / 1e3:.2f} | {mix * design.density / 1e6:.2f} |")
    return lines


def _first_pour(m: Mold, recipe: Recipe) -> list[str]:
    """Return the steps from the empty mould to the cured beam, still in part B."""
    return [
        "Spray release agent into B and onto A's underside and pin; let it dry.",
        f"{_mixing(recipe.silicone)}, degas until it has risen and fallen.",
        (
            "Fill B to its rim, then press A on slowly, until the lid lies on the rim: air and surplus leave by the "
            f"{m.vents} vents of each cavity."
        ),
        "Degas again in the vacuum chamber; top up through the vents.",
        f"First cure: {_curing(recipe.silicone)}, or in the oven at no more than the table below allows.",
        "Lift A straight up, a blade in the slot between skirt and foot. Leave the cast in B.",
    ]


def _mixing(silicone: Silicone | None) -> str:
    """Return how to mix; a ratio whose source was not read is said to need a look."""
    if silicone is None:
        return "Mix the silicone's parts as its data sheet says"
    unread = ", a ratio to check on its data sheet" if "mixed" in silicone.assumed else f" ({silicone.source})"
    return f"Mix {silicone.name} {silicone.mixed}{unread}"


def _curing(silicone: Silicone | None) -> str:
    """Return how long to cure without an oven."""
    if silicone is None:
        return "at room temperature for as long as the silicone's data sheet says"
    unread = ", times to check on its data sheet" if "hours" in silicone.assumed else ""
    return f"{silicone.hours:g} h at {silicone.temperature:g} °C{unread}"


def _second_pour(design: Design, m: Mold, recipe: Recipe) -> list[str]:
    """Return the steps that put the magnet into its pocket; none without a magnet."""
    if not design.shape.has_magnet:
        return []
    # the mould holds the sensor upside down
    down, pushed = design.magnet_north == "down", neighbours_push(design, m)
    north = "up, out of the mould: it points to the base" if down else "down, into the mould: it points to the tip"
    return [
        (
            "Wipe release agent out of the pocket with isopropanol. Degrease the magnet, coat it with a silane "
            "primer for platinum (addition-cure) silicone, and let it dry: silicone does not bond to nickel plating "
            "by itself, and the finite elements take magnet and silicone as bonded all round."
        ),
        (
            f"Glue the magnet ({design.magnet_diameter:g} x {design.magnet_height:g} mm) to the bottom of the "
            f"pocket with a drop of the same silicone, its north pole {north} later. Glues of tin-cured silicone or "
            "amine-cured epoxy keep platinum silicone from curing."
        ),
        *([_apart(*pushed, recipe)] if pushed else []),
        (
            f"Let the glue cure before the second pour ({_curing(recipe.silicone)}): a magnet on wet silicone "
            "shifts, tilts and turns."
        ),
        (
            "Second pour: mix afresh, fill the pocket over the magnet, degas, and strike it off flush with B's rim, "
            "which is the base plane."
        ),
        (
            f"Second cure, with the magnet: {_curing(recipe.silicone)}, or in the oven at no more than the table "
            "below allows."
        ),
    ]


def _apart(force: float, weights: float, recipe: Recipe) -> str:
    """Return the step that keeps neighbouring magnets in their pockets."""
    return (
        f"Neighbouring magnets, like poles up, repel with {force:.2g} N, {weights:.2g} times their weight, and would "
        "rather turn over. Put them in one after another: hold each down with a rod of brass, aluminium or wood that "
        "fills the pocket until its glue has cured, and only then bring the next; keep steel tools and other magnets "
        f"away. They stay by themselves from {recipe.magnets_apart_mm:.3g} mm between their axes on."
    )


def _demoulding(m: Mold) -> str:
    """Return the step that takes the cast out of part B."""
    out = "take the halves of B apart sideways" if m.split else "pull the cast straight up out of B"
    step = f"Cut the nubs of the vents, and {out}" + (" (first cut the nub of the tip)." if m.tip_vent else ".")
    if m.split:
        return step
    return (
        f"{step} The cavity has no draft, for it is the beam: pulled, silicone thins and lets go of the wall. Where "
        "it sticks, soapy water or air down the wall helps, or a mould made with `--mold split=1`."
    )


def _temperatures(recipe: Recipe) -> list[str]:
    """Return the table of the greatest temperature of each cure."""
    limit = recipe.magnet_limit_C
    second = "" if limit is None else " second cure, at most |"
    lines = [
        f"| mould of | softens from about | first cure, at most |{second}",
        f"|---|---:|---:|{second and '---:|'}",
    ]
    for each in recipe.cures:
        last = "" if each.second_cure_C is None else f" {each.second_cure_C:g} °C |"
        lines.append(f"| {each.mold_material} | {each.mold_limit_C:g} °C | {each.first_cure_C:g} °C |{last}")
    bounds = (
        f"Each is {MARGIN:g} K below what mould and magnet stand, and at most the paper's {PAPER_CURE:g} °C (1 h); "
        "how long a cooler cure takes, the silicone's data sheet says. The mould's figures are common ones: your "
        "material's data sheet goes first."
    )
    lines += ["", bounds]
    if limit is not None:
        lines.append(
            f"The magnet: common sintered NdFeB of grade N works up to {limit:g} °C and loses field for good above, "
            "a flat one somewhat earlier; grades M, H and SH stand 100, 120 and 150 °C."
        )
    return [*lines, ""]


def _assembly(design: Design, plan: Plan | None) -> list[str]:
    if plan is None:
        return []
    lines = ["## Assemble", ""]
    if plan.marks:
        lines += ["Grooves in the edge of the base's upper face mark the axes: one at +x, two at +y.", ""]
    if design.hall_layout == "three":
        lines.append("1. S1 goes into the pocket under the base, marked face up, its leads in the channel.")
        lines.append("2. S2 (on x) and S3 (on y) go into their slots, marked face to the beam, down to the ledge.")
        lines.append(
            "   Their output may fall where the model's rises: the sign of the part's gain decides; check it."
        )
    else:
        pads = board_drawing.pads(design)
        x, y = pads[0]
        where = f", {design.chip_x:g} mm from the axis on x" if design.chip_x else ""
        lines.append(f"1. The chip's board is glued under the base, the chip in its pocket{where}. Seen from above,")
        lines.append(f"   its pin 1 lies at x = {x:.3g}, y = {y:.3g} mm, the row of pins 1 to 3 along +x; the chip's")
        lines.append("   own axes are drawn on its data sheet: turn or change signs where they differ.")
        lines.append(
            "   The pocket has room for the chip and its pads; the capacitor goes on the underside of the board."
        )
        lines.append("2. Its z axis must point down as in the model, or change the sign.")
    if plan.screw:
        at = plan.screw_at
        lines.append(f"   Four screws M{math.floor(plan.screw):g} go through the holes of Ø{plan.screw:g} mm at")
        lines.append(f"   x, y = +-{at:.4g} mm and hold base and board; the board needs the same holes.")
    onto = "into the recess" if plan.recess else "onto the middle"
    lines.append(f"3. Glue the beam {onto} of the base with silicone glue; it must hold the whole disc.")
    lines.append("   The finite elements take it as bonded there: prime the base as the glue's data sheet says.")
    if plan.recess:
        gap, share = plan.recess_radius - design.R, 100 * plan.recess / design.L
        lines.append(
            f"   The recess is {plan.recess:g} mm deep and leaves a gap of {gap:.3g} mm around the beam, which may "
            f"stand off the axis by as much. Its floor is the base plane, so l0 and c count as without it. Keep the "
            f"gap free of glue: filled, it shortens the beam by up to {share:.2g} %, and the shear force rises by up "
            f"to {100 * ((1 - plan.recess / design.L) ** -3 - 1):.2g} %."
        )
    lines.append("")
    lines.append("Bodies of the elements and the depth of their plates are partly unchecked figures")
    return [*lines[:-1], lines[-1] + ": measure your parts before you print.", ""]


def _checks(fabricated: FabricationRow) -> list[str]:
    lines = ["## Checks", "", "| check | value | bound | unit |", "|---|---:|---:|---|"]
    for check in fabricated.checks:
        unit = {"1": "-", "mm2": "mm²", "mm3": "mm³"}.get(check.unit, check.unit)
        lines.append(f"| {check.name} | {check.value:.3g} | {check.bound.replace('|', chr(92) + '|')} | {unit} |")
    lines += ["", *(f"Warning: {warning}." for warning in fabricated.warnings)]
    return lines
