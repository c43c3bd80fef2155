"""Figures of the studies of the paper: assumption of a beam (verb assumption) and its claims (verb claims)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analytic import beam
from geometry.design import BadInput
from studies.output.figures import LOG, Figure, long, numbers, panels, rule, styles, texts, thinned
from studies.output.maps import ERROR_EDGES, heat

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = {
    "press": {"press force": "force_N", "sinking": "shift_z_mm"},
    "shear": {"shear force": "force_x_N", "sideways shift": "shift_x_mm", "tilt": "tilt_rad"},
}
"""Quantities of each kind of load that are judged, and their columns behind the model's prefix."""
COLUMNS = {name: column for own in QUANTITIES.values() for name, column in own.items()}
SHOWN_LEVELS = ("paper", "finite")
"""Levels of the formulas whose errors are mapped: the paper's and the best one; the table has all."""
MARKED = {
    "failed": "Crosses: the solve stopped, or the beam gave way.",
    "doubted": "Dots: a tip that is free to slide has buckled sideways before; these presses hold it on the axis.",
}
"""What the marks of cells mean."""


def cells(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a sweep over L, magnet, nu, depth and shear as cells, those of the largest nu first.

    Columns that are added: the `kind` of load, press or shear; lengths over D, `height` of the magnet, `slenderness`,
    `depth` and `shear`; whether the design is `possible`, and its state `answered` by finite elements; whether the
    beam `gave_way`, so that its force along the shear is not positive; whether a press `leans`: is deeper than the
    depth at which a tip that slides freely buckles sideways. What is answered and did not give way is `judged`.

    Raises
    ------
    BadInput
        Two rows belong to one cell; `studies.validation.formulas.assumption.plan_of` refuses such studies.
    """
    lengths = {"height": "magnet_height_mm", "slenderness": "L_mm", "depth": "depth_mm", "shear": "shear_mm"}
    found = table.assign(
        **{name: (numbers(table, column) / numbers(table, "D_mm")).round(9) for name, column in lengths.items()},
        nu=numbers(table, "nu"),
    )
    sheared = found["shear"] != 0
    force = numbers(table, "fem_force_x_N").where(sheared, numbers(table, "fem_force_N"))
    found["kind"] = np.where(sheared, "shear", "press")
    found["possible"], found["answered"] = texts(table, "status") != "bad_input", np.isfinite(force)
    found["gave_way"], found["judged"] = force <= 0, force > 0
    # a NaN, which stands for no critical depth, is exceeded by nothing
    found["leans"] = ~sheared & (numbers(table, "depth_mm") > numbers(table, "critical_depth_mm"))
    place = ["nu", "height", "kind", "depth", "shear", "slenderness"]
    if (twice := found.duplicated(place)).any():
        row = found[twice].iloc[0]
        raise BadInput(f"two rows of the table are one cell of {body(row.height)}, nu {row.nu:g}")
    return found.sort_values(place, ascending=[name != "nu" for name in place], ignore_index=True)


def body(height: float) -> str:
    """Return the name of a beam with a magnet of this height over D in sentences."""
    return f"magnet {height:.3g} D high" if height else "no magnet"


def errors(own: pd.DataFrame, quantity: str, levels: Sequence[str] = beam.LEVELS) -> pd.DataFrame:
    """Return the errors of levels of the formulas in cells, %; NaN where one is not judged, or has no answer."""
    fem = numbers(own, f"fem_{COLUMNS[quantity]}").where(lambda value: own["judged"] & (value != 0))
    return own[[]].assign(
        **{level: 100 * (numbers(own, f"analytic_{level}_{COLUMNS[quantity]}") / fem - 1) for level in levels}
    )


def assumption(table: pd.DataFrame, levels: tuple[str, ...] = SHOWN_LEVELS) -> list[Figure]:
    """Return maps of the errors of the formulas over L/D and load, a panel for each height of the magnet."""
    found = cells(table)
    known = [name for name in levels if name in beam.LEVELS and f"analytic_{name}_force_N" in table]
    kinds = [kind for kind in QUANTITIES if (found["kind"] == kind).any()]
    return [error_map(found, quantity, level) for kind in kinds for quantity in QUANTITIES[kind] for level in known]


def error_map(found: pd.DataFrame, quantity: str, level: str) -> Figure:
    """Return the map of the errors of one quantity by one level for the largest nu, a panel for each body."""
    error, kind = "error (%)", "press" if quantity in QUANTITIES["press"] else "shear"
    nu, *others = found["nu"].unique()
    own = found[(found["nu"] == nu) & (found["kind"] == kind)]
    data, axes = map_cells(own.assign(**{error: errors(own, quantity)[level]}), error)
    judged = data[error].dropna().abs()
    shares = [100 * float((judged <= bound).mean()) if len(judged) else 0.0 for bound in (5, 10)]
    caption = (
        f"Of {len(judged)} cells {shares[0]:.0f} % are within 5 % and {shares[1]:.0f} % within 10 % of finite "
        "elements. Empty cells: the magnet does not fit, or the level has no answer."
    )
    if others:
        caption += f" Poisson's ratio {nu:g}; the table also has {', '.join(map('{:g}'.format, sorted(others)))}."
    title = f"Error of the {quantity}, level {level}"
    return heat(title, caption, data, axes, error, edges=ERROR_EDGES, marked=MARKED)


def map_cells(own: pd.DataFrame, value: str) -> tuple[pd.DataFrame, tuple[str, str]]:
    """Return cells of one kind of load as the table of a map of a column, a panel for each body, and its axes."""
    press = own["kind"].iloc[0] == "press"
    load, flags = ("depth/D", ["failed", "doubted"]) if press else ("depth/D / shear/D", ["failed"])
    pairs = zip(own["depth"], own["shear"], strict=True)
    data = own.assign(
        panel=own["height"].map(body),
        failed=(own["possible"] & ~own["answered"]) | own["gave_way"],
        doubted=own["leans"] & own["judged"],
        **{"L/D": own["slenderness"].round(3)},
        **{load: [float(f"{d:.3g}") if press else f"{d:.3g} / {s:.3g}" for d, s in pairs]},
    )
    return data[["panel", "L/D", load, value, *flags]], ("L/D", load)


def readings(table: pd.DataFrame) -> list[Figure]:
    """Return how much of a reading's error is mechanics, tilt and field, over L/D."""
    import altair as alt

    names = {"mechanics_percent_FS": "mechanics", "tilt_percent_FS": "tilt", "dipole_percent_FS": "dipole as field"}
    y = "error (% of full scale)"
    data = long(table, ("L_over_D", "L/D"), y, names, panel=texts(table, "element"))
    data[y] = data[y].abs().where(data[y] != 0)
    caption = (
        "Each point is one state; the magnet's place (mechanics) dominates except where the field is a dipole's."
    )
    data = data.dropna(subset=["L/D", y], ignore_index=True)
    drawn, note = thinned(data, y)
    points = alt.Chart().transform_filter("datum.drawn").mark_point().encode(
        x="L/D", y=alt.Y(y, **LOG), **styles(names.values())
    )  # fmt: skip
    return [Figure("Where errors of readings come from", caption, panels(points, drawn), data, note)]


def heights(table: pd.DataFrame) -> list[Figure]:
    """Return the errors of the paper's force and voltage over the height of the magnet."""
    import altair as alt

    columns = {
        "error_percent_of_largest": "force, E = 1 MPa",
        "best_error_percent_of_largest": "force, best E for each height",
        "S1_error_percent": "voltage of S1, E = 1 MPa",
        "best_E_S1_error_percent": "voltage of S1, best E for each height",
    }
    x, y = "height of the magnet (mm)", "largest error (% of full scale)"
    within = numbers(table, "magnet_height_mm")[numbers(table, "error_percent_of_largest") <= 5]
    caption = (
        "At E = 1 MPa the paper's force is within 5 % of the largest force for heights of "
        f"{', '.join(map('{:g}'.format, within))} mm."
        if len(within)
        else "At E = 1 MPa no height of the magnet brings the paper's force within 5 % of the largest force."
    )
    data = long(table, ("magnet_height_mm", x), y, columns)
    lines = alt.Chart().mark_line(point=True).encode(x=x, y=y, **styles(columns.values()))
    chart = alt.layer(*rule("y", 5.0, "5 %"), lines, data=data)
    return [Figure("Errors of force and voltage over the height of the magnet", caption, chart, data)]


def presses(table: pd.DataFrame) -> list[Figure]:
    """Return the press force over depth for heights of the magnet."""
    import altair as alt
    import pandas as pd

    every = np.unique(numbers(table, "magnet_height_mm"))
    few = every[np.unique(np.linspace(0, len(every) - 1, 6).round().astype(int))]
    rows = table[numbers(table, "magnet_height_mm").isin(few)].sort_values("magnet_height_mm", kind="stable")
    names = [f"magnet {one:g} mm high" if one else "no magnet" for one in numbers(rows, "magnet_height_mm")]
    x, y = "depth (mm)", "press force (N)"
    data = pd.DataFrame({x: numbers(rows, "depth_mm"), y: numbers(rows, "fem_force_N"), "series": names})
    last = data.groupby("series", sort=False)[y].last()
    caption = (
        f"A taller magnet stiffens the press: {last.iloc[0]:.3g} N with {last.index[0]}, {last.iloc[-1]:.3g} N with "
        f"the {last.index[-1]}, each at its deepest state."
    )
    data = data.dropna(ignore_index=True)
    chart = alt.Chart(data).mark_line(point=True).encode(x=x, y=y, **styles(names))
    return [Figure("Press force for heights of the magnet, finite elements", caption, chart, data)]


def shears(table: pd.DataFrame) -> list[Figure]:
    """Return the force along the shear for conditions of the tip."""
    import altair as alt
    import pandas as pd

    x, y = "shear (mm)", "force along the shear (N)"
    data = pd.DataFrame(
        {x: numbers(table, "shear_mm"), y: numbers(table, "fem_force_x_N"), "series": texts(table, "tip")}
    )
    title = "Force along the shear for conditions of the tip, finite elements"
    data = data.dropna(ignore_index=True)
    chart = alt.Chart(data).mark_line(point=True).encode(x=x, y=y, **styles(data["series"]))
    return [Figure(title, "How the tip is held decides the shear force.", chart, data)]
