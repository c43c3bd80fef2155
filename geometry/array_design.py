"""Arrays of equal sensors on one base: where the beams stand, and which way up their magnets lie.

Beams are counted from 1, row by row: along x in a row, rows along y, about the middle of the array. Lengths in mm.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from geometry.bad_input import closest
from geometry.design import POLES, BadInput, Design

POLARITIES = ("up", "checkerboard", "rows")
"""All magnets alike; every other one reversed, along rows and columns; every other row reversed."""
WIDEST = 1000.0
"""Largest width of an array along x or y, mm: one plate and one board lie below all beams."""


@dataclass(frozen=True, slots=True, eq=False)
class ArrayDesign:
    """Equal beams, each with the elements of the design below it, which read as one sensor.

    Attributes
    ----------
    places : of the beams' axes, shape (n, 2), mm.
    poles : 1, or -1 for a magnet that lies the other way up than the design's, shape (n,).

    Raises
    ------
    BadInput
        There are fewer than two beams, two overlap, or the array is wider than `WIDEST`.
    """

    design: Design
    places: Array
    poles: Array

    def __post_init__(self) -> None:
        if not len(self.places) >= 2:
            raise BadInput(f"an array has two beams or more; got {len(self.places)} place: give more places")
        width = float(np.ptp(self.places, axis=0).max())
        if not width <= WIDEST:
            raise BadInput(
                f"an array may be {WIDEST:g} mm wide from its first to its last beam; got {width:g} mm: take a "
                "smaller pitch, fewer beams or nearer places"
            )
        if not self.pitch > self.design.D:
            first, second = list(itertools.combinations(range(1, len(self) + 1), 2))[int(self._distances.argmin())]
            raise BadInput(
                f"places {first} and {second} are {self.pitch:g} mm apart: beams overlap, so set them more "
                f"than D = {self.design.D:g} mm apart"
            )

    def __len__(self) -> int:
        return len(self.places)

    def of_beam(self, k: int) -> Design:
        """Return the design of a beam, counted from 0, whose magnet lies as it does in the array.

        >>> pair = grid_array(Design(), 1, 2, 20.0, "checkerboard")
        >>> [pair.of_beam(k).magnet_north for k in (0, 1)]
        ['down', 'up']
        """
        if self.poles[k] > 0:
            return self.design
        return replace(self.design, magnet_north=next(way for way in POLES if way != self.design.magnet_north))

    @property
    def pitch(self) -> float:
        """The least distance of two beams, mm."""
        return float(self._distances.min())

    @property
    def _distances(self) -> Array:
        """Of beams 1 and 2, 1 and 3, and so on, mm."""
        apart = np.linalg.norm(self.places[:, None] - self.places, axis=-1)
        return np.asarray(apart[np.triu_indices(len(self), 1)])


def grid_array(
    design: Design, rows: int, columns: int, pitch: float, polarity: str | Sequence[str] = "up"
) -> ArrayDesign:
    """Return a square grid of a design.

    Raises
    ------
    BadInput
        As for `ArrayDesign`, or the list of polarities has another length.
    """
    if not design.D < pitch < math.inf:
        raise BadInput(f"beams overlap: the pitch must exceed D = {design.D:g} mm; got {pitch:g} mm")
    if not (rows >= 1 and columns >= 1 and rows * columns >= 2):
        raise BadInput(f"an array has two beams or more; got {rows} x {columns}: raise rows or columns")
    return ArrayDesign(design, pitch * layout_of(rows, columns), poles_of(polarity, rows, columns))


def layout_of(rows: int, columns: int) -> Array:
    """Return the places of beams over the pitch, row by row, about the middle, shape (n, 2).

    >>> layout_of(1, 2).tolist()
    [[-0.5, 0.0], [0.5, 0.0]]
    """
    y, x = np.indices((rows, columns)).reshape(2, -1)
    return np.column_stack([x - (columns - 1) / 2, y - (rows - 1) / 2])


def poles_of(polarity: str | Sequence[str], rows: int, columns: int) -> Array:
    """Return the poles of the beams, row by row, from one of `POLARITIES` or a list of "up" and "down", shape (n,).

    >>> poles_of("checkerboard", 2, 3).tolist()
    [1.0, -1.0, 1.0, -1.0, 1.0, -1.0]
    """
    y, x = np.indices((rows, columns)).reshape(2, -1)
    if polarity in POLARITIES:
        odd = {"up": 0 * x, "checkerboard": x + y, "rows": y}[str(polarity)]
        return np.asarray(1.0 - 2 * (odd % 2))
    listed = [polarity] if isinstance(polarity, str) else list(polarity)
    if unknown := [word for word in listed if word not in ("up", "down")]:
        close = closest(str(unknown[0]), [*POLARITIES, "down"])
        raise BadInput(
            f"polarity must be {', '.join(POLARITIES)}, or a list of up and down; got {unknown[0]!r}"
            + (f": did you mean {close}?" if close else "")
        )
    if len(listed) != rows * columns:
        raise BadInput(
            f"polarity lists {len(listed)} magnets, and {rows} x {columns} beams have {rows * columns}: give one for "
            "each, row by row"
        )
    return np.array([1.0 if word == "up" else -1.0 for word in listed])
