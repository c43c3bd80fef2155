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

import numpy as np

from analytic import hall
from analytic.magnet import cylinder_field
from fem.accuracy import FINE, QUICK, STANDARD, Accuracy
from fem.scene import Scene
from geometry.arrays import Array
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet, Response, check_load
from geometry.messages import Progress
from studies.exploration.solved_paths import Answer, solved
from studies.exploration.store import Store
from studies.output import console
from studies.simulation.compare import part

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


@dataclass(frozen=True, slots=True, eq=False)
class Press:
    """Presses of the sensor with one magnet, for E = 1 MPa; arrays have shape (n,), NaN where no state was reached.

    Attributes
    ----------
    height : height of the magnet, mm; 0 without one.
    design : the sensor, whose S1 reads 2.87 V at rest.
    depth, force, sinking : depth, mm, press force, N, and sinking of the magnet's centre, mm.
    error_estimate : largest estimated relative error of the forces; NaN if one is unknown.
    message : why states are missing; "" if none is.
    """

    height: float
    design: Design
    depth: Array
    force: Array
    sinking: Array
    error_estimate: float
    message: str

    @property
    def complete(self) -> bool:
        """Whether every depth was reached."""
        return bool(np.isfinite(self.force).all())


@dataclass(frozen=True, slots=True)
class Sheared:
    """Shears of the sensor's tip under one condition; a response is None where the state was not reached.

    Attributes
    ----------
    tip : the condition of the tip, in words.
    depth : depth of the press under the shear, mm; 0 for a grip.
    """

    tip: str
    design: Design
    magnet: Magnet
    depth: float
    shear: tuple[float, ...]
    responses: tuple[Response | None, ...]

    def force(self) -> Array:
        """Return the force along the shear, shape (n,), N; NaN where no state was reached."""
        return np.array([NAN if r is None else r.force[0] for r in self.responses])


@dataclass(frozen=True, slots=True)
class States:
    """All states: presses by height of the magnet, one press with friction, and shears by condition of the tip."""

    presses: tuple[Press, ...]
    rubbed: Press
    sheared: tuple[Sheared, ...]

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


def solve(extent: Extent, store: Store, progress: Progress | None = None) -> States:
    """Return all states: those that the store has, and the others solved and added to it."""
    heights, accuracy = extent.heights, extent.accuracy
    presses = []
    for k, height in enumerate(heights):
        low, high = (0.4 * each / len(heights) for each in (k, k + 1))
        show = part(progress, low, high, f"magnet {height:g} mm high")
        presses.append(press(with_magnet(height), extent.depths, accuracy, store, show))
    show = part(progress, 0.4, 0.5, "press with friction")
    rubbed = press(paper(), extent.depths, accuracy, store, show, FRICTION)
    sheared = []
    conditions = _conditions(extent.shears)
    for k, (tip, magnet, loads) in enumerate(conditions):
        low, high = (0.5 + 0.5 * each / len(conditions) for each in (k, k + 1))
        answers = reached(paper(), loads, accuracy, magnet, store, part(progress, low, high, f"shear, {tip}"))
        responses = tuple(answer.response for answer in answers)
        sheared.append(Sheared(tip, paper(), magnet, loads[0].depth, extent.shears, responses))
    return States(tuple(presses), rubbed, tuple(sheared))


def _conditions(shears: Sequence[float]) -> list[tuple[str, Magnet, list[Load]]]:
    """Return the conditions of the tip under a shear: name, magnet, loads."""
    conditions: list[tuple[str, Magnet, list[Load]]] = []
    for depth in UNDER:
        loads = [Load(depth, shear, friction="stick") for shear in shears]
        conditions.append((f"stuck to a plate at depth {depth:g} mm", "rigid", loads))
    loads = [Load(UNDER[0], shear, friction="stick") for shear in shears]
    conditions.append((f"stuck to a plate at depth {UNDER[0]:g} mm, no magnet", "ignored", loads))
    loads = [Load(shear_x=shear, grip=GRIP) for shear in shears]
    conditions.append((f"topmost {GRIP:g} mm gripped, free to sink", "rigid", loads))
    return conditions


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


def press(
    design: Design,
    depths: Sequence[float],
    accuracy: Accuracy,
    store: Store,
    progress: Progress | None = None,
    friction: float = 0.0,
) -> Press:
    """Return the presses of a sensor; depths beyond its silicone are not reached.

    Parameters
    ----------
    friction : Coulomb coefficient of the plate.
    """
    loads = [Load(depth, friction=friction or "none") for depth in depths]
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    answers = reached(design, loads, accuracy, magnet, store, progress)
    responses = [answer.response for answer in answers]
    return Press(
        design.magnet_height,
        design,
        np.array(depths, dtype=np.float64),
        np.array([NAN if r is None else r.force[2] / design.E for r in responses]),
        np.array([NAN if r is None else -r.shift[2] for r in responses]),
        float(np.max([a.error_estimate for a in answers if a.response is not None] or [NAN])),
        next((answer.message for answer in answers if answer.response is None), ""),
    )


def reached(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    store: Store,
    progress: Progress | None = None,
) -> list[Answer]:
    """Return the answer to each load, from the store or solved; a load that the design refuses has no response."""
    answers: dict[int, Answer] = {}
    for k, load in enumerate(loads):
        try:
            check_load(design, load, magnet)
        except BadInput as error:
            answers[k] = Answer(design.D, design.E, None, "bad_input", str(error), NAN, 0.0)
    possible = [k for k in range(len(loads)) if k not in answers]
    if possible:
        scene = Scene(design, tuple(loads[k] for k in possible), accuracy, magnet)
        solutions, trouble = solved(scene, store, progress)
        answers |= dict(zip(possible, solutions, strict=True))
        if trouble:
            console.warn(trouble)
    return [answers[k] for k in range(len(loads))]


def s1_output(design: Design, sinking: Array, field: hall.Field = "exact") -> Array:
    """Return the output of S1 for an upright magnet that has sunk, shape (n,), V, without rails.

    Parameters
    ----------
    sinking : shape (n,), mm.
    """
    position = np.array(hall.elements(design)[0][:1]).repeat(len(sinking), axis=0)
    shift = np.column_stack([np.zeros((len(sinking), 2)), -sinking])
    return np.asarray(design.hall_null - design.hall_gain * hall.field_at(position, design, shift, field=field)[:, 2])
