"""Winners of `magtip size` from design file to decoded newtons, on benches of made sensors whose truth is known.

Each made sensor has a silicone, magnet, Hall part and places from the catalogues' ranges. It is pressed as `magtip
bench` plans, by finite elements of its own silicone and magnet; magpylib, an independent code, gives the field at its
displaced elements, with noise and the steps of their converters. `calibrate` gets these rows, and calibration.json
decodes presses between the planned ones. Errors are those against the true forces.
"""

from __future__ import annotations

import dataclasses
import math
import multiprocessing
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from geometry.arrays import Array
from geometry.bad_input import BadInput, SolveFailed
from geometry.design import PRESETS, Design
from geometry.messages import Progress
from studies.calibration import calibrated_forces, calibration_file, calibration_study, press_plan, simulated_bench
from studies.calibration.press_plan import Plan
from studies.calibration.simulated_bench import Stand
from studies.inputs.option_groups import Calibrating
from studies.inputs.user_input import read_design
from studies.output.goals import Goal
from studies.output.result import Result
from studies.parts.part_tolerances import parse_tolerances, parts_of_file
from studies.parts.requirements import Requirements, stated_requirements
from studies.sensitivity.made_sensors import made_sensors
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("WINNERS.md", "winners.csv")
WINNER = "winner.toml"
SENSORS, SEED, WORKERS = 6, 11, 2
"""Made sensors of each design, seed of the first one, and processes."""
UNSEEN = ((0.0, 0.0), (0.05, 0.5), (0.15, 0.0), (0.35, 0.5), (0.6, 0.3), (0.8, 0.9), (0.95, 0.6))
"""Shares of the required press, and of the largest force along the plate under it, of the decoded loads."""
TURNS = (20.0, 110.0, 200.0, 290.0, 335.0)
"""Their directions, deg: between the multiples of 45 of a plan."""
LEAST, LEAST_OF_DESIGN = 80.0, 75.0
"""Goals of the share of 90 % intervals that hold, %, over all sensors and over those of one design: errors of one
sensor depend on each other, so that its share scatters by 15, and that of six by 6 (sideways; along z by less)."""
PROMISE = "sensors whose largest error is within what the plan promises for 95 %"


def magpylib_field(points: Array, design: Design, shift: Array, turn: Array) -> Array:
    """Return B (n, 3), T, of a design's magnet at points (n, 3), mm, by magpylib; see `simulated_bench.FieldCode`."""
    import magpylib
    from scipy.spatial.transform import Rotation

    size = 1e-3 * np.array([design.magnet_diameter, design.magnet_height])
    centre = 1e-3 * (np.array([0.0, 0.0, design.H]) + shift)
    way = Rotation.from_rotvec(np.column_stack([turn, np.zeros(len(turn))]))
    local = way.inv().apply(1e-3 * points - centre)
    magnet = magpylib.magnet.Cylinder(polarization=(0.0, 0.0, -design.polarisation), dimension=size)
    return np.asarray(way.apply(np.atleast_2d(magnet.getB(local))))


def run(
    progress: Progress, *, winners: Path = Path("results/sizing"), sensors: int = SENSORS, quick: bool = False
) -> Result:
    """Calibrate made sensors of sized designs, and decode; exit status 3 if one is refused, or intervals do not hold.

    Parameters
    ----------
    winners
        Folder of folders that `magtip size` wrote, each with winner.toml; presets that are none of these are added.
    sensors
        Made sensors of each.
    quick
        One sensor of the first two.
    """
    files = sorted(winners.glob(f"*/{WINNER}"))
    if not files:
        raise BadInput(f"{str(winners)!r} has no folder with {WINNER}: give a folder of results of magtip size")
    sources = {file.parent.name: str(file) for file in files}
    sized = [read_design(source, []) for source in sources.values()]
    sources |= {f"preset {name}": name for name in PRESETS if read_design(name, []) not in sized}
    chosen, count = list(sources.items())[: 2 if quick else None], 1 if quick else sensors
    asked = [(name, source, j) for name, source in chosen for j in range(count)]
    rows = list[Row]()
    with ProcessPoolExecutor(1 if quick else WORKERS, multiprocessing.get_context("spawn")) as pool:
        answers = pool.map(judged, [source for _, source, _ in asked], [SEED + j for *_, j in asked])
        for (name, _, j), answer in zip(asked, answers, strict=True):
            rows.append({"winner": name, "sensor": j} | answer)
            progress(len(rows) / len(asked), f"{name}, sensor {j + 1} of {count}")
    return result(rows, quick=quick)


def judged(source: str, seed: int) -> Row:
    """Return what the calibration of one made sensor of a design file gives, in percent of the required forces."""
    design, needed = read_design(source, []), stated_requirements(source)
    made = parse_tolerances([], design, source)
    plan = press_plan.plan(design, made, needed)
    sensor = made_sensors(design, made, 1, seed, parts=parts_of_file(design, source))
    stand = Stand(plan.sensor.force_noise, field=magpylib_field)
    row: Row = {
        "E_over_nominal": float(sensor.fields["E"][0]) / design.E,
        "promised_percent": plan.record()["error_after_percent"],
    }
    try:
        seen = simulated_bench.bench(plan, sensor, stand, seed, _silent)
        unseen = simulated_bench.bench(between(plan), sensor, stand, seed + 1000, _silent)
    except SolveFailed as error:
        return row | {"refused": f"not solved: {error}"}
    with tempfile.TemporaryDirectory() as folder:
        bench, file = Path(folder) / "bench.csv", Path(folder) / "calibration.json"
        seen.drop(columns=[*simulated_bench.TRUE, *simulated_bench.MOVED]).to_csv(bench, index=False)
        found = calibration_study.run(design, made, needed, [bench], Calibrating(), "", _silent)
        row["refused"] = "; ".join(found.failures)
        if found.failures:
            return row
        found.files["calibration.json"](file)
        fit = calibration_file.of_design(file, design)
    held = found.tables["held_out"]
    readings = unseen[simulated_bench.columns(design)].to_numpy()
    usable = ~calibration_file.at_rails(design, readings).any(axis=1)
    decoded = calibrated_forces.decode(fit, readings[usable], np.zeros(int(usable.sum())))
    off = decoded.force - unseen[simulated_bench.TRUE].to_numpy()[usable]
    return row | scores(off, decoded.half_width, plan.needed) | {
        "saturated": int((~usable).sum()),
        "regression_over_held_out": _ratio(held),
    }  # fmt: skip


def between(plan: Plan) -> Plan:
    """Return a plan of loads that a plan has not, within its requirements."""
    needed = plan.needed
    aside = needed.force_x or 0.0
    force, way = [], np.radians(TURNS)
    for press, share in UNSEEN:
        z = press * needed.force_z
        x = share * min(aside, needed.friction * z)
        force += [[x * math.cos(angle), x * math.sin(angle), z] for angle in way]
    wanted = np.array(force)
    none = np.full_like(wanted, np.nan)
    return dataclasses.replace(plan, force=wanted, load=none, angle=np.tile(np.array(TURNS), len(UNSEEN)))


def scores(off: Array, half: Array, needed: Requirements) -> Row:
    """Return errors (n, 3), N, and shares of intervals that hold, by axis; errors over the largest required force."""
    known = np.isfinite(off).all(axis=1)
    span = np.array([needed.force_x or needed.force_z] * 2 + [needed.force_z])
    inside = 100 * (np.abs(off[known]) <= half[known]).mean(axis=0)
    rmse = np.sqrt(np.square(off[known]).mean(axis=0)) / span * 100
    largest = np.abs(off[known] / span).max(initial=0.0) * 100
    named = dict(zip("xyz", zip(rmse.tolist(), inside.tolist(), strict=True), strict=True))
    return {
        "rows": len(off),
        "lost": int((~known).sum()),
        "rmse_N": float(np.sqrt(np.square(off[known]).sum(axis=1).mean())),
        **{f"rmse_{axis}_percent": error for axis, (error, _) in named.items()},
        **{f"inside_{axis}_percent": share for axis, (_, share) in named.items()},
        "largest_percent": float(largest),
    }


def _ratio(held_out: Any) -> float:
    """Return the least RMSE of a regression on held-out rows over that of the calibration."""
    rmse = pd.DataFrame(held_out).groupby("method").rmse_N.apply(lambda each: math.sqrt(float((each**2).mean())))
    own = rmse[calibration_study.METHODS[0]]
    return float(rmse.drop(calibration_study.METHODS[0]).min() / own)


def _silent(share: float, text: str) -> None:
    """Take progress of a part of the study."""


def result(rows: list[Row], *, quick: bool) -> Result:
    """Return the table of the winners, with goals of refusals, intervals by axis and the promise."""
    frame = pd.DataFrame(rows)
    done = frame[frame.refused == ""]
    goals = [Goal("calibrations that are refused", len(frame) - len(done), 0, len(frame))]
    for axis in "xyz":
        share = float(done[f"inside_{axis}_percent"].mean(skipna=False)) if len(done) else math.nan
        goals.append(Goal(f"90 % intervals along {axis} that hold", share, LEAST, len(done), "%", at_least=True))
        by_design = done.groupby("winner")[f"inside_{axis}_percent"].mean() if len(done) else pd.Series([math.nan])
        least, what = float(by_design.min(skipna=False)), f"90 % intervals along {axis} that hold, least of a design"
        goals.append(Goal(what, least, LEAST_OF_DESIGN, len(by_design), "%", at_least=True))
    kept = 100 * float((done.largest_percent <= done.promised_percent).mean()) if len(done) else math.nan
    goals.append(Goal(PROMISE, kept, LEAST, len(done), "%", at_least=True))
    numbers = [name for name in done if name not in ("winner", "sensor", "refused")]
    table = done.groupby("winner")[numbers].mean().reset_index() if len(done) else done
    if len(done):
        table["refused"] = table.winner.map((frame.refused != "").groupby(frame.winner).sum())
    page: Row = {"table": pages.records(table), "sensors": len(frame), "designs": frame.winner.nunique()}
    page["loads"] = len(UNSEEN) * len(TURNS)
    page["refusals"] = [
        f"{row['winner']}, sensor {row['sensor']}: {row['refused']}" for row in rows if row["refused"]
    ]
    return pages.study("winners", "Winners on benches", rows, page, goals=goals, run="quick" if quick else "full")
