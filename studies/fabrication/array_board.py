"""The circuit board under the base of an array: chips at the places of all beams, and their buses.

Chips of one address each share a bus. Where there are more chips than addresses, a switch (TCA9548A) on the tab gives
each group of them a bus of its own; at one time one channel is on, and chips of all groups have the same addresses.
Each chip has its capacitor and its vias as on a board of its own; from there tracks are searched
(`studies.fabrication.track_router`). All lengths are mm in the frame of the array's places, seen from above.
"""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from geometry import base
from geometry.array_design import ArrayDesign
from geometry.base import BOARDS, ArrayPlan, Base
from geometry.design import BadInput, Design
from geometry.fabrication.hall_elements import chip_centres
from geometry.hall_chips import Pads
from studies.fabrication import board_layers, circuit_board
from studies.fabrication.board_layers import EDGE, Board, NoRoom, Pad, Part, Terminal, Track, Via
from studies.fabrication.circuit_board import CAPACITOR, PULL_UP, Circuit, Header, passive

SWITCH: dict[str, Any] = tomllib.loads((Path(__file__).parents[1] / "parts" / "bus_switch.toml").read_text("utf-8"))
"""The switch between buses: see the file."""
TAB, ROW = 20.0, 3.2
"""Length of the tab with a switch, and distance along y of the rows of capacitors and resistors below the switch."""
TABS = ((28.0, 2.2), (36.0, 2.8))
"""Widths of such a tab and distances of its parts along x; the second is tried where the first leaves no way."""

FARTHER = 1.5
"""A board without room is tried at a pitch so many times larger."""

Wire = TypeVar("Wire", Track, Via, Pad)


def board(whole: ArrayPlan, thickness: float = BOARDS[0]) -> Board:
    """Return the board of an array, with ground and silkscreen.

    Raises
    ------
    BadInput
        The thickness, a missing footprint, more chips than addresses on all buses, or no room for parts or tracks.
    """
    circuit_board.check_thickness(thickness)
    try:
        return circuit_board.finished(wired(whole, thickness))
    except NoRoom as error:
        count, remedies = len(whole.array), _remedies(whole)
        raise BadInput(f"the board of {count} beams has no room, {error}: {remedies}") from None


def _remedies(whole: ArrayPlan) -> str:
    """Return what gives room, as far as a board at `FARTHER` times the pitch tells."""
    array, several = whole.array, whole.array.design.chip_count > 1
    pitch = math.ceil(2 * FARTHER * array.pitch) / 2
    fewer = "fewer beams or chips" if several else "fewer beams"
    try:
        apart = dataclasses.replace(array, places=array.places * pitch / array.pitch)
        circuit_board.finished(wired(base.plan_under(apart, whole.one)))
    except BadInput:
        base_or_chips = "another chip_x, a larger base" if several else "a larger base"
        return f"a pitch of {pitch:g} mm has none either, so take {base_or_chips} (--base outer=...), or {fewer}"
    return f"take a larger pitch ({pitch:g} mm has room), or {fewer}"


def refusal(design: Design, array: ArrayDesign | None, choices: Base, process: str) -> str:
    """Return why a design, or an array of it, has no board, as far as is known before tracks are searched; "" if it
    may have one."""
    try:
        if array:
            placed(base.array_plan(array, choices, process))
        else:
            circuit_board.wired(design, base.plan(design, choices, process))
    except BadInput as error:
        return str(error)
    return ""


def wired(whole: ArrayPlan, thickness: float = BOARDS[0]) -> Board:
    """Return the board of an array without ground and silkscreen; BadInput as `board`."""
    from studies.fabrication import track_router

    for tab in TABS:
        made, ends = placed(whole, thickness, tab)
        try:
            tracks, vias = track_router.routed(made, ends)
        except NoRoom:
            if tab == TABS[-1] or not made.channels:
                raise
        else:
            break
    found = (*made.tracks, *tracks)
    # a net that runs on one face alone needs no hole at its chip
    made = dataclasses.replace(made, tracks=found, vias=(*(via for via in made.vias if _joins(via, found)), *vias))
    board_layers.check_rules(made)
    return made


@dataclass(slots=True)
class Laid:
    """Parts with the tracks and vias that they bring along, and what is still to be joined."""

    parts: list[Part] = field(default_factory=list)
    tracks: list[Track] = field(default_factory=list)
    vias: list[Via] = field(default_factory=list)
    ends: list[Terminal] = field(default_factory=list)


def _joins(via: Via, tracks: Sequence[Track]) -> bool:
    """Return whether a via joins tracks of both faces; ground is on both."""
    import shapely

    at = shapely.Point(via.at)
    near = {
        each.below for each in tracks if each.net == via.net and at.distance(shapely.LineString(each.points)) < 1e-3
    }
    return via.net == "GND" or len(near) == 2


def placed(
    whole: ArrayPlan, thickness: float = BOARDS[0], size: tuple[float, float] = TABS[0]
) -> tuple[Board, list[Terminal]]:
    """Return the board of an array with each chip's own tracks, and what is to be joined; BadInput as `board`.

    size : one of `TABS`.
    """
    design = whole.array.design
    circuit = circuit_board.circuit_of(design)
    share, count = len(circuit.addresses), len(whole.array) * int(design.chip_count)
    if not count <= (most := SWITCH["channels"] * share):
        fewer = "fewer beams or chips" if design.chip_count > 1 else "fewer beams"
        raise BadInput(
            f"{count} chips {design.hall_layout} are more than {SWITCH['channels']} buses of {share} addresses hold, "
            f"{most}: take {fewer}{circuit.remedy and f', or {circuit.remedy}'}"
        )
    buses = math.ceil(count / share)
    supplies = circuit_board.supplies(circuit, min(share, count))
    laid = _chips(whole, circuit, supplies, buses)
    first, *others = reversed(dict.fromkeys(supplies))
    header, tab = _header(whole, ("GND", first, "SDA", "SCL", *others), size[0] if buses > 1 else 0.0)
    laid.ends += [Terminal(net, (header.x(net), header.y)) for net in header.nets if net != "GND"]
    if buses > 1:
        _add_switch(laid, f"U{count + 1}", header, (tab[2] - tab[0], size[1]), buses)
    else:
        parts, tracks = circuit_board.pull_ups(header, first)
        laid.parts, laid.tracks = laid.parts + parts, laid.tracks + tracks
    low, high = SWITCH["supply"] if buses > 1 else circuit.supply
    made = circuit_board.unchecked(
        thickness,
        circuit_board.rectangle(whole.box, tab),
        whole.one,
        whole.array.places.tolist(),
        whole.screws,
        header,
        laid.parts,
        tracks=tuple(laid.tracks),
        vias=tuple(dict.fromkeys(laid.vias)),
        addresses=tuple(circuit.addresses[k % share] for k in range(count)),
        channels=tuple(k // share for k in range(count)) if buses > 1 else (),
        supply=(max(circuit.supply[0], low), min(circuit.supply[1], high)),
        warnings=tuple(circuit_board.assumptions(design, circuit)),
    )
    board_layers.check_rules(made)
    return made, laid.ends


def _chips(whole: ArrayPlan, circuit: Circuit, supplies: Sequence[str], buses: int) -> Laid:
    """Return the chips of all beams with their capacitors; those of one bus follow each other."""
    design, laid = whole.array.design, Laid()
    pads = design.chip.pads
    assert pads is not None
    places = [(x + u, y + v) for x, y in whole.array.places.tolist() for u, v in chip_centres(design).values()]
    for k, at in enumerate(places):
        bus, turn = divmod(k, len(circuit.addresses))
        names = {"SDA": f"SD{bus}", "SCL": f"SC{bus}"} if buses > 1 else {}
        part = circuit_board.chip_part(design, circuit, supplies[turn], turn, f"U{k + 1}", at)
        local = circuit_board.wired_chip(part, supplies[turn], pads, math.inf)
        on_bus = tuple(_renamed(pad, names) for pad in part.pads)
        laid.parts += [dataclasses.replace(part, pads=on_bus), local.capacitor]
        laid.tracks += [_renamed(track, names) for track in local.tracks]
        laid.vias += [_renamed(via, names) for via in local.vias]
        laid.vias += [Via(names.get(net, net), end) for net, end in local.ends.items()]
        laid.ends += [Terminal(names.get(net, net), end) for net, end in local.ends.items()]
    return laid


def _renamed(thing: Wire, names: Mapping[str, str]) -> Wire:
    return dataclasses.replace(thing, net=names.get(thing.net, thing.net))


def _header(whole: ArrayPlan, nets: Sequence[str], wanted: float) -> tuple[Header, tuple[float, float, float]]:
    """Return the header on the tab in the middle of the base's edge, and left, low and right of the tab.

    wanted : width of the tab with a switch, where the base is as wide, mm; 0 without a switch.
    """
    west, south, east, _ = whole.box
    middle, low = (west + east) / 2, south - (TAB if wanted else circuit_board.TAB)
    for pitch in (2.54, 1.27):
        header = Header(tuple(nets), pitch, middle, south, low)
        wide = max(header.width, min(wanted, east - west))
        if wide <= east - west:
            return header, (middle - wide / 2, low, middle + wide / 2)
    raise NoRoom(f"a base of {east - west:.3g} mm is too narrow for a header of {len(nets)} pins")


def _add_switch(laid: Laid, name: str, header: Header, size: tuple[float, float], buses: int) -> None:
    """Add the switch, its capacitor and all pull-ups to a tab; its grounded pins are joined in its middle.

    size : width of the tab, and distance of the parts along x, mm.

    Channels 0 to 3 face the array, SDA and SCL the header.
    """
    pads, (long, deep), supply = Pads(**SWITCH["pads"]), SWITCH["body"], header.nets[1]
    used = [f"S{line}{bus}" for bus in range(buses) for line in "DC"]
    # room for tracks above and below the switch, in equal parts
    x, y = header.middle, (header.high + header.y) / 2 + 0.5
    words = {f"A{k}": "GND" for k in range(3)} | {"VDD": supply}
    words |= {net: "" for net in SWITCH["pins"] if re.fullmatch(r"S[DC]\d", net) and net not in used}
    placed = tuple(
        Pad(str(k), words.get(net, net), (x - u, y - v), (a, b))
        for k, (net, (u, v, a, b)) in enumerate(zip(SWITCH["pins"], pads.boxes(), strict=True), 1)
    )
    body = (x - long / 2, y - deep / 2, x + long / 2, y + deep / 2, SWITCH["height"])
    order = SWITCH["order"]
    parts = [Part(name, order, SWITCH["package"], (x, y), 270.0, False, placed, body, order)]
    laid.tracks += [Track("GND", False, (pad.at, (pad.at[0], y), (x, y))) for pad in placed if pad.net == "GND"]
    laid.vias.append(Via("GND", (x, y)))
    values = [(f"C{name[1:]}", CAPACITOR, "GND")]
    values += [(f"R{k}", PULL_UP, net) for k, net in enumerate(("RESET", "SDA", "SCL", *used), 1)]
    columns = int((size[0] - 2 * (EDGE + 0.7)) / size[1]) + 1
    rows = [values[k : k + columns] for k in range(0, len(values), columns)]
    for row, group in enumerate(rows):
        for column, (reference, value, net) in enumerate(group):
            at = x + (column - (len(group) - 1) / 2) * size[1], y + ROW * (0.5 - row)
            parts.append(passive(reference, value, (supply, net), at, upright=True))
    laid.parts += parts
    laid.ends += [
        Terminal(pad.net, pad.at, (not part.below, part.below))
        for part in parts
        for pad in part.pads
        if pad.net not in ("", "GND")
    ]
