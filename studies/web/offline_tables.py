"""Numbers and pictures of the page without a server: states of a design, solved beforehand, and what lies between.

**States** over depth and shear, by finite elements. Presses are frictionless; a shear begins at a press whose
contact area is then bonded. The nodes of the depth d are evenly spaced in r = (d/D)^(1/2), as the contact radius and
the cubes of the force are nearly. With the shear s, the value of a quantity between the nodes is

    q(r, s) = q(r, 0) + [q(r, s) - q(r, 0)],

the press by a cubic spline over r through many presses, the bracket by cubic splines first over s, then over r. No
value is given in a cell that has a node without a solved state. `Grid.checks` are further states in the middle of the
cells, for which the finite elements are solved as well: they measure the error of whatever is read from the grid.

**Tables** over depth, shear and direction. The page interpolates linearly between the nodes of a table and does
nothing else to a number, but for turning vectors into the direction of the shear. Readings, formulas and the decoded
load are computed at the nodes by the functions of the live page. The half widths are those of the error estimates
and, added to them, the errors of the interpolation, measured at the checks of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import beam
from analytic.hall import ELEMENTS, batch_readings
from fem.accuracy import STANDARD, Accuracy
from fem.equilibrium import trace
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet, Response, rotation_of
from geometry.messages import Progress
from studies.web import state_answers, state_pictures

if TYPE_CHECKING:
    from fem.solution import Solution

DEEPEST, FARTHEST = 0.375, 0.375
"""Largest depth and shear over D, less where the silicone on the axis ends before."""
ROWS, COLUMNS, PRESSES = 16, 6, 4
"""Intervals of r and of the shear, and presses per interval of r: a press takes a hundredth of a row of shears."""
FIRST_ROW = 4
"""First row with shears; below, the plate of this stroke barely touches the tip, and a bonded one peels off."""
SHALLOWEST = 0.01
"""Least depth of a check, mm: the step of the page's slider."""
QUANTITIES = ("force_t", "force_n", "shift_t", "shift_n", "tilt", "contact_radius")
"""Quantities in the plane of the shear: force and shift along it and along z, N and mm, tilt, degrees, and mm."""
WIDTHS = ("force_t", "force_n", "shift", "tilt")
"""Half widths that the error estimates of the finite elements give."""
FINE = 8, 4
"""Intervals of the table of the response per interval of the grid, along depth and shear."""
READ = 2, 2, 48
"""The same for the readings, with the number of directions."""
DECODED = 2, 2, 12
"""The same for the decoded load, which takes a millisecond a node and grows with a power of the depth."""
PICTURED = 2, 2
"""Intervals of the grid per interval of the pictures."""
OF_FORMULAS = len(QUANTITIES)
SKIN = "back"
"""The half of the skin that is stored; the other one is its mirror image."""

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
    press, rows : `QUANTITIES` and `WIDTHS` of the presses, shape (p, 10), and at the nodes of rows and shears, shape
        (n, m, 10).
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

    def at(self, roots: Array, shears: Array) -> tuple[Array, Array]:
        """Return quantities and half widths at all pairs of r and shear, shapes (a, b, 6) and (a, b, 4)."""
        values, widths = (
            between(self.press_roots, self.press[:, part], roots, degree)[:, None]
            + self._change((self.rows - self.rows[:, :1])[..., part], roots, shears, degree)
            for part, degree in ((slice(len(QUANTITIES)), 3), (slice(len(QUANTITIES), None), 1))
        )
        values[..., 5] = np.maximum(values[..., 5], 0.0)
        return values, np.maximum(widths, 0.0)

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
    progress: Progress | None = None,
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
    middle = (press_roots[1:] + press_roots[:-1]) / 2
    wanted = [(root, 0.0) for root in middle[middle**2 * D >= SHALLOWEST].tolist()]
    checks = path(wanted, estimate=False)
    # the deeper a press, the longer the path of its shears
    total = roots[first:].sum() + ((roots[first + 1 :] + roots[first:-1]) / 2).sum()
    done = 0.0
    for k in range(first, len(roots)):
        if progress is not None:
            progress(done / total, f"finite elements at depth {roots[k] ** 2 * D:.3g} mm")
        states += path([(float(roots[k]), shear) for shear in shears[1:].tolist()], estimate=True)
        done += roots[k]
        if k + 1 < len(roots):
            root = float(roots[k] + roots[k + 1]) / 2
            between_shears = [(root, shear) for shear in ((shears[1:] + shears[:-1]) / 2).tolist()]
            checks += path(between_shears, estimate=False)
            wanted += between_shears
            done += root
    states, checks = ([one for one in some if one[2].status in ANSWERED] for some in (states, checks))
    if len(states) < 2:
        raise BadInput("no press of this design could be solved: the page needs its states")
    answered = {(root, shear) for root, shear, _ in checks}
    failed = [place for place in wanted if place not in answered]
    return _grid(design, (roots, shears, press_roots), states, checks, failed)


def quantities(solution: Solution) -> Array:
    """Return `QUANTITIES` of a state that is sheared along x."""
    response = solution.response
    force, shift = response.force, response.shift
    return np.array(
        [force[0], force[2], shift[0], shift[2], math.degrees(response.tilt), response.contact_radius], dtype=float
    )


def _widths(solution: Solution) -> Array:
    widths = state_answers.half_widths(solution)
    force, shift, tilt = widths["force"], widths["shift"], widths["tilt"]
    known = force is not None and shift is not None
    # an upright press has no tilt
    tilt = 0.0 if not solution.response.tilt else math.nan if tilt is None else tilt
    return np.array([force[0], force[2], shift[2], tilt] if known else [np.nan] * 4)


def _grid(
    design: Design,
    nodes: tuple[Array, Array, Array],
    states: list[State],
    checks: list[State],
    failed_checks: list[Place],
) -> Grid:
    roots, shears, press_roots = nodes
    press = np.full((len(press_roots), len(QUANTITIES) + len(WIDTHS)), np.nan)
    rows = np.full((len(roots), len(shears), press.shape[1]), np.nan)
    press[0] = 0.0
    for root, shear, state in states:
        values = np.concatenate([quantities(state), _widths(state)])
        if shear:
            rows[np.argmin(np.abs(roots - root)), np.argmin(np.abs(shears - shear))] = values
        else:
            press[np.argmin(np.abs(press_roots - root))] = values
    rows[:, 0] = press[:: (len(press_roots) - 1) // (len(roots) - 1)]
    return Grid(design, roots, shears, press_roots, press, rows, states, checks, failed_checks)


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Values at the nodes of axes; NaN where there is none, as between such nodes.

    Attributes
    ----------
    axes : nodes of each axis, evenly spaced.
    values : shape (*lengths of the axes, channels).
    """

    axes: tuple[Array, ...]
    values: Array

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
        return {"axes": axes, "channels": self.values.shape[-1], "values": self.values.astype(np.float32)}


def refined(nodes: Array, number: int) -> Array:
    """Return evenly spaced nodes with each interval divided."""
    return np.linspace(nodes[0], nodes[-1], (len(nodes) - 1) * number + 1)


def directions(number: int) -> Array:
    """Return directions of a full turn, its end included, degrees."""
    return np.linspace(0.0, 360.0, number + 1)


def measured(grid: Grid) -> tuple[Array, Array]:
    """Return the largest errors of the response, interpolated by spline and table, at the checks.

    Returns
    -------
    share : by interval of the depth; of force and shift over the lengths of the vectors, of the force along the
        shear and of the tilt over themselves, as far as there is a shear; in the order of `WIDTHS`, NaN where
        no check tells.
    absolute : of each of `QUANTITIES` at any check.
    """
    table, _ = _response(grid)
    points = np.array([check[:2] for check in grid.checks])
    exact = np.array([quantities(state) for *_, state in grid.checks])
    off = np.abs(table.at(points) - exact)
    force, shift = (np.hypot(exact[:, k], exact[:, k + 1]) for k in (0, 2))
    sheared = points[:, 1] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.stack(
            [
                np.where(sheared, off[:, 0] / np.abs(exact[:, 0]), 0.0),
                np.hypot(off[:, 0], off[:, 1]) / force,
                np.hypot(off[:, 2], off[:, 3]) / shift,
                np.where(sheared, off[:, 4] / np.abs(exact[:, 4]), 0.0),
            ],
            axis=1,
        )
    largest = _largest_by_depth(grid, points[:, 0], share)
    if grid.failed_checks:
        failed = np.array(grid.failed_checks)
        largest[_interval(grid, failed[np.isfinite(table.at(failed)[:, 0]), 0])] = np.nan
    return largest, np.nanmax(off, axis=0)


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


def _response(grid: Grid) -> tuple[Table, Array]:
    roots, shears = refined(grid.roots, FINE[0]), refined(grid.shears, FINE[1])
    values, widths = grid.at(roots, shears)
    return Table((roots, shears), values), widths


def response(grid: Grid, share: Array) -> Table:
    """Return quantities and half widths of the finite elements with the errors of the interpolation, 10 channels."""
    table, widths = _response(grid)
    share, values = _at_depths(grid, share, table.axes[0])[:, None], np.abs(table.values)
    force, shift = np.hypot(values[..., 0], values[..., 1]), np.hypot(values[..., 2], values[..., 3])
    size = np.stack([values[..., 0], force, shift, values[..., 4]], axis=-1)
    return replace(table, values=np.concatenate([table.values, widths + share * size], axis=-1))


def formulas(design: Design, axes: tuple[Array, ...]) -> tuple[Table, Ints, list[str]]:
    """Return `QUANTITIES` of each level of the formulas, and the number of each level's remark at each node."""
    levels, texts = beam.LEVELS, [""]
    roots, shears = axes
    values = np.full((len(roots), len(shears), len(levels) * OF_FORMULAS), np.nan)
    remarks = np.zeros((len(roots), len(shears), len(levels)), dtype=np.int64)
    for i, root in enumerate(roots):
        for j, shear in enumerate(shears):
            load = Load(root**2 * design.D, float(shear), friction="stick" if shear else "none")
            for k, level in enumerate(levels):
                part = state_answers.formula(design, load, level)
                if part["message"] not in texts:
                    texts.append(part["message"])
                remarks[i, j, k] = texts.index(part["message"])
                if part["force"] is not None:
                    force, shift = part["force"], part["shift"]
                    values[i, j, k * OF_FORMULAS : (k + 1) * OF_FORMULAS] = (
                        *(force[0], force[2], shift[0], shift[2]),
                        *(part["tilt"], part["contact_radius"]),
                    )
    return Table(axes, values), remarks, texts


def statuses(grid: Grid, axes: tuple[Array, ...]) -> tuple[Ints, list[list[str]]]:
    """Return the number of status and message of the solved state nearest to each node, and these texts."""
    from scipy.spatial import KDTree

    D, step = grid.design.D, np.array([grid.roots[1], grid.shears[1]])
    texts = [["ok", ""]]
    numbers = []
    for root, shear, state in grid.states:
        message = state.message
        if message:
            message = f"The nearest solved state ({root**2 * D:.3g} mm deep, sheared by {shear:.3g} mm): {message}."
        if [state.status, message] not in texts:
            texts.append([state.status, message])
        numbers.append(texts.index([state.status, message]))
    places = np.array([one[:2] for one in grid.states])
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return np.array(numbers)[KDTree(places / step).query(nodes / step)[1]], texts


def poses(values: Array, direction: Array) -> tuple[Array, Array]:
    """Return shift (..., 3) and rotation vector (..., 2) of `QUANTITIES` (..., 6) in directions, degrees."""
    angle, tilt = np.radians(direction), np.radians(values[..., 4])
    c, s = np.cos(angle), np.sin(angle)
    shift = np.stack([c * values[..., 2], s * values[..., 2], values[..., 3]], axis=-1)
    return shift, np.stack(rotation_of(c * tilt, s * tilt), axis=-1)


def outputs(design: Design, values: Array, direction: Array) -> Array:
    """Return the outputs of the Hall elements, and 1 for each that is at a rail, shape (..., 2 ELEMENTS)."""
    shift, turn = (part.reshape(-1, part.shape[-1]) for part in poses(values, direction))
    read = batch_readings([design], np.zeros(len(shift), dtype=np.int64), shift, turn)
    flat = np.concatenate([read.output, np.where(np.isnan(read.output), np.nan, read.saturated)], axis=1)
    return flat.reshape(*values.shape[:-1], 2 * ELEMENTS)


def readings(grid: Grid) -> tuple[Table, Array]:
    """Return the readings over depth, shear and direction, and the largest error of each reading at the checks."""
    roots, shears, turn = refined(grid.roots, READ[0]), refined(grid.shears, READ[1]), directions(READ[2])
    values = np.repeat(grid.at(roots, shears)[0][:, :, None], len(turn), axis=2)
    table = Table((roots, shears, turn), outputs(grid.design, values, np.broadcast_to(turn, values.shape[:-1])))
    points, exact = _checks(grid)
    largest = np.zeros(ELEMENTS)
    # each element has its error in other directions than its neighbours
    for angle in (turn[1:] + turn[:-1]) / 2:
        points[:, 2] = angle
        off = np.abs(table.at(points) - outputs(grid.design, exact, points[:, 2]))[:, :ELEMENTS]
        largest = np.fmax(largest, np.nanmax(off, axis=0))
    return table, largest


def _checks(grid: Grid) -> tuple[Array, Array]:
    """Return the checks with a direction each, between the nodes of all tables, and their quantities."""
    turn = (np.arange(len(grid.checks)) + 0.5) * 360 / READ[2] % 360
    points = np.array([[root, shear, angle] for (root, shear, _), angle in zip(grid.checks, turn, strict=True)])
    return points, np.array([quantities(state) for *_, state in grid.checks])


def decoded(grid: Grid, response: Table, reading_errors: Array) -> tuple[Table, Ints, list[str], Array]:
    """Return what the live page shows of readings and decoded load, with the errors of the interpolation.

    The channels are the half widths of the readings (3), then the decoded force along the shear, across and along z
    (3), its half widths (3) and noise (3), along x, y and z.

    Returns
    -------
    The table, the number of the decoder's status at each node, the names of the statuses, and the errors of the
    decoded force across z and along it, N, by interval of the depth, shape (n, 2); NaN where no check tells.
    """
    design = grid.design
    decoder = state_answers.build_decoder(design)
    axes = (refined(grid.roots, DECODED[0]), refined(grid.shears, DECODED[1]), directions(DECODED[2]))
    values, names = np.full((*map(len, axes), 12), np.nan), ["out_of_workspace"]
    status = np.zeros(values.shape[:-1], dtype=np.int64)
    points = np.stack(np.meshgrid(*axes[:2], indexing="ij"), axis=-1)
    nodes = response.at(points.reshape(-1, 2)).reshape(*points.shape[:-1], -1)
    for i, j in np.argwhere(np.isfinite(nodes[..., 0])).tolist():
        for k, angle in enumerate(axes[2].tolist()):
            if k and (not j or k == len(axes[2]) - 1):
                # without a shear all directions are one, and the last one is the first
                values[i, j, k], status[i, j, k] = values[i, j, 0], status[i, j, 0]
                continue
            name, channels = _decoded(design, decoder, nodes[i, j], angle)
            values[i, j, k] = channels
            values[i, j, k, :ELEMENTS] += reading_errors
            if name not in names:
                names.append(name)
            status[i, j, k] = names.index(name)
    errors = _decoding_errors(grid, decoder, Table(axes, values))
    values[..., 6:9] += _at_depths(grid, errors, axes[0])[:, None, None, [0, 0, 1]]
    return Table(axes, values), status, names, errors


def _decoding_errors(grid: Grid, decoder: Any, table: Table) -> Array:
    points, exact = _checks(grid)
    forces = np.array(
        [
            _decoded(grid.design, decoder, np.append(row, np.full(len(WIDTHS), np.nan)), angle)[1][3:6]
            for row, angle in zip(exact, points[:, 2].tolist(), strict=True)
        ]
    )
    off = np.abs(table.at(points)[:, 3:6] - forces)
    return _largest_by_depth(grid, points[:, 0], np.stack([np.hypot(off[:, 0], off[:, 1]), off[:, 2]], axis=1))


def _decoded(design: Design, decoder: Any, node: Array, angle: float) -> tuple[str, Array]:
    """Return status and channels of a node of the response in a direction, degrees."""
    tangential, normal, u, w, tilt, radius, *half = node.tolist()
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    lean = math.radians(tilt)
    one = Response((c * tangential, s * tangential, normal), (c * u, s * u, w), c * lean, radius, s * lean)
    aside = (abs(c), abs(s)) if tangential else (0.0, 0.0)
    known = not math.isnan(half[2])
    widths: Data = {
        "shift": [half[2] * aside[0], half[2] * aside[1], half[2]] if known else None,
        "tilt": None if math.isnan(half[3]) else half[3],
    }
    channels = np.full(12, np.nan)
    read = state_answers.readings(design, one, widths)
    if read is None or "volts" not in read:
        return "out_of_workspace", channels
    if read["half_width"] is not None:
        channels[:3] = read["half_width"]
    if decoder is None:
        return "out_of_workspace", channels
    part = state_answers.decoded(decoder, one, widths)
    if part["force"] is not None:
        x, y, z = part["force"]
        channels[3:6] = c * x + s * y, c * y - s * x, z
    for start, name in ((6, "half_width"), (9, "noise")):
        if part[name] is not None:
            channels[start : start + 3] = part[name]
    return part["status"], channels


def pictures(grid: Grid, magnet: Magnet) -> Data:
    """Return displacements, pressures and stretches of stored states on one template, and the template.

    A state is interpolated to the points of the section and the skin of the deepest press. Where none was solved
    stands the nearest one with less shear or depth, and the last channel is 1.
    """
    design = grid.design
    roots, shears = grid.roots[:: PICTURED[0]], grid.shears[:: PICTURED[1]]
    template = next(state for _, shear, state in reversed(grid.states) if not shear)
    section, surface = state_pictures.section(design, template, magnet), state_pictures.surface(template)["parts"]
    rest = _at_rest(template)
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


def _at_rest(solution: Solution) -> Solution:
    response = Response((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0)
    field = replace(solution.field, u=0 * solution.field.u, p=0 * solution.field.p)
    return replace(solution, load=Load(), response=response, field=field)


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
    still = Response((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0)
    rest = state_answers.readings(design, still, {"shift": None, "tilt": None})
    if rest is None or "volts" not in rest:
        return rest
    names: Sequence[str] = ("elements", "units", "rest", "noise", "low", "high")
    return {name: rest[name] for name in names}
