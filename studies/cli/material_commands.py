"""The verb fit: a silicone's laws from a uniaxial test, its relaxation from a relaxation test or a dynamic test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.input_warnings import say_no_effect
from studies.inputs.option_groups import LawName
from studies.output import atomic_files, console
from studies.output.records import FlatRow
from studies.output.result import FAILED, GOOD

if TYPE_CHECKING:
    from studies.simulation.relaxation_fit import BranchRow

COLUMNS = (
    "CSV of a uniaxial test: stretch, strain or strain_percent; nominal_stress_MPa, nominal_stress_kPa or "
    "nominal_stress_Pa. Of a relaxation test: time_s (ms, min, h); nominal_stress_MPa with a held stretch, or "
    "youngs_modulus_MPa or shear_modulus_MPa; optionally stretch and ramp_s. Of a dynamic test: frequency_Hz; "
    "storage_modulus_MPa and loss_modulus_MPa (of Young's modulus; shear_... of the shear modulus) or tan_delta."
)
Data = Annotated[str, Parameter(name="FILE", help=COLUMNS)]


def fit(
    data: Data,
    /,
    *,
    law: LawName | None = None,
    stretch: float | None = None,
    ramp: float | None = None,
    out: Path | None = None,
    nu: float = 0.4998,
    wide: Wide = False,
    as_json: AsJson = False,
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
    out
        Folder for the table, the plot and design.toml with the chosen law or branches.
    nu
        Poisson's ratio for which E is given.
    """
    command_line = command(fit, locals())
    from studies.simulation import material_fit as study
    from studies.simulation import relaxation_test
    from studies.simulation.law_selection import WRONG, reasons

    atomic_files.check_apart(atomic_files.inside(out, study.FILES), [data])
    kind = relaxation_test.kind_of(data)
    uses = (("--law", law, "uniaxial"), ("--stretch", stretch, "relaxation"), ("--ramp", ramp, "relaxation"))
    for option, value, fits in uses:
        if value is not None and kind != fits:
            say_no_effect(option, f"{data} is a {kind} test")
    if kind != "uniaxial":
        return _fit_branches(data, nu, out, stretch, ramp, command_line, wide=wide, as_json=as_json)
    with atomic_files.results(out, study.FILES) as folder, console.progress(as_json=as_json) as progress:
        rows = study.run(data, nu, folder, law, progress, command_line)
    if as_json:
        console.report([row.row() for row in rows], as_json=True)
    else:
        _print_laws([row.texts() for row in rows], wide=wide)
        for reason in filter(None, (reasons(row.judged) for row in rows)):
            console.note(f"{reason}.")
    chosen = [row for row in rows if row.judged.chosen]
    for row in chosen or rows:
        for warning in row.warnings:
            console.warn(warning)
    if not chosen:
        console.say(
            "magtip: no law is chosen and no design.toml written: every fitted E is outside the range of a design, "
            f"or the law misses the test by more than {100 * WRONG:g} % of the largest stress"
        )
        return FAILED
    return GOOD


def _print_laws(rows: list[FlatRow], *, wide: bool) -> None:
    """Print the laws as three tables that fit into 80 columns, or as a wide one."""
    ranking = (
        "ranked by AICc"
        if rows[0]["ranked_by"] == "AICc"
        else "ranked by number of constants (too few points for AICc)"
    )
    title = f"Laws, best first, {ranking}"
    if wide:
        console.report(rows, as_json=False, title=title, wide=True)
        return
    fits = ("law", "chosen", "AICc", "rms_percent", "small_strain_excess_percent", "E_MPa")
    ranges = ("law", "stable_uniaxial", "stable_equibiaxial", "stable_planar")
    for name, keys in ((title, fits), ("Numbers", ("law", "numbers")), ("Stable stretches", ranges)):
        console.report([{key: row[key] for key in keys} for row in rows], as_json=False, title=name)
    if rows[0]["ranked_by"] == "AICc":
        console.note(
            "Laws within 2 of the least AICc count as equally good; those with the fewest constants come first."
        )


def _fit_branches(
    data: str,
    nu: float,
    out: Path | None,
    stretch: float | None,
    ramp: float | None,
    command_line: str,
    *,
    wide: bool,
    as_json: bool,
) -> int:
    """Fit Prony branches and print them; see `fit`."""
    from geometry.relaxation import range_text
    from studies.simulation import relaxation_fit as study
    from studies.simulation.material_fit import FILES

    with atomic_files.results(out, FILES) as folder:
        rows = study.run(data, nu, folder, stretch, ramp, command_line)
    (chosen,) = [row for row in rows if row.chosen]
    usable = study.is_usable(chosen)
    if as_json:
        console.report([row.row() for row in rows], as_json=True)
    else:
        _print_branches(rows, chosen, wide=wide)
        if usable:
            console.note("Lines for a design file:")
            for line in study.design_lines(chosen, nu):
                console.note(f"  {line}")
        if chosen.fit.count:
            console.note(f"The branches speak for {range_text(chosen.fit.relaxation)}.")
    for warning in chosen.warnings:
        console.warn(warning)
    if usable:
        return GOOD
    reason = "E is outside the range of a design" if chosen.fit.count else "the test has no branches"
    if chosen.fit.count and chosen.fit.rms > study.WRONG:
        reason = f"the branches miss the test by more than {100 * study.WRONG:g} %"
    console.say(f"magtip: {reason}: no design.toml is written")
    return FAILED


def _print_branches(rows: Sequence[BranchRow], chosen: BranchRow, *, wide: bool) -> None:
    """Print the numbers of branches, the moduli with their confidence, and the chosen branches as tables."""
    table = [row.texts() for row in rows]
    if wide:
        console.report(table, as_json=False, title="Numbers of branches, least AICc first", wide=True)
    else:
        keys = ("branches", "chosen", "AICc", "rms_percent", "long_term_share")
        brief = [{key: row[key] for key in keys} for row in table]
        console.report(brief, as_json=False, title="Numbers of branches, least AICc first")
    console.note("Of the fits within 2 of the least AICc, the one with the fewest branches is chosen.")
    each = chosen.fit
    if chosen.test.has_modulus:
        moduli = (
            ("long-term", each.long_term, each.long_term_half_width),
            ("instantaneous", each.instantaneous, each.instantaneous_half_width),
        )
        lines = [[name, f"{value:.5g}", f"{width:.2g}"] for name, value, width in moduli]
        console.table("Young's modulus", ["modulus", "E (MPa)", "95 %: +- (MPa)"], lines)
    pairs = zip(each.relaxation.shares, each.relaxation.times, strict=True)
    branches = [[f"{g:.4g}", f"{tau:.4g}"] for g, tau in pairs]
    if branches:
        console.table("Branches", ["share g", "tau (s)"], branches)
