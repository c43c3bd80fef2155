"""n beams under presses and shears by any source, `BeamModel`, and what follows from them in N, mm and rad.

A beam is dimensionless: lengths are over D, forces over E D^2, tilts in rad. A load is a frictionless press to a
depth, and then a shear along x of a plate that is glued to the tip; a shear of 0 is the press alone. One along -x is
the mirror image. What a source does not know is NaN, and it says why. The sources:

- `studies.beam.prediction.Beams`, the surrogate of finite elements, with intervals;
- `studies.beam.formula_beams.FormulaBeams`, a level of the formulas;
- `studies.simulation.solved_beams.SolvedBeams`, finite elements, solved or from the store, with their estimates.

From any of them follow curves through nodes, which sizing inverts (`studies.beam.beam_curves`), motions in mm
(`motions`), which sensitivity and calibration read, and the polynomials of the decoder (`mechanics`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.response_surface import Mechanics, of_states
from geometry.arrays import Array, Ints
from geometry.design import Design

ODD = ("force_x", "shift_x", "tilt")
"""What a shear to the other side reverses."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Values of a quantity, and half widths of their 90 % intervals, arrays of one shape."""

    value: Array
    half_width: Array


@dataclass(frozen=True, slots=True)
class BeamStates:
    """States of n beams under k loads each.

    Attributes
    ----------
    quantities : force_x, force_z (compression), shift_x, shift_z (down, positive), tilt, and contact_radius and
        strain where the source has them, each (n, k). Those of a press are of the upright beam, also where it has
        buckled.
    refusals : returns for D of the beams (n,), mm, why a sensor does not show these states, "" where it does: texts
        (n, k).
    """

    quantities: Mapping[str, Quantity]
    refusals: Callable[[Array], NDArray[Any]]


class BeamModel(Protocol):
    """The response of n beams to presses and shears."""

    def states(self, depth: Array, shear: Array) -> BeamStates:
        """Return the states at depths and shears, 0 or more, over D, each (n, k)."""


class RatedBeams(BeamModel, Protocol):
    """Beams of which it is also known how stable they are and how fast they swing."""

    def take(self, rows: Ints) -> Self:
        """Return some of the beams."""

    def critical_depth(self) -> Quantity:
        """Return the depths over D at which frictionless presses buckle sideways, (n,); inf where none was found."""

    def stable_to(self, caution: float) -> Array:
        """Return the depths over D up to which presses are known to be stable, (n,), less some half widths."""

    def first_mode(self, density_ratio: Array) -> Quantity:
        """Return the lowest natural frequency of the unloaded beams over (E / rho)^(1/2) / D, (n,).

        density_ratio : density of the magnet over that of the silicone, (n,).
        """


@dataclass(frozen=True, slots=True, eq=False)
class Motions:
    """What n sensors do in k states, in the plane of the shear.

    Attributes
    ----------
    values : forces on the tip, N, positive along x and in compression; shifts of the magnet, mm, along x and along z
        (negative downwards); its tilt towards x, rad; contact radius, mm, and strain where the source has them: each
        (n, k), NaN where the model refuses.
    half_widths : half width of the model's 90 % interval, in the same form; NaN for a model that states none.
    refusals : why the model refuses, "" where it does not; texts (n, k).
    """

    values: Mapping[str, Array]
    half_widths: Mapping[str, Array]
    refusals: NDArray[Any]


def units(D: Array, E: Array) -> dict[str, Array]:
    """Return the factors from quantities of a beam to N, mm and rad, for D, mm, and E, MPa; z then points upwards."""
    force, one = E * D**2, np.ones_like(D)
    of_forces, of_shifts = {"force_x": force, "force_z": force}, {"shift_x": D, "shift_z": -D}
    return of_forces | of_shifts | {"tilt": one, "contact_radius": D, "strain": one, "sideways_ratio": one}


def mirrored(values: Mapping[str, Array], sign: Array | float = -1.0) -> dict[str, Array]:
    """Return values under shears to the other side, where `sign` is -1."""
    return {name: sign * value if name in ODD else value for name, value in values.items()}


def scales(designs: Sequence[Design]) -> tuple[Array, Array]:
    """Return D, mm, and E, MPa, of designs, each (n,)."""
    D, E = np.array([(design.D, design.E_now) for design in designs]).reshape(-1, 2).T
    return D, E


def motions(beams: BeamModel, designs: Sequence[Design], depth: Array, shear: Array) -> Motions:
    """Return what n designs do, whose beams these are, at depths and shears of either sign, mm, (n, k)."""
    D, E = scales(designs)
    states = beams.states(depth / D[:, None], np.abs(shear) / D[:, None])
    refusals = states.refusals(D)
    known, values, half_widths = refusals == "", {}, {}
    for name, unit in units(D, E).items():
        if name in states.quantities:
            found = states.quantities[name]
            values[name] = np.where(known, unit[:, None] * found.value, np.nan)
            half_widths[name] = np.where(known, np.abs(unit)[:, None] * found.half_width, np.nan)
    return Motions(mirrored(values, np.sign(shear)), half_widths, refusals)


def mechanics(moved: Motions, depth: Array, shear: Array, k: int = 0) -> Mechanics:
    """Return the polynomials of the decoder of sensor `k` through its states at depths and shears (n, k), mm.

    What the model refuses is left out.

    Raises
    ------
    BadInput
        The states contain no press or no shear.
    """
    known = moved.refusals[k] == ""
    u, w, tilt, f_t, f_n = (
        moved.values[name][k, known] for name in ("shift_x", "shift_z", "tilt", "force_x", "force_z")
    )
    return of_states(u, w, tilt, f_t, f_n, depth[k, known], shear[k, known])
