"""Technical drawings of solids in SVG: exact sections and views with dimension lines, on an A4 sheet or as a picture.

Sections and views consist of lines and arcs. Each view has its own plane, mm, with x to the right and y upwards. A
sheet shows its views side by side at one standard scale. Lengths on paper are in mm too: the SVG's unit is the
millimetre.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any, Literal

from geometry.arrays import Point
from geometry.cad import intersection

if TYPE_CHECKING:
    from build123d import Solid

Side = Literal["below", "above", "left", "right"]
Dimension = tuple[Point, Point, Side, int, str]

WIDTH, HEIGHT, MARGIN, BLOCK = 297.0, 210.0, 10.0, 18.0
"""Width and height of the sheet (A4, landscape), its margin, and the height of its title block, mm."""

SCALES = [f * 10.0**e for e in range(3, -5, -1) for f in (5, 2.5, 2, 1)]
"""Scales in the series 5, 2, 1 of ISO 5455, and 2.5, without which A4 is half empty; the largest first."""

TEXT, TITLE, NEAR, NEXT, ARROW = 3.2, 5.0, 8.0, 6.5, 2.4
"""Lengths on paper, mm: height of text, height for a view's title, distance of the first dimension line from the
view, distance of each further one, and length of an arrow."""


@dataclass(frozen=True, slots=True)
class Piece:
    """One piece of a path, mm: a line from `start` to `end`, or an arc of at most half a circle through `middle`."""

    start: Point
    end: Point
    middle: Point | None = None
    radius: float = 0.0


@dataclass(slots=True)
class View:
    """Paths, dimensions and labels in one plane, mm.

    Attributes
    ----------
    title : text above the view.
    paths : loops or open paths, each with the name of its CSS class; each piece starts where the last one ends.
    dims : dimensions: start, end, side of the view where the dimension line lies, its rank from the view outwards (0,
        1, ...), and text.
    labels : labelled point, text, and offset of the text from the point on paper, mm.
    arrows : point, vector from it on paper with y upwards, mm, text, and the end beyond which the text stands.
    """

    title: str
    paths: list[tuple[list[list[Piece]], str]] = field(default_factory=list)
    dims: list[Dimension] = field(default_factory=list)
    labels: list[tuple[Point, str, Point]] = field(default_factory=list)
    arrows: list[tuple[Point, Point, str, Literal["start", "end"]]] = field(default_factory=list)

    def cut(self, solid: Solid, style: str, *, y: float = 0.0) -> None:
        """Add the section of a solid with a plane of constant y, viewed along +y: x to the right, z upwards."""
        import build123d as bd

        box = solid.bounding_box(optimal=False)
        if not box.min.Y < y < box.max.Y:
            return
        reach = 4 * max(map(abs, (*box.min, *box.max)))
        plane = bd.Face.make_rect(reach, reach, bd.Plane((0, y, 0), x_dir=(1, 0, 0), z_dir=(0, -1, 0)))
        faces = [face for shape in intersection(solid, plane) for face in shape.faces()]
        # the kernel returns the faces in any order
        for face in sorted(faces, key=lambda face: tuple(face.center())):
            loops = [face.outer_wire(), *face.inner_wires()]
            self.paths.append(([_pieces(loop.order_edges(), 0, 2) for loop in loops], style))

    def projection(self, solid: Solid, *, below: bool = False) -> None:
        """Add the visible edges of a solid, viewed from above (x to the right, y upwards) or from below."""
        side = -1.0 if below else 1.0
        far = 10 * max(solid.bounding_box(optimal=False).size)
        edges, _ = solid.project_to_viewport((0, 0, side * far), (0, 1, 0), (0, 0, 0))
        self.paths.append(([_pieces([edge], 0, 1) for edge in edges], "outline"))

    def cross(self, centre: Point, half: float) -> None:
        """Add a cross of thin lines that marks a centre."""
        x, y = centre
        for u, v in ((half, 0.0), (0.0, half)):
            self.paths.append(([[Piece((x - u, y - v), (x + u, y + v))]], "axis"))

    def circle(self, centre: Point, radius: float, style: str) -> None:
        """Add a circle, as two half-circle arcs."""
        (x, y), r = centre, radius
        left, right, top, low = (x - r, y), (x + r, y), (x, y + r), (x, y - r)
        self.paths.append(([[Piece(left, right, top, r), Piece(right, left, low, r)]], style))

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Bounding box of the paths and of the arrows' starts: least x, greatest x, least y, greatest y, mm."""
        points = [p for loops, _ in self.paths for loop in loops for piece in loop for p in _ends(piece)]
        points += [start for start, *_ in self.arrows]
        x, y = zip(*points, strict=True)
        return min(x), max(x), min(y), max(y)

    def room(self, side: Side) -> float:
        """Return the width on paper of the dimensions on one side of the view, mm."""
        levels = [level for _, _, where, level, _ in self.dims if where == side]
        return NEAR + NEXT * (max(levels) + 0.6) if levels else NEAR / 2


def sheet(title: str, columns: Sequence[Sequence[View]], notes: Sequence[str], stamp: str) -> str:
    """Return the SVG text of a sheet at the largest standard scale at which all views fit.

    The columns stand side by side, or all views in one column where they are larger so. The views of a column are
    stacked, with their origins on one vertical line.

    stamp : design, date and tolerance, for the title block.
    """
    space_x, space_y = WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN - BLOCK

    def largest(columns: Sequence[Sequence[View]]) -> float:
        def fits(scale: float) -> bool:
            wide = sum(sum(_sides(column, scale)) for column in columns)
            return wide <= space_x and all(_height(column, scale) <= space_y for column in columns)

        return next((s for s in SCALES if fits(s)), SCALES[-1])

    columns = max(columns, [list(itertools.chain.from_iterable(columns))], key=largest)
    scale = largest(columns)
    out = _arranged(columns, scale, (MARGIN, MARGIN), (space_x, space_y))
    ratio = f"{scale:g}:1" if scale >= 1 else f"1:{1 / scale:g}"
    y = HEIGHT - MARGIN - BLOCK
    out.append(f'<path class="thin" d="M{MARGIN} {y}H{WIDTH - MARGIN}"/>')
    out.append(_text(MARGIN + 2, y + 7, title, "title"))
    out.append(_text(MARGIN + 2, y + 12, f"scale {ratio} on A4; all lengths in mm"))
    out.append(_text(MARGIN + 2, y + 16.2, stamp, "small"))
    for k, note in enumerate(notes):
        out.append(_text(MARGIN + 92, y + 4.2 + 4 * k, note, "small"))
    frame = f'<rect class="thin" x="{MARGIN}" y="{MARGIN}" width="{space_x}" height="{HEIGHT - 2 * MARGIN}"/>'
    return _svg(title, [frame, *out], WIDTH, HEIGHT)


def picture(title: str, columns: Sequence[Sequence[View]], scale: float) -> str:
    """Return the SVG text of views arranged as on a sheet, without its frame, as large as they are at a scale."""
    wide = sum(sum(_sides(column, scale)) for column in columns) + NEAR * (len(columns) + 1)
    high = max(_height(column, scale) for column in columns)
    return _svg(title, _arranged(columns, scale, (0.0, 0.0), (wide, high)), wide, high)


def _arranged(columns: Sequence[Sequence[View]], scale: float, corner: Point, room: Point) -> list[str]:
    """Return the elements of columns of views in a rectangle of paper: its upper left corner and its size, mm."""
    gap = (room[0] - sum(sum(_sides(column, scale)) for column in columns)) / (len(columns) + 1)
    out, x = [], corner[0] + gap
    for column in columns:
        left, right = _sides(column, scale)
        y = corner[1] + (room[1] - _height(column, scale)) / 2
        for view in column:
            y += view.room("above") + TITLE
            out.append(_drawn(view, scale, x + left, y + scale * view.box[3]))
            y += scale * (view.box[3] - view.box[2]) + view.room("below")
        x += left + right + gap
    return out


def _svg(title: str, elements: Sequence[str], width: float, height: float) -> str:
    text = Path(__file__).with_name("sheet.svg").read_text("utf-8")
    size = {"width": f"{width:g}", "height": f"{height:g}"}
    return Template(text).substitute(title=escape(title), views="\n".join(elements), **size)


def _sides(column: Sequence[View], scale: float) -> tuple[float, float]:
    """Return the width of a column on paper to the left and to the right of its origin, mm."""
    left = max(view.room("left") - scale * view.box[0] for view in column)
    return left, max(view.room("right") + scale * view.box[1] for view in column)


def _height(column: Sequence[View], scale: float) -> float:
    """Return the height of a column on paper, mm."""
    rooms = (view.room("above") + view.room("below") + TITLE for view in column)
    return sum(rooms) + scale * sum(view.box[3] - view.box[2] for view in column)


def number(value: float) -> str:
    """Format a length for a drawing: four significant digits, or three below 1.

    >>> number(8.0), number(1.23456), number(0.0125)
    ('8', '1.235', '0.0125')
    """
    return f"{value:.4g}" if abs(value) >= 1 or not value else f"{value:.3g}"


def _pieces(edges: Iterable[Any], first: int, second: int) -> list[Piece]:
    """Project edges of the CAD kernel to the plane of two coordinates; return lines and arcs.

    first, second : indices (0 to 2) of the coordinates that become x and y.
    """
    pieces = []
    for edge in edges:
        circle = edge.geom_type.name == "CIRCLE"
        # an arc is drawn as two, because SVG cannot draw a full circle as one; any other curve as 32 short lines
        steps = 4 if circle else 1 if edge.geom_type.name == "LINE" else 32
        places = [tuple(edge.position_at(k / steps)) for k in range(steps + 1)]
        points = [(place[first], place[second]) for place in places]
        if circle:
            pieces += [Piece(points[k], points[k + 2], points[k + 1], edge.radius) for k in (0, 2)]
        else:
            pieces += [Piece(a, b) for a, b in itertools.pairwise(points)]
    return pieces


def _ends(piece: Piece) -> list[Point]:
    """Return the ends of a piece and, of an arc, those of its outermost points that lie on it."""
    (x, y), (u, v) = piece.start, piece.end
    if piece.middle is None:
        return [piece.start, piece.end]
    (p, q), r = piece.middle, piece.radius
    # the centre lies on the line from the arc's middle through the middle of its chord
    back = math.dist(((x + u) / 2, (y + v) / 2), (p, q)) / r
    cx, cy = p + ((x + u) / 2 - p) / back, q + ((y + v) / 2 - q) / back

    # a point of the circle lies on the arc if it is on the same side of the chord as the arc's middle
    def side(point: Point) -> float:
        return (u - x) * (point[1] - y) - (v - y) * (point[0] - x)

    outer = [(cx + r, cy), (cx, cy + r), (cx - r, cy), (cx, cy - r)]
    return [piece.start, piece.end, *(point for point in outer if side(point) * side(piece.middle) > 0)]


def _drawn(view: View, scale: float, x0: float, y0: float) -> str:
    """Return the SVG elements of a view whose origin is at (x0, y0) on paper, mm."""

    def on(point: Point) -> Point:
        return x0 + scale * point[0], y0 - scale * point[1]

    out = [
        f'<path class="{style}" fill-rule="evenodd" d="{_path(loops, on, scale)}"/>' for loops, style in view.paths
    ]
    left, right, low, top = view.box
    (x1, y1), (x2, y2) = on((left, top)), on((right, low))
    taken = [_beside(on(point), text, away) for point, text, away in view.labels]
    for a, b, side, level, text in view.dims:
        away = NEAR + NEXT * level
        at = {"below": y2 + away, "above": y1 - away, "left": x1 - away, "right": x2 + away}[side]
        out.append(_dimension(on(a), on(b), side, at, text, taken))
    for point, text, (dx, dy) in view.labels:
        (x, y), end = on(point), "end" if dx < 0 else "start"
        out.append(f'<path class="thin" d="M{x:.3f} {y:.3f}L{x + dx:.3f} {y + dy:.3f}"/>')
        out.append(f'<circle class="arrow" cx="{x:.3f}" cy="{y:.3f}" r=".5"/>')
        out.append(_text(x + dx + math.copysign(0.8, dx), y + dy + 1.1, text, anchor=end))
    for point, along, text, where in view.arrows:
        out.append(_arrow(on(point), along, text, where == "end"))
    (middle, y), half = ((x1 + x2) / 2, y1 - view.room("above") - 1.5), _width(view.title) / 2
    # an arrow of a small view may point to the middle of its title
    tips = [(on(point)[0] + along[0], on(point)[1] - along[1]) for point, along, *_ in view.arrows]
    if any(abs(u - middle) < half + 2 and abs(v - y) < 2 * TEXT for u, v in tips):
        middle += half + 2 * TEXT
    out.append(_text(middle, y, view.title, anchor="middle"))
    # SVG draws in order: first the lines, then the halos that cover lines behind text, then the text
    return "\n".join(sorted("\n".join(out).split("\n"), key=lambda line: (line[:5] == "<text", "halo" not in line)))


def _path(loops: Iterable[Iterable[Piece]], on: Any, scale: float) -> str:
    """Return the path data of loops of pieces in their order; `on` maps a point of the view to paper."""
    words = []
    for loop in loops:
        for k, piece in enumerate(loop):
            (x, y), (u, v) = on(piece.start), on(piece.end)
            if k == 0:
                words.append(f"M{x:.4f} {y:.4f}")
            if piece.middle is None:
                words.append(f"L{u:.4f} {v:.4f}")
            else:
                p, q = on(piece.middle)
                turn = (p - x) * (v - y) - (q - y) * (u - x)
                r = scale * piece.radius
                words.append(f"A{r:.4f} {r:.4f} 0 0 {int(turn > 0)} {u:.4f} {v:.4f}")
    return "".join(words)


Box = tuple[float, float, float, float]
"""Least x and y, and greatest x and y of a text on paper, mm."""


def _width(text: str) -> float:
    return 0.56 * TEXT * len(text)


def _dimension(a: Point, b: Point, side: Side, at: float, text: str, taken: list[Box]) -> str:
    """Return extension lines, dimension line, arrows and text of one dimension.

    Parameters
    ----------
    a, b : the measured points on paper, mm.
    side : side of the view where the dimension line lies.
    at : y of a horizontal dimension line, or x of a vertical one, on paper, mm.
    taken : boxes of the texts that are there; that of this one is added.
    """
    upright = side in ("left", "right")
    k = 1 if upright else 0
    (p, q), (e, f) = sorted((a[k], b[k])), (a[1 - k], b[1 - k])
    if a[k] > b[k]:
        e, f = f, e
    beyond = 1.2 if side in ("below", "right") else -1.2
    span, wide = q - p, _width(text)
    inside = span > wide + 2 * ARROW + 1
    # on the right of a view, text outside a short line goes above it: below, it could meet that of another line
    before = [p - 3.2 - wide * (n + 0.5) for n in range(3)]
    after = [q + 3.2 + wide * (n + 0.5) for n in range(3)]
    outside = [*before, *after] if side == "right" else [after[0], *before, *after[1:]]

    def box(middle: float) -> Box:
        along, across = (middle - wide / 2, middle + wide / 2), (at - 1.2 - 0.75 * TEXT, at - 1.2)
        (x, u), (y, v) = (across, along) if upright else (along, across)
        return x, y, u, v

    places = [(p + q) / 2, *outside] if inside else outside
    middle = next((place for place in places if not any(_meet(box(place), other) for other in taken)), places[0])
    taken.append(box(middle))
    inside = p < middle < q
    ends = (p, q) if inside else (p - 4, q + 4)
    room = min(ends[0], middle - wide / 2 - 1.8), max(ends[1], middle + wide / 2 + 1.8)
    lines = [((p, e), (p, at + beyond)), ((q, f), (q, at + beyond)), ((room[0], at), (room[1], at))]
    way = 1 if inside else -1
    heads = [((p, at), way), ((q, at), -way)]

    def xy(s: float, t: float) -> Point:
        return (t, s) if upright else (s, t)

    out = []
    for start, end in lines:
        (x, y), (u, v) = xy(*start), xy(*end)
        out.append(f'<path class="dim" d="M{x:.3f} {y:.3f}L{u:.3f} {v:.3f}"/>')
    for (s, t), towards in heads:
        corners = [xy(s, t), xy(s + towards * ARROW, t - 0.4), xy(s + towards * ARROW, t + 0.4)]
        out.append('<path class="arrow" d="M' + "L".join(f"{x:.3f} {y:.3f}" for x, y in corners) + 'Z"/>')
    x, y = xy(middle, at - 1.2)
    turn = f' transform="rotate(-90 {x:.3f} {y:.3f})"' if upright else ""
    out.append(_text(x, y, text, anchor="middle", more=turn))
    return "\n".join(out)


def _beside(point: Point, text: str, away: Point) -> Box:
    """Return the box of a label's text, which begins or ends at an offset from its point on paper."""
    x, y = point[0] + away[0], point[1] + away[1]
    wide = math.copysign(_width(text) + 0.8, away[0])
    return min(x, x + wide), y + 1.1 - TEXT, max(x, x + wide), y + 1.1


def _meet(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _arrow(start: Point, along: Point, text: str, at_end: bool) -> str:
    """Return an arrow from a point on paper, and its text beyond one end; `along` with y upwards, mm."""
    (x, y), (dx, dy), length = start, (along[0], -along[1]), math.hypot(*along)
    c, s = dx / length, dy / length
    u, v, neck = x + dx, y + dy, 1.3 * ARROW
    corners = [(u, v), *((u - neck * c - w * s, v - neck * s + w * c) for w in (0.9, -0.9))]
    line = f'<path class="vector" d="M{x:.3f} {y:.3f}L{u - neck * c:.3f} {v - neck * s:.3f}"/>'
    head = '<path class="point" d="M' + "L".join(f"{p:.3f} {q:.3f}" for p, q in corners) + 'Z"/>'
    at, c, s = ((u, v), c, s) if at_end else ((x, y), -c, -s)
    side = "middle" if abs(c) < 0.5 else "start" if c > 0 else "end"
    name = _text(at[0] + c, at[1] + s + (1.1 + 1.6 * s if side == "middle" else 1.1), text, "vectors", anchor=side)
    return f"{line}\n{head}\n{name}"


def _text(x: float, y: float, text: str, kind: str = "", anchor: str = "start", more: str = "") -> str:
    """Return a text above its own white halo, as two elements.

    One element with SVG 2's paint-order would suffice, but few programs support paint-order.
    """
    where = f'x="{x:.3f}" y="{y:.3f}" text-anchor="{anchor}"{more}>{escape(text)}</text>'
    return f'<text class="halo {kind}" aria-hidden="true" {where}\n<text class="{kind}" {where}'
