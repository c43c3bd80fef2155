"""Beams by finite elements, solved now or taken from the store."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.arrays import Array, Ints
from geometry.design import Design
from geometry.loads import Load
from studies.beam.beam_model import ODD, BeamStates, Quantity, scales, units
from studies.cases import FiniteElements
from studies.mechanics.path_solver import frequency_unit

RATIO_DIGITS = 6
"""Digits of the ratio of densities: equal ratios share a stored solve."""
MOTIONS = ("force", "shift", "tilt", "strain")
"""Quantities that are asked for."""
READ = {
    "force_x": ("fem_force_x_N", 1.0, "sideways_error_estimate"),
    "force_z": ("fem_force_N", 1.0, "error_estimate"),
    "shift_x": ("fem_shift_x_mm", 1.0, "shift_error_estimate"),
    "shift_z": ("fem_shift_z_mm", 1.0, "shift_error_estimate"),
    "tilt": ("fem_tilt_rad", 1.0, "tilt_error_estimate"),
    "contact_radius": ("fem_contact_radius_mm", 1.0, ""),
    "strain": ("fem_largest_strain_percent", 100.0, "fem_largest_strain_error_estimate"),
    "sideways_ratio": ("fem_sideways_stiffness_ratio", 1.0, ""),
}
"""Columns of the answers, their unit in N, mm and rad, and columns of their relative errors, by quantity."""


class SolvedBeams:
    """Beams of n designs by finite elements; see `studies.beam.beam_model.RatedBeams`.

    Half widths are what error estimates say; 0 of what is 0, NaN where an error is unknown. The
    estimates of force_z and of shifts are relative to the lengths of the vectors.
    """

    def __init__(self, designs: Sequence[Design], fem: FiniteElements, quantities: Sequence[str] = MOTIONS) -> None:
        self.designs, self.fem, self.quantities = designs, fem, quantities
        self.D, self.E = scales(designs)

    def take(self, rows: Ints) -> SolvedBeams:
        """Return some of the beams."""
        return SolvedBeams([self.designs[k] for k in rows], self.fem, self.quantities)

    def states(self, depth: Array, shear: Array) -> BeamStates:
        """Return the states at depths and shears over D (n, k).

        All shears of a beam at one depth are one path. A load of which depth or shear is NaN, because a press has
        failed, has NaN as its response.
        """
        rows, columns = np.nonzero(~np.isnan(depth + shear))
        refusals = np.full(depth.shape, "its press has failed", dtype=object)
        if not len(rows):
            return BeamStates(dict.fromkeys(READ, Quantity(*np.full((2, *depth.shape), np.nan))), lambda _: refusals)
        depths, shears = (self.D[rows] * each[rows, columns] for each in (depth, shear))
        cases = [
            (self.designs[k], Load(d, s, friction="stick" if s else "none"))
            for k, d, s in zip(rows.tolist(), depths.tolist(), shears.tolist(), strict=True)
        ]
        answers = self.fem.answers(cases, self.quantities, "harmonic" if shears.all() else "auto")
        reasons = answers["message"].where(answers["message"] != "", answers["status"])
        refusals[rows, columns] = reasons.where(answers["status"] != "ok", "")
        of_unit, still = units(self.D[rows], self.E[rows]), 0.0 * answers["fem_force_N"]
        # presses alone have nothing sideways
        values = {
            name: answers.get(column, still).to_numpy() / (factor * of_unit[name])
            for name, (column, factor, _) in READ.items()
            if column in answers or name in ODD
        }
        force, shift = (np.hypot(values[f"{name}_x"], values[f"{name}_z"]) for name in ("force", "shift"))
        sizes = {name: np.abs(value) for name, value in values.items()}
        sizes |= {"force_z": force, "shift_x": shift, "shift_z": shift}
        found = {name: Quantity(*np.full((2, *depth.shape), np.nan)) for name in values}
        for name, value in values.items():
            error = READ[name][2]
            share = answers.get(error, np.nan) if error else np.nan
            found[name].value[rows, columns] = value
            found[name].half_width[rows, columns] = np.where(value == 0, 0.0, sizes[name] * share)
        return BeamStates(found, lambda _: refusals)

    @functools.cached_property
    def _stability(self) -> tuple[Array, Array, Array]:
        """Critical depth over D, see `critical_depth`, its relative error, and depth to which a press is stable."""
        answers = self.fem.answers(
            [(design, Load(depth=0.01 * design.D)) for design in self.designs], ["critical_depth"]
        )
        depth, stable = (answers[name].to_numpy() / self.D for name in ("critical_depth_mm", "stable_to_mm"))
        none = answers["critical_depth_verdict"].to_numpy() == "stable"
        return np.where(none, np.inf, depth), answers["critical_depth_error_estimate"].to_numpy(), stable

    def critical_depth(self) -> Quantity:
        """Return the depths at which frictionless presses buckle sideways, over D, shape (n,).

        inf where the search found none up to its end; NaN where it stopped before, or failed.
        """
        depth, error, _ = self._stability
        return Quantity(depth, np.where(np.isinf(depth), 0.0, error * depth))

    def stable_to(self, caution: float) -> Array:
        """Return the depths over D up to which presses are known to be stable, shape (n,); NaN where nothing is."""
        critical, stable = self.critical_depth(), self._stability[2]
        width = critical.half_width if caution else 0.0
        return np.where(np.isfinite(critical.value), critical.value - caution * width, stable)

    def first_mode(self, density_ratio: Array) -> Quantity:
        """Return the lowest natural frequency of the unloaded beams over `frequency_unit`, shape (n,)."""
        heavy = [
            (replace(design, magnet_density=round(float(ratio), RATIO_DIGITS) * design.density), Load(depth=0.0))
            for design, ratio in zip(self.designs, density_ratio, strict=True)
        ]
        unit = np.array([frequency_unit(design.D, design.E_now, design.density) for design in self.designs])
        lowest = self.fem.answers(heavy, ["modes"])["mode1_Hz"].to_numpy() / unit
        return Quantity(lowest, np.zeros(len(lowest)))
