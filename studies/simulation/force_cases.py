"""Forces on the command line: the targets that the options of `magtip solve` mean, and the columns of states."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Sequence
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.inputs import user_input
from studies.inputs.option_groups import Method, Motion
from studies.output.records import FlatRow
from studies.simulation import load_cases

if TYPE_CHECKING:
    from fem.analyses.force_targets import ForceTarget


def targets_of(motion: Motion) -> list[ForceTarget]:
    """Return the forces that the options of `magtip solve` mean, in their order; empty where no force is given.

    >>> [target.force for target in targets_of(Motion(force=3.0, steps=3))]
    [1.0, 2.0, 3.0]
    """
    if motion.force is None and motion.forces is None:
        if motion.shear_force is not None or motion.shear_force_y is not None:
            raise BadInput("--shear-force is applied after a press to a normal force: add --force F in N")
        return []
    _check_alone(motion)
    from fem.analyses.force_targets import ForceTarget

    sheared = bool(motion.shear_force or motion.shear_force_y)
    contact = load_cases.friction_of(motion.friction, "stick" if sheared else "none")
    load = Load(
        friction=contact, plate_tilt=load_cases.plate_tilt_of(motion.plate_tilt), imperfection=motion.imperfection
    )
    if motion.forces is not None:
        return [ForceTarget(force, None, load) for force in user_input.parse_numbers("--forces", motion.forces)]
    force, count = motion.force or 0.0, load_cases.count_of(motion.steps)
    shares = [(k + 1) / count for k in range(count)]
    if not sheared:
        return [ForceTarget(share * force, None, load) for share in shares]
    x, y = motion.shear_force or 0.0, motion.shear_force_y or 0.0
    return [ForceTarget(force, (share * x, share * y), load) for share in shares]


def _check_alone(motion: Motion) -> None:
    """Refuse options that exclude a force."""
    name = "--forces" if motion.force is None else "--force"
    if motion.force is not None and motion.forces is not None:
        raise BadInput("--force and --forces exclude each other: give only one")
    for other, value in {"--depth": motion.depth, "--depths": motion.depths}.items():
        if value is not None:
            raise BadInput(
                f"{name} and {other} exclude each other, because the force decides the depth: give only one"
            )
    if motion.grip is not None:
        raise BadInput(f"--grip has no plate that presses with a force: leave {name} or --grip out")
    for other, value in {"--shear": motion.shear, "--shear-y": motion.shear_y}.items():
        if value is not None:
            raise BadInput(
                f"{other} is a displacement and cannot be combined with {name}: give the force along the plate with "
                f"{other.replace('shear', 'shear-force')} in N"
            )
    if motion.forces is not None:
        others = {
            "--steps": motion.steps,
            "--shear-force": motion.shear_force,
            "--shear-force-y": motion.shear_force_y,
        }
        for other, value in others.items():
            if value is not None:
                raise BadInput(
                    f"--forces is for presses only and cannot be combined with {other}: give one --force instead"
                )


def approximate_loads(targets: Sequence[ForceTarget]) -> list[Load]:
    """Return loads of the kinds of the targets, before their depths and shears are known."""
    return [target.load_at(0.0, 0.0 if target.shear_force is None else 1.0) for target in targets]


def loads_at_quick(design: Design, targets: Sequence[ForceTarget], method: Method, progress: Progress) -> list[Load]:
    """Return the loads of the targets as accuracy quick finds them, by which a model is chosen for a tolerance."""
    from fem.accuracy import QUICK
    from fem.analyses.force_targets import walk_forces

    states = walk_forces(design, targets, QUICK, magnet=method.magnet, estimate=False, progress=progress)
    return [state.load for state in states]


def with_targets(rows: Generator[FlatRow], targets: Sequence[ForceTarget]) -> Generator[FlatRow]:
    """Yield the rows of states with the columns of their targets; closing this generator closes `rows`."""
    with contextlib.closing(rows):
        for row, target in zip(rows, targets, strict=False):
            shear = target.shear_force
            yield row | {
                "target_force_N": target.force,
                "target_shear_force_N": None if shear is None else list(shear),
            }


def columns(targets: Sequence[ForceTarget]) -> list[str]:
    """Return the columns for a table of several states."""
    shown = load_cases.columns(approximate_loads(targets))
    return [*shown[:1], "target_force_N", *shown[1:]]


def unshown(targets: Sequence[ForceTarget]) -> tuple[str, ...]:
    """Return the columns without values, which a table does not show."""
    return () if any(target.shear_force for target in targets) else ("target_shear_force_N",)


def change_of_force(record: FlatRow) -> str:
    """Return how the normal force changed during the shear, in a sentence; empty without a shear."""
    if record["target_shear_force_N"] is None or record["force_N"] is None:
        return ""
    before, after = record["target_force_N"], record["force_N"][2]
    shear = math.hypot(record["shear_mm"], record["shear_y_mm"])
    return (
        f"The normal force changed from {before:.4g} to {after:.4g} N during the shear of {shear:.4g} mm, at a fixed "
        f"depth of {record['depth_mm']:.4g} mm."
    )
