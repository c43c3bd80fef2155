"""The README.md of an exported folder: what to print, how to cast, and how much silicone each pour takes."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analytic import beam_arrays, hall
from analytic import magnet as magnet_field
from analytic.inverse.forward_model import model
from analytic.parts import element_names
from geometry.array_design import ArrayDesign
from geometry.base import BOARDS, ArrayPlan, Plan, base_screw, screw_thread
from geometry.cad import beam_volume
from geometry.design import Design
from geometry.fabrication import bench_parts, board_drawing, magnet_jig
from geometry.fabrication.hall_elements import SS495A, places
from geometry.mold import BOLT, EAR_DEPTH, NUT, Mold, pours, screw_length, sizes
from studies.fabrication.circuit_board import circuits
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.simulation import loaded_clearance

if TYPE_CHECKING:
    from studies.fabrication.sensor_solids import FabricationChoices

MARK = "# Magnetic force sensor, D = "
"""First words of the file, by which `magtip cad` recognises a README.md that it wrote itself."""

WASTE = 0.25
"""Surplus of silicone for vents and spills, as a share of what is poured."""

CUP = 2000.0
"""Silicone that stays in a mixing cup, mm³; it is added to what is mixed for each pour."""

DROP = 50.0
"""Silicone that glues a magnet, mm³: a drop."""

BALANCE = 0.01
"""Step of the balance, g; the masses of the parts are whole steps."""

RATIO = re.compile(r"\s*(\d+(?:\.\d+)?)\s*A\s*:\s*(\d+(?:\.\d+)?)\s*B\b.*\bweight\b", re.IGNORECASE)
"""Form of a ratio by weight, such as 10A:1B by weight; a ratio of another form gives no mass of each part."""

MIXING, DEGASSING, FILLING = 3.0, 8.0, 1.0
"""Minutes that it takes to weigh and mix, to degas until the silicone has risen and fallen and no bubbles come, and
to fill a cavity and close it: what a careful beginner needs, assumed."""

HANDLING = 2.0
"""Hours of work beside the cures: release agent, primer, cleaning, gluing and trimming, assumed."""


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


def cure(limit: float) -> float:
    """Return the hottest cure for a material or a magnet whose limit is `limit`, °C.

    >>> cure(55.0), cure(200.0)
    (45.0, 80.0)
    """
    return min(PAPER_CURE, limit - MARGIN)


def recipe_of(design: Design, choices: FabricationChoices, plan: Plan | None = None) -> FlatRow:
    """Return the temperatures and dowels of a casting; `plan` is that of the base, None without one.

    magnet_limit_C : working limit of the magnet; None without a magnet.
    cures : greatest temperatures of the cures, for each material that the mould can be printed from.
    lid_screws : countersunk screws that clamp A onto B, long enough for a washer and a nut.
    jig : length of the screws that clamp the jig in A's place, diameter of its bores, of a plunger in the bore and of
        its end; None without a jig.
    stand : levelling screws of the stand, and its tilt by one turn of a screw.
    fixture : load cell of the fixture, its screws and those of the base (0: none), its deflection by 1 N, and how far
        the axis of the beam is off the middle of the cell; None without a base.
    magnet_depth_mm : depth of the glued magnet's top below B's rim; None without a magnet.
    dowels, screws : pins that align the halves of a split mould, and screws that clamp them, long enough for two
        washers and a nut; None if the mould is not split.
    silicone : None where the design names none.
    mixes : see `mixes_of`.
    first_pour_min : time from mixing to the end of the second degassing of the first pour.
    total_h : time of all steps with cures as the silicone's data sheet states them; None where it is unknown.
    magnets_apart_mm : distance of the axes from which the magnets of neighbouring cavities stay where they are put;
        None without a magnet.
    """
    magnet, s = MAGNET_LIMIT if design.shape.has_magnet else None, sizes(design, choices.mold)
    length, (jig, _) = 2 * EAR_DEPTH, magnet_jig.planned(design, choices.mold)
    stand = bench_parts.stand(s)
    fixture = plan and bench_parts.fixture(plan, choices.mold.printing, choices.base.cell)
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
        "screws": s.ears
        and {
            "count": (2 + len(s.ears.stations)) * len(s.ears.bolt_z),
            "thread": f"M{BOLT:g}",
            "length_mm": screw_length(length + NUT),
        },
        "lid_screws": {"count": len(s.lugs), "thread": f"M{BOLT:g}", "length_mm": s.screw(s.lid)},
        "jig": jig
        and {
            "screw_mm": s.screw(jig.top + jig.bar),
            "bore_mm": 2 * jig.bore,
            "shank_mm": 2 * jig.shank,
            "end_mm": 2 * jig.tip,
            "limit_mm": magnet_jig.LIMIT,
        },
        "stand": {"screw_mm": stand.length, "tilt_deg": stand.tilt},
        "fixture": fixture
        and {
            "cell": fixture.cell.name,
            "cell_thread": f"M{fixture.cell.thread:g}",
            "cell_screws": len(fixture.cell.holes),
            "cell_screw_mm": fixture.cell_screw,
            "screw_mm": fixture.screw,
            "um_per_N": 1e3 * fixture.compliance,
            "off_mm": fixture.off,
        },
        "magnet_depth_mm": None if magnet is None else s.pin_depth - design.magnet_height,
        "silicone": choices.silicone,
        "mixes": (mixes := mixes_of(design, choices)),
        "first_pour_min": MIXING + 2 * DEGASSING + FILLING * len(s.centres),
        "total_h": choices.silicone and HANDLING + choices.silicone["hours"] * sum(mix["batches"] for mix in mixes),
        "magnets_apart_mm": magnet_field.resting_distance(design),
    }


def mixes_of(design: Design, choices: FabricationChoices) -> list[FlatRow]:
    """Return what to mix for each pour: that of the beam round the pin, the glue of the magnets, and their cover.

    batches : number of such mixes, each with a cure; neighbouring magnets are glued one after another where no jig
        holds them (`gluing_order`).
    stays_mL, poured_mL, mix_mL : what stays in the parts, what is poured (the first pour fills B to its rim, and the
        pin of A drives the surplus out), and what is mixed, of one batch.
    mix_g, A_g, B_g : masses of the mix and of its parts; None where the ratio is unknown.
    """
    mold, silicone = choices.mold, choices.silicone or {}
    count, (layer, cover) = mold.cavities, pours(design, mold)
    mixes = [
        (
            "first: the beam round the pin",
            1,
            count * layer,
            count * beam_volume(design.shape) / (1 - mold.shrink) ** 3,
        )
    ]
    if design.shape.has_magnet:
        groups = gluing_order(design, mold)
        drops = max(map(len, groups)) * DROP
        mixes.append((f"glue of the magnet{'s' if count > 1 else ''}", len(groups), drops, drops))
    if cover > 0:
        mixes.append(("second: over the magnet", 1, count * cover, count * cover))
    ratio, density = RATIO.match(silicone.get("mixed", "")), silicone.get("density", design.density) / 1e6
    rows: list[FlatRow] = []
    for pour, batches, stays, poured in mixes:
        volume = (1 + WASTE) * poured + CUP
        A, B = parts_by_weight(density * volume, float(ratio[1]), float(ratio[2])) if ratio else (None, None)
        volumes = {"stays_mL": stays / 1e3, "poured_mL": poured / 1e3, "mix_mL": volume / 1e3}
        rows.append({"pour": pour, "batches": batches, **volumes, "mix_g": density * volume, "A_g": A, "B_g": B})
    return rows


def parts_by_weight(mass: float, a: float, b: float) -> tuple[float, float]:
    """Return the masses of two parts in the ratio a to b, g: at least `mass` together, in steps of the balance.

    >>> parts_by_weight(2.46, 10, 1)
    (2.3, 0.23)
    """
    smaller = math.ceil(mass * min(a, b) / (a + b) / BALANCE - 1e-9) * BALANCE
    return round(smaller * a / min(a, b), 2), round(smaller * b / min(a, b), 2)


def neighbours_push(design: Design, mold: Mold) -> FlatRow | None:
    """Return what the magnets of neighbouring cavities do to each other; None where all stay in their pockets.

    alike, opposite : whether two neighbours have the same pole up, and so repel, or differ, and attract.
    pair_N, pair_weights : force between the nearest two, and over a magnet's weight.
    net_N, net_percent : largest force of all others on one, and its pressure on the pocket's wall over the modulus.
    lift_N, lift_weights : largest force that lifts one while a neighbour comes down its bore, and over the weight.
    """
    s, apart = sizes(design, mold), magnet_field.resting_distance(design)
    if apart is None or s.pitch >= apart:
        return None
    pole, weight = mold.poles, magnet_field.weight(design)
    pairs = itertools.combinations(range(len(s.centres)), 2)
    near = [pole[i] * pole[j] for i, j in pairs if math.dist(s.centres[i], s.centres[j]) < 1.01 * s.pitch]
    array = ArrayDesign(design, np.array(s.centres), np.array(pole))
    net = _held_together(array)
    two = ArrayDesign(design, np.array([[0.0, 0.0], [s.pitch, 0.0]]), np.ones(2))
    beams, pair, lift = beam_arrays.of_array(model(design), two), _held_together(two), 0.0
    for height in np.linspace(0.0, 2 * s.pitch, 40):
        coming = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height]])
        pulled = beam_arrays.magnet_forces(beams, coming)[0][0, 2]
        lift = max(lift, *(float(sign * pulled) for sign in set(near)))
    face = design.magnet_diameter * design.magnet_height
    return {
        "alike": 1.0 in near,
        "opposite": -1.0 in near,
        "pair_N": pair,
        "pair_weights": pair / weight,
        "net_N": net,
        "net_percent": 100 * net / (face * design.E),
        "lift_N": lift,
        "lift_weights": lift / weight,
    }


def _held_together(array: ArrayDesign) -> float:
    """Return the largest force of the other magnets on one, all in place on the base, N."""
    beams = beam_arrays.of_array(model(array.design), array)
    return float(np.linalg.norm(beam_arrays.magnet_forces(beams, np.zeros((len(array), 3)))[0], axis=1).max())


def stands(array: ArrayDesign) -> bool:
    """Return whether the beams of an array hold their magnets apart."""
    return beam_arrays.rest(beam_arrays.of_array(model(array.design), array)).margin > 0


def gluing_order(design: Design, mold: Mold) -> list[list[int]]:
    """Return the cavities, counted from 1, whose magnets are glued in together, in their order.

    A jig holds all at once. Without one the magnets of a group are so far apart that they stay where they are put.
    """
    s, apart = sizes(design, mold), magnet_field.resting_distance(design) or 0.0
    if magnet_jig.planned(design, mold)[0]:
        apart = 0.0
    groups: list[list[int]] = []
    for k, centre in enumerate(s.centres, 1):
        free = (group for group in groups if all(math.dist(centre, s.centres[j - 1]) >= apart for j in group))
        if group := next(free, None):
            group.append(k)
        else:
            groups.append([k])
    return groups


def poles_up(design: Design, mold: Mold) -> list[str]:
    """Return the rows of cavities, seen from above into the mould, each with its beam and the pole that faces up.

    >>> from geometry.array_design import grid_array
    >>> poles_up(Design(), Mold(array=grid_array(Design(), 2, 2, 16.0, "checkerboard")))
    ['1 N   2 S', '3 S   4 N']
    """
    letters = ("N", "S") if design.magnet_north == "down" else ("S", "N")
    rows: dict[float, list[str]] = {}
    placed = [(-y, x, k) for k, (x, y) in enumerate(sizes(design, mold).centres)]
    for y, _, k in sorted(placed):
        rows.setdefault(y, []).append(f"{k + 1} {letters[mold.poles[k] < 0]}")
    return ["   ".join(row) for row in rows.values()]


PINS = {"VDD": "supply (+)", "GND": "ground", "OUT": "output"}
"""Words for the nets of a one-axis element."""
PINCH = 30.0
"""Force of two magnets that touch from which on they hurt a finger, N: some ten times that of a fridge magnet."""
MOVED = (0.5, 0.3, 0.2, 0.1)
"""Displacements of the magnet in the table of expected readings, mm: the first that leaves all parts in range."""


def expected_readings(design: Design) -> FlatRow:
    """Return what the elements read at rest, and with the magnet lower, and moved towards x and y.

    moved : by how much, mm, one of `MOVED`.
    unit : V, or mT of a chip. rows : name of an element and these four readings.
    saturated : names of the elements that are at an end of their range in one of them.
    per_gap, per_shift : change of the first element's field by 0.1 mm of height, and of the difference of the next
        two by 0.1 mm of the magnet towards x, percent of the first one at rest.
    """
    for moved in MOVED:
        poses = [(0.0, 0.0, 0.0), (0.0, 0.0, -moved), (moved, 0.0, 0.0), (0.0, moved, 0.0)]
        found = [hall.readings(design, shift=pose) for pose in (*poses, (0.0, 0.0, -0.1), (0.1, 0.0, 0.0))]
        if not any(any(each.saturated) for each in found[:4]):
            break
    names, units = element_names(design.hall_layout, int(design.chip_count))
    values = [list(each.output) if units == "V" else [1e3 * value for value in each.output] for each in found]
    rows = [(name, *(reading[k] for reading in values[:4])) for k, name in enumerate(names)]
    fields = [each.B_T for each in found]
    first = abs(fields[0][0])
    aside = abs((fields[5][1] - fields[5][2]) - (fields[0][1] - fields[0][2]))
    gap = 100 * abs(fields[4][0] - fields[0][0]) / first
    full = [name for k, name in enumerate(names) if any(each.saturated[k] for each in found[:4])]
    unit = "V" if units == "V" else "mT"
    shares = {"per_gap": gap, "per_shift": 100 * aside / first}
    return {"moved": moved, "unit": unit, "rows": rows, "saturated": full} | shares


def _holding_force(design: Design) -> float:
    if not design.shape.has_magnet:
        return 0.0
    return magnet_field.holding_force(design.magnet_diameter / 2, design.magnet_height, design.remanence)


def _turn(design: Design, plan: Plan | None) -> float | None:
    """Return by how much a chip turns in its pocket, degrees, where nothing else holds the board; None elsewhere."""
    if plan is None or plan.screw or design.hall_layout == "three" or design.chip_count > 1:
        return None
    (pocket,) = plan.seats.bodies.values()
    (a, b), (wide, deep, _) = design.chip.pads.size if design.chip.pads else (0.0, 0.0), pocket.sides
    a, b = max(a, design.chip.body[0]), max(b, design.chip.body[1])
    return math.degrees(min((wide - a) / b, (deep - b) / a))


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
    pictures: Sequence[str],
    command: str,
    gap: loaded_clearance.Gap | None = None,
    whole: ArrayPlan | None = None,
) -> str:
    """Return the README.md of one design, or of the array with the base `whole`; it names `command` as its origin."""
    mold, three = choices.mold, design.hall_layout == "three"
    recipe = fabricated["recipe"]
    page = page_templates.rendered(
        Path(__file__).with_name("CASTING.md.j2"),
        mark=MARK,
        d=design,
        m=mold,
        row=fabricated,
        recipe=recipe,
        plan=plan,
        thread=plan and screw_thread(plan.screw),
        room=loaded_clearance.room(gap),
        breakout=choices.base.breakout,
        size=size_sentence(fabricated),
        array=choices.array,
        whole=whole,
        cast_whole=mold.array is not None,
        castings=choices.array and math.ceil(len(choices.array) / mold.cavities),
        cavity=2 * sizes(design, mold).R,
        up="N" if design.magnet_north == "down" else "S",
        held=_held_together(choices.array) if choices.array and design.shape.has_magnet else 0.0,
        letters=bool(recipe["jig"]) and len(set(mold.poles)) > 1,
        rows=poles_up(design, mold) if len(set(mold.poles)) > 1 else [],
        groups=gluing_order(design, mold),
        spread=mold.array is not None and sizes(design, mold).pitch > mold.array.pitch + 1e-9,
        pitch=sizes(design, mold).pitch,
        wall=sizes(design, mold).wall,
        reversed_beams=[
            k for k, pole in enumerate(choices.array.poles.tolist() if choices.array else [], 1) if pole < 0
        ],
        pictures=pictures,
        command=command,
        cavities=mold.cavities,
        balance=BALANCE,
        degassing=DEGASSING,
        # the tip's first layer is cut at half its height
        flat=lambda layer: 2 * math.sqrt(layer * design.R - (layer / 2) ** 2),
        waste=WASTE,
        cup=CUP,
        margin=MARGIN,
        paper_cure=PAPER_CURE,
        check=expected_readings(design) if plan and design.shape.has_magnet else None,
        pushed=neighbours_push(design, mold) if design.shape.has_magnet else None,
        pin=next(iter(board_drawing.pads(design)), None),
        inside=plan and plan.thickness + places(design)["S1"][2] + SS495A.depth - SS495A.thickness if three else None,
        pull=pull if (pull := _holding_force(design)) > PINCH else None,
        turn=_turn(design, plan),
        screw_mm=plan and base_screw(plan),
        board_mm=BOARDS[0],
        pins=[PINS[net] for net in circuits()["three"].pins],
        pins_assumed="pins" in circuits()["three"].assumed,
    )
    return f"{page}\n"
