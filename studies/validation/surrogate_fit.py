"""From finite-element states of beams to a surrogate: outputs, length scales, calibrated errors.

The forms of the outputs are those of `studies.mechanics.prediction`. No formula is a trend below them: with level
paper as the trend, the 95th percentile of the errors of the press force in 437 left-out beams was 1.01 % in place of
0.87 %; level finite alone, in its range, was 2.5 % off in 26 unseen beams, where the surrogate was 0.47 % off (commit
ca06535).

Intervals. An interval is the prediction plus or minus q g y, with the spread g of the Gaussian process, the yardstick
y of the quantity, and the quantile q of scores. A score is (|error| + own error of the finite elements) / (g y), so
that the interval is one for the converged answer and not for a mesh. With the ceil(0.9 (n + 1))-th smallest of n
scores it holds the truth of a beam that is drawn like those of the scores with a probability of at least 0.9 (Vovk
et al. 2005; Lei et al. 2018). That needs independent scores. The errors in the states of one beam are correlated, so
a beam has a single score: the largest one of its states. An interval then holds in all of them.

The quantiles are found in two steps. The errors of the training beams, each predicted from all others, tell by region
and node how large errors are there (the jackknife; Barber et al. 2021). Training beams are not drawn like a user's,
and know the errors at the nodes only. So random beams at random depths and shears, on which nothing else depends,
scale the intervals: the quantile of their scores over their half widths, by quantity and region, multiplies the first
ones. It is that of the region's beams alone.

Length scales. With the outputs' variances and trends at their best values, the logarithm of the restricted likelihood
is, up to a constant (Rasmussen and Williams 2006, section 2.7),

    -2 l = sum_q (N - m) log s_q^2 + q (log det K + log det H^T K^-1 H),   s_q^2 = y_q P y_q / (N - m),

with P the precision of `GaussianProcess.inverse` and m the number of coefficients of the trend.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize

from geometry.arrays import Array
from studies.mechanics import prediction, surrogate_range
from studies.mechanics.prediction import POSE, PRESS, SHEAR, SKIN, STRAIN
from studies.mechanics.surrogate_file import ROOT5, GaussianProcess, Group, Surrogate, with_constant
from studies.validation.surrogate_training import Beams, States, deepest, density_ratio, joined

LEAST_LOSS = 1e-4
"""Least loss 1 - k/k_0 of the sideways stiffness whose logarithm is taken: below it lies the error of the mesh."""
LEAST_DROP = 1e-4
"""Least decrease of the normal force over E D^2, divided by the square of the shear over D."""


class TrainingSet(NamedTuple):
    beams: Beams
    press: States
    mode: States
    shear: States

    def complete(self) -> TrainingSet:
        needed = self.press["force_x"], self.press["sideways_ratio"], self.shear["force_x"], self.mode["frequency"]
        rows = ~np.isnan(np.hstack(needed)).any(axis=1)
        return TrainingSet(self.beams[rows], *({name: q[rows] for name, q in part.items()} for part in self[1:]))

    def joined(self, other: TrainingSet) -> TrainingSet:
        pairs = zip(self[1:], other[1:], strict=True)
        parts = ({name: np.concatenate([q, two[name]]) for name, q in one.items()} for one, two in pairs)
        return TrainingSet(joined(self.beams, other.beams), *parts)


def press_outputs(press: States) -> dict[str, Array]:
    q, depth = press, press["depth"]
    return {
        "force": np.log(q["force_z"] / depth**1.5),
        "shift": np.log(-q["shift_z"] / depth),
        "contact_radius": np.log(q["contact_radius"] / np.sqrt(depth / 2)),
        "strain": np.log(q["strain"]),
        "sideways_ratio": np.log(np.maximum(1 - q["sideways_ratio"], LEAST_LOSS)),
    }


def shear_outputs(shear: States, L: Array, pressed: Mapping[str, Array]) -> dict[str, Array]:
    """Return the shear's forms, (n, nodes) each, by quantity.

    L are lengths of the beams, `pressed` force and shift (down) of the press at the depth of each shear, (n, 1) each.
    """
    q, s = shear, shear["shear"]
    return {
        "force_x": q["force_x"] / s * prediction.compliance(L),
        # the plate is pushed back less in a shear; a rise would be an error of the mesh
        "force_z": np.log(np.maximum(pressed["force"] - q["force_z"], LEAST_DROP * s**2) / s**2),
        "shift_x": q["shift_x"] / s,
        "shift_z": (-q["shift_z"] - pressed["shift"]) / s**2,
        "tilt": q["tilt"] / s,
        "contact_radius": np.log(q["contact_radius"] / np.sqrt(q["depth"] / 2)),
        "strain": np.log(q["strain"]),
    }


def surrogate_of(states: TrainingSet, about: Mapping[str, Any]) -> Surrogate:
    b = states.beams
    x = prediction.features(b.L, b.diameter, b.height, b.nu, b.edge)
    region = prediction.beam_region(b.L, b.diameter, b.height)
    outputs = press_outputs(states.press) | {"frequency": np.log(states.mode["frequency"])}
    kinds = {"press": (PRESS, x), "strain": (STRAIN, x)}
    kinds["mode"] = ("frequency",), prediction.mode_features(x, density_ratio(b))
    groups: dict[str, Group] = {}
    left_out: dict[str, Array] = {}
    for name, (quantities, points) in kinds.items():
        process, forms, g = _trained(points, outputs, quantities)
        left_out |= forms
        quantiles = {
            quantity: quantiles_by_region(np.abs(1 - np.exp(outputs[quantity] - logs)) / g, region)
            for quantity, logs in forms.items()
        }
        if name == "strain":
            widths = (g * quantiles["sideways_ratio"][region]).mean(axis=1)
            ratios = outputs["sideways_ratio"], forms["sideways_ratio"]
            quantiles[prediction.CRITICAL] = _critical_quantiles(states.press["depth"], *ratios, widths, region)
        groups[name] = Group(process, quantities, 1 if name == "mode" else surrogate_range.PRESS_NODES, quantiles)
    return Surrogate(groups | _shear_groups(states, x, left_out, region), about)


def _trained(
    points: Array, outputs: Mapping[str, Array], quantities: Sequence[str]
) -> tuple[GaussianProcess, dict[str, Array], Array]:
    """Return the process of some outputs, what it predicts of each point from all others, and the spreads, (n, 1)."""
    process = fitted(points, np.hstack([outputs[quantity] for quantity in quantities]))
    predicted, g = process.left_out()
    forms = np.split(predicted, len(quantities), axis=1)
    return process, dict(zip(quantities, forms, strict=True)), g[:, None]


def _critical_quantiles(
    depth: Array, true: Array, predicted: Array, widths: Array, region: NDArray[np.int64]
) -> Array:
    """Return the quantiles of the critical depth's errors, over the depth and the mean width of the stiffness."""
    share = np.linspace(0, 1, prediction.CRITICAL_GRID)
    low, high = np.sqrt(depth[:, :1]), np.sqrt(depth[:, -1:])
    grid = (low + (high - low) * share) ** 2

    def zero(logs: Array) -> Array:
        values = prediction.through_roots(logs, np.broadcast_to(share, grid.shape))
        return np.minimum(prediction.first_zero(grid, -values), depth[:, -1])

    one, other = zero(predicted), zero(true)
    # a beam without a critical depth by both has no error
    exists = (one < depth[:, -1]) | (other < depth[:, -1])
    scores = np.abs(one - other) / (one * widths)
    return quantiles_by_region(scores[exists, None], region[exists])


def _shear_groups(
    states: TrainingSet, x: Array, left_out: Mapping[str, Array], region: NDArray[np.int64]
) -> dict[str, Group]:
    """Return the groups of shears; their errors include those of the press that a shear begins from."""
    shear, L = states.shear, states.beams.L[:, None]
    depth, s = shear["depth"][:, :1], shear["shear"]
    outputs = shear_outputs(shear, L, press_at(states.beams, press_outputs(states.press), depth))
    points = prediction.shear_features(x, depth[:, 0])
    parts = {name: _trained(points, outputs, own) for name, own in (("shear", POSE), ("shear_skin", SKIN))}
    forms = {quantity: logs for _, own, _ in parts.values() for quantity, logs in own.items()}
    spreads = {quantity: g for _, own, g in parts.values() for quantity in own}
    values = prediction.shear_values(forms, L, depth, s, press_at(states.beams, left_out, depth))
    rods = prediction.yardsticks(values)
    truth = {name: -shear[name] if name == "shift_z" else shear[name] for name in SHEAR}
    where = prediction.shear_region(region, depth[:, 0])
    quantiles = {
        name: quantiles_by_region(
            np.abs(values[name] - truth[name]) / (rods[name] * spreads[name]), where, 2 * prediction.REGIONS
        )
        for name in SHEAR
    }
    nodes = len(surrogate_range.SHEAR_NODES)
    return {
        name: Group(process, tuple(own), nodes, {quantity: quantiles[quantity] for quantity in own})
        for name, (process, own, _) in parts.items()
    }


def press_at(beams: Beams, logs: Mapping[str, Array], depth: Array) -> dict[str, Array]:
    """Return force and shift (down) of presses at depths (n, 1) from the logarithms of their forms at the nodes."""
    low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(deepest(beams))[:, None]
    share = (np.sqrt(depth) - low) / (high - low)
    return {
        "force": depth**1.5 * np.exp(prediction.through_roots(logs["force"], share)),
        "shift": depth * np.exp(prediction.through_roots(logs["shift"], share)),
    }


# Intervals

COVERAGE = 0.9
FEWEST = 20
"""Least number of scores of a region with a quantile of its own; the others share that of all beams. Of 20 scores it
is the second largest."""


def conformal_quantile(scores: Array) -> Array:
    """Return the conformal quantile of scores (n, ...), shape (...); an unknown score (NaN) counts as infinite.

    >>> float(conformal_quantile(np.arange(1.0, 100.0)))
    90.0
    """
    n = len(scores)
    rank = min(math.ceil(COVERAGE * (n + 1)), n)
    return np.asarray(np.sort(np.nan_to_num(scores, nan=np.inf), axis=0)[rank - 1])


def quantiles_by_region(scores: Array, region: NDArray[np.int64], regions: int = prediction.REGIONS) -> Array:
    parts = [scores[region == k] for k in range(regions)]
    return np.array([conformal_quantile(own if len(own) >= FEWEST else scores) for own in parts])


# Length scales

LENGTHS, NUGGETS = (0.05, 50.0), (1e-8, 1e-2)
"""Bounds of the length scales, over the spread of the input, and of the nugget."""


def fitted(x: Array, y: Array) -> GaussianProcess:
    """Return the process with the most likely length scales and nugget for points (N, p) and outputs (N, q)."""
    scale = x.std(axis=0)
    bounds = [(np.log(LENGTHS[0] * s), np.log(LENGTHS[1] * s)) for s in scale]
    bounds.append((np.log(NUGGETS[0]), np.log(NUGGETS[1])))
    # outputs of different size count alike
    unit = (y - y.mean(axis=0)) / y.std(axis=0)
    begin = np.log(np.append(2 * scale, 1e-5))
    best = optimize.minimize(
        _misfit, begin, args=(x, unit), jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": 60}
    )
    return GaussianProcess(x, y, np.exp(best.x[:-1]), float(np.exp(best.x[-1])))


def _misfit(logs: Array, x: Array, y: Array) -> tuple[float, Array]:
    """Return -l / (N q) and its derivatives by the logarithms of length scales and nugget."""
    lengths, nugget = np.exp(logs[:-1]), np.exp(logs[-1])
    (count, outputs), terms = y.shape, x.shape[1] + 1
    process = GaussianProcess(x, y, lengths, float(nugget))
    P = process.inverse
    Py = P @ y
    power = np.einsum("nq,nq->q", y, Py)
    whitened = linalg.solve_triangular(process.factor, with_constant(x), lower=True)
    determinant = 2 * np.log(np.diag(process.factor)).sum() + np.linalg.slogdet(whitened.T @ whitened)[1]
    value = (count - terms) * np.log(power).sum() + outputs * determinant
    # d(-2 l) = outputs tr(P dK) - (N - m) sum_q Py_q dK Py_q / power_q
    S = outputs * P - (count - terms) * (Py / power) @ Py.T
    scaled = x / lengths
    distance = np.sqrt(np.maximum(((scaled[:, None] - scaled[None]) ** 2).sum(axis=2), 0.0))
    a = ROOT5 * distance
    # c'(r) / r = -5/3 (1 + a) exp(-a), so dK by log l_i is 5/3 (1 + a) exp(-a) times the squared difference in x_i
    common = S * (5 / 3) * (1 + a) * np.exp(-a)
    slopes = [float((common * (scaled[:, i, None] - scaled[None, :, i]) ** 2).sum()) for i in range(len(lengths))]
    slopes.append(float(nugget * np.trace(S)))
    return float(value) / (2 * count * outputs), np.array(slopes) / (2 * count * outputs)
