"""States of one design over depth and shear, solved by finite elements, and what lies between them.

Presses are frictionless; a shear begins at a press whose contact area is then bonded. The nodes of the depth d are
evenly spaced in r = (d/D)^(1/2), as the contact radius and the cubes of the force are nearly. With the shear s, the
value of a quantity between the nodes is

    q(r, s) = q(r, 0) + [q(r, s) - q(r, 0)],

the press by a cubic spline over r through many presses, the bracket by cubic splines first over s, then over r. No
value is given in a cell that has a node without a solved state.

`Grid.checks` are further states in the middle of the cells, for which the finite elements are solved as well: they
measure the error of whatever is read from the grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fem.accuracy import STANDARD, Accuracy
from fem.equilibrium import trace
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress
from studies.explorer.state_answers import half_widths

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


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Solved states of a design; NaN where there is none.

    Attributes
    ----------
    roots, shears : nodes r of the rows, and of the shear, mm; `press_roots` are those of the presses.
    press, press_widths : `QUANTITIES` and `WIDTHS` of the presses, shapes (p, 6) and (p, 4).
    values, widths : those at the nodes of rows and shears, shapes (n, m, 6) and (n, m, 4).
    states : the solutions with their place (r, shear).
    checks : states in the middle of the cells, in the same form.
    failed_checks : places of those without an answer.
    """

    design: Design
    roots: Array
    shears: Array
    press_roots: Array
    press: Array
    press_widths: Array
    values: Array
    widths: Array
    states: list[tuple[float, float, Solution]]
    checks: list[tuple[float, float, Solution]]
    failed_checks: list[tuple[float, float]]

    def at(self, roots: Array, shears: Array) -> tuple[Array, Array]:
        """Return quantities and half widths at all pairs of r and shear, shapes (a, b, 6) and (a, b, 4)."""
        values, widths = (
            between(self.press_roots, press, roots, degree)[:, None]
            + self._change(rows - rows[:, :1], roots, shears, degree)
            for press, rows, degree in ((self.press, self.values, 3), (self.press_widths, self.widths, 1))
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

    def path(root: float, to: Array, *, estimate: bool) -> list[tuple[float, float, Solution]]:
        loads = [Load(root**2 * D, float(shear), friction="stick") for shear in to]
        states = trace(design, loads, accuracy, magnet=magnet, estimate=estimate)
        return [(root, float(shear), state) for shear, state in zip(to.tolist(), states, strict=False)]

    def presses(at: Array, *, estimate: bool) -> list[tuple[float, float, Solution]]:
        loads = [Load(root**2 * D) for root in at]
        states = trace(design, loads, accuracy, magnet=magnet, estimate=estimate)
        return [(float(root), 0.0, state) for root, state in zip(at, states, strict=False)]

    states = presses(press_roots[1:], estimate=True)
    middle = (press_roots[1:] + press_roots[:-1]) / 2
    middle = middle[middle**2 * D >= SHALLOWEST]
    checks = presses(middle, estimate=False)
    wanted = [(float(root), 0.0) for root in middle]
    # the deeper a press, the longer the path of its shears
    total = roots[first:].sum() + ((roots[first + 1 :] + roots[first:-1]) / 2).sum()
    done = 0.0
    for k in range(first, len(roots)):
        if progress is not None:
            progress(done / total, f"finite elements at depth {roots[k] ** 2 * D:.3g} mm")
        states += path(roots[k], shears[1:], estimate=True)
        done += roots[k]
        if k + 1 < len(roots):
            root = (roots[k] + roots[k + 1]) / 2
            between_shears = (shears[1:] + shears[:-1]) / 2
            checks += path(root, between_shears, estimate=False)
            wanted += [(root, float(shear)) for shear in between_shears]
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
    widths = half_widths(solution)
    force, shift, tilt = widths["force"], widths["shift"], widths["tilt"]
    known = force is not None and shift is not None
    # an upright press has no tilt
    tilt = 0.0 if not solution.response.tilt else math.nan if tilt is None else tilt
    return np.array([force[0], force[2], shift[2], tilt] if known else [np.nan] * 4)


def _grid(
    design: Design,
    nodes: tuple[Array, Array, Array],
    states: list[tuple[float, float, Solution]],
    checks: list[tuple[float, float, Solution]],
    failed_checks: list[tuple[float, float]],
) -> Grid:
    roots, shears, press_roots = nodes
    press, widths = (
        np.full((len(press_roots), len(QUANTITIES)), np.nan),
        np.full((len(press_roots), len(WIDTHS)), np.nan),
    )
    values = np.full((len(roots), len(shears), len(QUANTITIES)), np.nan)
    row_widths = np.full((len(roots), len(shears), len(WIDTHS)), np.nan)
    press[0] = widths[0] = 0.0
    for root, shear, state in states:
        if shear:
            place = int(np.argmin(np.abs(roots - root))), int(np.argmin(np.abs(shears - shear)))
            values[place], row_widths[place] = quantities(state), _widths(state)
        else:
            row = int(np.argmin(np.abs(press_roots - root)))
            press[row], widths[row] = quantities(state), _widths(state)
    every = (len(press_roots) - 1) // (len(roots) - 1)
    values[:, 0], row_widths[:, 0] = press[::every], widths[::every]
    return Grid(design, roots, shears, press_roots, press, widths, values, row_widths, states, checks, failed_checks)
