"""The studies of `magtip validate`, each with its page in a folder: do the answers hold, and what do they cost?"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial, update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from studies import validation
from studies.cli.parameters import AsJson, OwnStore, Scheduler, Wide, Workers, destination
from studies.inputs.option_groups import Whole
from studies.output import atomic_files
from studies.output.result import publish

MODULES = {
    "accuracy": "accuracy_study",
    "vibration": "vibration_check",
    "calibration": "calibration_check",
    "firmware": "firmware_check",
}
"""Modules of studies that have other names."""
KEYWORD = inspect.Parameter.KEYWORD_ONLY
Folder = Annotated[Path | None, Parameter(help="Folder for the page, tables and pictures of the study.")]


def __getattr__(name: str) -> Callable[..., int]:
    """Return the verb of a module of `studies.validation`: its `run`, whose docstring is the help, with --out.

    Such a module has a page template of its name, `FILES`, and options with defaults behind the progress of `run`.
    """
    module = MODULES.get(name, name)
    if not (Path(validation.__file__).parent / f"{module}.py").exists():
        raise AttributeError(name)
    study = import_module(f"studies.validation.{module}")
    _, *options = inspect.signature(study.run, eval_str=True).parameters.values()
    common = (("out", Folder, None), ("wide", Wide, False), ("as_json", AsJson, False))
    more = (inspect.Parameter(key, KEYWORD, default=value, annotation=kind) for key, kind, value in common)
    signature = inspect.Signature([*(one.replace(kind=KEYWORD) for one in options), *more], return_annotation=int)

    def verb(**given: Any) -> int:
        arguments = {key: given.get(key, one.default) for key, one in signature.parameters.items()}
        found = partial(study.run, **{one.name: arguments[one.name] for one in options})
        return publish(found, destination(verb, arguments, study.FILES, [arguments.get("store")]))

    update_wrapper(verb, study.run, ("__doc__",)).__name__ = name
    verb.__annotations__ = {key: one.annotation for key, one in signature.parameters.items()}
    vars(verb)["__signature__"] = signature
    return verb


def range_(
    *, quick: bool = False, count: Whole = 64, out: Folder = None, wide: Wide = False, as_json: AsJson = False
) -> int:
    """Make solids, mould and meshes of designs sampled over all input ranges; exit status 3 if one fails.

    Nothing of a run that was stopped is kept: start it again.

    Parameters
    ----------
    quick
        Use the first four designs: 15 seconds.
    count
        Number of sampled designs, 1 to 1024; 64 take some minutes.
    """
    from studies.validation import design_range as study

    return publish(partial(study.run, count=4 if quick else count), destination(range_, locals(), study.FILES))


def assumption(
    study: Annotated[
        Path | None, Parameter(name="STUDY", help="TOML file of a study; default: the shipped one.")
    ] = None,
    /,
    *,
    out: Folder = None,
    store: OwnStore = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Map where the paper's formulas, and every level above them, are within 5 and 10 % of finite elements."""
    from studies.mechanics.solve_plan import Processes
    from studies.validation import assumption as about

    source = study or about.STUDY
    here = destination(assumption, locals(), about.FILES, [source, store])
    atomic_files.check_apart([store], [source])
    found = partial(about.run, plan=about.plan_of(source), processes=Processes(workers, scheduler), store=store)
    return publish(found, here)


def trade(
    *,
    designs: Whole = 24,
    confirm: bool = False,
    quick: bool = False,
    out: Folder = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Measure cost and true error of every model over the range of designs; the rule of --tolerance follows.

    The store keeps all answers, so that a run that was stopped continues there; the costs, up to half an hour, are
    measured again.

    Parameters
    ----------
    designs
        Number of designs, 2 to 24.
    confirm
        Check the rule on 78 random designs; exit status 3 if a goal is missed.
    quick
        Use the section models at accuracy quick in presses and glued shears only: seconds instead of an hour.
    """
    from studies.validation import trade as study

    here = destination(trade, locals(), study.FILES)
    found = partial(study.run, designs=designs, confirm=confirm, quick=quick, command=here.command)
    return publish(found, here)


def bench(
    *,
    quick: bool = False,
    cases: str | None = None,
    peers: Path = Path("out/peers"),
    ccx: str = "ccx",
    out: Folder = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Measure time and memory at a given error beside FElupe, CalculiX and magpylib.

    A program that is not installed gets a row with its install command. Missed goals are listed; the exit status is
    then 3, also where a program is not installed.

    Parameters
    ----------
    quick
        Use medians of 3 runs instead of 5, and no references of shears.
    cases
        Run only some cases, with commas between their names: press-curve, half-press, half-press-magnet, half-shear,
        shear, friction, tilted-plate, small-shear, modes, field; default: all.
    peers
        Folder of a Python environment with FElupe: python3 -m venv DIR && DIR/bin/pip install felupe.
    ccx
        Command that runs CalculiX.
    """
    from studies.validation import bench as study

    chosen = [] if cases is None else [name.strip() for name in cases.split(",")]
    found = partial(study.run, bench=study.Bench(quick, peers, ccx), cases=chosen)
    return publish(found, destination(bench, locals(), study.FILES))


def surrogate(
    *,
    quick: bool = False,
    out: Folder = None,
    store: OwnStore = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Build the surrogate from finite elements, and test it on beams that it has not seen.

    From an empty store it took some 70 minutes on two busy cores; what is solved is kept, so that an interrupted
    study goes on. To ship the new surrogate, copy surrogate.npz from the folder to studies/mechanics.

    Parameters
    ----------
    quick
        Use few beams and coarser meshes: some minutes, and errors of 10 %.
    """
    from studies.mechanics import store as stores
    from studies.mechanics.solve_plan import Processes
    from studies.validation import surrogate_study as study

    here = destination(surrogate, locals(), study.FILES, [store])
    extent = study.FEW if quick else study.Extent()
    with stores.opened(store or stores.default()) as states:
        found = partial(study.run, extent=extent, states=states, processes=Processes(workers, scheduler))
        return publish(found, here)
