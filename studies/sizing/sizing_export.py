"""Export of the best variant: its design file, and solids, mould and casting recipe as `magtip cad` writes them."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.messages import Progress
from studies.inputs import user_input
from studies.output import own_files, page_templates
from studies.output.atomic_files import write_text
from studies.output.literals import literal, one_line, toml
from studies.output.records import FlatRow
from studies.parts import part_tolerances
from studies.parts.requirements import design_table
from studies.sizing import front_yield
from studies.sizing.beam_neighbours import SIDE

if TYPE_CHECKING:
    from studies.parts.requirements import Requirements
    from studies.sizing.candidate_variables import Variant

DESIGN, PARTS = "winner.toml", "fabrication"
"""Design file of the best variant, and folder of its mould and recipe."""


def check_parts(folder: Path) -> None:
    """Raise BadInput if the folder of the parts has files of their names that magtip did not write."""
    from studies.fabrication import sensor_parts

    own_files.check(folder / PARTS, sensor_parts.names())


def remove(folder: Path) -> None:
    """Remove the design file and the parts of an earlier best variant; files of other names stay."""
    from studies.fabrication import sensor_parts

    for name in (DESIGN, *(f"{PARTS}/{name}" for name in sensor_parts.names())):
        (folder / name).unlink(missing_ok=True)
    own_files.remove_empty(folder / PARTS)


def export(variant: Variant, requirements: Requirements, folder: Path, progress: Progress) -> FlatRow:
    """Write the design file, and solids, mould and recipe if they pass their checks."""
    from geometry.mold import Mold
    from studies.fabrication.sensor_parts import RECIPE, build
    from studies.fabrication.sensor_solids import FabricationChoices
    from studies.parts.catalogues import mix_named, mix_of

    process = requirements.process
    mix = mix_of(variant.silicone)
    choices = FabricationChoices(Mold(process=process), requirements.base, silicone=mix, rated=requirements.rated)
    command = f"magtip cad {DESIGN} --out {PARTS}"
    if mix_named(None, variant.silicone.name) == mix:
        command += f" --silicone {shlex.quote(variant.silicone.name)}"
    row = build(variant.design, folder / PARTS, progress, choices, command=command)
    recipe = folder / PARTS / RECIPE
    if row["status"] == "ok" and recipe.exists():
        parts = page_templates.rendered(Path(__file__).with_name("PARTS.md.j2"), variant=variant)
        write_text(recipe, recipe.read_text("utf-8").rstrip("\n") + f"\n\n{parts}\n")
    return row


def write_design(
    variant: Variant, requirements: Requirements, folder: Path, origin: str = "", *, polarity: str = ""
) -> None:
    """Write the design file: all fields that are no defaults, the array, how it is made, and what was required.

    origin : the sentence of `provenance.made`, its first line. polarity : of the required array.
    """
    head = [
        *([f"# {origin}"] if origin else []),
        f"# magnet: {variant.magnet.name}",
        f"# silicone: {variant.silicone.name}, E = {variant.silicone.E_low:g} to {variant.silicone.E_high:g} MPa",
        f"# {variant.silicone.loss_words}",
        f"# Hall part: {f'{variant.hall_part.count} x ' * (variant.hall_part.count > 1)}{variant.hall_part.name}",
    ]
    unused = variant.design.unused_fields()
    fields = user_input.changed_fields(variant.design)
    lines = [*map(one_line, head), *toml({name: value for name, value in fields.items() if name not in unused})]
    if requirements.pitch is not None and polarity:
        sides = toml({"rows": SIDE, "columns": SIDE})
        lines += ["", "[array]", *sides, *toml({"pitch": requirements.pitch, "polarity": polarity})]
    lines += ["", "[fabrication]", *toml({"process": requirements.process})]
    screw = "" if requirements.screws else ", screw = 0"
    lines += [f"base = {{ shape = {literal(requirements.outer_shape)}{screw} }}", design_table(requirements).rstrip()]
    parts = front_yield.parts_of_variant(variant, requirements.process)
    if table := part_tolerances.stated(variant.design, parts):
        lines += ["", "[tolerances]", *toml(table)]
    write_text(folder / DESIGN, "\n".join(lines) + "\n")
