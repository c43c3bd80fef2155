"""The verbs of many designs and of pages: sweep, sensitivity, demo, report, explore."""

from __future__ import annotations

import dataclasses
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from geometry.bad_input import no_effect
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.cli.parameters import Call, Source, say_if_without_magnet, verb
from studies.inputs import user_input
from studies.inputs.option_groups import Calibration, Sensitivity, Solves, StoreFile, Sweep, Whole
from studies.inputs.user_input import warn_of_values
from studies.models import choice
from studies.output import atomic_files, console, own_files, provenance
from studies.output.result import FAILED, GOOD, Destination, Result, check_files, of_record, publish, show

if TYPE_CHECKING:
    from studies.calibration.sensor_fit import Fit
    from studies.parts.requirements import Requirements
    from studies.sensing.array_readings import Grid
    from studies.web.explorer_server import Measuring

MODELS = Parameter(
    help=f"Models side by side, such as quick,standard,paper,finite: {choice()}; default: standard,paper."
)
Study = Annotated[str | None, Parameter(name="STUDY", help="TOML file of a study; with --axis, a design.")]


@verb(
    "sets wide as_json",
    out="Folder for the table (sweep.csv, or sweep.parquet beyond 20 000 rows) and the pictures.",
    at=2,
)
def sweep(
    call: Call,
    source: Study = None,
    /,
    *,
    options: Sweep = Sweep(),
    models: Annotated[str | None, MODELS] = None,
    solves: Solves = Solves(),
    retry_failed: bool = False,
) -> int:
    """Run finite elements and formulas over many designs and loads, one row per case.

    Run a study by magtip sweep STUDY.toml, or without a file by magtip sweep --axis D=6,8,10 --depth 1. Options
    override the values of a study. Solved states are kept: no sweep solves a state again. The exit status is 3 if a
    case has another status than ok; all have their rows all the same.

    Parameters
    ----------
    retry_failed
        Solve again the cases whose process died.
    """
    from studies.answers import SweepColumns
    from studies.mechanics.executor import SchedulerLost
    from studies.mechanics.solve_plan import Processes
    from studies.sweeps import sweep as study

    here = call.here(study.FILES, [options.design])
    processes = Processes(solves.workers, solves.scheduler, retry_failed)
    plan = study.plan_of(source, options, call.sets, models)
    warn_of_values(plan.design)
    check_files(here)
    atomic_files.check_apart([solves.store], here.inputs)
    if plan.magnet == "rigid" and any(model.states_errors for model in plan.models):
        say_if_without_magnet(plan.design)
    shown = study.Shown(plan)
    try:
        with (
            console.progress(as_json=call.as_json) as progress,
            study.opened(plan, call.out, progress, processes, solves.store) as batches,
        ):
            for batch in batches:
                for row in shown.add(batch):
                    if call.as_json:
                        console.report([row], as_json=True)
            if call.out is not None:
                named = SweepColumns.of_plan(plan).record
                provenance.write(call.out, here.command, dataclasses.asdict(plan.design), sweep=named)
    except SchedulerLost as error:
        return show(replace(shown.result(), failures=[str(error)]), here)
    except BaseException:
        # after Ctrl-C the screen has what was solved
        show(shown.result(), here)
        raise
    whole = call.as_json or call.wide or call.out is not None
    warnings = [no_effect([f"axis {name}"], reason) for name, reason in study.idle_axes(shown, whole=whole)]
    show(replace(shown.result(), warnings=warnings, remarks=shown.remarks()), here)
    return GOOD if shown.is_good else FAILED


@verb("source sets wide as_json", out="Folder for SENSITIVITY.md, tables and pictures.", at=1)
def sensitivity(
    call: Call,
    *,
    options: Sensitivity,
) -> int:
    """Show which input matters most, and how much made sensors differ within their tolerances.

    Sobol indices come from a fast model, Morris' effects from finite elements, whose solved states are kept: an
    interrupted study continues. A Monte Carlo of tolerances predicts the spread of the calibration of made sensors.
    """
    from studies.parts import part_tolerances
    from studies.sensitivity import sensitivity_study
    from studies.sensitivity.beam_motions import Press

    here = call.here(sensitivity_study.FILES)
    design = call.design()
    sizes = part_tolerances.parse_tolerances(options.tolerances or [], design, call.source)
    chosen = tuple(dict.fromkeys(part.strip() for part in options.methods.split(",")))
    request = sensitivity_study.Request(
        design=design,
        ranges=sensitivity_study.ranges_of(design, options.vary or [], chosen, sizes),
        load=Press(options.depth, options.shear),
        methods=chosen,
        tolerances=sizes,
        parts=part_tolerances.parts_of_file(design, call.source),
        sampling=options.sampling,
        solves=options.solves,
    )
    store = options.solves.store
    if store is not None and "morris" not in chosen:
        raise BadInput("--store works with the method morris only: add it to --methods, or leave --store out")
    atomic_files.check_apart([store], [call.source])
    return publish(partial(sensitivity_study.run, request), here)


@verb()
def demo(call: Call, *, out: Path = Path("out/demo")) -> int:
    """Study the paper's sensor from start to end: CAD, mould, mesh, finite elements, formulas, comparison, report.

    Parameters
    ----------
    out
        Output folder.
    """
    from studies import demo as study

    own_files.check(out, study.WRITTEN)
    with atomic_files.filled(out) as folder, console.progress(as_json=False) as progress:
        outcome = study.run(folder, command=call.command, progress=progress)
    lost = outcome["status"] != "ok"
    result = Result(
        title="Demo",
        records=[],
        shown=[
            *(f"- {sentence}" for sentence in outcome["summary"]["sentences"]),
            f"All results are in {out}; start with REPORT.md.",
        ],
        failures=[f"part of the demo failed: {outcome['message']}"] if lost else [],
    )
    return show(result, Destination())


Results = Annotated[
    Path, Parameter(name="DIR", help="Folder of results that other verbs wrote, with its sub-folders.")
]


@verb("as_json", out="File of the page, .html; default: report.html in the folder.", at=1)
def report(call: Call, folder: Results, /, *, no_solve: bool = False) -> int:
    """Make one HTML page of a folder of results, with figures that can be read off and the deformed sensor in 3D.

    The page needs no network. It shows whatever the folder and its sub-folders hold: comparisons, sweeps and their
    error maps, the chart of cost and error, robustness, verification, maps of the beam assumption, claims, sizing,
    uncertainty, arrays and surroundings, with versions and commands. What it leaves out it names.

    Parameters
    ----------
    no_solve
        Solve nothing: no figure in 3D where a folder names a sensor but holds no solution; default: solve it.
    """
    from studies.web import report_page

    def study(progress: Progress) -> Result:
        page = report_page.report(folder, call.out, command=call.command, solve=not no_solve, progress=progress)
        return of_record("Report", page)

    return publish(study, call.screen)


@verb("sets")
def explore(
    call: Call,
    source: Source = "paper",
    /,
    *,
    port: Whole = 0,
    no_browser: bool = False,
    export: Path | None = None,
    calibration: Calibration | None = None,
    store: StoreFile | None = None,
) -> int:
    """Open a page on which a sensor and its load are changed by hand, solved by finite elements meanwhile.

    The page is served to this computer only, until Ctrl-C, and works without a network. With a file of requirements
    (see magtip size) it opens a variant that meets them, or nearly, under the largest required load, and shows what
    each requirement leaves; with a design file that states its requirements, such as winner.toml, it opens that one.
    Of a design file with a table [array] it shows all beams from above: choose one, and set its load.

    Parameters
    ----------
    port
        Port of the page; default: any free one.
    no_browser
        Print the address of the page, but do not open it.
    export
        Write the page of this one design as a file (.html) that needs no server: depth, shear and direction move
        between states that are solved beforehand, in a minute or more.
    """
    if export is not None and (port or no_browser):
        option = "--port" if port else "--no-browser"
        raise BadInput(f"--export writes a file without a server, for which {option} has no meaning: leave it out")
    if export is not None and calibration is not None:
        raise BadInput("--calibration works with the page of a server: leave --export out")
    atomic_files.check_apart([export, store], [source, calibration])
    from studies.sensing import array_readings
    from studies.web import required_margins

    with console.progress(as_json=False) as progress:
        design, needed = required_margins.sensor_of(source, call.sets, progress)
    stated = array_readings.stated_grid(source)
    if stated is not None:
        stated = replace(stated, pitch=None if stated.places else stated.pitch_of(design))
        if calibration is not None:
            raise BadInput(
                "--calibration takes that of a single sensor: leave it out, or take a design file without [array]"
            )
    made = None
    if calibration is not None:
        from studies.calibration import calibration_file

        made = calibration_file.of_design(calibration, design)
        design = made.design
    warn_of_values(design)
    if export is not None:
        if stated is not None:
            user_input.say_if_array(source)
        _export(design, export, store, of_array=stated is not None)
        return GOOD
    load = {} if needed is None else required_margins.opening_load(design, needed)
    serve_page(
        design, port=port, needed=needed, made=made, load=load, no_browser=no_browser, store=store, stated=stated
    )
    return GOOD


def serve_page(
    design: Design,
    measuring: Measuring | None = None,
    *,
    port: int = 0,
    needed: Requirements | None = None,
    made: Fit | None = None,
    load: Mapping[str, float] = MappingProxyType({}),
    no_browser: bool = False,
    store: Path | None = None,
    stated: Grid | None = None,
) -> None:
    """Serve the page of a design, and open it in the user's browser, until Ctrl-C."""
    from studies.web import explorer_server, state_exports

    changed = state_exports.address_fields(design) | {name: f"{value:g}" for name, value in load.items()}
    with tempfile.TemporaryDirectory(prefix="magtip-") as folder:

        def ready(address: str) -> None:
            print(f"{address}\n", end="", flush=True)
            console.note("The address is for this user of this computer only. Ctrl-C ends the explorer.")
            if not no_browser:
                _open(address, Path(folder, "explorer.html"))

        explorer_server.serve(changed, port, needed, made, ready, measuring, store, stated)


def _export(design: Design, path: Path, store: Path | None, *, of_array: bool) -> None:
    from studies.mechanics import store as stores
    from studies.web import offline_page

    file = atomic_files.check_output_file(path, ".html", ".htm")
    with console.progress(as_json=False) as progress, stores.opened(store) as states:
        offline_page.write(design, file, states, progress, of_array=of_array)
    console.note(f"{file}: open it in a browser; it needs no server and no network")


def _open(address: str, file: Path) -> None:
    """Open the page in the user's browser; say what to do if there is none.

    All users see the command lines of processes, and the address holds the token: the browser gets it from a file in
    a folder that only this user may read.
    """
    import html
    import webbrowser

    link = html.escape(address)
    file.write_text(
        f'<!DOCTYPE html>\n<meta charset="utf-8">\n<meta http-equiv="refresh" content="0; url={link}">\n'
        f'<title>magtip explore</title>\n<a href="{link}">magtip explore</a>\n',
        encoding="utf-8",
    )
    if webbrowser.open(file.as_uri()):
        console.note("If your browser shows no sensor, open the address in it.")
    else:
        console.note("No browser was found: open the address in one.")


SITE = Path(sys.prefix, "share", "doc", "magtip")
"""Where `make docs` installs the site. The wheel is without it: it would grow from 2.8 to 16 MB."""


@verb()
def help(
    call: Call,
    name: Annotated[str | None, Parameter(name="VERB", help="Verb; without one, all are listed.")] = None,
    /,
) -> int:
    """Open the page of a verb, with its picture and commands, in the browser; without the site, print its help.

    The site is there once make docs has built it, in the source of magtip.
    """
    import webbrowser

    from studies.cli import commands

    page = SITE / "docs" / "reference" / "verb" / f"{name}.html"
    if name and name in commands.app and page.exists() and webbrowser.open(page.as_uri()):
        print(page)
        return GOOD
    status = commands.run([*filter(None, [name]), "--help"])
    if name and status == GOOD and page.exists():
        console.say(f"magtip: no browser was found. The page of this verb is {page}.")
    elif name and status == GOOD:
        console.say(
            "magtip: the site has a page of this verb, with its picture, examples and columns. `make docs` in the "
            f"source of magtip builds the site; copied from out/docs to {SITE} it opens here."
        )
    return status
