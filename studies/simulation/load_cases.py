"""States under load: what the command line's options mean as loads, and what is printed of solutions."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from geometry import design_digest
from geometry.design import BadInput, Design
from geometry.loads import STEEPEST, Load, Magnet, Response
from geometry.messages import Progress
from studies.inputs import user_input
from studies.inputs.option_groups import Method, Motion
from studies.output import atomic_files, console, vtk_files
from studies.sensing import field_readings

if TYPE_CHECKING:
    from fem.accuracy import Accuracy
    from fem.solution import Facts, Solution
    from geometry.mesh import Parts

MOST_STEPS = 1000
MOVED = ("depth_mm", "shear_mm", "shear_y_mm")
"""Keys that tell the states of a path apart."""
FACTS = (
    *("stop", "remark", "unstable_directions", "unstable_stretches", "inside_out_share"),
    *("sideways_stiffness_ratio", "critical_depth_mm_estimate"),
    *(f"onset_{what}_{end}_mm" for what in ("depth", "shear") for end in ("from", "to")),
)
"""Keys whose values the message tells in words."""
FIRST = ("status", *MOVED, "force_N", "shift_mm")
"""Keys that a table of states needs most."""
UNSHOWN = (*FACTS, "made_for")
"""Keys that tables leave out."""


def loads_of(motion: Motion) -> list[Load]:
    """The states that the options of `magtip solve` ask for, in order.

    >>> [load.depth for load in loads_of(Motion(depth=1.0, steps=2))]
    [0.5, 1.0]
    >>> [load.shear_x for load in loads_of(Motion(depth=1.0, steps=2, shear=1.0))]
    [0.5, 1.0]
    """
    slides = _check_motion(motion)
    contact = _friction(motion.friction, "stick" if slides and motion.grip is None else "none")
    tilt = math.radians(motion.plate_tilt)
    if motion.depths is not None:
        depths = user_input.parse_numbers("--depths", motion.depths)
        given = Load(friction=contact, plate_tilt=tilt, imperfection=motion.imperfection)
        return [replace(given, depth=value) for value in depths]
    count = _count(motion.steps)
    full = Load(
        depth=motion.depth or 0.0,
        shear_x=motion.shear or 0.0,
        shear_y=motion.shear_y or 0.0,
        friction=contact,
        grip=motion.grip,
        plate_tilt=tilt,
        imperfection=motion.imperfection,
    )
    shares = [(k + 1) / count for k in range(count)]
    if slides:
        return [replace(full, shear_x=share * full.shear_x, shear_y=share * full.shear_y) for share in shares]
    return [replace(full, depth=share * full.depth) for share in shares]


def in_vain(motion: Motion, method: Method) -> list[tuple[str, str]]:
    """Options that another one makes useless, and why."""
    found = []
    if motion.friction == "stick" and not (motion.shear or motion.shear_y):
        found.append(("--friction stick", "it acts only during a shear, and this load has none"))
    if method.mesh is not None and method.accuracy != "standard" and motion.grip is None:
        found.append(("--accuracy", "the mesh comes from --mesh"))
    return found


def _check_motion(motion: Motion) -> bool:
    """Refuse options that exclude each other; returns whether there is a shear."""
    slides = bool(motion.shear or motion.shear_y)
    if motion.depth is not None and motion.depths is not None:
        raise BadInput("--depth and --depths exclude each other: give only one")
    if motion.depth is None and motion.depths is None and motion.grip is None:
        raise BadInput("no load is given: add --depth D in mm, or --grip HEIGHT with --shear X")
    if motion.grip is not None and not slides:
        raise BadInput("--grip needs a shear: add --shear X in mm")
    if motion.grip is not None and motion.friction is not None:
        raise BadInput("--friction has no meaning with --grip, which has no plate: leave --friction out")
    if motion.grip is not None and motion.imperfection:
        raise BadInput("--imperfection has no meaning with --grip, which has no plate: leave --imperfection out")
    if motion.grip is not None and motion.plate_tilt:
        raise BadInput("--plate-tilt has no meaning with --grip, which has no plate: leave --plate-tilt out")
    if motion.depths is not None:
        given = {"--steps": motion.steps, "--shear": motion.shear, "--shear-y": motion.shear_y}
        for name, value in given.items():
            if value is not None:
                raise BadInput(
                    f"--depths is for presses only and cannot be combined with {name}: give one --depth instead"
                )
    steepest = math.degrees(STEEPEST)
    if not abs(motion.plate_tilt) <= steepest:
        raise BadInput(f"--plate-tilt must lie within +-{steepest:.4g} degrees; got {motion.plate_tilt:g}")
    return slides


def _friction(text: str | None, default: Literal["none", "stick"]) -> float | Literal["none", "stick"]:
    if text is None:
        return default
    if text in ("none", "stick"):
        return "none" if text == "none" else "stick"
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"--friction must be none, stick or a coefficient of 0 or more; got {text!r}") from None


def _count(steps: int | None) -> int:
    if steps is None:
        return 1
    if not 1 <= steps <= MOST_STEPS:
        raise BadInput(f"--steps must be a whole number between 1 and {MOST_STEPS}; got {steps}")
    return steps


def columns(loads: list[Load]) -> list[str]:
    """Keys of a state that a table of several states shows: what moves, and what answers."""
    aside = any(load.shear_y for load in loads)
    shown = {
        "status": True,
        "depth_mm": loads[0].grip is None,
        "shear_mm": any(load.shear_x for load in loads),
        "shear_y_mm": aside,
        "plate_tilt_rad": bool(loads[0].plate_tilt),
        "force_N": True,
        "shift_mm": True,
        "tilt_rad": True,
        "tilt_y_rad": aside,
        "contact_radius_mm": loads[0].grip is None,
        "slip_share": loads[0].coulomb is not None,
        "error_estimate": True,
        "shift_error_estimate": True,
        "tilt_error_estimate": True,
        "sideways_error_estimate": aside or any(load.shear_x for load in loads),
        "seconds": True,
    }
    return [key for key, wanted in shown.items() if wanted]


def solve(
    design: Design,
    loads: list[Load],
    method: Method,
    *,
    out: Path | None,
    picture: Path | None,
    progress: Progress,
) -> Generator[dict[str, Any]]:
    """A record of each state as soon as it is reached.

    Whatever ends it, be it an interruption or the caller that closes it, files are written of the last good state.

    Raises
    ------
    BadInput
        At once, if the files cannot be written or the loads fit neither the design, the method nor each other.
    """
    from fem import equilibrium
    from fem.scene import Scene

    vtu = None if out is None else atomic_files.check_output_file(out, ".vtu")
    png = None if picture is None else atomic_files.check_output_file(picture, ".png")
    method, mesh = _given(design, method)
    scene = Scene(design, tuple(loads), _level(loads, method), method.magnet, method.model)
    found = equilibrium.walk(scene, progress=progress, mesh=mesh)
    return _records(design, loads, method, found, vtu, png)


def _given(design: Design, method: Method) -> tuple[Method, Any]:
    """The method with the model that the mesh in its file is for, and the mesh in units of D; None without a file."""
    if method.mesh is None:
        return method, None
    from geometry.meshing import mesh_import

    parts: Parts = "hole" if method.magnet == "rigid" else "none"
    mesh = mesh_import.read(method.mesh, design.shape, parts, console.warn)
    model: Literal["half", "full"] = "half" if "symmetry" in mesh.boundaries else "full"
    if method.model not in ("auto", model):
        raise BadInput(f"the mesh {str(method.mesh)!r} is for model {model}: leave --model {method.model} out")
    if method.magnet == "rigid" and "magnet" not in mesh.boundaries:
        raise BadInput(
            f"the mesh {str(method.mesh)!r} contains no magnet, neither as a region nor as a hole: "
            "add --magnet ignored"
        )
    return replace(method, model=model), replace(mesh, doflocs=mesh.doflocs / design.D)


def _level(loads: list[Load], method: Method) -> Accuracy:
    """The accuracy, with the number of harmonics asked for."""
    from fem import accuracy as accuracy_levels
    from fem.scene import MOST_HARMONICS, choose_model

    level, harmonics = accuracy_levels.LEVELS[method.accuracy], method.harmonics
    if harmonics is None:
        return level
    if not 0 <= harmonics <= MOST_HARMONICS:
        raise BadInput(f"--harmonics must be a whole number between 0 and {MOST_HARMONICS}; got {harmonics}")
    model = choose_model(loads, method.model)
    if model != "harmonic":
        raise BadInput(f"--harmonics is for model harmonic, but this load uses model {model}: add --model harmonic")
    if harmonics == 0 and any(load.shear for load in loads):
        raise BadInput("--harmonics must be 1 or more for a shear; got 0")
    return replace(level, harmonics=harmonics)


def _records(
    design: Design,
    loads: list[Load],
    method: Method,
    found: Iterator[Solution],
    vtu: Path | None,
    png: Path | None,
) -> Generator[dict[str, Any]]:
    last: Solution | None = None
    reached = 0
    label = design_digest.label(design_digest.of_mechanics(design, method.magnet))
    with atomic_files.sole_writer(vtu, png):
        try:
            for last in found:
                reached += 1
                yield solution_record(last) | label
        except RuntimeError as error:
            yield _unsolved(loads[reached], method.model, str(error)) | label
        finally:
            if last is not None:
                _write(design, last, method.magnet, vtu, png)


def _write(design: Design, state: Solution, magnet: Magnet, vtu: Path | None, png: Path | None) -> None:
    if vtu is not None:
        vtk_files.write_field(vtu, state)
    if png is not None:
        from studies.output.solution_pictures import section_picture

        section_picture(png, design, state, magnet=magnet)


def solution_record(state: Solution) -> dict[str, Any]:
    """One state under the names of the command line's contract."""
    return {
        "status": state.status,
        "message": state.message,
        "model": state.model,
        **_motion_record(state.load),
        **_response_record(state.response),
        "slip_share": state.slip_share,
        "dissipated_mJ": state.dissipated,
        "error_estimate": state.estimates.force,
        "shift_error_estimate": state.estimates.shift,
        "tilt_error_estimate": state.estimates.tilt,
        "sideways_error_estimate": state.estimates.sideways,
        "dofs": state.dofs,
        "newton_iterations": state.newton_iterations,
        "seconds": state.seconds,
        **_facts_record(state.facts),
    }


def _facts_record(facts: Facts) -> dict[str, Any]:
    """What the message of a state says, for programs; the onset is where the path turned unstable, from and to."""
    onsets = {
        f"onset_{what}_{end}_mm": facts.onset_mm[i] if facts.onset_mm and facts.onset == what else None
        for what in ("depth", "shear")
        for i, end in enumerate(("from", "to"))
    }
    return {
        "stop": facts.stop or None,
        "remark": facts.remark,
        "unstable_directions": facts.unstable_directions,
        **onsets,
        "unstable_stretches": None if facts.weak_at is None else list(facts.weak_at),
        "inside_out_share": facts.inverted_share,
        "sideways_stiffness_ratio": facts.sideways_stiffness_ratio,
        "critical_depth_mm_estimate": facts.critical_depth,
    }


def _motion_record(load: Load) -> dict[str, Any]:
    return {
        "depth_mm": load.depth,
        "shear_mm": load.shear_x,
        "shear_y_mm": load.shear_y,
        "plate_tilt_rad": load.plate_tilt,
        "imperfection_N": load.imperfection,
    }


def _response_record(response: Response) -> dict[str, Any]:
    return {
        "force_N": list(response.force),
        "shift_mm": list(response.shift),
        "tilt_rad": response.tilt,
        "tilt_y_rad": response.tilt_y,
        "rotation_rad": list(response.rotation),
        "contact_radius_mm": response.contact_radius,
    }


def _unsolved(load: Load, model: str, message: str) -> dict[str, Any]:
    """The record of a state that has no mesh to be solved on."""
    missing = ("force_N", "shift_mm", "tilt_rad", "tilt_y_rad", "rotation_rad", "contact_radius_mm")
    names = ("", "shift_", "tilt_", "sideways_")
    estimates = [f"{name}error_estimate" for name in names]
    return {
        "status": "not_converged",
        "message": message,
        "model": model,
        **_motion_record(load),
        **dict.fromkeys((*missing, "slip_share", "dissipated_mJ", *estimates)),
        "dofs": 0,
        "newton_iterations": 0,
        "seconds": 0.0,
        **dict.fromkeys(FACTS),
        "stop": "no_mesh",
    }


def analytic(design: Design, depth: float, shear: tuple[float, float], level: str) -> dict[str, Any]:
    """The formulas' answer under the same names, with the readings, what is in the magnet's way, and the same label.

    Without a magnet there are no readings; of a chip there are fields and outputs in T, of three elements volts.
    """
    from analytic import beam, hall

    friction: Literal["none", "stick"] = "stick" if any(shear) else "none"
    load = Load(depth=depth, shear_x=shear[0], shear_y=shear[1], friction=friction)
    response = beam.solve(design, load, level)
    seen = hall.readings(design, response) if design.shape.has_magnet else None
    label = design_digest.label(design_digest.of_mechanics(design, "ignored" if seen is None else "rigid"))
    volts = seen is not None and set(seen.units) == {"V"}
    return {
        "status": "ok",
        "message": beam.outside(design, load, level),
        "level": level,
        **_motion_record(load),
        **_response_record(response),
        "readings_T": None if seen is None else list(seen.B_T),
        "readings_V": list(seen.output) if seen and volts else None,
        "output_T": list(seen.output) if seen and not volts else None,
        "saturated": None if seen is None else list(seen.saturated),
        "warnings": [] if seen is None else field_readings.warnings(design, seen, response.shift, response.rotation),
        **label,
    }
