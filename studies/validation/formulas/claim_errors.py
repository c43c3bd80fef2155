"""Presses, shears and grips of the paper's sensor by finite elements, and the errors of the paper's formulas in them.

Presses are solved for several heights of the magnet, which the paper does not give. Each height has the distance l0
at which S1 reads at rest what the paper states, 2.87 V. The presses are those of E = 1 MPa: forces are proportional
to E, and poses do not depend on it, so one path of presses per height answers for every E. The formula keeps the
paper's E = 1 MPa; E here is the modulus of the silicone that is pressed.

The paper's sensor computes the shear force in three steps: the readings give the magnet's shift (by a field without
tilt), the shift gives the tip's displacement (delta = dx L/H, the geometry of a uniform bar), and this gives the
force by (6). The error splits into the same three parts, in order: tilt, geometry, force law.
"""

import dataclasses
import functools
import math
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import brentq, minimize_scalar

from analytic import beam, decode, hall
from analytic.magnet import cylinder_field
from geometry.arrays import Array
from geometry.design import Design, paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies import cases
from studies.validation.pages import TEMPLATES, Row

WORDS: dict[str, Any] = tomllib.loads((TEMPLATES / "claims.toml").read_text("utf-8"))
VALUES, EXTENTS = (WORDS.pop(name) for name in ("values", "extents"))
"""What the paper claims, in words; values of the paper and of this study with their sources; loads of the study."""
BOUND: float = VALUES["bound"]
CLAIMED: list[tuple[float, float]] = [(E, force) for E, force in VALUES["largest"]]
MODULI: tuple[float, float] = VALUES["moduli"][0], VALUES["moduli"][1]
NAN = math.nan


class Press(NamedTuple):
    """Presses of the sensor with one magnet, for E = 1 MPa; arrays have shape (n,), NaN where no state was reached.

    `depth` in mm, press `force`, N, and `sinking` of the magnet's centre, mm; `error_estimate` is the largest
    relative one of the forces, NaN if one is unknown; `status` and `message` are those of the first missing state.
    """

    design: Design
    depth: Array
    force: Array
    sinking: Array
    error_estimate: float = 0.0
    status: str = "ok"
    message: str = ""

    @property
    def height(self) -> float:
        """Height of the magnet, mm, 0 without one."""
        return self.design.magnet_height

    @property
    def complete(self) -> bool:
        return bool(np.isfinite(self.force).all())

    @property
    def relative_errors(self) -> Array:
        """Errors of the formula with E = 1 MPa relative to the force of each depth, %."""
        return np.asarray(100 * (formula(self.depth) / self.force - 1))


class States(NamedTuple):
    """Presses by height of the magnet, one press with friction, and the engine's rows.

    `sheared` are the shears, with the condition of the `tip`; `pressed` are the presses without friction.
    """

    presses: Sequence[Press]
    rubbed: Press
    sheared: pd.DataFrame
    pressed: pd.DataFrame

    @property
    def preset(self) -> Press:
        return next(press for press in self.presses if press.height == paper().magnet_height)


UNDER, GRIP = VALUES["under"], VALUES["grip"]
CONDITIONS: tuple[tuple[str, Magnet, float, float], ...] = (
    *((f"stuck to a plate at depth {depth:g} mm", "rigid", depth, 0.0) for depth in UNDER),
    (f"stuck to a plate at depth {UNDER[0]:g} mm, no magnet", "ignored", UNDER[0], 0.0),
    (f"topmost {GRIP:g} mm gripped, free to sink", "rigid", 0.0, GRIP),
)
"""Conditions of the tip under a shear: name, magnet, depth of the press and height of the grip, mm."""
QUANTITIES = ("force", "shift", "tilt", "readings")


def solve(extent: Row, store: Path | None, progress: Progress | None = None) -> States:
    series = [(height, "none") for height in extent["heights"]] + [(paper().magnet_height, VALUES["friction"])]
    designs = {height: with_magnet(height) for height, _ in series}
    states: list[tuple[str, Design, Load, Magnet]] = [
        ("", designs[height], Load(depth, friction=friction), "rigid")
        for height, friction in series
        for depth in extent["depths"]
    ]
    for tip, magnet, depth, grip in CONDITIONS:
        held: Any = {"grip": grip} if grip else {"friction": "stick"}
        states += [(tip, paper(), Load(depth, shear, **held), magnet) for shear in extent["shears"]]
    asked, model = cases.table(each[1:] for each in states), f"fem:{extent['accuracy']}"
    answers = cases.answer(asked, [model], quantities=QUANTITIES, store=store, progress=progress)
    answers = answers.assign(tip=[tip for tip, *_ in states])
    sheared, pressed = answers[answers.tip != ""], answers[answers.tip == ""]
    smooth, rubbed = (pressed[(pressed.friction == "none") == bare] for bare in (True, False))
    found = [press_of(designs[height], own) for height, own in smooth.groupby("magnet_height_mm", sort=False)]
    return States(found, press_of(paper(), rubbed), sheared, smooth)


def press_of(design: Design, rows: pd.DataFrame) -> Press:
    """Return the presses of a sensor from their rows; depths beyond its silicone are not reached."""
    reached = np.isfinite(rows.fem_force_N)
    missing = rows[~reached]
    return Press(
        design,
        rows.depth_mm.to_numpy(),
        rows.fem_force_N.to_numpy() / design.E,
        -rows.fem_shift_z_mm.to_numpy(),
        float(rows.error_estimate[reached].max(skipna=False)) if reached.any() else NAN,
        *(missing[["status", "message"]].iloc[0] if len(missing) else ("ok", "")),
    )


def with_magnet(height: float) -> Design:
    """Return the paper's sensor with a magnet of this height, mm, and l0 such that S1 reads 2.87 V at rest.

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
    goal: float = (VALUES["S1_at_rest"] - design.hall_null) / design.hall_gain

    def surplus(distance: float) -> float:
        point = np.array([[0.0, 0.0, distance]])
        magnet = design.magnet_diameter / 2, design.magnet_height, design.remanence
        return float(cylinder_field(point, *magnet)[0, 2]) - goal

    half = design.magnet_height / 2
    return round(float(brentq(surplus, half, half + 100 * design.magnet_diameter)), 3)


def s1_output(design: Design, sinking: Array, field: hall.Field = "exact") -> Array:
    """Return the output of S1 for an upright magnet that has sunk by (n,), mm: shape (n,), V, without rails."""
    position = np.array(hall.elements(design)[0][:1]).repeat(len(sinking), axis=0)
    shift = np.column_stack([np.zeros((len(sinking), 2)), -sinking])
    return np.asarray(design.hall_null - design.hall_gain * hall.field_at(position, design, shift, field=field)[:, 2])


# Errors of the press formula and of the voltage of S1


def formula(depths: Array) -> Array:
    """Return the press force of the paper's sensor by (5) and (7) at depths in mm, shape (n,), N."""
    return np.array([beam.solve(paper(), Load(float(depth))).force[2] for depth in depths])


def modulus_interval(predicted: Array, force: Array, slack: Array) -> tuple[float, float]:
    """Return the moduli E for which |predicted - E force| <= E slack at every depth; NaN if there is none.

    `predicted` are forces of the formula, `force` and `slack` those for E = 1 MPa and their allowed errors, (n,), N.

    >>> modulus_interval(np.array([2.0, 4.0]), np.array([1.0, 2.0]), np.array([0.0, 0.0]))
    (2.0, 2.0)
    """
    low = float(np.max(predicted / (force + slack)))
    bounded = force > slack
    high = float(np.min(predicted[bounded] / (force - slack)[bounded])) if bounded.any() else math.inf
    return (low, high) if low <= high else (NAN, NAN)


def error_of_largest(predicted: Array, force: Array, E: float) -> float:
    """Return the largest error of a prediction in % of the largest force, for forces `force` at E = 1 MPa."""
    return 100 * float(np.abs(predicted - E * force).max() / (E * force.max()))


def moduli(count: int = 97) -> Array:
    return np.geomspace(*MODULI, count)


def best_modulus(predicted: Array, force: Array) -> float:
    """Return the searched modulus of least error in % of the largest force, MPa."""
    # the error is a maximum of |a / E - b|, which falls and then rises with 1 / E: it has one minimum
    least = minimize_scalar(
        lambda x: error_of_largest(predicted, force, 1 / x),
        bounds=(1 / MODULI[1], 1 / MODULI[0]),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(1 / least.x)


def each_depth_from(depth: Array, predicted: Array, force: Array) -> float:
    """Return the least depth from which on some E keeps the error of every depth within 5 % of its force, mm."""
    keeps = (
        not math.isnan(modulus_interval(predicted[k:], force[k:], BOUND * force[k:])[0]) for k in range(len(depth))
    )
    return next((float(at) for at, fits in zip(depth, keeps, strict=True) if fits), NAN)


class Voltages(NamedTuple):
    """Voltage of S1 over the press force, by the formulas and by the finite elements, for E = 1 MPa of the latter.

    `predicted` and `modelled` are forces by (5), N, and changes of the voltage by the formulas, V, to depth D/2;
    `force` and `measured` the same by finite elements; `formula_largest` is the force by (5) at the deepest press.
    Forces to 5 % beyond it are compared.
    """

    predicted: Array
    modelled: Array
    force: Array
    measured: Array
    formula_largest: float

    def error(self, E: float, *, any_gain: bool = False, whole: bool = False) -> float:
        """Return the largest error of the voltage at equal force, in % of its largest change; NaN without a force.

        With `any_gain`, the gain of the formula's voltage is the best one, as a calibration would choose it. If
        `whole`, it is NaN too where not all presses are compared.
        """
        shared = E * self.force <= (1 + BOUND) * self.formula_largest
        if not shared.any() or (whole and not shared[-1]):
            return NAN
        at_equal_force = np.interp(E * self.force[shared], self.predicted, self.modelled)
        # neighbouring gains differ by less than a thousandth
        gains = np.geomspace(VALUES["gains"][0], VALUES["gains"][1], 4001) if any_gain else np.ones(1)
        errors = np.abs(np.outer(gains, at_equal_force) - self.measured[shared]).max(axis=1)
        return 100 * float(errors.min() / self.measured.max())


def voltages(press: Press) -> Voltages:
    """Return the voltages of S1 in the presses of a sensor with a magnet.

    The formulas give the depth of a force by (5), and the voltage at this depth by (3) and the sinking d H/L.
    """
    design = press.design
    depth = np.linspace(0.0, design.R, 81)
    rest = s1_output(design, np.zeros(1))[0]
    modelled = s1_output(design, depth * design.H / design.L, field="paper") - rest
    measured = s1_output(design, press.sinking) - rest
    return Voltages(formula(depth), modelled, press.force, measured, float(formula(press.depth)[-1]))


HEIGHT_FIGURES = (
    *("E_from_MPa", "E_to_MPa", "best_E_MPa", "best_error_percent_of_largest", "error_percent_of_largest"),
    *("worst_error_percent", "worst_at_mm", "each_depth_from_mm", "S1_error_percent", "best_E_S1_error_percent"),
    *("best_E_S1_error_any_gain_percent", "least_S1_error_percent", "least_S1_error_any_gain_percent"),
)
"""Columns of `height_row` that follow from presses to every depth."""


def height_row(press: Press) -> Row:
    """Return what holds for one height of the magnet; unknown, NaN, unless the presses reach every depth.

    Errors are in %, of the largest force or voltage where the name says so. E_from_MPa to E_to_MPa are the moduli for
    which the force formula is within 5 % of the largest force at every depth. The worst error is relative to the
    force of the same depth, for E = 1 MPa; from each_depth_from_mm on, one modulus keeps it within 5 %. The errors of
    S1 are those of its voltage at equal force: for E = 1 MPa, for the modulus that fits the forces best, and for the
    one that fits the voltage best (least); `any_gain` fits the gain of S1 too, as a calibration would.
    """
    predicted, force, depth = formula(press.depth), press.force, press.depth
    reached = depth[np.isfinite(force)].max(initial=0.0)
    row: Row = {"magnet_height_mm": press.height, "l0_mm": press.design.l0 if press.height else NAN}
    row |= {"reached_mm": float(reached), "status": press.status, "message": press.message}
    row |= dict.fromkeys(HEIGHT_FIGURES, NAN)
    if not press.complete:
        return row
    interval = modulus_interval(predicted, force, np.full_like(predicted, BOUND * force.max()))
    best, relative = best_modulus(predicted, force), press.relative_errors
    worst = int(np.abs(relative).argmax())
    found = [*interval, best, *(error_of_largest(predicted, force, E) for E in (best, 1.0))]
    found += [float(relative[worst]), float(depth[worst]), each_depth_from(depth, predicted, force)]
    if press.height:
        readings = voltages(press)
        found += [readings.error(1.0), readings.error(best), readings.error(best, any_gain=True)]
        for free in (False, True):
            errors = pd.Series([readings.error(E, any_gain=free, whole=True) for E in moduli().tolist()])
            found.append(float(errors.min()))
    return row | dict(zip(HEIGHT_FIGURES, found, strict=False))


# Errors of the shear formula, and how much of them the ignored tilt explains


def compared(sheared: pd.DataFrame) -> pd.DataFrame:
    """Return the states within the paper's range under one condition of the tip, without the unsheared one."""
    shear = sheared.shear_mm
    return sheared[(shear > 0) & (shear <= VALUES["farthest"] + 1e-9) & np.isfinite(sheared.fem_force_N)]


TIP_FIGURES = (
    *("stiffness_N_per_mm", "first_error_percent", "worst_error_percent", "last_error_percent", "best_E_MPa"),
    *("best_error_percent", "within_5_percent_from_E_MPa", "within_5_percent_to_E_MPa"),
)
"""Columns of `tip_row`."""


def tip_row(sheared: pd.DataFrame) -> Row:
    """Return the errors of (6) under one condition of the tip, for E = 1 MPa; NaN without a shear.

    The stiffness is the force over the first shear; best_E_MPa makes the largest error least.
    """
    known = compared(sheared)
    row: Row = {"tip": sheared.tip.iloc[0]} | dict.fromkeys(TIP_FIGURES, NAN)
    if not len(known):
        return row
    shear, force = known.shear_mm.to_numpy(), known.fem_force_x_N.to_numpy()
    # forces are proportional to E: error of E is ratio / E - 1, whose extremes balance at the mean of the extremes
    predicted = beam.cantilever_stiffness(paper()) * shear
    ratio = predicted / force
    error, low, high = 100 * (ratio - 1), float(ratio.min()), float(ratio.max())
    found = [float(force[0] / shear[0]), float(error[0]), float(error[np.abs(error).argmax()]), float(error[-1])]
    found += [(low + high) / 2, 100 * (high - low) / (high + low)]
    return row | dict(zip(TIP_FIGURES, (*found, *modulus_interval(predicted, force, BOUND * force)), strict=True))


def split(sheared: pd.DataFrame) -> pd.DataFrame:
    """Return the parts of the error at each shear of the paper's range that was reached, N.

    The readings are those of tilted magnets, decoded without tilt.
    """
    design, known = paper(), compared(sheared)
    readings = known[[f"fem_S{k}_mT" for k in (1, 2, 3)]].to_numpy() / 1e3
    shift = decode.decode(_decoder_without_tilt(design), readings, follow=True).shift if len(known) else readings
    stiffness, lever = beam.cantilever_stiffness(design), design.L / design.H
    force, law = known.fem_force_x_N, stiffness * known.shear_mm
    geometry, decoded = stiffness * lever * known.fem_shift_x_mm, stiffness * lever * shift[:, 0]
    return pd.DataFrame(
        {
            "tip": known.tip,
            "shear_mm": known.shear_mm,
            "fem_force_x_N": force,
            "decoded_force_x_N": decoded,
            "error_N": decoded - force,
            "tilt_N": decoded - geometry,
            "geometry_N": geometry - law,
            "force_law_N": law - force,
            "fem_tilt_rad": known.fem_tilt_rad,
        }
    )


@functools.cache
def _decoder_without_tilt(design: Design) -> decode.Decoder:
    """Return the decoder of an upright magnet in a workspace that contains every pose of a shear."""
    reach = 0.5 * design.D
    return decode.decoder(design, workspace=((-reach, -reach, -reach), (reach, reach, 0.5)))


def share(rows: pd.DataFrame, part: str) -> float:
    """Return the size of one part over the sizes of all parts, as sums over the shears, %; NaN without a shear."""
    sizes = rows[["tilt_N", "geometry_N", "force_law_N"]].abs().sum()
    return float(100 * sizes[part] / sizes.sum()) if sizes.sum() else NAN
