"""Deformed sections of one design for the page without a server: finite elements over a grid of depths and shears.

All lengths are over D, pressures over E. Every state is interpolated to the points of one template, the section of a
press, so that the page can interpolate between states point by point. Presses are frictionless; shears begin at a
press whose contact area is then bonded. Level quick suffices for pictures, because the page's numbers come from the
surrogate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.explorer import offline_data, section_data

if TYPE_CHECKING:
    from fem.solution import Solution

DEPTHS = (0.01, 0.03, 0.07, 0.125, 0.195, 0.28, 0.375)
"""Depths over D: evenly spaced in their roots, like the contact radius; a shear begins at the second one."""
SHEARS = (0.0, 0.08, 0.17, 0.27, 0.375)
"""Shears over D."""
FIELDS = ("u_x", "u_z", "pressure", "stretch")
FULL = 32767
"""Largest 16-bit integer: a field is stored in steps of its largest magnitude over this."""


@dataclass(frozen=True, slots=True)
class Sections:
    """Sections over depths and shears.

    Attributes
    ----------
    rest : points of the template, both sides of the axis in the same order, shape (n, 2), over D.
    triangles : shape (m, 3).
    depths, shears : nodes of the grid, over D.
    values : `FIELDS` at the points, shape (depths, shears, 4, n); NaN where there is no state.
    """

    rest: Array
    triangles: Ints
    depths: tuple[float, ...]
    shears: tuple[float, ...]
    values: Array


def solve(
    design: Design,
    depths: Sequence[float] = DEPTHS,
    shears: Sequence[float] = SHEARS,
    progress: Progress | None = None,
) -> Sections:
    """Solve for the sections of a design; a path that stops early leaves the states beyond without values.

    Raises
    ------
    BadInput
        Not even the lightest press was solved.
    """
    room = 0.9 * (design.L - design.magnet_height) / design.D
    depths = tuple(depth for depth in depths if depth < room)
    presses = _solved(design, [Load(depth=depth * design.D) for depth in depths])
    if not presses:
        raise BadInput("no press of this design could be solved: the page needs its sections")
    shape = section_data.section(design, presses[-1], "rigid")
    template = np.array(shape["rest"]) / design.D
    values = np.full((len(depths), len(shears), len(FIELDS), len(template)), np.nan)
    for i, depth in enumerate(depths):
        if progress is not None:
            progress(i / len(depths), f"sections at depth {depth * design.D:.3g} mm")
        loads = [Load(depth * design.D, shear * design.D, friction="stick") for shear in shears[1:]] if i else []
        states = [*presses[i : i + 1], *(_solved(design, loads) if i < len(presses) else [])]
        for j, state in enumerate(states):
            values[i, j] = _at_points(design, state, template)
    return Sections(template, np.array(shape["triangles"]), depths, tuple(shears), values)


def data(design: Design, sections: Sections) -> dict[str, Any]:
    """Return the sections as `StoredSections` in the page reads them."""
    known = np.isfinite(sections.values).all(axis=(2, 3))
    values = np.nan_to_num(sections.values)
    scale = np.abs(values).max(axis=(0, 1, 3))
    scale[scale == 0] = 1.0
    steps = np.round(values / scale[:, None] * FULL).astype(np.int64)
    return {
        "design": {name: getattr(design, name) / design.D for name in ("L", "magnet_diameter", "magnet_height")}
        | {"nu": design.nu},
        "rest": offline_data.floats(sections.rest),
        "triangles": offline_data.integers(sections.triangles),
        "depths": list(sections.depths),
        "shears": list(sections.shears),
        "known": known.tolist(),
        "scale": (scale / FULL).tolist(),
        "values": offline_data.integers(steps),
    }


def _solved(design: Design, loads: Sequence[Load]) -> list[Solution]:
    """Return the states along a path of loads, up to the first that was not solved."""
    from fem.accuracy import QUICK
    from fem.equilibrium import trace

    if not loads:
        return []
    states = trace(design, loads, QUICK, estimate=False)
    return [state for state in states if state.status in ("ok", "unstable")]


def _at_points(design: Design, solution: Solution, template: Array) -> Array:
    """Return `FIELDS` of a solution at the points of the template, shape (4, n)."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    part = section_data.section(design, solution, "rigid")
    rest, moved = np.array(part["rest"]), np.array(part["points"])
    columns = [
        *(moved - rest).T / design.D,
        np.array(part["fields"]["pressure"]) / design.E,
        part["fields"]["stretch"],
    ]
    fields, rest = np.stack(columns, axis=1), rest / design.D
    result = np.empty((len(template), len(FIELDS)))
    # both sides of the axis have the same count of points; a value there may differ from side to side
    for own, theirs in zip(_sides(len(rest)), _sides(len(template)), strict=True):
        points, first = np.unique(np.round(rest[own], 9), axis=0, return_index=True)
        values, at = fields[own][first], template[theirs]
        inside = LinearNDInterpolator(points, values)(at)
        # rounding puts some points of the outline outside
        nearest = NearestNDInterpolator(points, values)(at)
        result[theirs] = np.where(np.isnan(inside), nearest, inside)
    return result.T


def _sides(count: int) -> tuple[slice, slice]:
    return slice(0, count // 2), slice(count // 2, count)
