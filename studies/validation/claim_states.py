"""States of the paper's sensor by finite elements on which the claims are tested: presses, shears and grips.

Presses are solved for several heights of the magnet, which the paper does not give. Each height has the distance l0
at which S1 reads at rest what the paper states, 2.87 V. The presses are those of E = 1 MPa: forces are proportional
to E, and poses do not depend on it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analytic import hall
from analytic.magnet import cylinder_field
from fem.accuracy import FINE, QUICK, STANDARD, Accuracy
from geometry.arrays import Array
from geometry.design import Design, paper
from geometry.loads import Magnet
from geometry.messages import Progress
from studies import cases

if TYPE_CHECKING:
    import pandas as pd

S1_AT_REST = 2.87
"""Output of S1 at rest, V (section V.A of the paper)."""
NAN = math.nan


@dataclass(frozen=True, slots=True)
class Extent:
    """Loads on which the claims are tested.

    Attributes
    ----------
    heights : heights of the magnet, mm, in rising order; 0 is a beam without a magnet. The preset's is one of them.
    depths : depths of the presses, mm, in rising order; the paper presses to 3 mm.
    shears : shears of the tip, mm, in rising order from 0; the paper shears to 3.1 mm, and 3 mm along both axes of
        its Figure 6 are 4.24 mm along the diagonal.
    layouts : layouts on which uniqueness is tested: height of the magnet, and height c of S2 and S3, mm. The first is
        the preset's.
    accuracy, reference : accuracy of the finite elements, and of those against which costs are compared.
    """

    heights: tuple[float, ...] = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 6.7)
    depths: tuple[float, ...] = tuple(k / 8 for k in range(1, 25))
    shears: tuple[float, ...] = (0.0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.1, 2.4, 2.7, 3.1, 3.6, 4.25)
    layouts: tuple[tuple[float, float], ...] = ((2.0, 2.0), (2.0, 5.0), (4.0, 2.0))
    accuracy: Accuracy = STANDARD
    reference: Accuracy = FINE


QUICK_EXTENT = Extent(
    heights=(0.0, 2.0, 4.0),
    depths=(0.75, 1.5, 2.25, 3.0),
    shears=(0.0, 1.5, 3.1),
    layouts=((2.0, 2.0), (4.0, 2.0)),
    accuracy=QUICK,
    reference=STANDARD,
)
"""Few loads at accuracy quick: the verdicts of the whole study in some seconds."""


class Press(NamedTuple):
    """Presses of the sensor with one magnet, for E = 1 MPa; arrays have shape (n,), NaN where no state was reached.

    Attributes
    ----------
    height : height of the magnet, mm; 0 without one.
    design : the sensor, whose S1 reads 2.87 V at rest.
    depth, force, sinking : depth, mm, press force, N, and sinking of the magnet's centre, mm.
    error_estimate : largest estimated relative error of the forces; NaN if one is unknown.
    status, message : of the first state that is missing; "ok" and "" if none is.
    """

    height: float
    design: Design
    depth: Array
    force: Array
    sinking: Array
    error_estimate: float = 0.0
    status: str = "ok"
    message: str = ""

    @property
    def complete(self) -> bool:
        """Whether every depth was reached."""
        return bool(np.isfinite(self.force).all())


class States(NamedTuple):
    """All states: presses by height of the magnet, one press with friction, and the engine's rows.

    `sheared` are the shears, with the condition of the `tip`; `pressed` are the presses without friction.
    """

    presses: Sequence[Press]
    rubbed: Press
    sheared: pd.DataFrame
    pressed: pd.DataFrame

    @property
    def preset(self) -> Press:
        """The presses of the preset's magnet."""
        own = paper().magnet_height
        return next(press for press in self.presses if press.height == own)


FRICTION = 0.5
"""Coulomb coefficient of the press with friction; the paper does not give the friction of its plate."""
UNDER = (1.0, 2.0)
"""Depths under the shears, mm; the paper does not give its own. The first is that of its Figure 6."""
GRIP = 1.0
"""Height of the tip that a grip holds, mm: the tip condition of formula (6), free to sink and to turn."""
CONDITIONS: tuple[tuple[str, Magnet, float, float], ...] = (
    *((f"stuck to a plate at depth {depth:g} mm", "rigid", depth, NAN) for depth in UNDER),
    (f"stuck to a plate at depth {UNDER[0]:g} mm, no magnet", "ignored", UNDER[0], NAN),
    (f"topmost {GRIP:g} mm gripped, free to sink", "rigid", 0.0, GRIP),
)
"""Conditions of the tip under a shear: name, magnet, depth of the press and height of the grip, mm."""
QUANTITIES = ("force", "shift", "tilt", "readings")


def solve(extent: Extent, store: Path | None, progress: Progress | None = None) -> States:
    """Return all states: those that the store has, and the others solved and added to it."""
    import pandas as pd

    presses = [
        {"height": height, "friction": friction, "depth_mm": depth}
        for height, friction in (*((height, "none") for height in extent.heights), (paper().magnet_height, FRICTION))
        for depth in extent.depths
    ]
    shears = [
        {"tip": tip, "height": paper().magnet_height, "magnet": magnet, "shear_mm": shear}
        | {"depth_mm": depth, "grip_mm": grip, "friction": "stick" if depth else "none"}
        for tip, magnet, depth, grip in CONDITIONS
        for shear in extent.shears
    ]
    rows = pd.DataFrame([*presses, *shears]).fillna({"tip": "", "magnet": "rigid", "shear_mm": 0.0})
    designs = {height: with_magnet(height) for height in {*extent.heights, paper().magnet_height}}
    for field in ("magnet_diameter", "magnet_height", "magnet_edge_radius", "l0"):
        rows[f"{field}_mm"] = [getattr(designs[height], field) for height in rows["height"]]
    rows.loc[rows["tip"] != "", "l0_mm"] = paper().l0
    asked = rows.drop(columns=["tip", "height"])
    model = f"fem:{extent.accuracy.name}"
    answers = cases.answer(asked, [model], quantities=QUANTITIES, store=store, progress=progress)
    answers = answers.assign(tip=rows["tip"], height=rows["height"])
    sheared, pressed = answers[answers.tip != ""], answers[answers.tip == ""]
    smooth, rubbed = (pressed[(pressed.friction == "none") == bare] for bare in (True, False))
    found = [press_of(designs[height], own) for height, own in smooth.groupby("height", sort=False)]
    return States(found, press_of(paper(), rubbed), sheared, smooth)


def press_of(design: Design, rows: pd.DataFrame) -> Press:
    """Return the presses of a sensor from their rows; depths beyond its silicone are not reached."""
    reached = np.isfinite(rows.fem_force_N)
    missing = rows[~reached]
    return Press(
        design.magnet_height,
        design,
        rows.depth_mm.to_numpy(),
        rows.fem_force_N.to_numpy() / design.E,
        -rows.fem_shift_z_mm.to_numpy(),
        float(rows.error_estimate[reached].max(skipna=False)) if reached.any() else NAN,
        *(missing[["status", "message"]].iloc[0] if len(missing) else ("ok", "")),
    )


def with_magnet(height: float) -> Design:
    """Return the paper's sensor with a magnet of this height, mm, and l0 such that S1 reads 2.87 V at rest.

    Raises
    ------
    BadInput
        The magnet does not fit the beam.

    >>> with_magnet(2.0).l0
    7.21
    """
    base = paper()
    if not height:
        return dataclasses.replace(base, magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)
    edge = min(base.magnet_edge_radius, height / 4)
    fitted = dataclasses.replace(base, magnet_height=height, magnet_edge_radius=edge, l0=max(base.l0, height))
    return dataclasses.replace(fitted, l0=rest_distance(fitted))


def rest_distance(design: Design) -> float:
    """Return the distance l0 at which S1 reads 2.87 V at rest, mm, rounded to 0.001 mm."""
    from scipy.optimize import brentq

    goal = (S1_AT_REST - design.hall_null) / design.hall_gain

    def surplus(distance: float) -> float:
        point = np.array([[0.0, 0.0, distance]])
        magnet = design.magnet_diameter / 2, design.magnet_height, design.remanence
        return float(cylinder_field(point, *magnet)[0, 2]) - goal

    half = design.magnet_height / 2
    return round(float(brentq(surplus, half, half + 100 * design.magnet_diameter)), 3)


def s1_output(design: Design, sinking: Array, field: hall.Field = "exact") -> Array:
    """Return the output of S1 for an upright magnet that has sunk, shape (n,), V, without rails.

    Parameters
    ----------
    sinking : shape (n,), mm.
    """
    position = np.array(hall.elements(design)[0][:1]).repeat(len(sinking), axis=0)
    shift = np.column_stack([np.zeros((len(sinking), 2)), -sinking])
    return np.asarray(design.hall_null - design.hall_gain * hall.field_at(position, design, shift, field=field)[:, 2])
