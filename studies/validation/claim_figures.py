"""The paper's Figures 6, 8, 9, 11 and 12 from both models, and a map over E and the magnet's height."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analytic import beam, hall
from geometry.arrays import Array
from geometry.design import paper
from studies.output.table_plots import ANALYTIC, COLOURS, FEM, HOMOGENEOUS, OTHER, bands, canvas, label
from studies.validation.claim_errors import (
    BOUND,
    CLAIMED,
    FARTHEST,
    MODULI,
    PUBLISHED,
    compared,
    error_of_largest,
    formula,
    height_row,
    moduli,
    modulus_interval,
    voltages,
)
from studies.validation.claim_states import Press, Sheared, States, s1_output, with_magnet

POINTS = 41
"""Points along x and y in Figure 6."""


def pictures(states: States, best_E: float) -> dict[str, Callable[[Path], None]]:
    """Return what draws each figure, by the name of its file.

    Parameters
    ----------
    best_E : modulus that fits the press forces of the preset's magnet best, MPa.
    """
    return {
        "modulus_and_height.png": lambda path: modulus_and_height(path, states.presses),
        "figure_6.png": lambda path: figure_6(path, states.sheared[0]),
        "figure_8.png": lambda path: figure_8(path, states, best_E),
        "figure_9.png": lambda path: figure_9(path, states.preset, best_E),
        "figure_11.png": lambda path: figure_11(path, states.sheared),
        "figure_12.png": lambda path: figure_12(path, states),
    }


def figure_6(path: Path, sheared: Sheared) -> None:
    """Draw |B| at S1 and S2 over the displacement of the tip, pressed by 1 mm: maps of both models, cuts at y = 0.

    The formulas are equations (3), without its misprint, and (4). S3 shows what S2 does, with x and y swapped.
    """
    from matplotlib.ticker import MaxNLocator

    side = np.linspace(-3.0, 3.0, POINTS)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    by_formula, by_fem = _magnitudes_by_formula(sheared, x, y), _magnitudes_by_fem(sheared, x, y)
    with canvas(path, 3, 2, shared=False) as (figure, axes):
        for k, name in enumerate(("S1", "S2")):
            both = np.concatenate([by_formula[k], by_fem[k]])
            levels = MaxNLocator(10).tick_values(np.nanmin(both), np.nanmax(both))
            for row, values in enumerate((by_formula, by_fem)):
                axis = axes[2 * row + k]
                shape = (POINTS, POINTS)
                drawn = axis.contourf(side, side, values[k].reshape(shape), levels, cmap="cividis")
                axis.set_aspect("equal")
                axis.set_title(f"{name}, {('formulas', 'finite elements')[row]}", fontsize=11)
                axis.set_xlabel("x (mm)")
                axis.set_ylabel("y (mm)")
                figure.colorbar(drawn, ax=axis, format="%.3g").set_label("|B| (mT)")
            middle = slice(POINTS * (POINTS // 2), POINTS * (POINTS // 2 + 1))
            cut = axes[4 + k]
            cut.plot(side, by_formula[k][middle], color=ANALYTIC, linestyle="--", label="formulas")
            cut.plot(side, by_fem[k][middle], color=FEM, label="finite elements")
            cut.set_title(f"{name}, y = 0", fontsize=11)
            cut.set_xlabel("x (mm)")
            cut.set_ylabel("|B| (mT)")
        handles, names = axes[4].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False)


def _magnitudes_by_formula(sheared: Sheared, x: Array, y: Array) -> list[Array]:
    """Return |B| at S1 and S2 by (3) and (4) for displacements of the tip, each of shape (n,), mT."""
    design = sheared.design
    lever = design.H / design.L
    shift = np.column_stack([lever * x, lever * y, np.full_like(x, -lever * sheared.depth)])
    return _magnitudes(shift, np.zeros((len(x), 2)), "paper")


def _magnitudes_by_fem(sheared: Sheared, x: Array, y: Array) -> list[Array]:
    """Return |B| at S1 and S2 by finite elements, each of shape (n,), mT; NaN beyond the shears that were reached."""
    from scipy.interpolate import PchipInterpolator

    known = [(s, r) for s, r in zip(sheared.shear, sheared.responses, strict=True) if r is not None]
    shear = [s for s, _ in known]
    poses = np.array([(r.shift[0], r.shift[2], r.tilt) for _, r in known])
    size, angle = np.hypot(x, y), np.arctan2(y, x)
    # beyond the farthest state there is no pose: the interpolation returns NaN there
    aside, lower, tilt = PchipInterpolator(shear, poses, extrapolate=False)(size).T
    inside = np.isfinite(aside)
    shift = np.column_stack([aside * np.cos(angle), aside * np.sin(angle), lower])[inside]
    rotation = np.column_stack([-tilt * np.sin(angle), tilt * np.cos(angle)])[inside]
    values = []
    for part in _magnitudes(shift, rotation, "exact"):
        whole = np.full(len(x), np.nan)
        whole[inside] = part
        values.append(whole)
    return values


def _magnitudes(shift: Array, rotation: Array, field: hall.Field) -> list[Array]:
    """Return |B| at S1 and S2 of the preset, each of shape (n,), mT."""
    design = paper()
    points = hall.elements(design)[0][:2]
    return [
        1e3
        * np.linalg.norm(
            hall.field_at(point[None].repeat(len(shift), 0), design, shift, rotation, field=field), axis=1
        )
        for point in points
    ]


def figure_8(path: Path, states: States, best_E: float) -> None:
    """Draw F_N over the depth by (5) and (7) and by finite elements, and the formula's error at each depth."""
    preset = states.preset
    depth, predicted = preset.depth, formula(preset.depth)
    curves = [(f"FEM, magnet {preset.height:g} mm, 1 MPa", FEM, "-", preset.force)]
    curves += [
        ("FEM, no magnet, 1 MPa", HOMOGENEOUS, "-", press.force) for press in states.presses if not press.height
    ]
    curves.append((f"FEM, magnet {preset.height:g} mm, {best_E:.2g} MPa", OTHER, "-.", best_E * preset.force))
    with canvas(path, 2, 1) as (figure, axes):
        from_rest = np.append(0.0, depth)
        for name, colour, style, force in curves:
            axes[0].plot(from_rest, np.append(0.0, force), style, color=colour, label=name)
            axes[1].plot(depth, 100 * (predicted / force - 1), style, color=colour)
        axes[0].plot(from_rest, np.append(0.0, predicted), "--", color=ANALYTIC, label="formula (5), 1 MPa")
        bands(axes[1])
        axes[1].set_ylim(-80, 30)
        label(axes[0], "a", "press force $F_N$ (N)")
        label(axes[1], "b", "error of (5) (%)")
        axes[1].set_xlabel("depth d (mm)")
        figure.legend(loc="outside upper center", ncols=2, frameon=False)


def figure_9(path: Path, press: Press, best_E: float) -> None:
    """Draw F_N over the change of S1's voltage by the formulas and by finite elements."""
    curves = voltages(press)
    # the paper presses to 3 mm
    kept = curves.predicted <= curves.formula_largest * (1 + 1e-9)
    with canvas(path, 1, 1) as (figure, axes):
        axis = axes[0]
        measured = np.append(0.0, curves.measured)
        for E, colour, style in ((1.0, FEM, "-"), (best_E, OTHER, "-.")):
            axis.plot(measured, E * np.append(0.0, curves.force), style, color=colour, label=f"FEM, E = {E:.2g} MPa")
        axis.plot(
            curves.modelled[kept],
            curves.predicted[kept],
            "--",
            color=ANALYTIC,
            label="formulas (3) and (5), E = 1 MPa",
        )
        rest = s1_output(press.design, np.zeros(1))[0]
        axis.set_xlabel(f"change of S1 from its {rest:.2f} V at rest (V)")
        label(axis, "", "press force $F_N$ (N)")
        figure.legend(loc="outside upper center", ncols=2, frameon=False)


def figure_11(path: Path, sheared: Sequence[Sheared]) -> None:
    """Draw F_mu over the displacement of the tip by (6), and by finite elements under each condition of the tip."""
    with canvas(path, 1, 1) as (figure, axes):
        axis = axes[0]
        ends = np.array([0.0, FARTHEST])
        axis.plot(ends, beam.cantilever_stiffness(paper()) * ends, "--", color=ANALYTIC, label="formula (6)")
        colours = (FEM, OTHER, HOMOGENEOUS, COLOURS[4])
        for each, colour, marker in zip(sheared, colours, "osd^", strict=False):
            shear, force = compared(each)
            name = f"FEM, {each.tip}".replace("stuck to a plate at depth", "plate at")
            axis.plot(np.append(0, shear), np.append(0, force), color=colour, marker=marker, label=name)
        axis.set_xlabel("displacement of the tip along x (mm)")
        label(axis, "", r"shear force $F_\mu$ (N)")
        figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=10)


def figure_12(path: Path, states: States) -> None:
    """Draw F_N over the depth for three moduli, with the largest forces that the paper gives for them."""
    from matplotlib.lines import Line2D

    preset = states.preset
    depth = np.append(0.0, preset.depth)
    with canvas(path, 2, 1) as (figure, axes):
        handles = []
        for (E, claimed), colour, marker in zip(CLAIMED, (FEM, HOMOGENEOUS, OTHER), "osd", strict=True):
            at = float(np.interp(claimed / E, formula(depth), depth))
            for axis in axes:
                axis.plot(depth, E * np.append(0.0, preset.force), color=colour)
                axis.plot(depth, E * formula(depth), "--", color=colour)
                axis.plot([at], [claimed], marker, color=colour, markersize=8, markeredgecolor="black")
            name = f"E = {E:g} MPa (paper: to {claimed:g} N)"
            handles.append(Line2D([], [], color=colour, marker=marker, label=name))
        handles.append(Line2D([], [], color="black", label=f"FEM, magnet {preset.height:g} mm"))
        handles.append(Line2D([], [], color="black", linestyle="--", label="formula (5)"))
        axes[1].set_ylim(0, 1.4 * CLAIMED[-1][1])
        axes[1].set_xlabel("depth d (mm)")
        for axis, letter in zip(axes, "ab", strict=True):
            label(axis, letter, "press force $F_N$ (N)")
        figure.legend(handles=handles, loc="outside upper center", ncols=2, frameon=False, fontsize=10)


LEVELS = (0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0)
"""Bounds of the errors in the map, %."""
FINE = 49
"""Heights of the magnet in the map, between those that are solved."""


def modulus_and_height(path: Path, presses: Sequence[Press]) -> None:
    """Draw the error of the force, and of S1's voltage with a fitted gain, over the magnet's height and E."""
    known = [press for press in presses if press.complete and press.height]
    bare = [press for press in presses if press.complete and not press.height]
    searched, coarse, tallest = moduli(401), moduli(21), max(press.height for press in presses)
    rows = interpolated(known, np.linspace(known[0].height, known[-1].height, FINE))
    heights, predicted = [press.height for press in rows], formula(rows[0].depth)
    forces = np.array([[error_of_largest(predicted, press.force, E) for press in rows] for E in searched.tolist()])
    curves = [voltages(press) for press in rows]
    outputs = np.array(
        [[c.error(E, any_gain=True) if c.reaches(E) else np.nan for c in curves] for E in coarse.tolist()]
    )
    with canvas(path, 2, 1) as (figure, axes):
        _error_panel(axes[0], "a", "$F_N$", heights, searched, forces)
        drawn = _error_panel(axes[1], "b", "voltage of S1, gain fitted", heights, coarse, outputs)
        for axis in axes:
            _mark_moduli(axis, heights[-1], tallest)
        bounds = [modulus_interval(predicted, p.force, np.full_like(p.depth, BOUND * p.force[-1])) for p in rows]
        for ends in np.array([bound or (np.nan, np.nan) for bound in bounds]).T:
            axes[0].plot(heights, ends, color="black", linewidth=1.2)
        for press in bare:
            interval = height_row(press)
            axes[0].plot([0, 0], [interval["E_from_MPa"], interval["E_to_MPa"]], color="black", linewidth=4)
            axes[0].text(-0.08, 1.25, "no magnet", fontsize=10, va="center")
        axes[1].text(known[0].height + 0.1, 2.2, "(5) ends below the forces of the press", fontsize=10, va="center")
        figure.colorbar(drawn, ax=axes, ticks=LEVELS).set_label("largest error (%)")
        axes[-1].set_xlabel("height of the magnet (mm)")
        figure.legend(handles=_modulus_handles(), loc="outside upper center", ncols=3, frameon=False, fontsize=10)


def _error_panel(axis: Any, letter: str, title: str, heights: Sequence[float], E: Array, errors: Array) -> Any:
    """Draw errors, shape (moduli, heights), %, and return the filled contours."""
    from matplotlib.colors import BoundaryNorm

    axis.set_facecolor("#dddddd")
    drawn = axis.contourf(heights, E, errors, LEVELS, cmap="cividis_r", norm=BoundaryNorm(LEVELS, 256))
    axis.set(yscale="log", ylim=MODULI)
    axis.set_yticks([0.3, 0.5, 1, 2, 3], ["0.3", "0.5", "1", "2", "3"])
    axis.minorticks_off()
    label(axis, letter, "E (MPa)")
    axis.set_title(f"error of {title}, % of the largest", fontsize=11)
    return drawn


def interpolated(presses: Sequence[Press], heights: Array) -> list[Press]:
    """Return presses at other heights of the magnet, interpolated between those that were solved."""
    from scipy.interpolate import PchipInterpolator

    if len(presses) < 2:
        return list(presses)
    solved = [press.height for press in presses]
    # the force grows by orders of magnitude with the height, its logarithm evenly
    force = np.exp(PchipInterpolator(solved, np.log([press.force for press in presses]))(heights))
    sinking = PchipInterpolator(solved, [press.sinking for press in presses])(heights)
    depth = presses[0].depth
    return [
        Press(height, with_magnet(height), depth, by_force, by_sinking, error_estimate=0.0, message="")
        for height, by_force, by_sinking in zip(heights.tolist(), force, sinking, strict=True)
    ]


def _mark_moduli(axis: Any, reached: float, tallest: float) -> None:
    """Mark the published moduli, the paper's E, and the heights whose presses do not reach every depth."""
    for E in PUBLISHED:
        axis.axhline(E, color="black", linestyle=":", linewidth=1.5)
    axis.axhline(1.0, color=ANALYTIC, linewidth=1.5)
    axis.set_xlim(-0.15, tallest)
    if tallest > reached:
        axis.axvspan(reached, tallest, facecolor="#dddddd", edgecolor="#777777", hatch="//", linewidth=0)
        middle = (reached + tallest) / 2
        axis.text(middle, 1.7, "not reached\nby FEM", ha="center", va="center", fontsize=10, backgroundcolor="white")


def _modulus_handles() -> list[Any]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color="black", label="$F_N$ within 5 %"),
        Line2D([], [], color=ANALYTIC, label="the paper's E"),
        Line2D([], [], color="black", linestyle=":", label=f"published: {PUBLISHED[0]:g} to {PUBLISHED[1]:g} MPa"),
    ]
