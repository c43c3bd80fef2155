"""The parts `curve` and `stability`, which depend on the design alone.

The press of a curve has no friction, whatever the friction of the shear. The stability comes first from the
surrogate and then from finite elements.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analytic import beam
from fem.accuracy import LEVELS
from fem.analyses import modes, stability
from fem.equilibrium import trace
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from studies.exploration.solved_paths import frequency_unit
from studies.simulation.compare import default_loads
from studies.surrogate import surrogate_range, surrogate_response

Data = dict[str, Any]


def curve(design: Design, magnet: Magnet, level: str, *, estimate: bool) -> Data:
    """Return the curve by finite elements; states beyond the first that fails are left out.

    Parameters
    ----------
    estimate : with error estimates, as half widths.
    """
    loads, _ = default_loads(design)
    states = trace(design, loads, LEVELS[level], magnet=magnet, estimate=estimate)
    solved = [state for state in states if state.status in ("ok", "unstable")]
    rows = [(state.response, state.estimates) for state in solved]
    return {
        "depth": [state.load.depth for state in solved],
        "force": [response.force[2] for response, _ in rows],
        "shift": [response.shift[2] for response, _ in rows],
        "estimates": {
            "force": [_times(share.force, response.force) for response, share in rows],
            "shift": [_times(share.shift, response.shift) for response, share in rows],
        },
        "status": [state.status for state in solved],
        "message": states[-1].message,
    }


def with_formulas(data: Data, design: Design, level: str) -> Data:
    """Return a curve with the paper's formulas and those of a level at its depths; None beyond their range."""
    return data | {
        "paper": _formula(design, data["depth"], "paper"),
        "level": {"name": level, **_formula(design, data["depth"], level)},
    }


def _formula(design: Design, depths: list[float], level: str) -> Data:
    forces: list[float | None] = []
    shifts: list[float | None] = []
    for depth in depths:
        try:
            response = beam.solve(design, Load(depth=depth), level)
        except BadInput:
            forces.append(None)
            shifts.append(None)
            continue
        forces.append(response.force[2])
        shifts.append(response.shift[2])
    return {"force": forces, "shift": shifts}


def _times(share: float | None, vector: tuple[float, float, float]) -> float | None:
    return None if share is None else share * math.hypot(*vector)


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
        "estimate": _half_width(estimates.depth, critical.depth),
        "stable_to": critical.stable_to,
        "first_mode_hz": frequency,
        "first_mode_estimate_hz": _half_width(share, frequency),
        "first_mode_shape": first.shape[0] if first.shape else None,
        "rows": [
            {
                "name": "critical force",
                "unit": "N",
                "value": critical.force,
                "half_width": _half_width(estimates.force, critical.force),
            },
            {"name": "stable to", "unit": "mm", "value": critical.stable_to, "half_width": None},
        ],
        "message": message,
    }


def _half_width(share: float | None, value: float | None) -> float | None:
    return None if share is None or value is None else share * abs(value)
