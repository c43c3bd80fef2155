"""The list to order from: everything that one casting of sensors needs, from magnet to release agent.

Quantities follow from the design, the recipe and the board. A price stands here only with its date and source; there
is none so far, and an empty cell is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from geometry.base import BOARDS, ArrayPlan, Plan, base_screw, screw_thread
from geometry.design import BadInput, Design
from geometry.fabrication.breakout_boards import BREAKOUTS
from studies.fabrication import array_board, casting_recipe, circuit_board
from studies.fabrication.sensor_solids import FabricationChoices
from studies.output.records import FlatRow
from studies.parts import catalogues

if TYPE_CHECKING:
    from studies.fabrication.board_layers import Board

FILE = "parts.csv"
FILAMENT = 1.24e-3
"""Density of PLA, g/mm³, the common figure of data sheets; parts are taken as solid, as the recipe asks for."""
PRINT_TIME = (6.5, 17.0)
"""Minutes for a cm³, layers of 0.1 mm, nozzle of 0.4 mm: six parts of 1 to 16 cm³ sliced by PrusaSlicer 2.5."""
SYRINGE = 10.0
"""Volume of a syringe, mL."""
PRICE = ("price_low", "price_high", "currency", "price_date", "price_source")
PRINTED = (
    "base",
    "mold_a",
    "mold_b",
    "mold_b1",
    "mold_b2",
    "jig",
    "jig_plunger",
    "jig_bar",
    "jig_gauge",
    "stand",
    "fixture",
    "array_base",
)


def board_of(design: Design, plan: Plan | None, whole: ArrayPlan | None = None) -> Board | None:
    """Return the board of a design, or of all beams of an array, without its ground; None if none can be drawn."""
    try:
        if whole:
            return array_board.placed(whole)[0]
        return circuit_board.wired(design, plan) if plan else None
    except BadInput:
        return None


def printed_volumes(design: Design, choices: FabricationChoices) -> dict[str, float]:
    """Return the volumes of the printed parts, mm³."""
    from studies.fabrication.sensor_solids import make_solids

    solids = make_solids(design, choices)
    parts = solids.sensor | solids.mold | solids.jig | solids.bench
    return {name: part.volume for name, part in parts.items() if name in PRINTED}


def rows(
    design: Design,
    choices: FabricationChoices,
    plan: Plan | None,
    volumes: Mapping[str, float],
    board: Board | None = None,
    whole: ArrayPlan | None = None,
) -> list[FlatRow]:
    """Return a row for each thing to order: group, item, quantity with its unit, for how many sensors, and a note.

    An array is one sensor, whose beams take one casting or several.

    Parameters
    ----------
    plan : of the base; None if there is none, and then no board and no Hall parts.
    volumes : of the printed parts by their names, mm³.
    board : None if no board can be drawn for the design, and then the Hall parts stand without it.
    whole : of the one base of an array; None without one.
    """
    beams, castings = beams_of(choices), castings_of(choices)
    found = [
        *_magnets(design, choices, beams),
        *_silicone(design, choices, castings),
        *_board(design, choices, plan, board, 1 if whole and board else beams),
        *_screws(design, choices, plan, board, whole),
        *_prints(choices, volumes),
        *_consumables(design, choices, castings),
    ]
    sensors = 1 if choices.array else beams
    return [row | {"for_sensors": sensors} | dict.fromkeys(PRICE) for row in found]


def _row(group: str, item: str, quantity: float, unit: str = "piece", note: str = "") -> FlatRow:
    return {"group": group, "item": item, "quantity": quantity, "unit": unit, "note": note}


def _magnets(design: Design, choices: FabricationChoices, sensors: int) -> Iterator[FlatRow]:
    if not design.shape.has_magnet:
        return
    same = [
        part
        for part in catalogues.shipped_parts()[0]
        if math.isclose(part.diameter, design.magnet_diameter) and math.isclose(part.height, design.magnet_height)
    ]
    grades = [part for part in same if part.remanence_low <= design.remanence <= part.remanence_high]
    size = f"cylinder {design.magnet_diameter:g} x {design.magnet_height:g} mm, magnetised along its axis"
    grade = " or ".join(part.grade for part in grades) or f"of a grade with {design.remanence:g} T"
    tolerance = f", +-{same[0].tolerance:g} mm" if same else ""
    pole = {"down": "base", "up": "tip"}[design.magnet_north]
    turned = sum(each < 0 for each in choices.array.poles) if choices.array else 0
    note = f"remanence {design.remanence:g} T; mark the north pole, which points to the {pole}"
    note += f", of {turned} the other way" if turned else ""
    yield _row(
        "magnet", f"{size}, {grade}{tolerance}", sensors, note=note if same else f"{note}; not in the catalogue"
    )


def beams_of(choices: FabricationChoices) -> int:
    """Return the number of beams: of an array all, else one for each cavity."""
    return len(choices.array) if choices.array else choices.mold.cavities


def castings_of(choices: FabricationChoices) -> int:
    """Return how often the mould is filled."""
    return math.ceil(beams_of(choices) / choices.mold.cavities)


def _silicone(design: Design, choices: FabricationChoices, castings: int) -> Iterator[FlatRow]:
    mixes = casting_recipe.mixes_of(design, choices)
    name = choices.silicone["name"] if choices.silicone else design.silicone or "silicone"
    if any(mix["A_g"] is None for mix in mixes):
        total = castings * sum(mix["batches"] * mix["mix_g"] for mix in mixes)
        yield _row("silicone", f"{name}, both parts", round(total, 2), "g", "ratio of the parts: see its data sheet")
        return
    for part in ("A", "B"):
        total = castings * sum(mix["batches"] * mix[f"{part}_g"] for mix in mixes)
        batches = castings * sum(mix["batches"] for mix in mixes)
        yield _row("silicone", f"{name}, part {part}", round(total, 2), "g", f"{batches} batches of the recipe")


def _board(
    design: Design, choices: FabricationChoices, plan: Plan | None, board: Board | None, sensors: int
) -> Iterator[FlatRow]:
    if plan is None:
        return
    if name := choices.base.breakout:
        yield _row("electronics", f"breakout board {name}", sensors, note=BREAKOUTS[name].source)
        return
    if board is None:
        count = 3 if design.hall_layout == "three" else int(design.chip_count)
        yield _row(
            "electronics", f"Hall part {design.hall_layout}", count * sensors, note="no board: see magtip board"
        )
        return
    yield _row("electronics", "circuit board, two layers: gerbers.zip", sensors, note="of magtip board")
    counts: dict[str, int] = {}
    for part in board.parts:
        counts[part.order] = counts.get(part.order, 0) + sensors
    yield from (_row("electronics", order, count) for order, count in counts.items())


def _screws(
    design: Design,
    choices: FabricationChoices,
    plan: Plan | None,
    board: Board | None,
    whole: ArrayPlan | None,
) -> Iterator[FlatRow]:
    thread, sensors = "", 1 if whole else beams_of(choices)
    if plan and plan.screw:
        length = base_screw(plan, board.thickness if board else BOARDS[0])
        thread = f"M{screw_thread(plan.screw):g}"
        note = "brass, nylon or titanium: steel changes the field"
        yield _row("screws", f"{thread} x {length} mm", 4 * sensors, note=note)
        yield _row("screws", f"nut {thread}", 4 * sensors, note=note)
    recipe = casting_recipe.recipe_of(design, choices, None if whole else plan)
    lid = recipe["lid_screws"]
    kind = f"countersunk screw {lid['thread']} x {lid['length_mm']:g} mm of nylon, with nut and washer"
    yield _row("mould", kind, lid["count"], note="holds A down")
    if jig := recipe["jig"]:
        kind = f"countersunk screw {lid['thread']} x {jig['screw_mm']:g} mm of nylon, with nut and washer"
        yield _row("mould", kind, lid["count"], note="clamps the jig and its bar")
    yield _row("bench", f"screw M3 x {recipe['stand']['screw_mm']:g} mm of nylon", 3, note="levels the stand")
    if fixture := recipe["fixture"]:
        yield _row("bench", f"load cell {fixture['cell']}", 1, note="its capacity must exceed the largest press")
        kind = f"countersunk screw {fixture['cell_thread']} x {fixture['cell_screw_mm']:g} mm, and two washers"
        yield _row("bench", kind, fixture["cell_screws"], note="fixture on the load cell")
        if fixture["screw_mm"]:
            kind = f"countersunk screw {thread} x {fixture['screw_mm']:g} mm, with nut"
            yield _row("bench", kind, len(plan.screws) if plan else 4, note="base on the fixture; not of steel")
    if pins := recipe["dowels"]:
        yield _row("mould", f"dowel pin {pins['diameter_mm']:g} x {pins['length_mm']:g} mm", pins["count"])
    if screws := recipe["screws"]:
        yield _row("mould", f"screw {screws['thread']} x {screws['length_mm']:g} mm with nut", screws["count"])
        yield _row("mould", f"washer {screws['thread']}", 2 * screws["count"])


def count_of(name: str, choices: FabricationChoices) -> int:
    """Return how many of a printed part there are."""
    return {"base": beams_of(choices), "jig_plunger": choices.mold.cavities}.get(name, 1)


def _prints(choices: FabricationChoices, volumes: Mapping[str, float]) -> Iterator[FlatRow]:
    for name, volume in volumes.items():
        count = count_of(name, choices)
        if choices.mold.process == "sla":
            yield _row("print", f"{name} of resin", round(count * volume / 1e3, 2), "mL", "without supports")
            continue
        low, high = (count * volume / 1e3 * rate for rate in PRINT_TIME)
        span = " to ".join(dict.fromkeys((_rounded(low), _rounded(high))))
        time = f"about {span} min: {PRINT_TIME[0]:g} to {PRINT_TIME[1]:g} min a cm³"
        grams = round(count * volume * FILAMENT, 1)
        yield _row("print", f"{name} of filament", grams, "g", f"solid PLA; {time} at layers of 0.1 mm")


def _rounded(minutes: float) -> str:
    return f"{max(5, 5 * round(minutes / 5)):g}"


def _consumables(design: Design, choices: FabricationChoices, castings: int) -> Iterator[FlatRow]:
    mixes = casting_recipe.mixes_of(design, choices)
    batches = castings * sum(mix["batches"] for mix in mixes)
    syringes = castings * sum(mix["batches"] * math.ceil(mix["mix_mL"] / SYRINGE) for mix in mixes)
    yield _row("consumables", f"syringe of {SYRINGE:g} mL with a blunt needle", syringes, note="one for each batch")
    yield _row("consumables", "mixing cup of clean plastic, and a stick", batches)
    yield _row("consumables", "release agent for silicone", 1)
    if design.shape.has_magnet:
        yield _row("consumables", "silane primer for platinum (addition-cure) silicone", 1, note="on the magnet")
    yield _row("consumables", "silicone glue with its primer", 1, note="beam on base")
    yield _row("consumables", "isopropanol and lint-free cloth", 1)
    yield _row("consumables", "gloves of nitrile or vinyl", 1, "pair", "latex keeps platinum silicone from curing")
