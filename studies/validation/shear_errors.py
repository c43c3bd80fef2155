"""Errors of the paper's shear formula, and how much of them the ignored tilt explains.

The paper's sensor computes the shear force in three steps: the readings give the magnet's shift (by a field without
tilt), the shift gives the tip's displacement (delta = dx L/H, the geometry of a uniform bar), and this gives the
force by (6). The error splits into the same three parts, in order: tilt, geometry, force law.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic import beam, decode, hall
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Response
from studies.validation.claim_states import NAN, Sheared
from studies.validation.press_errors import BOUND, modulus_interval

FARTHEST = 3.1
"""Largest shear of the paper's Figure 11, mm."""


@dataclass(frozen=True, slots=True)
class TipRow:
    """Error of (6) under one condition of the tip.

    Attributes
    ----------
    stiffness_N_per_mm : force over the first shear.
    first_error_percent, worst_error_percent, last_error_percent : error of (6) for E = 1 MPa at the first shear, the
        largest, and at the last shear.
    best_E_MPa, best_error_percent : modulus that makes the largest error of (6) least, and that error.
    """

    tip: str
    stiffness_N_per_mm: float
    first_error_percent: float
    worst_error_percent: float
    last_error_percent: float
    best_E_MPa: float
    best_error_percent: float
    within_5_percent_from_E_MPa: float
    within_5_percent_to_E_MPa: float


@dataclass(frozen=True, slots=True)
class SplitRow:
    """Error of the shear force that the paper's sensor decodes, N, split into its parts."""

    shear_mm: float
    fem_force_x_N: float
    decoded_force_x_N: float
    error_N: float
    tilt_N: float
    geometry_N: float
    force_law_N: float
    fem_tilt_rad: float


def compared(sheared: Sheared) -> tuple[Array, Array]:
    """Return the shears within the paper's range and their forces, without the unsheared state, shape (n,)."""
    shear, force = np.array(sheared.shear), sheared.force()
    kept = (shear > 0) & (shear <= FARTHEST + 1e-9) & np.isfinite(force)
    return shear[kept], force[kept]


def tip_row(sheared: Sheared) -> TipRow:
    """Return the errors of (6) under one condition of the tip."""
    shear, force = compared(sheared)
    if not len(shear):
        return TipRow(sheared.tip, *[NAN] * 8)
    predicted = beam.shear_stiffness(sheared.design) * shear
    # forces are proportional to E: error of E is ratio / E - 1, whose extremes balance at the mean of the extremes
    ratio = predicted / force
    error = 100 * (ratio - 1)
    low, high = float(ratio.min()), float(ratio.max())
    interval = modulus_interval(predicted, force, BOUND * force) or (NAN, NAN)
    worst = float(error[np.abs(error).argmax()])
    best, spread = (low + high) / 2, 100 * (high - low) / (high + low)
    return TipRow(
        sheared.tip, float(force[0] / shear[0]), float(error[0]), worst, float(error[-1]), best, spread, *interval
    )


def split(sheared: Sheared) -> list[SplitRow]:
    """Return the parts of the error at each shear of the paper's range that was reached and can be decoded."""
    design = sheared.design
    states = [
        (shear, response)
        for shear, response in zip(sheared.shear, sheared.responses, strict=True)
        if response is not None and 0 < shear <= FARTHEST + 1e-9
    ]
    shifts = decoded_without_tilt(sheared, [response for _, response in states])
    stiffness, lever = beam.shear_stiffness(design), design.L / design.H
    rows = []
    for (shear, response), shift in zip(states, shifts, strict=True):
        force = response.force[0]
        law = stiffness * shear
        geometry = stiffness * lever * response.shift[0]
        decoded = stiffness * lever * float(shift[0])
        parts = (decoded - geometry, geometry - law, law - force)
        rows.append(SplitRow(shear, force, decoded, decoded - force, *parts, response.tilt))
    return rows


def decoded_without_tilt(sheared: Sheared, responses: Sequence[Response]) -> Array:
    """Return the shifts that a decoder without tilt finds from the readings of tilted magnets, shape (n, 3), mm."""
    design = sheared.design
    if not responses:
        return np.empty((0, 3))
    readings = np.array([hall.readings(design, response).B_T for response in responses])
    return decode.decode(_decoder_without_tilt(design), readings, follow=True).shift


@functools.cache
def _decoder_without_tilt(design: Design) -> decode.Decoder:
    """Return the decoder of an upright magnet in a workspace that contains every pose of a shear."""
    reach = 0.5 * design.D
    return decode.decoder(design, workspace=((-reach, -reach, -reach), (reach, reach, 0.5)))


def share(rows: Sequence[SplitRow], part: str) -> float:
    """Return the size of one part over the sizes of all parts, as sums over the shears, %.

    >>> rows = [SplitRow(1.0, 1.0, 1.5, 0.5, 0.1, 0.5, -0.4, 0.08)]
    >>> round(share(rows, "tilt_N"))
    10
    """
    sizes = {name: sum(abs(getattr(row, name)) for row in rows) for name in ("tilt_N", "geometry_N", "force_law_N")}
    whole = sum(sizes.values())
    return 100 * sizes[part] / whole if whole else NAN
