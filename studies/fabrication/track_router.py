"""Routing of tracks on two faces of a board: the cheapest path on a grid from what a net has to what it still lacks.

Copper of other nets, the edge and holes close the cells of the grid whose track or via would come too near. A path
goes along y on the upper face and along x on the lower one where it can, so that later nets find gaps. Where a net
finds no way, all begin anew with this one first. All lengths are mm.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Ints, Point
from geometry.compiled import compiled
from studies.fabrication.board_layers import (
    CLEARANCE,
    DRILL,
    EDGE,
    HOLE_GAP,
    HOLES_APART,
    TRACK,
    VIA,
    Board,
    NoRoom,
    Terminal,
    Track,
    Via,
    copper,
    pin_names,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from shapely import Polygon

STEP = 0.12
"""Distance of neighbouring cells: three of them part two tracks."""
SLACK = 4e-3
"""By how much gaps are larger than the rules ask for: a path between two open cells may cut a corner."""
ALONG, ACROSS, CHANGE = 2, 5, 60
"""Costs of a step along and across the direction of a face, and of a via."""
ATTEMPTS = 12
"""Largest number of orders of the nets."""
SHUT, MANY = -1, -2
"""Marks of a cell that is closed to all nets: for good, and by two nets or more."""


def routed(made: Board, terminals: Sequence[Terminal]) -> tuple[list[Track], list[Via]]:
    """Return the tracks and vias that join the terminals of each net on a board.

    Raises
    ------
    NoRoom
        A net finds no way, in whatever order the nets are tried.
    """
    nets = sorted({each.net for each in terminals}, key=lambda net: _span(net, terminals))
    grid = Grid(made)
    for _ in range(ATTEMPTS):
        tracks: list[Track] = []
        vias: list[Via] = []
        free = grid.copy()
        for net in nets:
            found = _net(free, net, [each for each in terminals if each.net == net])
            if found is None:
                break
            tracks += found[0]
            vias += found[1]
        else:
            return tracks, vias
        nets.remove(net)
        nets.insert(0, net)
    raise NoRoom(f"no way is left for the net {net}")


def _span(net: str, terminals: Sequence[Terminal]) -> tuple[bool, float]:
    """Return the order of a net: short ones first, supplies, which go everywhere, last."""
    at = np.array([each.at for each in terminals if each.net == net])
    return net.startswith("VDD"), float(np.ptp(at, axis=0).sum())


class Grid:
    """Cells of both faces, and which net closes them to the others' tracks and vias."""

    def __init__(self, made: Board) -> None:
        import shapely

        left, low, right, high = made.area.bounds
        self.corner = left, low
        self.size = math.ceil((high - low) / STEP) + 1, math.ceil((right - left) / STEP) + 1
        self.names: list[str] = [""]
        self.track, self.via = np.full((2, *self.size), SHUT), np.full(self.size, SHUT)
        for marks, half in ((self.track, TRACK / 2), (self.via, VIA / 2)):
            inside = made.area.buffer(-EDGE - half - SLACK, join_style="mitre")
            rows, columns, within = self._within(inside)
            marks[..., rows, columns][..., within] = 0
        for x, y, d in made.holes:
            for face in (0, 1):
                self._close(self.track[face], shapely.Point(x, y).buffer(d / 2 + HOLE_GAP + TRACK / 2 + SLACK), SHUT)
            self._close(self.via, shapely.Point(x, y).buffer(d / 2 + HOLE_GAP + VIA / 2 + SLACK), SHUT)
        drills = [(pad.at, pad.drill) for part in made.parts for pad in part.pads if pad.drill]
        for at, d in [*drills, *((via.at, DRILL) for via in made.vias)]:
            self._drilled(at, d)
        for piece in copper(made):
            self.add(piece.net, piece.faces, piece.shape)
        for pad in (pad for part in made.parts for pad in part.pads if not pad.drill):
            # solder would run into a via in a pad
            self._close(self.via, pad.shape(VIA / 2), SHUT)
        for name in pin_names(made):
            self._close(self.via, name, SHUT)

    def copy(self) -> Grid:
        other = object.__new__(Grid)
        other.corner, other.size, other.names = self.corner, self.size, list(self.names)
        other.track, other.via = self.track.copy(), self.via.copy()
        return other

    def number(self, net: str) -> int:
        if net not in self.names:
            self.names.append(net)
        return self.names.index(net)

    def add(self, net: str, faces: tuple[bool, bool], shape: Polygon) -> None:
        """Close what lies too near to copper of a net to the others."""
        mark = self.number(net)
        for face in (0, 1):
            if faces[face]:
                self._close(self.track[face], shape.buffer(CLEARANCE + TRACK / 2 + SLACK), mark)
        self._close(self.via, shape.buffer(CLEARANCE + VIA / 2 + SLACK), mark)

    def add_path(self, tracks: Sequence[Track], vias: Sequence[Via]) -> None:
        import shapely

        for track in tracks:
            shape = shapely.LineString(track.points).buffer(track.width / 2)
            self.add(track.net, (not track.below, track.below), shape)
        for via in vias:
            self.add(via.net, (True, True), shapely.Point(via.at).buffer(VIA / 2))
            self._drilled(via.at, DRILL)

    def cell(self, at: Point) -> tuple[int, int]:
        """Return row and column of the cell nearest to a place."""
        return round((at[1] - self.corner[1]) / STEP), round((at[0] - self.corner[0]) / STEP)

    def place(self, row: int, column: int) -> Point:
        return self.corner[0] + column * STEP, self.corner[1] + row * STEP

    def _drilled(self, at: Point, drill: float) -> None:
        import shapely

        self._close(self.via, shapely.Point(at).buffer((drill + DRILL) / 2 + HOLES_APART + SLACK), SHUT)

    def _within(self, shape: Polygon) -> tuple[slice, slice, NDArray[np.bool_]]:
        """Return rows, columns and, of their cells, those within a shape."""
        import shapely

        left, low, right, high = shape.bounds
        (first, start), (last, end) = self.cell((left, low)), self.cell((right, high))
        rows = slice(max(first, 0), max(min(last + 1, self.size[0]), 0))
        columns = slice(max(start, 0), max(min(end + 1, self.size[1]), 0))
        y, x = np.mgrid[rows, columns]
        return rows, columns, shapely.contains_xy(shape, self.corner[0] + x * STEP, self.corner[1] + y * STEP)

    def _close(self, marks: Ints, shape: Polygon, mark: int) -> None:
        rows, columns, within = self._within(shape)
        part = marks[rows, columns]
        if mark == SHUT:
            part[within] = SHUT
            return
        part[within & (part > 0) & (part != mark)] = MANY
        part[within & (part == 0)] = mark


def _net(free: Grid, net: str, terminals: Sequence[Terminal]) -> tuple[list[Track], list[Via]] | None:
    """Return tracks and vias of a net, and close them to the others; None if a terminal cannot be reached."""
    mark, (height, width) = free.number(net), free.size
    size = height * width
    cells = [row * width + column for row, column in (free.cell(each.at) for each in terminals)]
    states = [
        [face * size + cell for face in (0, 1) if each.faces[face]]
        for each, cell in zip(terminals, cells, strict=True)
    ]
    ends = dict(zip(cells, (each.at for each in terminals), strict=True))
    closed = ((free.track != 0) & (free.track != mark)).ravel()
    # a terminal is the net's own copper, however near others are
    closed[list(itertools.chain.from_iterable(states))] = False
    tree, left = list(states[0]), states[1:]
    tracks: list[Track] = []
    vias: list[Via] = []
    while left:
        goal = np.zeros(2 * size, bool)
        goal[list(itertools.chain.from_iterable(left))] = True
        no_via = ((free.via != 0) & (free.via != mark)).ravel()
        path = _cheapest(closed, no_via, np.array(tree), goal, height, width)
        if not len(path):
            return None
        reached = next(each for each in left if path[0] in each)
        left.remove(reached)
        tree += [*path.tolist(), *reached]
        new = list(_pieces(free, net, path.tolist(), ends))
        tracks += (run := [each for each in new if isinstance(each, Track)])
        vias += (through := [each for each in new if isinstance(each, Via)])
        free.add_path(run, through)
    return tracks, vias


def _pieces(free: Grid, net: str, path: Sequence[int], ends: dict[int, Point]) -> Iterator[Track | Via]:
    """Yield the tracks of a path of states, and the vias where it changes its face."""
    height, width = free.size
    size = height * width
    runs = [list(states) for _, states in itertools.groupby(path, lambda state: state // size)]
    for states in runs:
        face, cells = states[0] // size, [state % size for state in states]
        points = [free.place(*divmod(cell, width)) for cell in cells]
        points = [*_exact(cells[0], ends), *points, *_exact(cells[-1], ends)]
        if len(points) > 1:
            yield Track(net, bool(face), tuple(_corners(points)))
        if states is not runs[-1]:
            yield Via(net, free.place(*divmod(cells[-1], width)))


def _exact(cell: int, ends: dict[int, Point]) -> list[Point]:
    """Return the exact place of a terminal in a cell."""
    return [ends[cell]] if cell in ends else []


def _corners(points: Sequence[Point]) -> list[Point]:
    """Return the points of a line without those on a straight part of it."""
    kept = [points[0]]
    for (a, b), (c, d), (e, f) in zip(points, points[1:], points[2:], strict=False):
        if abs((c - a) * (f - d) - (d - b) * (e - c)) > 1e-9:
            kept.append((c, d))
    return [*kept, points[-1]]


@compiled
def _cheapest(closed, no_via, start, goal, height, width):  # type: ignore[no-untyped-def]
    """Return the states of the cheapest path, the goal first; empty if there is none.

    A state is a cell of the upper face, or, above `height` times `width`, of the lower one. Buckets by the cost,
    modulo the largest step, hold the states to go on from (Dial's algorithm).
    """
    size = height * width
    best, came = np.full(2 * size, 2**30), np.full(2 * size, -1)
    count = CHANGE + 1
    heads = np.full(count, -1)
    item, link = np.empty(12 * size + len(start), np.int64), np.empty(12 * size + len(start), np.int64)
    used = 0
    for state in start:
        best[state] = 0
        item[used], link[used] = state, heads[0]
        heads[0] = used
        used += 1
    cost, empty = 0, 0
    while empty <= count:
        entry = heads[cost % count]
        if entry < 0:
            cost += 1
            empty += 1
            continue
        empty = 0
        heads[cost % count] = link[entry]
        state = item[entry]
        if best[state] != cost:
            continue
        if goal[state]:
            length, at = 1, state
            while came[at] >= 0:
                at = came[at]
                length += 1
            path = np.empty(length, np.int64)
            for k in range(length):
                path[k] = state
                state = came[state]
            return path
        face, cell = state // size, state % size
        row, column = cell // width, cell % width
        for way in range(5):
            if way == 4:
                if no_via[cell]:
                    continue
                other, price = (1 - face) * size + cell, CHANGE
            else:
                r, c = row + (way == 0) - (way == 1), column + (way == 2) - (way == 3)
                if r < 0 or r >= height or c < 0 or c >= width:
                    continue
                other = face * size + r * width + c
                price = ALONG if (way < 2) == (face == 0) else ACROSS
            if closed[other] or best[other] <= cost + price:
                continue
            best[other], came[other] = cost + price, state
            item[used], link[used] = other, heads[(cost + price) % count]
            heads[(cost + price) % count] = used
            used += 1
    return np.empty(0, np.int64)
