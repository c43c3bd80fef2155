"""Sensors as arrays: candidates of a search, one variant as it is designed, and made sensors of a variant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analytic.hall import plates_of
from analytic.parts import AXES, Element, of_design
from geometry.arrays import Array, Ints
from geometry.base import Base, least_pitch, outer_size, plan
from geometry.design import modulus_at
from geometry.fabrication.hall_elements import SS495A
from geometry.mold import Mold, sizes
from studies.beam import prediction
from studies.parts.requirements import Requirements
from studies.sensitivity.made_sensors import MadeSensors
from studies.sizing.candidate_variables import Candidates, Variant

CORNERS = ("corner", "sides")
"""What a block is given by."""
ABSENT = 1e9
"""Rails of an element that a sensor has not, in the unit of its output; its noise is infinite."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensors:
    """n sensors as arrays; lengths in mm, moduli in MPa, remanence and noise in T.

    Attributes
    ----------
    D, L, E_low, E_high, density, magnet_density, size, height, wall, room : shape (n,); room is the pitch of arrays
        from which on pockets and recesses of neighbours are apart.
    beam : L, diameter and height of the magnet and its edge radius, over D, and nu, shape (n, 5).
    magnet, remanence : diameter and height; least and largest value, shape (n, 2).
    points, normals : where the elements sample the field, from the magnet's centre at rest, and their directions,
        shape (n, m, 3). owners : the element of each point, shape (m,).
    gain, null, low, high, noise : of the k elements, shape (n, k).
    drift : of the gain per K, relative, NaN where unknown, shape (n,).
    loss : largest loss factor of the silicone, and the least and the largest frequency at which it holds, Hz; NaN
        where unknown, shape (n, 3).
    bandwidth : largest one of the readings, Hz, NaN where unknown, shape (n,).
    beside : distance of the face of S2 from the axis and its height, shape (n, 2); NaN for a chip.
    offset, turn : displacement and rotation vector of the magnet in the silicone, (n, 3) and (n, 2); None for 0.
    """

    D: Array
    L: Array
    E_low: Array
    E_high: Array
    density: Array
    magnet_density: Array
    size: Array
    height: Array
    wall: Array
    room: Array
    beam: Array
    magnet: Array
    remanence: Array
    points: Array
    normals: Array
    owners: Ints
    gain: Array
    null: Array
    low: Array
    high: Array
    noise: Array
    drift: Array
    loss: Array
    bandwidth: Array
    beside: Array
    offset: Array | None = None
    turn: Array | None = None

    def __len__(self) -> int:
        return len(self.D)

    @property
    def mirrored(self) -> bool:
        """Whether the plane x = y mirrors all sensors: not so a circle of chips, nor what was made."""
        return self.turn is None and self.noise.shape[1] == 3

    def take(self, rows: Any) -> Sensors:
        """Return some of the sensors."""
        values = {name: getattr(self, name) for name in self.__slots__}
        return Sensors(**{n: v if n == "owners" or v is None else v[rows] for n, v in values.items()})

    def beams(self) -> prediction.Beams:
        """Return the surrogate's answers for the beams."""
        L, d, h, edge, nu = self.beam.T
        return prediction.beams(L, d, h, nu, edge)


def sensors_of(candidates: Candidates) -> Sensors:
    """Return candidates as sensors."""
    c, n = candidates, len(candidates)
    l0, f, _ = c.places()
    # element S1 or the chips, then S2 and S3
    circle = c.circle()
    at = np.zeros((n, 3 * len(circle), 3))
    at[:, :, :2] = np.repeat(circle, 3, axis=0).transpose(2, 0, 1)
    at[:, :, 2] = -l0[:, None]
    level = c.lengths[:, 4] - c.H
    for k in (1, 2):
        at[:, k, k - 1] = np.where(c.three, f, at[:, k, k - 1])
        at[:, k, 2] = np.where(c.three, level, -l0)
    axes = AXES * len(circle)
    owners, spread = np.arange(len(axes), dtype=np.int64), np.zeros((len(axes), 3))
    plate = c.hall_part("plate")[:, None, None]
    if plate.any():
        unit = [Element("", (0.0, 0.0, 0.0), axis, 1.0, 0.0, -1.0, 1.0, plate=1.0) for axis in axes]
        spread, owners = plates_of(unit)
    points = at[:, owners] + spread * plate
    # a sensor with fewer chips than others has elements that say nothing
    real = np.repeat(np.arange(len(circle)) < c.hall_part("count")[:, None], 3, axis=1)
    values = {name: c.hall_part(name)[:, None] * np.ones(real.shape) for name in ("gain", "null")}
    values |= {
        name: np.where(real, c.hall_part(name)[:, None], end) for name, end in (("low", -ABSENT), ("high", ABSENT))
    }
    values |= {name: c.silicone(name) for name in ("E_low", "E_high", "density")}
    values |= dict(zip(("size", "height", "wall"), c.sizes(), strict=True))
    D, d, h, edge = c.D, c.magnet("diameter"), c.magnet("height"), c.magnet("edge_radius")
    return Sensors(
        D=D,
        L=c.L,
        magnet_density=c.magnet("density"),
        room=c.room(),
        beam=np.column_stack([c.L / D, d / D, h / D, edge / D, c.silicone("nu")]),
        magnet=np.column_stack([d, h]),
        remanence=np.column_stack([c.magnet("remanence_low"), c.magnet("remanence_high")]),
        points=points,
        normals=np.broadcast_to(np.array(axes)[owners], points.shape),
        owners=owners,
        **values,
        noise=np.where(real, c.hall_part("noise_T")[:, None], np.inf),
        drift=c.hall_part("gain_drift"),
        loss=np.column_stack([c.silicone(name) for name in ("loss_factor_high", "loss_low", "loss_high")]),
        bandwidth=c.hall_part("bandwidth"),
        beside=np.where(c.three[:, None], np.column_stack([f - SS495A.depth, c.lengths[:, 4]]), np.nan),
    )


def sensors_of_variant(variant: Variant, needed: Requirements) -> Sensors:
    """Return one variant as it is designed, whatever its lengths."""
    d, silicone, magnet = variant.design, variant.silicone, variant.magnet
    elements = of_design(d)
    points, owners = plates_of(elements)
    one = {name: np.array([[getattr(each, name) for each in elements]]) for name in ("gain", "null", "low", "high")}
    three = d.hall_layout == "three"
    # a chip of unknown noise, and elements without any, have no resolution that is known
    known = three or d.chip.noise is not None
    noise = np.array([[each.noise_T if known and each.noise_T else np.nan for each in elements]])
    level = d.H - d.l0 + d.c
    outline = plan(d, needed.base, needed.process)
    mould, (_, _, height) = sizes(d, Mold(process=needed.process)), outer_size(d, outline)[0]
    wall = min(2 * mould.pin_radius, mould.wall, Base().seat_wall if outline.seats.posts else np.inf)
    names = ("L", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    values = {name: getattr(d, name) for name in ("D", "L", "density", "magnet_density")}
    values |= {name: modulus_at(getattr(silicone, name), d.temperature) for name in ("E_low", "E_high")}
    low, sides = (np.array([getattr(body, name)[:2] for body in outline.seats.bodies.values()]) for name in CORNERS)
    x, y = np.array([low, low + sides]).transpose(2, 0, 1)[..., None]
    (room,) = least_pitch(x, y, outline.recess_radius, is_round=outline.is_round)
    values |= {"size": 2 * outline.half, "height": height, "wall": wall, "room": room}
    return Sensors(
        **{name: np.array([value]) for name, value in values.items()},
        **one,
        noise=noise,
        beam=np.array([[*(getattr(d, name) / d.D for name in names), d.nu]]),
        magnet=np.array([[d.magnet_diameter, d.magnet_height]]),
        remanence=np.array([[magnet.remanence_low, magnet.remanence_high]]) * (d.remanence_now / d.remanence),
        points=points[None] - [0.0, 0.0, d.H],
        normals=np.array([each.direction for each in elements])[owners][None],
        owners=owners,
        drift=np.array([variant.hall_part.gain_drift], dtype=float),
        loss=np.array([variant.loss], dtype=float),
        bandwidth=np.array([variant.hall_part.largest_bandwidth(needed, int(d.hall_average))]),
        beside=np.array([[d.f - SS495A.depth, level] if three else [np.nan, np.nan]]),
    )


def made_sensors_of(variant: Variant, made: MadeSensors, nominal: Sensors) -> Sensors:
    """Return made sensors of a variant: each has its own E, magnet, gains and displaced parts, and no ranges.

    nominal : the variant as designed, one row.
    """
    n = len(made)
    whole = nominal.take(np.zeros(n, dtype=np.int64))
    elements = of_design(variant.design)
    names = ("E", "nu", "remanence", "magnet_diameter", "magnet_height")
    (E, nu, remanence, diameter, height), D = (np.asarray(made.fields[name]) for name in names), whole.D
    d = variant.design
    E, remanence = modulus_at(E, d.temperature), remanence * (d.remanence_now / d.remanence)
    beam = whole.beam.copy()
    beam[:, 1], beam[:, 2], beam[:, 4] = diameter / D, height / D, nu
    low, high, null = ([getattr(each, name) for each in elements] for name in ("low", "high", "null"))
    return replace(
        whole,
        E_low=E,
        E_high=E,
        beam=beam,
        magnet=np.column_stack([diameter, height]),
        remanence=np.column_stack([remanence, remanence]),
        points=whole.points + made.element_offset[:, whole.owners],
        gain=whole.gain * made.gain_factor,
        null=null + made.null_shift,
        low=low + 0 * made.null_shift,
        high=high + 0 * made.null_shift,
        noise=whole.noise / made.gain_factor,
        offset=made.magnet_offset,
        turn=made.magnet_tilt,
    )
