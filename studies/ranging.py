"""The whole range of designs, sampled: solids, mould and meshes of each, or what makes it impossible.

Sobol's sequence over D, L, the magnet's diameter, height and edge radius. D spans 1 to 50 mm and L D/2 + 0.05 mm to
10 D; the magnet spans a disc of 0.2 mm to one that leaves 0.15 mm of wall. All are spaced logarithmically (the edge
radius evenly, from 0 to half the most there can be), and a tenth of the samples lies at each end of each, so that the
extremes meet. Tetrahedra are those of level quick, of the half body, silicone and magnet; the section is that of
level standard. A design is good where each step of it is good or impossible for a reason that the message names.
"""

from __future__ import annotations

import functools
import json
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from geometry.design import BadInput, Design, Shape
from studies.accuracy import code
from studies.files import json_line

Progress = Callable[[float, str], None]
Row = dict[str, Any]

SEED, COUNT = 1960, 64
WALL, LEAST_SIDE, LEAST_STEM = 0.15, 0.1, 0.05
"""Silicone that the largest magnet leaves, the least height of a magnet, and the least L - D/2, mm."""
END = 0.1
"""Share of the samples at each end of each quantity."""


def samples(count: int) -> list[dict[str, float]]:
    """What the sampled designs have in mm, in powers of two for an even spread."""
    from scipy.stats import qmc

    points = qmc.Sobol(5, seed=SEED).random_base2(math.ceil(math.log2(max(count, 2))))
    return [_sample([min(max((float(x) - END) / (1 - 2 * END), 0.0), 1.0) for x in point]) for point in points][
        :count
    ]


def _sample(x: list[float]) -> dict[str, float]:
    D = _rounded(50 ** x[0])
    H = _between(LEAST_STEM, 9.5 * D, x[1])
    wide = _between(0.2, max(D - 2 * WALL, 0.2), x[2])
    high = 2 * min(math.sqrt(max((D / 2 - WALL) ** 2 - (wide / 2) ** 2, 0.0)), max(H - WALL, 0.0))
    tall = _between(LEAST_SIDE, max(high, LEAST_SIDE), x[3])
    return {
        "D": D,
        "L": D / 2 + H,
        "magnet_diameter": wide,
        "magnet_height": tall,
        "magnet_edge_radius": _rounded(x[4] * min(wide, tall) / 4),
        "l0": max(D / 2 + H, 1.0),
    }


def _between(low: float, high: float, share: float) -> float:
    """On a logarithmic scale, rounded down so as not to leave it."""
    value = low * (high / low) ** share
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return max(float(f"{math.floor(value / step * (1 + 1e-12)) * step:.6g}"), low)


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
