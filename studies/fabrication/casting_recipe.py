"""The README.md of an exported folder: what to print, how to cast, and how much silicone each pour takes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from analytic import magnet as magnet_field
from geometry.base import Plan
from geometry.design import Design
from geometry.fabrication import board_drawing
from geometry.mold import BOLT, EAR_DEPTH, Mold, pours, sizes
from studies.output import page_templates
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from studies.fabrication.sensor_solids import FabricationChoices

MARK = "# Magnetic force sensor, D = "
"""First words of the file, by which `magtip cad` recognises a README.md that it wrote itself."""

WASTE = 0.5
"""Surplus of silicone for vents and rim, as a share of what fills the mould."""

CUP = 2000.0
"""Silicone that stays in a mixing cup, mm³; it is added to what is mixed for each pour."""


MATERIALS = {
    "fdm": {"PLA": 55.0, "PETG": 70.0, "ABS or ASA": 90.0},
    "sla": {"standard resin": 60.0, "high-temperature resin": 200.0},
}
"""Temperatures at which the materials of a mould soften, °C, by process: heat deflection temperatures that vendors
commonly state, rounded down; the data sheet of the material decides."""

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


def recipe_of(design: Design, choices: FabricationChoices) -> FlatRow:
    """Return the temperatures and dowels of a casting.

    magnet_limit_C : working limit of the magnet; None without a magnet.
    cures : greatest temperatures of the cures, for each material that the mould can be printed from.
    dowels, screws : pins that align the halves of a split mould, and screws that clamp them, long enough for two
        washers and a nut; None if the mould is not split.
    silicone : None where the design names none.
    magnets_apart_mm : distance of the axes from which the magnets of neighbouring cavities stay where they are put;
        None without a magnet.
    """
    magnet, s = MAGNET_LIMIT if design.shape.has_magnet else None, sizes(design, choices.mold)
    length = 2 * EAR_DEPTH
    return {
        "magnet_limit_C": magnet,
        "cures": [
            {
                "mold_material": name,
                "mold_limit_C": limit,
                "first_cure_C": cure(limit),
                "second_cure_C": None if magnet is None else cure(min(limit, magnet)),
            }
            for name, limit in MATERIALS[choices.mold.process].items()
        ],
        "dowels": s.ears and {"count": 2, "diameter_mm": s.dowel, "length_mm": length, "hole_mm": s.dowel_hole},
        "screws": s.ears and {"count": 2 * len(s.ears.bolt_z), "thread": f"M{BOLT:g}", "length_mm": length + NUT},
        "silicone": choices.silicone,
        "magnets_apart_mm": magnet_field.resting_distance(design),
    }


def neighbours_push(design: Design, mold: Mold) -> tuple[float, float] | None:
    """Return the force between the magnets of neighbouring cavities, N and over a magnet's weight.

    None where there is no neighbour, or where its magnet stays in its pocket by itself.
    """
    (x, y), *neighbours = sizes(design, mold).centres
    apart = magnet_field.resting_distance(design)
    pitch = min((math.hypot(u - x, v - y) for u, v in neighbours), default=math.inf)
    if apart is None or pitch >= apart:
        return None
    force = magnet_field.repulsion(design.magnet_diameter / 2, design.magnet_height, design.remanence, pitch)
    return force, force / magnet_field.weight(design)


def size_sentence(size: FlatRow) -> str:
    """State the outer size of the assembled sensor in a sentence, or that of the beam if there is no base."""
    beam, whole = (
        " x ".join(f"{side:.4g}" for side in size[name] or ()) for name in ("beam_size_mm", "assembled_size_mm")
    )
    if not whole:
        return f"There is no base and so no assembled size; the beam is {beam} mm (x, y, z)."
    leads = size["leads_below_base_mm"]
    out = f"; the leads, as drawn, extend {leads:.4g} mm below it" if leads else ""
    return (
        f"Assembled, with base and Hall elements: {whole} mm (x, y, z); z is the total height from the base's "
        f"underside{out}."
    )


def text(
    design: Design,
    choices: FabricationChoices,
    fabricated: FlatRow,
    plan: Plan | None,
    picture: str,
    command: str,
) -> str:
    """Return the README.md of one design; it names `command` as its origin."""
    mold, pour_names = choices.mold, ("first: the beam round the pin", "second: over the magnet")
    count, mixes = mold.columns * mold.rows, []
    for name, volume in zip(pour_names, pours(design, mold), strict=True):
        if volume > 0:
            mixes.append((name, count * volume, (1 + WASTE) * count * volume + CUP))
    page = page_templates.rendered(
        Path(__file__).with_name("CASTING.md.j2"),
        mark=MARK,
        d=design,
        m=mold,
        row=fabricated,
        recipe=fabricated["recipe"],
        plan=plan,
        size=size_sentence(fabricated),
        picture=picture,
        command=command,
        cavities=count,
        mixes=mixes,
        waste=WASTE,
        cup=CUP,
        margin=MARGIN,
        paper_cure=PAPER_CURE,
        pushed=neighbours_push(design, mold) if design.shape.has_magnet else None,
        pin=next(iter(board_drawing.pads(design)), None),
    )
    return f"{page}\n"
