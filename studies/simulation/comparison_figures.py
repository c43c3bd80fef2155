"""Figures of models over a load: comparisons (`magtip compare`, `demo`) and states (`solve --json`)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from geometry.loads import ANSWERED
from studies.output.figures import FREE, SHADES, Figure, bands, long, numbers, panels, styles
from studies.quantities import UNITS, Part
from studies.simulation.comparison_rows import PARTS

if TYPE_CHECKING:
    import pandas as pd

NAMES = {
    "fem": "finite elements, rigid magnet",
    "analytic": "the paper's formulas",
    "fem_homogeneous": "finite elements, all silicone",
    "untilted": "finite elements, tilt left out",
}
"""Names of the models by the prefixes of their columns, in the order of their colours and markers."""
JUDGED = {"": "against rigid magnet", "homogeneous_": "against all silicone"}
"""Names of the finite elements by the prefixes of the formulas' errors."""
READING = re.compile(r"fem_(.+)_V$")
FIELD = re.compile(r"fem_(.+)_mT$")


def press(table: pd.DataFrame) -> list[Figure]:
    """Return force, its error, sinking and readings over the depth of a press."""
    x = ("depth_mm", "depth (mm)")
    return [
        _models(table, "Press force", x, "force", _force_sentence(table)),
        _errors(table, "Error of the paper's press force", x, "force_error_percent"),
        _models(table, "Sinking of the magnet", x, "shift_z"),
        _readings(table, "Outputs of the Hall elements in the press", x),
    ]


def shear(table: pd.DataFrame) -> list[Figure]:
    """Return force along the shear, its error, sideways motion, tilt and readings over the shear."""
    x = ("shear_mm", "shear of the plate (mm)")
    depth = next((f" at a depth of {value:.3g} mm" for value in numbers(table, "depth_mm")), "")
    return [
        _models(table, f"Force along the shear{depth}", x, "force_x"),
        _errors(table, "Error of the paper's shear force", x, "force_x_error_percent"),
        _models(table, "Sideways motion of the magnet", x, "shift_x"),
        _models(table, "Tilt of the magnet", x, "tilt"),
        _readings(table, "Outputs of the Hall elements in the shear", x),
    ]


def states(table: pd.DataFrame) -> list[Figure]:
    """Return force and magnet's motion over the load of states that `solve --json` printed."""
    import altair as alt

    shears = numbers(table, "shear_mm").fillna(0.0)
    sheared = bool(np.ptp(shears) > 0)
    x = ("shear_mm", "shear (mm)") if sheared else ("depth_mm", "depth (mm)")
    solved = table[table["status"].isin(ANSWERED)]
    figures = []
    for title, columns, unit in (
        ("Force of the solved states", ("force_x_N", "force_z_N"), "force (N)"),
        ("Motion of the magnet in the solved states", ("shift_x_mm", "shift_z_mm"), "motion of the magnet (mm)"),
    ):
        names = {name: f"along {'x' if '_x_' in name else 'z'}" for name in columns}
        depths = {"series": numbers(solved, "depth_mm").map("depth {:g} mm".format)} if sheared else {}
        data = long(solved, x, unit, names, "panel", **depths)
        looks = styles(data["series"]) if sheared else {}
        caption = f"{len(solved)} of {len(table)} states were reached."
        lines = alt.Chart().mark_line(point=True).encode(x=alt.X(x[1], **FREE), y=alt.Y(unit, **FREE), **looks)
        figures.append(Figure(title, caption, panels(lines, data), data))
    return figures


def _models(table: pd.DataFrame, title: str, x: tuple[str, str], part: str, caption: str = "") -> Figure:
    import altair as alt

    label = PARTS[part].title
    data = long(table, x, label, {f"{prefix}_{PARTS[part].column}": name for prefix, name in NAMES.items()})
    chart = alt.Chart(data).mark_line(point=True).encode(x=x[1], y=label, **styles(NAMES.values()))
    return Figure(title, caption or _last_sentence(data, x[1], PARTS[part]), chart, data)


def _last_sentence(data: pd.DataFrame, x: str, part: Part) -> str:
    last = data.dropna().groupby("series", sort=False).last()
    if not len(last):
        return "There is no point: every state failed."
    end = last[x].max()
    values = "; ".join(
        f"{name} {row[part.title]:.3g} {UNITS[part.unit]}" + (f" (only to {row[x]:.3g} mm)" if row[x] < end else "")
        for name, row in last.iterrows()
    )
    return f"At the end of the path, {end:.3g} mm: {values}."


def _force_sentence(table: pd.DataFrame) -> str:
    force, formula = numbers(table, "fem_force_N"), numbers(table, "analytic_force_N")
    rows = np.flatnonzero(np.isfinite(force) & np.isfinite(formula))
    if not len(rows):
        return "No state has both a finite-element and a formula result."
    row = rows[-1]
    depth = numbers(table, "depth_mm")[row]
    off = 100 * (formula[row] / force[row] - 1)
    return (
        f"At {depth:.3g} mm the rigid magnet makes finite elements give {force[row]:.3g} N; "
        f"a beam that is all silicone gives {numbers(table, 'fem_homogeneous_force_N')[row]:.3g} N, and the paper's "
        f"formula {formula[row]:.3g} N, {off:+z.0f} %."
    )


def _errors(table: pd.DataFrame, title: str, x: tuple[str, str], error: str) -> Figure:
    import altair as alt

    sentences = []
    for prefix, name in JUDGED.items():
        judged = numbers(table, prefix + error).dropna()
        if len(judged):
            worst = judged[judged.abs().idxmax()]
            within = int((judged.abs() <= 5).sum())
            sentences.append(f"{name}: {within} of {len(judged)} states within 5 %, largest error {worst:+z.0f} %")
    caption = f"Error of the paper's formula against finite elements, {'; '.join(sentences)}." if sentences else ""
    data = long(table, x, "error (%)", {prefix + error: name for prefix, name in JUDGED.items()})
    # the styles of the finite elements in the other figures
    looks = styles((JUDGED[""], "", JUDGED["homogeneous_"]))
    lines = alt.Chart().mark_line(point=True).encode(x=x[1], y="error (%)", **looks)
    return Figure(title, caption, alt.layer(*bands(), lines, data=data), data, (SHADES,))


def _readings(table: pd.DataFrame, title: str, x: tuple[str, str]) -> Figure:
    import altair as alt
    import pandas as pd

    volts = any(READING.match(name) for name in table.columns)
    unit, label = ("V", "output (V)") if volts else ("mT", "field at the element (mT)")
    elements = [found[1] for name in table.columns if (found := (READING if volts else FIELD).match(name))]
    parts = [
        long(table, x, label, {f"{prefix}_{element}_{unit}": name for prefix, name in NAMES.items()}, panel=element)
        for element in elements
    ]
    caption = "The field model is the same for all: differences come from where the models place the magnet."
    data = pd.concat(parts, ignore_index=True) if parts else long(table, x, label, {})
    lines = alt.Chart().mark_line(point=True).encode(x=x[1], y=alt.Y(label, **FREE), **styles(NAMES.values()))
    return Figure(title, caption, panels(lines, data), data)
