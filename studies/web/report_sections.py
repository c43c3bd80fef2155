"""Sections of the report: which figures and tables belong to which files, folder by folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design, paper
from geometry.loads import ANSWERED, Load, Magnet
from studies.answers import SweepColumns
from studies.inputs import study_input, user_input
from studies.inputs.study_input import load_of
from studies.mechanics.study_cases import varied
from studies.output import deformed_body, provenance
from studies.output.figures import Figure
from studies.quantities import shown
from studies.sensing import crosstalk
from studies.sensitivity import uncertainty_figures
from studies.simulation import comparison_figures, critical_depths, mesh_convergence, time_figures
from studies.sizing import sizing_figures
from studies.sweeps import sweep_figures
from studies.web import folder_contents, paper_figures, state_pictures, verdict_figures
from studies.web.folder_contents import Contents

if TYPE_CHECKING:
    import pandas as pd

    from fem.analyses.force_targets import ForceTarget
    from studies.parts.requirements import Requirements

MOST_SURFACES = 3
"""Largest number of solutions of one folder that are shown in 3D, of about 0.4 MB each."""
MOST_OPEN_ROWS, MOST_OPEN_COLUMNS = 40, 9
"""Size up to which a table of words is shown at once, and not only on demand."""


class Known(NamedTuple):
    """A table that magtip writes: some of its columns, what draws it (None: it is shown as a table, as those that are
    not listed), and pictures in the folder that show the same as these figures.
    """

    file: str
    columns: tuple[str, ...]
    figures: Callable[[pd.DataFrame], list[Figure]] | None
    pictures: tuple[str, ...] = ()


KNOWN = (
    Known("press.csv", ("depth_mm", "fem_force_N", "analytic_force_N"), comparison_figures.press, ("press.png",)),
    Known("shear.csv", ("shear_mm", "fem_force_x_N", "analytic_force_x_N"), comparison_figures.shear, ("shear.png",)),
    Known("states.jsonl", ("depth_mm", "status"), comparison_figures.states),
    Known(
        "trade.csv",
        ("kind", "model", "level", "cost", "force_error_percent", "status"),
        verdict_figures.trade,
        ("trade.png",),
    ),
    Known("extremes.csv", ("scene", "verdict", "measured", "bound"), verdict_figures.robustness),
    Known("verify.csv", ("target", "quantity", "error_percent", "tolerance_percent"), verdict_figures.verification),
    Known("accuracy.csv", ("force_error", "force_estimate", "level"), verdict_figures.accuracy, ("errors.png",)),
    Known("friction.csv", ("check", "off", "bound", "passed"), verdict_figures.friction),
    Known("crosscheck.csv", ("force_difference_percent", "agree"), verdict_figures.crosscheck),
    Known("converge.csv", ("mesh", "section_size_over_D"), mesh_convergence.figures, ("converge.png",)),
    Known("stability.csv", ("L_over_D", "critical_depth_mm"), critical_depths.figures, ("stability.png",)),
    Known("field.csv", ("region", "height_per_radius", "compiled"), verdict_figures.field),
    Known("ladder.csv", ("level", "outside", "press_force_error", "status"), verdict_figures.ladder, ("ladder.png",)),
    Known("ladder.csv", ("motion", "model", "natural_Hz"), None),
    Known("response.csv", ("motion", "frequency_Hz"), time_figures.response, ("response_z.png", "response_x.png")),
    Known("cycle.csv", ("law", "time_s", "cycle", "depth_mm", "shear_mm"), time_figures.cycle, ("cycle.png",)),
    Known("heights.csv", ("magnet_height_mm", "error_percent_of_largest"), paper_figures.heights),
    Known("presses.csv", ("magnet_height_mm", "depth_mm", "fem_force_N"), paper_figures.presses),
    Known("shears.csv", ("tip", "shear_mm", "fem_force_x_N"), paper_figures.shears),
    Known("readings.csv", ("L_over_D", "element", "mechanics_percent_FS"), paper_figures.readings, ("readings.png",)),
    Known("front.csv", ("status", "rank", "D_mm", "L_mm"), sizing_figures.front, ("front.png",)),
    Known("yield.csv", ("requirement", "sensors", "within_percent"), sizing_figures.made_within),
    Known("sobol.csv", ("output", "input", "first_order", "total_order"), uncertainty_figures.sobol, ("sobol.png",)),
    Known("morris.csv", ("output", "input", "mu_star", "sigma"), uncertainty_figures.morris, ("morris.png",)),
    Known("morris_cases.csv", ("fem_force_N", "status"), None),
    Known(
        "disturbances.csv",
        ("disturbance", "size", "error_percent", "tared_percent"),
        verdict_figures.disturbances,
    ),
    Known("pitches.csv", crosstalk.DRAWN, crosstalk.figures, ("array.png",)),
    Known("montecarlo.csv", ("sensor", "status", "E_MPa"), uncertainty_figures.made_sensors, ("montecarlo.png",)),
)
"""Tables by file name. A sweep's table is recognised by its columns, see `_figures_of`."""

ASSUMPTION = ("magnet_height_mm", "nu", "depth_mm", "shear_mm", "fem_force_N", "analytic_paper_force_N")
"""Columns of the sweep of `magtip validate formulas assumption`, whose figures need them all."""
ASSUMPTION_PICTURES = ("press_force.png", "sinking.png", "shear_force.png", "sideways_shift.png", "tilt.png")
"""Its pictures that show the same as these figures."""


@dataclass(frozen=True, slots=True)
class Section:
    """What the report says of one folder.

    Attributes
    ----------
    name : path of the folder below that of the report.
    surfaces : sensors in 3D: title, caption, parts and largest displacement, mm.
    sheets : tables that are shown at once, by their titles.
    replaced : pictures that a figure replaces.
    remarks : sentences on what is left out.
    """

    name: str
    contents: Contents
    figures: list[Figure] = field(default_factory=list)
    surfaces: list[dict[str, Any]] = field(default_factory=list)
    sheets: dict[str, pd.DataFrame] = field(default_factory=dict)
    replaced: set[str] = field(default_factory=set)
    remarks: list[str] = field(default_factory=list)


def section(contents: Contents, *, solve: bool) -> Section:
    """Return the section of a folder.

    Parameters
    ----------
    solve : whether the design that the folder names may be solved for the 3D figure.
    """
    result = Section(contents.name, contents, remarks=list(contents.unread))
    assumption = "ASSUMPTION.md" in contents.pages
    for name, table in contents.tables.items():
        try:
            figures, pictures, remark = _figures_of(name, table, contents.run, assumption=assumption)
        except BadInput as error:
            figures, pictures, remark = [], (), f"{name} has no figure: {error}."
        drawn = [replace(figure, source=name) for figure in figures if len(figure.data)]
        result.figures.extend(drawn)
        result.remarks.extend([remark] if remark else [])
        if not drawn and len(table) <= MOST_OPEN_ROWS and table.shape[1] <= MOST_OPEN_COLUMNS and len(table):
            result.sheets[name] = table
        result.replaced.update(pictures if drawn else ())
    if folder_contents.SIZING in contents.records:
        result.sheets.update(sizing_figures.sheets(contents.records[folder_contents.SIZING]))
        if "front.csv" in contents.tables:
            result.sheets["Front"] = sizing_figures.front_sheet(contents.tables["front.csv"])
    _add_surfaces(result, solve=solve)
    return result


def _figures_of(
    name: str, table: pd.DataFrame, run: provenance.Run | None, *, assumption: bool
) -> tuple[list[Figure], tuple[str, ...], str]:
    """Return the figures of a table, the pictures that they replace, and a sentence if one could expect some."""
    if not len(table):
        return [], (), f"{name} has no rows."
    for known in KNOWN:
        if known.file == name and set(known.columns) <= set(table):
            return (known.figures(table) if known.figures else []), known.pictures, ""
    if assumption and set(ASSUMPTION) <= set(table):
        return paper_figures.assumption(table), ASSUMPTION_PICTURES, ""
    study = SweepColumns.of_table(table.columns)
    if run is not None and run.sweep and name.startswith("sweep."):
        study = SweepColumns.of_record(run.sweep, table.columns)
    if study.axes and "status" in table and sweep_figures.drawn_quantities(study, table):
        figures = sweep_figures.sweep(table, study) if folder_contents.answered(table).any() else []
        return figures, ("sweep.png",), "" if figures else f"{name} has no figure: every case failed."
    expected = next((known for known in KNOWN if known.file == name), None)
    if expected is not None:
        missing = ", ".join(column for column in expected.columns if column not in table)
        return [], (), f"{name} has no figure: its columns {missing} are missing."
    return [], (), ""


def _add_surfaces(result: Section, *, solve: bool) -> None:
    """Add the solutions of the folder in 3D; without any the sensor that the folder names is solved."""
    contents = result.contents
    for name in contents.solutions:
        if len(result.surfaces) == MOST_SURFACES:
            result.remarks.append(f"{name} is not shown: the page shows {MOST_SURFACES} solutions of a folder in 3D.")
            continue
        try:
            surface = surface_of_file(contents.path / name)
        except BadInput as error:
            result.remarks.append(f"{name} was not read: {error}.")
            continue
        if surface is None:
            result.remarks.append(f"{name} is a mesh without displacements, which the page does not show.")
        else:
            result.surfaces.append(surface)
    state = state_of(contents)
    if not result.surfaces and state is not None and solve:
        try:
            result.surfaces.append(solved_surface(*state))
        except BadInput as error:
            result.remarks.append(f"{error}.")


def surface_of_file(path: Path) -> dict[str, Any] | None:
    """Return the surface of a solution's .vtu file; None if it is a mesh without displacements.

    Raises
    ------
    BadInput
        The file is no .vtu file with cells.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    # VTK would print its own messages; the report says in a sentence that the file cannot be read
    vtkObject.GlobalWarningDisplayOff()
    try:
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
        reader.Update()
        grid = pv.wrap(reader.GetOutput())
    finally:
        vtkObject.GlobalWarningDisplayOn()
    if not grid.n_cells:
        raise BadInput("it is no .vtu file with cells")
    if "displacement_mm" not in grid.point_data:
        return None
    return _described(
        f"Deformed sensor, {path.name}",
        f"the state in {path.name}",
        state_pictures.surface_data(deformed_body.parts_of(grid)),
    )


def solved_surface(design: Design, load: Load | ForceTarget | None) -> dict[str, Any]:
    """Solve for a state by finite elements and return its surface.

    The store has no deformed body, so the state is solved for here, without error estimates, whatever is kept of it.

    Parameters
    ----------
    load : of the study, or the forces that the design is required to bear; None, where it names none, for a press to
        D/8 and a glued shear of D/8.

    Raises
    ------
    BadInput
        The solve stopped before this state.
    """
    from fem.accuracy import STANDARD
    from fem.analyses.force_targets import ForceTarget, walk_forces
    from fem.equilibrium import trace

    why = ", for want of a load in the files," if load is None else ""
    load = load or Load(depth=design.D / 8, shear_x=design.D / 8, friction="stick")
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    status: str
    try:
        if isinstance(load, ForceTarget):
            solution = next(walk_forces(design, [load], STANDARD, magnet=magnet, estimate=False))
        else:
            solution = trace(design, [load], STANDARD, magnet=magnet, estimate=False)[-1]
        status, message = solution.status, solution.message
    except (BadInput, SolveFailed) as error:
        status, message = "bad_input" if isinstance(error, BadInput) else "not_converged", str(error)
    if status not in ANSWERED:
        raise BadInput(f"the sensor was not solved for its 3D figure ({status}): {message}")
    response = solution.response
    return _described(
        "Deformed sensor",
        _named_forces(load) if isinstance(load, ForceTarget) else _named_load(load),
        state_pictures.surface(solution),
        f" Solved{why} for this report, for D = {design.D:.4g} mm and L = {design.L:.4g} mm: force "
        f"{response.force[0]:.3g} N along the shear and {response.force[2]:.3g} N in compression; the magnet tilts "
        f"by {shown(response.tilt, 'deg', 2)}.",
    )


def _named_forces(target: ForceTarget) -> str:
    """Return what a sensor is required to bear, in words."""
    aside = f" and {target.shear_size:.3g} N along the plate, which sticks to the tip" if target.shear_force else ""
    return f"the required load, a press of {target.force:.3g} N{aside}"


def _named_load(load: Load) -> str:
    """Return what is done to the sensor.

    >>> _named_load(Load(depth=1.0, shear_x=0.5, friction=0.3))
    'a press of 1 mm and a shear of 0.5 mm with a friction coefficient of 0.3'
    """
    parts = [f"a press of {load.depth:.3g} mm" if load.grip is None else f"a grip of {load.grip:.3g} mm"]
    if load.plate_tilt:
        parts.append(f"a plate tilted by {shown(load.plate_tilt, 'deg')}")
    if load.shear:
        parts.append(f"a shear of {load.shear:.3g} mm")
    contact = {"stick": "with the plate stuck to the tip", "none": "without friction"}
    how = contact.get(str(load.friction), f"with a friction coefficient of {load.friction}")
    return " and ".join(parts) + (f" {how}" if load.shear and load.grip is None else "")


def _described(title: str, state: str, data: dict[str, Any], more: str = "") -> dict[str, Any]:
    """Return a surface with its title, and with what the figure shows."""
    magnet = "; the magnet is grey" if "magnet" in data["parts"] else ""
    caption = (
        f"The beam in {state}, at true scale, coloured by its displacement, at most {data['largest']:.3g} mm{magnet}."
        f" Drag, or use the arrow keys, to turn it.{more}"
    )
    points = np.concatenate([part["points"].reshape(-1, 3) for part in data["parts"].values()])
    box = {"low": points.min(axis=0).tolist(), "high": points.max(axis=0).tolist()}
    return {"title": title, "caption": caption, **box, **data}


def state_of(contents: Contents) -> tuple[Design, Load | ForceTarget | None] | None:
    """Return a sensor and a load that the study of a folder contains, the largest load; None without a design.

    Where no table states one, it is what a design file of the folder requires, else None.
    """
    design = design_of(contents)
    if design is None:
        return None
    for name in ("sweep.csv", "sweep.parquet", "shear.csv", "press.csv", "cycle.csv"):
        table = contents.tables.get(name)
        if table is not None and (state := _largest_state(table, design)) is not None:
            return state
    required = list(contents.requirements.values())
    return design, _required(required[0]) if len(required) == 1 else None


def _required(needed: Requirements) -> ForceTarget:
    """Return the largest required load, in the plane of the shear."""
    from fem.analyses.force_targets import ForceTarget

    aside = None if needed.force_x is None else (needed.force_x, 0.0)
    return ForceTarget(needed.force_z, aside, Load(friction="stick" if aside else "none"))


def _largest_state(table: pd.DataFrame, base: Design) -> tuple[Design, Load] | None:
    """Return the case of a table with the greatest shear, then depth, of the base design if the table has it."""
    import pandas as pd

    present = {study_input.column(name): name for name in study_input.AXES if study_input.column(name) in table}
    ok = folder_contents.answered(table)
    if "depth_mm" not in present or not ok.any():
        return None
    rows = table.loc[ok, list(present)].rename(columns=present)
    own = [rows[name] == getattr(base, name) for name in rows if name in study_input.DESIGN]
    sizes = {
        name: pd.to_numeric(rows[name], errors="coerce").abs().fillna(0.0) if name in rows else 0.0
        for name in ("shear", "shear_y", "depth")
    }
    rank = pd.DataFrame({"own": np.logical_and.reduce(own) if own else True, "aside": 0.0}, index=rows.index)
    rank = rank.assign(aside=np.hypot(sizes["shear"], sizes["shear_y"]), depth=sizes["depth"])
    place = rank.sort_values(["own", "aside", "depth"], ascending=False, kind="stable").index[0]
    case = {name: _axis_value(value) for name, value in rows.loc[place].items() if value == value and value != ""}
    fields = {k: v for k, v in case.items() if k in study_input.DESIGN and v != getattr(base, k)}
    try:
        return varied(base, fields), load_of({name: v for name, v in case.items() if name in study_input.LOAD})
    except BadInput:
        return None


def _axis_value(value: Any) -> float | str:
    """Return a value of an axis from its cell, which is a text where other rows have words."""
    try:
        return float(value)
    except ValueError:
        return str(value)


def design_of(contents: Contents) -> Design | None:
    """Return the design that a folder names: by the record of its run, by its only design file, or by its kind."""
    if contents.run is not None and contents.run.design:
        try:
            user_input.check_keys(provenance.NAME, contents.run.design, user_input.FIELDS)
            return user_input.design_from("paper", contents.run.design, "rigid")
        except BadInput:
            return None
    if len(contents.designs) == 1:
        return next(iter(contents.designs.values()))
    # the demonstration and the claims are about the paper's sensor
    if {"REPORT.md", "CLAIMS.md"} & set(contents.pages):
        return paper()
    return None
