"""The schematic of a circuit board, in the S-expressions of KiCad 6 (20211123), which later versions read.

Each part is a box with its pins, and each pin ends in a label with the name of its net: that is the netlist of the
board, whose footprints name the symbols here. All pins are passive, so that the check of electrical rules needs no
sources of power; what matters is that every pin has its net, or a cross where it stays open.
"""

from __future__ import annotations

import json
import math
import uuid
from collections.abc import Iterator, Sequence
from typing import Any

from studies.fabrication.board_layers import Board, Pad, Part

GRID, LENGTH, HALF = 2.54, 5.08, 7.62
"""Distance of neighbouring pins, length of a pin, and half the width of a box, mm: KiCad's grid is 1.27 mm."""
COLUMNS = {"U": 63.5, "S": 63.5, "C": 139.7, "R": 139.7, "J": 215.9}
"""Place along x of the parts by the first letter of their names, mm."""
TOP, GAP = 38.1, 5.08
"""Place along y of the highest part, and gap between neighbours, mm."""
FONT = ["effects", ["font", ["size", 1.27, 1.27]]]
HIDDEN = [*FONT, "hide"]
Expression = Sequence[Any]


def schematic(made: Board, title: str) -> str:
    """Return the text of the schematic's file (.kicad_sch)."""
    places = dict(_places(made.parts))
    comments = [f"supply {made.supply[0]:g} to {made.supply[1]:g} V"]
    comments += [f"I2C addresses {', '.join(dict.fromkeys(made.addresses))}"] if made.addresses else []
    words = (["comment", number, quoted(comment)] for number, comment in enumerate(comments, 1))
    heading = ["title_block", ["title", quoted(title)], *words]
    body: list[Expression] = [
        ["version", 20211123],
        ["generator", "magtip"],
        ["uuid", identity("schematic", title)],
        ["paper", *_paper(made.parts)],
        heading,
        ["lib_symbols", *(_symbol(part) for part in made.parts)],
    ]
    for part in made.parts:
        at = places[part.reference]
        body += [_end(part, pad, _pin(part, pad, at)) for pad in part.pads]
        body.append(_instance(part, at))
    body.append(["sheet_instances", ["path", '"/"', ["page", '"1"']]])
    body.append(["symbol_instances", *(_listed(part) for part in made.parts)])
    return text_of(["kicad_sch", *body]) + "\n"


def _paper(parts: Sequence[Part]) -> list[str | float]:
    """Return the size of the sheet: A4, or as high as the columns of many parts."""
    lowest = max(y + _high(next(part for part in parts if part.reference == name)) for name, (_, y) in _places(parts))
    return ['"A4"'] if lowest + TOP <= 210 else ['"User"', 297.0, math.ceil(lowest + TOP)]


def path_of(part: Part) -> str:
    """Return the path of a part's symbol, by which the board's footprint finds it."""
    return f"/{identity('symbol', part.reference)}"


def footprint_of(part: Part) -> str:
    return f"magtip:{part.package}"


# Symbols


def _rows(part: Part) -> int:
    return (len(part.pads) + 1) // 2


def _high(part: Part) -> float:
    """Return half the height of a part's box, a multiple of KiCad's grid of 1.27 mm."""
    return GRID * (_rows(part) + 1) / 2


def _places(parts: Sequence[Part]) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the middle of each part's box on the sheet, whose y points downwards, mm."""
    below = dict.fromkeys(COLUMNS.values(), TOP)
    for part in parts:
        x, high = COLUMNS[part.reference[0]], _high(part)
        yield part.reference, (x, below[x] + high)
        below[x] += 2 * high + GAP


def _local(part: Part, pad: Pad) -> tuple[float, float, int]:
    """Return the end of a pin in the frame of its symbol, y upwards, and its angle: pins 1 and on at the left from
    above, the others at the right from below, as on a package with two rows."""
    k, rows = [each.number for each in part.pads].index(pad.number), _rows(part)
    left = k < rows
    row = k if left else len(part.pads) - 1 - k
    return (-HALF - LENGTH if left else HALF + LENGTH), GRID * ((rows - 1) / 2 - row), 0 if left else 180


def _pin(part: Part, pad: Pad, at: tuple[float, float]) -> tuple[float, float, bool]:
    """Return the end of a pin on the sheet, and whether it is at the left."""
    x, y, angle = _local(part, pad)
    return at[0] + x, at[1] - y, angle == 0


def _symbol(part: Part) -> Expression:
    name, high = f"magtip:{part.reference}", _high(part)
    box = ["rectangle", ["start", -HALF, high], ["end", HALF, -high]]
    pen = ["stroke", ["width", 0.254], ["type", "default"], ["color", 0, 0, 0, 0]], ["fill", ["type", "background"]]
    pins = [
        ["pin", "passive", "line", ["at", *_local(part, pad)], ["length", LENGTH], *_named(pad)] for pad in part.pads
    ]
    return [
        "symbol",
        quoted(name),
        ["in_bom", "yes"],
        ["on_board", "yes"],
        *_properties(part, (0.0, 0.0)),
        ["symbol", quoted(f"{part.reference}_0_1"), [*box, *pen]],
        ["symbol", quoted(f"{part.reference}_1_1"), *pins],
    ]


def _named(pad: Pad) -> tuple[Expression, Expression]:
    return ["name", quoted(pad.net or "~"), FONT], ["number", quoted(pad.number), FONT]


def _properties(part: Part, at: tuple[float, float]) -> Iterator[Expression]:
    """Yield the fields of a part, about its place on the sheet or in its symbol."""
    x, y = at
    high = _high(part) + 1.27
    # a symbol's y points upwards, that of the sheet downwards
    up = -1.0 if y else 1.0
    values = (
        ("Reference", part.reference, high * up, FONT),
        ("Value", part.value, -high * up, FONT),
        ("Footprint", footprint_of(part), 0.0, HIDDEN),
        ("Datasheet", "", 0.0, HIDDEN),
    )
    for number, (name, value, away, effects) in enumerate(values):
        yield ["property", quoted(name), quoted(value), ["id", number], ["at", x, y + away, 0], effects]


def _instance(part: Part, at: tuple[float, float]) -> Expression:
    return [
        "symbol",
        ["lib_id", quoted(f"magtip:{part.reference}")],
        ["at", *at, 0],
        ["unit", 1],
        ["in_bom", "yes"],
        ["on_board", "yes"],
        ["uuid", path_of(part)[1:]],
        *_properties(part, at),
        *(["pin", quoted(pad.number), ["uuid", identity("pin", part.reference, pad.number)]] for pad in part.pads),
    ]


def _end(part: Part, pad: Pad, end: tuple[float, float, bool]) -> Expression:
    """Return the label of a pin's net, or the cross of an open one."""
    x, y, left = end
    mark = ["uuid", identity("end", part.reference, pad.number)]
    if not pad.net:
        return ["no_connect", ["at", x, y], mark]
    side = ["justify", "right" if left else "left"]
    at = ["at", x, y, 180 if left else 0]
    return ["global_label", quoted(pad.net), ["shape", "passive"], at, [*FONT, side], mark]


def _listed(part: Part) -> Expression:
    values = ("reference", part.reference), ("value", part.value), ("footprint", footprint_of(part))
    (reference, *others) = ([name, quoted(value)] for name, value in values)
    return ["path", quoted(path_of(part)), reference, ["unit", 1], *others]


# S-expressions


def quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def identity(*what: object) -> str:
    """Return the identity of a thing, which is the same in each run."""
    return str(uuid.uuid5(uuid.NAMESPACE_OID, repr(what)))


def text_of(expression: Expression, depth: int = 0) -> str:
    """Return an S-expression; a number has six digits behind the point at most."""
    parts = []
    for each in expression:
        if isinstance(each, (list, tuple)):
            parts.append(("\n" + "  " * (depth + 1) if depth < 2 else "") + text_of(each, depth + 1))
        else:
            number = f"{each:.6f}".rstrip("0").rstrip(".") if isinstance(each, float) else str(each)
            parts.append("0" if number == "-0" else number)
    return f"({' '.join(parts)})".replace(" \n", "\n")
