"""What the three Hall elements read when the magnet has moved. Lengths in mm, angles in rad, B in T, output in V.

The field is that of the sharp-edged cylinder magnet: its edge radius is ignored, as are the thickness of the
elements, noise and ambient field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.magnet import cylinder_field, paper_field
from geometry.design import BadInput, Design
from geometry.scene import Response

Array = NDArray[np.float64]
Mode = Literal["component", "magnitude"]
Field = Literal["exact", "paper"]


@dataclass(frozen=True, slots=True)
class Readings:
    """What S1, S2 and S3 read, in this order.

    Attributes
    ----------
    B_T : the flux density that the element responds to, T: B.n, or |B| in the paper's mode.
    V : the output, null + gain B, kept between the rails, V.
    saturated : whether the output lies at a rail, so that it no longer tells where the magnet is.
    """

    B_T: tuple[float, float, float]
    V: tuple[float, float, float]
    saturated: tuple[bool, bool, bool]


def elements(design: Design) -> tuple[Array, Array]:
    """Where S1, S2 and S3 sit, shape (3, 3), mm, and the unit vectors along which they read, shape (3, 3).

    The directions -z, +x and +y follow from the magnet's north pole pointing down. Under it B points down, and
    below its plane B leans away from the axis, so at rest all three outputs lie above the null voltage (S2 and S3
    need l0 > c; else their signs turn round). S1 grows when the magnet sinks. S2 grows when the magnet moves towards
    +x, and S3 towards +y, but not without end: straight above the element that component is 0 again. With the preset
    `paper`, S2 peaks at a shift of 2.1 mm, and at 2.5, 2.9 and 3.1 mm with the magnet 1, 2 and 3 mm lower.
    """
    s1, s23 = design.H - design.l0, design.H - design.l0 + design.c
    positions = np.array([[0.0, 0.0, s1], [design.f, 0.0, s23], [0.0, design.f, s23]])
    directions = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
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
    field : "exact" (closed form), or "paper" (quadrature of the paper's equation (3), outside the magnet only).

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
        raise BadInput("this design has no magnet (magnet_diameter is 0), so there is no field to read: give it one")
    if field not in ("exact", "paper"):
        raise BadInput(f"field must be exact or paper; got {field!r}")
    where = _rows("points", points, 3, single=False)
    vector = _rows("tilt", tilt, 2, len(where))
    moved = where - [0.0, 0.0, design.H] - _rows("shift", shift, 3, len(where))
    # seen from the magnet, with z along its magnetisation: half a turn about x, because its north pole points down
    flip = np.array([1.0, -1.0, -1.0])
    local = flip * _rotated(moved, -vector)
    magnet = design.magnet_diameter / 2, design.magnet_height, design.remanence
    b = cylinder_field(local, *magnet) if field == "exact" else _paper_vectors(local, *magnet)
    return _rotated(flip * b, vector)


def readings(
    design: Design,
    response: Response | None = None,
    *,
    shift: tuple[float, float, float] | None = None,
    tilt: tuple[float, float] | None = None,
    mode: Mode = "component",
    field: Field = "exact",
) -> Readings:
    """The three readings for a response, or for a shift and a tilt of the magnet; at rest if none is given.

    Parameters
    ----------
    response : gives the shift and the tilt.
    shift, tilt : as in `field_at`, instead of a response.
    mode : "component", B.n as a real element reads, or "magnitude", the paper's (4), sqrt(B_Z^2 + B_rho^2).
    field : as in `field_at`.

    Raises
    ------
    BadInput
        Both a response and a pose are given, or what `field_at` refuses.
    """
    if mode not in ("component", "magnitude"):
        raise BadInput(f"mode must be component or magnitude; got {mode!r}")
    if response is not None:
        if shift is not None or tilt is not None:
            raise BadInput("give a response, or a shift and a tilt, not both")
        shift, tilt = response.shift, (-response.tilt_y, response.tilt)
    positions, directions = elements(design)
    at = (0.0, 0.0, 0.0) if shift is None else shift
    b = field_at(positions, design, at, (0.0, 0.0) if tilt is None else tilt, field=field)
    seen = np.linalg.norm(b, axis=1) if mode == "magnitude" else (b * directions).sum(axis=1)
    raw = design.hall_null + design.hall_gain * seen
    kept = np.clip(raw, design.hall_low, design.hall_high)
    at_rail = (raw <= design.hall_low) | (raw >= design.hall_high)
    (b1, b2, b3), (v1, v2, v3), (s1, s2, s3) = seen.tolist(), kept.tolist(), at_rail.tolist()
    return Readings((b1, b2, b3), (v1, v2, v3), (s1, s2, s3))


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


def _paper_vectors(local: Array, radius: float, height: float, J: float) -> Array:
    """The paper's B_Z and B_rho at points of the magnet's frame, shape (n, 3), as vectors (n, 3)."""
    rho = np.hypot(local[:, 0], local[:, 1])
    b_z, b_rho = paper_field(rho, local[:, 2], radius, height, J)
    safe = np.where(rho > 0, rho, 1.0)
    return np.column_stack([b_rho * local[:, 0] / safe, b_rho * local[:, 1] / safe, b_z])
