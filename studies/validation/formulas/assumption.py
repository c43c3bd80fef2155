"""Where does the beam assumption hold? A sweep over designs and loads, regions within 5 and 10 %, and findings.

The sweep is a study file; the shipped one is `studies/examples/beam_assumption.toml`. Its models must be one
finite-element model and all levels of the formulas, and its axes L, the size of the magnet, nu, depth and shear. The
findings are in templates/assumption_findings.j2.

The errors of the paper's readings are split. The paper's reading is that of an upright magnet at the position by its
formulas, in the field by equation (3). The true one is that of the finite elements' pose in the exact field. The
difference is the sum of three parts:

    field       the paper's field less the exact one, at the paper's pose
    mechanics   the exact reading at the paper's position less that at the finite elements' position, both upright
    tilt        the exact reading of the upright magnet less that of the tilted one, at the finite elements' position

All are in % of full scale: the largest change from rest that the finite elements give a sensor in the table, for S2
and S3 together. `dipole` is what a dipole in place of (3) would add to the field part. The elements stay where they
are in the base of the sensor; L changes the distance to the magnet. A state whose pose is unknown has no parts.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analytic import beam, hall
from analytic.parts import of_design
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.answers import flat_rows
from studies.inputs.option_groups import Sweep, Whole
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import Cases, Plan, varied
from studies.output import atomic_files, page_templates
from studies.output.figures import COLOURS, LOG, Figure, panels, save, styles, table_of
from studies.output.maps import heat
from studies.output.result import Result, Table
from studies.sweeps import sweep
from studies.validation import pages
from studies.validation.pages import Row
from studies.web.paper_figures import MARKED, QUANTITIES, body, cells, error_map, errors, map_cells

STUDY = Path(__file__).resolve().parents[2] / "examples" / "beam_assumption.toml"
QUICK = Path(__file__).with_name("assumption_quick.toml")
"""The shipped study, and one of twelve cases."""
CELL, WITH_HEIGHT = ("L", "magnet_height", "nu", "depth", "shear"), ("magnet_diameter", "magnet_edge_radius")
"""Axes that make a cell, and those that may follow the magnet's height."""
FILES = (
    *("ASSUMPTION.md", "sweep.csv", "shares.csv", "best.csv", "readings.csv"),
    *("press_force.png", "sinking.png", "shear_force.png", "sideways_shift.png", "tilt.png"),
    *("best_level.png", "readings.png"),
)
BOUNDS = (5.0, 10.0)
"""Errors that bound a region, %; the map of the best level shows none beyond the second."""
FORMULAS = {"press force": "formula (5)", "shear force": "formula (6)"}
DEPTHS, BODIES = (0.06, 0.2), (0.0, 0.25)
"""Depths and heights of the magnet, over D, that part regions; a press up to the first is called light."""


def plan_of(study: Path) -> Plan:
    """Return the plan of a study file; BadInput if it lacks a model or an axis."""
    plan = sweep.plan_of(str(study), Sweep())
    why, allowed = "", (*CELL, *WITH_HEIGHT)
    if sum(model.states_errors for model in plan.models) != 1 or not set(beam.LEVELS) <= set(plan.levels):
        why = f"must have one finite-element model and all levels of the formulas ({', '.join(beam.LEVELS)}): "
        why += "change its models"
    elif other := ", ".join(name for name in plan.axes if name not in allowed):
        why = f"has the axis {other}; its axes may be {', '.join(allowed)}: "
        why += f"give {other} one value in [design] or [load]"
    elif lacking := ", ".join(name for name in CELL if name not in plan.axes):
        why = f"lacks the axis {lacking}: add it, with one value if fixed"
    elif not {"force", "shift", "tilt"} <= set(plan.quantities):
        why = "needs the quantities force, shift and tilt: add them"
    else:
        axes = Cases(plan).batch(np.arange(plan.count)).axes
        places = np.unique(np.column_stack([np.asarray(axes[name], dtype=float) for name in CELL]), axis=0)
        if len(places) < plan.count:
            why = f"has {plan.count} cases of {len(places)} different {', '.join(CELL)}; each may have one case: zip "
            why += f"{' and '.join(WITH_HEIGHT)} with magnet_height"
    if why:
        raise BadInput(f"the study {str(study)!r} {why}")
    return plan


def run(
    progress: Progress,
    *,
    study: Path | None = None,
    quick: bool = False,
    store: Path | None = None,
    workers: Whole | None = None,
    scheduler: str | None = None,
) -> Result:
    """Map where the paper's formulas, and every level above them, are within 5 and 10 % of finite elements.

    Parameters
    ----------
    study
        TOML file of a study; default: studies/examples/beam_assumption.toml.
    quick
        Use a study of twelve cases at accuracy quick: some seconds instead of eight minutes.
    store
        File of solved states; default: that of the user.
    workers
        Number of processes that solve; default: one for each core.
    scheduler
        Address of a Dask scheduler whose workers solve.
    """
    file = study or (QUICK if quick else STUDY)
    plan = plan_of(file)
    atomic_files.check_apart([store], [file])
    with sweep.opened(plan, None, progress, Processes(workers, scheduler), store) as batches:
        tables = list(batches)
    return result({name: np.concatenate([each[name] for each in tables]) for name in tables[0]}, plan.design)


def result(table: Mapping[str, NDArray[Any]], design: Design) -> Result:
    found = cells(pd.DataFrame(table))
    nu = found["nu"].max()
    main = found[found["nu"] == nu]
    shares, best = share_rows(found), best_rows(main)
    parts = split_cells(main, design)
    means = split_means(parts, ["load", "magnet_height_over_D", "slenderness"])
    sentences = findings(found, shares, split_means(parts, ["load", "slenderness"]))
    pictures = maps(found, means)
    chosen = [row for row in shares if row["nu"] == nu and row["level"] in ("paper", "finite")]
    page = {"design": design, "sentences": sentences, "nu": nu, "best": best, "means": means}
    page |= {"pictures": list(pictures), "bound": BOUNDS[1]}
    page["kinds"] = {name.replace(" ", "_"): (name, kind) for kind, names in QUANTITIES.items() for name in names}
    page["shares"] = [{name: value for name, value in row.items() if name != "nu"} for row in chosen]
    first = ("quantity", "level", "magnet_height_over_D", "within_10_percent")
    shown = [Table(title="Share of the cells within 5 and 10 %", rows=shares, first=first), *sentences]
    tables = {"shares": shares, "best": best, "readings": pages.records(parts), "sweep": list(flat_rows(table))}
    files = {name: partial(save, figures=figures) for name, figures in pictures.items()}
    return pages.study("assumption", "Assumption", shares, page, shown=shown, tables=tables, files=files)


# Regions


def share(error: pd.Series, bound: float) -> float:
    """Return the share of the known errors that are within a bound, %; NaN without any.

    >>> share(pd.Series([-3.0, 7.0, np.nan, 20.0, 1.0]), 5.0)
    50.0
    """
    return 100 * float((error.dropna().abs() <= bound).mean())


def largest_block(inside: NDArray[np.bool_]) -> tuple[slice, slice] | None:
    """Return loads and lengths of the largest block of neighbouring cells that are all inside; None if no cell is.

    Among equally large blocks the one with more lengths is taken.
    """
    best, most = None, (0, 0)
    for first, last in product(range(len(inside)), repeat=2):
        # columns that are inside in all rows from the first to the last one
        whole = inside[first : last + 1].all(axis=0) if first <= last else np.zeros(0, dtype=bool)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(np.int8)))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            if (size := ((last - first + 1) * (end - begin), end - begin)) > most:
                best, most = (slice(first, last + 1), slice(begin, end)), size
    return best


def block_text(own: pd.DataFrame, inside: pd.Series) -> str:
    """Return the largest block inside in words, such as "L/D 2 to 6, d/D 0.08 to 0.2"; "nowhere" for none."""
    flags = own.assign(inside=inside).pivot(index=["depth", "shear"], columns="slenderness", values="inside")
    block = largest_block(flags.eq(True).to_numpy())
    if block is None:
        return "nowhere"

    def span(low: float, high: float) -> str:
        return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"

    loads, lengths = flags.index[block[0]], flags.columns[block[1]]
    (depth, shear), (deepest, farthest) = loads[0], loads[-1]
    slender = f"L/D {span(lengths[0], lengths[-1])}"
    if not farthest:
        return f"{slender}, d/D {span(depth, deepest)}"
    if depth == deepest:
        return f"{slender}, d/D {depth:.3g}, shear/D {span(shear, farthest)}"
    return f"{slender}, from d/D {depth:.3g}, shear/D {shear:.3g} to d/D {deepest:.3g}, shear/D {farthest:.3g}"


def share_rows(found: pd.DataFrame) -> list[Row]:
    """Return a row for each quantity, level and body: shares of the judged cells within the bounds, errors, blocks.

    `leaning_of_these_percent` is the share of the cells within 10 % that are deeper than the critical depth of a free
    tip; a block is the largest one of neighbouring cells within the bound, in words.
    """
    rows: list[Row] = []
    for (nu, height, kind), own in found.groupby(["nu", "height", "kind"], sort=False):
        for quantity, level in product(QUANTITIES[kind], beam.LEVELS):
            error = errors(own, quantity)[level]
            known, near = error.dropna(), {bound: error.abs() <= bound for bound in BOUNDS}
            if not len(known):
                continue
            row = {"quantity": quantity, "level": level, "magnet_height_over_D": height, "nu": nu}
            row |= {"cells": len(known)} | {f"within_{bound:g}_percent": share(error, bound) for bound in BOUNDS}
            row["leaning_of_these_percent"] = 100 * float(own["leans"][near[BOUNDS[1]]].mean())
            row["median_error_percent"] = float(known.abs().median())
            row["largest_error_percent"] = float(known[known.abs().idxmax()])
            rows.append(row | {f"within_{bound:g}_block": block_text(own, near[bound]) for bound in BOUNDS})
    return rows


def best_rows(main: pd.DataFrame) -> list[Row]:
    """Return the best level in each region: body, slenderness and depth; regions without a cell are left out.

    The best level has the least root mean square error in the cells that every level answers; `best_in_percent` is
    the share of these in which it has the least error of all levels.
    """
    names = (f"d/D to {DEPTHS[0]:g}", f"d/D {DEPTHS[0]:g} to {DEPTHS[1]:g}", f"d/D above {DEPTHS[1]:g}")
    bodies = ("no magnet", f"magnet to {BODIES[1]:g} D", "taller magnet")
    rows: list[Row] = []
    for kind, quantity in ((one, name) for one, names in QUANTITIES.items() for name in names):
        known = errors(main[main["kind"] == kind], quantity).dropna()
        own = main.loc[known.index]
        places = [
            pd.cut(own["height"], [-math.inf, *BODIES, math.inf], labels=bodies),
            slender(own["slenderness"]),
            pd.cut(own["depth"], [-math.inf, *DEPTHS, math.inf], labels=names),
        ]
        for region, levels in known.groupby(places, observed=True):
            rms = (levels**2).mean() ** 0.5
            best = str(rms.idxmin())
            row: Row = {"quantity": quantity, "region": ", ".join(region), "cells": len(levels)}
            row |= {"best_level": best, "rms_error_percent": float(rms[best])}
            row["within_10_percent"] = share(levels[best], 10.0)
            row["best_in_percent"] = 100 * float((levels.abs().idxmin(axis=1) == best).mean())
            row["paper_rms_error_percent"] = float(rms["paper"])
            rows.append(row | {"paper_within_10_percent": share(levels["paper"], 10.0)})
    return rows


# Maps


def maps(found: pd.DataFrame, means: Sequence[Row]) -> dict[str, Sequence[Figure]]:
    """Return figures by the name of their file."""
    main = found[found["nu"] == found["nu"].max()]
    pictures: dict[str, Sequence[Figure]] = {}
    for quantity in (name for kind in sorted(main["kind"].unique()) for name in QUANTITIES[kind]):
        figures = [error_map(found, quantity, level) for level in beam.LEVELS]
        pictures[f"{quantity.replace(' ', '_')}.png"] = figures
    pictures["best_level.png"] = best_maps(main)
    return pictures | ({"readings.png": [split_figure(means)]} if means else {})


def best_maps(main: pd.DataFrame) -> list[Figure]:
    """Return maps of the level of least error in each cell, for the press force and the shear force.

    It is "none" where even that error exceeds the bound, and None without any.
    """
    value, figures = "level of least error", []
    colours = dict(zip([*beam.LEVELS, "none"], [*COLOURS[: len(beam.LEVELS)], "#bbbbbb"], strict=True))
    for kind, quantity in (("press", "press force"), ("shear", "shear force")):
        if len(own := main[main["kind"] == kind]):
            least = errors(own, quantity).abs().fillna(math.inf)
            names = least.idxmin(axis=1).mask(least.min(axis=1) > BOUNDS[1], "none")
            known = np.where(np.isfinite(least.min(axis=1)), names.astype(object), None)
            data, axes = map_cells(own.assign(**{value: known}), value)
            title = f"Level of least error, {quantity}"
            figures.append(heat(title, "", data, axes, value, colours=colours, marked=MARKED))
    return figures


LEAST_DRAWN = 0.01
"""Least error of a reading that a figure shows, % of full scale."""


def split_figure(means: Sequence[Row]) -> Figure:
    import altair as alt

    x, y = "height of the magnet, and L/D", "error (% of full scale)"
    data = table_of(
        {x: f"{row['magnet_height_over_D']:.3g} D, {row['slenderness']}", y: row[f"{part}_percent_FS"] or np.nan}
        | {"panel": row["load"], "series": part}
        for row, part in product(means, PARTS)
    )
    data = data[data[y] >= LEAST_DRAWN].reset_index(drop=True)
    points = alt.Chart().mark_point().encode(x=alt.X(x, sort=None), y=alt.Y(y, **LOG), **styles(PARTS))
    said = f"Parts below {LEAST_DRAWN:g} % are left out."
    return Figure("Parts of the errors of readings", said, panels(points, data, columns=1), data)


# Findings


def findings(found: pd.DataFrame, shares: Sequence[Row], readings: Sequence[Row]) -> list[str]:
    nu = found["nu"].max()
    main = [row for row in shares if row["nu"] == nu]
    known, pressed = found[found["nu"] == nu], found["kind"] == "press"

    def within(quantity: str) -> dict[str, float]:
        parts = {}
        for level, name in (("paper", FORMULAS[quantity]), ("finite", "level finite")):
            own = [row for row in main if (row["quantity"], row["level"]) == (quantity, level)]
            if own:
                parts[name] = np.average([r["within_10_percent"] for r in own], weights=[r["cells"] for r in own])
        return parts

    def by_paper(quantity: str, kind: str) -> pd.Series:
        return errors(known[known["kind"] == kind], quantity)["paper"].dropna()

    light = by_paper("press force", "press")
    text = page_templates.filled(
        (pages.TEMPLATES / "assumption_findings.j2").read_text("utf-8"),
        overall=[(quantity, within(quantity)) for quantity in FORMULAS],
        bodies=[
            row | {"body": body(row["magnet_height_over_D"]), "formula": FORMULAS[quantity]}
            for quantity, row in product(FORMULAS, main)
            if (row["quantity"], row["level"]) == (quantity, "paper")
        ],
        shallow=DEPTHS[0],
        light=light[known["depth"][light.index] <= DEPTHS[0]],
        sheared=by_paper("shear force", "shear"),
        readings=readings,
        shortest=SLENDER[0],
        leaning=(pressed & found["leans"] & found["judged"]).sum(),
        judged=(pressed & found["judged"]).sum(),
        given=(~pressed & found["gave_way"]).sum(),
        answered=(~pressed & found["answered"]).sum(),
        failed=(found["possible"] & ~found["answered"]).sum(),
        impossible=(~found["possible"]).sum(),
        cells=len(found),
    )
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


# Parts of the errors of readings

PARTS = ("total", "mechanics", "tilt", "field", "dipole")
COLUMNS = [f"{part}_percent_FS" for part in PARTS]
SLENDER = ("L/D below 1.1", "L/D 1.1 to 2", "L/D above 2")


def slender(ratio: pd.Series) -> pd.Categorical:
    return pd.Categorical.from_codes((ratio >= 1.1).astype(int) + (ratio > 2), SLENDER)


def split_cells(main: pd.DataFrame, design: Design) -> pd.DataFrame:
    """Return the parts in every judged state of the bodies with a magnet; `design` is that of the sweep.

    They are NaN where a pose is unknown.
    """
    found = [pd.DataFrame(columns=["L_over_D", "shear_over_D", *COLUMNS])]
    states = main[main["judged"] & (main["height"] > 0)]
    for (height, slenderness), own in states.groupby(["height", "slenderness"]):
        one = sensor(own, design)
        (fem, tilt), (formula, _) = (_poses(own, model) for model in ("fem", "analytic_paper"))
        known = np.isfinite(np.column_stack([fem, tilt, formula])).all(axis=1)
        names = [element.name for element in of_design(one)]
        percent = np.full((len(PARTS), len(own), len(names)), np.nan)
        if known.any():
            percent[:, known] = _parts(one, fem[known], tilt[known], formula[known])
        place: Row = {"magnet_height_over_D": height, "L_over_D": slenderness}
        place |= {f"{name}_over_D": (own[f"{name}_mm"] / one.D).repeat(len(names)) for name in ("depth", "shear")}
        parts = dict(zip(COLUMNS, percent.reshape(len(PARTS), -1), strict=True))
        found.append(pd.DataFrame({**place, "element": names * len(own), **parts}))
    return pd.concat(found[1:] or found, ignore_index=True)


def _parts(design: Design, fem: Array, tilt: Array, formula: Array) -> Array:
    """Return the parts of each state and element in % of full scale, shape (PARTS, n, elements)."""
    upright = np.zeros_like(tilt)
    true = readings(design, fem, tilt)
    rest = readings(design, np.zeros((1, 3)), np.zeros((1, 2)))
    straight, at_formula = readings(design, fem, upright), readings(design, formula, upright)
    by_paper, by_dipole = (readings(design, formula, upright, field) for field in ("paper", "dipole"))
    change = np.abs(true - rest).max(axis=0)
    # elements that look sideways share their full scale
    sideways = np.abs(hall.elements(design)[1][:, 2]) < 0.5
    scale = np.where(sideways, change[sideways].max(initial=0.0), change)
    parts = (by_paper - true, at_formula - straight, straight - true, by_paper - at_formula, by_dipole - by_paper)
    return np.array([100 * part / scale for part in parts])


def sensor(own: pd.DataFrame, design: Design) -> Design:
    names = ("L", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    sizes: Any = {name: float(own[f"{name}_mm"].iloc[0]) for name in names if f"{name}_mm" in own}
    return varied(design, sizes | {"nu": float(own["nu"].iloc[0])})


def _poses(own: pd.DataFrame, prefix: str) -> tuple[Array, Array]:
    """Return shifts (n, 3), mm, and rotation vectors (n, 2), rad, of a model; NaN where it has none.

    A press moves the magnet along the axis only, and its columns across may be empty.
    """
    shift = own[[f"{prefix}_shift_{axis}_mm" for axis in "xyz"]].to_numpy(dtype=float, copy=True)
    lean = own[[f"{prefix}_tilt_y_rad", f"{prefix}_tilt_rad"]].to_numpy(dtype=float) * [-1.0, 1.0]
    press = (own["kind"] == "press").to_numpy() & np.isfinite(shift[:, 2])
    shift[press, :2], lean[press] = np.nan_to_num(shift[press, :2]), np.nan_to_num(lean[press])
    return shift, lean


def readings(design: Design, shift: Array, tilt: Array, field: hall.Field = "exact") -> Array:
    """Return B.n of the elements for poses, shape (n, elements), T."""
    points, directions = hall.elements(design)
    values = [
        hall.field_at(np.tile(point, (len(shift), 1)), design, shift, tilt, field=field) @ direction
        for point, direction in zip(points, directions, strict=True)
    ]
    return np.column_stack(values)


def split_means(parts: pd.DataFrame, by: list[str]) -> list[Row]:
    """Return root mean squares in % of full scale by some of load, magnet_height_over_D and slenderness."""
    known = parts[parts["total_percent_FS"].notna()]
    known = known.assign(
        load=np.where(known["shear_over_D"] != 0, "shear", "press"),
        slenderness=slender(known["L_over_D"]),
        **known[COLUMNS] ** 2,
    )
    groups = known.groupby(by, observed=True)
    states = groups[["L_over_D", "depth_over_D", "shear_over_D"]].apply(lambda own: len(own.drop_duplicates()))
    rms = groups[COLUMNS].mean() ** 0.5
    rms.insert(0, "states", states)
    return pages.records(rms.reset_index())
