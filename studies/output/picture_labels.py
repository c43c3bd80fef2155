"""Names with leader lines, and the frame's axes, drawn into the white around a picture's subject. Pixels, y down."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image
    from PIL.ImageDraw import ImageDraw

Point = tuple[float, float]
Mask = NDArray[np.bool_]

INK = "#111111"
SIZE = 26
"""Height of letters."""
PAD = 8
"""White around a name."""
STEP = 6
"""Between the places along a line where a name is tried."""
WAYS = 24
"""Directions in which a leader line may leave."""
ARROW = 70
"""Length of an axis that lies in the picture's plane."""


def annotate(image: Image.Image, names: Mapping[str, Point], axes: Mapping[str, Point]) -> None:
    """Draw names and axes into a picture.

    Parameters
    ----------
    names : the point that each name's leader line ends at.
    axes : direction of each axis in the picture, as long as 1 where it lies in its plane.
    """
    from PIL import ImageDraw, ImageFont

    draw, font = ImageDraw.Draw(image), ImageFont.load_default(SIZE)
    taken = np.asarray(image.convert("L")) < 255
    subject = _box_of(taken)
    for name, tip in names.items():
        left, top, right, low = draw.textbbox((0, 0), name, font=font)
        place = free_place(taken, tip, (right - left + 2 * PAD, low - top + 2 * PAD))
        if place is None:
            continue
        _leader(draw, tip, place, (right - left) / 2 + PAD, (low - top) / 2 + PAD)
        draw.text(place, name, fill=INK, font=font, anchor="mm")
        _take(taken, place, (right - left) / 2 + PAD, (low - top) / 2 + PAD)
    corner = _corner(taken, subject)
    for name, (x, y) in axes.items():
        end = (corner[0] + ARROW * x, corner[1] + ARROW * y)
        _arrow(draw, corner, end)
        size = math.hypot(x, y) or 1.0
        draw.text((end[0] + SIZE * 0.7 * x / size, end[1] + SIZE * 0.7 * y / size), name, INK, font, anchor="mm")


def free_place(taken: Mask, tip: Point, size: tuple[float, float]) -> Point | None:
    """Centre of the nearest box of a size (width, height) that is free, on a line from the tip; None for none.

    >>> taken = np.zeros((100, 200), dtype=bool)
    >>> taken[20:80, :120] = True
    >>> free_place(taken, (100.0, 50.0), (20, 10))
    (130.0, 50.0)
    """
    high, wide = taken.shape
    half_x, half_y = size[0] / 2, size[1] / 2
    for distance in range(STEP, wide + high, STEP):
        for way in range(WAYS):
            angle = 2 * math.pi * way / WAYS
            x, y = tip[0] + distance * math.cos(angle), tip[1] + distance * math.sin(angle)
            if not (half_x <= x <= wide - half_x and half_y <= y <= high - half_y):
                continue
            if not taken[int(y - half_y) : int(y + half_y) + 1, int(x - half_x) : int(x + half_x) + 1].any():
                return x, y
    return None


def _leader(draw: ImageDraw, tip: Point, place: Point, half_x: float, half_y: float) -> None:
    """A line from a dot at the tip to the border of the name's box; white beside it, to be seen on dark bodies."""
    x, y = place[0] - tip[0], place[1] - tip[1]
    share = 1 - min(half_x / abs(x) if x else math.inf, half_y / abs(y) if y else math.inf)
    end = (tip[0] + share * x, tip[1] + share * y)
    for colour, width, dot in (("white", 6, 7), (INK, 2, 5)):
        draw.line([tip, end], fill=colour, width=width)
        draw.ellipse([tip[0] - dot, tip[1] - dot, tip[0] + dot, tip[1] + dot], fill=colour)


def _arrow(draw: ImageDraw, start: Point, end: Point) -> None:
    draw.line([start, end], fill=INK, width=2)
    x, y = end[0] - start[0], end[1] - start[1]
    length = math.hypot(x, y)
    # an axis that points at the eye has no head
    if length < 12:
        return
    x, y = x / length, y / length
    sides = [(end[0] - 12 * x + s * 5 * y, end[1] - 12 * y - s * 5 * x) for s in (-1, 1)]
    draw.polygon([end, *sides], fill=INK)


def _take(taken: Mask, place: Point, half_x: float, half_y: float) -> None:
    x, y = place
    taken[max(int(y - half_y), 0) : int(y + half_y) + 1, max(int(x - half_x), 0) : int(x + half_x) + 1] = True


def _box_of(taken: Mask) -> Sequence[int]:
    """Left, top, right and low end of what is drawn."""
    rows, columns = np.flatnonzero(taken.any(axis=1)), np.flatnonzero(taken.any(axis=0))
    high, wide = taken.shape
    return (columns[0], rows[0], columns[-1], rows[-1]) if len(rows) else (0, 0, wide, high)


def _corner(taken: Mask, subject: Sequence[int]) -> Point:
    """Origin of the axes: in a free corner of what is drawn, else in the picture's lower left corner."""
    reach = ARROW + SIZE
    left, top, right, low = subject
    for x, y in ((left, low), (right, low), (left, top), (right, top)):
        centre = (x + reach if x == left else x - reach, y - reach if y == low else y + reach)
        part: Any = taken[
            max(centre[1] - reach, 0) : centre[1] + reach, max(centre[0] - reach, 0) : centre[0] + reach
        ]
        if not part.any():
            return float(centre[0]), float(centre[1])
    return float(reach), float(taken.shape[0] - reach)
