"""Presses of a bench, planned before the first one: those that tell most about a made sensor, within its loads.

A sequential design (Fedorov, Theory of Optimal Experiments, 1972): of all presses and shears of the loads that the
sensor is for, each next one leaves the least mean variance of decoded forces over all these loads, given those before
it (`calibrated_forces.next_press`). What a press tells follows from the linearised sensor at the means of its priors,
so that the plan needs no measurement. None is repeated.

Loads are those of the requirements of a design; without any, a press to D/8 and a glued shear of as much there.
The first row is the sensor at rest: it costs nothing, and says what presses far from it leave open of light ones.
Directions along the plate are multiples of 45 degrees, which a person can set.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import parts
from analytic.inverse.response_surface import force_and_load
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.calibration import calibrated_forces, calibration_study, sensor_fit
from studies.calibration.bench_file import FEWEST, FORCES, Bench
from studies.calibration.regression_study import ASSUMED_NOISE
from studies.calibration.sensor_fit import Fit, Sensor
from studies.parts.part_tolerances import Tolerances
from studies.parts.requirements import Requirements
from studies.quantities import shown

if TYPE_CHECKING:
    from studies.output.records import FlatRow

PRESSES = 12
"""Number of presses of a plan: beyond a dozen errors fall by little (learning curve of `magtip calibrate`)."""
MOST_PRESSES = 48
"""Largest number of presses of a plan: more than these few loads have, none of which is repeated."""
SHARES = (1.0, 0.75, 0.5, 0.25)
"""Shares of D/8 of which the first one is taken that the mechanics reach."""
SLIPPERY = 2.0
"""Usual friction over that at which a plate with usual loads would slip."""
DRAWN, SEED = 1000, 0
"""Sensors whose errors tell the expected one, and their seed: those of a yield of `magtip size`."""
PLANNED = "planned_"
"""Beginning of the columns of plan.csv that `magtip calibrate` does not read."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The sensor at rest, and planned presses in the order in which they are done.

    Attributes
    ----------
    sensor : the design at the means of its priors, on the stand.
    needed : the loads for which the sensor is planned.
    range_source : where these come from, in words.
    mechanics_source : where the mechanics come from, in words.
    force : (n, 3) N, of a sensor that is as designed.
    load : (n, 3) depth and shears of the plate, mm, under which it has these forces.
    angle : (n,) deg, of the force along the plate; NaN without one.
    reached : (m, 3) mm, shifts under the loads of `needed`.
    before, after : the sensor before and after these presses.
    lost : share of the loads of `needed` that the mechanics do not reach.
    """

    sensor: Sensor
    needed: Requirements
    range_source: str
    mechanics_source: str
    force: Array
    load: Array
    angle: Array
    reached: Array
    before: Fit
    after: Fit
    lost: float

    def error(self, found: Fit) -> float:
        """Return what 95 % of made sensors' largest errors over the loads stay below, over the largest force."""
        errors = largest_errors(found, self.reached, self.needed, DRAWN, SEED)
        return float(np.quantile(errors, 0.95, method="higher"))

    def deviation(self, found: Fit) -> float:
        """Return the root of the mean variance of a component of decoded forces over the loads, N."""
        (variance,) = calibrated_forces.force_variances(found, [found.covariance], self.reached)
        return math.sqrt(variance)

    def rows(self) -> list[FlatRow]:
        """Return the rows of plan.csv: what to set, and empty cells for what is measured; press 0 is rest."""
        elements = parts.of_design(self.sensor.design)
        empty = [f"{name}_{elements[0].unit}" for name in parts.columns(elements)]
        empty += [*FORCES, "depth_mm"]
        names = [PLANNED + name for name in (*FORCES, "depth_mm", "shear_x_mm", "shear_y_mm")]
        return [
            {"press": k, "angle_deg": angle} | dict(zip(names, row, strict=True)) | dict.fromkeys(empty)
            for k, (angle, row) in enumerate(
                zip(self.angle.tolist(), np.hstack([self.force, self.load]).tolist(), strict=True)
            )
        ]

    def record(self) -> FlatRow:
        """Return the object that --json prints."""
        return {
            "loads": self.range_source,
            "force_z_N": self.needed.force_z,
            "force_x_N": self.needed.force_x,
            "mechanics": self.mechanics_source,
            "force_noise_N": self.sensor.force_noise,
            "lost_percent": 100 * self.lost,
            "error_before_percent": 100 * self.error(self.before),
            "error_after_percent": 100 * self.error(self.after),
            "deviation_before_N": self.deviation(self.before),
            "deviation_after_N": self.deviation(self.after),
            "presses": self.shown(),
        }

    def sentences(self) -> list[str]:
        """Return what the plan is for, how it is done, and what it promises."""
        aside, record = self.needed.force_x, self.record()
        before, after = (record[f"error_{when}_percent"] for when in ("before", "after"))
        along = f", and forces along the plate up to {aside:.4g} N" if aside else ""
        how = (
            "Row 0 is the sensor at rest: write down its readings, and 0 as its forces. Then press until the force "
            "sensor shows Fz, move the plate until it shows Fx and Fy, and write down readings, forces and, if it is "
            "known, the depth; depths and shears are those of a sensor as designed."
        )
        promise = (
            "After these presses 95 % of made sensors decode each force of these loads with an error below "
            f"{after:.3g} % of the largest force along its axis, beside noise; before any press the errors stay "
            f"below {before:.3g} %. The standard deviation of a decoded force, with noise, falls from "
            f"{record['deviation_before_N']:.3g} N to {record['deviation_after_N']:.3g} N."
        )
        return [
            f"Loads: {self.range_source}: presses up to {self.needed.force_z:.4g} N{along}.",
            f"Mechanics: {self.mechanics_source}.",
            how,
            promise,
        ]

    def warnings(self) -> list[str]:
        """Return a sentence if loads are left out."""
        left_out = (
            f"{shown(self.lost, 'percent')} of the loads are beyond the mechanics, and left out: "
            "give --responses, states of finite elements under larger loads"
        )
        return [left_out] if self.lost else []

    def shown(self) -> list[dict[str, Any]]:
        """Return the rows of the terminal: what to set."""
        return [{name.removeprefix(PLANNED): v for name, v in row.items() if v is not None} for row in self.rows()]


def plan(
    design: Design,
    made: Tolerances,
    needed: Requirements | None,
    *,
    count: int = PRESSES,
    responses: Path | None = None,
    force_noise: float | None = None,
    solves: Mapping[str, Any] = {},
) -> Plan:
    """Return the presses that tell most about a made sensor of a design.

    Parameters
    ----------
    made : tolerances of the sensor.
    needed : its requirements; None for usual loads.
    responses, solves : see `calibration_study.mechanics_of`.
    force_noise : standard deviation of a measured force, N; default: ASSUMED_NOISE of the largest one.

    Raises
    ------
    BadInput, SolveFailed
        The design has no magnet, finite elements know too few of its states, or its loads are beyond them.
    """
    import pandas as pd

    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0), so no bench of it has readings")
    # refused before the mechanics take their time
    _check_count(count, MOST_PRESSES)
    law, source, error = calibration_study.mechanics_of(design, responses, solves)
    noise, _ = calibration_study.noise_of(design)
    empty = Bench(pd.DataFrame({"run": []}), tuple(parts.columns(parts.of_design(design))), [])
    un = sensor_fit.unknowns_of(design, empty, made, model_error=error)
    sensor = Sensor(design, law, un, noise, 1.0)
    words = "the table [requirements] of the design"
    if needed is None:
        needed, words = usual_loads(sensor)
    sensor = dataclasses.replace(sensor, force_noise=force_noise or ASSUMED_NOISE * needed.force_z)
    return _plan_of(sensor, needed, count=count, sources=(words, source))


def _plan_of(
    sensor: Sensor, needed: Requirements, *, count: int = PRESSES, sources: tuple[str, str] = ("", "")
) -> Plan:
    """Return the presses that tell most about a sensor, within the loads of requirements; see `plan`."""
    before = calibrated_forces.planned(sensor, np.zeros((0, 3)))
    shift, force, angle = calibrated_forces.poses_under(before, loads_of(needed, count))
    known = np.isfinite(shift).all(axis=1)
    lost = 1 - float(known.mean())
    most = min(int(known.sum()), MOST_PRESSES)
    largest = largest_press(sensor)
    if not needed.force_z <= largest or most < FEWEST:
        raise BadInput(
            f"a press of {needed.force_z:.4g} N is beyond the mechanics of this design, which reach {largest:.3g} N: "
            "lower force_z in [requirements], or give --responses, states of finite elements under larger loads"
        )
    _check_count(count, most)
    shift, force, angle = (each[known] for each in (shift, force, angle))
    left, chosen, rest = list(range(len(shift))), list[int](), np.zeros((1, 3))
    found = calibrated_forces.planned(sensor, rest)
    for _ in range(count):
        best, _, _ = calibrated_forces.next_press(found, shift[left], shift)
        chosen.append(left.pop(best))
        found = calibrated_forces.planned(sensor, np.vstack([rest, shift[chosen]]))
    aside = np.hypot(force[:, 0], force[:, 1])
    # by direction, in each with rising forces; pure presses first
    order = sorted(chosen, key=lambda k: (np.nan_to_num(angle[k], nan=-1.0), round(force[k, 2], 9), aside[k]))
    load = force_and_load(sensor.mechanics, np.ascontiguousarray(shift[order].T), contact=False)[1].T + 0.0
    force, load = (np.vstack([rest, each]) for each in (force[order], load))
    return Plan(sensor, needed, *sources, force, load, np.append(math.nan, angle[order]), shift, before, found, lost)


def _check_count(count: int, most: int) -> None:
    if not FEWEST <= count <= most:
        raise BadInput(f"the number of presses must lie between {FEWEST} and {most}; got {count}")


def loads_of(needed: Requirements, count: int = PRESSES) -> Array:
    """Return normal forces and forces along the plate (n, 2), N, all over the required ones, for `count` presses."""
    loads = needed.loads(dense=True)
    pure = loads[loads[:, 1] == 0, 0]
    pure = np.linspace(pure[0], pure[-1], max(len(pure), min(count, MOST_PRESSES)))
    return np.vstack([np.column_stack([pure, 0 * pure]), loads[loads[:, 1] > 0]])


def usual_loads(sensor: Sensor) -> tuple[Requirements, str]:
    """Return the loads of a design without requirements, a press to D/8 and a glued shear of D/8, and these words."""
    design, friction = sensor.design, Requirements(force_z=1.0).friction
    for share in SHARES:
        size = share * design.D / 8
        shift, _, force = calibrated_forces.poses_of(sensor, np.array([[size, size, 0.0]]))
        if np.isfinite(shift).all():
            break
    else:
        raise BadInput(
            f"the mechanics of this design end before a press of D/32 = {size:.3g} mm: give --responses, states of "
            "finite elements to larger depths"
        )
    z, x = float(force[0, 2]), float(force[0, 0])
    x = min(x, friction / SLIPPERY * z)
    name = "D/8" if share == 1 else f"{share:g} D/8, where the mechanics end"
    words = f"a press to {name} and a glued shear of as much, since the design states no [requirements]"
    return Requirements(force_z=z, force_x=x, press_with_shear=SLIPPERY * x / friction), words


def largest_press(sensor: Sensor) -> float:
    """Return the largest normal force of a press that the mechanics reach, N."""
    law = sensor.mechanics
    return float(force_and_load(law, np.array([[0.0], [0.0], [-law.sink]]), contact=False)[0][2, 0])


def largest_errors(found: Fit, shift: Array, needed: Requirements, count: int, seed: int) -> Array:
    """Return the largest error (count,) of decoded forces at shifts (n, 3) over the largest required force of its
    component, of sensors as uncertain as an estimated one."""
    span = np.array([needed.force_x or 0.0] * 2 + [needed.force_z])
    errors = calibrated_forces.force_errors(found, shift, count, np.random.default_rng(seed))
    required = span > 0
    return np.asarray((np.abs(errors).max(axis=1)[:, required] / span[required]).max(axis=1))
