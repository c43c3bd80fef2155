"""The part `stability`: critical depth and first mode, first by the surrogate and then by finite elements."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fem.accuracy import LEVELS
from fem.analyses import modes, stability
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from studies.exploration.solved_paths import frequency_unit
from studies.surrogate import surrogate_range, surrogate_response

Data = dict[str, Any]


def by_surrogate(design: Design, magnet: Magnet) -> Data | None:
    """Return the surrogate's answers with half widths of 90 % intervals; None where it refuses the design."""
    try:
        if surrogate_response.refusal(design, Load(depth=surrogate_range.SHALLOWEST * design.D), magnet):
            return None
    except (BadInput, ArithmeticError):
        return None
    beams = surrogate_response.beams_of([design])
    critical = beams.critical_depth()
    mode = beams.first_mode(np.array([design.magnet_density / design.density]))
    depth = float(critical.value[0]) * design.D
    unit = frequency_unit(design.D, design.E, design.density)
    found = math.isfinite(depth)
    known = bool(np.isfinite(mode.value[0]))
    return {
        "source": "surrogate",
        "critical_depth": depth if found else None,
        "estimate": float(critical.half_width[0]) * design.D if found else None,
        "stable_to": float(beams.stable_to()[0]) * design.D,
        "first_mode_hz": unit * float(mode.value[0]) if known else None,
        "first_mode_estimate_hz": unit * float(mode.half_width[0]) if known else None,
        "rows": [],
        "message": "by the surrogate, with 90 % intervals; finite elements follow",
    }


def by_finite_elements(design: Design, magnet: Magnet, level: str) -> Data:
    """Return the answers of finite elements, with error estimates as half widths."""
    critical = stability.critical(design, magnet, accuracy=LEVELS[level])
    message, first = critical.message, modes.Modes((), ())
    try:
        first = modes.modes(design, magnet, 1, accuracy=LEVELS[level])
    except BadInput as error:
        message = "; ".join(text for text in (message, str(error)) if text)
    frequency = first.frequency[0] if first.frequency else None
    share = first.estimates[0] if first.estimates else None
    estimates = critical.estimates
    return {
        "source": "finite elements",
        "critical_depth": critical.depth,
        "estimate": _times(estimates.depth, critical.depth),
        "stable_to": critical.stable_to,
        "first_mode_hz": frequency,
        "first_mode_estimate_hz": _times(share, frequency),
        "first_mode_shape": first.shape[0] if first.shape else None,
        "rows": [
            {
                "name": "critical force",
                "unit": "N",
                "value": critical.force,
                "half_width": _times(estimates.force, critical.force),
            },
            {"name": "stable to", "unit": "mm", "value": critical.stable_to, "half_width": None},
        ],
        "message": message,
    }


def _times(share: float | None, value: float | None) -> float | None:
    return None if share is None or value is None else share * abs(value)
