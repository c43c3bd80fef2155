"""The paper's Figures 6, 8, 9, 11 and 12 from both models, and a map over E and the magnet's height."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

from analytic import beam, hall
from geometry.arrays import Array
from geometry.design import paper
from studies.output.figures import SHADES, Figure, bands, by_model, markers, panels, save, styles
from studies.output.maps import heat
from studies.validation.formulas.claim_errors import (
    CLAIMED,
    VALUES,
    Press,
    States,
    compared,
    error_of_largest,
    formula,
    moduli,
    s1_output,
    voltages,
)

FORMULA, FEM = "formulas", "finite elements"
DEPTH, FORCE = "depth d (mm)", "press force F_N (N)"
CLASSES = {
    "within 5 %": "#fde725", "5 to 10 %": "#9fda3a", "10 to 20 %": "#4ac16d", "20 to 50 %": "#1fa187",
    "50 to 100 %": "#277f8e", "above 100 %": "#46327e",
}  # fmt: skip
"""Classes of the errors in the map, and their colours."""
EDGES = (5.0, 10.0, 20.0, 50.0, 100.0)
ENLARGED = 1.4
"""Top of the enlarged part of Figure 12 over the largest force of the paper."""
MODULI = 33
"""Moduli in the map."""


def pictures(states: States, best_E: float, points: int) -> dict[str, Callable[[Path], None]]:
    """Return what draws each figure, by the name of its file.

    `best_E` fits the preset's press forces best, MPa; Figure 6 has `points` along x and y.
    """

    def drawn(draw: Callable[..., list[Figure]], *given: object) -> Callable[[Path], None]:
        return lambda path: save(path, draw(*given))

    return {
        "modulus_and_height.png": drawn(modulus_and_height, states.presses),
        "figure_6.png": drawn(figure_6, states.sheared, points),
        "figure_8.png": drawn(figure_8, states, best_E),
        "figure_9.png": drawn(figure_9, states.preset, best_E),
        "figure_11.png": drawn(figure_11, states.sheared),
        "figure_12.png": drawn(figure_12, states),
    }


def _curves(x: str, y: str, curves: Mapping[str, tuple[Array, Array]], **more: str) -> pd.DataFrame:
    parts = [pd.DataFrame({x: at, y: values}).assign(series=name, **more) for name, (at, values) in curves.items()]
    return pd.concat(parts, ignore_index=True)


def figure_6(sheared: pd.DataFrame, points: int) -> list[Figure]:
    """Return |B| at S1 and S2 over the displacement of the tip, pressed by 1 mm: maps of both models, cuts at y = 0.

    The formulas are equations (3), without its misprint, and (4). S3 shows what S2 does, with x and y swapped.
    """
    import altair as alt

    first = sheared[sheared.tip == sheared.tip.iloc[0]]
    side = np.linspace(-3.0, 3.0, points)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    models = {FORMULA: _by_formula(first.depth_mm.iloc[0], x, y), FEM: _by_fem(first, x, y)}
    field, axes, cuts, figures = "|B| (mT)", ("x (mm)", "y (mm)"), [], []
    middle = slice(points * (points // 2), points * (points // 2 + 1))
    for k, name in enumerate(("S1", "S2")):
        place = {"x (mm)": x.round(3), "y (mm)": y.round(3)}
        cells = [
            pd.DataFrame(place | {field: values[k], "panel": f"{name}, {model}"}) for model, values in models.items()
        ]
        figures.append(heat(f"|B| at {name}", "", pd.concat(cells, ignore_index=True), axes, field, columns=2))
        lines = {model: (side, values[k][middle]) for model, values in models.items()}
        cuts.append(_curves("x (mm)", field, lines, panel=f"{name}, y = 0"))
    data = pd.concat(cuts, ignore_index=True).dropna(ignore_index=True)
    lines = alt.Chart().mark_line(point=markers(data)).encode(
        x="x (mm)", y=field, **styles((FEM, FORMULA), "color", "strokeDash")
    )  # fmt: skip
    return [*figures, Figure("|B| at y = 0", "", panels(lines, data), data)]


def _by_formula(depth: float, x: Array, y: Array) -> list[Array]:
    lever = paper().H / paper().L
    shift = np.column_stack([lever * x, lever * y, np.full_like(x, -lever * depth)])
    return _magnitudes(shift, np.zeros((len(x), 2)), "paper")


def _by_fem(sheared: pd.DataFrame, x: Array, y: Array) -> list[Array]:
    """Return |B| at S1 and S2 by finite elements, each of shape (n,), mT; NaN beyond the shears that were reached."""
    known = sheared[np.isfinite(sheared.fem_force_N)]
    shear, poses = known.shear_mm, known[["fem_shift_x_mm", "fem_shift_z_mm", "fem_tilt_rad"]].to_numpy()
    size, angle = np.hypot(x, y), np.arctan2(y, x)
    # beyond the farthest state there is no pose: the interpolation returns NaN there
    aside, lower, tilt = PchipInterpolator(shear, poses, extrapolate=False)(size).T
    inside = np.isfinite(aside)
    shift = np.column_stack([aside * np.cos(angle), aside * np.sin(angle), lower])
    rotation = np.column_stack([-tilt * np.sin(angle), tilt * np.cos(angle)])
    whole = np.full((2, len(x)), np.nan)
    whole[:, inside] = _magnitudes(shift[inside], rotation[inside], "exact")
    return list(whole)


def _magnitudes(shift: Array, rotation: Array, field: hall.Field) -> list[Array]:
    design, n = paper(), len(shift)
    points = (point[None].repeat(n, 0) for point in hall.elements(design)[0][:2])
    fields = (hall.field_at(each, design, shift, rotation, field=field) for each in points)
    return [1e3 * np.linalg.norm(each, axis=1) for each in fields]


def figure_8(states: States, best_E: float) -> list[Figure]:
    import altair as alt

    preset, by_formula = states.preset, "formula (5), 1 MPa"
    depth, predicted = preset.depth, formula(preset.depth)
    forces = {f"FEM, magnet {preset.height:g} mm, 1 MPa": preset.force}
    for press in (press for press in states.presses if not press.height):
        forces["FEM, no magnet, 1 MPa"] = press.force
    forces[f"FEM, magnet {preset.height:g} mm, {best_E:.2g} MPa"] = best_E * preset.force
    curves = {
        name: (np.append(0.0, depth), np.append(0.0, force))
        for name, force in (forces | {by_formula: predicted}).items()
    }
    errors = {name: (depth, 100 * (predicted / force - 1)) for name, force in forces.items()}
    names, error = tuple(curves), "error of (5) (%)"
    off = _curves(DEPTH, error, errors)
    lines = alt.Chart().mark_line(point=markers(off), clip=True).encode(
        x=DEPTH, y=alt.Y(error).scale(domain=(-80.0, 30.0), clamp=True), **styles(names)
    )  # fmt: skip
    return [
        _lines("Press force", _curves(DEPTH, FORCE, curves), DEPTH, FORCE),
        Figure("Error of the formula", "", alt.layer(*bands(), lines, data=off), off, (SHADES,)),
    ]


def _lines(title: str, data: pd.DataFrame, x: str, y: str) -> Figure:
    """Return curves with markers, each with its colour."""
    import altair as alt

    chart = alt.Chart(data).mark_line(point=markers(data)).encode(x=x, y=y, **styles(data["series"]))
    return Figure(title, "", chart, data)


def figure_9(press: Press, best_E: float) -> list[Figure]:
    import altair as alt

    found = voltages(press)
    # the paper presses to 3 mm
    kept = found.predicted <= found.formula_largest * (1 + 1e-9)
    measured, force = np.append(0.0, found.measured), np.append(0.0, found.force)
    curves = {f"FEM, E = {E:.2g} MPa": (measured, E * force) for E in (1.0, best_E)}
    curves["formulas (3) and (5), E = 1 MPa"] = (found.modelled[kept], found.predicted[kept])
    rest = s1_output(press.design, np.zeros(1))[0]
    # a dot in a column's name has a meaning in Vega-Lite
    x, title = "change of S1 (V)", f"change of S1 from its {rest:.2f} V at rest (V)"
    data = _curves(x, FORCE, curves)
    across, looks = alt.X(x, title=title), styles(data["series"])
    chart = alt.Chart(data).mark_line(point=markers(data)).encode(x=across, y=FORCE, **looks)
    return [Figure("Press force over the change of S1", "", chart, data)]


def figure_11(sheared: pd.DataFrame) -> list[Figure]:
    ends = np.linspace(0.0, VALUES["farthest"], 9)
    curves = {}
    for tip, each in sheared.groupby("tip", sort=False):
        known = compared(each)
        name = f"FEM, {tip}".replace("stuck to a plate at depth", "plate at")
        curves[name] = (np.append(0.0, known.shear_mm), np.append(0.0, known.fem_force_x_N))
    curves["formula (6)"] = (ends, beam.cantilever_stiffness(paper()) * ends)
    x, y = "displacement of the tip along x (mm)", "shear force F_mu (N)"
    return [_lines("Force along the shear", _curves(x, y, curves), x, y)]


def figure_12(states: States) -> list[Figure]:
    """Return F_N over the depth for three moduli, with the largest forces that the paper gives for them."""
    preset = states.preset
    depth, force = np.append(0.0, preset.depth), np.append(0.0, preset.force)
    by_formula = formula(depth)
    models: dict[str, dict[str, tuple[Array, Array]]] = {
        f"FEM, magnet {preset.height:g} mm": {f"E = {E:g} MPa": (depth, E * force) for E, _ in CLAIMED},
        "formula (5)": {f"E = {E:g} MPa": (depth, E * by_formula) for E, _ in CLAIMED},
        "largest force of the paper": {
            f"E = {E:g} MPa": (np.interp([largest / E], by_formula, depth), np.array([largest]))
            for E, largest in CLAIMED
        },
    }
    data = pd.concat(
        [_curves(DEPTH, FORCE, curves, model=name) for name, curves in models.items()], ignore_index=True
    )
    small = data[data[FORCE] <= ENLARGED * CLAIMED[-1][1]]
    return [_of_moduli("Press force for three moduli", data, models), _of_moduli("Enlarged", small, models)]


def _of_moduli(title: str, data: pd.DataFrame, models: Collection[str]) -> Figure:
    """Return curves whose colours are moduli, and whose markers and dashes are models."""
    import altair as alt

    looks = by_model(models) | styles(data["series"], "color")
    chart = alt.Chart(data).mark_line(point=True).encode(x=DEPTH, y=FORCE, **looks)
    return Figure(title, "", chart, data)


def modulus_and_height(presses: Sequence[Press]) -> list[Figure]:
    """Return the error of the force, and of S1's voltage with a fitted gain, over the magnet's height and E."""
    rows = []
    for press in (press for press in presses if press.complete and press.height):
        predicted, readings = formula(press.depth), voltages(press)
        for E in moduli(MODULI).tolist():
            voltage = readings.error(E, any_gain=True, whole=True)
            rows.append((press.height, float(f"{E:.3g}"), error_of_largest(predicted, press.force, E), voltage))
    height, E, *errors = np.array(rows).T
    titles = "Error of F_N, % of the largest", "Error of the voltage of S1 with a fitted gain, % of the largest"
    axes, value = ("height of the magnet (mm)", "E (MPa)"), "largest error"
    names = np.array([*CLASSES, None], dtype=object)
    figures = []
    for title, error in zip(titles, errors, strict=True):
        shades = names[np.where(np.isfinite(error), np.searchsorted(EDGES, error, side="right"), -1)]
        data = pd.DataFrame({axes[0]: height, axes[1]: E, value: shades})
        figures.append(heat(title, "", data, axes, value, colours=CLASSES))
    return figures
