"""The command `magtip`: what its verbs take, check, call and print.

Exit status: 0 success, 2 bad input (one sentence on standard error), 3 a solve or a check failed, 130 interrupted,
1 a bug. Slow imports are made in the functions that need them.
"""

from __future__ import annotations

import io
import math
import os
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from geometry.design import BadInput
from geometry.scene import Magnet
from studies import console, describe, files, inputs, states
from studies.inputs import AccuracyName

GOOD, BAD, FAILED, INTERRUPTED, BROKEN_PIPE = 0, 2, 3, 130, 141

Source = Annotated[str, Parameter(name="DESIGN", help="A preset's name (paper) or a TOML file.")]
Study = Annotated[str | None, Parameter(name="STUDY", help="A study's TOML file; with --axis, a design.")]
Data = Annotated[str, Parameter(name="FILE", help="CSV: stretch or strain, and nominal_stress_MPa, _kPa or _Pa.")]
Sets = Annotated[list[str] | None, Parameter(name="--set", help="Override a field, KEY=VALUE; repeatable.")]
AsJson = Annotated[bool, Parameter(name="--json", help="Print JSON, one object per line, and nothing else.")]
Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]


def _version() -> str:
    from importlib.metadata import version

    return version("magtip")


app = App(
    name="magtip",
    help="Design, finite elements and formulas of soft magnetic three-axis force sensors. Units: mm and N.",
    version=_version,
    default_parameter=Parameter(negative=""),
    suppress_keyboard_interrupt=False,
)


def main(tokens: list[str] | None = None) -> int:
    """Run one command line (that of the process if not told) and return its exit status."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        status = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except (BadInput, CycloptsError) as error:
        console.say(f"magtip: {error}")
        return BAD
    except BrokenPipeError:
        # whoever read our output went away; nothing may be flushed into it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except OSError as error:
        name = repr(error.filename) if error.filename else "a file"
        console.say(f"magtip: cannot write or read {name} ({error.strerror or error}): choose another folder")
        return BAD
    except KeyboardInterrupt:
        console.say("magtip: interrupted; files that are complete stay")
        return INTERRUPTED
    return int(status or GOOD)


@app.command
def demo(*, out: Path = Path("out/demo")) -> int:
    """The main job on the paper's sensor: CAD, mould, mesh, finite elements, formulas, comparison, report.

    Parameters
    ----------
    out
        Folder of the results.
    """
    folder = files.output_folder(out)
    from studies import demo as work

    with console.progress(as_json=False) as progress:
        found = work.run(folder, progress=progress)
    for sentence in found["summary"]["sentences"]:
        print(f"- {sentence}")
    print(f"\nAll results are in {folder}; start with REPORT.md.")
    if found["status"] != "ok":
        console.say(f"magtip: not all of it succeeded: {found['message']}")
        return FAILED
    return GOOD


@app.command
def design(source: Source, /, *, sets: Sets = None, as_json: AsJson = False) -> int:
    """Every value of a design and where it comes from, derived values, what is assumed, warnings."""
    describe.show(inputs.read_design(source, sets or []), as_json=as_json)
    return GOOD


@app.command
def cad(source: Source, /, *, out: Path, sets: Sets = None, as_json: AsJson = False) -> int:
    """Write beam, silicone, magnet, mold_a and mold_b as .step, .stl and .3mf, and check the mould.

    Parameters
    ----------
    out
        Folder of the files.
    """
    given = inputs.read_design(source, sets or [])
    with console.progress(as_json=as_json) as progress:
        record = describe.build_cad(given, out, progress)
    describe.show_cad(record, as_json=as_json)
    return _judge([record])


@app.command
def mesh(
    source: Source, /, *, out: Path, size: float | None = None, sets: Sets = None, as_json: AsJson = False
) -> int:
    """Write the tetrahedral mesh of silicone and magnet as .vtu, and print its quality.

    Parameters
    ----------
    out
        A .vtu file.
    size
        Edge length away from features, mm; D/8 by default.
    """
    given = inputs.read_design(source, sets or [])
    with console.progress(as_json=as_json) as progress:
        record = describe.build_mesh(given, out, size, progress)
    console.report([record], as_json=as_json, title="Mesh")
    return _judge([record])


@app.command
def solve(
    source: Source,
    /,
    *,
    depth: float | None = None,
    depths: str | None = None,
    steps: float | None = None,
    shear: float | None = None,
    friction: str | None = None,
    grip: float | None = None,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    harmonics: int | None = None,
    accuracy: AccuracyName = "standard",
    out: Path | None = None,
    picture: Path | None = None,
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Force, shift and tilt of the magnet by finite elements; if that fails, the states reached, and status 3.

    Parameters
    ----------
    depth
        How far the plate comes down after first touch, mm.
    depths
        Several depths of a press, d1,d2,d3.
    steps
        N states on the way: of the depth, or with a shear, of the shear at the full depth.
    shear
        Sideways motion of the plate or the grip along x, mm.
    friction
        none, stick (the patch in contact is glued to the plate), or a Coulomb coefficient.
        By default none for a press, and stick when the plate shears.
    grip
        No plate: all surface points within this height of the tip are moved sideways, mm.
    magnet
        As a rigid body, or ignored: all silicone.
    model
        auto takes the smallest that can carry the load.
    harmonics
        Number of harmonics of the harmonic model.
    accuracy
        Of the mesh.
    out
        A .vtu file for the deformed body of the last state.
    picture
        A .png file for the deformed section of the last state.
    """
    given = inputs.read_design(source, sets or [], magnet=magnet)
    if harmonics is not None:
        raise BadInput("the harmonic model is not available yet: leave --harmonics out")
    loads = states.loads_of(depth=depth, depths=depths, steps=steps, shear=shear, friction=friction, grip=grip)
    with console.progress(as_json=as_json) as progress:
        records = states.solve(given, loads, accuracy, magnet, model, out=out, picture=picture, progress=progress)
    console.report(records, as_json=as_json, title="Finite elements", brief=states.DETAILS)
    return _judge(records)


@app.command
def analytic(
    source: Source,
    /,
    *,
    depth: float,
    shear: float = 0.0,
    level: str = "paper",
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Force, shift of the magnet and readings by formulas.

    Parameters
    ----------
    depth
        How far the plate comes down after first touch, mm.
    shear
        Sideways motion of the plate along x, mm; the tip sticks to it.
    level
        Which formulas: paper.
    """
    record = states.analytic(inputs.read_design(source, sets or []), depth, shear, level)
    console.report([record], as_json=as_json, title="Formulas")
    return GOOD


@app.command
def compare(
    source: Source,
    /,
    *,
    out: Path | None = None,
    accuracy: AccuracyName = "standard",
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Finite elements and formulas side by side, in press and in shear.

    Parameters
    ----------
    out
        Folder of tables and plots.
    accuracy
        Of the finite elements.
    """
    given = inputs.read_design(source, sets or [])
    folder = None if out is None else files.output_folder(out)
    from fem.equilibrium import LEVELS
    from studies import compare as work

    with console.progress(as_json=as_json) as progress:
        summary = work.run(given, folder, accuracy=LEVELS[accuracy], progress=progress)
    if as_json:
        console.report([summary], as_json=True)
    else:
        for name in ("press", "shear"):
            console.report([states.compared(row) for row in summary[name]], as_json=False, title=name.capitalize())
    return _judge([*summary["press"], *summary["shear"]])


@app.command
def sweep(
    source: Study = None,
    /,
    *,
    axis: list[str] | None = None,
    design: str | None = None,
    depth: float | None = None,
    magnet: Magnet | None = None,
    accuracy: AccuracyName | None = None,
    out: Path | None = None,
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Both models over a grid of D, L, f, E and the depth, one row per case.

    magtip sweep STUDY.toml runs a study; magtip sweep --axis D=6,8,10 --depth 1 does without a file. Options given
    beside a study replace its own values.

    Parameters
    ----------
    axis
        NAME=a,b,c with NAME one of D, L, f, E, depth; repeatable.
    design
        The design to vary: a preset or a TOML file; paper by default.
    depth
        Depth of the press where it is not an axis, mm.
    magnet
        As a rigid body (the default), or ignored.
    accuracy
        Of the finite elements; standard by default.
    out
        Folder of the table and the plot.
    """
    case = states.grid_of(source, axis or [], design, depth, magnet, accuracy, sets or [])
    with console.progress(as_json=as_json) as progress:
        rows = states.sweep(case, out, progress)
    shown = rows if as_json else [states.compared(row) for row in rows]
    console.report(shown, as_json=as_json, title="Sweep")
    failed = [row for row in rows if row["status"] != "ok"]
    for reason in dict.fromkeys(row["message"] for row in failed if row["message"]):
        console.say(f"magtip: {sum(row['message'] == reason for row in failed)} of {len(rows)} cases: {reason}")
    return GOOD if any(row.get("status") == "ok" for row in rows) else FAILED


@app.command
def fit(data: Data, /, *, out: Path | None = None, nu: float = 0.4998, as_json: AsJson = False) -> int:
    """E and the law of a silicone from a uniaxial test: every law's fit, ranked, and where it is stable.

    Parameters
    ----------
    out
        Folder of the table, the plot and design.toml, which holds the best law that is stable throughout.
    nu
        Poisson's ratio that E is for.
    """
    folder = None if out is None else files.output_folder(out)
    from studies import fit as work

    records = work.run(data, nu, folder)
    shown = records if as_json else [work.flat(record) for record in records]
    console.report(shown, as_json=as_json, title="Laws, the best first by AICc", brief=("warning",))
    for record in records:
        if record["warning"]:
            console.say(f"Warning: {record['warning']}.")
    return GOOD


@app.command
def verify(*, quick: bool = False, out: Path | None = None, as_json: AsJson = False) -> int:
    """Solve published and closed-form problems, and judge each against its tolerance; status 3 if one fails.

    Parameters
    ----------
    quick
        On coarser meshes: half a minute instead of four.
    out
        Folder of verify.csv and VERIFY.md.
    """
    folder = None if out is None else files.output_folder(out)
    from studies import verify as work

    with console.progress(as_json=as_json) as progress:
        rows = work.run(quick=quick, folder=folder, progress=progress)
    printed = rows if as_json else [work.shown(row) for row in rows]
    console.report(printed, as_json=as_json, title="Verification", brief=work.DETAILS)
    failed = [f"{row['target']} ({row['quantity']})" for row in rows if not row["passed"]]
    if failed:
        console.say(f"magtip: {len(failed)} of {len(rows)} targets are missed: {', '.join(failed)}")
    return FAILED if failed else GOOD


@app.command
def extremes(*, quick: bool = False, out: Path | None = None, as_json: AsJson = False) -> int:
    """Solve scenes at the edge of what is allowed: each must end in a right answer or a clear status, else status 3.

    Parameters
    ----------
    quick
        On quick accuracy and without the slow scenes: one minute.
    out
        Folder of extremes.csv and EXTREMES.md.
    """
    folder = None if out is None else files.output_folder(out)
    from studies import extremes as work

    with console.progress(as_json=as_json) as progress:
        rows = []
        for row in work.run(quick=quick, folder=folder, progress=progress):
            print(files.json_line(row) if as_json else work.line(row), flush=True)
            rows.append(row)
    failed = [row["scene"] for row in rows if not row["passed"]]
    if failed:
        console.say(f"magtip: {len(failed)} of {len(rows)} scenes end wrongly: {'; '.join(failed)}")
    return FAILED if failed else GOOD


@app.command
def accuracy(
    *, quick: bool = False, out: Path | None = None, minutes: float | None = None, as_json: AsJson = False
) -> int:
    """Error estimates and accuracy levels against much finer meshes on twelve designs; status 3 if a promise fails.

    Parameters
    ----------
    quick
        Two designs at level quick only: half a minute instead of an hour, against a rougher reference.
    out
        Folder of accuracy.csv, ACCURACY.md and a picture, and of the solves, from which a stopped run goes on.
    minutes
        Begin no further solve after this time, and report what there is.
    """
    folder = None if out is None else files.output_folder(out)
    from studies import accuracy as work
    from studies import calibration
    from studies.extremes import versions

    origin = versions()
    with console.progress(as_json=as_json) as progress:
        rows = work.run(
            quick=quick, folder=folder, minutes=math.inf if minutes is None else minutes, progress=progress
        )
    if folder is not None:
        calibration.write(folder, rows, origin, quick=quick)
    for name, table in (("Estimates", calibration.shares(rows)), ("Levels", calibration.summary(rows))):
        console.report(table, as_json=as_json, title=name)
    missed = calibration.verdicts(rows)
    if missed:
        console.say(f"magtip: {len(missed)} promises are not kept: {'; '.join(missed)}")
    return FAILED if missed else GOOD


def _judge(records: list[dict[str, Any]]) -> int:
    """0 if every state is reached, else 3 and a sentence."""
    failed = [record for record in records if record.get("status", "ok") != "ok"]
    if failed:
        console.say(f"magtip: {failed[-1].get('message') or 'the solve failed: ' + failed[-1]['status']}")
    return FAILED if failed else GOOD
