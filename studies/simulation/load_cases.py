"""Load cases of the command line: the loads that its options mean, and their solution state by state."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fem.solution import ForceOutOfReach, Solution
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.inputs import user_input
from studies.inputs.option_groups import Method, Motion
from studies.inputs.study_input import OF_STATES, load_of
from studies.mechanics import store as stores
from studies.mechanics import stored_answers
from studies.output import atomic_files, console, vtk_files
from studies.output.records import FlatRow
from studies.output.result import Result, of_record
from studies.sensing import field_readings
from studies.simulation import state_rows

if TYPE_CHECKING:
    from fem.accuracy import Accuracy
    from fem.analyses.force_targets import ForceTarget
    from fem.scene import Scene
    from geometry.mesh import MagnetCells

MOST_STEPS = 1000
"""Largest number of steps: a larger one is taken for a mistake, since each state takes a solve."""
MOVED = ("depth_mm", "shear_mm", "shear_y_mm")
"""Columns that distinguish the states of a path."""
FIRST = ("status", *MOVED, "force_N", "shift_mm")
"""Columns that a table of states shows even in a narrow terminal."""
UNSHOWN = (
    *state_rows.FACTS,
    *("sideways_stiffness_ratio", "sideways_stiffness_ratio_half_width", "crease_ratio_error_estimate", "made_for"),
)
"""Columns that only JSON and wide tables show."""


def loads_of(motion: Motion) -> list[Load]:
    """Return the loads that the options of `magtip solve` mean, in the order in which they are applied.

    >>> [load.depth for load in loads_of(Motion(depth=1.0, steps=2))]
    [0.5, 1.0]
    >>> [load.shear_x for load in loads_of(Motion(depth=1.0, steps=2, load={"shear": 1.0}))]
    [0.5, 1.0]
    """
    slides = bool(motion.load.get("shear") or motion.load.get("shear_y"))
    if motion.depths is None and motion.depth is None and "grip" not in motion.load:
        raise BadInput("no load is given: add --depth D in mm, --force F in N, or --grip HEIGHT with --shear X")
    if "grip" in motion.load and not slides:
        raise BadInput("--grip needs a shear: add --shear X in mm")
    _check_apart(motion)
    full = load_of({"depth": motion.depth or 0.0, **motion.load})
    if motion.depths is not None:
        return [replace(full, depth=value) for value in user_input.parse_numbers("--depths", motion.depths)]
    shares = shares_of(motion.steps)
    if slides:
        return [replace(full, shear_x=share * full.shear_x, shear_y=share * full.shear_y) for share in shares]
    return [replace(full, depth=share * full.depth) for share in shares]


def ineffective_options(motion: Motion, method: Method) -> list[tuple[str, str]]:
    """Return each option that has no effect, with the reason."""
    options = []
    if method.store is not None and method.mesh is not None:
        options.append(("--store", "states on a mesh of one's own are solved each time"))
    sideways = (motion.load.get("shear"), motion.load.get("shear_y"), motion.shear_force, motion.shear_force_y)
    if motion.load.get("friction") == "stick" and not any(sideways):
        options.append(("--friction stick", "it acts only during a shear, and this load has none"))
    if method.mesh is not None and method.wanted.name != "standard" and "grip" not in motion.load:
        options.append(("--accuracy", "the mesh comes from --mesh"))
    return options


_ASIDE = "{0} is a displacement and cannot be combined with {1}: give the force along the plate with {2} in N"
EXCLUDED = (
    ("force", "forces", "{1} and {0} exclude each other: give only one"),
    (
        "force forces",
        "depth depths",
        "{1} and {0} exclude each other, because the force decides the depth: give only one",
    ),
    ("force forces", "grip", "{0} has no plate that presses with a force: leave {1} or {0} out"),
    ("force forces", "shear shear_y", _ASIDE),
    (
        "forces",
        "steps shear_force shear_force_y",
        "{1} is for presses only and cannot be combined with {0}: give one --force instead",
    ),
    ("depths", "depth", "{0} and {1} exclude each other: give only one"),
    ("grip", "friction imperfection plate_tilt", "{0} has no meaning with {1}, which has no plate: leave {0} out"),
    (
        "depths",
        "steps shear shear_y",
        "{1} is for presses only and cannot be combined with {0}: give one --depth instead",
    ),
)
"""Options that exclude others, and the sentence on one of these ({0}) beside one of those ({1}); {2} is the force in
place of a displacement."""


def _check_apart(motion: Motion) -> None:
    given = {name for name in Motion.__dataclass_fields__ if getattr(motion, name) != getattr(Motion(), name)}
    given |= set(motion.load)
    option = {name: f"--{name.replace('_', '-')}" for name in given}
    for ones, others, sentence in EXCLUDED:
        for one, other in itertools.product(ones.split(), others.split()):
            if one in given and other in given:
                force = option[other].replace("shear", "shear-force")
                raise BadInput(sentence.format(option[other], option[one], force))


def shares_of(steps: int | None) -> list[float]:
    """Return the shares of a load that --steps reaches one after the other; default: the whole."""
    count = 1 if steps is None else steps
    if not 1 <= count <= MOST_STEPS:
        raise BadInput(f"--steps must be a whole number between 1 and {MOST_STEPS}; got {steps}")
    return [(k + 1) / count for k in range(count)]


# Loads that reach a force


def targets_of(motion: Motion) -> list[ForceTarget]:
    """Return the forces that the options of `magtip solve` mean, in their order; empty where no force is given.

    >>> [target.force for target in targets_of(Motion(force=3.0, steps=3))]
    [1.0, 2.0, 3.0]
    """
    if motion.force is None and motion.forces is None:
        if motion.shear_force is not None or motion.shear_force_y is not None:
            raise BadInput("--shear-force is applied after a press to a normal force: add --force F in N")
        return []
    _check_apart(motion)
    from fem.analyses.force_targets import ForceTarget

    sheared = bool(motion.shear_force or motion.shear_force_y)
    load = load_of({"friction": "stick" if sheared else "none", **motion.load})
    if motion.forces is not None:
        return [ForceTarget(force, None, load) for force in user_input.parse_numbers("--forces", motion.forces)]
    force, shares = motion.force or 0.0, shares_of(motion.steps)
    if not sheared:
        return [ForceTarget(share * force, None, load) for share in shares]
    x, y = motion.shear_force or 0.0, motion.shear_force_y or 0.0
    return [ForceTarget(force, (share * x, share * y), load) for share in shares]


def approximate_loads(targets: Sequence[ForceTarget]) -> list[Load]:
    """Return loads of the kinds of the targets, before their depths and shears are known."""
    return [target.load_at(0.0, 0.0 if target.shear_force is None else 1.0) for target in targets]


# Solves


def columns(loads: Sequence[Load], targets: Sequence[ForceTarget] = ()) -> list[str]:
    """Return the columns for a table of several states: the loads that vary, or their targets, and the response."""
    numbers = {column: spec.name for column, spec in OF_STATES.items() if isinstance(spec.default, float)}
    acting = [column for column, name in numbers.items() if any(getattr(load, name) for load in loads)]
    plate, aside = loads[0].grip is None, any(load.shear_y for load in loads)
    return [
        "status",
        *["target_force_N"] * bool(targets),
        *dict.fromkeys([*["depth_mm"] * plate, *acting]),
        *("force_N", "shift_mm", "tilt_rad"),
        *["tilt_y_rad"] * aside,
        *["contact_radius_mm"] * plate,
        *["slip_share"] * (loads[0].coulomb is not None),
        *("error_estimate", "shift_error_estimate", "tilt_error_estimate"),
        *["sideways_error_estimate"] * any(load.shear for load in loads),
        "seconds",
    ]


def solve(
    design: Design,
    loads: list[Load],
    method: Method,
    *,
    out: Path | None,
    picture: Path | None,
    progress: Progress,
    targets: Sequence[ForceTarget] = (),
) -> Generator[FlatRow]:
    """Solve the loads one after the other, and yield the row of each state as soon as it is reached.

    States come from the store, default: the user's, and are kept there (`mechanics.stored_answers`). The files, .vtu
    and .png, show the last state, which is solved for them if it came from the store. They are also written after an
    interruption, or if the caller closes the generator. Of targets, forces that the states must have, `loads` are
    loads of the same kind.
    """
    from fem.scene import Scene

    files = (
        None if out is None else atomic_files.check_output_file(out, ".vtu"),
        None if picture is None else atomic_files.check_output_file(picture, ".png"),
    )
    method, mesh = _read_mesh(design, method)
    level = _level(loads, method)
    if targets:
        states = _held(design, targets, method, level, mesh, progress)
        loads = [target.load for target in targets]
    else:
        scene = Scene(design, tuple(loads), level, method.magnet, method.model, mesh)
        states = _walked(scene, method.store, progress)
    return _rows(design, loads, method, states, *files, targets=targets)


def _held(
    design: Design,
    targets: Sequence[ForceTarget],
    method: Method,
    level: Accuracy,
    mesh: Any,
    progress: Progress,
) -> Iterator[Solution]:
    if mesh is not None:
        from fem.analyses.force_targets import walk_forces

        yield from walk_forces(
            design, targets, level, magnet=method.magnet, model=method.model, progress=progress, mesh=mesh
        )
        return
    with stores.opened(method.store) as states:
        yield from stored_answers.held(design, targets, level, method.magnet, method.model, states, progress)


def _walked(scene: Scene, store: Path | None, progress: Progress) -> Iterator[Solution]:
    if not stored_answers.is_kept(scene):
        from fem import equilibrium

        yield from equilibrium.walk(scene, progress=progress)
        return
    with stores.opened(store) as states:
        yield from stored_answers.walked(scene, states, progress)


def _read_mesh(design: Design, method: Method) -> tuple[Method, Any]:
    """Return the method with the model that suits the mesh in its file, and the mesh over D; None without a file."""
    if method.mesh is None:
        return method, None
    from geometry.meshing import mesh_import

    parts: MagnetCells = "hole" if method.magnet == "rigid" else "none"
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
    from fem import accuracy as accuracy_levels
    from fem.scene import MOST_HARMONICS, choose_model

    level, harmonics = accuracy_levels.LEVELS[method.wanted.name], method.harmonics
    if harmonics is None:
        return level
    if not 0 <= harmonics <= MOST_HARMONICS:
        raise BadInput(f"--harmonics must be a whole number between 0 and {MOST_HARMONICS}; got {harmonics}")
    model = choose_model(loads, method.model)
    if model != "harmonic":
        raise BadInput(f"--harmonics is for model harmonic, but this load uses model {model}: take --model harmonic")
    if harmonics == 0 and any(load.shear for load in loads):
        raise BadInput("--harmonics must be 1 or more for a shear; got 0")
    return replace(level, harmonics=harmonics)


def _rows(
    design: Design,
    loads: list[Load],
    method: Method,
    states: Iterator[Solution],
    vtu: Path | None,
    png: Path | None,
    targets: Sequence[ForceTarget] = (),
) -> Generator[FlatRow]:
    last: Solution | None = None
    reached = 0
    with atomic_files.sole_writer(vtu, png):
        try:
            for last in states:
                reached += 1
                yield state_rows.solved_row(design, method.magnet, last)
        except SolveFailed as error:
            # no mesh, for instance: the row says so, and the exit status is that of a failed solve
            lost: dict[str, Any] = {"status": "not_converged", "message": str(error), "stop": "no_mesh"}
            yield state_rows.state_row(design, method.magnet, loads[reached], None, method.model, **lost)
        except ForceOutOfReach as error:
            last, reached = error.state, reached + 1
            row = state_rows.solved_row(design, method.magnet, last)
            yield row | {"status": "out_of_reach", "message": str(error)}
        finally:
            if last is not None and (vtu or png):
                _show(last, targets[reached - 1] if targets else None, design, method, vtu, png)


def _show(
    last: Solution, target: ForceTarget | None, design: Design, method: Method, vtu: Path | None, png: Path | None
) -> None:
    """Write the files of a deformed body."""
    if last.field is None:
        last = _body(design, target or last.load, method)
    if vtu is not None:
        vtk_files.write_field(vtu, last)
    if png is not None:
        from studies.output.solution_pictures import section_picture

        section_picture(png, design, last, magnet=method.magnet)


def _body(design: Design, wanted: Load | ForceTarget, method: Method) -> Solution:
    """Solve for the deformed body of a kept state, which the store does not hold, without error estimates."""
    if isinstance(wanted, Load):
        from fem.equilibrium import trace

        level = _level([wanted], method)
        return trace(design, [wanted], level, magnet=method.magnet, model=method.model, estimate=False)[-1]
    from fem.analyses.force_targets import walk_forces

    level = _level(approximate_loads([wanted]), method)
    try:
        return next(walk_forces(design, [wanted], level, magnet=method.magnet, model=method.model, estimate=False))
    except ForceOutOfReach as error:
        return error.state


def loads_at_quick(design: Design, targets: Sequence[ForceTarget], method: Method, progress: Progress) -> list[Load]:
    """Return the loads of the targets as accuracy quick finds them, by which a model is chosen for a tolerance."""
    from fem.accuracy import QUICK

    with stores.opened(method.store) as states:
        found = stored_answers.held(design, targets, QUICK, method.magnet, "auto", states, progress)
        return [state.load for state in found]


def with_targets(rows: Generator[FlatRow], targets: Sequence[ForceTarget]) -> Generator[FlatRow]:
    """Yield the rows of states with the columns of their targets; closing this generator closes `rows`."""
    with contextlib.closing(rows):
        for row, target in zip(rows, targets, strict=False):
            shear = target.shear_force
            yield row | {
                "target_force_N": target.force,
                "target_shear_force_N": None if shear is None else list(shear),
            }


def in_words(rows: Generator[FlatRow]) -> Generator[FlatRow]:
    """Yield the rows with the word unknown for the error of a number that has no estimate; closing closes `rows`."""
    numbers = state_rows.estimated_numbers()
    with contextlib.closing(rows):
        for row in rows:
            yield row | {column: "unknown" for column, number in numbers.items() if _unsure(row, column, number)}


def _unsure(row: FlatRow, column: str, number: str) -> bool:
    """Return whether the error of a number is unknown; one that is zero by symmetry has none."""
    value = row.get(number)
    exists = value is not None if column.startswith("slip_share") else any(np.ravel(value or 0.0))
    return exists and row.get(column) is None


def unshown(targets: Sequence[ForceTarget]) -> tuple[str, ...]:
    """Return the columns without values, which a table does not show."""
    sheared = any(target.shear_force for target in targets)
    return (
        *["depth_error_estimate"] * (not targets),
        *["shear_error_estimate", "target_shear_force_N"] * (not sheared),
    )


def held_force(record: FlatRow) -> str:
    """Return how the plate moved during a shear that held the normal force, in a sentence; empty without a shear."""
    if record["target_shear_force_N"] is None or record["force_N"] is None:
        return ""
    shear = math.hypot(record["shear_mm"], record["shear_y_mm"])
    return (
        f"The plate held the normal force of {record['target_force_N']:.4g} N during the shear of {shear:.4g} mm, "
        f"which ends at a depth of {record['depth_mm']:.4g} mm."
    )


def analytic(design: Design, load: Load, level: str) -> Result:
    """Return the response by the formulas of a level, with the readings of the Hall elements."""
    from analytic import beam, hall

    response = beam.solve(design, load, level)
    readings = hall.readings(design, response) if design.shape.has_magnet else None
    warnings = field_readings.warnings(design, readings, response.shift, response.rotation) if readings else []
    said = beam.outside(design, load, level)
    row = state_rows.formula_row(design, load, response, readings, level=level, message=said, warnings=warnings)
    return of_record("Formulas", row, (*state_rows.FACTS, "made_for"))
