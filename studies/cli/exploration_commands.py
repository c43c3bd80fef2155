"""The verbs that work through many states or measurements: demo, compare, sweep, fit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from geometry.design import Design
from geometry.loads import Magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of, judged
from studies.cli.printed_command import command
from studies.exploration import sweep_axes
from studies.inputs.exit_status import FAILED, GOOD
from studies.inputs.input_warnings import say_no_effect, say_what_is_idle
from studies.inputs.option_groups import LawName
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console

Study = Annotated[str | None, Parameter(name="STUDY", help="A study's TOML file; with --axis, a design.")]
COLUMNS = "CSV: stretch, strain or strain_percent; nominal_stress_MPa, nominal_stress_kPa or nominal_stress_Pa."
Data = Annotated[str, Parameter(name="FILE", help=COLUMNS)]


def demo(*, out: Path = Path("out/demo")) -> int:
    """The main job on the paper's sensor: CAD, mould, mesh, finite elements, formulas, comparison, report.

    Parameters
    ----------
    out
        Folder of the results.
    """
    asked = command(demo, locals())
    from studies import demo as work

    with atomic_files.filled(out) as folder, console.progress(as_json=False) as progress:
        found = work.run(folder, command=asked, progress=progress)
    for sentence in found["summary"]["sentences"]:
        console.note(f"- {sentence}")
    console.note(f"All results are in {out}; start with REPORT.md.")
    if found["status"] != "ok":
        console.say(f"magtip: not all of it succeeded: {found['message']}")
        return FAILED
    return GOOD


def compare(
    source: Source,
    /,
    *,
    out: Path | None = None,
    accuracy: AccuracyName = "standard",
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Finite elements and formulas side by side, in press and in shear.

    A press in 12 steps to a depth of 3 D/8, or of 0.6 of the silicone on the axis if that is less; at a third of that
    depth a shear in 6 steps to 3 D/8. For other depths there is magtip sweep --axis depth=a,b,c.

    Parameters
    ----------
    out
        Folder of tables and plots.
    accuracy
        Of the finite elements.
    """
    given = design_of(source, sets)
    from fem.accuracy import LEVELS
    from studies.simulation import compare as work

    _say_what_is_ignored(given)
    atomic_files.check_apart(atomic_files.inside(out, work.FILES), [source])
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        summary = work.run(given, folder, accuracy=LEVELS[accuracy], progress=progress)
    if as_json:
        console.report([summary], as_json=True)
    else:
        for name in ("press", "shear"):
            sweep_axes.show(summary[name], name.capitalize(), wide=wide)
            _print_remarks(summary[name], summary[name])
    return judged([*summary["press"], *summary["shear"]])


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
    wide: Wide = False,
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
        Folder of the table and the plot, and of the solves, from which a sweep that was stopped goes on.
    """
    case = sweep_axes.grid_of(source, axis or [], design, depth, magnet, accuracy, sets or [])
    say_what_is_idle(case.design)
    atomic_files.check_apart(atomic_files.inside(out, sweep_axes.FILES), [source, design])
    if case.magnet == "rigid":
        _say_what_is_ignored(case.design)
    rows: list[dict[str, Any]] = []
    try:
        with console.progress(as_json=as_json) as progress:
            for row in sweep_axes.sweep(case, out, progress):
                rows.append(row)
                if as_json:
                    console.report([row], as_json=True)
    finally:
        if not as_json:
            sweep_axes.show(rows, "Sweep", wide=wide)
            _print_remarks([row for row in rows if row["status"] == "ok"], rows)
    for name, reason in sweep_axes.in_vain(rows, case.axes, whole=as_json or wide or out is not None):
        say_no_effect(f"axis {name}", reason)
    failed = [row for row in rows if row["status"] != "ok"]
    for reason in console.remarks(failed, sweep_axes.CASE, rows):
        console.say(f"magtip: {reason}")
    if failed:
        console.say(f"magtip: {len(failed)} of {len(rows)} cases failed")
    return GOOD if any(row.get("status") == "ok" for row in rows) else FAILED


def fit(
    data: Data,
    /,
    *,
    law: LawName | None = None,
    out: Path | None = None,
    nu: float = 0.4998,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """E and the law of a silicone from a uniaxial test: every law's fit, ranked, and where it is stable.

    Two or three values of a data sheet will do for the laws with as few constants.

    Parameters
    ----------
    law
        The law to choose. Default: of those that hit the test and are stable in it, the best that is stable in a
        press to 3/8 D too.
    out
        Folder of the table, the plot and design.toml, which holds the chosen law.
    nu
        Poisson's ratio that E is for.
    """
    asked = command(fit, locals())
    from studies.simulation import material_fit as work
    from studies.simulation.law_remarks import reasons

    atomic_files.check_apart(atomic_files.inside(out, work.FILES), [data])
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        records = work.run(data, nu, folder, law, progress, asked)
    if as_json:
        console.report(records, as_json=True)
    else:
        _print_laws([work.flat(record) for record in records], wide=wide)
        for reason in filter(None, map(reasons, records)):
            console.note(f"{reason}.")
    chosen = [record for record in records if record["chosen"]]
    for record in chosen or records:
        for warning in record["warnings"]:
            console.say(f"Warning: {warning}.")
    if not chosen:
        console.say("magtip: no law is chosen and there is no design.toml, for no E is one that a design may have")
        return FAILED
    return GOOD


def _print_laws(rows: list[dict[str, Any]], *, wide: bool) -> None:
    """Tables that a terminal of 80 columns holds, or a single one with all columns."""
    how = "by AICc" if rows[0]["ranked_by"] == "AICc" else "by fewest constants (too few points for AICc)"
    title = f"Laws, the best first {how}"
    if wide:
        console.report(rows, as_json=False, title=title, wide=True)
        return
    fits = ("law", "chosen", "AICc", "rms_percent", "small_strain_excess_percent", "E_MPa")
    ranges = ("law", "stable_uniaxial", "stable_equibiaxial", "stable_planar")
    for name, keys in ((title, fits), ("Numbers", ("law", "numbers")), ("Stable stretches", ranges)):
        console.report([{key: row[key] for key in keys} for row in rows], as_json=False, title=name)


def _print_remarks(rows: list[dict[str, Any]], among: list[dict[str, Any]]) -> None:
    for remark in console.remarks(rows, sweep_axes.CASE, among):
        console.note(remark)


def _say_what_is_ignored(design: Design) -> None:
    if not design.shape.has_magnet:
        console.say("magtip: the design has no magnet (magnet_diameter is 0): it is solved as all silicone")
