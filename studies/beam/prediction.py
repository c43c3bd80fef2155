"""Responses of many beams at once, predicted from finite-element states, with intervals for the errors.

All lengths are over D, forces over E D^2, tilts in rad. Each quantity is predicted in a form that varies little over
beams and loads (`PRESS_FORMS`, `shear_forms`):

- a frictionless press to a depth d: F / d^1.5, as in Hertz's law; -u_z / d; a / (d/2)^0.5, with the contact radius a;
  the strain; 1 - k/k_0, with the sideways stiffness k, which is the share of the buckling load. The logarithm of each
  at `PRESS_NODES` depths is an output of the Gaussian process, and a polynomial in d^0.5 goes through these;
- a glued shear s at a depth: C F_x / s, with the compliance C of a uniform cantilever, u_x / s and tilt / s are even
  functions of s, and so are the changes of F_z and u_z from the press, over s^2; that of F_z is a decrease, and its
  logarithm is taken. Polynomials in s^2 go through the values at `SHEAR_NODES`. F_z and u_z at s = 0 are those of the
  press, which therefore goes over into the shear continuously.

Half widths are those of 90 % intervals: of nine beams in ten they hold at all loads
(`studies.validation.surrogate`). They are the spread g of the process, times a quantile, by region and node,
of errors over g, times a yardstick: the value itself, the length of the vector of force or shift in a shear, or 1 -
k/k_0. Beams and loads outside the range have NaN, and `Beams.outside` says why; so have shears above a press that is
not known to stay upright (`Beams.stable_to`), where the equilibrium depends on the path. Values of presses are those
of the upright beam, also beyond that depth: who asks for the behaviour of a sensor takes `Beams.knows`.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.beam import surrogate_file, surrogate_range
from studies.beam.beam_model import ODD, BeamStates, Quantity
from studies.beam.surrogate_file import Group, Surrogate
from studies.beam.surrogate_range import SHEAR_NODES

PRESS = ("force", "shift", "contact_radius")
STRAIN = ("strain", "sideways_ratio")
POSE = ("force_x", "force_z", "shift_x", "shift_z", "tilt")
SKIN = ("contact_radius", "strain")
SHEAR = (*POSE, *SKIN)
SLENDER, THICK, WIDE, DEEP = 2.0, 0.35, 0.5, 0.15
"""L, height and diameter of the magnet and depth of a shear, all over D, beyond which errors are calibrated by
themselves; a magnet is wide if it is not thick."""
SLACK = 1e-9
"""Of bounds over D, for rounding."""
REGIONS = 6
"""Number of regions of beams."""
CRITICAL_GRID = 49
"""Depths at which the sideways stiffness is evaluated to find its zero."""
CRITICAL = "critical_depth"
BLOCK = 256
"""Points whose correlations with the training points are computed at a time: so few stay in the processor's cache."""


def beams(
    L: Array, magnet_diameter: Array, magnet_height: Array, nu: Array, edge_radius: Array | None = None
) -> Beams:
    """Return beams for the shipped surrogate, from arrays of shape (n,); lengths over D.

    `edge_radius`: radius of the magnet's edges; default: `USUAL_EDGE` of the smaller side of the magnet's section.
    """
    d, h = np.asarray(magnet_diameter, float), np.asarray(magnet_height, float)
    smaller = np.minimum(d, h)
    edge = np.full(d.shape, surrogate_range.USUAL_EDGE) if edge_radius is None else np.asarray(edge_radius) / smaller
    return Beams(np.asarray(L, float), d, h, np.asarray(nu, float), edge, surrogate_file.shipped())


def features(L: Array, diameter: Array, height: Array, nu: Array, edge: Array) -> Array:
    """Return the inputs of the processes, shape (n, 6): numbers in which the response varies evenly.

    The silicone between magnet and base, L - 1/2 - h/2, stands beside the length: it decides how far the magnet of a
    short beam sinks.
    """
    below = np.maximum(surrogate_range.below(L, height), 1e-3)
    return np.column_stack([np.log(L), diameter, height, np.sqrt(1 - 2 * nu), edge, np.log(below)])


@dataclass(frozen=True)
class Beams:
    """Beams whose responses are predicted, arrays of shape (n,).

    L, diameter, height, nu : length, size of the magnet, over D, and Poisson's ratio.
    edge : radius of the magnet's edges over the smaller side of its section.
    """

    L: Array
    diameter: Array
    height: Array
    nu: Array
    edge: Array
    surrogate: Surrogate

    def take(self, rows: NDArray[Any]) -> Beams:
        """Return some of the beams, with what is known of them already."""
        lengths = [each[rows] for each in (self.L, self.diameter, self.height, self.nu, self.edge)]
        L, diameter, height, nu, edge = lengths
        part = Beams(L, diameter, height, nu, edge, self.surrogate)
        if "_presses" in self.__dict__:
            part.__dict__["_presses"] = {
                name: (logs[rows], widths[rows]) for name, (logs, widths) in self._presses.items()
            }
            part.__dict__["_known_stable"] = {caution: value[rows] for caution, value in self._known_stable.items()}
        return part

    @functools.cached_property
    def outside(self) -> NDArray[Any]:
        """Why the surrogate refuses a beam, "" for none that it takes; texts of shape (n,)."""
        reasons = np.full(len(self.L), "", dtype=object)
        smaller = np.minimum(self.diameter, self.height)
        wall = surrogate_range.wall(self.L, self.diameter, self.height, self.edge)
        below = surrogate_range.below(self.L, self.height)
        # the last one that applies is said; lengths are over D
        for text, values, (low, high) in (
            ("silicone around the magnet of", wall, (surrogate_range.LEAST_WALL, np.inf)),
            ("silicone below the magnet of", below, (surrogate_range.LEAST_BELOW, np.inf)),
            ("the radius of the magnet's edges", self.edge * smaller, (0.0, surrogate_range.EDGE[1] * smaller)),
            ("nu", self.nu, surrogate_range.POISSON),
            ("magnet_height/D", self.height, surrogate_range.HEIGHT),
            ("magnet_diameter/D", self.diameter, surrogate_range.DIAMETER),
            ("L/D", self.L, surrogate_range.LENGTH),
        ):
            for k in np.flatnonzero(~((values >= low - SLACK) & (values <= high + SLACK))):
                top = high[k] if isinstance(high, np.ndarray) else high
                bound = f"at least {low:g}" if top == np.inf else f"within {low:g} and {top:.4g}"
                reasons[k] = f"the surrogate knows beams with {text} {bound}; got {values[k]:.4g}"
        return reasons

    @functools.cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Which beams the surrogate takes, shape (n,)."""
        return np.asarray(self.outside == "")

    @functools.cached_property
    def deepest(self) -> Array:
        """Largest depth over D, shape (n,)."""
        return surrogate_range.deepest(self.L, self.diameter, self.height)

    @functools.cached_property
    def farthest(self) -> Array:
        """Largest shear over D, shape (n,)."""
        return surrogate_range.farthest(self.L)

    @functools.cached_property
    def features(self) -> Array:
        return features(self.L, self.diameter, self.height, self.nu, self.edge)

    @functools.cached_property
    def region(self) -> NDArray[np.int64]:
        """Region of each beam, in which its errors are calibrated, shape (n,)."""
        return beam_region(self.L, self.diameter, self.height)

    @functools.cached_property
    def _presses(self) -> dict[str, tuple[Array, Array]]:
        """Logarithms of the press's forms at the nodes, and their half widths, each (n, PRESS_NODES), by quantity."""
        found: dict[str, tuple[Array, Array]] = {}
        for name in ("press", "strain"):
            group = self.surrogate.groups[name]
            found |= _at_nodes(group, self.features, self.region)
        return found

    def press(self, depth: Array) -> dict[str, Quantity]:
        """Return the response to frictionless presses.

        `depth`: over D, shape (n, k); NaN is returned outside SHALLOWEST to `deepest`.

        Returns
        -------
        force, shift (down, positive), contact_radius, strain and sideways_ratio, each (n, k).
        """
        depth = np.where(self._can_press(depth), depth, np.nan)
        low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(self.deepest)[:, None]
        shares = (np.sqrt(depth) - low) / (high - low)
        result = {}
        for name, (logs, widths) in self._presses.items():
            form, relative = np.exp(through_roots(logs, shares)), _linear_over_roots(widths, shares)
            unit = {"force": depth**1.5, "shift": depth, "contact_radius": np.sqrt(depth / 2)}.get(name, 1.0)
            value = 1 - form if name == "sideways_ratio" else unit * form
            result[name] = Quantity(value, relative * (form if name == "sideways_ratio" else unit * form))
        return result

    def states(self, depth: Array, shear: Array) -> BeamStates:
        """Return the states at depths and shears over D (n, k), see `studies.beam.beam_model.BeamModel`."""
        moves = shear != 0
        found = self.shear(depth, shear) if moves.any() else {}
        # a press that is not sheared reaches further than a shear
        if not found or not moves.all():
            pressed = self.press(depth)
            zero = np.where(np.isnan(pressed["force"].value), np.nan, 0.0)
            press = {"force_z": pressed["force"], "shift_z": pressed["shift"]} | {
                name: pressed[name] for name in SKIN
            }
            press |= dict.fromkeys(ODD, Quantity(zero, zero))
            found = {name: _chosen(moves, found[name], still) if found else still for name, still in press.items()}
        return BeamStates(found, functools.partial(self.refusals, depth, shear))

    def knows(self, depth: Array, shear: Array) -> NDArray[np.bool_]:
        """Return which loads have an answer that a sensor shows: in the range, and not beyond `stable_to`.

        `depth`, `shear`: over D, shape (n, k); a press has no shear.
        """
        stable = depth <= self.stable_to()[:, None] + SLACK
        return np.asarray(stable & np.where(shear == 0, self._can_press(depth), self._can_shear(depth, shear)))

    def refusals(self, depth: Array, shear: Array, D: Array) -> NDArray[Any]:
        """Return why a sensor does not show the answers to loads, "" where it does; texts (n, k).

        `depth`, `shear`: over D, shape (n, k); `D`: mm, (n,), for the sentences.
        """
        texts = np.full(depth.shape, "", dtype=object)
        for k, column in np.argwhere(~self.knows(depth, shear)):
            texts[k, column] = self._refusal(k, float(D[k]), float(depth[k, column]), float(shear[k, column]))
        return texts

    def _refusal(self, k: int, D: float, depth: float, shear: float) -> str:
        if self.outside[k]:
            return str(self.outside[k])
        least = surrogate_range.SHALLOWEST_SHEAR if shear else surrogate_range.SHALLOWEST
        most, farthest, stable = (float(end[k]) * D for end in (self.deepest, self.farthest, self.stable_to()))
        # lengths are told in mm
        depth, shear, least, slack = depth * D, shear * D, least * D, SLACK * D
        if not least - slack <= depth <= most + slack:
            return f"the surrogate knows depths of {least:.3g} to {most:.3g} mm here; got {depth:g} mm"
        if not shear <= farthest + slack:
            return f"the surrogate knows shears to {farthest:.3g} mm here; got {shear:g} mm"
        stays = f"the surrogate knows a press to stay stable to {stable:.3g} mm here, and nothing deeper"
        return f"{stays}; got {depth:g} mm"

    def shear(self, depth: Array, shear: Array, *, beyond_stable: bool = False) -> dict[str, Quantity]:
        """Return the response to shears of a plate that is glued to the tip after a press.

        Parameters
        ----------
        depth, shear : over D, shape (n, k); NaN is returned outside SHALLOWEST_SHEAR to `deepest` and `stable_to`,
            and 0 to `farthest`. Loads whose depths are equal in all beams share their work.
        beyond_stable : answer beyond `stable_to`, too, for tests of the intervals.

        Returns
        -------
        The quantities of `SHEAR`, each (n, k); along x, in which the plate moves. The shift along z is positive down.
        """
        possible = self._can_shear(depth, shear)
        if not beyond_stable:
            possible &= depth <= self.stable_to()[:, None] + SLACK
        depth = np.where(possible, depth, np.nan)
        columns, which = np.unique(np.nan_to_num(depth), axis=1, return_inverse=True)
        (n, k), nodes = columns.shape, len(SHEAR_NODES)
        distinct = np.where(columns > 0, columns, np.nan).ravel()
        x = shear_features(np.repeat(self.features, k, axis=0), np.nan_to_num(distinct, nan=0.1))
        region, groups = shear_region(np.repeat(self.region, k), distinct), self.surrogate.groups
        found = _at_nodes(groups["shear"], x, region) | _at_nodes(groups["shear_skin"], x, region)
        # forms at the nodes, and relative half widths, (n, k, nodes) each
        forms, widths = (
            {name: pair[part].reshape(n, k, nodes)[:, which.ravel()] for name, pair in found.items()}
            for part in (0, 1)
        )
        s = np.where(possible, shear, np.nan)
        square = (s / self.farthest[:, None]) ** 2
        pressed = self.press(depth)
        # polynomials in the square of the shear
        powers = square[..., None] ** np.arange(len(SHEAR_NODES))
        to_powers = np.linalg.inv(np.vander(np.array(SHEAR_NODES) ** 2, increasing=True)).T
        parts = {name: np.einsum("nkj,nkj->nk", powers, forms[name] @ to_powers) for name in SHEAR}
        press = {name: pressed[name].value for name in ("force", "shift")}
        values = shear_values(parts, self.L[:, None], depth, s, press)
        rods = yardsticks(values)
        root = np.sqrt(square)
        return {name: Quantity(values[name], rods[name] * _linear_over_shears(widths[name], root)) for name in SHEAR}

    def critical_depth(self) -> Quantity:
        """Return the depths over D at which frictionless presses buckle sideways, shape (n,).

        Infinite where there is none down to `deepest`; how deep it lies is then not known, and it has no half width
        (NaN): `stable_to` says how far the press is known to stay stable.
        """
        value = np.where(self.inside, first_zero(self._grid, -self._logs_of_loss), np.nan)
        return Quantity(value, np.where(np.isinf(value), np.nan, value * self.critical_spread))

    @functools.cached_property
    def critical_spread(self) -> Array:
        """Half width of the critical depth over the depth, shape (n,)."""
        spread = self._presses["sideways_ratio"][1].mean(axis=1)
        return np.asarray(self.surrogate.groups["strain"].quantiles[CRITICAL][self.region, 0] * spread)

    @functools.cached_property
    def _known_stable(self) -> dict[float, Array]:
        """Results of `stable_to` by the caution."""
        return {}

    def stable_to(self, caution: float = 1.0) -> Array:
        """Return the depths over D to which presses are known to stay stable, at most `deepest`, shape (n,).

        That is the lower end of the critical depth's interval. Without a critical depth in the range, it is the depth
        at which the interval of the sideways stiffness reaches 0, or `deepest`.

        `caution`: number of half widths of the intervals.
        """
        if caution not in self._known_stable:
            critical = self.critical_depth()
            widths = _linear_over_roots(self._presses["sideways_ratio"][1], self._grid_shares)
            doubtful = first_zero(self._grid, 1 - np.exp(self._logs_of_loss) * (1 + caution * widths))
            known = np.isfinite(critical.half_width)
            lower = np.where(known, critical.value - caution * critical.half_width, doubtful)
            self._known_stable[caution] = np.where(self.inside, np.minimum(lower, self.deepest), np.nan)
        return self._known_stable[caution]

    @property
    def _grid_shares(self) -> Array:
        return np.broadcast_to(np.linspace(0, 1, CRITICAL_GRID), (len(self.L), CRITICAL_GRID))

    @functools.cached_property
    def _grid(self) -> Array:
        """Depths at which the sideways stiffness is evaluated, shape (n, CRITICAL_GRID)."""
        low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(self.deepest)[:, None]
        return np.asarray((low + (high - low) * self._grid_shares) ** 2)

    @functools.cached_property
    def _logs_of_loss(self) -> Array:
        """Logarithms of 1 - k/k_0 at `_grid`; 0 where the press buckles."""
        return through_roots(self._presses["sideways_ratio"][0], self._grid_shares)

    def first_mode(self, density_ratio: Array) -> Quantity:
        """Return the lowest natural frequency of the unloaded beams over (E / rho)^(1/2) / D, shape (n,).

        `density_ratio`: density of the magnet over that of the silicone, shape (n,); NaN is returned out of range.
        """
        ratio = np.broadcast_to(np.asarray(density_ratio, float), self.L.shape)
        low, high = surrogate_range.DENSITY_RATIO
        x = mode_features(self.features, ratio)
        logs, widths = _at_nodes(self.surrogate.groups["mode"], x, self.region)["frequency"]
        value = np.where(self.inside & (ratio >= low) & (ratio <= high), np.exp(logs[:, 0]), np.nan)
        return Quantity(value, value * widths[:, 0])

    def _can_press(self, depth: Array) -> NDArray[np.bool_]:
        inside = self.inside[:, None] & (depth >= surrogate_range.SHALLOWEST - SLACK)
        return np.asarray(inside & (depth <= self.deepest[:, None] + SLACK))

    def _can_shear(self, depth: Array, shear: Array) -> NDArray[np.bool_]:
        possible = self._can_press(depth) & (depth >= surrogate_range.SHALLOWEST_SHEAR - SLACK)
        return np.asarray(possible & (shear >= 0) & (shear <= self.farthest[:, None] + SLACK))


def shear_values(
    forms: Mapping[str, Array], L: Array, depth: Array, s: Array, pressed: Mapping[str, Array]
) -> dict[str, Array]:
    """Return the quantities of shears from their forms, arrays that broadcast against each other.

    `pressed`: force and shift of the press at the same depth.
    """
    return {
        "force_x": s * forms["force_x"] / compliance(L),
        "force_z": pressed["force"] - s**2 * np.exp(forms["force_z"]),
        "shift_x": s * forms["shift_x"],
        "shift_z": pressed["shift"] + s**2 * forms["shift_z"],
        "tilt": s * forms["tilt"],
        "contact_radius": np.exp(forms["contact_radius"]) * np.sqrt(depth / 2),
        "strain": np.exp(forms["strain"]),
    }


def compliance(L: Array) -> Array:
    """Return the sideways compliance of uniform cantilevers by bending and shear, times E D, for nu = 0.5."""
    bending = 64 * L**3 / (3 * np.pi)
    return np.asarray(bending + 12 * L / (0.9 * np.pi))


def mode_features(x: Array, density_ratio: Array) -> Array:
    """Return the inputs of the first mode, shape (n, 7)."""
    return np.column_stack([x, np.log(density_ratio)])


def shear_features(x: Array, depth: Array) -> Array:
    """Return the inputs of shears at depths (n,), shape (n, 7)."""
    return np.column_stack([x, np.sqrt(depth)])


def beam_region(L: Array, diameter: Array, height: Array) -> NDArray[np.int64]:
    """Return the regions of beams: 1 for slender, plus 2 for a thick magnet, or 4 for a wide thin one.

    >>> beam_region(np.array([1.0, 3.0, 3.0]), np.array([0.3, 0.3, 0.6]), np.array([0.2, 0.5, 0.2])).tolist()
    [0, 3, 5]
    """
    thick = height > THICK
    return np.asarray(1 * (L > SLENDER) + 2 * thick + 4 * (~thick & (diameter > WIDE)))


def shear_region(region: NDArray[np.int64], depth: Array) -> NDArray[np.int64]:
    """Return the regions of shears: those of their beams, plus REGIONS for a deep press."""
    return np.asarray(region + REGIONS * (depth > DEEP))


def yardsticks(values: Mapping[str, Array]) -> dict[str, Array]:
    """Return what the errors of a shear's quantities are relative to."""
    force, shift = (np.hypot(values[f"{name}_x"], values[f"{name}_z"]) for name in ("force", "shift"))
    own = {name: np.abs(values[name]) for name in ("tilt", "contact_radius", "strain")}
    return {"force_x": force, "force_z": force, "shift_x": shift, "shift_z": shift} | own


def _chosen(which: NDArray[np.bool_], yes: Quantity, no: Quantity) -> Quantity:
    return Quantity(np.where(which, yes.value, no.value), np.where(which, yes.half_width, no.half_width))


def first_zero(depth: Array, values: Array) -> Array:
    """Return the depths (n,) at which positive values (n, k) first fall to 0, infinite where they do not."""
    below = values <= 0
    first = np.argmax(below, axis=1)
    rows = np.arange(len(values))
    before = np.maximum(first - 1, 0)
    a, b = values[rows, before], values[rows, first]
    share = np.where(a > b, a / np.where(a > b, a - b, 1.0), 0.0)
    zero = depth[rows, before] + share * (depth[rows, first] - depth[rows, before])
    return np.where(below.any(axis=1), zero, np.inf)


def _at_nodes(group: Group, x: Array, region: NDArray[np.int64]) -> dict[str, tuple[Array, Array]]:
    """Return outputs at the nodes and relative half widths, (n, nodes) each, by quantity."""
    parts = [group.process.predict(x[at : at + BLOCK]) for at in range(0, len(x), BLOCK)]
    y = np.concatenate([mean for mean, _ in parts]).reshape(len(x), len(group.quantities), group.nodes)
    g = np.concatenate([spread for _, spread in parts])[:, None]
    return {name: (y[:, i], g * group.quantiles[name][region]) for i, name in enumerate(group.quantities)}


def root_shares() -> Array:
    """Return where the depths of training lie in the range of the depths, 0 to 1 in their roots."""
    return np.asarray((chebyshev.chebpts2(surrogate_range.PRESS_NODES) + 1) / 2)


def through_roots(values: Array, share: Array) -> Array:
    """Evaluate the polynomials through values (n, PRESS_NODES) at shares (n, k) of the range of the roots."""
    degree = surrogate_range.PRESS_NODES - 1
    to_series = np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts2(degree + 1), degree)).T
    return np.asarray(np.einsum("nkj,nj->nk", chebyshev.chebvander(2 * share - 1, degree), values @ to_series))


def _linear_over_roots(values: Array, share: Array) -> Array:
    """Interpolate values (n, PRESS_NODES) linearly at shares (n, k) of the range of the roots."""
    return _linear(values, root_shares(), share)


def _linear_over_shears(values: Array, share: Array) -> Array:
    """Interpolate values (n, k, nodes) linearly at shares (n, k) of the largest shear."""
    n, k, nodes = values.shape
    return _linear(values.reshape(n * k, nodes), np.array(SHEAR_NODES), share.reshape(-1, 1)).reshape(n, k)


def _linear(values: Array, nodes: Array, at: Array) -> Array:
    """Interpolate the rows of values (n, nodes) linearly at (n, k), constant beyond the nodes; NaN stays NaN."""
    inner = np.clip(at, nodes[0], nodes[-1])
    right = np.clip(np.searchsorted(nodes, np.nan_to_num(inner)), 1, len(nodes) - 1)
    rows = np.arange(len(values))[:, None]
    share = (inner - nodes[right - 1]) / (nodes[right] - nodes[right - 1])
    return np.asarray(values[rows, right - 1] * (1 - share) + values[rows, right] * share)
