"""Figures of results of models over a load: comparisons (`magtip compare`, `demo`) and states (`solve --json`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.report.folder_contents import Table
from studies.report.report_figures import Axis, Figure, Panel, Series, error_guides, series

FEM, PAPER, HOMOGENEOUS, UNTILTED = 0, 1, 2, 3
"""Styles of the models, the same in all figures of a comparison."""
NAMES = {
    "fem": ("finite elements, rigid magnet", FEM),
    "fem_homogeneous": ("finite elements, all silicone", HOMOGENEOUS),
    "analytic": ("the paper's formulas", PAPER),
    "untilted": ("finite elements, tilt left out", UNTILTED),
}
"""Name and style of each prefix of a column."""


def press(table: Table) -> list[Figure]:
    """Return force, its error, sinking and readings over the depth of a press."""
    x = Axis("depth (mm)")
    return [
        _models(
            table, "Press force", "depth_mm", x, "force_N", "press force (N)", _force_sentence(table), "press.png"
        ),
        _errors(table, "Error of the paper's press force", "depth_mm", x, "force_error_percent"),
        _models(
            table, "Sinking of the magnet", "depth_mm", x, "shift_z_mm", "vertical motion of the magnet (mm)", ""
        ),
        _readings(table, "Outputs of the Hall elements in the press", "depth_mm", x, ("S1_V", "S2_V")),
    ]


def shear(table: Table) -> list[Figure]:
    """Return force along the shear, its error, sideways motion, tilt and readings over the shear."""
    x = Axis("shear of the plate (mm)")
    depth = next((f" at a depth of {value:.3g} mm" for value in table.floats("depth_mm")), "")
    return [
        _models(
            table,
            f"Force along the shear{depth}",
            "shear_mm",
            x,
            "force_x_N",
            "force along the shear (N)",
            "",
            "shear.png",
        ),
        _errors(table, "Error of the paper's shear force", "shear_mm", x, "force_x_error_percent"),
        _models(table, "Sideways motion of the magnet", "shear_mm", x, "shift_x_mm", "sideways motion (mm)", ""),
        _models(table, "Tilt of the magnet", "shear_mm", x, "tilt_rad", "tilt (rad)", ""),
        _readings(table, "Outputs of the Hall elements in the shear", "shear_mm", x, ("S1_V", "S2_V", "S3_V")),
    ]


def states(table: Table) -> list[Figure]:
    """Return force and magnet's motion over the load of states that `solve --json` printed."""
    sheared = np.ptp(np.nan_to_num(table.floats("shear_mm"))) > 0
    x, column = (Axis("shear (mm)"), "shear_mm") if sheared else (Axis("depth (mm)"), "depth_mm")
    ok = table.ok
    figures = []
    for title, names, unit in (
        ("Force of the solved states", ("force_x_N", "force_z_N"), "force (N)"),
        ("Motion of the magnet in the solved states", ("shift_x_mm", "shift_z_mm"), "motion of the magnet (mm)"),
    ):
        depths = np.unique(table.floats("depth_mm")[ok]) if sheared else np.array([np.nan])
        panels = []
        for name in names:
            parts = []
            for k, depth in enumerate(depths[:7]):
                rows = ok & ((table.floats("depth_mm") == depth) | np.isnan(depth))
                label = f"depth {depth:g} mm" if np.isfinite(depth) else name.split("_")[0]
                parts.append(series(label, table.floats(column)[rows], table.floats(name)[rows], k))
            panels.append(Panel(f"{'along x' if '_x_' in name else 'along z'}", tuple(parts)))
        caption = f"{int(ok.sum())} of {len(table)} states were reached."
        figures.append(Figure(title, caption, x, Axis(unit), tuple(panels), source=table.name))
    return figures


def _models(
    table: Table, title: str, column: str, x: Axis, quantity: str, unit: str, caption: str, picture: str = ""
) -> Figure:
    """Return a quantity of all models of a comparison; the caption is made from the last row by default."""
    parts = [
        series(name, table.floats(column), table.floats(f"{prefix}_{quantity}"), style)
        for prefix, (name, style) in NAMES.items()
        if f"{prefix}_{quantity}" in table.columns
    ]
    text = caption or _last_sentence(parts, x, unit)
    return Figure(
        title,
        text,
        x,
        Axis(unit),
        (Panel("", tuple(parts)),),
        source=table.name,
        replaces=(picture,) if picture else (),
    )


def _last_sentence(parts: Sequence[Series], x: Axis, unit: str) -> str:
    """Return what the series say at their last point."""
    last = [(one.name, one.x[-1], one.y[-1]) for one in parts if one.y]
    if not last:
        return "There is no point: every state failed."
    short = unit.rpartition("(")[2].rstrip(")")
    values = "; ".join(f"{name} {value:.3g} {short}" for name, _, value in last)
    return f"At the end of the path, {last[0][1]:.3g} mm: {values}."


def _force_sentence(table: Table) -> str:
    """Return the press forces of all models in the deepest state that was reached."""
    force, formula = table.floats("fem_force_N"), table.floats("analytic_force_N")
    rows = np.flatnonzero(np.isfinite(force) & np.isfinite(formula))
    if not len(rows):
        return "No state has both a finite-element and a formula result."
    row = rows[-1]
    off = 100 * (formula[row] / force[row] - 1)
    return (
        f"At {table.floats('depth_mm')[row]:.3g} mm the rigid magnet makes finite elements give {force[row]:.3g} N; "
        f"a beam that is all silicone gives {table.floats('fem_homogeneous_force_N')[row]:.3g} N, and the paper's "
        f"formula {formula[row]:.3g} N, {off:+z.0f} %."
    )


def _errors(table: Table, title: str, column: str, x: Axis, error: str) -> Figure:
    """Return the errors of the paper's formula against both kinds of finite elements."""
    parts, sentences = [], []
    for prefix, name, style in (("", "with magnet", FEM), ("homogeneous_", "all silicone", HOMOGENEOUS)):
        values = table.floats(prefix + error)
        one = series(f"against finite elements {name}", table.floats(column), values, style)
        parts.append(one)
        judged = values[np.isfinite(values)]
        if len(judged):
            worst = judged[np.abs(judged).argmax()]
            within = int((np.abs(judged) <= 5).sum())
            sentences.append(f"{name}: {within} of {len(judged)} states within 5 %, largest error {worst:+z.0f} %")
    caption = f"Error of the paper's formula against finite elements, {'; '.join(sentences)}." if sentences else ""
    return Figure(
        title,
        caption,
        x,
        Axis("error (%)"),
        (Panel("", tuple(parts)),),
        guides=error_guides(5, 10),
        source=table.name,
    )


def _readings(table: Table, title: str, column: str, x: Axis, names: Sequence[str]) -> Figure:
    """Return the outputs of Hall elements, a panel for each."""
    panels = []
    for reading in names:
        parts = [
            series(name, table.floats(column), table.floats(f"{prefix}_{reading}"), style)
            for prefix, (name, style) in NAMES.items()
            if f"{prefix}_{reading}" in table.columns
        ]
        panels.append(Panel(reading.removesuffix("_V"), tuple(parts)))
    caption = "The field model is the same for all: differences come from where the models place the magnet."
    return Figure(title, caption, x, Axis("output (V)"), tuple(panels), source=table.name)
