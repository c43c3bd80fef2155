"""Variables of the search, and the variants that they stand for: a design with its magnet, Hall part and silicone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.fabrication.hall_elements import SS495A, WEB
from geometry.fabrication.printability import PROCESSES
from studies.mechanics import surrogate_range
from studies.sizing.catalogues import FILTER, Catalogues, HallPartEntry, MagnetEntry, SiliconeEntry
from studies.sizing.front_search import Variable
from studies.sizing.requirements import Requirements

ROUNDING = 0.1
"""Lengths of a design are whole multiples of this, mm: a finer drawing asks for more than printers hold."""
USUAL_D = (3.0, 30.0)
"""Range of the diameter where the requirements have none, mm."""
BELOW, ASIDE, LEVEL = (0.0, 0.8), (0.0, 0.8), (-0.5, 0.8)
"""Ranges of the elements' places: how much farther than necessary S1 or the chip lies below the beam, and S2 and S3
beside it, over D; and the height of S2 and S3 over that of the magnet."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A design with typical values of its parts."""

    design: Design
    magnet: MagnetEntry
    hall_part: HallPartEntry
    silicone: SiliconeEntry

    def row(self) -> dict[str, Any]:
        """Return the columns that identify a variant in tables."""
        d = self.design
        three = d.hall_layout == "three"
        return {
            "D_mm": d.D,
            "L_mm": d.L,
            "magnet": self.magnet.name,
            "silicone": self.silicone.name,
            "hall_part": self.hall_part.name,
            "f_mm": d.f if three else None,
            "l0_mm": d.l0,
            "c_mm": d.c if three else None,
        }


def variables(requirements: Requirements, catalogues: Catalogues) -> tuple[Variable, ...]:
    """Return the variables of the search."""
    low = USUAL_D[0] if requirements.D_low is None else requirements.D_low
    high = USUAL_D[1] if requirements.D_high is None else requirements.D_high
    if requirements.outer_size is not None:
        high = min(high, requirements.outer_size)
    low = min(low, high)
    return (
        Variable("D", low, high),
        Variable("slenderness", *surrogate_range.LENGTH),
        Variable("magnet", choices=len(catalogues.magnets), ordered=True),
        Variable("silicone", choices=len(catalogues.silicones), ordered=True),
        Variable("hall_part", choices=len(catalogues.hall_parts), ordered=True),
        Variable("below", *BELOW),
        Variable("aside", *ASIDE),
        Variable("level", *LEVEL),
    )


def variant(values: Sequence[float], requirements: Requirements, catalogues: Catalogues) -> Variant | str:
    """Return the variant of one candidate, or the reason why its design is impossible.

    Parameters
    ----------
    values : of the variables, in their order.
    """
    D, slenderness, m, s, h, below, aside, level = values
    magnet, silicone = catalogues.magnets[int(m)], catalogues.silicones[int(s)]
    hall_part = catalogues.hall_parts[int(h)]
    D = _rounded(D)
    L = _rounded(slenderness * D)
    H, gap = L - D / 2, PROCESSES[requirements.process].fit / 2
    fields: dict[str, Any] = {
        "D": D,
        "L": L,
        "hall_average": float(requirements.samples),
        **magnet.fields(),
        **silicone.fields(),
        **hall_part.fields(),
    }
    if hall_part.layout == "three":
        part = SS495A
        # the roof of the seat of S1 leaves a web of base below the beam
        l0 = _raised(H + part.depth + gap + WEB + below * D)
        f = _raised(D / 2 + part.depth + gap + aside * D)
        fields |= {"l0": l0, "f": f, "c": _rounded(l0 - H + level * H)}
        fields |= noise_fields(hall_part, requirements)
    else:
        fields |= {
            "l0": _raised(H + hall_part.thickness - (hall_part.plate_height or 0.0) + gap + WEB + below * D),
            "chip_x": 0.0,
        }
    try:
        return Variant(Design(**fields), magnet, hall_part, silicone)
    except BadInput as error:
        return str(error)


def noise_fields(part: HallPartEntry, requirements: Requirements) -> dict[str, float]:
    """Return the fields of a `Design` for the noise of a one-axis part and the converter that reads it."""
    band = part.bandwidth or 0.0
    if requirements.bandwidth is not None:
        band = min(band, requirements.bandwidth)
    return {
        "hall_noise": requirements.converter_noise,
        "hall_step": requirements.converter_step,
        "hall_noise_density": part.gain * (part.noise_density or 0.0),
        "hall_bandwidth": FILTER * band,
    }


def shortage(X: Array, catalogues: Catalogues) -> Array:
    """Return by how much candidates (n, m) miss the beams that the surrogate covers, shape (n,), over D; 0 if not.

    It leads the search towards beams that are possible: how far it is to them, where a refusal would only say no.
    """
    magnets = np.array([(each.diameter, each.height, each.edge_radius) for each in catalogues.magnets])
    sizes, edges = magnets[X[:, 2].astype(int), :2], magnets[X[:, 2].astype(int), 2]
    D, slenderness = np.round(X[:, 0] / ROUNDING) * ROUNDING, X[:, 1]
    diameter, height = (sizes / D[:, None]).T
    wall = surrogate_range.wall(slenderness, diameter, height, edges / np.minimum(diameter, height) / D)
    thin = surrogate_range.LEAST_BELOW - surrogate_range.below(slenderness, height)
    missed = np.maximum(surrogate_range.LEAST_WALL - wall, 0.0) + np.maximum(thin, 0.0)
    for value, (low, high) in ((diameter, surrogate_range.DIAMETER), (height, surrogate_range.HEIGHT)):
        missed = missed + np.maximum(low - value, 0.0) + np.maximum(value - high, 0.0)
    return np.asarray(missed)


def _rounded(value: float) -> float:
    """Return the nearest multiple of `ROUNDING`, free of rounding errors.

    >>> _rounded(7.24999)
    7.2
    """
    return round(round(value / ROUNDING) * ROUNDING, 9)


def _raised(value: float) -> float:
    """Return the next multiple of `ROUNDING` at or above a value.

    >>> _raised(7.2000001), _raised(7.21)
    (7.2, 7.3)
    """
    return round(math.ceil(value / ROUNDING - 1e-4) * ROUNDING, 9)
