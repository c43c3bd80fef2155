"""Fit Prony branches to a relaxation test or a dynamic test, and write a design file with E and the field `prony`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from geometry.design import SILICONE_E, BadInput, Design
from geometry.prony import branches_text
from geometry.relaxation import range_text
from studies.output import own_files
from studies.output.atomic_files import write_text
from studies.output.records import FlatRow
from studies.simulation.branch_regression import BranchFit, fit, model, thinned
from studies.simulation.law_regression import MISFIT
from studies.simulation.material_fit import FILES, MARK, printable
from studies.simulation.relaxation_test import Test, read

STILL_FALLING = 3.0
"""A branch longer than the longest time over this has not relaxed by the end of the test."""

WRONG = 0.05
"""Rms residual from which on branches do not describe the test, and are no design."""
AT_START = 1.02
"""Ratio of the shortest branch to the first time up to which it lies at the bound of the fit."""


@dataclass(frozen=True, slots=True)
class BranchRow:
    """Branches of one number fitted to a test.

    Attributes
    ----------
    rank : by AICc, from 1.
    remarks : warnings that hold for every number of branches.
    """

    fit: BranchFit
    test: Test
    rank: int
    chosen: bool
    remarks: tuple[str, ...]

    @property
    def prony(self) -> str:
        """The branches as the field `prony` takes them; empty without branches."""
        return branches_text(self.fit.relaxation) if self.fit.count else ""

    @property
    def warnings(self) -> list[str]:
        """Warnings about the use of the branches."""
        return [*self.remarks, *_warnings(self.fit, self.test)]

    def row(self) -> FlatRow:
        """Return the flat row for JSON; E is None where the file has a stress without a stretch."""
        each, test, relaxation = self.fit, self.test, self.fit.relaxation
        E = {
            "E_MPa": each.long_term,
            "E_long_term_MPa": each.long_term,
            "E_long_term_half_width_MPa": each.long_term_half_width,
            "E_instantaneous_MPa": each.instantaneous,
            "E_instantaneous_half_width_MPa": each.instantaneous_half_width,
        }
        return {
            "rank": self.rank,
            "test": test.kind,
            "branches": each.count,
            "chosen": self.chosen,
            "AICc": each.aicc,
            "rms_percent": 100 * each.rms,
            **{name: value if test.has_modulus else None for name, value in E.items()},
            "long_term_share": relaxation.rest,
            "shares": list(relaxation.shares),
            "times_s": list(relaxation.times),
            "covered_s": list(relaxation.speaks_for),
            "covered_Hz": list(relaxation.speaks_for_frequencies),
            "prony": self.prony,
            "points": len(test.at),
            "ranked_by": "AICc",
            "warnings": self.warnings,
            "warning": "; ".join(self.warnings),
        }

    def texts(self) -> FlatRow:
        """Return the row for fit.csv: lists as texts."""
        texts: FlatRow = {
            name: ", ".join(f"{part:.6g}" for part in value)
            for name, value in self.row().items()
            if isinstance(value, list) and name != "warnings"
        }
        return {name: value for name, value in {**self.row(), **texts}.items() if name != "warnings"}


def run(
    path: str,
    nu: float,
    folder: Path | None,
    stretch: float | None = None,
    ramp: float | None = None,
    command: str = "magtip fit",
) -> list[BranchRow]:
    """Fit the test in a file, and write fit.csv, fit.png and design.toml into an existing folder.

    Parameters
    ----------
    stretch, ramp : held stretch, and the time in which it rose, s, where the file does not state them.
    command : command line that design.toml names as its origin.

    Returns
    -------
    A row for each number of branches, the least AICc first. If the chosen one has no branches, or an E that a design
    cannot have, there is no design.toml.
    """
    if not 0.0 <= nu <= 0.5:
        raise BadInput(f"--nu must lie between 0 and 0.5; got {nu:g}")
    test = read(path, nu, stretch, ramp)
    if folder is not None:
        own_files.check(folder, FILES)
    fits, chosen = fit(thinned(test))
    order = sorted(range(len(fits)), key=lambda k: fits[k].aicc)
    remarks = tuple(_remarks(test))
    rows = [BranchRow(fits[k], test, place + 1, k == chosen, remarks) for place, k in enumerate(order)]
    if folder is not None:
        from studies.output.csv_tables import write_table
        from studies.simulation import relaxation_plot

        write_table(folder / "fit.csv", [row.texts() for row in rows])
        smooth = replace(test, at=np.geomspace(test.at[0], test.at[-1], 400))
        curves = model(smooth, fits[chosen]), model(test, fits[chosen])
        relaxation_plot.draw(folder / "fit.png", test, smooth.at, *curves)
        (row,) = [row for row in rows if row.chosen]
        if is_usable(row):
            write_text(folder / "design.toml", design_text(path, row, nu, command))
    return rows


def is_usable(row: BranchRow) -> bool:
    """Return whether a design can have the branches and the E of a row, and these describe the test."""
    if row.fit.rms > WRONG:
        return False
    spec = Design.__dataclass_fields__["E"].metadata
    return row.fit.count > 0 and (not row.test.has_modulus or spec["low"] <= row.fit.long_term <= spec["high"])


def design_lines(row: BranchRow, nu: float) -> list[str]:
    """Return the lines of a design file: E at rest, if it is known, and the branches."""
    lines = [f"E = {row.fit.long_term:.6g}", f"nu = {nu!r}"] if row.test.has_modulus else []
    return [*lines, 'modulus = "long-term"', f'prony = "{row.prony}"']


def design_text(path: str, row: BranchRow, nu: float, command: str) -> str:
    """Return the text of the design file of a fit; it names the command and the range of the test."""
    head = f"{MARK}{printable(Path(path).name)}: rms residual {100 * row.fit.rms:.3g} %"
    about = f"# the branches speak for {range_text(row.fit.relaxation)}"
    return "\n".join([head, f"# by {printable(command)}", about, *design_lines(row, nu), ""])


def _remarks(test: Test) -> list[str]:
    """Return warnings about a test that hold for every number of branches."""
    texts = []
    if test.kind == "relaxation" and test.ramp is None:
        texts.append(
            "no ramp time is stated: the stretch is taken to rise at once at t = 0; state --ramp, or give data from "
            "ten ramp times on"
        )
    if test.ramp and test.at[0] < test.ramp:
        texts.append(
            f"the first time, {test.at[0]:.3g} s, is shorter than the ramp of {test.ramp:.3g} s: the fit accounts "
            f"for the ramp, but speaks for times from {test.ramp:.3g} s on; data from ten ramp times on are safer"
        )
    if not test.has_modulus:
        texts.append("the file has a stress, but no held stretch: E is unknown; state --stretch")
    if test.covered[1] < 10 * test.covered[0]:
        texts.append("the test covers less than one decade of time: it says little of the relaxation")
    return texts


def _warnings(each: BranchFit, test: Test) -> list[str]:
    """Return warnings about the use of fitted branches."""
    texts = []
    if each.rms > MISFIT and each.count:
        ramp = "; a wrong --ramp does so" if test.ramp else ""
        texts.append(f"the branches miss the test by {100 * each.rms:.2g} % (rms){ramp}")
    times = each.relaxation.times
    if times and times[-1] > test.covered[1] / STILL_FALLING:
        texts.append(
            f"relaxation goes on beyond the test: a branch has {times[-1]:.3g} s where the test covers "
            f"{test.covered[1]:.3g} s, so the long-term modulus is extrapolated"
        )
    if times and test.kind == "relaxation" and times[0] < AT_START * test.at[0]:
        texts.append(
            f"a branch is as short as the first time of the test, {test.at[0]:.3g} s, and may be shorter: the "
            "instantaneous modulus is extrapolated; record from the beginning of the stretch, whose time is 0"
        )
    if not times:
        texts.append(f"the test shows no relaxation above its noise of {100 * each.rms:.2g} % (rms)")
    if test.has_modulus and not SILICONE_E[0] <= each.long_term <= SILICONE_E[1]:
        texts.append(
            f"E = {each.long_term:.3g} MPa is outside the range of silicones, {SILICONE_E[0]:g} to "
            f"{SILICONE_E[1]:g} MPa: check that the column {test.column} is in the unit of its name"
        )
    return texts
