"""What `magtip fit` finds: laws of a uniaxial test, or branches of a relaxation or dynamic test, and a design file.

`laws` ranks the laws (`law_regression`, `law_selection`), and `branches` the numbers of Prony branches
(`branch_regression`). A law or a number of branches is a record; fit.csv has its lists as texts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.design import SILICONE_E, BadInput, Design
from geometry.messages import Progress
from geometry.relaxation import branches_text, range_text
from studies.output.atomic_files import write_text
from studies.output.figures import save
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, Texts
from studies.simulation import (
    branch_regression,
    fit_figures,
    law_regression,
    law_selection,
    relaxation_test,
    tensile_test,
)
from studies.simulation.branch_regression import BranchFit, thinned
from studies.simulation.law_regression import MISFIT, Fit, nominal_stress
from studies.simulation.law_selection import Judged
from studies.simulation.relaxation_test import Test
from studies.simulation.tensile_test import Specimen

FILES = ("fit.csv", "fit.png", "design.toml")
"""Files of a fit."""
MARK = "# fitted to "
"""First characters of a design file that this module writes."""
STILL_FALLING = 3.0
"""A branch longer than the longest time over this has not relaxed by the end of the test."""
WRONG = 0.05
"""Rms residual from which on branches do not describe the test, and are no design."""
AT_START = 1.02
"""Ratio of the shortest branch to the first time up to which it lies at the bound of the fit."""

# Laws of a uniaxial test


def laws(path: str, nu: float, asked: str | None, command: str, progress: Progress, *, wide: bool = False) -> Result:
    """Fit all laws to the uniaxial test in a file, the best first; at most one is chosen, and is in design.toml.

    Parameters
    ----------
    asked : the law that the user chooses.
    command : command line that design.toml names as its origin.
    wide : whether the terminal shows one wide table.
    """
    data = tensile_test.read(path)
    progress(0.0, "fits of all laws")
    judged = law_selection.choose(law_regression.fit(data, nu), data, asked)
    records = [law_record(each, data) for each in judged]
    texts = [_law_texts(each, record) for each, record in zip(judged, records, strict=True)]
    chosen = [each for each in judged if each.chosen]
    said = [f"{reason}." for reason in map(law_selection.reasons, judged) if reason]
    lost = (
        "no law is chosen and no design.toml written: every fitted E is outside the range of a design, or the law "
        f"misses the test by more than {100 * law_selection.WRONG:g} % of the largest stress"
    )
    files = {"fit.png": partial(_draw_laws, data=data, fits=[each.fit for each in judged], nu=nu)}
    if chosen:
        files["design.toml"] = partial(write_text, text=design_text(path, chosen[0].fit, nu, command))
    return Result(
        title="Laws",
        records=records,
        shown=[*_law_tables(texts, wide=wide), *said],
        tables={"fit": texts},
        files=files,
        warnings=[text for each in chosen or judged for text in law_selection.warnings(each, data)],
        failures=[] if chosen else [lost],
    )


def law_record(judged: Judged, data: Specimen) -> FlatRow:
    """Return the record of one law fitted to a test, with the properties of the test."""
    fit, warned = judged.fit, law_selection.warnings(judged, data)
    return {
        "rank": judged.rank,
        "law": fit.law,
        "chosen": judged.chosen,
        "AICc": fit.aicc,
        "rms_MPa": fit.rms,
        "rms_percent": 100 * fit.share,
        "E_MPa": fit.E,
        "numbers": fit.numbers,
        **{f"stable_{mode}": list(ends) for mode, ends in fit.stable.items()},
        "small_strain_excess_percent": 100 * fit.small,
        "compression_spread_percent": 100 * judged.spread,
        "constants": fit.constants,
        "points": int(data.telling.sum()),
        "exactly_determined": fit.exact,
        "least_strain_percent": 100 * data.least_strain,
        "ranked_by": fit.criterion,
        "at_bound": list(fit.bounded),
        "stable_in_test": judged.in_test,
        "stable_in_solve": judged.in_solve,
        "E_of_a_silicone": SILICONE_E[0] <= fit.E <= SILICONE_E[1],
        "not_chosen_because": list(judged.against),
        "stable_farther": judged.farther.law if judged.farther else None,
        "warnings": warned,
        "warning": "; ".join(warned),
    }


def _law_texts(judged: Judged, record: FlatRow) -> FlatRow:
    """Return a record for tables: numbers, ranges and lists as texts."""
    fit = judged.fit
    texts: FlatRow = {"numbers": ", ".join(f"{name}={value:.6g}" for name, value in fit.numbers.items())}
    texts |= {f"stable_{mode}": f"{low:.3g} to {high:.3g}" for mode, (low, high) in fit.stable.items()}
    texts |= {"at_bound": ", ".join(fit.bounded), "not_chosen_because": ", ".join(judged.against)}
    return {name: value for name, value in (record | texts).items() if name != "warnings"}


def _law_tables(rows: Sequence[FlatRow], *, wide: bool) -> list[Block]:
    """Return the laws as three tables that fit into 80 columns, or as a wide one."""
    by_AICc = rows[0]["ranked_by"] == "AICc"
    ranking = "AICc" if by_AICc else "number of constants (too few points for AICc)"
    title = f"Laws, best first, ranked by {ranking}"
    if wide:
        return [Table(title=title, rows=rows)]
    fits = ("law", "chosen", "AICc", "rms_percent", "small_strain_excess_percent", "E_MPa")
    ranges = ("law", "stable_uniaxial", "stable_equibiaxial", "stable_planar")
    tables: list[Block] = [
        Table(title=name, rows=[{key: row[key] for key in keys} for row in rows])
        for name, keys in ((title, fits), ("Numbers", ("law", "numbers")), ("Stable stretches", ranges))
    ]
    alike = "Laws within 2 of the least AICc count as equally good; those with the fewest constants come first."
    return [*tables, alike] if by_AICc else tables


def _draw_laws(path: Path, data: Specimen, fits: Sequence[Fit], nu: float) -> None:
    smooth = np.geomspace(min(1.0, data.stretch.min()), max(1.0, data.stretch.max()), 300)
    curves = {fit.law: (_stress(fit, smooth, nu), _stress(fit, data.stretch, nu)) for fit in fits}
    save(path, fit_figures.laws(data.stretch, data.stress, smooth, curves))


def _stress(fit: Fit, stretch: Array, nu: float) -> Array:
    """Return the nominal stress of a fitted law at stretches, MPa."""
    return fit.E / (2 * (1 + nu)) * nominal_stress(fit.law, tuple(fit.numbers.values()), stretch)


def design_text(path: str, fit: Fit, nu: float, command: str) -> str:
    """Return the text of the design file of a fit; it names the command."""
    values: dict[str, Any] = {"E": fit.E, "nu": nu, "law": fit.law, **fit.numbers}
    lines = [
        f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value!r}" for name, value in values.items()
    ]
    head = f"{MARK}{printable(Path(path).name)}: rms residual {100 * fit.share:.3g} % of the largest stress"
    return "\n".join([head, f"# by {printable(command)}", *lines, ""])


def printable(text: str) -> str:
    """Return the text without characters that a comment cannot contain."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


# Branches of a relaxation test or a dynamic test


def branches(
    path: str,
    nu: float,
    stretch: float | None,
    ramp: float | None,
    command: str,
    progress: Progress,
    *,
    wide: bool = False,
) -> Result:
    """Fit Prony branches to the test in a file: a record for each number of branches, the least AICc first.

    If the chosen one has no branches, or an E that a design cannot have, there is no design.toml.

    Parameters
    ----------
    stretch, ramp : held stretch, and the time in which it rose, s, where the file does not state them.
    command, wide : as in `laws`.
    """
    if not 0.0 <= nu <= 0.5:
        raise BadInput(f"--nu must lie between 0 and 0.5; got {nu:g}")
    test = relaxation_test.read(path, nu, stretch, ramp)
    progress(0.0, "fits of branches")
    fits, best = branch_regression.fit(thinned(test))
    chosen = fits[best]
    order = sorted(range(len(fits)), key=lambda k: fits[k].aicc)
    records = [branch_record(fits[k], test, place + 1, chosen=k == best) for place, k in enumerate(order)]
    texts = [_branch_texts(record) for record in records]
    files = {"fit.png": partial(_draw_branches, test=test, fit=chosen)}
    shown = _branch_tables(texts, chosen, test, wide=wide)
    usable = is_usable(chosen, test)
    if usable:
        files["design.toml"] = partial(write_text, text=branches_design(path, chosen, test, nu, command))
        shown += ["Lines for a design file:", *(f"  {line}" for line in design_lines(chosen, test, nu))]
    if chosen.count:
        shown.append(f"The branches speak for {range_text(chosen.relaxation)}.")
    return Result(
        title="Branches",
        records=records,
        shown=shown,
        tables={"fit": texts},
        files=files,
        warnings=next(record["warnings"] for record in records if record["chosen"]),
        failures=[] if usable else [f"{_why_unusable(chosen)}: no design.toml is written"],
    )


def branch_record(fit: BranchFit, test: Test, rank: int, *, chosen: bool) -> FlatRow:
    """Return the record of one number of branches; E is None where the file has a stress without a stretch."""
    relaxation, warned = fit.relaxation, _warnings(fit, test)
    E = {
        "E_MPa": fit.long_term,
        "E_long_term_MPa": fit.long_term,
        "E_long_term_half_width_MPa": fit.long_term_half_width,
        "E_instantaneous_MPa": fit.instantaneous,
        "E_instantaneous_half_width_MPa": fit.instantaneous_half_width,
    }
    return {
        "rank": rank,
        "test": test.kind,
        "branches": fit.count,
        "chosen": chosen,
        "AICc": fit.aicc,
        "rms_percent": 100 * fit.rms,
        **{name: value if test.has_modulus else None for name, value in E.items()},
        "long_term_share": relaxation.rest,
        "shares": list(relaxation.shares),
        "times_s": list(relaxation.times),
        "covered_s": list(relaxation.speaks_for),
        "covered_Hz": list(relaxation.speaks_for_frequencies),
        "prony": _prony(fit),
        "points": len(test.at),
        "ranked_by": "AICc",
        "warnings": warned,
        "warning": "; ".join(warned),
    }


def _prony(fit: BranchFit) -> str:
    """Return the branches as the field `prony` takes them; empty without branches."""
    return branches_text(fit.relaxation) if fit.count else ""


def _branch_texts(record: FlatRow) -> FlatRow:
    """Return a record for tables: lists as texts."""
    return {
        name: ", ".join(f"{part:.6g}" for part in value) if isinstance(value, list) else value
        for name, value in record.items()
        if name != "warnings"
    }


def _branch_tables(rows: Sequence[FlatRow], chosen: BranchFit, test: Test, *, wide: bool) -> list[Block]:
    """Return the numbers of branches, the moduli with their confidence, and the chosen branches."""
    keys = rows[0] if wide else ("branches", "chosen", "AICc", "rms_percent", "long_term_share")
    title = "Numbers of branches, least AICc first"
    tables: list[Block] = [Table(title=title, rows=[{key: row[key] for key in keys} for row in rows])]
    tables.append("Of the fits within 2 of the least AICc, the one with the fewest branches is chosen.")
    if test.has_modulus:
        moduli = (
            ("long-term", chosen.long_term, chosen.long_term_half_width),
            ("instantaneous", chosen.instantaneous, chosen.instantaneous_half_width),
        )
        cells = [[name, f"{value:.5g}", f"{width:.2g}"] for name, value, width in moduli]
        tables.append(Texts("Young's modulus", ["modulus", "E (MPa)", "95 %: +- (MPa)"], cells))
    pairs = zip(chosen.relaxation.shares, chosen.relaxation.times, strict=True)
    if cells := [[f"{g:.4g}", f"{tau:.4g}"] for g, tau in pairs]:
        tables.append(Texts("Branches", ["share g", "tau (s)"], cells))
    return tables


def _draw_branches(path: Path, test: Test, fit: BranchFit) -> None:
    smooth = replace(test, at=np.geomspace(test.at[0], test.at[-1], 400))
    curves = (branch_regression.model(each, fit) for each in (smooth, test))
    save(path, fit_figures.branches(test, smooth.at, *curves))


def is_usable(fit: BranchFit, test: Test) -> bool:
    """Return whether a design can have the branches and the E of a fit, and these describe the test."""
    if fit.rms > WRONG:
        return False
    spec = Design.__dataclass_fields__["E"].metadata
    return fit.count > 0 and (not test.has_modulus or spec["low"] <= fit.long_term <= spec["high"])


def _why_unusable(fit: BranchFit) -> str:
    if not fit.count:
        return "the test has no branches"
    if fit.rms > WRONG:
        return f"the branches miss the test by more than {100 * WRONG:g} %"
    return "E is outside the range of a design"


def design_lines(fit: BranchFit, test: Test, nu: float) -> list[str]:
    """Return the lines of a design file: E at rest, if it is known, and the branches."""
    lines = [f"E = {fit.long_term:.6g}", f"nu = {nu!r}"] if test.has_modulus else []
    return [*lines, 'modulus = "long-term"', f'prony = "{_prony(fit)}"']


def branches_design(path: str, fit: BranchFit, test: Test, nu: float, command: str) -> str:
    """Return the text of the design file of a fit; it names the command and the range of the test."""
    head = f"{MARK}{printable(Path(path).name)}: rms residual {100 * fit.rms:.3g} %"
    about = f"# the branches speak for {range_text(fit.relaxation)}"
    return "\n".join([head, f"# by {printable(command)}", about, *design_lines(fit, test, nu), ""])


def _warnings(fit: BranchFit, test: Test) -> list[str]:
    """Return warnings about a test and about the use of fitted branches."""
    return law_selection.sentences(
        "branches",
        fit=fit,
        times=fit.relaxation.times,
        test=test,
        silicone=SILICONE_E,
        misfit=MISFIT,
        still_falling=STILL_FALLING,
        at_start=AT_START,
    )
