"""States under load: what the command line's options mean as loads, and what is printed of solutions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from geometry.design import BadInput, Design
from geometry.scene import Load, Magnet
from studies import files, inputs
from studies.console import Progress

if TYPE_CHECKING:
    from fem.equilibrium import Model
    from fem.solution import Solution

MOST_STEPS = 1000
DETAILS = ("message", "model", "dofs", "newton_iterations")
"""Keys of a state that a table of several states leaves out."""


@dataclass(frozen=True, slots=True)
class Grid:
    """What a sweep is asked for."""

    design: Design
    axes: dict[str, list[float]]
    depth: float
    magnet: Magnet
    accuracy: str


def loads_of(
    *,
    depth: float | None = None,
    depths: str | None = None,
    steps: float | None = None,
    shear: float | None = None,
    friction: str | None = None,
    grip: float | None = None,
) -> list[Load]:
    """The states that the options of `magtip solve` ask for, in order.

    >>> [load.depth for load in loads_of(depth=1.0, steps=2)]
    [0.5, 1.0]
    >>> [load.shear_x for load in loads_of(depth=1.0, steps=2, shear=1.0)]
    [0.5, 1.0]
    """
    slides = shear is not None and shear != 0
    if sum(given is not None for given in (depth, depths)) > 1:
        raise BadInput("--depth and --depths exclude each other: give one of them")
    if depth is None and depths is None and grip is None:
        raise BadInput("what the plate does is not given: add --depth D in mm, or --grip HEIGHT with --shear X")
    if grip is not None and not slides:
        raise BadInput("a grip only moves sideways: add --shear X in mm")
    if grip is not None and friction is not None:
        raise BadInput("a grip has no plate to rub on: leave --friction out")
    if depths is not None and (steps is not None or shear is not None):
        other = "--steps" if steps is not None else "--shear"
        raise BadInput(f"--depths lists the states of a press: give one --depth instead to go with {other}")
    contact = _friction(friction, "stick" if slides and grip is None else "none")
    if depths is not None:
        return [Load(depth=value, friction=contact) for value in inputs.parse_numbers("--depths", depths)]
    count = _count(steps)
    full = Load(depth=depth or 0.0, shear_x=shear or 0.0, friction=contact, grip=grip)
    shares = [(k + 1) / count for k in range(count)]
    if slides:
        return [Load(full.depth, share * full.shear_x, 0.0, contact, grip) for share in shares]
    return [Load(share * full.depth, 0.0, 0.0, contact) for share in shares]


def _friction(text: str | None, default: Literal["none", "stick"]) -> float | Literal["none", "stick"]:
    if text is None:
        return default
    if text in ("none", "stick"):
        return "none" if text == "none" else "stick"
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"--friction must be none, stick or a coefficient of 0 or more; got {text!r}") from None


def _count(steps: float | None) -> int:
    if steps is None:
        return 1
    if not (1 <= steps <= MOST_STEPS and steps == int(steps)):
        raise BadInput(f"--steps must be a whole number between 1 and {MOST_STEPS}; got {steps:g}")
    return int(steps)


def solve(
    design: Design,
    loads: list[Load],
    accuracy: str,
    magnet: Magnet,
    model: Model,
    *,
    out: Path | None,
    picture: Path | None,
    progress: Progress,
) -> list[dict[str, Any]]:
    """Solve, write the files of the last state, and return a record of each state that was reached."""
    from fem import equilibrium

    vtu = None if out is None else files.check_output_file(out, ".vtu")
    png = None if picture is None else files.check_output_file(picture, ".png")
    level = equilibrium.LEVELS[accuracy]
    try:
        found = equilibrium.trace(design, loads, level, magnet=magnet, model=model, progress=progress)
    except RuntimeError as error:
        return [_unsolved(loads[0], model, str(error))]
    if vtu is not None:
        files.write_field(vtu, found[-1].field)
    if png is not None:
        from studies.pictures import section_picture

        section_picture(png, design, found[-1], magnet=magnet)
    return [solution_record(state) for state in found]


def solution_record(state: Solution) -> dict[str, Any]:
    """One state under the names of the command line's contract."""
    return {
        "status": state.status,
        "message": state.message,
        "model": state.model,
        "depth_mm": state.load.depth,
        "shear_mm": state.load.shear_x,
        "force_N": list(state.response.force),
        "shift_mm": list(state.response.shift),
        "tilt_rad": state.response.tilt,
        "contact_radius_mm": state.response.contact_radius,
        "error_estimate": state.error_estimate,
        "dofs": state.dofs,
        "newton_iterations": state.newton_iterations,
        "seconds": state.seconds,
    }


def _unsolved(load: Load, model: str, message: str) -> dict[str, Any]:
    """The record of a state that has no mesh to be solved on."""
    missing = ("force_N", "shift_mm", "tilt_rad", "contact_radius_mm", "error_estimate")
    return {
        "status": "not_converged",
        "message": message,
        "model": model,
        "depth_mm": load.depth,
        "shear_mm": load.shear_x,
        **dict.fromkeys(missing),
        "dofs": 0,
        "newton_iterations": 0,
        "seconds": 0.0,
    }


def compared(row: dict[str, Any]) -> dict[str, Any]:
    """What a table on the screen shows of a row of a comparison or a sweep; the rest is in the files."""
    load = ("D_mm", "L_mm", "f_mm", "E_MPa", "shear_mm", "depth_mm")
    judged = ("force_x_N", "shift_x_mm") if "shear_mm" in row else ("force_N", "shift_z_mm")
    keys = [f"{model}_{name}" for name in judged for model in ("fem", "fem_homogeneous", "analytic")]
    errors = ("force_error_percent", "force_x_error_percent", "fem_tilt_rad", "status")
    return {key: row[key] for key in (*load, *keys, *errors) if key in row}


def analytic(design: Design, depth: float, shear: float, level: str) -> dict[str, Any]:
    """The formulas' answer under the same names, with the readings; these are None without a magnet."""
    from analytic import beam, hall

    response = beam.solve(design, Load(depth=depth, shear_x=shear, friction="stick" if shear else "none"), level)
    seen = hall.readings(design, response) if design.shape.has_magnet else None
    return {
        "status": "ok",
        "level": level,
        "depth_mm": depth,
        "shear_mm": shear,
        "force_N": list(response.force),
        "shift_mm": list(response.shift),
        "tilt_rad": response.tilt,
        "contact_radius_mm": response.contact_radius,
        "readings_T": None if seen is None else list(seen.B_T),
        "readings_V": None if seen is None else list(seen.V),
    }


def grid_of(
    source: str | None,
    axes: list[str],
    design: str | None,
    depth: float | None,
    magnet: Magnet | None,
    accuracy: str | None,
    sets: list[str],
) -> Grid:
    """What a sweep is asked for: by a study, or by axes and a design, with the options that replace its values."""
    if source is not None and design is not None:
        raise BadInput(f"the design is given twice, {source!r} and --design {design!r}: give one of them")
    if source is not None and inputs.is_study(source):
        if axes:
            raise BadInput(f"the study {source!r} has its own axes: leave --axis out, or give a design instead")
        study = inputs.read_study(source)
        depth, accuracy = depth if depth is not None else study.depth, accuracy or study.accuracy
        magnet, values = magnet or study.magnet or "rigid", study.axes
        varied = inputs.study_design(study, sets, magnet=magnet)
    else:
        if not axes:
            raise BadInput("a sweep needs a study's TOML file with a table [axes], or --axis NAME=a,b,c")
        magnet, values = magnet or "rigid", inputs.parse_axes(axes)
        varied = inputs.read_design(source or design or "paper", sets, magnet=magnet)
    if "depth" in values and depth is not None:
        raise BadInput("the depth is an axis and given by itself too: leave one of them out")
    if "depth" not in values and depth is None:
        raise BadInput("a sweep needs a depth: add --depth D in mm, or the axis depth=a,b,c")
    if depth is not None:
        Load(depth=depth)
    return Grid(varied, values, depth or 0.0, magnet, accuracy or "standard")


def sweep(grid: Grid, out: Path | None, progress: Progress) -> list[dict[str, Any]]:
    """Run a sweep."""
    folder = None if out is None else files.output_folder(out)
    from fem.equilibrium import LEVELS
    from studies import sweep as work

    rows: list[dict[str, Any]] = work.run(
        grid.design,
        grid.axes,
        folder,
        depth=grid.depth,
        magnet=grid.magnet,
        accuracy=LEVELS[grid.accuracy],
        progress=progress,
    )
    return rows
