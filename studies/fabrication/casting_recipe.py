"""The README.md of an exported folder: what to print, how to cast, and how much silicone each pour takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.base import Plan
from geometry.design import Design
from geometry.mold import Mold, pours, sizes
from studies.fabrication.fabrication_rows import Cure, Dowels, FabricationRow, Recipe

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
    if not choices.mold.split:
        return Recipe(magnet, cures, None)
    s = sizes(design, choices.mold)
    return Recipe(magnet, cures, Dowels(2, s.dowel, s.floor))


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
        *_printing(design, choices, plan),
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


def _printing(design: Design, choices: FabricationChoices, plan: Plan | None) -> list[str]:
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
    if m.split:
        s = sizes(design, m)
        lines.append(
            f"- Two dowels of Ø{s.dowel:.3g} mm, {s.floor:.3g} mm long (flush with the foot, below A's skirt), stand "
            "in the foot, in the plane of the split; a rubber band round the foot holds the halves."
        )
    return [*lines, ""]


def _casting(design: Design, choices: FabricationChoices, recipe: Recipe) -> list[str]:
    m = choices.mold
    steps = [*_first_pour(m), *_second_pour(design), _demoulding(m)]
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


def _first_pour(m: Mold) -> list[str]:
    """Return the steps from the empty mould to the cured beam, still in part B."""
    return [
        "Spray release agent into B and onto A's underside and pin; let it dry.",
        "Mix the silicone's parts by its data sheet (Dragon Skin 30: 1 to 1), degas until it has risen and fallen.",
        (
            "Fill B to its rim, then press A on slowly, until the lid lies on the rim: air and surplus leave by the "
            f"{m.vents} vents of each cavity."
        ),
        "Degas again in the vacuum chamber; top up through the vents.",
        "First cure: 16 h at room temperature, or in the oven at no more than the table below allows.",
        "Lift A straight up, a blade in the slot between skirt and foot. Leave the cast in B.",
    ]


def _second_pour(design: Design) -> list[str]:
    """Return the steps that put the magnet into its pocket; none without a magnet."""
    if not design.shape.has_magnet:
        return []
    # the mould holds the sensor upside down
    down = design.magnet_north == "down"
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
        (
            "Second pour: mix afresh, fill the pocket over the magnet, degas, and strike it off flush with B's rim, "
            "which is the base plane."
        ),
        (
            "Second cure, with the magnet: 16 h at room temperature, or in the oven at no more than the table below "
            "allows."
        ),
    ]


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
        where = f", {design.chip_x:g} mm from the axis on x" if design.chip_x else ""
        lines.append(f"1. The chip's board is glued under the base, the chip in its pocket{where}.")
        lines.append("2. Its z axis must point down as in the model, or change the sign.")
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
