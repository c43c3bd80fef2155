"""What the Hall elements read when the magnet has moved. Lengths in mm, angles in rad, B in T.

An element reads B.n, averaged over its plate (2 x 2 Gauss points, so that the average is exact to third order), with
an ambient field added. Its output is null + gain B.n, plus noise, kept between the rails, rounded to the converter's
steps. The field is that of the sharp-edged cylinder magnet in air: its edge radius, its recoil permeability (1.05
weakens the field by 1.7 % everywhere outside) and iron nearby are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.magnet import cylinder_field, dipole_field, paper_field
from analytic.parts import Element, of_design
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Response

Mode = Literal["component", "magnitude"]
Field = Literal["exact", "paper", "paper-printed", "dipole"]
FLIP = np.array([1.0, -1.0, -1.0])
"""Half a turn about x: the magnet's north pole points down."""
FIELDS: tuple[Field, ...] = ("exact", "paper", "paper-printed", "dipole")


@dataclass(frozen=True, slots=True)
class Readings:
    """What the elements read, in their order: S1, S2 and S3 unless others are given.

    Attributes
    ----------
    B_T : the flux density that the element responds to, T: B.n, or |B| in the paper's mode.
    output : what the element gives, null + gain B, between the rails and in whole steps; V, or T for a chip.
    saturated : whether the output lies at a rail, so that it no longer tells where the magnet is.
    units : "V" or "T" for each output.
    """

    B_T: tuple[float, ...]
    output: tuple[float, ...]
    saturated: tuple[bool, ...]
    units: tuple[str, ...]

    @property
    def V(self) -> tuple[float, ...]:
        """The outputs in V; NaN for a chip, which sends flux densities."""
        return tuple(v if unit == "V" else math.nan for v, unit in zip(self.output, self.units, strict=True))


def elements(design: Design) -> tuple[Array, Array]:
    """Where S1, S2 and S3 sit, shape (3, 3), mm, and the unit vectors along which they read, shape (3, 3).

    The directions -z, +x and +y follow from the magnet's north pole pointing down. Under it B points down, and
    below its plane B leans away from the axis, so at rest all three outputs lie above the null voltage (S2 and S3
    need l0 > c; else their signs turn round). S1 grows when the magnet sinks. S2 grows when the magnet moves towards
    +x, and S3 towards +y, but not without end: straight above the element that component is 0 again. With the preset
    `paper`, S2 peaks at a shift of 2.1 mm, and at 2.5, 2.9 and 3.1 mm with the magnet 1, 2 and 3 mm lower. A chip
    reads along the same three directions, all at one place.
    """
    found = of_design(design)
    positions = np.array([element.position for element in found])
    directions = np.array([element.direction for element in found])
    return positions, directions


def field_at(
    points: ArrayLike,
    design: Design,
    shift: ArrayLike = (0.0, 0.0, 0.0),
    tilt: ArrayLike = (0.0, 0.0),
    *,
    field: Field = "exact",
) -> Array:
    """B at points of the sensor's frame, with the magnet displaced.

    Parameters
    ----------
    points : shape (n, 3), mm, fixed in space.
    shift : displacement of the magnet's centre, shape (3,) or one for each point (n, 3), mm.
    tilt : rotation vector (rx, ry) of the magnet about its centre, shape (2,) or (n, 2), rad; rz would change
        nothing. A positive ry carries z towards x, as `Response.tilt` does; a positive rx carries z towards -y.
    field : "exact" (closed form), "paper" (quadrature of the paper's equation (3), outside the magnet only),
        "paper-printed" (the same with its misprint), or "dipole".

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
    magnet = design.magnet_diameter / 2, design.magnet_height, design.remanence
    if field == "exact":
        b = cylinder_field(local, *magnet)
    elif field == "dipole":
        b = dipole_field(local, *magnet)
    else:
        b = _paper_vectors(local, *magnet, printed=field == "paper-printed")
    return _rotated(FLIP * b, _rows("tilt", tilt, 2, len(local)))


def in_magnet_frame(
    points: ArrayLike, design: Design, shift: ArrayLike = (0.0, 0.0, 0.0), tilt: ArrayLike = (0.0, 0.0)
) -> Array:
    """Points of the sensor's frame, seen from the displaced magnet, z along its magnetisation; shape (n, 3), mm.

    Parameters and errors as for `field_at`.
    """
    where = _rows("points", points, 3, single=False)
    vector = _rows("tilt", tilt, 2, len(where))
    moved = where - [0.0, 0.0, design.H] - _rows("shift", shift, 3, len(where))
    return np.asarray(FLIP * _rotated(moved, -vector))


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
    """The readings for a response, or for a shift and a tilt of the magnet; at rest if none is given.

    Parameters
    ----------
    response : gives the shift and the tilt.
    shift, tilt : as in `field_at`, instead of a response.
    mode : "component", B.n as a real element reads, or "magnitude", the paper's (4), sqrt(B_Z^2 + B_rho^2).
    field : as in `field_at`.
    elements : any elements, instead of those of the design's layout.
    ambient : uniform field in the sensor's frame that is added, T (the Earth's is about 5e-5).
    noise : a generator, to draw one sample of the noise; without it the outputs have none.

    Raises
    ------
    BadInput
        Both a response and a pose are given, the ambient field is not finite, or what `field_at` refuses.
    """
    if mode not in ("component", "magnitude"):
        raise BadInput(f"mode must be component or magnitude; got {mode!r}")
    if response is not None:
        if shift is not None or tilt is not None:
            raise BadInput("give a response, or a shift and a tilt, not both")
        shift, tilt = response.shift, response.rotation
    at = (0.0, 0.0, 0.0) if shift is None else shift
    chosen = of_design(design) if elements is None else tuple(elements)
    points, owners = plates(chosen)
    b = field_at(points, design, at, (0.0, 0.0) if tilt is None else tilt, field=field)
    b = b + _rows("ambient", ambient, 3)
    directions = np.array([element.direction for element in chosen])[owners]
    values = np.linalg.norm(b, axis=1) if mode == "magnitude" else (b * directions).sum(axis=1)
    seen = np.bincount(owners, values) / np.bincount(owners)
    gain, null, low, high, rms, step = (
        np.array([getattr(element, name) for element in chosen])
        for name in ("gain", "null", "low", "high", "noise", "step")
    )
    raw = null + gain * seen
    if noise is not None:
        raw = raw + rms * noise.standard_normal(len(raw))
    whole = np.where(step > 0, np.round(raw / np.where(step > 0, step, 1.0)) * step, raw)
    kept, full = np.clip(whole, low, high), (raw <= low) | (raw >= high)
    units = tuple(element.unit for element in chosen)
    return Readings(tuple(seen.tolist()), tuple(kept.tolist()), tuple(full.tolist()), units)


def plates(chosen: Sequence[Element]) -> tuple[Array, NDArray[np.int64]]:
    """Points at which the elements see the field, shape (n, 3), and the number of the element of each."""
    points, owners = [], []
    for k, element in enumerate(chosen):
        centre, normal = np.array(element.position), np.array(element.direction)
        if not element.plate:
            points.append(centre)
            owners.append(k)
            continue
        aside = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        aside *= element.plate / (2 * math.sqrt(3) * np.linalg.norm(aside))
        across = np.cross(normal, aside)
        points += [centre + i * aside + j * across for i in (-1, 1) for j in (-1, 1)]
        owners += [k] * 4
    return np.array(points).reshape(-1, 3), np.array(owners, dtype=np.int64)


def at_rail(elements: Sequence[Element], field: Array) -> NDArray[np.bool_]:
    """Return whether the output of any element lies at a rail, shape (n,), from B.n of the elements (k, n), T."""
    saturated = np.zeros(field.shape[1], dtype=np.bool_)
    for element, b in zip(elements, field, strict=True):
        # a rounding error of the output must not hide that it lies at a rail
        slack = 1e-12 * (element.high - element.low)
        output = element.null + element.gain * b
        saturated |= (output <= element.low + slack) | (output >= element.high - slack)
    return saturated


def _rows(name: str, values: ArrayLike, width: int, count: int = 0, *, single: bool = True) -> Array:
    """The values as finite floats, shape (n, width), or (width,) where a single row is allowed."""
    rows = np.asarray(values, dtype=np.float64)
    shapes = f"({width},) or ({count}, {width})" if single else f"(n, {width})"
    fits = (rows.shape == (width,) or rows.shape == (count, width)) if single else rows.shape[1:] == (width,)
    if not fits:
        raise BadInput(f"{name} must have shape {shapes}; got {rows.shape}")
    if not np.isfinite(rows).all():
        raise BadInput(f"{name} must be finite; got a NaN or an infinity")
    return rows


def _rotated(vectors: Array, tilt: Array) -> Array:
    """Vectors (n, 3) turned by the rotation vectors (rx, ry, 0), tilt (2,) or (n, 2): Rodrigues' formula."""
    axis = np.concatenate([tilt, np.zeros_like(tilt[..., :1])], axis=-1)
    angle = np.linalg.norm(axis, axis=-1, keepdims=True)
    along = (axis * vectors).sum(axis=-1, keepdims=True)
    # sinc keeps both factors finite at no tilt: sin(t)/t and (1 - cos t)/t^2
    first, second = np.sinc(angle / math.pi), np.sinc(angle / (2 * math.pi)) ** 2 / 2
    turned = vectors * np.cos(angle) + first * np.cross(axis, vectors) + second * along * axis
    return np.asarray(turned, dtype=np.float64)


def _paper_vectors(local: Array, radius: float, height: float, J: float, *, printed: bool) -> Array:
    """The paper's B_Z and B_rho at points of the magnet's frame, shape (n, 3), as vectors (n, 3)."""
    rho = np.hypot(local[:, 0], local[:, 1])
    b_z, b_rho = paper_field(rho, local[:, 2], radius, height, J, printed=printed)
    safe = np.where(rho > 0, rho, 1.0)
    return np.column_stack([b_rho * local[:, 0] / safe, b_rho * local[:, 1] / safe, b_z])
