"""Tables of the decoder in C: the magnet's field as splines, starts for the search of poses, and the mechanics.

The field of a body of revolution needs two functions of two variables: B_r / r and B_z over the distance r from the
magnet's axis and the height z. Each is a sum of products of cubic B-splines, fitted to exact fields. The grid of
starts is that of `analytic.inverse.pose_search` in 16 bits, with fewer cells, whose linear maps C computes from their
corners.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.cylinder import compiled_functions
from analytic.decode import Decoder, told_slopes
from analytic.hall import plates_of
from analytic.inverse import pose_search
from analytic.inverse.forward_model import magnets_at, readings_at, readings_with_slopes
from analytic.inverse.response_surface import force_and_load
from analytic.parts import with_noise
from analytic.shear_terms import softening
from analytic.time_series import least_jumps
from geometry.arrays import Array
from geometry.design import BadInput
from geometry.relaxation import moduli, relaxation_of

MARGIN, FOLD_MARGIN, CHIPS_MARGIN = 0.3, 0.2, 0.45
"""Margins of cells, as in `analytic.inverse.pose_search`: without a fold in the workspace, with one, where more
starts take more time, and for more than three readings, whose linear map fits less."""
POWERS, LARGEST_TILT = 7, 2.0
"""Powers of the series of cos and sin, and the angle, rad, up to which they have the digits of float."""
STEPS = 24_000
"""Range of the readings at the nodes, in steps of 16 bits; the rest is for margins."""
POSES = 4000
"""Poses of the workspace at which the errors of tables are looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """Constants of the decoder in C by their names, and the number of their bytes.

    Attributes
    ----------
    floats, integers : arrays as the template names them.
    cells : number of cells of the grid of starts along x, y, z.
    """

    floats: dict[str, Array]
    integers: dict[str, NDArray[Any]]
    cells: tuple[int, int, int]

    @property
    def size(self) -> int:
        return sum(4 * a.size for a in self.floats.values()) + sum(a.nbytes for a in self.integers.values())


def tables_of(
    coder: Decoder,
    cells: tuple[int, int, int],
    knots: tuple[int, int],
    doubt: float,
    unsure: Callable[[Array], Array] | None = None,
    warming: Mapping[str, Array] = {},
) -> Tables:
    """Return the tables of a decoder with mechanics.

    Parameters
    ----------
    cells : number of cells of the grid of starts along x, y and z.
    knots : number of coefficients of the field along r and z.
    doubt : share by which the branches may be off.
    unsure : half widths of the force (n, 3), N, at shifts (n, 3), by a calibration.
    warming : constants of its temperature, if its bench had one.

    Raises
    ------
    BadInput
        The field is infinite at a place where an element may be.
    """
    field, table = _field_tables(coder, knots)
    grids, integers = _start_tables(coder, cells)
    integers |= _places(coder) | {"table": table}
    floats = {**field, **grids, **_mechanics(coder), **_relaxation(coder, doubt), **warming}
    if unsure is not None:
        nodes = np.indices([n + 1 for n in cells]).reshape(3, -1).T
        # roots need few bits over a wide range
        roots = np.sqrt(unsure(grids["origin"] + grids["edge"] * nodes))
        integers["unsure"], floats["unsure_step"] = rounded_up(roots)
    floats["places"] = plates_of(coder.forward.elements)[0] - [0.0, 0.0, coder.forward.design.H]
    floats = {name: np.asarray(values, dtype=np.float32) for name, values in floats.items()}
    return Tables(floats, integers, cells)


def rounded_up(values: Array) -> tuple[NDArray[np.uint8], float]:
    """Return values as multiples of a step, rounded up to 0 to 255, and the step; what is not finite is the largest.

    >>> numbers, step = rounded_up(np.array([0.0, 0.125, 0.646, np.nan]))
    >>> numbers.tolist(), round(255 * step, 3)
    ([0, 50, 255, 255], 0.646)
    """
    largest = float(values[np.isfinite(values)].max())
    # the largest over itself is 1 exactly; 255 times it over it may be more than 255, which would wrap to 0
    shares = np.where(np.isfinite(values), values, largest) / largest
    return np.ceil(255 * shares).astype(np.uint8), largest / 255


def places_of(coder: Decoder, shift: Array) -> tuple[Array, Array, Array, Array]:
    """Return where the elements' points lie in the magnet's frame at shifts (3, n), each of shape (n, m).

    Returns
    -------
    distance from the axis and height, mm, and the components of their directions across and along the axis.
    """
    elements = coder.forward.elements
    points, owners = plates_of(elements)
    normals = np.array([e.direction for e in elements])[owners]
    moved, m = magnets_at(coder.forward, shift)
    x = points - [0.0, 0.0, coder.forward.design.H] - moved[:, None]
    zeta = (x * m[:, None]).sum(axis=2)
    across = x - zeta[..., None] * m[:, None]
    rho = np.linalg.norm(across, axis=2)
    on_u = (across * normals).sum(axis=2) / np.where(rho > 0, rho, 1.0)
    return rho, zeta, on_u, m @ normals.T


def _unit_fields(coder: Decoder, rho: Array, zeta: Array) -> tuple[Array, Array]:
    """Return -J times B_r / r (T/mm) and B_z (T) of the unit magnet at places (r, z), mm, shape (n, m) each."""
    functions, kernel = compiled_functions(), coder.forward.kernel
    radius, half, J, series, disc = kernel[6:]
    values = np.empty((2, len(rho), len(zeta)))
    for i, r in enumerate(rho.tolist()):
        for j, z in enumerate(zeta.tolist()):
            place = functions.lengths(r, 0.0, z, radius, half)
            values[:, i, j] = functions.unit_field(place, half / radius, series, disc, False)[:2]
    if not np.isfinite(values).all():
        raise BadInput("an element may touch the magnet's rim, where the field is infinite: raise l0")
    return J * values[0] / radius, J * values[1]


def _basis(count: int, places: Array) -> Array:
    """Return the values of `count` uniform cubic B-splines at places 0 to count - 3, shape (n, count)."""
    row = np.clip(np.floor(places), 0, count - 4).astype(int)
    x = places - row
    a = np.stack([(1 - x) ** 3, 4 + x * x * (3 * x - 6), 1 + 3 * x * (1 + x * (1 - x)), x**3], axis=1) / 6
    values = np.zeros((len(places), count))
    np.put_along_axis(values, row[:, None] + np.arange(4), a, axis=1)
    return values


def _field_tables(coder: Decoder, knots: tuple[int, int]) -> tuple[dict[str, Array], NDArray[np.uint8]]:
    """Return splines of the field, one for all elements that see the same part of it, and the number of each one's.

    Returns
    -------
    grid : origin and knots per mm of r and z. spline : coefficients (table, r, z, 2).
    """
    shift = np.stack(np.meshgrid(*np.linspace(*_reach(coder), 11).T, indexing="ij")).reshape(3, -1)
    owners, seen = plates_of(coder.forward.elements)[1], []
    for values in places_of(coder, shift)[:2]:
        ends = np.array(
            [(values[:, owners == k].min(), values[:, owners == k].max()) for k in range(owners.max() + 1)]
        )
        pad = 0.02 * np.ptp(ends, axis=1)
        seen.append(ends + pad[:, None] * [-1, 1])
    ranges = np.round(np.concatenate(seen, axis=1), 6)
    ranges[:, 0] = np.maximum(ranges[:, 0], 0.0)
    ranges, table = np.unique(ranges, axis=0, return_inverse=True)
    # three samples between two knots
    at = [np.linspace(0, n - 3, 3 * (n - 3) + 1) for n in knots]
    inverse = [np.linalg.pinv(_basis(n, t)) for n, t in zip(knots, at, strict=True)]
    splines, grids = [], []
    for r0, r1, z0, z1 in ranges.tolist():
        values = np.stack(_unit_fields(coder, r0 + (r1 - r0) * at[0] / at[0][-1], z0 + (z1 - z0) * at[1] / at[1][-1]))
        splines.append(np.einsum("ia,kab,jb->ijk", inverse[0], values, inverse[1]))
        grids.append((r0, (knots[0] - 3) / (r1 - r0), z0, (knots[1] - 3) / (z1 - z0)))
    return {"grid": np.array(grids), "spline": np.array(splines)}, table.reshape(-1).astype(np.uint8)


def _reach(coder: Decoder) -> tuple[Array, Array]:
    """Return the box in which the iteration moves: the way to a pose inside may lead a little outside."""
    pad = 0.05 * (coder.high - coder.low)
    return coder.low - pad, coder.high + pad


def _start_tables(coder: Decoder, cells: tuple[int, int, int]) -> tuple[dict[str, Array], dict[str, NDArray[Any]]]:
    """Return readings at the nodes of a grid over the workspace in steps, boxes of cells, and which have a fold."""
    pad = 0.01 * (coder.high - coder.low)
    low, high = coder.low - pad, coder.high + pad
    edge, nodes = (high - low) / cells, [n + 1 for n in cells]
    shifts = low + edge * np.indices(nodes).reshape(3, -1).T
    readings, slopes = readings_with_slopes(coder.forward, shifts.T.copy())
    # readings are turned into what a linear map takes for the shift: then few boxes of cells overlap
    told = coder.goal.free @ readings if len(coder.goal.free) else readings
    linear = np.linalg.lstsq(np.vstack([told, np.ones(len(shifts))]).T, (shifts - low) / edge, rcond=None)[0].T
    if len(coder.goal.free):
        linear[:, :-1] = linear[:, :-1] @ coder.goal.free
    places = linear[:, :-1] @ readings + linear[:, -1:]
    side = np.linalg.det(np.einsum("ik,jkn->nij", linear[:, :-1], slopes)) > 0
    middle, reach = (places.max(axis=1) + places.min(axis=1)) / 2, np.ptp(places, axis=1) / 2
    to_steps = (linear - np.outer(middle, np.arange(linear.shape[1]) == len(readings))) * (STEPS / reach)[:, None]
    steps = np.round(to_steps[:, :-1] @ readings + to_steps[:, -1:]).astype(np.int16).T
    where = np.indices(cells).reshape(3, -1).T
    corner = np.ravel_multi_index(tuple((where[:, None] + pose_search.CORNERS).T), nodes).T
    at, signs = steps[corner].astype(float), side[corner]
    least, most = at.min(axis=1), at.max(axis=1)
    folded = (signs != signs[:, :1]).any(axis=1)
    margin = margin_of(coder) * (most - least)
    boxes = np.stack([np.floor(least - margin) - 1, np.ceil(most + margin) + 1], axis=2).reshape(-1, 6)
    integers = {
        "nodes": steps,
        "boxes": np.clip(boxes, -32768, 32767).astype(np.int16),
    }
    if len(coder.table.corners):
        integers["folded"] = np.packbits(folded, bitorder="little")
    floor, roof = _reach(coder)
    ends = {"low": coder.low, "high": coder.high, "floor": floor, "roof": roof}
    return {"to_steps": to_steps, "origin": low, "edge": edge, **ends}, integers


def margin_of(coder: Decoder) -> float:
    if len(coder.forward.elements) > 3:
        return CHIPS_MARGIN
    return FOLD_MARGIN if len(coder.table.corners) else MARGIN


def _places(coder: Decoder) -> dict[str, NDArray[Any]]:
    points, owners = plates_of(coder.forward.elements)
    new = np.append(True, (np.diff(points, axis=0) != 0).any(axis=1))
    dithered = [e.noise > 0 and e.noise >= e.step for e in coder.forward.elements]
    return {
        name: np.asarray(v, np.uint8) for name, v in (("owner", owners), ("new_place", new), ("dithered", dithered))
    }


def _mechanics(coder: Decoder) -> dict[str, Any]:
    law, elements = coder.mechanics, coder.forward.elements
    assert law is not None
    rest = readings_at(coder.forward, np.zeros((3, 1)))
    (tau, least, most), offset, tilt = coder.forward.kernel[4]
    # beyond its range, tau nears a limit as far off as the range is wide
    angle = math.hypot(*_reach(coder)[1][:2]) * max(abs(2 * most - least), abs(2 * least - most))
    angle += math.hypot(*tilt)
    if not angle <= LARGEST_TILT:
        raise BadInput(
            f"the magnet may tilt by {angle:.2g} rad in the workspace, more than {LARGEST_TILT:g} rad: give solved "
            "states (--responses) over the loads that you need"
        )
    deepest = abs(law.normal @ (-law.sink) ** np.arange(law.normal.shape[1]))[0]
    return {
        "normals": [e.direction for e in elements],
        "output": [(e.null, e.gain) for e in elements],
        "rails": [(e.low, e.high) for e in elements],
        "noise": [e.noise_T for e in with_noise(elements)[0]],
        "rest": rest[:, 0],
        "tolerance": coder.goal.tolerance,
        **({} if coder.field_fit is None else {"field_fit": coder.field_fit}),
        "least_jump": least_jumps(coder),
        "tau": tau,
        # as in `analytic.inverse.forward_model.place_magnets`
        "offset": offset,
        "leaning": (tilt[1], -tilt[0]),
        "lean_range": (least, most),
        # of cos and of sin over the angle
        "series": [[(-1) ** n / math.factorial(2 * n + k) for n in range(POWERS)] for k in (0, 1)],
        "lateral": law.lateral,
        "normal": law.normal,
        "depth": law.depth,
        "shear": law.shear,
        # as in `response_surface.force_and_load`
        "least": (law.errors[2] + law.slack + 1e-9 * deepest, 1e-9 * law.sink),
        "fit_error": np.array([law.errors[1], law.errors[1], law.errors[2]]) / 2,
    }


def _relaxation(coder: Decoder, doubt: float) -> dict[str, Any]:
    design = coder.forward.design
    branches = relaxation_of(design)
    # C has no empty arrays
    rows = [(1 / tau, g / branches.rest) for g, tau in zip(branches.shares, branches.times, strict=True)] or [
        (1.0, 0.0)
    ]
    slow = moduli(design)[1] / design.E_now
    return {"branches": rows, "slow": (slow, softening(design), slow / branches.rest, doubt)}


def errors_of(coder: Decoder, tables: Tables, shift: Array | None = None) -> tuple[float, float, float]:
    """Return the largest errors of shift, mm, and force, N, that the splines cause, and the largest force, N.

    They follow from the errors of the readings at poses with a force, by the slopes there; NaN without such poses.

    shift : (n, 3), mm; default: random ones of the workspace.
    """
    if shift is None:
        shift = np.random.default_rng(0).uniform(coder.low, coder.high, (POSES, 3))
    shift = np.ascontiguousarray(shift.T)
    assert coder.mechanics is not None
    force, _, by_shift = force_and_load(coder.mechanics, shift)
    known = np.isfinite(force[2])
    if not known.any():
        return math.nan, math.nan, math.nan
    shift, force, by_shift = shift[:, known].copy(), force[:, known], by_shift[..., known]
    exact, slopes = readings_with_slopes(coder.forward, shift)
    rho, zeta, on_u, on_m = places_of(coder, shift)
    read = np.empty_like(exact)
    for k in range(len(exact)):
        own = plates_of(coder.forward.elements)[1] == k
        table = tables.integers["table"][k]
        spline, (r0, r, z0, z) = tables.floats["spline"][table], tables.floats["grid"][table]
        across, along = (
            (values[:, own].ravel() - zero) * step for values, zero, step in ((rho, r0, r), (zeta, z0, z))
        )
        bases = _basis(spline.shape[0], across), _basis(spline.shape[1], along)
        lean, up = np.einsum("ai,ijk,aj->ka", bases[0], spline, bases[1]).reshape(2, *rho[:, own].shape)
        read[k] = (lean * rho[:, own] * on_u[:, own] + up * on_m[:, own]).mean(axis=1)
    # a uniform field that is rejected lies in the null space of the told slopes' pseudo-inverse
    moves = (np.linalg.pinv(told_slopes(coder, slopes).transpose(2, 1, 0)) @ (read - exact).T[..., None])[..., 0]
    off = np.einsum("jin,nj->ni", by_shift, moves)
    return float(np.abs(moves).max()), float(np.abs(off).max()), float(np.abs(force).max())
