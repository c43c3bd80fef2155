"""Drawings that explain a design: its lengths by their symbols, its loads with their signs, its mesh and its tips.

The lengths are those of the exact solids. The bodies under load are sections of finite-element solutions at level
quick, drawn to scale; dashed lines show the body at rest.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from fem.accuracy import QUICK
from fem.equilibrium import solve, trace
from fem.solution import Solution
from geometry import cad
from geometry.arrays import Array, Ints, Point
from geometry.bad_input import SolveFailed
from geometry.base import Base, base, plan
from geometry.design import Design
from geometry.fabrication.hall_elements import bodies
from geometry.fabrication.technical_drawing import Dimension, Piece, View, picture
from geometry.loads import Load, Response
from studies.fabrication.part_drawings import add_axis, add_lengths
from studies.output import deformed_body, solution_pictures

BEAM, LOADED = 36.0, 30.0
"""Height of the beam on paper, mm, in the drawing of lengths and in that of loads."""
FORCE, BOLD = 11.0, 7.0
"""Lengths on paper of the arrows of forces, and of axes and poles, mm."""
THICK = 0.15
"""Drawn thickness of the plate over R."""


def lengths(design: Design) -> str:
    """Return the drawing of all lengths of a design, with the axes along which its Hall elements measure, as SVG."""
    parts = {"base": base(plan(design, Base(shape="round"))), "silicone": cad.silicone(design)}
    if design.shape.has_magnet:
        parts["magnet"] = cad.magnet(design)
    elements = bodies(design)
    side, above = View("section y = 0, lengths in mm"), View("from above")
    for name, solid in (parts | elements).items():
        side.cut(solid, {"base": "rigid", "silicone": "soft", "magnet": "magnet"}.get(name, "part"))
    if "magnet" in parts:
        down = -1.0 if design.magnet_north == "down" else 1.0
        side.arrows.append(((-0.3 * design.magnet_diameter, design.H), (0.0, down * BOLD), "N", "end"))
    above.projection(parts["base"])
    add_lengths(design, parts, elements, side, above)
    below_base = parts["base"].bounding_box().min.Z - 0.4 * design.D
    for view, axes, lowest in ((side, "xz", below_base), (above, "xy", math.inf)):
        left, _, low, _ = view.box
        _frame(view, (left, min(low, lowest)), axes)
        add_axis(view)
    return picture("Lengths of the sensor", [[side], [above]], BEAM / max(design.L, design.D))


def chips(design: Design) -> str:
    """Return the drawing of lengths of a design with three 3-axis chips in place of its elements, as SVG."""
    aside, below = 0.625 * design.D, design.H + 3
    return lengths(replace(design, hall_layout="tle493d-w2b6", chip_count=3, chip_x=aside, l0=below))


def loads(design: Design) -> str:
    """Return the drawing of four loads of a design, with the signs of loads and responses, as SVG.

    Raises
    ------
    SolveFailed
        A load has no stable answer: a slender beam, for example, buckles under a press of D/6.
    """
    D, L, R = design.D, design.L, design.R
    depth, shear, grip, tilt = D / 6, D / 4, D / 4, math.radians(15)
    scale = LOADED / L
    drop = (1.5 * R, L), (1.5 * R, L - depth)

    press, state = _under(design, Load(depth), "press")
    press.dims += [(*drop, "right", 0, "depth > 0"), _sunk(design, state)]
    press.arrows.append(((0.0, drop[1][1] + THICK * R + FORCE / scale), (0.0, -FORCE), "force z > 0", "start"))
    _frame(press, (-1.9 * R, -0.8 * R), "xz")

    sheared, state = _under(design, Load(depth, shear, friction="stick"), "press, then shear")
    sheared.dims += [((0.0, L), (shear, L), "above", 0, "shear > 0"), _moved(design, state)]
    edge = shear - 1.5 * R - FORCE / scale, L - depth + THICK * R / 2
    sheared.arrows.append((edge, (FORCE, 0.0), "force x > 0", "start"))
    _lean(sheared, _centre(design, state), state.tilt, 1.2 * D, "tilt > 0")

    tilted, _ = _under(design, Load(depth, plate_tilt=tilt), "press by a tilted plate")
    _lean(tilted, (0.0, design.shape.plate_height(depth, tilt)), tilt, 0.6 * D, "plate tilt > 0")

    held, state = _under(design, Load(grip=grip, shear_x=shear), "grip, then shear")
    held.dims += [((-R, L), (-R, L - grip), "left", 0, "grip"), ((0.0, L), (shear, L), "above", 0, "shear > 0")]
    held.dims.append(_moved(design, state))
    _lean(held, _centre(design, state), state.tilt, 1.2 * D, "tilt > 0")
    return picture("Loads of the sensor", [[press, tilted], [sheared, held]], scale)


def mesh(design: Design) -> str:
    """Return the drawing of the mesh of a pressed design, with base and plate, as SVG."""
    state = solve(design, Load(design.D / 8), QUICK)
    view, cut = _drawn(design, state, "section of a press, level quick"), solution_pictures.cut_of(state)
    sides = np.unique(np.sort(cut.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    ends = cut.moved[sides][:, :, [0, 2]].tolist()
    view.paths.append(([[Piece((a, b), (c, d))] for (a, b), (c, d) in ends], "thin"))
    _frame(view, (-1.9 * design.R, -0.1 * design.R), "xz")
    return picture("Mesh of a press", [[view]], 2 * LOADED / design.L)


def tips(design: Design) -> str:
    """Return the drawing of a free, a guided and a glued tip of a beam of silicone with L = 3 D, as SVG."""
    D = design.D
    beam = replace(design, L=3 * D, magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)
    presses = [Load(D / 5 * k / 4, imperfection=3e-5 * design.E * D**2) for k in range(1, 5)]
    states = {
        "free tip, gives way": trace(beam, presses, QUICK, magnet="ignored")[-1],
        "guided tip, same depth": solve(beam, Load(D / 5), QUICK, magnet="ignored"),
        "glued tip, sheared": solve(beam, Load(D / 20, D / 2, friction="stick"), QUICK, magnet="ignored"),
    }
    views = [[_drawn(beam, state, title)] for title, state in states.items()]
    _frame(views[0][0], (-2.5 * design.R, 0.1 * design.R), "xz")
    return picture("Three tips", views, LOADED / design.L / 1.5)


def _under(design: Design, load: Load, title: str) -> tuple[View, Response]:
    """Return the section of the sensor under a load, with plate or grip and its outline at rest, and its response."""
    state = solve(design, load, QUICK)
    if state.status != "ok":
        raise SolveFailed(f"the drawing of a {title} has no stable state: {state.message}")
    return _drawn(design, state, title), state.response


def _drawn(design: Design, state: Solution, title: str) -> View:
    """Return the section of a state with plate or grip, and its outline at rest."""
    view, cut, R, load = View(title), solution_pictures.cut_of(state), design.R, state.load
    outlines = _loops(cut.edges, cut.rest)
    skin = max(outlines, key=lambda loop: float(np.ptp(cut.rest[loop, 2])))
    moved, rest = cut.moved[skin][:, [0, 2]], cut.rest[skin][:, [0, 2]]
    _fill(view, np.array([(-1.5 * R, 0), (1.5 * R, 0), (1.5 * R, -0.2 * R), (-1.5 * R, -0.2 * R)]), "plate")
    if load.grip is None:
        for depth, style in ((0.0, "rest"), (load.depth, "plate")):
            _fill(view, _plate(design, load, depth), style)
    _fill(view, moved, "soft")
    if load.grip is not None:
        _fill(view, moved[rest[:, 1] >= design.L - load.grip], "held")
    if design.shape.has_magnet:
        shift, tilt = state.response.shift, state.response.tilt
        _fill(view, deformed_body.magnet_outline(design, shift[0], shift[2], tilt), "magnet")
    _fill(view, rest, "rest")
    return view


def _plate(design: Design, load: Load, depth: float) -> Array:
    """Return the outline of the plate after a travel, mm, shape (4, 2); at first touch it is not yet sheared."""
    R, slope = design.R, math.tan(load.plate_tilt)
    middle = load.shear_x if depth else 0.0
    x = np.array([-1.5, 1.5, 1.5, -1.5]) * R + middle
    lower = design.shape.plate_height(depth, load.plate_tilt) - slope * x
    return np.column_stack([x, lower + np.array([0.0, 0.0, THICK, THICK]) * R])


def _loops(edges: Ints, points: Array) -> list[Ints]:
    """Return the closed loops of edges (n, 2), each as numbers of its points (k,); equal points count as one."""
    _, first, same = np.unique(points.round(6), axis=0, return_index=True, return_inverse=True)
    beside: dict[int, list[int]] = {}
    for a, b in first[same.ravel()][edges].tolist():
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    loops = []
    while beside:
        loop = [next(iter(beside))]
        while following := [b for b in beside.pop(loop[-1]) if b in beside]:
            loop.append(following[0])
        loops.append(np.array(loop))
    return loops


def _fill(view: View, outline: Array, style: str) -> None:
    """Add a polygon (n, 2), mm, in a style."""
    points = [(float(x), float(z)) for x, z in outline]
    view.paths.append(([[Piece(a, b) for a, b in itertools.pairwise([*points, points[0]])]], style))


def _frame(view: View, corner: Point, axes: str) -> None:
    view.arrows += [(corner, (BOLD, 0.0), axes[0], "end"), (corner, (0.0, BOLD), axes[1], "end")]


def _centre(design: Design, response: Response) -> Point:
    return response.shift[0], design.H + response.shift[2]


def _sunk(design: Design, response: Response) -> Dimension:
    return (0.0, design.H), _centre(design, response), "left", 0, "shift z < 0"


def _moved(design: Design, response: Response) -> Dimension:
    return (0.0, design.H), _centre(design, response), "below", 0, "shift x > 0"


def _lean(view: View, foot: Point, angle: float, reach: float, text: str) -> None:
    """Add an axis from a point upwards, one that leans from z towards x, and the angle between them."""
    (x, z), zenith = foot, (foot[0], foot[1] + reach)
    end, middle = ((x + reach * math.sin(turn), z + reach * math.cos(turn)) for turn in (angle, angle / 2))
    view.paths.append(([[Piece(foot, end)], [Piece(foot, zenith)]], "axis"))
    view.paths.append(([[Piece(zenith, end, middle, reach)]], "thin"))
    view.labels.append((middle, text, (9.0, -2.0)))
