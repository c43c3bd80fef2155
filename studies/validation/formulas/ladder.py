"""Every level of the formulas beside finite elements: ten designs, presses and shears of a glued plate."""

from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from analytic import beam, buckling
from geometry.design import Design
from geometry.loads import Load
from geometry.messages import Progress
from studies import cases
from studies.inputs.user_input import AccuracyName
from studies.output.figures import picture
from studies.output.goals import Goal
from studies.output.result import Result
from studies.validation import pages
from studies.validation.error_study_cases import designs
from studies.web import verdict_figures

FILES = ("LADDER.md", "ladder.csv", "ladder.png")
PRESSES = (0.03, 0.06, 0.12, 0.18, 0.25)
UNDER, SHEARS = (0.06, 0.12, 0.25), (0.05, 0.15, 0.3)
"""Depths of the presses, depths under the shears, which are among them, and shears, over D."""
ERRORS = ("press_force", "sinking", "press_under_shear", "shear_force", "shift", "tilt")
"""Quantities whose relative error is a column, as ladder.md.j2 defines it; one that does not apply is NaN."""
MOTION = {"force_x_N": "force_x_N", "force_z_N": "force_N", "shift_x_mm": "shift_x_mm", "shift_z_mm": "shift_z_mm"}
MOTION |= {"tilt_rad": "tilt_rad"}
"""Columns of the table, and of the answers."""
SIZES = ("design", "D_mm", "L_over_D", "magnet_diameter_over_D", "magnet_height_over_D")


def run(
    progress: Progress, *, accuracy: AccuracyName = "quick", quick: bool = False, store: Path | None = None
) -> Result:
    """Compare every level of the formulas with finite elements on ten designs: errors by level and region.

    Exit status 3 if the finite elements do not reach a load.

    Parameters
    ----------
    accuracy
        Accuracy of the finite elements.
    quick
        Use the first of ten designs: some seconds.
    store
        File of solved states; default: that of the user.
    """
    count = 1 if quick else len(designs("ladder"))
    states = [
        (number, design, load) for number, design in enumerate(designs("ladder")[:count]) for load in loads(design)
    ]
    asked = cases.table((d, load, "rigid" if d.shape.has_magnet else "ignored") for _, d, load in states)
    models, quantities = [f"fem:{accuracy}", *beam.LEVELS], ["force", "shift", "tilt"]
    found = cases.answer(asked, models, quantities=quantities, store=store, progress=progress)
    # the levels of a state stand together
    return result(pd.concat(compare(states, found, level) for level in beam.LEVELS).sort_index(kind="stable"))


def loads(design: Design) -> list[Load]:
    D = design.D
    return [
        *(Load(depth=share * D) for share in PRESSES),
        *(Load(depth=under * D, shear_x=share * D, friction="stick") for under, share in product(UNDER, SHEARS)),
    ]


def compare(states: list[tuple[int, Design, Load]], found: pd.DataFrame, level: str) -> pd.DataFrame:
    """Return motions and errors of a level in states, of which `found` are the answers; NaN where there are none."""
    place = pd.DataFrame(
        {
            "design": number,
            "D_mm": design.D,
            "L_over_D": design.L / design.D,
            "magnet_diameter_over_D": design.shape.magnet_diameter / design.D,
            "magnet_height_over_D": design.shape.magnet_height / design.D,
            "depth_over_D": round(load.depth / design.D, 6),
            "shear_over_D": round(load.shear_x / design.D, 6),
            "level": level,
            "outside": beam.outside(design, load, level),
        }
        for number, design, load in states
    )
    one, fem = (
        pd.DataFrame({name: found[f"{model}_{column}"] for name, column in MOTION.items()})
        for model in (f"analytic_{level}", "fem")
    )
    refused, lost = one.force_z_N.isna(), fem.force_z_N.isna()
    place["status"] = np.select([lost, refused], ["not_converged", "refused"], "ok")
    place["message"] = np.where(lost | refused, found["message"], "")
    R, shear = (pd.Series(values) for values in zip(*((d.R, load.shear_x) for _, d, load in states), strict=True))
    cantilever = pd.Series([buckling.sideways_stiffness(design) for _, design, _ in states])
    sheared = shear > 0
    # the formula's press force before each shear is that of the press to the same depth
    before = one.force_z_N.where(~sheared).groupby([place["design"], place["depth_over_D"]]).transform("first")
    one[lost | refused] = fem[lost | refused] = np.nan
    off = one - fem
    errors = {
        "sinking": off.shift_z_mm / fem.shift_z_mm,
        "press_force": (off.force_z_N / fem.force_z_N).where(~sheared),
        "press_under_shear": (off.force_z_N / before).where(sheared),
        "shear_force": (off.force_x_N / (cantilever * shear)).where(sheared),
        "shift": (off.shift_x_mm / shear).where(sheared),
        "tilt": (off.tilt_rad * R / shear).where(sheared),
    }
    return pd.concat([place, one, fem.add_prefix("fem_"), pd.DataFrame(errors).add_suffix("_error")], axis=1)


def means(rows: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Return number of states and root mean squares of the errors, percent, of groups; NaN where no state has one."""
    errors = (rows[[f"{name}_error" for name in ERRORS]] ** 2).assign(**rows[by])
    groups = errors.groupby(by, sort=False)
    found = (100 * groups.mean() ** 0.5).add_suffix("_percent").assign(states=groups.size()).reset_index()
    return found[[*by, "states", *(f"{name}_error_percent" for name in ERRORS)]]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    shear, depth = rows.shear_over_D, rows.depth_over_D
    regions = {
        "press to 0.06 D": (shear == 0) & (depth <= 0.06),
        "press to D/4": (shear == 0) & (depth > 0.06),
        "shear of 0.05 D": shear == 0.05,
        "shear to 0.3 D": shear > 0.05,
        "in its own range": (rows.outside == "") & (rows.level != "paper"),
    }
    solved = rows.status == "ok"
    place = ["level", "region"]
    table = pd.concat(means(rows[inside & solved].assign(region=region), place) for region, inside in regions.items())
    return table.sort_values("level", kind="stable", key=lambda names: names.map(beam.LEVELS.index))


def by_design(rows: pd.DataFrame, level: str) -> pd.DataFrame:
    return means(rows[(rows.level == level) & (rows.status == "ok")], list(SIZES))


def goals(rows: pd.DataFrame) -> list[Goal]:
    """Return the goals of the study: each level is compared with finite elements in every state that it takes."""
    taken = rows[rows.status != "refused"]
    lost = (taken.status != "ok").groupby(taken.level).agg(["sum", "size"]).reindex(beam.LEVELS, fill_value=0)
    return [
        Goal(f"level {level}, states without a comparison", int(number), 0, int(count))
        for level, number, count in lost.itertuples()
    ]


def result(rows: pd.DataFrame) -> Result:
    best, records = beam.LEVELS[-1], pages.records(rows)
    regions, designs = (pages.records(table) for table in (summary(rows), by_design(rows, best)))
    stopped = rows[rows.message != ""].drop_duplicates(["design", "message"])
    page: pages.Row = {"summary": regions, "best": best, "designs": designs}
    page["stopped"] = sorted(f"design {row.design}: {row.message}" for row in stopped.itertuples())
    files = {"ladder.png": partial(picture, rows=records, draw=verdict_figures.ladder)}
    title = "Errors of the formulas, root mean square"
    return pages.study("ladder", title, records, page, regions, goals=goals(rows), files=files)
