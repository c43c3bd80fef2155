"""From beams of the range and their finite-element states to a surrogate: outputs, length scales, calibrated errors.

A Gaussian process extrapolates badly. So training begins with the corners of the range, and the scrambled Sobol
points that follow are stretched beyond it and cut at its faces: two of three lie on a face. Later points fill the
gaps between the first ones. Beams of calibration and test are independent random points, the same number in each
region of the beams, so that no region's intervals rest on a handful of beams.

States are presses, first modes, critical depths and glued shears, from the store or solved. A shear begins at a depth
between `SHALLOWEST_SHEAR` and the deepest press, but before the tip would buckle sideways: beyond that depth an
equilibrium depends on the path. So presses come first, and tell each beam's critical depth. The finite elements have
an error of their own. Answers bring estimates of it for force, shift and tilt; for the other quantities it is taken
for the difference from the same state on the coarser mesh (`compared`).

The forms of the outputs are those of `studies.beam.prediction`. No formula is a trend below them: with level
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
ones. It is that of the region's beams alone, light and deep presses together: two quantiles for them would hold both
in eight beams of ten. Medians of the scores tell how much larger those of light presses are, whose errors are those
of the contact's mesh; a median depends so little on a single beam that it leaves the coverage as it is. Of 24 scores
the quantile is the second largest, which 23 of 25 beams do not exceed on average.

Length scales. With the outputs' variances and trends at their best values, the logarithm of the restricted likelihood
is, up to a constant (Rasmussen and Williams 2006, section 2.7),

    -2 l = sum_q (N - m) log s_q^2 + q (log det K + log det H^T K^-1 H),   s_q^2 = y_q P y_q / (N - m),

with P the precision of `GaussianProcess.inverse` and m the number of coefficients of the trend.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize
from scipy.stats import qmc

from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Load
from studies.beam import prediction, surrogate_range
from studies.beam.beam_model import ODD
from studies.beam.prediction import POSE, PRESS, SHEAR, SKIN, STRAIN, first_zero
from studies.beam.surrogate_file import ROOT5, GaussianProcess, Group, Surrogate, with_constant
from studies.beam.surrogate_range import DENSITY_RATIO, DIAMETER, EDGE, HEIGHT, LEAST_WALL, LENGTH, POISSON
from studies.cases import FiniteElements
from studies.simulation.solved_beams import SolvedBeams

DIAMETER_MM = 10.0
"""D of the designs that are solved; the answers hold for every D."""
DIGITS = 5
"""Digits of the lengths over D: a design file can repeat a beam exactly."""
DIMENSIONS = 6
STRETCH = 1.2
"""Factor by which Sobol points are stretched from the centre of the cube, before they are cut at its faces."""
SAFE = 0.95
"""Deepest shear over the critical depth."""
Beams = Any
"""Beams of the surrogate, a record array of shape (n,) with fields BEAM."""
BEAM = np.dtype([(name, float) for name in ("L", "diameter", "height", "nu", "edge", "share")])
"""Length and size of the magnet over D, Poisson's ratio, radius of the magnet's edges over the smaller side of its
section; where the depth of its shear lies between the least and the largest one, 0 to 1 in the root of the depth."""
States = Mapping[str, Array]
"""States of beams by names: depth and shear over D, forces over E D^2, lengths over D (shift_z down), tilt in rad,
frequencies over `frequency_unit`, arrays of shape (n, k), NaN where a solve failed; and, behind `_error`, the
estimated errors of the finite elements themselves, NaN or missing where they are unknown."""


def in_range(beams: Beams) -> NDArray[np.bool_]:
    return np.asarray(surrogate_range.below(beams.L, beams.height) >= surrogate_range.LEAST_BELOW)


def deepest(beams: Beams) -> Array:
    return np.asarray(surrogate_range.deepest(beams.L, beams.diameter, beams.height))


def density_ratio(beams: Beams) -> Array:
    """Return the density of the magnet over that of the silicone, for the natural frequencies.

    It follows the last coordinate, which matters to shears only otherwise.
    """
    low, high = DENSITY_RATIO
    return np.asarray(np.round(low + (high - low) * beams.share, DIGITS))


def design(beam: Any) -> Design:
    """Return a beam as a design of D = 10 mm and E = 1 MPa."""
    L, diameter, height, nu, edge = (
        round(float(value), DIGITS)
        for value in (beam.L, beam.diameter, beam.height, beam.nu, beam.edge * min(beam.diameter, beam.height))
    )
    magnet: dict[str, Any] = {"magnet_diameter": diameter, "magnet_height": height, "magnet_edge_radius": edge}
    D = DIAMETER_MM
    return Design(D=D, L=L * D, nu=nu, l0=10 * D, **{name: value * D for name, value in magnet.items()})


def training_beams(count: int, seed: int) -> Beams:
    """Return the first `count` beams of training; more beams keep the first ones."""
    points = qmc.Sobol(DIMENSIONS, rng=seed)
    return _filled(corners(), count, lambda: np.clip(0.5 + STRETCH * (points.random(1024) - 0.5), 0.0, 1.0))


def random_beams(count: int, seed: int) -> Beams:
    rng = np.random.default_rng(seed)
    return _filled(of_cube(np.empty((0, DIMENSIONS))), count, lambda: rng.random((1024, DIMENSIONS)))


def _filled(found: Beams, count: int, draw: Callable[[], Array]) -> Beams:
    """Return some beams and, up to `count`, those in the range of points of the unit cube that are drawn."""
    while len(found) < count:
        beams = of_cube(draw())
        found = joined(found, beams[in_range(beams)])
    return found[:count]


def corners() -> Beams:
    """Return the corners of the range of L, diameter, height and nu, each with two edges and depths of its shear.

    A magnet that is too high for its beam is as high as the walls allow.
    """
    unit = np.array(list(itertools.product((0.0, 1.0), repeat=5)))
    # the share changes with the parity of the others: half of the corners of the six dimensions; mixed, so that the
    # first few differ in all of them
    unit = np.random.default_rng(0).permutation(np.column_stack([unit, unit.sum(axis=1) % 2]))
    low, high = np.zeros(len(unit)), unit[:, 2].copy()

    def possible(height: Array) -> NDArray[np.bool_]:
        beams = _scaled(np.column_stack([unit[:, :2], height, unit[:, 3:]]))
        return np.asarray(_walled(beams) & in_range(beams))

    for _ in range(40):
        middle = (low + high) / 2
        fits = possible(middle)
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    height = np.where(possible(unit[:, 2]), unit[:, 2], low - 1e-4)
    return of_cube(np.column_stack([unit[:, :2], height, unit[:, 3:]]))


def regional_beams(count: int, seed: int) -> Beams:
    """Return `count` independent random beams of each region, region after region in turn; more keep the first."""
    many = random_beams(100 * count * prediction.REGIONS, seed)
    region = prediction.beam_region(many.L, many.diameter, many.height)
    rows = [np.flatnonzero(region == k)[:count] for k in range(prediction.REGIONS)]
    return many[np.stack(rows, axis=1).ravel()]


def of_cube(unit: Array) -> Beams:
    """Return the beams of points of the unit cube, shape (n, 6), without those whose magnet leaves too thin a wall.

    The length is spread on a log scale. Poisson's ratio is spread in (1 - 2 nu)^(1/2): most silicones are close to
    0.5, and the response changes with 1 - 2 nu.
    """
    beams = _scaled(unit)
    return beams[_walled(beams)]


def _scaled(unit: Array) -> Beams:
    low, high = LENGTH
    soft = 1 - 2 * POISSON[0]
    L = low * (high / low) ** unit[:, 0]
    d, h, edge = (a + (b - a) * unit[:, k] for k, (a, b) in ((1, DIAMETER), (2, HEIGHT), (4, EDGE)))
    nu = (1 - soft * unit[:, 3] ** 2) / 2
    L, d, h, nu, edge = (np.round(x, DIGITS) for x in (L, d, h, nu, edge))
    return np.rec.fromarrays([L, d, h, nu, edge, unit[:, 5]], dtype=BEAM)


def _walled(beams: Beams) -> NDArray[np.bool_]:
    return np.asarray(surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge) >= LEAST_WALL)


def joined(*parts: Beams) -> Beams:
    return np.concatenate(parts).view(np.recarray)


# States


def compared(states: States, coarse: States) -> States:
    """Return states with errors, where they have none, that are the differences from coarser ones."""
    return {f"{name}_error": np.abs(q - coarse[name]) for name, q in states.items() if name in coarse} | dict(states)


ASKED = ("force", "shift", "tilt", "contact_radius", "strain", "sideways_stiffness")
"""Quantities of finite elements."""


def motions(fem: FiniteElements, beams: Beams, depth: Array, shear: Array | float = 0.0) -> States:
    depth, shear = np.broadcast_arrays(depth, shear)
    found = SolvedBeams([design(beam) for beam in beams], fem, ASKED).states(depth, shear).quantities
    # presses have nothing sideways
    told = [name for name in found if shear.any() or name not in ODD]
    errors = {f"{name}_error": found[name].half_width for name in told if name in POSE}
    return {"depth": depth, "shear": shear, **{name: found[name].value for name in told}, **errors}


def critical_depths(fem: FiniteElements, beams: Beams) -> States:
    """Return the critical depths over D, at most the deepest press of the surrogate; NaN where a search fails."""
    designs, most = [design(beam) for beam in beams], deepest(beams)
    if not designs:
        return _single("depth", most)
    answers = fem.answers([(one, Load(depth=0.0)) for one in designs], ["critical_depth"])
    depth, stable = (answers[name].to_numpy() / DIAMETER_MM for name in ("critical_depth_mm", "stable_to_mm"))
    found = np.where(np.isnan(depth) & (stable >= most - 1e-9), most, depth)
    return _single("depth", np.minimum(found, most))


def first_modes(fem: FiniteElements, beams: Beams) -> States:
    solved = SolvedBeams([design(beam) for beam in beams], fem)
    return _single("frequency", solved.first_mode(density_ratio(beams)).value)


def shear_depth(beams: Beams, press: States) -> Array:
    """Return the depth of each beam's shear, over D, shape (n,), above the depth at which its press buckles."""
    low = np.sqrt(surrogate_range.SHALLOWEST_SHEAR)
    critical = first_zero(press["depth"], np.nan_to_num(press["sideways_ratio"], nan=-1.0))
    most = np.minimum(deepest(beams), SAFE * critical)
    high = np.maximum(np.sqrt(most), low)
    return np.asarray(np.round((low + (high - low) * beams.share) ** 2, 5))


def _single(name: str, values: Array) -> States:
    column = values[:, None]
    return {"depth": np.zeros_like(column), "shear": np.zeros_like(column), name: column}


# Outputs, and the surrogate that they are

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
        needed = self.press["force_z"], self.press["sideways_ratio"], self.shear["force_x"], self.mode["frequency"]
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
        "shift": np.log(q["shift_z"] / depth),
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
        "shift_z": (q["shift_z"] - pressed["shift"]) / s**2,
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
        quantiles = _left_out_quantiles(process, quantities, region)
        if name == "strain":
            widths = (g * quantiles["sideways_ratio"][region]).mean(axis=1)
            ratios = outputs["sideways_ratio"], forms["sideways_ratio"]
            quantiles[prediction.CRITICAL] = _critical_quantiles(states.press["depth"], *ratios, widths, region)
        groups[name] = Group(process, quantities, 1 if name == "mode" else surrogate_range.PRESS_NODES, quantiles)
    return Surrogate(groups | _shear_groups(states, x, left_out, region), about)


def uncalibrated(surrogate: Surrogate) -> Surrogate:
    """Return a surrogate whose press intervals are those of its training beams, as before their calibration.

    The others are scaled by one factor for a region and quantity, so that they need not be.
    """
    groups = dict(surrogate.groups)
    for name in ("press", "strain"):
        process, quantities = groups[name].process, groups[name].quantities
        # as `prediction.features` orders the inputs
        region = prediction.beam_region(np.exp(process.x[:, 0]), process.x[:, 1], process.x[:, 2])
        quantiles = {**groups[name].quantiles, **_left_out_quantiles(process, quantities, region)}
        groups[name] = replace(groups[name], quantiles=quantiles)
    return replace(surrogate, groups=groups)


def _left_out_quantiles(
    process: GaussianProcess, quantities: Sequence[str], region: NDArray[np.int64]
) -> dict[str, Array]:
    """Return the quantiles of the errors of left-out training beams, over the spread, by region and node."""
    predicted, g = process.left_out()
    scores = np.abs(1 - np.exp(process.y - predicted)) / g[:, None]
    parts = np.split(scores, len(quantities), axis=1)
    return {name: quantiles_by_region(own, region) for name, own in zip(quantities, parts, strict=True)}


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
    truth = {name: shear[name] for name in SHEAR}
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


def quantiles_by_region(
    scores: Array,
    region: NDArray[np.int64],
    regions: int = prediction.REGIONS,
    quantile: Callable[[Array], Array] = conformal_quantile,
) -> Array:
    parts = [scores[region == k] for k in range(regions)]
    return np.array([quantile(own if len(own) >= FEWEST else scores) for own in parts])


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
