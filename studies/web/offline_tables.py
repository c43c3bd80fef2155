"""Numbers and pictures of the page without a server: states of a design, solved beforehand, and what lies between.

**States** over depth and shear, by finite elements. Presses are frictionless; a shear begins at a press whose
contact area is then bonded. The nodes of the depth d are evenly spaced in r = (d/D)^(1/2), as the contact radius and
the cubes of the force are nearly. With the shear s, the value of a quantity between the nodes is

    q(r, s) = q(r, 0) + [q(r, s) - q(r, 0)],

the press by a cubic spline over r through many presses, the bracket by cubic splines first over s, then over r. No
value is given in a cell that has a node without a solved state. `Grid.checks` are further states in the middle of the
cells, for which the finite elements are solved as well: they measure the error of whatever is read from the grid.

**Tables** of answers of the live page over depth and shear, or over depth, shear and direction, made by its own
functions (`state_answers`). The page interpolates linearly between the nodes of a table and does nothing else to a
number, but for turning vectors into the direction of the shear. The half widths are those of the error estimates and,
added to them, the errors of the interpolation, measured at the checks of the grid.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import beam
from analytic.hall import batch_readings
from fem.accuracy import STANDARD, Accuracy
from fem.equilibrium import trace
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet, Response, rotation_of
from geometry.messages import Progress
from studies.web import state_answers, state_pictures

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from fem.solution import Solution

DEEPEST, FARTHEST = 0.375, 0.375
"""Largest depth and shear over D, less where the silicone on the axis ends before."""
ROWS, COLUMNS, PRESSES = 16, 6, 4
"""Intervals of r and of the shear, and presses per interval of r: a press takes a hundredth of a row of shears."""
FIRST_ROW = 4
"""First row with shears; below, the plate of this stroke barely touches the tip, and a bonded one peels off."""
SHALLOWEST = 0.01
"""Least depth of a check, mm: the step of the page's slider."""
RESPONSE, RADIUS, WIDTHS = slice(0, 9), 8, slice(9, 16)
"""Columns of a state sheared along x: force, shift, tilts and contact radius (the last), and half widths of force,
shift and tilt; N, mm, degrees."""
FINE = 8, 4
"""Intervals of the table of the response per interval of the grid, along depth and shear."""
READ = 2, 2, 48
"""The same for the readings, with the number of directions."""
DECODED = 2, 2, 12
"""The same for the decoded load, which takes a millisecond a node and grows with a power of the depth."""
PICTURED = 2, 2
"""Intervals of the grid per interval of the pictures."""
SKIN = "back"
"""The half of the skin that is stored; the other one is its mirror image."""
REST = Response((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0)

Data = dict[str, Any]
Place = tuple[float, float]
"""A state's r and its shear, mm."""
State = tuple[float, float, "Solution"]
"""A solution at its place."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Solved states of a design; NaN where there is none.

    Attributes
    ----------
    roots, shears : nodes r of the rows, and of the shear, mm; `press_roots` are those of the presses.
    press, rows : numbers (`RESPONSE`, `WIDTHS`) of the presses, shape (p, 16), and at the nodes of rows and shears,
        shape (n, m, 16).
    states : the solutions with their place (r, shear).
    checks : states in the middle of the cells, in the same form.
    failed_checks : places of those without an answer.
    """

    design: Design
    roots: Array
    shears: Array
    press_roots: Array
    press: Array
    rows: Array
    states: list[State]
    checks: list[State]
    failed_checks: list[Place]

    def at(self, roots: Array, shears: Array) -> Array:
        """Return the numbers at all pairs of r and shear, shape (a, b, 16)."""
        parts = [
            between(self.press_roots, self.press[:, part], roots, degree)[:, None]
            + self._change((self.rows - self.rows[:, :1])[..., part], roots, shears, degree)
            for part, degree in ((RESPONSE, 3), (WIDTHS, 1))
        ]
        values = np.concatenate(parts, axis=-1)
        values[..., RADIUS:] = np.maximum(values[..., RADIUS:], 0.0)
        return values

    def _change(self, rows: Array, roots: Array, shears: Array, degree: int) -> Array:
        along = np.stack([between(self.shears, row, shears, degree) for row in rows])
        result = np.full((len(roots), len(shears), rows.shape[-1]), np.nan)
        for j, shear in enumerate(shears):
            result[:, j] = between(self.roots, along[:, j], roots, degree) if shear else 0.0
        return result


def between(nodes: Array, values: Array, at: Array, degree: int) -> Array:
    """Return a spline through values (n, q) at nodes (n,), shape (len(at), q); NaN beside a node without values.

    >>> between(np.arange(4.0), np.array([[0.0], [1.0], [4.0], [np.nan]]), np.array([0.5, 2.5]), 3).ravel()
    array([0.25,  nan])
    """
    from scipy.interpolate import make_interp_spline

    known, result = np.asarray(np.isfinite(values).all(axis=1)), np.full((len(at), values.shape[1]), np.nan)
    left = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 1)
    right = np.minimum(left + 1, len(nodes) - 1)
    tolerance = 1e-9 * nodes[-1]
    on_left, on_right = (known[k] & (np.abs(at - nodes[k]) <= tolerance) for k in (left, right))
    inside = np.asarray((known[left] & known[right] & (at <= nodes[-1])) | on_left | on_right)
    if known.sum() > 1:
        spline = make_interp_spline(nodes[known], values[known], k=min(degree, int(known.sum()) - 1))
        result[inside] = spline(at[inside])
    elif known.any():
        result[inside] = values[known]
    return result


def solve(
    design: Design,
    magnet: Magnet,
    accuracy: Accuracy = STANDARD,
    progress: Progress = lambda *_: None,
    *,
    size: tuple[int, int] = (ROWS, COLUMNS),
) -> Grid:
    """Solve for the states of a design at the nodes and at the checks.

    Parameters
    ----------
    size : intervals of r and of the shear, whole multiples of 4 and 2.

    Raises
    ------
    BadInput
        Not even the lightest presses were solved.
    """
    D, (rows, columns) = design.D, size
    room = 0.9 * (design.L - (design.magnet_height if magnet == "rigid" else 0.0)) / D
    roots = np.linspace(0.0, math.sqrt(min(DEEPEST, room)), rows + 1)
    press_roots = np.linspace(0.0, roots[-1], rows * PRESSES + 1)
    shears = np.linspace(0.0, FARTHEST * D, columns + 1)
    first = rows * FIRST_ROW // ROWS

    def path(places: list[Place], *, estimate: bool) -> list[State]:
        loads = [Load(root**2 * D, shear, friction="stick" if shear else "none") for root, shear in places]
        states = trace(design, loads, accuracy, magnet=magnet, estimate=estimate)
        return [(*place, state) for place, state in zip(places, states, strict=False)]

    states = path([(root, 0.0) for root in press_roots[1:].tolist()], estimate=True)
    wanted = [(r, 0.0) for r in ((press_roots[1:] + press_roots[:-1]) / 2).tolist() if r**2 * D >= SHALLOWEST]
    checks = path(wanted, estimate=False)
    # the deeper a press, the longer the path of its shears
    total, done = roots[first:].sum() + ((roots[first + 1 :] + roots[first:-1]) / 2).sum(), 0.0
    for k in range(first, len(roots)):
        progress(done / total, f"finite elements at depth {roots[k] ** 2 * D:.3g} mm")
        states += path([(float(roots[k]), shear) for shear in shears[1:].tolist()], estimate=True)
        done += roots[k]
        if k + 1 < len(roots):
            root = float(roots[k] + roots[k + 1]) / 2
            wanted += (row := [(root, shear) for shear in ((shears[1:] + shears[:-1]) / 2).tolist()])
            checks += path(row, estimate=False)
            done += root
    states, checks = ([one for one in some if one[2].status in ANSWERED] for some in (states, checks))
    if len(states) < 2:
        raise BadInput("no press of this design could be solved: the page needs its states")
    press, table = (
        np.full((*shape, WIDTHS.stop), np.nan) for shape in ((len(press_roots),), (rows + 1, columns + 1))
    )
    press[0] = 0.0
    for root, shear, state in states:
        if shear:
            table[np.argmin(np.abs(roots - root)), np.argmin(np.abs(shears - shear))] = numbers_of(state)
        else:
            press[np.argmin(np.abs(press_roots - root))] = numbers_of(state)
    table[:, 0] = press[::PRESSES]
    failed = [place for place in wanted if place not in {check[:2] for check in checks}]
    return Grid(design, roots, shears, press_roots, press, table, states, checks, failed)


def numbers_of(solution: Solution) -> Array:
    """Return the numbers of a state that is sheared along x, shape (16,)."""
    response, widths = state_answers.response_data(solution.response), state_answers.half_widths(solution)
    # an upright press has no tilt
    tilt = widths["tilt"] if response["tilt"] else 0.0
    half = [*(widths["force"] or [None] * 3), *(widths["shift"] or [None] * 3), tilt]
    numbers = [*response["force"], *response["shift"], response["tilt"], response["tilt_y"]]
    return np.array([*numbers, response["contact_radius"], *half], dtype=float)


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Values at the nodes of axes; NaN where there is none, as between such nodes.

    Attributes
    ----------
    axes : nodes of each axis, evenly spaced.
    values : shape (*lengths of the axes, channels).
    template : an answer at whose numbers the values stand, one after the other, and at whose words `texts`.
    codes : numbers of the texts at the nodes, shape (*lengths of the axes, words).
    """

    axes: tuple[Array, ...]
    values: Array
    template: Any = None
    texts: tuple[str, ...] = ()
    codes: Ints | None = None

    def at(self, points: Array) -> Array:
        """Return the values as the page reads them at points (n, axes), shape (n, channels).

        Nodes without values do no harm to a press, which lies on nodes of the shear.
        """
        from scipy.interpolate import RegularGridInterpolator

        result = np.asarray(RegularGridInterpolator(self.axes, self.values, bounds_error=False)(points))
        press = points[:, 1] == 0
        rest = RegularGridInterpolator((self.axes[0], *self.axes[2:]), self.values[:, 0], bounds_error=False)
        result[press] = rest(np.delete(points[press], 1, axis=1))
        return result

    def data(self) -> Data:
        """Return the table as the page takes it."""
        axes = [[float(axis[0]), float(axis[-1]), len(axis)] for axis in self.axes]
        values = {"channels": self.values.shape[-1], "values": self.values.astype(np.float32)}
        return {"axes": axes, **values, "template": self.template, "texts": self.texts, "codes": self.codes}


def tabulated(axes: tuple[Array, ...], answer: Callable[..., Data]) -> Table:
    """Return a table of the answers at all nodes; `answer` takes the places of a node on the axes."""
    shape = tuple(map(len, axes))
    answers = [answer(*index) for index in np.ndindex(shape)]
    template = functools.reduce(_wider, answers)
    leaves = [list(_leaves(template, one)) for one in answers]
    values = np.array([[leaf for leaf in row if not isinstance(leaf, str)] for row in leaves])
    words = [[leaf for leaf in row if isinstance(leaf, str)] for row in leaves]
    texts = tuple(dict.fromkeys(word for row in words for word in row))
    codes = np.array([[texts.index(word) for word in row] for row in words], dtype=np.int64)
    return Table(axes, values.reshape(*shape, -1), template, texts, codes.reshape(*shape, -1))


def _wider(one: Any, other: Any) -> Any:
    """Return an answer with the places of two."""
    if isinstance(one, dict) and isinstance(other, dict):
        return {key: _wider(one.get(key), other.get(key)) for key in one | other}
    return other if one is None else one


def _leaves(template: Any, answer: Any) -> Iterator[float | str]:
    """Yield the numbers and words of an answer at the places of a template; NaN and "" where it has none."""
    if isinstance(template, dict):
        for key, part in template.items():
            yield from _leaves(part, None if answer is None else answer.get(key))
    elif isinstance(template, (list, tuple)):
        for k, part in enumerate(template):
            yield from _leaves(part, None if answer is None else answer[k])
    elif isinstance(template, str):
        yield answer or ""
    elif template is not None:
        yield math.nan if answer is None else float(answer)


def refined(nodes: Array, number: int) -> Array:
    """Return evenly spaced nodes with each interval divided."""
    return np.linspace(nodes[0], nodes[-1], (len(nodes) - 1) * number + 1)


def directions(number: int) -> Array:
    """Return directions of a full turn, its end included, degrees."""
    return np.linspace(0.0, 360.0, number + 1)


def response(grid: Grid) -> tuple[Table, Array]:
    """Return the numbers with the errors of the interpolation in their half widths.

    Returns
    -------
    The table, and the largest errors of force, shift and tilt at the checks by interval of the depth, shape (n, 7);
    NaN where no check tells.
    """
    roots, shears = refined(grid.roots, FINE[0]), refined(grid.shears, FINE[1])
    table = Table((roots, shears), grid.at(roots, shears))
    points = np.array([check[:2] for check in grid.checks])
    exact = np.array([numbers_of(state) for *_, state in grid.checks])
    errors = _largest_by_depth(grid, points[:, 0], np.abs(table.at(points) - exact)[:, :7])
    if grid.failed_checks:
        failed = np.array(grid.failed_checks)
        errors[_interval(grid, failed[np.isfinite(table.at(failed)[:, 0]), 0])] = np.nan
    table.values[..., WIDTHS] += _at_depths(grid, errors, roots)[:, None]
    return table, errors


def _interval(grid: Grid, roots: Array) -> Ints:
    return np.asarray(np.clip(np.searchsorted(grid.roots, roots) - 1, 0, len(grid.roots) - 2), np.int64)


def _largest_by_depth(grid: Grid, roots: Array, errors: Array) -> Array:
    """Return the largest errors (n, q) of checks at r in each interval of the depth; NaN where none is known."""
    largest = np.full((len(grid.roots) - 1, errors.shape[1]), np.nan)
    for k, row in zip(_interval(grid, roots), errors, strict=True):
        largest[k] = np.fmax(largest[k], row)
    return largest


def _at_depths(grid: Grid, errors: Array, roots: Array) -> Array:
    """Return errors by interval of the depth at r, shape (len(roots), q): at an edge the larger one of both sides."""
    sides = [errors[_interval(grid, roots + side)] for side in (-1e-9, 1e-9)]
    return np.asarray(np.fmax(*sides))


def plane(grid: Grid, response: Table) -> Table:
    """Return the answers in the plane of the shear: response, half widths, status and formulas of all levels."""
    from scipy.spatial import KDTree

    D, (roots, shears) = grid.design.D, response.axes
    scale = np.array([grid.roots[1], grid.shears[1]])
    nearest = KDTree(np.array([one[:2] for one in grid.states]) / scale)

    def answer(i: int, j: int) -> Data:
        root, shear = float(roots[i]), float(shears[j])
        load = Load(root**2 * D, shear, friction="stick" if shear else "none")
        r, s, state = grid.states[nearest.query([root, shear] / scale)[1]]
        where = f"The nearest solved state ({r**2 * D:.3g} mm deep, sheared by {s:.3g} mm)"
        data, widths = in_direction(response.values[i, j], 0.0)
        return {
            "response": state_answers.response_data(data),
            "estimates": widths,
            "status": state.status,
            "message": f"{where}: {state.message}." if state.message else "",
            "formulas": {level: state_answers.formula(grid.design, load, level) for level in beam.LEVELS},
        }

    return tabulated(response.axes, answer)


def in_direction(numbers: Array, angle: float) -> tuple[Response, Data]:
    """Return the response and its half widths in a direction, degrees, from the numbers of a shear along x."""
    x, _, z, u, _, w, tilt, _, radius, *half = numbers.tolist()
    c, s, lean = math.cos(math.radians(angle)), math.sin(math.radians(angle)), math.radians(tilt)
    response = Response((c * x, s * x, z), (c * u, s * u, w), c * lean, radius, s * lean)
    a, b = abs(c), abs(s)
    force, shift = ([a * side, b * side, up] for side, up in ((half[0], half[2]), (half[3], half[5])))
    return response, {
        "force": None if math.isnan(half[2]) else force,
        "shift": None if math.isnan(half[5]) else shift,
        "tilt": None if math.isnan(half[6]) else half[6],
        "contact_radius": None,
    }


def outputs(design: Design, numbers: Array, direction: Array) -> Array:
    """Return the outputs of the Hall elements, and 1 for each that is at a rail, shape (..., 2 k)."""
    angle, tilt = np.radians(direction), np.radians(numbers[..., 6])
    c, s = np.cos(angle), np.sin(angle)
    shift = np.stack([c * numbers[..., 3], s * numbers[..., 3], numbers[..., 5]], axis=-1).reshape(-1, 3)
    turn = np.stack(rotation_of(c * tilt, s * tilt), axis=-1).reshape(-1, 2)
    read = batch_readings([design], np.zeros(len(shift), dtype=np.int64), shift, turn)
    flat = np.concatenate([read.output, np.where(np.isnan(read.output), np.nan, read.saturated)], axis=1)
    return flat.reshape(*numbers.shape[:-1], 2 * design.element_count)


def readings(grid: Grid) -> tuple[Table, Array]:
    """Return the readings over depth, shear and direction, and the largest error of each reading at the checks."""
    count = grid.design.element_count
    roots, shears, turn = refined(grid.roots, READ[0]), refined(grid.shears, READ[1]), directions(READ[2])
    values = np.repeat(grid.at(roots, shears)[:, :, None], len(turn), axis=2)
    read = outputs(grid.design, values, np.broadcast_to(turn, values.shape[:-1]))
    table = Table((roots, shears, turn), read, {"volts": [0] * count, "saturated": [0] * count})
    points, exact = _checks(grid)
    largest = np.zeros(count)
    # each element has its error in other directions than its neighbours
    for angle in (turn[1:] + turn[:-1]) / 2:
        points[:, 2] = angle
        off = np.abs(table.at(points) - outputs(grid.design, exact, points[:, 2]))[:, :count]
        largest = np.fmax(largest, np.nanmax(off, axis=0))
    return table, largest


def _checks(grid: Grid) -> tuple[Array, Array]:
    """Return the checks with a direction each, between the nodes of all tables, and their numbers."""
    turn = (np.arange(len(grid.checks)) + 0.5) * 360 / READ[2] % 360
    points = np.array([[root, shear, angle] for (root, shear, _), angle in zip(grid.checks, turn, strict=True)])
    return points, np.array([numbers_of(state) for *_, state in grid.checks])


def decoded(grid: Grid, response: Table, reading_errors: Array) -> tuple[Table, Array]:
    """Return the half widths of the readings, and the decoded load with its force along, across and up the shear.

    Returns
    -------
    The table, and the errors of the decoded force across z and along it, N, by interval of the depth, shape (n, 2);
    NaN where no check tells.
    """
    design = grid.design
    decoder = state_answers.build_decoder(design)
    axes = (refined(grid.roots, DECODED[0]), refined(grid.shears, DECODED[1]), directions(DECODED[2]))
    points = np.stack(np.meshgrid(*axes[:2], indexing="ij"), axis=-1)
    nodes = response.at(points.reshape(-1, 2)).reshape(*points.shape[:-1], -1)

    @functools.cache
    def at(i: int, j: int, k: int) -> Data:
        return _decoded(design, decoder, nodes[i, j], float(axes[2][k]))

    # without a shear all directions are one, and the last one is the first
    table = tabulated(axes, lambda i, j, k: at(i, j, k % (len(axes[2]) - 1) if j else 0))
    places, exact = _checks(grid)
    exact[:, WIDTHS] = np.nan
    forces = [
        _decoded(design, decoder, row, angle)["decoded"]["force"]
        for row, angle in zip(exact, places[:, 2].tolist(), strict=True)
    ]
    k = len(reading_errors)
    off = np.abs(table.at(places)[:, k : k + 3] - np.array(forces))
    off = np.stack([np.hypot(off[:, 0], off[:, 1]), off[:, 2]], axis=1)
    errors = _largest_by_depth(grid, places[:, 0], off)
    table.values[..., :k] += reading_errors
    table.values[..., k + 3 : k + 6] += _at_depths(grid, errors, axes[0])[:, None, None, [0, 0, 1]]
    return table, errors


def _decoded(design: Design, decoder: Decoder | None, numbers: Array, angle: float) -> Data:
    """Return what the live page shows in a direction, degrees; unknown numbers are NaN."""
    one, widths = in_direction(numbers, angle)
    part: Data = {"status": "out_of_workspace", "level": state_answers.DECODER_LEVEL}
    unknown = [math.nan] * 3
    read = state_answers.readings(design, one, widths) if np.isfinite(numbers[RESPONSE]).all() else None
    if read is None or "volts" not in read:
        read = {"half_width": None}
    elif decoder is not None:
        part = state_answers.decoded(decoder, one, widths)
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    x, y, z = part.get("force") or unknown
    return {
        "half_width": read["half_width"] or [math.nan] * design.element_count,
        "decoded": {
            "status": part["status"],
            "level": part["level"],
            "force": [c * x + s * y, c * y - s * x, z],
            "half_width": part.get("half_width") or unknown,
            "noise": part.get("noise") or unknown,
        },
    }


def pictures(grid: Grid, magnet: Magnet) -> Data:
    """Return displacements, pressures and stretches of stored states on one template, and the template.

    A state is interpolated to the points of the section and the skin of the deepest press. Where none was solved
    stands the nearest one with less shear or depth, and the last channel is 1.
    """
    design = grid.design
    roots, shears = grid.roots[:: PICTURED[0]], grid.shears[:: PICTURED[1]]
    template = next(state for _, shear, state in reversed(grid.states) if not shear)
    section, surface = state_pictures.section(design, template, magnet), state_pictures.surface(template)["parts"]
    still_field = replace(template.field, u=0 * template.field.u, p=0 * template.field.p)
    rest = replace(template, load=Load(), response=REST, field=still_field)
    skin = state_pictures.surface(rest)["parts"]
    still = skin[SKIN]["points"].reshape(-1, 3)
    place = {(round(root, 9), round(shear, 9)): state for root, shear, state in grid.states}
    count = 4 * len(section["rest"]) + still.size + 1
    values = np.full((len(roots), len(shears), count), np.nan)
    for i, root in enumerate(roots.tolist()):
        for j, shear in enumerate(shears.tolist()):
            state = place.get((round(root, 9), round(shear, 9)))
            if state is not None:
                on_section = _on_section(design, state, section["rest"], magnet)
                on_skin = (
                    state_pictures.surface(_on_mesh(state, template))["parts"][SKIN]["points"].reshape(-1, 3) - still
                )
                values[i, j] = np.concatenate([on_section.ravel(), on_skin.ravel(), [0.0]])
    # at rest
    values[0, 0] = 0.0
    values[0, 0, 3 * len(section["rest"]) : 4 * len(section["rest"])] = 1.0
    for i, j in np.argwhere(np.isnan(values[..., 0])).tolist():
        values[i, j] = values[i, j - 1] if j else values[i - 1, j]
        values[i, j, -1] = 1.0
    return {
        "table": Table((roots, shears), values).data(),
        "rest": section["rest"],
        "triangles": section["triangles"],
        "skin": {"points": still, "triangles": surface[SKIN]["triangles"]},
        "pocket": {key: skin["magnet"][key] for key in ("points", "triangles")} if "magnet" in skin else None,
        "outline": state_pictures.magnet_outline(design, 0.0, 0.0, 0.0) if magnet == "rigid" else None,
        "lines": state_pictures.field_lines(design, rest)["lines"],
    }


def _on_mesh(solution: Solution, template: Solution) -> Solution:
    field, mesh = solution.field, template.field.mesh
    u = _interpolated(field.mesh.doflocs.T, field.u, mesh.doflocs.T)
    return replace(solution, field=replace(field, mesh=mesh, u=u))


def _interpolated(points: Array, values: Array, at: Array) -> Array:
    """Return values (n, q) at points (n, 2) interpolated to other points; outside, those of the nearest point."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    inside = LinearNDInterpolator(points, values)(at)
    # rounding puts some points of the outline outside
    return np.asarray(np.where(np.isnan(inside), NearestNDInterpolator(points, values)(at), inside))


def _on_section(design: Design, solution: Solution, template: Array, magnet: Magnet) -> Array:
    """Return displacement along x and z, mm, pressure, MPa, and stretch at the template's points, shape (4, n)."""
    part = state_pictures.section(design, solution, magnet)
    rest, moved, fields = part["rest"], part["points"], part["fields"]
    columns = np.stack([*(moved - rest).T, fields["pressure"], fields["stretch"]], axis=1)
    result = np.empty((len(template), columns.shape[1]))
    # both sides of the axis have the same count of points; a value there may differ from side to side
    for own, theirs in zip(_sides(len(rest)), _sides(len(template)), strict=True):
        points, first = np.unique(rest[own], axis=0, return_index=True)
        result[theirs] = _interpolated(points, columns[own][first], template[theirs])
    return result.T


def _sides(count: int) -> tuple[slice, slice]:
    return slice(0, count // 2), slice(count // 2, count)


def elements(design: Design) -> Data | None:
    """Return what does not change of the readings; None without a magnet."""
    rest = state_answers.readings(design, REST, {"shift": None, "tilt": None})
    if rest is None or "volts" not in rest:
        return rest
    return {name: rest[name] for name in ("elements", "units", "rest", "high")}
