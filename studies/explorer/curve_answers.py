"""The part `curve`: force and shift over the depth of a press, by finite elements and by formulas.

The press has no friction, whatever the friction of the shear: the curve then depends on the design alone.
"""

from __future__ import annotations

import math
from typing import Any

from analytic import beam
from fem.accuracy import LEVELS
from fem.equilibrium import trace
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from studies.simulation.compare import default_loads

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
