"""Labels with leader lines, and coordinate axes, in the white space around a picture's subject. Pixels, y down."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Point = tuple[float, float]
Mask = NDArray[np.bool_]
INK = "#111111"
SIZE = 26
"""Font size, pixels."""
PAD = 8
"""White margin around a label, pixels."""
STEP = 6
"""Distance between the places that are tried along a direction, pixels."""
DIRECTIONS = 24
"""Number of directions that are tried for a leader line."""
ARROW = 70
"""Length of an axis that lies in the picture's plane, pixels."""
LEAST_ARROW = 12
"""Length of the arrow's head, and least length of an axis that gets one, pixels."""


def annotate(image: Image.Image, names: Mapping[str, Point], axes: Mapping[str, Point]) -> None:
    """Draw labels and axes into a picture.

    Parameters
    ----------
    names : label and the point at which its leader line ends.
    axes : name of each axis and its direction in the picture, of length 1 if it lies in the picture's plane.
    """
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(SIZE)
    taken = np.asarray(image.convert("L")) < 255
    rows, columns = np.flatnonzero(taken.any(axis=1)), np.flatnonzero(taken.any(axis=0))
    subject = (columns[0], rows[0], columns[-1], rows[-1]) if len(rows) else (0, 0, *taken.shape[::-1])
    for name, tip in names.items():
        left, top, right, low = draw.textbbox((0, 0), name, font=font)
        place = free_place(taken, tip, (right - left + 2 * PAD, low - top + 2 * PAD))
        if place is None:
            continue
        wide, high = (right - left) / 2 + PAD, (low - top) / 2 + PAD
        _leader(draw, tip, place, wide, high)
        draw.text(place, name, fill=INK, font=font, anchor="mm")
        x, y = place
        taken[max(int(y - high), 0) : int(y + high) + 1, max(int(x - wide), 0) : int(x + wide) + 1] = True
    corner = _corner(taken, subject)
    for name, (x, y) in axes.items():
        end = (corner[0] + ARROW * x, corner[1] + ARROW * y)
        _arrow(draw, corner, end)
        size = math.hypot(x, y) or 1.0
        draw.text((end[0] + SIZE * 0.7 * x / size, end[1] + SIZE * 0.7 * y / size), name, INK, font, anchor="mm")


def free_place(taken: Mask, tip: Point, size: tuple[float, float]) -> Point | None:
    """Return the centre of the free box nearest to the tip, or None if no box is free.

    The box has the size (width, height). Its centre lies in one of `DIRECTIONS` from the tip.

    >>> taken = np.zeros((100, 200), dtype=bool)
    >>> taken[20:80, :120] = True
    >>> free_place(taken, (100.0, 50.0), (20, 10))
    (130.0, 50.0)
    """
    high, wide = taken.shape
    half_x, half_y = size[0] / 2, size[1] / 2
    for distance in range(STEP, wide + high, STEP):
        for direction in range(DIRECTIONS):
            angle = 2 * math.pi * direction / DIRECTIONS
            x, y = tip[0] + distance * math.cos(angle), tip[1] + distance * math.sin(angle)
            if not (half_x <= x <= wide - half_x and half_y <= y <= high - half_y):
                continue
            if not taken[int(y - half_y) : int(y + half_y) + 1, int(x - half_x) : int(x + half_x) + 1].any():
                return x, y
    return None


def _leader(draw: ImageDraw.ImageDraw, tip: Point, place: Point, half_x: float, half_y: float) -> None:
    """Draw a line from a dot at the tip to the border of the label; a white rim makes it visible on dark parts."""
    x, y = place[0] - tip[0], place[1] - tip[1]
    share = 1 - min(half_x / abs(x) if x else math.inf, half_y / abs(y) if y else math.inf)
    end = (tip[0] + share * x, tip[1] + share * y)
    for colour, width, dot in (("white", 6, 7), (INK, 2, 5)):
        draw.line([tip, end], fill=colour, width=width)
        draw.ellipse([tip[0] - dot, tip[1] - dot, tip[0] + dot, tip[1] + dot], fill=colour)


def _arrow(draw: ImageDraw.ImageDraw, start: Point, end: Point) -> None:
    draw.line([start, end], fill=INK, width=2)
    x, y = end[0] - start[0], end[1] - start[1]
    length = math.hypot(x, y)
    # an axis that points almost at the viewer has no head
    if length < LEAST_ARROW:
        return
    x, y = x / length, y / length
    back = (end[0] - LEAST_ARROW * x, end[1] - LEAST_ARROW * y)
    sides = [(back[0] + s * 5 * y, back[1] - s * 5 * x) for s in (-1, 1)]
    draw.polygon([end, *sides], fill=INK)


def _corner(taken: Mask, subject: Sequence[int]) -> Point:
    """Return the origin of the axes: in a free corner of the subject's box, else at the picture's lower left."""
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
