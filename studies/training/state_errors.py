"""Errors of the surrogate in finite-element states of beams, and the scaling of its intervals to them.

Errors are in percent of the yardstick of the quantity: of the value itself, of the length of the vector of force or
shift in a shear, of the loss 1 - k/k_0 of the sideways stiffness, of the critical depth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.surrogate import prediction, surrogate_range
from studies.surrogate.prediction import CRITICAL, Beams, Quantity
from studies.surrogate.surrogate_file import Group, Surrogate
from studies.training.calibration import quantiles_by_region
from studies.training.surrogate_fit import TrainingSet

KINDS = {"press": "press", "strain": "press", "mode": "mode", "shear": "shear", "shear_skin": "shear"}
"""Kind of the states that each group of the surrogate predicts."""
HALF = 0.5
"""Share of the range of the depths, in their roots, beyond which a press is deep."""


@dataclass(frozen=True, slots=True)
class StateError:
    """Error of one quantity in one state.

    Attributes
    ----------
    kind : press, shear, critical depth or mode.
    error_percent, interval_percent : error, and half width of the 90 % interval, of the yardstick.
    """

    beam: int
    kind: str
    quantity: str
    L_over_D: float
    magnet_diameter_over_D: float
    magnet_height_over_D: float
    nu: float
    depth_over_D: float
    shear_over_D: float
    fem: float
    surrogate: float
    error_percent: float
    interval_percent: float

    @property
    def covered(self) -> bool:
        """Whether the interval holds the truth."""
        return abs(self.error_percent) <= self.interval_percent


def errors(surrogate: Surrogate, states: TrainingSet, critical: Array | None = None) -> list[StateError]:
    """Return the errors of a surrogate in all states of a set.

    Parameters
    ----------
    critical : critical depths of the first beams over D, infinite where there is none.
    """
    b = states.beams
    predicted = Beams(b.L, b.diameter, b.height, b.nu, b.edge, surrogate)
    return [
        *_presses(states, predicted),
        *_shears(states, predicted),
        *_modes(states, predicted),
        *(() if critical is None else _critical_depths(states, predicted, critical)),
    ]


def recalibrated(surrogate: Surrogate, rows: Sequence[StateError]) -> Surrogate:
    """Return the surrogate with intervals scaled to the errors of random beams, by quantity, region and depth."""
    return replace(
        surrogate, groups={name: _scaled(group, KINDS[name], rows) for name, group in surrogate.groups.items()}
    )


def _scaled(group: Group, kind: str, rows: Sequence[StateError]) -> Group:
    quantiles: dict[str, Array] = {}
    for name, values in group.quantiles.items():
        own = [row for row in rows if (row.kind, row.quantity) == (kind, name)]
        if name == CRITICAL or not own:
            quantiles[name] = values
            continue
        scores = np.array([abs(row.error_percent) / row.interval_percent for row in own])[:, None]
        region = _regions(own, kind)
        if kind != "press":
            quantiles[name] = values * quantiles_by_region(scores, region, len(values))
            continue
        # light and deep presses apart: the error of a light one is that of the contact's mesh
        deep, nodes = _shares(own) > HALF, prediction.root_shares() > HALF
        factors = [quantiles_by_region(scores[part], region[part], len(values)) for part in (~deep, deep)]
        quantiles[name] = values * np.where(nodes, factors[1], factors[0])
    return replace(group, quantiles=quantiles)


def _shares(rows: Sequence[StateError]) -> Array:
    """Return where the depth of each press lies in the range of the depths, 0 to 1 in the roots."""
    L, height, depth = (
        np.array([getattr(row, name) for row in rows])
        for name in ("L_over_D", "magnet_height_over_D", "depth_over_D")
    )
    low = np.sqrt(surrogate_range.SHALLOWEST)
    return np.asarray((np.sqrt(depth) - low) / (np.sqrt(surrogate_range.deepest(L, height)) - low))


def _regions(rows: Sequence[StateError], kind: str) -> NDArray[np.int64]:
    """Return the region of each row."""
    L, height, depth = (
        np.array([getattr(row, name) for row in rows])
        for name in ("L_over_D", "magnet_height_over_D", "depth_over_D")
    )
    region = prediction.beam_region(L, height)
    return prediction.shear_region(region, depth) if kind == "shear" else region


def _presses(states: TrainingSet, predicted: Beams) -> Iterator[StateError]:
    press = states.press
    q = press.quantities
    truth = {
        "force": q["force_z"],
        "shift": -q["shift_z"],
        "contact_radius": q["contact_radius"],
        "strain": q["strain"],
        "sideways_ratio": q["sideways_ratio"],
    }
    for name, quantity in predicted.press(press.depth).items():
        rod = 1 - quantity.value if name == "sideways_ratio" else quantity.value
        yield from _rows(states, "press", name, press.depth, press.shear, truth[name], quantity, rod)


def _shears(states: TrainingSet, predicted: Beams) -> Iterator[StateError]:
    shear = states.shear
    found = predicted.shear(shear.depth, shear.shear)
    rods = prediction.yardsticks({name: quantity.value for name, quantity in found.items()})
    for name, quantity in found.items():
        true = -shear.quantities[name] if name == "shift_z" else shear.quantities[name]
        yield from _rows(states, "shear", name, shear.depth, shear.shear, true, quantity, rods[name])


def _modes(states: TrainingSet, predicted: Beams) -> Iterator[StateError]:
    quantity = predicted.first_mode(states.beams.density_ratio)
    column = Quantity(quantity.value[:, None], quantity.half_width[:, None])
    none = np.zeros_like(column.value)
    yield from _rows(states, "mode", "frequency", none, none, states.mode[:, None], column, column.value)


def _critical_depths(states: TrainingSet, predicted: Beams, true: Array) -> Iterator[StateError]:
    """Yield the errors of the critical depths by `fem.stability` that lie within the range of the surrogate."""
    count = len(true)
    quantity, deepest = predicted.critical_depth(), predicted.deepest[:count]
    value = quantity.value[:count]
    # a beam that is stable as far as the range goes by one of both counts as critical at its end
    exists = ((true <= deepest) | (value <= deepest)) & ~np.isnan(true)
    column = Quantity(np.minimum(value, deepest)[:, None], quantity.half_width[:count, None])
    column = Quantity(column.value, np.where(np.isfinite(column.half_width), column.half_width, 0.0))
    shown = np.where(exists, np.minimum(true, deepest), np.nan)[:, None]
    none = np.zeros_like(shown)
    yield from _rows(states, "critical depth", "depth", shown, none, shown, column, column.value)


def _rows(
    states: TrainingSet, kind: str, name: str, depth: Array, shear: Array, true: Array, quantity: Quantity, rod: Array
) -> Iterator[StateError]:
    """Yield the errors of one quantity, arrays (n, k), without the states that do not exist."""
    b = states.beams
    for k, i in np.argwhere(~np.isnan(true)):
        unit = 100 / float(rod[k, i])
        yield StateError(
            beam=int(k),
            kind=kind,
            quantity=name,
            L_over_D=float(b.L[k]),
            magnet_diameter_over_D=float(b.diameter[k]),
            magnet_height_over_D=float(b.height[k]),
            nu=float(b.nu[k]),
            depth_over_D=float(depth[k, i]),
            shear_over_D=float(shear[k, i]),
            fem=float(true[k, i]),
            surrogate=float(quantity.value[k, i]),
            error_percent=unit * float(quantity.value[k, i] - true[k, i]),
            interval_percent=abs(unit) * float(quantity.half_width[k, i]),
        )
