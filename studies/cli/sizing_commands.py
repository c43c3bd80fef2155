"""The verb that sizes a sensor from requirements: size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from geometry.design import BadInput
from studies.cli.parameters import AsJson, Wide, destination
from studies.inputs.option_groups import Whole
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console
from studies.output.result import check_files, show, write

Wanted = Annotated[str, Parameter(name="REQUIREMENTS", help="TOML file of requirements.")]

MOST = 4096
"""Largest population, number of generations, and number of solved points; more are taken for a mistake."""


def size(
    source: Wanted,
    /,
    *,
    out: Path,
    export: bool = False,
    population: Whole = 96,
    generations: Whole = 80,
    points: Whole = 16,
    sensors: Whole = 1000,
    accuracy: AccuracyName = "standard",
    store: Path | None = None,
    workers: Whole | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Find the variants that meet requirements: a Pareto front of range, resolution and size, confirmed by FEM.

    Magnets, Hall parts and silicones come from catalogues (see magtip catalogue). All points of the front are solved
    by finite elements; those that fail are not ranked. Exit status 3 if no variant meets all requirements: the
    message then names a smallest set that conflicts, and by how much each of them would have to give. After an
    interruption the same command solves no state again.

    Parameters
    ----------
    out
        Folder for SIZING.md, sizing.json, front.csv, yield.csv and front.png; the design file and parts of an earlier
        sizing are removed from it.
    export
        Write design file, mould and casting recipe of the best variant too.
    population
        Number of candidates in a generation of the search.
    generations
        Number of generations.
    points
        Largest number of points of the front that are solved; of more points, those far apart are taken.
    sensors
        Number of made sensors from which the yield of the best variant follows.
    accuracy
        Accuracy of the finite elements.
    store
        File that keeps all solved states; default: one of the user, which the environment variable MAGTIP_STORE can
        name.
    workers
        Number of processes that solve; default: one for each core.
    """
    from fem.accuracy import LEVELS
    from studies.exploration.needed_paths import Processes
    from studies.output.provenance import versions
    from studies.sizing import sizing_export, sizing_report, sizing_study
    from studies.sizing.front_search import Effort
    from studies.sizing.requirements import read_requirements

    here = destination(size, locals(), sizing_report.FILES)
    for name, value, least in (
        ("population", population, 8),
        ("generations", generations, 1),
        ("points", points, 1),
        ("sensors", sensors, 1),
    ):
        most = 100_000 if name == "sensors" else MOST
        if not least <= value <= most:
            raise BadInput(f"--{name} must lie between {least} and {most}; got {value}")
    requirements = read_requirements(source)
    for warning in requirements.warnings():
        console.warn(warning)
    check_files(here)
    atomic_files.check_apart([store], [source])
    sizing_export.check_parts(out)
    effort = Effort(population, generations, requirements.seed)
    settings = sizing_study.Settings(effort, LEVELS[accuracy], Processes(workers), store, points, sensors)
    origin = versions(("pymoo",))
    with atomic_files.filled(out, here.names) as folder, console.progress(as_json=as_json) as progress:
        sizing = sizing_study.run(requirements, settings, progress)
        # parts of earlier requirements must not stand beside a new result
        sizing_export.remove(folder)
        result = sizing_report.result_of(sizing, origin, here.command, wide=wide)
        progress(0.97, "SIZING.md, tables and front.png")
        write(result, folder, here.command)
        if export and sizing.winner is not None:
            made = sizing_export.export(sizing.winner.variant, requirements, folder, progress)
            lost = [made.message] if made.status != "ok" else []
            result = replace(result, warnings=made.warnings, failures=[*result.failures, *lost])
    return show(result, here)
