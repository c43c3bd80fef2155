"""Breakout boards that makers own: places of their chip, screw holes and parts, and the hollows that the base needs.

A breakout board is screwed under the base with its chip in the chip's pocket. What else stands on this face gets a
hollow; one that would leave too little of the base above it is a window. All lengths are in mm.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geometry.arrays import Point
from geometry.bad_input import nearest
from geometry.design import BadInput, Design
from geometry.fabrication.hall_elements import WEB, Block, chip_centres

ROOM = 0.1
"""Gap around a part of the board, whose box holds its pads too."""

PLUG = 30.0
"""Length of the way for a plug, which ends outside of every base."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Breakout:
    """A breakout board: a table of `breakout_boards.toml`, which says what its fields are."""

    layouts: list[str]
    size: list[float]
    chip: list[float]
    turn: float
    hole: float
    holes: list[list[float]]
    parts: list[dict[str, Any]]
    source: str
    assumed: list[str]

    def placed(self, at: list[float], centre: Point) -> Point:
        """Return x and y in the sensor's frame of a place on the board, whose chip lies at `centre`."""
        x, y = at[0] - self.chip[0], at[1] - self.chip[1]
        cos, sin = round(math.cos(math.radians(self.turn))), round(math.sin(math.radians(self.turn)))
        return centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y


BREAKOUTS = {
    name: Breakout(**table)
    for name, table in tomllib.loads(Path(__file__).with_name("breakout_boards.toml").read_text("utf-8")).items()
}
"""The boards by their names."""


def breakout(name: str, design: Design) -> tuple[Breakout, Point]:
    """Return a board for the chip of a design, and where that chip lies; BadInput if it is not for this chip."""
    if name not in BREAKOUTS:
        raise BadInput(f"there is no breakout {name!r}: {nearest(str(name), BREAKOUTS)}")
    board = BREAKOUTS[name]
    if design.hall_layout not in board.layouts or design.chip_count > 1:
        raise BadInput(
            f"breakout {name} holds one {board.layouts[0]}; the design has {design.chip_count:g} x "
            f"{design.hall_layout}: set hall_layout and chip_count, or leave the breakout out"
        )
    return board, next(iter(chip_centres(design).values()))


def hollows(board: Breakout, centre: Point, thickness: float, top: float, foot: float) -> tuple[Block, ...]:
    """Return the hollows of the base above the board's parts, open below; those with too thin a roof are windows.

    Parameters
    ----------
    thickness, top : of the base below the base plane, and height of its upper face.
    foot : radius of the beam, or of its recess, under which no window may lie.

    Raises
    ------
    BadInput
        A window would lie under the beam.
    """
    boxes, window = [], thickness + top + WEB
    for part in board.parts:
        corners = [board.placed(corner, centre) for corner in (part["box"][:2], part["box"][2:])]
        (left, right), (low, high) = (sorted(ends) for ends in zip(*corners, strict=True))
        height = part["height"] + ROOM
        sides = right - left + 2 * ROOM, high - low + 2 * ROOM, height if thickness - height >= WEB else window
        box = Block((left - ROOM, low - ROOM, -thickness), sides)
        boxes.append(_outwards(box) if part.get("plug") else box)
    opened = [box for box in boxes if box.sides[2] == window]
    while opened:
        # a roof that ends at a window would hang free: it opens too, and so does the next one
        edge = opened.pop()
        for k, box in enumerate(boxes):
            if box.sides[2] < window and box.meets(edge, 0.0):
                boxes[k] = dataclasses.replace(box, sides=(*box.sides[:2], window))
                opened.append(boxes[k])
    for part, box in zip(board.parts, boxes, strict=True):
        if box.sides[2] == window:
            _check_window(part["name"], box, foot)
    return tuple(boxes)


def _outwards(box: Block) -> Block:
    """Return a hollow that runs out of the base on the side that is nearest, for the plug of a cable."""
    (x, y, z), (length, width, tall) = box.corner, box.sides
    if abs(x + length / 2) > abs(y + width / 2):
        return Block((x if x > 0 else x - PLUG, y, z), (length + PLUG, width, tall))
    return Block((x, y if y > 0 else y - PLUG, z), (length, width + PLUG, tall))


def _check_window(name: str, box: Block, foot: float) -> None:
    (x, y, _), (length, width, _) = box.corner, box.sides
    near = math.hypot(max(x, -x - length, 0.0), max(y, -y - width, 0.0))
    if not near >= foot:
        raise BadInput(
            f"l0 must be larger, or the base opens under the beam above {name} of the breakout; or take a beam whose "
            f"foot is at most {2 * near:.3g} mm wide"
        )
