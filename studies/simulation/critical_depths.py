"""The depth at which a press buckles sideways: of one design, and over the slenderness L/D beside formulas.

`at_design` is `magtip stability DESIGN`, and `over_slenderness` its option --slenderness, with the columns of Euler,
Engesser and Haringx. A critical depth or force is None if the press is stable at every depth searched, which is down
to `stable_to_mm`. A search that ended before its last depth leaves the status unknown, with a message.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from analytic import buckling
from fem.scene import Scene, check_glued
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.inputs.option_groups import Elements
from studies.mechanics import store as stores
from studies.mechanics.path_solver import Answer, place
from studies.mechanics.store import Store
from studies.mechanics.stored_answers import asked
from studies.output import page_templates
from studies.output.figures import LOG, Figure, long, numbers, picture, styles
from studies.output.records import FlatRow
from studies.output.result import Interrupted, Result, Table, failure_of

if TYPE_CHECKING:
    import pandas as pd

FORMULAS = {"euler": buckling.euler, "engesser": buckling.engesser, "haringx": buckling.haringx}
"""Buckling loads of a column with a free tip."""
CRITICAL = (
    "critical_depth_mm",
    "critical_force_N",
    "stable_to_mm",
    "critical_depth_error_estimate",
    "critical_force_error_estimate",
)
"""Columns of a search; those of a guided tip have the prefix guided_."""
COLUMNS = (
    *(f"{tip}{name}" for tip in ("", "guided_") for name in CRITICAL),
    *(f"{formula}_{name}" for formula in FORMULAS for name in ("N", "depth_mm")),
)
"""Columns of stability.csv that a refused length lacks: searches, loads of formulas, depths of presses with these."""
FILES = ("stability.csv", "stability.png", "STABILITY.md")
"""Files of --slenderness."""
MODELS = {
    "critical": "finite elements, free tip",
    "guided_critical": "finite elements, guided tip",
    "haringx": "Haringx, free tip",
    "euler": "Euler, free tip",
    "engesser": "Engesser, free tip",
}
"""Names of the critical points and loads by the beginning of their columns."""
NEAR = 0.1
"""Relative difference up to which the report calls a formula close to the finite elements."""


def at_design(design: Design, elements: Elements, depth: float | None, progress: Progress) -> Result:
    """Find the critical depths of a free and of a guided tip; at a depth, mm, also solve a small shear."""
    # a depth out of range is refused here, before the searches, which take seconds
    if depth is not None:
        check_glued(design, depth, elements.magnet)
    with stores.opened(elements.store) as states:
        return _at_design(design, elements, depth, states, progress)


def _at_design(design: Design, elements: Elements, depth: float | None, store: Store, progress: Progress) -> Result:
    haringx = buckling.haringx(design)
    verdict, free, guided = _searches(design, elements, store, progress)
    texts: FlatRow = {}
    record: FlatRow = {
        **verdict,
        **free,
        "euler_N": buckling.euler(design),
        "haringx_N": haringx,
        "haringx_depth_mm": buckling.depth(design, haringx),
        **guided,
        "guided_euler_N": buckling.euler(design, buckling.GUIDED),
    }
    if depth is not None:
        progress(0.8, f"shear at depth {depth:g} mm")
        scene = Scene(design, (Load(depth=depth),), elements.level, elements.magnet)
        shear = asked(place(scene, "small shear"), store)
        record |= _small_shear(depth, shear)
        status, sentence = shear.status, shear.message
        if shear.values:
            status, sentence = _stability_at(record, depth, status)
        record |= {"status": status, "message": _joined(record["message"], sentence)}
    for tip in ("", "guided_"):
        if record[f"{tip}critical_depth_mm"] is None:
            texts[f"{tip}critical_depth_mm"] = f"none up to {record[f'{tip}stable_to_mm']:.5g}"
    shown = Table(title="Stability", rows=[record | texts])
    return Result(title="Stability", records=[record], shown=[shown], failures=failure_of([record]))


def _joined(*sentences: str) -> str:
    return "; ".join(sentence for sentence in sentences if sentence)


def _searches(
    design: Design, elements: Elements, store: Store, progress: Progress | None = None
) -> tuple[FlatRow, FlatRow, FlatRow]:
    """Return status and message of both searches, and the columns of a free and of a guided tip."""
    D, unit = design.D, design.E_now * design.D**2
    scene = Scene(design, (Load(),), elements.level, elements.magnet)
    found, columns = [], []
    for share, guided in ((0.0, False), (0.4, True)):
        if progress is not None:
            progress(share, f"{'guided' if guided else 'free'} tip")
        where = place(scene, "critical depth", options={"guided": True} if guided else None)
        one = asked(where, store, ["force_error_estimate"])
        if not one.values:
            raise SolveFailed(one.message)
        scales = {"critical_depth_over_D": D, "critical_force_over_ED2": unit, "stable_to_over_D": D}
        sizes = [None if (size := one.values[name]) is None else scale * size for name, scale in scales.items()]
        error = None if math.isnan(one.error_estimate) else one.error_estimate
        values = (*sizes, error, one.values["force_error_estimate"])
        columns.append({f"{'guided_' * guided}{name}": value for name, value in zip(CRITICAL, values, strict=True)})
        found.append(one)
    # both searches may end for the same reason, which is then named once
    message = _joined(*dict.fromkeys(one.message for one in found))
    return {"status": "unknown" if message else "ok", "message": message}, columns[0], columns[1]


def _small_shear(depth: float, shear: Answer) -> FlatRow:
    """Return the columns of a small shear per mm of it; all but the depth is None if the press does not get there.

    `force_N` is that of the press alone.
    """
    values, D, E = shear.values, shear.D, shear.E
    scales = {
        "force_over_ED2": E * D**2,
        "contact_radius_over_D": D,
        "stiffness_over_ED": E * D,
        "tilt_times_D": 1 / D,
    }
    found = {name: scales.get(name, 1.0) * value for name, value in values.items() if value is not None}
    force = found.get("force_over_ED2")
    estimates = [f"{name}_error_estimate" for name in ("force", "contact_radius", "stiffness", "shift", "tilt")]
    return {
        "depth_mm": depth,
        "force_N": None if force is None else [0.0, 0.0, force],
        "contact_radius_mm": found.get("contact_radius_over_D"),
        "stiffness_N_per_mm": found.get("stiffness_over_ED"),
        "shift_per_mm": found.get("shift"),
        "tilt_rad_per_mm": found.get("tilt_times_D"),
        **{name: found.get(name) for name in estimates},
    }


def _stability_at(record: FlatRow, depth: float, shear: str) -> tuple[str, str]:
    """Return status and message of a small shear, whose own status is `shear`: the search for the guided critical
    depth and the shear judge it.

    Within the estimated error of a critical depth nothing is known, and of an unknown error at no depth.
    """
    names = ("critical_depth_mm", "guided_critical_depth_mm", "guided_stable_to_mm")
    free, guided, limit = (record[name] for name in names)
    near = _is_near(depth, guided, record["guided_critical_depth_error_estimate"])
    here, glued = f"at depth {depth:g} mm", "stiffness, shift and tilt hold for a tip that sticks to the plate"
    if shear == "unstable" or (guided is not None and depth > guided and not near):
        return "unstable", f"{here} the straight press is unstable even with a guided tip"
    if near or shear == "unknown":
        return "unknown", f"{here} it is not known whether the press is stable even with a guided tip"
    if depth > limit:
        return "unknown", f"{here} stability is unknown: the search ended at {limit:.4g} mm"
    # glued to a plate that does not move, the press is stable, also where a moved plate meets no resistance
    if _is_near(depth, free, record["critical_depth_error_estimate"]):
        doubt = f"{here} it is not known whether the press is stable if the tip slides freely: {glued}"
        return record["status"], doubt
    if free is not None and depth > free:
        return record["status"], f"{here} the straight press is unstable if the tip slides freely: {glued}"
    if not record["stiffness_N_per_mm"] > 0:
        return "unknown", f"{here} the tip pushes along the shear, though no critical depth was found down to there"
    return record["status"], ""


def _is_near(depth: float, critical: float | None, error: float | None) -> bool:
    """Return whether a depth cannot be told from a critical one; an unknown error has no bound."""
    return critical is not None and (error is None or abs(depth / critical - 1) <= error)


def over_slenderness(design: Design, elements: Elements, slenderness: Sequence[float], progress: Progress) -> Result:
    """Find the critical depths of a free and of a guided tip at each L/D, one row each, beside the formulas.

    A row of a length that the design refuses has the status refused and no numbers. Ctrl-C leaves the rows that are
    complete.
    """
    if elements.magnet == "ignored":
        design = replace(design, magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)
    rows: list[FlatRow] = []
    first = ("L_over_D", "status", "critical_depth_mm", "critical_force_N")
    table = Table(title="Stability over slenderness", rows=rows, first=first, places=("L_over_D",))
    try:
        with stores.opened(elements.store) as states:
            for i, ratio in enumerate(slenderness):
                progress(i / len(slenderness), f"L/D = {ratio:g}")
                rows.append(_row(design, elements, ratio, states))
    except KeyboardInterrupt:
        text = f"{len(rows)} of {len(slenderness)} lengths are complete, and no file is written"
        raise Interrupted(text, Result(title=table.title, records=rows, shown=[table])) from None
    return Result(
        title=table.title,
        records=rows,
        shown=[table],
        tables={"stability": rows},
        files={"stability.png": partial(picture, rows=rows, draw=figures)},
        pages={"STABILITY.md": page(rows)},
        failures=failure_of(rows),
    )


def _row(design: Design, elements: Elements, ratio: float, store: Store) -> FlatRow:
    length = ratio * design.D
    row: FlatRow = {"L_over_D": ratio, "L_mm": length, "magnet": elements.magnet, "status": "refused"}
    row |= {**dict.fromkeys(COLUMNS), "message": ""}
    try:
        beam = replace(design, L=length, l0=length)
        verdict, free, guided = _searches(beam, elements, store)
        loads = {name: load(beam) for name, load in FORMULAS.items()}
        depths = {f"{name}_depth_mm": buckling.depth(beam, load) for name, load in loads.items()}
    except BadInput as error:
        return row | {"message": str(error)}
    return row | verdict | free | guided | {f"{name}_N": load for name, load in loads.items()} | depths


def page(rows: Sequence[FlatRow]) -> str:
    """Return STABILITY.md without its origin: the rows, and where a formula is within `NEAR` of a free tip."""

    def close(column: str, critical: str) -> list[FlatRow]:
        return [row for row in rows if row[critical] and abs(row[column] / row[critical] - 1) <= NEAR]

    near = [
        (formula, quantity, close(f"{formula}_{column}", f"critical_{critical}"))
        for formula in FORMULAS
        for quantity, column, critical in (("load", "N", "force_N"), ("depth", "depth_mm", "depth_mm"))
    ]
    stable = [row for row in rows if row["status"] == "ok" and row["critical_depth_mm"] is None]
    template = Path(__file__).with_name("templates") / "STABILITY.md.j2"
    return page_templates.rendered(template, rows=rows, near=near, limit=NEAR, stable=stable)


def figures(table: pd.DataFrame) -> list[Figure]:
    """Return critical depths and forces over slenderness, beside the formulas of buckling; rows of stability.csv."""
    import altair as alt

    depths = {f"{name}_depth_mm": label for name, label in MODELS.items()}
    depths["stable_depth"] = "finite elements, free tip: stable at least to here"
    forces = {f"{name}_force_N" if "critical" in name else f"{name}_N": label for name, label in MODELS.items()}
    slenderness, depth = numbers(table, "L_over_D"), numbers(table, "critical_depth_mm")
    table = table.assign(stable_depth=numbers(table, "stable_to_mm").where(depth.isna()))
    caption = "No beam of the table gives way sideways."
    if depth.notna().any():
        least = depth.idxmin()
        caption = (
            f"The tip gives way sideways at the least depth, {depth[least]:.3g} mm, at L/D = {slenderness[least]:g}. "
            "Beams without a point have no critical depth in the range of the study."
        )
    looks = styles((*MODELS.values(), depths["stable_depth"]), "color", "shape", "strokeDash")
    figures = []
    for title, label, columns in (
        ("Critical depth over slenderness", "critical depth (mm)", depths),
        ("Critical force over slenderness", "critical force (N)", forces),
    ):
        data = long(table, ("L_over_D", "L/D"), label, columns)
        chart = alt.Chart(data).mark_line(point=True).encode(x=alt.X("L/D", **LOG), y=alt.Y(label, **LOG), **looks)
        figures.append(Figure(title, caption, chart, data))
    return figures
