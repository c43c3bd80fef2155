"""The verbs of mechanics: solve, analytic, stability, modes, compare, response, cycle, fit."""

from __future__ import annotations

import contextlib
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from geometry.design import BadInput, Design
from studies.cli.parameters import Call, say_if_without_magnet, verb
from studies.inputs import option_groups, user_input
from studies.inputs.option_groups import Body, Depth, Elements, Shear, ShearY, Wanted, Whole
from studies.inputs.study_input import load_of
from studies.inputs.user_input import say_no_effect
from studies.output import atomic_files, console
from studies.output.result import Result, failure_of, publish, show


@verb("source sets wide as_json", out="File (.vtu) for the deformed body of the last state.", at=2)
def solve(
    call: Call,
    *,
    motion: option_groups.Motion = option_groups.Motion(),
    method: option_groups.Method = option_groups.Method(),
    picture: Path | None = None,
) -> int:
    """Compute force, shift and tilt of the magnet by finite elements; print each state as soon as it is reached.

    If a solve stops early, the last converged state is printed and the exit status is 3. With --force and
    --shear-force the plate first presses by the force and then shears while it holds this force, until both are met;
    where they cannot be, the state that comes nearest is printed with the status out_of_reach. With --tolerance,
    formulas or the surrogate may replace the finite elements, and all states are printed at the end. With --force the
    model for a tolerance is chosen for the depth that accuracy quick finds, and only among finite elements.

    Parameters
    ----------
    picture
        File (.png) for the deformed section of the last state.
    """
    from studies.simulation import load_cases, within_tolerance

    design = call.design(method.magnet)
    atomic_files.check_apart([call.out, picture, method.store], [call.source, method.mesh])
    targets = load_cases.targets_of(motion)
    loads = load_cases.approximate_loads(targets) if targets else load_cases.loads_of(motion)
    for option, reason in load_cases.ineffective_options(motion, method):
        say_no_effect(option, reason)
    with console.progress(as_json=call.as_json) as progress:
        title, rows = within_tolerance.run(
            design, loads, method, targets, out=call.out, picture=picture, progress=progress
        )
        rows = rows if call.as_json else load_cases.in_words(rows)
        with contextlib.closing(rows):
            records = console.stream(
                rows,
                as_json=call.as_json,
                title=title,
                keys=load_cases.columns(loads, targets),
                count=len(loads),
                brief=(*load_cases.UNSHOWN, *load_cases.unshown(targets)),
                first=load_cases.FIRST,
                wide=call.wide,
            )
    notes = console.remarks(records, load_cases.MOVED) if len(loads) > 1 else []
    if targets and records and (held := load_cases.held_force(records[-1])):
        notes.append(held)
    # the records are printed as soon as they are reached
    result = Result(title=title, records=[], shown=notes, failures=failure_of(records))
    return show(result, call.screen)


@verb("source sets wide as_json", out="Folder for CONVERGE.md, tables and the picture.", at=4)
def converge(
    call: Call,
    *,
    motion: option_groups.Motion = option_groups.Motion(),
    magnet: Body = "rigid",
    levels: Whole = 5,
    ratio: float = 1.5,
) -> int:
    """Show how the answer to a load converges with the mesh: order, limit and its bar, and where the levels lie.

    The load is that of solve by depths. Where the three finest meshes do not converge monotonically, the limit is
    unknown.

    Parameters
    ----------
    levels
        Number of meshes, 4 to 8, not a name of a level; the first has the edge lengths of level quick.
    ratio
        Ratio of the edge lengths of a mesh to those of the next one.
    """
    from studies.simulation import load_cases, mesh_convergence

    if load_cases.targets_of(motion):
        raise BadInput("converge solves for a depth, the same on all meshes: give --depth in place of a force")
    design, loads = call.design(magnet), load_cases.loads_of(motion)
    study = partial(mesh_convergence.run, design, loads, magnet, levels, ratio)
    return publish(study, call.here(mesh_convergence.FILES))


@verb("source sets as_json")
def analytic(
    call: Call,
    *,
    depth: Depth,
    shear: Shear = 0.0,
    shear_y: ShearY = 0.0,
    level: str = "paper",
) -> int:
    """Compute force, shift of the magnet and readings by formulas; in a shear the tip sticks to the plate.

    Parameters
    ----------
    level
        Formulas, from the simplest to the most complete: paper, column, tip, magnet or finite.
    """
    from studies.simulation import load_cases

    design = call.design()
    if level == "paper" and design.law != "neo-hookean":
        say_no_effect("law", "level paper uses E only")
    load = load_of({"depth": depth, "shear": shear, "shear_y": shear_y})
    return publish(lambda _: load_cases.analytic(design, load, level), call.here())


@verb("source sets wide as_json", out="Folder for table, plot and STABILITY.md of --slenderness.")
def stability(
    call: Call,
    *,
    depth: Depth | None = None,
    elements: Elements = Elements(),
    slenderness: str | None = None,
) -> int:
    """Compute the depth at which a press buckles sideways; with --depth also the response to a small shear.

    Parameters
    ----------
    slenderness
        Values a,b,c of L/D: critical depths of beams of these lengths, beside Euler, Engesser and Haringx.
    """
    from studies.simulation import critical_depths

    design = call.design(elements.magnet)
    atomic_files.check_apart([elements.store], [call.source])
    if slenderness is not None:
        if depth is not None:
            raise BadInput("--depth and --slenderness exclude each other: give only one")
        if "L" in user_input.pairs("--set", call.sets, "D=10"):
            say_no_effect("L", "the lengths come from --slenderness")
        ratios = _slenderness_of(slenderness, design)
        here = call.here(critical_depths.FILES)
        return publish(partial(critical_depths.over_slenderness, design, elements, ratios), here)
    if call.out is not None:
        raise BadInput("--out works with --slenderness only: add --slenderness 1,2,3")
    return publish(partial(critical_depths.at_design, design, elements, depth), call.here())


def _slenderness_of(text: str, design: Design) -> list[float]:
    ratios = user_input.parse_numbers("--slenderness", text)
    if not min(ratios) > 0.5:
        raise BadInput(
            f"--slenderness must exceed 0.5, because L must exceed the tip radius D/2; got {min(ratios):g}"
        )
    longest = Design.__dataclass_fields__["L"].metadata["high"]
    if not min(ratios) * design.D <= longest:
        raise BadInput(
            f"--slenderness must be at most {longest / design.D:g} with D = {design.D:g} mm, because L is at most "
            f"{longest:g} mm; got {min(ratios):g}"
        )
    return ratios


@verb("source sets as_json")
def modes(
    call: Call,
    *,
    count: Whole = 8,
    depth: Depth = 0.0,
    elements: Elements = Elements(),
) -> int:
    """Compute natural frequencies and mode shapes of the sensor, free or pressed against a plate to which it sticks.

    Parameters
    ----------
    count
        Number of modes, 1 to 40; a pair of bending or ovalling modes counts once.
    """
    from studies.simulation import vibration_report

    design = call.design(elements.magnet)
    atomic_files.check_apart([elements.store], [call.source])
    study = partial(vibration_report.natural_frequencies, design, count, depth, elements)
    return publish(study, call.here())


@verb("source sets wide as_json", out="Folder for tables and plots.", at=0)
def compare(
    call: Call,
    *,
    wanted: Wanted = Wanted(),
) -> int:
    """Compare finite elements and formulas in a press and in a shear.

    The press has 12 steps to a depth of 3 D/8, or to 0.6 of the silicone on the axis if that is less. The shear has
    6 steps to 3 D/8 at a third of that depth. For other depths use magtip sweep --axis depth=a,b,c.
    """
    from fem.accuracy import LEVELS
    from studies.simulation import compare as study
    from studies.simulation import within_tolerance

    here = call.here(study.FILES)
    design = call.design()
    say_if_without_magnet(design)
    chosen = None
    if wanted.tolerance is not None:
        within_tolerance.check_alone({"--accuracy": wanted.accuracy})
        chosen = within_tolerance.choose_accuracy(design, study.default_loads(design), wanted.tolerance)
        within_tolerance.say(chosen)
    level = LEVELS[chosen.level_or_accuracy if chosen else wanted.name]
    options: dict[str, Any] = {"chosen": chosen, "accuracy": level}
    return publish(lambda progress: study.run(design, progress=progress, **options), here)


@verb("source sets wide as_json", out="Folder for response.csv, ladder.csv and the Bode plots.")
def response(call: Call, *, vibration: option_groups.Vibration = option_groups.Vibration()) -> int:
    """Compute the steady vibration of the pressed and sheared sensor: volts per mm and per N, resonances, bandwidth.

    The plate vibrates along z and along x about a state at rest, and x is the direction of the shear; --depth 0
    shakes the base of the free sensor. The silicone's loss factor or Prony branches are those of the design.
    """
    from studies.simulation import vibration_report

    here = call.here(vibration_report.FILES)
    atomic_files.check_apart([vibration.elements.store], [call.source])
    design = call.design(vibration.elements.magnet)
    study = vibration_report.study(design, vibration)
    say_if_without_magnet(design)
    return publish(study, here)


@verb("source sets wide as_json", out="Folder for cycle.csv, loops.csv and cycle.png.")
def cycle(call: Call, *, motion: option_groups.Cycle = option_groups.Cycle()) -> int:
    """Load and unload the sensor in time: loop of the force, its gap and area, drift, readings, decoded force.

    The silicone's loss factor or Prony branches are those of the design. The plate leaves skin that recovers too
    slowly, and touches it later in the next cycle.
    """
    from studies.simulation import cycle_findings

    here = call.here(cycle_findings.FILES, [motion.calibration])
    design, made = call.design(motion.elements.magnet), None
    if motion.calibration is not None:
        from studies.calibration import calibration_file

        if motion.elements.magnet != "rigid":
            raise BadInput("--magnet has no place beside --calibration, which is of a rigid one: leave it out")
        found = calibration_file.of_design(motion.calibration, design)
        design, made = found.design, partial(calibration_file.made_states, found)
    study = cycle_findings.study(design, motion, made)
    say_if_without_magnet(design)
    return publish(study, here)


COLUMNS = (
    "CSV of a uniaxial test: stretch, strain or strain_percent; nominal_stress_MPa, nominal_stress_kPa or "
    "nominal_stress_Pa. Of a relaxation test: time_s (ms, min, h); nominal_stress_MPa with a held stretch, or "
    "youngs_modulus_MPa or shear_modulus_MPa; optionally stretch and ramp_s. Of a dynamic test: frequency_Hz; "
    "storage_modulus_MPa and loss_modulus_MPa (of Young's modulus; shear_... of the shear modulus) or tan_delta."
)
Data = Annotated[str, Parameter(name="FILE", help=COLUMNS)]


@verb("wide as_json", out="Folder for the table, the plot and design.toml with the chosen law or branches.", at=4)
def fit(
    call: Call,
    data: Data,
    /,
    *,
    law: option_groups.LawName | None = None,
    stretch: float | None = None,
    ramp: float | None = None,
    nu: float = 0.4998,
) -> int:
    """Fit a silicone's laws to a uniaxial test, or its relaxation to a relaxation test or a dynamic test.

    A uniaxial test gives E and the laws, ranked, with the stretches where each is stable; two or three values from a
    data sheet are enough for laws with as few constants. The other tests give Prony branches, their number chosen by
    AICc, and the times and frequencies for which they speak. The names of the columns decide which test it is.

    AICc weighs the error of a fit against its number of constants; less is better. Those within 2 of the least AICc
    count as equally good, and of them the one with the fewest constants or branches comes first or is chosen.

    Parameters
    ----------
    law
        Law for design.toml; default: the best one that fits the test and is stable in the test and in a press to
        3/8 D.
    stretch
        Held stretch of a relaxation test with a stress, if no column has it.
    ramp
        Time in which the stretch of a relaxation test rose from t = 0 on, s, if no column has it; the fit accounts
        for the ramp. 0 states that a ramp is negligible.
    nu
        Poisson's ratio for which E is given.
    """
    from studies.simulation import material_fit, material_tests

    here = call.here(material_fit.FILES, [data])
    kind = material_tests.kind_of(data)
    uses = (("--law", law, "uniaxial"), ("--stretch", stretch, "relaxation"), ("--ramp", ramp, "relaxation"))
    for option, value, fits in uses:
        if value is not None and kind != fits:
            say_no_effect(option, f"{data} is a {kind} test")
    if kind == "uniaxial":
        return publish(partial(material_fit.laws, data, nu, law, here.command, wide=call.wide), here)
    return publish(partial(material_fit.branches, data, nu, stretch, ramp, here.command, wide=call.wide), here)
