"""Readings of the Hall elements for a displaced and tilted magnet. Lengths in mm, angles in rad, B in T.

An element measures B.n averaged over its plate, with an ambient field added to B. The average uses 2 x 2 Gauss
points, which are exact for fields up to third order. The output is null + gain B.n plus noise, rounded to the
converter's steps and limited by the rails; `analytic.reading_noise` has the noise of the average of several samples.
The field is that of a sharp-edged cylinder magnet in air. It ignores the edge radius, iron nearby and the recoil
permeability, of which a value of 1.05 weakens the field by 1.7 % everywhere outside.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.magnet import cylinder_field, dipole_field, paper_field
from analytic.parts import Element, common_values, of_design
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Response

__all__ = ["Readings", "elements", "field_at", "readings"]

Mode = Literal["component", "magnitude"]
Field = Literal["exact", "paper", "paper-printed", "dipole"]
FLIP = np.array([1.0, -1.0, -1.0])
"""Half a turn about x, from the magnet's frame to the sensor's: the north pole points down. The polarisation of a
magnet whose north pole points up is negative."""
SITE = attrgetter(
    *("D", "L", "magnet_diameter", "magnet_height", "hall_layout"),
    *("l0", "f", "c", "hall_plate", "chip_x", "chip_count"),
)
"""Returns the fields of a design that fix the field of its magnet at its elements, but for the remanence."""
FIELDS: tuple[Field, ...] = ("exact", "paper", "paper-printed", "dipole")
"""Models of the magnet's field, see `field_at`."""


@dataclass(frozen=True, slots=True)
class Readings:
    """Readings of the elements in their order; default: S1, S2 and S3.

    Attributes
    ----------
    B_T : flux density that the element measures, T: B.n, or |B| in the paper's mode.
    output : output of the element, null + gain B, in whole steps and within the rails; V, or T for a chip.
    saturated : whether the output lies at a rail, where it no longer depends on the magnet's pose.
    units : unit of each output, "V" or "T".
    """

    B_T: tuple[float, ...]
    output: tuple[float, ...]
    saturated: tuple[bool, ...]
    units: tuple[str, ...]

    @property
    def V(self) -> tuple[float, ...]:
        """Outputs in V; NaN for a chip, which sends flux densities."""
        return tuple(v if unit == "V" else math.nan for v, unit in zip(self.output, self.units, strict=True))


def elements(design: Design) -> tuple[Array, Array]:
    """Return positions and directions n of the elements, S1, S2 and S3 or those of each chip, shape (k, 3), mm and 1.

    The directions are -z, +x and +y because the magnet's north pole points down. B points down below the magnet and
    away from the axis beside it, so at rest all three outputs lie above the null voltage (S2 and S3 only if l0 > c;
    otherwise their signs are reversed). S1 grows when the magnet sinks, S2 when it moves towards +x, and S3 when it
    moves towards +y. S2 and S3 have a maximum, since straight above the element its component of B is 0. For the
    preset `paper` S2 has its maximum at a shift of 2.1 mm, and at 2.5, 2.9 and 3.1 mm if the magnet is 1, 2 and 3 mm
    lower. A chip measures along the same three directions, at one position. If the north pole points up
    (`magnet_north`), all fields have the opposite sign: the outputs lie as far on the other side of the null voltage.
    """
    layout = of_design(design)
    positions = np.array([element.position for element in layout])
    directions = np.array([element.direction for element in layout])
    return positions, directions


def field_at(
    points: ArrayLike,
    design: Design,
    shift: ArrayLike = (0.0, 0.0, 0.0),
    tilt: ArrayLike = (0.0, 0.0),
    *,
    field: Field = "exact",
    refuse: bool = True,
) -> Array:
    """Return B at points of the sensor's frame, for a displaced and tilted magnet.

    Parameters
    ----------
    points : shape (n, 3), mm, fixed in space.
    shift : displacement of the magnet's centre, shape (3,) or one for each point (n, 3), mm.
    tilt : rotation vector (rx, ry) of the magnet about its centre, shape (2,) or (n, 2), rad; rz has no effect on
        a body of revolution. A positive ry carries z towards x, as `Response.tilt` does; a positive rx carries z
        towards -y.
    field : "exact" (closed form), "paper" (quadrature of the paper's equation (3), outside the magnet only),
        "paper-printed" (equation (3) with its misprint), or "dipole".
    refuse : False for NaN where the exact field is not defined.

    Returns
    -------
    shape (n, 3), T.

    Raises
    ------
    BadInput
        The design has no magnet, a value is not finite or has a wrong shape, or a point lies where the field is not
        defined (see `cylinder_field`, `paper_field`).
    """
    if not design.shape.has_magnet:
        raise BadInput(
            "this design has no magnet (magnet_diameter is 0), so there is no field to read: give it a magnet"
        )
    if field not in FIELDS:
        raise BadInput(f"field must be one of {', '.join(FIELDS)}; got {field!r}")
    local = in_magnet_frame(points, design, shift, tilt)
    magnet = design.magnet_diameter / 2, design.magnet_height, design.polarisation
    if field == "exact":
        b = cylinder_field(local, *magnet, refuse=refuse)
    elif field == "dipole":
        b = dipole_field(local, *magnet)
    else:
        rho = np.hypot(local[:, 0], local[:, 1])
        b_z, b_rho = paper_field(rho, local[:, 2], *magnet, printed=field == "paper-printed")
        b = np.column_stack([*(local[:, :2].T * (b_rho / np.where(rho > 0, rho, 1.0))), b_z])
    return rotated(FLIP * b, _rows("tilt", tilt, 2, len(local)))


def in_magnet_frame(
    points: ArrayLike, design: Design, shift: ArrayLike = (0.0, 0.0, 0.0), tilt: ArrayLike = (0.0, 0.0)
) -> Array:
    """Return points of the sensor's frame in the displaced magnet's frame, shape (n, 3), mm; z points from the tip
    to the base, along its magnetisation if the north pole points down.

    Parameters and errors as in `field_at`.
    """
    where = _rows("points", points, 3, single=False)
    vector = _rows("tilt", tilt, 2, len(where))
    moved = where - [0.0, 0.0, design.H] - _rows("shift", shift, 3, len(where))
    return np.asarray(FLIP * rotated(moved, -vector))


def readings(
    design: Design,
    response: Response | None = None,
    *,
    shift: tuple[float, float, float] | None = None,
    tilt: tuple[float, float] | None = None,
    mode: Mode = "component",
    field: Field = "exact",
    elements: Sequence[Element] | None = None,
    ambient: tuple[float, float, float] = (0.0, 0.0, 0.0),
    noise: np.random.Generator | None = None,
) -> Readings:
    """Return the readings for a response, or for a shift and a tilt of the magnet; default: at rest.

    Parameters
    ----------
    response : response with the magnet's shift and tilt.
    shift, tilt : as in `field_at`, instead of a response.
    mode : "component" for B.n, which a real element measures, or "magnitude" for the paper's equation (4),
        sqrt(B_Z^2 + B_rho^2).
    field : as in `field_at`.
    elements : elements to read; default: those of the design's layout.
    ambient : uniform field in the sensor's frame that adds to the magnet's, T (the Earth's is about 5e-5).
    noise : generator that draws the noise of one reading, which may be the average of several samples; without it the
        outputs have no noise.

    Raises
    ------
    BadInput
        Both a response and a pose are given, the mode is unknown, the ambient field is not finite, or `field_at`
        refuses an argument.
    """
    if mode not in ("component", "magnitude"):
        raise BadInput(f"mode must be component or magnitude; got {mode!r}")
    if response is not None:
        if shift is not None or tilt is not None:
            raise BadInput("give a response, or a shift and a tilt, not both")
        shift, tilt = response.shift, response.rotation
    at = (0.0, 0.0, 0.0) if shift is None else shift
    chosen = of_design(design) if elements is None else tuple(elements)
    points, owners = plates_of(chosen)
    b = field_at(points, design, at, (0.0, 0.0) if tilt is None else tilt, field=field)
    b = b + _rows("ambient", ambient, 3)
    (measured,) = means_over_plates(b, chosen, owners, mode)
    gain, null, low, high, step = _values(chosen, "gain", "null", "low", "high", "step")
    raw = null + gain * measured
    output, saturated = converted(raw, low, high, step) if noise is None else averaged(chosen, raw, noise)
    units = tuple(element.unit for element in chosen)
    return Readings(tuple(measured.tolist()), tuple(output.tolist()), tuple(saturated.tolist()), units)


@dataclass(frozen=True, slots=True, eq=False)
class BatchReadings:
    """Readings of the k elements of n rows; NaN, and not saturated, where there is no reading.

    Attributes
    ----------
    field_T : flux density B.n that each element measures, shape (n, k), T.
    output : output of each element, in whole steps and within the rails, shape (n, k), V, or T for a chip.
    saturated : whether the output lies at a rail, shape (n, k).
    """

    field_T: Array
    output: Array
    saturated: NDArray[np.bool_]


def batch_readings(
    designs: Sequence[Design], owner: NDArray[np.int64], shift: Array, tilt: Array, offset: Array | None = None
) -> BatchReadings:
    """Return the values of `readings` for n rows, up to rounding; row i belongs to the design `designs[owner[i]]`.

    Designs whose magnets and elements have the same sizes and places share one call of the field, so that those which
    differ in E, in the remanence or in gains cost little.

    Parameters
    ----------
    owner : index of each row's design, shape (n,).
    shift : displacement of the magnet's centre, shape (n, 3), mm; NaN for no pose.
    tilt : rotation vectors (rx, ry) as in `field_at`, shape (n, 2), rad; NaN for no pose.
    offset : displacement of each element from its place in the design, shape (n, k, 3), mm; default: 0.

    Returns
    -------
    BatchReadings
        NaN for all elements of a row without a pose or a magnet, or with a point on the magnet's rim, where the
        field is infinite; and where other designs have more elements.
    """
    width = max((design.element_count for design in designs), default=3)
    if not len(owner):
        empty = np.zeros((0, width))
        return BatchReadings(empty, empty, empty > 0)
    common = np.array([common_values(design) for design in designs])
    numbers: dict[tuple[float | str, ...], int] = {}
    # by a dictionary of fields, because the positions would cost a sweep over E more than all else
    site_of = np.array([numbers.setdefault(SITE(design), len(numbers)) for design in designs])
    sites = [designs[k] for k in np.unique(site_of, return_index=True)[1]]
    posed = np.isfinite(np.hstack([shift, tilt])).all(axis=1)
    posed &= np.array([design.shape.has_magnet for design in sites])[site_of[owner]]
    order = np.argsort(site_of[owner], kind="stable")
    rows = order[posed[order]]
    measured = np.full((len(owner), width), np.nan)
    plates = [plates_of(of_design(design)) for design in sites]
    counts = np.array([len(points) for points, _ in plates])
    for count in np.unique(counts).tolist():
        alike = rows[counts[site_of[owner[rows]]] == count]
        moved = None if offset is None else offset[alike]
        values = _along_elements(sites, plates, site_of[owner[alike]], shift[alike], tilt[alike], moved)
        values[np.isnan(values).any(axis=1)] = np.nan
        measured[alike, : values.shape[1]] = values
    measured *= np.array([design.polarisation for design in designs])[owner, None]
    gain, null, low, high, _, step, _ = common[owner].T[:, :, None]
    output, saturated = converted(null + gain * measured, low, high, step)
    return BatchReadings(measured, output, saturated)


def _along_elements(
    sites: Sequence[Design], plates: Sequence[tuple[Array, NDArray[np.int64]]], site: NDArray[np.int64],
    shift: Array, tilt: Array, offset: Array | None,
) -> Array:  # fmt: skip
    """Return what the elements measure over the polarisation, shape (n, k), in poses that are sorted by their site.

    The plates of all these sites have as many points.
    """
    if not len(site):
        return np.zeros((0, 0))
    start = np.flatnonzero(np.diff(site, prepend=-1))
    owners = plates[site[0]][1]
    points = np.array([plates[k][0] - [0.0, 0.0, sites[k].H] for k in site[start]])
    moved = np.repeat(points, np.diff(start, append=len(site)), axis=0) - shift[:, None]
    if offset is not None:
        moved += offset[:, owners]
    local, turn = FLIP * rotated(moved, -tilt[:, None]), tilt[:, None]
    for low, high in itertools.pairwise([*start.tolist(), len(site)]):
        design, part = sites[site[low]], local[low:high]
        size = design.magnet_diameter / 2, design.magnet_height, design.polarisation
        part[:] = cylinder_field(part.reshape(-1, 3), *size, refuse=False).reshape(part.shape)
    b = rotated(FLIP * local, turn).reshape(-1, 3)
    polarisation = np.array([design.polarisation for design in sites])[site]
    return np.asarray(means_over_plates(b, of_design(sites[site[0]]), owners) / polarisation[:, None])


def means_over_plates(
    b: Array, elements: Sequence[Element], owners: NDArray[np.int64], mode: Mode = "component"
) -> Array:
    """Return what k elements measure, shape (n, k), T, from B at the points of their plates in n poses, (n m, 3), T.

    owners : index of the element of each of the m points of a pose, as `plates_of` returns it, ascending.
    """
    directions = np.array([element.direction for element in elements])[owners]
    at = b.reshape(-1, len(owners), 3)
    values = np.linalg.norm(at, axis=2) if mode == "magnitude" else (at * directions).sum(axis=2)
    counts = np.bincount(owners)
    return np.asarray(np.add.reduceat(values, np.cumsum(counts) - counts, axis=1) / counts)


def plates_of(elements: Sequence[Element]) -> tuple[Array, NDArray[np.int64]]:
    """Return the points at which plates sample the field, shape (n, 3), mm, and the index of each point's element."""
    points, owners = [], []
    for k, element in enumerate(elements):
        corners = [element.position]
        if element.plate:
            normal = np.array(element.direction)
            # the axis farthest from the normal gives a well-conditioned direction in the plate
            aside = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
            # from the centre to a Gauss point of a side of length 1
            aside /= 2 * math.sqrt(3) * np.linalg.norm(aside)
            x, y = element.plate * aside, element.plate * np.cross(normal, aside)
            corners = [tuple(element.position + i * x + j * y) for i in (-1, 1) for j in (-1, 1)]
        points += corners
        owners += [k] * len(corners)
    return np.array(points, dtype=np.float64).reshape(-1, 3), np.array(owners, dtype=np.int64)


def converted(raw: Array, low: Array, high: Array, step: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return outputs in whole steps and within the rails, and whether each lies at a rail; all arrays broadcast.

    `raw` is the output before the converter; a step of 0 means no converter.
    """
    # the converter rounds before the rails limit: a rail need not be a whole number of steps
    rounded = np.where(step > 0, np.round(raw / np.where(step > 0, step, 1.0)) * step, raw)
    return np.clip(rounded, low, high), (raw <= low) | (raw >= high)


def averaged(elements: Sequence[Element], raw: Array, noise: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
    """Return the averages of noisy samples through the converter, and whether any sample lies at a rail; (..., k).

    `raw` are the outputs of the k elements without noise, before the converter, shape (..., k).
    """
    low, high, step, rms, floor, count = _values(elements, "low", "high", "step", "noise", "floor", "average")
    most, slow = int(count.max()), bool(floor.any())
    draws = noise.standard_normal((*raw.shape[:-1], most + slow, raw.shape[-1]))
    # the noise of an average is common to its samples
    common = floor * draws[..., most:, :] if slow else 0.0
    samples, at_rails = converted(raw[..., None, :] + common + rms * draws[..., :most, :], low, high, step)
    # elements may average different numbers of samples
    used = np.arange(most)[:, None] < count
    return (samples * used).sum(axis=-2) / count, np.asarray((at_rails & used).any(axis=-2))


def _values(elements: Sequence[Element], *names: str) -> list[Array]:
    return [np.array([getattr(element, name) for element in elements]) for name in names]


def rails(elements: Sequence[Element]) -> Array:
    """Return the fields from which outputs lie at their lower and upper rails, shape (k, 2), T.

    They are nearer by a rounding error, which must not hide that an output lies at a rail.
    """
    null, gain, low, high = _values(elements, "null", "gain", "low", "high")
    slack = 1e-12 * (high - low)
    # in rows, as those of a calibration: the search of poses is compiled for one order
    return np.sort((np.column_stack([low + slack, high - slack]) - null[:, None]) / gain[:, None], axis=1)


def at_rail(elements: Sequence[Element], field: Array) -> NDArray[np.bool_]:
    """Return whether the output of each element lies at a rail, shape (k, n), from B.n of the elements (k, n), T."""
    low, high = rails(elements).T[:, :, None]
    return np.asarray((field <= low) | (field >= high))


def rotated(vectors: Array, tilt: Array) -> Array:
    """Return vectors (..., 3) rotated by the rotation vectors (rx, ry, 0), tilt (..., 2): Rodrigues' formula.

    The leading axes of both broadcast.
    """
    axis = np.concatenate([tilt, np.zeros_like(tilt[..., :1])], axis=-1)
    angle = np.linalg.norm(axis, axis=-1, keepdims=True)
    along = (axis * vectors).sum(axis=-1, keepdims=True)
    # sinc keeps both factors, sin(t)/t and (1 - cos t)/t^2, finite at t = 0
    first, second = np.sinc(angle / math.pi), np.sinc(angle / (2 * math.pi)) ** 2 / 2
    rotated = vectors * np.cos(angle) + first * np.cross(axis, vectors) + second * along * axis
    return np.asarray(rotated, dtype=np.float64)


def _rows(name: str, values: ArrayLike, width: int, count: int = 0, *, single: bool = True) -> Array:
    """Return the values as finite floats, shape (n, width), or (width,) where a single row is allowed."""
    rows = np.asarray(values, dtype=np.float64)
    shapes = f"({width},) or ({count}, {width})" if single else f"(n, {width})"
    fits = (rows.shape == (width,) or rows.shape == (count, width)) if single else rows.shape[1:] == (width,)
    if not fits:
        raise BadInput(f"{name} must have shape {shapes}; got {rows.shape}")
    if not np.isfinite(rows).all():
        raise BadInput(f"{name} must be finite; got a NaN or an infinity")
    return rows
