"""Calibrations of made sensors whose truth is known: do intervals hold, and what do a few presses give?

templates/calibrations.md.j2 says how sensors and stands are made. Sensors share the mechanics of a few designs, which
differ in what tolerances change, and have everything else of their own; forces are larger in half of the rows, on the
way down, and smaller in the others.

Each sensor is calibrated from 30 rows, and decodes others. Quadratic regressions get the same 30 rows, and 3000.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analytic.inverse.forward_model import rotation
from analytic.inverse.response_surface import Mechanics, force_and_load, forces
from analytic.parts import CONVERTER_STEP
from analytic.reading_noise import of_average
from fem.accuracy import QUICK
from geometry.arrays import Array
from geometry.design import Design, paper
from geometry.messages import Progress
from studies.beam.beam_model import mechanics, motions
from studies.calibration import (
    calibrated_forces,
    calibration_study,
    force_regression,
    regression_study,
    sensor_fit,
    simulated_bench,
)
from studies.calibration.bench_file import Bench
from studies.calibration.regression_study import Recorded
from studies.calibration.sensor_fit import Sensor
from studies.calibration.simulated_bench import STAND_COMPLIANCE, STAND_ZERO, Stand, States
from studies.cases import FiniteElements
from studies.output.goals import Goal
from studies.output.result import Result, Table
from studies.parts.part_tolerances import tolerances
from studies.sensing.decode_readings import QUANTILE
from studies.sensitivity.made_sensors import MadeSensors, made_sensors
from studies.simulation.solved_beams import SolvedBeams
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("CALIBRATIONS.md", "calibrations.csv", "unknowns.csv")
SENSORS, VARIANTS, SEED = 200, 12, 7
QUICK_SENSORS, QUICK_VARIANTS = 24, 3
ROWS, MANY, UNSEEN = 30, 3000, 200
"""Rows of a calibration, of the large regression, and rows that are decoded."""
DEPTHS, SHEARS = np.linspace(0.15, 2.3, 9), np.linspace(0.0, 1.0, 4)
"""Depths, mm, and shears over depth and over 1, of the solved states; shears end at the edge of the stick range."""
FORCE_NOISE, READING_NOISE = 0.02, 2.5e-4
"""Standard deviations of a measured force, N, and of a reading, V."""
STAND = Stand(FORCE_NOISE, READING_NOISE, loop=0.01, depth_noise=0.005)
ENOUGH = 100
"""Least number of sensors for goals of single unknowns."""
LAW: dict[str, Any] = {"law": "yeoh", "yeoh_2": 0.02}
FAR_OFF, FALSE = 12, 5.0
"""Number of sensors with parts three tolerances off, all of which are to be told; goal of the share of sensors within
tolerances of which the same is said, %."""
LEAST, MOST = 85.0, 95.0
"""Goals of the shares of 90 % intervals that hold, %."""
INSIDE = tuple(f"inside_{axis}_percent" for axis in "xyz")
"""Columns of the shares of intervals that hold, by axis."""
LOST = 1.0
"""Largest share of the decoded rows that may get no force, %."""


def mechanics_of(designs: Sequence[Design], store: Path | None, progress: Progress) -> list[Mechanics]:
    """Return the mechanics of designs by finite elements at level quick, in N and mm."""
    loads = np.repeat(DEPTHS, len(SHEARS)), np.outer(DEPTHS, SHEARS).ravel()
    depth, shear = (np.tile(each, (len(designs), 1)) for each in loads)
    fem = FiniteElements(QUICK, {"store": store, "progress": progress})
    moved = motions(SolvedBeams(designs, fem), designs, depth, shear)
    return [mechanics(moved, depth, shear, k) for k in range(len(designs))]


def stand_rows(made: MadeSensors, unit: Mechanics, E: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return what a stand measures of a made sensor at random shifts (n, 9), and its true forces (n, 3).

    unit : mechanics for E = 1 MPa; E : of the sensor, MPa.
    """
    law = dataclasses.replace(unit, lateral=unit.lateral * E, normal=unit.normal * E)
    shift = random_shifts(law, MANY + UNSEEN, rng)
    force, load, _ = force_and_load(law, shift.T, contact=False)
    states = States(force.T, shift, rotation(law.tilt, shift.T).T)
    rows = simulated_bench.measured(made, states, load[:1].T, STAND, rng)
    return np.column_stack([rows, np.full((len(rows), 2), np.nan)]), states.force


def random_shifts(law: Mechanics, count: int, rng: np.random.Generator) -> Array:
    """Return shifts (n, 3) of loads within the solved states that a plate with friction 1 can apply."""
    found = np.zeros((0, 3))
    while len(found) < count:
        w, angle = -law.sink * rng.uniform(0.05, 0.95, count) ** 0.7, rng.uniform(0, 2 * np.pi, count)
        u = law.reach * rng.uniform(0, 1, count) * (-w / law.sink)
        shift = np.stack([u * np.cos(angle), u * np.sin(angle), w], axis=1)
        force = forces(law, shift.T)[0].T
        holds = (force[:, 2] > 0.1) & (np.hypot(force[:, 0], force[:, 1]) < force[:, 2])
        found = np.concatenate([found, shift[holds]])
    return found[:count]


def truth_of(made: MadeSensors, un: sensor_fit.Unknowns, base: Design) -> dict[str, float]:
    """Return the true values of a made sensor's unknowns; the ambient field is 0."""
    (design,) = made.designs
    assert design is not None
    values = {"modulus": design.E / base.E, "remanence": design.remanence / base.remanence}
    values |= {"stand_zero": STAND_ZERO, "stand_compliance": STAND_COMPLIANCE}
    values |= {"wider_diameter": design.magnet_diameter - base.magnet_diameter}
    values |= {"wider_height": design.magnet_height - base.magnet_height}
    values |= {f"magnet_{axis}": v for axis, v in zip("xyz", made.magnet_offset[0].tolist(), strict=True)}
    values |= {f"tilt_{axis}": v for axis, v in zip("xy", made.magnet_tilt[0].tolist(), strict=True)}
    for i, name in enumerate(("S1", "S2", "S3")):
        values |= {f"gain_{name}": float(made.gain_factor[0, i]), f"null_{name}": float(made.null_shift[0, i])}
        values |= {f"place_{name}_{a}": float(v) for a, v in zip("xyz", made.element_offset[0, i], strict=True)}
    return {name: values[name] for name in un.names if name in values}


def run(progress: Progress, *, quick: bool = False, store: Path | None = None) -> Result:
    """Calibrate 200 simulated made sensors; exit status 3 if intervals do not hold, or regressions are as good.

    Parameters
    ----------
    quick
        Calibrate 24 sensors: a minute in place of some ten.
    store
        File of solved states; default: that of the user.
    """
    count, variants = (QUICK_SENSORS, QUICK_VARIANTS) if quick else (SENSORS, VARIANTS)
    base = paper(hall_step=CONVERTER_STEP)
    made = made_sensors(base, tolerances(), count, SEED)
    # a variant has the nu and the magnet of a made sensor, and another law; its E is that of each sensor
    possible = [design for design in made.designs if design is not None]
    few = [dataclasses.replace(design, E=base.E, **LAW) for design in possible[:variants]]
    laws = mechanics_of(few, store, lambda share, text: progress(0.5 * share, text))
    nominal, source, error = calibration_study.mechanics_of(base, None)
    rng = np.random.default_rng(SEED)
    judged, unknowns = list[Row](), list[Row]()
    for k in (k for k, design in enumerate(made.designs) if design is not None):
        progress(0.5 + 0.5 * k / count, f"sensor {k + 1} of {count}")
        measured = stand_rows(made.one(k), laws[k % variants], float(made.fields["E"][k]), rng)
        one, found = _judge(made.one(k), base, (nominal, error), *measured)
        judged.append({"sensor": k} | one)
        unknowns += [{"sensor": k} | row for row in found]
    named = 0
    for k in range(min(FAR_OFF, len(judged))):
        wrong, E = far_off(made.one(k), rng)
        one, _ = _judge(wrong, base, (nominal, error), *stand_rows(wrong, laws[k % variants], E, rng))
        named += one["contradicted"] > 0
    return result(judged, unknowns, source, count, named)


def far_off(made: MadeSensors, rng: np.random.Generator) -> tuple[MadeSensors, float]:
    """Return a sensor whose remanence, E and magnet lie three tolerances off, and its E, MPa."""
    (design,), sizes, way = made.designs, tolerances(), rng.choice([-3.0, 3.0], size=3)
    assert design is not None
    nominal, offset = made.nominal, made.magnet_offset.copy()
    offset[0, rng.integers(2)] = way[0] * sizes["magnet_x"]
    E, J = nominal.E * (1 + way[1] * sizes["E"] / 100), nominal.remanence * (1 + way[2] * sizes["remanence"] / 100)
    return dataclasses.replace(
        made, designs=(dataclasses.replace(design, E=E, remanence=J),), magnet_offset=offset
    ), E


def _judge(
    made: MadeSensors, base: Design, model: tuple[Mechanics, float], rows: Array, force: Array
) -> tuple[Row, list[Row]]:
    names = ("S1", "S2", "S3")
    bench = Bench(pd.DataFrame({"depth_mm": [0.0], "run": "a"}), names, [])
    un = sensor_fit.unknowns_of(base, bench, tolerances(), model_error=model[1])
    sensor = Sensor(base, model[0], un, np.full(3, of_average(READING_NOISE, CONVERTER_STEP)), 0.05)
    found = sensor_fit.fit_with_noise(sensor, rows[:ROWS], np.zeros(ROWS))
    readings, true = rows[MANY:, :3], force[MANY:]
    decoded = calibrated_forces.decode(found, readings, np.zeros(len(readings)))
    off = decoded.force - true
    known = np.isfinite(off).all(axis=1)

    def rmse(values: Array) -> float:
        return float(np.sqrt(np.square(values).sum(axis=1).mean()))

    inside = np.abs(off[known]) <= decoded.half_width[known]
    few, many = (force_regression.fit(rows[:n, :3], rows[:n, 3:6], 2).force(readings) - true for n in (ROWS, MANY))
    score: Row = {
        "rmse_N": rmse(off[known]),
        "quadratic_rmse_N": rmse(few),
        "quadratic_3000_rmse_N": rmse(many),
        "inside_percent": 100 * float(inside.mean()),
        **{
            f"inside_{axis}_percent": 100 * float(share)
            for axis, share in zip("xyz", inside.mean(axis=0), strict=True)
        },
        "lost": int((~known).sum()),
        "contradicted": len(calibration_study.contradicted(found)),
        "force_noise_N": found.sensor.force_noise,
        "force_share": found.sensor.force_share,
        "largest_N": float(np.abs(true).max()),
    }
    score |= _judged_regression(base, rows, true)
    truth = truth_of(made, un, base)
    unknowns = [
        {
            "name": name,
            "true": truth[name],
            "value": v,
            "deviation": d,
            "inside": abs(v - truth[name]) <= QUANTILE * d,
        }
        for name, v, d in zip(un.names, found.theta.tolist(), found.deviation.tolist(), strict=True)
        if name in truth
    ]
    return score, unknowns


def _judged_regression(base: Design, rows: Array, true: Array) -> Row:
    """Return how the regression of the first rows decodes those behind, within its range: beside true forces (n, 3),
    and whether intervals hold the measured ones."""
    bench = Bench(pd.DataFrame({"run": ["a"] * ROWS}), ("S1", "S2", "S3"), [])
    recorded = Recorded(bench, rows[:ROWS], None, np.arange(ROWS), (), ())
    found = regression_study.compared(base, recorded, FORCE_NOISE).found
    words, force, half = found.decode(rows[MANY:, :3], np.full(len(true), np.nan))
    known = np.array(words) == "ok"
    inside = np.abs(force - rows[MANY:, 3:6]) <= half
    return {
        "regression_rmse_N": float(np.sqrt(np.square(force - true)[known].sum(axis=1).mean())),
        "regression_inside_percent": 100 * float(inside[known].mean()),
        "regression_out_of_range_percent": 100 * float(1 - known.mean()),
    }


def result(judged: Sequence[Row], unknowns: Sequence[Row], source: str, drawn: int, named: int) -> Result:
    """Return the result of the sensors that were judged, of `drawn` ones; a row without a force misses its goal.

    named : number of the sensors far off of which a prior is said to be contradicted.
    """
    frame, each = pd.DataFrame(judged), pd.DataFrame(unknowns)
    shares = each.groupby("name", sort=False).agg(
        inside_percent=("inside", lambda own: 100 * own.mean()), deviation=("deviation", "median")
    )
    # a sensor none of whose rows is decoded has no error, and no median leaves it out
    few, many = (
        float((frame.rmse_N / frame[f"quadratic{rows}_rmse_N"]).median(skipna=False)) for rows in ("", "_3000")
    )
    n = len(frame)
    goals = [
        Goal("sensors without a calibration", drawn - n, 0, drawn),
        Goal("rows without a force", 100 * float(frame.lost.mean()) / UNSEEN, LOST, n * UNSEEN, "%"),
    ]
    inside = float(frame.inside_percent.mean(skipna=False))
    told = [("forces", inside), ("all unknowns", 100 * float(each.inside.mean()))]
    # of a few sensors the share of one unknown, or of regressions, is chance
    axes = [(f"forces along {name[7]}", float(frame[name].mean(skipna=False))) for name in INSIDE]
    by_regressions = ("forces by regressions", float(frame.regression_inside_percent.mean(skipna=False)))
    for name, share in [*told, *([*axes, by_regressions, *shares.inside_percent.items()] if n >= ENOUGH else [])]:
        goals.append(Goal(f"90 % intervals of {name} that hold", share, LEAST, n, "%", at_least=True))
        goals.append(Goal(f"90 % intervals of {name} that hold (not too wide)", share, MOST, n, "%"))
    # sensors with right priors, and with wrong ones
    alarms, far = 100 * float((frame.contradicted > 0).mean()), min(FAR_OFF, n)
    what = "calibrations that call a prior contradicted, parts"
    goals.append(Goal(f"{what} three tolerances off", 100 * named / far, 100.0, far, "%", at_least=True))
    goals.append(Goal(f"{what} within tolerances", alarms, FALSE, n, "%"))
    goals.append(Goal("RMSE over that of a quadratic regression, both from 30 rows, median", few, 1 / 3, n))
    goals.append(Goal("RMSE from 30 rows over that of a quadratic regression from 3000, median", many, 1.0, n))
    table = [{"unknown": name, **row} for name, row in shares.to_dict("index").items()]
    page: Row = {"table": table, "sensors": n, "source": source}
    page["median"] = pages.records(frame.drop(columns="sensor").median().to_frame().T)
    title = "Calibrations of made sensors"
    shown = [Table(title=title, rows=table), *map(str, goals[-4:]), str(goals[2])]
    tables = {"calibrations": judged, "unknowns": unknowns}
    fields: Row = {"shown": shown, "tables": tables, "digits": 5, "run": "full" if n >= ENOUGH else "quick"}
    return pages.study("calibrations", title, judged, page, goals=goals, **fields)
