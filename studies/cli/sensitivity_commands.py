"""The verb for sensitivity and tolerances: sensitivity."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from geometry.design import BadInput
from studies.cli.parameters import AsJson, OwnStore, Scheduler, Sets, Source, Wide, Workers, design_of, destination
from studies.inputs.option_groups import DEPTH, Whole
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files
from studies.output.result import publish


def sensitivity(
    source: Source,
    /,
    *,
    vary: list[str] | None = None,
    depth: Annotated[float, DEPTH],
    shear: float = 0.0,
    methods: str = "sobol,montecarlo",
    tolerances: Annotated[list[str] | None, Parameter(name="--tolerance")] = None,
    model: str = "surrogate",
    accuracy: AccuracyName = "standard",
    count: Whole = 1024,
    trajectories: Whole = 10,
    sensors: Whole = 1000,
    seed: Whole = 0,
    out: Path | None = None,
    store: OwnStore = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Show which input matters most, and how much made sensors differ within their tolerances.

    Sobol indices come from a fast model, Morris' effects from finite elements, whose solved states are kept: an
    interrupted study continues. A Monte Carlo of tolerances predicts the spread of the calibration of made sensors.

    Parameters
    ----------
    vary
        Range of an input, NAME=low:high, of a field of the design, depth or shear; repeatable. Default: E, nu,
        remanence and size of the magnet within their tolerances. Methods sobol and morris use it.
    shear
        Displacement of the plate along x after the press, with the tip stuck to it, mm.
    methods
        Any of sobol, morris and montecarlo, separated by commas.
    tolerances
        Tolerance of a made sensor, NAME=VALUE, such as E=5 (percent) or magnet_x=0.1 (mm); repeatable.
    model
        Model of sobol and montecarlo: surrogate, or a level of the formulas (paper, column, tip, magnet, finite).
    accuracy
        Accuracy of the finite elements of morris.
    count
        Number of base points of sobol, a power of 2; each needs a point more for every input, and one more.
    trajectories
        Number of trajectories of morris; each has a solve for every input, and one more.
    sensors
        Number of made sensors of montecarlo.
    seed
        Seed of all random numbers, 0 or more.
    out
        Folder for SENSITIVITY.md, tables and pictures.
    """
    from studies.exploration.needed_paths import Processes
    from studies.sensitivity import sensitivity_report, sensitivity_request

    here = destination(sensitivity, locals(), sensitivity_report.FILES)
    request = sensitivity_request.request_of(
        design=design_of(source, sets),
        vary=vary or [],
        load=(depth, shear),
        methods=methods,
        tolerances=tolerances or [],
        model=model,
        accuracy=accuracy,
        counts=(count, trajectories, sensors),
        seed=seed,
    )
    if store is not None and "morris" not in request.methods:
        raise BadInput("--store works with the method morris only: add it to --methods, or leave --store out")
    atomic_files.check_apart([store], [source])
    return publish(partial(sensitivity_request.run, request, store, Processes(workers, scheduler)), here)
