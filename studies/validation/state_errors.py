"""Errors of the surrogate in finite-element states of beams, and the scaling of its intervals to them.

Errors are in percent of the yardstick of the quantity: of the value itself, of the length of the vector of force or
shift in a shear, of the loss 1 - k/k_0 of the sideways stiffness, of the critical depth. They are differences from
finite elements at the level of training, whose own error is estimated: an interval counts as holding the truth only
if it holds every value that this estimate allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from studies.surrogate import prediction, surrogate_range
from studies.surrogate.prediction import CRITICAL, Beams, Quantity
from studies.surrogate.surrogate_file import Group, Surrogate
from studies.validation.calibration import quantiles_by_region
from studies.validation.surrogate_fit import TrainingSet
from studies.validation.training_beams import Beams as TrainingBeams
from studies.validation.training_states import States

PRESS_KIND, SHEAR_KIND, MODE_KIND, CRITICAL_KIND = "press", "shear", "mode", "critical depth"
"""Kinds of states."""
MAGNET = ("magnet_diameter_over_D", "magnet_height_over_D")
HALF = 0.5
"""Share of the range of the depths, in their roots, beyond which a press is deep."""


@dataclass(frozen=True, slots=True)
class StateError:
    """Error of one quantity in one state.

    Attributes
    ----------
    kind : press, shear, critical depth or mode.
    error_percent, interval_percent : error, and half width of the 90 % interval, of the yardstick.
    fem_error_percent : estimated error of the finite elements themselves, of the yardstick; NaN if it is unknown.
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
    fem_error_percent: float

    @property
    def score(self) -> float:
        """Largest distance of the truth over the half width; infinite where any of the three is unknown."""
        score = (abs(self.error_percent) + self.fem_error_percent) / self.interval_percent
        return score if math.isfinite(score) else math.inf

    @property
    def covered(self) -> bool:
        """Whether the interval holds the truth."""
        return self.score <= 1.0


def errors(surrogate: Surrogate, states: TrainingSet) -> list[StateError]:
    """Return the errors of a surrogate in all states of a set."""
    predicted = _predicted(surrogate, states.beams)
    return [*_presses(states, predicted), *_shears(states, predicted), *_modes(states, predicted)]


def critical_errors(surrogate: Surrogate, states: TrainingSet, critical: States) -> list[StateError]:
    """Return the errors of the critical depths by `fem.analyses.stability` of the first beams, within the range."""
    if not len(critical.depth):
        return []
    first = states.beams[: len(critical.depth)]
    predicted = _predicted(surrogate, first)
    deepest, true = predicted.deepest[:, None], critical.quantities["depth"]
    # a beam that is stable as far as the range goes by one of both counts as critical at its end
    value = np.minimum(predicted.critical_depth().value[:, None], deepest)
    exists = (true < deepest) | (value < deepest)
    shown = np.where(exists, true, np.nan)
    column = Quantity(value, value * predicted.critical_spread[:, None])
    one = replace(critical, depth=shown, quantities={"depth": shown})
    return list(_rows(first, CRITICAL_KIND, "depth", one, "depth", column, value))


def _predicted(surrogate: Surrogate, b: TrainingBeams) -> Beams:
    return Beams(b.L, b.diameter, b.height, b.nu, b.edge, surrogate)


def recalibrated(surrogate: Surrogate, rows: Sequence[StateError]) -> Surrogate:
    """Return the surrogate with intervals scaled to the errors of random beams, by quantity and region.

    The intervals of presses are scaled apart in light and in deep ones.
    """
    kinds = dict.fromkeys(surrogate.groups, PRESS_KIND) | dict.fromkeys(("shear", "shear_skin"), SHEAR_KIND)
    kinds["mode"] = MODE_KIND
    return replace(
        surrogate, groups={name: _scaled(group, kinds[name], rows) for name, group in surrogate.groups.items()}
    )


def _scaled(group: Group, kind: str, rows: Sequence[StateError]) -> Group:
    quantiles: dict[str, Array] = {}
    for name, values in group.quantiles.items():
        wanted = (CRITICAL_KIND, "depth") if name == CRITICAL else (kind, name)
        own = [row for row in rows if (row.kind, row.quantity) == wanted]
        if not own:
            quantiles[name] = values
        elif wanted[0] == PRESS_KIND:
            # light and deep presses apart: the error of a light one is that of the contact's mesh
            deep = _shares(own) > HALF
            factors = [_factors([row for row, at in zip(own, part, strict=True) if at]) for part in (~deep, deep)]
            quantiles[name] = values * np.where(prediction.root_shares() > HALF, factors[1], factors[0])
        else:
            # the quantiles of shears have the regions twice: above light and above deep presses
            quantiles[name] = values * np.tile(_factors(own), (len(values) // prediction.REGIONS, 1))
    return replace(group, quantiles=quantiles)


def _factors(rows: Sequence[StateError]) -> Array:
    """Return the quantile of the beams' scores in each region, shape (REGIONS, 1)."""
    scores: dict[int, float] = {}
    for row in rows:
        scores[row.beam] = max(scores.get(row.beam, 0.0), row.score)
    first = {row.beam: row for row in rows}
    L, diameter, height = _columns([first[beam] for beam in scores], "L_over_D", *MAGNET)
    region = prediction.beam_region(L, diameter, height)
    return quantiles_by_region(np.array(list(scores.values()))[:, None], region, prediction.REGIONS)


def _shares(rows: Sequence[StateError]) -> Array:
    """Return where the depth of each press lies in the range of the depths, 0 to 1 in the roots."""
    L, diameter, height, depth = _columns(rows, "L_over_D", *MAGNET, "depth_over_D")
    low = np.sqrt(surrogate_range.SHALLOWEST)
    high = np.sqrt(surrogate_range.deepest(L, diameter, height))
    return np.asarray((np.sqrt(depth) - low) / (high - low))


def _columns(rows: Sequence[StateError], *names: str) -> list[Array]:
    return [np.array([getattr(row, name) for row in rows]) for name in names]


def _presses(states: TrainingSet, predicted: Beams) -> Iterator[StateError]:
    press = states.press
    for name, quantity in predicted.press(press.depth).items():
        rod = 1 - quantity.value if name == "sideways_ratio" else quantity.value
        column = {"force": "force_z", "shift": "shift_z"}.get(name, name)
        yield from _rows(states.beams, PRESS_KIND, name, press, column, quantity, rod)


def _shears(states: TrainingSet, predicted: Beams) -> Iterator[StateError]:
    shear = states.shear
    found = predicted.shear(shear.depth, shear.shear, beyond_stable=True)
    rods = prediction.yardsticks({name: quantity.value for name, quantity in found.items()})
    for name, quantity in found.items():
        yield from _rows(states.beams, SHEAR_KIND, name, shear, name, quantity, rods[name])


def _modes(states: TrainingSet, predicted: Beams) -> Iterator[StateError]:
    quantity = predicted.first_mode(states.beams.density_ratio)
    column = Quantity(quantity.value[:, None], quantity.half_width[:, None])
    yield from _rows(states.beams, MODE_KIND, "frequency", states.mode, "frequency", column, column.value)


def _rows(
    b: TrainingBeams, kind: str, name: str, states: States, column: str, quantity: Quantity, rod: Array
) -> Iterator[StateError]:
    """Yield the errors of one quantity, arrays (n, k), without the states that do not exist.

    Parameters
    ----------
    column : name of the quantity in the states; those count the magnet's sinking as negative.
    """
    true = states.quantities[column] * (-1.0 if column == "shift_z" else 1.0)
    own = states.errors.get(column, np.full(true.shape, np.nan))
    for k, i in np.argwhere(~np.isnan(true)):
        unit = 100 / abs(float(rod[k, i]))
        yield StateError(
            beam=int(k),
            kind=kind,
            quantity=name,
            L_over_D=float(b.L[k]),
            magnet_diameter_over_D=float(b.diameter[k]),
            magnet_height_over_D=float(b.height[k]),
            nu=float(b.nu[k]),
            depth_over_D=float(states.depth[k, i]),
            shear_over_D=float(states.shear[k, i]),
            fem=float(true[k, i]),
            surrogate=float(quantity.value[k, i]),
            error_percent=unit * float(quantity.value[k, i] - true[k, i]),
            interval_percent=unit * float(quantity.half_width[k, i]),
            fem_error_percent=unit * float(own[k, i]),
        )
