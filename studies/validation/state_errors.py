"""Errors of the surrogate in finite-element states of beams, and the scaling of its intervals to them.

Errors are in percent of the yardstick of the quantity: of the value itself, of the length of the vector of force or
shift in a shear, of the loss 1 - k/k_0 of the sideways stiffness, of the critical depth. They are differences from
finite elements at the level of training, whose own error is estimated: an interval counts as holding the truth only
if it holds every value that this estimate allows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from geometry.arrays import Array
from studies.surrogate import prediction, surrogate_range
from studies.surrogate.prediction import CRITICAL, Beams, Quantity
from studies.surrogate.surrogate_file import Group, Surrogate
from studies.validation.surrogate_fit import TrainingSet, quantiles_by_region
from studies.validation.training_beams import Beams as TrainingBeams
from studies.validation.training_states import States

PRESS_KIND, SHEAR_KIND, MODE_KIND, CRITICAL_KIND = "press", "shear", "mode", "critical depth"
"""Kinds of states."""
BEAM = ("L_over_D", "magnet_diameter_over_D", "magnet_height_over_D")
HALF = 0.5
"""Share of the range of the depths, in their roots, beyond which a press is deep."""


Errors = Any
"""A DataFrame with a row for each quantity of each state: beam, kind (press, shear, critical depth, mode), quantity,
the beam's numbers, depth_over_D, shear_over_D, fem, surrogate, and in percent of the yardstick error_percent,
interval_percent (half width of the 90 % interval) and fem_error_percent (NaN if it is unknown)."""


def scores(rows: Errors) -> Array:
    """Return the largest distance of the truth over the half width; infinite where any of the three is unknown."""
    score = (rows.error_percent.abs() + rows.fem_error_percent) / rows.interval_percent
    return np.where(np.isfinite(score), score, np.inf)


def errors(surrogate: Surrogate, states: TrainingSet) -> Errors:
    """Return the errors of a surrogate in all states of a set."""
    import pandas as pd

    predicted = _predicted(surrogate, states.beams)
    tables = [*_presses(states, predicted), *_shears(states, predicted), _modes(states, predicted)]
    return pd.concat(tables, ignore_index=True)


def critical_errors(surrogate: Surrogate, states: TrainingSet, critical: States) -> Errors:
    """Return the errors of the critical depths by `fem.analyses.stability` of the first beams, within the range."""
    if not len(critical.depth):
        return errors(surrogate, states).iloc[:0]
    first = states.beams[: len(critical.depth)]
    predicted = _predicted(surrogate, first)
    deepest, true = predicted.deepest[:, None], critical.quantities["depth"]
    # a beam that is stable as far as the range goes by one of both counts as critical at its end
    value = np.minimum(predicted.critical_depth().value[:, None], deepest)
    exists = (true < deepest) | (value < deepest)
    shown = np.where(exists, true, np.nan)
    column = Quantity(value, value * predicted.critical_spread[:, None])
    one = replace(critical, depth=shown, quantities={"depth": shown})
    return _rows(first, CRITICAL_KIND, "depth", one, "depth", column, value)


def _predicted(surrogate: Surrogate, b: TrainingBeams) -> Beams:
    return Beams(b.L, b.diameter, b.height, b.nu, b.edge, surrogate)


def recalibrated(surrogate: Surrogate, rows: Errors) -> Surrogate:
    """Return the surrogate with intervals scaled to the errors of random beams, by quantity and region.

    The intervals of presses are scaled apart in light and in deep ones.
    """
    kinds = dict.fromkeys(surrogate.groups, PRESS_KIND) | dict.fromkeys(("shear", "shear_skin"), SHEAR_KIND)
    kinds["mode"] = MODE_KIND
    return replace(
        surrogate, groups={name: _scaled(group, kinds[name], rows) for name, group in surrogate.groups.items()}
    )


def _scaled(group: Group, kind: str, rows: Errors) -> Group:
    quantiles: dict[str, Array] = {}
    for name, values in group.quantiles.items():
        wanted = (CRITICAL_KIND, "depth") if name == CRITICAL else (kind, name)
        own = rows[(rows.kind == wanted[0]) & (rows.quantity == wanted[1])]
        if own.empty:
            quantiles[name] = values
        elif wanted[0] == PRESS_KIND:
            # light and deep presses apart: the error of a light one is that of the contact's mesh
            deep = _shares(own) > HALF
            factors = [_factors(own[part]) for part in (~deep, deep)]
            quantiles[name] = values * np.where(prediction.root_shares() > HALF, factors[1], factors[0])
        else:
            # the quantiles of shears have the regions twice: above light and above deep presses
            quantiles[name] = values * np.tile(_factors(own), (len(values) // prediction.REGIONS, 1))
    return replace(group, quantiles=quantiles)


def _factors(rows: Errors) -> Array:
    """Return the quantile of the beams' scores in each region, shape (REGIONS, 1)."""
    beams = rows.assign(score=scores(rows)).groupby("beam", sort=False)
    first, worst = beams.first(), beams["score"].max().to_numpy()
    region = prediction.beam_region(*(first[name].to_numpy() for name in BEAM))
    return quantiles_by_region(worst[:, None], region, prediction.REGIONS)


def _shares(rows: Errors) -> Array:
    """Return where the depth of each press lies in the range of the depths, 0 to 1 in the roots."""
    low = np.sqrt(surrogate_range.SHALLOWEST)
    high = np.sqrt(surrogate_range.deepest(*(rows[name].to_numpy() for name in BEAM)))
    return np.asarray((np.sqrt(rows.depth_over_D.to_numpy()) - low) / (high - low))


def _presses(states: TrainingSet, predicted: Beams) -> Iterator[Errors]:
    press = states.press
    for name, quantity in predicted.press(press.depth).items():
        rod = 1 - quantity.value if name == "sideways_ratio" else quantity.value
        column = {"force": "force_z", "shift": "shift_z"}.get(name, name)
        yield _rows(states.beams, PRESS_KIND, name, press, column, quantity, rod)


def _shears(states: TrainingSet, predicted: Beams) -> Iterator[Errors]:
    shear = states.shear
    found = predicted.shear(shear.depth, shear.shear, beyond_stable=True)
    rods = prediction.yardsticks({name: quantity.value for name, quantity in found.items()})
    for name, quantity in found.items():
        yield _rows(states.beams, SHEAR_KIND, name, shear, name, quantity, rods[name])


def _modes(states: TrainingSet, predicted: Beams) -> Errors:
    quantity = predicted.first_mode(states.beams.density_ratio)
    column = Quantity(quantity.value[:, None], quantity.half_width[:, None])
    return _rows(states.beams, MODE_KIND, "frequency", states.mode, "frequency", column, column.value)


def _rows(
    b: TrainingBeams, kind: str, name: str, states: States, column: str, quantity: Quantity, rod: Array
) -> Errors:
    """Return the errors of one quantity, arrays (n, k), without the states that do not exist.

    Parameters
    ----------
    column : name of the quantity in the states; those count the magnet's sinking as negative.
    """
    import pandas as pd

    true = states.quantities[column] * (-1.0 if column == "shift_z" else 1.0)
    own = states.errors.get(column, np.full(true.shape, np.nan))
    at = np.nonzero(~np.isnan(true))
    beam, unit = at[0], 100 / np.abs(rod[at])
    return pd.DataFrame(
        {
            "beam": beam,
            "kind": kind,
            "quantity": name,
            "L_over_D": b.L[beam],
            "magnet_diameter_over_D": b.diameter[beam],
            "magnet_height_over_D": b.height[beam],
            "nu": b.nu[beam],
            "depth_over_D": states.depth[at],
            "shear_over_D": states.shear[at],
            "fem": true[at],
            "surrogate": quantity.value[at],
            "error_percent": unit * (quantity.value[at] - true[at]),
            "interval_percent": unit * quantity.half_width[at],
            "fem_error_percent": unit * own[at],
        }
    )
