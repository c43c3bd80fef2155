"""Beams by a level of the formulas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytic import beam
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load
from studies.beam.beam_model import BeamStates, Quantity, scales, units

NAMES = ("force_x", "force_z", "shift_x", "shift_z", "tilt", "contact_radius")
"""What formulas answer."""


class FormulaBeams:
    """Beams of n designs by a level of the formulas, which state no errors and no strain."""

    def __init__(self, level: str, designs: Sequence[Design]) -> None:
        self.level, self.designs = level, designs

    def states(self, depth: Array, shear: Array) -> BeamStates:
        """Return the states at depths and shears over D (n, k), see `studies.beam.beam_model.BeamModel`."""
        numbers, refusals = np.full((*depth.shape, len(NAMES)), np.nan), np.full(depth.shape, "", dtype=object)
        for at in np.ndindex(depth.shape):
            design = self.designs[at[0]]
            aside = design.D * float(shear[at])
            try:
                load = Load(design.D * float(depth[at]), aside, friction="stick" if aside else "none")
                found = beam.solve(design, load, self.level)
            except BadInput as error:
                refusals[at] = str(error)
                continue
            (x, _, z), (u, _, w) = found.force, found.shift
            numbers[at] = x, z, u, w, found.tilt, found.contact_radius
        unit, none = units(*scales(self.designs)), np.full(depth.shape, np.nan)
        table = zip(NAMES, np.moveaxis(numbers, -1, 0), strict=True)
        quantities = {name: Quantity(value / unit[name][:, None], none) for name, value in table}
        return BeamStates(quantities, lambda _: refusals)
