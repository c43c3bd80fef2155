"""What the page without a server computes with: the surrogate, constants of formulas and of Hall parts, as JSON.

All numbers come from the modules that define them, so that a change there reaches the page. Arrays of floats are
texts of base64, in which no digit is lost.
"""

from __future__ import annotations

import base64
import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from analytic import beam, parts, press_terms, shear_terms
from geometry.design import LEAST_ALPHA, LEAST_WALL, POLES, Design
from geometry.loads import STEEPEST
from studies.explorer import offline_model
from studies.surrogate import prediction, surrogate_file, surrogate_range

Data = dict[str, Any]


def constants() -> Data:
    """Return everything that does not depend on the design of the page."""
    return {
        "fields": [_field(spec) for spec in dataclasses.fields(Design)],
        "limits": {"least_alpha": LEAST_ALPHA, "least_wall": LEAST_WALL, "steepest": STEEPEST},
        "surrogate": surrogate(),
        "formulas": formulas(),
        "hall": {
            "chips": {name: dataclasses.asdict(chip) for name, chip in parts.CHIPS.items()},
            "converter": {"noise": parts.CONVERTER_NOISE, "step": parts.CONVERTER_STEP},
            "poles": POLES,
        },
        "lines": {
            "starts": offline_model.LINE_STARTS,
            "step": offline_model.LINE_STEP,
            "steps": offline_model.LINE_STEPS,
            "box": offline_model.LINE_BOX,
            "clear": offline_model.LINE_CLEAR,
        },
    }


def surrogate() -> Data:
    """Return the shipped surrogate: training points, quantiles of errors and range."""
    shipped = surrogate_file.shipped()
    groups = {
        name: {
            "x": floats(group.process.x),
            "y": floats(group.process.y),
            "lengths": floats(group.process.lengths),
            "nugget": group.process.nugget,
            "quantities": list(group.quantities),
            "nodes": group.nodes,
            "quantiles": {quantity: floats(rows) for quantity, rows in group.quantiles.items()},
        }
        for name, group in shipped.groups.items()
    }
    return {
        "about": dict(shipped.about),
        "groups": groups,
        "range": {name.lower(): getattr(surrogate_range, name) for name in _RANGE},
        "calibration": {
            name.lower(): getattr(prediction, name) for name in ("SLENDER", "THICK", "WIDE", "DEEP", "REGIONS")
        }
        | {"critical_grid": prediction.CRITICAL_GRID},
    }


def formulas() -> Data:
    """Return the fitted constants of the formulas."""
    names = ("THIN", "SPHERE", "CENTRE", "INCLUSION", "LEAST", "THINNING")
    press = {name.lower(): getattr(press_terms, name) for name in names}
    names = ("DOME", "ROLLS", "PATCH", "ROLLED", "SETTLED", "NUDGE")
    shear = {name.lower(): getattr(shear_terms, name) for name in names}
    return press | shear | {"deepest": beam.DEEPEST, "farthest": beam.FARTHEST}


def floats(values: ArrayLike) -> Data:
    """Return an array of floats as `OfflineData.decoded` in the page reads it.

    >>> floats([[1.0, 0.5]])
    {'float64': 'AAAAAAAA8D8AAAAAAADgPw=='}
    """
    return {"float64": base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode("ascii")}


def integers(values: ArrayLike) -> Data:
    """Return an array of 16-bit integers in the same way.

    >>> integers([1, -2])
    {'int16': 'AQD+/w=='}
    """
    return {"int16": base64.b64encode(np.ascontiguousarray(values, dtype="<i2").tobytes()).decode("ascii")}


_RANGE = (
    *("LENGTH", "DIAMETER", "HEIGHT", "POISSON", "EDGE", "DENSITY_RATIO", "LEAST_WALL", "LEAST_BELOW", "SHALLOWEST"),
    *(
        "DEEPEST",
        "DEPTH_SHARE",
        "WIDEST_SHARE",
        "SHALLOWEST_SHEAR",
        "FARTHEST",
        "SHEAR_SHARE",
        "PRESS_NODES",
        "SHEAR_NODES",
    ),
)
"""Constants of `studies.surrogate.surrogate_range`."""


def _field(spec: dataclasses.Field[Any]) -> Data:
    """Return a field of a design as the page checks it."""
    common = {
        "name": spec.name,
        "default": spec.default,
        "unit": spec.metadata["unit"],
        "text": spec.metadata["text"],
    }
    if "choices" in spec.metadata:
        return common | {"choices": list(spec.metadata["choices"])}
    if "low" not in spec.metadata:
        return common
    return common | {"low": spec.metadata["low"], "high": spec.metadata["high"]}
