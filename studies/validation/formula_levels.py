"""Comparison of all levels of the formulas with finite elements: ten designs, presses and shears of a glued plate.

ABOUT defines the errors. `studies.validation.formula_level_report` has their statistics and the report.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from analytic import beam, buckling
from fem import equilibrium
from fem.accuracy import LEVELS
from fem.solution import Solution
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies.output import records
from studies.output.records import FlatRow

ABOUT = """\
All levels of the formulas are compared with finite elements. The designs span D, L/D and the magnet (none, small,
wide, tall). In the levels above `column`, four constants of the press and two of the shear were fitted to finite
elements of 18 designs with L/D from 0.75 to 4. Only the paper's sensor belongs to both sets of designs.

The tables show root mean squares of these errors over the states of a region:

- press force: relative to the force of the finite elements;
- sinking, the shift of the magnet along the axis, with and without shear: relative to that of the finite elements;
- press under shear: error of the press force, over the press force of the formula before the shear;
- shear force: error over k0 delta, the force of Timoshenko's cantilever of length L under the same shear delta (the
  shear force of the pressed beam itself passes through zero where the beam buckles);
- shift: error of the magnet's shift along the shear, over the shear;
- tilt: error of the magnet's tilt times R, over the shear.

If a level refuses a load, or the finite elements do not reach it, the row has a message and enters no mean.
"""

PRESSES = (0.03, 0.06, 0.12, 0.18, 0.25)
UNDER, SHEARS = (0.06, 0.12, 0.25), (0.05, 0.15, 0.3)
"""Depths of the presses, depths under the shears, and shears, over D."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Force, and shift and tilt of the magnet, in the plane of the shear."""

    force_x_N: float
    force_z_N: float
    shift_x_mm: float
    shift_z_mm: float
    tilt_rad: float


@dataclass(frozen=True, slots=True)
class Errors:
    """Relative errors of a level in one state, as ABOUT defines them; None where they do not apply."""

    sinking_error: float
    press_force_error: float | None = None
    press_under_shear_error: float | None = None
    shear_force_error: float | None = None
    shift_error: float | None = None
    tilt_error: float | None = None


@dataclass(frozen=True, slots=True)
class Comparison:
    """One level of the formulas and the finite elements in one state of one design.

    Attributes
    ----------
    outside : reason why the state is outside the level's own range, or empty.
    formula, fem, errors : None where the level refuses the load or the finite elements do not reach it.
    """

    design: int
    D_mm: float
    L_over_D: float
    magnet_diameter_over_D: float
    magnet_height_over_D: float
    depth_over_D: float
    shear_over_D: float
    level: str
    outside: str
    status: Literal["ok", "refused", "not_converged"]
    message: str
    formula: Motion | None = field(default=None, metadata={"prefix": ""})
    fem: Motion | None = field(default=None, metadata={"prefix": "fem_"})
    errors: Errors | None = field(default=None, metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Return the columns of ladder.csv and JSON."""
        return records.known(records.flat(self))


def designs() -> list[Design]:
    """Return the paper's design and nine others in order of L/D."""
    shapes = (
        *((8.0, 0.8, 0.3, 0.15), (6.0, 1.25, 0.0, 0.0), (10.0, 1.25, 0.4, 0.4), (8.0, 1.6, 0.0, 0.0)),
        *((5.0, 1.75, 0.6, 0.2), (12.0, 2.25, 0.3, 0.15), (8.0, 2.5, 0.45, 0.5), (6.0, 3.5, 0.0, 0.0)),
        (8.0, 3.5, 0.5, 0.25),
    )
    return [paper(), *(_design(*shape) for shape in shapes)]


def _design(D: float, slenderness: float, diameter: float, height: float) -> Design:
    edge = 0.0125 * D if diameter else 0.0
    L = slenderness * D
    return Design(
        D=D, L=L, l0=L, f=D, magnet_diameter=diameter * D, magnet_height=height * D, magnet_edge_radius=edge
    )


def run(accuracy: str, count: int, progress: Progress) -> Iterator[Comparison]:
    """Yield a comparison for each state and level of the first `count` designs."""
    for number, design in enumerate(designs()[:count]):
        progress(number / count, f"design {number}: L/D = {design.L / design.D:.3g}")
        for load, state in _states(design, accuracy):
            for level in beam.LEVELS:
                yield compare(number, design, load, state, level)


def _states(design: Design, accuracy: str) -> Iterator[tuple[Load, Solution | None]]:
    """Yield each load with its finite-element solution, or None: presses, then shears at three depths."""
    D = design.D
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    paths = [[Load(depth=share * D) for share in PRESSES]]
    paths += [
        [Load(depth=under * D, shear_x=share * D, friction="stick") for share in (0.0, *SHEARS)] for under in UNDER
    ]
    for path in paths:
        states = equilibrium.trace(design, path, LEVELS[accuracy], magnet=magnet, estimate=False)
        reached = {(s.load.depth, s.load.shear_x): s for s in states if s.status in ("ok", "unstable")}
        for load in path:
            if load.shear_x or load.friction == "none":
                yield load, reached.get((load.depth, load.shear_x))


def compare(number: int, design: Design, load: Load, state: Solution | None, level: str) -> Comparison:
    """Compare a level of the formulas with the state of the finite elements (None: load not reached)."""
    status: Literal["ok", "refused", "not_converged"] = "ok"
    message, formula, fem, errors = "", None, None, None
    if state is None:
        status, message = "not_converged", "the finite elements do not reach this load"
    else:
        try:
            response = beam.solve(design, load, level)
            before = beam.solve(design, Load(depth=load.depth), level).force[2]
        except BadInput as error:
            status, message = "refused", str(error)
        else:
            formula, fem = _motion(response), _motion(state.response)
            errors = _errors(design, load, response, before, state.response)
    D, shape = design.D, design.shape
    return Comparison(
        design=number,
        D_mm=D,
        L_over_D=design.L / D,
        magnet_diameter_over_D=shape.magnet_diameter / D,
        magnet_height_over_D=shape.magnet_height / D,
        depth_over_D=round(load.depth / D, 6),
        shear_over_D=round(load.shear_x / D, 6),
        level=level,
        outside=beam.outside(design, load, level),
        status=status,
        message=message,
        formula=formula,
        fem=fem,
        errors=errors,
    )


def _motion(response: Response) -> Motion:
    (force_x, _, force_z), (shift_x, _, shift_z) = response.force, response.shift
    return Motion(force_x, force_z, shift_x, shift_z, response.tilt)


def _errors(design: Design, load: Load, formula: Response, before: float, fem: Response) -> Errors:
    """Return the relative errors of a formula.

    Parameters
    ----------
    before : press force of the formula before the shear, N.
    """
    sinking = formula.shift[2] / fem.shift[2] - 1
    if not load.shear_x:
        return Errors(sinking, press_force_error=formula.force[2] / fem.force[2] - 1)
    cantilever = buckling.sideways_stiffness(design)
    return Errors(
        sinking,
        press_under_shear_error=(formula.force[2] - fem.force[2]) / before,
        shear_force_error=(formula.force[0] - fem.force[0]) / (cantilever * load.shear_x),
        shift_error=(formula.shift[0] - fem.shift[0]) / load.shear_x,
        tilt_error=(formula.tilt - fem.tilt) * design.R / load.shear_x,
    )
